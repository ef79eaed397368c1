"""From solutions of the equations to orbits: their multipliers, their symmetry, and their own event-driven runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from femimpact import core
from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError, changed, made
from femimpact.excitation.drives import PointForce
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.assembly import impacts_of
from femimpact.integrators.channel_rows import Drive, channel_rows, drive_of
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.block import Inputs, new_block, no_cycles, run_block, speed_pieces
from femimpact.integrators.event_driven.store import FormStore, Outputs, outputs_alone
from femimpact.orbits.equations import SECTION, EventStates, Solution, asymmetry, may_be_symmetric, product, state_unit
from femimpact.orbits.motion import IMPACT, SEPARATE, TOUCH
from femimpact.orbits.orbit import PeriodicOrbit, state_of
from femimpact.response.channels import resolve_channels
from femimpact.response.cycles import CycleStatistics, steady_motion
from femimpact.response.impacts import CYCLE_COLUMNS, EventLog, Impacts, event_log
from femimpact.system.state import ROUNDED
from femimpact.system.system import System
from femimpact.units import number_text

R = TypeVar("R")

VERIFIED = 1e-10
"""Largest miss of an orbit's own run after one period, times the largest multiplier where that is above 1."""

SYMMETRIC = 1e-8
"""Largest difference between an orbit and minus itself half a period later, in its units, of a symmetric one."""

SAME_PHASE = 1e-5
"""Difference of phases (rad) up to which an event of a run is that of its orbit."""

AT_START = 1e-12
"""Share of the period up to which an event before or after t = 0 is taken to be there."""

MOST_EVENTS = 1000
"""Events of one period of the drive beyond which a motion is taken for chatter."""

SAMPLES = 512
"""Instants of a period over which the first harmonic is summed; of many cycles those of `EventDriven` in each."""

MORE_EVENTS = 64
"""Events of a run beyond those of its orbit that are kept: of an orbit that is no motion some are met."""


class OtherMotionError(DivergenceError):
    """A solution of the equations that is no motion of the system: it meets other events, or is beyond a wall."""


@dataclass(frozen=True, eq=False)
class OwnRun:
    """What the event-driven run of an orbit over one period leaves. It begins between two events."""

    events: EventStates  # of the orbit
    first: int  # of these: the one that it is to meet first
    log: EventLog
    phases: Array  # rad: of the drive at the events of the log
    missed: float  # by which it misses its start, in units; infinite where its events did not end
    # m: largest displacement of the place, and its component at the frequency of the excitation
    peak: float
    first_harmonic: float
    impacts: Impacts | None  # that begin within the period, if they were asked for

    @cached_property
    def expected(self) -> EventStates:
        """The events that it is to meet, in their order; sections are none."""
        events, sequence = self.events, self.events.sequence
        order = np.roll(np.arange(events.phases.size), -self.first)
        order = order[np.array(sequence.kind)[order] != SECTION]
        phases = events.phases[order] + np.where(order < self.first, sequence.turn, 0.0)
        return EventStates(sequence.rows(order), events.states[order], phases)

    @cached_property
    def other_event(self) -> int | None:
        """Row of the log with the first event that the orbit has not.

        It is the number of rows where the first one is missing, and None where there is none.
        """
        log, expected = self.log, self.expected.sequence
        met, due = (list(zip(each.kind, each.pair, each.side, strict=True)) for each in (log, expected))
        equal = [one == other for one, other in zip(met, due, strict=False)]
        return None if all(equal) and len(met) == len(due) else [*equal, False].index(False)

    @property
    def first_other(self) -> int | None:
        """The same of an event that the orbit has not, or has at another phase."""
        other, count = self.other_event, min(self.phases.size, self.expected.phases.size)
        late = np.flatnonzero(np.abs(self.phases[:count] - self.expected.phases[:count]) > SAME_PHASE)
        return min([*late[:1].tolist(), *([] if other is None else [other])], default=None)

    @property
    def extra(self) -> tuple[int, float] | None:
        """Row of the log of that event, and its phase in the orbit's cycle; None where one is missing, or none is."""
        row, start = self.first_other, self.events.phases[0]
        if row is None or row == len(self.log):
            return None
        return row, float(start + (self.phases[row] - start) % self.events.sequence.turn)

    def check_events(self) -> None:
        """Refuse an orbit of which it meets other events."""
        i, log = self.other_event, self.log
        if i is None:
            return
        if i < len(log) and log.impacts[i] > 1:
            met = f"impacts of {log.impacts[i]} pairs at one instant, t = {log.time[i]:.6g} s"
            raise OtherMotionError(f"the orbit found has {met}: such orbits are not looked for")
        met, count = self._words(i) if i < len(log) else "nothing more", self.expected.phases.size
        raise OtherMotionError(
            f"the orbit found is no motion of the system: after {i} of its {count} events its own run meets {met}; "
            "start nearer to an orbit with the contacts of that run"
        )

    def check_missed(self, growth: float) -> None:
        """Refuse an orbit of which it misses its start, where a disturbance grows so much in a period."""
        allowed = VERIFIED * max(1.0, growth)
        if self.missed <= allowed:
            return
        k, off = self.first_other, ""
        if k is not None and k < len(self.log):
            later = self.phases[k] - self.expected.phases[k]
            words = f"event {k + 1} of it, {self._words(k)}, is {number_text(abs(later), 2)} rad of the excitation"
            off = f"; {words} {'later' if later > 0.0 else 'sooner'} than that of the orbit"
        raise DivergenceError(
            f"the orbit found is not confirmed: its own run misses its start by {number_text(self.missed, 2)} after "
            f"one period (in units of its length and of that times omega), above {number_text(allowed, 2)}{off}"
        )

    def _words(self, row: int) -> str:
        """Kind, pair, side and time of an event."""
        log, side = self.log, "+" if self.log.side[row] > 0 else "-"
        return f"{log.kind[row]} of {log.contacts[log.pair[row]]} on its {side} side at t = {log.time[row]:.6g} s"


