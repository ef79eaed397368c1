"""Motions of the base by sines: one sine and steps of frequency, with the level that each is given by."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, checked, choice, level_rows, optional, quantity, real_array, require
from femimpact.excitation.excitation import Harmonic, WithoutCycle, times
from femimpact.excitation.piecewise_polynomial import (
    NODES,
    ROUNDING,
    PiecewisePolynomial,
    coefficients_through,
    faded,
    faded_force,
)
from femimpact.excitation.sums import added

LEVEL, TABLE = level_rows("m or m/s^2"), level_rows("m/s^2")
"""Metadata of a level, and of an acceleration that may be a table."""

FADE = quantity("s", at_least=0.0)

UNITS_OF_LEVEL = {"amplitude": "m", "acceleration": "m/s^2"}

Level = float | tuple[tuple[float, float], ...]
"""A level, or rows of a frequency (Hz) and a level."""


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


def level_of(amplitude: float | None, acceleration: Any, level: Any, by: str | None) -> tuple[Any, str | None]:
    """The level and the name of what was given: exactly one of amplitude and acceleration, or level and `by`.

    Raises `InputError` if both or none of them are given.
    """
    levels = {"amplitude": amplitude, "acceleration": acceleration}
    named = [name for name, value in levels.items() if value is not None]
    if not named and (level is not None or by is not None):
        require(level is not None, "level", level, "m or m/s^2", "must be a finite number >= 0")
        return level, by
    allowed = f"{'must be given alone' if named else 'is missing'}: one of amplitude (m) and acceleration (m/s^2)"
    require(len(named) == 1, "amplitude", "both" if named else None, "", allowed)
    if hasattr(levels[named[0]], "__len__") and not isinstance(levels[named[0]], str):
        allowed = "must be a number: a level over frequency is an acceleration, (2 pi f)^2 times the amplitude"
        require(named[0] == "acceleration", "amplitude", amplitude, "m", allowed)
        return checked("acceleration", acceleration, TABLE), "acceleration"
    return levels[named[0]], named[0]


def set_fields(frozen: Any, **values: Any) -> None:
    """Set the fields of a frozen dataclass whose arguments are not its fields, and check them."""
    for name, value in values.items():
        object.__setattr__(frozen, name, value)
    check_fields(frozen)


MOST_OF_CYCLES = 2_000_000
"""Most cycles of a motion in pieces, which take some gigabytes."""


def check_cycles(cycles: float, key: str, value: Any, unit: str) -> None:
    """Raise `InputError`, with the key that sets it, for more cycles than memory holds."""
    allowed = f"must give at most {MOST_OF_CYCLES:,} cycles in all, which take some gigabytes, not {cycles:.4g}"
    require(cycles <= MOST_OF_CYCLES, key, value, unit, allowed)


def check_fade(fade: float, duration: float) -> None:
    """Raise `InputError` if both fades together are longer than the motion (s)."""
    require(fade <= 0.5 * duration, "fade", fade, "s", f"must be at most half the duration, {0.5 * duration:g} s")


@dataclass(frozen=True, init=False)
class Sine:
    """Steady sine of the base: ub(t) = amplitude sin(2 pi frequency t + phase).

    By acceleration the amplitude is acceleration/(2 pi frequency)^2: at another frequency, as of an axis of a study, it
    is another one.

    Parameters
    ----------
    amplitude : float, m
        Of the base's displacement; as the history of a `PointForce`, in newtons. Either this or `acceleration`.
    frequency : float, Hz
        Of the sine.
    phase : float, rad
        At t = 0.
    acceleration : float, m/s^2
        Amplitude of the base's acceleration.
    level : float, m or m/s^2
        What amplitude or acceleration was given as.
    by : {"amplitude", "acceleration"}
        Which of them was given.
    """

    level: float = field(metadata=quantity("m or m/s^2", at_least=0.0))
    frequency: float = field(metadata=quantity("Hz", above=0.0))
    phase: float = field(default=0.0, metadata=quantity("rad"))
    by: str = field(default="amplitude", metadata=choice("amplitude", "acceleration"))

    def __init__(
        self,
        amplitude: float | None = None,
        frequency: Any = None,
        phase: float = 0.0,
        acceleration: float | None = None,
        *,
        level: Any = None,
        by: str | None = None,
    ) -> None:
        key = "level" if amplitude is None and acceleration is None else None
        level, by = level_of(amplitude, acceleration, level, by)
        if isinstance(by, str) and by in UNITS_OF_LEVEL:
            level = checked(key or by, level, quantity(UNITS_OF_LEVEL[by], at_least=0.0))
        set_fields(self, level=level, frequency=frequency, phase=phase, by=by)

    @property
    def amplitude(self) -> float:
        """Of the base's displacement, m; of a force, N."""
        return self.level if self.by == "amplitude" else self.level / self.omega**2

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


class PiecewiseMotion(WithoutCycle):
    """A motion of the base that has no cycle, read from its closed form, which fades where it has a time (s) for it."""

    fade = 0.0

    @property
    def _form(self) -> PiecewisePolynomial:
        """Acceleration of the base without fades, m/s^2, by the class of the motion."""
        raise NotImplementedError

    @property
    def _force(self) -> PiecewisePolynomial:
        """The history without fades as a force, N: the acceleration, unless the class has another."""
        return self._form

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2."""
        return faded(self._form, self.fade) if self.fade else self._form

    @cached_property
    def force_form(self) -> PiecewisePolynomial:
        """The history as a force, N: its level, else its acceleration."""
        return faded_force(self._force, self.fade) if self.fade else self._force

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
        rising = tuple(values.tolist())
        set_fields(
            self, frequencies=rising, cycles=cycles, direction=direction, level=level, by=by, seconds=seconds, fade=fade
        )
        allowed = "must be given alone: one of cycles and seconds"
        require((cycles is None) != (seconds is None), "cycles", cycles, "", allowed)
        require_reach(self.level, min(self.frequencies), max(self.frequencies))
        if self.cycles is not None:
            check_cycles(float(self.cycles) * self.steps.size, "cycles", self.cycles, "")
        if self.seconds is not None:
            check_cycles(float(np.sum(self.seconds * self.steps)), "seconds", self.seconds, "s")
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

    @property
    def _form(self) -> PiecewisePolynomial:
        """The acceleration without fades."""
        omega, level = self._pieces
        size = level * np.ones_like(omega) if self.by == "amplitude" else level / omega**2
        # the middle of the motion: the farthest place stays where the frequency changes
        middle = size[0] - size
        knots, angle = self._knots(omega)
        h = np.diff(knots)
        values = -(size * omega**2)[:, None] * np.cos(angle[:, None] + np.pi / PIECES * (1.0 + NODES))
        starts = np.column_stack([middle + size * np.cos(angle), -size * omega * np.sin(angle)])
        last = [float(middle[-1] + size[-1]), 0.0]
        return PiecewisePolynomial(knots, coefficients_through(values, h), starts=np.vstack([starts, last]))

    @property
    def _force(self) -> PiecewisePolynomial:
        """Displacement by amplitude, acceleration by acceleration, as a force in newtons: level times cosine."""
        omega, level = self._pieces
        knots, angle = self._knots(omega)
        size = np.reshape(level if self.by == "amplitude" else -level, (-1, 1))
        values = size * np.cos(angle[:, None] + np.pi / PIECES * (1.0 + NODES))
        return PiecewisePolynomial(knots, coefficients_through(values, np.diff(knots)))

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
