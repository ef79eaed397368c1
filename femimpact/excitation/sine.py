"""A steady sine of the base."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, quantity
from femimpact.excitation.excitation import Harmonic, times
from femimpact.excitation.sums import added

__all__ = ["Sine"]


@dataclass(frozen=True)
class Sine:
    """Steady sine of the base: ub(t) = amplitude sin(2 pi frequency t + phase).

    Parameters
    ----------
    amplitude : float, m
        As the history of a `PointForce`, in newtons.
    frequency : float, Hz
    phase : float, rad

    Raises
    ------
    InputError
        If a value is not finite, the amplitude below zero or the frequency not above it.
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
