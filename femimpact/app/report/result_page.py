"""The report of a directory of results, made from its files: what cannot be read is named in it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.app.parametric.best import best_cases
from femimpact.app.parametric.best_design import BestCase
from femimpact.app.report.best_picture import marks_of, worst_over_axes
from femimpact.app.report.branch_charts import branches_section
from femimpact.app.report.charts import (
    axis_section,
    curves_section,
    energy_section,
    history_section,
    impacts_section,
    modes_section,
    steps_section,
    summary_table,
)
from femimpact.app.report.drive_charts import drive_section, spectra_section
from femimpact.app.report.maps import maps_section
from femimpact.app.report.page import (
    Conclusion,
    Page,
    Section,
    Table,
    list_element,
    table_element,
    table_of,
    write_page,
)
from femimpact.app.report.player import player_element
from femimpact.app.report.result_conclusions import (
    STARTS,
    ResultReading,
    conclusions_of,
    convergence_conclusions,
    study_conclusions,
    study_failures,
    study_lead,
    study_missing,
    study_versions,
    texts_of,
)
from femimpact.app.report.structure_drawing import structure_element, structure_words
from femimpact.app.results.branch_file import read_followed
from femimpact.app.results.picture_data import (
    read_bands,
    read_curves,
    read_film,
    read_last_cycles,
    read_parts,
    read_run,
    read_run_parts,
)
from femimpact.app.results.result_directory import (
    BEST_FIGURE,
    FILES,
    REPORT,
    STUDY_BLOCKS,
    STUDY_FIGURE,
    STUDY_MANIFEST,
    SUMMARY,
    ResultsWarning,
    finished_parts,
    is_file,
    is_folder,
    result_files,
    unfinished_state,
    update_results,
)
from femimpact.app.results.results import carried_of, read_json, read_summary
from femimpact.app.study.prepared import in_study_words
from femimpact.app.study.study import Study, build
from femimpact.app.study.study_file import load_study
from femimpact.app.study.summary import drive_name
from femimpact.errors import InputError, require, require_path
from femimpact.excitation import SteppedSine
from femimpact.excitation.excitation import has_cycle, words_of
from femimpact.scene.placed import DrawnSystem, drawn_system, placed_structure
from femimpact.signals.densities import MODES, modes_of
from femimpact.structure.structure import Structure
from femimpact.svg import Element, element
from femimpact.system.system import System
from femimpact.units import in_shown_units, unit_text

if TYPE_CHECKING:
    import xarray


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
    words = "none of their files is there, or what has their names was not written by femimpact"
    require(_holds_results(source, folder), "directory", str(folder), "", f"must hold results of a study: {words}")
    page = page_of(source, folder)
    if path is not None:
        return write_page(Path(path), page)
    with update_results(folder) as staging:
        write_page(staging.folder / REPORT, page)
    return folder / REPORT


OF_SUMMARY = frozenset({"study", "versions", "core", "natural_frequency", "sweep", "history", "warnings", "structure"})
"""Names of which a summary has several, of whatever version."""


def _holds_results(source: Path, directory: Path) -> bool:
    """True where a file of results stands that no other program writes: a folder of the user's may have their names."""
    names = set(result_files(source))
    if any(name.endswith(".nc") for name in names) or is_file(directory / STUDY_BLOCKS / STUDY_MANIFEST):
        return True
    if FILES["study"].name in names and any(FILES[key].name in names for key in ("summary", "modes", "impacts")):
        return True
    for key in ("summary", "convergence_notes"):
        try:
            written = read_json(source / FILES[key].name)
        except InputError:
            continue
        if len(OF_SUMMARY & set(written)) > 1:
            return True
    return False


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
        varied = {} if study is None or results.parameter_study is None else _varied(study)
        drawing = results.attempt(
            "drawing of the structure", lambda: structure_element(placed_structure(*given), varied)
        )  # fmt: skip
    conclusions = results.attempt("conclusions", lambda: conclusions_of(summary)) or ()
    recommended, accuracy = results.table(FILES["convergence_summary"].name), written.get("accuracy")
    conclusions += results.attempt("conclusions", lambda: convergence_conclusions(recommended, accuracy)) or ()
    studied, more, failures, about, first = _of_parameter_study(results, directory, study)
    data = results.parameter_study
    many_starts = data is not None and int(data.attrs.get("starts", 1)) > 1
    sections.append(about_section(summary or written or about, None if many_starts else study))
    listed = results.attempt("list of files", lambda: files_section(folder, summary))
    if listed is not None:
        section, lost = listed
        sections.append(section)
        results.missing.extend(text for text in lost if text not in results.missing)
    title = name if structure is None else f"{name}: {structure_words(structure, system.contacts if system else ())}"
    head = written if study is None else vars(study.output)
    given_title, by = _head(*(str(head.get(name, "")) for name in ("title", "author", "date")))
    return Page(
        title=given_title or title,
        by=by,
        lead=(*([f"{title}."] if given_title else []), *studied, *_lead(study, summary, written)),
        drawing=drawing,
        conclusions=(*conclusions, *more),
        missing=tuple(results.missing),
        warnings=(*texts_of(summary.get("warnings")), *failures),
        notes=(*texts_of(summary.get("notes")), *texts_of(written.get("notes"))),
        sections=tuple(sections),
        first=(*first, *_next_step(folder)),
    )


