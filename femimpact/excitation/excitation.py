"""The excitation of a run: an open protocol, and the closed forms that a history may have.

Every excitation gives the base's displacement, velocity and acceleration (consistent with one
another), and the frequency that "a cycle" means in statistics.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import checked, kind_of, quantity, real_array, require

ROUNDING = 1e-12
"""Share of the largest sample that is rounding beside a straight record."""

AT_SAMPLE = 1e-9
"""Share of the time between samples by which rounding may put an instant before a sample."""


@runtime_checkable
class Excitation(Protocol):
    """A motion of the base, or a force at a place; a user's class with these members serves every step method.

    Four members more are optional:

    - `closed_form`, a `Harmonic`, a `BrokenLine` or a `PiecewisePolynomial` of the base's acceleration (m/s^2) or of
      the force (N): the event-driven method needs it.
    - `has_cycle`, False where there is none: statistics are over time, and `frequency` is only the highest one of it.
    - `words`, what reports and pictures call it.
    - `at`, a place, with `force(time)` in N: the history acts there as a force. The base then stands still, so that its
      motions are zero.
    """

    @property
    def frequency(self) -> float:
        """Frequency of the cycles that statistics count, Hz; > 0."""

    @property
    def phase(self) -> float:
        """At t = 0, rad: that of an impact is counted from there. Not a number where the excitation has none."""

    @property
    def amplitude(self) -> float:
        """Largest displacement of the base, m: the scale by which divergence is recognised."""

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s."""

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s."""

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration (m/s^2) at times in s."""


class WithoutCycle:
    """What motions and forces share that have no cycle."""

    @property
    def has_cycle(self) -> bool:
        """False: statistics are over time, and no motion under it is called periodic."""
        return False

    @property
    def phase(self) -> float:
        """Not a number: without a cycle there is no phase."""
        return math.nan


@dataclass(frozen=True)
class Harmonic:
    """A history in closed form: s(t) = amplitude sin(omega t + phase).

    Parameters
    ----------
    amplitude : float, m/s^2 or N
    omega : float, rad/s
    phase : float, rad
    """

    amplitude: float
    omega: float
    phase: float


@dataclass(frozen=True, eq=False)
class BrokenLine:
    """A history in closed form: straight lines between samples from t = 0 on, zero beyond the last.

    Parameters
    ----------
    samples : ndarray (n,), m/s^2 or N
    interval : float, s
        Between samples.
    initial_velocity : float, m/s
        Of the base, where s is its acceleration.
    """

    samples: Array
    interval: float
    initial_velocity: float = 0.0

    @cached_property
    def spectrum(self) -> tuple[Array, Array]:
        """Frequencies (Hz) and |lines| of the samples without their line of least squares; zeros of a straight record.

        An offset or a drift is no oscillation.
        """
        a = np.asarray(self.samples, dtype=float)
        along = np.linspace(-1.0, 1.0, a.size)
        # in place: each of these arrays is 80 MB of a long record
        rest, onto, size = a - a.mean(), along @ a, along @ along
        along *= onto
        along /= size
        rest -= along
        del along
        frequency = np.asarray(np.fft.rfftfreq(a.size, self.interval))
        if np.abs(rest).max() <= ROUNDING * np.abs(a).max():
            return frequency, np.zeros_like(frequency)
        return frequency, np.asarray(np.abs(np.fft.rfft(rest)))

    def motion_at(self, time: float) -> Array:
        """Base displacement ub and velocity ub' at a time (s), with the history s and its slope s', as (4,).

        ub and ub' are exact integrals of s. At a sample the slope is that of the line after it.
        """
        s, h, last = np.asarray(self.samples, dtype=float), self.interval, len(self.samples) - 1
        k = math.floor(time / h + AT_SAMPLE)
        # late in a long record the quotient at a sample itself may be rounded to less
        k = min(k + ((k + 1) * h <= time), last)
        speeds = self.initial_velocity + np.concatenate([[0.0], np.cumsum(0.5 * h * (s[1 : k + 1] + s[:k]))])
        place = float(np.sum(h * speeds[:-1] + h * h * (2.0 * s[:k] + s[1 : k + 1]) / 6.0))
        velocity, value, slope, later = speeds[k], s[k], 0.0, time - k * h
        if k < last:
            slope = (s[k + 1] - s[k]) / h
        else:
            value = 0.0
        place += later * (velocity + later * (value / 2.0 + later * slope / 6.0))
        velocity += later * (value + 0.5 * later * slope)
        return np.array([place, velocity, value + slope * later, slope])


LATEST = 1e15
"""Seconds, beyond which a time is taken for a mistake: a float has no tenth of a second there."""

MEMBERS = ("frequency", "phase", "amplitude", "displacement", "velocity", "acceleration")
"""Members of every excitation."""


def has_cycle(excitation: object) -> bool:
    """True if an excitation repeats after a cycle: one that does not say so does."""
    return bool(getattr(excitation, "has_cycle", True))


def is_force(excitation: object) -> bool:
    """True for a force at a place."""
    return getattr(excitation, "at", None) is not None


def holds_drives(excitation: object) -> bool:
    """True for several drives at once, with forces among them."""
    return hasattr(excitation, "drives")


@dataclass(frozen=True)
class LineLoad:
    """Where a force acts that is spread along the beam; see `LineForce`.

    Parameters
    ----------
    density : float or function, N/m
        Along +w, the same everywhere or a function of x (m), from the root.
    """

    density: Any

    def __post_init__(self) -> None:
        if isinstance(self.density, type) or not callable(self.density):
            object.__setattr__(self, "density", checked("density", self.density, quantity("N/m")))

    def __str__(self) -> str:
        return "the whole beam" if callable(self.density) else f"the whole beam, {self.density:g} N/m"


def words_of(excitation: Any) -> str:
    """The excitation in a few words: "base at 5 Hz", "base: chirp + sine", "force at tip: hammer blow"."""
    if holds_drives(excitation):
        return ", ".join(map(words_of, excitation.drives))
    if hasattr(excitation, "words"):
        return str(excitation.words)
    place = getattr(excitation, "at", None)
    driven = "base" if place is None else f"force at {f'{place:g} m' if isinstance(place, (int, float)) else place}"
    if has_cycle(excitation) and math.isfinite(excitation.phase):
        return f"{driven}{' at' if place is None else ','} {excitation.frequency:.4g} Hz"
    history = getattr(excitation, "history", excitation)
    return f"{driven}: {' + '.join(map(_name_of, getattr(history, 'parts', (history,))))}"


def _name_of(history: object) -> str:
    """The name of a class as words: SteppedSine is a stepped sine, RandomBase random."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(history).__name__)
    return words.lower().removesuffix(" base")


def require_excitation(value: object, key: str = "excitation") -> None:
    """Raise `InputError` unless a value has the members of an excitation."""
    missing = [name for name in MEMBERS if not hasattr(value, name)]
    allowed = (
        "must be a Sine, a PointForce, a RecordedBase or another excitation, or an object with all of "
        + ", ".join(MEMBERS)
    )
    require(not missing and not isinstance(value, type), key, kind_of(value), "", allowed)


def times(time: ArrayLike) -> Array:
    """Times (s) as an array of float."""
    allowed = f"must be finite numbers from {-LATEST:g} to {LATEST:g} s"
    t = real_array("time", time, "s", allowed)
    require(bool(np.all(np.abs(t) <= LATEST)), "time", time, "s", allowed)
    return t
