"""Scripts for ParaView, read as text: what they say of the data is what the data is. `test_paraview` runs them."""

from __future__ import annotations

import ast
import dataclasses
import math

import numpy as np
import pytest
from builders import REFERENCE, reduced
from grids import points_of

import femimpact as fi
from femimpact import vtk
from femimpact.scene.scene import BALL, BEAM, CONTACT_POINT, STOP
from femimpact.vtk.script import script_path

TWO = dataclasses.replace(
    REFERENCE,
    masses=(*REFERENCE.masses, fi.PointMass("midbox", at=0.12, mass=0.008)),
    impactors=(
        dataclasses.replace(REFERENCE.impactors[0], name="tip ball"),
        fi.Impactor("mid ball", "midbox", 2e-3, 1e-3, fi.KelvinVoigt(restitution=0.6, contact_time=1e-3)),
    ),
)


def constants(path):
    """What the script in the folder of a file says of it; the script must compile."""
    return said_of_all(path)["FILES"][path.name]


def said_of_all(path):
    """Names at the top level of a script that have a literal value."""
    tree = ast.parse(script_path(path).read_text(encoding="utf-8"))
    compile(tree, "script", "exec")
    found = {}
    for line in tree.body:
        if isinstance(line, ast.Assign) and isinstance(line.targets[0], ast.Name):
            try:
                found.setdefault(line.targets[0].id, ast.literal_eval(line.value))
            except ValueError:
                continue
    return found


def frames(path):
    """Times and grids, by VTK's reader."""
    import pyvista

    reader = pyvista.get_reader(path)
    for time in reader.time_values:
        reader.set_active_time_value(time)
        yield time, reader.read()[0].copy()


def test_every_mode_has_a_colour_bar_of_its_own(tmp_path, system, reference):
    path = vtk.write_modes(tmp_path / "modes.pvd", system, fi.solve_modes(system, 4), reference)
    said = constants(path)
    assert len(said["BARS"]) == 4
    assert said["START"] == 1.0
    assert said["CLOSE_UP"] is None
    for (end, title), (time, grid) in zip(said["BARS"], frames(path), strict=True):
        stress, largest = grid["relative_stress"], np.abs(grid["axial_stress"]).max()
        assert stress * largest == pytest.approx(grid["axial_stress"], rel=1e-12)
        # one bar for both signs: both surfaces have the largest stress
        assert (stress.min(), stress.max(), end) == pytest.approx((-1.0, 1.0, 1.0), rel=1e-12)
        assert title.endswith(f"of mode {time:.0f}")
        # what ParaView colours by without the script
        assert grid.active_scalars_name == "relative_stress"


def test_one_mode_has_the_bar_of_its_whole_period(tmp_path, system, reference):
    path = vtk.write_mode(tmp_path / "mode_2.pvd", system, fi.solve_modes(system, 2), reference, mode=2, frames=8)
    ((end, title),) = constants(path)["BARS"]
    largest = [np.abs(grid["relative_stress"]).max() for _, grid in frames(path)]
    assert largest == pytest.approx(np.abs(np.cos(2.0 * np.pi * np.arange(8) / 8)), abs=1e-12)
    assert end == 1.0
    assert title.endswith("mode 2")


def test_colours_are_those_of_a_preset_that_has_one_neutral_colour_at_zero(tmp_path, system, reference):
    """ParaView 5.11 has two colours at zero in "Cool to Warm (Extended)", in the wrong order."""
    path = vtk.write_modes(tmp_path / "modes.pvd", system, fi.solve_modes(system, 1), reference)
    text = script_path(path).read_text(encoding="utf-8")
    assert 'ApplyPreset("Cool to Warm", True)' in text
    assert "Extended" not in text


def test_the_text_of_one_file_needs_no_field_data(tmp_path, system, reference):
    path = vtk.write_modes(tmp_path / "modes.vtkhdf", system, fi.solve_modes(system, 2), reference)
    # names that ParaView's annotation defines itself
    assert eval(constants(path)["WORDS"], {"t_value": 2.0}) == "time value 2"


def test_one_script_opens_every_file_of_its_folder(tmp_path, system, reference):
    modes = fi.solve_modes(system, 2)
    first = vtk.write_modes(tmp_path / "modes.pvd", system, modes, reference)
    alone = constants(first)
    second = vtk.write_mode(tmp_path / "mode_2.pvd", system, modes, reference, mode=2, frames=4)
    said = said_of_all(first)
    # the last one unless another is asked for, and what is said of the first one stays
    assert said["FILE"] == "mode_2.pvd"
    assert list(said["FILES"]) == ["modes.pvd", "mode_2.pvd"]
    assert constants(first) == alone
    assert [file.name for file in tmp_path.glob("*.py")] == [script_path(second).name]
    # a file that is gone is left out, and what is changed by hand stays
    second.unlink()
    script = script_path(first)
    script.write_text(script.read_text().replace("'START': 1.0", "'START': 2.0"))
    vtk.write_mode(tmp_path / "mode_1.pvd", system, modes, reference, mode=1, frames=4)
    assert list(said_of_all(first)["FILES"]) == ["modes.pvd", "mode_1.pvd"]
    assert constants(first)["START"] == 2.0


