"""Sweeps at constant acceleration, of any channel, and with dwells that follow each other."""

import math

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact.response.channels import channel_of

pytestmark = pytest.mark.impacts

EXACT = fi.EventDriven()
FREQUENCIES = np.array([5.6, 4.8, 5.2])
ACCELERATION = 0.2


@pytest.fixture(scope="module")
def ball():
    return reduced(with_ball(REFERENCE), 3)


@pytest.fixture(scope="module")
def bare(ball):
    return fi.without_impactors(ball)


def by_hand(system, frequencies, cycles):
    state, peaks, harmonics, impacts = fi.State(), [], [], []
    for f in frequencies:
        base = fi.Sine(2e-4, f, phase=-2.0 * math.pi * f * state.time)
        run = fi.integrate(system, base, EXACT, cycles / f, initial=state)
        peaks.append(run.steady.peak[0])
        harmonics.append(run.steady.first_harmonic[0])
        impacts.append(run.statistics.impacts_per_cycle)
        state = run.final_state
    return np.array(peaks), np.array(harmonics), np.array(impacts)


def test_each_frequency_goes_on_from_the_end_of_the_one_before(ball):
    up, down = np.sort(FREQUENCIES), np.sort(FREQUENCIES)[::-1]
    both = fi.frequency_sweep(ball, 2e-4, FREQUENCIES, EXACT, 12, direction="both")
    assert list(both) == ["up", "down"]
    peaks, harmonics, impacts = by_hand(ball, (*up, *down), 12)
    assert np.any(impacts > 0)
    # the same runs: what is recorded beside does not change them
    for way, own in (("up", slice(0, 3)), ("down", slice(5, 2, -1))):
        curve = both[way]
        assert curve.direction == way
        np.testing.assert_array_equal(curve.frequency, up)
        np.testing.assert_allclose(curve.peak, peaks[own], rtol=1e-12)
        np.testing.assert_allclose(curve.first_harmonic, harmonics[own], rtol=1e-12)
        np.testing.assert_allclose(curve.impacts_per_cycle, impacts[own], rtol=1e-12)
    alone = fi.frequency_sweep(ball, 2e-4, FREQUENCIES, EXACT, 12, direction="up")
    np.testing.assert_array_equal(alone.peak, both["up"].peak)
    falling = fi.frequency_sweep(ball, 2e-4, FREQUENCIES, EXACT, 12, direction="down")
    np.testing.assert_allclose(falling.peak[::-1], by_hand(ball, down, 12)[0], rtol=1e-12)


def test_a_dwell_longer_than_three_windows_is_one_dwell(bare):
    # 20 cycles of which 6 are measured: the first two are a separate run
    whole, parts = (fi.frequency_sweep(bare, 2e-4, [5.0], EXACT, 20, **way) for way in ({}, {"direction": "up"}))
    for name in ("peak", "rms", "first_harmonic", "phase"):
        np.testing.assert_allclose(parts[name], whole[name], rtol=1e-9)


@pytest.mark.parametrize("method", [EXACT, fi.Newmark(1e-3, allow_coarse_step=True)])
def test_at_constant_acceleration_each_frequency_has_its_own_amplitude(bare, method):
    curve = fi.frequency_sweep(bare, None, FREQUENCIES, method, 12, acceleration=ACCELERATION)
    own = ACCELERATION / (2.0 * np.pi * FREQUENCIES) ** 2
    np.testing.assert_allclose(curve.base_amplitude, own, rtol=1e-15)
    assert curve.amplitude is None
    for i, f in enumerate(FREQUENCIES):
        alone = fi.frequency_sweep(bare, own[i], [f], method, 12)
        np.testing.assert_allclose(curve.peak[i], alone.peak[0], rtol=1e-12)
        np.testing.assert_allclose(alone.base_amplitude, own[i], rtol=1e-15)
    assert curve.to_pandas()["base_amplitude"].to_list() == curve.base_amplitude.tolist()


def steady(system, f):
    """Complex amplitude (dofs,) relative to a base of unit displacement."""
    w = 2.0 * np.pi * f
    matrix = (system.K - w**2 * system.M + 1j * w * system.C).toarray()
    return np.linalg.solve(matrix, w**2 * system.base_load)


@pytest.mark.parametrize("way", [{}, {"direction": "up"}])
@pytest.mark.parametrize(
    ("channel", "unit"),
    [("tip.absolute_acceleration", "m/s^2"), ("root.surface_stress", "Pa"), ("tip.velocity", "m/s")],
)
def test_any_channel_has_its_exact_steady_amplitude_and_unit(bare, channel, unit, way):
    f, cycles = 5.0, 1500
    curve = fi.frequency_sweep(bare, 2e-4, [f], EXACT, cycles, channel=channel, **way)
    assert (curve.unit, curve.at) == (unit, channel)
    assert curve.to_xarray()["peak"].attrs["units"] == unit
    assert curve.to_pandas().attrs["units"]["peak"] == unit
    w, u = 2.0 * np.pi * f, steady(bare, f)
    tip = bare.point_row("tip") @ u
    exact = {"m/s^2": -(w**2) * (tip + 1.0), "m/s": 1j * w * tip}.get(unit)
    if exact is None:
        exact = response_stress(bare) @ u
    # 1.5 e-4 of the transient is left after 1000 cycles at 0.14 % damping; phase in the same measure
    assert curve.first_harmonic[0] == pytest.approx(2e-4 * abs(exact), rel=5e-4)
    assert curve.peak[0] == pytest.approx(2e-4 * abs(exact), rel=5e-4)
    assert math.cos(curve.phase[0] - np.angle(exact)) == pytest.approx(1.0, abs=1e-6)


def response_stress(system):
    """Row (dofs,) of the stress at the root; test_section_channels.py compares it with M y / I."""
    return channel_of(system, "root.surface_stress").reading(system).displacement


def test_a_curve_of_stress_is_drawn_with_its_unit(bare):
    curve = fi.frequency_sweep(bare, None, FREQUENCIES, EXACT, 12, acceleration=1.0, channel="root.surface_stress")
    axis = fi.figures.response_curve(curve)
    assert axis.get_ylabel() == "root surface stress (MPa)"
    assert "m/s" in axis.get_title(loc="left")


def test_chains_have_the_same_bits_for_any_number_of_threads(ball):
    def curves(threads):
        return fi.frequency_sweep(
            ball, None, FREQUENCIES, EXACT, 12, acceleration=ACCELERATION, direction="both", threads=threads
        )

    one, other = curves(1), curves(3)
    for way in ("up", "down"):
        np.testing.assert_array_equal(one[way].peak, other[way].peak)
