"""The directory of results: its lock, the files of a run that is not done, and the move of finished ones.

A run writes into DIR/.running/files, on the file system of DIR, and holds a lock that ends with its process.
What it finished is moved by a journal: from the moment the journal stands, the move can be finished by
anyone; the old summary goes first and the new one comes last, so that a summary always belongs to its files.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femimpact.errors import Fault, InputError, require
from femimpact.export.files import atomic_write

__all__ = ["SUMMARY", "ResultsWarning", "Staging", "complete_move", "stage", "unfinished_state"]

SUMMARY = "summary.json"
RUNNING = ".running"
FILES = "files"
JOURNAL = "journal.json"
FINISHED = "finished.json"
LOCK = "lock"

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
"""What a file system without locks answers."""


class ResultsWarning(UserWarning):
    """Something about results on disk that does not stop the work."""


@dataclass(frozen=True, eq=False)
class Staging:
    """The place of a run that is not done.

    Parameters
    ----------
    target : Path
        As the user named it.
    folder : Path
        Where the files go until the run is done.
    """

    target: Path
    folder: Path

    @property
    def finished(self) -> tuple[str, ...]:
        """Parts of the run whose files are complete."""
        return _finished(self.folder.parent)

    def finish_part(self, part: str) -> None:
        """Note that all files of a part are on disk: they are kept, whatever happens to the rest."""
        state = {"parts": [*self.finished, part], "files": _files_in(self.folder)}
        atomic_write(self.folder.parent / FINISHED, json.dumps(state))


@contextmanager
def stage(
    directory: str | Path, superseded: Callable[[Path], Sequence[str]], force: bool = False, update: bool = False
) -> Iterator[Staging]:
    """A place whose files move into the directory when the block ends well.

    When it does not, parts that were finished stay in DIR/.running, and a note of the error says so;
    without any, nothing stays.

    Parameters
    ----------
    directory : str or Path
    superseded : callable
        Given the directory, names of earlier files that must not stand beside the new ones.
    force : bool
        Take a directory that is not empty; files that are not superseded stay.
    update : bool
        The same, for files that are added to results that exist.

    Raises
    ------
    InputError
        If the directory cannot be taken, or another run writes into it.
    """
    target = Path(directory)
    _check_target(target, force or update)
    made = _missing(target)
    lock: _Lock | None = None
    try:
        with _named(target, "output"):
            lock = _Lock(target)
        with _named(target, None):
            _clear_leftovers(target, lock.running)
        _check_target(target, force or update)
        staging = Staging(target, lock.running / FILES)
        with _named(target, "output"):
            staging.folder.mkdir()
        with _noted(staging):
            with _named(target, None):
                yield staging
            with _named(target, None):
                _write_journal(staging, superseded(target))
        with _named(target, None):
            _move_noted(target, lock.running)
    finally:
        if lock is not None:
            lock.release()
        for folder in made:
            # only what is empty goes
            with suppress(OSError):
                folder.rmdir()


def complete_move(
    directory: str | Path, superseded: Callable[[Path], Sequence[str]], force: bool = False
) -> tuple[str, ...]:
    """Put the finished parts of a run that was ended into its directory, or finish a move that was ended.

    Parameters
    ----------
    directory : str or Path
    superseded : callable
        As of `stage`.
    force : bool
        Put parts of a run in the place of earlier results that are whole.

    Returns
    -------
    tuple of str
        The parts.

    Raises
    ------
    InputError
        If there is nothing to finish, a run is still at work, or whole earlier results would go.
    """
    target = Path(directory)
    running = target / RUNNING
    require(unfinished_state(target) is not None, "directory", str(target), "", "holds no unfinished results")
    parts = _finished(running)
    usable = bool(parts) or (running / JOURNAL).exists() or _Lock.is_held(running)
    require(
        usable, "directory", str(target), "", "holds a run that ended before its first part was finished: run it again"
    )
    lock = _Lock(target)
    try:
        with _named(target, None):
            if not (running / JOURNAL).exists():
                allowed = f"holds whole earlier results, which {_listed(parts)} of a later run would replace: --force"
                require(force or not (target / SUMMARY).exists(), "directory", str(target), "", allowed)
                _drop_unfinished(running)
                _write_journal(Staging(target, running / FILES), superseded(target))
            _move_noted(target, running)
    finally:
        lock.release()
    return parts


def unfinished_state(target: Path) -> str | None:
    """What a directory holds of a run that is not done, in words with what to do; None where there is nothing."""
    running = target / RUNNING
    if not running.is_dir():
        return None
    if _Lock.is_held(running):
        return "a run is writing into it"
    if (running / JOURNAL).exists():
        return f"its results are moved in part: 'femimpact finish {target}' finishes the move"
    parts = _finished(running)
    if parts:
        return (
            f"it holds a run that ended after {_listed(parts)}: 'femimpact finish {target}' keeps that, or run it again"
        )
    if not (running / FILES).exists():
        return None
    return "it holds a run that ended before its first part was finished: run it again"


# ---- before the work ------------------------------------------------------------------------------


def _check_target(target: Path, occupied: bool) -> None:
    """Refuse what cannot be the directory of a run."""
    require(not target.exists() or target.is_dir(), "output", str(target), "", "must be a directory: this is a file")
    if not target.is_dir():
        return
    with _named(target, "output"):
        held = any(item.name != RUNNING for item in target.iterdir())
    if not held or occupied:
        return
    if (target / RUNNING / JOURNAL).exists() and not _Lock.is_held(target / RUNNING):
        raise InputError([Fault("output", str(target), "", f"{unfinished_state(target)}, --force runs again")])
    raise InputError([Fault("output", str(target), "", "exists already: choose another directory with -o, or --force")])


def _missing(target: Path) -> list[Path]:
    """The directory and those above it that do not exist, the innermost first."""
    return [folder for folder in (target, *target.parents) if not folder.exists()]


def _clear_leftovers(target: Path, running: Path) -> None:
    """Finish an interrupted move, or remove what a killed run left, and say so."""
    if (running / JOURNAL).exists():
        _move(target, running)
        text = f"{target}: the results of an earlier run were moved in part; that move is now finished"
        warnings.warn(text, ResultsWarning, stacklevel=4)
    elif (running / FILES).exists():
        parts = _finished(running)
        held = f", with {_listed(parts)}" if parts else ""
        text = f"{target}: removed what a run that did not end well had left there{held}"
        warnings.warn(text, ResultsWarning, stacklevel=4)
    for item in running.iterdir():
        if item.name != LOCK:
            _remove(item)


class _Lock:
    """Sole use of a directory for as long as this process runs: DIR/.running with a locked file in it."""

    def __init__(self, target: Path) -> None:
        self.running = target / RUNNING
        refused = InputError([Fault("output", str(target), "", "another run is writing into it")])
        while True:
            _check_ours(target, self.running)
            # through a symbolic link whose end is missing, too
            Path(os.path.realpath(self.running)).mkdir(parents=True, exist_ok=True)
            try:
                self.file = os.open(self.running / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
            except FileNotFoundError:
                continue  # the run before removed the folder just now
            try:
                _lock_file(self.file)
                same = os.path.samestat(os.fstat(self.file), os.stat(self.running / LOCK))
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
        """Whether a living process holds the lock."""
        try:
            file = os.open(running / LOCK, os.O_RDWR)
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
        """Let others in; the folder goes unless it holds finished parts or a journal."""
        kept = _finished(self.running) or (self.running / JOURNAL).exists()
        if not kept:
            with suppress(OSError):
                for item in self.running.iterdir():
                    if item.name != LOCK:
                        _remove(item)
                (self.running / LOCK).unlink()
                self.running.rmdir()
        os.close(self.file)


def _lock_file(file: int) -> None:
    """Lock an open file without waiting.

    Raises
    ------
    BlockingIOError
        If another process holds it.
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


