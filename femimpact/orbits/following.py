"""A curve of orbits followed one way: its steps, the bifurcations on it, and where and why it ends.

A curve ends at an edge of its range, where an event loses its speed or its order, and where a branch of orbits that
repeat after half a period is met. Its solutions are no motions of the system beyond where the crest of a condition
reaches that of an event which they do not have: their own runs meet it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.interpolate
import scipy.optimize

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError
from femimpact.integrators.event_driven.loop_data import CONTACT, SEPARATING
from femimpact.orbits.curve import (
    AROUND,
    LONGEST,
    SAME,
    LostError,
    Point,
    at_value,
    between,
    evaluated,
    interpolated,
    locate,
    near_points,
    point_along,
)
from femimpact.orbits.equations import EXACT, SECTION
from femimpact.orbits.motion import IMPACT, PRESS_AGAIN, RELEASE, SEPARATE, TOUCH
from femimpact.orbits.orbit import NEUTRAL
from femimpact.orbits.verification import SAME_PHASE, OwnRun, own_runs
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
"""Points that are verified in one call: one that is followed in vain, beyond where its orbits are no motions, costs ms.
"""

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

MOST_CRESTS = 10
"""Crests of a gap between two points of which the first to reach a wall is looked for."""

BEFORE_CREST = 1e-4
"""Share of the way to a crest at the wall that lies between it and the last orbit that is looked at."""

SLOW = 1e-3
"""Speed of an impact, in lengths and rad, below which no run confirms it: rounding decides whether it is met."""

CLOSED = "closed on itself"
"""Why a closed curve ends."""

CHANGES = {"fold": 1, "period-doubling": 1, "symmetry-breaking": 1, "branch-point": 1, "neimark-sacker": 2}
"""How many multipliers cross the unit circle at each kind of bifurcation."""


class EndError(Exception):
    """Where a curve ends: why, and the bifurcation there if it is one."""

    def __init__(self, words: str, point: Point | None = None, kind: str = "") -> None:
        super().__init__(words)
        self.bifurcation = [(kind, point)] if kind and point is not None else []


@dataclass(frozen=True, eq=False)
class Followed:
    """A point of a curve that was followed."""

    point: Point
    kind: str = ""  # of its bifurcation
    # m: largest displacement of the place and its first harmonic, where its own run confirms the orbit
    peak: float = math.nan
    first_harmonic: float = math.nan


def follow(system: System, start: Point, low: float, high: float, most: int) -> tuple[list[Followed], str]:
    """Points along the tangent of a start as far as values (low, high), or so many points, and why they end there.

    The start is the first of them.
    """
    way, verified = [Followed(start)], 0
    left, step, bend = start, start.longest, np.zeros_like(start.x)
    end = _outside(start, low, high)
    while not end:
        try:
            right, located, step = _advance(left, bend, step, low, high)
        except EndError as reached:
            way += [Followed(point, kind) for kind, point in reached.bifurcation]
            end = str(reached)
        except LostError as lost:
            end = f"no convergence: {lost}"
        else:
            closed = _passes(start, left, right)
            # beyond the start it is one that was found
            way += [
                Followed(point, kind)
                for kind, point in located
                if not (closed and float(start.row @ _from_start(start, point)) > 0.0)
            ]
            # the last point may be where the one before it was
            length = float(left.row @ (right.x - left.x))
            bend = (right.tangent - left.tangent) / (2.0 * length) if length > 0.0 else np.zeros_like(left.x)
            left = start if closed else right
            way.append(Followed(left))
            end = CLOSED if closed else _outside(left, low, high)
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
    """Words for the edge that a curve leaves by at a point, if it does."""
    edge = high if point.tangent[-1] > 0.0 else low
    at_edge = abs(point.value - edge) <= 1e-12 * (high - low)
    return f"edge: {point.curve.parameter.path} = {edge:g}" if at_edge else ""


def _moved(left: Point, right: Point) -> float:
    """By how much a multiplier near the unit circle has moved."""
    here, there = left.multipliers, right.multipliers
    apart = np.abs(here[:, None] - there)
    near = [np.abs(np.abs(values) - 1.0) < NEAR_CIRCLE for values in (here, there)]
    return float(max(apart[near[0]].min(axis=1).max(initial=0.0), apart[:, near[1]].min(axis=0).max(initial=0.0)))


def _advance(
    left: Point, bend: Array, step: float, low: float, high: float
) -> tuple[Point, list[tuple[str, Point]], float]:
    """The next point, the bifurcations before it, and the step after it.

    `bend` is half the change of the tangent along the curve, as far as it is known. Raises `EndError` at a limit.
    """
    while True:
        try:
            right = point_along(left, step, bend)
            if low <= right.value <= high and left.tangent[-1] * right.tangent[-1] < 0.0:
                fold = locate(left, right, lambda point: point.tests["fold"])
                # it may turn round beyond the range
                right = right if low <= fold.value <= high else fold
            if not low <= right.value <= high:
                right = between(left.curve, left.x, right.x, low if right.value < low else high)
            if not left.row @ right.tangent > TURN:
                raise LostError("the curve turns too sharply")
            limit = first_limit(left, right)
            if limit is not None and limit.far > limit.near:
                # its multipliers are followed nearly up to the end
                step = 0.7 * limit.far
                continue
            if limit is not None:
                raise limit_point(left, right, limit)
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
                raise at_no_speed(point) from None
            if step < NEAR_END and left.curve.half_sign and (point := repeating_point(left)) is not None:
                raise joining(point) from None
            if step < SHORTEST:
                raise
            continue
        grown = min(1.5, 0.8 * MOST_MOVED / max(moved, 1e-9)) if moved else 1.5
        return right, located, min(right.longest, step * max(grown, 0.5))


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


# ---- where it ends -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Limit:
    """A number that ends a curve where it is zero."""

    function: Callable[[Point], float] | None  # None where a branch of orbits that repeat after half a period is met
    far: float  # how far along the tangent, roughly
    near: float  # how far it may be where the curve is followed no further
    is_singular: bool = False  # True where two events merge


def first_limit(left: Point, right: Point) -> Limit | None:
    """The first of the limits that a step passes."""
    found = []
    for i in np.argwhere((right.limits <= 0.0) & (left.limits > 0.0)).tolist():

        def function(point: Point, i: tuple[int, ...] = tuple(i)) -> float:
            return float(point.limits[i])

        near = locate(left, right, function, 0.1 * NEAR_END)
        merging = i[0] < 2 and near.curve.solved.kind[i[1]] in MERGING and without_speed(near, 10.0 * NEAR_END)
        found.append(Limit(function, float(left.row @ (near.x - left.x)), NEAR_END, bool(merging)))
    if left.curve.half_sign and (apart := right.apart(left)) <= ON_SYMMETRIC:
        far = float(left.row @ (right.x - left.x)) / (1.0 - apart)
        found.append(Limit(None, far, NEAR_SYMMETRIC))
    return min(found, key=lambda each: each.far, default=None)


def limit_point(left: Point, right: Point, limit: Limit) -> EndError:
    """The end of a curve at a limit."""
    if limit.function is None:
        point = repeating_point(left)
        if point is None:
            raise LostError("it nearly repeats after half a period, and no orbit that does is found there")
        return joining(point)
    if limit.is_singular:
        return at_no_speed(interpolated(left, right, limit.function, NEARER))
    return at_no_speed(locate(left, right, limit.function))


def at_no_speed(point: Point) -> EndError:
    """The end of a curve at a point at which events lose their speed or their order."""
    solved, still = point.curve.solved, without_speed(point, AT_WALL)
    if not still:
        return EndError(f"two events at one instant, {where(point)}")
    k, j, side = still[0], int(solved.pair[still[0]]), float(solved.side[still[0]])
    name, kind = point.curve.parameter.at(point.value)[0].contacts[j].name, solved.kind[k]
    if kind == PRESS_AGAIN and abs(point.limits[2, k]) < AT_WALL:
        return EndError(f"press again at the wall, of {name} {where(point)}", point, "grazing")
    if kind in MERGING:
        return EndError(f"{kind} and {MERGING[kind]} at one instant, of {name} {where(point)}", point, "grazing")
    leaves = point.solution.motion.condition(k, (TOUCH, j, side), point.events.phases[[k]])[2, 0] < 0.0
    kind, words = ("grazing", "impact speed zero") if leaves else ("sticking", "sticking after an impact at no speed")
    return EndError(f"{words}, of {name} {where(point)}", point, kind)


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


def joining(point: Point) -> EndError:
    """The end of a curve at a point on a branch of orbits that repeat after half a period."""
    if point.curve.half_sign > 0.0:
        return EndError(f"joins the branch of half its period {where(point)}", point, "period-doubling")
    return EndError(f"joins a symmetric branch {where(point)}", point, "symmetry-breaking")


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
        x = np.asarray(scipy.interpolate.BarycentricInterpolator(speed, np.array([point.x for point in points]))(0.0))
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
            found = left.curve.unknowns(*both, point.value)
            far = found - left.x
            near = far @ (left.curve.weight * far) < LONGEST**2
            return evaluated(left.curve, found, left.tangent) if near else None
    return None


# ---- what is no motion ----------------------------------------------------------------------------


def refusal(point: Point, run: OwnRun) -> DivergenceError | None:
    """Why its own run does not confirm the orbit of a point; None where it does, or an impact is too slow for that."""
    growth = float(np.abs(point.multipliers[0])) ** (2 if point.curve.is_symmetric else 1)
    try:
        run.check_events()
        run.check_missed(growth)
    except DivergenceError as error:
        return None if _is_slow(point, run) else error
    return None


def runs_of(system: System, points: list[Point]) -> list[OwnRun]:
    """Runs over one period of the orbits of some points."""
    parameter = points[0].curve.parameter
    # where the parameter is in the matrices, the closed forms of each differ
    systems = [parameter.at(point.value)[0] for point in points] if parameter.of_matrices else [system]
    excitation, solutions = parameter.at(parameter.value)[1], [point.solution for point in points]
    return own_runs(systems, excitation, solutions, place=parameter.place or None)


def _is_slow(point: Point, run: OwnRun) -> bool:
    """Whether a run leaves its orbit at an event so slow that rounding decides whether it is met."""
    n, kinds = point.curve.count, point.curve.solved.kind
    slow = [k for k in range(n) if kinds[k] != SECTION and np.any(np.abs(point.limits[[0, 2], k]) < SLOW)]
    if run.extra is None or not slow:
        return bool(slow)
    count = len(point.curve.sequence.kind)
    met = (run.first + run.extra[0]) % count
    return any(abs(met - k - half) <= 1 for k in slow for half in (0, n, count))


def verify(system: System, way: list[Followed], begin: int) -> str:
    """Cut a curve where its orbits from one on are no motions of the system, and say why; their peaks are kept."""
    unbounded = ""
    while True:
        try:
            runs = runs_of(system, [each.point for each in way[begin:]])
            break
        except InputError as error:
            # a resonance, at the last point of which the damping is zero
            if len(way) == 1:
                raise
            unbounded = f"no convergence: {error}"
            del way[-1]
            if len(way) == begin:
                return unbounded
    for number, run in enumerate(runs, begin):
        each = way[number]
        refused = None if each.kind == "grazing" else refusal(each.point, run)
        if refused is not None:
            return _cut(system, way, number, run, refused)
        way[number] = replace(each, peak=run.peak, first_harmonic=run.first_harmonic)
    return unbounded


def _cut(system: System, way: list[Followed], number: int, run: OwnRun, error: DivergenceError) -> str:
    """End a curve before a point, at the crest of a gap that reaches a wall if there is one."""
    left, right = way[max(number - 1, 0)].point, way[number].point
    del way[number:]
    for _ in range(MOST_CRESTS):
        if run.extra is None or not number:
            break
        (row, at), log = run.extra, run.log
        pair, side = int(log.pair[row]), float(log.side[row])
        kind = _kind_there(right, str(log.kind[row]), pair, at)
        try:
            beyond = kind == TOUCH and log.kind[row] in (RELEASE, SEPARATE)
            found = locate(left, right, _crest(right, kind, pair, side, at, beyond))
        except LostError:
            break
        # whether another one is met before
        before = near_points(left, ((1.0 - BEFORE_CREST) * float(left.row @ (found.x - left.x)),))
        if not before:
            break
        right = before[0]
        run, at_wall = runs_of(system, [right, found])
        if run.extra is None:
            way.append(Followed(found, "grazing", at_wall.peak, at_wall.first_harmonic))
            what = "contact" if kind == TOUCH else kind
            return f"extra {what} of {log.contacts[pair]} on its {'+' if side > 0.0 else '-'} side {where(found)}"
    return f"no convergence: {error}"


def _kind_there(point: Point, kind: str, pair: int, at: float) -> str:
    """What an extra event is from the contact state that its pair has in the orbit: a run may begin beyond a wall."""
    k = int(np.searchsorted(point.events.phases, at, side="right")) - 1
    state = abs(float(point.curve.sequence.contact_state[k, pair]))
    if state == CONTACT:
        return RELEASE
    if state == SEPARATING:
        return kind if kind == SEPARATE else PRESS_AGAIN
    return TOUCH


def _crest(
    right: Point, kind: str, pair: int, side: float, at: float, begun_beyond: bool
) -> Callable[[Point], float]:  # fmt: skip
    """How far beyond that of an event is the crest of its condition next to the phase at which a point has met it."""
    k, event = int(np.searchsorted(right.events.phases, at, side="right")) - 1, (kind, pair, side)
    numbers = _intervals(right, k, pair, -1 if begun_beyond else 1)

    def crests(point: Point) -> list[tuple[float, float]]:
        return [crest for m in numbers for crest in point.solution.motion.crests(event, m)]

    if begun_beyond:
        # the contact has turned the run from its orbit
        place = max(crests(right), key=lambda crest: crest[1], default=(at, 0.0))[0]
    else:
        place = min((phase for phase, _ in crests(right) if phase >= at - SAME_PHASE), default=at)
    place -= right.events.phases[k]

    def crest(point: Point) -> float:
        from_here = point.events.phases[k] + place
        nearest = min(crests(point), key=lambda crest: abs(crest[0] - from_here), default=None)
        return -1.0 if nearest is None else nearest[1] / float(point.curve.by_rows[-1])

    return crest


def _intervals(point: Point, k: int, pair: int, way: int) -> list[int]:
    """Events after which the pair goes on as after event k, until one of that pair: later ones, or earlier ones."""
    found, of = [k], point.curve.sequence.pair
    while len(found) < of.size and of[(found[-1] + (way > 0)) % of.size] != pair:
        found.append(found[-1] + way)
    return found[::way]
