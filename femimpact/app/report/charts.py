"""Parts of a report with charts: response curves, histories, impacts, mode shapes and convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.app.report.page import Section, Table, table_element, table_of
from femimpact.app.results.picture_data import channels_of
from femimpact.arrays import Array
from femimpact.svg import Axis, Band, Chart, Element, Line, axis_of, chart_element, element
from femimpact.sweep import FrequencyResponse
from femimpact.units import MINUS, prefixed, typeset, unit_text

if TYPE_CHECKING:
    import xarray

OTHERS = (
    ("impacts_per_cycle", "Impacts in a cycle of the base", "impacts per cycle", "1"),
    ("cycle_mean_force", "Cycle-averaged contact force", "force", "N"),
    ("peak_force", "Largest contact force", "force", "N"),
    ("mean_approach_speed", "Mean approach speed", "speed", "m/s"),
)
"""Charts of curves with impacts: column, title, quantity, unit."""

ONE_START = "Dots: values of one start, for the motion is not periodic; another start has others."


def curves_section(
    curves: Mapping[str, FrequencyResponse],
    key: str = "response",
    heading: str = "Response over frequency",
    # (str, ndarray, ndarray, ndarray) words, frequencies (Hz), and the smallest and the largest peaks (of the unit of
    # the curves) of several starts
    bands: Sequence[tuple[str, Array, Array, Array]] = (),
) -> Section:
    """Response curves by their names."""
    first = next(iter(curves.values()))
    relative = ", relative to the base" if first.unit == "m" else ""
    place = first.at if isinstance(first.at, str) else f"{first.at:g} m"
    peak = chart_of(curves, "peak", f"Peak of {place}{relative}", "peak", first.unit, bands)
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


STARTS = {
    "base": "at rest relative to the base",
    "space": "at rest in the inertial frame",
    "static": "in the static state",
}


def _dwell(curve: FrequencyResponse) -> Element:
    """Words for how each frequency is held, and how the base moves."""
    length = f"{curve.cycles} cycles" if curve.cycles is not None else f"{curve.duration:g} s"
    start = STARTS.get(curve.start, "from a given state")
    if isinstance(curve.acceleration, tuple):
        (first, low), (last, high) = curve.acceleration[0], curve.acceleration[-1]
        accelerations = f"{unit_text(low, 'm/s^2')} at {first:g} Hz to {unit_text(high, 'm/s^2')} at {last:g} Hz"
        driven = f"accelerates by {accelerations}, by the rows of the study"
    elif curve.acceleration is not None:
        driven = f"accelerates by {unit_text(curve.acceleration, 'm/s^2')}"
    else:
        driven = f"moves by {1e3 * (curve.amplitude or 0.0):.4g} mm"
    text = f"Each frequency is held for {length}, from a start {start}; the end of it is measured. The base {driven}."
    return element("p", text)


def _has(curves: Mapping[str, FrequencyResponse], name: str) -> bool:
    """True where a column has a value other than 0."""
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
    factor, shown = prefixed(largest_of(*columns.values()), unit) if unit != "rad" else (1.0, unit)
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
    units = dict.fromkeys(curve.unit for curve in curves.values())
    scales = {
        unit: prefixed(largest_of(*(one.peak for one in curves.values() if one.unit == unit)), unit) for unit in units
    }
    for label, curve in curves.items():
        if np.any(np.isfinite(curve.peak)):
            mark = "one sample" if curve.peak_is_sample else "transient" if curve.peak_is_transient else "periodic"
            scale = scales[curve.unit][0]
            rows.append((label, curve.peak_frequency, scale * curve.peak_amplitude, mark, len(curve.warnings)))
    peak = f"peak ({', '.join(shown for _, shown in scales.values())})"
    return Table("Peaks of the curves", ("curve", "frequency (Hz)", peak, "motion there", "warnings"), tuple(rows))


KINDS = {
    "m": "displacement relative to the base", "m/s": "velocity", "m/s^2": "acceleration", "N": "force", "N m": "moment",
    "Pa": "stress", "1": "value", "rad": "rotation",
}  # fmt: skip
"""Quantity of a channel by its unit."""


WORK, WORK_OF = "energy_work", "energy_work_of_"
"""Variables of a history: the work of all drives, and the beginning of that of each of several, before its name."""

ENERGIES = {
    WORK: "work of all drives",
    "energy_structure_loss": "lost in the structure",
    "energy_contact_loss": "lost in contacts",
    "energy_kinetic": "kinetic",
    "energy_strain": "strain",
    "energy_ball": "of the balls",
    "energy_contact": "in contacts",
}
"""Variables of a history that are energies, and their words."""

SUMMED = (WORK, "energy_structure_loss", "energy_contact_loss")
"""Those that are summed over the run."""

MOST_CHANNELS = 24
"""Channels that are drawn: of more the page would be too large to open."""

MOST_LINES = 4
"""Channels of one chart."""


def history_section(
    history: xarray.Dataset, last: Mapping[str, tuple[Array, Array, str]] | None = None, key: str = "motion",
    heading: str = "Motion", words: Sequence[str] = (),
) -> Section:  # fmt: skip
    """Section of a report: the channels of a history over time, in one chart or more for each unit.

    Parameters
    ----------
    history : xarray.Dataset
        As of `Response.to_xarray`.
    last : mapping of str to (time, values, unit), optional
        Channels over the last cycles at every step, drawn besides; by default the last twentieth of a long history.
    key, heading : str
        Identifier of the section on its page, and its title.
    words : sequence of str
        Sentences above the charts.
    """
    recorded = channels_of(history)
    channels = dict(list(recorded.items())[:MOST_CHANNELS])
    complete = history_charts(channels, "whole run")
    left_out = list(recorded)[MOST_CHANNELS:]
    late = {name: one for name, one in (last or {}).items() if name in channels}
    when = "last cycles" if "base_frequency_Hz" in history.attrs else "end of the run"
    end = history_charts(late, when) if late else _last_part(channels)
    more = f"{len(left_out)} more channels are not drawn: {', '.join(left_out)}."
    return Section(
        key, heading,
        (
            *(element("p", text) for text in (*words, *([more] if left_out else []))),
            element("div.charts", *(chart_element(one) for one in (*end, *complete))),
        ),
    )  # fmt: skip


def _last_part(channels: dict[str, tuple[Array, Array, str]], share: float = 0.05) -> list[Chart]:
    """The last twentieth of a history that has more than one chart's points."""
    found = {}
    for name, (time, values, unit) in channels.items():
        if time.size > 2000:
            late = time >= time[-1] - share * (time[-1] - time[0])
            found[name] = (time[late], values[late], unit)
    return history_charts(found, "end of the run")


