"""What README shows runs as it stands."""

from __future__ import annotations

import contextlib
import re
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from builders import read_study

import femimpact as fi
from femimpact.app.demo import paper_study_text

ROOT = Path(__file__).parent.parent
PARTS = ("development", "howto", "paper", "reference", "theory")
PAGES = [
    Path("README.md"),
    Path("CONTRIBUTING.md"),
    *sorted(path.relative_to(ROOT) for path in (ROOT / "docs").glob("*.md")),
    *sorted(path.relative_to(ROOT) for folder in PARTS for path in (ROOT / "docs" / folder).glob("*.md")),
]
WRITTEN_BY_BUILD = {"api", "gallery"}
LINKS = [
    (page, link)
    for page in PAGES
    for link in sorted(set(re.findall(r"\]\(((?!http)[^)]+)\)", (ROOT / page).read_text(encoding="utf-8"))))
    if not WRITTEN_BY_BUILD & set(Path(link).parts)
]


PICTURES = runpy.run_path(str(ROOT / "docs" / "pictures" / "make_pictures.py"))


def ran(*pages):
    """Names that a page's script leaves, and those of pages that go on from it."""
    return PICTURES["ran"](*(ROOT / page for page in pages))


GOING_ON = (
    "figures", "tapered_beams", "own_law", "own_terms", "moments_and_reactions", "own_channel", "own_excitation",
    "several_drives", "own_method",
)  # fmt: skip
"""Pages whose scripts go on from the one on scripting, each from it alone."""


@pytest.fixture
def drawn_off_screen():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def root_stress(tmp_path_factory):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    # among the requirements of the site alone
    pytest.importorskip("rainflow")
    with contextlib.chdir(tmp_path_factory.mktemp("root_stress")):
        names = ran("docs/howto/root_stress.md")
        names["folder"] = Path.cwd()
    pyplot.close("all")
    return names


@pytest.mark.impacts
def test_the_page_on_thick_beams_prints_what_it_shows(capsys):
    with warnings.catch_warnings():
        ran("docs/howto/thick_beams.md")
    *lines, with_ball = capsys.readouterr().out.splitlines()
    page = (ROOT / "docs/howto/thick_beams.md").read_text(encoding="utf-8")
    assert "```text\n" + "\n".join(lines) in page
    # the motion with the ball may be another sample: it is far below that without
    without, kept = (float(re.search(r"tip (\d+) um", line)[1]) for line in (lines[-1], with_ball))
    assert kept < 0.3 * without


@pytest.mark.impacts
def test_the_script_of_the_readme_runs_as_it_stands_and_the_page_start_goes_on_from_it(
    monkeypatch, tmp_path, capsys, drawn_off_screen
):
    monkeypatch.chdir(tmp_path)
    start, readme = (PICTURES["blocks"](ROOT / page, "python") for page in ("docs/start.md", "README.md"))
    assert start[:1] == readme
    names = ran("docs/start.md")
    assert (tmp_path / "response.png").stat().st_size > 10_000
    shown = PICTURES["blocks"](ROOT / "README.md", "text")[0].splitlines()
    lines = capsys.readouterr().out.splitlines()
    printed = lines[: len(shown)]
    # without the ball every processor has the same digits, and with it the page says that others differ
    assert printed[0] == shown[0]
    number = r"[\d.]+"
    assert [re.sub(number, "", line) for line in printed] == [re.sub(number, "", line) for line in shown]
    for line in (printed[1], shown[1]):
        peak, frequency = map(float, re.findall(number, line))
        # some millimetres: without the ball the resonance has some centimetres
        assert 2 < peak < 20
        assert 4.5 < frequency < 5.7
    assert len(list((tmp_path / "modes").iterdir())) == 4
    assert names["run"].energy.residual < 1e-10
    # the errors of the first frequency fall with the fourth power of the element's length
    first = [float(re.search(r"\[\s*([\d.]+)", line)[1]) for line in lines if re.match(r"\d+ \[", line)]
    assert len(first) == 4
    assert first[0] - first[1] > 8 * (first[1] - first[2])


