"""Text files of columns: where the rows of numbers are, and the names and units before them."""

from __future__ import annotations

import codecs
import csv
import io
import itertools
import math
import re
from array import array
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from operator import methodcaller
from pathlib import Path
from typing import BinaryIO

import numpy as np

from femimpact.arrays import Array, even_interval
from femimpact.errors import Fault, InputError, require, require_path
from femimpact.regular_file import decimal_number, open_regular, read_now
from femimpact.units import UNITS, read_unit

MOST_LINES = 10_001_000
"""Most lines of the file of a record: 10 million rows, behind a header, are read within 1 GB of memory."""

MOST_BYTES = 600_000_000
"""Most bytes of the file of a record: rows of two numbers to the last bit have 51."""

PIECE = 1 << 23
"""Bytes of a file, or letters of a text, that are gone through at once."""

SHOWN = 4
"""Cells of a line that is no row, of which a fault says what kind they are."""

QUOTES = re.compile(r'"[^"]*"')
"""Cells in quotes, or what is between two of them."""

OPEN = re.compile(r'(^|[;,\t])\s*"[^"]*$')
"""A cell in quotes that the line does not end, where those that it ends are left out."""

LONGEST = 1000
"""Letters of a header's line that may go on in the next one."""

MARKS = ";\t,"
"""Separators between cells: the first of these that a line has, or spaces."""


def record_text(path: str | Path) -> str:
    """Content of the file of a record.

    Raises `InputError` if it cannot be read, is no regular file or no text, or, before it is read, has too many
    bytes or lines.
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
    """The text of a file in UTF-8, or in the code of spreadsheets in Western Europe."""
    try:
        return _text_in(file, "utf-8-sig")
    except UnicodeDecodeError:
        file.seek(0)
        text = _text_in(file, "cp1252")
        if "\0" in text:
            raise
        return text


def _text_in(file: BinaryIO, encoding: str) -> str:
    """The text of a file, every end of a line a line feed, without a second copy of it in memory."""
    decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(encoding)(), translate=True)
    text = ""
    for piece in _pieces(file):
        # a text that nothing else refers to grows where it is
        text += decoder.decode(piece)
    text += decoder.decode(b"", final=True)
    return text


def in_si(name: str, unit: str, among: Iterable[str] = tuple(UNITS)) -> tuple[str, float, str]:
    """The SI unit, of some, of a column, what its numbers are multiplied by, and a note on what was taken for what."""
    known = unit_of(unit, among)
    if known is not None:
        return *known, f"{name!r} is in {unit}" + f", taken as {known[1]:.6g} {known[0]}" * (known[1] != 1.0)
    last = re.split(r"[\s_.-]", name)[-1]
    meant = None if unit or last == "t" else unit_of(last, [one for one in among if one not in ("s", "1", "Hz")])
    words = f"the unit {unit!r} is not known" if unit else "no unit is there"
    words += f"; is it in {last}?" if meant is not None and meant[1] != 1.0 else ""
    return unit, 1.0, f"{name!r} is left as it is: {words}"


def unit_of(word: str, among: Iterable[str] = tuple(UNITS)) -> tuple[str, float] | None:
    """What `read_unit` finds; words for times are read in capitals too."""
    time = word.isalpha() and len(word) > 2 and "s" in among
    return (read_unit(word.lower(), ("s",)) if time else None) or read_unit(word, among)


def is_column(value: object) -> bool:
    """True for a number from 0 or a name."""
    return isinstance(value, str) or (isinstance(value, int) and not isinstance(value, bool) and value >= 0)


def read_columns(text: str, places: tuple[int, ...], first: int, path: Path) -> tuple[Array, ...]:
    """Columns of numbers at some places, from a line on; lines that are empty or begin with # are left out."""
    # arrays that grow where they are
    found, width = tuple(array("d") for _ in places), 0
    for number, lines in _blocks(text):
        rows = lines[max(first - number, 0) :]
        width = width or next((len(fields) for _, fields in cells_of(rows, number)), 0)
        values = _plain_values(rows, places, width)
        if values is None:
            values = _values(cells_of(rows, max(first, number)), places, width, path)
        for column, part in zip(found, values.T, strict=True):
            column.frombytes(part.tobytes())
    return tuple(map(np.frombuffer, found))


