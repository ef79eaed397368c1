"""The files that a study leaves behind: their names, their checksums, and how they are read back."""

from __future__ import annotations

import gc
import hashlib
import json
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from femimpact.errors import Fault, InputError, require
from femimpact.export import tables
from femimpact.regular_file import check_regular, open_regular
from femimpact.study.result_directory import SUMMARY, ResultsWarning, Staging, complete_move, stage, unfinished_state
from femimpact.table import Head, head_of_values, short_repr

if TYPE_CHECKING:
    import xarray

__all__ = [
    "FILES",
    "OTHER_FILES",
    "STICKING_FILE",
    "StudyResults",
    "checksum",
    "finish_results",
    "load",
    "prepare_directory",
    "read_dataset",
    "read_sticking",
    "read_summary",
    "read_table",
    "update_results",
    "write_summary",
]

FILES = {
    "summary": SUMMARY,
    "study": "study.toml",
    "modes": "modes.csv",
    "mode_shapes": "modes.nc",
    "sweep": "sweep.csv",
    "sweep_data": "sweep.nc",
    "history": "history.nc",
    "impacts": "impacts.csv",
    "impact_data": "impacts.nc",
    "snapshots": "snapshots.nc",
    "last_cycles": "last_cycles.nc",
    "modes_scene": "modes.pvd",
    "modes_script": "modes_paraview.py",
    **{f"mode_{i}_scene": f"mode_{i}.pvd" for i in range(1, 5)},
    **{f"mode_{i}_script": f"mode_{i}_paraview.py" for i in range(1, 5)},
    "deflection_scene": "deflection.pvd",
    "deflection_script": "deflection_paraview.py",
    "movie": "deflection.mp4",
    "mode_figure": "modes.png",
    "response_figure": "response.png",
    "force_figure": "contact_force.png",
    "portrait_figure": "phase_portrait.png",
    "impact_histograms": "impact_histograms.png",
    "impulse_phase": "impulse_phase.png",
}
"""Every file that a study can leave behind."""

OTHER_FILES = {
    "deflection_hdf": "deflection.vtkhdf",
    "sticking": "sticking.csv",
    "old_sticking": "riding.csv",
    "base_record": "base_record.csv",
    "contact_table": "contact.csv",
    "movie_without_encoder": "deflection.gif",
    "comparison": "comparison.csv",
    "restitution": "restitution.csv",
    "restitution_figure": "restitution.png",
    "response_of_starts": "response_of_starts.png",
    "mesh_convergence": "mesh_convergence.csv",
    "mesh_convergence_figure": "mesh_convergence.png",
    "step_convergence": "step_convergence.csv",
    "step_convergence_figure": "step_convergence.png",
    "quantities_over_mesh": "quantities_over_mesh.csv",
    "quantities_over_mesh_figure": "quantities_over_mesh.png",
    "quantities_over_step": "quantities_over_step.csv",
    "quantities_over_step_figure": "quantities_over_step.png",
    "quantities_over_modes": "quantities_over_modes.csv",
    "quantities_over_modes_figure": "quantities_over_modes.png",
    "statistics_over_mesh": "statistics_over_mesh.csv",
    "convergence_summary": "convergence_summary.csv",
}
"""What is left besides: one file of deflections where the study has `vtkhdf`, what a history leaves in which something
stuck (and its name in results of earlier versions), the record of the base, and what a table of contacts, a movie
without an encoder, the demo and a convergence study leave."""

STICKING_FILE = OTHER_FILES["sticking"]

T = TypeVar("T")

CHECKSUMS, OWN_CHECKSUM = "checksums", "checksum"
"""Keys of the summary: of every other file, and of the summary without this key (SHA-256)."""


