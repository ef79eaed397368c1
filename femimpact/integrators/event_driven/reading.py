"""What is read of a motion between events: samples on a grid, statistics of base cycles, and their exact peaks."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.event_driven.motion import (
    Flight,
    Watch,
    clear_time,
    copy_flight,
    derivatives,
    measure,
    move,
    multiply,
    unit_phase,
)
from femimpact.integrators.event_driven.search import Search
from femimpact.integrators.event_driven.states import (
    FREE,
    Case,
    Pairs,
    Place,
    base_motion,
    gap_of,
    read_coordinates,
    side_of,
)
from femimpact.integrators.kernels.compiling import apart, inlined
from femimpact.integrators.kernels.laws import kelvin_voigt_force

__all__ = ["Grid", "Snapshots", "add_peaks", "add_to_cycle", "keep_snapshot", "value_now"]

PEAK_TOLERANCE = 1e-10
"""Share of a cycle's largest |w| by which a crest may stand out and not be looked for."""

LEAST_ADVANCE = 1e-6
"""Of the time between two samples: what the search for a peak advances at least."""

CANCELLED = 1e-11
"""Share of the terms that make w below which no peak is looked for, where these cancel."""

LEAST_MOTION = 1e-20
"""Metres below which nothing moves."""

SHORT = 1e3
"""Least advances below which a time is short."""

NEWTON_STEPS = 6


class Grid(NamedTuple):
    """What is read on a grid of times; O outputs, the first of them the observed place."""

    interval: NDArray[Any]  # (C,) s
    per_cycle: int  # samples
    origin: NDArray[Any]  # (C,) sample with which the first cycle begins
    cycle: NDArray[Any]  # (C,) cycle whose peak is being looked for
    cycles: NDArray[Any]  # (C, cycles, 6); see layout.CYCLE_COLUMNS
    values: NDArray[Any]  # (C, samples, O), or (C, 0, O) where only cycles are wanted
    kept: NDArray[Any]  # (samples,) number of the energy row that a sample fills, -1 for none
    energy: NDArray[Any]  # (C, rows, 7 + n)


class Snapshots(NamedTuple):
    """Whole motions of a single case."""

    shown: NDArray[Any]  # (samples,) number of the snapshot, -1 for none; no samples where none is wanted
    fields: NDArray[Any]  # (snapshots, 2, d)
    forces: NDArray[Any]  # (snapshots, R) N on the structure


@inlined
def value_now(r: int, active: int, phase: complex, watch: Watch, flight: Flight) -> float:
    """Scalar r at the present time."""
    value = watch.constant[r] + (watch.sine[r] * phase).real
    if watch.broken:
        for m in range(4):
            value += watch.follow[m, r] * flight.drive[m]
    for k in range(active):
        w, h = watch.weight[r, k], flight.entry[k]
        value += w.real * h.real - w.imag * h.imag
    for p in range(watch.particle_given.size):
        value += watch.particle_weight[r, p] * flight.particle[p]
        value += watch.particle_rate_weight[r, p] * flight.particle_rate[p]
    return float(value)


@inlined
def add_to_cycle(number: int, w: float, phase: complex, cycles: NDArray[Any]) -> None:
    """Sums over the cycle that a sample belongs to, where it is measured."""
    if 0 <= number < cycles.shape[0]:
        row = cycles[number]
        row[2] += w * w
        row[3] += w * phase.imag
        row[4] += w * phase.real
        row[5] += 1.0


@apart
def keep_snapshot(
    number: int, place: Place, pairs: Pairs, case: Case, flight: Flight, state: NDArray[Any], shots: Snapshots
) -> None:  # fmt: skip
    """The whole motion at one sample, with the forces of compliant contacts."""
    read_coordinates(place, flight, state)
    for m in range(state.shape[1]):
        shots.fields[number, 0, m], shots.fields[number, 1, m] = state[0, m], state[1, m]
    base, speed = base_motion(case.omega, case.amplitude, flight)
    for j in range(case.state.size):
        if case.state[j] == FREE or pairs.rigid[j]:
            continue
        side = side_of(case.state[j])
        depth = side * gap_of(j, pairs.direction, pairs.in_space, state[0], base) - case.gap[0 if side > 0.0 else 1, j]
        rate = side * gap_of(j, pairs.direction, pairs.in_space, state[1], speed)
        if depth > 0.0:
            shots.forces[number, j] = side * kelvin_voigt_force(depth, rate, case.stiffness[j], case.damping[j])


# ---- the peak of a cycle ---------------------------------------------------------------------------


@apart
def add_peaks(
    number: int, begin: float, length: float, until: float, least: float, watch: Watch, flight: Flight, spare: Flight,
    crest: Flight, search: Search, cycles: NDArray[Any],
) -> int:  # fmt: skip
    """Largest and smallest w of every cycle up to an instant; returns the cycle that goes on there.

    Cycle 0 begins at `begin`, before which the number is -1.
    """
    copy_flight(flight, spare)
    while spare.clock[0] < until and number < cycles.shape[0]:
        if number < 0:
            # measuring has not begun
            if until <= begin:
                break
            move(watch, spare, max(begin - spare.clock[0], 0.0))
            spare.clock[0], number = max(begin, spare.clock[0]), 0
            continue
        end = begin + (number + 1) * length
        _follow_peak(min(end, until), watch, spare, crest, search, least, cycles[number])
        if until >= end:
            number += 1
    return number


