"""A stationary random motion of the base from its spectral density."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import check_fields, choice, optional, quantity, real_array, require
from femimpact.excitation.harmonic import FADE, PiecewiseMotion, check_fade, level_at
from femimpact.excitation.piecewise_polynomial import (
    NODES,
    PiecewisePolynomial,
    coefficients_through,
    pieces_of,
)
from femimpact.excitation.records import RecordedBase

PIECES = 23.0
"""Polynomials of degree 5 in a cycle of a single line: within 1e-9 of the largest value, with half as much to spare."""

LEAST_PIECES = 8
"""In a cycle of the highest line, however weak it is."""

SAMPLES = 64
"""Of a clipped motion in a cycle of the highest line."""

MOST_ROUNDS, BEYOND_CLIP = 20, 1e-6
"""Most times that a motion is clipped, and the share of the limit by which no sample is then beyond it."""

MOST_LINES = 5_000_000


@dataclass(frozen=True)
class RandomBase(PiecewiseMotion):
    """Random motion of the base as a sum of sines: ub'' = sum_k sqrt(2 S(f_k) df) cos(2 pi f_k t + phase_k).

    The lines stand at all multiples f_k of df = 1/duration between the first and the last frequency of the density S;
    the phases are drawn evenly from 0 to 2 pi by numpy's generator of the seed. The sum is stationary from t = 0 on,
    close to normally distributed, and has the period `duration`; after it the base moves on uniformly.

    With fixed amplitudes the mean square over the duration is that of the density, for every seed: a test bench makes
    such motions. Runs of several seeds then scatter by less than those of a Gaussian process, and no confidence limit
    may be drawn from them. Random amplitudes follow Rayleigh's distribution, each with the same mean square, and the
    motion is a Gaussian process.

    The history is made of polynomials of degree 5, up to 23 in a
    cycle of the highest line, 18 of a flat density: displacement, velocity and acceleration are exact derivatives of
    one another, and the acceleration is within 1e-9 of its largest value. Libraries such as pyExSi give samples, from
    which no closed form follows.

    Clipped, the acceleration is cut off at a number of its root mean squares, and what that puts below the band of the
    density is taken out, as the high-pass of a shaker's controller does: else the base would wander by a hundred times
    its displacement. Both are repeated until no sample is beyond the limit by more than 1e-6 of it, or 20 times, after
    which it is by 3e-5 in a narrow band at 1.2 root mean squares. At 3 the root mean square is 0.3 % lower then, at 2
    by 4 %, and `lost_share` says what is taken from the density. The base is driven by what is left as by a detrended
    record: straight between 64 samples in a cycle of the highest line, without its mean, and about its place.

    Parameters
    ----------
    psd : array_like (n, 2), Hz and (m/s^2)^2/Hz
        One-sided, its frequencies rising, straight in a plot of its logarithms; n >= 2.
    duration : float, s
        Of the motion, and its period.
    seed : int
        Of the phases, and of random amplitudes: one seed gives one motion.
    amplitudes : {"fixed", "random"}
        Of the lines: sqrt(2 S df) each, or that times sqrt(E), E drawn from the exponential distribution of mean 1.
    clip : float, 1
        Largest acceleration over the root mean square of the sum of lines; absent, nothing is cut off.
    fade : float, s
        How long the motion takes to come, and to go at its end: the displacement is multiplied by
        sin^2(pi t/(2 fade)).
    """

    psd: Any
    duration: float = field(metadata=quantity("s", above=0.0))
    seed: int = field(default=0, metadata=quantity("1", at_least=0, integer=True))
    amplitudes: str = field(default="fixed", metadata=choice("fixed", "random"))
    clip: float | None = field(default=None, metadata=optional(quantity("1", at_least=1.0)))
    fade: float = field(default=0.0, metadata=FADE)

    def __post_init__(self) -> None:
        check_fields(self)
        allowed = "must be 2 or more pairs of a frequency (Hz) and a density ((m/s^2)^2/Hz), all > 0"
        psd = real_array("psd", self.psd, "", allowed)
        good = psd.ndim == 2 and psd.shape[0] >= 2 and psd.shape[1] == 2 and bool(np.all(psd > 0.0))
        low = psd[psd <= 0.0]
        wrong = f"{low[0]:g} among its values" if low.size and psd.ndim == 2 else f"array of shape {psd.shape}"
        require(good, "psd", wrong, "", allowed)
        falling = np.flatnonzero(np.diff(psd[:, 0]) <= 0.0)
        if falling.size:
            which = f"{psd[falling[0], 0]:.6g} and then {psd[falling[0] + 1, 0]:.6g}"
            require(False, "psd", which, "Hz", "must have frequencies that rise")
        object.__setattr__(self, "psd", tuple(map(tuple, psd.tolist())))
        first, last = self._numbers
        lines = last - first + 1
        allowed = f"must hold 1 to {MOST_LINES:,} lines 1/duration apart between {psd[0, 0]:g} and {psd[-1, 0]:g} Hz"
        require(1 <= lines <= MOST_LINES, "duration", self.duration, "s", allowed)
        # its pieces go with the cycles of the highest line, however few lines there are
        allowed = f"must hold at most {2 * MOST_LINES:,} cycles of the highest line, {psd[-1, 0]:g} Hz"
        require(last <= 2 * MOST_LINES, "duration", self.duration, "s", allowed)
        check_fade(self.fade, self.duration)

    @property
    def _numbers(self) -> tuple[int, int]:
        """First and last multiple of 1/duration."""
        low, high = self.psd[0][0] * self.duration, self.psd[-1][0] * self.duration
        return math.ceil(low * (1.0 - 1e-12)), math.floor(high * (1.0 + 1e-12))

    @cached_property
    def lines(self) -> tuple[Array, Array, Array]:
        """Frequency (Hz), amplitude (m/s^2) and phase (rad) of every line."""
        first, last = self._numbers
        frequency = np.arange(first, last + 1) / self.duration
        density = level_at(self.psd, frequency)
        generator = np.random.default_rng(self.seed)
        phase = generator.uniform(0.0, 2.0 * np.pi, frequency.size)
        amplitude = np.sqrt(2.0 * density / self.duration)
        if self.amplitudes == "random":
            amplitude = amplitude * np.sqrt(generator.standard_exponential(frequency.size))
        return frequency, amplitude, phase

    @property
    def rms(self) -> float:
        """Root mean square of the acceleration over the duration, m/s^2; without fades and what clipping takes."""
        return float(np.sqrt(0.5 * np.sum(self.lines[1] ** 2)))

    @cached_property
    def samples(self) -> Array:
        """The acceleration (n,) at 64 even times or more in a cycle of the highest line, m/s^2; clipped where it is."""
        from scipy.fft import next_fast_len

        _, size, phase = self.lines
        first, last = self._numbers
        count = next_fast_len(SAMPLES * last, real=True)
        spectrum = np.zeros(count // 2 + 1, dtype=complex)
        spectrum[first : last + 1] = 0.5 * count * size * np.exp(1j * phase)
        samples = np.fft.irfft(spectrum, count)
        # both limits are convex: what is projected on one and the other in turn comes to what meets both
        most = math.inf if self.clip is None else self.clip * self.rms
        for _ in range(MOST_ROUNDS):
            if np.abs(samples).max() <= most * (1.0 + BEYOND_CLIP):
                break
            spectrum = np.fft.rfft(np.clip(samples, -most, most))
            spectrum[:first] = 0.0
            samples = np.fft.irfft(spectrum, count)
        return samples

    @property
    def kurtosis(self) -> float:
        """Mean fourth power of the acceleration over the square of its mean square: 3 of a Gaussian process."""
        return float(np.mean(self.samples**4) / np.mean(self.samples**2) ** 2)

    @property
    def crest(self) -> float:
        """Largest acceleration over the root mean square, both as clipped where it is."""
        return float(np.abs(self.samples).max() / np.sqrt(np.mean(self.samples**2)))

    @property
    def lost_share(self) -> float:
        """Share of the mean square within the band of the density that clipping takes."""
        first, last = self._numbers
        lines = np.fft.rfft(self.samples)[first : last + 1] * (2.0 / self.samples.size)
        return 1.0 - float(np.sum(np.abs(lines) ** 2) / np.sum(self.lines[1] ** 2))

    @property
    def _record(self) -> PiecewisePolynomial:
        """The clipped motion as straight lines between its samples."""
        samples = np.append(self.samples, self.samples[0])
        record = RecordedBase(samples, self.duration / (samples.size - 1)).returning()
        middle = float(record.displacement(record.interval * np.arange(samples.size - 1)).mean())
        return replace(pieces_of(record.closed_form), initial_displacement=-middle, starts=None)

    @property
    def frequency(self) -> float:
        """The highest line, Hz: a random motion has no cycle."""
        return float(self.lines[0][-1])

    @property
    def _form(self) -> PiecewisePolynomial:
        """Acceleration of the base without fades, m/s^2."""
        return self._sum if self.clip is None else self._record

    @property
    def _sum(self) -> PiecewisePolynomial:
        """The sum of lines."""
        from scipy.fft import next_fast_len

        frequency, size, phase = self.lines
        first, last = self._numbers
        # a piece of length h misses a line by (omega h)^6/(720 924) of it; of all lines that is a mean square
        share = math.sqrt(np.sum((size * (frequency / frequency[-1]) ** 6) ** 2) / np.sum(size**2))
        count = next_fast_len(math.ceil(max(PIECES * share ** (1 / 6), LEAST_PIECES) * last), real=True)
        h, wave = self.duration / count, size * np.exp(1j * phase)
        spectrum = np.zeros(count // 2 + 1, dtype=complex)

        def on_grid(lines: Array, offset: float) -> Array:
            """The sum at all knots and an offset (s) later."""
            spectrum[first : last + 1] = 0.5 * count * lines * np.exp(2j * np.pi * frequency * offset)
            return np.fft.irfft(spectrum, count)

        values = np.stack([on_grid(wave, 0.5 * h * (1.0 + node)) for node in NODES], axis=1)
        rate = 2j * np.pi * frequency
        starts = np.column_stack([on_grid(wave / rate**2, 0.0), on_grid(wave / rate, 0.0)])
        knots = np.linspace(0.0, self.duration, count + 1)
        coefficients = coefficients_through(values, np.full(count, h))
        return PiecewisePolynomial(knots, coefficients, starts=np.vstack([starts, starts[0]]))
