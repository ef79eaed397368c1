"""Where blocks run: on threads of this process, or on the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.parametric.cluster import cluster_executor, evaluated_there
from femimpact.parametric.definition import ParameterStudy
from femimpact.parametric.evaluation import BlockValues, evaluated

__all__ = ["block_cases", "run_blocks"]

Numbers = NDArray[np.int64]

LARGEST_BLOCK = 256
"""Runs of a block at most: about a second of work, which is lost where a process is ended."""

SMALLEST_BLOCK = 16
"""Runs of a block at least, unless a case has more: fewer would wait for the disk.

Histories share nothing and may take seconds each: theirs are blocks of one case where there are few.
"""

BLOCKS = 64
"""Blocks of a study that is too small for larger ones: they fill the cores evenly."""

WAITING = 2
"""Blocks for each core that are handed over, so that none waits."""


def block_cases(study: ParameterStudy) -> list[Numbers]:
    """The cases of each block, which follow from the study alone: an earlier call had the same blocks."""
    least = SMALLEST_BLOCK if study.has_cycle else 1
    runs = min(max(-(-study.runs // BLOCKS), least), LARGEST_BLOCK)
    size = max(runs // study.starts, 1)
    order = study.table.running_order
    return [order[first : first + size] for first in range(0, order.size, size)]


def run_blocks(
    study: ParameterStudy, blocks: Sequence[Numbers], threads: int, client: Any = None
) -> Iterator[BlockValues]:  # fmt: skip
    """Values of all blocks as they are finished, whatever their order.

    Parameters
    ----------
    study : ParameterStudy
    blocks : sequence of ndarray of int
    threads : int
    client : distributed.Client, optional
        On whose workers they run, in place of threads.

    Yields
    ------
    BlockValues
    """
    if not blocks:
        return
    if client is not None:
        with cluster_executor(client, study) as (pool, there, count):
            yield from _as_finished(pool, evaluated_there, there, blocks, WAITING * max(count, 1))
        return
    with ThreadPoolExecutor(threads) as pool:
        yield from _as_finished(pool, evaluated, study, blocks, WAITING * threads)


def _as_finished(
    pool: Executor, evaluate: Callable[[Any, Numbers], BlockValues], study: Any, blocks: Sequence[Numbers], most: int
) -> Iterator[BlockValues]:  # fmt: skip
    """The same by any executor, which is handed no more than some blocks at a time."""
    waiting: set[Future[BlockValues]] = set()
    left = iter(blocks)
    try:
        while True:
            while len(waiting) < most and (cases := next(left, None)) is not None:
                waiting.add(pool.submit(evaluate, study, cases))
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    finally:
        # after an error or an interrupt the others are not begun
        for future in waiting:
            future.cancel()
