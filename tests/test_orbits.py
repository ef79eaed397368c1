"""Periodic orbits: closed forms, invariants, digits of 50-digit arithmetic, the rate of Newton's method."""

import importlib
import json
import math
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest
import scipy.linalg
from builders import REFERENCE, oscillator, reduced, with_ball
from orbit_cases import MODELS

import femimpact as fi
from femimpact.orbits.equations import (
    EventSequence,
    EventStates,
    derivative_by,
    event_maps,
    jacobian,
    residual,
    solve,
)
from femimpact.orbits.motion import flow_of, hybrid_system
from femimpact.orbits.orbit import state_vector
from femimpact.orbits.search import first_guess, orbit_near
from femimpact.orbits.verification import verified
from femimpact.validation import orbits as reference_orbits
from femimpact.validation.closed_forms import box_orbits

pytestmark = pytest.mark.impacts

DIGITS = json.loads((Path(__file__).parent / "data" / "orbit_derivatives.json").read_text())
"""Made once by `orbit_reference.py`."""


@pytest.fixture(scope="module")
def orbits():
    return {name: model.orbit() for name, model in MODELS.items()}


def state_of(orbit):
    return state_vector(orbit.state)


def units_of(orbit):
    d = orbit.events.displacement.shape[1]
    return np.repeat([orbit.length, orbit.length * 2 * math.pi * orbit.excitation.frequency], d)


# ---- derivatives ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_the_monodromy_has_the_digits_of_50_digit_arithmetic(orbits, name):
    orbit, exact = orbits[name], np.array(DIGITS[name]["monodromy"])
    # in units of the gap and of the gap times omega, in which its entries are of one size
    scale = units_of(orbit)[None, :] / units_of(orbit)[:, None]
    error = np.abs(orbit.monodromy - exact) * scale
    assert error.max() < 1e-8 * np.abs(exact * scale).max()


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("parameter", ["frequency", "amplitude", "gap", "restitution"])
def test_derivatives_by_a_parameter_have_the_digits_of_50_digit_arithmetic(orbits, name, parameter):
    if parameter not in DIGITS[name]:
        pytest.skip("a Kelvin-Voigt contact has its restitution by stiffness and dashpot")
    orbit = orbits[name]
    guess = first_guess(orbit.system, orbit.excitation, 1, orbit)
    hybrid = hybrid_system(orbit.system, orbit.excitation)

    def at(value):
        changed = {
            "frequency": {"omega": 2 * np.pi * value},
            "amplitude": {"amplitude": value},
            "gap": {"gaps": hybrid.gaps + value},
            "restitution": {"restitution": np.full(hybrid.restitution.shape, value)},
        }
        return replace(hybrid, **changed[parameter])

    model = MODELS[name]
    value = {"frequency": model.frequency, "amplitude": model.amplitude, "gap": 0.0, "restitution": model.law[0]}
    maps = event_maps(hybrid, guess)
    by = derivative_by(at, value[parameter], guess)
    size = by.size
    found = -np.linalg.solve(jacobian(maps).reshape(size, size), by.reshape(size)).reshape(by.shape)[0]
    exact = np.array(DIGITS[name][parameter])
    unit = np.append(units_of(orbit), 1.0)
    assert np.max(np.abs(found - exact) / unit) < 1e-8 * np.max(np.abs(exact) / unit)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("kind", ["impact", "release"])
def test_rates_of_a_condition_are_its_derivatives(orbits, name, kind):
    orbit = orbits[name]
    hybrid = hybrid_system(orbit.system, orbit.excitation)
    motion = first_guess(orbit.system, orbit.excitation, 1, orbit).motion(hybrid)
    k, step = motion.longest(), 1e-4
    middle = 0.5 * (motion.begin[k] + motion.end[k]) + np.array([-0.2, 0.0, 0.1])
    here, before, after = (motion.condition(k, (kind, 0, 1.0), middle + by) for by in (0.0, -step, step))
    derivative = (after - before)[:2] / (2 * step / hybrid.omega)
    np.testing.assert_allclose(derivative, here[1:], rtol=1e-5, atol=1e-6 * np.abs(here[1:]).max())


