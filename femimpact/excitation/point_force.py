"""A force at one place of the structure."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, kind_of, place, require
from femimpact.excitation.excitation import MEMBERS, Harmonic, has_cycle, times
from femimpact.excitation.piecewise_polynomial import pieces_of
from femimpact.excitation.sums import Sum, added, force_form_of, parts_of

__all__ = ["PointForce"]


@dataclass(frozen=True)
class PointForce:
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

    Raises
    ------
    InputError
        If the place is neither a name nor metres >= 0, or the history, or a part of a sum, has no closed form.

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

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be a Sine, Chirp, SteppedSine, RandomBase, Shock, RecordedBase or a sum of motions of the base"
        good = all(hasattr(self.history, name) for name in MEMBERS) and not hasattr(self.history, "at")
        require(good and not isinstance(self.history, type), "history", kind_of(self.history), "", allowed)
        for part in parts_of(self.history):
            allowed = "must have a closed form, and each part of a sum as well: sample it into a RecordedBase"
            require(force_form_of(part) is not None, "history", kind_of(part), "", allowed)

    @property
    def frequency(self) -> float:
        """Of the force, Hz."""
        return float(self.history.frequency)

    @property
    def has_cycle(self) -> bool:
        """Whether the history has one."""
        return has_cycle(self.history)

    @property
    def phase(self) -> float:
        """Of the force at t = 0, rad."""
        return float(self.history.phase)

    @property
    def amplitude(self) -> float:
        """Of the base's motion: none, 0 m."""
        return 0.0

    def force(self, time: ArrayLike) -> NDArray[np.float64]:
        """Force (N) at times in s."""
        if isinstance(self.history, Sum):
            return np.asarray(sum(replace(self, history=part).force(time) for part in parts_of(self.history)))
        form = self.closed_form
        if isinstance(form, Harmonic):
            return np.asarray(form.amplitude * np.sin(form.omega * times(time) + form.phase))
        return pieces_of(form).value(time)

    def displacement(self, time: ArrayLike) -> NDArray[np.float64]:
        """Base displacement: zero, m."""
        return np.zeros_like(times(time))

    velocity = displacement
    acceleration = displacement

    @property
    def closed_form(self) -> Any:
        """Force, N."""
        return force_form_of(self.history)

    def until(self, end: float) -> PointForce:
        """The same with a closed form up to a time (s), of a sum of sines."""
        return replace(self, history=self.history.until(end)) if isinstance(self.history, Sum) else self

    __add__ = added
