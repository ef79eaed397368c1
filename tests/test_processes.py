"""Processes in which the tests run side by side: how many they are, and that they share cores and the finished run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from conftest import (
    FEW_FILES,
    MOST_PROCESSES,
    THREADS,
    interactive,
    processes_for,
    pytest_cmdline_main,
    share_of_cores,
)

import femimpact.integrators.cases as threads

CHECKOUT = Path(__file__).parents[1]

COUNT = "import numpy as np, os; a = np.ones((900, 900)); a @ a; print(len(os.listdir('/proc/self/task')))"
"""Prints how many threads a process has after a product of matrices."""


@pytest.mark.parametrize("processes", [1, 2, 3, 100])
def test_all_processes_together_take_no_more_threads_than_there_are_cores_or_one_each(processes, monkeypatch):
    for cores in (1, 2, 7, 64):
        monkeypatch.setattr(threads, "cores", lambda cores=cores: cores)
        assert 1 <= share_of_cores(processes) <= max(cores / processes, 1)


@pytest.mark.skipif("PYTEST_XDIST_WORKER" not in os.environ, reason="this process runs the tests alone")
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no list of threads on this system")
def test_linear_algebra_in_a_process_of_tests_has_its_share_of_the_cores():
    share = min(int(os.environ[name]) for name in THREADS)
    done = subprocess.run([sys.executable, "-c", COUNT], capture_output=True, text=True, check=True)
    assert int(done.stdout) <= share
    assert threads.workers_of(None) <= share


def test_a_few_files_and_what_somebody_looks_at_are_run_in_one_process(monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 64)
    several = [f"tests/{path.name}" for path in sorted(Path(__file__).parent.glob("test_*.py"))]
    many = several[: FEW_FILES + 1]
    for args, processes in (
        (["tests"], MOST_PROCESSES),
        (many, MOST_PROCESSES),
        (several[:FEW_FILES], 0),
        ([f"{many[0]}::test_{i}" for i in range(20)], 0),
    ):
        assert processes_for(args, CHECKOUT, alone=False) == processes
        assert processes_for(args, CHECKOUT, alone=True) == 0
    monkeypatch.setattr(threads, "cores", lambda: 2)
    assert processes_for(["tests"], CHECKOUT, alone=False) == 2
    for changed in ({"usepdb": True}, {"trace": True}, {"capture": "no"}, {}):
        assert interactive(SimpleNamespace(**{"usepdb": False, "trace": False, "capture": "fd"} | changed)) == bool(
            changed
        )


def configured(processes):
    """What pytest has when it begins with a number of processes, or with none given."""
    option = SimpleNamespace(numprocesses=processes, dist="no", usepdb=False, trace=False, capture="fd")
    return SimpleNamespace(option=option, args=["tests"], invocation_params=SimpleNamespace(dir=CHECKOUT))


@pytest.mark.parametrize(("given", "processes", "dist"), [(None, 2, "loadfile"), (0, 0, "no"), (5, 5, "no")])
def test_the_command_line_decides_before_the_number_of_cores(monkeypatch, given, processes, dist):
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)
    monkeypatch.setattr(threads, "cores", lambda: 2)
    config = configured(given)
    pytest_cmdline_main(config)
    assert (config.option.numprocesses, config.option.dist) == (processes, dist)
    # without pytest-xdist there is no such option
    pytest_cmdline_main(SimpleNamespace(option=SimpleNamespace()))


def test_a_process_of_tests_begins_no_further_ones(monkeypatch):
    monkeypatch.setenv("PYTEST_XDIST_WORKER", "gw0")
    config = configured(None)
    pytest_cmdline_main(config)
    assert config.option.numprocesses is None
    monkeypatch.delenv("PYTEST_XDIST_WORKER")
    config.workerinput = {}
    pytest_cmdline_main(config)
    assert config.option.numprocesses is None
