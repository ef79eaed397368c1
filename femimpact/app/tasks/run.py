"""The run of a study: modes, history, sweeps, and the files of each."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.app.report.markup import Element
from femimpact.app.report.pictures import draw_kinds, with_pictures
from femimpact.app.report.result_page import add_report
from femimpact.app.results.picture_data import write_last_cycles, write_mode_shapes, write_snapshots
from femimpact.app.results.result_directory import FILES, new_file, new_results
from femimpact.app.results.results import STICKING_FILE, StudyResults, load, write_summary
from femimpact.app.study.prepared import (
    PARTS,
    PreparedStudy,
    even_grid,
    last_cycles_start,
    prepare,
    refined_grid,
    runs_of_starts,
)
from femimpact.app.study.study import Study, assemble_on
from femimpact.app.study.study_file import study_text, with_record
from femimpact.app.study.summary import SweepPair, summary_of
from femimpact.app.tasks.starts import drawn_curves, drawn_histories, spreads_of, write_curves
from femimpact.errors import checked, kind_of, require, require_name, require_path, require_type, truth
from femimpact.excitation.harmonic import Sine
from femimpact.files import atomic_write, write_csv, write_netcdf
from femimpact.integrators.cases import first_steps
from femimpact.integrators.methods import Method, read_at_least
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.operators import shortest_contact
from femimpact.response.impacts import DRAWN_IN_CONTACT, STICKING_UNITS, impact_columns
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import glue_impactors
from femimpact.sweep.curve import IMPACT_UNITS, SWEEP_UNITS, on_grid
from femimpact.sweep.sweep import frequency_sweep
from femimpact.system.modes import Modes, solve_modes
from femimpact.system.state import State

MODES_LISTED = 4


Report = Callable[[str, float], None]
"""Called with what is being done and the share of it that is done."""


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
    """The history of the study, with snapshots over its last cycles."""
    study, record = prepared.study, prepared.record
    return integrate(
        prepared.small, study.excitation, prepared.method, study.history_duration, record, study.initial,
        lambda share: report("history", share),
    )  # fmt: skip


def last_cycles(prepared: PreparedStudy, response: Response) -> Response:
    """The last 40 cycles of the study's history with every step kept, bit for bit as in the run: for figures.

    Where the history kept every step itself these are its last rows; else the run goes on once more from the state
    that it kept there. A method that keeps none makes the run once more.
    """
    study, method, record = prepared.study, prepared.method, prepared.record
    start, duration = last_cycles_start(study), study.history_duration
    grid = method.time_grid(prepared.small, study.excitation, duration, record)
    steps = round(duration / grid)
    finely, interval = _read_within_contacts(prepared, grid)
    if record.every == 1 and finely == method and interval == record.interval:
        first = first_steps(replace(record, start=start), steps, grid)[0]
        channels = {name: values[first:] for name, values in response.channels.items()}
        return replace(response, time=response.time[first:], channels=channels, energy=None, snapshots=None)
    initial = response.kept_state or study.initial
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


def run_sweep(
    prepared: PreparedStudy, report: Report = _silent, initial: State | None = None, ledger: bool = True
) -> SweepPair:
    """Sweeps without and with balls: the even grid, refined around both resonances.

    Without a ledger no energy residual is known.
    """
    study, small, bare = prepared.study, prepared.small, prepared.bare
    plan = study.sweep
    require(plan is not None, "sweep", None, "", "table [sweep] is missing")
    if plan is None:
        raise AssertionError("require raises")
    method, bare_method, level = prepared.method, prepared.bare_method, study.sweep_level
    coarse = even_grid(plan)
    state = initial or study.initial
    peak_with_ball = None
    if plan.refine and small.contacts:
        first = frequency_sweep(
            small, frequencies=coarse, method=method, cycles=plan.cycles, initial=state, ledger=False, **level,
            progress=lambda share: report(f"sweep with {prepared.carried}, even grid", share),
        )  # fmt: skip
        peak_with_ball = first.peak_frequency
    frequencies = refined_grid(plan, bare, peak_with_ball)
    without_balls = State(state.displacement, state.velocity, frame=state.frame, equilibrium=state.equilibrium)
    empty = frequency_sweep(
        bare, frequencies=frequencies, method=bare_method, cycles=plan.cycles, initial=without_balls, ledger=ledger,
        **level,
        progress=lambda share: report(f"sweep without {prepared.carried}", share),
    )  # fmt: skip
    ball = None
    if small.contacts:
        ball = frequency_sweep(
            small, frequencies=frequencies, method=method, cycles=plan.cycles, initial=state, ledger=ledger, **level,
            progress=lambda share: report(f"sweep with {prepared.carried}", share),
        )  # fmt: skip
    return SweepPair(empty, ball, coarse)


@dataclass(frozen=True, eq=False)
class Found:
    """Results of the parts of a run that are done; None for the others."""

    modes: tuple[Modes, Modes | None] | None = None  # (Modes, Modes or None) as of `run_modes`
    response: Response | None = None
    sweeps: SweepPair | None = None
    starts: Mapping[str, Any] = field(default_factory=dict)  # of the summary: medians and ranges over several starts


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
    prepared = prepare(study, parts)
    run = [part for part in parts if part != "sweep" or study.sweep is not None]
    with new_results(directory, force) as folder:
        found = Found()
        keep_study(folder, study)
        if "modes" in run:
            found = replace(found, modes=run_modes(prepared))
            keep_modes(folder, prepared, found, [part for part in run if part != "modes"])
        if "simulate" in run:
            found = replace(found, response=run_simulation(prepared, report))
            left = [part for part in run if part == "sweep"]
            found = keep_history(folder, prepared, found, left)
            found = _with_history_starts(prepared, found, report)
            if found.starts:
                # so that the ranges stay with the history, should the run end now
                _finish(folder, prepared, found, left)
        if "sweep" in run:
            found = replace(found, sweeps=run_sweep(prepared, report))
            keep_sweeps(folder, prepared, found)
            found = _with_sweep_starts(folder, prepared, found, report)
        drawn = keep_pictures(folder, directory, prepared, found, report)
    if study.output.report:
        add_report(directory, report, study, drawn)
    return load(directory)


def _with_history_starts(prepared: PreparedStudy, found: Found, report: Report) -> Found:
    """The same with medians and ranges of the history, where the study has several starts."""
    if runs_of_starts(prepared.small, prepared.study.output.starts) == 1:
        return found
    spreads, failed = drawn_histories(prepared, report)
    return replace(found, starts={**found.starts, "history_starts": spreads, **_failed(found, "history", failed)})


def _with_sweep_starts(folder: Path, prepared: PreparedStudy, found: Found, report: Report) -> Found:
    """The same of the sweep, whose bands are written."""
    plan, sweeps, start = prepared.study.sweep, found.sweeps, prepared.study.start
    if plan is None or sweeps is None or runs_of_starts(prepared.small, plan.starts) == 1:
        return found
    curves, failed = drawn_curves(prepared, sweeps.empty, report)
    write_curves(folder, {start: curves})
    step = float(sweeps.coarse[1] - sweeps.coarse[0])
    spreads = {name: asdict(spread) for name, spread in spreads_of(curves, sweeps.empty, step).items()}
    several = {"starts": {start: spreads}, "starts_of_sweep": curves.starts, **_failed(found, "sweep", failed)}
    return replace(found, starts={**found.starts, **several})


def _failed(found: Found, part: str, failed: Mapping[str, str]) -> dict[str, Any]:
    """The starts of a part that failed, with the reason of each, beside those of the parts before; none without any."""
    return {"failed_starts": {**found.starts.get("failed_starts", {}), part: dict(failed)}} if failed else {}


def _summary(prepared: PreparedStudy, found: Found) -> dict[str, Any]:
    """The summary of what there is, with a warning of the starts that failed."""
    summary = summary_of(prepared, found.modes, found.response, found.sweeps) | dict(found.starts)
    texts = [
        f"{part}: {len(failed)} of the further starts failed and are in no range; {name}: {why}"
        for part, failed in found.starts.get("failed_starts", {}).items()
        for name, why in list(failed.items())[:1]
    ]
    return summary | {"warnings": [*summary["warnings"], *texts]}


# ---- what is kept of a run, in the order in which it is written -----------------------------------


def keep_study(folder: Path, study: Study) -> None:
    """Write the study file, that of the study as it is run, and the record that it names."""
    if study.record is not None:
        name, path = FILES["base_record"].name, folder / FILES["study"].name
        atomic_write(folder / name, study.source["content"])
        study = replace(with_record(study, name), path=path)
    atomic_write(folder / FILES["study"].name, study_text(study))


def keep_modes(folder: Path, prepared: PreparedStudy, found: Found, left: Sequence[str] = ()) -> None:
    """Write what `run_modes` found; `left` names the parts of the run that are still to come."""
    if found.modes is None:
        raise AssertionError("there are modes to keep")
    full, study, (modes, glued) = prepared.full, prepared.study, found.modes
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
    write_csv(folder / FILES["modes"].name, columns, units)
    write_mode_shapes(folder / FILES["mode_shapes"].name, full, modes)
    if study.output.paraview:
        from femimpact import vtk

        vtk.write_modes(new_file(folder, "modes_scene"), full, modes, study.structure)
        # a rigid motion has no period to be shown over
        for mode in (1 + np.flatnonzero(modes.natural_frequency > 0.0)).tolist():
            vtk.write_mode(new_file(folder, f"mode_{mode}_scene"), full, modes, study.structure, mode)
    _finish(folder, prepared, found, left)


def keep_history(folder: Path, prepared: PreparedStudy, found: Found, left: Sequence[str] = ()) -> Found:
    """Write what `run_simulation` found; what the files for ParaView leave out is a warning of what is returned."""
    if found.response is None:
        raise AssertionError("there is a history to keep")
    response = found.response
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        _write_history(prepared.study, folder, response)
    # the same of both files
    texts = dict.fromkeys(f"{one.message}" for one in caught if issubclass(one.category, UserWarning))
    left_out = [f"{scene}: {text}" for scene in _deflection_scenes(prepared.study)[-1:] for text in texts]
    found = replace(found, response=replace(response, warnings=(*response.warnings, *left_out)))
    _finish(folder, prepared, found, left)
    return found


def keep_sweeps(folder: Path, prepared: PreparedStudy, found: Found, left: Sequence[str] = ()) -> None:
    """Write what `run_sweep` found."""
    import xarray

    if found.sweeps is None:
        raise AssertionError("there are sweeps to keep")
    sweeps = found.sweeps
    curves = {"empty": sweeps.empty, **({"ball": sweeps.ball} if sweeps.ball is not None else {})}
    frequency = sweeps.empty.frequency
    columns: dict[str, Any] = {"frequency": frequency}
    units = {"frequency": "Hz"}
    columns["grid"] = np.where(on_grid(frequency, sweeps.coarse), "even", "refined")
    for label, curve in curves.items():
        for name in (*SWEEP_UNITS, "steadiness"):
            if label == "empty" and name in IMPACT_UNITS:
                continue
            columns[f"{label}_{name}"] = getattr(curve, name)
            units[f"{label}_{name}"] = SWEEP_UNITS.get(name, "")
    write_csv(folder / FILES["sweep"].name, columns, units)
    data = xarray.concat(
        [curve.to_xarray() for curve in curves.values()],
        xarray.Variable("case", list(curves)),
        combine_attrs="override",
    )
    data = data.assign_coords(grid=("frequency", columns["grid"]))
    laws = "; ".join(f"{label}: {curve.law}" for label, curve in curves.items())
    write_netcdf(folder / FILES["sweep_data"].name, data.assign_attrs(contact_law=laws))
    _finish(folder, prepared, found, left)


def keep_pictures(
    folder: Path,
    directory: str | Path,  # that it will be
    prepared: PreparedStudy,
    found: Found,
    report: Report = _silent,
    more: Mapping[str, Any] | None = None,  # what the summary says besides
) -> dict[str, Element]:
    """Write what the figures show besides, draw, and write the summary of it all; the figures, for a page."""
    output, summary = prepared.study.output, _summary(prepared, found) | dict(more or {})
    touched = found.response is not None and bool(found.response.system.contacts)
    if output.figures and found.response is not None and touched:
        report("last cycles, for figures", 0.0)
        end = last_cycles(prepared, found.response)
        write_last_cycles(folder / FILES["last_cycles"].name, found.response, end)
        report("last cycles, for figures", 1.0)
    filmed = found.response is not None and found.response.snapshots is not None
    # a history without contacts has no figure
    beside = found.modes is not None or found.sweeps is not None or found.response is None
    figured = output.figures and (touched or beside)
    kinds = [*(["figures"] if figured else []), *(["movie"] if output.movie and filmed else [])]
    drawn = dict[str, Element]()
    if kinds:
        ended = dict.fromkeys(kinds, "the run was ended before")
        # what they are drawn from stays with the results, should the run end now
        write_summary(folder, with_pictures(summary, ended, directory))
        failures, drawn = draw_kinds(folder, kinds, report, prepared.study)
        summary = with_pictures(summary, failures, directory)
    write_summary(folder, summary)
    return drawn


def _finish(folder: Path, prepared: PreparedStudy, found: Found, left: Sequence[str]) -> None:
    """Write the summary of what there is so far: from here on its files are kept, whatever happens to the rest."""
    summary = _summary(prepared, found)
    if left:
        summary["unfinished"] = list(left)
        text = f"the run was ended before its part{'s' if len(left) > 1 else ''} {' and '.join(left)}"
        summary["warnings"] = [*summary["warnings"], text]
    write_summary(folder, summary)


def _write_history(study: Study, folder: Path, response: Response) -> None:
    write_netcdf(folder / FILES["history"].name, response.to_xarray())
    _write_impacts(folder, response)
    if response.snapshots is None:
        return
    write_snapshots(folder / FILES["snapshots"].name, response)
    for scene in _deflection_scenes(study):
        from femimpact import vtk

        vtk.write_deflection(new_file(folder, scene), response, study.structure, study.output.exaggeration or 1.0)


def _deflection_scenes(study: Study) -> list[str]:
    """Names of the files for ParaView; the last one is the one that its script opens."""
    output = study.output
    scenes = {FILES["deflection_hdf"].name: output.vtkhdf, FILES["deflection_scene"].name: output.paraview}
    return [name for name, written in scenes.items() if written]


def _write_impacts(folder: Path, response: Response) -> None:
    write_csv(folder / FILES["impacts"].name, *impact_columns(response.impacts))
    write_netcdf(folder / FILES["impact_data"].name, response.impacts.to_xarray())
    if len(response.sticking):
        sticking = {name: getattr(response.sticking, name) for name in STICKING_UNITS}
        write_csv(folder / STICKING_FILE, sticking, STICKING_UNITS)
