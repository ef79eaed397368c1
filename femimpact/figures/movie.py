"""A slow-motion movie in which the beam swings and the ball meets its walls, and that of a mode, by matplotlib.

Every frame of a run is a sheet: a caption, two views, and the histories with a moving marker.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import instance, optional, quantity, require, takes
from femimpact.excitation.excitation import words_of
from femimpact.figures.drawing import BLUE, DARK, GREY, ORANGE, STYLE, name_at
from femimpact.files import atomic_path, target_path
from femimpact.response.history import Snapshots, shown_snapshots
from femimpact.response.response import Response
from femimpact.scene.placed import Contact, ball_radius, offsets_of, travel_of
from femimpact.scene.scene import (
    BALL,
    BEAM,
    BODY,
    BOX,
    CONNECTION,
    CONTACT_POINT,
    EXAGGERATION,
    STOP,
    SUPPORT,
    Body,
    Scene,
    build_scene,
    chosen_exaggeration,
    snapshots_of,
)
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes, require_modes_of
from femimpact.system.system import System
from femimpact.units import number_text

__all__ = ["write_mode", "write_movie"]

MOST_FPS = 1000
"""Frames per second; a GIF counts milliseconds."""


@takes(
    response=instance(Response), structure=instance(Structure), exaggeration=optional(EXAGGERATION),
    fps=quantity("1/s", at_least=1, at_most=MOST_FPS, integer=True),
    most=quantity("frames", at_least=1, integer=True),
)  # fmt: skip
def write_movie(
    path: str | Path,
    response: Response,
    structure: Structure,
    exaggeration: float | None = None,
    fps: int = 25,
    most: int = 250,
) -> Path:
    """Write the snapshots of a response as a slow-motion movie.

    Parameters
    ----------
    path : str or Path
        `.mp4` needs the movie extra (imageio-ffmpeg); without it, or with `.gif`, a GIF is written.
    response : Response
        With snapshots.
    structure : Structure
    exaggeration : float, optional
        Scales the motion and the clearance together; chosen so that both fill about 8 %
        of the beam's length when None. The factor stands in the picture.
    fps : int
        Frames per second.
    most : int
        At most so many frames, evenly thinned. Of a run in which a period would have fewer than 12 of them they show
        the last periods; without a cycle, as of a decay or a shock, the first.

    Returns
    -------
    Path
        Of the file that was written, which may end in `.gif`.

    Raises
    ------
    InputError
        If the response holds no snapshots, or the path cannot be written.

    Examples
    --------
    >>> import femimpact as fi
    >>> record = fi.Recorder(channels=("tip",), snapshots=4)
    >>> run = fi.integrate(system, fi.Sine(1e-4, 5.0), fi.Newmark(1e-4), 0.1, record)
    >>> fi.figures.write_movie("run.gif", run, structure)  # doctest: +SKIP
    """
    file = target_path(path)
    film = _film(response, structure, exaggeration, fps, most)
    return _encode(file, map(sheets(film), range(film.chosen.size)), fps)


@takes(
    system=instance(System), modes=instance(Modes), structure=instance(Structure),
    mode=quantity("", at_least=1, integer=True), frames=quantity("frames", at_least=2, integer=True),
    fps=quantity("1/s", at_least=1, at_most=MOST_FPS, integer=True),
)  # fmt: skip
def write_mode(
    path: str | Path,
    system: System,
    modes: Modes,
    structure: Structure,
    mode: int = 1,
    frames: int = 40,
    fps: int = 25,
) -> Path:
    """Write one period of a mode as a movie that repeats; every ball moves with its box.

    Parameters
    ----------
    path : str or Path
        `.gif`, or `.mp4` with the movie extra (imageio-ffmpeg).
    system : System
    modes : Modes
        Of the system.
    structure : Structure
    mode : int
        Its number, from 1 on.
    frames : int
        In the period.
    fps : int
        Frames per second.

    Returns
    -------
    Path
        Of the file that was written, which may end in `.gif`.

    Raises
    ------
    InputError
        If the system has no beam, there is no such mode, or the path cannot be written.

    Examples
    --------
    >>> import femimpact as fi
    >>> modes = fi.solve_modes(system, count=3)
    >>> fi.figures.write_mode("mode_2.gif", system, modes, structure, mode=2)  # doctest: +SKIP
    """
    file, count = target_path(path), modes.natural_frequency.size
    require(system.nodes.size > 1, "system.nodes", system.nodes.size, "", "must be 2 or more: a shape needs a beam")
    require_modes_of(system.dofs, modes)
    require(mode <= count, "mode", mode, "", f"must be one of the {count} modes")
    length, scene, vector = structure.beam.length, build_scene(structure, system), modes.vectors[:, mode - 1]
    height = MODE_SWING * length
    factor = height / np.abs(system.deflection_rows(np.concatenate(scene.stretches)) @ vector).max()
    balls = [float((system.deflection_rows([pair.position]) @ vector)[0]) for pair in system.balls]
    moved = scene.displacement(factor * (system.expansion @ vector), factor * np.array(balls))

    def moment(i: int) -> NDArray[np.float64]:
        return np.asarray(scene.points + math.cos(2.0 * math.pi * i / frames) * moved)

    def view(figure: Any) -> list[Draw]:
        axis = figure.add_axes((0.075, 0.1, 0.905, 0.77))
        middle, half = _ends(scene, length)
        reach = _reach(scene, map(moment, range(frames)))
        _fit(axis, 1e3 * middle, 1e3 * half, 1.05e3 * reach, 1e3 * height, "w / max |w|")
        return [_moving_parts(axis, scene, system.balls, moment, np.zeros((frames, len(system.contacts)), dtype=int))]

    ratio = number_text(100.0 * modes.damping_ratio[mode - 1], 3)
    caption = f"Mode {mode}: {modes.natural_frequency[mode - 1]:.5g} Hz, damping ratio {ratio} %"
    return _encode(file, map(_sheets(caption, view), range(frames)), fps)


def _film(response: Response, structure: Structure, exaggeration: float | None, fps: int, most: int) -> Film:
    snapshots = snapshots_of(response)
    if exaggeration is None:
        motion = snapshots.displacement[:, 0::2], snapshots.ball_displacement
        exaggeration = chosen_exaggeration(*motion, structure, response.system.balls)
    chosen = shown_snapshots(snapshots, response.base, response.system, most)
    span = float(snapshots.time[chosen[-1]] - snapshots.time[chosen[0]])
    slow = f"   Slowed {number_text((chosen.size - 1) / fps / span, 2)} times." if span > 0.0 else ""
    words = words_of(response.base)
    is_sine = math.isfinite(response.base.phase) and response.base.amplitude > 0.0
    moved = f", {1e3 * response.base.amplitude:.4g} mm" if is_sine else ""
    base = f"{words[:1].upper()}{words[1:]}{moved}."
    drawn = "Motion and clearance" if response.system.contacts else "Motion"
    size = "to scale" if exaggeration == 1.0 else f"{exaggeration:g} times as large"
    caption = f"{base}   {drawn} drawn {size}.{slow}"
    scene = build_scene(structure, response.system, exaggeration)
    return Film(response, structure, snapshots, chosen, scene, caption, _touched(response, snapshots, chosen))


def _touched(response: Response, snapshots: Snapshots, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """Side on which each contact is closed: at the frame, or since the frame before the last.

    An impact is shorter than a frame, so one that fell between two frames is shown by the next two.
    """
    touched = np.sign(snapshots.contact_force[chosen]).astype(int)
    times, earlier = snapshots.time[chosen], snapshots.time[np.concatenate([chosen[:1], chosen[:1], chosen])[:-2]]
    for j, pair in enumerate(response.system.contacts):
        of_pair = response.impacts.impactor == pair.name
        start, side = response.impacts.time[of_pair], response.impacts.side[of_pair]
        last = np.searchsorted(start, times, side="right")
        recent = last > np.searchsorted(start, earlier, side="right")
        touched[recent, j] = side[last[recent] - 1]
    for j, balls in response.system.meetings.items():
        for ball in balls:
            # of no wall
            touched[(touched[:, j] != 0) & (touched[:, ball] == 0), ball] = 2
    return np.asarray(touched)


def _encode(path: Path, frames: Iterator[NDArray[np.uint8]], fps: int) -> Path:
    try:
        import imageio_ffmpeg
    except ImportError:
        imageio_ffmpeg = None
    if path.suffix == ".mp4" and imageio_ffmpeg is not None:
        with atomic_path(path) as temporary:
            options: dict[str, Any] = {"fps": fps, "quality": 7, "macro_block_size": 16, "pix_fmt_in": "rgb0"}
            options["output_params"] = ["-preset", "veryfast"]
            count = 0
            try:
                writer = imageio_ffmpeg.write_frames(str(temporary), (WIDTH, HEIGHT), **options)
                writer.send(None)
            # an encoder that does not answer makes its library fail in any way
            except Exception as error:
                raise RuntimeError(f"ffmpeg does not start: {error}") from error
            try:
                for frame in frames:
                    writer.send(frame)
                    count += 1
            finally:
                writer.close()
            # an encoder that ends early does so without a word
            if not temporary.stat().st_size or imageio_ffmpeg.count_frames_and_secs(temporary)[0] != count:
                raise RuntimeError(f"{path.name}: ffmpeg did not write all of its {count} frames")
        return path
    from PIL import Image

    path = path.with_suffix(".gif")
    small = (WIDTH // 2, HEIGHT // 2)
    pictures = [Image.fromarray(frame[..., :3]).resize(small).quantize(64) for frame in frames]
    with atomic_path(path) as temporary:
        pictures[0].save(temporary, save_all=True, append_images=pictures[1:], duration=1000 // fps, loop=0)
    return path


# ---- the sheet ------------------------------------------------------------------------------------


WIDTH, HEIGHT = 1280, 720
"""Pixels; multiples of 16, or the encoder would resize."""
VIEWS = slice(82, 462)
"""Rows of pixels that hold the two views."""
CLOSE_UPS, SPACE = 0.64, 0.06
"""Left end of the close-ups in the plane of motion, and what is between them, by the width of the sheet."""
BEAM_COLOUR, FLOOR = "#555b63", "#e3e8ee"
LINE, EDGE = 2.0, 0.5
"""Widths (points) of connections, and of the edges of bodies: no wider, or a thin plate would look thick."""
MODE_SWING = 0.18
"""Share of the length by which a mode swings: with it the shape fills the sheet."""
DRAWN = {
    SUPPORT: "black", CONNECTION: DARK, BODY: "#c3ced9", BOX: "#7b8a9a", BEAM: BEAM_COLOUR, STOP: DARK
}  # fmt: skip
"""Colours of parts, in the order in which they are drawn."""

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

    def moved(self, i: int, follow: int | None = None) -> NDArray[np.float64]:
        """Points (points, 3), m, of frame i; with `follow` seen from the box of that pair."""
        k = self.chosen[i]
        nodal, balls = self.snapshots.displacement[k], self.snapshots.ball_displacement[k]
        # seen from the base, what is fixed in space moves against it
        space = -float(self.response.base.displacement(self.snapshots.time[k]))
        points = np.asarray(self.scene.points + self.scene.displacement(nodal, balls, space=space))
        if follow is not None:
            pair, larger = self.response.system.balls[follow], self.scene.exaggeration
            middle = offsets_of(self.structure, larger).get(pair.name, 0.0)
            points[:, 1] -= larger * self.at_pair(follow)[k] + middle
        return points

    def at_pair(self, j: int) -> NDArray[np.float64]:
        """Deflection (m) of the beam at pair j in every snapshot."""
        position = self.response.system.balls[j].position
        rows = self.response.system.nodal_rows([position])
        return np.asarray((rows @ self.snapshots.displacement.T)[0])

    def room(self, j: int) -> float:
        """Largest distance (m) of the ball of pair j from its middle: the wider gap, or what it moves without."""
        pair = self.response.system.balls[j]
        moved = np.abs(self.snapshots.ball_displacement[:, j] - self.at_pair(j))
        return max(pair.gaps) if max(pair.gaps) < math.inf else float(moved.max())


def _ends(scene: Scene, length: float) -> tuple[float, float]:
    """Middle and half (m) of what is shown along the beam: a little more than its length, or all that is drawn."""
    x = scene.points[:, 0]
    low = min(-0.04 * length, float(x.min()) - 0.02 * length)
    high = max(1.08 * length, float(x.max()) + 0.02 * length)
    return 0.5 * (low + high), 0.5 * (high - low)


def _reach(scene: Scene, frames: Iterable[NDArray[np.float64]]) -> float:
    """Largest |y| (m) in frames of points of anything drawn but stops, which may be far from the beam."""
    still = [body.part in (STOP, CONTACT_POINT) for body in scene.bodies]
    moving = ~np.repeat(still, np.diff([*scene.first, len(scene.points)]))
    return max(float(np.abs(points[moving, 1]).max()) for points in frames)


def sheets(film: Film) -> Callable[[int], NDArray[np.uint8]]:
    """A function that draws frame i of a film as pixels."""

    def views(figure: Any) -> list[Draw]:
        for x, title in _titles(film):
            figure.text(x, 0.905, title, va="center", color=GREY)
        figure.text(0.02, 0.02, film.structure.beam.drawn_words, va="center", color=GREY)
        return [_histories(figure, film), *_plane_views(figure, film)]

    return _sheets(film.caption, views)


def _sheets(caption: str, views: Callable[[Any], list[Draw]]) -> Callable[[int], NDArray[np.uint8]]:
    """A function that draws frame i as pixels; what does not move is drawn once.

    Returns (HEIGHT, WIDTH, 4): red, green, blue, and a byte that is not read.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE | {"font.size": 13.0}):
        figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
        canvas: Any = FigureCanvasAgg(figure)
        figure.text(0.02, 0.965, caption, va="center", color="black", fontsize=14.0)
        draws = views(figure)
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
    return "beam" if pair.kind == "absorber" else "box"


