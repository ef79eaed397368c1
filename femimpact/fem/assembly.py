"""From a structure and a mesh to the semi-discrete equations: the only weak forms of femimpact."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from skfem import BilinearForm
from skfem.helpers import dd, ddot

from femimpact.errors import InputWarning
from femimpact.fem.discretisation import Discretisation, ElementLineHermiteReference, discretise, kind_of
from femimpact.fem.mesh import Mesh
from femimpact.fem.stiffness_factor import stiffness_factor
from femimpact.structure.springs import Dashpot, Spring
from femimpact.structure.structure import SUPPORTS, Impactor, Stop, Structure
from femimpact.structure.unusual import unusual_numbers
from femimpact.system.contact_pair import contact_pair
from femimpact.system.damped import damped_with_modes
from femimpact.system.hermite import hermite_rows
from femimpact.system.matrices import Matrix
from femimpact.system.modes import Modes, first_elastic_frequency, first_mode_at, flexibility
from femimpact.system.own_terms import add_terms
from femimpact.system.reactions import Reaction
from femimpact.system.system import System, with_checked_fields

__all__ = ["ElementLineHermiteReference", "assemble", "assembled_with_modes"]

Array = NDArray[np.float64]

HEAVY = 1e3
"""Mass of a beam (kg) above which millimetres may have been typed as metres."""

SLENDER = 5.0
"""Length over thickness below which Euler-Bernoulli theory does not hold."""

USUAL_FREQUENCY = (0.01, 1e5)
"""First natural frequency (Hz) of structures that are meant."""


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
        a mesh from `read_mesh`.

    Returns
    -------
    System
        In the free dofs (w1, w1', w2, w2', ...), nodes from root to tip, slope positive as dw/dx.

    Raises
    ------
    InputError
        If neither or both of elements and mesh are given, the mesh does not fit the beam, or a
        name is unknown.

    Warns
    -----
    InputWarning
        Of numbers that may be in another unit: a beam of more than a tonne or less slender than 5, a first mode
        outside 0.01 Hz to 100 kHz, a modulus outside 1e8 to 2e12 Pa, a density outside 10 to 30,000 kg/m^3, a width or
        a gap beyond the beam's length, a ball heavier than beam and bodies, a body of more than 1000 beams. Of a mesh
        of several regions under a beam of one segment.

    Notes
    -----
    Sections: Hermite cubic interpolation, K = int EI w'' v'', M = int rho A w v + lumped terms
    m N N^T + J N' N'^T, with N + e N' for N where a body's centre is offset by e; rotary inertia of the beam and
    shear are left out, as in the paper. Both integrals are exact along a linear taper too (see `Discretisation`), so
    that frequencies keep order 4 in the element length; `femimpact.validation.tapers` has the exact ones of wedges.
    Gravity is a constant acceleration of every mass: constant_load = base_load gravity.
    """
    return assembled_with_modes(structure, elements, mesh, 1)[0]


def assembled_with_modes(
    structure: Structure, elements: int | None, mesh: Mesh | None, least: int
) -> tuple[System, Modes]:  # fmt: skip
    """The system of `assemble`, and so many of its undamped modes or as many as its damping refers to."""
    grid = discretise(structure, elements, mesh)
    K, M = _beam_matrices(grid)
    M = M + _lumped_mass(grid)
    springs = _connection_rows(grid, structure.springs, "spring")
    weight = np.sqrt([spring.stiffness for spring in structure.springs])
    pulls = sparse.csr_array(springs.multiply(weight[:, None]))
    K = K + sparse.csr_array(pulls.T @ pulls)
    free = grid.free
    rigid = np.zeros(grid.dofs)
    rigid[0::2] = 1.0
    momentum = M @ rigid
    system = System(
        M=_free_block(M, free),
        C=sparse.csr_array((free.size, free.size)),
        K=_free_block(K, free),
        stiffness_factor=sparse.vstack([stiffness_factor(grid), pulls], format="csr")[:, free],
        base_load=_frozen(momentum[free]),
        rigid_translation=_frozen(rigid[free]),
        nodes=grid.mesh.nodes,
        expansion=sparse.eye_array(grid.dofs, format="csr")[:, free],
        points=_points(grid),
        total_mass=float(rigid @ momentum),
        first_frequency=math.nan,
        rayleigh=(0.0, 0.0),
        constant_load=_frozen(structure.gravity * momentum[free]),
        reactions=_reactions(grid, M, K, momentum, springs),
        sections=grid.sections,
    )
    found, modes = _with_damping_and_contacts(system, grid, min(least, system.dofs))
    whole = _with_dashpots(found, grid)
    _warn_of_unusual(structure, first_elastic_frequency(whole))
    return whole, modes


