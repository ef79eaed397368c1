"""Figures of contacts: impacts of a run, contact laws and one collision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.contact.collision import EFFECTIVE_MASS
from femimpact.contact.law import ContactLaw, a_law, collide, contact_force, resolve
from femimpact.errors import instance, quantity, require, takes, text
from femimpact.excitation.drives import Rest
from femimpact.excitation.excitation import words_of
from femimpact.figures.drawing import (
    COLOURS,
    GREY,
    LEGEND,
    OffScreen,
    break_lines,
    label_axes,
    legend_above,
    panel,
    panels,
    rows_of,
    scaled,
    walls_of,
)
from femimpact.response.response import Response
from femimpact.units import number_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase


def _shown_time(response: Response) -> tuple[float, float]:
    """Begin and end (s) of the impacts that are shown: the last third of a run, and all where none is in that."""
    begin, end = response.window
    inside = (response.impacts.time >= begin) & (response.impacts.time < end)
    whole = isinstance(response.base, Rest) or not inside.any()
    return (response.start if whole else begin), end


@takes(response=instance(Response))
def impact_histograms(response: Response, figure: FigureBase | OffScreen | None = None) -> NDArray[np.object_]:
    """Histograms of the impacts in the last third of a run: approach speed, impulse, energy loss.

    They are those of the whole run of a free decay, and where no impact lies in the last third. Both walls are
    stacked; the dashed line is the mean.

    Parameters
    ----------
    response : Response
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (3,) of Axes
    """
    impacts = response.impacts
    start, end = _shown_time(response)
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
        walls = walls_of(response)
        at_walls = [values[impacts.side[inside] == side] for side, *_ in walls]
        axis.hist(at_walls, bins=bins, stacked=True, color=[w[1] for w in walls], label=[w[3] for w in walls])
        if values.size:
            axis.axvline(values.mean(), color=GREY, linestyle="--", linewidth=1.2)
            axis.set_title(f"mean {number_text(values.mean(), 3)} {unit}", loc="left")
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

    Of an excitation that has no phase it is over time. The whole run is shown of a free decay, and where no impact lies
    in the last third.

    Parameters
    ----------
    response : Response
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.
    """
    impacts = response.impacts
    start, end = _shown_time(response)
    inside = (impacts.time >= start) & (impacts.time < end)
    impulse, unit = scaled(np.abs(impacts.impulse[inside]), "N s")
    phase, sides = np.degrees(impacts.phase[inside]), impacts.side[inside]
    has_phase = bool(np.all(np.isfinite(phase)))
    when = phase if has_phase else impacts.time[inside]
    axis = panel(ax, 8.0, 5.0)
    for side, colour, marker, label in walls_of(response):
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
    regime = response.regime.label.replace(": ", ":\n", 1)
    title = f"{words_of(response.base)}, {start:.4g} to {end:.4g} s: {regime}"
    label_axes(axis, "phase of the base (degrees)" if has_phase else "time (s)", f"impulse ({unit})", title)
    legend_above(axis)
    return axis


POINTS = 400
"""Instants of one collision that are drawn."""


def collision_history(law: ContactLaw, effective_mass: float, approach_speed: float) -> tuple[Array, Array, Array]:
    """Depth (m), rate (m/s) and force (N) of one collision (kg, m/s), integrated from touch to zero force."""
    from scipy.integrate import solve_ivp

    collision = collide(law, effective_mass, approach_speed)
    m, v = effective_mass, approach_speed

    def rates(_: float, y: Any) -> list[float]:
        return [y[1], -contact_force(law, y[0], y[1], v, m) / m]

    # from just inside the wall: on it, a dashpot's force would be zero
    inside = 1e-9 * collision.largest_penetration
    run: Any = solve_ivp(
        rates, (0.0, collision.contact_time), [inside, v], method="LSODA", rtol=1e-9,
        atol=[1e-11 * collision.largest_penetration, 1e-11 * v],
        t_eval=np.linspace(0.0, collision.contact_time, POINTS),
    )  # fmt: skip
    depth, rate = run.y
    force = [contact_force(law, p, r, v, m) for p, r in zip(depth, rate, strict=True)]
    return depth, rate, np.array(force)


