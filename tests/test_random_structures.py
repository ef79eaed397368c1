"""A hundred random structures through the event-driven method: none refused, every ledger closed, no wall passed."""

import math
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from random_structures import random_case, resting_case
from table_sums import loss_left, momentum_left

import femimpact as fi
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.closed_form import closed_forms
from femimpact.integrators.event_driven.complex_modes import part_of
from femimpact.integrators.event_driven.equations import equations_of, stacked

pytestmark = pytest.mark.impacts

MIXED = (*range(100), 229)
"""229: a pair that sticks beside another is let go, and is left with a rate of rounding."""

RESTING = range(-16, 0)
"""A ball lies on its wall at the start, and is left by it; see `resting_case`."""

SEEDS = (*MIXED, *RESTING)

UNUSUAL = (
    "the law is made for the first mode's mass",
    "the base moves by up to",
    "where no mode is kept",
    "the record is coarse",
    "begins in motion",
)
"""Of records that drift further than half the beam's length, have few samples in a period or move from the first one
on, and of one mode that is driven far above itself: allowed, and warned of."""

PHYSICAL = {
    # the generator keeps a drive away from undamped frequencies of the structure, not from those of its contact states
    "must not be a natural frequency of an undamped mode": "without damping a resonance grows without bound",
}
"""Refusals with a reason in the physics: their text, and the reason."""


@cache
def case_of(seed):
    return resting_case(-seed) if seed < 0 else random_case(seed)


@cache
def run_of(seed):
    """The run of a seed; None where the physics refuses it."""
    case = case_of(seed)
    channels = tuple(f"{pair.name}.gap" for pair in case.system.contacts)
    places = (case.system.default_place, *(pair.name for pair in case.system.balls))
    speeds = tuple(f"{pair.name}.absolute_velocity" for pair in case.system.balls)
    record = fi.Recorder((*channels, *places, *speeds), impacts=1_000_000)
    try:
        return fi.integrate(case.system, case.excitation, fi.EventDriven(), case.duration, record, case.initial)
    except (fi.InputError, fi.DivergenceError) as refusal:
        if any(text in str(refusal) for text in PHYSICAL):
            return None
        refusal.add_note(case.description)
        raise


every_seed = pytest.mark.parametrize("seed", SEEDS)


@every_seed
def test_the_ledger_closes(seed):
    run = run_of(seed)
    if run is None:
        return
    # above 1e-9 and above the bound that it derives for its own rounding, a run warns; so it does of lost impacts
    unexpected = [text for text in run.warnings if not any(words in text for words in UNUSUAL)]
    assert unexpected == [], case_of(seed).description
    assert np.isfinite(run.energy.residual)


@every_seed
def test_losses_never_come_back(seed):
    run = run_of(seed)
    if run is None:
        return
    energy = run.energy
    # rounding of sums, and of states whose energies are far larger than what is lost between two samples
    rounding = 1e-11 * energy.largest_input
    for name in ("structure_loss", "contact_loss"):
        lost = getattr(energy, name)
        assert lost[0] == 0.0
        assert np.min(np.diff(lost)) >= -rounding, name
    for name in ("kinetic", "strain", "ball", "contact"):
        assert np.min(getattr(energy, name)) >= -rounding, name


@every_seed
def test_no_ball_passes_a_rigid_wall(seed):
    run = run_of(seed)
    if run is None:
        return
    for pair in run.system.contacts:
        if not isinstance(pair.law, fi.Rigid):
            continue
        x = run[f"{pair.name}.gap"]
        moved = 0.0 if pair.is_stop else float(np.max(np.abs(run[pair.name])))
        # the gap is a difference of two displacements, and what is left out of an accumulation is below the closure
        largest = max(moved, float(np.max(np.abs(x))))
        slack = 1e-12 * largest + fi.EventDriven().closure
        assert np.max(x) <= pair.gaps[0] + slack, pair.name
        assert np.min(x) >= -pair.gaps[1] - slack, pair.name


