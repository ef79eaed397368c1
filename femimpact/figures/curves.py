"""Figures over parameters: response curves, damping over the amplitude, errors and orders, the curve of a damper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.convergence.table import ConvergenceTable, is_finer
from femimpact.errors import column, having, instance, optional, quantity, require, takes, text, truth
from femimpact.figures.drawing import (
    COLOURS,
    DARK,
    GREY,
    LEGEND,
    OffScreen,
    by_label,
    label_axes,
    legend_above,
    panel,
    panels,
    plain_log_ticks,
    rows_of,
)
from femimpact.signals.decay import DecayEstimate
from femimpact.sweep.curve import ONE_START, FrequencyResponse, on_grid
from femimpact.units import name_words, number_text, prefixed

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

FREQUENCY: Any = quantity("Hz", above=0.0)
RINGS: Any = {"markersize": 7.0, "markerfacecolor": "none", "markeredgewidth": 1.2}
"""Marks of an even grid."""


@takes(title=text(), coarse=optional(column("Hz", "points", finite=True)), join_all=truth())
def response_curve(
    curves: FrequencyResponse | Mapping[str, FrequencyResponse],
    title: str = "",
    coarse: ArrayLike | None = None,
    *,
    published: Sequence[tuple[str, float, float]] = (),
    bands: Sequence[tuple[str, ArrayLike, ArrayLike, ArrayLike]] = (),
    join_all: bool = False,
    ax: Axes | OffScreen | None = None,
) -> Axes:
    """Response curves over the base frequency on one logarithmic axis (the paper's Fig. 6 and 7).

    A line joins the peaks of motions that repeat ("periodic" in `FrequencyResponse.steadiness`) and of those without
    impacts, at whose largest peak is said where a transient has not died out. A dot marks a value of one start wherever
    a motion with impacts is not periodic (`FrequencyResponse.is_sample`): such a peak is one sample of a scatter, from
    another start it is another one, and no line joins it. The rms, which scatters less, is a dotted line where there
    are impacts, with small dots.

    Parameters
    ----------
    curves : FrequencyResponse or mapping of str to FrequencyResponse
        By label. The first one's largest peak is annotated, unless it is one sample of a scatter.
    title : str
    coarse : array_like of Hz, optional
        Frequencies marked on the curves, to show which points a coarse grid has.
    published : sequence of (label, Hz, m)
        Peaks to compare with, marked by stars; an amplitude that is not a number marks the frequency only.
    bands : sequence of (label, Hz, m, m)
        Frequencies with the lowest and the highest peak of several starts there. Each band has the colour of the curve
        of its place in `curves`, after the first.
    join_all : bool
        Join all peaks by lines, also those that scatter; these keep their dots.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Raises
    ------
    InputError
        If there is no curve, or something else than one.
    """
    named = by_label("curves", curves, FrequencyResponse, "response curves")
    peaks = rows_of("published", published, label=text(), frequency=FREQUENCY, amplitude=quantity("m", finite=False))
    ranges = rows_of("bands", bands, label=text(), frequency=column("Hz", "n"), low=column("m", "n"),
                     high=column("m", "n"))  # fmt: skip
    for i, (_, *arrays) in enumerate(ranges):
        same = len({len(array) for array in arrays}) == 1
        require(same, f"bands[{i}]", "arrays", "", "must have as many frequencies as lowest and highest peaks")
    axis = panel(ax, 8.0, 5.0)
    axis.set_yscale("log")
    filled = [
        axis.fill_between(
            x, 1e3 * low, 1e3 * high, color=COLOURS[i % len(COLOURS)], alpha=0.25, linewidth=0.0, label=label
        )
        for i, (label, x, low, high) in enumerate(ranges, 1)
    ]
    for colour, (label, curve) in zip(cycle(COLOURS), named.items(), strict=False):
        prefix = f"{label}: " if label else ""
        _peaks(axis, curve, colour, f"{prefix}peak", join_all)
        if _has_rms(named, curve):
            axis.plot(curve.frequency, _scale(curve)[0] * curve.rms, color=colour, linestyle=":", label=f"{prefix}rms")
            samples = curve.is_sample
            dots: Any = {"color": colour, "markersize": 6.0, "alpha": 0.7, "markeredgewidth": 0.0, "linestyle": "none"}
            axis.plot(curve.frequency[samples], _scale(curve)[0] * curve.rms[samples], ".", **dots)
        if coarse is not None:
            seen = on_grid(curve.frequency, coarse)
            axis.plot(curve.frequency[seen], _scale(curve)[0] * curve.peak[seen], "o", color=colour, **RINGS)
    marks = [_mark(axis, marker, *mark) for marker, mark in zip(cycle("*PX"), peaks, strict=False)]
    first = next(iter(named.values()))
    if not _scatter(first, join_all)[np.nanargmax(first.peak)]:
        _annotate_peak(axis, first)
    label_axes(axis, "base frequency (Hz)", _observed(first), title or _level(first))
    plain_log_ticks(axis.yaxis)
    _legend(axis, named, coarse, join_all, filled, marks)
    return axis


COLUMNS = (
    ("phase", "phase of the first harmonic", "rad"),
    ("impacts_per_cycle", "impacts per cycle of the base", "1"),
    ("cycle_mean_force", "cycle-averaged contact force", "N"),
    ("peak_force", "largest contact force", "N"),
    ("mean_approach_speed", "mean approach speed", "m/s"),
)
"""Columns of response curves that are drawn besides the peak: name, words, unit."""


def response_columns(
    curves: FrequencyResponse | Mapping[str, FrequencyResponse], figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """Phase, impacts per cycle, contact forces and approach speed of response curves over the base frequency.

    Of what is zero on every curve there is no panel.

    Parameters
    ----------
    curves : FrequencyResponse or mapping of str to FrequencyResponse
        By label.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (columns,) of Axes

    Raises
    ------
    InputError
        If there is no curve, or something else than one.
    """
    named = by_label("curves", curves, FrequencyResponse, "response curves")
    largest = {
        name: max(float(np.nanmax(np.abs(curve[name]), initial=0.0)) for curve in named.values())
        for name, _, _ in COLUMNS
    }
    drawn = [column for column in COLUMNS if column[0] == "phase" or largest[column[0]] > 0.0]
    rows = -(-len(drawn) // 2)
    axes = panels(figure, 8.0 if len(drawn) == 1 else 11.0, 3.2 * rows, rows, min(len(drawn), 2)).ravel()
    for axis, (name, words, unit) in zip(axes, drawn, strict=False):
        factor, label_unit = (1.0, unit) if unit == "rad" else prefixed(largest[name], unit)
        for colour, (label, curve) in zip(cycle(COLOURS), named.items(), strict=False):
            order = np.argsort(curve.frequency, kind="stable")
            x, y = curve.frequency[order], factor * curve[name][order]
            samples = curve.is_sample[order]
            axis.plot(x[samples], y[samples], ".", color=colour, markersize=5.0)
            if name == "phase":
                # a gap wherever it goes on at the other end of its range
                turns = 1 + np.flatnonzero(np.abs(np.diff(y)) > np.pi)
                x, y = np.insert(x, turns, np.nan), np.insert(y, turns, np.nan)
            if name == "phase" or np.nansum(np.abs(y)) > 0.0:
                axis.plot(x, y, color=colour, linewidth=1.2, label=label or None)
        label_axes(axis, "base frequency (Hz)", f"{words} ({label_unit})" if label_unit != "1" else words)
        if len(named) > 1:
            legend_above(axis)
    for axis in axes[len(drawn) :]:
        axis.remove()
    return np.asarray(axes[: len(drawn)])


def _annotate_peak(axis: Axes, curve: FrequencyResponse) -> None:
    """The largest peak and its frequency, on the side of the peak that is farther from the end of the axis."""
    scale, unit = _scale(curve)
    peak = (curve.peak_frequency, scale * curve.peak_amplitude)
    low, high = curve.frequency[0], curve.frequency[-1]
    side: Any = {"xytext": (8, -2)} if peak[0] <= 0.25 * low + 0.75 * high else {"xytext": (-8, -2), "ha": "right"}
    words = f"{number_text(peak[1])} {unit} at {number_text(peak[0])} Hz"
    if curve.peak_is_transient:
        words += ",\na transient has not died out"
    axis.annotate(words, peak, textcoords="offset points", color=COLOURS[0], fontsize=LEGEND, va="top", **side)


def _scale(curve: FrequencyResponse) -> tuple[float, str]:
    """Factor of the values of a curve where they are drawn, and the unit that they then have."""
    return {"m": (1e3, "mm"), "Pa": (1e-6, "MPa")}.get(curve.unit, (1.0, curve.unit))


def _level(curve: FrequencyResponse) -> str:
    if isinstance(curve.acceleration, tuple):
        return "base acceleration over the frequency"
    if curve.amplitude is None:
        return f"base acceleration {curve.acceleration:.4g} m/s$^2$"
    return f"base amplitude {1e3 * curve.amplitude:.4g} mm"


def _observed(curve: FrequencyResponse) -> str:
    """Name and unit of what a curve is of."""
    place, unit = curve.at, _scale(curve)[1]
    if isinstance(place, str) and (curve.unit != "m" or "." in place):
        return f"{name_words(place)} ({unit})"
    place = place if isinstance(place, str) else f"{1e3 * place:.4g} mm from the root,"
    return f"{place} displacement relative to the base ({unit})"


def _legend(
    axis: Axes, named: Mapping[str, FrequencyResponse], coarse: ArrayLike | None, join_all: bool, bands: Sequence[Any],
    marks: Sequence[Any],
) -> None:  # fmt: skip
    """Colours of the curves in one row, what their lines and dots are in another, then bands and published peaks."""
    from matplotlib.lines import Line2D

    def entry(label: str, **style: Any) -> Line2D:
        return Line2D([], [], **{"color": DARK, "label": label} | style)

    colours = [
        entry(label, color=colour, linewidth=3.0) for colour, label in zip(cycle(COLOURS), named, strict=False) if label
    ]
    scatter = [_scatter(curve, join_all) for curve in named.values()]
    kinds = []
    if not all(map(np.all, scatter)):
        kinds.append(entry("peak"))
    if any(np.any(curve.is_sample) for curve in named.values()):
        kinds.append(entry(ONE_START if kinds else f"peak, {ONE_START}", marker=".", markersize=7.0, linestyle="none"))
    if any(_has_rms(named, curve) for curve in named.values()):
        kinds.append(entry("rms", linestyle=":"))
    if coarse is not None:
        label = f"even grid, {np.size(coarse)} points"
        kinds.append(entry(label, marker="o", linestyle="none", **RINGS))
    legend_above(axis, colours, [*kinds, *marks], bands)


def _has_rms(named: Mapping[str, FrequencyResponse], curve: FrequencyResponse) -> bool:
    """True where the rms of a curve is drawn: of three curves at most."""
    return len(named) <= 3 and bool(np.nansum(curve.impacts_per_cycle) > 0.0)


def _peaks(axis: Any, curve: FrequencyResponse, colour: str, label: str, join_all: bool) -> None:
    """Peaks of one curve: lines through motions that repeat or are linear, dots where the motion is not periodic."""
    frequency, peak = curve.frequency, _scale(curve)[0] * curve.peak
    scatter = _scatter(curve, join_all)
    joined = np.where(scatter, np.nan, peak)
    if not scatter.all():
        axis.plot(frequency, joined, color=colour, label=label)
        # between two samples that scatter a line would have no length
        alone = ~scatter & np.append(True, scatter[:-1]) & np.append(scatter[1:], True) & (scatter.size > 1)
        axis.plot(frequency[alone], joined[alone], "_", color=colour, markersize=7.0)
    samples = curve.is_sample
    if samples.any():
        dots: Any = {"color": colour, "markersize": 7.0, "alpha": 0.7, "markeredgewidth": 0.0, "linestyle": "none"}
        axis.plot(frequency[samples], peak[samples], ".", label=f"{label}, {ONE_START}", **dots)


def _scatter(curve: FrequencyResponse, join_all: bool) -> NDArray[np.bool_]:
    """True for peaks that no line joins: samples of a motion with impacts that does not repeat."""
    # without impacts the motion is linear: it may still beat at the end of a dwell, and does not scatter
    return np.asarray(curve.is_sample & (not join_all))


def _mark(axis: Any, marker: str, label: str, frequency: float, amplitude: float) -> Any:
    """A published peak, or its frequency alone."""
    if not np.isfinite(amplitude):
        return axis.axvline(frequency, color=GREY, linestyle="--", linewidth=1.2, label=label)
    style: Any = {"color": "black", "markersize": 11.0, "linestyle": "none"}
    return axis.plot(frequency, 1e3 * amplitude, marker, label=label, **style)[0]


@takes(result=instance(DecayEstimate))
def decay(result: DecayEstimate, ax: Axes | OffScreen | None = None) -> Axes:
    """Damping ratio over the amplitude, with its intervals, beside those of the damped sines and of the maxima.

    Parameters
    ----------
    result : DecayEstimate
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.
    """
    axis = panel(ax, 8.0, 5.0)
    scale, unit = {"m": (1e3, "mm")}.get(result.unit, (1.0, result.unit))
    amplitude, ratio, known = scale * result.amplitude, 100.0 * result.damping_ratio, np.isfinite(result.low)
    bars = 100.0 * np.array([result.damping_ratio - result.low, result.high - result.damping_ratio])[:, known]
    axis.errorbar(amplitude[known], ratio[known], bars, fmt="o", color=COLOURS[0], capsize=3.0, markersize=5.0,
                  label=f"windows of 5 cycles, {result.level:.0%} interval")  # fmt: skip
    alone: Any = {"color": COLOURS[0], "marker": "o", "markerfacecolor": "white", "linestyle": "none"}
    if not known.all():
        axis.plot(amplitude[~known], ratio[~known], **alone, markersize=5.0, label="windows without an interval")
    axis.plot(amplitude, 100.0 * result.from_maxima, "x", color=GREY, markersize=5.0, label="maxima of their cycles")
    modes = [mode for mode in result.modes if np.isfinite(mode.damping_ratio)]
    for colour, mode in zip(cycle(COLOURS[1:]), modes, strict=False):
        axis.axhline(100.0 * mode.damping_ratio, color=colour, linestyle="--", linewidth=1.2,
                     label=f"damped sine of {mode.frequency:.4g} Hz")  # fmt: skip
    lowest = min(0.0, 1.2 * float(np.nanmin(ratio, initial=0.0)))
    highest = axis.get_ylim()[1]
    # of ratios that are all alike the marks lie below the edge
    axis.set(xlim=(0.0, None), ylim=(lowest, highest + 0.05 * (highest - lowest)))
    label_axes(axis, f"amplitude ({unit or 'unit of the signal'})", "damping ratio (%)", "")
    *lines, windows = axis.get_legend_handles_labels()[0]
    legend_above(axis, [windows, *lines])
    return axis


LABELS = {"mesh": ("longest element (mm)", 1e3), "step": ("step dt (µs)", 1e6), "modes": ("modes kept", 1.0)}
"""Label of the axis, and factor of its sizes."""

KINDS = {"Hz": "natural frequencies", "1": "mode shapes", "m": "displacements"}
"""Kind of a quantity by its unit."""

MARKERS, LINES = "os^Dv<>P", ("-", ":", "-.")
CURVES = (*COLOURS, "#222222")
"""Colours of curves; each next round of them has another line."""
LARGEST, SMALLEST = 10.0, 5.0
"""Sizes of marks, points."""

SLOPE_DASHES = ((6.0, 3.0), (2.0, 2.0), (8.0, 2.0, 2.0, 2.0))
"""Dashes of reference slopes, which have one colour."""

LOWEST = 1e-16
"""Smallest error that is drawn."""


@takes(table=instance(ConvergenceTable), names=optional(column("", "quantities", of="text")))
def convergence(
    table: ConvergenceTable, names: Sequence[str] | None = None, ax: Axes | OffScreen | None = None
) -> Axes:
    """Relative error of watched quantities over element length, step or number of modes, on logarithmic axes.

    A dashed line for each expected order begins at the largest error of the first quantity that has it. Hollow marks
    are differences of statistics within their scatter. Meshes whose longest element does not fall from one to the next
    are drawn over their number of elements. For many quantities see `convergence_panels`.

    Parameters
    ----------
    table : ConvergenceTable
    names : sequence of str, optional
        Quantities; all by default.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Raises
    ------
    InputError
        If it has no quantity of a name.
    """
    chosen = [table.index(str(name)) for name in (table.name if names is None else names)]
    axis = panel(ax, 8.6, 5.6)
    label, scale = LABELS[table.axis]
    has_order = bool(np.all(is_finer(table.size[np.isfinite(table.size)])))
    x = table.number if table.axis == "modes" or not has_order else scale * table.size
    if not has_order:
        label = "elements"
    slopes: dict[float, int] = {}
    for k, i in enumerate(chosen):
        error = np.where(table.error[:, i] >= LOWEST, table.error[:, i], np.nan)
        if not np.any(np.isfinite(error)):
            continue
        order = table.fitted_order[i]
        words = f"{table.name[i]}: order {order:.2f}" if np.isfinite(order) else str(table.name[i])
        style: dict[str, Any] = {
            "color": CURVES[k % len(CURVES)], "marker": MARKERS[k % len(MARKERS)],
            # of two curves in one place the first one's marks are seen around those of the other
            "markersize": max(LARGEST - 3.5 * k, SMALLEST),
        }  # fmt: skip
        axis.loglog(x, error, LINES[k // len(CURVES) % len(LINES)], label=words, **style)
        noise = np.where(table.meaningful[:, i], np.nan, error)
        axis.loglog(x, noise, linestyle="none", markerfacecolor="white", **style)
        if has_order and np.isfinite(table.expected_order[i]) and np.count_nonzero(np.isfinite(error)) > 1:
            slopes.setdefault(float(table.expected_order[i]), i)
    for number, (order, i) in enumerate(sorted(slopes.items())):
        _slope(axis, x, table.error[:, i], order, -1.0 if table.axis == "modes" else 1.0, number)
    floor = np.nanmax(table.floor[chosen], initial=0.0)
    if floor > 0.0:
        # its name is in the legend: inside, no place is free of curves for every study
        axis.axhspan(LOWEST, floor, color="#eeeeee", zorder=0, label=f"round-off floor: {floor:.0e}")
    axis.axhline(table.accuracy, color=GREY, linewidth=1.0, label=f"accuracy asked for: {100.0 * table.accuracy:g} %")
    plain_log_ticks(axis.xaxis)
    label_axes(axis, label, "relative error")
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=9.0)
    return axis


@takes(table=instance(ConvergenceTable))
def convergence_panels(table: ConvergenceTable, figure: FigureBase | OffScreen | None = None) -> NDArray[np.object_]:
    """The curves of `convergence` in a panel for each kind of quantity that has errors: frequencies, shapes, forces.

    Parameters
    ----------
    table : ConvergenceTable
    figure : Figure, optional
        Drawn on; a new pyplot figure by default.

    Returns
    -------
    ndarray (kinds,) of Axes
    """
    kinds: dict[str, list[str]] = {}
    has_errors = np.any(table.error > 0.0, axis=0)
    for i in np.flatnonzero(has_errors if np.any(has_errors) else ~has_errors).tolist():
        name, unit, is_statistic = table.name[i], table.unit[i], table.is_statistic[i]
        kind = "statistics" if is_statistic else KINDS.get(str(unit), "forces, moments and stresses")
        if table.kind == "runs":
            kind = "runs in steps"
        kinds.setdefault(kind, []).append(str(name))
    columns = min(len(kinds), 2)
    rows = -(-len(kinds) // columns)
    axes = panels(figure, 6.4 * columns, 3.9 * rows, rows, columns).ravel()
    for axis, (kind, names) in zip(axes, kinds.items(), strict=False):
        convergence(table, names, ax=axis)
        axis.set_title(kind)
    for axis in axes[len(kinds) :]:
        axis.remove()
    return np.asarray(axes[: len(kinds)])


def _slope(axis: Any, x: Any, error: Any, order: float, sense: float, number: int) -> None:
    """A line of a slope below the largest error, as far as the errors go; `number` decides its dashes."""
    known = np.flatnonzero(np.isfinite(error) & (error > 0.0))
    first = known[np.argmax(error[known])]
    line = 0.5 * error[first] * (x / x[first]) ** (sense * order)
    drawn = line >= max(0.1 * error[known].min(), LOWEST)
    if np.count_nonzero(drawn) < 2:
        return
    # its name is in the legend, where it lies on no curve
    dashes = (0, SLOPE_DASHES[int(number) % len(SLOPE_DASHES)])
    axis.loglog(x[drawn], line[drawn], linestyle=dashes, color=GREY, linewidth=1.2, label=f"reference: order {order:g}")


OF_DAMPER = {
    "loss": "loss per cycle / (m ω² A²)",
    "effective_mass": "effective mass / m",
    "both_walls": "share of starts with an impact on each wall in every cycle",
}
"""Panels of the curve of a damper."""


@takes(curve=having("a dataset of design.damper_curve", ("restitution", "amplitude_over_gap")), title=text())
def damper_curve(
    curve: xarray.Dataset, title: str = "", *, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """Loss and effective mass of a ball in a box over A/d, and the share of the starts that find both walls.

    The closed form is a line where it is stable, and dashed where it is not. Circles are motions of runs, the larger
    the more starts found them. A star is where from on all starts find an impact on each wall in every cycle.

    Parameters
    ----------
    curve : xarray.Dataset
        Of `design.damper_curve`.
    title : str
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (panels,) of Axes
    """
    names = [name for name in OF_DAMPER if name in curve or f"motion_{name}" in curve]
    axes: NDArray[np.object_] = panels(figure, 8.0, 3.2 * len(names), len(names), 1, sharex=True)[:, 0]
    level = curve["amplitude_over_gap"].to_numpy()
    for colour, (e, own) in zip(cycle(COLOURS), curve.groupby("restitution"), strict=False):
        own = own.squeeze("restitution")
        for axis, name in zip(axes, names, strict=True):
            runs = own.get(f"motion_{name}")
            if name in own:
                certain = own["stable"] if name != "both_walls" else True
                axis.plot(level, own[name].where(certain), color=colour, label=f"e = {e:g}")
                axis.plot(level, own[name], "--", color=colour, linewidth=1.0)
            if runs is not None:
                at = own["amplitude_over_gap"].broadcast_like(runs)
                size = 60.0 * own["motion_share"].fillna(0.0)
                axis.scatter(at, runs, size, facecolors="none", edgecolors=colour, label=f"e = {e:g}, runs")
            if "sure_from" in own and np.isfinite(own["sure_from"]):
                star = (own[name] if runs is None else runs[:, 0]).sel(amplitude_over_gap=own["sure_from"])
                look: Any = {"color": colour, "markersize": 15.0, "markeredgecolor": DARK, "zorder": 4.0}
                label = f"from {float(own['sure_from']):.3g} on all starts find both walls"
                axis.plot(own["sure_from"], star, "*", label=label, **look)
    axes[0].set(xscale="log", yscale="log")
    for axis, name in zip(axes, names, strict=True):
        x = "amplitude of the box over the gap, A/d" if name == names[-1] else ""
        label_axes(axis, x, OF_DAMPER[name], title if name == names[0] else "")
    plain_log_ticks(axes[0].xaxis)
    plain_log_ticks(axes[0].yaxis)
    legend_above(axes[0])
    return axes
