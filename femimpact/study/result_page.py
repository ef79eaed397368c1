"""The report of a directory of results, made from its files: what cannot be read is named in it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.errors import require, require_path
from femimpact.export.placed import DrawnSystem, drawn_system, placed_structure
from femimpact.export.report.page import Conclusion, Page, write_page
from femimpact.export.report.structure_drawing import structure_element, structure_words
from femimpact.export.tables import (
    SHOWN,
    axis_names,
    axis_words,
    measure_names,
    single_samples,
    unit_text,
    value_words,
)
from femimpact.structure.structure import Structure
from femimpact.study.best_case import MOST_NAMED, BestCase, best_cases, design_notes, label_of, more_designs, told
from femimpact.study.picture_data import read_parts, read_run_parts
from femimpact.study.result_conclusions import ResultReading, conclusions_of, convergence_conclusions, texts_of
from femimpact.study.result_directory import (
    FILES,
    OTHER_FILES,
    REPORT,
    STUDY_BLOCKS,
    SUMMARY,
    ResultsWarning,
    finished_parts,
    is_folder,
    result_files,
    unfinished_state,
    update_results,
)
from femimpact.study.result_sections import SECTIONS, about_section, files_section
from femimpact.study.results import read_json, read_summary
from femimpact.study.study import Study
from femimpact.study.study_file import load_study
from femimpact.svg import number_text
from femimpact.system.system import System

if TYPE_CHECKING:
    import xarray

MOST_NAMES = 20
"""Values of an axis of names that are listed."""

MOST_MEASURES = 8
"""Measures that have conclusions."""

NO_BEST_CASES: Mapping[str, BestCase] = {}


def study_lead(data: xarray.Dataset) -> list[str]:
    """What was studied, in sentences."""
    sizes, starts = tuple(data["finished"].sizes.values()), int(data.attrs["starts"])
    shape = f" ({' x '.join(map(str, sizes))})" if len(sizes) > 1 else ""
    each = f"{starts} starts each" if starts > 1 else "one start each"
    run = "a case is a run of the whole history of the base"
    if "cycles" in data.attrs:
        cycles, measured = (int(data.attrs[name]) for name in ("cycles", "measured_cycles"))
        run = f"{cycles} cycles of the base, of which the last {measured} are measured"
    return [
        f"Parameter study: {int(np.prod(sizes))} cases{shape}, {each}; {run}, at {data.attrs['place']}.",
        f"Axes: {'; '.join(_axes(data))}.",
    ]


def _axes(data: xarray.Dataset) -> Iterator[str]:
    """Every axis with its reach."""
    for name in axis_names(data):
        words, names, found = axis_words(data, name), value_words(data, name), data[name].to_numpy()
        if names is not None:
            distinct = list(dict.fromkeys(names))
            more = f" and {len(distinct) - MOST_NAMES} more" if len(distinct) > MOST_NAMES else ""
            yield f"{words}: {'; '.join(distinct[:MOST_NAMES])}{more}{_unit_of_words(data, name)}"
            continue
        low, high = (_text(value, data[name].attrs) for value in (found.min(), found.max()))
        yield f"{words}: {low} to {high}, {np.unique(found).size} values"


def _unit_of_words(data: xarray.Dataset, name: str) -> str:
    """Unit of the words of an axis, which pairs of gaps alone have."""
    return " mm" if f"{name}.plus" in data.coords else ""


def study_conclusions(data: xarray.Dataset, best: Mapping[str, BestCase] = NO_BEST_CASES) -> tuple[Conclusion, ...]:
    """The best case by every measure that has one, else its smallest and its largest value; where they are.

    The first has all that is known of it, each its scatter.
    """
    samples, starts = single_samples(data), int(data.attrs["starts"])
    names = [name for name in measure_names(data) if name not in best]
    found = [one for name in best for one in _of_best(data, best[name], name == next(iter(best)))]
    found = found[:MOST_MEASURES]
    for name in names[: MOST_MEASURES - len(found)]:
        values = data[name]
        array = values.to_numpy()
        least, most = (
            np.unravel_index(int(find(array)), array.shape) for find in (np.nanargmin, np.nanargmax)
        )  # fmt: skip
        factor, unit = SHOWN.get(values.attrs.get("units", "1"), (1.0, values.attrs.get("units", "1")))
        scatter = ""
        if starts > 1 and f"{name}_low" in data:
            low, high = (_text(data[f"{name}{end}"].to_numpy()[least], values.attrs) for end in ("_low", "_high"))
            scatter = f"{low} to {high} over {starts} starts"
        found.append(
            Conclusion(
                f"Smallest {name.replace('_', ' ')}", number_text(factor * float(array[least]), zeros=True),
                "" if unit == "1" else unit, scatter, bool(samples[least]) and not scatter,
                f"at {_place(data, values.dims, least)}; the largest is {_text(array[most], values.attrs)}, "
                f"at {_place(data, values.dims, most)}",
            )
        )  # fmt: skip
    return tuple(found)


def _of_best(data: xarray.Dataset, best: BestCase, all_of_it: bool) -> Iterator[Conclusion]:
    """The best design, for each value of the excitation's other axes; of many the first ones."""
    names = {axis: axis_words(data, axis) for axis in axis_names(data)}
    values, starts, samples = data[best.measure], best.starts, single_samples(data).reshape(-1)
    array = values.to_numpy()
    factor, unit = SHOWN.get(values.attrs.get("units", "1"), (1.0, values.attrs.get("units", "1")))
    other, find = ("smallest", np.nanargmin) if best.better == "large" else ("largest", np.nanargmax)
    most = np.unravel_index(int(find(array)), array.shape)
    rest = f"the {other} is {_text(array[most], values.attrs)}, at {_place(data, values.dims, most)}"
    shown = best.designs[:MOST_NAMED]
    for design in shown:
        level = f"for {told(best, design.at, names)}: " if design.at else ""
        if design.reason:
            yield Conclusion(label_of(best).capitalize(), "none", note=f"{level}{design.reason}")
            continue
        scatter = ""
        if starts > 1 and f"{best.measure}_low" in data:
            low, high = (
                _text(data[f"{best.measure}{end}"].to_numpy().reshape(-1)[design.case], values.attrs)
                for end in ("_low", "_high")
            )
            scatter = f"{low} to {high} over {starts} starts"
        notes = [*design_notes(best, design, names)] if all_of_it else []
        notes += [more_designs(best)] if design is shown[-1] and more_designs(best) else []
        yield Conclusion(
            label_of(best).capitalize(), number_text(factor * design.value, zeros=True), "" if unit == "1" else unit,
            scatter, bool(samples[design.case]) and not scatter,
            "; ".join((f"{level}at {told(best, design.values, names)}", rest, *notes)),
        )  # fmt: skip


