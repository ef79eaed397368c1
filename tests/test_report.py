"""The report of results: one file that loads nothing, says what is missing, and is the same twice."""

from __future__ import annotations

import base64
import json
import math
import re
import shutil
import warnings
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from builders import (
    NO_PICTURES,
    REFERENCE,
    UNDRAWN_STUDY,
    ParameterPlan,
    ResultFileWarning,
    reduced,
    run_study,
    short_study,
    write_report,
)
from test_markup import HOSTILE, Parsed

import femimpact as fi
from femimpact.app.report import script_page
from femimpact.app.report.pictures import draw_again
from femimpact.app.report.player import FULL, frames_of
from femimpact.app.report.result_conclusions import answer_of_runs
from femimpact.app.report.views import Measure
from femimpact.app.results.results import read_summary
from femimpact.app.study.findings import read_findings
from femimpact.app.study.parameter_plan import BestPlan
from femimpact.app.study.study import build_systems
from femimpact.cli import app
from femimpact.units import typeset_number

pytestmark = pytest.mark.impacts

PAGE = NO_PICTURES | {"report": True}

KEPT = PAGE | {"frames": 40, "frame_cycles": 2.0}

MOST_BYTES = 3_000_000
MOST_OF_A_PLAYER = 1_000_000

LOADING = {
    ("img", "src"), ("script", "src"), ("link", "href"), ("iframe", "src"), ("object", "data"), ("embed", "src"),
    ("image", "href"), ("use", "href"), ("video", "src"), ("audio", "src"), ("source", "src"), ("input", "src"),
    ("form", "action"), ("base", "href"), ("body", "background"),
}  # fmt: skip
"""Attributes by which a page fetches something."""


def fetched(page: Parsed) -> list[str | None]:
    """What a page asks for outside itself."""
    loaded = [value for tag, name, value in page.attributes if (tag, name) in LOADING]
    return [value for value in loaded if not (value or "").startswith(("#", "data:image/png;base64,"))]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    out = tmp_path_factory.mktemp("reported") / "out"
    run_study(short_study(1.5, **KEPT), out)
    return out


@pytest.fixture
def results(sound, tmp_path):
    return shutil.copytree(sound, tmp_path / "out")


@pytest.fixture(scope="module")
def run():
    """A run whose ball bounces between walls, with snapshots."""
    law = fi.KelvinVoigt(restitution=0.8, contact_time=2e-3)
    structure = replace(REFERENCE, impactors=(replace(REFERENCE.impactors[0], contact=law),))
    record = fi.Recorder(snapshots=2, snapshots_start=4.0)
    return fi.integrate(reduced(structure, 5, 10), fi.Sine(0.2e-3, 5.0), fi.EventDriven(), 5.0, record)


def text_of(directory: Path) -> str:
    return (directory / "report.html").read_text(encoding="utf-8")


def section(text: str, key: str) -> str:
    """The markup of one section of a page."""
    start = text.index(f'<section id="{key}"') if f'<section id="{key}"' in text else text.index(f'id="{key}" aria')
    return text[start : text.index("</section>", start)]


# ---- the file -------------------------------------------------------------------------------------


def test_a_run_leaves_one_page_that_loads_nothing(sound):
    text = text_of(sound)
    assert len(text.encode()) < MOST_BYTES
    page = Parsed(text)
    assert not fetched(page)
    assert "link" not in page.tags
    assert "@import" not in text
    assert text.count("url(") == text.count("url(#")
    for word in ("http://", "https://", "//cdn"):
        assert word not in text
    # no handler stands in an attribute, and links lead into the page or to a file beside it
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]
    links = [value for tag, name, value in page.attributes if (tag, name) == ("a", "href")]
    assert all(link.startswith("#") or (sound / link).exists() for link in links)


def test_links_within_the_page_lead_somewhere_and_identifiers_are_used_once(sound):
    page = Parsed(text_of(sound))
    identifiers = [value for _, name, value in page.attributes if name == "id"]
    assert len(set(identifiers)) == len(identifiers)
    links = [value for tag, name, value in page.attributes if (tag, name) == ("a", "href") and value.startswith("#")]
    assert {link[1:] for link in links} <= set(identifiers)
    named = [value for _, name, value in page.attributes if name == "aria-labelledby"]
    assert set(named) <= set(identifiers)


def test_two_reports_of_the_same_results_are_the_same_bytes_wherever_they_are(results, tmp_path):
    first = (results / "report.html").read_bytes()
    moved = shutil.copytree(results, tmp_path / "elsewhere")
    assert write_report(moved, tmp_path / "page.html").read_bytes() == first


@pytest.mark.usefixtures("empty_pictures")
def test_a_report_leaves_results_as_they_were(results):
    before = {path.name: path.read_bytes() for path in results.iterdir() if path.name != "report.html"}
    write_report(results)
    after = {path.name: path.read_bytes() for path in results.iterdir() if path.name != "report.html"}
    assert after == before
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fi.load(results)


def test_numbers_of_the_summary_are_conclusions_and_those_of_one_start_are_marked(results):
    summary = json.loads((results / "summary.json").read_text())
    text = Parsed(section(text_of(results), "conclusions")).text
    assert f"{1e3 * summary['sweep']['empty']['peak_amplitude']:.4g}" in text
    assert f"{summary['natural_frequency']['empty'][0]:.3f}" in text
    marked = summary["history"]["steadiness"] != "periodic" or summary["sweep"]["ball"]["peak_is_one_start"]
    assert ("one sample" in text) == marked
    for warning in summary["warnings"]:
        assert warning in text


