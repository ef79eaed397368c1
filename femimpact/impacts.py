"""The record of impacts: what each one was, and what they add up to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["IMPACT_UNITS", "ImpactStatistics", "Impacts", "impact_statistics"]

IMPACT_UNITS = {
    "time": "s",
    "impactor": "",
    "side": "1",
    "approach_speed": "m/s",
    "rebound_speed": "m/s",
    "impulse": "N s",
    "peak_force": "N",
    "duration": "s",
    "energy_loss": "J",
}
"""Columns of the impact table and their units, in their order."""


@dataclass(frozen=True, eq=False, repr=False)
class Impacts:
    """Table of the finished impacts of a run, one entry each, in the order in which they ended.

    Parameters
    ----------
    time : ndarray (n,), s
        Instant of touch.
    impactor : ndarray (n,) of str
    side : ndarray (n,), 1
        +1 or -1: which wall.
    approach_speed, rebound_speed : ndarray (n,), m/s
        Relative speed at touch and at separation, both positive.
    impulse : ndarray (n,), N s
    peak_force : ndarray (n,), N
        Means nothing without the contact law of the run.
    duration : ndarray (n,), s
        Time under force.
    energy_loss : ndarray (n,), J
        Dissipated in the contact.
    dropped : int
        Impacts that met a full table and were counted only.
    """

    time: NDArray[Any]
    impactor: NDArray[Any]
    side: NDArray[Any]
    approach_speed: NDArray[Any]
    rebound_speed: NDArray[Any]
    impulse: NDArray[Any]
    peak_force: NDArray[Any]
    duration: NDArray[Any]
    energy_loss: NDArray[Any]
    dropped: int = 0

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        return f"Impacts({len(self)} impacts, columns {', '.join(IMPACT_UNITS)})"

    @property
    def restitution(self) -> NDArray[Any]:
        """Rebound over approach speed of each impact, 1 (the structure's own motion included)."""
        return np.asarray(self.rebound_speed / self.approach_speed)


@dataclass(frozen=True)
class ImpactStatistics:
    """What the contacts of a time window add up to.

    Parameters
    ----------
    count : int
        Impacts that ended in the window.
    impacts_per_cycle : float, 1
    mean_approach_speed, largest_approach_speed : float, m/s
    mean_impulse : float, N s
    peak_force : float, N
        Of every contact in the window, also one that has not ended.
    law : str
        The contact law behind the peak force.
    cycle_mean_force : float, N
        Integral of the normal force over the window's length, a ball that rides on its wall included.
    """

    count: int
    impacts_per_cycle: float
    mean_approach_speed: float
    largest_approach_speed: float
    mean_impulse: float
    peak_force: float
    law: str
    cycle_mean_force: float


def impact_statistics(totals: NDArray[Any], duration: float, frequency: float, law: str) -> ImpactStatistics:
    """Statistics from the sums that the time loop keeps over a window.

    Parameters
    ----------
    totals : ndarray (6, balls)
        Impacts, sum and largest of the approach speed (m/s), sum of the impulse (N s), largest
        force (N), integral of the force (N s); see `integrators.layout.TOTAL_COLUMNS`.
    duration : float, s
        Of the window.
    frequency : float, Hz
        Of the base, to count per cycle.
    law : str

    Returns
    -------
    ImpactStatistics
        Over all balls given; means over no impact are 0.
    """
    count = int(totals[0].sum())
    each = 1.0 / max(count, 1)
    return ImpactStatistics(
        count=count,
        impacts_per_cycle=count / (duration * frequency),
        mean_approach_speed=float(totals[1].sum()) * each,
        largest_approach_speed=float(totals[2].max(initial=0.0)),
        mean_impulse=float(totals[3].sum()) * each,
        peak_force=float(totals[4].max(initial=0.0)),
        law=law,
        cycle_mean_force=float(totals[5].sum()) / duration,
    )
