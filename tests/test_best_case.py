"""The best case of a study: the worst counts, a failed case never wins, and what starts cannot tell apart is named."""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray
from builders import (
    paper_study,
    paper_study_text,
    print_results,
    read_study,
    study_conclusions,
    study_text,
    with_ball,
    write_parameter_study,
)
from matplotlib.colors import to_rgb

import femimpact as fi
from femimpact.app.parametric.best import NOTHING_TO_CHOOSE, best_cases
from femimpact.app.parametric.best_design import marks_of, worst_over_axes
from femimpact.app.report.result_page import best_measures, write_report
from femimpact.app.report.views import pictures_of
from femimpact.app.study.study import read_mesh_of
from femimpact.app.tasks.study_command import plan_of_cases
from femimpact.figures.studies import mark_best
from femimpact.figures.study_labels import OUTLINE
from femimpact.units import unit_text

GAP, RESTITUTION = "impactor.ball.gap", "impactor.ball.contact.restitution"
FREQUENCY, LEVEL = "base.frequency", "base.amplitude"
UNITS = {GAP: "m", RESTITUTION: "1", FREQUENCY: "Hz", LEVEL: "m"}
GAPS = 1e-3 * np.arange(1.0, 7.0)
FREQUENCIES = np.linspace(4.0, 6.0, 9)


def dataset(axes, columns, *, grid=True, starts=1, failed=None, better="small", units="m"):
    """A dataset as a study leaves it: columns of numbers over a grid of axes, or along the cases of a list."""
    dims = tuple(axes) if grid else ("case",)
    coordinates = {
        name: ((name,) if grid else ("case",), np.asarray(values), {"units": UNITS.get(name, "")})
        for name, values in axes.items()
    }
    shape = next(iter(columns.values())).shape
    failed = np.zeros(shape, dtype=np.int32) if failed is None else failed.astype(np.int32)
    data = {name: (dims, values, {"units": units, "better": better}) for name, values in columns.items()}
    data["failed_starts"] = (dims, failed)
    data["failure"] = (dims, np.where(failed > 0, "diverged", "").astype(object))
    data["finished"] = (dims, np.ones(shape, dtype=np.int8))
    return xarray.Dataset(data, coords=coordinates, attrs={"starts": starts})


def resonance(gap, frequency):
    """A peak around 5 Hz whose height is least at a gap of 3 mm, and which is low beside it at the widest gap alone."""
    height = 3e-3 + 1e-3 * np.abs(1e3 * gap - 3.0)
    width = 0.2 / (1.0 + (1e3 * gap - 1.0))
    return height / (1.0 + ((frequency - 5.0) / width) ** 2)


def grid(**more):
    """The same on a grid."""
    axes = {GAP: GAPS, FREQUENCY: FREQUENCIES}
    return dataset(axes, {"peak": resonance(GAPS[:, None], FREQUENCIES[None, :])}, **more)


def only(found):
    """The one design of a study without other axes of the excitation."""
    (design,) = found.designs
    return design


# ---- which is best -----------------------------------------------------------------------------------


def brute_force(rows, values, failed, worst, most=None, limited=None):
    """The best design of a list by plain loops: its values and the worst of them; designs that have none."""
    designs = defaultdict(list)
    for i, row in enumerate(rows):
        designs[tuple(sorted((name, value) for name, value in row.items() if name not in worst))].append(i)
    size = max(map(len, designs.values()))
    sound = {key: cases for key, cases in designs.items() if len(cases) == size and not any(failed[i] for i in cases)}
    kept = {
        key: max(values[i] for i in cases)
        for key, cases in sound.items()
        if most is None or max(limited[i] for i in cases) <= most
    }
    if not kept:
        return None
    key = min(kept, key=lambda one: (kept[one], one))
    return dict(key), kept[key], len(designs) - len(sound)


@pytest.mark.parametrize("seed", range(20))
def test_a_list_has_the_best_of_a_search_through_all_its_designs(seed):
    rng = np.random.default_rng(seed)
    rows = [
        {GAP: gap, RESTITUTION: restitution, FREQUENCY: frequency}
        for gap in (1e-3, 2e-3, 4e-3)
        for restitution in (0.5, 0.6, 0.7)
        for frequency in (4.0, 5.0, 6.0)
    ]
    rows = [rows[i] for i in rng.permutation(len(rows))[: 25 if seed % 2 else 27]]
    # of few values, so that some are equal
    values, force = rng.integers(1, 20, len(rows)).astype(float), rng.integers(1, 20, len(rows)).astype(float)
    failed = rng.random(len(rows)) < 0.05
    values[failed] = np.nan
    axes = {name: [row[name] for row in rows] for name in rows[0]}
    given = dataset(axes, {"peak": values, "peak_force": force}, grid=False, failed=failed)
    for worst in ((FREQUENCY,), (FREQUENCY, RESTITUTION)):
        for limits in ({}, {"peak_force": 19.0}, {"peak_force": 18.0}):
            expected = brute_force(rows, values, failed, worst, limits.get("peak_force"), force)
            if expected is None:
                with pytest.raises(fi.InputError, match=r"no design (has a value|keeps the limits)"):
                    fi.best_case(given, "peak", worst, limits)
                continue
            best = only(fi.best_case(given, "peak", worst, limits))
            assert (best.values, best.value, len(best.without_value)) == expected
            assert rows[best.case] == best.values | best.worst_at