@pytest.mark.impacts
def test_the_script_of_the_page_on_scripting_runs_as_it_stands(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    begun = ran("docs/howto/python.md")
    names = dict(begun)
    for name in GOING_ON:
        of_page = PICTURES["ran"](ROOT / "docs" / "howto" / f"{name}.md", names=begun)
        names |= {key: value for key, value in of_page.items() if begun.get(key) is not value}
    drawn = len(pyplot.get_fignums())
    pyplot.close("all")
    # every page that says from where it goes on is among them
    pages = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "howto").glob("*.md")}
    assert {name for name, text in pages.items() if "go on from the script on the page [" in text} == set(GOING_ON)
    # the shapes and names are the public interface
    assert names["modes"].natural_frequency.shape == (4,)
    assert names["small"].dofs == 8
    assert len(names["runs"]) == 3
    np.testing.assert_array_equal(names["curve"].frequency, np.linspace(4, 6, 21))
    # the largest peak of the sweep: some millimetres, near the resonance of the beam with its ball
    peak, frequency = map(float, capsys.readouterr().out.splitlines()[0].split())
    assert 2e-3 < peak < 2e-2
    assert 4.5 < frequency < 5.7
    rigid = names["response"]
    assert len(rigid.impacts) > 100
    assert rigid.energy.residual < 1e-10
    # seven separate figures and one with two panels
    assert drawn == 8
    # the whole run is drawn as envelopes, its last cycles as curves
    last = names["motion"][0, 1].lines[2].get_ydata()
    np.testing.assert_array_equal(last, 1e3 * names["run"]["tip"][-last.size :])
    assert names["section"]["tip"].shape == (151,)
    # a method of one's own: its impacts are those of the exact one, to the interval of its instants
    own = names["own"].impacts
    exact = fi.integrate(names["three"], names["base"], fi.EventDriven(), duration=0.3).impacts
    assert len(own) == len(exact) == 3
    np.testing.assert_allclose(own.approach_speed, exact.approach_speed, rtol=1e-2)
    np.testing.assert_allclose(own.impulse, exact.impulse, rtol=3e-2)
    # a frame of three equal storeys: its first frequency has a closed form
    assert names["frame"].first_frequency == pytest.approx(np.sqrt(2e3) * np.sin(np.pi / 14) / np.pi, rel=1e-12)
    assert names["swaying"].energy.residual < 1e-10
    assert names["path"].stat().st_size > 0


@pytest.mark.parametrize("page", ["docs/howto/convergence.md", "meshes/README.md"])
def test_the_pages_on_convergence_run_as_they_stand(monkeypatch, drawn_off_screen, page):
    # their meshes are beside the repository's root
    monkeypatch.chdir(ROOT)
    names = ran(page)
    table = names["table"] if "table" in names else names["study"]["mesh"]
    stress = table.index("stress root")
    # the coarsest mesh is enough, as the page says
    assert table.error[0, stress] < 1e-3
    assert table.recommended[stress] == table.number[0] == 6


