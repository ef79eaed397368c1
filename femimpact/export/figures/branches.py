"""The figure of a branch of periodic orbits."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import instance, takes
from femimpact.export.figures.drawing import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    OffScreen,
    label_axes,
    legend_above,
    panel,
    scaled,
)
from femimpact.orbits import Branch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKS = {
    "fold": ("s", ORANGE), "symmetry-breaking": ("D", GREEN), "period-doubling": ("^", PURPLE),
    "neimark-sacker": ("o", SKY), "branch-point": ("P", GREY), "grazing": ("X", DARK), "sticking": ("*", DARK),
}  # fmt: skip
"""Marker and colour of each kind of bifurcation."""

AXES = {
    "base.frequency": "frequency of the excitation", "base.amplitude": "amplitude of the excitation",
    "damping.factor": "factor on all damping",
}  # fmt: skip
"""Words for parameters of the excitation and the damping; the others are shown by their paths."""


@takes(branch=instance(Branch))
def branch(branch: Branch, ax: Axes | OffScreen | None = None) -> Axes:
    """The largest displacement of the orbits of a branch over its parameter: stable solid, unstable dashed.

    Bifurcations are marked by kind. Several branches on the same axes share one legend.

    Parameters
    ----------
    branch : Branch
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes
    """
    axis = panel(ax, 8.0, 5.0)
    values, unit = scaled(branch.values, branch.unit)
    peak, of_peak = scaled(branch.peak, "m")
    stable = _stable_between(branch)
    ends = np.append(np.flatnonzero(np.diff(stable)) + 1, stable.size)
    begin = 0
    for end in ends.tolist():
        part, is_stable = slice(begin, end + 1), bool(stable[begin])
        style: dict[str, Any] = {"linestyle": "-", "linewidth": 2.2} if is_stable else {"linestyle": (0, (4, 2))}
        axis.plot(values[part], peak[part], color=BLUE, label="stable" if is_stable else "unstable", **style)
        begin = end
    numbers = branch.bifurcation_points
    for number, each in zip(numbers.tolist(), branch.bifurcations, strict=True):
        marker, colour = MARKS[each.kind]
        axis.plot(
            values[number], peak[number], marker, color=colour, markersize=8.0, markeredgecolor="white",
            markeredgewidth=0.8, zorder=3, label=_words(each.kind),
        )  # fmt: skip
    name = AXES.get(branch.parameter, branch.parameter)
    label_axes(axis, f"{name} ({unit})" if unit != "1" else name, f"largest displacement of {branch.place} ({of_peak})")
    handles, labels = axis.get_legend_handles_labels()
    order = ["stable", "unstable", *map(_words, MARKS)]
    first = {label: handle for handle, label in zip(handles[::-1], labels[::-1], strict=True)}
    legend_above(axis, sorted(first.values(), key=lambda handle: order.index(str(handle.get_label()))))
    return axis


def _words(kind: str) -> str:
    return "Neimark-Sacker" if kind == "neimark-sacker" else kind.replace("-", " ")


def _stable_between(branch: Branch) -> NDArray[np.bool_]:
    """Whether the orbits between each two points are stable: at a bifurcation rounding decides."""
    stable, at = branch.is_stable, np.zeros(len(branch), dtype=bool)
    at[branch.bifurcation_points] = True
    return np.asarray(np.where(at[:-1], stable[1:], stable[:-1] & (stable[1:] | at[1:])))
