"""What a run keeps: names, strides, snapshots, limits."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

import femimpact as fi
from femimpact.response.cycles import cycle_statistics, steady_motion
from femimpact.response.impacts import IMPACT_UNITS, impact_statistics

pytestmark = pytest.mark.impacts

BASE = fi.Sine(amplitude=0.2037e-3, frequency=5.2)
METHOD = fi.Newmark(1e-4)
START = fi.State(ball_velocity=[0.2])


def run(system, duration=0.2, record=None, **more):
    return fi.integrate(system, BASE, METHOD, duration, record, initial=START, **more)


def test_by_default_tip_balls_and_contact_forces_are_kept_at_every_step(small):
    response = run(small, 0.01)
    assert tuple(response.channels) == ("tip", "ball", "contact_force")
    assert response.time.size == 101
    assert tuple(fi.integrate(fi.without_impactors(small), BASE, METHOD, 0.01).channels) == ("tip",)


def test_every_array_is_read_only(small):
    response = run(small, 0.2, fi.Recorder(snapshots=10))
    assert len(response.impacts) > 0
    arrays = [response.time, *response.channels.values(), *vars(response.snapshots).values()]
    arrays += [value for value in vars(response.energy).values() if isinstance(value, np.ndarray)]
    arrays += [getattr(response.impacts, name) for name in IMPACT_UNITS if name != "impactor"]
    for array in arrays:
        assert array.size > 0
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    for name in ("M", "C", "K"):
        assert getattr(small, name).shape == (8, 8)
    with pytest.raises(ValueError, match="read-only"):
        small.base_load[0] = 0.0


def test_with_two_balls_a_gap_belongs_to_a_named_one(reference):
    twin = replace(reference.impactors[0], name="twin", at="mid")
    system = fi.reduce(fi.assemble(replace(reference, impactors=(*reference.impactors, twin)), elements=8), modes=4)
    with pytest.raises(fi.InputError, match="channels = 'gap'"):
        fi.integrate(system, BASE, METHOD, 0.01, fi.Recorder(channels=("gap",)))
    response = fi.integrate(system, BASE, METHOD, 0.01)
    assert tuple(response.channels) == ("tip", "ball", "twin", "ball.contact_force", "twin.contact_force")


def test_a_float_is_a_place_along_the_beam(small):
    length = 0.23026615
    response = run(small, 0.1, fi.Recorder(channels=(length, "tip", length / 2, "mid", 0.0, 0.07)))
    np.testing.assert_array_equal(response[length], response["tip"])
    # the middle is a node: the same row, up to the rounding of its position
    np.testing.assert_allclose(response[length / 2], response["mid"], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(response[0.0], 0.0)
    assert np.max(np.abs(response[0.07])) < np.max(np.abs(response["mid"]))
    for place, words in ((-0.01, "metres from the root >= 0"), (0.24, "must be within the beam")):
        with pytest.raises(fi.InputError, match=words):
            run(small, 0.1, fi.Recorder(channels=(place,)))


def test_gap_and_velocities_are_what_they_say(small):
    channels = (
        "tip",
        "ball",
        "gap",
        "tip.velocity",
        "ball.velocity",
        "ball.gap",
        "ball.contact_force",
        "contact_force",
    )
    response = run(small, 0.2, fi.Recorder(channels=channels))
    assert len(response.impacts) > 0
    # a subtraction of numbers near 1e-3
    np.testing.assert_allclose(response["gap"], response["ball"] - response["tip"], rtol=0, atol=1e-17)
    np.testing.assert_array_equal(response["gap"], response["ball.gap"])
    np.testing.assert_array_equal(response["contact_force"], response["ball.contact_force"])
    for name in ("tip", "ball"):
        rate, u = response[f"{name}.velocity"], response[name]
        # Newmark's average acceleration: u1 - u0 = dt (v0 + v1)/2 exactly; rounding near 4e-3 m
        np.testing.assert_allclose(np.diff(u), 0.5e-4 * (rate[1:] + rate[:-1]), rtol=0, atol=1e-17)


def test_stride_and_start_pick_samples_of_the_same_run(small):
    full = run(small, 0.2)
    part = run(small, 0.2, fi.Recorder(every=7, start=0.05))
    # 0.05 s are 500 steps of 1e-4 s; every seventh to step 2000
    chosen = slice(500, None, 7)
    np.testing.assert_array_equal(part.time, full.time[chosen])
    for name in full.channels:
        np.testing.assert_array_equal(part[name], full[name][chosen])
    np.testing.assert_array_equal(part.energy.work, full.energy.work[chosen])
    np.testing.assert_array_equal(part.impacts.time, full.impacts.time)


def test_a_start_beyond_the_end_keeps_the_last_sample(small):
    full, part = run(small, 0.05), run(small, 0.05, fi.Recorder(start=1.0))
    assert part.time.size == 1
    assert part["tip"][0] == full["tip"][-1]


@pytest.mark.parametrize("modal", [True, False])
def test_snapshots_agree_with_channels(system, small, modal):
    used = small if modal else system
    channels = ("tip", "mid", "tip.velocity", "ball", "ball.velocity", "contact_force")
    record = fi.Recorder(channels=channels, snapshots=5, snapshots_start=0.03)
    response = run(used, 0.06, record)
    shots = response.snapshots
    chosen = slice(300, None, 5)
    np.testing.assert_array_equal(shots.time, response.time[chosen])
    assert shots.displacement.shape == (61, 2 * used.nodes.size)
    middle = 2 * (used.nodes.size // 2)  # 40 elements: a node at mid-span
    for name, values in (
        ("tip", shots.displacement[:, -2]),
        ("mid", shots.displacement[:, middle]),
        ("tip.velocity", shots.velocity[:, -2]),
    ):
        # the order of sums over the modes
        np.testing.assert_allclose(values, response[name][chosen], rtol=1e-10, atol=1e-16)
    np.testing.assert_array_equal(shots.ball_displacement[:, 0], response["ball"][chosen])
    np.testing.assert_array_equal(shots.ball_velocity[:, 0], response["ball.velocity"][chosen])
    np.testing.assert_array_equal(shots.contact_force[:, 0], response["contact_force"][chosen])
    # clamped root: no deflection, no slope
    np.testing.assert_array_equal(shots.displacement[:, :2], 0.0)


@pytest.mark.parametrize(
    ("record", "part"),
    [
        (fi.Recorder(), "channels"),
        (fi.Recorder(every=10**9, snapshots=1), "snapshots"),
        (fi.Recorder(channels=("tip",), every=10**9, ledger=False), "cycles"),
    ],
)
def test_a_run_that_would_keep_too_much_is_refused_before_it_starts(small, record, part):
    begun = time.process_time()
    with pytest.raises(fi.InputError) as caught:
        run(small, 1e9, record)
    # 1e13 steps take a month: a refusal within a minute of computing was not a run
    assert time.process_time() - begun < 60.0
    message = str(caught.value)
    assert "record.memory_limit" in message
    assert re.search(rf"[(, ]{part} [\d.e+]+ MB", message)
    assert "\n" not in message


def test_the_memory_limit_is_what_the_arrays_take(small):
    samples = 2001
    # 3 channels, 7 energies and 8 modes' losses, an empty impact table, 13 columns of 2 or 3 base cycles
    least = 8 * samples * 18
    with pytest.raises(fi.InputError, match="memory_limit"):
        run(small, 0.2, fi.Recorder(impacts=0, memory_limit=float(least)))
    run(small, 0.2, fi.Recorder(impacts=0, memory_limit=float(least + 8 * 13 * 4)))


def test_impacts_beyond_the_table_are_counted_and_warned_of(small):
    every = run(small, 3.0, fi.Recorder(every=1000))
    few = run(small, 3.0, fi.Recorder(every=1000, impacts=2))
    assert len(every.impacts) > 5
    assert every.impacts.dropped == 0
    assert len(few.impacts) == 2
    assert few.impacts.dropped == len(every.impacts) - 2
    assert few.warnings == (
        f"{few.impacts.dropped} impacts beyond the first 2 are not in the table (Recorder.impacts)",
    )
    np.testing.assert_array_equal(few.impacts.time, every.impacts.time[:2])
    np.testing.assert_array_equal(few["tip"], every["tip"])


def test_the_impact_statistics_are_those_of_the_table(bouncing):
    base, start = fi.Sine(amplitude=1e-6, frequency=45.0), fi.State(ball_velocity=[0.3])
    response = fi.integrate(bouncing, base, METHOD, 0.27, fi.Recorder(every=100), initial=start)
    table, statistics = response.impacts, response.statistics
    # an impact counts when it ends, and these regular ones are not near the edge of the last third
    assert np.min(np.abs(table.time + 1e-3 - 0.18)) > 3e-3
    inside = table.time >= 0.18
    assert statistics.count == inside.sum() > 1
    assert statistics.impacts_per_cycle == pytest.approx(inside.sum() / (0.09 * 45.0), rel=1e-9)
    assert statistics.mean_approach_speed == pytest.approx(table.approach_speed[inside].mean(), rel=1e-12)
    assert statistics.largest_approach_speed == table.approach_speed[inside].max()
    assert statistics.peak_force == table.peak_force[inside].max()
    assert statistics.cycle_mean_force == pytest.approx(table.impulse[inside].sum() / 0.09, rel=1e-9)
    assert statistics.law == "kelvin-voigt"
    nothing = impact_statistics(np.zeros((6, 1)), 1.0, 5.2, "none")
    assert (nothing.count, nothing.mean_approach_speed, nothing.peak_force, nothing.cycle_mean_force) == (0, 0, 0, 0)


def test_impacts_lie_in_order_and_their_columns_agree(small):
    table = run(small, 6.0, fi.Recorder(every=1000)).impacts
    ends = table.time + table.duration
    assert np.all(np.diff(ends) > 0)
    assert set(table.impactor) == {"ball"}
    assert set(np.abs(table.side)) == {1.0}
    for name in ("approach_speed", "impulse", "peak_force", "duration"):
        assert np.all(getattr(table, name) > 0), name
    # no force exceeds its peak: impulse <= peak force times time under force, with a step's triangle at each end
    assert np.all(table.impulse <= table.peak_force * (table.duration + 1e-4))
    np.testing.assert_array_equal(table.restitution, table.rebound_speed / table.approach_speed)


PHASE = np.linspace(0.0, 80.0 * np.pi, 40 * 64, endpoint=False)
WHIMS = np.repeat(np.random.default_rng(2).uniform(1.0, 2.0, 40), 64)
MOTIONS = {
    "one cycle": (np.sin(PHASE), True),
    "two cycles": (np.sin(PHASE) + 0.3 * np.cos(0.5 * PHASE), True),
    # as far as a regime is looked for
    "eight cycles": (np.sin(PHASE) + 0.1 * np.cos(0.125 * PHASE), True),
    "nine cycles": (np.sin(PHASE) + 0.1 * np.cos(PHASE / 9.0), False),
    "two impacts on a stop": (np.minimum(np.sin(PHASE) + 0.5 * np.sin(3.0 * PHASE), 0.4), True),
    "a beat": (np.sin(PHASE) + 0.1 * np.sin(np.sqrt(2.0) * PHASE), False),
    # a stop holds the upper extreme, two hold both
    "one stop": (np.minimum(WHIMS * np.sin(PHASE), 0.5), False),
    "two stops": (np.sign(np.sin(PHASE)) * np.abs(np.sin(PHASE)) ** WHIMS, False),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_periodic_is_what_repeats_on_both_sides_and_between(name):
    values, repeats = MOTIONS[name]
    cycles = cycle_statistics(values, PHASE, np.arange(0, PHASE.size, 64))
    found = steady_motion(cycles, np.array([40]))
    assert (found.steadiness[0] == "periodic") == repeats


@pytest.mark.parametrize(("modes", "repeats"), [(1, True), (4, False)])
def test_steadiness_and_regime_of_a_ruler_on_a_stop_say_the_same(modes, repeats):
    beam = fi.Beam.uniform(length=0.3, width=0.025, thickness=1e-3, young_modulus=210e9, density=7850)
    stop = fi.Stop("stop", at="tip", gap=(5e-3, np.inf), contact=fi.Rigid(0.7))
    structure = fi.Structure(beam, stops=[stop], damping=fi.Rayleigh(ratio=0.005, modes=(1, 2)))
    system = fi.reduce(fi.assemble(structure, elements=10), modes=modes)
    run = fi.integrate(system, fi.Sine(3e-4, 10.0), fi.EventDriven(), 30.0)
    curve = fi.frequency_sweep(system, 3e-4, [10.0], fi.EventDriven(), 300)
    assert run.impacts.time.size > 200
    assert (run.regime.kind == "periodic") == repeats
    assert (run.steady.steadiness[0] == "periodic") == repeats
    assert curve.is_sample[0] == (not repeats)


def test_steady_motion_of_a_settled_linear_run(reference):
    structure = fi.Structure(reference.beam, reference.masses, damping=fi.Rayleigh(ratio=0.05, modes=(1, 2)))
    system = fi.reduce(fi.assemble(structure, elements=8), modes=2)
    response = fi.integrate(system, BASE, fi.Newmark(2e-4), 60 / 5.2)
    steady, tip = response.steady, response["tip"]
    last = response.time >= 40 / 5.2
    # transient exp(-0.05 2 pi 40) = 3e-6; cycles are whole steps: one of 960
    assert steady.peak[0] == pytest.approx(np.max(np.abs(tip[last])), rel=1e-4)
    assert steady.rms[0] == pytest.approx(np.sqrt(np.mean(tip[last] ** 2)), rel=1e-3)
    assert steady.first_harmonic[0] == pytest.approx(np.sqrt(2) * steady.rms[0], rel=1e-4)
    assert steady.steadiness[0] == "periodic"
    # cycles of 58 and 59 samples, as of instants that do not divide a cycle
    uneven = fi.integrate(system, fi.Sine(3e-4, 10.0), fi.EventDriven(), 12.0, fi.Recorder(interval=1.7e-3))
    assert uneven.steady.steadiness[0] == "periodic"


def test_a_run_shorter_than_a_cycle_has_no_amplitude(small):
    steady = run(small, 0.05).steady
    assert np.isnan(steady.peak[0])
    assert steady.steadiness[0] == "transient"


def test_the_dataset_carries_units_and_the_base(small):
    response = run(small, 0.2, fi.Recorder(channels=("tip", "tip.velocity", "contact_force", 0.1)))
    data = response.to_xarray()
    units = {"tip": "m", "tip.velocity": "m/s", "contact_force": "N", "0.1": "m", "base": "m", "energy_kinetic": "J"}
    for name, unit in units.items():
        assert data[name].dims == ("time",)
        assert data[name].attrs["units"] == unit
    assert data.time.attrs["units"] == "s"
    np.testing.assert_array_equal(data["tip"], response["tip"])
    np.testing.assert_array_equal(data.time, response.time)
    np.testing.assert_allclose(data["base"], 0.2037e-3 * np.sin(2 * np.pi * 5.2 * response.time), rtol=0, atol=1e-17)
    assert data.attrs["energy_residual"] == response.energy.residual
    assert (data.attrs["base_amplitude_m"], data.attrs["base_frequency_Hz"]) == (0.2037e-3, 5.2)
    bare = run(small, 0.01, fi.Recorder(ledger=False)).to_xarray()
    assert not any(name.startswith("energy") for name in bare)


def test_the_dataset_survives_a_netcdf_file(small, tmp_path):
    import xarray

    data = run(small, 0.05).to_xarray()
    data.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as back:
        xarray.testing.assert_identical(back.load(), data)


def test_progress_runs_to_one(small):
    shares = []
    run(small, 0.5, progress=shares.append)
    assert shares[-1] == 1.0
    assert shares == sorted(shares)
