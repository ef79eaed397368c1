"""Transfer functions measured from the recorded channels of a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from femimpact.arrays import Array, Complex
from femimpact.errors import optional, quantity, require, require_name, takes, warns
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import Drives, HammerBlow, named_parts
from femimpact.excitation.excitation import LineLoad, is_force
from femimpact.excitation.harmonic import SteppedSine
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial
from femimpact.excitation.random_base import RandomBase
from femimpact.excitation.shock import Shock
from femimpact.integrators.channel_rows import Drive
from femimpact.response.channels import channel_key
from femimpact.response.response import Response
from femimpact.signals.densities import (
    EVEN,
    MODES,
    RUN,
    Record,
    drive_history,
    is_steady,
    modes_of,
    record_of,
    width_warnings,
    windows_of,
)
from femimpact.signals.transfer import INPUTS, TransferFunction, force_name, unit_over
from femimpact.structure.structure import Position
from femimpact.units import number_text

DECAYED = 1e-3
"""Share of its largest value to which a channel has decayed at the end of a record that is transformed whole."""

CONTENT = 1e-4
"""Share of the largest density of an input, below which it has no content at a line."""

FINER, MOST_FINE = 16, 4_000_000
"""Samples of a chirp between two readings, and at most in all: its pieces are too many for a transform of each."""

ALIASED = 0.02
"""Share of a line by which half the reading rate may change it: at the full rate it is then off by less."""

MOST_PAIRS = 2_000_000_000
"""Most pairs of a point of a drive and a line: half a minute."""

STEADY = 0.01
"""Relative difference of the harmonics of the two halves of a dwell beyond which it is not steady."""


@warns
@takes(response=RUN, resolution=optional(quantity("Hz", above=0.0)))
def measured_transfer(
    response: Response, to: Position, of: Position | None = None, *, resolution: float | None = None
) -> TransferFunction:
    """Transfer function of a run from its recorded channel and its drive, as a test bench measures it.

    - A chirp, a shock or a hammer's blow: one transform of the whole record, which must begin at rest, with the run,
      and have decayed at its end. That of the force of a blow or of a shock is exact, however short it is. A relative
      velocity or acceleration is taken from the displacement or the velocity, where these are recorded, whose lines
      have fewer aliases. With one record both estimates are one, and there is no coherence.
    - A stepped sine: the harmonics over the second half of the cycles of each dwell, a sine that of the last third of
      the run. Coherence is the share of the harmonic in the mean square.
    - A random motion, a record, or a sum of these and of sines: averages over Hann windows that overlap by half.
      H1 = S_xy/S_xx has no error by noise in the output, H2 = S_yy/S_yx none by noise in the input; coherence is
      |S_xy|^2/(S_xx S_yy).

    Lines at which the input has no content are left out, and of a blow or a shock those above a quarter of the reading
    rate and those that aliases spoil by more than about 2 %. With impacts it is a linear description of the run at its
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

    Raises
    ------
    InputError
        As of `spectrum`; if a sum has a part that passes, as a chirp, a stepped sine or a shock, a record that is
        transformed whole does not begin at rest or has not decayed, the input is zero, no dwell is complete, or a
        resolution is given to what is no average.

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
    history = drive_history(response)
    dwells = isinstance(history, SteppedSine) or is_steady(response.base)
    whole = not dwells and isinstance(history, Chirp | HammerBlow | Shock)
    if not (dwells or whole):
        _require_stationary(response.base)
    allowed = "must be left out: it belongs to averages over windows, as of a random drive"
    require(resolution is None or not (dwells or whole), "resolution", resolution, "Hz", allowed)
    output = record_of(response, to, key="to", whole=whole)
    drive = _input(response, of, whole)
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    if dwells:
        f, h1, coherence, warnings = _by_dwells(response, output, drive.values(output.time))
        h2 = h1
    elif whole:
        f, h1, notes = _by_one_transform(response, output, drive)
        h2, coherence = h1, np.full(f.size, np.nan)
    else:
        f, h1, h2, coherence, warnings = _by_averages(response, output, drive.values(output.time), resolution)
    factor = (2j * np.pi * f) ** (output.derivatives + drive.integrals)
    name = output.name
    return TransferFunction(
        f, {name: h1 * factor}, {name: unit_over(output.unit, drive.unit)}, drive.name, {name: h2 * factor},
        {name: coherence}, (*output.notes, *notes), (*output.warnings, *warnings),
    )  # fmt: skip


