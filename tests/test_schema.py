"""The JSON schema of the study file judges as `load_study` does, apart from the rules that it names."""

from __future__ import annotations

import copy
import itertools
import json
import re
import tomllib

import pytest
from builders import TABLES, load_study, paper_study_text, study_schema
from command import femimpact

import femimpact as fi
from femimpact.app.study.schema import NOT_IN_SCHEMA

jsonschema = pytest.importorskip("jsonschema")

STUDY = """
[study]
measures = ["peak", "rms"]
starts = 8
cycles = 60
[study.axes]
"impactor.ball.gap" = [0.001, [0.002, 0.003]]
impactor.ball.mass = { from = 0.003, to = 0.004, points = 3, spacing = "logarithmic" }
"base.frequency" = { normal = [5.0, 0.1] }
damping.ratio = { lognormal = [0.003, 0.2] }
"beam.thickness" = { uniform = [0.001, 0.002] }
[study.sample]
points = 64
seed = 1
method = "halton"
[study.best]
measure = "peak"
worst_over = ["base.frequency"]
limits = { peak_force = 50.0 }
"""
STEPPED = """
damping = { ratios = [0.003, 0.004] }
base = { frequency = 5.0, amplitude = 2e-4, phase = 0.3, duration = 5.0, start = "static" }
method = { name = "hht", dt = 1e-4 }
gravity = { acceleration = -9.81 }
mesh = { elements = 20 }
[[beam.segment]]
name = "thick"
length = 0.1
width = 0.02
thickness = 2e-3
young_modulus = 70e9
density = 2700
[[beam.segment]]
name = "thin"
length = 0.13
area = 2e-5
second_moment = 1.7e-12
young_modulus = 70e9
density = 2700
[[support]]
kind = "clamped"
at = "root"
[[impactor]]
name = "ball"
at = "tip"
mass = 3.4e-3
gap = [0.003, 0.004]
contact = { law = "hertz", stiffness = 1e6 }
[[stop]]
name = "s"
at = 0.15
gap = [inf, 0.01]
fixed_to = "space"
contact = { law = "kelvin-voigt", stiffness = 1e4, damping = 1.0 }
[[spring]]
name = "k"
at = "tip"
stiffness = 3.0
to = 0.1
"""
RANDOM = """
beam = { length = 0.23, width = 0.02, thickness = 1e-3, young_modulus = 70e9, density = 2700 }
mesh = { elements = 16 }
damping = { ratio = 0.003, modes = [1, 2] }
reduction = { modes = 6 }
base = { kind = "random", psd = [[5.0, 0.1], [50.0, 0.1]], duration = 5.0, seed = 3, initial = "space" }
method = { name = "event-driven", samples_per_cycle = 32 }
output = { interval = 1e-3, channels = ["tip.velocity"], report = false }
"""
SOUND = tomllib.loads(paper_study_text() + STUDY)
STUDIES = {"paper": (SOUND, 5), "stepped": (tomllib.loads(STEPPED), 9), "random": (tomllib.loads(RANDOM), 3)}
"""Studies, and how many of their mutants there are for one that the test takes: each step meets every change."""
RULES = (
    ("nan", r"\bnan\b"),
    (
        "pairs of keys",
        r": give (exactly one pair|width and thickness|either elements|either two modes)"
        r"|: is missing: one of ",
    ),
    (
        "comparisons",
        r": must (be > start|not be the value of from|be > 0, as to|be \[.*\], the (first|last)"
        r"|have frequencies that rise|hold 1 to [\d,]+ lines)",
    ),
    ("units", r": must have a unit that fits|: must have a level beside it"),
    ("axes", r": must be a power of two"),
    ("how many numbers", r": must be (two different values|one number (>= 0 )?or two)"),
    ("names", r": must (be one of root, tip, mid|be letters, digits|be distinct|have distinct)"),
    ("files", r": must be (readable|an existing)"),
    ("structure", r": must be within the beam"),
)
"""Words of `load_study` for each rule that the schema does not hold."""
VALUES = (-1.0, 0.0, 1e40, float("inf"), float("nan"), 0.3, 7, "text", "7 furlongs", True, [], [0.1, 0.2], {}, 10**400)
"""With a key left out and one of another name these are seventeen mutants of every key."""


