"""Stroboscopic sections: channels once per base cycle."""

from __future__ import annotations

import math

import numpy as np
import pytest

import femimpact as fi
from femimpact.response.history import stroboscopic

pytestmark = pytest.mark.impacts

UNITS = {"tip": "m", "tip.velocity": "m/s", "contact_force": "N"}


def sine(samples, cycles, frequency, base_phase=0.0):
    """A steady motion: tip leads the base by 0.7 rad, and a force of twice the frequency."""
    time = np.linspace(0.0, cycles / frequency, samples * cycles + 1)
    phase = 2 * math.pi * frequency * time + base_phase
    channels = {
        "tip": np.sin(phase + 0.7),
        "tip.velocity": 2 * math.pi * frequency * np.cos(phase + 0.7),
        "contact_force": np.cos(2 * phase),
    }
    return time, channels, fi.Sine(1e-3, frequency, base_phase)


@pytest.mark.parametrize("base_phase", [0.0, 2.5])
def test_samples_on_the_grid_are_read_as_they_are(base_phase):
    time, channels, base = sine(16, 9, 7.0, base_phase)
    # the phase of sample 3 of every cycle
    section = stroboscopic(time, channels, UNITS, base, base_phase + 2 * math.pi * 3 / 16)
    np.testing.assert_allclose(section.time, time[3::16], rtol=0.0, atol=1e-12)
    for name, values in channels.items():
        np.testing.assert_array_equal(section[name], values[3::16])


def test_a_periodic_motion_is_one_point():
    time, channels, base = sine(64, 20, 5.0, 1.1)
    section = stroboscopic(time, channels, UNITS, base, 2.0)
    assert section.time.size == 20
    # the same place between two samples in every cycle: one value, to rounding of the time
    for name, scale in (("tip", 1.0), ("tip.velocity", 31.4), ("contact_force", 1.0)):
        assert np.ptp(section[name]) < 1e-9 * scale


@pytest.mark.parametrize(("name", "order", "exact"), [("tip", 4, math.sin(2.7)), ("contact_force", 2, math.cos(4.0))])
def test_interpolation_has_its_order(name, order, exact):
    errors = []
    for samples in (50, 100, 200):
        # a phase of 2 rad is between samples of each
        section = stroboscopic(*sine(samples, 3, 5.0)[:2], UNITS, fi.Sine(1e-3, 5.0), 2.0)
        errors.append(np.abs(section[name] - exact).max())
    # the place between the neighbours differs from grid to grid: the bound falls with the order, not every error
    spacing = 2 * math.pi / np.array([50, 100, 200])
    bound = spacing**4 / 384 if order == 4 else 4.0 * spacing**2 / 8
    assert np.all(errors <= bound)
    assert errors[0] > 1e-3 * bound[0]


def test_without_its_velocity_a_displacement_is_read_from_the_straight_line():
    time = np.array([0.0, 0.4, 1.0])
    channels = {"tip": np.array([0.0, 4.0, 1.0])}
    section = stroboscopic(time, channels, {"tip": "m"}, fi.Sine(1e-3, 1.0), math.pi)
    np.testing.assert_allclose(section.time, [0.5])
    np.testing.assert_allclose(section["tip"], [4.0 - 3.0 / 6.0])


def test_a_run_gives_its_section(small):
    record = fi.Recorder(channels=("tip", "tip.velocity", "ball"))
    response = fi.integrate(small, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 2.0, record)
    section = response.stroboscopic()
    np.testing.assert_allclose(section.time, np.arange(11) / 5.0, atol=1e-12)
    assert set(section.channels) == set(response.channels)
    np.testing.assert_array_equal(section["tip"], response["tip"][np.searchsorted(response.time, section.time - 1e-9)])
    with pytest.raises(fi.InputError, match="phase"):
        response.stroboscopic(math.nan)
    with pytest.raises(fi.InputError, match="channel = 'top'"):
        section["top"]


def test_a_record_has_no_phase_and_no_section_and_still_a_portrait(small):
    pytest.importorskip("matplotlib")
    base = fi.RecordedBase(np.sin(np.arange(400) / 6.0), interval=5e-3)
    record = fi.Recorder(channels=("tip", "tip.velocity"), interval=1.0 / (64 * base.frequency))
    response = fi.integrate(fi.without_impactors(small), base, fi.EventDriven(), 1.0, record)
    with pytest.raises(fi.InputError, match=r"base\.phase = nan rad: must be finite"):
        response.stroboscopic()
    (portrait,) = fi.figures.phase_portrait(response, ax=fi.figures.OffScreen()).lines
    # of 64 samples in a cycle, each interval is drawn in 16 pieces
    np.testing.assert_allclose(portrait.get_ydata()[::16], 1e3 * response["tip.velocity"])


def test_a_streamed_run_has_no_cycles(small):
    record = fi.Recorder(sink=lambda piece: None)
    response = fi.integrate(small, fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 1.0, record)
    assert response.stroboscopic().time.size == 0
