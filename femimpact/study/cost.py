"""What a study takes, estimated before it runs: the grid of its sweep, memory and time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.identification import PeakResolution
from femimpact.integrators.cases import memory_needed, workers_of
from femimpact.integrators.methods import Method
from femimpact.response.response import Recorder
from femimpact.study.study import Study, SweepPlan
from femimpact.system.modes import DENSE_LIMIT, first_resonance, solve_modes
from femimpact.system.system import System

REACH = 8.0
"""Half-width of the refined part around the first mode over damping ratio times frequency: 4 half-power widths."""

LEAST_RATIO = 1e-4
"""Damping ratio that is taken for the reach where the structure has less."""

BESIDE_BALL = 1.5
"""Half-width of the refined part around the largest peak with ball, in steps of the even grid."""


def even_grid(plan: SweepPlan) -> NDArray[np.float64]:
    """Frequencies (Hz) of the even grid."""
    return np.linspace(plan.start, plan.stop, plan.points)


def refined_grid(
    plan: SweepPlan,
    bare: System,  # without balls
    peak_with_ball: float | None,  # Hz: on the even grid; None without a ball
) -> NDArray[np.float64]:
    """All frequencies (Hz) of a sweep, ascending.

    Returns (n,) Hz: the even grid, `plan.refine` points around the first natural frequency and as many around the peak
    with ball, and that natural frequency itself: the largest point of a linear curve is then its peak.
    """
    even = even_grid(plan)
    if not plan.refine:
        return even
    first, reach = _first_mode(bare)
    parts = [np.linspace(first - reach, first + reach, plan.refine), np.array([first])]
    if peak_with_ball is not None:
        around = BESIDE_BALL * float(even[1] - even[0])
        parts.append(np.linspace(peak_with_ball - around, peak_with_ball + around, plan.refine))
    inside = [part[(part > plan.start) & (part < plan.stop)] for part in parts]
    return np.asarray(np.unique(np.round(np.concatenate([even, *inside]), 9)))


def most_frequencies(plan: SweepPlan) -> int:
    """How many frequencies a sweep has at most."""
    return plan.points + (2 * plan.refine + 1 if plan.refine else 0)


def finer_grid_words(plan: SweepPlan, bare: System, found: PeakResolution) -> str:
    """The key of a study file with the value that makes its sweep resolve a resonance, as "sweep.refine = 33"."""
    first, reach = _first_mode(bare)
    if abs(found.frequency - first) <= reach:
        return f"sweep.refine = {math.ceil(2.0 * reach / found.step_needed) + 1}"
    return f"sweep.points = {math.ceil((plan.stop - plan.start) / found.step_needed) + 1}"


def resonances_in(plan: SweepPlan, system: System) -> tuple[float, ...]:
    """The lowest natural frequencies (Hz) of a system that lie within a sweep, at most ten."""
    natural = solve_modes(system, min(10, system.dofs)).natural_frequency
    return tuple(float(f) for f in natural if plan.start <= f <= plan.stop)


def _first_mode(bare: System) -> tuple[float, float]:
    """First natural frequency (Hz), and how far the refined part reaches to either side of it (Hz)."""
    first, ratio = first_resonance(bare)
    return first, REACH * max(ratio, LEAST_RATIO) * first


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


def mesh_memory(
    elements: int,
    modes: int | None,  # of the reduction; None where the physical dofs are integrated
) -> dict[str, float]:
    """Bytes at the peak of making the matrices of a mesh, and of solving for its modes."""
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

    Raises `InputError` naming what takes how much.
    """
    parts = mesh_memory(elements, study.reduction.modes if study.reduction else None)
    limit, needed = study.output.memory_limit, max(parts.values())
    shares = f"mesh of {elements} elements {parts['mesh'] / 1e6:.3g} MB, modes {parts['modes'] / 1e6:.3g} MB"
    allowed = f"must be >= {needed:.3g}, what this study takes ({shares}): take fewer elements or modes, or raise it"
    require(needed <= limit, "output.memory_limit", limit, "bytes", allowed)


def check_sweep(study: Study, small: System, method: Method) -> None:
    """Refuse a sweep that does not fit.

    Raises `InputError` naming what it takes.
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
