"""Forces in study files: read, written, described, refused, run, and axes of a parameter study."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from builders import read_study, same_study, study_schema, study_text

import femimpact as fi
from femimpact.app.parametric.paths import paths_of_study, study_with

HEAD = """
[beam]
length = 0.23
width = 0.02
thickness = 1e-3
young_modulus = 70e9
density = 2700

[mesh]
elements = 4

[reduction]
modes = 2

[method]
name = "event-driven"
"""
SINE = '[base]\namplitude = 1e-3\nfrequency = 5.0\nduration = 2.0\nstart = "space"\n'
REST = '[base]\nkind = "rest"\nhistory = 2.0\ninitial = "static"\n'
HAMMER = '[[force]]\nname = "hammer"\nat = "tip"\nkind = "hammer"\nimpulse = 0.002\nduration = 0.003\nbegin = 0.3\n'
COIL = '[[force]]\nname = "coil"\nat = 0.1\nkind = "sine"\nforce = 0.01\nfrequency = 5.0\nphase = 0.4\n'
SWEEP = '[[force]]\nname = "swept"\nat = "tip"\nkind = "chirp"\nforce = 1.0\nstart = 4\nstop = 9\nduration = 2\n'
PULSE = (
    '[[force]]\nname = "swept"\nat = "tip"\nkind = "shock"\npulse = "triangle"\n'
    "force = 1.0\nduration = 0.01\ndelay = 0.1\n"
)
UNNAMED = '[[force]]\nat = "tip"\nkind = "sine"\nforce = 0.01\nfrequency = 5.0\n'
KINDS = {
    'kind = "chirp"\nforce = 0.1\nstart = 3\nstop = 9\nduration = 1.0\nrate = "logarithmic"': fi.Chirp(
        3, 9, 1.0, amplitude=0.1, kind="logarithmic"
    ),
    'kind = "random"\npsd = [[2, 1e-3], [60, 1e-3]]\nduration = 2.0\nseed = 3': fi.RandomBase(
        [(2, 1e-3), (60, 1e-3)], 2.0, 3
    ),
    'kind = "shock"\npulse = "half-sine"\nforce = 2.0\nduration = 0.01': fi.Shock("half-sine", 2.0, 0.01),
    'kind = "stepped-sine"\nfrequencies = [4, 5]\ncycles = 3\nforce = 0.1': fi.SteppedSine([4, 5], 3, amplitude=0.1),
}
DRIVES = fi.excitation.Drives(
    fi.Sine(1e-3, 5.0),
    [fi.HammerBlow("tip", 0.002, 0.003, 0.3, name="hammer"), fi.PointForce(0.1, fi.Sine(0.01, 5.0, 0.4), "coil")],
)


def read(*parts: str) -> fi.app.Study:
    """A study of these tables."""
    text = HEAD + "\n".join(parts)
    jsonschema.Draft202012Validator(study_schema()).validate(tomllib.loads(text))
    return read_study(text, Path("study.toml"))


def test_forces_beside_a_base_are_drives_and_are_written_as_they_were_read():
    study = read(SINE, HAMMER, COIL)
    assert study.excitation == DRIVES
    assert study.initial.frame == "space"
    assert study.history_duration == 2.0
    other = replace(study, output=replace(study.output, frames=10))
    assert same_study(read_study(study_text(other), study.path), other)


def test_one_force_beside_a_base_at_rest_stays_itself():
    study = read(REST, HAMMER)
    assert study.excitation == DRIVES.forces[0]
    assert study.initial.equilibrium
    assert read(REST, HAMMER, COIL).excitation == fi.excitation.Drives(forces=DRIVES.forces)
    other = replace(study, output=replace(study.output, frames=10))
    assert same_study(read_study(study_text(other), study.path), other)


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_force_is_the_history_of_that_kind(kind):
    study = read(REST, f'[[force]]\nat = "mid"\n{kind}\n')
    assert study.excitation == fi.PointForce("mid", KINDS[kind])


def test_the_response_curve_of_the_page_has_the_linear_peak_without_the_ball():
    page = Path(__file__).parent.parent / "docs" / "howto" / "several_drives.md"
    block = page.read_text(encoding="utf-8").partition("```toml\n")[2].partition("```")[0]
    # a force and frequencies for this beam, and a run long enough to be steady
    for old, new in (
        ("40 N", "0.1 N"),
        ("185 Hz", "12 Hz"),
        ("from = 160, to = 200, points = 61", "from = 12, to = 18, points = 2"),
    ):
        assert old in block
        block = block.replace(old, new)
    ball = '[[impactor]]\nname = "ball"\nat = "tip"\nmass = 1e-3\ngap = 1e-4\n'
    ball += 'contact = { law = "rigid", restitution = 0.6 }\n'
    damping = "[damping]\nratio = 0.1\nmodes = [1, 2]\n"
    study = read_study(HEAD + REST + ball + damping + block, Path("study.toml"))
    plan = study.plan
    found = fi.parameter_study(study, plan.axes, plan.measures)
    bare = fi.without_impactors(fi.reduce(fi.assemble(study.structure, 4), 2))
    runs = [fi.integrate(bare, fi.PointForce("tip", fi.Sine(0.1, f)), fi.EventDriven(), 2.0) for f in (12.0, 18.0)]
    linear = [run.largest("tip").value for run in runs]
    np.testing.assert_allclose(found["peak"] / found["peak_ratio"], np.abs(linear), rtol=1e-9)
    assert np.all(found["peak_ratio"] != 1.0)


def test_numbers_of_forces_are_axes():
    study = read(SINE, HAMMER, COIL)
    known = paths_of_study(study)
    wanted = {"force.hammer.impulse": 0.5, "force.coil.force": 0.02, "force.coil.at": "mid", "base.amplitude": 2e-3}
    drives = study_with(study, {known[path]: value for path, value in wanted.items()}).excitation
    assert drives.base.amplitude == 2e-3
    assert drives.forces[0].impulse == 0.5
    assert (drives.forces[1].at, drives.forces[1].history.amplitude) == ("mid", 0.02)
    assert known["force.coil.force"].unit == "N"
    assert known["force.hammer.impulse"].unit == "N s"


def test_numbers_at_their_defaults_are_axes():
    known = paths_of_study(read(SINE, HAMMER.replace("begin = 0.3\n", ""), COIL.replace("phase = 0.4\n", "")))
    assert known["force.hammer.begin"].unit == "s"
    assert known["force.coil.phase"].unit == "rad"
    pulse = read(REST, PULSE.replace("delay = 0.1\n", ""))
    delayed = study_with(pulse, {paths_of_study(pulse)["force.swept.delay"]: 0.2}).excitation
    assert delayed.history == fi.Shock("triangle", 1.0, 0.01, delay=0.2)
    chirp = SUM.partition("[[base.parts]]\nkind")[2].replace("duration", "history = 2.0\nduration")
    alone = paths_of_study(read("[base]\nkind" + chirp))
    assert alone["base.fade"].unit == "s"
    # of two that exclude each other the one that is not given is none
    assert "base.amplitude" not in alone
    assert "base.octaves_per_minute" not in alone


def test_numbers_of_parts_of_a_sum_are_axes():
    axes = '"base.parts.1.amplitude" = ["1 mm", "2 mm"]\nbase.parts.2.fade = [0, "0.5 s"]\n'
    study = read_study(HEAD + SUM + '[study]\nmeasures = ["peak"]\n[study.axes]\n' + axes, Path("study.toml"))
    assert study.plan.axes["base.parts.1.amplitude"].values == (1e-3, 2e-3)
    known = paths_of_study(study)
    changed = study_with(study, {known["base.parts.1.amplitude"]: 5e-3, known["base.parts.2.fade"]: 0.25})
    assert changed.excitation.parts == (
        fi.Sine(5e-3, 5.0),
        fi.Chirp(3.0, 9.0, 1.5, acceleration=0.2, kind="logarithmic", fade=0.25),
    )
    with pytest.raises(fi.InputError, match=r"^base\.parts\.2\.fade = 5\.0 s: must be at most half"):
        study_with(study, {known["base.parts.2.fade"]: 5.0})


@pytest.mark.parametrize(
    ("axis", "words"),
    [
        ('"force.hammer.at" = ["mid", "tipp"]', "study.axes.force.hammer.at = 'tipp': unknown; did you mean 'tip'"),
        ('"impactor.ball.at" = ["foo"]', "study.axes.impactor.ball.at = 'foo': unknown; known: "),
    ],
)
def test_an_axis_of_places_that_are_not_there_is_refused_by_check(axis, words):
    ball = '[[impactor]]\nname = "ball"\nat = "tip"\nmass = 1e-3\ngap = 1e-3\n'
    ball += 'contact = { law = "rigid", restitution = 0.5 }\n'
    plan = f'[study]\nmeasures = ["peak"]\n[study.axes]\n{axis}\n'
    with pytest.raises(fi.InputError, match=words):
        fi.preflight(read_study(HEAD + SINE + HAMMER + ball + plan, Path("study.toml")))


def test_a_parameter_study_over_an_impulse_is_linear_without_balls():
    found = fi.parameter_study(read(REST, HAMMER), {"force.hammer.impulse": [0.001, 0.002]}, ["tip.displacement"])
    low, high = np.abs(found["tip.displacement"].to_numpy()).ravel()
    # the peak is found to 1e-9 of itself
    assert high == pytest.approx(2.0 * low, rel=1e-8)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ((SINE, HAMMER, HAMMER), r"force.name = 'hammer'.*must differ"),
        ((SINE, HAMMER.replace('"hammer"\nat', '"a.b"\nat')), r"'a.b'.*without a dot"),
        ((SINE, HAMMER.replace("impulse", "impuls")), r"force.hammer.impuls: unknown; did you mean 'impulse'"),
        ((SINE, HAMMER.replace("0.003", "0")), r"force.hammer.duration = 0 s: must be"),
        ((SINE, HAMMER.replace('kind = "hammer"', 'kind = "hamer"')), r"force.hammer.kind = 'hamer'"),
        ((SINE, HAMMER.replace('at = "tip"\n', "")), r"force.hammer.at: is missing"),
        ((SINE, COIL.replace("5.0", "-5.0")), r"force.coil.frequency = -5.0 Hz: must be"),
        ((SINE, COIL.replace("force = 0.01", "amplitude = 0.01")), r"force.coil.amplitude: unknown"),
        ((SINE, COIL.replace("force = 0.01\n", "")), r"force.coil.force: is missing"),
        ((SINE, COIL.replace("sine", "impact")), r"force.coil.kind = 'impact'.*'impact' is 'hammer' here"),
        ((SINE, SWEEP.replace("1.0", "-1.0")), r"force.swept.force = -1.0 N: must be a finite number >= 0 N$"),
        ((SINE, SWEEP.replace("1.0", "[[4, 1], [9, 1]]")), r"force.swept.force = .*: must be a finite number >= 0 N$"),
        ((SINE, PULSE.replace("force = 1.0\n", "")), r"force.swept.force: is missing"),
        ((SINE, PULSE.replace("0.1", "9.0")), r"force.swept.delay = 9.0 s: must be < [0-9.]+ s, the history"),
        ((SINE, COIL.replace('"coil"', '""')), r"^force.1.name = '': must be a text without a dot"),
        ((SINE, COIL.replace('"coil"', '"force 2"'), UNNAMED), r'force.name = .* without a name is "force 1", "fo'),
        ((REST, "[sweep]\nstart = 4\nstop = 6\npoints = 9\ncycles = 30\n"), r"sweep: needs a .* of kind 'rest'"),
        ((REST.replace("history = 2.0\n", ""), HAMMER), r"base.history: is missing"),
        ((SINE, HAMMER, "[sweep]\nstart = 4\nstop = 6\npoints = 9\ncycles = 30\n"), r"sweep: needs a .* a frequency$"),
        ((REST, COIL, "[sweep]\nstart = 4\nstop = 6\npoints = 9\ncycles = 30\n"), r"axis 'force\.coil\.frequency'$"),
    ],
)  # fmt: skip
def test_faults_of_forces_are_said_by_their_keys(parts, words):
    with pytest.raises(fi.InputError, match=words):
        read_study(HEAD + "\n".join(parts), Path("study.toml"))


@pytest.mark.parametrize(("at", "said"), [('"tipp"', "'tipp': unknown; did you mean 'tip'"), ("0.3", "0.3 m")])
def test_a_place_off_the_beam_is_refused_before_the_run_and_by_check(at, said):
    study = read_study(HEAD + SINE + HAMMER.replace('at = "tip"', f"at = {at}"), Path("study.toml"))
    with pytest.raises(fi.InputError, match=f"force.hammer.at = {said}"):
        fi.preflight(study)


def test_the_density_of_a_force_has_its_unit():
    random = '[[force]]\nat = "tip"\nkind = "random"\npsd = [[2, 0], [60, 1e-3]]\nduration = 2.0\n'
    with pytest.raises(fi.InputError, match=r"row 1: must have a level > 0, in N\^2/Hz"):
        read_study(HEAD + SINE + random, Path("study.toml"))


SUM = """
[base]
kind = "sum"
history = 2.0

