"""The report that a parameter study leaves: its numbers, its maps, and what is missing of a damaged or ended study."""

from __future__ import annotations

import re
import shutil
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray
from builders import (
    ResultFileWarning,
    build,
    paper_study,
    paper_study_text,
    read_study,
    study_conclusions,
    with_ball,
    write_parameter_study,
    write_report,
)
from test_markup import Parsed
from test_report import fetched, section, text_of

import femimpact as fi
from femimpact.app.parametric.best import best_cases
from femimpact.app.report.result_conclusions import study_lead
from femimpact.app.report.structure_drawing import gap_words
from femimpact.app.tasks.study_command import plan_of_cases
from femimpact.figures.study_labels import measure_names, path_words, unsure_cells
from femimpact.units import counted, name_words

pytestmark = pytest.mark.impacts

TABLE = (
    '[study]\nmeasures = ["peak", "impacts_per_cycle"]\nstarts = 5\ncycles = 9\n[study.axes]\n'
    '"impactor.ball.gap" = [0.002, 0.004, 0.006]\n"impactor.ball.contact.restitution" = [0.5, 0.7]\n'
)


def study(table=TABLE, **output):
    """The paper's case on three modes, event-driven, with a parameter study and without figures."""
    text = paper_study_text().replace('name = "newmark"', 'name = "event-driven"') + table
    given = read_study(text, Path("study.toml"))
    smaller = replace(given, mesh=replace(given.mesh, elements=6), reduction=replace(given.reduction, modes=3))
    return replace(smaller, output=replace(given.output, figures=False, **output), text="")


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    out = tmp_path_factory.mktemp("studied") / "out"
    write_parameter_study(study(), out)
    return out


@pytest.fixture
def results(sound, tmp_path):
    return shutil.copytree(sound, tmp_path / "out")


def test_check_foretells_the_disk_that_a_study_takes_within_a_factor_of_two(sound):
    taken = sum(path.stat().st_size for path in sound.rglob("*") if path.is_file())
    told = re.search(r"and ([\d.e+]+) MB on disk", plan_of_cases(study()).costs[1])
    assert taken / 2 < 1e6 * float(told[1]) < 2 * taken


def missing_of(directory):
    """What a report says is missing."""
    text = text_of(directory)
    start = text.index("What is missing")
    return Parsed(text[start : text.index("</ul>", start)]).text


def test_a_study_leaves_one_page_with_its_smallest_and_largest_values(sound):
    text = text_of(sound)
    page = Parsed(text)
    assert not fetched(page)
    with xarray.open_dataset(sound / "study.nc") as data:
        peak = 1e3 * data["peak"].to_numpy()
        low, high = (1e3 * data[f"peak_{end}"].to_numpy().flat[peak.argmin()] for end in ("low", "high"))
    found = Parsed(section(text, "conclusions")).text
    for value in (peak.min(), peak.max(), low, high):
        assert f"{value:.4g}" in found
    # the page has the structure, a map of either measure, and every case
    assert "230.3 mm" in Parsed(section(text, "structure")).text
    assert section(text, "study").count('class="picture"') == 2
    assert section(text, "cases").count("<tr>") == 1 + 6
    assert "0, of the 5 starts" in Parsed(section(text, "versions")).text
    assert "What is missing" not in text


def test_the_report_of_a_study_can_be_made_again_with_the_same_bytes(results):
    before = {path.name: path.read_bytes() for path in results.iterdir() if path.is_file()}
    write_report(results)
    assert {path.name: path.read_bytes() for path in results.iterdir() if path.is_file()} == before


def test_without_report_a_study_leaves_none(tmp_path):
    write_parameter_study(study(TABLE.replace("starts = 5", "starts = 1"), report=False), tmp_path)
    assert (tmp_path / "study.nc").exists()
    assert not (tmp_path / "report.html").exists()


def test_a_report_that_fails_is_a_warning_and_the_study_stands(tmp_path, monkeypatch):
    def fails(*_):
        raise RuntimeError("no page")

    monkeypatch.setattr("femimpact.app.report.result_page.page_of", fails)
    with pytest.warns(ResultFileWarning, match=r"report not written: no page; 'femimpact report"):
        data = write_parameter_study(study(TABLE.replace("starts = 5", "starts = 1")), tmp_path)
    with xarray.open_dataset(tmp_path / "study.nc") as again:
        np.testing.assert_array_equal(again["peak"], data["peak"])


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(path.read_bytes()[:5000]),
        lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\nnothing"),
        lambda path: path.write_bytes(b""),
        lambda path: xarray.Dataset({"a": ("x", [1.0, 2.0])}).to_netcdf(path, engine="h5netcdf"),
    ],
    ids=["cut", "nonsense", "empty", "of another kind"],
)
def test_a_damaged_dataset_is_named_and_the_table_of_cases_stands(results, damage):
    damage(results / "study.nc")
    write_report(results)
    assert "study.nc" in missing_of(results)
    assert section(text_of(results), "cases").count("<tr>") == 1 + 6


