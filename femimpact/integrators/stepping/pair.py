"""The step's scalar equation of one pair: the force F with F = law(x_free - give_u F, rate_free - give_v F)."""

from __future__ import annotations

from femimpact.integrators.compiled.compiling import called, inlined
from femimpact.integrators.compiled.laws import (
    KELVIN_VOIGT,
    RIGID,
    SWITCHING_SPRING,
    kelvin_voigt_force,
    mean_forces,
    normal_force,
    switching_stiffness,
)
from femimpact.integrators.stepping.layout import Scheme

__all__ = ["pair_force"]

MOST_ITERATIONS = 200
ROUNDING = 2.3e-16


@called
def _law_at(
    force: float, mean: bool, kind: int, gate: float, x_free: float, rate_free: float, x_before: float,
    give_u: float, give_v: float, dt: float, gap_plus: float, gap_minus: float, stiffness: float, damping: float,
    exponent: float, approach: float, address: int,
) -> float:  # fmt: skip
    """Signed force of the law where that force leaves the pair."""
    x = x_free - give_u * force
    if not mean:
        depth = gate * x - (gap_plus if gate > 0.0 else gap_minus)
        rate = gate * (rate_free - give_v * force)
        return gate * normal_force(kind, depth, rate, stiffness, damping, exponent, approach, address)
    total = 0.0
    # a coarse step may reach from one wall to the other: each side has its own mean over the displacement
    for k in range(2):
        side, gap = (1.0, gap_plus) if k == 0 else (-1.0, gap_minus)
        before, after = max(side * x_before - gap, 0.0), max(side * x - gap, 0.0)
        if before > 0.0 or after > 0.0:
            increment = side * (x - x_before)
            total += side * mean_forces(
                kind, before, after, increment, dt, stiffness, damping, exponent, approach, address
            )[1]  # fmt: skip
    return total


@called
def _solve(
    mean: bool, kind: int, gate: float, x_free: float, rate_free: float, x_before: float,
    give_u: float, give_v: float, dt: float, gap_plus: float, gap_minus: float, stiffness: float, damping: float,
    exponent: float, approach: float, address: int,
) -> float:  # fmt: skip
    """Root of force - law(force), which rises with the force: Illinois steps in a bracket, bisection now and then."""
    high = _law_at(
        0.0, mean, kind, gate, x_free, rate_free, x_before, give_u, give_v, dt, gap_plus, gap_minus, stiffness, damping,
        exponent, approach, address,
    )  # fmt: skip
    if high == 0.0:
        return 0.0
    low, low_excess = 0.0, -high
    high_excess = high - _law_at(
        high, mean, kind, gate, x_free, rate_free, x_before, give_u, give_v, dt, gap_plus, gap_minus, stiffness,
        damping, exponent, approach, address,
    )  # fmt: skip
    if high_excess == 0.0:
        return high
    side = 0
    for k in range(MOST_ITERATIONS):
        # the weights of Illinois keep the bracket shrinking from both ends; a bisection bounds the number of steps
        force = (low * high_excess - high * low_excess) / (high_excess - low_excess)
        if k % 4 == 3 or not min(low, high) < force < max(low, high):
            force = 0.5 * (low + high)
        excess = force - _law_at(
            force, mean, kind, gate, x_free, rate_free, x_before, give_u, give_v, dt, gap_plus, gap_minus, stiffness,
            damping, exponent, approach, address,
        )  # fmt: skip
        if abs(excess) <= ROUNDING * abs(force) or abs(high - low) <= 2.0 * ROUNDING * abs(force):
            break
        if (excess > 0.0) == (high_excess > 0.0):
            high, high_excess = force, excess
            low_excess *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            low, low_excess = force, excess
            high_excess *= 0.5 if side == -1 else 1.0
            side = -1
    return force


@inlined
def pair_force(
    s: Scheme, kind: int, gate: float, x_free: float, rate_free: float, x_before: float, rate_before: float,
    give_u: float, give_v: float, gap_plus: float, gap_minus: float, stiffness: float, damping: float, exponent: float,
    restitution: float, spring: float, approach: float, address: int,
) -> tuple[float, float]:  # fmt: skip
    """Force on the structure (N), centring spring included, and its normal part, positive where its wall pushes.

    `gate` is the side at hand, decided before the equation is solved, never inside an iteration.
    """
    if kind == SWITCHING_SPRING:
        # decided by the state before the step, as printed
        spring = switching_stiffness(x_before, gap_plus, gap_minus, spring, stiffness)
    old = spring * (1.0 - s.spring_now) * x_before
    compliance_factor = 1.0 / (1.0 + give_u * s.spring_now * spring)
    x = (x_free - give_u * old) * compliance_factor
    pull = spring * s.spring_now * x + old
    if kind == SWITCHING_SPRING:
        return pull, abs(pull)
    if gate == 0.0:
        return pull, 0.0
    rate = rate_free - give_v * pull
    give_u, give_v = give_u * compliance_factor, give_v * (1.0 - give_u * compliance_factor * s.spring_now * spring)
    if kind == RIGID:
        force = gate * max(gate * (rate + restitution * rate_before) / give_v, 0.0)
    elif kind == KELVIN_VOIGT and not s.mean:
        depth = gate * x - (gap_plus if gate > 0.0 else gap_minus)
        denominator = 1.0 + stiffness * give_u + damping * give_v
        force = gate * kelvin_voigt_force(depth, gate * rate, stiffness, damping) / denominator
    else:
        force = _solve(
            s.mean, kind, gate, x, rate, x_before, give_u, give_v, s.dt, gap_plus, gap_minus, stiffness, damping,
            exponent, approach, address,
        )  # fmt: skip
    return force + spring * s.spring_now * (x - give_u * force) + old, gate * force
