"""A sweep by a step method: blocks of frequencies side by side."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.errors import DivergenceError
from femimpact.excitation import Sine
from femimpact.integrators.integrate import divergence_message
from femimpact.integrators.stepping.block import Block, Inputs, prepare, run_block
from femimpact.integrators.stepping.newmark import SteppingMethod
from femimpact.integrators.stepping.step_size import check_sampling, check_step
from femimpact.integrators.threads import Progress, run_each
from femimpact.response.energy import BALANCED, energy_residual, residual_warnings
from femimpact.response.impacts import statistics_of_cases
from femimpact.response.signals import SteadyMotion, steady_motion
from femimpact.sweep.curve import IMPACT_NAMES, SWEEP_UNITS
from femimpact.sweep.dwells import Dwells
from femimpact.system.system import State, System

__all__ = ["stepped_columns"]

WIDEST_BLOCK = 64
"""Cases side by side beyond which a block no longer gains speed but leaves the cache."""


ALIKE = 1.05
"""Longest over shortest run up to which cases count as equally long."""


def stepped_columns(
    system: System, amplitude: float, dwells: Dwells, method: SteppingMethod, state: State,
    observed: NDArray[Any], ledger: bool, workers: int, progress: Progress | None,
) -> tuple[dict[str, NDArray[Any]], list[str]]:  # fmt: skip
    """All frequencies by a step method, side by side in blocks: columns, and warnings."""
    f = dwells.frequency
    check_sampling(f, method, "frequencies")
    warnings = list(check_step(system, method))
    ends = np.ceil(dwells.cycles / (f * method.dt)).astype(int)
    starts = np.ceil((dwells.cycles - dwells.measured) / (f * method.dt)).astype(int)
    columns: dict[str, NDArray[Any]] = {name: np.full(f.size, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(f.size, "failed", dtype="<U11")
    diverged = np.full(f.size, np.inf)

    def run(members: NDArray[Any], share: Progress | None) -> None:
        # laid out when its turn comes: of many blocks only those at work are in memory
        block = prepare(
            system,
            Inputs(
                [Sine(amplitude, float(f[i])) for i in members], ends[members].tolist(), starts[members].tolist(), state
            ),
            method, observed=observed, ledger=ledger,
        )  # fmt: skip
        run_block(block, share)
        diverged[members] = block.diverged[: members.size]
        _fill(columns, block, members, dwells, method)

    run_each(run, _blocks(ends, workers), workers, progress)
    for i in np.flatnonzero(np.isfinite(diverged)):
        warnings.append(divergence_message(float(f[i]), float(diverged[i]), method))
    if ledger:
        # those that failed have said so
        residual = np.where(np.isfinite(diverged), 0.0, columns["energy_residual"])
        warnings += residual_warnings(f, residual, np.full(f.size, BALANCED))
    if all(s == "failed" for s in columns["steadiness"]):
        raise DivergenceError(divergence_message(float(f[0]), float(diverged.min()), method))
    return columns, warnings


def _blocks(ends: NDArray[Any], workers: int) -> list[NDArray[Any]]:
    """Cases of like length together; as many blocks as workers, none wider than the cache likes."""
    count = max(min(workers, ends.size // 2), math.ceil(ends.size / WIDEST_BLOCK), 1)
    if ends.max() <= ALIKE * ends.min():
        # neighbours in frequency have much or little contact: dealt out, every block gets its share
        return [np.arange(first, ends.size, count) for first in range(count)]
    return [members for members in np.array_split(np.argsort(-ends, kind="stable"), count) if members.size]


def _fill(
    columns: dict[str, NDArray[Any]], block: Block, members: NDArray[Any], dwells: Dwells, method: SteppingMethod
) -> None:
    """Columns of the frequencies of one block, but for those that diverged."""
    motion = _motion(block, dwells.cycles[members], dwells.measured[members])
    totals = block.motion.totals[:, :, : members.size]
    # an impulse has no peak
    totals[4, block.pairs.kind == RIGID] = np.nan
    measured = np.diff(block.motion.window[:, : members.size], axis=0)[0] * method.dt
    statistics = statistics_of_cases(totals, measured, dwells.frequency[members])
    fine = np.isinf(block.diverged[: members.size])
    for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
        columns[name][members[fine]] = getattr(motion, name)[fine]
    for name in IMPACT_NAMES:
        columns[name][members[fine]] = statistics[name][fine]
    if block.ledger:
        columns["energy_residual"][members[fine]] = _residuals(block, dwells.cycles[members])[fine]


def _motion(block: Block, cycles: NDArray[Any], measured: NDArray[Any]) -> SteadyMotion:
    # slower cases of the block run on beyond their own dwell: leave those cycles out
    statistics = block.cycle_statistics
    own = np.arange(statistics.samples.shape[0])[:, None] < cycles
    return steady_motion(replace(statistics, samples=np.where(own, statistics.samples, 0.0)), measured)


def _residuals(block: Block, cycles: NDArray[Any]) -> NDArray[Any]:
    energy = block.cycles.energy[:, :, : block.cases]
    # slower cases run on beyond their own dwell: its last row stands for those after it
    own = np.minimum(np.arange(energy.shape[0])[:, None, None], cycles)
    kinetic, strain, ball, contact, work, structure_loss, contact_loss = np.moveaxis(
        np.take_along_axis(energy, own, axis=0), 1, 0
    )
    with np.errstate(invalid="ignore", over="ignore"):
        residual = energy_residual(kinetic + strain + ball + contact, work, structure_loss + contact_loss)
        return np.asarray(np.max(np.abs(residual), axis=0))
