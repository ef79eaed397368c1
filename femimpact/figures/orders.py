"""Figures of convergence: errors over mesh, step and modes with their orders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence import ConvergenceTable, MeshConvergence, ModeConvergence, StepConvergence
from femimpact.convergence.table import is_finer
from femimpact.errors import column, instance, optional, quantity, takes
from femimpact.figures.drawing import (
    BLUE,
    COLOURS,
    GREY,
    ORANGE,
    OffScreen,
    label_axes,
    legend_above,
    panel,
    panels,
    plain_log_ticks,
)
from femimpact.units import prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

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

    Returns
    -------
    Axes

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
    """The curves of `convergence` in a panel for each kind of quantity: frequencies, shapes, displacements, forces.

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
    for name, unit, is_statistic in zip(table.name, table.unit, table.is_statistic, strict=True):
        kind = "statistics" if is_statistic else KINDS.get(str(unit), "forces, moments and stresses")
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
    kept = line >= max(0.1 * error[known].min(), LOWEST)
    if np.count_nonzero(kept) < 2:
        return
    # its name is in the legend, where it lies on no curve
    dashes = (0, SLOPE_DASHES[int(number) % len(SLOPE_DASHES)])
    axis.loglog(x[kept], line[kept], linestyle=dashes, color=GREY, linewidth=1.2, label=f"reference: order {order:g}")


SLOPE: Any = optional(quantity("1", above=0.0, at_most=20.0))
"""Order of a reference line."""

MODE_MARKERS = "osD^v"
"""Markers of curves; each next round of colours has another one."""

CASES = ((0, BLUE, "o", 0.97, "modes only"), (1, ORANGE, "s", 1.03, "with static correction"))
"""Column, colour, marker, shift along the axis so that bars do not hide one another, label."""


