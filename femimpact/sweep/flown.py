"""A sweep event-driven: each frequency a flight of its own."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.energy import BALANCED, CLOSED, residual_warnings, unbalanced
from femimpact.errors import DivergenceError
from femimpact.excitation import Sine
from femimpact.impacts import impact_statistics, statistics_of_cases
from femimpact.integrators.compliant import compliant_forms, is_compliant
from femimpact.integrators.driving import drive_of
from femimpact.integrators.event_driven import EventDriven, check_events
from femimpact.integrators.passages import Passages, pass_dwells
from femimpact.integrators.threads import Progress, run_each
from femimpact.signals import steady_motion
from femimpact.sweep.curve import IMPACT_NAMES, SWEEP_UNITS
from femimpact.sweep.dwells import Dwells
from femimpact.system import State, System

__all__ = ["flown_columns"]

AT_ONCE = 1024
"""Cases whose statistics are in memory at once."""


def flown_columns(
    system: System, amplitude: float, dwells: Dwells, method: EventDriven, state: State,
    observed: NDArray[Any], ledger: bool, workers: int, progress: Progress | None,
) -> tuple[dict[str, NDArray[Any]], list[str]]:  # fmt: skip
    """All frequencies event-driven: columns, and warnings."""
    f, warnings = dwells.frequency, list[str]()
    check_events(system)
    if not system.contacts or is_compliant(system):
        return _passed_columns(system, amplitude, dwells, method, state, observed, ledger, workers, progress)
    from femimpact.integrators.dwell import dwell

    columns = _empty(f.size)
    lock = threading.Lock()

    def run(i: int, share: Progress | None) -> None:
        cycles, measured = int(dwells.cycles[i]), int(dwells.measured[i])
        try:
            found = dwell(system, Sine(amplitude, float(f[i])), method, cycles, measured, state, observed, ledger)
        except DivergenceError as error:
            with lock:
                warnings.append(f"at {f[i]:g} Hz: {error}")
            return
        motion = steady_motion(found.cycles, np.array([measured]))
        fault = _fault(float(motion.rms[0]), found.residual, ledger)
        if fault:
            with lock:
                warnings.append(f"at {f[i]:g} Hz: {fault}")
            return
        for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
            columns[name][i] = getattr(motion, name)[0]
        statistics = impact_statistics(found.totals, found.measured, float(f[i]), "")
        for name in IMPACT_NAMES:
            columns[name][i] = getattr(statistics, name)
        columns["energy_residual"][i] = found.residual
        if share is not None:
            share(1.0)

    run_each(run, range(f.size), workers, progress)
    if ledger:
        # those that failed have said so
        residual = np.nan_to_num(columns["energy_residual"], nan=0.0)
        warnings += residual_warnings(f, residual, np.full(f.size, CLOSED))
    if all(s == "failed" for s in columns["steadiness"]):
        raise DivergenceError(warnings[-1])
    return columns, warnings


def _fault(rms: float, residual: float, ledger: bool) -> str:
    """What is wrong with a run beyond rounding, or nothing."""
    if not math.isfinite(rms) or (ledger and not math.isfinite(residual)):
        return "the motion is not finite: its closed form has lost all digits; Newmark takes this system"
    return unbalanced(residual) if ledger and residual > BALANCED else ""


def _empty(cases: int) -> dict[str, NDArray[Any]]:
    """Columns of a sweep in which every case has failed so far."""
    columns: dict[str, NDArray[Any]] = {name: np.full(cases, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(cases, "failed", dtype="<U11")
    return columns


def _passed_columns(
    system: System, amplitude: float, dwells: Dwells, method: EventDriven, state: State,
    observed: NDArray[Any], ledger: bool, workers: int, progress: Progress | None,
) -> tuple[dict[str, NDArray[Any]], list[str]]:  # fmt: skip
    """All frequencies through compliant contacts, or without any, in groups that share one compiled call."""
    f, warnings = dwells.frequency, list[str]()
    bases = [Sine(amplitude, float(frequency)) for frequency in f]
    drives = [drive_of(system, base) for base in bases]
    found = compliant_forms(system, drives[0])
    balls = len(system.balls)
    # at rest in space means a speed of its own at every frequency
    alike = state.frame == "base"
    starts = [state.relative_to_base(system, base) for base in (bases[:1] if alike else bases)] * (
        f.size if alike else 1
    )
    position = np.array([np.concatenate([u, y[:balls]]) for u, _, y, _ in starts])
    velocity = np.array([np.concatenate([v, y_rate[:balls]]) for _, v, _, y_rate in starts])
    columns, bound = _empty(f.size), np.full(f.size, CLOSED)
    # the ledger of a case takes some kilobytes a second: many cases go one part after the other
    parts = np.array_split(np.arange(f.size), math.ceil(f.size / AT_ONCE))
    for number, members in enumerate(parts):
        share = None if progress is None else _share(progress, number, len(parts))
        passed = pass_dwells(
            system, found, [drives[i] for i in members], method, dwells.cycles[members], dwells.measured[members],
            position[members], velocity[members], observed, ledger, workers, share,
        )  # fmt: skip
        bound[members] = passed.bound
        _fill(columns, warnings, members, passed, dwells, method)
    if ledger:
        warnings += residual_warnings(f, np.nan_to_num(columns["energy_residual"], nan=0.0), bound)
    if all(s == "failed" for s in columns["steadiness"]):
        raise DivergenceError(warnings[-1])
    return columns, warnings


def _share(progress: Progress, number: int, parts: int) -> Progress:
    return lambda done: progress((number + done) / parts)


def _fill(
    columns: dict[str, NDArray[Any]], warnings: list[str], members: NDArray[Any], passed: Passages, dwells: Dwells,
    method: EventDriven,
) -> None:  # fmt: skip
    """Columns of one group."""
    motion = steady_motion(passed.cycles, dwells.measured[members])
    statistics = statistics_of_cases(
        passed.totals, dwells.measured[members] / dwells.frequency[members], dwells.frequency[members]
    )
    faults = [
        _fault(*pair, ledger=bool(np.isfinite(passed.bound[0])))
        for pair in zip(motion.rms, passed.residual, strict=True)
    ]
    resolved = np.isinf(passed.stuck)
    fine = resolved & np.array([not fault for fault in faults])
    for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
        columns[name][members[fine]] = getattr(motion, name)[fine]
    for name in IMPACT_NAMES:
        columns[name][members[fine]] = statistics[name][fine]
    columns["energy_residual"][members[fine]] = passed.residual[fine]
    for c in np.flatnonzero(resolved & ~fine):
        warnings.append(f"at {dwells.frequency[members[c]]:g} Hz: {faults[c]}")
    for c in np.flatnonzero(~resolved):
        warnings.append(
            f"at {dwells.frequency[members[c]]:g} Hz: contacts at t = {passed.stuck[c]:.6g} s do not resolve within "
            f"{method.most_events} changes a cycle: raise most_events, or check gaps that leave no clearance"
        )