@pytest.mark.parametrize("seed", range(5))
def test_neither_the_order_of_the_axes_nor_that_of_their_values_changes_the_winner(seed):
    rng = np.random.default_rng(seed)
    axes = {GAP: GAPS, RESTITUTION: [0.4, 0.6, 0.8], FREQUENCY: FREQUENCIES}
    # of few values, so that several designs are as good
    given = dataset(axes, {"peak": rng.integers(1, 4, (6, 3, 9)).astype(float)})
    best = only(fi.best_case(given, "peak"))
    for other in (
        given.transpose(RESTITUTION, FREQUENCY, GAP),
        given.isel({GAP: slice(None, None, -1)}),
        given.isel({name: rng.permutation(given.sizes[name]) for name in axes}),
    ):
        again = only(fi.best_case(other, "peak"))
        assert (again.values, again.value) == (best.values, best.value)
        assert {one.axis: one for one in again.margins} == {one.axis: one for one in best.margins}
        assert other["peak"].to_numpy().flat[again.case] == again.value
    listed = given.stack(case=list(axes)).reset_index("case")
    assert only(fi.best_case(listed, "peak")).values == best.values


def test_the_best_is_said_for_each_level_unless_it_is_one_of_the_worst():
    levels = np.array([1e-4, 2e-4, 4e-4])
    # the best gap is ten times the level, and what is wrong with it counts by the level
    value = np.abs(GAPS[:, None] - 10.0 * levels[None, :]) * levels[None, :] + 1e-3
    given = dataset({GAP: GAPS, LEVEL: levels}, {"peak": value})
    found = fi.best_case(given, "peak")
    assert [(design.at[LEVEL], design.values[GAP]) for design in found.designs] == [
        (1e-4, 1e-3), (2e-4, 2e-3), (4e-4, 4e-3),
    ]  # fmt: skip
    best = only(fi.best_case(given, "peak", [LEVEL]))
    assert best.value == value.max(axis=1).min()
    assert best.values[GAP] == GAPS[value.max(axis=1).argmin()]


def test_the_frequency_of_a_force_is_no_choice_as_that_of_the_base_is_none():
    of_base = grid()
    of_force = of_base.rename({FREQUENCY: "force.wind.frequency"})
    base, force = only(fi.best_case(of_base, "peak")), fi.best_case(of_force, "peak")
    assert force.worst_over == ("force.wind.frequency",)
    assert (only(force).values, only(force).value, only(force).case) == (base.values, base.value, base.case)
    for path in ("force.wind.amplitude", "force.wind.at"):
        assert len(fi.best_case(of_base.rename({FREQUENCY: path}), "peak").designs) == len(FREQUENCIES)
    # alone it leaves nothing to choose
    alone = of_force.isel({GAP: [0]})
    assert best_cases(alone, None) == ({}, dict.fromkeys(["peak"], NOTHING_TO_CHOOSE))


def test_a_design_with_a_failed_case_has_no_value_and_is_named():
    failed = np.zeros((6, 9), dtype=bool)
    failed[2, 0] = True
    given = grid(failed=failed)
    given["peak"][2, 0] = np.nan
    found = fi.best_case(given, "peak")
    best = only(found)
    assert best.values[GAP] in (2e-3, 4e-3)
    assert best.without_value == (({GAP: 3e-3}, "a case failed: diverged"),)
    assert "without a value: impactor.ball.gap = 3 mm: a case failed: diverged" in str(found)
    # one start of several is enough
    given["peak"][2, 0] = 1e-3
    assert only(fi.best_case(given, "peak")).values == best.values


@pytest.mark.parametrize("frequencies", [(4.0, 4.0), (4.0, 5.0, 5.0)])
def test_a_design_at_fewer_frequencies_does_not_win_by_it(frequencies):
    # as many cases as the other designs have, or more, and not at 6 Hz, which is the worst
    rows = [(gap, f) for gap in (1e-3, 2e-3) for f in (4.0, 5.0, 6.0)] + [(4e-3, f) for f in frequencies]
    axes = {GAP: [gap for gap, _ in rows], FREQUENCY: [f for _, f in rows]}
    found = fi.best_case(dataset(axes, {"peak": np.array([f / gap for gap, f in rows])}, grid=False), "peak")
    assert only(found).values == {GAP: 2e-3}
    (((values, why),),) = [only(found).without_value]
    assert values == {GAP: 4e-3}
    assert f"{len(set(frequencies))} of 3 cases are there" in why


@pytest.mark.parametrize("axis", ["start.ball.position", "mesh.elements", "reduction.modes", "method.dt"])
def test_neither_start_nor_numerics_are_a_choice(axis):
    values = np.array([[3.0, 1.0], [2.0, 5.0]])
    given = dataset({GAP: GAPS[:2], axis: [1.0, 2.0]}, {"peak": values})
    assert [design.value for design in fi.best_case(given, "peak", []).designs] == [2.0, 1.0]
    assert only(fi.best_case(given, "peak", [axis])).value == 3.0
    with pytest.raises(fi.InputError, match="leaves no axis to choose on"):
        fi.best_case(given.isel({GAP: 0}), "peak")


def test_margins_of_a_sample_are_one_line():
    rng = np.random.default_rng(1)
    given = dataset({GAP: rng.random(8), RESTITUTION: rng.random(8)}, {"peak": rng.random(8)}, grid=False)
    lines = str(fi.best_case(given, "peak")).splitlines()
    (line,) = [line for line in lines if "may be off is not known" in line]
    assert GAP in line
    assert RESTITUTION in line
    assert not any("was not run" in one for one in lines)


