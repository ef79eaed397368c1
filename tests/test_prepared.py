"""A study is made ready once, is written down as it was run, and its summary says everything once."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from itertools import combinations

import numpy as np
import pytest
from builders import (
    FILES,
    TABLES,
    MeshChoice,
    OrbitsPlan,
    Output,
    ParameterPlan,
    Reduction,
    SweepPlan,
    done,
    load_study,
    paper_study,
    plan_lines,
    prepare,
    read_study,
    run_simulation,
    run_study,
    same_study,
    study_text,
    summary_of,
)

import femimpact as fi
from femimpact.app import demo
from femimpact.app.study import study as studies
from femimpact.app.study.findings import read_findings
from femimpact.app.study.parameter_plan import AxisValues
from femimpact.app.study.prepared import with_base
from femimpact.app.study.start import PartStart
from femimpact.app.study.study import Gravity
from femimpact.app.study.study_file import LAWS
from femimpact.app.tasks import run as runs
from femimpact.app.tasks.run import last_cycles
from femimpact.cli import print_results

pytestmark = pytest.mark.usefixtures("unreported")


@pytest.fixture(scope="module")
def study():
    """The paper's case in seconds: figures, no frames."""
    paper = paper_study()
    return dataclasses.replace(
        paper,
        duration=2.0,
        sweep=SweepPlan(4.0, 6.0, points=4, cycles=24, refine=2),
        output=Output(frames=0, paraview=False, movie=False),
    )


@pytest.fixture
def assembled(monkeypatch):
    """The structures that are assembled while a test runs, one for each time."""
    found, assemble = [], studies.assemble

    def counted(structure, **more):
        found.append(structure)
        return assemble(structure, **more)

    monkeypatch.setattr(studies, "assemble", counted)
    return found


@pytest.mark.usefixtures("undrawn")
def test_a_run_assembles_the_structure_once_and_the_glued_one_once(study, assembled, tmp_path):
    run_study(study, tmp_path / "out")
    assert sorted(map(len, ([s.impactors for s in assembled]))) == [0, 1]
    assert assembled == [study.structure, fi.structure.glue_impactors(study.structure)]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("parts", [("simulate",), ("sweep",), ("simulate", "sweep")])
def test_without_modes_nothing_is_glued(study, assembled, tmp_path, parts):
    run_study(study, tmp_path / "out", parts=parts)
    assert assembled == [study.structure]


def test_a_plan_assembles_the_structure_once_and_once_with_its_balls_glued_on(study, assembled):
    plan_lines(study)
    assert assembled == [study.structure, fi.structure.glue_impactors(study.structure)]


def test_the_demo_assembles_once(study, assembled, tmp_path, monkeypatch):
    short = dataclasses.replace(study, output=dataclasses.replace(study.output, figures=False))
    monkeypatch.setattr(demo, "paper_study", lambda: short)
    runs, whole = [], demo.parameter_study

    def counted(system, axes, measures, **more):
        runs.append((math.prod(map(len, axes.values())), more["cycles"]))
        return whole(system, axes, measures, **more)

    monkeypatch.setattr(demo, "parameter_study", counted)
    task = demo.task_of_demo(demo.ScanPlan((0.7,), points=4, cycles=24, starts=1))
    done(task, tmp_path / "out")
    assert assembled == [short.structure, fi.structure.glue_impactors(short.structure)]
    # its plan says how many runs there are beside the history and the sweep
    (line,) = [line for line in task.plan().lines if line.startswith("demo: ")]
    assert [(int(count), int(cycles)) for count, cycles in re.findall(r"(\d+) (?:runs )?of (\d+) cycles", line)] == runs


@pytest.mark.parametrize("method", [{"name": "event-driven"}, {"name": "newmark"}])
@pytest.mark.parametrize("frequency", [0.5, 4.9, 400.0])
def test_a_history_resolves_a_base_cycle_unless_told_otherwise(study, method, frequency):
    base = dataclasses.replace(study.base, frequency=frequency)
    ready = prepare(dataclasses.replace(study, base=base, method=method, output=Output()), ("modes",))
    grid = ready.method.time_grid(ready.small, base, study.history_duration, ready.record)
    samples = 1.0 / (frequency * grid * ready.record.every)
    assert samples >= 20
    assert not any("output.every" in text for text in ready.warnings)
    told = prepare(dataclasses.replace(ready.study, output=Output(every=100_000)), ("modes",))
    assert any("output.every = 100000: the history keeps" in text for text in told.warnings)


