"""Damping from a free decay: damped sines fitted to the whole record, and the damping ratio over the amplitude."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array, even_interval
from femimpact.errors import check_fields, column, items, quantity, real_array, require, takes, text, warns
from femimpact.signals.damped_sines import DecayFit, noise_of, seen_modes, windows
from femimpact.table import Head, flat_columns, frame_of, head_of_columns, named_column, short_repr
from femimpact.units import counted, interval_texts, number_text

if TYPE_CHECKING:
    import pandas

LEVEL = 0.90
"""Share of records in which an interval holds the truth under white noise."""

FEWEST_CYCLES, FEWEST_SAMPLES = 3.0, 8.0
"""Cycles of a record, and samples of a cycle, below which there is no interval."""

FEWEST_STEPS = 16.0
"""Steps of its resolution in the largest value of a record below which there is no interval: rounding is no noise."""

MOST_WANDER = 0.02
"""Share of a step by which means of times may be off the even grid: 4e-5 of the frequency in 2000 samples."""

FEWEST_LEFT = 0.2
"""Share of a record that must be left behind its clipped samples."""

STILL = 0.1
"""Share of the whole stroke within which nothing moves yet.

A decay from near its top leaves it in a fifth of a cycle, and needs 0.3 cycles more for all but that share.
"""

RUNS = 0.04
"""Share by which a frequency changes from the first third of a sweep to the last."""

STAYS, STAYS_BEHIND_MORE = 0.95, 0.5
"""Least amplitude of the last third of a sweep by the first; the frequency of a decay runs where its amplitude falls.

