"""Whatever number or text stands at a key of a study file, `check` accepts it or says in words what is wrong."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import pytest
from builders import paper_study_text, plan_lines, read_study
from command import femimpact

from femimpact.errors import FemimpactError, InputWarning

TEXT = paper_study_text()
"""What `femimpact init` writes."""

LONG = "1" + "0" * 5000

VALUES = (
    "1e300", "-1e300", "1e-300", "5e-324", "1e308", "1e30", "1e-30", "1e15", "1e-15", "nan", "inf", "-inf", "0", "-1",
    str(2**63), str(10**400), LONG, "0x10", "true", '""', f'"{"a" * 10**6}"', "[]", "[1e300, 1e-300]", "[nan, inf]",
    "[[1]]", "{a = 1}", "1979-05-27",
)  # fmt: skip

NUMBER_OR_TEXT = r"\"[^\"]*\"|\[[^\]]*\]|[^\s#,{}]+"


def _sites():
    """Path of every key, also within the contact's table, with the place of its value in the text."""
    table = ""
    for found in re.finditer(rf"(?m)^\[+(\w+)\]+|^\w+ *= *\{{|(?<![\w#] )\b(\w+) *= *({NUMBER_OR_TEXT})", TEXT):
        if found[1]:
            table = found[1]
        elif found[2] and "#" not in TEXT[TEXT.rfind("\n", 0, found.start()) + 1 : found.start()]:
            yield f"{table}.{found[2]}", found.span(3)


SITES = dict(_sites())


def test_every_key_is_found():
    assert len(SITES) == 39
    assert {"beam.length", "impactor.contact_time", "damping.modes", "sweep.cycles", "output.movie"} <= set(SITES)


@pytest.mark.parametrize("key", SITES)
def test_a_value_is_accepted_or_refused_in_words(key):
    begin, end = SITES[key]
    for value in VALUES:
        text = TEXT[:begin] + value + TEXT[end:]
        with warnings.catch_warnings():
            # an unusual size is said, which is no fault
            warnings.simplefilter("ignore", InputWarning)
            try:
                plan, refused = list(plan_lines(read_study(text, Path("study.toml")))), ""
            except FemimpactError as error:
                plan, refused = [], str(error)
        assert plan or refused
        assert max(map(len, refused.splitlines()), default=0) < 1000


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("x = " + "[" * 3000 + "]" * 3000, "lists or tables in one another"),
        ("x = " + "{a=" * 3000 + "1" + "}" * 3000, "lists or tables in one another"),
        (".".join("a" * 3000) + " = 1", "tables or lists in one another more than 20 times"),
        ("x = " + "[" * 100 + "]" * 100, "tables or lists in one another more than 20 times"),
        (f"x = {LONG}", "a number of 5001 digits in line 7"),
        ("frames = 1\nframes = 2", "Cannot overwrite a value"),
        ("#" * 10_000_001, "bytes, of which at most"),
    ],
    ids=["lists", "tables", "dotted", "deep", "digits", "repeated", "long"],
)
def test_a_text_that_python_cannot_read_is_one_line_and_exit_status_2(tmp_path, more, words):
    study = tmp_path / "study.toml"
    study.write_text(f"[beam]\nlength = 0.1\n\n# a comment\n\n[output]\n{more}\n", encoding="utf-8")
    done = femimpact("check", study, cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert words in done.stderr
