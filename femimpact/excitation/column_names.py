"""Cells of the lines of a text of columns; names and units of the columns, in the lines before their rows."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress

from femimpact.regular_file import decimal_number
from femimpact.units import UNITS, read_unit

QUOTES = re.compile(r'"[^"]*"')
"""Cells in quotes, or what is between two of them."""

MARKS = ";\t,"
"""Separators between cells: the first of these that a line has, or spaces."""


def mark_of(line: str) -> str | None:
    """The separator of the cells of a line; None is spaces."""
    return next((mark for mark in MARKS if mark in line), None)


def cells_in(line: str) -> list[str]:
    """Cells of a line: between semicolons, tabulators or commas, the first of them that it has, or spaces.

    What is in quotes is one cell. Between semicolons or tabulators a decimal comma is a point.
    """
    if '"' in line.strip(' "'):
        # a cell beyond what the library takes is no number
        with suppress(csv.Error):
            mark = mark_of(QUOTES.sub("", line)) or " "
            cells = next(csv.reader([line.strip(" ")], delimiter=mark, skipinitialspace=True))
            return [cell.strip().strip('"') for cell in cells]
    return [cell.strip().strip('"') for cell in line.split(mark_of(line))]


def number_in(cell: str) -> float:
    """The number that a cell holds, not a number where it holds none."""
    value = decimal_number(cell.replace(",", "."))
    return math.nan if value is None else value


def is_number(cell: str) -> bool:
    """True if a cell holds a number."""
    return not math.isnan(number_in(cell))


BRACKETED = re.compile(r"(.*?)[\s/]*[\[({<]([^\[\](){}<>]*(?:\([^()]*\)[^()]*)?)[\])}>]")
"""A name and, in brackets, a unit."""

BRACKETS = re.compile(r"\s*[\[({<]([^\[\](){}<>]+)[\])}>]")
"""What is in brackets, as in "acc (g) left"."""

BEFORE_UNIT = re.compile(r"\s+(?:in|en)\s+|\s*/\s*")
"""What stands between a name and a unit, as in "acceleration in g" and "a/g"."""

AFTER_NAME = re.compile(r"[\s_.,:|-]+")
"""What stands between a name and what may be a unit, as in "acc_g" and "acc, g"."""

NO_SUFFIX = ("s", "1", "Hz")
"""SI units whose names are no unit behind a name: "acc_h", "T_min"."""

TIMES = re.compile(r"(t|T(?!_)|(?i:time|zeit|temps|tiempo|tempo|x_value))(?![^\W_])(?:[\s_.,:|/-]*(\w*)|.*)")
"""Names of a column of time, and what may be its unit, as in "t_ms"; T_min is a temperature."""

HAS_TIME = re.compile(r"time|zeit|temps|tiempo|tempo", re.IGNORECASE)
"""Words of the name of a time, as in "Messzeit"."""

GS = re.compile(r"g[\s_-]?forces?(?![^\W_])|(gF[xyz]|TgF)$", re.IGNORECASE)
"""Names that say that a column is in g."""

UNIT_LINE = re.compile(
    r"(?:(x|h|horizontal|abscissa|time|zeit|temps)|"
    r"(y|v|vertical|ordinate|values?|signals?|channels?|data|amplitude|engineering))?[\s_.-]*(?:ax[ei]s|achse)?[\s_.-]*"
    r"(?:units?|einheit(?:en)?|unit[ée]s?|unidad(?:es)?)(?:[\s_.-]*(?:labels?|strings?|names?))?(?:[\s_.-]+(?:(x)|y))?"
    r"\s*(?:[:=]\s*(.*))?", re.IGNORECASE,
)  # fmt: skip
"""The first cell of a line of units, as in "Vertical Units,g", "Y_Unit_Label g" and "Unit: g"."""

TYPES = ("double", "float", "single", "real", "int", "integer", "number", "numeric", "string", "text")
"""Words of a row, in small letters, that names the types of the columns."""

MOST_PARTS = 8
"""Most cells of the name of a column."""

AROUND = "[](){}<> "
"""Letters around a unit in a row of units."""


def in_si(name: str, unit: str, among: Iterable[str] = tuple(UNITS)) -> tuple[str, float, str]:
    """The SI unit, of some, of a column, what its numbers are multiplied by, and a note on what was taken for what."""
    known = unit_of(unit, among)
    if known is not None:
        return *known, f"{name!r} is in {unit}" + f", taken as {known[1]:.6g} {known[0]}" * (known[1] != 1.0)
    last = AFTER_NAME.split(name)[-1]
    meant = None if unit or last == "t" else unit_of(last, [u for u in among if u not in NO_SUFFIX])
    words = f"the unit {unit!r} is not known" if unit else "no unit is there"
    words += f"; is it in {last}?" if meant is not None and meant[1] != 1.0 else ""
    return unit, 1.0, f"{name!r} is left as it is: {words}"


def unit_of(word: str, among: Iterable[str] = tuple(UNITS)) -> tuple[str, float] | None:
    """What `read_unit` finds, in capitals alone too; words for times are read in any."""
    time = word.isalpha() and len(word) > 2 and "s" in among
    unit = (read_unit(word.lower(), ("s",)) if time else None) or read_unit(word, among)
    # one capital is a name: T, M, F
    capitals = word.isupper() and (len(word) > 1 or word == "S")
    return unit or (read_unit(word.lower(), among) if capitals else None)


def names_and_units(
    before: Sequence[str],
    places: tuple[int, ...],
    width: int,  # cells of the first row
    beside: Sequence[list[str]] = (),  # cells before the rows, in their lines
) -> tuple[dict[int, str], dict[int, str], bool]:
    """Names as written and units by place of the lines before the rows, and whether a line is one of units."""
    lines = [_cells_of_names(line, width) for line in before]
    stated = [line for line in (*lines, *beside) if line and UNIT_LINE.fullmatch(line[0])]
    lines = [line for line in lines if line not in stated]
    fitting = [f for f in lines if len(f) > max(places) and not _is_of_types([f[p] for p in places])]
    row, units, has_row = fitting[-1] if fitting else [], dict[int, str](), False
    if fitting and _are_units([row[p] for p in places], [f[places[0]] for f in fitting[:-1]]):
        units = {p: unit for p in places if (unit := row[p].strip(AROUND)) not in ("", "-")}
        row, has_row = fitting[-2] if len(fitting) > 1 else [], True
    elif len(fitting) > 1 and unit_of(fitting[-2][places[0]], ("s",)) and all(unit_of(fitting[-2][p]) for p in places):
        units, has_row = {p: fitting[-2][p] for p in places}, True
    columns = {p: name_and_unit(row[p]) for p in places} if row else {}
    for p, (_, unit) in columns.items():
        if unit not in ("", "-"):
            units.setdefault(p, unit)
    time = next((p for p, (name, _) in columns.items() if TIMES.fullmatch(name)), places[0])
    signals = [p for p in places if p != time or len(places) == 1]
    for p, unit in _stated_units(stated, time, signals):
        has_row = True
        units.setdefault(p, unit)
    if row and time in units and (parts := AFTER_NAME.split(row[time]))[-1] == units[time] and len(parts) > 1:
        # "t_ms,acc_g": as the time has its unit, the others have theirs
        for p, (name, unit) in _suffixes(row, signals).items():
            if p not in units:
                units[p], row = unit, [*row[:p], name, *row[p + 1 :]]
    return dict(enumerate(row)), units, has_row


def _cells_of_names(line: str, width: int) -> list[str]:
    """Cells of a line before rows; those of a name with the separator in it are put together."""
    cells, blanks = cells_in(line), re.split(r"\s{2,}", line.strip())
    if cells and UNIT_LINE.fullmatch(cells[0]):
        return cells
    if mark_of(line) is None and (stated := UNIT_LINE.fullmatch(line.strip())) and stated[4]:
        # blanks within the name of the line
        return [line.strip()]
    if len(cells) <= width:
        return cells
    if mark_of(line) is None and len(blanks) == width:
        return blanks
    names, parts = list[str](), list[str]()
    for cell in cells:
        parts.append(cell)
        if name_and_unit(" ".join(parts))[1]:
            names.append(" ".join(parts))
            parts.clear()
        elif len(parts) == MOST_PARTS:
            break
    if len(names) == width and not parts:
        return names
    # words between blanks, of which nothing says which of them belong together
    return cells if mark_of(line) else [f"column {p}" for p in range(width)]


def _stated_units(lines: Sequence[list[str]], time: int, signals: Sequence[int]) -> Iterator[tuple[int, str]]:
    """Places and units of lines of units."""
    for first, *others in lines:
        statement = UNIT_LINE.fullmatch(first)
        of_time, _, of_time_too, behind = statement.groups("") if statement else [""] * 4
        cells = [cell.strip(AROUND) for cell in ([behind] if behind else []) + others if cell not in ("=", ":")]
        while cells and not cells[-1]:
            del cells[-1]
        columns = sorted({time, *signals})
        if of_time or of_time_too:
            columns = [time]
        elif len(cells) != len(columns):
            columns = list(signals)
        if len(cells) == 1:
            cells *= len(columns)
        if len(cells) == len(columns):
            yield from ((p, cell) for p, cell in zip(columns, cells, strict=True) if cell not in ("", "-"))


def _suffixes(row: Sequence[str], places: Sequence[int]) -> dict[int, tuple[str, str]]:
    """Names and units of cells that end with a unit, as "acc_g"."""
    columns = {}
    for p in places:
        *name, last = AFTER_NAME.split(row[p])
        known = unit_of(last, [unit for unit in UNITS if unit not in NO_SUFFIX]) if name and last != "t" else None
        # "acc_N" may be north, and "x_m" the mean
        if known is not None and (known[1] != 1.0 or len(last) > 1):
            columns[p] = AFTER_NAME.sub(" ", row[p][: -len(last)]).strip(), last
    return columns


def _is_of_types(cells: list[str]) -> bool:
    """True for words of the types of columns, and for lines that are drawn."""
    return all(cell.lower() in TYPES for cell in cells) or not any(cell.strip("-=_ ") for cell in cells)


def _are_units(cells: list[str], above: list[str]) -> bool:
    """True if cells are units and no names; above them are others of the first column."""
    words = [cell.strip(AROUND) for cell in cells]
    # t is a time, and no column in tonnes
    known = [word != "t" and unit_of(word) is not None for word in words if word not in ("", "-")]
    # names may read as units alone; with a row above, or a time among them, they are
    times = [word not in ("h", "min") and unit_of(word, ("s",)) is not None for word in words]
    if not known or TIMES.fullmatch(words[0]):
        return False
    if all(known) and (len(above) > 0 or any(times) or all(cell[:1] in AROUND[::2] for cell in cells)):
        return True
    # "Second" may be a name; with names above, a time in a unit that is not known is none
    named = len(above) > 0 and not is_number(above[-1]) and above[-1] not in ("", "-")
    if times[0]:
        return len(above) > 0 or len(words[0]) < len("second")
    return named and (any(known) or TIMES.fullmatch(above[-1]) is not None)


def name_and_unit(cell: str) -> tuple[str, str]:
    """Name of a column and its unit, "" where the cell has none."""
    for inner in BRACKETS.finditer(cell):
        known = None if inner[1] == "t" else unit_of(inner[1].strip())
        if known is not None and known[0] != "1" and inner.end() < len(cell):
            return f"{cell[: inner.start()]}{cell[inner.end() :]}".strip(), inner[1].strip()
    if parts := BRACKETED.fullmatch(cell):
        # "a(t)" is no column in tonnes
        if parts[2] == "t":
            return cell, ""
        name, unit = name_and_unit(parts[1]) if unit_of(parts[2].strip("$ ")) is None else ("", "")
        # "Weg / mm (laser)" has its unit before the brackets
        return (f"{name} ({parts[2]})", unit) if unit else (parts[1] or cell, parts[2].strip("$ "))
    if (parts := TIMES.fullmatch(cell)) and unit_of(parts[2] or "", ("s",)):
        return parts[1], parts[2]
    if GS.match(cell):
        return cell, "g"
    if unit_of(cell) is not None:
        # a word for a unit of time is a name too
        return cell, cell if len(cell) > 3 and unit_of(cell, ("s",)) else ""
    pairs = ((cell[: mark.start()], cell[mark.end() :]) for mark in BEFORE_UNIT.finditer(cell, 1))
    for name, unit in pairs:
        # V/s is a rate, and no voltage in seconds
        rate = unit_of(unit, ("s",)) is not None and "/" in cell and not HAS_TIME.search(name)
        if unit != "t" and not rate and unit_of(unit):
            return name, unit
    return cell, ""
