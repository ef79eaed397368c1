"""A motion of the base from a logger's file: what is read, what is removed, and what is said of it."""

from __future__ import annotations

import math
import re

import matplotlib.figure
import numpy as np
import pytest

import femimpact as fi
from femimpact.excitation.remarks import is_pulse

G = 9.80665
RATE = 200.0


def written(path, time, values, *, mark=",", header="time (s),acceleration (g)\n", point="."):
    rows = [f"{t:.5f}{mark}{a:.9g}".replace(".", point) for t, a in zip(time, values, strict=True)]
    path.write_text(header + "\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def record():
    """Time (s) and acceleration (g): a burst that ends as it begins, on an offset and a drift."""
    time = np.arange(1001) / RATE
    return time, 0.1 * np.cos(2 * np.pi * 5.0 * time), 0.012 + 0.003 * time


@pytest.mark.parametrize(
    ("mark", "header", "point"),
    [(",", "t,a\n", "."), (";", "Logger 7\n\n# serial 12\nt;a\n", ","), ("\t", "", "."), ("  ", "t a\n", ".")],
)
def test_a_file_is_read_back_as_it_was_written(tmp_path, record, mark, header, point):
    time, burst, _ = record
    path = written(tmp_path / "a.csv", time + 3.0, burst, mark=mark, header=header, point=point)
    base = fi.RecordedBase.from_csv(path, scale=G)
    # nine digits are written
    np.testing.assert_allclose(base.samples, G * burst, rtol=0, atol=1e-9)
    assert base.interval == pytest.approx(1 / RATE, rel=1e-12)
    assert base.initial_velocity == 0.0


def test_columns_go_by_number_and_by_name(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text('n,"a (g)",t,b\n1,0.5,0.0,9\n2,0.25,0.1,9\n', encoding="utf-8")
    for columns in ((2, 1), ("t", "a (g)"), ["t", 1]):
        base = fi.RecordedBase.from_csv(path, columns=columns)
        assert base.samples.tolist() == [0.5 * 9.80665, 0.25 * 9.80665]
        assert base.interval == 0.1


def test_rounded_times_have_the_interval_of_the_whole_record(tmp_path):
    time = np.arange(2049) / 2048.0
    path = tmp_path / "a.csv"
    path.write_text("\n".join(f"{t:.4f},0.5" for t in time), encoding="utf-8")
    # 4 decimals of 4.9e-4 s: steps look like 4e-4 and 5e-4 s
    assert fi.RecordedBase.from_csv(path).interval == pytest.approx(1 / 2048, rel=1e-4)


def test_what_is_removed_is_the_offset_or_the_line_and_the_base_ends_where_it_began(tmp_path, record):
    time, burst, drift = record
    offset = written(tmp_path / "o.csv", time, burst + 0.012)
    sloped = written(tmp_path / "s.csv", time, burst + drift)
    line = np.polynomial.Polynomial.fit(time, burst, 1)(time)
    for path, detrend, left in ((offset, "mean", burst - burst.mean()), (sloped, "line", burst - line)):
        base = fi.RecordedBase.from_csv(path, scale=G, detrend=detrend)
        np.testing.assert_allclose(base.samples, G * left, rtol=0, atol=1e-7)
        # exact integrals: to rounding of a sum of 1000 terms
        assert abs(base.displacement(time[-1])) < 1e-12
        assert base.amplitude < 0.1
    # as it is, the offset moves the base by a t^2/2
    kept = fi.RecordedBase.from_csv(offset, scale=G)
    assert kept.displacement(time[-1]) == pytest.approx(G * 0.012 * time[-1] ** 2 / 2, rel=0.1)


def test_the_motion_relative_to_the_base_does_not_depend_on_the_speed_at_which_it_begins(tmp_path, record, small):
    time, burst, _ = record
    path = written(tmp_path / "a.csv", time, burst - burst.mean())
    bases = [fi.RecordedBase.from_csv(path, scale=G, detrend=name) for name in ("none", "mean")]
    bare = fi.without_impactors(small)
    one, other = (fi.integrate(bare, base, fi.EventDriven(), 2.0)["tip"] for base in bases)
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-7 * np.abs(one).max())


@pytest.mark.parametrize(
    ("text", "more", "words"),
    [
        ("t,a\n0,1\n0.1,x\n", {}, r"line 3, column 1: a text is no finite number"),
        ("t,a\n0,1\n0.1,nan\n", {}, r"line 3, column 1: (a text|a number) is no finite number"),
        ("0,1\n0.1\n", {}, r"line 2, column 1: nothing is no finite number"),
        (
            "0,1\n0.1,2\n0.3,3\n",
            {},
            r"line 2: the time is uneven: a step of 0\.1 s, and 0\.15 s is usual; resample it first",
        ),
        ("0,1\n0.1,2\n0.2,2\n0.2,3\n", {}, r"line 4: the time does not rise: a step of 0 s"),
        ("0.1,1\n0,2\n", {}, r"line 2: the time does not rise"),
        ("t,a\n0,1\n", {}, r"must hold 2 or more rows"),
        (
            "t\n0\n0.1\n",
            {},
            r"columns = 1: must be one of the columns of numbers of a\.csv, which are from line 2 on: \['t'\]",
        ),
        ("", {}, r"path = .*must hold rows of numbers, in columns: it is empty"),
        ("a,b c\n", {}, r"must hold rows of numbers, in columns: it begins at line 1 with 2 cells: a text, a text"),
        (
            "t,a\n0,1\n0.1,2\n",
            {"columns": ("t", "acc")},
            r"columns = 'acc': must be one of the columns .* from line 2 on: \['t', 'a'\]",
        ),
        ("0,1\n0.1,2\n", {"columns": (0,)}, r"columns = .*must be two"),
        ("0,1\n0.1,2\n", {"detrend": "linear"}, r"detrend = 'linear': must be 'none' or 'mean' or 'line'"),
        ("0,1\n0.1,2\n", {"scale": 0.0}, r"scale = 0\.0: must not be 0"),
        ("0,1\n0.1,2\n", {"scale": math.nan}, r"scale = nan: must be a finite number"),
    ],
)
def test_a_bad_file_is_one_clear_line(tmp_path, text, more, words):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(fi.InputError, match=words) as told:
        fi.RecordedBase.from_csv(path, **more)
    assert len(str(told.value).splitlines()) == 1


def test_a_file_that_is_not_there_or_no_text_is_one_clear_line(tmp_path):
    (tmp_path / "b.csv").write_bytes(b"\xff\x00\x00\x81")
    for path, words in (
        (tmp_path / "a.csv", "No such file"),
        (tmp_path, "directory"),
        (tmp_path / "b.csv", "is no text"),
    ):
        with pytest.raises(fi.InputError, match=words):
            fi.RecordedBase.from_csv(path)


def test_a_base_that_travels_further_than_half_the_beam_is_warned_of_with_the_mean_acceleration(small, record):
    _, burst, drift = record
    far = fi.RecordedBase(G * (burst + drift), interval=1 / RATE)
    run = fi.integrate(fi.without_impactors(small), far, fi.EventDriven(), 1.0)
    mean = float(np.mean(far.samples))
    (told,) = [text for text in run.warnings if "the base moves" in text]
    assert f"up to {far.amplitude:.4g} m, beside a beam of 0.2303 m" in told
    assert f"{mean:.3g} m/s^2; remove offset and drift" in told
    near = fi.RecordedBase(G * (burst - burst.mean()), interval=1 / RATE)
    assert near.amplitude < 0.5 * small.length
    (other,) = fi.integrate(fi.without_impactors(small), near, fi.EventDriven(), 1.0).warnings
    assert other.startswith("the record begins in motion")


def test_a_sine_that_travels_further_than_half_the_beam_is_warned_of_in_a_run_and_in_a_sweep(small):
    bare = fi.without_impactors(small)
    for amplitude, said in ((0.2, True), (0.02, False)):
        run = fi.integrate(bare, fi.Sine(amplitude, 5.0), fi.EventDriven(), 1.0)
        curve = fi.frequency_sweep(bare, amplitude, [5.0, 6.0], fi.EventDriven(), cycles=24)
        for told in (run.warnings, curve.warnings):
            assert any("is the amplitude of the base in metres?" in text for text in told) == said


def test_a_structure_without_a_length_has_no_measure_of_how_far_is_far():
    oscillator = fi.System.from_matrices([[1.0]], [[0.1]], [[40.0]], points={"tip": [1.0]})
    assert oscillator.length == 0.0
    assert fi.integrate(oscillator, fi.Sine(10.0, 1.0), fi.EventDriven(), 1.0).warnings == ()


@pytest.mark.parametrize("method", [fi.EventDriven(), fi.Newmark(5e-4)])
def test_a_run_longer_than_its_record_has_a_note(small, record, method):
    time, burst, _ = record
    base = fi.RecordedBase(G * burst, interval=1 / RATE)
    bare = fi.without_impactors(small)

    def told(duration):
        return [text for text in fi.integrate(bare, base, method, duration).notes if "the record" in text]

    assert told(time[-1]) == []
    (text,) = told(6.0)
    assert "the run ends at 6 s, the record at 5 s" in text
    assert f"{float(base.velocity(5.0)):.3g} m/s" in text


def test_no_record_accelerates_after_its_end():
    """Whatever the rounding of its duration over its interval: one in twenty went on with its last slope."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        count, interval = int(rng.integers(3, 400)), float(rng.uniform(1e-4, 0.1))
        base = fi.RecordedBase(rng.normal(size=count), interval)
        after = base.duration * np.array([1.0, 1.5, 2.0])
        assert np.all(base.acceleration(after) == 0.0)
        assert np.ptp(base.velocity(after)) == 0.0


def test_figures_of_a_run_on_a_record_name_seconds_and_no_cycles(small, record):
    _, burst, _ = record
    base = fi.RecordedBase(G * burst, interval=1 / RATE)
    run = fi.integrate(small, base, fi.EventDriven(), 2.0)
    axes = fi.figures.motion(run, cycles=4, figure=matplotlib.figure.Figure())
    assert axes[0, 1].get_xlabel() == f"time (s), last {4 / base.frequency:.3g} s"
    sine = fi.integrate(small, fi.Sine(1e-4, 5.0), fi.EventDriven(), 2.0)
    axes = fi.figures.motion(sine, cycles=4, figure=matplotlib.figure.Figure())
    assert axes[0, 1].get_xlabel() == "time (s), last 4 cycles at 5 Hz"


def test_a_column_of_zeros_is_no_record(tmp_path, record):
    time, _, _ = record
    path = written(tmp_path / "a.csv", time, 0.0 * time)
    with pytest.raises(fi.InputError, match="the second holds zeros only"):
        fi.RecordedBase.from_csv(path)


@pytest.mark.parametrize("cycles", [2, 2.4, 3.5, 17, 40.5])
@pytest.mark.parametrize("trend", [(0.0, 0.0), (1e3, 0.0), (0.0, 1e3), (-5.0, 40.0)])
def test_offset_and_drift_are_no_cycle(cycles, trend):
    # the sine's line of the spectrum, or one of the two beside it
    n, interval = 1000, 1e-3
    t = interval * np.arange(n)
    offset, drift = trend
    for phase in (0.0, 0.7, np.pi / 2):
        base = fi.RecordedBase(np.sin(2 * np.pi * cycles * t + phase) + offset + drift * t, interval)
        assert base.frequency == pytest.approx(cycles, abs=(1.0 if cycles % 1 else 1e-9) / (n * interval))


@pytest.mark.parametrize("samples", [np.ones(50), np.linspace(-3.0, 8.0, 50), [0.0, 1.0], np.zeros(50)])
def test_a_straight_record_is_one_cycle(samples):
    assert fi.RecordedBase(samples, 0.1).frequency == pytest.approx(1.0 / (0.1 * len(samples)))


# ---- pulses and drift ----------------------------------------------------------------------------------


WIDTH = 0.011


def pulse(duration, start, interval=1e-4, shape="half-sine", noise=0.0):
    """10 g for 11 ms in a record of a duration (s), with noise in g."""
    t = interval * np.arange(round(duration / interval) + 1)
    share = np.clip((t - start) / WIDTH, 0.0, 1.0)
    a = {"half-sine": np.sin(np.pi * share), "haversine": np.sin(np.pi * share) ** 2}[shape]
    return fi.RecordedBase(G * (10 * a + noise * np.random.default_rng(3).standard_normal(t.size)), interval)


@pytest.mark.parametrize("shape", ["half-sine", "haversine"])
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("duration", [0.011, 0.015, 0.03, 0.06, 0.5, 5.0])
def test_a_pulse_is_no_drift_wherever_it_stands_in_its_record(duration, noise, shape):
    for start in (0.0, 0.5 * (duration - WIDTH), duration - WIDTH):
        for sign in (1.0, -1.0):
            assert is_pulse(sign * pulse(duration, start, shape=shape, noise=noise).samples)


@pytest.mark.parametrize("duration", [0.5, 5.0, 40.0])
def test_offset_and_drift_are_no_pulse_whatever_oscillates_on_them(duration):
    t = 1e-3 * np.arange(round(duration / 1e-3) + 1)
    noise = np.random.default_rng(5).standard_normal(t.size)
    trends = (
        0.0,
        0.012,
        -0.01 + 0.02 * t / duration,
        0.012 + 0.003 * t,
        0.01 * t / duration,
        -0.01 * (t / duration) ** 2,
    )
    for motion in (0.0, 0.02 * np.sin(31.4 * t + 0.3), 0.1 * np.cos(10 * np.pi * t), np.cos(46.0 * t), 0.02 * noise):
        for trend in trends:
            assert not is_pulse(np.asarray(motion + trend + 0.0 * t))


def test_a_pulse_has_a_note_of_its_change_of_velocity_and_no_advice_to_remove_it(small):
    bare, base = fi.without_impactors(small), pulse(5.0, 0.1)
    assert base.amplitude > small.length
    run = fi.integrate(bare, base, fi.EventDriven(), 0.5)
    assert not [text for text in run.warnings if "remove" in text or "the base moves" in text]
    (note,) = [text for text in run.notes if "pulse" in text]
    # 2/pi of 10 g for 11 ms; the line through 110 samples
    change = 10 * G * WIDTH * 2 / np.pi
    assert f"{change:.3g} m/s for good" in note


@pytest.mark.parametrize("kind", ["mean", "line"])
@pytest.mark.parametrize("start", [0.0, 0.2])
def test_a_pulse_without_its_mean_is_warned_of_and_its_peak_is_wrong(small, tmp_path, kind, start):
    bare, base = fi.without_impactors(small), pulse(0.5, start, noise=0.01)
    time = base.interval * np.arange(base.samples.size)
    path = written(tmp_path / "a.csv", time, base.samples / G)
    kept, removed = (fi.RecordedBase.from_csv(path, scale=G, detrend=name) for name in ("none", kind))
    runs = [fi.integrate(bare, b, fi.EventDriven(), 0.5, fi.Recorder(("tip",))) for b in (kept, removed)]
    told = [[text for text in run.warnings if "without its mean" in text] for run in runs]
    assert [len(texts) for texts in told] == [0, 1]
    # 2/pi of 10 g for 11 ms, whatever its noise adds
    change = float(re.search(r"velocity of the base by ([\d.]+) m/s", told[1][0])[1])
    assert change == pytest.approx(10 * G * WIDTH * 2 / np.pi, rel=0.1)
    # the level that is taken off, 0.14 g, acts on the beam before the pulse and after it
    right, wrong = (abs(run.largest("root.surface_stress").value) for run in runs)
    assert abs(wrong / right - 1.0) > 1e-3


def test_what_is_rightly_removed_of_a_drift_is_not_warned_of(small, tmp_path, record):
    bare, (time, burst, drift) = fi.without_impactors(small), record
    path = written(tmp_path / "a.csv", time, burst + drift)
    for kind in ("none", "mean", "line"):
        run = fi.integrate(bare, fi.RecordedBase.from_csv(path, scale=G, detrend=kind), fi.EventDriven(), 1.0)
        assert not [text for text in (*run.warnings, *run.notes) if "pulse" in text]


def test_long_after_its_end_the_base_moves_on_uniformly_and_a_time_beyond_sense_is_refused():
    base = fi.RecordedBase([0.0, 2.0, -1.0], 0.1, initial_velocity=0.3)
    end, late = base.duration, 1e12
    speed = float(base.velocity(end))
    assert base.velocity(late) == speed
    assert base.acceleration(late) == 0.0
    # the place at the end is lost in the rounding of the way since then
    assert float(base.displacement(late)) == pytest.approx(speed * (late - end), rel=1e-12)
    for drive in (base, fi.Sine(1e-3, 5.0)):
        with pytest.raises(fi.InputError, match=r"^time = 1e.300 s: must be finite numbers from"):
            drive.displacement(1e300)
