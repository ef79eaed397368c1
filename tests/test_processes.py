"""Processes in which the tests run side by side: how many they are, and that they share cores and the finished run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from conftest import FEW_FILES, MOST_PROCESSES, THREADS, pytest_xdist_auto_num_workers, share_of_cores

import femimpact.integrators.threads as threads

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


def asked(folder, *args, capture="fd"):
    """What pytest knows when it asks how many processes there shall be."""
    invocation = SimpleNamespace(dir=folder)
    return SimpleNamespace(args=list(args), option=SimpleNamespace(capture=capture), invocation_params=invocation)


def test_a_few_files_and_what_is_not_captured_are_run_in_this_process(monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 64)
    several = [f"tests/{path.name}" for path in sorted(Path(__file__).parent.glob("test_*.py"))]
    many = several[: FEW_FILES + 1]
    for args, processes in (
        (["tests"], MOST_PROCESSES),
        (many, MOST_PROCESSES),
        (several[:FEW_FILES], 0),
        ([f"{many[0]}::test_{i}" for i in range(20)], 0),
    ):
        assert pytest_xdist_auto_num_workers(asked(CHECKOUT, *args)) == processes
        assert pytest_xdist_auto_num_workers(asked(CHECKOUT, *args, capture="no")) == 0
    monkeypatch.setattr(threads, "cores", lambda: 2)
    assert pytest_xdist_auto_num_workers(asked(CHECKOUT, "tests")) == 2
