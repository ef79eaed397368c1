"""Damping and frequency from a response curve: arrays in, estimates out, measured or simulated alike."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, checked, quantity, real_array, require, require_type, text

__all__ = [
    "UNRESOLVED",
    "DampingEstimate",
    "PeakResolution",
    "amplitude_ratio_damping",
    "fit_one_pole",
    "half_power",
    "one_pole_amplitude",
    "peak_resolution",
    "resolution_warnings",
]

Array = NDArray[np.float64]

RESOLVED = 4.0
"""A half-power width counts as resolved when it holds this many frequency steps: the peak is then 3 % low at most."""

UNRESOLVED = "does not resolve the half-power width"
"""Words of every warning that a grid is too coarse, by which it is known."""


SYSTEMATIC = 2.5
"""Standard errors beyond which neighbouring misfits are alike: the curve is then not one pole plus noise."""

ENOUGH_POINTS = 8
"""Fewer do not distinguish a second pole from noise."""

CONFIDENCE = 0.995
"""With which a curve is called more than one pole and noise."""

NEGLIGIBLE_MISFIT = 1e-5
"""Share of the peak below which a misfit, of far modes or of rounding, does not matter."""

KNOWN = 1e-8
"""Share of the peak to which any point is known."""

UNDETERMINED = math.log(10.0)
"""Half-width of the logarithm's interval beyond which the points do not determine the ratio."""


@dataclass(frozen=True)
class DampingEstimate:
    """Damping ratio of one resonance, how it was found and how sure it is.

    Parameters
    ----------
    ratio : float, 1
        Not a number where the method found none.
    frequency : float, Hz
        Natural frequency (fit) or frequency of the peak (half-power); not a number where no curve was read.
    interval : pair of float, 1
        95 % confidence interval of the fit's ratio, not a number where the misfit is no noise; for half-power,
        what the grid leaves open.
    method : str
    warnings : tuple of str

    Raises
    ------
    InputError
        If the ratio is negative, the frequency is not > 0, or the interval is not two numbers, the lower one
        first.
    """

    ratio: float = field(metadata=quantity("1", at_least=0.0, finite=False))
    frequency: float = field(metadata=quantity("Hz", above=0.0, finite=False))
    interval: tuple[float, float] = field(metadata=quantity("1", finite=False, several=True))
    method: str = field(metadata=text())
    warnings: tuple[str, ...] = field(default=(), metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)
        two = isinstance(self.interval, tuple) and len(self.interval) == 2 and not self.interval[0] > self.interval[1]
        require(two, "interval", self.interval, "1", "must be two numbers, the lower one first")

    def __str__(self) -> str:
        low, high = self.interval
        interval = f"{low:.4g} to {high:.4g}" if math.isfinite(low + high) else "no interval"
        ratio = f"{self.ratio:.4g} ({interval})" if math.isfinite(self.ratio) else "no damping ratio"
        text = f"{ratio} at {self.frequency:.6g} Hz by {self.method}"
        return text + "".join(f"\n  warning: {warning}" for warning in self.warnings)


def one_pole_amplitude(frequency: ArrayLike, scale: float, natural_frequency: float, ratio: float) -> Array:
    """Relative displacement amplitude of one mode under a sine of the base.

    |X| = scale f^2 / sqrt((f0^2 - f^2)^2 + (2 zeta f0 f)^2)

    Parameters
    ----------
    frequency : array_like, Hz
    scale : float, m
        Base amplitude times participation factor times the mode's displacement.
    natural_frequency : float, Hz
    ratio : float, 1

    Returns
    -------
    ndarray, m

    Raises
    ------
    InputError
        If a number is not finite, or natural frequency or ratio are not > 0.
    """
    f = real_array("frequency", frequency, "Hz", "must be finite numbers")
    scale = checked("scale", scale, quantity("m"))
    natural_frequency = checked("natural_frequency", natural_frequency, quantity("Hz", above=0.0))
    return _one_pole(f, scale, natural_frequency, checked("ratio", ratio, quantity("1", above=0.0)))


