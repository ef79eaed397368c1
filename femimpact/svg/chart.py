"""A chart as HTML and SVG: lines over one axis, which fills any width and keeps the size of its words.

The plot is an SVG that is stretched to the width there is; its lines keep their thickness, and the words beside it are
HTML. A dot is a line without length with round ends, which no stretching makes an ellipse. Colours are variables of
CSS (`--fi-1` and so on), so that a page can have its own; without one, and in a notebook, those of the figures hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from femimpact.svg.axis import Axis
from femimpact.svg.elements import Child, Element, element, markup
from femimpact.svg.thinning import MOST_POINTS, thinned_line

__all__ = ["COLOURS", "GRID", "Band", "Chart", "Line", "chart_element", "chart_style", "notebook_markup", "path_of"]

Array = NDArray[np.float64]

GRID = 10_000
"""Steps into which a plot is divided both ways."""

NOTEBOOK_POINTS = 600
"""Points of a line in a notebook."""

COLOURS = 6
"""Colours that differ; further lines begin with the first again."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a chart.

    Parameters
    ----------
    name : str
        Without one it has no place in the legend.
    x, y : ndarray (n,)
        What is not a number is a gap.
    colour : int
        Number, from 1; 0 is that of what is beside the matter.
    style : {"line", "dots", "thin", "dashed", "none"}
        Of "none" the marked points alone are drawn.
    marked : ndarray (n,) of bool, optional
        Points that have a dot besides.
    """

    name: str
    x: Array
    y: Array
    colour: int = 1
    style: str = "line"
    marked: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Band:
    """What lies between two lines, shaded."""

    name: str
    x: Array
    low: Array
    high: Array
    colour: int = 0


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines over an axis.

    Parameters
    ----------
    title : str
    x, y : Axis
    lines : tuple of Line
    bands : tuple of Band
        Below the lines.
    levels : tuple of (str, float)
        Words and value of y of lines across the chart.
    places : tuple of (str, float)
        Words and value of x of lines from its lower to its upper edge.
    note : str
        Below the chart.
    """

    title: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]
    bands: tuple[Band, ...] = ()
    levels: tuple[tuple[str, float], ...] = ()
    places: tuple[tuple[str, float], ...] = ()
    note: str = ""


def chart_element(chart: Chart, most: int = MOST_POINTS) -> Element:
    """The chart as a figure of HTML, with at most so many points of each line."""
    return element(
        "figure.fi-chart",
        element("figcaption.fi-title", chart.title) if chart.title else None,
        _legend(chart),
        element("div.fi-y-label", chart.y.label),
        element("div.fi-plot", _plot(chart, most), *_ticks(chart), *_words(chart)),
        element("div.fi-x-label", chart.x.label),
        element("p.fi-note", chart.note) if chart.note else None,
        data_x=_range_words(chart.x),
        data_y=_range_words(chart.y),
    )


def notebook_markup(chart: Chart | Element | None) -> str:
    """A chart as HTML for a notebook, with its style and fewer points; nothing for None."""
    if chart is None:
        return ""
    shown = chart_element(chart, NOTEBOOK_POINTS) if isinstance(chart, Chart) else chart
    return markup(element("div", element("style", chart_style()), shown, style="max-width:40rem"))


@cache
def chart_style() -> str:
    """The style sheet of charts."""
    return files("femimpact.svg").joinpath("chart.css").read_text(encoding="utf-8")


def path_of(x: Array, y: Array) -> str:
    """A path through points that are shares of the plot, (n,) each from 0 to 1; what is not a number is a gap."""
    columns = np.clip(np.rint(GRID * x), -GRID, 2 * GRID), np.clip(np.rint(GRID * (1.0 - y)), -GRID, 2 * GRID)
    parts, follows = list[str](), False
    for across, down in zip(*(column.tolist() for column in columns), strict=True):
        known = across == across and down == down
        if known:
            parts.append(f"{'L' if follows else 'M'}{across:.0f} {down:.0f}")
        follows = known
    return "".join(parts)


def _dots_of(x: Array, y: Array) -> str:
    known = np.isfinite(x) & np.isfinite(y) & (np.abs(x) <= 2.0) & (np.abs(y) <= 2.0)
    pairs = zip(np.rint(GRID * x[known]).tolist(), np.rint(GRID * (1.0 - y[known])).tolist(), strict=True)
    return "".join(f"M{across:.0f} {down:.0f}h0" for across, down in pairs)


def _range_words(axis: Axis) -> str:
    return f"{axis.low!r} {axis.high!r} {'log' if axis.logarithmic else 'linear'}"


