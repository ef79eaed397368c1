"""Blocks of a study on disk, and what may stand in their files.

DIR/blocks holds `study.json`, the manifest: the study in plain data, the labels of its dataset and a checksum. Beside
it is one file for each finished block, named by the key of the study and the cases: a line with the checksum of the
rest, then arrays as numpy writes them. Each file is written under a temporary name, synced and renamed. A damaged file
is reported and counts as missing: its block is run again.

All that is read back is checked here for names, types, shapes and ranges: a right checksum says that a file is as it
was written, not that this version wrote it.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import re
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.arrays import Integers
from femimpact.errors import Fault, InputError, InputWarning, require
from femimpact.export.files import atomic_write, to_disk
from femimpact.parametric.definition import MOST_CASES
from femimpact.parametric.measures import MEASURES, Measure, Source, check_names
from femimpact.parametric.runs import BlockValues
from femimpact.regular_file import read_regular
from femimpact.study.parameter_plan import MOST_STARTS
from femimpact.study.result_directory import FILES, REPORT, STUDY_BLOCKS, STUDY_MANIFEST, earlier_files

Plain = Mapping[str, Any]

BLOCKS, MANIFEST = STUDY_BLOCKS, STUDY_MANIFEST
REWRITTEN = frozenset({FILES["study"].name, FILES["parameter_study"].name, FILES["parameter_table"].name, REPORT})
"""Files beside the blocks that every call writes anew."""

NAME = re.compile(r"([0-9a-f]{16})-([0-9a-f]{16})\.block")
UNFINISHED = re.compile(r"\.(study|[0-9a-f]{16}-[0-9a-f]{16})-\w{8}\.(json|block)")
UNFINISHED_RESULT = re.compile(r"\.(study(_[\w-]+)?|report)-\w{8}\.(nc|csv|toml|png|html)")
MOST_BYTES = 2_000_000_000

CHECKSUM = "sha256"
"""Key of the checksum of a manifest; absent in files of earlier versions."""

LONGEST_FAULT = 200

MANIFEST_KEYS = {"key": (str,), "study": (dict,), "table": (dict,)}
TABLE_KEYS = {
    "axes": (list,), "shape": (list,), "is_grid": (bool,), "measures": (list,), "starts": (int,), "attributes": (dict,),
}  # fmt: skip
AXIS_KEYS = {
    "path": (str,), "unit": (str,), "words": (str,), "levels": (list,), "codes": (list, type(None)),
    "distribution": (str,),
}  # fmt: skip
MEASURE_KEYS = {"name": (str,), "unit": (str,), "words": (str,), "is_text": (bool,)}
TEXT_KEYS = {"key": (str,), "failures": (list,), "words": (dict,)}
ARRAYS = ("cases", "values", "periodic", "words")


class DamagedFileError(Exception):
    """A file does not hold what a study writes; the message says why."""


class BlockFolder:
    """The finished blocks of one study in a directory.

    A directory with a block of this study belongs to it, whatever its manifest says: a manifest that is damaged, or
    that an earlier version has written without a checksum, is written anew.

    Parameters
    ----------
    directory : Path
        Of results; locked by the caller.
    plain : mapping
        The manifest without key and checksum: `study`, the study in plain data, and `table`, the labels of its dataset.
    key : str
        Of the study and the code.
    say : callable, optional
        Called with a line for each damaged file.

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
        manifest = {"key": key, **plain}
        content = json.dumps({CHECKSUM: _checksum(manifest), **manifest})
        now = json.loads(content)
        earlier = self._earlier(directory, now["study"])
        self.folder.mkdir(parents=True, exist_ok=True)
        if earlier != now:
            atomic_write(self.folder / MANIFEST, content)

    def _earlier(self, directory: Path, study: Any) -> dict[str, Any] | None:
        """The manifest that the directory holds; refused if it is that of another study."""
        keys = {matched[1] for matched in map(NAME.fullmatch, _names(self.folder)) if matched}
        has_blocks = self.key[:16] in keys
        try:
            earlier = _manifest(directory)
        except DamagedFileError as error:
            if keys and not has_blocks:
                raise _damaged(directory, error) from None
            self.say(f"{BLOCKS}/{MANIFEST} is damaged ({error}): it is written again")
            return None
        if earlier is None:
            other = next((name for name in earlier_files(directory) if name not in REWRITTEN), None)
            allowed = f"holds results of another kind ({other}): choose another directory"
            require(other is None, "directory", str(directory), "", allowed)
            return None
        difference = "" if has_blocks else first_difference(earlier["study"], study)
        allowed = f"holds another study: {difference}; choose another directory"
        require(not difference, "directory", str(directory), "", allowed)
        return earlier

    def path(self, cases: Integers) -> Path:
        """The file of a block by its cases."""
        return self.folder / _name(self.key, cases)

    def finished(self, cases: Integers) -> BlockValues | None:
        """The block of these cases from disk; None where it is missing or damaged."""
        path = self.path(cases)
        try:
            return _read(path, self.key, self.table)
        except FileNotFoundError:
            return None
        except DamagedFileError as error:
            self.say(f"{BLOCKS}/{path.name} is damaged ({error}): its cases are run again")
            return None

    def write(self, block: BlockValues) -> None:
        """Write a block to disk."""
        atomic_write(self.path(block.cases), block_content(block, self.key))
        to_disk(self.folder)

    def remove_unfinished(self) -> None:
        """Remove the temporary files of a process that was ended while it wrote."""
        for folder, pattern in ((self.folder, UNFINISHED), (self.folder.parent, UNFINISHED_RESULT)):
            for name in os.listdir(folder):
                if pattern.fullmatch(name):
                    (folder / name).unlink(missing_ok=True)


