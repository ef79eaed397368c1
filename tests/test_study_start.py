"""Tables [[start]] of a study file: a bent or moving structure and balls elsewhere, in runs and parameter studies."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import NO_PICTURES, paper_study_text, prepare, read_study, short_study, study_text

import femimpact as fi
from femimpact.app.study.study import build_systems
from femimpact.app.tasks.run import run_simulation, run_sweep

pytestmark = pytest.mark.impacts

PULLED = '[[start]]\nat = "tip"\ndisplacement = "5 mm"\n'
BALL = '[[start]]\nball = "ball"\ndisplacement = "-1 mm"\nspeed = "2 cm/s"\n'


def given(tables, **changes):
    """The paper's case for a second on three modes, event-driven, with these tables."""
    begins = read_study(f"{paper_study_text()}\n{tables}", Path("study.toml")).begins
    paper = short_study(1.0, **NO_PICTURES)
    options = {"method": {"name": "event-driven"}, "reduction": replace(paper.reduction, modes=3), "sweep": None}
    return replace(paper, begins=begins, **{**options, **changes})


def test_a_tip_that_is_pulled_has_the_static_shape_of_a_force_there_and_the_ball_goes_with_it():
    study = given(PULLED, structure=replace(short_study(1.0).structure, gravity=-9.81))
    system = build_systems(study)[1]
    state, row = study.initial_on(system), system.point_row("tip")
    assert float(row @ state.displacement) == pytest.approx(5e-3, rel=1e-12)
    # the shape of the force that holds it there: displacements are linear in a force
    sag, pulled = (fi.State.under_force(system, force, "tip").displacement for force in (0.0, 1.0))
    force = (5e-3 - float(row @ sag)) / float(row @ (pulled - sag))
    np.testing.assert_allclose(state.displacement, sag + force * (pulled - sag), rtol=1e-10)
    np.testing.assert_allclose(state.ball_displacement, 5e-3, rtol=1e-12)
    np.testing.assert_array_equal(state.velocity, 0.0)


def test_speeds_are_those_of_a_place_of_a_ball_in_its_box_or_of_everything():
    system = build_systems(given(""))[1]
    state = given(PULLED + 'speed = "0.1 m/s"\n' + BALL).initial_on(system)
    assert float(system.point_row("tip") @ state.velocity) == pytest.approx(0.1, rel=1e-12)
    struck = fi.State.struck("tip", 0.1).relative_to_base(system, fi.Sine(0.0, 1.0))[1]
    np.testing.assert_allclose(state.velocity, struck, rtol=1e-12)
    np.testing.assert_allclose([*state.ball_displacement, *state.ball_velocity], [4e-3, 0.12], rtol=1e-12)
    # a ball without a table does not feel the blow
    np.testing.assert_array_equal(given(PULLED + 'speed = "0.1 m/s"\n').initial_on(system).ball_velocity, 0.0)
    state, stopped = given('[[start]]\nspeed = "0.3 m/s"\n').initial_on(system), fi.State.with_speed(system, 0.3)
    assert state.displacement is None
    np.testing.assert_array_equal(state.velocity, stopped.velocity)
    np.testing.assert_array_equal(state.ball_velocity, stopped.ball_velocity)


def test_a_run_begins_so_and_the_study_is_written_and_read_again():
    study = given(PULLED + BALL)
    run = run_simulation(prepare(study))
    assert run["tip"][0] == pytest.approx(5e-3, rel=1e-12)
    assert run["ball"][0] == pytest.approx(4e-3, rel=1e-12)
    assert run["ball.velocity"][0] == pytest.approx(0.02, rel=1e-12)
    system = build_systems(study)[1]
    again = fi.integrate(system, study.base, fi.EventDriven(), 1.0, initial=study.initial_on(system))
    assert run.largest("tip").value == pytest.approx(again.largest("tip").value, rel=1e-9)
    assert read_study(study_text(study), Path("study.toml")).begins == study.begins != ()


