"""The part of a report on a parameter study: a quantity over two axes as a map of colours, over one as a line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.report.blocks import Section
from femimpact.svg.axis import Axis, axis_of, number_text
from femimpact.svg.chart import GRID, Chart, Line, chart_element
from femimpact.svg.elements import Element, element

if TYPE_CHECKING:
    import xarray

__all__ = ["maps_section"]

MOST_CELLS = 4000
"""Cells of one map; of a finer one every second, third, ... is drawn."""

LEVELS = 16
"""Colours of a map."""

MOST_MAPS = 12

COLOURS = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#fde725")
"""Viridis, which is read alike in grey and by colour-blind readers, at equal distances."""


def maps_section(data: xarray.Dataset, key: str = "maps", heading: str = "Maps of the study") -> Section | None:
    """Every numeric quantity of a dataset over its first two axes; further axes are read at their first value.

    Parameters
    ----------
    data : xarray.Dataset
        Coordinates and variables with `units` and `long_name` where they have them.
    key, heading : str

    Returns
    -------
    Section or None
        None where there is nothing to draw.
    """
    drawn = []
    for name, values in data.data_vars.items():
        if values.dtype.kind not in "fiu" or not values.dims:
            continue
        fixed = {str(dim): 0 for dim in values.dims[2:]}
        one = values.isel(fixed) if fixed else values
        made = _line(data, str(name), one) if one.ndim == 1 else _map(data, str(name), one)
        if made is not None:
            drawn.append(made)
    return Section(key, heading, (element("div.charts", *drawn[:MOST_MAPS]),)) if drawn else None


def _label(data: Any, name: str) -> str:
    about = data[name].attrs if name in data.variables else {}
    words, unit = str(about.get("long_name", name.replace("_", " "))), str(about.get("units", ""))
    return f"{words} ({unit})" if unit not in ("", "1") else words


def _places(data: Any, dim: str, count: int) -> NDArray[np.float64]:
    values = data[dim].to_numpy() if dim in data.variables else np.arange(count)
    return np.asarray(values, dtype=float) if values.dtype.kind in "fiu" else np.arange(count, dtype=float)


def _line(data: Any, name: str, values: Any) -> Element | None:
    dim = str(values.dims[0])
    x, y = _places(data, dim, values.size), np.asarray(values.to_numpy(), dtype=float)
    if not np.any(np.isfinite(y)):
        return None
    order = np.argsort(x, kind="stable")
    chart = Chart(
        _label(data, name),
        axis_of(_label(data, dim), x, tight=True),
        axis_of(_label(data, name), y),
        (Line(name, x[order], y[order]),),
    )
    return chart_element(chart)


def _map(data: Any, name: str, values: Any) -> Element | None:
    """A map of colours in 16 levels, with its scale below."""
    down, across = (str(dim) for dim in values.dims)
    z = np.asarray(values.to_numpy(), dtype=float)
    finite = z[np.isfinite(z)]
    if not finite.size or min(z.shape) < 2:
        return None
    low, high = float(finite.min()), float(finite.max())
    stride = math.ceil(math.sqrt(z.size / MOST_CELLS))
    x, y = _places(data, across, z.shape[1])[::stride], _places(data, down, z.shape[0])[::stride]
    columns, rows = np.argsort(x, kind="stable"), np.argsort(y, kind="stable")
    level = _levels(z[::stride, ::stride][np.ix_(rows, columns)], low, high)
    ends = _edges(x[columns]), _edges(y[rows])
    axes = [Axis(_label(data, dim), float(e[0]), float(e[-1])) for dim, e in zip((across, down), ends, strict=True)]
    frame = chart_element(Chart(_label(data, name), axes[0], axes[1], ()))
    plot = frame.find(".//svg")
    if plot is None:
        raise AssertionError("a chart has a plot")
    # corners of the cells in the units of the plot
    left = np.rint(GRID * axes[0].share(ends[0])).astype(int).tolist()
    top = np.rint(GRID * (1.0 - axes[1].share(ends[1]))).astype(int).tolist()
    for k in range(LEVELS):
        cells = np.argwhere(level == k).tolist()
        path = "".join(f"M{left[j]} {top[i + 1]}H{left[j + 1]}V{top[i]}H{left[j]}Z" for i, j in cells)
        if path:
            plot.append(element("path", d=path, style=f"fill:{_colour(k / (LEVELS - 1))};stroke:none"))
    thinned = f"; one of {stride} cells is drawn each way" if stride > 1 else ""
    scale = element("span.key", style=f"background:linear-gradient(to right,{','.join(COLOURS)})")
    frame.append(element("p.fi-note", scale, f" {number_text(low)} to {number_text(high)}{thinned}"))
    return frame


def _levels(z: NDArray[np.float64], low: float, high: float) -> NDArray[np.int64]:
    """Number of the level of every value; -1 where there is none."""
    known = np.isfinite(z)
    share = np.where(known, (z - low) / ((high - low) or 1.0), 0.0)
    return np.where(known, np.minimum((LEVELS * share).astype(np.int64), LEVELS - 1), -1)


def _edges(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ends of the cells around places in their order."""
    middles = 0.5 * (places[1:] + places[:-1])
    return np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])


def _colour(share: float) -> str:
    """Of the scale of colours, between two of which it lies."""
    at = share * (len(COLOURS) - 1)
    k = min(int(at), len(COLOURS) - 2)
    mixed = [
        round((1 - at + k) * int(COLOURS[k][i : i + 2], 16) + (at - k) * int(COLOURS[k + 1][i : i + 2], 16))
        for i in (1, 3, 5)
    ]
    return "#" + "".join(f"{part:02x}" for part in mixed)
