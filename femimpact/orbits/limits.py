"""Where a curve of orbits ends by itself: an impact without speed, two events at one instant, a symmetric orbit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femimpact.orbits.crests import depth_beyond
from femimpact.orbits.curve import (
    AROUND,
    LONGEST,
    LostError,
    Point,
    at_value,
    evaluated,
    interpolated,
    locate,
    near_points,
)
from femimpact.orbits.equations import IMPACT, PRESS_AGAIN, RELEASE, SEPARATE, TOUCH
from femimpact.orbits.newton import EXACT

NEAR_END = 1e-4
"""Distance to the end of a curve at which its multipliers are followed no further: at no speed they are infinite."""

ON_SYMMETRIC = 1e-3
"""Share of the asymmetry at the beginning of a step below which its end is taken for a symmetric orbit."""

NEAR_SYMMETRIC = 2e-3
"""The same distance to a symmetric branch, beside which the equations are singular."""

MOST_SECANTS = 20
"""Steps of a secant method."""

NEARER = (AROUND, 0.1 * AROUND, 0.01 * AROUND)
"""Distances to where two events merge of the points from which it is interpolated."""

AT_WALL = 1e-6
"""Distance of a crest from a wall, speed of an impact, and phase between two events, in units, that are none."""

MERGING = {RELEASE: PRESS_AGAIN, PRESS_AGAIN: RELEASE, SEPARATE: TOUCH}
"""Events of a Kelvin-Voigt contact of which the second follows the first at once where both lose their speed."""


@dataclass(frozen=True, eq=False)
class Limit:
    """A number that ends a curve where it is zero."""

    function: Callable[[Point], float] | None  # None where a branch of orbits that repeat after half a period is met
    far: float  # how far along the tangent, roughly
    near: float  # how far it may be where the curve is followed no further
    is_singular: bool = False  # True where two events merge


def first_limit(left: Point, right: Point) -> Limit | None:
    """The first of the limits that a step passes."""
    limits = []
    for i in np.argwhere((right.limits <= 0.0) & (left.limits > 0.0)).tolist():

        def function(point: Point, i: tuple[int, ...] = tuple(i)) -> float:
            return float(point.limits[i])

        near = locate(left, right, function, 0.1 * NEAR_END)
        merging = i[0] < 2 and near.curve.solved.kind[i[1]] in MERGING and without_speed(near, 10.0 * NEAR_END)
        limits.append(Limit(function, float(left.row @ (near.x - left.x)), NEAR_END, bool(merging)))
    if left.curve.half_sign and (apart := right.apart(left)) <= ON_SYMMETRIC:
        far = float(left.row @ (right.x - left.x)) / (1.0 - apart)
        limits.append(Limit(None, far, NEAR_SYMMETRIC))
    return min(limits, key=lambda limit: limit.far, default=None)


def limit_point(left: Point, right: Point, limit: Limit) -> tuple[list[tuple[str, Point]], float, str]:
    """The point at a limit, as of `_advance`."""
    if limit.function is None:
        point = repeating_point(left)
        if point is None:
            raise LostError("it nearly repeats after half a period, and no orbit that does is found there")
        return joining(point)
    if limit.is_singular:
        return at_no_speed(interpolated(left, right, limit.function, NEARER))
    return at_no_speed(locate(left, right, limit.function))


def at_no_speed(point: Point) -> tuple[list[tuple[str, Point]], float, str]:
    """A point at which events lose their speed or their order, as of `_advance`."""
    solved, still = point.curve.solved, without_speed(point, AT_WALL)
    if not still:
        return [], 0.0, f"two events at one instant, {where(point)}"
    k, j, side = still[0], int(solved.pair[still[0]]), float(solved.side[still[0]])
    name, kind = point.curve.parameter.at(point.value)[0].contacts[j].name, solved.kind[k]
    if kind == PRESS_AGAIN and abs(point.limits[2, k]) < AT_WALL:
        return [("grazing", point)], 0.0, f"press again at the wall, of {name} {where(point)}"
    if kind in MERGING:
        return [("grazing", point)], 0.0, f"{kind} and {MERGING[kind]} at one instant, of {name} {where(point)}"
    leaves = depth_beyond(point, k, j, side, point.events.phases[k : k + 1], 2)[0] < 0.0
    kind, words = ("grazing", "impact speed zero") if leaves else ("sticking", "sticking after an impact at no speed")
    return [(kind, point)], 0.0, f"{words}, of {name} {where(point)}"


def without_speed(point: Point, tolerance: float) -> list[int]:
    """Events at which a contact just begins or ends: impacts and touches without speed, the first of two that merge.

    Also where a contact presses again just at the wall.
    """
    solved, n = point.curve.solved, point.curve.count
    rate, between, away = np.abs(point.limits) < tolerance
    after = (np.arange(n) + 1) % n
    merging = [
        k
        for k in np.flatnonzero(rate & rate[after] & between & (solved.pair == solved.pair[after])).tolist()
        if MERGING.get(solved.kind[k]) == solved.kind[after[k]]
    ]
    second = {int(after[k]) for k in merging}
    alone = [k for k in np.flatnonzero(rate).tolist() if solved.kind[k] in (IMPACT, TOUCH) and k not in second]
    return sorted({*merging, *alone, *np.flatnonzero(away).tolist()} - (second - set(merging)))


def joining(point: Point) -> tuple[list[tuple[str, Point]], float, str]:
    """A point on a branch of orbits that repeat after half a period, as of `_advance`."""
    if point.curve.half_sign > 0.0:
        return [("period-doubling", point)], 0.0, f"joins the branch of half its period {where(point)}"
    return [("symmetry-breaking", point)], 0.0, f"joins a symmetric branch {where(point)}"


def where(point: Point) -> str:
    """Words for the value at a point."""
    return f"at {point.curve.parameter.path} = {point.value:.10g}"


def near_no_contact(left: Point) -> Point | None:
    """The point at which a Kelvin-Voigt contact, or its release, has no duration, if one is near.

    Its events are one there, and the equations singular: it is extrapolated from points before it.
    """
    kinds = TOUCH, RELEASE, PRESS_AGAIN
    speeds = [left.limits[0, k] for k, kind in enumerate(left.curve.solved.kind) if kind in kinds]
    if min(speeds, default=math.inf) > 0.1 * LONGEST:
        return None
    k, step = left.limits[0].tolist().index(min(speeds)), NEAR_END
    for _ in range(3):
        points = [left, *near_points(left, (-0.5 * step, -step))]
        if len(points) < 3:
            return None
        speed = np.array([point.limits[0, k] for point in points])
        if not speed[0] < speed[1] < speed[2]:
            return None
        others = [np.delete(speed, i) for i in range(3)]
        share = [float(np.prod(other / (other - at))) for other, at in zip(others, speed, strict=True)]
        x = np.asarray(np.array(share) @ np.array([point.x for point in points]))
        step = float(left.row @ (x - left.x))
        if not 0.0 < step < LONGEST:
            return None
        # once more from nearer
        left, step = next(iter(near_points(left, (0.9 * step,))), left), 0.1 * step
    return evaluated(left.curve, x, left.tangent)


def repeating_point(left: Point) -> Point | None:
    """The orbit that repeats after half a period, at -1 of a multiplier of that, to which a branch near it comes.

    The equations of the whole period are singular there: those of the half are not.
    """
    states, phases = left.events.states, left.events.phases
    sign, curve = left.curve.half_sign, left.curve.half
    half, kind = len(phases) // 2, "period-doubling" if sign > 0.0 else "symmetry-breaking"
    later = phases[half:] - 0.5 * left.cycle
    x = curve.unknowns(0.5 * (states[:half] + sign * states[half:]), 0.5 * (phases[:half] + later), left.value)
    value, step, before = left.value, 1e-6 * curve.width, None
    for _ in range(MOST_SECANTS):
        point = at_value(curve, x, value)
        if point is None:
            return None
        x, test = point.x, point.tests[kind]
        if before is not None and test != before:
            step *= -test / (test - before)
        value, before = value + step, test
        if abs(step) <= EXACT * abs(value):
            states, phases = point.events.states[:half], point.events.phases[:half]
            both = np.concatenate([states, sign * states]), np.concatenate([phases, phases + 0.5 * left.cycle])
            unknowns = left.curve.unknowns(*both, point.value)
            far = unknowns - left.x
            near = far @ (left.curve.weight * far) < LONGEST**2
            return evaluated(left.curve, unknowns, left.tangent) if near else None
    return None
