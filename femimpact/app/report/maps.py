"""The part of a report on a parameter study: a quantity over two axes as a map of colours, over one as a line."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from femimpact.app.report.page import Section
from femimpact.figures.study_labels import (
    OUTLINE,
    OUTLINED,
    STATISTICS,
    UNSURE,
    BestMarks,
    axis_value,
    axis_words,
    has_logarithmic_colours,
    map_panels,
    measure_names,
    sample_axes,
    single_samples,
    unsure_cells,
    value_words,
)
from femimpact.svg import GRID, Axis, Band, Chart, Element, Line, axis_of, chart_element, element
from femimpact.units import SHOWN_IN, in_shown_units, typeset

if TYPE_CHECKING:
    import xarray


MOST_CELLS = 4000
"""Cells of one map; of a finer one every second, third, ... is drawn."""

LEVELS = 16
"""Colours of a map."""

BRIGHT = 10
"""Lowest level whose colour has black marks."""

MOST_MAPS = 36

MOST_PANELS = 9
"""Maps of one measure; of more values of its further axes some are shown, the first and the last among them."""

MOST_DOTS = 60
"""Points of a line up to which each has a dot."""

MOST_NUMBERS = 120
"""Cells of a map up to which each has its number."""

CORNER = 0.2
"""Sides of the mark in the corner of a cell, over those of the cell."""

DOTS = (("#000000", "7px"), ("#ffffff", "4px"))
"""Colours and widths of the dot in a cell, drawn one over the other: one is visible on any colour."""

MARKED = f"A mark in the corner of a cell: {UNSURE} (90 % interval of the median)."

MOTIONS = "A dot in a cell: its motion does not repeat, the value is one sample, and another start has another."

COLOURS = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#fde725")
"""Viridis, at equal distances; in grey and to colour-blind readers its order stays."""


def maps_section(
    data: xarray.Dataset,  # xarray.Dataset: coordinates and variables with `units` and `long_name` where they have them
    key: str = "maps",
    heading: str = "Maps of the study",
    marks: BestMarks | None = None,  # of lines
) -> Section | None:
    """Every measure of a dataset: over two axes as a map, over one as a line, of a list of cases as dots.

    The first axis leads to the right and the second up, as in `figures.study_map`. There is a map for each value of
    a third axis and a fourth, all of one scale of colours; further axes are read at their middle value. Of several
    starts a line has the band from the smallest start to the largest; a cell has a mark in its corner where the
    starts cannot tell it from its neighbours, a dot where its value is a sample of a motion that does not repeat, and
    an outline where `is_best` is true.

    Returns: none where there is nothing to draw.
    """
    drawn: list[Element] = []
    shown_marks = BestMarks() if marks is None else _in_units_of(data, marks)
    data = _in_shown_units(data)
    for name in measure_names(data):
        # a dimension with one value is not drawn as an axis
        longer = [str(dim) for dim, size in data[name].sizes.items() if size > 1]
        fixed = {str(dim): 0 for dim, size in data[name].sizes.items() if size == 1}
        one = data.isel(fixed) if fixed else data
        if one[name].dims == ("case",):
            drawn += _dots(one, name)
        elif len(longer) == 1:
            drawn.append(_line(one, name, shown_marks))
        elif longer:
            drawn += _maps(one, name, longer)
    if not drawn:
        return None
    left = len(drawn) - MOST_MAPS
    words = [element("p.below", f"{left} further charts are left out: the file of the study has all values.")]
    return Section(key, heading, (element("div.charts", *drawn[:MOST_MAPS]), *(words if left > 0 else [])))


def _in_shown_units(data: xarray.Dataset) -> xarray.Dataset:
    """The same dataset in the units in which measures and axes are shown."""
    measures = measure_names(data)
    names = [*measures, *(f"{name}{end}" for name in measures for end in STATISTICS if end != "_groups")]
    # the sides of a pair of gaps are read in m
    names += [str(name) for name in data.coords if not str(name).endswith((".plus", ".minus"))]
    about = {name: data[name] for name in names if name in data.variables}
    units = {name: str(values.attrs["units"]) for name, values in about.items() if "units" in values.attrs}
    columns, shown = in_shown_units({name: about[name].to_numpy() for name in units}, units)
    changed = {
        name: (about[name].dims, columns[name], about[name].attrs | {"units": unit})
        for name, unit in shown.items()
        if unit != units[name]
    }
    return data.assign({k: v for k, v in changed.items() if k in data.data_vars}).assign_coords(
        {k: v for k, v in changed.items() if k in data.coords}
    )


def _in_units_of(data: xarray.Dataset, marks: BestMarks) -> BestMarks:
    """Marks of the first measure of a dataset in the units in which it and its axes are shown."""
    units = {str(name): str(data[name].attrs.get("units", "")) for name in data.variables}
    factor = SHOWN_IN.get(units[measure_names(data)[0]], (1.0, ""))[0]
    spans = dict[str, tuple[float, float]]()
    for axis, (low, high) in marks.spans.items():
        scale = SHOWN_IN.get(units.get(axis, ""), (1.0, ""))[0]
        spans[axis] = (scale * low, scale * high)
    return BestMarks(marks.within, tuple((told, factor * level) for told, level in marks.levels), spans)


def _label(data: Any, name: str) -> str:
    about = data[name].attrs if name in data.variables else {}
    unit = str(about.get("units", ""))
    words = axis_words(data, name) if "long_name" in about else name.replace("_", " ")
    return f"{words} ({unit})" if unit not in ("", "1") else words


def _places(data: Any, dim: str, count: int) -> NDArray[np.float64]:
    values = data[dim].to_numpy() if dim in data.variables else np.arange(count)
    return np.asarray(values, dtype=float) if values.dtype.kind in "fiu" else np.arange(count, dtype=float)


def _line(data: Any, name: str, marks: BestMarks) -> Element:
    """A measure over one axis, with the band of its starts and with the marks of the best."""
    values = data[name]
    dim = str(values.dims[0])
    x, y = _places(data, dim, values.size), np.asarray(values.to_numpy(), dtype=float)
    order = np.argsort(x, kind="stable")
    bands: tuple[Band, ...] = ()
    reach = [y]
    if f"{name}_low" in data and f"{name}_high" in data:
        low, high = (np.asarray(data[f"{name}{end}"].to_numpy(), dtype=float) for end in ("_low", "_high"))
        bands = (Band("smallest to largest of the starts", x[order], low[order], high[order], colour=1),)
        reach += [low, high]
    dots = np.full(order.shape, order.size <= MOST_DOTS)
    # without a name a single line has no legend
    line = Line("median of the starts" if bands else name, x[order], y[order], marked=dots)
    up = axis_of(_label(data, name), np.concatenate(reach), [level for _, level in marks.levels])
    lines, note = [line], _names_of_places(data, dim)
    if dim in marks.spans and not note:
        ends = np.asarray(marks.spans[dim])
        bands = (Band(marks.within, ends, np.full(2, up.low), np.full(2, up.high), colour=3), *bands)
    if "is_best" in data:
        at = data["is_best"].to_numpy()
        lines.append(Line(OUTLINED, x[at], y[at], colour=2, style="none", marked=np.ones(int(at.sum()), dtype=bool)))
    chart = Chart(
        _label(data, name), axis_of(_label(data, dim), x, tight="is_best" not in data), up, tuple(lines), bands,
        marks.levels, note=note,
    )  # fmt: skip
    return chart_element(chart)


def _dots(data: Any, name: str) -> list[Element]:
    """A measure of a list or a sample of cases over each of their values that is a number."""
    y = np.asarray(data[name].to_numpy(), dtype=float)
    drawn: list[Element] = []
    for axis in sample_axes(data):
        places = data[axis]
        if places.dims != ("case",) or places.dtype.kind not in "fiu":
            continue
        x = np.asarray(places.to_numpy(), dtype=float)
        lines = (Line(name, x, y, style="dots"),)
        chart = Chart(_label(data, name), axis_of(_label(data, axis), x), axis_of(_label(data, name), y), lines)
        drawn.append(chart_element(chart))
    return drawn


def _names_of_places(data: Any, dim: str) -> str:
    """Legend of the numbers, from 0, that stand for the values of an axis of names or of pairs of gaps; else empty."""
    names = value_words(data, dim) if dim in data.variables else None
    if names is None:
        return ""
    unit = " mm" if f"{dim}.plus" in data.coords else ""
    return "; ".join(f"{i}: {name}{unit}" for i, name in enumerate(names[:20]))


def _maps(data: Any, name: str, axes: Sequence[str]) -> list[Element]:
    """Maps over the first two axes, one for each value of a third and a fourth, with one scale of colours."""
    panels, middle = map_panels(data, axes, MOST_PANELS, math.isqrt(MOST_PANELS))
    shown = data.isel(middle) if middle else data
    finite = shown[name].to_numpy()
    finite = finite[np.isfinite(finite)]
    if not finite.size:
        return []
    colours = Colours(float(finite.min()), float(finite.max()), has_logarithmic_colours(finite))
    drawn = []
    for numbers in itertools.product(*panels.values()):
        panel = dict(zip(panels, numbers, strict=True))
        title = ", ".join(_value_text(data, axis, index) for axis, index in (panel | middle).items())
        drawn.append(_map(shown.isel(panel) if panel else shown, name, colours, title))
    return drawn


def _value_text(data: Any, axis: str, index: int) -> str:
    """One value of an axis, with its name before it."""
    words, value, unit = axis_value(data, axis, index)
    shown = value if isinstance(value, str) else typeset(value)
    return f"{words} {shown}{' ' if unit else ''}{unit}"


class Colours(NamedTuple):
    """Scale of colours that maps share."""

    low: float
    high: float
    is_logarithmic: bool

    def share(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Place of values along the scale, from 0 to 1; not a number where they are none."""
        if self.is_logarithmic:
            return np.log(z / self.low) / math.log(self.high / self.low)
        return (z - self.low) / ((self.high - self.low) or 1.0)


