"""A movie in which the beam swings and the ball hits its walls: pyvista where it can render, else matplotlib."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.export.figures import BLUE, GREY, ORANGE, STYLE
from femimpact.export.files import atomic_path
from femimpact.export.scene import BALL, BEAM, BOX, Scene, ball_radius, build_scene, snapshots_of
from femimpact.response import Response, Snapshots
from femimpact.structure import Structure
from femimpact.system import hermite_rows

__all__ = ["gl_window", "write_movie"]

WIDTH, STRIP, VIEW = 1280, 272, 448
"""Frame width, height of the time strip and of the pictures above it, pixels: multiples of 16."""
AT_REST = "#8a8a8a"
SWING = 0.08
"""Share of the beam's length that swing and clearance fill when the exaggeration is chosen here."""

PROBE = (
    "import pyvista as pv; p = pv.Plotter(off_screen=True, window_size=(64, 48)); p.add_mesh(pv.Sphere()); "
    "a = p.screenshot(None, return_img=True); print('drawn' if a.min() < a.max() else 'blank')"
)


@cache
def gl_window() -> str | None:
    """The window class with which VTK can render off screen here, or None.

    Tried in a child process: without a GL library VTK does not raise, it ends the process.
    """
    for name in ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"):
        environment = {**os.environ, "VTK_DEFAULT_OPENGL_WINDOW": name}
        with suppress(subprocess.TimeoutExpired):
            probe = subprocess.run([sys.executable, "-c", PROBE], env=environment, capture_output=True, timeout=60)
            if probe.returncode == 0 and b"drawn" in probe.stdout:
                return name
    return None


@dataclass(frozen=True, eq=False)
class _Film:
    """What every renderer needs: the chosen snapshots, the scene and the words."""

    response: Response
    structure: Structure
    snapshots: Snapshots
    chosen: NDArray[Any]
    scene: Scene
    exaggeration: float
    caption: str
    touching: NDArray[Any]  # (frames, balls)


