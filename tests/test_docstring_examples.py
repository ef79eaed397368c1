"""Examples in docstrings of public names run, and every name that scripts use most has one, there or in the gallery."""

from __future__ import annotations

import dataclasses
import doctest
import inspect
import re
from pathlib import Path

import pytest
from builders import REFERENCE, reduced
from public import PATHS, public

import femimpact as fi

ROOT = Path(__file__).parents[1]

MOST_USED = 40


def with_examples():
    """Public names whose docstring has an example."""
    return [name for name in PATHS if ">>>" in (inspect.getdoc(public(name)) or "")]


def names():
    """What an example may use besides what it makes."""
    rigid = dataclasses.replace(
        REFERENCE, impactors=tuple(dataclasses.replace(ball, contact=fi.Rigid(0.6)) for ball in REFERENCE.impactors)
    )
    bare = dataclasses.replace(REFERENCE, impactors=())
    return {"structure": REFERENCE, "system": reduced(REFERENCE, 4, 10), "rigid": reduced(rigid, 4, 10), "bare": bare}


@pytest.mark.parametrize("name", with_examples())
def test_an_example_runs(name, monkeypatch):
    monkeypatch.chdir(ROOT)
    text = inspect.getdoc(public(name))
    test = doctest.DocTestParser().get_doctest(text, names(), name, None, 0)
    assert doctest.DocTestRunner().run(test).failed == 0


def test_every_name_that_scripts_use_most_has_an_example():
    scripts = {path: path.read_text(encoding="utf-8") for path in (ROOT / "examples").glob("*.py")}
    pages = [
        path.read_text(encoding="utf-8")
        for path in (*ROOT.glob("docs/*.md"), *ROOT.glob("docs/[dhp]*/*.md"), ROOT / "README.md")
    ]
    called = r"\bfi\.(?:\w+\.)?([A-Za-z_]+)"
    used = re.findall(called, "\n".join([*scripts.values(), *pages]))
    most = sorted(set(PATHS) & set(used), key=lambda name: (-used.count(name), name))[:MOST_USED]
    shown = set(re.findall(called, "\n".join(scripts.values()))) | set(with_examples())
    assert set(most) <= shown
