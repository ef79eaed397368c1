"""What linear beam theory neglects of a deflection, and the warning of it."""

from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, oscillator, reduced
from scipy.integrate import solve_bvp

import femimpact as fi
from femimpact.response.cycles import LARGE, deflection_warnings

WORDS = "the beam deflects by up to"
SYSTEM = fi.without_impactors(reduced(REFERENCE, modes=2))
LENGTH = SYSTEM.length
METHODS = [fi.EventDriven(), fi.Newmark(dt=2e-3), fi.HHT(dt=2e-3), fi.GeneralizedAlpha(dt=2e-3), fi.MoreauJean(dt=2e-3)]


def elastica(load):
    """Tip of a cantilever of unit length under P = load EI/L^2: its exact deflection and distance to the root."""

    def along(s, y):
        return np.array([y[1], -load * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])])

    s = np.linspace(0.0, 1.0, 21)
    linear = np.array([load * (s - s**2 / 2), load * (1 - s), load * (s**2 / 2 - s**3 / 6), s])
    exact = solve_bvp(along, lambda root, tip: np.array([root[0], tip[1], root[2], root[3]]), s, linear, tol=1e-10)
    return exact.y[2, -1], exact.y[3, -1]


@pytest.mark.parametrize("share", [0.02, 0.05, LARGE, 0.2])
def test_a_linear_deflection_is_too_large_by_its_square(share):
    deflection, distance = elastica(3.0 * share)
    # the next term of either series is of the fourth power, of a factor below 3
    assert share / deflection - 1.0 == pytest.approx(36 / 35 * share**2, abs=3 * share**4)
    assert 1.0 - distance == pytest.approx(3 / 5 * share**2, abs=3 * share**4)


def warned(result):
    return any(text.startswith(WORDS) for text in result.warnings)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_run_and_a_sweep_warn_from_a_tenth_of_the_length_on(method):
    def run(amplitude):
        return fi.integrate(SYSTEM, fi.Sine(amplitude, 4.0), method, duration=3.0)

    def sweep(amplitude):
        return fi.frequency_sweep(SYSTEM, amplitude, [4.0, 4.5], method, cycles=12)

    # the motion is in proportion to the base's
    unit = 1e-6
    of_run = max(abs(run(unit)["tip"]).max(), run(unit).steady.peak[0])
    for largest, verb in ((of_run, run), (sweep(unit).peak.max(), sweep)):
        amplitude = unit * LARGE * LENGTH / largest
        assert warned(verb(1.001 * amplitude))
        assert not warned(verb(0.999 * amplitude))


def test_a_warning_names_the_deflection_and_its_share_of_the_length():
    (text,) = deflection_warnings([0.01, np.nan, 0.0625], 0.25)
    # no share that is rounded to the limit
    assert "up to 0.0625 m, 0.25 of its length, beyond 0.1:" in text
    assert text.endswith(" 6.2 %")
    assert "just over 0.1 of its length, beyond 0.1:" in deflection_warnings([0.025001], 0.25)[0]
    assert deflection_warnings([np.nan], 0.25) == ()


def test_every_recorded_place_counts_over_the_whole_run():
    # the tip of a beam on two pins does not move, and a shock is over before the last third of the run
    pins = (fi.Support("pinned", "root"), fi.Support("pinned", "tip"))
    damping = fi.Rayleigh(ratio=0.2, modes=(1, 2))
    system = fi.without_impactors(reduced(replace(REFERENCE, masses=(), supports=pins, damping=damping), modes=3))
    shock = fi.RecordedBase(1000.0 * np.sin(np.linspace(0.0, np.pi, 20)), 1e-3)
    runs = {
        places: fi.integrate(system, shock, fi.EventDriven(), 1.0, fi.Recorder(channels=places))
        for places in ("tip", "mid", "mid.absolute_displacement")
    }
    assert abs(runs["mid"]["mid"]).max() > LARGE * system.length
    assert [places for places, run in runs.items() if warned(run)] == ["mid"]


def test_an_oscillator_and_a_ball_have_no_deflection():
    run = fi.integrate(oscillator(stiffness=100.0), fi.Sine(1.0, 1.0), fi.EventDriven(), 3.0)
    assert run.warnings == ()
    # the box is wider than a tenth of the beam
    ball = fi.Impactor("ball", "tip", mass=1e-3, gap=0.05, contact=fi.Rigid(0.6))
    system = reduced(replace(REFERENCE, impactors=[ball]), modes=2)
    leaving = fi.State(ball_velocity=[0.1])
    run = fi.integrate(system, fi.Sine(1e-6, 4.0), fi.EventDriven(), 1.0, initial=leaving)
    assert abs(run["ball"]).max() > LARGE * LENGTH
    assert not warned(run)
