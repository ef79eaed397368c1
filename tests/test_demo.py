"""The demo on a shortened study: the published figures beside ours, and results that can be run again."""

from __future__ import annotations

import dataclasses
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from builders import done, read_csv

import femimpact as fi
from femimpact.app import demo
from femimpact.app.report.pictures import draw_again
from femimpact.app.results.picture_data import RANGES, read_results
from femimpact.app.results.result_directory import result_files
from femimpact.app.study.findings import Spread
from femimpact.app.study.summary import spread_of
from femimpact.cli import print_results

PAGE = Path(__file__).parent.parent / "docs" / "paper" / "paper.md"
EXACT = {
    "first frequency, without ball",
    "first frequency, ball glued on",
    "damping, without ball",
    "damping, without ball, by half-power",
    "largest motion of the tip, without",
}
RANGE = r"[\d.]+( mm| Hz| %| N| mN s)? \([\d.]+ to [\d.]+\)"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    study = demo.paper_study()
    short = dataclasses.replace(
        study,
        sweep=dataclasses.replace(study.sweep, cycles=400, refine=8),
        duration=8.0,
        output=dataclasses.replace(study.output, frames=0, paraview=False, movie=False),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "paper_study", lambda: short)
        plan = demo.ScanPlan((0.6, 0.78), points=21, cycles=120, starts=2)
        return done(demo.task_of_demo(plan), tmp_path_factory.mktemp("demo") / "out")


@pytest.fixture(scope="module")
def comparison(results):
    """Rows of the table with the published figures."""
    return list(zip(*read_csv(results.directory / "comparison.csv").values(), strict=True))


@pytest.mark.impacts
def test_published_figures_stand_beside_ours(comparison):
    rows = {row[0]: row for row in comparison}
    _, theory, experiment, here, there, method = rows["first frequency, without ball"]
    assert (theory, experiment, method) == ("5.30 Hz", "5.05 Hz", "eigenvalue")
    assert here == there == "5.300 Hz"
    assert rows["first frequency, ball glued on"][3] == "4.980 Hz"
    # the input ratio found again; a transient of exp(-0.0029 x 2 pi x 267) = 0.8 % is left in the window
    assert float(rows["damping, without ball"][3].removesuffix(" %")) == pytest.approx(0.29, rel=0.03)
    assert rows["ratio without / with"][1:3] == ("about 5", "about 5")
    assert {"contact force, mean of a cycle", "contact force, largest", "mean impulse"} <= set(rows)
    # every number names its method, and one name never has two numbers
    assert all(row[5] for row in comparison)
    assert len(rows) == len(comparison)


@pytest.mark.impacts
def test_a_chaotic_peak_has_no_fitted_damping(results, comparison):
    # only the drop of the peak is called a damping of the ball
    assert [row[0] for row in comparison if "damping with ball" in row[0]] == ["damping with ball (0.29 % x ratio)"]
    ball = results.summary["sweep"]["ball"]
    assert ball["damping_fit"] is None
    assert ball["damping_half_power"] is None
    assert any("does not repeat" in text for text in ball["warnings"])
    assert results.summary["sweep"]["empty"]["damping_fit"] == pytest.approx(0.0029, rel=0.03)


@pytest.mark.impacts
def test_what_is_chaotic_is_a_median_within_its_range(results, comparison):
    # one run is a sample: the demo's own numbers are those of several starts
    for start in ("base", "space"):
        for name, spread in results.summary["starts"][start].items():
            assert 0.0 < spread["lowest"] <= spread["median"] <= spread["highest"], (start, name)
    chaotic = [row[3:5] for row in comparison if row[0] not in EXACT]
    assert len(chaotic) == 6
    assert all(re.fullmatch(rf"{RANGE}( at {RANGE})?", cell) for pair in chaotic for cell in pair)
    scan, starts = read_csv(results.directory / "restitution.csv"), ("base", "space")
    np.testing.assert_array_equal(scan["restitution"], [0.6, 0.78])
    for name in (f"{start}_{name}" for start in starts for name in ("peak_frequency", "amplitude_ratio")):
        assert np.all(scan[f"{name}_low"] <= scan[name]), name
        assert np.all(scan[name] <= scan[f"{name}_high"]), name
    assert {scan[f"{start}_starts"][i] for start in starts for i in (0, 1)} == {2}


