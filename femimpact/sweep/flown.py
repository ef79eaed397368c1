"""A sweep event-driven: each frequency a flight of its own."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError
from femimpact.excitation import Sine
from femimpact.impacts import impact_statistics
from femimpact.integrators.block import Progress
from femimpact.integrators.dwell import dwell
from femimpact.integrators.event_driven import EventDriven, check_events
from femimpact.signals import steady_motion
from femimpact.sweep.curve import SWEEP_UNITS
from femimpact.sweep.dwells import Dwells
from femimpact.sweep.stepped import IMPACT_NAMES
from femimpact.system import State, System

__all__ = ["flown_columns"]


def flown_columns(
    system: System, amplitude: float, dwells: Dwells, method: EventDriven, state: State,
    observed: NDArray[Any], ledger: bool, workers: int, progress: Progress | None,
) -> tuple[dict[str, NDArray[Any]], list[str]]:  # fmt: skip
    """All frequencies event-driven: columns, and warnings."""
    f, warnings = dwells.frequency, list[str]()
    check_events(system)
    columns = {name: np.full(f.size, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(f.size, "failed", dtype="<U11")
    lock, done = threading.Lock(), [0]

    def run(i: int) -> None:
        cycles, measured = int(dwells.cycles[i]), int(dwells.measured[i])
        try:
            found = dwell(system, Sine(amplitude, float(f[i])), method, cycles, measured, state, observed, ledger)
        except DivergenceError as error:
            with lock:
                warnings.append(f"at {f[i]:g} Hz: {error}")
            return
        motion = steady_motion(found.cycles, np.array([measured]))
        for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
            columns[name][i] = getattr(motion, name)[0]
        statistics = impact_statistics(found.totals, found.measured, float(f[i]), "")
        for name in IMPACT_NAMES:
            columns[name][i] = getattr(statistics, name)
        columns["energy_residual"][i] = found.residual
        with lock:
            done[0] += 1
            if progress is not None:
                progress(done[0] / f.size)

    if workers == 1 or f.size == 1:
        for i in range(f.size):
            run(i)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(run, range(f.size)))
    if all(s == "failed" for s in columns["steadiness"]):
        raise DivergenceError(warnings[-1])
    return columns, warnings
