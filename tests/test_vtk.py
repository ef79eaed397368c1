"""What ParaView is given, read back by VTK's own readers and compared with the response it was written from."""

import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import femimpact as fi
from femimpact.export import vtk

BEAM, BOX, BALL = 0, 1, 2
STEEL = 7850.0


def stepped() -> fi.Structure:
    """Two sections, a ball at the tip with unequal gaps and a second one along the beam."""
    steel = {"young_modulus": 210e9, "density": STEEL}
    return fi.Structure(
        beam=fi.Beam(
            (
                fi.Segment(length=0.12, width=0.030, thickness=3e-3, name="thick", **steel),
                fi.Segment(length=0.08, width=0.015, thickness=1e-3, name="thin", **steel),
            )
        ),
        impactors=[
            fi.Impactor("end", at="tip", mass=3e-3, gap=(4e-3, 2e-3), contact=fi.KelvinVoigt(stiffness=1e4)),
            fi.Impactor("middle", at=0.06, mass=1e-3, gap=1e-3, contact=fi.KelvinVoigt(stiffness=1e4)),
        ],
        damping=fi.Rayleigh(ratio=0.01, modes=(1, 2)),
    )


def invented(structure: fi.Structure, count: int = 6) -> fi.Response:
    """A response whose snapshots are drawn at random: no motion is special, so nothing agrees by chance.

    The first ball touches in every other snapshot, and only then.
    """
    system = fi.assemble(structure, elements=10)
    method = fi.Newmark(dt=fi.recommended_step(system))
    base = fi.Sine(amplitude=1e-3, frequency=7.0, phase=0.4)
    response = fi.integrate(system, base, method, 3 * method.dt, record=fi.Recorder(snapshots=1))
    assert response.snapshots is not None
    random = np.random.default_rng(3)
    nodes, balls = 2 * system.nodes.size, len(system.contacts)
    force = random.uniform(1.0, 2.0, (count, balls))
    force[1::2, 0] = 0.0
    snapshots = replace(
        response.snapshots,
        time=0.1 + np.sort(random.uniform(0.0, 1.0, count)),
        displacement=1e-3 * random.standard_normal((count, nodes)),
        velocity=random.standard_normal((count, nodes)),
        ball_displacement=1e-3 * random.standard_normal((count, balls)),
        ball_velocity=random.standard_normal((count, balls)),
        contact_force=force,
    )
    return replace(response, snapshots=snapshots)


@pytest.fixture(scope="module")
def structure() -> fi.Structure:
    return stepped()


@pytest.fixture(scope="module")
def response(structure: fi.Structure) -> fi.Response:
    return invented(structure)


class Frame:
    """One .vtu file in VTK's own hands."""

    def __init__(self, path: Path) -> None:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path))
        reader.Update()
        assert reader.GetErrorCode() == 0
        self.grid = grid = reader.GetOutput()
        self.points = vtk_to_numpy(grid.GetPoints().GetData())
        self.point = {name: vtk_to_numpy(grid.GetPointData().GetArray(name)) for name in names(grid.GetPointData())}
        self.cell = {name: vtk_to_numpy(grid.GetCellData().GetArray(name)) for name in names(grid.GetCellData())}
        self.field = {name: grid.GetFieldData().GetAbstractArray(name) for name in names(grid.GetFieldData())}

    def number(self, name: str) -> float:
        return float(self.field[name].GetValue(0))

    def nodes_of(self, part: int, force: float | None = None) -> np.ndarray:
        """Points of one part, or of the piece of it that carries this contact force."""
        chosen = self.cell["part"] == part
        if force is not None:
            chosen &= self.cell["contact_force"] == force
        ids = {self.grid.GetCell(int(c)).GetPointId(i) for c in np.flatnonzero(chosen)
               for i in range(self.grid.GetCell(int(c)).GetNumberOfPoints())}  # fmt: skip
        return np.array(sorted(ids))


def names(data: object) -> list[str]:
    return [data.GetArrayName(i) for i in range(data.GetNumberOfArrays())]


