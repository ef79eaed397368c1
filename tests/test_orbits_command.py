"""`femimpact orbits`: the branches of [orbits], their files, figure and report, and what is refused."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from builders import OrbitsPlan, build, paper_study_text, read_csv, read_study
from command import femimpact

import femimpact as fi
from femimpact.app.results.picture_data import read_results
from femimpact.files import read_units

pytestmark = pytest.mark.impacts

ORBITS = {"parameter": '"frequency"', "range": "[4.9, 5.6]", "guess_duration": "80.0",
          "switch": '["symmetry-breaking"]'}  # fmt: skip


def study_text(changes=(), **orbits):
    """The paper's beam with 4 modes, a gap of 2 mm, a restitution of 0.6 and 5.3 Hz, which settles."""
    text = paper_study_text().partition("# Branches of periodic orbits")[0]
    for find, put in (
        ('name = "newmark" ', 'name = "event-driven" '),
        ("gap = 0.004 ", "gap = 0.002 "),
        ("frequency = 4.9 ", "frequency = 5.3 "),
        ("modes = 8 ", "modes = 4 "),
        ("elements = 40 ", "elements = 20 "),
        ('law = "kelvin-voigt", restitution = 0.78, contact_time = 2e-3', 'law = "rigid", restitution = 0.6'),
        ("points = 21 ", "points = 15 "),
        ("cycles = 600 ", "cycles = 400 "),
        *changes,
    ):
        assert find in text, find
        text = text.replace(find, put)
    keys = {**ORBITS, **orbits}
    return f"{text}\n[orbits]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items() if value is not None)


