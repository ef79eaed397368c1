"""Flight from case to case through compliant contacts: between two changes of contact every state is linear.

A pair is free, in contact with one of its walls, or rebounds from it: beyond the gap still, but without
force, since a contact does not pull. What is watched of it follows from that: its way x to both walls, its
force F = k x + c x', or both.
"""

from __future__ import annotations

import cmath
import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.kernels.books import (
    APPROACH,
    DURATION,
    IMPULSE,
    PEAK,
    START,
    Books,
    book_flight,
    integral,
    keep_books,
    open_books,
    write_impact,
)
from femimpact.integrators.kernels.compiling import called, compiled, inlined
from femimpact.integrators.kernels.crossing import (
    NODES,
    WEIGHTS,
    Flight,
    Watch,
    copy_flight,
    has_blocks,
    move,
    move_particles,
    multiply,
    panels_of,
    unit_phase,
)
from femimpact.integrators.kernels.forms import CONTACT, FREE, REBOUND, Forms, Waves, enter_state, read_state
from femimpact.integrators.kernels.search import END, REST, STUCK, Search, next_event

__all__ = ["Journey", "Reading", "fly_cases"]

PROBES = 16
"""Instants of a contact at which its force is looked at for the largest, which is then refined."""

CHANGES_AT_ONCE = 200
"""Changes of contact at one instant beyond which the motion is called unresolved."""


class Reading(NamedTuple):
    """What is read on a grid of times."""

    interval: NDArray[Any]  # (cases,) s
    weight: NDArray[Any]  # (S, O, K) complex
    particle: NDArray[Any]  # (S, O, P)
    particle_rate: NDArray[Any]  # (S, O, P)
    constant: NDArray[Any]  # (S, O)
    sine: NDArray[Any]  # (cases, S, O) complex
    values: NDArray[Any]  # (cases, samples, O), or (cases, 0, O) where only cycles are wanted
    origin: NDArray[Any]  # (cases,) sample with which the first cycle begins
    last: NDArray[Any]  # (cases, 2) the observed place and its rate at the sample before
    per_cycle: int  # samples
    cycles: NDArray[Any]  # (cases, cycles, 6) of output 0, whose rate is output 1; see layout.CYCLE_COLUMNS


class Journey(NamedTuple):
    """Where every case is."""

    entry: NDArray[Any]  # (cases, K) complex
    particle: NDArray[Any]  # (cases, P)
    particle_rate: NDArray[Any]  # (cases, P)
    clock: NDArray[Any]  # (cases, 4): see Flight
    mode: NDArray[Any]  # (cases, R) what each pair does, times the side of its wall
    tally: NDArray[Any]  # (cases, 3): samples taken since t = 0, changes of contact, impacts
    window: NDArray[Any]  # (cases, 2) s
    totals: NDArray[Any]  # (cases, 6, R); see layout.TOTAL_COLUMNS
    touch: NDArray[Any]  # (cases, 6, R): START, APPROACH, IMPULSE, PEAK, DURATION, LOSS of open contacts
    state: NDArray[Any]  # (2, d) scratch: displacements and velocities
    turn: NDArray[Any]  # (2, K + 1) complex scratch


@inlined
def _watch(c: int, number: int, forms: Forms, waves: Waves, limits: NDArray[Any]) -> Watch:
    """Watched scalars of one case in one state."""
    return Watch(
        forms.exponent[number], forms.coupling[number], forms.blocks[number], forms.size[number], waves.omega[c], False,
        forms.particle_given[number], limits[3], limits[2], limits[0], limits[1], forms.weight[number],
        forms.weight_size[number], forms.particle_weight[number], forms.particle_rate_weight[number],
        waves.sine[c, number], forms.constant[number], limits[3], limits[3],
    )  # fmt: skip


@inlined
def _state_number(mode: NDArray[Any]) -> int:
    """Number of the state of contact: one digit of base 3 for each pair."""
    number, digit = 0, 1
    for j in range(mode.size):
        if abs(mode[j]) == CONTACT:
            number += digit if mode[j] > 0.0 else 2 * digit
        digit *= 3
    return number


@inlined
def _set_limits(mode: NDArray[Any], forms: Forms, limits: NDArray[Any]) -> None:
    """Bounds of the watched scalars: upper, lower, and the side of a contact that lasts."""
    pairs = mode.size
    for j in range(pairs):
        side = 1.0 if mode[j] > 0.0 else -1.0
        gap = side * forms.gap[0 if side > 0.0 else 1, j]
        for r in (j, pairs + j):
            limits[0, r], limits[1, r], limits[2, r] = math.inf, -math.inf, 0.0
        if mode[j] == FREE:
            limits[0, j], limits[1, j] = forms.gap[0, j], -forms.gap[1, j]
        elif abs(mode[j]) == CONTACT:
            # the force of the wall ends where k x + c x' is that of the gap
            limits[1 if side > 0.0 else 0, pairs + j] = forms.stiffness[j] * gap
            limits[2, pairs + j] = side
        else:
            limits[1 if side > 0.0 else 0, j] = gap
            limits[0 if side > 0.0 else 1, pairs + j] = forms.stiffness[j] * gap


