"""Types of arrays, read-only copies, and the interval of evenly spaced times."""

from __future__ import annotations

import itertools
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Kind = TypeVar("Kind", bound=np.generic)

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integers = NDArray[np.int64]


def own(values: ArrayLike) -> Array:
    """A read-only copy of numbers, its rows together."""
    copy = np.array(values, dtype=float, order="C")
    copy.setflags(write=False)
    return copy


def read_only(array: NDArray[Kind]) -> NDArray[Kind]:
    """A read-only copy of an array."""
    copy = np.array(array)
    copy.setflags(write=False)
    return copy


UNEVEN = 0.25
"""Share of the interval by which a time may lie off the even grid: rounding is less, a lost sample half or more."""


def even_interval(time: Array) -> tuple[float, int]:
    """Interval (s) of evenly spaced times, and the number of the first that is none of them; -1 where all are."""
    interval = float(time[-1] - time[0]) / (time.size - 1)
    steps = np.diff(time)
    # in place: each of these arrays is 80 MB of a long record
    off = np.arange(time.size, dtype=float)
    off *= interval
    off += time[0]
    np.abs(np.subtract(time, off, out=off), out=off)
    if float(steps.min()) > 0.0 and float(off.max()) <= UNEVEN * interval:
        return interval, -1
    usual = float(np.median(steps))
    bad = np.flatnonzero(~((steps > 0.0) & (np.abs(steps - usual) <= 2.0 * UNEVEN * usual)))
    return interval, int(bad[0]) + 1 if bad.size else int(np.argmax(off))


def thinned_line(
    values: Array,  # (n,) what is not a number is drawn only where no stretch is cut
    most: int,  # at least 4
) -> Integers:
    """Numbers of the points of a line that are drawn, in their order.

    The line is cut into stretches of equally many points, and of each the lowest and the highest stay: the largest and
    the smallest value of all among them, and both ends.

    Returns (m,): m <= most.
    """
    count = values.size
    if count <= most:
        return np.arange(count)
    edges = np.linspace(0, count, (most - 2) // 2 + 1).round().astype(int)
    indices = [0, count - 1]
    low, high = np.where(np.isnan(values), np.inf, values), np.where(np.isnan(values), -np.inf, values)
    for first, end in itertools.pairwise(edges.tolist()):
        indices += [first + int(np.argmin(low[first:end])), first + int(np.argmax(high[first:end]))]
    return np.unique(np.array(indices, dtype=np.int64))


def thinned(count: int, most: int) -> NDArray[np.int64]:
    """At most so many of the numbers 0 to count - 1, evenly spread, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))
