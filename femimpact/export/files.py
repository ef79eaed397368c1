"""Files written under a temporary name beside the target and then renamed, so that none is left incomplete."""

from __future__ import annotations

import errno
import io
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from femimpact.errors import require, require_path
from femimpact.regular_file import kind_of

NO_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EROFS)
"""Error numbers of a file system that cannot write through to the disk."""


def file_path(path: str | Path) -> Path:
    """The path of a file, which need not exist.

    Raises `InputError` if it is no path: neither text nor a `Path`, no name, or a null character in it.
    """
    require_path(path, "path", "a file")
    require(bool(Path(path).name), "path", str(path), "", "must be the path of a file")
    return Path(path)


def target_path(path: str | Path) -> Path:
    """The path of a file that is written, where none is or a regular one.

    Raises `InputError` as of `file_path`, or if a pipe, a device, a socket or a directory is there, or a link to an
    open file, as /dev/stdout, all of which a rename would remove.
    """
    target, kind = file_path(path), ""
    with suppress(OSError):
        kind = kind_of(os.stat(target)) or "a link to an open file" * os.readlink(target).startswith("/proc/")
    require(not kind, "path", str(path), "", f"must be a file: this is {kind}")
    return target


@contextmanager
def atomic_path(
    path: str | Path,  # in an existing directory
) -> Iterator[Path]:
    """A temporary sibling that becomes `path` when the block ends well, and vanishes when it does not.

    Yields: where to write; it has the suffix of `path`.

    Raises `OSError` with the name of `path`, never with the temporary one.
    """
    target = target_path(path)
    require(target.parent.is_dir(), "path", str(path), "", "must be in an existing directory")
    prefix = f".{target.stem}-"
    try:
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=target.suffix, dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            # mkstemp makes a private file; a result is an ordinary one
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            to_disk(temporary)
            os.replace(temporary, target)
        finally:
            with suppress(OSError):
                temporary.unlink()
    except OSError as error:
        # a failed write names no file, the others a hidden one
        hidden = error.filename is None or Path(os.fsdecode(error.filename)).name.startswith(prefix)
        if error.errno is not None and hidden:
            error.filename = str(target)
            # None would be shown as the end of an arrow
            del error.filename2
        raise


def atomic_write(path: str | Path, content: str | bytes) -> None:
    """Write text (UTF-8) or bytes to a file, which is complete or stays as it was."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def to_disk(path: Path) -> None:
    """Write a file, or the names in a directory, through to the disk, before a rename relies on it."""
    if path.is_dir() and os.name != "posix":  # no such thing outside POSIX
        return
    file = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(file)
    except OSError as error:
        if error.errno not in NO_SYNC:
            raise
    finally:
        os.close(file)


class GuardedFile(io.RawIOBase):
    """A file for the HDF5 library that keeps the first failed write to itself and raises it when left.

    A write that fails inside HDF5 (a full disk) leaves its caches in a state in which closing the file ends
    the process. Here the library gets success from every write, and the caller gets the first failure.

    Parameters
    ----------
    path : Path
        Of a file that is written anew.
    """

    def __init__(self, path: Path) -> None:
        self._file: Any = path.open("w+b", buffering=0)
        self.failure: BaseException | None = None

    def check(self) -> None:
        """Raise the first write that failed, if one did."""
        if self.failure is not None:
            raise self.failure

    def write(self, data: Any) -> int:
        """All of the data, or none and the failure kept."""
        rest = memoryview(data).cast("B")
        size = rest.nbytes
        try:
            while self.failure is None and rest.nbytes:
                rest = rest[self._file.write(rest) :]
        except BaseException as failure:
            self.failure = failure
        return size

    def readinto(self, buffer: Any) -> int:
        """Fill the buffer; what a failed write did not leave reads as zeros."""
        view = memoryview(buffer).cast("B")
        found = self._file.readinto(view) or 0
        if found < view.nbytes and self.failure is not None:
            view[found:] = bytes(view.nbytes - found)
            return view.nbytes
        return int(found)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to a place in the file."""
        return int(self._file.seek(offset, whence))

    def tell(self) -> int:
        """Place in the file."""
        return int(self._file.tell())

    def truncate(self, size: int | None = None) -> int:
        """Cut or lengthen the file; a failure is kept."""
        try:
            return int(self._file.truncate(size))
        except BaseException as failure:
            self.failure = self.failure or failure
            return size or 0

    def readable(self) -> bool:
        """True: HDF5 reads back what it wrote."""
        return True

    def writable(self) -> bool:
        """True."""
        return True

    def seekable(self) -> bool:
        """True: HDF5 writes at any place."""
        return True

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._file.close()
        super().close()

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file; a failed write is raised in place of the error that HDF5 raised for it."""
        self.close()
        if self.failure is not None and (value is None or isinstance(value, Exception)):
            raise self.failure from None
