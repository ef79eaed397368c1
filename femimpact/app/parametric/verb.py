"""`parameter_study`: runs the blocks that are not on disk yet, on threads or on the workers of a cluster.

`load_parameter_study` reads those that are.
"""

from __future__ import annotations

import json
import os
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact import core
from femimpact.app.parametric.dataset import (
    BLOCKS,
    BlockFolder,
    Columns,
    block_folder,
    dataset_of,
    labels_of,
    read_manifest,
)
from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.identity import plain_study, study_key, versions
from femimpact.app.parametric.runs import BlockValues, evaluated
from femimpact.app.results.result_directory import FILES, Lock
from femimpact.app.study.parameter_plan import SamplePlan
from femimpact.app.study.study import Study
from femimpact.arrays import Integers
from femimpact.errors import (
    Fault,
    InputError,
    InputWarning,
    check_fields,
    kind_of,
    quantity,
    require,
    require_path,
    warns,
)
from femimpact.excitation.harmonic import Sine
from femimpact.files import write_netcdf
from femimpact.integrators.cases import workers_of
from femimpact.integrators.methods import Method
from femimpact.progress import draws_progress
from femimpact.regular_file import read_regular
from femimpact.structure.structure import Position
from femimpact.system.system import System
from femimpact.units import number_text

if TYPE_CHECKING:
    import xarray


LARGEST_BLOCK = 256
"""Runs of a block at most: about a second of work, which is lost where a process is ended."""

SMALLEST_BLOCK = 16
"""Runs of a block at least, unless a case has more: fewer would wait for the disk.

Histories share nothing and may take seconds each: theirs are blocks of one case where there are few.
"""

FEWEST_BLOCKS = 64
"""Blocks of a study that is too small for larger ones: they fill the cores evenly."""

WAITING = 2
"""Blocks for each core that are handed over, so that none waits."""

NEEDED = ("get_executor", "submit", "run", "nthreads")
"""Members that a client must have."""

TIMEOUT = "10s"
"""Time limit of a connection to a scheduler."""

SCHEDULER = "must be the address of a running scheduler, as tcp://host:8786, or its scheduler file"

MOST_BYTES = 10_000_000
"""Most bytes of a scheduler file."""


@dataclass(frozen=True)
class StudyProgress:
    """How far a study is.

    Parameters
    ----------
    cases : int
    finished : int
        Those found on disk included.
    found : int
        Cases that an earlier call had finished.
    failed : int
        Finished cases of which a start has no values.
    rate : float, 1/s
        Cases finished in a second by this call.
    """

    cases: int = field(metadata=quantity("1", at_least=1, integer=True))
    finished: int = field(metadata=quantity("1", at_least=0, integer=True))
    found: int = field(metadata=quantity("1", at_least=0, integer=True))
    failed: int = field(metadata=quantity("1", at_least=0, integer=True))
    rate: float = field(metadata=quantity("1/s", at_least=0.0))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def share(self) -> float:
        """Share that is done, 0 to 1."""
        return self.finished / self.cases

    @property
    def remaining(self) -> float:
        """Time (s) that the rest takes at this rate; infinite before the first cases."""
        left = self.cases - self.finished
        return left / self.rate if self.rate > 0.0 else float("inf") if left else 0.0

    def __float__(self) -> float:
        return self.share

    def __str__(self) -> str:
        failed = f", {self.failed} failed" if self.failed else ""
        return f"{self.finished} of {self.cases} cases, {number_text(self.rate, 3)}/s{failed}"


@warns
@draws_progress
def parameter_study(
    study: Study | System | Callable[..., Any],
    axes: Mapping[str, Any] | Sequence[Mapping[str, Any]],
    measures: Sequence[str | Callable[..., Any]],
    *,
    starts: int = 1,
    seed: int = 0,
    sample: SamplePlan | Mapping[str, Any] | None = None,
    cycles: int | None = None,
    excitation: Sine | None = None,
    method: Method | None = None,
    at: Position | None = None,
    elements: int = 40,
    modes: int = 4,
    version: str | None = None,
    directory: str | Path | None = None,
    client: Any = None,
    threads: int | None = None,
    progress: Callable[[StudyProgress], None] | bool | None = None,
) -> xarray.Dataset:
    """Measures of many cases over named axes, each from one start or several.

    A case is run at the frequency of its base for whole cycles, of which the last third is measured.

    Parameters
    ----------
    study, axes, measures, starts, seed, sample, cycles, excitation, method, at, elements, modes, version
        What is studied; see `ParameterStudy`.
    directory : str or Path, optional
        Where finished blocks are kept, and `study.nc` is written. The same call goes on from the blocks that are
        there, and gives the dataset of a call that was never interrupted, to the last bit.
    client : distributed.Client, optional
        On whose workers the cases run; this process alone writes. The results are the same, to the last bit, on
        processors of the same kind.
    threads : int, optional
        Without a client: the number of cores by default; the results do not depend on it, to the last bit.
    progress : callable or bool, optional
        Called with a `StudyProgress` after each block; True draws a bar.

    Returns
    -------
    xarray.Dataset
        The axes as coordinates, of a list or a sample along "case". For each measure its value, of several starts the
        median, `_low` and `_high`, from 5 starts on `_median_low` and `_median_high`, and `_groups`. `failure` says
        why a case has no values.

    Raises
    ------
    InputError
        Before the first case; also if the directory holds another study, or is in use.
    """
    definition = ParameterStudy(
        study, axes, measures, starts=starts, seed=seed, sample=sample, cycles=cycles, excitation=excitation,
        method=method, at=at, elements=elements, modes=modes, version=version,
    )  # fmt: skip
    usable = progress is None or (callable(progress) and not isinstance(progress, type))
    require(usable, "progress", kind_of(progress), "", "must be True, or callable with a StudyProgress")
    return run_parameter_study(
        definition, directory=directory, client=client, threads=threads, say=to_stderr,
        progress=progress if callable(progress) else None,
    )  # fmt: skip


