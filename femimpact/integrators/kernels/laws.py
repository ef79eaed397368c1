"""The contact laws' formulas, compiled: they stand in `contact`, and nowhere else."""

from __future__ import annotations

from femimpact.contact import formulas
from femimpact.integrators.kernels.compiling import inlined

__all__ = [
    "SWITCHING_SPRING",
    "kelvin_voigt_force",
    "penetration",
    "spring_potential",
    "switching_potential",
    "switching_stiffness",
]

SWITCHING_SPRING = formulas.SWITCHING_SPRING
penetration = inlined(formulas.penetration)
kelvin_voigt_force = inlined(formulas.kelvin_voigt_force)
spring_potential = inlined(formulas.spring_potential)
switching_stiffness = inlined(formulas.switching_stiffness)
switching_potential = inlined(formulas.switching_potential)