def test_a_dataset_with_cases_that_are_not_finished_says_how_many(results):
    data = xarray.load_dataset(results / "study.nc", engine="h5netcdf")
    data["finished"][0, :] = 0
    for name in measure_names(data):
        data[name][0, :] = np.nan
    data.to_netcdf(results / "study.nc", engine="h5netcdf")
    write_report(results)
    assert "2 of 6 cases: the study was not finished" in missing_of(results)


def test_a_study_that_was_ended_has_a_report_that_says_so(results):
    for path in results.iterdir():
        if path.is_file():
            path.unlink()
    write_report(results)
    assert "study.nc: the parameter study was not finished" in missing_of(results)
    assert "blocks/" in section(text_of(results), "files")
    # the report does not keep the same study from going on
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_parameter_study(study(), results)
    assert "What is missing" not in text_of(results)


def test_every_file_beside_the_page_is_in_one_group(sound):
    part = section(text_of(sound), "files")
    linked = re.findall(r'<a href="([^"]+)"', part)
    assert len(linked) == len(set(linked))
    present = {path.name + "/" * path.is_dir() for path in sound.iterdir() if not path.name.startswith(".")}
    assert set(linked) == present
    counts = re.findall(r"<summary>([^:<]+): (\d+) files?</summary>", part)
    assert sum(int(count) for _, count in counts) == len(linked)
    assert {group for group, _ in counts} <= {"Numbers and study", "Pictures and movie", "ParaView"}


def test_a_case_that_fails_is_a_warning_of_the_report(results):
    data = xarray.load_dataset(results / "study.nc", engine="h5netcdf")
    data["failed_starts"][0, 0] = 5
    data["failure"] = data["failure"].astype(object)
    data["failure"][0, 0] = "<b>too soft</b>"
    data.to_netcdf(results / "study.nc", engine="h5netcdf")
    write_report(results)
    text = text_of(results)
    assert "1 of 6 cases have starts that failed, the first: <b>too soft</b>" in Parsed(text).text
    assert "<b>too soft" not in text


def test_the_cells_that_the_starts_cannot_tell_apart_have_a_mark(sound, tmp_path):
    data = xarray.load_dataset(sound / "study.nc", engine="h5netcdf")
    # made by hand: the first row apart from the rest, with narrow intervals; the others alike, with wide ones
    data["peak"][:] = [[9.0, 8.0], [1.0, 1.01], [1.0, 1.01]]
    data["peak_median_low"][:], data["peak_median_high"][:] = data["peak"] - 0.1, data["peak"] + 0.1
    unsure = unsure_cells(data, "peak")
    np.testing.assert_array_equal(unsure, [[False, False], [False, False], [True, True]])
    fi.report(tmp_path / "page.html", {"Study": data[["peak", "peak_median_low", "peak_median_high"]]})
    markup = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "starts differ by more than neighbouring cells do" in markup


def test_starts_are_a_band_around_their_median_and_a_sample_is_dots_over_each_axis(tmp_path):
    system = fi.reduce(
        fi.assemble(with_ball(paper_study().structure, contact=fi.Rigid(0.6)), elements=6), modes=3
    )  # fmt: skip
    given = {"excitation": fi.Sine(0.2e-3, 5.0), "cycles": 9}
    axes = {"base.frequency": [4.8, 5.0, 5.2]}
    lines = fi.parameter_study(system, axes, ["peak"], starts=5, **given)
    cases = [{"base.frequency": 4.8, "impactor.ball.gap": 2e-3}, {"base.frequency": 5.2, "impactor.ball.gap": 4e-3}]
    dots = fi.parameter_study(system, cases, ["peak"], **given)
    fi.report(tmp_path / "page.html", {"Lines": lines, "Dots": dots})
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    # one picture of the measure, not one of each statistic and count
    for part in ("part-1", "part-2"):
        assert section(text, part).count('class="picture"') == 1
    assert "smallest to largest of the starts" in section(text, "part-1")
    assert all(f"{axis}" in section(text, "part-2") for axis in ("frequency", "gap of ball (mm)"))