def test_a_design_that_was_not_run_to_the_end_has_no_value():
    given = grid()
    given["finished"][2, 4], given["peak"][2, 4] = 0, np.nan
    best = only(fi.best_case(given, "peak"))
    assert best.without_value == (({GAP: 3e-3}, "a case has not been run"),)


def test_of_a_measure_of_which_large_values_are_better_the_largest_smallest_wins():
    small, large = grid(), grid(better="large")
    large["peak"][...] = -large["peak"]
    one, other = only(fi.best_case(small, "peak")), only(fi.best_case(large, "peak"))
    assert (other.values, other.value, other.worst_at) == (one.values, -one.value, one.worst_at)
    assert other.margins == one.margins
    limited = only(fi.best_case(large, "peak", limits={"peak": -3.5e-3}))
    assert limited.limited == {"peak": -3e-3}
    with pytest.raises(
        fi.InputError,
        match=r"keeps the limits: the nearest, .* has gap of ball 3 mm, with peak .3 mm, limit .2 mm",
    ):
        fi.best_case(large, "peak", limits={"peak": -2e-3})


def test_pairs_of_gaps_and_names_are_designs_too():
    values = np.array([[3.0, 2.0], [1.0, 5.0], [4.0, 4.5]])
    pairs = {f"{GAP}.plus": (GAP, [1e-3, 2e-3, 3e-3]), f"{GAP}.minus": (GAP, [1e-3, 4e-3, 3e-3])}
    given = dataset({GAP: np.arange(3), "base.start": np.array(["base", "space"], dtype=object)}, {"peak": values})
    given = given.assign_coords(pairs)
    assert [design.values[GAP] for design in fi.best_case(given, "peak").designs] == [(2e-3, 4e-3), (1e-3, 1e-3)]
    best = only(fi.best_case(given, "peak", ["base.start"]))
    assert (best.values, best.worst_at, best.margins) == ({GAP: (1e-3, 1e-3)}, {"base.start": "base"}, ())


# ---- how sure it is ----------------------------------------------------------------------------------


def test_designs_whose_intervals_overlap_are_not_told_from_the_best():
    median = np.array([[3.0, 2.0], [2.2, 2.1], [2.0, 2.6], [1.0, 4.0]])
    columns = {
        "peak": median, "peak_low": median - 0.5, "peak_high": median + 0.5,
        "peak_median_low": median - 0.25, "peak_median_high": median + 0.25,
    }  # fmt: skip
    best = only(fi.best_case(dataset({GAP: GAPS[:4], FREQUENCY: [4.0, 5.0]}, columns, starts=8), "peak"))
    assert (best.value, best.low, best.high) == (2.2, 2.2 - 0.25, 2.2 + 0.25)
    assert best.alike == ({GAP: 3e-3},)  # 2.35 to 2.85, and not 2.75 to 3.25
    assert best.alike_values == (2.6,)
    for end in ("low", "high"):
        del columns[f"peak_median_{end}"]
    few = fi.best_case(dataset({GAP: GAPS[:4], FREQUENCY: [4.0, 5.0]}, columns, starts=3), "peak")
    assert np.isnan(only(few).low)
    assert "with starts = 3 there is no interval" in str(few)


def test_designs_that_are_not_told_apart_have_their_values_and_their_groups_of_starts():
    median, groups = np.array([2.0, 3.2, 2.5]), np.array([1.0, 2.0, 1.0])
    columns = {
        "peak": median, "peak_low": median - 1.5, "peak_high": median + 1.0,
        "peak_median_low": median - 1.4, "peak_median_high": median + 0.5, "peak_groups": groups,
    }  # fmt: skip
    given = dataset({GAP: GAPS[:3]}, {name: 1e-3 * one for name, one in columns.items()}, starts=8)
    given["peak_groups"] = (GAP, groups)
    found = fi.best_case(given, "peak")
    best = only(found)
    # the nearest first
    assert (best.alike, best.alike_values) == (({GAP: 3e-3}, {GAP: 2e-3}), (2.5e-3, 3.2e-3))
    assert (best.groups, best.alike_groups) == ((), ((), pytest.approx((1.7e-3, 4.2e-3))))
    assert "impactor.ball.gap = 3 mm (2.5 mm, 25 % more); impactor.ball.gap = 2 mm (3.2 mm, 60 % more; its" in str(
        found
    )
    assert "its starts lie in two groups, 1.7 mm to 4.2 mm)" in str(found)
    assert "two motions" not in str(found)
    given["peak_groups"] = (GAP, groups[[1, 0, 2]])
    assert only(fi.best_case(given, "peak")).groups == pytest.approx((0.5e-3, 3e-3))
    assert "two motions: at its worst the starts lie in two groups, 0.5 mm to 3 mm" in str(fi.best_case(given, "peak"))


