"""Texts with a unit in a study file: read once, where the file enters, with the units that its schema names."""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from femimpact.app.study.parameter_plan import is_part_of_path
from femimpact.errors import LARGEST, Fault, InputError
from femimpact.excitation.column_names import names_and_units
from femimpact.excitation.columns import cells_of, first_lines
from femimpact.orbits.parameter import SHORT
from femimpact.regular_file import decimal_number, read_regular
from femimpact.response.channels import QUANTITIES
from femimpact.sweep.curve import SWEEP_UNITS
from femimpact.units import TEXT_SCHEMA, in_si, read_unit, units_that_fit

START = {"position": "m", "speed": "m/s"}

SLOPE = re.compile(
    r"\s*([+-]?(?:\d{1,40}\.?\d{0,40}|\.\d{1,40})(?:[eE][+-]?\d{1,3})?)\s*dB\s*/\s*(oct|dec)(?:ave|ade)?\s*", re.ASCII
)

QUOTED = re.compile(r'"""[\s\S]*?"""|\'\'\'[\s\S]*?\'\'\'|#[^\n]*|("(?:[^"\\\n]|\\[^\n])*"|\'[^\'\n]*\')(\s*[=.])?')
"""A text of TOML in one line, and what makes it a key; or a comment, or a text in several lines."""

FILE, NUMBER = re.compile(r"\.[A-Za-z]\w*$"), re.compile(r"\s*[+-]?\.?[0-9]")
"""The end of the name of a file, and the beginning of a number."""

MOST_BYTES = 10_000_000
"""Largest size of a file of rows, bytes."""

MOST_DECIBELS = 3000.0
"""Of one slope: more is beyond the range of numbers."""

NOT_OF_AXIS = ("points", "spacing")

PLACES = (".at", ".to")
"""Keys that are names of places, or metres."""


@dataclass
class Readings:
    """What a study file has as texts with a unit: each with its key, the number and the unit in SI, and the faults."""

    folder: Path = Path()  # of the study file, beside which files of rows are
    found: list[tuple[str, str, Any, str]] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    def number(self, key: str, value: Any, unit: str) -> Any:
        """The number that a text is, of a list those of its texts; what is no such text as it is."""
        if isinstance(value, list):
            return [self.number(key, entry, unit) for entry in value]
        try:
            taken = in_si(key, value, unit)
        except InputError as error:
            self.faults += error.faults
            return value
        if taken is not value:
            self.found.append((key, value, taken, unit))
        elif isinstance(value, str) and unit:
            units = units_that_fit(unit)
            form = f'must be a number, or one with a decimal point and a unit, as "0.5 {units.partition(", ")[0]}"'
            open_side = key.endswith(".gap") and value.startswith("inf")
            allowed = "must be inf for an open side, without quotes and unit" if open_side else f"{form}: {units}"
            self.faults.append(Fault(key, value, "", allowed))
        elif isinstance(value, str) and key.endswith(PLACES) and (metres := Readings().number("", value, "m")) != value:
            self.found.append((key, value, metres, "m"))
            return metres
        return taken


def in_si_units(data: Mapping[str, Any], schema: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], Readings]:
    """The tables of a study file with numbers in SI where they have texts with a unit, and what was read."""
    readings, tables = Readings(folder), schema["properties"]
    found = {
        name: _read(name, value, tables[name], readings) if name in tables else value for name, value in data.items()
    }
    orbits: Any = found.get("orbits")
    if isinstance(orbits, dict) and isinstance(orbits.get("range"), list):
        unit = _unit_of_orbits(orbits.get("parameter"), data, tables)
        found["orbits"] = {**orbits, "range": readings.number("orbits.range", orbits["range"], unit)}
    plan: Any = found.get("study")
    if isinstance(plan, dict) and isinstance(plan.get("axes"), dict):

        def axis(path: str, given: Any) -> Any:
            return _axis(f"study.axes.{path}", given, _unit_at(path, data, tables), readings)

        found["study"] = plan = {**plan, "axes": _mapped(plan["axes"], is_part_of_path, axis)}
    best = plan.get("best") if isinstance(plan, dict) else None
    if isinstance(best, dict) and isinstance(best.get("limits"), dict):

        def limit(name: str, value: Any) -> Any:
            # units of measures are those of the columns of a sweep and of channels
            quantity = QUANTITIES.get(name.rpartition(".")[2])
            unit = SWEEP_UNITS.get(name, "" if quantity is None else quantity.unit)
            return readings.number(f"study.best.limits.{name}", value, unit)

        found["study"] = {**plan, "best": {**best, "limits": _mapped(best["limits"], is_table, limit)}}
    return found, readings


