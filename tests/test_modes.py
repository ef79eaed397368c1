"""Natural modes against exact solutions of the Euler-Bernoulli beam, and what they mean for a moving base."""

import math

import numpy as np
import pytest
from scipy.linalg import block_diag, eigh
from scipy.optimize import brentq

import femimpact as fi

BEAM = {"length": 0.3, "width": 0.02, "thickness": 1e-3, "young_modulus": 70e9, "density": 2700.0}
BENDING_STIFFNESS = 70e9 * 0.02 * 1e-3**3 / 12
MASS_PER_LENGTH = 2700.0 * 0.02 * 1e-3


def roots(function, start, end, count, points=20_000):
    """The first `count` sign changes of a function, each by Brent's method."""
    grid = np.linspace(start, end, points)
    values = np.array([function(x) for x in grid])
    places = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))[:count]
    assert places.size == count
    return np.array([brentq(function, grid[i], grid[i + 1], xtol=1e-15, rtol=1e-15) for i in places])


def exact_cantilever(mass_ratio, inertia_ratio, count):
    """Roots lambda = beta L of the clamped beam with a body at its tip.

    phi = (cosh - cos) + b (sinh - sin); at the tip, with L = 1: phi'' = lambda^4 J phi', phi''' = -lambda^4 m phi,
    m and J over the beam's own mass (times length squared). The determinant is divided by cosh^2.
    """

    def determinant(x):
        c, s = math.cos(x) / math.cosh(x), math.sin(x) / math.cosh(x)
        t = math.tanh(x)
        even, odd = (1 - c, t + s, 1 + c, t - s), (t - s, 1 - c, t + s, 1 + c)  # value, slope, curvature, its slope
        moment = [f[2] - x**3 * inertia_ratio * f[1] for f in (even, odd)]
        shear = [f[3] + x * mass_ratio * f[0] for f in (even, odd)]
        return (moment[0] * shear[1] - moment[1] * shear[0]) / (1 + x**3 * inertia_ratio) / (1 + x * mass_ratio)

    return roots(determinant, 0.05, 4.0 * count, count)


def frequency_of_root(root, length=BEAM["length"]):
    return (root / length) ** 2 * math.sqrt(BENDING_STIFFNESS / MASS_PER_LENGTH) / (2 * math.pi)


def cantilever(mass_ratio=0.0, inertia_ratio=0.0, **more):
    beam = fi.Beam.uniform(**BEAM)
    masses = []
    if mass_ratio or inertia_ratio:
        mass, inertia = mass_ratio * beam.mass, inertia_ratio * beam.mass * beam.length**2
        masses = [fi.PointMass("box", "tip", mass, inertia)]
    return fi.Structure(beam, masses=masses, **more)


@pytest.mark.parametrize(("mass_ratio", "inertia_ratio"), [(0.0, 0.0), (0.5, 0.0), (2.0, 0.05), (0.1, 0.4)])
def test_six_modes_of_a_cantilever_with_a_heavy_and_rotating_tip_are_exact(mass_ratio, inertia_ratio):
    exact = frequency_of_root(exact_cantilever(mass_ratio, inertia_ratio, 6))
    modes = fi.solve_modes(fi.assemble(cantilever(mass_ratio, inertia_ratio), elements=200), 6)
    # the discretisation's frequency error (lambda/N)^4/1440 is 3.9e-8 at the sixth mode's lambda = 17.3
    np.testing.assert_allclose(modes.natural_frequency, exact, rtol=5e-8)


@pytest.mark.parametrize("elements", [1, 2, 5, 10, 31, 50, 200, 1000, 2000])
def test_first_frequency_stays_exact_from_one_element_to_two_thousand(elements):
    root = exact_cantilever(1.5, 0.01, 1)[0]
    computed = fi.solve_modes(fi.assemble(cantilever(1.5, 0.01), elements=elements), 1).natural_frequency[0]
    error = computed / frequency_of_root(root) - 1
    # half the eigenvalue's error (lambda h)^4/720, doubled for the coarsest meshes; 1e-8 is what rounding may take
    # (an assembled stiffness would lose 3e-4 at N = 2000)
    assert -1e-8 < error < (root / elements) ** 4 / 720 + 1e-8


