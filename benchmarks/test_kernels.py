"""Kernels for pytest-benchmark: their history, run against run. Not part of the test run (`testpaths` is tests/).

python -m pytest benchmarks/test_kernels.py --benchmark-autosave
pytest-benchmark compare
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("pytest_benchmark")
sys.path.insert(0, str(Path(__file__).parent))

from problem import load_problem

import femimpact as fi
from femimpact.integrators.stepping.arrays import Inputs
from femimpact.integrators.stepping.run import prepare, run_block

PROBLEM = load_problem()
pytestmark = pytest.mark.benchmark(timer=time.process_time)
STEPS = 2000


def _block(system, cases, contact="end", refine=1, dt=5e-5):
    method = fi.Newmark(dt=dt, contact=contact, refine=refine, allow_coarse_step=True)
    bases = [fi.Sine(PROBLEM.amplitude, 4.0 + 2.0 * i / cases) for i in range(cases)]
    block = prepare(
        system, Inputs(bases, [STEPS] * cases, [0] * cases), method,
        observed=system.point_row("tip"), ledger=False,
    )  # fmt: skip
    return (block,), {}


@pytest.mark.parametrize("cases", [1, 8, 21, 64])
def test_step_of_eight_modes(benchmark, cases):
    benchmark.extra_info["case_steps"] = STEPS * cases
    benchmark.pedantic(run_block, setup=lambda: _block(PROBLEM.modal(), cases), rounds=20, warmup_rounds=1)


@pytest.mark.parametrize("cases", [8, 21])
def test_step_refined_in_touch(benchmark, cases):
    def setup():
        return _block(PROBLEM.modal(), cases, "energy-consistent", 20, 1e-3)

    benchmark.pedantic(run_block, setup=setup, rounds=20, warmup_rounds=1)


@pytest.mark.parametrize("elements", [10, 100])
def test_banded_step(benchmark, elements):
    benchmark.extra_info["case_steps"] = STEPS * 8
    benchmark.pedantic(run_block, setup=lambda: _block(PROBLEM.full(elements), 8), rounds=10, warmup_rounds=1)


@pytest.mark.parametrize("ball", [False, True])
def test_event_driven_sweep(benchmark, ball):
    task, system = PROBLEM.task("B" if ball else "A"), PROBLEM.modal(ball=ball)

    def sweep():
        return fi.frequency_sweep(
            system, PROBLEM.amplitude, PROBLEM.frequencies, fi.EventDriven(),
            duration=task.duration, window=task.window, ledger=False, threads=1,
        )  # fmt: skip

    try:
        sweep()
    except fi.InputError as error:
        pytest.skip(f"refused: {error}")
    benchmark.pedantic(sweep, rounds=10)


@pytest.mark.parametrize("ledger", [False, True])
def test_history_of_every_step(benchmark, ledger):
    record, duration = fi.Recorder(channels=("tip",), ledger=ledger), 0.5
    benchmark.extra_info["case_steps"] = round(duration / 1e-5)
    system, sine = PROBLEM.modal(), fi.Sine(PROBLEM.amplitude, 5.2)
    benchmark.pedantic(
        lambda: fi.integrate(system, sine, fi.Newmark(dt=1e-5), duration, record), rounds=10, warmup_rounds=1
    )
