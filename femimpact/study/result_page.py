"""The report of a directory of results, made from its files: what cannot be read is named in it, and stops nothing."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from femimpact.export import tables
from femimpact.export.report.blocks import Section, Table, list_element, table_element, table_of
from femimpact.export.report.convergence import axis_section, steps_section, summary_table
from femimpact.export.report.impacts import impacts_section
from femimpact.export.report.mode_shapes import modes_section
from femimpact.export.report.motion import energy_section, history_section
from femimpact.export.report.page import Page
from femimpact.export.report.player import player_element
from femimpact.export.report.response_curves import curves_section
from femimpact.export.report.structure_drawing import structure_element
from femimpact.export.report.structure_parts import place_finder, placed_contacts, structure_words
from femimpact.structure.structure import Structure
from femimpact.study.picture_data import read_curves, read_film, read_last_cycles, read_mode_shapes, read_parts
from femimpact.study.result_conclusions import conclusions_of, convergence_conclusions
from femimpact.study.result_directory import ResultsWarning, unfinished_state
from femimpact.study.result_files import FILES, OTHER_FILES, SUMMARY
from femimpact.study.result_list import about_section, files_section
from femimpact.study.results import read_dataset, read_json, read_summary, read_table
from femimpact.study.study import Study
from femimpact.study.study_file import load_study
from femimpact.svg.elements import Element, element

if TYPE_CHECKING:
    import xarray

    from femimpact.system.modes import Modes
    from femimpact.system.system import System

__all__ = ["page_of"]

T = TypeVar("T")

CASES = {"empty": "without ball", "ball": "with ball"}


@dataclass(frozen=True, eq=False)
class _Results:
    """A directory of results while it is read.

    Parameters
    ----------
    folder : Path
        With the files.
    summary : dict
        Empty where there is none.
    missing : list of str
        What could not be read, and why.
    """

    folder: Path
    summary: dict[str, Any]
    missing: list[str] = field(default_factory=list)

    def attempt(self, what: str, make: Callable[[], T]) -> T | None:
        """What `make` returns; None, and a line of what is missing, where it fails."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                found: T | None = make()
            # what damaged results make a reader raise is without limit, and a report is made of the rest
            except Exception as error:
                words = " ".join(str(error).split()) or type(error).__name__
                self.miss(words if words.startswith(str(self.folder)) else f"{what}: {words}")
                found = None
        for one in caught:
            if issubclass(one.category, ResultsWarning):
                self.miss(str(one.message))
        return found

    @cached_property
    def history(self) -> xarray.Dataset | None:
        """The history; None where there is none, or it cannot be read."""
        return self.attempt(FILES["history"], lambda: read_dataset(self.folder, "history", self.summary))

    @cached_property
    def modes(self) -> tuple[System, Modes, Structure | None] | None:
        """The mode shapes, as the history."""
        return self.attempt(FILES["mode_shapes"], lambda: read_mode_shapes(self.folder, self.summary))

    def miss(self, text: str) -> None:
        """Note what is missing, with names of files alone: a report does not hang on where its directory is."""
        plain = text.replace(f"{self.folder}/", "").replace(f"{self.folder}: ", "")[:400]
        if plain not in self.missing:
            self.missing.append(plain)

    def table(self, name: str) -> dict[str, Any] | None:
        """A table of the results by the name of its file; None where there is none, or it cannot be read."""
        return self.attempt(name, lambda: read_table(self.folder, name, self.summary))

    def units(self, name: str) -> dict[str, str]:
        """Units of the columns of a table that was read."""
        return self.attempt(name, lambda: tables.read_units(self.folder / name)) or {}


