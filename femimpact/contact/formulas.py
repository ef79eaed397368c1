"""Contact formulas: numbers in, numbers out.

The compiled time loop, the energy ledger and the figures all call these same functions; a contact
force is written down nowhere else.
"""

from __future__ import annotations

import math

__all__ = [
    "CUSTOM",
    "KELVIN_VOIGT",
    "POWER",
    "RIGID",
    "SWITCHING_SPRING",
    "kelvin_voigt_force",
    "penetration",
    "power_force",
    "power_potential",
    "spring_potential",
    "switching_potential",
    "switching_stiffness",
]

KELVIN_VOIGT, SWITCHING_SPRING, POWER, CUSTOM, RIGID = range(5)


def penetration(x: float, gap_plus: float, gap_minus: float) -> tuple[float, float]:
    """Penetration (m) and side (+1, -1, or 0 between contacts) of a ball at x = y_ball - w_structure."""
    if x > gap_plus:
        return x - gap_plus, 1.0
    if x < -gap_minus:
        return -(x + gap_minus), -1.0
    return 0.0, 0.0


def kelvin_voigt_force(depth: float, rate: float, stiffness: float, damping: float) -> float:
    """Normal force max(0, k p + c p') in N while the pair touches: the wall never pulls."""
    force = stiffness * depth + damping * rate
    return force if force > 0.0 else 0.0


def spring_potential(depth: float, stiffness: float) -> float:
    """Energy k p^2 / 2 (J) stored by a linear spring."""
    return 0.5 * stiffness * depth * depth


def switching_stiffness(
    x_before: float, gap_plus: float, gap_minus: float, free_stiffness: float, stiffness: float
) -> float:
    """Spring stiffness (N/m) of the paper's law: decided by the state before the step."""
    return stiffness if x_before > gap_plus or x_before < -gap_minus else free_stiffness


def switching_potential(x: float, gap_plus: float, gap_minus: float, free_stiffness: float, stiffness: float) -> float:
    """Work (J) that the force k(x) x does from the centre to x: the law's own potential."""
    wall = gap_plus if x > 0.0 else gap_minus
    if abs(x) <= wall:
        return 0.5 * free_stiffness * x * x
    return 0.5 * free_stiffness * wall * wall + 0.5 * stiffness * (x * x - wall * wall)


def power_force(
    depth: float, rate: float, stiffness: float, exponent: float, loss: float, approach_speed: float
) -> float:
    """Normal force k p^n max(0, 1 + d p'/v0) in N of Hertz and of the laws that add damping to it."""
    if depth <= 0.0:
        return 0.0
    elastic = stiffness * (depth * math.sqrt(depth) if exponent == 1.5 else depth**exponent)
    if loss == 0.0:
        return elastic
    factor = 1.0 + loss * rate / approach_speed
    return elastic * factor if factor > 0.0 else 0.0


def power_potential(depth: float, stiffness: float, exponent: float) -> float:
    """Energy k p^(n + 1)/(n + 1) (J) stored by the elastic part."""
    if depth <= 0.0:
        return 0.0
    if exponent == 1.5:
        return 0.4 * stiffness * depth * depth * math.sqrt(depth)
    return float(stiffness * depth ** (exponent + 1.0) / (exponent + 1.0))
