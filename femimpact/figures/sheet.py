"""The sheet that every frame of a movie is: a caption, two views, and the histories with a moving marker."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.figures.drawing import BLUE, DARK, GREY, ORANGE, STYLE, name_at
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.scene.placed import ball_radius, placed_structure
from femimpact.scene.scene import BALL, BODY, BOX, CONNECTION, CONTACT_POINT, STOP, Scene, outline_of, sections_along
from femimpact.structure.structure import Structure
from femimpact.system.hermite import hermite_rows
from femimpact.units import number_text

WIDTH, HEIGHT = 1280, 720
"""Pixels; multiples of 16, or the encoder would resize."""
VIEWS = slice(82, 462)
"""Rows of pixels that hold the two views."""
CLOSE_UPS, SPACE = 0.64, 0.06
"""Left end of the close-ups in the plane of motion, and what is between them, by the width of the sheet."""
BEAM_COLOUR, BODY_COLOUR = "#555b63", "#c3ced9"

Draw = Callable[[int], None]


@dataclass(frozen=True, eq=False)
class Film:
    """Input of a movie: the chosen snapshots, the scene, and which contact is closed when."""

    response: Response
    structure: Structure
    snapshots: Snapshots  # of the response
    chosen: NDArray[np.int64]  # (frames,) numbers of the snapshots that are shown
    scene: Scene
    caption: str
    # (frames, contacts) side of the wall that a ball touches, or of a stop that the beam touches; 0 without contact
    touched: NDArray[np.int64]

    def touches(self, i: int, pair: int, side: int) -> bool:
        """True where a pair touches on that side at frame i; side 0 means either."""
        return bool(self.touched[i, pair] != 0 and side in (0, self.touched[i, pair]))

    def moved(self, i: int) -> NDArray[np.float64]:
        """Points (points, 3), m, of frame i."""
        k = self.chosen[i]
        nodal, balls = self.snapshots.displacement[k], self.snapshots.ball_displacement[k]
        # seen from the base, what is fixed in space moves against it
        space = -float(self.response.base.displacement(self.snapshots.time[k]))
        return np.asarray(self.scene.points + self.scene.displacement(nodal, balls, space=space))

    def at_pair(self, j: int) -> NDArray[np.float64]:
        """Deflection (m) of the beam at pair j in every snapshot."""
        position = self.response.system.balls[j].position
        rows = hermite_rows(self.response.system.nodes, [position])
        return np.asarray((rows @ self.snapshots.displacement.T)[0])

    def room(self, j: int) -> float:
        """Largest distance (m) of the ball of pair j from its middle: the wider gap, or what an absorber moves."""
        pair = self.response.system.balls[j]
        moved = np.abs(self.snapshots.ball_displacement[:, j] - self.at_pair(j))
        return max(pair.gaps) if pair.has_walls else float(moved.max())

    def stops(self) -> list[tuple[int, int, int]]:
        """Cell, pair and side of each block of a stop, in the order of the scene."""
        cells = iter(np.flatnonzero(self.scene.part == STOP).tolist())
        sides = [
            (j, side)
            for j, pair in enumerate(self.response.system.contacts)
            for side, gap in zip((1, -1), pair.gaps, strict=True)
            if pair.is_stop and math.isfinite(gap)
        ]
        return [(cell, j, side) for cell, (j, side) in zip(cells, sides, strict=True)]

    def ends(self, left: float, right: float) -> tuple[float, float]:
        """Middle and half (m) of what is shown along the beam: these shares of its length, or all that is drawn."""
        length, x = self.structure.beam.length, self.scene.points[:, 0]
        low = min(left * length, float(x.min()) - 0.02 * length)
        high = max(right * length, float(x.max()) + 0.02 * length)
        return 0.5 * (low + high), 0.5 * (high - low)

    @property
    def reach(self) -> float:
        """Largest exaggerated |y| (m) of anything drawn but stops, which may be far from the beam."""
        scene = self.scene
        kinds = np.repeat(scene.part, np.diff(scene.offsets, prepend=0))
        moving = np.unique(scene.connectivity[(kinds != STOP) & (kinds != CONTACT_POINT)])
        return max(float(np.abs(self.moved(i)[moving, 1]).max()) for i in range(self.chosen.size))


def sheets(film: Film) -> Callable[[int], NDArray[np.uint8]]:
    """A function that draws frame i as pixels; what does not move is drawn once.

    Returns (HEIGHT, WIDTH, 4): red, green, blue, and a byte that is not read.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE | {"font.size": 13.0}):
        figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
        canvas: Any = FigureCanvasAgg(figure)
        figure.text(0.02, 0.965, film.caption, va="center", color="black", fontsize=14.0)
        for x, title in _titles(film):
            figure.text(x, 0.905, title, va="center", color=GREY)
        figure.text(0.02, 0.02, film.structure.beam.drawn_words, va="center", color=GREY)
        draws = [_histories(figure, film), *_plane_views(figure, film)]
        canvas.draw()
        still = canvas.copy_from_bbox(figure.bbox)

    def frame(i: int) -> NDArray[np.uint8]:
        canvas.restore_region(still)
        for draw in draws:
            draw(i)
        return np.array(canvas.buffer_rgba())

    return frame


