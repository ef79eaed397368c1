"""Files that are read: regular files only, within a limit of size; and the decimal numbers that stand in their text."""

from __future__ import annotations

import errno
import os
import re
import stat
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from io import BufferedReader

DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def decimal_number(text: str) -> float | None:
    """The number that a text is, with white space around it at most; None where it is not a number."""
    return float(text) if DECIMAL.fullmatch(text.strip()) else None


KINDS = ((stat.S_ISDIR, "a directory"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISCHR, "a device"),
         (stat.S_ISBLK, "a device"), (stat.S_ISSOCK, "a socket"))  # fmt: skip


def check_regular(
    path: str | Path,
    most: int | None = None,  # bytes that the file may have
) -> None:
    """Refuse what is no regular file, before a library opens it by its name.

    Raises `OSError` if it does not exist, is a directory, a pipe, a device or a socket, or larger; `strerror` says
    which.
    """
    try:
        found = os.stat(path)
    except ValueError:
        # a null character
        raise OSError(errno.EINVAL, "no path of a file", str(path)) from None
    _check(found, path, most)


def open_regular(
    path: str | Path,
    most: int | None = None,  # bytes that the file may have
) -> BufferedReader:
    """The open file of a path, to read bytes from.

    Raises `OSError` as of `check_regular`, or if it cannot be opened.
    """
    # first by its name: to open a device can change it
    check_regular(path, most)
    with ExitStack() as stack:
        file = stack.enter_context(open(path, "rb", opener=_open_without_waiting))
        # it may be another one by now
        _check(os.fstat(file.fileno()), path, most)
        stack.pop_all()
    return file


def read_regular(
    path: str | Path,
    most: int,  # bytes that it may hold, whatever size it states
) -> bytes:
    """Bytes of a file, read in one piece.

    Raises `OSError` as of `open_regular`.
    """
    with open_regular(path, most) as file:
        content = read_now(file, most + 1)
    if len(content) > most:
        raise _too_large(path, len(content), most)
    return content


def read_now(file: BinaryIO, most: int) -> bytes:
    """The next bytes of an open file, up to a number of them, without waiting for any.

    Raises `OSError` if it would have to be waited for, as for the messages of the kernel.
    """
    # not bytes: there are none yet, and the file has not ended
    content: bytes | None = file.read(most)
    if content is None:
        raise OSError(errno.EAGAIN, "has nothing to read now, as a pipe or a device has, no regular file", file.name)
    return content


def _open_without_waiting(path: str, flags: int) -> int:
    # there is no such flag, and no such pipe, on Windows
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def kind_of(found: os.stat_result) -> str:
    """Words for what is no regular file; empty for one."""
    return next((words for is_one, words in KINDS if is_one(found.st_mode)), "")


def _check(found: os.stat_result, path: str | Path, most: int | None) -> None:
    if kind := kind_of(found):
        code = errno.EISDIR if stat.S_ISDIR(found.st_mode) else errno.EINVAL
        raise OSError(code, f"is {kind}, no regular file", str(path))
    if most is not None and found.st_size > most:
        raise _too_large(path, found.st_size, most)


def _too_large(path: str | Path, size: int, most: int) -> OSError:
    return OSError(errno.EFBIG, f"has {size:,} bytes, of which at most {most:,} are read", str(path))
