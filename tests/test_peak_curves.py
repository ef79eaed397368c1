"""Curves swept only where their largest peak may be: values of whole sweeps, and none of their peaks missed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball

import femimpact as fi
from femimpact.sweep import SWEEP_UNITS, peak_curves

pytestmark = pytest.mark.impacts

AMPLITUDE = 0.2037e-3
GRID = np.linspace(4.5, 5.7, 25)
LAWS = [fi.KelvinVoigt(restitution=e, contact_time=2e-3) for e in (0.5, 0.95)]


def swept(systems, method, frequencies=GRID, cycles=60, **options):
    base = {"amplitude": AMPLITUDE, "acceleration": None, "initial": fi.State()}
    return peak_curves(systems, method, frequencies, cycles, **(base | options))


@pytest.fixture(scope="module")
def systems():
    return [reduced(with_ball(REFERENCE, contact=law), 4, 10) for law in LAWS]


@pytest.mark.parametrize("initial", [fi.State(), fi.State.at_rest("space"), fi.State(ball_displacement=[2e-3])])
def test_every_value_is_that_of_the_systems_own_sweep(systems, initial):
    method = fi.EventDriven()
    for system, curve in zip(systems, swept(systems, method, initial=initial, step=4), strict=True):
        whole = fi.frequency_sweep(system, AMPLITUDE, curve.frequency, method, 60, initial=initial, ledger=False)
        for name in (*SWEEP_UNITS, "steadiness"):
            np.testing.assert_array_equal(curve[name], whole[name], err_msg=name)
        assert curve.warnings == whole.warnings
        assert (curve.start, curve.cycles, curve.amplitude) == (whole.start, whole.cycles, whole.amplitude)


def test_a_method_with_steps_has_the_same_values_as_long_as_rounding_does_not_grow(systems):
    for system, curve in zip(systems, swept(systems, fi.Newmark(1e-4), cycles=6), strict=True):
        whole = fi.frequency_sweep(system, AMPLITUDE, GRID, fi.Newmark(1e-4), 6, ledger=False)
        np.testing.assert_allclose(curve.peak, whole.peak, rtol=1e-9)


def test_a_step_of_one_is_the_whole_grid(systems):
    for system, curve in zip(systems, swept(systems, fi.EventDriven()), strict=True):
        whole = fi.frequency_sweep(system, AMPLITUDE, GRID, fi.EventDriven(), 60, ledger=False)
        np.testing.assert_array_equal(curve.frequency, GRID)
        np.testing.assert_array_equal(curve.peak, whole.peak)


@pytest.mark.parametrize("step", [2, 4, 8])
@pytest.mark.parametrize("frequency", [4.8, 5.03, 5.3])
def test_the_peak_of_a_resonance_is_found_with_its_neighbours(step, frequency):
    # without impacts: a ball in a gap that the beam does not cross, whatever the step
    structure = replace(with_ball(REFERENCE, gap=0.2), damping=fi.Rayleigh(ratio=0.02, modes=(1, 2)))
    system = reduced(structure, 2, 10)
    grid = GRID * (system.first_frequency / frequency)
    (curve,) = swept([system], fi.EventDriven(), grid, step=step)
    whole = fi.frequency_sweep(system, AMPLITUDE, grid, fi.EventDriven(), 60, ledger=False)
    top = int(np.argmax(whole.peak))
    assert np.count_nonzero(curve.impacts_per_cycle) == 0
    assert (curve.peak_frequency, curve.peak_amplitude) == (whole.peak_frequency, whole.peak_amplitude)
    assert np.isin(grid[top - 1 : top + 2], curve.frequency).all()
    # and not all that is beside it
    assert curve.frequency.size < 0.75 * grid.size


def test_what_is_left_out_is_beside_no_point_near_the_peak(systems):
    for curve in swept(systems, fi.EventDriven(), step=2):
        left_out = np.flatnonzero(~np.isin(GRID, curve.frequency))
        coarse = dict(zip(curve.frequency.tolist(), curve.peak.tolist(), strict=True))
        for i in left_out:
            neighbours = [coarse[GRID[i - 1]], coarse[GRID[i + 1]]]
            assert max(neighbours) < 0.6 * curve.peak_amplitude


def test_a_scan_has_the_same_peaks_whatever_its_step(systems):
    from femimpact.calibration import scan_systems

    pairs = list(zip((0.5, 0.95), systems, strict=True))
    empty = fi.frequency_sweep(fi.without_impactors(systems[0]), AMPLITUDE, GRID, fi.EventDriven(), 400, ledger=False)
    one, four = (scan_systems(pairs, empty, frequencies=GRID, cycles=60, step=step) for step in (1, 4))
    for name in ("peak_frequency", "peak_amplitude", "amplitude_ratio", "damping_amplitude_ratio", "steadiness"):
        np.testing.assert_array_equal(one[name], four[name], err_msg=name)
    assert all(few.frequency.size < every.frequency.size for few, every in zip(four.curves, one.curves, strict=True))