def test_another_base_motion_leaves_systems_and_methods_as_they_are(study):
    one = prepare(study)
    other = with_base(one, dataclasses.replace(study.base, frequency=5.0))
    fresh = prepare(other.study)
    assert other.small is one.small
    assert other.method == fresh.method
    assert other.record == fresh.record != one.record


@pytest.mark.parametrize("method", [{"name": "newmark"}, {"name": "event-driven", "samples_per_cycle": 4096}])
def test_the_last_cycles_are_those_of_the_run_to_the_last_bit(study, method):
    output = dataclasses.replace(study.output, every=1)
    duration = 50 / study.base.frequency
    ready = prepare(dataclasses.replace(study, duration=duration, method=method, output=output), ("simulate",))
    response = run_simulation(ready)
    cut = last_cycles(ready, response)
    # with another stride of the history they come from a second run
    again = last_cycles(dataclasses.replace(ready, record=dataclasses.replace(ready.record, every=7)), response)
    assert cut.time.size < response.time.size
    np.testing.assert_array_equal(cut.time, again.time)
    assert set(cut.channels) == set(again.channels)
    for name, values in cut.channels.items():
        np.testing.assert_array_equal(values[1:], again.channels[name][1:])
        # where the second run begins it reads the state that was kept, and the first one has come from sample to
        # sample, 4096 in a cycle
        np.testing.assert_allclose(values[0], again.channels[name][0], rtol=0.0, atol=1e-12 * np.abs(values).max())


# event-driven from the end of the base cycle before them on
@pytest.mark.parametrize(
    ("method", "cycles"),
    [("newmark", 40.0), ("generalized-alpha", 40.0), ("moreau-jean", 40.0), ("event-driven", 40.4)],
)
def test_the_last_cycles_cost_no_more_than_they_take(study, method, cycles, monkeypatch):
    output = dataclasses.replace(study.output, every=7)
    duration, frequency = 50.4 / study.base.frequency, study.base.frequency
    if method == "moreau-jean":
        ball = dataclasses.replace(study.structure.impactors[0], contact=fi.Rigid(0.6))
        study = dataclasses.replace(study, structure=dataclasses.replace(study.structure, impactors=(ball,)))
    changed = dataclasses.replace(study, duration=duration, method={"name": method}, output=output)
    ready = prepare(changed, ("simulate",))
    response = run_simulation(ready)
    assert len(response.impacts) > 50
    durations, integrate = [], runs.integrate

    def counted(system, excitation, method, duration, *more):
        durations.append(duration)
        return integrate(system, excitation, method, duration, *more)

    monkeypatch.setattr(runs, "integrate", counted)
    cut = last_cycles(ready, response)
    # as if the method had kept no state, from the start of the run
    whole = last_cycles(ready, dataclasses.replace(response, kept_state=None))
    assert np.round(np.array(durations) * frequency, 1).tolist() == [cycles, 50.4]
    np.testing.assert_array_equal(cut.time, whole.time)
    for name, values in whole.channels.items():
        np.testing.assert_array_equal(cut.channels[name], values)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("method", ["newmark", "event-driven"])
@pytest.mark.parametrize("every", [None, 3])
def test_a_file_keeps_some_twenty_rows_of_a_cycle_unless_the_study_says_how_many(study, tmp_path, method, every):
    output = dataclasses.replace(study.output, every=every)
    changed = dataclasses.replace(study, duration=7.3 / study.base.frequency, method={"name": method}, output=output)
    run = run_simulation(prepare(changed, ("simulate",)))
    kept = run_study(changed, tmp_path / "out", parts=("simulate",)).history
    # bits of the run, from its start on
    rows = np.searchsorted(run.time, kept["time"])
    np.testing.assert_array_equal(run.time[rows], kept["time"])
    for name, values in run.channels.items():
        np.testing.assert_array_equal(values[rows], kept[name])
    np.testing.assert_array_equal(run.energy.work[rows], kept["energy_work"])
    stride = 1 if every else max(rows[1], 2)
    np.testing.assert_array_equal(rows, np.arange(0, run.time.size, stride))
    # one row more in a cycle would be too many
    per_cycle = 1.0 / (study.base.frequency * float(kept["time"][1]))
    assert every or 20.0 <= per_cycle * (1.0 + 1e-9) < 20.0 * (stride + 1) / stride


# ---- the study as text ----------------------------------------------------------------------------