def frames(collection: Path) -> list[Frame]:
    return [Frame(file) for file in sorted(collection.with_suffix("").glob("*.vtu"))]


def test_collection_has_the_real_times(tmp_path, structure, response):
    import pyvista

    path = vtk.write_deflection(tmp_path / "deflection.pvd", response, structure)
    assert path == tmp_path / "deflection.pvd"
    reader = pyvista.get_reader(path)
    assert isinstance(reader, pyvista.PVDReader)
    times = response.snapshots.time
    assert np.array_equal(reader.time_values, times)
    for k, time in enumerate(times):
        reader.set_active_time_value(time)
        grid = reader.read()[0]
        assert grid.field_data["TimeValue"][0] == time
        tip = np.argmax(grid.points[:, 0] * (grid.point_data["displacement"][:, 2] == 0.0))
        assert np.all(np.isfinite(grid.point_data["displacement"])), k
        assert np.abs(grid.points[tip, 0]) > 0.0


@pytest.mark.parametrize("exaggeration", [1.0, 7.3])
def test_beam_moves_as_the_snapshots_say(tmp_path, structure, response, exaggeration):
    snapshots, length = response.snapshots, structure.beam.length
    vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=exaggeration)
    for k, frame in enumerate(frames(tmp_path / "a.pvd")):
        beam = frame.nodes_of(BEAM)
        tip = beam[np.isclose(frame.points[beam, 0], length, rtol=0, atol=1e-12)]
        assert len(tip) == 4
        w, slope = snapshots.displacement[k, -2:]
        y = frame.points[tip, 1]
        moved = frame.point["displacement"][tip]
        np.testing.assert_allclose(moved[:, 1], exaggeration * w, rtol=0, atol=1e-12)
        np.testing.assert_allclose(moved[:, 0], -exaggeration * slope * y, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(moved[:, 2], 0.0)
        # the velocity is the true one
        np.testing.assert_allclose(frame.point["velocity"][tip, 1], snapshots.velocity[k, -2], rtol=1e-12)


def test_every_station_follows_the_hermite_curve(tmp_path, structure, response):
    from femimpact.system import hermite_rows

    vtk.write_deflection(tmp_path / "a.pvd", response, structure)
    for k, frame in enumerate(frames(tmp_path / "a.pvd")):
        beam = frame.nodes_of(BEAM)
        curve = hermite_rows(response.system.nodes, frame.points[beam, 0]) @ response.snapshots.displacement[k]
        np.testing.assert_allclose(frame.point["displacement"][beam, 1], curve, rtol=0, atol=1e-12)


@pytest.mark.parametrize("exaggeration", [0.5, 1.0, 30.0])
def test_drawn_clearance_is_the_true_one_times_the_exaggeration(tmp_path, structure, response, exaggeration):
    """So a ball that is inside its box in the model is inside its box in the picture, at any exaggeration."""
    vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=exaggeration)
    snapshots, pair = response.snapshots, response.system.contacts[0]
    radius = (3 * pair.mass / (4 * math.pi * STEEL)) ** (1 / 3)
    assert 0.0 < radius < structure.beam.length
    seen = 0
    for k, frame in enumerate(frames(tmp_path / "a.pvd")):
        force = snapshots.contact_force[k, 0]
        if force == 0.0:
            continue
        seen += 1
        box, ball = frame.nodes_of(BOX, force), frame.nodes_of(BALL, force)
        moved = frame.points + frame.point["displacement"]
        x = snapshots.ball_displacement[k, 0] - snapshots.displacement[k, -2]
        # walls at rest: outer and inner faces on the - side, inner and outer on the + side
        levels = np.unique(frame.points[box, 1].round(12))
        assert levels.size == 4
        for level, gap, side in ((levels[2], pair.gaps[0], 1.0), (levels[1], pair.gaps[1], -1.0)):
            assert side * level == pytest.approx(exaggeration * gap + radius, abs=1e-11)
            face = box[np.isclose(frame.points[box, 1], level, rtol=0, atol=1e-11)]
            wall = moved[face, 1].mean()
            surface = (side * moved[ball, 1]).max()
            assert side * wall - surface == pytest.approx(exaggeration * (gap - side * x), abs=1e-11)
    assert seen == 3