@pytest.mark.parametrize(
    "text", ["FILES = [1]", "FILES = {'modes.pvd': open}", "not (python", "\0", "", "FILES = {1: 2}"]
)
def test_what_is_no_script_of_ours_is_replaced(tmp_path, system, reference, text):
    path = tmp_path / "modes.pvd"
    script_path(path).write_text(text)
    vtk.write_modes(path, system, fi.solve_modes(system, 1), reference)
    assert list(said_of_all(path)["FILES"]) == ["modes.pvd"]


@pytest.fixture(scope="module")
def two_balls(tmp_path_factory):
    record = fi.Recorder(channels=("tip",), snapshots=8, snapshots_start=2.0)
    run = fi.integrate(reduced(TWO), fi.Sine(0.5e-3, 4.7), fi.EventDriven(), 3.0, record)
    path = vtk.write_deflection(tmp_path_factory.mktemp("two") / "deflection.pvd", run, TWO)
    return run, constants(path), list(frames(path))


@pytest.mark.impacts
def test_the_largest_impact_is_shown_first_and_its_ball_closely(two_balls):
    run, said, shown = two_balls
    table = run.impacts
    late = np.flatnonzero((table.time >= shown[0][0]) & np.isin(table.time, [time for time, _ in shown]))
    hardest = late[np.argmax(table.impulse[late])]
    assert said["START"] == table.time[hardest]
    assert said["CLOSE_UP"] == table.impactor[hardest]
    for j, name in enumerate(("tip ball", "mid ball")):
        low, high = np.reshape(said["CLOSE_UPS"][name], (3, 2)).T
        for _, grid in shown:
            moved = (grid.points + grid["displacement"])[points_of(grid, grid["contact_pair"] == j)]
            # bounds are written with six digits
            assert np.all(moved > low - 1e-6)
            assert np.all(moved < high + 1e-6)


@pytest.mark.impacts
def test_the_words_of_a_frame_are_the_arrows_that_it_shows(two_balls):
    """Every contact that presses is named, with its wall and the largest component of each of its two vectors."""
    said = 0
    for _, grid in two_balls[2]:
        expected = []
        for j, name in enumerate(("tip ball", "mid ball")):
            marks = points_of(grid, (grid["part"] == CONTACT_POINT) & (grid["contact_pair"] == j))
            sizes = [grid[f"contact_{what}_vector"][marks, 1] for what in ("force", "impulse")]
            words = [
                f"{what} {np.abs(size).max():.3g} {unit}"
                for what, size, unit in zip(("force", "impulse"), sizes, ("N", "N s"), strict=True)
                if np.any(size)
            ]
            if words:
                # marks are those of the + wall, the ball beside it, the - wall, the ball beside that
                side = "+" if np.any([size[:2] for size in sizes]) else "-"
                expected.append(f"{name} on its {side} wall: {', '.join(words)}")
        assert grid.field_data["contacts"][0] == "\n".join(expected)
        said += len(expected)
    assert said > 5


@pytest.mark.impacts
def test_arrows_begin_in_front_of_what_would_hide_them(two_balls):
    grid = two_balls[2][0][1]
    for j in range(2):
        mine = grid["contact_pair"] == j
        marks, ball = (points_of(grid, mine & (grid["part"] == part)) for part in (CONTACT_POINT, BALL))
        assert grid.points[marks, 2].min() > grid.points[ball, 2].max()


@pytest.mark.impacts
def test_arrows_stand_beside_the_box_in_every_frame_and_within_the_view(two_balls):
    _, said, shown = two_balls
    assert len(said["ARROWS"]) == 2
    for j, name in enumerate(("tip ball", "mid ball")):
        for _, grid in shown:
            moved, mine = grid.points + grid["displacement"], grid["contact_pair"] == j
            marks = moved[points_of(grid, mine & (grid["part"] == CONTACT_POINT)), 0]
            edge = moved[points_of(grid, mine), 0].max()
            for _, _, beside, _ in said["ARROWS"]:
                assert marks.min() + beside > edge
                assert marks.max() + beside < said["CLOSE_UPS"][name][1]


def test_arrows_of_a_stop_begin_in_front_of_stop_and_beam():
    stop = fi.Stop("stop", at="tip", gap=(2e-3, math.inf), contact=fi.Rigid(restitution=0.6))
    structure = dataclasses.replace(REFERENCE, impactors=(), stops=(stop,))
    system = fi.assemble(structure, elements=4)
    grid = fi.vtk.to_pyvista(fi.solve_modes(system, 1), structure, system)[0]
    marks = points_of(grid, grid["part"] == CONTACT_POINT)
    hiding = points_of(grid, np.isin(grid["part"], (STOP, BEAM)))
    assert grid.points[marks, 2].min() >= grid.points[hiding, 2].max()