The second where the middle third is larger than the first, as about a resonance.
"""

SHORTEST_STEP = 1e-100
"""Time (s) of a step, and of its inverse, whose square is a number."""

NONE = (math.nan, math.nan)
"""No interval."""


@dataclass(frozen=True)
class DecayMode:
    """One damped sine of a free decay; an interval is not a number where there is none.

    Parameters
    ----------
    frequency : float, Hz
        Natural frequency: that of the motion is sqrt(1 - damping_ratio^2) times this. Not a number where the mode
        cannot be told from noise.
    damping_ratio : float, 1
    amplitude : float
        At the first sample that is read, in the unit of the signal.
    frequency_interval : pair of float, Hz
        90 % confidence interval under white noise.
    damping_ratio_interval : pair of float, 1
        90 % confidence interval under white noise.
    """

    frequency: float = field(metadata=quantity("Hz", above=0.0, finite=False))
    damping_ratio: float = field(metadata=quantity("1", finite=False))
    amplitude: float = field(metadata=quantity("", at_least=0.0, finite=False))
    frequency_interval: tuple[float, float] = field(metadata=quantity("Hz", finite=False, several=True))
    damping_ratio_interval: tuple[float, float] = field(metadata=quantity("1", finite=False, several=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def __str__(self) -> str:
        if math.isnan(self.frequency):
            return "no mode that can be told from noise"
        texts = []
        for value, (low, high), unit in (
            (self.frequency, self.frequency_interval, " Hz"),
            (100.0 * self.damping_ratio, 100.0 * np.array(self.damping_ratio_interval), " %"),
        ):
            known = math.isfinite(low + high)
            text, least, most = interval_texts(value, low, high)
            interval = f"{LEVEL:.0%} interval {least} to {most}" if known else "no interval"
            texts.append(f"{text}{unit} ({interval})")
        return f"natural frequency {texts[0]}, damping ratio {texts[1]}, amplitude {number_text(self.amplitude)}"


@short_repr
@dataclass(frozen=True, eq=False)
class DecayEstimate:
    """Damping of a free decay: its damped sines, and a table over the amplitude with a row for each window of 5 cycles.

    Parameters
    ----------
    modes : tuple of DecayMode
        By frequency.
    time : ndarray (windows,), s
        Middle of the window.
    amplitude : ndarray (windows,)
        Geometric mean of those of its cycles, in the unit of the signal.
    frequency : ndarray (windows,), Hz
        Of the motion in the window.
    damping_ratio : ndarray (windows,), 1
        Logarithmic decrement of a cycle over 2 pi: slope of the line of least squares through the logarithms of the
        amplitudes of the cycles, each from a sine fitted to it.
    low, high : ndarray (windows,), 1
        90 % confidence interval of `damping_ratio`; not a number where there is none.
    from_maxima : ndarray (windows,), 1
        The ratio by the logarithmic decrement of the first and the last maximum. Noise lifts maxima: no interval.
    noise : float
        Standard deviation of the signal above 10 times the frequency, in its unit.
    unit : str
        Of the signal, where it names one in `attrs["units"]`, as a variable of xarray may.
    level : float, 1
        Of every interval.
    warnings, notes : tuple of str
    """

    _figure: ClassVar[str] = "fi.figures.decay(estimate)"

    modes: tuple[DecayMode, ...] = field(metadata=items(DecayMode))
    time: Array = field(metadata=column("s", "windows"))
    amplitude: Array = field(metadata=column("", "windows"))
    frequency: Array = field(metadata=column("Hz", "windows"))
    damping_ratio: Array = field(metadata=column("1", "windows"))
    low: Array = field(metadata=column("1", "windows"))
    high: Array = field(metadata=column("1", "windows"))
    from_maxima: Array = field(metadata=column("1", "windows"))
    noise: float = field(metadata=quantity("", at_least=0.0, finite=False))
    unit: str = field(default="", metadata=text())
    level: float = field(default=LEVEL, metadata=quantity("1", above=0.0, below=1.0))
    warnings: tuple[str, ...] = field(default=(), metadata=text(several=True))
    notes: tuple[str, ...] = field(default=(), metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def __len__(self) -> int:
        return self.time.size

    def __getitem__(self, name: str) -> NDArray[Any]:
        return named_column(self, name)

    @property
    def _head(self) -> Head:
        summary = f"{counted(len(self.modes), 'mode')}, {len(self)} windows, {len(self.warnings)} warnings"
        return head_of_columns(f"DecayEstimate: {summary}", *self.columns())

    def columns(self) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
        """Columns of the table over the amplitude, and their units."""
        columns, units = flat_columns(self)
        return columns, units | {"amplitude": self.unit}

    def __str__(self) -> str:
        lines = [
            *map(str, self.modes),
            *(f"warning: {remark}" for remark in self.warnings),
            *(f"note: {remark}" for remark in self.notes),
        ]
        return "\n".join(lines)

    def to_pandas(self) -> pandas.DataFrame:
        """The table over the amplitude; `attrs["units"]` holds the units by name."""
        return frame_of(*self.columns())


@warns
@takes(modes=quantity("1", at_least=1, at_most=3, integer=True))
def identify_decay(time: ArrayLike, signal: ArrayLike, *, modes: int = 1) -> DecayEstimate:
    """Frequencies and damping ratios of a free decay, with intervals, and the damping ratio over the amplitude.

    Fitted by least squares to the whole record are damped sines with an offset and a line. Beside them stands a
    table of windows of 5 cycles, in which the damping may depend on the amplitude. The base must be at rest, and no
    force act: a base that still moves drives the structure, and what is read is no damping. Rest or a hold before the
    release, and a clipped beginning, are left out, and a warning says so.

    Parameters
    ----------
    time : array_like (n,), s
        Evenly spaced.
    signal : array_like (n,)
        Displacement, velocity or acceleration, in any unit.
    modes : int
        Damped sines that are fitted, 1 to 3. With several, the table is that of the largest, without the others.

    Returns
    -------
    DecayEstimate
        Intervals of 90 % under white noise. There are none, and a warning says why, where the signal is clipped or
        has few bits, its times wander, the record is shorter than 3 cycles, a cycle has fewer than 8 samples, or the
        misfit of the damped sines is no noise; of a window, where its decrement changes by more than half.

    Examples
    --------
    >>> import numpy as np
    >>> import femimpact as fi
    >>> t = np.arange(0.0, 8.0, 0.005)
    >>> decay = fi.identify_decay(t, np.exp(-0.1 * t) * np.cos(2 * np.pi * 5.0 * t))
    >>> f"{decay.modes[0].frequency:.3f} Hz, {100 * decay.modes[0].damping_ratio:.3f} %"
    '5.000 Hz, 0.318 %'
    """
    t, y, interval = _checked_signal(time, signal)
    begin, left_out = _begin(t, y)
    t, y = t[begin:], y[begin:]
    # the fit does not hang on units
    offset, scale = float(y.mean()), float(np.max(np.abs(y - y.mean())))
    x = (y - offset) / scale
    fit = seen_modes(x, interval, modes)
    largest, frequency = (x - fit.beside_main, fit.main.imag / (2.0 * math.pi)) if fit else (x, math.nan)
    noise = noise_of(largest, interval, frequency)
    table, changes, notes = windows(t, largest, interval, frequency, noise, LEVEL)
    real = _modes(fit, scale) if fit else ()
    warnings = _unfit(fit, real, t, y, interval) if fit else [f"no decay can be told from noise in {t.size} samples"]
    bare, missing = bool(warnings), modes - len(real)
    if fit and missing:
        warnings.append(f"{modes} modes were asked for, and {len(real)} can be told from noise")
    reason, further = fit.reason_against(x, interval) if fit and not bare else ("", False)
    if bare or reason:
        real = tuple(replace(one, frequency_interval=NONE, damping_ratio_interval=NONE) for one in real)
    swept = "" if further or (fit and not reason) else _swept(x, interval)
    warnings += [one for one in (*left_out, swept or reason) if one]
    beats = bool(reason) and not swept and fit is not None and fit.beats(x, interval)
    if beats:
        warnings.append("the envelope beats: no interval over the amplitude either; fit several modes")
    if bare := bare or further or beats or bool(swept):
        table |= dict.fromkeys(("low", "high"), np.full(table["time"].size, math.nan))
    table["amplitude"] *= scale
    return DecayEstimate(
        modes=(*real, *(DecayMode(math.nan, math.nan, math.nan, NONE, NONE),) * missing), **table, noise=noise * scale,
        unit=str(getattr(signal, "attrs", {}).get("units", "")), notes=tuple(notes),
        warnings=(*warnings, *(() if bare else changes)),
    )  # fmt: skip


def _checked_signal(time: ArrayLike, signal: ArrayLike) -> tuple[Array, Array, float]:
    """Times (s), the signal, and the interval between samples (s)."""
    t = real_array("time", time, "s", "must be a row of finite numbers")
    y = real_array("signal", signal, "", "must be a row of finite numbers")
    require(t.ndim == 1 and t.shape == y.shape, "signal", y.shape, "", f"must be as long as time, shape {t.shape}")
    require(t.size >= 16, "signal", t.size, "samples", "must hold at least 16")
    bad = even_interval(t)[1]
    steps = np.diff(t)
    allowed = "must be evenly spaced: a sample is lost, or resample it first (numpy.interp)"
    require(bad < 0, "time", f"steps of {steps.min():.6g} to {steps.max():.6g}", "s", allowed)
    require(float(np.ptp(y)) > 1e-12 * float(np.max(np.abs(y))), "signal", float(y[0]), "", "must not be constant")
    usual = float(np.median(steps))
    in_seconds = SHORTEST_STEP < usual < 1.0 / SHORTEST_STEP
    require(in_seconds, "time", f"steps of {usual:.6g}", "s", "must be steps of seconds")
    # the first and the last time may be rounded
    return t, y, float(np.polyfit(np.arange(t.size), t - t[0], 1)[0])


def _begin(t: Array, y: Array) -> tuple[int, list[str]]:
    """The first sample of a free decay, behind rest, a hold and clipped cycles, with words on what is left out."""
    begin, words = _release(y), list[str]()
    if begin:
        words.append(f"rest or a hold is left out: the record is read from {t[begin]:.6g} s on")
    of_clipping, last = _clipped(y[begin:])
    if of_clipping and y.size - begin - last - 1 >= max(FEWEST_LEFT * y.size, 16):
        begin += last + 1
        words.append(f"{of_clipping}: the record is read from {t[begin]:.6g} s on")
    return begin, words


def _release(y: Array) -> int:
    """The first largest sample after a beginning in which nothing moves for as long as a stroke takes; 0 without."""
    moved = np.maximum.accumulate(y) - np.minimum.accumulate(y)
    still, moves = (int(np.argmax(moved > share * float(np.ptp(y)))) for share in (STILL, 1.0 - STILL))
    stroke, after = moves - still, y[still:] - y[still:].mean()
    if after.size < 16 or still < max(stroke, 2):
        return 0
    return still + int(np.argmax(np.abs(after[: 2 * stroke + 1])))


def _swept(x: Array, interval: float) -> str:
    """Words where the frequency runs and the amplitude stays, as in a sweep; empty for a decay."""
    thirds = np.array_split(x - x.mean(), 3)
    frequencies = []
    for part in thirds:
        lines = np.abs(np.fft.rfft(part * np.hanning(part.size))) ** 2
        lines[lines < 0.01 * lines.max()] = 0.0
        frequencies.append(float(lines @ np.fft.rfftfreq(part.size, interval)) / max(float(lines.sum()), 1e-300))
    first, middle, last = frequencies
    runs = min(first, last) < middle < max(first, last) and abs(last - first) > RUNS * first
    begin, between, end = (float(np.std(part)) for part in thirds)
    stays = end > (STAYS_BEHIND_MORE if between > begin else STAYS) * begin
    words = f"the frequency runs from about {first:.3g} to {last:.3g} Hz, and the amplitude stays"
    return f"no free decay: {words}. A sweep or a driven motion has no damping to read" if runs and stays else ""


def _modes(fit: DecayFit, scale: float) -> tuple[DecayMode, ...]:
    return tuple(
        DecayMode(f, ratio, amplitude, (f - df, f + df), (ratio - dr, ratio + dr))
        for (f, ratio, df, dr), amplitude in zip(fit.values(LEVEL), (scale * fit.amplitudes).tolist(), strict=True)
    )


def _unfit(fit: DecayFit, real: tuple[DecayMode, ...], t: Array, y: Array, interval: float) -> list[str]:
    """Warnings of a record that bears no interval."""
    own = fit.means.poles.imag / (2.0 * math.pi)
    slowest, fastest, near = float(own[0]), float(own[-1]), float(np.min(np.diff(own), initial=math.inf))
    duration, samples = y.size * interval, 1.0 / (interval * fastest)
    words, wander, cycles = list[str](), _wander(t, interval), duration * slowest
    _, step, half = _steps(y)
    if half < FEWEST_STEPS * step:
        words.append(
            f"the record is rounded to steps of {number_text(step, 3)}, of which its largest value has "
            f"{number_text(half / step, 2)} (at least {FEWEST_STEPS:g})"
        )
    if clipping := _clipped(y)[0]:
        words.append(clipping)
    if wander > MOST_WANDER:
        words.append(
            f"the times wander off the even grid by {number_text(wander, 2)} of a step (at most {MOST_WANDER:g})"
        )
    if cycles < FEWEST_CYCLES:
        words.append(f"the record has {number_text(cycles, 2)} cycles of {slowest:.4g} Hz (at least {FEWEST_CYCLES:g})")
    if samples < FEWEST_SAMPLES:
        words.append(f"a cycle of {fastest:.4g} Hz has {number_text(samples, 3)} samples (at least {FEWEST_SAMPLES:g})")
    words += [
        f"the amplitude of {one.frequency:.4g} Hz "
        f"{'grows' if one.damping_ratio_interval[1] < 0.0 else 'does not decay'}, by a damping ratio of "
        f"{number_text(100.0 * one.damping_ratio, 3)} %: it is driven, and no free decay"
        for one in real
        if one.damping_ratio <= 0.0
    ]
    if near * duration < 1.0:
        words.append(
            f"two modes are {number_text(near, 2)} Hz apart, below the {number_text(1.0 / duration, 2)} Hz of one "
            "beat in the record: they may be one whose damping depends on the amplitude"
        )
    return [f"no interval: {one}" for one in words]


def _wander(t: Array, interval: float) -> float:
    """By what share of a step means of many times lie off the even grid; 0 where rounding may be what does it."""
    along = np.arange(t.size) - 0.5 * (t.size - 1)
    off = t / interval - t.mean() / interval - along
    off -= (along @ off) / (along @ along) * along
    block = t.size // 16
    slow = np.abs(off[: 16 * block].reshape(16, block).mean(axis=1)).max()
    return float(slow) if slow > 4.0 * float(np.sqrt(np.mean(off**2) / block)) else 0.0


def _steps(y: Array) -> tuple[Array, float, float]:
    """Values of a record by size, the least step between them, and half of their range."""
    values = np.unique(y)
    return values, float(np.min(np.diff(values))), 0.5 * float(values[-1] - values[0])


def _clipped(y: Array) -> tuple[str, int]:
    """Words on consecutive samples at the largest or the smallest value, and the last of these samples."""
    values, step, half = _steps(y)
    words, last = "", -1
    for top in (values[-1], values[0]):
        at = np.flatnonzero(y == top)
        runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
        longest = max(map(len, runs))
        # the top of a sine of few bits is flat too: as many samples as between the crossings of the last step
        above = y[max(int(runs[0][0]) - y.size // 2, 0) :] > 0.5 * float(values[0] + values[-1])
        cycle = 2.0 * above.size / max(int(np.count_nonzero(above[1:] != above[:-1])), 1)
        flat = 1.0 + (cycle / math.pi * math.sqrt(2.0 * step / half) if step > 1e-9 * half else 0.0)
        if longest > max(1.0, 1.5 * flat):
            words = words or f"the signal is clipped, {longest} consecutive samples are at {float(top):.6g}"
            last = max(last, int(at[-1]))
    return words, last
