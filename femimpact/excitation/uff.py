"""Datasets 58 and 58b of UFF files: functions over time, read from the bytes of a file and written as text."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, require
from femimpact.excitation.columns import MOST_BYTES
from femimpact.regular_file import read_regular

UFF = (".uff", ".uf", ".ufb", ".unv", ".bunv")
"""Endings of the names of UFF files."""

MOST_SAMPLES = 10_000_000
"""Most samples of a UFF file by its headers."""

MINUS_ONE = re.compile(rb"^[ \t]*-1[ \t]*\r?(?:\n|\Z)", re.MULTILINE)
"""The line before and behind a dataset."""

LINES = 12
"""Lines of a dataset 58 before its data: its number and the 11 of its header."""

SHORT_EXPONENT = re.compile(rb"(\d)([+-]\d{3})(?=[\s+-]|\Z)")
"""The end of a number whose exponent has no letter, as Fortran writes it in a narrow column."""

TIME = (0, 17)
"""Types of an axis: unknown and time."""

REAL = {2: "f4", 4: "f8"}
"""Binary numbers by the type of the data; 5 and 6 are complex."""

KINDS = {"m": 8, "m/s": 11, "m/s^2": 12, "N": 13}
"""Type of the data by the SI unit."""


@dataclass(frozen=True, eq=False)
class Signal:
    """A dataset 58: samples over time, in the units of the file."""

    name: str
    values: Array
    time: Array
    unit: str  # "" where the file names none
    unit_of_time: str


def read_uff(path: str | Path) -> list[Signal]:
    """Datasets 58 and 58b of a file.

    Raises `InputError` if it cannot be read, is no regular file or too large, holds none, or one is damaged, complex
    or not over time.
    """
    must_be = "must be a UFF file with datasets 58"
    try:
        content = read_regular(path, MOST_BYTES)
        _check(MINUS_ONE.search(content) is not None, f"{must_be}: it has no dataset")
        signals = list(_signals(content))
        _check(len(signals) > 0, f"{must_be}: it has none")
    except OSError as error:
        raise InputError([Fault("path", str(path), "", f"{must_be}: {error.strerror or 'cannot be read'}")]) from None
    except InputError as error:
        raise InputError([replace(fault, value=str(path)) for fault in error.faults]) from None
    return signals


def _check(sound: bool, words: str) -> None:
    require(sound, "path", None, "", words)


def _signals(content: bytes) -> Iterator[Signal]:
    at, samples = 0, 0
    while begin := MINUS_ONE.search(content, at):
        header, at = _lines(content, begin.end())
        number = header[0].split()[:1] if header else []
        if number not in (["58"], ["58b"], ["58B"]):
            at = _behind(content, begin.end())[1]
            continue
        _check(len(header) == LINES, "is cut off in the header of a dataset 58")
        name = header[1].strip()
        if not name or name.upper() == "NONE":
            name = f"{header[6][30:41].strip() or 'signal'} {header[6][41:51].strip()}".strip()
        form = _form(header[7], name)
        samples += form.count
        most = f"must be a UFF file with datasets 58: it has {samples:,} samples by its headers"
        _check(samples <= MOST_SAMPLES, f"{most}, of which at most {MOST_SAMPLES:,} are read")
        _check(form.kind not in (5, 6), f"{name!r} is complex: must be over time")
        _check(form.kind in REAL, f"{name!r} has data of type {form.kind}: must be 2 or 4, real numbers")
        axis = header[8][:10].strip()
        _check(axis.isdigit() and int(axis) in TIME, f"{name!r} must be over time")
        if number == ["58"]:
            end, behind = _behind(content, at)
            values = _numbers(content[at:end], name)
        else:
            values, behind = _binary(content, at, form, header[0].split(), name)
        stored = form.count * form.columns
        allowed = f"{name!r} has {values.size // form.columns} samples, and {form.count} by its header: "
        _check(values.size == stored, f"{allowed}is the file cut off?")
        table, at = values.reshape(form.count, form.columns), behind
        is_finite = np.isfinite(table).all(axis=1)
        _check(bool(is_finite.all()), f"{name!r}, sample {np.argmin(is_finite) + 1}: is no finite number")
        time = table[:, 0].copy() if form.columns == 2 else form.begin + form.step * np.arange(form.count, dtype=float)
        yield Signal(name, table[:, -1].copy(), time, _unit(header[9]), _unit(header[8]))


def _lines(content: bytes, at: int) -> tuple[list[str], int]:
    """The lines of a header, and where its data begins."""
    begin = at
    for _ in range(LINES):
        end = content.find(b"\n", at)
        if end < 0:
            break
        at = end + 1
    header = content[begin:at]
    try:
        return header.decode().splitlines(), at
    except UnicodeDecodeError:
        # in the code of Western Europe every byte is a letter
        return header.decode("latin-1").splitlines(), at


def _behind(content: bytes, at: int) -> tuple[int, int]:
    """Where the lines of a dataset end, and where to look for the next one; the last may lack its -1."""
    end = MINUS_ONE.search(content, at)
    if end is None:
        return len(content), len(content)
    # a number behind it: this -1 begins the next dataset, and the one that ends this is lost
    begins = re.match(rb" *\d{2,4}[bB]?\b", content[end.end() : end.end() + 12])
    return end.start(), end.start() if begins else end.end()


@dataclass(frozen=True)
class _Form:
    kind: int  # of the numbers
    count: int  # of samples
    columns: int  # 1, or 2 with the times
    begin: float
    step: float


def _form(line: str, name: str) -> _Form:
    """The line of a header with the form of the data."""
    try:
        cells = line.upper().replace("D", "E").split()
        kind, count, even = map(int, cells[:3])
        begin, step = (float(cells[3]), float(cells[4])) if even else (0.0, 0.0)
    except (ValueError, IndexError):
        kind, count, even, begin, step = 0, -1, -1, 0.0, 0.0
    sound = count >= 0 and even in (0, 1) and np.isfinite([begin, step]).all()
    _check(bool(sound), f"{name!r}: line 7 of its header must be a type, a number of samples, 0 or 1, begin and step")
    return _Form(kind, count, 1 if even else 2, begin, step)


def _numbers(block: bytes, name: str) -> Array:
    """The numbers of a block of text, in columns of any width."""
    block = SHORT_EXPONENT.sub(rb"\1E\2", block.upper().replace(b"D", b"E"))
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.asarray(np.fromstring(block, sep=" "))
        except (ValueError, DeprecationWarning):
            allowed = f"{name!r} holds what is no number: is the file cut off?"
            raise InputError([Fault("path", None, "", allowed)]) from None


def _binary(content: bytes, at: int, form: _Form, number: Sequence[str], name: str) -> tuple[Array, int]:
    """The numbers of a dataset 58b, and where the next one begins."""
    known = len(number) >= 3 and number[1] in ("1", "2") and number[2] == "2"
    _check(known, f"{name!r} has numbers that are not IEEE, or in no known order of bytes")
    kind = np.dtype(("<" if number[1] == "1" else ">") + REAL[form.kind])
    end = min(at + form.count * form.columns * kind.itemsize, len(content))
    values = np.frombuffer(content[at : end - (end - at) % kind.itemsize], kind).astype(float)
    # with a byte lost the end of a line is the last byte of the data
    line = b"\r\n" if content[:at].endswith(b"\r\n") else b"\n"
    behind = re.compile(rb"(?:%s)?    -1[ \t]*\r?(?:\n|\Z)|\s*\Z" % line).match(content, end)
    swallowed = content[:end].endswith(line) and not content.startswith(line, end) and end < len(content)
    ended = (behind is not None and not swallowed) or values.size < form.count * form.columns
    _check(ended, f"{name!r}: no -1 behind its data: are bytes lost or added?")
    return values, behind.end() if behind else len(content)


def _unit(line: str) -> str:
    """Unit of an axis; empty where it names none."""
    label_and_unit = re.split(r"\s{2,}", line[25:].strip("\0 "))
    unit = label_and_unit[1] if len(label_and_unit) == 2 else line[46:67].strip("\0 ")
    return _held(unit)


def names_in_uff(signals: Sequence[tuple[str, str, Array]]) -> list[tuple[str, str]]:
    """Names and units of signals, cut to the columns of a file that `write_uff` makes, "" where they are lost."""
    return [(_held(name[:80].strip()), _held(unit[:20].strip())) for name, unit, _ in signals]


def _held(word: str) -> str:
    return "" if word.upper() == "NONE" else word


def write_uff(
    path: Path,
    begin: float,  # s
    step: float,  # s, between samples
    signals: Sequence[tuple[str, str, Array]],  # name, unit and samples
) -> None:
    """Write signals over the same even times as datasets 58."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for node, (name, unit, values) in enumerate(signals, 1):
            lines = ["    -1", "    58", name[:80] or "NONE", *["NONE"] * 4]
            lines.append(f"{1:5}{0:10}{0:5}{0:10} {'NONE':10}{node:10}{3:4} {'NONE':10}{node:10}{3:4}")
            lines.append(f"{4:10}{values.size:10}{1:10}{begin:13.5e}{step:13.5e}{0.0:13.5e}")
            axes = ((17, "s"), (KINDS.get(unit, 0), unit[:20] or "NONE"), (0, "NONE"), (0, "NONE"))
            lines += [f"{kind:10}{0:5}{0:5}{0:5} {'NONE':20} {label:20}" for kind, label in axes]
            rows = (values[i : i + 4].tolist() for i in range(0, values.size, 4))
            file.writelines(f"{line}\n" for line in lines)
            file.writelines("".join(f"{value:20.11e}" for value in row) + "\n" for row in rows)
            file.write("    -1\n")
