"""Figures of what drives a run, and of its channels over time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, thinned_line
from femimpact.errors import instance, optional, quantity, takes
from femimpact.excitation.excitation import has_cycle, is_force, require_excitation
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.random_base import RandomBase
from femimpact.figures.drawing import (
    BLUE,
    COLOURS,
    OffScreen,
    label_axes,
    legend_above,
    panels,
    plain_log_ticks,
    require_history,
)
from femimpact.response.response import Response
from femimpact.units import GRAVITY, prefixed, unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

QUANTITIES = {
    "m": "displacement relative to the base", "m/s": "velocity", "m/s^2": "acceleration", "N": "force", "N m": "moment",
    "Pa": "stress", "1": "value", "rad": "rotation",
}  # fmt: skip
"""Quantity of a channel by its unit."""

MOST_CHANNELS, MOST_LINES = 24, 4
"""Channels of a figure, and of one of its panels."""

LAST_PART = 0.05
"""Share of a history that is drawn beside the whole of it."""

MOST_POINTS = 1000
"""Points of a line that are drawn."""

SHOWN_CYCLES, READINGS, MOST_READINGS = 10, 64, 200_000
"""Cycles of a steady sine that are drawn; readings of a drive in a cycle, and at most in all."""


@takes(response=instance(Response), end=optional(instance(Response)))
def channels(
    response: Response, end: Response | None = None, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """Channels of a run over time: a row for four of one quantity, the whole run beside its end.

    Of a long line the smallest and the largest value of each stretch are drawn. The first 24 channels are drawn, and
    contact forces that are zero throughout, as those of rigid impacts, are left out.

    Parameters
    ----------
    response : Response
    end : Response, optional
        Its last cycles, which may be read more finely; by default the last twentieth of the run.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (rows, 2) of Axes

    Raises
    ------
    InputError
        If the run holds no history.
    """
    require_history(response)
    rows = _rows(drawn_channels(response), response.units)
    axes = panels(figure, 11.0, 2.6 * len(rows) + 0.4, len(rows), 2, sharex="col", width_ratios=(1.3, 1.0))
    time = response.time
    late = time >= time[-1] - LAST_PART * (time[-1] - time[0])
    for (full, close), (words, names) in zip(axes, rows, strict=True):
        lines = {name: (time, response.channels[name]) for name in names}
        last = {name: (time[late], values[late]) for name, (_, values) in lines.items()}
        if end is not None:
            last |= {name: (end.time, end.channels[name]) for name in names if name in end.channels}
        unit = response.units[names[0]]
        largest = max(float(np.nanmax(np.abs(values), initial=0.0)) for _, values in (*lines.values(), *last.values()))
        factor, label_unit = prefixed(largest, unit)
        _over_time(full, lines, factor)
        _over_time(close, last, factor)
        label = names[0] if len(names) == 1 else words
        label_axes(full, "", f"{label}\n({label_unit})" if label_unit != "1" else label)
        if unit == "m/s^2":
            close.set_title(f"largest {unit_text(largest, unit)}", loc="left")
        legend_above(full)
    axes[-1, 0].set_xlabel("time (s)")
    axes[-1, 1].set_xlabel(f"time (s), {'end of the run' if end is None else 'last cycles'}")
    return axes


def drawn_channels(response: Response) -> list[str]:
    """Names of the channels that `channels` draws, the first 24.

    Rigid impacts last no time: a line at zero would say that there was no force.
    """
    names = [
        name
        for name, values in response.channels.items()
        if name.rpartition(".")[2] != "contact_force" or np.any(values)
    ]
    return names[:MOST_CHANNELS]


def _rows(names: list[str], units: Mapping[str, str]) -> list[tuple[str, list[str]]]:
    """Quantities, each with the names of four channels at most."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in names:
        read = name.rpartition(".")[2]
        # what is absolute, or bounded by gaps, is not relative to the base
        own = read.startswith("absolute_") or read == "gap"
        words = read.replace("_", " ") if own else QUANTITIES.get(units[name], "value")
        groups.setdefault((words, units[name]), []).append(name)
    return [
        (words, group[k : k + MOST_LINES])
        for (words, _), group in groups.items()
        for k in range(0, len(group), MOST_LINES)
    ]


