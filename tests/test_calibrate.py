"""Parameters from measured peaks: oscillators in closed form, what peaks cannot tell, and damaged input."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from builders import oscillator
from scipy.stats import t

import femimpact as fi
from femimpact.app.parametric.measured_peaks import _median_and_scale
from femimpact.errors import InputError

LEVEL, NATURAL, RATIO = 1e-3, 5.0, 0.05
FREQUENCIES = np.linspace(4.0, 6.0, 9)
DRIVE: dict[str, Any] = {"excitation": fi.Sine(LEVEL, 5.0), "cycles": 60, "starts": 2, "at": None}
"""After 40 cycles a transient of e^(-2 pi 0.05 40) = 3e-6 is left at a damping ratio of 5 %."""


def oscillator_of(natural: float, ratio: float) -> fi.System:
    """An oscillator of a natural frequency (Hz) and a damping ratio."""
    omega = 2.0 * np.pi * natural
    return oscillator(omega**2, 2.0 * ratio * omega)


def damped(ratio: float) -> fi.System:
    """An oscillator of 5 Hz."""
    return oscillator_of(NATURAL, ratio)


def relative_peak(frequency: Any, natural: Any = NATURAL, ratio: Any = RATIO) -> Any:
    """Steady peak (m) relative to the base, r^2/|1 - r^2 + 2 i zeta r| of the base's amplitude."""
    r = frequency / natural
    return LEVEL * r**2 / np.abs(1.0 - r**2 + 2j * ratio * r)


PEAKS = relative_peak(FREQUENCIES)
BOUNDS = {"natural": (4.7, 5.3), "ratio": (0.03, 0.07)}


def test_the_posterior_of_one_parameter_is_that_of_the_closed_form() -> None:
    found = fi.calibrate(damped, FREQUENCIES, PEAKS, {"ratio": (0.03, 0.07)}, **DRIVE)
    # no spread of starts: 2 % of noise and 3 % of the interpolation are left
    sigma = np.hypot(0.02, 0.03)
    ratio = np.linspace(0.03, 0.07, 4001)
    misfit = np.log(PEAKS[:, None] / relative_peak(FREQUENCIES[:, None], ratio=ratio)) / sigma
    share = np.cumsum(np.exp(t.logpdf(misfit, 4).sum(axis=0)))
    expected = np.interp([0.05, 0.5, 0.95], share / share[-1], ratio)
    (one,) = found.parameters
    # ln(peak) is bent by at most h^2/(8 zeta^2) = 0.0015 between 13 values of the ratio: 0.04 of sigma
    assert [one.low, one.median, one.high] == pytest.approx(expected, abs=0.05 * (expected[2] - expected[0]))
    assert float(found.posterior.integrate("ratio")) == pytest.approx(1.0, rel=1e-12)
    # without noise nothing is left but the interpolation
    assert found.misfit < 0.1
    assert found.notes == ()


def test_two_parameters_are_found_together_and_in_any_order_of_the_peaks() -> None:
    found = fi.calibrate(oscillator_of, FREQUENCIES, PEAKS, BOUNDS, **DRIVE)
    for one, truth in zip(found.parameters, (NATURAL, RATIO), strict=True):
        assert one.low < truth < one.high
        assert one.bound == ""
    order = np.random.default_rng(1).permutation(FREQUENCIES.size)
    other = fi.calibrate(oscillator_of, FREQUENCIES[order], PEAKS[order], BOUNDS, **DRIVE)
    # sums of nine terms in another order
    assert [one.median for one in other.parameters] == pytest.approx([one.median for one in found.parameters], rel=1e-9)
    assert other.fitted == pytest.approx(found.fitted[order], rel=1e-9)
    assert str(found).count("90 % interval") == 2


