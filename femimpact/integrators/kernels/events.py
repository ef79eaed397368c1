"""The loop over events: fly to the next one, collide, and note what happened."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.kernels.balance import Balance, book_flight, write_balance
from femimpact.integrators.kernels.compiling import called, compiled, inlined
from femimpact.integrators.kernels.crossing import (
    Flight,
    Space,
    copy_flight,
    derivatives,
    has_blocks,
    measure,
    move,
    move_particles,
    read_coordinates,
    unit_phase,
)
from femimpact.integrators.kernels.search import END, HIT, RELEASE, REST, STUCK, Search, look, next_event

__all__ = [
    "END", "HIT", "RELEASE", "REST", "STUCK", "Contact", "Samples", "collide_all", "comes_to_rest", "look_at_all",
    "run_events",
]  # fmt: skip

COLLISIONS_AT_ONCE = 100_000
"""Most collisions that one instant may take among several pairs."""


class Contact(NamedTuple):
    """Pairs and their impacts; R pairs."""

    search: Search
    restitution: NDArray[Any]  # (R,)
    closure: NDArray[Any]  # (1,) m
    impulse: NDArray[Any]  # (R,) scratch
    impacts: NDArray[Any]  # (most, 9 + n); see layout.IMPACT_COLUMNS, then the energy given to each mode
    totals: NDArray[Any]  # (6, R); see layout.TOTAL_COLUMNS
    window: NDArray[Any]  # (2,) s
    tally: NDArray[Any]  # (3,): impacts met, flights, most events in a call


class Samples(NamedTuple):
    """Grid on which the motion is read; O outputs."""

    interval: NDArray[Any]  # (1,) s
    done: NDArray[Any]  # (2,) samples taken since t = 0, samples in this piece
    weight: NDArray[Any]  # (O, K) complex
    particle: NDArray[Any]  # (O, P)
    particle_rate: NDArray[Any]  # (O, P)
    sine: NDArray[Any]  # (O,) complex
    constant: NDArray[Any]  # (O,)
    follow: NDArray[Any]  # (O,)
    follow_rate: NDArray[Any]  # (O,)
    values: NDArray[Any]  # (samples, O)
    kept: NDArray[Any]  # (samples,) number of the energy row that a sample fills, -1 for none
    shown: NDArray[Any]  # (samples,) number of the snapshot, -1 for none
    energy: NDArray[Any]  # (rows, 7 + n)
    fields: NDArray[Any]  # (snapshots, 2, d)


@inlined
def _write_outputs(i: int, space: Space, flight: Flight, phase: complex, out: Samples) -> None:
    clock = flight.clock
    for o in range(out.constant.size):
        value = out.constant[o] + (out.sine[o] * phase).real
        if space.watch.broken:
            value += out.follow[o] * clock[1] + out.follow_rate[o] * clock[2]
        for k in range(space.watch.exponent.size):
            value += out.weight[o, k].real * flight.entry[k].real - out.weight[o, k].imag * flight.entry[k].imag
        for p in range(flight.particle.size):
            value += out.particle[o, p] * flight.particle[p] + out.particle_rate[o, p] * flight.particle_rate[p]
        out.values[i, o] = value


@inlined
def _book(space: Space, mark: Flight, flight: Flight, amplitude: float, b: Balance) -> None:
    """Book work and losses since the mark, and set the mark here."""
    book_flight(space, mark, flight.clock[0] - mark.clock[0], amplitude, b)
    copy_flight(flight, mark)


@called
def _sample(
    space: Space, flight: Flight, mark: Flight, until: float, amplitude: float, out: Samples, b: Balance, ledger: bool
) -> None:
    """Read the motion at every grid time up to `until`; `flight` ends at the last of them."""
    dt, turned, phase = out.interval[0], False, complex(1.0, 0.0)
    turn = complex(math.cos(space.watch.omega * dt), math.sin(space.watch.omega * dt))
    while True:
        number, i = out.done[0] + 1, int(out.done[1])
        time = number * dt
        if time > until or i >= out.values.shape[0]:
            break
        # the turn from one sample to the next is a number for an entry that stands alone only
        if turned and not has_blocks(space.watch):
            for k in range(space.watch.exponent.size):
                flight.entry[k] *= space.turn[k]
            move_particles(space.watch, flight, time - flight.clock[0])
            phase *= turn
            flight.clock[0] = time
        else:
            move(space.watch, flight, time - flight.clock[0])
            flight.clock[0], turned = time, True
            phase = unit_phase(space.watch.omega, flight.clock)
        _write_outputs(i, space, flight, phase, out)
        if out.kept[i] >= 0 or out.shown[i] >= 0:
            _keep(space, flight, mark, phase, amplitude, out.kept[i], out.shown[i], out, b, ledger)
        out.done[0] = number
        out.done[1] = i + 1


@inlined
def _keep(
    space: Space, flight: Flight, mark: Flight, phase: complex, amplitude: float, row: int, snapshot: int, out: Samples,
    b: Balance, ledger: bool,
) -> None:  # fmt: skip
    """Energies and the whole motion at one sample."""
    if row >= 0 and ledger:
        _book(space, mark, flight, amplitude, b)
    read_coordinates(space, flight, phase, b.position, b.velocity)
    if row >= 0 and ledger:
        write_balance(b, out.energy[row])
        for m in range(b.loss_of_mode.size):
            out.energy[row, 7 + m] = b.loss_of_mode[m]
    if snapshot >= 0:
        for m in range(b.position.size):
            out.fields[snapshot, 0, m], out.fields[snapshot, 1, m] = b.position[m], b.velocity[m]


@inlined
def _write_impact(
    r: int, side: float, approach: float, impulse: float, space: Space, flight: Flight, c: Contact, b: Balance
) -> None:
    """Note one collision: the coordinates hold the state before it."""
    time, rebound = flight.clock[0], c.restitution[r] * approach
    loss = 0.5 * impulse * (approach - rebound)
    b.sums[1] += loss
    if c.window[0] <= time < c.window[1]:
        c.totals[0, r] += 1.0
        c.totals[1, r] += approach
        c.totals[2, r] = max(c.totals[2, r], approach)
        c.totals[3, r] += impulse
        c.totals[5, r] += impulse
    n = int(b.structure[0])
    row = c.tally[0]
    if row < c.impacts.shape[0]:
        out = c.impacts[row]
        # an impulse has no largest force and no duration
        out[0], out[1], out[2], out[3], out[4] = time, r, side, approach, rebound
        out[5], out[6], out[7], out[8] = impulse, math.nan, 0.0, loss
    for i in range(n):
        push = b.force[i, r] * side * impulse
        if row < c.impacts.shape[0]:
            c.impacts[row, 9 + i] = push * (b.velocity[i] + 0.5 * push / b.mass[i])
        b.velocity[i] += push / b.mass[i]
    c.tally[0] = row + 1


@called
def look_at_all(space: Space, flight: Flight, c: Contact) -> None:
    """Find which pairs are at a wall, and their rates."""
    phase = unit_phase(space.watch.omega, flight.clock)
    measure(space.watch, flight, c.search.size, c.search.power[0])
    for r in range(space.watch.upper.size):
        look(r, space.watch, flight, space.watch.size.size, phase, 1.0, c.search)


@called
def collide_all(space: Space, flight: Flight, c: Contact, b: Balance) -> bool:
    """Collide every pair at its wall that approaches it, the fastest first, until none does; see `look_at_all`.

    The rule for simultaneous impacts: one after another at the same instant, each with its own
    restitution. For e = 1 and equal masses in a row it is Newton's cradle.
    """
    phase = unit_phase(space.watch.omega, flight.clock)
    read_coordinates(space, flight, phase, b.position, b.velocity)
    pairs, largest = space.watch.upper.size, 0.0
    for r in range(pairs):
        c.impulse[r] = 0.0
        if c.search.at_wall[r] != 0.0:
            largest = max(largest, c.search.at_wall[r] * c.search.rate[r])
    # what is left of the approach after so many collisions is rounding
    least = 1e-14 * largest
    for _ in range(COLLISIONS_AT_ONCE):
        fastest, hit = least, -1
        for r in range(pairs):
            if c.search.at_wall[r] != 0.0 and c.search.at_wall[r] * c.search.rate[r] > fastest:
                fastest, hit = c.search.at_wall[r] * c.search.rate[r], r
        if hit < 0:
            break
        side = c.search.at_wall[hit]
        impulse = (1.0 + c.restitution[hit]) * fastest / -space.mobility[hit, hit]
        _write_impact(hit, side, fastest, impulse, space, flight, c, b)
        c.impulse[hit] += side * impulse
        c.search.leaving[hit] = 0.0
        for r in range(pairs):
            c.search.rate[r] += space.mobility[r, hit] * side * impulse
    else:
        return False
    _kick(space, flight, c)
    return True


@inlined
def _kick(space: Space, flight: Flight, c: Contact) -> None:
    for r in range(c.impulse.size):
        if c.impulse[r] == 0.0:
            continue
        for k in range(space.watch.exponent.size):
            flight.entry[k] += space.kick[k, r] * c.impulse[r]
        for i in range(flight.particle.size):
            flight.particle_rate[i] += space.particle_kick[i, r] * c.impulse[r]


@inlined
def _mark_capture(r: int, capture: float, rebound: float, c: Contact) -> None:
    """The last impact of a captured pair ends without rebound."""
    for row in range(min(c.tally[0], c.impacts.shape[0]) - 1, -1, -1):
        if c.impacts[row, 1] == r:
            c.impacts[row, 4] = 0.0
            c.impacts[row, 5] -= capture
            c.impacts[row, 8] += 0.5 * capture * rebound
            return


@called
def comes_to_rest(space: Space, flight: Flight, c: Contact, b: Balance) -> bool:
    """Whether a pair that just collided bounces no higher than the closure: then it is captured.

    Under a pressing acceleration a the bounces to come last 2 v/(a (1 - e)) and stay below v^2/(2 a).
    """
    phase = unit_phase(space.watch.omega, flight.clock)
    measure(space.watch, flight, c.search.size, c.search.power[0])
    for r in range(c.impulse.size):
        if c.impulse[r] == 0.0:
            continue
        side, e = c.search.at_wall[r], c.restitution[r]
        rebound = -side * c.search.rate[r]
        derivatives(r, space.watch, flight, phase, c.search.size, c.search.power, c.search.found)
        press, steepest = side * c.search.found[0], c.search.found[3]
        if press <= 1e-12 * c.search.found[2] or rebound * rebound > 2.0 * press * c.closure[0]:
            continue
        lasting = 2.0 * max(rebound, 0.0) / (press * (1.0 - e)) if e < 1.0 else 2.0 * rebound / press
        # and the press must last until the bounces are over
        if steepest * lasting > 0.5 * press:
            continue
        for i in range(c.impulse.size):
            c.impulse[i] = 0.0
        capture = rebound / -space.mobility[r, r]
        c.impulse[r] = -side * capture
        _kick(space, flight, c)
        b.sums[1] += 0.5 * capture * rebound
        _mark_capture(r, capture, rebound, c)
        c.search.event[0], c.search.event[1], c.search.event[2] = r, side, flight.clock[0] + lasting
        return True
    return False


@compiled
def run_events(
    space: Space, flight: Flight, trial: Flight, mark: Flight, until: float, amplitude: float, riding: bool,
    ledger: bool, c: Contact, out: Samples, b: Balance,
) -> int:  # fmt: skip
    """Fly, sample and collide up to `until`, or to an event that changes who rides."""
    while True:
        copy_flight(flight, trial)
        status = next_event(space.watch, trial, until, c.search)
        _sample(space, flight, mark, trial.clock[0], amplitude, out, b, ledger)
        copy_flight(trial, flight)
        if ledger:
            _book(space, mark, flight, amplitude, b)
        if status != HIT:
            if status == REST:
                c.search.event[2] = flight.clock[0]
            return status
        if riding:
            return HIT
        pair, side = int(c.search.event[0]), c.search.event[1]
        look_at_all(space, flight, c)
        c.search.at_wall[pair] = side
        if not collide_all(space, flight, c, b):
            return STUCK
        c.tally[1] += 1
        resting = comes_to_rest(space, flight, c, b)
        copy_flight(flight, mark)
        if resting:
            return REST
        if c.tally[1] >= c.tally[2]:
            return STUCK
