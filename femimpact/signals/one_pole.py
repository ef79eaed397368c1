"""Damping of one resonance from its response curve: the fit of one mode under base motion, the half-power width."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, quantity, real_array, require, require_name, require_type, takes, text, warns
from femimpact.response.cycles import peak_resolution, resolution_warnings
from femimpact.units import interval_texts, number_text

METHOD = "one-pole least squares"

ENOUGH_POINTS = 15
"""From so many points on, without noise, a second pole of a tenth of the first is seen half a width away or more."""

FEWEST_POLES, MOST_POLES = 8, 60
"""Between which a second pole is looked for at so many places."""

NEGLIGIBLE_MISFIT = 1e-5
"""Share of the peak below which a misfit, of far modes or of rounding, does not matter."""

TOLD_MISFIT = 1e-4
"""Share of the peak above which a misfit is told: a far mode that leaves a smaller one moves the ratio by some 2e-4."""

KNOWN = 1e-8
"""Share of the peak to which any point is known."""

LARGEST = 50.0
"""Power of e that a scale and a ratio are tried up to."""

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

    def __repr__(self) -> str:
        return f"DampingEstimate: {self}"

    def __str__(self) -> str:
        low, high = self.interval
        percent, interval = number_text(self.ratio), "no interval"
        if math.isfinite(low + high):
            percent, least, most = interval_texts(self.ratio, low, high)
            interval = f"{least} to {most}"
        ratio = f"{percent} ({interval})" if math.isfinite(self.ratio) else "no damping ratio"
        text = f"{ratio} at {self.frequency:.6g} Hz by {self.method}"
        return text + "".join(f"\n  warning: {warning}" for warning in self.warnings)


def checked_curve(frequency: ArrayLike, amplitude: ArrayLike, least: int) -> tuple[Array, Array]:
    """Finite points of a curve by rising frequency (Hz), and their amplitudes (m), checked."""
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


def _no_estimate(method: str, frequency: float, why: str) -> DampingEstimate:
    return DampingEstimate(math.nan, float(frequency), (math.nan, math.nan), method, (why,))


@warns
@takes(reference_peak=quantity("m", above=0.0), peak=quantity("m", above=0.0))
def amplitude_ratio_damping(reference: DampingEstimate, reference_peak: float, peak: float) -> DampingEstimate:
    """Equivalent damping from the drop of the largest peak: zeta_eq = zeta_ref X_ref/X.

    Parameters
    ----------
    reference : DampingEstimate
        Of the structure without balls.
    reference_peak, peak : float, m
        Largest peaks without and with balls.
    """
    require_type(reference, DampingEstimate, "reference")
    drop = reference_peak / peak
    low, high = reference.interval
    return DampingEstimate(
        reference.ratio * drop, reference.frequency, (low * drop, high * drop), "amplitude ratio", reference.warnings
    )


@warns
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
    """
    f, x = checked_curve(frequency, amplitude, 3)
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
            return _no_estimate("half-power", f[top], message)
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


def one_pole_amplitude(
    f: Array,  # Hz
    scale: float,  # m: base amplitude times participation factor times the mode's displacement
    natural_frequency: float,  # Hz
    ratio: float,
) -> Array:  # m
    """Relative displacement amplitude of one mode under a sine of the base.

    |X| = scale f^2 / sqrt((f0^2 - f^2)^2 + (2 zeta f0 f)^2)
    """
    return np.asarray(scale * f**2 / np.hypot(natural_frequency**2 - f**2, 2.0 * ratio * natural_frequency * f))


