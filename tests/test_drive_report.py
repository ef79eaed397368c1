"""What the summary and the report of a run say of its drives."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import run_study, write_parameter_study
from test_markup import Parsed
from test_report import text_of
from test_study_forces import HAMMER, REST, SINE, read

import femimpact as fi
from femimpact.app.report.views import spectra_of
from femimpact.arrays import Array
from femimpact.cli import print_results
from femimpact.excitation.drives import drive_words

SHAKER = '[[force]]\nname = "shaker"\nat = "mid"\nkind = "sine"\nforce = 0.1\nfrequency = 33.0\n'
QUIET = "[output]\nfigures = false\nmovie = false\nparaview = false\n"


def ran(folder: Path, *parts: str) -> tuple[fi.app.StudyResults, str]:
    """Results of a study of these tables, and its report."""
    results = run_study(read(*parts, QUIET), folder / "out", parts=("simulate",))
    return results, (folder / "out" / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def two_drives(tmp_path_factory):
    return ran(tmp_path_factory.mktemp("two"), SINE, SHAKER)


@pytest.fixture(scope="module")
def hammer(tmp_path_factory):
    return ran(tmp_path_factory.mktemp("hammer"), REST, HAMMER)


def test_the_summary_has_the_work_of_every_drive_and_their_sum(two_drives, hammer):
    summary = two_drives[0].summary
    assert list(summary["work_of"]) == ["base", "shaker"]
    assert sum(summary["work_of"].values()) == pytest.approx(summary["work"], rel=1e-12)
    assert summary["work"] == two_drives[0].history["energy_work"].to_numpy()[-1]
    # a single one has all of it, by its own name
    summary = hammer[0].summary
    assert summary["work_of"] == {"hammer": summary["work"]}
    assert summary["work"] > 0.0


def test_the_energies_of_several_drives_have_the_work_of_each_and_their_sum():
    system = fi.System.from_matrices([[1.0]], [[0.4]], [[900.0]], points={"mass": [1.0]})
    drives = fi.Sine(1e-3, 5.0) + fi.PointForce("mass", fi.Sine(0.1, 3.0), "shaker")
    for drive, words in ((drives, {"work of the base", "work of shaker"}), (fi.Sine(1e-3, 5.0), set())):
        run = fi.integrate(system, drive, fi.EventDriven(), 2.0)
        labels = {line.get_label() for line in fi.figures.energies(run, fi.figures.OffScreen())[1].lines}
        assert {label for label in labels if label.startswith("work")} == {"work put in", *words}


# ---- the drive, and what a run under it is read by -------------------------------------------------


@pytest.mark.parametrize(
    ("drive", "said", "axis"),
    [
        (fi.Sine(1e-3, 5.0), ("base at 5 Hz; amplitude 1 mm", "0.987 m/s^2 (0.101 g)"), "acceleration (m/s^2)"),
        (
            fi.Chirp(3.0, 12.0, 120.0, acceleration=0.05 * 9.80665, kind="logarithmic"),
            ("start 3 Hz", "stop 12 Hz", "1 oct/min", "acceleration 0.4903 m/s^2 (0.05 g)"),
            "acceleration (m/s^2)",
        ),
        (fi.Chirp(3.0, 12.0, 90.0, amplitude=1e-3), ("0.1 Hz/s", "amplitude 1 mm"), "acceleration (m/s^2)"),
        (
            fi.SteppedSine([4.0, 5.0], 9, acceleration=[(4.0, 1.0), (5.0, 2.0)]),
            ("4 to 5 Hz in 2 steps", "cycles 9", "in 2 rows"),
            "acceleration (m/s^2)",
        ),
        (
            fi.RandomBase([(10.0, 4.0), (35.0, 4.0)], 8.0, seed=3),
            # the square root of 25 Hz times 4 (m/s^2)^2/Hz
            ("10 to 35 Hz", "seed 3", "root mean square 10"),
            "density (g²/Hz)",
        ),
        (
            fi.Shock("half-sine", 294.1995, 0.011, compensated=True),
            ("half-sine", "compensated", "duration 0.011 s", "largest 294.2 m/s^2 (30 g)"),
            "acceleration (m/s^2)",
        ),
        (
            fi.HammerBlow("mass", 0.05, 2e-3, begin=0.1, name="hammer"),
            # pi impulse/(2 duration)
            ("force at mass", "impulse 50 mN s", "begin 0.1 s", "largest 39.27 N"),
            "force (N)",
        ),
        (fi.PointForce("mass", fi.RandomBase([(10.0, 4.0), (35.0, 4.0)], 8.0)), ("10 to 35 Hz",), "density (N²/Hz)"),
    ],
)
def test_a_drive_is_shown_with_its_numbers_and_a_picture(drive, said, axis):
    (drawn,) = fi.figures.drive(drive, 9.0, fi.figures.OffScreen())
    text = f"{drive_words(drive)[0]} {drawn.get_title('left')}"
    for words in said:
        assert words in text
    assert drawn.get_ylabel().endswith(axis)
    assert drawn.get_xlabel().endswith(("(s)", "(Hz)"))


def test_the_report_of_several_drives_has_a_line_and_a_chart_of_each(two_drives):
    text = two_drives[1]
    for words in ("acceleration of the base", "shaker: force", "amplitude 1 mm", "amplitude 0.1 N", "work of shaker"):
        assert words in text
    assert "several drives act at once" in text


def test_a_blow_has_its_transfer_function_or_the_history_that_it_needs(tmp_path):
    damping = "[damping]\nratio = 0.1\nmodes = [1, 2]\n"
    # a ratio of 0.1 at 20 Hz needs ln(1000)/(2 pi 2 Hz), 0.55 s
    run_study(read(damping, REST, HAMMER, QUIET), tmp_path / "long")
    assert "tip over force" in (tmp_path / "long" / "report.html").read_text(encoding="utf-8")
    # modes are no part of it: what decays slowest is known from the study
    run_study(read(damping, REST.replace("2.0", "0.4"), HAMMER, QUIET), tmp_path / "short", parts=("simulate",))
    text = (tmp_path / "short" / "report.html").read_text(encoding="utf-8")
    assert "No spectrum of tip: base.history = 0.4 s" in text
    asked = float(text.split("No spectrum of tip: ")[1].split("base.history = ")[2].split(" s")[0])
    # the named length is enough
    long = REST.replace("2.0", f"{asked}")
    run_study(read(damping, long, HAMMER, QUIET), tmp_path / "asked")
    assert "tip over force" in (tmp_path / "asked" / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("empty_pictures")
def test_a_study_is_warned_in_the_keys_of_its_file(tmp_path):
    results, text = ran(tmp_path, REST, HAMMER)
    notes = " ".join(results.summary["notes"])
    assert "output.interval sets another one" in notes
    assert "Recorder(" not in text
    # a run without a cycle has no kind of motion to judge
    assert "Criterion" not in text
    assert "not periodic" not in text


def test_results_of_a_study_in_place_of_a_run_are_refused_in_a_short_line(hammer):
    for read_off in (fi.measured_transfer, fi.spectrum):
        with pytest.raises(fi.InputError, match=r"^response = StudyResults: must be a Response, as fi\.integrate"):
            read_off(hammer[0], "tip")


@pytest.mark.usefixtures("empty_pictures")
def test_a_blow_beside_a_ball_has_its_spectra_or_the_reason(tmp_path):
    ball = '[[impactor]]\nname = "ball"\nat = "tip"\nmass = 3e-3\ngap = 2e-3\n'
    ball += 'contact = { law = "kelvin-voigt", restitution = 0.78, contact_time = 2e-3 }\n'
    damping = "[damping]\nratio = 0.01\nmodes = [1, 2]\n"
    text = ran(tmp_path, ball, damping, REST.replace('"static"', '"base"'), HAMMER)[1]
    assert "No spectrum of tip: base.history = 2.0 s" in text


def test_a_record_of_few_samples_has_no_response_spectrum():
    """Its highest frequency, a tenth of the reading rate, is not above its lowest, a period of the whole."""
    system = fi.System.from_matrices([[1.0]], [[0.4]], [[900.0]], points={"mass": [1.0]})
    for count, is_there in ((2, False), (10, False), (11, True)):
        record = fi.RecordedBase([(-1.0) ** i for i in range(count)], interval=1e-3)
        spectra, refused = spectra_of(fi.integrate(system, record, fi.EventDriven(), 0.1))
        assert (len(spectra), len(refused)) == (is_there, 1 - is_there)
        assert all(one.frequency[0] < one.frequency[-1] for one in spectra)


def test_a_stepped_sine_over_gaps_says_where_its_frequencies_are(tmp_path):
    ball = '[[impactor]]\nname = "ball"\nat = "tip"\nmass = 3e-3\ngap = 2e-3\n'
    ball += 'contact = { law = "rigid", restitution = 0.6 }\n'
    steps = '[base]\nkind = "stepped-sine"\nfrequencies = [4.0, 5.0]\ncycles = 3\namplitude = 1e-4\n'
    axes = '[study]\nmeasures = ["peak"]\n[study.axes]\n"impactor.ball.gap" = [1e-3, 2e-3]\n'
    write_parameter_study(read(ball, "[damping]\nratio = 0.01\nmodes = [1, 2]\n", steps, axes, QUIET), tmp_path / "out")
    assert "one value over all dwells" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


BALL = (
    '[[impactor]]\nname = "ball"\nat = "tip"\nmass = 1e-3\ngap = 1e-3\n'
    'contact = { law = "rigid", restitution = 0.6 }\n[damping]\nratio = 0.02\nmodes = [1, 2]\n'
)
AT_TIP = '[base]\nkind = "rest"\nhistory = 6.0\ninitial = "base"\n[[force]]\nname = "cut"\nkind = "sine"\n'
FORCES = {"point": 'at = "tip"\nforce = 0.02\n', "line": "density = 0.2\n"}


def steady_peaks(study: fi.app.Study, frequencies: Sequence[float]) -> Array:
    """Peaks (m) of the tip without its ball, by integration until a start has died out."""
    bare = fi.without_impactors(fi.reduce(fi.assemble(study.structure, elements=4), modes=2))
    drives = [replace(study.excitation, history=fi.Sine(study.excitation.history.level, f)) for f in frequencies]
    return np.array([fi.integrate(bare, drive, fi.EventDriven(), 9.0).steady.peak[0] for drive in drives])


@pytest.mark.usefixtures("empty_pictures")
@pytest.mark.parametrize("kind", FORCES)
def test_a_run_under_a_sine_of_a_force_has_the_peak_without_its_ball(kind, tmp_path, capsys):
    study = read(BALL, AT_TIP, FORCES[kind], "frequency = 15.5\n", QUIET)
    results = run_study(study, tmp_path / "out", parts=("simulate",))
    with_ball, without = (results.summary[name]["peak"] for name in ("history", "history_without"))
    assert without == pytest.approx(steady_peaks(study, [15.5])[0], rel=1e-4)
    assert with_ball < 0.8 * without
    print_results(results.directory)
    told = re.search(r"lowers the largest motion of the tip from (\S+) mm to (\S+) mm", capsys.readouterr().out)
    assert [float(one) for one in told.groups()] == pytest.approx([1e3 * without, 1e3 * with_ball], rel=5e-3)


@pytest.mark.parametrize("kind", FORCES)
def test_a_study_over_the_frequency_of_a_force_has_the_peak_without_its_ball(kind, tmp_path):
    axes = '"impactor.ball.gap" = [1e-3, 2e-3]\n"force.cut.frequency" = [15.0, 15.4, 16.0]\n'
    table = f'[study]\nmeasures = ["peak"]\n[study.axes]\n{axes}[study.best]\nmeasure = "peak"\n'
    study = read(BALL, AT_TIP, FORCES[kind], "frequency = 9.0\n", table, QUIET)
    data = write_parameter_study(study, tmp_path / "out")
    head, text = (Parsed(one).text for one in ((tmp_path / "out" / "report.html").read_text().split("<main")))
    # a resonance lies between two frequencies of the axis
    largest = steady_peaks(study, np.linspace(15.0, 16.0, 101)).max()
    told = re.search(r"Without ball the largest steady peak from 15 to 16 Hz is (\S+) mm, at 15\.\d+ Hz", head)
    assert 1e-3 * float(told[1]) == pytest.approx(largest, rel=1e-3)
    ratio = re.search(r", (\S+) times less than without ball", head)
    assert float(ratio[1]) == pytest.approx(largest / float(data["peak"].max("force.cut.frequency").min()), rel=1e-2)
    # the frequency of the study file is that of no case, and the motion is that of the tip
    assert "but frequency of force cut as its axis has it." in head
    assert "of the base" not in head
    # `femimpact run` takes the last third
    assert "of the whole history, its start included" in text


@pytest.mark.parametrize(("level", "frequency"), [("amplitude = 2e-4", 15.4), ("acceleration = 2.0", 9.0)])
def test_the_peak_without_its_ball_is_that_of_the_level_of_the_base(level, frequency, tmp_path):
    """An acceleration is the same at all frequencies of an axis, and its amplitude is not."""
    axes = '"impactor.ball.gap" = [1e-3, 2e-3]\n"base.frequency" = [15.0, 15.4, 16.0]\n'
    table = f'[study]\nmeasures = ["peak"]\ncycles = 30\n[study.axes]\n{axes}[study.best]\nmeasure = "peak"\n'
    study = read(BALL, f"[base]\n{level}\nfrequency = {frequency}\n", table, QUIET)
    write_parameter_study(study, tmp_path / "out")
    bare = fi.without_impactors(fi.reduce(fi.assemble(study.structure, elements=4), modes=2))
    given = {study.sine.by: study.sine.level, "frequency": bare.first_frequency}
    peak = fi.integrate(bare, fi.Sine(**given), fi.EventDriven(), 9.0).steady.peak[0]
    told = re.search(r"the largest steady peak from 15 to 16 Hz is (\S+) mm", text_of(tmp_path / "out"))
    assert 1e-3 * float(told[1]) == pytest.approx(peak, rel=2e-3)


def test_files_call_relative_what_is_relative_to_the_base():
    system = fi.System.from_matrices([[1.0]], [[0.4]], [[900.0]], points={"mass": [1.0]})
    record = fi.Recorder(("mass", "mass.absolute_acceleration"))
    names = fi.integrate(system, fi.Sine(1e-3, 5.0), fi.EventDriven(), 0.1, record).to_xarray()
    assert names["mass"].attrs["long_name"] == "mass, relative to the base"
    assert names["mass.absolute_acceleration"].attrs["long_name"] == "mass.absolute_acceleration"
