"""What a study takes, estimated before it runs: memory of mesh, modes, history and sweep, and time.

The factors were measured on one machine; memory is met within a factor of 2, time on an idle one within 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from femimpact.errors import require
from femimpact.integrators.memory import memory_needed
from femimpact.integrators.methods import Method
from femimpact.integrators.threads import workers_of
from femimpact.response.response import Recorder
from femimpact.study.study import Study
from femimpact.study.sweep_grid import most_frequencies
from femimpact.system.modes import DENSE_LIMIT
from femimpact.system.system import System

__all__ = [
    "START", "Cost", "check_mesh", "check_sweep", "history_cost", "mesh_memory", "picture_seconds", "sweep_cost",
]  # fmt: skip

ELEMENT = 4200.0
"""Bytes of an element while the matrices are made."""

ELEMENT_KEPT = 2000.0
"""Bytes of an element afterwards."""

DENSE_MATRICES = 8
"""Full matrices of the dofs in a dense solution."""

COPIES = 2.3
"""Histories in memory while one is labelled and written."""

POINT = 1200.0
"""Bytes of a frequency of a sweep in its tables."""

LEAST = 1e6
"""Bytes of any part."""

START = 1.5
"""What a command takes besides, s: starting, systems, summary, reading back."""

WRITING = 8e-9
"""Labelling and writing of a byte that is kept, s."""


FIGURES, MOVIE, FRAME = 4.0, 2.0, 0.07
"""Drawing all figures, beginning a movie, and each frame of it, rendered without a graphics card, s."""


@dataclass(frozen=True)
class Cost:
    """Peak of the memory (bytes) that a part of a run takes beyond the libraries', and its time (s) on one core."""

    memory: float
    seconds: float


def picture_seconds(study: Study) -> float:
    """Time (s) that figures and movie of a whole run take, which are drawn when all else is done."""
    output = study.output
    filmed = MOVIE + FRAME * output.frames if output.movie and output.frames > 0 else 0.0
    return (FIGURES if output.figures else 0.0) + filmed


def mesh_memory(elements: int, modes: int | None) -> dict[str, float]:
    """Bytes at the peak of making the matrices of a mesh, and of solving for its modes.

    Parameters
    ----------
    elements : int
    modes : int or None
        Of the reduction; None where the physical dofs are integrated.
    """
    dofs, count = 2 * elements, max(modes or 0, 4)
    kept = ELEMENT_KEPT * elements
    if dofs <= DENSE_LIMIT or count > dofs // 4:
        solved = kept + 8.0 * DENSE_MATRICES * dofs**2
    else:
        # Lanczos vectors, and copies of those that are kept
        solved = kept + 8.0 * dofs * (max(2 * count + 1, 20) + 2 * count)
    return {"mesh": ELEMENT * elements, "modes": solved}


def check_mesh(study: Study, elements: int) -> None:
    """Refuse a mesh or a number of modes that does not fit, before anything is assembled.

    Raises
    ------
    InputError
        Naming what takes how much.
    """
    parts = mesh_memory(elements, study.reduction.modes if study.reduction else None)
    limit, needed = study.output.memory_limit, max(parts.values())
    shares = f"mesh of {elements} elements {parts['mesh'] / 1e6:.3g} MB, modes {parts['modes'] / 1e6:.3g} MB"
    allowed = f"must be >= {needed:.3g}, what this study takes ({shares}): take fewer elements or modes, or raise it"
    require(needed <= limit, "output.memory_limit", limit, "bytes", allowed)


def check_sweep(study: Study, small: System, method: Method) -> None:
    """Refuse a sweep that does not fit.

    Raises
    ------
    InputError
        Naming what it takes.
    """
    limit, needed = study.output.memory_limit, sweep_cost(study, small, method).memory
    allowed = f"must be >= {needed:.3g}, what the sweep takes: take fewer points or cycles, or raise it"
    require(needed <= limit, "output.memory_limit", limit, "bytes", allowed)


def history_cost(study: Study, small: System, method: Method, record: Recorder) -> Cost:
    """Of one history, until it is written."""
    grid = method.interval(small, study.excitation, study.base.history_duration, record)
    steps = round(study.base.history_duration / grid)
    parts: Mapping[str, int] = memory_needed(
        small, record, len(record.channels or ()), steps, grid, study.base.frequency
    )
    kept = parts["channels"] + parts["energies"]
    rest = sum(parts.values()) - kept
    cycles = study.base.history_duration * study.base.frequency
    seconds = method.cost(small, study.base.frequency).history_seconds * cycles
    return Cost(LEAST + COPIES * kept + rest, START + seconds + WRITING * kept)


def sweep_cost(study: Study, small: System, method: Method) -> Cost:
    """Of a sweep without and with balls, until it is written."""
    plan = study.sweep
    if plan is None:
        return Cost(0.0, 0.0)
    cases = most_frequencies(plan)
    cost = method.cost(small, 0.5 * (plan.start + plan.stop))
    at_once = min(cases, cost.cases_at_once * workers_of(None))
    memory = cost.sweep_memory * at_once * plan.cycles + POINT * cases
    return Cost(LEAST + memory, START + cost.sweep_seconds * cases * plan.cycles)