@pytest.mark.impacts
def test_the_restitution_is_the_studys_and_its_neighbours_are_named(results):
    assert results.summary["restitution"] == pytest.approx(0.78, rel=1e-12)
    assert "near the published resonance" in results.summary["remarks"][0]


@pytest.mark.impacts
def test_the_table_of_the_page_on_the_paper_has_the_rows_of_the_demo(comparison):
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    rows = [row for row in rows if len(row) == len(comparison[0])]
    for name, theory, experiment, here, there, method in comparison:
        (row,) = [row for row in rows if row[0] == name]
        assert [*row[1:3], row[5]] == [theory, experiment, method]
        if name.startswith("first frequency"):
            assert row[3:5] == [here, there]


@pytest.mark.impacts
def test_the_answer_is_the_start_at_rest_relative_to_the_base(results, comparison, capsys):
    print_results(results.directory)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == (
        "A cantilever on a shaker (0.2037 mm); in a box at its tip a loose ball of 3.43 g, 4 mm from each wall."
    )
    # what stands in the table of the report, for that start
    for line, (name, theory, _, here, *_) in zip(lines[3:12], comparison, strict=False):
        assert (line[:37].rstrip(), line[37:47].rstrip(), line[47:]) == (name, theory or "-", here)
    parts = {2: "half", 3: "a third", 4: "a quarter", 5: "a fifth"}
    starts, words = results.summary["starts"], " ".join(" ".join(lines[13:17]).split())
    ratio, there = (starts[start]["amplitude_ratio"] for start in ("base", "space"))
    assert f"At rest in space the ratio is {Spread(**there).text(digits=3)} at " in words
    assert words.startswith(f"The ball lowers the largest motion of the tip to {parts[round(ratio['median'])]}.")
    share = results.summary["sweep"]["empty"]["peak_amplitude"] / 0.23026615
    assert f"{share:.2g} of the length" in words
    assert f"some {100 * share**2:.2g} % off" in words
    assert len(lines) == 20
    # files that are there
    _, first, *others = lines[-2].replace(",", "").split()
    assert Path(first) == results.directory / "report.html"
    assert others == []
    for command in lines[-1].removeprefix("Next:    ").split("; "):
        assert command.startswith("femimpact ")


def test_quiet_leaves_warnings_alone(results, capsys):
    print_results(results.directory, quiet=True)
    said = capsys.readouterr()
    assert said.out == ""
    assert "beyond 0.1" in said.err


@pytest.mark.parametrize(
    ("values", "resolution", "text"),
    [
        ([4.03, 4.07, 4.12], 0.0, "4.070 (4.007 to 4.143)"),
        ([9.24, 10.3, 10.97], 0.0, "10.30 (8.80 to 11.41)"),
        ([4.9, 4.9, 4.9], 0.05, "4.90 (4.85 to 4.95)"),
        ([5.2, 5.45, 5.55], 0.05, "5.45 (5.06 to 5.69)"),
        ([0.0183, 0.0186, 0.0192], 0.0, "0.01860 (0.01807 to 0.01943)"),
        ([2.0, 2.0], 0.0, "2.000 (2.000 to 2.000)"),
        ([0.0, 0.0], 0.0, "0"),
        ([120.0, 250.0, 260.0], 0.0, "250 (85 to 295)"),
        ([0.1, 2.0, 9.9], 0.0, "2.0 (0.0 to 12.4)"),
    ],
)
def test_a_spread_is_rounded_to_what_its_range_allows(values, resolution, text):
    assert spread_of(values, resolution).text() == text


