"""A history in closed form: polynomials between knots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import check_fields, quantity, real_array, require
from femimpact.excitation.excitation import AT_SAMPLE, BrokenLine, times

HIGHEST_DEGREE = 5
"""Highest degree of the polynomial of a piece."""

ORDERS = HIGHEST_DEGREE + 3
"""Numbers that begin a piece: ub, ub', s, and the derivatives of s to the fifth."""

FACTORIAL = np.array([math.factorial(n) for n in range(ORDERS + 1)], dtype=float)

CONTINUOUS = 1e-6
"""Share of the largest displacement, or velocity, by which given starts may differ from the integrals of the pieces."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(HIGHEST_DEGREE + 1)


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial:
    """A history in closed form: s(t) = sum_j c_ij (t - t_i)^j from t_i to t_{i+1}, zero outside.

    Where s is the acceleration of the base, every piece begins with the displacement and the velocity that the base has
    there, so that rounding does not add up over the pieces.

    Parameters
    ----------
    knots : array_like (n + 1,), s
        t_i, rising.
    coefficients : array_like (n, degree + 1), m/s^2 or N per s^j
        c_ij; at most degree 5.
    initial_velocity : float, m/s
        Of the base at the first knot.
    initial_displacement : float, m
    starts : array_like (n + 1, 2), optional
        Displacement (m) and velocity (m/s) of the base at the knots, where they are known better than as the sums of
        the integrals of the pieces.
    """

    knots: Any
    coefficients: Any
    initial_velocity: float = field(default=0.0, metadata=quantity("m/s"))
    initial_displacement: float = field(default=0.0, metadata=quantity("m"))
    starts: Any = None

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be 2 or more finite numbers that rise"
        knots = real_array("knots", self.knots, "s", allowed)
        several = knots.ndim == 1 and knots.size >= 2
        require(several, "knots", f"array of shape {knots.shape}", "s", allowed)
        falling = np.flatnonzero(np.diff(knots) <= 0.0)
        if falling.size:
            which = f"{knots[falling[0]]:.9g} and then {knots[falling[0] + 1]:.9g}"
            require(False, "knots", which, "s", allowed)
        rows, most = knots.size - 1, HIGHEST_DEGREE + 1
        allowed = f"must be finite numbers in {rows} rows, one less than knots, of 1 to {most}: degree 0 to {most - 1}"
        values = real_array("coefficients", self.coefficients, "m/s^2 or N", allowed)
        fits = values.ndim == 2 and values.shape[0] == rows and 1 <= values.shape[1] <= most
        require(fits, "coefficients", f"array of shape {values.shape}", "m/s^2 or N", allowed)
        for name, array in (("knots", knots), ("coefficients", values)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        with np.errstate(over="ignore", invalid="ignore"):
            sums = self._sums()
        finite = bool(np.all(np.isfinite(sums)))
        require(finite, "coefficients", f"array of shape {values.shape}", "m/s^2", "must move the base by finite sizes")
        if self.starts is not None:
            sums = self._checked_starts(sums)
        sums.setflags(write=False)
        object.__setattr__(self, "starts", sums)

    def _sums(self) -> Array:
        """Displacement and velocity at the knots (n + 1, 2) as sums of the integrals of the pieces."""
        h = np.diff(self.knots)
        faster, moved = np.zeros_like(h), np.zeros_like(h)
        # Horner's scheme, from the highest power down
        for n in range(self.degree, -1, -1):
            c = self.coefficients[:, n]
            faster = faster * h + c / (n + 1.0)
            moved = moved * h + c / ((n + 1.0) * (n + 2.0))
        speed = self.initial_velocity + np.concatenate([[0.0], np.cumsum(h * faster)])
        place = self.initial_displacement + np.concatenate([[0.0], np.cumsum(h * (speed[:-1] + h * moved))])
        return np.column_stack([place, speed])

    def _checked_starts(self, sums: Array) -> Array:
        allowed = f"must be finite numbers in {self.knots.size} rows of 2, displacement and velocity at the knots"
        starts = real_array("starts", self.starts, "m and m/s", allowed)
        require(starts.shape == sums.shape, "starts", f"array of shape {starts.shape}", "m and m/s", allowed)
        # from the start of each piece to that of the next one
        changes, steps = np.diff(sums, axis=0), np.diff(starts, axis=0)
        changes[:, 0] += np.diff(self.knots) * (starts[:-1, 1] - sums[:-1, 1])
        size = np.abs(starts).max(axis=0) + np.abs(sums).max(axis=0)
        close = bool(np.all(np.abs(steps - changes) <= CONTINUOUS * size))
        allowed = "must be the integrals of the pieces: displacement and velocity do not jump"
        require(close, "starts", f"array of shape {starts.shape}", "m and m/s", allowed)
        return starts

    @property
    def degree(self) -> int:
        """Degree of the pieces."""
        return int(self.coefficients.shape[1]) - 1

    @property
    def duration(self) -> float:
        """Time (s) of the last knot."""
        return float(self.knots[-1])

    @cached_property
    def table(self) -> Array:
        """ub, ub', s and the derivatives of s to the fifth at the knots, (n + 1, 8); s is zero from the last one on."""
        table = np.zeros((self.knots.size, ORDERS))
        table[:, :2] = self.starts
        count = self.coefficients.shape[1]
        table[:-1, 2 : 2 + count] = self.coefficients * FACTORIAL[:count]
        table.setflags(write=False)
        return table

    @cached_property
    def rate(self) -> float:
        """Rate of change of the pieces (1/s): largest n-th root of |d^n s/dt^n| over the largest |s|; 0 of lines."""
        if self.degree <= 1:
            return 0.0
        h = np.diff(self.knots)
        sizes = np.abs(self.coefficients)
        largest = float((sizes * h[:, None] ** np.arange(self.degree + 1)).max())
        if largest == 0.0:
            return 0.0
        shares = sizes.max(axis=0)[1:] * FACTORIAL[1 : self.degree + 1] / largest
        return float((shares ** (1.0 / np.arange(1, self.degree + 1))).max())

    def _derivative(self, time: ArrayLike, order: int) -> Array:
        """Ub differentiated so often at times (s)."""
        t = times(time)
        piece = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, self.knots.size - 1)
        later, outside = t - self.knots[piece], t < self.knots[0]
        total = np.zeros(np.shape(t))
        for i in range(ORDERS - 1, order - 1, -1):
            coefficient = self.table[piece, i]
            total = np.where(outside & (i >= 2), 0.0, coefficient) + total * later / (i - order + 1.0)
        return total

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s, where s is an acceleration; uniform motion outside the knots."""
        return self._derivative(time, 0)

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s, where s is an acceleration."""
        return self._derivative(time, 1)

    def value(self, time: ArrayLike) -> Array:
        """S (m/s^2 or N) at times in s; zero outside the knots."""
        return self._derivative(time, 2)


