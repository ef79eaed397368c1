"""The linear contact: a spring and a dashpot that do not pull."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from femimpact.contact.collision import Collision, collision_of, crest
from femimpact.contact.formulas import KELVIN_VOIGT, kelvin_voigt_force, spring_potential
from femimpact.contact.parameters import ContactParameters
from femimpact.contact.restitution import (
    EFFECTIVE_MASS,
    contact_time_of,
    damping_ratio_for_restitution,
    linear_angle,
    restitution_of_damping_ratio,
)
from femimpact.errors import Fault, InputError, check_fields, checked, in_range, quantity, require, require_type

__all__ = ["KelvinVoigt", "spring_and_dashpot"]


@dataclass(frozen=True)
class KelvinVoigt:
    """Spring and dashpot in parallel at each wall, without pull: N = max(0, k p + c p').

    Give exactly one of the pairs (stiffness, damping), (stiffness, restitution),
    (restitution, contact_time).

    Parameters
    ----------
    stiffness : float, N/m
        Of the spring.
    damping : float, N s/m
        Of the dashpot.
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
    may_be_preloaded: ClassVar[bool] = True

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

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N) of spring and dashpot, never below zero."""
        return kelvin_voigt_force(depth, rate, *spring_and_dashpot(self, effective_mass)) if depth > 0.0 else 0.0

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored by the spring."""
        return spring_potential(max(depth, 0.0), spring_and_dashpot(self, effective_mass)[0])

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision: the closed form of m p'' + c p' + k p = 0 up to the first zero of the force."""
        stiffness, damping = spring_and_dashpot(self, effective_mass)
        mass, speed = effective_mass, approach_speed
        z = damping / (2.0 * math.sqrt(stiffness * mass))
        time = contact_time_of(stiffness, damping, mass)
        omega = math.sqrt(stiffness / mass)
        # sampled finely, then by a parabola: peak force and penetration have no short closed form for all z
        t = np.linspace(0.0, time, 2001)
        root = np.sqrt(complex(z * z - 1.0)) if z != 1.0 else complex(1e-9)
        p = speed / omega * np.real(np.exp(-z * omega * t) * np.sinh(root * omega * t) / root)
        rate = speed * np.real(
            np.exp(-z * omega * t) * (np.cosh(root * omega * t) - z / root * np.sinh(root * omega * t))
        )
        force = np.maximum(stiffness * p + damping * rate, 0.0)
        return collision_of(restitution_of_damping_ratio(z), time, crest(force), crest(p), mass, speed)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop."""
        stiffness, damping = spring_and_dashpot(self, effective_mass)
        ratio = damping / (2.0 * math.sqrt(stiffness * effective_mass))
        return ContactParameters(
            KELVIN_VOIGT,
            stiffness,
            damping,
            contact_time_of(stiffness, damping, effective_mass),
            restitution_of_damping_ratio(ratio),
        )

    def force_function(self, effective_mass: float) -> None:
        """None: the time loop has a branch for Kelvin-Voigt contacts."""

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Stiffness and damping."""
        stiffness, damping = spring_and_dashpot(self, effective_mass)
        return ("stiffness", stiffness, "N/m"), ("damping", damping, "N s/m")

    def with_restitution(self, restitution: float) -> KelvinVoigt | None:
        """The same stiffness or contact time with another restitution (1); None where the damping was given."""
        return None if self.restitution is None else replace(self, restitution=restitution)


def spring_and_dashpot(law: KelvinVoigt, effective_mass: float) -> tuple[float, float]:
    """Stiffness (N/m) and damping (N s/m) of any of the three complete pairs of a Kelvin-Voigt law.

    Raises
    ------
    InputError
        If the law is of another kind, or the mass is not > 0.
    """
    require_type(law, KelvinVoigt, "law")
    effective_mass = checked("effective_mass", effective_mass, EFFECTIVE_MASS)
    ratio = None if law.restitution is None else damping_ratio_for_restitution(law.restitution)
    stiffness = law.stiffness or 0.0
    if ratio is not None and law.contact_time is not None:
        rate = 2.0 * linear_angle(ratio) / law.contact_time
        stiffness = effective_mass * rate * rate
    key, unit = ("stiffness", "N/m") if law.contact_time is None else ("contact_time", "s")
    allowed = "must give a contact that is neither loose nor rigid to rounding with an effective_mass of "
    within = in_range(stiffness, quantity("N/m", above=0.0))
    require(within, key, getattr(law, key), unit, f"{allowed}{effective_mass:g} kg")
    damping = law.damping or 0.0
    return stiffness, damping if ratio is None else 2.0 * ratio * math.sqrt(stiffness * effective_mass)