BRACKETED = re.compile(r"(.*?)[\s/]*[\[(]([^\[\]()]*(?:\([^()]*\)[^()]*)?)[\])]")
"""A name and, in brackets, a unit."""

BEFORE_UNIT = re.compile(r"\s+in\s+|\s*/\s*")
"""What stands between a name and a unit, as in "acceleration in g" and "a/g"."""

TIMES = re.compile(r"(t|T(?!_)|(?i:time|zeit|temps|tiempo|tempo))(?![^\W_])(?:[\s_./-]*(\w*)|.*)")
"""Names of a column of time, and what may be its unit, as in "t_ms"; T_min is a temperature."""

COUNTS = re.compile(r"(samples?|index|idx|no|nr|num|number|nummer|sequence|scan|count)\W*", re.IGNORECASE)
"""Names of a column that counts samples."""

TYPES = ("double", "float", "single", "real", "int", "integer", "number", "numeric", "string", "text")
"""Words of a row, in small letters, that names the types of the columns."""

SPLIT = re.compile(r"-0|0\d+|\d{2,}[eE][+-]?\d+", re.ASCII)
"""Parts of numbers that decimal commas among commas leave, and no whole number is."""

EMPTY = ("", "-", "nan", "inf", "-inf", "null", "none", "n/a", "#n/a")
"""Cells, in small letters, that stand where a number is missing."""

MODEL_LINES, MODEL_LETTERS = 200, 1 << 16
"""Lines, of the last letters of a text, that show where its columns of numbers are."""


@dataclass(frozen=True)
class RecordHeader:
    """What stands before the rows of a file of columns."""

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

    def place(self, column: int | str, path: Path) -> int:
        """Place of a column by its number or its name, with or without a unit."""
        named = {name: p for names in (self.names, self.cells) for p, name in reversed(names.items())}
        found = named.get(column, -1) if isinstance(column, str) else column
        shown = f"{path.name}, which are from line {self.first} on: {[self.name(p) for p in self.places]}"
        require(found in self.places, "columns", column, "", f"must be one of the columns of numbers of {shown}")
        return found


def record_header(text: str, path: Path) -> RecordHeader:
    """Columns of numbers of a text, their names and units, and where the rows begin.

    A fault does not show what stands in a file without rows, which may be no record at all but something secret.
    """
    tail = text[-MODEL_LETTERS:].splitlines()[-MODEL_LINES:]
    rows = [fields for _, fields in cells_of(tail[1:] if len(text) > MODEL_LETTERS else tail, 1)]
    width = max(map(len, rows), default=0)
    counts = [sum(p < len(f) and _is_number(f[p]) for f in rows) for p in range(width)]
    places = tuple(p for p in range(width) if counts[p] > 0 and 2 * counts[p] >= max(counts))
    lines = _rows(text)
    first, row = next(((i, f) for i, f in lines if _is_row(f, places)), (0, []))
    require(bool(row), "path", str(path), "", "must hold rows of numbers, in columns" + _begin(text) * (not row))
    # the last of many, as those of a file of remarks
    before = deque(itertools.takewhile(lambda line: line[0] < first, first_lines(text)), MODEL_LINES)
    head = [row, *(fields for _, fields in itertools.islice(lines, MODEL_LINES))]
    last, fields = before[-1] if before else (0, list[str]())
    cells = [fields[p] for p in places] if len(fields) > max(places) else []
    bad = [i for i, cell in enumerate(cells) if not _is_number(cell)]
    words = ""
    if 0 < len(bad) < len(cells) and (bad[0] > 0 or all(cells[i].lower() in EMPTY for i in bad)):
        words = f"line {last}, column {places[bad[0]]}: {_kind(cells, bad[0])} is no finite number"
    if _mark("".join(tail[-1:])) == ",":
        found = [cell for row in head for cell in row]
        parts = any(map(SPLIT.fullmatch, found)) and not any("." in cell for cell in found)
        if parts or 2 <= len(fields) <= max(places):
            words = f"line {first}: more numbers than names, or parts of numbers: is a comma a decimal one? "
            words += "put semicolons between"
    require(not words, "path", str(path), "", words)
    named, units, has_row = names_and_units([fields for _, fields in before], places)
    names = {p: _name_and_unit(cell)[0] for p, cell in named.items()}
    some = {p for p, name in names.items() if name and not _is_number(name)}
    some |= {p for row in head for p, cell in enumerate(row) if _is_number(cell)}
    left = tuple(names.get(p) or f"column {p}" for p in sorted(some - {*places}))
    return RecordHeader(first, places, named, names, units, has_row, left)


