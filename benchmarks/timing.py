"""CPU and wall time of jobs that take turns, so that what else the machine does meets all of them alike."""

from __future__ import annotations

import datetime
import gc
import os
import platform
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

__all__ = ["Job", "Measured", "machine", "take_turns", "timed"]


@dataclass
class Measured:
    """Least CPU and wall time of some runs (s), what the last one gave, and how many there were."""

    cpu: float
    wall: float
    result: Any
    repeats: int


@dataclass
class Job:
    """What is timed: a function without arguments, and how often."""

    name: str
    call: Callable[[], Any]
    repeats: int = 5


def timed(call: Callable[[], Any]) -> tuple[float, float, Any]:
    """CPU and wall time (s) of one call, and its result."""
    gc.collect()
    wall, cpu = time.perf_counter(), time.process_time()
    result = call()
    return time.process_time() - cpu, time.perf_counter() - wall, result


def take_turns(jobs: list[Job], say: Callable[[str], None] = lambda text: None) -> dict[str, Measured | str]:
    """Every job its number of times, one after the other in turns; a text says why one failed.

    A call may itself return (cpu, wall, result) as a `Child` does: then these count.
    """
    found: dict[str, Measured | str] = {}
    for turn in range(max((job.repeats for job in jobs), default=0)):
        for job in jobs:
            before = found.get(job.name)
            if turn >= job.repeats or isinstance(before, str):
                continue
            say(f"{job.name}, {turn + 1} of {job.repeats}")
            try:
                outcome = job.call() if isinstance(job.call, Child) else timed(job.call)
            except (ValueError, RuntimeError, ArithmeticError, OSError, BrokenProcessPool) as error:
                first = str(error).strip().splitlines() or [type(error).__name__]
                found[job.name] = first[0]
                continue
            cpu, wall, result = outcome
            if before is None:
                found[job.name] = Measured(cpu, wall, result, 1)
            else:
                found[job.name] = Measured(min(before.cpu, cpu), min(before.wall, wall), result, turn + 1)
    return found


class Child:
    """A call in a separate process, which stays for the next one; the time is taken there."""

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self.function, self.arguments = function, arguments
        self.pool: ProcessPoolExecutor | None = None

    def __call__(self) -> tuple[float, float, Any]:
        """CPU and wall time (s) in the child, and the result."""
        if self.pool is None:
            self.pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_silent)
            # imports and first-use costs are nobody's task
            self.pool.submit(self.function, *self.arguments).result()
        return self.pool.submit(_timed_in_child, self.function, self.arguments).result()

    def close(self) -> None:
        """End the process."""
        if self.pool is not None:
            self.pool.shutdown(wait=False, cancel_futures=True)


def _silent():
    """What a tool prints about itself is not part of the table."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)


def _timed_in_child(function, arguments):
    return timed(lambda: function(*arguments))


def machine() -> dict[str, str]:
    """Processor, cores, Python and date."""
    name = platform.processor() or platform.machine()
    listing = Path("/proc/cpuinfo")
    if listing.exists():
        for line in listing.read_text().splitlines():
            if line.startswith("model name"):
                name = line.split(":", 1)[1].strip()
                break
    return {
        "processor": name,
        "cores": str(os.cpu_count()),
        "system": platform.system(),
        "python": platform.python_version(),
        "date": datetime.date.today().isoformat(),
    }
