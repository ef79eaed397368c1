"""The part of a report on response curves: peaks without and with balls, what happens at the impacts, damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.figures.drawing import prefixed
from femimpact.export.report.blocks import Section, Table
from femimpact.svg.axis import axis_of
from femimpact.svg.chart import Band, Chart, Line, chart_element
from femimpact.svg.elements import Element, element
from femimpact.sweep import FrequencyResponse

__all__ = ["curve_table", "curves_section"]

Array = NDArray[np.float64]

OTHERS = (
    ("impacts_per_cycle", "Impacts in a cycle of the base", "impacts per cycle", "1"),
    ("cycle_mean_force", "Cycle-averaged contact force", "force", "N"),
    ("peak_force", "Largest contact force", "force", "N"),
    ("mean_approach_speed", "Mean approach speed", "speed", "m/s"),
)
"""What is drawn of curves with impacts: column, title, quantity, unit."""

ONE_START = "Dots: values of one start, for the motion is not periodic; another start has others."


def curves_section(
    curves: Mapping[str, FrequencyResponse],
    key: str = "response",
    heading: str = "Response over frequency",
    bands: Sequence[tuple[str, Array, Array, Array]] = (),
) -> Section:
    """Response curves by their names.

    Parameters
    ----------
    curves : mapping of str to FrequencyResponse
    key, heading : str
    bands : sequence of (str, ndarray, ndarray, ndarray)
        Words, frequencies (Hz), and the smallest and the largest peaks (of the unit of the curves) of several starts.
    """
    first = next(iter(curves.values()))
    relative = ", relative to the base" if first.unit == "m" else ""
    peak = chart_of(
        curves,
        "peak",
        f"Peak of {first.at if isinstance(first.at, str) else f'{first.at:g} m'}{relative}",
        "peak",
        first.unit,
        bands,
    )
    phase = chart_of(curves, "phase", "Phase of the first harmonic", "phase", "rad")
    others = [chart_of(curves, *other) for other in OTHERS if _has(curves, other[0])]
    return Section(
        key, heading,
        (
            element("div.wide", chart_element(peak)),
            element("div.charts", *(chart_element(one) for one in (*others, phase) if one.lines)),
            _dwell(first),
        ),
    )  # fmt: skip


def _dwell(curve: FrequencyResponse) -> Element:
    length = f"{curve.cycles} cycles" if curve.cycles is not None else f"{curve.duration:g} s"
    starts = {
        "base": "at rest relative to the base",
        "space": "at rest in the inertial frame",
        "static": "in the static state",
    }
    start = starts.get(curve.start, "from a given state")
    return element(
        "p",
        f"Each frequency is held for {length}, from a start {start}; the end of it is measured. " + _level(curve),
    )


def _level(curve: FrequencyResponse) -> str:
    if curve.amplitude is None:
        return f"The base accelerates by {curve.acceleration:.4g} m/s^2."
    return f"The base moves by {1e3 * curve.amplitude:.4g} mm."


def _has(curves: Mapping[str, FrequencyResponse], name: str) -> bool:
    """Whether a column says something: it is not 0 or without a value everywhere."""
    return any(np.any(np.nan_to_num(np.asarray(curve[name], dtype=float)) != 0.0) for curve in curves.values())


def chart_of(
    curves: Mapping[str, FrequencyResponse],
    name: str,
    title: str,
    quantity: str,
    unit: str,
    bands: Sequence[tuple[str, Array, Array, Array]] = (),
) -> Chart:
    """One column of curves over the frequency, with dots where it is one start's, above bands of several starts."""
    columns = {label: np.asarray(curve[name], dtype=float) for label, curve in curves.items()}
    finite = np.concatenate([values[np.isfinite(values)] for values in columns.values()])
    factor, shown = prefixed(float(np.abs(finite).max(initial=0.0)), unit) if unit not in ("1", "rad") else (1.0, unit)
    lines, marked = [], False
    for i, (label, curve) in enumerate(curves.items()):
        values = factor * columns[label]
        if name not in ("peak", "phase") and not np.any(np.nan_to_num(values) != 0.0):
            continue
        order = np.argsort(curve.frequency, kind="stable")
        sample = np.asarray(curve.is_sample)[order]
        marked = marked or bool(sample.any())
        x, y = curve.frequency[order], values[order]
        if name == "phase":
            x, y, sample = _cut_at_turns(x, y, sample)
        lines.append(Line(label, x, y, 1 + i, marked=sample))
    words = quantity if shown == "1" else f"{quantity} ({shown})"
    frequency = axis_of("frequency of the base (Hz)", *(line.x for line in lines), tight=True)
    zero = name != "phase"
    note = ONE_START if marked and name == "peak" else ""
    shaded = tuple(
        # the first has the colour of the last curve, whose starts they are
        Band(label, x, factor * low, factor * high, len(curves) + i)
        for i, (label, x, low, high) in enumerate(bands)
    )
    drawn = [*(line.y for line in lines), *(one for band in shaded for one in (band.low, band.high))]
    # a resonance beside bands of starts: all of them are seen on a logarithmic axis alone
    heights = axis_of(words, *drawn, zero=zero, logarithmic=bool(shaded))
    return Chart(title, frequency, heights, tuple(lines), shaded, note=note)


def _cut_at_turns(x: Array, y: Array, sample: Any) -> tuple[Array, Array, Any]:
    """The same with a gap wherever a phase goes on at the other end of its range."""
    turns = 1 + np.flatnonzero(np.abs(np.diff(y)) > np.pi)
    return np.insert(x, turns, np.nan), np.insert(y, turns, np.nan), np.insert(sample, turns, False)


def curve_table(curves: Mapping[str, FrequencyResponse]) -> Table:
    """Peak and damping of each curve."""
    rows: list[tuple[Any, ...]] = []
    for label, curve in curves.items():
        if np.any(np.isfinite(curve.peak)):
            mark = "one sample" if curve.peak_is_sample else "periodic"
            scale = 1e3 if curve.unit == "m" else 1.0
            rows.append((label, curve.peak_frequency, scale * curve.peak_amplitude, mark, len(curve.warnings)))
    units = dict.fromkeys("mm" if curve.unit == "m" else curve.unit for curve in curves.values())
    peak = f"peak ({', '.join(units)})"
    return Table("Peaks of the curves", ("curve", "frequency (Hz)", peak, "motion there", "warnings"), tuple(rows))
