"""What `run` does with a study: modes, history, sweeps, and every file of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.errors import checked, require, require_name, require_type, truth
from femimpact.export import tables
from femimpact.export.files import atomic_write
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.integrate import check_memory, integrate
from femimpact.integrators.methods import Method, check_method, check_resolution, time_grid
from femimpact.integrators.stepping.step_size import shortest_contact
from femimpact.response.impacts import STICKING_UNITS, impact_columns
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import glue_impactors
from femimpact.study.cost import check_mesh, check_sweep
from femimpact.study.picture_data import write_last_cycles, write_mode_shapes, write_snapshots
from femimpact.study.pictures import draw_in_child, with_pictures
from femimpact.study.result_directory import Staging
from femimpact.study.results import FILES, STICKING_FILE, StudyResults, load, prepare_directory, write_summary
from femimpact.study.study import Study, build, method_for, read_mesh_of
from femimpact.study.summary import SweepPair, summary_of
from femimpact.sweep import SWEEP_UNITS, frequency_sweep, on_grid
from femimpact.system.modes import Modes, solve_modes
from femimpact.system.system import State, System, without_impactors

__all__ = [
    "Found",
    "Report",
    "history_record",
    "keep_history",
    "keep_modes",
    "keep_pictures",
    "keep_study",
    "keep_sweeps",
    "preflight",
    "run_modes",
    "run_simulation",
    "run_study",
    "run_sweep",
]

PARTS = ("modes", "simulate", "sweep")
"""What `run_study` does, each part by its name."""

MODES_LISTED = 4
FIGURE_CYCLES = 40

SAMPLES_PER_CONTACT = 20
"""Instants at which a figure shows the force of one contact, at least."""

Report = Callable[[str, float], None]
"""Called with what is being done and the share of it that is done."""


def _silent(_what: str, _share: float) -> None:
    pass


def run_modes(study: Study) -> tuple[System, Modes, Modes | None]:
    """The full system, its modes without balls, and those with every ball glued on."""
    full = build(study)[0]
    count = min(MODES_LISTED, full.dofs)
    glued = None
    if study.structure.impactors:
        glued = solve_modes(build(study, glue_impactors(study.structure))[0], count)
    return full, solve_modes(full, count), glued


def history_record(study: Study, small: System, method: Method) -> Recorder:
    """What the study's history keeps: every place that carries a ball, the balls, the last cycles whole."""
    output = study.output
    kept, grid = _frames_duration(study), time_grid(method, study.base.frequency)
    channels: list[str | float] = ["tip", "tip.velocity", "mid"]
    for pair in small.contacts:
        place = next((name for name, x in small.points.items() if x == pair.position), None)
        if place not in (None, "tip"):
            channels += [str(place), f"{place}.velocity"]
        moving = [] if pair.is_stop else [pair.name, f"{pair.name}.velocity"]
        channels += [*moving, f"{pair.name}.contact_force"]
    return Recorder(
        channels=tuple(channels),
        every=output.every,
        snapshots=max(round(kept / (output.frames * grid)), 1) if output.frames else 0,
        snapshots_start=max(study.base.duration - kept, 0.0),
        memory_limit=output.memory_limit,
    )


def preflight(study: Study, parts: tuple[str, ...] = PARTS) -> tuple[System, System, Method]:
    """Find all that can be wrong with a run before its first long step.

    Returns
    -------
    full, small : System
    method : Method

    Raises
    ------
    InputError
        If the step does not resolve contact or base, or the history would keep too much.
    """
    mesh = read_mesh_of(study)
    elements = study.mesh.elements if mesh is None else mesh.nodes.size - 1
    check_mesh(study, elements or 1)
    full, small, method = build(study)
    check_method(small, method)
    bare = method_for(study, without_impactors(small))
    if "simulate" in parts:
        check_resolution(np.array([study.base.frequency]), method, "base.frequency")
        record = history_record(study, small, method)
        grid = time_grid(method, study.base.frequency)
        channels, key = len(record.channels or ()), "output.memory_limit"
        check_memory(small, record, channels, round(study.base.duration / grid), grid, study.base.frequency, key)
    if "sweep" in parts and study.sweep is not None:
        check_sweep(study, small, method)
        for each in (method, bare):
            check_resolution(np.array([study.sweep.stop]), each, "sweep.stop")
    return full, small, method


