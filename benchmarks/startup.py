"""From nothing to a finished task B, with nothing compiled and with a warm cache; and the time of the help."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

__all__ = ["help_time", "start_times"]

HERE = Path(__file__).parent


def _wall(command, environment=None):
    """Wall time (s) of a child process, Python's start included; a text where it fails."""
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        return (done.stderr.strip().splitlines() or ["failed"])[-1]
    return time.perf_counter() - start


def start_times(repeats=3):
    """Rows: for each method cold and warm wall time of a finished task B in a process of its own."""
    from contestants import OWN

    rows = []
    for index, tool in enumerate(OWN[:3]):
        command = [sys.executable, str(HERE / "startup.py"), "--task-b", str(index)]
        cold, warm = [], []
        for _ in range(repeats):
            with tempfile.TemporaryDirectory() as folder:
                environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
                cold.append(_wall(command, environment))
                warm += [_wall(command, environment) for _ in range(2)]
        texts = [value for value in cold + warm if isinstance(value, str)]
        if texts:
            rows.append({"method": tool.NAME, "refused": texts[0]})
        else:
            rows.append({"method": tool.NAME, "cold": min(cold), "warm": min(warm)})
    return rows


def help_time(repeats=5):
    """Wall time (s) of `femimpact --help`."""
    beside = Path(sys.executable).parent / "femimpact"
    command = [str(beside)] if beside.exists() else [sys.executable, "-m", "femimpact"]
    return min(_wall([*command, "--help"]) for _ in range(repeats))


def _task_b(index):
    from contestants import OWN
    from problem import load_problem

    problem = load_problem()
    OWN[index].sweep(problem, problem.task("B"))


if __name__ == "__main__" and "--task-b" in sys.argv:
    _task_b(int(sys.argv[-1]))
