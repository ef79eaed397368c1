"""One event-driven run: who rides, when that changes, and what is read on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_driven import EventDriven, Outputs, force_directions, new_search, space_of
from femimpact.integrators.flight_space import FlightSpace, Riders, flight_space
from femimpact.integrators.kernels import entries, events
from femimpact.integrators.kernels.balance import Balance
from femimpact.integrators.kernels.crossing import Flight, Space
from femimpact.integrators.kernels.events import Contact, Samples
from femimpact.integrators.layout import CYCLE_COLUMNS, ENERGY_COLUMNS, IMPACT_COLUMNS
from femimpact.integrators.threads import Progress
from femimpact.system import System

__all__ = ["EventRun", "Keep", "Ride", "kept_rows", "new_run", "piece_of", "run_event_driven"]

CYCLES_AT_ONCE = 256
"""Base cycles between two looks at progress and interrupts."""

SWITCHES_AT_ONCE = 200
"""Changes of riding at one instant beyond which the motion is called unresolved."""

SWITCHES_IN_CYCLE = 20_000
"""The same in one base cycle."""


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
    """Working state and results of one run; arrays grow by pieces."""

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
    )
    contact = Contact(
        search=new_search(pairs, most),
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


def run_event_driven(
    run: EventRun, position: NDArray[Any], velocity: NDArray[Any], samples: int, progress: Progress | None = None,
    after_piece: Callable[[], None] | None = None,
) -> None:  # fmt: skip
    """Fly from the given coordinates at t = 0 to the last sample.

    Parameters
    ----------
    run : EventRun
        Filled with what is kept.
    position, velocity : ndarray (d,)
        Structure and balls relative to the base, m and m/s.
    samples : int
    progress : callable, optional
    after_piece : callable, optional
        Called when another piece of the history is complete.

    Raises
    ------
    DivergenceError
        If more events happen than the method allows, or riding cannot be decided.
    """
    riders: Riders = ()
    clock = np.array([0.0, 0.0, 0.0, run.drive.phase])
    _set_drive(run.drive, clock, 0)
    flight = _flight_from(run, riders, position, velocity, clock)
    _keep_start(run, flight, position, velocity)
    done, piece = 0, piece_of(run)
    while done < samples:
        count = min(piece, samples - done)
        out = _samples(run, done, count)
        run.contact.tally[1] = 0
        run.contact.tally[2] = run.method.most_events * max(count // run.method.samples_per_cycle, 1)
        flight, riders = _fly(run, flight, riders, out, (done + count) * run.interval)
        _gather(run, out, done)
        done += count
        if after_piece is not None:
            after_piece()
        if progress is not None:
            progress(done / samples)
    for pair, (side, start, impulse) in sorted(run.open_rides.items()):
        run.rides.append(Ride(pair, side, start, math.nan, impulse))


def _fly(run: EventRun, flight: Flight, riders: Riders, out: Samples, end: float) -> tuple[Flight, Riders]:
    """Through all events of one piece; the outputs' rows change with who rides."""
    knot = _next_knot(run.drive, flight.clock[0])
    last, repeated, switches, counted = -1.0, 0, 0, -1
    while True:
        space = run.space(riders)[1]
        spare, mark = _copies(flight)
        reader = _reader(run, riders, out)
        began = flight.clock[0]
        before = [np.array(values) for values in (flight.entry, flight.particle, flight.particle_rate, flight.clock)]
        until = min(end, knot)
        status = events.run_events(
            space, flight, spare, mark, until, run.drive.amplitude, bool(riders), run.ledger, run.contact, reader,
            run.balance,
        )  # fmt: skip
        _add_ride_impulses(run, riders, Flight(*before), flight.clock[0] - began)
        if status == events.END:
            if until >= end:
                return flight, riders
            _turn_knot(run, space, flight, knot)
            knot = _next_knot(run.drive, knot)
            continue
        repeated = repeated + 1 if flight.clock[0] <= last else 0
        last = flight.clock[0]
        cycle = math.floor(last / (run.interval * run.method.samples_per_cycle))
        switches, counted = (switches + 1, cycle) if cycle == counted else (0, cycle)
        if status == events.STUCK or repeated > SWITCHES_AT_ONCE or switches > SWITCHES_IN_CYCLE:
            raise DivergenceError(_stuck_message(run, flight.clock[0]))
        flight, riders = _change(run, flight, riders, status)