# ---- what was computed ----------------------------------------------------------------------------


def _study(results: ResultReading) -> Study | None:
    path = results.folder / FILES["study"].name
    return results.attempt(FILES["study"].name, lambda: load_study(path)) if path.exists() else None


def _convergence_summary(results: ResultReading) -> dict[str, Any]:
    name = FILES["convergence_notes"].name
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
        found = results.attempt(FILES[key].name, partial(read_run_parts, results.folder, key, results.summary))
        if found is not None:
            return found
    if "structure" not in written:
        return None
    return results.attempt(FILES["convergence_notes"].name, lambda: read_parts(written["structure"]))


def _next_step(folder: Path) -> list[Section]:
    """How to run the best case of a parameter study, where its study file is there."""
    name = FILES["best_study"].name
    words = (
        f"'femimpact run {name}' in the folder of this page runs the best case where it is worst, with its own report."
    )
    return [Section("next", "The next step", (element("p", words),))] if (folder / name).exists() else []


def _varied(study: Study) -> dict[str, list[str]]:
    """Fields that the axes of a study vary, by their parts as "impactor.ball"; "restitution" of a contact's."""
    found: dict[str, list[str]] = {}
    for path in study.plan.axes if study.plan is not None else ():
        part, _, name = path.replace(".contact.", ".").rpartition(".")
        found.setdefault(part, []).append(name.replace("_", " "))
    return found


def _of_parameter_study(
    results: ResultReading, directory: Path, study: Study | None
) -> tuple[list[str], tuple[Conclusion, ...], tuple[str, ...], Mapping[str, Any], list[Section]]:
    """Sentences, conclusions, failures, versions and the picture of the best case of a parameter study.

    Cases that were not run are missing.
    """
    data, name = results.parameter_study, FILES["parameter_study"].name
    if data is None:
        if is_folder(directory / STUDY_BLOCKS) and not (results.folder / name).exists():
            results.miss(f"{name}: the parameter study was not finished; the same femimpact study goes on with it")
        return [], (), (), {}, []
    for text in results.attempt(name, lambda: study_missing(data)) or ():
        results.miss(text)
    about = results.attempt(name, lambda: study_versions(data)) or {}
    plan = None if study is None or study.plan is None else study.plan.best
    best, reasons = results.attempt(name, lambda: best_cases(data, plan)) or ({}, {})
    lead = results.attempt(name, lambda: study_lead(data)) or []
    if study is not None and isinstance(study.excitation, SteppedSine):
        lead.append("A case has one value over all dwells; a sine with the axis base.frequency has one at each.")
    return (
        lead,
        results.attempt(name, lambda: study_conclusions(data, best, reasons)) or (),
        results.attempt(name, lambda: study_failures(data)) or (),
        about,
        results.attempt(name, lambda: best_sections(data, best)) or [],
    )