@warns
@takes(share=quantity("1", at_least=0.0, at_most=1.0), misfit_limit=quantity("1", at_least=0.0))
def fit_one_pole(
    frequency: ArrayLike,
    amplitude: ArrayLike,
    share: float = 0.2,
    misfit_limit: float = 0.05,
    held: str = "displacement",
) -> DampingEstimate:
    """Least-squares fit of one mode under base motion to a response curve.

    Minimises the sum of (|X_i| - scale f^2/|f0^2 - f^2 + 2 i zeta f0 f|)^2 over scale, f0 and zeta;
    see `one_pole_amplitude`. At constant acceleration X_i is the amplitude times f_i^2.

    Parameters
    ----------
    frequency : array_like (n,), Hz
    amplitude : array_like (n,), m
        Relative to the base.
    share : float, 1
        All points from the first above this share of the peak to the last are fitted, and never fewer than the 7
        nearest. Those between that are lower count too: a choice by each value would keep the noise that raises it.
    misfit_limit : float, 1
        A root-mean-square misfit above this share of the peak is warned of.
    held : {"displacement", "acceleration"}
        What of the base has one amplitude at all frequencies. A curve under a force is like one at constant
        acceleration; one at any other level is divided by the base's displacement first.

    Returns
    -------
    DampingEstimate
        With the 95 % interval of the linearised fit for independent noise of one size at all points. There is none
        where fewer than 15 points are fitted, or the misfit shows a pattern that such noise shows in at most 1 of 100
        curves, by a Monte Carlo test (Hope, 1968): neighbouring residuals are correlated, or a second pole or a
        constant added to the fit would remove much of the misfit (see `femimpact.signals.one_pole`). There is
        no ratio where the points do not determine it or the largest amplitude is at an end of the grid.
    """
    from scipy.optimize import leastsq

    require_name(held, ("displacement", "acceleration"), "held")
    f, x = checked_curve(frequency, amplitude, 4)
    if held == "acceleration":
        x = x * f**2
    top = int(np.argmax(x))
    if top in (0, f.size - 1):
        message = f"no resonance within {f[0]:g} to {f[-1]:g} Hz: the largest amplitude is at the edge, {f[top]:.4g} Hz"
        return _no_estimate(METHOD, f[top], message)
    chosen = x >= share * x[top]
    chosen[np.argsort(np.abs(f - f[top]))[:7]] = True
    first, last = np.flatnonzero(chosen)[[0, -1]]
    chosen[first : last + 1] = True
    # both as shares of the peak's: the fit does not hang on units
    f_fit, x_fit = f[chosen] / f[top], x[chosen] / x[top]

    def curve_of(p: Array) -> Array:
        return one_pole_amplitude(f_fit, _power(p[0]), p[1], _power(p[2]))

    def misfit_of(p: Array) -> Array:
        return np.asarray(curve_of(p) - x_fit)

    def tangents(p: Array) -> Array:
        value, ratio = curve_of(p), _power(p[2])
        apart, damped = p[1] ** 2 - f_fit**2, 2.0 * ratio * p[1] * f_fit
        by_frequency = -2.0 * p[1] * value * (apart + 2.0 * (ratio * f_fit) ** 2) / (apart**2 + damped**2)
        return np.column_stack([value, by_frequency, -value * damped**2 / (apart**2 + damped**2)])

    # the residual has several valleys when the grid is coarse: start from narrow and wide peaks
    step = float(np.mean(np.diff(f)))
    starts = [
        np.array([math.log(2.0 * ratio), 1.0 + shift * step / f[top], math.log(ratio)])
        for ratio in (1e-3, 5e-3, 2e-2, 8e-2)
        for shift in (-0.5, 0.0, 0.5)
    ]
    # MINPACK's search finds the same minima in a quarter of the time of the one that scipy has by default, and without
    # that one's interface before it in two thirds of this quarter
    options: Any = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-8, "maxfev": 300, "diag": (1.0, 1e2, 1.0)}
    optima = [leastsq(misfit_of, start, Dfun=tangents, full_output=True, **options) for start in starts]
    pole, misfit = min(((p, about["fvec"]) for p, _, about, *_ in optima), key=lambda optimum: optimum[1] @ optimum[1])
    slopes = tangents(pole)
    # the curve is that of the frequency's square
    pole[1] = abs(pole[1])
    return _judged(f, float(f[top]), f_fit, pole, misfit, slopes, misfit_limit)


def _power(logarithm: float) -> float:
    """E to a power, finite: a search among points of no resonance may try any."""
    return math.exp(min(max(logarithm, -LARGEST), LARGEST))


def _judged(
    f: Array,  # (n,) all frequencies, Hz
    at: float,  # of the peak, Hz
    f_fit: Array,  # (m,) of the points that are fitted, as shares of that
    pole: Array,  # logarithm of the scale, frequency as a share, logarithm of the ratio
    misfit: Array,  # (m,) as shares of the peak
    tangents: Array,  # (m, 3) its derivatives by the pole
    misfit_limit: float,
) -> DampingEstimate:
    """The estimate of the best fit, as far as its points determine it."""
    from scipy.special import stdtrit

    step = float(np.mean(np.diff(f)))
    ratio, natural_frequency, squares = _power(pole[2]), float(pole[1] * at), float(misfit @ misfit)
    spread = _spread_of_logarithm(tangents, squares, stdtrit)
    if not f[0] <= natural_frequency <= f[-1]:
        message = (
            f"no resonance within {f[0]:g} to {f[-1]:g} Hz: the best fit has its pole at {natural_frequency:.4g} Hz"
        )
        return _no_estimate(METHOD, natural_frequency, message)
    if spread > UNDETERMINED:
        message = (
            f"{f_fit.size} points with steps of {number_text(step, 3)} Hz do not determine a damping ratio: "
            f"refine the grid around {at:.4g} Hz"
        )
        return _no_estimate(METHOD, natural_frequency, message)
    warnings = list(resolution_warnings(peak_resolution(f, natural_frequency, 2.0 * ratio * natural_frequency)))
    interval = (ratio * math.exp(-spread), ratio * math.exp(spread))
    size = math.sqrt(squares / f_fit.size)
    # far modes and rounding leave a pattern, but a negligible one
    few, negligible = f_fit.size < ENOUGH_POINTS, size <= NEGLIGIBLE_MISFIT
    pattern = "" if few or negligible else pattern_in(misfit, tangents, _further_terms(f_fit, pole, at))
    reason = f"is not random over frequency, as beside a second pole or on a bent peak: {pattern}" if pattern else ""
    if few and not negligible:
        reason = f"may be noise or a second pole: {f_fit.size} points do not decide it"
    if reason:
        interval = (math.nan, math.nan)
    if reason and size > TOLD_MISFIT:
        warnings.append(f"no interval: the misfit of {number_text(100 * size, 2)} % of the peak {reason}")
    if size > misfit_limit:
        kind = "the curve is not that of one pole" if pattern else "the points scatter about the curve of one pole"
        warnings.append(
            f"{kind}: root-mean-square misfit {100 * size:.0f} % of the peak "
            f"(limit {100 * misfit_limit:.0f} %); read the ratio as an equivalent one"
        )
    return DampingEstimate(ratio, natural_frequency, interval, METHOD, tuple(warnings))


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