def _place(data: xarray.Dataset, dims: tuple[Any, ...], index: Any) -> str:
    """Values of the axes of a case."""
    chosen = dict(zip(dims, (int(i) for i in index), strict=True))
    return ", ".join(_value(data.isel(chosen), name) for name in axis_names(data))


def _value(one: xarray.Dataset, name: str) -> str:
    """The value of an axis in one case."""
    names = value_words(one, name)
    shown = _text(one[name].item(), one[name].attrs) if names is None else f"{names[0]}{_unit_of_words(one, name)}"
    return f"{axis_words(one, name)} {shown}"


def _text(value: Any, attributes: Mapping[str, Any]) -> str:
    """A value with its unit."""
    return unit_text(value, attributes.get("units", "1"))


def study_missing(data: xarray.Dataset) -> tuple[str, ...]:
    """What of the cases has not been run."""
    finished = data["finished"].to_numpy()
    left = int(np.count_nonzero(finished == 0))
    if not left:
        return ()
    return (f"{left} of {finished.size} cases: the study was not finished; the same femimpact study goes on with it",)


def study_failures(data: xarray.Dataset) -> tuple[str, ...]:
    """How many cases have starts without values, and why the first of them has."""
    failed = data["failed_starts"].to_numpy()
    if not failed.any():
        return ()
    first = next((str(reason) for reason in data["failure"].to_numpy().ravel() if reason), "not known")
    return (f"{int(np.count_nonzero(failed))} of {failed.size} cases have starts that failed, the first: {first}",)


