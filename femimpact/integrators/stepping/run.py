"""Runs and dwells by a method with steps: blocks of cases side by side, and what they have kept."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array, own, read_only
from femimpact.contact.custom_law import ForcePointer, force_pointer, law_error, speed_note
from femimpact.contact.laws import RIGID
from femimpact.core.structs import zeros
from femimpact.errors import DivergenceError, require
from femimpact.excitation.drives import until
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.assembly import (
    MethodRun,
    Readings,
    cycles_of_table,
    impacts_of,
    snapshots_of,
    sticking_of,
    whole_number_of,
)
from femimpact.integrators.cases import (
    SineCases,
    SineDwellResults,
    check_memory,
    equal_groups,
    first_steps,
    in_blocks,
    kept_rows,
    modes_kept,
    start_of,
    with_contacts_of,
)
from femimpact.integrators.channel_rows import ChannelRows, Drive, drive_of
from femimpact.integrators.stepping.arrays import (
    Held,
    Inputs,
    cycles_of,
    inputs_alone,
    kind_of_steps,
    limits_of,
    motion_of,
    pairs_of,
)
from femimpact.integrators.stepping.operators import SteppingMethod, check_sampling, check_step, operator_of, scheme_of
from femimpact.progress import Progress
from femimpact.response.channels import resolve_channels
from femimpact.response.cycles import CycleStatistics, SteadyMotion, steady_motion
from femimpact.response.energy import BALANCED, EnergyLedger, energy_residual
from femimpact.response.history import HistoryPiece, Stream
from femimpact.response.impacts import ENERGY_COLUMNS, IMPACT_COLUMNS, PEAK_FORCE
from femimpact.response.response import Recorder
from femimpact.system.state import Continuation, State
from femimpact.system.system import System
from femimpact.units import number_text


def check_recorder(recorder: Recorder) -> None:
    """Raise `InputError` for what a method with steps lacks: an interval of readings beside its step, and events."""
    allowed = "is for EventDriven: a method with steps is read at its steps, of which `every` keeps one in so many"
    require(recorder.interval is None, "record.interval", recorder.interval, "s", allowed)
    allowed = "must be 0: a method with steps finds no events, whose log is for EventDriven"
    require(recorder.events == 0, "record.events", recorder.events, "", allowed)


def record_of(
    system: System, recorder: Recorder, rows: ChannelRows, inputs: Inputs, method: SteppingMethod, drive: Drive
) -> core.steps.Record:
    """Arrays for what a run alone keeps, refused before it when they would not fit."""
    dt, modes, (steps,), first = method.dt, modes_kept(system, recorder), inputs.steps, inputs.step
    # a recorded motion is spread over all fine steps before the first
    values = ((first + steps) * method.refine + 1) * (len(drive.loads) + len(drive.parts)) if drive.is_tabulated else 0
    # with the base's displacement and velocity, where stops are fixed in space
    values *= 3 if any(pair.fixed_to == "space" for pair in system.contacts) else 1
    check_memory(system, recorder, rows.constant.size, steps, dt, drive.omega / (2.0 * np.pi), drive=values)
    samples, snapshots = kept_rows(recorder, steps, dt)
    start, start_field = (first + number for number in first_steps(recorder, steps, dt))
    of_state = np.stack([rows.displacement, rows.velocity], axis=1)
    of_pairs = np.stack([rows.ball_displacement, rows.ball_velocity, rows.pair_force, rows.contact_force], axis=1)
    used = [np.any(of_state, axis=2), np.any(of_pairs[:, :2], axis=(1, 2)), np.any(of_pairs[:, 2:], axis=(1, 2))]
    lengths = {
        "h": rows.constant.size, "a": samples, "g": len(ENERGY_COLUMNS) + modes, "d": samples if recorder.ledger else 0,
        "D": len(drive.parts), "S": samples if recorder.ledger and drive.parts else 0, "j": snapshots, "n": system.dofs,
        "P": len(system.contacts), "q": recorder.impacts if system.contacts else 0, "u": len(IMPACT_COLUMNS) + modes,
    }  # fmt: skip
    return zeros(
        core.steps.Record,
        lengths,
        used=np.column_stack(used).astype(np.int64),
        rows=of_state,
        pair_rows=of_pairs,
        stride=np.array([recorder.every, start, max(recorder.snapshots, 1), start_field], dtype=np.int64),
        tally=np.array([first, 0, 0, 0], dtype=np.int64),
    )


STEPS_BETWEEN_CHECKS = 4_000_000
"""Mode-steps between two looks at progress, interrupts and divergence: some 10 ms of work."""


@dataclass(frozen=True, eq=False)
class Block:
    """Arrays of one compiled run, which the kernel writes into, and of what they were made."""

    stepped: core.steps.Stepped
    fine: core.steps.Fine | None
    inputs: Inputs
    limit: Array
    diverged: Array
    names: tuple[str, ...]
    # the C functions of the pairs' laws, which are kept alive here
    forces: tuple[ForcePointer | None, ...]

    @property
    def arrays(self) -> core.steps.Cases:
        """Those of the cases."""
        return self.stepped.cases

    @property
    def cycle_statistics(self) -> CycleStatistics:
        """Statistics of every base cycle of the real cases that was finished since the beginning."""
        values = self.arrays.cycles.values[self.inputs.cycle :, :, : len(self.inputs.excitations)]
        return cycles_of_table(np.moveaxis(values, 1, 0))


PACK = 8
"""Cases that the core takes side by side."""


def prepare(
    system: System,
    inputs: Inputs,
    method: SteppingMethod,
    *,
    observed: Array,  # (dofs,) row whose value gets cycle statistics
    ledger: bool,
    record: core.steps.Record | None = None,  # what case 0 keeps
) -> Block:
    """Lay out all arrays of a block; nothing runs yet."""
    cases = len(inputs.excitations)
    # the width of the case axis; idle lanes repeat the last case: finite numbers, no effect on the others
    lanes = 1 if cases == 1 else PACK * math.ceil(cases / PACK)
    columns: dict[str, Any] = {}
    for name in ("excitations", "steps", "window_start", "each"):
        of_cases = list(getattr(inputs, name))
        columns[name] = of_cases + of_cases[-1:] * (lanes - cases)
    padded = replace(inputs, **columns)
    drives = [drive_of(system, excitation) for excitation in padded.excitations]
    scheme = scheme_of(method)
    loads = drives[0].load, [load.load for load in drives[0].more]
    operator = operator_of(system, scheme, observed, *loads)
    fine = core.steps.Fine(1, operator, scheme) if scheme.rigid else None
    if method.refine > 1:
        fine_scheme = scheme_of(method, method.dt / method.refine)
        fine = core.steps.Fine(method.refine, operator_of(system, fine_scheme, observed, *loads), fine_scheme)
    functions = [pair.law.force_function(pair.effective_mass) for pair in system.contacts]
    forces = tuple(None if function is None else force_pointer(function) for function in functions)
    pairs = pairs_of(system, operator, drives[0], forces, padded)
    # only a history has losses mode by mode; in a sweep a case alone is summed as beside others
    modal = ledger and record is not None and lanes == 1 and not operator.banded
    if record is None:
        lengths = {"n": system.dofs, "P": len(functions), "g": len(ENERGY_COLUMNS), "u": len(IMPACT_COLUMNS)}
        nothing = dict.fromkeys("hadSDjq", 0)
        record = zeros(core.steps.Record, nothing | lengths, stride=np.ones(4, dtype=np.int64))
    motion = motion_of(system, operator, pairs, padded, drives, method, modal, record)
    cycles = cycles_of(padded, motion, method.dt, ledger)
    _go_on(inputs, motion, cycles)
    scratch = np.zeros((6, len(functions))), np.zeros(len(ENERGY_COLUMNS))
    arrays = core.steps.Cases(pairs, motion, cycles, record, *scratch)
    block = Block(
        stepped=core.steps.Stepped(operator, scheme, arrays, ledger),
        fine=fine,
        inputs=inputs,
        limit=limits_of(system, padded, drives, operator, motion, method),
        diverged=np.full(lanes, np.inf),
        names=tuple(pair.name for pair in system.contacts),
        forces=forces,
    )
    if ledger:
        core.write_energies(block.stepped)
        check_laws(block)
    return block


def _go_on(inputs: Inputs, motion: core.steps.Motion, cycles: core.steps.Cycles) -> None:
    """Set motion and cycles to what the run has reached that this one goes on from."""
    held = inputs.held
    if held is None:
        return
    if held.to_modes.shape == motion.to_modes.shape:
        motion.to_modes[...] = held.to_modes
    else:
        # it was not summed before
        motion.to_modes[held.motion["touch"][core.steps.OPEN, :, 0] != 0.0] = np.nan
    if not inputs.complete:
        return
    for arrays, target in ((held.motion, motion), (held.cycles, cycles)):
        for name, values in arrays.items():
            getattr(target, name)[...] = values


def check_laws(block: Block) -> None:
    """Raise what a custom law has raised, or that its force was no finite number."""
    refused = block.arrays.pairs.refused
    for j in np.flatnonzero(refused[:, 0]):
        force = block.forces[j]
        if force is not None:
            raise law_error(block.names[j], force, *refused[j].tolist())


def run_block(
    block: Block,
    progress: Progress | None = None,  # called with the share of the steps that is done, 0 to 1
    ends: Sequence[int] | None = None,  # steps from here on at which the cases end; by default those of the inputs
) -> None:
    """Take a block to the ends of its cases; between pieces come progress, interrupts and the check for divergence."""
    motion, of_cases = block.arrays.motion, np.array(block.inputs.steps if ends is None else ends)
    piece, done, last = max(1000, STEPS_BETWEEN_CHECKS // motion.q.size), 0, int(of_cases.max())
    while done < last:
        # pieces end where cases end, so that what comes after does not count
        steps = min(piece, int(of_cases[of_cases > done].min()) - done)
        core.advance(steps, block.stepped, block.fine)
        check_laws(block)
        done += steps
        with np.errstate(invalid="ignore"):
            out = ~(np.abs(motion.w[0]) <= block.limit) & np.isinf(block.diverged)
        out[: of_cases.size] &= of_cases >= done
        block.diverged[out] = done * block.stepped.scheme.dt
        if bool(np.all(np.isfinite(block.diverged[: of_cases.size]))):
            return
        if progress is not None:
            progress(done / last)


MOTION = ("q", "v", "a", "w", "w_rate", "ball", "touch", "drive")
CYCLES = ("next_wrap", "number", "sums", "last")
"""What a run that goes on takes over of the motion and of the statistics of cycles."""


def state_of(block: Block, system: System, excitation: Excitation, method: SteppingMethod) -> State:
    """Where a run of one case stands at its last step, with all that the same method needs to go on."""
    inputs, arrays, motion = block.inputs, block.arrays, block.arrays.motion
    step = int(arrays.record.tally[0])
    held = Held(
        origin=inputs.origin,
        step=step,
        motion={name: read_only(getattr(motion, name)) for name in MOTION},
        cycles={name: read_only(getattr(arrays.cycles, name)) for name in CYCLES},
        gaps=read_only(arrays.pairs.constants[[core.steps.GAP_PLUS, core.steps.GAP_MINUS]]),
        to_modes=read_only(motion.to_modes),
    )
    balls, time = len(system.balls), inputs.origin + step * method.dt
    places, rates = (
        (own(of_dofs[:, 0]), own(motion.ball[row, :balls, 0]))
        for of_dofs, row in ((motion.q, core.steps.Y), (motion.v, core.steps.Y_RATE))
    )
    touching = held.contacts_in_progress(system)
    left = Continuation(kind_of_steps(method), held, places, rates, time, system, excitation, touching)
    return State(places[0], rates[0], places[1], rates[1], time=time, continuation=left)


def history_of(
    block: Block,
    readings: Readings,
    refilled: bool,  # whether the arrays of the record are filled again once they were read
    samples_before: int,  # what was taken out of the record earlier
    snapshots_before: int,
) -> HistoryPiece:
    """All samples and snapshots that the record of a block holds now."""
    record, dt, origin, system = block.arrays.record, block.stepped.scheme.dt, block.inputs.origin, readings.system
    samples, count = int(record.tally[1]), int(record.tally[2])
    every, first, stride, first_field = (int(value) for value in record.stride)
    # a copy of 20 histories of a run costs more than its steps
    read_only = own if refilled else _view
    snapshots = None
    if record.snapshots.shape[0] > 0:
        time = own(origin + (first_field + stride * (snapshots_before + np.arange(count))) * dt)
        fields = record.snapshots[:count]
        # one by one: a product with many columns rounds as their number has it, and pieces must not show
        at_nodes = [[system.expansion @ row for row in fields[:, k, : system.dofs]] for k in (0, 1)]
        u, v = np.array(at_nodes).reshape(2, count, system.expansion.shape[0])
        snapshots = snapshots_of(system, time, u, v, fields, record.forces[:count])
    return readings.piece(
        own(origin + (first + every * (samples_before + np.arange(samples))) * dt),
        read_only(record.channels[:, :samples]),
        read_only(record.energy[:, :samples]) if block.stepped.ledger else None,
        record.work_of[:, :samples].T,
        snapshots,
    )


def impact_rows(block: Block) -> Array:
    """Rows of the table of impacts, as far as it was kept."""
    rows = block.arrays.record.impacts[: int(block.arrays.record.tally[3])].copy()
    rows[:, 0] += block.inputs.origin
    return rows


def sticking_rows(block: Block) -> Array:
    """Rows of `sticking_of`, of rigid contacts that took an impulse in three or more steps in a row.

    A ball then moves with its wall. Each begins with an impact, which has a row in the table of impacts once the
    contact has ended; the impulses of the two tables are the same.
    """
    arrays, origin = block.arrays, block.inputs.origin
    touch, ended = arrays.motion.touch[:, :, 0], arrays.record.impacts[: int(arrays.record.tally[3])]
    start, duration = ended[:, 0], ended[:, 7]
    rows = np.column_stack([ended[:, 1:3], origin + start, origin + (start + duration), ended[:, 5], duration])
    open_pairs = np.flatnonzero(touch[core.steps.OPEN])
    of_pairs = touch[:, open_pairs].T
    lasting = [
        (j, of[core.steps.SIDE], origin + of[core.steps.START], np.nan, *of[[core.steps.IMPULSE, core.steps.DURATION]])
        for j, of in zip(open_pairs, of_pairs, strict=True)
    ]
    rows = np.vstack([rows, np.array(lasting).reshape(-1, 6)])
    is_rigid = arrays.pairs.kind[rows[:, 0].astype(int)] == RIGID
    return np.asarray(rows[is_rigid & (rows[:, 5] > 1.5 * block.stepped.scheme.dt)])


def open_contacts(block: Block, system: System) -> tuple[str, ...]:
    """Notes on balls that touch at the end: their contact is in the forces, not in the table of impacts."""
    touch = block.arrays.motion.touch[:, :, 0]
    return tuple(
        f"{pair.name} is in contact at the end, under force for {touch[core.steps.DURATION, j]:.3g} s of it: that "
        "contact counts in forces and energies but is no finished impact"
        for j, pair in enumerate(system.contacts)
        if touch[core.steps.OPEN, j] != 0.0
    )


def _view(array: Array) -> Array:
    """A view that cannot be written to."""
    view = array.view()
    view.setflags(write=False)
    return view


def run_steps(
    method: SteppingMethod,
    system: System,
    excitation: Excitation,
    duration: float,
    recorder: Recorder,
    initial: State,
    progress: Progress | None = None,
) -> MethodRun:
    """Stepped motion of structure and balls, with a step that resolves contact and drive; see `integrate`."""
    check_recorder(recorder)
    steps = whole_number_of(duration, method.dt, "step")
    # the sines of a sum go on behind the last step, which may be half a step after the end
    excitation = until(excitation, initial.time + duration + 2.0 * method.dt)
    channels, drive = resolve_channels(system, recorder.channels), drive_of(system, excitation)
    readings = Readings(system, excitation, drive, channels, springs_apart=False)
    inputs, recorder = inputs_alone(system, excitation, steps, initial, method), recorder.seen_from(initial.time)
    record = record_of(system, recorder, readings.rows, inputs, method, drive)
    observed = system.point_row(system.default_place)
    block = prepare(system, inputs, method, observed=observed, ledger=recorder.ledger, record=record)
    motion = block.arrays.motion
    if record.channels.shape[1] + record.snapshots.shape[0] > 0:
        core.keep_present(block.stepped)
        check_laws(block)
    stream = Stream(
        read=partial(history_of, block, readings, recorder.sink is not None),
        clear=partial(record.tally[1:3].fill, 0),
        sink=recorder.sink,
    )
    # step after the beginning at which the state is kept, if there is one
    step_to_keep = 0 if recorder.state_at is None else round(min(recorder.state_at / method.dt, 2.0 * steps))
    steps_to_keep, kept_state = (step_to_keep,) if 0 < step_to_keep <= steps else (), None
    # a piece for the sink has as many samples, that at the start counted
    piece = steps + 1 if recorder.sink is None else recorder.piece_samples * recorder.every
    ends = heapq.merge(range(piece - 1, steps, piece), [steps], steps_to_keep)
    for step in _run(block, ends, excitation, method, progress):
        stream.hand_over()
        if step in steps_to_keep:
            kept_state = state_of(block, system, excitation, method)
    history, totals = stream.left(), motion.totals[:, :, 0]
    # an impulse has no peak
    totals[PEAK_FORCE, block.arrays.pairs.kind == RIGID] = np.nan
    named = zip(block.names, block.forces, strict=True)
    of_laws = [speed_note(name, force) for name, force in named if force is not None]
    return MethodRun(
        history=history,
        final_state=state_of(block, system, excitation, method),
        cycles=block.cycle_statistics,
        measured=float(motion.window[1, 0] - motion.window[0, 0]) * method.dt,
        totals=totals,
        impacts=impacts_of(system, excitation, impact_rows(block), int(record.tally[3])),
        sticking=sticking_of(system, sticking_rows(block)),
        kept_state=kept_state,
        streamed_to=stream.streamed_to,
        going_on=() if inputs.held is None else inputs.held.contacts_in_progress(system),
        warnings=_residual_warnings(history.energy, recorder.residual_limit),
        notes=(*filter(None, of_laws), *open_contacts(block, system), *readings.notes),
    )


def divergence_message(frequency: float, time: float, method: SteppingMethod) -> str:
    """Words for a run that grew without bound, and what to do."""
    return (
        f"the motion at {frequency:g} Hz is not finite or grew without bound before t = {time:.4g} s with "
        f"dt = {number_text(method.dt, 3)} s: take a smaller dt (recommended_step gives one), a contact law with "
        "damping, "
        f"or raise divergence_limit ({method.divergence_limit:g})"
    )


def _run(
    block: Block,
    ends: Iterable[int],
    excitation: Excitation,
    method: SteppingMethod,
    progress: Progress | None,
) -> Iterator[int]:
    """Run a block to its end; yields each of some ascending steps when it is reached."""
    done, steps = 0, block.inputs.steps[0]
    for end in ends:
        if end > done:
            share = None if progress is None else partial(_tell, progress, done, end, steps)
            run_block(block, share, [end - done])
        if np.isfinite(block.diverged[0]):
            begun = block.inputs.origin + block.inputs.step * method.dt
            time = begun + done * method.dt + float(block.diverged[0])
            raise DivergenceError(divergence_message(excitation.frequency, time, method))
        done = end
        yield end


def _tell(progress: Progress, begin: int, end: int, steps: int, share: float) -> None:
    """Tell the share of a run's steps that is done, by that of some of them."""
    progress((begin + share * (end - begin)) / steps)


