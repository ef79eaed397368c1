"""What is read of a motion between events: samples on a grid, statistics of base cycles, and their exact peaks."""

from __future__ import annotations

import math

from femimpact.integrators.compiled.compiling import apart, inlined
from femimpact.integrators.compiled.laws import kelvin_voigt_force
from femimpact.integrators.event_driven.loop_data import FREE, Case, Grid, Pairs, Shapes, Snapshots, Space
from femimpact.integrators.event_driven.motion import (
    Array,
    Motion,
    Scalars,
    Search,
    clear_time,
    copy_motion,
    derivatives,
    measure,
    move,
    rates_now,
    rigid_body_push,
    taylor,
    unit_phase,
    value_now,
)
from femimpact.integrators.event_driven.states import base_motion, gap_of, gap_on, read_coordinates, side_of

__all__ = ["LEAST_ADVANCE", "add_peaks", "add_to_cycle", "cycle_end", "end_cycle", "follow_peak", "keep_snapshot"]

PEAK_TOLERANCE = 1e-10
"""Share of the largest value by which a crest may stand out and not be looked for."""

LEAST_ADVANCE = 1e-6
"""Of the time between two samples: what the search for a peak advances at least."""

CANCELLED = 1e-11
"""Share of the terms that make a value below which no peak is looked for, where these cancel."""

LEAST_MOTION = 1e-20
"""Metres below which nothing moves, and newtons below which nothing pushes."""

SHORT = 1e3
"""Least advances below which a time is short."""

NEWTON_STEPS = 6


MAXIMUM_TIME, MINIMUM_TIME = 6, 7
"""Where the times of the extremes stand in a row of `Grid.cycles`."""


@inlined
def _include(w: float, time: float, row: Array) -> None:
    """Add what w is at a time to the extremes of a cycle."""
    if w > row[0]:
        row[0], row[MAXIMUM_TIME] = w, time
    if w < row[1]:
        row[1], row[MINIMUM_TIME] = w, time


@inlined
def _cycle_begin(number: int, c: int, grid: Grid) -> float:
    """Where a cycle begins, in samples."""
    return float(grid.origin[c] + number * grid.per_cycle)


@inlined
def cycle_end(c: int, grid: Grid) -> float:
    """When (s) the cycle ends that goes on."""
    return float(grid.start[c] + _cycle_begin(grid.cycle[c] + 1, c, grid) * grid.interval[c])


@inlined
def add_to_cycle(sample: int, time: float, w: float, phase: complex, c: int, space: Space, grid: Grid) -> None:
    """Sums over the cycle that goes on, to which a sample belongs."""
    number = grid.cycle[c]
    row = grid.cycles[c, number]
    space.samples[sample - math.floor(_cycle_begin(number, c, grid)) - 1] = w
    _include(w, time, row)
    row[2] += w * w
    row[3] += w * phase.imag
    row[4] += w * phase.real
    row[5] += 1.0


@apart
def keep_snapshot(number: int, shapes: Shapes, pairs: Pairs, case: Case, space: Space, snapshots: Snapshots) -> None:
    """The whole motion at one sample, with the forces of compliant contacts."""
    state, motion = space.products.after, space.motion
    read_coordinates(shapes, motion, state)
    for m in range(state.shape[1]):
        snapshots.fields[number, 0, m], snapshots.fields[number, 1, m] = state[0, m], state[1, m]
    base, speed = base_motion(case, motion)
    for j in range(case.state.size):
        if case.state[j] == FREE or pairs.rigid[j]:
            continue
        side = side_of(case.state[j])
        depth = side * gap_of(j, pairs, state[0], base) - gap_on(side, j, case)
        rate = side * gap_of(j, pairs, state[1], speed)
        if depth > 0.0:
            force = kelvin_voigt_force(depth, rate, case.stiffness[j], case.damping[j])
            snapshots.forces[number, j] = side * force


# ---- the peak of a cycle, and of a contact ---------------------------------------------------------


