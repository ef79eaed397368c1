"""Equal parts and nearly critical damping: complex modes that repeat, or that nearly lose an eigenvector."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import expm_multiply

import femimpact as fi
from femimpact.integrators.event_driven.complex_modes import complex_modes

EXACT = fi.EventDriven()

pytestmark = pytest.mark.impacts


# ---- the closed form against the matrix exponential -----------------------------------------------


def state_matrix(omega_squared, damping):
    n = omega_squared.size
    return np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(omega_squared), -damping]])


def modes_of(omega_squared, damping):
    """Complex modes of one structure, without the axis of structures."""
    ((members, modes),) = complex_modes(omega_squared[None], damping[None])
    assert members.tolist() == [0]
    names = ("exponent", "rate", "size", "shape", "from_u", "from_v")
    return SimpleNamespace(blocks=modes.blocks, **{name: getattr(modes, name)[0] for name in names})


def worst_error(omega_squared, damping, times=(0.0, 0.7, 3.0)):
    """Largest error of displacements times their frequency, for energies of size 1."""
    rng = np.random.default_rng(5)
    unit = np.sqrt(np.maximum(omega_squared, 1e-3))
    u, v = rng.normal(size=unit.size) / unit, rng.normal(size=unit.size)
    modes = modes_of(omega_squared, damping)
    entry, error = modes.from_u @ u + modes.from_v @ v, 0.0
    for t in times:
        # the exponential of the state matrix by scaling and squaring needs no eigenvectors
        exact = (scipy.linalg.expm(state_matrix(omega_squared, damping) * t) @ np.concatenate([u, v]))[: unit.size]
        # by Taylor's series: scipy's expm of a triangular matrix loses digits where its eigenvalues are close
        found = (modes.shape @ expm_multiply(modes.rate * t, entry)).real
        error = max(error, float(np.abs(unit * (found - exact)).max()))
    return error, modes


def in_contact(balls, boxes, damping=2.0, apart=0.0):
    """Equal oscillators with equal balls pressed to their walls, on normal modes."""
    size = boxes + balls
    M, C, K = np.eye(size), np.zeros((size, size)), np.zeros((size, size))
    C[:boxes, :boxes], K[:boxes, :boxes] = 0.02 * np.eye(boxes), np.eye(boxes)
    for j in range(balls):
        M[boxes + j, boxes + j] = 0.1 * (1.0 + apart * j)
        b = np.zeros(size)
        b[j % boxes], b[boxes + j] = 1.0, -1.0
        C, K = C + damping * np.outer(b, b), K + 50.0 * np.outer(b, b)
    omega_squared, vectors = scipy.linalg.eigh(K, M)
    return np.maximum(omega_squared, 0.0), vectors.T @ C @ vectors


@pytest.mark.parametrize("apart", [0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-4])
@pytest.mark.parametrize(("balls", "boxes"), [(2, 2), (3, 1), (4, 1), (4, 2)])
def test_equal_parts_move_as_the_matrix_exponential_says(balls, boxes, apart):
    # rounding of expm itself is some 1e-14 here
    assert worst_error(*in_contact(balls, boxes, apart=apart))[0] < 1e-12


def test_structures_together_have_the_bits_of_each_alone():
    """Among them blocks, real and complex entries, in random order: what lies alike is computed together."""
    rng = np.random.default_rng(8)
    given = [in_contact(2, 2, c, apart) for c in (0.5, 2.0, nearly_defective()) for apart in (0.0, 1e-8, 0.3)]
    given += [in_contact(2, 2, c, 0.3) for c in rng.uniform(0.1, 9.0, 40)]
    square = rng.uniform(0.5, 2.0, (40, 4))
    given += [(own, np.diag(2.0 * np.sqrt(own) * rng.choice([0.1, 1.0, 1.0 + 1e-9, 3.0], 4))) for own in square]
    order = rng.permutation(len(given))
    found = complex_modes(np.array([given[i][0] for i in order]), np.array([given[i][1] for i in order]))
    assert sorted(np.concatenate([members for members, _ in found])) == list(range(len(given)))
    assert 1 < len(found) < len(given)
    assert max(members.size for members, _ in found) >= 10
    for members, modes in found:
        for f, number in enumerate(members):
            alone = modes_of(*given[order[number]])
            np.testing.assert_array_equal(modes.blocks, alone.blocks)
            for name in ("exponent", "rate", "size", "shape", "from_u", "from_v"):
                np.testing.assert_array_equal(getattr(modes, name)[f], getattr(alone, name))


@pytest.mark.parametrize("off", [0.0, 1e-12, -1e-12, 1e-8, -1e-8, 1e-4, -1e-4, 1e-2, -1e-2])
def test_one_mode_near_its_critical_damping_keeps_its_digits(off):
    error, modes = worst_error(np.array([4.0]), np.array([[4.0 * (1.0 + off)]]))
    assert error < 1e-13
    assert (modes.blocks.size > 0) == (abs(off) < 1e-3)


def nearly_defective():
    """The dashpot with which two decays of one oscillator and its pressed ball become one."""

    def discriminant(c):
        omega_squared, damping = in_contact(1, 1, c)
        values = np.linalg.eigvals(state_matrix(omega_squared, damping))
        pair = values[np.argsort(-np.abs(values))[:2]]
        return float(((pair[0] - pair[1]) ** 2).real)

    from scipy.optimize import brentq

    return brentq(discriminant, 4.2, 4.35, xtol=1e-15)


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-8, -1e-8, 1e-4, -1e-4])
@pytest.mark.parametrize(("balls", "boxes"), [(1, 1), (2, 2)])
def test_coupled_damping_near_its_critical_value_keeps_its_digits(balls, boxes, off):
    error, modes = worst_error(*in_contact(balls, boxes, nearly_defective() + off))
    assert modes.blocks.size > 0
    # a block's basis is well conditioned: what is lost is far below the 1e-8 of a nearly defective pair of vectors
    assert error < 1e-12
    for first, count in modes.blocks:
        own = modes.rate[first : first + count, first : first + count]
        # no motion of a block grows: what the search for crossings relies on
        assert np.linalg.eigvalsh(own + own.conj().T).max() < 1e-6 * np.linalg.norm(own)


# ---- runs ------------------------------------------------------------------------------------------


def oscillators(rotation=0.0, contact=None, masses=(0.1, 0.1), springs=(1.0, 1.0)):
    """Two oscillators, each with a ball, in coordinates rotated by an angle."""
    c, s = math.cos(rotation), math.sin(rotation)
    turned = np.array([[c, -s], [s, c]])
    contact = contact or fi.KelvinVoigt(stiffness=50.0, restitution=0.6)
    return fi.System.from_matrices(
        np.eye(2),
        0.02 * np.eye(2),
        turned.T @ np.diag(springs) @ turned if springs[0] != springs[1] else np.eye(2),
        points={"a": turned[0], "b": turned[1]},
        base_load=turned.T @ np.ones(2),
        impactors=[
            fi.Impactor(f"ball {at}", at=at, mass=mass, gap=1.0, contact=contact)
            for at, mass in zip("ab", masses, strict=True)
        ],
    )


def by_runge_kutta(mass, stiffness, damping, base, times):
    """One of the oscillators with its ball, by DOP853 restarted at every change of contact."""

    def force(z, side):
        return stiffness * (z[2] - z[0] - side) + damping * (z[3] - z[1]) if side else 0.0

    def rates(t, z, side):
        acting, push = float(base.acceleration(t)), force(z, side)
        return [z[1], -z[0] - 0.02 * z[1] + push - acting, z[3], -push / mass - acting]

    def event(t, z, side):
        return side * force(z, side) if side else 1.0 - abs(z[2] - z[0])

    event.terminal, event.direction = True, -1
    t, z, side, out, changes = 0.0, np.zeros(4), 0, [], 0
    while t < times[-1]:
        left = times[times >= t] if t == 0.0 else times[times > t]
        found = solve_ivp(
            rates, (t, times[-1]), z, "DOP853", t_eval=left, events=event, args=(side,), rtol=1e-13, atol=1e-14,
            max_step=0.05,
        )  # fmt: skip
        out.extend(found.y[0])
        if found.status == 0:
            break
        t, z, changes = float(found.t_events[0][0]), found.y_events[0][0], changes + 1
        side = 0 if side else (1 if z[2] > z[0] else -1)
    return np.array(out), changes


@pytest.mark.parametrize("rotation", [0.0, 0.3, 1.1])
@pytest.mark.parametrize("apart", [0.0, 1e-14, 1e-11, 1e-8])
def test_equal_oscillators_with_equal_balls_move_as_each_does_alone(rotation, apart):
    base = fi.Sine(amplitude=0.5, frequency=0.15)
    system = oscillators(rotation, masses=(0.1, 0.1 * (1.0 + apart)))
    run = fi.integrate(system, base, EXACT, 40.0, fi.Recorder(channels=("a", "b")))
    times = run.time[run.time < 20.0]
    numbers = system.contacts[0].parameters
    alone, changes = by_runge_kutta(0.1, numbers.stiffness, numbers.damping, base, times)
    assert changes >= 6  # three impacts
    # 1e-9 is the reference's own accuracy after three impacts; the second ball's mass differs by `apart`
    np.testing.assert_allclose(run["a"][: times.size], alone, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["b"][: times.size], alone, rtol=0, atol=1e-9 + 1e3 * apart)
    assert run.energy.residual < 1e-10
    assert np.abs(run["a"]).max() < 50.0


@pytest.mark.parametrize("balls", [3, 4])
def test_the_ledger_closes_with_equal_balls_in_one_box(balls):
    ball = {"at": "box", "mass": 0.05, "gap": 1.0, "contact": fi.KelvinVoigt(stiffness=40.0, restitution=0.5)}
    system = fi.System.from_matrices(
        [[1.0]], [[0.02]], [[1.0]], points={"box": [1.0]},
        impactors=[fi.Impactor(f"ball {i}", **ball) for i in range(balls)],
    )  # fmt: skip
    run = fi.integrate(system, fi.Sine(amplitude=0.5, frequency=0.15), EXACT, 200.0, fi.Recorder(channels=("box",)))
    assert len(run.impacts) > 20
    assert run.energy.residual < 1e-10
    # equal balls that start alike stay alike
    first = run.impacts.time[run.impacts.impactor == "ball 0"][:5]
    for i in range(1, balls):
        np.testing.assert_allclose(run.impacts.time[run.impacts.impactor == f"ball {i}"][:5], first, rtol=1e-9)


@pytest.mark.parametrize("rotation", [0.0, 0.3, 1.1])
def test_rigid_balls_that_stick_on_equal_oscillators_move_as_each_does_alone(rotation):
    """Each box with its ball is one body while the ball sticks: compared with the same box alone in its own system."""
    sticky = fi.Rigid(restitution=0.0)
    base = fi.Sine(amplitude=0.5, frequency=0.15)
    both = fi.integrate(oscillators(rotation, sticky), base, EXACT, 20.0, fi.Recorder(channels=("a", "b")))
    one = fi.System.from_matrices(
        [[1.0]], [[0.02]], [[1.0]], points={"a": [1.0]},
        impactors=[fi.Impactor("ball a", at="a", mass=0.1, gap=1.0, contact=sticky)],
    )  # fmt: skip
    alone = fi.integrate(one, base, EXACT, 20.0, fi.Recorder(channels=("a",)))
    assert len(alone.sticking.start) > 0
    # until the fourth impact: rounding grows by each
    few = alone.time < (alone.impacts.time[3] if len(alone.impacts) > 3 else np.inf)
    for place in "ab":
        np.testing.assert_allclose(both[place][few], alone["a"][few], rtol=0, atol=1e-9)
    assert both.energy.residual < 1e-10


@pytest.mark.parametrize("off", [0.0, 1e-8, -1e-8, 1e-4])
def test_the_ledger_closes_in_contacts_near_their_critical_damping(off):
    contact = fi.KelvinVoigt(stiffness=50.0, damping=nearly_defective() + off)
    run = fi.integrate(oscillators(0.3, contact), fi.Sine(0.5, 0.15), EXACT, 100.0, fi.Recorder(channels=("a",)))
    assert len(run.impacts) > 5
    assert run.energy.residual < 1e-9


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-8, -1e-8, 1e-3])
def test_the_ledger_closes_where_a_mode_has_critical_damping(off):
    """With a rigid ball: free motion only, and a closed form of the mode's own."""
    system = fi.System.from_matrices(
        [[1.0]], [[2.0 * (1.0 + off)]], [[1.0]], points={"a": [1.0]},
        impactors=[fi.Impactor("ball", at="a", mass=0.1, gap=1.0, contact=fi.Rigid(restitution=0.7))],
    )  # fmt: skip
    run = fi.integrate(system, fi.Sine(amplitude=2.0, frequency=0.15), EXACT, 200.0, fi.Recorder(channels=("a",)))
    assert len(run.impacts) > 20
    assert run.energy.residual < 1e-10


@pytest.mark.parametrize("rotation", [0.0, 0.7])
def test_an_impact_is_as_strong_near_its_critical_damping_as_on_either_side_of_it(rotation):
    """Force, impulse, duration and loss are smooth in the dashpot: at a block they are the mean of both sides."""

    def first_impact(share):
        contact = fi.KelvinVoigt(stiffness=50.0, damping=share * nearly_defective())
        run = fi.integrate(oscillators(rotation, contact), fi.Sine(0.5, 0.15), EXACT, 12.0)
        table = run.impacts
        return np.array([getattr(table, name)[0] for name in ("peak_force", "impulse", "duration", "energy_loss")])

    at, below, above = (first_impact(share) for share in (1.0, 0.98, 1.02))
    # the second difference over 2 % is some 1e-4 of the value
    np.testing.assert_allclose(at, 0.5 * (below + above), rtol=2e-3)
    assert np.all(np.abs(above / below - 1.0) < 0.1)
