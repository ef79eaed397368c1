"""Levels over frequency and over time: tables that are straight between logarithms, fades at the beginning and end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import require
from femimpact.excitation.piecewise_polynomial import PHASE_OF_PIECE, PiecewisePolynomial, fitted

Level = float | tuple[tuple[float, float], ...]
"""A level, or rows of a frequency (Hz) and a level."""

ROUNDING = 1e-9
"""Share of a frequency, or of a piece, that rounding may take."""


def level_at(level: Level, frequency: Array) -> Array:
    """The level at frequencies (Hz); between rows it is straight in a plot of the logarithms."""
    if not isinstance(level, tuple):
        return np.full(np.shape(frequency), level)
    points = np.log(np.array(level))
    return np.asarray(np.exp(np.interp(np.log(frequency), points[:, 0], points[:, 1])))


def require_reach(level: Level, lowest: float, highest: float) -> None:
    """Raise `InputError` unless the rows of a level reach over all frequencies (Hz)."""
    if isinstance(level, tuple):
        reaches = level[0][0] <= lowest * (1.0 + ROUNDING) and level[-1][0] >= highest * (1.0 - ROUNDING)
        allowed = (
            f"must reach from {lowest:g} to {highest:g} Hz; its rows go from {level[0][0]:g} to {level[-1][0]:g} Hz"
        )
        require(reaches, "acceleration", None, "", allowed)


def exponent_at(level: Level, frequency: Array, start: float, stop: float) -> Array:
    """Power of the frequency (Hz) with which a level goes there; at a row, and at an end, that of what is within."""
    if not isinstance(level, tuple):
        return np.zeros(np.shape(frequency))
    points = np.log(np.array(level))
    low, high = min(start, stop) * (1.0 + ROUNDING), max(start, stop) * (1.0 - ROUNDING)
    inside = np.log(np.clip(frequency, low, high))
    i = np.clip(np.searchsorted(points[:, 0], inside, side="right"), 1, len(level) - 1)
    return np.asarray((np.diff(points[:, 1]) / np.diff(points[:, 0]))[i - 1])


def with_breaks(knots: Array, breaks: Array) -> Array:
    """Knots with further ones where a history bends; none is nearer to another than rounding."""
    near = ROUNDING * float(np.diff(knots).min())
    inner = np.unique(breaks[(breaks > knots[0]) & (breaks < knots[-1])])
    after = np.searchsorted(knots, inner)
    new = (knots[after] - inner > near) & (inner - knots[after - 1] > near)
    return np.asarray(np.insert(knots, after[new], inner[new]))


AT_ONCE = 0.02
"""Share of the shortest piece, below 0.034, the first Gauss point, in which a change is a jump without pieces."""


def knots_with_breaks(knots: Array, breaks: Array, turned: Callable[[Array], Array]) -> Array:
    """Knots such that a history bends at some of them, in pieces of `PHASE_OF_PIECE` of what has turned (rad)."""
    ends = with_breaks(knots[[0, -1]], breaks)
    grid = with_breaks(knots, ends)
    angles = turned(grid)
    angle = np.interp(ends, grid, angles)
    counts = np.maximum(np.ceil(np.diff(angle) / PHASE_OF_PIECE), 1.0).astype(int)
    first = np.concatenate([[0], np.cumsum(counts)])
    new = np.interp(np.interp(np.arange(first[-1] + 1), first, angle), angles, grid)
    new[first] = ends
    return np.asarray(new)


BESIDE_LEVEL = 8e-7
"""Share of the level that what keeps the base in its place adds to the acceleration, where that is enough."""

RIPPLE = 0.05
"""Share of the displacement that what is left of a bend may move the base by."""

LEAST_CYCLES = 0.5
"""Between nodes."""

GROWTH = 0.5
"""Of the time between nodes over the time from a bend."""

SLOW = 0.1
"""Relative change of the frequency in a radian up to which a sine by acceleration stays in its place."""


def nodes_beside(knots: Array, bends: Array, sizes: Array, frequency: Array) -> NDArray[np.int64]:
    """Numbers of the knots (s) between which the drift is taken out.

    At a bend of the relative rate of the level by a size r (1/s) the velocity gains up to r level/omega^2. Taken out
    over h on either side, by an acceleration of a triangle in time, it adds r/(omega^2 h) to the level and moves the
    base by r h/6 of the displacement.
    """
    omega = 2.0 * np.pi * frequency
    least, most = LEAST_CYCLES / frequency, 6.0 * RIPPLE / sizes
    length = np.minimum(np.maximum(sizes / (BESIDE_LEVEL * omega**2), least), most)
    # so many bends, each at another phase, move the base by the root of their number
    count = np.searchsorted(bends, bends + length) - np.searchsorted(bends, bends - length)
    length = np.maximum(np.minimum(length, most / np.cbrt(count)), least)
    before = np.minimum.accumulate(length - GROWTH * bends)
    after = np.minimum.accumulate((length + GROWTH * bends)[::-1])[::-1]
    i = np.searchsorted(bends, knots)
    step = np.minimum(np.append(np.inf, before)[i] + GROWTH * knots, np.append(after, np.inf)[i] - GROWTH * knots)
    counted = np.concatenate([[0.0], np.cumsum(np.diff(knots) / np.minimum(step[1:], step[:-1]))])
    integers = np.linspace(0.0, counted[-1], max(int(np.ceil(counted[-1])), 1) + 1)
    return np.unique(np.append(np.searchsorted(counted, integers[:-1]), knots.size - 1))


def without_drift(
    form: PiecewisePolynomial, smooth: Callable[[Array], tuple[Array, Array, Array]], nodes: NDArray[np.int64]
) -> PiecewisePolynomial:
    """A motion less what it drifts by: its distance from the smooth one, as a cubic spline between some knots.

    The spline has the distances as its coefficients, each at the mean of three nodes (the variation-diminishing spline
    of Schoenberg): it leaves a straight line as it is, and depends on what is near alone. Its second derivative is
    straight between nodes.
    """
    knots = form.knots
    ends = np.concatenate([[knots[0]] * 3, knots[nodes], [knots[-1]] * 3])
    time = (ends[1:-3] + ends[2:-2] + ends[3:-1]) / 3.0
    speed, place, change = smooth(time)
    known = np.flatnonzero(change <= max(SLOW, float(change.min())))
    off, fast = form.displacement(time) - place, form.velocity(time) - speed
    first, last = known[[0, -1]]
    off = np.interp(time, time[known], off[known])
    off[:first] += fast[first] * (time[:first] - time[first])
    off[last + 1 :] += fast[last] * (time[last + 1 :] - time[last])
    once = 3.0 * np.diff(off) / (ends[4:-1] - ends[1:-4])
    twice = 2.0 * np.diff(once) / (ends[4:-2] - ends[2:-4])
    pieces = np.column_stack([twice[:-1], np.diff(twice) / np.diff(knots[nodes])])
    drift = PiecewisePolynomial(knots[nodes], pieces, float(once[0]), float(off[0]))
    coefficients = form.coefficients.copy()
    coefficients[:, 0] -= drift.value(knots[:-1])
    coefficients[:, 1] -= np.repeat(pieces[:, 1], np.diff(nodes))
    starts = form.starts - np.column_stack([drift.displacement(knots), drift.velocity(knots)])
    return PiecewisePolynomial(knots, coefficients, starts=starts)


def faded(form: PiecewisePolynomial, fade: float) -> PiecewisePolynomial:
    """A motion of the base whose displacement comes and goes over some seconds: times sin^2(pi t/(2 fade)).

    Velocity and acceleration are the exact derivatives. It begins and ends at rest in its place.
    """
    knots, (window, slope, bend) = _faded_knots(form, fade)

    def acceleration(t: Array) -> Array:
        return window(t) * form.value(t) + 2.0 * slope(t) * form.velocity(t) + bend(t) * form.displacement(t)

    place, speed = form.displacement(knots), form.velocity(knots)
    starts = np.column_stack([window(knots) * place, window(knots) * speed + slope(knots) * place])
    return fitted(acceleration, knots, starts)


def faded_force(form: PiecewisePolynomial, fade: float) -> PiecewisePolynomial:
    """A history whose value comes and goes in this way."""
    knots, (window, _, _) = _faded_knots(form, fade)
    return fitted(lambda t: window(t) * form.value(t), knots)


def _faded_knots(form: PiecewisePolynomial, fade: float) -> tuple[Array, tuple[Callable[[Array], Array], ...]]:
    """Knots of a faded history, and its window with the first and the second derivative."""
    end, rate = form.duration, np.pi / fade

    def since(t: Array) -> Array:
        """Time within a fade, s: counted from the nearer end, at most the fade."""
        return np.clip(np.minimum(t, end - t), 0.0, fade)

    def window(t: Array) -> Array:
        return np.asarray(np.sin(0.5 * rate * since(t)) ** 2)

    def slope(t: Array) -> Array:
        return np.asarray(0.5 * rate * np.sin(rate * since(t)) * np.where(t < 0.5 * end, 1.0, -1.0))

    def bend(t: Array) -> Array:
        within = since(t) < fade
        return np.asarray(np.where(within, 0.5 * rate**2 * np.cos(rate * since(t)), 0.0))

    return with_breaks(form.knots, np.array([fade, end - fade])), (window, slope, bend)
