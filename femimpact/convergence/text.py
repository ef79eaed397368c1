"""A table of a convergence study as text: relative errors, orders and recommended numbers, in 80 columns."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from femimpact.convergence.table import ConvergenceTable

__all__ = ["COUNTED", "cell", "note_lines", "row_line", "table_lines"]

WIDTH = 80
"""Characters of a line."""

NAME, CELL = 25, 9
"""Characters of a quantity's name, or more where one is longer, and of a number."""

WIDTHS = (7, 9, 9, 11)
"""Of a row of orders."""

COUNTED = {"mesh": "elements", "step": "steps in a first period", "modes": "modes"}


def table_lines(table: ConvergenceTable) -> list[str]:
    """Lines of at most 80 columns: the problem, relative errors, their orders, and notes."""
    width = max([NAME, *(len(str(name)) + 1 for name in table.name)])
    return [
        *textwrap.wrap(table.problem, WIDTH), *_errors(table, width), *_reasons(table), "",
        *_orders(table, width), *note_lines(table.notes),
    ]  # fmt: skip


def row_line(name: str, cells: Iterable[str], width: int = NAME) -> str:
    """A name and cells under those of the lines around it."""
    return f"{name:<{width}}{''.join(f'{entry:>{CELL}}' for entry in cells)}"[:WIDTH].rstrip()


def cell(value: Any, form: str = ".1e") -> str:
    """A number; a dash where there is none."""
    return "-" if math.isnan(value) else format(value, form)


def note_lines(notes: Iterable[str]) -> list[str]:
    """Notes, each from a dash on."""
    return [line for note in notes for line in textwrap.wrap(f"- {note}", WIDTH, subsequent_indent="  ")]


def _shown_cases(table: ConvergenceTable, most: int) -> tuple[list[int], int]:
    """Cases that have values, thinned evenly to those that fit, and how many they are unthinned."""
    known = np.flatnonzero(np.any(np.isfinite(table.value), axis=1))
    few = np.unique(np.linspace(0, known.size - 1, min(most, known.size)).round().astype(int))
    return [int(i) for i in known[few]], known.size


def _errors(table: ConvergenceTable, width: int) -> list[str]:
    shown, count = _shown_cases(table, (WIDTH - width) // CELL)
    statistics = bool(np.all(table.is_statistic))
    title = f"Over the {table.axis}: " + ("differences from the finest" if statistics else "relative errors")
    if len(shown) < count:
        title += f", {len(shown)} of {count} cases"
    if np.any(table.is_statistic):
        title += " (* beyond the scatter)"
    lines = [title, row_line(COUNTED[table.axis][:NAME], [f"{table.number[i]:.4g}" for i in shown], width)]
    meaningful = table.meaningful
    for j, name in enumerate(table.name):
        marks = ["*" if table.is_statistic[j] and meaningful[i, j] else "" for i in shown]
        cells = [cell(table.error[i, j]) + mark for i, mark in zip(shown, marks, strict=True)]
        lines.append(row_line(str(name), cells, width))
    return lines


def _reasons(table: ConvergenceTable) -> list[str]:
    """Why cases have no values."""
    failed = [(label, reason) for label, reason in zip(table.label, table.failure, strict=True) if reason]
    return [
        line for label, reason in failed for line in textwrap.wrap(f"{label}: {reason}", WIDTH, subsequent_indent="  ")
    ]


def _orders(table: ConvergenceTable, width: int) -> list[str]:
    """Orders, floors, recommended numbers and limits of what does not scatter."""
    shown = np.flatnonzero(~table.is_statistic)
    if shown.size == 0:
        return []
    lines = [_wide("", ["order", "expected", "floor", f"for {100.0 * table.accuracy:g} %"], "  limit", width)]
    for j in shown:
        orders = [cell(table.fitted_order[j], ".2f"), cell(table.expected_order[j], "g")]
        number = ("<= " if table.recommended_is_bound[j] else "") + cell(table.recommended[j], ".5g")
        unit = "" if table.unit[j] == "1" else f" {table.unit[j]}"
        limit = "" if math.isnan(table.reference[j]) else f"  {table.reference[j]:.7g}{unit}"
        lines.append(_wide(str(table.name[j]), [*orders, cell(table.floor[j]), number], limit, width))
    return [*lines, ""]


def _wide(name: str, cells: Sequence[str], end: str, width: int) -> str:
    columns = "".join(f"{entry:>{places}}" for entry, places in zip(cells, WIDTHS, strict=True))
    return f"{name:<{width - 2}}{columns}{end}"[:WIDTH].rstrip()
