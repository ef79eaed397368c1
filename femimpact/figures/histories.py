"""Figures over time: energies, contact force, channels, and what drives a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, thinned_line
from femimpact.contact.laws import Rigid
from femimpact.errors import Fault, InputError, instance, optional, quantity, require, takes, truth
from femimpact.excitation.excitation import BrokenLine, LineLoad, has_cycle, is_force, require_excitation, words_of
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.random_base import RandomBase
from femimpact.figures.drawing import (
    BLUE,
    COLOURS,
    CYCLES,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    OffScreen,
    label_axes,
    last_cycles,
    legend_above,
    panel,
    panels,
    plain_log_ticks,
    require_history,
    scaled,
    walls_of,
)
from femimpact.response.channels import channel_of
from femimpact.response.impacts import DRAWN_IN_CONTACT
from femimpact.response.response import Response
from femimpact.units import GRAVITY, number_text, prefixed, quantity_text, unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

# ---- energies -------------------------------------------------------------------------------------


@takes(response=instance(Response))
def energies(response: Response, figure: FigureBase | OffScreen | None = None) -> NDArray[np.object_]:
    """The energy ledger: what is stored, what was put in and lost, and the residual.

    Parameters
    ----------
    response : Response
        With a ledger.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (3,) of Axes

    Raises
    ------
    InputError
        If the ledger was switched off, or went with its history to `Recorder.sink`.
    """
    require_history(response)
    ledger = response.energy
    if ledger is None:
        raise InputError([Fault("response.energy", None, "", "must be kept: Recorder(ledger=True)")])
    axes = panels(figure, 8.0, 7.4, 3, 1, sharex=True)[:, 0]
    # no line of what is not there
    balls, contacts = bool(response.system.balls), bool(response.system.contacts)
    stored = (
        ("beam: kinetic + strain", ledger.kinetic + ledger.strain, COLOURS[0]),
        *(("balls", ledger.ball, ORANGE),) * balls,
        *(("contacts", ledger.contact, GREEN),) * contacts,
    )
    # of several drives that of each
    drives = zip(ledger.work_of.items(), (PURPLE, SKY, *COLOURS), strict=False)
    since = (
        ("work put in", ledger.work, "black"),
        *((f"work of {'the base' if name == 'base' else name}", values, colour) for (name, values), colour in drives),
        ("stored", ledger.stored - ledger.stored[0], GREY),
        ("lost in the structure", ledger.structure_loss, COLOURS[0]),
        *(("lost in the contacts", ledger.contact_loss, ORANGE),) * contacts,
    )
    for axis, rows in ((axes[0], stored), (axes[1], since)):
        largest = max(float(np.abs(values).max()) for _, values, _ in rows)
        factor, unit = prefixed(largest, "J")
        for label, values, colour in rows:
            axis.plot(ledger.time, factor * values, color=colour, linewidth=1.2, label=label)
        axis.set_ylabel(f"energy ({unit})")
        legend_above(axis)
    axes[2].plot(ledger.time, ledger.residual_history, color=PURPLE, linewidth=1.2)
    title = f"energy unaccounted for over the energy put in: at most {number_text(ledger.residual, 2)}"
    label_axes(axes[2], "time (s)", "residual (1)", title)
    axes[2].yaxis.set_major_formatter("{x:g}")
    return axes


# ---- contact force --------------------------------------------------------------------------------


def cycle_averaged_force(response: Response) -> tuple[Array, Array]:
    """Middle (s) of each complete cycle of the base, and its mean normal force (N) between balls, stops and beam.

    It is the sum of the impulses of the impacts that touch in the cycle, and of the sticking phases by the time that
    they share with it, times the base's frequency.
    """
    require(has_cycle(response.base), "response.base", words_of(response.base), "", "must have a cycle")
    period, impacts, sticking = 1.0 / response.base.frequency, response.impacts, response.sticking
    edges = period * np.arange(int(response.window[1] / period + 1e-9) + 1, dtype=float)
    # a method with steps has the impulse of a sticking phase in both tables
    phases = set(zip(sticking.start.tolist(), sticking.impulse.tolist(), strict=True))
    pairs = zip(impacts.time.tolist(), impacts.impulse.tolist(), strict=True)
    single = np.where([pair in phases for pair in pairs], 0.0, np.abs(impacts.impulse))
    impulse = np.histogram(impacts.time, bins=edges, weights=single)[0] if edges.size > 1 else edges[1:]
    for start, end, force in zip(sticking.start, sticking.end, sticking.mean_force, strict=True):
        last = edges[-1] if np.isnan(end) else end
        shared = np.minimum(edges[1:], last) - np.maximum(edges[:-1], start)
        impulse = impulse + np.nan_to_num(abs(force)) * np.maximum(shared, 0.0)
    return edges[:-1] + 0.5 * period, np.asarray(impulse / period)


@takes(response=instance(Response), cycles=CYCLES, averaged=truth())
def contact_force(
    response: Response, cycles: float = 8, *, averaged: bool = True, figure: FigureBase | OffScreen | None = None
) -> NDArray[np.object_]:
    """Contact force over time (the paper's Fig. 8): last cycles, peak of every impact, average of every cycle.

    The course of every compliant contact is shown: where the run was read more coarsely it is computed once more.

    Parameters
    ----------
    response : Response
        With a contact force among its channels.
    cycles : float
        Base cycles whose force is drawn.
    averaged : bool
        Give the cycle-averaged force a separate panel, instead of a line among the peaks, which the mean force is
        where the excitation has no cycle.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (3,) or (2,) of Axes

    Raises
    ------
    InputError
        If the run holds no history of a contact force.
    """
    require_history(response)
    names = [name for name in response.channels if name.rpartition(".")[2] == "contact_force"]
    require(bool(names), "channels", list(response.channels), "", "must hold a contact force")
    cyclic = has_cycle(response.base)
    averaged = averaged and cyclic
    axes = panels(figure, 8.0, 8.0 if averaged else 5.6, 3 if averaged else 2, 1)[:, 0]
    _last_cycles(axes[0], response, names, cycles)
    impacts, statistics = response.impacts, response.statistics
    # an impact of a rigid law has no force
    rigid = len(impacts) > 0 and not np.isfinite(impacts.peak_force).any()
    sizes, size, unit = (impacts.impulse, "impulse", "N s") if rigid else (impacts.peak_force, "peak force", "N")
    largest = float(np.nanmax(np.abs(sizes), initial=0.0))
    factor, label_unit = prefixed(largest, unit)
    for side, colour, _, label in walls_of(response):
        chosen = impacts.side == side
        axes[1].plot(
            impacts.time[chosen], factor * np.abs(sizes[chosen]), "o", markersize=3.0, color=colour, label=label
        )
    title = f"{'impulse' if rigid else 'peak'} of each impact; "
    if averaged:
        _averages(axes[2], response)
        axes[1].set_xlim(axes[2].get_xlim())
    else:
        if not rigid:
            axes[1].axhline(factor * statistics.cycle_mean_force, color=GREY, linestyle="--", linewidth=1.2)
        mean = "cycle-averaged" if cyclic else "mean"
        title += f"{'' if rigid else 'dashed: '}{mean} force {quantity_text(statistics.cycle_mean_force, 'N', 3)};\n"
    title += f"mean impulse {quantity_text(statistics.mean_impulse, 'N s', 3)}"
    label_axes(axes[1], "time (s)", f"{size} ({label_unit})", title)
    axes[1].set_ylim(0.0, 1.05 * (factor * largest or 1.0))
    legend_above(axes[1])
    return axes


def _last_cycles(axis: Any, response: Response, names: list[str], cycles: float) -> None:
    start, words = last_cycles(response, cycles)
    time, forces = _within_contacts(response, names, start)
    laws = response.impacts.law
    for colour, name in zip(cycle(COLOURS), names, strict=False):
        owner = name.rpartition(".")[0]
        label = f"{owner} (rigid: force only while sticking)" if laws.get(owner) == Rigid.name else owner or None
        axis.plot(time, forces[name], color=colour, label=label)
    law = response.statistics.law
    only = " (force only while sticking)" if law == Rigid.name and len(names) == 1 else ""
    label_axes(axis, "time (s)", "force on the beam (N)", f"{words}, law: {law}{only}")
    if len(names) > 1:
        legend_above(axis)


def _within_contacts(response: Response, names: list[str], start: float) -> tuple[Array, dict[str, Array]]:
    """Times (s) from a start on, and contact forces (N) that show the course of each compliant contact.

    A run that was read more coarsely is computed once more; what was read from files is shown as it is.
    """
    time, impacts, run_again = response.time, response.impacts, response.largest_values
    last = time >= start
    lasting = impacts.duration[(impacts.time >= start) & (impacts.duration > 0.0)]
    if run_again is not None and lasting.size and time.size > 1:
        # one that is cut short by another is no measure
        wanted = max(float(lasting.min()), 0.1 * float(np.median(lasting))) / DRAWN_IN_CONTACT
        if time[1] - time[0] > wanted:
            return run_again.reread(tuple(channel_of(response.system, name) for name in names), start, wanted)
    return time[last], {name: response[name][last] for name in names}


def _averages(axis: Any, response: Response) -> None:
    time, force = cycle_averaged_force(response)
    mean_force, unit = scaled(force, "N")
    mean, mean_unit = scaled(response.statistics.cycle_mean_force, "N")
    axis.plot(time, mean_force, color=BLUE, linewidth=1.0, marker=".", markersize=4.0)
    axis.set_ylim(0.0, 1.15 * (mean_force.max(initial=0.0) or 1.0))
    title = f"normal force averaged over each base cycle; over the last third {number_text(mean, 3)} {mean_unit}"
    label_axes(axis, "time (s)", f"average force ({unit})", title)


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

    Of a drive without a cycle it is beside the part around the largest displacement.
    Of a long line the smallest and the largest value of each stretch are drawn. The first 24 channels are drawn, and
    contact forces that are zero throughout, as those of rigid impacts, are left out.

    Parameters
    ----------
    response : Response
    end : Response, optional
        Its last cycles, which may be read more finely; by default the last twentieth of the run. Of a drive without a
        cycle it is not drawn.
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
    allowed = "must be one or more that are not zero throughout; a Recorder names them"
    require(len(rows) > 0, "response.channels", "none", "", allowed)
    axes = panels(figure, 11.0, 2.6 * len(rows) + 0.4, len(rows), 2, sharex="col", width_ratios=(1.3, 1.0))
    time = response.time
    close_to, part = "end of the run" if end is None else "last cycles", LAST_PART * (time[-1] - time[0])
    begin = time[-1] - part
    if not has_cycle(response.base):
        first = response.channels[
            next((names[0] for _, names in rows if response.units[names[0]] == "m"), rows[0][1][0])
        ]
        begin = min(max(time[np.nanargmax(np.abs(first))] - 0.3 * part, time[0]), begin)
        close_to, end = "around the largest displacement", None
    late = (time >= begin) & (time <= begin + part)
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
    axes[-1, 1].set_xlabel(f"time (s), {close_to}")
    return axes


def one_channel(response: Response, name: str, ax: Axes | OffScreen | None = None) -> Axes:
    """One channel over the whole run."""
    axis, values = panel(ax, 8.0, 4.6), response[name]
    factor, unit = prefixed(float(np.nanmax(np.abs(values), initial=0.0)), response.units[name])
    _over_time(axis, {name: (response.time, values)}, factor)
    words = QUANTITIES.get(response.units[name], "value")
    label_axes(axis, "time (s)", f"{name}, {words} ({unit})")
    return axis


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
        along = isinstance(getattr(source, "at", None), LineLoad)
        of_force = ("1", f"factor of the force at {source.at}") if along else ("N", "force")
        unit, what = of_force if is_force(source) else ("m/s^2", "acceleration of the base")
        title = f"{name}: {what}" if name not in ("", "base") else what
        history = getattr(source, "history", source)
        if isinstance(history, RandomBase):
            _density(axis, history, title, unit)
        else:
            _drive_over_time(axis, source, end, title, unit)
    return axes


def _density(axis: Axes, motion: RandomBase, title: str, unit: str) -> None:
    f, density = np.array(motion.psd).T
    factor, label_unit = {"N": (1.0, "N²/Hz"), "1": (1.0, "1/Hz")}.get(unit, (GRAVITY**-2, "g²/Hz"))
    axis.loglog(f, factor * density, color=BLUE)
    plain_log_ticks(axis.xaxis)
    words = f"{title}: root mean square {unit_text(motion.rms, unit)}"
    label_axes(axis, "frequency (Hz)", f"spectral density ({label_unit})", words)


def _drive_over_time(axis: Axes, source: Any, end: float, title: str, unit: str) -> None:
    """The force (N), the factor of one along the beam, or the acceleration (m/s^2) while the drive acts."""
    form, begin = getattr(source, "closed_form", None), 0.0
    # a record is shown to its end, be one of its lines a cycle or not
    repeats = has_cycle(source) and not isinstance(form, BrokenLine)
    last = SHOWN_CYCLES / source.frequency if repeats else end
    if isinstance(form, PiecewisePolynomial):
        begin, last = float(form.knots[0]), float(form.knots[-1])
    margin = 0.05 * (last - begin)
    begin, last = max(begin - margin, 0.0), min(last + margin, end)
    begin = min(begin, last)
    cycles = source.frequency * (last - begin)
    time = np.linspace(begin, last, min(max(READINGS * math.ceil(cycles), 2000), MOST_READINGS))
    if isinstance(form, BrokenLine):
        # its largest value is one of its samples
        time = np.union1d(time, form.interval * np.arange(math.floor(last / form.interval) + 1))
    values = (source.force if is_force(source) else source.acceleration)(time)
    largest, chosen = float(np.abs(values).max()), thinned_line(values, MOST_POINTS)
    factor, label_unit = prefixed(largest, unit) if unit == "N" else (1.0, unit)
    axis.plot(time[chosen], factor * values[chosen], color=BLUE, linewidth=0.9 if cycles > 60.0 else 1.4)
    quantity_of = {"N": "force", "1": "factor"}.get(unit, "acceleration")
    label_axes(axis, "time (s)", f"{quantity_of} ({label_unit})", f"{title}: largest {unit_text(largest, unit)}")
