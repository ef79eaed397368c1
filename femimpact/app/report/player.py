"""The motion of a run for the player of the page: frames with smooth beams, at the snapshots and at every impact.

Deflection and slope at some places of the beam draw its cubic curve between them exactly. Numbers are integers of
16 bits in Base64: lengths are exact to 1/32000 of the largest. Between two snapshots the beam moves by the cubic
through their displacements and velocities, and a ball on a straight line to the next wall that it meets.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.app.report.markup import Element, data_element, element, svg_element
from femimpact.arrays import Array, thinned
from femimpact.figures.drawing import COLOURS, GREY, OffScreen, label_axes, legend_above, panel
from femimpact.response.history import Snapshots, shown_snapshots
from femimpact.response.impacts import Impacts
from femimpact.response.response import Response
from femimpact.scene.placed import Contact, PlacedStructure, ball_radius, offsets_of, placed_structure
from femimpact.scene.scene import BODY, BOX, PARTS, STOP, SUPPORT, Body, bodies_on_beam, chosen_exaggeration
from femimpact.structure.structure import Structure
from femimpact.units import TIMES

MOST_SNAPSHOTS, MOST_IMPACTS = 600, 600
"""Frames on the grid of the snapshots, and at impacts."""

STATIONS = 48
"""Places of the beam of which deflection and slope are kept, at most."""

FULL = 32_000
"""Largest integer that stands for a length."""

SPEEDS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
"""Shares of the true speed that can be chosen."""

WIDTH = 9.6
"""Width of the picture over time, inches."""

MOST_CLOSE = 4
"""Balls that are shown close up."""

KEYS = "Keys: space plays and pauses, left and right step by frames, with shift by impacts."

WANTED = 10.0
"""Seconds for which the motion is shown, about."""


@dataclass(frozen=True, eq=False)
class Frames:
    """The motion in frames."""

    time: Array  # (frames,) s
    stations: Array  # (stations,) m
    deflection: Array  # (frames, stations) m and 1: relative to the base
    slope: Array  # (frames, stations) m and 1
    balls: Array  # (frames, balls) m
    space: Array  # (frames,) m: of what is fixed in space, relative to the base
    impacts: tuple[tuple[int, int, int], ...]  # (frame, contact, side)


def frames_of(response: Response) -> Frames | None:
    """Frames at snapshots and impacts; None of a response without snapshots, or without a beam."""
    snapshots, nodes = response.snapshots, np.asarray(response.system.nodes, dtype=float)
    if snapshots is None or snapshots.time.size < 2 or nodes.size < 2:
        return None
    if snapshots.displacement.shape[1] != 2 * nodes.size:
        return None
    contacts = list(response.system.contacts)
    grid = snapshots.time[shown_snapshots(snapshots, response.base, response.system, MOST_SNAPSHOTS)]
    hits = _hits(response.impacts, grid, [pair.name for pair in contacts])
    times = np.unique(np.concatenate([grid, hits["time"]]))
    stations = _stations(nodes, [pair.position for pair in contacts])
    rows, slopes = (response.system.nodal_rows(stations, order).toarray() for order in (0, 1))
    displacement = _between(snapshots, times)
    deflection = displacement @ rows.T
    at_pairs = (
        displacement @ response.system.nodal_rows([pair.position for pair in contacts]).toarray().T
        if contacts
        else None
    )
    balls = np.zeros((times.size, len(response.system.balls)))
    for j, pair in enumerate(response.system.balls):
        mine = hits["contact"] == j
        beam = np.interp(hits["time"][mine], times, at_pairs[:, j]) if at_pairs is not None else np.zeros(0)
        side = hits["side"][mine]
        walls = beam + np.where(side > 0, pair.gaps[0], -pair.gaps[1])
        known = np.concatenate([snapshots.time, hits["time"][mine]])
        order = np.argsort(known, kind="stable")
        balls[:, j] = np.interp(times, known[order], np.concatenate([snapshots.ball_displacement[:, j], walls])[order])
    space = -np.asarray(response.base.displacement(times), dtype=float)
    frames = np.searchsorted(times, hits["time"])
    events = list(zip(frames.tolist(), hits["contact"].tolist(), hits["side"].tolist(), strict=True))
    # balls that meet have no body of their own: both are hit, at no wall
    meetings = response.system.meetings
    hit = [(frame, ball, side if ball == j else 0) for frame, j, side in events for ball in meetings.get(j, (j,))]
    return Frames(times, stations, deflection, displacement @ slopes.T, balls, space, tuple(hit))


def _hits(impacts: Impacts, shown: Array, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Impacts within the snapshots: time, number of the contact, side; the hardest where there are too many."""
    number = {name: j for j, name in enumerate(names)}
    within = (impacts.time >= shown[0]) & (impacts.time <= shown[-1])
    within &= np.isin(impacts.impactor, names) if names else np.zeros(within.shape, dtype=bool)
    chosen = np.flatnonzero(within)
    if chosen.size > MOST_IMPACTS:
        hardest = np.argsort(-impacts.approach_speed[chosen], kind="stable")[:MOST_IMPACTS]
        chosen = np.sort(chosen[hardest])
    return {
        "time": impacts.time[chosen],
        "contact": np.array([number[str(name)] for name in impacts.impactor[chosen]], dtype=np.int64),
        "side": np.sign(impacts.side[chosen]).astype(np.int64),
    }