def _require_stationary(excitation: Any) -> None:
    """Refuse a sum with a part that is not stationary: its response may fall into a window after it."""
    for which, _, part in named_parts(excitation):
        allowed = (
            "must be a sine, a random motion or a record: averages over windows take no transient beside another "
            "drive; a run under it alone is transformed whole"
        )
        transient = isinstance(part, Chirp | HammerBlow | Shock | SteppedSine)
        require(not transient, "response", f"{which}, {type(part).__name__}", "", allowed)


class Input(NamedTuple):
    """What a response is set in proportion to."""

    name: str
    unit: str
    values: Callable[[Array], Array]  # at times in s
    integrals: int  # how often it is to be integrated to be the input; less than zero, differentiated
    pieces: PiecewisePolynomial | None  # its closed form, where it is the drive and made of pieces


def _input(response: Response, of: Position | None, whole: bool) -> Input:
    force = is_force(response.base)
    own = "force" if force else "base.acceleration"
    name = own if of is None else channel_key(of, "of")
    if name not in {*INPUTS, "force"}:
        require_name(name, (*response.channels, *(("force",) if force else INPUTS)), "of")
        record = record_of(response, name, key="of", whole=whole)
        return Input(
            name, record.unit, lambda time: np.interp(time, record.time, record.values), -record.derivatives, None
        )
    allowed = f"must be {'the force that drives' if force else 'a motion of the base'}, or a recorded channel"
    require((name == "force") == force, "of", name, "", allowed)
    base: Any = response.base
    at: Any = base.at if force else None
    values = base.force if force else base.acceleration
    drive = Drive(np.zeros(0), float(not force), 1.0, values, getattr(base, "closed_form", None), at)
    unit, integrals = INPUTS.get(name, ("1" if isinstance(at, LineLoad) else "N", 0))
    # jumps have the impulses that the samples give them
    return Input(force_name(at) if force else name, unit, drive.value_at_steps, integrals, drive.pieces)


Found = tuple[Array, Complex, Complex, Array, tuple[str, ...]]


def _by_averages(response: Response, output: Record, drive: Array, resolution: float | None) -> Found:
    from scipy.signal import csd

    window, segments = windows_of(output, resolution)
    require(segments >= 2, "resolution", resolution, "Hz", "must leave two windows or more, for a coherence")
    rate = 1.0 / output.interval
    # the mean of all, for that of each window would be seen at the lowest lines
    x, y = drive - drive.mean(), output.values - output.values.mean()
    f, across = csd(x, y, rate, nperseg=window, detrend=False)
    own, other = (csd(signal, signal, rate, nperseg=window, detrend=False)[1].real for signal in (x, y))
    has_content = (f > 0.0) & (own > CONTENT * own.max())
    history = drive_history(response)
    if isinstance(history, RandomBase):
        has_content &= (f >= history.psd[0][0]) & (f <= history.psd[-1][0])
    require(bool(np.any(has_content)), "of", None, "", "must not be zero all the time")
    # of an output that is zero there is no second estimate
    with np.errstate(divide="ignore", invalid="ignore"):
        h1, h2 = across / own, other / np.conj(across)
        coherence = np.abs(across) ** 2 / (own * other)
    warnings = width_warnings(response, float(f[1]), float(f[has_content][-1]))
    return f[has_content], h1[has_content], h2[has_content], coherence[has_content], warnings


