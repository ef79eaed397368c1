"""Figures of a parameter study: lines with bands over one axis, a map over two, maps over more, dots of a sample."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, thinned
from femimpact.errors import having, optional, require, require_name, require_type, takes, text
from femimpact.figures.drawing import (
    BLUE,
    DARK,
    GREEN,
    STYLE,
    OffScreen,
    label_axes,
    legend_above,
    panel,
    panels,
    plain_log_ticks,
    tick_texts,
)
from femimpact.figures.study_labels import (
    BESIDE,
    OUTLINE,
    OUTLINED,
    UNSURE,
    BestMarks,
    axis_words,
    sample_axes,
    single_samples,
    unsure_cells,
    value_words,
)
from femimpact.sweep.curve import ONE_START
from femimpact.units import number_text, prefixed

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import FigureBase


MOST_NUMBERS = 120
"""Cells of a map up to which each has its number."""

MOST_TICKS, MOST_TICKS_OF_PANEL = 12, 5

LETTERS = 11.0
"""Letters of the numbers of ticks in an inch of an axis."""

MOST_PANELS_EACH_WAY = 6
"""Maps of a figure along its rows and along its columns."""

LOGARITHMIC = 10.0
"""Largest over smallest value of a map beyond which its colours are logarithmic, where all values are above 0."""

MOST_MARKS = 100
"""Values of an axis that have a mark each: more would be a bar."""

CORNER = 0.3
"""Sides of the mark in the corner of a cell, over those of the cell."""


@takes(measure=optional(text()), title=text())
def study(
    dataset: xarray.Dataset, measure: str | None = None, *, title: str = "", norm: str | Normalize | None = None,
    ax: Axes | OffScreen | None = None, figure: FigureBase | OffScreen | None = None,
) -> Any:  # fmt: skip
    """A measure of a parameter study: a line over one axis, a map over two, maps over more, dots of a sample of cases.

    Axes of a single value do not count. A line is that of the medians, with bands from the smallest start to the
    largest and of the median. Maps have the first axis to the right; the third and the fourth lie along columns and
    rows of maps, of an axis beyond the fourth the middle value is shown, and of more values than fit some. Dots are
    drawn over each axis of a list or a sample of cases, with lines from the smallest start to the largest.

    A cell has a mark in its corner where the 90 % interval of its median is wider than the largest difference of its
    median to that of a neighbour: between such cells the map says nothing. Of fewer than 5 starts there is no
    interval; a star is then at a motion that is not periodic, whose value is one sample.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of `parameter_study`, or any other with axes.
    measure : str, optional
        The first of the dataset by default.
    title : str
    norm : {"linear", "log"} or Normalize of matplotlib, optional
        Scale of the colours, of values in the unit of the bar; by default logarithmic where all values are above 0 and
        the largest is more than 10 times the smallest.
    ax : Axes, optional
        A line or one map is drawn on; those of a new pyplot figure by default.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    Axes, or ndarray of Axes
        An array of several maps, and of the dots over each axis.

    Raises
    ------
    InputError
        If there is no such measure, it has no axis, there are `ax` for several panels or a `norm` without a map, no
        value of a map is finite, or a logarithmic scale is asked for of a value that is not above 0.

    Examples
    --------
    >>> import xarray
    >>> peaks = xarray.Dataset({"peak": ("gap", [5e-3, 8e-3])}, {"gap": [2e-3, 4e-3]})
    >>> axis = fi.figures.study(peaks, "peak", ax=fi.figures.OffScreen())
    """
    measure = _measure(dataset, measure)
    dataset = without_single(dataset, measure)
    names = [str(name) for name in dataset[measure].dims]
    require(bool(names), "dataset", f"{measure} alone", "", "must have an axis: one number has no figure")
    require(ax is None or figure is None, "ax", ax, "", "must be left out beside figure=")
    listed, is_line = names == ["case"], len(names) == 1
    allowed = "must be left out: colours are those of a map, over two axes or more"
    require(norm is None or not is_line, "norm", norm, "", allowed)
    if listed or len(names) > 2:
        allowed = f"must be left out, over {'a list of cases' if listed else f'{len(names)} axes'}: give figure="
        require(ax is None or isinstance(ax, OffScreen), "ax", ax, "", allowed)
        on: Any = ax if figure is None else figure
        return _scatter(dataset, measure, title, on) if listed else _maps(dataset, measure, norm, title, on)
    axis = panel(ax, 8.0, 5.0) if figure is None else panels(figure, 8.0, 5.0)[0, 0]
    return _line(dataset, measure, title, axis) if is_line else _map(dataset, measure, norm, title, axis)


def without_single(dataset: xarray.Dataset, measure: str) -> xarray.Dataset:
    """The dataset at the one value of each axis of a measure that has no other, unless all are such."""
    sizes = {name: size for name, size in dataset[measure].sizes.items() if size > 1}
    kept = [*sizes] or [*dataset[measure].dims[:1]]
    return dataset.isel({name: 0 for name in dataset[measure].dims if name not in kept})


def _line(dataset: xarray.Dataset, measure: str, title: str, axis: Axes) -> Axes:
    """A line of medians with its bands."""
    (name,) = dataset[measure].dims
    values = _values(dataset, measure)
    x, label, words = _axis_values(dataset, str(name))
    factor, unit = _scale(dataset, measure, values)
    entries: list[Any] = []
    for low, high, alpha, meaning in (
        ("_low", "_high", 0.18, "smallest to largest of the starts"),
        ("_median_low", "_median_high", 0.4, "90 % interval of the median"),
    ):
        if f"{measure}{low}" in dataset:
            below, above = (factor * dataset[f"{measure}{end}"].to_numpy() for end in (low, high))
            entries.append(axis.fill_between(x, below, above, color=BLUE, alpha=alpha, linewidth=0.0, label=meaning))
    starts = int(dataset.attrs.get("starts", 1))
    entries.insert(0, axis.plot(x, factor * values, "o-", color=BLUE, markersize=4.0,
                                label="value" if starts == 1 else f"median of {starts} starts")[0])  # fmt: skip
    single = single_samples(dataset)
    if single.any():
        star: dict[str, Any] = {"color": DARK, "markersize": 9.0, "label": _star_words(dataset)}
        entries.append(axis.plot(x[single], factor * values[single], "*", **star)[0])
    texts, step = words or tick_texts(x), float(np.diff(np.unique(x)).min(initial=np.inf))
    room = LETTERS * axis.get_window_extent().width / axis.figure.dpi
    if words is not None or (1 + max(map(len, texts))) * np.ptp(x) <= room * step:
        axis.set_xticks(x, texts)
    elif x.size <= MOST_MARKS:
        # each value of the study has a mark, and some have their numbers
        axis.set_xticks(x, minor=True)
    label_axes(axis, label, _measure_label(dataset, measure, unit), title)
    legend_above(axis, entries)
    return axis


def mark_best(axis: Axes, dataset: xarray.Dataset, measure: str, marks: BestMarks) -> Axes:
    """The axes of `study`; of a line with levels across, a span of the axis shaded, and a ring at the best."""
    dataset = without_single(dataset, measure)
    if dataset[measure].ndim > 1:
        # a map outlines the best
        return axis
    factor, _ = _scale(dataset, measure, _values(dataset, measure))
    (name,) = (str(dim) for dim in dataset[measure].dims)
    x, _, words = _axis_values(dataset, name)
    for label, level in marks.levels:
        axis.axhline(factor * level, color=DARK, linewidth=0.8, linestyle="--")
        axis.annotate(label, (0.01, factor * level), xycoords=("axes fraction", "data"), ha="left", va="bottom",
                      fontsize=9.0)  # fmt: skip
    if words is None and name in marks.spans:
        scale = x[np.argmax(np.abs(x))] / dataset[name].to_numpy()[np.argmax(np.abs(x))]
        low, high = (scale * end for end in marks.spans[name])
        axis.axvspan(low, high, color=GREEN, alpha=0.15, linewidth=0.0, label=marks.within)
    at = dataset["is_best"].to_numpy()
    axis.plot(x[at], factor * dataset[measure].to_numpy()[at], "o", markersize=11.0, fillstyle="none", color=OUTLINE,
              label=OUTLINED)  # fmt: skip
    legend_above(axis)
    return axis


def _map(dataset: xarray.Dataset, measure: str, norm: str | Normalize | None, title: str, axis: Axes) -> Axes:
    """Coloured cells over two axes, with a bar."""
    values = _map_values(dataset, measure)
    factor, unit = _scale(dataset, measure, values)
    image = _cells(axis, dataset, measure, factor, _colours(norm, factor * values))
    _bar(image, axis, _measure_label(dataset, measure, unit))
    label_axes(axis, axis.get_xlabel(), axis.get_ylabel(), title)
    _map_legend(axis, dataset, measure)
    return axis


def _maps(
    dataset: xarray.Dataset, measure: str, norm: str | Normalize | None, title: str, on: FigureBase | OffScreen | None
) -> NDArray[np.object_]:
    """A map over the first two of three axes or more in each panel, the others along rows and columns."""
    values = _map_values(dataset, measure)
    names = [str(name) for name in dataset[measure].dims]
    chosen = {name: thinned(dataset.sizes[name], MOST_PANELS_EACH_WAY).tolist() for name in names[2:4]}
    middle = {name: dataset.sizes[name] // 2 for name in names[4:]}
    at_middle, (across, *_) = dataset.isel(middle), chosen
    down = names[3] if len(names) > 3 else None
    columns, rows = chosen[across], chosen[down] if down else [0]
    factor, unit = _scale(dataset, measure, values)
    colours = _colours(norm, factor * values)
    width, height = 2.2 + 2.6 * len(columns), 1.4 + 2.5 * len(rows)
    axes = panels(on, width, height, len(rows), len(columns), sharex=True, sharey=True)
    image, maps = None, []
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            cells = at_middle.isel({across: column} | ({down: row} if down else {}))
            maps.append(cells)
            image = _cells(axes[i, j], cells, measure, factor, colours, numbers=False)
            lines = [_told(dataset, across, column)] + ([_told(dataset, down, row)] if down else [])
            axes[i, j].set_title("\n".join(lines), loc="left", fontsize=9.0)
            if i < len(rows) - 1:
                axes[i, j].set_xlabel("")
            if j:
                axes[i, j].set_ylabel("")
    _bar(image, axes, _measure_label(dataset, measure, unit))
    lines = [title] if title else []
    lines += [f"at {', '.join(_told(dataset, name, index) for name, index in middle.items())}"] if middle else []
    # of what is drawn: a map has fewer neighbours than the dataset
    lines += [f"corner marked: {UNSURE}"] if any(unsure_cells(cells, measure).any() for cells in maps) else []
    lines += [f"*: {_star_words(dataset)}"] if any(single_samples(cells).any() for cells in maps) else []
    if lines:
        axes[0, 0].figure.suptitle("\n".join(lines), fontsize=10.0)
    return axes


def _scatter(
    dataset: xarray.Dataset, measure: str, title: str, on: FigureBase | OffScreen | None
) -> NDArray[np.object_]:
    """Dots of a list or a sample of cases over each of its axes."""
    values = _values(dataset, measure)
    names = sample_axes(dataset)
    factor, unit = _scale(dataset, measure, values)
    axes = panels(on, 1.5 + 3.4 * len(names), 4.2, 1, len(names), sharey=True)
    for axis, name in zip(axes[0], names, strict=True):
        x, label, words = _axis_values(dataset, name)
        if f"{measure}_low" in dataset:
            ends = [factor * dataset[f"{measure}{end}"].to_numpy() for end in ("_low", "_high")]
            axis.vlines(x, *ends, color=BLUE, alpha=0.25, linewidth=1.0)
        axis.plot(x, factor * values, ".", color=BLUE, markersize=5.0)
        if words is not None:
            axis.set_xticks(x, words)
        axis.set_xlabel(label)
    label_axes(axes[0, 0], axes[0, 0].get_xlabel(), _measure_label(dataset, measure, unit), title)
    return axes


# ---- what they share -------------------------------------------------------------------------------


def _measure(dataset: xarray.Dataset, measure: str | None) -> str:
    """Name of a measure, by default of the first.

    Raises `InputError` if the dataset is none, or has no such measure.
    """
    import xarray

    require_type(dataset, xarray.Dataset, "dataset")
    known = [str(name) for name in dataset.data_vars if name not in BESIDE and dataset[name].dtype.kind in "fiu"]
    require(bool(known), "dataset", "no measure", "", "must hold a variable of numbers")
    require_name(known[0] if measure is None else measure, known, "measure")
    return known[0] if measure is None else measure


def _values(dataset: xarray.Dataset, measure: str) -> Array:
    return np.asarray(dataset[measure].to_numpy(), dtype=float)


def _map_values(dataset: xarray.Dataset, measure: str) -> Array:
    values = _values(dataset, measure)
    require(bool(np.any(np.isfinite(values))), "dataset", measure, "", "must have a finite value of the measure")
    return values


def _scale(dataset: xarray.Dataset, measure: str, values: Array) -> tuple[float, str]:
    """Factor and unit in which a measure is shown."""
    unit = str(dataset[measure].attrs.get("units", ""))
    largest = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
    return (1.0, "") if unit in ("", "1") else prefixed(largest, unit)


def _measure_label(dataset: xarray.Dataset, measure: str, unit: str) -> str:
    return _label(dataset[measure].attrs.get("long_name", measure), unit, int(dataset.attrs.get("starts", 1)))


def _bar(image: Any, axes: Any, label: str) -> None:
    """The bar of the colours of cells, beside axes."""
    import matplotlib
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import ScalarFormatter

    ticks = "%g" if isinstance(image.norm, LogNorm) else ScalarFormatter(useOffset=False)
    # print of the size of that of the axes
    with matplotlib.rc_context(STYLE):
        label_axes(image.figure.colorbar(image, ax=axes, format=ticks).ax, "", label)


def _label(words: str, unit: str, starts: int) -> str:
    label = words if starts > 1 or not words else words.removesuffix(", median over the starts")
    lines = label.replace(", median over the starts", f",\nmedian of {starts} starts")
    if len(lines.split("\n")[0]) > 48:
        half = lines.find(" ", 36)
        lines = f"{lines[:half]}\n{lines[half + 1 :]}" if half > 0 else lines
    return f"{lines} ({unit})" if unit else lines


def _axis_values(dataset: xarray.Dataset, name: str) -> tuple[Array, str, list[str] | None]:
    """Numbers along an axis as they are shown, its label, and words of its ticks where its values are no numbers."""
    coordinate, words, ticks = dataset[name], axis_words(dataset, name), value_words(dataset, name)
    values = coordinate.to_numpy()
    if ticks is not None:
        label = f"{words} (mm)" if f"{name}.plus" in dataset.coords else words
        return np.arange(values.size, dtype=float), label, ticks
    unit = str(coordinate.attrs.get("units", ""))
    if unit in ("", "1"):
        return values.astype(float), words, None
    factor, label_unit = prefixed(float(np.max(np.abs(values))), unit)
    return factor * values, f"{words} ({label_unit})", None


def _told(dataset: xarray.Dataset, name: str, index: int) -> str:
    """A value of an axis in words."""
    x, label, words = _axis_values(dataset, name)
    if words is not None:
        return f"{label}: {words[index]}"
    head, _, unit = label.rpartition(" (")
    return f"{head or label}: {tick_texts(x)[index]}{' ' + unit.rstrip(')') if head else ''}"


def _colours(norm: str | Normalize | None, values: Array) -> Normalize:
    """The scale of the colours over all values (in the unit shown) that share it."""
    from matplotlib.colors import LogNorm, Normalize

    if isinstance(norm, Normalize):
        return norm
    known = norm is None or (isinstance(norm, str) and norm in ("linear", "log"))
    require(known, "norm", norm, "", 'must be "linear", "log", or a Normalize of matplotlib')
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    require(norm != "log" or low > 0.0, "norm", "log", "", f"needs values above 0, and the smallest is {low:.4g}")
    # one large cell would leave the others one colour
    logarithmic = high > LOGARITHMIC * low > 0.0 if norm is None else norm == "log"
    return LogNorm(low, high) if logarithmic else Normalize(low, high)


def _cells(
    axis: Axes, dataset: xarray.Dataset, measure: str, factor: float, norm: Normalize, numbers: bool = True
) -> Any:
    """Coloured cells over the two axes of a dataset."""
    from matplotlib.patches import PathPatch, Rectangle

    first, second = (str(name) for name in dataset[measure].dims)
    table = factor * dataset[measure].to_numpy().T
    image = axis.imshow(table, cmap="cividis", origin="lower", aspect="auto", norm=norm)
    axis.grid(False)
    for name, set_ticks, set_label in (
        (first, axis.set_xticks, axis.set_xlabel), (second, axis.set_yticks, axis.set_ylabel),
    ):  # fmt: skip
        x, label, words = _axis_values(dataset, name)
        chosen = list(range(0, x.size, -(-x.size // (MOST_TICKS if numbers else MOST_TICKS_OF_PANEL))))
        set_ticks(chosen, tick_texts(x[chosen]) if words is None else [words[i] for i in chosen])
        set_label(label)
    if "is_best" in dataset:
        for i, j in np.argwhere(dataset["is_best"].to_numpy().T):
            axis.add_patch(Rectangle((j - 0.5, i - 0.5), 1.0, 1.0, fill=False, edgecolor=OUTLINE, linewidth=2.0))
    # of a cell without a value the colour is not read
    unsure, bright = unsure_cells(dataset, measure).T, np.ma.filled(norm(np.ma.masked_invalid(table)), 0.0) >= 0.5
    for side, colour in ((False, "white"), (True, "black")):
        cells = np.argwhere(unsure & (bright == side))
        if len(cells):
            axis.add_patch(PathPatch(_corners(cells), facecolor=colour, linewidth=0.0))
    samples = single_samples(dataset).T & np.isfinite(table)
    if table.size <= MOST_NUMBERS and numbers:
        _write_numbers(axis, table, bright, samples)
    else:
        for side, colour in ((False, "white"), (True, "black")):
            cells = np.argwhere(samples & (bright == side))
            axis.plot(cells[:, 1], cells[:, 0], linestyle="none", marker="$*$", markersize=_star(axis, table.shape),
                      color=colour)  # fmt: skip
    return image


def _star(axis: Axes, shape: tuple[int, ...]) -> float:
    """Size (points) of a star that leaves the colour of its cell to be seen."""
    frame, dpi = axis.get_window_extent(), axis.figure.dpi
    return float(min(5.0, 72.0 / dpi * min(frame.width / shape[1], frame.height / shape[0]) / 2.5))


def _corners(cells: NDArray[np.int64]) -> Any:
    """Triangles in the upper left corners of cells, each by its row and its column, as one path."""
    from matplotlib.path import Path

    corner = np.array([(-0.5, 0.5), (CORNER - 0.5, 0.5), (-0.5, 0.5 - CORNER), (-0.5, 0.5)])
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    return Path((cells[:, None, ::-1] + corner).reshape(-1, 2), np.tile(codes, len(cells)))


def _write_numbers(axis: Axes, table: Array, bright: NDArray[np.bool_], samples: NDArray[np.bool_]) -> None:
    """The number of each cell, with a star where it is a sample."""
    for (i, j), value in np.ndenumerate(table):
        if np.isfinite(value):
            words = f"{number_text(value, 3)}{'*' if samples[i, j] else ''}"
            axis.annotate(words, (j, i), ha="center", va="center", fontsize=9.0,
                          color="black" if bright[i, j] else "white")  # fmt: skip


def _star_words(dataset: xarray.Dataset) -> str:
    """What a star means: a value of one start, or of several starts their median."""
    starts = int(dataset.attrs.get("starts", 1))
    return ONE_START if starts == 1 else f"not periodic: median of {starts} starts"


def _map_legend(axis: Axes, dataset: xarray.Dataset, measure: str) -> None:
    """Legend of stars and marked corners, where there are any."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Any] = []
    if "is_best" in dataset:
        entries.append(Patch(fill=False, edgecolor=OUTLINE, linewidth=2.0, label=OUTLINED))
    if single_samples(dataset).any():
        star: dict[str, Any] = {"color": DARK, "marker": "$*$", "markersize": 7.0, "label": _star_words(dataset)}
        entries.append(Line2D([], [], linestyle="none", **star))
    if unsure_cells(dataset, measure).any():
        corner = [(-1, 1), (1, 1), (-1, -1)]
        entries.append(Line2D([], [], color=DARK, marker=corner, markersize=7.0, linestyle="none", label=UNSURE))
    legend_above(axis, entries)


