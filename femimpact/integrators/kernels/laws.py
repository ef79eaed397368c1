"""The contact laws' formulas, compiled: they stand in `contact`, and nowhere else."""

from __future__ import annotations

from femimpact import contact
from femimpact.integrators.kernels.compiling import inlined

__all__ = [
    "SWITCHING_SPRING",
    "kelvin_voigt_force",
    "penetration",
    "spring_potential",
    "switching_potential",
    "switching_stiffness",
]

SWITCHING_SPRING = contact.SWITCHING_SPRING
penetration = inlined(contact.penetration)
kelvin_voigt_force = inlined(contact.kelvin_voigt_force)
spring_potential = inlined(contact.spring_potential)
switching_stiffness = inlined(contact.switching_stiffness)
switching_potential = inlined(contact.switching_potential)
