"""The directory of results: names of its files, its lock, and the folder beside it in which a run writes them."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from femimpact.errors import Fault, InputError, require
from femimpact.files import to_disk

SUMMARY = "summary.json"

PART, OLD = ".part", ".old"
"""Behind the name of a directory: the folder that a run fills, and the earlier results while that takes their place."""

LOCK = ".lock"
"""The locked file in a folder that a process writes into; what a killed one left holds it, too."""


@dataclass(frozen=True)
class ResultFile:
    """A file that a command may leave in a directory of results."""

    name: str
    purpose: str  # shown in the list of files of a report
    writer: str  # the commands, or the parts of `run`, that write it, and under which condition


CONVERGENCE: Mapping[str, str] = {
    **{f"quantities_over_{axis}": f"Relative errors over the {axis}" for axis in ("mesh", "step", "modes")},
    "statistics_over_mesh": "Means of runs with contacts over the mesh",
    "runs_over_step": "Errors of runs in steps",
}
"""Tables of a convergence study, each with a figure of the same name."""

FIGURES: Mapping[str, str] = {
    "response": "Response over frequency",
    "response_columns": "Phase, impacts and forces over frequency",
    "curves_of_starts": "Response curves of both starts",
    "restitution": "Scan of the restitution",
    "branches": "Largest displacement of the periodic orbits",
    "drive": "The drive",
    "history": "Channels over time",
    "phase_portrait": "Phase portrait",
    "spectrum": "Spectrum of a channel, or of the drive",
    "impact_histograms": "How hard the impacts are",
    "impulse_phase": "When the impacts are",
    "contact_force": "Contact force",
    "energy": "Energy",
    "modes": "Mode shapes of the structure alone",
    "study_best": "The best case: its measure over the axes that are chosen",
    **CONVERGENCE,
    **{f"statistics_over_{axis}": f"Means of runs with contacts over the {axis}" for axis in ("step", "modes")},
}
"""Titles of figures of results, by the stem of their file, which a number may follow; those of measures have others."""

_ROWS: Mapping[str, tuple[str, ...]] = {
    "summary": (SUMMARY, "the numbers of this page, machine-readable", "run, converge, orbits"),
    "study": ("study.toml", "the study that was run, from which it can be run again", "run, converge, orbits, study"),
    "modes": ("modes.csv", "frequencies, damping and effective masses of the modes", "modes"),
    "mode_shapes": ("modes.nc", "mode shapes with labels (netCDF, xarray)", "modes"),
    "sweep": ("sweep.csv", "response curves, a row for each frequency", "sweep"),
    "sweep_data": ("sweep.nc", "response curves with labels (netCDF, xarray)", "sweep"),
    "history": ("history.nc", "every channel over time, and the last cycles finely (netCDF, xarray)", "history"),
    "impacts": ("impacts.csv", "every impact, a row each", "history"),
    "impact_data": ("impacts.nc", "impacts with the energy to each mode (netCDF, xarray)", "history"),
    "modes_scene": ("paraview/modes.pvd", "mode shapes for ParaView", "modes"),
    **{
        f"mode_{i}_scene": (f"paraview/mode_{i}.pvd", f"mode {i} over its period, for ParaView", "modes --animate")
        for i in range(1, 5)
    },
    "deflection_scene": ("paraview/deflection.pvd", "the moving beam for ParaView, also at every impact", "history"),
    "scene_script": ("paraview/open_in_paraview.py", "opens a file beside it in ParaView", "modes, history"),
    "movie": ("movie.mp4", "the moving beam in slow motion", "pictures"),
    "deflection_hdf": (
        "paraview/deflection.vtkhdf",
        "the moving beam for ParaView in one file",
        "history with output.vtkhdf",
    ),
    "sticking": ("sticking.csv", "times in which a ball and its wall moved together", "history in which a ball sticks"),
    "base_record": ("base_record.csv", "the record that moved the base", "run with a record of the base"),
    "movie_without_encoder": ("movie.gif", "the moving beam in slow motion", "pictures, no encoder"),
    "comparison": ("comparison.csv", "the paper beside ours", "demo"),
    "restitution": ("restitution.csv", "scan of the restitution", "demo"),
    "curves_of_starts": (
        "curves_of_starts.csv",
        "peaks with balls or absorbers over the frequency: median, smallest and largest of the starts in each frame",
        "demo, sweep with starts",
    ),
    **{key: (f"{key}.csv", words, "converge") for key, words in CONVERGENCE.items()},
    "convergence_summary": ("convergence_summary.csv", "orders and recommended numbers", "converge"),
    "parameter_study": ("study.nc", "every measure over the axes of the study, with labels (netCDF, xarray)", "study"),
    "parameter_table": ("study.csv", "every measure and its statistics, a row for each case", "study"),
    "best_study": ("best.toml", "the study with the values of the best case, to be run", "study"),
    "branches": ("branches.nc", "branches of periodic orbits with labels (netCDF, xarray)", "orbits"),
    "branch_table": ("branches.csv", "every orbit of the branches, a row each", "orbits"),
    "bifurcations": ("bifurcations.csv", "every bifurcation of the branches, a row each", "orbits"),
    "report": ("report.html", "this page", "run, converge, study, orbits, report"),
    "sheet": ("sheet.html", "the report on one sheet of paper", "report --short"),
}

FILES = {key: ResultFile(*row) for key, row in _ROWS.items()}
"""Every file of results but figures, by the key under which the package asks for it."""

NAMES = {file.name: file for file in FILES.values()}

STUDY_BLOCKS, STUDY_MANIFEST = "blocks", "study.json"
"""The folder in which a parameter study keeps its finished blocks, from which it goes on, and its file on the study."""

BEST_FIGURE = "figures/study_best.png"

STUDY_FIGURE = re.compile(r"figures/study_[\w-]+\.png")
"""Names of the figures of a parameter study, one for each measure."""

FIGURE = re.compile(rf"figures/({'|'.join(FIGURES)})(_[0-9]+)?\.png")

FRAME = re.compile(r"paraview/\w+/[0-9]{4,}\.vtu")

REPORT = FILES["report"].name
"""Name of the report, which is made from the other files and can be made again at any time."""


def new_file(folder: Path, name: str) -> Path:
    """Path of a file of `FILES` by its key, or of another by its name, in a folder whose own folders are made."""
    path = folder / (FILES[name].name if name in FILES else name)
    path.parent.mkdir(exist_ok=True)
    return path


def result_files(folder: Path) -> list[str]:
    """Names of the results in a folder, with those in its folders, the summary last."""
    names = sorted(name for name in _all_files(folder) if _is_result(name))
    return [*(name for name in names if name != SUMMARY), *(name for name in names if name == SUMMARY)]


def purpose_of(name: str) -> str:
    """What a file of results is for, in words."""
    if name in NAMES:
        return NAMES[name].purpose
    figure = FIGURE.fullmatch(name)
    return FIGURES[figure[1]] if figure else "A measure over the axes of the study"


def _all_files(folder: Path) -> Iterator[str]:
    return (path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir())


def _is_result(name: str) -> bool:
    return name in NAMES or any(pattern.fullmatch(name) for pattern in (FIGURE, STUDY_FIGURE, FRAME))


NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
"""Errors of a file system without locks."""


class Lock:
    """Sole use of a folder for as long as this process runs: a locked file in it."""

    def __init__(
        self,
        folder: Path,  # made where it is not there
        directory: Path | None = None,  # that is named where another process has it; the folder by default
    ) -> None:
        self.path = folder / LOCK
        # what a run that was killed left, which says that the folder is a run's
        self.left = self.path.exists()
        while True:
            folder.mkdir(parents=True, exist_ok=True)
            try:
                self.file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            except FileNotFoundError:
                continue  # the run before put the folder in its place just now
            try:
                _lock_file(self.file)
                if os.path.samestat(os.fstat(self.file), os.stat(self.path)):
                    return
            except BlockingIOError:
                os.close(self.file)
                fault = Fault("output", str(directory or folder), "", "another run is writing into it")
                raise InputError([fault]) from None
            except FileNotFoundError:
                pass  # it was removed between opening and locking
            os.close(self.file)

    @staticmethod
    def is_held(folder: Path) -> bool:
        """True while a living process holds the lock of a folder."""
        try:
            file = os.open(folder / LOCK, os.O_RDWR)
        except OSError:
            return False
        try:
            _lock_file(file)
        except OSError as error:
            return isinstance(error, BlockingIOError)
        finally:
            os.close(file)
        return False

    def close(self) -> None:
        """Let others in; the file stays."""
        os.close(self.file)

    def release(self) -> None:
        """Let others in; the file goes where it was not there before."""
        if not self.left:
            with suppress(OSError):
                self.path.unlink()
        self.close()

    def __enter__(self) -> Lock:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()


def _lock_file(file: int) -> None:
    """Lock an open file without waiting.

    Raises `BlockingIOError` if another process holds it.
    """
    try:
        import fcntl
    except ImportError:  # no such locks outside POSIX: two runs at once are not found there
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise


class ResultFileWarning(UserWarning):
    """Something about results on disk that does not stop the work."""


@contextmanager
def new_results(
    directory: str | Path,
    force: bool = False,  # take the place of earlier results
) -> Iterator[Path]:
    """The folder DIR.part, which takes the place of a directory DIR when the block ends well.

    When it does not, the parts that its summary names stay in DIR.part, and a note of the error says so; without any,
    nothing stays.

    Raises `InputError` if the directory cannot be taken, holds what are no results, or another run writes into it.
    """
    named, target = Path(directory), Path(os.path.realpath(directory))
    part = beside(target, PART)
    with _in_words_of(named, target):
        with _as_input(named):
            _finish_move(named, target)
            _check_target(named, target, force)
            made = next((folder for folder in reversed(part.parents) if not folder.exists()), None)
            lock = Lock(part, named)
        try:
            _clear(named, part)
            yield part
            _put_in_place(target)
        except BaseException as error:
            _note(error, named, part)
            raise
        finally:
            if not (part / SUMMARY).exists():
                shutil.rmtree(part, ignore_errors=True)
            if made is not None:
                _remove_empty(made)
            # a part that stays keeps the file, which says that a run made it
            lock.close()


@contextmanager
def added_results(directory: str | Path) -> Iterator[Path]:
    """A directory of results, to which files are added one by one while no other process writes into it.

    Raises `InputError` if there is no such directory, or another process writes into it.
    """
    named, target = Path(directory), Path(os.path.realpath(directory))
    with _as_input(named):
        _finish_move(named, target)
        require(target.is_dir(), "directory", str(named), "", "must be a directory of results")
        lock = Lock(target, named)
    try:
        yield named
    finally:
        lock.release()


def beside(directory: Path, suffix: str) -> Path:
    """The folder DIR.part or DIR.old of a directory."""
    target = Path(os.path.realpath(directory))
    return target.with_name(target.name + suffix)


def unfinished_state(directory: Path) -> str | None:
    """State of an unfinished run in a directory, in words with what to do; None where there is none."""
    part, old = beside(directory, PART), beside(directory, OLD)
    if Lock.is_held(part):
        return "a run is writing into it"
    if _in_replacement(Path(os.path.realpath(directory))):
        moves = "the next run, figures, movie or report moves them"
        return f"its results are in {part}, the earlier ones in {old}: {moves}"
    if (part / SUMMARY).exists() and (part / LOCK).exists():
        return f"what a run that was ended has finished is in {part}: {_left(part)}"
    ended = "a run was ended before its first part was finished: run it again"
    return ended if (part / LOCK).exists() else None


def _left(part: Path) -> str:
    """What an ended run left undone, in words."""
    left = list[str]()
    with suppress(OSError, ValueError, AttributeError, TypeError):
        left = list(map(str, json.loads((part / SUMMARY).read_text(encoding="utf-8")).get("unfinished", [])))
    return f"all but {' and '.join(left or ['pictures', 'report'])}"


# ---- before the work ------------------------------------------------------------------------------


def _check_target(named: Path, target: Path, force: bool) -> None:
    """Refuse what cannot be the directory of a run, or holds something where it must not."""
    require(not target.exists() or target.is_dir(), "output", str(named), "", "must be a directory: this is a file")
    is_here = target in (Path.cwd(), *Path.cwd().parents)
    require(not is_here, "output", str(named), "", "is the working directory, or one above it: name one in it with -o")
    require(not os.path.ismount(target), "output", str(named), "", "is a mount point: name a directory in it with -o")
    for suffix, words in ((PART, "a run fills"), (OLD, "earlier results are moved to")):
        folder = beside(target, suffix)
        free = not folder.exists() or (folder / LOCK).exists() or (folder.is_dir() and not any(folder.iterdir()))
        allowed = f"{folder.name} beside it, which {words}, was made by no run: move it, or choose another with -o"
        require(free, "output", str(named), "", allowed)
    held = [name for name in _all_files(target) if name != LOCK] if target.is_dir() else []
    allowed = "exists already: choose another directory with -o, or --force"
    require(force or not held, "output", str(named), "", allowed)
    other = next((name for name in held if not _is_result(name)), None)
    allowed = f"holds {other}, which is no result of a run: move it, or choose another directory with -o"
    require(other is None, "output", str(named), "", allowed)


def _clear(named: Path, part: Path) -> None:
    """Remove what an ended run left in the folder of a new one, and say so."""
    if any(path.name != LOCK for path in part.iterdir()):
        words = f", which held {_left(part)}" if (part / SUMMARY).exists() else ""
        text = f"{named}: removed what a run that did not end well had left in {part.name}{words}"
        warnings.warn(text, ResultFileWarning, stacklevel=4)
    _empty(part)


def _empty(folder: Path) -> None:
    """Remove all but the file of the lock, which says that a run made the folder."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name != LOCK:
            path.unlink()


