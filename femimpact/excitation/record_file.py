"""Samples of an acceleration from a text file of columns, as data loggers write them."""

from __future__ import annotations

import codecs
import io
import math
from array import array
from collections.abc import Iterable, Iterator, Sequence
from operator import methodcaller
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from femimpact.decimal_number import decimal_number
from femimpact.errors import Fault, InputError, checked, choice, instance, quantity, require, require_path
from femimpact.errors import text as a_text
from femimpact.regular_file import open_regular, read_now

__all__ = ["record_text", "samples_of"]

Array = NDArray[np.float64]

UNEVEN = 0.25
"""Share of the interval by which a time may lie off the even grid: rounding is less, a lost sample half or more."""

MOST_LINES = 10_001_000
"""Of the file of a record: 10 million rows, behind a header, are read within 1 GB of memory."""

MOST_BYTES = 600_000_000
"""Of the file of a record: rows of two numbers to the last bit have 51."""

PIECE = 1 << 23
"""Bytes of a file, or letters of a text, that are gone through at once."""

SHOWN = 4
"""Cells of a line that is no row, of which a fault says what kind they are."""

MARKS = ";\t,"
"""What stands between cells: the first of these that a line has, or spaces."""


def record_text(path: str | Path) -> str:
    """What the file of a record holds.

    Raises
    ------
    InputError
        If it cannot be read, is no regular file or no text, or, before it is read, has too many bytes or lines.
    """
    require_path(path, "path", "a text file")
    try:
        with open_regular(path, MOST_BYTES) as file:
            lines = _line_count(file)
            if lines <= MOST_LINES:
                return _decoded(file)
            reason = f"has {lines:,} lines, of which at most {MOST_LINES:,} are read"
    except OSError as error:
        reason = error.strerror or "cannot be read"
    except UnicodeDecodeError:
        reason = "is no text"
    raise InputError([Fault("path", str(path), "", f"must be a text file of columns: {reason}")])


def _pieces(file: BinaryIO) -> Iterator[bytes]:
    while piece := read_now(file, PIECE):
        yield piece


def _line_count(file: BinaryIO) -> int:
    """Lines of a file, which is at its beginning again then."""
    count = 0
    for piece in _pieces(file):
        # lines of old Macintosh files end with a carriage return alone
        count += max(piece.count(b"\n"), piece.count(b"\r"))
    file.seek(0)
    return count


def _decoded(file: BinaryIO) -> str:
    """The text of a file, every end of a line a line feed, without a second copy of it in memory."""
    decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder("utf-8-sig")(), translate=True)
    text = ""
    for piece in _pieces(file):
        # a text that nothing else refers to grows where it is
        text += decoder.decode(piece)
    text += decoder.decode(b"", final=True)
    return text


def samples_of(
    text: str, scale: float, detrend: str, columns: Sequence[int | str], path: str | Path
) -> tuple[Array, float]:
    """Samples and interval of what `record_text` read from a path; see `RecordedBase.from_csv`.

    Returns
    -------
    samples : ndarray (n,)
        The second column times the scale, without its mean or its line of least squares where that is asked.
    interval : float, s
        Between samples, from the first and the last time.

    Raises
    ------
    InputError
        If an argument is out of range, or the text lacks a column, holds what is not a finite number or fewer than two
        samples, its times are not evenly spaced, or all its accelerations are zero.
    """
    checked("text", text, a_text())
    checked("path", path, instance(str, Path))
    scale = checked("scale", scale, quantity("1"))
    require(scale != 0.0, "scale", scale, "1", "must not be 0")
    detrend = checked("detrend", detrend, choice("none", "mean", "line"))
    two = isinstance(columns, (tuple, list)) and len(columns) == 2 and all(map(_is_column, columns))
    require(two, "columns", columns, "", "must be two numbers from 0 or names of the header, of time and acceleration")
    time, values = _columns(text, Path(path), tuple(columns))
    # a long one is as large as all the rest; it goes here where the caller keeps none
    del text
    require(time.size >= 2, "path", str(path), "", "must hold 2 or more rows of numbers")
    require(
        bool(values.any()), "columns", tuple(columns), "", "must be time and acceleration: the second holds zeros only"
    )
    interval = _interval(time, path)
    del time
    values *= scale
    return _without_trend(values, detrend), interval


def _without_trend(samples: Array, detrend: str) -> Array:
    """The samples, their own array, without their mean or their line of least squares."""
    if detrend != "none":
        samples -= samples.mean()
    if detrend == "line":
        # at right angles to a constant: the mean stays zero
        along = np.arange(samples.size, dtype=float)
        along -= along.mean()
        along *= (along @ samples) / (along @ along)
        samples -= along
    return samples


def _is_column(value: object) -> bool:
    return isinstance(value, str) or (isinstance(value, int) and not isinstance(value, bool) and value >= 0)


def _columns(text: str, path: Path, columns: tuple[int | str, ...]) -> tuple[Array, Array]:
    """The two columns of numbers behind the header; lines that are empty or begin with # are left out."""
    places, first = _header(path, text, columns)
    # arrays that grow where they are
    found, width = (array("d"), array("d")), 0
    for number, lines in _blocks(text):
        rows = lines[max(first - number, 0) :]
        width = width or next((len(fields) for _, fields in _cells(rows, number)), 0)
        values = _plain_values(rows, places, width)
        if values is None:
            values = _values(_cells(rows, max(first, number)), places, width, path)
        for column, part in zip(found, values.T, strict=True):
            column.frombytes(part.tobytes())
    return np.frombuffer(found[0]), np.frombuffer(found[1])


