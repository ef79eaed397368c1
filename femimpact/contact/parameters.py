"""The numbers of a law once the effective mass of its pair is known."""

from __future__ import annotations

import math
from typing import NamedTuple

from femimpact.contact.collision import collide, power_contact_time
from femimpact.contact.formulas import CUSTOM, KELVIN_VOIGT, POWER, RIGID, SWITCHING_SPRING
from femimpact.contact.laws import (
    ContactLaw,
    CustomLaw,
    PowerLaw,
    Rigid,
    SwitchingSpring,
    loss_factor,
    require_law,
    spring_and_dashpot,
)
from femimpact.contact.restitution import contact_time_of, restitution_of_damping_ratio, restitution_of_loss_factor
from femimpact.errors import checked, quantity

__all__ = ["ContactParameters", "resolve"]


class ContactParameters(NamedTuple):
    """Numbers that the time loop needs of a law."""

    kind: int
    stiffness: float  # N/m, or N/m^n
    damping: float  # N s/m; of a power law its loss factor d, 1
    contact_time: float  # s, from touch to zero force
    restitution: float  # 1, of one collision in continuous time
    exponent: float = 1.0


def resolve(law: ContactLaw, effective_mass: float) -> ContactParameters:
    """Numbers of a law for the effective mass of its pair.

    Parameters
    ----------
    law : ContactLaw
    effective_mass : float, kg
        1/(1/m + phi1^2) of the pair.

    Returns
    -------
    ContactParameters
        Contact time (s) and restitution (1) are those at the law's reference speed where they
        depend on speed.
    """
    require_law(law)
    effective_mass = checked("effective_mass", effective_mass, quantity("kg", above=0.0))
    if isinstance(law, Rigid):
        return ContactParameters(RIGID, math.inf, 0.0, 0.0, law.restitution)
    if isinstance(law, SwitchingSpring):
        half_period = math.pi * math.sqrt(effective_mass / law.stiffness)
        return ContactParameters(SWITCHING_SPRING, law.stiffness, 0.0, half_period, 1.0)
    if isinstance(law, PowerLaw):
        d = loss_factor(law)
        time = power_contact_time(law.stiffness, law.exponent, d, effective_mass, law.reference_speed)
        return ContactParameters(POWER, law.stiffness, d, time, restitution_of_loss_factor(d), law.exponent)
    if isinstance(law, CustomLaw):
        typical = collide(law, effective_mass, law.reference_speed)
        return ContactParameters(CUSTOM, math.nan, 0.0, typical.contact_time, typical.restitution)
    stiffness, damping = spring_and_dashpot(law, effective_mass)
    ratio = damping / (2.0 * math.sqrt(stiffness * effective_mass))
    return ContactParameters(
        KELVIN_VOIGT,
        stiffness,
        damping,
        contact_time_of(stiffness, damping, effective_mass),
        restitution_of_damping_ratio(ratio),
    )