@pytest.mark.parametrize("starts", [5, 8, 20])
def test_a_measured_peak_scatters_about_the_median_of_starts_as_the_scale_says(starts: int) -> None:
    """Of one more draw and the median of n: the scale holds the scatter of both."""
    draws = np.random.default_rng(starts).standard_normal((40_000, starts + 1))
    scatter = np.var(draws[:, 0] - np.median(draws[:, 1:], axis=1))
    # the mean range of the starts, of which the scale estimates their spread
    ends = 0.5 * float(np.mean(np.ptp(draws[:, 1:], axis=1)))
    axes = {"ratio": [0.03, 0.05, 0.07], "base.frequency": [5.0]}
    values = {"peak": 1.0, "peak_low": np.exp(-0.1 * ends), "peak_high": np.exp(0.1 * ends)}
    cases = {name: (tuple(axes), np.full((3, 1), value)) for name, value in values.items()}
    dataset = xarray.Dataset(cases, axes, {"starts": starts})
    median, scale = _median_and_scale(dataset, ["ratio"], 0.02)
    np.testing.assert_allclose(median, 0.0)
    # pi/2n is the variance of a median of many, 0.02 of 1.3 too much of 5; pi/n would be 0.3 more
    np.testing.assert_allclose((scale**2 - 0.02**2 - 0.03**2) / 0.1**2, scatter, rtol=0.04)


def test_peaks_that_are_measured_twice_count_twice() -> None:
    once = fi.calibrate(damped, FREQUENCIES, PEAKS, {"ratio": (0.03, 0.07)}, **DRIVE).parameters[0]
    twice = fi.calibrate(
        damped, np.tile(FREQUENCIES, 2), np.tile(PEAKS, 2), {"ratio": (0.03, 0.07)}, **DRIVE
    ).parameters[0]
    # twice the information: the width falls by the square root of two for a density that is nearly normal
    assert (twice.high - twice.low) / (once.high - once.low) == pytest.approx(2**-0.5, rel=0.06)


def test_what_the_peaks_cannot_tell_is_said() -> None:
    def scaled(factor: float, ratio: float) -> fi.System:
        # at resonance the peak is that of factor/ratio alone
        return oscillator_of(NATURAL, ratio / factor)

    bounds = {"factor": (0.5, 2.0), "ratio": (0.03, 0.07)}
    found = fi.calibrate(scaled, [4.95, 5.0, 5.05], relative_peak(np.array([4.95, 5.0, 5.05])), bounds, **DRIVE)
    assert found.correlation > 0.9
    assert any("correlated by" in note for note in found.notes)
    beyond = fi.calibrate(damped, FREQUENCIES, PEAKS, {"ratio": (0.06, 0.09)}, **DRIVE)
    assert beyond.parameters[0].bound == "lowest"
    assert np.isnan(beyond.parameters[0].low)
    assert any("lowest bound" in note for note in beyond.notes)
    assert "no interval" in str(beyond)
    nothing = fi.calibrate(damped, FREQUENCIES, PEAKS * np.array([1, 3] * 4 + [1]), {"ratio": (0.03, 0.07)}, **DRIVE)
    assert any("no value between the bounds explains" in note for note in nothing.notes)


def test_a_ball_is_recovered_from_peaks_of_other_starts(tmp_path: Path) -> None:
    drive, frequencies = fi.Sine(0.2e-3, 5.0), np.linspace(4.6, 5.6, 6)
    truth = fi.parameter_study(
        with_ball(0.6),
        {"base.frequency": frequencies.tolist()},
        ["peak"],
        excitation=drive,
        starts=5,
        seed=7,
        cycles=90,
    )["peak"]
    more: dict[str, Any] = {"excitation": drive, "starts": 5, "cycles": 90, "directory": tmp_path / "grid"}
    found = fi.calibrate(with_ball, frequencies, truth, {"restitution": (0.3, 0.9)}, **more)
    # three times the interval of 90 %: medians of five starts of one test
    (one,) = found.parameters
    assert one.median == pytest.approx(0.6, abs=1.5 * (one.high - one.low))
    known = []
    again = fi.calibrate(with_ball, frequencies, truth, {"restitution": (0.3, 0.9)}, **more, progress=known.append)
    assert again.parameters == found.parameters
    assert all(each.found == each.cases for each in known)


