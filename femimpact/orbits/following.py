"""A curve of orbits followed one way: its steps, and the bifurcations on it located."""

from __future__ import annotations

import itertools
import math

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import DivergenceError
from femimpact.orbits.curve import LONGEST, SAME, LostError, Point, between, interpolated, locate, point_along
from femimpact.orbits.limits import (
    NEAR_END,
    Followed,
    at_no_speed,
    first_limit,
    joining,
    limit_point,
    near_no_contact,
    repeating_point,
    verify,
)
from femimpact.orbits.orbit import NEUTRAL
from femimpact.system.system import System

SHORTEST = 1e-8
"""Shortest step along a curve."""

TURN = 0.95
"""Least cosine between the tangents at the ends of a step."""

NEAR_CIRCLE = 0.3
"""Distance of a multiplier from the unit circle below which it may not move far in a step."""

MOST_MOVED = 0.1
"""By which it may move."""

RESOLVED = 1e-5
"""Step below which a curve is not followed more closely for its multipliers."""

NEARLY = 0.2
"""Share of the values at the ends of a step below which a cubic that turns round may be of a function beyond zero."""

MOST_LOOKS = 3
"""Points, one between another one and an end of a step, at which it is looked at."""

AT_ONCE = 64
"""Points that are verified in one call.

More save little: a branch of 370 points 0.015 s at 512. A point that is followed in vain, beyond where its orbits are
no motions, costs 3 to 6 ms.
"""

CLOSED = "closed on itself"
"""Why a closed curve ends."""

CHANGES = {"fold": 1, "period-doubling": 1, "symmetry-breaking": 1, "branch-point": 1, "neimark-sacker": 2}
"""How many multipliers cross the unit circle at each kind of bifurcation."""


def follow(system: System, start: Point, low: float, high: float, most: int) -> tuple[list[Followed], str]:
    """Points along the tangent of a start as far as values (low, high), or so many points, and why they end there.

    The start is the first of them.
    """
    way, verified = [Followed(start)], 0
    left, step, bend = start, start.longest, np.zeros_like(start.x)
    end = _outside(start, low, high)
    while not end:
        try:
            after, located, step, end = _advance(left, bend, step, low, high)
        except LostError as lost:
            end = f"no convergence: {lost}"
        else:
            closed = after is not None and _passes(start, left, after)
            # beyond the start it is one that was found
            way += [
                Followed(point, kind)
                for kind, point in located
                if not (closed and float(start.row @ _from_start(start, point)) > 0.0)
            ]
            if after is not None:
                # the last point may be where the one before it was
                length = float(left.row @ (after.x - left.x))
                bend = (after.tangent - left.tangent) / (2.0 * length) if length > 0.0 else np.zeros_like(left.x)
                left = start if closed else after
                way.append(Followed(left))
            end = CLOSED if closed else end
        if len(way) > most or (len(way) == most and not end):
            end = f"number of points: {most}"
            del way[most:]
        if len(way) - verified >= AT_ONCE:
            end = verify(system, way, verified) or end
            verified = len(way)
    if verified < len(way):
        end = verify(system, way, verified) or end
    if not way:
        raise DivergenceError(end.removeprefix("no convergence: "))
    return way, end


def _outside(point: Point, low: float, high: float) -> str:
    """The edge that a curve leaves by at a point, if it does."""
    value, rises = point.value, point.tangent[-1] > 0.0
    edge = high if rises else low
    return _edge(point, edge) if abs(value - edge) <= 1e-12 * (high - low) else ""


def _edge(point: Point, value: float) -> str:
    return f"edge: {point.curve.parameter.path} = {value:g}"


def _moved(left: Point, right: Point) -> float:
    """By how much a multiplier near the unit circle has moved."""
    here, there = left.multipliers, right.multipliers
    apart = np.abs(here[:, None] - there)
    near = [np.abs(np.abs(values) - 1.0) < NEAR_CIRCLE for values in (here, there)]
    return float(max(apart[near[0]].min(axis=1).max(initial=0.0), apart[:, near[1]].min(axis=0).max(initial=0.0)))


