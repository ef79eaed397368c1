"""Damping from a free decay: damped sines fitted to the whole record, and the damping ratio over the amplitude.

Least squares with the amplitudes eliminated are those of Golub and Pereyra (1973), by the shorter derivatives of
Kaufman (1975); they start from a matrix pencil (Hua and Sarkar, 1990).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, checked, column, items, quantity, real_array, require, text
from femimpact.identification.one_pole import pattern_in
from femimpact.svg import Band, Chart, Line, axis_of
from femimpact.table import Head, flat_columns, frame_of, head_of_columns, named_column, short_repr

if TYPE_CHECKING:
    import pandas

LEVEL = 0.90
"""Share of records in which an interval holds the truth under white noise."""

CYCLES = 5
"""Cycles of a window."""

FEWEST_CYCLES, FEWEST_SAMPLES = 3.0, 8.0
"""Cycles of a record, and samples of a cycle, below which there is no interval."""

ABOVE_NOISE = 5.0
"""Least amplitude of a window, by the standard deviation of the noise."""

CHANGES = 0.5
"""Share of the decrement by which it may change within a window."""

SURE = 3.0
"""Standard deviations beyond which a change of the decrement is none of noise."""

SAMPLES_KEPT, PER_CYCLE = 2000, 16.0
"""Of a longer record means of neighbours are fitted, at least so many in a cycle: a damped sine stays one."""

PENCIL = 600
"""Most samples of a matrix pencil."""

SEEN = (30.0, 6.0)
"""A mode is told from noise where it takes more than a + b ln(samples) variances of the noise from the squares."""

NEGLIGIBLE = 1e-5
"""Share of the largest value below which a misfit, of rounding or of a step in time, does not matter."""

RIPPLE = 0.02
"""By how much the ratio in a window hangs on what ratio is meant, by the share of other frequencies in it (rms).

