"""Tables of the pages are those of the files that the code made, and benchmarks write such files."""

from __future__ import annotations

import csv
import importlib.util
import math
from pathlib import Path
from types import SimpleNamespace

import femimpact as fi
from femimpact.app.study.study_file import study_schema

ROOT = Path(__file__).parents[1]


def loaded(path):
    """A module of a script."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_pages_have_the_tables_of_their_files():
    assert loaded(ROOT / "docs" / "make_tables.py").main(check=True) == []


def test_the_schema_is_the_same_whether_or_not_a_docstring_was_read():
    assert fi.PointMass.__doc__.count("Must be") > 2
    body = study_schema()
    assert "Must be" not in str(body["properties"]["mass"])


def test_the_reference_has_every_key_and_every_command_as_plain_markdown():
    # what the pages hold, `test_pages_have_the_tables_of_their_files` compares with the schema and the help
    keys, commands = (
        (ROOT / "docs" / "reference" / f"{name}.md").read_text(encoding="utf-8")
        for name in ("study_file", "command_line")
    )
    assert "{include}" not in keys + commands
    assert '| `report` | `true` or `false` or `"short"` |' in keys
    assert "| `begin` | number | s | `0.0` | >= 0 | When it begins. |" in keys
    assert "amplitude of the base's" not in keys
    assert "## femimpact run\n" in commands


def test_benchmarks_write_the_tables_of_the_page(tmp_path):
    def row(tool, task, cpu, tip, own):
        return SimpleNamespace(tool=tool, space="8 modes", task=task, cpu=cpu, tip=tip, own=own)

    rows = [
        row("femimpact, Newmark", "A", 0.03, 0.001, True),
        row("femimpact, Newmark", "B", 0.1, 0.01, True),
        row("C by hand, 8 cases side by side", "B", 0.04, 0.01, False),
        row("another program", "A", 12.0, 0.002, False),
        row("another program", "B", math.nan, math.nan, False),
    ]
    points = [SimpleNamespace(tool="femimpact, Newmark", own=True, error=error, cpu=0.005) for error in (1e-2, 1e-4)]
    loaded(ROOT / "benchmarks" / "report.py").write_page_tables(tmp_path, rows, points)

    def cells(name):
        with (tmp_path / f"{name}.csv").open(newline="") as file:
            return list(csv.reader(file))[1:]

    assert cells("beside_c") == [
        ["femimpact, Newmark", "8 modes", "30", "0.001", "100", "0.01", "2.5"],
        ["C by hand, 8 cases side by side", "8 modes", "", "", "40", "0.01", "1"],
    ]
    assert cells("beside_programs") == [["another program", "8 modes", "12", "0.002", "", ""]]
    assert cells("time_for_error") == [["femimpact, Newmark", "5", "5", "5", "", ""]]