@short_repr
@dataclass(frozen=True, eq=False)
class StudyResults:
    """Results of a study, read back from its directory.

    Parameters
    ----------
    directory : Path
    summary : mapping
        `summary.json`.
    modes, impacts, sticking : mapping of str to ndarray, or None
        Tables by column; no sticking where nothing stuck.
    sweep, history, impact_data : xarray.Dataset or None
        The last holds the impacts with the energy to each mode.
    """

    directory: Path
    summary: Mapping[str, Any]
    modes: Mapping[str, Any] | None
    impacts: Mapping[str, Any] | None
    sweep: xarray.Dataset | None
    history: xarray.Dataset | None
    impact_data: xarray.Dataset | None
    sticking: Mapping[str, Any] | None

    @property
    def _head(self) -> Head:
        tables = {name: getattr(self, name) for name in ("modes", "impacts", "sticking")}
        data = {name: getattr(self, name) for name in ("sweep", "history", "impact_data")}
        values = {name: ", ".join(table) for name, table in tables.items() if table is not None}
        values |= {name: ", ".join(map(str, found.data_vars)) for name, found in data.items() if found is not None}
        values["warnings"] = "; ".join(self.summary.get("warnings", [])) or "none"
        return head_of_values(f"StudyResults: {self.directory}", values)

    @property
    def riding(self) -> Mapping[str, Any] | None:
        """The earlier name of `sticking`."""
        return self.sticking


