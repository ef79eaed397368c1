"""Several starts of a run: its medians and ranges are those of a parameter study, and one start changes nothing."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from builders import (
    NO_PICTURES,
    UNDRAWN_STUDY,
    plain_study,
    plan_lines,
    prepare,
    read_csv,
    read_study,
    short_study,
    study_key,
)

import femimpact as fi
from femimpact.app.report.result_conclusions import conclusions_of
from femimpact.app.results.picture_data import read_results
from femimpact.app.study.findings import read_findings
from femimpact.app.tasks import run as runs
from femimpact.app.tasks import starts as starts_of
from femimpact.app.tasks.starts import OF_CURVES, StartCurves, spreads_of
from femimpact.cli import print_results
from femimpact.integrators.runs import integrate
from femimpact.response.history import shown_snapshots

pytestmark = pytest.mark.impacts

STARTS = 5


def study(starts=STARTS, **changes):
    """The paper's case for some seconds on three modes, event-driven."""
    paper = short_study(6.0, **NO_PICTURES, starts=starts)
    given = {"method": {"name": "event-driven"}, "reduction": replace(paper.reduction, modes=3)}
    sweep = replace(paper.sweep, points=5, cycles=60, starts=starts)
    return replace(paper, mesh=replace(paper.mesh, elements=10), **{**given, "sweep": sweep, **changes})


def shock(starts=1):
    return study(starts, base=fi.Shock("half-sine", 100.0, 0.011), duration=3.0, sweep=None)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    return fi.run_study(study(), tmp_path_factory.mktemp("starts") / "out")


def test_the_ranges_are_those_of_a_parameter_study_of_as_many_starts(ran):
    given = fi.parameter_study(study(), {"base.frequency": [4.0, 5.0]}, ["peak"], cycles=60, starts=STARTS, seed=0)
    columns = read_csv(ran.directory / "curves_of_starts.csv")
    at = [columns["frequency"].tolist().index(f) for f in (4.0, 5.0)]
    # the same runs, so the same bits
    np.testing.assert_array_equal(columns["base_peak"][at], given["peak"])
    np.testing.assert_array_equal(columns["base_peak_low"][at], given["peak_low"])
    np.testing.assert_array_equal(columns["base_peak_high"][at], given["peak_high"])


def test_bands_contain_the_median(ran):
    columns = read_csv(ran.directory / "curves_of_starts.csv")
    assert np.all(columns["base_peak_low"] <= columns["base_peak"])
    assert np.all(columns["base_peak"] <= columns["base_peak_high"])
    ((words, frequency, low, high),) = read_results(ran.directory).curves.bands
    assert words == "with ball, 5 starts of the ball"
    for name, values in (("frequency", frequency), ("base_peak_low", low), ("base_peak_high", high)):
        np.testing.assert_array_equal(values, columns[name])

    def leaves(table):
        return [table] if "median" in table else [leaf for value in table.values() if isinstance(value, dict)
                                                  for leaf in leaves(value)]  # fmt: skip

    found = leaves(ran.summary["starts"]["base"]) + leaves(ran.summary["history_starts"])
    assert len(found) > 20
    # five points do not determine a damping ratio
    known = [spread for spread in found if spread["median"] is not None]
    assert len(known) >= len(found) - 1
    for spread in known:
        assert spread["lowest"] <= spread["median"] <= spread["highest"]


def test_the_files_are_those_of_the_studys_own_start(ran, tmp_path):
    alone = fi.run_study(study(1), tmp_path / "out")
    assert "starts" not in alone.summary
    assert "history_starts" not in alone.summary
    assert not (tmp_path / "out" / "curves_of_starts.csv").exists()
    np.testing.assert_array_equal(alone.sweep["peak"], ran.sweep["peak"])
    np.testing.assert_array_equal(alone.history["tip"], ran.history["tip"])
    assert {name: ran.summary[name] for name in ("sweep", "history", "amplitude_ratio")} == {
        name: alone.summary[name] for name in ("sweep", "history", "amplitude_ratio")
    }


def test_the_median_of_one_start_is_that_run():
    prepared = prepare(study(1))
    args = (0.2e-3, np.linspace(4.5, 5.5, 5), fi.EventDriven(), 60)
    curve, empty = (fi.frequency_sweep(system, *args) for system in (prepared.small, prepared.bare))
    curves = StartCurves(curve.frequency, {name: getattr(curve, name)[None] for name in OF_CURVES})
    spreads = spreads_of(curves, empty, 0.25)
    for name in ("peak_amplitude", "peak_frequency"):
        spread = spreads[name]
        assert spread.lowest == spread.median == spread.highest == getattr(curve, name)


