"""Stepped-sine sweeps: one base frequency a case, all side by side."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import DivergenceError, checked, quantity, require_type, truth
from femimpact.excitation import Sine
from femimpact.excitation.remarks import frequency_warnings, motion_warnings
from femimpact.identification import peak_resolution, resolution_warnings
from femimpact.integrators.answers import SineDwellResults, SineDwells
from femimpact.integrators.methods import Method, require_method
from femimpact.integrators.threads import workers_of
from femimpact.progress import Progress, check_progress, draws_progress
from femimpact.response.energy import residual_warnings
from femimpact.response.impacts import statistics_of_cases
from femimpact.response.remarks import deflection_warnings
from femimpact.structure.damping import realised_damping_ratio
from femimpact.structure.structure import Position
from femimpact.sweep.curve import IMPACT_NAMES, SWEEP_UNITS, FrequencyResponse
from femimpact.sweep.dwells import dwells_of
from femimpact.system.modes import first_elastic_frequency, first_resonance
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["frequency_sweep"]

Array = NDArray[np.float64]

TRANSIENT_LEFT = 0.03
"""Share of the first mode's transient that may be left where measuring begins without a warning."""


@draws_progress
def frequency_sweep(
    system: System,
    amplitude: float,
    frequencies: ArrayLike,
    method: Method,
    cycles: int | None = None,
    *,
    duration: float | None = None,
    window: float | None = None,
    initial: State | None = None,
    at: Position = "tip",
    ledger: bool = True,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> FrequencyResponse:
    """Stepped-sine sweep: each frequency a run of its own from the initial state.

    Parameters
    ----------
    system : System
        Reduced systems are fastest.
    amplitude : float, m
        Of the base displacement, the same at all frequencies.
    frequencies : array_like (n,), Hz
    method : Newmark, HHT, WBZ, GeneralizedAlpha, MoreauJean or EventDriven
    cycles : int
        Whole dwell in base cycles; the last third is measured. Or
    duration : float, s
        the whole dwell in time, of which
    window : float, s
        is measured at its end: the whole base cycles in it. The last third by default.
    initial : State, optional
        At rest in the frame of the base by default. Every run begins at t = 0 s, whatever the state's time.
    at : str or float
        The observed place.
    ledger : bool
        Keep the energy residual of every case; costs about half as much again, event-driven up to as much again.
    threads : int, optional
        The number of cores by default; the results do not depend on it, to the last bit.
    progress : callable or bool, optional
        Called with the share done, 0 to 1; True draws a bar.

    Returns
    -------
    FrequencyResponse
        A frequency that diverged is a row of not-a-numbers, "failed", with a warning. Without contacts there is a
        warning too where the frequencies are too far apart for the peak of the first mode.

    Raises
    ------
    InputError
        If an argument is out of range or the step does not resolve the contact.
    DivergenceError
        If every frequency diverged.
    """
    state = State() if initial is None else initial
    require_type(system, System, "system")
    require_type(state, State, "initial")
    require_method(method)
    report = check_progress(progress)
    state = replace(state, time=0.0)
    amplitude = checked("amplitude", amplitude, quantity("m", at_least=0.0))
    ledger = checked("ledger", ledger, truth())
    dwells = dwells_of(amplitude, frequencies, cycles, duration, window)
    workers, observed = workers_of(threads), system.point_row(at)
    found = method.run_dwells(system, dwells, state, observed, ledger, workers, report)
    columns, warnings = _columns(found, dwells.frequency, ledger)
    warnings += _steadiness_warnings(dwells.frequency, columns["steadiness"]) + _dwell_warnings(system, dwells)
    warnings += _grid_warnings(system, dwells.frequency)
    warnings += motion_warnings(Sine(amplitude, float(dwells.frequency[0])), system.length)
    warnings += frequency_warnings(dwells.frequency, system.highest_kept, system.first_left_out)
    warnings += deflection_warnings(columns["peak"], system.length)
    return FrequencyResponse(
        frequency=_read_only(dwells.frequency),
        **{name: _read_only(column) for name, column in columns.items()},
        amplitude=amplitude,
        cycles=None if cycles is None else int(cycles),
        at=at,
        start=_start(state, system),
        law=", ".join(dict.fromkeys(pair.law.name for pair in system.contacts)) or "none",
        warnings=tuple(warnings),
        notes=method.notes(system),
        duration=duration,
        window=window,
    )


def _columns(found: SineDwellResults, f: Array, ledger: bool) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Columns of all cases that have come to their end, and warnings of those that have not.

    Raises
    ------
    DivergenceError
        If none has.
    """
    columns: dict[str, NDArray[Any]] = {name: np.full(f.size, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(f.size, "failed", dtype="<U11")
    statistics = statistics_of_cases(found.totals, found.duration, f)
    fine = np.array([not failure for failure in found.failures])
    for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
        columns[name][fine] = getattr(found.motion, name)[fine]
    for name in IMPACT_NAMES:
        columns[name][fine] = statistics[name][fine]
    columns["energy_residual"][fine] = found.residual[fine]
    failures = [failure for failure in found.failures if failure]
    if not fine.any():
        raise DivergenceError(failures[0])
    warnings = [*found.warnings, *failures]
    if ledger:
        # those that failed have said so
        warnings += residual_warnings(f, np.where(fine, found.residual, 0.0), found.bound)
    return columns, warnings


def _start(state: State, system: System) -> str:
    """In one word where all runs start."""
    if not state.is_at_rest:
        return "given"
    return "static" if state.is_static_on(system) else state.frame


def _steadiness_warnings(f: Array, steadiness: NDArray[np.str_]) -> list[str]:
    moving = f[steadiness == "transient"]
    if moving.size == 0:
        return []
    return [
        f"not steady at {moving.size} of {f.size} frequencies ({moving.min():.4g} to {moving.max():.4g} Hz): "
        "the two halves of the measured time differ; take a longer dwell"
    ]


def _dwell_warnings(system: System, dwells: SineDwells) -> list[str]:
    """What is left of the structure's own transient where measuring begins, when that is much."""
    if system.rayleigh is None:
        return []
    first = first_elastic_frequency(system)
    if first == 0.0:
        return []
    omega = 2.0 * math.pi * first
    ratio = float(realised_damping_ratio(*system.rayleigh, omega))
    begin = float(((dwells.cycles - dwells.measured) / dwells.frequency).min())
    left = math.exp(-ratio * omega * begin)
    if left <= TRANSIENT_LEFT:
        return []
    return [
        f"dwell of {begin:.3g} s before measuring begins: {100 * left:.2g} % of the first mode's transient "
        f"(damping ratio {ratio:.3g}) is left there: peaks and damping near {first:.4g} Hz need a "
        "longer dwell"
    ]


def _grid_warnings(system: System, f: Array) -> list[str]:
    """Where the grid is too coarse for the first resonance of a structure without contacts, whose width is known."""
    if system.contacts or np.unique(f).size < 2:
        return []
    near, ratio = first_resonance(system)
    width = 2.0 * ratio * near
    if not f.min() < near < f.max() or width == 0.0:
        return []
    return list(resolution_warnings(peak_resolution(np.unique(f), near, width)))


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array
