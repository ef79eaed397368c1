"""Files that are read: regular files only, within a limit of size; and the decimal numbers that stand in their text."""

from __future__ import annotations

import errno
import os
import re
import stat
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from io import BufferedReader

DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def decimal_number(text: str) -> float | None:
    """The number that a text is, with white space around it at most; None where it is not a number."""
    return float(text) if DECIMAL.fullmatch(text.strip()) else None


KINDS = ((stat.S_ISDIR, "a directory"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISCHR, "a device"),
         (stat.S_ISBLK, "a device"), (stat.S_ISSOCK, "a socket"))  # fmt: skip


def open_regular(
    path: str | Path,
    most: int | None = None,  # bytes that the file may have
) -> BufferedReader:
    """The open file of a path, to read bytes from.

    Raises `OSError`, before it is opened, if it does not exist, is a directory, a pipe, a device or a socket, or is
    larger; `strerror` says which.
    """
    try:
        status = os.stat(path)
    except ValueError:
        # a null character
        raise OSError(errno.EINVAL, "no path of a file", str(path)) from None
    if kind := kind_of(status):
        code = errno.EISDIR if stat.S_ISDIR(status.st_mode) else errno.EINVAL
        raise OSError(code, f"is {kind}, no regular file", str(path))
    if most is not None and status.st_size > most:
        words = f"has {status.st_size:,} bytes, of which at most {most:,} are read"
        raise OSError(errno.EFBIG, words, str(path))
    return open(path, "rb")


def read_regular(path: str | Path, most: int) -> bytes:
    """Bytes of a file; raises `OSError` as `open_regular`."""
    with open_regular(path, most) as file:
        return file.read()


def kind_of(status: os.stat_result) -> str:
    """Words for what is no regular file; empty for one."""
    return next((words for is_one, words in KINDS if is_one(status.st_mode)), "")
