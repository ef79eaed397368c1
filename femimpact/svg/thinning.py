"""Fewer points of a line, with every extreme that the eye could see."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

__all__ = ["MOST_POINTS", "thinned_line"]

MOST_POINTS = 2000
"""Points of a line that are drawn at most."""


def thinned_line(values: NDArray[np.float64], most: int = MOST_POINTS) -> NDArray[np.int64]:
    """Numbers of the points of a line that are drawn, in their order.

    The line is cut into stretches of equally many points, and of each the lowest and the highest stay: the largest and
    the smallest value of all among them, and both ends.

    Parameters
    ----------
    values : ndarray (n,)
        What is not a number is drawn only where no stretch is cut.
    most : int
        At least 4.

    Returns
    -------
    ndarray (m,)
        m <= most.
    """
    count = values.size
    if count <= most:
        return np.arange(count)
    edges = np.linspace(0, count, (most - 2) // 2 + 1).round().astype(int)
    kept = [0, count - 1]
    low, high = np.where(np.isnan(values), np.inf, values), np.where(np.isnan(values), -np.inf, values)
    for first, end in itertools.pairwise(edges.tolist()):
        kept += [first + int(np.argmin(low[first:end])), first + int(np.argmax(high[first:end]))]
    return np.unique(np.array(kept, dtype=np.int64))