def study_versions(data: xarray.Dataset) -> dict[str, Any]:
    """Versions and seeds of a study, by the names that a summary has for them."""
    versions = {name: data.attrs[name] for name in ("femimpact", "numpy", "scipy", "python") if name in data.attrs}
    starts = int(data.attrs["starts"])
    seeds = [f"{data.attrs['seed']} of the {starts} starts"] if starts > 1 else []
    seeds += [f"sample: {data.attrs['sample']}"] if "sample" in data.attrs else []
    return {"versions": versions, "seeds": "; ".join(seeds)}


def page_of(
    folder: Path,  # that holds their files
    # the one that the user knows: that folder, or the one in which it stands while a run is not finished
    directory: Path,
) -> Page:
    """The report of results."""
    results = ResultReading(folder, {})
    if (folder / SUMMARY).exists():
        results.summary.update(results.attempt(SUMMARY, lambda: read_summary(folder)) or {})
    state = results.attempt("directory", lambda: unfinished_state(directory))
    if state:
        results.miss(state.replace(str(directory), "DIR"))
    summary, written = results.summary, _convergence_summary(results)
    study = _study(results)
    name, structure, system = _structure(results, study, written)
    made_of = [results.attempt(words, partial(make, results)) or [] for words, make in SECTIONS]
    sections = [section for several in made_of for section in several]
    drawing = None
    if structure is not None and system is not None:
        given = structure, system
        drawing = results.attempt("drawing of the structure", lambda: structure_element(placed_structure(*given)))
    conclusions = results.attempt("conclusions", lambda: conclusions_of(summary)) or ()
    conclusions = (
        *conclusions,
        *(
            results.attempt(
                "conclusions",
                lambda: convergence_conclusions(
                    results.table(OTHER_FILES["convergence_summary"]), written.get("accuracy")
                ),
            )
            or ()
        ),
    )
    studied = _of_parameter_study(results, directory, study)
    sections.append(about_section(summary or written or studied.about, None if studied.many_starts else study))
    listed = results.attempt("list of files", lambda: files_section(folder, summary))
    if listed is not None:
        section, lost = listed
        sections.append(section)
        results.missing.extend(text for text in lost if text not in results.missing)
    title = name if structure is None else f"{name}: {structure_words(structure, system.contacts if system else ())}"
    return Page(
        title=title,
        lead=(*studied.lead, *_lead(study, summary, written)),
        drawing=drawing,
        conclusions=(*conclusions, *studied.conclusions),
        missing=tuple(results.missing),
        warnings=(*texts_of(summary.get("warnings")), *studied.failures),
        notes=(*texts_of(summary.get("notes")), *texts_of(written.get("notes"))),
        sections=tuple(sections),
    )


# ---- what was computed ----------------------------------------------------------------------------


def _study(results: ResultReading) -> Study | None:
    path = results.folder / FILES["study"]
    return results.attempt(FILES["study"], lambda: load_study(path)) if path.exists() else None


def _convergence_summary(results: ResultReading) -> dict[str, Any]:
    name = OTHER_FILES["convergence_notes"]
    return results.attempt(name, lambda: read_json(results.folder / name)) or {}


def _structure(
    results: ResultReading, study: Study | None, written: Mapping[str, Any]
) -> tuple[str, Structure | None, System | DrawnSystem | None]:
    """Name of the study, structure, and its places and contacts: neither its mesh nor its record is read again."""
    named = results.summary.get("study", written.get("study"))
    name = (
        str(named).removesuffix(".toml") if named else "study" if results.parameter_study is None else "parameter study"
    )
    stored = _stored_structure(results, written)
    if study is None:
        return name, *(stored or (None, None))
    points = stored[1].points if stored else {}
    placed = results.attempt("places of the structure", lambda: drawn_system(study.structure, points))
    return name, study.structure, placed


def _stored_structure(
    results: ResultReading, written: Mapping[str, Any]
) -> tuple[Structure, System | DrawnSystem] | None:
    """Structure, places and contacts from the first of the files that has them."""
    if results.modes is not None and results.modes[2] is not None:
        return results.modes[2], results.modes[0]
    for key in ("last_cycles", "snapshots"):
        found = results.attempt(FILES[key], partial(read_run_parts, results.folder, key, results.summary))
        if found is not None:
            return found
    if "structure" not in written:
        return None
    return results.attempt(OTHER_FILES["convergence_notes"], lambda: read_parts(written["structure"]))


