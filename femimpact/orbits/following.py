"""A curve of orbits followed one way: its steps, the events on it located, and why it ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

from femimpact.arrays import Array
from femimpact.errors import DivergenceError
from femimpact.integrators.event_driven.loop_data import CONTACT, SEPARATING
from femimpact.orbits.curve import RATES, Curve, Point, corrected, evaluated
from femimpact.orbits.equations import IMPACT, PRESS_AGAIN, RELEASE, SECTION, SEPARATE, TOUCH, known_flow
from femimpact.orbits.newton import EXACT, ROUNDED
from femimpact.orbits.own_runs import OwnRuns, own_runs
from femimpact.orbits.verification import check_events, check_missed, other_event
from femimpact.response.impacts import EventLog
from femimpact.system.system import System

LONGEST, SHORTEST = 0.02, 1e-8
"""Steps along a curve, of which the unit is the range of the parameter, and the unit of the states."""

TURN = 0.95
"""Least cosine between the tangents at the ends of a step."""

NEAR_CIRCLE = 0.3
"""Distance of a multiplier from the unit circle below which it may not move far in a step."""

MOST_MOVED = 0.1
"""By which it may move."""

RESOLVED = 1e-5
"""Step below which a curve is not followed more closely for its multipliers."""

NEAR_END = 1e-4
"""Distance to the end of a curve at which its multipliers are followed no further: at no speed they are infinite."""

ON_SYMMETRIC = 1e-3
"""Share of the asymmetry at the beginning of a step below which its end is taken for a symmetric orbit."""

NEAR_SYMMETRIC = 2e-3
"""The same distance to a symmetric branch, beside which the equations are singular."""

MOST_SECANTS = 20
"""Steps of a secant method."""

MOST_CRESTS = 10
"""Crests of a gap between two points of which the first to reach a wall is looked for."""

SAME_PHASE = 1e-5
"""Difference of phases (rad) up to which an event of a run is that of its orbit."""

BEFORE_CREST = 1e-4
"""Share of the way to a crest at the wall that lies between it and the last orbit that is looked at."""

SLOW = 1e-3
"""Speed of an impact, in lengths and rad, below which no run confirms it: rounding decides whether it is met."""

AT_ONCE = 64
"""Points that are verified in one call."""

PROFILE = 257
"""Instants of an interval between events among which the highest crest of a gap is looked for."""

CLOSED = "closed on itself"
"""Why a closed curve ends."""

CHANGES = {"fold": 1, "period-doubling": 1, "symmetry-breaking": 1, "branch-point": 1, "neimark-sacker": 2}
"""How many multipliers cross the unit circle at each kind of bifurcation."""


@dataclass(frozen=True, eq=False)
class Followed:
    """One way along a curve from its start, which is the first point."""

    points: list[Point]
    kinds: dict[int, str]  # of bifurcations, by the number of their points
    peak: list[float]  # of each point, see `OwnRuns`
    first_harmonic: list[float]
    end: str


class _LostError(Exception):
    """A curve has no point where one was looked for."""


def follow(system: System, start: Point, low: float, high: float, most: int) -> Followed:
    """Points along the tangent of a start as far as values (low, high), or so many points, and its own event."""
    way = Followed([start], {}, [], [], "")
    left, step = start, LONGEST
    end = _outside(start, low, high)
    while not end:
        try:
            after, located, step, end = _advance(start, left, step, low, high)
        except _LostError as lost:
            end = f"no convergence: {lost}"
        else:
            closed = after is not None and _passes(start, left, after)
            for kind, point in located:
                # beyond the start it is one that was found
                if not (closed and float(start.row @ _from_start(start, point)) > 0.0):
                    way.kinds[len(way.points)] = kind
                    way.points.append(point)
            if after is not None:
                left = start if closed else after
                way.points.append(left)
            end = CLOSED if closed else end
        if not end and len(way.points) >= most:
            end = f"number of points: {most}"
        if len(way.points) - len(way.peak) >= AT_ONCE:
            end = _verify(system, way) or end
    if len(way.peak) < len(way.points):
        end = _verify(system, way) or end
    return replace(way, end=end)


def _outside(point: Point, low: float, high: float) -> str:
    """The edge that a curve leaves by at a point, if it does."""
    value, rises = point.value, point.tangent[-1] > 0.0
    edge = high if rises else low
    return _edge(point, edge) if abs(value - edge) <= 1e-12 * (high - low) else ""


def _edge(point: Point, value: float) -> str:
    return f"edge: {point.curve.parameter.path} = {value:g}"


def _point(left: Point, step: float, bend: Array | float = 0.0) -> Point:
    """The point so far along the tangent of another one, near to where a parabola leads."""
    point, change = corrected(left.curve, left.x + step * left.tangent + step**2 * bend, left.row)
    if point is None:
        raise _LostError(f"the last step of Newton's method changed the orbit by {change:.2g}")
    return point


def _locate(left: Point, right: Point, function: Callable[[Point], float], tolerance: float = EXACT) -> Point:
    """The point between two others at which a function of the points vanishes, that has two signs at them."""
    length = float(left.row @ (right.x - left.x))
    bend = (right.x - left.x - length * left.tangent) / length**2
    known = {0.0: left, length: right}

    def at(step: float) -> float:
        if step not in known:
            known[step] = _point(left, step, bend)
        return function(known[step])

    try:
        step = float(scipy.optimize.toms748(at, 0.0, length, xtol=tolerance, rtol=1e-14, maxiter=60))
    except (ValueError, RuntimeError):
        raise _LostError("an event on the curve cannot be located") from None
    return _point(left, step, bend)


def _moved(left: Point, right: Point) -> float:
    """By how much a multiplier near the unit circle has moved."""
    here, there = left.multipliers, right.multipliers
    apart = np.abs(here[:, None] - there)
    near = [np.abs(np.abs(values) - 1.0) < NEAR_CIRCLE for values in (here, there)]
    return float(max(apart[near[0]].min(axis=1).max(initial=0.0), apart[:, near[1]].min(axis=0).max(initial=0.0)))


def _advance(
    start: Point, left: Point, step: float, low: float, high: float
) -> tuple[Point | None, list[tuple[str, Point]], float, str]:
    """The next point, the events before it, the step after it, and the reason if the curve ends there."""
    while True:
        try:
            right, end = _point(left, step), ""
            if not low <= right.value <= high:
                right, end = _at_edge(left, right, low if right.value < low else high)
            if not left.row @ right.tangent > TURN:
                raise _LostError("the curve turns too sharply")
            limit = _first_limit(left, right)
            if limit is not None and limit.far > limit.near:
                # its multipliers are followed nearly up to the end
                step = 0.7 * limit.far
                continue
            if limit is not None:
                return None, *_limit_point(left, right, limit)
            moved = _moved(left, right)
            if moved > MOST_MOVED and step > RESOLVED:
                step *= max(0.8 * MOST_MOVED / moved, 0.25)
                continue
            located = _located(left, right)
            explained = sum(CHANGES[kind] for kind, _ in located)
            change = abs(right.unstable - left.unstable)
            if (change > explained or (change - explained) % 2) and step > RESOLVED:
                step *= 0.5
                continue
        except _LostError:
            step *= 0.5
            if step < NEAR_END and (point := _near_no_contact(left)) is not None:
                return None, *_at_no_speed(point)
            if step < NEAR_END and left.curve.may_lose_symmetry and (point := _symmetric(left)) is not None:
                return None, *_joining(point)
            if step < SHORTEST:
                raise
            continue
        grown = min(1.5, 0.8 * MOST_MOVED / max(moved, 1e-9)) if moved else 1.5
        return right, located, min(LONGEST, step * max(grown, 0.5)), end


def _at_edge(left: Point, right: Point, value: float) -> tuple[Point, str]:
    """The point between two others that has a value."""
    share = (value - left.value) / (right.value - left.value)
    found = at_value(left.curve, left.x + share * (right.x - left.x), value)
    if found is None:
        raise _LostError(f"no orbit found at {value:g}")
    aligned = found if left.row @ found.tangent > 0.0 else replace(found, tangent=-found.tangent)
    return aligned, _edge(found, value)


def at_value(curve: Curve, near: Array, value: float) -> Point | None:
    """The point next to some unknowns with a value of the parameter."""
    guess, row = near.copy(), np.zeros(near.size)
    guess[-1], row[-1] = value, 1.0
    return corrected(curve, guess, row)[0]


def _located(left: Point, right: Point) -> list[tuple[str, Point]]:
    """Bifurcations between two points, in their order."""
    found = []
    for kind, before in left.tests.items():
        if not before * right.tests[kind] < 0.0:
            continue
        point = _locate(left, right, lambda point, kind=kind: point.tests[kind])  # type: ignore[misc]
        # a real pair with product 1 is none
        if kind != "neimark-sacker" or _is_complex(point):
            found.append((kind, point))
    return sorted(found, key=lambda each: float(left.row @ each[1].x))


def _is_complex(point: Point) -> bool:
    """Whether the two multipliers of which the product is nearest to 1 are complex."""
    i, j = np.triu_indices(point.multipliers.size, 1)
    k = int(np.argmin(np.abs(point.pair_products)))
    return bool(abs(point.multipliers[i[k]].imag) > 1e-6 and abs(point.multipliers[j[k]].imag) > 1e-6)


# ---- where a curve ends -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Limit:
    """A number that ends a curve where it is zero."""

    function: Callable[[Point], float] | None  # None where a symmetric branch is met
    far: float  # how far along the tangent, roughly
    near: float  # how far it may be where the curve is followed no further


def _first_limit(left: Point, right: Point) -> _Limit | None:
    """The first of the limits that a step passes."""
    found = []
    for i in np.flatnonzero((right.limits <= 0.0) & (left.limits > 0.0)).tolist():

        def function(point: Point, i: int = i) -> float:
            return float(point.limits[i])

        near = _locate(left, right, function, 0.1 * NEAR_END)
        found.append(_Limit(function, float(left.row @ (near.x - left.x)), NEAR_END))
    if left.curve.may_lose_symmetry and (apart := right.apart(left)) <= ON_SYMMETRIC:
        far = float(left.row @ (right.x - left.x)) / (1.0 - apart)
        found.append(_Limit(None, far, NEAR_SYMMETRIC))
    return min(found, key=lambda each: each.far, default=None)


def _limit_point(left: Point, right: Point, limit: _Limit) -> tuple[list[tuple[str, Point]], float, str]:
    """The point at a limit, as of `_advance`."""
    if limit.function is None:
        point = _symmetric(left)
        if point is None:
            raise _LostError("it is nearly symmetric, and no symmetric orbit is found there")
        return _joining(point)
    return _at_no_speed(_locate(left, right, limit.function))


def slowest(point: Point) -> float:
    """Speed of the slowest event, in units."""
    return float(np.abs(point.limits[: point.curve.events]).min())


def _joining(point: Point) -> tuple[list[tuple[str, Point]], float, str]:
    """A point on a symmetric branch, as of `_advance`."""
    return [("symmetry-breaking", point)], 0.0, f"joins a symmetric branch {_where(point)}"


def _at_no_speed(point: Point) -> tuple[list[tuple[str, Point]], float, str]:
    """A point at which events lose their speed or their order, as of `_advance`."""
    solved = point.curve.solved
    still = [k for k, kind in enumerate(solved.kind) if kind in (IMPACT, TOUCH) and abs(point.limits[k]) < ROUNDED]
    if not still:
        return [], 0.0, f"two events at one instant, {_where(point)}"
    k, j, side = still[0], int(solved.pair[still[0]]), float(solved.side[still[0]])
    leaves = _gap(point, k, j, side, point.orbit[1][k : k + 1], 2)[0] < 0.0
    kind, words = ("grazing", "impact speed zero") if leaves else ("sticking", "sticking after an impact at no speed")
    name = point.curve.parameter.at(point.value)[0].contacts[j].name
    return [(kind, point)], 0.0, f"{words}, of {name} {_where(point)}"


def _near_no_contact(left: Point) -> Point | None:
    """The point at which a Kelvin-Voigt contact has no duration, if one is near.

    Its events are one there, and the equations singular: it is extrapolated from points before it.
    """
    speeds = [left.limits[k] for k, kind in enumerate(left.curve.solved.kind) if kind == TOUCH]
    if min(speeds, default=math.inf) > 0.1 * LONGEST:
        return None
    k, step = left.limits.tolist().index(min(speeds)), NEAR_END
    for _ in range(2):
        points = [left, *_near_points(left, (-0.5 * step, -step))]
        if len(points) < 3:
            return None
        speed = np.array([point.limits[k] for point in points])
        if not speed[0] < speed[1] < speed[2]:
            return None
        others = [np.delete(speed, i) for i in range(3)]
        share = [float(np.prod(other / (other - at))) for other, at in zip(others, speed, strict=True)]
        x = np.asarray(np.array(share) @ np.array([point.x for point in points]))
        step = float(left.row @ (x - left.x))
        if not 0.0 < step < LONGEST:
            return None
        # once more from nearer
        left, step = next(iter(_near_points(left, (0.9 * step,))), left), 0.1 * step
    return evaluated(left.curve, x, left.tangent)


def _near_points(left: Point, steps: tuple[float, ...]) -> list[Point]:
    """Points so far along the tangent of one, those that are found."""
    found = [corrected(left.curve, left.x + step * left.tangent, left.row)[0] for step in steps]
    return [point for point in found if point is not None]


def _where(point: Point) -> str:
    return f"at {point.curve.parameter.path} = {point.value:.10g}"


def _symmetric(left: Point) -> Point | None:
    """The symmetric orbit at -1 of a half multiplier that a branch near it comes to.

    The equations without symmetry are singular there: those of the half map are not.
    """
    states, phases = left.orbit
    curve, half = replace(left.curve, is_symmetric=True), len(phases) // 2
    later = phases[half:] - math.pi * curve.sequence.cycles
    x = curve.unknowns(0.5 * (states[:half] - states[half:]), 0.5 * (phases[:half] + later), left.value)
    value, step, before = left.value, 1e-6 * curve.width, None
    for _ in range(MOST_SECANTS):
        point = at_value(curve, x, value)
        if point is None:
            return None
        x, test = point.x, point.tests["symmetry-breaking"]
        if before is not None and test != before:
            step *= -test / (test - before)
        value, before = value + step, test
        if abs(step) <= EXACT * abs(value):
            found = left.curve.unknowns(*point.orbit, point.value)
            far = found - left.x
            near = far @ (left.curve.weight * far) < LONGEST**2
            return evaluated(left.curve, found, left.tangent) if near else None
    return None


def _from_start(start: Point, point: Point) -> Array:
    """Unknowns of a point less those of a start, with phases that may have turned by whole cycles."""
    states, phases = point.orbit
    turns = 2.0 * math.pi * round((phases[0] - start.orbit[1][0]) / (2.0 * math.pi))
    return point.curve.unknowns(states, phases - turns, point.value) - start.x


def _passes(start: Point, left: Point, right: Point) -> bool:
    """Whether a curve comes back to its start in a step."""
    before, after = (_from_start(start, each) for each in (left, right))
    along = [float(start.row @ each) for each in (before, after)]
    if left is start or not along[0] < 0.0 <= along[1]:
        return False
    # where the line between both passes the start
    passed = before - along[0] / (along[1] - along[0]) * (after - before)
    return bool(passed @ (start.curve.weight * passed) < (0.2 * LONGEST) ** 2)


def _verify(system: System, way: Followed) -> str:
    """Cut a curve where its orbits are no motions of the system, and say why; their peaks are kept."""
    begin = len(way.peak)
    points = way.points[begin:]
    runs = own_runs(system, points)
    for i, point in enumerate(points):
        number = begin + i
        try:
            if not slowest(point) < SLOW:
                check_events(runs.logs[i], point.curve.sequence, runs.first[i])
                growth = float(np.abs(point.multipliers[0])) ** (2 if point.curve.is_symmetric else 1)
                check_missed(float(runs.missed[i]), growth)
        except DivergenceError as error:
            return _cut(system, way, number, runs, i, error)
        way.peak.append(float(runs.peak[i]))
        way.first_harmonic.append(float(runs.first_harmonic[i]))
    return ""


def _cut(system: System, way: Followed, number: int, runs: OwnRuns, i: int, error: DivergenceError) -> str:
    """End a curve before a point, at the crest of a gap that reaches a wall if there is one."""
    left, right = way.points[max(number - 1, 0)], way.points[number]
    del way.points[number:]
    for k in [k for k in way.kinds if k >= number]:
        del way.kinds[k]
    for _ in range(MOST_CRESTS):
        extra = _extra_event(right, runs, i)
        if extra is None or not number:
            break
        log, row, at = extra
        pair, side = int(log.pair[row]), float(log.side[row])
        kind = _kind_there(right, str(log.kind[row]), pair, at)
        try:
            beyond = kind == TOUCH and log.kind[row] in (RELEASE, SEPARATE)
            found = _locate(left, right, _crest(right, kind, pair, side, at, beyond))
        except _LostError:
            break
        # whether another one is met before
        before = _near_points(left, ((1.0 - BEFORE_CREST) * float(left.row @ (found.x - left.x)),))
        if not before:
            break
        runs, i, right = own_runs(system, [before[0], found]), 0, before[0]
        if _extra_event(right, runs, 0) is None:
            way.kinds[len(way.points)] = "grazing"
            way.points.append(found)
            way.peak.append(float(runs.peak[1]))
            way.first_harmonic.append(float(runs.first_harmonic[1]))
            what = "contact" if kind == TOUCH else kind
            return f"extra {what} of {log.contacts[pair]} on its {'+' if side > 0.0 else '-'} side {_where(found)}"
    return f"no convergence: {error}"


def _extra_event(point: Point, runs: OwnRuns, i: int) -> tuple[EventLog, int, float] | None:
    """The first event of a run that is none of its orbit's: its row in the log, and its phase in the orbit's cycle."""
    log, sequence, (_, phases) = runs.logs[i], point.curve.sequence, point.orbit
    met = runs.phase[i] + float(point.passed.hybrid.omega) * log.time
    expected = np.roll(np.where(np.arange(phases.size) < runs.first[i], phases + point.cycle, phases), -runs.first[i])
    expected = expected[np.roll(np.array(sequence.kind) != SECTION, -runs.first[i])]
    count = min(met.size, expected.size)
    other = other_event(log, sequence, runs.first[i])
    late = np.flatnonzero(np.abs(met[:count] - expected[:count]) > SAME_PHASE)
    row = min([*late[:1].tolist(), *([] if other is None else [other])], default=met.size)
    return (log, row, float(phases[0] + (met[row] - phases[0]) % point.cycle)) if row < met.size else None


def _kind_there(point: Point, kind: str, pair: int, at: float) -> str:
    """What an extra event is from the contact state that its pair has in the orbit: a run may begin beyond a wall."""
    k = int(np.searchsorted(point.orbit[1], at, side="right")) - 1
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
    k, hybrid = int(np.searchsorted(right.orbit[1], at, side="right")) - 1, right.passed.hybrid
    of_force, sign = kind in (RELEASE, PRESS_AGAIN), RATES.get(kind, 1.0)
    damped = float(hybrid.contact_damping[pair] / hybrid.contact_stiffness[pair]) if of_force else 0.0

    def condition(point: Point, phases: Array, derivative: int) -> Array:
        found = _gap(point, k, pair, side, phases, derivative)
        return sign * (found + damped * _gap(point, k, pair, side, phases, derivative + 1) if damped else found)

    def tops(point: Point) -> list[tuple[float, float]]:
        """Phases after the event before between which each crest is."""
        begin, end = np.append(point.orbit[1], point.orbit[1][0] + point.cycle)[k : k + 2]
        grid = np.linspace(begin, end, PROFILE)
        rates = condition(point, grid, 1)
        found = np.flatnonzero((rates[:-1] > 0.0) & (rates[1:] <= 0.0))
        return list(zip(grid[found] - begin, grid[found + 1] - begin, strict=True))

    # met before its crest, or left behind it by a run that begins beyond the wall
    after, places = at - right.orbit[1][k], tops(right)
    if begun_beyond:
        place = max((high for low, high in places if low <= after), default=after)
    else:
        place = min((high for _, high in places if high >= after), default=after)

    def crest(point: Point) -> float:
        between, begin = tops(point), point.orbit[1][k]
        if not between:
            return -1.0
        low, high = min(between, key=lambda top: abs(top[1] - place))
        highest = scipy.optimize.brentq(
            lambda phase: float(condition(point, np.array([phase]), 1)[0]), begin + low, begin + high
        )
        return float(condition(point, np.array([highest]), 0)[0]) / float(point.curve.by_rows[-1])

    return crest


def _gap(point: Point, k: int, pair: int, side: float, phases: Array, derivative: int) -> Array:
    """Depth (n,) beyond a wall at phases (n,) after event k, m, or its first or second derivative by the time."""
    hybrid, (states, begun) = point.passed.hybrid, point.orbit
    flow, d = known_flow(hybrid, point.curve.sequence.contact_state[k], point.flows), hybrid.mass.size
    z, _ = flow.carried(np.tile(states[k], (phases.size, 1)), np.full(phases.size, begun[k]), phases)
    moves = (z[:, :d], z[:, d:], flow.field(z, phases)[:, d:])[derivative]
    sine = (np.sin(phases), np.cos(phases), -np.sin(phases))[derivative]
    base = hybrid.amplitude * hybrid.omega**derivative * sine
    wall = 0.0 if derivative else float(hybrid.gaps[pair, 0 if side > 0.0 else 1])
    return np.asarray(-side * (moves @ hybrid.force[:, pair] + hybrid.in_space[pair] * base) - wall)
