"""Figure of a response over the number of normal modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.convergence import ModeConvergence
from femimpact.export.figures import BLUE, ORANGE, _figure, _plain_log_ticks
from femimpact.export.impact_figures import _scaled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["mode_convergence_figure"]

CASES = ((0, BLUE, "o", 0.97, "modes only"), (1, ORANGE, "s", 1.03, "with static correction"))
"""Column, colour, marker, shift along the axis so that bars do not hide one another, label."""


def mode_convergence_figure(result: ModeConvergence) -> Figure:
    """Displacement, losses and equivalent damping over the number of modes, with and without correction.

    Bars are the scatter between eight parts of the window; differences within them mean nothing.
    """
    figure, axes = _figure(12.0, 4.6, 1, 3)
    displacement, loss, damping = axes[0]
    _draw(displacement, result, (("rms", "-", ""),), "m", "displacement")
    _draw(loss, result, (("contact_loss", "-", "contact"), ("structure_loss", ":", "structure")), "J", "loss per cycle")
    _draw(damping, result, (("damping", "-", ""),), "%", "equivalent damping ratio")
    displacement.set_title(f"rms displacement: {result.at}", loc="left")
    loss.set_title("loss per cycle", loc="left")
    damping.set_title("equivalent damping ratio", loc="left")
    figure.suptitle(
        f"law: {result.law}; bars: scatter between 8 parts of the last {result.cycles} base cycles\n" + _first(result),
        x=0.01, ha="left", fontsize=11.0,
    )  # fmt: skip
    return figure


def _draw(axis: Any, result: ModeConvergence, rows: tuple[tuple[str, str, str], ...], unit: str, label: str) -> None:
    """Each row of the result, without and with correction, in a unit that reads well."""
    largest = max(float(np.nanmax(np.abs(getattr(result, name)))) for name, *_ in rows)
    scale = 100.0
    if unit != "%":
        scaled, unit = _scaled(largest, unit)
        scale = scaled / largest if largest else 1.0
    for name, line, what in rows:
        values, bars = scale * getattr(result, name), scale * result.scatter[name]
        for k, colour, marker, shift, case in CASES:
            axis.errorbar(
                shift * result.counts, values[:, k], bars[:, k], color=colour, marker=marker, linestyle=line,
                capsize=3.0, markersize=5.0, markerfacecolor=colour if line == "-" else "white",
                label=f"{what}, {case}" if what else case,
            )  # fmt: skip
    axis.set_xscale("log")
    _plain_log_ticks(axis.xaxis)
    axis.set_ylim(bottom=0.0, top=(1.2 + 0.15 * len(rows)) * axis.get_ylim()[1])
    axis.set_xlabel("normal modes kept")
    axis.set_ylabel(f"{label} ({unit})")
    axis.legend(loc="upper right", frameon=False, fontsize=9.0)


def _first(result: ModeConvergence) -> str:
    """The part that converges, in words."""
    cells = [
        f"{result.displacement_error[-2, k]:.1g} {case} (order {result.displacement_order[k]:.2g})"
        for k, *_, case in CASES
    ]
    return f"displacement after one first impact, error at {result.counts[-2]} modes: " + ", ".join(cells)