def _map(data: Any, name: str, colours: Colours, title: str) -> Element:
    """A map of colours in 16 levels, with its scale below: the first axis to the right, the second up."""
    dims = [str(dim) for dim in data[name].dims]
    z = np.asarray(data[name].to_numpy(), dtype=float)
    stride = math.ceil(math.sqrt(z.size / MOST_CELLS))
    places = [_places(data, dim, size)[::stride] for dim, size in zip(dims, z.shape, strict=True)]
    orders = [np.argsort(one, kind="stable") for one in places]
    ends = [_edges(one[order]) for one, order in zip(places, orders, strict=True)]

    def rows_up(values: Any) -> Any:
        """The cells that are drawn, in rows from below."""
        return values[::stride, ::stride][np.ix_(*orders)].T

    x, y = (Axis(_label(data, dim), float(e[0]), float(e[-1])) for dim, e in zip(dims, ends, strict=True))
    frame = chart_element(Chart(f"{_label(data, name)}; {title}" if title else _label(data, name), x, y, ()))
    plot, box = frame.find(".//svg"), frame.find(".//div[@class='fi-plot']")
    if plot is None or box is None:
        raise AssertionError("a chart has a plot")
    # corners of the cells in the units of the plot
    left = np.rint(GRID * x.share(ends[0])).astype(int).tolist()
    top = np.rint(GRID * (1.0 - y.share(ends[1]))).astype(int).tolist()
    cells = rows_up(z)
    level = _levels(colours.share(cells))
    _colour_cells(plot, level, left, top)
    unsure = rows_up(unsure_cells(data, name)) & (level >= 0)
    _mark_corners(plot, unsure, level, left, top)
    single = rows_up(single_samples(data) if "finished" in data else np.zeros(z.shape, dtype=bool)) & (level >= 0)
    _mark(plot, "sample", DOTS, "".join(
        f"M{(left[j] + left[j + 1]) // 2} {(top[i] + top[i + 1]) // 2}h0" for i, j in np.argwhere(single).tolist()
    ))  # fmt: skip
    best = rows_up(data["is_best"].to_numpy()) if "is_best" in data else np.zeros(cells.shape, dtype=bool)
    path = "".join(f"M{left[j]} {top[i + 1]}H{left[j + 1]}V{top[i]}H{left[j]}Z" for i, j in np.argwhere(best).tolist())
    if path:
        plot.append(element("path.best", d=path, style=f"fill:none;stroke:{OUTLINE};stroke-width:3px"))
    if cells.size <= MOST_NUMBERS:
        _write_numbers(box, cells, level, left, top)
    some = f"; one of {stride} cells is drawn each way" if stride > 1 else ""
    unit = str(data[name].attrs.get("units", ""))
    scale_words = f"{f' {unit}' if unit not in ('', '1') else ''}{', logarithmic' if colours.is_logarithmic else ''}"
    scale = element("span.key", style=f"background:linear-gradient(to right,{','.join(COLOURS)})")
    frame.append(element("p.fi-note", scale, f" {typeset(colours.low)} to {typeset(colours.high)}{scale_words}{some}"))
    notes = [
        f"Outlined: {OUTLINED}." if best.any() else "",
        MARKED if unsure.any() else "",
        MOTIONS if single.any() else "",
        *(_names_of_places(data, d) for d in dims),
    ]
    for words in filter(None, notes):
        frame.append(element("p.fi-note", words))
    return frame