def _warn_of_unusual(structure: Structure, first_frequency: float) -> None:
    """Warn where a number of the beam is so unusual that another unit may have been meant."""
    beam = structure.beam
    slenderness = beam.length / max(max(part.rectangle[1], part.end_rectangle[1]) for part in beam.segments)
    low, high = USUAL_FREQUENCY
    found = []
    if beam.mass > HEAVY:
        found.append(f"beam.mass = {beam.mass:.4g} kg: more than {HEAVY:g} kg; are lengths in metres?")
    if slenderness < SLENDER:
        found.append(
            f"beam.length = {slenderness:.3g} times the thickness: below {SLENDER:g}, where shear and rotary inertia, "
            "which are left out, are no longer small"
        )
    if not low <= first_frequency <= high:
        found.append(f"first mode at {first_frequency:.4g} Hz: outside {low:g} to {high:g} Hz; are units SI?")
    for words in (*found, *unusual_numbers(structure)):
        warnings.warn(words, InputWarning, stacklevel=3)


def _with_damping_and_contacts(system: System, grid: Discretisation, least: int) -> tuple[System, Modes]:
    structure = grid.structure
    system, modes = damped_with_modes(system, structure.damping, least)
    system = with_checked_fields(system, first_frequency=float(modes.natural_frequency[0]))
    items: tuple[Impactor | Stop, ...] = (*structure.impactors, *structure.stops)
    places = [grid.position_of(item.at, f"{kind_of(item)}.{item.name}.at") for item in items]
    rows = system.deflection_rows(places) if items else np.zeros((0, system.dofs))
    compliance = flexibility(system, rows)
    contacts = tuple(
        contact_pair(item, row, place, first_mode_at(system, modes, row), flexible, structure.gravity)
        for item, row, place, flexible in zip(items, rows, places, compliance, strict=True)
    )
    return replace(system, contacts=contacts, computed_together=None), modes


def _with_dashpots(system: System, grid: Discretisation) -> System:
    """The system with the dashpots' damping, and the forces of those to the base."""
    dashpots = grid.structure.dashpots
    if not dashpots:
        return system
    rows = _connection_rows(grid, dashpots, "dashpot")
    sizes = sparse.diags_array([dashpot.damping for dashpot in dashpots])
    damped = add_terms(system, damping=rows.T @ sizes @ rows)
    still = _frozen(np.zeros(system.dofs))
    forces = {
        f"{dashpot.name}.force": Reaction(None, "N", still, _frozen(-dashpot.damping * row), still, 0.0)
        for dashpot, row in zip(dashpots, rows[:, grid.free].toarray(), strict=True)
        if dashpot.to is None
    }
    return replace(damped, reactions={**damped.reactions, **forces}, computed_together=None)