@takes(speeds=quantity("m/s", above=0.0, several=True))
def contact_laws(
    contacts: Sequence[tuple[str, ContactLaw, float]],
    speeds: Sequence[float] = (0.05, 0.1, 0.2),
    figure: FigureBase | OffScreen | None = None,
) -> NDArray[np.object_]:
    """Force over penetration of every contact: one loop for each approach speed, whose area is the energy lost.

    Parameters
    ----------
    contacts : sequence of (name, ContactLaw, effective mass in kg)
    speeds : sequence of float, m/s
        Of approach, ascending; by default of the size of those of a ball of some grams on a shaken beam.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (contacts,) of Axes

    Raises
    ------
    InputError
        If there is no contact or no speed.
    """
    named = rows_of("contacts", contacts, name=text(), law=a_law(), effective_mass=EFFECTIVE_MASS)
    require(len(named) > 0, "contacts", "none", "", "must be one or more of (name, law, effective_mass)")
    columns = min(len(named), 2)
    rows = -(-len(named) // columns)
    axes = panels(figure, 7.2 if columns == 1 else 11.0, 4.4 * rows + 0.3, rows, columns).ravel()
    caption = "one collision; solid: loading, dashed: unloading, area between them: energy lost"
    whole = axes[0].figure
    break_lines(whole.suptitle(caption, fontsize=11.0, color=GREY), 0.95 * whole.bbox.width)
    for axis, (name, law, mass) in zip(axes, named, strict=False):
        _loops(axis, name, law, mass, np.atleast_1d(speeds).tolist())
    for axis in axes[len(named) :]:
        axis.remove()
    return axes[: len(named)]


def _loops(axis: Any, name: str, law: ContactLaw, mass: float, speeds: Sequence[float]) -> None:
    title = f"{name}: {law.name}, effective mass {1e3 * mass:.4g} g"
    label_axes(axis, "penetration (micrometres)", "contact force (N)", title)
    if resolve(law, mass).is_rigid:
        axis.set_xticks([])
        axis.set_yticks([])
        axis.annotate("an impulse only: no force, no penetration", (0.5, 0.5), xycoords="axes fraction",
                      ha="center", color=GREY, fontsize=LEGEND)  # fmt: skip
        return
    loops = [collision_history(law, mass, speed) for speed in speeds]
    axis.set_xlim(0.0, 1.16e6 * max(depth.max() for depth, _, _ in loops))
    axis.set_ylim(0.0, 1.14 * max(force.max() for _, _, force in loops))
    # the slow loops on top: elastic ones lie on one another
    for colour, speed, (depth, _, force) in reversed(list(zip(COLOURS, speeds, loops, strict=False))):
        _loop(axis, 1e6 * depth, force, colour, f"{number_text(speed, 3)} m/s")


def _loop(axis: Any, depth: Array, force: Array, colour: str, label: str) -> None:
    from matplotlib.patheffects import withStroke

    turn, crest = int(np.argmax(depth)), int(np.argmax(force))
    # off the wall without force: the loop closes along the axes
    axis.fill(np.append(depth, 0.0), np.append(force, 0.0), color=colour, alpha=0.08, linewidth=0.0)
    # both branches share the deepest point, or a hole would be left there
    axis.plot(depth[: turn + 1], force[: turn + 1], color=colour)
    axis.plot(depth[turn:], force[turn:], color=colour, linestyle="--")
    axis.plot(depth[turn], force[turn], "o", color=colour, markersize=4.0)
    # beside an elastic line, on top of a loop
    elastic = depth[crest] > 0.995 * depth[turn]
    place: Any = {"xytext": (7, -3), "ha": "left", "va": "top"} if elastic else {"xytext": (0, 5), "ha": "center"}
    axis.annotate(label, (depth[crest], force[crest]), textcoords="offset points", color=colour, fontsize=LEGEND,
                  path_effects=[withStroke(linewidth=3.0, foreground="white")], **place)  # fmt: skip