def _legend(chart: Chart) -> Child:
    named = [(line.name, line.colour, line.style) for line in chart.lines if line.name]
    named += [(band.name, band.colour, "band") for band in chart.bands if band.name]
    if len(named) < 2 and not chart.bands:
        return None
    entries = [
        element("li", element(f"span.fi-key.fi-{style}.fi-c{_colour(colour)}"), name) for name, colour, style in named
    ]
    return element("ul.fi-legend", *entries)


def _colour(number: int) -> int:
    return 0 if number == 0 else (number - 1) % COLOURS + 1


def _plot(chart: Chart, most: int) -> Element:
    words = ", ".join(line.name for line in chart.lines if line.name)
    title = f"{chart.title or chart.y.label}: {chart.y.label} over {chart.x.label}{'; ' if words else ''}{words}"
    grid = "".join(f"M{GRID * at:.0f} 0V{GRID}" for at in _places(chart.x))
    grid += "".join(f"M0 {GRID * (1.0 - at):.0f}H{GRID}" for at in _places(chart.y))
    return element(
        "svg",
        element("path.fi-grid", d=grid),
        *(_band(chart, band, most) for band in chart.bands),
        *(element("path.fi-level", d=f"M0 {GRID * (1.0 - at):.0f}H{GRID}") for _, at in _levels(chart)),
        *(element("path.fi-level", d=f"M{GRID * at:.0f} 0V{GRID}") for _, at in _marks(chart)),
        *(drawn for line in chart.lines for drawn in _line(chart, line, most)),
        viewBox=f"0 0 {GRID} {GRID}", preserveAspectRatio="none", role="img", aria_label=title,
    )  # fmt: skip


def _places(axis: Axis) -> list[float]:
    return [float(axis.share(value)) for value, _ in axis.ticks]


def _levels(chart: Chart) -> list[tuple[str, float]]:
    found = [(words, float(chart.y.share(value))) for words, value in chart.levels]
    return [(words, at) for words, at in found if 0.0 <= at <= 1.0]


def _marks(chart: Chart) -> list[tuple[str, float]]:
    found = [(words, float(chart.x.share(value))) for words, value in chart.places]
    return [(words, at) for words, at in found if 0.0 <= at <= 1.0]


def _line(chart: Chart, line: Line, most: int) -> list[Element]:
    x, y = chart.x.share(line.x), chart.y.share(line.y)
    drawn, colour = [], _colour(line.colour)
    if line.style != "none":
        kept = thinned_line(y, most)
        path = _dots_of(x[kept], y[kept]) if line.style == "dots" else path_of(x[kept], y[kept])
        drawn.append(element(f"path.fi-{line.style}.fi-c{colour}", d=path, data_name=line.name or None))
    if line.marked is not None and np.any(line.marked):
        own = thinned_line(y[line.marked], most // 2)
        name = line.name if line.style == "none" else None
        path = _dots_of(x[line.marked][own], y[line.marked][own])
        drawn.append(element(f"path.fi-dots.fi-c{colour}", d=path, data_name=name or None))
    return drawn


def _band(chart: Chart, band: Band, most: int) -> Element:
    x, low, high = chart.x.share(band.x), chart.y.share(band.low), chart.y.share(band.high)
    kept = np.union1d(thinned_line(low, most // 2), thinned_line(high, most // 2))
    known = kept[np.isfinite(x[kept]) & np.isfinite(low[kept]) & np.isfinite(high[kept])]
    around = np.concatenate([x[known], x[known][::-1]]), np.concatenate([low[known], high[known][::-1]])
    path = path_of(*around)
    return element(f"path.fi-band.fi-c{_colour(band.colour)}", d=f"{path}Z" if path else "")


def _ticks(chart: Chart) -> list[Element]:
    across = zip(_places(chart.x), chart.x.ticks, strict=True)
    up = zip(_places(chart.y), chart.y.ticks, strict=True)
    return [
        *(element("span.fi-x-tick", text, style=f"left:{100 * at:.2f}%") for at, (_, text) in across),
        *(element("span.fi-y-tick", text, style=f"bottom:{100 * at:.2f}%") for at, (_, text) in up),
    ]


def _words(chart: Chart) -> list[Element]:
    """Words of the levels and places inside the plot."""
    return [
        *(
            element("span.fi-level-word", words, style=f"bottom:{100 * at:.2f}%")
            for words, at in _levels(chart)
            if words
        ),
        *(
            element("span.fi-place-word" + (".fi-left" if at > 0.6 else ""), words, style=_beside(at))
            for words, at in _marks(chart)
            if words
        ),
    ]


def _beside(at: float) -> str:
    return f"right:{100 * (1 - at):.2f}%" if at > 0.6 else f"left:{100 * at:.2f}%"