def test_every_table_cell_holds_the_number_of_its_file(results):
    modes = fi.load(results).modes
    page = Parsed(section(text_of(results), "modes"))
    values = [float(value) for tag, name, value in page.attributes if (tag, name) == ("td", "data-value") and value]
    for column in ("natural_frequency", "damping_ratio", "effective_mass"):
        assert set(np.asarray(modes[column]).tolist()) <= set(values)


def test_without_report_none_is_written(tmp_path):
    run_study(short_study(0.5, **NO_PICTURES), tmp_path / "out", parts=("modes",))
    assert not (tmp_path / "out" / "report.html").exists()


def test_a_report_that_fails_is_a_warning_and_the_results_stand(tmp_path, monkeypatch):
    def fails(*_):
        raise RuntimeError("no page")

    monkeypatch.setattr("femimpact.app.report.result_page.page_of", fails)
    with pytest.warns(ResultFileWarning, match=r"report not written: no page; 'femimpact report .*out' writes it"):
        found = run_study(short_study(0.5, **PAGE), tmp_path / "out", parts=("modes",))
    assert found.modes is not None
    assert not (tmp_path / "out" / "report.html").exists()


@pytest.mark.usefixtures("empty_pictures")
def test_the_command_writes_the_page_or_says_why_not(results, tmp_path, capsys):
    (results / "report.html").unlink()
    app(["report", str(results)], result_action="return_value")
    assert (results / "report.html").exists()
    assert "report.html" in capsys.readouterr().out
    (tmp_path / "empty").mkdir()
    for nothing in ("empty", "absent"):
        with pytest.raises(fi.InputError, match="directory = "):
            write_report(tmp_path / nothing)
    assert list((tmp_path / "empty").iterdir()) == []


# ---- what is missing ------------------------------------------------------------------------------


DAMAGE = {"gone": None, "empty": b"", "another file": b"[1, 2]", "zeros": b"\x89HDF\r\n\x1a\n" + bytes(500)}

READ = ("summary.json", "study.toml", "modes.csv", "modes.nc", "sweep.nc", "history.nc", "impacts.csv")


@pytest.mark.usefixtures("empty_pictures")
@pytest.mark.parametrize(
    ("name", "damage"), [(name, list(DAMAGE)[i % len(DAMAGE)]) for i, name in enumerate((*READ, *READ[1:]))]
)
def test_a_damaged_file_is_named_and_stops_nothing(results, name, damage):
    if DAMAGE[damage] is None:
        (results / name).unlink()
    else:
        (results / name).write_bytes(DAMAGE[damage])
    write_report(results)
    text = text_of(results)
    assert "What was found" in text
    # without a summary nothing tells of a file that is gone
    assert name in Parsed(section(text, "conclusions")).text or name == "summary.json"


