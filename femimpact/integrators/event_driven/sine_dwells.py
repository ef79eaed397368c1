"""Dwells under sine motions of the base, event-driven: each frequency a case of its own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.excitation import Sine
from femimpact.integrators.answers import SineDwellResults, SineDwells
from femimpact.integrators.driving import drive_of
from femimpact.integrators.event_driven.alone import unending
from femimpact.integrators.event_driven.dwells import DwellCases, run_dwells
from femimpact.integrators.event_driven.run import not_finite, peaks_of_forces
from femimpact.integrators.event_driven.settings import EventSettings, check_events
from femimpact.integrators.threads import Progress
from femimpact.response.energy import BALANCED, unbalanced
from femimpact.response.signals import steady_motion
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["event_driven_dwells"]

Array = NDArray[np.float64]


def event_driven_dwells(
    system: System, dwells: SineDwells, method: EventSettings, initial: State, observed: Array, ledger: bool,
    workers: int, progress: Progress | None,
) -> SineDwellResults:  # fmt: skip
    """Dwells event-driven; see `Method.run_dwells`."""
    check_events(system)
    found = run_dwells(system, _cases(system, dwells, initial), method, observed, ledger, workers, progress)
    motion = steady_motion(found.cycles, dwells.measured)
    rigid = np.array([pair.parameters.kind == RIGID for pair in system.contacts], dtype=bool)
    totals = peaks_of_forces(found.totals, rigid)
    faults = [
        _fault(method, float(time), float(rms), float(residual), ledger)
        for time, rms, residual in zip(found.unending, motion.rms, found.residual, strict=True)
    ]
    failures = tuple(
        f"at {f:g} Hz: {fault}" if fault else "" for f, fault in zip(dwells.frequency, faults, strict=True)
    )
    duration = dwells.measured / dwells.frequency
    return SineDwellResults(motion, totals, duration, found.residual, found.bound, failures)


def _cases(system: System, dwells: SineDwells, initial: State) -> DwellCases:
    """Every frequency from the state of its own that the initial one means under it."""
    bases = [Sine(dwells.amplitude, float(frequency)) for frequency in dwells.frequency]
    balls = len(system.balls)
    # at rest in the inertial frame means a speed of its own at every frequency, a stop fixed there a place of its own
    alike = initial.frame == "base" and all(pair.fixed_to == "base" for pair in system.contacts)
    starts = [initial.relative_to_base(system, base) for base in (bases[:1] if alike else bases)]
    starts = starts * (len(bases) if alike else 1)
    return DwellCases(
        drives=[drive_of(system, base) for base in bases],
        contacts=[system.contacts] * len(bases),
        position=np.array([np.concatenate([u, y[:balls]]) for u, _, y, _ in starts]),
        velocity=np.array([np.concatenate([v, y_rate[:balls]]) for _, v, _, y_rate in starts]),
        cycles=dwells.cycles,
        measured=dwells.measured,
    )


def _fault(method: EventSettings, time: float, rms: float, residual: float, ledger: bool) -> str:
    """What is wrong with a case beyond rounding, or nothing."""
    if math.isfinite(time):
        return unending(time, method)
    if not math.isfinite(rms) or (ledger and not math.isfinite(residual)):
        return not_finite("")
    return unbalanced(residual) if ledger and residual > BALANCED else ""
