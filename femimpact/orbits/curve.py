"""The curve of solutions over a parameter: its points, their tangents, and the functions that vanish at its events.

Unknown are states and phases as of `equations`, and the parameter. A symmetric orbit is that of its first half:
states half a period later are opposite, phases by half a period later.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.interpolate
import scipy.optimize
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex
from femimpact.orbits.equations import (
    EXACT,
    ROUNDED,
    EventMaps,
    EventSequence,
    EventStates,
    Solution,
    derivative_by,
    event_maps,
    halves_agree,
    jacobian,
    length_of,
    may_be_symmetric,
    multipliers_of,
    product,
    residual,
    units_of,
)
from femimpact.orbits.motion import PRESS_AGAIN, RELEASE
from femimpact.orbits.orbit import NEUTRAL
from femimpact.orbits.parameter import Parameter
from femimpact.units import number_text

MOST_STEPS = 8
"""Steps of Newton's method onto the curve: more are taken for a step along it that was too long."""

FAR = 0.5
"""Largest change, in units, of a step of Newton's method onto the curve."""

SAME = 1e-6
"""Difference between the halves of a period, in units, that is none."""

LONGEST = 0.02
"""Most that states and phases change in a step along a curve, in their units, and the parameter, in that of its range.

Of states larger than their unit it is a share of them.
"""

AROUND = 1e-3
"""Distance to a point at which the equations are singular of the points from which it is interpolated."""

DIFFERENCE = 1e-6
"""Step along a curve for a derivative by differences, whose error is as large by rounding as by the step."""