def test_values_of_any_kind_in_a_summary_stop_nothing(sound, tmp_path):
    summary = json.loads((sound / "summary.json").read_text())
    values = (None, 3, "text", [], [None], {}, {"a": None}, {"ball": 3, "empty": [1]}, True, 1e999)
    (tmp_path / "study.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    for key in summary:
        for value in values:
            (tmp_path / "summary.json").write_text(json.dumps({"study": "a.toml", "warnings": [], key: value}))
            write_report(tmp_path)
            assert "What was found" in text_of(tmp_path)


@pytest.mark.usefixtures("empty_pictures")
def test_a_damaged_summary_shows_what_is_sound_and_names_each_damaged_key(results):
    summary = json.loads((results / "summary.json").read_text())
    assert summary["warnings"]
    whole = Parsed(text_of(results)).text
    assert "the summary is damaged" not in whole
    damaged = {"history": {**summary["history"], "peak": "wide"}, "seeds": 3, "checksums": {"modes.csv": 1}}
    (results / "summary.json").write_text(json.dumps(summary | damaged))
    write_report(results)
    text = Parsed(text_of(results)).text
    missing = text[text.index("What is missing") :]
    for key in ("summary.history.peak = 'wide'", "summary.seeds = 3", "summary.checksums.modes.csv = 1"):
        assert key in missing, key
    # the rest is there: warnings, notes, versions, and numbers of the sweep, but none of the history
    for word in (*summary["warnings"], *summary["notes"], *summary["versions"], "Largest peak without ball"):
        assert word in text, word
    assert "Peak of the tip" in whole
    assert "Peak of the tip" not in text
    for refused in (fi.load, lambda folder: draw_again(folder, "figures", lambda *_: None)):
        with (
            pytest.warns(ResultFileWarning, match=r"summary.json: is not as the study left it"),
            pytest.raises(fi.InputError, match=r"summary\.history\.peak = 'wide': .*the summary is damaged"),
        ):
            refused(results)


FOREIGN = {
    "nothing": {},
    "notes": {"notes.txt": "a", "report.html": "<p>mine</p>"},
    "tables": {"modes.csv": "a,b\n1,2\n", "sweep.csv": "f,x\n1,2\n"},
    "summary": {"summary.json": '{"total": 3}', "response.png": "no picture"},
    "broken": {"summary.json": "{"},
    "a study": {"study.toml": UNDRAWN_STUDY, "best.toml": UNDRAWN_STUDY},
    "folders": {"blocks/mine.txt": "a", "deflection/0000.vtu": "a"},
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_foreign_folder_gets_no_page(name, tmp_path):
    for file, content in FOREIGN[name].items():
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(content, encoding="utf-8")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(fi.InputError, match="must hold results of a study"):
        write_report(tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_a_history_without_a_contact_has_figures_without_contacts_and_no_warning(tmp_path):
    short = short_study(1.0, figures=True, paraview=False, movie=False, frames=0, starts=1)
    bare = replace(short, structure=replace(short.structure, impactors=()), sweep=None)
    found = run_study(bare, tmp_path / "out", parts=("simulate",))
    assert not any("not drawn" in text for text in found.summary["warnings"])
    assert {file.stem for file in (tmp_path / "out").rglob("*.png")} == {"drive", "history", "energy"}


@pytest.mark.usefixtures("empty_pictures")
def test_results_of_a_version_without_these_files_make_a_report(results):
    for name in ("modes.nc", "history.nc", "impacts.nc"):
        (results / name).unlink()
    summary = json.loads((results / "summary.json").read_text())
    old = {key: value for key, value in summary.items() if key in ("study", "natural_frequency", "sweep", "warnings")}
    (results / "summary.json").write_text(json.dumps(old))
    write_report(results)
    text = text_of(results)
    assert "versions" in text
    assert "not known" in text


@pytest.mark.usefixtures("empty_pictures")
def test_parts_of_a_run_that_was_ended_make_a_report(tmp_path, monkeypatch):
    def ended(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("femimpact.app.tasks.run.run_sweep", ended)
    out, part = tmp_path / "out", tmp_path / "out.part"
    with pytest.raises(KeyboardInterrupt):
        run_study(short_study(1.0, **KEPT), out)
    assert [path.name for path in tmp_path.iterdir()] == [part.name]
    write_report(part)
    text = text_of(part)
    assert "the run was ended before its part" in text
    assert str(tmp_path) not in text
    monkeypatch.undo()
    with pytest.warns(ResultFileWarning, match="removed what a run that did not end well had left"):
        run_study(short_study(1.0, **PAGE), out, parts=("modes",))
    assert "the run was ended" not in text_of(out)


# ---- texts ----------------------------------------------------------------------------------------


def attributes_of(page: Parsed) -> list[tuple[str, str]]:
    """Elements with their attributes; the class of a cell hangs on how long its text is."""
    return [(tag, name) for tag, name, _ in page.attributes if name != "class"]


@pytest.mark.parametrize("text", HOSTILE)
def test_every_text_of_a_report_stays_text(sound, tmp_path, text):
    summary = json.loads((sound / "summary.json").read_text())
    (tmp_path / "study.toml").write_text(UNDRAWN_STUDY, encoding="utf-8")
    for named, expected in (("plain", "word"), ("hostile", text)):
        changed = summary | {"warnings": [expected], "notes": [expected], "remarks": [expected], "study": expected}
        changed["versions"] = {expected: expected}
        changed["history"] = summary["history"] | {"regime": {"label": expected, "criterion": expected}}
        (tmp_path / "summary.json").write_text(json.dumps(changed))
        (tmp_path / "comparison.csv").write_text(f"quantity,unit\n{json.dumps(expected).replace(',', ';')},1\n")
        write_report(tmp_path, tmp_path / f"{named}.html")
    plain, hostile = (Parsed((tmp_path / f"{n}.html").read_text(encoding="utf-8")) for n in ("plain", "hostile"))
    assert hostile.tags == plain.tags
    assert attributes_of(hostile) == attributes_of(plain)


@pytest.mark.usefixtures("empty_pictures")
@pytest.mark.parametrize("text", HOSTILE)
def test_every_text_of_a_script_stays_text(run, tmp_path, text):
    def page(word: str) -> Parsed:
        columns = {word: [1.0, 2.0], "words": [word, word]}
        fi.report(tmp_path / "p.html", {word: columns, "run": run}, REFERENCE, title=word, notes=(word,))
        return Parsed((tmp_path / "p.html").read_text(encoding="utf-8"))

    hostile, plain = page(text), page("word")
    assert hostile.tags == plain.tags
    assert attributes_of(hostile) == attributes_of(plain)


# ---- the player -----------------------------------------------------------------------------------


def player_data(page: Path) -> dict:
    text = page.read_text(encoding="utf-8")
    start = text.index('<script type="application/json">') + len('<script type="application/json">')
    found = text[start : text.index("</script>", start)]
    assert len(found) < MOST_OF_A_PLAYER
    return json.loads(found)


def unpacked(text: str, width: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype="<i2").reshape(-1, width).astype(float)


@pytest.mark.usefixtures("empty_pictures")
def test_the_player_has_every_snapshot_to_its_last_bit_but_rounding(run, tmp_path):
    fi.report(tmp_path / "page.html", {"run": run}, REFERENCE)
    data = player_data(tmp_path / "page.html")
    snapshots = run.snapshots
    rows = np.searchsorted(data["time"], snapshots.time - 1e-8)
    assert np.abs(np.array(data["time"])[rows] - snapshots.time).max() < 1e-8
    # the stations are the nodes, whose values the snapshots hold
    assert np.allclose(data["stations"], run.system.nodes, atol=1e-8)
    deflection = data["unit"] * unpacked(data["deflection"], len(data["stations"]))[rows]
    slope = data["slopeUnit"] * unpacked(data["slope"], len(data["stations"]))[rows]
    assert np.abs(deflection - snapshots.displacement[:, 0::2]).max() <= 0.51 * data["unit"]
    assert np.abs(slope - snapshots.displacement[:, 1::2]).max() <= 0.51 * data["slopeUnit"]
    # on its wall at an impact the ball is further out than at any snapshot
    assert data["unit"] * FULL <= np.abs(deflection).max() + REFERENCE.impactors[0].gap
    balls = data["unit"] * unpacked(data["balls"], 1)[rows]
    assert np.abs(balls - snapshots.ball_displacement).max() <= 0.51 * data["unit"]


def test_every_impact_within_the_snapshots_has_a_frame_with_the_ball_on_its_wall(run):
    frames = frames_of(run)
    within = (run.impacts.time >= run.snapshots.time[0]) & (run.impacts.time <= run.snapshots.time[-1])
    assert within.sum() > 3
    at = np.array([frames.time[frame] for frame, _, _ in frames.impacts])
    assert np.array_equal(at, run.impacts.time[within])
    gap = REFERENCE.impactors[0].gap
    for frame, contact, side in frames.impacts:
        between = frames.balls[frame, contact] - frames.deflection[frame, -1]
        assert between == pytest.approx(side * gap, abs=1e-12)


def test_between_snapshots_the_beam_moves_as_it_did():
    # a free swing of one mode has a closed form: u = cos(w t)
    system = fi.without_impactors(reduced(REFERENCE, 1, 6))
    system = fi.system.with_damping(system, fi.ModalDamping((0.0,)))
    start = fi.State(displacement=np.array([1e-4]))
    fine = fi.integrate(system, fi.Sine(1e-12, 5.0), fi.EventDriven(), 0.4, fi.Recorder(snapshots=1), start)
    coarse = fi.integrate(system, fi.Sine(1e-12, 5.0), fi.EventDriven(), 0.4, fi.Recorder(snapshots=4), start)
    from femimpact.app.report.player import _between

    times = fine.snapshots.time
    read = _between(coarse.snapshots, times)[:, -2]
    step = coarse.snapshots.time[1] - coarse.snapshots.time[0]
    omega = 2 * np.pi * system.first_frequency
    # the remainder of the cubic through two values and two slopes: h^4 max|u''''| / 384
    amplitude = np.abs(fine.snapshots.displacement[:, -2]).max()
    assert np.abs(read - fine.snapshots.displacement[:, -2]).max() <= 1.02 * amplitude * (omega * step) ** 4 / 384


@pytest.mark.parametrize(("damper", "cubes"), [("ball", 1), ("absorber", 2)])
def test_the_box_of_a_ball_is_drawn_once_in_drawing_and_player(tmp_path, damper, cubes):
    """A body at the place of a ball is its box and no cube; elsewhere, and beside an absorber, it is one."""
    box, clip = fi.PointMass("box", at="tip", mass=0.02, offset=0.01), fi.PointMass("clip", at=0.1, mass=5e-3)
    beam = fi.Beam.uniform(length=0.2, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", "tip", 2e-3, 3e-3, fi.Rigid(0.6))
    carried = {"impactors": [ball]} if damper == "ball" else {"absorbers": [fi.Absorber("a", "tip", 2e-3, 3.0, 0.01)]}
    structure = fi.Structure(beam, [box, clip], **carried)
    system = fi.reduce(fi.assemble(structure, elements=4), modes=3)
    record = fi.Recorder(channels=("tip",), snapshots=10)
    motion = fi.integrate(system, fi.Sine(amplitude=1e-4, frequency=5.0), fi.EventDriven(), 0.5, record)
    fi.report(tmp_path / "page.html", {"run": motion}, structure)
    assert (tmp_path / "page.html").read_text(encoding="utf-8").count('class="body"') == cubes
    data = player_data(tmp_path / "page.html")
    assert sum(block["part"] == "body" for block in data["blocks"]) == cubes
    # the middle of the box is its centre of mass
    boxes = [np.mean(block["corners"], axis=1)[:, 0] for block in data["blocks"] if block["part"] == "box"]
    assert boxes == (3 * [pytest.approx(0.01)] if damper == "ball" else [])


@pytest.mark.usefixtures("empty_pictures")
def test_a_player_of_a_long_record_on_a_fine_mesh_stays_small(tmp_path):
    structure = replace(REFERENCE, impactors=(replace(REFERENCE.impactors[0], contact=fi.Rigid(0.9)),))
    record = fi.Recorder(snapshots=1)
    run = fi.integrate(reduced(structure, 4, 300), fi.Sine(0.5e-3, 5.0), fi.EventDriven(), 30.0, record)
    assert run.snapshots.time.size > 5000
    fi.report(tmp_path / "page.html", {"run": run}, structure)
    data = player_data(tmp_path / "page.html")
    assert 600 <= len(data["time"]) <= 1200
    assert (tmp_path / "page.html").stat().st_size < MOST_BYTES


# ---- scripts --------------------------------------------------------------------------------------


def test_a_script_writes_responses_curves_tables_and_maps(run, tmp_path):
    import xarray

    system = reduced(REFERENCE, 4, 10)
    curve = fi.frequency_sweep(system, 0.2e-3, [4.8, 5.0, 5.2], fi.EventDriven(), cycles=30)
    bare = replace(REFERENCE, impactors=())
    study = fi.convergence_study(
        bare, fi.convergence.OverMeshes.uniform(bare, [2, 4, 8]), fi.convergence.Frequencies(2)
    )
    maps = xarray.Dataset(
        {"peak": (("gap", "e"), np.arange(12.0).reshape(3, 4), {"units": "m"})}, {"gap": [1.0, 2.0, 4.0]}
    )
    parts = {
        "Run": run, "Curve": curve, "Curves": {"a": curve, "b": curve}, "Convergence": study, "Maps": maps,
        "Impacts": run.impacts, "Frame": run.to_pandas().iloc[:5], "Columns": {"x": [1, 2], "word": ["a", "b"]},
    }  # fmt: skip
    assert fi.report(tmp_path / "page.html", parts, REFERENCE, title="All") == tmp_path / "page.html"
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    for heading in parts:
        assert f">{heading}" in text
    page = Parsed(text)
    identifiers = [value for _, name, value in page.attributes if name == "id"]
    assert len(set(identifiers)) == len(identifiers)
    assert text.count('class="picture"') == text.count("<figcaption>") - 1 > 8


def test_two_runs_of_the_command_line_stand_on_one_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, seconds in (("light", 1.0), ("heavy", 6.0)):
        run_study(short_study(seconds, **NO_PICTURES), f"{name}-results", parts=("simulate",))
    page = Path(__file__).parents[1] / "docs/howto/report.md"
    *_, code = re.findall("(?s)```python\n(.*?)```", page.read_text(encoding="utf-8"))
    exec(code, {})
    text = Parsed((tmp_path / "two.html").read_text(encoding="utf-8")).text
    for name in ("light", "heavy"):
        found = fi.load(f"{name}-results")
        assert f"Peak of the tip, {name.capitalize()}{typeset_number(1e3 * found.summary['history']['peak'])}" in text
        assert all(f"{name.capitalize()}: {words}" in text for words in found.warnings)
        history = found.history
    # every peak of a channel of many values is drawn, and few values beside it
    drawn = script_page._thinned(Measure(history, "tip", "tip")).dataset["tip"]
    assert drawn.size <= script_page.MOST_VALUES < history["tip"].size
    assert (drawn.max(), drawn.min()) == (history["tip"].max(), history["tip"].min())


def test_every_curve_of_a_report_speaks_and_has_its_unit(tmp_path):
    """Warnings of all curves of one heading, and the stress at a root in MPa."""
    small = reduced(replace(REFERENCE, impactors=()), 3, 10)
    f = np.linspace(5.0, 5.6, 4)
    first = fi.frequency_sweep(small, 2e-4, f, fi.EventDriven(), 30)
    second = replace(first, warnings=())
    stress = fi.frequency_sweep(small, 2e-4, f, fi.EventDriven(), 30, channel="root.surface_stress")
    path = fi.report(tmp_path / "r.html", {"Curves": {"first": first, "second": second}, "Root": stress})
    text = Parsed(path.read_text(encoding="utf-8")).text
    assert len(first.warnings) > 0
    for warning in first.warnings:
        assert f"Curves, first: {warning}" in text
    assert f"{1e-6 * stress.peak_amplitude:.4g} MPa" in text.replace("Largest peak, Root", "")
    assert f"{1e3 * first.peak_amplitude:.4g} mm" in text
    # on a card each, and on their pictures
    assert text.count("has not died out") == 5
    # of two curves of one unit the answer is the ratio, whichever is larger
    half = replace(first, peak=first.peak / 2)
    for curves, words in (({"a": first, "b": half}, "2 times less"), ({"b": half, "a": first}, "2 times more")):
        two = fi.report(tmp_path / "two.html", curves).read_text(encoding="utf-8")
        assert f"{words}.</p>" in two.partition('class="answer">')[2]
    mixed = fi.report(tmp_path / "two.html", {"a": first, "root": stress}).read_text(encoding="utf-8")
    assert "times" not in mixed.partition('class="answer">')[2].partition("</p>")[0]
    assert "one sample" not in text


def test_what_a_ball_leaves_as_it_is_has_one_number():
    # a beam that is let go moves farthest where it begins
    answer = answer_of_runs("ball", (20e-3, 12.3e-3), (20e-3, 9.84e-3))
    rms = "The ball lowers the rms of the tip from 12.3 mm to 9.84 mm, 1.25 times less"
    assert answer == f"{rms}, and hardly changes the largest motion of the tip, 20 mm."


@pytest.mark.usefixtures("empty_pictures")
def test_a_study_on_a_page_names_its_drive_and_takes_the_axes_of_the_worst(tmp_path):
    small = reduced(replace(REFERENCE, impactors=(replace(REFERENCE.impactors[0], gap=1e-3),)), 3, 10)
    axes = {
        "impactor.ball.gap": [1e-3, 2e-3],
        "base.frequency": [4.8, 5.2],
        "impactor.ball.contact.restitution": [0.5, 0.8],
    }
    data = fi.parameter_study(small, axes, ["peak"], cycles=30, excitation=fi.Sine(2e-4, 5.0))
    worst = ("base.frequency", "impactor.ball.contact.restitution")
    cards = {}
    for name in ((), worst):
        path = fi.report(tmp_path / "r.html", {"Study": data}, worst_over=name or None)
        text = " ".join(Parsed(path.read_text(encoding="utf-8")).text.split())
        best = fi.best_case(data, "peak", worst_over=name or None)
        cards[name] = f"Smallest worst peak{1e3 * best.designs[0].value:.4g}"
        assert cards[name].replace(" ", "") in text.replace(" ", "")
        assert "a sine of the base, amplitude 0.2 mm, frequency as its axis has it" in text
        assert ("The worst counts over" in text) == bool(best.worst_over)
    assert cards[()] != cards[worst]
    with pytest.raises(fi.InputError, match="worst_over"):
        fi.report(tmp_path / "r.html", {"Study": data}, worst_over=("impactor.ball.mass",))


def test_numbers_of_a_planned_test_are_a_part(tmp_path):
    found = fi.preflight(reduced(REFERENCE, 3, 10), fi.Sine(2e-4, 5.0), duration=3.0)
    path = fi.report(tmp_path / "r.html", {"B": found})
    text = Parsed(path.read_text(encoding="utf-8")).text
    assert all(row.what in text for row in found.rows)


def test_a_notebook_names_the_figure_of_a_record_and_texts_stay_texts(run):
    for record, figure in ((run, "channels"), (run.impacts, "impact_histograms")):
        shown = record._repr_html_()
        assert len(shown) < 10_000
        assert f"<code>fi.figures.{figure}(response)</code>" in shown
    # a channel that a user writes may have any name
    name = "<script>alert(1)</script>"
    named = replace(run, channels={name: run["tip"]}, units={name: "m"})
    assert "script" not in Parsed(named._repr_html_()).tags


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([5.3, 70.13385, 462.2723], ["5.300", "70.134", "462.272"]),
        ([1e-9, 0.5], ["1\u00d710\u207b\u2079", "0.5"]),
        ([1.2782e-3, 462.27, None], ["0.0012782", "462.27", "\u2013"]),
        ([1, -20], ["1", "\u221220"]),
        ([2.0, 4.0, np.nan], ["2", "4", "\u2013"]),
        ([0.0, 0.0], ["0", "0"]),
        ([np.inf, 1.0], ["\u221e", "1"]),
    ],
)
def test_numbers_of_a_column_stand_below_one_another(values, texts):
    from femimpact.app.report.page import Table, table_element

    cells = table_element(Table("t", ("x",), tuple((value,) for value in values))).iter("td")
    shown, data = zip(*((cell.text, cell.get("data-value")) for cell in cells), strict=True)
    assert list(shown) == texts
    # all digits are in what is copied
    known = [value for value in values if value is not None and not np.isnan(value)]
    assert [float(text) for text in data if text] == known


@pytest.mark.parametrize("part", [3, None, "text", {}, {"a": [1, 2], "b": [1]}, [1, 2], {"a": np.ones((2, 2))}])
def test_a_part_that_is_no_result_is_named(tmp_path, part):
    with pytest.raises(fi.InputError, match=r"parts\.Odd"):
        fi.report(tmp_path / "page.html", {"Odd": part})
    assert not (tmp_path / "page.html").exists()


def test_a_drive_is_read_as_its_trade_reads_it(tmp_path):
    """Densities of a random drive, transfer functions of a chirp, the response spectrum of a shock; no others."""
    omega = 2 * math.pi * 5.0
    system = fi.System.from_matrices([[1.0]], [[0.1 * omega]], [[omega**2]], points={"tip": [1.0]})
    drives = {
        "random": fi.RandomBase([(2.0, 0.1), (20.0, 0.1)], 10.0), "chirp": fi.Chirp(2.0, 20.0, 5.0, acceleration=1.0),
        "shock": fi.Shock("half-sine", 100.0, 0.01), "sine": fi.Sine(1e-3, 5.0),
    }  # fmt: skip
    record = fi.Recorder(channels=("tip",), interval=0.01)
    runs = {name: fi.integrate(system, one, fi.EventDriven(), 10.0, record) for name, one in drives.items()}
    page = fi.report(tmp_path / "page.html", runs).read_text(encoding="utf-8")
    assert "Spectral density of tip" in page
    assert "tip over base.acceleration" in page
    assert "Shock response spectrum of the base" in page
    assert "sine: spectra" not in page
    # with its interval, and with what was warned of
    assert "95 % interval" in page
    (text,) = fi.spectrum(runs["random"], "tip").warnings
    assert text.split(":")[0] in page
    # what cannot be read is said in place of a chart
    short = fi.integrate(system, drives["chirp"], fi.EventDriven(), 5.0, record)
    page = fi.report(tmp_path / "short.html", {"chirp": short}).read_text(encoding="utf-8")
    assert "No spectrum of tip: response.time" in page


# ---- the answer, and a sheet of paper ---------------------------------------------------------------


def test_a_page_begins_with_its_answer_and_each_number_is_a_card_or_a_row(sound):
    from femimpact.app.report.result_conclusions import best_of, result_conclusions
    from femimpact.app.results.picture_data import read_results

    results = read_results(sound)
    conclusions = result_conclusions(results, best_of(results))
    text = text_of(sound)
    answer = Parsed(text[text.index('class="answer"') : text.index("</p>", text.index('class="answer"'))]).text
    empty, ball = (results.findings.sweep[case].peak_amplitude for case in ("empty", "ball"))
    assert all(f"{1e3 * peak:.3g} mm" in answer for peak in (empty, ball))
    assert f"{empty / ball:.3g} times less" in answer
    found = section(text, "conclusions")
    cards, rows = found.count("<dt>"), found.count("<tr>") - 1
    assert cards == min(len(conclusions), 6)
    assert cards + rows == len(conclusions) > 6
    assert all(one.label in Parsed(found).text for one in conclusions)


def test_the_answer_of_a_sweep_says_what_the_ball_does():
    from femimpact.app.report.result_conclusions import answer_of
    from femimpact.app.study.findings import CurveSummary, Findings

    def curve(peak, frequency):
        values = {"peak_amplitude": peak, "peak_frequency": frequency, "peak_is_one_start": False}
        names = {item.name for item in fields(CurveSummary)}
        return CurveSummary(**{**dict.fromkeys(names), **values})

    sweep = {"empty": curve(36.8e-3, 5.3), "ball": curve(4.6e-3, 5.51)}
    assert answer_of(Findings(sweep=sweep), ()) == (
        "The ball lowers the largest motion of the tip from 36.8 mm at 5.3 Hz to 4.6 mm at 5.51 Hz: 8 times less."
    )
    larger = {"empty": sweep["ball"], "ball": sweep["empty"]}
    assert "The ball raises the largest motion" in answer_of(Findings(sweep=larger), ())
    assert "8 times more" in answer_of(Findings(sweep=larger), ())
    # where the larger peak is a bound, their ratio is one
    coarse = {"empty": replace(sweep["empty"], resolved=False), "ball": sweep["ball"]}
    words = answer_of(Findings(sweep=coarse), ())
    assert "from at least 36.8 mm" in words
    assert words.endswith(": at least 8 times less.")


def test_two_runs_of_which_one_has_the_ball_are_compared_under_any_headings(tmp_path):
    system, base = reduced(REFERENCE, 1, 6), fi.Sine(2e-4, 5.3)
    ball, bare = (fi.integrate(one, base, fi.EventDriven(), 20.0) for one in (system, fi.without_impactors(system)))

    def answer(**parts):
        text = fi.report(tmp_path / "two.html", parts).read_text(encoding="utf-8")
        return text.partition('class="answer">')[2].partition("</p>")[0]

    words = [f"{1e3 * run.steady.peak[0]:.3g} mm" for run in (bare, ball)]
    for parts in ({"A": ball, "B": bare}, {"B": bare, "A": ball}):
        assert f"the largest motion of the tip from {words[0]} to {words[1]}" in answer(**parts)
    # not where the drives differ, or both have it
    other = fi.integrate(fi.without_impactors(system), fi.Sine(1e-4, 5.3), fi.EventDriven(), 20.0)
    assert "The ball" not in answer(A=ball, B=other)
    assert "The ball" not in answer(A=ball, B=ball)


def test_two_runs_named_without_and_with_are_compared(tmp_path):
    system = fi.without_impactors(reduced(REFERENCE, 1, 6))
    one, half = (
        fi.integrate(system, fi.Shock("half-sine", acceleration=a, duration=0.05), fi.EventDriven(), 2.0)
        for a in (1.0, 0.5)
    )
    page = fi.report(tmp_path / "page.html", {"Without ball": one, "With ball": half}).read_text(encoding="utf-8")
    words = page[page.index("The ball lowers the rms of the tip from ") :].partition("<")[0]
    assert words.count("2 times less") == 2
    other = fi.report(tmp_path / "other.html", {"Without ball": one, "With balls": half}).read_text(encoding="utf-8")
    assert "times less" not in other


@pytest.mark.usefixtures("empty_pictures")
def test_a_sheet_has_the_answer_and_one_picture_and_neither_paths_nor_residuals(results):
    text = write_report(results, results / "sheet.html", True).read_text(encoding="utf-8")
    page = Parsed(text)
    assert not fetched(page)
    assert 'class="answer"' in text
    assert text.count('class="picture"') == 1
    for words in ("Energy unaccounted", ".csv", ".nc", str(results), "SHA-256", "<nav"):
        assert words in text_of(results) or words == str(results)
        assert words not in text
    # the same by the command and by the key of a study
    app(["report", str(results), "--short", "-o", str(results / "again.html")], result_action="return_value")
    assert (results / "again.html").read_text(encoding="utf-8") == text
    # of the damping an interval may be left out, and not that the curve has another shape
    said = ["with ball: fit: no interval: the misfit", "with ball: fit: the curve is not that of one pole"]
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    (results / "summary.json").write_text(json.dumps(summary | {"warnings": said}), encoding="utf-8")
    sheet = write_report(results, results / "sheet.html", True).read_text(encoding="utf-8")
    assert [words in sheet for words in said] == [False, True]
    assert all(words in write_report(results).read_text(encoding="utf-8") for words in said)
    # without a path it leaves the report as it is
    full = text_of(results)
    assert write_report(results, short=True) == results / "sheet.html"
    assert text_of(results) == full


def test_a_sheet_is_a_file_of_results_that_a_new_run_takes_away(tmp_path):
    out = tmp_path / "out"
    run_study(short_study(0.5, **PAGE), out)
    before = text_of(out)
    assert write_report(out, short=True) == out / "sheet.html"
    assert text_of(out) == before
    run_study(short_study(0.5, **PAGE), out, force=True)
    assert {path.name for path in out.glob("*.html")} == {"report.html"}


def test_a_study_asks_for_its_sheet_and_other_words_are_refused(tmp_path):
    run_study(short_study(0.5, **PAGE | {"report": "short"}), tmp_path / "out")
    assert text_of(tmp_path / "out").count("<nav") == 0
    with pytest.raises(fi.InputError, match=r"report = 'long': must be True or False, or 'short'"):
        replace(short_study(0.5).output, report="long")


def test_orbits_branches_spectra_preflights_and_figures_are_parts_of_a_page(tmp_path):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    rigid = replace(REFERENCE, impactors=(replace(REFERENCE.impactors[0], gap=2e-3, contact=fi.Rigid(0.6)),))
    system, base = reduced(rigid, 4, 20), fi.Sine(0.2e-3, 5.25)
    orbit = next(one for one in fi.orbits.two_impact_orbits(system, base) if one.is_stable)
    figure, _ = pyplot.subplots()
    parts = {
        "An orbit": orbit,
        "A branch": fi.continue_orbit(orbit, "frequency", to=(5.24, 5.26), points=5),
        "A transfer function": fi.transfer_function(fi.without_impactors(system), np.linspace(5.0, 5.6, 9)),
        "A figure of mine": figure,
    }
    shock = fi.shock_response_spectrum(fi.Shock("half-sine", acceleration=10.0, duration=0.01), [20.0, 80.0, 200.0])
    preflight = fi.preflight(system, base, duration=60.0)
    text = fi.report(tmp_path / "page.html", {**parts, "A test": preflight}).read_text(encoding="utf-8")
    alone = {
        name: fi.report(tmp_path / "one.html", {name: part}).read_text(encoding="utf-8")
        for name, part in {**parts, "A test": preflight, "A shock": shock}.items()
    }
    pyplot.close("all")
    answers = {name: one.partition('class="answer">')[2].partition("</p>")[0] for name, one in alone.items()}
    assert f"{1e3 * orbit.steady().peak.max():.4g} mm, stable, period" in answers["An orbit"]
    assert parts["A branch"].is_stable.all()
    assert "Hz, all of them stable" in answers["A branch"]
    assert "16.51 m/s" in answers["A shock"]
    assert "at 5.3 Hz" in answers["A transfer function"]
    assert "Limits that are passed" in answers["A test"]
    assert 'class="answer"' not in alone["A figure of mine"]
    assert 'id="conclusions"' not in alone["A figure of mine"]
    keys = [f"part-{number}" for number in range(1, 6)]
    assert [section(text, key).count('class="picture"') for key in keys] == [1, 1, 1, 1, 0]
    assert section(text, "part-5").count("<tr>") == 1 + len(preflight.rows)
    with pytest.raises(fi.InputError, match="an orbit or a branch"):
        fi.report(tmp_path / "page.html", {"three": 3})


@pytest.mark.parametrize("swept", [False, True])
def test_the_largest_stress_stands_with_and_without_the_ball_and_says_where_it_is(swept, tmp_path):
    study = short_study(2.0, **PAGE)
    run_study(study if swept else replace(study, sweep=None), tmp_path)
    found, text = read_findings(read_summary(tmp_path)), Parsed(text_of(tmp_path)).text
    assert "Largest root surface stress with ball" in text
    assert f"steady at {study.base.frequency:g} Hz" in text or f"MPa at {study.base.frequency:g} Hz, steady" in text
    # the steady motion without the ball, run until its transient has died out
    system = fi.reduce(fi.without_impactors(build_systems(study)[1]), 8)
    kept = fi.Recorder(channels=("root.surface_stress", "tip"), start=590.0)
    run = fi.integrate(system, study.base, fi.EventDriven(), 600.0, kept)
    steady = np.abs(run["root.surface_stress"]).max()
    assert found.history.root_stress_without == pytest.approx(steady, rel=5e-3)
    if swept:
        curve = found.sweep["empty"]
        assert f"at {curve.peak_frequency:.4g} Hz, where the peak of the sweep is" in text
        # a motion of one mode has the stress in proportion to it
        ratio = steady / np.abs(run["tip"]).max()
        assert curve.root_stress == pytest.approx(ratio * curve.peak_amplitude, rel=0.02)


@pytest.mark.parametrize("limit", [1e6, 2e9])
def test_a_stress_has_its_limit_and_the_share_that_it_uses(limit, tmp_path):
    study = replace(short_study(1.0, **PAGE), sweep=None)
    best = BestPlan("peak", limits={"root.surface_stress": limit})
    axes = {"impactor.ball.gap": [0.003, 0.004]}
    plan = ParameterPlan(axes=axes, measures=("peak", "root.surface_stress"), best=best)
    run_study(replace(study, plan=plan), tmp_path)
    largest = read_findings(read_summary(tmp_path)).history.channels["root.surface_stress"].largest_of_run
    for short in (False, True):
        text = Parsed(write_report(tmp_path, tmp_path / "page.html", short).read_text(encoding="utf-8")).text
        share = re.search(r"root.surface_stress [\d.]+ MPa, limit (\d+) MPa, ([\d.]+) % of it", text)
        assert float(share[1]) == 1e-6 * limit
        assert float(share[2]) == pytest.approx(100.0 * largest / limit, rel=5e-3)
