"""Compiled code on disk: which sources it is made of, where it may lie, and whether a file of it is whole.

A file of compiled code is a pickle with machine code in it: who can write it can run anything as the user who
reads it. So it lies only in a directory that belongs to the user and that nobody else can write to, and it is
read only if its checksum fits.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from femimpact.regular_file import open_regular

__all__ = ["CodeFiles", "candidates", "is_private", "open_code_files", "sources_of", "stamp_of"]

LOG = logging.getLogger("femimpact")
PACKAGE = Path(__file__).parents[2]
MARK = b"femimpact compiled code 1\n"
DIGEST = hashlib.sha256().digest_size

IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n#]*)|import[ \t]+([^\n#]*))", re.MULTILINE
)


def _imported(text: str) -> set[str]:
    """Dotted names that a source imports; a name out of a module counts as the module's and as one of its own."""
    found = set()
    for module, names, modules in IMPORT.findall(text):
        plain = [name.split()[0] for name in (names or modules).strip("()").split(",") if name.split()]
        found |= {f"{module}.{name}" for name in plain} if module else set(plain)
    return found


def _file_of(name: str, package: Path) -> Path | None:
    """Source of a module of the package, or of the module that the name is taken from."""
    first, *path = name.split(".")
    if first != package.name:
        return None
    for parts in (path, path[:-1]):
        here = package.joinpath(*parts)
        for file in (here.with_suffix(".py"), here / "__init__.py"):
            if parts and file.is_file():
                return file
    return package / "__init__.py"


def sources_of(package: Path) -> tuple[Path, ...]:
    """Every source that a kernel is made of: all integrators, and what they import, and so on, wherever it lies.

    A function or a constant of another module that a kernel reads is inlined into it or frozen in it.

    Parameters
    ----------
    package : Path
        Directory of the package.
    """
    waiting = sorted((package / "integrators").rglob("*.py"))
    found: set[Path] = set()
    while waiting:
        source = waiting.pop()
        if source not in found:
            found.add(source)
            names = _imported(source.read_text(encoding="utf-8"))
            waiting += [file for name in names if (file := _file_of(name, package)) is not None]
    return tuple(sorted(found))


def stamp_of(package: Path, *more: str) -> bytes:
    """Digest of the contents of every source that a kernel is made of, and of more words.

    Contents, not times, which may be equal in a package that was unpacked, and new in one that was copied.
    """
    digest = hashlib.sha256("\n".join(more).encode())
    for source in sources_of(package):
        content = source.read_bytes()
        digest.update(f"{source.relative_to(package).as_posix()} {len(content)}\n".encode() + content)
    return digest.digest()


def _home() -> Path | None:
    """The user's directory for what can be made again; None without a home."""
    for value in (os.environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~/.cache")):
        # without a home, ~ stays what it is: a directory of that name would be made where the user happens to be
        if os.path.isabs(value):
            return Path(value) / "femimpact"
    return None


def candidates(package: Path) -> tuple[Path, ...]:
    """Directories that may hold compiled code: beside the sources, else the user's own.

    NUMBA_CACHE_DIR, where it is set, is the only one.
    """
    asked = os.environ.get("NUMBA_CACHE_DIR", "")
    # packages of other environments share the user's directory
    own = hashlib.sha256(os.fsencode(package.resolve())).hexdigest()[:16]
    if asked:
        return (Path(asked).absolute() / f"femimpact-{own}",)
    inside = package / "integrators" / "compiled" / "__pycache__" / "compiled"
    home = _home()
    return (inside,) if home is None else (inside, home / f"compiled-{own}")


def is_private(directory: Path) -> bool:
    """Whether it is a directory, no link to one, that belongs to the user and that nobody else can write to."""
    try:
        status = os.lstat(directory)
    except OSError:
        return False
    if not stat.S_ISDIR(status.st_mode):
        return False
    user = getattr(os, "geteuid", None)  # none on Windows, where a user's directories are the user's
    return user is None or (status.st_uid == user() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


def _made(directory: Path) -> bool:
    """Whether the directory has been made just now, for the user alone."""
    try:
        directory.parent.mkdir(parents=True, exist_ok=True)
        directory.mkdir(mode=0o700)
    except OSError:
        return False
    return True


def _discard(path: Path) -> None:
    """Remove a damaged file, or what lies in its place; where that fails, it stays and is no use."""
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


@dataclass(frozen=True)
class CodeFiles:
    """Directories to read compiled code from, and to write it to.

    Parameters
    ----------
    directories : tuple of Path
        Each the user's own; read in this order, written to the first that takes it.
    stamp : bytes
        Of the sources: a file with another one is out of date.
    """

    directories: tuple[Path, ...]
    stamp: bytes

    def read(self, name: str) -> bytes | None:
        """What was written under a name; None if nothing was, or it is out of date or damaged."""
        for directory in self.directories:
            path = directory / name
            try:
                with open_regular(path) as file:
                    content = file.read()
            except FileNotFoundError:
                continue
            except OSError as error:
                LOG.warning("femimpact's compiled code cannot be read and is made again: %s", error)
                _discard(path)
                continue
            start = len(MARK) + len(self.stamp)
            whole = content.startswith(MARK) and len(content) > start + DIGEST
            if whole and content[len(MARK) : start] != self.stamp:
                continue
            payload = content[start + DIGEST :]
            if whole and hashlib.sha256(payload).digest() == content[start : start + DIGEST]:
                return payload
            LOG.warning("femimpact's compiled code is damaged and is made again: %s", path)
            _discard(path)
        return None

    def write(self, name: str, payload: bytes) -> None:
        """Write code under a name, whole or not at all; where nothing can be written, it stays in memory."""
        content = MARK + self.stamp + hashlib.sha256(payload).digest() + payload
        for directory in self.directories:
            if is_private(directory) and _written(directory / name, content):
                return
        if self.directories:
            _say_once(f"femimpact's compiled code cannot be written to {self.directories[0]}: it is kept in memory")


def _written(path: Path, content: bytes) -> bool:
    """Whether the file has been written; it shows up under its name when it is whole."""
    try:
        handle, temporary = tempfile.mkstemp(prefix=f"{path.name}.", dir=path.parent)
    except OSError:
        return False
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except OSError:
        with suppress(OSError):
            os.unlink(temporary)
        return False
    return True


@cache
def _say_once(words: str) -> None:
    LOG.warning("%s", words)


def open_code_files(package: Path, places: Iterable[Path], *more: str) -> CodeFiles | None:
    """The files of a package's compiled code; one line of the log says where they are if not in the first place.

    Parameters
    ----------
    package : Path
        Directory of the package.
    places : iterable of Path
        As `candidates` gives them: the first is where compiled code lies as a rule.
    more : str
        What else makes compiled code out of date: versions of the compiler.

    Returns
    -------
    CodeFiles or None
        None if code is kept in memory only.
    """
    try:
        stamp = stamp_of(package, *more)
    except OSError:
        _say_once("femimpact's sources cannot be read: its compiled code is kept in memory, by every process anew")
        return None
    found: list[Path] = []
    for rank, place in enumerate(places):
        made = _made(place)
        if not is_private(place):
            continue
        if made and rank:
            _say_once(f"femimpact's compiled code is kept in {place}")
        found.append(place)
        if os.access(place, os.W_OK | os.X_OK):
            break
    if not found:
        _say_once("no private directory for femimpact's compiled code: it is kept in memory, by every process anew")
        return None
    return CodeFiles(tuple(found), stamp)