def test_the_page_on_paraview_runs_as_it_stands(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/mode_shapes_in_paraview.md")
    assert len(names["blocks"]) == 4
    assert len(list((tmp_path / "mode_2").iterdir())) == 24
    text = (tmp_path / "open_in_paraview.py").read_text(encoding="utf-8")
    compile(text, "open_in_paraview.py", "exec")
    assert all(f"'{name}.pvd': " in text for name in ("modes", "mode_2"))


def test_the_page_on_spectra_runs_as_it_stands(monkeypatch, tmp_path, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/spectra.md")
    # a linear run measures its closed form; the lines resolve the resonance of 2 %
    exact, found = names["exact"], names["measured"]
    assert np.abs(found["tip"]).max() == pytest.approx(np.abs(exact["tip"]).max(), rel=0.01)
    # two columns as of a test, away from the resonance that windows of 16 s do not resolve
    test, closed = (names[key]["tip.velocity"] for key in ("test", "closed"))
    far = np.abs(names["f"] - 5.3) > 1.0
    np.testing.assert_allclose(np.abs(test[far]), np.abs(closed[far]), rtol=0.03)
    assert names["density"].unit == "(m/s^2)^2/Hz"
    assert "lacks the impulses" in names["density"].notes[0]
    assert names["shock"].acceleration.max() > 1.6 * 30 * 9.80665


@pytest.mark.impacts
def test_the_page_on_root_stress_runs_as_it_stands(root_stress):
    # under a static moment the root's stress is that moment over the section modulus; inertia and damping add little
    modulus = 0.02 * 1e-3**2 / 6
    moment = np.abs(root_stress["run"]["root.reaction_moment"]).max()
    assert np.abs(root_stress["stress"]).max() == pytest.approx(moment / modulus, rel=0.02)
    folder = root_stress["folder"]
    written = np.loadtxt(folder / "root_stress.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(written[:, 1], root_stress["histories"]["with ball"][1])
    compile((folder / "open_in_paraview.py").read_text(encoding="utf-8"), "open_in_paraview.py", "exec")


def test_the_page_on_root_stress_counts_ranges_as_the_standard_does(root_stress):
    # the example of ASTM E1049, section 5.4.4: ranges 3, 4, 6, 8, 9 with 0.5, 1.5, 0.5, 1, 0.5 cycles
    ranges, counts = root_stress["counted"](np.array([-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]))
    found = {size: counts[ranges == size].sum() for size in np.unique(ranges)}
    assert found == {3.0: 0.5, 4.0: 1.5, 6.0: 0.5, 8.0: 1.0, 9.0: 0.5}
    ranges, counts = root_stress["spectra"]["without ball"]
    stress = root_stress["histories"]["without ball"][1]
    # a steady sine: one cycle in a period of the base but for the two ends, all of the range from lowest to highest
    assert counts.sum() == pytest.approx(20.0 * 5.3, abs=1.0)
    np.testing.assert_allclose(ranges[counts == 1.0], np.ptp(stress), rtol=1e-3)


@pytest.mark.impacts
def test_the_page_on_a_measured_base_runs_as_it_stands(monkeypatch, tmp_path, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/measured_base.md")
    largest = {name: base.amplitude for name, base in names["bases"].items()}
    # half the offset's acceleration times the time squared
    assert largest["as read"] == pytest.approx(0.5 * 0.01 * 9.80665 * 40.0**2, rel=0.01)
    # the sweep has all of its acceleration from 3 s on; noise above 1 Hz and ends add some hundredths of a millimetre
    swept = 0.02 * 9.80665 / (2 * np.pi * (4.5 + 1.5 * 3 / 40)) ** 2
    assert largest["high-pass at 1 Hz"] == pytest.approx(swept, rel=0.1)
    peaks = [np.abs(run["tip"]).max() for run in names["alone"].values()]
    # relative to the base nothing but the static deflection under the offset differs, 0.1 of 13.7 mm
    np.testing.assert_allclose(peaks, peaks[-1], rtol=0.02)
    assert np.abs(names["with_ball"]["tip"]).max() < 0.5 * peaks[-1]
    # of the record cut within the motion, from rest and from the start that is fitted
    errors = [np.std(run["tip"] - names["measured"]) for run in (names["rest"], names["run"])]
    assert errors[0] > 0.3 * np.std(names["measured"])
    assert errors[1] < 0.002 * np.std(names["measured"])
    assert any("begins in motion" in text for text in names["rest"].warnings)
    assert not any("begins in motion" in text for text in names["run"].warnings)


def test_the_page_on_the_record_of_a_shock_runs_as_it_stands(capsys):
    ran("docs/howto/shock_record.md")
    # a linear run: every processor has these digits
    printed = capsys.readouterr().out.splitlines()[:3]
    assert "\n".join(printed) in (ROOT / "docs/howto/shock_record.md").read_text(encoding="utf-8")


def test_the_page_on_ones_own_mesh_runs_as_it_stands(monkeypatch, tmp_path, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    PICTURES["prepare"](ROOT / "docs/howto/own_mesh.md", tmp_path)
    names = ran("docs/howto/own_mesh.md")
    table, stress = names["table"], names["stress"]
    # h^2 under base excitation away from a resonance
    assert table.fitted_order[stress] == pytest.approx(2.0, abs=0.1)
    assert table.error[0, stress] < 1e-3
    assert table.recommended[stress] == 6


def test_gmsh_makes_the_meshes_of_the_page_of_its_geometry(tmp_path):
    pytest.importorskip("gmsh")
    page = ROOT / "docs/howto/own_mesh.md"
    (tmp_path / "beam.geo").write_text(PICTURES["blocks"](page, "text")[0], encoding="utf-8")
    for name, source in PICTURES["MESHES"].items():
        elements = re.search(r"\d+", name)[0]
        call = "import sys, gmsh; gmsh.initialize(sys.argv, run=True); gmsh.finalize()"
        options = ["-1", "-v", "2", "-setnumber", "n", elements, "beam.geo", "-o", name]
        subprocess.run([sys.executable, "-c", call, *options], cwd=tmp_path, check=True)
        made, shipped = fi.read_mesh(tmp_path / name), fi.read_mesh(source)
        np.testing.assert_allclose(made.nodes, shipped.nodes, atol=1e-12)
        assert made.points == pytest.approx(shipped.points, abs=1e-12)
        assert list(made.regions) == list(shipped.regions)


@pytest.mark.impacts
def test_the_page_on_two_balls_runs_as_it_stands(monkeypatch, tmp_path, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/two_balls.md")
    forces = [np.median([curve.peak_force.max() for curve in of_starts]) for of_starts in names["curves"].values()]
    # half the mass with the same contact time: half the force at the same speed, which scatters by a fifth
    assert forces[1] == pytest.approx(0.5 * forces[0], rel=0.3)
    # the last runs have gaps of 3 and 5 mm: the shorter way is gone more often
    for run in names["runs"]:
        often = {name: ball.impacts_per_cycle for name, ball in run.statistics_of.items()}
        assert often["ball A"] > 1.2 * often["ball B"]
        assert run.energy.residual < 1e-10


@pytest.mark.impacts
def test_the_page_on_balls_that_meet_runs_as_it_stands(monkeypatch, tmp_path, capsys, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/balls_that_meet.md")
    page = ROOT / "docs/howto/balls_that_meet.md"
    printed, (said,) = capsys.readouterr().out.splitlines(), PICTURES["blocks"](page, "text")
    # the run before is chaotic
    assert printed[6:] == said.splitlines()[6:]
    assert printed[1] == "b: 0.00 impacts in a cycle"
    often = {name: of_pair.impacts_per_cycle for name, of_pair in names["run"].statistics_of.items()}
    assert min(often["ab"], often["bc"]) > 1.2 * max(often["a"], often["c"])
    assert (tmp_path / "balls_that_meet.png").stat().st_size > 10_000
    # the tables of the study file stand in a whole one
    rest = paper_study_text().split("[[impactor]]")[0] + '[base]\namplitude = "1 mm"\nfrequency = "5 Hz"\n'
    (tables,) = PICTURES["blocks"](page, "toml")
    structure = read_study(rest + tables, Path("study.toml")).structure
    assert structure.meetings == (fi.Meeting("ab", ("a", "b"), 3e-3, fi.Rigid(0.6)),)
    assert [ball.gaps for ball in structure.impactors] == [(np.inf, 3e-3), (3e-3, np.inf)]


def test_the_page_on_ring_downs_runs_as_it_stands(monkeypatch, tmp_path, capsys, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    time = 0.01 * np.arange(2000)
    tip = 20.0 * np.exp(-0.0029 * 2 * np.pi * 5.3 * time) * np.cos(2 * np.pi * 5.3 * time)
    rows = np.column_stack([time, tip + 0.1 * np.random.default_rng(1).standard_normal(time.size)])
    np.savetxt("ring-down.csv", rows, delimiter=",", header="time,tip\ns,mm", comments="")
    names = ran("docs/howto/ring_down.md")
    (mode,) = names["found"].modes
    # noise of 0.5 %: tolerances of the page's reading, of 1 %
    assert mode.frequency == pytest.approx(5.3, rel=3e-5)
    assert mode.damping_ratio == pytest.approx(0.0029, rel=0.0125)
    assert set(names["found"].to_pandas()) >= {"amplitude", "damping_ratio", "low", "high"}
    page = (ROOT / "docs/howto/ring_down.md").read_text(encoding="utf-8")
    said = [row for block in re.findall(r"```text\n(.*?)```", page, re.DOTALL) for row in block.splitlines()]
    printed = capsys.readouterr().out.splitlines()[-len(said) :]
    for row, other in zip(printed, said, strict=True):
        # the last digit, and the word between the numbers
        assert re.sub(r"[\d.]+", "", row) == re.sub(r"[\d.]+", "", other)
        numbers = [[float(one) for one in re.findall(r"\d+\.\d+", text)] for text in (row, other)]
        assert numbers[0] == pytest.approx(numbers[1], rel=1e-4, abs=2e-3 if "mJ" in row else 1e-9)
    start, lost, left = (float(one) for one in re.findall(r"\d+\.\d+", printed[0]))
    assert start == pytest.approx(lost + left, abs=2e-3)


# not marked: the page has the range of its numbers over ten seeds, and the calibration of the examples is marked
def test_the_page_on_calibration_runs_as_it_stands(monkeypatch, tmp_path, capsys, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/calibration.md")
    assert (tmp_path / "calibration.png").stat().st_size > 10_000
    found, few = names["found"], names["few"]
    # the truth that the page names, within three standard errors of its intervals: another kernel has other last digits
    for one, truth in zip(found.parameters, (3.7e-3, 0.57), strict=True):
        assert abs(one.median - truth) < 3 * (one.high - one.low) / (2 * 1.645)
    gap, restitution = few.parameters
    assert (gap.bound in ("highest", "both"), restitution.bound) == (True, "")
    assert few.notes[0].startswith("impactor.ball.gap: no interval, it reaches")
    assert capsys.readouterr().out.endswith(few.notes[0] + "\n")


@pytest.mark.impacts
def test_the_page_on_parameter_studies_runs_as_it_stands(monkeypatch, tmp_path, capsys, drawn_off_screen):
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/parameter_studies.md")
    best, search = names["best"], names["search"]
    # a gap of some millimetres is best whatever the restitution is, and less is a cliff
    assert 2e-3 < best.designs[0].values["impactor.ball.gap"] < 4.5e-3
    shown = PICTURES["blocks"](ROOT / "docs/howto/parameter_studies.md", "text")[0]
    number = r"[\d.]+"
    assert re.sub(number, "", shown.splitlines()[0]) == re.sub(number, "", capsys.readouterr().out.splitlines()[0])
    assert 2e-3 <= search.best.designs[0].values["impactor.ball.gap"] <= 4e-3
    assert (tmp_path / "gap_study" / "study.nc").exists()


@pytest.mark.parametrize("page", ["parameter_studies", "orbits"])
def test_tables_of_a_page_belong_into_the_study_that_init_writes(tmp_path, page):
    (table,) = PICTURES["blocks"](ROOT / "docs" / "howto" / f"{page}.md", "toml")
    text = paper_study_text()
    # the method of the page takes the place of that of the file
    text = re.sub(r"\[method\].*?(?=\n\[)", "", text, flags=re.DOTALL) if "[method]" in table else text
    (tmp_path / "study.toml").write_text(f"{text}\n{table}", encoding="utf-8")
    study = fi.load_study(tmp_path / "study.toml")
    assert page == "orbits" or (study.plan.best.measure, study.plan.starts) == ("peak", 8)
    assert page == "parameter_studies" or study.orbits.most_branches == 10


def test_every_picture_of_a_page_that_is_run_is_one_that_the_page_writes():
    for name in PICTURES["PAGES"]:
        text = PICTURES["page_of"](name).read_text(encoding="utf-8")
        shown = {Path(link).name for link in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)} - {"paraview_deflection.png"}
        shown -= {f"{example}.png" for example in PICTURES["EXAMPLES"]}
        assert shown == set(re.findall(r'save(?:fig|_figure)\([^\n]*"([^"]+\.png)"\)', text)), name


def anchors(path):
    """Anchors of the headings of a page, as hosts make them from the words, or the keys of references."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".bib":
        return {*re.findall(r"^@\w+\{(\w+),", text, re.MULTILINE)}
    headings = re.findall(
        r"^#+ (.*)", re.sub(r"^ *```.*?^ *```", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE
    )
    return {re.sub(r"[^\w -]", "", one).lower().replace(" ", "-") for one in headings}


@pytest.mark.parametrize(("page", "link"), LINKS)
def test_links_lead_somewhere(page, link):
    name, _, anchor = link.partition("#")
    path = ROOT / page.parent / name if name else ROOT / page
    assert path.exists()
    assert not anchor or anchor in anchors(path)


def targets(page):
    """Pages that a page links to."""
    links = re.findall(r"\]\(((?!http)[^)#]+\.md)", (ROOT / page).read_text(encoding="utf-8"))
    return {(ROOT / page.parent / link).resolve().relative_to(ROOT) for link in links}


@pytest.mark.parametrize("words", ["a stop", "an animation", "a phase portrait", "a step response", "energy balance"])
def test_what_a_lecture_shows_stands_beside_a_link_one_click_from_readme(words):
    pages = [(ROOT / "docs" / page).read_text(encoding="utf-8") for page in ("howto/index.md", "index.md")]
    assert Path("docs/howto/index.md") in targets(Path("README.md"))
    for page in pages:
        assert any("](" in line for line in page.splitlines() if words in line)


@pytest.mark.parametrize(
    ("words", "page"),
    [
        ("A force", "several_drives"),
        ("cutting, wind", "mast_in_the_wind"),
        ("A stop, ", "course"),
        ("orbits", "orbits"),
    ],
)
def test_the_table_of_the_readme_leads_from_a_question_to_its_page(words, page):
    rows = (
        (ROOT / "README.md").read_text(encoding="utf-8").partition("## Questions")[2].partition("\n## ")[0].splitlines()
    )
    (row,) = (one for one in rows if one.startswith("| ") and words in one.split(" | ")[0])
    assert f"docs/howto/{page}.md" in row


def test_twelve_questions_are_answered_within_two_clicks():
    page = Path("docs/development/contributing.md")
    rows = re.findall(r"^\| [^|]+\? \| (\[.*) \|$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) == 12
    for row in rows:
        way = re.findall(r"\]\(([^)#]+)#?([^)]*)\)", row)
        assert len(way) <= 2
        before = Path("README.md")
        for link, anchor in way:
            path = (ROOT / page.parent / link).resolve().relative_to(ROOT)
            assert path in targets(before)
            assert anchor in {"", *anchors(ROOT / path)}
            before = path


def test_the_two_commands_stand_on_lines_of_their_own():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert """python3 -m venv .venv && .venv/bin/pip install -e ".[movie,test]" && .venv/bin/femimpact demo""" in lines
    assert ".venv/bin/python -m pytest" in lines


def test_the_readme_has_at_most_700_words_and_the_result_before_the_build():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.split()) <= 700
    assert text.index("response.png)") < text.index("CONTRIBUTING.md")
    # the build's troubles have a page
    assert "hatchling" not in text
    assert "](docs/howto/installation.md)" in text


def test_the_page_on_typical_values_runs_as_it_stands(capsys):
    names = ran("docs/howto/restitution_values.md")
    text = (ROOT / "docs/howto/restitution_values.md").read_text(encoding="utf-8")
    printed = capsys.readouterr().out.splitlines()
    assert "\n".join(printed[1:4]) in text
    assert "\n".join(printed[4:]) in text
    # Hertz's time of the table's row "steel, aluminium", rounded to two digits
    assert f"| steel | aluminium | 4.1 | {1e3 * float(printed[0]):.2g} |" in text
    assert names["speed"].max() < 1.5


@pytest.mark.impacts
def test_the_page_on_orbits_runs_as_it_stands(capsys, tmp_path, monkeypatch):
    # it leaves a file
    monkeypatch.chdir(tmp_path)
    names = ran("docs/howto/orbits.md")
    assert names["orbit"].is_stable
    assert names["orbit"].is_symmetric
    # as its comments say
    assert abs(names["orbit"].multipliers[0]) == pytest.approx(0.960, abs=5e-4)
    speed = names["orbit"].impacts.approach_speed
    assert names["again"].impacts.approach_speed == pytest.approx(speed[0], rel=1e-10)
    branch = names["branch"]
    assert [branch.bifurcations[i].kind for i in (0, -1)] == ["symmetry-breaking", "neimark-sacker"]
    assert [branch.bifurcations[i].value for i in (0, -1)] == pytest.approx([4.97097, 5.39606], abs=5e-6)
