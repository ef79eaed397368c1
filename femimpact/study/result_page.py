"""The report of a directory of results, made from its files: what cannot be read is named in it, and stops nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from femimpact.export.report.blocks import Conclusion
from femimpact.export.report.page import Page
from femimpact.export.report.structure_drawing import structure_element
from femimpact.export.report.structure_parts import place_finder, placed_contacts, structure_words
from femimpact.structure.structure import Structure
from femimpact.study.parameter_words import (
    study_conclusions,
    study_failures,
    study_lead,
    study_missing,
    study_versions,
)
from femimpact.study.picture_data import read_parts
from femimpact.study.result_conclusions import conclusions_of, convergence_conclusions
from femimpact.study.result_directory import unfinished_state
from femimpact.study.result_files import FILES, OTHER_FILES, STUDY_BLOCKS, SUMMARY, is_folder
from femimpact.study.result_list import about_section, files_section
from femimpact.study.result_reading import ResultReading, texts_of
from femimpact.study.result_sections import SECTIONS
from femimpact.study.results import read_json, read_summary
from femimpact.study.study import Study
from femimpact.study.study_file import load_study

__all__ = ["page_of"]


def page_of(folder: Path, directory: Path) -> Page:
    """The report of results.

    Parameters
    ----------
    folder : Path
        That holds their files.
    directory : Path
        The one that the user knows: that folder, or the one in which it stands while a run is not finished.
    """
    results = ResultReading(folder, {})
    if (folder / SUMMARY).exists():
        results.summary.update(results.attempt(SUMMARY, lambda: read_summary(folder)) or {})
    state = results.attempt("directory", lambda: unfinished_state(directory))
    if state:
        results.miss(state.replace(str(directory), "DIR"))
    summary, written = results.summary, _convergence_summary(results)
    study = _study(results)
    name, structure, finder, contacts = _structure(results, study, written)
    made_of = [results.attempt(words, partial(make, results)) or [] for words, make in SECTIONS]
    sections = [section for several in made_of for section in several]
    drawing = None
    if structure is not None and finder is not None:
        made, find, placed = structure, finder, contacts
        drawing = results.attempt("drawing of the structure", lambda: structure_element(made, find, placed))
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
    title = name if structure is None else f"{name}: {structure_words(structure, contacts)}"
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
) -> tuple[str, Structure | None, Any, tuple[Any, ...]]:
    """Name of the study, structure, what finds a place of it, and its contacts."""
    named = results.summary.get("study", written.get("study"))
    name = (
        str(named).removesuffix(".toml") if named else "study" if results.parameter_study is None else "parameter study"
    )
    modes = results.modes
    points = {} if modes is None else dict(modes[0].points)
    if study is not None:
        finder = place_finder(study.structure, points)
        placed = results.attempt("places of the structure", lambda: placed_contacts(study.structure, finder))
        return name, study.structure, finder, placed or ()
    if modes is not None and modes[2] is not None:
        return name, modes[2], place_finder(modes[2], points), tuple(modes[0].contacts)
    if "structure" in written:
        parts = results.attempt(OTHER_FILES["convergence_notes"], lambda: read_parts(written["structure"]))
        if parts is not None:
            made, places, contacts = parts
            return name, made, place_finder(made, places), contacts
    return name, None, None, ()


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
    return _Studied(
        tuple(results.attempt(name, lambda: study_lead(data)) or ()),
        results.attempt(name, lambda: study_conclusions(data)) or (),
        results.attempt(name, lambda: study_failures(data)) or (),
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
