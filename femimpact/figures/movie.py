"""A slow-motion movie in which the beam swings and the ball meets its walls, drawn by matplotlib."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import thinned
from femimpact.errors import instance, optional, quantity, takes
from femimpact.excitation.excitation import words_of
from femimpact.figures.sheet import HEIGHT, WIDTH, Film, sheets
from femimpact.files import atomic_path, target_path
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.scene.scene import EXAGGERATION, build_scene, chosen_exaggeration, snapshots_of
from femimpact.structure.structure import Structure
from femimpact.units import number_text

__all__ = ["write_movie"]

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
        At most so many frames, evenly thinned.

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


def _film(response: Response, structure: Structure, exaggeration: float | None, fps: int, most: int) -> Film:
    snapshots = snapshots_of(response)
    if exaggeration is None:
        balls = response.system.balls
        hung = snapshots.ball_displacement[:, [not pair.has_walls for pair in balls]]
        exaggeration = chosen_exaggeration(np.hstack([snapshots.displacement[:, 0::2], hung]), structure, balls)
    chosen = thinned(snapshots.time.size, most)
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
