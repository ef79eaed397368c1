"""A pulse of the base's acceleration."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from femimpact.errors import check_fields, choice, quantity, truth
from femimpact.excitation.harmonic import PiecewiseMotion
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, half_sine

RAMP = 0.1
"""Share of a trapezoid in which it rises, and in which it falls."""

COMPENSATION = 20.0
"""Length of what brings the base to rest, in durations of the pulse."""


@dataclass(frozen=True, init=False)
class Shock(PiecewiseMotion):
    """Pulse of the base's acceleration from t = 0 on, the base being at rest before it.

    With x = t/duration: half-sine, a sin(pi x); terminal-sawtooth, a x up to its end, where it falls to zero at once;
    trapezoid, a after a tenth of the duration and until a tenth before its end, with straight ramps. The pulse leaves
    the base with a velocity. Compensated, an acceleration x (1 - x)(p + q x) follows over 20 durations, and the base is
    at rest in its place after it.

    Parameters
    ----------
    kind : {"half-sine", "terminal-sawtooth", "trapezoid"}
        Shape of the pulse.
    acceleration : float, m/s^2
        Largest one of the pulse, a.
    duration : float, s
        Of the pulse.
    compensated : bool
        Let an acceleration follow that brings the base to rest in its place.
    level : float, m/s^2
        The same as acceleration, as the copy of a pulse has it.
    """

    kind: str = field(metadata=choice("half-sine", "terminal-sawtooth", "trapezoid"))
    level: float = field(metadata=quantity("m/s^2"))
    duration: float = field(metadata=quantity("s", above=0.0))
    compensated: bool = field(default=False, metadata=truth())

    def __init__(
        self,
        kind: str,
        acceleration: float | None = None,
        duration: float = 0.0,
        compensated: bool = False,
        *,
        level: float | None = None,
    ) -> None:
        values = {"kind": kind, "level": acceleration if level is None else level, "duration": duration}
        for name, value in (values | {"compensated": compensated}).items():
            object.__setattr__(self, name, value)
        check_fields(self)

    @property
    def frequency(self) -> float:
        """Frequency of the sine of which a half-sine is a half, Hz: a pulse has no cycle."""
        return 0.5 / self.duration

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2."""
        a, d = self.level, self.duration
        if self.kind == "half-sine":
            pulse = half_sine(a, d)
        elif self.kind == "terminal-sawtooth":
            pulse = PiecewisePolynomial([0.0, d], [[0.0, a / d]])
        else:
            slope = a / (RAMP * d)
            knots = [0.0, RAMP * d, (1.0 - RAMP) * d, d]
            pulse = PiecewisePolynomial(knots, [[0.0, slope], [a, 0.0], [a, -slope]])
        return self._compensated(pulse) if self.compensated else pulse

    def _compensated(self, pulse: PiecewisePolynomial) -> PiecewisePolynomial:
        """The same with what ends velocity and displacement: p/6 + q/12 and p/12 + q/30 are its integrals."""
        place, speed = pulse.starts[-1]
        length = COMPENSATION * self.duration
        p, q = np.linalg.solve(
            [[1 / 6, 1 / 12], [1 / 12, 1 / 30]], [-speed / length, -place / length**2 - speed / length]
        )
        more = np.zeros((1, 6))
        more[0, 1:4] = np.array([p, q - p, -q]) / length ** np.arange(1, 4)
        pieces = np.zeros((len(pulse.coefficients), 6))
        pieces[:, : pulse.coefficients.shape[1]] = pulse.coefficients
        return PiecewisePolynomial([*pulse.knots, self.duration + length], np.vstack([pieces, more]))
