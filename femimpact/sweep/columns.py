"""Columns of a curve from what its dwells give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import DivergenceError
from femimpact.integrators.answers import SineDwellResults
from femimpact.response.energy import residual_warnings
from femimpact.response.impacts import statistics_of_cases
from femimpact.sweep.curve import IMPACT_NAMES, SWEEP_UNITS
from femimpact.sweep.dwell_runs import DwellRun

__all__ = ["columns_of_dwells", "columns_of_runs"]

Array = NDArray[np.float64]


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
