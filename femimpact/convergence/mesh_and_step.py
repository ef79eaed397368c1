"""Two short ways to tables of convergence: frequencies over uniform meshes, and runs in steps over the step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from femimpact.arrays import Array
from femimpact.convergence.cases import OverMeshes
from femimpact.convergence.quantities import Frequencies
from femimpact.convergence.study import convergence_study
from femimpact.convergence.table import (
    LINEAR,
    ConvergenceTable,
    agrees,
    fitted_order,
    local_orders,
    new_column,
    number_for,
    number_of_case,
    table_of,
)
from femimpact.errors import checked, quantity, require_type
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.response.response import Recorder
from femimpact.structure.structure import Structure
from femimpact.system.modes import first_elastic_frequency
from femimpact.system.system import System, without_impactors

PHASES = 8
"""Base phases over which the error after the first impact is averaged."""


def converge_elements(structure: Structure, elements: Sequence[int], modes: int = 4) -> ConvergenceTable:
    """Natural frequencies of a structure over uniform meshes, without its balls; see `Frequencies`.

    Parameters
    ----------
    structure : Structure
    elements : sequence of int
        Increasing numbers of elements.
    modes : int
        How many frequencies; fewer where the finest mesh has fewer dofs.

    Returns
    -------
    ConvergenceTable
        That of `convergence_study` over `OverMeshes.uniform`.

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range.
    """
    require_type(structure, Structure, "structure")
    modes = checked("modes", modes, quantity("1", at_least=1, at_most=1000, integer=True))
    bare = replace(structure, impactors=())
    return convergence_study(bare, OverMeshes.uniform(bare, elements), Frequencies(modes))["mesh"]


def converge_step(
    system: System, excitation: Sine, method: Newmark, halvings: int = 5, *, accuracy: float = 1e-3
) -> ConvergenceTable:
    """Error of runs in Newmark's steps over the step, against a run with a step four times finer than the finest.

    Without balls it is that of the tip over a few base cycles, relative to the largest tip displacement. With contacts
    it is that of the tip and the balls shortly after the first impact, relative to their largest displacements: the
    root mean square over 8 phases of the base, since where in a step the touch falls is chance. So is the energy
    residual of these short runs; later chaos makes histories incomparable.

    Parameters
    ----------
    system : System
    excitation : Sine
    method : Newmark
        Its dt is the coarsest step.
    halvings : int
        How often it is halved.
    accuracy : float, 1
        Relative error that the recommended numbers are for.

    Returns
    -------
    ConvergenceTable
        Its values are errors. The average-acceleration method has order 2 without contacts (Hughes, 1987).

    Raises
    ------
    InputError
        If an argument is of the wrong kind or out of range.
    """
    arguments: tuple[tuple[str, Any, Any], ...] = (
        ("system", system, System), ("excitation", excitation, Sine), ("method", method, Newmark)
    )  # fmt: skip
    for key, value, kind in arguments:
        require_type(value, kind, key)
    halvings = checked("halvings", halvings, quantity("1", at_least=1, at_most=20, integer=True))
    accuracy = checked("accuracy", accuracy, quantity("1", above=0.0, below=1.0))
    dt = method.dt / 2.0 ** np.arange(halvings + 1, dtype=float)
    finest = replace(method, dt=float(dt[-1] / 4.0))
    # a multiple of the coarsest step, so that all runs end at the same instant
    cycles = method.dt * round(3.0 / (excitation.frequency * method.dt))
    errors = {LINEAR: _errors(without_impactors(system), excitation, method, dt, finest, cycles)[0]}
    notes = ["without balls: the tip over 3 base cycles from rest"]
    if system.contacts:
        squares = []
        for phase in 2.0 * math.pi * np.arange(PHASES) / PHASES:
            base = replace(excitation, phase=float(phase))
            duration = _past_first_impact(system, base, method)
            if duration is not None:
                squares.append(np.square(_errors(system, base, method, dt, finest, duration)))
        if squares:
            impact, residual = np.sqrt(np.mean(squares, axis=0))
            errors |= {"motion after an impact": impact, "energy residual": residual}
            notes.append(f"with balls: to shortly after the first impact, over {len(squares)} phases of the base")
        else:
            notes.append("with balls: no impact within 40 base cycles, nothing to compare")
    first, columns = first_elastic_frequency(system), list[dict[str, Any]]()
    number = 1.0 / (dt * first) if first > 0.0 else np.full(dt.size, np.nan)
    for name, error in errors.items():
        order = (2.0 if method.gamma == 0.5 else 1.0) if name == LINEAR else math.nan
        fitted = fitted_order(dt, error, 0.0)
        enough = (
            number_for(number, error, fitted, accuracy, 0.0) if agrees(fitted, order)
            else number_of_case(number, error, 0.0, accuracy)
        )  # fmt: skip
        columns.append(new_column(name, "1", error, expected_order=order) | {
            "error": error, "order": local_orders(dt, error, 0.0), "fitted_order": fitted, "recommended": enough
        })  # fmt: skip
    return table_of(
        "step", [f"{step:.4g} s" for step in dt], number, dt, columns, accuracy=accuracy, notes=tuple(notes),
        problem="Runs in Newmark's steps, compared with a step four times finer than the finest",
    )  # fmt: skip


def _past_first_impact(system: System, base: Sine, method: Newmark) -> float | None:
    """A whole number of coarse steps to a little after the first impact; None without one in 40 cycles."""
    probe = integrate(system, base, method, 40.0 / base.frequency, Recorder(channels=("tip",), every=50, ledger=False))
    if len(probe.impacts) == 0:
        return None
    contact_time = max(pair.parameters.contact_time for pair in system.contacts if pair.has_walls)
    return float(method.dt * round((probe.impacts.time[0] + 4.0 * contact_time) / method.dt))


def _errors(
    system: System, excitation: Sine, method: Newmark, dt: Array, finest: Newmark, duration: float
) -> tuple[Array, Array]:
    """Largest difference from the finest run at the coarse steps, and the energy residual, for each dt."""
    names = ("tip", *(pair.name for pair in system.contacts))

    def histories(step: float) -> tuple[Array, float]:
        every = round(method.dt / step)
        record = Recorder(channels=names, every=every)
        response = integrate(system, excitation, replace(method, dt=step), duration, record)
        residual = response.energy.residual if response.energy is not None else math.nan
        return np.array([response[name] for name in names]), residual

    exact, _ = histories(finest.dt)
    scale = np.abs(exact).max(axis=1, keepdims=True)
    runs = [histories(float(step)) for step in dt]
    errors = [float(np.max(np.abs(values - exact) / scale)) for values, _ in runs]
    return np.array(errors), np.array([residual for _, residual in runs])