def _over_time(axis: Axes, lines: Mapping[str, tuple[Array, Array]], factor: float) -> None:
    """Lines by their names, the larger ones first, or they would hide the others."""
    colours = dict(zip(lines, COLOURS, strict=False))
    for name in sorted(lines, key=lambda name: -float(np.nan_to_num(np.abs(lines[name][1])).mean())):
        time, values = lines[name]
        chosen = thinned_line(values, MOST_POINTS)
        width = 0.9 if values.size > 4 * MOST_POINTS else 1.4
        axis.plot(time[chosen], factor * values[chosen], color=colours[name], linewidth=width, label=name)
    time = next(iter(lines.values()))[0]
    axis.set_xlim(time[0], max(time[-1], time[0] + 1e-9))


@takes(end=quantity("s", above=0.0))
def drive(excitation: Any, end: float, figure: FigureBase | OffScreen | None = None) -> NDArray[np.object_]:
    """What drives a run: the force, or the acceleration of the base, over time; of a random one its density.

    Of a steady sine ten cycles are drawn, of a pulse the time in which it acts.

    Parameters
    ----------
    excitation : Excitation
    end : float, s
        End of the run.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (drives,) of Axes
    """
    require_excitation(excitation)
    drives = getattr(excitation, "drives", (excitation,))
    names = getattr(excitation, "names", ("",))
    axes = panels(figure, 8.0, 3.2 * len(drives), len(drives), 1)[:, 0]
    for axis, name, source in zip(axes, names, drives, strict=True):
        unit, what = ("N", "force") if is_force(source) else ("m/s^2", "acceleration of the base")
        title = f"{name}: {what}" if name not in ("", "base") else what
        history = getattr(source, "history", source)
        if isinstance(history, RandomBase):
            _density(axis, history, title, unit)
        else:
            _drive_over_time(axis, source, end, title, unit)
    return axes


def _density(axis: Axes, motion: RandomBase, title: str, unit: str) -> None:
    f, density = np.array(motion.psd).T
    factor, label_unit = (1.0, "N²/Hz") if unit == "N" else (GRAVITY**-2, "g²/Hz")
    axis.loglog(f, factor * density, color=BLUE)
    plain_log_ticks(axis.xaxis)
    words = f"{title}: root mean square {unit_text(motion.rms, unit)}"
    label_axes(axis, "frequency (Hz)", f"spectral density ({label_unit})", words)


def _drive_over_time(axis: Axes, source: Any, end: float, title: str, unit: str) -> None:
    """The force (N) or acceleration (m/s^2) while the drive acts."""
    form, begin = getattr(source, "closed_form", None), 0.0
    last = SHOWN_CYCLES / source.frequency if has_cycle(source) else end
    if isinstance(form, PiecewisePolynomial):
        begin, last = float(form.knots[0]), float(form.knots[-1])
    margin = 0.05 * (last - begin)
    begin, last = max(begin - margin, 0.0), min(last + margin, end)
    begin = min(begin, last)
    cycles = source.frequency * (last - begin)
    time = np.linspace(begin, last, min(max(READINGS * math.ceil(cycles), 2000), MOST_READINGS))
    values = (source.force if unit == "N" else source.acceleration)(time)
    largest, chosen = float(np.abs(values).max()), thinned_line(values, MOST_POINTS)
    factor, label_unit = prefixed(largest, unit) if unit == "N" else (1.0, unit)
    axis.plot(time[chosen], factor * values[chosen], color=BLUE, linewidth=0.9 if cycles > 60.0 else 1.4)
    quantity_of = "force" if unit == "N" else "acceleration"
    label_axes(axis, "time (s)", f"{quantity_of} ({label_unit})", f"{title}: largest {unit_text(largest, unit)}")
