"""The directory of results: names of its files, its lock, and the move of the files of a finished run."""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from femimpact.errors import Fault, InputError, require
from femimpact.files import to_disk

SUMMARY = "summary.json"


@dataclass(frozen=True)
class ResultFile:
    """A file that a command may leave in a directory of results."""

    name: str
    purpose: str  # shown in the list of files of a report
    writer: str  # the commands, or the parts of `run`, that write it, and under which condition
    # {"result", "scene", "movie", "input"}: a scene has a folder of frames; of two movies only the newer stays; an
    # input may be the user's, and stays unless another run brings one
    group: str = "result"


_ROWS: Mapping[str, tuple[str, ...]] = {
    "summary": (SUMMARY, "the numbers of this page, machine-readable", "run"),
    "study": ("study.toml", "the study that was run, from which it can be run again", "run, study", "input"),
    "modes": ("modes.csv", "frequencies, damping and effective masses of the modes", "modes"),
    "mode_shapes": ("modes.nc", "mode shapes with labels (netCDF, xarray)", "modes"),
    "sweep": ("sweep.csv", "response curves, a row for each frequency", "sweep"),
    "sweep_data": ("sweep.nc", "response curves with labels (netCDF, xarray)", "sweep"),
    "history": ("history.nc", "every channel over time (netCDF, xarray)", "history"),
    "impacts": ("impacts.csv", "every impact, a row each", "history"),
    "impact_data": ("impacts.nc", "impacts with the energy to each mode (netCDF, xarray)", "history"),
    "snapshots": ("snapshots.nc", "whole deflections, from which player and movie are drawn", "history"),
    "last_cycles": ("last_cycles.nc", "channels of the last cycles at every step", "pictures"),
    "modes_scene": ("modes.pvd", "mode shapes for ParaView", "modes", "scene"),
    "modes_script": ("modes_paraview.py", "opens modes.pvd in ParaView", "modes"),
    **{
        f"mode_{i}_{key}": (name.format(i), f"mode {i} over its period, for ParaView", "modes", *group)
        for i in range(1, 5)
        for key, name, *group in (("scene", "mode_{}.pvd", "scene"), ("script", "mode_{}_paraview.py"))
    },
    "deflection_scene": ("deflection.pvd", "the moving beam for ParaView, also at every impact", "history", "scene"),
    "deflection_script": ("deflection_paraview.py", "opens deflection.pvd in ParaView", "history"),
    "movie": ("deflection.mp4", "the moving beam in slow motion", "pictures", "movie"),
    "mode_figure": ("modes.png", "mode shapes", "pictures"),
    "response_figure": ("response.png", "response curves", "pictures"),
    "response_columns_figure": ("response_columns.png", "phase, impacts and forces over frequency", "pictures"),
    "drive_figure": ("drive.png", "what drives the history", "pictures"),
    "history_figure": ("history.png", "channels over time", "pictures"),
    "energy_figure": ("energy.png", "energies over time", "pictures"),
    **{
        f"spectrum_figure{end}": (f"spectrum{end}.png", "spectrum of a channel, or of the drive", "pictures")
        for end in ("", "_2", "_3", "_4")
    },
    "force_figure": ("contact_force.png", "contact force over the last cycles", "pictures"),
    "portrait_figure": ("phase_portrait.png", "phase portraits", "pictures"),
    "impact_histograms": ("impact_histograms.png", "how often which impact speed and impulse came", "pictures"),
    "impulse_phase": ("impulse_phase.png", "impulse over the phase of the base", "pictures"),
    "deflection_hdf": ("deflection.vtkhdf", "the moving beam for ParaView in one file", "history with output.vtkhdf"),
    "sticking": ("sticking.csv", "times in which a ball and its wall moved together", "history in which a ball sticks"),
    "old_sticking": ("riding.csv", "times in which a ball and its wall moved together", "earlier versions"),
    "base_record": ("base_record.csv", "the record that moved the base", "run with a record of the base", "input"),
    "movie_without_encoder": ("deflection.gif", "the moving beam in slow motion", "pictures, no encoder", "movie"),
    "comparison": ("comparison.csv", "the paper beside ours", "demo"),
    "restitution": ("restitution.csv", "scan of the restitution", "demo"),
    "restitution_figure": ("restitution.png", "scan of the restitution", "demo"),
    "response_of_starts": ("response_of_starts.png", "response curves of both starts", "demo"),
    "curves_of_starts": (
        "curves_of_starts.csv",
        "peaks with balls or absorbers over the frequency: median, smallest and largest of the starts in each frame",
        "demo, sweep with starts",
    ),
    **{
        f"{name}{key}": (f"{name}.{suffix}", about.format(words, name), "converge")
        for name, words in (
            *((f"quantities_over_{axis}", f"values and errors over the {axis}") for axis in ("mesh", "step", "modes")),
            ("statistics_over_mesh", "means of runs with contacts over the mesh"),
            ("runs_over_step", "errors of runs in steps"),
        )
        for key, suffix, about in (("", "csv", "{}"), ("_figure", "png", "the same as a figure: {1}.csv"))
    },
    "convergence_summary": ("convergence_summary.csv", "orders and recommended numbers", "converge"),
    "parameter_study": ("study.nc", "every measure over the axes of the study, with labels (netCDF, xarray)", "study"),
    "parameter_table": ("study.csv", "every measure and its statistics, a row for each case", "study"),
    "best_study": ("best.toml", "the study with the values of the best case, to be run", "study", "input"),
    "branches": ("branches.nc", "branches of periodic orbits with labels (netCDF, xarray)", "orbits"),
    "branch_table": ("branches.csv", "every orbit of the branches, a row each", "orbits"),
    "bifurcations": ("bifurcations.csv", "every bifurcation of the branches, a row each", "orbits"),
    "branch_figure": ("branches.png", "branches of periodic orbits", "orbits"),
    "convergence_notes": ("convergence.json", "what was studied, with versions and notes", "converge"),
    "report": ("report.html", "this page", "run, converge, study, orbits, report"),
}

