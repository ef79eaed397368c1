"""Assembly of the semi-discrete equations of a structure on a mesh."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from skfem import BilinearForm
from skfem.helpers import d, dd, ddd, ddot, dot, grad

from femimpact.arrays import Array, own
from femimpact.errors import InputWarning
from femimpact.fem.axial import axial_forces, weight_words
from femimpact.fem.discretisation import Discretisation, discretise
from femimpact.fem.mesh import Mesh
from femimpact.structure.axial import Axial
from femimpact.structure.structure import (
    SUPPORTS,
    Absorber,
    Dashpot,
    Impactor,
    Spring,
    Stop,
    Structure,
    unusual_numbers,
)
from femimpact.system.added_terms import add_terms
from femimpact.system.contact_pair import ContactPair, contact_pair, meeting_pairs
from femimpact.system.hermite import Reaction, hermite_rows
from femimpact.system.matrices import Matrix, factor_of_sum
from femimpact.system.modes import (
    Modes,
    damped_with_modes,
    first_elastic_frequency,
    first_mode_at,
    flexibility,
)
from femimpact.system.system import System, computed_system, with_checked_fields


@BilinearForm  # type: ignore[untyped-decorator]
def bending(u: Any, v: Any, w: Any) -> Any:
    """Integral of EI u'' v''."""
    return w.bending_stiffness * ddot(dd(u), dd(v))


@BilinearForm  # type: ignore[untyped-decorator]
def inertia(u: Any, v: Any, w: Any) -> Any:
    """Integral of rho A u v."""
    return w.mass_per_length * u * v


@BilinearForm  # type: ignore[untyped-decorator]
def tilting(u: Any, v: Any, w: Any) -> Any:
    """Integral of N u' v'."""
    return w.normal_force * dot(grad(u), grad(v))


@BilinearForm  # type: ignore[untyped-decorator]
def shear(u: Any, v: Any, w: Any) -> Any:
    """Integral of k G A gamma^2, with gamma = -l^2 times the third derivative and l^2 = EI/(kGA)."""
    return w.shear_bending * ddd(u)[0, 0, 0] * ddd(v)[0, 0, 0]


@BilinearForm  # type: ignore[untyped-decorator]
def turning(u: Any, v: Any, w: Any) -> Any:
    """Integral of rho I t t', with the turn t = dw/dx - gamma."""
    turn, other = (d(each)[0] + w.length_squared * ddd(each)[0, 0, 0] for each in (u, v))
    return w.rotary_inertia * turn * other


class Entries(NamedTuple):
    """Entries of a matrix over all dofs of a basis, held ones included; those at one place are summed."""

    row: NDArray[np.integer[Any]]  # (entries,)
    column: NDArray[np.integer[Any]]  # (entries,)
    value: Array  # (entries,)

    def times(self, vector: Array) -> Array:
        """The matrix times a vector (dofs,)."""
        return np.asarray(np.bincount(self.row, self.value * vector[self.column], vector.size), dtype=float)

    def row_of(self, dof: int, dofs: int) -> Array:
        """One row of the matrix, (dofs,)."""
        here = self.row == dof
        return np.asarray(np.bincount(self.column[here], self.value[here], dofs), dtype=float)

    def on(self, free: NDArray[np.int64], dofs: int) -> Matrix:
        """The matrix on the free ones of so many dofs."""
        number = np.full(dofs, -1)
        number[free] = np.arange(free.size)
        row, column = number[self.row], number[self.column]
        inside = (row >= 0) & (column >= 0)
        places = row[inside], column[inside]
        block: Matrix = sparse.csr_array((self.value[inside], places), shape=(free.size, free.size))
        block.eliminate_zeros()
        return block


