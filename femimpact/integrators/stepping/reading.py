"""What a stepped run has kept, read from its arrays: histories, impacts, sticking."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.contact.formulas import RIGID
from femimpact.excitation import Excitation
from femimpact.integrators.channel_rows import ChannelRows
from femimpact.integrators.driving import Drive
from femimpact.integrators.stepping import layout
from femimpact.integrators.stepping.block import Block
from femimpact.response.channels import Channel
from femimpact.response.columns import ENERGY_COLUMNS, IMPACT_COLUMNS
from femimpact.response.energy import EnergyLedger
from femimpact.response.history import HistoryPiece, Snapshots
from femimpact.response.impacts import Impacts, StickingPhases
from femimpact.system.system import System

__all__ = ["Recorded", "history_of", "impacts_of", "open_contacts", "sticking_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recorded:
    """What a run's history is read for: its excitation, and the channels with their rows."""

    excitation: Excitation
    drive: Drive
    channels: tuple[Channel, ...]
    rows: ChannelRows
    refilled: bool
    """Whether the arrays of the record are filled again once they were read."""


def history_of(
    block: Block,
    system: System,
    recorded: Recorded,
    samples_before: int,
    snapshots_before: int,
) -> HistoryPiece:
    """All samples and snapshots that the record of a block holds now.

    Parameters
    ----------
    block : Block
    system : System
    recorded : Recorded
    samples_before, snapshots_before : int
        What was taken out of the record earlier.

    Returns
    -------
    HistoryPiece
        Of copies where the record is filled again, otherwise of its arrays.
    """
    record, dt, origin = block.record, block.scheme.dt, block.beginning.origin
    samples, snapshots = int(record.tally[1]), int(record.tally[2])
    every, first, stride, first_field = (int(value) for value in record.stride)
    # a copy of 20 histories of a run costs more than its steps
    kept = _own if recorded.refilled else _read_only
    histories = kept(record.channels[:, :samples])
    time = _own(origin + (first + every * (samples_before + np.arange(samples))) * dt)
    shown = _own(origin + (first_field + stride * (snapshots_before + np.arange(snapshots))) * dt)
    return HistoryPiece(
        time=time,
        channels={
            channel.name: _with(histories[i], recorded.rows.of_time(i, time, recorded.excitation, recorded.drive))
            for i, channel in enumerate(recorded.channels)
        },
        units={channel.name: channel.unit for channel in recorded.channels},
        energy=_ledger(kept(record.energy[:, :samples]), time) if block.ledger else None,
        snapshots=_snapshots(record, system, shown) if record.snapshots.shape[0] > 0 else None,
        base=recorded.excitation,
    )


def _ledger(table: Array, time: Array) -> EnergyLedger:
    columns = dict(zip(ENERGY_COLUMNS, table, strict=False))
    return EnergyLedger(time=time, structure_loss_of_mode=table[len(ENERGY_COLUMNS) :].T, **columns)


def _with(history: Array, of_time: Array | float) -> Array:
    """A history and what the state has no share in."""
    return _own(history + of_time) if np.any(of_time) else history


def _snapshots(record: layout.Record, system: System, time: Array) -> Snapshots:
    fields, forces = record.snapshots[: time.size], record.forces[: time.size]
    dofs, balls = system.dofs, slice(system.dofs, system.dofs + len(system.balls))
    return Snapshots(
        time=time,
        displacement=_own(_at_nodes(system, fields[:, 0, :dofs])),
        velocity=_own(_at_nodes(system, fields[:, 1, :dofs])),
        ball_displacement=_own(fields[:, 0, balls]),
        ball_velocity=_own(fields[:, 1, balls]),
        contact_force=_own(forces * [-1.0 if pair.is_stop else 1.0 for pair in system.contacts]),
    )


def _at_nodes(system: System, rows: Array) -> Array:
    values = np.zeros((rows.shape[0], system.expansion.shape[0]))
    for k, row in enumerate(rows):
        # one by one: a product with many columns rounds as their number has it, and pieces must not show
        values[k] = system.expansion @ row
    return values


def impacts_of(block: Block, system: System, excitation: Excitation) -> Impacts:
    """The table of impacts, as far as it was kept."""
    record = block.record
    count = min(int(record.tally[3]), record.impacts.shape[0])
    columns = {name: _own(record.impacts[:count, i]) for i, name in enumerate(IMPACT_COLUMNS)}
    names = np.array([pair.name for pair in system.contacts] or [""])
    impactor = names[columns.pop("pair").astype(int)]
    columns["time"] = _own(block.beginning.origin + columns["time"])
    return Impacts(
        **columns,
        impactor=impactor,
        phase=_own(np.mod(2.0 * np.pi * excitation.frequency * columns["time"] + excitation.phase, 2.0 * np.pi)),
        energy_to_modes=_own(record.impacts[:count, len(IMPACT_COLUMNS) :]),
        law={pair.name: pair.law.name for pair in system.contacts},
        dropped=int(record.tally[3]) - count,
    )


def sticking_of(block: Block, system: System) -> StickingPhases:
    """Rigid contacts that took an impulse in three or more steps in a row: a ball that moves with its wall.

    Each begins with an impact, which has its own row in the table of impacts once the contact has ended;
    the impulses of the two tables are the same.
    """
    record, touch, dt = block.record, block.motion.touch[:, :, 0], block.scheme.dt
    count = min(int(record.tally[3]), record.impacts.shape[0])
    rows = [(*row[:3], row[7], row[5], row[0] + row[7]) for row in record.impacts[:count]]
    for j in np.flatnonzero(touch[layout.OPEN]):
        time, side, duration, impulse = (
            touch[row, j] for row in (layout.START, layout.SIDE, layout.DURATION, layout.IMPULSE)
        )
        rows.append((time, j, side, duration, impulse, np.nan))
    rows = [row for row in rows if block.pairs.kind[int(row[1])] == RIGID and row[3] > 1.5 * dt]
    if not rows:
        return StickingPhases.none()
    start, pair, side, duration, impulse, end = (np.array(column) for column in zip(*rows, strict=True))
    start, end = block.beginning.origin + start, block.beginning.origin + end
    return StickingPhases(
        impactor=np.array([system.contacts[int(j)].name for j in pair]),
        side=_own(side),
        start=_own(start),
        end=_own(end),
        impulse=_own(impulse),
        mean_force=_own(impulse / duration),
    )


def open_contacts(block: Block, system: System) -> tuple[str, ...]:
    """Notes on balls that touch at the end: their contact is in the forces, not in the table of impacts."""
    touch = block.motion.touch[:, :, 0]
    return tuple(
        f"{pair.name} is in contact at the end, under force for {touch[layout.DURATION, j]:.3g} s of it: that "
        "contact counts in forces and energies but is no finished impact"
        for j, pair in enumerate(system.contacts)
        if touch[layout.OPEN, j] != 0.0
    )


def _own(array: ArrayLike) -> Array:
    """A read-only copy, its rows together."""
    copy = np.array(array, dtype=float, order="C")
    copy.setflags(write=False)
    return copy


def _read_only(array: Array) -> Array:
    """A view that cannot be written to."""
    view = array.view()
    view.setflags(write=False)
    return view
