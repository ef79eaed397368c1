"""Many dwells by a method with steps: blocks of cases side by side, each with separate numbers and start."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.contact.custom_law import speed_note
from femimpact.contact.laws import RIGID
from femimpact.errors import DivergenceError, require
from femimpact.excitation.drives import until
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.assembly import MethodRun, Readings, impacts_of, sticking_of, whole_number_of
from femimpact.integrators.cases import (
    SineCases,
    SineDwellResults,
    equal_groups,
    in_blocks,
    start_of,
    with_contacts_of,
)
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.stepping.arrays import Inputs, inputs_alone
from femimpact.integrators.stepping.block import (
    Block,
    check_laws,
    check_recorder,
    history_of,
    impact_rows,
    open_contacts,
    piece_ends,
    prepare,
    record_of,
    run_block,
    state_of,
    sticking_rows,
)
from femimpact.integrators.stepping.operators import SteppingMethod, check_sampling, check_step
from femimpact.progress import Progress
from femimpact.response.channels import resolve_channels
from femimpact.response.cycles import SteadyMotion, steady_motion
from femimpact.response.energy import BALANCED, EnergyLedger, energy_residual
from femimpact.response.history import Stream
from femimpact.response.impacts import PEAK_FORCE
from femimpact.response.response import Recorder
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.units import number_text


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
    for step in _run(block, heapq.merge(piece_ends(recorder, steps), steps_to_keep), excitation, method, progress):
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
