"""One frequency of a sweep through rigid impacts: a run of whole cycles of which only statistics are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.energy import energy_residual
from femimpact.excitation import Excitation
from femimpact.integrators.driving import drive_of
from femimpact.integrators.event_driven import EventDriven, Outputs
from femimpact.integrators.event_run import run_event_driven
from femimpact.integrators.event_state import Keep, new_run
from femimpact.integrators.fly import cycle_statistics
from femimpact.signals import CycleStatistics
from femimpact.system import State, System

__all__ = ["Dwell", "dwell"]


@dataclass(frozen=True, eq=False)
class Dwell:
    """What one frequency left behind.

    Parameters
    ----------
    cycles : CycleStatistics
        Of the observed place, arrays (cycles, 1).
    totals : ndarray (6, pairs)
        Sums over the measured cycles; see `layout.TOTAL_COLUMNS`.
    measured : float, s
    residual : float, 1
        Largest at the ends of cycles; not a number without a ledger.
    """

    cycles: CycleStatistics
    totals: NDArray[Any]
    measured: float
    residual: float


def dwell(
    system: System,
    excitation: Excitation,
    method: EventDriven,
    cycles: int,
    measured: int,
    initial: State,
    observed: NDArray[Any],
    ledger: bool,
) -> Dwell:
    """Fly a number of whole cycles and keep the statistics of the last ones.

    Parameters
    ----------
    system : System
        Checked before; see `check_events`.
    excitation : Excitation
    method : EventDriven
    cycles, measured : int
        Of the base: the whole dwell, and how many at its end are measured.
    initial : State
    observed : ndarray (dofs,)
    ledger : bool

    Returns
    -------
    Dwell
    """
    d, balls = system.dofs + len(system.balls), len(system.balls)
    position = np.zeros((1, d))
    position[0, : system.dofs] = observed
    outputs = Outputs(position, np.zeros((1, d)), (-1,))
    period = 1.0 / excitation.frequency
    window = ((cycles - measured) * period, np.inf)
    keep = Keep(method.samples_per_cycle if ledger else 0)
    run = new_run(system, drive_of(system, excitation), method, outputs, window, ledger, keep, 0)
    u, v, y, y_rate = initial.relative_to_base(system, excitation)
    start, rate = np.concatenate([u, y[:balls]]), np.concatenate([v, y_rate[:balls]])
    run_event_driven(run, start, rate, cycles * method.samples_per_cycle)
    totals = run.contact.totals.copy()
    # an impulse has no peak force
    totals[4] = np.nan
    residual = np.nan
    if ledger:
        kinetic, strain, ball, contact, work, lost, in_contact = np.concatenate(run.energy)[:, :7].T
        balance = energy_residual(kinetic + strain + ball + contact, work, lost + in_contact)
        residual = float(np.max(np.abs(balance)))
    return Dwell(cycle_statistics(run), totals, measured * period, residual)
