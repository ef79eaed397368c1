"""A sweep event-driven: each frequency a case of its own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.errors import DivergenceError
from femimpact.excitation import Sine
from femimpact.integrators.driving import drive_of
from femimpact.integrators.event_driven import EventDriven, check_events
from femimpact.integrators.event_driven.dwells import DwellCases, DwellStatistics, run_dwells
from femimpact.integrators.event_driven.run import not_finite, unending
from femimpact.integrators.threads import Progress
from femimpact.response.energy import BALANCED, residual_warnings, unbalanced
from femimpact.response.impacts import statistics_of_cases
from femimpact.response.signals import steady_motion
from femimpact.sweep.curve import IMPACT_NAMES, SWEEP_UNITS
from femimpact.sweep.dwells import Dwells
from femimpact.system.system import State, System

__all__ = ["event_driven_columns"]


def event_driven_columns(
    system: System, amplitude: float, dwells: Dwells, method: EventDriven, state: State,
    observed: NDArray[Any], ledger: bool, workers: int, progress: Progress | None,
) -> tuple[dict[str, NDArray[Any]], list[str]]:  # fmt: skip
    """All frequencies event-driven: columns, and warnings."""
    check_events(system)
    f = dwells.frequency
    bases = [Sine(amplitude, float(frequency)) for frequency in f]
    balls = len(system.balls)
    # at rest in space means a speed of its own at every frequency, and a stop fixed there a place of its own
    alike = state.frame == "base" and all(pair.fixed_to == "base" for pair in system.contacts)
    starts = [state.relative_to_base(system, base) for base in (bases[:1] if alike else bases)]
    starts = starts * (f.size if alike else 1)
    cases = DwellCases(
        drives=[drive_of(system, base) for base in bases],
        contacts=[system.contacts] * f.size,
        position=np.array([np.concatenate([u, y[:balls]]) for u, _, y, _ in starts]),
        velocity=np.array([np.concatenate([v, y_rate[:balls]]) for _, v, _, y_rate in starts]),
        cycles=dwells.cycles,
        measured=dwells.measured,
    )
    found = run_dwells(system, cases, method, observed, ledger, workers, progress)
    columns: dict[str, NDArray[Any]] = {name: np.full(f.size, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(f.size, "failed", dtype="<U11")
    warnings = _fill(columns, found, dwells, method, system, ledger)
    if ledger:
        # those that failed have said so
        warnings += residual_warnings(f, np.nan_to_num(columns["energy_residual"], nan=0.0), found.bound)
    if all(s == "failed" for s in columns["steadiness"]):
        raise DivergenceError(warnings[-1])
    return columns, warnings


def _fill(
    columns: dict[str, NDArray[Any]], found: DwellStatistics, dwells: Dwells, method: EventDriven, system: System,
    ledger: bool,
) -> list[str]:  # fmt: skip
    """Columns of all cases that have come to their end, and warnings of those that have not."""
    motion = steady_motion(found.cycles, dwells.measured)
    totals = found.totals.copy()
    # an impulse has no peak force
    totals[4, [pair.parameters.kind == RIGID for pair in system.contacts]] = np.nan
    statistics = statistics_of_cases(totals, dwells.measured / dwells.frequency, dwells.frequency)
    faults = [
        _fault(method, float(time), float(rms), float(residual), ledger)
        for time, rms, residual in zip(found.unending, motion.rms, found.residual, strict=True)
    ]
    fine = np.array([not fault for fault in faults])
    for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
        columns[name][fine] = getattr(motion, name)[fine]
    for name in IMPACT_NAMES:
        columns[name][fine] = statistics[name][fine]
    columns["energy_residual"][fine] = found.residual[fine]
    return [f"at {dwells.frequency[c]:g} Hz: {faults[c]}" for c in np.flatnonzero(~fine)]


def _fault(method: EventDriven, time: float, rms: float, residual: float, ledger: bool) -> str:
    """What is wrong with a case beyond rounding, or nothing."""
    if math.isfinite(time):
        return unending(time, method)
    if not math.isfinite(rms) or (ledger and not math.isfinite(residual)):
        return not_finite("")
    return unbalanced(residual) if ledger and residual > BALANCED else ""