def read_manifest(directory: Path) -> dict[str, Any] | None:
    """The manifest of the study in a directory; None where there is none.

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
    """Names of the files in the folder of blocks, sorted; none where there is no folder."""
    try:
        return sorted(os.listdir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise InputError([Fault("directory", str(folder), "", f"must be readable: {error.strerror}")]) from None


def blocks_of(directory: Path, key: str, table: Mapping[str, Any]) -> Iterator[BlockValues]:
    """All blocks of a study on disk; a warning names each that is damaged.

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


def _name(key: str, cases: Integers) -> str:
    block = hashlib.sha256(np.ascontiguousarray(cases, dtype="<i8").tobytes()).hexdigest()
    return f"{key[:16]}-{block[:16]}.block"


def _read(path: Path, key: str, table: Mapping[str, Any]) -> BlockValues:
    """The block in a file; a file that is named after other cases is damaged."""
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


def first_difference(one: Any, other: Any, path: str = "") -> str:
    """The first difference between two plain data as text; empty where they are equal."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for name in dict.fromkeys((*one, *other)):
            inner = f"{path}.{name}" if path else str(name)
            if name not in one or name not in other:
                return f"{inner} is in one of them only"
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
    there, here = (text if len(text) <= 60 else f"{text[:57]}..." for text in map(json.dumps, (one, other)))
    return "" if one == other else f"{path} is {there} there, {here} here"


def _sound(condition: bool, fault: str) -> None:
    if not condition:
        # a line that may hold a text of the file
        raise DamagedFileError(" ".join(fault.split())[:LONGEST_FAULT])


def _check_record(record: Any, kinds: Mapping[str, tuple[type, ...]], name: str) -> None:
    """Check names and types of a record; a truth value is no number."""
    _sound(type(record) is dict and record.keys() == kinds.keys(), f"{name} must have {', '.join(kinds)} alone")
    for key, allowed in kinds.items():
        _sound(type(record[key]) in allowed, f"{key} of {name} is a {type(record[key]).__name__}")


# ---- manifest --------------------------------------------------------------------------------------


def _checksum(plain: Plain) -> str:
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def manifest_of(content: bytes) -> dict[str, Any]:
    """The manifest in a file: `key`, `study`, `table`, and the checksum unless an earlier version wrote the file.

    Raises `DamagedFileError` if it is not what `BlockFolder` writes.
    """
    try:
        found = json.loads(content)
        plain = {key: value for key, value in found.items() if key != CHECKSUM}
        same = CHECKSUM not in found or found[CHECKSUM] == _checksum(plain)
    except (ValueError, RecursionError, AttributeError):
        raise DamagedFileError("it is no table in JSON") from None
    _sound(same, "its checksum is that of another content")
    _check_record(plain, MANIFEST_KEYS, "the file")
    _sound(re.fullmatch("[0-9a-f]{64}", plain["key"]) is not None, "key is no hash")
    _check_table(plain["table"])
    _check_study(plain["study"], plain["table"])
    return dict(found)


def _check_table(table: Any) -> None:
    """Check the labels of a dataset."""
    _check_record(table, TABLE_KEYS, "table")
    _sound(1 <= table["starts"] <= MOST_STARTS, f"starts must be 1 to {MOST_STARTS}")
    for axis in table["axes"]:
        _check_axis(axis, table["is_grid"])
    for item in table["measures"]:
        _check_record(item, MEASURE_KEYS, "a measure")
        known = MEASURES.get(item["name"])
        # a function of the user gives a number
        _sound(item["is_text"] == (known is not None and known.is_text), "is_text of a measure is that of another")
    paths = [axis["path"] for axis in table["axes"]]
    names = {f"{path}{side}" for path in paths for side in ("", ".plus", ".minus")}
    _sound(len(paths) > 0 and len(names) == 3 * len(paths) and "" not in paths, "axes have no names of their own")
    _sound(len(table["measures"]) > 0, "there is no measure")
    try:
        measures = [Measure(item["name"], item["unit"], item["words"], Source.DWELL) for item in table["measures"]]
        check_names(measures, paths)
    except InputError as error:
        _sound(False, str(error))
    lengths = [len(axis["levels" if table["is_grid"] else "codes"]) for axis in table["axes"]]
    expected = lengths if table["is_grid"] else lengths[:1]
    # of a list or a sample every axis has a value in every case
    _sound(all(type(size) is int for size in table["shape"]) and table["shape"] == expected, "shape does not fit axes")
    _sound(table["is_grid"] or len(set(lengths)) == 1, "axes differ in their number of cases")
    _sound(1 <= math.prod(expected) <= MOST_CASES, f"cases must be 1 to {MOST_CASES}")
    texts_or_numbers = all(type(value) is str or _is_number(value) for value in table["attributes"].values())
    _sound(texts_or_numbers, "an attribute is no text or number")
    _sound(table["attributes"].get("starts") == table["starts"], "starts among the attributes are others")


def _check_axis(axis: Any, is_grid: bool) -> None:
    _check_record(axis, AXIS_KEYS, "an axis")
    levels, codes = axis["levels"], axis["codes"]
    _sound(len(levels) > 0, f"{axis['path']} has no value")
    _sound(all(map(_is_level, levels)), f"{axis['path']} has a value that is no finite number, pair or name")
    _sound((codes is None) == is_grid, f"codes of {axis['path']} do not fit is_grid")
    if codes is not None:
        sound = all(type(code) is int and 0 <= code < len(levels) for code in codes)
        _sound(sound, f"{axis['path']} has a code without a value")


def _is_level(value: Any) -> bool:
    if type(value) is list:
        return len(value) == 2 and all(map(_is_number, value))
    return type(value) is str or _is_number(value)


def _is_number(value: Any) -> bool:
    try:
        return type(value) in (int, float) and math.isfinite(value)
    except OverflowError:
        return False


def _check_study(study: Plain, table: Plain) -> None:
    """Check that the table is that of the study beside it."""
    axes = {axis["path"]: axis["levels"] for axis in table["axes"]}
    _sound(study.get("axes") == axes and study.get("order") == list(axes), "table has other axes than study")
    _sound(study.get("starts") == table["starts"], "table has other starts than study")
    _sound((study.get("cases") == "grid") == table["is_grid"], "table has other cases than study")
    named = [item["name"] for item in table["measures"]]
    asked = study.get("measures")
    # a function of the user is there by its code
    same = isinstance(asked, list) and len(asked) == len(named)
    same = same and all(type(one) is dict or one == name for one, name in zip(asked or (), named, strict=True))
    _sound(same, "table has other measures than study")


# ---- blocks ----------------------------------------------------------------------------------------


def block_content(
    block: BlockValues,
    key: str,  # of the study and the code
) -> bytes:
    """A block as bytes with their checksum."""
    payload = io.BytesIO()
    words = {"key": key, "failures": block.failures, "words": block.words}
    text = np.frombuffer(json.dumps(words).encode(), dtype=np.uint8)
    np.savez(payload, cases=block.cases, values=block.values, periodic=block.periodic, words=text)
    content = payload.getvalue()
    return hashlib.sha256(content).hexdigest().encode() + b"\n" + content


def block_of(
    content: bytes,  # bytes
    key: str,  # of the study and the code
    table: Plain,  # labels of the dataset of the study
) -> BlockValues:
    """The block that bytes hold.

    Raises `DamagedFileError` if they are not what `block_content` writes of a block of that study.
    """
    digest, _, payload = content.partition(b"\n")
    _sound(hashlib.sha256(payload).hexdigest().encode() == digest, "its checksum is that of another content")
    try:
        arrays = _arrays(payload)
        words = json.loads(arrays["words"].tobytes())
    except DamagedFileError:
        raise
    except Exception:
        # zipfile, numpy and json raise errors of a dozen kinds for what they do not understand
        raise DamagedFileError("it is no file of arrays") from None
    _check_record(words, TEXT_KEYS, "words")
    _sound(words["key"] == key, "it belongs to another study")
    _check_arrays(arrays, table)
    count = arrays["periodic"].size
    _check_texts(words["failures"], count, "failures")
    texts = {item["name"] for item in table["measures"] if item["is_text"]}
    _sound(words["words"].keys() == texts, "words are those of other measures")
    for name, rows in words["words"].items():
        _check_texts(rows, count, name)
    _check_values(arrays["values"], words["failures"], table)
    return BlockValues(
        cases=arrays["cases"],
        values=arrays["values"],
        periodic=arrays["periodic"],
        failures=words["failures"],
        words=words["words"],
    )


def _arrays(payload: bytes) -> dict[str, np.ndarray[Any, Any]]:
    """The arrays of a file that has those of a block alone, none of them packed: what is packed may be of any size."""
    with zipfile.ZipFile(io.BytesIO(payload)) as archive:
        members = archive.infolist()
        expected = sorted(f"{name}.npy" for name in ARRAYS)
        _sound(sorted(one.filename for one in members) == expected, "it has other arrays than a block")
        plain = all(one.compress_type == zipfile.ZIP_STORED and one.file_size <= len(payload) for one in members)
        _sound(plain, "its arrays are packed")
        texts = {name: io.BytesIO(archive.read(f"{name}.npy")) for name in ARRAYS}
    return {name: np.lib.format.read_array(text, allow_pickle=False) for name, text in texts.items()}


def _check_arrays(arrays: Mapping[str, np.ndarray[Any, Any]], table: Plain) -> None:
    """Check types and shapes of the arrays, and that the cases are some of the study's."""
    cases, starts = arrays["cases"], table["starts"]
    shapes = {"values": (cases.size, starts, len(table["measures"])), "periodic": (cases.size, starts)}
    kinds = {"cases": np.int64, "values": np.float64, "periodic": np.bool_}
    for name, kind in kinds.items():
        _sound(arrays[name].dtype == kind, f"{name} are of type {arrays[name].dtype}")
    _sound(cases.ndim == 1 and cases.size > 0, f"cases have the shape {cases.shape}")
    for name, shape in shapes.items():
        _sound(arrays[name].shape == shape, f"{name} have the shape {arrays[name].shape} in place of {shape}")
    known = bool(cases.min() >= 0 and cases.max() < math.prod(table["shape"]))
    _sound(known and np.unique(cases).size == cases.size, "cases are none of the study, or there twice")


def _check_texts(rows: Any, count: int, name: str) -> None:
    sound = type(rows) is list and len(rows) == count and all(type(row) is str for row in rows)
    _sound(sound, f"{name} must be {count} texts")


def _check_values(values: np.ndarray[Any, Any], failures: list[str], table: Plain) -> None:
    """Check that there is no number where a start failed, or where a measure is a word."""
    failed = np.array([failure != "" for failure in failures]).reshape(values.shape[:2])
    text = np.array([item["is_text"] for item in table["measures"]])
    _sound(bool(np.isnan(values[failed]).all()), "a start that failed has values")
    _sound(bool(np.isnan(values[:, :, text]).all()), "a measure that is a word has numbers")