def write_movie(
    path: str | Path,
    response: Response,
    structure: Structure,
    exaggeration: float | None = None,
    fps: int = 25,
    most: int = 250,
    renderer: str = "auto",
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
        Scales the motion and the clearance together; chosen so that both fill 8 % of the
        beam's length when None. The factor stands in the picture.
    fps : int
        Frames per second.
    most : int
        At most so many frames, evenly thinned.
    renderer : {"auto", "pyvista", "matplotlib"}
        "auto" takes pyvista where a child process could render with it.

    Returns
    -------
    Path
        Of the file that was written, which may end in `.gif`.
    """
    snapshots = snapshots_of(response)
    names = ("auto", "pyvista", "matplotlib")
    require(renderer in names, "renderer", renderer, "", f"must be one of {', '.join(names)}")
    positive = exaggeration is None or 0.0 < exaggeration < np.inf
    require(positive, "exaggeration", exaggeration, "1", "must be a finite number > 0")
    if exaggeration is None:
        reach = float(np.max(np.abs(snapshots.displacement[:, 0::2])))
        reach += max((max(pair.gaps) for pair in response.system.contacts), default=0.0)
        exaggeration = float(f"{max(SWING * structure.beam.length / max(reach, 1e-12), 1e-3):.1g}")
    chosen = np.unique(np.linspace(0, snapshots.time.size - 1, min(most, snapshots.time.size)).round().astype(int))
    shown = float(snapshots.time[chosen[-1]] - snapshots.time[chosen[0]])
    slow = chosen.size / fps / shown if shown > 0.0 else 1.0
    film = _Film(
        response,
        structure,
        snapshots,
        chosen,
        build_scene(structure, response.system, exaggeration),
        exaggeration,
        f"base {response.base.frequency:.4g} Hz, {1e3 * response.base.amplitude:.4g} mm;  motion and clearance x "
        f"{exaggeration:g};  slowed {slow:.3g} times",
        _touching(response, snapshots, chosen),
    )
    window = gl_window() if renderer != "matplotlib" else None
    require(renderer != "pyvista" or window is not None, "renderer", renderer, "", "cannot render here (no GL library)")
    frames = _pyvista_frames(film, window) if window else _matplotlib_frames(film)
    return _encode(Path(path), frames, fps)


def _touching(response: Response, snapshots: Snapshots, chosen: NDArray[Any]) -> NDArray[Any]:
    """Whether each ball touches at a frame, or has since the frame before the last: a hit is shorter than a frame."""
    touching = snapshots.contact_force[chosen] != 0.0
    earlier = snapshots.time[np.maximum(chosen - 2 * int(np.diff(chosen, append=chosen[-1] + 1)[0]), 0)]
    for j, pair in enumerate(response.system.contacts):
        hits = response.impacts.time[response.impacts.impactor == pair.name]
        first = np.searchsorted(hits, earlier)
        touching[:, j] |= np.searchsorted(hits, snapshots.time[chosen], side="right") > first
    return np.asarray(touching)


# ---- files ----------------------------------------------------------------------------------------


def _encode(path: Path, frames: Iterator[NDArray[Any]], fps: int) -> Path:
    try:
        import imageio_ffmpeg
    except ImportError:
        imageio_ffmpeg = None
    if path.suffix == ".mp4" and imageio_ffmpeg is not None:
        with atomic_path(path) as temporary:
            size = (WIDTH, VIEW + STRIP)
            writer = imageio_ffmpeg.write_frames(str(temporary), size, fps=fps, quality=7, macro_block_size=16)
            writer.send(None)
            try:
                for frame in frames:
                    writer.send(np.ascontiguousarray(frame))
            finally:
                writer.close()
        return path
    from PIL import Image

    path = path.with_suffix(".gif")
    pictures = [Image.fromarray(frame).resize((WIDTH // 2, (VIEW + STRIP) // 2)).quantize(64) for frame in frames]
    with atomic_path(path) as temporary:
        pictures[0].save(temporary, save_all=True, append_images=pictures[1:], duration=1000 // fps, loop=0)
    return path


# ---- the strip of histories, drawn once; only its marker moves --------------------------------------


@dataclass(frozen=True, eq=False)
class _Strip:
    picture: NDArray[Any]
    columns: NDArray[Any]  # pixel of each chosen time
    rows: tuple[int, int]

    def at(self, i: int) -> NDArray[Any]:
        """The strip with its marker at frame i."""
        picture = self.picture.copy()
        picture[self.rows[0] : self.rows[1], self.columns[i] : self.columns[i] + 2] = (40, 40, 40)
        return picture


def _picture(figure: Any) -> NDArray[Any]:
    """Pixels of a figure, ndarray (height, width, 3) of uint8."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _strip(film: _Film) -> _Strip:
    import matplotlib
    from matplotlib.figure import Figure

    snapshots, system = film.snapshots, film.response.system
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH / 100, STRIP / 100), dpi=100)
        axis = figure.add_axes((0.075, 0.24, 0.90, 0.60))
        if system.contacts:
            pair = system.contacts[0]
            wall = 1e3 * np.asarray(hermite_rows(system.nodes, [pair.position]) @ snapshots.displacement.T)[0]
            ball = 1e3 * snapshots.ball_displacement[:, 0]
            axis.fill_between(
                snapshots.time,
                wall - 1e3 * pair.gaps[1],
                wall + 1e3 * pair.gaps[0],
                color="#e9e9e9",
                label="inside of the box",
            )
            axis.plot(snapshots.time, wall, color=BLUE, label="beam at the box")
            axis.plot(snapshots.time, ball, color=ORANGE, label=pair.name)
            axis.legend(loc="lower left", bbox_to_anchor=(0.0, 0.99), ncols=3, frameon=False, borderaxespad=0.0)
        else:
            axis.plot(snapshots.time, 1e3 * snapshots.displacement[:, -2], color=BLUE)
        axis.set_ylabel("y (mm)")
        axis.set_xlabel("time (s)")
        axis.set_xlim(snapshots.time[0], snapshots.time[-1])
        figure.text(0.975, 0.92, film.caption, ha="right", va="center", color=GREY, fontsize=10.5)
        picture = _picture(figure)
    pixels = axis.transData.transform([(time, 0.0) for time in snapshots.time[film.chosen]])[:, 0]
    low, high = (int(STRIP - y) for y in axis.transAxes.transform([(0.0, 0.0), (0.0, 1.0)])[:, 1])
    return _Strip(picture, np.clip(pixels.round().astype(int), 0, WIDTH - 2), (high, low))