def test_starts_are_in_no_key_of_a_study_and_check_prints_the_time_of_all():
    axes = {"impactor.ball.gap": [3e-3, 4e-3]}
    keys = {study_key(plain_study(fi.app.ParameterStudy(study(n), axes, ["peak"]))) for n in (1, 5)}
    assert len(keys) == 1
    one, five = plan_lines(study(1)), plan_lines(study(5))
    for name in ("history: ", "sweep: "):
        (before,), (after,) = ([line for line in lines if line.startswith(name)] for lines in (one, five))
        assert "further starts" not in before
        assert "with 5 further starts" in after


def test_headline_and_report_have_ranges_and_no_star(ran, capsys):
    print_results(ran.directory)
    printed = capsys.readouterr().out
    for label in ("Largest peak with ball", "Peak of the tip"):
        (line,) = [line for line in printed.splitlines() if line.startswith(f"{label}: ")]
        assert " to " in line
        assert "5 starts" in line
        assert "*" not in line
    (place,) = [line for line in printed.splitlines() if line.startswith(" tip ")]
    # each median with its range, and the largest of the study's own start
    assert place.count(" mm") == 4
    cards = {one.label: one for one in conclusions_of(read_findings(ran.summary))}
    for label in ("Largest peak with ball", "Peak of the tip", "Largest force of ball", "Cycle-averaged force of ball",
                  "Peak without ball over peak with it"):  # fmt: skip
        assert "5 starts of the ball" in cards[label].scatter
        assert not cards[label].one_sample


def test_a_beam_without_a_ball_has_one_start(tmp_path):
    one = study()
    bare = replace(one, structure=replace(one.structure, impactors=()))
    found = fi.run_study(bare, tmp_path / "out")
    assert "starts" not in found.summary
    assert "history_starts" not in found.summary
    assert "further starts" not in "\n".join(plan_lines(bare))


@pytest.mark.parametrize(("table", "value"), [("sweep", "0"), ("sweep", "2.5"), ("output", "-1"), ("output", '"5"')])
def test_what_is_no_number_of_starts_is_refused(table, value, tmp_path):
    text = UNDRAWN_STUDY.replace(f"[{table}]\nstarts = 1 ", f"[{table}]\nstarts = {value} ")
    if table == "sweep":
        text = UNDRAWN_STUDY.replace("\nstarts = 1 ", f"\nstarts = {value} ", 1)
    with pytest.raises(fi.InputError, match="starts"):
        read_study(text, tmp_path / "study.toml")


@pytest.mark.parametrize("start", ["space", "static"])
def test_other_frames_have_ranges_too(start, tmp_path):
    one = study(2)
    found = fi.run_study(replace(one, start=start), tmp_path / "out")
    assert set(found.summary["starts"]) == {start}
    assert len(read_results(found.directory).curves.bands) == 1
    assert any("2 starts" in card.scatter for card in conclusions_of(read_findings(found.summary)))


# ---- drives without a cycle --------------------------------------------------------------------------


def test_the_headline_of_a_shock_is_of_the_whole_run(tmp_path, capsys):
    given = shock()
    found = fi.run_study(given, tmp_path / "out")
    prepared = prepare(given)
    run = integrate(prepared.small, given.excitation, prepared.method, 3.0, prepared.record, given.initial)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["history"]["peak"] == abs(run.largest("tip").value)
    assert summary["contact"]["peak_force"] == abs(run.largest("ball.contact_force").value)
    # the shock is over when the last third begins
    assert summary["history"]["peak"] > 1.2 * np.abs(run["tip"][run.time >= run.window[0]]).max()
    assert summary["history"]["rms"] == pytest.approx(np.sqrt(np.mean(run["tip"] ** 2)), rel=1e-12)
    assert summary["history"]["rms"] > 1.2 * run.steady.rms[0]
    assert summary["contact"]["mean_impulse"] == pytest.approx(np.abs(run.impacts.impulse).mean(), rel=1e-12)
    assert summary["contact"]["mean_impulse"] > 1.05 * run.statistics.mean_impulse
    print_results(found.directory)
    printed = capsys.readouterr().out
    # the ball has struck: from another start the peak is another one
    assert f"Peak of the tip: {1e3 * abs(run.largest('tip').value):.4g}* mm; of the whole run" in printed
    assert f"rms {1e3 * summary['history']['rms']:.4g} mm of the whole run" in printed
    assert "Mean force" not in printed
    cards = {one.label: one for one in conclusions_of(read_findings(summary))}
    assert cards["Peak of the tip"].note == "of the whole run"
    assert "of the whole run" in cards["Largest force of ball"].note


