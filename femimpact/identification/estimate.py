"""A damping ratio with its interval, and the response curves that it is read of."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import check_fields, checked, quantity, real_array, require, require_type, text

__all__ = ["DampingEstimate", "amplitude_ratio_damping", "checked_curve"]

Array = NDArray[np.float64]


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

    def __repr__(self) -> str:
        return f"DampingEstimate: {self}"

    def __str__(self) -> str:
        low, high = self.interval
        interval = f"{low:.4g} to {high:.4g}" if math.isfinite(low + high) else "no interval"
        ratio = f"{self.ratio:.4g} ({interval})" if math.isfinite(self.ratio) else "no damping ratio"
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
