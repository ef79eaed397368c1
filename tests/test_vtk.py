"""Files for ParaView, read back with VTK's own readers and compared with the response."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from builders import FILES, NO_PICTURES, done, short_study
from grids import points_of, read_series

import femimpact as fi
from femimpact import vtk
from femimpact.app.study.prepared import prepare
from femimpact.app.tasks.run import task_of_run
from femimpact.scene.placed import ball_radius, body_side
from femimpact.scene.scene import BALL, BEAM, BODY, BOX, CONNECTION, CONTACT_POINT, SUPPORT
from femimpact.vtk import formats
from femimpact.vtk.deflection import frames_of
from femimpact.vtk.script import script_path

pytestmark = pytest.mark.impacts


@pytest.fixture(scope="module")
def response(small):
    record = fi.Recorder(channels=("tip",), every=100, snapshots=200, snapshots_start=2.0)
    base = fi.Sine(amplitude=0.2037e-3, frequency=4.9)
    return fi.integrate(small, base, fi.Newmark(dt=fi.recommended_step(small)), duration=3.0, record=record)


def nodes_of(grid, part):
    """Numbers of the points that belong to a part."""
    return points_of(grid, grid["part"] == part)


def centre_line(grid, x):
    """Mean displacement of the four corners of the beam's section at x."""
    points = nodes_of(grid, BEAM)
    at = points[np.isclose(grid.points[points, 0], x, atol=1e-12)]
    return grid["displacement"][at].mean(axis=0)


@pytest.mark.parametrize("exaggeration", [1.0, 7.5])
def test_deflection_read_back_is_the_response(tmp_path, response, reference, exaggeration):
    path = vtk.write_deflection(tmp_path / "deflection.pvd", response, reference, exaggeration)
    times, grids = read_series(path)
    snapshots = frames_of(response, 600).snapshots
    # base64 of float64 keeps every bit; the collection's times are written in full
    np.testing.assert_array_equal(times, snapshots.time)
    for k, grid in enumerate(grids):
        tip = centre_line(grid, reference.beam.length)
        assert tip[1] == pytest.approx(exaggeration * snapshots.displacement[k, -2], rel=1e-12, abs=1e-18)
        ball = grid["displacement"][nodes_of(grid, BALL)]
        np.testing.assert_allclose(ball[:, 1], exaggeration * snapshots.ball_displacement[k, 0], rtol=1e-12)
        # velocities are true ones, whatever the exaggeration
        speed = grid["velocity"][nodes_of(grid, BALL)][:, 1]
        np.testing.assert_allclose(speed, snapshots.ball_velocity[k, 0], rtol=1e-12)
        on_ball = grid["contact_force"][grid["part"] == BALL]
        np.testing.assert_array_equal(on_ball, snapshots.contact_force[k, 0])
        assert np.all(grid["contact_force"][grid["part"] == BEAM] == 0)
        assert np.all(grid["state"][grid["contact_force"] != 0] == 1)
        assert grid.field_data["TimeValue"][0] == times[k]
        assert grid.field_data["exaggeration"][0] == exaggeration
        assert "clearance" in grid.field_data["note"][0]
    assert set(np.unique(grids[0]["part"])) == {BEAM, BOX, BALL, SUPPORT, CONTACT_POINT}