def _frames_duration(study: Study) -> float:
    return min(study.output.frame_cycles / study.base.frequency, study.base.duration)


def run_simulation(study: Study, report: Report = _silent) -> Response:
    """The history that the study asks for, with snapshots over its last cycles."""
    _, small, method = build(study)
    record = history_record(study, small, method)
    return integrate(
        small, study.sine, method, study.base.duration, record, study.initial, lambda share: report("history", share)
    )


def run_end(study: Study) -> Response:
    """The study's history once more, bit for bit, with every step of its last 40 cycles kept: for figures."""
    _, small, method = build(study)
    record = history_record(study, small, method)
    start = max(study.base.duration - FIGURE_CYCLES / study.base.frequency, 0.0)
    record = replace(record, every=1, start=start, snapshots=0, ledger=False)
    if isinstance(method, EventDriven):
        method = _read_within_contacts(method, small, study.base.frequency)
    return integrate(small, study.sine, method, study.base.duration, record, study.initial)


def _read_within_contacts(method: EventDriven, system: System, frequency: float) -> EventDriven:
    """The same flights, read often enough to show the course of a compliant contact's force."""
    samples, contact_time = method.samples_per_cycle, shortest_contact(system)
    # doubled, the grid keeps its instants to the last bit, and with them the pieces in which a run is flown
    while math.isfinite(contact_time) and samples * frequency * contact_time < SAMPLES_PER_CONTACT:
        samples *= 2
    return replace(method, samples_per_cycle=samples)


def run_sweep(study: Study, report: Report = _silent, initial: State | None = None) -> SweepPair:
    """Sweeps without and with balls: the even grid, refined around both resonances."""
    plan = study.sweep
    require(plan is not None, "sweep", None, "", "table [sweep] is missing")
    if plan is None:
        raise AssertionError("require raises")
    _, small, method = build(study)
    bare = without_impactors(small)
    bare_method = method_for(study, bare)
    coarse = np.linspace(plan.start, plan.stop, plan.points)
    state = initial or study.initial
    frequencies = coarse
    if plan.refine:
        centres = [small.first_frequency]
        reach = [8.0 * max(float(solve_modes(bare, 1).damping_ratio[0]), 1e-4) * small.first_frequency]
        if small.contacts:
            first = frequency_sweep(
                small, study.base.amplitude, coarse, method, plan.cycles, initial=state, ledger=False,
                progress=lambda share: report("sweep with ball, even grid", share),
            )  # fmt: skip
            centres.append(first.peak_frequency)
            reach.append(1.5 * float(coarse[1] - coarse[0]))
        fine = [np.linspace(c - r, c + r, plan.refine) for c, r in zip(centres, reach, strict=True)]
        inside = [part[(part > plan.start) & (part < plan.stop)] for part in fine]
        frequencies = np.unique(np.round(np.concatenate([coarse, *inside]), 9))
    empty = frequency_sweep(
        bare, study.base.amplitude, frequencies, bare_method, plan.cycles, initial=_structure_only(state),
        progress=lambda share: report("sweep without ball", share),
    )  # fmt: skip
    ball = None
    if small.contacts:
        ball = frequency_sweep(
            small, study.base.amplitude, frequencies, method, plan.cycles, initial=state,
            progress=lambda share: report("sweep with ball", share),
        )  # fmt: skip
    return SweepPair(empty, ball, coarse)


def _structure_only(state: State) -> State:
    return State(state.displacement, state.velocity, frame=state.frame, equilibrium=state.equilibrium)


@dataclass(frozen=True, eq=False)
class Found:
    """What a run has found so far; None where it has not, or will not.

    Parameters
    ----------
    modes : (System, Modes, Modes or None), optional
        As of `run_modes`.
    response : Response, optional
    sweeps : SweepPair, optional
    """

    modes: tuple[System, Modes, Modes | None] | None = None
    response: Response | None = None
    sweeps: SweepPair | None = None