def _check_ours(target: Path, running: Path) -> None:
    """Refuse a folder of that name that no run made: its content would be removed."""
    ours = not running.exists() or (running.is_dir() and ((running / LOCK).exists() or not any(running.iterdir())))
    require(ours, "output", str(target), "", f"holds a {RUNNING} that no run made: remove it, or choose another")


# ---- after the work -------------------------------------------------------------------------------


def _write_journal(staging: Staging, superseded: Sequence[str]) -> None:
    """From here on the move can be finished by anyone."""
    files = _files_in(staging.folder)
    # a collection after the frames that it names
    files.sort(key=lambda name: (name == SUMMARY, name.endswith(".pvd"), name))
    new = set(files)
    steps = {"move": files, "remove": sorted(name for name in superseded if name not in new and name != SUMMARY)}
    for name in files:
        place = staging.target / name
        allowed = f"holds a folder {name}, where a file of the results goes"
        require(not place.is_dir(), "output", str(staging.target), "", allowed)
        folder = place.parent
        allowed = f"holds a file {folder.name}, where a folder of the results goes"
        require(folder.is_dir() or not folder.exists(), "output", str(staging.target), "", allowed)
    atomic_write(staging.folder.parent / JOURNAL, json.dumps(steps))


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
        if (running / JOURNAL).exists():
            error.add_note(f"the move into {target} is unfinished: 'femimpact finish {target}' finishes it")
        raise


