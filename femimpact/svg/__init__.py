"""Line charts as SVG text: elements, axes with their ticks, thinned lines and the chart."""

from __future__ import annotations

import itertools
import json
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any
from xml.etree.ElementTree import Element as Element

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.units import MINUS, power_of_ten, typeset

Child = Element | str | None
"""Child of an element: another one, a text, or nothing."""

NO_CHARACTER = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Characters that no document may hold: control characters, halves of surrogate pairs."""

RAW = frozenset({"script", "style"})
"""Elements whose text a browser reads as it stands."""


def element(
    kind: str,  # name of the element, and behind dots those of its classes: "p.lead"
    /,
    *children: Child,  # in their order; None is left out
    # value: an underscore stands for a hyphen, one at the end for nothing (`for_`). None and False are left out, True
    # is an attribute without a value.
    **attributes: Any,
) -> Element:
    """An element of HTML or SVG."""
    tag, *classes = kind.split(".")
    made = Element(tag, {"class": " ".join(classes)} if classes else {})
    for key, value in attributes.items():
        if value is not None and value is not False:
            made.set(key.rstrip("_").replace("_", "-"), "" if value is True else _sound(value))
    last: Element | None = None
    for child in children:
        if isinstance(child, str):
            if last is None:
                made.text = (made.text or "") + _sound(child)
            else:
                last.tail = (last.tail or "") + _sound(child)
        elif child is not None:
            made.append(child)
            last = child
    return made


def data_element(data: Any) -> Element:
    """Plain data for a script of the page, as JSON that no text in it can end."""
    # of one text alone the writer escapes nothing, for a browser would not read it
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), sort_keys=True).replace("<", "\\u003c")
    return element("script", text, type="application/json")


def markup(root: Element) -> str:
    """An element as text of HTML.

    Raises `ValueError` if the text of a script or a style would end it.
    """
    for found in root.iter():
        if found.tag in RAW and f"</{found.tag}" in (found.text or "").lower():
            raise ValueError(f"the text of an element {found.tag} holds its own end")
    return ElementTree.tostring(root, encoding="unicode", method="html")


def _sound(value: Any) -> str:
    """A value as text without what no document may hold."""
    return NO_CHARACTER.sub("\ufffd", str(value))


TICKS = 6
"""Ticks of a linear axis, about."""


MARGIN = 0.04
"""Share of the range that is left free at an end."""


@dataclass(frozen=True)
class Axis:
    """A range of values and how it is divided."""

    label: str  # quantity with its unit
    low: float
    high: float
    logarithmic: bool = False

    def share(self, values: ArrayLike) -> Array:
        """Position of values, 0 at the low end and 1 at the high one; not a number off the range of a logarithm."""
        array = np.asarray(values, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if self.logarithmic:
                ends = np.log10([self.low, self.high])
                found = (np.log10(np.where(array > 0.0, array, np.nan)) - ends[0]) / (ends[1] - ends[0])
            else:
                # halves, or a range of the largest numbers overflows
                found = (0.5 * array - 0.5 * self.low) / (0.5 * self.high - 0.5 * self.low)
        return np.where(np.isfinite(found), found, np.nan)

    @property
    def ticks(self) -> list[tuple[float, str]]:
        """Round values within the range, each with its text."""
        return _log_ticks(self) if self.logarithmic else _linear_ticks(self)


def axis_of(
    label: str,
    *values: ArrayLike,
    logarithmic: bool = False,
    tight: bool = False,  # whether it ends with the values, without a margin
    zero: bool = False,  # whether 0 is on it
) -> Axis:
    """The axis on which all finite values have a place."""
    found = [np.asarray(one, dtype=float).ravel() for one in values]
    array = np.concatenate([*found, np.zeros(1 if zero and not logarithmic else 0)])
    array = array[np.isfinite(array) & ((array > 0.0) | (not logarithmic))]
    if array.size == 0:
        return Axis(label, 0.1 if logarithmic else 0.0, 1.0, logarithmic)
    low, high = float(array.min()), float(array.max())
    if logarithmic:
        # room for what is beside it
        low, high = (min(max(end, 1e-300), 1e300) for end in (low, high))
        low, high = (low / 2.0, high * 2.0) if high <= low * 1.0001 else (low, high)
        widened = 1.0 if tight else 10.0 ** (MARGIN * (math.log10(high) - math.log10(low)))
        return Axis(label, low / widened, high * widened, True)
    if not high - low > 1e-12 * max(abs(low), abs(high)):
        half = 0.5 * abs(high) or 0.5
        return Axis(label, low - half, high + half)
    margin = 0.0 if tight else MARGIN * (0.5 * high - 0.5 * low) * 2.0
    most = 8e307
    return Axis(label, max(low if zero and low == 0.0 else low - margin, -most), min(high + margin, most))


def _linear_ticks(axis: Axis) -> list[tuple[float, str]]:
    span = axis.high - axis.low
    step = _round_step(span / TICKS)
    if not 0.0 < step < math.inf:
        return [(axis.low, typeset(axis.low))]
    first, last = math.ceil(axis.low / step - 1e-9), math.floor(axis.high / step + 1e-9)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    values = [k * step for k in range(first, min(last, first + 4 * TICKS) + 1)]
    largest = max(map(abs, values), default=0.0)
    plain = digits <= 5 and largest < 1e6

    def text(value: float) -> str:
        if plain:
            return f"{value:.{digits}f}".replace("-", MINUS) if value else "0"
        return typeset(value if abs(value) > 1e-9 * step else 0.0, 6)

    return [(value, text(value)) for value in values]


def _round_step(least: float) -> float:
    """The least of 1, 2, 5, 10, ... times a power of ten that is not below a value."""
    if not 0.0 < least < math.inf:
        return 0.0
    decade = 10.0 ** math.floor(math.log10(least))
    return next((n * decade for n in (1.0, 2.0, 5.0, 10.0) if n * decade >= least * (1.0 - 1e-9)), 10.0 * decade)


def _log_ticks(axis: Axis) -> list[tuple[float, str]]:
    first, last = math.floor(math.log10(axis.low)), math.ceil(math.log10(axis.high))
    decades = last - first
    steps = (1.0,) if decades > 3 else (1.0, 3.0) if decades > 2 else (1.0, 2.0, 5.0)
    stride = max(1, -(-decades // 8))
    values = [n * 10.0**k for k in range(max(first, -307), min(last, 308) + 1, stride) for n in steps]
    return [(v, _power_text(v, decades)) for v in values if axis.low * (1 - 1e-9) <= v <= axis.high * (1 + 1e-9)]


def _power_text(value: float, decades: int) -> str:
    power = round(math.log10(value))
    is_power = abs(value / 10.0**power - 1.0) < 1e-9
    return f"{value:g}" if decades <= 4 or not is_power else power_of_ten(power)


MOST_POINTS = 2000
"""Points of a line that are drawn at most."""


def thinned_line(
    values: NDArray[np.float64],  # (n,) what is not a number is drawn only where no stretch is cut
    most: int = MOST_POINTS,  # at least 4
) -> NDArray[np.int64]:
    """Numbers of the points of a line that are drawn, in their order.

    The line is cut into stretches of equally many points, and of each the lowest and the highest stay: the largest and
    the smallest value of all among them, and both ends.

    Returns (m,): m <= most.
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