def to_stderr(line: str) -> None:
    """Print a line to standard error, beside the progress."""
    print(line, file=sys.stderr, flush=True)


def run_parameter_study(
    study: ParameterStudy,
    *,
    directory: str | Path | None = None,
    client: Any = None,
    threads: int | None = None,
    progress: Callable[[StudyProgress], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> xarray.Dataset:
    """Run a study that has been checked; the other arguments are those of `parameter_study`."""
    check_client(client)
    workers = workers_of(threads)
    columns = Columns(labels_of(study))
    if directory is None:
        _run(study, columns, None, workers, client, progress, say)
        return dataset_of(columns)
    require_path(directory, "directory", "a directory")
    target = Path(directory)
    require(not target.exists() or target.is_dir(), "directory", str(directory), "", "must be a directory")
    plain = plain_study(study)
    lock = Lock(target)
    try:
        labelled = {"study": plain, "table": columns.labels}
        folder = block_folder(target, labelled, study_key(plain), say or (lambda line: None))
        folder.remove_unfinished()
        _run(study, columns, folder, workers, client, progress, say)
        dataset = dataset_of(columns)
        write_netcdf(target / FILES["parameter_study"].name, dataset)
    finally:
        lock.release()
    return dataset


def _run(
    study: ParameterStudy, columns: Columns, folder: BlockFolder | None, threads: int, client: Any,
    progress: Callable[[StudyProgress], None] | None, say: Callable[[str], None] | None,
) -> None:  # fmt: skip
    """Fill the columns from the blocks on disk, then from those that are run now."""
    begun = time.monotonic()
    for block in () if folder is None else folder.blocks():
        columns.add(block)
    found = columns.finished
    left = [cases for cases in block_cases(study) if not columns.done[cases].all()]
    if found and say is not None:
        say(f"found {found} of {columns.cases} finished")

    def report() -> None:
        if progress is not None:
            finished, lasted = columns.finished, time.monotonic() - begun
            failed = int(np.count_nonzero(columns.values["failed_starts"]))
            progress(StudyProgress(columns.cases, finished, found, failed, (finished - found) / max(lasted, 1e-9)))

    report()
    for block in run_blocks(study, left, threads, client):
        if folder is not None:
            folder.write(block)
        columns.add(block)
        report()


def load_parameter_study(directory: str | Path) -> xarray.Dataset:
    """The dataset of a study from the blocks in its directory; cases that are not finished have no values.

    Parameters
    ----------
    directory : str or Path
        That of `parameter_study`, which may be at work.
    """
    require_path(directory, "directory", "a directory")
    manifest, folder = read_manifest(Path(directory)), Path(directory) / BLOCKS
    columns = Columns(manifest["table"])

    def damaged(name: str, reason: str) -> None:
        text = f"{folder / name} is damaged ({reason}): its cases count as not finished"
        warnings.warn(text, InputWarning, stacklevel=4)

    for block in BlockFolder(folder, manifest["key"], damaged).blocks():
        columns.add(block)
    return dataset_of(columns)


# ---- blocks, on threads or on a cluster ----------------------------------------------------------------


def block_cases(study: ParameterStudy) -> list[Integers]:
    """The cases of each block, which follow from the study alone: an earlier call had the same blocks."""
    least = SMALLEST_BLOCK if study.has_cycle else 1
    runs = min(max(-(-study.runs // FEWEST_BLOCKS), least), LARGEST_BLOCK)
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


def check_client(client: object) -> None:
    """Raise `InputError` unless the value is None or a client of a cluster."""
    fits = client is None or (not isinstance(client, type) and all(hasattr(client, name) for name in NEEDED))
    require(fits, "client", kind_of(client), "", "must be a distributed.Client")


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of the scheduler at an address, or of the one that a scheduler file names."""
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
    """An executor on the workers, the study as `evaluated_there` takes it, and the number of threads of all workers."""
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
    """`evaluated` on a worker, which may have come after the others were checked."""
    study, of_client = sent
    _check_versions(f"worker {platform.node()}", versions(), of_client, "the process with the client")
    return evaluated(study, cases)