def without_sweep(text):
    return re.sub(r"\[sweep\].*?(?=\[output\])", "", text, flags=re.DOTALL)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A folder with the study, what the command left in `out`, and what it printed."""
    folder = tmp_path_factory.mktemp("orbits")
    (folder / "study.toml").write_text(study_text(), encoding="utf-8")
    return folder, femimpact("orbits", "study.toml", "-o", "out", cwd=folder).stdout


@pytest.fixture(scope="module")
def out(done):
    return done[0] / "out"


@pytest.fixture(scope="module")
def branch():
    """The branch that functions of the package follow."""
    study = read_study(study_text(), Path("study.toml"))
    system = build(study)[1]
    run = fi.integrate(system, study.sine, fi.EventDriven(), 80.0)
    return fi.continue_orbit(fi.find_orbit(system, run.base, guess=run), "frequency", (4.9, 5.6))


# ---- what is found ----------------------------------------------------------------------------------


def rows_of(out, number):
    table = read_csv(out / "bifurcations.csv")
    return {name: values[table["branch"] == number] for name, values in table.items()}


def assert_rows(rows, branch):
    """Bifurcations are located to a relative 1e-10, at which the multipliers move by more."""
    points = branch.bifurcation_points
    assert rows["kind"].tolist() == [each.kind for each in branch.bifurcations]
    np.testing.assert_allclose(rows["base.frequency"], [each.value for each in branch.bifurcations], rtol=1e-9)
    np.testing.assert_allclose(rows["peak"], branch.peak[points], rtol=1e-6)
    np.testing.assert_allclose(rows["first_harmonic"], branch.first_harmonic[points], rtol=1e-6)
    np.testing.assert_allclose(rows["largest_multiplier"], np.abs(branch.multipliers[points, 0]), rtol=1e-5)


def test_the_table_has_the_bifurcations_of_the_functions(out, branch):
    assert_rows(rows_of(out, 1), branch)
    units = read_units(out / "bifurcations.csv")
    expected = {"base.frequency": "Hz", "peak": "m", "first_harmonic": "m", "largest_multiplier": "1"}
    assert units == expected


def test_a_switched_branch_is_that_of_the_functions(out, branch):
    breaking = [each for each in branch.bifurcations if each.kind == "symmetry-breaking"][-1]
    one, _ = fi.orbits.switch_branch(breaking)
    first = rows_of(out, 1)
    row = np.argmin(np.abs(first["base.frequency"] - breaking.value))
    assert_rows(rows_of(out, int(first["leads_to"][row])), fi.continue_orbit(one, "frequency", (4.9, 5.6)))


def beginning_at(folder, frequency, **orbits):
    """Results of a study that settles on an orbit of a branch that ends on another one."""
    changes = (("figures = true", "figures = false\nreport = false"), ("frequency = 5.3 ", f"frequency = {frequency} "))
    (folder / "study.toml").write_text(without_sweep(study_text(changes, most_branches=2, **orbits)), encoding="utf-8")
    femimpact("orbits", "study.toml", "-o", "out", cwd=folder)
    return fi.load(folder / "out").summary["orbits"]["branches"]


def test_from_an_asymmetric_orbit_the_symmetric_branch_is_followed(tmp_path, branch):
    beginning_at(tmp_path, 5.16, range="[5.155, 5.18]")
    breaking = next(each.value for each in branch.bifurcations if each.kind == "symmetry-breaking" and each.value > 5.1)
    for number, other in ((1, 2), (2, 1)):
        rows = rows_of(tmp_path / "out", number)
        (row,) = np.flatnonzero(rows["kind"] == "symmetry-breaking")
        # located to a relative 1e-10, from either branch
        assert rows["base.frequency"][row] == pytest.approx(breaking, rel=1e-9)
        assert float(rows["leads_to"][row]) == other


def test_from_a_doubled_orbit_the_branch_of_half_its_period_is_followed(tmp_path):
    keys = {"range": "[5.119, 5.142]", "guess_duration": "200.0", "cycles": "2", "switch": '["period-doubling"]'}
    doubled, single = beginning_at(tmp_path, 5.122, **keys)
    assert (doubled["cycles"], single["cycles"]) == (2, 1)
    assert any(end.startswith("joins the branch of half its period") for end in doubled["ends"])
    rows = [rows_of(tmp_path / "out", number) for number in (1, 2)]
    (row,) = np.flatnonzero(rows[0]["leads_to"] == 2)
    back = rows[1]["leads_to"] == 1
    np.testing.assert_allclose(rows[1]["base.frequency"][back], rows[0]["base.frequency"][[row]], rtol=1e-9)


def test_mirror_images_are_one_branch(out):
    """Each pair begins and ends on the symmetric branch, or at an impact more, and is followed once."""
    table = read_csv(out / "bifurcations.csv")
    breaking = table["kind"] == "symmetry-breaking"
    led_to = {int(number) for number in table["leads_to"][breaking & (table["branch"] == 1)]}
    assert led_to == set(range(2, int(table["branch"].max()) + 1))
    # each of the others leads back to the first
    assert set(table["leads_to"][breaking & (table["branch"] != 1)]) == {"1"}
    values = np.round(table["base.frequency"][breaking], 6)
    assert all(np.count_nonzero(values == value) == 2 for value in values)


def test_runs_lie_on_the_stable_branch(out, branch):
    """Between symmetry breaking and the Neimark-Sacker point no other motion is met from rest."""
    data = fi.load(out).branches
    low, high = (next(b.value for b in branch.bifurcations if b.kind == kind and b.value > 5.1)
                 for kind in ("symmetry-breaking", "neimark-sacker"))  # fmt: skip
    within = (data["swept"].to_numpy() > low) & (data["swept"].to_numpy() < high)
    swept, peak = data["swept"].to_numpy()[within], data["swept_peak"].to_numpy()[within]
    assert swept.size >= 2
    exact = np.interp(swept, branch.values, branch.peak)
    # of 400 cycles the last third is measured: what is left of the transient is below 1 % there
    np.testing.assert_allclose(peak, exact, rtol=0.02)


# ---- files ------------------------------------------------------------------------------------------


def test_branches_come_back_from_their_file(out, branch):
    loaded = fi.app.load_branch(out / "branches.nc")
    for name in ("values", "peak", "first_harmonic"):
        np.testing.assert_allclose(getattr(loaded, name), getattr(branch, name), rtol=1e-9)
    assert loaded.end == branch.end
    assert (loaded.parameter, loaded.unit, loaded.place) == (branch.parameter, branch.unit, branch.place)
    data, table = fi.load(out).branches, read_csv(out / "branches.csv")
    for number in data["branch"].to_numpy().tolist():
        one, rows = fi.app.load_branch(out / "branches.nc", number=number), table["branch"] == number
        np.testing.assert_array_equal(one.values, table["base.frequency"][rows])
        np.testing.assert_array_equal(one.peak, table["peak"][rows])
        assert [b.kind for b in one.bifurcations] == rows_of(out, number)["kind"].tolist()
        assert one.end == (data["first_end"].sel(branch=number).item(), data["last_end"].sel(branch=number).item())


@pytest.mark.parametrize("number", [0, 99, 1.5])
def test_a_number_of_no_branch_is_one_line(out, number):
    with pytest.raises(fi.InputError, match="number = ") as caught:
        fi.app.load_branch(out / "branches.nc", number=number)
    assert "\n" not in str(caught.value)


def cut_off(path):
    path.write_bytes(path.read_bytes()[:5000])


def of_something_else(path):
    path.write_bytes(b"CDF no branches")


def without_ends(path):
    import xarray

    data = xarray.load_dataset(path)
    data.drop_vars("first_end").to_netcdf(path)


@pytest.mark.parametrize("damage", [cut_off, of_something_else, without_ends])
def test_a_damaged_file_is_one_line(out, tmp_path, damage):
    shutil.copy(out / "branches.nc", tmp_path / "branches.nc")
    damage(tmp_path / "branches.nc")
    with pytest.raises(fi.InputError, match="is damaged and cannot be read") as caught:
        fi.app.load_branch(tmp_path / "branches.nc", number=2)
    assert "\n" not in str(caught.value)


def edited(name, change):
    def changed(data):
        return data.assign({name: data[name].copy(data=change(data[name].to_numpy().copy()))})

    return changed


def with_units(name, unit):
    def changed(data):
        data[name].attrs["units"] = unit
        return data

    return changed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (with_units("peak", "mm"), "units of peak = 'mm': must be m"),
        (with_units("first_harmonic", ""), "units of first_harmonic = 'none': must be m"),
        (with_units("value", "kHz"), "units of value = 'kHz': must be Hz"),
        (edited("peak", lambda peak: -peak), "peak = array"),
        (edited("first_harmonic", lambda peak: np.nan * peak), "must be finite numbers >= 0"),
        (edited("is_stable", lambda stable: ~stable), "is_stable = array"),
        (edited("number", lambda number: np.where(number == 2, 1, number)), "number = [1"),
        (lambda data: data.isel(multiplier=slice(None, None, -1)), "the largest first"),
        (lambda data: data.isel(multiplier=slice(0)), "must be one or more of each orbit"),
        (lambda data: data.isel(branch=slice(1)), "must be 1 to 1, for as many branches have ends"),
        (edited("multipliers_real", lambda real: np.nan * real), "the largest first"),
    ],
)
def test_an_edited_file_is_one_line(out, tmp_path, change, words):
    import xarray

    change(xarray.load_dataset(out / "branches.nc")).to_netcdf(tmp_path / "branches.nc")
    with pytest.raises(fi.InputError, match="is damaged and cannot be read: ") as caught:
        fi.app.load_branch(tmp_path / "branches.nc")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("change", [
    lambda data: data.drop_attrs(deep=False), lambda data: data.drop_vars("origin"),
    lambda data: data.drop_vars("swept_peak"), lambda data: data.assign_attrs(modes="four"),
])  # fmt: skip
def test_results_that_lack_a_part_are_one_line(out, tmp_path, change):
    import xarray

    change(xarray.load_dataset(out / "branches.nc")).to_netcdf(tmp_path / "branches.nc")
    results = read_results(tmp_path)
    assert results.followed is None
    (line,) = results.failures
    assert line.startswith("branches.nc: ")
    assert "\n" not in line
    # the whole file is read
    shutil.copy(out / "branches.nc", tmp_path)
    assert len(read_results(tmp_path).followed.branches) > 1


def test_a_report_of_damaged_branches_says_so(out, tmp_path):
    shutil.copytree(out, tmp_path / "out")
    cut_off(tmp_path / "out" / "branches.nc")
    femimpact("report", "out", cwd=tmp_path)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "What is missing" in page
    assert "branches.nc" in page[page.index("What is missing") :][:400]
    assert 'id="orbits"' not in page


def test_figure_report_and_printed_lines_say_the_same(done, out):
    printed, page = done[1], (out / "report.html").read_text(encoding="utf-8")
    results = fi.load(out)
    branches, rows = results.summary["orbits"]["branches"], results.bifurcations
    assert results.summary["pictures"] == {"figures": "drawn"}
    assert (out / "figures" / "branches.png").stat().st_size > 10_000
    section = page[page.index('<section id="orbits"') :]
    section = section[: section.index("</section>")]
    captions = re.findall(r"<caption>(.*?)</caption>", section)
    assert captions == ["The branches", "Bifurcations"]
    # a head each
    assert section.count("<tr>") == 2 + len(branches) + len(rows["kind"])
    for words in ("femimpact orbits study.toml", "On 4 modes", "stable", "unstable", "stepped sweep", "Neimark-Sacker"):
        assert words in section
    for branch in branches:
        assert all(end in section for end in branch["ends"])
    for words in ("The branches", "Bifurcations", f"Branches of periodic orbits: {len(branches)}; over base.frequency"):
        assert words in printed
    # of 8 digits, so that bifurcations side by side can be told apart
    for value in rows["base.frequency"]:
        assert f"{value:.8g}" in printed
        assert f">{value:.7f}<" in section
    conclusions = page[page.index('<section id="conclusions"') : page.index('<section id="structure"')]
    assert f'Branches of periodic orbits</dt><dd class="value">{len(branches)}</dd>' in conclusions


def test_the_summary_says_where_a_branch_is_stable(done, out):
    results = read_results(out)
    summary, branches = results.findings.orbits.branches, results.followed.branches
    assert any(one.stable for one in summary)
    for one, branch in zip(summary, branches, strict=True):
        away = np.ones(len(branch), dtype=bool)
        away[branch.bifurcation_points] = False
        inside = np.any(
            [(low <= branch.values) & (branch.values <= high) for low, high in one.stable or [(1, 0)]], axis=0
        )
        assert inside[branch.is_stable & away].all()
        # without a fold a value has one orbit
        if not any(each.kind == "fold" for each in branch.bifurcations):
            assert not inside[~branch.is_stable & away].any()
    low, high = next(one.stable[0] for one in summary if one.stable)
    assert f"{low:.8g} to {high:.8g} Hz" in " ".join(done[1].split())


def test_the_figure_is_drawn_again_and_a_second_run_is_refused(done, out):
    folder, before = done[0], (out / "bifurcations.csv").read_bytes()
    assert "branches.png" in femimpact("figures", "out", cwd=folder).stdout
    refused = femimpact("orbits", "study.toml", "-o", "out", cwd=folder, check=False)
    assert refused.returncode == 2
    assert refused.stderr.strip() == (
        "femimpact: output = 'out': exists already: choose another directory with -o, or --force"
    )
    assert (out / "bifurcations.csv").read_bytes() == before


def test_the_number_of_branches_is_limited_and_said(tmp_path):
    """Without figures, report and sweep, and quietly: what is left out is in the summary."""
    changes = (("figures = true", "figures = false\nreport = false"),)
    text = without_sweep(study_text(changes, range="[5.29, 5.33]", most_branches=1))
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    quiet = femimpact("orbits", "study.toml", "-q", cwd=tmp_path)
    assert (quiet.stdout, quiet.stderr) == ("", "")
    results = fi.load(tmp_path / "study-orbits")
    assert len(results.summary["orbits"]["branches"]) == 1
    (note,) = [text for text in results.summary["notes"] if "not followed" in text]
    assert note.startswith("not followed, for orbits.most_branches = 1: from symmetry breaking of branch 1 at 5.32")
    assert {path.name for path in (tmp_path / "study-orbits").iterdir()} == {
        "bifurcations.csv", "branches.csv", "branches.nc", "study.toml", "summary.json",
    }  # fmt: skip


def test_a_refused_switch_is_a_note(tmp_path):
    """With less and less amplitude the ball ends up touching nothing, and it may be anywhere."""
    changes = (("figures = true", "figures = false\nreport = false"),)
    keys = {"parameter": '"amplitude"', "range": '["1 um", "0.21 mm"]', "switch": '["grazing"]'}
    (tmp_path / "study.toml").write_text(study_text(changes, **keys), encoding="utf-8")
    printed = femimpact("orbits", "study.toml", cwd=tmp_path).stdout
    (note,) = fi.load(tmp_path / "study-orbits").summary["notes"]
    assert note.startswith("not followed from grazing of branch 1 at 1.08")
    assert "must leave ball a contact" in note
    assert f"note: {note}" in " ".join(printed.split())


@pytest.mark.skipif(os.name != "posix", reason="kills a child process")
def test_a_killed_process_leaves_no_file_of_results(tmp_path):
    (tmp_path / "study.toml").write_text(study_text(), encoding="utf-8")
    command = [sys.executable, "-m", "femimpact", "orbits", "study.toml", "-o", "out", "-q"]
    child = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    for _ in range(1200):
        if (tmp_path / "out.part").exists() or child.poll() is not None:
            break
        time.sleep(0.05)
    child.send_signal(signal.SIGKILL)
    child.communicate(timeout=60)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.part", "study.toml"]
    with pytest.raises(fi.InputError, match="a run was ended before its first part was finished: run it again"):
        fi.load(tmp_path / "out")


# ---- what would run, and what is refused ------------------------------------------------------------


def test_a_new_study_names_every_key_of_the_table():
    shown = paper_study_text().partition("# [orbits]")[2].partition("# [study]")[0]
    assert set(re.findall(r"^# (\w+) = ", shown, re.MULTILINE)) == {key.name for key in fields(OrbitsPlan)}


def test_check_says_what_would_run(tmp_path):
    (tmp_path / "study.toml").write_text(study_text(range='["4.9 Hz", "0.0056 kHz"]'), encoding="utf-8")
    lines = [
        line for line in femimpact("check", "--all", "study.toml", cwd=tmp_path).stdout.splitlines() if "orbits" in line
    ]
    assert "orbits.range = 0.0056 kHz: 5.6 Hz" in lines
    words = ("a run of 80 s", "base.frequency from 4.9 to 5.6 Hz", "at symmetry-breaking the others too")
    assert all(any(text in line for line in lines) for text in words)


REST = (
    (
        "amplitude = 0.2037e-3       # m\nfrequency = 5.3             # Hz, of the simulated history\n",
        'kind = "rest"\n',
    ),
    ("duration = 120.0 ", "history = 120.0 "),
    ('start = "base" ', 'initial = "base" '),
)
FORCE = '\n[[force]]\nkind = "sine"\nat = "tip"\nforce = "20 mN"\nfrequency = 5.3\n'


def test_the_amplitude_of_a_force_is_in_newtons():
    text = without_sweep(study_text(REST, parameter='"amplitude"', range='["10 mN", "50 mN"]')) + FORCE
    assert read_study(text, Path("study.toml")).orbits.range == pytest.approx((0.01, 0.05), rel=1e-15)


@pytest.mark.parametrize(
    ("orbits", "words"),
    [
        ({"parametr": "1"}, "orbits.parametr: unknown; did you mean 'parameter'"),
        ({"range": "[5.6, 4.9]"}, "orbits.range = (5.6, 4.9): must be two finite numbers, the lowest and the highest"),
        ({"range": "[4.9, nan]"}, "orbits.range = [4.9, nan]: must be two finite numbers"),
        ({"range": "5.3"}, "orbits.range = 5.3: must be two finite numbers"),
        ({"range": "[5.0, 5.2]"}, "orbits.range = (5.0, 5.2) Hz: must have the study's base.frequency = 5.3 Hz in it"),
        ({"range": "[-1.0, 5.6]"}, "orbits.range = -1.0 Hz: must be a finite number > 0 Hz"),
        ({"range": '["4.9 mm", 5.6]'}, "orbits.range = '4.9 mm': must have a unit that fits: Hz"),
        ({"parameter": '"impactor.bal.gap"'}, "orbits.parameter = 'impactor.bal.gap': unknown; did you mean"),
        ({"parameter": '"beam.thickness"'}, "orbits.parameter = 'beam.thickness': changes the modes"),
        ({"guess_duration": "-1"}, "orbits.guess_duration = -1 s: must be a finite number > 0 s"),
        ({"guess_duration": "1e12"}, "orbits.guess_duration = 1000000000000.0 s: must be shorter: the run keeps"),
        ({"guess_duration": "1e-6"}, "orbits.guess_duration = 1e-06 s: must be >= one reading of the run"),
        (
            {"parameter": '"damping.factor"', "range": "[0.2, 0.9]"},
            "orbits.range = (0.2, 0.9): must have the study's damping.factor = 1 in it",
        ),
        ({"switch": '["grazing", "grazing"]'}, "orbits.switch = ('grazing', 'grazing'): must have each kind once"),
        ({"guess_duration": None}, "orbits.guess_duration: is missing"),
        ({"most_branches": "0"}, "orbits.most_branches = 0: must be a whole number >= 1"),
        ({"points": "1"}, "orbits.points = 1: must be a whole number >= 2"),
        ({"cycles": "0"}, "orbits.cycles = 0: must be a whole number >= 1"),
        ({"switch": '["fold"]'}, "orbits.switch = 'fold': has no other orbits to switch to: both sheets are in the"),
        ({"switch": '["grazin"]'}, "orbits.switch = 'grazin': unknown; did you mean 'grazing'"),
        ({"switch": '"grazing"'}, "orbits.switch = 'grazing': must be a list of"),
    ],
)
def test_bad_keys_are_one_line_of_check_and_of_the_command(tmp_path, orbits, words):
    (tmp_path / "study.toml").write_text(study_text(**orbits), encoding="utf-8")
    assert_refused(tmp_path, words)


def assert_refused(folder, words):
    for command in ("check", "orbits"):
        refused = femimpact(command, "study.toml", cwd=folder, check=False)
        assert refused.returncode == 2
        assert words in refused.stderr
        assert len(refused.stderr.splitlines()) == 1
    assert [path.name for path in folder.iterdir()] == ["study.toml"]


KELVIN_VOIGT = ('law = "rigid", restitution = 0.6', 'law = "kelvin-voigt", restitution = 0.78, contact_time = 2e-3')


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            study_text((KELVIN_VOIGT, ('name = "event-driven"', 'name = "newmark"'))),
            "method.name = 'newmark': must be 'event-driven' for [orbits]",
        ),
        (study_text((("[reduction]\nmodes = 4 ", "# "),)), "in a study file add [reduction] modes = n"),
        (without_sweep(study_text()) + FORCE, "orbits = 'base at 5.3 Hz, force at tip, 5.3 Hz': needs one sine"),
        (
            without_sweep(study_text(REST)) + 2 * FORCE,
            "needs one sine, of the base or of a force beside a base at rest",
        ),
    ],
)
def test_a_study_without_periodic_orbits_to_follow_is_one_line(tmp_path, text, words):
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert_refused(tmp_path, words)


def test_a_study_without_the_table_is_one_line(tmp_path):
    text = study_text().partition("[orbits]")[0]
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    refused = femimpact("orbits", "study.toml", cwd=tmp_path, check=False)
    assert (refused.returncode, refused.stderr) == (2, "femimpact: orbits: table [orbits] is missing from the study\n")


def test_a_ball_that_touches_nothing_is_one_line_with_a_key_of_the_study(tmp_path):
    text = study_text((("amplitude = 0.2037e-3", "amplitude = 0.2037e-6"),))
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    refused = femimpact("orbits", "study.toml", "-q", cwd=tmp_path, check=False)
    words = "orbits.guess_duration = 'ball: no contact in a period': must touch a wall: else it may be anywhere"
    assert (refused.returncode, refused.stderr) == (2, f"femimpact: {words}\n")


def test_a_sweep_that_does_not_fit_is_one_line(tmp_path):
    text = study_text((("[output]", "[output]\nmemory_limit = 3e7"), ("points = 15 ", "points = 100000 ")))
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    # four times the limit, on one core too
    assert_refused(tmp_path, "output.memory_limit = 30000000.0 bytes: must be >=")


def test_a_motion_that_has_not_settled_is_one_line_with_what_to_try(tmp_path):
    """After 1.5 s the first mode has lost 13 % of its transient: the five cycles before are far from any orbit."""
    (tmp_path / "study.toml").write_text(study_text(guess_duration="1.5", cycles="5"), encoding="utf-8")
    ended = femimpact("orbits", "study.toml", "-q", cwd=tmp_path, check=False)
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1
    assert "femimpact: orbits: after 1.5 s, no periodic orbit found" in ended.stderr
    assert "a longer orbits.guess_duration" in ended.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]