def _carrier(pair: Any) -> str:
    """What a ball or an absorber moves on, in a word."""
    return "box" if pair.has_walls else "beam"


def _titles(film: Film) -> list[tuple[float, str]]:
    """Words above the two views, with the sizes that an exaggerated picture cannot be measured for."""
    titles = [(0.02, f"Whole beam ({1e3 * film.structure.beam.length:.4g} mm), relative to the moving base")]
    balls = film.response.system.balls
    for j, pair in enumerate(balls):
        plus, minus = (1e3 * gap for gap in pair.gaps)
        gaps = (
            f"gaps {number_text(plus, 3)} mm"
            if plus == minus
            else f"gaps +{number_text(plus, 3)}, -{number_text(minus, 3)} mm"
        )
        gaps = gaps if pair.has_walls else "absorber"
        # several are too narrow for both in a line
        name = f"Close-up, moving with the {_carrier(pair)} " if len(balls) == 1 else f"{pair.name}\n"
        titles.append((CLOSE_UPS + (0.98 + SPACE - CLOSE_UPS) * j / len(balls), f"{name}({gaps})"))
    return titles


def _histories(figure: Any, film: Film) -> Draw:
    """Strips over time, true millimetres, one for each ball, with a marker at the frame's time."""
    time, balls = film.snapshots.time, film.response.system.balls
    count, space = max(len(balls), 1), 0.02
    height = (0.195 - space * (count - 1)) / count
    # the last label of the time is centred below the right end of the axes
    places = [(0.078, 0.105 + (height + space) * (count - 1 - k), 0.887, height) for k in range(count)]
    axes = [figure.add_axes(place) for place in places]
    for j, axis in enumerate(axes):
        if balls:
            _history(axis, film, j)
        else:
            axis.plot(time, 1e3 * film.snapshots.displacement[:, -2], color=BEAM_COLOUR, label="tip")
        axis.set_xlim(time[0], max(time[-1], time[0] + 1e-9))
        axis.tick_params(labelbottom=j == count - 1)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, borderaxespad=0.1)
    axes[-1].set_xlabel("time (s)")
    # one for all strips: of two or three of them none is as high as these words are long
    words = "relative to\nthe base (mm)"
    figure.text(0.004, 0.2025, words, rotation=90.0, ha="left", va="center", multialignment="center")
    markers = [axis.axvline(time[0], color="black", linewidth=1.6, animated=True) for axis in axes]
    clock = figure.text(0.965, 0.325, "", ha="right", va="center", fontsize=14.0, animated=True)

    def draw(i: int) -> None:
        now = time[film.chosen[i]]
        clock.set_text(f"t = {now:.3f} s")
        figure.draw_artist(clock)
        for axis, marker in zip(axes, markers, strict=True):
            marker.set_xdata([now, now])
            axis.draw_artist(marker)

    return draw


def _history(axis: Any, film: Film, j: int) -> None:
    """A ball, the beam at its box and what is free between the walls, over time."""
    snapshots, balls, impacts = film.snapshots, film.response.system.balls, film.response.impacts
    time, pair = snapshots.time, balls[j]
    wall, ball = 1e3 * film.at_pair(j), 1e3 * snapshots.ball_displacement[:, j]
    inside = (wall - 1e3 * pair.gaps[1], wall + 1e3 * pair.gaps[0])
    place = name_at(film.response.system, pair) or "beam at the box"
    if pair.has_walls:
        axis.fill_between(time, *inside, color="#e6eaee", label="between the walls")
    axis.plot(time, wall, color=BEAM_COLOUR, label=place if len(balls) == 1 else "beam at the box")
    axis.plot(time, ball, color=BLUE, label=pair.name if len(balls) == 1 else "ball")
    if pair.has_walls:
        at = impacts.time[(impacts.impactor == pair.name) & (impacts.time >= time[0]) & (impacts.time <= time[-1])]
        axis.plot(at, np.interp(at, time, ball), "o", color=ORANGE, markersize=5.0, label="impact")
    if len(balls) > 1:
        # beside the axes, where no curve is
        axis.text(1.005, 0.5, pair.name, transform=axis.transAxes, rotation=90.0, ha="left", va="center", color=GREY)


