"""The record of impacts: phases, shares, regimes told from tables with a known answer, files that read back."""

import dataclasses
import math

import numpy as np
import pytest

import femimpact as fi
from femimpact.export import impact_figures, tables
from femimpact.response.impacts import IMPACT_UNITS, STICKING_UNITS, Impacts, StickingPhases, impact_columns
from femimpact.response.regimes import RegimeCriteria, classify, impacts_per_cycle, significant

pytestmark = pytest.mark.impacts

FREQUENCY = 5.0
SINE = fi.Sine(amplitude=0.2037e-3, frequency=5.2, phase=0.7)


def table(time, side, speed, *, impactor=None, impulse=None, to_modes=None, dropped=0):
    """Impacts with the columns that tell a regime; the others are zero."""
    time, speed = np.asarray(time, dtype=float), np.broadcast_to(np.asarray(speed, dtype=float), np.shape(time))
    nothing = np.zeros(time.size)
    return Impacts(
        time=time,
        phase=np.mod(2 * np.pi * FREQUENCY * time, 2 * np.pi),
        impactor=np.full(time.size, "ball") if impactor is None else np.asarray(impactor),
        side=np.broadcast_to(np.asarray(side, dtype=float), time.shape),
        approach_speed=speed,
        rebound_speed=0.6 * speed,
        impulse=5e-3 * speed if impulse is None else np.asarray(impulse),
        peak_force=nothing,
        duration=nothing,
        energy_loss=nothing,
        energy_to_modes=np.zeros((time.size, 0)) if to_modes is None else np.asarray(to_modes),
        law={"ball": "rigid"},
        dropped=dropped,
    )


def repeated(offsets, sides, speeds, period, periods, noise=0.0, start=0.0):
    """A pattern of impacts (offsets in cycles) that repeats after `period` cycles, with a little noise."""
    rng = np.random.default_rng(1)
    turn = period * np.arange(periods)[:, None]
    time = start + (turn + np.asarray(offsets) + noise * rng.uniform(-1, 1, (periods, len(offsets)))) / FREQUENCY
    speed = np.asarray(speeds) * (1 + noise * rng.uniform(-1, 1, time.shape))
    order = np.argsort(time.ravel())
    return table(time.ravel()[order], np.tile(sides, periods)[order], speed.ravel()[order])


def of(impacts, end, sticking=None, start=0.0, **tolerances):
    return classify(impacts, sticking or StickingPhases.none(), FREQUENCY, start, end, RegimeCriteria(**tolerances))


