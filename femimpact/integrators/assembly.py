"""What a method hands over of a run, and the parts of a response that all methods build of the same arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array, own
from femimpact.errors import in_range, made, quantity, require
from femimpact.excitation.excitation import Excitation
from femimpact.integrators.channel_rows import ChannelRows, Drive, channel_rows, mode_notes, named_work
from femimpact.response.channels import Channel
from femimpact.response.cycles import CycleStatistics, LargestValues, SteadyMotion, no_steady_motion, steady_motion
from femimpact.response.energy import EnergyLedger
from femimpact.response.history import HistoryPiece, Snapshots
from femimpact.response.impacts import CYCLE_COLUMNS, ENERGY_COLUMNS, IMPACT_COLUMNS, EventLog, Impacts, StickingPhases
from femimpact.system.state import State
from femimpact.system.system import System


@dataclass(frozen=True, eq=False)
class MethodRun:
    """What a method has computed of a run; `runs.response_by` makes a `Response` of it."""

    history: HistoryPiece  # all that was kept; of a run with a sink what is left of it
    final_state: State
    cycles: CycleStatistics  # of the default place, arrays (cycles, 1)
    measured: float  # s: length of the last third, of which the totals are
    totals: Array  # (6, pairs); see `impacts.TOTAL_COLUMNS`
    impacts: Impacts
    sticking: StickingPhases = field(default_factory=StickingPhases.none)
    events: EventLog | None = None
    kept_state: State | None = None  # at `Recorder.state_at`
    streamed_to: float | None = None  # s: time of the last sample that went to the sink
    going_on: tuple[str, ...] = ()  # names of the contacts in progress at the start that went on
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    # where the method finds more than the largest of the instants at which it is read
    largest: LargestValues | None = None

    @property
    def steady(self) -> SteadyMotion:
        """Amplitudes of the default place over the last third of the cycles."""
        finished = int(np.count_nonzero(self.cycles.samples[:, 0]))
        return steady_motion(self.cycles, np.array([max(finished // 3, 1)])) if finished else no_steady_motion()


def whole_number_of(duration: float, interval: float, what: str) -> int:
    """Number of intervals (s) in a duration (s), rounded; an error where there is less than one."""
    fits = in_range(duration, quantity("s", at_least=interval))
    require(fits, "duration", duration, "s", f"must be a finite number >= one {what}, {interval:g} s")
    return round(duration / interval)


def cycles_of_table(table: Array) -> CycleStatistics:
    """Statistics of cycles from their columns (columns, cycles, cases)."""
    return made(CycleStatistics, **dict(zip(CYCLE_COLUMNS, table, strict=False)))


@dataclass(frozen=True, eq=False)
class Readings:
    """The channels of a run with their rows: makes pieces of history of what a method has read."""

    system: System
    excitation: Excitation
    drive: Drive
    channels: tuple[Channel, ...]
    springs_apart: bool  # as of `channel_rows`

    @cached_property
    def rows(self) -> ChannelRows:
        """Rows of the channels."""
        return channel_rows(self.system, self.drive, self.channels, springs_apart=self.springs_apart)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on what modes that are left out would add to the channels."""
        return mode_notes(self.system, self.drive, self.channels)

    def piece(
        self,
        time: Array,  # (samples,) s
        values: Array,  # (channels, samples) what the state has a share in
        energy: Array | None = None,  # (columns, samples) J: `ENERGY_COLUMNS`, then losses of modes
        work_of: Array | None = None,  # (samples, drives + 1) J
        snapshots: Snapshots | None = None,
    ) -> HistoryPiece:
        """A piece of history, of arrays that are not written to any more."""
        channels = {}
        for i, channel in enumerate(self.channels):
            of_time = self.rows.of_time(i, time, self.excitation, self.drive)
            channels[channel.name] = own(values[i] + of_time) if np.any(of_time) else values[i]
        return made(
            HistoryPiece,
            time=time,
            channels=channels,
            units={channel.name: channel.unit for channel in self.channels},
            energy=None if energy is None else self._ledger(time, energy, work_of),
            snapshots=snapshots,
            base=self.excitation,
        )

    def _ledger(self, time: Array, energy: Array, work_of: Array | None) -> EnergyLedger:
        named = {} if work_of is None else named_work(self.drive, work_of, self.system)
        of_mode, columns = energy[len(ENERGY_COLUMNS) :].T, dict(zip(ENERGY_COLUMNS, energy, strict=False))
        return made(EnergyLedger, time=time, structure_loss_of_mode=of_mode, work_of=named, **columns)


def snapshots_of(
    system: System,
    time: Array,  # (samples,) s
    displacement: Array,  # (samples, nodal values) m, and m/s
    velocity: Array,
    fields: Array,  # (samples, 2, dofs + balls or more) m and m/s
    forces: Array,  # (samples, pairs) N: on the ball or, at a stop, on the stop
) -> Snapshots:
    """Snapshots of the beam and the balls."""
    balls = slice(system.dofs, system.dofs + len(system.balls))
    return made(
        Snapshots,
        time=time,
        displacement=own(displacement),
        velocity=own(velocity),
        ball_displacement=own(fields[:, 0, balls]),
        ball_velocity=own(fields[:, 1, balls]),
        # a force on the beam: the direction of a stop is that of its place turned round
        contact_force=own(forces * [pair.sign for pair in system.contacts]),
    )


def impacts_of(
    system: System,
    excitation: Excitation,
    rows: Array,  # (n, columns): `IMPACT_COLUMNS`, then energies to modes
    count: int,  # impacts in all
) -> Impacts:
    """The table of impacts, as far as it was kept."""
    columns = {name: own(rows[:, i]) for i, name in enumerate(IMPACT_COLUMNS)}
    names = np.array([pair.name for pair in system.contacts] or [""])
    impactor = names[columns.pop("pair").astype(int)]
    return made(
        Impacts,
        **columns,
        impactor=impactor,
        phase=own(np.mod(2.0 * np.pi * excitation.frequency * columns["time"] + excitation.phase, 2.0 * np.pi)),
        energy_to_modes=own(rows[:, len(IMPACT_COLUMNS) :]),
        law={pair.name: pair.law.name for pair in system.contacts if pair.has_walls},
        dropped=count - rows.shape[0],
    )


def sticking_of(
    system: System,
    rows: ArrayLike,  # (n, 6): number of the pair, side, start and end (s), impulse (N s), how long it has lasted (s)
) -> StickingPhases:
    """The table of sticking phases."""
    pair, side, start, end, impulse, lasting = np.asarray(rows, dtype=float).reshape(-1, 6).T
    return made(
        StickingPhases,
        impactor=np.array([system.contacts[int(j)].name for j in pair], dtype=str),
        side=own(side),
        start=own(start),
        end=own(end),
        impulse=own(impulse),
        mean_force=own(np.divide(impulse, lasting, out=np.zeros_like(impulse), where=lasting > 0.0)),
    )
