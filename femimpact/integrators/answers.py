"""What methods take and return: many dwells and their results, the restitution they achieve, what a run costs."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from femimpact.contact import ContactLaw
from femimpact.errors import check_fields, quantity
from femimpact.response.signals import SteadyMotion
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["AchievedRestitution", "MethodCost", "SineCases", "SineDwellResults", "SineDwells"]

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
    """Dwells under sine motions of the base, each a separate case from the same state.

    Parameters
    ----------
    amplitude : float, m
        Of the base.
    frequency : ndarray (n,), Hz
    cycles : ndarray (n,) of int
        Whole base cycles run.
    measured : ndarray (n,) of int
        Of these at the end.
    phase : float, rad
        Of the base at t = 0.
    """

    amplitude: float
    frequency: Array
    cycles: NDArray[np.int64]
    measured: NDArray[np.int64]
    phase: float = 0.0


@dataclass(frozen=True, eq=False)
class SineCases:
    """Dwells of one system under sine motions of the base, each with its own numbers.

    Parameters
    ----------
    frequency, amplitude, phase : ndarray (n,)
        Of the base: Hz, m and rad.
    gaps : ndarray (n, pairs, 2), m
        To the + and to the - side, in the order of `System.contacts`.
    laws : tuple of tuple of ContactLaw
        Sets of one law for each pair.
    law_of : ndarray (n,) of int
        Which set a case has.
    initial : State
        What all cases start from, at t = 0.
    ball_displacement, ball_velocity : ndarray (n, balls)
        In place of those of the initial state, and in its frame, m and m/s. Of a case whose displacements are not
        numbers the balls are where the initial state has them.
    cycles, measured : ndarray (n,) of int
        Whole base cycles run, and how many of them at the end are measured.
    systems : tuple of tuple of System and ndarray (dofs,)
        Systems in place of the common one, with the row of the observed place of each: alike in the number of dofs,
        and in their pairs but for numbers. For methods with a member `run_cases`; none for the common one.
    system_of : ndarray (n,) of int, optional
        Which of them a case has.
    """

    frequency: Array
    amplitude: Array
    phase: Array
    gaps: Array
    laws: tuple[tuple[ContactLaw, ...], ...]
    law_of: NDArray[np.int64]
    initial: State
    ball_displacement: Array
    ball_velocity: Array
    cycles: NDArray[np.int64]
    measured: NDArray[np.int64]
    systems: tuple[tuple[System, Array], ...] = ()
    system_of: NDArray[np.int64] | None = None

    def of(self, members: NDArray[np.intp]) -> SineCases:
        """Some of the cases."""
        common = ("laws", "initial", "systems")
        own = {item.name: getattr(self, item.name) for item in fields(self) if item.name not in common}
        return replace(self, **{name: values[members] for name, values in own.items() if values is not None})

    def system(self, case: int, common: System) -> System:
        """That of a case."""
        return self.systems[int(self.system_of[case])][0] if self.system_of is not None else common


def _no_values() -> Array:
    """An array of no entry, for what a method does not sum up."""
    return np.zeros(0)


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
    loss : ndarray (n,) or (0,), J
        Of structure and contacts in the measured time; not a number without a ledger, no entry of a method that does
        not sum it up.
    stored : ndarray (n,) or (0,), J
        Largest of all energy stored at the instants of the ledger in the measured time.
    """

    motion: SteadyMotion
    totals: Array
    duration: Array
    residual: Array
    bound: Array
    failures: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    loss: Array = field(default_factory=_no_values)
    stored: Array = field(default_factory=_no_values)