# ---- regimes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("offsets", "sides", "speeds", "period"),
    [
        ((0.2,), (1,), (0.3,), 1),
        ((0.2, 0.7), (1, -1), (0.3, 0.3), 1),
        ((0.0, 0.5), (1, -1), (0.3, 0.2), 1),  # on the wrap of the phase: half of the noisy ones before it
        ((0.1, 0.6, 1.15, 1.55), (1, -1, 1, -1), (0.3, 0.25, 0.28, 0.35), 2),
        ((0.1, 0.9, 2.2), (1, -1, 1), (0.3, 0.5, 0.2), 3),
        ((0.1, 0.12, 4.0), (1, -1, 1), (0.3, 0.5, 0.2), 8),
    ],
)
def test_a_motion_that_repeats_is_named_by_its_smallest_period(offsets, sides, speeds, period):
    impacts = repeated(offsets, sides, speeds, period, 48 // period, noise=2e-4)
    regime = of(impacts, 48 / FREQUENCY)
    assert (regime.kind, regime.impacts, regime.cycles) == ("periodic", len(offsets), period)
    assert regime.label == f"{len(offsets)}:{period} periodic"
    for number in ("0.1 of the largest impulse", "0.01 rad", "4 repeats"):
        assert number in regime.criterion


def test_tolerances_decide_what_repeats():
    impacts = repeated((0.2, 0.7), (1, -1), (0.3, 0.3), 1, 40, noise=5e-3)
    assert "chaotic" in of(impacts, 8.0).label
    assert of(impacts, 8.0, phase_tolerance=0.1, speed_tolerance=0.05).label == "2:1 periodic"
    two = repeated((0.2, 1.2), (1, 1), (0.3, 0.31), 2, 20)
    assert of(two, 8.0).label == "2:2 periodic"
    assert of(two, 8.0, longest_period=1).cycles == 0
    assert of(two, 8.0, speed_tolerance=0.1).label == "1:1 periodic"


def test_a_slow_drift_is_no_repetition():
    cycle = np.arange(40)
    impacts = table((cycle + 0.2 + 5e-4 * cycle) / FREQUENCY, 1, 0.3)  # 3e-3 rad a cycle, 0.1 rad over all
    assert "chaotic" in of(impacts, 8.0).label


def test_small_impacts_do_not_count_towards_the_period():
    rng = np.random.default_rng(2)
    large = repeated((0.2, 0.7), (1, -1), (0.3, 0.3), 1, 40)
    time = np.concatenate([large.time, rng.uniform(0.0, 8.0, 30)])
    side = np.concatenate([large.side, np.ones(30)])
    impacts = table(time, side, np.concatenate([large.approach_speed, np.full(30, 0.02)]))
    assert np.count_nonzero(significant(impacts)) == 80
    assert np.count_nonzero(significant(impacts, share=0.0)) == 110
    assert impacts_per_cycle(impacts, FREQUENCY, 0.0, 8.0) == pytest.approx(110 / 40)
    assert of(impacts, 8.0).label == "2:1 periodic"
    assert of(impacts, 8.0, significant_share=0.0).kind != "periodic"


def bouncing(cycles, restitution=0.7, bounces=12):
    """A ball on a wall in every cycle: v_k = e^k v_0, intervals 2 v_k/g."""
    speed = 0.3 * restitution ** np.arange(bounces)
    flight = np.concatenate([[0.0], np.cumsum(speed[1:])])
    after = 0.6 * flight / flight[-1]  # the geometric series fits into 0.6 of a cycle
    return (cycles[:, None] + 0.1 + after) / FREQUENCY, np.tile(speed, (cycles.size, 1))


def test_geometric_bounces_in_every_cycle_are_chatter():
    time, speed = bouncing(np.arange(30))
    regime = of(table(time.ravel(), 1, speed.ravel()), 6.0)
    assert regime.kind == "chatter"
    assert regime.label.endswith(":1 periodic")
    # in every third cycle only: less than half
    time, speed = bouncing(np.arange(0, 30, 3))
    assert of(table(time.ravel(), 1, speed.ravel()), 6.0).kind == "periodic"
    # without an order between cycles it is still chatter, and periodic no more
    jitter = np.random.default_rng(3).uniform(0.0, 0.2, (30, 1)) / FREQUENCY
    time, speed = bouncing(np.arange(30))
    irregular = of(table((time + jitter).ravel(), 1, speed.ravel()), 6.0)
    assert (irregular.kind, irregular.label, irregular.cycles) == ("chatter", "chatter", 0)


def test_alternate_walls_or_growing_intervals_are_no_chatter():
    time, speed = bouncing(np.arange(30))
    assert of(table(time.ravel(), np.tile([1, -1], time.size // 2), speed.ravel()), 6.0).kind == "periodic"
    backwards = (2 * np.arange(30)[:, None] + 1) / FREQUENCY - time[:, ::-1]
    assert of(table(backwards.ravel(), 1, speed.ravel()), 6.0).kind == "periodic"


def test_sticking_in_half_of_the_cycles_is_sticking():
    cycle = np.arange(0, 40, 2)
    start, end = (cycle + 0.3) / FREQUENCY, (cycle + 0.6) / FREQUENCY
    columns = {"impactor": np.full(20, "ball"), "side": np.ones(20), "impulse": np.ones(20), "mean_force": np.ones(20)}
    sticks = StickingPhases(start=start, end=end, **columns)
    impacts = repeated((0.1,), (1,), (0.3,), 2, 20)
    assert of(impacts, 8.0, sticks).label == "sticking, 1:2 periodic"
    assert of(table([], 1, []), 8.0, sticks).kind == "sticking"
    fewer = StickingPhases(**{name: value[1:] for name, value in vars(sticks).items()})
    assert of(impacts, 8.0, fewer).label == "1:2 periodic"
    last = StickingPhases(
        **{name: value[:1] for name, value in vars(dataclasses.replace(sticks, end=end * np.nan)).items()}
    )
    assert of(table([], 1, []), 8.0, last).kind == "sticking"  # from the first cycle on, and still


def test_random_impacts_are_called_chaotic_by_the_criterion_only():
    rng = np.random.default_rng(4)
    time = np.sort(rng.uniform(0.0, 10.0, 150))
    impacts = table(time, rng.choice([-1, 1], 150), rng.uniform(0.1, 0.5, 150))
    regime = of(impacts, 10.0)
    assert (regime.impacts, regime.cycles) == (0, 0)
    assert "chaotic" in regime.label
    assert "up to 8 cycles" in regime.criterion
    # a window of 20 cycles can show four repeats of 4 cycles at most, and says so
    assert "up to 4 cycles" in of(impacts, 4.0).criterion


def test_what_cannot_be_told_is_not_told():
    impacts = repeated((0.2,), (1,), (0.3,), 1, 40)
    assert of(table([], 1, []), 8.0).label == "no impacts"
    assert of(impacts, 0.5).kind == "undecided"
    # the table was full before the window began: no impacts in it mean nothing
    assert of(dataclasses.replace(impacts, dropped=10), 20.0, start=10.0).kind == "undecided"
    with pytest.raises(fi.InputError, match="end"):
        of(impacts, 0.0)
    with pytest.raises(fi.InputError, match="repeats"):
        of(impacts, 8.0, repeats=0)


def test_two_balls_at_the_same_instant_repeat_each_for_itself():
    rng = np.random.default_rng(5)
    time = np.repeat((np.arange(40) + 0.2) / FREQUENCY, 2) + 1e-9 * rng.uniform(-1, 1, 80)
    names = np.tile(["left", "right"], 40)
    speed = np.where(names == "left", 0.3, 0.2)
    order = np.argsort(time)
    impacts = table(time[order], 1, speed[order], impactor=names[order])
    assert of(impacts, 8.0).label == "2:1 periodic"


def test_the_closed_form_orbit_is_two_impacts_per_cycle():
    # mass ratio 0.1, restitution 0.6, damping 0.01, at resonance, total clearance 24: |u| = 7.527982
    ball = fi.Impactor("ball", "mass", 0.1, 12.0, fi.Rigid(0.6))
    system = fi.System.from_matrices([[1.0]], [[0.02]], [[1.0]], points={"mass": [1.0]}, impactors=[ball])
    push, start = fi.PointForce("mass", fi.Sine(1.0, 1 / (2 * math.pi), 0.3)), fi.State([0.0], [0.0], [0.0], [5.0])
    run = fi.integrate(system, push, fi.EventDriven(), 300 * math.pi, fi.Recorder(channels=("mass",)), start)
    assert run.regime.label == "2:1 periodic"
    last = run.impacts.approach_speed[-1]
    assert last == pytest.approx(2 * 7.527982 * (1 + 0.1) / (1 + 0.6), rel=1e-6)
    np.testing.assert_allclose(np.abs(np.diff(run.impacts.phase[-5:])), math.pi, atol=1e-6)


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
    rows = repr(repeated((0.2,), (1,), (0.3,), 1, 40)).splitlines()
    assert rows[0] == "Impacts: 40 (contact law of ball: rigid)"
    assert rows[1].split()[:4] == ["time", "phase", "impactor", "side"]
    assert rows[2].split()[:2] == ["s", "rad"]
    assert len({len(row) for row in rows[1:-1]}) == 1
    assert (len(rows), rows[-1]) == (9, "...")
    assert "3 more not kept" in repr(table([], 1, [], dropped=3))


@pytest.fixture(scope="module")
def light(reference):
    return fi.reduce(fi.assemble(reference, elements=10), modes=4)


@pytest.fixture(scope="module")
def response(light):
    method = fi.Newmark(dt=fi.recommended_step(light))
    return fi.integrate(light, SINE, method, 6.0, fi.Recorder(channels=("tip",), every=10_000))


@pytest.fixture(scope="module")
def flown(reference):
    ball = dataclasses.replace(reference.impactors[0], contact=fi.Rigid(restitution=0.6))
    rigid = fi.reduce(fi.assemble(dataclasses.replace(reference, impactors=[ball]), elements=10), modes=4)
    sine = fi.Sine(amplitude=3e-3, frequency=5.2)
    return fi.integrate(rigid, sine, fi.EventDriven(), 15.0, fi.Recorder(channels=("tip",)))


def test_phases_are_those_of_the_known_sine_and_all_impacts_stay_when_histories_are_thinned(response):
    impacts = response.impacts
    assert len(impacts) > 5 * response.time.size > 0
    assert ((impacts.phase >= 0) & (impacts.phase < 2 * np.pi)).all()
    moved = SINE.amplitude * np.sin(impacts.phase)
    np.testing.assert_allclose(moved, SINE.displacement(impacts.time), atol=1e-15)
    assert set(impacts.contact_law) == {"kelvin-voigt"}


@pytest.mark.parametrize("run", ["response", "flown"])
def test_csv_and_netcdf_hold_the_same_table(run, request, tmp_path):
    import xarray

    impacts = request.getfixturevalue(run).impacts
    columns, units = impact_columns(impacts)
    path = tables.write_csv(tmp_path / "impacts.csv", columns, units)
    assert path.read_text().startswith("time [s],phase [rad],impactor,side [1],approach_speed [m/s]")
    back = tables.read_csv(path)
    assert list(back) == list(columns)
    file = tables.write_netcdf(tmp_path / "impacts.nc", impacts.to_xarray())
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

    empty = table([], 1, [])
    columns, units = impact_columns(empty)
    assert tables.read_csv(tables.write_csv(tmp_path / "impacts.csv", columns, units))["time"].size == 0
    file = tables.write_netcdf(tmp_path / "impacts.nc", empty.to_xarray())
    assert xarray.load_dataset(file, engine="h5netcdf")["time"].size == 0


def test_a_rigid_impact_loses_its_impulse_times_the_mean_relative_speed(flown):
    impacts = flown.impacts
    assert impacts.energy_to_modes.shape == (len(impacts), 4)
    lost = 0.5 * impacts.impulse * (impacts.approach_speed - impacts.rebound_speed)
    np.testing.assert_allclose(impacts.energy_loss, lost, rtol=1e-6, atol=1e-15)
    assert np.isnan(impacts.peak_force).all()
    assert set(impacts.contact_law) == {"rigid"}


# ---- of a run -------------------------------------------------------------------------------------


def test_a_run_knows_its_regime_over_its_last_third(flown):
    start, end = flown.window
    assert (start, end) == pytest.approx((10.0, 15.0))
    expected = classify(flown.impacts, flown.sticking, 5.2, start, end)
    assert flown.regime == expected
    assert flown.regime.criterion
    assert math.isfinite(impacts_per_cycle(flown.impacts, 5.2, start, end))


@pytest.mark.parametrize("run", ["response", "flown"])
def test_figures_show_units_walls_and_regime(run, request):
    result = request.getfixturevalue(run)
    histograms = impact_figures.impact_histogram_figure(result)
    labels = [axis.get_xlabel() for axis in histograms.axes]
    assert [label.partition(" (")[0] for label in labels] == ["approach speed", "impulse", "energy loss"]
    assert all(unit in label for unit, label in zip(("m/s)", "N s)", "J)"), labels, strict=True))
    start, end = result.window
    inside = np.count_nonzero((result.impacts.time >= start) & (result.impacts.time <= end))
    for axis in histograms.axes:
        bars = [bar.get_height() for group in axis.containers for bar in group]
        assert sum(bars) == inside
    axis = impact_figures.impulse_phase_figure(result).axes[0]
    walls = [line for line in axis.lines if "wall" in line.get_label()]
    assert sum(line.get_xdata().size for line in walls) == inside
    for look in ("marker", "color"):
        assert len({line.properties()[look] for line in walls}) == 2
    assert result.regime.label in axis.get_title(loc="left").replace("\n", " ")


def test_figures_of_a_run_without_impacts(light):
    method = fi.Newmark(dt=fi.recommended_step(light))
    quiet = fi.integrate(light, fi.Sine(1e-9, 3.0), method, 0.5)
    assert quiet.regime.label == "no impacts"
    assert impact_figures.impact_histogram_figure(quiet).axes
    assert impact_figures.impulse_phase_figure(quiet).axes


@pytest.mark.parametrize("run", ["response", "flown"])
def test_a_study_leaves_the_record_and_sticking_only_where_something_stuck(run, request, tmp_path):
    from femimpact.study import run as running
    from femimpact.study.results import FILES, STICKING_FILE

    result = request.getfixturevalue(run)
    running._write_impacts(tmp_path, result)
    assert tables.read_csv(tmp_path / FILES["impacts"])["time"].size == len(result.impacts)
    assert (tmp_path / FILES["impact_data"]).is_file()
    assert (tmp_path / STICKING_FILE).is_file() == (len(result.sticking) > 0) == (run == "flown")
    if run == "flown":
        back = tables.read_csv(tmp_path / STICKING_FILE)
        for name in STICKING_UNITS:
            np.testing.assert_array_equal(back[name], getattr(result.sticking, name))