@pytest.mark.filterwarnings("ignore:.*wider than the beam is long")
def test_a_shock_is_compared_with_itself_without_the_ball(tmp_path, capsys):
    given = shock()
    (ball,) = given.structure.impactors
    found = {}
    # in a box that it does not cross in the run a ball changes nothing
    for name, gap in (("far", 1e3), ("near", 2e-3)):
        impactors = (replace(ball, gap=gap),)
        one = replace(given, structure=replace(given.structure, impactors=impactors))
        directory = fi.run_study(one, tmp_path / name, parts=("simulate",)).directory
        summary = json.loads((directory / "summary.json").read_text())
        found[name] = summary["history"], summary["history_without"]
        print_results(directory)
    printed = capsys.readouterr().out
    for key in ("peak", "rms"):
        assert found["far"][0][key] == pytest.approx(found["far"][1][key], rel=1e-6)
        assert found["near"][1][key] == pytest.approx(found["far"][1][key], rel=1e-6)
    assert found["near"][0]["rms"] < 0.95 * found["near"][1]["rms"]
    # without an impact no start of the ball changes anything
    assert [one["peak_is_one_start"] for one in (*found["far"], *found["near"])] == [False, False, True, False]
    assert "The ball lowers the rms of the tip from " in printed
    assert f"Peak of the tip without ball: {1e3 * found['far'][1]['peak']:#.4g} mm" in printed


def test_a_shock_has_ranges_too(tmp_path):
    found = fi.run_study(shock(3), tmp_path / "out")
    given = fi.parameter_study(shock(), {"impactor.ball.gap": [4e-3]}, ["peak"], starts=3, seed=0)
    peak = found.summary["history_starts"]["peak"]
    # the same motion up to its largest deflection, some tenths of a second in: rounding, by which the records differ
    for name, of_study in (("median", "peak"), ("lowest", "peak_low"), ("highest", "peak_high")):
        assert peak[name] == pytest.approx(float(given[of_study][0]), rel=1e-9)


