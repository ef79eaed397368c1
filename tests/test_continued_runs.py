"""A run goes on from the final state of another: two halves are the whole, also when cut inside a contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, oscillator, reduced, with_ball

import femimpact as fi

pytestmark = pytest.mark.impacts

SINE = fi.Sine(0.6e-3, 5.2, 0.3)
FORCE = fi.PointForce("tip", fi.Sine(0.02, 5.0))
RECORD = fi.RecordedBase(0.3 * np.random.default_rng(1).standard_normal(2000), 1e-3)
DRIVES = (SINE, FORCE, RECORD)
KELVIN_VOIGT = fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
DT = 5e-5
NEWMARK = fi.Newmark(DT)
EXACT = fi.EventDriven()
STEPPING = (
    NEWMARK, fi.HHT(DT), fi.GeneralizedAlpha(DT), fi.Newmark(4 * DT, refine=4, allow_coarse_step=True),
    fi.Newmark(DT, contact="energy-consistent"),
)  # fmt: skip
COLUMNS = ("time", "phase", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss")


@pytest.fixture(scope="module")
def modal():
    return reduced(REFERENCE, 6, 12)


@pytest.fixture(scope="module")
def physical():
    return fi.assemble(REFERENCE, elements=8)


@pytest.fixture(scope="module")
def several():
    """Two balls, a stop on the base and one in space."""
    stop = fi.Stop("in space", "tip", 2e-3, KELVIN_VOIGT, fixed_to="space")
    ball = replace(REFERENCE.impactors[0], name="inner", at=0.15, mass=1e-3)
    structure = replace(REFERENCE, impactors=(*REFERENCE.impactors, ball), stops=(stop,))
    return reduced(structure, 5, 12)


@pytest.fixture(scope="module")
def sticking():
    """A ball that bounces from no wall: it sticks to it for a while after every impact."""
    return reduced(with_ball(REFERENCE, contact=fi.Rigid(0.0)), 4, 10)


def recorder(system):
    forces = tuple(f"{pair.name}.contact_force" for pair in system.contacts)
    return fi.Recorder(("tip", "tip.acceleration", "tip.absolute_velocity", *forces), snapshots=50)


def parts_of(system, drive, method, lengths, record=None):
    """Runs of some durations (s), each from the final state of the one before."""
    state, parts = None, []
    for length in lengths:
        parts.append(fi.integrate(system, drive, method, length, record, state))
        state = parts[-1].final_state
    return parts


def joined(parts, of):
    """Arrays of all parts; each begins with the sample that ends the one before."""
    return np.concatenate([of(parts[0]), *(of(part)[1:] for part in parts[1:])])


def steps_in_contact(whole, step):
    """Steps before and after which some contact force acts: for each contact one in the middle of a contact."""
    found = []
    for name, force in whole.channels.items():
        acting = np.flatnonzero(force[:-1] * force[1:] != 0.0) if name.endswith("contact_force") else np.zeros(0, int)
        found += acting[[acting.size // 2]].tolist() if acting.size else []
    assert found
    assert step not in found
    return found


def assert_bits(system, drive, method, duration=1.0):
    """Three parts have the bits of the whole: histories, snapshots, impacts; wherever they were cut."""
    whole = fi.integrate(system, drive, method, duration, recorder(system))
    steps = round(duration / method.dt)
    for cut in (steps // 3, *steps_in_contact(whole, steps // 3)):
        later = (cut + steps) // 2
        lengths = [method.dt * count for count in (cut, later - cut, steps - later)]
        parts = parts_of(system, drive, method, lengths, recorder(system))
        np.testing.assert_array_equal(joined(parts, lambda part: part.time), whole.time)
        for name, values in whole.channels.items():
            np.testing.assert_array_equal(joined(parts, lambda part, name=name: part[name]), values)
        for name in COLUMNS:
            rows = np.concatenate([part.impacts[name] for part in parts])
            np.testing.assert_array_equal(rows, whole.impacts[name])
        to_modes = np.concatenate([part.impacts.energy_to_modes for part in parts])
        np.testing.assert_array_equal(to_modes, whole.impacts.energy_to_modes)
        for name in ("displacement", "velocity", "ball_displacement", "ball_velocity"):
            np.testing.assert_array_equal(getattr(parts[-1].final_state, name), getattr(whole.final_state, name))
    assert len(whole.impacts) > 0


@pytest.mark.parametrize("method", STEPPING, ids=repr)
def test_parts_have_the_bits_of_the_whole_on_modes(modal, method):
    assert_bits(modal, SINE, method)


@pytest.mark.parametrize("method", STEPPING, ids=repr)
def test_parts_have_the_bits_of_the_whole_on_physical_dofs(physical, method):
    assert_bits(physical, SINE, method)


@pytest.mark.parametrize("method", [NEWMARK, STEPPING[3]], ids=repr)
@pytest.mark.parametrize("drive", [FORCE, RECORD], ids=["force", "recorded"])
def test_parts_have_the_bits_of_the_whole_under_other_drives(modal, drive, method):
    # the recorded motion takes a while until the ball meets a wall
    assert_bits(modal, drive, method, duration=2.5 if drive is RECORD else 1.0)


@pytest.mark.parametrize("drive", DRIVES, ids=["sine", "force", "recorded"])
def test_parts_have_the_bits_of_the_whole_with_several_contacts(several, drive):
    assert_bits(several, drive, NEWMARK)


def test_parts_have_the_bits_of_the_whole_with_impulses(sticking):
    # what sticks to its wall takes an impulse in every step: contact forces without an end
    assert_bits(sticking, SINE, fi.MoreauJean(DT))


def test_cycle_statistics_are_those_of_the_whole(modal):
    # 17 whole cycles, and the 16 that end after a cut inside the second one: a third of either is the last 5
    cycle = 1.0 / SINE.frequency
    whole = fi.integrate(modal, SINE, NEWMARK, 17.2 * cycle)
    cut = round(1.4 * cycle / DT) * DT
    after = parts_of(modal, SINE, NEWMARK, [cut, 17.2 * cycle - cut])[1]
    for name in ("peak", "rms", "first_harmonic", "phase"):
        np.testing.assert_array_equal(getattr(after.steady, name), getattr(whole.steady, name))
    # the extremes of the cycle that was cut are in both of its parts
    short = parts_of(modal, SINE, NEWMARK, [cut, 2.1 * cycle - cut])[1]
    entire = fi.integrate(modal, SINE, NEWMARK, 2.1 * cycle, fi.Recorder("tip"))
    second = np.abs(entire["tip"][(entire.time >= cycle) & (entire.time <= 2.0 * cycle)])
    # between two steps a crest rises no higher by more than (omega dt)^2/8 of it, of the modes that matter here
    assert short.steady.peak[0] == pytest.approx(second.max(), rel=1e-4)


def test_energies_begin_anew_and_close(modal):
    whole = fi.integrate(modal, SINE, NEWMARK, 1.0)
    cut = steps_in_contact(fi.integrate(modal, SINE, NEWMARK, 1.0, recorder(modal)), 0)[0]
    before, after = parts_of(modal, SINE, NEWMARK, [cut * DT, 1.0 - cut * DT])
    assert after.energy.work[0] == after.energy.structure_loss[0] == after.energy.contact_loss[0] == 0.0
    assert after.energy.stored[0] == before.energy.stored[-1]
    # sums of the parts are the sums of the whole, to the rounding of some ten thousand terms
    for name in ("work", "structure_loss", "contact_loss"):
        total = getattr(before.energy, name)[-1] + getattr(after.energy, name)[-1]
        assert total == pytest.approx(getattr(whole.energy, name)[-1], rel=1e-10)


def test_a_history_in_pieces_goes_on_with_the_same_bits(modal):
    before, after = parts_of(modal, SINE, NEWMARK, [0.5, 0.5])
    pieces = []
    record = fi.Recorder(sink=pieces.append, piece_samples=333)
    streamed = fi.integrate(modal, SINE, NEWMARK, 0.5, record, before.final_state)
    np.testing.assert_array_equal(np.concatenate([piece.time for piece in pieces]), after.time)
    np.testing.assert_array_equal(np.concatenate([piece.channels["tip"] for piece in pieces]), after["tip"])
    np.testing.assert_array_equal(streamed.final_state.displacement, after.final_state.displacement)


def test_a_run_without_ledger_goes_on_in_one_with_a_ledger(modal):
    cut = steps_in_contact(fi.integrate(modal, SINE, NEWMARK, 1.0, recorder(modal)), 0)[0]
    before = fi.integrate(modal, SINE, NEWMARK, cut * DT, fi.Recorder(ledger=False))
    after = fi.integrate(modal, SINE, NEWMARK, 1.0, initial=before.final_state)
    # as small as that of a run with steps from rest, whose contacts lose and gain by the coarseness of their step
    assert after.energy.residual < 1e-2
    # what the contact had given to each mode before the cut was not summed
    assert np.isnan(after.impacts.energy_to_modes[0]).all()
    assert np.isfinite(after.impacts.energy_to_modes[1:]).all()


# ---- event-driven ----------------------------------------------------------------------------------


def interval_of(system, drive):
    """Time between the readings of a run of some seconds."""
    return EXACT.time_grid(system, drive, 2.0, fi.Recorder())


def samples_inside(starts, ends, interval):
    """Samples of a grid that lie within the phases given, one for each."""
    samples = np.ceil(np.asarray(starts) / interval) + 1
    return samples[samples * interval < np.asarray(ends)].astype(int).tolist()


def assert_impacts_go_on(system, drive, samples, whole, touching):
    """The first three impacts after the cut, and what lasts there, are those of the whole to 1e-10."""
    interval = interval_of(system, drive)
    rest = round(whole.time[-1] / interval) - samples
    before, after = parts_of(system, drive, EXACT, [samples * interval, rest * interval])
    assert (before.final_state.continuation.touching != ()) == touching
    assert before.final_state.time == after.start == after.time[0] == pytest.approx(samples * interval, rel=1e-15)
    first = len(before.impacts)
    count = min(3, len(whole.impacts) - first)
    assert count > 0
    for name in ("time", "approach_speed", "rebound_speed", "impulse", "duration"):
        expected = whole.impacts[name][first : first + count]
        np.testing.assert_allclose(after.impacts[name][:count], expected, rtol=0.0, atol=1e-10)
    # phases are those of the excitation at absolute time; 2 pi f times the tolerance of the time
    expected = whole.impacts.phase[first : first + count]
    np.testing.assert_allclose(after.impacts.phase[:count], expected, rtol=0.0, atol=1e-8)
    near = after.time < after.impacts.time[count - 1]
    tip = whole["tip"][samples:]
    np.testing.assert_allclose(after["tip"][near], tip[near], rtol=0.0, atol=1e-12)
    # in closed form it closes to rounding: `response.energy.CLOSED`
    assert max(before.energy.residual, after.energy.residual) < 1e-9
    return before, after


@pytest.mark.parametrize("drive", DRIVES, ids=["sine", "force", "recorded"])
def test_impacts_after_a_cut_in_free_motion_are_those_of_the_whole(sticking, several, drive):
    for system in (sticking, several):
        whole = fi.integrate(system, drive, EXACT, 2.0)
        impacts, interval = whole.impacts, interval_of(system, drive)
        ends = np.concatenate([impacts.time + impacts.duration, whole.sticking.end])
        begins = np.concatenate([impacts.time, whole.sticking.start])
        # the middle of the longest free time that some impacts follow
        order = np.argsort(begins)
        free = begins[order][1:-3] - np.maximum.accumulate(np.nan_to_num(ends[order]))[:-4]
        middle = begins[order][1:-3][np.argmax(free)] - 0.5 * free.max()
        assert free.max() > 2 * interval
        assert_impacts_go_on(system, drive, round(middle / interval), whole, touching=False)


@pytest.mark.parametrize("drive", [SINE, FORCE], ids=["sine", "force"])
def test_impacts_after_a_cut_inside_a_contact_are_those_of_the_whole(modal, several, drive):
    for system in (modal, several):
        whole = fi.integrate(system, drive, EXACT, 2.0)
        impacts, interval = whole.impacts, interval_of(system, drive)
        samples = np.ceil(impacts.time / interval)
        inside = samples[samples * interval < impacts.time + impacts.duration].astype(int)
        inside = inside[inside * interval < impacts.time[-4]]
        assert inside.size > 0
        for cut in inside[:2]:
            before, after = assert_impacts_go_on(system, drive, int(cut), whole, touching=True)
            # the contact in progress has one row, with its touch before the cut
            assert after.impacts.time.min() < after.start
            assert len(before.impacts) + len(after.impacts) == len(whole.impacts)


@pytest.mark.parametrize("drive", DRIVES, ids=["sine", "force", "recorded"])
def test_impacts_after_a_cut_inside_a_sticking_phase_are_those_of_the_whole(sticking, drive):
    whole = fi.integrate(sticking, drive, EXACT, 2.0)
    phases = whole.sticking
    interval = interval_of(sticking, drive)
    inside = samples_inside(phases.start[:-4], phases.end[:-4], interval)
    assert inside
    for cut in inside[:2]:
        before, after = assert_impacts_go_on(sticking, drive, cut, whole, touching=True)
        ended = np.isfinite(before.sticking.end)
        first = int(np.count_nonzero(ended))
        # the phase in progress has its start before the cut, and the impulse of all of it
        assert after.sticking.start[0] < after.start < after.sticking.end[0]
        for name in ("start", "end", "impulse"):
            expected = getattr(phases, name)[first]
            assert getattr(after.sticking, name)[0] == pytest.approx(expected, rel=0.0, abs=1e-10)


# ---- time, other excitations, other methods --------------------------------------------------------


@pytest.mark.parametrize("method", [NEWMARK, EXACT, STEPPING[3]], ids=repr)
def test_a_run_at_a_later_time_is_that_of_a_sine_with_a_later_phase(several, method):
    start = 0.37
    shifted = replace(SINE, phase=SINE.phase + SINE.omega * start)
    early = fi.integrate(several, shifted, method, 0.4)
    late = fi.integrate(several, SINE, method, 0.4, initial=fi.State(time=start))
    np.testing.assert_allclose(late.time, start + early.time, rtol=1e-14)
    # before the first impact, after which rounding grows
    quiet = early.time < early.impacts.time[0]
    assert quiet.sum() > 20
    np.testing.assert_allclose(late["tip"][quiet], early["tip"][quiet], rtol=0.0, atol=1e-13)
    assert late.impacts.time[0] == pytest.approx(start + early.impacts.time[0], abs=1e-10)
    assert late.impacts.phase[0] == pytest.approx(early.impacts.phase[0], abs=1e-8)
    assert late.window == pytest.approx((start + 0.8 / 3, start + 0.4), abs=2e-3)


@pytest.mark.parametrize("method", [NEWMARK, EXACT], ids=repr)
@pytest.mark.parametrize("start", [0.4, 0.4003], ids=["on a sample", "between samples"])
def test_a_recorded_motion_at_a_later_time_is_that_of_its_later_samples(method, start):
    system, t = oscillator(stiffness=1e3, damping=2.0), 1e-4 * np.arange(20000)
    # straight lines 1 ms long, given by samples ten times as dense
    samples = np.interp(t, t[::10], np.sin(31.0 * t[::10]) + np.cos(7.0 * t[::10]))
    later, record = fi.RecordedBase(samples[round(start / 1e-4) :], 1e-4), fi.Recorder("mass")
    if method is EXACT:
        record = replace(record, interval=3e-3)
    early = fi.integrate(system, later, method, 0.5, record)
    late = fi.integrate(system, fi.RecordedBase(samples[::10], 1e-3), method, 0.5, record, fi.State(time=start))
    # of some millimetres, with the rounding of thousands of steps
    assert np.abs(early["mass"]).max() > 1e-3
    np.testing.assert_allclose(late["mass"], early["mass"], rtol=0.0, atol=1e-13)


def test_the_recorder_keeps_from_an_absolute_time_on(modal):
    before = fi.integrate(modal, SINE, NEWMARK, 0.5)
    after = fi.integrate(modal, SINE, NEWMARK, 0.5, fi.Recorder(start=0.8), before.final_state)
    assert after.time[0] == pytest.approx(0.8, abs=1e-12)
    assert after.time[-1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("sink", [None, lambda piece: None])
@pytest.mark.parametrize(("method", "time"), [(NEWMARK, 0.7), (EXACT, 0.2 + 2 / 5.2)], ids=repr)
def test_a_state_kept_within_a_run_goes_on_with_the_bits_of_the_run(modal, method, time, sink):
    first = fi.integrate(modal, SINE, method, 0.2)
    # event-driven at the end of a base cycle, with a grid of readings that goes on
    start = first.final_state.time
    time = start + (time - 0.2)
    record = replace(recorder(modal), state_at=time + 1e-5, sink=sink, piece_samples=900)
    whole = fi.integrate(modal, SINE, method, 0.8, record, first.final_state)
    assert whole.kept_state.time == pytest.approx(time, abs=1e-12)
    left = whole.final_state.time - time
    end = fi.integrate(modal, SINE, method, left, replace(recorder(modal), sink=sink), whole.kept_state).final_state
    assert_same_state(end, whole.final_state)


def assert_same_state(one, other):
    for name in ("time", "displacement", "velocity", "ball_displacement", "ball_velocity"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_run_read_more_often_from_a_kept_state_on_is_the_same_motion(several):
    record = replace(recorder(several), state_at=1.0)
    whole = fi.integrate(several, RECORD, EXACT, 1.9, record)
    kept = whole.kept_state
    often = replace(recorder(several), interval=interval_of(several, RECORD) / 4)
    rest = fi.integrate(several, RECORD, EXACT, whole.final_state.time - kept.time, often, kept)
    assert_same_state(rest.final_state, whole.final_state)
    np.testing.assert_array_equal(rest.time[::4], whole.time[-rest.time[::4].size :])


@pytest.mark.parametrize("time", [None, 0.0, 0.2, 1.5])
def test_no_state_is_kept_outside_a_run(modal, time):
    first = fi.integrate(modal, SINE, NEWMARK, 0.2)
    assert fi.integrate(modal, SINE, NEWMARK, 0.8, fi.Recorder(state_at=time), first.final_state).kept_state is None


def test_what_is_made_anew_with_the_same_numbers_goes_on_as_the_same(modal):
    again = reduced(REFERENCE, 6, 12)
    for drive, same in ((SINE, replace(SINE)), (RECORD, fi.RecordedBase(np.array(RECORD.samples), RECORD.interval))):
        before, after = parts_of(modal, drive, NEWMARK, [0.5, 0.5])
        other = fi.integrate(again, same, NEWMARK, 0.5, initial=before.final_state)
        np.testing.assert_array_equal(other["tip"], after["tip"])


@pytest.mark.parametrize("method", [NEWMARK, STEPPING[4], EXACT], ids=repr)
def test_contacts_go_on_under_another_excitation(modal, method):
    whole = fi.integrate(modal, SINE, NEWMARK, 1.0, recorder(modal))
    cut = steps_in_contact(whole, 0)[0] * DT
    interval = method.time_grid(modal, SINE, 1.0, fi.Recorder())
    before = fi.integrate(modal, SINE, method, np.round(cut / interval) * interval)
    assert before.final_state.continuation.touching == ("ball",)
    other = fi.Sine(0.6e-3, 5.4)
    after = fi.integrate(modal, other, method, 0.5, initial=before.final_state)
    of_one = ("the run ends", "transient of the first mode", "ball is in contact at the end", "contact_force is read")
    of_runs = [[text for text in run.notes if not text.startswith(of_one)] for run in (before, after)]
    assert of_runs[0] == of_runs[1]
    assert not any("anew" in note for note in after.notes)
    # the contact keeps its touch, which was before the cut
    touched = fi.integrate(modal, SINE, method, 0.7).impacts.time
    assert after.impacts.time[0] == pytest.approx(touched[len(before.impacts)], abs=1e-12)
    assert after.impacts.time[0] < after.start
    # as of a separate run
    assert after.energy.residual < 1e-2
    restarted = fi.integrate(modal, other, method, 0.5, initial=replace(before.final_state, time=0.0))
    assert restarted.time[0] == 0.0
    assert restarted.impacts.time[0] == pytest.approx(after.impacts.time[0] - after.start, abs=1e-12)


def test_a_state_inside_a_contact_begins_it_anew_by_another_method_and_says_so(modal, sticking):
    whole = fi.integrate(modal, SINE, NEWMARK, 1.0, recorder(modal))
    cut = steps_in_contact(whole, 0)[0] * DT
    state = fi.integrate(modal, SINE, NEWMARK, cut).final_state
    following = whole.impacts.time[whole.impacts.time > cut][0]
    for method in (fi.HHT(DT), fi.Newmark(0.5 * DT), EXACT):
        run = fi.integrate(modal, SINE, method, 0.5, initial=state)
        assert "inside a contact of ball, which begins anew" in run.notes[0]
        assert run.impacts.time[0] == pytest.approx(cut, abs=1e-12)
        # the course of the contact is nearly the same: the next one comes within a few steps
        assert run.impacts.time[1] == pytest.approx(following, abs=50 * DT)
    free = fi.integrate(modal, SINE, NEWMARK, 0.05).final_state
    assert not any("anew" in note for note in fi.integrate(modal, SINE, EXACT, 0.5, initial=free).notes)
    phases = fi.integrate(sticking, SINE, EXACT, 2.0).sticking
    interval = EXACT.time_grid(sticking, SINE, 1.0, fi.Recorder())
    stuck = fi.integrate(sticking, SINE, EXACT, samples_inside(phases.start, phases.end, interval)[0] * interval)
    for method, drive in ((fi.MoreauJean(DT), SINE), (EXACT, fi.Sine(1e-3, 5.0))):
        run = fi.integrate(sticking, drive, method, 0.5, initial=stuck.final_state)
        assert any("begins anew" in note for note in run.notes)


def test_replaced_values_and_other_gaps_are_a_start_of_their_own(modal):
    whole = fi.integrate(modal, SINE, NEWMARK, 1.0, recorder(modal))
    cut = steps_in_contact(whole, 0)[0] * DT
    state = fi.integrate(modal, SINE, NEWMARK, cut).final_state
    still = replace(state, ball_velocity=[0.0])
    run = fi.integrate(modal, SINE, NEWMARK, 0.2, initial=still)
    assert any("begins anew" in note for note in run.notes)
    wider = reduced(with_ball(REFERENCE, gap=5e-3), 6, 12)
    assert any("begins anew" in note for note in fi.integrate(wider, SINE, NEWMARK, 0.2, initial=state).notes)
    narrower = reduced(with_ball(REFERENCE, gap=3e-3, contact=fi.Rigid(0.6)), 6, 12)
    with pytest.raises(fi.InputError, match="must start between its walls"):
        fi.integrate(narrower, SINE, EXACT, 0.2, initial=state)


def test_a_sweep_from_the_state_of_a_run_begins_at_zero(modal):
    state = fi.integrate(modal, SINE, NEWMARK, 0.05).final_state
    plain = fi.State(state.displacement, state.velocity, state.ball_displacement, state.ball_velocity)
    for method in (NEWMARK, EXACT):
        curves = [
            fi.frequency_sweep(modal, 0.2e-3, [5.0, 5.2], method, cycles=12, initial=start) for start in (state, plain)
        ]
        np.testing.assert_array_equal(curves[0].peak, curves[1].peak)


def test_a_preloaded_stop_that_is_rigid_goes_on_with_its_bits():
    # the wall of such a start is moved to it, by less than rounding
    structure = replace(REFERENCE, impactors=(), stops=(fi.Stop("stop", "tip", (-1e-4, np.inf), fi.Rigid(0.6)),))
    assert_bits(fi.reduce(fi.assemble(structure, elements=10), modes=4), SINE, fi.MoreauJean(DT))


def test_a_start_so_late_that_rounding_exchanges_the_readings_is_refused():
    drive, late = fi.Sine(1e-4, 5.0), fi.State(time=1e12)
    with pytest.raises(fi.InputError, match=r"^initial\.time = 1000000000000\.0 s: must be at most 3\.12e\+11 s"):
        fi.integrate(oscillator(900.0), drive, fi.EventDriven(), 1.0, initial=late)
