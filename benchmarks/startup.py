"""From nothing to a finished task B, a first call beside a second, and the time of the help."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

__all__ = ["help_time", "start_times"]

HERE = Path(__file__).parent


def _wall(command):
    """Wall time (s) of a child process, Python's start included, and what it printed; a text where it fails."""
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return (done.stderr.strip().splitlines() or ["failed"])[-1]
    return time.perf_counter() - start, done.stdout


def start_times(repeats=3):
    """Rows: for each method wall times (s) of a process that runs task B once, and of two calls in one process."""
    from contestants import OWN

    rows = []
    for index, tool in enumerate(OWN[:3]):
        command = [sys.executable, str(HERE / "startup.py"), "--task-b", str(index)]
        once = [_wall([*command, "1"]) for _ in range(repeats)]
        twice = [_wall([*command, "2"]) for _ in range(repeats)]
        texts = [found for found in once + twice if isinstance(found, str)]
        if texts:
            rows.append({"method": tool.NAME, "refused": texts[0]})
            continue
        calls = [[float(part) for part in printed.split()] for _, printed in twice]
        first, second = (min(times) for times in zip(*calls, strict=True))
        rows.append({"method": tool.NAME, "start": min(wall for wall, _ in once), "first": first, "second": second})
    return rows


def help_time(repeats=5):
    """Wall time (s) of `femimpact --help`."""
    beside = Path(sys.executable).parent / "femimpact"
    command = [str(beside)] if beside.exists() else [sys.executable, "-m", "femimpact"]
    return min(_wall([*command, "--help"])[0] for _ in range(repeats))


def _task_b(index, calls):
    """Runs the task that many times and prints the wall times (s)."""
    from contestants import OWN
    from problem import load_problem

    problem = load_problem()
    task = problem.task("B")
    # kept from here on: what assembles it is imported and paid for once
    OWN[index].system(problem, task)
    for _ in range(calls):
        start = time.perf_counter()
        OWN[index].sweep(problem, task)
        print(time.perf_counter() - start)


def main() -> None:
    for row in start_times():
        print(", ".join(f"{name} {value}" for name, value in row.items()))
    print(f"femimpact --help {help_time():.3f}")


if __name__ == "__main__":
    if "--task-b" in sys.argv:
        _task_b(int(sys.argv[-2]), int(sys.argv[-1]))
    else:
        main()
