"""The frequencies of a study's sweep: an even grid, refined around its resonances."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from femimpact.identification import PeakResolution
from femimpact.study.study import SweepPlan
from femimpact.system.modes import first_resonance, solve_modes
from femimpact.system.system import System

__all__ = ["even_grid", "finer_grid_words", "most_frequencies", "refined_grid", "resonances_in"]

REACH = 8.0
"""Half-width of the refined part around the first mode over damping ratio times frequency: 4 half-power widths."""

LEAST_RATIO = 1e-4
"""Damping ratio that is taken for the reach where the structure has less."""

BESIDE_BALL = 1.5
"""Half-width of the refined part around the largest peak with ball, in steps of the even grid."""


def even_grid(plan: SweepPlan) -> NDArray[np.float64]:
    """Frequencies (Hz) of the even grid."""
    return np.linspace(plan.start, plan.stop, plan.points)


def refined_grid(plan: SweepPlan, bare: System, peak_with_ball: float | None) -> NDArray[np.float64]:
    """All frequencies (Hz) of a sweep, ascending.

    Parameters
    ----------
    plan : SweepPlan
    bare : System
        Without balls.
    peak_with_ball : float or None, Hz
        On the even grid; None without a ball.

    Returns
    -------
    ndarray (n,), Hz
        The even grid, `plan.refine` points around the first natural frequency and as many around the peak with ball,
        and that natural frequency itself: the largest point of a linear curve is then its peak.
    """
    even = even_grid(plan)
    if not plan.refine:
        return even
    first, reach = _first_mode(bare)
    parts = [np.linspace(first - reach, first + reach, plan.refine), np.array([first])]
    if peak_with_ball is not None:
        around = BESIDE_BALL * float(even[1] - even[0])
        parts.append(np.linspace(peak_with_ball - around, peak_with_ball + around, plan.refine))
    inside = [part[(part > plan.start) & (part < plan.stop)] for part in parts]
    return np.asarray(np.unique(np.round(np.concatenate([even, *inside]), 9)))


def most_frequencies(plan: SweepPlan) -> int:
    """How many frequencies a sweep has at most."""
    return plan.points + (2 * plan.refine + 1 if plan.refine else 0)


def finer_grid_words(plan: SweepPlan, bare: System, found: PeakResolution) -> str:
    """The key of a study file with the value that makes its sweep resolve a resonance, as "sweep.refine = 33"."""
    first, reach = _first_mode(bare)
    if abs(found.frequency - first) <= reach:
        return f"sweep.refine = {math.ceil(2.0 * reach / found.step_needed) + 1}"
    return f"sweep.points = {math.ceil((plan.stop - plan.start) / found.step_needed) + 1}"


def resonances_in(plan: SweepPlan, system: System) -> tuple[float, ...]:
    """The lowest natural frequencies (Hz) of a system that lie within a sweep, at most ten."""
    natural = solve_modes(system, min(10, system.dofs)).natural_frequency
    return tuple(float(f) for f in natural if plan.start <= f <= plan.stop)


def _first_mode(bare: System) -> tuple[float, float]:
    """First natural frequency (Hz), and how far the refined part reaches to either side of it (Hz)."""
    first, ratio = first_resonance(bare)
    return first, REACH * max(ratio, LEAST_RATIO) * first
