"""The search of periodic orbits: what is one orbit, what is refused, and why; against closed forms."""

import math

import numpy as np
import pytest
from builders import oscillator

import femimpact as fi
from femimpact.orbits.equations import _at_rounding
from femimpact.orbits.search import first_guess

pytestmark = pytest.mark.impacts

FIRST = 1 / (2 * math.pi)
"""Natural frequency (Hz) of an oscillator of 1 kg and 1 N/m."""


def force(ratio, amplitude=1.0):
    """A sine of so many natural frequencies."""
    return fi.PointForce("mass", fi.Sine(amplitude, ratio * FIRST))


def boxed(gap=10.0, restitution=0.7, damping=0.0):
    """A ball between two equal walls on an oscillator."""
    return oscillator(damping=damping, impactors=[fi.Impactor("ball", "mass", 0.1, gap, fi.Rigid(restitution))])


def stopped(law, damping=0.1, gap=0.3, names=("stop",)):
    """An oscillator with stops to its + side."""
    return oscillator(damping=damping, stops=[fi.Stop(name, "mass", (gap, math.inf), law) for name in names])


def test_steps_that_halve_are_no_rounding():
    # Newton's method at a double root halves its error: it is as large as the step
    assert not _at_rounding([0.08 * 0.5**k for k in range(24)])
    # at a simple root it falls quadratically, and then moves by what rounding leaves
    assert _at_rounding([1e-2, 1e-4, 3e-9, 2e-9])
    # from the orbit itself it is rounding at once, and what still falls is not
    assert _at_rounding([4e-9, 2e-9])
    assert not _at_rounding([1e-3, 1e-5, 1e-9])


def test_a_resonance_without_damping_is_refused_as_in_runs():
    words = "frequency = .* Hz: must not be a natural frequency of an undamped mode"
    for search in (
        lambda: fi.orbits.two_impact_orbits(boxed(), force(1.0)),
        lambda: fi.find_orbit(boxed(), force(1.0), guess=fi.orbits.two_impact_orbits(boxed(), force(0.99))[0]),
        lambda: fi.orbits.find_orbits(boxed(), force(1.0), [fi.State()]),
        lambda: fi.integrate(boxed(), force(1.0), fi.EventDriven(), 10.0),
    ):
        with pytest.raises(fi.InputError, match=words):
            search()


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-6, -1e-6])
def test_an_oscillator_at_rest_on_its_stop_has_the_orbit_of_the_closed_form(gap):
    """One impact in a period, by hand: the steady motion, and a free one that the impact makes anew."""
    zeta, ratio, restitution = 0.05, 2.7, 0.6
    eta, period = math.sqrt(1 - zeta**2), 2 * math.pi / ratio
    decay, c, s = math.exp(-zeta * period), math.cos(eta * period), math.sin(eta * period)
    flow = decay * np.array([[c + zeta / eta * s, s / eta], [-s / eta, c - zeta / eta * s]])
    # the free motion per unit of the approach speed, just before the impact
    place, rate = flow @ np.linalg.solve(np.eye(2) - flow, [0.0, -(1 + restitution)])
    response = 1.2 / (1 - ratio**2 + 2j * zeta * ratio)
    # |X|^2 = (gap - place v)^2 + ((1 - rate) v/ratio)^2
    square = [place**2 + ((1 - rate) / ratio) ** 2, -2 * gap * place, gap**2 - abs(response) ** 2]
    speed = max(np.roots(square).real)
    phase = math.atan2(gap - place * speed, (1 - rate) * speed / ratio) - np.angle(response)
    system = stopped(fi.Rigid(restitution), 2 * zeta, gap)
    push = force(ratio, 1.2)
    start = fi.State([gap], [-restitution * speed], time=(phase % (2 * math.pi)) / ratio)
    run = fi.integrate(system, push, fi.EventDriven(), 60 * period)
    for guess in (start, run):
        orbit = fi.find_orbit(system, push, guess=guess)
        assert orbit.impacts.approach_speed == pytest.approx(speed, rel=1e-10)
        # Liouville
        assert np.prod(orbit.multipliers) == pytest.approx(restitution**2 * math.exp(-2 * zeta * period), rel=1e-10)