def _begin(text: str) -> str:
    """Words for the first line of a text, by the kinds of its cells."""
    number, fields = next(first_lines(text), (0, []))
    kinds = ", ".join(_kind(fields, place) for place in range(min(len(fields), SHOWN)))
    more = ", ..." if len(fields) > SHOWN else ""
    begin = f"begins at line {number} with {len(fields)} cell{'s' * (len(fields) != 1)}: {kinds}{more}"
    return f": it {begin if number else 'is empty'}"


def _is_row(fields: list[str], places: tuple[int, ...]) -> bool:
    """True if a line has a number in the first of some places, and numbers or nothing in the others."""
    whole = len(places) > 0 and len(fields) > max(places) and _is_number(fields[places[0]])
    return whole and all(_is_number(fields[p]) or fields[p].lower() in EMPTY for p in places)


def first_lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is not empty, those behind a # too as long as no other line came.

    A cell in quotes may go on in the next lines; the number is that of the last one.
    """
    commented, begun = True, ""
    for number, lines in _blocks(text):
        for i, line in enumerate(lines, number):
            line = f"{begun} {line}" if begun else line
            begun = line if len(line) < LONGEST and OPEN.search(QUOTES.sub("", line)) else ""
            if not begun and line.strip() and (commented or line.lstrip()[0] != "#"):
                commented = commented and line.lstrip()[0] == "#"
                yield i, _fields(line.lstrip("# \t") if line.lstrip()[0] == "#" else line)


def names_and_units(before: list[list[str]], places: tuple[int, ...]) -> tuple[dict[int, str], dict[int, str], bool]:
    """Names as written and units by place of the lines before the rows, and whether the last one is a row of units."""
    fitting = [f for f in before if len(f) > max(places) and not _is_of_types([f[p] for p in places])]
    row, units, has_row = fitting[-1] if fitting else [], dict[int, str](), False
    if fitting and _are_units([row[p] for p in places], [f[places[0]] for f in fitting[:-1]]):
        units = {p: unit for p in places if (unit := row[p].strip("[]() ")) not in ("", "-")}
        row, has_row = fitting[-2] if len(fitting) > 1 else [], True
    for p in places if row else ():
        unit = _name_and_unit(row[p])[1]
        if unit not in ("", "-"):
            units.setdefault(p, unit)
    return dict(enumerate(row)), units, has_row


def _is_of_types(cells: list[str]) -> bool:
    """True for words of the types of columns, and for lines that are drawn."""
    return all(cell.lower() in TYPES for cell in cells) or not any(cell.strip("-=_ ") for cell in cells)


def _are_units(cells: list[str], above: list[str]) -> bool:
    """True if cells are units and no names; above them are others of the first column."""
    words = [cell.strip("[]() ") for cell in cells]
    # t is a time, and no column in tonnes
    known = [word != "t" and unit_of(word) is not None for word in words if word not in ("", "-")]
    # names may read as units alone; with a row above, or a time among them, they are
    times = [word not in ("h", "min") and unit_of(word, ("s",)) is not None for word in words]
    if not known or TIMES.fullmatch(words[0]):
        return False
    if all(known) and (len(above) > 0 or any(times) or all(cell[:1] in "[(" for cell in cells)):
        return True
    # "Second" may be a name; with names above, a time in a unit that is not known is none
    named = len(above) > 0 and not _is_number(above[-1]) and above[-1] not in ("", "-")
    if times[0]:
        return len(above) > 0 or len(words[0]) < len("second")
    return named and (any(known) or TIMES.fullmatch(above[-1]) is not None)


def _name_and_unit(cell: str) -> tuple[str, str]:
    """Name of a column and its unit, "" where the cell has none."""
    if found := BRACKETED.fullmatch(cell):
        # "a(t)" is no column in tonnes
        return (cell, "") if found[2] == "t" else (found[1] or cell, found[2].strip())
    if (found := TIMES.fullmatch(cell)) and unit_of(found[2] or "", ("s",)):
        return found[1], found[2]
    if unit_of(cell) is not None:
        # a word for a unit of time is a name too
        return cell, cell if len(cell) > 3 and unit_of(cell, ("s",)) else ""
    pairs = ((cell[: mark.start()], cell[mark.end() :]) for mark in BEFORE_UNIT.finditer(cell, 1))
    # V/s is a rate, and no voltage in seconds
    rate = unit_of(cell.rpartition("/")[2].strip(), ("s",)) is not None
    return next(((name, unit) for name, unit in pairs if not rate and unit != "t" and unit_of(unit)), (cell, ""))


def line_of_row(text: str, header: RecordHeader, row: int) -> str:
    """Words for the line of a row, counted from 0."""
    rows = (i for i, _ in _rows(text) if i >= header.first)
    return f"line {next(itertools.islice(rows, row, None), 0)}"


def interval_of(time: Array, path: str | Path, line: Callable[[int], str]) -> float:
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


def has_decimal_commas(text: str, header: RecordHeader) -> bool:
    """True where a line of commas has digits alone in every second cell, as decimal commas leave them."""
    lines = itertools.islice((fields for i, fields in _rows(text) if i >= header.first), MODEL_LINES)
    whole = all(len(fields) % 2 == 0 and all(cell.isdigit() for cell in fields[1::2]) for fields in lines)
    return _mark(text[:MODEL_LETTERS]) == "," and whole


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
    return ((i, _fields(line)) for i, line in enumerate(lines, number) if line.strip() and line.lstrip()[0] != "#")


def _plain_values(lines: Sequence[str], places: tuple[int, ...], width: int) -> Array | None:
    """The values that `_values` finds in lines that are all written in the same plain way; None where they are not."""
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


def _kind(fields: Sequence[str], place: int) -> str:
    """Kind of the cell at a place of a line: "nothing", "a text" or "a number"."""
    if place >= len(fields) or not fields[place]:
        return "nothing"
    return "a text" if decimal_number(fields[place].replace(",", ".")) is None else "a number"


def _mark(line: str) -> str | None:
    """The separator of the cells of a line; None is spaces."""
    return next((mark for mark in MARKS if mark in line), None)


def _fields(line: str) -> list[str]:
    """Cells of a line: between semicolons, tabulators or commas, the first of them that it has, or spaces.

    What is in quotes is one cell. Between semicolons or tabulators a decimal comma is a point.
    """
    if '"' in line.strip(' "'):
        # a cell beyond what the library takes is no number
        with suppress(csv.Error):
            mark = _mark(QUOTES.sub("", line)) or " "
            cells = next(csv.reader([line.strip(" ")], delimiter=mark, skipinitialspace=True))
            return [cell.strip().strip('"') for cell in cells]
    return [cell.strip().strip('"') for cell in line.split(_mark(line))]


def _number(cell: str) -> float:
    """The number that a cell holds, not a number where it holds none."""
    value = decimal_number(cell.replace(",", "."))
    return math.nan if value is None else value


def _is_number(cell: str) -> bool:
    return not math.isnan(_number(cell))
