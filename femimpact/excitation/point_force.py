"""A force at one place of the structure."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, place, require_type
from femimpact.excitation.excitation import Harmonic, times
from femimpact.excitation.sine import Sine

__all__ = ["PointForce"]


@dataclass(frozen=True)
class PointForce:
    """Force on the structure at one place, the base at rest: F(t) = history(t), read as newtons.

    Parameters
    ----------
    at : str or float
        Named place, or metres from the root.
    history : Sine
        Its amplitude is a force, N.

    Raises
    ------
    InputError
        If the place is none, or the history no Sine.
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

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force (N) at times in s."""
        return self.history.displacement(time)

    def displacement(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base displacement: zero, m."""
        return np.zeros_like(times(time))

    velocity = displacement
    acceleration = displacement

    @property
    def closed_form(self) -> Harmonic:
        """Force, N."""
        return Harmonic(self.history.amplitude, self.history.omega, self.history.phase)
