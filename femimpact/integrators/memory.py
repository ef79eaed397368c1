"""How much memory a run keeps, known before it starts."""

from __future__ import annotations

import math

from femimpact.errors import require
from femimpact.response.columns import CYCLE_COLUMNS, ENERGY_COLUMNS, IMPACT_COLUMNS
from femimpact.response.response import Recorder
from femimpact.system.system import System

__all__ = ["check_memory", "first_steps", "kept_rows", "memory_needed", "modes_kept"]


def memory_needed(
    system: System, recorder: Recorder, channels: int, steps: int, dt: float, frequency: float, drive: int = 0
) -> dict[str, int]:
    """Bytes that a run will keep: channels, energies, snapshots, impacts, cycle statistics, values of the drive.

    With a sink these are channels, energies and snapshots of one piece.
    """
    samples, snapshots = kept_rows(recorder, steps, dt)
    width = 2 * (system.dofs + len(system.contacts)) + len(system.contacts)
    cycles, modes = int(steps * dt * frequency) + 2, modes_kept(system, recorder)
    return {
        "channels": 8 * samples * channels,
        "energies": 8 * samples * (len(ENERGY_COLUMNS) + modes) * recorder.ledger,
        # in dofs while running, at the nodes afterwards
        "snapshots": 8 * snapshots * (width + 4 * system.nodes.size),
        "impacts": 8 * recorder.impacts * (len(IMPACT_COLUMNS) + modes) * bool(system.contacts),
        "cycles": 8 * cycles * (len(CYCLE_COLUMNS) + len(ENERGY_COLUMNS)),
        "drive": 8 * drive,
    }


def modes_kept(system: System, recorder: Recorder) -> int:
    """For how many modes the energies are kept separately: all of a system on its modes, with a ledger."""
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
        f"must be >= {needed:.3g}, what this run keeps ({shares}): keep less (a larger stride every or interval, fewer "
        "snapshots, a shorter duration), give the recorder a sink, or raise it"
    )
    require(needed <= recorder.memory_limit, key, recorder.memory_limit, "bytes", allowed)
    return needed


def kept_rows(recorder: Recorder, steps: int, dt: float) -> tuple[int, int]:
    """Rows for samples and snapshots: of the whole run, or of the largest piece of it."""
    first, first_field = first_steps(recorder, steps, dt)
    samples = (steps - first) // recorder.every + 1
    snapshots = (steps - first_field) // recorder.snapshots + 1 if recorder.snapshots else 0
    if recorder.sink is None:
        return samples, snapshots
    piece = recorder.piece_samples * recorder.every
    return min(samples, recorder.piece_samples), min(snapshots, math.ceil(piece / max(recorder.snapshots, 1)))


def first_steps(recorder: Recorder, steps: int, dt: float) -> tuple[int, int]:
    """Steps of the first sample and of the first snapshot."""
    start, start_field = (round(min(t / dt, steps)) for t in (recorder.start, recorder.snapshots_start))
    return start, start_field