FILES = {key: ResultFile(*row) for key, row in _ROWS.items()}
"""Every file of results, by the key under which the package asks for it."""

NAMES = sorted((file.name for file in FILES.values()), key=lambda name: (name == SUMMARY, name))
"""Names in the order in which files are moved: the summary is the last."""

FRAME = re.compile(r"[0-9]{4,}\.vtu")

STUDY_BLOCKS, STUDY_MANIFEST = "blocks", "study.json"
"""The folder in which a parameter study keeps its finished blocks, from which it goes on, and its file on the study."""

BEST_FIGURE = "study_best.png"

STUDY_FIGURE = re.compile(r"study_[\w-]+\.png")
"""Names of the figures of a parameter study, one for each measure."""

REPORT = FILES["report"].name
"""Name of the report, which is made from the other files and can be made again at any time."""


def result_files(folder: Path) -> list[str]:
    """Names of the results that stand in a folder as regular files: frames, then what names them, the summary last."""
    return _standing(folder, stat.S_ISREG)


def earlier_files(folder: Path, new: Iterable[str] = ()) -> list[str]:
    """Names of the results in a folder that new ones supersede, the summary first; links of such a name, too."""
    found = _standing(folder, lambda mode: stat.S_ISREG(mode) or stat.S_ISLNK(mode))
    kept = () if FILES["study"].name in new else _in_group("input")
    return [name for name in reversed(found) if name not in kept]


def replaced_by(added: Iterable[str]) -> frozenset[str]:
    """Names of results that must be gone before some are added to them: the summary, and the other of two movies."""
    names, movies = frozenset(added), frozenset(_in_group("movie"))
    return names & {SUMMARY} | (movies - names if names & movies else frozenset())


def _in_group(group: str) -> list[str]:
    """Names of the files of a group, in the order of `NAMES`."""
    members = {file.name for file in FILES.values() if file.group == group}
    return [name for name in NAMES if name in members]


def _scenes() -> list[str]:
    """Folders of frames, each beside the collection that names them."""
    return [name.removesuffix(".pvd") for name in _in_group("scene")]


def is_file(path: Path) -> bool:
    """True for a regular file, not for a link to one."""
    return stat.S_ISREG(_mode(path))


def is_folder(path: Path) -> bool:
    """True for a folder, not for a link to one."""
    return stat.S_ISDIR(_mode(path))