def with_numbers(text: str, tables: Mapping[str, Any]) -> str:
    """The text of a study file with numbers in SI, as its tables have them, in place of the texts that they were."""
    quoted: list[str] = []

    def marked(match: re.Match[str]) -> str:
        if match[1] is None or match[2]:
            return match[0]
        quoted.append(match[1])
        return f'"@{len(quoted) - 1}"'

    def put(mark: Any, value: Any) -> None:
        if isinstance(mark, str) and mark[:1] == "@" and not isinstance(value, str):
            # a list of Python's numbers is one of TOML
            quoted[int(mark[1:])] = repr(value)
        elif isinstance(mark, dict) and isinstance(value, dict):
            for name in mark.keys() & value.keys():
                put(mark[name], value[name])
        elif isinstance(mark, list) and isinstance(value, list):
            for one, other in zip(mark, value, strict=False):
                put(one, other)

    put(tomllib.loads(QUOTED.sub(marked, text)), tables)
    numbers = iter(quoted)
    return QUOTED.sub(lambda match: match[0] if match[1] is None or match[2] else next(numbers), text)


def label_of(item: Any, number: int) -> str:
    """What faults call one of several tables: its name where that is sound, or its named place, or its number."""
    given = item if isinstance(item, dict) else {}
    sound = (given.get(key) for key in ("name", "at"))
    return next((one for one in sound if isinstance(one, str) and one and "." not in one), str(number))


def is_table(value: Any) -> bool:
    """True for a table."""
    return isinstance(value, dict)


