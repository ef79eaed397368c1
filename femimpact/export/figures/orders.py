"""Figure of a table of a convergence study: relative errors over the size, with reference slopes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.convergence import ConvergenceTable
from femimpact.errors import require_type
from femimpact.export.figures.look import COLOURS, GREY, OffScreen, panel, plain_log_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["convergence"]

LABELS = {"mesh": ("longest element (mm)", 1e3), "step": ("step dt (µs)", 1e6), "modes": ("modes kept", 1.0)}
"""Of the axis, and the factor of its sizes."""

MARKERS = "os^Dv<>P"
LOWEST = 1e-16
"""Smallest error that is drawn."""


def convergence(
    table: ConvergenceTable, names: Sequence[str] | None = None, ax: Axes | OffScreen | None = None
) -> Axes:
    """Relative error of watched quantities over element length, step or number of modes, on logarithmic axes.

    A dashed line for each expected order begins at the largest error of the first quantity that has it. Hollow marks
    are differences of statistics within their scatter.

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
    """
    require_type(table, ConvergenceTable, "table")
    chosen = [table.index(name) for name in (table.name.tolist() if names is None else names)]
    axis = panel(ax, 8.6, 5.6)
    label, scale = LABELS[table.axis]
    x = table.number if table.axis == "modes" else scale * table.size
    slopes: dict[float, int] = {}
    for k, i in enumerate(chosen):
        error = np.where(table.error[:, i] >= LOWEST, table.error[:, i], np.nan)
        if not np.any(np.isfinite(error)):
            continue
        order = table.fitted_order[i]
        words = f"{table.name[i]}: order {order:.2f}" if np.isfinite(order) else str(table.name[i])
        style: dict[str, Any] = {"color": COLOURS[k % len(COLOURS)], "marker": MARKERS[k // len(COLOURS) % 8]}
        axis.loglog(x, error, label=words, **style)
        noise = np.where(table.meaningful[:, i], np.nan, error)
        axis.loglog(x, noise, linestyle="none", markerfacecolor="white", **style)
        if np.isfinite(table.expected_order[i]) and np.count_nonzero(np.isfinite(error)) > 1:
            slopes.setdefault(float(table.expected_order[i]), i)
    for order, i in sorted(slopes.items()):
        _slope(axis, x, table.error[:, i], order, -1.0 if table.axis == "modes" else 1.0)
    floor = np.nanmax(table.floor[chosen], initial=0.0)
    if floor > 0.0:
        axis.axhspan(LOWEST, floor, color="#eeeeee", zorder=0)
        axis.annotate(f"round-off floor {floor:.0e}", (0.02, floor), xycoords=("axes fraction", "data"), color=GREY)
    axis.axhline(table.accuracy, color=GREY, linewidth=1.0)
    words = f"{100.0 * table.accuracy:g} %"
    axis.annotate(
        words, (0.99, table.accuracy), xycoords=("axes fraction", "data"), color=GREY, ha="right", va="bottom"
    )
    plain_log_ticks(axis.xaxis)
    axis.set_xlabel(label)
    axis.set_ylabel("relative error")
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=9.0)
    return axis


def _slope(axis: Any, x: Any, error: Any, order: float, sense: float) -> None:
    """A line of a slope through the largest error, as far as the errors go."""
    known = np.flatnonzero(np.isfinite(error) & (error > 0.0))
    first = known[np.argmax(error[known])]
    line = 0.5 * error[first] * (x / x[first]) ** (sense * order)
    kept = line >= max(0.1 * error[known].min(), LOWEST)
    if np.count_nonzero(kept) < 2:
        return
    axis.loglog(x[kept], line[kept], "--", color=GREY, linewidth=1.0)
    last = np.flatnonzero(kept)[-1]
    axis.annotate(f"{order:g}", (x[last], line[last]), color=GREY, fontsize=9.0, ha="right", va="top")
