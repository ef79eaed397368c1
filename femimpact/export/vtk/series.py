"""A series of frames on one grid: what every format for ParaView writes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Frame", "Series", "Value"]

Value = float | Sequence[float] | str
"""Of field data: numbers, or a line of text."""


@dataclass(frozen=True, eq=False)
class Frame:
    """What changes from frame to frame.

    Parameters
    ----------
    fields : mapping of str to number, numbers or text
    points : mapping of str to ndarray (points,) or (points, 3)
    cells : mapping of str to ndarray (cells,)
    """

    fields: Mapping[str, Value]
    points: Mapping[str, NDArray[np.float64]]
    cells: Mapping[str, NDArray[np.float64 | np.int32]]


@dataclass(frozen=True, eq=False)
class Series:
    """Frames on one grid, each made when it is needed.

    Parameters
    ----------
    points : ndarray (points, 3), m
    connectivity, offsets, types : ndarray
        Cells in VTK's form: points of all, the end of each among these, and its type.
    times : sequence of float
    names : sequence of str
        Of every frame.
    frame : callable of int to Frame
    coloured_by : str
        Array at points that ParaView colours by when it opens the file; "" for none.
    """

    points: NDArray[np.float64]
    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]
    types: NDArray[np.uint8]
    times: Sequence[float]
    names: Sequence[str]
    frame: Callable[[int], Frame]
    coloured_by: str = ""

    def timed_frames(self) -> Iterator[tuple[float, Frame]]:
        """Every frame with its time."""
        return ((time, self.frame(k)) for k, time in enumerate(self.times))