@every_seed
def test_the_table_of_impacts_is_that_of_the_laws(seed):
    run = run_of(seed)
    if run is None:
        return
    table = run.impacts
    assert table.dropped == 0
    for pair in run.system.contacts:
        own = table.impactor == pair.name
        if not np.any(own):
            continue
        side, approach, rebound = table.side[own], table.approach_speed[own], table.rebound_speed[own]
        assert set(side) <= {-1.0, 1.0}
        walls = [s for s, gap in zip((1.0, -1.0), pair.gaps, strict=True) if math.isfinite(gap)]
        assert set(side) <= set(walls)
        # a pair that starts at rest at its wall touches it at a speed that is zero but for rounding
        assert np.all(approach > -1e-12 * np.max(approach))
        assert np.all(rebound >= 0.0)
        assert np.all(table.impulse[own] >= 0.0)
        assert np.all((table.time[own] >= 0.0) & (table.time[own] <= run.time[-1] * (1.0 + 1e-12)))
        if isinstance(pair.law, fi.Rigid):
            check_rigid(run, pair, own)
        else:
            # a contact that a start is in, and leaves without a force, lasts no time
            assert np.all((table.duration[own] > 0.0) | ((table.time[own] == 0.0) & (table.impulse[own] == 0.0)))
            assert np.all(np.diff(table.time[own]) > 0.0)
    # what the impacts lost, with contacts not yet over, is all that the ledger has lost in contacts
    assert loss_left(run) < 1e-9
    for pair in run.system.balls:
        if not pair.free_stiffness:
            assert momentum_left(run, case_of(seed).initial, pair.name) < 1e-9


def check_rigid(run, pair, own):
    """Rebound e v and loss of every impact but the last of an accumulation; its impulse where no other pair takes part.

    That is (1 + e) v/(1/m + b^T M^-1 b).
    """
    table, e = run.impacts, pair.law.restitution
    time, approach, rebound = table.time[own], table.approach_speed[own], table.rebound_speed[own]
    assert np.all(np.diff(time) >= 0.0)
    felt = 1.0 / (pair.mobility + float(np.sum(pair.direction**2 / run.system.M.diagonal())))
    bounced = rebound > 0.0
    # a few products of numbers that have 16 digits
    np.testing.assert_allclose(rebound[bounced], e * approach[bounced], rtol=1e-13)
    impulse, loss = table.impulse[own], table.energy_loss[own]
    alone = bounced & is_alone(run, pair, time)
    np.testing.assert_allclose(impulse[alone], (1.0 + e) * felt * approach[alone], rtol=1e-12)
    # e = 1 loses the rounding of what it gives back
    expected = 0.5 * impulse * (approach - rebound)
    size = impulse * approach
    np.testing.assert_allclose((loss - expected)[bounced] / size[bounced], 0.0, atol=1e-12)
    # the last of an accumulation may share its instant with others, whose impulses change what is left to lose
    assert np.all(loss >= -1e-12 * size)
    if e > 0.0:
        # only the last impact of an accumulation has no rebound: a sticking phase of that pair follows
        phases = run.sticking.impactor == pair.name
        end = np.where(np.isnan(run.sticking.end[phases]), math.inf, run.sticking.end[phases])
        for last in time[~bounced]:
            assert np.any(end >= last)


def is_alone(run, pair, time):
    """Whether no other rigid pair collides at these times (s), or sticks."""
    rigid = [other.name for other in run.system.contacts if isinstance(other.law, fi.Rigid) and other is not pair]
    others, phases = np.isin(run.impacts.impactor, rigid), np.isin(run.sticking.impactor, rigid)
    end = np.where(np.isnan(run.sticking.end[phases]), math.inf, run.sticking.end[phases])
    start = run.sticking.start[phases]
    sticks = np.any((start[:, None] <= time) & (time <= end[:, None]), axis=0)
    # a phase begins in the table when the last bounces would have ended: its last impact is somewhat before that
    begun = np.isin(run.impacts.impactor, rigid) & (run.impacts.rebound_speed == 0.0)
    for captured in run.impacts.time[begun]:
        later = start[start >= captured]
        sticks |= (captured <= time) & (time <= (later.min() if later.size else math.inf))
    return ~np.isin(time, run.impacts.time[others]) & ~sticks


