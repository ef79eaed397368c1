"""Cells of the lines of a text of columns, and the numbers in them."""

from __future__ import annotations

import csv
import math
import re
from contextlib import suppress

from femimpact.regular_file import decimal_number

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
