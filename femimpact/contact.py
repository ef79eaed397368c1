"""Contact laws of one scalar pair: when a ball touches, which wall, and with what force.

The formulas are plain functions of numbers. The compiled time loop, the energy ledger and the
figures all call these same functions; nobody else writes a contact force down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

from femimpact.errors import Fault, InputError, check_fields, quantity, require

__all__ = [
    "ContactLaw",
    "ContactParameters",
    "KelvinVoigt",
    "SwitchingSpring",
    "contact_time_of",
    "damping_ratio_for_restitution",
    "kelvin_voigt_force",
    "penetration",
    "resolve",
    "restitution_of_damping_ratio",
    "spring_potential",
    "switching_potential",
    "switching_stiffness",
]

KELVIN_VOIGT, SWITCHING_SPRING = 0, 1


# ---- formulas: numbers in, numbers out (compiled by integrators.kernels) -------------------------


def penetration(x: float, gap_plus: float, gap_minus: float) -> tuple[float, float]:
    """Penetration (m) and side (+1, -1, or 0 in flight) of a ball at x = y_ball - w_structure."""
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


# ---- restitution of the linear law without pull --------------------------------------------------


def _angle(damping_ratio: float) -> float:
    """acos(z)/sqrt(1 - z^2), continued beyond z = 1 as acosh(z)/sqrt(z^2 - 1)."""
    z = damping_ratio
    if abs(z - 1.0) < 1e-6:
        return 1.0 - (z - 1.0) / 3.0
    if z < 1.0:
        return math.acos(z) / math.sqrt(1.0 - z * z)
    return math.acosh(z) / math.sqrt(z * z - 1.0)


def restitution_of_damping_ratio(damping_ratio: float) -> float:
    """Restitution of a Kelvin-Voigt contact that ends at zero force.

    e = exp(-2 z acos(z)/sqrt(1 - z^2)), z = c/(2 sqrt(k m_eff)); for z > 1 with acosh.

    Parameters
    ----------
    damping_ratio : float, 1
        z of the contact, >= 0.

    Returns
    -------
    float, 1
        Rebound speed over approach speed, from 1 (z = 0) towards 0.

    Notes
    -----
    From m x'' + c x' + k x = 0, x(0) = 0, left at the first zero of k x + c x'
    (derived here; the same condition as Schwager and Poeschel, 2007).
    """
    return math.exp(-2.0 * damping_ratio * _angle(damping_ratio))


def damping_ratio_for_restitution(restitution: float) -> float:
    """Contact damping ratio z whose restitution (contact ending at zero force) is the one given."""
    if restitution >= 1.0:
        return 0.0
    from scipy.optimize import brentq

    # e(z) lies below exp(-2 z) up to z = 1 and near 1/(4 z^2) far beyond: this brackets both.
    upper = 1.0 + 1.0 / math.sqrt(restitution)
    target = math.log(restitution)
    return float(brentq(lambda z: -2.0 * z * _angle(z) - target, 0.0, upper, xtol=1e-16, rtol=1e-15))


def contact_time_of(stiffness: float, damping: float, effective_mass: float) -> float:
    """Contact time (s) of the linear law, from touch to zero force: 2 acos(z)/(w0 sqrt(1 - z^2))."""
    omega = math.sqrt(stiffness / effective_mass)
    return 2.0 * _angle(damping / (2.0 * math.sqrt(stiffness * effective_mass))) / omega


# ---- the laws -------------------------------------------------------------------------------------


class ContactParameters(NamedTuple):
    """Numbers that the time loop needs of a law, once the effective mass is known."""

    kind: int
    stiffness: float  # N/m
    damping: float  # N s/m
    contact_time: float  # s, from touch to zero force
    restitution: float  # 1, of one collision in continuous time


@dataclass(frozen=True)
class KelvinVoigt:
    """Spring and dashpot in parallel at each wall, without pull: N = max(0, k p + c p').

    Give exactly one of the pairs (stiffness, damping), (stiffness, restitution),
    (restitution, contact_time).

    Parameters
    ----------
    stiffness : float, N/m
    damping : float, N s/m
    restitution : float, 1
        Rebound over approach speed of the ball against the effective mass of the pair.
    contact_time : float, s
        From touch to zero force.

    Raises
    ------
    InputError
        If a value is out of range or the pair given is not one of the three.
    """

    stiffness: float | None = field(default=None, metadata=quantity("N/m", above=0.0))
    damping: float | None = field(default=None, metadata=quantity("N s/m", at_least=0.0))
    restitution: float | None = field(default=None, metadata=quantity("1", above=0.0, at_most=1.0))
    contact_time: float | None = field(default=None, metadata=quantity("s", above=0.0))
    name: ClassVar[str] = "kelvin-voigt"

    def __post_init__(self) -> None:
        check_fields(self)
        names = ("stiffness", "damping", "restitution", "contact_time")
        given = {name for name in names if getattr(self, name) is not None}
        pairs = ({"stiffness", "damping"}, {"stiffness", "restitution"}, {"restitution", "contact_time"})
        if given not in pairs:
            allowed = (
                "give exactly one pair: stiffness (N/m) and damping (N s/m), stiffness and "
                "restitution (0 < e <= 1), or restitution and contact_time (s)"
            )
            raise InputError([Fault("contact", " and ".join(sorted(given)) or "nothing", "", allowed)])


@dataclass(frozen=True)
class SwitchingSpring:
    """The paper's law: k_I0 x inside the gap, k_I x outside, switched by the state before the step.

    The force jumps at the wall, and deciding one step late feeds energy in; the energy ledger
    of a run shows how much. Kept to reproduce the paper (eq. 25 to 30), not to be trusted.

    Parameters
    ----------
    free_stiffness : float, N/m
        k_I0, acts on the full relative displacement while the ball is inside its gap.
    stiffness : float, N/m
        k_I, acts on the full relative displacement outside.
    """

    free_stiffness: float = field(metadata=quantity("N/m", at_least=0.0))
    stiffness: float = field(metadata=quantity("N/m", above=0.0))
    name: ClassVar[str] = "switching-spring"

    def __post_init__(self) -> None:
        check_fields(self)


ContactLaw = KelvinVoigt | SwitchingSpring


def _spring_and_dashpot(law: KelvinVoigt, effective_mass: float) -> tuple[float, float]:
    """Stiffness (N/m) and damping (N s/m) of any of the three complete pairs of a Kelvin-Voigt law."""
    if law.restitution is None:
        return law.stiffness or 0.0, law.damping or 0.0
    ratio = damping_ratio_for_restitution(law.restitution)
    stiffness = law.stiffness or 0.0
    if law.contact_time is not None:
        stiffness = effective_mass * (2.0 * _angle(ratio) / law.contact_time) ** 2
    return stiffness, 2.0 * ratio * math.sqrt(stiffness * effective_mass)


def resolve(law: ContactLaw, effective_mass: float) -> ContactParameters:
    """Numbers of a law for the effective mass of its pair.

    Parameters
    ----------
    law : KelvinVoigt or SwitchingSpring
    effective_mass : float, kg
        1/(1/m + phi1^2) of the pair.

    Returns
    -------
    ContactParameters
        Stiffness (N/m), damping (N s/m), contact time (s) and restitution (1).
    """
    require(effective_mass > 0.0, "effective_mass", effective_mass, "kg", "must be > 0")
    if isinstance(law, SwitchingSpring):
        half_period = math.pi * math.sqrt(effective_mass / law.stiffness)
        return ContactParameters(SWITCHING_SPRING, law.stiffness, 0.0, half_period, 1.0)
    stiffness, damping = _spring_and_dashpot(law, effective_mass)
    ratio = damping / (2.0 * math.sqrt(stiffness * effective_mass))
    return ContactParameters(
        KELVIN_VOIGT,
        stiffness,
        damping,
        contact_time_of(stiffness, damping, effective_mass),
        restitution_of_damping_ratio(ratio),
    )