def flat(table: Mapping[str, Any], is_part: Callable[[Any], bool], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Values of tables in one another by their whole names."""
    for name, value in table.items():
        yield from flat(value, is_part, f"{prefix}{name}.") if is_part(value) else [(f"{prefix}{name}", value)]


def _mapped(
    table: Mapping[str, Any], is_part: Callable[[Any], bool], change: Callable[[str, Any], Any], prefix: str = ""
) -> dict[str, Any]:
    """Tables in one another with other values, which follow from their whole names and from what they were."""
    return {
        name: _mapped(value, is_part, change, f"{prefix}{name}.") if is_part(value) else change(prefix + name, value)
        for name, value in table.items()
    }


def with_texts(schema: Any, of_unit: bool = False) -> Any:
    """A schema that allows a text with a unit wherever it has a number in a unit of SI."""
    if isinstance(schema, list):
        return [with_texts(part, of_unit) for part in schema]
    if not isinstance(schema, dict):
        return schema
    units = (schema.get("x-unit", "").replace("exponent", "1.5"), schema.get("x-rows", ""))
    of_unit = of_unit or any(read_unit(unit, (unit,)) for unit in units)
    if of_unit and schema.get("type") == "number":
        return _or(schema, TEXT_SCHEMA)
    made = {name: with_texts(part, of_unit) for name, part in schema.items()}
    return _or(made, {"type": "string"}) if units[1] else made


def _or(schema: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """A schema that allows what another does as well."""
    about = {name: part for name, part in schema.items() if name[:2] == "x-" or name in ("description", "default")}
    first = {name: part for name, part in schema.items() if name not in about}
    return {"anyOf": [*first.pop("anyOf", [first]), other], **about}


# ---- the tables, each beside its schema -----------------------------------------------------------


def _read(key: str, value: Any, schema: Mapping[str, Any], readings: Readings) -> Any:
    """A table, a list of tables or a value with its texts read."""
    if isinstance(value, dict) and "anyOf" in schema:
        return _axis(key, value, schema.get("x-unit", ""), readings)
    if isinstance(value, dict):
        known = _properties(schema, value)
        return {
            name: _read(f"{key}.{name}", part, known[name], readings) if name in known else part
            for name, part in value.items()
        }
    items, unit, rows = schema.get("items", {}), schema.get("x-unit", ""), schema.get("x-rows", "")
    if isinstance(value, list) and ("properties" in items or "oneOf" in items):
        return [_read(f"{key}.{label_of(part, i)}", part, items, readings) for i, part in enumerate(value, 1)]
    if isinstance(value, list) and "prefixItems" in items:
        return [_read_row(key, row, items["prefixItems"], readings) for row in value]
    if isinstance(value, list) and rows and any(isinstance(row, list) for row in value):
        return _levels(key, value, rows, readings)
    if isinstance(value, str) and rows and value and (FILE.search(value) or not NUMBER.match(value)):
        return _rows_of_file(key, value, rows, readings)
    if rows and rows != unit and isinstance(value, (str, list)) and value:
        allowed = f'must be rows of a frequency and a level, as [["20 Hz", 0.1], ["2 kHz", 0.1]]: {_units_of(rows)}'
        readings.faults.append(Fault(key, value, "", allowed))
        return value
    # a whole number counts something
    return readings.number(key, value, "" if schema.get("type") == "integer" else unit)


def _read_row(key: str, row: Any, schemas: Sequence[Mapping[str, Any]], readings: Readings) -> Any:
    """A row of numbers with the texts of each column read; what is no row stays."""
    if not isinstance(row, list) or len(row) != len(schemas):
        return row
    return [_read(key, part, schema, readings) for part, schema in zip(row, schemas, strict=True)]


def _properties(schema: Mapping[str, Any], value: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a table, of those of its forms that its kind, law or name leaves."""
    found: dict[str, Any] = {}
    for form in (schema, *schema.get("oneOf", ())):
        known = form.get("properties", {})
        fixed = {name: part["const"] for name, part in known.items() if "const" in part}
        if all(value.get(name, one) == one for name, one in fixed.items()):
            found = {**known, **found}
    if {"exponent", "stiffness"} <= found.keys():
        exponent = Readings().number("exponent", value.get("exponent", 1.5), "1")
        exponent = f"{exponent:g}" if isinstance(exponent, (int, float)) else "1.5"
        found["stiffness"] = {**found["stiffness"], "x-unit": f"N/m^{exponent}"}
    return found


DERIVATIVE = {"m": 0, "m/s": 1, "m/s^2": 2}


def _levels(key: str, rows: list[Any], unit: str, readings: Readings, file: str = "", lines: Sequence[int] = ()) -> Any:
    """Rows of a frequency and a level, from a file with the numbers of its lines; what they were where one is bad.

    A level may be that of the displacement, velocity or acceleration of a sine, or a slope: from the row before, of the
    first row to the next one.
    """
    taken, slopes = list[list[Any]](), dict[int, float]()

    def refuse(i: int, allowed: str, shown: Any = None) -> Any:
        # what stands in a file may be no rows at all, but something secret
        where = f"line {lines[i]}" if file else f"row {i + 1}"
        readings.faults.append(Fault(key, file or shown or rows[i], "", f"{where}: {allowed}"))
        return file or rows

    for i, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != 2:
            return refuse(i, "must be a frequency and a level")
        inner = Readings()
        frequency, level = inner.number(key, row[0], "Hz"), row[1]
        found = SLOPE.fullmatch(level) if isinstance(level, str) else None
        if not inner.faults and not _is_positive(frequency):
            return refuse(i, "must have a frequency > 0 Hz")
        if found:
            slopes[i] = float(found[1]) * (1.0 if found[2] == "oct" else math.log10(2.0))
        elif not inner.faults:
            level = _level(key, [frequency, level], unit, inner)
            if isinstance(level, (int, float)) and not _is_positive(level):
                return refuse(i, f"must have a level > 0, in {unit}")
        if inner.faults:
            return refuse(i, inner.faults[0].allowed.replace(units_that_fit(unit), _units_of(unit)))
        if taken and frequency <= taken[-1][0]:
            allowed = f"must have frequencies that rise: {taken[-1][0]:g} Hz is followed by {frequency:g} Hz"
            edge = f"; an edge has a width: {frequency:g} and {1.01 * frequency:.4g} Hz" * (frequency == taken[-1][0])
            return refuse(i, allowed + edge, rows[i - 1 : i + 1])
        taken.append([frequency, level])
    for i, slope in slopes.items():
        if (i == 0 and 1 in slopes) or len(taken) == 1:
            return refuse(i, "must have a level beside it, from which the slope goes")
        frequency, (of, level) = taken[i][0], taken[i - 1 if i else 1]
        decibels = slope * math.log2(frequency / of)
        if not isinstance(level, (int, float)):
            # a fault of the field
            return rows
        if abs(decibels) > MOST_DECIBELS:
            return refuse(i, f"must change the level by at most {MOST_DECIBELS:g} dB")
        taken[i][1] = level * 10.0 ** (decibels / (10.0 if "/Hz" in unit else 20.0))
    for i, row in enumerate(rows if not file else ()):
        if any(isinstance(part, str) for part in row):
            readings.found.append((f"{key}, row {i + 1}", ", ".join(map(str, row)), tuple(taken[i]), unit))
    return taken


def _units_of(unit: str) -> str:
    """Words for the units of a level, and for a slope."""
    of = dict.fromkeys([unit, *(DERIVATIVE if unit in DERIVATIVE else ())])
    return f"{', '.join(map(units_that_fit, of))}, or a slope as 3 dB/oct"


def _is_positive(value: Any) -> bool:
    return isinstance(value, (int, float)) and 0.0 < value <= LARGEST


def _level(key: str, row: list[Any], unit: str, readings: Readings) -> Any:
    """The level of a row; that of another derivative times a power of 2 pi times the frequency."""
    frequency, value = row
    for other in DERIVATIVE if unit in DERIVATIVE else ():
        unfit = Readings()
        taken = unfit.number(key, value, other)
        if unfit.found and not unfit.faults and other != unit:
            taken *= (2.0 * math.pi * frequency) ** (DERIVATIVE[unit] - DERIVATIVE[other])
            readings.found.append((key, value, taken, unit))
            return taken
    return readings.number(key, value, unit)


def _rows_of_file(key: str, name: str, unit: str, readings: Readings) -> Any:
    """Rows of a frequency and a level from a file beside the study, in the units that its header names."""
    try:
        text = read_regular(readings.folder / name, MOST_BYTES).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "no text"
        readings.faults.append(Fault(key, name, "", f"must be an existing file of rows, or rows: {reason}"))
        return name
    rows = list(itertools.dropwhile(lambda line: not NUMBER.match(line[1][0]), cells_of(text.splitlines(), 1)))
    first = rows[0][0] if rows else 0
    before = [line for _, line in itertools.takewhile(lambda line: line[0] < first, first_lines(text))]
    units = names_and_units(before, (0, 1), len(rows[0][1]) if rows else 0)[1]
    fitting = {0: ("Hz",), 1: tuple(DERIVATIVE) if unit in DERIVATIVE else (unit,)}
    wrong = [units[p] for p in units if read_unit(units[p], fitting[p]) is None]
    if wrong or not rows:
        allowed = (
            f"must have a unit that fits in place of the {wrong[0]!r} in its header" if wrong else "must have rows"
        )
        readings.faults.append(Fault(key, name, "", f"{allowed}: {_units_of(unit)}"))
        return name
    cells = [[_cell(cell, units.get(p, "")) for p, cell in enumerate(row) if p < 2 or cell] for _, row in rows]
    levels = _levels(key, cells, unit, readings, name, [number for number, _ in rows])
    if levels is not name:
        readings.found.append((key, name, levels, unit))
    return levels


def _cell(cell: str, unit: str) -> Any:
    """A number in SI, or the text with its unit."""
    number = decimal_number(cell.replace(",", "."))
    return cell if number is None else f"{cell.replace(',', '.')} {unit}" if unit else number


OF_SINE = "an axis of frequencies takes [base] of kind 'sine', with acceleration or amplitude"
"""Way on from a frequency of a base that has none, as a stepped sine."""


def _axis(key: str, given: Any, unit: str, readings: Readings) -> Any:
    """An axis, or what is given as one, in the unit of the numbers that its path leads to."""
    entries = given.values() if isinstance(given, dict) else given if isinstance(given, list) else [given]
    texts = [one for one in entries if isinstance(one, str) and NUMBER.match(one)]
    if texts and not unit and not key.endswith(PLACES):
        way = f": {OF_SINE}" if key.endswith(".base.frequency") else ""
        readings.faults.append(Fault(key, texts[0], "", f"has a unit, and no number with a unit has this path{way}"))
        # that it is text is no fault beside
        return [0.0, 1.0]
    if not isinstance(given, dict):
        return readings.number(key, given, unit)
    units = {part: "" if part in NOT_OF_AXIS else unit for part in given}
    read = {part: readings.number(f"{key}.{part}", value, units[part]) for part, value in given.items()}
    if isinstance(given.get("lognormal"), list):
        # the spread of a logarithm has no unit
        read["lognormal"][1:] = given["lognormal"][1:]
    return read


def _unit_of_orbits(path: Any, data: Mapping[str, Any], tables: Mapping[str, Any]) -> str:
    """Unit of the parameter of [orbits]; its amplitude is that of the base, or of a force beside a base at rest."""
    base, path = data.get("base"), SHORT.get(path, path) if isinstance(path, str) else ""
    at_rest = isinstance(base, dict) and base.get("kind") == "rest"
    of_force = {"base.frequency": "Hz", "base.amplitude": "N"} if at_rest else {}
    return of_force.get(path) or _unit_at(path, data, tables)


def _unit_at(path: str, data: Mapping[str, Any], tables: Mapping[str, Any]) -> str:
    """Unit of the number that a path of a study leads to; none where it leads to a name, or nowhere."""
    owner, *rest = path.split(".")
    if owner == "start":
        return START.get(rest[-1] if rest else "", "")
    schema, value = tables.get(owner, {}), data.get(owner)
    if isinstance(value, dict) and isinstance(value.get("segment"), list) and len(rest) > 1:
        value, schema = value["segment"], _properties(schema, value)["segment"]
    for name in rest:
        if isinstance(value, list):
            # by its name, or its number where it has none
            named = {str(part.get("name", i)): part for i, part in enumerate(value, 1) if isinstance(part, dict)}
            value = named.get(name, named.get(name.removeprefix("force ")))
            schema = schema.get("items", {})
        else:
            schema = _properties(schema, value if isinstance(value, dict) else {}).get(name, {})
            value = value.get(name) if isinstance(value, dict) else None
    return str(schema.get("x-unit", ""))