@apart
def _follow_peak(
    until: float, watch: Watch, flight: Flight, crest: Flight, search: Search, least: float, row: NDArray[Any]
) -> None:  # fmt: skip
    """Extremes of the observed place up to an instant, to `PEAK_TOLERANCE`: row[0] and row[1].

    Advances by times in which a bound on the motion excludes more than the extremes so far; where these are
    approached, by those in which w surely rises on, or is surely concave, so that its only crest is found.
    """
    r = watch.lasting.size
    while True:
        phase = unit_phase(watch.omega, flight.clock)
        measure(watch, flight, search.size, search.power[0])
        remaining = until - flight.clock[0]
        if row[0] == -math.inf:
            # the bounds are no help before there is a value
            watch.upper[r], watch.lower[r] = math.inf, -math.inf
            clear_time(r, watch, flight, watch.size.size, search.size, search.power[0], phase, remaining, search.found)
            row[0] = row[1] = search.found[0]
        slack = PEAK_TOLERANCE * max(abs(row[0]), abs(row[1])) + _negligible(r, watch, flight, search)
        watch.upper[r], watch.lower[r] = row[0] + slack, row[1] - slack
        active = _leave_out_ripples(0.25 * slack, watch.size.size, watch.weight_size[r], search)
        safe = clear_time(r, watch, flight, active, search.size, search.power[0], phase, remaining, search.found)
        value, rate = search.found[0], search.found[1]
        row[0], row[1] = max(row[0], value), min(row[1], value)
        if remaining <= 0.0:
            return
        # far below the extremes so far long times are safe, and curvature need not be asked for
        if safe < remaining and (0.25 * abs(rate) * safe < row[0] - row[1] or safe < SHORT * least):
            derivatives(r, watch, flight, phase, search.size, search.power, search.found)
            safe = max(max(safe, least), _advance_to_crest(r, rate, remaining, watch, flight, crest, search, row))
        move(watch, flight, min(safe, remaining))
        if safe >= remaining:
            flight.clock[0] = until


@inlined
def _negligible(r: int, watch: Watch, flight: Flight, search: Search) -> float:
    """What is too little to be looked for in w where large terms cancel."""
    wave = watch.sine[r]
    scale = abs(watch.constant[r]) + abs(wave.real) + abs(wave.imag)
    for k in range(watch.size.size):
        scale += watch.weight_size[r, k] * search.size[k]
    for p in range(watch.particle_given.size):
        scale += abs(watch.particle_weight[r, p] * flight.particle[p])
    return float(CANCELLED * scale + LEAST_MOTION)


@inlined
def _leave_out_ripples(least: float, active: int, weight_size: NDArray[Any], search: Search) -> int:
    """Number of the entries that matter: the fastest are left out that together move w by no more than `least`."""
    left = 0.0
    while active > 0:
        left += weight_size[active - 1] * search.size[active - 1]
        if left > least:
            break
        active -= 1
        search.size[active], search.power[0, active] = 0.0, 0.0
    return active


@inlined
def _advance_to_crest(
    r: int, rate: float, remaining: float, watch: Watch, flight: Flight, crest: Flight, search: Search,
    row: NDArray[Any],
) -> float:  # fmt: skip
    """Time in which w rises on, or in which its only crest has been looked at; the same with a falling w."""
    found = search.found
    side = 1.0 if rate >= 0.0 else -1.0
    speed, bend, bound = side * rate, side * found[0], found[3]
    if bound <= 0.0:
        bound = 1e-300
    rising: float = (bend + math.sqrt(bend * bend + 2.0 * speed * bound)) / bound
    if bend >= 0.0:
        return rising
    concave: float = min(-bend / bound, remaining)
    if rising >= concave:
        return rising
    # to second order in the rate, which is speed + bend t + twist t^2/2
    inner = bend * bend - 2.0 * speed * side * found[1]
    first = 2.0 * speed / (math.sqrt(inner) - bend) if inner > 0.0 else -speed / bend
    low, high, time = 0.0, concave, min(first, concave)
    for _ in range(NEWTON_STEPS):
        copy_flight(flight, crest)
        move(watch, crest, time)
        value, slope, curve = _rates(r, watch, crest, search.power)
        row[0], row[1] = max(row[0], value), min(row[1], value)
        slope, curve = side * slope, side * curve
        if slope > 0.0:
            low = time
        else:
            high = time
        # what is left to the crest
        if slope * slope <= -2.0 * curve * PEAK_TOLERANCE * (row[0] - row[1]) or curve >= 0.0:
            break
        time = min(max(time - slope / curve, low), high)
    return concave


@inlined
def _rates(r: int, watch: Watch, flight: Flight, power: NDArray[Any]) -> tuple[float, float, float]:
    """Scalar r with its first and second derivative."""
    phase = unit_phase(watch.omega, flight.clock)
    turned = watch.sine[r] * phase
    value, rate, bend = watch.constant[r] + turned.real, -watch.omega * turned.imag, -(watch.omega**2) * turned.real
    if watch.broken:
        d = flight.drive
        value += watch.follow[0, r] * d[0] + watch.follow[1, r] * d[1] + watch.follow[2, r] * d[2]
        value += watch.follow[3, r] * d[3]
        rate += watch.follow[0, r] * d[1] + watch.follow[1, r] * d[2] + watch.follow[2, r] * d[3]
        bend += watch.follow[0, r] * d[2] + watch.follow[1, r] * d[3]
    multiply(watch, flight.entry, power[1])
    multiply(watch, power[1], power[2])
    for k in range(watch.exponent.size):
        value += (watch.weight[r, k] * flight.entry[k]).real
        rate += (watch.weight[r, k] * power[1, k]).real
        bend += (watch.weight[r, k] * power[2, k]).real
    for p in range(watch.particle_given.size):
        weight, given = watch.particle_weight[r, p], watch.particle_given[p] + watch.particle_drive[p] * flight.drive[2]
        value += weight * flight.particle[p]
        rate += weight * flight.particle_rate[p]
        bend += weight * given
    return value, rate, bend
