"""A structure on its mesh: the scikit-fem basis, its dofs, the section in every element."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skfem import Basis, ElementLineHermite, MeshLine
from skfem.element import DiscreteField

from femimpact.arrays import Array, read_only
from femimpact.errors import (
    Fault,
    InputError,
    InputWarning,
    checked,
    quantity,
    real_array,
    require,
    require_name,
    require_type,
    suggestion,
)
from femimpact.fem.mesh import SAME_PLACE, Mesh, uniform_mesh, with_nodes
from femimpact.structure.beam import Beam, Segment
from femimpact.structure.structure import SUPPORTS, Position, Structure, Support
from femimpact.system.hermite import SectionFields, hermite_rows, shape_functions
from femimpact.system.matrices import Matrix

OFF_MESH = 1e-6
"""Share of the beam's length by which it and a mesh of single precision may differ."""


NAMED_IN_FILES = (
    "; a mesh file names a place by a physical point in Gmsh, by a point array that is 1 there and 0 elsewhere in .vtu"
)
"""Words on how a place gets a name."""


class ElementLineHermiteReference(ElementLineHermite):  # type: ignore[misc]
    """Cubic Hermite line element in reference coordinates, dofs (u, u_x).

    The stock element inverts a Vandermonde matrix in global coordinates and keeps it on the
    instance: it loses digits on fine or graded meshes and is wrong on a second mesh.

    With lengths sqrt(EI/(kGA)) of the elements, (elements,), m, the dofs are those of `shape_functions`.
    """

    def __init__(self, shear_lengths: Array | None = None) -> None:
        super().__init__()
        self.shear_lengths = shear_lengths

    def gbasis(self, mapping: Any, X: Array, i: int, tind: Any = None) -> tuple[DiscreteField]:
        """Basis function i and its derivatives by x at reference points X."""
        mesh = mapping.mesh
        t = mesh.t if tind is None else mesh.t[:, tind]
        length = (mesh.p[0, t[1]] - mesh.p[0, t[0]])[:, None]  # signed, so reversed elements are right
        s = X[0]
        if s.ndim == 1:
            s = np.broadcast_to(s, (t.shape[1], s.shape[0]))
        scale = length if i % 2 else 1.0
        shear = self.shear_lengths
        ratio = None if shear is None else shear[slice(None) if tind is None else tind, None] / length
        value, slope, curvature, third = (scale * shape_functions(s, k, ratio)[i] / length**k for k in range(4))
        if ratio is not None:
            # dw/dx is the turn and the shear strain
            slope = slope - (ratio * length) ** 2 * third
        field = DiscreteField(value=value, grad=slope[None], hess=curvature[None, None], grad3=third[None, None, None])
        return (field,)


