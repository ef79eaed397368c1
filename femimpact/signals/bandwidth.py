"""Estimates of damping, half-power bandwidth of a response curve, and resolution of a peak by its points."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.errors import check_fields, checked, quantity, real_array, require, require_type, text
from femimpact.response.cycles import peak_resolution, resolution_warnings
from femimpact.units import interval_texts, number_text


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
        If the interval is not two numbers, the lower one first.
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
        If the reference is not an estimate, or a peak is not > 0.
    """
    require_type(reference, DampingEstimate, "reference")
    reference_peak = checked("reference_peak", reference_peak, quantity("m", above=0.0))
    peak = checked("peak", peak, quantity("m", above=0.0))
    drop = reference_peak / peak
    low, high = reference.interval
    return DampingEstimate(
        reference.ratio * drop, reference.frequency, (low * drop, high * drop), "amplitude ratio", reference.warnings
    )


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