[[base.parts]]
amplitude = 1e-3
frequency = 5.0

[[base.parts]]
kind = "chirp"
start = 3.0
stop = 9.0
duration = 1.5
acceleration = 0.2
rate = "logarithmic"
"""


def test_a_sum_of_motions_of_the_base_is_read_written_and_run():
    study = read(SUM)
    assert study.excitation == fi.Sine(1e-3, 5.0) + fi.Chirp(3.0, 9.0, 1.5, acceleration=0.2, kind="logarithmic")
    other = replace(study, output=replace(study.output, frames=10))
    assert same_study(read_study(study_text(other), study.path), other)
    # without a history the longest of the parts that have a duration
    assert read(SUM.replace("history = 2.0", "")).history_duration == 1.5
    assert read(SUM, HAMMER).excitation == fi.excitation.Drives(study.excitation, DRIVES.forces[:1])
    assert "up to 9 Hz" in study.history_words


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ((SUM.replace("5.0", "-5.0"),), r"base.parts.1.frequency = -5.0 Hz"),
        ((SUM.replace('"chirp"', '"chrip"'),), r"base.parts.2.kind = 'chrip'"),
        ((SUM.replace('rate = "', 'rates = "'),), r"base.parts.2.rates: unknown; did you mean 'rate'"),
        ((SUM.replace("history = 2.0", "amplitude = 1.0"),), r"base.amplitude: unknown"),
        ((SUM + '[[base.parts]]\nrecord = "a.csv"\n',), r"base.parts.3.record: is no part of a sum"),
        ((SUM.replace('"chirp"', '"swept sine"'),), r"base.parts.2.kind = 'swept sine'.* is 'chirp' here"),
        (('[base]\nkind = "sum"\nhistory = 2.0\n',), r"base.parts.*must be one or more tables"),
        (('[base]\nkind = "sum"\n[[base.parts]]\namplitude = 1e-3\nfrequency = 5\n',), r"base.history.*is missing"),
    ],
)  # fmt: skip
def test_faults_of_sums_are_said_by_their_keys(parts, words):
    with pytest.raises(fi.InputError, match=words):
        read_study(HEAD + "\n".join(parts), Path("study.toml"))
