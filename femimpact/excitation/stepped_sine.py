"""Sines of several frequencies one after another."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, choice, quantity, real_array, require
from femimpact.excitation.level import level_of
from femimpact.excitation.piecewise_motion import PiecewiseMotion
from femimpact.excitation.piecewise_polynomial import (
    NODES,
    PiecewisePolynomial,
    coefficients_through,
)

__all__ = ["SteppedSine"]

Array = NDArray[np.float64]

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
        If a value is out of range, there is no frequency, or both or none of amplitude and acceleration are given.
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
        """Of all cycles, s."""
        return float(np.sum(self.cycles / self.steps))

    @property
    def frequency(self) -> float:
        """The highest one, Hz: there is no cycle that all of it has."""
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
