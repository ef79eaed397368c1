"""Sections along the beam, element by element, and the signs of what is read from them.

Signs, stated here once. w is positive along +w, a rotation is dw/dx, and a moment is positive where it does work on a
positive dw/dx.

- Bending moment EI w'' (N m). A force +F on the tip of a cantilever gives +F (L - x).
- Shear force (EI w'')' (N), the derivative of the bending moment by x: EI w''' where the section is constant, and
  EI w''' + (EI)' w'' along a taper. It is the force along +w that the root's side of
  a cut gives to the tip's side; a static force +F on the tip gives -F everywhere.
- Surface strain -+ h/2 w'': the surface at +h/2 is the one on the side of +w, and is compressed by a positive
  curvature. Stress is E times the strain.
- Reactions are forces (along +w) and moments (along +dw/dx) of a support on the structure. Static forces make the
  reaction at a clamped root (EI w'')' (force) and -EI w'' (moment).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, column, quantity, require, text

__all__ = ["Section", "SectionFields"]

Array = NDArray[np.float64]


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
    """The section of every element: that in its middle, and how it tapers.

    Over an element, with s from 0 at its end towards the root to 1, the width is its value in the middle times
    a = 1 + width_taper (s - 1/2), and the thickness times b = 1 + thickness_taper (s - 1/2). Then E I and rho I in the
    middle are multiplied by a b^3, rho A by a b, and the half height by b.

    Parameters
    ----------
    bending_stiffness : ndarray (elements,), N m^2
        E I in the middle of each element, as all that follow.
    mass_per_length : ndarray (elements,), kg/m
        rho A.
    rotary_inertia : ndarray (elements,), kg m
        rho I, which the beam's own mass matrix leaves out.
    young_modulus : ndarray (elements,), Pa
    half_height : ndarray (elements,), m
        From the neutral axis to the surface.
    region : ndarray (elements,) of str
        Name of the segment.
    width_taper, thickness_taper : ndarray (elements,), 1
        Difference of width and of thickness between the two ends of each element, over the value in its middle. None
        is 0 everywhere, a section that is constant in every element.

    Raises
    ------
    InputError
        If the arrays are not equally long, a value is not positive, or a taper ends in nothing.
    """

    bending_stiffness: Array = field(metadata=column("N m^2", "elements", finite=True))
    mass_per_length: Array = field(metadata=column("kg/m", "elements", finite=True))
    rotary_inertia: Array = field(metadata=column("kg m", "elements", finite=True))
    young_modulus: Array = field(metadata=column("Pa", "elements", finite=True))
    half_height: Array = field(metadata=column("m", "elements", finite=True))
    region: NDArray[np.str_] = field(metadata=column("", "elements", of="text"))
    width_taper: Any = field(default=None, metadata=column("1", "elements", finite=True))
    thickness_taper: Any = field(default=None, metadata=column("1", "elements", finite=True))

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("bending_stiffness", "mass_per_length", "rotary_inertia", "young_modulus", "half_height"):
            values = getattr(self, name)
            require(bool((values > 0.0).all()), name, None, "", "must hold numbers > 0")
        for name in ("width_taper", "thickness_taper"):
            if getattr(self, name) is None:
                none = np.zeros(self.region.size)
                none.setflags(write=False)
                object.__setattr__(self, name, none)
            within = bool((np.abs(getattr(self, name)) < 2.0).all())
            require(within, name, None, "1", "must hold numbers > -2 and < 2, so that both ends have a section")

    @property
    def is_tapered(self) -> NDArray[np.bool_]:
        """Which elements taper, (elements,)."""
        return np.asarray((self.width_taper != 0.0) | (self.thickness_taper != 0.0))

    @property
    def bending_polynomial(self) -> Array:
        """E I over that in the middle, as a polynomial in x = 2 s - 1: its coefficients by powers, (5, elements)."""
        a, b = 0.5 * self.width_taper, 0.5 * self.thickness_taper
        return np.stack([np.ones(a.size), a + 3.0 * b, 3.0 * b * (a + b), b * b * (3.0 * a + b), a * b**3])

    @property
    def mass_polynomial(self) -> Array:
        """The same of rho A, (3, elements)."""
        a, b = 0.5 * self.width_taper, 0.5 * self.thickness_taper
        return np.stack([np.ones(a.size), a + b, a * b])

    def bending_stiffness_at(self, element: int | NDArray[np.intp], s: float | Array, derivative: int = 0) -> Array:
        """E I (N m^2) at places s from 0 to 1 of elements, or its first derivative by s."""
        w, t, a, b = self._taper(element, s)
        shape = (a * b**3, w * b**3 + 3.0 * t * a * b**2)[derivative]
        return np.asarray(self.bending_stiffness[element] * shape)

    def mass_per_length_at(self, element: int | NDArray[np.intp], s: float | Array) -> Array:
        """Rho A (kg/m) at places s from 0 to 1 of elements."""
        _, _, a, b = self._taper(element, s)
        return np.asarray(self.mass_per_length[element] * (a * b))

    def rotary_inertia_at(self, element: int | NDArray[np.intp], s: float | Array) -> Array:
        """Rho I (kg m) at places s from 0 to 1 of elements."""
        _, _, a, b = self._taper(element, s)
        return np.asarray(self.rotary_inertia[element] * (a * b**3))

    def half_height_at(self, element: int | NDArray[np.intp], s: float | Array) -> Array:
        """Half height (m) at places s from 0 to 1 of elements."""
        return np.asarray(self.half_height[element] * self._taper(element, s)[3])

    def _taper(self, element: int | NDArray[np.intp], s: float | Array) -> tuple[float | Array, ...]:
        """Tapers of elements, and the factors a and b of width and thickness."""
        w, t = self.width_taper[element], self.thickness_taper[element]
        return w, t, 1.0 + w * (s - 0.5), 1.0 + t * (s - 0.5)

    def section(self, element: int, s: float = 0.5) -> Section:
        """The section at a place of one element: s from 0, at its end towards the root, to 1."""
        return Section(
            float(self.bending_stiffness_at(element, s)),
            float(self.half_height_at(element, s)),
            float(self.young_modulus[element]),
            str(self.region[element]),
        )
