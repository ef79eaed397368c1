"""Columns of a curve from what its dwells give, and the curve of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError
from femimpact.excitation import Sine
from femimpact.excitation.remarks import frequency_warnings, motion_warnings
from femimpact.identification import peak_resolution, resolution_warnings
from femimpact.integrators.answers import SineDwellResults, SineDwells
from femimpact.integrators.methods import Method
from femimpact.response.energy import residual_warnings
from femimpact.response.impacts import statistics_of_cases
from femimpact.response.remarks import deflection_warnings
from femimpact.structure.damping import realised_damping_ratio
from femimpact.sweep.curve import IMPACT_NAMES, SWEEP_UNITS, FrequencyResponse
from femimpact.sweep.dwell_runs import DwellRun
from femimpact.system.modes import first_elastic_frequency, first_resonance
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["columns_of_dwells", "columns_of_runs", "curve_of", "start_of"]

Array = NDArray[np.float64]

TRANSIENT_LEFT = 0.03
"""Share of the first mode's transient that may be left where measuring begins without a warning."""


def columns_of_dwells(found: SineDwellResults, f: Array, ledger: bool) -> tuple[dict[str, NDArray[Any]], list[str]]:
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


def columns_of_runs(runs: Sequence[DwellRun], f: Array, ledger: bool) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """The same of dwells that are separate runs."""
    columns: dict[str, NDArray[Any]] = {name: np.full(f.size, np.nan) for name in SWEEP_UNITS}
    columns["steadiness"] = np.full(f.size, "failed", dtype="<U11")
    for i, run in enumerate(runs):
        if run.motion is None or run.statistics is None:
            continue
        for name in ("peak", "rms", "first_harmonic", "phase", "steadiness"):
            columns[name][i] = getattr(run.motion, name)[0]
        for name in IMPACT_NAMES:
            columns[name][i] = getattr(run.statistics, name)
        columns["energy_residual"][i] = run.residual
    failures = [run.failure for run in runs if run.failure]
    if len(failures) == len(runs):
        raise DivergenceError(failures[0])
    warnings = [*dict.fromkeys(text for run in runs for text in run.warnings), *failures]
    return columns, warnings


def curve_of(
    system: System, method: Method, dwells: SineDwells, found: tuple[dict[str, NDArray[Any]], list[str]],
    about: Mapping[str, Any],
) -> FrequencyResponse:  # fmt: skip
    """The curve of columns, with what there is to say of it."""
    columns, warnings = found
    f = dwells.frequency
    values: dict[str, Any] = {name: _read_only(column) for name, column in columns.items()}
    warnings = warnings + _steadiness_warnings(f, columns["steadiness"]) + _dwell_warnings(system, dwells)
    warnings += _grid_warnings(system, f)
    curve = FrequencyResponse(
        frequency=_read_only(f),
        **values,
        law=", ".join(dict.fromkeys(pair.law.name for pair in system.contacts)) or "none",
        **about,
    )
    largest = int(np.argmax(curve.base_amplitude))
    warnings += motion_warnings(Sine(float(curve.base_amplitude[largest]), float(f[largest])), system.length)
    warnings += frequency_warnings(f, system.highest_kept, system.first_left_out)
    if curve.unit == "m":
        warnings += deflection_warnings(columns["peak"], system.length)
    return replace(curve, warnings=tuple(warnings), notes=method.notes(system))


def start_of(state: State, system: System) -> str:
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
