"""Many frequencies of a sweep side by side, through compliant contacts: only statistics are kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.energy import CLOSED, energy_residual, largest_input
from femimpact.integrators.compliant import Compliant
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_driven import EventDriven, Outputs
from femimpact.integrators.kernels.books import Books
from femimpact.integrators.layout import ENERGY_COLUMNS
from femimpact.integrators.passing import energy_now, new_books, new_passing, pass_on
from femimpact.integrators.threads import Progress, run_each
from femimpact.signals import CycleStatistics
from femimpact.system import System

__all__ = ["Passages", "pass_dwells"]

LARGEST_GROUP = 64
"""Cases between two looks at progress and interrupts."""

GROUPS = 8
"""Groups per thread."""


@dataclass(frozen=True, eq=False)
class Passages:
    """What many frequencies left behind, flown through compliant contacts or without any.

    Parameters
    ----------
    cycles : CycleStatistics
        Of the observed place, arrays (measured cycles, cases).
    totals : ndarray (6, pairs, cases)
        Sums over the measured cycles; see `layout.TOTAL_COLUMNS`.
    residual : ndarray (cases,), 1
        Largest at the start and the ends of measured cycles; not a number without a ledger.
    bound : ndarray (cases,), 1
        What rounding may make of it.
    stuck : ndarray (cases,), s
        When changes of contact did not end; infinite where they did.
    """

    cycles: CycleStatistics
    totals: NDArray[Any]
    residual: NDArray[Any]
    bound: NDArray[Any]
    stuck: NDArray[Any]


def pass_dwells(
    system: System, found: Compliant, drives: Sequence[Drive], method: EventDriven, cycles: NDArray[Any],
    measured: NDArray[Any], position: NDArray[Any], velocity: NDArray[Any], observed: NDArray[Any], ledger: bool,
    workers: int, progress: Progress | None,
) -> Passages:  # fmt: skip
    """Fly many cases through whole cycles and keep the statistics of the last ones.

    Parameters
    ----------
    system : System
        Checked before; see `check_events`.
    found : Compliant
    drives : sequence of Drive
        One for each case.
    method : EventDriven
    cycles, measured : ndarray (cases,) of int
        Of the base: the whole dwell, and how many at its end are measured.
    position, velocity : ndarray (cases, d)
        Structure and balls at t = 0 relative to the base, m and m/s.
    observed : ndarray (dofs,)
    ledger : bool
    workers : int
        Threads at most.
    progress : callable, optional

    Returns
    -------
    Passages
    """
    per_cycle, d = method.samples_per_cycle, position.shape[1]
    rows, rates = np.zeros((2, d)), np.zeros((2, d))
    rows[0, : system.dofs] = rates[1, : system.dofs] = observed
    period = np.array([2.0 * np.pi / drive.omega for drive in drives])
    end = cycles * per_cycle
    # one sample more: the first measured cycle begins with it, that at the start too
    begin = (cycles - measured) * per_cycle - 1
    window = np.stack([(cycles - measured) * period, np.full(period.size, np.inf)], axis=1)
    run = new_passing(
        system, found, drives, Outputs(rows, rates, (-1, -1)), per_cycle, 0, int(measured.max()), window, position,
        velocity,
    )  # fmt: skip
    run.reading.origin[:] = end - measured * per_cycle
    if ledger:
        # the ledger of the transient is summed, and read where measuring begins
        number, most_rows = np.arange(int(measured.max()) * per_cycle + 1), int(measured.max()) + 1
        kept = np.where(number % per_cycle == 0, number // per_cycle, -1)
        none = np.full(number.size, -1)
        run = replace(run, books=new_books(system, found, drives[0], kept, none, most_rows, len(drives), 0, 0))
    most = float(method.most_events) * cycles

    def fly(members: NDArray[Any], share: Progress | None) -> None:
        pass_on(run, members, begin, end, most)
        if share is not None:
            share(1.0)

    # cases cost differently: small groups even that out
    groups = max(math.ceil(period.size / LARGEST_GROUP), 1 if workers == 1 else min(GROUPS * workers, period.size))
    run_each(fly, np.array_split(np.arange(period.size), groups), workers, progress)
    residual, bound = np.full((2, period.size), np.nan)
    if run.books is not None:
        start = energy_now(system, found, position, velocity)
        run.books.energy[begin < 0, 0] = start[begin < 0]
        residual, bound = _residuals(run.books, start, measured)
    statistics = CycleStatistics(*np.moveaxis(run.reading.cycles, (2, 1), (0, 1)))
    return Passages(statistics, np.moveaxis(run.way.totals, 0, 2), residual, bound, run.stuck)


def _residuals(books: Books, start: NDArray[Any], measured: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Largest energy residual of every case, and its bound."""
    table = np.concatenate([start[:, None], books.energy], axis=1)[:, :, : len(ENERGY_COLUMNS)]
    # a case with fewer cycles than others: its last row stands for those after it
    own = np.minimum(np.arange(table.shape[1]), measured[:, None] + 1)
    table = np.take_along_axis(table, own[:, :, None], axis=1)
    kinetic, strain, ball, contact, work, lost, in_contact = table.T
    stored = kinetic + strain + ball + contact
    residual = np.max(np.abs(energy_residual(stored, work, lost + in_contact)), axis=0)
    put_in = largest_input(stored, work)
    rounding = books.sums[:, 2] / np.where(put_in > 0.0, put_in, 1.0)
    return np.asarray(residual), np.maximum(CLOSED, rounding)
