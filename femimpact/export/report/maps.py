"""The part of a report on a parameter study: a quantity over two axes as a map of colours, over one as a line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.report.blocks import Section
from femimpact.svg.axis import Axis, axis_of, number_text
from femimpact.svg.chart import Chart, Line, chart_element
from femimpact.svg.elements import Element, element

if TYPE_CHECKING:
    import xarray

__all__ = ["maps_section"]

MOST_CELLS = 20_000
"""Cells of one map; of a finer one every second, third, ... is drawn."""

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
    down, across = (str(dim) for dim in values.dims)
    z = np.asarray(values.to_numpy(), dtype=float)
    finite = z[np.isfinite(z)]
    if not finite.size or min(z.shape) < 2:
        return None
    stride = int(np.ceil(np.sqrt(z.size / MOST_CELLS)))
    x, y = _places(data, across, z.shape[1])[::stride], _places(data, down, z.shape[0])[::stride]
    z = z[::stride, ::stride]
    columns, rows = np.argsort(x, kind="stable"), np.argsort(y, kind="stable")
    x, y, z = x[columns], y[rows], z[np.ix_(rows, columns)]
    low, high = float(finite.min()), float(finite.max())
    ends_x, ends_y = _edges(x), _edges(y)
    axes = (
        Axis(_label(data, across), float(ends_x[0]), float(ends_x[-1])),
        Axis(_label(data, down), float(ends_y[0]), float(ends_y[-1])),
    )
    frame = chart_element(Chart(_label(data, name), *axes, ()))
    plot = frame.find(".//svg")
    if plot is None:
        raise AssertionError("a chart has a plot")
    for level in range(16):
        share = np.clip((z - low) / (high - low), 0.0, 1.0) if high > low else np.zeros_like(z)
        mine = np.argwhere(
            np.isfinite(z)
            & (
                np.minimum(
                    (16 * share).astype(int, copy=False)
                    if np.all(np.isfinite(share))
                    else np.nan_to_num(16 * share, nan=-1).astype(int),
                    15,
                )
                == level
            )
        )
        path = "".join(_cell(axes, ends_x, ends_y, int(i), int(j)) for i, j in mine)
        if path:
            plot.append(element("path", d=path, style=f"fill:{_colour(level / 15.0)};stroke:none"))
    key = element(
        "p.fi-note", element("span.key", style=f"background:linear-gradient(to right,{','.join(COLOURS)})"),
        f" {number_text(low)} to {number_text(high)}",
    )  # fmt: skip
    frame.append(key)
    return frame


def _edges(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ends of the cells around places in their order."""
    middles = 0.5 * (places[1:] + places[:-1])
    return np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])


def _cell(axes: tuple[Axis, Axis], x: NDArray[np.float64], y: NDArray[np.float64], row: int, column: int) -> str:
    left, right = (round(1e4 * float(axes[0].share(x[column + k]))) for k in (0, 1))
    low, high = (round(1e4 * (1.0 - float(axes[1].share(y[row + k])))) for k in (0, 1))
    return f"M{left} {high}H{right}V{low}H{left}Z"


def _colour(share: float) -> str:
    """Of the scale of colours, between two of which it lies."""
    at = share * (len(COLOURS) - 1)
    k = min(int(at), len(COLOURS) - 2)
    mixed = [
        round((1 - at + k) * int(COLOURS[k][i : i + 2], 16) + (at - k) * int(COLOURS[k + 1][i : i + 2], 16))
        for i in (1, 3, 5)
    ]
    return "#" + "".join(f"{part:02x}" for part in mixed)
