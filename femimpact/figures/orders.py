"""Figures of convergence: errors over mesh, step and modes with their orders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence.table import ConvergenceTable, is_finer
from femimpact.errors import column, instance, optional, takes
from femimpact.figures.drawing import COLOURS, GREY, OffScreen, label_axes, panel, panels, plain_log_ticks

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