@dataclass(frozen=True, eq=False)
class Discretisation:
    """A structure on a mesh, before any matrix: what a user's weak forms are assembled on.

    All matrices on the basis have the dofs (w1, w1', w2, w2', ...), nodes from root to tip, w in m and the slope
    w' = dw/dx positive, held dofs included. `assemble` keeps those in `free`. Where the beam shears, the turn of the
    section stands in place of w'; `grad` of the basis is dw/dx, `hess` the curvature, the turn's derivative.

    Parameters
    ----------
    structure : Structure
    mesh : Mesh
        Nodes, named points and regions; `basis.mesh` is scikit-fem's mesh of the same nodes.
    basis : skfem.CellBasis
        Cubic Hermite elements. Their quadrature is exact to degree 6, that of two cubics; on a beam that tapers, to 8,
        with rho A of degree 2. EI of degree 4 with two second derivatives, linear each, is of degree 6.
    free : ndarray (dofs,)
        Numbers of the dofs that no support holds.
    sections : SectionFields
        Bending stiffness, mass per length and so on in the middle of every element, the taper, and how it shears.
    """

    structure: Structure
    mesh: Mesh
    basis: Any
    free: NDArray[np.int64]
    sections: SectionFields

    @cached_property
    def dofs(self) -> int:
        """Number of dofs of the basis, those held by supports included."""
        return 2 * self.mesh.nodes.size

    @property
    def held(self) -> NDArray[np.int64]:
        """Numbers of the dofs that supports hold."""
        return np.setdiff1d(np.arange(self.dofs), self.free)

    def at_quadrature(self, values: Any) -> Array:
        """One value of each element, (elements,), at the basis's quadrature points: (elements, points).

        For coefficients of a form. What varies along a taper is there as `bending_stiffness`, `mass_per_length` and
        `rotary_inertia`: `form.assemble(d.basis, EI=d.bending_stiffness)`.
        """
        allowed = f"must hold {self.mesh.elements} finite numbers, one for each element"
        of_element = real_array("values", values, "", allowed)
        require(of_element.shape == (self.mesh.elements,), "values", f"array of shape {of_element.shape}", "", allowed)
        return np.asarray(of_element[:, None] + self.basis.zero_w())

    @property
    def bending_stiffness(self) -> Array:
        """E I (N m^2) at the basis's quadrature points, (elements, points)."""
        return self.sections.bending_stiffness_at(*self._quadrature_places)

    @property
    def mass_per_length(self) -> Array:
        """Rho A (kg/m) at the basis's quadrature points, (elements, points)."""
        return self.sections.mass_per_length_at(*self._quadrature_places)

    @property
    def rotary_inertia(self) -> Array:
        """Rho I (kg m) at the basis's quadrature points, (elements, points)."""
        return self.sections.rotary_inertia_at(*self._quadrature_places)

    @property
    def _quadrature_places(self) -> tuple[NDArray[np.int64], Array]:
        """Numbers of the elements, (elements, 1), and places from 0 to 1 inside them, (1, points)."""
        return np.arange(self.mesh.elements)[:, None], np.asarray(self.basis.X)

    def rows(self, positions: ArrayLike, derivative: int = 0) -> Matrix:
        """Sparse rows (positions, dofs) that read the deflection, its turn or a derivative of it (`hermite_rows`)."""
        return hermite_rows(self.mesh.nodes, positions, derivative, shear_lengths=self.sections.shear_length)

    def position_of(self, at: Position, key: str = "at") -> float:
        """Metres from the root of a place that the mesh names, of a body's name, or of a number."""
        return _position(self.structure, self.mesh, at, key)

    def node_of(self, support: Support) -> int:
        """Number of the node that a support holds."""
        require_type(support, Support, "support")
        return _node(self.structure, self.mesh, support)


def discretise(structure: Structure, elements: int | None = None, mesh: Mesh | None = None) -> Discretisation:
    """A structure on a mesh: the scikit-fem basis, the free dofs and the section in every element.

    Parameters
    ----------
    elements : int
        Number of elements of a mesh made here; or
    mesh : Mesh
        a mesh from `read_mesh`.

    Raises
    ------
    InputError
        If neither or both of elements and mesh are given, the mesh does not fit the beam, or a
        name is unknown.

    Examples
    --------
    >>> import femimpact as fi
    >>> int(fi.fem.discretise(structure, elements=4).basis.N)
    10
    """
    require_type(structure, Structure, "structure")
    one = (elements is None) != (mesh is None)
    require(one, "mesh", None, "", "give either elements (a whole number) or a mesh")
    if mesh is not None:
        require_type(mesh, Mesh, "mesh")
    else:
        kind = type(elements).__name__
        require(not isinstance(elements, Mesh), "elements", kind, "", "must be a whole number; pass a mesh as mesh=")
        mesh = uniform_mesh(structure, elements)  # type: ignore[arg-type]
    _check_length(structure.beam, mesh)
    if structure.axial is not None:
        # where the normal force jumps
        places = [_position(structure, mesh, body.at, f"mass.{body.name}.at") for body in structure.masses]
        mesh = with_nodes(mesh, places)
    bodies: tuple[Any, ...] = (*structure.impactors, *structure.absorbers, *structure.stops, *structure.meetings)
    for item in bodies:
        key, allowed = f"{type(item).__name__.lower()}.{item.name}.name", "must not be the name of a point of the mesh"
        require(item.name not in mesh.points, key, item.name, "", allowed)
    # what is refused, before what is warned of
    free = read_only(np.delete(np.arange(2 * mesh.nodes.size), _held_dofs(structure, mesh)))
    sections = _sections(structure.beam, mesh)
    # the product of two cubics, and rho A of degree 2 where width and thickness taper
    degree = 8 if sections.is_tapered.any() else 6
    shear = None if sections.shear_length is None else sections.shear_length.tobytes()
    return Discretisation(structure, mesh, _basis(mesh.nodes.tobytes(), degree, shear), free, sections)


