"""Many dwells by a method with steps: blocks of cases side by side, each with its own numbers and start."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.errors import require
from femimpact.excitation import Sine
from femimpact.integrators.answers import SineCases, SineDwellResults, SineDwells
from femimpact.integrators.cases import start_of, with_contacts_of
from femimpact.integrators.stepping.block import Block, Inputs, prepare, run_block
from femimpact.integrators.stepping.run import divergence_message
from femimpact.integrators.stepping.scheme import SteppingMethod
from femimpact.integrators.stepping.step_size import check_sampling, check_step
from femimpact.integrators.threads import Progress, run_each
from femimpact.response.energy import BALANCED, energy_residual
from femimpact.response.signals import SteadyMotion, steady_motion
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["stepped_cases", "stepped_dwells"]

Array = NDArray[np.float64]

WIDEST_BLOCK = 64
"""Cases side by side beyond which a block no longer gains speed but leaves the cache."""

MOST_STEPS = 1e15
"""Of a dwell: more are a mistake, and no whole number of the loop."""

ALIKE = 1.05
"""Longest over shortest run up to which cases count as equally long."""

MOTION = ("peak", "rms", "first_harmonic", "phase")
"""Numbers of a steady motion."""


def stepped_dwells(
    system: System, dwells: SineDwells, method: SteppingMethod, initial: State, observed: Array, ledger: bool,
    workers: int, progress: Progress | None,
) -> SineDwellResults:  # fmt: skip
    """Dwells by a method with steps, side by side in blocks; see `Method.run_dwells`."""
    lengths = _Lengths(dwells.frequency, dwells.cycles, dwells.measured)
    check_sampling(dwells.frequency, method, "frequencies")
    warnings = check_step(system, method)

    def inputs_of(members: NDArray[np.intp], ends: list[int], begins: list[int]) -> Inputs:
        sines = [Sine(dwells.amplitude, float(dwells.frequency[i]), dwells.phase) for i in members]
        return Inputs(sines, ends, begins, initial)

    return _stepped(system, lengths, inputs_of, method, observed, ledger, workers, progress, warnings)


def stepped_cases(
    system: System, cases: SineCases, method: SteppingMethod, observed: Array, instants: int, workers: int,
    progress: Progress | None,
) -> SineDwellResults:  # fmt: skip
    """Cases, each with its own gaps, laws and start, by a method with steps; see `many_cases.run_cases`.

    Their laws are of the kinds of the system's, with compiled branches, and their starts are not static. The ledger is
    read at the ends of cycles.
    """
    lengths = _Lengths(cases.frequency, cases.cycles, cases.measured)
    check_sampling(cases.frequency, method, "frequencies")
    first = [int(np.argmax(cases.law_of == number)) for number in np.unique(cases.law_of)]
    warnings = [text for case in first for text in check_step(with_contacts_of(system, cases, case), method)]

    def inputs_of(members: NDArray[np.intp], ends: list[int], begins: list[int]) -> Inputs:
        numbers = (values[members].tolist() for values in (cases.amplitude, cases.frequency, cases.phase))
        sines = [Sine(*own) for own in zip(*numbers, strict=True)]
        each = [(with_contacts_of(system, cases, case), start_of(cases, case)) for case in members.tolist()]
        return Inputs(sines, ends, begins, cases.initial, each=each)

    told = tuple(dict.fromkeys(warnings))
    return _stepped(system, lengths, inputs_of, method, observed, instants > 0, workers, progress, told)


@dataclass(frozen=True, eq=False)
class _Lengths:
    """Frequencies (Hz) of dwells, their whole cycles and the measured ones, arrays (n,)."""

    frequency: Array
    cycles: NDArray[np.int64]
    measured: NDArray[np.int64]


def _stepped(
    system: System, dwells: _Lengths, inputs_of: Callable[[NDArray[np.intp], list[int], list[int]], Inputs],
    method: SteppingMethod, observed: Array, ledger: bool, workers: int, progress: Progress | None,
    warnings: tuple[str, ...],
) -> SineDwellResults:  # fmt: skip
    """Dwells side by side in blocks; `inputs_of` gives what some are given, for their steps and windows."""
    f = dwells.frequency
    steps = float(np.max(dwells.cycles / f)) / method.dt
    require(steps <= MOST_STEPS, "frequencies", float(f.min()), "Hz", f"must take at most {MOST_STEPS:g} steps")
    ends = np.ceil(dwells.cycles / (f * method.dt)).astype(int)
    begins = np.ceil((dwells.cycles - dwells.measured) / (f * method.dt)).astype(int)
    motion: dict[str, NDArray[Any]] = {name: np.full(f.size, np.nan) for name in MOTION}
    motion["steadiness"] = np.full(f.size, "transient", dtype="<U11")
    totals = np.full((6, len(system.contacts), f.size), np.nan)
    duration, residual, diverged = np.full((3, f.size), np.nan)

    def run(members: NDArray[np.intp], share: Progress | None) -> None:
        # laid out when its turn comes: of many blocks only those at work are in memory
        inputs = inputs_of(members, ends[members].tolist(), begins[members].tolist())
        block = prepare(system, inputs, method, observed=observed, ledger=ledger)
        run_block(block, share)
        diverged[members] = block.diverged[: members.size]
        found = _motion(block, dwells.cycles[members], dwells.measured[members])
        for name, column in motion.items():
            column[members] = getattr(found, name)
        totals[:, :, members] = block.motion.totals[:, : len(system.contacts), : members.size]
        duration[members] = np.diff(block.motion.window[:, : members.size], axis=0)[0] * method.dt
        if ledger:
            residual[members] = _residuals(block, dwells.cycles[members])

    run_each(run, _blocks(ends, workers), workers, progress)
    # an impulse has no peak
    totals[4, [pair.parameters.kind == RIGID for pair in system.contacts]] = np.nan
    failures = tuple(
        divergence_message(float(frequency), float(time), method) if math.isfinite(time) else ""
        for frequency, time in zip(f, diverged, strict=True)
    )
    bound = np.full(f.size, BALANCED)
    return SineDwellResults(SteadyMotion(**motion), totals, duration, residual, bound, failures, warnings)


def _blocks(ends: NDArray[np.int64], workers: int) -> list[NDArray[np.intp]]:
    """Cases of like length together; as many blocks as workers, none wider than the cache holds."""
    count = max(min(workers, ends.size // 2), math.ceil(ends.size / WIDEST_BLOCK), 1)
    if ends.max() <= ALIKE * ends.min():
        # neighbours in frequency have much or little contact: distributed in turn, every block gets its share
        return [np.arange(first, ends.size, count) for first in range(count)]
    return [members for members in np.array_split(np.argsort(-ends, kind="stable"), count) if members.size]


def _motion(block: Block, cycles: NDArray[np.int64], measured: NDArray[np.int64]) -> SteadyMotion:
    # slower cases of the block run on beyond their own dwell: leave those cycles out
    statistics = block.cycle_statistics
    own = np.arange(statistics.samples.shape[0])[:, None] < cycles
    return steady_motion(replace(statistics, samples=np.where(own, statistics.samples, 0.0)), measured)


def _residuals(block: Block, cycles: NDArray[np.int64]) -> Array:
    energy = block.cycles.energy[:, :, : block.cases]
    # slower cases run on beyond their own dwell: its last row stands for those after it
    own = np.minimum(np.arange(energy.shape[0])[:, None, None], cycles)
    kinetic, strain, ball, contact, work, structure_loss, contact_loss = np.moveaxis(
        np.take_along_axis(energy, own, axis=0), 1, 0
    )
    with np.errstate(invalid="ignore", over="ignore"):
        residual = energy_residual(kinetic + strain + ball + contact, work, structure_loss + contact_loss)
        return np.asarray(np.max(np.abs(residual), axis=0))
