"""Tables on a terminal: no column of numbers loses a digit, whatever the width."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["console", "print_table"]

BESIDE = 3
"""Characters between two columns."""

EDGES = 2
"""Characters beside the first and the last one."""

LEAST_WORDS = 18
"""Characters to which a column of words may be wrapped."""

PIPE = 180
"""Width of an output that is not a terminal: wide enough that few tables are divided."""


def console() -> Console:
    """Where a command prints."""
    from rich.console import Console

    return Console(highlight=False, width=None if sys.stdout.isatty() else PIPE)


def print_table(where: Console, header: Iterable[Any], rows: Iterable[Sequence[Any]], title: str) -> None:
    """Print a table; where it is too wide it goes on below with its next columns beside the first one.

    Columns of several rows that say the same in each are one line under the title.

    Parameters
    ----------
    where : Console
    header : iterable of str
    rows : iterable of sequences
        Numbers, texts, or None.
    title : str
    """
    names = [str(name).replace("_", " ") for name in header]
    columns = [list(map(_cell, column)) for column in zip(*rows, strict=True)]
    same = [i for i, column in enumerate(columns) if len(column) > 1 and len(set(column)) == 1]
    varied = [i for i in range(len(columns)) if i not in same]
    where.print(title, style="italic")
    if same and varied:
        where.print(", ".join(f"{names[i]} {columns[i][0]}".replace("\n", " ") for i in same))
    shown = varied or same
    for group in _groups([_least_width(names[i], columns[i]) for i in shown], where.width):
        chosen = [shown[k] for k in group]
        _print_columns(where, [names[i] for i in chosen], [columns[i] for i in chosen])


def _print_columns(where: Console, names: list[str], columns: list[list[str]]) -> None:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for i, (name, column) in enumerate(zip(names, columns, strict=True)):
        numbers = _are_numbers(column)
        wrapped = name.replace(" ", "\n") if numbers else name
        table.add_column(wrapped, justify="right" if numbers and i > 0 else "left", no_wrap=numbers)
    for row in zip(*columns, strict=True):
        table.add_row(*row)
    where.print(table)


def _groups(widths: list[int], width: int) -> list[list[int]]:
    """Numbers of the columns that fit side by side; every group begins with the first column."""
    groups, used = [[0]], EDGES + widths[0]
    for i in range(1, len(widths)):
        if used + BESIDE + widths[i] > width and len(groups[-1]) > 1:
            groups.append([0])
            used = EDGES + widths[0]
        groups[-1].append(i)
        used += BESIDE + widths[i]
    return groups


def _least_width(name: str, column: list[str]) -> int:
    """Characters that a column cannot do without: of a number all, of words the longest one."""
    longest = max((len(word) for word in name.split()), default=0)
    if _are_numbers(column):
        return max([longest, *map(len, column)])
    words = [word for text in column for word in text.split()]
    return max([longest, *map(len, words), min(LEAST_WORDS, max(map(len, column), default=0))])


def _are_numbers(column: list[str]) -> bool:
    return all(cell == "-" or _is_number(cell) for cell in column)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.5g}"