@inlined
def _book_contact(
    c: int,
    j: int,
    watch: Watch,
    side: float,
    wall: float,
    flight: Flight,
    duration: float,
    way: Journey,
    search: Search,
    wanted: bool,
) -> None:
    """Add impulse and largest force of one flight in contact with a wall; `wall` is the force at the gap."""
    if has_blocks(watch):
        _sum_contact_over_nodes(c, j, watch, side, wall, flight, duration, way, search)
        return
    r = way.mode.shape[1] + j
    wave = complex(0.0, watch.omega)
    turned = watch.sine[r] * unit_phase(watch.omega, flight.clock)
    offset = side * watch.constant[r] - wall
    impulse = offset * duration + side * (turned * integral(wave, duration)).real
    for k in range(watch.exponent.size):
        impulse += side * (watch.weight[r, k] * flight.entry[k] * integral(watch.exponent[k], duration)).real
    way.touch[c, IMPULSE, j] += impulse
    way.touch[c, DURATION, j] += duration
    inside = way.window[c, 0] <= flight.clock[0] < way.window[c, 1]
    if inside:
        way.totals[c, 5, j] += impulse
    elif not wanted:
        return
    best, largest = 0.0, 0.0
    # the last place in a row of probes is that of the sine
    last = watch.exponent.size
    for k in range(last + 1):
        e = watch.exponent[k] if k < last else wave
        way.turn[0, k] = cmath.exp(e * (duration / PROBES))
        way.turn[1, k] = watch.weight[r, k] * flight.entry[k] if k < last else turned
    for probe in range(PROBES + 1):
        force = offset
        for k in range(last + 1):
            force += side * way.turn[1, k].real
            way.turn[1, k] *= way.turn[0, k]
        if force > largest:
            largest, best = force, probe * duration / PROBES
    for _ in range(2):
        force, slope, bend, twist = offset, 0.0, 0.0, 0.0
        for k in range(last + 1):
            e = watch.exponent[k] if k < last else wave
            term = side * (watch.weight[r, k] * flight.entry[k] if k < last else turned) * cmath.exp(e * best)
            force += term.real
            slope += (e * term).real
            bend += (e * e * term).real
            twist += (e * e * e * term).real
        largest = max(largest, force)
        if bend >= 0.0:
            break
        near = -slope / bend
        best = min(max(best - slope / (bend + 0.5 * twist * near), 0.0), duration)
    way.touch[c, PEAK, j] = max(way.touch[c, PEAK, j], largest)
    if inside:
        way.totals[c, 4, j] = max(way.totals[c, 4, j], largest)


@called
def _sum_contact_over_nodes(
    c: int, j: int, watch: Watch, side: float, wall: float, flight: Flight, duration: float, way: Journey,
    search: Search,
) -> None:  # fmt: skip
    """The same where entries do not stand alone: by Gauss points, and Newton's method from the largest of them."""
    r, spare, rate = way.mode.shape[1] + j, search.spare, search.power
    copy_flight(flight, spare)
    panels = panels_of(watch, flight, duration)
    half, start, impulse, best = 0.5 * duration / panels, flight.clock[0], 0.0, 0.0
    offset = side * watch.constant[r] - wall
    # a dashpot pushes most at the touch, before any of the points
    largest = offset + side * (watch.sine[r] * unit_phase(watch.omega, spare.clock)).real
    for k in range(watch.exponent.size):
        largest += side * (watch.weight[r, k] * spare.entry[k]).real
    for panel in range(panels):
        for node in range(len(NODES)):
            time = start + half * (2 * panel + 1 + NODES[node])
            move(watch, spare, time - spare.clock[0])
            force = offset + side * (watch.sine[r] * unit_phase(watch.omega, spare.clock)).real
            for k in range(watch.exponent.size):
                force += side * (watch.weight[r, k] * spare.entry[k]).real
            impulse += half * WEIGHTS[node] * force
            if force > largest:
                largest, best = force, time - start
    for _ in range(3):
        copy_flight(flight, spare)
        move(watch, spare, best)
        multiply(watch, spare.entry, rate[1])
        multiply(watch, rate[1], rate[2])
        turned = side * watch.sine[r] * unit_phase(watch.omega, spare.clock)
        force, slope, bend = offset + turned.real, -watch.omega * turned.imag, -(watch.omega**2) * turned.real
        for k in range(watch.exponent.size):
            force += side * (watch.weight[r, k] * spare.entry[k]).real
            slope += side * (watch.weight[r, k] * rate[1, k]).real
            bend += side * (watch.weight[r, k] * rate[2, k]).real
        largest = max(largest, force)
        if bend >= 0.0:
            break
        best = min(max(best - slope / bend, 0.0), duration)
    way.touch[c, IMPULSE, j] += impulse
    way.touch[c, DURATION, j] += duration
    way.touch[c, PEAK, j] = max(way.touch[c, PEAK, j], largest)
    if way.window[c, 0] <= start < way.window[c, 1]:
        way.totals[c, 4, j] = max(way.totals[c, 4, j], largest)
        way.totals[c, 5, j] += impulse


