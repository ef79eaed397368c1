"""`femimpact study`: the parameter study of a study file, its table, figures, cost and summary."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.app.parametric.best import best_cases, check_best
from femimpact.app.parametric.best_design import BestCase
from femimpact.app.parametric.dataset import endings_of, level_remarks
from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.measures import Source
from femimpact.app.parametric.paths import Stage, study_with
from femimpact.app.parametric.runs import evaluated, run_case
from femimpact.app.parametric.verb import StudyProgress, block_cases, connected, run_parameter_study, to_stderr
from femimpact.app.report.markup import Element
from femimpact.app.report.result_page import add_report, best_measures
from femimpact.app.report.views import measures_of, save_pictures
from femimpact.app.results.result_directory import BEST_FIGURE, FILES, ResultFileWarning
from femimpact.app.study.prepared import START, history_cost
from femimpact.app.study.start import PartStart, state_of
from femimpact.app.study.study import Study
from femimpact.app.study.study_file import study_text, with_record
from femimpact.app.tasks.task import Plan, study_files, write_files
from femimpact.errors import Fault, InputError, faults_under, require
from femimpact.files import atomic_write, dataset_columns
from femimpact.integrators.cases import cores
from femimpact.integrators.methods import bytes_of_cycle, seconds_of_cycle
from femimpact.response.response import Recorder
from femimpact.units import counted, number_text

if TYPE_CHECKING:
    import xarray


SECONDS_OF_MODES = 0.006
"""Making a system with other modes, s."""

SECONDS_OF_FIGURE = 0.5
"""Drawing a measure, s."""

COLUMN_BYTES = 8.0
"""Bytes of a number; the rest of a row takes as much as eight numbers."""

BYTES_OF_BLOCK, BYTES_OF_FILE, BYTES_OF_VARIABLE = 1300.0, 14e3, 1400.0
"""On disk, beside the numbers: of a block, of the description of the study, and of a variable of the dataset."""

BYTES_OF_LEVEL, BYTES_OF_TEXT = 50.0, 19.0
"""On disk, of a value of an axis of a list or a sample, and of a number of the table."""

BYTES_OF_FIGURE, BYTES_OF_REPORT, CASES_OF_REPORT = 1e5, 1.2e5, 500
"""On disk, of a figure, and of a measure in the report of so many cases or more."""

AT_ONCE = 256
"""Runs of a block that are in memory."""

RUN_FACTOR = 2.5
"""Time of a run with its history over that of the same in a compiled call with others."""


def definition_of(study: Study) -> ParameterStudy:
    """The parameter study of a study file.

    Raises `InputError` if the file has none, or a path or a measure in it is unknown.
    """
    require(study.plan is not None, "study", None, "", "table [study] is missing from the study")
    plan: Any = study.plan
    try:
        cases = ParameterStudy(
            study, plan.axes, plan.measures, starts=plan.starts, seed=plan.seed, sample=plan.sample, cycles=plan.cycles
        )
    except InputError as error:
        raise InputError([_in_file(study, fault) for fault in error.faults]) from None
    if plan.best is not None:
        known = {one.name: one.better for one in cases.chosen if not one.is_text}
        with faults_under("study.best"):
            check_best(plan.best.measure, plan.best.worst_over, plan.best.limits, tuple(plan.axes), known)
    return cases


def _in_file(study: Study, fault: Fault) -> Fault:
    """A fault with the key that it has in the study file."""
    plan: Any = study.plan
    if fault.key in plan.axes:
        return fault.under("study.axes")
    return fault.under("study") if fault.key in ("measures", "axes", "sample") else fault


def write_parameter_study(
    study: Study,
    directory: Path,  # goes on from what an earlier call has left there
    progress: Callable[[StudyProgress], None] | None = None,  # None is silence
    scheduler: str | None = None,  # address or scheduler file of a cluster on which the cases run
) -> xarray.Dataset:
    """Run the parameter study of a study file and leave `study.nc`, `study.csv`, `study.toml`, figures and a report.

    Raises `InputError` as of `parameter_study`.
    """
    definition = definition_of(study)
    with nullcontext() if scheduler is None else connected(scheduler) as client:
        dataset = run_parameter_study(
            definition, directory=directory, client=client, progress=progress, say=to_stderr if progress else None
        )
    write_files(directory, study_files(study) | {"parameter_table": dataset_columns(dataset)})
    plan: Any = study.plan
    best, _ = best_cases(dataset, plan.best)
    _write_best(definition, next(iter(best.values()), None), directory)
    drawn = _drawn(dataset, best, directory) if study.output.figures else {}
    if study.output.report:
        add_report(directory, lambda part, share: None, study, drawn)
    return dataset


def _write_best(definition: ParameterStudy, best: BestCase | None, directory: Path) -> None:
    """The study with the values of the best case, where there is one, to be run: `best.toml`."""
    path = directory / FILES["best_study"].name
    path.unlink(missing_ok=True)
    design = next((one for one in best.designs if one.case >= 0), None) if best is not None else None
    if design is None:
        return
    study: Any = definition.study
    places = definition.table.values(design.case)
    # a study without a file that says the same, or another drive
    with suppress(InputError, ValueError):
        chosen = replace(study_with(study, places), plan=None)
        if definition.has_cycle:
            chosen = replace(chosen, duration=definition.dwell / chosen.sine.frequency)
        if chosen.start == "base":
            chosen = replace(chosen, begins=_worst_begins(definition, chosen, best, design.case))
        atomic_write(path, study_text(_moved(chosen, directory)))


def _worst_begins(definition: ParameterStudy, study: Study, best: Any, case: int) -> tuple[PartStart, ...]:
    """The tables [[start]] of the study of a case: its balls begin as in the worst of its starts."""
    kept, start = [part for part in study.begins if part.ball is None], 0
    if definition.starts > 1:
        measure = [item.name for item in definition.chosen].index(best.measure)
        values = evaluated(definition, np.array([case], dtype=np.int64)).values[0, :, measure]
        start = int(np.nanargmax(values if best.better == "small" else -values))
    elif not any(place.owner == "start" for place in definition.places):
        return study.begins
    names = [pair.name for pair in definition.nominal.balls]
    channels = tuple(name for ball in names for name in (ball, f"{ball}.velocity"))
    run = run_case(definition, case, start, Recorder(channels))
    moving = state_of(kept, run.system).relative_to_base(run.system, run.base)[:2]
    for pair in run.system.balls:
        relative = [run[pair.name][0], run[f"{pair.name}.velocity"][0]] - np.array(moving) @ pair.direction
        kept.append(PartStart(ball=pair.name, displacement=float(relative[0]), speed=float(relative[1])))
    return tuple(kept)


def _moved(study: Study, directory: Path) -> Study:
    """The study with the paths of its mesh and its record from another directory."""
    here = os.path.relpath(study.path.parent, directory)
    if study.mesh.file is not None:
        study = replace(study, mesh=replace(study.mesh, file=os.path.join(here, study.mesh.file)))
    return study if study.record is None else with_record(study, os.path.join(here, study.record))


def _drawn(dataset: xarray.Dataset, best: Mapping[str, BestCase], directory: Path) -> dict[str, Element]:
    """Figures of the best case, and of every measure that is a number and has a value, for a page."""
    (directory / BEST_FIGURE).unlink(missing_ok=True)
    drawn, failures = save_pictures([*best_measures(dataset, best), *measures_of(dataset)], directory)
    for text in failures:
        warnings.warn(f"not drawn: {text}", ResultFileWarning, stacklevel=3)
    return drawn


def plan_of_cases(study: Study) -> Plan:
    """Number of cases, time, memory and disk space of the parameter study of a study file.

    Raises `InputError` as of `definition_of`.
    """
    cases = definition_of(study)
    seconds, memory = _cost(cases, study)
    drawn = START + (SECONDS_OF_FIGURE * len(cases.chosen) if study.output.figures else 0.0)
    dwell, table = cases.dwell, cases.table
    shape = " x ".join(map(str, table.shape)) if table.is_grid else f"{table.size} of a sample"
    length = f"{dwell} cycles, of which {dwell // 3} are measured" if dwell else study.history_words
    runs = f"study: {counted(table.size, 'case')} ({shape}), {counted(cases.starts, 'start')} each, {length}"
    cost = (
        f"study takes about {number_text(seconds + drawn, 2)} s on one core, "
        f"{number_text(seconds / cores() + drawn, 2)} s on {cores()}, "
        f"{number_text(max(memory, 1e6) / 1e6, 3)} MB of memory and {number_text(_disk(cases, study) / 1e6, 2)} MB "
        "on disk"
    )
    return Plan((runs, cost, *(f"study: {text}" for text in level_remarks(cases))))


def _cost(cases: ParameterStudy, study: Study) -> tuple[float, float]:
    """Time (s) of all runs on one core, and memory (bytes)."""
    method, table = cases.systems.method_of(cases.nominal, {}), cases.table
    of_cycle = partial(seconds_of_cycle, method, cases.nominal, study.excitation.frequency)
    seconds, memory = of_cycle(sweep=True) * cases.dwell, bytes_of_cycle(method) * AT_ONCE * cases.dwell
    if not cases.has_cycle:
        history = history_cost(study, cases.nominal, method, Recorder((str(cases.observed),)), 1)
        seconds, memory = RUN_FACTOR * (history.seconds - START), history.memory * cores()
    elif any(measure.source is Source.RUN for measure in cases.chosen):
        seconds += RUN_FACTOR * of_cycle() * cases.dwell
    own_modes = [codes.tolist() for codes, at in zip(table.codes, table.places, strict=True) if at.stage is Stage.MODES]
    systems = len(set(zip(*own_modes, strict=True)))
    numbers = len(cases.chosen) * len(endings_of(cases.starts))
    return seconds * cases.runs + SECONDS_OF_MODES * systems, memory + COLUMN_BYTES * table.size * (numbers + 8)


def _disk(cases: ParameterStudy, study: Study) -> float:
    """Bytes of all that a study leaves."""
    size, names, axes = cases.table.size, len(cases.chosen), len(cases.table.places)
    variables = names * len(endings_of(cases.starts)) + 4
    blocks = BYTES_OF_FILE + BYTES_OF_BLOCK * len(block_cases(cases)) + cases.runs * (COLUMN_BYTES * names + 5.0)
    listed = 0.0 if cases.table.is_grid else BYTES_OF_LEVEL * size * axes
    dataset = BYTES_OF_FILE + BYTES_OF_VARIABLE * variables + COLUMN_BYTES * size * (variables + 2)
    table = BYTES_OF_TEXT * size * (variables - 4 + axes)
    figures = BYTES_OF_FIGURE * names if study.output.figures else 0.0
    report = BYTES_OF_REPORT * names * min(size / CASES_OF_REPORT, 1.0) if study.output.report else 0.0
    return blocks + listed + dataset + table + figures + report