# ---- after the work -------------------------------------------------------------------------------


def _in_replacement(target: Path) -> bool:
    """True where a run was ended between its two renames."""
    return not target.exists() and all((beside(target, suffix) / LOCK).exists() for suffix in (PART, OLD))


def _put_in_place(target: Path) -> None:
    """Rename the folder of a run that is done to its directory; earlier results go."""
    part, old = beside(target, PART), beside(target, OLD)
    for folder in {part, *(path.parent for path in part.rglob("*"))}:
        to_disk(folder)
    if target.is_dir() and any(target.iterdir()):
        # while another process adds to them they stay; the file says of what is left of them that a run moved it
        with Lock(target):
            os.rename(target, old)
    elif target.is_dir():
        target.rmdir()
    _finish(target)


def _finish(target: Path) -> None:
    """The second rename, and what it leaves to remove."""
    os.rename(beside(target, PART), target)
    to_disk(target.parent)
    if beside(target, OLD).is_dir():
        _remove(beside(target, OLD))
    (target / LOCK).unlink(missing_ok=True)


def _remove(old: Path) -> None:
    """Remove earlier results, the file that says so last."""
    _empty(old)
    shutil.rmtree(old)


def _finish_move(named: Path, target: Path) -> None:
    """Finish a replacement that was ended, and say so."""
    old = beside(target, OLD)
    if Lock.is_held(beside(target, PART)):
        return
    if _in_replacement(target):
        _finish(target)
    elif target.is_dir() and (old / LOCK).exists():
        _remove(old)
    else:
        return
    text = f"{named}: the results of an earlier run were not yet in place; they are now"
    warnings.warn(text, ResultFileWarning, stacklevel=4)