def _standing(folder: Path, kind: Callable[[int], bool]) -> list[str]:
    frames = [
        f"{scene}/{name}"
        for scene in _scenes()
        if is_folder(folder / scene)
        for name in sorted(os.listdir(folder / scene))
        if FRAME.fullmatch(name)
    ]
    return [name for name in (*frames, *NAMES) if kind(_mode(folder / name))]


def _mode(path: Path) -> int:
    """Kind and permissions at a path, without following a link; 0 where nothing is there."""
    try:
        return path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return 0


RUNNING = ".running"
LOCK = "lock"

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
"""Errors of a file system without locks."""


class Lock:
    """Sole use of a directory for as long as this process runs: DIR/.running with a locked file in it."""

    def __init__(self, target: Path) -> None:
        self.running = target / RUNNING
        refused = InputError([Fault("output", str(target), "", "another run is writing into it")])
        allowed = f"holds a {RUNNING} that no run made: remove it, or choose another"
        while True:
            require(is_ours(self.running), "output", str(target), "", allowed)
            # through a symbolic link to the directory whose end is missing, too
            Path(os.path.realpath(target), RUNNING).mkdir(parents=True, exist_ok=True)
            try:
                self.file = _open_lock(self.running, os.O_CREAT)
            except FileNotFoundError:
                continue  # the run before removed the folder just now
            try:
                _lock_file(self.file)
                same = os.path.samestat(os.fstat(self.file), os.lstat(self.running / LOCK))
            except BlockingIOError:
                os.close(self.file)
                raise refused from None
            except FileNotFoundError:
                same = False
            except BaseException:
                os.close(self.file)
                raise
            if same:
                return
            os.close(self.file)  # it was removed between opening and locking

    @staticmethod
    def is_held(running: Path) -> bool:
        """True while a living process holds the lock."""
        try:
            file = _open_lock(running)
        except OSError:
            return False
        try:
            _lock_file(file)
        except BlockingIOError:
            return True
        except OSError:
            return False
        finally:
            os.close(file)
        return False

    def release(self) -> None:
        """Let others in; the folder goes where it holds nothing else."""
        with suppress(OSError):
            if os.listdir(self.running) == [LOCK]:
                (self.running / LOCK).unlink()
                self.running.rmdir()
        os.close(self.file)


def _open_lock(running: Path, create: int = 0) -> int:
    """Open the file of the lock, which is a file itself and no link."""
    return os.open(running / LOCK, os.O_RDWR | create | getattr(os, "O_NOFOLLOW", 0), 0o666)


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


def is_ours(running: Path) -> bool:
    """True for a folder that a run made or none at all: the content of another must not be removed."""
    if not is_folder(running):
        return not os.path.lexists(running)
    return is_file(running / LOCK) or not os.listdir(running)


NEW_FILES = "files"
FINISHED = "finished"
REPLACING = "replacing"
MOVING = "moving"

PART = re.compile(r"[1-9][0-9]* [a-z ]+")
"""Name of the folder in which the files of a part came."""


class ResultsWarning(UserWarning):
    """Something about results on disk that does not stop the work."""


class _Left(Enum):
    """States of an unfinished run, in words with what to do."""

    MOVE = "its results are moved in part: 'femimpact finish {target}' finishes the move, --force runs again"
    PARTS = "it holds a run that ended after {parts}: 'femimpact finish {target}' keeps that, or run it again"
    BEGUN = "it holds a run that ended before its first part was finished: run it again"
    STRANGE = "its {running} is damaged or of another version, and cannot be finished: run it again with --force"


@dataclass(frozen=True, eq=False)
class Staging:
    """The place of a run that is not done."""

    target: Path  # as the user named it
    folder: Path  # where the files of a part go until it is finished

    @property
    def finished(self) -> Path:
        """Where the files of finished parts are."""
        return self.folder.parent / FINISHED

    def finish_part(self, part: str) -> None:
        """Note that all files of a part are on disk: they are kept, whatever happens to the rest."""
        _sync(self.folder)
        os.rename(self.folder, self.finished / f"{len(_parts(self.finished)) + 1} {part}")
        _gather(self.finished)
        self.folder.mkdir()


