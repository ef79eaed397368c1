"""What several starts of a case say: median, extremes, quantiles, the interval of the median, and groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEAST_FOR_INTERVAL", "LEAST_FOR_QUANTILES", "median_ranks", "over_starts"]

Array = NDArray[np.float64]

LEAST_FOR_INTERVAL = 5
"""Starts from which the median has an interval."""

LEAST_FOR_QUANTILES = 40
"""Starts from which quantiles of 5 and 95 % are given."""

CONFIDENCE = 0.9
"""Of the interval of the median."""

APART = 0.1
"""Share of the median that the widest distance between neighbours must exceed for two groups."""

BESIDE = 2
"""Starts on each side of it at least."""


def median_ranks(starts: int) -> tuple[int, int]:
    """Numbers from 0 of the sorted values between which the median lies with a probability of at least 90 %.

    The interval from the k-th smallest to the k-th largest of n values holds the median with the probability
    1 - 2 P(B < k), B binomial of n and 1/2; k is the largest for which that is at least 0.9. (David and Nagaraja,
    2003.)

    Parameters
    ----------
    starts : int
        At least `LEAST_FOR_INTERVAL`.
    """
    from scipy.stats import binom

    k = 1
    while 1.0 - 2.0 * float(binom.cdf(k, starts, 0.5)) >= CONFIDENCE:
        k += 1
    return k - 1, starts - k


def over_starts(values: Array) -> dict[str, Array]:
    """Columns (cases,) by the end of their names, from values (cases, starts); "" is the median.

    What is not a number is left out; a case without numbers has none.

    Parameters
    ----------
    values : ndarray (cases, starts)

    Returns
    -------
    dict of str to ndarray (cases,)
        `_low` and `_high` the extremes; `_median_low` and `_median_high` the 90 % interval of the median from 5 starts
        on; `_quantile_5` and `_quantile_95` from 40 on; `_groups` 1, or 2 where the sorted values lie in two groups.
    """
    cases, starts = values.shape
    if starts == 1:
        return {"": values[:, 0]}
    ordered = np.sort(values, axis=1)
    count = np.count_nonzero(~np.isnan(ordered), axis=1)
    names = ["", "_low", "_high", "_groups"]
    names += ["_median_low", "_median_high"] if starts >= LEAST_FOR_INTERVAL else []
    names += ["_quantile_5", "_quantile_95"] if starts >= LEAST_FOR_QUANTILES else []
    found = {name: np.full(cases, np.nan) for name in names}
    # cases of which as many starts have values are done together
    for n in np.unique(count[count > 0]).tolist():
        own = count == n
        for name, column in _of_sorted(ordered[own, :n]).items():
            if name in found:
                found[name][own] = column
    return found


def _of_sorted(values: Array) -> dict[str, Array]:
    n = values.shape[1]
    middle = 0.5 * (values[:, (n - 1) // 2] + values[:, n // 2])
    found = {"": middle, "_low": values[:, 0], "_high": values[:, -1], "_groups": _groups(values, middle)}
    if n >= LEAST_FOR_INTERVAL:
        low, high = median_ranks(n)
        found |= {"_median_low": values[:, low], "_median_high": values[:, high]}
    if n >= LEAST_FOR_QUANTILES:
        for name, share in (("_quantile_5", 0.05), ("_quantile_95", 0.95)):
            place = share * (n - 1)
            below = int(place)
            found[name] = values[:, below] + (place - below) * (values[:, min(below + 1, n - 1)] - values[:, below])
    return found


def _groups(values: Array, middle: Array) -> Array:
    """1, or 2 where the widest distance between sorted values exceeds 10 % of the median, two starts on each side."""
    if values.shape[1] < 2 * BESIDE:
        return np.ones(len(values))
    distance = np.diff(values, axis=1)
    # of several that are widest one with two starts on each side is enough, whichever comes first
    widest = distance[:, BESIDE - 1 : 1 - BESIDE].max(axis=1)
    return np.where((widest >= distance.max(axis=1)) & (widest > APART * np.abs(middle)), 2.0, 1.0)