def toml(value):
    """A value of TOML, tables in line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    # of numbers both have the same words
    return repr(value) if isinstance(value, float) else json.dumps(value)


def leaves(data, path=()):
    """Paths of all keys."""
    parts = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in parts:
        if isinstance(key, str):
            yield (*path, key)
        yield from leaves(value, (*path, key))


def changed(sound, path, change):
    data = copy.deepcopy(sound)
    place = data
    for key in path[:-1]:
        place = place[key]
    change(place, path[-1])
    return data


def mutants(sound):
    """A study with one key of another value, left out, or unknown."""
    for path in leaves(sound):
        yield changed(sound, path, lambda place, key: place.pop(key))
        yield changed(sound, path, lambda place, key: place.update({key + "x": place.pop(key)}))
        for value in VALUES:
            yield changed(sound, path, lambda place, key, value=value: place.update({key: value}))


@pytest.fixture(scope="module")
def validator():
    schema = study_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def judged(tmp_path, data):
    """What `load_study` has against a study; nothing of a sound one."""
    path = tmp_path / "study.toml"
    path.write_text("\n".join(f"{key} = {toml(value)}" for key, value in data.items()), encoding="utf-8")
    try:
        load_study(path)
    except fi.InputError as error:
        return str(error) or "refused without a word"
    return ""


@pytest.mark.parametrize("name", STUDIES)
def test_mutants_are_judged_alike_apart_from_the_named_rules(tmp_path, validator, name):
    sound, step = STUDIES[name]
    assert judged(tmp_path, sound) == ""
    unlike, count = [], 0
    for data in itertools.islice(mutants(sound), 0, None, step):
        count += 1
        told, refused = judged(tmp_path, data), not validator.is_valid(data)
        # what the schema refuses is refused; what it lets through is sound, or breaks a named rule
        if refused and not told:
            unlike.append(("the schema alone refuses", data, [e.message for e in validator.iter_errors(data)][:2]))
        elif not refused:
            # every line of it is of a named rule
            unnamed = [line for line in told.splitlines() if not any(re.search(words, line) for _, words in RULES)]
            unlike += [("load_study alone refuses", line, "") for line in unnamed]
    assert count > 90
    assert unlike == []


def test_every_rule_that_is_left_out_is_named():
    assert [name for name, _ in RULES] == [next(name for name, _ in RULES if name in rule) for rule in NOT_IN_SCHEMA]


@pytest.mark.parametrize(
    "change",
    [
        {"damping": {"ratios": [0.01, 0.02]}},
        {"base": {"record": "shaker.csv", "scale": 9.8, "columns": [0, "z"], "duration": 2.0}, "sweep": None},
        {"method": {"name": "event-driven", "samples_per_cycle": 32}},
        {
            "stop": [
                {"name": "s", "at": 0.1, "gap": [float("inf"), -1e-4], "contact": {"law": "rigid", "restitution": 1}}
            ]
        },
        {"beam": {"segment": [dict(SOUND["beam"], name="a"), dict(SOUND["beam"], name="b", end_width=0.01)]}},
        {
            "reduction": {"modes": 4},
            "gravity": {"acceleration": "-1 g"},
            "mesh": {"elements": 9},
            "beam": dict(SOUND["beam"], length="23 cm", young_modulus="70 GPa"),
            "damping": {"ratio": "0.3 %", "modes": [1, 2]},
            "sweep": None,
            "base": {"kind": "random", "psd": [["20 Hz", "3 dB/oct"], [80, "0.1 g^2/Hz"]], "duration": "2 s"},
            "impactor": [{**SOUND["impactor"][0], "gap": ["4 mm", 3e-3], "mass": "3 g"}],
            "study": {
                "measures": ["peak"],
                "axes": {
                    "impactor.ball.gap": ["4 mm", ["3 mm", 0.005]],
                    "impactor.ball.mass": {"from": "3 g", "to": "4 g", "points": 2},
                },
            },
        },
        {"gravity": {"acceleration": -9.81}, "spring": [{"name": "k", "at": "tip", "stiffness": 3, "to": 0.1}]},
    ],
    ids=lambda change: next(iter(change)),
)
def test_other_sound_studies_are_sound_to_the_schema(validator, change):
    data = {key: value for key, value in {**SOUND, **change}.items() if value is not None}
    assert [error.message for error in validator.iter_errors(data)] == []


def test_every_key_has_a_meaning_and_every_number_a_unit():
    def keys(part):
        for name, about in part.get("properties", {}).items():
            yield name, about
            yield from keys(about)
        for inner in (*part.get("oneOf", ()), *([part["items"]] if "items" in part else ())):
            yield from keys(inner)

    found = [item for name in TABLES for item in keys(study_schema()["properties"][name])]
    assert len(found) > 100
    assert [name for name, about in found if not about.get("description")] == []
    numbers = [name for name, about in found if about.get("type") in ("number", "integer") and "x-unit" not in about]
    assert numbers == []


def test_the_command_writes_a_schema_once(tmp_path):
    assert json.loads(femimpact("schema", cwd=tmp_path).stdout) == study_schema()
    femimpact("schema", "-o", "s.json", cwd=tmp_path)
    assert json.loads((tmp_path / "s.json").read_text(encoding="utf-8")) == study_schema()
    again = femimpact("schema", "-o", "s.json", cwd=tmp_path, check=False)
    assert again.returncode == 2
    assert "exists already" in again.stderr
