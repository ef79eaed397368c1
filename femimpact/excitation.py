"""What drives a run: motions of the base, or a force at a place.

Every excitation answers the same questions: the base's displacement, velocity and acceleration
(consistent with one another), and the frequency that "a cycle" means in statistics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, place, quantity, real_array, require, require_type

__all__ = ["Excitation", "PointForce", "RecordedBase", "Sine"]


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

    def displacement(self, time: ArrayLike) -> NDArray[Any]:
        """Base displacement ub (m) at times in s."""
        return np.asarray(self.amplitude * np.sin(self.omega * _times(time) + self.phase))

    def velocity(self, time: ArrayLike) -> NDArray[Any]:
        """Base velocity (m/s) at times in s."""
        scale = self.amplitude * self.omega
        return np.asarray(scale * np.cos(self.omega * _times(time) + self.phase))

    def acceleration(self, time: ArrayLike) -> NDArray[Any]:
        """Base acceleration (m/s^2) at times in s."""
        return -(self.omega**2) * self.displacement(time)


@dataclass(frozen=True)
class PointForce:
    """Force on the structure at one place, the base at rest: F(t) = history(t), read as newtons.

    Parameters
    ----------
    at : str or float
        Named place, or metres from the root.
    history : Sine
        Its amplitude is a force, N.
    """

    at: str | float = field(metadata=place())
    history: Sine

    def __post_init__(self) -> None:
        check_fields(self)
        require_type(self.history, Sine, "history")

    @property
    def frequency(self) -> float:
        """Of the force, Hz."""
        return self.history.frequency

    @property
    def phase(self) -> float:
        """Of the force at t = 0, rad."""
        return self.history.phase

    @property
    def amplitude(self) -> float:
        """Of the base's motion: none, 0 m."""
        return 0.0

    def force(self, time: ArrayLike) -> NDArray[Any]:
        """Force (N) at times in s."""
        return self.history.displacement(time)

    def displacement(self, time: ArrayLike) -> NDArray[Any]:
        """Base displacement: zero, m."""
        return np.zeros_like(_times(time))

    velocity = displacement
    acceleration = displacement


@dataclass(frozen=True, eq=False)
class RecordedBase:
    """Base motion from samples of its acceleration, straight between them; at rest at t = 0.

    Beyond the last sample the base moves on uniformly.

    Parameters
    ----------
    samples : array_like (n,), m/s^2
        n >= 2, the first at t = 0.
    interval : float, s
        Between samples.
    initial_velocity : float, m/s
    """

    samples: Any
    interval: float = field(metadata=quantity("s", above=0.0))
    initial_velocity: float = field(default=0.0, metadata=quantity("m/s"))

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be 2 or more finite numbers"
        samples = real_array("samples", self.samples, "m/s^2", allowed)
        several = samples.ndim == 1 and samples.size >= 2
        require(several, "samples", f"array of shape {samples.shape}", "m/s^2", allowed)
        samples.setflags(write=False)
        object.__setattr__(self, "samples", samples)
        with np.errstate(over="ignore", invalid="ignore"):
            bounded = bool(np.isfinite(self.amplitude))
        require(
            bounded, "samples", f"array of shape {samples.shape}", "m/s^2", "must move the base by a finite distance"
        )

    @cached_property
    def _knots(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Velocity and displacement at the samples: exact integrals of the broken line."""
        a, h = self.samples, self.interval
        v = self.initial_velocity + np.concatenate([[0.0], np.cumsum(0.5 * h * (a[1:] + a[:-1]))])
        steps = h * v[:-1] + h * h * (2.0 * a[:-1] + a[1:]) / 6.0
        return v, np.concatenate([[0.0], np.cumsum(steps)])

    def _locate(self, time: ArrayLike) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Sample before each time, time since then (s), acceleration there, and its slope."""
        t = _times(time)
        index = np.clip(np.floor(t / self.interval).astype(int), 0, self.samples.size - 1)
        padded = np.append(self.samples, self.samples[-1])
        beyond = index >= self.samples.size - 1
        slope = np.where(beyond, 0.0, (padded[index + 1] - padded[index]) / self.interval)
        return index, t - index * self.interval, np.where(beyond, 0.0, padded[index]), slope

    @cached_property
    def frequency(self) -> float:
        """Frequency (Hz) of the largest line of the spectrum."""
        lines = np.abs(np.fft.rfft(self.samples - self.samples.mean()))
        return float(max(np.argmax(lines), 1) / (self.samples.size * self.interval))

    @property
    def phase(self) -> float:
        """Reference of phases: the cycles begin at t = 0, rad."""
        return 0.0

    @cached_property
    def amplitude(self) -> float:
        """Largest displacement, m."""
        return float(np.max(np.abs(self._knots[1])))

    def displacement(self, time: ArrayLike) -> NDArray[Any]:
        """Base displacement ub (m) at times in s."""
        index, s, a, slope = self._locate(time)
        v, u = self._knots
        return np.asarray(u[index] + s * v[index] + s * s * a / 2.0 + s**3 * slope / 6.0)

    def velocity(self, time: ArrayLike) -> NDArray[Any]:
        """Base velocity (m/s) at times in s."""
        index, s, a, slope = self._locate(time)
        return np.asarray(self._knots[0][index] + s * a + s * s * slope / 2.0)

    def acceleration(self, time: ArrayLike) -> NDArray[Any]:
        """Base acceleration (m/s^2) at times in s."""
        _, s, a, slope = self._locate(time)
        return np.asarray(a + s * slope)


def _times(time: ArrayLike) -> NDArray[Any]:
    return real_array("time", time, "s", "must be finite numbers")


Excitation = Sine | PointForce | RecordedBase