def test_ball_is_a_sphere_that_moves_with_its_own_displacement(tmp_path, structure, response):
    vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=2.0)
    snapshots = response.snapshots
    for k, frame in enumerate(frames(tmp_path / "a.pvd")):
        for j, pair in enumerate(response.system.contacts):
            if snapshots.contact_force[k, j] == 0.0:
                continue
            ball = frame.nodes_of(BALL, snapshots.contact_force[k, j])
            at_rest = frame.points[ball]
            centre = 0.5 * (at_rest.min(axis=0) + at_rest.max(axis=0))
            np.testing.assert_allclose(centre[:2], [pair.position, 0.0], rtol=0, atol=1e-12)
            volume = pair.mass / STEEL
            radius = np.linalg.norm(at_rest - centre, axis=1)
            np.testing.assert_allclose(4 / 3 * math.pi * radius**3, volume, rtol=1e-9)
            moved = frame.point["displacement"][ball]
            y = snapshots.ball_displacement[k, j]
            np.testing.assert_allclose(moved, np.tile([0.0, 2.0 * y, 0.0], (len(ball), 1)), rtol=0, atol=1e-12)
            velocity = np.tile([0.0, snapshots.ball_velocity[k, j], 0.0], (len(ball), 1))
            np.testing.assert_allclose(frame.point["velocity"][ball], velocity, rtol=1e-12)


def test_parts_forces_and_states(tmp_path, structure, response):
    vtk.write_deflection(tmp_path / "a.pvd", response, structure)
    forces = response.snapshots.contact_force
    for k, frame in enumerate(frames(tmp_path / "a.pvd")):
        part, force, state = (frame.cell[name] for name in ("part", "contact_force", "state"))
        assert set(part) == {BEAM, BOX, BALL}
        assert not force[part == BEAM].any()
        np.testing.assert_array_equal(state, force != 0.0)
        # each pair's force on its own box and its own ball, and nowhere else
        for kind in (BOX, BALL):
            assert set(force[part == kind]) == set(forces[k])
            x = {f: frame.points[frame.nodes_of(kind, f), 0].mean() for f in forces[k]}
            assert x[forces[k, 0]] == pytest.approx(response.system.contacts[0].position, abs=1e-9)
            assert x[forces[k, 1]] == pytest.approx(response.system.contacts[1].position, abs=1e-9)


def test_solid_of_a_stepped_beam_has_the_beams_mass(tmp_path, structure, response):
    """Volume of the hexahedra times density; a cell of wrong orientation would count negative."""
    import pyvista

    vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=5.0)
    frame = frames(tmp_path / "a.pvd")[0]
    grid = pyvista.wrap(frame.grid)
    volume = grid.compute_cell_sizes(length=False, area=False, volume=True).cell_data["Volume"]
    beam = frame.cell["part"] == BEAM
    assert volume[beam].min() > 0.0
    assert STEEL * volume[beam].sum() == pytest.approx(structure.beam.mass, rel=1e-9)
    assert volume[frame.cell["part"] == BOX].min() > 0.0
    for segment, x in zip(structure.beam.segments, (0.05, 0.15), strict=True):
        piece = grid.extract_cells(np.flatnonzero(beam & (np.abs(grid.cell_centers().points[:, 0] - x) < 0.02)))
        width, thickness = segment.rectangle
        assert np.ptp(piece.points[:, 1]) == pytest.approx(thickness, rel=1e-12)
        assert np.ptp(piece.points[:, 2]) == pytest.approx(width, rel=1e-12)


