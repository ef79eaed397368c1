"""Deflections along the beam: cubic Hermite functions, sections, and the reactions of supports."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array, own
from femimpact.errors import (
    Fault,
    InputError,
    choice,
    quantity,
)
from femimpact.system.matrices import Matrix

OFF_BEAM = 1e-6
"""Share of the length by which a position in single precision may lie off the beam."""


AT_NODE = 1e-9
"""Share of the length within which a position is at a node."""

SIDE = choice("left", "right")
"""Element that is read at a node: the one towards the root, or towards the tip."""

DERIVATIVE = quantity("1", at_least=0, at_most=3, integer=True)
"""Orders of derivative that a cubic has."""


def shape_functions(
    s: Array,  # shape (...) position inside the element, 0 at its first node and 1 at its second
    derivative: int,
    ratio: Array | float | None = None,  # sqrt(EI/(kGA)) over the element length h; None: the element does not shear
) -> tuple[Array, ...]:
    """Four functions (...) of (w1, h w1', w2, h w2') for the deflection or its first, second or third derivative by s.

    w(s) = H1 w1 + H2 h w1' + H3 w2 + H4 h w2', cubic Hermite, s = (x - x1)/h. Multiply the second and the fourth by the
    element length for dofs (w, dw/dx), and divide all by that power of it for derivatives by x.

    In an element that shears the dofs are w and the turn t of the section, and the first derivative is the turn. The
    shear strain gamma = dw/dx - t is constant: with Phi = 12 ratio^2 it is Phi/(1 + Phi) ((w2 - w1)/h - (t1 + t2)/2),
    and w is the cubic with the end slopes t + gamma, as where no load acts (interdependent interpolation).
    """
    if ratio is None:
        return _SHAPES[derivative](s)
    # what is left where Phi is infinite, and a multiple of the third derivative: no digit is lost
    limit: Any = (1 - s, (s - s**2) / 2, s, (s**2 - s) / 2), (0, 1 - s, 0, s), (0, -1, 0, 1), (0, 0, 0, 0)
    bend = s - 3 * s**2 + 2 * s**3, 6 * s**2 - 6 * s, 12 * s - 6, 12 + 0.0 * s
    share = bend[derivative] / (1.0 + 12.0 * ratio**2)
    return tuple(part + share * by for part, by in zip(limit[derivative], (1.0, 0.5, -1.0, 0.5), strict=True))


_SHAPES: tuple[Callable[[Array], tuple[Array, ...]], ...] = (
    lambda s: (1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3, 3 * s**2 - 2 * s**3, s**3 - s**2),
    lambda s: (6 * s**2 - 6 * s, 1 - 4 * s + 3 * s**2, 6 * s - 6 * s**2, 3 * s**2 - 2 * s),
    lambda s: (12 * s - 6, 6 * s - 4, 6 - 12 * s, 6 * s - 2),
    lambda s: (12 + 0.0 * s, 6 + 0.0 * s, -12 + 0.0 * s, 6 + 0.0 * s),
)
"""The functions and their derivatives by s, by the order of the derivative."""


def element_of(nodes: Array, positions: Array, side: str) -> NDArray[np.intp]:
    """Numbers of the elements that hold positions (k,) in m; at a node, to 1e-9 of the length, the one on a side."""
    shift = (1.0 if side == "right" else -1.0) * AT_NODE * (nodes[-1] - nodes[0])
    element = np.searchsorted(nodes, positions + shift, side="right") - 1
    return np.asarray(np.minimum(np.maximum(element, 0), nodes.size - 2))


def place_in_element(nodes: Array, positions: Array, side: str) -> tuple[NDArray[np.intp], Array]:
    """Elements that hold positions (k,) in m, as `element_of`, and places from 0 to 1 inside them."""
    element = element_of(nodes, positions, side)
    s = (positions - nodes[element]) / (nodes[element + 1] - nodes[element])
    return element, np.asarray(np.clip(s, 0.0, 1.0))


def hermite_rows(
    nodes: Array,  # (n,) m
    positions: ArrayLike,  # (k,) m
    derivative: int = 0,
    side: str = "right",  # {"left", "right"}: which element is read at a node, where curvature and its slope jump
    shear_lengths: Array | None = None,  # (n - 1,) m: sqrt(EI/(kGA)) of each element; None: none shears
) -> Matrix:  # csr_array (k, 2 n)
    """Sparse rows from nodal pairs of deflection and turn to the deflection, or a derivative of it, at positions.

    The first derivative is the turn of the section, dw/dx where the beam does not shear; the second is the curvature,
    whose multiple the bending moment is. A position off the nodes by rounding is moved to their end.
    """
    x = np.minimum(np.maximum(np.atleast_1d(np.asarray(positions, dtype=float)), nodes[0]), nodes[-1])
    element = element_of(nodes, x, side)
    length = nodes[element + 1] - nodes[element]
    ratio = None if shear_lengths is None else shear_lengths[element] / length
    values = np.array(shape_functions((x - nodes[element]) / length, derivative, ratio)) / length**derivative
    values[[1, 3]] *= length
    column = (2 * element[:, None] + np.arange(4)).ravel()
    first = np.arange(0, column.size + 1, 4)
    return sparse.csr_array((values.T.ravel(), column, first), shape=(x.size, 2 * nodes.size))


@dataclass(frozen=True)
class Section:
    """The section at one position of a beam."""

    bending_stiffness: float  # N m^2: E I: a bending moment is this times the curvature w''
    # m: from the neutral axis to the surface: a surface strain is -+ this times the curvature. None where area and
    # second moment alone are given
    half_height: float | None
    young_modulus: float  # Pa: a stress is this times the strain
    region: str  # name of the segment

    def known_half_height(self, key: str) -> float:
        """The half height (m), for what is asked for under a key.

        Raises `InputError` with this key if it is not known.
        """
        if self.half_height is None:
            raise InputError([Fault(key, None, "", needs_outer_fibre(self.region))])
        return self.half_height


def needs_outer_fibre(region: str) -> str:
    """What strain and stress of the surface need in a segment by area and second moment alone."""
    return f"needs outer_fibre (m) of segment {region!r}: area and second_moment alone do not say where its surface is"


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
        rho I, which the beam's mass matrix has where the beam shears.
    young_modulus : ndarray (elements,), Pa
    half_height : ndarray (elements,), m
        From the neutral axis to the surface; not a number where it is not known.
    region : ndarray (elements,) of str
        Name of the segment.
    width_taper, thickness_taper : ndarray (elements,), 1
        Difference of width and of thickness between the two ends of each element, over the value in its middle.
    shear_length : ndarray (elements,), m, optional
        sqrt(E I/(k G A)); 0 where the beam does not shear, as it does not where it tapers. None: nowhere.
    """

    bending_stiffness: Array
    mass_per_length: Array
    rotary_inertia: Array
    young_modulus: Array
    half_height: Array
    region: NDArray[np.str_]
    width_taper: Array
    thickness_taper: Array
    shear_length: Array | None = None

    @property
    def is_tapered(self) -> NDArray[np.bool_]:
        """True for elements that taper, (elements,)."""
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
        """Half height (m) at places s from 0 to 1 of elements; not a number where it is not known."""
        return np.asarray(self.half_height[element] * self._taper(element, s)[3])

    def _taper(self, element: int | NDArray[np.intp], s: float | Array) -> tuple[float | Array, ...]:
        """Tapers of elements, and the factors a and b of width and thickness."""
        w, t = self.width_taper[element], self.thickness_taper[element]
        return w, t, 1.0 + w * (s - 0.5), 1.0 + t * (s - 0.5)

    def section(self, element: int, s: float = 0.5) -> Section:
        """The section at a place of one element: s from 0, at its end towards the root, to 1."""
        half_height = float(self.half_height_at(element, s))
        return Section(
            float(self.bending_stiffness_at(element, s)),
            None if math.isnan(half_height) else half_height,
            float(self.young_modulus[element]),
            str(self.region[element]),
        )


