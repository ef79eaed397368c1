"""Arrays for what a stepped run keeps."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from femimpact.excitation import Excitation, RecordedBase
from femimpact.integrators.memory import check_memory, first_steps, kept_rows, modes_kept
from femimpact.integrators.stepping import layout
from femimpact.integrators.stepping.newmark import SteppingMethod
from femimpact.response.columns import ENERGY_COLUMNS, IMPACT_COLUMNS
from femimpact.response.response import Channel, Recorder
from femimpact.system.system import System

__all__ = ["piece_ends", "record_of"]


def piece_ends(recorder: Recorder, steps: int) -> Iterable[int]:
    """Steps after which a run with a sink hands over a piece; a piece has as many, the state at t = 0 counted."""
    if recorder.sink is None:
        return [steps]
    piece = recorder.piece_samples * recorder.every
    return itertools.chain(range(piece - 1, steps, piece), [steps])


def record_of(
    system: System,
    recorder: Recorder,
    channels: tuple[Channel, ...],
    steps: int,
    method: SteppingMethod,
    excitation: Excitation,
) -> layout.Record:
    """Arrays for what is kept, refused before the run when they would not fit."""
    dt, modes = method.dt, modes_kept(system, recorder)
    # a recorded motion is spread over all fine steps before the first
    drive = steps * method.refine + 1 if isinstance(excitation, RecordedBase) else 0
    # with the base's displacement and velocity, where stops stand still in space
    drive *= 3 if any(pair.fixed_to == "space" for pair in system.contacts) else 1
    check_memory(system, recorder, len(channels), steps, dt, excitation.frequency, drive=drive)
    samples, snapshots = kept_rows(recorder, steps, dt)
    rows = [channel.row for channel in channels if channel.row is not None]
    number = iter(range(len(rows)))
    index = [channel.ball if channel.row is None else next(number) for channel in channels]
    balls = len(system.contacts)
    start, start_field = first_steps(recorder, steps, dt)
    return layout.Record(
        kind=np.array([channel.kind for channel in channels], dtype=np.int64),
        source=np.array(index, dtype=np.int64),
        rows=np.array(rows).reshape(-1, system.dofs),
        channels=np.zeros((samples, len(channels))),
        energy=np.zeros((samples if recorder.ledger else 0, len(ENERGY_COLUMNS) + modes)),
        fields=np.zeros((snapshots, 2, system.dofs + balls)),
        forces=np.zeros((snapshots, balls)),
        impacts=np.zeros((recorder.impacts if balls else 0, len(IMPACT_COLUMNS) + modes)),
        stride=np.array([recorder.every, start, max(recorder.snapshots, 1), start_field], dtype=np.int64),
        tally=np.zeros(4, dtype=np.int64),
    )