def piece_at(pieces: PiecewisePolynomial, time: float) -> int:
    """Number of the piece at a time (s), n beyond the last knot; rounding does not put a time before a knot."""
    knots: Array = pieces.knots
    piece = min(max(int(np.searchsorted(knots, time, side="right")) - 1, 0), knots.size - 1)
    if piece + 1 < knots.size and knots[piece + 1] - time <= AT_SAMPLE * (knots[piece + 1] - knots[piece]):
        return piece + 1
    return piece


def motion_at(pieces: PiecewisePolynomial, time: float) -> Array:
    """ub, ub', s and the derivatives of s to the fifth at a time (s), as (8,)."""
    number = piece_at(pieces, time)
    row, later = pieces.table[number], time - pieces.knots[number]
    if time < pieces.knots[0]:
        row = np.where(np.arange(ORDERS) < 2, row, 0.0)
    factors = later ** np.arange(ORDERS) / FACTORIAL[:ORDERS]
    return np.array([float(row[i:] @ factors[: ORDERS - i]) for i in range(ORDERS)])


def fitted(
    history: Callable[[Array], Array],  # s (m/s^2 or N) at times (pieces, 6) in s
    knots: Array,  # (n + 1,) s
    starts: Array | None = None,  # (n + 1, 2) as of `PiecewisePolynomial`
) -> PiecewisePolynomial:
    """The polynomials of degree 5 through a history at the 6 Gauss points of each piece.

    Their integrals over a piece are those of the history to the order 12, so that velocity and displacement do not
    drift. The error of a sine of amplitude a is a (omega h)^6/(720 924) in pieces of length h, at their ends.
    """
    h = np.diff(knots)
    values = np.asarray(history(knots[:-1, None] + 0.5 * h[:, None] * (1.0 + NODES)))
    return PiecewisePolynomial(knots, _of_short_pieces(values, h), starts=starts)