def _colour_cells(plot: Element, level: NDArray[np.int64], left: list[int], top: list[int]) -> None:
    """One path of cells for each level."""
    for k in range(LEVELS):
        cells = np.argwhere(level == k).tolist()
        path = "".join(f"M{left[j]} {top[i + 1]}H{left[j + 1]}V{top[i]}H{left[j]}Z" for i, j in cells)
        if path:
            plot.append(element("path", d=path, style=f"fill:{_colour(k / (LEVELS - 1))};stroke:none"))


def _mark(plot: Element, kind: str, strokes: Sequence[tuple[str, str]], path: str) -> None:
    """One path through cells, drawn in two colours of which one is seen on any cell."""
    for colour, width in strokes if path else ():
        plot.append(element(f"path.{kind}", d=path, style=f"stroke:{colour};stroke-width:{width}"))


def _mark_corners(
    plot: Element, marked: NDArray[np.bool_], level: NDArray[np.int64], left: list[int], top: list[int]
) -> None:
    """A triangle in the upper left corner of each marked cell, white on dark colours and black on bright ones."""
    for bright, colour in ((False, "#ffffff"), (True, "#000000")):
        path = ""
        for i, j in np.argwhere(marked & ((level >= BRIGHT) == bright)).tolist():
            across, down = (
                round(CORNER * (to - begin)) for begin, to in ((left[j], left[j + 1]), (top[i + 1], top[i]))
            )
            path += f"M{left[j]} {top[i + 1]}h{across}L{left[j]} {top[i + 1] + down}Z"
        if path:
            plot.append(element("path.corner", d=path, style=f"fill:{colour};stroke:none"))


