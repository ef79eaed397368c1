"""Figures of a periodic orbit and of a branch of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import instance, optional, require, suggestion, takes, text
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
    name_at,
    panel,
    panels,
    scaled,
)
from femimpact.export.figures.portraits import ContactRow, phase_portrait
from femimpact.orbits import Branch, PeriodicOrbit
from femimpact.orbits.period import period_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

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


@takes(orbit=instance(PeriodicOrbit), of=optional(text()))
def orbit(
    orbit: PeriodicOrbit, of: str | None = None, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """One period of an orbit: its phase portrait, its motion over time, and its multipliers beside the unit circle.

    The phase portrait is that of `phase_portrait`: a ball relative to its box, or the place of a stop. Over time walls
    and impacts are drawn as in `motion`. Half multipliers are those of a symmetric orbit.

    Parameters
    ----------
    orbit : PeriodicOrbit
    of : str, optional
        A ball, a stop, or a place; by default the first ball or stop with walls, or else the default place.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (1, 3) of Axes

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
    frequency, modes = f"{orbit.excitation.frequency:.6g} Hz", _count(system.dofs, "mode")
    over_time.set_title(f"{_count(orbit.cycles, 'cycle')} at {frequency}, {modes}", loc="left")
    legend_above(over_time)
    _multipliers(orbit, plane)
    return np.array([[portrait, over_time, plane]])


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


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