@pytest.mark.parametrize(
    ("supports", "exact"),
    [
        ((("pinned", "root"), ("pinned", "tip")), np.pi * np.arange(1, 6)),
        ((("clamped", "root"), ("clamped", "tip")), [4.73004074, 7.85320462, 10.9956078, 14.1371655, 17.2787597]),
        ((("clamped", "root"), ("pinned", "tip")), [3.92660231, 7.06858275, 10.2101761, 13.3517688, 16.4933614]),
        ((("pinned", "root"), ("guided", "tip")), np.pi * (np.arange(1, 6) - 0.5)),
        ((("clamped", "root"), ("pinned", 0.15), ("clamped", "tip")), [7.85320462, 9.46008149]),
    ],
)
def test_other_supports_have_their_textbook_frequencies(supports, exact):
    structure = cantilever(supports=[fi.Support(*support) for support in supports])
    modes = fi.solve_modes(fi.assemble(structure, elements=200), len(exact))
    # Blevins's roots have 9 digits (squared: 4e-9); (lambda/N)^4/1440 with lambda = 17.3 is 4e-8
    # pinned in its middle as well: two halves clamped-pinned (2 x 3.9266) or clamped-clamped (2 x 4.7300)
    exact = np.array(exact)
    np.testing.assert_allclose(modes.natural_frequency, frequency_of_root(exact), rtol=1e-7)


@pytest.mark.parametrize("elements", [20, 100])
def test_modes_are_orthonormal_in_mass_and_diagonal_in_stiffness(elements):
    system = fi.assemble(cantilever(0.5, 0.02), elements=elements)
    modes = fi.solve_modes(system, 12)
    phi, omega = modes.vectors, 2 * np.pi * modes.natural_frequency
    # the eigensolver's residual, with the modes 1 apart in norm
    np.testing.assert_allclose(phi.T @ (system.M @ phi), np.eye(12), rtol=0, atol=1e-9)
    stiffness = phi.T @ (system.K @ phi) / np.outer(omega, omega)
    # relative to both frequencies; mode 1 against mode 12 (1000 times faster) keeps fewer digits
    np.testing.assert_allclose(stiffness, np.eye(12), rtol=0, atol=1e-7)
    tip = system.point_row("tip") @ phi
    assert np.all(tip > 0)


@pytest.mark.parametrize("reader", ["damping_ratio", "participation_factor", "effective_mass", "vectors"])
def test_modes_are_read_only(reader):
    modes = fi.solve_modes(fi.assemble(cantilever(), elements=4), 2)
    with pytest.raises(ValueError, match="read-only"):
        getattr(modes, reader)[...] = 0.0


def test_effective_masses_of_all_modes_sum_to_what_the_free_dofs_carry():
    for elements in (5, 40):
        system = fi.assemble(cantilever(0.5, 0.02), elements=elements)
        total = fi.solve_modes(system, system.dofs).effective_mass.sum()
        exact = system.base_load @ np.linalg.solve(system.M.toarray(), system.base_load)
        # completeness of the modes: phi phi^T = M^-1, up to the rounding of 80 terms
        assert total == pytest.approx(exact, rel=1e-10)
        assert total < system.total_mass


def test_the_published_frequencies_without_the_ball_and_with_the_ball_glued(reference):
    without = fi.solve_modes(fi.assemble(reference, elements=40), 1).natural_frequency[0]
    glued = fi.solve_modes(fi.assemble(fi.structure.glue_impactors(reference), elements=40), 1).natural_frequency[0]
    # Table 1 of the paper: 5.30 and 4.98 Hz; the reference data were fitted to 4 digits of both
    assert without == pytest.approx(5.300, abs=5e-4)
    assert glued == pytest.approx(4.980, abs=5e-4)


def test_a_ball_between_contacts_does_not_change_the_structures_modes(reference):
    with_ball = fi.assemble(reference, elements=20)
    empty = fi.without_impactors(with_ball)
    assert empty.contacts == ()
    np.testing.assert_array_equal(
        fi.solve_modes(with_ball, 3).natural_frequency, fi.solve_modes(empty, 3).natural_frequency
    )


def test_a_point_mass_inside_an_element_converges_from_above_to_the_one_on_a_node():
    structure = fi.Structure(fi.Beam.uniform(**BEAM), masses=[fi.PointMass("lump", "mid", 0.02)])
    exact = fi.solve_modes(fi.assemble(structure, elements=1000), 1).natural_frequency[0]
    counts = np.array([5, 11, 21, 41])  # odd: the middle lies inside an element
    error = []
    for n in counts:
        mesh = fi.fem.Mesh(np.linspace(0.0, BEAM["length"], n + 1))
        assert np.min(np.abs(mesh.nodes - 0.15)) > 1e-3
        error.append(fi.solve_modes(fi.assemble(structure, mesh=mesh), 1).natural_frequency[0] / exact - 1)
    assert np.all(np.array(error) > 0)
    # the shear jumps inside one element, where cubics have none: energy error ~ (h w''')^2 h, third order
    slope = -np.polyfit(np.log(counts), np.log(error), 1)[0]
    assert 2.8 < slope < 3.3
    assert error[-1] < 1e-5


