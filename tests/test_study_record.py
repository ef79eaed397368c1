"""A study whose base moves by a record: the file of columns beside the study file."""

from __future__ import annotations

import dataclasses
import json
import tomllib

import numpy as np
import pytest
from builders import FILES, ResultFileWarning, load_study, plan_lines, prepare, same_study, study_text

import femimpact as fi
from femimpact.app.report.pictures import draw_again
from femimpact.app.results.picture_data import read_results
from femimpact.app.study.drives import recorded
from femimpact.app.study.study_file import with_record
from femimpact.app.tasks.convergence import task_of_convergence
from femimpact.cli import app

pytestmark = [pytest.mark.impacts, pytest.mark.usefixtures("unreported")]

G = 9.80665
FREQUENCY, PER_CYCLE, CYCLES, AMPLITUDE = 5.0, 40, 20, 0.2e-3

BEAM = """
[beam]
length = 0.23026615
width = 0.020
thickness = 1e-3
young_modulus = 70e9
density = 2700.0

[mesh]
elements = 10

[[mass]]
name = "box"
at = "tip"
mass = 0.02290976

[damping]
ratio = 0.0029
modes = [1, 2]

[reduction]
modes = 4

[method]
name = "event-driven"

[output]
figures = false
paraview = false
movie = false
"""

BALL = """
[[impactor]]
name = "ball"
at = "tip"
mass = 3.43e-3
gap = 1e-3
contact = { law = "rigid", restitution = 0.6 }
"""

BASE = """
[base]
record = "shaker.csv"   # of the table, in g
scale = 9.80665
detrend = "mean"
"""

SWEEP = "[sweep]\nstart = 4.0\nstop = 6.0\npoints = 5\ncycles = 24\n"


@pytest.fixture
def shaker(tmp_path):
    """The file of a logger: whole cycles of a sine at FREQUENCY, in g, on an offset."""
    time = np.arange(CYCLES * PER_CYCLE) / (FREQUENCY * PER_CYCLE)
    sine = -AMPLITUDE * (2 * np.pi * FREQUENCY) ** 2 * np.sin(2 * np.pi * FREQUENCY * time) / G
    path = tmp_path / "shaker.csv"
    rows = (f"{t!r},{a!r}" for t, a in zip(time.tolist(), (sine + 0.02).tolist(), strict=True))
    path.write_text("time (s),base (g)\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def written(tmp_path, text):
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_study_with_a_record_gives_the_history_of_the_same_record_in_python(tmp_path, shaker):
    study = fi.load_study(written(tmp_path, BEAM + BALL + BASE))
    base = fi.RecordedBase.from_csv(shaker, scale=G, detrend="mean")
    assert study.duration is None
    assert study.history_duration == base.duration
    assert study.excitation.frequency == base.frequency == pytest.approx(FREQUENCY, rel=1e-12)
    results = fi.run_study(study, tmp_path / "out")
    prepared = prepare(study)
    run = fi.integrate(prepared.small, base, prepared.method, base.duration, prepared.record)
    assert len(run.impacts) > 10
    # the same call on the same samples
    assert np.array_equal(results.history["tip"], run["tip"])
    assert np.array_equal(results.history["base"], base.displacement(run.time))
    assert np.array_equal(results.impacts["time"], run.impacts.time)
    # a record has no phase, and no impact has one in it
    assert np.isnan(results.impact_data["phase"]).all()
    assert results.summary["history"]["impacts"] == len(run.impacts)


def test_a_record_of_a_sine_gives_the_motion_of_the_sine_but_for_the_lines_between_its_samples(tmp_path, shaker):
    base = f"\n[base]\namplitude = {AMPLITUDE}\nfrequency = {FREQUENCY}\nduration = 3.9\n"
    beam = BEAM.replace("[output]\n", "[output]\ninterval = 3.125e-3\n")
    studies = [load_study(written(tmp_path, beam + more)) for more in (BASE + "duration = 3.9\n", base)]
    recorded, exact = (
        fi.run_study(study, tmp_path / f"out-{i}").history["tip"].to_numpy() for i, study in enumerate(studies)
    )
    # as the docstring of RecordedBase says; what is left is the next term of sinc^2 and the images of the sine about
    # the rate of the samples, both below a twentieth of it
    low = (np.pi / PER_CYCLE) ** 2 / 3.0
    size = np.abs(exact).max()
    assert 1.0 - np.abs(recorded).max() / size == pytest.approx(low, rel=0.05)
    np.testing.assert_allclose(recorded, (1.0 - low) * exact, rtol=0, atol=0.05 * low * size)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("method", "rounding"), [("event-driven", 1e-11), ("newmark", 0.0)])