@inlined
def _add_to_cycle(c: int, sample: int, w: float, rate: float, phase: complex, reading: Reading) -> None:
    """Statistics of the cycle that a sample belongs to."""
    before, rate_before, h = reading.last[c, 0], reading.last[c, 1], reading.interval[c]
    reading.last[c, 0], reading.last[c, 1] = w, rate
    number = (sample - 1 - reading.origin[c]) // reading.per_cycle
    if number < 0 or number >= reading.cycles.shape[1]:
        return
    row = reading.cycles[c, number]
    if row[5] == 0.0:
        row[0] = row[1] = w
    high, low = max(w, before), min(w, before)
    if rate_before * rate < 0.0:
        # the crest of the cubic through both samples with their rates
        mean = (w - before) / h
        bend, twist = (3.0 * mean - 2.0 * rate_before - rate) / h, (rate_before + rate - 2.0 * mean) / (h * h)
        root = math.sqrt(max(bend * bend - 3.0 * twist * rate_before, 0.0))
        root = root - bend if rate_before > 0.0 else -root - bend
        time = min(max(rate_before / root, 0.0), h) if root != 0.0 else 0.0
        crest = before + time * (rate_before + time * (bend + time * twist))
        high, low = max(high, crest), min(low, crest)
    row[0], row[1] = max(row[0], high), min(row[1], low)
    row[2] += w * w
    row[3] += w * phase.imag
    row[4] += w * phase.real
    row[5] += 1.0


@inlined
def _read(
    c: int, number: int, first: int, until: float, watch: Watch, reading: Reading, flight: Flight, mark: Flight,
    way: Journey, forms: Forms, waves: Waves, books: Books | None,
) -> None:  # fmt: skip
    """Read the motion at every grid time up to `until`; `flight` ends at the last of them."""
    dt, started, phase, active = reading.interval[c], False, complex(1.0, 0.0), 0
    alone = not has_blocks(watch)
    turn = complex(math.cos(watch.omega * dt), math.sin(watch.omega * dt))
    while True:
        sample = way.tally[c, 0] + 1
        i, time = sample - first - 1, sample * dt
        if time > until:
            break
        if started and alone:
            for k in range(active):
                flight.entry[k] *= way.turn[0, k]
            move_particles(watch, flight, time - flight.clock[0])
            phase *= turn
        else:
            move(watch, flight, time - flight.clock[0])
            theta = watch.omega * time + flight.clock[3]
            started, phase = True, complex(math.cos(theta), math.sin(theta))
            for k in range(watch.exponent.size):
                if flight.entry[k] != 0.0:
                    active, way.turn[0, k] = k + 1, cmath.exp(watch.exponent[k] * dt)
        flight.clock[0] = time
        for o in range(reading.constant.shape[1]):
            value = reading.constant[number, o] + (reading.sine[c, number, o] * phase).real
            for k in range(active):
                w, h = reading.weight[number, o, k], flight.entry[k]
                value += w.real * h.real - w.imag * h.imag
            for p in range(flight.particle.size):
                value += reading.particle[number, o, p] * flight.particle[p]
                value += reading.particle_rate[number, o, p] * flight.particle_rate[p]
            if o < 2:
                way.state[o, 0] = value
            if i < reading.values.shape[1]:
                reading.values[c, i, o] = value
        _add_to_cycle(c, sample, way.state[0, 0], way.state[1, 0], phase, reading)
        if books is not None:
            keep_books(c, number, i, forms, waves, watch, way.mode[c], flight, mark, way.touch[c], books)
        way.tally[c, 0] = sample