@pytest.mark.parametrize("damping", [0.02, 1e-6])
@pytest.mark.parametrize("phase", [0.0, 0.5 * math.pi, 1.0])
def test_the_unit_of_a_motion_without_walls_is_its_size_at_any_phase(damping, phase):
    push = fi.PointForce("mass", fi.Sine(1.0, FIRST, phase))
    orbit = fi.find_orbit(oscillator(damping=damping), push, guess=fi.State())
    # at resonance |x| = |F|/(c omega): the larger of |x| and |x'/omega| is no less than this over sqrt 2
    assert 1 / math.sqrt(2) - 1e-8 <= orbit.length * damping <= 1 + 1e-8


def test_an_orbit_of_several_periods_is_one_orbit_from_each_of_them():
    """Begun one period of the drive later, it is the same motion with another state at t = 0."""
    system, push = stopped(fi.Rigid(0.8)), force(2.093220338983051)
    drive = 1 / push.frequency
    run = fi.integrate(system, push, fi.EventDriven(), 800 * drive)
    orbit = fi.find_orbit(system, push, 2, guess=run)
    left = fi.integrate(system, push, fi.EventDriven(), drive, initial=orbit.state).final_state
    later = fi.State(left.displacement, left.velocity)
    assert abs(later.displacement[0] - orbit.state.displacement[0]) > 0.01
    for guess in (orbit.state, later):
        # the orbit has the state of the guess at the time of the guess
        found = fi.find_orbit(system, push, 2, guess=guess)
        assert found.state.displacement == pytest.approx(guess.displacement, abs=1e-8)
        assert found.state.velocity == pytest.approx(guess.velocity, abs=1e-8)
    assert len(fi.orbits.find_orbits(system, push, [orbit, later, orbit.state, run], 2)) == 1


def settled(damping=0.02):
    """A run in a box that has settled on the orbit with two impacts."""
    system = boxed(12.0, damping=damping)
    return fi.integrate(system, force(1.0), fi.EventDriven(), 400 / FIRST)


OTHER_DRIVES = {
    "Chirp": fi.Chirp(0.1, 0.2, 30.0, amplitude=0.1),
    "Shock": fi.Shock("half-sine", 0.1, 0.1),
    "Sum": fi.Sine(0.1, 0.1) + fi.Sine(0.1, 0.2),
    "Drives": fi.Sine(0.1, 0.1) + force(1.0),
    "HammerBlow": fi.HammerBlow("mass", impulse=0.01, duration=0.003),
}


def test_guesses_that_lead_to_no_orbit_are_left_out_and_faulty_calls_are_refused():
    run = settled()
    system, push = run.system, run.base
    orbit, twice = fi.find_orbit(system, push, guess=run), fi.find_orbit(system, push, 2, guess=run)
    compliant = oscillator(
        damping=0.02, impactors=[fi.Impactor("ball", "mass", 0.1, 12.0, fi.KelvinVoigt(stiffness=200.0, damping=1.0))]
    )
    soft = fi.find_orbit(compliant, push, guess=fi.integrate(compliant, push, fi.EventDriven(), 200 / FIRST))
    to_plus = stopped(fi.Rigid(0.8), gap=0.3)
    to_minus = oscillator(damping=0.1, stops=[fi.Stop("stop", "mass", (math.inf, 0.3), fi.Rigid(0.8))])
    met = fi.find_orbit(to_plus, push, guess=fi.integrate(to_plus, push, fi.EventDriven(), 400 / FIRST))
    beyond = fi.State(ball_displacement=[13.0])
    for of, guess, words in (
        (system, twice, "guess.cycles = 2: must divide"),
        (system, soft, "guess.ball = 'kelvin-voigt on the . side': must be met at a wall of the same law"),
        (compliant, orbit, "guess.ball = 'rigid on the . side'"),
        (to_minus, met, r"guess.stop = 'rigid on the \+ side'"),
        (system, beyond, "guess.ball.gap = 13.0 m: must start between its walls"),
        *(
            (system, fi.integrate(system, drive, fi.EventDriven(), 5.0), f"guess = 'a run under {name}': must be")
            for name, drive in OTHER_DRIVES.items()
        ),
    ):
        with pytest.raises(fi.InputError, match=words) as caught:
            fi.find_orbit(of, push, guess=guess)
        assert len(str(caught.value).splitlines()) == 1
        assert fi.orbits.find_orbits(of, push, [guess]) == ()
    assert len(fi.orbits.find_orbits(system, push, [beyond, twice, soft, run, orbit])) == 1
    # the state of another motion is a guess of any
    assert fi.find_orbit(system, push, guess=soft.state).impacts.approach_speed == pytest.approx(
        orbit.impacts.approach_speed, rel=1e-10
    )
    for guess, words in (
        (fi.State(displacement=[1.0, 2.0]), "guess.displacement = .* must hold 1 finite numbers"),
        (fi.State(ball_velocity=[1.0, 2.0]), "guess.ball_velocity = "),
        (
            fi.find_orbit(oscillator(damping=0.1), push, guess=fi.State()),
            "system = '1 dofs, 1 balls and 0 stops': .*0 b",
        ),
    ):
        with pytest.raises(fi.InputError, match=words):
            fi.orbits.find_orbits(system, push, [guess])


