"""Crests of the conditions of events between the events of an orbit: where one that is not met is nearest."""

from __future__ import annotations

import numpy as np
import scipy.optimize

from femimpact.arrays import Array
from femimpact.orbits.curve import RATES, Point
from femimpact.orbits.equations import PRESS_AGAIN, RELEASE

PROFILE = 257
"""Instants of an interval between events among which the crests of a condition are looked for."""


def depth_beyond(point: Point, k: int, pair: int, side: float, phases: Array, derivative: int) -> Array:
    """Depth (n,) beyond a wall at phases (n,) after event k, m, or its first or second derivative by the time."""
    wall = 0.0 if derivative else float(point.maps.hybrid.gaps[pair, 0 if side > 0.0 else 1])
    return np.asarray(side * point.intervals.gaps(k, phases)[derivative, :, pair] - wall)


def begin(point: Point, m: int) -> float:
    """Phase of event m, of later cycles too."""
    turns, event = divmod(m, point.events.phases.size)
    return float(point.events.phases[event] + turns * point.cycle)


def condition(point: Point, event: tuple[str, int, float], m: int, phases: Array, derivative: int) -> Array:
    """How far (n,) beyond that of an event its condition is at phases (n,) after event m, or its first derivative.

    An event is its kind, pair and side; the condition is a depth, m, or the force over the stiffness.
    """
    (kind, pair, side), hybrid = event, point.maps.hybrid
    turns, k = divmod(m, point.events.phases.size)
    at = k, pair, side, phases - turns * point.cycle
    depth = depth_beyond(point, *at, derivative)
    if kind in (RELEASE, PRESS_AGAIN) and hybrid.contact_damping[pair]:
        damped = float(hybrid.contact_damping[pair] / hybrid.contact_stiffness[pair])
        depth = depth + damped * depth_beyond(point, *at, derivative + 1)
    return RATES.get(kind, 1.0) * depth


def crests(point: Point, event: tuple[str, int, float], intervals: list[int]) -> list[tuple[float, float, int]]:
    """Phases between which each crest of a condition is after some events in a row, and the event before it.

    Both are one where an event turns the motion round.
    """
    brackets, last = [], -1.0
    for m in intervals:
        grid = np.linspace(begin(point, m), begin(point, m + 1), PROFILE)
        rates = condition(point, event, m, grid, 1)
        if last > 0.0 >= rates[0]:
            brackets.append((float(grid[0]), float(grid[0]), m))
        i = np.flatnonzero((rates[:-1] > 0.0) & (rates[1:] <= 0.0))
        brackets += list(zip(grid[i].tolist(), grid[i + 1].tolist(), [m] * i.size, strict=True))
        last = float(rates[-1])
    return brackets


def top(point: Point, event: tuple[str, int, float], low: float, high: float, m: int) -> tuple[float, float]:
    """Phase of a crest, and how far the condition is beyond that of its event there, in the unit of displacements."""

    def rate(phase: float) -> float:
        return float(condition(point, event, m, np.array([phase]), 1)[0])

    at = low if low == high else float(scipy.optimize.brentq(rate, low, high))
    return at, float(condition(point, event, m, np.array([at]), 0)[0]) / float(point.curve.by_rows[-1])
