"""What is fitted to a free decay: damped sines to the whole record, by least squares; sines to windows of 5 cycles.

Least squares with the amplitudes eliminated are those of Golub and Pereyra (1973), by the shorter derivatives of
Kaufman (1975); they start from a matrix pencil (Hua and Sarkar, 1990).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.signals.one_pole import pattern_in
from femimpact.units import number_text

SAMPLES_KEPT, PER_CYCLE = 2000, 16.0
"""Of a longer record means of neighbours are fitted, at least so many in a cycle: a damped sine stays one."""

SHORTEST = 64
"""Samples of the shortest beginning of a record that is looked at."""

PENCIL = 600
"""Most samples of a matrix pencil."""

SEEN = (30.0, 6.0)
"""A mode is told from noise where it takes more than a + b ln(samples) variances of the noise from the squares."""

NEGLIGIBLE = 3e-5
"""Share of the largest value below which a misfit, of rounding or of a further mode of a release, does not matter.

A damping that is linear in the amplitude and leaves as much changes by less than 0.3 % over the record.
"""

LARGEST_RATIO = 0.95
"""A pole of larger damping is no vibration."""

USUAL_RATIO = 0.5
"""Poles of larger damping are started from only where there are too few others: a drift has such."""


@dataclass(frozen=True, eq=False)
class DampedSines:
    """Damped sines, an offset and a line, of the amplitudes of least squares."""

    poles: NDArray[Any]  # (modes,) complex, 1/s, of positive frequency, by it
    time: Array  # (points,) s
    basis: Array  # (points, 2 modes + 2): cosines and sines in pairs, offset, line
    factors: Array  # (2 modes + 2,)
    misfit: Array  # (points,)
    jac: Array  # (points, 2 modes) by the poles' real and imaginary parts, orthogonal to the basis

    @property
    def squares(self) -> float:
        """Sum of those of the misfit."""
        return float(self.misfit @ self.misfit)

    @property
    def variance(self) -> float:
        """Of the noise, by the misfit."""
        return self.squares / float(max(self.time.size - 2 * self.basis.shape[1] + 2, 1))

    @property
    def parts(self) -> Array:
        """The damped sine of each mode (modes, points)."""
        pairs = range(0, 2 * self.poles.size, 2)
        return np.array([self.basis[:, k : k + 2] @ self.factors[k : k + 2] for k in pairs])

    @property
    def by_energy(self) -> NDArray[np.intp]:
        """The modes, that of most energy first."""
        return np.argsort(np.sum(self.parts**2, axis=1))[::-1]

    @property
    def seen(self) -> bool:
        """True if without any one of the modes the squares of the misfit are larger than noise makes them."""
        inverse = np.linalg.pinv(self.basis.T @ self.basis, hermitian=True)
        pairs = [slice(k, k + 2) for k in range(0, 2 * self.poles.size, 2)]
        taken = [float(self.factors[p] @ np.linalg.pinv(inverse[p, p]) @ self.factors[p]) for p in pairs]
        return min(taken) > (SEEN[0] + SEEN[1] * math.log(self.time.size)) * self.variance

    @property
    def pattern(self) -> str:
        """Words on what noise seldom leaves in the misfit; empty where it may be noise."""
        return pattern_in(self.misfit, np.column_stack([self.jac, self.basis]), self.further_terms)

    @property
    def further_terms(self) -> dict[str, Array]:
        """What a damping and a frequency that depend on the amplitude, and harmonics, would add."""
        terms, u = dict[str, Array](), self.time[:, None] / self.time[-1]
        for k, pole in enumerate(self.poles):
            pair = self.basis[:, 2 * k : 2 * k + 2]
            frequency = f"{pole.imag / (2.0 * math.pi):.4g} Hz"
            terms[f"a damping and a frequency of {frequency} that change"] = np.hstack([pair * u**2, pair * u**3])
            turned = [np.exp((pole.real + 1j * n * pole.imag) * self.time) for n in (2, 3)]
            terms[f"harmonics of {frequency}"] = np.column_stack([part for z in turned for part in (z.real, z.imag)])
        return terms


@dataclass(frozen=True, eq=False)
class DecayFit:
    """Damped sines at a minimum of the squares over means of neighbouring samples, and the same at every sample."""

    means: DampedSines
    samples: DampedSines

    @property
    def seen(self) -> bool:
        """True if every mode is told from noise, at every sample too: a faster one is another in the means."""
        return self.means.seen and (self.samples is self.means or self.samples.seen)

    @property
    def main(self) -> complex:
        """Pole (1/s) of the mode of most energy."""
        return complex(self.means.poles[self.samples.by_energy[0]])

    @property
    def beside_main(self) -> Array:
        """What all parts but the mode of most energy are at each sample."""
        return np.asarray(self.samples.basis @ self.samples.factors - self.samples.parts[self.samples.by_energy[0]])

    @property
    def amplitudes(self) -> Array:
        """Of the modes at the first sample."""
        return np.hypot(self.samples.factors[:-2:2], self.samples.factors[1:-2:2])

    def values(self, level: float) -> list[list[float]]:
        """Frequency (Hz) and damping ratio of each mode, and half the widths of their intervals."""
        from scipy.special import stdtrit

        fit, count = self.means, self.means.poles.size
        # points are never known better than to the last bits
        covariance = (fit.variance + 1e-20) * np.linalg.pinv(fit.jac.T @ fit.jac, hermitian=True)
        width = float(stdtrit(max(fit.time.size - 4 * count - 2, 1), 0.5 + 0.5 * level))
        rows = []
        for k, pole in enumerate(fit.poles):
            omega = abs(pole)
            # derivatives of frequency and ratio by the real and the imaginary part of the pole
            by = np.array([[pole.real, pole.imag], [-(pole.imag**2) / omega, pole.real * pole.imag / omega]])
            by /= np.array([[2.0 * math.pi * omega], [omega**2]])
            half = width * np.sqrt(np.diag(by @ covariance[np.ix_([k, count + k], [k, count + k])] @ by.T))
            rows.append([float(omega) / (2.0 * math.pi), float(-pole.real / omega), *half.tolist()])
        return rows

    def reason_against(self, x: Array, interval: float) -> tuple[str, bool]:
        """Words where the misfit is no noise of one size, else none; and whether a further mode leaves noise alone."""
        size = math.sqrt(self.means.squares / self.means.time.size)
        pattern = "" if size <= NEGLIGIBLE else self.means.pattern or self._uneven()
        if not pattern:
            return "", False
        share = f"{number_text(100.0 * size, 2)} % of the largest value"
        count = self.means.poles.size + 1
        modes = "one mode" if count == 2 else f"{count - 1} modes"
        words = f"no linear decay of {modes}, and no interval: the misfit of {share} is no noise: {pattern}"
        other = seen_fit(x, interval, count) if count <= 3 else None
        if other is not None:
            poles, end = other.means.poles, other.means.time[-1]
            if float(np.min(np.diff(poles.imag))) * end > 2.0 * math.pi and not other.means.pattern:
                frequencies = " and ".join(f"{p.imag / (2.0 * math.pi):.4g}" for p in poles)
                words += f". {count} modes, of {frequencies} Hz, leave noise alone: modes={count}"
                return f"{words}; with fewer there is no interval over the amplitude either", True
        causes = "other modes, which a filter or modes= takes out, or a damping that depends on the amplitude"
        return f"{words}. Causes: {causes}: read the ratio over the amplitude", False

    def _uneven(self) -> str:
        """Words where the misfit falls or rises with the amplitude."""
        from scipy.special import fdtri

        fit = self.means
        order = np.argsort(np.abs(np.exp(self.main.real * fit.time)))
        small, large = (float(np.mean(fit.misfit[part] ** 2)) for part in np.array_split(order, 2))
        freedom = fit.time.size / 2 - fit.basis.shape[1]
        limit = float(fdtri(freedom, freedom, 0.9975)) if freedom > 4 else math.inf
        ratio = max(small, large) / max(min(small, large), 1e-300)
        words = f"it is {number_text(math.sqrt(ratio), 3)} times as large where the amplitude is"
        return "" if ratio <= limit else f"{words} {'large' if large > small else 'small'}"

    def beats(self, x: Array, interval: float) -> bool:
        """True if the amplitude of cycles of the largest mode rises again by more than noise lifts it."""
        cycle = max(round(2.0 * math.pi / (self.main.imag * interval)), 1)
        count = x.size // (2 * cycle)
        turned = (x - self.beside_main) * np.exp(-1j * self.main.imag * interval * np.arange(x.size))
        amplitude = 2.0 * np.abs(turned[: 2 * count * cycle].reshape(count, -1).mean(axis=1))
        rise = amplitude - np.minimum.accumulate(amplitude)
        noise = math.sqrt(self.means.variance / (2 * cycle))
        return bool(count >= 3 and rise.max() > max(0.1 * amplitude.max(), 6.0 * noise))


def seen_modes(x: Array, interval: float, modes: int) -> DecayFit | None:
    """The fit of so many damped sines, or of as many as are told from noise; None without one."""
    for count in range(modes, 0, -1):
        # what is left of several may be one that was split
        fit = seen_fit(x, interval, count)
        if fit is not None:
            return fit
    return None


def seen_fit(x: Array, interval: float, modes: int) -> DecayFit | None:
    """The fit of so many damped sines that are told from noise; None where there are fewer.

    Of a mode that is fast beside the others, and short or small, little is left in means of neighbours: what is not
    found in these is looked for at the beginning, where the record is finer than they are.
    """
    slow, fast = _fastest(x, interval), _fastest_at_the_beginning(x, interval)
    for fastest in (slow,) if modes == 1 or fast <= slow else (slow, fast):
        fit = _fitted(x, interval, modes, fastest)
        if fit is not None and fit.seen:
            return fit
    return None


def _fitted(x: Array, interval: float, modes: int, fastest: float) -> DecayFit | None:
    """The best fit of so many damped sines, from several starts; None where each start ends at what is none."""
    from scipy.optimize import leastsq

    along, points, step = _means(x, interval, fastest)
    best: tuple[float, NDArray[Any]] | None = None
    for start in _starts(points, step, modes, max(fastest, _fastest(points, step))):
        unit = abs(start.imag).max()
        parameters = np.concatenate([start.real, start.imag]) / unit

        def parts(p: Array, unit: float = unit) -> DampedSines:
            return _projected(unit * (p[:modes] + 1j * p[modes:]), along, points)

        def misfit(p: Array) -> Array:
            return parts(p).misfit

        def tangents(p: Array, unit: float = unit) -> Array:
            return unit * parts(p).jac

        try:
            p, _, about, *_ = leastsq(
                misfit, parameters, Dfun=tangents, full_output=True, maxfev=200, xtol=1e-13, ftol=1e-13
            )
        except np.linalg.LinAlgError:
            # it ran away from this start
            continue
        squares = float(about["fvec"] @ about["fvec"])
        poles = unit * (p[:modes] + 1j * np.abs(p[modes:]))
        # at the points a sine above half their rate is a slower one
        sound = np.all(-poles.real < LARGEST_RATIO * np.abs(poles)) and np.all(poles.imag < math.pi / step)
        if sound and math.isfinite(squares) and (best is None or squares < best[0]):
            best = squares, np.asarray(poles[np.argsort(poles.imag)])
    if best is None:
        return None
    means = _projected(best[1], along, points)
    return DecayFit(means, means if step == interval else _projected(best[1], interval * np.arange(x.size), x))


def _projected(poles: NDArray[Any], time: NDArray[Any], points: NDArray[Any]) -> DampedSines:
    """Damped sines of some poles with amplitudes, offset and line of least squares.

    Raises `LinAlgError` if a pole is no number.
    """
    if not np.isfinite(poles).all():
        raise np.linalg.LinAlgError
    with np.errstate(over="ignore", under="ignore"):
        waves = np.exp(np.clip(np.outer(time, poles.real), -700.0, 50.0)) * np.exp(1j * np.outer(time, poles.imag))
    pairs = np.stack([waves.real, waves.imag], axis=2).reshape(time.size, -1)
    basis = np.column_stack([pairs, np.ones(time.size), time / time[-1] - 0.5])
    size = np.linalg.norm(basis, axis=0)
    # a sine may be gone before its second sample
    size[size == 0.0] = 1.0
    q, r = np.linalg.qr(basis / size)
    factors = np.linalg.lstsq(r, q.T @ points, rcond=1e-13)[0] / size
    a, b = factors[:-2:2], factors[1:-2:2]
    by_real = time[:, None] * (waves.real * a + waves.imag * b)
    by_imag = time[:, None] * (waves.real * b - waves.imag * a)
    slopes = np.column_stack([by_real, by_imag])
    return DampedSines(poles, time, basis, factors, basis @ factors - points, slopes - q @ (q.T @ slopes))


def _fastest(x: Array, interval: float) -> float:
    """Frequency (Hz) below which 99.9 % of the largest lines of the spectrum lie."""
    lines = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(x.size))) ** 2
    large = np.flatnonzero(lines >= 1e-3 * lines.max())
    return float(max(large[-1], 1) / (x.size * interval))


def _fastest_at_the_beginning(x: Array, interval: float) -> float:
    """The largest such frequency (Hz) of the record and of halves of halves of it from its beginning on."""
    sizes = [x.size >> k for k in range(x.size.bit_length()) if x.size >> k >= SHORTEST]
    return max((_fastest(x[:size], interval) for size in sizes), default=_fastest(x, interval))


def _means(x: Array, interval: float, fastest: float) -> tuple[Array, Array, float]:
    """Times (s) from the first sample on, means of neighbours, and the time between them."""
    most = max(int(1.0 / (PER_CYCLE * fastest * interval)), 1)
    block = min(max(x.size // SAMPLES_KEPT, 1), most)
    count = x.size // block
    points = np.asarray(x[: count * block].reshape(count, block).mean(axis=1))
    along = interval * (block * np.arange(count, dtype=float) + 0.5 * (block - 1))
    return np.asarray(along), points, block * interval


def _starts(points: Array, step: float, modes: int, fastest: float) -> list[NDArray[Any]]:
    """Poles to start from: the strongest of matrix pencils of several orders, and the largest line of the spectrum."""
    block = max(int(1.0 / (PER_CYCLE / 2.0 * fastest * step)), 1)
    count = min(points.size // block, PENCIL)
    x = points[: count * block].reshape(count, block).mean(axis=1)
    h = block * step
    size = count // 2
    hankel = np.lib.stride_tricks.sliding_window_view(x, size)
    _, _, rows = np.linalg.svd(hankel - x.mean(), full_matrices=False)
    starts = list[NDArray[Any]]()
    for order in sorted({min(order, size - 1) for order in (2 * modes + 2, 4 * modes + 8)}):
        shape = rows[:order].T
        z = np.linalg.eigvals(np.linalg.lstsq(shape[:-1], shape[1:], rcond=None)[0])
        s = np.log(z[np.abs(z) > 1e-3].astype(complex)) / h
        s = s[(s.imag > 1.0 / (h * count)) & (s.imag < 0.98 * math.pi / h)]
        usual = s[np.abs(s.real) < USUAL_RATIO * s.imag]
        s = usual if usual.size >= modes else s[np.abs(s.real) < LARGEST_RATIO * np.abs(s)]
        if s.size >= modes:
            starts.append(np.asarray(s[_projected(s, h * np.arange(count), x).by_energy[:modes]]))
    lines = np.abs(np.fft.rfft((points - points.mean()) * np.hanning(points.size)))
    top = 2.0 * math.pi * max(int(np.argmax(lines)), 1) / (points.size * step)
    apart = 2.0 * math.pi / (points.size * step) * np.arange(modes)
    starts.append((-0.005 + 1j) * (top + apart))
    return starts


# ---- the damping ratio over the amplitude ----------------------------------------------------------

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
            "frequency: the amplitudes of cycles scatter so much at the end of the record"
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
