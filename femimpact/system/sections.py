"""Sections along the beam, element by element, and the signs of what is read from them.

Signs, stated here once. w is positive along +w, a rotation is dw/dx, and a moment is positive where it does work on a
positive dw/dx.

- Bending moment EI w'' (N m). A force +F on the tip of a cantilever gives +F (L - x).
- Shear force EI w''' (N), the derivative of the bending moment by x. It is the force along +w that the root's side of
  a cut gives to the tip's side; a static force +F on the tip gives -F everywhere.
- Surface strain -+ h/2 w'': the surface at +h/2 is the one on the side of +w, and is compressed by a positive
  curvature. Stress is E times the strain.
- Reactions are forces (along +w) and moments (along +dw/dx) of a support on the structure. Static forces make the
  reaction at a clamped root EI w''' (force) and -EI w'' (moment).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from femimpact.errors import check_fields, column, quantity, require, text

__all__ = ["Section", "SectionFields"]


@dataclass(frozen=True)
class Section:
    """The section at one position of a beam.

    Parameters
    ----------
    bending_stiffness : float, N m^2
        E I: a bending moment is this times the curvature w''.
    half_height : float, m
        From the neutral axis to the surface: a surface strain is -+ this times the curvature.
    young_modulus : float, Pa
        A stress is this times the strain.
    region : str
        Name of the segment.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    bending_stiffness: float = field(metadata=quantity("N m^2", above=0.0))
    half_height: float = field(metadata=quantity("m", above=0.0))
    young_modulus: float = field(metadata=quantity("Pa", above=0.0))
    region: str = field(metadata=text())

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, eq=False)
class SectionFields:
    """Constants of the section in every element.

    Parameters
    ----------
    bending_stiffness : ndarray (elements,), N m^2
        E I.
    mass_per_length : ndarray (elements,), kg/m
        rho A.
    rotary_inertia : ndarray (elements,), kg m
        rho I, which the beam's own mass matrix leaves out.
    young_modulus : ndarray (elements,), Pa
    half_height : ndarray (elements,), m
        From the neutral axis to the surface.
    region : ndarray (elements,) of str
        Name of the segment.

    Raises
    ------
    InputError
        If the arrays are not equally long, or a value is not positive.
    """

    bending_stiffness: NDArray[Any] = field(metadata=column("N m^2", "elements", finite=True))
    mass_per_length: NDArray[Any] = field(metadata=column("kg/m", "elements", finite=True))
    rotary_inertia: NDArray[Any] = field(metadata=column("kg m", "elements", finite=True))
    young_modulus: NDArray[Any] = field(metadata=column("Pa", "elements", finite=True))
    half_height: NDArray[Any] = field(metadata=column("m", "elements", finite=True))
    region: NDArray[Any] = field(metadata=column("", "elements", of="text"))

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("bending_stiffness", "mass_per_length", "rotary_inertia", "young_modulus", "half_height"):
            values = getattr(self, name)
            require(bool((values > 0.0).all()), name, None, "", "must hold numbers > 0")

    def section(self, element: int) -> Section:
        """The section in one element."""
        return Section(
            float(self.bending_stiffness[element]),
            float(self.half_height[element]),
            float(self.young_modulus[element]),
            str(self.region[element]),
        )
