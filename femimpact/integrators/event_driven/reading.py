"""What is read of a motion between events: samples on a grid, statistics of base cycles, and their exact peaks."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import apart, inlined
from femimpact.integrators.compiled.laws import kelvin_voigt_force
from femimpact.integrators.event_driven.loop_data import FREE, Case, Grid, Pairs, Shapes, Snapshots, Space
from femimpact.integrators.event_driven.motion import (
    Motion,
    Scalars,
    Search,
    clear_time,
    copy_motion,
    derivatives,
    measure,
    move,
    rates_now,
    unit_phase,
    value_now,
)
from femimpact.integrators.event_driven.states import base_motion, gap_of, read_coordinates, side_of

__all__ = ["add_peaks", "add_to_cycle", "keep_snapshot"]

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


@inlined
def add_to_cycle(number: int, w: float, phase: complex, cycles: NDArray[Any]) -> None:
    """Sums over the cycle that a sample belongs to, where it is measured."""
    if 0 <= number < cycles.shape[0]:
        row = cycles[number]
        row[0], row[1] = max(row[0], w), min(row[1], w)
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
        depth = side * gap_of(j, pairs, state[0], base) - case.gap[0 if side > 0.0 else 1, j]
        rate = side * gap_of(j, pairs, state[1], speed)
        if depth > 0.0:
            force = kelvin_voigt_force(depth, rate, case.stiffness[j], case.damping[j])
            snapshots.forces[number, j] = side * force


# ---- the peak of a cycle ---------------------------------------------------------------------------


@apart
def add_peaks(c: int, until: float, scalars: Scalars, space: Space, grid: Grid) -> None:
    """Largest and smallest w of every cycle from where the closed form began up to an instant.

    `grid.cycle` is the cycle that goes on there, -1 before the first one.
    """
    number, cycles, interval = grid.cycle[c], grid.cycles[c], grid.interval[c]
    begin, length, motion = grid.start[c] + grid.origin[c] * interval, grid.per_cycle * interval, space.spare
    copy_motion(space.begin, motion)
    while motion.clock[0] < until and number < cycles.shape[0]:
        if number < 0:
            # measuring has not begun
            if until <= begin:
                break
            move(scalars, motion, max(begin - motion.clock[0], 0.0))
            motion.clock[0], number = max(begin, motion.clock[0]), 0
            continue
        end = begin + (number + 1) * length
        _follow_peak(min(end, until), LEAST_ADVANCE * interval, scalars, space, cycles[number])
        if until >= end:
            number += 1
    grid.cycle[c] = number


@apart
def _follow_peak(until: float, least: float, scalars: Scalars, space: Space, row: NDArray[Any]) -> None:
    """Extremes of the observed place up to an instant, to `PEAK_TOLERANCE`: row[0] and row[1].

    Advances by times in which a bound on the motion excludes more than the extremes so far; where these are
    approached, by those in which w surely rises on, or is surely concave, so that its only crest is found.
    """
    r, entries, motion, search = scalars.lasting.size, scalars.size.size, space.spare, space.search
    while True:
        phase = unit_phase(scalars.omega, motion.clock)
        measure(scalars, motion, search)
        remaining = until - motion.clock[0]
        if row[0] == -math.inf:
            # the bounds are no help before there is a value
            row[0] = row[1] = value_now(r, entries, phase, scalars, motion)
        slack = PEAK_TOLERANCE * max(abs(row[0]), abs(row[1])) + _negligible(r, scalars, motion, search)
        scalars.upper[r], scalars.lower[r] = row[0] + slack, row[1] - slack
        active = _leave_out_ripples(0.25 * slack, entries, scalars.weight_size[r], search)
        safe = clear_time(r, scalars, motion, active, phase, remaining, search)
        value, rate = search.found[0], search.found[1]
        row[0], row[1] = max(row[0], value), min(row[1], value)
        if remaining <= 0.0:
            return
        # far below the extremes so far long times are safe, and curvature need not be asked for
        if safe < remaining and (0.25 * abs(rate) * safe < row[0] - row[1] or safe < SHORT * least):
            derivatives(r, scalars, motion, phase, search)
            safe = max(max(safe, least), _advance_to_crest(rate, remaining, scalars, space, row))
        move(scalars, motion, min(safe, remaining))
        if safe >= remaining:
            motion.clock[0] = until


@inlined
def _negligible(r: int, scalars: Scalars, motion: Motion, search: Search) -> float:
    """What is too little to be looked for in w where large terms cancel."""
    wave = scalars.sine[r]
    scale = abs(scalars.constant[r]) + abs(wave.real) + abs(wave.imag)
    for k in range(scalars.size.size):
        scale += scalars.weight_size[r, k] * search.size[k]
    for p in range(scalars.rigid_body_given.size):
        scale += abs(scalars.rigid_body_weight[r, p] * motion.rigid_body[p])
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
    rate: float, remaining: float, scalars: Scalars, space: Space, row: NDArray[Any]
) -> float:  # fmt: skip
    """Time in which w rises on, or in which its only crest has been looked at; the same with a falling w."""
    r, found = scalars.lasting.size, space.search.found
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
        copy_motion(space.spare, space.crest)
        move(scalars, space.crest, time)
        value, slope, curve = rates_now(r, scalars, space.crest, space.search.power)
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
