"""How well a grid of frequencies resolves a peak."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femimpact.errors import checked, quantity, real_array, require
from femimpact.units import number_text

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
    """How well a grid of frequencies resolves one resonance."""

    frequency: float  # Hz: the point of the grid beside which the steps are read
    step: float  # Hz: the larger of the two steps beside it
    width: float  # Hz: half-power width of the resonance

    @property
    def resolved(self) -> bool:
        """True if the width holds enough steps for a damping ratio and a peak."""
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


def peak_resolution(
    frequency: ArrayLike,  # (n,) Hz: n >= 2, ascending
    near: float,  # Hz: the resonance: steps are read beside the point of the grid next to it
    width: float,  # Hz: its half-power width, 2 zeta f0 where the damping ratio zeta is small
) -> PeakResolution:
    """Resolution of a resonance by a grid of frequencies."""
    f = real_array("frequency", frequency, "Hz", "must be finite numbers")
    near = checked("near", near, quantity("Hz", above=0.0))
    width = checked("width", width, quantity("Hz", above=0.0))
    require(f.ndim == 1 and f.size >= 2, "frequency", f.size, "points", "must hold at least 2")
    top = int(np.argmin(np.abs(f - near)))
    return PeakResolution(float(f[top]), float(np.max(np.diff(f[max(top - 1, 0) : top + 2]))), width)


def resolution_warnings(peak: PeakResolution, *, of_peak: bool = True) -> tuple[str, ...]:
    """A warning where a grid is too coarse for a resonance; `of_peak` says too how low the peak may be read."""
    if peak.resolved:
        return ()
    miss = number_text(100 * peak.largest_miss, 2)
    low = f"the peak may be read up to {miss} % too low (1 - 1/sqrt(1 + (step/width)^2)); "
    return (
        f"the frequency step of {number_text(peak.step, 3)} Hz {UNRESOLVED} of {number_text(peak.width, 3)} Hz "
        f"(at least {RESOLVED:g} steps are needed): {low if of_peak else ''}"
        f"take frequencies at most {number_text(_rounded_down(peak.step_needed), 2)} Hz apart around "
        f"{peak.frequency:.4g} Hz",
    )
