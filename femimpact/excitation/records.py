"""Recorded motions of the base: the file of columns, and the motion as straight lines between samples."""

from __future__ import annotations

import codecs
import csv
import io
import itertools
import math
import re
import warnings
from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import methodcaller
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array, even_interval
from femimpact.errors import (
    Fault,
    InputError,
    InputWarning,
    check_fields,
    checked,
    choice,
    instance,
    optional,
    quantity,
    real_array,
    require,
    require_path,
)
from femimpact.errors import text as a_text
from femimpact.excitation.excitation import BrokenLine, times
from femimpact.excitation.sums import added
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
    """The text of a file, every end of a line a line feed, without a second copy of it in memory."""
    decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder("utf-8-sig")(), translate=True)
    text = ""
    for piece in _pieces(file):
        # a text that nothing else refers to grows where it is
        text += decoder.decode(piece)
    text += decoder.decode(b"", final=True)
    return text


def samples_of(
    text: str, scale: float | None, detrend: str, columns: Sequence[int | str], path: str | Path
) -> tuple[Array, float, str]:
    """Samples, interval and a note on units of what `record_text` read from a path; see `RecordedBase.from_csv`.

    `samples` (n,): the second column times the scale, without its mean or its line of least squares where that is
    asked.
    `interval` s: between samples, from the first and the last time.

    Raises `InputError` if an argument is out of range, or the text lacks a column, holds what is not a finite
    number or fewer than two samples, its times are not evenly spaced, or all its accelerations are zero.
    """
    checked("text", text, a_text())
    checked("path", path, instance(str, Path))
    scale = checked("scale", scale, optional(quantity("1")))
    require(scale != 0.0, "scale", scale, "1", "must not be 0")
    detrend = checked("detrend", detrend, choice("none", "mean", "line"))
    two = isinstance(columns, (tuple, list)) and len(columns) == 2 and all(map(is_column, columns))
    require(two, "columns", columns, "", "must be two numbers from 0 or names of the header, of time and acceleration")
    header = record_header(text, Path(path))
    places, first = tuple(header.place(column, Path(path)) for column in columns), header.first
    seconds, factor, note = _factors(header, places, scale, path)
    time, values = read_columns(text, places, first, Path(path))
    # a long one is as large as all the rest; it goes here where the caller keeps none
    del text
    require(time.size >= 2, "path", str(path), "", "must hold 2 or more rows of numbers")
    require(
        bool(values.any()), "columns", tuple(columns), "", "must be time and acceleration: the second holds zeros only"
    )
    interval = _interval(time, path) * seconds
    del time
    values *= factor
    return _without_trend(values, detrend), interval, note


def _factors(
    header: RecordHeader, places: tuple[int, ...], scale: float | None, path: str | Path
) -> tuple[float, float, str]:
    """What times and accelerations are multiplied by for s and m/s^2, and a note where the header's units say so."""
    count = header.name(places[0])
    allowed = f"must be a column of time: {count!r} counts samples"
    require(places[0] not in header.counted, "columns", places[0], "", allowed)
    factors, said = [1.0, 1.0 if scale is None else scale], []
    for i, (place, si) in enumerate(zip(places, ("s", "m/s^2"), strict=True)):
        unit, given = header.units.get(place, ""), scale is not None and i == 1
        (found, factor, note), known = in_si(header.name(place), unit, (si,)), unit_of(unit)
        named = header.has_row or (known is not None and known[0] != "1")
        words = f"column {place}: {unit!r} in the header"
        if given and known is not None and named and (found != si or abs(abs(factors[1]) / factor - 1.0) > SAME):
            _warn(path, f"{words}, taken as {scale:g} m/s^2 by scale")
        elif unit and found != si and named and not given:
            allowed = f"column {place} is in {unit} by its header: must be in a unit of {si}{'; or give scale' * i}"
            raise InputError([Fault("path", str(path), "", allowed)])
        elif unit and found != si and not given:
            _warn(path, f"{words} is no unit of {si}: taken as {si}{'; scale = 1 says so' * i}")
        elif found == si and factor != 1.0 and not given:
            factors[i] = factor
            said.append(note)
        elif note.endswith("?") and not given:
            _warn(path, f"{note} Taken as {si}{'; scale = 1 says so' * i}")
    return factors[0], factors[1], f"{Path(path).name}: {', '.join(said)}, by its header" if said else ""