DRIVES = {
    "force": '[base]\nkind = "rest"\nhistory = 3.0\n'
    '[[force]]\nat = "tip"\nkind = "sine"\nforce = 0.02\nfrequency = 4.9\n',
    "two": '[base]\namplitude = 2e-4\nfrequency = 4.9\nduration = 3.0\n'
    '[[force]]\nat = "tip"\nkind = "sine"\nforce = 0.02\nfrequency = 7.0\n',
    "blow": '[base]\nkind = "rest"\nhistory = 3.0\n'
    '[[force]]\nat = "tip"\nkind = "hammer"\nimpulse = 0.02\nduration = 0.003\n',
    "record": '[base]\nrecord = "base.csv"\n',
    "sine": '[base]\namplitude = 2e-4\nfrequency = 4.9\nduration = 3.0\n',
}  # fmt: skip


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("name", DRIVES)
def test_each_number_of_a_history_stands_under_its_name(name, rigid, tmp_path, capsys):
    """Largest values of the run and of its last third by the samples, which are read ten times as often."""
    text = UNDRAWN_STUDY.replace("starts = 5", "starts = 1").replace('name = "newmark"', 'name = "event-driven"')
    parts = [
        text[text.index(f"[{first}]") : text.index(f"[{last}]")]
        for first, last in (("beam", "base"), ("method", "sweep"))
    ]
    # a record that grows weaker, and has a cycle
    time = np.arange(0.0, 3.0, 0.01)
    samples = (1.0 - 0.2 * time) * np.sin(2.0 * np.pi * 5.0 * time)
    rows = (f"{t:.2f},{a:.9f}" for t, a in zip(time, samples, strict=True))
    (tmp_path / "base.csv").write_text("\n".join(rows) + "\n")
    text = parts[0] + DRIVES[name] + parts[1] + text[text.index("[output]") :]
    given = read_study(text, tmp_path / "study.toml")
    ball = replace(given.structure.impactors[0], gap=1e-3)
    ball = replace(ball, contact=fi.Rigid(0.8)) if rigid else ball
    output = replace(given.output, report=False, every=1)
    given = replace(given, structure=replace(given.structure, impactors=(ball,)), output=output)
    found = fi.run_study(given, tmp_path / "out", parts=("simulate",))
    history, contact = found.summary["history"], found.summary["contact"]
    prepared = prepare(given)
    finely = replace(prepared.record, interval=2e-4, snapshots=0, state_at=None)
    run = integrate(prepared.small, given.excitation, prepared.method, given.history_duration, finely, given.initial)
    late, cyclic = run.time >= run.window[0], name not in ("two", "blow")
    size = np.abs(run["tip"])
    assert ("frequency" in history) == cyclic
    assert history["channels"]["tip"]["largest_of_run"] == pytest.approx(size.max(), rel=1e-3)
    assert history["channels"]["tip"]["largest"] == pytest.approx((size[late] if cyclic else size).max(), rel=2e-2)
    measured = np.full(run.time.size, True)
    if cyclic:
        cycles, f = int(run.time[-1] * history["frequency"] + 1e-6), history["frequency"]
        measured = (run.time >= (cycles - cycles // 3) / f) & (run.time <= cycles / f)
    assert history["peak"] == pytest.approx(size[measured].max(), rel=1e-3)
    print_results(found.directory)
    line = " ".join(capsys.readouterr().out.split())
    assert (" mm; of the whole run rms" in line.replace("*", "")) == (not cyclic)
    cards = {one.label: one for one in conclusions_of(read_findings(found.summary))}
    assert cards["Peak of the tip"].note.startswith("over the" if cyclic else "of the whole run")
    impacts = run.impacts
    if rigid:
        assert contact["peak_force"] is None
        assert contact["largest_impulse"] == pytest.approx(np.abs(impacts.impulse).max(), rel=1e-9)
        assert history["channels"]["ball.contact_force"]["largest"] is None
        assert "Largest impulse of ball: " in line
        assert "contact_force" not in line
        assert cards["Largest impulse of ball"].note.startswith("of the whole run")
        assert "Largest force of ball" not in cards
    else:
        force = np.abs(run["ball.contact_force"])
        assert contact["peak_force"] == pytest.approx(force[late].max() if cyclic else force.max(), rel=2e-2)
        assert ("N; of the whole run; law: kelvin-voigt" in line.replace("mN", "N").replace("*", "")) == (not cyclic)
        assert ("of the whole run" in cards["Largest force of ball"].note) == (not cyclic)


def test_what_has_not_died_out_is_no_sample(tmp_path, capsys):
    one = study(1)
    bare = replace(one, structure=replace(one.structure, impactors=()), sweep=replace(one.sweep, cycles=30))
    found = fi.run_study(bare, tmp_path / "out", parts=("simulate", "sweep"))
    history, curve = found.summary["history"], found.summary["sweep"]["empty"]
    assert history["steadiness"] != "periodic"
    for about in (history, curve):
        assert about["peak_is_transient"]
        assert not about["peak_is_one_start"]
    print_results(found.directory)
    printed = capsys.readouterr().out
    assert "*" not in printed
    assert printed.count("has not died out") == 2
    cards = [card for card in conclusions_of(read_findings(found.summary)) if "has not died out" in card.note]
    assert [card.one_sample for card in cards] == [False, False]


# ---- starts that fail, and runs that are ended ----------------------------------------------------


def failing(work, numbers):
    """The same function, whose calls of some numbers diverge."""
    calls = []

    def called(*arguments, **more):
        calls.append(1)
        if len(calls) in numbers:
            raise fi.DivergenceError("the motion grows without bound")
        return work(*arguments, **more)

    return called


def blocks_of_which_a_start_diverges(study, *arguments):
    for block in all_blocks(study, *arguments):
        block.fail(np.arange(1, block.periodic.size, STARTS), "the motion grows without bound")
        yield block


all_blocks = starts_of.run_blocks


@pytest.mark.parametrize(("name", "failed", "part", "counted"), [
    ("integrate", failing(integrate, {2}), "history", ("history_starts", "count")),
    ("run_blocks", blocks_of_which_a_start_diverges, "sweep", ("starts_of_sweep",)),
])  # fmt: skip
def test_a_start_that_diverges_is_a_named_failure_and_the_others_have_ranges(
    tmp_path, monkeypatch, ran, name, failed, part, counted
):
    monkeypatch.setattr(starts_of, name, failed)
    found = fi.run_study(study(), tmp_path / "out").summary
    assert found["failed_starts"] == {part: {"start 2": "the motion grows without bound"}}
    value = found
    for key in counted:
        value = value[key]
    assert value == STARTS - 1
    (said,) = [text for text in found["warnings"] if "failed" in text]
    assert said.startswith(f"{part}: 1 ")
    assert "start 2: the motion grows without bound" in said
    # the draws of the others are the same, so their range lies within that of all
    keys = ("history_starts", "peak") if part == "history" else ("starts", "base", "peak_amplitude")
    some, every = found, ran.summary
    for key in keys:
        some, every = some[key], every[key]
    assert every["lowest"] <= some["lowest"] <= some["highest"] <= every["highest"]
    assert "failed_starts" not in ran.summary


def test_where_all_starts_diverge_the_run_ends_with_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(starts_of, "integrate", failing(integrate, set(range(1, STARTS + 1))))
    with pytest.raises(fi.DivergenceError, match=r"^all 5 starts have failed, the first: the motion grows") as ended:
        fi.run_study(study(), tmp_path / "out")
    assert len(str(ended.value).splitlines()) == 1


def test_ranges_of_a_history_stay_where_the_run_is_ended_in_its_sweep(tmp_path, monkeypatch, ran):
    def end(*_arguments, **_more):
        raise KeyboardInterrupt

    monkeypatch.setattr("femimpact.app.tasks.run.run_sweep", end)
    with pytest.raises(KeyboardInterrupt):
        fi.run_study(study(), tmp_path / "out")
    found = fi.load(tmp_path / "out.part").summary
    assert found["unfinished"] == ["sweep"]
    assert found["history_starts"] == ran.summary["history_starts"]


def test_the_film_of_a_run_without_a_cycle_shows_its_largest_motion():
    given = shock()
    given = replace(given, output=replace(given.output, frames=120))
    prepared = prepare(given)
    run = runs.run_simulation(prepared)
    tip, times = run.snapshots.displacement[:, -2], run.snapshots.time
    assert np.abs(tip).max() == pytest.approx(abs(run.largest("tip").value), rel=0.05)
    # some three periods of the first mode, of the run's 3 s
    assert times[0] == pytest.approx(0.0, abs=1e-3)
    assert times[-1] == pytest.approx(3.0 / prepared.small.first_frequency, rel=0.05)
    # of a random run too it is where the largest motion is
    noise = replace(given, base=fi.RandomBase([(2.0, 0.1), (20.0, 0.1)], 6.0, seed=3), duration=None)
    late = runs.run_simulation(prepare(noise))
    largest, times = late.largest("tip"), late.snapshots.time
    assert times[0] < largest.time < times[-1]
    assert times[-1] < 6.0
    whole = integrate(prepared.small, given.excitation, prepared.method, 1.0).impacts
    np.testing.assert_allclose(run.impacts.time[:10], whole.time[:10], rtol=1e-9)
    assert run.impacts.time[-1] > 2.0
    system = fi.without_impactors(prepared.small)
    for drive, first in ((fi.Sine(1e-4, 4.9), False), (fi.Shock("half-sine", acceleration=1.0, duration=0.02), True)):
        long = fi.integrate(system, drive, fi.EventDriven(), 20.0, fi.Recorder(snapshots=1))
        chosen = shown_snapshots(long.snapshots, drive, system, 60)
        assert chosen.size == 60
        assert (chosen[0] == 0) == first
        assert (chosen[-1] == long.snapshots.time.size - 1) == (not first)
        frequency = system.first_frequency if first else 4.9
        assert 12 <= 1.0 / (frequency * np.diff(long.snapshots.time[chosen]).max()) * (1 + 1e-9) < 25
    assert shown_snapshots(long.snapshots, drive, system, 10**6).size == long.snapshots.time.size


def test_the_page_of_a_shock_has_its_player(tmp_path):
    given = shock()
    given = replace(given, output=replace(given.output, frames=60, report=True))
    found = fi.run_study(given, tmp_path / "out", parts=("simulate",))
    page = (found.directory / "report.html").read_text(encoding="utf-8")
    assert "has no attribute" not in page
    assert 'id="player' in page
