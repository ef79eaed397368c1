"""One event-driven run: who rides, and when that changes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_reading import gather, keep_start, read_with, samples_of
from femimpact.integrators.event_state import EventRun, Ride, piece_of
from femimpact.integrators.flight_space import Riders
from femimpact.integrators.kernels import entries, events
from femimpact.integrators.kernels.crossing import Flight, Space
from femimpact.integrators.kernels.events import Samples
from femimpact.integrators.threads import Progress

__all__ = ["run_event_driven"]

SWITCHES_AT_ONCE = 200
"""Changes of riding at one instant beyond which the motion is called unresolved."""

SWITCHES_IN_CYCLE = 20_000
"""The same in one base cycle."""


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
    keep_start(run, position, velocity)
    done, piece = 0, piece_of(run)
    while done < samples:
        count = min(piece, samples - done)
        out = samples_of(run, done, count)
        run.contact.tally[1] = 0
        run.contact.tally[2] = run.method.most_events * max(count // run.method.samples_per_cycle, 1)
        flight, riders = _fly(run, flight, riders, out, (done + count) * run.interval)
        gather(run, out, done)
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
        trial, mark, before, spare = (Flight(*(np.array(a) for a in flight)) for _ in range(4))
        reader = read_with(run, riders, out)
        until = min(end, knot)
        status = events.run_events(
            space, flight, trial, mark, until, run.drive.amplitude, bool(riders), run.ledger, run.contact, reader,
            run.balance._replace(spare=spare),
        )  # fmt: skip
        _add_ride_impulses(run, riders, before, flight.clock[0] - before.clock[0])
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
    search = contact.search
    entries.measure(space.watch, flight, search.size, search.power[0])
    phase = _phase(space, flight.clock)
    entries.derivatives(pair, space.watch, flight, phase, search.size, search.power, search.found)
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
        np.zeros(closed.modes.exponent.size, dtype=complex),
    )


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
    closed, space = run.space(riders)
    wave = 1j * space.watch.omega
    summed = closed.modes.integral(start.entry, duration)
    for j, _ in riders:
        total = float(np.sum(space.watch.weight[j] * summed).real) + space.watch.constant[j] * duration
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
