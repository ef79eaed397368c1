"""Figures over frequency: spectra, transfer functions and shock response spectra, on the axes of the trade."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import instance, optional, quantity, require, suggestion, takes, truth
from femimpact.excitation.excitation import is_force
from femimpact.figures.drawing import (
    BLUE,
    COLOURS,
    GREY,
    OffScreen,
    by_label,
    label_axes,
    legend_above,
    panel,
    panels,
    plain_log_ticks,
    require_history,
)
from femimpact.response.channels import channel_key
from femimpact.response.response import Response
from femimpact.signals.densities import Spectrum
from femimpact.signals.densities import spectrum as spectrum_of
from femimpact.signals.shock_response import ShockResponseSpectrum
from femimpact.signals.transfer import TransferFunction
from femimpact.structure.structure import Position
from femimpact.units import GRAVITY, name_words, number_text, prefixed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

STYLES = [{"color": colour, "linestyle": line} for line in ("-", "--", "-.") for colour in COLOURS]
"""Of curves in their order: beyond the colours in dashes."""

DECADES = 1e-6
"""Share of the largest value that the axis of a spectrum reaches down to."""


@takes(response=instance(Response, Spectrum), highest=optional(quantity("Hz", above=0.0)))
def spectrum(
    response: Response | Spectrum,
    channel: str | float | None = None,
    highest: float | None = None,
    ax: Axes | OffScreen | None = None,
) -> Axes:
    """Spectrum of a channel: what `femimpact.spectrum` returns, a density with its interval, or amplitudes.

    A density is drawn on logarithmic axes, an acceleration's in g^2/Hz. Amplitudes of a run stand over a linear axis
    with the frequency of what drives.

    Parameters
    ----------
    response : Response or Spectrum
        Of a run the spectrum by default.
    channel : str or float, optional
        Of a run; the first one recorded by default.
    highest : float, Hz, optional
        End of the axis. By default of a run's amplitudes the lower of 20 base frequencies and half the sampling rate,
        of its density 1.5 times the frequency of the excitation, of a spectrum its last line.
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Raises
    ------
    InputError
        If the run holds no history, no such channel, or not one base cycle in its last third.
    """
    if isinstance(response, Spectrum):
        require(channel is None, "channel", channel, "", "must be left out: a spectrum is of one")
        psd, base = response, None
    else:
        require_history(response)
        psd, base = spectrum_of(response, channel), response.base
    axis = panel(ax, 8.0, 4.4)
    if psd.kind == "amplitude":
        return _amplitudes(axis, psd, base, highest)
    if highest is None:
        highest = psd.frequency[-1] if base is None else min(1.5 * base.frequency, psd.frequency[-1])
    psd = psd.in_gravity()
    band = (psd.frequency > 0.0) & (psd.frequency <= highest)
    require(bool(band.any()), "highest", highest, "Hz", f"must be the lowest line or more, {psd.resolution:.4g} Hz")
    root = psd.unit.removesuffix("^2/Hz").strip("()")
    label = f"{psd.channel}, rms {np.sqrt(psd.mean_square):.4g} {root}"
    colour = COLOURS[len(axis.get_lines()) % len(COLOURS)]
    f, low, high = psd.frequency[band], psd.low[band], psd.high[band]
    axis.fill_between(f, low, high, color=colour, alpha=0.2, linewidth=0.0)
    axis.plot(f, psd.values[band], color=colour, linewidth=1.2, label=label)
    axis.set(xscale="log", xlim=(f[0], highest))
    if high.max() > 0.0:
        # of a channel at rest there is no logarithm
        axis.set(yscale="log", ylim=(max(0.5 * float(low.min()), DECADES * float(high.max())), None))
    plain_log_ticks(axis.xaxis)
    title = f"lines {number_text(psd.resolution, 3)} Hz apart, Hann windows, band: {100 * psd.confidence:g} % interval"
    label = f"spectral density of {name_words(psd.channel)}, {psd.unit.replace('^2', '²')}"
    label_axes(axis, "frequency (Hz)", label, title)
    legend_above(axis)
    return axis


def _amplitudes(axis: Axes, lines: Spectrum, base: Any, highest: float | None) -> Axes:
    top = lines.frequency[-1] if base is None else min(20.0 * base.frequency, lines.frequency[-1])
    top = top if highest is None else highest
    band = lines.frequency <= top
    values = lines.values[band]
    factor, unit = prefixed(float(values.max()), lines.unit)
    title = f"lines {number_text(lines.resolution, 3)} Hz apart, Hann window"
    if base is not None:
        driven = "drives" if hasattr(base, "drives") else "force" if is_force(base) else "base"
        axis.axvline(
            base.frequency, color=GREY, linestyle="--", linewidth=1.2, label=f"{driven}, {base.frequency:.4g} Hz"
        )
        title = f"last {round(base.frequency / lines.resolution)} cycles, {title}"
        if base.amplitude == 0.0 and not is_force(base):
            title += "\nof a free decay fi.spectrum(run, start=0.0) takes all"
    axis.plot(lines.frequency[band], factor * values, color=BLUE, linewidth=1.2, label=lines.channel)
    if values.any():
        # of a channel at rest there is no logarithm
        axis.set(yscale="log", ylim=(factor * max(float(values.max()) * DECADES, float(values.min())), None))
    axis.set_xlim(0.0, top)
    label_axes(axis, "frequency (Hz)", f"amplitude of {name_words(lines.channel)} ({unit})", title)
    legend_above(axis)
    return axis


def transfer_function(
    transfers: TransferFunction | Mapping[str, TransferFunction],
    channel: Position | None = None,
    figure: FigureBase | OffScreen | None = None,
) -> NDArray[np.object_]:
    """Magnitude in dB and phase of transfer functions over a logarithmic frequency; coherence of measured ones.

    Parameters
    ----------
    transfers : TransferFunction or mapping of str to TransferFunction
        By label; of one input and one unit.
    channel : str or float, optional
        The output; the first one by default.
    figure : Figure, optional
        Drawn on; a new one of pyplot's by default.

    Returns
    -------
    ndarray (2,) or (3,) of Axes

    Raises
    ------
    InputError
        If there is no transfer function, none of this output, or inputs or units differ.
    """
    named = by_label("transfers", transfers, TransferFunction, "transfer functions")
    first = next(iter(named.values()))
    name = next(iter(first.values)) if channel is None else channel_key(channel)
    unit = first.units.get(name)
    for label, transfer in named.items():
        require(name in transfer.values, "channel", name, "", suggestion(name, transfer.values))
        same = transfer.of == first.of and transfer.units[name] == unit
        allowed = f"must be over {first.of} in {unit}, as the first one: they share an axis"
        require(same, f"transfers.{label}", f"over {transfer.of}", transfer.units[name], allowed)
    coherent = any(np.any(np.isfinite(transfer.coherence.get(name, np.nan))) for transfer in named.values())
    axes = panels(figure, 8.0, 7.0 if coherent else 5.6, 3 if coherent else 2, 1, sharex=True)[:, 0]
    for drawn, (label, transfer) in zip(cycle(STYLES), named.items(), strict=False):
        # the dwells of a sweep up and down stand in their order in time
        order = np.argsort(transfer.frequency, kind="stable")
        f, values = transfer.frequency[order], transfer.values[name][order]
        style: Any = {**drawn, "linewidth": 1.2, "marker": "." if f.size < 60 else None}
        with np.errstate(divide="ignore"):
            axes[0].semilogx(f, 20.0 * np.log10(np.abs(values)), label=label or name, **style)
        axes[1].semilogx(f, np.degrees(np.angle(values)), **style)
        if coherent and name in transfer.coherence:
            axes[2].semilogx(f, transfer.coherence[name][order], **style)
    # in two rows: a unit of both is longer than the panel
    magnitude = "magnitude (dB re 1)" if unit == "1" else f"magnitude\n(dB re 1 {unit})"
    label_axes(axes[0], "", magnitude, f"{name} over {first.of}")
    label_axes(axes[1], "", "phase (degrees)")
    axes[1].set(ylim=(-185.0, 185.0), yticks=[-180, -90, 0, 90, 180])
    if coherent:
        axes[2].set(ylim=(0.0, 1.05), ylabel="coherence")
    axes[-1].set_xlabel("frequency (Hz)")
    plain_log_ticks(axes[-1].xaxis)
    legend_above(axes[0])
    return axes


@takes(pseudo_velocity=truth())
def shock_response_spectrum(
    spectra: ShockResponseSpectrum | Mapping[str, ShockResponseSpectrum],
    *,
    pseudo_velocity: bool = False,
    ax: Axes | OffScreen | None = None,
) -> Axes:
    """Maxi-max of shock response spectra on logarithmic axes, and both directions of a single one.

    Parameters
    ----------
    spectra : ShockResponseSpectrum or mapping of str to ShockResponseSpectrum
        By label.
    pseudo_velocity : bool
        Draw the pseudo velocity (m/s) in place of the absolute acceleration (g).
    ax : Axes, optional
        Drawn on; those of a new pyplot figure by default.

    Raises
    ------
    InputError
        If there is no spectrum.
    """
    named = by_label("spectra", spectra, ShockResponseSpectrum, "shock response spectra")
    axis = panel(ax, 8.0, 4.8)
    read, factor, unit = ("pseudo_velocity", 1.0, "m/s") if pseudo_velocity else ("acceleration", 1.0 / GRAVITY, "g")
    for drawn, (label, srs) in zip(cycle(STYLES), named.items(), strict=False):
        axis.loglog(srs.frequency, factor * getattr(srs, read), **drawn, label=label or "maxi-max")
        if len(named) == 1:
            for side, style in (("positive", "--"), ("negative", ":")):
                values = factor * getattr(srs, f"{side}_{read}")
                axis.loglog(srs.frequency, np.where(values > 0.0, values, np.nan), style, color=GREY, label=side)
    ratios = sorted({srs.ratio for srs in named.values()})
    title = f"shock response, damping ratio {', '.join(f'{ratio:g}' for ratio in ratios)}"
    quantity_of = "pseudo velocity" if pseudo_velocity else "absolute acceleration"
    label_axes(axis, "natural frequency (Hz)", f"{quantity_of} ({unit})", title)
    for one_axis in (axis.xaxis, axis.yaxis):
        plain_log_ticks(one_axis)
    legend_above(axis)
    return axis