def in_si(name: str, unit: str, among: Iterable[str] = tuple(UNITS)) -> tuple[str, float, str]:
    """The SI unit, of some, of a column, what its numbers are multiplied by, and a note on what was taken for what."""
    known = unit_of(unit, among)
    if known is not None:
        return *known, f"{name!r} is in {unit}" + f", taken as {known[1]:.6g} {known[0]}" * (known[1] != 1.0)
    last = re.split(r"[\s_.-]", name)[-1]
    meant = None if unit or last == "t" else unit_of(last, [one for one in among if one not in ("s", "1", "Hz")])
    words = f"the unit {unit!r} is not known" if unit else "no unit is there"
    return (
        unit,
        1.0,
        f"{name!r} is left as it is: {words}" + f"; is it in {last}?" * (meant is not None and meant[1] != 1.0),
    )


def unit_of(word: str, among: Iterable[str] = tuple(UNITS)) -> tuple[str, float] | None:
    """What `read_unit` finds; words for times are read in capitals too."""
    time = word.isalpha() and len(word) > 2 and "s" in among
    return (read_unit(word.lower(), ("s",)) if time else None) or read_unit(word, among)


def _warn(path: str | Path, words: str) -> None:
    warnings.warn(f"{Path(path).name}, {words}", InputWarning, stacklevel=6)


def _without_trend(samples: Array, detrend: str) -> Array:
    """A new array of the samples without their mean or their line of least squares."""
    if detrend != "none":
        samples -= samples.mean()
    if detrend == "line":
        # at right angles to a constant: the mean stays zero
        along = np.arange(samples.size, dtype=float)
        along -= along.mean()
        along *= (along @ samples) / (along @ along)
        samples -= along
    return samples


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

TIMES = re.compile(r"(t|time|zeit|temps|tiempo|tempo)(?![^\W_])(?:[\s_./-]*(\w*)|.*)", re.IGNORECASE)
"""Names of a column of time, and what may be its unit, as in "t_ms"."""

COUNTS = re.compile(r"(samples?|index|idx|no|nr|num|number|nummer|sequence|scan|count)\W*", re.IGNORECASE)
"""Names of a column that counts samples."""

TYPES = ("double", "float", "single", "real", "int", "integer", "number", "numeric", "string", "text")
"""Words of a row, in small letters, that names the types of the columns."""

SAME = 2e-3
"""Share by which a scale may differ from a unit that it stands for: 9.81 is one g."""

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
    before = list(itertools.takewhile(lambda line: line[0] < first or not row, first_lines(text)))
    require(bool(row), "path", str(path), "", f"must hold rows of numbers, in columns: it {_begin(before)}")
    head = [row, *(fields for _, fields in itertools.islice(lines, MODEL_LINES))]
    last, fields = before[-1] if before else (0, list[str]())
    cells = [fields[p] for p in places] if len(fields) > max(places) else []
    bad = [i for i, cell in enumerate(cells) if not _is_number(cell)]
    words = ""
    if 0 < len(bad) < len(cells) and (bad[0] > 0 or all(cells[i].lower() in EMPTY for i in bad)):
        words = f"line {last}, column {places[bad[0]]}: {_kind(cells, bad[0])} is no finite number"
    if _mark("".join(tail[-1:])) == ",":
        found = [cell for fields in head for cell in fields]
        if 2 <= len(fields) <= max(places) or (any(map(SPLIT.fullmatch, found)) and not any("." in c for c in found)):
            words = (
                f"line {first}: more numbers than names, or parts of numbers: is a comma a decimal one? put semicolons"
            )
    require(not words, "path", str(path), "", words)
    named, units, has_row = names_and_units([fields for _, fields in before], places)
    names = {p: _name_and_unit(cell)[0] for p, cell in named.items()}
    some = {p for p, name in names.items() if name and not _is_number(name)}
    some |= {p for fields in head for p, cell in enumerate(fields) if _is_number(cell)}
    left = tuple(names.get(p) or f"column {p}" for p in sorted(some - {*places}))
    return RecordHeader(first, places, named, names, units, has_row, left)


def _begin(lines: list[tuple[int, list[str]]]) -> str:
    """Words for the first line of a text, by the kinds of its cells."""
    if not lines:
        return "is empty"
    number, fields = lines[0]
    kinds = ", ".join(_kind(fields, place) for place in range(min(len(fields), SHOWN)))
    more = ", ..." if len(fields) > SHOWN else ""
    return f"begins at line {number} with {len(fields)} cell{'s' * (len(fields) != 1)}: {kinds}{more}"


