"""Convergence of a study over mesh, step and modes: its tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np

from femimpact.app.report.pictures import Report
from femimpact.app.study.findings import Findings, joined
from femimpact.app.study.prepared import ELEMENT_KEPT, LIBRARIES, START, Cost, mesh_memory
from femimpact.app.study.study import Study, build_systems, check_method, method_for, read_mesh_of, sine_of
from femimpact.app.study.summary import findings_of_study
from femimpact.app.tasks.task import Finished, Plan, Task
from femimpact.convergence.cases import Axis, Case, OverMeshes, OverModes, OverSteps
from femimpact.convergence.quantities import (
    Frequencies,
    ModeShapes,
    SteadyResponse,
    SupportReaction,
    SurfaceStress,
    Watched,
)
from femimpact.convergence.runs import HALVINGS, MOST_IMPACTS, PHASES, ContactStatistics, converge_step
from femimpact.convergence.study import convergence_study
from femimpact.convergence.table import ConvergenceTable
from femimpact.errors import FemimpactError, InputError
from femimpact.fem.mesh import SAME_PLACE, Mesh, uniform_mesh
from femimpact.integrators.cases import memory_needed
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method, seconds_of_cycle
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.response.response import Recorder
from femimpact.structure.structure import Position
from femimpact.system.hermite import needs_outer_fibre
from femimpact.system.system import System
from femimpact.units import counted

MESHES = (1, 2, 4, 8, 16, 32, 64, 128, 256)
"""Elements of uniform meshes."""

MOST_REFINED = 2048
"""Elements of the finest refinement of a mesh file."""

STATISTICS_MESHES = 4
"""Coarse meshes of which statistics of runs with contacts are taken."""

MOST_JUMPS = 3
"""Jumps of the section whose stress is watched: those with the largest."""

MODES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
COARSEST_STEPS = 40
"""Steps in a base cycle of the coarsest step."""

SECONDS_OF_AXIS = 0.3
"""Quantities over an axis, s."""

CYCLES_OVER_STEPS = 3
"""Base cycles of a run without contacts over the step; most runs to shortly after the first impact are as short."""


def task_of_convergence(
    study: Study,
    accuracy: float = 1e-3,  # relative error that the recommended numbers are for
) -> Task:
    """The convergence studies of a study: tables and figures.

    Raises `InputError` if the mesh or the method does not fit the study, or its base does not move by a sine.
    """
    free = "fi.convergence_study(structure, meshes, fi.convergence.Frequencies(4)) of a script needs none"
    sine_of(study, "converge", instead=f"; take a copy of the study with such a [base] and no force, or {free}")
    mesh = read_mesh_of(study)
    full, small = build_systems(study, mesh)
    method = method_for(study, small)
    check_method(study, small, method)
    notes, parts = list(_without_stress(study)), ["quantities"]
    if study.structure.impactors or study.structure.stops:
        parts.append("statistics")
    if isinstance(method, Newmark):
        parts.append("steps")
    else:
        notes.append("over the step: Newmark's method only; the study's is another")
    findings = replace(findings_of_study(study, full, method), notes=tuple(notes), accuracy=accuracy)
    axes = _axes(study, mesh, full, method)
    work = partial(_parts_of_convergence, study, axes, full, small, method, accuracy)
    return Task(study, findings, tuple(parts), work, partial(plan_of_convergence, study, axes, small, method))


def _axes(study: Study, mesh_of_file: Mesh | None, full: System, method: Method) -> tuple[OverMeshes, list[Axis]]:
    """The meshes, and the steps, where there are some, and the numbers of modes."""
    mesh = mesh_of_file if mesh_of_file is not None else uniform_mesh(study.structure, cast(int, study.mesh.elements))
    steps: list[Axis] = [_steps(study, mesh, method)] if isinstance(method, Newmark) else []
    return _meshes(study, mesh_of_file), [*steps, OverModes(mesh, _counts(full.dofs))]


def plan_of_convergence(study: Study, axes: tuple[OverMeshes, list[Axis]], small: System, method: Method) -> Plan:
    """Cases and runs of each part, their time, and the memory of the meshes and of a run."""
    elements = [mesh.elements for mesh in axes[0].meshes if isinstance(mesh, Mesh)]
    counts = [f"{len(elements)} meshes of {elements[0]} to {elements[-1]} elements"]
    for axis in axes[1]:
        steps, modes = getattr(axis, "halvings", None), getattr(axis, "counts", ())
        counts.append(f"{len(modes)} numbers of modes" if steps is None else f"{steps + 1} steps")
    costs = [f"quantities of the motion without contacts over {', '.join(counts)}"]
    # the finest mesh is refined once more, and all are kept
    finest = 2 * elements[-1]
    memory = max(mesh_memory(finest, 4).values()) + ELEMENT_KEPT * (sum(elements) + finest)
    seconds, frequency = START + SECONDS_OF_AXIS * (1 + len(axes[1])), study.excitation.frequency
    contacts = bool(study.structure.impactors or study.structure.stops)
    if contacts:
        runs, most = ContactStatistics(), min(STATISTICS_MESHES, len(elements))
        costs.append(
            f"statistics of runs with contacts over {most} meshes, each from {runs.starts} phases of the base, "
            f"{runs.cycles} cycles, event-driven"
        )
        seconds += most * runs.starts * runs.cycles * seconds_of_cycle(EventDriven(), small, frequency)
        memory += memory_needed(small, Recorder(impacts=MOST_IMPACTS), 0, 0, 1.0, 1.0)["impacts"]
    if isinstance(method, Newmark):
        costs.append(f"runs over {HALVINGS + 1} steps of {method.dt:.4g} s and shorter")
        cycles = CYCLES_OVER_STEPS * (1 + PHASES * contacts) * (2 ** (HALVINGS + 1) + 2 ** (HALVINGS + 2))
        seconds += cycles * seconds_of_cycle(method, small, frequency)
    cost = f"convergence takes about {Cost(memory, seconds)}"
    return Plan((*(f"convergence: {text}" for text in costs), cost, LIBRARIES))


def _parts_of_convergence(
    study: Study, axes: tuple[OverMeshes, list[Axis]], full: System, small: System, method: Method, accuracy: float,
    report: Report,
) -> Iterator[Finished]:  # fmt: skip
    """Quantities over the axes, runs with contacts over the mesh, and runs in steps to after the first impact."""
    meshes, others = axes
    quantities = convergence_study(
        study.structure, [meshes, *others], _watched(full, study), study.sine, accuracy=accuracy,
        progress=lambda share: report("quantities", share),
    ).tables  # fmt: skip
    tables = {f"quantities_over_{axis}": table for axis, table in quantities.items()}
    yield _tables("quantities", tables, {"convergence_summary": _summary(list(quantities.values()))})
    if study.structure.impactors or study.structure.stops:
        yield _statistics(study, meshes, _moving(full)[0], accuracy, report)
    if isinstance(method, Newmark):
        report("steps", 0.0)
        runs = converge_step(small, study.sine, method, accuracy=accuracy)
        report("steps", 1.0)
        yield _tables("steps", {"runs_over_step": runs})


def _tables(part: str, tables: Mapping[str, ConvergenceTable], files: Mapping[str, Any] | None = None) -> Finished:
    """Tables by the keys of their files, beside other files."""
    notes = tuple(dict.fromkeys(note for table in tables.values() for note in table.notes))
    problems = tuple(dict.fromkeys(table.problem for table in tables.values()))
    columns = {key: table.columns() for key, table in tables.items()}
    return Finished(part, columns | dict(files or {}), Findings(notes=notes, problems=problems))


# ---- what is studied ------------------------------------------------------------------------------


def _meshes(study: Study, mesh: Mesh | None) -> OverMeshes:
    """Uniform meshes of the study's structure, or the mesh of its file and its refinements."""
    if mesh is None:
        made: list[Mesh] = []
        for count in MESHES:
            try:
                made.append(uniform_mesh(study.structure, count))
            except InputError:
                # fewer elements than stretches between joints and attachments
                if count == MESHES[-1]:
                    raise
        return OverMeshes(tuple(made), make=partial(uniform_mesh, study.structure))
    times = max(int(math.log2(MOST_REFINED / mesh.elements)) if mesh.elements < MOST_REFINED else 0, 1)
    return OverMeshes.refinements(mesh, min(times, 4))


