"""The results of a study read back from its directory, and the summary with their checksums."""

from __future__ import annotations

import gc
import hashlib
import json
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from femimpact.app.results.result_directory import (
    FILES,
    REPORT,
    SUMMARY,
    ResultFileWarning,
    result_files,
    unfinished_state,
)
from femimpact.app.study.findings import Findings, read_findings, summary_of
from femimpact.errors import Fault, InputError, require, require_path
from femimpact.files import atomic_path, load_netcdf, read_csv, write_json
from femimpact.files import plain as plain_data
from femimpact.regular_file import open_regular
from femimpact.signals.decay import DecayEstimate
from femimpact.table import Head, head_of_values, short_repr

if TYPE_CHECKING:
    import xarray


IDENTIFIED = ("identify.json", "identify.png")
"""Files of `write_decay`."""

T = TypeVar("T")

SUMMARY_CHECKSUM = "checksum"
"""Key of the summary: SHA-256 of the summary without this key."""


@short_repr
@dataclass(frozen=True, eq=False)
class StudyResults:
    """Results of a study, read back from its directory.

    Parameters
    ----------
    directory : Path
    summary : mapping
        `summary.json`, as it stands in the file.
    modes, impacts, sticking, bifurcations : mapping of str to ndarray, or None
        Tables by column; no sticking where nothing stuck. The last one is of branches of periodic orbits.
    sweep, history, impact_data, branches : xarray.Dataset or None
        The third holds the impacts with the energy to each mode, the last one the branches of periodic orbits.
    """

    directory: Path
    summary: Mapping[str, Any]
    modes: Mapping[str, Any] | None
    impacts: Mapping[str, Any] | None
    sweep: xarray.Dataset | None
    history: xarray.Dataset | None
    impact_data: xarray.Dataset | None
    sticking: Mapping[str, Any] | None
    branches: xarray.Dataset | None = None
    bifurcations: Mapping[str, Any] | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What may make a number of the results wrong."""
        return read_findings(self.summary).warnings

    @property
    def _head(self) -> Head:
        tables = {name: getattr(self, name) for name in ("modes", "impacts", "sticking", "bifurcations")}
        data = {name: getattr(self, name) for name in ("sweep", "history", "impact_data", "branches")}
        values = {name: ", ".join(table) for name, table in tables.items() if table is not None}
        values |= {name: ", ".join(map(str, found.data_vars)) for name, found in data.items() if found is not None}
        values["warnings"] = "; ".join(self.warnings) or "none"
        return head_of_values(f"StudyResults: {self.directory}", values)


def load(directory: str | Path) -> StudyResults:
    """Read the results that a study left in a directory.

    Parameters
    ----------
    directory : str or Path

    Raises
    ------
    InputError
        If the directory holds no results or unfinished ones, a file is missing or cannot be read, or a key of the
        summary is damaged.

    Warns
    -----
    ResultFileWarning
        For a file that can be read but is not the one that the study left, and for pictures, scenes and other
        files that are lost or changed.

    Examples
    --------
    >>> import femimpact as fi
    >>> results = fi.load("study-results")  # doctest: +SKIP
    >>> results.sweep["ball_peak"].max()  # doctest: +SKIP
    """
    require_path(directory, "directory", "a directory")
    folder = Path(directory)
    summary = read_summary(folder)
    checksums = read_findings(summary).checksums
    names = {name: FILES[key].name for name, key in READ.items()}
    contents: dict[str, Any] = {name: read_file(folder, file, checksums) for name, file in names.items()}
    _check_others(folder, checksums, set(names.values()))
    return StudyResults(folder, summary, **contents)


READ = {
    **{name: name for name in ("modes", "impacts", "history", "impact_data", "sticking", "branches", "bifurcations")},
    "sweep": "sweep_data",
}
"""Files of `StudyResults`, by its fields and their keys in `FILES`."""


def _check_others(folder: Path, checksums: Mapping[str, str], read: set[str]) -> None:
    """Warn of files of the results that are lost or changed, but for those that were read."""
    others = {name: expected for name, expected in checksums.items() if name not in read}
    lost = sorted(name for name in others if not (folder / name).is_file())
    if lost:
        shown = ", ".join(lost[:3]) + (f" and {len(lost) - 3} more" if len(lost) > 3 else "")
        text = f"{folder}: missing, though {SUMMARY} names them among the results: {shown}"
        warnings.warn(text, ResultFileWarning, stacklevel=3)
    for name, expected in others.items():
        if name not in lost and _differs(folder / name, expected):
            _warn_changed(folder / name)


def _differs(path: Path, expected: str) -> bool:
    try:
        return checksum(path) != expected
    except OSError:
        return True


def read_summary(folder: Path) -> dict[str, Any]:
    """The summary of a directory of results.

    Raises `InputError` if there is none, it cannot be read, or the results are unfinished.
    """
    path = folder / SUMMARY
    if not path.is_file():
        state = unfinished_state(folder)
        allowed = f"must hold results of a study ({SUMMARY} is missing)"
        require(False, "directory", str(folder), "", f"is incomplete: {state}" if state else allowed)
    try:
        with open_regular(path) as file:
            summary = json.loads(file.read().decode("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise _damaged(path, _in_words(error)) from None
    if not isinstance(summary, dict):
        raise _damaged(path, "no summary of a study")
    # before its keys are read as `Findings`
    if "checksums" in summary and summary.get(SUMMARY_CHECKSUM) != _of_summary(summary):
        _warn_changed(path)
    return summary


def read_file(folder: Path, name: str, checksums: Mapping[str, str], group: str | None = None) -> Any:
    """A table by column or a labelled dataset of the results, by the name of its file; None where they have none.

    Of a netCDF file it may be a group.

    Raises `InputError` if it is missing or cannot be read.
    """
    path, expected = folder / name, checksums.get(name)
    if checksums and expected is None:
        # of a part of a run that was ended before its summary was written
        return None
    if not path.exists():
        if expected is not None:
            raise InputError([Fault("file", str(path), "", f"is missing: {SUMMARY} names it among the results")])
        return None
    changed = expected is not None and undamaged(path, checksum) != expected
    content = undamaged(path, partial(load_netcdf, group=group) if path.suffix == ".nc" else read_csv)
    if changed:
        _warn_changed(path)
    return content


def undamaged(path: Path, reader: Callable[[Path], T]) -> T:
    """What a reader makes of a file.

    Raises `InputError` if it cannot be read.
    """
    with _quiet_finalizers():
        try:
            return reader(path)
        # what a damaged file makes a reader raise is without limit
        except Exception as error:
            problem = _in_words(error)
        # what the reader had opened
        gc.collect()
    raise _damaged(path, problem)


@contextmanager
def _quiet_finalizers() -> Iterator[None]:
    """Without a word from objects that end half made: h5netcdf's file prints a traceback for a damaged one."""
    before = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        yield
    finally:
        sys.unraisablehook = before