def test_a_worst_case_at_an_end_of_its_axis_is_said_and_a_flat_axis_is_not():
    def ends(values, worst=(FREQUENCY,)):
        given = dataset({GAP: GAPS[:2], FREQUENCY: [4.0, 5.0, 6.0]}, {"peak": 1e-3 * np.array(values)})
        found = fi.best_case(given, "peak", worst)
        assert ("a worse one may lie beyond" in str(found)) == bool(only(found).worst_bounds)
        return only(found).worst_bounds

    assert ends([[1.0, 2.0, 3.0], [9.0, 9.0, 9.0]]) == {FREQUENCY: "highest"}
    assert ends([[3.0, 2.0, 1.0], [9.0, 9.0, 9.0]]) == {FREQUENCY: "lowest"}
    assert ends([[1.0, 3.0, 1.0], [9.0, 9.0, 9.0]]) == {}
    assert ends([[3.0, 3.0, 3.0], [9.0, 9.0, 9.0]]) == {}
    assert ends([[3.0, 1.0, 3.0], [9.0, 9.0, 9.0]]) == {}
    # names have no order
    names = dataset({GAP: GAPS[:2], "base.start": np.array(["base", "space"])}, {"peak": np.array([[1.0, 2], [3, 4]])})
    assert only(fi.best_case(names, "peak", ["base.start"])).worst_bounds == {}
    # nor have seeds
    seeds = dataset({GAP: GAPS[:2], "base.seed": [1.0, 2.0, 3.0]}, {"peak": np.array([[1.0, 2, 3], [4, 5, 6]])})
    assert only(fi.best_case(seeds, "peak", ["base.seed"])).worst_bounds == {}


def test_a_restitution_that_is_no_part_of_the_worst_counts_as_a_choice_and_says_so():
    axes = {GAP: GAPS[:3], RESTITUTION: [0.5, 0.7, 0.9], FREQUENCY: [4.0, 5.0, 6.0]}
    value = 1e-3 * np.array([[5.0, 5.0, 6.0], [3.0, 8.0, 14.0], [7.0, 7.0, 7.0]])
    given = dataset(axes, {"peak": value[:, :, None] * np.array([0.5, 1.0, 0.5])})
    found = fi.best_case(given, "peak")
    assert found.uncertain == (RESTITUTION,)
    assert only(found).over_uncertain == 14e-3
    (line,) = [line for line in str(found).splitlines() if "counts as a choice" in line]
    assert "over all its values impactor.ball.gap = 2 mm has up to 14 mm; to be safe over it, worst_over =" in line
    # what it says to give
    safe = fi.best_case(given, "peak", json.loads(line.partition("worst_over = ")[2]))
    assert (safe.uncertain, only(safe).values, only(safe).value) == ((), {GAP: 1e-3}, 6e-3)
    assert "choice" not in str(safe)
    # of one value nothing is chosen, and without another axis there is no remedy
    assert fi.best_case(given.isel({RESTITUTION: [1]}), "peak").uncertain == ()
    for one in (given.isel({GAP: 0}, drop=True), given.isel({GAP: [0]})):
        assert f"{RESTITUTION} counts as a choice: no other axis is left to choose on" in str(fi.best_case(one, "peak"))


def test_the_nearest_design_passes_its_most_passed_limit_by_the_smallest_share():
    # of the limits 10 and 2 these use 1.1 and 2, 1.5 and 1.4, 3 and 0.5: the second has the smallest of the largest
    columns = {name: np.array(row)[:, None] for name, row in (("peak", [11.0, 15, 30]), ("rms", [4.0, 2.8, 1]))}
    given = dataset({GAP: np.array([1e-3, 2e-3, 3e-3]), FREQUENCY: np.array([5.0])}, columns)
    with pytest.raises(fi.InputError, match=r"gap of ball 2 mm, with peak .*, 150 % of it and rms .*, 140 % of it"):
        fi.best_case(given, "peak", limits={"peak": 10.0, "rms": 2.0})


def test_limits_hold_for_the_largest_start_of_the_worst_case():
    columns = {"peak": resonance(GAPS[:, None], FREQUENCIES[None, :])}
    columns["peak_force"] = np.repeat(np.array([[9.0], [9.0], [40.0], [10.0], [9.0], [9.0]]), 9, axis=1)
    columns["peak_force_low"] = columns["peak_force"] - 5.0
    columns["peak_force_high"] = columns["peak_force"] + 10.0
    given = dataset({GAP: GAPS, FREQUENCY: FREQUENCIES}, columns, starts=3)

    def gap(most):
        return only(fi.best_case(given, "peak", limits={"peak_force": most})).values[GAP]

    assert (gap(50.0), gap(49.9), gap(19.0)) == (3e-3, 2e-3, 2e-3)
    assert only(fi.best_case(given, "peak", limits={"peak_force": 60.0})).limited == {"peak_force": 50.0}
    unlimited, tight = (only(fi.best_case(given, "peak", limits=one)) for one in ({}, {"peak_force": 20.0}))
    assert [unlimited.beyond, tight.beyond] == [(0, 6), (1, 6)]
    with pytest.raises(fi.InputError, match=r"gap of ball .* mm, with peak_force 19000 mm, limit 18000 mm, 106 %"):
        fi.best_case(given, "peak", limits={"peak_force": 18.0})


def test_a_symmetric_problem_has_the_same_margin_on_both_sides_and_no_cliff():
    gaps = np.linspace(1e-3, 5e-3, 41)
    given = dataset({GAP: gaps}, {"peak": 1.0 + np.abs(gaps - 3e-3) / 1e-3})
    (margin,) = only(fi.best_case(given, "peak")).margins
    # 15 % of 1 at a slope of 1 in a millimetre; rounding of the gaps
    assert (margin.below, margin.above) == pytest.approx((0.15e-3, 0.15e-3), rel=1e-9)
    assert (margin.below_found, margin.above_found, margin.cliff, margin.bound) == (True, True, "", "")


