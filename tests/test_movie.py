"""Movies: the right number of frames, and a GIF where MP4 cannot be written."""

from __future__ import annotations

import dataclasses
import itertools
import sys
from types import SimpleNamespace
from xml.etree.ElementTree import tostring

import numpy as np
import pytest
from builders import impact_table, reduced
from PIL import Image

import femimpact as fi
from femimpact.app.report.structure_drawing import structure_element
from femimpact.figures import movie
from femimpact.scene.placed import placed_structure
from femimpact.scene.scene import BEAM, STOP


@pytest.fixture(scope="module")
def response(small):
    record = fi.Recorder(channels=("tip",), every=100, snapshots=200, snapshots_start=2.85)
    base = fi.Sine(amplitude=0.2037e-3, frequency=4.9)
    return fi.integrate(small, base, fi.Newmark(dt=fi.recommended_step(small)), duration=3.0, record=record)


def test_movie_has_a_frame_for_every_snapshot(tmp_path, response, reference):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = movie.write_movie(tmp_path / "deflection.mp4", response, reference)
    assert path.name == "deflection.mp4"
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert frames == response.snapshots.time.size
    assert seconds == pytest.approx(frames / 25, abs=0.05)
    pictures = imageio_ffmpeg.read_frames(str(path))
    size = next(pictures)["size"]
    arrays = [np.frombuffer(picture, dtype=np.uint8).reshape(size[1], size[0], 3).astype(int) for picture in pictures]
    # the beam and the ball move: the upper picture changes between frames, and is not blank
    view = [array[movie.VIEWS] for array in arrays]
    assert np.ptp(view[0]) > 100
    assert np.abs(view[0] - view[-1]).max() > 50
    assert [entry.name for entry in tmp_path.iterdir()] == ["deflection.mp4"]


