"""Curves of systems that differ in their contact laws alone, side by side, as far as their largest peaks need them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import DivergenceError
from femimpact.integrators.answers import SineCases, SineDwellResults, SineDwells
from femimpact.integrators.many_cases import run_cases
from femimpact.integrators.methods import Method
from femimpact.integrators.threads import workers_of
from femimpact.progress import Progress
from femimpact.sweep.columns import columns_of_dwells, curve_of, start_of
from femimpact.sweep.curve import SWEEP_UNITS, FrequencyResponse
from femimpact.sweep.dwells import cases_of, dwells_of
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["peak_curves"]

Array = NDArray[np.float64]

SKIRT = 0.6
"""Of the largest peak: where neither neighbour reaches it no larger one is looked for. A resonance has skirts."""


@dataclass(frozen=True, eq=False)
class _Swept:
    """What is known of some systems (k) at all frequencies (n)."""

    columns: dict[str, NDArray[Any]]
    known: NDArray[np.bool_]
    warnings: list[str] = field(default_factory=list)
    failures: dict[int, list[str]] = field(default_factory=dict)


def peak_curves(
    systems: Sequence[System], method: Method, frequencies: ArrayLike, cycles: int, *, amplitude: float | None,
    acceleration: float | None, initial: State, step: int = 1, progress: Progress | None = None,
) -> tuple[FrequencyResponse, ...]:  # fmt: skip
    """One curve for each system, at those of the frequencies where its largest peak may be.

    Every `step`-th frequency is swept first. Then, with half the step at a time, those beside the points that reach
    the share `SKIRT` of the largest peak so far. The values are those of `frequency_sweep`; event-driven ones have the
    same bits.

    Parameters
    ----------
    systems : sequence of System
        Alike but for numbers of their contact laws.
    method : Method
    frequencies : array_like (n,), Hz
        Rising.
    cycles : int
        Dwell at each frequency.
    amplitude, acceleration : float or None, m or m/s^2
        Of the base, one of them.
    initial : State
    step : int
        A power of two; with 1 all frequencies are swept.
    progress : callable, optional

    Returns
    -------
    tuple of FrequencyResponse

    Raises
    ------
    InputError
        If an argument is out of range.
    DivergenceError
        If a system diverged at every frequency.
    """
    state, first = replace(initial, time=0.0), systems[0]
    dwells = dwells_of(0.0 if amplitude is None else amplitude, frequencies, cycles, None, None)
    cases, row = cases_of(first, dwells, state, acceleration), first.point_row("tip")
    swept = _nothing(len(systems), dwells.frequency.size)
    wanted = np.zeros_like(swept.known)
    wanted[:, ::step] = True
    while np.any(wanted):
        number, place = np.nonzero(wanted)
        own = _of_systems(cases.of(place), systems, number)
        found = run_cases(first, own, method, row, 0, workers_of(None), progress)
        _add(swept, number, place, found, dwells.frequency[place])
        step //= 2
        wanted = _beside_peaks(swept, step) if step else np.zeros_like(wanted)
    about = {"amplitude": amplitude, "acceleration": acceleration, "cycles": cycles, "at": "tip"}
    about |= {"start": start_of(state, first)}
    return tuple(_curve(system, method, dwells, swept, k, about) for k, system in enumerate(systems))


def _nothing(systems: int, frequencies: int) -> _Swept:
    shape = (systems, frequencies)
    columns: dict[str, NDArray[Any]] = {name: np.full(shape, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(shape, "failed", dtype="<U11")
    return _Swept(columns, np.zeros(shape, dtype=bool))


def _of_systems(cases: SineCases, systems: Sequence[System], number: NDArray[np.intp]) -> SineCases:
    """The same cases, each with the laws of its system."""
    laws = tuple(tuple(pair.law for pair in system.contacts) for system in systems)
    return replace(cases, laws=laws, law_of=number)


def _add(swept: _Swept, number: NDArray[np.intp], place: NDArray[np.intp], found: SineDwellResults, f: Array) -> None:
    """Enter the results of cases by the numbers of their systems and frequencies; the latter are `f` (Hz)."""
    swept.known[number, place] = True
    swept.warnings.extend(found.warnings)
    for k, failure in zip(number.tolist(), found.failures, strict=True):
        if failure:
            swept.failures.setdefault(k, []).append(failure)
    if all(found.failures):
        return
    columns, _ = columns_of_dwells(found, f, ledger=False)
    for name, values in columns.items():
        swept.columns[name][number, place] = values


def _beside_peaks(swept: _Swept, step: int) -> NDArray[np.bool_]:
    """Frequencies not swept yet beside the points that reach the share `SKIRT` of their system's largest."""
    peak = np.where(swept.known, np.nan_to_num(swept.columns["peak"]), -np.inf)
    high = peak >= SKIRT * peak.max(axis=1, keepdims=True)
    beside = np.zeros_like(high)
    beside[:, step:] |= high[:, :-step]
    beside[:, :-step] |= high[:, step:]
    return np.asarray(beside & ~swept.known)


def _curve(
    system: System, method: Method, dwells: SineDwells, swept: _Swept, k: int, about: dict[str, Any]
) -> FrequencyResponse:
    known, failures = swept.known[k], swept.failures.get(k, [])
    if len(failures) == np.count_nonzero(known):
        raise DivergenceError(failures[0])
    own = {name: getattr(dwells, name)[known] for name in ("frequency", "cycles", "measured")}
    columns = {name: values[k, known] for name, values in swept.columns.items()}
    warnings = [*dict.fromkeys(swept.warnings), *failures]
    return curve_of(system, method, replace(dwells, **own), (columns, warnings), about)