def page_of(folder: Path, directory: Path) -> Page:
    """The report of results.

    Parameters
    ----------
    folder : Path
        That holds their files.
    directory : Path
        The one that the user knows: that folder, or the one in which it stands while a run is not finished.
    """
    results = _Results(folder, {})
    if (folder / SUMMARY).exists():
        results.summary.update(results.attempt(SUMMARY, lambda: read_summary(folder)) or {})
    state = results.attempt("directory", lambda: unfinished_state(directory))
    if state:
        results.miss(state.replace(str(directory), "DIR"))
    summary, written = results.summary, _convergence_summary(results)
    study = _study(results)
    name, structure, finder, contacts = _structure(results, study, written)
    sections = [
        *results_of(results, _comparison), *results_of(results, _curves), *results_of(results, _player(structure)),
        *results_of(results, _motion), *results_of(results, _impacts), *results_of(results, _energy),
        *results_of(results, _modes), *results_of(results, _convergence), *results_of(results, _contact_table),
    ]  # fmt: skip
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
    sections.append(about_section(summary or written, study))
    listed = results.attempt("list of files", lambda: files_section(folder, summary))
    if listed is not None:
        section, lost = listed
        sections.append(section)
        results.missing.extend(text for text in lost if text not in results.missing)
    title = name if structure is None else f"{name}: {structure_words(structure, contacts)}"
    return Page(
        title=title,
        lead=tuple(_lead(study, summary, written)),
        drawing=drawing,
        conclusions=conclusions,
        missing=tuple(results.missing),
        warnings=_texts(summary.get("warnings")),
        notes=(*_texts(summary.get("notes")), *_texts(written.get("notes"))),
        sections=tuple(sections),
    )


def results_of(results: _Results, make: Callable[[_Results], list[Section]]) -> list[Section]:
    """Sections that can be made."""
    words = make.__name__.strip("_").replace("_", " ")
    return results.attempt(words, lambda: make(results)) or []


def _texts(values: Any) -> tuple[str, ...]:
    """What a summary has for a list of texts, whatever stands there."""
    return tuple(str(one) for one in values) if isinstance(values, (list, tuple)) else ()


# ---- what was computed ----------------------------------------------------------------------------


def _study(results: _Results) -> Study | None:
    path = results.folder / FILES["study"]
    return results.attempt(FILES["study"], lambda: load_study(path)) if path.exists() else None


def _convergence_summary(results: _Results) -> dict[str, Any]:
    name = OTHER_FILES["convergence_notes"]
    return results.attempt(name, lambda: read_json(results.folder / name)) or {}


def _structure(
    results: _Results, study: Study | None, written: Mapping[str, Any]
) -> tuple[str, Structure | None, Any, tuple[Any, ...]]:
    """Name of the study, structure, what finds a place of it, and its contacts."""
    named = results.summary.get("study", written.get("study"))
    name = str(named).removesuffix(".toml") if named else "study"
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


# ---- sections -------------------------------------------------------------------------------------


def _comparison(results: _Results) -> list[Section]:
    """The paper beside ours, the scan of the restitution, and what the paper cannot be met in."""
    content: list[Element] = []
    beside = results.table(OTHER_FILES["comparison"])
    if beside is not None:
        heads = {
            "paper_theory": "paper, theory",
            "paper_experiment": "paper, experiment",
            "from_rest_on_base": "ours, from rest relative to the base",
            "from_rest_in_space": "ours, from rest in the inertial frame",
        }  # fmt: skip
        header = tuple(heads.get(name, name) for name in beside)
        rows = tuple(zip(*(_plain_column(values) for values in beside.values()), strict=True))
        content.append(
            table_element(
                Table("The paper beside ours: median and range over starts", header, rows, OTHER_FILES["comparison"])
            )
        )
    remarks = _texts(results.summary.get("remarks"))
    if remarks:
        content.append(element("div.said", element("h3", "Where they differ, and why"), list_element(remarks, "notes")))
    scan = results.table(OTHER_FILES["restitution"])
    if scan is not None:
        units = results.units(OTHER_FILES["restitution"])
        content.append(table_element(table_of("Scan of the restitution", scan, units, OTHER_FILES["restitution"])))
    return [Section("comparison", "The paper and ours", tuple(content))] if content else []


