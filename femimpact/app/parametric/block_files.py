"""Blocks of a study on disk.

DIR/blocks holds `study.json`, the manifest: the key of the study and the code, the study in plain data, the labels of
its dataset and a checksum. Beside it is one file for each finished block, named by the key and its first case: a line
with the checksum of its name and the rest, then arrays as numpy writes them. Each file is written under a temporary
name, synced and renamed. A damaged file is reported and counts as missing: its block is run again.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.app.parametric.runs import BlockValues
from femimpact.app.results.result_directory import (
    FILES,
    REPORT,
    STUDY_BLOCKS,
    STUDY_FIGURE,
    STUDY_MANIFEST,
    result_files,
)
from femimpact.errors import Fault, InputError, require
from femimpact.files import atomic_write, to_disk
from femimpact.regular_file import read_regular

BLOCKS, MANIFEST = STUDY_BLOCKS, STUDY_MANIFEST
REWRITTEN = frozenset(
    {REPORT, *(FILES[key].name for key in ("study", "parameter_study", "parameter_table", "best_study", "base_record"))}
)
"""Files beside the blocks that every call writes anew."""

NAME = re.compile(r"([0-9a-f]{16})-\d+\.block")
UNFINISHED = re.compile(r"\.(study|[0-9a-f]{16}-\d+)-\w{8}\.(json|block)")
UNFINISHED_RESULT = re.compile(r"\.(study(_[\w-]+)?|report)-\w{8}\.(nc|csv|toml|png|html)")
MOST_BYTES = 2_000_000_000


class DamagedFileError(Exception):
    """A file does not hold what a study has written; the message says why."""


# ---- blocks ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class BlockFolder:
    """The finished blocks of one study.

    Parameters
    ----------
    folder : Path
    key : str
        Of the study and the code.
    damaged : callable
        Called with the name of each damaged file and the reason.
    """

    folder: Path
    key: str
    damaged: Callable[[str, str], None]

    def blocks(self) -> Iterator[BlockValues]:
        """All blocks on disk.

        Raises `InputError` if the folder cannot be listed.
        """
        for name in _names(self.folder):
            if keys_of([name]) == {self.key[:16]}:
                try:
                    yield _block_of(_bytes_of(self.folder / name), self._checked_by(name))
                except FileNotFoundError:
                    continue
                except DamagedFileError as error:
                    self.damaged(name, str(error))

    def write(self, block: BlockValues) -> None:
        """Write a block to disk."""
        name = f"{self.key[:16]}-{int(block.cases[0]):08d}.block"
        atomic_write(self.folder / name, _content_of(block, self._checked_by(name)))
        to_disk(self.folder)

    def remove_unfinished(self) -> None:
        """Remove the temporary files of a process that was ended while it wrote."""
        for folder, pattern in ((self.folder, UNFINISHED), (self.folder.parent, UNFINISHED_RESULT)):
            for name in os.listdir(folder):
                if pattern.fullmatch(name):
                    (folder / name).unlink(missing_ok=True)

    def _checked_by(self, name: str) -> bytes:
        """What the checksum of a file holds beside its content: under another name it is damaged."""
        return f"{self.key} {name}".encode()


def _content_of(block: BlockValues, place: bytes) -> bytes:
    """A block as bytes with their checksum."""
    payload = io.BytesIO()
    text = np.frombuffer(json.dumps([block.failures, block.words]).encode(), dtype=np.uint8)
    np.savez(payload, cases=block.cases, values=block.values, periodic=block.periodic, texts=text)
    content = payload.getvalue()
    return hashlib.sha256(place + content).hexdigest().encode() + b"\n" + content


def _block_of(content: bytes, place: bytes) -> BlockValues:
    """The block in a file."""
    digest, _, payload = content.partition(b"\n")
    if hashlib.sha256(place + payload).hexdigest().encode() != digest:
        raise DamagedFileError("its checksum is that of another content")
    with np.load(io.BytesIO(payload)) as arrays:
        failures, words = json.loads(arrays["texts"].tobytes())
        return BlockValues(arrays["cases"], arrays["values"], arrays["periodic"], failures, words)


def _bytes_of(path: Path) -> bytes:
    """Bytes of a file; one that cannot be read is damaged."""
    try:
        return read_regular(path, MOST_BYTES)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DamagedFileError(f"it cannot be read: {error.strerror}") from None


def _names(folder: Path) -> list[str]:
    """Names of the files in the folder of blocks, sorted; none where there is no folder."""
    try:
        return sorted(os.listdir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise InputError([Fault("directory", str(folder), "", f"must be readable: {error.strerror}")]) from None


def keys_of(names: list[str]) -> set[str]:
    """The beginnings of the keys of the studies whose blocks have these names."""
    return {matched[1] for matched in map(NAME.fullmatch, names) if matched}


# ---- manifest --------------------------------------------------------------------------------------


def block_folder(
    directory: Path,  # of results; locked by the caller
    plain: Mapping[str, Any],  # `study`, the study in plain data, and `table`, the labels of its dataset
    key: str,  # of the study and the code
    say: Callable[[str], None],  # called with a line for each damaged file
) -> BlockFolder:
    """The blocks of a study in a directory, which says from now on that it is the study's.

    A directory with a block of this study belongs to it, whatever its manifest says.

    Raises `InputError` if the directory holds another study, a damaged one of which no block is this study's, or
    something that is not a study.
    """

    def damaged(name: str, reason: str) -> None:
        say(f"{BLOCKS}/{name} is damaged ({reason}): its cases are run again")

    folder = directory / BLOCKS
    keys = keys_of(_names(folder))
    now = json.loads(json.dumps({"key": key, **plain}))
    earlier = None
    try:
        earlier = _manifest(folder / MANIFEST)
    except FileNotFoundError:
        names = (name for name in result_files(directory) if not STUDY_FIGURE.fullmatch(name))
        other = next((name for name in names if name not in REWRITTEN), None)
        allowed = f"holds results of another kind ({other}): choose another directory"
        require(other is None, "directory", str(directory), "", allowed)
    except DamagedFileError as error:
        if keys and key[:16] not in keys:
            raise _damaged(directory, error) from None
        say(f"{BLOCKS}/{MANIFEST} is damaged ({error}): it is written again")
    difference = "" if earlier is None or key[:16] in keys else first_difference(earlier["study"], now["study"])
    allowed = f"holds another study: {difference}; choose another directory"
    require(not difference, "directory", str(directory), "", allowed)
    folder.mkdir(parents=True, exist_ok=True)
    if earlier != now:
        atomic_write(folder / MANIFEST, json.dumps({"sha256": _checksum(now), **now}))
    return BlockFolder(folder, key, damaged)


def read_manifest(directory: Path) -> dict[str, Any]:
    """The manifest of the study in a directory: `key`, `study` and `table`.

    Raises `InputError` if there is none, or it is damaged.
    """
    try:
        return _manifest(directory / BLOCKS / MANIFEST)
    except FileNotFoundError:
        raise InputError([Fault("directory", str(directory), "", "must hold a parameter study")]) from None
    except DamagedFileError as error:
        raise _damaged(directory, error) from None


def _damaged(directory: Path, error: DamagedFileError) -> InputError:
    advice = f"run the same study again to write it anew, remove {BLOCKS}, or choose another directory"
    allowed = f"holds a {BLOCKS}/{MANIFEST} that is damaged ({error}): {advice}"
    return InputError([Fault("directory", str(directory), "", allowed)])


def _manifest(path: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(_bytes_of(path))
        same = found.pop("sha256", None) == _checksum(found)
    except (ValueError, RecursionError, AttributeError, TypeError):
        raise DamagedFileError("it is no table in JSON") from None
    if not same:
        raise DamagedFileError("its checksum is that of another content")
    return found


def _checksum(plain: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def first_difference(one: Any, other: Any, path: str = "") -> str:
    """The first difference between two plain data as text; empty where they are equal."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for name in dict.fromkeys((*one, *other)):
            inner = f"{path}.{name}" if path else str(name)
            if name not in one or name not in other:
                absent = "at its default" if "noun" in one else "absent"
                there, here = (_short(each[name]) if name in each else absent for each in (one, other))
                return f"{inner} is {there} there, {here} here"
            found = first_difference(one[name], other[name], inner)
            if found:
                return found
        return ""
    if isinstance(one, list) and isinstance(other, list):
        for i, (first, second) in enumerate(zip(one, other, strict=False)):
            found = first_difference(first, second, f"{path}[{i}]")
            if found:
                return found
        return "" if len(one) == len(other) else f"{path} has {len(one)} entries there, {len(other)} here"
    return "" if one == other else f"{path} is {_short(one)} there, {_short(other)} here"


def _short(plain: Any) -> str:
    text = json.dumps(plain)
    return text if len(text) <= 60 else f"{text[:57]}..."