def test_the_study_that_is_left_behind_is_the_one_that_was_run(results):
    study = fi.load_study(results.directory / "study.toml")
    assert study.structure.impactors[0].contact.restitution == pytest.approx(results.summary["restitution"])
    assert study.base.frequency == pytest.approx(results.summary["history"]["frequency"], rel=1e-6)


@pytest.mark.impacts
def test_both_starts_are_in_the_tables(results):
    folder = results.directory
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
    assert {"comparison.csv", "restitution.csv", "sweep.csv"} <= names
    assert {"figures/restitution.png", "figures/curves_of_starts.png"} <= names
    # all of them are known as results: --force replaces them
    assert set(result_files(folder)) == {name for name in names if (folder / name).is_file()}


def test_figures_are_drawn_again_from_the_tables_of_the_demo(results, tmp_path):
    folder = Path(shutil.copytree(results.directory, tmp_path / "out"))
    names = {f"figures/{stem}.png": (folder / f"figures/{stem}.png").read_bytes() for stem in RANGES}
    for name in names:
        (folder / name).unlink()
    drawn = draw_again(folder, "figures", lambda _what, _share: None)
    assert names.keys() <= set(drawn)
    assert all((folder / name).read_bytes() == picture for name, picture in names.items())
    # of the table with other numbers there is another picture
    table = folder / "restitution.csv"
    table.write_text(table.read_text().replace("\n0.6,", "\n0.5,"))
    draw_again(folder, "figures", lambda _what, _share: None)
    assert (folder / "figures/restitution.png").read_bytes() != names["figures/restitution.png"]


def test_ranges_over_starts_are_read_by_frame(results):
    reading = read_results(results.directory)
    curves, scan = reading.ranges
    for ranges, name in ((curves, "curves_of_starts.csv"), (scan, "restitution.csv")):
        table = read_csv(results.directory / name)
        assert list(ranges.frames) == ["base", "space"]
        for start, data in ranges.frames.items():
            for measure in list(RANGES[ranges.key])[1:]:
                np.testing.assert_array_equal(data[measure], table[f"{start}_{measure}"])
    assert scan.frames["base"]["peak_frequency"].attrs["units"] == "Hz"
    # the picture of the response has the range of the frame in which its curve starts
    ((words, _, _, high),) = reading.curves.bands
    assert words.endswith("at rest relative to the base")
    np.testing.assert_array_equal(high, curves.frames["base"]["peak_high"])


def test_a_free_directory_is_chosen_when_the_usual_one_is_taken(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert demo.free_directory("femimpact-demo").name == "femimpact-demo"
    (tmp_path / "femimpact-demo").mkdir()
    assert demo.free_directory("femimpact-demo").name == "femimpact-demo-2"


@pytest.mark.parametrize("scale", [1.0, 1e3, 1e-4])
def test_a_range_in_words_holds_all_starts_and_its_ends_and_median_can_be_read(scale):
    rng = np.random.default_rng(0)
    for width in 10.0 ** rng.uniform(-7.0, 3.0, 500):
        middle = 10.0 ** rng.uniform(-3.0, 4.0)
        values = middle + width * np.sort(rng.uniform(-0.5, 0.5, 3))
        spread = spread_of(values)
        texts = re.fullmatch(r"(\S+) \((\S+) to (\S+)\)", spread.text(scale)).groups()
        median, low, high = map(float, texts)
        lowest, true, highest = (scale * value for value in (spread.lowest, spread.median, spread.highest))
        tiny = 1e-6 * (high - low)
        assert low - tiny <= lowest, texts
        assert highest <= high + tiny, texts
        assert low <= median <= high, texts
        assert low < high, texts
        # two digits of half the range or four of the largest number, and two of the median whatever the range
        unit = max((highest - lowest) / 20.0, 1.1e-3 * max(abs(low), abs(high)))
        assert abs(median - true) <= min(unit, 0.1 * abs(true)) * 0.5001 + 1e-12 * abs(true), texts
        assert all(len(text.lstrip("-0.").replace(".", "").rstrip("0")) <= 4 for text in texts), texts