def joined(*parts: Entries) -> Entries:
    """Entries of the sum of matrices."""
    return Entries(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def beam_matrices(grid: Discretisation) -> tuple[Entries, Entries]:
    """K and M of the bare beam over all dofs, with shear and rotary inertia where it shears."""
    sections, basis = grid.sections, grid.basis
    stiffness = sections.bending_stiffness * sections.bending_polynomial
    mass = sections.mass_per_length * sections.mass_polynomial
    K, M = _weighted(bending, "bending_stiffness", basis, stiffness), _weighted(inertia, "mass_per_length", basis, mass)
    if sections.shear_length is None:
        return K, M
    squared = grid.at_quadrature(sections.shear_length**2)
    bent, turned = grid.bending_stiffness * squared, np.where(squared > 0.0, grid.rotary_inertia, 0.0)
    strained = shear.coo_data(basis, shear_bending=bent)
    inert = turning.coo_data(basis, length_squared=squared, rotary_inertia=turned)
    more = [Entries(part.indices[0], part.indices[1], part.data) for part in (strained, inert)]
    return joined(K, more[0]), joined(M, more[1])


def _weighted(form: Any, name: str, basis: Any, coefficients: Array) -> Entries:
    """A form whose coefficient is a polynomial in every element: (powers, elements), by powers of x = 2 s - 1."""
    powers = [power for power, coefficient in enumerate(coefficients) if coefficient.any()] or [0]
    parts = [_integrals(form, name, basis, power) for power in powers]
    row, column, _ = parts[0]
    value = sum(coefficients[power] * part.value for power, part in zip(powers, parts, strict=True))
    return Entries(row, column, np.ravel(value))


@lru_cache(maxsize=16)
def _integrals(form: Any, name: str, basis: Any, power: int) -> Entries:
    """Entries of a form whose coefficient is x^power, with x from -1 to 1 in every element.

    Their value is (16, elements): a coefficient of each element may multiply it. Structures on one mesh share them.
    """
    x = 2.0 * basis.X[0] - 1.0 + basis.zero_w()
    integrals = form.coo_data(basis, **{name: x**power})
    row, column = integrals.indices
    entries = Entries(row, column, integrals.data.reshape(-1, basis.nelems))
    for array in entries:
        array.setflags(write=False)
    return entries


def stiffness_factor(grid: Discretisation) -> Matrix:  # csr_array (2 elements, dofs) sqrt(N m) per unit of a dof
    """G with K = G^T G over all dofs: sqrt(weight) w'' at two points of every element, and its share of shear.

    The energy of an element is the integral of EI w''^2 with w'' linear. The two Gauss points of the weight EI itself
    integrate any cubic times EI exactly, so that G has two rows for each element whether it tapers or not, and K is
    that of the weak form to rounding. Where EI is constant they are the usual Gauss points. More of those would be
    exact too, as the degree of EI w''^2 is 6 (four points), with twice the rows for the same rank.
    """
    nodes, sections = grid.mesh.nodes, grid.sections
    lengths = np.diff(nodes)
    places, shares = _gauss_points(sections.bending_polynomial)
    weight = np.sqrt(lengths[:, None] * sections.bending_stiffness[:, None] * shares)
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    points = middles[:, None] + lengths[:, None] * places / (2.0 * math.sqrt(3.0))
    shears = sections.shear_length
    curvature = hermite_rows(nodes, points.ravel(), derivative=2, shear_lengths=shears)
    # four entries in each row
    curvature.data *= np.repeat(weight.ravel(), 4)
    if shears is None:
        return curvature
    third = hermite_rows(nodes, middles, derivative=3, shear_lengths=shears)
    third.data *= np.repeat(shears * np.sqrt(lengths * sections.bending_stiffness), 4)
    return sparse.vstack([curvature, third[shears > 0.0]], format="csr")


def _gauss_points(polynomial: Array) -> tuple[Array, Array]:
    """Two Gauss points of half a polynomial (5, elements) in x = -1 to 1, and their weights, (elements, 2) each.

    It is the weight, positive and 1 at x = 0.

    The points are in 1/sqrt(3), so that those of a constant weight are -1 and 1 to the last bit. They are the
    eigenvalues of the Jacobi matrix of the first two orthogonal polynomials, and the weights are the squared first
    components of its eigenvectors times the integral of the weight (Golub and Welsch, 1969).
    """
    _, c1, c2, c3, c4 = polynomial
    m0, m1 = 1.0 + c2 / 3.0 + c4 / 5.0, c1 / 3.0 + c3 / 5.0
    m2, m3 = 1.0 / 3.0 + c2 / 5.0 + c4 / 7.0, c1 / 5.0 + c3 / 7.0
    first = m1 / m0
    variance = m2 / m0 - first**2
    second = (m3 - 2.0 * first * m2 + first**2 * m1) / (m0 * variance)
    half = 0.5 * (second - first)
    spread = np.sqrt(1.0 + 3.0 * (half**2 + (variance - 1.0 / 3.0)))
    middle, lean = math.sqrt(3.0) * 0.5 * (first + second), math.sqrt(3.0) * half / spread
    places = np.stack([middle - spread, middle + spread], axis=1)
    return places, 0.5 * m0[:, None] * np.stack([1.0 + lean, 1.0 - lean], axis=1)


HEAVY = 1e3
"""Mass of a beam (kg) above which millimetres may have been typed as metres."""

USUAL_FREQUENCY = (0.01, 1e5)
"""First natural frequency (Hz) of structures that are meant."""


def assemble(structure: Structure, elements: int | None = None, mesh: Mesh | None = None) -> System:
    """Euler-Bernoulli beam with consistent mass, lumped bodies, and one contact pair per ball, absorber and stop.

    Parameters
    ----------
    elements : int
        Number of elements of a mesh made here; or
    mesh : Mesh
        a mesh from `read_mesh`.

    Returns
    -------
    System
        In the free dofs (w1, w1', w2, w2', ...), nodes from root to tip, slope positive as dw/dx. Where the beam
        shears w' stands for the turn of the section, also in bodies and supports: clamped is no turn.

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
        of several regions under a beam of one segment. Of the balls' weight along the beam (`Axial`).

    Notes
    -----
    Sections: Hermite cubic interpolation, K = int EI w'' v'', M = int rho A w v + lumped terms
    m N N^T + J N' N'^T, with N + e N' for N where a body's centre is offset by e; rotary inertia of the beam and
    shear are left out, as in the paper, of segments without a shear modulus. Both integrals are exact along a linear
    taper too (see `Discretisation`), so that frequencies keep order 4 in the element length (Strang and Fix, 1973);
    `femimpact.validation.beams` has the exact ones of wedges. Segments with a shear modulus have both by
    interdependent interpolation (`femimpact.system.hermite.shape_functions`): static states under loads at
    nodes are exact, and frequencies have order 2 once elements are shorter than sqrt(EI/(kGA)). Gravity is a constant
    acceleration of every mass: constant_load = base_load gravity. A load along the beam adds to K what `Axial`
    says.
    """
    return assembled_with_modes(structure, elements, mesh, 1)[0]


def assembled_with_modes(
    structure: Structure, elements: int | None, mesh: Mesh | None, least: int
) -> tuple[System, Modes]:  # fmt: skip
    """The system of `assemble`, and so many of its undamped modes or as many as its damping refers to."""
    grid = discretise(structure, elements, mesh)
    bare = _undamped(grid)
    damped, modes = damped_with_modes(bare, structure.damping, min(least, bare.dofs))
    contacts = _contacts(damped, grid, modes)
    complete = with_checked_fields(damped, first_frequency=float(modes.natural_frequency[0]), contacts=contacts)
    for words in unusual_words(structure, complete):
        warnings.warn(words, InputWarning, stacklevel=3)
    return _with_dashpots(complete, grid), modes


def _undamped(grid: Discretisation) -> System:
    """The system without damping and contacts, before its first frequency is known."""
    K, beam_mass = beam_matrices(grid)
    numbers = [(body.mass, body.rotary_inertia, body.offset) for body in grid.structure.masses]
    M, factor, springs = joined(beam_mass, _on_bodies(grid, numbers)), stiffness_factor(grid), grid.structure.springs
    if springs:
        rows = _connection_rows(grid, springs, "spring")
        pulls = sparse.diags_array(np.sqrt([spring.stiffness for spring in springs])) @ rows
        pull = (pulls.T @ pulls).tocoo()
        K = joined(K, Entries(pull.coords[0], pull.coords[1], pull.data))
        factor = sparse.vstack([factor, pulls], format="csr")
    free, rigid = grid.free, np.zeros(grid.dofs)
    rigid[0::2] = 1.0
    factor = factor[:, free]
    if grid.structure.axial is not None:
        added = _axial_stiffness(grid, grid.structure.axial, beam_mass)
        K = joined(K, added)
        factor = factor_of_sum("axial", factor, added.on(free, grid.dofs), K.on(free, grid.dofs))
    momentum = M.times(rigid)
    load = own(grid.structure.gravity * momentum[free])
    return computed_system(
        M=M.on(free, grid.dofs),
        C=sparse.csr_array((free.size, free.size)),
        K=K.on(free, grid.dofs),
        stiffness_factor=factor,
        base_load=own(momentum[free]),
        rigid_translation=own(rigid[free]),
        nodes=grid.mesh.nodes,
        expansion=_expansion(grid),
        points=_points(grid),
        total_mass=float(rigid @ momentum),
        first_frequency=math.nan,
        rayleigh=(0.0, 0.0),
        constant_load=load,
        reactions={**_forces_to_base(grid, springs, "spring"), **_reactions(grid, M, K, momentum)},
        sections=grid.sections,
    )


def _axial_stiffness(grid: Discretisation, load: Axial, beam_mass: Entries) -> Entries:
    """What a load along the beam adds to K, over all dofs."""
    lag = load.spin**2 if load.spin_plane == "lag" else 0.0
    force, on_bodies = axial_forces(grid, load, lag)
    beam = _weighted(tilting, "normal_force", grid.basis, force)
    return joined(beam, _on_bodies(grid, on_bodies), beam_mass._replace(value=-lag * beam_mass.value))


def _expansion(grid: Discretisation) -> Matrix:
    """Matrix from the free dofs to all, (dofs, free dofs)."""
    count = grid.free.size
    first = np.searchsorted(grid.free, np.arange(grid.dofs + 1))
    return sparse.csr_array((np.ones(count), np.arange(count), first), shape=(grid.dofs, count))


def unusual_words(structure: Structure, system: System) -> list[str]:
    """Words on numbers of an assembled structure that may be meant in another unit, and on a weight left out."""
    beam, first_frequency = structure.beam, first_elastic_frequency(system)
    low, high = USUAL_FREQUENCY
    notes = []
    if beam.mass > HEAVY:
        notes.append(f"beam.mass = {beam.mass:.4g} kg: more than {HEAVY:g} kg; are lengths in metres?")
    if not low <= first_frequency <= high:
        notes.append(f"first mode at {first_frequency:.4g} Hz: outside {low:g} to {high:g} Hz; are units SI?")
    return [*notes, *map(str, unusual_numbers(structure)), *weight_words(structure, system)]


def _contacts(system: System, grid: Discretisation, modes: Modes) -> tuple[ContactPair, ...]:
    """The pairs of balls, absorbers and stops, with what they take from stiffness and first mode."""
    structure = grid.structure
    items: tuple[Impactor | Absorber | Stop, ...] = (*structure.impactors, *structure.absorbers, *structure.stops)
    places = [grid.position_of(item.at, f"{type(item).__name__.lower()}.{item.name}.at") for item in items]
    rows = np.array([system.point_row(place) for place in places]).reshape(len(items), system.dofs)
    compliance = flexibility(system, rows)
    pairs = tuple(
        contact_pair(item, row, place, first_mode_at(system, modes, row), flexible, structure.gravity)
        for item, row, place, flexible in zip(items, rows, places, compliance, strict=True)
    )
    return (*pairs, *meeting_pairs(structure.meetings, pairs))


def _with_dashpots(system: System, grid: Discretisation) -> System:
    """The system with the dashpots' damping, and the forces of those to the base."""
    dashpots = grid.structure.dashpots
    if not dashpots:
        return system
    rows = _connection_rows(grid, dashpots, "dashpot")
    sizes = sparse.diags_array([dashpot.damping for dashpot in dashpots])
    damped = add_terms(system, damping=rows.T @ sizes @ rows)
    reactions = {**damped.reactions, **_forces_to_base(grid, dashpots, "dashpot")}
    return with_checked_fields(damped, reactions=reactions)


def _connection_rows(grid: Discretisation, items: Sequence[Spring | Dashpot], kind: str) -> Any:
    """Rows (items, all dofs) that read the elongation w(at) - w(to) of springs or dashpots; w of the base is zero."""

    def ends(field: str) -> Any:
        places = [
            (i, grid.position_of(place, f"{kind}.{item.name}.{field}"))
            for i, item in enumerate(items)
            if (place := getattr(item, field)) is not None
        ]
        chosen = sparse.csr_array(
            (np.ones(len(places)), ([i for i, _ in places], range(len(places)))), shape=(len(items), len(places))
        )
        return chosen @ grid.rows([x for _, x in places])

    return sparse.csr_array(ends("at") - ends("to"))


def _reactions(grid: Discretisation, M: Entries, K: Entries, momentum: Array) -> dict[str, Reaction]:
    """Rows of the held dofs, by the name of their support; a dof that two supports hold has the first one's name."""
    held: dict[int, str] = {}
    for support in grid.structure.supports:
        at = support.at if isinstance(support.at, str) else f"{support.at:.9g}"
        node = grid.node_of(support)
        for kind in SUPPORTS[support.kind]:
            held.setdefault(*((2 * node, f"{at}.force") if kind == "w" else (2 * node + 1, f"{at}.moment")))
    still = own(np.zeros(grid.free.size))
    return {
        name: Reaction(
            dof=dof,
            unit="N m" if dof % 2 else "N",
            on_acceleration=own(M.row_of(dof, grid.dofs)[grid.free]),
            on_velocity=still,
            on_displacement=own(K.row_of(dof, grid.dofs)[grid.free]),
            on_base_acceleration=float(momentum[dof]),
            constant=float(grid.structure.gravity * momentum[dof]),
        )
        for dof, name in sorted(held.items())
    }


def _forces_to_base(grid: Discretisation, items: Sequence[Spring | Dashpot], kind: str) -> dict[str, Reaction]:
    """Forces of springs or dashpots on the beam, of those to the base: they pull it back by their elongation."""
    to_base = [item for item in items if item.to is None]
    if not to_base:
        return {}
    still = own(np.zeros(grid.free.size))
    forces = {}
    for item, row in zip(to_base, _connection_rows(grid, to_base, kind)[:, grid.free].toarray(), strict=True):
        if isinstance(item, Dashpot):
            on_velocity, on_displacement = own(-item.damping * row), still
        else:
            on_velocity, on_displacement = still, own(-item.stiffness * row)
        forces[f"{item.name}.force"] = Reaction(None, "N", still, on_velocity, on_displacement, 0.0)
    return forces


def _on_bodies(grid: Discretisation, numbers: Sequence[tuple[float, float, float]]) -> Entries:
    """Mass m (N + e N')(N + e N')^T + J N' N'^T for every body by its (m, J, e), e from its place, over all dofs."""
    bodies = grid.structure.masses
    places = [grid.position_of(body.at, f"mass.{body.name}.at") for body in bodies]
    shape, slope = (grid.rows(places, order) for order in (0, 1))
    mass, inertia, offset = np.array(numbers).reshape(-1, 3).T[:, :, None]
    # four dofs of each body, those of the element that holds it
    dof, turn = shape.indices.reshape(-1, 4), slope.data.reshape(-1, 4)
    centre = shape.data.reshape(-1, 4) + offset * turn
    value = (mass * centre)[:, :, None] * centre[:, None, :] + (inertia * turn)[:, :, None] * turn[:, None, :]
    return Entries(np.repeat(dof, 4), np.tile(dof, 4).ravel(), value.ravel())


def _points(grid: Discretisation) -> dict[str, float]:
    """Named places of the mesh, and of every body that is not itself such a name."""
    places = dict(grid.mesh.points)
    for body in grid.structure.masses:
        if body.name not in places:
            places[body.name] = grid.position_of(body.at, f"mass.{body.name}.at")
    return places