def _titles(film: Film) -> list[tuple[float, str]]:
    """Words above the two views, with the sizes that an exaggerated picture cannot be measured for."""
    titles = [(0.02, f"Whole beam ({1e3 * film.structure.beam.length:.4g} mm), relative to the moving base")]
    balls = film.response.system.balls
    for j, pair in enumerate(balls):
        plus, minus = (1e3 * gap for gap in travel_of(pair, film.structure))
        gaps = (
            f"gaps {number_text(plus, 3)} mm"
            if plus == minus
            else f"gaps +{number_text(plus, 3)}, -{number_text(minus, 3)} mm"
        )
        gaps = "absorber" if pair.kind == "absorber" else gaps
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
    inside, contacts = [wall - 1e3 * pair.gaps[1], wall + 1e3 * pair.gaps[0]], film.response.system.contacts
    names = [one.name for one in contacts if pair.name in (one.name, *one.between)]
    for k, (first, second) in film.response.system.meetings.items():
        gap = 1e3 * contacts[k].gaps[0]
        if j == second:
            inside[0] = np.maximum(inside[0], 1e3 * snapshots.ball_displacement[:, first] - gap)
        if j == first:
            inside[1] = np.minimum(inside[1], 1e3 * snapshots.ball_displacement[:, second] + gap)
    place = name_at(film.response.system, pair) or "beam at the box"
    if np.isfinite(inside).all():
        axis.fill_between(time, *inside, color="#e6eaee", label="free space" if len(names) > 1 else "between the walls")
    axis.plot(time, wall, color=BEAM_COLOUR, label=place if len(balls) == 1 else "beam at the box")
    axis.plot(time, ball, color=BLUE, label=pair.name if len(balls) == 1 else "ball")
    if pair.kind != "absorber":
        at = impacts.time[np.isin(impacts.impactor, names) & (impacts.time >= time[0]) & (impacts.time <= time[-1])]
        axis.plot(at, np.interp(at, time, ball), "o", color=ORANGE, markersize=5.0, label="impact")
    if len(balls) > 1:
        # beside the axes, where no curve is
        axis.text(1.005, 0.5, pair.name, transform=axis.transAxes, rotation=90.0, ha="left", va="center", color=GREY)


