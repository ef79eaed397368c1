"""A slow-motion movie in which the beam swings and the ball meets its walls, by pyvista or by matplotlib alone."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import thinned
from femimpact.errors import choice, instance, optional, quantity, require, takes
from femimpact.excitation.excitation import words_of
from femimpact.figures.drawing import BLUE, DARK, ORANGE
from femimpact.figures.sheet import BODY_COLOUR, HEIGHT, VIEWS, WIDTH, Film, sheets
from femimpact.files import atomic_path, target_path
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.scene.placed import ball_radius, placed_structure
from femimpact.scene.scene import (
    BALL,
    BEAM,
    BODY,
    BOX,
    CONNECTION,
    EXAGGERATION,
    build_scene,
    chosen_exaggeration,
    snapshots_of,
)
from femimpact.structure.structure import Structure
from femimpact.units import number_text

__all__ = ["gl_window", "write_movie"]

MOST_FPS = 1000
"""Frames per second; a GIF counts milliseconds."""

PROBE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules import vtkCommonCore as common, vtkFiltersSources as sources, vtkRenderingCore as core
mapper, actor, renderer, window = core.vtkPolyDataMapper(), core.vtkActor(), core.vtkRenderer(), core.vtkRenderWindow()
ball = sources.vtkSphereSource()
mapper.SetInputConnection(ball.GetOutputPort())
actor.SetMapper(mapper)
renderer.AddActor(actor)
window.SetOffScreenRendering(1)
window.SetSize(64, 48)
window.AddRenderer(renderer)
window.Render()
pixels = common.vtkUnsignedCharArray()
window.GetPixelData(0, 0, 63, 47, 1, pixels, 0)
low, high = pixels.GetRange(-1)
print('drawn' if low < high else 'blank')
"""
"""VTK alone, which loads in a third of the time of pyvista."""


WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"
"""Environment variable by which VTK chooses its window class."""


def gl_window() -> str | None:
    """The window class with which VTK can render off screen here, or None; that of the environment is tried first.

    Tried in a child process: without a GL library VTK does not raise, it ends the process.
    """
    chosen = os.environ.get(WINDOW)
    return _probed((*([chosen] if chosen else []), "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"))


@cache
def _probed(names: tuple[str, ...]) -> str | None:
    """The first of several window classes that draws."""
    for name in names:
        # without -P a pyvista.py of the current directory would be run
        command = [sys.executable, "-P", "-c", PROBE]
        with suppress(subprocess.TimeoutExpired):
            probe = subprocess.run(command, env={**os.environ, WINDOW: name}, capture_output=True, timeout=60)
            if probe.returncode == 0 and b"drawn" in probe.stdout:
                return name
    return None


@contextmanager
def _window(name: str) -> Iterator[None]:
    """The environment in which VTK makes windows of that class: what was probed is what is used."""
    before = os.environ.get(WINDOW)
    os.environ[WINDOW] = name
    try:
        yield
    finally:
        os.environ.pop(WINDOW)
        if before is not None:
            os.environ[WINDOW] = before


