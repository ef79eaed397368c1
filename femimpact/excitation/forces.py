"""Forces at one place of the structure: a history read as newtons, and the blow of a hammer."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, kind_of, name_text, optional, place, quantity, require
from femimpact.excitation.excitation import MEMBERS, Harmonic, has_cycle, holds_drives, times
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, half_sine, pieces_of
from femimpact.excitation.sums import Sum, added, force_form_of, parts_of


class BaseAtRest:
    """Displacement, velocity and acceleration of a base that does not move while a force acts."""

    @property
    def amplitude(self) -> float:
        """Amplitude of the base's motion: 0 m."""
        return 0.0

    def displacement(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base displacement: zero, m."""
        return np.zeros_like(times(time))

    velocity = displacement
    acceleration = displacement

    __add__ = added
    __radd__ = added


def check_name(name: str | None) -> None:
    """Raise `InputError` for a name of a force that is empty, or holds what parts names of axes or of a file's data."""
    good = name is None or (bool(name.strip()) and not {".", "/"} & set(name))
    require(good, "name", name, "", "must be a text without a dot or a slash that is not empty")


@dataclass(frozen=True)
class PointForce(BaseAtRest):
    """Force on the structure at one place, the base at rest: F(t) = history(t), read as newtons.

    What a history was given by is the force, with its sign: the displacement where that is an amplitude (of a sine, a
    chirp or a stepped sine), the acceleration where it is one (of a chirp, a stepped sine, a record, a shock, a density
    in N^2/Hz). So a stepped sine begins with +amplitude, and with -acceleration, which is that of a base that is
    farthest out on the + side. After its end a history is no force. The force of a sum is the sum of those of its
    parts.

    Parameters
    ----------
    at : str or float
        Named place, or metres from the root.
    history : Sine, Chirp, SteppedSine, RandomBase, Shock, RecordedBase or Sum
        Its level is a force, N.
    name : str, optional
        Among several drives, without a dot or a slash; see `Drives`.

    Raises
    ------
    InputError
        If the history, or a part of a sum, has no closed form.

    Examples
    --------
    A sine of 10 mN at the tip of a beam at rest:

    >>> import femimpact as fi
    >>> force = fi.PointForce("tip", fi.Sine(amplitude=0.01, frequency=5.0))
    >>> fi.integrate(system, force, fi.EventDriven(), duration=1.0).channels["tip"].size > 0
    True
    """

    at: str | float = field(metadata=place())
    history: Any
    name: str | None = field(default=None, metadata=optional(name_text()))

    def __post_init__(self) -> None:
        check_fields(self)
        check_name(self.name)
        allowed = "must be a Sine, Chirp, SteppedSine, RandomBase, Shock, RecordedBase or a sum of motions of the base"
        good = all(hasattr(self.history, name) for name in MEMBERS) and not (
            hasattr(self.history, "at") or holds_drives(self.history)
        )
        require(good and not isinstance(self.history, type), "history", kind_of(self.history), "", allowed)
        for part in parts_of(self.history):
            allowed = "must have a closed form, and each part of a sum as well: sample it into a RecordedBase"
            require(force_form_of(part) is not None, "history", kind_of(part), "", allowed)

    @property
    def frequency(self) -> float:
        """Frequency of the force, Hz."""
        return float(self.history.frequency)

    @property
    def has_cycle(self) -> bool:
        """True if the history has a cycle."""
        return has_cycle(self.history)

    @property
    def phase(self) -> float:
        """Phase of the force at t = 0, rad."""
        return float(self.history.phase)

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force (N) at times in s."""
        if isinstance(self.history, Sum):
            return np.asarray(sum(replace(self, history=part).force(time) for part in parts_of(self.history)))
        form = self.closed_form
        if isinstance(form, Harmonic):
            return np.asarray(form.amplitude * np.sin(form.omega * times(time) + form.phase))
        return pieces_of(form).value(time)

    @property
    def closed_form(self) -> Any:
        """Force, N."""
        return force_form_of(self.history)

    def until(self, end: float) -> PointForce:
        """The force with a closed form up to a time (s) where its history is a sum; any other is returned as it is."""
        return replace(self, history=self.history.until(end)) if isinstance(self.history, Sum) else self


@dataclass(frozen=True)
class HammerBlow(BaseAtRest):
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
    name : str, optional
        Among several drives, without a dot or a slash; see `Drives`.
    """

    at: str | float = field(metadata=place())
    impulse: float = field(metadata=quantity("N s"))
    duration: float = field(metadata=quantity("s", above=0.0))
    begin: float = field(default=0.0, metadata=quantity("s", at_least=0.0))
    name: str | None = field(default=None, metadata=optional(name_text()))

    def __post_init__(self) -> None:
        check_fields(self)
        check_name(self.name)

    @property
    def frequency(self) -> float:
        """Frequency of the sine of which it is a half, Hz: a blow has no cycle."""
        return 0.5 / self.duration

    @property
    def has_cycle(self) -> bool:
        """False: statistics are over time, and no motion under it is called periodic."""
        return False

    @property
    def phase(self) -> float:
        """Not a number: a blow has no phase."""
        return math.nan

    @cached_property
    def closed_form(self) -> PiecewisePolynomial:
        """Force, N."""
        return half_sine(0.5 * np.pi * self.impulse / self.duration, self.duration, self.begin)

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force (N) at times in s."""
        return self.closed_form.value(time)
