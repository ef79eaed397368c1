"""Many cases of whole cycles of a sine, of which only statistics are kept: blocks spread over threads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_driven.block import Block, Inputs, new_block, no_cycles, run_block
from femimpact.integrators.event_driven.equations import equations_of
from femimpact.integrators.event_driven.loop_data import DONE, Ledger
from femimpact.integrators.event_driven.settings import EventSettings
from femimpact.integrators.event_driven.store import FormStore, outputs_of
from femimpact.integrators.threads import Progress, run_each
from femimpact.response.columns import CYCLE_COLUMNS, ENERGY_COLUMNS
from femimpact.response.energy import CLOSED, energy_residual, largest_input
from femimpact.response.signals import CycleStatistics
from femimpact.system.contact_pair import ContactPair
from femimpact.system.system import System

__all__ = ["DwellCases", "DwellStatistics", "run_dwells"]

Array = NDArray[np.float64]

LARGEST_BLOCK = 64
"""Cases between two reports of progress, when interrupts are checked."""

BLOCKS = 8
"""Blocks per thread: cases cost differently, small blocks even that out."""


@dataclass(frozen=True, eq=False)
class DwellCases:
    """Cases that run through whole cycles of a sine.

    Parameters
    ----------
    drives : sequence of Drive
        Sines of one kind, at one place.
    contacts : sequence of sequence of ContactPair
        For each case: the system's pairs, with gaps and contact parameters of the case's own.
    position, velocity : ndarray (cases, d)
        Structure and balls at t = 0 relative to the base, m and m/s.
    cycles, measured : ndarray (cases,) of int
        Of the base: the whole dwell, and how many at its end are measured.
    """

    drives: Sequence[Drive]
    contacts: Sequence[Sequence[ContactPair]]
    position: Array
    velocity: Array
    cycles: NDArray[np.int64]
    measured: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class DwellStatistics:
    """Statistics of many cases.

    Parameters
    ----------
    cycles : CycleStatistics
        Of the observed place, arrays (measured cycles, cases).
    totals : ndarray (6, pairs, cases)
        Sums over the measured cycles; see `columns.TOTAL_COLUMNS`.
    residual : ndarray (cases,), 1
        Largest at the start and the ends of measured cycles; not a number without a ledger.
    bound : ndarray (cases,), 1
        What rounding may make of it.
    unending : ndarray (cases,), s
        When events did not end; infinite where they did.
    """

    cycles: CycleStatistics
    totals: Array
    residual: Array
    bound: Array
    unending: Array


def run_dwells(
    system: System, cases: DwellCases, method: EventSettings, observed: Array, ledger: bool, workers: int,
    progress: Progress | None,
) -> DwellStatistics:  # fmt: skip
    """Run many cases through whole cycles and keep the statistics of the last ones.

    Parameters
    ----------
    system : System
        Checked before; see `check_events`.
    cases : DwellCases
    method : EventSettings
    observed : ndarray (dofs,)
        Row of the observed place.
    ledger : bool
    workers : int
        Threads at most.
    progress : callable, optional

    Returns
    -------
    DwellStatistics
    """
    whole, count = equations_of(system, cases.drives[0]), len(cases.drives)
    rigid = np.array([pair.parameters.kind == RIGID for pair in system.contacts], dtype=bool)
    store = FormStore(whole, rigid, outputs_of(system, observed), rate=None, derived=system.derived)

    def run(members: NDArray[np.intp], share: Progress | None) -> DwellStatistics:
        found = _run_block(system, store, cases, members, method, ledger)
        if share is not None:
            share(1.0)
        return found

    blocks = max(math.ceil(count / LARGEST_BLOCK), 1 if workers == 1 else min(BLOCKS * workers, count))
    return _joined(run_each(run, np.array_split(np.arange(count), blocks), workers, progress))


def _run_block(
    system: System, store: FormStore, cases: DwellCases, members: NDArray[np.intp], method: EventSettings, ledger: bool
) -> DwellStatistics:  # fmt: skip
    own, per_cycle, count = members.tolist(), method.samples_per_cycle, members.size
    cycles, measured, most_measured = cases.cycles[members], cases.measured[members], int(cases.measured.max())
    drives = [cases.drives[i] for i in own]
    period = np.array([2.0 * np.pi / drive.omega for drive in drives])
    inputs = Inputs(
        drives=drives,
        contacts=[cases.contacts[i] for i in own],
        position=cases.position[members],
        velocity=cases.velocity[members],
        window=np.stack([(cycles - measured) * period, np.full(count, np.inf)], axis=1),
    )
    block = new_block(system, store, inputs, method, ledger or None)
    end = cycles * per_cycle
    # one sample more: the first measured cycle begins with it, be it that at the start
    begin = (cycles - measured) * per_cycle - 1
    number = np.arange(most_measured * per_cycle + 1)
    shape = (count, most_measured + 1 if ledger else 0, block.grid.energy.shape[2])
    block.cases.sample[:] = begin
    block.grid = block.grid._replace(
        origin=begin + 1,
        cycles=no_cycles(count, most_measured),
        kept=np.where(number % per_cycle == 0, number // per_cycle, -1),
        energy=np.zeros(shape),
    )
    run_block(block, begin, end, float(method.most_events) * cycles.astype(float))
    residual, bound = _residuals(block, measured) if ledger else np.full((2, count), np.nan)
    table = block.grid.cycles[:, :, : len(CYCLE_COLUMNS)]
    table = np.where(table[:, :, 5:] > 0.0, table, 0.0)
    return DwellStatistics(
        cycles=CycleStatistics(*np.moveaxis(table, (2, 1), (0, 1))),
        totals=np.moveaxis(block.cases.totals, 0, 2),
        residual=residual,
        bound=bound,
        unending=np.where(block.stopped == DONE, np.inf, block.cases.clock[:, 0]),
    )


def _residuals(block: Block, measured: NDArray[np.int64]) -> tuple[Array, Array]:
    """Largest energy residual of every case at the start and the ends of measured cycles, and its bound."""
    ledger = cast(Ledger, block.ledger)
    table = np.concatenate([ledger.start[:, None], block.grid.energy], axis=1)[:, :, : len(ENERGY_COLUMNS)]
    # a case with fewer cycles than others: its last row stands for those after it
    own = np.minimum(np.arange(table.shape[1]), measured[:, None] + 1)
    table = np.take_along_axis(table, own[:, :, None], axis=1)
    kinetic, strain, ball, contact, work, lost, in_contact = table.T
    stored = kinetic + strain + ball + contact
    residual = np.max(np.abs(energy_residual(stored, work, lost + in_contact)), axis=0)
    put_in = largest_input(stored, work)
    return np.asarray(residual), np.maximum(CLOSED, ledger.rounding / np.where(put_in > 0.0, put_in, 1.0))


def _joined(parts: Sequence[DwellStatistics]) -> DwellStatistics:
    """All blocks in one."""
    cycles = CycleStatistics(
        *(np.concatenate([getattr(part.cycles, name) for part in parts], axis=1) for name in CYCLE_COLUMNS)
    )
    totals = np.concatenate([part.totals for part in parts], axis=2)
    residual, bound, unending = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("residual", "bound", "unending")
    )
    return DwellStatistics(cycles, totals, residual, bound, unending)
