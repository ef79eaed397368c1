"""Texts with a unit in a study file: read once, where the file enters, with the units that its schema names."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from femimpact.errors import Fault, InputError, require_path
from femimpact.regular_file import decimal_number, read_regular
from femimpact.response.channels import QUANTITIES
from femimpact.study.parameter_plan import is_part_of_path
from femimpact.sweep.curve import SWEEP_UNITS
from femimpact.units import TEXT_SCHEMA, in_si, read_unit

START = {"position": "m", "speed": "m/s"}

SLOPE = re.compile(r"\s*([+-]?(?:\d{1,40}\.?\d{0,40}|\.\d{1,40}))\s*dB/oct\s*")

QUOTED = re.compile(r""""([^"\n\\]*)"|'([^'\n]*)'""")
"""A text of TOML in one line."""

FILE, NUMBER = re.compile(r"\.[A-Za-z]\w*$"), re.compile(r"\s*[+-]?\.?\d")
"""The end of the name of a file, and the beginning of a number."""

HEADER = re.compile(r"[\[(]\s*(\S[^\[\]]*?)\s*[\])]\s*$")
"""A unit in brackets at the end of the name of a column."""

MOST_BYTES = 10_000_000
"""Largest size of a file of rows, bytes."""

MOST_DECIBELS = 3000.0
"""Of one slope: more is beyond the range of numbers."""

NOT_OF_AXIS = ("points", "spacing")


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
        return taken


def in_si_units(data: Mapping[str, Any], schema: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], Readings]:
    """The tables of a study file with numbers in SI where they have texts with a unit, and what was read."""
    readings, tables = Readings(folder), schema["properties"]
    found = {
        name: _read(name, value, tables[name], readings) if name in tables else value for name, value in data.items()
    }
    plan: Any = found.get("study")
    if isinstance(plan, dict) and isinstance(plan.get("axes"), dict):
        found["study"] = plan = {**plan, "axes": dict(_axes(plan["axes"], data, tables, readings))}
    best = plan.get("best") if isinstance(plan, dict) else None
    if isinstance(best, dict) and isinstance(best.get("limits"), dict):
        found["study"] = {**plan, "best": {**best, "limits": _limits(best["limits"], readings)}}
    return found, readings


def with_numbers(text: str, readings: Readings) -> str:
    """The text of a study file with numbers in SI in place of the texts that were read.

    A text that stands for two numbers, as "10 g" of a mass and of an acceleration, is left in its place.
    """
    values: dict[str, set[str]] = {}
    for _, words, value, _ in readings.found:
        # a list of Python's numbers is one of TOML
        values.setdefault(words, set()).add(repr(value))

    def number(found: re.Match[str]) -> str:
        numbers = values.get(found[1] or found[2], set())
        return next(iter(numbers)) if len(numbers) == 1 else found[0]

    return QUOTED.sub(number, text)