def _residual_warnings(energy: EnergyLedger | None, limit: float) -> tuple[str, ...]:
    if energy is None or energy.residual <= limit:
        return ()
    return (
        f"energy residual {number_text(energy.residual, 2)} exceeds {limit:g}: the method or the contact law makes or "
        "loses energy that the ledger cannot name; take a smaller dt, or raise Recorder.residual_limit",
    )


WIDEST_BLOCK = 64
"""Cases side by side beyond which a block no longer gains speed but leaves the cache."""

MOST_STEPS = 1e15
"""Most steps of a dwell: more are a mistake, and do not fit in an integer of the loop."""

ALIKE = 1.05
"""Longest over shortest run up to which cases count as equally long."""


def stepped_cases(
    method: SteppingMethod, system: System, cases: SineCases, observed: Array, instants: int, workers: int,
    progress: Progress | None = None,
) -> SineDwellResults:  # fmt: skip
    """Results of cases by a method with steps, side by side in blocks.

    Those of a block have one system, and differ in more than their sine only where laws have compiled branches and no
    start is static. The ledger is read at the ends of cycles.
    """
    check_sampling(method, cases.frequency, "frequencies")
    sets = np.unique(np.column_stack([cases.law_of, cases.numbers_of_systems]), axis=0, return_index=True)[1]
    of_step = [check_step(method, with_contacts_of(cases.system(case, system), cases, case)) for case in sets.tolist()]
    warnings = tuple(dict.fromkeys(text for texts in of_step for text in texts))
    f, dt = cases.frequency, method.dt
    steps = float(np.max(cases.cycles / f)) / dt
    require(steps <= MOST_STEPS, "frequencies", float(f.min()), "Hz", f"must take at most {MOST_STEPS:g} steps")
    ends = np.ceil(cases.cycles / (f * dt)).astype(int)
    together = not cases.systems and _may_differ(system, cases)
    groups = [np.arange(f.size)] if together else equal_groups(cases)

    def run(members: NDArray[np.intp], share: Progress | None) -> SineDwellResults:
        # laid out when its turn comes: of many blocks only those at work are in memory
        part = cases.of(members)
        block = _block_of(system, part, method, observed, ends[members], instants > 0)
        run_block(block, share)
        return replace(_results(block, part, method), warnings=warnings)

    blocks = [group[members] for group in groups for members in _blocks(ends[group], workers)]
    return in_blocks(run, blocks, workers, progress)