# ---- Rayleigh damping ------------------------------------------------------------------------------


def with_damping(damping):
    return fi.assemble(cantilever(0.5, damping=damping), elements=20)


@pytest.mark.parametrize(
    ("ratio", "modes"),
    [(0.0029, (1, 2)), (0.0029, (2, 4)), (0.0029, (3, 1)), ((0.01, 0.03), (1, 2)), ((0.03, 0.01), (3, 1))],
)
def test_rayleigh_damping_has_its_target_at_its_two_modes_and_the_formula_elsewhere(ratio, modes):
    system = with_damping(fi.Rayleigh(ratio=ratio, modes=modes))
    solved = fi.solve_modes(system, 6)
    targets = ratio if isinstance(ratio, tuple) else (ratio, ratio)
    phi, omega = solved.vectors, 2 * np.pi * solved.natural_frequency
    measured = np.einsum("ij,ij->j", phi, system.C @ phi) / (2 * omega)
    pair = np.array(modes) - 1
    # the modes' own accuracy (eigenvector error squared) and rounding of phi^T C phi
    np.testing.assert_allclose(measured[pair], targets, rtol=1e-8)
    alpha, beta = np.linalg.solve(np.column_stack([0.5 / omega[pair], 0.5 * omega[pair]]), targets)
    np.testing.assert_allclose(measured, alpha / (2 * omega) + beta * omega / 2, rtol=1e-8)
    np.testing.assert_allclose(solved.damping_ratio, measured, rtol=1e-8)
    reduced = fi.reduce(system, modes=6)
    np.testing.assert_allclose(reduced.C.diagonal() / (2 * np.sqrt(reduced.K.diagonal())), measured, rtol=1e-8)


def test_rayleigh_damping_by_frequencies_is_the_formula():
    system = with_damping(fi.Rayleigh(ratio=0.02, frequencies=(5.0, 80.0)))
    alpha, beta = 2 * 0.02 * 2 * np.pi * 5 * 80 / 85, 2 * 0.02 / (2 * np.pi * 85)
    # closed form for equal ratios; rounding
    assert system.rayleigh == pytest.approx((alpha, beta), rel=1e-13)
    np.testing.assert_allclose(
        system.C.toarray(), alpha * system.M.toarray() + beta * system.K.toarray(), rtol=1e-13, atol=0
    )


@pytest.mark.parametrize("modes", [1, 5, 40])
def test_reduction_keeps_exactly_the_modes_asked_for(modes):
    system = with_damping(fi.Rayleigh(ratio=0.01, modes=(1, 2)))
    reduced = fi.reduce(system, modes=modes)
    assert reduced.dofs == modes
    assert reduced.is_diagonal
    # rounding between two calls of one solver with different counts
    np.testing.assert_allclose(
        np.sqrt(reduced.K.diagonal()), 2 * np.pi * fi.solve_modes(system, 40).natural_frequency[:modes], rtol=1e-9
    )
    phi = fi.solve_modes(system, modes)
    np.testing.assert_allclose(reduced.base_load, phi.participation_factor, rtol=1e-10, atol=1e-12)


def test_contacts_keep_their_effective_mass_in_every_reduction(reference):
    system = fi.assemble(reference, elements=20)
    first = fi.solve_modes(system, 1).vectors[:, 0]
    exact = 1 / (1 / 3.43e-3 + (system.point_row("tip") @ first) ** 2)
    for used in (system, fi.reduce(system, modes=1), fi.reduce(system, modes=12)):
        # the same number is handed on; rounding of one product
        assert used.contacts[0].effective_mass == pytest.approx(exact, rel=1e-12)


def test_a_place_off_the_beam_by_rounding_is_its_end(system):
    length = float(system.nodes[-1])
    # 6e-8 is the rounding of single precision
    for off, end in ((-6e-8 * length, 0.0), (length * (1.0 + 6e-8), length)):
        np.testing.assert_array_equal(system.deflection_rows([off]), system.deflection_rows([end]))
        assert system.position_of(off) == end


def of_matrices(M, K, C=None):
    M, K = np.asarray(M, dtype=float), np.asarray(K, dtype=float)
    return fi.System.from_matrices(
        M, 0.0 * K if C is None else C, K, points={"first": np.eye(len(M))[0]}, base_load=M.sum(axis=1)
    )


