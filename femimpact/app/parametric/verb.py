"""`parameter_study`: runs the blocks that are not on disk yet, and `load_parameter_study` reads those that are."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.app.parametric.block_files import BLOCKS, BlockFolder, block_folder, read_manifest
from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.identity import plain_study, study_key
from femimpact.app.parametric.labelled import Columns, dataset_of, labels_of
from femimpact.app.parametric.workers import block_cases, check_client, run_blocks
from femimpact.app.results.result_directory import FILES, Lock
from femimpact.app.study.parameter_plan import SamplePlan
from femimpact.app.study.study import Study
from femimpact.errors import InputWarning, check_fields, kind_of, quantity, require, require_path
from femimpact.excitation import Sine
from femimpact.files import write_netcdf
from femimpact.integrators.cases import workers_of
from femimpact.integrators.methods import Method
from femimpact.progress import draws_progress
from femimpact.structure.structure import Position
from femimpact.system.system import System
from femimpact.units import number_text

if TYPE_CHECKING:
    import xarray


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
        If an argument is wrong, before the first case; or the directory holds another study, or is in use.
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
            failed = int(np.count_nonzero(columns.failed))
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

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the directory holds no study, or a damaged one.
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