@contextmanager
def prepare_directory(
    directory: str | Path,
    force: bool = False,  # take a directory that is not empty: earlier results are replaced, other files stay
) -> Iterator[Staging]:
    """A place whose files become the results in a directory when the block ends well.

    When it does not, parts that were finished stay in DIR/.running, and a note of the error says so;
    without any, nothing stays.

    Raises `InputError` if the directory cannot be taken, or another run writes into it.
    """
    target = Path(directory)
    with _named(target, "output"):
        _check_places(target, (*NAMES, *(f"{scene}/0000.vtu" for scene in _scenes())))
    reported = _holds_parts(target)
    with _taken(target, force) as running:
        with _named(target, None):
            _clear_leftovers(target, running, os.listdir(running))
        # a move that was finished just now has filled it
        _check_target(target, force, reported)
        staging = Staging(target, running / NEW_FILES)
        with _named(target, "output"):
            staging.folder.mkdir()
            staging.finished.mkdir()
        with _noted(target), _named(target, None):
            yield staging
            if result_files(staging.folder):
                staging.finish_part("pictures")
            _commit(target, running)
        with _named(target, None):
            _move_noted(target, running)


@contextmanager
def update_results(directory: str | Path) -> Iterator[Staging]:
    """A place whose files, with a new summary, are added to results in a directory when the block ends well.

    Finished parts of a run that was ended stay.

    Raises `InputError` if the directory cannot be taken, or a run writes into it.
    """
    target = Path(directory)
    with _taken(target, True) as running:
        with _named(target, None):
            _clear_leftovers(target, running, {NEW_FILES, REPLACING, MOVING}.intersection(os.listdir(running)))
        staging = Staging(target, running / NEW_FILES)
        with _named(target, "output"):
            staging.folder.mkdir()
        with _noted(target), _named(target, None):
            yield staging
            _check_places(target, result_files(staging.folder))
            _sync(staging.folder)
            os.rename(staging.folder, running / MOVING)
        with _named(target, None):
            _move_noted(target, running)


def finish_results(
    directory: str | Path,
    force: bool = False,  # put parts of a run in the place of earlier results
) -> tuple[str, ...]:
    """Put what an ended run finished into its directory, or finish a move that was ended.

    Returns: the parts of the run that were finished.

    Raises `InputError` if there is nothing to finish, a run is still at work, or earlier results would go.
    """
    target = Path(directory)
    running, state = target / RUNNING, unfinished_state(target)
    require(state is not None, "directory", str(target), "", "holds no unfinished results")
    usable = _left(running) in (_Left.MOVE, _Left.PARTS) or Lock.is_held(running)
    require(usable, "directory", str(target), "", str(state))
    with _taken(target, True), _named(target, None):
        left, parts = _left(running), _part_names(running)
        require(left is not None, "directory", str(target), "", "holds no unfinished results")
        if left is _Left.PARTS:
            allowed = f"holds earlier results, which {', '.join(parts)} of a later run would replace: --force"
            earlier = [name for name in earlier_files(target) if name != REPORT]
            require(force or not earlier, "directory", str(target), "", allowed)
            _gather(running / FINISHED)
            _commit(target, running)
        _move_noted(target, running)
    return parts


def unfinished_state(target: Path) -> str | None:
    """State of an unfinished run in a directory, in words with what to do; None where there is none."""
    running = target / RUNNING
    if Lock.is_held(running):
        return "a run is writing into it"
    left = _left(running)
    return None if left is None else _in_words(left, target)


def _in_words(left: _Left, target: Path) -> str:
    return left.value.format(target=target, running=RUNNING, parts=", ".join(_part_names(target / RUNNING)))


def _left(running: Path) -> _Left | None:
    """State of an unfinished run, by the names of its folders; None where nothing is left."""
    try:
        if not is_folder(running) or not is_ours(running):
            return None
        replacing = running / REPLACING
        # without a file it would remove earlier results and put nothing in their place
        if is_folder(running / MOVING) or (is_folder(replacing) and result_files(replacing)):
            return _Left.MOVE
        if _parts(running / FINISHED):
            return _Left.PARTS
        names = set(os.listdir(running)) - {LOCK}
    except OSError:
        return _Left.STRANGE
    if not names:
        return None
    return _Left.BEGUN if names <= {NEW_FILES, FINISHED} else _Left.STRANGE


