"""The part of a report on impacts: when in a cycle they fall, how hard they are, and their table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.figures.drawing import prefixed
from femimpact.export.report.blocks import Section, table_element, table_of
from femimpact.svg.axis import MINUS, axis_of
from femimpact.svg.chart import Chart, Line, chart_element
from femimpact.svg.elements import Element, element

__all__ = ["impacts_section"]

SHOWN = (
    "time",
    "impactor",
    "side",
    "approach_speed",
    "rebound_speed",
    "impulse",
    "peak_force",
    "duration",
    "energy_loss",
)
"""Columns of the table, where an impact has them."""

ROWS = 100

BINS = 30


def impacts_section(
    columns: Mapping[str, Any], units: Mapping[str, str], file: str = "", more: tuple[Element, ...] = ()
) -> Section | None:
    """Impulse over the phase, approach speeds, impulse over time, and the last impacts; None without impacts.

    Parameters
    ----------
    columns : mapping of str to ndarray (n,)
        As of `impacts.csv`.
    units : mapping of str to str
    file : str
        That holds all of them.
    more : tuple of Element
        Charts besides.
    """
    needed = ("time", "impactor", "side", "impulse", "approach_speed")
    if any(name not in columns for name in needed) or not len(columns["time"]):
        return None
    numbers = {name: np.asarray(values) for name, values in columns.items()}
    count = numbers["time"].size
    shown = [name for name in SHOWN if name in numbers and not _empty(numbers[name])]
    late = slice(max(count - ROWS, 0), None)
    title = f"The last {ROWS} of {count} impacts" if count > ROWS else f"All {count} impacts"
    table = table_of(title, {name: numbers[name][late] for name in shown}, units, file)
    charts = [one for one in (_over_phase(numbers), _speeds(numbers), _over_time(numbers)) if one is not None]
    return Section(
        "impacts",
        "Impacts",
        (element("div.charts", *(chart_element(one) for one in charts), *more), table_element(table)),
    )


def _empty(values: NDArray[Any]) -> bool:
    return values.dtype.kind == "f" and not bool(np.any(np.isfinite(values)))


def _walls(numbers: Mapping[str, NDArray[Any]]) -> list[tuple[str, NDArray[np.bool_]]]:
    """Each wall that was met, in words, and which impacts are of it."""
    names = list(dict.fromkeys(numbers["impactor"].tolist()))
    found = []
    for name in names[:3]:
        for side, sign in ((1.0, "+"), (-1.0, MINUS)):
            mine = (numbers["impactor"] == name) & (np.sign(numbers["side"].astype(float)) == side)
            if mine.any():
                found.append((f"{name}, {sign} side", mine))
    return found


def _over_phase(numbers: Mapping[str, NDArray[Any]]) -> Chart | None:
    phase = numbers.get("phase")
    if phase is None or _empty(phase):
        return None
    factor, unit = prefixed(_largest(numbers["impulse"]), "N s")
    lines = tuple(
        Line(name, np.degrees(phase[mine].astype(float)), factor * numbers["impulse"][mine], 1 + i, "dots")
        for i, (name, mine) in enumerate(_walls(numbers))
    )
    phases = axis_of("phase of the base at impact (degrees)", [0.0, 360.0], tight=True)
    return Chart(
        "Impulse over the phase", phases, axis_of(f"impulse ({unit})", *(line.y for line in lines), zero=True), lines
    )


def _largest(values: NDArray[Any]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max(initial=0.0))


def _speeds(numbers: Mapping[str, NDArray[Any]]) -> Chart | None:
    """How many impacts have which approach speed."""
    speed = numbers["approach_speed"].astype(float)
    speed = speed[np.isfinite(speed)]
    if speed.size < 5 or speed.max() <= 0.0:
        return None
    edges = np.linspace(0.0, float(speed.max()), BINS + 1)
    lines = []
    for i, name in enumerate(list(dict.fromkeys(numbers["impactor"].tolist()))[:4]):
        mine = numbers["approach_speed"][numbers["impactor"] == name].astype(float)
        count, _ = np.histogram(mine[np.isfinite(mine)], edges)
        x = np.repeat(edges, 2)
        y = np.concatenate([[0.0], np.repeat(count.astype(float), 2), [0.0]])
        lines.append(Line(name, x, y, 1 + i))
    speeds = axis_of("approach speed (m/s)", edges, tight=True)
    return Chart("How fast they are", speeds, axis_of("impacts", *(line.y for line in lines), zero=True), tuple(lines))


def _over_time(numbers: Mapping[str, NDArray[Any]]) -> Chart:
    factor, unit = prefixed(_largest(numbers["impulse"]), "N s")
    lines = tuple(
        Line(name, numbers["time"][mine], factor * numbers["impulse"][mine], 1 + i, "dots")
        for i, (name, mine) in enumerate(_walls(numbers))
    )
    time = axis_of("time (s)", numbers["time"])
    return Chart(
        "Impulse of every impact", time, axis_of(f"impulse ({unit})", *(line.y for line in lines), zero=True), lines
    )
