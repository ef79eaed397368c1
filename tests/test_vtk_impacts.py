"""Frames at impacts in files for ParaView, read back and set beside the record of impacts."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from builders import REFERENCE, reduced, with_ball
from grids import points_of, read_series

import femimpact as fi
from femimpact.scene.scene import BALL, BOX, CONTACT_POINT, STOP
from femimpact.vtk import deflection, write_deflection
from femimpact.vtk.deflection import frames_of

pytestmark = pytest.mark.impacts

BASE = fi.Sine(amplitude=0.2037e-3, frequency=5.0)
LAST = fi.Recorder(channels=("tip",), snapshots=1, snapshots_start=7.5)
RIGID = with_ball(REFERENCE, contact=fi.Rigid(restitution=0.6))


def read(path):
    """Frames that show an impact: name, grid."""
    return [(time, grid) for time, grid in zip(*read_series(path), strict=True) if grid.field_data["impact"][0]]


@pytest.fixture(scope="module", params=["kelvin-voigt", "rigid"])
def run(request):
    structure = REFERENCE if request.param == "kelvin-voigt" else RIGID
    return structure, fi.integrate(reduced(structure), BASE, fi.EventDriven(), 8.0, LAST)


def test_every_impact_has_a_frame_with_its_record(tmp_path, run):
    """Ball on the wall, the relative speed of approach, and the impulse: as the table has them, to rounding."""
    structure, response = run
    shown = read(write_deflection(tmp_path / "a.pvd", response, structure))
    table = response.impacts
    met = [(time, grid) for time, grid in shown if "sticks" not in grid.field_data["name"][0]]
    assert len(met) > 2
    in_time = (table.time >= response.snapshots.time[0]) & (table.time <= response.snapshots.time[-1])
    # what has no frame leads to a sticking phase, without the other wall in between
    for i in np.flatnonzero(in_time & ~np.isin(table.time, [time for time, _ in met])):
        start = response.sticking.start[response.sticking.start >= table.time[i]].min()
        assert np.all(table.side[(table.time >= table.time[i]) & (table.time <= start)] == table.side[i])
    for time, grid in met:
        (i,) = np.flatnonzero(table.time == time)
        moved = grid.points + grid["displacement"]
        ball = points_of(grid, grid["part"] == BALL)
        marks = np.flatnonzero(grid["contact_impulse_vector"][:, 1])
        assert marks.size == 2
        # the marks of wall and ball lie on one another: the clearance is zero to rounding of 0.01 m
        assert moved[marks[0], 1] == pytest.approx(moved[marks[1], 1], abs=1e-14)
        speed = table.side[i] * (grid["velocity"][ball[0], 1] - grid["velocity"][marks[0], 1])
        # the side the wall is on turns with the box: no velocity along y at the first order
        assert speed == pytest.approx(table.approach_speed[i], rel=1e-9)
        impulses = grid["contact_impulse_vector"][marks, 1]
        np.testing.assert_allclose(impulses, [table.side[i] * table.impulse[i], -table.side[i] * table.impulse[i]])
        assert np.all(grid["state"][np.isin(grid["part"], (BALL, BOX))] == 1)
        assert f"{table.approach_speed[i]:.4g} m/s" in grid.field_data["name"][0]
        # rounding, and what the method leaves out where it captures an accumulation
        assert grid.field_data["impact_state_mismatch"][0] < 1e-6


@pytest.mark.parametrize("exaggeration", [1.0, 10.0])
def test_a_rigid_ball_is_inside_its_walls_in_every_frame(tmp_path, exaggeration):
    """The two points of contact on each side, of wall and ball, never pass one another."""
    response = fi.integrate(reduced(RIGID), BASE, fi.EventDriven(), 8.0, LAST)
    least = []
    for grid in read_series(write_deflection(tmp_path / "a.pvd", response, RIGID, exaggeration))[1]:
        y = (grid.points + grid["displacement"])[points_of(grid, grid["part"] == CONTACT_POINT), 1]
        # in the order of the scene: + wall, ball beside it, - wall, ball beside it
        least.append(min(y[0] - y[1], y[3] - y[2]))
    # the method's closure is 1e-12 m
    assert min(least) > -1e-11 * exaggeration
    assert np.count_nonzero(np.array(least) < 1e-9) > 2


def test_the_rest_of_the_frames_is_the_even_grid(run):
    _, response = run
    frames = frames_of(response, 600)
    grid = [time for time, what in zip(frames.snapshots.time, frames.what, strict=True) if not what]
    assert set(response.snapshots.time) == set(grid)
    assert np.all(np.diff(frames.snapshots.time) > 0.0)


def test_states_at_impacts_do_not_depend_on_the_spacing_of_snapshots(run):
    """Of event-driven runs they are exact: from a snapshot 16 times further away they are the same."""
    _, response = run
    sparse = {f.name: getattr(response.snapshots, f.name)[::16] for f in dataclasses.fields(response.snapshots)}
    far = dataclasses.replace(response, snapshots=dataclasses.replace(response.snapshots, **sparse))
    frames, others = frames_of(response, 600), frames_of(far, 600)
    times = {time: k for k, time in enumerate(frames.snapshots.time)}
    compared = 0
    for k, what in enumerate(others.what):
        if what:
            own = times[others.snapshots.time[k]]
            scale = np.abs(frames.snapshots.displacement[:, 0::2]).max()
            difference = others.snapshots.displacement[k] - frames.snapshots.displacement[own]
            # between them lie recorded impulses, and what the method leaves out where it captures an accumulation
            np.testing.assert_allclose(difference[0::2] / scale, 0.0, atol=1e-6)
            compared += 1
    assert compared > 2


def test_an_accumulation_has_a_frame_at_its_start_and_one_at_its_end(tmp_path):
    """A ball that falls on its wall bounces ever lower and sticks: of all those impacts the first alone is shown."""
    falling = with_ball(REFERENCE, contact=fi.Rigid(restitution=0.5), acceleration=-9.81, gap=1e-3)
    response = fi.integrate(
        reduced(falling), fi.Sine(amplitude=1e-6, frequency=5.0), fi.EventDriven(), 1.0,
        fi.Recorder(channels=("tip",), snapshots=1),
    )  # fmt: skip
    assert len(response.sticking) == 1
    assert len(response.impacts) > 10
    shown = read(write_deflection(tmp_path / "a.pvd", response, falling))
    times = [time for time, _ in shown]
    np.testing.assert_array_equal(times, [response.impacts.time[0], response.sticking.start[0]])
    assert f"accumulation of {len(response.impacts)} impacts" in shown[1][1].field_data["name"][0]
    frames = frames_of(response, 600)
    x = frames.snapshots.ball_displacement[:, 0] - frames.snapshots.displacement[:, -2]
    # from its end on the ball lies on its wall; the method's closure is 1e-12 m
    after = frames.snapshots.time >= response.sticking.start[0]
    np.testing.assert_allclose(x[after], -1e-3, atol=1e-11)
    assert np.all(frames.touching[after, 0])
    assert frames.mismatch < 1e-7


def test_other_methods_and_laws_are_met_to_their_own_error():
    """A step method's motion differs from the exact one by O(dt^2) between two snapshots."""
    structure = with_ball(REFERENCE, contact=fi.contact.Flores(restitution=0.6, stiffness=1e7))
    system = reduced(structure, modes=4)
    found = []
    for dt in (4e-5, 2e-5):
        every = round(2e-3 / dt)
        record = fi.Recorder(channels=("tip",), snapshots=every)
        start = fi.State(ball_velocity=[0.1])
        run = fi.integrate(system, BASE, fi.Newmark(dt=dt), 0.1, record, start)
        frames = frames_of(run, 600)
        assert sum(map(bool, frames.what)) > 0
        found.append(frames.mismatch)
    # four times less, more or less where the touch falls within its step
    assert found[1] < 0.4 * found[0]
    assert found[0] < 1e-4


