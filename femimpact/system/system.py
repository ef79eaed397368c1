"""The semi-discrete equations: matrices, named places and contact pairs. No finite-element object inside.

M u'' + C u' + K u = -base_load ub'' + constant_load + sum_j b_j F_j,   m_j (y_j'' + ub'') = m_j g_j - F_j,
with u and y relative to the moving base. A stop is a pair whose other side does not move by itself: y_j = 0 where it
is fixed to the base; where it is fixed in space y_j = ub, for with its b_j u = -w this is x_j = y_j - b_j u = w + ub.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array, own
from femimpact.errors import (
    Fault,
    InputError,
    InputWarning,
    check_fields,
    checked,
    column,
    in_range,
    instance,
    items,
    kind_of,
    name_text,
    optional,
    quantity,
    real_array,
    require,
    require_name,
    require_type,
    suggestion,
)
from femimpact.excitation.excitation import LineLoad
from femimpact.structure.structure import Absorber, Impactor, Meeting, Position, Stop, check_meetings
from femimpact.system.contact_pair import ContactPair, contact_pair, meeting_pairs, meetings_of
from femimpact.system.hermite import (
    DERIVATIVE,
    OFF_BEAM,
    SIDE,
    Reaction,
    Section,
    SectionFields,
    damped_reactions,
    hermite_rows,
    place_in_element,
    unloaded_reactions,
)
from femimpact.system.matrices import (
    FINITE,
    MOST_FULL,
    Matrix,
    check_damping,
    checked_matrix,
    checked_row,
    checked_shapes,
    definite_factor,
)
from femimpact.table import Head, head_of_values, short_repr

GAUSS_POINTS = 8
"""In an element, of the integral of a force per length."""

ALIKE = 1e-6
"""Relative difference of omega^2 below which two modes count as one first mode."""


TOGETHER = (
    "M", "C", "K", "stiffness_factor", "base_load", "rigid_translation", "nodes", "expansion", "points", "total_mass",
    "first_frequency", "rayleigh", "directions", "reactions", "sections", "constant_resultant", "first_left_out",
    "unreduced",
)  # fmt: skip
"""Fields of a system that are computed from one another."""


class SystemOrigin(NamedTuple):
    """Fields of a system as they were when they were computed from one another."""

    fields: tuple[Any, ...]
    contacts: tuple[Any, ...]
    constant_load: Any


def check_unchanged(system: Any, origin: SystemOrigin) -> bool:
    """Refuse replaced fields that others follow from; True if the damping, from which none follows, was replaced."""
    numbers = (float, tuple)
    changed = [
        name
        for name, original in zip(TOGETHER, origin.fields, strict=True)
        if (value := getattr(system, name)) is not original
        and not (isinstance(original, numbers) and isinstance(value, numbers) and value == original)
    ]
    stale = [name for name in changed if name not in ("C", "rayleigh")]
    if stale:
        allowed = (
            "cannot be replaced: the fields of a System are computed from one another (stiffness factor, modes, base "
            "load, masses, contacts); change the Structure and assemble it again, or use "
            "System.from_matrices(M, C, K, points=...)"
        )
        raise InputError([Fault(name, None, "", allowed) for name in stale])
    return bool(changed)


def check_contacts(system: Any, origin: SystemOrigin) -> None:
    """Refuse contacts at places that the system was not made with."""
    for pair in system.contacts:
        known = any(pair is other or pair.shares_place(other) for other in origin.contacts)
        allowed = (
            "must be at a place that the system has a contact at, with that one's direction, position, first_mode and "
            "flexibility: add contacts to the Structure and assemble it again, or use System.from_matrices"
        )
        require(known, f"contacts.{pair.name}", None, "", allowed)


@short_repr
@dataclass(frozen=True, eq=False)
class System:
    """Semi-discrete equations of a structure, in free degrees of freedom or in modal ones.

    Parameters
    ----------
    M, C, K : csr_array (dofs, dofs)
        Mass, damping and stiffness of the structure only (kg, N s/m, N/m; modal: 1, 1/s, 1/s^2).
    stiffness_factor : csr_array (strains, dofs)
        G with K = G^T G: weighted curvatures at the Gauss points (modal: diag(omega)).
    base_load : ndarray (dofs,), kg
        M r, the share of the held dofs included: the load is -base_load ub''.
    rigid_translation : ndarray (dofs,)
        r, the free dofs when the structure moves as a rigid body by 1 m.
    nodes : ndarray (n,), m
    expansion : csr_array or ndarray (2 n, dofs)
        From the dofs to (w1, w1', w2, w2', ...) at the nodes, held ones included.
    points : mapping of str to float
        Named places, m from the root.
    total_mass : float, kg
        Mass that moves with the base, balls excluded.
    first_frequency : float, Hz
        First natural frequency of the structure, without balls and undamped.
    contacts : tuple of ContactPair
        Balls first, then stops and balls that meet.
    rayleigh : pair of float, optional
        alpha (1/s) and beta (s) where C = alpha M + beta K.
    directions : mapping of str to ndarray (dofs,)
        Rows that read the displacement of named places which lie on no beam.
    constant_load : ndarray (dofs,), N
        Constant force on the structure, as of gravity; None stands for zero. It may be replaced: nothing else follows
        from it. Balls have an `acceleration`.
    constant_resultant : float, N
        Sum of the constant forces along w on the free dofs, r^T f: that of all modes also where some are left out, as
        `total_mass` is the mass of all. None is rigid_translation^T constant_load, as after a replaced `constant_load`.
    reactions : mapping of str to Reaction
        Forces and moments of the supports, as "root.force" and "root.moment", read from the motion; none where the
        rows of held dofs are not known: for matrices of other programs, and after the damping was replaced by one
        without `rayleigh`. A replaced `constant_load` acts on the free dofs alone.
    sections : SectionFields, optional
        The section of every element; None for a system given by matrices.
    first_left_out : float, Hz
        Lowest natural frequency that a reduction has left out; infinite where none has.
    unreduced : System, optional
        The system on all dofs, of one that `reduce` has put on modes; None of any other.
    computed_together : SystemOrigin
        What the fields were when they were computed from one another. It is made with the system and goes with
        its copies, so that a copy with another M, K or point is refused: what follows from them would be stale.

    Raises
    ------
    InputError
        If it is not made by `assemble` or `from_matrices`, or a field was replaced from which others follow. Other
        contacts at the same places, none, and another damping matrix (with its `rayleigh`, or None) may be replaced.
    """

    M: Matrix
    C: Matrix
    K: Matrix
    stiffness_factor: Matrix
    base_load: Array = field(metadata=column("kg", "dofs", finite=True))
    rigid_translation: Array = field(metadata=column("1", "dofs", finite=True))
    nodes: Array = field(metadata=column("m", "nodes", finite=True))
    expansion: Matrix | Array
    points: Mapping[str, float]
    total_mass: float = field(metadata=quantity("kg", at_least=0.0))
    first_frequency: float = field(metadata=quantity("Hz", at_least=0.0, finite=False))
    contacts: tuple[ContactPair, ...] = field(default=(), metadata=items(ContactPair))
    rayleigh: tuple[float, float] | None = field(
        default=None, metadata=optional(quantity("1/s and s", at_least=0.0, several=True))
    )
    directions: Mapping[str, Array] = field(default_factory=dict)
    constant_load: Any = field(default=None, metadata=column("N", "dofs", finite=True))
    constant_resultant: Any = field(default=None, metadata=optional(quantity("N")))
    reactions: Mapping[str, Reaction] = field(default_factory=dict)
    sections: SectionFields | None = field(default=None, metadata=optional(instance(SectionFields)))
    first_left_out: float = field(default=math.inf, metadata=quantity("Hz", at_least=0.0, finite=False))
    unreduced: System | None = field(default=None, repr=False)
    computed_together: SystemOrigin = field(default=None, repr=False)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be that of a system: make one by assemble or System.from_matrices, and copies by replace"
        origin = self.computed_together
        require(isinstance(origin, SystemOrigin), "computed_together", kind_of(origin), "", allowed)
        if self.constant_load is None:
            object.__setattr__(self, "constant_load", own(np.zeros(self.dofs)))
        if check_unchanged(self, origin):
            check_damping(self)
            self._set_reactions(damped_reactions(self.reactions, *self.rayleigh) if self.rayleigh else {})
        if self.constant_load is not origin.constant_load:
            self._set_reactions(unloaded_reactions(self.reactions))
            resultant = float(self.rigid_translation @ np.asarray(self.constant_load))
            object.__setattr__(self, "constant_resultant", resultant)
        check_contacts(self, origin)
        names = [pair.name for pair in self.contacts]
        require(len(set(names)) == len(names), "contacts", names, "", "must have distinct names")
        stops = [pair.is_stop for pair in self.contacts]
        require(stops == sorted(stops), "contacts", names, "", "must be balls first, then stops and meetings")
        for pair in self.contacts:
            for name in pair.between:
                require_name(name, (ball.name for ball in self.balls), f"contacts.{pair.name}.between")
        _together(self, origin.contacts)

    def _set_reactions(self, reactions: Mapping[str, Reaction]) -> None:
        object.__setattr__(self, "reactions", reactions)

    @classmethod
    def from_matrices(
        cls,
        M: Any,
        C: Any,
        K: Any,
        *,
        points: Mapping[str, ArrayLike],
        base_load: ArrayLike | None = None,
        impactors: Sequence[Impactor] = (),
        stops: Sequence[Stop] = (),
        constant_load: ArrayLike | None = None,
        nodes: ArrayLike | None = None,
        expansion: Any = None,
        absorbers: Sequence[Absorber] = (),
        meetings: Sequence[Meeting] = (),
    ) -> System:
        """Any linear structure by its matrices: M u'' + C u' + K u = -base_load ub'' + constant_load + sum_j b_j F_j.

        Parameters
        ----------
        M, C, K : array_like or sparse (dofs, dofs)
            Symmetric; M positive definite, C and K positive semidefinite (kg, N s/m, N/m).
        points : mapping of str to array_like (dofs,)
            Each named place by the row that reads its displacement (m).
        base_load : array_like (dofs,), kg
            M r with r the rigid translation; the default r = 1 in every dof. An `InputWarning` says where that cannot
            be, as of dofs that turn.
        impactors, stops, absorbers : sequences
            Their `at` is a name among the points.
        meetings : sequence of Meeting
            Of balls at one point.
        constant_load : array_like (dofs,), N
            Constant force on the structure; the default is none. Balls have an `acceleration` each.
        nodes : array_like (n,), m
            Increasing positions along a line, for pictures: mode shapes and deflections are drawn there.
        expansion : array_like or sparse (2 n, dofs)
            From the dofs to (w1, w1', w2, w2', ...) at the nodes; given with `nodes`. A point whose row is that of
            w at a node is at this node in pictures, others have no position.

        Raises
        ------
        InputError
            For shapes that do not fit, matrices that are not symmetric or not definite, unknown names.
        """
        _check_parts(points, impactors, absorbers, stops, meetings)
        check_meetings(meetings, {ball.name: ball.at for ball in impactors})
        matrices = _checked_matrices(M, C, K)
        dofs = matrices["M"].shape[0]
        require(len(points) > 0, "points", "none", "", 'must name at least one place, as {"tip": [1.0]}')
        rows = {name: checked_row(f"points.{name}", row, dofs) for name, row in points.items()}
        dense = {name: matrix.toarray() for name, matrix in matrices.items()}
        definite_factor("M", dense["M"], strictly=True)
        # before C, which may be a multiple of K
        factor, rank = definite_factor("K", dense["K"])
        definite_factor("C", dense["C"])
        load = dense["M"].sum(axis=1) if base_load is None else checked_row("base_load", base_load, dofs)
        if base_load is None and (load < 0.0).any():
            words = (
                f"base_load: by default the sums of the rows of M, of which that of dof {int(load.argmin())} is "
                "negative: a turn does not move with the base; give M r with r = 1 for displacements along the base"
            )
            warnings.warn(words, InputWarning, stacklevel=2)
        places, shapes = checked_shapes(nodes, expansion, dofs)
        rigid = np.linalg.solve(dense["M"], load)
        with np.errstate(over="ignore"):
            total_mass = float(rigid @ load)
        require(np.isfinite(total_mass), "base_load", None, "", "must be of a finite mass, base_load M^-1 base_load")
        bare = computed_system(
            M=matrices["M"],
            C=matrices["C"],
            K=matrices["K"],
            stiffness_factor=sparse.csr_array(factor),
            base_load=own(load),
            rigid_translation=own(rigid),
            nodes=places,
            expansion=shapes,
            points={name: _place_of_row(row, places, shapes) for name, row in rows.items()},
            total_mass=total_mass,
            first_frequency=0.0,
            directions=rows,
            constant_load=None if constant_load is None else checked_row("constant_load", constant_load, dofs),
        )
        items: tuple[Impactor | Absorber | Stop, ...] = (*impactors, *absorbers, *stops)
        names = [*(item.name for item in items), *(item.name for item in meetings)]
        distinct = len({*names, *points}) == len(names) + len(points)
        require(distinct, "name", names, "", "must be distinct, and not the name of a point")
        first, contacts = _contacts_of_matrices(bare, dense, rank, items)
        contacts += meeting_pairs(meetings, contacts)
        return with_checked_fields(bare, first_frequency=first, contacts=contacts)

    @property
    def _head(self) -> Head:
        values = {
            "first frequency": f"{self.first_frequency:.5g} Hz",
            "total mass": f"{self.total_mass:.5g} kg",
            "damping": "a given matrix",
            "points": ", ".join(name if math.isnan(x) else f"{name} at {x:.5g} m" for name, x in self.points.items()),
        }
        if self.rayleigh is not None:
            values["damping"] = f"Rayleigh, alpha = {self.rayleigh[0]:.5g} 1/s, beta = {self.rayleigh[1]:.5g} s"
        if self.nodes.size:
            values["nodes"] = f"{self.nodes.size} from {self.nodes[0]:.5g} to {self.nodes[-1]:.5g} m"
        for pair in self.contacts:
            body = pair.kind if pair.is_stop else f"{pair.mass:.5g} kg"
            values[pair.name] = f"{body}, gaps {pair.gaps[0]:.5g} and {pair.gaps[1]:.5g} m, {pair.law.name}"
            if pair.kind == "absorber":
                values[pair.name] = f"{body} on {pair.free_stiffness:.5g} N/m and {pair.free_damping:.5g} N s/m"
        return head_of_values(f"System: {self.dofs} dofs, contacts: {len(self.contacts)}", values)

    @property
    def balls(self) -> tuple[ContactPair, ...]:
        """The contact pairs that are balls; they come first in `contacts`."""
        return tuple(pair for pair in self.contacts if not pair.is_stop)

    @property
    def meetings(self) -> dict[int, tuple[int, int]]:
        """Of the pairs that are balls that meet, by their number: those of the two balls."""
        return meetings_of(self.contacts)

    @cached_property
    def default_place(self) -> str:
        """The place observed unless another is named: the tip, or the first point of a system without one.

        Where it is held, the middle, else the first named place that moves: the same with balls and without them.
        """
        place = "tip" if "tip" in self.points or not self.directions else next(iter(self.directions))
        places = [place, *(name for name in ("mid",) if name in self.points), *self.points, *self.directions]
        return next((name for name in places if np.any(self.point_row(name))), place)

    @property
    def length(self) -> float:
        """Distance from the first node to the last, m; 0 without nodes."""
        return float(self.nodes[-1] - self.nodes[0]) if self.nodes.size else 0.0

    @cached_property
    def dofs(self) -> int:
        """Number of degrees of freedom of the structure."""
        return int(self.base_load.size)

    @cached_property
    def is_diagonal(self) -> bool:
        """True if M, C and K are diagonal, as in modal coordinates."""
        entries = (matrix.tocoo(copy=False) for matrix in (self.M, self.C, self.K))
        return all(bool(np.all((one.coords[0] == one.coords[1]) | (one.data == 0.0))) for one in entries)

    def position_of(self, at: Position) -> float:
        """Metres from the root of a named place or of a number, checked to lie on the beam.

        Raises
        ------
        InputError
            If the name is unknown, there is no beam, or the number lies off it.
        """
        if isinstance(at, str):
            if at not in self.points:
                require(False, "at", at, "", suggestion(at, self.points))
            return float(self.points[at])
        return float(self._on_beam(checked("at", at, quantity("m")) if self.nodes.size else at, "at"))

    def nodal_rows(self, positions: ArrayLike, derivative: int = 0, side: str = "right") -> Matrix:
        """Sparse rows (k, 2 n) of `deflection_rows` on the deflections and turns of the nodes, held ones included."""
        x = np.atleast_1d(self._on_beam(positions))
        require(x.ndim == 1, "positions", f"array of shape {x.shape}", "m", "must be one place or a row of them")
        order, end = checked("derivative", derivative, DERIVATIVE), checked("side", side, SIDE)
        shear = None if self.sections is None else self.sections.shear_length
        return hermite_rows(self.nodes, x, order, end, shear)

    def deflection_rows(self, positions: ArrayLike, derivative: int = 0) -> Array:
        """Rows that read the deflection (or its derivative by x) at positions off the dofs.

        w(x) = rows @ u, along the Hermite curve of the element that holds x.

        Parameters
        ----------
        positions : array_like (k,), m
        derivative : int
            0 deflection, 1 turn of the section, without shear dw/dx, 2 its derivative, the curvature (1/m), 3 (1/m^2).

        Returns
        -------
        ndarray (k, dofs)

        Raises
        ------
        InputError
            If there is no beam, a position lies off it, or a cubic has no such derivative.
        """
        return self._on_dofs(self.nodal_rows(positions, derivative))

    def curvature_rows(self, positions: ArrayLike, side: str = "right") -> Array:
        """Rows that read the curvature w'' (1/m) at positions.

        The bending moment is EI w'', the elastic part: the shares of damping in proportion to the stiffness and of
        `add_terms` are not in it. A surface strain is -+ half_height w'', a stress E times that; the constants are
        those of `section_at`, and `femimpact.system.hermite` the signs. w'' is linear in each element, with an error of
        the second order of the element's length.

        Parameters
        ----------
        positions : array_like (k,), m
        side : {"left", "right"}
            Which element is read at a node: towards the root, or towards the tip. Where the section jumps, both
            moments tend to one value as the mesh is refined; curvature, strain and stress jump.

        Returns
        -------
        ndarray (k, dofs), 1/m per unit of a dof

        Raises
        ------
        InputError
            If there is no beam, or a position lies off it.
        """
        return self._on_dofs(self.nodal_rows(positions, 2, side))

    def shear_rows(self, positions: ArrayLike, side: str = "right") -> Array:
        """Rows that read the shear force (EI w'')' = EI w''' + (EI)' w'' (N) at positions.

        w''' is constant in a cubic element, so that the reading jumps from element to element: its error is of the
        first order of the element's length, and of the second at an element's middle. Where the section is constant
        (EI)' is 0, and an element has one shear force, -k G A times its shear strain if any; along a taper it varies.

        Parameters
        ----------
        positions : array_like (k,), m
        side : {"left", "right"}
            Which element is read at a node.

        Returns
        -------
        ndarray (k, dofs), N per unit of a dof

        Raises
        ------
        InputError
            If there is no beam with known sections, or a position lies off it.
        """
        sections, (element, s) = self._known_sections, self._place_of(positions, side)
        rows = sections.bending_stiffness_at(element, s)[:, None] * self._on_dofs(self.nodal_rows(positions, 3, side))
        if sections.is_tapered[element].any():
            slope = sections.bending_stiffness_at(element, s, derivative=1) / np.diff(self.nodes)[element]
            rows = rows + slope[:, None] * self._on_dofs(self.nodal_rows(positions, 2, side))
        return np.asarray(rows)

    def section_at(self, at: Position, side: str = "right") -> Section:
        """The section at a place: bending stiffness, half height, Young's modulus, region.

        Parameters
        ----------
        at : str or float
            A named place, or metres from the root.
        side : {"left", "right"}
            Which element's at a node: towards the root, or towards the tip.

        Raises
        ------
        InputError
            If there is no beam with known sections, or no such place.
        """
        sections = self._known_sections
        element, s = self._place_of([self.position_of(at)], side)
        return sections.section(int(element[0]), float(s[0]))

    @property
    def _known_sections(self) -> SectionFields:
        if self.sections is None:
            raise InputError([Fault("sections", None, "", "are not known of a system given by matrices")])
        return self.sections

    def _place_of(self, positions: ArrayLike, side: str) -> tuple[NDArray[np.intp], Array]:
        """Elements that hold positions, and the places from 0 to 1 inside them."""
        return place_in_element(self.nodes, np.atleast_1d(self._on_beam(positions)), checked("side", side, SIDE))

    def _on_beam(self, positions: Any, key: str = "positions") -> Array:
        """Positions (m) on the beam, those off it by rounding only moved to its end."""
        require(
            self.nodes.size > 0, "at", positions, "m", f"must be a name, {', '.join(self.points)}: there is no beam"
        )
        root, tip = float(self.nodes[0]), float(self.nodes[-1])
        allowed = f"must be within the beam, {root:g} to {tip:g} m"
        x = real_array(key, positions, "m", allowed)
        slack = OFF_BEAM * (tip - root)
        beyond = x[(x < root - slack) | (x > tip + slack)]
        require(beyond.size == 0, key, float(beyond[0]) if beyond.size else None, "m", allowed)
        return np.minimum(np.maximum(x, root), tip)

    def _on_dofs(self, rows: Any) -> Array:
        """Rows on the dofs of what rows (k, 2 n) read at the nodes."""
        if isinstance(self.expansion, np.ndarray):
            return np.asarray(rows @ self.expansion)
        # sooner than the product of two sparse matrices
        return np.ascontiguousarray((self.expansion.T @ rows.toarray().T).T)

    def _nodal_row(self, at: Position | LineLoad) -> Matrix:
        """Row (1, 2 n) on the nodes' (w, w') that reads the deflection at a place, or the integral of q w dx (N m)."""
        if not isinstance(at, LineLoad):
            return self.nodal_rows([self.position_of(at)])
        self._on_beam([])
        points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        half = 0.5 * np.diff(self.nodes)[:, None]
        x = (self.nodes[:-1, None] + half * (1.0 + points)).ravel()
        q = [at.density(float(place)) for place in x] if callable(at.density) else at.density
        density = real_array("density", q, "N/m", "must be a finite number at each place of the beam")
        return sparse.csr_array([(half * weights).ravel() * density]) @ self.nodal_rows(x)

    def resultant(self, line: LineLoad) -> float:
        """Force (N) of a line load: the integral of its density over the beam."""
        require_type(line, LineLoad, "line")
        return float(self._nodal_row(line).toarray()[0, 0::2].sum())

    def held_shares(self, at: Position | LineLoad) -> Array:
        """Share of a unit force at a place that acts on the held dof of each reaction, (reactions,).

        It is 1 for a force on a support itself, and not 0 in the elements beside one. A reaction is less by this
        times the force.
        """
        rows = self._nodal_row(at).toarray()[0] if self.reactions else np.zeros(0)
        return np.array([0.0 if item.dof is None else rows[item.dof] for item in self.reactions.values()])

    @cached_property
    def contact_shares(self) -> Array:
        """Share of each contact force F_j that acts on the held dof of each reaction, (reactions, contacts).

        It is b_j at the held dof: a reaction is less by this times F_j.
        """
        shares = np.zeros((len(self.reactions), len(self.contacts)))
        if self.reactions:
            for j, pair in enumerate(self.contacts):
                if not pair.between:
                    shares[:, j] = pair.sign * self.held_shares(pair.position)
        return own(shares)

    def point_row(self, at: Position | LineLoad) -> Array:
        """Row (dofs,) that reads the deflection at a named place, or at metres from the root; of a line its load (N).

        Raises
        ------
        InputError
            If the place is unknown, or lies off the beam.
        """
        if isinstance(at, LineLoad):
            return np.asarray(self._on_dofs(self._nodal_row(at))[0])
        if isinstance(at, str) and at in self.directions:
            return self.directions[at]
        if not isinstance(at, str) and not in_range(at, quantity("m")):
            require(False, "at", at, "", "must be the name of a place, or metres from the root")
        position, rows = self.position_of(at), self.derived_undamped.setdefault("rows", {})
        if position not in rows:
            rows[position] = own(self.deflection_rows([position])[0])
        row_there: Array = rows[position]
        return row_there

    @cached_property
    def highest_kept(self) -> float:
        """Highest natural frequency (Hz) of the modes kept by a reduction; infinite where nothing was left out.

        Attachment vectors of a static correction are no modes: theirs are above the lowest one left out.
        """
        if math.isinf(self.first_left_out):
            return math.inf
        natural = np.sqrt(self.K.diagonal() / self.M.diagonal()) / (2.0 * math.pi)
        return float(natural[natural <= self.first_left_out].max(initial=0.0))

    @cached_property
    def derived(self) -> dict[Any, Any]:
        """Results computed from this system, by keys of the functions that computed them: kept as long as the system.

        A value follows from its key and the system alone, and is not changed once it is there, so that threads
        may share it.
        """
        return {}

    @cached_property
    def derived_undamped(self) -> dict[Any, Any]:
        """The same of what follows from mass, stiffness and mesh alone.

        Copies of `femimpact.system.modes` with another damping or other contacts have the same one.
        """
        return {}

    def __getstate__(self) -> dict[str, Any]:
        # what was computed before is computed again where it is sent to; a factorisation cannot be sent
        return {name: value for name, value in self.__dict__.items() if not name.startswith("derived")}


def _check_parts(points: Any, impactors: Any, absorbers: Any, stops: Any, meetings: Any) -> None:
    """Refuse named places, balls, absorbers, stops and meetings that are of the wrong kind."""
    require_type(points, Mapping, "points")
    for name in points:
        checked("points", name, name_text())
    parts: tuple[tuple[str, Any, Any], ...]
    parts = ("impactors", impactors, Impactor), ("absorbers", absorbers, Absorber), ("stops", stops, Stop)
    parts += (("meetings", meetings, Meeting),)
    for key, bodies, kind in parts:
        require(isinstance(bodies, (list, tuple)), key, type(bodies).__name__, "", "must be a list")
        for item in bodies:
            require_type(item, kind, key)


def _checked_matrices(M: Any, C: Any, K: Any) -> dict[str, Matrix]:
    """Symmetric matrices of one shape, by their names."""
    matrices = {name: checked_matrix(name, value) for name, value in (("M", M), ("C", C), ("K", K))}
    dofs = matrices["M"].shape[0]
    require(dofs <= MOST_FULL, "M", (dofs, dofs), "", f"must have at most {MOST_FULL:,} dofs, as a full matrix")
    for name, matrix in matrices.items():
        require(matrix.shape[0] == dofs, name, matrix.shape, "", f"must have the shape of M, {dofs} by {dofs}")
    return matrices


def _place_of_row(row: Array, nodes: Array, expansion: Matrix) -> float:
    """Position (m) of the node whose deflection a row reads; not a number where there is none."""
    same = np.flatnonzero(np.all(np.abs(expansion[0::2].toarray() - row) <= 1e-9 * np.abs(row).max(), axis=1))
    return float(nodes[same[0]]) if same.size else math.nan


def _contacts_of_matrices(
    system: System, dense: Mapping[str, Array], rank: int, items: Sequence[Impactor | Absorber | Stop]
) -> tuple[float, tuple[ContactPair, ...]]:
    """First natural frequency (Hz) of a system given by matrices, and its contact pairs."""
    omega_squared, vectors = scipy.linalg.eigh(dense["K"], dense["M"])
    elastic = rank == system.dofs
    # equal parts share the lowest frequency: what their modes have at a place together does not hang on their choice
    lowest = vectors[:, omega_squared <= omega_squared[0] * (1.0 + ALIKE)]
    contacts = []
    for item in items:
        require(item.at in system.points, f"{item.name}.at", item.at, "", suggestion(str(item.at), system.points))
        row = system.directions[str(item.at)]
        first = float(np.linalg.norm(row @ lowest))
        if not elastic or first == 0.0:
            # without a first mode there: the mass that an impulse moves
            first = math.sqrt(float(row @ np.linalg.solve(dense["M"], row)))
        flexibility = float(row @ np.linalg.solve(dense["K"], row)) if elastic else math.nan
        contacts.append(contact_pair(item, row, math.nan, first, flexibility))
    first_frequency = math.sqrt(float(omega_squared[0])) / (2.0 * math.pi) if elastic else 0.0
    return first_frequency, tuple(contacts)


def without_impactors(system: System) -> System:
    """The same system with its cavities empty: no ball, no absorber, no contact but that of stops."""
    require_type(system, System, "system")
    return replace(system, contacts=tuple(pair for pair in system.contacts if pair.kind == "stop"))


FIELDS = tuple(item.name for item in fields(System))

UNDAMPED = ("M", "K", "stiffness_factor", "nodes", "expansion", "sections")
"""Fields that `System.derived_undamped` follows from."""


def computed_system(**values: Any) -> System:
    """The system with these fields, all but `computed_together`, as they follow from sound input.

    Raises `InputError` if a number is infinite.
    """
    system = object.__new__(System)
    system.__dict__.update(
        {"contacts": (), "rayleigh": None, "directions": {}, "reactions": {}, "sections": None,
         "first_left_out": math.inf, "unreduced": None, **values}
    )  # fmt: skip
    load = values["constant_load"]
    system.__dict__["constant_load"] = own(np.zeros(system.dofs)) if load is None else load
    system.__dict__["constant_resultant"] = float(system.rigid_translation @ system.constant_load)
    check_fields(system)
    _require_finite(values.items())
    return _together(system, system.contacts)


def with_checked_fields(system: System, **changes: Any) -> System:
    """The same system with other fields that were computed together.

    Raises `InputError` if a number is infinite.
    """
    _require_finite(changes.items())
    return _together(_copy(system, **changes), changes.get("contacts", system.computed_together.contacts))


def with_checked_pairs(system: System, contacts: tuple[ContactPair, ...]) -> System:
    """The same system with other numbers of its pairs, which were checked when they were made: no more is checked."""
    return _copy(system, contacts=contacts)


def _require_finite(values: Iterable[tuple[str, Any]]) -> None:
    for name, value in values:
        numbers: Any = value.data if sparse.issparse(value) else value  # type: ignore[attr-defined]
        if isinstance(numbers, np.ndarray) and numbers.dtype.kind == "f" and not np.isfinite(numbers).all():
            raise InputError([Fault(name, None, "", FINITE)])


def _together(system: System, contacts: tuple[ContactPair, ...]) -> System:
    """The system, whose fields are from now on those that were computed together, with contacts at these places."""
    fields = tuple(system.__dict__[name] for name in TOGETHER)
    system.__dict__["computed_together"] = SystemOrigin(fields, contacts, system.constant_load)
    return system


def _copy(system: System, **changes: Any) -> System:
    copied = object.__new__(System)
    copied.__dict__.update({name: system.__dict__[name] for name in FIELDS} | changes)
    if system.__dict__.get("is_diagonal"):
        # diagonal matrices stay so
        copied.__dict__["is_diagonal"] = True
    if changes.keys().isdisjoint(UNDAMPED):
        copied.__dict__["derived_undamped"] = system.derived_undamped
    return copied