def best_sections(data: xarray.Dataset, best: Mapping[str, BestCase], key: str = "best") -> list[Section]:
    """The worst value over the axes that one chooses; nothing of a list of cases, or without a best case."""
    made = list[Section]()
    for measure, found in best.items():
        worst = worst_over_axes(data, found)
        heading = f"The {'worst ' if found.worst_over else ''}{measure.replace('_', ' ')} over what is chosen"
        section = None if worst is None else maps_section(worst, key, heading, marks_of(found))
        made += [section] if section is not None else []
    return made


def _head(*given: str) -> tuple[str, str]:
    """Title that the study gives its report, and a line with author and date; each empty where it gives none."""
    title, *by = (" ".join(words.split()) for words in given)
    return title, ", ".join(filter(None, by))


def _lead(study: Study | None, summary: Mapping[str, Any], written: Mapping[str, Any]) -> list[str]:
    """Sentences on what was computed."""
    if study is None:
        return [str(written["problem"])] if "problem" in written else []
    said = [f"History: {study.base.words}." if "history" in summary else ""]
    amplitude = getattr(study.base, "amplitude", None)
    base = ""
    if amplitude is not None:
        reached = unit_text(amplitude * (2.0 * math.pi * study.base.frequency) ** 2, "m/s^2")
        base = f" The base moves by {1e3 * amplitude:.4g} mm, with {reached} at {study.base.frequency:g} Hz."
    if "sweep" in summary and study.sweep is not None:
        plan = study.sweep
        said.append(
            f"Sweep: {plan.start:g} to {plan.stop:g} Hz at {plan.points} points, {plan.refine} more around each "
            f"resonance; {plan.cycles} cycles at each frequency."
        )
    followed = summary.get("orbits")
    if isinstance(followed, Mapping) and study.orbits is not None:
        low, high = (unit_text(value, str(followed.get("unit", ""))) for value in study.orbits.range)
        drive = words_of(study.excitation)
        said.append(f"Periodic orbits over {followed.get('parameter')} from {low} to {high}; drive: {drive}.")
    kept = f"on {study.reduction.modes} modes" if study.reduction is not None else "in physical degrees of freedom"
    step = summary.get("step")
    steps = f", step {1e3 * step:.4g} ms" if isinstance(step, float) and step == step else ""
    said.append(f"Method: {study.method.get('name', 'newmark')} {kept}{steps}.{base}")
    return [text for text in said if text]


# ---- sections ------------------------------------------------------------------------------------


def _comparison(results: ResultReading) -> list[Section]:
    """Table of the paper's results beside ours, remarks on where they differ, and the scan of the restitution."""
    content: list[Element] = []
    beside = results.table(FILES["comparison"].name)
    if beside is not None:
        heads = {
            "paper_theory": "paper, theory",
            "paper_experiment": "paper, experiment",
            "from_rest_on_base": "ours, from rest relative to the base",
            "from_rest_in_space": "ours, from rest in the inertial frame",
        }  # fmt: skip
        header = tuple(heads.get(name, name) for name in beside)
        rows = tuple(zip(*(_plain_column(values) for values in beside.values()), strict=True))
        title = "The paper beside ours: median and range over starts"
        content.append(table_element(Table(title, header, rows, FILES["comparison"].name)))
    remarks = texts_of(results.summary.get("remarks"))
    if remarks:
        content.append(element("div.said", element("h3", "Where they differ, and why"), list_element(remarks, "notes")))
    name = FILES["restitution"].name
    scan = results.table(name)
    if scan is not None:
        content.append(table_element(table_of("Scan of the restitution", scan, results.units(name), name)))
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


