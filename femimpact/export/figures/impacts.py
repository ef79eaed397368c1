"""Figures of the table of impacts: how large they are, and when in the cycle they come."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import instance, takes
from femimpact.excitation.excitation import words_of
from femimpact.export.figures.drawing import (
    GREY,
    LEGEND,
    WALLS,
    OffScreen,
    legend_above,
    panel,
    panels,
    scaled,
)
from femimpact.response.response import Response

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

__all__ = ["impact_histograms", "impulse_phase"]


@takes(response=instance(Response))
def impact_histograms(response: Response, figure: FigureBase | OffScreen | None = None) -> NDArray[np.object_]:
    """How often impacts of a size happen in the last third of a run: approach speed, impulse, energy loss.

    Both walls are stacked; the dashed line is the mean.

    Parameters
    ----------
    response : Response
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (3,) of Axes

    Raises
    ------
    InputError
        If it is no response.
    """
    impacts = response.impacts
    start, end = response.window
    inside = (impacts.time >= start) & (impacts.time < end)
    axes: NDArray[np.object_] = panels(figure, 10.0, 3.9, 1, 3, sharey=True)[0]
    columns = (
        ("approach speed", impacts.approach_speed, "m/s"),
        ("impulse", np.abs(impacts.impulse), "N s"),
        ("energy loss", impacts.energy_loss, "J"),
    )
    for axis, (name, column, unit) in zip(axes, columns, strict=True):
        values, unit = scaled(column[inside], unit)
        bins = np.linspace(min(values.min(initial=0.0), 0.0), values.max(initial=0.0) or 1.0, 31)
        walls = [values[impacts.side[inside] == side] for side, *_ in WALLS]
        axis.hist(walls, bins=bins, stacked=True, color=[w[1] for w in WALLS], label=[w[3] for w in WALLS])
        if values.size:
            axis.axvline(values.mean(), color=GREY, linestyle="--", linewidth=1.2)
            axis.set_title(f"mean {values.mean():.3g} {unit}", loc="left")
        axis.set_xlabel(f"{name} ({unit})")
    axes[0].set_ylabel("impacts")
    count = int(np.count_nonzero(inside))
    axes[0].figure.suptitle(
        f"{count} impacts from {start:.4g} to {end:.4g} s, {words_of(response.base)}",
        x=0.01, ha="left", fontsize=11.0,
    )  # fmt: skip
    # outside the axes: any bin may be the highest
    handles, labels = axes[0].get_legend_handles_labels()
    axes[0].figure.legend(handles, labels, loc="outside upper right", ncols=2, frameon=False, fontsize=LEGEND)
    return axes


@takes(response=instance(Response))
def impulse_phase(response: Response, ax: Axes | OffScreen | None = None) -> Axes:
    """Impulse of each impact over the base's phase, last third of the run, with the regime in the title.

    Of an excitation that has no phase it is over time.

    Parameters
    ----------
    response : Response
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If it is no response.
    """
    impacts = response.impacts
    start, end = response.window
    inside = (impacts.time >= start) & (impacts.time < end)
    impulse, unit = scaled(np.abs(impacts.impulse[inside]), "N s")
    phase, sides = np.degrees(impacts.phase[inside]), impacts.side[inside]
    has_phase = bool(np.all(np.isfinite(phase)))
    when = phase if has_phase else impacts.time[inside]
    axis = panel(ax, 8.0, 5.0)
    for side, colour, marker, label in WALLS:
        chosen = sides == side
        axis.plot(
            when[chosen], impulse[chosen], marker, color=colour, markersize=5.0, alpha=0.6, markeredgewidth=0.0,
            clip_on=False, label=f"{label}: {np.count_nonzero(chosen)} impacts",
        )  # fmt: skip
    if has_phase:
        axis.set_xlim(0.0, 360.0)
        axis.set_xticks(np.arange(0.0, 361.0, 45.0))
    else:
        axis.set_xlim(start, end)
    axis.set_ylim(0.0, 1.05 * (impulse.max(initial=0.0) or 1.0))
    axis.set_xlabel("phase of the base (degrees)" if has_phase else "time (s)")
    axis.set_ylabel(f"impulse ({unit})")
    label = response.regime.label.replace(": ", ":\n", 1)
    axis.set_title(f"{words_of(response.base)}, {start:.4g} to {end:.4g} s: {label}", loc="left")
    legend_above(axis)
    return axis
