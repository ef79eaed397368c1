"""A sine of the base whose frequency goes from one value to another, with its level over frequency."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import checked, choice, quantity, require
from femimpact.excitation.excitation import times
from femimpact.excitation.harmonic import (
    FADE,
    LEVEL,
    Level,
    PiecewiseMotion,
    check_cycles,
    check_fade,
    level_at,
    level_of,
    require_reach,
    set_fields,
)
from femimpact.excitation.piecewise_polynomial import (
    PHASE_OF_PIECE,
    ROUNDING,
    PiecewisePolynomial,
    fitted,
    knots_of,
    with_breaks,
)

FREQUENCY = quantity("Hz", above=0.0)

TERMS = 12
"""Most terms of the asymptotic series of an integral: it ends with its smallest term."""


@dataclass(frozen=True, init=False)
class Chirp(PiecewiseMotion):
    """Sine of the base whose frequency goes from one value to another, up or down; at uniform speed after its end.

    The phase is 2 pi times the integral of the frequency f(t), and zero at t = 0:

    - linear: f = start + (stop - start) t/duration
    - logarithmic: f = start (stop/start)^(t/duration), the same number of octaves in every minute

    By amplitude ub = amplitude sin(phase). By acceleration ub'' = acceleration sin(phase); velocity and displacement
    are those of its integrals that do not drift: they tend to a sine about zero where the frequency is highest. The
    history is made of polynomials of degree 5, 23 in a cycle: displacement, velocity and acceleration are exact
    derivatives of one another, and the acceleration is within 1e-9 of its largest value. Of a level in rows it is
    within 1e-6 of the level, but for sharp bends, as of a notch: where the relative rate of the level changes by r
    (1/s), the velocity of what does not drift changes by up to r acceleration/(2 pi f)^2. An acceleration takes this
    out of the motion, of up to 8e-7 of the level, or where the base would then leave its sine by more than a twentieth
    of the amplitude, of 3.3 (r/(2 pi f))^2 of the level, within a few cycles. `level_error` is the largest, which a
    note of the run says too. Beside a change of the level within a cycle it is as large as the level.

    Parameters
    ----------
    start, stop : float, Hz
        Frequencies at t = 0 and at the end of the duration.
    duration : float, s
        Of the motion; None where `octaves_per_minute` gives it.
    amplitude : float, m
        Either this or `acceleration`.
    acceleration : float or array_like (k, 2), m/s^2
        Amplitude of the base's acceleration, or rows of a frequency (Hz) and an amplitude, straight in a plot of the
        logarithms. A constant displacement d up to a crossover is a line through two rows of (2 pi f)^2 d.
    kind : {"linear", "logarithmic"}
        The frequency changes by the same number of Hz in every second, or of octaves in every minute; by default
        linear, and logarithmic with `octaves_per_minute`.
    octaves_per_minute : float, 1/min
        Of a logarithmic chirp, in place of the duration.
    fade : float, s
        How long the motion takes to come, and to go at its end: the displacement is multiplied by
        sin^2(pi t/(2 fade)).
    level : float or array_like (k, 2), m or m/s^2
        What amplitude or acceleration was given as.
    by : {"amplitude", "acceleration"}
        Which of them was given.
    """

    start: float = field(metadata=FREQUENCY)
    stop: float = field(metadata=FREQUENCY)
    duration: float = field(metadata=quantity("s", above=0.0))
    kind: str = field(metadata=choice("linear", "logarithmic"))
    level: Level = field(metadata=LEVEL)
    by: str = field(metadata=choice("amplitude", "acceleration"))
    fade: float = field(default=0.0, metadata=FADE)
    octaves_per_minute: float | None = field(default=None, init=False, compare=False, repr=False)

    def __init__(
        self,
        start: float,
        stop: float,
        duration: float | None = None,
        amplitude: float | None = None,
        acceleration: Any = None,
        kind: str | None = None,
        octaves_per_minute: float | None = None,
        fade: float = 0.0,
        *,
        level: Any = None,
        by: str | None = None,
    ) -> None:
        level, by = level_of(amplitude, acceleration, level, by)
        if octaves_per_minute is not None:
            require(duration is None, "duration", duration, "s", "must be left out where octaves_per_minute is given")
            allowed = 'must be "logarithmic" or left out: a linear chirp has no constant octaves_per_minute'
            require(kind in (None, "logarithmic"), "kind", kind, "", allowed)
            low, high = checked("start", start, FREQUENCY), checked("stop", stop, FREQUENCY)
            rate = octaves_per_minute = checked("octaves_per_minute", octaves_per_minute, quantity("1/min", above=0.0))
            allowed = "must be a finite number > 0 1/min, and start and stop two frequencies"
            require(low != high, "octaves_per_minute", octaves_per_minute, "1/min", allowed)
            duration = 60.0 * abs(math.log2(high / low)) / rate
        allowed = "must be a finite number > 0 s, or octaves_per_minute be given"
        require(duration is not None, "duration", duration, "s", allowed)
        kind = ("linear" if octaves_per_minute is None else "logarithmic") if kind is None else kind
        set_fields(self, start=start, stop=stop, duration=duration, kind=kind, level=level, by=by, fade=fade)
        object.__setattr__(self, "octaves_per_minute", octaves_per_minute)
        require_reach(self.level, min(self.start, self.stop), max(self.start, self.stop))
        # at least as many as at its lowest frequency, where the duration is beyond what a phase is known at
        check_cycles(min(self.start, self.stop) * self.duration, "duration", self.duration, "s")
        check_cycles(float(self.phase_at(self.duration)) / (2.0 * np.pi), "duration", self.duration, "s")
        check_fade(self.fade, self.duration)

    @property
    def frequency(self) -> float:
        """The highest one, Hz: a chirp has no cycle."""
        return max(self.start, self.stop)

    @property
    def amplitude(self) -> float:
        """Largest displacement, m."""
        return self.level if isinstance(self.level, float) and self.by == "amplitude" else super().amplitude

    @property
    def level_error(self) -> tuple[float, float]:
        """What rows add to the acceleration over the largest level within a cycle, at most, and at which frequency, Hz.

        Between the fades; 0 of a level without rows.
        """
        if not isinstance(self.level, tuple):
            return 0.0, self.start
        knots = self.closed_form.knots
        time = knots[(knots >= self.fade) & (knots < (self.duration - self.fade) * (1.0 - ROUNDING))]
        frequency = self.frequency_at(time)
        near = (self.frequency_at(np.clip(time + way / frequency, 0.0, self.duration)) for way in (-1.0, 0.0, 1.0))
        level = np.max([level_at(self.level, f) for f in near], axis=0)
        share = np.abs(self.acceleration(time) - self._level_times_sine(time)) / level
        most = int(share.argmax())
        return float(share[most]), float(frequency[most])

    def frequency_at(self, time: ArrayLike) -> Array:
        """Frequency (Hz) at times in s."""
        share = times(time) / self.duration
        if self.kind == "linear":
            return np.asarray(self.start + (self.stop - self.start) * share)
        return np.asarray(self.start * (self.stop / self.start) ** share)

    def phase_at(self, time: ArrayLike) -> Array:
        """Phase (rad) at times in s."""
        t = times(time)
        if self.kind == "linear" or self.stop == self.start:
            return np.asarray(2.0 * np.pi * t * (self.start + 0.5 * (self.stop - self.start) * t / self.duration))
        rate = math.log(self.stop / self.start) / self.duration
        return np.asarray(2.0 * np.pi * self.start * np.expm1(rate * t) / rate)

    @property
    def _form(self) -> PiecewisePolynomial:
        """The acceleration without fades."""
        knots, level = self._knots, cast(float, self.level)
        if self.by == "amplitude":

            def acceleration(time: Array) -> Array:
                phase, rate = self.phase_at(time), 2.0 * np.pi * self.frequency_at(time)
                return level * (rate * self._slope(time) * np.cos(phase) - rate**2 * np.sin(phase))

            phase, rate = self.phase_at(knots), 2.0 * np.pi * self.frequency_at(knots)
            starts = level * np.column_stack([np.sin(phase), rate * np.cos(phase)])
            return fitted(acceleration, knots, starts)
        pieces = fitted(self._level_times_sine, knots)
        bends, sizes = self._bends
        if bends.size:
            nodes = drift_knots(knots, bends, sizes, self.frequency_at(bends))
            return without_drift(pieces, self._smooth_motion, nodes)
        end = float(knots[-1] if self.stop >= self.start else knots[0])
        speed, place, _ = (float(value) for value in self._smooth_motion(np.array(end)))
        began = pieces.starts[-1 if self.stop >= self.start else 0]
        speed -= float(began[1])
        place -= float(began[0]) + speed * end
        return PiecewisePolynomial(knots, pieces.coefficients, speed, place)

    @property
    def _force(self) -> PiecewisePolynomial:
        """The level times sin(phase), as a force in newtons."""
        return fitted(self._level_times_sine, self._knots)

    def _level_times_sine(self, time: Array) -> Array:
        return level_at(self.level, self.frequency_at(time)) * np.sin(self.phase_at(time))

    @property
    def _knots(self) -> Array:
        # what changes the frequency counts as turning too, and what changes the level
        knots = knots_of(lambda t: 2.0 * np.pi * self.frequency_at(t) + abs(self._slope(t)), self.duration)
        if not isinstance(self.level, tuple):
            return knots
        way = 1 if self.stop >= self.start else -1
        rows = np.log(np.array(self.level))[::way]
        time = self._time_of(np.exp(rows[:, 0]))
        slow = np.diff(time) > AT_ONCE * float(np.diff(knots).min())
        changed = np.concatenate([[0.0], np.cumsum(np.where(slow, np.abs(np.diff(rows[:, 1])), 0.0))])

        def turned(time: Array) -> Array:
            height = way * np.log(self.frequency_at(time))
            level = height + np.interp(height, way * rows[:, 0], changed)
            return np.asarray(self.phase_at(time) + level - level[0])

        return knots_with_breaks(knots, time[np.append(True, slow)], turned)

    @property
    def _bends(self) -> tuple[Array, Array]:
        """Times (s) at which the level bends, and how much its relative change in a second differs after them (1/s)."""
        if not isinstance(self.level, tuple) or self.start == self.stop:
            return np.zeros(0), np.zeros(0)
        rows = np.log(np.array(self.level))
        time = self._time_of(np.exp(rows[1:-1, 0]))
        jump = np.abs(np.diff(np.diff(rows[:, 1]) / np.diff(rows[:, 0])))
        order = np.argsort(time)
        order = order[(time[order] > 0.0) & (time[order] < self.duration) & (jump[order] > 0.0)]
        return time[order], jump[order] * np.abs(self._slope(time[order]))

    def _time_of(self, frequency: Array) -> Array:
        """Times (s) of some frequencies (Hz), below zero or above the duration where they are not met."""
        if self.start == self.stop:
            return np.full(frequency.shape, -1.0)
        if self.kind == "linear":
            return np.asarray(self.duration * (frequency - self.start) / (self.stop - self.start))
        return np.asarray(self.duration * np.log(frequency / self.start) / math.log(self.stop / self.start))

    def _slope(self, time: Array) -> Array:
        """Relative change of the frequency, 1/s."""
        if self.kind == "linear":
            return np.asarray((self.stop - self.start) / self.duration / self.frequency_at(time))
        return np.full(np.shape(time), math.log(self.stop / self.start) / self.duration)

    def _smooth_motion(self, time: Array) -> tuple[Array, Array, Array]:
        """Velocity, displacement and the relative change of the frequency in a radian, of a level by acceleration.

        By the asymptotic series of the integrals: (e^{i phase} G)' = e^{i phase} where i omega G + G' = 1, and G is a
        sum of (-i)^(n + 1) times a real term, each from the one before by parts (Bender and Orszag, 1978, on
        integration by parts). The series ends where its terms begin to grow; the relative change of the frequency in a
        radian says how small they are.
        """
        frequency = self.frequency_at(time)
        omega, slope, linear = 2.0 * np.pi * frequency, self._slope(time), self.kind == "linear"
        # of a level in proportion to a power of the frequency the derivative of G times the level counts
        level_exponent = exponent_at(self.level, frequency, self.start, self.stop)
        velocity_term, displacement_term = 1.0 / omega, 1.0 / omega**2
        minus_i_power, still_shrinking = -1j, np.ones(np.shape(time), dtype=bool)
        velocity, displacement = minus_i_power * velocity_term, minus_i_power * minus_i_power * displacement_term
        for n in range(1, TERMS):
            # d omega/dt = slope omega: of a linear chirp omega' is constant, of a logarithmic one omega'/omega
            next_velocity = ((2 * n - 1 if linear else n) - level_exponent) * slope / omega * velocity_term
            still_shrinking = still_shrinking & (np.abs(next_velocity) < np.abs(velocity_term))
            velocity_term = np.where(still_shrinking, next_velocity, velocity_term)
            next_displacement = (
                next_velocity + ((2 * n if linear else n + 1) - level_exponent) * slope * displacement_term
            ) / omega
            displacement_term = np.where(still_shrinking, next_displacement, displacement_term)
            minus_i_power *= -1j
            velocity = velocity + np.where(still_shrinking, minus_i_power * velocity_term, 0.0)
            displacement = displacement + np.where(still_shrinking, minus_i_power * -1j * displacement_term, 0.0)
        phasor = level_at(self.level, frequency) * np.exp(1j * self.phase_at(time))
        return (phasor * velocity).imag, (phasor * displacement).imag, np.abs(slope) / omega


# ---- a level that changes over frequency -----------------------------------------------------------


def exponent_at(level: Level, frequency: Array, start: float, stop: float) -> Array:
    """Power of the frequency (Hz) with which a level goes there; at a row, and at an end, that of what is within."""
    if not isinstance(level, tuple):
        return np.zeros(np.shape(frequency))
    points = np.log(np.array(level))
    low, high = min(start, stop) * (1.0 + ROUNDING), max(start, stop) * (1.0 - ROUNDING)
    inside = np.log(np.clip(frequency, low, high))
    i = np.clip(np.searchsorted(points[:, 0], inside, side="right"), 1, len(level) - 1)
    return np.asarray((np.diff(points[:, 1]) / np.diff(points[:, 0]))[i - 1])


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


def drift_knots(
    knots: Array,  # (n,) s, rising
    bends: Array,  # (m,) s, at which the relative rate of the level jumps
    sizes: Array,  # (m,) 1/s, of the jumps
    frequency: Array,  # (m,) Hz, at the bends
) -> NDArray[np.int64]:
    """Indices of the knots between which the drift is taken out: close beside bends, farther apart away from them.

    At a bend of the relative rate of the level by a size r (1/s) the velocity gains up to r level/omega^2. Taken out
    over h on either side, by an acceleration of a triangle in time, it adds r/(omega^2 h) to the level and moves the
    base by r h/6 of the displacement.
    """
    omega = 2.0 * np.pi * frequency
    least, most = LEAST_CYCLES / frequency, 6.0 * RIPPLE / sizes
    length = np.minimum(np.maximum(sizes / (BESIDE_LEVEL * omega**2), least), most)
    # bends within such a length, each at another phase, move the base by the root of their number, and that grows with
    # the length: where the displacement decides it the length falls by the cube root
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
