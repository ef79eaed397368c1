"""The demo on a shortened study: the published figures beside ours, and results that can be run again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import femimpact as fi
from femimpact import demo

pytestmark = pytest.mark.impacts


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    study = demo.paper_study()
    short = dataclasses.replace(
        study,
        sweep=dataclasses.replace(study.sweep, cycles=400, refine=8),
        base=dataclasses.replace(study.base, duration=8.0),
        output=dataclasses.replace(study.output, frames=8, movie=False),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "paper_study", lambda: short)
        plan = demo.ScanPlan((0.6, 0.78), points=21, cycles=120)
        return demo.run_demo(tmp_path_factory.mktemp("demo") / "out", scan=plan)


def test_published_figures_stand_beside_ours(found):
    rows = {row[0]: row for row in found.comparison}
    _, unit, theory, experiment, here, there, method = rows["natural frequency without ball"]
    assert (unit, theory, experiment, method) == ("Hz", 5.30, 5.05, "eigenvalue")
    assert here == there == pytest.approx(5.30, abs=5e-4)
    assert rows["natural frequency, ball glued on"][4] == pytest.approx(4.98, abs=5e-4)
    # the input ratio found again; a transient of exp(-0.0029 x 2 pi x 267) = 0.8 % is left in the window
    assert rows["damping without ball"][4] == pytest.approx(0.29, rel=0.03)
    assert rows["amplitude ratio without / with"][2:4] == (5.0, 5.0)
    assert {"impact force", "peak force", "mean impulse"} <= set(rows)
    # every number names its method
    assert all(row[6] for row in found.comparison)


def test_the_restitution_is_the_best_of_the_scan(found):
    scan = found.scans["base"]
    misfit = scan.misfit(demo.PUBLISHED["frequency_ball_experiment"], demo.PUBLISHED["amplitude_ratio"])
    assert found.restitution == scan.restitution[np.argmin(misfit)]
    assert found.results.summary["restitution"] == found.restitution
    assert found.results.summary["remarks"]


def test_the_study_that_is_left_behind_is_the_one_that_was_run(found):
    study = fi.load_study(found.results.directory / "study.toml")
    assert study.structure.impactors[0].contact.restitution == pytest.approx(found.restitution)
    assert study.base.frequency == pytest.approx(found.results.summary["history"]["frequency"], rel=1e-6)


def test_both_starts_are_in_the_tables(found):
    names = {path.name for path in found.results.directory.iterdir()}
    assert {"comparison.csv", "restitution.csv", "restitution.png", "response.png", "sweep.csv"} <= names
    assert "ball_from_rest_in_space" in found.results.summary["sweep"]


def test_a_free_directory_is_chosen_when_the_usual_one_is_taken(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert demo.free_directory("femimpact-demo").name == "femimpact-demo"
    (tmp_path / "femimpact-demo").mkdir()
    assert demo.free_directory("femimpact-demo").name == "femimpact-demo-2"