def with_texts(schema: Any) -> Any:
    """A schema that allows a text with a unit wherever it has a number in a unit of SI."""
    if isinstance(schema, list):
        return [with_texts(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if not any(read_unit(unit, (unit,)) for unit in (schema.get("x-unit", ""), schema.get("x-rows", ""))):
        return {name: with_texts(part) for name, part in schema.items()}
    return _or(_or_text(schema), {"type": "string"}) if "x-rows" in schema else _or_text(schema)


def _or_text(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_or_text(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if schema.get("type") == "number":
        return _or(schema, TEXT_SCHEMA)
    return {name: _or_text(part) for name, part in schema.items()}


def _or(schema: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """A schema that allows what another does as well."""
    about = {name: part for name, part in schema.items() if name[:2] == "x-" or name in ("description", "default")}
    first = {name: part for name, part in schema.items() if name not in about}
    return {"anyOf": [*first.pop("anyOf", [first]), other], **about}


# ---- the tables, each beside its schema -----------------------------------------------------------


def _read(key: str, value: Any, schema: Mapping[str, Any], readings: Readings) -> Any:
    """A table, a list of tables or a value with its texts read."""
    if isinstance(value, dict):
        known = _properties(schema, value)
        return {
            name: _read(f"{key}.{name}", part, known[name], readings) if name in known else part
            for name, part in value.items()
        }
    items = schema.get("items", {})
    if isinstance(value, list) and ("properties" in items or "oneOf" in items):
        # a table is named as its faults name it
        labels = [part.get("name", part.get("at", i + 1)) if isinstance(part, dict) else i + 1
                  for i, part in enumerate(value)]  # fmt: skip
        return [_read(f"{key}.{label}", part, items, readings) for label, part in zip(labels, value, strict=True)]
    if isinstance(value, list) and "x-rows" in schema and any(isinstance(row, list) for row in value):
        return _levels(key, value, schema["x-rows"], readings)
    if isinstance(value, str) and "x-rows" in schema and (FILE.search(value) or not NUMBER.match(value)):
        return _rows_of_file(key, value, schema["x-rows"], readings)
    # a whole number counts something
    return readings.number(key, value, "" if schema.get("type") == "integer" else schema.get("x-unit", ""))


def _properties(schema: Mapping[str, Any], value: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a table, of those of its forms that its kind, law or name leaves."""
    found: dict[str, Any] = {}
    for form in (schema, *schema.get("oneOf", ())):
        known = form.get("properties", {})
        if all(
            part.get("const", value.get(name)) == value.get(name, part.get("const")) for name, part in known.items()
        ):
            found = {**known, **found}
    if "exponent" in found:
        exponent = value.get("exponent", 1.5)
        found["stiffness"] = {**found["stiffness"], "x-unit": f"N/m^{exponent}"}
    return found


DERIVATIVE = {"m": 0, "m/s": 1, "m/s^2": 2}


def _levels(key: str, rows: list[Any], unit: str, readings: Readings) -> list[Any]:
    """Rows of a frequency and a level.

    A level may be that of the displacement, velocity or acceleration of a sine, or a slope: from the row before, of the
    first row to the next one.
    """
    taken = [
        [readings.number(key, row[0], "Hz"), row[1]] if isinstance(row, list) and len(row) == 2 else row for row in rows
    ]
    sound = [row for row in taken if isinstance(row, list) and len(row) == 2 and _is_positive(row[0])]
    if len(sound) < len(rows):
        # a fault of the field
        return taken
    slopes = {i: float(found[1]) for i, row in enumerate(taken)
              if isinstance(row[1], str) and (found := SLOPE.fullmatch(row[1]))}  # fmt: skip
    for row in (row for i, row in enumerate(taken) if i not in slopes):
        row[1] = _level(key, row, unit, readings)
    for i, slope in slopes.items():
        frequency, words = taken[i]
        if (i == 0 and 1 in slopes) or len(taken) == 1:
            readings.faults.append(Fault(key, words, "", "must have a level beside it, from which the slope goes"))
            return taken
        of, level = taken[i - 1 if i else 1]
        octaves = math.log2(frequency / of)
        if isinstance(level, (int, float)) and abs(slope * octaves) < MOST_DECIBELS:
            taken[i][1] = level * 10.0 ** (slope * octaves / (10.0 if "/Hz" in unit else 20.0))
            readings.found.append((key, words, taken[i][1], unit))
    return taken


def _is_positive(value: Any) -> bool:
    return isinstance(value, (int, float)) and 0.0 < value < math.inf


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
    """Rows of a frequency and a level from a file beside the study, in the units that its header has in brackets."""
    rows: list[list[Any]] = []
    units, inner = ["", ""], Readings()
    try:
        require_path(name, key, "a file of rows")
        text = read_regular(readings.folder / name, MOST_BYTES).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "no text"
        readings.faults.append(Fault(key, name, "", f"must be an existing file of rows, or rows: {reason}"))
        return name
    except InputError as error:
        readings.faults += error.faults
        return name
    for line in filter(None, map(str.strip, text.splitlines())):
        mark = next((mark for mark in ";\t," if mark in line), None)
        cells = [cell.strip().strip('"') for cell in line.split(mark)]
        if rows or NUMBER.match(line):
            rows.append([_cell(cell, of) for cell, of in itertools.zip_longest(cells, units, fillvalue="")])
        elif line[0] != "#":
            units = [found[1] if (found := HEADER.search(cell)) else "" for cell in cells]
    levels = _levels(key, rows, unit, inner)
    readings.faults += inner.faults
    readings.found.append((key, name, levels, unit))
    return levels


def _cell(cell: str, unit: str) -> Any:
    """A number in SI, or the text with its unit."""
    number = decimal_number(cell)
    return cell if number is None else f"{cell} {unit}" if unit else number


def _limits(limits: Mapping[str, Any], readings: Readings, prefix: str = "") -> dict[str, Any]:
    """Limits of measures, whose units are those of the columns of a sweep and of channels."""
    return {
        name: _limits(value, readings, f"{prefix}{name}.") if isinstance(value, dict)
        else readings.number(f"study.best.limits.{prefix}{name}", value, _unit_of_measure(f"{prefix}{name}"))
        for name, value in limits.items()
    }  # fmt: skip


def _unit_of_measure(name: str) -> str:
    quantity = QUANTITIES.get(name.rpartition(".")[2])
    return SWEEP_UNITS.get(name, "" if quantity is None else quantity.make("tip").unit)


def _axes(
    axes: Mapping[str, Any], data: Mapping[str, Any], tables: Mapping[str, Any], readings: Readings, prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    """The axes of a study, whose units are those of the numbers that their paths lead to."""
    for name, given in axes.items():
        path = f"{prefix}{name}"
        if is_part_of_path(given):
            yield name, dict(_axes(given, data, tables, readings, f"{path}."))
            continue
        unit, key = _unit_at(path, data, tables), f"study.axes.{path}"
        if isinstance(given, dict):
            units = {part: "" if part in NOT_OF_AXIS else unit for part in given}
            read = {part: readings.number(f"{key}.{part}", value, units[part]) for part, value in given.items()}
            if isinstance(given.get("lognormal"), list):
                # the spread of a logarithm has no unit
                read["lognormal"][1:] = given["lognormal"][1:]
            yield name, read
        else:
            yield name, readings.number(key, given, unit)


def _unit_at(path: str, data: Mapping[str, Any], tables: Mapping[str, Any]) -> str:
    """Unit of the number that a path of a study leads to; none where it leads to a name, or nowhere."""
    owner, *rest = path.split(".")
    if owner == "start":
        return START.get(rest[-1] if rest else "", "")
    schema, value = tables.get(owner, {}), data.get(owner)
    if isinstance(value, dict) and isinstance(value.get("segment"), list) and len(rest) > 1:
        value, schema = value["segment"], _properties(schema, value)["segment"]
    if isinstance(value, list):
        named = [part for part in value if isinstance(part, dict) and part.get("name") == (rest or [""])[0]]
        value, schema, rest = named[0] if named else None, schema.get("items", {}), rest[1:]
    for name in rest:
        schema = _properties(schema, value if isinstance(value, dict) else {}).get(name, {})
        value = value.get(name) if isinstance(value, dict) else None
    return str(schema.get("x-unit", ""))
