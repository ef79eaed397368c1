"""Springs and dashpots in figures: a spring is a zigzag, a dashpot a dashed line."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.figures.drawing import DARK, GREY
from femimpact.structure.springs import Dashpot, Spring

__all__ = ["draw_connection", "draw_ground"]

Point = tuple[float, float]

TURNS = 6
"""Of a zigzag."""


def draw_connection(axis: Any, item: Spring | Dashpot, ends: tuple[Point, Point], across: Point) -> None:
    """A spring or a dashpot between two points of a figure, with its name for the legend.

    Parameters
    ----------
    axis : Axes
    item : Spring or Dashpot
    ends : pair of (x, y)
        In units of the axes.
    across : (x, y)
        From the line between the ends to the corners of a zigzag.
    """
    damps = isinstance(item, Dashpot)
    points = np.array(ends, dtype=float) if damps else _zigzag(np.array(ends, dtype=float), np.array(across))
    label, line = f"{item.name} ({'dashpot' if damps else 'spring'})", "--" if damps else "-"
    axis.plot(points[:, 0], points[:, 1], line, color=DARK, linewidth=1.2, label=label, clip_on=False)
    axis.plot(*np.array(ends, dtype=float).T, "o", color=DARK, markersize=3.5, clip_on=False)


def draw_ground(axis: Any, at: Point) -> None:
    """The base, where a spring or a dashpot ends on it."""
    axis.plot([at[0]], [at[1]], "_", color=GREY, markersize=14.0, markeredgewidth=2.5, clip_on=False)


def _zigzag(ends: NDArray[np.float64], across: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points from one end to the other, straight for a while at both."""
    share = np.concatenate([[0.0], np.linspace(0.2, 0.8, 2 * TURNS + 1), [1.0]])
    side = np.concatenate([[0.0, 0.0], np.resize([1.0, -1.0], 2 * TURNS - 1), [0.0, 0.0]])
    return np.asarray(ends[0] + share[:, None] * (ends[1] - ends[0]) + side[:, None] * across)