def _curves(results: ResultReading) -> list[Section]:
    swept = read_curves(results.folder, results.summary)
    if swept is None:
        return []
    curves, _ = swept
    carried = carried_of(results.summary)
    cases = {"empty": f"without {carried}", "ball": f"with {carried}"}
    named = {cases.get(case, case): curve for case, curve in curves.items()}
    return [curves_section(named, bands=read_bands(results.folder, results.summary))]


def _player(results: ResultReading) -> list[Section]:
    film = read_film(results.folder, results.summary)
    if film is None:
        drawn = [FILES[key].name for key in ("movie", "deflection_scene")]
        drawn = [name for name in drawn if (results.folder / name).exists()]
        if drawn:
            results.miss(
                f"{FILES['snapshots'].name}: results of an earlier version have none for a player; "
                f"{drawn[0]} shows the motion"
            )
        return []
    made = player_element(*film)
    return [Section("player", "The motion", (made,))] if made is not None else []


def _motion(results: ResultReading) -> list[Section]:
    history = results.history
    if history is None:
        return []
    last = results.attempt(FILES["last_cycles"].name, lambda: read_last_cycles(results.folder, results.summary))
    end = None
    if last is not None:
        response = last[1]
        end = {name: (response.time, values, response.units[name]) for name, values in response.channels.items()}
    found = results.summary.get("history")
    regime = found.get("regime") if isinstance(found, dict) else None
    words, study = [], _study(results)
    if isinstance(regime, dict):
        label, criterion = (str(regime.get(key, "not known")) for key in ("label", "criterion"))
        judged = f"Kind of motion over the last third: {label}. Criterion: {criterion}."
        cycle = "base_frequency_Hz" in history.attrs
        words.append(judged if cycle else "The excitation has no cycle: no kind of periodic motion is looked for.")
    drawn = [history_section(history, end, heading="Histories", words=words)]
    if study is None:
        return drawn
    duration = study.base.history_duration
    drive = results.attempt("drive", lambda: drive_section(study.excitation, duration))
    drawn = drawn if drive is None else [drive, *drawn]
    system = _system_of(study) if results.modes is None else results.modes[0]
    run = results.attempt(
        "spectra", lambda: read_run(results.folder, results.summary, history, system, study.excitation)
    )
    if run is None:
        return drawn
    spectra = results.attempt("spectra", lambda: spectra_section(run, told=in_study_words))
    return drawn if spectra is None else [*drawn, spectra]


def _system_of(study: Study) -> DrawnSystem:
    """Places and contacts of a study; its modes too where spectra need them, and they need no file of a mesh."""
    drawn = drawn_system(study.structure, {})
    if study.mesh.file or has_cycle(study.excitation):
        return drawn
    return replace(drawn, modes=modes_of(build(study)[1], MODES))


def _energy(results: ResultReading) -> list[Section]:
    history, study = results.history, _study(results)
    if history is None:
        return []
    made = energy_section(history) if study is None else energy_section(history, drive_name(study.excitation))
    return [] if made is None else [made]


def _of_table(results: ResultReading, key: str, make: Callable[[Any, str], Section | None]) -> list[Section]:
    """The section that is made of a table, from its columns and its name; none where there is no such table."""
    name = FILES[key].name
    columns = results.table(name)
    made = None if columns is None else make(columns, name)
    return [] if made is None else [made]


def _impacts(results: ResultReading) -> list[Section]:
    return _of_table(results, "impacts", lambda columns, name: impacts_section(columns, results.units(name), name))


def _modes(results: ResultReading) -> list[Section]:
    found = results.modes
    name = FILES["modes"].name
    columns = results.table(name)
    table = (
        None
        if columns is None
        else table_of(
            f"Modes without {carried_of(results.summary)}",
            {k: _whole(v) for k, v in columns.items()},
            results.units(name),
            name,
        )
    )
    if found is None:
        return [] if table is None else [Section("modes", "Modes", (table_element(table),))]
    return [modes_section(found[0], found[1], table)]


