"""Newton's method on the equations of a periodic orbit, damped far from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from femimpact.arrays import Array
from femimpact.orbits.equations import EventMaps, EventStates, event_maps, jacobian, residual, units_of
from femimpact.orbits.flow import HybridSystem

MOST_STEPS = 60
"""Steps of one search."""

EXACT = 1e-12
"""Largest change of a state or a phase, in its unit, at which a search ends."""

ROUNDED = 1e-8
"""The same where rounding ends it: slow impacts leave their phases no more digits."""

NEAR, FALL = 0.1, 0.1
"""Change below which the next one is less than this share of it, beside a solution that is not singular."""

GIVEN = 1e-6
"""First change up to which the guess is a solution already, but for rounding."""

LEAST_SHARE = 1e-3
"""Least share of a step that is tried."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a search ended."""

    maps: EventMaps  # there
    length: float  # m: unit of displacements
    changes: tuple[float, ...] = ()  # largest of each step, in units of the length, the length times omega, and rad
    residual: float = 0.0  # largest, in the same units
    converged: bool = True

    @property
    def events(self) -> EventStates:
        """Events, states and phases."""
        return self.maps.events


def solve(
    hybrid: HybridSystem,
    guess: EventStates,
    length: float,  # m: unit of displacements; that of velocities is it times omega
) -> Solution:
    """Solution of the equations from a first guess.

    A step is shortened until the step that would follow it, with the same matrix, is shorter (the natural
    monotonicity test of Deuflhard, 2011, which does not depend on units), and the events keep their order.
    """
    maps, converged = event_maps(hybrid, guess), False
    (count, size), changes = guess.states.shape, list[float]()
    unit, by_rows = units_of(hybrid, guess.sequence, length)

    def scaled_step(factors: Any, trial: EventMaps) -> Array:
        right = (residual(trial) / by_rows).reshape(-1)
        return -np.asarray(dgetrs(*factors, right)[0]).reshape(count, size + 1)

    while len(changes) < MOST_STEPS:
        matrix = (jacobian(maps) / by_rows[:, None, None] * unit).reshape(2 * [count * (size + 1)])
        *factors, singular = dgetrf(matrix)
        if singular or not np.all(np.isfinite(matrix)):
            break
        step, here = scaled_step(factors, maps), maps.events
        change, share = float(np.abs(step).max()), 1.0
        if not np.isfinite(change):
            break
        norm = float(np.linalg.norm(step))
        while True:
            moved = here.states + share * step[:, :size] * unit[:-1]
            turned = here.phases + share * step[:, size]
            if change <= ROUNDED or np.all(here.sequence.between(turned) >= 0.0):
                after = event_maps(hybrid, replace(here, states=moved, phases=turned))
                next_norm = float(np.linalg.norm(scaled_step(factors, after)))
                if change <= ROUNDED or next_norm <= (1.0 - 0.25 * share) * norm:
                    break
            share *= 0.5
            if share < LEAST_SHARE:
                break
        if share < LEAST_SHARE:
            break
        maps = after
        changes.append(change)
        converged = change <= EXACT or _at_rounding(changes)
        if converged:
            break
    left = residual(maps) / by_rows
    return Solution(maps, length, tuple(changes), float(np.abs(left).max()), converged)


def _at_rounding(changes: list[float]) -> bool:
    """Whether the steps fall no more, after one that fell as beside a solution that is not singular.

    Beside one that is singular each step is about half of the one before, and the error is as large as the step.
    """
    pairs = list(pairwise(changes))
    if not pairs or changes[-1] > ROUNDED or changes[-1] < FALL * changes[-2]:
        return False
    return changes[0] <= GIVEN or any(before > GIVEN and after <= FALL * min(before, NEAR) for before, after in pairs)
