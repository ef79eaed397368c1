"""Blocks of a study, run on threads of this process or on the workers of a cluster."""

from __future__ import annotations

import json
import os
import platform
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from femimpact import core
from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.evaluation import evaluated
from femimpact.app.parametric.identity import versions
from femimpact.app.parametric.runs import BlockValues
from femimpact.arrays import Integers
from femimpact.errors import Fault, InputError, InputWarning, kind_of, require
from femimpact.regular_file import read_regular

NEEDED = ("get_executor", "submit", "run", "nthreads")
"""Members that a client must have."""

TIMEOUT = "10s"
"""Time limit of a connection to a scheduler."""

SCHEDULER = "must be the address of a running scheduler, as tcp://host:8786, or its scheduler file"

MOST_BYTES = 10_000_000
"""Most bytes of a scheduler file."""


def check_client(client: object) -> None:
    """Raise `InputError` unless the value is None or a client of a cluster."""
    fits = client is None or (not isinstance(client, type) and all(hasattr(client, name) for name in NEEDED))
    require(fits, "client", kind_of(client), "", "must be a distributed.Client")


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of the scheduler at an address, or of the one that a scheduler file names.

    Raises `InputError` if there is none, or `distributed` is not installed.
    """
    try:
        from distributed import Client
    except ImportError:
        allowed = "needs the library distributed: pip install 'femimpact[cluster]'"
        raise InputError([Fault("scheduler", scheduler, "", allowed)]) from None
    address = _address_of(scheduler)
    make: Any = Client
    try:
        client = make(address, timeout=TIMEOUT)
    except (OSError, ValueError, TypeError) as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise InputError([Fault("scheduler", scheduler, "", f"{SCHEDULER}: {words}")]) from None
    with client:
        yield client


def _address_of(scheduler: str) -> str:
    """The address of a scheduler: the text itself where it has a port, else the one in the file of that name."""
    if ":" in scheduler and not os.path.lexists(scheduler):
        return scheduler
    try:
        address = json.loads(read_regular(scheduler, MOST_BYTES))["address"]
    except OSError as error:
        words = f"no port, and as a file: {error.strerror}"
    except (ValueError, RecursionError):
        words = "the file is not JSON"
    except (KeyError, TypeError, IndexError):
        words = "the file has no address"
    else:
        if isinstance(address, str) and ":" in address:
            return address
        words = "the address in the file has no port"
    raise InputError([Fault("scheduler", scheduler, "", f"{SCHEDULER}: {words}")])


def worker_facts() -> dict[str, str]:
    """Sources, versions and processor of a worker, which decide its numbers."""
    return {**versions(), "processor": f"{core.build_info()['target']} {platform.machine()} {_model()}"}


def _model() -> str:
    """Name of the processor; empty where the system does not tell it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


def check_workers(client: Any) -> None:
    """Refuse workers of another version, and warn of processors of several kinds.

    Raises `InputError` if there is no worker, or one that has no femimpact, other sources or other versions of
    numpy and scipy.
    """
    try:
        found: dict[str, dict[str, str]] = client.run(worker_facts)
    except (ImportError, AttributeError) as error:
        allowed = f"must have workers with the same femimpact as this process: {error}"
        raise InputError([Fault("client", kind_of(client), "", allowed)]) from None
    require(bool(found), "client", "no worker", "", "must have one worker or more")
    for address, facts in found.items():
        _check_versions(f"worker {address}", facts, versions(), "this process")
    processors = sorted({facts.get("processor", "unknown") for facts in found.values()})
    if len(processors) > 1:
        text = f"workers on several kinds of processors ({'; '.join(processors)}): the last bits may depend on which"
        warnings.warn(text, InputWarning, stacklevel=4)


def _check_versions(worker: str, facts: Mapping[str, str], expected: Mapping[str, str], whose: str) -> None:
    """Refuse a worker of another version."""
    for name, version in expected.items():
        # an earlier version may not tell all of it
        other = facts.get(name, "unknown")
        allowed = f"has {name} {other[:12]}, and {whose} {version[:12]}: install the same femimpact"
        require(other == version, worker, None, "", allowed)


@contextmanager
def cluster_executor(client: Any, study: ParameterStudy) -> Iterator[tuple[Executor, Any, int]]:
    """An executor on the workers, the study as `evaluated_there` takes it, and the number of threads of all workers.

    Raises `InputError` if a worker is refused, or the cluster drops the work.
    """
    check_workers(client)
    # a task, whose result is made anew where the worker that had it is lost
    there = client.submit(_received, study, versions(), pure=False)
    try:
        with client.get_executor(pure=False, retries=3) as pool:
            yield pool, there, sum(client.nthreads().values())
    except CancelledError:
        allowed = (
            "has dropped the work: its scheduler must be running, and it and the workers must have every module "
            "that a function of your own uses"
        )
        raise InputError([Fault("client", kind_of(client), "", allowed)]) from None


def _received(study: ParameterStudy, of_client: dict[str, str]) -> tuple[ParameterStudy, dict[str, str]]:
    """The study and the versions of the client's process, on a worker."""
    return study, of_client


def evaluated_there(sent: tuple[ParameterStudy, dict[str, str]], cases: Integers) -> BlockValues:
    """`evaluated` on a worker, which may have come after the others were checked.

    Raises `InputError` if the worker has another version than the process of the client.
    """
    study, of_client = sent
    _check_versions(f"worker {platform.node()}", versions(), of_client, "the process with the client")
    return evaluated(study, cases)


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


def block_cases(study: ParameterStudy) -> list[Integers]:
    """The cases of each block, which follow from the study alone: an earlier call had the same blocks."""
    least = SMALLEST_BLOCK if study.has_cycle else 1
    runs = min(max(-(-study.runs // BLOCKS), least), LARGEST_BLOCK)
    size = max(runs // study.starts, 1)
    order = study.table.running_order
    return [order[first : first + size] for first in range(0, order.size, size)]


def run_blocks(
    study: ParameterStudy, blocks: Sequence[Integers], threads: int, client: Any = None
) -> Iterator[BlockValues]:  # fmt: skip
    """Values of all blocks as they are finished, in any order, from threads or from the workers of a client."""
    if not blocks:
        return
    if client is not None:
        with cluster_executor(client, study) as (pool, there, count):
            yield from _as_finished(pool, evaluated_there, there, blocks, WAITING * max(count, 1))
        return
    with ThreadPoolExecutor(threads) as pool:
        yield from _as_finished(pool, evaluated, study, blocks, WAITING * threads)


def _as_finished(
    pool: Executor, evaluate: Callable[[Any, Integers], BlockValues], study: Any, blocks: Sequence[Integers], most: int
) -> Iterator[BlockValues]:  # fmt: skip
    """Values of all blocks from an executor, which has at most `most` of them at a time."""
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