def _connection_rows(grid: Discretisation, items: Sequence[Spring | Dashpot], kind: str) -> Any:
    """Rows (items, all dofs) that read the elongation w(at) - w(to) of springs or dashpots; w of the base is zero."""
    if not items:
        return sparse.csr_array((0, grid.dofs))

    def ends(field: str) -> Any:
        places = [
            (i, grid.position_of(place, f"{kind}.{item.name}.{field}"))
            for i, item in enumerate(items)
            if (place := getattr(item, field)) is not None
        ]
        chosen = sparse.csr_array(
            (np.ones(len(places)), ([i for i, _ in places], range(len(places)))), shape=(len(items), len(places))
        )
        return chosen @ hermite_rows(grid.mesh.nodes, [x for _, x in places])

    return sparse.csr_array(ends("at") - ends("to"))


def _reactions(grid: Discretisation, M: Matrix, K: Matrix, momentum: Array, springs: Matrix) -> dict[str, Reaction]:
    """Rows of the held dofs, by the name of their support; a dof that two supports hold has the first one's name.

    Springs to the base, with the rows of their elongation, pull the beam back: theirs is a force on it, too.
    """
    held: dict[int, str] = {}
    for support in grid.structure.supports:
        at = support.at if isinstance(support.at, str) else f"{support.at:.9g}"
        node = grid.node_of(support)
        for kind in SUPPORTS[support.kind]:
            held.setdefault(*((2 * node, f"{at}.force") if kind == "w" else (2 * node + 1, f"{at}.moment")))
    still = _frozen(np.zeros(grid.free.size))
    forces = {
        f"{spring.name}.force": Reaction(None, "N", still, still, _frozen(-spring.stiffness * row), 0.0)
        for spring, row in zip(grid.structure.springs, springs[:, grid.free].toarray(), strict=True)
        if spring.to is None
    }
    return forces | {
        name: Reaction(
            dof=dof,
            unit="N m" if dof % 2 else "N",
            on_acceleration=_held_row(M, dof, grid.free),
            on_velocity=still,
            on_displacement=_held_row(K, dof, grid.free),
            on_base_acceleration=float(momentum[dof]),
            constant=float(grid.structure.gravity * momentum[dof]),
        )
        for dof, name in sorted(held.items())
    }


def _held_row(matrix: Matrix, dof: int, free: NDArray[np.int64]) -> Array:
    rows: Any = sparse.csr_array(matrix)
    own = slice(rows.indptr[dof], rows.indptr[dof + 1])
    whole = np.zeros(rows.shape[1])
    np.add.at(whole, rows.indices[own], rows.data[own])
    return _frozen(whole[free])


def _beam_matrices(grid: Discretisation) -> tuple[Matrix, Matrix]:
    """K and M of the bare beam over all dofs, held ones included."""
    K = bending.assemble(grid.basis, bending_stiffness=grid.bending_stiffness)
    M = inertia.assemble(grid.basis, mass_per_length=grid.mass_per_length)
    return sparse.csr_array(K), sparse.csr_array(M)


def _lumped_mass(grid: Discretisation) -> Matrix:
    """M (N + e N')(N + e N')^T + J N' N'^T for every body with its centre at e from its place, over all dofs."""
    total = sparse.csr_array((grid.dofs, grid.dofs))
    for body in grid.structure.masses:
        place = [grid.position_of(body.at, f"mass.{body.name}.at")]
        shape, slope = (hermite_rows(grid.mesh.nodes, place, order) for order in (0, 1))
        centre = shape + body.offset * slope
        total = total + body.mass * (centre.T @ centre) + body.rotary_inertia * (slope.T @ slope)
    return total


def _free_block(matrix: Matrix, free: NDArray[np.int64]) -> Matrix:
    block = sparse.csr_array(matrix[free][:, free])
    block.eliminate_zeros()
    return block


def _points(grid: Discretisation) -> dict[str, float]:
    """Named places of the mesh, and of every body that is not itself such a name."""
    places = dict(grid.mesh.points)
    for body in grid.structure.masses:
        if body.name not in places:
            places[body.name] = grid.position_of(body.at, f"mass.{body.name}.at")
    return places


def _frozen(array: Array) -> Array:
    array = np.array(array, dtype=float)
    array.setflags(write=False)
    return array