def _change(run: EventRun, flight: Flight, riders: Riders, status: int) -> tuple[Flight, Riders]:
    """Who rides after an event, and the same motion in that closed form."""
    pair, side = int(run.contact.search.event[0]), int(run.contact.search.event[1])
    position, velocity = _coordinates(run, riders, flight)
    run.contact.search.leaving[:] = 0.0
    if status == events.REST:
        # an accumulation of impacts ends a moment after the last one that is followed
        run.open_rides[pair] = (side, float(run.contact.search.event[2]), 0.0)
        after: Riders = tuple(sorted((*riders, (pair, side))))
    elif status == events.RELEASE:
        run.contact.search.leaving[pair] = dict(riders)[pair]
        after = tuple(rider for rider in riders if rider[0] != pair)
        _close_ride(run, pair, float(flight.clock[0]))
    elif riders and _comes_to_rest_too(run, flight, riders, pair, side):
        after = tuple(sorted((*riders, (pair, side))))
        velocity = _captured(run, after, position, velocity, flight.clock)
        status = events.REST
    else:
        # an impact elsewhere passes through riders as an impact of its own: they are let go
        after = ()
    moved = _flight_from(run, after, position, velocity, flight.clock)
    if status != events.HIT:
        return moved, after
    space = run.space(())[1]
    entries.look_at_all(space, moved, run.contact)
    for j, own in (*riders, (pair, side)):
        run.contact.search.at_wall[j] = own
    for j, _ in riders:
        _close_ride(run, j, float(flight.clock[0]))
    if not entries.collide_all(space, moved, run.contact, run.balance):
        raise DivergenceError(_stuck_message(run, flight.clock[0]))
    if entries.comes_to_rest(space, moved, run.contact, run.balance):
        return _change(run, moved, (), events.REST)
    return moved, ()


def _comes_to_rest_too(run: EventRun, flight: Flight, riders: Riders, pair: int, side: int) -> bool:
    """Whether a pair that hits its wall while others ride bounces no higher than the closure.

    What presses it there is decided with the riders in place: without their forces it may seem to leave.
    """
    space, contact = run.space(riders)[1], run.contact
    entries.derivatives(pair, space.watch, flight, _phase(space, flight.clock), contact.search.found)
    press, e = side * float(contact.search.found[0]), float(contact.restitution[pair])
    rebound = e * side * float(contact.search.rate[pair])
    if press <= 1e-12 * contact.search.found[2] or rebound**2 > 2.0 * press * run.method.closure:
        return False
    lasting = 2.0 * rebound / (press * (1.0 - e)) if e < 1.0 else 2.0 * rebound / press
    run.open_rides[pair] = (side, float(flight.clock[0]) + lasting, 0.0)
    return True


def _captured(
    run: EventRun, riders: Riders, position: NDArray[Any], velocity: NDArray[Any], clock: NDArray[Any]
) -> NDArray[Any]:
    """Velocities after the impulses that make all these pairs ride at once; the energy that goes is booked."""
    moved = _flight_from(run, riders, position, velocity, clock)
    after = _coordinates(run, riders, moved)[1]
    run.balance.sums[1] += 0.5 * float(run.balance.mass @ (velocity**2 - after**2))
    return after


def _coordinates(run: EventRun, riders: Riders, flight: Flight) -> tuple[NDArray[Any], NDArray[Any]]:
    space = run.space(riders)[1]
    position, velocity = np.zeros_like(run.balance.position), np.zeros_like(run.balance.velocity)
    entries.read_coordinates(space, flight, _phase(space, flight.clock), position, velocity)
    return position, velocity


def _phase(space: Space, clock: NDArray[Any]) -> complex:
    theta = space.watch.omega * clock[0] + clock[3]
    return complex(math.cos(theta), math.sin(theta))


def _flight_from(
    run: EventRun, riders: Riders, position: NDArray[Any], velocity: NDArray[Any], clock: NDArray[Any]
) -> Flight:
    """The homogeneous part and the particles of a motion given by its coordinates."""
    closed, space = run.space(riders)
    turned = space.shape_sine * _phase(space, clock)
    p = position - space.shape_constant - turned.real
    v = velocity - (1j * space.watch.omega * turned).real
    if space.watch.broken:
        p = p - space.shape_follow * clock[1] - space.shape_follow_rate * clock[2]
        v = v - space.shape_follow * clock[2]
    return Flight(
        np.ascontiguousarray(closed.to_entry_u @ p + closed.to_entry_v @ v, dtype=complex),
        np.ascontiguousarray(closed.to_particle @ p),
        np.ascontiguousarray(closed.to_particle @ v),
        np.array(clock),
    )


