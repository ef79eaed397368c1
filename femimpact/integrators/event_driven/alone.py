"""One case alone: its arrays at the start, and the pieces in which it is run."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from femimpact.contact.formulas import RIGID
from femimpact.errors import require
from femimpact.excitation import Excitation
from femimpact.integrators.driving import Drive, drive_of
from femimpact.integrators.event_driven.block import Block, Inputs, case_numbers, new_block
from femimpact.integrators.event_driven.continued import Sampling, held_by, sampling_from
from femimpact.integrators.event_driven.equations import equations_of
from femimpact.integrators.event_driven.reading_grid import ReadingGrid
from femimpact.integrators.event_driven.settings import EventSettings
from femimpact.integrators.event_driven.store import FormStore, Outputs
from femimpact.response.response import Recorder
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["block_alone", "closed_drive", "pieces", "sample_to_keep", "unending"]

CYCLES_AT_ONCE = 256
"""Base cycles between two reports of progress, when interrupts are checked."""

SAMPLES_AT_ONCE = 2**17
"""The same in samples, at most, where these do not divide base cycles."""


def closed_drive(system: System, excitation: Excitation) -> Drive:
    """The right-hand side of an excitation that has a closed form.

    Raises
    ------
    InputError
        If it has none.
    """
    drive = drive_of(system, excitation)
    allowed = "must have a closed_form for EventDriven: sample it into a RecordedBase, or take Newmark"
    require(drive.closed_form is not None, "excitation", type(excitation).__name__, "", allowed)
    return drive


def block_alone(
    system: System, excitation: Excitation, drive: Drive, method: EventSettings, outputs: Outputs, initial: State,
    grid: ReadingGrid, begin: float, ledger: bool | None, most_rows: int,
) -> tuple[Block, Sampling]:  # fmt: skip
    """Arrays of one case at its start, and its instants of reading.

    Parameters
    ----------
    system : System
    excitation : Excitation
    drive : Drive
        Of the excitation.
    method : EventSettings
    outputs : Outputs
    initial : State
    grid : ReadingGrid
    begin : float, s
        From when on impacts are counted.
    ledger, most_rows
        As of `new_block`.

    Returns
    -------
    Block, Sampling
    """
    rigid = np.array([pair.parameters.kind == RIGID for pair in system.contacts], dtype=bool)
    whole = equations_of(system, drive)
    store = FormStore(
        whole, rigid, outputs, rate=None if drive.pieces is None else drive.pieces.rate, derived=system.derived
    )
    u, v, y, y_rate = initial.relative_to_base(system, excitation)
    balls, held = len(system.balls), held_by(initial, system, excitation)
    inputs = Inputs(
        numbers=case_numbers([drive], [system.contacts]),
        is_sine=drive.is_sine,
        position=np.concatenate([u, y[:balls]])[None],
        velocity=np.concatenate([v, y_rate[:balls]])[None],
        window=np.array([[begin, math.inf]]),
        start=initial.time,
        held=held,
    )
    block = new_block(system, store, inputs, method, ledger, most_rows)
    sampling = sampling_from(held, initial.time, grid.interval)
    block.grid = block.grid._replace(
        start=np.array([sampling.origin]),
        interval=np.array([grid.interval]),
        per_cycle=grid.per_cycle,
        origin=np.array([sampling.first]),
    )
    return block, sampling


def pieces(grid: ReadingGrid, recorder: Recorder, samples: int) -> Iterator[tuple[int, int]]:
    """First and last sample of each piece, after the beginning: a run has its bits in the same pieces only.

    Where base cycles are whole samples these are whole cycles, and if possible no more than a piece for the sink.
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
    """Sample after the beginning at which the state is kept, 0 for none: where cycles are whole samples, at their end.

    Another one is the sample before the time.
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
