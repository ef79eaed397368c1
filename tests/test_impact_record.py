"""The record of impacts: phases, shares, files that read back, figures, and the regime of a run."""

import dataclasses
import math

import numpy as np
import pytest
from builders import FILES, impact_table, reduced, with_ball

import femimpact as fi
from femimpact.app.tasks.run import impact_files
from femimpact.app.tasks.task import write_files
from femimpact.files import read_csv, write_csv, write_netcdf
from femimpact.response.impacts import IMPACT_UNITS, StickingPhases, impact_columns
from femimpact.response.regimes import classify, impacts_per_cycle
from femimpact.table import column_units

pytestmark = pytest.mark.impacts

FREQUENCY = 5.0
SINE = fi.Sine(amplitude=0.2037e-3, frequency=5.2, phase=0.7)


def table(time, side, speed, **more):
    return impact_table(FREQUENCY, time, side, speed, **more)


# ---- the table ------------------------------------------------------------------------------------


def test_shares_sum_to_one_or_are_zero():
    to_modes = np.array([[3e-6, -1e-6, 0.0], [0.0, 0.0, 0.0], [-2e-6, -2e-6, 4e-6]])
    impacts = table([0.1, 0.2, 0.3], 1, 0.3, to_modes=to_modes)
    np.testing.assert_allclose(impacts.mode_share, [[0.75, 0.25, 0.0], [0, 0, 0], [0.25, 0.25, 0.5]])
    np.testing.assert_allclose(impacts.energy_to_higher_modes, [-1e-6, 0.0, 2e-6])
    # nothing known is not zero
    assert np.isnan(table([0.1], 1, 0.3).energy_to_higher_modes).all()
    assert np.isfinite(table([0.1], 1, 0.3, to_modes=[[1.0]]).energy_to_higher_modes).all()


def test_the_head_of_the_table_is_readable():
    rows = repr(table((np.arange(40) + 0.2) / FREQUENCY, 1, 0.3)).splitlines()
    assert rows[0] == "Impacts: 40 (contact law of ball: rigid)"
    assert rows[1].split()[:4] == ["time", "phase", "impactor", "side"]
    assert rows[2].split()[:2] == ["s", "rad"]
    assert len({len(row) for row in rows[1:-1]}) == 1
    # the first three and the last two
    assert (len(rows), set(rows[6].split())) == (10, {"..."})
    assert rows[7].split()[0] == f"{38.2 / FREQUENCY:.5g}"
    assert "3 more not kept" in repr(table([], 1, 0.3, dropped=3))


@pytest.fixture(scope="module")
def light(reference):
    return reduced(reference, 4, 10)


@pytest.fixture(scope="module")
def response(light):
    method = fi.Newmark(dt=fi.recommended_step(light))
    return fi.integrate(light, SINE, method, 6.0, fi.Recorder(channels=("tip",), every=10_000))


@pytest.fixture(scope="module")
def event_driven(reference):
    rigid = reduced(with_ball(reference, contact=fi.Rigid(restitution=0.6)), 4, 10)
    sine = fi.Sine(amplitude=3e-3, frequency=5.2)
    return fi.integrate(rigid, sine, fi.EventDriven(), 15.0, fi.Recorder(channels=("tip",)))


def test_phases_are_those_of_the_known_sine_and_all_impacts_stay_when_histories_are_thinned(response):
    impacts = response.impacts
    assert len(impacts) > 5 * response.time.size > 0
    assert ((impacts.phase >= 0) & (impacts.phase < 2 * np.pi)).all()
    moved = SINE.amplitude * np.sin(impacts.phase)
    np.testing.assert_allclose(moved, SINE.displacement(impacts.time), atol=1e-15)
    assert set(impacts.contact_law) == {"kelvin-voigt"}


@pytest.mark.parametrize("run", ["response", "event_driven"])
def test_csv_and_netcdf_hold_the_same_table(run, request, tmp_path):
    import xarray

    impacts = request.getfixturevalue(run).impacts
    columns, units = impact_columns(impacts)
    path = write_csv(tmp_path / "impacts.csv", columns, units)
    assert path.read_text().startswith("time [s],phase [rad],impactor,side [1],approach_speed [m/s]")
    back = read_csv(path)
    assert list(back) == list(columns)
    file = write_netcdf(tmp_path / "impacts.nc", impacts.to_xarray())
    data = xarray.load_dataset(file, engine="h5netcdf")
    for name, unit in IMPACT_UNITS.items():
        np.testing.assert_array_equal(back[name], getattr(impacts, name))
        np.testing.assert_array_equal(data[name], getattr(impacts, name))
        assert data[name].attrs.get("units", "") == unit
        assert data[name].dims == ("impact",)
    modes = impacts.energy_to_modes.shape[1]
    if modes:
        assert data["mode_share"].dims == ("impact", "mode")
        np.testing.assert_array_equal(data["energy_to_modes"], impacts.energy_to_modes)
        np.testing.assert_array_equal(back["share_of_mode_2"], impacts.mode_share[:, 1])
        np.testing.assert_allclose(data["mode_share"].sum("mode"), 1.0, rtol=1e-12)