@pytest.mark.parametrize("exaggeration", [0.5, 1.0, 20.0])
def test_ball_stays_in_its_box_at_any_exaggeration(tmp_path, response, reference, exaggeration):
    """In every frame, impacts included: it may be in a wall by the penetration of its contact, and no deeper."""
    path = vtk.write_deflection(tmp_path / "deflection.pvd", response, reference, exaggeration)
    pair, snapshots = response.system.contacts[0], frames_of(response, 600).snapshots
    radius, law = ball_radius(pair.mass), pair.parameters
    speed = response.impacts.approach_speed.max()
    # an undamped contact of the same spring goes deeper than a damped one
    deepest = speed * np.sqrt(pair.effective_mass / law.stiffness)
    touched = 0
    for k, grid in enumerate(read_series(path)[1]):
        x = snapshots.ball_displacement[k, 0] - snapshots.displacement[k, -2]
        warped = grid.points + grid["displacement"]
        ball, box = warped[nodes_of(grid, BALL), 1], warped[nodes_of(grid, BOX), 1]
        # the walls are 0.3 radii thick; the box turns with the small slope of the tip only
        inner = box.max() - 0.3 * radius, box.min() + 0.3 * radius
        assert inner[0] - inner[1] == pytest.approx(2 * (exaggeration * 4e-3 + radius), rel=0.02)
        assert abs(x) < 4e-3 + deepest
        slope = exaggeration * abs(snapshots.displacement[k, -1]) * 1.3 * radius
        assert ball.max() < inner[0] + exaggeration * deepest + slope
        assert ball.min() > inner[1] - exaggeration * deepest - slope
        touched += abs(x) > (1 - 1e-6) * 4e-3
    assert touched > 1


@pytest.fixture(scope="module")
def two_balls():
    """A stepped beam with two balls, and snapshots drawn at random: no motion is special."""
    steel, law = {"young_modulus": 210e9, "density": 7850.0}, fi.KelvinVoigt(stiffness=1e4, restitution=0.6)
    thick = fi.Segment(length=0.12, width=0.030, thickness=3e-3, name="thick", **steel)
    thin = fi.Segment(length=0.08, width=0.015, thickness=1e-3, name="thin", **steel)
    end = fi.Impactor("end", at="tip", mass=3e-3, gap=(4e-3, 2e-3), contact=law)
    middle = fi.Impactor("middle", at=0.06, mass=1e-3, gap=1e-3, contact=law)
    structure = fi.Structure(beam=fi.Beam((thick, thin)), impactors=[end, middle])
    system = fi.assemble(structure, elements=10)
    dt = fi.recommended_step(system)
    response = fi.integrate(system, fi.Sine(1e-3, 7.0), fi.Newmark(dt=dt), 5 * dt, record=fi.Recorder(snapshots=1))
    random, snapshots = np.random.default_rng(3), response.snapshots
    drawn = {
        name: 1e-3 * random.standard_normal(getattr(snapshots, name).shape)
        for name in ("displacement", "velocity", "ball_displacement", "ball_velocity", "contact_force")
    }
    return structure, dataclasses.replace(response, snapshots=dataclasses.replace(snapshots, **drawn))


@pytest.mark.parametrize("exaggeration", [0.5, 1.0, 30.0])
def test_drawn_clearance_is_the_true_one_times_the_exaggeration(tmp_path, two_balls, exaggeration):
    """Wall face minus ball surface, for unequal gaps, two balls and any motion: so no exaggeration makes a hit."""
    structure, response = two_balls
    snapshots = response.snapshots
    _, grids = read_series(vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration))
    for k, grid in enumerate(grids):
        warped = grid.points + grid["displacement"]
        for j, pair in enumerate(response.system.contacts):
            own = grid["contact_pair"] == j
            ball, box = (points_of(grid, own & (grid["part"] == part)) for part in (BALL, BOX))
            rest = np.unique(grid.points[box, 1].round(13))
            x = snapshots.ball_displacement[k, j] - deflection_at(response, k, pair.position)
            for side, gap, level in ((1, pair.gaps[0], rest[2]), (-1, pair.gaps[1], rest[1])):
                face = box[np.isclose(grid.points[box, 1], level, rtol=0, atol=1e-12)]
                clearance = side * warped[face, 1].mean() - (side * warped[ball, 1]).max()
                assert clearance == pytest.approx(exaggeration * (gap - side * x), abs=1e-12)


