"""What a convergence study prints: errors, orders and recommended numbers, in 80 columns."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable

import numpy as np

from femimpact.convergence import ConvergenceTable, StepConvergence
from femimpact.study.convergence import WrittenConvergence

__all__ = ["convergence_lines"]

WIDTH = 80
MOST_CASES = 6
"""Columns of errors that fit beside the name of a quantity."""

NAME, CELL = 25, 9
WIDTHS = (7, 9, 9, 11)
"""Of a row of orders."""
COUNTED = {"mesh": "elements", "step": "steps in a first period", "modes": "modes"}


def convergence_lines(found: WrittenConvergence) -> list[str]:
    """Lines of at most 80 columns: for each axis the relative errors, and what they say."""
    lines: list[str] = []
    for table in found.tables.tables.values():
        lines += [*_errors(table, f"Over the {table.axis}: relative errors"), "", *_orders(table), ""]
        lines += [*_notes(table.notes), ""]
    if found.statistics is not None:
        title = "With contacts, over the mesh: differences from the finest (* beyond the scatter)"
        lines += [*_errors(found.statistics, title), ""]
    if found.step is not None:
        lines += [*_steps(found.step), ""]
    return lines + _notes([*found.notes, *found.mesh.notes, *(found.step.notes if found.step else ())])


def _shown_cases(table: ConvergenceTable) -> list[int]:
    """Cases that have values, thinned evenly to those that fit."""
    known = np.flatnonzero(np.any(np.isfinite(table.value), axis=1))
    few = np.unique(np.linspace(0, known.size - 1, min(MOST_CASES, known.size)).round().astype(int))
    return [int(i) for i in known[few]]


def _errors(table: ConvergenceTable, title: str) -> list[str]:
    shown = _shown_cases(table)
    lines = [title, _row(COUNTED[table.axis][:NAME], [f"{table.number[i]:.4g}" for i in shown])]
    meaningful = table.meaningful
    for j, name in enumerate(table.name):
        cells = []
        for i in shown:
            mark = "*" if table.scatter[i, j] > 0.0 and meaningful[i, j] else ""
            cells.append(_cell(table.error[i, j]) + mark)
        lines.append(_row(str(name), cells))
    for label, reason in zip(table.label, table.failure, strict=True):
        if reason:
            lines += textwrap.wrap(f"{label}: {reason}", WIDTH, subsequent_indent="  ")
    return lines


def _orders(table: ConvergenceTable) -> list[str]:
    asked = f"for {100.0 * table.accuracy:g} %"
    lines = [_wide("", ["order", "expected", "floor", asked], "  limit")]
    for j, name in enumerate(table.name):
        orders = [_cell(table.fitted_order[j], ".2f"), _cell(table.expected_order[j], "g")]
        cells = [*orders, _cell(table.floor[j]), _recommended(table, j)]
        unit = "" if table.unit[j] == "1" else f" {table.unit[j]}"
        limit = "" if math.isnan(table.reference[j]) else f"  {table.reference[j]:.7g}{unit}"
        lines.append(_wide(str(name), cells, limit))
    return lines


def _recommended(table: ConvergenceTable, j: int) -> str:
    """The number for the accuracy; where already the coarsest case has it, that number is a bound."""
    known = table.error[np.isfinite(table.error[:, j]), j]
    bound = "<= " if known.size and known[0] <= table.accuracy else ""
    return bound + _cell(table.recommended[j], ".5g")


def _steps(step: StepConvergence) -> list[str]:
    lines = [
        f"Runs in steps: relative errors; orders {step.linear_order:.2f} and {step.first_impact_order:.2f}",
        _row("dt (s)", ["no ball", "impact", "energy"]),
    ]
    for row in zip(step.dt, step.linear_error, step.first_impact_error, step.energy_residual, strict=True):
        lines.append(_row(f"{row[0]:.4g}", [_cell(value) for value in row[1:]]))
    return lines


def _row(name: str, cells: list[str]) -> str:
    return f"{name:<{NAME}}{''.join(f'{cell:>{CELL}}' for cell in cells)}"[:WIDTH].rstrip()


def _wide(name: str, cells: list[str], end: str) -> str:
    columns = "".join(f"{cell:>{width}}" for cell, width in zip(cells, WIDTHS, strict=True))
    return f"{name:<{NAME - 2}}{columns}{end}"[:WIDTH].rstrip()


def _cell(value: float, form: str = ".1e") -> str:
    return "-" if math.isnan(value) else format(value, form)


def _notes(notes: Iterable[str]) -> list[str]:
    return [line for note in notes for line in textwrap.wrap(f"- {note}", WIDTH, subsequent_indent="  ")]