def _plane_views(figure: Any, film: Film) -> list[Draw]:
    """Axes of the beam, and of the close-up where there is a ball."""
    length, s, contacts = 1e3 * film.structure.beam.length, film.scene.exaggeration, film.response.system.balls
    axis = figure.add_axes((0.065, 0.435, 0.5 if contacts else 0.915, 0.435))
    middle, half = film.ends(-0.04, 1.08)
    _fit(axis, 1e3 * middle, 1e3 * half, 1.05e3 * film.reach, s, "relative to the base (mm)")
    for _, place in placed_structure(film.structure, film.response.system).supports:
        x = 1e3 * place
        axis.plot([x, x], [-0.05 * length, 0.05 * length], color="black", linewidth=5.0)
    views = [_moving_parts(axis, film, None)]
    width = (0.98 + SPACE - CLOSE_UPS) / max(len(contacts), 1) - SPACE
    if contacts:
        # one for all: below each of several it would be wider than its view
        figure.text(0.5 * (CLOSE_UPS + 0.98), 0.378, axis.get_xlabel(), ha="center", va="center")
    for j, pair in enumerate(contacts):
        half = 1e3 * (s * film.room(j) + 1.6 * ball_radius(pair.mass))
        close = figure.add_axes((CLOSE_UPS + j * (width + SPACE), 0.435, width, 0.435))
        _fit(
            close,
            1e3 * pair.position,
            1.6e3 * ball_radius(pair.mass),
            half,
            s,
            f"relative to the {_carrier(pair)} (mm)",
        )
        close.set_xlabel("")
        if j > 0:
            close.set_ylabel("")
        views.append(_moving_parts(close, film, j))
    return views


def _fit(axis: Any, middle: float, half_x: float, half_y: float, exaggeration: float, label: str) -> None:
    """Show at least these half spans (mm) about (middle, 0), x and y to one scale; label y by the true mm."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

    box = axis.get_position()
    ratio = box.width * WIDTH / (box.height * HEIGHT)
    half = max(half_y, half_x / ratio)
    axis.set(xlim=(middle - half * ratio, middle + half * ratio), ylim=(-half, half))
    # round numbers of the true scale; round numbers of the drawn one would be odd
    ticks = MaxNLocator(nbins=6).tick_values(-half / exaggeration, half / exaggeration)
    axis.yaxis.set_major_locator(MultipleLocator(exaggeration * float(ticks[1] - ticks[0])))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y / exaggeration:g}".replace("-", "\u2212")))
    axis.set_xlabel("distance from the root (mm)")
    axis.set_ylabel(label)


def _moving_parts(axis: Any, film: Film, follow: int | None) -> Draw:
    """Beam, boxes and balls in the plane of motion; with `follow`, seen from the box of that pair."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Circle

    scene, contacts = film.scene, film.response.system.balls
    cells = np.split(scene.connectivity, scene.offsets[:-1])
    # the faces that look along z: of the beam from section to section, and of a hexahedron of a box
    beam = _silhouette(film)
    boxes = [cells[c][:4] for c in np.flatnonzero(scene.part == BOX)]
    bodies = [cells[c][:4] for c in np.flatnonzero(scene.part == BODY)]
    # there and back; its post looks along z
    springs = [cells[c][[0, 1, 1, 0]] for c in np.flatnonzero(scene.part == CONNECTION)]
    stops = film.stops()
    faces = np.array([*bodies, *boxes, *beam, *springs, *(cells[cell][:4] for cell, _, _ in stops)])
    collection = PolyCollection([], linewidths=2.0, joinstyle="round", animated=True)
    axis.add_collection(collection, autolim=False)
    balls = [
        np.unique(np.concatenate([cells[c] for c in np.flatnonzero((scene.part == BALL) & (scene.pair == j))]))
        for j in range(len(contacts))
    ]
    circles = [
        axis.add_patch(Circle((1e3 * pair.position, 0.0), 1e3 * ball_radius(pair.mass), animated=True))
        for pair in contacts
    ]

    def draw(i: int) -> None:
        moved = 1e3 * film.moved(i)[:, :2]
        if follow is not None:
            moved[:, 1] -= 1e3 * scene.exaggeration * film.at_pair(follow)[film.chosen[i]]
        boxed = [j for j, pair in enumerate(contacts) if pair.has_walls]
        colours = [BODY_COLOUR] * len(bodies)
        colours += [colour for j in boxed for colour in _box_colours(film, i, j)]
        colours += [BEAM_COLOUR] * len(beam) + [DARK] * len(springs)
        colours += [ORANGE if film.touches(i, j, side) else DARK for _, j, side in stops]
        collection.set(verts=moved[faces], facecolors=colours, edgecolors=colours)
        axis.draw_artist(collection)
        for j, (circle, ball) in enumerate(zip(circles, balls, strict=True)):
            circle.set_center((1e3 * contacts[j].position, float(moved[ball, 1].mean())))
            circle.set_color(ORANGE if film.touches(i, j, 0) else BLUE)
            axis.draw_artist(circle)

    return draw


def _silhouette(film: Film) -> list[NDArray[np.int64]]:
    """Points of the quadrilaterals between the lowest and the highest point of neighbouring sections of the beam."""
    faces, first = [], 0
    for stations in film.scene.stretches:
        points = outline_of(sections_along(film.structure, stations)[0]).points
        low, high = int(points[:, 0].argmin()), int(points[:, 0].argmax())
        for _ in range(stations.size - 1):
            faces.append(first + np.array([low, high, len(points) + high, len(points) + low]))
            first += len(points)
        first += len(points)
    return faces


def _box_colours(film: Film, i: int, j: int) -> tuple[str, str, str]:
    """Colours of the + wall, the - wall and the floor, in the order in which a scene holds them."""
    plus, minus = (ORANGE if film.touches(i, j, side) else "#7b8a9a" for side in (1, -1))
    return plus, minus, "#e3e8ee"