A third harmonic of the share h sqrt(2) gives ln sqrt(x^2 + (x'/omega)^2) a ripple of 2 sqrt(2) h at twice the
frequency. A line of least squares through it over n cycles takes up to 12/n^3 n/(4 pi) of that per cycle, over 2 pi
in the ratio: 0.0172 h, and more of higher ones. Sines fitted to whole cycles take nothing. (Derived here.)
"""

LARGEST_RATIO = 0.5
"""A pole of larger damping is no vibration."""


COLUMNS = ("time", "amplitude", "frequency", "damping_ratio", "low", "high", "from_maxima")
"""Of the table over the amplitude."""


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
        At the first sample, in the unit of the signal.
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
        shown = []
        for value, (low, high), unit in (
            (self.frequency, self.frequency_interval, " Hz"),
            (100.0 * self.damping_ratio, 100.0 * np.array(self.damping_ratio_interval), " %"),
        ):
            known = math.isfinite(low + high)
            interval = f"{LEVEL:.0%} interval {low:.6g} to {high:.6g}" if known else "no interval"
            shown.append(f"{value:.6g}{unit} ({interval})")
        return f"{shown[0]}, damping ratio {shown[1]}, amplitude {self.amplitude:.4g}"


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
        said = (
            f"{len(self.modes)} mode{'s' * (len(self.modes) > 1)}, {len(self)} windows, {len(self.warnings)} warnings"
        )
        return head_of_columns(f"DecayEstimate: {said}", *self.columns())

    @property
    def _picture(self) -> Chart | None:
        """The damping ratio over the amplitude."""
        if not len(self):
            return None
        across = axis_of(f"amplitude ({self.unit})" if self.unit else "amplitude", self.amplitude, zero=True)
        ratio, known = 100.0 * self.damping_ratio, np.isfinite(self.low)
        order = np.argsort(self.amplitude)
        x, low, high = (values[order][known[order]] for values in (self.amplitude, 100.0 * self.low, 100.0 * self.high))
        bands = (Band(f"{self.level:.0%} interval", x, low, high),) if x.size > 1 else ()
        up = axis_of("damping ratio (%)", ratio, 100.0 * self.low, 100.0 * self.high, zero=True)
        lines = (Line("damping ratio", self.amplitude[order], ratio[order], 1, "dots"),)
        return Chart("Damping ratio over the amplitude", across, up, lines, bands)

    def columns(self) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
        """Columns of the table over the amplitude, and their units."""
        columns, units = flat_columns(self)
        return columns, units | {"amplitude": self.unit}

    def __str__(self) -> str:
        lines = [
            *map(str, self.modes),
            *(f"warning: {one}" for one in self.warnings),
            *(f"note: {one}" for one in self.notes),
        ]
        return "\n".join(lines)

    def to_pandas(self) -> pandas.DataFrame:
        """The table over the amplitude; `attrs["units"]` holds the units by name."""
        return frame_of(*self.columns())


def identify_decay(time: ArrayLike, signal: ArrayLike, *, modes: int = 1) -> DecayEstimate:
    """Frequencies and damping ratios of a free decay, with intervals, and the damping ratio over the amplitude.

    Fitted by least squares to the whole record are damped sines with an offset and a line. Beside them stands a
    table of windows of 5 cycles, in which the damping may depend on the amplitude. The base must be at rest, and no
    force act: a base that still moves drives the structure, and what is read is no damping.

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
        Intervals of 90 % under white noise. There are none, and a warning says why, where the signal is clipped, the
        record is shorter than 3 cycles, a cycle has fewer than 8 samples, or the misfit of the damped sines is no
        noise; of a window, where its decrement changes by more than half.

    Raises
    ------
    InputError
        If time and signal are not finite or not of one length, the times are not evenly spaced, there are fewer than
        16 samples, the signal is constant, or the number of modes is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import femimpact as fi
    >>> t = np.arange(0.0, 8.0, 0.005)
    >>> found = fi.identify_decay(t, np.exp(-0.1 * t) * np.cos(2 * np.pi * 5.0 * t))
    >>> f"{found.modes[0].frequency:.3f} Hz, {100 * found.modes[0].damping_ratio:.3f} %"
    '5.000 Hz, 0.318 %'
    """
    modes = checked("modes", modes, quantity("1", at_least=1, at_most=3, integer=True))
    t, y, interval = _checked_signal(time, signal)
    clipped = _clipped(y)
    # the fit does not hang on units
    offset, scale = float(y.mean()), float(np.max(np.abs(y - y.mean())))
    x = (y - offset) / scale
    fit = _fitted(x, interval, modes)
    while len(fit.poles) > 1 and not all(fit.seen):
        # what is left of several may be one that was split
        fit = _fitted(x, interval, len(fit.poles) - 1)
    seen = bool(fit.poles.size) and all(fit.seen)
    frequency = fit.main.imag / (2.0 * math.pi) if seen else math.nan
    noise = _noise(x - fit.beside_main(x.size), interval, frequency)
    nothing_seen = f"no decay can be told from noise in {fit.time.size} points: no frequency and no damping ratio"
    warnings = _unfit(fit, t.size * interval, interval, clipped) if seen else [nothing_seen]
    spoilt = bool(warnings)
    missing = modes - len(fit.poles) if seen else modes
    if seen and missing:
        warnings.append(f"{modes} modes were asked for, and {len(fit.poles)} can be told from noise")
    found = _modes(fit, scale, spoilt) if seen else ()
    table, about, counted = _windows(t, x - fit.beside_main(x.size), interval, frequency, noise, spoilt)
    if seen and not spoilt:
        reason = fit.reason_against(x)
        if reason:
            warnings.append(reason)
            found = _modes(fit, scale, True)
        if reason and _beats(x, fit):
            warnings.append("the envelope beats: no interval over the amplitude either; fit several modes")
            table[4:6], about = math.nan, []
    nothing = DecayMode(math.nan, math.nan, math.nan, (math.nan, math.nan), (math.nan, math.nan))
    table[1] *= scale
    return DecayEstimate(
        modes=(*found, *(nothing,) * missing), **dict(zip(COLUMNS, table, strict=True)), noise=noise * scale,
        unit=str(getattr(signal, "attrs", {}).get("units", "")), warnings=(*warnings, *about), notes=tuple(counted),
    )  # fmt: skip


def _checked_signal(time: ArrayLike, signal: ArrayLike) -> tuple[Array, Array, float]:
    """Times (s), the signal, and the interval between samples (s)."""
    t = real_array("time", time, "s", "must be a row of finite numbers")
    y = real_array("signal", signal, "", "must be a row of finite numbers")
    require(t.ndim == 1 and t.shape == y.shape, "signal", y.shape, "", f"must be as long as time, shape {t.shape}")
    require(t.size >= 16, "signal", t.size, "samples", "must hold at least 16")
    interval = float(t[-1] - t[0]) / (t.size - 1)
    even = interval > 0.0 and bool(np.all(np.abs(t - t[0] - interval * np.arange(t.size)) <= 0.25 * interval))
    steps = np.diff(t)
    allowed = "must be evenly spaced: a sample is lost, or resample it first (numpy.interp)"
    require(even, "time", f"steps of {steps.min():.6g} to {steps.max():.6g}", "s", allowed)
    require(float(np.ptp(y)) > 1e-12 * float(np.max(np.abs(y))), "signal", float(y[0]), "", "must not be constant")
    return t, y, interval


def _clipped(y: Array) -> tuple[int, float]:
    """Most consecutive samples at the largest or the smallest value where it is clipped there, and that value."""
    values = np.unique(y)
    resolution = float(np.min(np.diff(values)))
    half = 0.5 * float(values[-1] - values[0])
    for top in (values[-1], values[0]):
        at = np.flatnonzero(y == top)
        runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
        longest = max(map(len, runs))
        # the top of a sine of few bits is flat too: as many samples as between the crossings of the last step
        flat = _flat_samples(y, int(runs[0][0]), resolution, half)
        if longest > max(1.0, 1.5 * flat):
            return longest, float(top)
    return 0, 0.0


def _flat_samples(y: Array, at: int, resolution: float, half: float) -> float:
    """Samples that the top of an unclipped sine may have within one step of its resolution."""
    centre = 0.5 * (float(y.max()) + float(y.min()))
    above = (y[max(at - y.size // 2, 0) :] - centre) > 0.0
    crossings = int(np.count_nonzero(np.diff(above.astype(int))))
    cycle = 2.0 * above.size / max(crossings, 1)
    return cycle / math.pi * math.sqrt(2.0 * resolution / half) + 1.0 if resolution > 1e-9 * half else 1.0


# ---- damped sines ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Fit:
    """Damped sines, an offset and a line at a minimum of the squares, over means of neighbouring samples."""

    poles: NDArray[Any]  # (modes,) complex, 1/s, of positive frequency, by it
    time: Array  # (points,) s
    interval: float  # s, of the record
    basis: Array  # (points, 2 modes + 2): cosines and sines in pairs, offset, line
    factors: Array  # (2 modes + 2,)
    misfit: Array  # (points,)
    jac: Array  # (points, 2 modes) by the poles' real and imaginary parts, orthogonal to the basis
    seen: tuple[bool, ...] = ()

    @property
    def squares(self) -> float:
        return float(self.misfit @ self.misfit)

    @property
    def variance(self) -> float:
        return self.squares / float(max(self.time.size - 2 * self.basis.shape[1] + 2, 1))

    @property
    def amplitudes(self) -> Array:
        """Of the modes at t = 0."""
        return np.hypot(self.factors[:-2:2], self.factors[1:-2:2])

    @property
    def largest(self) -> int:
        """The mode of most energy."""
        return int(np.argmax([np.sum((self.basis[:, 2 * k : 2 * k + 2] @ self.factors[2 * k : 2 * k + 2]) ** 2)
                              for k in range(self.poles.size)]))  # fmt: skip

    @property
    def main(self) -> complex:
        return complex(self.poles[self.largest])

    def beside_main(self, count: int) -> Array:
        """What all parts but the largest mode are at each sample of the record."""
        others = self.factors.copy()
        others[2 * self.largest : 2 * self.largest + 2] = 0.0
        return np.asarray(_basis(self.poles, self.interval * np.arange(count), self.time[-1]) @ others)

    def reason_against(self, x: Array) -> str:
        """A warning where the misfit is no noise of one size; empty where it may be."""
        size = math.sqrt(self.squares / self.time.size)
        if size <= NEGLIGIBLE:
            return ""
        found = pattern_in(self.misfit, np.column_stack([self.jac, self.basis]), self._further_terms())
        found = found or self._uneven()
        if not found:
            return ""
        words = (
            f"no linear decay, and no interval: the misfit of {100.0 * size:.2g} % of the largest value is no noise: "
        )
        count = self.poles.size + 1
        if count <= 3:
            other = _fitted(x, self.interval, count)
            terms = np.column_stack([other.jac, other.basis])
            apart = float(np.min(np.diff(other.poles.imag), initial=math.inf)) * self.time[-1] > 2.0 * math.pi
            if all(other.seen) and apart and not pattern_in(other.misfit, terms, other._further_terms()):
                shown = " and ".join(f"{p.imag / (2.0 * math.pi):.4g}" for p in other.poles)
                return f"{words}{found}. {count} modes, of {shown} Hz, leave noise alone: modes={count}"
        return f"{words}{found}. Read the ratio over the amplitude"

    def _uneven(self) -> str:
        """Words where the misfit falls or rises with the amplitude."""
        from scipy.special import fdtri

        envelope = np.abs(np.exp(self.main.real * self.time))
        order = np.argsort(envelope)
        small, large = (float(np.mean(self.misfit[part] ** 2)) for part in np.array_split(order, 2))
        freedom = self.time.size / 2 - self.basis.shape[1]
        limit = float(fdtri(freedom, freedom, 0.9975)) if freedom > 4 else math.inf
        ratio = max(small, large) / max(min(small, large), 1e-300)
        if ratio <= limit:
            return ""
        where = "large" if large > small else "small"
        return f"it is {math.sqrt(ratio):.3g} times as large where the amplitude is {where}"

    def _further_terms(self) -> dict[str, Array]:
        """What a damping and a frequency that depend on the amplitude, and harmonics, would add."""
        terms = {}
        u = self.time / self.time[-1]
        for k, pole in enumerate(self.poles):
            pair = self.basis[:, 2 * k : 2 * k + 2]
            shown = f"{pole.imag / (2.0 * math.pi):.4g} Hz"
            terms[f"a damping and a frequency of {shown} that change"] = np.column_stack(
                [pair * u[:, None] ** 2, pair * u[:, None] ** 3]
            )
            envelope = np.exp(pole.real * self.time)
            turned = [p(n * pole.imag * self.time) * envelope for n in (2, 3) for p in (np.cos, np.sin)]
            terms[f"harmonics of {shown}"] = np.column_stack(turned)
        return terms


def _basis(poles: NDArray[Any], time: NDArray[Any], end: float) -> Array:
    """Cosine and sine of every pole (1/s), an offset and a line."""
    with np.errstate(over="ignore", under="ignore"):
        waves = np.exp(np.clip(np.outer(time, poles.real), -700.0, 50.0)) * np.exp(1j * np.outer(time, poles.imag))
    pairs = np.stack([waves.real, waves.imag], axis=2).reshape(time.size, -1)
    return np.column_stack([pairs, np.ones(time.size), time / end - 0.5])


def _fitted(x: Array, interval: float, modes: int) -> _Fit:
    """The best fit of so many damped sines, from several starts."""
    from scipy.optimize import leastsq

    along, points, step = _means(x, interval, _fastest(x, interval))
    best: tuple[float, NDArray[Any]] | None = None
    for start in _starts(points, step, modes):
        unit = abs(start.imag).max()
        given = np.concatenate([start.real, start.imag]) / unit

        def parts(p: Array, unit: float = unit) -> tuple[Array, Array, Array, Array]:
            return _projected(unit * (p[:modes] + 1j * p[modes:]), along, points)

        def misfit(p: Array) -> Array:
            return parts(p)[2]

        def tangents(p: Array, unit: float = unit) -> Array:
            return unit * parts(p)[3]

        p, _, about, *_ = leastsq(misfit, given, Dfun=tangents, full_output=True, maxfev=200, xtol=1e-13, ftol=1e-13)
        squares = float(about["fvec"] @ about["fvec"])
        poles = unit * (p[:modes] + 1j * np.abs(p[modes:]))
        sound = np.all(np.isfinite(p)) and np.all(-poles.real < LARGEST_RATIO * np.abs(poles))
        if sound and (best is None or squares < best[0]):
            best = squares, np.asarray(poles[np.argsort(poles.imag)])
    poles = best[1] if best else np.zeros(0, dtype=complex)
    basis, factors, left, jac = _projected(poles, along, points)
    made = _Fit(poles, along, interval, basis, factors, left, jac)
    return replace(made, seen=_seen(made, points))


def _seen(fit: _Fit, points: Array) -> tuple[bool, ...]:
    """For every mode whether the squares of the misfit without it are larger than noise makes them."""
    limit = (SEEN[0] + SEEN[1] * math.log(points.size)) * fit.variance
    found = []
    for k in range(fit.poles.size):
        rest = np.delete(fit.basis, [2 * k, 2 * k + 1], axis=1)
        factors = np.linalg.lstsq(rest, points, rcond=None)[0]
        found.append(float(np.sum((points - rest @ factors) ** 2)) - fit.squares > limit)
    return tuple(found)


def _projected(poles: NDArray[Any], time: NDArray[Any], points: NDArray[Any]) -> tuple[Array, Array, Array, Array]:
    """Basis, its factors of least squares, the misfit, and its derivatives by the poles beyond the basis."""
    basis = _basis(poles, time, float(time[-1]))
    size = np.linalg.norm(basis, axis=0)
    q, r = np.linalg.qr(basis / size)
    factors = np.linalg.lstsq(r, q.T @ points, rcond=1e-13)[0] / size
    waves = basis[:, :-2].reshape(time.size, -1, 2)
    a, b = factors[:-2:2], factors[1:-2:2]
    by_real = time[:, None] * (waves[:, :, 0] * a + waves[:, :, 1] * b)
    by_imag = time[:, None] * (waves[:, :, 0] * b - waves[:, :, 1] * a)
    slopes = np.column_stack([by_real, by_imag])
    return basis, factors, basis @ factors - points, slopes - q @ (q.T @ slopes)


def _fastest(x: Array, interval: float) -> float:
    """Frequency (Hz) below which 99.9 % of the largest lines of the spectrum lie."""
    lines = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(x.size))) ** 2
    large = np.flatnonzero(lines >= 1e-3 * lines.max())
    return float(max(large[-1], 1) / (x.size * interval))


def _means(x: Array, interval: float, fastest: float) -> tuple[Array, Array, float]:
    """Times (s) from the first sample on, means of neighbours, and the time between them."""
    most = max(int(1.0 / (PER_CYCLE * fastest * interval)), 1)
    block = min(max(x.size // SAMPLES_KEPT, 1), most)
    count = x.size // block
    points = np.asarray(x[: count * block].reshape(count, block).mean(axis=1))
    along = interval * (block * np.arange(count, dtype=float) + 0.5 * (block - 1))
    return np.asarray(along), points, block * interval


def _starts(points: Array, step: float, modes: int) -> list[NDArray[Any]]:
    """Poles to start from: the strongest of matrix pencils of several orders, and the largest line of the spectrum."""
    block = max(int(1.0 / (PER_CYCLE / 2.0 * _fastest(points, step) * step)), 1)
    count = min(points.size // block, PENCIL)
    x = points[: count * block].reshape(count, block).mean(axis=1)
    h = block * step
    size = count // 2
    hankel = np.lib.stride_tricks.sliding_window_view(x, size)
    _, _, rows = np.linalg.svd(hankel - x.mean(), full_matrices=False)
    found = list[NDArray[Any]]()
    for order in sorted({min(order, size - 1) for order in (2 * modes + 2, 4 * modes + 8)}):
        shape = rows[:order].T
        z = np.linalg.eigvals(np.linalg.lstsq(shape[:-1], shape[1:], rcond=None)[0])
        s = np.log(z[np.abs(z) > 1e-3]) / h
        s = s[(s.imag > 1.0 / (h * count)) & (s.imag < 0.98 * math.pi / h) & (np.abs(s.real) < LARGEST_RATIO * s.imag)]
        if s.size < modes:
            continue
        along = h * np.arange(count)
        basis, factors, *_ = _projected(s, along, x)
        energy = [np.sum((basis[:, 2 * k : 2 * k + 2] @ factors[2 * k : 2 * k + 2]) ** 2) for k in range(s.size)]
        found.append(np.asarray(s[np.argsort(energy)[::-1][:modes]]))
    lines = np.abs(np.fft.rfft((points - points.mean()) * np.hanning(points.size)))
    top = 2.0 * math.pi * max(int(np.argmax(lines)), 1) / (points.size * step)
    apart = 2.0 * math.pi / (points.size * step) * np.arange(modes)
    found.append((-0.005 + 1j) * (top + apart))
    return found


def _modes(fit: _Fit, scale: float, spoilt: bool) -> tuple[DecayMode, ...]:
    from scipy.special import stdtrit

    count = fit.poles.size
    # points are never known better than to the last bits
    covariance = (fit.variance + 1e-20) * np.linalg.pinv(fit.jac.T @ fit.jac, hermitian=True)
    width = float(stdtrit(max(fit.time.size - 4 * count - 2, 1), 0.5 + 0.5 * LEVEL))
    found = []
    for k, pole in enumerate(fit.poles):
        omega = abs(pole)
        chosen = covariance[np.ix_([k, count + k], [k, count + k])]
        # derivatives of frequency and ratio by the real and the imaginary part of the pole
        by = np.array([[pole.real, pole.imag], [-(pole.imag**2) / omega, pole.real * pole.imag / omega]])
        by /= np.array([[2.0 * math.pi * omega], [omega**2]])
        spread = width * np.sqrt(np.diag(by @ chosen @ by.T))
        values = np.array([omega / (2.0 * math.pi), -pole.real / omega])
        low, high = (values + sign * (math.nan if spoilt else spread) for sign in (-1.0, 1.0))
        f, ratio = ((float(a), float(b)) for a, b in zip(low, high, strict=True))
        found.append(DecayMode(float(values[0]), float(values[1]), float(scale * fit.amplitudes[k]), f, ratio))
    return tuple(found)


def _unfit(fit: _Fit, duration: float, interval: float, clipped: tuple[int, float]) -> list[str]:
    """Warnings of a record that bears no interval."""
    slowest, fastest = (float(p.imag) / (2.0 * math.pi) for p in (fit.poles[0], fit.poles[-1]))
    cycles, samples = duration * slowest, 1.0 / (interval * fastest)
    found = []
    if clipped[0]:
        found.append(f"no interval: the signal is clipped, {clipped[0]} consecutive samples are at {clipped[1]:.6g}")
    if cycles < FEWEST_CYCLES:
        found.append(
            f"no interval: the record has {cycles:.2g} cycles of {slowest:.4g} Hz (at least {FEWEST_CYCLES:g})"
        )
    if samples < FEWEST_SAMPLES:
        words = f"a cycle of {fastest:.4g} Hz has {samples:.3g} samples (at least {FEWEST_SAMPLES:g})"
        found.append(f"no interval: {words}")
    for mode in _modes(fit, 1.0, False):
        if mode.damping_ratio_interval[1] < 0.0:
            found.append(
                f"no interval: the amplitude of {mode.frequency:.4g} Hz grows, by a damping ratio of "
                f"{100.0 * mode.damping_ratio:.3g} %: no free decay"
            )
    near = float(np.min(np.diff(fit.poles.imag), initial=math.inf)) / (2.0 * math.pi)
    if near * duration < 1.0:
        found.append(
            f"no interval: two modes are {near:.2g} Hz apart, below the {1.0 / duration:.2g} Hz of one beat in the "
            "record: they may be one whose damping depends on the amplitude"
        )
    return found


# ---- over the amplitude ----------------------------------------------------------------------------


def _noise(x: Array, interval: float, frequency: float) -> float:
    """Standard deviation of what is faster than 10 times the frequency (Hz), or than half of what is recorded."""
    taper = np.hanning(x.size + 2)[1:-1]
    lines = np.abs(np.fft.rfft((x - x.mean()) * taper)) ** 2
    faster = np.fft.rfftfreq(x.size, interval) >= min(10.0 * frequency, 0.25 / interval)
    return math.sqrt(float(np.mean(lines[faster])) / float(taper @ taper)) if faster.any() else math.nan


@dataclass(frozen=True, eq=False)
class _Window:
    """Sines of one frequency fitted to the cycles of a window, with an offset and a line."""

    frequency: float  # Hz
    logarithms: Array  # (cycles,) of the amplitudes
    offset: Array  # (samples,) what is taken off
    left: float  # standard deviation of the misfit
    spread: Array  # (cycles,) of the logarithms by that of the noise

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
"""Weights of the logarithms of the cycles."""


def _window(x: Array, interval: float, frequency: float) -> _Window | None:
    """The fit to 5 cycles from the first sample on, at the frequency (Hz) that their phases show; None without one."""
    decay, size = 0.0, 0
    for _ in range(4):
        size = round(CYCLES / (frequency * interval))
        if size > x.size or size < 3 * CYCLES:
            return None
        u = frequency * interval * np.arange(size)
        cycle = np.minimum(u.astype(int), CYCLES - 1)
        basis = np.zeros((size, 2 * CYCLES + 2))
        envelope = np.exp(decay * (u - cycle - 0.5))
        basis[np.arange(size), 2 * cycle] = np.cos(2.0 * math.pi * u) * envelope
        basis[np.arange(size), 2 * cycle + 1] = np.sin(2.0 * math.pi * u) * envelope
        basis[:, -2], basis[:, -1] = 1.0, u / CYCLES - 0.5
        factors, _, rank, _ = np.linalg.lstsq(basis, x[:size], rcond=None)
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
    misfit = x[:size] - basis @ factors
    left = math.sqrt(float(misfit @ misfit) / max(size - basis.shape[1], 1))
    logarithms = np.log(np.hypot(a, b))
    spread = math.sqrt(2.0 * CYCLES / size) / np.exp(logarithms)
    return _Window(frequency, logarithms, basis[:, -2:] @ factors[-2:], left, spread)


def _windows(
    time: Array, x: Array, interval: float, frequency: float, noise: float, spoilt: bool
) -> tuple[Array, list[str], list[str]]:
    """Columns of the table over the amplitude (7, windows), warnings, and notes."""
    from scipy.special import ndtri

    rows, changes, left_out, unread, begin = list[tuple[float, ...]](), list[float](), 0, 0, 0
    cycle = frequency
    while math.isfinite(cycle) and round(CYCLES / (cycle * interval)) <= x.size - begin:
        found = _window(x[begin:], interval, cycle)
        size = found.offset.size if found else round(CYCLES / (cycle * interval))
        amplitude = math.exp(float(found.logarithms.mean())) if found else math.nan
        part, first = x[begin : begin + size], time[begin]
        begin += size
        if found is None or not abs(found.frequency / frequency - 1.0) < 0.2:
            unread += 1
            continue
        if amplitude < ABOVE_NOISE * noise:
            left_out += 1
            continue
        cycle, ratio = found.frequency, -found.slope / (2.0 * math.pi)
        other = math.sqrt(max(found.left**2 - noise**2, 0.0)) / amplitude
        random = noise * math.sqrt(float(_SLOPE**2 @ found.spread**2)) / (2.0 * math.pi)
        half = float(ndtri(0.5 + 0.5 * LEVEL)) * math.hypot(random, RIPPLE * other)
        change, spread = found.change
        if change - SURE * noise * spread > CHANGES * abs(found.slope):
            changes.append(100.0 * change / max(abs(found.slope), 1e-300))
            half = math.nan
        half = math.nan if spoilt else half
        maxima = _from_maxima(part - found.offset)
        middle = first + 0.5 * (size - 1) * interval
        rows.append((middle, amplitude, found.frequency, ratio, ratio - half, ratio + half, maxima))
    warnings, notes = [], []
    if changes and not spoilt:
        warnings.append(
            f"no interval of {len(changes)} of {len(rows)} windows: the decrement changes within one by up to "
            f"{max(changes):.0f} % (at most {100.0 * CHANGES:.0f} %)"
        )
    if left_out:
        notes.append(f"{left_out} windows whose amplitude is below {ABOVE_NOISE:g} times the noise are left out")
    if unread:
        notes.append(f"{unread} windows without a motion of about {frequency:.4g} Hz are left out")
    return np.array(rows, dtype=float).reshape(-1, 7).T.copy(), warnings, notes


def _from_maxima(x: Array) -> float:
    """The ratio by the largest values of the first and the last cycle."""
    cycle = round(x.size / CYCLES)
    first, last = float(x[:cycle].max()), float(x[-cycle:].max())
    return math.log(first / last) / (2.0 * math.pi * (CYCLES - 1)) if first > 0.0 and last > 0.0 else math.nan


def _beats(x: Array, fit: _Fit) -> bool:
    """True if the amplitude of cycles rises again after it has fallen, by more than noise lifts it."""
    along = fit.interval * np.arange(x.size)
    cycle = max(round(2.0 * math.pi / (fit.main.imag * fit.interval)), 1)
    flat = x - fit.basis[0, -2] * fit.factors[-2] - (along / fit.time[-1] - 0.5) * fit.factors[-1]
    count = x.size // (2 * cycle)
    turned = (flat * np.exp(-1j * fit.main.imag * along))[: 2 * count * cycle].reshape(count, -1)
    amplitude = 2.0 * np.abs(turned.mean(axis=1))
    rise = amplitude - np.minimum.accumulate(amplitude)
    noise = math.sqrt(fit.variance / (2 * cycle))
    return bool(count >= 3 and rise.max() > max(0.1 * amplitude.max(), 6.0 * noise))
