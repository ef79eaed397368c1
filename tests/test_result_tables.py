"""The page on result tables has the columns that a study writes, in their order and with their units."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest
from builders import OrbitsPlan, done, load_study, paper_study_text, run_study

from femimpact.app.tasks.branches import task_of_orbits

pytestmark = pytest.mark.impacts

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "result_tables.md"

CHANGES = {
    # short runs with bounces that come to rest, and no pictures
    "duration = 120.0": "duration = 4.0",
    "cycles = 600": "cycles = 24",
    "points = 21": "points = 5",
    "refine = 40": "refine = 2",
    'name = "newmark"': 'name = "event-driven"',
    'law = "kelvin-voigt", restitution = 0.78, contact_time = 2e-3': 'law = "rigid", restitution = 0.1',
    "frames = 120": "frames = 0",
    "figures = true": "figures = false",
    "\nparaview = true": "\nparaview = false",
    "\nmovie = true": "\nmovie = false",
}


def documented() -> dict[str, list[tuple[str, str]]]:
    """Names and units of the columns of every table of the page, by its file."""
    sections = re.split(r"^## (\S+\.csv)$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    tables = {}
    for file, text in zip(sections[::2], sections[1::2], strict=True):
        rows = re.findall(r"^\| (`.*?) \| (.*?) ?\| .* \|$", text, re.MULTILINE)
        tables[file] = [(name, unit) for names, unit in rows for name in re.findall("`(.*?)`", names)]
    return tables


def written(path: Path) -> list[tuple[str, str]]:
    """Names and units of the columns of a file; of the shares of modes the first stands for all."""
    titles = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    columns = [re.fullmatch(r"([\w.]+)(?: \[(.*)\])?", title).groups("") for title in titles]
    return [(name, unit) for name, unit in columns if not re.fullmatch(r"share_of_mode_(?!1$)\d+", name)]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    text = paper_study_text()
    for old, new in CHANGES.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    study = load_study(folder / "study.toml")
    run_study(study, folder / "results")
    # without a ball: one branch, its frequency response
    alone = dataclasses.replace(study.structure, impactors=())
    plan = OrbitsPlan("frequency", (4.8, 5.0), 2.0)
    linear = dataclasses.replace(study, structure=alone, sweep=None, orbits=plan)
    done(task_of_orbits(linear), folder / "orbits")
    return [path for name in ("results", "orbits") for path in (folder / name).glob("*.csv")]


def test_every_table_and_column_is_on_the_page(results):
    page = documented()
    assert sorted(path.name for path in results) == sorted(page)
    for path in results:
        # the columns of one row stand beside one another on the page, those of one curve in the file
        assert sorted(written(path)) == sorted(page[path.name]), path.name