def _may_differ(system: System, cases: SineCases) -> bool:
    """True if no start follows from statics, and no law is a function: gaps, laws and starts of a block may differ."""
    static = cases.initial.is_static_on(system) or bool(np.any(cases.gaps < 0.0))
    pairs = [(law, pair) for laws in cases.laws for law, pair in zip(laws, system.contacts, strict=True)]
    return not static and all(law.force_function(pair.effective_mass) is None for law, pair in pairs)


def _blocks(ends: NDArray[np.int64], workers: int) -> list[NDArray[np.intp]]:
    """Cases of like length together; as many blocks as workers, none wider than the cache holds."""
    count = max(min(workers, ends.size // 2), math.ceil(ends.size / WIDEST_BLOCK), 1)
    if ends.max() <= ALIKE * ends.min():
        # neighbours in frequency have much or little contact: distributed in turn, every block gets its share
        return [np.arange(first, ends.size, count) for first in range(count)]
    return [members for members in np.array_split(np.argsort(-ends, kind="stable"), count) if members.size]


def _block_of(
    system: System, cases: SineCases, method: SteppingMethod, observed: Array, ends: NDArray[np.int64], ledger: bool
) -> Block:
    """A block of cases at its start."""
    numbers = (values.tolist() for values in (cases.amplitude, cases.frequency, cases.phase))
    sines = [Sine(*of_case) for of_case in zip(*numbers, strict=True)]
    begins = np.ceil((cases.cycles - cases.measured) / (cases.frequency * method.dt)).astype(int)
    common, initial, starts = cases.system(0, system), cases.initial, []
    if len(equal_groups(cases)) == 1:
        common, initial = with_contacts_of(common, cases, 0), start_of(cases, 0)
    else:
        starts = [(with_contacts_of(common, cases, case), start_of(cases, case)) for case in range(ends.size)]
    inputs = Inputs(sines, ends.tolist(), begins.tolist(), initial, each=starts)
    return prepare(common, inputs, method, observed=cases.row(0, observed), ledger=ledger)


def _results(block: Block, cases: SineCases, method: SteppingMethod) -> SineDwellResults:
    """Results of the cases of a block that has run."""
    count, motion = cases.frequency.size, block.arrays.motion
    totals, diverged = motion.totals[:, :, :count].copy(), block.diverged[:count].tolist()
    # an impulse has no peak
    totals[PEAK_FORCE, block.arrays.pairs.kind == RIGID] = np.nan
    return SineDwellResults(
        motion=_motion(block, cases.cycles, cases.measured),
        totals=totals,
        duration=np.diff(motion.window[:, :count], axis=0)[0] * method.dt,
        residual=_residuals(block, cases.cycles) if block.stepped.ledger else np.full(count, np.nan),
        bound=np.full(count, BALANCED),
        failures=tuple(
            divergence_message(frequency, time, method) if math.isfinite(time) else ""
            for frequency, time in zip(cases.frequency.tolist(), diverged, strict=True)
        ),
    )


def _motion(block: Block, cycles: NDArray[np.int64], measured: NDArray[np.int64]) -> SteadyMotion:
    # slower cases of the block run on beyond their dwell: leave those cycles out
    statistics = block.cycle_statistics
    of_dwell = np.arange(statistics.samples.shape[0])[:, None] < cycles
    return steady_motion(replace(statistics, samples=np.where(of_dwell, statistics.samples, 0.0)), measured)


def _residuals(block: Block, cycles: NDArray[np.int64]) -> Array:
    energy = block.arrays.cycles.energy[:, :, : cycles.size]
    # slower cases run on beyond their dwell: its last row stands for those after it
    row = np.minimum(np.arange(energy.shape[0])[:, None, None], cycles)
    kinetic, strain, ball, contact, work, structure_loss, contact_loss = np.moveaxis(
        np.take_along_axis(energy, row, axis=0), 1, 0
    )
    with np.errstate(invalid="ignore", over="ignore"):
        residual = energy_residual(kinetic + strain + ball + contact, work, structure_loss + contact_loss)
        return np.asarray(np.max(np.abs(residual), axis=0))
