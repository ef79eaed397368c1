"""The log of events: each row is reached from the one before it by a flow of other make, and nothing is left out."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import fields, replace

import numpy as np
import pytest
from builders import REFERENCE, oscillator, reduced, with_ball
from reference_equations import FREE, PRESSED, RESTING, SEPARATING, drive_of, equations_of, inverse_mass, rows_of
from scipy.linalg import expm

import femimpact as fi
from femimpact.files import write_netcdf
from femimpact.integrators.event_driven.block import inputs_of, new_block, run_block
from femimpact.integrators.event_driven.run import closed_drive
from femimpact.integrators.event_driven.store import FormStore, outputs_of
from femimpact.response.impacts import event_log
from femimpact.table import column_units

pytestmark = pytest.mark.impacts

EXACT, LOGGED = fi.EventDriven(), fi.Recorder(every=64, events=100_000)
SINE = fi.Sine(0.6e-3, 5.2, 0.4)
SOFT = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
# of such a ball, hardly thrown back, some contacts let go and press again
DEAD = fi.KelvinVoigt(restitution=0.3, contact_time=2e-3)
FALLING = fi.Impactor("falling", 0.15, 1e-3, 2e-3, fi.Rigid(0.3), acceleration=-2.0)

SYSTEMS = {
    "rigid": lambda: reduced(with_ball(REFERENCE, contact=fi.Rigid(0.6)), 4, 12),
    "sticking": lambda: reduced(with_ball(REFERENCE, contact=fi.Rigid(0.0)), 4, 12),
    "accumulating": lambda: reduced(replace(REFERENCE, impactors=(FALLING,)), 3, 12),
    "Kelvin-Voigt": lambda: reduced(with_ball(REFERENCE, contact=SOFT), 4, 12),
    "pressed again": lambda: reduced(with_ball(REFERENCE, contact=DEAD, gap=2e-3), 3, 12),
    "stop in space": lambda: reduced(
        replace(REFERENCE, impactors=(), stops=(fi.Stop("stop", "tip", 3e-3, fi.Rigid(0.7), fixed_to="space"),)), 3, 12
    ),
    "mixed": lambda: reduced(
        replace(
            REFERENCE,
            impactors=(*with_ball(REFERENCE, contact=fi.Rigid(0.5)).impactors, FALLING),
            stops=(fi.Stop("stop", "mid", (1e-3, math.inf), SOFT),),
        ), 3, 12,
    ),
}  # fmt: skip


def run_of(name, duration=6.0, record=LOGGED):
    return fi.integrate(SYSTEMS[name](), SINE, EXACT, duration, record)


def states_of(system, row):
    """Contact states of a row of the log in the words of the reference."""
    rigid = [isinstance(pair.law, fi.Rigid) for pair in system.contacts]
    names = {0: FREE, 1: PRESSED, 2: SEPARATING}
    return [
        (RESTING if hard and state else names[abs(state)], int(np.sign(state)))
        for hard, state in zip(rigid, row.tolist(), strict=True)
    ]


def flow(e, history, omega, phase, start, z, end):
    """The state at another time, by the matrix exponential of the motion together with its sine."""
    size = z.size
    whole = np.zeros((size + 3, size + 3))
    whole[:size, :size], whole[:size, -1] = e.A, e.constant
    whole[:size, size], whole[size, size + 1], whole[size + 1, size] = e.drive, omega, -omega
    # velocities are larger than displacements by the frequency: beside each other they keep their digits
    scale = np.r_[np.full(size // 2, 1.0 / 300.0), np.ones(size // 2 + 3)]
    quarter = 0.5 * math.pi / omega
    ahead = history(start + quarter)
    given = np.concatenate([z, [history(start), ahead, 1.0]]) / scale
    return (expm((end - start) * whole * scale / scale[:, None]) @ given * scale)[:size]


def replayed(system, log):
    """State just before every event but the first, reached from the row before it."""
    history, load, _ = drive_of(system, SINE)
    found, omega = [], 2.0 * math.pi * SINE.frequency
    for k in range(1, len(log)):
        e = equations_of(system, load, states_of(system, log.contact_state[k - 1]))
        z = np.concatenate([log.displacement[k - 1], log.velocity[k - 1]])
        found.append(flow(e, history, omega, SINE.phase, float(log.time[k - 1]), z, float(log.time[k])))
    return np.array(found)


@pytest.mark.parametrize("name", SYSTEMS)
def test_an_independent_flow_leads_from_each_row_to_the_next(name):
    run = run_of(name)
    system, log, d = run.system, run.events, run.events.displacement.shape[1]
    rows, inverse = rows_of(system), inverse_mass(system)
    space = np.array([pair.fixed_to == "space" for pair in system.contacts], dtype=float)
    rigid = [pair.law.name == "rigid" for pair in system.contacts]
    assert len(log) > 20
    before = replayed(system, log)
    # of the largest displacement and velocity; 1e-10 of what some 1e3 radians of the fastest mode leave to rounding
    far, fast = (1e-10 * np.max(np.abs(values)) for values in (log.displacement, log.velocity))
    np.testing.assert_allclose(before[:, :d], log.displacement[1:], rtol=0, atol=far)
    moved = 0
    for k in range(1, len(log)):
        rate, after, pair = before[k - 1, d:], log.velocity[k], int(log.pair[k])
        if log.kind[k] not in ("impact", "capture"):
            np.testing.assert_allclose(rate, after, rtol=0, atol=fast)
            continue
        # impulses at rigid pairs alone, those that stick among them
        jump = after - rate
        sticks = [hard and state != 0 for hard, state in zip(rigid, log.contact_state[k], strict=True)]
        alone = log.impacts[k] == 1 and not any(sticks)
        along = (rows[[pair] if alone else rigid] @ inverse).T
        np.testing.assert_allclose(along @ np.linalg.lstsq(along, jump)[0], jump, rtol=0, atol=fast)
        if log.impacts[k] > 1:
            continue
        # what the law asks of its speed
        base = space[pair] * float(SINE.velocity(log.time[k]))
        approach, rebound = (float(log.side[k] * (rows[pair] @ v + base)) for v in (rate, after))
        restitution = system.contacts[pair].law.restitution if log.kind[k] == "impact" else 0.0
        assert rebound == pytest.approx(-restitution * approach, abs=fast)
        assert approach > -fast
        moved += 1
    assert moved > 5 or not any(rigid)


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_condition_of_each_event_holds_at_its_row(name):
    run = run_of(name)
    system, log = run.system, run.events
    history, load, _ = drive_of(system, SINE)
    rows = rows_of(system)
    for k in range(1, len(log)):
        pair, side, z = int(log.pair[k]), int(log.side[k]), np.concatenate([log.displacement[k], log.velocity[k]])
        if log.kind[k] in ("impact", "capture", "touch", "separate"):
            base = float(SINE.displacement(log.time[k])) if system.contacts[pair].fixed_to == "space" else 0.0
            x = rows[pair] @ log.displacement[k] + base
            gap = system.contacts[pair].gaps[0 if side > 0 else 1]
            assert side * x == pytest.approx(gap, rel=1e-11)
            continue
        # the force of the contact that was before is zero
        e = equations_of(system, load, states_of(system, log.contact_state[k - 1]))
        wanted = {"let go": FREE, "release": SEPARATING, "press again": PRESSED}[log.kind[k]]
        i = e.meaning.index((pair, side, wanted))
        value = e.rows[i] @ z + e.offset[i] + e.pull[i] * history(float(log.time[k]))
        size = np.abs(e.rows[i]) @ np.abs(z) + abs(e.offset[i]) + abs(e.pull[i] * history(float(log.time[k])))
        assert abs(value) < 1e-9 * size


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_log_has_all_impacts_of_the_table(name):
    run = run_of(name, 20.0)
    log, impacts = run.events, run.impacts
    assert log.impacts.sum() == len(impacts) > 5
    assert np.all(np.diff(log.time) >= 0.0)
    ended = np.repeat(np.arange(len(log)), log.impacts)
    names, alone = np.array(log.contacts)[log.pair], log.impacts[ended] == 1
    np.testing.assert_array_equal(impacts.impactor[alone], names[ended][alone])
    np.testing.assert_array_equal(impacts.side[alone], log.side[ended][alone])
    rigid = impacts.contact_law == "rigid"
    np.testing.assert_array_equal(impacts.time[rigid], log.time[ended][rigid])
    # the table has the touch of a compliant contact, the log its separation too
    for pair in set(impacts.impactor[~rigid]):
        touches = log.time[(names == pair) & (log.kind == "touch")]
        times = impacts.time[impacts.impactor == pair]
        np.testing.assert_array_equal(touches[: times.size], times)
        assert touches.size - times.size in (0, 1)


@pytest.mark.parametrize("name", ["rigid", "sticking", "accumulating"])
def test_impacts_lose_the_energy_that_the_ledger_has(name):
    run = run_of(name, record=fi.Recorder(events=100_000))
    system, log, d = run.system, run.events, run.events.displacement.shape[1]
    M = np.linalg.inv(inverse_mass(system))
    before, after = replayed(system, log)[:, d:], log.velocity[1:]
    lost = 0.5 * (np.einsum("ki,ij,kj->k", before, M, before) - np.einsum("ki,ij,kj->k", after, M, after))
    hit = log.impacts[1:] > 0
    # rounding of velocities, of which the first row has none before it
    rounding = 1e-10 * np.max(np.abs(lost))
    np.testing.assert_allclose(lost[hit], run.impacts.energy_loss[1:], rtol=0, atol=rounding)
    np.testing.assert_allclose(lost[~hit], 0.0, atol=rounding)
    total = run.energy.contact_loss[-1] - run.impacts.energy_loss[0]
    assert lost.sum() == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("name", ["Kelvin-Voigt", "pressed again"])
def test_a_compliant_contact_is_released_before_it_separates(name):
    log = run_of(name, 60.0).events
    follows = {
        "touch": {"release"}, "release": {"press again", "separate"}, "press again": {"release"}, "separate": {"touch"},
    }  # fmt: skip
    assert log.kind[0] == "touch"
    assert all(after in follows[before] for before, after in zip(log.kind[:-1], log.kind[1:], strict=True))
    states = {"touch": 1, "release": 2, "press again": 1, "separate": 0}
    np.testing.assert_array_equal(log.contact_state[:, 0], [states[kind] for kind in log.kind] * log.side)
    found = Counter(log.kind.tolist())
    assert found["touch"] > 5
    assert (found["press again"] > 5) == (name == "pressed again")


def test_impacts_at_one_instant_are_one_row():
    ball = fi.Impactor("left", "mass", 0.3, 0.02, fi.Rigid(0.7))
    system = oscillator(30.0, 0.1, impactors=[ball, replace(ball, name="right")])
    run = fi.integrate(system, fi.Sine(0.02, 1.0), EXACT, 20.0, LOGGED)
    log, times = run.events, Counter(run.impacts.time.tolist())
    assert max(times.values()) >= 2
    assert Counter(log.time.tolist())[log.time[0]] == 1
    assert log.impacts[0] == times[log.time[0]] >= 2
    assert log.kind[0] == "impact"
    assert log.impacts.sum() == len(run.impacts)


@pytest.mark.parametrize("name", ["Kelvin-Voigt", "sticking", "mixed"])
def test_the_logs_of_two_parts_are_that_of_the_whole_also_within_a_contact(name):
    system = SYSTEMS[name]()
    record = replace(LOGGED, interval=1e-3)
    log = fi.integrate(system, SINE, EXACT, 6.0, record).events
    times = 1e-3 * np.arange(1000, 5000)
    state = log.contact_state[np.searchsorted(log.time, times) - 1]
    touching, free = (times[np.any(state != 0, axis=1) == held].tolist() for held in (True, False))
    for cut in (touching[len(touching) // 2], free[len(free) // 2]):
        whole = fi.integrate(system, SINE, EXACT, 6.0, replace(record, state_at=cut))
        first = fi.integrate(system, SINE, EXACT, cut, record)
        rest = fi.integrate(system, SINE, EXACT, 6.0 - cut, record, whole.kept_state)
        assert first.events.time[-1] < cut < rest.events.time[0]
        for item in fields(fi.response.EventLog):
            if "axes" in item.metadata:
                joined = np.concatenate([getattr(run.events, item.name) for run in (first, rest)])
                np.testing.assert_array_equal(joined, getattr(whole.events, item.name))


def test_an_event_at_the_very_end_is_in_the_log_and_in_the_table():
    system = oscillator(impactors=[fi.Impactor("ball", "mass", 1.0, 1.0, fi.Rigid(0.5))])
    run = fi.integrate(system, fi.Sine(0.0, 1.0), EXACT, 1.0, LOGGED, fi.State(ball_velocity=[1.0]))
    assert run.events.time.tolist() == run.impacts.time.tolist() == [run.final_state.time] == [1.0]
    # m e/(m + M) and so on: equal masses, momentum kept, 0.5 apart
    np.testing.assert_allclose(run.events.velocity, [[0.75, 0.25]], rtol=1e-15)
    np.testing.assert_array_equal(run.final_state.ball_velocity, run.events.velocity[0, 1:])
    rest = fi.integrate(system, fi.Sine(0.0, 1.0), EXACT, 1.0, LOGGED, run.final_state)
    assert len(rest.events) == len(rest.impacts) == 0


@pytest.mark.parametrize("name", ["mixed", "sticking"])
def test_a_log_changes_no_bit_of_the_run(name):
    bare, logged = (run_of(name, 10.0, fi.Recorder(events=events)) for events in (0, 1000))
    assert bare.events is None
    for table in ("impacts", "sticking", "energy"):
        one, other = (getattr(run, table) for run in (bare, logged))
        for item in fields(one):
            if item.metadata.get("axes"):
                np.testing.assert_array_equal(getattr(one, item.name), getattr(other, item.name))
    np.testing.assert_array_equal(bare["tip"], logged["tip"])
    np.testing.assert_array_equal(bare.final_state.velocity, logged.final_state.velocity)


def test_what_the_log_has_no_row_for_is_counted_and_noted():
    every, few = run_of("mixed"), run_of("mixed", record=replace(LOGGED, events=7))
    assert not [note for note in every.notes if "Recorder.events" in note]
    assert every.events.dropped == 0
    assert len(few.events) == 7
    assert few.events.dropped == len(every.events) - 7
    assert f"{few.events.dropped} events beyond the first 7 are not in the log (Recorder.events)" in few.notes
    np.testing.assert_array_equal(few.events.displacement, every.events.displacement[:7])


def test_netcdf_and_a_frame_hold_the_same_log(tmp_path):
    import xarray

    log = run_of("mixed", 2.0).events
    file = write_netcdf(tmp_path / "events.nc", log.to_xarray())
    data = xarray.load_dataset(file, engine="h5netcdf")
    for name, unit in column_units(log).items():
        np.testing.assert_array_equal(data[name], log[name])
        assert data[name].attrs.get("units", "") == unit
    assert data["contact"].values.tolist() == list(log.contacts)
    assert data["contact_state"].dims == ("event", "contact")
    frame = log.to_pandas()
    assert frame["kind"].tolist() == log.kind.tolist()
    np.testing.assert_array_equal(frame["velocity_4"], log.velocity[:, 3])
    np.testing.assert_array_equal(frame["contact_state_2"], log.contact_state[:, 1])


def test_each_case_of_a_block_has_its_log():
    system = SYSTEMS["Kelvin-Voigt"]()
    bases = [fi.Sine(0.6e-3, 5.2), fi.Sine(0.4e-3, 5.4), fi.Sine(1e-5, 3.0)]
    drives = [closed_drive(system, base) for base in bases]
    start, d = fi.State().relative_to_base(system, bases[0]), system.dofs + 1
    observed = outputs_of(system, system.point_row(system.default_place))
    store = FormStore([system], drives[:1], [observed])
    velocity = np.array([np.concatenate(fi.State().relative_to_base(system, base)[1::2]) for base in bases])
    inputs = inputs_of(
        drives, [system.contacts] * 3, position=np.tile(np.concatenate(start[::2]), (3, 1)), velocity=velocity,
        window=np.tile([0.0, math.inf], (3, 1)),
    )  # fmt: skip
    block = new_block(store, inputs, EXACT, None, most_events=12)
    assert block.tables.events.shape == (3, 12, 5 + 1 + 2 * d)
    run_block(block, np.zeros(3, dtype=np.int64), np.full(3, 64 * 5, dtype=np.int64), np.full(3, 1e6))
    for c, base in enumerate(bases):
        log = event_log(block.tables.events[c], int(block.tables.logged[c]), ("ball",))
        alone = fi.integrate(system, base, EXACT, 5.0 / base.frequency, replace(LOGGED, events=12)).events
        assert len(log) == len(alone)
        assert log.dropped == alone.dropped
        assert (len(alone) == 0) == (base.amplitude == 1e-5)
        for name in ("time", "displacement", "velocity"):
            np.testing.assert_allclose(getattr(log, name), getattr(alone, name), rtol=1e-9, atol=1e-15)
    assert block.tables.logged[0] > 12