def run_study(
    study: Study,
    directory: str | Path,
    *,
    parts: tuple[str, ...] = PARTS,
    force: bool = False,
    report: Report = _silent,
) -> StudyResults:
    """Run what the study asks for and write its results into a directory.

    Every part is on disk before the next begins; figures and movie come last, and what of them cannot be
    drawn is a warning of the results.

    Parameters
    ----------
    study : Study
    directory : str or Path
        Must not exist or be empty, unless forced.
    parts : tuple of str
        Any of "modes", "simulate", "sweep"; a study without [sweep] skips it.
    force : bool
    report : callable, optional

    Returns
    -------
    StudyResults
        As read back from the directory.
    """
    require_type(study, Study, "study")
    require(isinstance(directory, (str, Path)), "directory", directory, "", "must be the path of a directory")
    require(isinstance(parts, (tuple, list)), "parts", parts, "", f"must be some of {', '.join(PARTS)}")
    for part in parts:
        require_name(part, PARTS, "parts")
    force = checked("force", force, truth())
    preflight(study, parts)
    wanted = [part for part in parts if part != "sweep" or study.sweep is not None]
    with prepare_directory(directory, force) as staging:
        found = Found()
        keep_study(staging, study)
        if "modes" in wanted:
            found = replace(found, modes=run_modes(study))
            keep_modes(staging, study, found, [part for part in wanted if part != "modes"])
        if "simulate" in wanted:
            found = replace(found, response=run_simulation(study, report))
            keep_history(staging, study, found, [part for part in wanted if part == "sweep"])
        if "sweep" in wanted:
            found = replace(found, sweeps=run_sweep(study, report))
            keep_sweeps(staging, study, found)
        keep_pictures(staging, study, found, report)
    return load(directory)


# ---- what is kept of a run, in the order in which it is written -----------------------------------


def keep_study(staging: Staging, study: Study) -> None:
    """Write the study file."""
    atomic_write(staging.folder / FILES["study"], study.text)


def keep_modes(staging: Staging, study: Study, found: Found, left: Sequence[str] = ()) -> None:
    """Write what `run_modes` found; `left` names the parts of the run that are still to come."""
    if found.modes is None:
        raise AssertionError("there are modes to keep")
    full, modes, glued = found.modes
    _write_modes(study, staging.folder, full, modes, glued)
    _finish(staging, study, found, "modes", left)


def keep_history(staging: Staging, study: Study, found: Found, left: Sequence[str] = ()) -> None:
    """Write what `run_simulation` found."""
    if found.response is None:
        raise AssertionError("there is a history to keep")
    _write_history(study, staging.folder, found.response)
    _finish(staging, study, found, "history", left)


def keep_sweeps(staging: Staging, study: Study, found: Found, left: Sequence[str] = ()) -> None:
    """Write what `run_sweep` found."""
    if found.sweeps is None:
        raise AssertionError("there are sweeps to keep")
    _write_sweeps(staging.folder, found.sweeps)
    _finish(staging, study, found, "sweep", left)


def keep_pictures(
    staging: Staging, study: Study, found: Found, report: Report = _silent, more: Mapping[str, Any] | None = None
) -> None:
    """Write what the figures show besides, draw, and write the summary of it all.

    Parameters
    ----------
    staging : Staging
    study : Study
    found : Found
    report : callable, optional
    more : mapping, optional
        What the summary says besides.
    """
    folder, output = staging.folder, study.output
    summary = summary_of(study, found.modes, found.response, found.sweeps) | dict(more or {})
    if output.figures and found.response is not None and found.response.system.contacts:
        report("last cycles, for figures", 0.0)
        write_last_cycles(folder / FILES["last_cycles"], study.structure, found.response, run_end(study))
        report("last cycles, for figures", 1.0)
    filmed = found.response is not None and found.response.snapshots is not None
    kinds = [*(["figures"] if output.figures else []), *(["movie"] if output.movie and filmed else [])]
    if kinds:
        ended = dict.fromkeys(kinds, "the run was ended before")
        write_summary(folder, with_pictures(summary, ended, staging.target))
        # what they are drawn from stays with the results, should the run end now
        staging.finish_part("data of pictures")
        summary = with_pictures(summary, draw_in_child(folder, folder, kinds, report), staging.target)
    write_summary(folder, summary)


