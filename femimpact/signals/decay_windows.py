"""The damping ratio of a free decay over its amplitude, in windows of 5 cycles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from femimpact.arrays import Array
from femimpact.units import number_text

CYCLES = 5
"""Cycles of a window."""

ABOVE_NOISE = 5.0
"""Least amplitude of a window, by the standard deviation of the noise."""

CHANGES = 0.5
"""Share of the decrement by which it may change within a window."""

SURE = 3.0
"""Standard deviations beyond which a change of the decrement is none of noise."""

SELDOM = 0.005
"""Share of records in which white noise may make the amplitudes of cycles scatter so much that intervals are wider."""

RIPPLE = 0.02
"""By how much the ratio in a window hangs on what ratio is meant, by the share of other frequencies in it (rms).

A third harmonic of the share h sqrt(2) gives ln sqrt(x^2 + (x'/omega)^2) a ripple of 2 sqrt(2) h at twice the
frequency. A line of least squares through it over n cycles takes up to 12/n^3 n/(4 pi) of that per cycle, over 2 pi
in the ratio: 0.0172 h, and more of higher ones. Sines fitted to whole cycles take nothing. (Derived here.)
"""


def noise_of(x: Array, interval: float, frequency: float) -> float:
    """Standard deviation of what is faster than 10 times the frequency (Hz), or than half of what is recorded."""
    taper = np.hanning(x.size + 2)[1:-1]
    lines = np.abs(np.fft.rfft((x - x.mean()) * taper)) ** 2
    faster = np.fft.rfftfreq(x.size, interval) >= min(10.0 * frequency, 0.25 / interval)
    return math.sqrt(float(np.mean(lines[faster])) / float(taper @ taper)) if faster.any() else math.nan


@dataclass(frozen=True, eq=False)
class Window:
    """Sines of one frequency fitted to the cycles of a window, with an offset and a line."""

    begin: int  # its first sample
    size: int  # samples
    frequency: float  # Hz
    logarithms: Array  # (cycles,) of the amplitudes
    left: float  # standard deviation of the misfit
    spread: Array  # (cycles,) of the logarithms by that of the noise
    from_maxima: float  # the ratio by the largest values of the first and the last cycle

    @property
    def amplitude(self) -> float:
        """Geometric mean of those of the cycles."""
        return math.exp(float(self.logarithms.mean()))

    @property
    def scatter(self) -> float:
        """Of the amplitudes of the cycles about a cubic; by white noise it has its standard deviation."""
        return float(_ABOUT @ np.exp(self.logarithms)) * math.sqrt(self.size / (2.0 * CYCLES * float(_ABOUT @ _ABOUT)))

    @property
    def slope(self) -> float:
        """Of the logarithm of the amplitude by cycle."""
        return float(_SLOPE @ self.logarithms)

    @property
    def change(self) -> tuple[float, float]:
        """By how much the decrement changes along the window, and the spread of that by the one of the noise."""
        decrements = -np.diff(self.logarithms)
        bent, several = abs(float(_CHANGE @ self.logarithms)), float(np.ptp(decrements))
        if bent > several:
            return bent, math.sqrt(float(_CHANGE**2 @ self.spread**2))
        return several, 2.0 * float(np.sqrt(np.mean(self.spread**2)))


_ALONG = np.arange(CYCLES) - 0.5 * (CYCLES - 1)
_SLOPE = _ALONG / (_ALONG @ _ALONG)
_BENT = _ALONG**2 - np.mean(_ALONG**2)
_CHANGE = 2.0 * CYCLES * _BENT / (_BENT @ _BENT)
_ABOUT = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Weights of the logarithms of the cycles."""


def _window(x: Array, begin: int, interval: float, frequency: float) -> Window | None:
    """The fit to 5 cycles from a sample on, at the frequency (Hz) that their phases show; None without one."""
    decay, size = 0.0, 0
    for _ in range(4):
        size = round(CYCLES / (frequency * interval))
        part = x[begin : begin + size]
        if size > part.size or size < 3 * CYCLES:
            return None
        u = frequency * interval * np.arange(size)
        cycle = np.minimum(u.astype(int), CYCLES - 1)
        basis = np.zeros((size, 2 * CYCLES + 2))
        envelope = np.exp(decay * (u - cycle - 0.5))
        basis[np.arange(size), 2 * cycle] = np.cos(2.0 * math.pi * u) * envelope
        basis[np.arange(size), 2 * cycle + 1] = np.sin(2.0 * math.pi * u) * envelope
        basis[:, -2], basis[:, -1] = 1.0, u / CYCLES - 0.5
        factors, _, rank, _ = np.linalg.lstsq(basis, part, rcond=None)
        a, b = factors[:-2:2], factors[1:-2:2]
        if rank < basis.shape[1] or not np.all(np.hypot(a, b) > 0.0):
            return None
        shift = float(_SLOPE @ np.unwrap(np.angle(a - 1j * b))) / (2.0 * math.pi)
        slope = float(_SLOPE @ np.log(np.hypot(a, b)))
        if abs(shift) > 0.2:
            return None
        if abs(shift) < 1e-5 and abs(slope - decay) < 1e-5:
            break
        frequency, decay = frequency * (1.0 + shift), slope
    misfit = part - basis @ factors
    left = math.sqrt(float(misfit @ misfit) / max(size - basis.shape[1], 1))
    logarithms = np.log(np.hypot(a, b))
    spread = math.sqrt(2.0 * CYCLES / size) / np.exp(logarithms)
    flat = part - basis[:, -2:] @ factors[-2:]
    cycle_samples = round(size / CYCLES)
    first, last = float(flat[:cycle_samples].max()), float(flat[-cycle_samples:].max())
    maxima = math.log(first / last) / (2.0 * math.pi * (CYCLES - 1)) if first > 0.0 and last > 0.0 else math.nan
    return Window(begin, size, frequency, logarithms, left, spread, maxima)


def windows(
    time: Array, x: Array, interval: float, frequency: float, noise: float, level: float
) -> tuple[dict[str, Any], list[str], list[str]]:
    """Columns of the table over the amplitude by name, warnings, and notes."""
    from scipy.special import stdtrit

    all_windows, unread = _read(x, interval, frequency, noise)
    width, freedom = _wider(all_windows, noise)
    above_noise = [window for window in all_windows if window.amplitude >= ABOVE_NOISE * noise * width]
    rows, changes = list[tuple[float, ...]](), list[float]()
    for window in above_noise:
        ratio, amplitude = -window.slope / (2.0 * math.pi), window.amplitude
        other = math.sqrt(max(window.left**2 - noise**2, 0.0)) / amplitude
        random = noise * width * math.sqrt(float(_SLOPE**2 @ window.spread**2)) / (2.0 * math.pi)
        half = float(stdtrit(freedom, 0.5 + 0.5 * level)) * math.hypot(random, RIPPLE * other)
        change, spread = window.change
        if change - SURE * noise * width * spread > CHANGES * abs(window.slope):
            changes.append(100.0 * change / max(abs(window.slope), 1e-300))
            half = math.nan
        middle = time[window.begin] + 0.5 * (window.size - 1) * interval
        rows.append((middle, amplitude, window.frequency, ratio, ratio - half, ratio + half, window.from_maxima))
    warnings, notes = [], []
    if changes:
        warnings.append(
            f"no interval of {len(changes)} of {len(rows)} windows: the decrement changes within one by up to "
            f"{max(changes):.0f} % (at most {100.0 * CHANGES:.0f} %)"
        )
    if width > 1.0 and rows:
        notes.append(
            f"intervals of windows are {number_text(width, 3)} times as wide as by the noise above 10 times the "
            "frequency: the "
            "amplitudes of cycles scatter so much at the end of the record"
        )
    if len(all_windows) > len(above_noise):
        small = f"{len(all_windows) - len(above_noise)} windows whose amplitude is below"
        notes.append(f"{small} {number_text(ABOVE_NOISE * width, 3)} times the noise are left out")
    if unread:
        notes.append(f"{unread} windows without a motion of about {frequency:.4g} Hz are left out")
    names = ("time", "amplitude", "frequency", "damping_ratio", "low", "high", "from_maxima")
    columns = np.array(rows, dtype=float).reshape(-1, len(names)).T
    return dict(zip(names, columns.copy(), strict=True)), warnings, notes


def _read(x: Array, interval: float, frequency: float, noise: float) -> tuple[list[Window], int]:
    """Windows one behind the other, and how many have no motion of about a frequency (Hz)."""
    read_windows, unread, begin, cycle = list[Window](), 0, 0, frequency
    while math.isfinite(cycle) and round(CYCLES / (cycle * interval)) <= x.size - begin:
        window = _window(x, begin, interval, cycle)
        begin += window.size if window else round(CYCLES / (cycle * interval))
        if window is None or not abs(window.frequency / frequency - 1.0) < 0.2:
            unread += 1
            continue
        cycle = window.frequency if window.amplitude >= ABOVE_NOISE * noise else cycle
        read_windows.append(window)
    return read_windows, unread


def _wider(all_windows: list[Window], noise: float) -> tuple[float, float]:
    """How many times as wide as by the noise intervals are, and the degrees of freedom of that.

    Noise that is stronger about the frequency than above 10 times of it shows in how the amplitudes of cycles scatter
    in the last third of the windows, where a ball makes them scatter least.
    """
    from scipy.special import chdtri

    late = [(window.scatter / max(noise, 1e-300)) ** 2 for window in all_windows[2 * len(all_windows) // 3 :]]
    seldom = bool(late) and sum(late) > float(chdtri(len(late), SELDOM))
    return (math.sqrt(sum(late) / len(late)), len(late)) if seldom else (1.0, 1e9)