# ---- pyvista ----------------------------------------------------------------------------------------


def _pyvista_frames(film: _Film, window: str) -> Iterator[NDArray[Any]]:
    """Beam and box in three dimensions: the whole on the left, a close-up of the box on the right."""
    # VTK reads its choice of window from the environment
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", window)
    import pyvista

    scene, strip = film.scene, _strip(film)
    pairs = film.response.system.contacts
    plotter: Any = pyvista.Plotter(
        off_screen=True, window_size=[WIDTH, VIEW], shape=(1, 2) if pairs else (1, 1), border=False
    )
    plotter.set_background("white")
    plotter.disable_anti_aliasing()
    plotter.render_window.SetMultiSamples(4)
    whole: Any = pyvista.UnstructuredGrid(_with_sizes(scene), scene.types, scene.points.copy())
    bent = {part: whole.extract_cells(np.flatnonzero(scene.part == part)) for part in (BEAM, BOX) if part in scene.part}
    sources = {part: np.asarray(grid.point_data["vtkOriginalPointIds"]) for part, grid in bent.items()}
    balls: list[tuple[int, Any]] = []
    for column in range(2 if pairs else 1):
        plotter.subplot(0, column)
        for part, grid in bent.items():
            look = {"color": "#b9c4cf"} if part == BEAM else {"color": "#56B4E9", "opacity": 0.75}
            plotter.add_mesh(grid, ambient=0.35, **look)
        for j in range(len(pairs)):
            sphere = whole.extract_cells(np.flatnonzero((scene.part == BALL) & (scene.pair == j)))
            balls.append((j, plotter.add_mesh(sphere, color=AT_REST, smooth_shading=True, specular=0.4)))
        _aim(plotter, film, close=column == 1)
    try:
        plotter.show(auto_close=False)
        for i, k in enumerate(film.chosen):
            moved = scene.points + scene.displacement(film.snapshots, int(k))
            for part, grid in bent.items():
                grid.points = moved[sources[part]]
            for j, ball in balls:
                ball.position = (0.0, film.exaggeration * film.snapshots.ball_displacement[k, j], 0.0)
                ball.prop.color = ORANGE if film.touching[i, j] else AT_REST
            plotter.render()
            picture = plotter.image
            yield np.vstack([picture[:VIEW, :WIDTH, :3], strip.at(i)])
    finally:
        plotter.close()


def _with_sizes(scene: Scene) -> NDArray[Any]:
    """Cells as pyvista wants them: each preceded by its number of points."""
    starts = np.concatenate([[0], scene.offsets[:-1]])
    return np.insert(scene.connectivity, starts, np.diff(np.append(starts, scene.connectivity.size)))


def _aim(plotter: Any, film: _Film, close: bool) -> None:
    """Look along the beam's width, a little from the side, so that the swing and the gap are seen."""
    length = film.structure.beam.length
    if close:
        pair = film.response.system.contacts[0]
        radius = ball_radius(pair.mass)
        reach = film.exaggeration * (max(pair.gaps) + _swing(film)) + 2.2 * radius
        target = (pair.position, 0.0, 0.0)
        plotter.add_text(f"{pair.name} and its box", position="upper_left", font_size=9, color="black")
    else:
        reach = 0.42 * length
        target = (0.5 * length, 0.0, 0.0)
        plotter.add_text("beam", position="upper_left", font_size=9, color="black")
    plotter.enable_parallel_projection()
    plotter.camera.focal_point = target
    plotter.camera.position = (target[0] - 0.25 * length, -0.35 * length, length)
    plotter.camera.up = (0.0, 1.0, 0.0)
    plotter.camera.parallel_scale = reach
    plotter.camera.clipping_range = (0.01 * length, 10.0 * length)