def test_sections_and_boxes_turn_with_the_slope(tmp_path, two_balls):
    structure, response = two_balls
    _, grids = read_series(vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=2.0))
    for k, grid in enumerate(grids):
        w, slope = response.snapshots.displacement[k, -2:]
        points = nodes_of(grid, BEAM)
        tip = points[np.isclose(grid.points[points, 0], structure.beam.length, atol=1e-12)]
        np.testing.assert_allclose(grid["displacement"][tip, 0], -2.0 * slope * grid.points[tip, 1], atol=1e-15)
        # a box at the tip turns as a rigid body about the axis
        box = points_of(grid, (grid["part"] == BOX) & (grid.cell_centers().points[:, 0] > 0.15))
        arm = grid.points[box] - [structure.beam.length, 0.0, 0.0]
        np.testing.assert_allclose(grid["displacement"][box, 0], -2.0 * slope * arm[:, 1], atol=1e-15)
        np.testing.assert_allclose(grid["displacement"][box, 1], 2.0 * (w + slope * arm[:, 0]), atol=1e-15)


def test_solid_has_the_mass_of_beam_and_balls(tmp_path, two_balls):
    """Volume times density; a cell of wrong orientation would count negative."""
    structure, response = two_balls
    grid = read_series(vtk.write_deflection(tmp_path / "a.pvd", response, structure, 5.0))[1][0]
    volume = grid.compute_cell_sizes(length=False, area=False, volume=True)["Volume"]
    assert volume[~np.isin(grid["part"], (BALL, CONTACT_POINT))].min() > 0.0
    assert 7850.0 * volume[grid["part"] == BEAM].sum() == pytest.approx(structure.beam.mass, rel=1e-9)
    masses = 7850.0 * 4.0 / 3.0 * np.pi * grid.field_data["ball_radius"] ** 3
    np.testing.assert_allclose(masses, [ball.mass for ball in structure.impactors], rtol=1e-12)


def deflection_at(response, k, position):
    """Deflection of snapshot k at a position, m, on the cubic through its nodal values and slopes."""
    from scipy.interpolate import CubicHermiteSpline

    nodal = response.snapshots.displacement[k]
    return float(CubicHermiteSpline(response.system.nodes, nodal[0::2], nodal[1::2])(position))


def test_displacement_in_space_adds_the_base(tmp_path, response, reference):
    """To all that moves with it: the supports too."""
    relative = read_series(vtk.write_deflection(tmp_path / "a.pvd", response, reference, 4.0))[1]
    absolute = read_series(vtk.write_deflection(tmp_path / "b.pvd", response, reference, 4.0, frame="space"))[1]
    for k in (0, 3, 7):
        time = absolute[k].field_data["TimeValue"][0]
        shift = absolute[k]["displacement"] - relative[k]["displacement"]
        np.testing.assert_allclose(
            shift, np.outer(np.ones(len(shift)), [0, 4 * response.base.displacement(time), 0]), atol=1e-15
        )
        speed = (absolute[k]["velocity"] - relative[k]["velocity"])[:, 1]
        np.testing.assert_allclose(speed, response.base.velocity(time), atol=1e-14)
        np.testing.assert_array_equal(relative[k].points, relative[0].points)


def none_of(impacts):
    """The table without a row."""
    names = [f.name for f in dataclasses.fields(impacts) if f.name not in ("law", "dropped")]
    return dataclasses.replace(impacts, **{name: getattr(impacts, name)[:0] for name in names})


def test_thinning_keeps_first_and_last(tmp_path, response, reference):
    quiet = dataclasses.replace(response, impacts=none_of(response.impacts))
    times, _ = read_series(vtk.write_deflection(tmp_path / "a.pvd", quiet, reference, most=5))
    assert len(times) == 5
    assert (times[0], times[-1]) == (response.snapshots.time[0], response.snapshots.time[-1])


