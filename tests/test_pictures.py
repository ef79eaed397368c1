"""Figures and movie are drawn from files: what fails there costs no result."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from builders import (
    FILES,
    NO_PICTURES,
    REFERENCE,
    load_study,
    prepare,
    run_simulation,
    run_study,
    short_study,
    study_text,
)

import femimpact as fi
from femimpact import figures
from femimpact.app.report import pictures
from femimpact.app.results.picture_data import StructureModes, mode_shape_data, read_results
from femimpact.app.tasks.run import run_sweep
from femimpact.figures import movie
from femimpact.files import write_netcdf

DATA = Path(__file__).parent / "data"
LAST = {
    f"figures/{stem}.png" for stem in ("contact_force", "phase_portrait", "impact_histograms", "impulse_phase", "drive")
}
"""Figures that are drawn of the last cycles alone."""
FIGURES = LAST | {f"figures/{stem}.png" for stem in ("modes", "response", "response_columns", "history", "energy")}


def no_report(_what, _share):
    pass


@pytest.fixture
def ran(finished):
    return finished / "out"


@pytest.fixture(scope="module")
def study(finished):
    """That of the finished run."""
    return load_study(finished / "study.toml")


@pytest.fixture
def results(finished, tmp_path):
    return shutil.copytree(finished / "out", tmp_path / "out")


def encoder(folder, monkeypatch, script):
    """Another program in the place of ffmpeg."""
    pytest.importorskip("imageio_ffmpeg")
    program = folder / "ffmpeg"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o700)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))


def test_pictures_stand_in_the_summary_and_are_all_there(ran):
    summary = fi.load(ran).summary
    assert summary["pictures"] == {"figures": "drawn", "movie": "drawn"}
    assert all((ran / name).stat().st_size > 1000 for name in FIGURES)
    assert set(summary["checksums"]) >= FIGURES


def test_what_is_stored_is_what_was_computed(ran, study):
    # the same call gives the same bits: a round trip through the files
    prepared = prepare(study)
    results, response, sweeps = read_results(ran), run_simulation(prepared), run_sweep(prepared)
    filmed, end, structure = results.film, results.last_cycles, results.study.structure
    for field in dataclasses.fields(response.snapshots):
        stored, computed = (getattr(of.snapshots, field.name) for of in (filmed, response))
        np.testing.assert_array_equal(stored, computed)
    assert structure == study.structure
    assert end.statistics == response.statistics
    pair, drawn = response.system.balls[0], filmed.system.balls[0]
    assert (drawn.name, drawn.position, drawn.mass, drawn.gaps) == (pair.name, pair.position, pair.mass, pair.gaps)
    for name in ("time", "impulse", "side", "impactor", "restitution", "mode_share"):
        np.testing.assert_array_equal(getattr(end.impacts, name), getattr(response.impacts, name))
    # every step of the last cycles, of which the history keeps each tenth
    at = np.isin(response.time, end.time)
    np.testing.assert_array_equal(end["tip"][np.isin(end.time, response.time)], response["tip"][at])
    swept = results.curves
    np.testing.assert_array_equal(swept.coarse, sweeps.coarse)
    assert swept.curves["with ball"].peak_frequency == sweeps.ball.peak_frequency
    np.testing.assert_array_equal(swept.curves["without ball"].rms, sweeps.empty.rms)


def test_stored_mode_shapes_are_those_of_the_system(ran, system):
    found = read_results(ran).modes
    drawn, modes, structure = found.system, found.modes, found.structure
    x = np.linspace(0.0, system.nodes[-1], 7)
    shapes = system.deflection_rows(x) @ fi.solve_modes(system, 4).vectors
    np.testing.assert_allclose(drawn.deflection_rows(x) @ modes.vectors, shapes, atol=1e-9 * np.abs(shapes).max())
    assert drawn.total_mass == system.total_mass
    assert structure.masses == REFERENCE.masses
    (ball,) = drawn.contacts
    assert (ball.name, ball.position, ball.is_stop) == ("ball", system.nodes[-1], False)


def test_stored_modes_are_drawn_with_the_same_parts_as_those_in_memory(tmp_path):
    rigid = fi.Rigid(0.5)
    structure = fi.Structure(
        REFERENCE.beam,
        [fi.PointMass("box", "tip", 0.02), fi.PointMass("midbox", 0.1, 0.005, offset=0.004)],
        [fi.Impactor("ball", "box", 3e-3, (3e-3, 5e-3), rigid), fi.Impactor("second", "midbox", 1e-3, 2e-3, rigid)],
        fi.Rayleigh(0.003, (1, 2)),
        stops=[fi.Stop("post", 0.2, (6e-3, np.inf), rigid), fi.Stop("fork", 0.15, (4e-3, 5e-3), rigid)],
        springs=[fi.Spring("wire", 0.18, 5.0), fi.Spring("tie", 0.05, 5.0, to="midbox")],
        dashpots=[fi.Dashpot("damper", "mid", 0.1)],
    )
    system = fi.assemble(structure, elements=8)
    modes = fi.solve_modes(system, count=3)
    write_netcdf(tmp_path / FILES["mode_shapes"].name, mode_shape_data(system, modes))
    study = dataclasses.replace(short_study(1.0), structure=structure)
    (tmp_path / FILES["study"].name).write_text(study_text(study), encoding="utf-8")
    off_screen = figures.OffScreen()
    drawn = [
        figures.mode_shapes(one.system, one.modes, structure=one.structure, figure=off_screen)
        for one in (read_results(tmp_path).modes, StructureModes(system, modes, structure))
    ]
    for stored, computed in zip(*drawn, strict=True):
        for ours, theirs in zip(stored.lines, computed.lines, strict=True):
            assert ours.get_label() == theirs.get_label()
            np.testing.assert_allclose(ours.get_xydata(), theirs.get_xydata(), atol=1e-9)
        at = {found.get_label(): found.get_xydata() for found in stored.lines}
        for name, x in (("post", 200.0), ("fork", 150.0), ("ball", 1e3 * system.nodes[-1]), ("second", 100.0)):
            assert at[name][0, 0] == pytest.approx(x)
        # a mark of a stop on each side that is closed
        assert sum(found.get_label() == "fork" for found in stored.lines) == 2
        assert sum(found.get_label() == "post" for found in stored.lines) == 1


ON_A_MESH = """
[mesh]
file = "stepped.msh"
[[beam.segment]]
name = "thick"
length = 0.15
width = 0.02
thickness = 0.002
young_modulus = 70e9
density = 2700
[[beam.segment]]
name = "thin"
length = 0.10
width = 0.02
thickness = 0.001
young_modulus = 70e9
density = 2700
[[mass]]
name = "can"
at = "box"
mass = 0.02
[[impactor]]
name = "ball"
at = "can"
mass = 3.43e-3
gap = [1e-3, 2e-3]
contact = { law = "kelvin-voigt", restitution = 0.6, contact_time = 0.02 }
[[stop]]
name = "post"
at = "sensor"
gap = [0.2e-3, inf]
fixed_to = "space"
contact = { law = "kelvin-voigt", restitution = 0.6, contact_time = 0.02 }
[damping]
ratio = 0.003
modes = [1, 2]
[reduction]
modes = 2
[base]
amplitude = 1e-3
frequency = 9.0
duration = 2.0
[method]
name = "event-driven"
[output]
frames = 4
paraview = false
movie = false
"""


@pytest.fixture(scope="module")
def on_a_mesh(tmp_path_factory):
    """Results of a study with parts at a point of a mesh file, which is gone."""
    folder = tmp_path_factory.mktemp("on_a_mesh")
    shutil.copy(DATA / "stepped.msh", folder)
    (folder / "study.toml").write_text(ON_A_MESH, encoding="utf-8")
    study = load_study(folder / "study.toml")
    run_study(study, folder / "out", parts=("modes", "simulate"))
    (folder / "stepped.msh").unlink()
    return folder / "out"


def test_results_are_drawn_without_their_mesh_file(on_a_mesh, tmp_path):
    out = shutil.copytree(on_a_mesh, tmp_path / "out")
    drawn = {f"figures/{path.name}" for path in out.glob("figures/*.png")}
    shutil.rmtree(out / "figures")
    assert pictures.draw_kinds(out, ("figures",), no_report)[0] == {"figures": None}
    assert {f"figures/{path.name}" for path in out.glob("figures/*.png")} == drawn >= LAST
    results = read_results(out)
    ball, stop = results.film.system.contacts
    assert (ball.name, ball.position, ball.gaps, ball.law) == ("ball", 0.25, (1e-3, 2e-3), "kelvin-voigt")
    assert (stop.is_stop, stop.position, stop.gaps, stop.fixed_to) == (True, 0.1, (0.2e-3, np.inf), "space")
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "What is missing" not in text
    assert "fixed obstacle at 100 mm, gap 0.2 mm on the + side, fixed to space, kelvin-voigt" in text
    assert "free between its walls at 250 mm: gaps +1 mm, \N{MINUS SIGN}2 mm, kelvin-voigt" in text


def test_a_law_of_ones_own_keeps_no_picture_from_the_run_and_is_named_where_it_is_drawn_again(tmp_path):
    """A study file cannot say such a law: only the run itself knows what it drew."""
    law = fi.CustomLaw(lambda depth, rate, speed: 1e4 * depth, name="own")
    study = short_study(0.5, **NO_PICTURES | {"figures": True, "report": True})
    ball = dataclasses.replace(study.structure.impactors[0], contact=law)
    structure = dataclasses.replace(study.structure, impactors=(ball,))
    study = dataclasses.replace(study, structure=structure, method={"name": "newmark"}, sweep=None)
    out = tmp_path / "out"
    assert run_study(study, out).summary["pictures"] == {"figures": "drawn"}
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "free between its walls" in text
    assert (out / "figures" / "contact_force.png").exists()
    with pytest.raises(fi.InputError, match=r"impactor\.ball\.contact\.law"):
        pictures.draw_again(out, "figures", no_report)


def test_the_exaggeration_of_a_study_is_that_of_movie_and_paraview_alike(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    study = short_study(1.0, frames=4, figures=False, movie=False)
    study = dataclasses.replace(study, sweep=None, output=dataclasses.replace(study.output, exaggeration=3.0))
    run_study(study, tmp_path / "out", parts=("simulate",))
    results = read_results(tmp_path / "out")
    assert results.study.output.exaggeration == 3.0
    assert "drawn 3 times as large" in movie._film(results.film, results.study.structure, 3.0, 25, 4).caption
    reader = pyvista.get_reader(tmp_path / "out" / FILES["deflection_scene"].name)
    assert reader.read()[0].field_data["exaggeration"][0] == 3.0


@pytest.mark.skipif(os.name != "posix", reason="a shell script in the place of ffmpeg")
@pytest.mark.parametrize("script", ["cat > /dev/null; exit 0", "kill -SEGV $$"])
def test_an_encoder_that_writes_nothing_is_found(results, tmp_path, monkeypatch, script):
    encoder(tmp_path, monkeypatch, script)
    before = (results / "movie.mp4").read_bytes()
    assert pictures.draw_kinds(results, ("movie",), no_report)[0]["movie"] is not None
    assert (results / "movie.mp4").read_bytes() == before


@pytest.mark.skipif(os.name != "posix", reason="a shell script in the place of ffmpeg")
def test_a_failing_encoder_is_a_warning_and_the_movie_can_be_made_again(tmp_path, monkeypatch):
    encoder(tmp_path, monkeypatch, "exit 1")
    out, study = tmp_path / "out", short_study(3.0, frames=4, paraview=False)
    # without contacts there is one figure, of the modes
    study = dataclasses.replace(study, structure=dataclasses.replace(study.structure, impactors=()))
    results = run_study(study, out, parts=("modes", "simulate"))
    assert results.history is not None
    (warning,) = (text for text in results.summary["warnings"] if text.startswith("movie not drawn: "))
    assert f"'femimpact movie {out}' draws again" in warning
    assert results.summary["pictures"]["figures"] == "drawn"
    assert not list(out.glob("*.mp4"))
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE")
    assert pictures.draw_again(out, "movie", no_report) == ("movie.mp4",)
    summary = fi.load(out).summary
    assert summary["pictures"]["movie"] == "drawn"
    assert not [text for text in summary["warnings"] if text.startswith("movie")]
    assert "movie.mp4" in summary["checksums"]
    # nothing else has changed
    assert {**summary, **dict.fromkeys(("pictures", "warnings", "checksums", "checksum"))} == {
        **results.summary, **dict.fromkeys(("pictures", "warnings", "checksums", "checksum"))
    }  # fmt: skip


def test_figures_are_made_again(results):
    before = {name: (results / name).read_bytes() for name in FIGURES}
    for name in FIGURES:
        (results / name).unlink()
    assert set(pictures.draw_again(results, "figures", no_report)) == FIGURES
    # the same data by the same code
    assert {name: (results / name).read_bytes() for name in FIGURES} == before


def test_what_can_not_be_drawn_does_not_take_the_other_figures_with_it(results):
    # no curve to draw: the file is read, but holds not-a-numbers
    import xarray

    data = xarray.load_dataset(results / FILES["sweep_data"].name, engine="h5netcdf")
    data["peak"][:] = np.nan
    data.to_netcdf(results / FILES["sweep_data"].name, engine="h5netcdf")
    (results / "figures" / "response.png").unlink()
    (results / "figures" / "contact_force.png").unlink()
    with pytest.raises(fi.InputError, match=r"figures = .*not drawn: response.png"):
        pictures.draw_again(results, "figures", no_report)
    summary = json.loads((results / "summary.json").read_text())
    assert summary["pictures"]["figures"].startswith("not drawn: response.png: ")
    assert (results / "figures" / "contact_force.png").exists()
