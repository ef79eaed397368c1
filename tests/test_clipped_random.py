"""Clipped random motions, their kurtosis and crest, and a high-pass for records in study files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import load_study, read_study, same_study, study_text

import femimpact as fi
from femimpact.excitation.remarks import motion_notes, motion_warnings

FLAT = ((20.0, 1.0), (200.0, 1.0))
ONE_LINE = ((9.9, 1.0), (10.1, 1.0))


def test_one_line_has_the_kurtosis_and_crest_of_a_sine() -> None:
    base = fi.RandomBase(ONE_LINE, duration=1.0)
    # the crest is read at 64 times in a cycle: within (pi/64)^2/2
    assert base.kurtosis == pytest.approx(1.5, rel=1e-12)
    assert base.crest == pytest.approx(math.sqrt(2.0), rel=1.3e-3)
    assert base.lost_share == pytest.approx(0.0, abs=1e-14)


def test_a_clipped_sine_loses_what_its_describing_function_says() -> None:
    base = fi.RandomBase(ONE_LINE, duration=1.0, clip=1.2)
    share = 1.2 / math.sqrt(2.0)
    left = 2.0 / math.pi * (math.asin(share) + share * math.sqrt(1.0 - share**2))
    # of 64 samples in a cycle
    assert base.lost_share == pytest.approx(1.0 - left**2, rel=2e-3)
    assert np.abs(base.samples).max() == pytest.approx(1.2 * base.rms, rel=1e-12)


@pytest.mark.parametrize("clip", [2.0, 3.0])
def test_clipping_a_gaussian_motion_scales_it_as_bussgang_says(clip: float) -> None:
    whole = fi.RandomBase(FLAT, duration=40.0, seed=5, amplitudes="random")
    cut = fi.RandomBase(FLAT, duration=40.0, seed=5, amplitudes="random", clip=clip)
    gain = float(whole.samples @ cut.samples / (whole.samples @ whole.samples))
    # 2 B T = 14,400 independent values: those beyond the limit are counted to a tenth, of which four
    exact = math.erf(clip / math.sqrt(2.0))
    assert gain == pytest.approx(exact, abs=0.4 * (1.0 - exact))
    assert whole.kurtosis == pytest.approx(3.0, abs=4.0 * math.sqrt(24.0 / 14_400))
    assert cut.kurtosis < whole.kurtosis
    assert cut.crest < whole.crest
    assert 0.0 < cut.lost_share < 1.0 - gain**2 + 1e-3


def test_a_clipped_motion_is_driven_as_the_record_of_its_samples() -> None:
    base = fi.RandomBase(FLAT, duration=2.0, seed=1, clip=3.0)
    samples = np.append(base.samples, base.samples[0])
    record = fi.RecordedBase(samples, 2.0 / (samples.size - 1)).returning()
    t = np.linspace(0.0, 1.999, 5001)
    for name in ("displacement", "velocity", "acceleration"):
        exact = getattr(record, name)(t)
        # the record begins in its place, the motion goes about it
        exact = exact + base.displacement(0.0) if name == "displacement" else exact
        np.testing.assert_allclose(getattr(base, name)(t), exact, rtol=0.0, atol=1e-11 * np.abs(exact).max())
    # the mean is gone, and the base comes back to where it was
    assert abs(base.samples.mean()) < 1e-13 * base.rms
    assert abs(base.displacement(2.0) - base.displacement(0.0)) < 1e-9 * np.abs(base.displacement(t)).max()


@pytest.mark.parametrize("clip", [1.5, 2.0, 3.0])
@pytest.mark.parametrize("psd", [FLAT, ((5.0, 0.1), (100.0, 0.1)), ((50.0, 1.0), (60.0, 1.0))])
def test_a_clipped_motion_goes_no_further_than_an_unclipped_one(psd: Any, clip: float) -> None:
    whole, base = (fi.RandomBase(psd, 20.0, seed=3, amplitudes="random", clip=one) for one in (None, clip))
    assert np.abs(base.acceleration(np.linspace(0.0, 19.99, 100_001))).max() < clip * whole.rms * (1.0 + 1e-3)
    lines = 2.0 / base.samples.size * np.abs(np.fft.rfft(base.samples))
    first, last = whole._numbers
    assert lines[:first].max() < 1e-12 * whole.rms
    # all lines are scaled by one number, and scattered about it
    share = math.sqrt(1.0 - base.lost_share)
    assert share > math.erf(clip / math.sqrt(2.0)) - 0.03
    left = float(lines[first : last + 1] @ whole.lines[1] / (whole.lines[1] @ whole.lines[1]))
    assert left == pytest.approx(share, abs=0.02)
    # displacement comes from the slow end of the band; the base moves on from the same place
    far = base.amplitude / whole.amplitude
    assert 0.5 < far < 1.1


def test_a_fade_of_a_clipped_motion_leaves_the_base_in_its_place() -> None:
    whole, base = (fi.RandomBase(FLAT, 4.0, seed=2, clip=clip, fade=0.5) for clip in (None, 3.0))
    assert base.amplitude < 1.1 * whole.amplitude
    assert motion_warnings(base, 0.01) == motion_warnings(whole, 0.01)


def test_what_clipping_takes_is_said() -> None:
    base = fi.RandomBase(FLAT, duration=2.0, seed=1, clip=2.5)
    (note,) = motion_notes(base, 0.2, 2.0)
    assert note.startswith("the random motion is clipped at 2.5 root mean squares: ")
    assert f"{100.0 * base.lost_share:.3g} % of the mean square of its density is lost" in note
    assert f"kurtosis is {base.kurtosis:.4g}" in note
    assert motion_notes(fi.RandomBase(FLAT, duration=2.0), 0.2, 2.0) == ()
    assert motion_notes(base + fi.Shock("half-sine", 3.0, 0.011), 0.2, 2.0) == (note,)
    assert motion_warnings(base, 0.2) == ()


def test_a_fade_of_a_random_motion_multiplies_its_displacement() -> None:
    whole, base = (fi.RandomBase(FLAT, duration=2.0, seed=1, fade=fade) for fade in (0.0, 0.3))
    t = np.linspace(0.0, 2.0, 4001)
    window = np.sin(0.5 * np.pi * np.clip(np.minimum(t, 2.0 - t), 0.0, 0.3) / 0.3) ** 2
    exact = whole.displacement(t)
    np.testing.assert_allclose(base.displacement(t), window * exact, atol=1e-9 * np.abs(exact).max())


def test_a_record_of_a_study_file_takes_a_high_pass(tmp_path: Path) -> None:
    t = np.arange(4000) * 1e-3
    drift, wave = 0.3 + 0.5 * np.sin(2.0 * np.pi * 0.05 * t), np.sin(2.0 * np.pi * 20.0 * t)
    rows = "\n".join(f"{a!r},{b!r}" for a, b in zip(t.tolist(), (drift + wave).tolist(), strict=True))
    (tmp_path / "shaker.csv").write_text(rows, encoding="utf-8")
    text = Path(__file__).parent.parent.joinpath("femimpact/app/paper.toml").read_text(encoding="utf-8")
    path = tmp_path / "study.toml"
    path.write_text(
        text[: text.index("[base]")] + '[base]\nrecord = "shaker.csv"\nhigh_pass = "2 Hz"\n', encoding="utf-8"
    )
    study = load_study(path)
    base: Any = study.base
    inner = slice(1000, 3000)
    # a Butterworth filter of order 4 forwards and backwards: (0.05/2)^8 of the drift, 1 - (2/20)^8 of the wave
    np.testing.assert_allclose(base.samples[inner], wave[inner], atol=2e-3)
    again = fi.RecordedBase.from_csv(tmp_path / "shaker.csv", high_pass=2.0)
    np.testing.assert_array_equal(again.samples, base.samples)
    # the base comes back to its place
    assert abs(base.displacement(base.duration)) < 1e-12
    assert same_study(read_study(study_text(study), path), study)
    with pytest.raises(fi.InputError, match=r"high_pass = 600\.0 Hz: must be a finite number > 0 and < 500 Hz"):
        fi.RecordedBase.from_csv(tmp_path / "shaker.csv", high_pass=600.0)
