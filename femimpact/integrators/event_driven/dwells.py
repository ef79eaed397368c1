"""Many cases of whole cycles of a sine, of which only statistics are kept: blocks spread over threads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.integrators.driving import Drive
from femimpact.integrators.event_driven.block import (
    Block,
    CaseNumbers,
    Inputs,
    new_block,
    no_cycles,
    run_block,
    share_block,
)
from femimpact.integrators.event_driven.equations import Equations, equations_of
from femimpact.integrators.event_driven.loop_data import DONE, Ledger
from femimpact.integrators.event_driven.settings import EventSettings
from femimpact.integrators.event_driven.store import FormStore, Outputs, WantedForm, outputs_of
from femimpact.integrators.threads import Progress, run_each
from femimpact.response.columns import CYCLE_COLUMNS, ENERGY_COLUMNS
from femimpact.response.energy import CLOSED, energy_residual, largest_input
from femimpact.response.signals import CycleStatistics
from femimpact.system.system import System

__all__ = ["DwellCases", "DwellStatistics", "DwellSystem", "run_dwells"]

Array = NDArray[np.float64]

LARGEST_BLOCK = 64
"""Cases between two reports of progress, when interrupts are checked."""

BLOCKS = 8
"""Blocks per thread: cases cost differently, small blocks even that out."""


OF_LEDGER = ("residual", "bound", "loss", "stored")
"""What the ledger of a case gives."""


@dataclass(frozen=True, eq=False)
class DwellSystem:
    """A system with its drive and the row (dofs,) of its observed place."""

    system: System
    drive: Drive
    observed: Array


@dataclass(frozen=True, eq=False)
class DwellCases:
    """Cases that run through whole cycles of a sine.

    Parameters
    ----------
    drive : Drive
        Of the first case: all are sines of one kind, at one place.
    numbers : CaseNumbers
        Frequency, amplitude, phase, gaps and contact parameters of each case's own.
    position, velocity : ndarray (cases, d)
        Structure and balls at t = 0 relative to the base, m and m/s.
    cycles, measured : ndarray (cases,) of int
        Of the base: the whole dwell, and how many at its end are measured.
    systems : sequence of DwellSystem
        In place of the common system and its drive, alike in coordinates, outputs and pairs; none for the common one.
    system_of : ndarray (cases,) of int, optional
        Which of them a case has.
    """

    drive: Drive
    numbers: CaseNumbers
    position: Array
    velocity: Array
    cycles: NDArray[np.int64]
    measured: NDArray[np.int64]
    systems: Sequence[DwellSystem] = ()
    system_of: NDArray[np.int64] | None = None


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
    loss : ndarray (cases,), J
        Of structure and contacts in the measured cycles; not a number without a ledger.
    stored : ndarray (cases,), J
        Largest of kinetic, strain, ball and contact energy together at the instants of the ledger in these cycles.
    """

    cycles: CycleStatistics
    totals: Array
    residual: Array
    bound: Array
    unending: Array
    loss: Array
    stored: Array


