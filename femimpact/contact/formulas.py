"""Contact formulas: numbers in, numbers out.

They stand in the compiled core (`core/contact/formulas.hpp`), and nowhere else: the loops over time, the energy ledger
and the figures all call the same ones.
"""

from __future__ import annotations

from femimpact import core

__all__ = [
    "CUSTOM",
    "KELVIN_VOIGT",
    "POWER",
    "RIGID",
    "SWITCHING_SPRING",
    "kelvin_voigt_force",
    "power_force",
    "power_potential",
    "spring_potential",
    "switching_potential",
]

KELVIN_VOIGT, SWITCHING_SPRING, POWER, CUSTOM, RIGID = range(5)


def kelvin_voigt_force(depth: float, rate: float, stiffness: float, damping: float) -> float:
    """Normal force max(0, k p + c p') in N while the pair touches: the wall never pulls."""
    return core.kelvin_voigt_force(depth, rate, stiffness, damping)


def spring_potential(depth: float, stiffness: float) -> float:
    """Energy k p^2 / 2 (J) stored by a linear spring."""
    return core.spring_potential(depth, stiffness)


def switching_potential(x: float, gap_plus: float, gap_minus: float, free_stiffness: float, stiffness: float) -> float:
    """Work (J) that the force k(x) x does from the centre to x: the law's own potential."""
    return core.switching_potential(x, gap_plus, gap_minus, free_stiffness, stiffness)


def power_force(
    depth: float, rate: float, stiffness: float, exponent: float, loss: float, approach_speed: float
) -> float:
    """Normal force k p^n max(0, 1 + d p'/v0) in N of Hertz and of the laws that add damping to it."""
    return core.power_force(depth, rate, stiffness, exponent, loss, approach_speed)


def power_potential(depth: float, stiffness: float, exponent: float) -> float:
    """Energy k p^(n + 1)/(n + 1) (J) stored by the elastic part."""
    return core.power_potential(depth, stiffness, exponent)