def test_the_figure_shows_units_and_what_was_measured() -> None:
    two = fi.calibrate(oscillator_of, FREQUENCIES, PEAKS, BOUNDS, **DRIVE)
    one = fi.calibrate(damped, FREQUENCIES, PEAKS, {"ratio": (0.03, 0.07)}, **DRIVE)
    for found in (one, two):
        axes = fi.figures.calibration(found, title="a title", figure=fi.figures.OffScreen())
        assert axes[1].get_xlabel() == "base frequency (Hz)"
        assert axes[1].get_ylabel() == "peak (mm)"
        assert axes[0].get_title(loc="left") == "a title"
        (dots,) = [line for line in axes[1].lines if line.get_label() == "measured"]
        assert dots.get_ydata() == pytest.approx(1e3 * PEAKS)


def with_ball(restitution: float) -> fi.System:
    """A beam of one mode with a ball."""
    beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", at="tip", mass=5e-3, gap=3e-3, contact=fi.Rigid(restitution))
    box, damping = fi.PointMass("box", at="tip", mass=0.023), fi.Rayleigh(ratio=0.0029, modes=(1, 2))
    return fi.reduce(fi.assemble(fi.Structure(beam, [box], [ball], damping), elements=10), modes=1)


OF_BALL = "impactor.ball.contact.restitution"


def test_a_system_and_a_function_that_makes_it_have_one_posterior() -> None:
    more: dict[str, Any] = {"excitation": fi.Sine(0.2e-3, 5.0), "cycles": 9, "starts": 2}
    peaks = [2e-3, 3e-3, 2e-3]
    of_system = fi.calibrate(with_ball(0.5), [4.9, 5.0, 5.1], peaks, {OF_BALL: (0.3, 0.9)}, **more)
    of_function = fi.calibrate(with_ball, [4.9, 5.0, 5.1], peaks, {"restitution": (0.3, 0.9)}, **more)
    np.testing.assert_array_equal(of_system.posterior.values, of_function.posterior.values)


def test_a_calibration_that_was_interrupted_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    def stopped(done: Any) -> None:
        if 0.3 < done.share < 1.0:
            raise KeyboardInterrupt

    first: list[Any] = []
    more: dict[str, Any] = {**DRIVE, "directory": tmp_path / "grid"}
    with pytest.raises(KeyboardInterrupt):
        fi.calibrate(oscillator_of, FREQUENCIES, PEAKS, BOUNDS, **more, progress=stopped)
    found = fi.calibrate(oscillator_of, FREQUENCIES, PEAKS, BOUNDS, **more, progress=first.append)
    assert 0 < first[0].found < first[0].cases
    whole = fi.calibrate(oscillator_of, FREQUENCIES, PEAKS, BOUNDS, **DRIVE)
    np.testing.assert_array_equal(found.posterior.values, whole.posterior.values)


