"""Stroboscopic sections of a run: its channels once per base cycle, the Poincare section of a driven system."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, checked, column, quantity, real_array, require, require_type, suggestion
from femimpact.excitation import Excitation
from femimpact.response.channels import channel_key
from femimpact.structure.structure import Position
from femimpact.table import Head, head_of_columns, short_repr

__all__ = ["StroboscopicSection", "stroboscopic"]

Array = NDArray[np.float64]

SAME_INSTANT = 1e-9
"""Cycles by which an instant may differ from that of a sample and still be it: rounding of long times."""


@short_repr
@dataclass(frozen=True, eq=False)
class StroboscopicSection:
    """Channels once per base cycle, at one phase of the base.

    Parameters
    ----------
    phase : float, rad
        Of the base, 0 to 2 pi.
    time : ndarray (cycles,), s
    channels : mapping of str to ndarray (cycles,)
        As `Response.channels` has them; `section["tip"]` reads one.
    units : mapping of str to str

    Raises
    ------
    InputError
        If the phase is not finite, `time` is no array of finite numbers, or a channel has not its samples or no unit.
    """

    phase: float = field(metadata=quantity("rad"))
    time: Array = field(metadata=column("s", "cycles", finite=True))
    channels: Mapping[str, Array]
    units: Mapping[str, str]

    def __post_init__(self) -> None:
        check_fields(self)
        for key, given in (("channels", self.channels), ("units", self.units)):
            require_type(given, Mapping, key)
        known = set(self.channels) <= set(self.units)
        require(known, "units", list(self.units), "", f"must be those of the channels, {list(self.channels)}")
        for name, values in self.channels.items():
            array = real_array(f"channels.{name}", values, self.units[name], "must hold numbers", finite=False)
            fits = array.shape == self.time.shape
            require(fits, f"channels.{name}", f"array of shape {array.shape}", "", "must have the samples of time")

    @property
    def _head(self) -> Head:
        title = f"StroboscopicSection: {self.time.size} cycles, at {self.phase:.5g} rad of the base"
        return head_of_columns(title, {"time": self.time, **self.channels}, {"time": "s", **self.units})

    def __getitem__(self, name: Position) -> Array:
        key = channel_key(name)
        require(key in self.channels, "channel", key, "", suggestion(key, self.channels))
        return self.channels[key]


def stroboscopic(
    time: Array,
    channels: Mapping[str, Array],
    units: Mapping[str, str],
    base: Excitation,
    phase: float = 0.0,
) -> StroboscopicSection:
    """Channels at the instants at which the base has a phase.

    An instant that is a sample is read from it. Between samples a displacement whose velocity was
    recorded too is read from the cubic with the values and rates of both neighbours (order 4), every other
    channel from the straight line between them (order 2). Where an impact lies between the neighbours the
    error is at most the spacing of samples times the jump of the rate.

    Parameters
    ----------
    time : ndarray (samples,), s
        Ascending.
    channels : mapping of str to ndarray (samples,)
    units : mapping of str to str
    base : Excitation
        Its `frequency` and `phase` say what a cycle is: 2 pi frequency t + base.phase.
    phase : float, rad

    Returns
    -------
    StroboscopicSection
        Of all whole cycles between the first and the last sample; none where there is no sample.

    Raises
    ------
    InputError
        If the phase is no finite number, or the base has none, as a record.
    """
    taken_at = checked("phase", phase, quantity("rad")) % (2.0 * math.pi)
    require(
        math.isfinite(base.phase),
        "base.phase",
        base.phase,
        "rad",
        "must be finite: no record and nothing without a cycle has one",
    )
    instants = _instants(time, base, taken_at)
    right = np.clip(np.searchsorted(time, instants), 1, max(time.size - 1, 1))
    read = {}
    for name, values in channels.items():
        rate = channels.get(f"{name}.velocity") if units[name] == "m" else None
        read[name] = _read(time, values, rate, instants, right, SAME_INSTANT / base.frequency)
    return StroboscopicSection(taken_at, instants, read, dict(units))


def _instants(time: Array, base: Excitation, phase: float) -> Array:
    """Instants (s) at which the base has the phase, within the samples."""
    if time.size == 0:
        return np.zeros(0)
    shift = (phase - base.phase) / (2.0 * math.pi)
    first = math.ceil(time[0] * base.frequency - shift - SAME_INSTANT)
    last = math.floor(time[-1] * base.frequency - shift + SAME_INSTANT)
    return np.clip((np.arange(first, last + 1) + shift) / base.frequency, time[0], time[-1])


def _read(
    time: Array,
    values: Array,
    rate: Array | None,
    instants: Array,
    right: NDArray[np.int64],
    same: float,
) -> Array:
    """Values at instants from their neighbours, of which `right` is the number of the later one."""
    if time.size < 2 or instants.size == 0:
        return np.asarray(values[np.zeros(instants.size, dtype=int)])
    left = right - 1
    h = time[right] - time[left]
    s = np.divide(instants - time[left], h, out=np.zeros_like(h), where=h > 0.0)
    between = values[left] + s * (values[right] - values[left])
    if rate is not None:
        # the cubic that has the values and rates of both neighbours, as its distance from the straight line
        secant = values[right] - values[left]
        between += s * (1.0 - s) * ((1.0 - s) * (h * rate[left] - secant) - s * (h * rate[right] - secant))
    nearest = np.where(s < 0.5, left, right)
    return np.asarray(np.where(np.abs(time[nearest] - instants) <= same, values[nearest], between))