def test_a_folder_that_is_missing_is_named(tmp_path, system, reference):
    for name in ("m.pvd", "m.vtkhdf"):
        with pytest.raises(fi.InputError, match=r"existing directory: make .*missing"):
            vtk.write_modes(tmp_path / "missing" / name, system, fi.solve_modes(system, 2), reference)


def test_modes_read_back_are_the_modes(tmp_path, system, reference):
    modes = fi.solve_modes(system, 4)
    times, grids = read_series(vtk.write_modes(tmp_path / "modes.pvd", system, modes, reference, scale=0.02))
    np.testing.assert_array_equal(times, [1, 2, 3, 4])
    for i, grid in enumerate(grids):
        points = nodes_of(grid, BEAM)
        x = grid.points[points, 0]
        shape = system.deflection_rows(x) @ modes.vectors[:, i]
        drawn = grid["displacement"][points, 1]
        assert np.abs(drawn).max() == pytest.approx(0.02, rel=1e-12)
        # proportional to the mode, along its Hermite curve between the nodes too
        np.testing.assert_allclose(drawn, 0.02 * shape / np.abs(shape).max(), atol=1e-15)
        slope = system.deflection_rows(x, 1) @ modes.vectors[:, i]
        np.testing.assert_allclose(grid["rotation"][points, 2], 0.02 * slope / np.abs(shape).max(), atol=1e-13)
        assert grid.field_data["natural_frequency"][0] == modes.natural_frequency[i]
        assert f"{modes.natural_frequency[i]:.6g} Hz" in grid.field_data["name"][0]
        # mass-normalised mode times modal coordinate is what is drawn
        assert 0.02 / np.abs(shape).max() == pytest.approx(grid.field_data["modal_coordinate"][0], rel=1e-12)
        assert np.unique(x).size >= 100
        # a ball moves with its box, and what holds the beam stands still
        ball = grid["displacement"][nodes_of(grid, BALL)]
        np.testing.assert_allclose(ball[:, 1], drawn[-1], rtol=1e-12)
        assert not np.any(grid["displacement"][nodes_of(grid, SUPPORT)])


def test_one_mode_over_its_period_is_a_cosine(tmp_path, system, reference):
    """w(t) = W cos(omega t): half a period later the opposite, and the velocity is its derivative."""
    modes = fi.solve_modes(system, 2)
    times, grids = read_series(vtk.write_mode(tmp_path / "mode_2.pvd", system, modes, reference, mode=2))
    assert len(times) == 24
    period = 1.0 / modes.natural_frequency[1]
    np.testing.assert_allclose(np.diff(times), period / 24, rtol=1e-9)
    for k in range(24):
        opposite = grids[(k + 12) % 24]
        scale = np.abs(grids[0]["displacement"]).max()
        np.testing.assert_allclose(grids[k]["displacement"], -opposite["displacement"], atol=1e-12 * scale)
        quarter = grids[(k + 6) % 24]["displacement"]
        np.testing.assert_allclose(
            grids[k]["velocity"], 2 * np.pi / period * quarter, atol=1e-12 * scale * 2 * np.pi / period
        )


def test_a_coarse_mesh_still_gives_a_smooth_curve(tmp_path, reference):
    coarse = fi.assemble(reference, elements=1)
    _, grids = read_series(vtk.write_modes(tmp_path / "m.pvd", coarse, fi.solve_modes(coarse, 2), reference))
    assert np.unique(grids[0].points[nodes_of(grids[0], BEAM), 0]).size >= 100


def test_what_stood_there_survives_a_failed_attempt(tmp_path, response, reference, monkeypatch):
    response = dataclasses.replace(response, impacts=none_of(response.impacts))
    path = vtk.write_deflection(tmp_path / "a.pvd", response, reference, most=3)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    # three frames, the collection and its script
    assert len(before) == 5

    def full(*_arguments):
        raise OSError("disk full")

    monkeypatch.setattr(formats, "atomic_write", full)
    for name in ("a.pvd", "new.pvd"):
        with pytest.raises(OSError, match="disk full"):
            vtk.write_deflection(tmp_path / name, response, reference, exaggeration=2.0)
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before
    monkeypatch.undo()
    vtk.write_deflection(path, response, reference, most=2)
    assert len(list((tmp_path / "a").iterdir())) == 2