def _plain_column(values: Any) -> list[Any]:
    """A column of texts with those that are numbers as numbers."""
    found: list[Any] = []
    for one in np.asarray(values).tolist():
        try:
            found.append(float(f"{float(one):.6g}"))
        except ValueError:
            found.append(one or None)
    return found


def _curves(results: _Results) -> list[Section]:
    swept = read_curves(results.folder, results.summary)
    if swept is None:
        return []
    curves, _ = swept
    named = {CASES.get(case, case): curve for case, curve in curves.items()}
    return [curves_section(named)]


def _player(structure: Structure | None) -> Callable[[_Results], list[Section]]:
    """What makes the player; the balls' and the supports' places are those of the snapshots."""

    def player(results: _Results) -> list[Section]:
        film = read_film(results.folder, results.summary)
        if film is None:
            return []
        finder = place_finder(film.structure, film.response.system.points)
        made = player_element(film.response, film.structure, finder, film.exaggeration)
        return [Section("player", "The motion", (made,))] if made is not None else []

    return player


def _motion(results: _Results) -> list[Section]:
    history = results.history
    if history is None:
        return []
    last = results.attempt(FILES["last_cycles"], lambda: read_last_cycles(results.folder, results.summary))
    end = None
    if last is not None:
        response = last[1]
        end = {name: (response.time, values, response.units[name]) for name, values in response.channels.items()}
    found = results.summary.get("history")
    regime = found.get("regime") if isinstance(found, dict) else None
    words = []
    if isinstance(regime, dict):
        label, criterion = (str(regime.get(key, "not known")) for key in ("label", "criterion"))
        words.append(f"Kind of motion over the last third: {label}. Criterion: {criterion}.")
    return [history_section(history, end, heading="Histories", words=words)]


def _energy(results: _Results) -> list[Section]:
    history = results.history
    made = None if history is None else energy_section(history)
    return [] if made is None else [made]


def _impacts(results: _Results) -> list[Section]:
    name = FILES["impacts"]
    columns = results.table(name)
    made = None if columns is None else impacts_section(columns, results.units(name), name)
    return [] if made is None else [made]


def _modes(results: _Results) -> list[Section]:
    found = results.modes
    name = FILES["modes"]
    columns = results.table(name)
    table = (
        None
        if columns is None
        else table_of("Modes without balls", {k: _whole(v) for k, v in columns.items()}, results.units(name), name)
    )
    if found is None:
        return [] if table is None else [Section("modes", "Modes", (table_element(table),))]
    return [modes_section(found[0], found[1], table)]


def _whole(values: Any) -> Any:
    """Numbers as whole ones where all are."""
    array = np.asarray(values)
    return (
        array.astype(int)
        if array.dtype.kind == "f"
        and array.size
        and np.all(array == np.rint(array))
        and np.abs(array).max() < 1e6
        and array.min() >= 1
        else array
    )


def _convergence(results: _Results) -> list[Section]:
    sections = []
    recommended = results.table(OTHER_FILES["convergence_summary"])
    if recommended is not None:
        made = summary_table(recommended, OTHER_FILES["convergence_summary"])
        sections.append(Section("recommended", "Recommended numbers", (table_element(made),)))
    for axis in ("mesh", "step", "modes"):
        name = OTHER_FILES[f"quantities_over_{axis}"]
        columns = results.table(name)
        section = None if columns is None else axis_section(axis, columns, results.units(name), name)
        sections += [] if section is None else [section]
    name = OTHER_FILES["statistics_over_mesh"]
    columns = results.table(name)
    section = None if columns is None else axis_section("mesh", columns, results.units(name), name, statistics=True)
    sections += [] if section is None else [section]
    name = OTHER_FILES["step_convergence"]
    columns = results.table(name)
    section = None if columns is None else steps_section(columns, name)
    return sections + ([] if section is None else [section])


def _contact_table(results: _Results) -> list[Section]:
    name = OTHER_FILES["contact_table"]
    columns = results.table(name)
    if columns is None:
        return []
    made = table_of("One collision, by its approach speed", columns, results.units(name), name)
    return [Section("contact", "Contacts alone", (table_element(made),))]
