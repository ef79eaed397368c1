"""Movies: the right number of frames, by either renderer, and a GIF where MP4 cannot be written."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import femimpact as fi
from femimpact.export import movie


@pytest.fixture(scope="module")
def response(small):
    record = fi.Recorder(channels=("tip",), every=100, snapshots=200, snapshots_start=2.85)
    base = fi.Sine(amplitude=0.2037e-3, frequency=4.9)
    return fi.integrate(small, base, fi.Newmark(dt=fi.recommended_step(small)), duration=3.0, record=record)


@pytest.mark.parametrize("renderer", ["matplotlib", "pyvista"])
def test_movie_has_a_frame_for_every_snapshot(tmp_path, response, reference, renderer):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    if renderer == "pyvista" and movie.gl_window() is None:
        pytest.skip("VTK cannot render here")
    path = movie.write_movie(tmp_path / "deflection.mp4", response, reference, renderer=renderer)
    assert path.name == "deflection.mp4"
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert frames == response.snapshots.time.size
    assert seconds == pytest.approx(frames / 25, abs=0.05)
    pictures = imageio_ffmpeg.read_frames(str(path))
    size = next(pictures)["size"]
    arrays = [np.frombuffer(picture, dtype=np.uint8).reshape(size[1], size[0], 3).astype(int) for picture in pictures]
    # the beam and the ball move: the upper picture changes between frames, and is not blank
    view = [array[: movie.VIEW] for array in arrays]
    assert np.ptp(view[0]) > 100
    assert np.abs(view[0] - view[-1]).max() > 50
    assert [entry.name for entry in tmp_path.iterdir()] == ["deflection.mp4"]


def test_gif_where_ffmpeg_is_missing(tmp_path, response, reference, monkeypatch):
    from PIL import Image

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    path = movie.write_movie(tmp_path / "deflection.mp4", response, reference, renderer="matplotlib", most=4)
    assert path.name == "deflection.gif"
    with Image.open(path) as picture:
        assert picture.n_frames == 4


def test_a_hit_is_shown_though_it_is_shorter_than_a_frame(small, reference):
    record = fi.Recorder(channels=("tip",), every=100, snapshots=100)
    method = fi.Newmark(dt=fi.recommended_step(small))
    response = fi.integrate(small, fi.Sine(amplitude=0.2037e-3, frequency=4.9), method, duration=3.0, record=record)
    times = response.snapshots.time
    touching = movie._touching(response, response.snapshots, np.arange(times.size))[:, 0]
    for hit in response.impacts.time[response.impacts.time < times[-2]]:
        assert touching[np.searchsorted(times, hit)]
    # and not all the time: before the first impact nothing is coloured
    assert not touching[times < response.impacts.time[0]].any()


def test_automatic_exaggeration_keeps_ball_and_beam_in_the_picture(response, reference):
    reach = np.abs(response.snapshots.displacement[:, 0::2]).max() + 4e-3
    film = {}

    def spy(structure, system, exaggeration):
        film["exaggeration"] = exaggeration
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(movie, "build_scene", spy)
        with pytest.raises(KeyboardInterrupt):
            movie.write_movie("never.mp4", response, reference)
    # one significant digit: within a factor 1.5 of 8 % of the beam
    assert film["exaggeration"] * reach == pytest.approx(0.08 * reference.beam.length, rel=0.5)


def test_unknown_renderer_is_refused(tmp_path, response, reference):
    with pytest.raises(fi.InputError, match="renderer = 'gl': must be one of auto, pyvista, matplotlib"):
        movie.write_movie(tmp_path / "a.mp4", response, reference, renderer="gl")