def _further_terms(f: Array, pole: Array, at: float) -> dict[str, Array]:
    """Derivatives of a curve of one pole by the complex factors of a constant and of second poles added to it.

    d|X + c Y| by the real and the imaginary part of c, at none of it. Second poles are as wide as the first and stand
    a half-power width apart, from two widths before the first point to two behind the last.
    """

    def response(natural_frequency: float) -> NDArray[np.complex128]:
        return np.asarray(f**2 / (natural_frequency**2 - f**2 + 2j * ratio * natural_frequency * f))

    def added(term: NDArray[np.complex128]) -> Array:
        turned = np.conj(first / np.abs(first)) * term
        return np.column_stack([turned.real, -turned.imag])

    ratio = math.exp(pole[2])
    first, width = response(pole[1]), 2.0 * ratio * pole[1]
    low, high = max(f[0] - 2.0 * width, 0.5 * f[0]), f[-1] + 2.0 * width
    count = int(np.clip((high - low) / width, FEWEST_POLES, MOST_POLES)) + 1
    poles = {f"a second pole at {at * share:.4g} Hz": added(response(share)) for share in np.linspace(low, high, count)}
    return {"a constant": added(np.ones(f.size, dtype=complex)), **poles}


# ---- patterns in a misfit --------------------------------------------------------------------------

LEVEL = 0.005
"""Share of curves of one pole and noise in which each of two patterns is seen."""

DRAWS = 1999
"""Simulated curves of noise."""

SEED = 20240607
"""Seed of the simulated noise: every call judges the same misfits in the same way."""

BLOCK = 2_000_000
"""Numbers that are drawn at a time."""

INDEPENDENT = 1e-8
"""Share of a shape beyond what the fit follows below which it is rounding."""


def pattern_in(
    misfit: Array,  # (n,) by rising frequency
    tangents: Array,  # (n, parameters) jacobian of the fit
    # what a further term of the model, by its name, adds per unit of each of its k parameters
    shapes: Mapping[str, Array],
) -> str:
    """Text on a pattern in the misfits of a least-squares fit that noise seldom shows; empty where there is none.

    Seldom is in 1 of 200 curves or fewer with independent noise of one size at all points, for each of

    - the correlation of neighbours, sum r_i r_(i+1) / sum r_i^2, which smooth misfits make large;
    - the largest share of sum r_i^2 that one of the shapes takes away.
    """
    tangent_basis, _ = np.linalg.qr(tangents)
    bases = [_beyond(tangent_basis, shape) for shape in shapes.values()]
    left = misfit[:, None] - tangent_basis @ (tangent_basis.T @ misfit[:, None])
    correlation, share, which = (float(x[0]) for x in _read(left, bases))
    random, counts = np.random.default_rng(SEED), np.zeros(2)
    block = max(1, BLOCK // misfit.size)
    for first in range(0, DRAWS, block):
        noise = random.standard_normal((misfit.size, min(block, DRAWS - first)))
        correlations, shares, _ = _read(noise - tangent_basis @ (tangent_basis.T @ noise), bases)
        counts += np.sum(correlations >= correlation), np.sum(shares >= share)
    seldom = (1.0 + counts) / (1.0 + DRAWS) <= LEVEL
    patterns = []
    if seldom[0]:
        patterns.append(f"neighbouring misfits are alike (correlation {correlation:.2f})")
    if seldom[1]:
        patterns.append(f"{list(shapes)[int(which)]} beside the first would take {100.0 * share:.0f} % of their square")
    return " and ".join(patterns)


def _beyond(tangent_basis: Array, shape: Array) -> Array:
    """Orthonormal columns (n, k or fewer) of the part of a shape that is orthogonal to the tangents of the fit."""
    left = shape - tangent_basis @ (tangent_basis.T @ shape)
    columns, size, _ = np.linalg.svd(left, full_matrices=False)
    return np.asarray(columns[:, size > INDEPENDENT * np.linalg.norm(shape)])


def _read(misfit: Array, bases: Sequence[Array]) -> tuple[Array, Array, NDArray[np.intp]]:
    """Correlation of neighbours, the largest share that a shape takes, and which one, of each column of misfits."""
    size = np.sum(misfit**2, axis=0)
    correlation = np.sum(misfit[1:] * misfit[:-1], axis=0) / size
    taken = [np.sum((basis.T @ misfit) ** 2, axis=0) for basis in bases]
    return correlation, np.max(taken, axis=0) / size, np.argmax(taken, axis=0)
