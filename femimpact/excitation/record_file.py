"""Samples of an acceleration from a text file of columns, as data loggers write them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import Fault, InputError, checked, choice, instance, quantity, require
from femimpact.errors import text as a_text

__all__ = ["record_text", "samples_of"]

UNEVEN = 0.25
"""Share of the interval by which a time may lie off the even grid: rounding is less, a lost sample half or more."""

TRENDS: dict[str, Literal["constant", "linear"]] = {"mean": "constant", "line": "linear"}
"""Names of `scipy.signal.detrend` for what is removed."""


def record_text(path: str | Path) -> str:
    """What the file of a record holds.

    Raises
    ------
    InputError
        If it cannot be read, or is no text.
    """
    require(isinstance(path, (str, Path)), "path", path, "", "must be the path of a text file")
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        reason = error.strerror or "cannot be read"
    except UnicodeDecodeError:
        reason = "is no text"
    except ValueError:
        # a null character
        reason = "no path of a file"
    raise InputError([Fault("path", str(path), "", f"must be a text file of columns: {reason}")])


def samples_of(
    text: str, scale: float, detrend: str, columns: Sequence[int | str], path: str | Path
) -> tuple[NDArray[np.float64], float]:
    """Samples and interval of what `record_text` read from a path; see `RecordedBase.from_csv`.

    Returns
    -------
    samples : ndarray (n,)
        The second column times the scale, without its mean or its line of least squares where that is asked.
    interval : float, s
        Between samples, from the first and the last time.

    Raises
    ------
    InputError
        If an argument is out of range, or the text lacks a column, holds what is not a finite number or fewer than two
        samples, its times are not evenly spaced, or all its accelerations are zero.
    """
    checked("text", text, a_text())
    checked("path", path, instance(str, Path))
    scale = checked("scale", scale, quantity("1"))
    require(scale != 0.0, "scale", scale, "1", "must not be 0")
    detrend = checked("detrend", detrend, choice("none", *TRENDS))
    two = isinstance(columns, (tuple, list)) and len(columns) == 2 and all(map(_is_column, columns))
    require(two, "columns", columns, "", "must be two numbers from 0 or names of the header, of time and acceleration")
    rows = list(_rows(text, Path(path), tuple(columns)))
    require(len(rows) >= 2, "path", str(path), "", "must hold 2 or more rows of numbers")
    time, values = np.array(rows).T
    require(
        bool(values.any()), "columns", tuple(columns), "", "must be time and acceleration: the second holds zeros only"
    )
    if detrend != "none":
        from scipy import signal

        values = signal.detrend(values, type=TRENDS[detrend])
    return scale * values, _interval(time, path)


def _is_column(value: object) -> bool:
    return isinstance(value, str) or (isinstance(value, int) and not isinstance(value, bool) and value >= 0)


def _rows(text: str, path: Path, columns: tuple[int | str, ...]) -> Iterator[tuple[float, ...]]:
    """The two numbers of every row behind the header; lines that are empty or begin with # are left out."""
    lines = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip() and line.lstrip()[0] != "#"]
    cells = [(i, _fields(line)) for i, line in lines]
    places, first = _header(path, cells, columns)
    for i, fields in cells[first:]:
        row = []
        for place in places:
            cell = fields[place] if place < len(fields) else "nothing"
            value = _number(cell)
            require(
                math.isfinite(value), "path", str(path), "", f"line {i}, column {place}: {cell!r} is no finite number"
            )
            row.append(value)
        yield tuple(row)


def _header(
    path: Path, cells: list[tuple[int, list[str]]], columns: tuple[int | str, ...]
) -> tuple[tuple[int, ...], int]:
    """Numbers of the two columns, and how many lines stand before the first row."""
    names = [column for column in columns if isinstance(column, str)]
    for k, (_, fields) in enumerate(cells):
        if names and all(name in fields for name in names):
            return tuple(fields.index(column) if isinstance(column, str) else column for column in columns), k + 1
        numbers = [column for column in columns if isinstance(column, int) and column < len(fields)]
        if not names and len(numbers) == 2 and not any(math.isnan(_number(fields[i])) for i in numbers):
            return (numbers[0], numbers[1]), k
    begin = f"begins with {', '.join(map(repr, cells[0][1]))}" if cells else "is empty"
    allowed = f"must be two columns of numbers in {path.name}, by number from 0 or by name of its header; it {begin}"
    raise InputError([Fault("columns", list(columns), "", allowed)])


def _fields(line: str) -> list[str]:
    """Cells of a line: between semicolons, tabulators or commas, the first of them that it has, or spaces.

    Between semicolons or tabulators a decimal comma is a point.
    """
    mark = next((mark for mark in ";\t," if mark in line), None)
    return [cell.strip().strip('"') for cell in line.split(mark)]


def _number(cell: str) -> float:
    """The number that a cell holds, not a number where it holds none."""
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return math.nan


def _interval(time: NDArray[Any], path: str | Path) -> float:
    """Time (s) between samples, where it is one."""
    interval = float(time[-1] - time[0]) / (time.size - 1)
    steps = np.diff(time)
    off = np.abs(time - time[0] - interval * np.arange(time.size))
    even = interval > 0.0 and bool(np.all(steps > 0.0)) and float(off.max()) <= UNEVEN * interval
    allowed = "must have evenly spaced times: a sample is lost, or resample it first (numpy.interp)"
    shown = f"{Path(path).name}, steps of {steps.min():.6g} to {steps.max():.6g} s"
    require(even, "path", shown, "", allowed)
    return interval