def _stations(nodes: Array, held: Sequence[float]) -> Array:
    inner = nodes if nodes.size <= STATIONS else nodes[thinned(nodes.size, STATIONS)]
    inside = [x for x in held if nodes[0] <= x <= nodes[-1]]
    found = np.unique(np.concatenate([inner, inside]))
    # two places that rounding alone separates are one
    apart = np.diff(found) > 1e-9 * (nodes[-1] - nodes[0])
    return np.asarray(found[np.concatenate([[True], apart])])


def _between(snapshots: Snapshots, times: Array) -> Array:
    """Nodal values (times, 2 nodes) by the cubic through the displacements and velocities of two snapshots."""
    known = snapshots.time
    k = np.clip(np.searchsorted(known, times, side="right") - 1, 0, known.size - 2)
    h = np.maximum(known[k + 1] - known[k], 1e-300)
    s = np.clip((times - known[k]) / h, 0.0, 1.0)[:, None]
    u, v, span = snapshots.displacement, snapshots.velocity, h[:, None]
    return (
        (1 - 3 * s**2 + 2 * s**3) * u[k] + (s - 2 * s**2 + s**3) * span * v[k]
        + (3 * s**2 - 2 * s**3) * u[k + 1] + (s**3 - s**2) * span * v[k + 1]
    )  # fmt: skip


# ---- the page -------------------------------------------------------------------------------------


def player_element(
    response: Response,
    structure: Structure,
    exaggeration: float | None,  # by which motion and gaps are drawn larger; chosen for None
    key: str = "player",  # begins identifiers
) -> Element | None:
    """The player of a response's snapshots, with its data; None where it has none."""
    frames = frames_of(response)
    if frames is None:
        return None
    placed = placed_structure(structure, response.system)
    balls = list(response.system.balls)
    larger = exaggeration or max(chosen_exaggeration(frames.deflection, frames.balls, structure, balls), 1e-3)
    span = float(frames.time[-1] - frames.time[0])
    speed = min(SPEEDS, key=lambda share: abs(math.log(span / share / WANTED)))
    data = _data(frames, placed, larger) | {"larger": larger, "speed": speed}
    speeds = {share: "true" if share == 1.0 else f"1/{1.0 / share:.0f}" for share in SPEEDS}
    options = [element("option", text, value=repr(one), selected=one == speed) for one, text in speeds.items()]
    factors = {factor: "true" if factor == 1.0 else f"motion and gaps {TIMES} {factor:g}" for factor in (larger, 1.0)}
    scales = [element("option", text, value=repr(float(factor))) for factor, text in factors.items()]
    close = [
        _view(f"{pair.name}, moving with its box", str(j), f"{pair.name} in its box")
        if pair.kind == "impactor"
        else _view(f"{pair.name}, moving with the beam", str(j), f"{pair.name} on its spring")
        for j, pair in enumerate(balls)
    ]
    about = "; ".join(filter(None, ("Whole beam, relative to the moving base", structure.beam.drawn_words)))
    stage = element(
        "div.stage.beside" if balls else "div.stage",
        _view(about, "beam", "The moving beam"),
        element("div.close", *close[:MOST_CLOSE]) if balls else None,
    )
    controls = element(
        "div.controls",
        element("button", "Play", type="button", data_do="play"),
        element("button", "Previous impact", type="button", data_do="before") if frames.impacts else None,
        element("button", "Next impact", type="button", data_do="after") if frames.impacts else None,
        element("input", type="range", min="0", max=frames.time.size - 1, step="1", value="0", aria_label="Time"),
        element("output", ""),
        element("label", "speed ", element("select", *options, data_do="speed")),
        element("label", "scale ", element("select", *scales, data_do="scale")),
    )
    return element(
        "div.player",
        element("noscript", element("p", "The player needs scripts, which this browser does not run.")),
        stage,
        controls,
        _history(response, frames, key),
        element("p.keys", KEYS),
        data_element(data),
        tabindex="0", role="group", aria_label="Player of the motion",
    )  # fmt: skip


def _view(words: str, view: str, label: str) -> Element:
    return element("div.view", element("p", words), element("canvas", data_view=view, role="img", aria_label=label))


