"""The step's scalar equation of one pair: the force F with F = law(x_free - give_u F, rate_free - give_v F)."""

from __future__ import annotations

from typing import NamedTuple

from femimpact.integrators.compiled.compiling import called, inlined
from femimpact.integrators.compiled.laws import (
    KELVIN_VOIGT,
    RIGID,
    SWITCHING_SPRING,
    LawNumbers,
    kelvin_voigt_force,
    mean_forces,
    normal_force,
    switching_stiffness,
)
from femimpact.integrators.stepping.layout import Scheme

__all__ = ["FreePair", "pair_force"]

MOST_ITERATIONS = 200
ROUNDING = 2.3e-16


class FreePair(NamedTuple):
    """One pair at a step's end as it would be without its own force, and what 1 N does to it."""

    gate: float  # +1 or -1: the side at hand, 0 between contacts; decided before the equation is solved
    x: float  # m
    rate: float  # m/s
    x_before: float
    rate_before: float
    give_u: float  # m/N
    give_v: float  # m/(s N)


@called
def _law_at(force: float, mean: bool, dt: float, law: LawNumbers, free: FreePair) -> float:
    """Signed force of the law where that force leaves the pair."""
    x = free.x - free.give_u * force
    if not mean:
        depth = free.gate * x - (law.gap_plus if free.gate > 0.0 else law.gap_minus)
        rate = free.gate * (free.rate - free.give_v * force)
        return free.gate * normal_force(
            law.kind, depth, rate, law.stiffness, law.damping, law.exponent, law.approach, law.address
        )
    total = 0.0
    # a coarse step may reach from one wall to the other: each side has its own mean over the displacement
    for k in range(2):
        side, gap = (1.0, law.gap_plus) if k == 0 else (-1.0, law.gap_minus)
        before, after = max(side * free.x_before - gap, 0.0), max(side * x - gap, 0.0)
        if before > 0.0 or after > 0.0:
            total += side * mean_forces(law, before, after, side * (x - free.x_before), dt)[1]
    return total


@called
def _solve(mean: bool, dt: float, law: LawNumbers, free: FreePair) -> float:
    """Root of force - law(force), which rises with the force: Illinois steps in a bracket, bisection now and then."""
    high = _law_at(0.0, mean, dt, law, free)
    if high == 0.0:
        return 0.0
    low, low_excess = 0.0, -high
    high_excess = high - _law_at(high, mean, dt, law, free)
    if high_excess == 0.0:
        return high
    side = 0
    for k in range(MOST_ITERATIONS):
        # the weights of Illinois keep the bracket shrinking from both ends; a bisection bounds the number of steps
        force = (low * high_excess - high * low_excess) / (high_excess - low_excess)
        if k % 4 == 3 or not min(low, high) < force < max(low, high):
            force = 0.5 * (low + high)
        excess = force - _law_at(force, mean, dt, law, free)
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
def pair_force(s: Scheme, law: LawNumbers, free: FreePair) -> tuple[float, float]:
    """Force on the structure (N), centring spring included, and its normal part, positive where its wall pushes."""
    spring, gate, x_before = law.spring, free.gate, free.x_before
    if law.kind == SWITCHING_SPRING:
        # decided by the state before the step, as printed
        spring = switching_stiffness(x_before, law.gap_plus, law.gap_minus, spring, law.stiffness)
    old = spring * (1.0 - s.spring_now) * x_before
    compliance_factor = 1.0 / (1.0 + free.give_u * s.spring_now * spring)
    x = (free.x - free.give_u * old) * compliance_factor
    pull = spring * s.spring_now * x + old
    if law.kind == SWITCHING_SPRING:
        return pull, abs(pull)
    if gate == 0.0:
        return pull, 0.0
    rate = free.rate - free.give_v * pull
    give_u = free.give_u * compliance_factor
    give_v = free.give_v * (1.0 - free.give_u * compliance_factor * s.spring_now * spring)
    if law.kind == RIGID:
        force = gate * max(gate * (rate + law.restitution * free.rate_before) / give_v, 0.0)
    elif law.kind == KELVIN_VOIGT and not s.mean:
        depth = gate * x - (law.gap_plus if gate > 0.0 else law.gap_minus)
        denominator = 1.0 + law.stiffness * give_u + law.damping * give_v
        force = gate * kelvin_voigt_force(depth, gate * rate, law.stiffness, law.damping) / denominator
    else:
        moved = FreePair(gate, x, rate, x_before, free.rate_before, give_u, give_v)
        force = _solve(s.mean, s.dt, law, moved)
    return force + spring * s.spring_now * (x - give_u * force) + old, gate * force