def _plane_views(figure: Any, film: Film) -> list[Draw]:
    """Axes of the beam, and of the close-up where there is a ball."""
    s, contacts = film.scene.exaggeration, film.response.system.balls
    axis = figure.add_axes((0.065, 0.435, 0.5 if contacts else 0.915, 0.435))
    middle, half = _ends(film.scene, film.structure.beam.length)
    reach = _reach(film.scene, map(film.moved, range(film.chosen.size)))
    _fit(axis, 1e3 * middle, 1e3 * half, 1.05e3 * reach, s, "relative to the base (mm)")
    views = [_moving_parts(axis, film.scene, contacts, film.moved, film.touched)]
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
        views.append(_moving_parts(close, film.scene, contacts, partial(film.moved, follow=j), film.touched))
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


def _moving_parts(
    axis: Any,
    scene: Scene,
    balls: Sequence[Contact],
    moved: Callable[[int], NDArray[np.float64]],  # points (points, 3), m, of a frame
    touched: NDArray[np.int64],  # (frames, contacts) as of a film
) -> Draw:
    """Beam, boxes and balls in the plane of motion."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Circle

    parts = list(zip(scene.bodies, scene.first, strict=True))
    faces, owners = [], []
    for part in DRAWN:
        for body, first in parts:
            if body.part == part:
                own = [first + face for face in _faces(body)]
                faces += own
                owners += [body] * len(own)
    corners = np.array(faces)
    widths = [LINE if body.part == CONNECTION else EDGE for body in owners]
    collection = PolyCollection([], linewidths=widths, joinstyle="round", animated=True)
    axis.add_collection(collection, autolim=False)
    spheres = [slice(first, first + len(body.points)) for body, first in parts if body.part == BALL]
    circles = [
        axis.add_patch(Circle((1e3 * pair.position, 0.0), 1e3 * ball_radius(pair.mass), animated=True))
        for pair in balls
    ]

    def draw(i: int) -> None:
        places, sides = 1e3 * moved(i)[:, :2], touched[i]
        colours = [ORANGE if one.side and sides[one.pair] == one.side else _colour(one) for one in owners]
        # the floor has the edge of a box, so that it is around its ball
        edges = [DRAWN[BOX] if _is_floor(one) else colour for one, colour in zip(owners, colours, strict=True)]
        collection.set(verts=places[corners], facecolors=colours, edgecolors=edges)
        axis.draw_artist(collection)
        for j, (circle, points) in enumerate(zip(circles, spheres, strict=True)):
            circle.set_center((1e3 * balls[j].position, float(places[points, 1].mean())))
            circle.set_color(ORANGE if sides[j] else BLUE)
            axis.draw_artist(circle)

    return draw


def _faces(body: Body) -> list[Any]:
    """Points of what is drawn of a body: quadrilaterals in the plane of motion, and lines there and back."""
    if body.part == BEAM:
        # between the lowest and the highest point of neighbouring sections
        size = np.count_nonzero(body.points[:, 0] == body.points[0, 0])
        low, high = int(body.points[:size, 1].argmin()), int(body.points[:size, 1].argmax())
        first = np.arange(0, len(body.points) - size, size)[:, None]
        return list(first + np.array([low, high, size + high, size + low]))
    if body.part == CONNECTION:
        return [np.array(cell)[[0, 1, 1, 0]] for _, cell in body.cells]
    return [np.arange(4)]


def _colour(body: Body) -> str:
    return FLOOR if _is_floor(body) else DRAWN[body.part]


def _is_floor(body: Body) -> bool:
    return body.part == BOX and body.side == 0