def read_sticking(folder: Path, summary: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Table of sticking phases, also of an earlier version; None where nothing stuck."""
    table = read_table(folder, STICKING_FILE, summary)
    return read_table(folder, OTHER_FILES["old_sticking"], summary) if table is None else table


def load(directory: str | Path) -> StudyResults:
    """Read the results that a study left in a directory.

    Parameters
    ----------
    directory : str or Path

    Returns
    -------
    StudyResults

    Raises
    ------
    InputError
        If the directory holds no results or unfinished ones, or a file is missing or cannot be read.

    Warns
    -----
    ResultsWarning
        For a file that can be read but is not the one that the study left, and for pictures, scenes and other
        files that are lost or changed. Results without checksums, of earlier versions, are read as they are.
    """
    require(isinstance(directory, (str, Path)), "directory", directory, "", "must be the path of a directory")
    folder = Path(directory)
    summary = read_summary(folder)

    def table(file: str) -> Mapping[str, Any] | None:
        return read_table(folder, file, summary)

    def dataset(name: str) -> xarray.Dataset | None:
        return read_dataset(folder, name, summary)

    results = StudyResults(
        folder,
        summary,
        modes=table(FILES["modes"]),
        impacts=table(FILES["impacts"]),
        sweep=dataset("sweep_data"),
        history=dataset("history"),
        impact_data=dataset("impact_data"),
        sticking=read_sticking(folder, summary),
    )
    read = {
        STICKING_FILE,
        OTHER_FILES["old_sticking"],
        *(FILES[name] for name in ("modes", "impacts", "sweep_data", "history", "impact_data")),
    }
    _check_others(folder, summary, read)
    return results


def _check_others(folder: Path, summary: Mapping[str, Any], read: set[str]) -> None:
    """Warn of files of the results that are lost or changed, but for those that were read."""
    others = {name: expected for name, expected in summary.get(CHECKSUMS, {}).items() if name not in read}
    lost = sorted(name for name in others if not (folder / name).is_file())
    if lost:
        shown = ", ".join(lost[:3]) + (f" and {len(lost) - 3} more" if len(lost) > 3 else "")
        text = f"{folder}: missing, though {SUMMARY} names them among the results: {shown}"
        warnings.warn(text, ResultsWarning, stacklevel=3)
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

    Raises
    ------
    InputError
        If there is none, it cannot be read, or the results are unfinished.
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
    if not isinstance(summary, dict) or not isinstance(summary.get(CHECKSUMS, {}), dict):
        raise _damaged(path, "no summary of a study")
    if CHECKSUMS in summary and summary.get(OWN_CHECKSUM) != _of_summary(summary):
        _warn_changed(path)
    return summary


def read_dataset(folder: Path, name: str, summary: Mapping[str, Any]) -> xarray.Dataset | None:
    """One of the netCDF files of `FILES`; None where the results have none.

    Raises
    ------
    InputError
        If it is missing or cannot be read.
    """
    return _read(folder, FILES[name], summary, _load_dataset)


def _load_dataset(path: Path) -> xarray.Dataset:
    import xarray

    # the library opens it by its name
    check_regular(path)
    return xarray.load_dataset(path, engine="h5netcdf")


def read_table(folder: Path, name: str, summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """One of the tables of the results; None where they have none.

    Raises
    ------
    InputError
        If it is missing or cannot be read.
    """
    return _read(folder, name, summary, tables.read_csv)


def _read(folder: Path, name: str, summary: Mapping[str, Any], reader: Callable[[Path], T]) -> T | None:
    """One file of the results, checked against the summary."""
    path, expected = folder / name, summary.get(CHECKSUMS, {}).get(name)
    if not path.exists():
        if expected is not None:
            raise InputError([Fault("file", str(path), "", f"is missing: {SUMMARY} names it among the results")])
        return None
    with _quiet_finalizers():
        try:
            changed = expected is not None and checksum(path) != expected
            found, problem = reader(path), None
        # what a damaged file makes a reader raise is without limit
        except Exception as error:
            problem = _in_words(error)
        if problem is not None:
            # what the reader had opened
            gc.collect()
    if problem is not None:
        raise _damaged(path, problem)
    if changed:
        _warn_changed(path)
    return found


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
    warnings.warn(text, ResultsWarning, stacklevel=5)


# ---- writing --------------------------------------------------------------------------------------


def checksum(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _of_summary(summary: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in summary.items() if key != OWN_CHECKSUM}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def write_summary(folder: Path, summary: Mapping[str, Any], earlier: Path | None = None) -> None:
    """Write the summary of the files in a folder, with their checksums.

    Parameters
    ----------
    folder : Path
    summary : mapping
        Checksums that it has of files elsewhere stay.
    earlier : Path, optional
        A directory whose files are kept beside those in the folder: checksums of files in neither go.
    """
    sums = dict(summary.get(CHECKSUMS, {})) if earlier is not None else {}
    sums = {name: value for name, value in sums.items() if earlier is not None and (earlier / name).exists()}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name != SUMMARY:
            sums[path.relative_to(folder).as_posix()] = checksum(path)
    whole = tables.plain({**summary, CHECKSUMS: sums})
    tables.write_json(folder / SUMMARY, {**whole, OWN_CHECKSUM: _of_summary(whole)})


def _earlier_results(target: Path) -> list[str]:
    """Names of results in a directory: all that a study can leave, with the frames of its collections."""
    names = [*FILES.values(), *OTHER_FILES.values()]
    frames = [path for name in names if name.endswith(".pvd") for path in (target / name[:-4]).glob("[0-9]*.vtu")]
    return [name for name in names if (target / name).is_file()] + [str(path.relative_to(target)) for path in frames]


@contextmanager
def prepare_directory(directory: str | Path, force: bool = False) -> Iterator[Staging]:
    """A place whose files move into the directory when all went well; see `result_directory.stage`.

    Raises
    ------
    InputError
        If the directory exists and is not empty, unless forced; then earlier results are
        replaced and other files stay.
    """
    target = Path(directory)
    for name in FILES.values():
        allowed = f"holds a folder {name}, where a file of the results goes"
        require(not (target / name).is_dir(), "output", str(target), "", allowed)
        folder = target / name.removesuffix(".pvd")
        allowed = f"holds a file {folder.name}, where a folder of the results goes"
        free = not name.endswith(".pvd") or folder.is_dir() or not folder.exists()
        require(free, "output", str(target), "", allowed)
    with stage(target, _earlier_results, force) as staging:
        yield staging


@contextmanager
def update_results(directory: str | Path, superseded: Sequence[str]) -> Iterator[Staging]:
    """A place whose files, with a new summary, move into a directory of results when all went well.

    Parameters
    ----------
    directory : str or Path
    superseded : sequence of str
        Names of files that go unless they are made anew.
    """
    with stage(
        directory, lambda target: [name for name in superseded if (target / name).is_file()], update=True
    ) as new:
        yield new


def finish_results(directory: str | Path, force: bool = False) -> tuple[str, ...]:
    """Put what an ended run finished into its directory, or finish a move that was ended.

    Parameters
    ----------
    directory : str or Path
    force : bool
        Put parts of a run in the place of earlier results that are whole.

    Returns
    -------
    tuple of str
        The parts of the run that were finished.

    Raises
    ------
    InputError
        If there is nothing to finish, a run is still at work, or whole earlier results would go.
    """
    return complete_move(directory, _earlier_results, force)