@lru_cache(maxsize=4)
def _basis(nodes: bytes, degree: int, shear: bytes | None) -> Any:
    """The basis on nodes, of which structures on one mesh share the shape functions at the quadrature points."""
    element = ElementLineHermiteReference(None if shear is None else np.frombuffer(shear))
    return Basis(MeshLine(np.frombuffer(nodes)), element, intorder=degree)


def _sections(beam: Beam, mesh: Mesh) -> SectionFields:
    """The section of every element."""
    values = np.empty((8, mesh.elements))
    region = np.empty(mesh.elements, dtype=object)
    for segment, members in _segments_on_mesh(beam, mesh):
        bending, modulus = segment.bending_stiffness, segment.young_modulus
        rotary = segment.density * bending / modulus
        constants = (bending, segment.mass_per_length, rotary, modulus, segment.half_height or math.nan)
        values[:5, members] = np.array(constants)[:, None]
        values[7, members] = segment.shear_length
        if segment.is_tapered:
            (a, b), values[5:7, members] = _taper(segment, mesh, members)
            values[:5, members] *= np.stack([a * b**3, a * b, a * b**3, np.ones(a.size), b])
        else:
            values[5:7, members] = 0.0
        region[members] = segment.name
    values.setflags(write=False)
    stiffness, mass, inertia, moduli, half, width_taper, thickness_taper, shear = values
    names, length = region.astype(str), shear if shear.any() else None
    return SectionFields(stiffness, mass, inertia, moduli, half, names, width_taper, thickness_taper, length)


def _taper(segment: Segment, mesh: Mesh, members: NDArray[np.int64]) -> tuple[Array, Array]:
    """Width and thickness in the middle of a segment's elements over those at its start, and their tapers.

    Two arrays (2, members). The segment begins and ends where its elements do.
    """
    neighbours = bool(np.ptp(members) == members.size - 1)
    allowed = "must be one row of neighbouring elements, as its section tapers"
    require(neighbours, f"mesh.regions.{segment.name}", f"{members.size} elements", "", allowed)
    near, far = mesh.nodes[members], mesh.nodes[members + 1]
    start, end = near.min(), far.max()
    growth = (np.array(segment.end_rectangle) / np.array(segment.rectangle) - 1.0)[:, None]
    middle = 1.0 + growth * ((0.5 * (near + far) - start) / (end - start))
    return middle, growth * ((far - near) / (end - start)) / middle


def _segments_on_mesh(beam: Beam, mesh: Mesh) -> Iterable[tuple[Segment, NDArray[np.int64]]]:
    """Each segment with the elements it fills, checked to cover the mesh once and to be as long."""
    if len(beam.segments) == 1:
        _warn_of_steps(mesh)
        return [(beam.segments[0], np.arange(mesh.elements))]
    result = []
    for segment in beam.segments:
        require_name(segment.name, mesh.regions, "mesh.regions")
        fault = _length_fault(mesh, segment)
        if fault is not None:
            raise InputError([fault])
        result.append((segment, mesh.regions[segment.name]))
    covered = np.sort(np.concatenate([members for _, members in result]))
    complete = bool(np.array_equal(covered, np.arange(mesh.elements)))
    require(complete, "mesh.regions", None, "", "must cover every element once")
    return result


