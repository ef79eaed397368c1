"""Rigid impacts at one instant: p >= 0, u+ + e u- >= 0, one of both zero, for all pairs that close or rest, together.

Closed forms, conserved momentum, energy that does not grow, and independence of the order in which pairs are listed.
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np
import pytest

import femimpact as fi

pytestmark = pytest.mark.impacts

EXACT, STILL = fi.EventDriven(), fi.Sine(0.0, 1.0)
METHODS = {"event-driven": EXACT, "Moreau-Jean": fi.MoreauJean(1e-3)}


def at_a_wall(restitutions, wall=1.0, masses=None, names=None):
    """Balls in boxes on one free mass, of 1 kg and 1 m from its wall where nothing else is said."""
    masses = [1.0] * len(restitutions) if masses is None else masses
    names = [f"ball {k}" for k in range(len(masses))] if names is None else names
    balls = [
        fi.Impactor(name, "wall", mass, (1.0, 100.0), fi.Rigid(e))
        for name, mass, e in zip(names, masses, restitutions, strict=True)
    ]
    return fi.System.from_matrices([[wall]], [[0.0]], [[0.0]], points={"wall": [1.0]}, impactors=balls)


def bodies(rows, masses, restitutions, gap=0.0, order=None):
    """Free masses that meet one another where a row of each contact, times their displacements, has closed its gap."""
    n, order = len(masses), range(len(rows)) if order is None else order
    points = {f"mass {i}": np.eye(n)[i] for i in range(n)} | {f"row {k}": rows[k] for k in order}
    stops = [fi.Stop(f"stop {k}", f"row {k}", (gap, math.inf), fi.Rigid(restitutions[k])) for k in order]
    zero = np.zeros((n, n))
    return fi.System.from_matrices(np.diag(masses), zero, zero, points=points, stops=stops)


def row(size=5):
    """Rows of masses in a line, of which each meets the next."""
    return np.eye(size)[:-1] - np.eye(size)[1:]


def thrown(system, velocity, method=EXACT, duration=1.5, initial=None):
    start = fi.State(ball_velocity=velocity) if initial is None else initial
    run = fi.integrate(system, STILL, method, duration, fi.Recorder(("wall",) if system.balls else ("mass 0",)), start)
    assert run.energy.residual < 1e-13 or method is not EXACT
    return run


def loss_of(run):
    """Energy (J) that all impacts have lost by the table."""
    return float(np.sum(run.impacts.energy_loss))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("restitutions", "balls", "wall"),
    [
        ((0.5, 0.5), (0.5, 0.5), 1.0),
        ((0.0, 0.0), (2 / 3, 2 / 3), 2 / 3),
        ((0.9, 0.1), (0.1, 0.9), 1.0),
        ((0.1, 0.9), (0.9, 0.1), 1.0),
        ((1.0, 1.0), (1 / 3, 1 / 3), 4 / 3),
        ((0.5, 0.5, 0.5), (5 / 8, 5 / 8, 5 / 8), 9 / 8),
        ((0.5,) * 20, (1.0 - 1.5 / 21,) * 20, 30 / 21),
    ],
)
def test_balls_that_meet_a_wall_at_one_instant(method, restitutions, balls, wall):
    # as one ball: u+ = -e u- for each, and momentum is kept
    run = thrown(at_a_wall(restitutions), [1.0] * len(balls), METHODS[method])
    np.testing.assert_allclose(run.final_state.ball_velocity, balls, rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.final_state.velocity, wall, rtol=0, atol=1e-13)
    # 1/2 (1 - e) p u of each
    impulse = 1.0 - np.array(balls)
    np.testing.assert_allclose(run.impacts.impulse, impulse, rtol=0, atol=1e-13)
    lost = 0.5 * (1.0 - np.array(restitutions)) * impulse
    np.testing.assert_allclose(run.impacts.energy_loss, lost, rtol=0, atol=1e-13)
    kept = 0.5 * (np.sum(np.square(balls)) + wall**2)
    assert loss_of(run) == pytest.approx(0.5 * len(balls) - kept, abs=1e-12)


def test_a_ball_between_two_bodies_is_met_from_both_sides():
    # A = [[2, -1], [-1, 2]] and both approach at 1 m/s: impulses of (1 + e) each, and the middle stays
    rows = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
    start = fi.State(displacement=[-0.5, 0.0, 0.5], velocity=[1.0, 0.0, -1.0])
    run = thrown(bodies(rows, np.ones(3), (0.5, 0.5)), None, duration=1.0, initial=start)
    np.testing.assert_allclose(run.final_state.velocity, [-0.5, 0.0, 0.5], rtol=0, atol=1e-14)
    np.testing.assert_allclose(run.impacts.impulse, 1.5, rtol=1e-14)


def test_equal_masses_in_touch_move_as_the_rule_says_and_with_gaps_as_a_cradle():
    start = fi.State(displacement=[-1.0, 0, 0], velocity=[1.0, 0, 0])
    touching = thrown(bodies(row(3), np.ones(3), (1.0, 1.0)), None, initial=start)
    np.testing.assert_allclose(touching.final_state.velocity, [-1 / 3, 2 / 3, 2 / 3], rtol=0, atol=1e-14)
    start = fi.State(displacement=[-1.0, 0, 0, 0, 0], velocity=[2.0, 0, 0, 0, 0])
    five = thrown(bodies(row(), np.ones(5), (1.0,) * 4), None, duration=1.0, initial=start)
    # as a mass of 1 that meets one of 4
    np.testing.assert_allclose(five.final_state.velocity, [-1.2, 0.8, 0.8, 0.8, 0.8], rtol=0, atol=1e-13)
    apart = thrown(bodies(row(), np.ones(5), (1.0,) * 4, gap=1e-6), None, duration=1.0, initial=start)
    np.testing.assert_allclose(apart.final_state.velocity, [0, 0, 0, 0, 2.0], rtol=0, atol=1e-13)
    assert np.all(np.diff(apart.impacts.time) > 4e-7)


def test_balls_that_arrive_one_after_the_other_are_solved_one_after_the_other():
    # the nearer one leaves 1/4 behind and sets the wall in motion at 3/4, which the other meets at 1/4
    balls = [fi.Impactor(name, "wall", 1.0, gap, fi.Rigid(0.5)) for name, gap in (("near", 1.0), ("far", 1.0 + 1e-9))]
    system = fi.System.from_matrices([[1.0]], [[0.0]], [[0.0]], points={"wall": [1.0]}, impactors=balls)
    run = thrown(system, [1.0, 1.0])
    np.testing.assert_allclose(run.final_state.ball_velocity, [0.25, 0.8125], rtol=0, atol=1e-14)
    assert run.impacts.time[1] > run.impacts.time[0]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_ball_that_rests_on_its_wall_is_taken_along_or_left_behind(side):
    # a ball of 1 kg is pressed to a wall of 1 kg that nothing holds, and another one of 1 kg meets that from within or
    # from behind: the three move on together, or the ball is left
    rests = fi.Impactor("rests", "wall", 1.0, 0.0, fi.Rigid(0.6), acceleration=1e-3)
    comes = fi.Impactor("comes", "wall", 1.0, 0.5, fi.Rigid(0.5))
    system = fi.System.from_matrices(
        [[1.0]], [[0.0]], [[0.0]], points={"wall": [1.0]}, impactors=[
            fi.Impactor("rests", "wall", 1.0, (0.0, 100.0), fi.Rigid(0.6), acceleration=1e-3), comes,
        ],
    )  # fmt: skip
    assert rests.mass == comes.mass
    run = thrown(system, None, duration=0.6, initial=fi.State(ball_velocity=[0.0, side]))
    time, impulse = float(run.impacts.time[-1]), float(run.impacts.impulse[-1])
    moved = 0.5e-3 * time
    approach = 1.0 - side * moved
    assert float(run.impacts.approach_speed[-1]) == pytest.approx(approach, rel=1e-12)
    # from below (+) the wall flees from the ball on it, which stays behind; from above it is pressed against that ball
    felt = 0.5 if side > 0.0 else 2.0 / 3.0
    assert impulse == pytest.approx(1.5 * felt * approach, rel=1e-12)
    ends = run.sticking.end[run.sticking.impactor == "rests"]
    assert bool(np.any(ends == time)) == (side > 0.0)


def test_what_accumulates_at_one_instant_is_captured_at_one_instant():
    balls = [fi.Impactor(name, "wall", 1e-3, (1.0, 1e-3), fi.Rigid(0.5), acceleration=-9.81) for name in "ab"]
    system = fi.System.from_matrices([[1.0]], [[2.0]], [[100.0]], points={"wall": [1.0]}, impactors=balls)
    run = thrown(system, [0.0, 0.0], duration=0.3)
    one, two = (run.impacts.impactor == name for name in "ab")
    for column in ("time", "approach_speed", "rebound_speed", "impulse", "energy_loss"):
        np.testing.assert_allclose(run.impacts[column][one], run.impacts[column][two], rtol=1e-9)
    assert len(run.sticking) == 2
    assert run.sticking.start[0] == pytest.approx(run.sticking.start[1], rel=1e-9)
    # the momentum of both is handed over: the wall sinks by the weight of both
    single = fi.Impactor("a", "wall", 2e-3, (1.0, 1e-3), fi.Rigid(0.5), acceleration=-9.81)
    whole = fi.System.from_matrices([[1.0]], [[2.0]], [[100.0]], points={"wall": [1.0]}, impactors=[single])
    np.testing.assert_allclose(run["wall"], thrown(whole, [0.0], duration=0.3)["wall"], rtol=0, atol=1e-13)


@pytest.mark.parametrize("several", [2, 3, 7])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_stops_at_one_place_share_their_impulse_evenly(several, e):
    # more pairs than degrees of freedom: G M^-1 G^T is singular
    rows = np.ones((several, 1))
    run = thrown(bodies(rows, [2.0], (e,) * several, gap=0.5), None, initial=fi.State(velocity=[0.7]))
    np.testing.assert_allclose(run.impacts.impulse, (1.0 + e) * 2.0 * 0.7 / several, rtol=1e-13)
    np.testing.assert_allclose(run.final_state.velocity, -0.7 * e, rtol=1e-13, atol=1e-15)


def test_of_stops_at_one_place_with_unequal_restitution_the_liveliest_pushes():
    run = thrown(bodies(np.ones((3, 1)), [2.0], (0.2, 0.8, 0.5), gap=0.5), None, initial=fi.State(velocity=[1.0]))
    assert list(run.impacts.impactor) == ["stop 1"]
    np.testing.assert_allclose(run.final_state.velocity, -0.8, rtol=1e-14)


def test_three_stops_under_a_bar_share_as_equals_of_least_norm():
    # translation and turning: the middle and both ends, all of which any impulses with the same sum and moment stop
    rows = np.array([[1.0, -0.5], [1.0, 0.0], [1.0, 0.5]])
    run = thrown(bodies(rows, [3.0, 0.25], (0.5,) * 3, gap=0.1), None, initial=fi.State(velocity=[1.0, 0.0]))
    np.testing.assert_allclose(run.impacts.impulse, 1.5, rtol=1e-13)
    np.testing.assert_allclose(run.final_state.velocity, [-0.5, 0.0], rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_random_chains_keep_momentum_and_never_gain_energy_in_any_order(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 6))
    masses, restitutions = 10.0 ** rng.uniform(-1.0, 1.0, n), rng.choice([0.0, 0.1, 0.5, 0.9, 1.0], n - 1)
    velocity = np.where(rng.uniform(size=n) < 0.3, 0.0, rng.normal(size=n))
    start, found = fi.State(displacement=np.zeros(n), velocity=velocity), []
    before = 0.5 * float(masses @ velocity**2)
    for order in list(permutations(range(n - 1)))[:: 1 if n < 5 else 5]:
        system = bodies(row(n), masses, restitutions, order=order)
        run = fi.integrate(system, STILL, EXACT, 1e-3, fi.Recorder(("mass 0",), interval=1e-3), start)
        after = np.asarray(run.final_state.velocity)
        energy = 0.5 * float(masses @ after**2)
        assert energy <= before * (1.0 + 1e-14)
        assert energy + loss_of(run) == pytest.approx(before, rel=1e-13)
        assert np.all(run.impacts.energy_loss >= -1e-15 * before)
        assert masses @ after == pytest.approx(masses @ velocity, abs=1e-13 * float(masses @ np.abs(velocity)))
        # nothing is left that closes
        assert np.all(np.diff(after) >= -1e-11 * np.max(np.abs(velocity)))
        found.append(after)
    np.testing.assert_allclose(found, found[:1] * len(found), rtol=0, atol=1e-12 * np.max(np.abs(velocity)))


@pytest.mark.parametrize("seed", [37, 54, 82, 100])
def test_steps_with_several_impacts_never_gain_energy_in_any_order(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 6))
    masses, restitutions = 10.0 ** rng.uniform(-1.0, 1.0, n), rng.choice([0.0, 0.1, 0.5, 0.9, 1.0], n - 1)
    start = fi.State(velocity=rng.normal(size=n), displacement=np.sort(rng.uniform(-0.01, 0.01, n)))
    channels, found = fi.Recorder(tuple(f"mass {i}.velocity" for i in range(n))), []
    for order in (range(n - 1), range(n - 2, -1, -1)):
        system = bodies(row(n), masses, restitutions, order=order)
        run = fi.integrate(system, STILL, fi.MoreauJean(1e-4), 0.1, channels, start)
        velocity = np.array([run[name] for name in channels.channels])
        energy = 0.5 * masses @ velocity**2
        assert len(run.impacts) > 2
        assert np.all(np.diff(energy) <= 1e-14 * energy[0])
        assert np.all(run.impacts.energy_loss >= -1e-14 * energy[0])
        np.testing.assert_allclose(masses @ velocity, masses @ velocity[:, 0], rtol=0, atol=1e-13 * masses.sum())
        found.append(velocity)
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-11)


@pytest.mark.parametrize(("e", "place"), [(0.6, 0.25), (0.8, 0.4), (1.0, 0.25)])
def test_a_symmetric_beam_with_two_balls_stays_symmetric(e, place):
    beam = fi.Beam.uniform(length=0.4, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    balls = [
        fi.Impactor(name, at, 2e-3, 5e-4, fi.Rigid(e)) for name, at in (("a", 0.4 * place), ("b", 0.4 - 0.4 * place))
    ]
    both = [fi.Support("clamped", "root"), fi.Support("clamped", "tip")]
    structure = fi.Structure(beam, [], balls, fi.Rayleigh(ratio=0.005, modes=(1, 2)), both)
    system = fi.reduce(fi.assemble(structure, elements=20), modes=6)
    frequency = system.first_frequency
    run = fi.integrate(
        system, fi.Sine(1e-4, frequency), EXACT, 12.0 / frequency, fi.Recorder(("a", "b", "a.gap", "b.gap"))
    )
    one, two = (run.impacts.time[run.impacts.impactor == name] for name in "ab")
    assert one.size >= 10
    np.testing.assert_array_equal(one[:10], two[:10])
    until = run.time <= one[9]
    for left, right in (("a", "b"), ("a.gap", "b.gap")):
        size = np.max(np.abs(run[left]))
        np.testing.assert_allclose(run[left][until], run[right][until], rtol=0, atol=1e-9 * size)
    assert run.energy.residual < 1e-11
