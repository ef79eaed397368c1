"""Text files of columns: where the rows of numbers are, and the names and units before them."""

from __future__ import annotations

import codecs
import itertools
import math
import re
from array import array
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import methodcaller
from pathlib import Path

import numpy as np

from femimpact.arrays import Array, even_interval
from femimpact.errors import Fault, InputError, require, require_path
from femimpact.excitation.column_names import (
    MARKS,
    QUOTES,
    cells_in,
    is_number,
    mark_of,
    name_and_unit,
    names_and_units,
    number_in,
)
from femimpact.regular_file import decimal_number, open_regular
from femimpact.units import counted

MOST_LINES = 10_001_000
"""Most lines of the file of a record: 10 million rows behind a header."""

MOST_BYTES = 600_000_000
"""Most bytes of the file of a record: rows of two numbers to the last bit have 51."""

PIECE = 1 << 23
"""Bytes of a file, or letters of a text, that are gone through at once."""

SHOWN = 4
"""Cells of a line that is no row, of which a fault says what kind they are."""

OPEN = re.compile(r'(^|[;,\t])\s*"[^"]*$')
"""A cell in quotes that the line does not end, where those that it ends are left out."""

SERIES = re.compile(
    r"^.*?NPTS *= *(\d+)[ ,]+DT *= *([\d.]+(?:E[+-]?\d+)?).*$|^ *(\d+) +([\d.]+(?:E[+-]?\d+)?) +NPTS, *DT.*$",
    re.IGNORECASE | re.MULTILINE | re.ASCII,
)  # fmt: skip
"""The line of a PEER file (AT2) with the number of samples and the step, s, behind which the samples stand."""

QUANTITY = re.compile(r"^.*?(\w+) TIME SERIES IN UNITS OF +(\S+)", re.IGNORECASE | re.MULTILINE)
"""The line of a PEER file with the quantity and its unit."""

LONGEST = 1000
"""Letters of a header's line that may go on in the next one."""


def record_text(path: str | Path) -> str:
    """Content of the file of a record, every end of a line a line feed.

    Raises `InputError` if it cannot be read, is no regular file or no text, or, before it is read, has too many
    bytes or lines.
    """
    require_path(path, "path", "a text file")
    try:
        with open_regular(path, MOST_BYTES) as file:
            # lines of old Macintosh files end with a carriage return alone
            lines = sum(max(piece.count(b"\n"), piece.count(b"\r")) for piece in iter(lambda: file.read(PIECE), b""))
            if lines <= MOST_LINES:
                file.seek(0)
                return _decoded(file.read()).replace("\r\n", "\n").replace("\r", "\n")
            reason = f"has {lines:,} lines, of which at most {MOST_LINES:,} are read"
    except OSError as error:
        reason = error.strerror or "cannot be read"
    except UnicodeDecodeError:
        reason = "is no text"
    raise InputError([Fault("path", str(path), "", f"must be a text file of columns: {reason}")])


