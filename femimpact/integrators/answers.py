"""What methods return: the restitution that they achieve, what a run costs, and the results of many dwells."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, quantity
from femimpact.response.signals import SteadyMotion

__all__ = ["AchievedRestitution", "MethodCost", "SineDwellResults", "SineDwells"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AchievedRestitution:
    """Restitution of one collision, in continuous time and with a step.

    Parameters
    ----------
    exact : float, 1
        Of the law, in continuous time.
    mean, lowest, highest : float, 1
        With the step, over the instants within a step at which the touch can fall.
    peak_force : float, N
        Largest with the step, at the approach speed given.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    exact: float = field(metadata=quantity("1", at_least=0.0, finite=False))
    mean: float = field(metadata=quantity("1", finite=False))
    lowest: float = field(metadata=quantity("1", finite=False))
    highest: float = field(metadata=quantity("1", finite=False))
    peak_force: float = field(metadata=quantity("N", at_least=0.0, finite=False))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class MethodCost:
    """What one base cycle of one case takes, roughly, on one core of a 2024 server.

    Parameters
    ----------
    history_seconds, sweep_seconds : float, s
        Of a run alone; of a case of a sweep, with what the sweep without balls takes beside it.
    sweep_memory : float, bytes
        Kept of a base cycle of a case of a sweep.
    cases_at_once : int
        Cases of a sweep that are in memory together on each thread.
    """

    history_seconds: float
    sweep_seconds: float
    sweep_memory: float
    cases_at_once: int


@dataclass(frozen=True, eq=False)
class SineDwells:
    """Dwells under sine motions of the base, each a case of its own from the same state.

    Parameters
    ----------
    amplitude : float, m
        Of the base.
    frequency : ndarray (n,), Hz
    cycles : ndarray (n,) of int
        Whole base cycles run.
    measured : ndarray (n,) of int
        Of these at the end.
    """

    amplitude: float
    frequency: Array
    cycles: NDArray[np.int64]
    measured: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SineDwellResults:
    """Results of dwells, measured at their ends.

    Parameters
    ----------
    motion : SteadyMotion
        Of the observed place, arrays (n,).
    totals : ndarray (6, pairs, n)
        Sums over the measured time; see `columns.TOTAL_COLUMNS`. The peak force of a rigid pair is not a number.
    duration : ndarray (n,), s
        Of the measured time.
    residual : ndarray (n,), 1
        Largest energy residual; not a number without a ledger.
    bound : ndarray (n,), 1
        Of the residual, beyond which it is warned of.
    failures : tuple of str (n,)
        Why a case has no results, with its frequency; empty where it has.
    warnings : tuple of str
        Of the method on the system.
    """

    motion: SteadyMotion
    totals: Array
    duration: Array
    residual: Array
    bound: Array
    failures: tuple[str, ...]
    warnings: tuple[str, ...] = ()
