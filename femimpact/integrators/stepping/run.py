"""One stepped run: from a system and an excitation to its response."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from femimpact import core
from femimpact.contact.callback import speed_note
from femimpact.contact.formulas import RIGID
from femimpact.errors import DivergenceError, in_range, quantity, require
from femimpact.excitation import Excitation, PointForce, Sum
from femimpact.integrators.channel_rows import channel_rows, reaction_notes
from femimpact.integrators.driving import drive_of
from femimpact.integrators.stepping.block import Block, Inputs, check_laws, prepare, run_block
from femimpact.integrators.stepping.continued import beginning_of, final_state
from femimpact.integrators.stepping.largest import find_largest
from femimpact.integrators.stepping.reading import Recorded, history_of, impacts_of, open_contacts, sticking_of
from femimpact.integrators.stepping.record import check_recorder, piece_ends, record_of
from femimpact.integrators.stepping.scheme import SteppingMethod
from femimpact.integrators.stepping.step_size import check_sampling, check_step, step_notes
from femimpact.integrators.threads import Progress
from femimpact.response.channels import resolve_channels
from femimpact.response.history import Stream
from femimpact.response.impacts import impact_statistics
from femimpact.response.largest import LargestValues
from femimpact.response.response import Recorder, Response
from femimpact.response.signals import no_steady_motion, steady_motion
from femimpact.system.continuation import begun_anew
from femimpact.system.reduction import truncation_notes
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["divergence_message", "run_steps"]


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

    Raises
    ------
    InputError
        If the step does not resolve the contact, the run would keep too much, or an argument is
        out of range.
    DivergenceError
        If the motion is not finite or grows without bound.
    """
    check_recorder(recorder)
    fits = in_range(duration, quantity("s", at_least=method.dt))
    require(fits, "duration", duration, "s", f"must be a finite number >= one step, {method.dt:g} s")
    check_sampling(np.array([excitation.frequency]), method, "frequency")
    warnings, again = check_step(system, method), partial(_again, system, excitation, method, duration, initial)
    largest = LargestValues(partial(find_largest, again, recorder))
    steps = round(duration / method.dt)
    if isinstance(excitation, Sum | PointForce):
        # the sines of a sum go on behind the last step, which may be half a step after the end
        excitation = excitation.until(initial.time + duration + 2.0 * method.dt)
    channels, drive = resolve_channels(system, recorder.channels), drive_of(system, excitation)
    rows = channel_rows(system, drive, channels, springs_apart=False)
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
    notes = (*response.notes, *reaction_notes(system, drive, channels))
    return replace(response, notes=notes, kept_state=kept_state, largest_values=largest)


def _again(
    system: System, excitation: Excitation, method: SteppingMethod, duration: float, initial: State, recorder: Recorder
) -> Response:  # fmt: skip
    """The same run with another recorder."""
    return run_steps(system, excitation, method, duration, recorder, initial)


def divergence_message(frequency: float, time: float, method: SteppingMethod) -> str:
    """Words for a run that grew without bound, and what to do."""
    return (
        f"the motion at {frequency:g} Hz is not finite or grew without bound before t = {time:.4g} s with "
        f"dt = {method.dt:.3g} s: take a smaller dt (recommended_step gives one), a contact law with damping, "
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
    """Where a block stands."""
    step = int(block.record.tally[0])
    return final_state(system, excitation, method, block.beginning, step, block.pairs, block.motion, block.cycles)


def _share_of(progress: Progress, done: int, end: int, steps: int) -> Progress:
    """Progress of a whole run, told by the share of the steps from `done` to `end`."""
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
    return Response(
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
        f"energy residual {residual:.2g} exceeds {limit:g}: the method or the contact law makes or loses energy that "
        "the ledger cannot name; take a smaller dt, or raise Recorder.residual_limit"
    )