def _copies(flight: Flight) -> tuple[Flight, Flight]:
    return Flight(*(np.array(a) for a in flight)), Flight(*(np.array(a) for a in flight))


# ---- a broken-line drive --------------------------------------------------------------------------


def _next_knot(drive: Drive, time: float) -> float:
    if drive.samples is None:
        return math.inf
    index = math.floor(time / drive.interval + 1e-9) + 1
    return index * drive.interval if index < drive.samples.size else math.inf


def _set_drive(drive: Drive, clock: NDArray[Any], index: int) -> None:
    """Value and slope of s(t) from a knot on."""
    if drive.samples is None:
        return
    last = index >= drive.samples.size - 1
    clock[1] = 0.0 if last else drive.samples[index]
    clock[2] = 0.0 if last else (drive.samples[index + 1] - drive.samples[index]) / drive.interval


def _turn_knot(run: EventRun, space: Space, flight: Flight, knot: float) -> None:
    """A new straight piece: the steady answer changes, and what it changes by is flown off."""
    before = flight.clock.copy()
    _set_drive(run.drive, flight.clock, round(knot / run.drive.interval))
    value, slope = flight.clock[1:3] - before[1:3]
    flight.entry[:] += space.jump_value * value + space.jump_slope * slope


# ---- riding ---------------------------------------------------------------------------------------


def _add_ride_impulses(run: EventRun, riders: Riders, start: Flight, duration: float) -> None:
    """Add the integral of every rider's contact force over a flight to its open ride."""
    if duration <= 0.0 or not riders:
        return
    space = run.space(riders)[1]
    mu, wave = space.watch.exponent, 1j * space.watch.omega
    for j, _ in riders:
        safe = np.where(mu == 0.0, 1.0, mu)
        grown = np.where(mu == 0.0, duration, np.expm1(mu * duration) / safe)
        total = float(np.sum(space.watch.weight[j] * start.entry * grown).real) + space.watch.constant[j] * duration
        if space.watch.broken:
            s = start.clock[1] * duration + 0.5 * start.clock[2] * duration**2
            total += space.watch.follow[j] * s + space.watch.follow_rate[j] * start.clock[2] * duration
        else:
            turned = space.watch.sine[j] * _phase(space, start.clock)
            total += float((turned * np.expm1(wave * duration) / wave).real)
        side, began, impulse = run.open_rides[j]
        run.open_rides[j] = (side, began, impulse + total)
        first, last = run.contact.window
        if first <= start.clock[0] < last:
            run.contact.totals[5, j] += total


def _close_ride(run: EventRun, pair: int, time: float) -> None:
    side, start, impulse = run.open_rides.pop(pair)
    before = run.rides[-1] if run.rides else None
    if before is not None and (before.pair, before.side) == (pair, side) and before.end >= start:
        # let go by an impact elsewhere and at once at rest again: one riding state
        run.rides[-1] = Ride(pair, side, before.start, time, before.impulse + impulse)
    elif time > start:
        run.rides.append(Ride(pair, side, start, time, impulse))


def _stuck_message(run: EventRun, time: float) -> str:
    return (
        f"impacts and riding at t = {time:.6g} s do not resolve within {run.method.most_events} events a cycle: "
        f"raise closure ({run.method.closure:g} m) or most_events, or check gaps that leave no clearance"
    )


# ---- what is read ---------------------------------------------------------------------------------