def _length_fault(mesh: Mesh, segment: Segment) -> Fault | None:
    """The fault in the length of a segment, where the mesh has its region."""
    if segment.name not in mesh.regions:
        return None
    meshed = float(np.diff(mesh.nodes)[mesh.regions[segment.name]].sum())
    if abs(meshed - segment.length) <= OFF_MESH * mesh.nodes[-1]:
        return None
    allowed = f"must be the length of the mesh's region, {meshed:.9g} m"
    return Fault(f"beam.{segment.name}.length", segment.length, "m", allowed)


def _warn_of_steps(mesh: Mesh) -> None:
    """Warn of a mesh whose regions are the pieces of a beam, where the beam has one section."""
    pieces = [members for members in mesh.regions.values() if members.size]
    if len(pieces) > 1 and np.array_equal(np.sort(np.concatenate(pieces)), np.arange(mesh.elements)):
        names = ", ".join(mesh.regions)
        text = f"mesh.regions = {names}: the beam has one segment, and its section is taken in all of them; a stepped"
        warnings.warn(f"{text} beam has a segment of each name", InputWarning, stacklevel=4)


def _position(structure: Structure, mesh: Mesh, at: Position, key: str) -> float:
    # a name of the mesh is its place, also where a body has the same one
    if isinstance(at, str) and at not in mesh.points:
        at = structure.place_of(at)
    if not isinstance(at, str):
        tip = float(mesh.nodes[-1])
        return min(float(checked(key, at, quantity("m", at_least=0.0, at_most=tip * (1.0 + OFF_MESH)))), tip)
    if at not in mesh.points:
        # a body has no place before it is placed
        known = [*mesh.points, *(body.name for body in structure.masses if key != f"mass.{body.name}.at")]
        require(False, key, at, "", suggestion(at, known) + NAMED_IN_FILES)
    return float(mesh.points[at])


def _node(structure: Structure, mesh: Mesh, support: Support) -> int:
    nodes = mesh.nodes
    position = _position(structure, mesh, support.at, "support.at")
    node = int(np.argmin(np.abs(nodes - position)))
    at_node = abs(nodes[node] - position) <= SAME_PLACE * nodes[-1]
    require(at_node, "support.at", support.at, "", "must be a node of the mesh")
    return node


def _held_dofs(structure: Structure, mesh: Mesh) -> list[int]:
    held: set[int] = set()
    for support in structure.supports:
        node = _node(structure, mesh, support)
        held.update(2 * node + ("w", "slope").index(kind) for kind in SUPPORTS[support.kind])
    pinned = [float(mesh.nodes[dof // 2]) for dof in held if dof % 2 == 0]
    pinned += [
        _position(structure, mesh, spring.at, f"spring.{spring.name}.at") for spring in structure.springs_to_base
    ]
    apart = bool(pinned) and max(pinned) - min(pinned) > SAME_PLACE * mesh.nodes[-1]
    stiff = apart or (bool(pinned) and any(dof % 2 for dof in held)) or bool(structure.springs_to_base)
    allowed = "must hold two places of the mesh, or one place and a slope"
    require(stiff or not held, "supports", len(held), "held dofs", allowed)
    return sorted(held)


def _check_length(beam: Beam, mesh: Mesh) -> None:
    meshed = float(mesh.nodes[-1])
    if abs(meshed - beam.length) > OFF_MESH * beam.length:
        unlike = [fault for fault in map(partial(_length_fault, mesh), beam.segments) if fault is not None]
        if len(unlike) == 1 < len(beam.segments):
            raise InputError(unlike)
        allowed = f"must be the mesh's length, {meshed:.9g} m"
        raise InputError([Fault("beam.length", beam.length, "m", allowed)])