def test_a_sum_of_one_sine_is_a_sine():
    run = settled()
    one = fi.PointForce("mass", fi.excitation.Sum((run.base.history,)))
    for guess in (run, fi.integrate(run.system, one, fi.EventDriven(), 400 / FIRST)):
        for push in (run.base, one):
            found = fi.find_orbit(run.system, push, guess=guess)
            assert len(found.impacts) == 2
            assert found.is_symmetric


def test_many_cycles_are_no_chatter():
    """600 periods of two impacts each: 2400 events in two periods of the orbit."""
    run = settled()
    guess = first_guess(run.system, run.base, 600, run)
    assert len(guess.phases) == 1200


def test_no_solution_of_the_closed_form_vanishes_by_rounding():
    # beside the resonance the steady response is 1e6 gaps, and its rounding above what confirms an orbit
    with pytest.raises(fi.DivergenceError, match=r"not confirmed: its own run misses its start by .* above 1e-10"):
        fi.orbits.two_impact_orbits(boxed(), fi.PointForce("mass", fi.Sine(1.0, 0.159155)))
    # a little farther away it is one
    assert len(fi.orbits.two_impact_orbits(boxed(), force(0.99))) >= 1


def test_impacts_of_two_pairs_at_one_instant_are_named_from_an_orbit_too():
    def pair(second):
        stops = [fi.Stop(f"{name} stop", name, (3.0, math.inf), fi.Rigid(0.7)) for name in ("first", "second")]
        return fi.System.from_matrices(
            np.eye(2), 0.2 * np.eye(2), np.diag([1.0, second]), base_load=[1.0, 1.0], stops=stops,
            points={"first": [1.0, 0.0], "second": [0.0, 1.0]},
        )  # fmt: skip

    base = fi.Sine(1.0, 1.1 * FIRST)
    split = fi.find_orbit(pair(1.05), base, guess=fi.integrate(pair(1.05), base, fi.EventDriven(), 400 / FIRST))
    with pytest.raises(fi.DivergenceError, match=r"has impacts of 2 pairs at one instant, t = .* not looked for"):
        fi.find_orbit(pair(1.0), base, guess=split)


def test_compliant_stops_that_touch_at_one_instant_are_one_stop():
    """Two equal ones side by side are one with twice the stiffness and dashpot, and their forces have no jump."""
    push = force(0.9)
    soft = fi.KelvinVoigt(stiffness=20.0, damping=0.2)
    both, one = (
        stopped(soft, gap=1.0, names=("first", "second")),
        stopped(fi.KelvinVoigt(stiffness=40.0, damping=0.4), gap=1.0),
    )
    double, single = (
        fi.find_orbit(system, push, guess=fi.integrate(system, push, fi.EventDriven(), 400 / FIRST))
        for system in (both, one)
    )
    assert len(double.impacts) == 2 * len(single.impacts) > 0
    # of the gap of 1 m; multipliers have the digits of the flow between 6 events
    np.testing.assert_allclose(double.state.displacement, single.state.displacement, atol=1e-12)
    np.testing.assert_allclose(double.state.velocity, single.state.velocity, atol=1e-12)
    np.testing.assert_allclose(double.multipliers, single.multipliers, atol=1e-10)


@pytest.mark.parametrize("ratio", [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.3])
def test_a_motion_without_damping_is_not_stable(ratio):
    """Its disturbances neither grow nor decay, whatever side of 1 rounding puts the multipliers."""
    orbit = fi.find_orbit(oscillator(ratio**2), fi.PointForce("mass", fi.Sine(1.0, 0.11)), guess=fi.State())
    assert np.max(abs(abs(orbit.multipliers) - 1)) < 1e-14
    assert not orbit.is_stable
    # exp(-c T/2) of a dashpot that takes 2e-9 in a period
    damped = fi.find_orbit(oscillator(ratio**2, 4e-10), orbit.excitation, guess=orbit)
    assert damped.is_stable
    branch = fi.continue_orbit(orbit, "amplitude", to=(0.9, 1.1))
    assert not branch.is_stable.any()