def history_charts(channels: Mapping[str, tuple[Array, Array, str]], when: str) -> list[Chart]:
    """A chart for the channels of each quantity; more than four are divided."""
    by_quantity: dict[tuple[str, str], list[str]] = {}
    for name, (_, _, unit) in channels.items():
        by_quantity.setdefault((_quantity(name, unit), unit), []).append(name)
    parts = [
        (names[k : k + MOST_LINES], quantity, unit)
        for (quantity, unit), names in by_quantity.items()
        for k in range(0, len(names), MOST_LINES)
    ]
    return [
        _chart(
            f"{names[0] if len(names) == 1 else quantity.capitalize()}, {when}", quantity, unit,
            {name: channels[name][:2] for name in names},
        )
        for names, quantity, unit in parts
    ]  # fmt: skip


def _quantity(name: str, unit: str) -> str:
    """Words for what a channel is: what is absolute, or bounded by gaps, is not relative to the base."""
    read = name.rpartition(".")[2]
    return _words(read) if read.startswith("absolute_") or read == "gap" else KINDS.get(unit, "value")


def _chart(
    title: str, quantity: str, unit: str, values: Mapping[str, tuple[Array, Array]], *, zero: bool = False
) -> Chart:
    """Lines of one quantity over time, by their names."""
    largest = largest_of(*(y for _, y in values.values()))
    factor, shown = prefixed(largest, unit)
    style = "thin" if max((y.size for _, y in values.values()), default=0) > 4000 else "line"
    lines = [Line(name, time, factor * y, 1 + i, style) for i, (name, (time, y)) in enumerate(values.items())]
    # the larger ones first, or they would hide the others
    lines.sort(key=lambda line: -float(np.nan_to_num(np.abs(line.y)).mean()) if line.y.size else 0.0)
    time_axis = axis_of("time (s)", *(line.x for line in lines), tight=True)
    heights = axis_of(f"{quantity} ({shown})" if shown != "1" else quantity, *(line.y for line in lines), zero=zero)
    note = f"Largest: {unit_text(largest, unit)}." if unit == "m/s^2" else ""
    return Chart(title, time_axis, heights, tuple(lines), note=note)


def largest_of(*arrays: NDArray[Any]) -> float:
    """Largest absolute value of arrays, of those that are finite."""
    return max((float(np.abs(values[np.isfinite(values)]).max(initial=0.0)) for values in arrays), default=0.0)


