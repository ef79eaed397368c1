"""Many dwells by a method with steps: blocks of cases side by side, each with separate numbers and start."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.contact.custom_law import speed_note
from femimpact.contact.laws import RIGID
from femimpact.errors import DivergenceError, changed, in_range, made, quantity, require
from femimpact.excitation import Excitation, Sine
from femimpact.excitation.drives import until
from femimpact.integrators.cases import (
    SineCases,
    SineDwellResults,
    equal_groups,
    run_each,
    start_of,
    with_contacts_of,
)
from femimpact.integrators.channel_rows import channel_rows, drive_of, mode_notes
from femimpact.integrators.stepping.arrays import Inputs
from femimpact.integrators.stepping.block import (
    Block,
    Recorded,
    check_laws,
    check_recorder,
    history_of,
    impacts_of,
    open_contacts,
    piece_ends,
    prepare,
    record_of,
    run_block,
    sticking_of,
)
from femimpact.integrators.stepping.continued import beginning_of, final_state
from femimpact.integrators.stepping.operators import SteppingMethod, check_sampling, check_step, step_notes
from femimpact.progress import Progress
from femimpact.response.channels import Channel, resolve_channels
from femimpact.response.energy import BALANCED, energy_residual
from femimpact.response.history import HistoryPiece, Stream
from femimpact.response.impacts import impact_statistics
from femimpact.response.response import Recorder, Response
from femimpact.response.signals import (
    Largest,
    LargestSample,
    LargestValues,
    SteadyMotion,
    no_steady_motion,
    steady_motion,
)
from femimpact.system.reduction import truncation_notes
from femimpact.system.state import State, begun_anew
from femimpact.system.system import System
from femimpact.units import number_text

PIECE = 10_000
"""Steps in memory at once."""

NO_LIMIT = 1e30
"""Bytes: a piece is all that is kept."""


def find_largest(
    run: Callable[[Recorder], Any],  # the run, with what it is to keep: its steps have the same bits whatever that is
    recorder: Recorder,  # of the run before
    notes: Callable[[tuple[Channel, ...]], tuple[str, ...]],  # on channels
    channels: tuple[Channel, ...],
) -> tuple[Largest, ...]:
    """Largest values of channels over all steps of a run."""
    found = [LargestSample() for _ in channels]

    def take(piece: HistoryPiece) -> None:
        for one, channel in zip(found, channels, strict=True):
            one.add(piece.channels[channel.name], piece.time)

    every_step = replace(
        recorder, channels=channels, every=1, start=0.0, snapshots=0, state_at=None, impacts=0, ledger=False,
        memory_limit=NO_LIMIT, sink=take, piece_samples=PIECE,
    )  # fmt: skip
    run(every_step)
    return tuple(
        Largest(one.value, one.time or 0.0, channel.unit, notes((channel,)))
        for one, channel in zip(found, channels, strict=True)
    )


def reread(
    run: Callable[[Recorder], Any],  # as of `find_largest`
    recorder: Recorder,
    channels: tuple[Channel, ...],
    start: float,  # s: from when on
    _: float,  # s: a run with steps is read at them
) -> tuple[Array, dict[str, Array]]:
    """Times (s) and values of channels at all steps of a run from a time on."""
    every_step = replace(
        recorder, channels=channels, every=1, start=start, snapshots=0, state_at=None, impacts=0, ledger=False,
        memory_limit=NO_LIMIT, sink=None,
    )  # fmt: skip
    found = run(every_step)
    return found.time, dict(found.channels)


def run_steps(
    system: System,
    excitation: Excitation,
    method: SteppingMethod,
    duration: float,
    recorder: Recorder,
    initial: State,
    progress: Progress | None = None,
) -> Response:
    """Stepped motion of structure and balls; see `integrate`.

    Raises `InputError` if the step does not resolve the contact, the run would keep too much, or an argument is out
    of range.

    Raises `DivergenceError` if the motion is not finite or grows without bound.
    """
    check_recorder(recorder)
    fits = in_range(duration, quantity("s", at_least=method.dt))
    require(fits, "duration", duration, "s", f"must be a finite number >= one step, {method.dt:g} s")
    check_sampling(np.array([excitation.frequency]), method, "frequency")
    warnings, again = check_step(system, method), partial(_again, system, excitation, method, duration, initial)
    steps = round(duration / method.dt)
    # the sines of a sum go on behind the last step, which may be half a step after the end
    excitation = until(excitation, initial.time + duration + 2.0 * method.dt)
    channels, drive = resolve_channels(system, recorder.channels), drive_of(system, excitation)
    rows = channel_rows(system, drive, channels, springs_apart=False)
    largest = LargestValues(
        partial(find_largest, again, recorder, partial(mode_notes, system, drive)), partial(reread, again, recorder)
    )
    beginning, recorder = beginning_of(initial, system, excitation, method), recorder.seen_from(initial.time)
    block = prepare(
        system,
        Inputs([excitation], [steps], [2 * steps // 3], initial, beginning),
        method,
        observed=system.point_row(system.default_place),
        ledger=recorder.ledger,
        record=record_of(system, recorder, rows, steps, method, drive, beginning.step),
    )
    _keep_first(block)
    stream = Stream(
        read=partial(history_of, block, system, Recorded(excitation, drive, channels, rows, recorder.sink is not None)),
        clear=partial(block.record.tally[1:3].fill, 0),
        sink=recorder.sink,
    )
    kept, kept_state = _step_to_keep(recorder, steps, method), None
    for step in _run(block, heapq.merge(piece_ends(recorder, steps), kept), excitation, method, progress):
        stream.hand_over()
        if step in kept:
            kept_state = _state(block, system, excitation, method)
    response = _response(block, system, excitation, method, recorder, initial, stream, warnings)
    notes = (*response.notes, *mode_notes(system, drive, channels))
    return changed(response, notes=notes, kept_state=kept_state, largest_values=largest)


def _again(
    system: System, excitation: Excitation, method: SteppingMethod, duration: float, initial: State, recorder: Recorder
) -> Response:  # fmt: skip
    """The same run with another recorder."""
    return run_steps(system, excitation, method, duration, recorder, initial)


def divergence_message(frequency: float, time: float, method: SteppingMethod) -> str:
    """Words for a run that grew without bound, and what to do."""
    return (
        f"the motion at {frequency:g} Hz is not finite or grew without bound before t = {time:.4g} s with "
        f"dt = {number_text(method.dt, 3)} s: take a smaller dt (recommended_step gives one), a contact law with "
        "damping, "
        f"or raise divergence_limit ({method.divergence_limit:g})"
    )


def _keep_first(block: Block) -> None:
    """Keep the state at the start where it is asked for."""
    if block.record.channels.shape[1] + block.record.snapshots.shape[0] > 0:
        core.keep_present(block.handed())
        check_laws(block)


def _run(
    block: Block,
    ends: Iterable[int],
    excitation: Excitation,
    method: SteppingMethod,
    progress: Progress | None,
) -> Iterator[int]:
    """Run a block to its end; yields each of some ascending steps when it is reached."""
    done = 0
    for end in ends:
        if end > done:
            share = None if progress is None else _share_of(progress, done, end, block.steps)
            run_block(replace(block, steps=end - done, ends=np.array([end - done])), share)
        if np.isfinite(block.diverged[0]):
            begun = block.beginning.origin + block.beginning.step * method.dt
            time = begun + done * method.dt + float(block.diverged[0])
            raise DivergenceError(divergence_message(excitation.frequency, time, method))
        done = end
        yield end


def _step_to_keep(recorder: Recorder, steps: int, method: SteppingMethod) -> tuple[int, ...]:
    """Step after the beginning at which the state is kept, if there is one."""
    step = 0 if recorder.state_at is None else round(min(recorder.state_at / method.dt, 2.0 * steps))
    return (step,) if 0 < step <= steps else ()


def _state(block: Block, system: System, excitation: Excitation, method: SteppingMethod) -> State:
    """State of the cases of a block at its last step."""
    step = int(block.record.tally[0])
    return final_state(system, excitation, method, block.beginning, step, block.pairs, block.motion, block.cycles)


def _share_of(progress: Progress, done: int, end: int, steps: int) -> Progress:
    """Progress of the run, told by the share of the steps from `done` to `end`."""
    return lambda share: progress((done + share * (end - done)) / steps)


def _response(
    block: Block,
    system: System,
    excitation: Excitation,
    method: SteppingMethod,
    recorder: Recorder,
    initial: State,
    stream: Stream,
    warnings: tuple[str, ...],
) -> Response:
    laws = ", ".join(dict.fromkeys(pair.law.name for pair in system.contacts)) or "none"
    window = float(block.motion.window[1, 0] - block.motion.window[0, 0]) * method.dt
    totals = block.motion.totals[:, :, 0]
    # an impulse has no peak
    totals[4, block.pairs.kind == RIGID] = np.nan
    impacts = impacts_of(block, system, excitation)
    left = stream.left()
    if impacts.dropped:
        lost = f"{impacts.dropped} impacts beyond the first {recorder.impacts} are not in the table (Recorder.impacts)"
        warnings = (*warnings, lost)
    if left.energy is not None and not left.energy.residual <= recorder.residual_limit:
        warnings = (*warnings, _residual_warning(left.energy.residual, recorder.residual_limit))
    cycles = block.cycle_statistics
    finished = int(np.count_nonzero(cycles.samples[:, 0]))
    return made(
        Response,
        time=left.time,
        channels=left.channels,
        units=left.units,
        impacts=impacts,
        sticking=sticking_of(block, system),
        statistics=impact_statistics(totals, window, excitation.frequency, laws),
        statistics_of={
            pair.name: impact_statistics(totals[:, j : j + 1], window, excitation.frequency, pair.law.name)
            for j, pair in enumerate(system.contacts)
        },
        steady=steady_motion(cycles, np.array([max(finished // 3, 1)])) if finished else no_steady_motion(),
        energy=left.energy,
        snapshots=left.snapshots,
        base=excitation,
        system=system,
        warnings=warnings,
        notes=(
            *begun_anew(initial.continuation, block.beginning.going_on(system)),
            *step_notes(system, method),
            *truncation_notes(system),
            *_law_notes(block),
            *open_contacts(block, system),
        ),
        streamed_to=stream.streamed_to,
        start=initial.time,
        final_state=_state(block, system, excitation, method),
    )


def _law_notes(block: Block) -> tuple[str, ...]:
    """Notes on laws that are called as functions of Python."""
    pairs = zip(block.names, block.forces, strict=True)
    notes = [speed_note(name, force) for name, force in pairs if force is not None]
    return tuple(note for note in notes if note)


def _residual_warning(residual: float, limit: float) -> str:
    return (
        f"energy residual {number_text(residual, 2)} exceeds {limit:g}: the method or the contact law makes or loses "
        "energy that "
        "the ledger cannot name; take a smaller dt, or raise Recorder.residual_limit"
    )


WIDEST_BLOCK = 64
"""Cases side by side beyond which a block no longer gains speed but leaves the cache."""

MOST_STEPS = 1e15
"""Most steps of a dwell: more are a mistake, and do not fit in an integer of the loop."""

ALIKE = 1.05
"""Longest over shortest run up to which cases count as equally long."""


def stepped_cases(
    system: System, cases: SineCases, method: SteppingMethod, observed: Array, instants: int, workers: int,
    progress: Progress | None,
) -> SineDwellResults:  # fmt: skip
    """Results of cases by a method with steps, side by side in blocks; see `runs.run_cases`.

    Where gaps, laws or starts differ, the laws are of the kinds of the system's, with compiled branches, and no start
    is static. The ledger is read at the ends of cycles.
    """
    check_sampling(cases.frequency, method, "frequencies")
    first = [int(np.argmax(cases.law_of == number)) for number in np.unique(cases.law_of)]
    warnings = [text for case in first for text in check_step(with_contacts_of(system, cases, case), method)]
    f, ledger, equal = cases.frequency, instants > 0, len(equal_groups(cases)) == 1
    common, initial = (with_contacts_of(system, cases, 0), start_of(cases, 0)) if equal else (system, cases.initial)
    steps = float(np.max(cases.cycles / f)) / method.dt
    require(steps <= MOST_STEPS, "frequencies", float(f.min()), "Hz", f"must take at most {MOST_STEPS:g} steps")
    ends = np.ceil(cases.cycles / (f * method.dt)).astype(int)
    begins = np.ceil((cases.cycles - cases.measured) / (f * method.dt)).astype(int)
    motion: dict[str, NDArray[Any]] = {item.name: np.full(f.size, np.nan) for item in fields(SteadyMotion)}
    motion["steadiness"] = np.full(f.size, "transient", dtype="<U11")
    totals = np.full((6, len(system.contacts), f.size), np.nan)
    duration, residual, diverged = np.full((3, f.size), np.nan)

    def run(members: NDArray[np.intp], share: Progress | None) -> None:
        # laid out when its turn comes: of many blocks only those at work are in memory
        numbers = (values[members].tolist() for values in (cases.amplitude, f, cases.phase))
        sines = [Sine(*given) for given in zip(*numbers, strict=True)]
        each = [] if equal else [(with_contacts_of(system, cases, c), start_of(cases, c)) for c in members.tolist()]
        inputs = Inputs(sines, ends[members].tolist(), begins[members].tolist(), initial, each=each)
        block = prepare(common, inputs, method, observed=observed, ledger=ledger)
        run_block(block, share)
        diverged[members] = block.diverged[: members.size]
        found = _motion(block, cases.cycles[members], cases.measured[members])
        for name, column in motion.items():
            column[members] = getattr(found, name)
        totals[:, :, members] = block.motion.totals[:, : len(system.contacts), : members.size]
        duration[members] = np.diff(block.motion.window[:, : members.size], axis=0)[0] * method.dt
        if ledger:
            residual[members] = _residuals(block, cases.cycles[members])

    run_each(run, _blocks(ends, workers), workers, progress)
    # an impulse has no peak
    totals[4, [pair.parameters.kind == RIGID for pair in system.contacts]] = np.nan
    failures = tuple(
        divergence_message(float(frequency), float(time), method) if math.isfinite(time) else ""
        for frequency, time in zip(f, diverged, strict=True)
    )
    bound, told = np.full(f.size, BALANCED), tuple(dict.fromkeys(warnings))
    return SineDwellResults(SteadyMotion(**motion), totals, duration, residual, bound, failures, told)


def _blocks(ends: NDArray[np.int64], workers: int) -> list[NDArray[np.intp]]:
    """Cases of like length together; as many blocks as workers, none wider than the cache holds."""
    count = max(min(workers, ends.size // 2), math.ceil(ends.size / WIDEST_BLOCK), 1)
    if ends.max() <= ALIKE * ends.min():
        # neighbours in frequency have much or little contact: distributed in turn, every block gets its share
        return [np.arange(first, ends.size, count) for first in range(count)]
    return [members for members in np.array_split(np.argsort(-ends, kind="stable"), count) if members.size]


def _motion(block: Block, cycles: NDArray[np.int64], measured: NDArray[np.int64]) -> SteadyMotion:
    # slower cases of the block run on beyond their dwell: leave those cycles out
    statistics = block.cycle_statistics
    of_dwell = np.arange(statistics.samples.shape[0])[:, None] < cycles
    return steady_motion(replace(statistics, samples=np.where(of_dwell, statistics.samples, 0.0)), measured)


def _residuals(block: Block, cycles: NDArray[np.int64]) -> Array:
    energy = block.cycles.energy[:, :, : block.cases]
    # slower cases run on beyond their dwell: its last row stands for those after it
    row = np.minimum(np.arange(energy.shape[0])[:, None, None], cycles)
    kinetic, strain, ball, contact, work, structure_loss, contact_loss = np.moveaxis(
        np.take_along_axis(energy, row, axis=0), 1, 0
    )
    with np.errstate(invalid="ignore", over="ignore"):
        residual = energy_residual(kinetic + strain + ball + contact, work, structure_loss + contact_loss)
        return np.asarray(np.max(np.abs(residual), axis=0))