def test_geometry_stays_and_space_adds_the_base(tmp_path, structure, response):
    vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=4.0)
    vtk.write_deflection(tmp_path / "b.pvd", response, structure, exaggeration=4.0, frame="space")
    relative, absolute = frames(tmp_path / "a.pvd"), frames(tmp_path / "b.pvd")
    assert len(relative) == len(absolute) == response.snapshots.time.size
    for time, a, b in zip(response.snapshots.time, relative, absolute, strict=True):
        np.testing.assert_array_equal(a.points, relative[0].points)
        shift = np.array([0.0, 4.0 * response.base.displacement(time), 0.0])
        speed = np.array([0.0, response.base.velocity(time), 0.0])
        np.testing.assert_allclose(b.point["displacement"] - a.point["displacement"], shift + 0 * a.points, atol=1e-12)
        np.testing.assert_allclose(b.point["velocity"] - a.point["velocity"], speed + 0 * a.points, atol=1e-12)
        assert a.number("exaggeration") == 4.0
        assert "4" in a.field["note"].GetValue(0)
        assert a.field["note"].GetValue(0) != b.field["note"].GetValue(0)


def test_thinning_keeps_the_first_and_the_last(tmp_path, structure, response):
    import pyvista

    vtk.write_deflection(tmp_path / "a.pvd", response, structure, most=3)
    times = pyvista.get_reader(tmp_path / "a.pvd").time_values
    assert len(times) == 3
    assert set(times) <= set(response.snapshots.time)
    assert (times[0], times[-1]) == (response.snapshots.time[0], response.snapshots.time[-1])


def test_a_beam_without_a_ball_is_written_too(tmp_path):
    beam = fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    bare = fi.Structure(beam=beam)
    response = invented_without_balls(bare)
    vtk.write_deflection(tmp_path / "a.pvd", response, bare)
    assert set(frames(tmp_path / "a.pvd")[0].cell["part"]) == {BEAM}


def invented_without_balls(structure: fi.Structure) -> fi.Response:
    system = fi.assemble(structure, elements=4)
    method = fi.Newmark(dt=1e-4)
    return fi.integrate(system, fi.Sine(1e-3, 5.0), method, 5e-4, record=fi.Recorder(snapshots=1))


@pytest.mark.parametrize("count", [1, 3])
def test_modes_are_steps_in_hertz(tmp_path, structure, count):
    import pyvista

    system = fi.assemble(structure, elements=10)
    modes = fi.solve_modes(system, count)
    path = vtk.write_modes(tmp_path / "modes.pvd", system, modes, structure, scale=0.03)
    assert np.array_equal(pyvista.get_reader(path).time_values, modes.natural_frequency)
    tip = (system.point_row("tip") @ modes.vectors, system.deflection_rows([structure.beam.length], 1) @ modes.vectors)
    for i, frame in enumerate(frames(path)):
        moved, rotation = frame.point["displacement"], frame.point["rotation"]
        last = np.argmax(frame.points[:, 0])
        assert frame.points[last, 0] == pytest.approx(structure.beam.length, rel=1e-14)
        assert frame.points.shape[0] >= 100
        assert np.abs(moved[:, 1]).max() == pytest.approx(0.03, rel=1e-12)
        np.testing.assert_array_equal(moved[:, [0, 2]], 0.0)
        np.testing.assert_array_equal(rotation[:, :2], 0.0)
        # the same factor scales deflection and slope; the slope is the curve's own derivative
        assert rotation[last, 2] / moved[last, 1] == pytest.approx(tip[1][0, i] / tip[0][i], rel=1e-12)
        np.testing.assert_allclose(
            np.gradient(moved[:, 1], frame.points[:, 0])[5:-5], rotation[5:-5, 2], atol=5e-3 * np.abs(rotation).max()
        )
        assert frame.number("TimeValue") == modes.natural_frequency[i]
        assert frame.number("damping_ratio") == modes.damping_ratio[i]
        assert frame.number("effective_mass") == modes.effective_mass[i]
        assert frame.number("natural_frequency") == modes.natural_frequency[i]
        assert set(frame.cell["part"]) == {BEAM}