def _is_row(fields: list[str], places: tuple[int, ...]) -> bool:
    """True if a line has a number in the first of some places, and numbers or nothing in the others."""
    whole = len(places) > 0 and len(fields) > max(places) and _is_number(fields[places[0]])
    return whole and all(_is_number(fields[p]) or fields[p].lower() in EMPTY for p in places)


def first_lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is not empty, those behind a # too as long as no other line came."""
    commented = True
    for number, lines in _blocks(text):
        for i, line in enumerate(lines, number):
            if line.strip() and (commented or line.lstrip()[0] != "#"):
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
    if (found := TIMES.fullmatch(cell)) and found[2] and unit_of(found[2], ("s",)):
        return found[1], found[2]
    if unit_of(cell) is not None:
        # a word for a unit of time is a name too
        return cell, cell if len(cell) > 3 and unit_of(cell, ("s",)) else ""
    pairs = ((cell[: mark.start()], cell[mark.end() :]) for mark in BEFORE_UNIT.finditer(cell, 1))
    return next(((name, unit) for name, unit in pairs if unit != "t" and unit_of(unit)), (cell, ""))


def line_of_row(text: str, header: RecordHeader, row: int) -> str:
    """Words for the line of a row, counted from 0."""
    rows = (i for i, _ in _rows(text) if i >= header.first)
    return f"line {next(itertools.islice(rows, row, None), 0)}"


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


def _interval(time: Array, path: str | Path) -> float:
    """Time (s) between samples, where it is one."""
    interval, bad = even_interval(time)
    steps = np.diff(time)
    allowed = "must have evenly spaced times: a sample is lost, or resample it first (numpy.interp)"
    shown = f"{Path(path).name}, steps of {steps.min():.6g} to {steps.max():.6g} s"
    require(bad < 0, "path", shown, "", allowed)
    return interval


LEAKAGE = 2
"""Lines on either side of one that a sine between them has 95 % of its energy in, all five together."""


