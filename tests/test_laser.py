"""A laser: its range, its noise, its samples, and what the first mode makes of its reading."""

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi

EXACT = fi.EventDriven()
STILL = fi.Sine(0.0, 5.0)


@pytest.fixture(scope="module")
def bare():
    return fi.without_impactors(reduced(with_ball(REFERENCE), 4))


@pytest.fixture(scope="module")
def run(bare):
    """Free motion in the first mode, 1 mm at mid-span."""
    state = fi.State.of_mode(bare, 1, 1e-3, at="mid")
    return fi.integrate(bare, STILL, EXACT, 2.0, fi.Recorder(("mid", "tip"), interval=5e-4), state)


def test_within_its_range_and_without_noise_it_reads_the_displacement(run):
    reading = fi.Laser("mid", range=3e-3).measure(run)
    np.testing.assert_array_equal(reading.displacement, run["mid"])
    assert reading.clipped == 0.0
    assert reading.warnings == ()


def test_beyond_its_range_it_stays_at_the_end_and_says_so(run):
    reading = fi.Laser("mid", range=1e-3, offset=2e-4).measure(run)
    np.testing.assert_allclose(reading.displacement, np.clip(run["mid"], -3e-4, 7e-4), rtol=1e-15)
    outside = np.mean((run["mid"] < -3e-4) | (run["mid"] > 7e-4))
    assert reading.clipped == outside
    assert 0.3 < outside < 0.8
    assert f"{100 * outside:.3g} % of the samples are clipped" in reading.warnings[0]


def test_noise_has_its_standard_deviation_and_is_that_of_its_seed(run):
    laser = fi.Laser("mid", range=1.0, noise=1e-4)
    one, again, other = (laser.measure(run, seed=seed).displacement - run["mid"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.any(one != other)
    # five standard errors of a standard deviation
    assert np.std(one) == pytest.approx(1e-4, rel=5 / np.sqrt(2 * one.size))


def test_between_samples_it_reads_the_spline(run):
    laser = fi.Laser("mid", range=1.0, sample_rate=730.0)
    reading = laser.measure(run)
    np.testing.assert_allclose(reading.time, np.arange(reading.time.size) / 730.0, rtol=1e-12)
    modes = fi.solve_modes(run.system, 1)
    ratio, omega = modes.damping_ratio[0], 2 * np.pi * modes.natural_frequency[0]
    damped, t = omega * np.sqrt(1 - ratio**2), reading.time
    exact = 1e-3 * np.exp(-ratio * omega * t) * (np.cos(damped * t) + ratio * omega / damped * np.sin(damped * t))
    # 5/384 (h omega)^4 of the amplitude with h omega = 0.017, and some times as much at the ends of a spline
    assert np.abs(reading.displacement - exact).max() < 1e-3 * 0.017**4


@pytest.mark.parametrize("rate", [None, 400.0])
def test_where_one_mode_moves_its_shape_carries_the_reading_exactly(bare, run, rate):
    reading = fi.Laser("mid", range=1.0, sample_rate=rate).measure(run)
    tip = fi.signals.extrapolate(bare, reading, to="tip")
    assert tip.at == "tip"
    true = run["tip"] if rate is None else fi.Laser("tip", range=1.0, sample_rate=rate).measure(run).displacement
    np.testing.assert_allclose(tip.displacement, true, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(
        fi.signals.extrapolate(bare, tip, to="mid").displacement, reading.displacement, rtol=1e-12
    )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda r: fi.Laser("mid", range=0.0), "range = 0.0 m"),
        (lambda r: fi.Laser("mid", range=1.0, noise=-1e-6), "noise = -1e-06 m"),
        (lambda r: fi.Laser("mid", range=1.0, sample_rate=0.0), "sample_rate = 0.0 Hz"),
        (lambda r: fi.Laser("root", range=1.0).measure(r), r"at = 'root': was not recorded: run with fi.Recorder\("),
        (lambda r: fi.Laser("mid", range=1.0, sample_rate=5e3).measure(r), r"interval=0\.0002"),
        (lambda r: fi.Laser("mid", range=1.0).measure(5), "response"),
        (lambda r: fi.signals.extrapolate(r.system, fi.Laser("mid", range=1.0).measure(r), mode=9), "mode = 9"),
        (lambda r: fi.signals.extrapolate(r.system, fi.Laser("mid", range=1.0).measure(r), to="nowhere"), "nowhere"),
        (lambda r: fi.signals.extrapolate(r.system, r), "measured"),
    ],
)
def test_what_cannot_be_is_one_line(run, call, words):
    with pytest.raises(fi.InputError, match=words) as refusal:
        call(run)
    assert "\n" not in str(refusal.value)