def test_a_folder_with_other_files_is_not_replaced(tmp_path, response, reference):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "measured.csv").write_text("precious")
    (tmp_path / "a" / "0000.vtu").write_text("a frame beside it")
    with pytest.raises(fi.InputError, match="holds other files"):
        vtk.write_deflection(tmp_path / "a.pvd", response, reference)
    assert (tmp_path / "a" / "measured.csv").read_text() == "precious"


def test_offset_bodies_and_springs_move_with_their_section(tmp_path):
    """The centre of a body moves by w + offset dw/dx; a spring's ends are on the beam and on the base."""
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("head", at="tip", mass=0.01, offset=0.03)],
        springs=[fi.Spring("coil", at="head", stiffness=30.0)],
    )
    system = fi.assemble(structure, elements=4)
    modes = fi.solve_modes(system, 2)
    for i, grid in enumerate(read_series(vtk.write_modes(tmp_path / "m.pvd", system, modes, structure))[1]):
        factor = grid.field_data["modal_coordinate"][0]
        w, slope = (factor * float((system.deflection_rows([0.2], k) @ modes.vectors[:, i])[0]) for k in (0, 1))
        head = nodes_of(grid, BODY)
        assert grid.points[head, 0].mean() == pytest.approx(0.23)
        assert grid["displacement"][head, 1].mean() == pytest.approx(w + 0.03 * slope)
        (cell,) = np.flatnonzero(grid["part"] == CONNECTION)
        beam, base = grid.get_cell(cell).point_ids
        assert grid["displacement"][beam, 1] == pytest.approx(w)
        assert grid["displacement"][base, 1] == 0.0


def carrying(*masses, **attachments):
    """A cantilever of 0.2 m with bodies, and a ball of 2 g at its tip where nothing else is given."""
    attachments = attachments or {"impactors": [fi.Impactor("ball", "tip", 2e-3, 3e-3, fi.Rigid(0.6))]}
    beam = fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    return fi.Structure(beam, masses, **attachments)


@pytest.mark.parametrize("offset", [0.0, 0.01, -0.02])
def test_the_heaviest_body_at_the_place_of_a_ball_is_its_box_and_drawn_once(offset):
    """The middle of the box is the body's centre of mass, and the ball is within the box."""
    light, clip = fi.PointMass("sensor", "tip", 1e-3), fi.PointMass("clip", 0.1, 5e-3)
    structure = carrying(light, fi.PointMass("box", "tip", 0.02, offset=offset), clip)
    system = fi.assemble(structure, elements=4)
    grid = vtk.to_pyvista(fi.solve_modes(system, 2), structure, system)[0]
    box, ball, bodies = (grid.points[nodes_of(grid, part)] for part in (BOX, BALL, BODY))
    low, high = box[:, 0].min(), box[:, 0].max()
    assert 0.5 * (low + high) == pytest.approx(0.2 + offset)
    assert low < ball[:, 0].min() < ball[:, 0].max() < high
    # two walls and a floor; single precision of a file holds 1e-9 m
    assert np.count_nonzero(grid["part"] == BOX) == 3
    ends = [x + sign * 0.5 * body_side(body.mass) for body, x in ((clip, 0.1), (light, 0.2)) for sign in (-1, 1)]
    np.testing.assert_allclose(np.unique(bodies[:, 0].round(9)), ends, atol=1e-8)


