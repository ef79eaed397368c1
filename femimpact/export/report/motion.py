"""The part of a report on histories: displacements, contact forces, what else was recorded, and the energies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.figures.drawing import prefixed
from femimpact.export.report.blocks import Section
from femimpact.svg.axis import axis_of
from femimpact.svg.chart import Chart, Line, chart_element
from femimpact.svg.elements import element

if TYPE_CHECKING:
    import xarray

__all__ = ["energy_section", "history_charts", "history_section"]

Array = NDArray[np.float64]

KINDS = {
    "m": "displacement relative to the base", "m/s": "velocity", "m/s^2": "acceleration", "N": "force", "N m": "moment",
    "Pa": "stress", "1": "value", "rad": "rotation",
}  # fmt: skip
"""What a channel of a unit is."""

NO_CHANNELS = ("base_displacement", "base_velocity", "base_acceleration", "base", "time")

ENERGIES = {
    "energy_work": "work of the base",
    "energy_structure_loss": "lost in the structure",
    "energy_contact_loss": "lost in contacts",
    "energy_kinetic": "kinetic",
    "energy_strain": "strain",
    "energy_ball": "of the balls",
    "energy_contact": "in contacts",
}
"""Variables of a history that are energies, and their words."""

MOST_CHANNELS = 24
"""Channels that are drawn: of more the page would be too large to open."""

MOST_LINES = 4
"""Channels of one chart."""


def history_section(
    history: xarray.Dataset, last: Mapping[str, tuple[Array, Array, str]] | None = None, key: str = "motion",
    heading: str = "Motion", words: Sequence[str] = (),
) -> Section:  # fmt: skip
    """Every channel of a history over time.

    Parameters
    ----------
    history : xarray.Dataset
        As of `Response.to_xarray`.
    last : mapping of str to (time, values, unit), optional
        Channels of the last cycles with every step.
    key, heading : str
    words : sequence of str
        Sentences above the charts.
    """
    recorded = channels_of(history)
    channels = dict(list(recorded.items())[:MOST_CHANNELS])
    whole = history_charts(channels, "whole run")
    left_out = list(recorded)[MOST_CHANNELS:]
    late = {name: one for name, one in (last or {}).items() if name in channels}
    when = "last cycles" if "base_frequency_Hz" in history.attrs else "end of the run"
    end = history_charts(late, when) if late else _last_part(channels)
    more = f"{len(left_out)} more channels are not drawn: {', '.join(left_out)}."
    return Section(
        key, heading,
        (
            *(element("p", text) for text in (*words, *([more] if left_out else []))),
            element("div.charts", *(chart_element(one) for one in (*end, *whole))),
        ),
    )  # fmt: skip


def channels_of(history: xarray.Dataset) -> dict[str, tuple[Array, Array, str]]:
    """Time, values and unit of every channel of a history."""
    time = np.asarray(history["time"].to_numpy(), dtype=float)
    found = {}
    for name, values in history.data_vars.items():
        plain = str(name)
        if plain.startswith("energy_") or plain in NO_CHANNELS or values.dims != ("time",):
            continue
        found[plain] = (time, np.asarray(values.to_numpy(), dtype=float), str(values.attrs.get("units", "1")))
    return found


def _last_part(channels: dict[str, tuple[Array, Array, str]], share: float = 0.05) -> list[Chart]:
    """The last twentieth of a history that has more than one chart's points."""
    found = {}
    for name, (time, values, unit) in channels.items():
        if time.size > 2000:
            late = time >= time[-1] - share * (time[-1] - time[0])
            found[name] = (time[late], values[late], unit)
    return history_charts(found, "end of the run")


def history_charts(channels: Mapping[str, tuple[Array, Array, str]], when: str) -> list[Chart]:
    """A chart for the channels of each unit; more than four are divided."""
    by_unit: dict[str, list[str]] = {}
    for name, (_, _, unit) in channels.items():
        by_unit.setdefault(unit, []).append(name)
    charts = []
    for unit, names in by_unit.items():
        for k in range(0, len(names), MOST_LINES):
            charts.append(_chart(channels, names[k : k + MOST_LINES], unit, when))
    return charts


def _chart(channels: Mapping[str, tuple[Array, Array, str]], names: Sequence[str], unit: str, when: str) -> Chart:
    arrays = [channels[name][1] for name in names]
    largest = max((float(np.abs(one[np.isfinite(one)]).max(initial=0.0)) for one in arrays), default=0.0)
    factor, shown = _unit(largest, unit)
    quantity = KINDS.get(unit, "value")
    style = "thin" if max((one.size for one in arrays), default=0) > 4000 else "line"
    sizes = [float(np.nan_to_num(np.abs(one)).mean()) if one.size else 0.0 for one in arrays]
    lines = tuple(
        Line(name, channels[name][0], factor * channels[name][1], 1 + i, style) for i, name in enumerate(names)
    )
    # the larger ones first, or they would hide the others
    lines = tuple(lines[i] for i in sorted(range(len(lines)), key=lambda i: -sizes[i]))
    title = f"{names[0] if len(names) == 1 else quantity.capitalize()}, {when}"
    time = axis_of("time (s)", *(line.x for line in lines), tight=True)
    return Chart(
        title, time, axis_of(f"{quantity} ({shown})" if shown != "1" else quantity, *(line.y for line in lines)), lines
    )


def _unit(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which values up to the largest are read most easily."""
    return prefixed(largest, unit) if unit != "1" else (1.0, "1")


def energy_section(history: xarray.Dataset) -> Section | None:
    """Work and losses, stored energies, and what the balance leaves over; None without a ledger."""
    known = {name: words for name, words in ENERGIES.items() if name in history}
    if not known:
        return None
    time = np.asarray(history["time"].to_numpy(), dtype=float)
    values = {name: np.asarray(history[name].to_numpy(), dtype=float) for name in known}
    summed = [name for name in known if name in ("energy_work", "energy_structure_loss", "energy_contact_loss")]
    stored = [name for name in known if name not in summed]
    charts = [
        _energies("Energy put in, and where it went", time, {n: values[n] for n in summed}, "line"),
        _energies("Energy stored", time, {n: values[n] for n in stored}, "thin" if time.size > 4000 else "line"),
    ]
    return Section("energy", "Energy", (element("div.charts", *(chart_element(one) for one in charts if one.lines)),))


def _energies(title: str, time: Array, values: Mapping[str, Array], style: str) -> Chart:
    largest = max((float(np.abs(one[np.isfinite(one)]).max(initial=0.0)) for one in values.values()), default=0.0)
    factor, unit = prefixed(largest, "J")
    lines: list[Any] = [
        Line(ENERGIES[name], time, factor * one, 1 + i, style) for i, (name, one) in enumerate(values.items())
    ]
    # the larger ones first, or they would hide the others
    lines.sort(key=lambda line: -float(np.nan_to_num(line.y).mean()))
    up = axis_of(f"energy ({unit})", *(line.y for line in lines), zero=True)
    return Chart(title, axis_of("time (s)", time, tight=True), up, tuple(lines))