def verified(system: System, excitation: Sine | PointForce, found: Solution) -> PeriodicOrbit:
    """The orbit of a solution of the equations.

    Raises `DivergenceError` if its own run meets other events, or does not end where it began.
    """
    run = own_run(system, excitation, found)
    run.check_events()
    orbit = orbit_of(system, excitation, found, run)
    run.check_missed(float(np.abs(orbit.multipliers[0])))
    return orbit


def orbit_of(system: System, excitation: Sine | PointForce, found: Solution, run: OwnRun) -> PeriodicOrbit:
    """The orbit of a solution, and of its own run with its impacts."""
    cycles, times = found.events.sequence.cycles, _times(found.events, excitation)
    # from t = 0 on; those at one instant to rounding as they follow one another
    first = int(np.argmax(np.roll(times, 1) - times))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # an event without speed has no finite saltation
        state, contact_state, monodromy = _at_start(excitation, found, times, first)
        half_map = _half_map(found, first)
    log = _log(system, found, times, first)
    return _made(
        PeriodicOrbit,
        system=system,
        excitation=excitation,
        cycles=cycles,
        state=state_of(system, state, 0.0),
        events=log,
        contact_state=contact_state.astype(np.int8),
        impacts=_impacts(run, log, excitation, cycles / excitation.frequency),
        monodromy=monodromy,
        half_map=half_map,
        residual=run.missed,
        length=found.length,
    )


def _times(events: EventStates, excitation: Sine | PointForce) -> Array:
    """Times (N,) of events within one period from t = 0 on, s."""
    period = events.sequence.cycles / excitation.frequency
    times = np.mod((events.phases - excitation.phase) / (2.0 * math.pi * excitation.frequency), period)
    near = np.minimum(times, period - times) <= AT_START * period
    return np.where(near, 0.0, times)


def _at_start(excitation: Sine | PointForce, found: Solution, times: Array, first: int) -> tuple[Array, Array, Array]:
    """State (2d,) and contact states at t = 0, before the first event or after it, and the monodromy there."""
    sequence, later, hybrid = found.events.sequence, np.roll(found.maps.steps, -1 - first, axis=0), found.hybrid
    if times[first] == 0.0:
        return found.events.states[first], sequence.contact_state[first], product(later)
    contact_state = sequence.contact_state[first - 1]
    flow, phase = hybrid.flow(contact_state), np.array([found.events.phases[first]])
    now = phase - times[first] * hybrid.omega
    before = now - (sequence.cycles / excitation.frequency - times[first - 1]) * hybrid.omega
    (state,), (onto,) = flow.carried(found.events.states[first - 1][None], before, now)
    _, (up_to,) = flow.carried(state[None], now, phase)
    return state, contact_state, onto @ product(later[:-1]) @ found.maps.saltation[first] @ up_to


