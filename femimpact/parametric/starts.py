"""Where the balls of a case start: the same unit draws for every case, scaled to its gaps and its base."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.excitation import Excitation
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["placed_balls", "scaled_starts", "structure_at_balls", "unit_draws"]

Array = NDArray[np.float64]


def unit_draws(starts: int, balls: int, seed: int) -> Array:
    """Numbers (starts, balls, 2) from 0 to 1, for the place and the speed of each ball; those of fewer starts first."""
    return np.random.default_rng(seed).random((starts, balls, 2))


def scaled_starts(draws: Array, gaps: Array, speed: Array) -> tuple[Array, Array]:
    """Places of balls uniform in their gaps, speeds uniform within +- a speed, relative to the state of the structure.

    Parameters
    ----------
    draws : ndarray (starts, balls, 2)
    gaps : ndarray (cases, balls, 2), m
        To the + and to the - side.
    speed : ndarray (cases,), m/s
        Amplitude times angular frequency of the base.

    Returns
    -------
    displacement, velocity : ndarray (cases, starts, balls), m and m/s
    """
    plus, minus = gaps[:, None, :, 0], gaps[:, None, :, 1]
    displacement = -minus + (plus + minus) * draws[None, :, :, 0]
    return displacement, speed[:, None, None] * (2.0 * draws[None, :, :, 1] - 1.0)


def structure_at_balls(system: System, initial: State, base: Excitation) -> Array:
    """Displacement (m) of the structure at each ball where a run starts, (balls,): of a static state it is not zero."""
    u, *_ = initial.relative_to_base(system, base)
    return np.array([pair.direction @ u for pair in system.balls])


def placed_balls(given: Array, system: System, initial: State, base: Excitation) -> Array:
    """Displacements (m) of the balls, (balls,), those that are not given where they lie; all not given stay so.

    Parameters
    ----------
    given : ndarray (balls,), m
        Not a number where no axis places a ball; zero is a place as any other.
    system : System
    initial : State
        From which the run starts.
    base : Excitation
    """
    left = np.isnan(given)
    if left.all() or not left.any():
        return given
    if not initial.is_static_on(system):
        return np.where(left, 0.0, given)
    *_, other, _ = initial.relative_to_base(system, base)
    return np.where(left, other[: given.size], given)
