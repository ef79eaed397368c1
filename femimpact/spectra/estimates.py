"""Transfer functions measured from the recorded channels of a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from femimpact.arrays import Array, Complex
from femimpact.errors import optional, quantity, require, require_name, takes
from femimpact.excitation import Chirp, Drives, HammerBlow, RandomBase, Shock, SteppedSine
from femimpact.excitation.excitation import has_cycle
from femimpact.integrators.channel_rows import Drive
from femimpact.response.channels import channel_key
from femimpact.response.response import Response
from femimpact.spectra.densities import (
    MODES,
    RUN,
    Record,
    drive_history,
    modes_of,
    record_of,
    width_warnings,
    windows_of,
)
from femimpact.spectra.transfer import INPUTS, TransferFunction, unit_over
from femimpact.structure.structure import Position

DECAYED = 1e-3
"""Share of its largest value to which a channel has decayed at the end of a record that is transformed whole."""

CONTENT = 1e-4
"""Share of the largest density of an input, below which it has no content at a line."""

FINER, MOST_FINE = 16, 4_000_000
"""Samples of a drive between two readings where it is transformed whole, and at most in all: a blow has few of them."""

STEADY = 0.01
"""Relative difference of the harmonics of the two halves of a dwell beyond which it is not steady."""


@takes(response=RUN, resolution=optional(quantity("Hz", above=0.0)))
def measured_transfer(
    response: Response, to: Position, of: Position | None = None, *, resolution: float | None = None
) -> TransferFunction:
    """Transfer function of a run from its recorded channel and its drive, as a test bench measures it.

    - A chirp, a shock or a hammer's blow: one transform of the whole record, which must have decayed at its end. With
      one record both estimates are one, and there is no coherence.
    - A stepped sine: the harmonics over the second half of the cycles of each dwell, a sine that of the last third of
      the run. Coherence is the share of the harmonic in the mean square.
    - Any other drive: averages over Hann windows that overlap by half. H1 = S_xy/S_xx has no error by noise in the
      output, H2 = S_yy/S_yx none by noise in the input; coherence is |S_xy|^2/(S_xx S_yy).

    Lines at which the input has no content are left out. With impacts it is a linear description of the run at its
    level, which the coherence judges.

    Parameters
    ----------
    response : Response
    to : str or float
        Output, a recorded channel; an acceleration beside rigid contacts is taken from the velocity.
    of : str or float, optional
        Input: "base.displacement", "base.velocity", "base.acceleration", "force" of a run that a force drives, or a
        recorded channel. By default the base's acceleration, or the force.
    resolution : float, Hz, optional
        Distance of the lines of averages; by default that of 15 windows.

    Returns
    -------
    TransferFunction

    Raises
    ------
    InputError
        As of `spectrum`; if a record that is transformed whole has not decayed, or no dwell is complete.

    Examples
    --------
    >>> import femimpact as fi
    >>> motion = fi.RandomBase([(2.0, 0.1), (20.0, 0.1)], duration=20.0)
    >>> run = fi.integrate(fi.without_impactors(system), motion, fi.EventDriven(), 20.0)
    >>> fi.measured_transfer(run, "tip", "base.acceleration").units["tip"]
    'm/(m/s^2)'
    """
    several = isinstance(response.base, Drives)
    require(not several, "response", "several drives at once", "", "must be a run under one drive")
    output, history = record_of(response, to, key="to"), drive_history(response)
    of, unit, given, integrals = _input(response, of)
    x = given(output.time)
    if isinstance(history, SteppedSine) or (has_cycle(response.base) and not math.isnan(response.base.phase)):
        f, h1, coherence, warnings = _by_dwells(response, output, x)
        h2 = h1
    elif isinstance(history, Chirp | HammerBlow | Shock):
        f, h1, warnings = _by_one_transform(response, output, given)
        h2, coherence = h1, np.full(f.size, np.nan)
    else:
        f, h1, h2, coherence, warnings = _by_averages(response, output, x, resolution)
    factor = (2j * np.pi * f) ** (output.derivatives + integrals)
    name = output.name
    return TransferFunction(
        f, {name: h1 * factor}, {name: unit_over(output.unit, unit)}, str(of), {name: h2 * factor}, {name: coherence},
        output.notes, (*output.warnings, *warnings),
    )  # fmt: skip


def _input(response: Response, of: Position | None) -> tuple[str, str, Callable[[Array], Array], int]:
    """Name and unit of the input, its history, and how often that is to be integrated (less, for a derivative)."""
    at = getattr(response.base, "at", None)
    own = "base.acceleration" if at is None else "force"
    name = own if of is None else channel_key(of, "of")
    if name not in {*INPUTS, "force"}:
        require_name(name, (*response.channels, *(INPUTS if at is None else ("force",))), "of")
        record = record_of(response, name, key="of")
        return name, record.unit, lambda time: np.interp(time, record.time, record.values), -record.derivatives
    allowed = f"must be {'a motion of the base' if at is None else 'the force that drives'}, or a recorded channel"
    require((name == "force") == (at is not None), "of", name, "", allowed)
    base: Any = response.base
    values = base.acceleration if at is None else base.force
    drive = Drive(np.zeros(0), float(at is None), 1.0, values, getattr(base, "closed_form", None), at)
    unit, integrals = INPUTS.get(name, ("N", 0))
    # jumps have the impulses that the samples give them
    return name, unit, drive.value_at_steps, integrals


Found = tuple[Array, Complex, Complex, Array, tuple[str, ...]]


def _by_averages(response: Response, output: Record, given: Array, resolution: float | None) -> Found:
    from scipy.signal import csd

    window, segments = windows_of(output, resolution)
    require(segments >= 2, "resolution", resolution, "Hz", "must leave two windows or more, for a coherence")
    rate = 1.0 / output.interval
    # the mean of all, for that of each window would be seen at the lowest lines
    x, y = given - given.mean(), output.values - output.values.mean()
    f, across = csd(x, y, rate, nperseg=window, detrend=False)
    own, other = (csd(one, one, rate, nperseg=window, detrend=False)[1].real for one in (x, y))
    kept = (f > 0.0) & (own > CONTENT * own.max())
    history = drive_history(response)
    if isinstance(history, RandomBase):
        kept &= (f >= history.psd[0][0]) & (f <= history.psd[-1][0])
    require(bool(np.any(kept)), "of", None, "", "must not be zero all the time")
    # of an output that is zero there is no second estimate
    with np.errstate(divide="ignore", invalid="ignore"):
        h1, h2 = across / own, other / np.conj(across)
        coherence = np.abs(across) ** 2 / (own * other)
    warnings = width_warnings(response, float(f[1]), float(f[kept][-1]))
    return f[kept], h1[kept], h2[kept], coherence[kept], warnings


def _by_one_transform(
    response: Response, output: Record, given: Callable[[Array], Array]
) -> tuple[Array, Complex, tuple[str, ...]]:
    count, history = output.time.size, drive_history(response)
    end = max(count // 50, 2)
    level = output.values - output.values[-end:].mean()
    finer = max(min(FINER, MOST_FINE // count), 1)
    x = given(output.time[0] + output.interval / finer * np.arange(count * finer))
    for name, values, last in ((output.name, level, end), ("the input", x, end * finer)):
        largest, left = float(np.abs(values).max()), float(np.abs(values[-last:]).max())
        share = left / largest if largest > 0.0 else 0.0
        if share > DECAYED:
            allowed = f"must end when {name} is at {100 * DECAYED:g} % of its largest, and it is at {100 * share:.2g} %"
            last_time = float(f"{output.time[-1]:.6g}")
            require(False, "response.time", last_time, "s", allowed + _until(response, values))
    f = np.fft.rfftfreq(count, output.interval)
    own = np.fft.rfft(x)[: f.size] / finer
    kept = (f > 0.0) & (np.abs(own) ** 2 > CONTENT * np.max(np.abs(own) ** 2))
    if isinstance(history, Chirp):
        kept &= (f >= min(history.start, history.stop)) & (f <= max(history.start, history.stop))
    require(bool(np.any(kept)), "of", None, "", "must not be zero all the time")
    return f[kept], np.fft.rfft(level)[kept] / own[kept], ()


def _until(
    response: Response,
    values: Array,  # (n,) evenly over the run
) -> str:
    """How much longer a run has to be for its slowest mode to decay."""
    frequency, ratio = modes_of(response.system, MODES)
    rates = 2.0 * np.pi * ratio * frequency
    if not rates.size or not rates.min() > 0.0:
        return ""
    slowest, end = int(np.argmin(rates)), float(response.time[-1])
    # over a period: the mean of less hides a part of the motion
    late = values[-math.ceil(values.size * min(max(1.0 / frequency[slowest] / end, 0.02), 1.0)) :]
    share = float(np.abs(late - late.mean()).max() / np.abs(values).max())
    more = max(math.log(share / DECAYED), 0.0) / rates[slowest]
    # the end is the last 2 %
    return f": its slowest mode takes {more:.3g} s more, response.time = {1.01 * (end + more / 0.98):.3g} s"


def _by_dwells(response: Response, output: Record, given: Array) -> tuple[Array, Complex, Array, tuple[str, ...]]:
    history, time = drive_history(response), output.time
    if isinstance(history, SteppedSine):
        ends = np.cumsum(history.cycles_of_steps / history.steps)
        cycles = np.maximum(history.cycles_of_steps // 2, 1)
        steps = history.steps
    else:
        steps, ends = np.array([response.base.frequency]), np.array([time[-1]])
        cycles = np.floor((ends - max(response.window[0], float(time[0]))) * steps + 1e-9).astype(int)
    near = 1e-6 * output.interval
    found, unsteady = [], 0
    for f, end, many in zip(steps, ends, cycles, strict=True):
        begin = end - many / f
        if many < 1 or begin < time[0] - near or end > time[-1] + output.interval:
            continue
        inside = (time >= begin - near) & (time < end - near)
        require(int(np.count_nonzero(inside)) >= 8, "interval of response.time", output.interval, "s",
                f"must leave 8 readings or more in a dwell at {f:.4g} Hz")  # fmt: skip
        y, x = (_harmonic(time[inside], values[inside], f) for values in (output.values, given))
        found.append((f, y[0] / x[0], y[1]))
        middle = begin + (many // 2) / f
        early, late = (inside & (time < middle - near)), (inside & (time >= middle - near))
        if many > 1 and min(np.count_nonzero(early), np.count_nonzero(late)) >= 8:
            first, second = (_harmonic(time[half], output.values[half], f)[0] for half in (early, late))
            unsteady += abs(first - second) > STEADY * abs(second)
    require(bool(found), "response.time", float(time[-1]), "s", "must hold a complete dwell")
    warnings = (f"{unsteady} of {len(found)} dwells are not steady to {100 * STEADY:g} %: take more cycles",)
    columns = [np.array(column) for column in zip(*found, strict=True)]
    return columns[0], columns[1], columns[2], warnings if unsteady else ()


def _harmonic(time: Array, values: Array, frequency: float) -> tuple[complex, float]:
    """Complex amplitude at a frequency (Hz) beside a constant, and its share in the mean square."""
    angle = 2.0 * np.pi * frequency * time
    design = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    found = np.linalg.lstsq(design, values)[0]
    rest, whole = values - design @ found, values - values.mean()
    total = float(whole @ whole)
    return complex(found[0], -found[1]), 1.0 - float(rest @ rest) / total if total > 0.0 else 1.0