def _whole(values: Any) -> Any:
    """A column as integers, where all of its numbers are."""
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


def _convergence(results: ResultReading) -> list[Section]:
    def recommended(columns: Any, name: str) -> Section:
        return Section("recommended", "Recommended numbers", (table_element(summary_table(columns, name)),))

    def over(axis: str, statistics: bool = False) -> Callable[[Any, str], Section | None]:
        return lambda columns, name: axis_section(axis, columns, results.units(name), name, statistics=statistics)

    return [
        *_of_table(results, "convergence_summary", recommended),
        *(
            one
            for axis in ("mesh", "step", "modes")
            for one in _of_table(results, f"quantities_over_{axis}", over(axis))
        ),
        *_of_table(results, "statistics_over_mesh", over("mesh", statistics=True)),
        *_of_table(results, "step_convergence", steps_section),
    ]


def _parameter_study(results: ResultReading) -> list[Section]:
    """Every measure over the axes of the study, and a row for each case."""
    data = results.parameter_study
    maps = None if data is None else maps_section(data, "study", "The measures over the axes")
    cases = _of_table(
        results, "parameter_table", lambda columns, name: cases_section(columns, results.units(name), name)
    )
    return cases if maps is None else [maps, *cases]


def cases_section(columns: Mapping[str, Any], units: Mapping[str, str], file: str = "", key: str = "cases") -> Section:
    """A row for each case of a parameter study, in the units of its maps and conclusions."""
    table = table_of("A row for each case", *in_shown_units(columns, units), file)
    return Section(key, "Cases", (table_element(table),))


def _orbits(results: ResultReading) -> list[Section]:
    """Branches of periodic orbits, and the command that follows them again."""
    followed, name = read_followed(results.folder, results.summary), FILES["bifurcations"].name
    if followed is None:
        return []
    over_frequency = followed.branches[0].parameter == "base.frequency"
    more = ": one mode more moves windows that are some 0.01 Hz wide" if over_frequency else ""
    words = (
        f"On {followed.modes} modes{more}. At stable orbits every small disturbance decays.",
        f"'femimpact orbits {FILES['study'].name}' in the folder of this page follows the branches again.",
    )
    table = results.table(name)
    rows = None if table is None else (table, results.units(name), name)
    file = FILES["branches"].name
    return [branches_section(followed.branches, followed.origins, followed.cycles, words, rows, followed.swept, file)]


SECTIONS: tuple[tuple[str, Callable[[ResultReading], list[Section]]], ...] = (
    ("comparison", _comparison),
    ("response curves", _curves),
    ("periodic orbits", _orbits),
    ("player", _player),
    ("histories", _motion),
    ("impacts", _impacts),
    ("energy", _energy),
    ("modes", _modes),
    ("convergence", _convergence),
    ("parameter study", _parameter_study),
)
"""Sections of a report in their order: the words for each, and the function that makes it."""


def about_section(summary: Mapping[str, Any], study: Study | None) -> Section:
    """Versions, the compiled core, seeds and start of the results."""
    rows: list[tuple[str, str]] = []
    versions, core = summary.get("versions"), summary.get("core")
    if isinstance(versions, Mapping):
        rows += [(str(name), str(version)) for name, version in versions.items()]
    if isinstance(core, Mapping):
        words = ", ".join(f"{name} {core[name]}" for name in ("target", "compiler", "kind") if name in core)
        rows.append(("compiled core", words))
        if "sources" in core:
            rows.append(("its sources (SHA-256)", str(core["sources"])))
    seeds = summary.get("seeds")
    rows.append(("seeds", str(seeds) if seeds else "none: no random numbers were used"))
    if study is not None:
        rows.append(("start", STARTS.get(study.base.start, study.base.start)))
    if not isinstance(versions, Mapping):
        rows.insert(0, ("versions", "not known: the results do not say"))
    pairs = [part for name, value in rows for part in (element("dt", name), element("dd", value))]
    return Section("versions", "Versions and seeds", (element("dl.about", *pairs),))