def _finish(staging: Staging, study: Study, found: Found, part: str, left: Sequence[str]) -> None:
    """Write the summary of what there is so far, and note that the part is on disk."""
    summary = summary_of(study, found.modes, found.response, found.sweeps)
    if left:
        summary["unfinished"] = list(left)
        text = f"the run was ended before its part{'s' if len(left) > 1 else ''} {' and '.join(left)}"
        summary["warnings"] = [*summary["warnings"], text]
    write_summary(staging.folder, summary)
    staging.finish_part(part)


def _write_modes(study: Study, folder: Path, full: System, modes: Modes, glued: Modes | None) -> None:
    columns: dict[str, Any] = {
        "mode": list(range(1, modes.natural_frequency.size + 1)),
        "natural_frequency": modes.natural_frequency,
        "damping_ratio": modes.damping_ratio,
        "participation_factor": modes.participation_factor,
        "effective_mass": modes.effective_mass,
    }
    units = {"natural_frequency": "Hz", "damping_ratio": "1", "participation_factor": "kg^0.5", "effective_mass": "kg"}
    if glued is not None:
        columns["natural_frequency_glued"], units["natural_frequency_glued"] = glued.natural_frequency, "Hz"
    tables.write_csv(folder / FILES["modes"], columns, units)
    write_mode_shapes(folder / FILES["mode_shapes"], full, modes)
    if study.output.paraview:
        from femimpact.export import vtk

        vtk.write_modes(folder / FILES["modes_scene"], full, modes, study.structure)


def _write_sweeps(folder: Path, sweeps: SweepPair) -> None:
    import xarray

    curves = {"empty": sweeps.empty, **({"ball": sweeps.ball} if sweeps.ball is not None else {})}
    frequency = sweeps.empty.frequency
    columns: dict[str, Any] = {"frequency": frequency}
    units = {"frequency": "Hz"}
    columns["grid"] = np.where(on_grid(frequency, sweeps.coarse), "even", "refined")
    for label, curve in curves.items():
        for name in (*SWEEP_UNITS, "steadiness"):
            if label == "empty" and name not in (
                "peak",
                "rms",
                "first_harmonic",
                "phase",
                "energy_residual",
                "steadiness",
            ):
                continue
            columns[f"{label}_{name}"] = getattr(curve, name)
            units[f"{label}_{name}"] = SWEEP_UNITS.get(name, "")
    tables.write_csv(folder / FILES["sweep"], columns, units)
    data = xarray.concat(
        [curve.to_xarray() for curve in curves.values()],
        xarray.Variable("case", list(curves)),
        combine_attrs="override",
    )
    data = data.assign_coords(grid=("frequency", columns["grid"]))
    laws = "; ".join(f"{label}: {curve.law}" for label, curve in curves.items())
    tables.write_netcdf(folder / FILES["sweep_data"], data.assign_attrs(contact_law=laws))


def _write_history(study: Study, folder: Path, response: Response) -> None:
    tables.write_netcdf(folder / FILES["history"], response.to_xarray())
    _write_impacts(folder, response)
    if response.snapshots is None:
        return
    exaggeration = study.output.exaggeration
    write_snapshots(folder / FILES["snapshots"], study.structure, response, exaggeration)
    if study.output.paraview:
        from femimpact.export import vtk

        vtk.write_deflection(folder / FILES["deflection_scene"], response, study.structure, exaggeration or 1.0)


def _write_impacts(folder: Path, response: Response) -> None:
    tables.write_csv(folder / FILES["impacts"], *impact_columns(response.impacts))
    tables.write_netcdf(folder / FILES["impact_data"], response.impacts.to_xarray())
    if len(response.sticking):
        sticking = {name: getattr(response.sticking, name) for name in STICKING_UNITS}
        tables.write_csv(folder / STICKING_FILE, sticking, STICKING_UNITS)
