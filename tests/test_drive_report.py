"""What the summary and the report of a run say of its drives."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from test_study_forces import HAMMER, REST, SINE, read

import femimpact as fi
from femimpact.export.report.charts import energy_section
from femimpact.study.run import run_study

SHAKER = '[[force]]\nname = "shaker"\nat = "mid"\nkind = "sine"\nforce = 0.1\nfrequency = 33.0\n'
QUIET = "[output]\nfigures = false\nmovie = false\nparaview = false\n"


def ran(folder: Path, *parts: str) -> tuple[fi.StudyResults, str]:
    """Results of a study of these tables, and its report."""
    results = run_study(read(*parts, QUIET), folder / "out", parts=("simulate",))
    return results, (folder / "out" / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def two_drives(tmp_path_factory):
    return ran(tmp_path_factory.mktemp("two"), SINE, SHAKER)


@pytest.fixture(scope="module")
def hammer(tmp_path_factory):
    return ran(tmp_path_factory.mktemp("hammer"), REST, HAMMER)


def markup(section) -> str:
    return " ".join(ElementTree.tostring(one, encoding="unicode") for one in section.content)


def test_the_summary_has_the_work_of_every_drive_and_their_sum(two_drives, hammer):
    summary = two_drives[0].summary
    assert list(summary["work_of"]) == ["base", "shaker"]
    assert sum(summary["work_of"].values()) == pytest.approx(summary["work"], rel=1e-12)
    assert summary["work"] == two_drives[0].history["energy_work"].to_numpy()[-1]
    # a single one has all of it, by its own name
    summary = hammer[0].summary
    assert summary["work_of"] == {"hammer": summary["work"]}
    assert summary["work"] > 0.0


def test_the_balance_in_the_report_names_what_does_the_work(hammer):
    text = hammer[1]
    assert "work of hammer" in text
    assert "work of the base" not in text


def test_the_chart_of_several_drives_has_each_of_them_and_their_sum():
    system = fi.System.from_matrices([[1.0]], [[0.4]], [[900.0]], points={"mass": [1.0]})
    drives = fi.Sine(1e-3, 5.0) + fi.PointForce("mass", fi.Sine(0.1, 3.0), "shaker")
    run = fi.integrate(system, drives, fi.EventDriven(), 2.0)
    history = run.to_xarray().assign(
        {f"energy_work_of_{name}": ("time", work) for name, work in run.energy.work_of.items()}
    )
    said = markup(energy_section(history))
    for words in ("work of all drives", "work of the base", "work of shaker"):
        assert words in said
    for name, work in run.energy.work_of.items():
        assert f'data-value="{float(work[-1])!r}"' in said, name
    # of one drive the sum is its own
    single = fi.integrate(system, fi.Sine(1e-3, 5.0), fi.EventDriven(), 2.0)
    said = markup(energy_section(single.to_xarray()))
    assert "work of the base" in said
    assert "all drives" not in said