def _write_numbers(
    box: Element, cells: NDArray[np.float64], level: NDArray[np.int64], left: list[int], top: list[int]
) -> None:
    """The number of each cell in its middle."""
    for (i, j), value in np.ndenumerate(cells):
        if np.isfinite(value):
            across, down = (50.0 * (ends[k] + ends[k + 1]) / GRID for ends, k in ((left, j), (top, i)))
            colour = "#000" if level[i, j] >= BRIGHT else "#fff"
            style = f"left:{across:.4g}%;top:{down:.4g}%;color:{colour}"
            box.append(element("span.cell", f"{typeset(value, 3)}", style=style))


def _levels(share: NDArray[np.float64]) -> NDArray[np.int64]:
    """Number of the level of every place on the scale; -1 where there is none."""
    known = np.isfinite(share)
    return np.where(known, np.minimum((LEVELS * np.where(known, share, 0.0)).astype(np.int64), LEVELS - 1), -1)


def _edges(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ends of the cells around places in their order."""
    middles = 0.5 * (places[1:] + places[:-1])
    return np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])


def _colour(share: float) -> str:
    """Colour at a share of the scale, mixed of the two beside it."""
    at = share * (len(COLOURS) - 1)
    k = min(int(at), len(COLOURS) - 2)
    mixed = [
        round((1 - at + k) * int(COLOURS[k][i : i + 2], 16) + (at - k) * int(COLOURS[k + 1][i : i + 2], 16))
        for i in (1, 3, 5)
    ]
    return "#" + "".join(f"{part:02x}" for part in mixed)
