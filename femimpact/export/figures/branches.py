"""The figure of branches of periodic orbits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import checked, column, items, require, takes, text
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
    prefixed,
)
from femimpact.orbits import Branch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKS = {
    "fold": ("s", ORANGE), "symmetry-breaking": ("D", GREEN), "period-doubling": ("^", PURPLE),
    "neimark-sacker": ("o", SKY), "branch-point": ("P", GREY), "grazing": ("X", DARK), "sticking": ("*", DARK),
}  # fmt: skip
"""Marker and colour of each kind of bifurcation."""

AXES = {"base.frequency": "frequency of the excitation", "base.amplitude": "amplitude of the excitation"}
"""Words for parameters of the excitation; the others are shown by their paths."""


SWEPT = "stepped sweep"
"""What the points of a sweep are called."""


@takes(title=text())
def branch(
    branch: Branch | Sequence[Branch], ax: Axes | OffScreen | None = None, *, title: str = "",
    swept: tuple[ArrayLike, ArrayLike] | None = None,
) -> Axes:  # fmt: skip
    """The largest displacement of the orbits of branches over their parameter: stable solid, unstable dashed.

    Bifurcations are marked by kind. Branches that are drawn one after the other on the same axes share one legend.

    Parameters
    ----------
    branch : Branch or sequence of Branch
        Of one parameter.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.
    title : str
    swept : pair of array_like (n,), optional
        Values of the parameter and largest displacements (m) of runs, drawn as dots.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If the branches are of several parameters, or there is none.
    """
    branches = checked("branch", [branch] if isinstance(branch, Branch) else branch, items(Branch))
    different = {each.parameter for each in branches}
    require(len(different) == 1, "branch", sorted(different) or "none", "", "must be one or more, of one parameter")
    pair = swept is None or (isinstance(swept, (tuple, list)) and len(swept) == 2)
    require(pair, "swept", swept, "", "must be values of the parameter and largest displacements")
    runs = [checked(f"swept[{i}]", one, column("", "n")) for i, one in enumerate(swept or ())]
    axis, first = panel(ax, 8.0, 5.0), branches[0]
    factor, unit = _prefix([each.values for each in branches], first.unit)
    of_peak, unit_of_peak = _prefix([*(each.peak for each in branches), *runs[1:]], "m")
    for each in branches:
        _draw(axis, each, factor, of_peak)
    if runs:
        require(runs[0].size == runs[1].size, "swept", runs[0].size, "", "must have a displacement for each value")
        rings: Any = {"color": DARK, "markersize": 5.0, "markerfacecolor": "none", "linestyle": "none", "zorder": 2.5}
        axis.plot(factor * runs[0], of_peak * runs[1], "o", label=SWEPT, **rings)
    name = AXES.get(first.parameter, first.parameter)
    of_place = f"largest displacement of {first.place} ({unit_of_peak})"
    label_axes(axis, f"{name} ({unit})" if unit != "1" else name, of_place, title)
    handles, labels = axis.get_legend_handles_labels()
    order = ["stable", "unstable", SWEPT, *map(kind_words, MARKS)]
    named = {label: handle for handle, label in zip(handles[::-1], labels[::-1], strict=True)}
    legend_above(axis, sorted(named.values(), key=lambda handle: order.index(str(handle.get_label()))))
    return axis


def _prefix(arrays: Sequence[Array], unit: str) -> tuple[float, str]:
    """Factor and unit with the prefix of the largest value of arrays."""
    return prefixed(float(np.nanmax(np.abs(np.concatenate(arrays)), initial=0.0)), unit)


def _draw(axis: Axes, branch: Branch, factor: float, of_peak: float) -> None:
    """Lines of a branch, and marks of its bifurcations."""
    values, peak = factor * branch.values, of_peak * branch.peak
    for part, is_stable in stretches(branch):
        style: dict[str, Any] = {"linestyle": "-", "linewidth": 2.2} if is_stable else {"linestyle": (0, (4, 2))}
        axis.plot(values[part], peak[part], color=BLUE, label="stable" if is_stable else "unstable", **style)
    for number, each in zip(branch.bifurcation_points.tolist(), branch.bifurcations, strict=True):
        marker, colour = MARKS[each.kind]
        axis.plot(
            values[number], peak[number], marker, color=colour, markersize=8.0, markeredgecolor="white",
            markeredgewidth=0.8, zorder=3, label=kind_words(each.kind),
        )  # fmt: skip


def kind_words(kind: str) -> str:
    """Words for a kind of bifurcation."""
    return "Neimark-Sacker" if kind == "neimark-sacker" else kind.replace("-", " ")


def stretches(branch: Branch) -> Iterator[tuple[slice, bool]]:
    """Points of a branch between changes of its stability, and whether the orbits there are stable."""
    stable = _stable_between(branch)
    begin = 0
    for end in np.append(np.flatnonzero(np.diff(stable)) + 1, stable.size).tolist():
        yield slice(begin, end + 1), bool(stable[begin])
        begin = end


def _stable_between(branch: Branch) -> NDArray[np.bool_]:
    """Whether the orbits between each two points are stable: at a bifurcation rounding decides."""
    stable, at = branch.is_stable, np.zeros(len(branch), dtype=bool)
    at[branch.bifurcation_points] = True
    return np.asarray(np.where(at[:-1], stable[1:], stable[:-1] & (stable[1:] | at[1:])))
