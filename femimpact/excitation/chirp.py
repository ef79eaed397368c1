"""A sine whose frequency changes steadily."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, choice, quantity, require
from femimpact.excitation.excitation import times
from femimpact.excitation.level import level_of
from femimpact.excitation.piecewise_motion import PiecewiseMotion
from femimpact.excitation.piecewise_polynomial import (
    PiecewisePolynomial,
    fitted,
    knots_of,
)

__all__ = ["Chirp"]

Array = NDArray[np.float64]

TERMS = 12
"""Of the asymptotic series of an integral, at most: it ends with its smallest term."""


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
        If a value is out of range, both or none of amplitude and acceleration, or of duration and octaves per minute,
        are given, or a linear chirp has octaves per minute.
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
            phase, rate = self.phase_at(knots), 2.0 * np.pi * self.frequency_at(knots)
            starts = self.level * np.column_stack([np.sin(phase), rate * np.cos(phase)])
            return fitted(self._acceleration_of_amplitude, knots, starts)
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

    def _acceleration_of_amplitude(self, time: Array) -> Array:
        phase, rate = self.phase_at(time), 2.0 * np.pi * self.frequency_at(time)
        return self.level * (rate * self._slope(time) * np.cos(phase) - rate**2 * np.sin(phase))

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