LAW_OF = {
    "kelvin-voigt": fi.KelvinVoigt(stiffness=1.0 / 3.0 * 1e4, damping=0.0),
    "switching-spring": fi.contact.SwitchingSpring(0.0, 1e4),
    "hertz": fi.Hertz(1e7, exponent=1.7),
    "hunt-crossley": fi.HuntCrossley(1e7, 0.9),
    "lankarani-nikravesh": fi.contact.LankaraniNikravesh(1e7, 0.9),
    "flores": fi.contact.Flores(1e7, 0.1, reference_speed=0.1),
    "gonthier-carvalho-martins": fi.contact.GonthierCarvalhoMartins(1e7, 1.0),
    "rigid": fi.Rigid(0.0),
}


def structure_with(law):
    segments = (
        fi.Segment(0.1, 70e9, 2700.0, width=0.02, thickness=0.1 + 0.2, name="thick"),
        fi.Segment(0.2, 70e9, 2700.0, area=1e-5, second_moment=1e-12, name="thin"),
    )
    return fi.Structure(
        beam=fi.Beam(segments),
        masses=(fi.PointMass("box", "tip", 0.02, rotary_inertia=1e-7), fi.PointMass("clip", 0.1, 0.0)),
        impactors=(fi.Impactor("ball", "tip", 3e-3, (1e-3, 2e-3), law, free_stiffness=1.0, acceleration=-0.5),),
        stops=(fi.Stop("wall", "mid", (5e-3, math.inf), fi.Rigid(0.5), fixed_to="space"),),
        supports=(fi.Support("pinned", "root"), fi.Support("pinned", 0.2)),
        damping=fi.Rayleigh((0.01, 0.02), frequencies=(5.0, 30.0)),
        gravity=-9.81,
    )


@pytest.mark.parametrize("name", LAWS)
def test_a_study_is_what_its_text_says_to_the_last_bit(study, name):
    changed = dataclasses.replace(
        study,
        structure=structure_with(LAW_OF[name]),
        mesh=MeshChoice(elements=12),
        method={"name": "newmark", "contact": "energy-consistent", "allow_coarse_step": True, "dt": 1e-4 / 3},
        reduction=None,
        output=Output(every=3, memory_limit=2e9, exaggeration=2.5, vtkhdf=True, movie=False),
    )
    back = read_study(study_text(changed), changed.path)
    assert same_study(back, changed)
    assert not same_study(back, study)
    # what the text gives is written as it is
    assert study_text(back) == back.text