def _parts(finished: Path) -> list[str]:
    """Folders in which finished parts came, the first part first."""
    if not is_folder(finished):
        return []
    found = [name for name in os.listdir(finished) if PART.fullmatch(name) and is_folder(finished / name)]
    return sorted(found, key=lambda name: int(name.split(" ", 1)[0]))


def _part_names(running: Path) -> tuple[str, ...]:
    """Names of the finished parts, wherever on their way they are."""
    found = [name for folder in (MOVING, REPLACING, FINISHED) for name in _parts(running / folder)]
    return tuple(name.split(" ", 1)[1] for name in found)


# ---- before the work ------------------------------------------------------------------------------


@contextmanager
def _taken(target: Path, occupied: bool) -> Iterator[Path]:
    """The folder of a run in a directory that no other process writes into; what of the two stays empty goes."""
    _check_target(target, occupied, _holds_parts(target))
    made = [folder for folder in (target, *target.parents) if not folder.exists()]
    try:
        with _named(target, "output"):
            lock = Lock(target)
        try:
            yield lock.running
        finally:
            try:
                _drop_unfinished(lock.running)
            finally:
                lock.release()
    finally:
        for folder in made:
            # only what is empty goes
            with suppress(OSError):
                folder.rmdir()


def _check_target(target: Path, occupied: bool, reported: bool) -> None:
    """Refuse what cannot be the directory of a run, or holds something where it must not.

    Where it holds, or held, parts of an ended run, a report is `reported`: one of these, which may be there.
    """
    with _named(target, "output"):
        allowed = "must be a directory: this is a file"
        require(not target.exists() or target.is_dir(), "output", str(target), "", allowed)
        if occupied or not target.is_dir():
            return
        held = any(item.name != RUNNING and not (reported and item.name == REPORT) for item in target.iterdir())
    left = _left(target / RUNNING)
    if left is _Left.STRANGE or (held and left is _Left.MOVE):
        state = "another run is writing into it" if Lock.is_held(target / RUNNING) else _in_words(left, target)
        raise InputError([Fault("output", str(target), "", state)])
    require(not held, "output", str(target), "", "exists already: choose another directory with -o, or --force")


def _holds_parts(target: Path) -> bool:
    """True where a directory holds parts of an ended run; a report beside them was made from these."""
    return _left(target / RUNNING) is _Left.PARTS


def finished_parts(target: Path) -> Path | None:
    """The folder with the files of an ended run's finished parts; None where there is none."""
    return target / RUNNING / FINISHED if _holds_parts(target) else None


def _check_places(target: Path, names: Iterable[str]) -> None:
    """Refuse a directory in which something stands where files of results go, or a link where their folder goes."""
    for name in names:
        place = target / name
        allowed = f"holds a folder {name}, where a file of the results goes"
        require(not is_folder(place), "output", str(target), "", allowed)
        folder = place.parent
        kind = "link" if folder.is_symlink() else "file"
        allowed = f"holds a {kind} {folder.name}, where a folder of the results goes"
        free = folder == target or is_folder(folder) or not os.path.lexists(folder)
        require(free, "output", str(target), "", allowed)


def _clear_leftovers(target: Path, running: Path, names: Iterable[str]) -> None:
    """Finish an interrupted move, or remove what a killed run left under some names, and say so."""
    left, parts, names = _left(running), _part_names(running), [name for name in names if name != LOCK]
    if left is _Left.MOVE:
        _move(target, running)
        text = f"{target}: the results of an earlier run were moved in part; that move is now finished"
        warnings.warn(text, ResultsWarning, stacklevel=4)
    elif names:
        held = f", with {', '.join(parts)}" if parts and FINISHED in names else ""
        text = f"{target}: removed what a run that did not end well had left there{held}"
        warnings.warn(text, ResultsWarning, stacklevel=4)
    for name in names:
        _remove(running / name)


# ---- after the work -------------------------------------------------------------------------------


def _gather(finished: Path) -> None:
    """Put the files of finished parts together, from wherever that was interrupted."""
    for part in _parts(finished):
        names = result_files(finished / part)
        _check_places(finished, names)
        _merge(finished / part, finished, names)