def _remove_empty(folder: Path) -> None:
    """Remove a folder that was made for a run, with those in it, where they hold nothing."""
    for path, _, _ in os.walk(folder, topdown=False):
        with suppress(OSError):
            os.rmdir(path)


# ---- errors ---------------------------------------------------------------------------------------


def _note(error: BaseException, named: Path, part: Path) -> None:
    """Add to an error what is kept of the run that it ends."""
    if _in_replacement(part.with_name(part.name.removesuffix(PART))):
        error.add_note(f"{unfinished_state(named)}")
    elif (part / SUMMARY).exists():
        error.add_note(f"what was finished is kept in {part}: {_left(part)}; rename it to keep it from the next run")
    elif isinstance(error, KeyboardInterrupt):
        error.add_note("nothing was written")


@contextmanager
def _as_input(named: Path) -> Iterator[None]:
    """An error of the file system becomes an input error: the directory cannot be written at all."""
    try:
        yield
    except OSError as error:
        text = f"cannot be written: {error.strerror or error}"
        raise InputError([Fault("output", str(named), "", text)]) from None


@contextmanager
def _in_words_of(named: Path, target: Path) -> Iterator[None]:
    """Errors of the file system name the user's path."""
    try:
        yield
    except OSError as error:
        name = "" if error.filename is None else os.fsdecode(error.filename)
        for folder in (beside(target, PART), target):
            if Path(name).is_relative_to(folder):
                error.filename = str(named / Path(name).relative_to(folder))
                # None would be shown as the end of an arrow
                del error.filename2
                break
        raise
