"""Figures over time: the motion between its walls, the energies, the contact force; and spectra."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.contact.laws import Rigid
from femimpact.errors import Fault, InputError, column, instance, optional, quantity, require, takes, truth
from femimpact.excitation.excitation import has_cycle, is_force, words_of
from femimpact.export.figures.drawing import (
    BLUE,
    COLOURS,
    CYCLES,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    WALLS,
    OffScreen,
    channel_name,
    label_axes,
    last_cycles,
    legend_above,
    panel,
    panels,
    prefixed,
    require_history,
    scaled,
)
from femimpact.response.response import Response

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase


LEAST_WINDOWS = 16
"""Half windows of a spectral density."""


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
    stored = (
        ("beam: kinetic + strain", ledger.kinetic + ledger.strain, COLOURS[0]),
        ("balls", ledger.ball, ORANGE),
        ("contacts", ledger.contact, GREEN),
    )
    since = (
        ("work put in", ledger.work, "black"),
        ("stored", ledger.stored - ledger.stored[0], GREY),
        ("lost in the structure", ledger.structure_loss, COLOURS[0]),
        ("lost in the contacts", ledger.contact_loss, ORANGE),
    )
    for axis, rows in ((axes[0], stored), (axes[1], since)):
        largest = max(float(np.abs(values).max()) for _, values, _ in rows)
        factor, unit = prefixed(largest, "J")
        for label, values, colour in rows:
            axis.plot(ledger.time, factor * values, color=colour, linewidth=1.2, label=label)
        axis.set_ylabel(f"energy ({unit})")
        legend_above(axis)
    axes[2].plot(ledger.time, ledger.residual_history, color=PURPLE, linewidth=1.2)
    title = f"energy unaccounted for over the energy put in: at most {ledger.residual:.2g}"
    label_axes(axes[2], "time (s)", "residual (1)", title)
    return axes


# ---- spectrum -------------------------------------------------------------------------------------


@takes(time=column("s", "samples", finite=True), values=column("", "samples", finite=True))
def amplitude_spectrum(time: Array, values: Array) -> tuple[Array, Array]:
    """Single-sided amplitudes of a history under a Hann window.

    A sine of amplitude A whose periods fill the history reads A.

    Parameters
    ----------
    time : ndarray (n,), s
        Ascending; samples that are not evenly spaced are read from the straight lines between them.
    values : ndarray (n,)

    Returns
    -------
    frequency : ndarray (n // 2 + 1,), Hz
    amplitude : ndarray (n // 2 + 1,), as the values

    Raises
    ------
    InputError
        If these are not as many finite numbers, two or more, or the times do not ascend.
    """
    ascending = time.size >= 2 and bool(np.all(np.diff(time) > 0.0))
    require(ascending, "time", f"{time.size} samples", "", "must be two or more ascending times")
    even = np.linspace(time[0], time[-1], time.size)
    window = np.hanning(time.size + 1)[:-1]
    lines = np.abs(np.fft.rfft(np.interp(even, time, values) * window)) / window.sum()
    # of every line but the mean and the last of an even count there are two, at +f and -f
    lines[1 : (time.size + 1) // 2] *= 2.0
    return np.fft.rfftfreq(time.size, even[1] - even[0]), lines


@takes(response=instance(Response), highest=optional(quantity("Hz", above=0.0)))
def spectrum(
    response: Response,
    channel: str | float | None = None,
    highest: float | None = None,
    ax: Axes | OffScreen | None = None,
) -> Axes:
    """Amplitude spectrum of a channel over complete base cycles in the last third of a run; else a spectral density.

    Where the excitation has no cycle, or is a record, the one-sided spectral density over the run is drawn, by
    the averages of Hann windows that overlap by half (Welch), and no frequency of the base.

    Parameters
    ----------
    response : Response
    channel : str or float, optional
        The first one recorded by default.
    highest : float, Hz, optional
        End of the axis; the lower of 20 base frequencies and half the sampling rate by default.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If the run holds no history, no such channel, or not one base cycle in its last third.
    """
    require_history(response)
    name = channel_name(response, channel)
    # of a record, which has no phase either, the frequency of a cycle is only that of its largest line
    if not has_cycle(response.base) or math.isnan(response.base.phase):
        return _density(response, name, highest, ax)
    values, base = response[name], response.base.frequency
    start, end = max(response.window[0], float(response.time[0])), float(response.time[-1])
    cycles = int((end - start) * base + 1e-9)
    require(cycles >= 1, "response.time", end - start, "s", f"must hold a base cycle, {1.0 / base:.3g} s, in its end")
    # the sample at the end of the last cycle would be the first of the next
    inside = (response.time >= end - cycles / base * (1.0 + 1e-9)) & (response.time < end)
    frequency, amplitude = amplitude_spectrum(response.time[inside], values[inside])
    top = min(20.0 * base, frequency[-1]) if highest is None else highest
    shown = frequency <= top
    axis = panel(ax, 8.0, 4.4)
    largest = float(amplitude[shown].max())
    driven = "base" if not is_force(response.base) else "force"
    if hasattr(response.base, "drives"):
        driven = "drives"
    factor, unit = prefixed(largest, response.units[name])
    axis.axvline(base, color=GREY, linestyle="--", linewidth=1.2, label=f"{driven}, {base:.4g} Hz")
    axis.semilogy(frequency[shown], factor * amplitude[shown], color=BLUE, linewidth=1.2, label=name)
    axis.set_ylim(bottom=max(factor * largest * 1e-6, float((factor * amplitude[shown]).min()) or 1e-300))
    axis.set_xlim(0.0, top)
    title = f"last {cycles} cycles, lines {base / cycles:.3g} Hz apart, Hann window"
    label_axes(axis, "frequency (Hz)", f"amplitude of {name.replace('_', ' ')} ({unit})", title)
    legend_above(axis)
    return axis


def _density(response: Response, name: str, highest: float | None, ax: Axes | OffScreen | None) -> Axes:
    """One-sided spectral density of a channel over a run."""
    from scipy.signal import welch

    time, values = response.time, response[name]
    require(time.size >= LEAST_WINDOWS, "response.time", time.size, "", f"must hold {LEAST_WINDOWS} or more samples")
    frequency, density = welch(values, (time.size - 1) / (time[-1] - time[0]), nperseg=2 * time.size // LEAST_WINDOWS)
    top = min(1.5 * response.base.frequency, float(frequency[-1])) if highest is None else highest
    shown = (frequency > 0.0) & (frequency <= top)
    axis = panel(ax, 8.0, 4.4)
    rms = float(np.sqrt(np.mean(values**2)))
    label = f"{name}, rms {rms:.4g} {response.units[name]}"
    colour = COLOURS[len(axis.get_lines()) % len(COLOURS)]
    axis.semilogy(frequency[shown], density[shown], color=colour, linewidth=1.2, label=label)
    axis.set_xlim(0.0, top)
    unit = response.units[name].replace("^2", "²")
    # brackets only where the square would be read as that of a part of the unit
    squared = f"{unit}²" if unit.isalpha() else f"({unit})²"
    label = f"spectral density of {name.replace('_', ' ')}, {squared}/Hz"
    label_axes(axis, "frequency (Hz)", label, f"lines {frequency[1]:.3g} Hz apart, Hann windows")
    legend_above(axis)
    return axis


# ---- contact force --------------------------------------------------------------------------------


@takes(response=instance(Response))
def cycle_averaged_force(response: Response) -> tuple[Array, Array]:
    """Normal force between balls, stops and beam, averaged over each complete base cycle of a run.

    The average of a cycle is the sum of the impulses of the impacts that touch in it, and of the sticking phases
    by the time that they share with it, times the base's frequency.

    Parameters
    ----------
    response : Response

    Returns
    -------
    time : ndarray (cycles,), s
        Middle of each cycle.
    force : ndarray (cycles,), N

    Raises
    ------
    InputError
        If its excitation has no cycle.
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
    for side, colour, _, label in WALLS:
        chosen = impacts.side == side
        axes[1].plot(impacts.time[chosen], impacts.peak_force[chosen], "o", markersize=3.0, color=colour, label=label)
    title = "peak of each impact; "
    if averaged:
        _averages(axes[2], response)
        axes[1].set_xlim(axes[2].get_xlim())
    else:
        axes[1].axhline(statistics.cycle_mean_force, color=GREY, linestyle="--", linewidth=1.2)
        mean = "cycle-averaged" if cyclic else "mean"
        title += f"dashed: {mean} force {1e3 * statistics.cycle_mean_force:.3g} mN;\n"
    title += f"mean impulse {1e3 * statistics.mean_impulse:.3g} mN s"
    label_axes(axes[1], "time (s)", "peak force (N)", title)
    axes[1].set_ylim(0.0, 1.05 * (np.nanmax(impacts.peak_force, initial=0.0) or 1.0))
    legend_above(axes[1])
    return axes


def _last_cycles(axis: Any, response: Response, names: list[str], cycles: float) -> None:
    start, words = last_cycles(response, cycles)
    last, laws = response.time >= start, response.impacts.law
    for colour, name in zip(COLOURS, names, strict=False):
        owner = name.rpartition(".")[0]
        label = f"{owner} (rigid: force only while sticking)" if laws.get(owner) == Rigid.name else owner or None
        axis.plot(response.time[last], response[name][last], color=colour, label=label)
    label_axes(axis, "time (s)", "force on the beam (N)", f"{words}, law: {response.statistics.law}")
    if len(names) > 1:
        legend_above(axis)


def _averages(axis: Any, response: Response) -> None:
    time, force = cycle_averaged_force(response)
    shown, unit = scaled(force, "N")
    mean, mean_unit = scaled(response.statistics.cycle_mean_force, "N")
    axis.plot(time, shown, color=BLUE, linewidth=1.0, marker=".", markersize=4.0)
    axis.set_ylim(0.0, 1.15 * (shown.max(initial=0.0) or 1.0))
    title = f"normal force averaged over each base cycle; over the last third {mean:.3g} {mean_unit}"
    label_axes(axis, "time (s)", f"average force ({unit})", title)