def test_first_mode_of_a_cantilever_is_largest_at_the_tip_by_a_tenth_of_its_length(tmp_path, structure):
    system = fi.assemble(structure, elements=10)
    path = vtk.write_modes(tmp_path / "modes.pvd", system, fi.solve_modes(system, 1), structure)
    frame = frames(path)[0]
    tip = np.argmax(frame.points[:, 0])
    assert frame.point["displacement"][tip, 1] == pytest.approx(0.1 * structure.beam.length, rel=1e-12)


@pytest.mark.parametrize("stop", [KeyboardInterrupt, OSError])
def test_interrupted_write_leaves_nothing(tmp_path, structure, response, monkeypatch, stop):
    interrupt_at_third_frame(monkeypatch, stop)
    with pytest.raises(stop):
        vtk.write_deflection(tmp_path / "a.pvd", response, structure)
    assert list(tmp_path.iterdir()) == []


def test_interrupted_overwrite_keeps_what_was_there(tmp_path, structure, response, monkeypatch):
    path = vtk.write_deflection(tmp_path / "a.pvd", response, structure)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    interrupt_at_third_frame(monkeypatch, KeyboardInterrupt)
    with pytest.raises(KeyboardInterrupt):
        vtk.write_deflection(path, response, structure, exaggeration=3.0)
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


def test_shorter_overwrite_leaves_no_stale_frame(tmp_path, structure, response):
    path = vtk.write_deflection(tmp_path / "a.pvd", response, structure)
    vtk.write_deflection(path, response, structure, most=2)
    assert len(frames(path)) == 2


def interrupt_at_third_frame(monkeypatch: pytest.MonkeyPatch, stop: type[BaseException]) -> None:
    written = Path.write_text
    count = iter(range(100))

    def write_text(self: Path, *args: object, **options: object) -> int:
        if next(count) == 2:
            raise stop
        return written(self, *args, **options)

    monkeypatch.setattr(Path, "write_text", write_text)


def test_refuses_what_it_cannot_draw(tmp_path, structure, response):
    path = tmp_path / "a.pvd"
    with pytest.raises(fi.InputError, match="snapshots"):
        vtk.write_deflection(path, replace(response, snapshots=None), structure)
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(fi.InputError, match="exaggeration"):
            vtk.write_deflection(path, response, structure, exaggeration=bad)
    with pytest.raises(fi.InputError, match="frame"):
        vtk.write_deflection(path, response, structure, frame="earth")
    with pytest.raises(fi.InputError, match="most"):
        vtk.write_deflection(path, response, structure, most=0)
    system = fi.assemble(structure, elements=4)
    with pytest.raises(fi.InputError, match="scale"):
        vtk.write_modes(path, system, fi.solve_modes(system, 1), structure, scale=0.0)
    with pytest.raises(fi.InputError, match="subdivisions"):
        vtk.write_modes(path, system, fi.solve_modes(system, 1), structure, subdivisions=0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(shutil.which("pvpython") is None, reason="needs ParaView's pvpython")
def test_paraview_opens_it(tmp_path, structure, response):
    vtk.write_deflection(tmp_path / "a.pvd", response, structure, exaggeration=2.0)
    script = tmp_path / "look.py"
    script.write_text(
        "from paraview.simple import *\n"
        f"r = OpenDataFile({str(tmp_path / 'a.pvd')!r}); print('times', *r.TimestepValues)\n"
        "w = WarpByVector(Input=r); w.Vectors = ['POINTS', 'displacement']\n"
        "w.UpdatePipeline(r.TimestepValues[-1]); print('bounds', *w.GetDataInformation().GetBounds())\n"
    )
    done = subprocess.run(["pvpython", str(script)], capture_output=True, text=True, timeout=120, check=True)
    words = {line.split()[0]: np.array(line.split()[1:], dtype=float) for line in done.stdout.splitlines() if line}
    np.testing.assert_allclose(words["times"], response.snapshots.time, rtol=1e-12)
    last = frames(tmp_path / "a.pvd")[-1]
    moved = last.points + last.point["displacement"]
    np.testing.assert_allclose(words["bounds"][[0, 2, 4]], moved.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(words["bounds"][[1, 3, 5]], moved.max(axis=0), atol=1e-6)