Advance = tuple[Point | None, list[tuple[str, Point]], float, str]
"""The next point, the bifurcations before it, the step after it, and why the curve ends there if it does."""


def _ended(kind: str, point: Point, words: str) -> Advance:
    return None, [(kind, point)] if kind else [], 0.0, words


def _advance(left: Point, bend: Array, step: float, low: float, high: float) -> Advance:
    """The next point, the events before it, the step after it, and the reason if the curve ends there.

    `bend` is half the change of the tangent along the curve, as far as it is known.
    """
    while True:
        try:
            right, end = point_along(left, step, bend), ""
            if low <= right.value <= high and left.tangent[-1] * right.tangent[-1] < 0.0:
                fold = locate(left, right, lambda point: point.tests["fold"])
                # it may turn round beyond the range
                right = right if low <= fold.value <= high else fold
            if not low <= right.value <= high:
                edge = low if right.value < low else high
                right = between(left.curve, left.x, right.x, edge)
                end = _edge(right, edge)
            if not left.row @ right.tangent > TURN:
                raise LostError("the curve turns too sharply")
            limit = first_limit(left, right)
            if limit is not None and limit.far > limit.near:
                # its multipliers are followed nearly up to the end
                step = 0.7 * limit.far
                continue
            if limit is not None:
                return _ended(*limit_point(left, right, limit))
            moved = _moved(left, right)
            if moved > MOST_MOVED and step > RESOLVED:
                step *= max(0.8 * MOST_MOVED / moved, 0.25)
                continue
            beyond = _beyond(left, right)
            if beyond is not None:
                step = float(left.row @ (beyond.x - left.x))
                continue
            located = _located(left, right)
            explained = sum(CHANGES[kind] for kind, _ in located)
            change = abs(right.unstable - left.unstable)
            if (change > explained or (change - explained) % 2) and step > RESOLVED:
                step *= 0.5
                continue
            if change == explained + 2 and _outside_circle(left) * _outside_circle(right) < 0.0:
                # together with a real pair of product 1
                located.append(("neimark-sacker", locate(left, right, _outside_circle)))
        except LostError:
            step *= 0.5
            if step < NEAR_END and (point := near_no_contact(left)) is not None:
                return _ended(*at_no_speed(point))
            if step < NEAR_END and left.curve.half_sign and (point := repeating_point(left)) is not None:
                return _ended(*joining(point))
            if step < SHORTEST:
                raise
            continue
        grown = min(1.5, 0.8 * MOST_MOVED / max(moved, 1e-9)) if moved else 1.5
        return right, located, min(right.longest, step * max(grown, 0.5)), end


def _located(left: Point, right: Point) -> list[tuple[str, Point]]:
    """Bifurcations between two points, in their order."""
    found = []
    for kind, before in left.tests.items():
        after = right.tests[kind]
        # multipliers of a motion without damping are on the unit circle, to rounding
        if not (before * after < 0.0 and abs(after - before) > NEUTRAL):
            continue

        def function(point: Point, kind: str = kind) -> float:
            return point.tests[kind]

        find = interpolated if kind == "branch-point" else locate
        point = find(left, right, function)
        # a real pair with product 1 is none
        if kind != "neimark-sacker" or _is_complex(point):
            found.append((kind, point))
    return sorted(found, key=lambda each: float(left.row @ each[1].x))


