"""Figures in phase space: the portrait of a motion with its Poincare section, and sections over the frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import instance, items, optional, quantity, require, suggestion, takes
from femimpact.export.figures.drawing import (
    BLUE,
    CYCLES,
    ORANGE,
    OffScreen,
    ball_of,
    beam_at,
    channel_name,
    last_cycles,
    legend_above,
    panel,
    place_of,
    require_history,
    scaled,
)
from femimpact.export.figures.phase_curve import POINTS, changes_of_contact, corners_of, phase_curve
from femimpact.response.channels import channel_key
from femimpact.response.response import Response

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["bifurcation", "phase_portrait"]


@takes(response=instance(Response), cycles=CYCLES, phase=optional(quantity("rad")))
def phase_portrait(
    response: Response,
    of: str | None = None,
    cycles: float = 40,
    phase: float | None = 0.0,
    ax: Axes | OffScreen | None = None,
) -> Axes:
    """Velocity over displacement in the last cycles, with the Poincare section once per cycle.

    A ball is drawn relative to its box, with the walls, and needs the channels of the ball, of its velocity, and of
    the beam with its velocity where the ball is. A place of the beam is drawn relative to the base.

    Parameters
    ----------
    response : Response
    of : str, optional
        A ball or a place; by default the first ball, or the first channel where there is none.
    cycles : float
        Base cycles that are drawn.
    phase : float, rad, optional
        Of the base at which the section is taken; see `Response.stroboscopic`. None draws no section,
        nor does a base without a phase, as a record.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If the run holds no history, a channel is missing, which is named, or an argument is out of range.
    """
    require_history(response)
    balls = [pair.name for pair in response.system.balls]
    chosen = None if of is None else channel_key(of, "of")
    if chosen in balls or (chosen is None and balls):
        pair = ball_of(response, chosen)
        beam_at(response, pair)
        names, place = (pair.name, f"{pair.name}.velocity"), place_of(response, pair)
        minus: tuple[str, ...] = (str(place), f"{place}.velocity")
    else:
        known = [*balls, *response.channels]
        require(chosen is None or chosen in known, "of", chosen, "", suggestion(str(chosen), known))
        pair, minus = None, ()
        name = channel_name(response, chosen)
        names = (name, f"{name}.velocity")
    for name in (*names, *minus):
        require(name in response.channels, "channels", list(response.channels), "", f"must hold {name!r}")
    start, shown = last_cycles(response, cycles)
    x, rate = _curve(response, start, names, minus, None if pair is None else pair.name)
    drawn = phase if np.isfinite(response.base.phase) else None
    axis = panel(ax, 6.4, 5.6)
    axis.plot(x, rate, color=BLUE, linewidth=0.7)
    if pair is None:
        _stops(axis, response, names[0])
    if drawn is not None:
        section = response.stroboscopic(drawn)
        once = section.time >= start
        points = [values[once] for values in _pair(section.channels, names, minus)]
        label = f"once per cycle, base at {math.degrees(section.phase):.4g} degrees"
        axis.plot(*points, "o", color=ORANGE, markersize=4.5, linestyle="none", label=label)
    if pair is None:
        title, to = f"{names[0]}, {shown}", "the base"
    else:
        _walls(axis, pair, x)
        title, to = f"{pair.name} in its box, {shown}; grey: inside the walls", "the box"
    axis.set_title(title, loc="left")
    legend_above(axis)
    axis.set_xlabel(f"{'ball' if pair else names[0]} relative to {to} (mm)")
    axis.set_ylabel(f"velocity relative to {to} (mm/s)")
    return axis


def _pair(
    channels: Any, names: tuple[str, ...], minus: tuple[str, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacement (mm) and velocity (mm/s), relative to the second pair of channels if there is one."""
    values = [channels[name] for name in names]
    if minus:
        values = [value - channels[name] for value, name in zip(values, minus, strict=True)]
    return 1e3 * values[0], 1e3 * values[1]


def _curve(
    response: Response, start: float, names: tuple[str, ...], minus: tuple[str, ...], ball: str | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The history from a time (s) on in mm and mm/s, drawn as often as a smooth curve takes."""
    x, rate = _pair(response.channels, names, minus)
    last = response.time >= start
    time = response.time[last]
    # of an impact after the table was full no instant is known
    known = response.impacts.dropped == 0 and time.size > 1
    if not known:
        return x[last], rate[last]
    corners = None
    if ball is not None:
        at, *others = corners_of(response, ball)
        place, before, after = (1e3 * values for values in others)
        corners = (at, place, before, after)
    samples = (time.size - 1) / ((time[-1] - time[0]) * response.base.frequency)
    points = max(math.ceil(POINTS / samples), 1)
    return phase_curve(time, x[last], rate[last], changes_of_contact(response), corners, points)[1:]


def _walls(axis: Any, pair: Any, x: NDArray[np.float64]) -> None:
    walls = (-1e3 * pair.gaps[1], 1e3 * pair.gaps[0])
    # as much of either wall, however the gaps and the depths differ
    low, high = min(walls[0], float(x.min())), max(walls[1], float(x.max()))
    low, high = low - 0.06 * (high - low), high + 0.06 * (high - low)
    for wall, outer in zip(walls, (low, high), strict=True):
        axis.axvspan(min(wall, outer), max(wall, outer), color="#dddddd", zorder=0)
        axis.axvline(wall, color="black", linewidth=1.4)
    axis.set_xlim(low, high)


def _stops(axis: Any, response: Response, place: str) -> None:
    """Stops that move with the base at a place."""
    for pair in response.system.contacts:
        if pair.is_stop and pair.fixed_to == "base" and place_of(response, pair) == place:
            for wall in (1e3 * pair.gaps[0], -1e3 * pair.gaps[1]):
                if math.isfinite(wall):
                    axis.axvline(wall, color="black", linewidth=1.4, label=pair.name)


@takes(responses=items(Response), phase=quantity("rad"))
def bifurcation(
    responses: Sequence[Response],
    channel: str | float | None = None,
    phase: float = 0.0,
    ax: Axes | OffScreen | None = None,
) -> Axes:
    """A channel once per base cycle over the base frequency, in the last third of each run.

    A motion of period k of the base leaves k points at its frequency, a chaotic one a cloud.

    Parameters
    ----------
    responses : sequence of Response
        One for each frequency.
    channel : str or float, optional
        The first one recorded by default.
    phase : float, rad
        Of the base; see `Response.stroboscopic`.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If there is no run, one holds no history of the channel, or an argument is of the wrong kind.
    """
    require(len(responses) > 0, "responses", "none", "", "must be one or more runs")
    for response in responses:
        require_history(response)
    name = channel_name(responses[0], channel)
    sections = [response.stroboscopic(phase) for response in responses]
    last = [s[name][s.time >= r.window[0]] for s, r in zip(sections, responses, strict=True)]
    frequency = np.repeat([r.base.frequency for r in responses], [values.size for values in last])
    values, unit = scaled(np.concatenate(last), responses[0].units[name])
    axis = panel(ax, 8.0, 5.0)
    axis.plot(frequency, values, ".", color=BLUE, markersize=2.5, markeredgewidth=0.0)
    axis.set_xlabel("base frequency (Hz)")
    axis.set_ylabel(f"{name.replace('_', ' ')} once per cycle ({unit})")
    axis.set_title(f"last third of each run, base at {math.degrees(phase):.4g} degrees", loc="left")
    return axis