@dataclass(frozen=True, eq=False)
class RecordedBase:
    """Base motion from samples of its acceleration, straight between them; at rest at t = 0.

    Velocity and displacement are the exact integrals of these straight lines, and nothing is filtered: an offset or a
    drift of the sensor is taken for motion. An offset a moves the base by a t^2/2, so that offset and drift are to be
    removed before; of relative motion, a constant one bends the beam by its static deflection. Between samples a sine
    is read too low, by (pi f interval)^2/3 at a frequency f. Beyond the last sample the base moves on uniformly.

    Parameters
    ----------
    samples : array_like (n,), m/s^2
        n >= 2, the first at t = 0.
    interval : float, s
        Between samples.
    initial_velocity : float, m/s
    note : str
        What a file's units were taken for.

    Raises
    ------
    InputError
        If samples are fewer than two or not finite, the interval is not above zero, or the base moves beyond numbers.
    """

    samples: Any
    interval: float = field(metadata=quantity("s", above=0.0))
    initial_velocity: float = field(default=0.0, metadata=quantity("m/s"))
    note: str = field(default="", metadata=a_text())

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        scale: float | None = None,
        detrend: str = "none",
        columns: Sequence[int | str] = (0, 1),
        high_pass: float | None = None,
    ) -> RecordedBase:
        """The motion that a text file of columns holds: time (s) and acceleration, evenly spaced.

        Parameters
        ----------
        path : str or Path
            Rows of numbers, in columns between commas, semicolons, tabulators or spaces. A header before the first row
            may have any number of lines; empty lines, and those that begin with #, are left out. The first row is at
            t = 0. A regular file of at most 10 million rows and 600 MB.
        scale : float, optional
            Times which the column is m/s^2: 9.80665 for a record in g. Without it units of the header count, in a row
            or beside the names, as `note` says; 1 where there are none. With it the unit of the acceleration is only
            compared, and a contradiction is warned of. A unit of the time is applied with it as well.
        detrend : {"none", "mean", "line"}
            What is removed: the mean of the acceleration (an offset), or its line of least squares (offset and drift).
            With either the base moves at t = 0 with the velocity that brings it back to its place at the last sample,
            which no motion relative to the base depends on. Not of a pulse: it changes the velocity of the base for
            good, its mean is no offset, and without it the peak is wrong. A run on such a record has a warning;
            `excitation.remarks.is_pulse` says how pulses are told from drift.
        columns : two of int or str
            Time and acceleration, by their numbers from 0 or their names in the header.
        high_pass : float, Hz, optional
            What is slower is taken out after that, as of `from_velocity`, and the base comes back to its place.

        Returns
        -------
        RecordedBase

        Raises
        ------
        InputError
            If the file cannot be read or is too large, lacks a column, holds what is no finite number, its times are
            not evenly spaced, or its header has a unit that is none of acceleration and `scale` is not given.
        """
        return cls.from_text(record_text(path), scale, detrend, columns, path, high_pass)

    @classmethod
    def from_text(
        cls,
        text: str,
        scale: float | None = None,
        detrend: str = "none",
        columns: Sequence[int | str] = (0, 1),
        path: str | Path = "text",
        high_pass: float | None = None,
    ) -> RecordedBase:
        """The motion that the text of such a file holds, once it is read.

        Parameters
        ----------
        text : str
        scale, detrend, columns
            As of `from_csv`.
        path : str or Path
            What a fault calls the text.
        high_pass : float, Hz, optional
            As of `from_csv`.

        Returns
        -------
        RecordedBase

        Raises
        ------
        InputError
            As of `from_csv`.
        """
        samples, interval, note = samples_of(text, scale, detrend, columns, path)
        # a long one is as large as all the rest
        del text
        if high_pass is not None:
            samples = _high_passed(samples, interval, high_pass)
        base = cls(samples, interval, note=note)
        return base if detrend == "none" and high_pass is None else base.returning()

    @classmethod
    def from_velocity(cls, samples: ArrayLike, interval: float, high_pass: float | None = None) -> RecordedBase:
        """The motion whose velocity is recorded.

        Its acceleration is the slope of the cubic spline through the samples. An offset of the sensor moves the base
        steadily; without `high_pass` it stays in.

        Parameters
        ----------
        samples : array_like (n,), m/s
            n >= 4, the first at t = 0.
        interval : float, s
        high_pass : float, Hz, optional
            What is slower is taken out, by a Butterworth filter of order 4 forwards and backwards, which leaves no
            delay: half of the amplitude is left at this frequency.

        Returns
        -------
        RecordedBase

        Raises
        ------
        InputError
            If samples are fewer than four or not finite, or the interval or the frequency is out of range.
        """
        spline = _spline(samples, interval, high_pass, "m/s")
        return cls(spline(spline.x, 1), interval, initial_velocity=float(spline(0.0)))

    @classmethod
    def from_displacement(cls, samples: ArrayLike, interval: float, high_pass: float | None = None) -> RecordedBase:
        """The motion whose displacement is recorded, from its place at the first sample.

        The cubic spline through the samples has straight lines as its acceleration: the motion meets every sample, and
        nothing drifts. Noise of the samples is multiplied by some 1/interval^2.

        Parameters
        ----------
        samples : array_like (n,), m
            n >= 4, the first at t = 0.
        interval : float, s
        high_pass : float, Hz, optional
            As of `from_velocity`.

        Returns
        -------
        RecordedBase

        Raises
        ------
        InputError
            As of `from_velocity`.
        """
        spline = _spline(samples, interval, high_pass, "m")
        return cls(spline(spline.x, 2), interval, initial_velocity=float(spline(0.0, 1)))

    def returning(self) -> RecordedBase:
        """The same with the velocity at t = 0 that brings the base back to its place at the last sample.

        Motions relative to the base do not depend on it.
        """
        moved = float(self._knots[1][-1])
        return replace(self, initial_velocity=self.initial_velocity - moved / self.duration)

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be 2 or more finite numbers"
        samples = real_array("samples", self.samples, "m/s^2", allowed)
        several = samples.ndim == 1 and samples.size >= 2
        require(several, "samples", f"array of shape {samples.shape}", "m/s^2", allowed)
        samples.setflags(write=False)
        object.__setattr__(self, "samples", samples)
        with np.errstate(over="ignore", invalid="ignore"):
            bounded = bool(np.isfinite(self.amplitude))
        require(
            bounded, "samples", f"array of shape {samples.shape}", "m/s^2", "must move the base by a finite distance"
        )

    @cached_property
    def _knots(self) -> tuple[Array, Array]:
        """Velocity and displacement at the samples: exact integrals of the broken line."""
        a, h = self.samples, self.interval
        v = self.initial_velocity + np.concatenate([[0.0], np.cumsum(0.5 * h * (a[1:] + a[:-1]))])
        steps = h * v[:-1] + h * h * (2.0 * a[:-1] + a[1:]) / 6.0
        return v, np.concatenate([[0.0], np.cumsum(steps)])

    def _locate(self, time: ArrayLike) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """Sample before each time, time since then (s), acceleration there, and its slope."""
        t = times(time)
        # the end is that of `duration`, whose ratio to the interval may be rounded down to the sample before
        index = np.floor(np.clip(t, 0.0, self.duration) / self.interval).astype(int)
        index = np.where(t >= self.duration, self.samples.size - 1, np.clip(index, 0, self.samples.size - 1))
        padded = np.append(self.samples, self.samples[-1])
        beyond = index >= self.samples.size - 1
        slope = np.where(beyond, 0.0, (padded[index + 1] - padded[index]) / self.interval)
        return index, t - index * self.interval, np.where(beyond, 0.0, padded[index]), slope

    @property
    def duration(self) -> float:
        """Time (s) of the last sample."""
        return float((self.samples.size - 1) * self.interval)

    @cached_property
    def frequency(self) -> float:
        """Frequency (Hz) of the largest line of the spectrum, a multiple of 1/(n interval).

        That of the record without its line of least squares: an offset or a drift is no cycle. Where nothing is left
        beside that line, all of the record is one cycle.
        """
        _, lines = self.closed_form.spectrum
        return float(max(np.argmax(lines), 1) / (self.samples.size * self.interval))

    @cached_property
    def has_cycle(self) -> bool:
        """True if half of the energy of the samples is in the largest line of the spectrum and the two on either side.

        That of a recorded sine is; noise, a pulse and a chirp have no cycle after which anything could repeat. What is
        said of `frequency` holds here: without the line of least squares, and with 2 cycles or more in the record.
        """
        energy = self.closed_form.spectrum[1] ** 2
        largest = int(np.argmax(energy))
        near = energy[max(largest - LEAKAGE, 0) : largest + LEAKAGE + 1].sum()
        return largest >= 2 and bool(near >= 0.5 * energy.sum())

    @property
    def phase(self) -> float:
        """Not a number: a record has no phase, and no impact has one in it."""
        return math.nan

    @cached_property
    def amplitude(self) -> float:
        """Largest displacement, m."""
        return float(np.max(np.abs(self._knots[1])))

    def displacement(self, time: ArrayLike) -> Array:
        """Base displacement ub (m) at times in s."""
        index, s, a, slope = self._locate(time)
        v, u = self._knots
        return np.asarray(u[index] + s * v[index] + s * s * a / 2.0 + s**3 * slope / 6.0)

    def velocity(self, time: ArrayLike) -> Array:
        """Base velocity (m/s) at times in s."""
        index, s, a, slope = self._locate(time)
        return np.asarray(self._knots[0][index] + s * a + s * s * slope / 2.0)

    def acceleration(self, time: ArrayLike) -> Array:
        """Base acceleration (m/s^2) at times in s."""
        _, s, a, slope = self._locate(time)
        return np.asarray(a + s * slope)

    @cached_property
    def closed_form(self) -> BrokenLine:
        """Acceleration of the base, m/s^2."""
        return BrokenLine(self.samples, self.interval, self.initial_velocity)

    __add__ = added


def _spline(samples: ArrayLike, interval: float, high_pass: float | None, unit: str) -> Any:
    """Cubic spline through samples, without what is slower than a frequency (Hz)."""
    from scipy.interpolate import CubicSpline

    interval = checked("interval", interval, quantity("s", above=0.0))
    allowed = "must be 4 or more finite numbers"
    values = real_array("samples", samples, unit, allowed)
    several = values.ndim == 1 and values.size >= 4
    require(several, "samples", f"array of shape {values.shape}", unit, allowed)
    if high_pass is not None:
        values = _high_passed(values, interval, high_pass)
    return CubicSpline(interval * np.arange(values.size), values)


def _high_passed(values: Array, interval: float, high_pass: float) -> Array:
    """Samples without what is slower than a frequency (Hz), without delay."""
    from scipy.signal import butter, sosfiltfilt

    high_pass = checked("high_pass", high_pass, quantity("Hz", above=0.0, below=0.5 / interval))
    sections = butter(4, high_pass, "highpass", fs=1.0 / interval, output="sos")
    padding = min(values.size - 1, int(3.0 / (high_pass * interval)) + 1)
    return np.asarray(sosfiltfilt(sections, values, padlen=padding))
