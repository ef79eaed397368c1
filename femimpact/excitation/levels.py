"""Levels over frequency and over time: tables that are straight between logarithms, fades at the beginning and end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import require
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, fitted

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


def exponent_at(level: Level, frequency: float, below: bool) -> float:
    """Power of the frequency (Hz) with which a level goes there, from below it or from above."""
    if not isinstance(level, tuple):
        return 0.0
    points = np.log(np.array(level))
    i = int(np.searchsorted(points[:, 0], np.log(frequency), side="left" if below else "right"))
    i = min(max(i, 1), len(level) - 1)
    return float((points[i, 1] - points[i - 1, 1]) / (points[i, 0] - points[i - 1, 0]))


def with_breaks(knots: Array, breaks: Array) -> Array:
    """Knots with further ones where a history bends; none is nearer to another than rounding."""
    inner = np.unique(breaks[(breaks > knots[0]) & (breaks < knots[-1])])
    after = np.searchsorted(knots, inner)
    near = ROUNDING * float(np.diff(knots).min())
    new = (knots[after] - inner > near) & (inner - knots[after - 1] > near)
    return np.asarray(np.insert(knots, after[new], inner[new]))


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
