"""Figures of a periodic orbit and of branches of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import checked, column, instance, items, optional, require, suggestion, takes, text
from femimpact.figures.drawing import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    YELLOW,
    OffScreen,
    label_axes,
    legend_above,
    name_at,
    panel,
    panels,
)
from femimpact.figures.portraits import ContactRow, phase_portrait
from femimpact.figures.study_labels import path_words
from femimpact.orbits.branch import Branch
from femimpact.orbits.orbit import PeriodicOrbit, period_of
from femimpact.units import counted, prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

MARKS = {
    "fold": ("s", ORANGE), "symmetry-breaking": ("D", GREEN), "period-doubling": ("^", PURPLE),
    "neimark-sacker": ("o", SKY), "branch-point": ("P", GREY), "grazing": ("X", DARK), "sticking": ("*", YELLOW),
}  # fmt: skip
"""Marker and colour of each kind of bifurcation."""

AXES = {
    "base.frequency": "frequency of the excitation", "base.amplitude": "amplitude of the excitation",
    "damping.factor": "factor on all damping",
}  # fmt: skip
"""Words for parameters of the excitation and the damping; the others have those of a study."""


SWEPT = "stepped sweep"
"""What the points of a sweep are called."""


@takes(title=text())
def branch(
    branch: Branch | Sequence[Branch], ax: Axes | OffScreen | None = None, *, title: str = "",
    swept: tuple[ArrayLike, ArrayLike] | None = None,
) -> Axes:  # fmt: skip
    """The largest displacement of the orbits of branches over their parameter: stable solid, unstable dashed.

    Bifurcations are marked by kind.

    Parameters
    ----------
    branch : Branch or sequence of Branch
        Of one parameter, and of the displacement of one place.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.
    title : str
        Above the axes.
    swept : pair of array_like (n,), optional
        Values of the parameter and largest displacements (m) of runs, drawn as dots.

    Raises
    ------
    InputError
        If the branches are of several parameters or places, if there is none, or if axes that have branches already
        have another unit or quantity.
    """
    branches = checked("branch", [branch] if isinstance(branch, Branch) else branch, items(Branch))
    different = {f"{each.parameter}, of {each.place}" for each in branches}
    allowed = "must be one or more, of one parameter and one place"
    require(len(different) == 1, "branch", sorted(different) or "none", "", allowed)
    pair = swept is None or (isinstance(swept, (tuple, list)) and len(swept) == 2)
    require(pair, "swept", swept, "", "must be values of the parameter and largest displacements")
    runs = [checked(f"swept[{i}]", one, column("", "n")) for i, one in enumerate(swept or ())]
    require(not runs or runs[0].size == runs[1].size, "swept", runs, "", "must have a displacement for each value")
    axis, first = panel(ax, 8.0, 5.0), branches[0]
    factor, unit = prefix_of([each.values for each in branches], first.unit)
    of_peak, unit_of_peak = prefix_of([*(each.peak for each in branches), *runs[1:]], "m")
    place, _, read = first.place.rpartition(".")
    # of a place in metres the dot is that of the number
    of = f"{read.replace('_', ' ')} of {place}" if place and read[0].isalpha() else f"displacement of {first.place}"
    words = parameter_words(first.parameter, unit), f"largest {of} ({unit_of_peak})"
    for old, new in zip((axis.get_xlabel(), axis.get_ylabel()), words, strict=True):
        require(old in ("", new), "ax", old, "", f"must have no other axis than {new}: draw branches in one call")
    for each in branches:
        _draw(axis, each, factor, of_peak)
    if runs:
        rings: Any = {"color": DARK, "markersize": 5.0, "markerfacecolor": "none", "linestyle": "none", "zorder": 2.5}
        axis.plot(factor * runs[0], of_peak * runs[1], "o", label=SWEPT, **rings)
    label_axes(axis, *words, title)
    handles, labels = axis.get_legend_handles_labels()
    order = ["stable", "unstable", SWEPT, *map(kind_words, MARKS)]
    named = {label: handle for handle, label in zip(handles[::-1], labels[::-1], strict=True)}
    legend_above(axis, sorted(named.values(), key=lambda handle: order.index(str(handle.get_label()))))
    return axis


def parameter_words(parameter: str, unit: str) -> str:
    """Words for the axis of a parameter, in a unit."""
    name = AXES.get(parameter) or path_words(parameter)
    return name if unit == "1" else f"{name} ({unit})"


def prefix_of(arrays: Sequence[Array], unit: str) -> tuple[float, str]:
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
    stable = branch.is_stable if len(branch) == 1 else _stable_between(branch)
    begin = 0
    for end in np.append(np.flatnonzero(np.diff(stable)) + 1, stable.size).tolist():
        yield slice(begin, end + 1), bool(stable[begin])
        begin = end


def stable_ranges(branch: Branch) -> tuple[tuple[float, float], ...]:
    """Lowest and highest value of the parameter of each stretch of stable orbits, in their order."""
    parts = (branch.values[part] for part, is_stable in stretches(branch) if is_stable)
    return tuple(sorted({(float(part.min()), float(part.max())) for part in parts}))


def _stable_between(branch: Branch) -> NDArray[np.bool_]:
    """Whether the orbits between each two points are stable: at a bifurcation rounding decides."""
    stable, at = branch.is_stable, np.zeros(len(branch), dtype=bool)
    at[branch.bifurcation_points] = True
    return np.asarray(np.where(at[:-1], stable[1:], stable[:-1] & (stable[1:] | at[1:])))


@takes(orbit=instance(PeriodicOrbit), of=optional(text()))
def orbit(
    orbit: PeriodicOrbit, of: str | None = None, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """One period of an orbit: its phase portrait, its motion over time, and its multipliers beside the unit circle.

    The phase portrait is that of `phase_portrait`: a ball relative to its box, or the place of a stop. Over time walls
    and impacts are drawn as in `motion`. Half multipliers are those of a symmetric orbit.

    Parameters
    ----------
    of : str, optional
        A ball, a stop, or a place; by default the first ball or stop with walls, or else the default place.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Raises
    ------
    InputError
        If there is no such ball, stop or place, which is named.
    """
    system = orbit.system
    pairs = {pair.name: pair for pair in system.contacts}
    first = next((pair.name for pair in system.contacts if pair.has_walls), system.default_place)
    of = first if of is None else of
    require(of in pairs or of in system.points, "of", of, "", suggestion(of, [*pairs, *system.points]))
    pair = pairs.get(of)
    place = of if pair is None else name_at(system, pair) or str(float(pair.position))
    shown = place if pair is None or pair.is_stop else of
    names = dict.fromkeys((place, shown))
    response = period_of(orbit, (*names, *(f"{name}.velocity" for name in names)))
    portrait, over_time, plane = panels(figure, 15.0, 4.8, 1, 3, width_ratios=(1.1, 1.3, 1.0))[0]
    phase_portrait(response, shown, cycles=orbit.cycles, ax=portrait)
    portrait.set_title("phase portrait" + ("; grey: inside the walls" if shown != place else ""), loc="left")
    legend_above(portrait)
    row = ContactRow(response, pair)
    row.draw(over_time, response.time >= 0.0, close=True)
    over_time.set(xlabel="time (s)", ylabel=f"relative to the base ({row.unit})")
    frequency, modes = f"{orbit.excitation.frequency:.6g} Hz", counted(system.dofs, "mode")
    over_time.set_title(f"{counted(orbit.cycles, 'cycle')} at {frequency}, {modes}", loc="left")
    legend_above(over_time)
    _multipliers(orbit, plane)
    return np.array([[portrait, over_time, plane]])


def _multipliers(orbit: PeriodicOrbit, axis: Any) -> None:
    """The multipliers in the complex plane, and the half multipliers of a symmetric orbit."""
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axis.plot(np.cos(turn), np.sin(turn), color=GREY, linewidth=1.0)
    for values, marker, colour, label in (
        (orbit.multipliers, "o", BLUE, "multipliers"), (orbit.half_multipliers, "s", ORANGE, "half multipliers"),
    ):  # fmt: skip
        style: Any = {"color": colour, "markerfacecolor": colour if marker == "o" else "none", "markeredgewidth": 1.6}
        if values.size:
            axis.plot(values.real, values.imag, marker, label=label, **style)
    axis.margins(0.1)
    axis.set_aspect("equal", adjustable="datalim")
    kind = f"{'symmetric, ' if orbit.is_symmetric else ''}{'stable' if orbit.is_stable else 'unstable'}"
    label_axes(axis, "real part", "imaginary part", f"{kind}; grey: unit circle")
    legend_above(axis)
