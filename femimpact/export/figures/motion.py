"""Figure of beam, balls and stops over time: the whole run, and a close-up with walls and impacts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import instance, takes
from femimpact.export.figures.drawing import (
    BLUE,
    CYCLES,
    ORANGE,
    OffScreen,
    beam_at,
    last_cycles,
    legend_above,
    panels,
    place_of,
    prefixed,
    require_history,
)
from femimpact.response.response import Response

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

__all__ = ["motion"]

BEAM, FREE, WALL = "#555b63", "#e6eaee", "#9aa5b1"

LONG, PARTS = 100, 200
"""Oscillations beyond which a whole run is drawn as an envelope, and in how many parts of equal time at most."""


@takes(response=instance(Response), cycles=CYCLES)
def motion(
    response: Response, cycles: float = 4.0, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """Beam and balls over time: a row for every ball and stop, the whole run beside its last cycles.

    A whole run of more than 100 oscillations is drawn as the envelope of each curve, from its smallest to its largest
    value in each of 200 parts, or of fewer with two oscillations in each.

    The shaded band is where the ball may move: the beam where the ball is, with the gap to either wall. Of a stop it is
    where the beam may move. Dots in the close-up are impacts.

    Parameters
    ----------
    response : Response
        With every ball among its channels, and the beam where each ball or stop is (or the gap there).
    cycles : float
        Base cycles of the close-up.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (contacts, 2) of Axes
        One row, of the first channel, without contacts.

    Raises
    ------
    InputError
        If the run holds no history, a channel is missing, which is named, or `cycles` is not > 0.
    """
    require_history(response)
    pairs = response.system.contacts or (None,)
    # before a figure is made: a channel may be missing
    rows = [_Row(response, pair) for pair in pairs]
    axes = panels(figure, 11.0, 2.5 * len(rows) + 0.8, len(rows), 2, sharex="col", width_ratios=(1.0, 1.3))
    start, words = last_cycles(response, cycles)
    for i, (row, pair_of_axes) in enumerate(zip(rows, axes, strict=True)):
        for axis, inside, close in zip(
            pair_of_axes, (response.time >= -1.0, response.time >= start), (False, True), strict=True
        ):
            row.draw(axis, inside, close)
        if row.oscillations <= LONG:
            # an envelope has its legend there
            pair_of_axes[0].set_title(row.title, loc="left")
        pair_of_axes[0].set_ylabel(f"relative to the base ({row.unit})")
        legend_above(pair_of_axes[1])
        if i == len(rows) - 1:
            pair_of_axes[0].set_xlabel("time (s)")
            pair_of_axes[1].set_xlabel(f"time (s), {words}")
    return axes


class _Row:
    """Curves of one contact in a unit that reads well: the beam, the ball where there is one, and the walls."""

    def __init__(self, response: Response, pair: Any) -> None:
        self.response, self.pair = response, pair
        first = next(iter(response.channels))
        self.place = first if pair is None else place_of(response, pair) or f"beam at {pair.name}"
        self.beam = response[first] if pair is None else beam_at(response, pair)
        moving = pair is not None and not pair.is_stop
        self.ball = response[pair.name] if moving else None
        above = self.beam > self.beam.mean()
        self.oscillations = int(np.count_nonzero(np.diff(above))) // 2
        largest = float(np.abs(self.beam if self.ball is None else self.ball).max())
        self.factor, self.unit = prefixed(largest, response.units[first] if pair is None else "m")
        self.title = self.place if pair is None else f"{pair.name}, {self.place}" if moving else f"stop {pair.name}"

    def draw(self, axis: Any, inside: NDArray[np.bool_], close: bool) -> None:
        time, factor = self.response.time[inside], self.factor
        width = 1.6 if close else 0.8
        if not close and self.oscillations > LONG:
            self._envelopes(axis)
            return
        if self.pair is not None:
            self._walls(axis, inside)
        axis.plot(time, factor * self.beam[inside], color=BEAM, linewidth=width, zorder=3.0, label=self.place)
        if self.ball is not None:
            axis.plot(time, factor * self.ball[inside], color=BLUE, linewidth=width, label=self.pair.name)
        if close and self.pair is not None:
            self._impacts(axis, float(time[0]))
        axis.set_xlim(time[0], max(time[-1], time[0] + 1e-9))

    def _envelopes(self, axis: Any) -> None:
        """The ball's envelope behind that of the beam."""
        time = self.response.time
        parts = min(PARTS, self.oscillations // 2)
        starts = np.linspace(0, time.size, parts + 1).astype(int)[:-1]
        curves = [(self.beam, BEAM, self.place)] if self.ball is None else [
            (self.ball, BLUE, self.pair.name), (self.beam, BEAM, self.place)
        ]  # fmt: skip
        for values, color, name in curves:
            low, high = (self.factor * edge.reduceat(values, starts) for edge in (np.minimum, np.maximum))
            axis.fill_between(time[starts], low, high, color=color, linewidth=0.6, label=f"envelope of {name}")
        axis.set_xlim(time[0], time[-1])
        legend_above(axis)

    def _walls(self, axis: Any, inside: NDArray[np.bool_]) -> None:
        """Walls of a box move with the beam, stops stand still relative to the base or in space."""
        time, (plus, minus) = self.response.time[inside], self.pair.gaps
        middle = self.beam[inside] if self.ball is not None else np.zeros(time.size)
        if self.ball is None and getattr(self.pair, "fixed_to", "base") == "space":
            middle = -self.response.base.displacement(time)
        edges = [self.factor * (middle + gap) for gap in (plus, -minus)]
        both = all(map(math.isfinite, (plus, minus)))
        if both:
            axis.fill_between(time, *edges, color=FREE, linewidth=0.0, label="between the walls")
        for edge, gap in zip(edges, (plus, minus), strict=True):
            if math.isfinite(gap):
                label = None if both else self.pair.name
                axis.plot(time, edge, color=WALL, linewidth=0.8 if both else 2.0, label=label)

    def _impacts(self, axis: Any, start: float) -> None:
        impacts, time = self.response.impacts, self.response.time
        at = impacts.time[(impacts.impactor == self.pair.name) & (impacts.time >= start) & (impacts.time <= time[-1])]
        curve = self.beam if self.ball is None else self.ball
        axis.plot(at, self.factor * np.interp(at, time, curve), "o", color=ORANGE, markersize=5.0, label="impact")