def test_cases_of_a_study_begin_so_each_with_the_shape_of_its_own_structure():
    study, axes = given(PULLED + BALL), {"beam.length": [0.23, 0.25], "impactor.ball.gap": [2e-3, 3e-3]}
    found = fi.parameter_study(study, axes, ["peak"], cycles=3).peak.values
    unbent = fi.parameter_study(replace(study, begins=()), axes, ["peak"], cycles=3).peak.values
    assert np.all(found > 2.0 * unbent)
    for i, length in enumerate(axes["beam.length"]):
        for j, gap in enumerate(axes["impactor.ball.gap"]):
            beam, ball = study.structure.beam, study.structure.impactors[0]
            segment = replace(beam.segments[0], length=length)
            structure = replace(study.structure, beam=fi.Beam((segment,)), impactors=(replace(ball, gap=gap),))
            own = replace(study, structure=structure)
            system = build_systems(own)[1]
            time = 3 / study.base.frequency
            run = fi.integrate(system, study.base, fi.EventDriven(), time, initial=own.initial_on(system))
            assert found[i, j] == pytest.approx(float(run.steady.peak[0]), rel=1e-9)
    # a base without cycles, and drawn balls, which lie in the box that the bent beam carries
    chirp = replace(study, base=fi.Chirp(4.7, 5.3, 1.0, acceleration=0.3))
    system = build_systems(chirp)[1]
    run = fi.integrate(system, chirp.base, fi.EventDriven(), 1.0, initial=chirp.initial_on(system))
    gap = {"impactor.ball.gap": [study.structure.impactors[0].gap]}
    assert float(fi.parameter_study(chirp, gap, ["peak"]).peak[0]) == abs(run.largest("tip").value)
    for one in (study, chirp):
        assert list(fi.parameter_study(one, {"impactor.ball.gap": [1e-3]}, ["peak"], starts=4).failed_starts) == [0]


def test_the_start_on_the_page_is_that_of_its_run():
    page = Path(__file__).parent.parent / "docs" / "howto" / "histories.md"
    (tables,) = re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    run = run_simulation(prepare(given(tables)))
    first = [run[name][0] for name in ("tip", "ball", "ball.velocity")]
    np.testing.assert_allclose(first, [5e-3, 8e-3, -0.1], rtol=1e-12)


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ('[[start]]\nat = "tip"\nspeed = "5 g"', r"start\.tip\.speed = '5 g': must have a unit that fits"),
        ('[[start]]\nat = "tip"\nball = "ball"', r"start\.tip\.ball = 'ball': must be left out: at is given"),
        ('[[start]]\ndisplacement = 1e-3', r"start\.1\.displacement = 0\.001 m: needs a place, at = 'tip', or a ball"),
        ('[start]\nat = "tip"', r"start: must be a list of tables, \[\[start\]\]"),
        (PULLED + '[[start]]\nat = "mid"\nspeed = 1', "start: must have at most one table for a ball"),
        ('[[start]]\nat = "root"\nspeed = 1', r"start\.at = 'root': must be a place that moves"),
        ('[[start]]\nat = "tap"\nspeed = 1', r"start\.at = 'tap': unknown; did you mean 'tip'\?"),
        ('[[start]]\nball = "bal"\nspeed = 1', r"start\.ball = 'bal': unknown; did you mean 'ball'\?"),
        (BALL.replace("-1 mm", "5 mm"), r"initial\.ball\.gap = 0\.005 m: must start between its walls"),
    ],
)  # fmt: skip
def test_what_is_no_start_is_one_line(tables, words):
    with pytest.raises(fi.InputError, match=words) as error:
        prepare(replace(given(tables, structure=with_rigid_ball()), path=Path("study.toml")))
    assert len(str(error.value).splitlines()) == 1


def with_rigid_ball():
    structure = short_study(1.0).structure
    return replace(structure, impactors=(replace(structure.impactors[0], contact=fi.Rigid(0.6)),))


def test_what_does_not_go_with_a_start_is_refused():
    study = given(PULLED)
    for axis in ({"start.ball.position": [0.0]}, {"base.start": ["space"]}):
        with pytest.raises(fi.InputError, match=rf"{next(iter(axis))}: must not be an axis beside \[\[start\]\]"):
            fi.parameter_study(study, axis, ["peak"], cycles=3)
    with pytest.raises(fi.InputError, match=r"base\.start = 'space': must be 'base' beside \[\[start\]\]"):
        replace(study, start="space")


def test_a_sweep_begins_at_rest_all_the_same():
    study = given(PULLED, sweep=replace(short_study(1.0).sweep, points=4, cycles=24, refine=0))
    swept, other = (run_sweep(prepare(one)).ball for one in (study, replace(study, begins=())))
    np.testing.assert_array_equal(swept.peak, other.peak)
