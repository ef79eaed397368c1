"""What motions of the base that are made of polynomials have in common."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.sums import added

__all__ = ["PiecewiseMotion"]

Array = NDArray[np.float64]


class PiecewiseMotion:
    """A motion of the base that has no cycle, read from its closed form."""

    @property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2: each motion has its own."""
        raise NotImplementedError

    @property
    def has_cycle(self) -> bool:
        """False: statistics are over time, and no motion under it is called periodic."""
        return False

    @property
    def phase(self) -> float:
        """Not a number: impacts have no phase in it."""
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