ROUNDED = 1e-8
"""Share of the values of a piece that may be rounding."""


def _of_short_pieces(values: Array, lengths: Array) -> Array:
    """The polynomials through values, without the derivatives of which pieces much shorter than others show nothing.

    A piece of a thousandth of its neighbour's length has a thousandth to the fifth power of its fifth difference, which
    is less than the rounding of the values.
    """
    coefficients, longer = coefficients_through(values, lengths), lengths.copy()
    longer[1:], longer[:-1] = np.maximum(longer[1:], lengths[:-1]), np.maximum(longer[:-1], lengths[1:])
    powers = np.arange(HIGHEST_DEGREE + 1)
    for i in np.flatnonzero((lengths / longer) ** HIGHEST_DEGREE < ROUNDED):
        size = np.abs(values[max(i - 1, 0) : i + 2]).max()
        hidden = (lengths[i] / longer[i]) ** powers < ROUNDED
        coefficients[i, hidden & (np.abs(coefficients[i]) * lengths[i] ** powers <= ROUNDED * size)] = 0.0
    return coefficients


PIECES_OF_HALF_SINE = 12
"""Polynomials of degree 5 in half a sine."""


def half_sine(
    largest: float, duration: float, begin: float = 0.0, pieces: int = PIECES_OF_HALF_SINE
) -> PiecewisePolynomial:
    """Half a sine of a duration (s) from a time (s) on, in 12 pieces within 1e-9 of its largest value (m/s^2 or N)."""
    knots = begin + np.linspace(0.0, duration, pieces + 1)
    return fitted(lambda t: largest * np.sin(np.pi * (t - begin) / duration), knots)


def coefficients_through(values: Array, lengths: Array) -> Array:
    """Coefficients (n, 6) of the polynomials with given values at the Gauss points of pieces of these lengths (s)."""
    inverse = np.linalg.inv(np.vander(0.5 * (1.0 + NODES), increasing=True))
    # rows of points: columns of 6 are multiplied four times as slowly
    coefficients, power = (inverse @ values.T).T, np.ones_like(lengths)
    for n in range(1, HIGHEST_DEGREE + 1):
        power = power * lengths
        coefficients[:, n] /= power
    return np.asarray(coefficients)


def pieces_of(line: BrokenLine | PiecewisePolynomial) -> PiecewisePolynomial:
    """A broken line as polynomials of degree 1; what is in pieces already, as it is."""
    if isinstance(line, PiecewisePolynomial):
        return line
    samples = np.asarray(line.samples, dtype=float)
    slopes = np.diff(samples) / line.interval
    knots = np.arange(samples.size) * line.interval
    return PiecewisePolynomial(knots, np.column_stack([samples[:-1], slopes]), line.initial_velocity)


# ---- what excitations that are made of pieces share -----------------------------------------------------------------

PHASE_OF_PIECE = 0.27
"""Phase of a sine in one piece, rad: its polynomials of degree 5 are then within 1e-9 of it, 23 in a cycle."""


def knots_of(rate: Callable[[Array], Array], duration: float) -> Array:
    """Knots (n + 1,) from 0 to a duration (s), in pieces of `PHASE_OF_PIECE` of what turns at some rates (rad/s)."""
    coarse = np.linspace(0.0, duration, 2049)
    count = max(math.ceil(float(rate(coarse).max()) * duration / PHASE_OF_PIECE), 1)
    grid = np.linspace(0.0, duration, 2 * count + 1)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(grid) * (rate(grid)[1:] + rate(grid)[:-1]))])
    pieces = max(math.ceil(float(turned[-1]) / PHASE_OF_PIECE), 4)
    knots = np.interp(np.linspace(0.0, turned[-1], pieces + 1), turned, grid)
    knots[-1] = duration
    return np.asarray(knots)


ROUNDING = 1e-9
"""Share of a frequency, or of a piece, that rounding may take."""


def with_breaks(knots: Array, breaks: Array) -> Array:
    """Knots with further ones where a history bends; none is nearer to another than rounding."""
    near = ROUNDING * float(np.diff(knots).min())
    inner = np.unique(breaks[(breaks > knots[0]) & (breaks < knots[-1])])
    after = np.searchsorted(knots, inner)
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
