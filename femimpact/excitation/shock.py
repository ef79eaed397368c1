"""Pulses of the base's acceleration."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from femimpact.errors import choice, optional, quantity, require, truth
from femimpact.excitation.harmonic import PiecewiseMotion, set_fields
from femimpact.excitation.piecewise_polynomial import PIECES_OF_HALF_SINE, PiecewisePolynomial, fitted, half_sine

RAMP = 0.1
"""Share of a trapezoid in which it rises, and in which it falls, unless it is given."""

COMPENSATION = 20.0
"""Length of what brings the base to rest, in durations of the pulse."""


@dataclass(frozen=True, init=False)
class Shock(PiecewiseMotion):
    """Pulse of the base's acceleration, or several of them, the base being at rest before the first.

    With x = t/duration from the beginning of the pulse: half-sine, a sin(pi x); haversine, a (1 - cos(2 pi x))/2;
    triangle, a (1 - |2 x - 1|); rectangle, a; terminal-sawtooth, a x up to its end, where it falls to zero at once;
    initial-sawtooth, a (1 - x), which begins with its peak; trapezoid, a after its ramp and until its ramp before the
    end, with straight ramps. The pulse leaves the base with a velocity of a duration times 2/pi, 1/2, 1/2, 1, 1/2, 1/2
    and 1 - ramp. Compensated, an acceleration x (1 - x)(p + q x) of 20 durations follows, or goes before, and the base
    is at rest in its place after all of it.

    Parameters
    ----------
    kind : {"half-sine", "haversine", "triangle", "rectangle", "terminal-sawtooth", "initial-sawtooth", "trapezoid"}
        Shape of the pulse.
    acceleration : float, m/s^2
        Largest one of the pulse, a.
    duration : float, s
        Of the pulse.
    compensated : bool
        Let an acceleration bring the base to rest in its place.
    compensation : {"after", "before"}
        Where that stands. Before the pulse, it begins at the delay and the pulse 20 durations later.
    ramp : float, 1
        Share of the duration of a trapezoid in which it rises, and in which it falls.
    delay : float, s
        Rest before all of it.
    pulses : int
        How many there are, each with its compensation.
    period : float, s
        From the beginning of one to that of the next, where there are several.
    level : float, m/s^2
        The same as acceleration, as the copy of a pulse has it.
    """

    kind: str = field(
        metadata=choice(
            "half-sine", "haversine", "triangle", "rectangle", "terminal-sawtooth", "initial-sawtooth", "trapezoid"
        )
    )
    level: float = field(metadata=quantity("m/s^2"))
    duration: float = field(metadata=quantity("s", above=0.0))
    compensated: bool = field(default=False, metadata=truth())
    compensation: str = field(default="after", metadata=choice("after", "before"))
    ramp: float = field(default=RAMP, metadata=quantity("1", above=0.0, at_most=0.5))
    delay: float = field(default=0.0, metadata=quantity("s", at_least=0.0))
    pulses: int = field(default=1, metadata=quantity("1", at_least=1, at_most=100_000, integer=True))
    period: float | None = field(default=None, metadata=optional(quantity("s", above=0.0)))

    def __init__(
        self,
        kind: str,
        acceleration: float | None = None,
        duration: float = 0.0,
        compensated: bool = False,
        compensation: str = "after",
        ramp: float = RAMP,
        delay: float = 0.0,
        pulses: int = 1,
        period: float | None = None,
        *,
        level: float | None = None,
    ) -> None:
        level = acceleration if level is None else level
        set_fields(
            self, kind=kind, level=level, duration=duration, compensated=compensated, compensation=compensation,
            ramp=ramp, delay=delay, pulses=pulses, period=period,
        )  # fmt: skip
        allowed = 'must be left out: it belongs to kind "trapezoid"'
        require(kind == "trapezoid" or self.ramp == RAMP, "ramp", ramp, "", allowed)
        good = self.compensated or compensation == "after"
        require(good, "compensation", compensation, "", "must be left out: it belongs to compensated = true")
        allowed = "must be left out: it belongs to several pulses"
        require(self.pulses > 1 or period is None, "period", period, "s", allowed)
        least = self.duration * (1.0 + COMPENSATION * self.compensated)
        if self.pulses > 1:
            allowed = f"must be >= {least:.6g} s, the length of one pulse{' and its compensation' * self.compensated}"
            require(self.period is not None and self.period >= least, "period", period, "s", allowed)

    @property
    def frequency(self) -> float:
        """Frequency of the sine of which a half-sine is a half, Hz: a pulse has no cycle."""
        return 0.5 / self.duration

    @property
    def _form(self) -> PiecewisePolynomial:
        """Acceleration of the base, m/s^2."""
        pulse = self._compensated(self._pulse) if self.compensated else self._pulse
        return pulse if self.pulses == 1 and self.delay == 0.0 else self._repeated(pulse)

    @property
    def _pulse(self) -> PiecewisePolynomial:
        """The pulse alone, from t = 0 on."""
        a, d, r = self.level, self.duration, self.ramp * self.duration
        if self.kind == "half-sine":
            return half_sine(a, d)
        if self.kind == "haversine":
            knots = np.linspace(0.0, d, 2 * PIECES_OF_HALF_SINE + 1)
            return fitted(lambda t: 0.5 * a * (1.0 - np.cos(2.0 * np.pi * t / d)), knots)
        corners, pieces = {
            "triangle": ([0.0, 0.5 * d, d], [[0.0, 2.0 * a / d], [a, -2.0 * a / d]]),
            "rectangle": ([0.0, d], [[a]]),
            "terminal-sawtooth": ([0.0, d], [[0.0, a / d]]),
            "initial-sawtooth": ([0.0, d], [[a, -a / d]]),
            # a ramp of one half leaves no time at the level
            "trapezoid": ([0.0, r, (1.0 - self.ramp) * d, d], [[0.0, a / r], [a, 0.0], [a, -a / r]])
            if self.ramp < 0.5
            else ([0.0, r, d], [[0.0, a / r], [a, -a / r]]),
        }[self.kind]
        return PiecewisePolynomial(corners, pieces)

    def _compensated(self, pulse: PiecewisePolynomial) -> PiecewisePolynomial:
        """The same with what ends velocity and displacement: p/6 + q/12 and p/12 + q/30 are its integrals."""
        place, speed = pulse.starts[-1]
        length, before = COMPENSATION * self.duration, self.compensation == "before"
        # before the pulse it ends with -speed, where the pulse brings the base back to its place
        rest = (speed * self.duration - place) / length**2 if before else -place / length**2 - speed / length
        p, q = np.linalg.solve([[1 / 6, 1 / 12], [1 / 12, 1 / 30]], [-speed / length, rest])
        more = np.zeros((1, 6))
        more[0, 1:4] = np.array([p, q - p, -q]) / length ** np.arange(1, 4)
        pieces = np.zeros((len(pulse.coefficients), 6))
        pieces[:, : pulse.coefficients.shape[1]] = pulse.coefficients
        if before:
            return PiecewisePolynomial([0.0, *(length + pulse.knots)], np.vstack([more, pieces]))
        return PiecewisePolynomial([*pulse.knots, self.duration + length], np.vstack([pieces, more]))

    def _repeated(self, pulse: PiecewisePolynomial) -> PiecewisePolynomial:
        """So many of them one after the other after the delay, each followed by rest up to the next."""
        begin = self.delay + (self.period or 0.0) * np.arange(self.pulses)[:, None]
        rows, degree = pulse.coefficients.shape
        rest = self.pulses > 1 and self.period is not None and self.period > pulse.duration
        knots = (begin + pulse.knots[: rows + rest]).ravel()
        pieces = np.tile(np.vstack([pulse.coefficients, np.zeros((int(rest), degree))]), (self.pulses, 1))
        last = self.delay + (self.period or 0.0) * (self.pulses - 1) + pulse.knots[-1]
        return PiecewisePolynomial([*knots[: knots.size - rest], last], pieces[: len(pieces) - rest])