def test_an_empty_table_reads_back(tmp_path):
    import xarray

    empty = table([], 1, 0.3)
    columns, units = impact_columns(empty)
    assert read_csv(write_csv(tmp_path / "impacts.csv", columns, units))["time"].size == 0
    file = write_netcdf(tmp_path / "impacts.nc", empty.to_xarray())
    assert xarray.load_dataset(file, engine="h5netcdf")["time"].size == 0


def test_a_rigid_impact_loses_its_impulse_times_the_mean_relative_speed(event_driven):
    impacts = event_driven.impacts
    assert impacts.energy_to_modes.shape == (len(impacts), 4)
    lost = 0.5 * impacts.impulse * (impacts.approach_speed - impacts.rebound_speed)
    np.testing.assert_allclose(impacts.energy_loss, lost, rtol=1e-6, atol=1e-15)
    assert np.isnan(impacts.peak_force).all()
    assert set(impacts.contact_law) == {"rigid"}


# ---- of a run -------------------------------------------------------------------------------------


def test_a_run_knows_its_regime_over_its_last_third(event_driven):
    start, end = event_driven.window
    assert (start, end) == pytest.approx((10.0, 15.0))
    expected = classify(event_driven.impacts, event_driven.sticking, 5.2, start, end)
    assert event_driven.regime == expected
    assert event_driven.regime.criterion
    assert math.isfinite(impacts_per_cycle(event_driven.impacts, 5.2, start, end))


@pytest.mark.parametrize("run", ["response", "event_driven"])
def test_figures_show_units_walls_and_regime(run, request):
    result = request.getfixturevalue(run)
    histograms = fi.figures.impact_histograms(result, fi.figures.OffScreen())
    labels = [axis.get_xlabel() for axis in histograms]
    assert [label.partition(" (")[0] for label in labels] == ["approach speed", "impulse", "energy loss"]
    assert all(unit in label for unit, label in zip(("m/s)", "N s)", "J)"), labels, strict=True))
    start, end = result.window
    inside = np.count_nonzero((result.impacts.time >= start) & (result.impacts.time <= end))
    for axis in histograms:
        bars = [bar.get_height() for group in axis.containers for bar in group]
        assert sum(bars) == inside
    axis = fi.figures.impulse_phase(result, fi.figures.OffScreen())
    walls = [line for line in axis.lines if "wall" in line.get_label()]
    assert sum(line.get_xdata().size for line in walls) == inside
    # in degrees
    chosen = (result.impacts.time >= start) & (result.impacts.time < end)
    degrees = np.concatenate([line.get_xdata() for line in walls])
    np.testing.assert_allclose(np.sort(degrees), np.sort(result.impacts.phase[chosen] * 180.0 / np.pi), rtol=1e-12)
    for look in ("marker", "color"):
        assert len({line.properties()[look] for line in walls}) == 2
    assert result.regime.label in axis.get_title(loc="left").replace("\n", " ")


def test_impulses_without_a_phase_are_drawn_over_time(response):
    phase = np.full(len(response.impacts), math.nan)
    unknown = dataclasses.replace(response, impacts=dataclasses.replace(response.impacts, phase=phase))
    axis = fi.figures.impulse_phase(unknown, fi.figures.OffScreen())
    assert axis.get_xlabel() == "time (s)"
    assert axis.get_xlim() == unknown.window
    start, end = unknown.window
    inside = (unknown.impacts.time >= start) & (unknown.impacts.time < end)
    drawn = np.concatenate([line.get_xdata() for line in axis.lines if "wall" in line.get_label()])
    np.testing.assert_array_equal(np.sort(drawn), np.sort(unknown.impacts.time[inside]))


def test_figures_of_a_run_without_impacts(light):
    method = fi.Newmark(dt=fi.recommended_step(light))
    quiet = fi.integrate(light, fi.Sine(1e-9, 3.0), method, 0.5)
    assert quiet.regime.label == "no impacts"
    histograms = fi.figures.impact_histograms(quiet, fi.figures.OffScreen())
    assert not any(bar.get_height() for axis in histograms for group in axis.containers for bar in group)
    assert not any(line.get_xdata().size for line in fi.figures.impulse_phase(quiet, fi.figures.OffScreen()).lines)


@pytest.mark.parametrize("run", ["response", "event_driven"])
def test_a_study_leaves_the_record_and_sticking_only_where_something_stuck(run, request, tmp_path):
    result = request.getfixturevalue(run)
    write_files(tmp_path, impact_files(result))
    assert read_csv(tmp_path / FILES["impacts"].name)["time"].size == len(result.impacts)
    assert (tmp_path / FILES["impact_data"].name).is_file()
    assert (tmp_path / FILES["sticking"].name).is_file() == (len(result.sticking) > 0) == (run == "event_driven")
    if run == "event_driven":
        back = read_csv(tmp_path / FILES["sticking"].name)
        for name in column_units(StickingPhases):
            np.testing.assert_array_equal(back[name], getattr(result.sticking, name))
