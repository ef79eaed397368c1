"""Items of arrays (F, ...) that stand one behind the other: which can be computed together, and some of them alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["alike", "part_of", "stack"]

T = TypeVar("T")


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


def part_of(items: T, members: NDArray[np.intp] | int) -> T:
    """Some of the items of a dataclass of arrays (F, ...), or one of them without the axis.

    Parameters
    ----------
    items : dataclass
        Fields that its attribute `COMMON` names are the same for all items.
    members : ndarray of int, or int
        Rising, each once. Of all items the dataclass itself is returned.
    """
    given: Any = items
    common = getattr(given, "COMMON", ())
    own = {item.name: getattr(given, item.name) for item in fields(given) if item.name not in common}
    if isinstance(members, np.ndarray) and members.size == _count(own):
        return items
    chosen = {name: part_of(value, members) if is_dataclass(value) else value[members] for name, value in own.items()}
    changed: T = replace(given, **chosen)
    return changed


def _count(arrays: dict[str, Any]) -> int:
    """Number of items."""
    return int(next(value.shape[0] for value in arrays.values() if isinstance(value, np.ndarray)))


def stack(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Arrays in one, with an axis before the others; of a single one a view, which takes a tenth of the time."""
    return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)
