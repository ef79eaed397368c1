"""The run of a study: modes, history and sweeps, with the files and the findings of each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from femimpact.app.report.pictures import Report
from femimpact.app.results.picture_data import last_cycle_data, mode_shape_data, snapshot_data
from femimpact.app.results.results import StudyResults
from femimpact.app.study.findings import Findings, joined
from femimpact.app.study.prepared import (
    LEAST_SAMPLES,
    LIBRARIES,
    PARTS,
    RUNS_OF_HISTORY,
    PreparedStudy,
    carried_words,
    counts_of,
    even_grid,
    film_window,
    history_cost,
    in_study_words,
    last_cycles_start,
    mesh_memory,
    most_frequencies,
    picture_seconds,
    prepare,
    refined_grid,
    root_stress_notes,
    runs_of_starts,
    sweep_cost,
)
from femimpact.app.study.study import Study, SweepPlan, assemble_on
from femimpact.app.study.summary import (
    SweepPair,
    findings_of,
    findings_of_history,
    findings_of_modes,
    findings_of_sweeps,
)
from femimpact.app.tasks.starts import columns_of_starts, drawn_curves, drawn_histories, spreads_of
from femimpact.app.tasks.task import Finished, Plan, Task, run_task
from femimpact.errors import checked, kind_of, require, require_name, require_path, require_type, truth, warns
from femimpact.excitation.drives import until
from femimpact.excitation.excitation import has_cycle
from femimpact.excitation.harmonic import Sine
from femimpact.excitation.remarks import motion_notes
from femimpact.files import write_netcdf
from femimpact.integrators.cases import first_steps
from femimpact.integrators.methods import Method, read_at_least, step_of
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.operators import shortest_contact
from femimpact.response.impacts import DRAWN_IN_CONTACT, impact_columns
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import glue_impactors
from femimpact.sweep.curve import IMPACT_UNITS, SWEEP_UNITS, on_grid
from femimpact.sweep.sweep import frequency_sweep
from femimpact.system.modes import Modes, first_elastic_frequency, mode_columns, solve_modes
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import flat_columns
from femimpact.units import counted, number_text

MODES_LISTED = 4


def _silent(_what: str, _share: float) -> None:
    pass


def run_modes(prepared: PreparedStudy) -> tuple[Modes, Modes | None]:
    """Modes of the full system without balls, and those with every ball glued on."""
    study, full = prepared.study, prepared.full
    count = min(MODES_LISTED, full.dofs)
    glued = None
    if study.structure.impactors:
        glued = solve_modes(assemble_on(study, glue_impactors(study.structure), prepared.mesh), count)
    return solve_modes(full, count), glued


def run_simulation(prepared: PreparedStudy, report: Report = _silent) -> Response:
    """The history of the study, with snapshots over its last cycles, without a cycle around its largest motion."""
    study, small, record, apart = prepared.study, prepared.small, prepared.record, _is_filmed_apart(prepared)
    response = integrate(
        small, study.excitation, prepared.method, study.history_duration,
        replace(record, snapshots=0, snapshots_start=0.0) if apart else record, prepared.initial,
        lambda share: report("history", share),
    )  # fmt: skip
    if not apart:
        return response
    begin, end = film_window(study, small, response.largest(small.default_place).time)
    # a run has snapshots up to its end: those of a part are kept by one that ends with it
    record = replace(record, channels=(), ledger=False, state_at=None, start=0.0, snapshots_start=begin)
    film = integrate(small, study.excitation, prepared.method, end, record, prepared.initial)
    return replace(response, snapshots=film.snapshots)


def _is_filmed_apart(prepared: PreparedStudy) -> bool:
    """Whether the snapshots need a run of their own: where the largest motion is, the history says."""
    return prepared.record.snapshots > 0 and not has_cycle(prepared.study.excitation)


def _is_compared(prepared: PreparedStudy) -> bool:
    """Whether the history is run without what the structure carries too: on a sine of the base a sweep does that."""
    of_sweep = isinstance(prepared.study.excitation, Sine)
    return not of_sweep and len(prepared.bare.contacts) < len(prepared.small.contacts)


def runs_of_history(prepared: PreparedStudy) -> int:
    """How many runs the history takes: its own, those of several starts, without what it carries, and of the film."""
    beside = _is_compared(prepared) + _is_filmed_apart(prepared)
    return RUNS_OF_HISTORY * (runs_of_starts(prepared.small, prepared.study.output.starts) + beside)


def run_without(prepared: PreparedStudy, report: Report = _silent) -> Response | None:
    """The same history without what the structure carries or meets, where it is compared; else None."""
    study, small, bare = prepared.study, prepared.small, prepared.bare
    if not _is_compared(prepared):
        return None
    left_out = {"contact_force", *(pair.name for pair in small.contacts)}
    channels = [name for name in prepared.record.channels or () if str(name).partition(".")[0] not in left_out]
    record = replace(prepared.record, channels=tuple(channels), snapshots=0, ledger=False, state_at=None)
    start, of_history = _without_balls(prepared.initial), partial(report, f"history without {prepared.carried}")
    return integrate(bare, study.excitation, prepared.method, study.history_duration, record, start, of_history)


def _without_balls(state: State) -> State:
    return replace(state, ball_displacement=None, ball_velocity=None)


def last_cycles(prepared: PreparedStudy, response: Response) -> Response:
    """The last 40 cycles of the study's history with every step kept, bit for bit as in the run: for figures.

    Where the history kept every step itself these are its last rows; else the run goes on once more from the state
    that it kept there. A method that keeps none makes the run once more.
    """
    study, method, record = prepared.study, prepared.method, prepared.record
    start, duration = last_cycles_start(study, prepared.small), study.history_duration
    grid = method.time_grid(prepared.small, study.excitation, duration, record)
    steps = round(duration / grid)
    finely, interval = _read_within_contacts(prepared, grid)
    if record.every == 1 and finely == method and interval == record.interval:
        first = first_steps(replace(record, start=start), steps, grid)[0]
        channels = {name: values[first:] for name, values in response.channels.items()}
        return replace(response, time=response.time[first:], channels=channels, energy=None, snapshots=None)
    initial = response.kept_state or prepared.initial
    # an integer number of steps, so that no rounding of a time adds one
    duration = (steps - round(initial.time / grid)) * grid
    record = replace(record, every=1, start=start, snapshots=0, ledger=False, interval=interval)
    return integrate(prepared.small, study.excitation, finely, duration, record, initial)


def _read_within_contacts(prepared: PreparedStudy, grid: float) -> tuple[Method, float | None]:
    """A method and an interval (s) with which the same motion shows the course of a compliant contact's force.

    `grid` (s) is that of the history, and stays where it cannot be chosen.
    """
    study, small, method, record = prepared.study, prepared.small, prepared.method, prepared.record
    contact_time, frequency, parts = shortest_contact(small), study.excitation.frequency, 1
    # doubled, the grid keeps its instants to the last bit, and with them the pieces in which a run is computed
    while math.isfinite(contact_time) and parts * contact_time < DRAWN_IN_CONTACT * grid:
        parts *= 2
    one = Sine(0.0, frequency), 1.0 / frequency, Recorder()
    finely = read_at_least(method, parts * round(1.0 / (frequency * method.time_grid(small, *one))))
    if finely == method or finely.time_grid(small, study.excitation, study.history_duration, record) < grid:
        return finely, record.interval
    # samples of a cycle do not set the grid: its interval does
    return method, grid / parts


def run_sweep(prepared: PreparedStudy, report: Report = _silent) -> SweepPair:
    """Sweeps without and with balls: the even grid, refined around both resonances."""
    study, small, bare = prepared.study, prepared.small, prepared.bare
    plan = cast(SweepPlan, study.sweep)
    method, bare_method, level = prepared.method, prepared.bare_method, study.sweep_level
    coarse = even_grid(plan)
    state = study.initial
    peak_with_ball = None
    if plan.refine and small.contacts:
        first = frequency_sweep(
            small, frequencies=coarse, method=method, cycles=plan.cycles, initial=state, ledger=False, **level,
            progress=lambda share: report(f"sweep with {prepared.carried}, even grid", share),
        )  # fmt: skip
        peak_with_ball = first.peak_frequency
    frequencies = refined_grid(plan, bare, peak_with_ball)
    empty = frequency_sweep(
        bare, frequencies=frequencies, method=bare_method, cycles=plan.cycles, initial=_without_balls(state), **level,
        progress=lambda share: report(f"sweep without {prepared.carried}", share),
    )  # fmt: skip
    ball = None
    if small.contacts:
        ball = frequency_sweep(
            small, frequencies=frequencies, method=method, cycles=plan.cycles, initial=state, **level,
            progress=lambda share: report(f"sweep with {prepared.carried}", share),
        )  # fmt: skip
    return SweepPair(empty, ball, coarse)


@warns
def run_study(
    study: Study,
    directory: str | Path,
    *,
    parts: tuple[str, ...] = PARTS,
    force: bool = False,
    report: Report = _silent,
) -> StudyResults:
    """Run all parts of the study and write its results into a directory.

    Every part is on disk before the next begins; figures and movie come last, and what of them cannot be
    drawn is a warning of the results.

    Parameters
    ----------
    directory : str or Path
        Must not exist or be empty, unless forced.
    parts : tuple of str
        Any of "modes", "simulate", "sweep"; a study without [sweep] skips it.
    report : callable, optional
        Called with what is being done and its share, 0 to 1.

    Examples
    --------
    >>> import femimpact as fi
    >>> study = fi.load_study("meshes/stepped_cantilever.toml")
    >>> results = fi.run_study(study, "results", parts=("modes",))  # doctest: +SKIP
    >>> results.modes["natural_frequency"]  # doctest: +SKIP
    """
    require_type(study, Study, "study")
    require_path(directory, "directory", "a directory")
    require(isinstance(parts, (tuple, list)), "parts", parts, "", f"must be some of {', '.join(PARTS)}")
    for part in parts:
        require_name(part, PARTS, "parts")
    force = checked("force", force, truth())
    usable = callable(report) and not isinstance(report, type)
    require(usable, "report", kind_of(report), "", "must be callable with the name of a part and its share")
    return run_task(task_of_run(prepare(study, parts), parts), directory, force, report)


def task_of_run(prepared: PreparedStudy, parts: tuple[str, ...] = PARTS, animate: bool = False) -> Task:
    """The parts of a run, of which that of a study without [sweep] has none."""
    names = {"modes": "modes", "simulate": "history", "sweep": "sweep"}
    kept = tuple(name for part, name in names.items() if part in parts and (part != "sweep" or prepared.study.sweep))
    work, plan = partial(_parts_of_run, prepared, kept, animate), partial(plan_of_run, prepared, kept)
    return Task(prepared.study, findings_of(prepared), kept, work, plan)


def _parts_of_run(prepared: PreparedStudy, parts: tuple[str, ...], animate: bool, report: Report) -> Iterator[Finished]:
    """Modes, history and sweep, as far as they are asked for; ranges over several starts behind each."""
    study, small, response = prepared.study, prepared.small, None
    if "modes" in parts:
        yield modes_part(prepared, run_modes(prepared), animate)
    if "history" in parts:
        response = run_simulation(prepared, report)
        yield history_part(prepared, response, report)
        if runs_of_starts(small, study.output.starts) > 1:
            yield Finished("history", findings=drawn_histories(prepared, report))
    if "sweep" in parts:
        sweeps = run_sweep(prepared, report)
        swept = sweep_part(prepared, sweeps)
        # the energy of a history stands before that of a sweep
        yield swept if response is None else replace(swept, findings=replace(swept.findings, energy_residual=None))
        if study.sweep is not None and runs_of_starts(small, study.sweep.starts) > 1:
            curves, failed = drawn_curves(prepared, sweeps.empty, report)
            step = float(sweeps.coarse[1] - sweeps.coarse[0])
            ranges = Findings(
                starts={study.start: spreads_of(curves, sweeps.empty, step)}, starts_of_sweep=curves.starts
            )
            files = {"curves_of_starts": columns_of_starts({study.start: curves})}
            yield Finished("sweep", files, joined(ranges, failed))


# ---- what would run ---------------------------------------------------------------------------------


def plan_of_run(prepared: PreparedStudy, parts: tuple[str, ...]) -> Plan:
    """Dofs, contact time, contacts and method, and what each part takes."""
    study, small, end = prepared.study, prepared.small, prepared.study.history_duration
    notes = (*prepared.method.notes(small), *motion_notes(until(study.excitation, end), small.length, end))
    notes += (*root_stress_notes(study.structure, small), *_files_elsewhere(study))
    frequency, details = (_first_frequency(prepared),), tuple(_details(prepared))
    return Plan(
        tuple(_costs(prepared, parts)), frequency, details, tuple(map(in_study_words, notes)), prepared.warnings
    )


def _first_frequency(prepared: PreparedStudy) -> str:
    """The first natural frequency without balls, and with every ball glued on."""
    study, small = prepared.study, prepared.small
    words = f"first natural frequency: {first_elastic_frequency(small):.6g} Hz"
    if small.balls:
        words += f" without {prepared.carried}"
    if study.structure.impactors:
        glued = assemble_on(study, glue_impactors(study.structure), prepared.mesh)
        balls = "it" if len(study.structure.impactors) == 1 else "them"
        words += f", {first_elastic_frequency(glued):.6g} Hz with {balls} glued on"
    return words if small.first_frequency > 0.0 else f"{words}, above a rigid motion at 0 Hz"


def _details(prepared: PreparedStudy) -> Iterator[str]:
    """Dofs, contact time, gravity, absorbers, contacts and method."""
    full, small = prepared.full, prepared.small
    kind = "modal" if small.is_diagonal else "physical"
    counts = [counted(count, name) for name, count in counts_of(small).items() if count]
    yield (
        f"dofs: {full.dofs} of the mesh ({full.nodes.size - 1} elements), {small.dofs} integrated ({kind}), "
        f"{', '.join(counts) or 'no ball'}"
    )
    contact_time = shortest_contact(small)
    yield f"contact time: {contact_time:.4g} s" if math.isfinite(contact_time) else "contact time: no contact"
    study, method = prepared.study, prepared.method
    if study.structure.gravity:
        yield f"gravity: {study.structure.gravity:g} m/s^2 along the deflection"
    if study.structure.axial is not None:
        yield f"load along the beam: {study.structure.axial}"
    for pair in prepared.small.contacts:
        if pair.kind == "absorber":
            tuned = math.sqrt(pair.free_stiffness / pair.mass)
            yield (
                f"absorber {pair.name}: {1e3 * pair.mass:.4g} g, {tuned / (2.0 * math.pi):.5g} Hz on a structure at "
                f"rest, damping ratio {pair.free_damping / (2.0 * tuned * pair.mass):.4g}"
            )
            continue
        fixed = ", fixed in space" if pair.fixed_to == "space" else ""
        preload = f", {pair.preload_words}" if pair.is_preloaded else ""
        numbers = pair.law.shown_numbers(pair.effective_mass)
        of_law = "".join(f"{name} {value:.5g}{unit and f' {unit}'}, " for name, value, unit in numbers)
        yield (
            f"contact of {pair.name}: {pair.law.name}, {of_law}restitution {pair.parameters.restitution:.4g}, "
            f"effective mass {1e3 * pair.effective_mass:.4g} g, {_clearance(pair.gaps)}"
            f"{preload}{fixed}"
        )
    yield f"method: {study.method.get('name', 'newmark')}; {_step_words(study, method)}"


def _costs(prepared: PreparedStudy, parts: tuple[str, ...]) -> Iterator[str]:
    """Instants, memory and time of each part."""
    study, small, method, grid = prepared.study, prepared.small, prepared.method, prepared.grid
    instants = "samples" if step_of(method) is None else "steps"
    if "history" in parts:
        runs = runs_of_history(prepared)
        yield (
            f"history: {round(study.history_duration / grid)} {instants}, {grid:.4g} s apart, {study.history_words}, "
            f"takes about {history_cost(study, small, method, prepared.record, runs)}"
            f"{_starts_words(small, study.output.starts)}"
        )
    if "sweep" in parts and study.sweep is not None:
        plan = study.sweep
        cases, middle = most_frequencies(plan), 0.5 * (plan.start + plan.stop)
        total = cases * plan.cycles / middle / method.time_grid(small, Sine(0.0, middle), 1.0 / middle, Recorder())
        yield (
            f"sweep: up to {cases} frequencies from {plan.start:g} to {plan.stop:g} Hz, {plan.cycles} cycles each, "
            f"{number_text(total, 3)} {instants}, takes about {sweep_cost(study, small, method)} on one core"
            f"{_starts_words(small, plan.starts)}"
        )
    if picture_seconds(study) > 0.0:
        yield f"figures and movie: about {number_text(picture_seconds(study), 2)} s, when the rest is done"
    mesh = mesh_memory(prepared.full.nodes.size - 1, small.dofs if study.reduction else None)
    yield f"mesh and modes: take about {number_text(max(mesh.values()) / 1e6, 3)} MB"
    yield LIBRARIES


def _step_words(study: Study, method: Method) -> str:
    """How a method advances in time, in words."""
    step, refine = step_of(method), getattr(method, "refine", 1)
    if step is None:
        return "exact between impacts and through compliant ones"
    origin = "given" if "dt" in study.method else "recommended"
    return f"step: {step:.4g} s ({origin})" + (f", divided by {refine} in contact" if refine > 1 else "")


def _files_elsewhere(study: Study) -> list[str]:
    """Notes on files that a study reads from outside its folder: it cannot be handed on with that alone."""
    folder = study.path.parent.resolve()
    named = {"base.record": study.record, "mesh.file": study.mesh.file}
    # links are followed
    places = {key: (name, (folder / name).resolve()) for key, name in named.items() if name}
    return [
        f"{key} = {name!r} is outside the folder of the study file: {place}"
        for key, (name, place) in places.items()
        if not place.is_relative_to(folder)
    ]


def _starts_words(small: System, starts: int) -> str:
    """Words on further starts, whose time is in that of the run."""
    return f", with {starts} further starts of the {carried_words(small)}" if runs_of_starts(small, starts) > 1 else ""


def _clearance(gaps: tuple[float, float]) -> str:
    if math.isfinite(sum(gaps)):
        return f"total clearance {1e3 * sum(gaps):.4g} mm"
    return f"wall on the {'+' if math.isfinite(gaps[0]) else '-'} side alone, gap {1e3 * min(gaps):.4g} mm"


# ---- files and findings of the parts ----------------------------------------------------------------


def modes_part(prepared: PreparedStudy, modes: tuple[Modes, Modes | None], animate: bool = False) -> Finished:
    """What `run_modes` returned; animated, each mode over its period too."""
    full, structure, (empty, glued) = prepared.full, prepared.study.structure, modes
    columns, units = mode_columns(empty)
    # a number of a row has none in a file
    del units["mode"]
    if glued is not None:
        columns["natural_frequency_glued"], units["natural_frequency_glued"] = glued.natural_frequency, "Hz"
    files: dict[str, Any] = {
        "modes": (columns, units),
        "mode_shapes": mode_shape_data(full, empty),
    }
    if animate or prepared.study.output.paraview:
        from femimpact import vtk

        # a rigid motion has no period to be shown over
        for mode in (1 + np.flatnonzero(empty.natural_frequency > 0.0)).tolist() if animate else ():
            files[f"mode_{mode}_scene"] = lambda path, i=mode: vtk.write_mode(path, full, empty, structure, i)
        # the script opens the last one
        files["modes_scene"] = lambda path: vtk.write_modes(path, full, empty, structure)
    return Finished("modes", files, findings_of_modes(modes))


def history_part(prepared: PreparedStudy, response: Response, report: Report) -> Finished:
    """What `run_simulation` returned, and with contacts the last cycles at every step, where there will be figures."""
    study, output = prepared.study, prepared.study.output
    groups, history = dict[str, Any](), response.to_xarray().isel(time=slice(None, None, _stride(study, response)))
    files: dict[str, Any] = {"history": lambda path: write_netcdf(path, history, **groups), **impact_files(response)}
    if output.figures and response.system.contacts:
        report("last cycles, for figures", 0.0)
        groups["last_cycles"] = last_cycle_data(response, last_cycles(prepared, response))
        report("last cycles, for figures", 1.0)
    if response.snapshots is not None:
        scale = output.exaggeration or 1.0
        groups["snapshots"] = snapshot_data(response, response.snapshots)
        # the script opens the last one
        scenes = (("deflection_hdf", output.vtkhdf), ("deflection_scene", output.paraview))
        for key in (key for key, asked in scenes if asked):
            from femimpact import vtk

            files[key] = lambda path: vtk.write_deflection(path, response, study.structure, scale)
    findings = findings_of_history(prepared, response, run_without(prepared, report))
    warnings = (*findings_of(prepared).warnings, *findings.warnings)
    history = history.assign_attrs(warnings="; ".join(warnings))
    return Finished("history", files, findings)


def _stride(study: Study, response: Response) -> int:
    """Every how many samples of a run are in its file: of a cycle of a sine `LEAST_SAMPLES`, unless the study says."""
    asked = study.output.every or study.output.interval or study.record
    if asked or not has_cycle(study.excitation) or response.time.size < 2:
        return 1
    samples = 1.0 / (study.excitation.frequency * float(response.time[1] - response.time[0]))
    return max(math.floor(samples / LEAST_SAMPLES + 1e-9), 1)


def impact_files(response: Response) -> dict[str, Any]:
    """Every impact, and the sticking phases where something stuck."""
    return {
        "impacts": impact_columns(response.impacts),
        "impact_data": response.impacts.to_xarray(),
        **({"sticking": flat_columns(response.sticking)} if len(response.sticking) else {}),
    }


def sweep_part(prepared: PreparedStudy, sweeps: SweepPair) -> Finished:
    """What `run_sweep` returned."""
    import xarray

    curves = {"empty": sweeps.empty, **({"ball": sweeps.ball} if sweeps.ball is not None else {})}
    frequency = sweeps.empty.frequency
    grid = np.where(on_grid(frequency, sweeps.coarse), "even", "refined")
    columns: dict[str, Any] = {"frequency": frequency, "grid": grid}
    units = {"frequency": "Hz"}
    for label, curve in curves.items():
        for name in (*SWEEP_UNITS, "steadiness"):
            if label != "empty" or name not in IMPACT_UNITS:
                columns[f"{label}_{name}"] = getattr(curve, name)
                units[f"{label}_{name}"] = SWEEP_UNITS.get(name, "")
    cases = xarray.Variable("case", list(curves))
    data = xarray.concat([curve.to_xarray() for curve in curves.values()], cases, combine_attrs="override")
    laws = "; ".join(f"{label}: {curve.law}" for label, curve in curves.items())
    data = data.assign_coords(grid=("frequency", grid)).assign_attrs(contact_law=laws)
    return Finished("sweep", {"sweep": (columns, units), "sweep_data": data}, findings_of_sweeps(prepared, sweeps))