@takes(result=instance(MeshConvergence), slope=SLOPE)
def mesh_convergence(result: MeshConvergence, slope: float | None = 4.0, ax: Axes | OffScreen | None = None) -> Axes:
    """Relative error of the natural frequencies over the number of elements.

    Parameters
    ----------
    result : MeshConvergence
    slope : float, 1, optional
        Order of the dashed reference line: 4 for the frequencies of cubic Hermite elements. None draws none.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes
    """
    axis = panel(ax, 7.0, 5.0)
    for i in range(result.reference.size):
        label = _with_order(f"mode {i + 1}, {result.reference[i]:.5g} Hz", result.order[i])
        marker = MODE_MARKERS[i // len(COLOURS) % len(MODE_MARKERS)]
        error = np.maximum(result.error[:, i], 1e-16)
        axis.loglog(result.elements, error, f"{marker}-", color=COLOURS[i % len(COLOURS)], label=label)
    if slope is not None:
        _reference(axis, result.elements, result.error[:, :1], -slope, 0.3, f"reference: order {slope:g}")
    axis.axhspan(1e-16, 1e-12, color="#eeeeee", zorder=0, label="round-off floor")
    axis.set_ylim(bottom=1e-16)
    plain_log_ticks(axis.xaxis)
    label_axes(axis, "elements", "relative error of the natural frequency")
    legend_above(axis)
    return axis


@takes(result=instance(StepConvergence), slope=SLOPE)
def step_convergence(result: StepConvergence, slope: float | None = 2.0, ax: Axes | OffScreen | None = None) -> Axes:
    """Error of the response and of the energy over the step.

    Parameters
    ----------
    result : StepConvergence
    slope : float, 1, optional
        Order of the dashed reference line: 2 for the Newmark family. None draws none.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes
    """
    axis = panel(ax, 7.0, 5.0)
    rows = (
        (result.linear_error, _with_order("without ball, 3 cycles", result.linear_order), "o-"),
        (result.first_impact_error, _with_order("after the first impact", result.first_impact_order), "s-"),
        (result.energy_residual, "energy residual of these runs", "^--"),
    )
    for colour, (values, label, style) in zip(COLOURS, rows, strict=False):
        if np.any(np.isfinite(values)):
            axis.loglog(1e6 * result.dt, values, style, color=colour, label=label)
    if slope is not None:
        _reference(axis, 1e6 * result.dt, result.linear_error[:, None], slope, 0.5, f"reference: order {slope:g}")
    label_axes(axis, "step dt (microseconds)", "relative error")
    legend_above(axis)
    return axis


def _with_order(words: str, order: float) -> str:
    """A curve's label: rows that all lie at the round-off floor have no order."""
    return f"{words}: order {order:.2f}" if np.isfinite(order) else words


def _reference(
    axis: Any, x: NDArray[np.float64 | np.int64], errors: NDArray[np.float64], slope: float, below: float, label: str
) -> None:
    """A line of a slope below the errors (n, curves), from the largest one to where the errors end."""
    worst = int(np.nanargmax(errors.max(axis=1)))
    line = below * np.nanmin(errors[worst]) * (x / x[worst]) ** slope
    kept = line >= 0.1 * np.nanmin(errors[errors > 0.0], initial=np.nanmax(errors))
    axis.loglog(x[kept], line[kept], "--", color=GREY, linewidth=1.2, label=label)


@takes(result=instance(ModeConvergence))
def mode_convergence(result: ModeConvergence, figure: FigureBase | OffScreen | None = None) -> NDArray[np.object_]:
    """Displacement, losses and equivalent damping over the number of modes, with and without correction.

    Bars are the scatter between eight parts of the window; differences within them mean nothing.

    Parameters
    ----------
    result : ModeConvergence
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (3,) of Axes
    """
    axes: NDArray[np.object_] = panels(figure, 12.0, 4.6, 1, 3)[0]
    displacement, loss, damping = axes
    losses = (("contact_loss", "-", "contact"), ("structure_loss", ":", "structure"))
    _draw(displacement, result, (("rms", "-", ""),), "m", "displacement", f"rms displacement: {result.at}")
    _draw(loss, result, losses, "J", "loss per cycle", "loss per cycle")
    _draw(damping, result, (("damping", "-", ""),), "%", "equivalent damping ratio", "equivalent damping ratio")
    errors = (
        f"{result.displacement_error[-2, k]:.1g} {case} (order {result.displacement_order[k]:.2g})"
        for k, *_, case in CASES
    )
    axes[0].figure.suptitle(
        f"law: {result.law}; bars: scatter between 8 parts of the last {result.cycles} base cycles\n"
        f"displacement after one first impact, error at {result.counts[-2]} modes: {', '.join(errors)}",
        x=0.01, ha="left", fontsize=11.0,
    )  # fmt: skip
    return axes


def _draw(
    axis: Any, result: ModeConvergence, rows: tuple[tuple[str, str, str], ...], unit: str, label: str, title: str
) -> None:  # fmt: skip
    """Each row of the result, without and with correction, in a unit that reads well."""
    largest = max(float(np.nanmax(np.abs(getattr(result, name)))) for name, *_ in rows)
    scale = 100.0
    if unit != "%":
        scale, unit = prefixed(largest, unit)
    for name, line, what in rows:
        values, bars = scale * getattr(result, name), scale * result.scatter[name]
        for k, colour, marker, shift, case in CASES:
            axis.errorbar(
                shift * result.counts, values[:, k], bars[:, k], color=colour, marker=marker, linestyle=line,
                capsize=3.0, markersize=5.0, markerfacecolor=colour if line == "-" else "white",
                label=f"{what}, {case}" if what else case,
            )  # fmt: skip
    axis.set_xscale("log")
    plain_log_ticks(axis.xaxis)
    axis.set_ylim(bottom=0.0, top=(1.2 + 0.15 * len(rows)) * axis.get_ylim()[1])
    label_axes(axis, "normal modes kept", f"{label} ({unit})", title)
    axis.legend(loc="upper right", frameon=False, fontsize=9.0)
