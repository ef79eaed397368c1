"""The largest value of a channel over a whole run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, quantity, text
from femimpact.response.channels import Channel

__all__ = ["Largest", "LargestSample", "LargestValues"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Largest:
    """The value of a channel whose size is the largest of a run.

    Parameters
    ----------
    value : float
        With its sign: `abs(value)` is the largest absolute value of the channel. Of two of one size it is the first.
    time : float, s
        When the channel has it.
    unit : str
        Of the value.

    Raises
    ------
    InputError
        If a field is of the wrong kind.
    """

    value: float = field(metadata=quantity("", finite=False))
    time: float = field(metadata=quantity("s", at_least=0.0))
    unit: str = field(metadata=text())

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(eq=False)
class LargestSample:
    """Value and time of the largest size among samples that come one piece after another."""

    value: float = 0.0
    time: float | None = None

    def add(self, values: Array, times: Array) -> None:
        """Take in the next samples with their times (s)."""
        if not values.size:
            return
        i = int(np.argmax(np.abs(values)))
        if self.time is None or abs(float(values[i])) > abs(self.value):
            self.value, self.time = float(values[i]), float(times[i])


@dataclass(frozen=True, eq=False)
class LargestValues:
    """Largest values of the channels of a run, found when they are first asked for and then known.

    Parameters
    ----------
    find : callable
        From channels to the largest value of each, found by computing the run once more.
    known : list of (Channel, Largest)
    """

    find: Callable[[tuple[Channel, ...]], tuple[Largest, ...]] = field(repr=False)
    known: list[tuple[Channel, Largest]] = field(default_factory=list, repr=False)

    def of(self, channels: tuple[Channel, ...]) -> tuple[Largest, ...]:
        """The largest value of each channel."""
        left = tuple(channel for channel in channels if self._known(channel) is None)
        if left:
            self.known.extend(zip(left, self.find(left), strict=True))
        found = (self._known(channel) for channel in channels)
        return tuple(one for one in found if one is not None)

    def _known(self, channel: Channel) -> Largest | None:
        return next((found for other, found in self.known if other is channel or other == channel), None)
