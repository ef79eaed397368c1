"""What a study takes, as estimated before it runs, beside what it takes."""

from __future__ import annotations

import dataclasses
import re
import tracemalloc

import numpy as np
import pytest
from builders import (
    NO_PICTURES,
    REFERENCE,
    MeshChoice,
    Reduction,
    SweepPlan,
    done,
    paper_study,
    plan_lines,
    prepare,
    run_study,
    short_study,
)

import femimpact as fi
from femimpact.app.study.prepared import history_cost, mesh_memory, picture_seconds, sweep_cost
from femimpact.app.tasks.convergence import task_of_convergence
from femimpact.app.tasks.run import run_modes, runs_of_history
from femimpact.integrators.methods import seconds_of_cycle
from femimpact.sweep.curve import on_grid


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Without pictures and report; run once, so that libraries are there before memory is measured."""
    study = short_study(1.0, points=4, every=1, **NO_PICTURES)
    for method in ("newmark", "event-driven"):
        one = dataclasses.replace(study, method={"name": method})
        run_study(one, tmp_path_factory.mktemp("warm") / "out")
    return study


def peak_of(work):
    """Bytes that numpy and Python hold at most while something is done."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(("method", "duration"), [("newmark", 20.0), ("event-driven", 200.0)])
def test_memory_of_a_history_is_met_within_a_factor_of_two(tmp_path, study, method, duration):
    study = dataclasses.replace(study, duration=duration, method={"name": method})
    ready = prepare(study, ("simulate",))
    asked = history_cost(study, ready.small, ready.method, ready.record, 1).memory
    taken = peak_of(lambda: run_study(study, tmp_path / "out", parts=("simulate",)))
    assert 0.5 < taken / asked < 2.0


def test_memory_of_several_drives_has_the_pieces_of_each(tmp_path, study):
    forces = tuple(fi.PointForce("tip", fi.Chirp(20.0, 40.0, 12.0, amplitude=1e-4), name) for name in "abc")
    study = dataclasses.replace(
        study,
        base=fi.Chirp(20.0, 40.0, 12.0, amplitude=1e-7),
        forces=forces,
        duration=None,
        method={"name": "event-driven"},
        sweep=None,
        output=dataclasses.replace(study.output, every=50),
    )
    ready = prepare(study, ("simulate",))
    asked = history_cost(study, ready.small, ready.method, ready.record, 1).memory
    taken = peak_of(lambda: run_study(study, tmp_path / "out", parts=("simulate",)))
    # 1.8 without the pieces
    assert 0.7 < taken / asked < 1.5


@pytest.mark.parametrize(("method", "points", "cycles"), [("newmark", 40, 1000), ("event-driven", 400, 60)])
def test_memory_of_a_sweep_is_met_within_a_factor_of_two(tmp_path, study, method, points, cycles):
    study = dataclasses.replace(study, sweep=SweepPlan(4.0, 6.0, points, cycles), method={"name": method})
    ready = prepare(study, ("sweep",))
    taken = peak_of(lambda: run_study(study, tmp_path / "out", parts=("sweep",)))
    assert 0.5 < taken / sweep_cost(study, ready.small, ready.method).memory < 2.0


@pytest.mark.parametrize(("elements", "modes"), [(4000, None), (300, 300), (1000, 150)])
def test_memory_of_mesh_and_modes_is_met_within_a_factor_of_two(study, elements, modes):
    reduction = None if modes is None else Reduction(modes)
    study = dataclasses.replace(study, mesh=MeshChoice(elements=elements), reduction=reduction)
    taken = peak_of(lambda: prepare(study, ()) if modes else run_modes(prepare(study, ("modes",))))
    assert 0.5 < taken / max(mesh_memory(elements, modes).values()) < 2.0