def piece_of(run: EventRun) -> int:
    """Samples between two looks at progress: whole cycles, and no more than a sink wants at once if it can be."""
    per_cycle = run.method.samples_per_cycle
    fitting = max(run.piece_samples * max(run.keep.every, 1) // per_cycle, 1) if run.piece_samples else CYCLES_AT_ONCE
    return min(CYCLES_AT_ONCE, fitting) * per_cycle


def kept_rows(run: EventRun, done: int, count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Row of the history and of the snapshots that each sample of a piece fills, -1 for none."""
    number = done + 1 + np.arange(count)

    def rows(every: int, first: int) -> NDArray[Any]:
        due = (number >= first) & ((number - first) % max(every, 1) == 0) & (every > 0)
        return np.where(due, np.cumsum(due) - 1, -1)

    keep = run.keep
    return rows(keep.every, keep.first), rows(keep.snapshots, keep.first_snapshot)


def _samples(run: EventRun, done: int, count: int) -> Samples:
    """Arrays of one piece; which of its samples are kept and shown."""
    n, d = run.system.dofs, run.balance.mass.size
    kept, shown = kept_rows(run, done, count)
    outputs = len(run.outputs.force)
    nothing = np.zeros((outputs, 0))
    return Samples(
        interval=np.array([run.interval]),
        done=np.array([done, 0], dtype=np.int64),
        weight=nothing.astype(complex),
        particle=nothing,
        particle_rate=nothing,
        sine=np.zeros(outputs, dtype=complex),
        constant=np.zeros(outputs),
        follow=np.zeros(outputs),
        follow_rate=np.zeros(outputs),
        values=np.zeros((count, outputs)),
        kept=kept,
        shown=shown,
        energy=np.zeros(((int(kept.max()) + 1) if run.ledger else 0, len(ENERGY_COLUMNS) + n)),
        fields=np.zeros((int(shown.max()) + 1, 2, d)),
    )


def _reader(run: EventRun, riders: Riders, out: Samples) -> Samples:
    """The piece's arrays with the output rows of who rides now."""
    closed, space = run.space(riders)
    position, rate = run.outputs.position, run.outputs.rate
    weight = position @ space.shape + rate @ (space.shape * space.watch.exponent)
    sine = position @ space.shape_sine + 1j * space.watch.omega * (rate @ space.shape_sine)
    constant, follow = position @ space.shape_constant, position @ space.shape_follow
    follow_rate = position @ space.shape_follow_rate + rate @ space.shape_follow
    number = {pair: i for i, (pair, _) in enumerate(riders)}
    for o, pair in enumerate(run.outputs.force):
        if pair in number:
            i, wave = number[pair], complex(0.0, -run.drive.amplitude)
            weight[o], sine[o] = closed.force_shape[i], closed.force_harmonic[i] * wave
            constant[o], follow[o] = closed.force_static[i], closed.force_follow[i]
            follow_rate[o] = closed.force_follow_rate[i]
    return out._replace(
        weight=np.ascontiguousarray(weight, dtype=complex),
        particle=np.ascontiguousarray(position @ space.particle_shape),
        particle_rate=np.ascontiguousarray(rate @ space.particle_shape),
        sine=np.ascontiguousarray(sine, dtype=complex),
        constant=constant,
        follow=follow,
        follow_rate=follow_rate,
    )


def _keep_start(run: EventRun, flight: Flight, position: NDArray[Any], velocity: NDArray[Any]) -> None:
    """The state at t = 0 where it is asked for."""
    if run.keep.every and run.keep.first == 0:
        rows = run.outputs
        run.samples.append((rows.position @ position + rows.rate @ velocity)[None, :])
        if run.ledger:
            run.balance.position[:], run.balance.velocity[:] = position, velocity
            energy = np.zeros((1, len(ENERGY_COLUMNS) + run.system.dofs))
            entries.write_balance(run.balance, energy[0])
            run.energy.append(energy)
    if run.keep.snapshots and run.keep.first_snapshot == 0:
        run.fields.append(np.array([[position, velocity]]))


def _gather(run: EventRun, out: Samples, done: int) -> None:
    """Statistics of the piece's whole cycles, and the samples that are kept."""
    per_cycle = run.method.samples_per_cycle
    whole = out.values.shape[0] // per_cycle
    w = out.values[: whole * per_cycle, 0].reshape(whole, per_cycle)
    theta = run.drive.phase + 2.0 * np.pi * (np.arange(per_cycle) + 1) / per_cycle
    columns = (_crests(w), -_crests(-w), (w**2).sum(axis=1), w @ np.sin(theta), w @ np.cos(theta))
    table = np.stack([*columns, np.full(whole, float(per_cycle))], axis=1)
    run.cycles.append(table.reshape(whole, len(CYCLE_COLUMNS)))
    run.samples.append(out.values[out.kept >= 0])
    run.energy.append(out.energy)
    run.fields.append(out.fields)


def _crests(w: NDArray[Any]) -> NDArray[Any]:
    """Largest value of every row, by the parabola through the largest sample and its neighbours."""
    if w.shape[0] == 0:
        return np.zeros(0)
    i = np.clip(np.argmax(w, axis=1), 1, w.shape[1] - 2)
    row = np.arange(w.shape[0])
    before, at, after = w[row, i - 1], w[row, i], w[row, i + 1]
    bend = np.minimum(before + after - 2.0 * at, -1e-300)
    crest = at - 0.125 * (after - before) ** 2 / bend
    inside = np.abs(after - before) <= -2.0 * bend
    return np.asarray(np.where(inside & (at >= before) & (at >= after), crest, w.max(axis=1)))