def energy_section(
    history: xarray.Dataset,
    drive: str = "base",  # name of the drive, where it is one
) -> Section | None:
    """Work of each drive and losses, stored energies, and what the balance leaves over; None without a ledger."""
    each = {str(name): str(name)[len(WORK_OF) :] for name in history if str(name).startswith(WORK_OF)}
    names = {name: f"work of {'the base' if one == 'base' else one}" for name, one in (each or {WORK: drive}).items()}
    known = {name: words for name, words in (ENERGIES | names).items() if name in history}
    if not known:
        return None
    time, charts = np.asarray(history["time"].to_numpy(), dtype=float), []
    for title, summed in (("Energy put in, and where it went", True), ("Energy stored", False)):
        shown = {words: name for name, words in known.items() if (name in SUMMED or name in each) is summed}
        values = {words: (time, np.asarray(history[name].to_numpy(), dtype=float)) for words, name in shown.items()}
        charts += [_chart(title, "energy", "J", values, zero=True)] if values else []
    return Section("energy", "Energy", (element("div.charts", *map(chart_element, charts)),))


SHOWN = (
    "time", "impactor", "side", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss",
)  # fmt: skip
"""Columns of the table, where an impact has them."""

ROWS = 100

BINS = 30


def impacts_section(
    columns: Mapping[str, Any],  # as of `impacts.csv`
    units: Mapping[str, str],
    file: str = "",  # that holds all of them
    more: tuple[Element, ...] = (),  # charts besides
) -> Section | None:
    """Impulse over the phase, approach speeds, impulse over time, and the last impacts; None without impacts."""
    needed = ("time", "impactor", "side", "impulse", "approach_speed")
    if any(name not in columns for name in needed) or not len(columns["time"]):
        return None
    numbers = {name: np.asarray(values) for name, values in columns.items()}
    count = numbers["time"].size
    shown = [name for name in SHOWN if name in numbers and not _empty(numbers[name])]
    late = slice(max(count - ROWS, 0), None)
    title = f"The last {ROWS} of {count} impacts" if count > ROWS else f"All {count} impacts"
    table = table_of(title, {name: numbers[name][late] for name in shown}, units, file)
    phases = axis_of("phase of the base at impact (degrees)", [0.0, 360.0], tight=True)
    phase = numbers.get("phase", np.full(count, np.nan)).astype(float)
    over_phase = None if _empty(phase) else _impulses("Impulse over the phase", phases, np.degrees(phase), numbers)
    times = axis_of("time (s)", numbers["time"])
    over_time = _impulses("Impulse of every impact", times, numbers["time"], numbers)
    charts = [one for one in (over_phase, _speeds(numbers), over_time) if one is not None]
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


def _impulses(title: str, axis: Axis, places: NDArray[Any], numbers: Mapping[str, NDArray[Any]]) -> Chart:
    """Impulse of every impact over something else of it."""
    factor, unit = prefixed(largest_of(numbers["impulse"]), "N s")
    lines = tuple(
        Line(name, places[mine], factor * numbers["impulse"][mine], 1 + i, "dots")
        for i, (name, mine) in enumerate(_walls(numbers))
    )
    return Chart(title, axis, axis_of(f"impulse ({unit})", *(line.y for line in lines), zero=True), lines)


def _speeds(numbers: Mapping[str, NDArray[Any]]) -> Chart | None:
    """Histogram of the approach speeds of each ball or stop; none of fewer than 5 impacts."""
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


STATIONS = 201

MOST = 4


def modes_section(
    system: Any,  # or what a picture knows of one: `nodes` and `deflection_rows`
    modes: Any,
    table: Table | None = None,
) -> Section:
    """Shapes of the lowest modes, each with its largest deflection 1, and a table."""
    content: list[Element] = []
    nodes = np.asarray(system.nodes, dtype=float)
    if nodes.size >= 2:
        content.append(element("div.wide.low", chart_element(_shapes(system, modes, nodes))))
    return Section("modes", "Modes", (*content, table_element(table or _table(modes))))


def _shapes(system: Any, modes: Any, nodes: Any) -> Chart:
    x = np.linspace(nodes[0], nodes[-1], STATIONS)
    shapes = np.asarray(system.deflection_rows(x) @ modes.vectors, dtype=float)
    lines = []
    for i in range(min(shapes.shape[1], MOST)):
        shape = shapes[:, i]
        # the sign of a mode is free: that of the tip, or of its largest deflection
        largest = shape[np.argmax(np.abs(shape))]
        sign = shape[-1] if abs(shape[-1]) > 1e-6 * abs(largest) else largest
        scaled = shape / (abs(largest) or 1.0) * (1.0 if sign >= 0.0 else -1.0)
        name = f"mode {i + 1}, {typeset(float(modes.natural_frequency[i]))} Hz"
        lines.append(Line(name, 1e3 * x, scaled, 1 + i))
    places = axis_of("distance from the root (mm)", 1e3 * x, tight=True)
    return Chart(
        "Mode shapes of the structure alone", places, axis_of("deflection over its largest", [-1.0, 1.0]), tuple(lines)
    )


