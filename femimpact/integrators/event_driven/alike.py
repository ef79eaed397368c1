"""Items of arrays that stand one behind the other: which of them can be computed together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["alike"]


def alike(*marks: NDArray[np.bool_ | np.int64]) -> list[NDArray[np.intp]]:
    """Numbers of the items that have the same marks, group by group.

    Parameters
    ----------
    *marks : ndarray (F, ...)
        Of each of F items, as which of its coordinates are coupled.

    Returns
    -------
    list of ndarray of int
        Each number once; rising within a group.
    """
    count = marks[0].shape[0]
    if count == 1:
        return [np.zeros(1, dtype=np.intp)]
    rows = np.concatenate([each.reshape(count, -1) for each in marks], axis=1)
    if np.all(rows == rows[0]):
        return [np.arange(count)]
    kinds, kind = np.unique(rows, axis=0, return_inverse=True)
    return [np.flatnonzero(kind.reshape(-1) == number) for number in range(kinds.shape[0])]