@pytest.mark.parametrize("name", MODELS)
def test_state_times_and_multipliers_have_the_digits_of_50_digit_arithmetic(orbits, name):
    orbit, exact = orbits[name], DIGITS[name]
    assert np.max(np.abs(state_of(orbit) - exact["state"]) / units_of(orbit)) < 1e-10
    np.testing.assert_allclose(orbit.events.time, exact["times"], rtol=1e-10)
    multipliers = np.array(exact["multipliers"]) @ [1.0, 1.0j]
    np.testing.assert_allclose(by_size(orbit.multipliers), by_size(multipliers), atol=1e-10)


def test_the_reference_case_has_the_same_digits():
    exact = DIGITS["Kelvin-Voigt"]
    assert list(reference_orbits.COMPLIANT_TIMES) == exact["times"]
    assert list(reference_orbits.COMPLIANT_STATE) == exact["state"]
    pairs = np.array(exact["multipliers"]) @ [1.0, 1.0j]
    assert set(reference_orbits.COMPLIANT_MULTIPLIERS) == {value for value in pairs.tolist() if value.imag > 0.0}


def volume(orbit, damping):
    """By how much a small volume of states shrinks in a period, with so much damping (1/s) of the structure in all.

    A rigid impact turns it by e^2, the structure's dashpots shrink it all the time, that of a contact while it pushes.
    """
    hybrid, log = hybrid_system(orbit.system, orbit.excitation), orbit.events
    pushing = np.sum(log.time[log.kind == "release"]) - np.sum(log.time[log.kind == "touch"])
    P = hybrid.force[:, 0]
    rate = hybrid.contact_damping[0] * float(P @ (P / hybrid.mass))
    impacts = np.count_nonzero(log.kind == "impact")
    return hybrid.restitution[0] ** (2 * impacts) * math.exp(-damping * orbit.period - rate * pushing)


@pytest.mark.parametrize("name", MODELS)
def test_liouville(orbits, name):
    """The product of the multipliers."""
    orbit, model = orbits[name], MODELS[name]
    exact = volume(orbit, 2 * model.ratio * sum(model.omega))
    assert abs(np.prod(orbit.multipliers) - exact) < 1e-10 * exact


@pytest.mark.parametrize(
    "law", [fi.Rigid(0.6), fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)], ids=lambda x: x.name
)
@pytest.mark.parametrize("modes", [1, 2, 3, 4])
def test_liouville_of_a_beam(modes, law):
    system = reduced(with_ball(REFERENCE, contact=law, gap=2e-3), modes)
    base = fi.Sine(0.2037e-3, 5.3)
    run = fi.integrate(system, base, fi.EventDriven(), 80.0, fi.Recorder(channels=(), ledger=False))
    orbit = fi.find_orbit(system, base, guess=run)
    assert len(orbit.impacts) == 2
    exact = volume(orbit, float(system.C.diagonal().sum()))
    assert abs(np.prod(orbit.multipliers) - exact) < 1e-10 * exact


# ---- closed forms -----------------------------------------------------------------------------------


def by_size(values):
    """Largest modulus first, of a pair the negative imaginary part."""
    return values[np.lexsort((values.imag, -np.round(np.abs(values), 8)))]


TABLE = [(0.1, 0.8, 0.01, 1.0, 20.0), (0.1, 0.6, 0.01, 1.0, 24.0), (0.05, 0.7, 0.005, 1.0, 40.0)]
OVER_FREQUENCY = [(0.1, 0.8, 0.01, ratio, 20.0) for ratio in (0.97, 0.98, 0.99, 1.01, 1.03)]
OVER_GAP = [(0.1, 0.7, 0.01, 1.0, clearance) for clearance in (10.0, 15.0, 25.0, 30.0)]
OVER_RESTITUTION = [(0.1, e, 0.01, 1.0, 20.0) for e in (0.5, 0.65, 0.9)]


def box(mu, e, zeta, ratio, clearance):
    """A ball in a box on an oscillator that a force of 1 N drives."""
    system = oscillator(damping=2 * zeta, impactors=[fi.Impactor("ball", "mass", mu, clearance / 2, fi.Rigid(e))])
    return system, fi.PointForce("mass", fi.Sine(1.0, ratio / (2 * math.pi)))


