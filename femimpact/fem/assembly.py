"""From a structure and a mesh to the semi-discrete equations: the only weak forms of femimpact."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from skfem import Basis, BilinearForm, ElementLineHermite, MeshLine
from skfem.element import DiscreteField
from skfem.helpers import dd, ddot

from femimpact.errors import Fault, InputError, require, require_type, suggestion
from femimpact.fem.mesh import SAME_PLACE, Mesh, uniform_mesh
from femimpact.structure.damping import Rayleigh, rayleigh_coefficients
from femimpact.structure.structure import SUPPORTS, Beam, Impactor, Position, Segment, Stop, Structure
from femimpact.system.hermite import shape_functions
from femimpact.system.modes import solve_modes, solve_stiffness
from femimpact.system.system import System, contact_pair, hermite_rows

__all__ = ["ElementLineHermiteReference", "assemble"]


class ElementLineHermiteReference(ElementLineHermite):  # type: ignore[misc]
    """Cubic Hermite line element in reference coordinates, dofs (u, u_x).

    The stock element inverts a Vandermonde matrix in global coordinates and keeps it on the
    instance: it loses digits on fine or graded meshes and is wrong on a second mesh.
    """

    def gbasis(self, mapping: Any, X: NDArray[Any], i: int, tind: Any = None) -> tuple[DiscreteField]:
        """Basis function i and its derivatives by x at reference points X."""
        mesh = mapping.mesh
        t = mesh.t if tind is None else mesh.t[:, tind]
        length = (mesh.p[0, t[1]] - mesh.p[0, t[0]])[:, None]  # signed, so reversed elements are right
        s = X[0]
        if s.ndim == 1:
            s = np.broadcast_to(s, (t.shape[1], s.shape[0]))
        scale = length if i % 2 else 1.0
        value, slope, curvature, third = (scale * shape_functions(s, order)[i] / length**order for order in range(4))
        field = DiscreteField(value=value, grad=slope[None], hess=curvature[None, None], grad3=third[None, None, None])
        return (field,)


@BilinearForm  # type: ignore[untyped-decorator]
def bending(u: Any, v: Any, w: Any) -> Any:
    """Integral of EI u'' v''."""
    return w.bending_stiffness * ddot(dd(u), dd(v))


@BilinearForm  # type: ignore[untyped-decorator]
def inertia(u: Any, v: Any, w: Any) -> Any:
    """Integral of rho A u v."""
    return w.mass_per_length * u * v


def assemble(structure: Structure, elements: int | None = None, mesh: Mesh | None = None) -> System:
    """Euler-Bernoulli beam with consistent mass, lumped bodies, and one contact pair per ball.

    Parameters
    ----------
    structure : Structure
    elements : int
        Number of elements of a mesh made here; or
    mesh : Mesh
        a mesh of one's own, from `read_mesh`.

    Returns
    -------
    System
        In the free dofs (w1, w1', w2, w2', ...), nodes from root to tip, slope positive as dw/dx.

    Raises
    ------
    InputError
        If neither or both of elements and mesh are given, the mesh does not fit the beam, or a
        name is unknown.

    Notes
    -----
    Sections: Hermite cubic interpolation, K = int EI w'' v'', M = int rho A w v + lumped terms
    m N N^T + J N' N'^T; rotary inertia of the beam and shear are left out, as in the paper. Gravity is a constant
    acceleration of every mass: constant_load = base_load gravity.
    """
    require_type(structure, Structure, "structure")
    one = (elements is None) != (mesh is None)
    require(one, "mesh", None, "", "give either elements (a whole number) or a mesh")
    if mesh is not None:
        require_type(mesh, Mesh, "mesh")
    else:
        mesh = uniform_mesh(structure, elements)  # type: ignore[arg-type]
    _check_length(structure.beam, mesh)
    K, M = _beam_matrices(structure.beam, mesh)
    M = M + _lumped_mass(structure, mesh)
    free = _free_dofs(structure, mesh)
    rigid = np.zeros(2 * mesh.nodes.size)
    rigid[0::2] = 1.0
    momentum = M @ rigid
    system = System(
        M=_free_block(M, free),
        C=sparse.csr_array((free.size, free.size)),
        K=_free_block(K, free),
        stiffness_factor=_stiffness_factor(structure.beam, mesh)[:, free],
        base_load=_frozen(momentum[free]),
        rigid_translation=_frozen(rigid[free]),
        nodes=mesh.nodes,
        expansion=sparse.eye_array(2 * mesh.nodes.size, format="csr")[:, free],
        points=_points(structure, mesh),
        total_mass=float(rigid @ momentum),
        first_frequency=math.nan,
        rayleigh=(0.0, 0.0),
        constant_load=_frozen(structure.gravity * momentum[free]),
    )
    return _with_damping_and_contacts(system, structure, mesh)


def _with_damping_and_contacts(system: System, structure: Structure, mesh: Mesh) -> System:
    pair = structure.damping.modes if structure.damping else None
    count = max(pair) if pair else 1
    require(
        count <= system.dofs,
        "damping.modes",
        pair,
        "",
        f"must be at most {system.dofs}, the dofs of this mesh: use more elements",
    )
    modes = solve_modes(system, count)
    alpha, beta = 0.0, 0.0
    if structure.damping is not None:
        alpha, beta = _rayleigh(structure.damping, 2.0 * math.pi * modes.natural_frequency)
    system = replace(
        system,
        C=sparse.csr_array(alpha * system.M + beta * system.K) if structure.damping else system.C,
        rayleigh=(alpha, beta),
        first_frequency=float(modes.natural_frequency[0]),
        computed_together=None,
    )
    items: tuple[Impactor | Stop, ...] = (*structure.impactors, *structure.stops)
    places = [_position(item.at, mesh, f"{_kind(item)}.{item.name}.at") for item in items]
    rows = system.deflection_rows(places) if items else np.zeros((0, system.dofs))
    flexibility = _flexibility(system, rows)
    contacts = tuple(
        contact_pair(item, row, place, float(row @ modes.vectors[:, 0]), flexible, structure.gravity)
        for item, row, place, flexible in zip(items, rows, places, flexibility, strict=True)
    )
    return replace(system, contacts=contacts, computed_together=None)


def _kind(item: Impactor | Stop) -> str:
    return "stop" if isinstance(item, Stop) else "impactor"


def _flexibility(system: System, rows: NDArray[Any]) -> NDArray[Any]:
    """b^T K^-1 b (m/N) of every row, through the stiffness factor so that fine meshes keep their digits."""
    if rows.size == 0:
        return np.zeros(0)
    solved = solve_stiffness(system, rows.T)
    return np.asarray(np.einsum("ji,ij->j", rows, solved))


def _rayleigh(damping: Rayleigh, omega: NDArray[Any]) -> tuple[float, float]:
    ratio = damping.ratio if isinstance(damping.ratio, tuple) else (damping.ratio, damping.ratio)
    if damping.modes:
        first, second = damping.modes
        return rayleigh_coefficients((omega[first - 1], omega[second - 1]), ratio)
    low, high = damping.frequencies or (0.0, 0.0)
    return rayleigh_coefficients((2 * math.pi * low, 2 * math.pi * high), ratio)


def _sections(beam: Beam, mesh: Mesh) -> tuple[NDArray[Any], NDArray[Any]]:
    """EI (N m^2) and rho A (kg/m) of every element."""
    bending_stiffness, mass_per_length = np.empty(mesh.elements), np.empty(mesh.elements)
    for segment, members in _segments_on_mesh(beam, mesh):
        bending_stiffness[members] = segment.bending_stiffness
        mass_per_length[members] = segment.mass_per_length
    return bending_stiffness, mass_per_length


def _stiffness_factor(beam: Beam, mesh: Mesh) -> Any:
    """G with K = G^T G: sqrt(EI h/2) w'' at the two Gauss points, which integrate w''^2 exactly."""
    lengths = np.diff(mesh.nodes)
    weight = np.sqrt(0.5 * lengths * _sections(beam, mesh)[0])
    middles = 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])
    points = middles[:, None] + lengths[:, None] * np.array([-1.0, 1.0]) / (2.0 * math.sqrt(3.0))
    curvature = hermite_rows(mesh.nodes, points.ravel(), derivative=2)
    return sparse.csr_array(sparse.diags_array(np.repeat(weight, 2)) @ curvature)


def _beam_matrices(beam: Beam, mesh: Mesh) -> tuple[Any, Any]:
    """K and M of the bare beam over all dofs, held ones included."""
    bending_stiffness, mass_per_length = _sections(beam, mesh)
    # degree 6 integrates the product of two cubics exactly
    basis = Basis(MeshLine(mesh.nodes), ElementLineHermiteReference(), intorder=6)
    each = basis.zero_w()
    K = bending.assemble(basis, bending_stiffness=bending_stiffness[:, None] + each)
    M = inertia.assemble(basis, mass_per_length=mass_per_length[:, None] + each)
    return sparse.csr_array(K), sparse.csr_array(M)


def _segments_on_mesh(beam: Beam, mesh: Mesh) -> Iterable[tuple[Segment, NDArray[Any]]]:
    """Each segment with the elements it fills, checked to cover the mesh once and to be as long."""
    if len(beam.segments) == 1:
        return [(beam.segments[0], np.arange(mesh.elements))]
    result, lengths = [], np.diff(mesh.nodes)
    for segment in beam.segments:
        known = segment.name in mesh.regions
        require(known, "mesh.regions", segment.name, "", suggestion(segment.name, mesh.regions))
        members = mesh.regions[segment.name]
        meshed = float(lengths[members].sum())
        fits = abs(meshed - segment.length) <= 1e-6 * beam.length
        allowed = f"must be the length of the mesh's region, {meshed:.9g} m"
        require(fits, f"beam.{segment.name}.length", segment.length, "m", allowed)
        result.append((segment, members))
    covered = np.sort(np.concatenate([members for _, members in result]))
    whole = bool(np.array_equal(covered, np.arange(mesh.elements)))
    require(whole, "mesh.regions", None, "", "must cover every element once")
    return result


def _lumped_mass(structure: Structure, mesh: Mesh) -> Any:
    """M N N^T + J N' N'^T for every point mass, over all dofs."""
    size = 2 * mesh.nodes.size
    total = sparse.csr_array((size, size))
    for body in structure.masses:
        place = [_position(body.at, mesh, f"mass.{body.name}.at")]
        shape, slope = (hermite_rows(mesh.nodes, place, order) for order in (0, 1))
        total = total + body.mass * (shape.T @ shape) + body.rotary_inertia * (slope.T @ slope)
    return total


def _free_dofs(structure: Structure, mesh: Mesh) -> NDArray[Any]:
    held: set[int] = set()
    for support in structure.supports:
        position = _position(support.at, mesh, "support.at")
        node = int(np.argmin(np.abs(mesh.nodes - position)))
        at_node = abs(mesh.nodes[node] - position) <= SAME_PLACE * mesh.nodes[-1]
        require(at_node, "support.at", support.at, "", "must be a node of the mesh")
        held.update(2 * node + ("w", "slope").index(kind) for kind in SUPPORTS[support.kind])
    deflections = sum(dof % 2 == 0 for dof in held)
    stiff = deflections >= 2 or (deflections == 1 and len(held) >= 2)
    require(stiff, "supports", len(held), "held dofs", "must hold two places of the mesh, or one place and a slope")
    return np.setdiff1d(np.arange(2 * mesh.nodes.size), sorted(held))


def _free_block(matrix: Any, free: NDArray[Any]) -> Any:
    block = sparse.csr_array(matrix[free][:, free])
    block.eliminate_zeros()
    return block


def _position(at: Position, mesh: Mesh, key: str) -> float:
    if not isinstance(at, str):
        return min(float(at), float(mesh.nodes[-1]))
    require(at in mesh.points, key, at, "", suggestion(at, mesh.points))
    return float(mesh.points[at])


def _points(structure: Structure, mesh: Mesh) -> dict[str, float]:
    """Named places of the mesh, and of every body and ball that is not itself such a name."""
    pairs: tuple[Impactor | Stop, ...] = (*structure.impactors, *structure.stops)
    for item in pairs:
        free = item.name not in mesh.points
        require(free, f"{_kind(item)}.{item.name}.name", item.name, "", "must not be the name of a point of the mesh")
    places = dict(mesh.points)
    for body in structure.masses:
        if body.name not in places:
            places[body.name] = _position(body.at, mesh, f"mass.{body.name}.at")
    return places


def _check_length(beam: Beam, mesh: Mesh) -> None:
    meshed = float(mesh.nodes[-1])
    if abs(meshed - beam.length) > 1e-6 * beam.length:
        allowed = f"must be the mesh's length, {meshed:.9g} m"
        raise InputError([Fault("beam.length", beam.length, "m", allowed)])


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array = np.array(array, dtype=float)
    array.setflags(write=False)
    return array