def test_gif_where_ffmpeg_is_missing(tmp_path, response, reference, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    path = movie.write_movie(tmp_path / "deflection.mp4", response, reference, most=4)
    assert path.name == "deflection.gif"
    with Image.open(path) as picture:
        assert picture.n_frames == 4


def frames_of(film):
    """The pictures of a film, one after the other."""
    return map(movie.sheets(film), range(film.chosen.size))


def vermilion(picture):
    """Number of pixels in the two views that have the colour of an impact, near enough for a shaded surface."""
    red, green, blue = np.moveaxis(picture[movie.VIEWS, :, :3].astype(int), -1, 0)
    return np.count_nonzero((red > 120) & (red > 1.7 * green) & (green > 1.7 * blue))


@pytest.fixture(scope="module")
def meeting(small):
    record = fi.Recorder(channels=("tip",), every=100, snapshots=100)
    method = fi.Newmark(dt=fi.recommended_step(small))
    return fi.integrate(small, fi.Sine(amplitude=0.2037e-3, frequency=4.9), method, duration=3.0, record=record)


@pytest.mark.impacts
def test_an_impact_is_coloured_and_nothing_else_is(meeting, reference):
    film = movie._film(meeting, reference, None, 25, meeting.snapshots.time.size)
    struck = film.touched[:, 0] != 0
    shown = np.concatenate([np.flatnonzero(struck)[:3], np.flatnonzero(~struck)[:3]])
    film = dataclasses.replace(film, chosen=film.chosen[shown], touched=film.touched[shown])
    coloured = [vermilion(picture) for picture in frames_of(film)]
    # the ball in the close-up alone is a disc of about 40 pixels radius
    assert min(coloured[:3]) > 4500
    assert coloured[3:] == [0, 0, 0]


def test_the_caption_says_how_much_slower_than_the_motion_the_movie_is(response, reference):
    film = movie._film(response, reference, None, 20, 5)
    times = film.snapshots.time[film.chosen]
    # four intervals between five frames, 20 of them in a second
    slowed = (4 / 20) / (times[-1] - times[0])
    assert f"Slowed {slowed:.2g} times." in film.caption


def test_an_impact_between_two_frames_is_shown_by_the_next_two_and_no_more(small):
    # frames at 0, 0.1, 0.2, ...; nothing is in contact at any of them
    grid = SimpleNamespace(time=np.linspace(0.0, 1.0, 11), contact_force=np.zeros((11, 1)))
    impacts = impact_table(1.0, np.array([0.15, 0.55]), np.array([1, -1]), np.array([0.1, 0.1]))
    run = SimpleNamespace(system=small, impacts=impacts)
    assert movie._touched(run, grid, np.arange(11))[:, 0].tolist() == [0, 0, 1, 1, 0, 0, -1, -1, 0, 0, 0]


@pytest.fixture(scope="module")
def two(reference):
    """A run of two balls, the second one in the middle."""
    second = dataclasses.replace(reference.impactors[0], name="mid ball", at=0.11, gap=1e-3)
    structure = dataclasses.replace(reference, impactors=(*reference.impactors, second))
    system = reduced(structure, modes=4)
    method = fi.Newmark(dt=fi.recommended_step(system))
    return structure, fi.integrate(system, fi.Sine(0.3e-3, 4.9), method, 0.5, fi.Recorder(snapshots=200))


def test_two_balls_have_a_trace_and_a_close_up_each(two):
    structure, response = two
    film = movie._film(response, structure, None, 25, 4)
    film = dataclasses.replace(film, chosen=film.chosen[:2], touched=np.array([[1, 0], [0, -1]]))
    # the right half is the close-up of the one, then that of the other
    for struck, picture in enumerate(frames_of(film)):
        edges = [round(share * movie.WIDTH) for share in (0.63, 0.8, 1.0)]
        coloured = [vermilion(picture[:, a:b]) for a, b in itertools.pairwise(edges)]
        assert coloured[struck] > 1000
        assert coloured[1 - struck] == 0
        # a blue line, and nothing but white at the right edge: no label is cut
        strip = picture[500:650].astype(int)
        for rows in np.array_split(strip, 2):
            assert np.count_nonzero((rows[..., 2] > 120) & (rows[..., 0] < 60)) > 500
        assert picture[470:, -3:].min() == 255


@pytest.mark.impacts
def test_the_side_view_of_a_tube_is_its_diameter_and_that_of_a_section_says_what_is_drawn(reference):
    material = {"length": 0.1, "young_modulus": 70e9, "density": 2700.0}
    tube = fi.Segment(diameter=6e-3, wall=1e-3, name="tube", **material)
    other = fi.Segment(area=2e-5, second_moment=1.7e-12, name="other", **material)
    structure = dataclasses.replace(reference, beam=fi.Beam((tube, other)))
    record = fi.Recorder(channels=("tip",), snapshots=4)
    run = fi.integrate(reduced(structure, 2), fi.Sine(1e-4, 5.0), fi.EventDriven(), 0.2, record)
    film = movie._film(run, structure, 1.0, 25, 4)
    beams = [body for body in film.scene.bodies if body.part == BEAM]
    faces = np.concatenate([body.points[np.array(movie._faces(body))] for body in beams])
    for begin, height in ((0.0, 6e-3), (0.1, np.sqrt(12 * 1.7e-12 / 2e-5))):
        within = (faces[:, :, 0].min(axis=1) > begin - 1e-9) & (faces[:, :, 0].max(axis=1) < begin + 0.1 + 1e-9)
        assert np.ptp(faces[within][:, :, 0]) == pytest.approx(0.1, rel=1e-9)
        np.testing.assert_allclose(np.abs(faces[within][:, :, 1]), 0.5 * height, rtol=1e-9)
    assert structure.beam.drawn_words == "other: drawn as the rectangle of its area and second moment"
    drawing = tostring(structure_element(placed_structure(structure, run.system)), encoding="unicode")
    assert structure.beam.drawn_words in drawing
    assert "diameter 6 mm, wall 1 mm" in drawing
    axis = fi.figures.beam_mesh(fi.uniform_mesh(structure, 4), structure, ax=fi.figures.OffScreen())
    assert structure.beam.drawn_words in axis.get_title(loc="left")


@pytest.mark.parametrize("thickness", [1e-3, 6e-3])
def test_a_plate_is_drawn_as_thick_as_it_is_in_a_mode_that_swings_both_ways(reference, thickness, monkeypatch):
    (plate,) = reference.beam.segments
    beam = fi.Beam.uniform(
        length=plate.length, width=0.02, thickness=thickness, young_modulus=70e9, density=plate.density
    )
    structure = dataclasses.replace(reference, beam=beam)
    system = fi.assemble(structure, 10)
    monkeypatch.setattr(movie, "_encode", lambda path, frames, fps: list(frames))
    frames = fi.figures.write_mode("mode.gif", system, fi.solve_modes(system, 2), structure, mode=2, frames=4)
    # axes of 0.905 of the width show the length, with 0.04 of it before the root and 0.08 behind the tip
    scale, middle = 0.905 * movie.WIDTH / (1.12 * plate.length), round(0.45 * movie.WIDTH)
    columns = [frame[120:-90, middle, :3].astype(int) - (0x55, 0x5B, 0x63) for frame in frames]
    dark = [np.flatnonzero(np.abs(column).max(axis=1) < 60) for column in columns]
    assert [rows.size for rows in dark[1::2]] == pytest.approx([thickness * scale] * 2, abs=1.5)
    # a column through a slope is longer
    assert all(-1.5 < rows.size - thickness * scale < 1.5 + 0.15 * thickness * scale for rows in dark)
    one, rest, other, again = (rows.mean() for rows in dark)
    assert one - rest == pytest.approx(rest - other, abs=2.0)
    # and the shape fills their height of 0.77
    assert 0.4 < abs(one - other) / (0.77 * movie.HEIGHT) < 1.0
    assert again == rest


def test_a_mode_is_a_gif_that_repeats_and_one_that_is_none_is_refused(reference, tmp_path):
    system = fi.assemble(reference, 10)
    modes = fi.solve_modes(system, 2)
    path = fi.figures.write_mode(tmp_path / "mode.gif", system, modes, reference, mode=2, frames=4, fps=10)
    with Image.open(path) as picture:
        assert (picture.n_frames, picture.info["loop"], picture.info["duration"]) == (4, 0, 100)
    for wrong in (0, 3, 1.5, True):
        with pytest.raises(fi.InputError, match="mode = "):
            fi.figures.write_mode(path, system, modes, reference, mode=wrong)
    bare = fi.System.from_matrices([[1.0]], [[0.0]], [[1.0]], points={"mass": [1.0]}, base_load=[1.0])
    with pytest.raises(fi.InputError, match="a shape needs a beam"):
        fi.figures.write_mode(path, bare, fi.solve_modes(bare, 1), reference)


@pytest.mark.parametrize("fixed_to", ["base", "space"])
def test_a_stop_stands_at_its_gap_and_is_coloured_when_it_is_touched(reference, fixed_to):
    stop = fi.Stop("stop", at=0.1, gap=(2e-4, np.inf), contact=fi.Rigid(0.6), fixed_to=fixed_to)
    structure = dataclasses.replace(reference, impactors=(), stops=(stop,))
    base = fi.Sine(0.2e-3, 5.3)
    response = fi.integrate(reduced(structure, 3, 10), base, fi.EventDriven(), 2.0, fi.Recorder(snapshots=4))
    film = movie._film(response, structure, 5.0, 25, 200)
    ((first, block),) = [
        (first, body) for first, body in zip(film.scene.first, film.scene.bodies, strict=True) if body.part == STOP
    ]
    assert (block.pair, block.side) == (0, 1)
    times = film.snapshots.time[film.chosen]
    corners = first + np.arange(len(block.points))
    for i, time in enumerate(times):
        low = film.moved(i)[corners, 1].min()
        # 5 times the gap above the upper face of the beam of 1 mm; relative to the base, space moves against it
        moves = 5.0 * base.displacement(time) if fixed_to == "space" else 0.0
        assert low == pytest.approx(5.0 * 2e-4 + 0.5e-3 - moves, abs=1e-15)
    assert len(response.impacts) > 3
    touched = film.touched[:, 0] == 1
    first = response.impacts.time[0]
    assert not touched[times < first].any()
    assert touched[np.searchsorted(times, first)]
    frames = frames_of(dataclasses.replace(film, chosen=film.chosen[:1]))
    assert vermilion(next(frames)) == 0
    at = np.flatnonzero(touched)[:1]
    frames = frames_of(dataclasses.replace(film, chosen=film.chosen[at], touched=film.touched[at]))
    # the block is 2 % of the length of a beam that fills nearly the width: 22 pixels square
    assert vermilion(next(frames)) > 300


@pytest.mark.impacts
def test_an_impact_is_shown_though_it_is_shorter_than_a_frame(meeting):
    times = meeting.snapshots.time
    side = movie._touched(meeting, meeting.snapshots, np.arange(times.size))[:, 0]
    whole = meeting.impacts.time < times[-2]
    assert whole.sum() > 3
    for start, wall in zip(meeting.impacts.time[whole], meeting.impacts.side[whole], strict=True):
        assert side[np.searchsorted(times, start)] == wall
    # a ball in contact at a frame is at that wall
    touching = meeting.snapshots.contact_force[:, 0]
    assert np.all(side[touching > 0] == 1)
    assert np.all(side[touching < 0] == -1)
    # and not all the time: before the first impact nothing is coloured
    assert not side[times < meeting.impacts.time[0]].any()


def test_a_beam_without_a_ball_and_one_snapshot_make_a_movie(tmp_path, reference):
    bare = dataclasses.replace(reference, impactors=())
    system = fi.assemble(bare, elements=4)
    record = fi.Recorder(snapshots=1, snapshots_start=2e-3)
    response = fi.integrate(system, fi.Sine(1e-3, 5.0), fi.Newmark(dt=1e-3), duration=2e-3, record=record)
    assert response.snapshots.time.size == 1
    assert movie.write_movie(tmp_path / "a.gif", response, bare).stat().st_size > 0


def test_an_interrupted_movie_leaves_nothing(tmp_path, response, reference, monkeypatch):
    draw = movie.Film.moved

    def interrupted(film, i, **more):
        if i == 3:
            raise KeyboardInterrupt
        return draw(film, i, **more)

    # the reach is asked for first, then the frames are drawn while the encoder runs
    monkeypatch.setattr(movie, "_reach", lambda scene, frames: 0.02)
    monkeypatch.setattr(movie.Film, "moved", interrupted)
    for name in ("a.mp4", "a.gif"):
        with pytest.raises(KeyboardInterrupt):
            movie.write_movie(tmp_path / name, response, reference)
    assert list(tmp_path.iterdir()) == []


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


@pytest.mark.parametrize("change", [{"fps": 0}, {"most": 0}, {"exaggeration": 0.0}, {"exaggeration": np.nan}])
def test_bad_options_are_refused(tmp_path, response, reference, change):
    with pytest.raises(fi.InputError, match=next(iter(change))):
        movie.write_movie(tmp_path / "a.mp4", response, reference, **change)