@pytest.mark.parametrize("case", [*TABLE, *OVER_FREQUENCY, *OVER_GAP, *OVER_RESTITUTION])
def test_two_impacts_meet_the_quadratic(case):
    exact = box_orbits(*case)
    found = fi.orbits.two_impact_orbits(*box(*case))
    assert found
    speeds = [orbit.impacts.approach_speed[0] for orbit in found]
    assert speeds == sorted(speeds, reverse=True)
    for orbit in found:
        speed, phase, half_map = min(exact, key=lambda each: abs(each[0] - orbit.impacts.approach_speed[0]))
        np.testing.assert_allclose(orbit.impacts.approach_speed, speed, rtol=1e-9)
        at = orbit.events.time[orbit.events.side > 0][0] * 2 * math.pi * orbit.excitation.frequency
        assert abs(np.exp(1j * at) - np.exp(1j * phase)) < 1e-9
        np.testing.assert_allclose(by_size(orbit.half_multipliers), by_size(np.linalg.eigvals(half_map)), atol=1e-9)


def test_the_published_unstable_orbit():
    (orbit, *_) = fi.orbits.two_impact_orbits(*box(0.1, 0.8, 0.01, 0.98, 20.0))
    assert abs(orbit.half_multipliers[0]) == pytest.approx(1.2605, abs=5e-5)
    assert orbit.is_symmetric
    assert not orbit.is_stable
    # the quadratic has both signs of its eigenvalue: the full map its square
    np.testing.assert_allclose(abs(orbit.multipliers), abs(orbit.half_multipliers) ** 2, rtol=1e-10)
    run = fi.integrate(orbit.system, orbit.excitation, fi.EventDriven(), 100 * orbit.period, initial=orbit.state)
    speed = orbit.impacts.approach_speed[0]
    np.testing.assert_allclose(run.impacts.approach_speed[:8], speed, rtol=1e-11)
    assert np.max(np.abs(run.impacts.approach_speed / speed - 1)) > 1e-2


def test_orbits_of_the_closed_form_are_those_of_runs():
    system, base = reduced(with_ball(REFERENCE, contact=fi.Rigid(0.6), gap=2e-3), 4), fi.Sine(0.2037e-3, 5.3)
    run = fi.integrate(system, base, fi.EventDriven(), 80.0, fi.Recorder(channels=(), ledger=False))
    settled, (closed, *_) = fi.find_orbit(system, base, guess=run), fi.orbits.two_impact_orbits(system, base)
    assert np.max(np.abs(state_of(settled) - state_of(closed)) / units_of(closed)) < 1e-11
    assert settled.is_stable
    assert settled.is_symmetric


def test_the_closed_form_holds_at_a_stop_in_space():
    model = MODELS["stop in space"]
    system, base = model.system(), fi.Sine(model.amplitude, model.frequency)
    (closed, *_) = fi.orbits.two_impact_orbits(system, base)
    assert np.max(np.abs(state_of(model.orbit()) - state_of(closed)) / units_of(closed)) < 1e-11


def test_a_stop_in_space_has_a_slow_and_a_fast_orbit():
    stop = fi.Stop("stop", "tip", (1e-3, 1e-3), fi.Rigid(0.7), fixed_to="space")
    system = fi.System.from_matrices(
        np.eye(2), np.diag([0.6, 4.0]), np.diag([900.0, 4e4]), points={"tip": [1.0, 0.8]}, stops=[stop]
    )
    fast, slow = fi.orbits.two_impact_orbits(system, fi.Sine(1e-3, 8.0))
    assert fast.impacts.approach_speed[0] > 2 * slow.impacts.approach_speed[0] > 0
    # between them lies the fold that both come from: of the slow one a half multiplier is beyond +1
    assert fast.is_stable
    assert slow.half_multipliers[0].real > 1
    assert slow.half_multipliers[0].imag == 0


def test_solutions_that_meet_a_wall_once_more_are_no_orbits():
    narrow = (0.1, 0.5, 0.01, 1.0, 2.0)
    assert box_orbits(*narrow)
    assert fi.orbits.two_impact_orbits(*box(*narrow)) == ()


