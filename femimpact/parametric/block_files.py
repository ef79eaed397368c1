"""Finished blocks of a study on disk: each a file that is there whole or not at all, named by its key.

DIR/blocks holds `study.json`, what the study is, and one file for each finished block: a line with the hash of the
rest, then arrays as numpy writes them. A damaged file is one that is not there.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import re
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.errors import Fault, InputError, require
from femimpact.export.files import atomic_write, to_disk
from femimpact.parametric.evaluation import BlockValues
from femimpact.parametric.identity import first_difference
from femimpact.regular_file import read_regular
from femimpact.study.result_directory import FILES, OTHER_FILES, REPORT, STUDY_BLOCKS, earlier_files

BLOCKS = STUDY_BLOCKS
MANIFEST = "study.json"
OWN = frozenset({FILES["study"], OTHER_FILES["parameter_study"], OTHER_FILES["parameter_table"], REPORT})
"""What a parameter study writes anew beside its blocks."""

NAME = re.compile(r"([0-9a-f]{16})-([0-9a-f]{16})\.block")
UNFINISHED = re.compile(r"\.(study|[0-9a-f]{16}-[0-9a-f]{16})-\w{8}\.(json|block)")
UNFINISHED_RESULT = re.compile(r"\.(study(_[\w-]+)?|report)-\w{8}\.(nc|csv|toml|png|html)")
MOST_BYTES = 2_000_000_000


class BlockFolder:
    """The finished blocks of one study in a directory.

    Parameters
    ----------
    directory : Path
        Of results; locked by the caller.
    plain : mapping
        The study in plain data, with `table`, what a partial result is labelled by.
    key : str
        Of the study and the code.

    Raises
    ------
    InputError
        If the directory holds another study, or something that is not a study.
    """

    def __init__(self, directory: Path, plain: Mapping[str, Any], key: str) -> None:
        self.folder, self.key = directory / BLOCKS, key
        manifest = self.folder / MANIFEST
        earlier = read_manifest(directory)
        if earlier is not None:
            difference = first_difference(earlier.get("study"), json.loads(json.dumps(plain["study"])))
            allowed = f"holds another study: {difference}; choose another directory"
            if difference:
                raise InputError([Fault("directory", str(directory), "", allowed)])
        else:
            other = next((name for name in earlier_files(directory) if name not in OWN), None)
            allowed = f"holds results of another kind ({other}): choose another directory"
            require(other is None, "directory", str(directory), "", allowed)
        self.folder.mkdir(parents=True, exist_ok=True)
        if earlier is None or earlier.get("key") != key:
            atomic_write(manifest, json.dumps({"key": key, **plain}))

    def path(self, cases: np.ndarray[Any, np.dtype[np.int64]]) -> Path:
        """The file of a block by its cases."""
        block = hashlib.sha256(np.ascontiguousarray(cases, dtype="<i8").tobytes()).hexdigest()
        return self.folder / f"{self.key[:16]}-{block[:16]}.block"

    def finished(self, cases: np.ndarray[Any, np.dtype[np.int64]], shape: tuple[int, int]) -> BlockValues | None:
        """A block of these cases and shape (starts, measures) that is on disk whole; None where there is none."""
        found = _read(self.path(cases), self.key)
        if found is None or found.values.shape != (cases.size, *shape) or not np.array_equal(found.cases, cases):
            return None
        return found

    def write(self, block: BlockValues) -> None:
        """Put a block on disk: written whole, synced, then named."""
        payload = io.BytesIO()
        of_words = {name: list(rows) for name, rows in block.words.items()}
        words = {"key": self.key, "failures": list(block.failures), "words": of_words}
        text = np.frombuffer(json.dumps(words).encode(), dtype=np.uint8)
        np.savez(payload, cases=block.cases, values=block.values, periodic=block.periodic, words=text)
        content = payload.getvalue()
        atomic_write(self.path(block.cases), hashlib.sha256(content).hexdigest().encode() + b"\n" + content)
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
    path = directory / BLOCKS / MANIFEST
    try:
        found = json.loads(read_regular(path, MOST_BYTES))
        if isinstance(found, dict) and isinstance(found.get("key"), str) and "study" in found and "table" in found:
            return found
    except FileNotFoundError:
        return None
    except (ValueError, RecursionError):
        pass
    except OSError as error:
        if error.errno != errno.ENOTDIR:
            raise InputError([Fault("directory", str(path), "", f"must be readable: {error.strerror}")]) from None
    allowed = f"holds a {BLOCKS}/{MANIFEST} that is damaged: remove {BLOCKS}, or choose another directory"
    raise InputError([Fault("directory", str(directory), "", allowed)])


def blocks_of(directory: Path, key: str) -> Iterator[BlockValues]:
    """All blocks of a study that are on disk whole.

    Raises `InputError` if the folder cannot be listed.
    """
    folder = directory / BLOCKS
    try:
        names = sorted(os.listdir(folder))
    except OSError as error:
        raise InputError([Fault("directory", str(folder), "", f"must be readable: {error.strerror}")]) from None
    for name in names:
        matched = NAME.fullmatch(name)
        if matched and matched[1] == key[:16]:
            found = _read(folder / name, key)
            if found is not None:
                yield found


def _read(path: Path, key: str) -> BlockValues | None:
    """A block of a study, by its key; None where the file is missing, is damaged, or belongs to another study."""
    try:
        digest, _, content = read_regular(path, MOST_BYTES).partition(b"\n")
        if hashlib.sha256(content).hexdigest().encode() != digest:
            return None
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            text = json.loads(arrays["words"].tobytes())
            if text["key"] != key:
                return None
            return BlockValues(
                cases=arrays["cases"],
                values=arrays["values"],
                periodic=arrays["periodic"],
                failures=tuple(text["failures"]),
                words={name: tuple(rows) for name, rows in text["words"].items()},
            )
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None
