"""What a stepped run keeps, laid out and weighed before it starts."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

import numpy as np

from femimpact.errors import require
from femimpact.excitation import Excitation, RecordedBase
from femimpact.integrators import layout
from femimpact.integrators.newmark import SteppingMethod
from femimpact.response.response import Channel, Recorder
from femimpact.system.system import System

__all__ = ["check_memory", "memory_needed", "piece_ends", "record_of"]


def memory_needed(
    system: System, recorder: Recorder, channels: int, steps: int, dt: float, frequency: float, drive: int = 0
) -> dict[str, int]:
    """Bytes that a run will keep: channels, energies, snapshots, impacts, cycle statistics, values of the drive.

    With a sink these are channels, energies and snapshots of one piece.
    """
    samples, snapshots = _rows(recorder, steps, dt)
    width = 2 * (system.dofs + len(system.contacts)) + len(system.contacts)
    cycles, modes = int(steps * dt * frequency) + 2, _modes_kept(system, recorder)
    return {
        "channels": 8 * samples * channels,
        "energies": 8 * samples * (len(layout.ENERGY_COLUMNS) + modes) * recorder.ledger,
        # in dofs while running, at the nodes afterwards
        "snapshots": 8 * snapshots * (width + 4 * system.nodes.size),
        "impacts": 8 * recorder.impacts * (len(layout.IMPACT_COLUMNS) + modes) * bool(system.contacts),
        "cycles": 8 * cycles * (len(layout.CYCLE_COLUMNS) + len(layout.ENERGY_COLUMNS)),
        "drive": 8 * drive,
    }


def _modes_kept(system: System, recorder: Recorder) -> int:
    """How many modes get energies of their own: all of a system on its modes, with a ledger."""
    return system.dofs if recorder.ledger and system.is_diagonal else 0


def check_memory(
    system: System, recorder: Recorder, channels: int, steps: int, dt: float, frequency: float,
    key: str = "record.memory_limit", drive: int = 0,
) -> int:  # fmt: skip
    """Bytes that a run will keep; an error when they are more than the recorder allows.

    Raises
    ------
    InputError
        Naming what takes how much.
    """
    parts = memory_needed(system, recorder, channels, steps, dt, frequency, drive)
    needed = sum(parts.values())
    shares = ", ".join(f"{name} {size / 1e6:.3g} MB" for name, size in parts.items() if size > 1e6)
    allowed = (
        f"must be >= {needed:.3g}, what this run keeps ({shares}): keep less (a larger stride every, fewer "
        "snapshots, a shorter run), give the recorder a sink, or raise it"
    )
    require(needed <= recorder.memory_limit, key, recorder.memory_limit, "bytes", allowed)
    return needed


def _rows(recorder: Recorder, steps: int, dt: float) -> tuple[int, int]:
    """Rows for samples and snapshots: of the whole run, or of the largest piece of it."""
    first, first_field = _first_steps(recorder, steps, dt)
    samples = (steps - first) // recorder.every + 1
    snapshots = (steps - first_field) // recorder.snapshots + 1 if recorder.snapshots else 0
    if recorder.sink is None:
        return samples, snapshots
    piece = recorder.piece_samples * recorder.every
    return min(samples, recorder.piece_samples), min(snapshots, math.ceil(piece / max(recorder.snapshots, 1)))


def _first_steps(recorder: Recorder, steps: int, dt: float) -> tuple[int, int]:
    """Steps of the first sample and of the first snapshot."""
    start, start_field = (round(min(t / dt, steps)) for t in (recorder.start, recorder.snapshots_start))
    return start, start_field


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
    dt, modes = method.dt, _modes_kept(system, recorder)
    # a recorded motion is spread over all fine steps before the first
    drive = steps * method.refine + 1 if isinstance(excitation, RecordedBase) else 0
    # with the base's displacement and velocity, where stops stand still in space
    drive *= 3 if any(pair.fixed_to == "space" for pair in system.contacts) else 1
    check_memory(system, recorder, len(channels), steps, dt, excitation.frequency, drive=drive)
    samples, snapshots = _rows(recorder, steps, dt)
    rows = [channel.row for channel in channels if channel.row is not None]
    number = iter(range(len(rows)))
    index = [channel.ball if channel.row is None else next(number) for channel in channels]
    balls = len(system.contacts)
    start, start_field = _first_steps(recorder, steps, dt)
    return layout.Record(
        kind=np.array([channel.kind for channel in channels], dtype=np.int64),
        source=np.array(index, dtype=np.int64),
        rows=np.array(rows).reshape(-1, system.dofs),
        channels=np.zeros((samples, len(channels))),
        energy=np.zeros((samples if recorder.ledger else 0, len(layout.ENERGY_COLUMNS) + modes)),
        fields=np.zeros((snapshots, 2, system.dofs + balls)),
        forces=np.zeros((snapshots, balls)),
        impacts=np.zeros((recorder.impacts if balls else 0, len(layout.IMPACT_COLUMNS) + modes)),
        stride=np.array([recorder.every, start, max(recorder.snapshots, 1), start_field], dtype=np.int64),
        tally=np.zeros(4, dtype=np.int64),
    )