def test_the_equations_are_regular_at_grazing():
    """An oscillator that just touches a stop: the map has a square root there, states and phases have none."""
    omega = 2 * math.pi * 0.2
    response = 1 / (1 - omega**2 + 0.2j * omega)
    stop = fi.Stop("stop", "mass", (abs(response), math.inf), fi.Rigid(0.6))
    system, push = oscillator(1.0, 0.2, stops=[stop]), fi.PointForce("mass", fi.Sine(1.0, 0.2))
    hybrid, crest = hybrid_system(system, push), math.pi / 2 - np.angle(response)
    one = np.zeros(1)
    sequence = EventSequence(("impact",), np.zeros(1, dtype=int), one + 1, one[:, None], one, 1)
    exact = np.array([[abs(response), 0.0]])
    maps = event_maps(hybrid, EventStates(sequence, exact, one + crest))
    assert abs(maps.speed[0]) < 1e-15
    assert np.linalg.cond(jacobian(maps).reshape(3, 3)) < 100
    off = exact + np.array([[0.0, -0.05]])
    found = solve(hybrid, EventStates(sequence, off, one + crest + 0.02), abs(response))
    assert found.converged
    np.testing.assert_allclose(found.events.states, exact, atol=1e-11)
    # it is the linear motion, and no impact: a search does not end there
    with pytest.raises(fi.DivergenceError, match="a contact begins at no speed"):
        orbit_near(system, push, EventStates(sequence, off, one + crest + 0.02))


# ---- motions without events -------------------------------------------------------------------------


def test_a_linear_structure_has_its_steady_response():
    structure = replace(REFERENCE, impactors=(), damping=fi.Rayleigh(0.02, (1, 2)))
    system, base = reduced(structure, 3), fi.Sine(1e-3, 5.1, 0.3)
    orbit = fi.find_orbit(system, base, guess=fi.State())
    omega = 2 * math.pi * base.frequency
    M, C, K = (matrix.toarray() for matrix in (system.M, system.C, system.K))
    load = system.base_load * base.amplitude * omega**2
    response = np.linalg.solve(K - omega**2 * M + 1j * omega * C, load) * np.exp(0.3j)
    np.testing.assert_allclose(orbit.state.displacement, response.imag, atol=1e-12 * abs(response).max())
    rates, largest = (1j * omega * response).imag, omega * abs(response).max()
    np.testing.assert_allclose(orbit.state.velocity, rates, atol=1e-12 * largest)
    values = np.roots([1.0, C[0, 0], K[0, 0]])
    np.testing.assert_allclose(abs(orbit.multipliers[:2]), abs(np.exp(values * orbit.period)), rtol=1e-10)
    # half a period later it is minus itself
    np.testing.assert_allclose(abs(orbit.half_multipliers[:2]) ** 2, abs(orbit.multipliers[:2]), rtol=1e-10)
    assert len(orbit.events) == len(orbit.impacts) == 0


def test_a_contact_that_lasts_is_a_spring():
    """A preloaded Kelvin-Voigt stop that never opens: one oscillator with both springs and dashpots."""
    wall = fi.Stop("wall", "mass", (-0.1, math.inf), fi.KelvinVoigt(stiffness=3.0, damping=0.2))
    push = fi.PointForce("mass", fi.Sine(0.01, 0.2))
    orbit = fi.find_orbit(oscillator(1.0, 0.1, stops=[wall]), push, guess=fi.State())
    omega = 2 * math.pi * 0.2
    place = -0.075 + (0.01 / (4.0 - omega**2 + 0.3j * omega)).imag
    assert orbit.state.displacement[0] == pytest.approx(place, abs=1e-14)
    exact = np.exp(np.roots([1.0, 0.3, 4.0]) * orbit.period)
    np.testing.assert_allclose(abs(orbit.multipliers), abs(exact), rtol=1e-12)
    assert orbit.contact_state.tolist() == [1]