def test_frequencies_at_which_the_starts_disagree_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from femimpact.app.parametric import measured_peaks

    bounds = {"ratio": (0.03, 0.07)}
    cases = fi.calibrate(damped, FREQUENCIES, PEAKS, bounds, **DRIVE).dataset.copy(deep=True)
    cases["peak_groups"].loc[{"base.frequency": 4.5}] = 2.0
    # far from the median of the ratio, 0.05, starts may disagree
    cases["peak_groups"].loc[{"base.frequency": 5.5, "ratio": 0.03}] = 2.0
    monkeypatch.setattr(measured_peaks, "parameter_study", lambda *_, **__: cases)
    found = fi.calibrate(damped, FREQUENCIES, PEAKS, bounds, **DRIVE)
    assert found.start_dependent == pytest.approx([4.5])
    assert found.notes == ("at 4.5 Hz the starts run into two groups of peaks: measure there from several starts",)


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"peak": [1e-3, 1e-3]}, "peak = 2 points: must have 3 points, as frequency has"),
        ({"peak": [1e-3, -9e-3, 1e-3]}, "peak[1] = -0.009 m: must be > 0"),
        ({"frequency": [4.0, 5.0, 0.0]}, "frequency[2] = 0.0 Hz: must be > 0"),
        (
            {"parameters": {"a": (0, 1), "b": (0, 1), "c": (0, 1)}},
            "parameters = ['a', 'b', 'c']: must be the bounds of one or two parameters by their paths",
        ),
        ({"parameters": {3: (0, 1)}}, "parameters = [3]: must be the bounds of one or two parameters by their paths"),
        # the bound that was given, not a value of the grid
        ({"parameters": {OF_BALL: (0.3, 1.9)}}, f"{OF_BALL} = 1.9: must be a finite number >= 0 and <= 1"),
        ({"parameters": {"base.start": (0, 1)}}, "base.start = 0.0: must be 'base' or 'space' or 'static'"),
    ],
)
def test_a_line_names_what_was_given(changed: dict[str, Any], line: str) -> None:
    given: dict[str, Any] = {"frequency": [4.9, 5.0, 5.1], "peak": [1e-3] * 3, "parameters": {OF_BALL: (0.3, 0.9)}}
    with pytest.raises(InputError) as caught:
        fi.calibrate(with_ball(0.5), **{**DRIVE, **given, **changed, "at": "tip"})
    assert str(caught.value) == line


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"frequency": []}, "frequency"),
        ({"frequency": [4.0, -5.0, 6.0]}, "frequency"),
        ({"frequency": [4.0, np.nan, 6.0]}, "frequency"),
        ({"peak": [1e-3, 1e-3]}, "peak"),
        ({"peak": [1e-3, 0.0, 1e-3]}, "peak"),
        ({"frequency": [5.0], "peak": [1e-3]}, "frequency"),
        ({"parameters": {}}, "parameters"),
        ({"parameters": [("ratio", 0.03, 0.07)]}, "parameters"),
        ({"parameters": {"ratio": (0.07, 0.03)}}, "parameters.ratio"),
        ({"parameters": {"ratio": 0.05}}, "parameters.ratio"),
        ({"parameters": {"base.frequency": (4.0, 5.0)}}, "parameters"),
        ({"noise": 0.0}, "noise"),
        ({"starts": 1}, "starts"),
        ({"cycles": 0}, "cycles"),
    ],
)
def test_bad_input_is_one_line(changed: dict[str, Any], named: str) -> None:
    given: dict[str, Any] = {
        "frequency": [4.0, 5.0, 6.0],
        "peak": [1e-3, 9e-3, 1e-3],
        "parameters": {"ratio": (0.03, 0.07)},
    }
    given = {**DRIVE, **given, **changed}
    with pytest.raises(InputError) as caught:
        fi.calibrate(damped, **given)
    assert named in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(("ratio", "warned"), [(0.003, True), (0.2, False)])
def test_dwells_that_are_too_short_for_the_damping_are_warned_of(ratio: float, warned: bool) -> None:
    beam = fi.Beam.uniform(length=0.23, width=0.02, thickness=1e-3, young_modulus=70e9, density=2700)
    ball = fi.Impactor("ball", "tip", 3e-3, 4e-3, fi.Rigid(0.6))
    structure = fi.Structure(beam, [], [ball], fi.Rayleigh(ratio=ratio, modes=(1, 2)))
    system = fi.reduce(fi.assemble(structure, 6), 2)
    more: dict[str, Any] = {"excitation": fi.Sine(2e-4, 15.0), "starts": 2, "cycles": 15}
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", fi.ResultWarning)
        found = fi.calibrate(system, [14.0, 15.0], [1e-3, 1e-3], {"impactor.ball.gap": (2e-3, 6e-3)}, **more)
    assert len(found.warnings) == warned
    # ten cycles of the highest frequency go by before it measures
    assert all(text.startswith("dwell of 0.667 s before measuring begins") for text in found.warnings)
    assert [str(one.message).partition(" (docs")[0] for one in said] == list(found.warnings)
    assert all(text in str(found) for text in found.warnings)