@dataclass(frozen=True, eq=False)
class Reaction:
    """Force or moment of one support on the structure, as a linear reading of its motion.

    reaction = on_acceleration @ u'' + on_velocity @ u' + on_displacement @ u + on_base_acceleration ub'' - constant
    - (forces on the held dof itself: `System.contact_shares`, `System.held_shares`)

    A force is positive along +w and a moment along +dw/dx; see `femimpact.system.hermite`. It is the force of this
    one support. The sum over all supports is not the force of the shaker where damping in proportion to the mass
    (alpha of Rayleigh), terms that a user adds or an elastic foundation also act between structure and base.

    With modes left out (`reduce`), this reads the held rows of the kept modes. The sum of the inertia and contact
    forces of the kept modes is another number: both tend to the reaction as modes are added, at different rates.

    Parameters
    ----------
    dof : int, optional
        Number of the held dof on the basis (2 node for w, 2 node + 1 for dw/dx); None for a spring or dashpot to
        the base, which holds none.
    unit : {"N", "N m"}
        Of a force, or of a moment.
    on_acceleration : ndarray (dofs,)
        Row of M (a force: kg and, of slopes, kg m; a moment: kg m and kg m^2).
    on_velocity : ndarray (dofs,)
        Row of C (a force: N s/m, N s).
    on_displacement : ndarray (dofs,)
        Row of K (a force: N/m, N).
    on_base_acceleration : float
        Entry of M r (a force: kg; a moment: kg m), M_hf r_f + M_hh r_h.
    constant : float
        Constant load on the held dof (a force: N; a moment: N m).
    """

    dof: int | None
    unit: str
    on_acceleration: Array
    on_velocity: Array
    on_displacement: Array
    on_base_acceleration: float
    constant: float = 0.0


def damped_reactions(reactions: Mapping[str, Reaction], alpha: float, beta: float) -> dict[str, Reaction]:
    """The same reactions with C = alpha M + beta K (1/s, s), whose rows at held dofs follow from those of M and K."""
    return {
        name: replace(item, on_velocity=own(alpha * item.on_acceleration + beta * item.on_displacement))
        for name, item in reactions.items()
    }


def reduced_reactions(reactions: Mapping[str, Reaction], phi: Array) -> dict[str, Reaction]:
    """The same reactions read from modal coordinates q, u = phi q, with phi (dofs, modes)."""
    return {
        name: replace(
            item,
            on_acceleration=own(item.on_acceleration @ phi),
            on_velocity=own(item.on_velocity @ phi),
            on_displacement=own(item.on_displacement @ phi),
        )
        for name, item in reactions.items()
    }


def unloaded_reactions(reactions: Mapping[str, Reaction]) -> dict[str, Reaction]:
    """The same reactions without a constant load on the held dofs."""
    return {name: replace(item, constant=0.0) for name, item in reactions.items()}