def _decoded(content: bytes) -> str:
    """The text of bytes in UTF-8, UTF-16 with its mark, or in the code of spreadsheets in Western Europe."""
    try:
        is_utf16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return content.decode("utf-16" if is_utf16 else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252")
        if "\0" in text:
            raise
        return text


def _in_columns(text: str, path: Path) -> str:
    """A text of columns: the samples of a PEER file, some in a row, with their times beside them; others as they are.

    Raises `InputError` if there are not as many samples as the file says.
    """
    head = text[:MODEL_LETTERS]
    if not (series := SERIES.search(head)):
        return text
    count, step = int(series[1] or series[3]), float(series[2] or series[4])
    allowed = f"has NPTS = {count} and DT = {step:g} s: must be samples"
    require(count >= 2 and step > 0.0, "path", str(path), "", allowed)
    samples = text[series.end() :].split()
    if len(samples) > count and len(samples) % count == 0:
        # columns below such a line
        return text
    allowed = f"has {len(samples)} samples, and {count} by its NPTS: is the file cut off?"
    require(len(samples) == count, "path", str(path), "", allowed)
    bad = next((i for i, sample in enumerate(samples) if decimal_number(sample) is None), -1)
    require(bad < 0, "path", str(path), "", f"sample {bad + 1} is no finite number")
    name, unit = quantity.groups() if (quantity := QUANTITY.search(head, 0, series.start())) else ("value", "")
    rows = "\n".join(f"{i * step!r},{sample}" for i, sample in enumerate(samples))
    return f"time [s],{name.lower()} [{unit}]\n{rows}\n"


def is_column(value: object) -> bool:
    """True for a number from 0 or a name."""
    return isinstance(value, str) or (isinstance(value, int) and not isinstance(value, bool) and value >= 0)


COUNTS = re.compile(r"(samples?|index|idx|no|nr|num|number|nummer|sequence|scan|count)\W*", re.IGNORECASE)
"""Names of a column that counts samples."""

SPLIT = re.compile(r"-0|0\d+|\d{2,}[eE][+-]?\d+", re.ASCII)
"""Parts of numbers that decimal commas among commas leave, and no whole number is."""

EMPTY = ("", "-", "nan", "inf", "-inf", "null", "none", "n/a", "#n/a")
"""Cells, in small letters, that stand where a number is missing."""

MODEL_LINES, MODEL_LETTERS = 200, 1 << 16
"""Lines, of the last letters of a text, that show where its columns of numbers are."""


@dataclass(frozen=True)
class TextTable:
    """A text of columns of numbers, with what stands before their rows."""

    text: str
    path: Path  # by which a fault names the text
    first: int  # number of the line from which on there are rows
    places: tuple[int, ...]  # of the columns of numbers
    cells: dict[int, str]  # of the line of names, by place
    names: dict[int, str]  # those without a unit, by place
    units: dict[int, str]  # by place, as they are written
    has_row: bool  # of units
    left: tuple[str, ...]  # names of other columns, with numbers in some rows or in none

    @property
    def counted(self) -> list[int]:
        """Places of columns that count samples, by their names."""
        return [p for p in self.places if COUNTS.fullmatch(self.name(p)) and not self.units.get(p)]

    def name(self, place: int) -> str:
        """Name of a column, made from its number where it has none."""
        return self.names.get(place) or f"column {place}"

    @cached_property
    def _by_name(self) -> dict[str, int]:
        return {name: p for names in (self.names, self.cells) for p, name in reversed(names.items())}

    def place(self, column: int | str) -> int:
        """Place of a column by its number or its name, with or without a unit."""
        number = self._by_name.get(column, -1) if isinstance(column, str) else column
        if number not in self.places:
            choices = f"{self.path.name}, which are from line {self.first} on: {[self.name(p) for p in self.places]}"
            raise InputError([Fault("columns", column, "", f"must be one of the columns of numbers of {choices}")])
        return number

    def read(self, places: Sequence[int]) -> tuple[Array, ...]:
        """Columns of numbers at some places; lines that are empty or begin with # are left out."""
        # arrays that grow where they are
        columns, width = tuple(array("d") for _ in places), 0
        for number, lines in _blocks(self.text):
            rows = lines[max(self.first - number, 0) :]
            width = width or next((len(fields) for _, fields in cells_of(rows, number)), 0)
            values = _plain_values(rows, places, width)
            if values is None:
                values = _values(cells_of(rows, max(self.first, number)), places, width, self.path)
            for column, part in zip(columns, values.T, strict=True):
                column.frombytes(part.tobytes())
        return tuple(map(np.frombuffer, columns))

    @property
    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        return ((i, fields) for i, fields in _rows(self.text) if i >= self.first)

    def interval(self, time: Array) -> float:
        """Time (s) between the rows, evenly spaced by a column that is read."""
        return interval_of(
            time, self.path, lambda row: f"line {next(itertools.islice(self._rows, row, None), (0,))[0]}"
        )

    @property
    def has_decimal_commas(self) -> bool:
        """True where a line of commas has digits alone in every second cell, as decimal commas leave them."""
        lines = (fields for _, fields in itertools.islice(self._rows, MODEL_LINES))
        are_digits = all(len(fields) % 2 == 0 and all(cell.isdigit() for cell in fields[1::2]) for fields in lines)
        return mark_of(self.text[:MODEL_LETTERS]) == "," and are_digits


def text_table(text: str, path: str | Path) -> TextTable:
    """Columns of numbers of a text, their names and units, and where the rows begin.

    A fault does not show what stands in a file without rows, which may be no record at all but something secret.
    """
    path = Path(path)
    text = _in_columns(text, path)
    tail = text[-MODEL_LETTERS:].splitlines()[-MODEL_LINES:]
    rows = [fields for _, fields in cells_of(tail[1:] if len(text) > MODEL_LETTERS else tail, 1)]
    width = max(map(len, rows), default=0)
    counts = [sum(p < len(f) and is_number(f[p]) for f in rows) for p in range(width)]
    places = tuple(p for p in range(width) if counts[p] > 0 and 2 * counts[p] >= max(counts))
    lines = _rows(text)
    first, row = next(((i, f) for i, f in lines if _is_row(f, places)), (0, []))
    require(bool(row), "path", str(path), "", "must hold rows of numbers, in columns" + _begin(text) * (not row))
    # the last of many, as those of a file of remarks
    before = deque(itertools.takewhile(lambda line: line[0] < first, first_lines(text)), MODEL_LINES)
    head = [row, *(fields for _, fields in itertools.islice(lines, MODEL_LINES))]
    last, fields = (before[-1][0], cells_in(before[-1][1])) if before else (0, list[str]())
    cells = [fields[p] for p in places] if len(fields) > max(places) else []
    bad = [i for i, cell in enumerate(cells) if not is_number(cell)]
    words = ""
    if 0 < len(bad) < len(cells) and (bad[0] > 0 or all(cells[i].lower() in EMPTY for i in bad)):
        words = f"line {last}, column {places[bad[0]]}: {_kind(cells, bad[0])} is no finite number"
    if mark_of("".join(tail[-1:])) == ",":
        head_cells = [cell for row in head for cell in row]
        parts = any(map(SPLIT.fullmatch, head_cells)) and not any("." in cell for cell in head_cells)
        if parts or 2 <= len(fields) <= max(places):
            words = f"line {first}: more numbers than names, or parts of numbers: is a comma a decimal one? "
            words += "put semicolons between"
    require(not words, "path", str(path), "", words)
    # an oscilloscope writes its settings beside the rows
    beside = [fields[: places[0]] for fields in head if any(fields[: places[0]])]
    named, units, has_row = names_and_units([line for _, line in before], places, len(row), beside)
    names = {p: name_and_unit(cell)[0] for p, cell in named.items()}
    some = {p for p, name in names.items() if name and not is_number(name)}
    some |= {p for row in head for p, cell in enumerate(row) if is_number(cell)}
    left = tuple(names.get(p) or f"column {p}" for p in sorted(some - {*places}))
    return TextTable(text, path, first, places, named, names, units, has_row, left)


def _begin(text: str) -> str:
    """Words for the first line of a text, by the kinds of its cells."""
    number, line = next(first_lines(text), (0, ""))
    fields = cells_in(line)
    kinds = ", ".join(_kind(fields, place) for place in range(min(len(fields), SHOWN)))
    more = ", ..." if len(fields) > SHOWN else ""
    begin = f"begins at line {number} with {counted(len(fields), 'cell')}: {kinds}{more}"
    return f": it {begin if number else 'is empty'}"


def _is_row(fields: list[str], places: tuple[int, ...]) -> bool:
    """True if a line has a number in the first of some places, and numbers or nothing in the others."""
    has_first = len(places) > 0 and len(fields) > max(places) and is_number(fields[places[0]])
    return has_first and all(is_number(fields[p]) or fields[p].lower() in EMPTY for p in places)


def first_lines(text: str) -> Iterator[tuple[int, str]]:
    """Number and text of every line that is not empty, those behind a # too as long as no other line came.

    A cell in quotes may go on in the next lines; the number is that of the last one.
    """
    commented, begun = True, ""
    for number, lines in _blocks(text):
        for i, line in enumerate(lines, number):
            line = f"{begun} {line}" if begun else line
            begun = line if len(line) < LONGEST and OPEN.search(QUOTES.sub("", line)) else ""
            if not begun and line.strip() and (commented or line.lstrip()[0] != "#"):
                commented = commented and line.lstrip()[0] == "#"
                yield i, line.lstrip("# \t") if line.lstrip()[0] == "#" else line


def interval_of(time: Array, path: Path, line: Callable[[int], str]) -> float:
    """Time (s) between evenly spaced samples; `line` has the words for the line of a row."""
    require(time.size >= 2, "path", str(path), "", "must hold 2 or more rows of numbers")
    interval, bad = even_interval(time)
    if bad < 0:
        return interval
    step, usual = float(time[bad] - time[max(bad - 1, 0)]), float(np.median(np.diff(time)))
    kind = "does not rise" if step <= 0.0 else "leaves a gap" if step > 1.5 * usual else "is uneven"
    steps = f"a step of {step:.6g} s, and {usual:.6g} s is usual"
    allowed = f"{line(bad)}: the time {kind}: {steps}; resample it first (numpy.interp)"
    raise InputError([Fault("path", str(path), "", allowed)])


def _blocks(text: str) -> Iterator[tuple[int, list[str]]]:
    """Lines of a text, some at once, with the number of the first of them."""
    begin, number = 0, 1
    while begin < len(text):
        end = text.find("\n", begin + PIECE) + 1 or len(text)
        lines = text[begin:end].splitlines()
        yield number, lines
        begin, number = end, number + len(lines)


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    return itertools.chain.from_iterable(cells_of(lines, number) for number, lines in _blocks(text))


def cells_of(lines: Iterable[str], number: int) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is neither empty nor begins with #."""
    return ((i, cells_in(line)) for i, line in enumerate(lines, number) if line.strip() and line.lstrip()[0] != "#")


def _plain_values(lines: Sequence[str], places: Sequence[int], width: int) -> Array | None:
    """The values that `_values` finds in lines that are all written in the same plain way; None where they are not."""
    block = "\n".join(lines)
    # few files have lines to leave out, and what is asked of each line takes as long as its numbers
    if "#" in block or not all(lines) or any(map(str.isspace, lines)):
        lines = [line for line in lines if (begin := line.lstrip()) and begin[0] != "#"]
        block = "\n".join(lines)
    if not lines:
        return np.zeros((0, len(places)))
    mark = mark_of(lines[0])
    # a line without the mark has no second cell
    others = MARKS.partition(mark)[0] if mark else MARKS
    if any(sign in block for sign in others) or max(places) == 0:
        return None
    if mark == "," and set(map(methodcaller("count", ","), lines)) != {width - 1}:
        return None
    if mark in (";", "\t") and "," in block:
        lines = block.replace(",", ".").split("\n")
    try:
        values = np.loadtxt(lines, delimiter=mark, comments=None, quotechar='"', usecols=places, ndmin=2)
    except ValueError:
        return None
    return values if len(values) == len(lines) and np.isfinite(values).all() else None


def _values(cells: Iterable[tuple[int, list[str]]], places: Sequence[int], width: int, path: Path) -> Array:
    """The two numbers of every line (rows, 2), or the first line without; `width` counts cells of the first row."""
    rows = []
    for i, fields in cells:
        # the rest of a number with a decimal comma, in a file of commas; words may stand there
        more = next((cell for cell in fields[width:] if decimal_number(cell) is not None), None)
        allowed = f"line {i}: a number, {more!r}, behind the {width} cells of the first row: is a comma a decimal one?"
        require(more is None, "path", str(path), "", allowed)
        row = []
        for place in places:
            value = number_in(fields[place]) if place < len(fields) else math.nan
            allowed = f"line {i}, column {place}: {_kind(fields, place)} is no finite number"
            require(math.isfinite(value), "path", str(path), "", allowed)
            row.append(value)
        rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, len(places))


def _kind(fields: Sequence[str], place: int) -> str:
    """Kind of the cell at a place of a line: "nothing", "a text" or "a number"."""
    if place >= len(fields) or not fields[place]:
        return "nothing"
    return "a text" if decimal_number(fields[place].replace(",", ".")) is None else "a number"