def _commit(target: Path, running: Path) -> None:
    """From here on the finished parts are the results of the directory, and anyone can finish the move."""
    _check_places(target, result_files(running / FINISHED))
    _remove(running / NEW_FILES)
    os.rename(running / FINISHED, running / REPLACING)
    to_disk(running)


def _move_noted(target: Path, running: Path) -> None:
    """The move; an interrupt waits for its end, and an error says how it can be finished."""
    try:
        try:
            _move(target, running)
        except KeyboardInterrupt as interrupt:
            _move(target, running)
            interrupt.add_note(f"the results in {target} are complete")
            raise
    except BaseException as error:
        if _left(running) is _Left.MOVE:
            error.add_note(f"the move into {target} is unfinished: 'femimpact finish {target}' finishes it")
        raise


def _move(target: Path, running: Path) -> None:
    """Put files that are done into the directory, from wherever that was interrupted."""
    replacing, moving = running / REPLACING, running / MOVING
    in_move = is_folder(moving)
    names = result_files(moving if in_move else replacing)
    _check_places(target, names)
    if not in_move and is_folder(replacing):
        _unlink_results(target, (name for name in earlier_files(target, names) if name == SUMMARY or name not in names))
        os.rename(replacing, moving)
    _unlink_results(target, replaced_by(names).intersection(earlier_files(target)))
    _merge(moving, target, names)
    if is_folder(moving):
        shutil.rmtree(moving)


def _merge(source: Path, target: Path, names: Sequence[str]) -> None:
    """Move files from one folder to another, in the order of their names there."""
    for name in names:
        (target / name).parent.mkdir(exist_ok=True)
        os.replace(source / name, target / name)
    for folder in {target, *((target / name).parent for name in names)}:
        to_disk(folder)


def _unlink_results(target: Path, names: Iterable[str]) -> None:
    """Remove earlier results, and their folders when they are empty."""
    for name in names:
        (target / name).unlink()
        if name not in NAMES:
            with suppress(OSError):
                (target / name).parent.rmdir()


def _sync(folder: Path) -> None:
    """Have the results in a folder on disk, before a rename says that they are."""
    names = result_files(folder)
    for place in (*(folder / name for name in names), *{folder, *((folder / name).parent for name in names)}):
        to_disk(place)


def _drop_unfinished(running: Path) -> None:
    """Remove files of a part that was not finished, and what is empty of finished ones."""
    _remove(running / NEW_FILES)
    if not _parts(running / FINISHED):
        _remove(running / FINISHED)


def _remove(item: Path) -> None:
    if is_folder(item):
        shutil.rmtree(item, ignore_errors=True)
    else:
        with suppress(OSError):
            item.unlink()


# ---- errors ---------------------------------------------------------------------------------------


@contextmanager
def _noted(target: Path) -> Iterator[None]:
    """Add to an error what is kept of the run that it ends."""
    try:
        yield
    except BaseException as error:
        left, parts = _left(target / RUNNING), ", ".join(_part_names(target / RUNNING))
        if left is _Left.MOVE:
            error.add_note(_in_words(left, target))
        elif left is _Left.PARTS and earlier_files(target):
            error.add_note(
                f"the earlier results stay; finished parts ({parts}) are kept beside them: "
                f"'femimpact finish {target} --force' puts them in their place"
            )
        elif left is _Left.PARTS:
            error.add_note(f"finished parts ({parts}) are kept: 'femimpact finish {target}' makes them results")
        elif isinstance(error, KeyboardInterrupt):
            error.add_note("nothing was written")
        raise


@contextmanager
def _named(target: Path, key: str | None) -> Iterator[None]:
    """Errors of the file system name the user's path, not the one in the folder of the run.

    With a key they are input errors: the directory cannot be written at all.
    """
    try:
        yield
    except OSError as error:
        if key is not None:
            text = f"cannot be written: {error.strerror or error}"
            raise InputError([Fault(key, str(target), "", text)]) from None
        name = "" if error.filename is None else os.fsdecode(error.filename)
        hidden = str(target / RUNNING)
        if name == hidden or name.startswith(hidden + os.sep):
            # without the folder that holds it for the time being
            _, *rest = Path(name).relative_to(hidden).parts or ("",)
            error.filename = str(Path(target, *rest))
            # None would be shown as the end of an arrow
            del error.filename2
        raise