@pytest.mark.parametrize("fixed_to", ["base", "space"])
@pytest.mark.parametrize("law", [fi.Rigid(restitution=0.6), fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)])
def test_stops_are_touched_and_push_the_beam_back(tmp_path, law, fixed_to):
    stop = fi.Stop("stop", at="tip", gap=(2e-3, math.inf), contact=law, fixed_to=fixed_to)
    structure = dataclasses.replace(REFERENCE, impactors=(), stops=(stop,))
    response = fi.integrate(reduced(structure), fi.Sine(0.4e-3, 5.2), fi.EventDriven(), 8.0, LAST)
    shown = read(write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=2.0))
    assert len(shown) > 0
    for time, grid in shown:
        moved = grid.points + grid["displacement"]
        marks = np.flatnonzero(grid["contact_impulse_vector"][:, 1])
        assert marks.size == 2
        beam, block = marks
        # a compliant stop is met at zero depth too; the times are the table's, of rounding 1e-15 s
        assert moved[beam, 1] == pytest.approx(moved[block, 1], abs=1e-12)
        assert grid["contact_impulse_vector"][beam, 1] < 0.0
        assert grid["contact_impulse_vector"][block, 1] > 0.0
        still = grid["displacement"][points_of(grid, grid["part"] == STOP)][:, 1]
        expected = -2.0 * response.base.displacement(time) if fixed_to == "space" else 0.0
        np.testing.assert_allclose(still, expected, atol=1e-15)
        assert grid.field_data["impact_state_mismatch"][0] < 1e-7


def test_a_limit_on_frames_is_said_when_it_is_reached(run):
    _, response = run
    shown = sum(map(bool, frames_of(response, 600).what))
    with pytest.warns(UserWarning, match=f"2 of {shown} impacts have a frame"):
        frames = frames_of(response, 4)
    assert frames.snapshots.time.size == 4
    assert sum(map(bool, frames.what)) == 2


def test_a_state_that_misses_the_next_snapshot_is_not_shown(run):
    """An impact of a changed record: the motion between two snapshots is not that of the record."""
    _, response = run
    table = response.impacts
    first = int(np.flatnonzero(table.time > response.snapshots.time[0])[0])
    names = [field.name for field in dataclasses.fields(table) if field.name not in ("law", "dropped")]
    fields = {name: np.array(getattr(table, name)) for name in names}
    # of a rigid contact the impulse decides, of a compliant one how long it lasts
    fields["impulse"][first] *= -200.0
    fields["duration"][first] *= 0.1
    sparse = {f.name: getattr(response.snapshots, f.name)[::16] for f in dataclasses.fields(response.snapshots)}
    wrong = dataclasses.replace(
        response,
        impacts=dataclasses.replace(table, **fields),
        snapshots=dataclasses.replace(response.snapshots, **sparse),
    )
    with pytest.warns(UserWarning, match=r"impacts have no frame: their states, taken on, miss the next snapshot"):
        frames = frames_of(wrong, 600)
    assert table.time[first] not in frames.snapshots.time


def test_a_large_system_has_the_even_grid_only(monkeypatch, run):
    _, response = run
    monkeypatch.setattr(deflection, "MOST_DOFS", 8)
    with pytest.warns(UserWarning, match="no impact has a frame: the system has 9 dofs"):
        frames = frames_of(response, 600)
    np.testing.assert_array_equal(frames.snapshots.time, response.snapshots.time)
