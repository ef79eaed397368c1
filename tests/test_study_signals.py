"""Chirps, stepped sines, random motions and shocks in study files."""

import json
from dataclasses import replace

import numpy as np
import pytest
from builders import UNDRAWN_STUDY, read_study, run_study, study_text

import femimpact as fi

pytestmark = [pytest.mark.impacts, pytest.mark.usefixtures("unreported")]

KINDS = {
    "chirp": (
        'start = 4.0\nstop = 6.0\nduration = 2.0\nacceleration = 0.3\nrate = "logarithmic"\ninitial = "space"',
        fi.Chirp(4.0, 6.0, 2.0, acceleration=0.3, kind="logarithmic"), 2.0,
    ),
    "stepped-sine": (
        'frequencies = [4.5, 5.0]\ncycles = 4\namplitude = 0.2e-3\ndirection = "both"\nhistory = 1.5',
        fi.SteppedSine([4.5, 5.0], 4, 0.2e-3, direction="both"), 1.5,
    ),
    "random": (
        "psd = [[3.0, 0.05], [20.0, 0.1]]\nduration = 2.0\nseed = 3",
        fi.RandomBase([[3.0, 0.05], [20.0, 0.1]], 2.0, seed=3), 2.0,
    ),
    "random amplitudes": (
        'psd = [[3.0, 0.05], [20.0, 0.1]]\nduration = 2.0\nseed = 3\namplitudes = "random"',
        fi.RandomBase([[3.0, 0.05], [20.0, 0.1]], 2.0, seed=3, amplitudes="random"), 2.0,
    ),
    "shock": (
        'pulse = "half-sine"\nacceleration = 98.0\nduration = 0.011\nhistory = 1.0',
        fi.Shock("half-sine", 98.0, 0.011), 1.0,
    ),
}  # fmt: skip


def text_with(base):
    """The small study with another [base], without a sweep."""
    first, method = UNDRAWN_STUDY.index("[base]"), UNDRAWN_STUDY.index("[method]")
    sweep, output = UNDRAWN_STUDY.index("[sweep]"), UNDRAWN_STUDY.index("[output]")
    return f"{UNDRAWN_STUDY[:first]}[base]\n{base}\n\n{UNDRAWN_STUDY[method:sweep]}{UNDRAWN_STUDY[output:]}"


def of_kind(kind):
    return text_with(f'kind = "{kind.split()[0]}"\n{KINDS[kind][0]}')


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_of_a_study_is_that_of_its_noun(tmp_path, kind):
    study = read_study(of_kind(kind), tmp_path / "study.toml")
    _, noun, history = KINDS[kind]
    time = np.linspace(0.0, history, 101)
    np.testing.assert_array_equal(study.excitation.acceleration(time), noun.acceleration(time))
    assert study.base == noun
    assert study.history_duration == history
    assert study.initial.frame == ("space" if kind == "chirp" else "base")
    # written anew, it is the same study
    other = read_study(study_text(study).replace("seed = 3", "seed =  3"), tmp_path / "study.toml")
    assert (other.base, other.duration, other.start) == (study.base, study.duration, study.start)


@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_study_is_written_anew_with_its_motion(tmp_path, kind):
    study = read_study(of_kind(kind), tmp_path / "study.toml")
    changed = replace(study, duration=0.7)
    assert read_study(study_text(changed), tmp_path / "study.toml").duration == 0.7