# ---- the head of the page -------------------------------------------------------------------------


def test_title_author_and_date_stand_at_the_head_and_the_same_study_goes_on(results):
    def written():
        blocks = [path for path in (results / "blocks").rglob("*") if path.is_file() and path.name != "study.json"]
        return {path: path.stat().st_mtime_ns for path in blocks}

    blocks = written()
    assert blocks
    words = {"title": "Damper of arm <3>", "author": "A. Author & B. Author", "date": "24 November 2026"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_parameter_study(study(**words), results)
    assert written() == blocks
    text = text_of(results)
    head = Parsed(text[: text.index("<main")]).text
    for word in words.values():
        assert word in head
    assert "230.3 mm" in head
    # the study file of the results gives the page again
    before = text
    write_report(results)
    assert text_of(results) == before


def test_a_report_has_no_date_of_its_own(sound):
    assert 'class="by"' not in text_of(sound)


def test_a_date_that_is_no_text_is_one_line():
    with pytest.raises(fi.InputError, match=r"output\.date.*must be a text"):
        read_study(paper_study_text().replace("[output]", "[output]\ndate = 2026-11-24", 1), Path("study.toml"))


# ---- studies without a best case ------------------------------------------------------------------


def curve_study(**axes):
    """A dataset as of a study whose peak is smallest beside its resonance at 5 Hz."""
    frequency = np.array(axes["base.frequency"])
    about = {"units": "m", "better": "small"}
    coords = {name: ("case", np.array(values)) for name, values in axes.items()} if len(axes) > 1 else axes
    dims = ("case",) if len(axes) > 1 else ("base.frequency",)
    whole = np.ones(frequency.shape, dtype=int)
    return xarray.Dataset(
        {
            "peak": (dims, 1e-3 / (0.01 + np.abs(frequency - 5.0)), about), "finished": (dims, whole),
            "failed_starts": (dims, 0 * whole), "periodic_starts": (dims, whole),
        },
        coords, {"starts": 1, "place": "the tip"},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("axes", "reason"),
    [
        ({"base.frequency": [4.8, 5.0, 5.8]}, "all axes that have several values are of the excitation"),
        ({"base.frequency": [4.8, 5.0, 5.8], "impactor.ball.gap": [1e-3, 2e-3, 3e-3]}, "study a grid, or a list"),
    ],
    ids=["excitation alone", "a sample in which none agree"],
)
def test_a_study_without_a_best_case_shows_the_resonance_and_says_why(axes, reason):
    data = curve_study(**axes)
    best, reasons = best_cases(data, None)
    assert not best
    shown = study_conclusions(data, best, reasons)[0]
    assert (shown.label, float(shown.value)) == ("Largest peak", pytest.approx(100.0))
    assert reason in shown.note
    assert "5.8" not in shown.note


def test_a_script_that_gives_the_dataset_has_what_the_page_of_the_study_holds(sound, tmp_path):
    data = xarray.load_dataset(sound / "study.nc", engine="h5netcdf")
    fi.report(tmp_path / "page.html", {"Study": data})
    script, own = (path.read_text(encoding="utf-8") for path in (tmp_path / "page.html", sound / "report.html"))
    # the study file of the best case lies beside a study's own page alone
    beside = Parsed(section(own, "conclusions")).text.partition("Notes'femimpact run best.toml'")[0]
    assert Parsed(section(script, "conclusions")).text.partition("Notes")[0] == beside
    for lead in study_lead(data):
        assert lead in Parsed(script).text
    for words in ("A row for each case", "peak (mm)", "gap of ball (mm)", "0, of the 5 starts"):
        assert words in Parsed(script).text.replace("\u00a0", " ")
    assert section(script, "part-1").count("picture") == section(own, "study").count("picture")
    # numbers of one quantity have one unit in cards, maps and tables; the files stay in SI
    assert "(m)" not in Parsed(own).text.replace("\u00a0", " ")
    assert "peak [m]" in (sound / "study.csv").read_text()


def test_parts_of_a_study_make_a_report_too(sound, tmp_path):
    data = xarray.load_dataset(sound / "study.nc", engine="h5netcdf")
    for i, part in enumerate((data.isel({data["peak"].dims[0]: 0}), data[["peak"]], data.drop_attrs())):
        assert fi.report(tmp_path / f"{i}.html", {"Study": part}).exists()


def test_a_study_begins_with_its_drive_and_with_what_the_best_case_is_worth(tmp_path):
    given = study(
        '[study]\nmeasures = ["peak", "root.surface_stress"]\ncycles = 60\n[study.axes]\n'
        '"impactor.ball.gap" = [0.002, 0.004]\n"base.frequency" = [5.2, 5.3, 5.4]\n'
        '[study.best]\nmeasure = "peak"\nlimits = { "root.surface_stress" = 200e6 }\n'
    )
    data = write_parameter_study(given, tmp_path)
    text = text_of(tmp_path)
    head = Parsed(text[: text.index("<main")]).text
    assert head.index("Drive: a sine of the base, amplitude 0.2037 mm") < head.index("Parameter study: 6 cases")
    assert "The worst counts over frequency of base." in head
    worst = float(data["peak"].max("base.frequency").min())
    bare = fi.without_impactors(build(given)[1])
    # the resonance lies between two frequencies of the axis: a long dwell there
    first = bare.first_frequency
    empty = fi.frequency_sweep(bare, 0.2037e-3, [first], fi.EventDriven(), cycles=3000)
    answer = re.search(
        r"Best case: gap of ball [24] mm; its worst peak over frequency of base is .*?, (\S+) times less", head
    )
    told = re.search(r"largest steady peak from 5.2 to 5.4 Hz is ([\d.]+) mm, at 5.3 Hz", head)
    assert float(told[1]) == pytest.approx(1e3 * empty.peak_amplitude, rel=1e-3)
    assert float(answer[1]) == pytest.approx(empty.peak_amplitude / worst, rel=1e-2)
    # one map or line of the worst, and how much of the limit the stress uses
    assert section(text, "best").count('class="picture"') == 1
    used = re.search(r"root.surface_stress ([\d.]+) MPa, limit 200 MPa, ([\d.]+) % of it", Parsed(text).text)
    assert float(used[2]) == pytest.approx(float(used[1]) / 2.0, rel=1e-2)
    # on the sheet too, where the other details of the best case are left out
    sheet = Parsed(write_report(tmp_path, tmp_path / "sheet.html", True).read_text(encoding="utf-8")).text
    assert used[0] in sheet
    assert "worst at" in sheet
    # one of two gaps is at an end of its axis, and a better one may lie beyond
    assert re.search(r"more was not run; it is the highest value of the axis|it is the lowest value of the axis", sheet)
    # the last line: version, core, command and key
    foot = Parsed(text[text.index("<footer") : text.index("</footer")]).text
    assert re.match(rf"femimpact {re.escape(fi.__version__)} · core \w{{12}} · femimpact study .*key \w{{12}}", foot)


def test_nothing_is_said_of_a_beam_without_balls_where_the_axes_vary_the_beam(tmp_path):
    given = study(
        '[study]\nmeasures = ["peak"]\ncycles = 30\n[study.axes]\n"beam.thickness" = [0.001, 0.0011]\n'
        '"base.frequency" = [5.2, 5.3]\n'
    )
    write_parameter_study(given, tmp_path)
    assert "Without ball" not in Parsed(text_of(tmp_path)).text


def test_words_of_a_report_are_words():
    assert path_words("impactor.ball.at") == "place of ball"
    assert name_words("root.surface_stress") == "root surface stress"
    assert name_words("0.12.absolute_acceleration") == "0.12 absolute acceleration"
    assert (counted(1, "mode"), counted(3, "mode")) == ("1 mode", "3 modes")
    ball = fi.Impactor("ball", at="root", mass=5e-3, gap=(50e-3, 0.0), contact=fi.Rigid(0.5))
    assert gap_words(ball) == "gaps +50 mm, \N{MINUS SIGN}0 mm"


def test_the_largest_of_a_largest_value_is_said_once():
    values = xarray.DataArray([0.1, 0.3], dims="impactor.ball.at", attrs={"units": "m/s", "better": "small"})
    place = xarray.DataArray([0.1, 0.2], dims="impactor.ball.at", attrs={"units": "m"})
    data = xarray.Dataset({"largest_approach_speed": values}, coords={"impactor.ball.at": place}, attrs={"starts": 1})
    data["finished"] = ("impactor.ball.at", [1, 1])
    data["periodic_starts"] = data["failed_starts"] = 0 * data["finished"]
    (one,) = study_conclusions(data, {}, {"largest_approach_speed": "no two designs agree"})
    assert one.label == "Largest approach speed"
    assert one.note.startswith("at place of ball 200 mm; no best case: no two designs agree; ")