@inlined
def _change(
    c: int, r: int, side: float, rate: float, time: float, forms: Forms, way: Journey, books: Books | None
) -> None:
    """What a pair does after one of its scalars met a bound; an impact opens and closes here."""
    pairs = way.mode.shape[1]
    j = r % pairs
    before = way.mode[c, j]
    own = 1.0 if before > 0.0 else -1.0
    if before == FREE:
        way.mode[c, j] = side * CONTACT
        for field in range(way.touch.shape[1]):
            way.touch[c, field, j] = 0.0
        way.touch[c, START, j], way.touch[c, APPROACH, j] = time, side * rate
        if books is not None:
            open_books(c, j, books)
    elif r >= pairs:
        way.mode[c, j] = own * (REBOUND if abs(before) == CONTACT else CONTACT)
    else:
        way.mode[c, j] = FREE
        way.tally[c, 2] += 1
        if way.window[c, 0] <= time < way.window[c, 1]:
            way.totals[c, 0, j] += 1.0
            way.totals[c, 1, j] += way.touch[c, APPROACH, j]
            way.totals[c, 2, j] = max(way.totals[c, 2, j], way.touch[c, APPROACH, j])
            way.totals[c, 3, j] += way.touch[c, IMPULSE, j]
        if books is not None:
            write_impact(c, j, own, -own * rate, way.touch[c], books)


@called
def _fly(
    c: int, first: int, until: float, most: float, forms: Forms, waves: Waves, reading: Reading, way: Journey,
    search: Search, limits: NDArray[Any], flight: Flight, trial: Flight, mark: Flight, books: Books | None,
) -> int:  # fmt: skip
    """Take one case to a time: END, or STUCK where changes of contact do not end."""
    mode = way.mode[c]
    pairs, at_once, changes = mode.size, 0, 0
    number = _state_number(mode)
    search.leaving[:] = 0.0
    _set_limits(mode, forms, limits)
    if books is not None:
        copy_flight(flight, mark)
    while True:
        watch = _watch(c, number, forms, waves, limits)
        copy_flight(flight, trial)
        status = next_event(watch, trial, until, search)
        duration = trial.clock[0] - flight.clock[0]
        if duration > 0.0:
            at_once = 0
            for j in range(pairs):
                if abs(mode[j]) == CONTACT:
                    side = 1.0 if mode[j] > 0.0 else -1.0
                    wall = forms.stiffness[j] * forms.gap[0 if side > 0.0 else 1, j]
                    _book_contact(c, j, watch, side, wall, flight, duration, way, search, books is not None)
        _read(c, number, first, trial.clock[0], watch, reading, flight, mark, way, forms, waves, books)
        copy_flight(trial, flight)
        if books is not None:
            book_flight(c, number, forms, waves, watch, mode, mark, flight, way.touch[c], books)
        if status == END:
            return END
        at_once, changes = at_once + 1, changes + 1
        if status == STUCK or at_once > CHANGES_AT_ONCE or changes > most:
            return STUCK
        r = int(search.event[0])
        read_state(number, forms, waves.harmonic[c, number], waves.omega[c], flight, way.state)
        _change(c, r, search.event[1], search.rate[r], flight.clock[0], forms, way, books)
        if status == REST and abs(mode[r % pairs]) == CONTACT:
            # what began at rest does not end by the rounding of its rate
            search.leaving[pairs + r % pairs] = -search.event[1]
        after = _state_number(mode)
        if after != number:
            enter_state(after, forms, waves.harmonic[c, after], waves.omega[c], way.state, flight)
            number = after
            if books is not None:
                copy_flight(flight, mark)
        _set_limits(mode, forms, limits)


@compiled
def fly_cases(
    cases: NDArray[Any], begin: NDArray[Any], end: NDArray[Any], most: NDArray[Any], forms: Forms, waves: Waves,
    reading: Reading, way: Journey, search: Search, limits: NDArray[Any], flight: Flight, trial: Flight,
    mark: Flight, stuck: NDArray[Any], books: Books | None,
) -> None:  # fmt: skip
    """Take some cases from where they are to their end, reading every sample after `begin`.

    `most` (cases,) are the changes of contact allowed; `stuck` (cases,) gets the time (s) at which those
    of a case did not end. `limits` (4, 2R), `flight`, `trial` and `mark` are scratch space.
    """
    for i in range(cases.size):
        c = cases[i]
        home = Flight(way.entry[c], way.particle[c], way.particle_rate[c], way.clock[c], flight.term)
        copy_flight(home, flight)
        status = END
        if way.tally[c, 0] < begin[c]:
            way.tally[c, 0] = begin[c]
            time = begin[c] * reading.interval[c]
            status = _fly(
                c, end[c], time, most[c], forms, waves, reading, way, search, limits, flight, trial, mark, books
            )
        if status == END:
            time = end[c] * reading.interval[c]
            status = _fly(
                c, begin[c], time, most[c], forms, waves, reading, way, search, limits, flight, trial, mark, books
            )
        copy_flight(flight, home)
        if status != END:
            stuck[c] = flight.clock[0]
