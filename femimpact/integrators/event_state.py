"""What an event-driven run works on and what it gathers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_driven import EventDriven, Outputs, force_directions, new_flight, new_search, space_of
from femimpact.integrators.flight_space import FlightSpace, Riders, flight_space
from femimpact.integrators.kernels.balance import Balance
from femimpact.integrators.kernels.crossing import Space
from femimpact.integrators.kernels.events import Contact
from femimpact.integrators.layout import IMPACT_COLUMNS
from femimpact.system import System

__all__ = ["EventRun", "Keep", "Ride", "kept_rows", "new_run", "piece_of", "require_finite"]

CYCLES_AT_ONCE = 256
"""Base cycles between two looks at progress and interrupts."""


@dataclass(frozen=True)
class Keep:
    """Which samples are kept: strides and first samples of history and snapshots; 0 strides keep none."""

    every: int = 1
    first: int = 0
    snapshots: int = 0
    first_snapshot: int = 0


@dataclass(frozen=True)
class Ride:
    """One riding state: pair, side, from when to when (s; not a number while it lasts), impulse (N s)."""

    pair: int
    side: int
    start: float
    end: float
    impulse: float


@dataclass(eq=False)
class EventRun:
    """Working state and results of one run; arrays grow by pieces. `rounding` (J) bounds that of the ledger."""

    system: System
    drive: Drive
    method: EventDriven
    outputs: Outputs
    interval: float
    ledger: bool
    keep: Keep
    contact: Contact
    balance: Balance
    spaces: dict[Riders, tuple[FlightSpace, Space]] = field(default_factory=dict)
    samples: list[NDArray[Any]] = field(default_factory=list)
    energy: list[NDArray[Any]] = field(default_factory=list)
    fields: list[NDArray[Any]] = field(default_factory=list)
    cycles: list[NDArray[Any]] = field(default_factory=list)
    rides: list[Ride] = field(default_factory=list)
    open_rides: dict[int, tuple[int, float, float]] = field(default_factory=dict)
    touching: tuple[int, ...] = ()
    rounding: float = 0.0
    piece_samples: int = 0

    def clear(self) -> None:
        """Forget the history that was handed over."""
        self.samples.clear()
        self.energy.clear()
        self.fields.clear()

    def space(self, riders: Riders) -> tuple[FlightSpace, Space]:
        """Closed form and kernel arrays for these riders, made once."""
        if riders not in self.spaces:
            flight = flight_space(self.system, self.drive, riders)
            self.spaces[riders] = (flight, space_of(self.system, self.drive, flight, self.interval))
        return self.spaces[riders]


def new_run(
    system: System, drive: Drive, method: EventDriven, outputs: Outputs, window: tuple[float, float],
    ledger: bool, keep: Keep, most_impacts: int,
) -> EventRun:  # fmt: skip
    """Arrays of a run that has not begun."""
    n, balls, pairs = system.dofs, len(system.balls), len(system.contacts)
    mass = np.concatenate([system.M.diagonal(), [pair.mass for pair in system.balls]])
    given = np.concatenate([np.zeros(n), [pair.mass * pair.acceleration for pair in system.balls]])
    load = np.concatenate([drive.load, [-pair.mass * drive.share for pair in system.balls]])
    most = 2 * (n + balls) + 2
    balance = Balance(
        mass=mass,
        damping=np.concatenate([system.C.diagonal(), np.zeros(balls)]),
        stiffness=np.concatenate([system.K.diagonal(), np.zeros(balls)]),
        load=load,
        given=given,
        force=force_directions(system),
        spring=np.array([pair.free_stiffness for pair in system.contacts]),
        structure=np.array([n]),
        loss_of_mode=np.zeros(n),
        sums=np.zeros(2),
        growth=np.zeros(most, dtype=complex),
        strength=np.zeros(most, dtype=complex),
        position=np.zeros(n + balls),
        velocity=np.zeros(n + balls),
        spare=new_flight(0, 0),
    )
    contact = Contact(
        search=new_search(pairs, most, 0),
        restitution=np.array([pair.parameters.restitution for pair in system.contacts]),
        closure=np.array([method.closure]),
        impulse=np.zeros(pairs),
        impacts=np.zeros((most_impacts if pairs else 0, len(IMPACT_COLUMNS) + n)),
        totals=np.zeros((6, pairs)),
        window=np.array(window),
        tally=np.array([0, 0, 0], dtype=np.int64),
    )
    interval = 2.0 * math.pi / (drive.omega * method.samples_per_cycle)
    return EventRun(system, drive, method, outputs, interval, ledger, keep, contact, balance)


def piece_of(run: EventRun) -> int:
    """Samples between two looks at progress: whole cycles, and no more than a sink wants at once if it can be."""
    per_cycle = run.method.samples_per_cycle
    fitting = max(run.piece_samples * max(run.keep.every, 1) // per_cycle, 1) if run.piece_samples else CYCLES_AT_ONCE
    return min(CYCLES_AT_ONCE, fitting) * per_cycle


def require_finite(values: NDArray[Any], time: float) -> None:
    """Stop a run whose readings are no numbers.

    Raises
    ------
    DivergenceError
        Naming the time (s) until which they were read.
    """
    if not np.all(np.isfinite(values)):
        raise DivergenceError(
            f"the motion is not finite before t = {time:.4g} s: its closed form has lost all digits; Newmark takes "
            "this system"
        )


def kept_rows(run: EventRun, done: int, count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Row of the history and of the snapshots that each sample of a piece fills, -1 for none."""
    number = done + 1 + np.arange(count)

    def rows(every: int, first: int) -> NDArray[Any]:
        due = (number >= first) & ((number - first) % max(every, 1) == 0) & (every > 0)
        return np.where(due, np.cumsum(due) - 1, -1)

    keep = run.keep
    return rows(keep.every, keep.first), rows(keep.snapshots, keep.first_snapshot)