@dataclass(frozen=True, eq=False)
class _Studied:
    """What a report says of a parameter study beside its sections; nothing where there is none."""

    lead: tuple[str, ...] = ()
    conclusions: tuple[Conclusion, ...] = ()
    failures: tuple[str, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)
    many_starts: bool = False


def _of_parameter_study(results: ResultReading, directory: Path, study: Study | None) -> _Studied:
    """What the dataset of a parameter study says; what it does not is among the missing."""
    data, name = results.parameter_study, OTHER_FILES["parameter_study"]
    if data is None:
        if is_folder(directory / STUDY_BLOCKS) and not (results.folder / name).exists():
            results.miss(f"{name}: the parameter study was not finished; the same femimpact study goes on with it")
        return _Studied()
    for text in results.attempt(name, lambda: study_missing(data)) or ():
        results.miss(text)
    about = results.attempt(name, lambda: study_versions(data)) or {}
    plan = None if study is None or study.plan is None else study.plan.best
    best, reasons = results.attempt(name, lambda: best_cases(data, plan)) or ({}, ())
    return _Studied(
        tuple(results.attempt(name, lambda: study_lead(data)) or ()),
        results.attempt(name, lambda: study_conclusions(data, best)) or (),
        (*reasons, *(results.attempt(name, lambda: study_failures(data)) or ())),
        about,
        int(data.attrs.get("starts", 1)) > 1,
    )


def _lead(study: Study | None, summary: Mapping[str, Any], written: Mapping[str, Any]) -> list[str]:
    """What was computed, in sentences."""
    if study is None:
        return [str(written["problem"])] if "problem" in written else []
    said = [f"History: {study.base.words}." if "history" in summary else ""]
    amplitude = getattr(study.base, "amplitude", None)
    base = f" The base moves by {1e3 * amplitude:.4g} mm." if amplitude is not None else ""
    if "sweep" in summary and study.sweep is not None:
        plan = study.sweep
        said.append(
            f"Sweep: {plan.start:g} to {plan.stop:g} Hz in {plan.points} steps, {plan.refine} more around each "
            f"resonance; {plan.cycles} cycles at each frequency."
        )
    kept = f"on {study.reduction.modes} modes" if study.reduction is not None else "in physical degrees of freedom"
    step = summary.get("step")
    steps = f", step {1e3 * step:.4g} ms" if isinstance(step, float) and step == step else ""
    said.append(f"Method: {study.method.get('name', 'newmark')} {kept}{steps}.{base}")
    return [text for text in said if text]


def write_report(
    directory: str | Path,
    path: str | Path | None = None,  # of the file; `report.html` beside the results without one
) -> Path:
    """Write the report of a directory of results.

    Results of an earlier version, damaged ones and the finished parts of a run that was ended make a report that says
    what is missing.

    Raises `InputError` if the directory holds no results, a run writes into it, or the file cannot be there.
    """
    require_path(directory, "directory", "a directory")
    folder = Path(directory)
    require(folder.is_dir(), "directory", str(folder), "", "must be a directory of results")
    parts = finished_parts(folder)
    source = folder if parts is None or set(result_files(folder)) - {REPORT} else parts
    some = bool(set(result_files(source)) - {REPORT}) or is_folder(folder / STUDY_BLOCKS)
    require(some, "directory", str(folder), "", "must hold results of a study: none of their files is there")
    page = page_of(source, folder)
    if path is not None:
        return write_page(Path(path), page)
    with update_results(folder) as staging:
        write_page(staging.folder / REPORT, page)
    return folder / REPORT


def add_report(directory: str | Path, report: Callable[[str, float], None]) -> None:
    """Write the report of a run that is done; what keeps it from being written is a warning, and the results stand."""
    report("report", 0.0)
    try:
        write_report(directory)
    # no result hangs on it
    except Exception as error:
        words = " ".join(str(error).split()) or type(error).__name__
        text = f"report not written: {words}; 'femimpact report {directory}' writes it"
        warnings.warn(text, ResultsWarning, stacklevel=3)
    report("report", 1.0)