def _half_map(found: Solution, first: int) -> Array | None:
    """Minus the derivative of the state half a period later by that after the first event, of a symmetric orbit."""
    hybrid, sequence = found.hybrid, found.events.sequence
    unit = state_unit(found.length, hybrid.omega, hybrid.mass.size)
    if not may_be_symmetric(hybrid, sequence) or asymmetry(found.events, unit) > SYMMETRIC:
        return None
    return -product(np.roll(found.maps.steps, -1 - first, axis=0)[: len(sequence.kind) // 2])


def _log(system: System, found: Solution, times: Array, first: int) -> EventLog:
    """The events of one period from t = 0 on; sections are none."""
    sequence = found.events.sequence
    order = np.roll(np.arange(times.size), -first)
    order = order[sequence.pair[order] >= 0]
    kind, d = np.array(sequence.kind)[order], found.events.states.shape[1] // 2
    return _made(
        EventLog,
        time=np.maximum.accumulate(times[order]),
        kind=kind,
        pair=sequence.pair[order],
        side=sequence.side[order].astype(np.int64),
        impacts=np.isin(kind, (IMPACT, SEPARATE)).astype(np.int64),
        contact_state=sequence.contact_state[order].astype(np.int8),
        displacement=found.events.states[order, :d],
        velocity=found.events.states[order, d:],
        contacts=tuple(pair.name for pair in system.contacts),
    )


def _impacts(run: OwnRun, log: EventLog, excitation: Sine | PointForce, period: float) -> Impacts:
    """The impacts of one period at the times of their events, from the table of its own run."""
    table: Any = run.impacts
    columns = {item.name: getattr(table, item.name) for item in fields(Impacts) if "axes" in item.metadata}
    names, touches = np.array(log.contacts), np.flatnonzero(np.isin(log.kind, (IMPACT, TOUCH)))
    omega, place = 2.0 * math.pi * excitation.frequency, np.full(len(table), len(log))
    columns["time"] = np.mod(table.time, period)
    for i, (time, name, side) in enumerate(zip(columns["time"].tolist(), table.impactor, table.side, strict=True)):
        own = touches[(names[log.pair[touches]] == name) & (log.side[touches] == side)]
        apart = np.abs(np.mod(log.time[own] - time + 0.5 * period, period) - 0.5 * period)
        if own.size and omega * apart.min() <= SAME_PHASE:
            # of an event at t = 0 the run's own time may be just before the end of the period
            place[i] = own[np.argmin(apart)]
            columns["time"][i] = log.time[place[i]]
    columns["phase"] = np.mod(omega * columns["time"] + excitation.phase, 2.0 * math.pi)
    order = np.lexsort((place, columns["time"]))
    return _made(Impacts, law=table.law, dropped=table.dropped, **{name: each[order] for name, each in columns.items()})


def _made(record: type[R], /, **values: Any) -> R:
    """A record whose arrays are only read: what is derived from them is kept."""
    for value in values.values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return made(record, **values)


# ---- the runs of orbits ------------------------------------------------------------------------------


def own_run(system: System, excitation: Sine | PointForce, found: Solution) -> OwnRun:
    """The run of the orbit of a solution, with its impacts.

    Raises `DivergenceError` if it is beyond a wall where it is to begin, or cannot be run.
    """
    state, phase, _ = found.motion.start()
    turned = np.array([math.sin(phase), math.cos(phase)])
    for j, pair in enumerate(system.contacts):
        for side in (1.0, -1.0) if pair.parameters.is_rigid else ():
            row, base, level = found.hybrid.condition((IMPACT, j, side))
            # that none of the events is at
            beyond = float(row @ state + base @ turned - level)
            if beyond > ROUNDED:
                place = side * (beyond + pair.gaps[0 if side > 0.0 else 1])
                where = f"between two events {pair.name} is at {place:.6g} m, beyond a wall"
                raise OtherMotionError(f"the orbit found is no motion of the system: {where}")
    try:
        return own_runs([system], excitation, [found], most_impacts=found.events.sequence.cycles * MOST_EVENTS)[0]
    except InputError as error:
        raise DivergenceError(f"the orbit found is not confirmed: {error}") from None


def own_runs(
    systems: Sequence[System],  # of each; one where they differ in gaps, contacts and the excitation alone
    excitation: Sine | PointForce,  # of one of them
    solutions: Sequence[Solution],  # of the same events
    most_impacts: int = 0,  # of one alone: what is kept of them
    place: str | None = None,  # whose peak is found; the default place where it is None
) -> list[OwnRun]:
    """Runs over one period of some orbits in one compiled call, each from where nothing is in contact, if it ever is.

    Raises `InputError` where one is driven at a resonance without damping.
    """
    hybrids, count = [each.hybrid for each in solutions], len(solutions)
    sequence, pairs = solutions[0].events.sequence, systems[0].contacts
    cycles = sequence.cycles
    method = EventDriven(samples_per_cycle=max(SAMPLES // cycles, EventDriven().samples_per_cycle))
    starts, phase, first = zip(*(one.motion.start() for one in solutions), strict=True)
    state, d = np.array(starts), hybrids[0].mass.size
    drives = [drive_of(each, excitation) for each in systems]
    store = FormStore(systems, drives, [_outputs(systems[0], drives[0], d, place)] * len(systems))
    inputs = Inputs(
        omega=np.array([hybrid.omega for hybrid in hybrids]),
        amplitude=np.array([[hybrid.drive] for hybrid in hybrids], dtype=complex),
        phase=np.array(phase),
        pieces=(),
        gaps=np.array([hybrid.gaps for hybrid in hybrids]),
        stiffness=np.array([hybrid.contact_stiffness for hybrid in hybrids]),
        damping=np.array([hybrid.contact_damping for hybrid in hybrids]),
        restitution=np.array([hybrid.restitution for hybrid in hybrids]),
        over_speed=speed_pieces([hybrid.over_speed for hybrid in hybrids], (count, len(systems[0].contacts))),
        is_sine=True,
        position=state[:, :d],
        velocity=state[:, d:],
        window=np.tile([0.0, np.inf], (count, 1)),
    )
    kept, samples = len(sequence.kind) + MORE_EVENTS, cycles * method.samples_per_cycle
    block = new_block(
        store, inputs, method, False if most_impacts else None,
        most_rows=most_impacts, most_events=kept, system_of=np.arange(count) if len(systems) > 1 else None,
    )  # fmt: skip

    def advance(begin: int) -> None:
        # one period of it
        values, statistics = np.zeros((count, samples, 1 + 2 * d)), no_cycles(count, cycles)
        first, none = np.full(count, begin, dtype=np.int64), np.zeros(count, dtype=np.int64)
        block.cases.sample[:] = begin
        block.grid = block.grid._replace(cycles=statistics, values=values, origin=first, cycle=none)
        run_block(block, first, first + samples, np.full(count, 10.0 * kept + samples))

    advance(0)
    units = np.array([state_unit(each.length, each.hybrid.omega, d) for each in solutions])
    missed = np.max(np.abs(block.grid.values[:, -1, 1:] - state) / units, axis=1)
    missed = np.where(block.stopped == core.events.DONE, missed, np.inf)
    table = np.moveaxis(block.grid.cycles[:, :, : len(CYCLE_COLUMNS)], (2, 1), (0, 1))
    motion = steady_motion(CycleStatistics(*table), np.full(count, cycles))
    # from t = 0 on
    begun = np.mod(inputs.phase - excitation.phase, 2.0 * math.pi * cycles) / inputs.omega
    names, logs = tuple(pair.name for pair in pairs), list[EventLog]()
    for rows, number in zip(block.tables.events, block.tables.logged.tolist(), strict=True):
        logs.append(event_log(rows, number, names))
    at_events = [each + omega * log.time for each, omega, log in zip(phase, inputs.omega, logs, strict=True)]
    logs = [changed(log, time=log.time + time) for log, time in zip(logs, begun, strict=True)]
    impacts = None
    if most_impacts and np.isfinite(missed[0]):
        # contacts that last at the end of the period end in the next one
        advance(samples)
        rows, number = block.tables.impacts, int(block.tables.number[0])
        rows = rows[: min(number, most_impacts)]
        rows = rows[(rows[:, 0] > 0.0) & (rows[:, 0] <= cycles / excitation.frequency)]
        rows[:, 0] += begun[0]
        impacts = impacts_of(systems[0], excitation, rows, rows.shape[0] + max(number - most_impacts, 0))
    read = missed.tolist(), motion.peak.tolist(), motion.first_harmonic.tolist(), [impacts] * count
    return list(map(OwnRun, [each.events for each in solutions], first, logs, at_events, *read))


def _outputs(system: System, drive: Drive, d: int, place: str | None) -> Outputs:
    """The displacement whose peak is found, then all coordinates and their rates."""
    channels = resolve_channels(system, (place or system.default_place,))
    first = outputs_alone(system, channel_rows(system, drive, channels, springs_apart=True), drive)
    pairs, nothing, each = len(system.contacts), np.zeros((d, d)), np.eye(d)
    return Outputs(
        np.concatenate([first.position, each, nothing]),
        np.concatenate([first.rate, nothing, each]),
        np.zeros((1 + 2 * d, pairs)),
        np.hstack([first.drive, np.zeros((first.drive.shape[0], 2 * d))]),
        np.zeros(1 + 2 * d),
    )