def files_section(folder: Path, summary: Mapping[str, Any]) -> tuple[Section, tuple[str, ...]]:
    """The files of results with what each is for, and lines for those that are lost."""
    present = {*result_files(folder), REPORT, *([SUMMARY] if (folder / SUMMARY).exists() else [])}
    # the report changes its size and that of the summary
    rows = [
        (file.name, "" if file.name in (SUMMARY, REPORT) else _size((folder / file.name).stat().st_size), file.purpose)
        for file in FILES.values()
        if file.name in present
    ]
    rows += [
        (
            path.name,
            _size(path.stat().st_size),
            "the best case: its measure over the axes that are chosen"
            if path.name == BEST_FIGURE
            else "a measure over the axes of the study",
        )
        for path in sorted(folder.glob("study_*.png"))
        if STUDY_FIGURE.fullmatch(path.name)
    ]
    if is_folder(folder / STUDY_BLOCKS):
        rows.append((f"{STUDY_BLOCKS}/", "", "finished blocks of cases, from which the same study goes on"))
    for scene in sorted({name.partition("/")[0] for name in present if "/" in name}):
        frames = [name for name in present if name.startswith(f"{scene}/")]
        total = sum((folder / name).stat().st_size for name in frames)
        rows.append((f"{scene}/", _size(total), f"{len(frames)} frames of {scene}.pvd"))
    groups: dict[str, list[tuple[str, str, str]]] = {group: [] for group in FILE_GROUPS}
    for row in sorted(rows):
        groups[_group_of(row[0])].append(row)
    shown = [_table_of_files(group, found) for group, found in groups.items() if found]
    return Section("files", "Files", tuple(shown)), _lost(summary, present)


FILE_GROUPS = ("Numbers and study", "Pictures and movie", "ParaView")


def _group_of(name: str) -> str:
    """Group of a file, or of a folder whose name ends with a stroke."""
    if name.endswith((".png", ".mp4", ".gif")):
        return FILE_GROUPS[1]
    scene = name.endswith((".pvd", "_paraview.py", ".vtkhdf")) or (name.endswith("/") and name != f"{STUDY_BLOCKS}/")
    return FILE_GROUPS[2] if scene else FILE_GROUPS[0]


def _table_of_files(group: str, rows: Sequence[tuple[str, str, str]]) -> Element:
    """The files of a group, folded but for the first group."""
    body = [
        element(
            "tr", element("td", element("a", name, href=name)), element("td.number", size), element("td", words),
        )
        for name, size, words in rows
    ]  # fmt: skip
    columns = (("th", "file"), ("th.number", "size"), ("th", "what it is for"))
    head, title = (
        element("tr", *(element(*column, scope="col") for column in columns)),
        f"{group}: {len(rows)} file{'s' if len(rows) > 1 else ''}",
    )
    table = element("table", element("caption", title), element("thead", head), element("tbody", *body))
    holder = element("div.table", element("div.scroll", table, tabindex="0", role="region", aria_label=title))
    folded = element("details", element("summary", title), holder)
    if group == FILE_GROUPS[0]:
        folded.set("open", "open")
    return folded


def _lost(summary: Mapping[str, Any], present: set[str]) -> tuple[str, ...]:
    known = summary.get("checksums")
    lost = sorted(set(map(str, known)) - present) if isinstance(known, Mapping) else []
    if not lost:
        return ()
    more = f" and {len(lost) - 5} more" if len(lost) > 5 else ""
    return (f"files that {SUMMARY} names and that are gone: {', '.join(lost[:5])}{more}",)


def _size(count: int) -> str:
    for unit, factor in (("MB", 1e6), ("kB", 1e3)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count} B"