def test_a_sprung_body_is_part_of_the_linear_motion():
    absorber = fi.Absorber("body", "mass", 0.1, 0.09, 0.01)
    system, push = oscillator(1.0, 0.02, absorbers=[absorber]), fi.PointForce("mass", fi.Sine(1.0, 0.15))
    orbit = fi.find_orbit(system, push, guess=fi.State())
    omega = 2 * math.pi * 0.15
    M, C = np.diag([1.0, 0.1]), np.array([[0.03, -0.01], [-0.01, 0.01]])
    K = np.array([[1.09, -0.09], [-0.09, 0.09]])
    exact = np.linalg.solve(K - omega**2 * M + 1j * omega * C, [1.0, 0.0])
    np.testing.assert_allclose(
        np.append(orbit.state.displacement, orbit.state.ball_displacement), exact.imag, atol=1e-13 * abs(exact).max()
    )


# ---- the search --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_newton_falls_quadratically(orbits, name):
    orbit = orbits[name]
    guess = first_guess(orbit.system, orbit.excitation, 1, orbit)
    hybrid = hybrid_system(orbit.system, orbit.excitation)
    moved = guess.phases + 0.02 * np.cos(np.arange(guess.phases.size))
    if not MODELS[name].is_rigid:
        # the events of one contact are near one another
        moved = guess.phases + 0.02 * np.cos(np.arange(guess.phases.size) // 3)
    off = np.sin(1 + np.arange(guess.states.size)).reshape(guess.states.shape)
    states = guess.states + 0.02 * units_of(orbit) * off
    found = solve(hybrid, replace(guess, states=states, phases=moved), orbit.length)
    assert found.converged
    assert found.changes[-1] <= 1e-12
    # each step leaves about the square of the one before, down to rounding
    falls = [(before, after) for before, after in zip(found.changes, found.changes[1:], strict=False) if after > 1e-12]
    assert len(falls) >= 3
    assert all(after < 20 * before**2 for before, after in falls)
    assert len(found.changes) <= 6
    unit = units_of(orbit)
    assert np.max(np.abs(found.events.states - guess.states) / unit) < 1e-11


def test_far_away_steps_are_damped(orbits):
    orbit = orbits["rigid"]
    guess, hybrid = first_guess(orbit.system, orbit.excitation, 1, orbit), hybrid_system(orbit.system, orbit.excitation)
    found = solve(hybrid, replace(guess, phases=guess.phases + np.array([1.3, -0.65])), orbit.length)
    assert found.changes[0] > 1
    assert found.converged
    assert np.max(np.abs(found.events.states - guess.states) / units_of(orbit)) < 1e-11


def test_the_end_of_a_run_is_a_guess_at_any_phase_of_the_base():
    model = MODELS["gravity"]
    system, base = model.system(), fi.Sine(model.amplitude, model.frequency)
    run = fi.integrate(system, base, fi.EventDriven(), 400.3 / 5.3, fi.Recorder(channels=(), ledger=False))
    for phase in (0.0, 1.0, 4.0):
        turned = replace(base, phase=phase)
        guess = first_guess(system, turned, 1, run)
        maps = event_maps(hybrid_system(system, turned), guess)
        # the run has settled: its events are those of the orbit already
        assert np.max(np.abs(residual(maps)[:, :2])) < 1e-9 * 2e-3


def with_events(solution, **changes):
    """A solution with other states or phases."""
    return replace(solution, events=replace(solution.events, **changes))


def test_an_orbit_is_confirmed_by_its_run(orbits):
    orbit = orbits["rigid"]
    guess, hybrid = first_guess(orbit.system, orbit.excitation, 1, orbit), hybrid_system(orbit.system, orbit.excitation)
    exact = solve(hybrid, guess, orbit.length)
    wrong = with_events(exact, states=exact.events.states + 1e-8 * units_of(orbit))
    with pytest.raises(fi.DivergenceError, match="not confirmed: its own run misses its start by"):
        verified(orbit.system, orbit.excitation, wrong)
    # the same events at other times: the first one that is off is named
    later = with_events(exact, phases=exact.events.phases + 1e-3)
    with pytest.raises(
        fi.DivergenceError, match=r"; event 1 of it, impact of ball 0 on its . side at t = .* s, is .* rad"
    ):
        verified(orbit.system, orbit.excitation, later)
    # a stop in the way of it
    run = fi.integrate(orbit.system, orbit.excitation, fi.EventDriven(), 5 * orbit.period, initial=orbit.state)
    stop = fi.Stop("stop", "place 0", (0.99 * float(run.steady.peak[0]), math.inf), fi.Rigid(0.6))
    blocked = fi.System.from_matrices(
        np.eye(1), orbit.system.C, orbit.system.K, points={"place 0": [6.2]}, base_load=[0.178],
        impactors=[fi.Impactor("ball 0", "place 0", 3.43e-3, 2e-3, fi.Rigid(0.6))], stops=[stop],
    )  # fmt: skip
    free = replace(guess.sequence, contact_state=np.zeros((2, 2)))
    with pytest.raises(fi.DivergenceError, match=r"no motion of the system: after .* its own run meets impact of stop"):
        orbit_near(blocked, orbit.excitation, replace(guess, sequence=free))


@pytest.mark.parametrize("name", ["rigid", "Kelvin-Voigt"])
@pytest.mark.parametrize("off", [-1e-3, -1e-9, -1e-15, 0.0, 1e-15, 1e-9, 1e-3])
def test_an_impact_at_the_start_of_a_period_changes_nothing(orbits, name, off):
    """The base's phase at t = 0 moves all events through t = 0, and none of them is lost or met twice."""
    orbit, omega = orbits[name], 2 * math.pi * orbits[name].excitation.frequency
    for time in orbit.events.time:
        base = replace(orbit.excitation, phase=omega * float(time) + off)
        found = fi.find_orbit(orbit.system, base, guess=orbit)
        assert len(found.events) == len(orbit.events)
        np.testing.assert_allclose(abs(found.multipliers[:3]), abs(orbit.multipliers[:3]), rtol=1e-9)
        speeds = np.sort(orbit.impacts.approach_speed)
        np.testing.assert_allclose(np.sort(found.impacts.approach_speed), speeds, rtol=1e-10)
        # from its state, which is that after an impact at t = 0
        again = fi.find_orbit(orbit.system, base, guess=found.state)
        assert np.max(np.abs(state_of(again) - state_of(found)) / units_of(found)) < 1e-10


@pytest.mark.parametrize("name", MODELS)
def test_stable_orbits_repeat(orbits, name):
    orbit = orbits[name]
    assert orbit.is_stable
    run = fi.integrate(
        orbit.system, orbit.excitation, fi.EventDriven(), 1000 * orbit.period,
        fi.Recorder(channels=(), ledger=False, impacts=0), orbit.state,
    )  # fmt: skip
    end = run.final_state
    reached = np.concatenate([end.displacement, end.ball_displacement, end.velocity, end.ball_velocity])
    assert np.max(np.abs(reached - state_of(orbit)) / units_of(orbit)) < 1e-6


PERIODIC = (6, 8, 9, 11, 12, 14, 18, 19, 28, 30, 32, 34, 35, 36, 37, 38, 47, 48, 49, 57, 58, 60, 62, 69)
"""Seeds of `benchmarks/orbit_search.py` whose runs settle to a periodic motion, rigid and Kelvin-Voigt."""


def test_twenty_stable_orbits_of_random_runs_repeat(monkeypatch):
    """For 1,000 cycles, within 1e-6 of the gap. On another processor a run may settle elsewhere: 20 of the 24 do."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    orbit_search = importlib.import_module("orbit_search")
    drifts, kinds = [], []
    for seed in PERIODIC:
        kind, _, fault, *_ = orbit_search.one_run(seed, drifts)
        kinds.append(kind)
        assert not fault, f"seed {seed}: {fault}"
    assert kinds.count("periodic") >= len(drifts) == 20
    assert max(drifts) < 1e-6


def test_several_periods_have_the_power_of_the_multipliers(orbits):
    orbit = orbits["gravity"]
    twice = fi.find_orbit(orbit.system, orbit.excitation, cycles=2, guess=orbit)
    np.testing.assert_allclose(abs(twice.multipliers), abs(orbit.multipliers) ** 2, rtol=1e-9)
    assert not twice.is_symmetric
    assert not orbit.is_symmetric


def test_stable_and_unstable_orbits_from_states():
    # the orbit of the table and the one beside it, which has lost its symmetry
    system, push = box(0.1, 0.8, 0.01, 0.98, 20.0)
    (unstable, *_) = fi.orbits.two_impact_orbits(system, push)
    near = replace(unstable.state, velocity=unstable.state.velocity + 1e-4)
    found = fi.orbits.find_orbits(system, push, [near, unstable.state, fi.State(), unstable])
    assert any(np.allclose(state_of(orbit), state_of(unstable), atol=1e-9) for orbit in found)
    states = [state_of(orbit) for orbit in found]
    assert all(np.abs(a - b).max() > 1e-5 for i, a in enumerate(states) for b in states[:i])


# ---- what is refused, in one line ------------------------------------------------------------------


def refused(system, excitation, words, **given):
    with pytest.raises(fi.InputError, match=words) as caught:
        fi.find_orbit(system, excitation, **{"guess": fi.State(), **given})
    assert len(str(caught.value).splitlines()) == 1


def test_other_excitations_and_laws_are_refused_by_name():
    system, push = box(0.1, 0.8, 0.01, 1.0, 20.0)
    for excitation in (
        fi.Chirp(0.1, 0.2, 10.0, amplitude=1.0),
        fi.Sine(1.0, 0.15) + fi.Sine(1.0, 0.3),
        fi.Sine(1.0, 0.15) + push,
        fi.PointForce("mass", fi.Chirp(0.1, 0.2, 10.0, amplitude=1.0)),
        fi.RecordedBase(np.sin(np.arange(50)), 0.1),
    ):
        refused(system, excitation, "excitation = .*must be one Sine")
    hertz = oscillator(damping=0.02, impactors=[fi.Impactor("ball", "mass", 0.1, 1.0, fi.Hertz(1e4))])
    refused(hertz, push, r"ball.contact = .*must be Rigid or KelvinVoigt")
    coupled = fi.System.from_matrices(np.eye(2), np.zeros((2, 2)), [[2, -1], [-1, 2]], points={"mass": [1.0, 0.0]})
    refused(coupled, push, "normal modes")
    for cycles in (0, 1.5, -1, "one", 10**6):
        refused(system, push, "cycles = ", cycles=cycles)
    for guess in (None, 1.0, "run"):
        refused(system, push, "guess", guess=guess)


def test_a_guess_of_another_system_is_refused(orbits):
    refused(
        orbits["two balls"].system, orbits["two balls"].excitation, "system = .*guess: 1 dofs", guess=orbits["rigid"]
    )
    with pytest.raises(fi.InputError, match="system = "):
        fi.orbits.find_orbits(orbits["two balls"].system, orbits["rigid"].excitation, [orbits["rigid"]])
    orbit = orbits["gravity"]
    twice = fi.find_orbit(orbit.system, orbit.excitation, cycles=2, guess=orbit)
    refused(orbit.system, orbit.excitation, "guess.cycles = 2: must divide .*, 3", cycles=3, guess=twice)


def test_motions_that_stick_or_meet_at_one_instant_are_refused():
    floor = fi.Stop("floor", "mass", (math.inf, 0.0), fi.Rigid(0.1))
    system = oscillator(damping=0.1, stops=[floor])
    refused(system, fi.PointForce("mass", fi.Sine(0.5, 0.05)), "guess: must lead to .* of balls$")
    # two equal boxes that know nothing of one another
    balls = [fi.Impactor(f"{name} ball", name, 0.1, 10.0, fi.Rigid(0.8)) for name in ("first", "second")]
    boxes = fi.System.from_matrices(
        np.eye(2), 0.02 * np.eye(2), np.eye(2), points={"first": [1.0, 0.0], "second": [0.0, 1.0]}, impactors=balls
    )
    (one, *_) = fi.orbits.two_impact_orbits(*box(0.1, 0.8, 0.01, 1.0, 20.0))
    names = ("displacement", "velocity", "ball_displacement", "ball_velocity")
    both = fi.State(**{name: np.repeat(getattr(one.state, name), 2) for name in names})
    base = fi.Sine(1.0, 1 / (2 * math.pi), math.pi)
    refused(boxes, base, "guess = '2 impacts at t = .* at one instant", guess=both)


def test_a_ball_that_touches_nothing_is_named():
    system, _ = box(0.1, 0.8, 0.01, 1.0, 20.0)
    refused(
        system, fi.PointForce("mass", fi.Sine(1e-3, 0.1)), "guess.ball = 'no contact in a period': must touch a wall"
    )


def test_a_search_that_ends_elsewhere_says_so(orbits):
    model = MODELS["rigid"]
    base = fi.Sine(model.amplitude, model.frequency)
    # too fast for an orbit with as many impacts as its first period has
    start = replace(orbits["rigid"].state, ball_velocity=[1.0])
    with pytest.raises(fi.DivergenceError, match=r"no periodic orbit found: .*residual of .*; try a run") as caught:
        fi.find_orbit(model.system(), base, guess=start)
    assert len(str(caught.value).splitlines()) == 1
    assert fi.orbits.find_orbits(model.system(), base, [start]) == ()


def test_the_closed_form_asks_for_its_system(orbits):
    system, push = box(0.1, 0.8, 0.01, 1.0, 20.0)
    with pytest.raises(fi.InputError, match="2 pairs with walls"):
        fi.orbits.two_impact_orbits(orbits["two balls"].system, orbits["two balls"].excitation)
    with pytest.raises(fi.InputError, match="must be Rigid"):
        fi.orbits.two_impact_orbits(orbits["Kelvin-Voigt"].system, orbits["Kelvin-Voigt"].excitation)
    with pytest.raises(fi.InputError, match="constant forces"):
        fi.orbits.two_impact_orbits(orbits["gravity"].system, orbits["gravity"].excitation)
    unequal = oscillator(damping=0.02, impactors=[fi.Impactor("ball", "mass", 0.1, (9.0, 10.0), fi.Rigid(0.8))])
    with pytest.raises(fi.InputError, match=r"ball.gap = .*the same on both sides"):
        fi.orbits.two_impact_orbits(unequal, push)
    assert fi.orbits.two_impact_orbits(system, fi.PointForce("mass", fi.Sine(1e-3, 0.1))) == ()


# ---- the flow ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.0, 0.01, 0.99999, 1.0, 1.00001, 5.0, 1e3])
@pytest.mark.parametrize("omega", [0.0, 3.0])
def test_a_coordinate_alone_moves_as_its_exponential(ratio, omega):
    damping = 2 * ratio * (omega or 1.0)
    system = fi.System.from_matrices(
        np.eye(2),
        np.diag([damping, 1.0]),
        np.diag([omega**2, 1.0]),
        points={"mass": [1.0, 0.0]},
        constant_load=[0.7, 0.0],
    )
    flow = flow_of(hybrid_system(system, fi.PointForce("mass", fi.Sine(1.0, 0.3))), np.zeros(0))
    for time in (1e-6, 1e-3, 0.4, 7.0):
        propagator, moved = flow.over(np.array([time]))
        augmented = np.zeros((5, 5))
        augmented[:4, :4], augmented[:4, 4] = flow.matrix, flow.constant
        # in more digits: that of double precision squares its rounding where the rates spread
        exact = np.array(mpmath.expm(mpmath.matrix(time * augmented)).tolist(), dtype=float)
        np.testing.assert_allclose(propagator[0], exact[:4, :4], rtol=0, atol=1e-14)
        np.testing.assert_allclose(moved[0], exact[:4, 4], rtol=0, atol=1e-14 * max(1.0, abs(exact[:4, 4]).max()))


@pytest.mark.parametrize("name", ["Kelvin-Voigt", "stop in space"])
def test_pressed_contacts_move_as_their_exponential(name):
    model = replace(MODELS[name], law=(3000.0, 2.0))
    hybrid = hybrid_system(model.system(), fi.Sine(model.amplitude, model.frequency))
    flow = flow_of(hybrid, np.array([1.0]))
    size = flow.constant.size
    augmented = np.zeros((size + 1, size + 1))
    augmented[:size, :size], augmented[:size, size] = flow.matrix, flow.constant
    unit = np.repeat([2e-3, 2e-3 * hybrid.omega], size // 2)
    times = np.array([1e-4, 2e-3, 5e-2])
    for time, propagator, moved in zip(times, *flow.over(times), strict=True):
        exact = scipy.linalg.expm(time * augmented)
        assert np.max(np.abs(propagator - exact[:size, :size]) * unit / unit[:, None]) < 1e-11
        assert np.max(np.abs(moved - exact[:size, size]) / unit) < 1e-11