def _table(modes: Any) -> Table:
    columns: Sequence[tuple[str, Any]] = (
        ("natural frequency (Hz)", modes.natural_frequency), ("damping ratio", modes.damping_ratio),
        ("participation factor (kg^0.5)", modes.participation_factor),
    )  # fmt: skip
    rows = tuple((i + 1, *(float(values[i]) for _, values in columns)) for i in range(len(modes.natural_frequency)))
    return Table("Modes", ("mode", *(name for name, _ in columns)), rows)


COUNTED = {"mesh": "elements", "step": "steps in the first natural period", "modes": "modes kept"}

FAMILIES = 6
"""Lines of one chart."""


POWER = "Relative errors. A straight line falls with a power of the size, its order."
ERROR_TABLES = {
    "convergence": ("Convergence over the {}", POWER),
    "statistics": (
        "Runs with contacts, over the {}",
        "Means over several starts: a difference below three standard errors means nothing.",
    ),
    "runs": ("Runs in steps", POWER),
}
"""Heading and words of each kind of tables of errors."""


def axis_section(
    axis: str,  # {"mesh", "step", "modes"}
    columns: Mapping[str, Any],  # as of `ConvergenceTable.columns`
    units: Mapping[str, str],
    file: str = "",
    kind: str = "convergence",  # of `ERROR_TABLES`
) -> Section | None:
    """Relative errors over one axis, and the values behind them; None of a table without errors."""
    names = [name.removesuffix("_error") for name in columns if name.endswith("_error")]
    if not names or "number" not in columns:
        return None
    number = np.asarray(columns["number"], dtype=float)
    across = axis_of(COUNTED[axis], number, logarithmic=True)
    groups = [names[k : k + FAMILIES] for k in range(0, len(names), FAMILIES)]
    charts = [_error_chart(across, number, {_words(n): columns[f"{n}_error"] for n in group}) for group in groups]
    shown = {"case": columns["case"]} if "case" in columns else {"number": number}
    rows_of = {**shown, **{name: columns[name] for name in names if name in columns}}
    header = tuple(
        f"{_words(name)} ({units[name]})" if units.get(name) not in (None, "", "1") else _words(name)
        for name in rows_of
    )
    rows = tuple(zip(*(np.asarray(values).tolist() for values in rows_of.values()), strict=True))
    heading, words = ERROR_TABLES[kind]
    return Section(
        f"{kind}-{axis}", heading.format(axis),
        (
            element("p", words), element("div.charts", *(chart_element(one) for one in charts if one.lines)),
            table_element(Table("Values of the cases", header, rows, file)),
        ),
    )  # fmt: skip


def _words(name: str) -> str:
    return name.replace("_", " ")


def _error_chart(across: Axis, number: NDArray[np.float64], errors: Mapping[str, Any]) -> Chart:
    """Errors by their words, over a number on a logarithmic axis."""
    lines = []
    for i, (words, values) in enumerate(errors.items()):
        error = np.asarray(values, dtype=float)
        known = np.isfinite(error) & (error > 0.0)
        if known.any():
            lines.append(Line(words, number[known], error[known], 1 + i, marked=np.ones(int(known.sum()), dtype=bool)))
    return Chart("", across, axis_of("relative error", *(line.y for line in lines), logarithmic=True), tuple(lines))


def summary_table(columns: Mapping[str, Any], file: str = "") -> Table:
    """Reference, orders and recommended number of every quantity."""
    shown = (
        "axis", "quantity", "unit", "reference", "fitted_order", "expected_order", "recommended",
        "recommended_is_bound",
    )  # fmt: skip
    names = [name for name in shown if name in columns]
    heads = {"recommended_is_bound": "fewer may do"}
    values = {name: np.asarray(columns[name]).tolist() for name in names}
    if "recommended_is_bound" in values:
        values["recommended_is_bound"] = ["yes" if str(one) == "True" else "" for one in values["recommended_is_bound"]]
    rows = tuple(zip(*values.values(), strict=True))
    return Table("What an accuracy takes", tuple(heads.get(name, _words(name)) for name in names), rows, file)
