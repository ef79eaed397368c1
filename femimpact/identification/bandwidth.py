"""Damping from the half-power bandwidth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from femimpact.identification.estimate import DampingEstimate, checked_curve
from femimpact.identification.resolution import peak_resolution, resolution_warnings

__all__ = ["half_power"]


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
