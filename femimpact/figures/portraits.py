"""Figures of motion: deflection over time, phase portraits, bifurcation diagrams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import checked, column, instance, items, optional, quantity, require, suggestion, takes
from femimpact.excitation.excitation import LineLoad, is_force
from femimpact.figures.drawing import (
    BLUE,
    CYCLES,
    ORANGE,
    OffScreen,
    ball_of,
    beam_at,
    channel_name,
    label_axes,
    last_cycles,
    legend_above,
    name_at,
    panel,
    panels,
    place_of,
    require_history,
    scaled,
)
from femimpact.response.channels import channel_key
from femimpact.response.response import Response
from femimpact.units import name_words, prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

Corners = tuple[Array, Array, Array, Array]

SHORT = 0.25
"""Share of the usual interval between two samples below which one beside a corner is drawn straight."""
POINTS = 1024
"""Points of a curve in a base cycle, at least: some 2 pixels apart in a picture of 1000 pixels."""


def corners_of(
    response: Response,
    pair: str,  # name of the ball or the stop
) -> Corners:
    """Instants (s) at which a ball or the beam touches a wall; its place there (m), its rate (m/s) before and after.

    The table of impacts holds both speeds. After the touch of a compliant contact the rate is as before it; how deep
    the ball is when that contact ends is not in the table.

    Returns (n,): in the order of time.
    """
    impacts = response.impacts
    (contact,) = [contact_of_system for contact_of_system in response.system.contacts if contact_of_system.name == pair]
    of_pair = np.flatnonzero(impacts.impactor == pair)
    of_pair = of_pair[np.argsort(impacts.time[of_pair], kind="stable")]
    side = impacts.side[of_pair].astype(float)
    wall = np.where(side > 0, contact.gaps[0], contact.gaps[1])
    approach, rebound = impacts.approach_speed[of_pair], impacts.rebound_speed[of_pair]
    after = np.where(impacts.duration[of_pair] > 0.0, approach, -rebound)
    return impacts.time[of_pair], side * wall, side * approach, side * after


def changes_of_contact(response: Response) -> Array:
    """Instants (s) at which a contact begins or ends, ascending; there a rate or its slope may jump."""
    impacts, sticking = response.impacts, response.sticking
    times = np.concatenate([impacts.time, impacts.time + impacts.duration, sticking.start, sticking.end])
    return np.sort(times[np.isfinite(times)])


def phase_curve(
    time: Array,  # (n,) s: ascending
    value: Array,  # (n,)
    rate: Array,  # (n,) 1/s
    changes: Array,  # (k,) s: as of `changes_of_contact`
    corners: Corners | None = None,  # (m,) as of `corners_of`, in units of the value
    points: int = 1,  # points in each interval
) -> tuple[Array, Array, Array]:
    """Points of the curve through samples of a value and its rate.

    Between two samples it is the cubic that has the value and the rate of both, and its derivative. Where a contact
    begins or ends between them it is a straight line, unless that is one of the corners.

    `time` (p,) s
    `value` (p,)
    `rate` (p,) 1/s
    """
    if corners is not None:
        time, value, rate, changes = _with_corners(time, value, rate, changes, corners)
    step = np.diff(time)
    smooth = np.searchsorted(changes, time[1:], side="left") == np.searchsorted(changes, time[:-1], side="right")
    share = np.arange(points) / points
    # rows are intervals, columns the points in them
    s, h = share[None, :], step[:, None]
    times = time[:-1, None] + s * h
    x0, x1, v0, v1 = value[:-1, None], value[1:, None], rate[:-1, None], rate[1:, None]
    mean = np.divide(x1 - x0, h, out=np.zeros_like(h), where=h > 0.0)
    # in a short interval it is nearly straight, and the cubic's rate would magnify an error of its two places
    smooth &= step > SHORT * np.median(step)
    cubic = x0 + s * (h * v0 + s * (h * (3.0 * mean - 2.0 * v0 - v1) + s * h * (v0 + v1 - 2.0 * mean)))
    slope = v0 + s * (2.0 * (3.0 * mean - 2.0 * v0 - v1) + 3.0 * s * (v0 + v1 - 2.0 * mean))
    drawn = np.where(smooth[:, None], cubic, x0 + s * (x1 - x0))
    drawn_rate = np.where(smooth[:, None], slope, v0 + s * (v1 - v0))
    return np.append(times, time[-1]), np.append(drawn, value[-1]), np.append(drawn_rate, rate[-1])


def _with_corners(
    time: Array, value: Array, rate: Array, changes: Array, corners: Corners
) -> tuple[Array, Array, Array, Array]:
    """Samples, with each corner twice: before and after; and the changes that no corner is."""
    at, place, before, after = corners
    inside = (at >= time[0]) & (at <= time[-1])
    at, place, before, after = at[inside], place[inside], before[inside], after[inside]
    # a sample at the instant of an impact is on one side of it only
    between = ~np.isin(time, at)
    times = np.concatenate([time[between], np.repeat(at, 2)])
    values = np.concatenate([value[between], np.repeat(place, 2)])
    rates = np.concatenate([rate[between], np.stack([before, after], axis=1).ravel()])
    order = np.argsort(times, kind="stable")
    return times[order], values[order], rates[order], changes[~np.isin(changes, at)]


BEAM, FREE, WALL = "#555b63", "#e6eaee", "#9aa5b1"

LONG, PARTS = 100, 200
"""Oscillations beyond which a run is drawn as an envelope, and in how many parts of equal time at most."""


@takes(response=instance(Response), cycles=CYCLES)
def motion(
    response: Response, cycles: float = 4.0, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """Beam and balls over time: a row for every ball and stop, the run beside its last cycles.

    A run of more than 100 oscillations is drawn as the envelope of each curve, from its smallest to its largest
    value in each of 200 parts, or of fewer with two oscillations in each.

    The shaded band is where the ball may move: the beam where the ball is, with the gap to either wall. Of a stop it is
    where the beam may move. Dots in the close-up are impacts.

    Parameters
    ----------
    response : Response
        With every ball among its channels, and the beam where each ball or stop is (or the gap there).
    cycles : float
        Base cycles of the close-up.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (contacts, 2) of Axes
        One row, of the first channel, without contacts.

    Raises
    ------
    InputError
        If the run holds no history, or a channel is missing, which is named.
    """
    require_history(response)
    pairs: list[Any] = [pair for pair in response.system.contacts if not pair.between] or [None]
    # before a figure is made: a channel may be missing
    rows = [ContactRow(response, pair) for pair in pairs]
    axes = panels(figure, 11.0, 2.5 * len(rows) + 0.8, len(rows), 2, sharex="col", width_ratios=(1.0, 1.3))
    start, words = last_cycles(response, cycles)
    for i, (row, pair_of_axes) in enumerate(zip(rows, axes, strict=True)):
        for axis, inside, close in zip(
            pair_of_axes, (response.time >= -1.0, response.time >= start), (False, True), strict=True
        ):
            row.draw(axis, inside, close)
        if row.oscillations <= LONG:
            # an envelope has its legend there
            pair_of_axes[0].set_title(row.title, loc="left")
        pair_of_axes[0].set_ylabel(f"relative to the base ({row.unit})")
        legend_above(pair_of_axes[1])
        if i == len(rows) - 1:
            pair_of_axes[0].set_xlabel("time (s)")
            pair_of_axes[1].set_xlabel(f"time (s), {words}")
    return axes


class ContactRow:
    """Curves of one contact in a unit that reads well: the beam, the ball where there is one, and the walls."""

    def __init__(self, response: Response, pair: Any) -> None:
        self.response, self.pair = response, pair
        first = next(iter(response.channels))
        self.place = first if pair is None else place_of(response, pair) or f"beam at {pair.name}"
        self.beam = response[first] if pair is None else beam_at(response, pair)
        moving = pair is not None and not pair.is_stop
        self.ball = response[pair.name] if moving else None
        above = self.beam > self.beam.mean()
        self.oscillations = int(np.count_nonzero(np.diff(above))) // 2
        largest = float(np.abs(self.beam if self.ball is None else self.ball).max())
        self.factor, self.unit = prefixed(largest, response.units[first] if pair is None else "m")
        self.title = self.place if pair is None else f"{pair.name}, {self.place}" if moving else f"stop {pair.name}"

    def draw(self, axis: Any, inside: NDArray[np.bool_], close: bool) -> None:
        """Draw the samples inside; of a long run its envelope, unless they are a close-up, which has the impacts."""
        time, factor = self.response.time[inside], self.factor
        width = 1.6 if close else 0.8
        if not close and self.oscillations > LONG:
            self._envelopes(axis)
            return
        if self.pair is not None:
            self._walls(axis, inside)
        axis.plot(time, factor * self.beam[inside], color=BEAM, linewidth=width, zorder=3.0, label=self.place)
        if self.ball is not None:
            axis.plot(time, factor * self.ball[inside], color=BLUE, linewidth=width, label=self.pair.name)
        if close and self.pair is not None:
            self._impacts(axis, float(time[0]))
        axis.set_xlim(time[0], max(time[-1], time[0] + 1e-9))

    def _envelopes(self, axis: Any) -> None:
        """The ball's envelope behind that of the beam."""
        time = self.response.time
        parts = min(PARTS, self.oscillations // 2)
        starts = np.linspace(0, time.size, parts + 1).astype(int)[:-1]
        curves = [(self.beam, BEAM, self.place)] if self.ball is None else [
            (self.ball, BLUE, self.pair.name), (self.beam, BEAM, self.place)
        ]  # fmt: skip
        for values, color, name in curves:
            low, high = (self.factor * edge.reduceat(values, starts) for edge in (np.minimum, np.maximum))
            axis.fill_between(time[starts], low, high, color=color, linewidth=0.6, label=f"envelope of {name}")
        axis.set_xlim(time[0], time[-1])
        legend_above(axis)

    def _walls(self, axis: Any, inside: NDArray[np.bool_]) -> None:
        """Walls of a box move with the beam, stops stand still relative to the base or in space."""
        time, (plus, minus) = self.response.time[inside], self.pair.gaps
        middle = self.beam[inside] if self.ball is not None else np.zeros(time.size)
        if self.ball is None and getattr(self.pair, "fixed_to", "base") == "space":
            middle = -self.response.base.displacement(time)
        edges = [self.factor * (middle + gap) for gap in (plus, -minus)]
        both = all(map(math.isfinite, (plus, minus)))
        if both:
            axis.fill_between(time, *edges, color=FREE, linewidth=0.0, label="between the walls")
        for edge, gap in zip(edges, (plus, minus), strict=True):
            if math.isfinite(gap):
                label = None if both else self.pair.name if self.ball is None else "wall"
                axis.plot(time, edge, color=WALL, linewidth=0.8 if both else 2.0, label=label)

    def _impacts(self, axis: Any, start: float) -> None:
        impacts, time = self.response.impacts, self.response.time
        names = [one.name for one in self.response.system.contacts if self.pair.name in (one.name, *one.between)]
        at = impacts.time[np.isin(impacts.impactor, names) & (impacts.time >= start) & (impacts.time <= time[-1])]
        curve = self.beam if self.ball is None else self.ball
        axis.plot(at, self.factor * np.interp(at, time, curve), "o", color=ORANGE, markersize=5.0, label="impact")


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

    Raises
    ------
    InputError
        If the run holds no history, or a channel is missing, which is named.
    """
    require_history(response)
    pair, names, minus = _drawn_channels(response, None if of is None else channel_key(of, "of"))
    start, window = last_cycles(response, cycles)
    stops = [] if pair is not None else _stops_at(response, names[0])
    met = pair or next(iter(stops), None)
    x, rate = _curve(response, start, names, minus, None if met is None else met.name)
    drawn = phase if np.isfinite(response.base.phase) else None
    axis = panel(ax, 6.4, 5.6)
    axis.plot(x, rate, color=BLUE, linewidth=0.7)
    for stop in stops:
        walls = [wall for wall in (1e3 * stop.gaps[0], -1e3 * stop.gaps[1]) if math.isfinite(wall)]
        for number, wall in enumerate(walls):
            axis.axvline(wall, color="black", linewidth=1.4, label=None if number else stop.name)
    if drawn is not None:
        section = response.stroboscopic(drawn)
        once = section.time >= start
        points = [values[once] for values in _pair(section.channels, names, minus)]
        label = f"once per cycle, base at {math.degrees(section.phase):.4g} degrees"
        axis.plot(*points, "o", color=ORANGE, markersize=4.5, linestyle="none", label=label)
    if pair is None:
        title, to = f"{names[0]}, {window}", "the base"
    elif pair.kind == "impactor":
        _walls(axis, pair, x)
        title, to = f"{pair.name} in its box, {window}; grey: inside the walls", "the box"
    else:
        title, to = f"{pair.name}, {window}", "the beam"
    moving = "ball" if pair is not None and pair.kind == "impactor" else names[0]
    label_axes(axis, f"{moving} relative to {to} (mm)", f"velocity relative to {to} (mm/s)", title)
    legend_above(axis)
    return axis


def _drawn_channels(response: Response, chosen: str | None) -> tuple[Any, tuple[str, ...], tuple[str, ...]]:
    """A ball or None, its channels or those of a place, and the channels of the beam that are taken off a ball's."""
    balls = [pair.name for pair in response.system.balls]
    pair, minus = None, tuple[str, ...]()
    if chosen in balls or (chosen is None and balls):
        pair = ball_of(response, chosen)
        place = place_of(response, pair) or name_at(response.system, pair) or f"{pair.position:g}"
        name, minus = pair.name, _with_velocity(place)
    else:
        known = [*balls, *response.channels]
        require(chosen is None or chosen in known, "of", chosen, "", suggestion(str(chosen), known))
        name = channel_name(response, chosen)
    names = _with_velocity(name)
    # only a displacement has a velocity that can be recorded
    moves = response.units.get(name, "m") == "m"
    recorder = f": run with record=fi.Recorder(channels={(*minus, *names)})" if moves else ""
    for needed in (*names, *minus):
        require(needed in response.channels, "channels", list(response.channels), "", f"must hold {needed!r}{recorder}")
    return pair, names, minus


def _with_velocity(name: str) -> tuple[str, ...]:
    """Names of the channels of a displacement and of its velocity."""
    return name, f"{name}.velocity"


def _pair(
    channels: Any, names: tuple[str, ...], minus: tuple[str, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacement (mm) and velocity (mm/s), relative to the second pair of channels if there is one."""
    values = [channels[name] for name in names]
    if minus:
        values = [value - channels[name] for value, name in zip(values, minus, strict=True)]
    return 1e3 * values[0], 1e3 * values[1]


def _curve(
    response: Response, start: float, names: tuple[str, ...], minus: tuple[str, ...], met: str | None
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
    if met is not None:
        at, *others = corners_of(response, met)
        place, before, after = (1e3 * values for values in others)
        corners = (at, place, before, after)
    samples = (time.size - 1) / ((time[-1] - time[0]) * response.base.frequency)
    points = max(math.ceil(POINTS / samples), 1)
    return phase_curve(time, x[last], rate[last], changes_of_contact(response), corners, points)[1:]


def _walls(axis: Any, pair: Any, x: NDArray[np.float64]) -> None:
    walls = (-1e3 * pair.gaps[1], 1e3 * pair.gaps[0])
    # as much of either wall, however the gaps and the depths differ
    reached = [wall for wall in (*walls, float(x.min()), float(x.max())) if math.isfinite(wall)]
    low, high = min(reached), max(reached)
    low, high = low - 0.06 * (high - low), high + 0.06 * (high - low)
    for wall, outer in zip(walls, (low, high), strict=True):
        if math.isinf(wall):
            continue
        axis.axvspan(min(wall, outer), max(wall, outer), color="#dddddd", zorder=0)
        axis.axvline(wall, color="black", linewidth=1.4)
    axis.set_xlim(low, high)


def _stops_at(response: Response, place: str) -> list[Any]:
    """Stops that move with the base at a place."""
    stops = [pair for pair in response.system.contacts if pair.kind == "stop" and pair.fixed_to == "base"]
    return [pair for pair in stops if place_of(response, pair) == place]


@takes(responses=items(Response), phase=quantity("rad"))
def bifurcation(
    responses: Sequence[Response],
    channel: str | float | None = None,
    phase: float = 0.0,
    ax: Axes | OffScreen | None = None,
    *,
    over: tuple[str, ArrayLike] | None = None,
) -> Axes:
    """A channel once per base cycle over a number that differs between runs, in the last third of each run.

    A motion of period k of the base leaves k points at its number, a chaotic one a cloud.

    Parameters
    ----------
    responses : sequence of Response
        One for each value of the number.
    channel : str or float, optional
        The first one recorded by default.
    phase : float, rad
        Of the base; see `Response.stroboscopic`.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.
    over : pair of str and array_like (n,), optional
        Words of the axis and the value of each run, as ("damping ratio (%)", [0.1, 0.2]). By default the first number
        that differs of the drive's frequency and amplitude and of each ball's or stop's gap, restitution and mass.

    Raises
    ------
    InputError
        If there is no run, if one holds no history of the channel, or if none of these numbers differs.
    """
    require(len(responses) > 0, "responses", "none", "", "must be one or more runs")
    for response in responses:
        require_history(response)
    name = channel_name(responses[0], channel)
    sections = [response.stroboscopic(phase) for response in responses]
    last = [s[name][s.time >= r.window[0]] for s, r in zip(sections, responses, strict=True)]
    words, numbers = _varied(responses, over)
    across = np.repeat(numbers, [values.size for values in last])
    values, unit = scaled(np.concatenate(last), responses[0].units[name])
    axis = panel(ax, 8.0, 5.0)
    axis.plot(across, values, ".", color=BLUE, markersize=2.5, markeredgewidth=0.0)
    title = f"last third of each run, base at {math.degrees(phase):.4g} degrees"
    label_axes(axis, words, f"{name_words(name)} once per cycle ({unit})", title)
    return axis


def _varied(responses: Sequence[Response], over: Any) -> tuple[str, Array]:
    """Words and values of the first number that differs between runs, or of one that is given; of one run the first."""
    if over is not None:
        pair = isinstance(over, (tuple, list)) and len(over) == 2 and np.size(over[1]) == len(responses)
        allowed = f'must be words and a value for each of {len(responses)} runs, as ("damping ratio (%)", [0.1, 0.2])'
        require(pair and isinstance(over[0], str), "over", over, "", allowed)
        return over[0], checked("over[1]", over[1], column("", "runs", finite=True))
    numbers = [_numbers(response) for response in responses]
    columns = {words: np.array([each.get(words) for each in numbers], dtype=float) for words in numbers[0]}
    differ = [words for words, values in columns.items() if np.all(np.isfinite(values)) and np.ptp(values) > 0.0]
    allowed = "must be words and the value of each run: no frequency, amplitude, gap, restitution or mass differs"
    require(bool(differ) or len(responses) == 1, "over", "none", "", allowed)
    words = [*differ, *columns][0]
    return words, columns[words]


def _numbers(response: Response) -> dict[str, Any]:
    """Numbers of a run that may differ from those of another, by their words for an axis."""
    drive: Any = response.base
    words, level = "amplitude of the base (mm)", 1e3 * drive.amplitude
    if is_force(drive):
        words = "factor on the force" if isinstance(drive.at, LineLoad) else "amplitude of the force (N)"
        level = drive.history.amplitude
    numbers: dict[str, Any] = {"base frequency (Hz)": drive.frequency, words: level}
    for pair in response.system.contacts:
        for gap, side in zip(pair.gaps, ("", ", - side"), strict=True):
            numbers[f"gap of {pair.name}{side} (mm)"] = 1e3 * gap
        numbers[f"restitution of {pair.name}"] = getattr(pair.law, "restitution", None)
        numbers[f"mass of {pair.name} (g)"] = 1e3 * pair.mass
    return numbers
