"""A block of cases side by side: one system, one method, many excitations of one kind."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.contact.callback import ForcePointer, law_error
from femimpact.integrators.driving import drive_of
from femimpact.integrators.stepping import layout
from femimpact.integrators.stepping.arrays import (
    Inputs,
    cycles_of,
    empty_record,
    forces_of,
    limits_of,
    motion_of,
    pairs_of,
)
from femimpact.integrators.stepping.continued import Beginning, go_on
from femimpact.integrators.stepping.operators import operator_of
from femimpact.integrators.stepping.scheme import SteppingMethod, scheme_of
from femimpact.integrators.threads import Progress
from femimpact.response.columns import CYCLE_COLUMNS, ENERGY_COLUMNS
from femimpact.response.signals import CycleStatistics
from femimpact.system.system import System

__all__ = ["Block", "Inputs", "check_laws", "prepare", "run_block"]

Array = NDArray[np.float64]

STEPS_BETWEEN_CHECKS = 4_000_000
"""Mode-steps between two looks at progress, interrupts and divergence: some 10 ms of work."""


@dataclass(frozen=True, eq=False)
class Block:
    """Arrays of one compiled run; the kernel writes into them."""

    operator: layout.Operator
    scheme: layout.Scheme
    fine: layout.Fine | None
    pairs: layout.Pairs
    motion: layout.Motion
    cycles: layout.Cycles
    record: layout.Record
    ledger: bool
    steps: int
    beginning: Beginning
    ends: NDArray[np.int64]
    cases: int
    limit: Array
    diverged: Array
    names: tuple[str, ...]
    forces: tuple[ForcePointer | None, ...]
    """The C functions of the pairs' laws, which are kept alive here."""

    def handed(self) -> layout.Stepped:
        """The block as functions of the core take it, with scratch space of this call."""
        scratch = np.zeros((6, len(self.pairs.row))), np.zeros(len(ENERGY_COLUMNS))
        cases = layout.Cases(self.pairs, self.motion, self.cycles, self.record, *scratch)
        return layout.Stepped(self.operator, self.scheme, cases, self.ledger)

    @property
    def cycle_statistics(self) -> CycleStatistics:
        """Statistics of every base cycle of the real cases that was finished since the beginning."""
        values = self.cycles.values[self.beginning.cycle :, :, : self.cases]
        columns = {name: values[:, i] for i, name in enumerate(CYCLE_COLUMNS)}
        return CycleStatistics(**columns)


def _lanes(cases: int) -> int:
    """Width of the case axis: one alone, else whole packs."""
    return 1 if cases == 1 else layout.WIDTH * math.ceil(cases / layout.WIDTH)


def prepare(
    system: System,
    inputs: Inputs,
    method: SteppingMethod,
    *,
    observed: Array,
    ledger: bool,
    record: layout.Record | None = None,
) -> Block:
    """Lay out all arrays of a block; nothing runs yet.

    Parameters
    ----------
    system : System
    inputs : Inputs
    method : SteppingMethod
    observed : ndarray (dofs,)
        Row whose value gets cycle statistics.
    ledger : bool
    record : layout.Record, optional
        What case 0 keeps.

    Returns
    -------
    Block
    """
    cases = len(inputs.excitations)
    lanes = _lanes(cases)
    # idle lanes repeat the last case: finite numbers, no effect on the others
    idle = lanes - cases
    padded = replace(
        inputs,
        excitations=[*inputs.excitations, *[inputs.excitations[-1]] * idle],
        steps=[*inputs.steps, *[inputs.steps[-1]] * idle],
        window_start=[*inputs.window_start, *[inputs.window_start[-1]] * idle],
        each=[*inputs.each, *(list(inputs.each[-1:]) * idle)],
    )
    drives = [drive_of(system, excitation) for excitation in padded.excitations]
    scheme = scheme_of(method)
    operator = operator_of(system, scheme, observed, drives[0].load)
    fine = layout.Fine(1, operator, scheme) if scheme.rigid else None
    if method.refine > 1:
        fine_scheme = scheme_of(method, method.dt / method.refine)
        fine = layout.Fine(method.refine, operator_of(system, fine_scheme, observed, drives[0].load), fine_scheme)
    kept = record or empty_record(system.dofs, len(system.contacts))
    forces = forces_of(system)
    pairs = pairs_of(system, operator, drives[0], lanes, forces, padded.each)
    # only a history has losses mode by mode; in a sweep a case alone is summed as beside others
    modal = ledger and record is not None and lanes == 1 and not operator.banded
    motion = motion_of(system, operator, pairs, padded, drives, method, modal, kept)
    cycles = cycles_of(padded, motion, method.dt, ledger)
    go_on(inputs.beginning, motion, cycles)
    block = Block(
        operator=operator,
        scheme=scheme,
        fine=fine,
        pairs=pairs,
        motion=motion,
        cycles=cycles,
        record=kept,
        ledger=ledger,
        steps=max(inputs.steps),
        beginning=inputs.beginning,
        ends=np.array(inputs.steps),
        cases=cases,
        limit=limits_of(system, padded, drives, operator, motion, method),
        diverged=np.full(lanes, np.inf),
        names=tuple(pair.name for pair in system.contacts),
        forces=forces,
    )
    if ledger:
        core.write_energies(block.handed())
        check_laws(block)
    return block


def check_laws(block: Block) -> None:
    """Raise what a custom law has raised, or that its force was no finite number.

    Raises
    ------
    InputError
        With the name of the pair, and what the law was given.
    """
    for j in np.flatnonzero(block.pairs.refused[:, 0]):
        force = block.forces[j]
        if force is not None:
            raise law_error(block.names[j], force, *(float(value) for value in block.pairs.refused[j]))


def run_block(block: Block, progress: Progress | None = None, stop: threading.Event | None = None) -> None:
    """Run a block to its end, in pieces: between them come progress, interrupts and the check for divergence.

    Parameters
    ----------
    block : Block
    progress : callable, optional
        Called with the share of the block that is done, 0 to 1.
    stop : threading.Event, optional
        Ends the run early once set.
    """
    lanes, dofs = block.motion.q.shape[1], block.motion.q.shape[0]
    handed = block.handed()
    piece = max(1000, STEPS_BETWEEN_CHECKS // (lanes * dofs))
    done = 0
    while done < block.steps:
        if stop is not None and stop.is_set():
            return
        # pieces end where cases end, so that what comes after does not count
        steps = min(piece, int(block.ends[block.ends > done].min()) - done)
        core.advance(steps, handed, block.fine)
        check_laws(block)
        done += steps
        with np.errstate(invalid="ignore"):
            out = ~(np.abs(block.motion.w[0]) <= block.limit) & np.isinf(block.diverged)
        out[: block.cases] &= block.ends >= done
        block.diverged[out] = done * block.scheme.dt
        if bool(np.all(np.isfinite(block.diverged[: block.cases]))):
            return
        if progress is not None:
            progress(done / block.steps)
