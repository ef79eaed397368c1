"""Sweeps at a level over frequency: each dwell is that of a sweep at its level, from Python and from a study file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import read_study, same_study, study_text

import femimpact as fi
from femimpact.app.parametric.dataset import labels_of
from femimpact.app.results.picture_data import read_results
from femimpact.app.tasks.study_command import definition_of, plan_of_cases

ROWS = ((4.0, 0.2), (5.0, 0.4), (6.0, 0.4))


def oscillator() -> fi.System:
    omega = 2.0 * np.pi * 5.0
    return fi.System.from_matrices([[1.0]], [[0.02 * omega]], [[omega**2]], points={"tip": [1.0]})


def test_each_frequency_has_its_level() -> None:
    frequencies = [4.0, 4.5, 5.0, 5.7, 6.0]
    method: Any = fi.EventDriven()
    curve = fi.frequency_sweep(oscillator(), frequencies=frequencies, method=method, cycles=300, acceleration=ROWS)
    size = 0.2 * (np.array(frequencies) / 4.0) ** (np.log(2.0) / np.log(1.25))
    size[2:] = 0.4
    np.testing.assert_allclose(curve.base_amplitude, size / (2.0 * np.pi * np.array(frequencies)) ** 2, rtol=1e-13)
    # the oscillator's steady amplitude in closed form, after 200 cycles of transient at a ratio of one percent
    ratio = np.array(frequencies) / 5.0
    exact = size / (10.0 * np.pi) ** 2 / np.sqrt((1.0 - ratio**2) ** 2 + (0.02 * ratio) ** 2)
    np.testing.assert_allclose(curve.first_harmonic, exact, rtol=5e-4)
    assert curve.to_xarray().attrs["base_acceleration_m_s2"].tolist() == np.ravel(ROWS).tolist()
    one = fi.frequency_sweep(oscillator(), frequencies=[5.0], method=method, cycles=300, acceleration=0.4)
    assert one.peak[0] == pytest.approx(curve.peak[2], rel=1e-12)


@pytest.mark.parametrize("level", [0.4, ((4.0, 0.1), (5.0, 0.3), (6.0, 3.0))])
def test_damping_is_that_of_the_curve_over_the_motion_of_the_base(level: Any) -> None:
    frequencies = np.linspace(4.0, 6.0, 161)
    method: Any = fi.EventDriven()
    curve = fi.frequency_sweep(oscillator(), frequencies=frequencies, method=method, cycles=600, acceleration=level)
    assert (curve.damping.ratio, curve.damping.frequency) == (
        pytest.approx(0.01, rel=1e-4),
        pytest.approx(5.0, rel=1e-6),
    )
    # half-power has the error of straight lines between the points
    assert curve.damping_half_power.ratio == pytest.approx(0.01, rel=0.02)
    # the peaks as they are do not have them
    assert fi.fit_one_pole(curve.frequency, curve.peak).frequency != pytest.approx(5.0, rel=2e-4)


def test_a_fit_knows_what_of_the_base_is_held() -> None:
    f = np.linspace(4.0, 6.0, 161)
    per_acceleration = np.abs(fi.transfer_function(oscillator(), f, to="tip")["tip"])
    fits = {held: fi.fit_one_pole(f, per_acceleration, held=held) for held in ("acceleration", "displacement")}
    right, wrong = fits["acceleration"], fits["displacement"]
    assert (right.ratio, right.frequency) == (pytest.approx(0.01, rel=1e-9), pytest.approx(5.0, rel=1e-9))
    assert right.warnings == ()
    assert wrong.frequency != pytest.approx(5.0, rel=2e-4)
    with pytest.raises(fi.InputError, match="held"):
        fi.fit_one_pole(f, per_acceleration, held="velocity")


def study(tmp_path: Path, acceleration: str) -> fi.app.Study:
    text = Path(__file__).parent.parent.joinpath("femimpact/app/paper.toml").read_text(encoding="utf-8")
    text = text.replace('name = "newmark"', 'name = "event-driven"').replace("elements = 40", "elements = 8")
    text = (
        text.replace("modes = 8 ", "modes = 2 ")
        .replace("cycles = 600 ", "cycles = 30 ")
        .replace("starts = 5", "starts = 2")
    )
    text = text.replace("refine = 40 ", f"refine = 2\nacceleration = {acceleration}\n#").replace(
        "duration = 120.0", "duration = 2.0"
    )
    text = (
        text.replace("points = 21 ", "points = 5 ")
        .replace("movie = true", "movie = false")
        .replace("figures = true", "figures = false")
    )
    return read_study(text.replace("paraview = true", "paraview = false"), tmp_path / "study.toml")


def test_a_study_sweeps_at_the_level_of_its_plan(tmp_path: Path) -> None:
    found = study(tmp_path, '[["4 Hz", "0.2 mm"], [5, "0.03 g"], [6, "0.03 g"]]')
    assert found.sweep is not None
    rows: Any = found.sweep.acceleration
    assert rows[0] == pytest.approx((4.0, 0.2e-3 * (8.0 * np.pi) ** 2), rel=1e-14)
    assert rows[1] == (5.0, 0.2941995)
    assert same_study(read_study(study_text(found), tmp_path / "study.toml"), found)
    fi.run_study(found, tmp_path / "results")
    read = read_results(tmp_path / "results").curves
    assert read is not None
    for curve in read.curves.values():
        np.testing.assert_array_equal(curve.acceleration, rows)  # type: ignore[arg-type]
        expected = np.exp(np.interp(np.log(curve.frequency), *np.log(np.array(rows)).T))
        np.testing.assert_allclose(curve.base_amplitude, expected / (2.0 * np.pi * curve.frequency) ** 2, rtol=1e-12)
    page = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert "by the rows of the study" in page


def test_a_sweep_beyond_its_rows_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        fi.InputError, match=r"sweep\.acceleration: must reach from 4 to 6 Hz; its rows go from 4 to 5 Hz"
    ):
        study(tmp_path, '[["4 Hz", "0.2 mm"], [5, "0.03 g"]]')


def test_a_study_says_that_the_level_of_the_sweep_is_not_its_own(tmp_path: Path) -> None:
    cases = '\n[study]\nmeasures = ["peak"]\n[study.axes]\n'
    for line, said in (
        ('"base.frequency" = [5.0, 5.2]', True),
        ('"base.amplitude" = ["0.1 mm", "0.2 mm"]', False),
        ('"base.acceleration" = ["0.1 g"]', False),
    ):
        text = study_text(study(tmp_path, '"0.03 g"')).partition("\n[study")[0]
        one = read_study(f"{text}{cases}{line}\n", tmp_path / "study.toml")
        words = "the acceleration of [sweep] is not that of the cases, which have the level of [base]"
        assert (f"study: {words}" in plan_of_cases(one).lines) == said
        assert (words in labels_of(definition_of(one))["attributes"]["warnings"]) == said
