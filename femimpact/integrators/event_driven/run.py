"""One event-driven run: from a system and an excitation to its response."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array, own, read_only
from femimpact.core.structs import zeros
from femimpact.errors import DivergenceError, require
from femimpact.excitation.excitation import Excitation
from femimpact.integrators.assembly import (
    MethodRun,
    Readings,
    cycles_of_table,
    impacts_of,
    snapshots_of,
    sticking_of,
    whole_number_of,
)
from femimpact.integrators.cases import check_memory, first_steps
from femimpact.integrators.channel_rows import Drive, channel_rows, drive_of, mode_notes
from femimpact.integrators.event_driven.block import (
    EXTREMES,
    Block,
    inputs_of,
    new_block,
    no_cycles,
    run_block,
    work_apart,
)
from femimpact.integrators.event_driven.equations import require_met
from femimpact.integrators.event_driven.loop_data import (
    CONTACT,
    FREE,
    KIND,
    EventSettings,
    Held,
    ReadingGrid,
    contacts_in_progress,
    grid_from,
    held_by,
    reading_grid,
)
from femimpact.integrators.event_driven.store import FormStore, Outputs, outputs_alone, outputs_of
from femimpact.progress import Progress
from femimpact.response.channels import Channel, resolve_channels
from femimpact.response.cycles import Largest, LargestValues
from femimpact.response.energy import BALANCED, CLOSED, EnergyLedger, unbalanced
from femimpact.response.history import HistoryPiece, Stream
from femimpact.response.impacts import COUNT, MAXIMUM, MINIMUM, PEAK_FORCE, StickingPhases, event_log
from femimpact.response.response import Recorder
from femimpact.system.state import Continuation, State
from femimpact.system.system import System
from femimpact.units import number_text

CYCLES_AT_ONCE = 256
"""Base cycles between two reports of progress, when interrupts are checked."""

SAMPLES_AT_ONCE = 2**17
"""The same in samples, at most, where these do not divide base cycles."""

LEAST_INTERVAL = 1e-14
"""Time between two readings as a share of the times themselves, below which rounding may exchange them."""


def closed_drive(system: System, excitation: Excitation) -> Drive:
    """The right-hand side of an excitation that has a closed form."""
    drive = drive_of(system, excitation)
    allowed = "must have a closed_form for EventDriven: sample it into a RecordedBase, or take Newmark"
    require(drive.closed_form is not None, "excitation", type(excitation).__name__, "", allowed)
    return drive


def block_alone(
    system: System, excitation: Excitation, drive: Drive, method: EventSettings, outputs: Outputs, initial: State,
    grid: ReadingGrid, begin: float, ledger: bool | None, most_rows: int, most_events: int = 0,
) -> tuple[Block, ReadingGrid]:  # fmt: skip
    """Arrays of one case at its start, and its instants from there on; impacts are counted from `begin` (s) on."""
    store = FormStore([system], [drive], [outputs])
    u, v, y, y_rate = initial.relative_to_base(system, excitation)
    latest = grid.interval / LEAST_INTERVAL
    allowed = f"must be at most {latest:.3g} s in size where a run is read every {grid.interval:.4g} s"
    require(abs(initial.time) < latest, "initial.time", initial.time, "s", allowed)
    balls, held = len(system.balls), held_by(initial, system, excitation)
    inputs = inputs_of(
        [drive],
        [system.contacts],
        position=np.concatenate([u, y[:balls]])[None],
        velocity=np.concatenate([v, y_rate[:balls]])[None],
        window=np.array([[begin, math.inf]]),
        start=initial.time,
        held=held,
    )
    block = new_block(store, inputs, method, ledger, most_rows, most_events)
    work_apart(block, drive, initial.time)
    grid = grid_from(held, initial.time, grid)
    block.grid = block.grid._replace(
        start=np.array([grid.origin]),
        interval=np.array([grid.interval]),
        per_cycle=grid.per_cycle,
        origin=np.array([grid.first]),
    )
    return block, grid


def pieces(grid: ReadingGrid, recorder: Recorder, samples: int) -> Iterator[tuple[int, int]]:
    """First and last sample of each piece, after the beginning: a run has its bits in the same pieces only.

    Where a base cycle is an integer number of samples, a piece is an integer number of cycles, and if possible no
    longer than one for the sink.
    """
    most = 0 if recorder.sink is None else recorder.piece_samples * max(recorder.every, 1)
    if grid.follows_cycles:
        per_cycle = int(grid.per_cycle)
        fitting = max(most // per_cycle, 1) if most else CYCLES_AT_ONCE
        piece = min(CYCLES_AT_ONCE, fitting) * per_cycle
    else:
        piece = min(max(int(CYCLES_AT_ONCE * grid.per_cycle), 1), SAMPLES_AT_ONCE, most or SAMPLES_AT_ONCE)
    done, state_at = 0, sample_to_keep(grid, recorder, samples)
    while done < samples:
        end = min(done + piece, samples)
        if done < state_at:
            end = min(end, state_at)
        yield done, end
        done = end


def sample_to_keep(grid: ReadingGrid, recorder: Recorder, samples: int) -> int:
    """Sample after the beginning at which the state is kept, 0 for none.

    The last end of a cycle before the time where a cycle is an integer number of samples, else the sample before it.
    """
    if recorder.state_at is None:
        return 0
    stride = int(grid.per_cycle) if grid.follows_cycles else 1
    sample = math.floor(min(recorder.state_at / (stride * grid.interval) + 1e-9, samples)) * stride
    return sample if sample <= samples else 0


def unending(time: float, method: EventSettings) -> str:
    """Words for events that do not end."""
    return (
        f"impacts and changes of contact at t = {time:.6g} s do not resolve within {method.most_events} events a "
        f"cycle: raise closure ({method.closure:g} m) or most_events, or check gaps that leave no clearance"
    )


def find_largest(
    system: System, excitation: Excitation, method: EventSettings, duration: float, recorder: Recorder, initial: State,
    channels: tuple[Channel, ...],
) -> tuple[Largest, ...]:  # fmt: skip
    """Largest values of channels over a run, each found as the peak of a cycle is, to 1e-9 of itself.

    The motion has the bits of `run_events` with the same arguments.
    """
    instants = []
    for channel in channels:
        highest, lowest = find_extremes(system, excitation, method, duration, recorder, initial, channel)
        # the sooner one of two of one size
        first = (highest.value, -highest.time) >= (-lowest.value, -lowest.time)
        instants.append(highest if first else lowest)
    return tuple(instants)


def find_extremes(
    system: System, excitation: Excitation, method: EventSettings, duration: float, recorder: Recorder, initial: State,
    channel: Channel,
) -> tuple[Largest, Largest]:  # fmt: skip
    """Maximum and minimum of a channel over a run, as of `find_largest`."""
    grid, drive = reading_grid(system, excitation, method, duration, recorder), closed_drive(system, excitation)
    samples = round(duration / grid.interval)
    parts = list(pieces(grid, recorder.seen_from(initial.time), samples))
    outputs = outputs_alone(system, channel_rows(system, drive, (channel,), springs_apart=True), drive)
    # a piece takes the place of a base cycle
    grid = replace(grid, per_cycle=float(max(end - done for done, end in parts)))
    block, grid = block_alone(system, excitation, drive, method, outputs, initial, grid, math.inf, None, 0)
    extremes, most = no_cycles(1, 1), float(method.most_events)
    for done, end in parts:
        begin = grid.first + done
        block.cases.sample[0] = begin
        block.grid = block.grid._replace(
            origin=np.array([begin]), cycle=np.zeros(1, dtype=np.int64), cycles=extremes, kept=np.full(end - done, -1)
        )
        run_block(block, np.array([begin]), np.array([begin + end - done]), np.array([most * max(end - done, 1)]))
    row, times = extremes[0, 0], extremes[0, 0, -EXTREMES:]
    notes = mode_notes(system, drive, (channel,))
    highest, lowest = (Largest(float(row[i]), float(times[i]), channel.unit, notes) for i in (MAXIMUM, MINIMUM))
    return highest, lowest


def reread(
    system: System, excitation: Excitation, method: EventSettings, duration: float, recorder: Recorder, initial: State,
    channels: tuple[Channel, ...],
    start: float,  # s: from when on
    longest: float,  # s: between two readings at most
) -> tuple[Array, dict[str, Array]]:  # fmt: skip
    """Times (s) and values of channels over a run that is computed once more, with the bits that it had."""
    grid, recorder = reading_grid(system, excitation, method, duration, recorder), recorder.seen_from(initial.time)
    samples, parts = round(duration / grid.interval), 1
    while parts * longest < grid.interval:
        # doubled, the grid keeps its instants to the last bit
        parts *= 2
    finer = replace(grid, interval=grid.interval / parts, per_cycle=grid.per_cycle * parts)
    begin = max(start - initial.time, 0.0)
    bare = replace(recorder, ledger=False, impacts=0, events=0, snapshots=0, every=1, start=begin, state_at=None)
    run = _new_run(system, excitation, method, channels, bare, math.inf, initial, finer, samples * parts)
    # a run has its bits in the same pieces only
    for done, end in pieces(grid, recorder, samples):
        _call(run, done * parts, (end - done) * parts)
    piece = _history(run, 0, 0)
    return piece.time, dict(piece.channels)


WHOLE = 1e-9
"""Share of a base cycle that rounding may take from the last cycle of a run."""


@dataclass(eq=False)
class _Run:
    """A run under way: what it reads, the block that it advances, and what was read so far, call by call."""

    readings: Readings
    method: EventSettings
    recorder: Recorder
    first: tuple[int, int]  # samples of the first row of the history and of the snapshots
    block: Block
    grid: ReadingGrid
    # samples, energies, work of drives, fields and forces of snapshots, of each call
    parts: list[tuple[Array, Array, Array, Array, Array]] = field(default_factory=list)


def run_events(
    method: EventSettings,
    system: System,
    excitation: Excitation,
    duration: float,
    recorder: Recorder,
    initial: State,
    progress: Progress | None = None,
) -> MethodRun:
    """Event-driven motion of structure and balls, on a system that the method takes; see `integrate`."""
    asked, grid = recorder, reading_grid(system, excitation, method, duration, recorder)
    samples = whole_number_of(duration, grid.interval, "sample")
    channels, recorder = resolve_channels(system, recorder.channels), recorder.seen_from(initial.time)
    check_memory(system, recorder, len(channels), samples, grid.interval, excitation.frequency)
    begin = initial.time + 2.0 * (grid.interval * samples) / 3.0
    run = _new_run(system, excitation, method, channels, recorder, begin, initial, grid, samples)
    stream = Stream(read=partial(_history, run), clear=run.parts.clear, sink=recorder.sink)
    state_at, kept_state = sample_to_keep(grid, recorder, samples), None
    for done, end in pieces(grid, recorder, samples):
        _call(run, done, end - done)
        stream.hand_over()
        if end == state_at:
            kept_state = _state(run, end)
        if progress is not None:
            progress(end / samples)
    history = stream.left()
    # an event at the very end is found by this, and belongs to the tables
    final_state = _state(run, samples)
    block, tables, log, dropped = run.block, run.block.tables, None, list[str]()
    if tables.events.shape[1]:
        log = event_log(tables.events[0], int(tables.logged[0]), tuple(pair.name for pair in system.contacts))
        if log.dropped:
            dropped = [f"{log.dropped} events beyond the first {len(log)} are not in the log (Recorder.events)"]
    count, arguments = int(tables.number[0]), (system, excitation, method, duration, asked, initial)
    return MethodRun(
        history=history,
        final_state=final_state,
        cycles=cycles_of_table(block.grid.cycles.T),
        measured=float(run.grid.time(samples)) - begin,
        totals=peaks_of_forces(block.cases.totals[0], block.pairs.rigid),
        impacts=impacts_of(system, excitation, tables.impacts[: min(count, tables.impacts.shape[0])], count),
        sticking=_sticking(run),
        events=log,
        kept_state=kept_state,
        streamed_to=stream.streamed_to,
        going_on=contacts_in_progress(held_by(initial, system, excitation), system),
        warnings=() if history.energy is None else _balance_warnings(block, history.energy),
        notes=(*run.readings.notes, *_open_contacts(run), *dropped, *grid.chosen),
        largest=LargestValues(partial(find_largest, *arguments), partial(reread, *arguments)),
    )


def _new_run(
    system: System, excitation: Excitation, method: EventSettings, channels: tuple[Channel, ...], recorder: Recorder,
    begin: float, initial: State, grid: ReadingGrid, samples: int,
) -> _Run:  # fmt: skip
    """A run at its start, which is read."""
    drive = closed_drive(system, excitation)
    readings = Readings(system, excitation, drive, channels, springs_apart=True)
    outputs = outputs_of(system, system.point_row(system.default_place), readings.rows)
    block, grid = block_alone(
        system, excitation, drive, method, outputs, initial, grid, begin, recorder.ledger,
        recorder.impacts if system.contacts else 0, recorder.events,
    )  # fmt: skip
    block.grid = block.grid._replace(cycles=no_cycles(1, math.floor(samples / grid.per_cycle + WHOLE)))
    run = _Run(readings, method, recorder, first_steps(recorder, samples, grid.interval), block, grid)
    _read_start(run)
    return run


def _rows_kept(run: _Run, done: int, count: int) -> list[NDArray[np.int64]]:
    """Row of the history and of the snapshots that each sample of a piece fills, -1 for none."""
    number, rows = done + 1 + np.arange(count), list[NDArray[np.int64]]()
    for every, first in zip((run.recorder.every, run.recorder.snapshots), run.first, strict=True):
        due = (number >= first) & ((number - first) % max(every, 1) == 0) & (every > 0)
        rows.append(np.where(due, np.cumsum(due) - 1, -1))
    return rows


def _read_start(run: _Run) -> None:
    """Read the state at the start into the history: a piece of no length of which the beginning is read.

    All but the contact forces is taken from what was given: a start at rest is at rest to the last bit.
    """
    block, recorder, (outputs,) = run.block, run.recorder, run.block.store.outputs
    position, velocity = block.cases.coordinates[0].copy()
    has_row, has_snapshot = run.first[0] == 0, bool(recorder.snapshots) and run.first[1] == 0
    if not (has_row or has_snapshot):
        return
    _call(run, -1, 1, (0 if has_row else -1, 0 if has_snapshot else -1))
    block.cases.sample[0] = run.grid.first
    reading, of_motion = outputs.position @ position + outputs.rate @ velocity, ~np.any(outputs.force, axis=1)
    samples, energy, _, fields, _ = run.parts[0]
    samples[:, of_motion] = reading[of_motion]
    energy[:] = block.ledger.start if block.ledger is not None else 0.0
    fields[:] = np.array([position, velocity])


def _state(run: _Run, sample: int) -> State:
    """Where the run stands at the sample that it has reached, with all that another one needs to go on from there."""
    _call(run, sample - 1, 1, (-1, 0))
    # of a piece of no length
    coordinates, system = run.parts.pop()[3][0], run.readings.system
    cases, forms, n = run.block.cases, run.block.store.forms, system.dofs
    grid, f = replace(run.grid, first=run.grid.first + sample), cases.form[0, 1]
    motion = {
        "entry": cases.entry[0, : forms.entries[f]], "rigid_body": cases.rigid_body[0, :, : forms.rigid_bodies[f]],
        "clock": cases.clock[0], "drive": cases.drive[0],
    }  # fmt: skip
    contacts = (cases.state, cases.touch, cases.to_modes, cases.leaving)
    copies = {name: read_only(values) for name, values in motion.items()}
    held = Held(grid, copies, int(forms.driven[f]), *(read_only(values[0]) for values in contacts))
    places, rates = ((own(row[:n]), own(row[n:])) for row in coordinates)
    time, touching = float(grid.time(0)), contacts_in_progress(held, system)
    left = Continuation(KIND, held, places, rates, time, system, run.readings.excitation, touching)
    return State(places[0], rates[0], places[1], rates[1], time=time, continuation=left)


def _call(run: _Run, done: int, count: int, rows: tuple[int, int] | None = None) -> None:
    """Take the run some samples on, and gather what is read of them.

    With rows of the history and of the snapshots, -1 for none, one sample is read again: it counts in no statistics.
    """
    block, begin, cycles = run.block, run.grid.first + done, run.block.grid.cycles
    row_at, snapshot_at = _rows_kept(run, done, count) if rows is None else np.array(rows)[:, None]
    block.cases.sample[0] = begin
    energies, drives = int(row_at.max(initial=-1)) + 1 if run.recorder.ledger else 0, len(run.readings.drive.parts)
    block.grid = block.grid._replace(
        values=np.zeros((1, count, block.grid.values.shape[2])),
        cycles=cycles if rows is None else no_cycles(1, 0),
        kept=row_at,
        energy=np.zeros((1, energies, block.grid.energy.shape[2])),
        work_of=np.zeros((1, energies if drives else 0, drives + 1)),
    )
    pictures, pairs = int(snapshot_at.max(initial=-1)) + 1, block.pairs.rigid.size
    snapshots = zeros(
        core.events.Snapshots,
        {"f": pictures, "d": block.cases.coordinates.shape[2], "R": pairs},
        shown=snapshot_at if pictures else np.zeros(0, dtype=np.int64),
    )
    most = np.array([float(run.method.most_events) * max(count / block.grid.per_cycle, 1.0)])
    run_block(block, np.array([begin]), np.array([begin + count]), most, snapshots)
    grid = block.grid
    block.grid = grid._replace(cycles=cycles)
    if block.stopped[0] == core.events.UNENDING:
        # walls that hold the structure between them are another fault than too many events
        require_met(block.store.equations[0], np.flatnonzero(block.cases.released[0]))
        raise DivergenceError(unending(float(block.cases.clock[0, 0]), run.method))
    if not np.all(np.isfinite(grid.values)):
        raise DivergenceError(not_finite(f" before t = {float(run.grid.time(done + count)):.4g} s"))
    run.parts.append(
        (grid.values[0][row_at >= 0], grid.energy[0], grid.work_of[0], snapshots.fields, snapshots.forces)
    )  # fmt: skip


def peaks_of_forces(totals: Array, rigid: NDArray[np.bool_]) -> Array:
    """Sums of a window (6, pairs, ...) with no peak force where a rigid pair collided: an impulse has none."""
    totals = totals.copy()
    totals[PEAK_FORCE, rigid] = np.where(totals[COUNT, rigid] > 0.0, math.nan, totals[PEAK_FORCE, rigid])
    return totals


def not_finite(when: str) -> str:
    """Words for readings that are no numbers."""
    return f"the motion is not finite{when}: its closed form has lost all digits; Newmark takes this system"


# ---- results ---------------------------------------------------------------------------------------


def _history(run: _Run, samples_before: int, snapshots_before: int) -> HistoryPiece:
    """The history that was read since the last piece was handed over."""
    recorder, block, system, drives = run.recorder, run.block, run.readings.system, len(run.readings.drive.parts)
    pairs, n = block.pairs.rigid.size, block.cases.coordinates.shape[2]
    shapes = (block.grid.values.shape[2],), (block.grid.energy.shape[2],), (drives + 1,), (2, n), (pairs,)
    nothing = tuple(np.zeros((0, *shape)) for shape in shapes)
    samples, energy, work_of, fields, forces = map(np.concatenate, zip(nothing, *run.parts, strict=True))
    snapshots = None
    if recorder.snapshots:
        number = snapshots_before + np.arange(fields.shape[0])
        time = own(run.grid.time(run.first[1] + recorder.snapshots * number))
        u, v = ((system.expansion @ fields[:, k, : system.dofs].T).T for k in (0, 1))
        snapshots = snapshots_of(system, time, u, v, fields, forces)
    return run.readings.piece(
        own(run.grid.time(run.first[0] + recorder.every * (samples_before + np.arange(samples.shape[0])))),
        # at rest it is 0, not -0
        own(samples[:, 1:].T + 0.0),
        own(energy.T) if recorder.ledger else None,
        work_of,
        snapshots,
    )


def _balance_warnings(block: Block, energy: EnergyLedger) -> tuple[str, ...]:
    """A warning where the ledger's residual is above its bound, an error where it does not close at all."""
    rounding = 0.0 if block.ledger is None else float(block.ledger.rounding[0])
    # what was put in before the readings begin may be all, and rounding is that of it
    put_in = max(energy.largest_input, float(np.abs(energy.work).max()))
    residual = energy.residual * (energy.largest_input / put_in) if put_in > 0.0 else energy.residual
    bound = max(CLOSED, rounding / put_in) if put_in > 0.0 else CLOSED
    if not residual <= BALANCED:
        raise DivergenceError(unbalanced(residual))
    if residual <= bound:
        return ()
    return (
        f"energy residual {number_text(residual, 2)} of the energy put in, above {number_text(bound, 2)}: an "
        "event-driven run "
        "closes to rounding unless its modes span too many decades; keep fewer",
    )