@pytest.mark.parametrize("better", ["small", "large"])
def test_no_margin_ends_where_the_starts_do_not_tell_two_designs_apart(better):
    """Values scatter by 20 to 40 % about a plain, with intervals that overlap, and rise beyond 4 mm and below 2 mm."""
    gaps = np.array([1.0, 1.9, 2.0, 2.9, 2.98, 3.0, 3.019, 3.1, 4.0, 4.1, 5.0])
    median = np.array([4.0, 1.9, 1.3, 1.2, 1.4, 1.0, 1.3, 1.25, 1.35, 2.0, 4.0])
    columns = {"peak": median, "peak_median_low": median - 0.4, "peak_median_high": median + 0.4}
    if better == "large":
        columns = {"peak": -median, "peak_median_low": -median - 0.4, "peak_median_high": -median + 0.4}
    (margin,) = only(fi.best_case(dataset({GAP: 1e-3 * gaps}, columns, starts=8, better=better), "peak")).margins
    # 1.9 and 4.1 mm are the first whose intervals lie apart
    assert (margin.below_found, margin.above_found, margin.cliff) == (True, True, "")
    assert (margin.below, margin.above) == (pytest.approx(1.0e-3), pytest.approx(1.0e-3))
    # without intervals the values are what is known
    plain = {"peak": columns["peak"]}
    (margin,) = only(fi.best_case(dataset({GAP: 1e-3 * gaps}, plain, better=better), "peak")).margins
    assert margin.above == pytest.approx(0.019e-3 * 0.15 / 0.3)


def test_the_steep_side_is_the_cliff_and_a_mirror_turns_it():
    gaps = np.array([2.0, 2.5, 3.0, 3.5, 4.0])
    peak = np.array([6.0, 4.4, 2.7, 3.2, 3.4])
    (margin,) = only(fi.best_case(dataset({RESTITUTION: gaps}, {"peak": peak}), "peak")).margins
    assert margin.below == pytest.approx(0.5 * 0.15 * 2.7 / 1.7, rel=1e-12)
    assert margin.above == pytest.approx(0.5 * 0.15 * 2.7 / 0.5, rel=1e-12)
    assert margin.cliff == "below"
    (turned,) = only(fi.best_case(dataset({RESTITUTION: -gaps}, {"peak": peak}), "peak")).margins
    assert (turned.below, turned.above, turned.cliff) == (margin.above, margin.below, "above")


def test_a_best_at_the_end_of_an_axis_says_so_and_what_was_not_run_is_no_margin():
    given = dataset({GAP: GAPS}, {"peak": 1.0 + 0.01 * np.arange(6.0)})
    found = fi.best_case(given, "peak")
    (margin,) = only(found).margins
    assert (margin.below, margin.below_found, margin.bound) == (0.0, False, "lowest")
    assert (margin.above, margin.above_found) == (pytest.approx(5e-3), False)
    assert "less was not run, at least 5 mm more; it is the lowest value of the axis" in str(found)


def test_a_margin_ends_before_a_failed_case_and_where_a_limit_is_passed():
    failed = np.array([0, 0, 0, 0, 1, 0])
    columns = {"peak": np.array([1.01, 1.01, 1.0, 1.01, 1.01, 9.0]), "rms": np.array([5.0, 3.0, 1.0, 1.0, 1.0, 1.0])}
    given = dataset({RESTITUTION: np.arange(6.0)}, columns, failed=failed)
    (margin,) = only(fi.best_case(given, "peak", limits={"rms": 2.0})).margins
    assert (margin.above, margin.above_found) == (1.0, False)
    assert (margin.below, margin.below_found) == (0.5, True)