@takes(
    result=having("what calibrate returns", ("posterior", "parameters", "frequency", "peak", "fitted")), title=text()
)
def calibration(result: Any, *, title: str = "", figure: FigureBase | OffScreen | None = None) -> Any:
    """The posterior of the parameters, and the measured peaks beside those at its medians.

    Parameters
    ----------
    result : Calibration
        Of `calibrate`.
    title : str
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (2,) of Axes
    """
    axes = panels(figure, 11.0, 4.8, 1, 2)[0]
    _posterior(axes[0], result)
    axis, low, high = axes[1], 1e3 * result.fitted_low, 1e3 * result.fitted_high
    order = np.argsort(result.frequency)
    x = result.frequency[order]
    words = "90 % of measured peaks"
    axis.fill_between(x, low[order], high[order], color=BLUE, alpha=0.18, linewidth=0.0, label=words)
    axis.plot(x, 1e3 * result.fitted[order], color=BLUE, label="fitted, median over the starts")
    axis.plot(x, 1e3 * result.peak[order], "o", color=DARK, markersize=4.0, label="measured")
    axis.set_yscale("log")
    plain_log_ticks(axis.yaxis)
    axis.set(xlabel="base frequency (Hz)", ylabel="peak (mm)")
    axes[0].set_title(title, loc="left")
    for panel_axes in axes:
        legend_above(panel_axes)
    return axes


