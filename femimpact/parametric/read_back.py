"""What is read back from the directory of a study: names, types, shapes and ranges are checked here, and nowhere else.

A right checksum says that a file is as it was written, not that this version wrote it.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from femimpact.errors import InputError
from femimpact.parametric.cases import MOST_CASES
from femimpact.parametric.evaluation import BlockValues
from femimpact.parametric.measures import MEASURES, Measure, Source, check_names
from femimpact.study.parameter_plan import MOST_STARTS

Plain = Mapping[str, Any]

CHECKSUM = "sha256"
"""Key of the checksum of what a study is; absent in files of earlier versions."""

LONGEST_FAULT = 200

MANIFEST = {"key": (str,), "study": (dict,), "table": (dict,)}
TABLE = {
    "axes": (list,), "shape": (list,), "is_grid": (bool,), "measures": (list,), "starts": (int,), "attributes": (dict,),
}  # fmt: skip
AXIS = {
    "path": (str,), "unit": (str,), "words": (str,), "levels": (list,), "codes": (list, type(None)),
    "distribution": (str,),
}  # fmt: skip
MEASURE = {"name": (str,), "unit": (str,), "words": (str,), "is_text": (bool,)}
WORDS = {"key": (str,), "failures": (list,), "words": (dict,)}
ARRAYS = ("cases", "values", "periodic", "words")


class DamagedFileError(Exception):
    """A file does not hold what a study writes; its words say what is wrong."""


def _sound(condition: bool, fault: str) -> None:
    if not condition:
        # a line that may hold a text of the file
        raise DamagedFileError(" ".join(fault.split())[:LONGEST_FAULT])


def _check_record(record: Any, kinds: Mapping[str, tuple[type, ...]], name: str) -> None:
    """Check names and types of a record; a truth value is no number."""
    _sound(type(record) is dict and record.keys() == kinds.keys(), f"{name} must have {', '.join(kinds)} alone")
    for key, allowed in kinds.items():
        _sound(type(record[key]) in allowed, f"{key} of {name} is a {type(record[key]).__name__}")


# ---- what the study is -----------------------------------------------------------------------------


def _checksum(plain: Plain) -> str:
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def manifest_content(plain: Plain) -> str:
    """Text in JSON of the record that defines a study, with a checksum of that record."""
    return json.dumps({CHECKSUM: _checksum(plain), **plain})


def manifest_of(content: bytes) -> dict[str, Any]:
    """What a study is, by the content of its file: `key`, `study` and `table`, and the checksum where there is one.

    Of a file of an earlier version, without a checksum, the table is held to the study beside it, as of any.

    Raises `DamagedFileError` if it is not what `manifest_content` writes.
    """
    try:
        found = json.loads(content)
        plain = {key: value for key, value in found.items() if key != CHECKSUM}
        same = CHECKSUM not in found or found[CHECKSUM] == _checksum(plain)
    except (ValueError, RecursionError, AttributeError):
        raise DamagedFileError("it is no table in JSON") from None
    _sound(same, "its checksum is that of another content")
    _check_record(plain, MANIFEST, "the file")
    _sound(re.fullmatch("[0-9a-f]{64}", plain["key"]) is not None, "key is no hash")
    _check_table(plain["table"])
    _check_study(plain["study"], plain["table"])
    return dict(found)


def _check_table(table: Any) -> None:
    """Check what a dataset is labelled by."""
    _check_record(table, TABLE, "table")
    _sound(1 <= table["starts"] <= MOST_STARTS, f"starts must be 1 to {MOST_STARTS}")
    for axis in table["axes"]:
        _check_axis(axis, table["is_grid"])
    for item in table["measures"]:
        _check_record(item, MEASURE, "a measure")
        known = MEASURES.get(item["name"])
        # a function of the user's own gives a number
        _sound(item["is_text"] == (known is not None and known.is_text), "is_text of a measure is that of another")
    paths = [axis["path"] for axis in table["axes"]]
    names = {f"{path}{side}" for path in paths for side in ("", ".plus", ".minus")}
    _sound(len(paths) > 0 and len(names) == 3 * len(paths) and "" not in paths, "axes have no names of their own")
    _sound(len(table["measures"]) > 0, "there is no measure")
    try:
        check_names([Measure(**_renamed(item), source=Source.DWELL) for item in table["measures"]], paths)
    except InputError as error:
        _sound(False, str(error))
    lengths = [len(axis["levels" if table["is_grid"] else "codes"]) for axis in table["axes"]]
    expected = lengths if table["is_grid"] else lengths[:1]
    # of a list or a sample every axis has a value in every case
    _sound(all(type(size) is int for size in table["shape"]) and table["shape"] == expected, "shape does not fit axes")
    _sound(table["is_grid"] or len(set(lengths)) == 1, "axes differ in their number of cases")
    _sound(1 <= math.prod(expected) <= MOST_CASES, f"cases must be 1 to {MOST_CASES}")
    told = table["attributes"]
    _sound(all(type(value) is str or _is_number(value) for value in told.values()), "an attribute is no text or number")
    _sound(told.get("starts") == table["starts"], "starts among the attributes are others")


def _renamed(item: Plain) -> dict[str, Any]:
    return {"long_name" if key == "words" else key: value for key, value in item.items()}


def _check_axis(axis: Any, is_grid: bool) -> None:
    _check_record(axis, AXIS, "an axis")
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
    # a function of the user's own is there by its code
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
    of_words = {name: list(rows) for name, rows in block.words.items()}
    words = {"key": key, "failures": list(block.failures), "words": of_words}
    text = np.frombuffer(json.dumps(words).encode(), dtype=np.uint8)
    np.savez(payload, cases=block.cases, values=block.values, periodic=block.periodic, words=text)
    content = payload.getvalue()
    return hashlib.sha256(content).hexdigest().encode() + b"\n" + content


def block_of(
    content: bytes,  # bytes
    key: str,  # of the study and the code
    table: Plain,  # what the dataset of the study is labelled by
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
    _check_record(words, WORDS, "words")
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
        failures=tuple(words["failures"]),
        words={name: tuple(rows) for name, rows in words["words"].items()},
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