@apart
def end_cycle(c: int, end: float, read: int, scalars: Scalars, space: Space, grid: Grid) -> None:
    """End the cycle that goes on at a time between two samples, `read` being the number of the first of them."""
    motion = space.crest
    copy_motion(space.begin, motion)
    move(scalars, motion, end - motion.clock[0])
    motion.clock[0] = end
    phase = unit_phase(scalars.omega, motion.clock)
    last = value_now(scalars.lasting.size, scalars.exponent.size, phase, scalars, motion)
    add_peaks(c, end, last, read, scalars, space, grid)
    grid.cycle[c] += 1


@apart
def add_peaks(
    c: int, until: float, last: float, read: int, scalars: Scalars, space: Space, grid: Grid
) -> None:  # fmt: skip
    """Largest and smallest w of the cycle that goes on, from where the closed form began up to an instant in it.

    `last` is w at that instant, and `read` the number of the last sample before it. Only between samples where more
    than the extremes is not excluded by what w may do there, is a crest looked for.
    """
    number, interval = grid.cycle[c], grid.interval[c]
    begun = _cycle_begin(number, c, grid)
    first, begin = math.floor(begun), grid.start[c] + begun * interval
    row, motion = grid.cycles[c, number], space.spare
    # before the first cycle nothing is measured, and what lasts no time is no motion
    if until <= max(begin, space.begin.clock[0]):
        return
    copy_motion(space.begin, motion)
    if motion.clock[0] < begin:
        move(scalars, motion, begin - motion.clock[0])
        motion.clock[0] = begin
    time, least, r = motion.clock[0], LEAST_ADVANCE * interval, scalars.lasting.size
    measure(scalars, motion, space.search)
    before = value_now(r, scalars.size.size, unit_phase(scalars.omega, motion.clock), scalars, motion)
    _include(before, time, row)
    _include(last, until, row)
    slack = PEAK_TOLERANCE * max(abs(row[0]), abs(row[1])) + _negligible(r, scalars, motion, space.search)
    excess = _excess_between(r, interval, until - time, scalars, motion, space.search) - slack
    place, start = int((time - (grid.start[c] + first * interval)) / interval) + 1, math.inf
    while time < until:
        at, value = grid.start[c] + (first + place) * interval, last
        if first + place <= read and at < until:
            value = space.samples[place - 1]
        else:
            at = until
        place += 1
        if max(before, value) + excess > row[0] or min(before, value) - excess < row[1]:
            start = min(start, time)
        elif start < time:
            follow_peak(r, 0.0, start, time, least, scalars, space, row)
            start = math.inf
        time, before = at, value
    if start < until:
        follow_peak(r, 0.0, start, until, least, scalars, space, row)


@inlined
def _excess_between(
    r: int, interval: float, duration: float, scalars: Scalars, motion: Motion, search: Search
) -> float:  # fmt: skip
    """How far w may stand out above and below what it is at both ends of an interval.

    Each of its terms does by |w''| interval^2/8 at most, and by no more than twice its size.
    """
    share, wave, d = min(interval, duration) ** 2 / 8.0, scalars.sine[r], motion.drive
    total = scalars.omega**2 * math.sqrt(wave.real * wave.real + wave.imag * wave.imag) * share
    if scalars.broken:
        _, _, pull, twist = taylor(scalars.follow, r, d)
        total += (abs(pull) + abs(twist) * duration) * share
    for p in range(scalars.rigid_body_given.size):
        weight, rate_weight = scalars.rigid_body_weight[r, p], scalars.rigid_body_rate_weight[r, p]
        push, growth = rigid_body_push(p, scalars, motion)
        total += (abs(weight * push + rate_weight * growth) + abs(weight * growth) * duration) * share
    for k in range(scalars.size.size):
        own = min(scalars.size[k] ** 2 * share, 2.0)
        total += scalars.weight_size[r, k] * search.size[k] * own
    return float(total)


