"""A record with too few samples is warned of, by how much its peak is wrong, and one with enough is not."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, oscillator, paper_study, prepare
from scipy.interpolate import CubicSpline

import femimpact as fi
from femimpact.excitation.harmonic import PiecewiseMotion
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.integrators.record_reading import coarse_record, record_coarseness

FULL = fi.assemble(REFERENCE, elements=20)
BARE = fi.without_impactors(FULL)
ONE = fi.reduce(BARE, 1)
SAID = "the record is coarse"


def half_sine(interval, end=0.5):
    t = np.arange(0.0, end, interval)
    return fi.RecordedBase(100.0 * np.where(t < 0.011, np.sin(np.pi * t / 0.011), 0.0), interval)


def sine(rate, frequency=5.3, duration=10.0):
    return fi.RecordedBase(np.sin(2 * np.pi * frequency * np.arange(0.0, duration, 1.0 / rate)), 1.0 / rate)


def said_of(system, drive, duration, method=None):
    """What a run says of its record, %: below a spline is negative; 0 where nothing is said."""
    told = fi.integrate(system, drive, method or fi.EventDriven(), duration).warnings
    found = [re.search(r"contacts ([\d.e+-]+) % (below|above)", text) for text in told if SAID in text]
    assert len(found) <= 1
    return sum(float(one[1]) * {"below": -1.0, "above": 1.0}[one[2]] for one in found)


class BySpline(PiecewiseMotion):
    """The motion of the base whose acceleration is the cubic spline through a record."""

    def __init__(self, record):
        self.record = record
        self.frequency = record.frequency

    @property
    def closed_form(self):
        """Cubic pieces."""
        spline = CubicSpline(self.record.interval * np.arange(self.record.samples.size), self.record.samples)
        return PiecewisePolynomial(spline.x, spline.c[::-1].T)


@pytest.mark.parametrize(
    ("record", "duration", "expected"),
    [
        (half_sine(0.001), 1.0, 0.0),
        (half_sine(0.003), 1.0, -3.2),
        (half_sine(0.005), 1.0, -15.0),
        (sine(200), 10.0, 0.0),
        (sine(50), 10.0, -3.6),
        (sine(25), 10.0, -13.0),
        (sine(12), 10.0, -30.0),
    ],
)
def test_the_size_told_is_that_of_two_exact_runs(record, duration, expected):
    told = said_of(ONE, record, duration)
    peaks = [
        abs(fi.integrate(ONE, drive, fi.EventDriven(), duration).largest("tip").value)
        for drive in (record, BySpline(record))
    ]
    true = 100.0 * (peaks[0] / peaks[1] - 1.0)
    # two digits are told, and the peak is read at 24 instants in a cycle: (pi/24)^2/2 = 0.9 % of itself
    assert told == pytest.approx(true if abs(true) > 1.0 else 0.0, rel=0.06)
    assert told == pytest.approx(expected, rel=0.06)


def test_contacts_methods_and_places_of_the_record_change_nothing_of_it():
    record, balls = sine(25, duration=2.0), fi.reduce(FULL, 1)
    expected = said_of(ONE, record, 2.0)
    assert expected < -5.0
    assert said_of(balls, record, 2.0) == expected
    assert said_of(ONE, record, 2.0, fi.Newmark(1e-3)) == expected
    # one mode follows a force as it follows the base
    assert said_of(ONE, fi.PointForce("tip", record), 2.0) == expected
    # beside a sine a hundred times as large the record decides nothing, beside a small one all
    assert said_of(ONE, record + fi.Sine(0.1, 5.3), 2.0) == 0.0
    assert said_of(ONE, record + fi.Sine(1e-9, 7.0), 2.0) == pytest.approx(expected, rel=0.06)


def test_a_noisy_record_that_is_sampled_well_is_not_warned_of():
    rng = np.random.default_rng(5)
    for rate in (200.0, 1000.0):
        samples = rng.normal(size=int(10 * rate))
        # the spectrum is as high at half the sampling rate as anywhere
        for system in (ONE, fi.reduce(BARE, 4), BARE):
            assert not coarse_record(*record_coarseness(system, fi.RecordedBase(samples, 1.0 / rate), 10.0))


def test_a_stiff_structure_follows_a_record_as_if_at_rest():
    # at 1 kHz, damped as metal is: the peak is that of the record between its samples
    stiff = oscillator((2e3 * np.pi) ** 2, 10.0)
    assert said_of(stiff, sine(400, 5.0, 1.0), 1.0) == 0.0
    # each crest lies in the middle between two samples, 90 degrees apart: a line cuts it off at cos(pi/4)
    t = np.arange(0.0, 4.0, 0.05)
    cut = fi.RecordedBase(np.minimum(t / 2.0, 1.0) * np.sin(2 * np.pi * 5.0 * t + np.pi / 4), 0.05)
    # the spline misses little of it
    assert said_of(stiff, cut, 4.0) == pytest.approx(-29.0, abs=4.0)


def test_short_records_and_runs_are_read(recwarn):
    for samples in ([1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0]):
        for duration in (0.004, 0.02):
            fi.integrate(ONE, fi.RecordedBase(samples, 0.002), fi.EventDriven(), duration)
    assert not coarse_record(*record_coarseness(oscillator(0.0), sine(12, duration=1.0), 1.0))
    # nothing but what the runs themselves say
    assert {one.category for one in recwarn} <= {fi.ResultWarning}


def test_a_study_says_it_before_its_run(tmp_path):
    record = sine(25, duration=2.0)
    rows = "\n".join(f"{i * record.interval:.9g},{a:.9g}" for i, a in enumerate(record.samples))
    study = replace(paper_study(), base=fi.RecordedBase.from_text(f"{rows}\n"), duration=None, sweep=None)
    assert sum(SAID in text for text in prepare(study, ("simulate",)).warnings) == 1
    assert not any(SAID in text for text in prepare(study, ("modes",)).warnings)


def test_an_offset_in_a_sum_gets_the_advice_on_drift():
    t = np.arange(0.0, 4.0, 1e-3)
    drift = fi.RecordedBase(np.sin(2 * np.pi * 5.0 * t) + 0.5, 1e-3)
    alone = fi.integrate(ONE, drift, fi.EventDriven(), 1.0).warnings
    for whole in (drift + fi.Sine(1e-3, 3.0), fi.Sine(1e-3, 3.0) + drift + fi.Sine(1e-3, 4.0)):
        told = fi.integrate(ONE, whole, fi.EventDriven(), 1.0).warnings
        assert [text for text in told if "moves by up to" in text] == [text for text in alone if "moves by" in text]
        assert not any("in metres?" in text for text in told)
    # each sine is small, and both are not
    both = fi.Sine(0.3 * ONE.length, 1.0) + fi.Sine(0.3 * ONE.length, 2.0)
    assert any("in metres?" in text for text in fi.integrate(ONE, both, fi.EventDriven(), 1.0).warnings)
