"""A block of cases side by side: one system, one method, many excitations of one kind."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.excitation import Excitation
from femimpact.integrators.compiled.packs import WIDTH
from femimpact.integrators.driving import drive_of
from femimpact.integrators.stepping import layout, loop
from femimpact.integrators.stepping.arrays import cycles_of, empty_record, limits_of, motion_of, pairs_of
from femimpact.integrators.stepping.entries import write_energy
from femimpact.integrators.stepping.newmark import SteppingMethod, scheme_of
from femimpact.integrators.stepping.operators import operator_of
from femimpact.integrators.threads import Progress
from femimpact.response.columns import CYCLE_COLUMNS, ENERGY_COLUMNS
from femimpact.response.signals import CycleStatistics
from femimpact.system.system import State, System

__all__ = ["Block", "prepare", "run_block"]

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
    ends: NDArray[Any]
    cases: int
    limit: NDArray[Any]
    diverged: NDArray[Any]

    @property
    def cycle_statistics(self) -> CycleStatistics:
        """Statistics of every finished base cycle of the real cases."""
        values = self.cycles.values[:, :, : self.cases]
        columns = {name: values[:, i] for i, name in enumerate(CYCLE_COLUMNS)}
        return CycleStatistics(**columns)


def _lanes(cases: int) -> int:
    """Width of the case axis: one alone, else whole packs."""
    return 1 if cases == 1 else WIDTH * math.ceil(cases / WIDTH)


def prepare(
    system: System,
    excitations: Sequence[Excitation],
    method: SteppingMethod,
    *,
    steps: Sequence[int],
    window_start: Sequence[int],
    initial: State,
    observed: NDArray[Any],
    ledger: bool,
    record: layout.Record | None = None,
) -> Block:
    """Lay out all arrays of a block; nothing runs yet.

    Parameters
    ----------
    system : System
    excitations : sequence of Excitation
        One for each case, all acting along one load.
    method : SteppingMethod
    steps : sequence of int
        Length of each case; the block runs to the longest, and what a case does after its own end
        does not count.
    window_start : sequence of int
        Step from which impacts are counted, for each case, to its own end.
    initial : State
    observed : ndarray (dofs,)
        Row whose value gets cycle statistics.
    ledger : bool
    record : layout.Record, optional
        What case 0 keeps.

    Returns
    -------
    Block
    """
    lanes = _lanes(len(excitations))
    # idle lanes repeat the last case: finite numbers, no effect on the others
    idle = lanes - len(excitations)
    padded = [*excitations, *[excitations[-1]] * idle]
    drives = [drive_of(system, excitation) for excitation in padded]
    window = np.array([[*w, *[w[-1]] * idle] for w in (window_start, steps)], dtype=np.int64)
    scheme = scheme_of(method)
    operator = operator_of(system, scheme, observed, drives[0].load)
    fine = layout.Fine(1, operator, scheme) if scheme.rigid else None
    if method.refine > 1:
        fine_scheme = scheme_of(method, method.dt / method.refine)
        fine = layout.Fine(method.refine, operator_of(system, fine_scheme, observed, drives[0].load), fine_scheme)
    longest = max(steps)
    kept = record or empty_record(system.dofs)
    pairs = pairs_of(system, operator, drives[0], lanes)
    # only a history tells losses mode by mode; in a sweep a case alone is summed as beside others
    modal = ledger and record is not None and lanes == 1 and not operator.banded
    motion = motion_of(system, operator, pairs, padded, drives, method, initial, window, longest, modal, kept)
    cycles = cycles_of(padded, motion, method.dt, longest, ledger)
    block = Block(
        operator=operator,
        scheme=scheme,
        fine=fine,
        pairs=pairs,
        motion=motion,
        cycles=cycles,
        record=kept,
        ledger=ledger,
        steps=longest,
        ends=np.array(steps),
        cases=len(excitations),
        limit=limits_of(system, padded, drives, operator, motion, method, longest * method.dt),
        diverged=np.full(lanes, np.inf),
    )
    if ledger:
        # a row of its own: strided, it would have the same code compiled once more
        energy = np.zeros(len(ENERGY_COLUMNS))
        for c in range(lanes):
            write_energy(c, operator, pairs, motion, energy)
            cycles.energy[0, :, c] = energy
    return block


def run_block(block: Block, progress: Progress | None = None, stop: threading.Event | None = None) -> None:
    """Run a block to its end, in pieces: between them it reports, listens and looks for divergence.

    Parameters
    ----------
    block : Block
    progress : callable, optional
        Called with the share of the block that is done, 0 to 1.
    stop : threading.Event, optional
        Ends the run early once set.
    """
    lanes, dofs = block.motion.q.shape[1], block.motion.q.shape[0]
    work, energy = np.zeros((6, max(len(block.pairs.row), 1))), np.zeros(len(ENERGY_COLUMNS))
    piece = max(1000, STEPS_BETWEEN_CHECKS // (lanes * dofs))
    done = 0
    while done < block.steps:
        if stop is not None and stop.is_set():
            return
        # pieces end where cases end, so that none is judged by what comes after
        steps = min(piece, int(block.ends[block.ends > done].min()) - done)
        loop.advance(
            steps, block.operator, block.scheme, block.fine, block.pairs, block.motion, block.cycles, block.record,
            block.ledger, work, energy, True if block.operator.banded else None,
        )  # fmt: skip
        done += steps
        with np.errstate(invalid="ignore"):
            out = ~(np.abs(block.motion.w[0]) <= block.limit) & np.isinf(block.diverged)
        out[: block.cases] &= block.ends >= done
        block.diverged[out] = done * block.scheme.dt
        if bool(np.all(np.isfinite(block.diverged[: block.cases]))):
            return
        if progress is not None:
            progress(done / block.steps)
