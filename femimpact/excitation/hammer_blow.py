"""A blow of a hammer on one place of the structure."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, place, quantity
from femimpact.excitation.excitation import times
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, fitted
from femimpact.excitation.sums import added

__all__ = ["HammerBlow"]

PIECES = 12
"""Polynomials of degree 5 in half a sine."""


@dataclass(frozen=True)
class HammerBlow:
    """Half a sine of force at one place, the base at rest: F = pi impulse/(2 duration) sin(pi (t - begin)/duration).

    The history is made of 12 polynomials of degree 5, within 1e-9 of its largest value.

    Parameters
    ----------
    at : str or float
        Named place, or metres from the root.
    impulse : float, N s
        Its sign is that of the force.
    duration : float, s
    begin : float, s

    Raises
    ------
    InputError
        If the place is neither a name nor metres >= 0, or a value is out of range.
    """

    at: str | float = field(metadata=place())
    impulse: float = field(metadata=quantity("N s"))
    duration: float = field(metadata=quantity("s", above=0.0))
    begin: float = field(default=0.0, metadata=quantity("s", at_least=0.0))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def frequency(self) -> float:
        """Of the sine of which it is a half, Hz: a blow has no cycle."""
        return 0.5 / self.duration

    @property
    def has_cycle(self) -> bool:
        """False: statistics are over time, and no motion under it is called periodic."""
        return False

    @property
    def phase(self) -> float:
        """Not a number."""
        return math.nan

    @property
    def amplitude(self) -> float:
        """Of the base's motion: none, 0 m."""
        return 0.0

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Force, N."""
        largest = 0.5 * np.pi * self.impulse / self.duration
        knots = self.begin + np.linspace(0.0, self.duration, PIECES + 1)
        return fitted(lambda t: largest * np.sin(np.pi * (t - self.begin) / self.duration), knots)

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force (N) at times in s."""
        return self.closed_form.value(time)

    def displacement(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base displacement: zero, m."""
        return np.zeros_like(times(time))

    velocity = displacement
    acceleration = displacement

    __add__ = added
