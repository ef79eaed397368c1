"""Motions of the base by sines: one sine, steps of frequency, a chirp; with the level that each is given by."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, choice, quantity, real_array, require
from femimpact.excitation.excitation import Harmonic, times
from femimpact.excitation.piecewise_polynomial import NODES, PiecewisePolynomial, coefficients_through, fitted, knots_of
from femimpact.excitation.sums import added


def level_of(
    amplitude: float | None, acceleration: float | None, level: float | None, by: str | None
) -> tuple[float | None, str | None]:
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
    return given[named[0]], named[0]


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
        At each frequency.
    amplitude : float, m
        Either this or `acceleration`.
    acceleration : float, m/s^2
        Amplitude of the base's acceleration.
    direction : {"given", "up", "down", "both"}
        Order of the frequencies: as given, from the lowest up, from the highest down, or up and then down.
    level : float, m or m/s^2
        What amplitude or acceleration was given as.
    by : {"amplitude", "acceleration"}
        Which of them was given.

    Raises
    ------
    InputError
        If there is no frequency, or both or none of amplitude and acceleration are given.
    """

    frequencies: Any
    cycles: int = field(metadata=quantity("1", at_least=1, integer=True))
    direction: str = field(metadata=choice("given", "up", "down", "both"))
    level: float = field(metadata=quantity("m or m/s^2", at_least=0.0))
    by: str = field(metadata=choice("amplitude", "acceleration"))

    def __init__(
        self,
        frequencies: Any,
        cycles: int,
        amplitude: float | None = None,
        acceleration: float | None = None,
        direction: str = "given",
        *,
        level: float | None = None,
        by: str | None = None,
    ) -> None:
        level, by = level_of(amplitude, acceleration, level, by)
        allowed = "must be one or more finite numbers > 0"
        values = real_array("frequencies", frequencies, "Hz", allowed)
        good = values.ndim == 1 and values.size > 0 and bool(np.all(values > 0.0))
        require(good, "frequencies", f"array of shape {values.shape}", "Hz", allowed)
        given = {"frequencies": tuple(values.tolist()), "cycles": cycles, "direction": direction}
        for name, value in (given | {"level": level, "by": by}).items():
            object.__setattr__(self, name, value)
        check_fields(self)

    @property
    def steps(self) -> Array:
        """Frequencies (Hz) in their order in time."""
        if self.direction == "given":
            return np.array(self.frequencies)
        up = np.sort(self.frequencies)
        return {"up": up, "down": up[::-1], "both": np.concatenate([up, up[-2::-1]])}[self.direction]

    @property
    def duration(self) -> float:
        """Duration of all cycles, s."""
        return float(np.sum(self.cycles / self.steps))

    @property
    def frequency(self) -> float:
        """Highest of its frequencies, Hz: the motion has no single cycle."""
        return float(max(self.frequencies))

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2."""
        omega = np.repeat(2.0 * np.pi * self.steps, PIECES * self.cycles)
        size = self.level * np.ones_like(omega) if self.by == "amplitude" else self.level / omega**2
        # the middle of the motion: the farthest place stays where the frequency changes
        middle = size[0] - size
        knots, angle = self._knots(omega)
        h = np.diff(knots)
        values = -(size * omega**2)[:, None] * np.cos(angle[:, None] + np.pi / PIECES * (1.0 + NODES))
        starts = np.column_stack([middle + size * np.cos(angle), -size * omega * np.sin(angle)])
        last = [float(middle[-1] + size[-1]), 0.0]
        return PiecewisePolynomial(knots, coefficients_through(values, h), starts=np.vstack([starts, last]))

    @cached_property
    def force_form(self) -> PiecewisePolynomial:
        """Displacement by amplitude, acceleration by acceleration, as a force in newtons: level times cosine."""
        knots, angle = self._knots(np.repeat(2.0 * np.pi * self.steps, PIECES * self.cycles))
        size = self.level if self.by == "amplitude" else -self.level
        values = size * np.cos(angle[:, None] + np.pi / PIECES * (1.0 + NODES))
        return PiecewisePolynomial(knots, coefficients_through(values, np.diff(knots)))

    def _knots(self, omega: Array) -> tuple[Array, Array]:
        """Times (s) of the knots, and the angle (rad) at the beginning of each piece."""
        lengths = 2.0 * np.pi / PIECES / omega
        angle = 2.0 * np.pi / PIECES * (np.arange(omega.size) % PIECES)
        return np.concatenate([[0.0], np.cumsum(lengths)]), np.asarray(angle, dtype=float)


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
    derivatives of one another, and the acceleration is within 1e-9 of its largest value.

    Parameters
    ----------
    start, stop : float, Hz
        Frequencies at t = 0 and at the end of the duration.
    duration : float, s
        Of the motion; None where `octaves_per_minute` gives it.
    amplitude : float, m
        Either this or `acceleration`.
    acceleration : float, m/s^2
        Amplitude of the base's acceleration.
    kind : {"linear", "logarithmic"}
        The frequency changes by the same number of Hz in every second, or of octaves in every minute.
    octaves_per_minute : float, 1/min
        Of a logarithmic chirp, in place of the duration.
    level : float, m or m/s^2
        What amplitude or acceleration was given as.
    by : {"amplitude", "acceleration"}
        Which of them was given.

    Raises
    ------
    InputError
        If both or none of amplitude and acceleration, or of duration and octaves per minute, are given, or a
        linear chirp has octaves per minute.
    """

    start: float = field(metadata=quantity("Hz", above=0.0))
    stop: float = field(metadata=quantity("Hz", above=0.0))
    duration: float = field(metadata=quantity("s", above=0.0))
    kind: str = field(metadata=choice("linear", "logarithmic"))
    level: float = field(metadata=quantity("m or m/s^2", at_least=0.0))
    by: str = field(metadata=choice("amplitude", "acceleration"))

    def __init__(
        self,
        start: float,
        stop: float,
        duration: float | None = None,
        amplitude: float | None = None,
        acceleration: float | None = None,
        kind: str = "linear",
        octaves_per_minute: float | None = None,
        *,
        level: float | None = None,
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
        for name, value in values.items():
            object.__setattr__(self, name, value)
        check_fields(self)

    @property
    def frequency(self) -> float:
        """The highest one, Hz: a chirp has no cycle."""
        return max(self.start, self.stop)

    @property
    def amplitude(self) -> float:
        """Largest displacement, m."""
        return self.level if self.by == "amplitude" else super().amplitude

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
        knots = self._knots
        if self.by == "amplitude":

            def acceleration(time: Array) -> Array:
                phase, rate = self.phase_at(time), 2.0 * np.pi * self.frequency_at(time)
                return self.level * (rate * self._slope(time) * np.cos(phase) - rate**2 * np.sin(phase))

            phase, rate = self.phase_at(knots), 2.0 * np.pi * self.frequency_at(knots)
            starts = self.level * np.column_stack([np.sin(phase), rate * np.cos(phase)])
            return fitted(acceleration, knots, starts)
        pieces = fitted(lambda t: self.level * np.sin(self.phase_at(t)), knots)
        end = knots.size - 1 if self.stop >= self.start else 0
        speed, place = self._integrals_at(float(knots[end]))
        speed -= float(pieces.starts[end, 1])
        place -= float(pieces.starts[end, 0]) + speed * float(knots[end])
        return PiecewisePolynomial(knots, pieces.coefficients, speed, place)

    @cached_property
    def force_form(self) -> PiecewisePolynomial:
        """The level times sin(phase), as a force in newtons."""
        return fitted(lambda t: self.level * np.sin(self.phase_at(t)), self._knots)

    @property
    def _knots(self) -> Array:
        # what changes the frequency counts as turning too
        return knots_of(lambda t: 2.0 * np.pi * self.frequency_at(t) + abs(self._slope(t)), self.duration)

    def _slope(self, time: Array) -> Array:
        """Relative change of the frequency, 1/s."""
        if self.kind == "linear":
            return np.asarray((self.stop - self.start) / self.duration / self.frequency_at(time))
        return np.full(np.shape(time), math.log(self.stop / self.start) / self.duration)

    def _integrals_at(self, time: float) -> tuple[float, float]:
        """Velocity and displacement by acceleration at one end, from the asymptotic series of the integrals.

        (e^{i phase} G)' = e^{i phase} where i omega G + G' = 1: G = sum of c_n omega^-p, by parts again and again
        (Bender and Orszag, 1978, on integration by parts).
        """
        omega = 2.0 * math.pi * float(self.frequency_at(np.array(time)))
        slope = float(self._slope(np.array(time)))
        turn = self.level * cmath.exp(1j * float(self.phase_at(np.array(time))))
        # d omega/dt = slope omega: of a linear chirp omega' is constant, of a logarithmic one omega'/omega
        linear = self.kind == "linear"
        once, twice = [-1j / omega], [-1.0 / omega**2 + 0j]
        for n in range(1, TERMS):
            power = 2 * n - 1 if linear else n
            first = -1j * power * slope / omega * once[-1]
            if abs(first) >= abs(once[-1]):
                break
            once.append(first)
            power = 2 * n if linear else n + 1
            twice.append(-1j * (first + power * slope * twice[-1]) / omega)
        speed, place = turn * sum(once), turn * sum(twice)
        return speed.imag, place.imag