def run_dwells(
    system: System, cases: DwellCases, method: EventSettings, observed: Array, instants: int, workers: int,
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
    instants : int
        Of a measured cycle at which the ledger is read, a divisor of `samples_per_cycle`; 0 for no ledger.
    workers : int
        Threads at most.
    progress : callable, optional

    Returns
    -------
    DwellStatistics
    """
    count = cases.cycles.size
    rigid = np.array([pair.parameters.kind == RIGID for pair in system.contacts], dtype=bool)
    first, *others = cases.systems or (DwellSystem(system, cases.drive, observed),)
    whole, outputs, derived = _source(first)
    store = FormStore(whole, rigid, outputs, rate=None, derived=derived)
    for other in others:
        store.add_system(*_source(other))

    def run(members: NDArray[np.intp], share: Progress | None) -> DwellStatistics:
        found = _run_block(system, store, cases, members, method, instants)
        if share is not None:
            share(1.0)
        return found

    blocks = max(math.ceil(count / LARGEST_BLOCK), 1 if workers == 1 else min(BLOCKS * workers, count))
    return _joined(run_each(run, np.array_split(np.arange(count), blocks), workers, progress))


def _source(given: DwellSystem) -> tuple[Equations, Outputs, dict[Any, Any]]:
    """What a store of closed forms takes of a system."""
    system = given.system
    return equations_of(system, given.drive), outputs_of(system, given.observed), system.derived


def _run_block(
    system: System, store: FormStore, cases: DwellCases, members: NDArray[np.intp], method: EventSettings, instants: int
) -> DwellStatistics:  # fmt: skip
    per_cycle, count = method.samples_per_cycle, members.size
    cycles, measured, most_measured = cases.cycles[members], cases.measured[members], int(cases.measured.max())
    numbers = cases.numbers.of(members)
    period = 2.0 * np.pi / numbers.omega
    inputs = Inputs(
        numbers=numbers,
        is_sine=True,
        position=cases.position[members],
        velocity=cases.velocity[members],
        window=np.stack([(cycles - measured) * period, np.full(count, np.inf)], axis=1),
    )
    block = new_block(system, store, inputs, method, True if instants else None)
    if cases.system_of is not None:
        share_block(block, [each.system for each in cases.systems], cases.system_of[members], method)
    _begin_free(block)
    end = cycles * per_cycle
    # one sample more: the first measured cycle begins with it, be it that at the start
    begin = (cycles - measured) * per_cycle - 1
    number = np.arange(most_measured * per_cycle + 1)
    between = per_cycle // max(instants, 1)
    shape = (count, most_measured * instants + 1 if instants else 0, block.grid.energy.shape[2])
    block.cases.sample[:] = begin
    block.grid = block.grid._replace(
        origin=begin + 1,
        cycles=no_cycles(count, most_measured),
        kept=np.where((number % between == 0) & (instants > 0), number // between, -1),
        energy=np.zeros(shape),
    )
    run_block(block, begin, end, float(method.most_events) * cycles.astype(float))
    found = _energies(block, measured, instants) if instants else np.full((4, count), np.nan)
    table = block.grid.cycles[:, :, : len(CYCLE_COLUMNS)]
    table = np.where(table[:, :, 5:] > 0.0, table, 0.0)
    return DwellStatistics(
        cycles=CycleStatistics(*np.moveaxis(table, (2, 1), (0, 1))),
        totals=np.moveaxis(block.cases.totals, 0, 2),
        unending=np.where(block.stopped == DONE, np.inf, block.cases.clock[:, 0]),
        **dict(zip(OF_LEDGER, found, strict=True)),
    )


def _begin_free(block: Block) -> None:
    """Make the closed forms without contact before the first call: every case needs one."""
    cases = block.cases
    own = np.hstack([block.system_of[:, None], cases.stiffness, cases.damping])
    parameters, of_case = np.unique(own, axis=0, return_inverse=True)
    pairs = block.pairs.rigid.size
    wanted = [WantedForm(0, row[1 : 1 + pairs].copy(), row[1 + pairs :].copy(), int(row[0])) for row in parameters]
    first = np.array(block.store.first_forms(wanted))
    cases.form[:, 0] = first[of_case.reshape(-1)]


def _energies(block: Block, measured: NDArray[np.int64], instants: int) -> tuple[Array, Array, Array, Array]:
    """What `OF_LEDGER` names; the residual is that of the start and of the ends of measured cycles."""
    ledger = cast(Ledger, block.ledger)
    table = np.concatenate([ledger.start[:, None], block.grid.energy], axis=1)[:, :, : len(ENERGY_COLUMNS)]
    # a case with fewer cycles than others: its last row stands for those after it
    own = np.minimum(np.arange(table.shape[1]), instants * measured[:, None] + 1)
    table = np.take_along_axis(table, own[:, :, None], axis=1)
    kinetic, strain, ball, contact, work, lost, in_contact = table.T
    stored, lost = kinetic + strain + ball + contact, lost + in_contact
    ends = np.append(0, np.arange(1, table.shape[1], instants))
    residual = np.max(np.abs(energy_residual(stored[ends], work[ends], lost[ends])), axis=0)
    put_in = largest_input(stored[ends], work[ends])
    bound = np.maximum(CLOSED, ledger.rounding / np.where(put_in > 0.0, put_in, 1.0))
    return np.asarray(residual), bound, lost[-1] - lost[1], np.asarray(np.max(stored[1:], axis=0))


def _joined(parts: Sequence[DwellStatistics]) -> DwellStatistics:
    """All blocks in one."""
    cycles = CycleStatistics(
        *(np.concatenate([getattr(part.cycles, name) for part in parts], axis=1) for name in CYCLE_COLUMNS)
    )
    totals = np.concatenate([part.totals for part in parts], axis=2)
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in (*OF_LEDGER, "unending")}
    return DwellStatistics(cycles, totals, **columns)
