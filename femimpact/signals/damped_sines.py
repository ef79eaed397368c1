"""Damped sines fitted to a free decay by least squares, and what speaks against them.

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

NEGLIGIBLE = 1e-5
"""Share of the largest value below which a misfit, of rounding or of a step in time, does not matter."""

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
        words = f"no linear decay, and no interval: the misfit of {share} is no noise: {pattern}"
        count = self.means.poles.size + 1
        other = seen_fit(x, interval, count) if count <= 3 else None
        if other is not None:
            poles, end = other.means.poles, other.means.time[-1]
            if float(np.min(np.diff(poles.imag))) * end > 2.0 * math.pi and not other.means.pattern:
                frequencies = " and ".join(f"{p.imag / (2.0 * math.pi):.4g}" for p in poles)
                words += f". {count} modes, of {frequencies} Hz, leave noise alone: modes={count}"
                return f"{words}; with fewer there is no interval over the amplitude either", True
        return f"{words}. Read the ratio over the amplitude", False

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
