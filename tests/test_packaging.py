"""What is promised to a package manager: lower bounds that are tried, and versions that agree."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import femimpact

ROOT = Path(__file__).parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]

OF_THEIR_TIME = {"vtk", "pandas"}
"""Needed by dependencies that name no newest version of them: held, without being asked for by us."""


def _versions(lines: list[str], relation: str) -> dict[str, str]:
    """Version of each package, from lines such as numpy>=2.0.2."""
    pairs = [re.fullmatch(rf"([a-z0-9-]+){relation}([\d.]+)", line) for line in lines]
    assert None not in pairs, lines
    return {pair[1]: pair[2] for pair in pairs}


def test_the_lowest_versions_that_are_tried_are_the_lower_bounds():
    extras = PROJECT["optional-dependencies"]
    bounds = _versions([*PROJECT["dependencies"], *extras["movie"], *extras["test"]], "(?:>=|==)")
    lines = (ROOT / ".ci" / "lowest.txt").read_text(encoding="utf-8").splitlines()
    tried = _versions([line for line in lines if not line.startswith("#")], "==")
    assert set(tried) - set(bounds) == OF_THEIR_TIME
    assert {name: tried[name] for name in bounds} == bounds


def test_the_backend_that_is_tried_is_the_one_that_builds():
    # the hook is of the interface of one major version
    tried = _versions([line for line in PROJECT["optional-dependencies"]["test"] if "hatchling" in line], ">=")
    assert PYPROJECT["build-system"]["requires"] == [f"hatchling>={tried['hatchling']},<2"]


def test_the_version_is_the_same_everywhere():
    stated = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert stated[1] == PROJECT["version"] == femimpact.__version__
    assert f"version {stated[1]}," in (ROOT / "docs" / "start.md").read_text(encoding="utf-8")
    assert f"\n## {stated[1]}\n" in (ROOT / "docs" / "development" / "changelog.md").read_text(encoding="utf-8")


def test_what_a_page_is_made_of_is_in_the_wheel_and_in_the_source_distribution(tmp_path):
    from hatchling.builders.sdist import SdistBuilder
    from hatchling.builders.wheel import WheelBuilder

    wanted = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "femimpact/app/report").iterdir()
        if path.suffix in (".css", ".js", ".py", ".pyi")
    }
    assert {"femimpact/app/report/report.css", "femimpact/app/report/player.js"} <= wanted
    for builder in (SdistBuilder, WheelBuilder):
        made = builder(str(ROOT))
        # what a builder would take, without running its hooks
        with made.config.set_build_data({"artifacts": [], "force_include": {}, "build_hooks": ()}):
            taken = {Path(file.relative_path).as_posix() for file in made.recurse_included_files()}
        assert wanted <= taken, builder.__name__


def test_every_python_that_is_named_is_allowed_and_the_oldest_and_the_newest_are_tried():
    pattern = r"Programming Language :: Python :: (3\.\d+)"
    named = [match[1] for match in (re.fullmatch(pattern, line) for line in PROJECT["classifiers"]) if match]
    workflow = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8")
    matrices = [re.findall(r"3\.\d+", line) for line in re.findall(r"^ +python: \[(.*)\]$", workflow, re.MULTILINE)]
    assert named[0] == PROJECT["requires-python"].removeprefix(">=")
    assert [(tried[0], tried[-1]) for tried in matrices] == [(named[0], named[-1])] * 2


def test_wheels_are_uploaded_without_a_password_by_one_job_alone():
    workflow = (ROOT / ".github" / "workflows" / "wheels.yml").read_text(encoding="utf-8")
    upload = workflow.partition("\n  upload:\n")[2]
    assert "id-token: write" in upload
    assert "secrets." not in workflow
    assert workflow.count("id-token: write") == 1


def test_every_action_is_held_by_its_commit():
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        uses = re.findall(r"uses: (\S+)", path.read_text(encoding="utf-8"))
        others = [name for name in uses if not name.startswith("./")]
        assert others
        assert [name for name in others if not re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", name)] == []
