"""What "amplitude" and "steady" mean: statistics of a motion from its base cycles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["CycleStatistics", "SteadyMotion", "no_steady_motion", "steady_motion"]


@dataclass(frozen=True, eq=False)
class CycleStatistics:
    """Sums over every base cycle of a run, one row a cycle.

    Parameters
    ----------
    maximum, minimum : ndarray (cycles, cases), m
    square : ndarray (cycles, cases), m^2
        Sum of w^2 over the samples.
    sine, cosine : ndarray (cycles, cases), m
        Sums of w sin(phase) and w cos(phase), phase being that of the base.
    samples : ndarray (cycles, cases), 1
    """

    maximum: NDArray[Any]
    minimum: NDArray[Any]
    square: NDArray[Any]
    sine: NDArray[Any]
    cosine: NDArray[Any]
    samples: NDArray[Any]


@dataclass(frozen=True, eq=False)
class SteadyMotion:
    """Amplitudes over a window of whole base cycles, and whether the motion was steady there.

    Parameters
    ----------
    peak : ndarray (cases,), m
        Largest |w| in the window.
    rms : ndarray (cases,), m
    first_harmonic : ndarray (cases,), m
        Amplitude of the component at the base's frequency.
    phase : ndarray (cases,), rad
        Of that component, relative to the base's displacement.
    steadiness : ndarray (cases,) of str
        "periodic", "statistical" or "transient".
    """

    peak: NDArray[Any]
    rms: NDArray[Any]
    first_harmonic: NDArray[Any]
    phase: NDArray[Any]
    steadiness: NDArray[Any]


def steady_motion(
    cycles: CycleStatistics,
    window: NDArray[Any],
    periodic_tolerance: float = 1e-3,
    statistical_tolerance: float = 0.05,
    standard_errors: float = 3.0,
    longest_period: int = 4,
) -> SteadyMotion:
    """Amplitudes and steadiness over the last cycles of a run.

    The motion is "periodic" when the cycle maxima repeat after 1 to `longest_period` cycles within
    `periodic_tolerance` of the largest; else "statistical" when the rms of the window's two halves
    agree within `statistical_tolerance`, or when their mean squares differ by fewer than
    `standard_errors` of the scatter between the window's eight parts; else "transient".

    Parameters
    ----------
    cycles : CycleStatistics
    window : ndarray (cases,) of int
        How many cycles at the end are measured.
    periodic_tolerance, statistical_tolerance, standard_errors : float, 1
    longest_period : int, cycles

    Returns
    -------
    SteadyMotion
    """
    cases = cycles.maximum.shape[1]
    columns: dict[str, list[Any]] = {name: [] for name in ("peak", "rms", "first_harmonic", "phase", "steadiness")}
    for c in range(cases):
        finished = int(np.count_nonzero(cycles.samples[:, c]))
        last = slice(max(finished - int(window[c]), 0), finished)
        maximum, square, samples = (a[last, c] for a in (cycles.maximum, cycles.square, cycles.samples))
        peaks = np.maximum(maximum, -cycles.minimum[last, c])
        total = samples.sum()
        in_phase, in_quadrature = (2.0 * a[last, c].sum() / total for a in (cycles.sine, cycles.cosine))
        columns["peak"].append(peaks.max())
        columns["rms"].append(np.sqrt(square.sum() / total))
        columns["first_harmonic"].append(np.hypot(in_phase, in_quadrature))
        columns["phase"].append(np.arctan2(in_quadrature, in_phase))
        periodic = _repeats(maximum, periodic_tolerance, longest_period)
        even = _halves_agree(square / samples, statistical_tolerance, standard_errors)
        columns["steadiness"].append("periodic" if periodic else "statistical" if even else "transient")
    return SteadyMotion(**{name: np.array(values) for name, values in columns.items()})


def no_steady_motion() -> SteadyMotion:
    """What a run shorter than one base cycle has: no amplitude, and a transient."""
    nothing = np.full(1, np.nan)
    return SteadyMotion(nothing, nothing, nothing, nothing, np.array(["transient"]))


def _repeats(maximum: NDArray[Any], tolerance: float, longest_period: int) -> bool:
    scale = float(np.max(np.abs(maximum)))
    for period in range(1, min(longest_period, maximum.size // 2) + 1):
        if float(np.max(np.abs(maximum[period:] - maximum[:-period]))) > tolerance * scale:
            continue
        # a slow drift also repeats from cycle to cycle: the whole window must stay level
        strobed = maximum[(maximum.size - 1) % period :: period]
        if float(np.ptp(strobed)) <= tolerance * scale:
            return True
    return False


def _halves_agree(mean_square: NDArray[Any], tolerance: float, standard_errors: float) -> bool:
    """Whether the two halves of the window are one population of cycles."""
    if mean_square.size < 8:
        return False
    parts = np.array([part.mean() for part in np.array_split(mean_square, 8)])
    first, second = parts[:4], parts[4:]
    low, high = sorted(np.sqrt([first.mean(), second.mean()]))
    if high - low <= tolerance * high:
        return True
    error = np.sqrt((first.var(ddof=1) + second.var(ddof=1)) / 4.0)
    return bool(abs(first.mean() - second.mean()) <= standard_errors * error)