def _one_pole(f: Array, scale: float, natural_frequency: float, ratio: float) -> Array:
    return np.asarray(scale * f**2 / np.hypot(natural_frequency**2 - f**2, 2.0 * ratio * natural_frequency * f))


def _checked(frequency: ArrayLike, amplitude: ArrayLike, least: int) -> tuple[Array, Array]:
    # a case that failed is not a number and left out; why a masked one is masked is unknown
    f = real_array("frequency", frequency, "Hz", "must be a row of numbers", finite=False)
    x = real_array("amplitude", amplitude, "m", "must be a row of numbers", finite=False)
    same = f.ndim == 1 and f.shape == x.shape
    require(same, "amplitude", x.shape, "", f"must be as long as frequency, shape {f.shape}")
    usable = np.isfinite(f) & np.isfinite(x)
    f, x = f[usable], x[usable]
    order = np.argsort(f)
    f, x = f[order], x[order]
    require(f.size >= least, "frequency", f.size, "points", f"must hold at least {least} finite points")
    require(bool(np.all(f > 0)), "frequency", float(f.min()), "Hz", "must be > 0")
    require(bool(np.all(np.diff(f) > 0)), "frequency", None, "Hz", "must not repeat")
    require(bool(np.all(x >= 0) and np.any(x > 0)), "amplitude", None, "m", "must be >= 0 and not all zero")
    return f, x


def half_power(frequency: ArrayLike, amplitude: ArrayLike) -> DampingEstimate:
    """Half-power bandwidth: zeta = (f2^2 - f1^2)/(4 f_peak^2) between the crossings of peak/sqrt(2).

    Clough and Penzien (2003).

    Parameters
    ----------
    frequency : array_like (n,), Hz
    amplitude : array_like (n,), m

    Returns
    -------
    DampingEstimate
        Crossings interpolated linearly between points; the interval is what the points on either
        side of each crossing allow. A width of fewer than 4 frequency steps is warned of.

    Raises
    ------
    InputError
        If frequency and amplitude are not of one length, fewer than 3 points are finite, a frequency is not > 0 or
        there twice, or an amplitude is negative.
    """
    f, x = _checked(frequency, amplitude, 3)
    top = int(np.argmax(x))
    level = x[top] / math.sqrt(2.0)
    crossings, brackets = [], []
    for step in (-1, 1):
        i = top
        while 0 <= i + step < f.size and x[i + step] > level:
            i += step
        outer = i + step
        if not 0 <= outer < f.size:
            side = "below" if step < 0 else "above"
            message = f"no half-power point {side} the peak at {f[top]:.4g} Hz within {f[0]:g} to {f[-1]:g} Hz"
            return DampingEstimate(math.nan, float(f[top]), (math.nan, math.nan), "half-power", (message,))
        share = (x[i] - level) / (x[i] - x[outer])
        crossings.append(f[i] + share * (f[outer] - f[i]))
        brackets.append((f[i], f[outer]))

    def ratio(low: float, high: float) -> float:
        return float(((high / f[top]) ** 2 - (low / f[top]) ** 2) / 4.0)

    interval = (ratio(brackets[0][0], brackets[1][0]), ratio(brackets[0][1], brackets[1][1]))
    # a coarse grid widens it: how low the peak is does not follow from it
    warnings = resolution_warnings(peak_resolution(f, f[top], crossings[1] - crossings[0]), of_peak=False)
    value = ratio(crossings[0], crossings[1])
    return DampingEstimate(value, float(f[top]), interval, "half-power", warnings)