def _move(target: Path, running: Path) -> None:
    """What the journal says, from wherever it was interrupted."""
    files, journal = running / FILES, _read(running / JOURNAL, {})
    moves, removals = journal["move"], journal["remove"]
    last = files / SUMMARY
    if SUMMARY not in moves or last.exists():
        (target / SUMMARY).unlink(missing_ok=True)
    for name in moves:
        if name != SUMMARY and (files / name).exists():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(files / name, target / name)
    for name in removals:
        (target / name).unlink(missing_ok=True)
    for folder in sorted({(target / name).parent for name in removals} - {target}):
        with suppress(OSError):
            folder.rmdir()
    if last.exists():
        os.replace(last, target / SUMMARY)
    (running / FINISHED).unlink(missing_ok=True)
    shutil.rmtree(files, ignore_errors=True)
    (running / JOURNAL).unlink()


@contextmanager
def _noted(staging: Staging) -> Iterator[None]:
    """Add to an error what is kept of the run that it ends."""
    try:
        yield
    except BaseException as error:
        target, parts = staging.target, staging.finished
        if parts and (target / SUMMARY).exists():
            error.add_note(
                f"the earlier results stay; finished parts ({_listed(parts)}) are kept beside them: "
                f"'femimpact finish {target} --force' puts them in their place"
            )
        elif parts:
            error.add_note(
                f"finished parts ({_listed(parts)}) are kept: 'femimpact finish {target}' makes them results"
            )
        elif isinstance(error, KeyboardInterrupt):
            error.add_note("nothing was written")
        raise


@contextmanager
def _named(target: Path, key: str | None) -> Iterator[None]:
    """Errors of the file system name the user's path, not the one in the folder of the run.

    With a key they are input errors: the directory cannot be written at all.
    """
    hidden, files = str(target / RUNNING), str(target / RUNNING / FILES)
    try:
        yield
    except OSError as error:
        if key is not None:
            text = f"cannot be written: {error.strerror or error}"
            raise InputError([Fault(key, str(target), "", text)]) from None
        name = "" if error.filename is None else os.fsdecode(error.filename)
        for folder in (files, hidden):
            if name == folder or name.startswith(folder + os.sep):
                error.filename, error.filename2 = str(target) + name[len(folder) :], None
                break
        raise


def _finished(running: Path) -> tuple[str, ...]:
    return tuple(_read(running / FINISHED, {"parts": []})["parts"])


def _files_in(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def _drop_unfinished(running: Path) -> None:
    """Remove files of a part that was not finished."""
    kept = set(_read(running / FINISHED, {"files": []})["files"])
    for name in _files_in(running / FILES):
        if name not in kept:
            (running / FILES / name).unlink()


def _read(path: Path, absent: Any) -> Any:
    """Content of a file of ours, which is whole where it exists."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return absent


def _listed(parts: Sequence[str]) -> str:
    return ", ".join(parts)


def _remove(item: Path) -> None:
    if item.is_dir() and not item.is_symlink():
        shutil.rmtree(item, ignore_errors=True)
    else:
        with suppress(OSError):
            item.unlink()