def _data(frames: Frames, placed: PlacedStructure, larger: float) -> dict[str, Any]:
    largest = max(float(np.abs(values).max(initial=0.0)) for values in (frames.deflection, frames.balls, frames.space))
    unit, steepest = (largest or 1.0) / FULL, (float(np.abs(frames.slope).max(initial=0.0)) or 1.0) / FULL
    beam = placed.structure.beam
    middles = 0.5 * (frames.stations[1:] + frames.stations[:-1])
    nearest = [int(np.argmin(np.abs(frames.stations - pair.position))) for pair in placed.contacts]
    at_pairs = frames.deflection[:, nearest]
    return {
        "time": [round(float(t), 9) for t in frames.time],
        "stations": [round(float(x), 9) for x in frames.stations],
        "thickness": [float(f"{beam.drawn_at(float(np.clip(x, 0.0, beam.joints[-1])))[1]:.5g}") for x in middles],
        "unit": unit,
        "slopeUnit": steepest,
        "deflection": _packed(frames.deflection / unit),
        "slope": _packed(frames.slope / steepest),
        "balls": _packed(frames.balls / unit),
        "space": _packed(frames.space / unit),
        "impacts": [list(one) for one in frames.impacts],
        "length": beam.length,
        "contacts": [
            {
                "x": pair.position,
                "stop": pair.is_stop,
                "hung": pair.kind == "absorber",
                "radius": 0.0 if pair.is_stop else ball_radius(pair.mass),
                "foot": placed.half_height(pair.position, larger),  # of an absorber's spring
                "room": 0.0 if pair.is_stop else _room(pair, frames.balls[:, j], at_pairs[:, j]),
                "met": [k for k, other in enumerate(placed.contacts) if other.name in placed.met_by(pair)],
                "beside": [offsets_of(placed.structure, scale).get(pair.name, 0.0) for scale in (larger, 1.0)],
            }
            for j, pair in enumerate(placed.contacts)
        ],
        "blocks": [
            {
                "part": PARTS[body.part],
                "x": body.axis if math.isfinite(body.axis) else None,  # of the section that carries it
                "space": body.in_space,
                "pair": body.pair,
                "side": body.side,
                "corners": [_corners(body), _corners(at_true_scale)],  # at both scales, from what carries it
            }
            for body, at_true_scale in zip(bodies_on_beam(placed, larger), bodies_on_beam(placed), strict=True)
            if body.part in (SUPPORT, BODY, BOX, STOP)
        ],
    }


def _corners(body: Body) -> list[list[float]]:
    origin = body.axis if math.isfinite(body.axis) else 0.0
    return [[round(float(x) - origin, 9), round(float(y), 9)] for x, y in body.outline]


def _room(pair: Contact, ball: Array, beam: Array) -> float:
    """Largest distance (m) of a ball from its middle: the wider gap, or what one moves that reaches a wall or none."""
    return max(pair.gaps) if max(pair.gaps) < math.inf else float(np.abs(ball - beam).max())


def _packed(values: Array) -> str:
    integers = np.clip(np.rint(values), -FULL, FULL).astype("<i2")
    return base64.b64encode(integers.tobytes()).decode("ascii")


def _history(response: Response, frames: Frames, key: str) -> Element:
    """The tip, and the balls with the free space between their walls, over the time that is shown."""
    balls, time = list(response.system.balls), frames.time
    axis = panel(OffScreen(), WIDTH, 3.2)
    axis.plot(time, 1e3 * frames.deflection[:, -1], color=GREY, linewidth=1.2, label="tip")
    for colour, (j, pair) in zip(COLOURS, enumerate(balls[:MOST_CLOSE]), strict=False):
        at = int(np.argmin(np.abs(frames.stations - pair.position)))
        beam, ball = 1e3 * frames.deflection[:, at], 1e3 * frames.balls[:, j]
        if len(balls) == 1 and max(pair.gaps) < math.inf:
            plus, minus = (1e3 * gap for gap in pair.gaps)
            axis.fill_between(
                time, beam - minus, beam + plus, color=GREY, alpha=0.2, linewidth=0.0, label="between the walls"
            )
        axis.plot(time, ball, color=colour, linewidth=1.2, label=pair.name)
        hits = [frame for frame, contact, _ in frames.impacts if contact == j]
        if hits:
            axis.plot(time[hits], ball[hits], ".", color=colour, label=f"impacts of {pair.name}")
    axis.set_xlim(time[0], time[-1])
    label_axes(axis, "time (s)", "relative to the base (mm)")
    legend_above(axis)
    title = "Displacements over the time that is shown"
    drawn = svg_element(axis, key, title)
    box = axis.get_position()
    place = f"left:{box.x0:.4%};width:{box.width:.4%};top:{1.0 - box.y1:.4%};height:{box.height:.4%}"
    return element(
        "div.frame",
        element("div.timeline", drawn, element("div.plot", style=place), style=f"max-width:{72.0 * WIDTH:g}pt"),
        tabindex="0", role="region", aria_label=title,
    )  # fmt: skip