@pytest.mark.parametrize(
    "changes",
    [
        {"base": dataclasses.replace(paper_study().base, frequency=math.pi, phase=-1.0), "start": "static"},
        {"sweep": None},
        {"method": {"name": "event-driven", "samples_per_cycle": 128}},
        {"method": {}},
        {"reduction": Reduction(3)},
        {"mesh": MeshChoice(file='a "b".msh')},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_one_change_is_in_the_text_and_nothing_else_is(changes):
    changed = dataclasses.replace(paper_study(), **changes)
    assert same_study(read_study(study_text(changed), changed.path), changed)


def test_every_table_of_a_study_file_can_be_written(study):
    springs, dashpots = (fi.Spring("stay", 0.05, 20.0),), (fi.Dashpot("damper", 0.05, 0.1),)
    hung = {"springs": springs, "dashpots": dashpots, "absorbers": (fi.Absorber("body", "mid", 1e-3, 5.0, 0.1 + 0.2),)}
    structure = structure_with(fi.Rigid(0.5))
    met = dataclasses.replace(structure.impactors[0], name="other", gap=(math.inf, 1e-3))
    meeting = fi.Meeting("pair", ("ball", "other"), 1e-3, fi.KelvinVoigt(restitution=0.5, contact_time=1e-3))
    hung |= {"impactors": (*structure.impactors, met), "meetings": (meeting,)}
    structure = dataclasses.replace(structure, axial=fi.Axial(tension=0.1), **hung)
    plan = ParameterPlan(("peak",), {"base.amplitude": AxisValues((1e-4, 2e-4))})
    orbits = OrbitsPlan("frequency", (4.0, 6.0), 10.0, switch=("grazing",))
    everything = dataclasses.replace(
        study, structure=structure, method={"name": "event-driven"}, plan=plan, orbits=orbits
    )
    # forces go without a sweep
    begins = (PartStart("tip", displacement=1e-3),)
    struck = dataclasses.replace(everything, sweep=None, forces=(fi.HammerBlow("tip", 1e-3, 1e-3),), begins=begins)
    text = study_text(everything) + study_text(struck)
    for table in TABLES:
        assert f"[{table}]" in text or f"[[{table}]]" in text or f"[{table}.segment]" in text
    assert Gravity(everything.structure.gravity).acceleration == -9.81


def test_a_study_that_was_not_changed_keeps_its_text_and_comments():
    paper = paper_study()
    assert study_text(paper) == paper.text
    assert study_text(dataclasses.replace(paper, base=dataclasses.replace(paper.base))) == paper.text


def test_a_law_without_a_name_in_study_files_is_named_and_not_taken_for_another(study):
    law = fi.CustomLaw(lambda depth, rate, speed: 1e4 * depth, name="rigid")
    ball = dataclasses.replace(study.structure.impactors[0], contact=law)
    text = study_text(dataclasses.replace(study, structure=dataclasses.replace(study.structure, impactors=(ball,))))
    with pytest.raises(fi.InputError, match=r"impactor\.ball\.contact\.law"):
        read_study(text, study.path)
    assert "'rigid' (CustomLaw) has no name in study files" in text


@pytest.mark.usefixtures("undrawn")
def test_results_hold_the_study_that_was_run_not_the_file_it_came_from(study, tmp_path):
    changed = dataclasses.replace(study, base=dataclasses.replace(study.base, frequency=5.1))
    run_study(changed, tmp_path / "out", parts=("simulate",))
    left = load_study(tmp_path / "out" / FILES["study"].name)
    assert same_study(left, changed)
    summary = json.loads((tmp_path / "out" / FILES["summary"].name).read_text())
    assert left.base.frequency == summary["history"]["frequency"]


# ---- what is said once ----------------------------------------------------------------------------


def blocks(value, path=""):
    """Every mapping of three keys or more within a summary, by its path."""
    if isinstance(value, dict):
        if len(value) >= 3:
            yield path, value
        for key, inner in value.items():
            yield from blocks(inner, f"{path}/{key}")


@pytest.mark.usefixtures("undrawn")
def test_no_block_of_a_summary_is_repeated(study, tmp_path):
    law = fi.KelvinVoigt(restitution=0.5, contact_time=2e-3)
    second = fi.Impactor("second", "mid", 1e-3, 2e-3, law)
    structure = dataclasses.replace(study.structure, impactors=(*study.structure.impactors, second))
    run_study(dataclasses.replace(study, structure=structure), tmp_path / "out")
    summary = fi.load(tmp_path / "out").summary
    for (one, first), (other, twin) in combinations(blocks(summary), 2):
        assert first != twin, f"{one} is {other}"
    assert list(read_findings(summary).contacts) == ["ball", "second"]
    assert summary["contact"]["name"] == "ball"
    assert summary["further_contacts"]["second"]["law"] == "kelvin-voigt"


@pytest.mark.impacts
@pytest.mark.parametrize(("method", "by"), [("event-driven", "law"), ("newmark", "step")])
def test_a_summary_has_every_channel_and_what_the_method_does_to_the_restitution_in_words(
    study, tmp_path, method, by, capsys
):
    asked = ("root.surface_stress", "tip.absolute_acceleration")
    kept_by = {"event-driven": 1, "newmark": 10}
    output = dataclasses.replace(study.output, channels=asked, figures=False, every=kept_by[method])
    changed = dataclasses.replace(study, method={"name": method}, output=output, sweep=None)
    results = run_study(changed, tmp_path / "out", parts=("simulate",))
    kept, found = results.history, results.summary["history"]["channels"]
    assert set(asked) <= set(found)
    last = kept["time"] >= 2.0 / 3.0 * float(kept["time"][-1])
    ready = prepare(changed)
    every = dataclasses.replace(ready.record, every=1, snapshots=0)
    whole = fi.integrate(ready.small, changed.excitation, ready.method, 2.0, every, changed.initial)
    for name, channel in found.items():
        size = np.abs(kept[name])
        assert channel["unit"] == kept[name].attrs["units"]
        # of all steps, whose bits do not depend on what is kept; event-driven between the samples, too
        largest = float(np.abs(whole[name]).max())
        assert channel["largest_of_run"] >= largest >= float(size.max())
        assert by == "law" or channel["largest_of_run"] == largest
        near = np.abs(whole.time - channel["time_of_largest"]).argmin()
        assert abs(float(whole[name][near])) <= channel["largest_of_run"]
        read, exact = float(size[last].max()), results.summary["contact"]["peak_force"]
        # a contact force is zero between readings that miss its peak
        assert channel["largest"] == (exact if name == "ball.contact_force" else read) >= read
        # sums in another order
        assert channel["rms"] == pytest.approx(float(np.sqrt((size[last] ** 2).mean())), rel=1e-12)
    assert results.summary["contact"]["achieved_by"] == by
    print_results(results.directory)
    printed = " ".join(capsys.readouterr().out.split())
    for name in asked:
        scale, unit = {"Pa": (1e-6, "MPa"), "m": (1e3, "mm")}.get(found[name]["unit"], (1.0, found[name]["unit"]))
        largest, later, rms = (f"{scale * found[name][key]:.4g} {unit}" for key in ("largest_of_run", "largest", "rms"))
        assert all(number in printed for number in (name, largest, later, rms))
    # one start of a motion that is not periodic
    assert "Channels of the history: one start's value" in printed
    assert ("with this step" in printed) == (by == "step")


def test_a_study_without_a_contact_has_none_in_its_summary(study):
    empty = dataclasses.replace(study, structure=dataclasses.replace(study.structure, impactors=()))
    assert read_findings(summary_of(prepare(empty))).contacts == {}


def test_one_file_name_has_one_key():
    names = [file.name for file in FILES.values()]
    assert len(set(names)) == len(names)


def test_bodies_are_counted_in_words(study):
    ball = study.structure.impactors[0]
    stop = fi.Stop("stop", "mid", 1e-3, fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
    others = {
        "no ball": {"impactors": ()},
        "1 ball": {},
        "2 balls, 1 stop": {"impactors": (ball, dataclasses.replace(ball, name="other")), "stops": (stop,)},
    }
    for words, change in others.items():
        line = plan_lines(dataclasses.replace(study, structure=dataclasses.replace(study.structure, **change)))[1]
        assert line.endswith(f"integrated (modal), {words}")


@pytest.mark.parametrize(
    ("damaged", "key"),
    [({"sweep": []}, "summary.sweep"), ({"history": {"peak": "wide"}}, "summary.history.peak"),
     ({"warnings": [1]}, "summary.warnings.1"), ({"orbits": {"modes": True}}, "summary.orbits.")],
)  # fmt: skip
def test_a_damaged_summary_is_one_line_with_its_key(damaged, key):
    with pytest.raises(fi.InputError, match=key.replace(".", r"\.")) as caught:
        read_findings(damaged)
    assert "the summary is damaged" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


RULER = """
[beam]
length = "300 mm"
width = "25 mm"
thickness = "1 mm"
young_modulus = "210 GPa"
density = 7850
[mesh]
elements = 10
[[stop]]
name = "stop"
at = "tip"
gap = ["5 mm", inf]
contact = { law = "rigid", restitution = 0.7 }
[damping]
ratio = 0.02
modes = [1, 2]
[reduction]
modes = 2
[base]
amplitude = "0.3 mm"
frequency = 9.1
duration = 5.0
[method]
name = "event-driven"
[sweep]
start = 8.5
stop = 10.0
points = 31
cycles = 150
"""
BALL = """
[[impactor]]
name = "ball"
at = "tip"
mass = "1 g"
gap = "1 mm"
contact = { law = "rigid", restitution = 0.7 }
"""


def test_without_stop_is_without_it(tmp_path):
    prepared = runs.prepare(read_study(RULER, tmp_path / "study.toml"))
    swept = runs.run_sweep(prepared)
    exact = 3e-4 * np.abs(
        fi.transfer_function(prepared.bare, swept.empty.frequency, to="tip", of="base.displacement")["tip"]
    )
    np.testing.assert_allclose(swept.empty.peak, exact, rtol=1e-3)
    met = swept.ball.impacts_per_cycle > 0.0
    # where it would go beyond its stop it meets it
    assert np.all(met[exact > 5.1e-3])
    assert not np.all(met)
    assert exact.max() > 10e-3
    np.testing.assert_allclose(swept.ball.peak[~met], exact[~met], rtol=1e-3)
    assert swept.empty.damping.ratio == pytest.approx(0.02, rel=1e-2)


def test_without_ball_a_stop_stays(tmp_path):
    prepared = runs.prepare(read_study(RULER + BALL, tmp_path / "study.toml"))
    assert prepared.carried == "ball"
    assert [pair.name for pair in prepared.bare.contacts] == ["stop"]
