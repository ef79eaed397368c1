"""Motions of the base by sines: one sine, steps of frequency, a chirp; with the level that each is given by."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, checked, choice, level_rows, optional, quantity, real_array, require
from femimpact.excitation.excitation import Harmonic, times
from femimpact.excitation.levels import Level, exponent_at, faded, faded_force, level_at, require_reach, with_breaks
from femimpact.excitation.piecewise_polynomial import NODES, PiecewisePolynomial, coefficients_through, fitted, knots_of
from femimpact.excitation.sums import added

LEVEL, TABLE = level_rows("m or m/s^2"), level_rows("m/s^2")
"""Metadata of a level, and of an acceleration that may be a table."""

FADE = quantity("s", at_least=0.0)


def level_of(amplitude: float | None, acceleration: Any, level: Any, by: str | None) -> tuple[Any, str | None]:
    """The level and the name of what was given: exactly one of amplitude and acceleration, or level and `by`.

    Raises `InputError` if both or none of them are given.
    """
    given = {"amplitude": amplitude, "acceleration": acceleration}
    named = [name for name, value in given.items() if value is not None]
    if not named and (level is not None or by is not None):
        require(level is not None, "level", level, "m or m/s^2", "must be a finite number >= 0")
        return level, by
    allowed = "must be given alone: one of amplitude (m) and acceleration (m/s^2)"
    require(len(named) == 1, "amplitude", "both" if named else None, "", allowed)
    if hasattr(given[named[0]], "__len__"):
        allowed = "must be a number: a level over frequency is an acceleration, (2 pi f)^2 times the amplitude"
        require(named[0] == "acceleration", "amplitude", amplitude, "m", allowed)
        return checked("acceleration", acceleration, TABLE), "acceleration"
    return given[named[0]], named[0]


def check_fade(fade: float, duration: float) -> None:
    """Raise `InputError` if both fades together are longer than the motion (s)."""
    require(fade <= 0.5 * duration, "fade", fade, "s", f"must be at most half the duration, {0.5 * duration:g} s")


@dataclass(frozen=True)
class Sine:
    """Steady sine of the base: ub(t) = amplitude sin(2 pi frequency t + phase).

    Parameters
    ----------
    amplitude : float, m
        As the history of a `PointForce`, in newtons.
    frequency : float, Hz
    phase : float, rad
    """

    amplitude: float = field(metadata=quantity("m", at_least=0.0))
    frequency: float = field(metadata=quantity("Hz", above=0.0))
    phase: float = field(default=0.0, metadata=quantity("rad"))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def omega(self) -> float:
        """Angular frequency, rad/s."""
        return 2.0 * math.pi * self.frequency

    def displacement(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base displacement ub (m) at times in s."""
        return np.asarray(self.amplitude * np.sin(self.omega * times(time) + self.phase))

    def velocity(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base velocity (m/s) at times in s."""
        scale = self.amplitude * self.omega
        return np.asarray(scale * np.cos(self.omega * times(time) + self.phase))

    def acceleration(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base acceleration (m/s^2) at times in s."""
        return -(self.omega**2) * self.displacement(time)

    @property
    def closed_form(self) -> Harmonic:
        """Acceleration of the base, m/s^2."""
        return Harmonic(-self.amplitude * self.omega**2, self.omega, self.phase)

    @property
    def force_form(self) -> Harmonic:
        """The amplitude times the sine, as a force in newtons."""
        return Harmonic(self.amplitude, self.omega, self.phase)

    __add__ = added


class PiecewiseMotion:
    """A motion of the base that has no cycle, read from its closed form."""

    @property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2, by the class of the motion."""
        raise NotImplementedError

    @property
    def has_cycle(self) -> bool:
        """False: statistics are over time, and no motion under it is called periodic."""
        return False

    @property
    def phase(self) -> float:
        """Not a number: a motion without a cycle has no phase."""
        return math.nan

    @property
    def amplitude(self) -> float:
        """Largest displacement at the knots, m."""
        return float(np.abs(self.closed_form.starts[:, 0]).max())

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s."""
        return self.closed_form.displacement(time)

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s."""
        return self.closed_form.velocity(time)

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration (m/s^2) at times in s."""
        return self.closed_form.value(time)

    __add__ = added


PIECES = 24
"""Polynomials of degree 5 in a cycle."""


@dataclass(frozen=True, init=False)
class SteppedSine(PiecewiseMotion):
    """Whole cycles of the base at one frequency after another; at rest after the last.

    The frequency changes where the base is farthest out and stands still, so that displacement and velocity are
    continuous: ub = A cos(2 pi f (t - t_j)) from t_j on, starting farthest out at t = 0. By acceleration A is
    acceleration/(2 pi f)^2, and the middle of the motion moves from one frequency to the next, so that the acceleration
    is continuous too. The history is made of polynomials of degree 5, 24 in a cycle: the acceleration is within 1e-9 of
    its largest value.

    Parameters
    ----------
    frequencies : array_like (n,), Hz
        Of the sines.
    cycles : int
        At each frequency; either this or `seconds`.
    amplitude : float, m
        Either this or `acceleration`.
    acceleration : float or array_like (k, 2), m/s^2
        Amplitude of the base's acceleration, or rows of a frequency (Hz) and an amplitude, straight in a plot of the
        logarithms: each frequency then has its level, and the acceleration jumps where it changes.
    direction : {"given", "up", "down", "both"}
        Order of the frequencies: as given, from the lowest up, from the highest down, or up and then down.
    level : float or array_like (k, 2), m or m/s^2
        What amplitude or acceleration was given as.
    by : {"amplitude", "acceleration"}
        Which of them was given.
    seconds : float, s
        At each frequency, as many whole cycles as last so long or longer.
    fade : float, s
        How long the motion takes to come, and to go at its end: the displacement is multiplied by
        sin^2(pi t/(2 fade)).

    Raises
    ------
    InputError
        If there is no frequency, both or none of amplitude and acceleration or of cycles and seconds are given, or rows
        do not rise or reach over all frequencies.
    """

    frequencies: Any
    cycles: int | None = field(metadata=optional(quantity("1", at_least=1, integer=True)))
    direction: str = field(metadata=choice("given", "up", "down", "both"))
    level: Level = field(metadata=LEVEL)
    by: str = field(metadata=choice("amplitude", "acceleration"))
    seconds: float | None = field(default=None, metadata=optional(quantity("s", above=0.0)))
    fade: float = field(default=0.0, metadata=FADE)

    def __init__(
        self,
        frequencies: Any,
        cycles: int | None = None,
        amplitude: float | None = None,
        acceleration: Any = None,
        direction: str = "given",
        seconds: float | None = None,
        fade: float = 0.0,
        *,
        level: Any = None,
        by: str | None = None,
    ) -> None:
        level, by = level_of(amplitude, acceleration, level, by)
        allowed = "must be one or more finite numbers > 0"
        values = real_array("frequencies", frequencies, "Hz", allowed)
        good = values.ndim == 1 and values.size > 0 and bool(np.all(values > 0.0))
        require(good, "frequencies", f"array of shape {values.shape}", "Hz", allowed)
        given = {"frequencies": tuple(values.tolist()), "cycles": cycles, "direction": direction}
        for name, value in (given | {"level": level, "by": by, "seconds": seconds, "fade": fade}).items():
            object.__setattr__(self, name, value)
        check_fields(self)
        allowed = "must be given alone: one of cycles and seconds"
        require((cycles is None) != (seconds is None), "cycles", cycles, "", allowed)
        require_reach(self.level, min(self.frequencies), max(self.frequencies))
        check_fade(self.fade, self.duration)

    @property
    def steps(self) -> Array:
        """Frequencies (Hz) in their order in time."""
        if self.direction == "given":
            return np.array(self.frequencies)
        up = np.sort(self.frequencies)
        return {"up": up, "down": up[::-1], "both": np.concatenate([up, up[-2::-1]])}[self.direction]

    @property
    def cycles_of_steps(self) -> NDArray[np.int64]:
        """Whole cycles at each of the frequencies, in their order in time."""
        if self.seconds is None:
            return np.full(self.steps.size, self.cycles)
        return np.maximum(np.ceil(self.seconds * self.steps * (1.0 - 1e-12)), 1.0).astype(np.int64)

    @property
    def duration(self) -> float:
        """Duration of all cycles, s."""
        return float(np.sum(self.cycles_of_steps / self.steps))

    @property
    def frequency(self) -> float:
        """Highest of its frequencies, Hz: the motion has no single cycle."""
        return float(max(self.frequencies))

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2."""
        omega, level = self._pieces
        size = level * np.ones_like(omega) if self.by == "amplitude" else level / omega**2
        # the middle of the motion: the farthest place stays where the frequency changes
        middle = size[0] - size
        knots, angle = self._knots(omega)
        h = np.diff(knots)
        values = -(size * omega**2)[:, None] * np.cos(angle[:, None] + np.pi / PIECES * (1.0 + NODES))
        starts = np.column_stack([middle + size * np.cos(angle), -size * omega * np.sin(angle)])
        last = [float(middle[-1] + size[-1]), 0.0]
        form = PiecewisePolynomial(knots, coefficients_through(values, h), starts=np.vstack([starts, last]))
        return faded(form, self.fade) if self.fade else form

    @cached_property
    def force_form(self) -> PiecewisePolynomial:
        """Displacement by amplitude, acceleration by acceleration, as a force in newtons: level times cosine."""
        omega, level = self._pieces
        knots, angle = self._knots(omega)
        size = np.reshape(level if self.by == "amplitude" else -level, (-1, 1))
        values = size * np.cos(angle[:, None] + np.pi / PIECES * (1.0 + NODES))
        form = PiecewisePolynomial(knots, coefficients_through(values, np.diff(knots)))
        return faded_force(form, self.fade) if self.fade else form

    @property
    def _pieces(self) -> tuple[Array, Array]:
        """Angular frequency (rad/s) and level of every piece."""
        count = PIECES * self.cycles_of_steps
        return np.repeat(2.0 * np.pi * self.steps, count), np.repeat(level_at(self.level, self.steps), count)

    def _knots(self, omega: Array) -> tuple[Array, Array]:
        """Times (s) of the knots, and the angle (rad) at the beginning of each piece."""
        lengths = 2.0 * np.pi / PIECES / omega
        angle = 2.0 * np.pi / PIECES * (np.arange(omega.size) % PIECES)
        return np.concatenate([[0.0], np.cumsum(lengths)]), np.asarray(angle, dtype=float)


BESIDE_LEVEL = 4e-7
"""Largest share of the level that what keeps the base in its place adds to the acceleration, for each bend."""

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
    within 1e-6 of the level: where the level bends, the speed of what does not drift changes by about
    acceleration/(2 pi f)^2 times the change of the power of the frequency times the relative change of the frequency
    in a second. An acceleration of up to 4e-7 of the level takes this up. In sweeps too fast for it, of tens of octaves
    a minute, the rest moves the middle of the motion.

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
        The frequency changes by the same number of Hz in every second, or of octaves in every minute.
    octaves_per_minute : float, 1/min
        Of a logarithmic chirp, in place of the duration.
    fade : float, s
        How long the motion takes to come, and to go at its end: the displacement is multiplied by
        sin^2(pi t/(2 fade)).
    level : float or array_like (k, 2), m or m/s^2
        What amplitude or acceleration was given as.
    by : {"amplitude", "acceleration"}
        Which of them was given.

    Raises
    ------
    InputError
        If both or none of amplitude and acceleration, or of duration and octaves per minute, are given, a linear chirp
        has octaves per minute, or rows do not rise or reach from start to stop.
    """

    start: float = field(metadata=quantity("Hz", above=0.0))
    stop: float = field(metadata=quantity("Hz", above=0.0))
    duration: float = field(metadata=quantity("s", above=0.0))
    kind: str = field(metadata=choice("linear", "logarithmic"))
    level: Level = field(metadata=LEVEL)
    by: str = field(metadata=choice("amplitude", "acceleration"))
    fade: float = field(default=0.0, metadata=FADE)

    def __init__(
        self,
        start: float,
        stop: float,
        duration: float | None = None,
        amplitude: float | None = None,
        acceleration: Any = None,
        kind: str = "linear",
        octaves_per_minute: float | None = None,
        fade: float = 0.0,
        *,
        level: Any = None,
        by: str | None = None,
    ) -> None:
        level, by = level_of(amplitude, acceleration, level, by)
        if octaves_per_minute is not None:
            require(duration is None, "duration", duration, "s", "must be left out where octaves_per_minute is given")
            allowed = 'must be of kind "logarithmic": a linear chirp has no constant octaves_per_minute'
            require(kind == "logarithmic", "kind", kind, "", allowed)
            allowed = "must be a finite number > 0 1/min, and start and stop two frequencies"
            good = (
                all(isinstance(v, (int, float)) and v > 0.0 for v in (start, stop, octaves_per_minute))
                and start != stop
            )
            require(good, "octaves_per_minute", octaves_per_minute, "1/min", allowed)
            duration = 60.0 * abs(math.log2(stop / start)) / octaves_per_minute
        allowed = "must be a finite number > 0 s, or octaves_per_minute be given"
        require(duration is not None, "duration", duration, "s", allowed)
        values = {"start": start, "stop": stop, "duration": duration, "kind": kind, "level": level, "by": by}
        for name, value in (values | {"fade": fade}).items():
            object.__setattr__(self, name, value)
        check_fields(self)
        require_reach(self.level, min(self.start, self.stop), max(self.start, self.stop))
        check_fade(self.fade, self.duration)

    @property
    def frequency(self) -> float:
        """The highest one, Hz: a chirp has no cycle."""
        return max(self.start, self.stop)

    @property
    def amplitude(self) -> float:
        """Largest displacement, m."""
        return self.level if isinstance(self.level, float) and self.by == "amplitude" else super().amplitude

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

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2."""
        return faded(self._form, self.fade) if self.fade else self._form

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
        bends = self._bends
        if bends.size:
            knots = with_breaks(knots, np.concatenate([bends[:, 0] - bends[:, 1], bends[:, 0] + bends[:, 1]]))

        def without_drift(time: Array) -> Array:
            found = self._level_times_sine(time)
            for middle, width, size in bends:
                found = found - size * (1.0 - np.minimum(((time - middle) / width) ** 2, 1.0)) ** 2
            return found

        pieces = fitted(without_drift, knots)
        end = knots.size - 1 if self.stop >= self.start else 0
        speed, place = self._integrals_at(float(knots[end]))
        speed -= float(pieces.starts[end, 1])
        place -= float(pieces.starts[end, 0]) + speed * float(knots[end])
        return PiecewisePolynomial(knots, pieces.coefficients, speed, place)

    @cached_property
    def force_form(self) -> PiecewisePolynomial:
        """The level times sin(phase), as a force in newtons."""
        form = fitted(self._level_times_sine, self._knots)
        return faded_force(form, self.fade) if self.fade else form

    def _level_times_sine(self, time: Array) -> Array:
        return level_at(self.level, self.frequency_at(time)) * np.sin(self.phase_at(time))

    @property
    def _knots(self) -> Array:
        # what changes the frequency, or the level, counts as turning too
        powers = 1.0 + abs(self._steepest)
        knots = knots_of(lambda t: 2.0 * np.pi * self.frequency_at(t) + powers * abs(self._slope(t)), self.duration)
        if not isinstance(self.level, tuple):
            return knots
        return with_breaks(knots, self._time_of(np.array(self.level)[:, 0]))

    @property
    def _bends(self) -> Array:
        """What keeps the base in its place where the level bends: time (s), half width (s) and largest acceleration.

        There the velocity that is no sine changes by a small amount, which an acceleration of less than
        `BESIDE_LEVEL` of the level takes away over a while.
        """
        if not isinstance(self.level, tuple) or self.start == self.stop:
            return np.zeros((0, 3))
        found, way = [], math.copysign(1.0, self.stop - self.start)
        times_of_rows = self._time_of(np.array(self.level)[:, 0])
        for time in times_of_rows[(times_of_rows > 0.0) & (times_of_rows < self.duration)]:
            others = np.abs(np.array([0.0, self.duration, *times_of_rows]) - time)
            room, width = float(others[others > 0.0].min()), 0.0
            # the integral of (1 - x^2)^2 from -1 to 1 is 16/15
            moved = 15.0 / 16.0 * way * (self._integrals_at(time, True)[0] - self._integrals_at(time, False)[0])
            for _ in range(2):
                lowest = level_at(self.level, self.frequency_at(time + width * np.array([-1.0, 0.0, 1.0]))).min()
                most = BESIDE_LEVEL * float(lowest)
                width = min(max(abs(moved) / most, 1.0 / float(self.frequency_at(time))), room)
            found.append([time, width, min(max(moved / width, -most), most)])
        return np.array(found).reshape(-1, 3)

    @property
    def _steepest(self) -> float:
        """Largest power of the frequency with which the level goes."""
        rows = self.level if isinstance(self.level, tuple) else ()
        return max((abs(exponent_at(self.level, row[0], True)) for row in rows), default=0.0)

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

    def _integrals_at(self, time: float, below: bool = True) -> tuple[float, float]:
        """Velocity and displacement by acceleration at one end, from the asymptotic series of the integrals.

        (e^{i phase} G)' = e^{i phase} where i omega G + G' = 1: G = sum of c_n omega^-p, by parts again and again
        (Bender and Orszag, 1978, on integration by parts).
        """
        omega = 2.0 * math.pi * float(self.frequency_at(np.array(time)))
        slope = float(self._slope(np.array(time)))
        level = float(level_at(self.level, self.frequency_at(np.array(time))))
        # of a level that goes with a power of the frequency (G level)' counts in place of G'
        own = exponent_at(self.level, omega / (2.0 * math.pi), below)
        turn = level * cmath.exp(1j * float(self.phase_at(np.array(time))))
        # d omega/dt = slope omega: of a linear chirp omega' is constant, of a logarithmic one omega'/omega
        linear = self.kind == "linear"
        once, twice = [-1j / omega], [-1.0 / omega**2 + 0j]
        for n in range(1, TERMS):
            power = (2 * n - 1 if linear else n) - own
            first = -1j * power * slope / omega * once[-1]
            if abs(first) >= abs(once[-1]):
                break
            once.append(first)
            power = (2 * n if linear else n + 1) - own
            twice.append(-1j * (first + power * slope * twice[-1]) / omega)
        speed, place = turn * sum(once), turn * sum(twice)
        return speed.imag, place.imag