@every_seed
def test_impacts_at_one_instant_are_those_of_the_rule(seed):
    run = run_of(seed)
    if run is None:
        return
    pairs = {pair.name: pair for pair in run.system.contacts}
    table, inverse = run.impacts, 1.0 / run.system.M.diagonal()
    rigid = np.array([isinstance(pairs[name].law, fi.Rigid) for name in table.impactor], dtype=bool)
    for time in np.unique(table.time[rigid]):
        rows = np.flatnonzero(rigid & (table.time == time))
        several = np.unique(table.impactor[rows]).size == rows.size > 1
        if not several or np.any(table.rebound_speed[rows] == 0.0) or run.sticking.start.size:
            continue
        # what the impulses take away at each: (1 + e) times its approach
        push = np.array([pairs[table.impactor[row]].direction * table.side[row] for row in rows])
        mobility = (push * inverse) @ push.T + np.diag([pairs[table.impactor[row]].mobility for row in rows])
        taken = table.approach_speed[rows] + table.rebound_speed[rows]
        np.testing.assert_allclose(mobility @ table.impulse[rows], taken, rtol=1e-11)


@pytest.mark.parametrize("seed", range(10, 30))
def test_a_small_table_holds_the_first_rows_of_a_large_one(seed):
    """What happens after the last kept row, the capture of a pair that it is of too, changes none."""
    run, case = run_of(seed), case_of(seed)
    if run is None or not len(run.impacts):
        return
    captured = np.flatnonzero(run.impacts.rebound_speed == 0.0)
    # up to just before an impact whose rebound is taken: the kept rows of that pair must stay
    for rows in {5, *(int(row) for row in captured[[0, captured.size // 2]] if row)} if captured.size else {5}:
        record = fi.Recorder((), impacts=rows)
        small = fi.integrate(case.system, case.excitation, fi.EventDriven(), case.duration, record, case.initial)
        kept = min(rows, len(run.impacts))
        assert (len(small.impacts), small.impacts.dropped) == (kept, len(run.impacts) - kept)
        assert any("not in the table" in text for text in small.warnings) == (kept < len(run.impacts))
        ended = min(rows, int(np.count_nonzero(np.isfinite(run.sticking.end))))
        for few, many, count in ((small.impacts, run.impacts, kept), (small.sticking, run.sticking, ended)):
            for item in fields(few):
                if isinstance(getattr(few, item.name), np.ndarray):
                    own, first = getattr(few, item.name)[:count], getattr(many, item.name)[:count]
                    np.testing.assert_array_equal(own, first, err_msg=item.name)


@pytest.mark.parametrize("seed", RESTING)
def test_a_wall_only_pushes_the_ball_that_lies_on_it(seed):
    """Beside one wall alone the velocity that its constant force has not made changes away from that wall only."""
    run = run_of(seed)
    for pair in run.system.balls:
        side = 1.0 if pair.gaps[0] < pair.gaps[1] else -1.0
        pushed = run[f"{pair.name}.absolute_velocity"] - pair.acceleration * run.time
        assert np.all(side * np.diff(pushed) <= 1e-12 * np.abs(pushed).max()), pair.name
    # it does not stay where it was put
    lying, start = run.sticking.impactor == "lying", run.sticking.start == 0.0
    assert run.sticking.end[lying & start].size == 1
    assert run.sticking.end[lying & start][0] < run.time[-1]


def test_the_seeds_are_as_busy_and_as_mixed_as_they_are_said_to_be():
    cases = [case_of(seed) for seed in MIXED]
    counts = np.array([len(run_of(seed).impacts) for seed in MIXED if run_of(seed)])
    assert np.count_nonzero((counts >= 50) & (counts <= 3000)) >= 0.6 * counts.size
    assert np.median(counts) > 100
    pairs = [pair for case in cases for pair in case.system.contacts]
    assert {pair.is_stop for pair in pairs} == {True, False}
    assert {type(pair.law) for pair in pairs} == {fi.Rigid, fi.KelvinVoigt}
    assert {type(case.excitation) for case in cases} == {fi.Sine, fi.PointForce, fi.RecordedBase}
    assert any(pair.acceleration for pair in pairs)
    assert any(pair.free_stiffness for pair in pairs)
    assert any(0.0 in pair.gaps for pair in pairs)
    # another machine draws the same numbers; a seed gives the same case twice
    again = random_case(3)
    assert (again.description, again.duration) == (cases[3].description, cases[3].duration)


@pytest.mark.parametrize("seed", range(20, 50))
def test_the_peak_of_a_cycle_does_not_hang_on_the_samples(seed):
    """Crests between 8 samples of a cycle are those between 4096, where both runs are one motion."""
    case, runs = case_of(seed), []
    # the last of three cycles is measured
    duration, place = 3.0 / case.excitation.frequency, case.system.default_place
    for samples in (8, 4096):
        # a record is read by its own interval, or by one that is given
        interval = 1.0 / (case.excitation.frequency * samples) if hasattr(case.excitation, "interval") else None
        method = fi.EventDriven(samples_per_cycle=samples)
        record = fi.Recorder((place,), ledger=False, interval=interval)
        runs.append(fi.integrate(case.system, case.excitation, method, duration, record, case.initial))
    coarse, fine = runs
    dense = np.max(np.abs(fine[place][-4096:]))
    assert dense > 1e-12
    assert coarse.steady.peak[0] == pytest.approx(fine.steady.peak[0], rel=1e-9)
    assert coarse.steady.peak[0] >= dense * (1.0 - 1e-9)


# ---- many systems at once -------------------------------------------------------------------------


def arrays_of(value, name=""):
    """Every array below a dataclass, with a path of names."""
    if isinstance(value, np.ndarray):
        yield name, value
    else:
        for item in fields(value):
            yield from arrays_of(getattr(value, item.name), f"{name}.{item.name}")


@pytest.mark.parametrize("seed", range(20))
def test_closed_forms_of_systems_together_have_the_bits_of_each_alone(seed):
    """A case of a study has the same bits whatever cases stand beside it."""
    case, rng = random_case(seed), np.random.default_rng(seed)
    drive = drive_of(case.system, case.excitation)
    variants = []
    for _ in range(7):
        damped = fi.system.with_damping(
            case.system, fi.Rayleigh(frequencies=(1.0, 50.0), ratio=10.0 ** rng.uniform(-3.0, 0.0))
        )
        pairs = [
            pair if pair.is_stop else replace(pair, mass=pair.mass * rng.uniform(0.5, 2.0)) for pair in damped.contacts
        ]
        variants.append(equations_of(replace(damped, contacts=tuple(pairs)), drive))
    rigid = np.array([pair.parameters.is_rigid for pair in case.system.contacts])
    stiffness, damping = np.where(rigid, 0.0, 10.0 ** rng.uniform(0.0, 5.0, (2, 7, rigid.size)))
    sets = (np.zeros_like(rigid), *(np.arange(rigid.size) == j for j in range(rigid.size)))
    for active in sets:
        found = closed_forms(stacked(variants), active, stiffness, damping)
        assert sorted(np.concatenate([members for members, _ in found])) == list(range(7))
        for members, forms in found:
            for f, number in enumerate(members):
                one = stacked([variants[number]])
                ((_, alone),) = closed_forms(one, active, stiffness[[number]], damping[[number]])
                for (name, together), (_, single) in zip(
                    arrays_of(part_of(forms, np.array([f]))), arrays_of(alone), strict=True
                ):
                    np.testing.assert_array_equal(together, single, err_msg=name)
