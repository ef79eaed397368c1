"""The temporal VTKHDF file and the grids for notebooks: the same arrays as the series of VTU files."""

from __future__ import annotations

import numpy as np
import pytest
from builders import REFERENCE, reduced, run_study, short_study
from grids import read_series

import femimpact as fi
from femimpact.files import GuardedFile
from femimpact.vtk import write_deflection, write_modes

pytestmark = [pytest.mark.impacts, pytest.mark.usefixtures("unreported")]


@pytest.fixture(scope="module")
def response():
    record = fi.Recorder(channels=("tip",), snapshots=4, snapshots_start=1.0)
    return fi.integrate(reduced(REFERENCE), fi.Sine(0.2037e-3, 5.0), fi.EventDriven(), 2.0, record)


def steps_of(path):
    """Frames of a temporal file by VTK's reader."""
    import pyvista
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for k in range(reader.GetNumberOfSteps()):
        reader.SetStep(k)
        reader.Update()
        yield reader.GetTimeValue(), pyvista.wrap(reader.GetOutputDataObject(0)).copy()


def assert_same(one, other):
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.celltypes, other.celltypes)
    np.testing.assert_array_equal(one.cell_connectivity, other.cell_connectivity)
    assert set(one.point_data.keys()) == set(other.point_data.keys())
    for name in one.point_data:
        np.testing.assert_array_equal(one.point_data[name], other.point_data[name])
    for name in one.cell_data:
        np.testing.assert_array_equal(one.cell_data[name], other.cell_data[name])


def test_one_temporal_file_holds_the_frames_of_the_collection(tmp_path, response):
    """Every bit of every array, at every time."""
    path = write_deflection(tmp_path / "a.pvd", response, REFERENCE, exaggeration=2.0)
    frames = list(zip(*read_series(path), strict=True))
    steps = list(steps_of(write_deflection(tmp_path / "a.vtkhdf", response, REFERENCE, exaggeration=2.0)))
    assert len(frames) == len(steps) > 20
    for (time, frame), (own, step) in zip(frames, steps, strict=True):
        assert own == time
        assert_same(step, frame)


@pytest.mark.parametrize("paraview", [True, False])
def test_a_study_leaves_the_file_that_it_asks_for(tmp_path, paraview):
    study = short_study(1.0, frames=8, figures=False, movie=False, paraview=paraview, vtkhdf=True)
    folder = run_study(study, tmp_path / "out", parts=("simulate",)).directory / "paraview"
    steps = list(steps_of(folder / "deflection.vtkhdf"))
    script = (folder / "open_in_paraview.py").read_text(encoding="utf-8")
    assert len(steps) >= 8
    assert f"FILE = {'deflection.pvd' if paraview else 'deflection.vtkhdf'!r}" in script
    assert "'deflection.vtkhdf': {" in script
    if not paraview:
        assert not list(folder.glob("deflection.pvd"))
        return
    frames = list(zip(*read_series(folder / "deflection.pvd"), strict=True))
    assert len(frames) == len(steps)
    for (time, frame), (own, step) in zip(frames, steps, strict=True):
        assert own == time
        assert_same(step, frame)


def test_modes_have_the_numbers_of_modes_as_times(tmp_path, system, reference):
    modes = fi.solve_modes(system, 3)
    times = [time for time, _ in steps_of(write_modes(tmp_path / "m.vtkhdf", system, modes, reference))]
    np.testing.assert_array_equal(times, [1, 2, 3])


def test_a_failed_write_leaves_no_file(tmp_path, response, monkeypatch):
    written = []

    def full(self, data):
        written.append(1)
        self.failure = self.failure or OSError(28, "disk full")
        return memoryview(data).nbytes

    monkeypatch.setattr(GuardedFile, "write", full)
    with pytest.raises(OSError, match="disk full"):
        write_deflection(tmp_path / "a.vtkhdf", response, REFERENCE)
    assert written
    assert list(tmp_path.iterdir()) == []


def test_grids_for_notebooks_are_those_of_the_files(tmp_path, response):
    blocks = fi.vtk.to_pyvista(response, REFERENCE, exaggeration=2.0)
    path = write_deflection(tmp_path / "a.pvd", response, REFERENCE, exaggeration=2.0)
    frames = list(zip(*read_series(path), strict=True))
    assert len(blocks) == len(frames)
    for block, (time, frame) in zip(blocks, frames, strict=True):
        assert block.field_data["TimeValue"][0] == time
        assert_same(block, frame)
        assert block.field_data["units"][0] == frame.field_data["units"][0]


def test_modes_as_grids_can_be_warped(system, reference):
    modes = fi.solve_modes(system, 2)
    blocks = fi.vtk.to_pyvista(modes, reference, system, scale=0.01)
    assert blocks.keys() == [f"mode {i + 1}, {modes.natural_frequency[i]:.6g} Hz" for i in range(2)]
    warped = blocks[1].warp_by_vector("displacement")
    np.testing.assert_array_equal(warped.points, blocks[1].points + blocks[1]["displacement"])
    assert np.abs(blocks[1]["displacement"][:, 1]).max() == pytest.approx(0.01)
