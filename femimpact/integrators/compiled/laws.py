"""The contact laws in the time loop: their formulas stand in `contact`, and nowhere else.

A law here is (kind, stiffness, damping, exponent, approach speed, address); a rigid one has no force.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from femimpact.contact import formulas
from femimpact.integrators.compiled.compiling import called, inlined
from femimpact.integrators.compiled.custom import call_law

__all__ = [
    "CUSTOM",
    "KELVIN_VOIGT",
    "POWER",
    "RIGID",
    "SWITCHING_SPRING",
    "LawNumbers",
    "elastic_mean",
    "elastic_potential",
    "kelvin_voigt_force",
    "mean_forces",
    "normal_force",
    "penetration",
    "spring_potential",
    "switching_potential",
    "switching_stiffness",
]

KELVIN_VOIGT, SWITCHING_SPRING, POWER = formulas.KELVIN_VOIGT, formulas.SWITCHING_SPRING, formulas.POWER
CUSTOM, RIGID = formulas.CUSTOM, formulas.RIGID
penetration = inlined(formulas.penetration)
kelvin_voigt_force = inlined(formulas.kelvin_voigt_force)
spring_potential = inlined(formulas.spring_potential)
switching_stiffness = inlined(formulas.switching_stiffness)
switching_potential = inlined(formulas.switching_potential)
power_force = inlined(formulas.power_force)
power_potential = inlined(formulas.power_potential)

_LEGENDRE = np.polynomial.legendre.leggauss(8)
NODES, WEIGHTS = 0.5 * (_LEGENDRE[0] + 1.0), 0.5 * _LEGENDRE[1]
"""Gauss points and weights on 0 to 1."""
SHORT = 0.02
"""Travel over depth below which a mean of forces is taken by quadrature: differences of potentials would cancel."""


@called
def normal_force(
    kind: int, depth: float, rate: float, stiffness: float, damping: float, exponent: float, approach: float,
    address: int,
) -> float:  # fmt: skip
    """Normal force of a law (N, never pulling)."""
    if depth <= 0.0:
        return 0.0
    if kind == KELVIN_VOIGT:
        return kelvin_voigt_force(depth, rate, stiffness, damping)
    if kind == POWER:
        return power_force(depth, rate, stiffness, exponent, damping, approach)
    if kind == CUSTOM:
        force: float = call_law(address, depth, rate, approach)
        return force if force > 0.0 else 0.0
    return 0.0


@called
def elastic_potential(
    kind: int, depth: float, stiffness: float, exponent: float, approach: float, address: int
) -> float:
    """Energy (J) that a law has stored at a depth: the integral of its force at rate zero."""
    if depth <= 0.0:
        return 0.0
    if kind == KELVIN_VOIGT:
        return spring_potential(depth, stiffness)
    if kind == POWER:
        return power_potential(depth, stiffness, exponent)
    if kind == CUSTOM:
        # depth s^2 for the integration variable: half powers of the depth are integrated exactly
        total = 0.0
        for i in range(NODES.size):
            s = NODES[i]
            total += 2.0 * WEIGHTS[i] * s * normal_force(kind, depth * s * s, 0.0, 0.0, 0.0, 1.0, approach, address)
        return depth * total
    return 0.0


class LawNumbers(NamedTuple):
    """Numbers of one pair's law, and of its contact in progress."""

    kind: int
    gap_plus: float  # m
    gap_minus: float  # m
    stiffness: float  # N/m, or N/m^n
    damping: float  # N s/m; of a power law its loss factor, 1
    exponent: float
    restitution: float
    spring: float  # N/m, of the centring spring
    approach: float  # m/s, speed at which the contact opened
    address: int  # of a custom law's compiled function


@called
def mean_forces(law: LawNumbers, before: float, after: float, travel: float, dt: float) -> tuple[float, float]:
    """Elastic and whole normal force (N) of a step, as means over its displacement.

    mean = (1/travel) integral of N(p, travel/dt) dp from before to after: depths at both ends of the
    step, no less than 0; the travel is that of the pair, between contacts too. The elastic part is
    [V(after) - V(before)]/travel: its work is what the potential changes by.
    """
    kind, approach, address = law.kind, law.approach, law.address
    increment = after - before
    # in contact at both ends both are the same; their quotient would be noise where the pair rests
    inside = increment / travel if travel != 0.0 and (before == 0.0 or after == 0.0) else 1.0
    rate = travel / dt
    middle = 0.5 * (before + after)
    short = abs(increment) <= SHORT * middle
    if kind == KELVIN_VOIGT:
        elastic = law.stiffness * middle * inside
        whole = elastic + law.damping * rate * inside
    else:
        if short:
            elastic = 0.0
            for i in range(NODES.size):
                depth = before + NODES[i] * increment
                force = normal_force(kind, depth, 0.0, law.stiffness, 0.0, law.exponent, approach, address)
                elastic += WEIGHTS[i] * force
            elastic *= inside
        else:
            gained = elastic_potential(kind, after, law.stiffness, law.exponent, approach, address)
            gained -= elastic_potential(kind, before, law.stiffness, law.exponent, approach, address)
            elastic = gained / travel
        whole = elastic
        if kind == POWER:
            whole += elastic * law.damping * rate / approach if law.damping > 0.0 else 0.0
        else:
            for i in range(NODES.size):
                depth = before + NODES[i] * increment
                share = WEIGHTS[i] * inside
                whole += share * normal_force(kind, depth, rate, 0.0, 0.0, 1.0, approach, address)
                whole -= share * normal_force(kind, depth, 0.0, 0.0, 0.0, 1.0, approach, address)
    return elastic, max(whole, 0.0)


@called
def elastic_mean(law: LawNumbers, x_before: float, x: float, dt: float) -> float:
    """Mean elastic force (N) of both walls over the displacement of a step, positive at the + wall."""
    total = 0.0
    for k in range(2):
        side, gap = (1.0, law.gap_plus) if k == 0 else (-1.0, law.gap_minus)
        before, after = max(side * x_before - gap, 0.0), max(side * x - gap, 0.0)
        if before > 0.0 or after > 0.0:
            elastic, _ = mean_forces(law, before, after, side * (x - x_before), dt)
            total += side * elastic
    return total