def _sticking(run: _Run) -> StickingPhases:
    """Sticking phases that have ended, then those that last."""
    block, now = run.block, float(run.block.cases.clock[0, 0])
    rows = [tuple(row) for row in block.tables.sticking[: min(int(block.tables.number[1]), len(block.tables.sticking))]]
    for j in np.flatnonzero(block.pairs.rigid & (np.abs(block.cases.state[0]) == CONTACT)).tolist():
        impulse = float(block.cases.touch[0, core.events.PUSHED, j])
        rows.append((j, float(np.sign(block.cases.state[0, j])), _begun(block, j), math.nan, impulse))
    table = np.array(rows).reshape(-1, 5)
    lasting = np.where(np.isfinite(table[:, 3]), table[:, 3], now) - table[:, 2]
    return sticking_of(run.readings.system, np.column_stack([table, lasting]))


def _begun(block: Block, pair: int) -> float:
    """Start (s) of a sticking phase that lasts: the end of its bounces, or its capture where these are not over."""
    touch, now = block.cases.touch[0, :, pair], float(block.cases.clock[0, 0])
    return float(touch[core.events.BEGUN] if touch[core.events.BEGUN] <= now else now - touch[core.events.LASTED])


def _open_contacts(run: _Run) -> tuple[str, ...]:
    """Notes on what lasts at the end, and has no row in its table yet."""
    notes, state = [], run.block.cases.state[0]
    for j, pair in enumerate(run.readings.system.contacts):
        if state[j] == FREE:
            continue
        if run.block.pairs.rigid[j]:
            wall = "" if pair.between else f" to its {'+' if state[j] > 0 else '-'} wall"
            notes.append(f"{pair.name} sticks{wall} since t = {_begun(run.block, j):.4g} s")
        else:
            notes.append(
                f"{pair.name} is in contact at the end: that contact counts in forces and energies but is no finished "
                "impact"
            )
    return tuple(notes)