def _beyond(left: Point, right: Point, looks: int = MOST_LOOKS) -> Point | None:
    """A point between two others beyond a bifurcation after which there is another one of its kind.

    Multipliers may cross the unit circle and come back in one step. It is looked for where a cubic with the values and
    the slopes at both ends says so.
    """
    along = float(left.row @ (right.x - left.x))
    slopes = along * left.crossing_slopes, along * right.crossing_slopes / float(left.row @ right.tangent)
    # multipliers of a motion without damping are on the unit circle, to rounding
    far = np.maximum(left.nearest, right.nearest) > NEUTRAL
    for k, ends in enumerate(zip(left.crossings, right.crossings, *slopes, strict=True)):
        turn = _turn(*map(float, ends)) if far[k] and along > RESOLVED else None
        if turn is None:
            continue
        try:
            point = point_along(left, turn * along, (right.x - left.x - along * left.tangent) / along**2)
        except LostError:
            continue
        here, there, at = ends[0], ends[1], float(point.crossings[k])
        if abs(at) > NEUTRAL * max(abs(here), abs(there)) and at * here < 0.0 < here * there:
            return point
        found = (_beyond(left, point, looks - 1) or _beyond(point, right, looks - 1)) if looks > 1 else None
        if found is not None:
            return found
    return None


def _turn(here: float, there: float, begin: float, end: float) -> float | None:
    """Where a cubic of two values and slopes first turns round beyond zero, or nearly does, from 0 to 1."""
    square, cube = 3.0 * (there - here) - 2.0 * begin - end, 2.0 * (here - there) + begin + end
    discriminant = square**2 - 3.0 * cube * begin
    if not 0.0 < discriminant < math.inf:
        return None
    # of the roots of its derivative neither is a difference of nearly equal numbers
    large = -square - math.copysign(math.sqrt(discriminant), square)
    turns = sorted(a / b for a, b in ((large, 3.0 * cube), (begin, large)) if b and 0.0 < a / b < 1.0)
    values = [here + t * (begin + t * (square + t * cube)) for t in turns]
    signs = [value > 0.0 for value in (here, *values, there)]
    passes = sum(one != other for one, other in itertools.pairwise(signs)) > (signs[0] != signs[-1])
    least = NEARLY * min(abs(here), abs(there))
    return next((t for t, value in zip(turns, values, strict=True) if passes or abs(value) < least), None)


def _is_complex(point: Point) -> bool:
    """Whether the two multipliers of which the product is nearest to 1 are complex."""
    i, j = np.triu_indices(point.multipliers.size, 1)
    k = int(np.argmin(np.abs(point.pair_products)))
    return bool(abs(point.multipliers[i[k]].imag) > 1e-6 and abs(point.multipliers[j[k]].imag) > 1e-6)


def _outside_circle(point: Point) -> float:
    """By how much the complex multipliers nearest to the unit circle are outside it; 0 if there are none."""
    far = np.abs(point.multipliers[np.abs(point.multipliers.imag) > 1e-6]) - 1.0
    return float(far[np.argmin(np.abs(far))]) if far.size else 0.0


def _from_start(start: Point, point: Point) -> Array:
    """Unknowns of a point less those of a start, with phases that may have turned by whole cycles."""
    states, phases = point.events.states, point.events.phases
    turns = 2.0 * math.pi * round((phases[0] - start.events.phases[0]) / (2.0 * math.pi))
    return point.curve.unknowns(states, phases - turns, point.value) - start.x


def _passes(start: Point, left: Point, right: Point) -> bool:
    """Whether a curve comes back to its start in a step."""
    before, after = (_from_start(start, each) for each in (left, right))
    along = [float(start.row @ each) for each in (before, after)]
    if left is start or not along[0] < 0.0 <= along[1]:
        return False
    # where the line between both passes the start
    crossing = before - along[0] / (along[1] - along[0]) * (after - before)
    if crossing @ (start.curve.weight * crossing) > (0.2 * start.longest) ** 2:
        return False
    try:
        there = locate(left, right, lambda point: float(start.row @ _from_start(start, point)))
    except LostError:
        return False
    # another sheet may be near
    return bool(np.abs(_from_start(start, there)).max() < SAME * start.longest / LONGEST)