def test_the_last_cycles_of_a_record_are_the_rows_of_the_history(tmp_path, shaker, method, rounding):
    text = (BEAM + BALL + BASE).replace('"event-driven"', f'"{method}"').replace("figures = false", "figures = true")
    # no impact amplifies what rounding leaves
    text = text.replace('law = "rigid"', 'law = "kelvin-voigt", contact_time = 2e-3').replace("gap = 1e-3", "gap = 0.1")
    # a record of many cycles begins its last ones within the run
    time = np.arange(60 * 40) / 400.0
    np.savetxt(shaker, np.column_stack([time, np.sin(20 * np.pi * time)]), delimiter=",")
    results = fi.run_study(load_study(written(tmp_path, text.replace("9.80665", "0.2"))), tmp_path / "out")
    end = read_results(results.directory).last_cycles
    assert end.time[0] == pytest.approx(results.history["time"].to_numpy()[-1] - 4.0, abs=1e-2)
    rows = results.history.sel(time=slice(end.time[0] - 1e-9, None))
    same = np.searchsorted(end.time, rows["time"].to_numpy() - 1e-9)
    # they go on from a state within the run: step methods to the last bit, the event-driven one to rounding
    largest = float(np.abs(rows["tip"]).max())
    np.testing.assert_allclose(end["tip"][same], rows["tip"], rtol=0.0, atol=rounding * largest)
    assert largest > 1e-5


@pytest.mark.usefixtures("undrawn")
def test_results_are_whole_without_the_file_of_the_record(tmp_path, shaker):
    text = (BEAM + BALL + BASE).replace("figures = false", "figures = true")
    study = load_study(written(tmp_path, text))
    shaker.unlink()
    # what was read once is not read again
    results = fi.run_study(study, tmp_path / "out")
    again = read_results(results.directory)
    end, filmed = again.last_cycles, again.film
    times = np.linspace(0.0, study.history_duration, 101)
    for response in (end, filmed):
        assert np.array_equal(response.base.displacement(times), study.excitation.displacement(times))
        assert np.isnan(response.base.phase)
    assert set(end.channels) == set(results.summary["history"]["channels"])
    drawn = draw_again(results.directory, "figures", lambda _what, _share: None)
    stems = ("modes", "phase_portrait", "impact_histograms", "impulse_phase")
    assert {f"figures/{stem}.png" for stem in stems} <= set(drawn)
    assert fi.load(results.directory).summary["pictures"] == {"figures": "drawn"}


def test_the_study_of_the_results_runs_again_from_there(tmp_path, shaker):
    study = load_study(written(tmp_path, BEAM + BALL + BASE))
    first = fi.run_study(study, tmp_path / "out")
    copy = first.directory / FILES["base_record"].name
    assert copy.read_text() == shaker.read_text()
    assert copy.name in json.loads((first.directory / "summary.json").read_text())["checksums"]
    # as it was written, but for the name of the record
    kept = (first.directory / "study.toml").read_text(encoding="utf-8")
    assert kept == study.text.replace("shaker.csv", copy.name)
    shaker.unlink()
    again = fi.run_study(load_study(first.directory / "study.toml"), tmp_path / "again")
    for name in ("history.nc", "impacts.csv", "study.toml", copy.name):
        assert (again.directory / name).read_bytes() == (first.directory / name).read_bytes()
    # in its own place, too
    fi.run_study(load_study(first.directory / "study.toml"), first.directory, force=True)
    assert copy.read_bytes() == (again.directory / copy.name).read_bytes()
    copy.write_text(copy.read_text() + "# later\n")
    with pytest.warns(ResultFileWarning, match=r"base_record\.csv: is not as the study left it"):
        fi.load(first.directory)