@pytest.mark.parametrize("structure", [REFERENCE, dataclasses.replace(REFERENCE, impactors=())])
def test_memory_of_a_convergence_is_met_within_a_factor_of_two(tmp_path, study, structure):
    task = task_of_convergence(dataclasses.replace(study, structure=structure))
    asked = float(re.search(r"about ([\d.]+) MB", "\n".join(task.plan().lines))[1])
    assert 0.5 < peak_of(lambda: done(task, tmp_path / "out")) / 1e6 / asked < 2.0


def test_what_does_not_fit_is_one_line_before_any_work(study, monkeypatch):
    monkeypatch.setattr("femimpact.app.study.study.assemble", lambda *_a, **_k: pytest.fail("must not be assembled"))
    large = dataclasses.replace(study, mesh=MeshChoice(elements=20_000), reduction=Reduction(20_000))
    for work in (plan_lines, prepare, lambda study: run_study(study, "never")):
        with pytest.raises(fi.InputError, match=r"memory_limit = 1e9|memory_limit = 1000000000.0") as caught:
            work(large)
        assert len(str(caught.value).splitlines()) == 1
        assert "20000 elements" in str(caught.value)


def test_a_sweep_that_does_not_fit_is_refused(study):
    long = dataclasses.replace(study, sweep=SweepPlan(4.0, 6.0, points=1000, cycles=10_000_000))
    with pytest.raises(fi.InputError, match="what the sweep takes: take fewer points or cycles"):
        prepare(long)


def test_the_plan_names_memory_and_time(study):
    text = "\n".join(plan_lines(study))
    for words in ("history: 10000 steps", "sweep: up to 4 frequencies", "MB", "for the libraries"):
        assert words in text


def test_the_run_that_finds_the_largest_values_is_in_the_time_of_a_history(study):
    ready = prepare(study, ("simulate",))
    sparse = dataclasses.replace(ready.record, every=1000, interval=None)

    def seconds(times):
        longer = dataclasses.replace(study, duration=times * study.duration)
        return history_cost(longer, ready.small, ready.method, sparse, runs_of_history(ready)).seconds

    cycles = study.duration * study.base.frequency
    run = seconds_of_cycle(ready.method, ready.small, study.base.frequency) * cycles
    # the samples that are written take a hundredth of a run
    assert seconds(200.0) - seconds(100.0) == pytest.approx(100.0 * 2.0 * run, rel=0.05)
    # without a cycle the history is run without its ball too
    shock = fi.Shock("half-sine", acceleration=10.0, duration=0.01)
    assert runs_of_history(ready) == 2
    assert runs_of_history(dataclasses.replace(ready, study=dataclasses.replace(study, base=shock, sweep=None))) == 4


def test_points_of_a_grid_are_found_in_linear_memory():
    coarse = np.linspace(4.0, 6.0, 30_001)
    frequency = np.unique(np.round(np.concatenate([coarse, np.linspace(4.9, 5.1, 20_011)]), 9))
    # by all pairs, n x n: 1.5e9 numbers
    assert peak_of(lambda: on_grid(frequency, coarse)) < 50 * frequency.size * 8
    found = on_grid(frequency, coarse)
    # each point of the even grid is found once, and nothing else
    assert found.sum() == coarse.size
    np.testing.assert_allclose(frequency[found], coarse, atol=1e-9)
    assert on_grid([1.0, 2.0], []).tolist() == [False, False]
    assert on_grid([1.0, 2.0, 3.0], [2.0]).tolist() == [False, True, False]


def test_pictures_are_part_of_the_estimate_and_only_those_that_are_asked_for():
    paper = paper_study()
    assert picture_seconds(paper) > 3.0
    none = dataclasses.replace(paper, output=dataclasses.replace(paper.output, figures=False, movie=False))
    assert picture_seconds(none) == 0.0
    still = dataclasses.replace(paper, output=dataclasses.replace(paper.output, figures=True, movie=False))
    assert 0.0 < picture_seconds(still) < picture_seconds(paper)
