"""Separate runs side by side: how many threads, and what happens when one fails."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from femimpact.errors import in_range, quantity, require
from femimpact.progress import Progress

__all__ = ["Progress", "cores", "run_each", "workers_of"]

Case = TypeVar("Case")
Result = TypeVar("Result")


class _Stopped(Exception):  # noqa: N818 - no error: the caller no longer waits for this run
    """Ends a run whose result is no longer wanted."""


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def workers_of(threads: int | None) -> int:
    """Number of threads to use: all cores by default."""
    positive = threads is None or in_range(threads, quantity("1", at_least=1, integer=True))
    require(positive, "threads", threads, "", "must be a whole number >= 1")
    return cores() if threads is None else int(threads)


def run_each(
    run: Callable[[Case, Progress | None], Result], cases: Sequence[Case], workers: int, progress: Progress | None
) -> tuple[Result, ...]:
    """Results of all cases in their order; of several that fail, the first raises.

    Parameters
    ----------
    run : callable
        Of a case and of what it calls with the share of it that is done.
    cases : sequence
    workers : int
        Threads at most.
    progress : callable, optional
        Called with the share done of all, by one thread at a time.

    Returns
    -------
    tuple
    """
    if len(cases) == 1:
        return (run(cases[0], progress),)
    stop, lock, shares = threading.Event(), threading.Lock(), [0.0] * len(cases)

    def report(index: int, share: float) -> None:
        # runs report now and then: the only place where one can be ended
        if stop.is_set():
            raise _Stopped
        with lock:
            shares[index] = share
            if progress is not None:
                progress(sum(shares) / len(shares))

    def one(index: int) -> Result:
        report(index, 0.0)
        return run(cases[index], lambda share: report(index, share))

    if workers == 1:
        return tuple(one(index) for index in range(len(cases)))
    with ThreadPoolExecutor(min(workers, len(cases))) as pool:
        futures = [pool.submit(one, index) for index in range(len(cases))]
        try:
            return tuple(future.result() for future in futures)
        finally:
            # after an error or an interrupt the others are not waited for
            stop.set()