def test_a_run_without_a_cycle_says_so_in_its_summary(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(of_kind("random"))
    run_study(fi.load_study(path), tmp_path / "results")
    summary = json.loads((tmp_path / "results" / "summary.json").read_text())
    history = summary["history"]
    assert "frequency" not in history
    assert history["impacts_per_cycle"] is None
    assert history["regime"]["label"] in ("not periodic: the excitation has no cycle", "no impacts")
    assert fi.load(tmp_path / "results").summary["history"]["impacts"] == history["impacts"]


def test_the_kinds_of_sines_and_records_may_be_named(tmp_path):
    sine = "amplitude = 0.2e-3\nfrequency = 5.0"
    named, plain = (read_study(text_with(text), tmp_path / "s.toml") for text in (f'kind = "sine"\n{sine}', sine))
    assert named.base == plain.base


SHOCK = 'kind = "shock"\npulse = "haversine"\nduration = 0.011\nhistory = 1.0\n'


@pytest.mark.parametrize(
    ("base", "words"),
    [
        ('kind = "noise"', "base.kind = 'noise': must be one of 'sine', 'record', 'chirp'"),
        ("kind = 5", "base.kind = 5: must be one of"),
        ('kind = "record"', "base.record: is missing"),
        ('kind = "chirp"\nstart = 4.0\nduration = 2.0\namplitude = 1e-3', "base.stop: is missing"),
        ('kind = "chirp"\nstart = 0.0\nstop = 9.0\nduration = 2.0\namplitude = 1e-3', "base.start = 0.0 Hz"),
        ('kind = "chirp"\nstart = 4.0\nstop = 9.0\nduration = 2.0', "base.amplitude: is missing: one of amplitude"),
        (
            'kind = "chirp"\nstart = 4.0\nstop = 9.0\nduration = 2.0\namplitude = 1.0\nrate = "cubic"',
            "base.rate = 'cubic'",
        ),
        (
            'kind = "random"\npsd = [[3.0, 0.05], [2.0, 0.05]]\nduration = 2.0',
            "base.psd",
        ),
        ('kind = "random"\npsd = "flat"\nduration = 2.0', "base.psd"),
        (
            'kind = "random"\npsd = [[3.0, 0.05], [20.0, 0.1]]\nduration = 2.0\namplitudes = "drawn"',
            "base.amplitudes = 'drawn': must be 'fixed' or 'random'",
        ),
        ('kind = "random"\npsd = [[3.0, 0.05], [20.0, 0.0]]\nduration = 2.0', "base.psd"),
        ('kind = "shock"\npulse = "half-sine"\nacceleration = 98.0\nduration = 0.011', "base.history: is missing"),
        ('kind = "shock"\npulse = "bang"\nacceleration = 98.0\nduration = 0.011\nhistory = 1.0', "base.pulse = 'bang'"),
        ('kind = "stepped-sine"\nfrequencies = []\ncycles = 4\namplitude = 1e-3', "base.frequencies"),
        (
            'kind = "stepped-sine"\nfrequencies = [1]\ncycles = 4\namplitude = 1e-3\nfrequency = 3',
            "base.frequency: ",
        ),
        (
            'kind = "stepped-sine"\nfrequencies = {from = 4, to = 6}\ncycles = 4\namplitude = 1e-3',
            "base.frequencies = {.*}: must be numbers, or points between two of them",
        ),
        ('kind = "dwell"', "base.kind = 'dwell': must be one of 'sine'.*; 'dwell' is 'stepped-sine' here$"),
        ('kind = "Sine sweep"', "'Sine sweep' is 'chirp' here$"),
        ('frequency = 5.0\nacceleration = "2 mm"', "base.acceleration = '2 mm': must have a unit that fits: m/s"),
        ('frequency = 5.0\nacceleration = 0', r"base.acceleration = 0 m/s\^2: must be a finite number > 0 m/s\^2"),
        ('frequency = 5.0\nacceleration = [[4, 1], [6, 2]]', r"base.acceleration = .*: must be a finite number > 0 m"),
        ('frequency = 5.0\nacceleration = "1 g"\namplitude = "1 mm"', "base.amplitude = 'both': must be given alone"),
        ('frequencies = [5, 6]\nacceleration = "1 g"', r'base.frequencies = .*: belongs .*"base.frequency" = \[...\]$'),
        ('amplitude = 1e-3\nfrequency = 5.0\nfade = 1.0', 'base.fade = 1.0 s: belongs to kind = "stepped-sine"'),
        (
            'kind = "chirp"\nstart = 4.0\nstop = 9.0\nacceleration = 1.0\nrate = "1 oct/min"',
            'base.rate = .*: must be one of \'linear\', \'logarithmic\'; .* octaves_per_minute = "1 oct/min"$',
        ),
        (
            'kind = "chirp"\nstart = 4.0\nstop = 9.0\nduration = 1.0\nacceleration = "-1 g"',
            "base.acceleration = -9.80665 m/s\\^2: must be a finite number >= 0 m/s\\^2",
        ),
        (
            'kind = "stepped-sine"\nfrequencies = [5.0]\ncycles = 3\namplitude = -1.0',
            "base.amplitude = -1.0 m: must be a finite number >= 0 m$",
        ),
        ('kind = "shock"\npulse = "half-sine"\nduration = 0.011\nhistory = 1.0', "base.acceleration: is missing"),
        (SHOCK + "acceleration = '1 mm'", "base.acceleration = '1 mm': must have a unit that fits: m/s"),
        (SHOCK + "acceleration = 1.0\nramp = 0.2", 'base.ramp = 0.2: must be left out: it belongs to pulse "trap'),
        (SHOCK + 'acceleration = 1.0\ncompensation = "before"', "base.compensation = .*belongs to compensated = true"),
        (SHOCK + "acceleration = 1.0\nperiod = 0.5", "base.period = 0.5 s: must be left out: it belongs to several"),
        (SHOCK + "acceleration = 1.0\ndelay = 5.0", "base.delay = 5.0 s: must be < 1 s, the history"),
        (SHOCK.replace("haversine", "saw-tooth") + "acceleration = 1.0", "'saw-tooth' is 'terminal-sawtooth' here"),
        ('kind = "chirp"\nstart = "low"\nstop = 9.0\nduration = 2.0\namplitude = 1e-3', "base.start = 'low'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_with_its_key(tmp_path, base, words):
    with pytest.raises(fi.InputError, match=words) as refusal:
        read_study(text_with(base), tmp_path / "study.toml")
    assert "\n" not in str(refusal.value)


def test_words_of_a_dwell_shorter_than_a_cycle_say_how_long_it_is(tmp_path):
    base = 'kind = "stepped-sine"\nfrequencies = [20.0]\nseconds = {}\namplitude = 1e-3'
    words = [read_study(text_with(base.format(n)), tmp_path / "study.toml").history_words for n in (1e-3, 0.5)]
    assert words[0].endswith("up to 20 Hz, up to 0.05 s at a frequency, in whole cycles")
    assert words[1].endswith("up to 20 Hz")


def test_a_sweep_beside_another_motion_is_told_to_go(tmp_path):
    base = 'kind = "chirp"\nstart = 4.0\nstop = 9.0\nduration = 2.0\namplitude = 1e-3\n'
    sweep = "[sweep]\nstart = 4.0\nstop = 6.0\npoints = 9\ncycles = 30\n"
    with pytest.raises(fi.InputError, match=r"^sweep: needs a sine .* is of kind 'chirp'; remove \[sweep\]"):
        read_study(text_with(base + sweep), tmp_path / "study.toml")
    with pytest.raises(fi.InputError, match=r'^sweep\.seconds: belongs to \[base\] kind = "stepped-sine"$'):
        read_study(text_with("amplitude = 1e-3\nfrequency = 5.0\n" + sweep + "seconds = 5\n"), tmp_path / "study.toml")


def test_what_needs_a_sine_names_the_kind(tmp_path):
    text = of_kind("random").replace(
        "[output]", "[sweep]\nstart = 4.0\nstop = 6.0\npoints = 5\ncycles = 30\n\n[output]"
    )
    with pytest.raises(fi.InputError, match=r"needs a sine of the base, and .* is of kind 'random'"):
        read_study(text, tmp_path / "study.toml")
