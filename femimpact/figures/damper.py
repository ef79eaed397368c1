"""Figure of the curve of a damper: loss, effective mass, and the starts that find it, over the amplitude."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import having, takes, text
from femimpact.figures.drawing import COLOURS, DARK, OffScreen, label_axes, legend_above, panels, plain_log_ticks

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import FigureBase


@takes(curve=having("a dataset of design.damper_curve", ("data_vars", "coords")), title=text())
def damper_curve(
    curve: xarray.Dataset, title: str = "", *, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """Loss per cycle and effective mass of a ball in a box over A/d, a colour for each restitution.

    The motion in closed form is a line where it is stable, and dashed where it is not. A circle is a motion that runs
    found, the larger the more of the starts found it. A star, and a line down to the share of the starts, are where
    from on all starts find one impact on each wall in every cycle.

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
        Loss, effective mass and, of a curve with starts, their share.
    """
    has_runs = "found" in curve
    axes = panels(figure, 8.0, 3.0 + 3.0 * (2 + has_runs), 2 + has_runs, 1, sharex=True)[:, 0]
    level = curve["amplitude_over_gap"].to_numpy()
    for colour, e in zip(cycle(COLOURS), curve["restitution"].to_numpy(), strict=False):
        own, label = curve.sel(restitution=e), f"e = {e:g}"
        for axis, name in zip(axes, ("loss", "effective_mass"), strict=False):
            if name in own:
                stable = own["stable"].to_numpy()
                for mask, line in ((stable, "-"), (~stable, "--")):
                    # an end of a part reaches to the next level
                    near = mask | (np.append(mask[1:], False) if line == "--" else False)
                    values = np.where(near, own[name], np.nan)
                    axis.plot(level, values, line, color=colour, label=label if line == "-" else None)
            if has_runs:
                share = own["motion_share"].to_numpy()
                x = np.broadcast_to(level[:, None], share.shape)
                axis.scatter(
                    x, own[f"motion_{name}"], 60.0 * np.nan_to_num(share), facecolors="none", edgecolors=colour
                )
        if has_runs:
            axes[2].plot(level, 100.0 * own["found"], "o-", color=colour, markersize=4.0, label=label)
            _mark(axes, own, level, colour)
    axes[0].set(xscale="log", yscale="log")
    labels = ("loss per cycle / (m ω² A²)", "effective mass / m", "starts that find one\nimpact on each wall (%)")
    for axis, words in zip(axes, labels, strict=False):
        label_axes(axis, "", words)
    label_axes(axes[0], "", labels[0], title)
    axes[-1].set_xlabel("amplitude of the box over the gap, A/d")
    plain_log_ticks(axes[0].xaxis)
    plain_log_ticks(axes[0].yaxis)
    legend_above(axes[0])
    return np.asarray(axes)


def _mark(axes: Any, own: xarray.Dataset, level: Any, colour: str) -> None:
    """Mark from where on all starts find the motion."""
    at = float(own["sure_from"])
    if not np.isfinite(at):
        return
    point = own.sel(amplitude_over_gap=at)
    for axis, name in zip(axes, ("motion_loss", "motion_effective_mass"), strict=False):
        axis.plot(at, float(point[name][0]), "*", color=colour, markersize=15.0, markeredgecolor=DARK, zorder=4.0)
    axes[2].axvline(at, color=colour, linewidth=1.0, linestyle=":")