@takes(
    response=instance(Response), structure=instance(Structure), exaggeration=optional(EXAGGERATION),
    fps=quantity("1/s", at_least=1, at_most=MOST_FPS, integer=True),
    most=quantity("frames", at_least=1, integer=True), renderer=choice("auto", "pyvista", "matplotlib"),
)  # fmt: skip
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
        Scales the motion and the clearance together; chosen so that both fill about 8 %
        of the beam's length when None. The factor stands in the picture.
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

    Raises
    ------
    InputError
        If the response holds no snapshots, or the path cannot be written.

    Examples
    --------
    >>> import femimpact as fi
    >>> record = fi.Recorder(channels=("tip",), snapshots=4)
    >>> run = fi.integrate(system, fi.Sine(1e-4, 5.0), fi.Newmark(1e-4), 0.1, record)
    >>> fi.write_movie("run.gif", run, structure)  # doctest: +SKIP
    """
    file = target_path(path)
    film = _film(response, structure, exaggeration, fps, most)
    window = gl_window() if renderer != "matplotlib" else None
    require(renderer != "pyvista" or window is not None, "renderer", renderer, "", "cannot render here (no GL library)")
    return _encode(file, _pyvista_frames(film, window) if window else _matplotlib_frames(film), fps)


def _film(response: Response, structure: Structure, exaggeration: float | None, fps: int, most: int) -> Film:
    snapshots = snapshots_of(response)
    if exaggeration is None:
        balls = response.system.balls
        hung = snapshots.ball_displacement[:, [not pair.has_walls for pair in balls]]
        exaggeration = chosen_exaggeration(np.hstack([snapshots.displacement[:, 0::2], hung]), structure, balls)
    chosen = thinned(snapshots.time.size, most)
    shown = float(snapshots.time[chosen[-1]] - snapshots.time[chosen[0]])
    slow = f"   Slowed {number_text((chosen.size - 1) / fps / shown, 2)} times." if shown > 0.0 else ""
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
        mine = response.impacts.impactor == pair.name
        start, side = response.impacts.time[mine], response.impacts.side[mine]
        last = np.searchsorted(start, times, side="right")
        recent = last > np.searchsorted(start, earlier, side="right")
        touched[recent, j] = side[last[recent] - 1]
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


def _matplotlib_frames(film: Film) -> Iterator[NDArray[np.uint8]]:
    """Both views seen from above, along z; works without any GL library."""
    draw = sheets(film, plane=True)
    return (draw(i) for i in range(film.chosen.size))


def _pyvista_frames(film: Film, window: str) -> Iterator[NDArray[np.uint8]]:
    """Both views in three dimensions, pasted into the sheet."""
    import pyvista

    draw, balls, height = sheets(film, plane=False), len(film.response.system.balls), VIEWS.stop - VIEWS.start
    # the beam on the left half, the balls on the right one
    layout: Any = {"shape": (1, 1 + balls), "col_weights": [max(balls, 1), *balls * [1]], "border": False}
    with _window(window):
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=[WIDTH, height], **layout)
    plotter.render_window.SetMultiSamples(4)
    # nothing is shown: a swap takes as long as all the rest
    plotter.render_window.SwapBuffersOff()
    plotter.set_background("white")
    pieces, actors = _pieces(film), []
    for view in range(1 + balls):
        plotter.subplot(0, view)
        actors.append([plotter.add_mesh(mesh, **style) for mesh, _, style, _ in pieces])
        for block in _supports(film):
            plotter.add_mesh(block, color=DARK)
        _aim(plotter, film, view - 1)
    try:
        for i in range(film.chosen.size):
            moved = film.moved(i)
            for k, (mesh, source, style, contact) in enumerate(pieces):
                mesh.points = moved[source]
                touches = contact is not None and film.touches(i, *contact)
                for scene in actors:
                    scene[k].prop.color = ORANGE if touches else style["color"]
            _follow_boxes(plotter, film, i)
            picture = draw(i)
            picture[VIEWS] = _pixels(plotter, height)
            for j in range(balls):
                edge = WIDTH // 2 + j * WIDTH // (2 * balls)
                picture[VIEWS, edge - 1 : edge + 1] = 205
            yield picture
    finally:
        plotter.close()


TILT = (0.0, -0.4, 1.0)
"""Vector (m) from the focal point to the camera: above it, a little towards the - side; the beam at rest is level."""


def _pieces(film: Film) -> list[tuple[Any, NDArray[np.intp], dict[str, Any], tuple[int, int] | None]]:
    """Meshes to draw: each with its point numbers, its style, and the contact (pair, side or 0) that colours it."""
    import pyvista

    scene = film.scene
    cells = [np.concatenate([[cell.size], cell]) for cell in np.split(scene.connectivity, scene.offsets[:-1])]
    grid = pyvista.UnstructuredGrid(np.concatenate(cells), scene.types, scene.points.copy())
    shiny = {"color": BLUE, "smooth_shading": True, "ambient": 0.25, "specular": 0.4, "specular_power": 20.0}
    plan: list[tuple[NDArray[np.intp], dict[str, Any], tuple[int, int] | None]]
    plan = [(np.flatnonzero(scene.part == BEAM), {"color": "#a3acb6", "ambient": 0.4}, None)]
    plan += [(body, {"color": BODY_COLOUR}, None) for body in np.flatnonzero(scene.part == BODY)[:, None]]
    for j in range(len(film.response.system.balls)):
        if film.response.system.balls[j].has_walls:
            plus, minus, floor = np.flatnonzero((scene.part == BOX) & (scene.pair == j))[:, None]
            plan.append((plus, {"color": "#7b8a9a", "ambient": 0.4}, (j, 1)))
            plan.append((minus, {"color": "#7b8a9a", "ambient": 0.4}, (j, -1)))
            plan.append((floor, {"color": "#c3ced9"}, None))
        else:
            line = np.flatnonzero((scene.part == CONNECTION) & (scene.pair == j))
            plan.append((line, {"color": DARK, "line_width": 3.0}, None))
        plan.append((np.flatnonzero((scene.part == BALL) & (scene.pair == j)), shiny, (j, 0)))
    plan += [(np.array([cell]), {"color": DARK, "ambient": 0.4}, (j, side)) for cell, j, side in film.stops()]
    pieces = []
    for chosen, style, contact in plan:
        solid: Any = grid.extract_cells(chosen.tolist())
        # that of a solid would be looked for at each frame; newer versions warn of another default, which does as well
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            surface = solid.extract_surface()
        source = solid.point_data["vtkOriginalPointIds"][surface.point_data["vtkOriginalPointIds"]]
        pieces.append((surface, np.asarray(source), style, contact))
    return pieces


def _pixels(plotter: Any, height: int) -> NDArray[np.uint8]:
    """The window drawn anew, (height, WIDTH, 4)."""
    from pyvista import convert_array
    from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

    window, pixels = plotter.render_window, vtkUnsignedCharArray()
    window.Render()
    window.GetRGBACharPixelData(0, 0, WIDTH - 1, height - 1, 0, pixels)
    # rows from below
    return np.asarray(convert_array(pixels)).reshape(height, WIDTH, 4)[::-1]


def _supports(film: Film) -> list[Any]:
    """A block where the beam is held."""
    import pyvista

    length, width = film.structure.beam.length, film.structure.beam.drawn_at(0.0)[0]
    size: dict[str, Any] = {"x_length": 0.02 * length, "y_length": 0.1 * length, "z_length": 1.2 * width}
    shift = {0.0: -0.01 * length, length: 0.01 * length}
    supports = placed_structure(film.structure, film.response.system).supports
    return [pyvista.Cube(center=(x + shift.get(x, 0.0), 0.0, 0.0), **size) for _, x in supports]


def _follow_boxes(plotter: Any, film: Film, i: int) -> None:
    """Move the camera of each close-up with its box to frame i."""
    for j in range(len(film.response.system.balls)):
        camera = plotter.renderers[1 + j].camera
        x, _, z = camera.focal_point
        y = film.scene.exaggeration * film.at_pair(j)[film.chosen[i]]
        camera.focal_point = (x, y, z)
        camera.position = (x, y + TILT[1], z + TILT[2])


def _aim(plotter: Any, film: Film, j: int) -> None:
    """Point the camera of a view, of the beam (-1) or of a ball, and choose its scale.

    A parallel projection, so that lengths stay lengths.
    """
    balls = film.response.system.balls
    aspect = (1 + (not balls)) * 0.5 * WIDTH / (VIEWS.stop - VIEWS.start)
    upright = 1.0 / np.hypot(1.0, TILT[1])
    if j >= 0:
        pair, radius = balls[j], ball_radius(balls[j].mass)
        height = 0.5 * film.structure.beam.drawn_at(pair.position)[0] + 1.3 * radius
        target = (pair.position, 0.0, height)
        high = upright * (film.scene.exaggeration * film.room(j) + 2.2 * radius)
        scale = max(high, 1.6 * radius * len(balls) / aspect)
    else:
        middle, half = film.ends(-0.06, 1.06)
        target = (middle, 0.0, 0.25 * film.structure.beam.drawn_at(0.0)[0])
        scale = max(upright * 1.08 * film.reach, half / aspect)
    plotter.enable_parallel_projection()
    plotter.camera.focal_point = target
    plotter.camera.position = tuple(np.add(target, TILT))
    plotter.camera.up = (0.0, 1.0, 0.0)
    plotter.camera.parallel_scale = scale
    plotter.camera.clipping_range = (0.1, 3.0)
