"""Sole use of a directory of results: DIR/.running with a file in it that is locked as long as a process runs."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

from femimpact.errors import Fault, InputError, require
from femimpact.study.result_files import is_file, is_folder

__all__ = ["LOCK", "RUNNING", "Lock", "is_ours"]

RUNNING = ".running"
LOCK = "lock"

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
"""What a file system without locks answers."""


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
        """Whether a living process holds the lock."""
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


def is_ours(running: Path) -> bool:
    """Whether there is no folder of that name, or one that a run made: the content of another must not be removed."""
    if not is_folder(running):
        return not os.path.lexists(running)
    return is_file(running / LOCK) or not os.listdir(running)