def _rounded_down(value: float) -> float:
    """The value, > 0, to two digits and not above it."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.floor(value / unit) * unit


@dataclass(frozen=True)
class PeakResolution:
    """How well a grid of frequencies resolves one resonance.

    Parameters
    ----------
    frequency : float, Hz
        The point of the grid beside which the steps are read.
    step : float, Hz
        The larger of the two steps beside it.
    width : float, Hz
        Half-power width of the resonance.
    """

    frequency: float
    step: float
    width: float

    @property
    def resolved(self) -> bool:
        """Whether the width holds enough steps for a damping ratio and a peak."""
        return self.width >= RESOLVED * self.step

    @property
    def largest_miss(self) -> float:
        """Share by which the largest point of the grid may be below the peak: 1 - 1/sqrt(1 + (step/width)^2).

        Near a resonance at f0 the amplitude is that of the peak over sqrt(1 + (2 (f - f0)/width)^2), and a point of the
        grid lies within half a step of f0. (Derived here.)
        """
        return 1.0 - 1.0 / math.hypot(1.0, self.step / self.width)

    @property
    def step_needed(self) -> float:
        """Largest step (Hz) that resolves the width."""
        return self.width / RESOLVED


def peak_resolution(frequency: ArrayLike, near: float, width: float) -> PeakResolution:
    """Resolution of a resonance by a grid of frequencies.

    Parameters
    ----------
    frequency : array_like (n,), Hz
        n >= 2, ascending.
    near : float, Hz
        The resonance: steps are read beside the point of the grid next to it.
    width : float, Hz
        Its half-power width, 2 zeta f0 where the damping ratio zeta is small.

    Returns
    -------
    PeakResolution
    """
    f = real_array("frequency", frequency, "Hz", "must be finite numbers")
    near = checked("near", near, quantity("Hz", above=0.0))
    width = checked("width", width, quantity("Hz", above=0.0))
    require(f.ndim == 1 and f.size >= 2, "frequency", f.size, "points", "must hold at least 2")
    top = int(np.argmin(np.abs(f - near)))
    return PeakResolution(float(f[top]), float(np.max(np.diff(f[max(top - 1, 0) : top + 2]))), width)


def resolution_warnings(found: PeakResolution, *, of_peak: bool = True) -> tuple[str, ...]:
    """A warning where a grid is too coarse for a resonance; `of_peak` says too how low the peak may be read."""
    if found.resolved:
        return ()
    low = f"the peak may be read up to {100 * found.largest_miss:.2g} % too low (1 - 1/sqrt(1 + (step/width)^2)); "
    return (
        f"the frequency step of {found.step:.3g} Hz {UNRESOLVED} of {found.width:.3g} Hz "
        f"(at least {RESOLVED:g} steps are needed): {low if of_peak else ''}"
        f"take frequencies at most {_rounded_down(found.step_needed):.2g} Hz apart around {found.frequency:.4g} Hz",
    )


def fit_one_pole(
    frequency: ArrayLike, amplitude: ArrayLike, share: float = 0.2, misfit_limit: float = 0.05
) -> DampingEstimate:
    """Least-squares fit of one mode under base motion to a response curve.

    Minimises the sum of (|X_i| - scale f^2/|f0^2 - f^2 + 2 i zeta f0 f|)^2 over scale, f0 and zeta;
    see `one_pole_amplitude`.

    Parameters
    ----------
    frequency : array_like (n,), Hz
    amplitude : array_like (n,), m
        Relative to the base.
    share : float, 1
        Only points above this share of the peak are fitted, and never fewer than the 7 nearest.
    misfit_limit : float, 1
        A root-mean-square misfit above this share of the peak is warned of: not one pole.

    Returns
    -------
    DampingEstimate
        With the 95 % interval of the linearised fit. There is none where the misfit is systematic, and no ratio
        where the points do not determine it or the largest amplitude is at an end of the grid.

    Raises
    ------
    InputError
        If an argument is out of range, frequency and amplitude are not of one length, fewer than 4 points are
        finite, a frequency is not > 0 or there twice, or an amplitude is negative.
    """
    from scipy.optimize import least_squares

    share = checked("share", share, quantity("1", at_least=0.0, at_most=1.0))
    misfit_limit = checked("misfit_limit", misfit_limit, quantity("1", at_least=0.0))
    f, x = _checked(frequency, amplitude, 4)
    top = int(np.argmax(x))
    if top in (0, f.size - 1):
        message = f"no resonance within {f[0]:g} to {f[-1]:g} Hz: the largest amplitude is at the edge, {f[top]:.4g} Hz"
        return DampingEstimate(math.nan, float(f[top]), (math.nan, math.nan), "one-pole least squares", (message,))
    chosen = x >= share * x[top]
    chosen[np.argsort(np.abs(f - f[top]))[:7]] = True
    # both as shares of the peak's: the fit does not hang on units
    f_fit, x_fit = f[chosen] / f[top], x[chosen] / x[top]

    def misfit_of(p: Array) -> Array:
        return np.asarray(_one_pole(f_fit, math.exp(p[0]), p[1], math.exp(p[2])) - x_fit)

    # the residual has several valleys when the grid is coarse: start from narrow and wide peaks
    step = float(np.mean(np.diff(f)))
    starts = [
        np.array([math.log(2.0 * ratio), 1.0 + shift * step / f[top], math.log(ratio)])
        for ratio in (1e-3, 5e-3, 2e-2, 8e-2)
        for shift in (-0.5, 0.0, 0.5)
    ]
    scale = [1.0, 1e-2, 1.0]
    trials: list[Any] = [least_squares(misfit_of, p, x_scale=scale, xtol=1e-14, ftol=1e-14) for p in starts]
    best = min(trials, key=lambda trial: float(trial.cost))
    return _judged(f, float(f[top]), f_fit, x_fit, best, misfit_limit)


def _judged(f: Array, at: float, f_fit: Array, x_fit: Array, best: Any, misfit_limit: float) -> DampingEstimate:
    """The estimate of the best fit, as far as its points determine it: they are shares of the peak, which lies at `at`.

    `f` are all frequencies (Hz).
    """
    from scipy.special import stdtrit

    step = float(np.mean(np.diff(f)))
    ratio, frequency_found = math.exp(best.x[2]), float(best.x[1] * at)
    spread = _spread_of_logarithm(best.jac, 2.0 * best.cost, stdtrit)
    if not f[0] <= frequency_found <= f[-1]:
        message = f"no resonance within {f[0]:g} to {f[-1]:g} Hz: the best fit has its pole at {frequency_found:.4g} Hz"
        return DampingEstimate(math.nan, frequency_found, (math.nan, math.nan), "one-pole least squares", (message,))
    if spread > UNDETERMINED:
        message = (
            f"{f_fit.size} points with steps of {step:.3g} Hz do not determine a damping ratio: "
            f"refine the grid around {at:.4g} Hz"
        )
        return DampingEstimate(math.nan, frequency_found, (math.nan, math.nan), "one-pole least squares", (message,))
    warnings = list(resolution_warnings(peak_resolution(f, frequency_found, 2.0 * ratio * frequency_found)))
    interval = (ratio * math.exp(-spread), ratio * math.exp(spread))
    misfit = math.sqrt(2.0 * best.cost / f_fit.size)
    if misfit > NEGLIGIBLE_MISFIT:
        reason = _no_interval(f_fit, x_fit, best, misfit > misfit_limit, resolved=not warnings)
        if reason:
            interval = (math.nan, math.nan)
            warnings.append(f"no interval: the misfit of {100 * misfit:.2g} % of the peak {reason}")
    if misfit > misfit_limit:
        warnings.append(
            f"the curve is not that of one pole: root-mean-square misfit {100 * misfit:.0f} % of the peak "
            f"(limit {100 * misfit_limit:.0f} %); read the ratio as an equivalent one"
        )
    return DampingEstimate(ratio, frequency_found, interval, "one-pole least squares", tuple(warnings))


def _spread_of_logarithm(jacobian: Array, squares: float, quantile: Any) -> float:
    """Half-width of the 95 % interval of log(ratio), the third parameter; infinite where nothing depends on it."""
    points = jacobian.shape[0]
    freedom = max(points - 3, 1)
    size = np.linalg.norm(jacobian, axis=0)
    if float(size[2]) < 1e-6 * math.sqrt(points):
        return math.inf
    scaled = jacobian / np.where(size > 0.0, size, 1.0)
    normal = scaled.T @ scaled
    if float(np.linalg.eigvalsh(normal)[0]) < 1e-13:
        return math.inf
    # points are never known better than this: a fit through all of them may still be one of many
    variance = (squares / freedom + KNOWN**2) * float(np.linalg.inv(normal)[2, 2]) / float(size[2]) ** 2
    return float(quantile(freedom, 0.975)) * math.sqrt(variance)


def _is_systematic(misfit: Array) -> bool:
    """Whether neighbouring misfits are alike: their correlation beyond what independent ones would have."""
    size = float(misfit @ misfit)
    alike = float(misfit[1:] @ misfit[:-1]) / size if size > 0.0 else 0.0
    return alike > min(SYSTEMATIC / math.sqrt(misfit.size), 0.8)


def _no_interval(f: Array, x: Array, pole: Any, large: bool, resolved: bool) -> str:
    """Why the misfit is not to be taken for noise, or nothing."""
    if f.size < ENOUGH_POINTS or not resolved:
        return f"may be noise or a second pole: {f.size} points of this grid do not decide it"
    if large or _is_systematic(pole.fun) or _is_more_than_a_pole(f, x, pole):
        return "is no noise but systematic, as of a second pole or of a bent peak"
    return ""


def _is_more_than_a_pole(f: Array, x: Array, pole: Any) -> bool:
    """Whether a constant, or a second pole, beside the pole explains much more than noise would let it (F test)."""
    from scipy.optimize import least_squares
    from scipy.special import fdtri

    def first(p: Array) -> NDArray[np.complex128]:
        return np.asarray(math.exp(p[0]) * f**2 / (p[1] ** 2 - f**2 + 2j * math.exp(p[2]) * p[1] * f))

    def with_constant(p: Array) -> Array:
        return np.asarray(np.abs(first(p) + p[3] + 1j * p[4]) - x)

    def with_pole(p: Array) -> Array:
        # as wide as the first: one parameter less to find
        second = p[3] * f**2 / (p[4] ** 2 - f**2 + 2j * math.exp(p[2]) * p[4] * f)
        return np.asarray(np.abs(first(p) + second) - x)

    width = math.exp(pole.x[2]) * float(pole.x[1])
    share = math.exp(pole.x[0])
    # shares of either sign: at none the derivative by its normal part is zero
    constants = [(a, b) for a in (-0.1, 0.1) for b in (-0.1, 0.1)]
    poles = [(a * share, float(pole.x[1]) + d * width) for a in (-0.3, 0.3) for d in (-4.0, -1.0, 1.0, 4.0)]
    freedom = f.size - 5
    quantile = float(fdtri(2, freedom, CONFIDENCE))
    for model, starts, scale in (
        (with_constant, constants, [1.0, 1e-2, 1.0, 1.0, 1.0]),
        (with_pole, poles, [1.0, 1e-2, 1.0, share, 1e-2]),
    ):
        trials = [least_squares(model, np.append(pole.x, more), x_scale=scale, max_nfev=200) for more in starts]
        cost = min(float(trial.cost) for trial in trials)
        if (float(pole.cost) - cost) * freedom > 2.0 * cost * quantile:
            return True
    return False


def amplitude_ratio_damping(reference: DampingEstimate, reference_peak: float, peak: float) -> DampingEstimate:
    """Equivalent damping from the drop of the largest peak: zeta_eq = zeta_ref X_ref/X.

    Parameters
    ----------
    reference : DampingEstimate
        Of the structure without balls.
    reference_peak, peak : float, m
        Largest peaks without and with balls.

    Returns
    -------
    DampingEstimate
        At the reference's frequency; the interval scales with the reference's.

    Raises
    ------
    InputError
        If the reference is none, or a peak is not > 0.
    """
    require_type(reference, DampingEstimate, "reference")
    reference_peak = checked("reference_peak", reference_peak, quantity("m", above=0.0))
    peak = checked("peak", peak, quantity("m", above=0.0))
    drop = reference_peak / peak
    low, high = reference.interval
    return DampingEstimate(
        reference.ratio * drop, reference.frequency, (low * drop, high * drop), "amplitude ratio", reference.warnings
    )