SETTLED = 1e-4
"""Change below which the derivative by the parameter is that of the step before."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Solutions with the same events. The m + 1 unknowns of a point are in units, the parameter, last, is not."""

    parameter: Parameter
    sequence: EventSequence
    is_symmetric: bool
    unit: Array  # (2d + 1,) of states and phases
    by_rows: Array  # (2d + 1,) of the equations
    width: float  # of the parameter: its range

    @cached_property
    def weight(self) -> Array:
        """Weights (m + 1,) of squares in the length of the curve."""
        m = self.count * self.unit.size
        return np.append(np.full(m, 1.0 / m), 1.0 / self.width**2)

    @property
    def count(self) -> int:
        """Number of events that have unknowns."""
        return len(self.solved.kind)

    @cached_property
    def solved(self) -> EventSequence:
        """The events that have unknowns."""
        if not self.is_symmetric:
            return self.sequence
        return replace(self.sequence.rows(slice(len(self.sequence.kind) // 2)), is_half=True)

    @cached_property
    def half_sign(self) -> float:
        """Sign with which an orbit may come to repeat after half a period: 1, -1 as a symmetric one does, 0 if none."""
        if self.is_symmetric:
            return 0.0
        twice = self.sequence.cycles % 2 == 0 and halves_agree(self.sequence, 1.0)
        return 1.0 if twice else -1.0 if may_be_symmetric(self.parameter.hybrid, self.sequence) else 0.0

    @cached_property
    def half(self) -> Curve:
        """The curve of the orbits that do."""
        if self.half_sign < 0.0:
            return replace(self, is_symmetric=True)
        first = self.sequence.rows(slice(len(self.sequence.kind) // 2))
        return replace(self, sequence=replace(first, cycles=self.sequence.cycles // 2))

    def unknowns(self, states: Array, phases: Array, value: float) -> Array:
        """Unknowns (m + 1,) of an orbit."""
        both = np.concatenate([states, phases[:, None]], axis=1)[: self.count] / self.unit
        return np.append(both.reshape(-1), value)

    def solved_events(self, x: Array) -> EventStates:
        """The events that have unknowns, with their states and phases."""
        both = x[:-1].reshape(self.count, -1) * self.unit
        return EventStates(self.solved, both[:, :-1], both[:, -1])

    def events_at(self, x: Array) -> EventStates:
        """All events, with their states and phases."""
        solved = self.solved_events(x)
        if not self.is_symmetric:
            return solved
        states, phases = solved.states, solved.phases
        later = phases + math.pi * self.sequence.cycles
        return EventStates(self.sequence, np.concatenate([states, -states]), np.concatenate([phases, later]))

    def sizes(self, x: Array) -> Array:
        """Sizes (3,) of a change of the unknowns: of states and phases, root mean squares in units, and parameter."""
        states, phases = np.split(x[:-1].reshape(self.count, -1), [-1], axis=1)
        m = self.count * self.unit.size
        return np.array(
            [np.linalg.norm(states), np.linalg.norm(phases), math.sqrt(m) * abs(x[-1]) / self.width]
        ) / math.sqrt(m)

    def by_unknowns(self, maps: EventMaps) -> Array:
        """Derivative (m, m) of the equations, in units."""
        found = jacobian(maps) / self.by_rows[:, None, None] * self.unit
        return np.asarray(found.reshape(2 * [self.count * self.unit.size]))

    def in_units(self, rows: Array) -> Array:
        """Equations (m,) in units of rows (N, 2d + 1)."""
        return np.asarray((rows / self.by_rows).reshape(-1))


def curve_of(parameter: Parameter, sequence: EventSequence, is_symmetric: bool, length: float, width: float) -> Curve:
    """The curve of some events, with a length (m) as unit of displacements."""
    return Curve(parameter, sequence, is_symmetric, *units_of(parameter.hybrid, sequence, length), width)


@dataclass(frozen=True, eq=False)
class Point:
    """A solution on a curve."""

    curve: Curve
    x: Array  # (m + 1,)
    tangent: Array  # (m + 1,) of unit length
    maps: EventMaps

    @property
    def value(self) -> float:
        """Of the parameter."""
        return float(self.x[-1])

    @property
    def row(self) -> Array:
        """Row (m + 1,) of the plane across the curve."""
        return self.curve.weight * self.tangent

    @cached_property
    def events(self) -> EventStates:
        """All events, with their states and phases."""
        return self.curve.events_at(self.x)

    @cached_property
    def solution(self) -> Solution:
        """All events, in the unit of the curve or of a motion that is far larger."""
        hybrid = self.maps.hybrid
        return Solution(hybrid, self.events, max(length_of(hybrid, self.events.states), float(self.curve.unit[0])))

    @property
    def longest(self) -> float:
        """Longest step from it along the curve: states may grow in proportion to their size."""
        most = LONGEST * np.array([max(1.0, self.curve.sizes(self.x)[0]), 1.0, 1.0])
        with np.errstate(divide="ignore"):
            return float(np.min(most / self.curve.sizes(self.tangent)))

    @property
    def cycle(self) -> float:
        """Phase (rad) of one period of the orbit."""
        return 2.0 * math.pi * self.curve.sequence.cycles

    @cached_property
    def multipliers(self) -> Complex:
        """Those of the half map of a symmetric orbit, else of the orbit; infinite where an event has no speed."""
        with np.errstate(all="ignore"):
            found = product(self.maps.steps)
        if not np.all(np.isfinite(found)):
            return np.full(found.shape[0], np.inf, dtype=complex)
        return multipliers_of(-found if self.curve.is_symmetric else found)

    @property
    def unstable(self) -> int:
        """Number of multipliers outside the unit circle."""
        return int(np.count_nonzero(np.abs(self.multipliers) > 1.0 + NEUTRAL))

    @cached_property
    def pair_products(self) -> NDArray[Any]:
        """1 - mu_i mu_j of each two multipliers, over 1 + |mu_i mu_j|, so that no product of them overflows."""
        i, j = np.triu_indices(self.multipliers.size, 1)
        both = self.multipliers[i] * self.multipliers[j]
        with np.errstate(invalid="ignore"):
            # of an impact without speed they are no numbers
            return np.asarray((1.0 - both) / (1.0 + np.abs(both)))

    @cached_property
    def tests(self) -> dict[str, float]:
        """Functions that change sign at bifurcations, by kind."""
        at_minus_one = "symmetry-breaking" if self.curve.is_symmetric else "period-doubling"
        (at_one, minus_one, pairs), slope = self.crossings.tolist(), float(self.tangent[-1])
        return {
            "fold": slope,
            at_minus_one: minus_one,
            # at a fold both change sign
            "branch-point": at_one * math.copysign(1.0, slope),
            "neimark-sacker": pairs,
        }

    @property
    def _factors(self) -> tuple[NDArray[Any], ...]:
        """1 less each multiplier, 1 and each multiplier, and 1 less each product of two."""
        return 1.0 - self.multipliers, 1.0 + self.multipliers, self.pair_products

    @cached_property
    def crossings(self) -> Array:
        """Functions (3,) that vanish where multipliers cross the unit circle, smooth also where two of them meet.

        At +1, at -1, and anywhere by a pair of product 1.
        """
        return np.array([np.prod(each).real for each in self._factors])

    @cached_property
    def nearest(self) -> Array:
        """Sizes (3,) of their smallest factors."""
        return np.array([np.abs(each).min(initial=math.inf) for each in self._factors])

    @cached_property
    def crossing_slopes(self) -> Array:
        """Their derivatives (3,) along the curve."""
        with np.errstate(all="ignore"):
            ahead = evaluated(self.curve, self.x + DIFFERENCE * self.tangent, self.tangent)
            return np.asarray((ahead.crossings - self.crossings) / DIFFERENCE)

    @cached_property
    def limits(self) -> Array:
        """Numbers (3, n) that are above zero as long as the events happen, at a speed and in their order.

        The rates of their conditions, the phases (rad) up to the next ones, and the speeds away from the wall at which
        contacts press again: at none they are at the wall itself, and would separate.
        """
        solved, unit = self.curve.solved, self.curve.by_rows[-1]
        between = solved.between(self.maps.events.phases)
        again, release = (np.array([kind == one for kind in solved.kind]) for one in (PRESS_AGAIN, RELEASE))
        # a contact without damping is released at the wall, and separates there
        between[release & ~np.any(self.maps.row[:, self.maps.row.shape[1] // 2 :], axis=1)] = math.inf
        away = np.where(again, -self.maps.speed / (unit * float(self.maps.hybrid.omega)), math.inf)
        return np.array([self.maps.distance_rate / unit, between, away])

    def apart(self, other: Point) -> float:
        """How far from repeating after half a period the orbit is, along the difference that another one has."""
        mine, its = (point.half_difference for point in (self, other))
        square = float(its @ its)
        # of an orbit that has repeated all the time there is none
        return float(mine @ its) / square if square > SAME**2 else 1.0

    @cached_property
    def half_difference(self) -> Array:
        """By what an orbit does not repeat after half a period, as of `Curve.half_sign`, in units."""
        states, phases, half = self.events.states, self.events.phases, len(self.events.phases) // 2
        turned = phases[half:] - phases[:half] - 0.5 * self.cycle
        return np.append(
            ((states[:half] - self.curve.half_sign * states[half:]) / self.curve.unit[:-1]).ravel(), turned
        )


def evaluated(curve: Curve, x: Array, tangent: Array) -> Point:
    """A point of known unknowns."""
    return Point(curve, x, tangent, event_maps(curve.parameter.hybrid_at(float(x[-1])), curve.solved_events(x)))


def null_vectors(point: Point) -> Array:
    """Two directions (2, m + 1) that change the equations least, the last one least, orthonormal with the weights."""
    curve, root = point.curve, np.sqrt(point.curve.weight)
    by_value = derivative_by(curve.parameter.hybrid_at, point.value, point.maps.events)
    matrix = np.column_stack([curve.by_unknowns(point.maps), curve.in_units(by_value)]) / root
    return np.asarray(np.linalg.svd(matrix)[2][-2:] / root)


def corrected(curve: Curve, guess: Array, row: Array) -> tuple[Point | None, float]:
    """The point of the curve next to a guess, on the plane through it across a row (m + 1,), and the last change.

    The tangent leads to where the row does.
    """
    x, change, m, by_value = guess, math.inf, guess.size - 1, np.zeros((0, 0))
    matrix = np.empty((m + 1, m + 1))
    matrix[m] = row
    # of states larger than their unit it is a share that rounding leaves
    size = np.repeat([max(1.0, curve.sizes(x)[0]), 1.0], [curve.unit.size - 1, 1])
    with np.errstate(all="ignore"):
        for _ in range(MOST_STEPS):
            last, events, hybrid = change, curve.solved_events(x), curve.parameter.hybrid_at(float(x[-1]))
            try:
                maps = event_maps(hybrid, events)
                if change > SETTLED:
                    by_value = derivative_by(curve.parameter.hybrid_at, float(x[-1]), events)
                matrix[:m, :m], matrix[:m, m] = curve.by_unknowns(maps), curve.in_units(by_value)
                right = np.zeros((m + 1, 2))
                right[:m, 0], right[m] = curve.in_units(residual(maps)), (row @ (x - guess), 1.0)
                step, along = np.linalg.solve(matrix, right).T
            except np.linalg.LinAlgError:
                # singular, or a resonance without damping
                break
            change = float(np.abs(step[:-1] / np.tile(size, curve.count)).max())
            change = max(change, abs(float(step[-1])) / curve.width)
            if change <= EXACT or (change <= ROUNDED and change >= 0.1 * last):
                return Point(curve, x, along / math.sqrt(along @ (curve.weight * along)), maps), change
            if not change < FAR:
                break
            x = x - step
    return None, change


class LostError(Exception):
    """A curve has no point where one was looked for."""


def point_along(left: Point, step: float, bend: Array | float = 0.0) -> Point:
    """The point so far along the tangent of another one, near to where a parabola leads."""
    point, change = corrected(left.curve, left.x + step * left.tangent + step**2 * bend, left.row)
    if point is None:
        raise LostError(f"the last step of Newton's method changed the orbit by {number_text(change, 2)}")
    return point


def near_points(left: Point, steps: tuple[float, ...]) -> list[Point]:
    """Points so far along the tangent of one, those that are found."""
    found = [corrected(left.curve, left.x + step * left.tangent, left.row)[0] for step in steps]
    return [point for point in found if point is not None]


def at_value(curve: Curve, near: Array, value: float) -> Point | None:
    """The point next to some unknowns with a value of the parameter."""
    guess, row = near.copy(), np.zeros(near.size)
    guess[-1], row[-1] = value, 1.0
    return corrected(curve, guess, row)[0]


def between(curve: Curve, here: Array, there: Array, value: float) -> Point:
    """The point at a value of the parameter between the unknowns of two others, on planes across the line of both.

    Raises `LostError` where it is not found.
    """
    line = there - here
    direction = line / math.sqrt(line @ (curve.weight * line))
    left, right = (evaluated(curve, x, direction) for x in (here, there))
    found = locate(left, right, lambda point: point.value - value)
    # beside a fold the equations at the value are nearly singular
    exact = at_value(curve, found.x, value)
    if exact is None or np.abs(exact.x - found.x).max() > 1e-3 * SAME:
        return replace(found, x=np.append(found.x[:-1], value))
    return exact if found.tangent @ exact.row > 0.0 else replace(exact, tangent=-exact.tangent)


def locate(left: Point, right: Point, function: Callable[[Point], float], tolerance: float = EXACT) -> Point:
    """The point between two others at which a function of the points vanishes, that has two signs at them."""
    length = float(left.row @ (right.x - left.x))
    bend = (right.x - left.x - length * left.tangent) / length**2
    known = {0.0: left, length: right}

    def at(step: float) -> float:
        if step not in known:
            known[step] = point_along(left, step, bend)
        return function(known[step])

    try:
        step = float(scipy.optimize.toms748(at, 0.0, length, xtol=tolerance, rtol=1e-14, maxiter=60))
    except (ValueError, RuntimeError):
        raise LostError("an event on the curve cannot be located") from None
    return point_along(left, step, bend)


def interpolated(
    left: Point, right: Point, function: Callable[[Point], float], nearer: tuple[float, ...] = (AROUND, 0.3 * AROUND)
) -> Point:
    """The point between two others at which a function vanishes, and the equations are singular: from points around it.

    Raises `LostError` where it cannot be found.
    """
    low, high = 0.0, float(left.row @ (right.x - left.x))
    for around in (*nearer, 0.0):
        points = near_points(left, tuple(low + share * (high - low) for share in (0.0, 0.3, 0.7, 1.0)))
        values, x = np.array([function(point) for point in points]), np.array([point.x for point in points])
        if len(points) < 4 or not np.all(np.diff(values) * (values[-1] - values[0]) > 0.0):
            raise LostError("a point at which the equations are singular cannot be located")
        found = scipy.interpolate.BarycentricInterpolator(values, x)(0.0)
        at = float(left.row @ (found - left.x))
        low, high = at - around, at + around
    return evaluated(left.curve, np.asarray(found), left.tangent)