def test_a_study_of_cases_has_its_record_and_tells_its_best_design(tmp_path, shaker, capsys):
    cases = """
[study]
measures = ["peak", "rms"]
starts = 1
[study.axes]
"impactor.ball.gap" = [0.5e-3, 1e-3]
"impactor.ball.contact.restitution" = [0.4, 0.8]
[study.best]
measure = "rms"
worst_over = ["impactor.ball.contact.restitution"]
"""
    out = tmp_path / "out"
    path = written(tmp_path, BEAM + BALL + BASE + cases)
    with pytest.raises(SystemExit) as ended:
        app(["study", str(path), "-o", str(out)])
    assert not ended.value.code
    assert (out / FILES["base_record"].name).read_bytes() == shaker.read_bytes()
    results = read_results(out)
    assert results.study is not None
    assert results.missing == []
    assert "Smallest worst rms" in capsys.readouterr().out
    (best,) = fi.best_case(results.parameter_study, "rms", ["impactor.ball.contact.restitution"]).designs
    chosen = load_study(out / "best.toml").structure.impactors[0]
    assert chosen.gap == pytest.approx(best.values["impactor.ball.gap"])


def test_a_later_run_with_a_sine_leaves_no_record_beside_its_results(tmp_path, shaker):
    out = tmp_path / "out"
    fi.run_study(load_study(written(tmp_path, BEAM + BASE)), out, parts=("modes",))
    assert (out / FILES["base_record"].name).exists()
    sine = "[base]\namplitude = 1e-4\nfrequency = 5.0\n"
    fi.run_study(load_study(written(tmp_path, BEAM + sine)), out, parts=("modes",), force=True)
    assert not (out / FILES["base_record"].name).exists()


@pytest.mark.parametrize(
    "changes",
    [
        {"base": {"scale": -9.80665}},
        {"duration": 1.5},
        {"base": {"columns": ("time (s)", 1)}},
        {"base": {"detrend": "line"}},
        {"start": "space"},
    ],
)
def test_a_changed_record_is_written_anew_and_read_as_the_same_study(tmp_path, shaker, changes):
    study = load_study(written(tmp_path, BEAM + BALL + BASE))
    changes = changes if "base" not in changes else {"base": recorded(**{**study.base.source, **changes["base"]})}
    changed = dataclasses.replace(study, **changes)
    results = fi.run_study(changed, tmp_path / "out", parts=("modes",))
    found = load_study(results.directory / "study.toml")
    assert same_study(found, with_record(changed, FILES["base_record"].name))
    data = tomllib.loads((results.directory / "study.toml").read_text(encoding="utf-8"))
    assert "content" not in data["base"]
    assert study_text(study) == study.text


@pytest.mark.parametrize(
    ("find", "put", "words"),
    [
        ('"shaker.csv"', '"nowhere.csv"', "nowhere.csv': must be a text file of columns: No such file"),
        ('"shaker.csv"', '"damaged.csv"', "damaged.csv': line 3, column 1: a text is no finite number"),
        ('"shaker.csv"', '"binary.csv"', "binary.csv': must be a text file of columns: is no text"),
        ('"shaker.csv"', '"uneven.csv"', "uneven.csv': line 2: the time is uneven"),
        ('"shaker.csv"', '"a\\u0000b"', "must be the path of a text file"),
        ('"shaker.csv"', "5", "base.record = 5: must be a text"),
        ("scale = 9.80665", "scale = 0", "base.scale = 0.0: must not be 0"),
        ('"mean"', '"linear"', "base.detrend = 'linear': must be 'none' or 'mean' or 'line'"),
        ('"mean"', '"mean"\ncolumns = [0]', "base.columns = (0,): must be two numbers"),
        ('"mean"', '"mean"\ncolumns = ["t", "x"]', "base.columns = 't': must be one of the columns of numbers of "),
        ('"mean"', '"mean"\nduration = 0', "base.duration = 0 s: must be a finite number > 0 s"),
        ('"mean"', '"mean"\nscael = 2.0', "base.scael: unknown; did you mean 'scale'?"),
        ('"mean"', '"mean"\ncontent = "0,1"', "base.content: unknown"),
        ('"mean"', '"mean"\nfrequency = 5.0', "base.frequency = 5.0: belongs to a sine"),
        ('"mean"', '"mean"\nacceleration = 5.0', "base.acceleration = 5.0: belongs to a sine"),
        ("record =", "file =", "base.record: is missing: [base] has detrend, file, scale"),
        ("\n[base]", f"\n{SWEEP}[base]", "sweep: needs a sine of the base"),
    ],
)  # fmt: skip
def test_what_does_not_go_with_a_record_is_one_clear_line(tmp_path, shaker, find, put, words):
    (tmp_path / "damaged.csv").write_text("t,a\n0,1\n0.1,x\n", encoding="utf-8")
    (tmp_path / "uneven.csv").write_text("0,1\n0.1,2\n0.3,3\n", encoding="utf-8")
    (tmp_path / "binary.csv").write_bytes(b"\xff\x00\x00\x81")
    assert find in BEAM + BASE
    with pytest.raises(fi.InputError) as told:
        load_study(written(tmp_path, (BEAM + BASE).replace(find, put)))
    (line,) = str(told.value).splitlines()
    assert words in line