GRID = 10_000
"""Steps into which a plot is divided both ways."""

NOTEBOOK_POINTS = 600
"""Points of a line in a notebook."""

COLOURS = 6
"""Colours that differ; further lines begin with the first again."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a chart."""

    name: str  # without one it has no place in the legend
    x: Array  # (n,) what is not a number is a gap
    y: Array  # (n,)
    colour: int = 1  # number, from 1; 0 is that of what is beside the matter
    style: str = "line"  # {"line", "dots", "thin", "dashed", "none"}: of "none" the marked points alone are drawn
    marked: NDArray[np.bool_] | None = None  # (n,) points that have a dot besides


@dataclass(frozen=True, eq=False)
class Band:
    """A shaded area between two lines."""

    name: str
    x: Array
    low: Array
    high: Array
    colour: int = 0


@dataclass(frozen=True, eq=False)
class Chart:
    """Lines over an axis."""

    title: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]
    bands: tuple[Band, ...] = ()  # below the lines
    levels: tuple[tuple[str, float], ...] = ()  # (str, float) words and value of y of lines across the chart
    # (str, float) words and value of x of lines from its lower to its upper edge
    places: tuple[tuple[str, float], ...] = ()
    note: str = ""  # below the chart


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
        *(element("path.fi-level", d=f"M0 {GRID * (1.0 - at):.0f}H{GRID}") for _, at in _inside(chart.y, chart.levels)),
        *(element("path.fi-level", d=f"M{GRID * at:.0f} 0V{GRID}") for _, at in _inside(chart.x, chart.places)),
        *(drawn for line in chart.lines for drawn in _line(chart, line, most)),
        viewBox=f"0 0 {GRID} {GRID}", preserveAspectRatio="none", role="img", aria_label=title,
    )  # fmt: skip


def _places(axis: Axis) -> list[float]:
    return [float(axis.share(value)) for value, _ in axis.ticks]


def _inside(axis: Axis, named: Iterable[tuple[str, float]]) -> list[tuple[str, float]]:
    """Words of values within an axis, and their positions on it."""
    found = [(words, float(axis.share(value))) for words, value in named]
    return [(words, at) for words, at in found if 0.0 <= at <= 1.0]


def _line(chart: Chart, line: Line, most: int) -> list[Element]:
    x, y = chart.x.share(line.x), chart.y.share(line.y)
    drawn, colour = [], _colour(line.colour)
    if line.style != "none":
        kept = thinned_line(y, most)
        path = _dots_of(x[kept], y[kept]) if line.style == "dots" else path_of(x[kept], y[kept])
        drawn.append(element(f"path.fi-{line.style}.fi-c{colour}", d=path, data_name=line.name or None))
    if line.marked is not None and np.any(line.marked):
        kept = thinned_line(y[line.marked], most // 2)
        name = line.name if line.style == "none" else None
        path = _dots_of(x[line.marked][kept], y[line.marked][kept])
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
            for words, at in _inside(chart.y, chart.levels)
            if words
        ),
        *(
            element("span.fi-place-word.fi-left", words, style=f"right:{100 * (1 - at):.2f}%")
            if at > 0.6
            else element("span.fi-place-word", words, style=f"left:{100 * at:.2f}%")
            for words, at in _inside(chart.x, chart.places)
            if words
        ),
    ]
