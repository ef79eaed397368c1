"""The command line as a user meets it."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from builders import FILES, SMALL_STUDY, UNDRAWN_STUDY, paper_study_text, read_csv
from command import femimpact, femimpact_process

import femimpact as fi
from femimpact import core
from femimpact.app.report.page import WARNINGS_PAGE


@pytest.fixture
def ran(finished):
    """What one `run` of a small study left, to be read."""
    return finished / "out"


def test_the_help_of_the_completion_names_the_file_that_it_edits(tmp_path, monkeypatch):
    shown = femimpact_process("--install-completion", "--help", cwd=tmp_path).stdout
    monkeypatch.setenv("HOME", str(tmp_path))
    for shell, edited in (("bash", ".bashrc"), ("zsh", ".zshrc"), ("fish", None)):
        before = set(tmp_path.glob(".*rc"))
        monkeypatch.delenv("ZSH", raising=False)
        monkeypatch.delenv("ZSH_CUSTOM", raising=False)
        femimpact_process("--install-completion", "--shell", shell, cwd=tmp_path)
        assert {path.name for path in set(tmp_path.glob(".*rc")) - before} == ({edited} if edited else set())
        assert edited is None or f"~/{edited}" in shown


def test_init_then_check(tmp_path):
    femimpact("init", "mine.toml", cwd=tmp_path)
    # as a user calls it: in a separate process
    printed = femimpact_process("check", "mine.toml", "--all", cwd=tmp_path).stdout
    for words in (
        "dofs: 80 of the mesh",
        "contact time: 0.002 s",
        "step: 0.0001 s (recommended)",
        "1200000 steps",
        "MB",
    ):
        assert words in printed
    again = femimpact("init", "mine.toml", cwd=tmp_path, check=False)
    assert again.returncode == 2
    (line,) = again.stderr.splitlines()
    assert "exists already" in line


def test_run_leaves_every_file_and_load_reads_it_back(ran):
    parts = {"run", "modes", "history", "sweep", "pictures"}
    movies = ("movie", "movie_without_encoder")
    written = [file.name for key, file in FILES.items() if parts & set(file.writer.split(", ")) and key not in movies]
    assert len(written) > 12
    assert [name for name in written if not (ran / name).exists()] == []
    assert any((ran / name).exists() for name in ("movie.mp4", "movie.gif"))
    results = fi.load(ran)
    assert results.summary["natural_frequency"]["empty"][0] == pytest.approx(5.30, abs=5e-4)
    assert results.summary["natural_frequency"]["glued"][0] == pytest.approx(4.98, abs=5e-4)
    # the table and the netCDF file hold the same sweep
    table = read_csv(ran / FILES["sweep"].name)
    np.testing.assert_array_equal(table["ball_peak"], results.sweep["peak"].sel(case="ball"))
    assert results.history["tip"].attrs["units"] == "m"
    assert results.impacts["time"].size == results.summary["history"]["impacts"]
    assert not [path for path in ran.parent.iterdir() if path.name.startswith(".out")]


def test_summary_has_the_promised_keys_as_plain_numbers(ran):
    summary = json.loads((ran / "summary.json").read_text())
    for case in ("empty", "ball"):
        for key in ("peak_frequency", "peak_amplitude", "damping_fit", "damping_half_power"):
            assert isinstance(summary["sweep"][case][key], float | None)
    for key in ("amplitude_ratio", "restitution", "energy_residual"):
        assert isinstance(summary[key], float)
    assert summary["contact"]["law"] == "kelvin-voigt"
    for key in ("peak_force", "mean_impulse", "cycle_mean_force"):
        assert summary["contact"][key] > 0
    assert summary["versions"]["femimpact"] == fi.__version__
    # by what the numbers were computed
    assert summary["core"] == core.build_info() | {"targets": list(core.build_info()["targets"])}
    assert isinstance(summary["warnings"], list)


def test_values_of_one_start_have_a_star_on_the_terminal(ran, capsys):
    from femimpact.cli import print_results

    results, table = fi.load(ran), read_csv(ran / "sweep.csv")
    print_results(results.directory)
    printed = capsys.readouterr().out
    for case in ("empty", "ball"):
        one = table[f"{case}_steadiness"][np.nanargmax(table[f"{case}_peak"])] != "periodic"
        words = {"empty": "without", "ball": "with"}[case]
        peak = f"Largest peak {words} ball: {1e3 * results.summary['sweep'][case]['peak_amplitude']:#.4g}"
        about = results.summary["sweep"][case]
        assert about["peak_is_one_start"] is bool(one and case == "ball")
        # without impacts it is no sample
        assert about["peak_is_transient"] is bool(one and case == "empty")
        assert (f"{peak}*" if one and case == "ball" else f"{peak} ") in printed
    # six seconds from rest are not periodic
    history = results.summary["history"]
    assert history["steadiness"] != "periodic"
    assert f"Peak of the tip: {1e3 * history['peak']:#.4g}* mm" in printed
    force, unit = (results.summary["contact"]["peak_force"], "N")
    force, unit = (force, unit) if force >= 1.0 else (1e3 * force, "mN")
    assert f"Largest force of ball: {force:#.4g}* {unit}" in printed
    largest = (f"{1e3 * history['channels']['tip'][key]:.4g} mm" for key in ("largest_of_run", "largest"))
    assert f"tip {' '.join(largest)}" in " ".join(printed.split())
    assert "* one start's value: the motion is not periodic" in printed


def test_existing_results_are_kept_unless_forced(finished, tmp_path):
    ran = shutil.copytree(finished / "out", tmp_path / "out")
    (tmp_path / "small.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    refused = femimpact("modes", "small.toml", "-o", "out", cwd=tmp_path, check=False)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert "exists already" in line
    assert (ran / "history.nc").exists()
    femimpact("modes", "small.toml", "-o", "out", "--force", "--quiet", cwd=tmp_path)
    assert not (ran / "history.nc").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "nowhere.toml"), "must be an existing TOML file"),
        (("runn", "small.toml"), "runn"),
        (("simulate", "small.toml", "--frequency", "0"), "frequency = 0.0 Hz: must be a finite number > 0 Hz"),
        (("simulate", "small.toml", "--frequency", "fast"), "fast"),
        (("run", "coarse.toml"), "contact time of 0.002 s"),
        (("run", "typo.toml"), "did you mean 'thickness'?"),
    ],
)
def test_bad_input_exits_with_2_and_no_traceback(tmp_path, arguments, words):
    (tmp_path / "small.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    (tmp_path / "coarse.toml").write_text(UNDRAWN_STUDY.replace('name = "newmark"', "dt = 1e-3"), encoding="utf-8")
    (tmp_path / "typo.toml").write_text(UNDRAWN_STUDY.replace("thickness =", "thicknes ="), encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    done = femimpact(*arguments, cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert words in done.stderr
    assert sorted(tmp_path.iterdir()) == before


def test_coarse_step_let_through_leaves_its_warning(tmp_path):
    text = UNDRAWN_STUDY.replace('name = "newmark"', "dt = 1e-3\nallow_coarse_step = true")
    (tmp_path / "coarse.toml").write_text(text, encoding="utf-8")
    printed = femimpact("simulate", "coarse.toml", "-o", "out", cwd=tmp_path).stdout
    warnings = fi.load(tmp_path / "out").summary["warnings"]
    assert any("coarse step: dt = 0.001 s against a contact time of 0.002 s" in text for text in warnings)
    assert "warning: coarse step" in printed


def test_a_run_shorter_than_a_base_cycle_has_no_amplitude_and_says_so(tmp_path):
    (tmp_path / "short.toml").write_text(UNDRAWN_STUDY.replace("duration = 6.0 ", "duration = 0.05 "), encoding="utf-8")
    printed = femimpact("simulate", "short.toml", "-o", "out", cwd=tmp_path).stdout
    assert "Peak of the tip: none; the history is shorter than a cycle" in printed


def test_a_frequency_of_the_command_line_takes_the_place_of_that_of_the_study(tmp_path):
    (tmp_path / "small.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    femimpact("simulate", "small.toml", "--frequency", "7.25", "-o", "out", "-q", cwd=tmp_path)
    assert fi.load(tmp_path / "out").summary["history"]["frequency"] == 7.25


@pytest.mark.parametrize("command", ["modes", "simulate", "sweep", "run", "converge"])
def test_a_plan_says_what_would_be_computed_and_leaves_nothing(tmp_path, command):
    (tmp_path / "s.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    lines = femimpact(command, "s.toml", "--plan", cwd=tmp_path).stdout.splitlines()
    parts = {"simulate": {"history"}, "sweep": {"sweep"}, "run": {"history", "sweep"}, "converge": {"convergence"}}
    kinds = {line.partition(": ")[0] for line in lines} & {"history", "sweep", "convergence"}
    assert kinds == parts.get(command, set())
    assert "besides: some 200 MB for the libraries" in lines
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


def test_the_plan_of_a_parameter_study_counts_its_cases_and_leaves_nothing(tmp_path):
    cases = '[study]\nmeasures = ["peak"]\ncycles = 30\n[study.axes]\n"impactor.ball.gap" = [0.003, 0.004, 0.005]\n'
    (tmp_path / "s.toml").write_text(UNDRAWN_STUDY + cases, encoding="utf-8")
    lines = femimpact("study", "s.toml", "--plan", cwd=tmp_path).stdout.splitlines()
    assert lines[0].startswith("study: 3 cases (3), 1 start each, 30 cycles")
    assert lines[1].startswith("study takes about")
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


@pytest.mark.parametrize("command", ["study", "run"])
def test_an_unknown_option_names_the_help_of_its_command(tmp_path, command):
    done = femimpact(command, "s.toml", "--pln", cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert f"see: femimpact {command} --help" in done.stderr


def test_converge_without_a_sine_of_the_base_names_the_ways_on(tmp_path):
    driven = UNDRAWN_STUDY.replace(
        "[base]", '[[force]]\nat = "tip"\nkind = "sine"\nforce = 1.0\nfrequency = 5.0\n[base]'
    )
    driven = driven[: driven.index("[sweep]")] + driven[driven.index("[output]") :]
    (tmp_path / "s.toml").write_text(driven, encoding="utf-8")
    done = femimpact("converge", "s.toml", cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert "take a copy of the study with such a [base] and no force, or fi.convergence_study(" in done.stderr


def test_check_refuses_what_run_would_refuse(tmp_path):
    for find, put, words in (
        ("stop = 6.0 ", "stop = 6000.0 ", "sweep.stop = 6000.0 Hz: must be <= 1250 Hz"),
        ("duration = 6.0 ", "duration = 1e9 ", "output.memory_limit"),
    ):
        (tmp_path / "s.toml").write_text(UNDRAWN_STUDY.replace(find, put), encoding="utf-8")
        for command in (("check", "s.toml"), ("run", "s.toml")):
            done = femimpact(*command, cwd=tmp_path, check=False)
            assert done.returncode == 2
            assert words in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


def test_check_strict_has_status_2_where_a_limit_is_passed_or_a_warning_is_printed(tmp_path):
    study = UNDRAWN_STUDY.replace("duration = 6.0 ", "duration = 60.0 ").replace("cycles = 60 ", "cycles = 600 ")
    # half of the amplitude: linear beam theory holds without the ball too
    study = study.replace("refine = 6 ", "refine = 40 ").replace("amplitude = 0.2037e-3", "amplitude = 0.1e-3")
    for find, put, words in (
        ("gap = 0.004 ", "gap = 0.004 ", ""),
        ("gap = 0.004 ", "gap = 4.0 ", "impactor.ball.gap"),
        ("# every = 10 ", "every = 400 ", "misses the extremes between them; take at most 102"),
    ):
        (tmp_path / "s.toml").write_text(study.replace(find, put), encoding="utf-8")
        done = femimpact("check", "--strict", "s.toml", cwd=tmp_path, check=False)
        assert done.returncode == (2 if words else 0)
        assert words in done.stderr


def test_an_output_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "small.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    done = femimpact("modes", "small.toml", "-o", "small.toml/out", cwd=tmp_path, check=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "Traceback" not in done.stderr


def test_forced_results_do_not_stand_beside_older_ones(tmp_path):
    (tmp_path / "small.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    femimpact("modes", "small.toml", "-o", "out", "-q", cwd=tmp_path)
    quiet = femimpact("sweep", "small.toml", "-o", "out", "-q", "--force", cwd=tmp_path)
    results = fi.load(tmp_path / "out")
    # quiet is without tables and progress, not without warnings: the dwells are short
    assert quiet.stdout == ""
    assert any("of the first mode's transient" in text for text in results.summary["warnings"])
    said = [f"femimpact: warning: {text}" for text in results.summary["warnings"]]
    assert quiet.stderr.splitlines()[:-1] == said
    assert results.modes is None
    assert results.sweep is not None


@pytest.mark.skipif(os.name != "posix", reason="sends signals to a child process")
@pytest.mark.parametrize("request_to_end", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_leaves_nothing_behind(tmp_path, request_to_end):
    text = (
        paper_study_text()
        .replace("duration = 120.0 ", "duration = 200000.0 ")
        .replace("# every = 10 ", "every = 1000 ")
    )
    (tmp_path / "long.toml").write_text(text, encoding="utf-8")
    child = subprocess.Popen(
        [sys.executable, "-m", "femimpact", "simulate", "long.toml", "-o", "out", "-q"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        # where the tests run in the background, their children would ignore it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    # this folder appears when the work begins
    for _ in range(600):
        if (tmp_path / "out.part" / "study.toml").exists():
            break
        time.sleep(0.05)
    time.sleep(0.5)
    child.send_signal(request_to_end)
    _, errors = child.communicate(timeout=120)
    assert child.returncode == 130, errors
    assert errors.strip() == "femimpact: interrupted; nothing was written"
    assert [path.name for path in tmp_path.iterdir()] == ["long.toml"]


def test_converge_writes_tables_and_figures(tmp_path):
    text = SMALL_STUDY.replace("[output]", '[output]\ntitle = "Mesh of an arm"\nauthor = "A. Author"', 1)
    (tmp_path / "small.toml").write_text(text, encoding="utf-8")
    printed = femimpact("converge", "small.toml", "-o", "out", "--accuracy", "1e-4", cwd=tmp_path).stdout
    names = {
        "quantities_over_mesh", "quantities_over_step", "quantities_over_modes", "statistics_over_mesh",
        "runs_over_step",
    }  # fmt: skip
    assert {path.name for path in (tmp_path / "out").glob("*.csv")} == {f"{name}.csv" for name in names} | {
        "convergence_summary.csv"
    }
    assert {path.name for path in (tmp_path / "out" / "figures").iterdir()} == {f"{name}.png" for name in names}
    assert (tmp_path / "out" / "report.html").exists()
    assert fi.load(tmp_path / "out").summary["accuracy"] == 1e-4
    # of every axis the errors that fall, and what the accuracy takes
    quantities = read_csv(tmp_path / "out" / "quantities_over_mesh.csv")
    for axis, counted in (("mesh", "elements"), ("step", "steps in a first period"), ("modes", "modes")):
        errors = printed[printed.index(f"Over the {axis}: relative errors") :].partition("\n\n")[0].splitlines()
        assert errors[1].startswith(counted)
        row = next(line for line in errors if line.startswith("steady tip")).split()[2:]
        assert len(row) >= 3
        assert all(a > b for a, b in itertools.pairwise(map(float, row)))
    first = next(line for line in printed.splitlines() if line.startswith("frequency 1")).split()[2]
    assert float(first) == pytest.approx(quantities["frequency_1_error"][0], rel=0.05)
    assert "differences from the finest (* beyond the scatter)" in printed
    assert printed.count("for 0.01 %") == 3
    assert "What an accuracy takes" not in printed
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    for words in (
        "Linear response without contacts, base motion of 0.2037 mm at 4.9 Hz",
        "Runs with contacts, base motion of 0.2037 mm at 4.9 Hz",
        "Needed: elements",
    ):
        assert words in printed
        assert words in page
    assert "<title>Mesh of an arm" in page
    assert "A. Author" in page[: page.index("<main")]


def test_check_prints_what_matters_and_all_of_it_where_that_is_asked_for(tmp_path):
    femimpact("init", "mine.toml", cwd=tmp_path)
    every = femimpact("check", "mine.toml", "--all", cwd=tmp_path).stdout.splitlines()
    lines = femimpact("check", "mine.toml", cwd=tmp_path).stdout.splitlines()
    *kept, count, page = lines
    assert set(kept) < set(every)
    assert page == every[-1]
    # without ball and with it glued on, as the modes of a run are
    without, glued = map(float, re.findall(r"([\d.]+) Hz", lines[0]))
    structure = fi.load_study(tmp_path / "mine.toml").structure
    bare, heavy = (
        fi.solve_modes(fi.assemble(one, elements=40), count=1).natural_frequency[0]
        for one in (replace(structure, impactors=()), fi.structure.glue_impactors(structure))
    )
    assert without == pytest.approx(bare, rel=1e-5)
    assert glued == pytest.approx(heavy, rel=1e-5)
    # no row is lost between the two: a limit that is passed is among the lines, the others are counted
    rows = [line for line in every if line.startswith(("test: ", "limit passed: "))]
    assert [line for line in rows if line.startswith("limit passed: ")] == [
        line for line in lines if line.startswith("limit passed: ")
    ]
    assert count.startswith(f"{len(set(rows) - set(lines))} more numbers within their limits")


def test_check_and_quiet_name_the_page_of_warnings_with_their_warnings(tmp_path):
    clean, warned = (re.sub(r"^(points|refine) = .*$", rf"\1 = {n}", UNDRAWN_STUDY, flags=re.MULTILINE) for n in (9, 4))
    (tmp_path / "study.toml").write_text(re.sub(r"^stop = .*$", "stop = 4.1", warned, flags=re.M), encoding="utf-8")
    words = f"what warnings mean and what to do: {WARNINGS_PAGE}"
    checked = femimpact("check", "study.toml", cwd=tmp_path).stdout.splitlines()
    assert any(line.startswith("warning: ") for line in checked)
    assert checked[-1] == words
    quiet = femimpact("sweep", "study.toml", "--quiet", "-o", "out", cwd=tmp_path).stderr.splitlines()
    assert quiet[0].startswith("femimpact: warning: ")
    assert quiet.count(f"femimpact: {words}") == 1
    assert quiet[-1] == f"femimpact: {words}"
    (tmp_path / "study.toml").write_text(clean, encoding="utf-8")
    quiet = femimpact("modes", "study.toml", "--quiet", "-o", "modes", cwd=tmp_path).stderr
    assert (words in quiet) == ("warning: " in quiet)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs a limit on address space")
@pytest.mark.parametrize("limit", [4e8, 6.5e8, 9.9e8])
def test_a_memory_limit_below_what_the_libraries_take_is_one_line(tmp_path, limit):
    import resource

    (tmp_path / "small.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "femimpact", "modes", "small.toml", "-o", "out"],
        cwd=tmp_path, capture_output=True, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (int(limit), resource.RLIM_INFINITY)),
    )  # fmt: skip
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert f"{limit / 1e6:.0f} MB" in done.stderr
    assert not (tmp_path / "out").exists()
