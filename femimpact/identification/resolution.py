"""How well a grid of frequencies resolves a resonance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femimpact.errors import checked, quantity, real_array, require

__all__ = ["UNRESOLVED", "PeakResolution", "peak_resolution", "resolution_warnings"]

RESOLVED = 4.0
"""A half-power width counts as resolved when it holds this many frequency steps: the peak is then 3 % low at most."""

UNRESOLVED = "does not resolve the half-power width"
"""Words of every warning that a grid is too coarse, by which it is known."""


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