def test_a_body_that_carries_an_absorber_or_a_stop_stays_a_body():
    """Neither is in a box; the absorber's post stands on the beam, and its body is at the end of its spring."""
    absorber = fi.Absorber("absorber", "tip", 2e-3, 3.0, 0.01)
    stop = fi.Stop("stop", "tip", 3e-3, fi.Rigid(0.6), fixed_to="space")
    for attachments in ({"absorbers": [absorber]}, {"stops": [stop]}):
        structure = carrying(fi.PointMass("box", "tip", 0.02), **attachments)
        system = fi.assemble(structure, elements=4)
        grid = vtk.to_pyvista(fi.solve_modes(system, 2), structure, system)[0]
        assert np.count_nonzero(grid["part"] == BODY) == 1
        assert BOX not in grid["part"]
        if "absorbers" in attachments:
            lines = [grid.get_cell(cell).point_ids for cell in np.flatnonzero(grid["part"] == CONNECTION)]
            (foot, top), (other, end) = lines
            assert (top, grid.points[foot, 2]) == (other, pytest.approx(0.01))
            np.testing.assert_allclose(grid.points[end], grid.points[nodes_of(grid, BALL)].mean(axis=0), atol=1e-12)


def test_what_ties_two_places_of_the_beam_moves_with_both_sections(tmp_path):
    """Legs stand on their sections as rigid bodies, and one line goes from the one to the other."""
    structure = fi.Structure(
        beam=fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700),
        springs=[fi.Spring("tie", at=0.05, stiffness=30.0, to="tip")],
    )
    system = fi.assemble(structure, elements=7)
    modes = fi.solve_modes(system, 2)
    for i, grid in enumerate(read_series(vtk.write_modes(tmp_path / "m.pvd", system, modes, structure))[1]):
        factor = grid.field_data["modal_coordinate"][0]
        lines = [grid.get_cell(cell).point_ids for cell in np.flatnonzero(grid["part"] == CONNECTION)]
        (first, foot), (second, other), joined = lines
        assert list(joined) == [foot, other]
        for x, axis, low in ((0.05, first, foot), (0.2, second, other)):
            w, slope = (factor * float((system.deflection_rows([x], k) @ modes.vectors[:, i])[0]) for k in (0, 1))
            np.testing.assert_allclose(grid.points[[axis, low], 0], x)
            np.testing.assert_allclose(grid["displacement"][[axis, low], 1], w, atol=1e-9)
            leg = grid.points[axis, 1] - grid.points[low, 1]
            assert leg > 0.0
            assert grid["displacement"][low, 0] == pytest.approx(leg * slope, abs=1e-9)


def test_the_script_of_a_study_has_the_name_that_the_study_knows():
    scenes = [name for name in FILES if name.endswith("_scene")]
    assert len(scenes) > 2
    for name in scenes:
        assert FILES["scene_script"].name == script_path(Path(FILES[name].name)).as_posix()


@pytest.mark.parametrize("free", [False, True])
def test_modes_of_a_study_are_animated_where_that_is_asked_for(tmp_path, free):
    study = short_study(1.0, **NO_PICTURES)
    if free:
        # about a single spring it turns
        springs = (fi.Spring("spring", at=0.1, stiffness=100.0),)
        turning = {"supports": (), "springs": springs, "damping": fi.Rayleigh(ratio=0.003, modes=(2, 3))}
        study = dataclasses.replace(study, structure=dataclasses.replace(study.structure, **turning))
    names = [f"mode_{i}.pvd" for i in range(1 + free, 5)]
    for animate, expected in ((False, []), (True, names)):
        task = task_of_run(prepare(study, ("modes",)), ("modes",), animate)
        results = done(task, tmp_path / str(animate))
        folder = results.directory / "paraview"
        assert sorted(file.name for file in folder.glob("mode_?.pvd")) == expected
        assert folder.exists() == animate
    # a rigid motion has no period
    rigid = results.modes["natural_frequency"] == 0.0
    assert list(rigid) == [free, False, False, False]
    assert (folder / "modes.pvd").exists()
    assert f"FILE = {'modes.pvd'!r}" in (folder / "open_in_paraview.py").read_text(encoding="utf-8")
