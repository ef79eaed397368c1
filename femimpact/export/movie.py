"""A slow-motion movie in which the beam swings and the ball meets its walls, by VTK or by matplotlib alone."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import choice, instance, optional, quantity, require, takes
from femimpact.excitation.excitation import words_of
from femimpact.export.files import atomic_path, file_path
from femimpact.export.scene import EXAGGERATION, build_scene, snapshots_of, thinned
from femimpact.export.sheet import HEIGHT, VIEWS, WIDTH, Film, sheets
from femimpact.export.solid_views import solid_views
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.structure.structure import Structure

__all__ = ["gl_window", "write_movie"]

MOST_FPS = 1000
"""Frames per second; a GIF counts milliseconds."""

SWING = 0.08
"""Share of the beam's length that swing and gap fill when the exaggeration is chosen here."""

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
window.SetMultiSamples(4)
window.SwapBuffersOff()
window.AddRenderer(renderer)
window.Render()
pixels = common.vtkUnsignedCharArray()
window.GetRGBACharPixelData(0, 0, 63, 47, 0, pixels)
low, high = pixels.GetRange(-1)
print('drawn' if low < high else 'blank')
"""

WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"
"""Environment variable by which VTK chooses its window class."""


def gl_window() -> str | None:
    """The window class with which VTK can render off screen here, or None; the user's own choice is tried first.

    Tried in a child process: without a GL library VTK does not raise, it ends the process.
    """
    own = os.environ.get(WINDOW)
    return _probed((*([own] if own else []), "vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"))


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
        "pyvista" draws in three dimensions, by the VTK that comes with it, "matplotlib" in the plane of motion; "auto"
        takes the first where a child process could draw by it.

    Returns
    -------
    Path
        Of the file that was written, which may end in `.gif`.

    Raises
    ------
    InputError
        If the response holds no snapshots, an argument is out of range, or the path cannot be written.
    """
    file = file_path(path)
    film = _film(response, structure, exaggeration, fps, most)
    window = gl_window() if renderer != "matplotlib" else None
    require(renderer != "pyvista" or window is not None, "renderer", renderer, "", "cannot render here (no GL library)")
    return _encode(file, _vtk_frames(film, window) if window else _matplotlib_frames(film), fps)


def _film(response: Response, structure: Structure, exaggeration: float | None, fps: int, most: int) -> Film:
    snapshots = snapshots_of(response)
    if exaggeration is None:
        reach = float(np.abs(snapshots.displacement[:, 0::2]).max())
        reach += max((max(pair.gaps) for pair in response.system.balls), default=0.0)
        exaggeration = float(f"{SWING * structure.beam.length / max(reach, 1e-12):.1g}")
    chosen = thinned(snapshots.time.size, most)
    shown = float(snapshots.time[chosen[-1]] - snapshots.time[chosen[0]])
    slow = f"   Slowed {(chosen.size - 1) / fps / shown:.2g} times." if shown > 0.0 else ""
    words = words_of(response.base)
    is_sine = math.isfinite(response.base.phase) and getattr(response.base, "at", None) is None
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
            if _frames_in(temporary) != count:
                raise RuntimeError(f"{path.name}: ffmpeg did not write all of its {count} frames")
        return path
    from PIL import Image

    path = path.with_suffix(".gif")
    small = (WIDTH // 2, HEIGHT // 2)
    pictures = [Image.fromarray(frame[..., :3]).resize(small).quantize(64) for frame in frames]
    with atomic_path(path) as temporary:
        pictures[0].save(temporary, save_all=True, append_images=pictures[1:], duration=1000 // fps, loop=0)
    return path


def _frames_in(path: Path) -> int:
    """Frames of an MP4 by its table of their sizes (ISO/IEC 14496-12, 8.7.3), which is written last; 0 without one."""
    data = path.read_bytes()
    table = data.rfind(b"stsz")
    # after the name a version and the size that all have
    return int.from_bytes(data[table + 12 : table + 16], "big") if table >= 0 else 0


def _matplotlib_frames(film: Film) -> Iterator[NDArray[np.uint8]]:
    """Both views seen from above, along z; works without any GL library."""
    draw = sheets(film, plane=True)
    return (draw(i) for i in range(film.chosen.size))


def _vtk_frames(film: Film, window: str) -> Iterator[NDArray[np.uint8]]:
    """Both views in three dimensions, pasted into the sheet."""
    draw, balls = sheets(film, plane=False), len(film.response.system.balls)
    with _window(window):
        views = solid_views(film)
    with closing(views):
        for i, placed in enumerate(views):
            picture = draw(i)
            for rows, columns, pixels in placed:
                picture[rows, columns] = pixels
            for j in range(balls):
                edge = WIDTH // 2 + j * WIDTH // (2 * balls)
                picture[VIEWS, edge - 1 : edge + 1] = 205
            yield picture