def _in_words(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


def _damaged(path: Path, problem: str) -> InputError:
    return InputError([Fault("file", str(path), "", f"is damaged and cannot be read: {problem}")])


def _warn_changed(path: Path) -> None:
    text = f"{path}: is not as the study left it (its SHA-256 differs from that in {SUMMARY})"
    warnings.warn(text, ResultFileWarning, stacklevel=5)


# ---- writing --------------------------------------------------------------------------------------


def checksum(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _of_summary(summary: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in summary.items() if key != SUMMARY_CHECKSUM}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def write_summary(
    folder: Path,
    findings: Findings,  # checksums in it are of files that are still as they were
) -> None:
    """Write the summary of the files in a folder, with their checksums."""
    # the report is made again at any time
    names = (name for name in result_files(folder) if name not in (SUMMARY, REPORT))
    sums = {name: findings.checksums.get(name) or checksum(folder / name) for name in names}
    plain = plain_data(summary_of(replace(findings, checksums=sums)))
    write_json(folder / SUMMARY, {**plain, SUMMARY_CHECKSUM: _of_summary(plain)})


def write_decay(
    directory: Path,
    decay: DecayEstimate,
    record: xarray.Dataset,  # which it is of
    force: bool,  # whether files of the same names are replaced
) -> None:
    """Write what was identified from a record as JSON and as a figure."""
    from femimpact import figures

    there = ", ".join(name for name in IDENTIFIED if (directory / name).exists())
    require(force or not there, "output", str(directory), "", f"has {there} already: choose another, or --force")
    require(not directory.exists() or directory.is_dir(), "output", str(directory), "", "must be a directory")
    directory.mkdir(parents=True, exist_ok=True)
    columns, units = decay.columns()
    content = {
        "source": record.attrs.get("source", ""), "signal": str(next(iter(record.data_vars))),
        "level": decay.level, "modes": [vars(mode) for mode in decay.modes], "noise": decay.noise,
        "over_amplitude": {name: values.tolist() for name, values in columns.items()},
        "units": {**units, "noise": decay.unit},
        "warnings": decay.warnings, "notes": [*record.attrs.get("notes", ()), *decay.notes],
    }  # fmt: skip
    text = json.dumps(plain_data(content), indent=2, ensure_ascii=False) + "\n"
    # both or none: one alone would be in the way of the next run
    with atomic_path(directory / IDENTIFIED[0]) as table, atomic_path(directory / IDENTIFIED[1]) as picture:
        table.write_text(text, encoding="utf-8")
        figures.save_figure(figures.decay(decay, ax=figures.OffScreen()), picture)