def _posterior(axis: Axes, result: Any) -> None:
    """Density of one parameter as a line, of two as a map, with median and intervals."""
    density, parameters = result.posterior, result.parameters
    scales = [prefixed(float(np.abs(density[p.path]).max()), p.unit) for p in parameters]
    labels = [
        _label(str(density[p.path].attrs["long_name"]), u, 1) for p, (_, u) in zip(parameters, scales, strict=True)
    ]
    medians = [factor * p.median for p, (factor, _) in zip(parameters, scales, strict=True)]
    x = scales[0][0] * density[parameters[0].path].to_numpy()
    ends = [(factor * p.low, factor * p.high) for p, (factor, _) in zip(parameters, scales, strict=True)]
    if len(parameters) == 1:
        axis.plot(x, density.to_numpy() / scales[0][0], color=BLUE, label="posterior")
        axis.axvspan(*ends[0], color=BLUE, alpha=0.18, label="90 % interval")
        axis.axvline(medians[0], color=DARK, label="median")
        axis.set(xlabel=labels[0], ylabel=f"density (1/{scales[0][1]})" if scales[0][1] != "1" else "density")
        return
    y = scales[1][0] * density[parameters[1].path].to_numpy()
    axis.pcolormesh(x, y, density.to_numpy().T, cmap="cividis", shading="nearest", rasterized=True)
    off = [np.array([[middle - low], [high - middle]]) for middle, (low, high) in zip(medians, ends, strict=True)]
    axis.errorbar(
        medians[0], medians[1], xerr=off[0], yerr=off[1], fmt="o", color="white", markersize=5.0, capsize=4.0,
        label="white: median and 90 % intervals",
    )  # fmt: skip
    axis.grid(False)
    axis.set(xlabel=labels[0], ylabel=labels[1])