@apart
def follow_peak(
    r: int, wanted: float, start: float, until: float, least: float, scalars: Scalars, space: Space, row: Array
) -> None:  # fmt: skip
    """Extremes of scalar r of the spare motion between two instants, to `PEAK_TOLERANCE`: row[0] and row[1].

    `wanted` is 1 where only the largest value is, -1 for the smallest, 0 for both. Advances by times in which a bound
    on the motion excludes more than the extremes so far; where these are approached, by those in which the scalar
    surely rises on, or is surely concave, so that its only crest is found. The extremes hold what it is at the end
    already.
    """
    entries, motion, search = scalars.size.size, space.spare, space.search
    upper, lower = scalars.upper[r], scalars.lower[r]
    move(scalars, motion, start - motion.clock[0])
    motion.clock[0] = start
    safe, remaining = 0.0, until - start
    while safe < remaining:
        phase = unit_phase(scalars.omega, motion.clock)
        measure(scalars, motion, search)
        remaining = until - motion.clock[0]
        slack = PEAK_TOLERANCE * max(abs(row[0]), abs(row[1])) + _negligible(r, scalars, motion, search)
        scalars.upper[r] = math.inf if wanted < 0.0 else row[0] + slack
        scalars.lower[r] = -math.inf if wanted > 0.0 else row[1] - slack
        active = _leave_out_ripples(0.25 * slack, entries, scalars.weight_size[r], search)
        safe = clear_time(r, scalars, motion, active, phase, remaining, search)
        value, rate = search.found[0], search.found[1]
        _include(value, motion.clock[0], row)
        # far below the extremes so far long times are safe, and curvature need not be computed
        if safe < remaining and (0.25 * abs(rate) * safe < row[0] - row[1] or safe < SHORT * least):
            derivatives(r, scalars, motion, phase, search)
            safe = max(max(safe, least), _advance_to_crest(r, wanted, rate, remaining, scalars, space, row))
        if safe < remaining:
            move(scalars, motion, safe)
    # the bounds of a contact are those of its end too
    scalars.upper[r], scalars.lower[r] = upper, lower


@inlined
def _negligible(r: int, scalars: Scalars, motion: Motion, search: Search) -> float:
    """What is too little to be looked for in scalar r where large terms cancel."""
    wave = scalars.sine[r]
    scale = abs(scalars.constant[r]) + abs(wave.real) + abs(wave.imag)
    for k in range(scalars.size.size):
        scale += scalars.weight_size[r, k] * search.size[k]
    for p in range(scalars.rigid_body_given.size):
        scale += abs(scalars.rigid_body_weight[r, p] * motion.rigid_body[p])
    return float(CANCELLED * scale + LEAST_MOTION)


@inlined
def _leave_out_ripples(least: float, active: int, weight_size: Array, search: Search) -> int:
    """Number of the entries that matter: the fastest are left out that together add no more than `least`."""
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
    r: int, wanted: float, rate: float, remaining: float, scalars: Scalars, space: Space, row: Array
) -> float:  # fmt: skip
    """Time in which scalar r rises on, or in which its only crest has been looked at; the same where it falls."""
    found = space.search.found
    side = 1.0 if rate >= 0.0 else -1.0
    speed, bend, bound = side * rate, side * found[0], found[3]
    if bound <= 0.0:
        bound = 1e-300
    rising: float = (bend + math.sqrt(bend * bend + 2.0 * speed * bound)) / bound
    if bend >= 0.0:
        return rising
    concave: float = min(-bend / bound, remaining)
    # where crests alone are wanted, a trough has none inside
    if rising >= concave or side * wanted < 0.0:
        return max(rising, concave)
    # to second order in the rate, which is speed + bend t + twist t^2/2
    inner = bend * bend - 2.0 * speed * side * found[1]
    first = 2.0 * speed / (math.sqrt(inner) - bend) if inner > 0.0 else -speed / bend
    low, high, time = 0.0, concave, min(first, concave)
    for _ in range(NEWTON_STEPS):
        copy_motion(space.spare, space.crest)
        move(scalars, space.crest, time)
        value, slope, curve = rates_now(r, scalars, space.crest, space.search.power)
        _include(value, space.crest.clock[0], row)
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