def _swing(film: _Film) -> float:
    """Largest deflection (m) of the axis in the film."""
    return float(np.max(np.abs(film.snapshots.displacement[film.chosen][:, 0::2])))


# ---- matplotlib -------------------------------------------------------------------------------------


def _matplotlib_frames(film: _Film) -> Iterator[NDArray[Any]]:
    """The same two views seen along z, in two dimensions; works without any GL library."""
    import matplotlib
    from matplotlib.figure import Figure

    strip, system, s = _strip(film), film.response.system, film.exaggeration
    x = np.linspace(0.0, film.structure.beam.length, 160)
    curves = s * 1e3 * np.asarray(hermite_rows(system.nodes, x) @ film.snapshots.displacement.T)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH / 100, VIEW / 100), dpi=100)
        has_ball = bool(system.contacts)
        axis = figure.add_axes((0.075, 0.14, 0.50 if has_ball else 0.9, 0.78))
        reach = max(1.15 * float(np.abs(curves).max()), 1e-3)
        (beam,) = axis.plot([], [], color=BLUE, linewidth=3.0)
        axis.plot([0.0, 0.0], [-0.5 * reach, 0.5 * reach], color="black", linewidth=5.0)
        axis.set_xlim(-4.0, 1.06e3 * x[-1])
        axis.set_xlabel("distance from the root (mm)")
        axis.set_ylabel(f"displacement x {s:g} (mm)")
        close = _CloseUp(figure, film, reach) if has_ball else None
        if close is not None:
            reach = max(reach, close.reach)
            axis.plot([1e3 * close.position], [0.0], alpha=0.0)
        axis.set_ylim(-reach, reach)
        for i, k in enumerate(film.chosen):
            beam.set_data(1e3 * x, curves[:, k])
            if close is not None:
                close.draw(i, int(k))
            yield np.vstack([_picture(figure), strip.at(i)])


class _CloseUp:
    """The box with both walls and the ball, moving with the beam."""

    def __init__(self, figure: Any, film: _Film, reach: float) -> None:
        from matplotlib.patches import Circle, Rectangle

        self.film, self.pair = film, film.response.system.contacts[0]
        s, radius = film.exaggeration, 1e3 * ball_radius(self.pair.mass)
        self.position, self.radius, self.wall = self.pair.position, radius, 0.3 * radius
        plus, minus = (1e3 * s * gap for gap in self.pair.gaps)
        self.reach = reach + max(plus, minus) + 1.5 * radius
        row = hermite_rows(film.response.system.nodes, [self.pair.position])
        self.w = 1e3 * s * np.asarray(row @ film.snapshots.displacement.T)[0]
        self.y = 1e3 * s * film.snapshots.ball_displacement[:, 0]
        axis = figure.add_axes((0.645, 0.14, 0.33, 0.78))
        # the same scale both ways keeps the ball round
        across = self.reach * (0.33 * WIDTH) / (0.78 * VIEW)
        axis.set_xlim(-across, across)
        axis.set_ylim(-self.reach, self.reach)
        axis.set_xticks([])
        axis.set_yticks([])
        axis.spines[:].set_visible(False)
        axis.grid(False)
        axis.set_title(f"{self.pair.name} and its box, coloured in contact", loc="left")
        self.offsets = (plus + radius, -minus - radius - self.wall)
        self.walls = [
            axis.add_patch(Rectangle((-1.3 * radius, 0.0), 2.6 * radius, self.wall, color=BLUE)) for _ in self.offsets
        ]
        (self.side,) = axis.plot([], [], color=BLUE, linewidth=1.5)
        self.ball = axis.add_patch(Circle((0.0, 0.0), radius, color=GREY))

    def draw(self, i: int, k: int) -> None:
        """Move walls and ball to snapshot k, frame i."""
        for wall, offset in zip(self.walls, self.offsets, strict=True):
            wall.set_y(self.w[k] + offset)
        self.side.set_data([-1.3 * self.radius] * 2, [self.w[k] + self.offsets[1], self.w[k] + self.offsets[0]])
        self.ball.set_center((0.0, self.y[k]))
        self.ball.set_color(ORANGE if self.film.touching[i, 0] else AT_REST)
