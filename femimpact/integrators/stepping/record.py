"""Arrays for what a stepped run keeps."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from femimpact.errors import require
from femimpact.integrators.channel_rows import ChannelRows
from femimpact.integrators.driving import Drive
from femimpact.integrators.memory import check_memory, first_steps, kept_rows, modes_kept
from femimpact.integrators.stepping import layout
from femimpact.integrators.stepping.scheme import SteppingMethod
from femimpact.response.columns import ENERGY_COLUMNS, IMPACT_COLUMNS
from femimpact.response.response import Recorder
from femimpact.system.system import System

__all__ = ["check_recorder", "piece_ends", "record_of"]


def check_recorder(recorder: Recorder) -> None:
    """Raise `InputError` for an interval of readings: a method with steps has its own."""
    allowed = "is for EventDriven: a method with steps is read at its steps, of which `every` keeps one in so many"
    require(recorder.interval is None, "record.interval", recorder.interval, "s", allowed)


def piece_ends(recorder: Recorder, steps: int) -> Iterable[int]:
    """Steps after which a run with a sink passes on a piece; a piece has as many, the state at the start counted."""
    if recorder.sink is None:
        return [steps]
    piece = recorder.piece_samples * recorder.every
    return itertools.chain(range(piece - 1, steps, piece), [steps])


def record_of(
    system: System,
    recorder: Recorder,
    rows: ChannelRows,
    steps: int,
    method: SteppingMethod,
    drive: Drive,
    first: int,
) -> layout.Record:
    """Arrays for what is kept from the step `first` on, refused before the run when they would not fit."""
    dt, modes = method.dt, modes_kept(system, recorder)
    # a recorded motion is spread over all fine steps before the first
    values = 0 if drive.is_sine else (first + steps) * method.refine + 1
    # with the base's displacement and velocity, where stops are fixed in space
    values *= 3 if any(pair.fixed_to == "space" for pair in system.contacts) else 1
    check_memory(system, recorder, rows.drive.size, steps, dt, drive.omega / (2.0 * np.pi), drive=values)
    samples, snapshots = kept_rows(recorder, steps, dt)
    balls = len(system.contacts)
    start, start_field = (first + number for number in first_steps(recorder, steps, dt))
    of_state = np.stack([rows.displacement, rows.velocity], axis=1)
    of_pairs = np.stack([rows.ball_displacement, rows.ball_velocity, rows.pair_force, rows.contact_force], axis=1)
    return layout.Record(
        used=np.column_stack(
            [np.any(of_state, axis=2), np.any(of_pairs[:, :2], axis=(1, 2)), np.any(of_pairs[:, 2:], axis=(1, 2))]
        ).astype(np.int64),
        rows=of_state,
        pair_rows=of_pairs,
        channels=np.zeros((rows.drive.size, samples)),
        energy=np.zeros((len(ENERGY_COLUMNS) + modes, samples if recorder.ledger else 0)),
        snapshots=np.zeros((snapshots, 2, system.dofs + balls)),
        forces=np.zeros((snapshots, balls)),
        impacts=np.zeros((recorder.impacts if balls else 0, len(IMPACT_COLUMNS) + modes)),
        stride=np.array([recorder.every, start, max(recorder.snapshots, 1), start_field], dtype=np.int64),
        tally=np.array([first, 0, 0, 0], dtype=np.int64),
    )
