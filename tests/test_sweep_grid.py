"""The grid of a sweep: what it misses of a peak, and what of it is said."""

import dataclasses
import math

import numpy as np
import pytest
from builders import paper_study, prepare, summary_of

import femimpact as fi
from femimpact.app.study.prepared import finer_grid_words, most_frequencies, refined_grid
from femimpact.app.tasks.run import run_sweep
from femimpact.response.cycles import UNRESOLVED, peak_resolution
from femimpact.signals.one_pole import one_pole_amplitude

F0, RATIO = 5.3, 0.0029
WIDTH = 2.0 * RATIO * F0


@pytest.mark.parametrize("step", [0.1, 0.03, 0.008])
@pytest.mark.parametrize("offset", np.linspace(-0.5, 0.5, 11))
def test_the_largest_point_misses_the_peak_by_no_more_than_is_said_and_by_that_in_the_middle(step, offset):
    f = F0 + step * (np.arange(-20, 21) + offset)
    peak = one_pole_amplitude(F0 / math.sqrt(1.0 - 2.0 * RATIO**2), 1.0, F0, RATIO)
    missed = 1.0 - one_pole_amplitude(f, 1.0, F0, RATIO).max() / peak
    found = peak_resolution(f, F0, WIDTH)
    # the formula is that of a narrow resonance: half a step off f0 changes the amplitude by step/f0 besides
    near = 2.0 * step / F0
    assert missed <= found.largest_miss + near
    if abs(offset) == 0.5:
        assert missed == pytest.approx(found.largest_miss, abs=near)
    assert found.resolved == (step <= WIDTH / 4.0)


@pytest.fixture(scope="module")
def ready():
    """The paper's case without its ball, its reduced system, and the plan of a sweep."""
    study = paper_study()
    study = dataclasses.replace(study, structure=dataclasses.replace(study.structure, impactors=()))
    study = dataclasses.replace(study, method={"name": "event-driven"})
    return prepare(study, ("sweep",))


def with_plan(ready, **changes):
    plan = dataclasses.replace(ready.study.sweep, **changes)
    return dataclasses.replace(ready, study=dataclasses.replace(ready.study, sweep=plan))


@pytest.mark.parametrize("refine", [1, 6, 20, 41])
def test_a_refined_grid_holds_the_natural_frequency_so_that_its_largest_point_is_the_peak(ready, refine):
    small, plan = ready.small, with_plan(ready, refine=refine).study.sweep
    f = refined_grid(plan, small, None)
    assert f.size <= refined_grid(plan, small, 4.9173).size <= most_frequencies(plan)
    first = fi.solve_modes(small, 1)
    f0, ratio = float(first.natural_frequency[0]), float(first.damping_ratio[0])
    peak = one_pole_amplitude(f0 / math.sqrt(1.0 - 2.0 * ratio**2), 1.0, f0, ratio)
    # frequencies are rounded to nine digits; at f0 the amplitude is below its largest by zeta^2/2
    assert one_pole_amplitude(f, 1.0, f0, ratio).max() == pytest.approx(float(peak), rel=ratio**2)


@pytest.mark.parametrize(
    ("changes", "key"), [({"refine": 12}, "sweep.refine"), ({"start": 25.0, "stop": 40.0}, "sweep.points")]
)
def test_the_value_that_is_named_resolves_the_peak_and_one_less_does_not(ready, changes, key):
    plan = with_plan(ready, **changes).study.sweep
    first = fi.solve_modes(ready.small, 1)
    f0 = float(first.natural_frequency[0]) if key == "sweep.refine" else 33.3
    width = 2.0 * float(first.damping_ratio[0]) * f0
    named, value = finer_grid_words(
        plan, ready.bare, peak_resolution(np.array([f0 - 1.0, f0, f0 + 1.0]), f0, width)
    ).split(" = ")
    assert named == key
    name = key.removeprefix("sweep.")

    def step(count):
        if name == "points":
            return (plan.stop - plan.start) / (count - 1)
        return float(np.diff(np.linspace(-8.0, 8.0, count)).max()) * width / 2.0

    assert step(int(value)) <= width / 4.0 * (1 + 1e-12) < step(int(value) - 1)


def test_a_coarse_sweep_without_balls_says_how_low_its_peak_may_be_and_a_fine_one_nothing(ready):
    small = ready.small
    f0 = small.first_frequency
    exact = fi.frequency_sweep(small, 1e-4, [f0], fi.EventDriven(), cycles=1500, ledger=False).peak[0]
    for step, said in ((0.05, True), (0.006, False)):
        # the resonance half-way between two points
        f = f0 + step * (np.arange(-10, 11) + 0.5)
        curve = fi.frequency_sweep(small, 1e-4, f, fi.EventDriven(), cycles=1500, ledger=False)
        told = [text for text in curve.warnings if UNRESOLVED in text]
        assert len(told) == said
        miss = 1.0 - curve.peak_amplitude / exact
        width = 2.0 * 0.0029 * f0
        # the other modes and the slope of f^2 take part by step/f0
        assert miss == pytest.approx(1.0 - 1.0 / math.hypot(1.0, step / width), abs=2.0 * step / f0)
        for text in told:
            assert f"up to {100 * miss:.0f}"[:7] in text
            assert "frequencies at most 0.007" in text


def test_a_study_names_the_key_once_and_marks_what_is_not_resolved(ready):
    coarse = with_plan(ready, refine=0)
    summary = summary_of(coarse, sweeps=run_sweep(coarse))
    told = [text for text in summary["warnings"] if UNRESOLVED in text]
    assert len(told) == 1
    assert "(sweep.refine = 33)" in told[0]
    assert summary["sweep"]["empty"]["resolved"] is False
    assert summary["sweep"]["empty"]["peak_too_low_at_most"] == pytest.approx(
        1 - 1 / math.hypot(1, 0.1 / WIDTH), rel=0.02
    )
    fine = with_plan(ready, refine=33)
    summary = summary_of(fine, sweeps=run_sweep(fine))
    assert not [text for text in summary["warnings"] if UNRESOLVED in text]
    assert summary["sweep"]["empty"]["resolved"] is True


def test_a_sweep_beside_every_resonance_has_a_warning_and_no_damping(ready):
    beside = with_plan(ready, start=6.0, stop=9.0, refine=0)
    again = prepare(beside.study, ("sweep",))
    summary = summary_of(again, sweeps=run_sweep(again))
    assert any("no natural frequency lies between them" in text for text in summary["warnings"])
    assert math.isnan(summary["sweep"]["empty"]["damping_fit"])
    assert math.isnan(summary["sweep"]["empty"]["damping_half_power"])
    assert not any("no natural frequency" in text for text in ready.warnings)
