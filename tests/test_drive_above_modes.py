"""A drive that the kept modes do not follow is warned of, and one that they follow is not."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from builders import REFERENCE, Output, Reduction, SweepPlan, oscillator, paper_study, plan_lines, prepare

import femimpact as fi
from femimpact.cli import app
from femimpact.excitation.remarks import drives_above_modes

FULL = fi.without_impactors(fi.assemble(REFERENCE, elements=20))
FREQUENCIES = fi.solve_modes(FULL, 5).natural_frequency
SAID = "no mode is kept"


def kept(modes):
    return fi.reduce(FULL, modes)


def said(texts):
    return [text for text in texts if SAID in text]


def test_a_reduction_knows_the_first_mode_that_it_leaves_out():
    for modes in (1, 2, 4):
        system = kept(modes)
        # one count of modes more, from another call of the solver
        assert system.first_left_out == pytest.approx(FREQUENCIES[modes], rel=1e-9)
        assert system.highest_kept == pytest.approx(FREQUENCIES[modes - 1], rel=1e-9)
    assert fi.reduce(kept(4), 2).first_left_out == pytest.approx(FREQUENCIES[2], rel=1e-9)
    assert fi.reduce(kept(4), 4).first_left_out == kept(4).first_left_out
    for whole in (FULL, kept(FULL.dofs), oscillator(), fi.reduce(oscillator(), 1)):
        assert whole.first_left_out == whole.highest_kept == np.inf
    balls = fi.reduce(fi.assemble(REFERENCE, elements=20), 2, static_correction=True)
    # an attachment vector is no mode
    assert balls.dofs > 2
    assert balls.highest_kept == pytest.approx(FREQUENCIES[1], rel=1e-9)


def test_a_sine_at_a_mode_that_was_left_out_is_warned_of_with_both_frequencies():
    third = FREQUENCIES[2]
    drives = (fi.Sine(1e-5, third), fi.PointForce("tip", fi.Sine(0.01, third)))
    for drive in drives:
        for method in (fi.EventDriven(), fi.Newmark(1e-4)):
            (text,) = said(fi.integrate(kept(2), drive, method, 0.2).warnings)
            assert f"{third:.4g} Hz" in text
            assert f"kept is at {FREQUENCIES[1]:.4g} Hz" in text
            assert said(fi.integrate(kept(3), drive, method, 0.2).warnings) == []
    # what is missing without it: the resonance, 30 times the quasi-static stress of both modes
    stress = [
        fi.integrate(kept(n), drives[0], fi.EventDriven(), 5.0).largest("root.surface_stress").value for n in (2, 3)
    ]
    assert abs(stress[1]) > 8 * abs(stress[0])


@pytest.mark.parametrize("modes", [1, 2, 3])
def test_ordinary_drives_are_not_warned_of(modes):
    # at and beyond the first resonance, of which one mode is enough
    for frequency in (4.0, 5.0, FREQUENCIES[0], 6.0, 10.0):
        assert said(fi.integrate(kept(modes), fi.Sine(1e-4, frequency), fi.EventDriven(), 1.0).warnings) == []
    curve = fi.frequency_sweep(kept(modes), 1e-4, np.linspace(4, 6, 5), fi.EventDriven(), 24)
    assert said(curve.warnings) == []


def test_modes_close_together_are_distinguished():
    # two equal oscillators, weakly coupled
    K = [[100.0, -2.0], [-2.0, 100.0]]
    pair = fi.System.from_matrices(np.eye(2), 0.01 * np.eye(2), K, points={"mass": [1.0, 0.0]})
    one = fi.reduce(pair, 1)
    first, second = one.highest_kept, one.first_left_out
    assert second / first == pytest.approx(np.sqrt(102 / 98), rel=1e-9)
    for frequency, warned in ((first, False), (second, True), (0.25 * first + 0.75 * second, True)):
        assert bool(said(fi.integrate(one, fi.Sine(1e-3, frequency), fi.EventDriven(), 2.0).warnings)) == warned


def test_systems_that_leave_nothing_out_are_driven_at_any_frequency():
    for system in (oscillator(100.0, 2.0), fi.reduce(oscillator(100.0, 2.0), 1)):
        assert said(fi.integrate(system, fi.Sine(1e-4, 50.0), fi.EventDriven(), 1.0).warnings) == []
    assert said(fi.integrate(FULL, fi.Sine(1e-6, 500.0), fi.Newmark(1e-4), 0.1).warnings) == []


def test_a_sweep_names_how_many_frequencies_are_above():
    curve = fi.frequency_sweep(kept(2), 1e-6, [20.0, 60.0, 150.0, FREQUENCIES[2]], fi.EventDriven(), 24)
    (text,) = said(curve.warnings)
    assert f"up to {FREQUENCIES[2]:.4g} Hz, at 2 of 4 frequencies" in text
    assert f"{FREQUENCIES[1]:.4g} Hz" in text


def record(*parts, duration=2.0, interval=2e-4):
    """Sines of frequencies (Hz) and amplitudes (m/s^2), faded in and out."""
    t = interval * np.arange(round(duration / interval) + 1)
    fade = np.clip(np.minimum(t, t[-1] - t) / 0.2, 0.0, 1.0)
    return fi.RecordedBase(fade * sum(a * np.sin(2 * np.pi * f * t) for f, a in parts), interval)


def test_a_record_is_judged_by_the_energy_of_its_spectrum():
    third = FREQUENCIES[2]
    # half of the energy at each of two frequencies, well apart
    (text,) = said(fi.integrate(kept(2), record((5.0, 1.0), (third, 1.0)), fi.EventDriven(), 0.5).warnings)
    share = float(re.match(r"([\d.]+) % of the energy", text)[1])
    assert share == pytest.approx(50.0, abs=1.0)
    # up to 10 % above it the highest mode kept is nearer than the next one
    assert f"above {1.1 * FREQUENCIES[1]:.4g} Hz" in text
    assert f"kept is at {FREQUENCIES[1]:.4g} Hz" in text
    # a tenth of the amplitude is a hundredth of the energy
    for ratio, warned in ((0.07, False), (0.15, True)):
        base = record((5.0, 1.0), (third, ratio))
        for method in (fi.EventDriven(), fi.Newmark(2e-4)):
            assert bool(said(fi.integrate(kept(2), base, method, 0.5).warnings)) == warned
    assert said(fi.integrate(kept(3), record((third, 1.0)), fi.EventDriven(), 0.5).warnings) == []


def test_an_offset_and_a_drift_are_no_energy_of_the_spectrum():
    third, base = FREQUENCIES[2], record((5.0, 1.0), (FREQUENCIES[2], 0.3))
    t = base.interval * np.arange(base.samples.size)
    moved = replace(base, samples=base.samples + 30.0 + 20.0 * t)
    plain, offset = (said(fi.integrate(kept(2), b, fi.EventDriven(), 0.5).warnings) for b in (base, moved))
    assert plain == offset
    assert len(plain) == 1
    # nothing but a line has no spectrum
    straight = fi.RecordedBase(1.0 + t, base.interval)
    assert said(fi.integrate(kept(2), straight, fi.EventDriven(), 0.5).warnings) == []
    assert third > 200.0


def study(**changes):
    paper = paper_study()
    quiet = Output(frames=0, figures=False, paraview=False, movie=False)
    return replace(paper, output=quiet, method={"name": "event-driven"}, **changes)


def test_a_study_says_it_before_and_after_its_run(tmp_path, capsys):
    base = replace(paper_study().base, amplitude=1e-6, frequency=round(FREQUENCIES[2], 3))
    plan = SweepPlan(100.0, 230.0, points=4, cycles=24)
    fast = study(base=base, duration=0.5, sweep=plan, reduction=Reduction(2))
    lines = said(plan_lines(fast))
    assert len(lines) == 2
    assert lines[0].startswith("warning: the drive is at")
    assert lines[1].startswith("warning: sweep.stop: the drive is at")
    assert said(prepare(fast, ("modes",)).warnings) == []
    results = fi.run_study(fast, tmp_path / "out")
    # once of the history, and of the sweep as the study was told and of each curve
    told = said(results.summary["warnings"])
    assert [text for text in told if "history" in text] == []
    assert sum(text.startswith("the drive is at") for text in told) == 1
    slow = study(sweep=None, reduction=Reduction(2))
    assert said(plan_lines(slow)) == []
    path = tmp_path / "out" / "study.toml"
    app(["check", str(path)], result_action="return_value")
    assert SAID in capsys.readouterr().out


def test_of_a_band_the_share_above_the_modes_is_named():
    # kept up to 100 Hz, the next mode at 200 Hz: the limit is 110 Hz
    flat = fi.RandomBase([[10.0, 1.0], [210.0, 1.0]], 10.0)
    octaves = fi.Chirp(55.0, 220.0, 2.0, acceleration=1.0, kind="logarithmic")
    for drive, left_out, words in (
        (fi.Chirp(60.0, 160.0, 2.0, acceleration=1.0), 200.0, "50 % of the time of the chirp is above 110 Hz"),
        (octaves, 200.0, "50 % of the time"),
        # of 2001 lines 1000 are above
        (flat, 200.0, "50 % of the mean square of the random motion is above 110 Hz"),
        (fi.Chirp(10.0, 100.0, 2.0, acceleration=1.0), 200.0, ""),
        (flat, float("inf"), ""),
    ):
        ((*_, text),) = drives_above_modes(drive, 100.0, left_out)
        assert words in text
        assert bool(text) == bool(words)