def _blocks(text: str) -> Iterator[tuple[int, list[str]]]:
    """Lines of a text, some at once, with the number of the first of them."""
    begin, number = 0, 1
    while begin < len(text):
        end = text.find("\n", begin + PIECE) + 1 or len(text)
        lines = text[begin:end].splitlines()
        yield number, lines
        begin, number = end, number + len(lines)


def _cells(lines: Iterable[str], number: int) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is neither empty nor begins with #."""
    return ((i, _fields(line)) for i, line in enumerate(lines, number) if line.strip() and line.lstrip()[0] != "#")


def _plain_values(lines: Sequence[str], places: tuple[int, ...], width: int) -> Array | None:
    """What `_values` finds in lines that are all written in the same plain way; None where they are not."""
    block = "\n".join(lines)
    # few files have lines to leave out, and what is asked of each line takes as long as its numbers
    if "#" in block or not all(lines) or any(map(str.isspace, lines)):
        lines = [line for line in lines if (begin := line.lstrip()) and begin[0] != "#"]
        block = "\n".join(lines)
    if not lines:
        return np.zeros((0, len(places)))
    mark = _mark(lines[0])
    # a line without the mark has no second cell
    others = MARKS.partition(mark)[0] if mark else MARKS
    if mark and '"' in block:
        block = block.replace(f'"{mark}', mark).replace(f'{mark}"', mark)
        lines = [line.strip().strip('"') for line in block.split("\n")]
        block = "\n".join(lines)
    if any(sign in block for sign in others + '"') or max(places) == 0:
        return None
    if mark == "," and set(map(methodcaller("count", ","), lines)) != {width - 1}:
        return None
    if mark in (";", "\t") and "," in block:
        lines = block.replace(",", ".").split("\n")
    try:
        values = np.loadtxt(lines, delimiter=mark, comments=None, usecols=places, ndmin=2)
    except ValueError:
        return None
    return values if len(values) == len(lines) and np.isfinite(values).all() else None


def _values(cells: Iterable[tuple[int, list[str]]], places: tuple[int, ...], width: int, path: Path) -> Array:
    """The two numbers of every line (rows, 2), or the first line without; `width` counts cells of the first row."""
    rows = []
    for i, fields in cells:
        # the rest of a number with a decimal comma, in a file of commas; words may stand there
        more = next((cell for cell in fields[width:] if decimal_number(cell) is not None), None)
        allowed = f"line {i}: a number, {more!r}, behind the {width} cells of the first row: is a comma a decimal one?"
        require(more is None, "path", str(path), "", allowed)
        row = []
        for place in places:
            value = _number(fields[place]) if place < len(fields) else math.nan
            allowed = f"line {i}, column {place}: {_kind(fields, place)} is no finite number"
            require(math.isfinite(value), "path", str(path), "", allowed)
            row.append(value)
        rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, len(places))


def _header(path: Path, text: str, columns: tuple[int | str, ...]) -> tuple[tuple[int, ...], int]:
    """Numbers of the two columns, and of the line from which on there are rows.

    A fault does not show what stands in the file, which may be no record at all but something secret.
    """
    names = [column for column in columns if isinstance(column, str)]
    begin = "is empty"
    for i, fields in (cells for number, lines in _blocks(text) for cells in _cells(lines, number)):
        if names and all(name in fields for name in names):
            return tuple(fields.index(column) if isinstance(column, str) else column for column in columns), i + 1
        numbers = [column for column in columns if isinstance(column, int) and column < len(fields)]
        if not names and len(numbers) == 2 and not any(math.isnan(_number(fields[place])) for place in numbers):
            return (numbers[0], numbers[1]), i
        if begin == "is empty":
            kinds = ", ".join(_kind(fields, place) for place in range(min(len(fields), SHOWN)))
            more = ", ..." if len(fields) > SHOWN else ""
            begin = f"begins at line {i} with {len(fields)} cell{'s' * (len(fields) != 1)}: {kinds}{more}"
    allowed = f"must be two columns of numbers in {path.name}, by number from 0 or by name of its header; it {begin}"
    raise InputError([Fault("columns", list(columns), "", allowed)])


def _kind(fields: Sequence[str], place: int) -> str:
    """What kind of cell stands at a place of a line, without what it holds."""
    if place >= len(fields) or not fields[place]:
        return "nothing"
    return "a text" if decimal_number(fields[place].replace(",", ".")) is None else "a number"


def _mark(line: str) -> str | None:
    """What stands between the cells of a line; None is spaces."""
    return next((mark for mark in MARKS if mark in line), None)


def _fields(line: str) -> list[str]:
    """Cells of a line: between semicolons, tabulators or commas, the first of them that it has, or spaces.

    Between semicolons or tabulators a decimal comma is a point.
    """
    return [cell.strip().strip('"') for cell in line.split(_mark(line))]


def _number(cell: str) -> float:
    """The number that a cell holds, not a number where it holds none."""
    value = decimal_number(cell.replace(",", "."))
    return math.nan if value is None else value


def _interval(time: Array, path: str | Path) -> float:
    """Time (s) between samples, where it is one."""
    interval = float(time[-1] - time[0]) / (time.size - 1)
    steps = np.diff(time)
    # in place: each of these arrays is 80 MB of a long record
    off = np.arange(time.size, dtype=float)
    off *= interval
    off += time[0]
    np.abs(np.subtract(time, off, out=off), out=off)
    even = interval > 0.0 and bool(np.all(steps > 0.0)) and float(off.max()) <= UNEVEN * interval
    allowed = "must have evenly spaced times: a sample is lost, or resample it first (numpy.interp)"
    shown = f"{Path(path).name}, steps of {steps.min():.6g} to {steps.max():.6g} s"
    require(even, "path", shown, "", allowed)
    return interval
