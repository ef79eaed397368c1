"""Records as tables: a column by its name, a pandas frame with units, and a short repr as text and as HTML."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require_name
from femimpact.units import number_text

if TYPE_CHECKING:
    import pandas


WIDTH = 80
"""Characters of a line of text."""

GAP = "  "
"""Between two columns."""

FIRST, LAST = 3, 2
"""Rows of a longer table that its head shows, from its beginning and from its end."""

LINES = 9
"""Named values that are shown at most."""


def column_units(table: Any) -> dict[str, str]:
    """Units by name of a record's columns: its array fields along the axis of the first one, which is the rows'.

    None of a record whose rows are no arrays.
    """
    arrays = [item for item in fields(table) if "axes" in item.metadata]
    if not arrays:
        return {}
    rows = arrays[0].metadata["axes"][0]
    return {item.name: item.metadata["unit"] for item in arrays if item.metadata["axes"][0] == rows}


def named_column(
    table: Any,  # dataclass
    name: str,
    units: Mapping[str, str] | None = None,  # its columns and their units, where they are not those of `column_units`
) -> NDArray[Any]:
    """The column of a record that has this name.

    Returns (n, ...): the very array that the record holds.
    """
    require_name(name, column_units(table) if units is None else units, "column")
    values: NDArray[Any] = getattr(table, name)
    return values


def flat_columns(
    table: Any,  # dataclass
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Columns of a record and their units, those of two axes as many, numbered from 1: error_1, error_2.

    `columns` (n,)
    `units`
    """
    columns: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    for name, unit in column_units(table).items():
        values = getattr(table, name)
        parts = {name: values} if values.ndim == 1 else {f"{name}_{i + 1}": part for i, part in enumerate(values.T)}
        columns |= parts
        units |= dict.fromkeys(parts, unit)
    return columns, units


def frame_of(
    columns: Mapping[str, Any],
    units: Mapping[str, str],  # of every column, the index among them; "" for text
    index: str | None = None,  # the column that becomes the index; the rows are numbered without one
) -> pandas.DataFrame:
    """Columns as a pandas frame.

    Returns pandas.DataFrame: copies of the columns; `attrs["units"]` holds the units by name.
    """
    import pandas

    frame = pandas.DataFrame({name: np.asarray(values) for name, values in columns.items()}, copy=True)
    if index is not None:
        frame = frame.set_index(index)
    frame.attrs["units"] = {name: units[name] for name in columns}
    return frame


class Head(NamedTuple):
    """Cells that the repr of a table, or of a few named values, shows."""

    title: str
    rows: tuple[tuple[str, ...], ...]  # cells, equally many in every row
    headings: int  # how many of the rows are headings: 0 of named values, else the names and the units of columns

    @property
    def text(self) -> str:
        """Lines of at most 80 characters; the last one names the columns that do not fit."""
        # a number stands under the end of its column's name, a value behind its name
        justify = str.rjust if self.headings else str.ljust
        columns = list(zip(*self.rows, strict=True))
        widths = [max(map(len, column)) for column in columns]
        fitting = len(widths)
        while self.headings and sum(widths[:fitting]) + len(GAP) * (fitting - 1) > WIDTH:
            fitting -= 1
        rows = [
            GAP.join(justify(cell, width) for cell, width in zip(row[:fitting], widths[:fitting], strict=True)).rstrip()
            for row in self.rows
        ]
        left_out = ", ".join(column[0] for column in columns[fitting:])
        also = [textwrap.shorten(f"also: {left_out}", WIDTH, placeholder=" ...")] if left_out else []
        return "\n".join([*map(_cut, (self.title, *rows)), *also])

    @property
    def html(self) -> str:
        """All rows and columns as a table of HTML; what is a sign of HTML is escaped."""
        rows = ""
        for i, row in enumerate(self.rows):
            kind = "th" if i < self.headings else "td"
            rows += f"<tr>{''.join(f'<{kind}>{html.escape(cell)}</{kind}>' for cell in row)}</tr>"
        return f"<table><caption>{html.escape(self.title)}</caption>{rows}</table>"


Record = TypeVar("Record")


def short_repr(kind: type[Record]) -> type[Record]:
    """Class decorator: text and HTML of the record's `_head`, a `Head`, are its reprs.

    Where it has a `_figure`, the call that draws it, a notebook names that below.
    """
    setattr(kind, "__repr__", _text)  # noqa: B010
    setattr(kind, "_repr_html_", _html)  # noqa: B010
    return kind


def _text(record: Any) -> str:
    return str(record._head.text)


def _html(record: Any) -> str:
    return str(record._head.html) + figure_note(record)


def figure_note(record: Any) -> str:
    """HTML that names the function which draws a record; empty where it has none."""
    call = getattr(record, "_figure", "")
    return f"<p>figure: <code>{html.escape(call)}</code></p>" if call else ""


def head_of_columns(
    title: str,
    columns: Mapping[str, NDArray[Any]],
    units: Mapping[str, str],  # of the columns; "" for text
    marks: Mapping[str, NDArray[np.bool_]] | None = None,  # of some columns, the values that have a star behind them
) -> Head:
    """The first three and the last two rows of a table, or all where they are six or fewer."""
    marks_of = marks or {}
    count = min((values.shape[0] for values in columns.values()), default=0)
    complete = count <= FIRST + LAST + 1
    visible = [*range(count)] if complete else [*range(FIRST), *range(count - LAST, count)]
    rows = [
        tuple(_cell(values[i]) + "*" * int(name in marks_of and marks_of[name][i]) for name, values in columns.items())
        for i in visible
    ]
    if not complete:
        rows.insert(FIRST, ("...",) * len(columns))
    return Head(title, (tuple(columns), tuple(units[name] for name in columns), *rows), 2)


def head_of_values(title: str, values: Mapping[str, str]) -> Head:
    """A few named values, the first nine."""
    rows = [*values.items()]
    return Head(title, tuple(rows if len(rows) <= LINES else [*rows[: LINES - 1], ("...", "")]), 0)


def _cell(value: Any) -> str:
    return number_text(value, 5) if isinstance(value, float) else str(value)


def _cut(line: str) -> str:
    return line if len(line) <= WIDTH else f"{line[: WIDTH - 3]}..."