# ---- what is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"measure": "peek"}, "measure = 'peek': is no number of the study: unknown; did you mean 'peak'"),
        ({"measure": 3}, "measure = 'int': must be the name of a measure"),
        ({"measure": "damping"}, "does not say whether small or large values are better: take one of peak, peak_force"),
        ({"worst_over": ["base.frequenzy"]}, "worst_over = 'base.frequenzy': is no axis of the study"),
        ({"worst_over": FREQUENCY}, "worst_over = 'base.frequency': must be a list of paths of axes"),
        ({"worst_over": [FREQUENCY, GAP]}, "leaves no axis to choose on"),
        ({"limits": {"force": 1.0}}, "limits = 'force': is no number of the study"),
        ({"limits": {"peak": "low"}}, "limits.peak = 'low'"),
        ({"limits": 3.0}, "limits = 3.0: must be numbers by the names of measures"),
        ({"limits": {"peak_force": 1.0}}, r"peak_force: .* without a contact time \(ball: rigid\)"),
        ({"dataset": 3}, "dataset = 'int': must be what parameter_study returns"),
        ({"dataset": xarray.Dataset()}, "must be what parameter_study returns"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(arguments, words):
    given = grid()
    given["damping"] = given["peak"].assign_attrs(better="")
    given["peak_force"] = given["peak"] * np.nan
    given["peak_force"].attrs["better"] = "small"
    given.attrs["contact_laws"] = "ball: rigid"
    with pytest.raises(fi.InputError, match=words) as caught:
        fi.best_case(**{"dataset": given, "measure": "peak", **arguments})
    assert "\n" not in str(caught.value)


def test_a_study_in_which_nothing_can_be_chosen_is_one_line():
    given = grid()
    for one in (given.isel({GAP: [2], FREQUENCY: [4]}), given.isel({GAP: [2]})):
        with pytest.raises(fi.InputError, match=r"one (case|design).*nothing to choose between"):
            fi.best_case(one, "peak")
    with pytest.raises(fi.InputError, match=r"leaves no axis to choose on: base.frequency"):
        fi.best_case(given.isel({GAP: 2}), "peak")
    failed = grid(failed=np.ones((6, 9), dtype=bool))
    failed["peak"][...] = np.nan
    with pytest.raises(fi.InputError, match="peak: has no value: all 54 cases have failed, the first: diverged"):
        fi.best_case(failed, "peak")


def test_a_sample_in_which_no_cases_agree_is_refused_with_what_to_do():
    rng = np.random.default_rng(0)
    given = dataset(
        {GAP: rng.random(16), FREQUENCY: rng.random(16), LEVEL: np.ones(16)}, {"peak": rng.random(16)}, grid=False
    )
    with pytest.raises(fi.InputError, match=r"no two cases that agree in all axes but base.frequency: study a grid"):
        fi.best_case(given, "peak")
    with pytest.raises(fi.InputError, match=r"dataset: no two designs agree in base.frequency"):
        fi.best_case(given, "peak", [])
    without = given.drop_vars(FREQUENCY)
    assert only(fi.best_case(without, "peak")).value == float(given["peak"].min())


# ---- of a real study ---------------------------------------------------------------------------------


@pytest.mark.impacts
def test_a_measure_says_what_is_better_and_a_limit_without_a_value_names_the_law():
    paper = paper_study()
    structure = with_ball(paper.structure, contact=fi.Rigid(0.6))
    system = fi.reduce(fi.assemble(structure, elements=6), modes=2)
    axes = {GAP: [1e-3, 3e-3, 9e-3], FREQUENCY: [4.9, 5.0, 5.1]}
    measures = ["peak", "damping", "peak_force", "tip.velocity"]
    found = fi.parameter_study(system, axes, measures, excitation=fi.Sine(0.2e-3, 5.0), starts=5, cycles=30)
    better = {name: found[name].attrs.get("better", "") for name in measures}
    assert better == {"peak": "small", "damping": "", "peak_force": "small", "tip.velocity": "small"}
    best = only(fi.best_case(found, "peak"))
    worst = found["peak"].max(FREQUENCY)
    assert best.value == float(worst.min())
    assert best.values[GAP] == float(worst[GAP][int(worst.to_numpy().argmin())])
    assert best.low <= best.value <= best.high
    with pytest.raises(fi.InputError, match=r"peak_force: has no value.*ball: rigid"):
        fi.best_case(found, "peak", limits={"peak_force": 50.0})


STUDIED = """
[study]
measures = ["peak", "rms", "impacts_per_cycle"]
starts = 5
cycles = 9
[study.axes]
"impactor.ball.gap" = [0.001, 0.003, 0.009]
"base.frequency" = [4.9, 5.3]
"""
BEST = '[study.best]\nmeasure = "rms"\nworst_over = ["base.frequency"]\nlimits = { peak = 1.0 }\n'


def study(table=""):
    """The paper's case on two modes, event-driven, with a parameter study."""
    text = paper_study_text().replace('name = "newmark"', 'name = "event-driven"') + STUDIED + table
    given = read_study(text, Path("study.toml"))
    smaller = replace(given, mesh=replace(given.mesh, elements=6), reduction=replace(given.reduction, modes=2))
    return replace(smaller, output=replace(given.output, figures=False), text="")


@pytest.mark.impacts
def test_command_report_and_study_file_say_the_same_and_another_table_resumes_the_study(tmp_path, capsys):
    first = write_parameter_study(study(), tmp_path)
    blocks = {path.name: path.read_bytes() for path in (tmp_path / "blocks").glob("*.block")}
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Smallest worst peak" in page
    # what the words of the cells hide: the smallest of all cells is another value
    best = only(fi.best_case(first, "peak"))
    shown = study_conclusions(first, best_cases(first, None)[0])[0]
    assert float(shown.value) == pytest.approx(1e3 * best.value, rel=1e-3)  # of four digits
    print_results(tmp_path)
    # of the other measures the best is not asked for
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Smallest")]
    assert line.startswith(f"Smallest worst peak: {shown.value}")
    assert [one.label for one in study_conclusions(first, *best_cases(first, None))] == ["Smallest worst peak"]
    again = study(BEST)
    second = write_parameter_study(again, tmp_path)
    assert {path.name: path.read_bytes() for path in (tmp_path / "blocks").glob("*.block")} == blocks
    np.testing.assert_array_equal(second["peak"], first["peak"])
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Smallest worst rms" in page
    assert "Smallest worst peak" not in page
    print_results(tmp_path)
    lines = capsys.readouterr().out
    assert "limit 1000 mm" in lines
    # the next step: a study file of the best case at its worst, without a study
    best = only(fi.best_case(second, "rms", [FREQUENCY], {"peak": 1.0}))
    chosen = fi.load_study(tmp_path / "best.toml")
    assert (chosen.structure.impactors[0].gap, chosen.base.frequency) == (best.values[GAP], best.worst_at[FREQUENCY])
    assert replace(chosen.structure, impactors=()) == replace(again.structure, impactors=())
    assert chosen.plan is None
    assert f"femimpact run {tmp_path / 'best.toml'}" in " ".join(lines.split())
    assert "'femimpact run best.toml' in the folder of this page" in page
    # the ball of the drawing has the gap of the best case
    gap = f"gaps {1e3 * best.values[GAP]:g} mm"
    assert page.count(f"{gap}, of the best case; gap is an axis of the study") == 1
    assert "kelvin-voigt, of the best case; gap is an axis of the study" in page
    assert page.index('<h2 id="best-heading">') < page.index('<h2 id="structure-heading">')
    assert "worst rms over" in page


def test_of_a_study_without_a_best_case_nothing_is_left_of_an_earlier_one(tmp_path, capsys):
    drawn = replace(study(), output=replace(study().output, figures=True, report=False))
    first = write_parameter_study(drawn, tmp_path)
    left = {"best.toml", "study_best.png"}
    assert left <= {path.name for path in tmp_path.rglob("*")}
    # no case keeps the limit
    limited = replace(drawn.plan, best=replace(study(BEST).plan.best, limits={"peak": 1e-9}))
    second = write_parameter_study(replace(drawn, plan=limited), tmp_path)
    assert not left & {path.name for path in tmp_path.rglob("*")}
    print_results(tmp_path)
    lines = " ".join(capsys.readouterr().out.split())
    assert "no best case: no design keeps the limits: the nearest, whose" in lines
    assert f", limit {unit_text(1e-9, 'm')}" in lines
    assert "Largest rms" in lines[: lines.index("no best case")]
    assert "femimpact run" not in lines
    assert "Smallest worst" not in lines
    found, reasons = best_cases(second, limited.best)
    shown = {one.label: one.note for one in study_conclusions(first, found, reasons)}
    assert "[study.best] asks for rms" in shown["Largest peak"]


def test_the_study_of_the_best_case_finds_the_mesh_of_the_study_from_another_folder(tmp_path):
    table = '[study]\nmeasures = ["peak"]\ncycles = 3\n[study.axes]\n"impactor.ball.gap" = [0.002, 0.003]\n'
    path = Path("meshes/stepped_cantilever.toml")
    given = read_study(path.read_text(encoding="utf-8") + table, path)
    given = replace(given, output=replace(given.output, figures=False, report=False))
    write_parameter_study(given, tmp_path / "results")
    chosen = fi.load_study(tmp_path / "results" / "best.toml")
    assert (tmp_path / "results" / chosen.mesh.file).resolve() == Path("meshes/stepped_cantilever.msh").resolve()
    assert read_mesh_of(chosen) is not None


def test_what_is_drawn_is_the_worst_over_what_is_not_chosen():
    rng = np.random.default_rng(0)
    axes = {GAP: GAPS, RESTITUTION: [0.5, 0.7, 0.9], FREQUENCY: FREQUENCIES}
    for better, most in (("small", np.max), ("large", np.min)):
        columns = {"peak": rng.random((6, 3, 9)), "peak_low": rng.random((6, 3, 9)), "rms": rng.random((6, 3, 9))}
        given = dataset(axes, columns, better=better, starts=3)
        given["periodic_starts"] = given["failed_starts"]
        for name in axes:
            given[name].attrs["long_name"] = name
        for worst, over in (((FREQUENCY,), 2), ((RESTITUTION, FREQUENCY), (1, 2)), ((), ())):
            found = fi.best_case(given, "peak", worst)
            drawn = worst_over_axes(given, found)
            assert drawn["peak"].dims == tuple(name for name in axes if name not in worst)
            for name in ("peak", "peak_low"):
                np.testing.assert_array_equal(drawn[name], most(columns[name], axis=over))
            # the ring is at the best, and nothing of another measure is drawn
            best_values = sorted(design.value for design in found.designs)
            assert sorted(drawn["peak"].to_numpy()[drawn["is_best"].to_numpy()]) == best_values
            assert "rms" not in drawn
    failed = np.zeros((6, 3, 9), dtype=bool)
    failed[2, 1, 4] = True
    given = dataset(axes, {"peak": np.where(failed, np.nan, 1.0 + rng.random((6, 3, 9)))}, failed=failed)
    given["periodic_starts"] = given["failed_starts"]
    drawn = worst_over_axes(given, fi.best_case(given, "peak", [FREQUENCY]))
    assert np.argwhere(np.isnan(drawn["peak"].to_numpy())).tolist() == [[2, 1]]
    listed = given.stack(case=list(axes)).reset_index("case")
    assert worst_over_axes(listed, fi.best_case(listed, "peak", [FREQUENCY])) is None


def test_marks_of_a_line_are_the_level_of_15_percent_more_the_limit_and_the_margins():
    given = grid()
    found = fi.best_case(given, "peak", limits={"peak": 0.01})
    (margin,) = only(found).margins
    marks = marks_of(found)
    assert marks.levels == (("15 % more", pytest.approx(3.45e-3)), ("limit", 0.01))
    assert marks.spans == {GAP: (3e-3 - margin.below, 3e-3 + margin.above)}
    given = given.assign(periodic_starts=given["finished"])
    drawn = worst_over_axes(given, found)
    axes = mark_best(fi.figures.study(drawn, "peak", ax=fi.figures.OffScreen()), drawn, "peak", marks)
    assert {text.get_text() for text in axes.get_legend().get_texts()} == {
        "value", "the best", "at most 15 % more than the best, within the limits",
    }  # fmt: skip
    # one millimetre of slope 1: 0.45 mm to each side, in millimetres
    (span,) = axes.patches
    assert span.get_x() == pytest.approx(2.55)
    assert span.get_width() == pytest.approx(0.9)


def test_the_commented_study_of_a_new_file_is_one_and_takes_the_worst_over_what_is_not_chosen():
    given, commented = paper_study_text().split("# [study]\n")
    lines = f"# [study]\n{commented.partition('# [study.sample]')[0]}".splitlines()
    plan = read_study("\n".join([given, *(line.removeprefix("# ") for line in lines)]), Path("study.toml"))
    assert plan_of_cases(plan).costs[0].startswith("study: 1025 cases (5 x 5 x 41), 8 starts each")
    assert set(plan.plan.best.worst_over) == set(plan.plan.axes) - {GAP}


def test_the_report_begins_with_a_map_with_the_best_outlined_or_a_line_with_its_marks():
    axes = {GAP: GAPS, RESTITUTION: [0.5, 0.7, 0.9], FREQUENCY: FREQUENCIES}
    given = dataset(axes, {"peak": 1e-3 * (1.0 + np.random.default_rng(0).random((6, 3, 9)))})
    given = given.assign(periodic_starts=given["finished"])
    for name in axes:
        given[name].attrs["long_name"] = name
    found = fi.best_case(given, "peak")
    (mapped,) = pictures_of(best_measures(given, {"peak": found}))
    axes = mapped.view.figure(mapped.record)
    assert [one.get_edgecolor()[:3] for one in axes.patches] == [to_rgb(OUTLINE)]
    (lined,) = pictures_of(best_measures(given, {"peak": fi.best_case(given, "peak", [FREQUENCY, RESTITUTION])}))
    assert mapped.name == lined.name == "study_best"
    axes = lined.view.figure(lined.record)
    assert "15 % more" in {text.get_text() for text in axes.texts}
    legend = {text.get_text() for text in axes.get_legend().get_texts()}
    assert legend == {"value", "the best", "at most 15 % more than the best"}


def test_a_table_of_the_best_goes_round_and_is_checked_before_the_first_case():
    given = study(BEST.replace("peak = 1.0", '"peak" = 1.0'))
    assert read_study(study_text(given), Path("study.toml")).plan == given.plan
    assert plan_of_cases(given) == plan_of_cases(study())
    dotted = study('[study.best]\nmeasure = "peak"\n[study.best.limits]\ntip.velocity = 1.0\n')
    assert dotted.plan.best.limits == {"tip.velocity": 1.0}
    with pytest.raises(fi.InputError, match=r"study.best.limits = 'tip.velocity': is no number of the study"):
        plan_of_cases(dotted)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('measure = "peek"', r"study.best.measure = 'peek'.*did you mean 'peak'"),
        ("", "study.best.measure: is missing"),
        ('measure = "peak"\nworst = ["base.frequency"]', r"study.best.worst: unknown; did you mean 'worst_over'"),
        ('measure = "peak"\nworst_over = ["gap"]', r"study.best.worst_over = 'gap': is no axis of the study"),
        ('measure = "peak"\nworst_over = "gap"', r"study.best.worst_over = 'gap': must be texts"),
        ('measure = "peak"\nlimits = { peak = "low" }', r"study.best.limits.peak = 'low'"),
        ('measure = "peak"\nlimits = 3.0', r"study.best.limits = 3.0: must be numbers"),
        (
            'measure = "impacts_per_cycle"',
            "does not say whether small or large values are better: take one of peak, rms",
        ),
    ],
)
def test_a_wrong_table_of_the_best_is_named_by_its_key(table, words):
    with pytest.raises(fi.InputError, match=words) as caught:
        plan_of_cases(study(f"[study.best]\n{table}\n"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("start", ["base", "space"])
def test_the_study_of_the_best_case_begins_where_the_study_was_at_its_worst(tmp_path, capsys, start):
    text = Path("meshes/stepped_cantilever.toml").read_text(encoding="utf-8")
    text = text.partition("[sweep]")[0] if "[sweep]" in text else text
    plan = '[study]\nmeasures = ["peak"]\ncycles = 30\nstarts = 3\n[study.axes]\n"impactor.ball.gap" = [0.002, 0.003]\n'
    given = read_study(text + plan, Path("meshes/stepped_cantilever.toml"))
    given = replace(given, start=start, output=replace(given.output, figures=False, report=False))
    found = write_parameter_study(given, tmp_path / "results")
    (best,) = fi.best_case(found, "peak").designs
    chosen = fi.load_study(tmp_path / "results" / "best.toml")
    print_results(tmp_path / "results")
    said = "another start, another value" in " ".join(capsys.readouterr().out.split())
    assert (bool(chosen.begins), said) == (start == "base", start == "space")
    page = write_report(tmp_path / "results").read_text(encoding="utf-8")
    assert ("another start, another value)" in page) == said
    if start == "base":
        run = fi.run_study(chosen, tmp_path / "run", parts=("simulate",))
        # the peak of samples, beside that of the motion itself
        assert run.summary["history"]["peak"] == pytest.approx(found["peak_high"].to_numpy()[best.case], rel=2e-3)
        assert found["peak_high"].to_numpy()[best.case] > 1.002 * found["peak_low"].to_numpy()[best.case]
    # a file of another program has its name
    (tmp_path / "results" / "best.toml").write_bytes(b"\xff\x00")
    print_results(tmp_path / "results")
    assert "best.toml" not in capsys.readouterr().out
    page = write_report(tmp_path / "results").read_text(encoding="utf-8")
    assert "femimpact run best.toml" not in page
    assert "best.toml" in page[page.index("What is missing") :]