def test_what_needs_a_sine_is_refused_before_any_work(tmp_path, shaker):
    path = written(tmp_path, BEAM + BALL + BASE)
    study, out = load_study(path), tmp_path / "out"
    words = r"needs a sine of the base, and \[base\] of this study has a record, 'shaker.csv'"
    refused = [
        (r"^frequency = 5\.0 Hz: ", lambda: app(["simulate", str(path), "--frequency", "5", "-o", str(out)])),
        ("^sweep: ", lambda: app(["sweep", str(path), "-o", str(out)])),
        ("^converge: ", lambda: task_of_convergence(study)),
        (r"^study\.sine: ", lambda: study.sine),
    ]
    for key, ask in refused:
        with pytest.raises(fi.InputError, match=key + words + "(; take a copy of the study .*)?$"):
            ask()
    assert not out.exists()


def test_the_plan_says_that_a_record_drives_the_history(tmp_path, shaker):
    study = load_study(written(tmp_path, BEAM + BALL + BASE))
    (line,) = [line for line in plan_lines(study) if line.startswith("history: ")]
    assert "3.995 s of the record 'shaker.csv' (800 samples, 0.005 s apart; a cycle is that of its largest" in line
    sine = dataclasses.replace(study, base=fi.Sine(1e-4, 5.0), duration=4.0)
    assert sine.history_words == "4 s at 5 Hz"


def test_a_check_that_takes_long_shows_that_it_goes_on(tmp_path, shaker, capsys, monkeypatch):
    path = written(tmp_path, BEAM + BALL + BASE)
    for wait, terminal, shown in ((0.0, True, True), (0.0, False, False), (1000.0, True, False)):
        monkeypatch.setattr("femimpact.cli.UNTIL_BAR", wait)
        monkeypatch.setattr("sys.stderr.isatty", lambda terminal=terminal: terminal)
        app(["check", str(path)], result_action="return_value")
        out, err = capsys.readouterr()
        assert ("check" in err) == shown
        assert "of the record 'shaker.csv'" in out


def test_a_record_outside_the_folder_of_its_study_is_named(tmp_path, shaker, capsys):
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "link.csv").symlink_to(tmp_path / "shaker.csv")
    plain = "\n".join(plan_lines(load_study(written(tmp_path, BEAM + BASE))))
    assert "outside the folder" not in plain
    for name in ("../shaker.csv", "link.csv", str(tmp_path / "shaker.csv")):
        lines = plan_lines(load_study(written(inner, (BEAM + BASE).replace("shaker.csv", name))))
        (line,) = [text for text in lines if "outside the folder" in text]
        assert line.startswith(f"note: base.record = {name!r} is outside the folder of the study file: ")
        assert line.endswith(str((tmp_path / "shaker.csv").resolve()))


def test_a_fault_of_a_text_that_is_no_record_does_not_show_it(tmp_path):
    secret = "root:x:0:0:root:/root:/bin/bash"
    for text in (f"{secret}\n", f"1,2\n{secret},{secret}\n", f"a,b\n\n{secret} {secret}\n", f"{secret},1\0\n"):
        for columns in ("", '\ncolumns = ["t", "a"]'):
            (tmp_path / "shaker.csv").write_text(text, encoding="utf-8")
            with pytest.raises(fi.InputError) as told:
                load_study(written(tmp_path, BEAM + BASE + columns))
            assert "root" not in str(told.value)
            assert " line " in str(told.value)