def _steps(study: Study, mesh: Mesh, method: Newmark) -> OverSteps:
    """Time steps to compare: a fortieth of the base's period, halved three to ten times, down to the study's step."""
    coarse = 1.0 / (COARSEST_STEPS * study.excitation.frequency)
    halvings = math.ceil(math.log2(coarse / method.dt)) if coarse > method.dt else 0
    return OverSteps(mesh, replace(method, dt=coarse, allow_coarse_step=True), min(max(halvings, 3), 10))


def _counts(dofs: int) -> tuple[int, ...]:
    """Numbers of modes up to half the dofs, the upper half of which is of the mesh rather than of the beam."""
    counts = [n for n in MODES if n <= dofs // 2]
    return tuple(counts) if len(counts) >= 3 else tuple(range(1, max(dofs, 3) + 1))[:3]


def _moving(system: System) -> tuple[str, ...]:
    """The tip and the middle, where no support holds them."""
    return tuple(place for place in dict.fromkeys((system.default_place, "mid")) if np.any(system.point_row(place)))


def _watched(system: System, study: Study) -> list[Watched]:
    """Quantities of any study; the stress is that at a clamped root, else at mid, and at jumps of the section."""
    # a moment before a force; none where springs alone hold the beam
    reactions = sorted(system.reactions, key=lambda name: not name.endswith(".moment"))[:1]
    clamped = {"root.force", "root.moment"} <= set(system.reactions)
    places = _moving(system)
    stresses = [SurfaceStress("root" if clamped else "mid"), *stresses_at_jumps(system, study)]
    known = [stress for stress in stresses if system.section_at(stress.at, stress.side).half_height is not None]
    return [Frequencies(4), ModeShapes(3), SteadyResponse(places), *map(SupportReaction, reactions), *known]


def _without_stress(study: Study) -> Iterator[str]:
    """A note on each segment whose stresses are left out."""
    for segment in study.structure.beam.segments:
        if segment.half_height is None:
            yield f"surface stresses of segment {segment.name!r} are left out: each {needs_outer_fibre(segment.name)}"


def stresses_at_jumps(system: System, study: Study) -> list[SurfaceStress]:
    """Stresses on the more stressed side of the jumps of the section where the steady response has the largest.

    Where the surface of a segment is not known its stress counts as none.
    """
    steady, names, found = Case("mesh", system, system, study.sine).steady, system.points.items(), []
    for joint in study.structure.beam.joints[1:-1]:
        # the node itself: a mesh file of single precision has it beside the joint
        node = float(system.nodes[np.argmin(np.abs(system.nodes - joint))])
        sections = [system.section_at(node, side) for side in ("left", "right")]
        properties = [(one.bending_stiffness, one.half_height or 0.0, one.young_modulus) for one in sections]
        if np.allclose(properties[0], properties[1], rtol=1e-9, atol=0.0):
            continue
        at: Position = next((name for name, x in names if abs(x - node) <= SAME_PLACE * system.nodes[-1]), node)
        for side, section in zip(("left", "right"), sections, strict=True):
            curvature = abs(complex(system.curvature_rows([node], side)[0] @ steady))
            stress = section.young_modulus * (section.half_height or 0.0) * curvature
            found.append((stress, at, SurfaceStress(at, side=side)))
    found.sort(key=lambda one: one[0], reverse=True)
    # the first of a place is its more stressed side
    largest = {at: watched for _, at, watched in reversed(found)}
    return [watched for _, at, watched in found if largest[at] is watched][:MOST_JUMPS]


def _statistics(study: Study, meshes: OverMeshes, at: str, accuracy: float, report: Report) -> Finished:
    """Statistics of runs with contacts over the coarser meshes, or why there are none."""
    few = OverMeshes(tuple(meshes.meshes[:STATISTICS_MESHES]))
    modes, watched = study.reduction.modes if study.reduction else 8, ContactStatistics(at=at)
    try:
        tables = convergence_study(
            study.structure, few, watched, study.sine, modes=modes, accuracy=accuracy,
            progress=lambda share: report("statistics", share),
        )  # fmt: skip
    except FemimpactError as error:
        text = f"statistics of runs with contacts: none, for {' '.join(str(error).split())}"
        return Finished("statistics", findings=Findings(notes=(text,)))
    finished = _tables("statistics", {"statistics_over_mesh": tables["mesh"]})
    words = (
        f"statistics: means over {watched.starts} phases of the base, {watched.cycles} cycles each, event-driven on "
        f"{counted(modes, 'mode')}{' or fewer' * (modes > 1)}"
    )
    return replace(finished, findings=joined(finished.findings, Findings(notes=(words,))))


def _summary(tables: Sequence[ConvergenceTable]) -> tuple[dict[str, Any], dict[str, str]]:
    """The summaries of all axes below one another."""
    parts = [table.summary() for table in tables]
    columns: dict[str, Any] = {"axis": np.concatenate([[table.axis] * table.name.size for table in tables])}
    for name in parts[0][0]:
        columns[name] = np.concatenate([part[name] for part, _ in parts])
    return columns, parts[0][1]
