"""Convergence of a study over mesh, step and modes: its tables, figures and printed lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from femimpact import core
from femimpact.app.report.markup import Element
from femimpact.app.report.result_page import add_report
from femimpact.app.report.views import save_pictures
from femimpact.app.results.result_directory import FILES, new_results
from femimpact.app.study.study import Study, build_systems, check_method, method_for, read_mesh_of, sine_of
from femimpact.app.study.summary import library_versions
from femimpact.app.tasks.run import Report, keep_study
from femimpact.convergence.cases import Axis, Case, OverMeshes, OverModes, OverSteps
from femimpact.convergence.quantities import (
    Frequencies,
    ModeShapes,
    SteadyResponse,
    SupportReaction,
    SurfaceStress,
    Watched,
)
from femimpact.convergence.runs import ContactStatistics, converge_step
from femimpact.convergence.study import convergence_study
from femimpact.convergence.table import ConvergenceTable, note_lines, table_lines
from femimpact.errors import FemimpactError, InputError
from femimpact.fem.mesh import SAME_PLACE, Mesh, uniform_mesh
from femimpact.files import write_csv, write_json
from femimpact.integrators.methods import Method
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.structure.structure import Position
from femimpact.system.hermite import needs_outer_fibre
from femimpact.system.system import System

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


@dataclass(frozen=True, eq=False)
class WrittenConvergence:
    """Tables of the convergence studies of a study, by the names of their files, and the directory of these."""

    # of quantities over the mesh, the modes, and the step where the study's method is Newmark's; of runs in its steps,
    # to shortly after the first impact; of statistics of event-driven runs with contacts over the mesh
    tables: Mapping[str, ConvergenceTable]
    notes: tuple[str, ...]
    directory: Path


def write_convergence(
    study: Study, directory: Path, force: bool, report: Report, accuracy: float = 1e-3
) -> WrittenConvergence:
    """Run the convergence studies of a study and write their tables and figures.

    Parameters
    ----------
    study : Study
    directory : Path
    force : bool
    report : callable
        Called with what is done and its share, 0 to 1.
    accuracy : float, 1
        Relative error that the recommended numbers are for.

    Raises
    ------
    InputError
        If the mesh or the method does not fit the study, or its base does not move by a sine.
    """
    sine_of(study, "converge")
    mesh_of_file = read_mesh_of(study)
    full, small = build_systems(study, mesh_of_file)
    method = method_for(study, small)
    check_method(study, small, method)
    meshes = _meshes(study, mesh_of_file)
    mesh = mesh_of_file if mesh_of_file is not None else uniform_mesh(study.structure, cast(int, study.mesh.elements))
    in_steps = study.method.get("name", "newmark") == "newmark"
    axes: list[Axis] = [meshes, OverModes(mesh, _counts(full.dofs))]
    notes = list(_without_stress(study))
    if in_steps:
        axes.insert(1, _steps(study, mesh, method))
    else:
        notes.append("over the step: Newmark's method only; the study's is another")
    with new_results(directory, force) as folder:
        keep_study(folder, study)
        quantities = convergence_study(
            study.structure, axes, _watched(full, study), study.sine, accuracy=accuracy,
            progress=lambda share: report("quantities", share),
        )  # fmt: skip
        found = {f"quantities_over_{axis}": table for axis, table in quantities.tables.items()}
        written = list(quantities.tables.values())
        write_csv(folder / FILES["convergence_summary"].name, *_summary(written))
        drawn = _write(folder, found)
        statistics, why = _statistics(study, meshes, _moving(full)[0], accuracy, report)
        if statistics is not None:
            drawn |= _write(folder, {"statistics_over_mesh": statistics})
            found["statistics_over_mesh"] = statistics
        if in_steps:
            report("steps", 0.0)
            found["runs_over_step"] = converge_step(small, study.sine, cast(Newmark, method), accuracy=accuracy)
            report("steps", 1.0)
            drawn |= _write(folder, {"runs_over_step": found["runs_over_step"]})
        done = WrittenConvergence(found, (*notes, *why), directory)
        write_json(folder / FILES["convergence_notes"].name, _about(study, full, done, accuracy))
    if study.output.report:
        add_report(directory, report, study, drawn)
    return done


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


def _steps(study: Study, mesh: Mesh, method: Method) -> OverSteps:
    """Time steps to compare: a fortieth of the base's period, halved three to ten times, down to the study's step."""
    given = cast(Newmark, method)
    coarse = 1.0 / (COARSEST_STEPS * study.excitation.frequency)
    halvings = math.ceil(math.log2(coarse / given.dt)) if coarse > given.dt else 0
    return OverSteps(mesh, replace(given, dt=coarse, allow_coarse_step=True), min(max(halvings, 3), 10))


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


def _statistics(
    study: Study, meshes: OverMeshes, at: str, accuracy: float, report: Report
) -> tuple[ConvergenceTable | None, tuple[str, ...]]:
    """Statistics of runs with contacts over the coarser meshes, or why there are none."""
    if not (study.structure.impactors or study.structure.stops):
        return None, ()
    few = OverMeshes(tuple(meshes.meshes[:STATISTICS_MESHES]))
    modes, watched = study.reduction.modes if study.reduction else 8, ContactStatistics(at=at)
    try:
        found = convergence_study(
            study.structure, few, watched, study.sine, modes=modes, accuracy=accuracy,
            progress=lambda share: report("statistics", share),
        )  # fmt: skip
    except FemimpactError as error:
        return None, (f"statistics of runs with contacts: none, for {' '.join(str(error).split())}",)
    words = (
        f"statistics: means over {watched.starts} phases of the base, {watched.cycles} cycles each, event-driven on "
        f"{modes} modes or fewer"
    )
    return found["mesh"], (words,)


def _about(study: Study, system: System, found: WrittenConvergence, accuracy: float) -> dict[str, Any]:
    """The problem, notes and versions, for the report of the tables."""
    studied = found.tables.values()
    return {
        "study": study.path.name,
        "problem": next((table.problem for table in studied), ""),
        "accuracy": accuracy,
        "notes": list(dict.fromkeys([*(note for table in studied for note in table.notes), *found.notes])),
        "versions": library_versions(),
        "core": core.build_info(),
        "points": dict(system.points) if study.mesh.file else {},
    }


def _write(folder: Path, found: Mapping[str, ConvergenceTable]) -> dict[str, Element]:
    """Write tables and their figures, by the names of their files; the figures, for a page."""
    for name, table in found.items():
        write_csv(folder / FILES[name].name, *table.columns())
    return save_pictures(found.values(), folder)[0]


def _summary(found: Sequence[ConvergenceTable]) -> tuple[dict[str, Any], dict[str, str]]:
    """The summaries of all axes below one another."""
    parts = [table.summary() for table in found]
    columns: dict[str, Any] = {"axis": np.concatenate([[table.axis] * table.name.size for table in found])}
    for name in parts[0][0]:
        columns[name] = np.concatenate([part[name] for part, _ in parts])
    return columns, parts[0][1]


def convergence_lines(found: WrittenConvergence) -> list[str]:
    """Lines of at most 80 columns: for each table the relative errors, and what they say."""
    lines = [line for table in found.tables.values() for line in (*table_lines(table), "")]
    return lines + note_lines(found.notes)