@pytest.mark.parametrize(
    ("mass", "stiffness"),
    [
        ([1.0, 1.0], [5.8, 0.0]),
        ([1.0, 1.0, 1.0], [0.0, 0.0, 1.0]),
        ([1.0, 1.0, 1.0, 1.0], [0.0, 3.0, 0.0, 3.0]),
        ([1e-3, 1e3, 1.0], [0.0, 2.0, 0.0]),
        ([1.0, 1.0], [0.0, 0.0]),
        ([1.0, 1.0, 1.0], [1.0, 1e14, 0.0]),
        ([1.0, 1e-15, 1.0], [1.0, 1e-15, 0.0]),
        ([1.0, 1.0], [1e-20, 1e3]),
    ],
)
def test_masses_that_nothing_joins_have_the_frequency_of_each_and_free_ones_none(mass, stiffness):
    exact = np.sort(np.sqrt(np.divide(stiffness, mass))) / (2 * math.pi)
    for count in range(1, len(mass) + 1):
        found = fi.solve_modes(of_matrices(np.diag(mass), np.diag(stiffness)), count).natural_frequency
        np.testing.assert_allclose(found, exact[:count], rtol=1e-14, atol=0)


@pytest.mark.parametrize("size", [2, 3, 5, 8, 70])  # the last beyond what is solved as full matrices
def test_free_structures_of_any_masses_have_the_frequencies_of_eigh(size):
    random = np.random.default_rng(size)
    for _ in range(20 if size < 10 else 2):
        free = int(random.integers(1, min(size, 4)))
        unit = 10.0 ** random.uniform(-1.5, 1.5, size)  # of each dof: masses over six powers of ten
        strains, momenta = random.normal(size=(size - free, size)), random.normal(size=(size, size))
        K, M = strains.T @ strains, momenta.T @ momenta + np.eye(size)
        exact = np.sqrt(np.maximum(eigh(K, M, eigvals_only=True), 0.0)) / (2 * math.pi)
        for count in (free + 1, size):
            modes = fi.solve_modes(of_matrices(M * np.outer(unit, unit), K * np.outer(unit, unit)), count)
            assert np.all(modes.natural_frequency[:free] == 0.0)
            np.testing.assert_allclose(modes.natural_frequency[free:], exact[free:count], atol=1e-11 * exact[-1])
            gram = modes.vectors.T @ (M * np.outer(unit, unit)) @ modes.vectors
            np.testing.assert_allclose(gram, np.eye(count), atol=1e-11)


def chain(springs, masses):
    """Free masses (kg) in a row, with a spring (N/m) between each and the next."""
    stretches = np.diff(np.eye(len(masses)), axis=0)
    return np.diag(masses), stretches.T @ (np.asarray(springs)[:, None] * stretches)


def test_two_masses_on_a_damped_spring_have_the_closed_form():
    M, K = chain([1000.0], [2.0, 3.0])
    reduced = fi.reduce(of_matrices(M, K, 1e-3 * K), 2)
    omega = math.sqrt(1000.0 * (1 / 2 + 1 / 3))
    np.testing.assert_allclose(reduced.K.diagonal(), [0.0, omega**2], rtol=1e-14)
    np.testing.assert_allclose(reduced.C.diagonal(), [0.0, 1e-3 * omega**2], rtol=1e-14)


@pytest.mark.parametrize("alpha", [0.0, 0.3])
@pytest.mark.parametrize("bodies", [1, 2])
@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e6])  # of the other dofs
def test_free_structures_with_rayleighs_damping_as_a_matrix_are_reduced(alpha, bodies, unit):
    random = np.random.default_rng(bodies)
    for size in (2, 5, 40):
        parts = [chain(random.uniform(0.1, 10, size - 1), random.uniform(0.1, 10, size)) for _ in range(bodies)]
        units = np.where(np.arange(bodies * size) % 2, unit, 1.0)
        M, K = (block_diag(*matrices) * np.outer(units, units) for matrices in zip(*parts, strict=True))
        omega = fi.solve_modes(of_matrices(M, K), bodies * size).natural_frequency * 2 * math.pi
        assert np.count_nonzero(omega == 0.0) == bodies
        reduced = fi.reduce(of_matrices(M, K, alpha * M + 0.01 * K), bodies * size)
        expected = alpha + 0.01 * omega**2
        np.testing.assert_allclose(reduced.C.diagonal(), expected, atol=1e-11 * expected.max())


@pytest.mark.parametrize("share", [1.0, 1e-3, 1e-6])
def test_a_damping_that_joins_the_modes_of_a_free_structure_is_refused(share):
    M, K = chain([1000.0, 2000.0], [2.0, 3.0, 1.0])
    at_the_first = np.diag([1.0, 0.0, 0.0])
    system = of_matrices(M, K, 1e-3 * K + share * at_the_first)
    with pytest.raises(fi.errors.InputError, match="must decouple"):
        fi.reduce(system, 3)
    assert fi.reduce(system, 1).C.diagonal() == pytest.approx(share / 6.0, rel=1e-9)