def _by_one_transform(response: Response, output: Record, drive: Input) -> tuple[Array, Complex, tuple[str, ...]]:
    history, time, h, pieces = drive_history(response), output.time, output.interval, drive.pieces
    level = output.values - output.values[-max(time.size // 50, 2) :].mean()
    _require_whole(
        response, {output.name: level} | ({} if pieces else {drive.name: drive.values(time)}), output, pieces
    )
    f = np.asarray(np.fft.rfftfreq(time.size, h), dtype=float)
    y, chirp = np.fft.rfft(level) * h, isinstance(history, Chirp)
    if pieces is None or chirp:
        finer = 1 if pieces is None else max(min(FINER, MOST_FINE // time.size), 1)
        x = np.fft.rfft(drive.values(time[0] + h / finer * np.arange(time.size * finer)))[: f.size] * h / finer
    else:
        # above a quarter of the rate no line is kept
        x, low_lines = np.zeros(f.size, dtype=complex), f <= 0.25 / h
        x[low_lines] = _transform_of(pieces, f[low_lines], float(time[0]))
    # of an input that is read from its integral, the content is its own
    content = (np.abs(x) * f ** max(-drive.integrals, 0)) ** 2
    has_content = (f > 0.0) & (content > CONTENT * content.max())
    if chirp:
        low, high = sorted((history.start, history.stop))
        # above the second limit the end of the chirp has aliases
        has_content &= (f >= low) & (f <= min(high, 1.0 / h - high))
    require(bool(np.any(has_content)), "of", None, "", "must not be zero all the time")
    clean = has_content & (chirp | (f <= 0.25 / h))
    for lines in () if chirp else (y, x) if pieces is None else (y,):
        # every second sample alone would add the line mirrored at a quarter of the rate; one of them may be zero
        beyond = np.maximum.accumulate(np.abs(lines[::-1]))[::-1]
        clean &= np.interp(0.5 / h - f, f, beyond) <= ALIASED * np.abs(lines)
    if output.holds_drive and pieces is not None and not chirp:
        above, below = (np.abs(_transform_of(pieces, 1.0 / h + side * f, 0.0)) for side in (1.0, -1.0))
        clean &= above + below <= ALIASED * np.abs(x)
    allowed = "must be finer, or the displacement recorded beside an acceleration: aliases spoil all lines"
    require(bool(np.any(clean)), "interval of response.time", h, "s", allowed)
    left_out = np.count_nonzero(has_content & ~clean)
    notes = (f"{left_out} lines to {0.25 / h:.4g} Hz are left out for aliases: read finer",) if left_out else ()
    return f[clean], y[clean] / x[clean], notes


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
    last = number_text(1.01 * (end + more / 0.98), 3)
    return f": its slowest mode takes {number_text(more, 3)} s more, response.time = {last} s"


def _require_whole(
    response: Response, histories: dict[str, Array], output: Record, pieces: PiecewisePolynomial | None
) -> None:
    """Raise `InputError` unless a record goes from rest at the beginning of the run to the end of its motion."""
    time, begin = output.time, response.start
    allowed = f"must begin with the run, at {begin:g} s: leave Recorder.start out"
    require(time[0] - begin <= EVEN * output.interval, "response.time", float(time[0]), "s", allowed)
    if pieces is not None:
        is_complete = pieces.knots[0] >= begin - EVEN * output.interval and pieces.duration <= time[-1]
        allowed = (
            f"must hold all of the drive, {pieces.knots[0]:.4g} to {pieces.duration:.4g} s, and the decay after it"
        )
        require(is_complete, "response.time", f"{time[0]:.4g} to {time[-1]:.4g}", "s", allowed)
    # of energies the share is squared
    energy = None if response.energy is None else np.sqrt(np.abs(response.energy.kinetic))
    for name, values in (*histories.items(), *(() if energy is None else (("the velocity", energy),))):
        largest = float(np.abs(values).max()) or 1.0
        first, left = abs(float(values[0])) / largest, float(np.abs(values[-max(time.size // 50, 2) :]).max()) / largest
        if left > DECAYED and values is not energy:
            share = number_text(100 * left, 2)
            allowed = f"must end when {name} is at {100 * DECAYED:g} % of its largest, and it is at {share} %"
            last_time = float(f"{time[-1]:.6g}")
            require(False, "response.time", last_time, "s", allowed + _until(response, values))
        # a level that is taken from an end at rest
        allowed = f"must begin at rest, and {name} begins at {number_text(100 * first, 2)} % of its largest value"
        require(first <= DECAYED, "response.time", float(time[0]), "s", allowed)


def _transform_of(
    pieces: PiecewisePolynomial,
    frequency: Array,  # Hz
    begin: float,  # s, from which phases count
) -> Complex:
    """Integral of s(t) e^{-2 pi i f (t - begin)}, by 12 Gauss points in every 4 rad: exact to 1e-11 of a piece."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    even = np.arange(pieces.knots[0], pieces.duration, 2.0 / np.pi / frequency.max())
    knots = np.union1d(pieces.knots, even)
    half = 0.5 * np.diff(knots)[:, None]
    t = (knots[:-1, None] + half * (1.0 + nodes)).ravel()
    values = pieces.value(t) * (half * weights).ravel()
    t, values = t[values != 0.0] - begin, values[values != 0.0]
    most = MOST_PAIRS // frequency.size
    require(t.size <= most, "of", t.size, "Gauss points", f"must be at most {most}: the drive is long in action")
    total = np.zeros(frequency.size, dtype=complex)
    for few in np.array_split(np.arange(t.size), t.size // 256 + 1):
        total += np.exp(-2j * np.pi * np.outer(frequency, t[few])) @ values[few]
    return total


def _by_dwells(response: Response, output: Record, drive: Array) -> tuple[Array, Complex, Array, tuple[str, ...]]:
    history, time = drive_history(response), output.time
    if isinstance(history, SteppedSine):
        ends = np.cumsum(history.cycles_of_steps / history.steps)
        cycles = np.maximum(history.cycles_of_steps // 2, 1)
        steps = history.steps
    else:
        steps, ends = np.array([response.base.frequency]), np.array([time[-1]])
        cycles = np.floor((ends - max(response.window[0], float(time[0]))) * steps + 1e-9).astype(int)
    near = 1e-6 * output.interval
    dwells, unsteady = [], 0
    for f, end, many in zip(steps, ends, cycles, strict=True):
        begin = end - many / f
        if many < 1 or begin < time[0] - near or end > time[-1] + output.interval:
            continue
        inside = (time >= begin - near) & (time < end - near)
        require(int(np.count_nonzero(inside)) >= 8, "interval of response.time", output.interval, "s",
                f"must leave 8 readings or more in a dwell at {f:.4g} Hz")  # fmt: skip
        y, x = (_harmonic(time[inside], values[inside], f) for values in (output.values, drive))
        require(x[0] != 0.0, "of", None, "", f"must not be zero at {f:.4g} Hz")
        dwells.append((f, y[0] / x[0], y[1]))
        middle = begin + (many // 2) / f
        early, late = (inside & (time < middle - near)), (inside & (time >= middle - near))
        if many > 1 and min(np.count_nonzero(early), np.count_nonzero(late)) >= 8:
            first, second = (_harmonic(time[half], output.values[half], f)[0] for half in (early, late))
            unsteady += abs(first - second) > STEADY * abs(second)
    require(bool(dwells), "response.time", float(time[-1]), "s", "must hold a complete dwell")
    warnings = (f"{unsteady} of {len(dwells)} dwells are not steady to {100 * STEADY:g} %: take more cycles",)
    columns = [np.array(column) for column in zip(*dwells, strict=True)]
    return columns[0], columns[1], columns[2], warnings if unsteady else ()


def _harmonic(time: Array, values: Array, frequency: float) -> tuple[complex, float]:
    """Complex amplitude at a frequency (Hz) beside a constant, and its share in the mean square."""
    angle = 2.0 * np.pi * frequency * time
    design = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    parts = np.linalg.lstsq(design, values)[0]
    rest, swing = values - design @ parts, values - values.mean()
    total = float(swing @ swing)
    return complex(parts[0], -parts[1]), 1.0 - float(rest @ rest) / total if total > 0.0 else 1.0
