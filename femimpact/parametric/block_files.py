"""Finished blocks of a study on disk: each a file that is there whole or not at all, named by its key.

DIR/blocks holds `study.json`, what the study is, with a hash of the rest, and one file for each finished block: a line
with the hash of the rest, then arrays as numpy writes them. A damaged file is named, and counts as one that is not
there: its block is run again. What a file may hold is checked in `read_back`.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.errors import Fault, InputError, InputWarning, require
from femimpact.export.files import atomic_write, to_disk
from femimpact.parametric.evaluation import BlockValues
from femimpact.parametric.identity import first_difference
from femimpact.parametric.read_back import DamagedFileError, block_content, block_of, manifest_content, manifest_of
from femimpact.regular_file import read_regular
from femimpact.study.result_directory import FILES, REPORT, STUDY_BLOCKS, earlier_files

BLOCKS = STUDY_BLOCKS
MANIFEST = "study.json"
OWN = frozenset({FILES["study"].name, FILES["parameter_study"].name, FILES["parameter_table"].name, REPORT})
"""What a parameter study writes anew beside its blocks."""

NAME = re.compile(r"([0-9a-f]{16})-([0-9a-f]{16})\.block")
UNFINISHED = re.compile(r"\.(study|[0-9a-f]{16}-[0-9a-f]{16})-\w{8}\.(json|block)")
UNFINISHED_RESULT = re.compile(r"\.(study(_[\w-]+)?|report)-\w{8}\.(nc|csv|toml|png|html)")
MOST_BYTES = 2_000_000_000


class BlockFolder:
    """The finished blocks of one study in a directory.

    A directory with a block of this study is this study's, whatever its `study.json` says by now: it is written anew
    where it is not what it should be, as where an earlier version has written it without a checksum.

    Parameters
    ----------
    directory : Path
        Of results; locked by the caller.
    plain : mapping
        The study in plain data, with `table`, what a partial result is labelled by.
    key : str
        Of the study and the code.
    say : callable, optional
        Told of each damaged file in a line.

    Raises
    ------
    InputError
        If the directory holds another study, a damaged one of which no block is this study's, or something that is
        not a study.
    """

    def __init__(
        self, directory: Path, plain: Mapping[str, Any], key: str, say: Callable[[str], None] | None = None
    ) -> None:
        self.folder, self.key, self.table = directory / BLOCKS, key, plain["table"]
        self.say = say or (lambda line: None)
        content = manifest_content({"key": key, **plain})
        now = json.loads(content)
        earlier = self._earlier(directory, now["study"])
        self.folder.mkdir(parents=True, exist_ok=True)
        if earlier != now:
            atomic_write(self.folder / MANIFEST, content)

    def _earlier(self, directory: Path, study: Any) -> dict[str, Any] | None:
        """What the directory holds, refused where it is not this study."""
        keys = {matched[1] for matched in map(NAME.fullmatch, _names(self.folder)) if matched}
        is_own = self.key[:16] in keys
        try:
            earlier = _manifest(directory)
        except DamagedFileError as error:
            if keys and not is_own:
                raise _damaged(directory, error) from None
            self.say(f"{BLOCKS}/{MANIFEST} is damaged ({error}): it is written again")
            return None
        if earlier is None:
            other = next((name for name in earlier_files(directory) if name not in OWN), None)
            allowed = f"holds results of another kind ({other}): choose another directory"
            require(other is None, "directory", str(directory), "", allowed)
            return None
        difference = "" if is_own else first_difference(earlier["study"], study)
        allowed = f"holds another study: {difference}; choose another directory"
        require(not difference, "directory", str(directory), "", allowed)
        return earlier

    def path(self, cases: np.ndarray[Any, np.dtype[np.int64]]) -> Path:
        """The file of a block by its cases."""
        return self.folder / _name(self.key, cases)

    def finished(self, cases: np.ndarray[Any, np.dtype[np.int64]]) -> BlockValues | None:
        """A block of these cases that is on disk whole; None where there is none."""
        path = self.path(cases)
        try:
            return _read(path, self.key, self.table)
        except FileNotFoundError:
            return None
        except DamagedFileError as error:
            self.say(f"{BLOCKS}/{path.name} is damaged ({error}): its cases are run again")
            return None

    def write(self, block: BlockValues) -> None:
        """Put a block on disk: written whole, synced, then named."""
        atomic_write(self.path(block.cases), block_content(block, self.key))
        to_disk(self.folder)

    def remove_unfinished(self) -> None:
        """Remove the temporary files of a process that was ended while it wrote."""
        for folder, pattern in ((self.folder, UNFINISHED), (self.folder.parent, UNFINISHED_RESULT)):
            for name in os.listdir(folder):
                if pattern.fullmatch(name):
                    (folder / name).unlink(missing_ok=True)


def read_manifest(directory: Path) -> dict[str, Any] | None:
    """What the study in a directory is; None where there is none.

    Raises `InputError` if the file is damaged.
    """
    try:
        return _manifest(directory)
    except DamagedFileError as error:
        raise _damaged(directory, error) from None


def _damaged(directory: Path, error: DamagedFileError) -> InputError:
    advice = f"run the same study again to write it anew, remove {BLOCKS}, or choose another directory"
    allowed = f"holds a {BLOCKS}/{MANIFEST} that is damaged ({error}): {advice}"
    return InputError([Fault("directory", str(directory), "", allowed)])


def _manifest(directory: Path) -> dict[str, Any] | None:
    path = directory / BLOCKS / MANIFEST
    try:
        return manifest_of(read_regular(path, MOST_BYTES))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError([Fault("directory", str(path), "", f"must be readable: {error.strerror}")]) from None


def _names(folder: Path) -> list[str]:
    """What is in the folder of blocks, where there is one."""
    try:
        return sorted(os.listdir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise InputError([Fault("directory", str(folder), "", f"must be readable: {error.strerror}")]) from None


def blocks_of(directory: Path, key: str, table: Mapping[str, Any]) -> Iterator[BlockValues]:
    """All blocks of a study that are on disk whole; a warning names each that is damaged.

    Raises `InputError` if the folder cannot be listed.
    """
    folder = directory / BLOCKS
    for name in _names(folder):
        matched = NAME.fullmatch(name)
        if not matched or matched[1] != key[:16]:
            continue
        try:
            yield _read(folder / name, key, table)
        except FileNotFoundError:
            continue
        except DamagedFileError as error:
            text = f"{folder / name} is damaged ({error}): its cases count as not finished"
            warnings.warn(text, InputWarning, stacklevel=3)


def _name(key: str, cases: np.ndarray[Any, np.dtype[np.int64]]) -> str:
    block = hashlib.sha256(np.ascontiguousarray(cases, dtype="<i8").tobytes()).hexdigest()
    return f"{key[:16]}-{block[:16]}.block"


def _read(path: Path, key: str, table: Mapping[str, Any]) -> BlockValues:
    """A block of a study, by its key."""
    try:
        content = read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DamagedFileError(f"it cannot be read: {error.strerror}") from None
    found = block_of(content, key, table)
    if path.name != _name(key, found.cases):
        raise DamagedFileError("it holds other cases than its name says")
    return found
