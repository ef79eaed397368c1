"""The report of a directory of results, made from its files: what cannot be read is named in it."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.app.parametric.best import frequency_axes
from femimpact.app.parametric.best_design import (
    LIMIT,
    OF_AXIS,
    WORST_AT,
    BestCase,
    limited_words,
    marks_of,
    told,
    worst_over_axes,
)
from femimpact.app.parametric.dataset import read_manifest
from femimpact.app.report.markup import Element, element
from femimpact.app.report.page import (
    MOST_CARDS,
    Page,
    Section,
    Table,
    list_element,
    table_element,
    table_of,
    write_page,
)
from femimpact.app.report.page_tables import beside, branch_table, case_table, channel_table, summary_table
from femimpact.app.report.player import player_element
from femimpact.app.report.result_conclusions import (
    answer_of,
    best_of,
    result_conclusions,
    result_warnings,
    study_lead,
    study_missing,
    study_versions,
    than_words,
)
from femimpact.app.report.structure_drawing import OF_FILE, structure_element, structure_words
from femimpact.app.report.views import NOT_DRAWN, SECTIONS, Measure, measures_of, one_panel, sections_of, spectra_of
from femimpact.app.results.picture_data import ResultReading, read_convergence, read_results
from femimpact.app.results.result_directory import (
    FILES,
    REPORT,
    STUDY_BLOCKS,
    STUDY_MANIFEST,
    SUMMARY,
    ResultFileWarning,
    added_results,
    purpose_of,
    result_files,
)
from femimpact.app.study.findings import START_WORDS, Findings, joined
from femimpact.app.study.prepared import in_study_words
from femimpact.app.study.study import Study, build_systems
from femimpact.errors import require, require_path
from femimpact.excitation.drives import drive_words
from femimpact.excitation.excitation import is_force, words_of
from femimpact.excitation.harmonic import Sine, SteppedSine
from femimpact.figures.study_labels import axis_names, axis_words, in_shown_units
from femimpact.orbits.figures import kind_words
from femimpact.response.regimes import FREE_DECAY
from femimpact.scene.placed import drawn_system, placed_structure
from femimpact.signals.transfer import transfer_function
from femimpact.system.modes import mode_columns, solve_modes
from femimpact.system.system import without_impactors
from femimpact.units import PARAMETER_DIGITS, counted, name_words, unit_text

if TYPE_CHECKING:
    import xarray


NO_NUMBERS = "No numbers were found that could stand here."


def write_report(
    directory: str | Path,
    path: str | Path | None = None,  # of the file; without one `report.html`, or `sheet.html`, beside the results
    short: bool = False,  # on one sheet of paper
) -> Path:
    """Write the report of a directory of results.

    Damaged results and the finished parts of a run that was ended make a report that says what is missing.

    Raises `InputError` if the directory holds no results, a run writes into it, or the file cannot be there.
    """
    require_path(directory, "directory", "a directory")
    folder = Path(directory)
    with added_results(folder):
        words = "none of their files is there, or what has their names was not written by femimpact"
        require(_holds_results(folder), "directory", str(folder), "", f"must hold results of a study: {words}")
        page = page_of(read_results(folder), short=short)
        return write_page(folder / (FILES["sheet"].name if short else REPORT) if path is None else Path(path), page)


def _holds_results(directory: Path) -> bool:
    """True where a file of results stands that no other program writes: a folder of the user's may have their names."""
    names = set(result_files(directory))
    if any(name.endswith(".nc") for name in names) or (directory / STUDY_BLOCKS / STUDY_MANIFEST).is_file():
        return True
    return FILES["study"].name in names and any(FILES[key].name in names for key in ("summary", "modes", "impacts"))


def add_report(
    directory: str | Path,
    report: Callable[[str, float], None],
    study: Study,  # that was run
    drawn: Mapping[str, Element] = NOT_DRAWN,  # its pictures
) -> None:
    """Write the report of a run that is done; what keeps it from being written is a warning, and the results stand."""
    report("report", 0.0)
    try:
        folder = Path(directory)
        with added_results(folder):
            page = page_of(read_results(folder, study), drawn, study.output.report == "short")
            write_page(folder / REPORT, page)
    # no result hangs on it
    except Exception as error:
        words = " ".join(str(error).split()) or type(error).__name__
        text = f"report not written: {words}; 'femimpact report {directory}' writes it"
        warnings.warn(text, ResultFileWarning, stacklevel=3)
    report("report", 1.0)


def page_of(results: ResultReading, drawn: Mapping[str, Element] = NOT_DRAWN, short: bool = False) -> Page:
    """The report of a directory of results."""
    findings, study = results.findings, results.study
    structure, system = (None, None) if study is None else (study.structure, results.system)
    drawing = None
    if study is not None and system is not None:
        varied = {} if results.parameter_study is None else _varied(study)
        design, of_design = results.best_design or (study, OF_FILE)
        places = system if design is study else drawn_system(design.structure, findings.points)
        drawing = results.attempt(
            "drawing of the structure",
            lambda: structure_element(placed_structure(design.structure, places), varied, of_design),
        )
    best, next_step = best_of(results), _next_step(results)
    conclusions = result_conclusions(results, best)
    studied, about = _of_parameter_study(results)
    worth = results.attempt("what the best case is worth", lambda: _worth(results, best[0]))
    lines, answer = worth or ([], "")
    studied += lines
    records, refused = records_of(results, best[0])
    if short and results.run is not None:
        drawn = results.attempt("history", partial(one_panel, results.run)) or drawn
    beside = beside_of(results, records) | {"spectra": [element("p", text) for text in refused]}
    sections = sections_of(records, beside, miss=results.miss, drawn=drawn)
    first = [section for section in sections if section.key == "best"]
    sections = [section for section in sections if section.key != "best"]
    data = results.parameter_study
    many_starts = data is not None and int(data.attrs.get("starts", 1)) > 1
    sections.append(about_section(joined(about, findings), None if many_starts else study))
    listed = results.attempt("list of files", lambda: files_section(results.folder, findings.checksums))
    if listed is not None:
        section, lost = listed
        sections.append(section)
        results.missing.extend(text for text in lost if text not in results.missing)
    name = _file_name(results, findings).removesuffix(".toml")
    name = name if data is None else f"parameter study {name}".removesuffix(" study")
    title = name if structure is None else f"{name}: {structure_words(structure, system.contacts if system else ())}"
    head = ("", "", "") if study is None else (study.output.title, study.output.author, study.output.date)
    given_title, by = _head(*head)
    warnings = result_warnings(results)
    page = Page(
        title=given_title or title,
        by=by,
        answer=answer or answer_of(findings, conclusions),
        foot=_foot(results, joined(about, findings)),
        lead=(*([f"{title}."] if given_title else []), *studied, *_lead(study, findings)),
        drawing=drawing,
        conclusions=conclusions,
        missing=tuple(results.missing),
        warnings=warnings,
        notes=findings.notes or (() if conclusions or results.missing or warnings else (NO_NUMBERS,)),
        sections=tuple(sections),
        first=(*first, *next_step),
    )
    return short_page(page) if short else page


# ---- one sheet -------------------------------------------------------------------------------------


ON_SHEET = ("best", "response", "orbits", "convergence", "study", "motion")
"""Parts of a page of which the first that has a picture gives that of the sheet."""

LEFT_OFF_SHEET = ("Energy unaccounted for",)
"""Conclusions that check the computation."""

KEPT, CHECKS = re.compile(rf", {LIMIT} |, steady$|{OF_AXIS}$"), (": fit: no interval: ", ": half-power: ")
"""What details have in them that a sheet keeps, and warnings of an interval or of a second estimate, which has none."""


def short_page(page: Page) -> Page:
    """Question, structure, drive, answer with its range, a picture and limits: without paths and residuals."""
    sections = {section.key: section for section in (*page.first, *page.sections)}
    pictures = [
        picture
        for key in ON_SHEET
        if key in sections
        for part in sections[key].content
        for picture in part.iter("figure")
        if picture.get("class") == "picture"
    ][:1]
    conclusions = [
        replace(one, details=tuple(text for text in one.details if text.startswith(WORST_AT) or KEPT.search(text)))
        for one in page.conclusions
        if one.label not in LEFT_OFF_SHEET
    ]
    for picture in pictures:
        # the names of files
        for words in picture.findall("p"):
            picture.remove(words)
    return replace(
        page,
        conclusions=tuple(conclusions[:MOST_CARDS]),
        missing=(),
        # a limit of the planned test that is passed
        warnings=(
            *(text for text in page.warnings if not any(words in text for words in CHECKS)),
            *(text for text in page.notes if "(limit: " in text),
        ),
        notes=(),
        first=(),
        sections=(Section("picture", "Picture", tuple(pictures)),) if pictures else (),
        short=True,
    )


# ---- what was computed ----------------------------------------------------------------------------


def other_start_words(results: ResultReading) -> str:
    """That a run of the best case has another start than the study ran, where its study file keeps none of them."""
    data, (best, _) = results.parameter_study, results.best_design or (None, "")
    several = data is not None and int(data.attrs.get("starts", 1)) > 1
    another = several and best is not None and best.structure.impactors and not best.begins
    return " (the study ran other starts of the balls: another start, another value)" if another else ""


def _next_step(results: ResultReading) -> list[Section]:
    """How to run the best case of a parameter study, where its study file can be read."""
    if results.best_design is None:
        return []
    name = FILES["best_study"].name
    words = (
        f"'femimpact run {name}' in the folder of this page runs the best case where it is worst, with its own report"
    )
    return [Section("next", "The next step", (element("p", f"{words}{other_start_words(results)}."),))]


def _varied(study: Study) -> dict[str, list[str]]:
    """Fields that the axes of a study vary, by their parts as "impactor.ball"; "restitution" of a contact's."""
    fields: dict[str, list[str]] = {}
    for path in study.plan.axes if study.plan is not None else ():
        part, _, name = path.replace(".contact.", ".").rpartition(".")
        fields.setdefault(part, []).append(name.replace("_", " "))
    return fields


def _of_parameter_study(results: ResultReading) -> tuple[list[str], Findings]:
    """Sentences and versions of a parameter study; cases that were not run are missing."""
    data, study, name = results.parameter_study, results.study, FILES["parameter_study"].name
    if data is None:
        if (results.folder / STUDY_BLOCKS).is_dir() and not (results.folder / name).exists():
            results.miss(f"{name}: the parameter study was not finished; the same femimpact study goes on with it")
        return [], Findings()
    for text in results.attempt(name, lambda: study_missing(data)) or ():
        results.miss(text)
    lead = results.attempt(name, lambda: study_lead(data)) or []
    if study is not None and isinstance(study.excitation, SteppedSine):
        lead.append("A case has one value over all dwells; a sine with the axis base.frequency has one at each.")
    return lead, results.attempt(name, lambda: study_versions(data)) or Findings()


def best_measures(data: xarray.Dataset, best: Mapping[str, BestCase]) -> list[Measure]:
    """The worst value of measures over the axes that one chooses; none of a list of cases, or without a best case."""
    worst = {measure: worst_over_axes(data, case) for measure, case in best.items()}
    # of several measures one: the pages of the others are a map each
    return [
        Measure(one, measure, "study_best", marks_of(best[measure]))
        for measure, one in worst.items()
        if one is not None
    ][:1]


def worst_words(data: xarray.Dataset, case: BestCase | None) -> Iterator[str]:
    """Over which axes the worst counts; nothing of a study without such axes."""
    if case is not None and case.worst_over:
        yield f"The worst counts over {' and '.join(axis_words(data, axis) for axis in case.worst_over)}."


def _worth(results: ResultReading, best: Mapping[str, BestCase]) -> tuple[list[str], str]:
    """The worst peak without balls beside that of the best case, and the best case in a sentence; "" of several."""
    data, case = results.parameter_study, next(iter(best.values()), None)
    if data is None or case is None:
        return [], ""
    (design, *others), names = case.designs, {axis: axis_words(data, axis) for axis in axis_names(data)}
    words = name_words(case.measure)
    if case.worst_over:
        words = f"worst {words} over {' and '.join(names[axis] for axis in case.worst_over)}"
    known = None if design.reason else _peak_without(results, case)
    lines, factor = [*worst_words(data, case)], ""
    if known is not None:
        sentence, ratio = known
        lines, factor = [*lines, sentence], f", {than_words(ratio)} without {results.findings.carried}"
    if others or design.reason:
        return lines, ""
    value = unit_text(design.value, case.units[case.measure])
    limited = limited_words(design).replace(" within", ", within")
    return lines, f"Best case: {told(case, design.values, names)}; its {words} is {value}{factor}{limited}."


def _peak_without(results: ResultReading, case: BestCase) -> tuple[str, float] | None:
    """The largest steady peak without balls, in a sentence, and over that of the best case; None where not known."""
    data, study, design = results.parameter_study, results.study, case.designs[0]
    axes = set() if data is None else set(axis_names(data))
    of_drive = frequency_axes(axes)
    of_balls = all(axis in of_drive or axis.startswith(("impactor.", "start.")) for axis in axes)
    if data is None or study is None or case.measure != "peak" or not of_balls:
        return None
    drive: Any = study.excitation
    system, place = build_systems(study)[1], data.attrs["place"]
    # of a force its history, read as newtons
    bare, sine = without_impactors(system), getattr(drive, "history", drive)
    if not system.balls or bare.contacts or not isinstance(sine, Sine):
        return None
    f = np.unique(data[of_drive[0]].to_numpy()) if of_drive else np.array([sine.frequency])
    # a grid may step over a resonance, of which the motion without balls has a closed form
    natural = solve_modes(bare, bare.dofs).natural_frequency
    f = np.union1d(f, natural[(natural > f[0]) & (natural < f[-1])])
    of = "base.displacement" if sine.by == "amplitude" else "base.acceleration"
    at: dict[str, Any] = {"force_at": drive.at} if is_force(drive) else {"of": of}
    peaks = sine.level * np.abs(transfer_function(bare, f, to=(place,), **at)[place])
    largest, value = int(np.argmax(peaks)), float(data["peak"].to_numpy().flat[design.case])
    over = f"from {f[0]:.4g} to {f[-1]:.4g} Hz" if f.size > 1 else "there"
    without = f"Without {results.findings.carried} the largest steady peak {over} is {unit_text(peaks[largest], 'm')}"
    return f"{without}, at {f[largest]:.4g} Hz.", peaks[largest] / value


def _file_name(results: ResultReading, findings: Findings) -> str:
    """Name of the study file that the command was given; of a parameter study its dataset has it."""
    data = results.parameter_study
    given = "" if data is None else str(data.attrs.get("study_file", ""))
    return findings.study or given or FILES["study"].name


def _foot(results: ResultReading, findings: Findings) -> str:
    """Version, core, command, seeds and the key of a parameter study."""
    studied = results.parameter_study is not None
    kinds = {"modes": "modes", "simulate": "history", "sweep": "sweep_data"}
    parts_run = [name for name, key in kinds.items() if (results.folder / FILES[key].name).exists()]
    of_parts = parts_run[0] if len(parts_run) == 1 else "run"
    command = "study" if studied else "orbits" if findings.orbits else "converge" if findings.problems else of_parts
    blocks = results.folder / STUDY_BLOCKS / STUDY_MANIFEST
    key = results.attempt("key of the study", lambda: read_manifest(results.folder)["key"]) if blocks.is_file() else ""
    parts = {
        "femimpact": findings.versions.get("femimpact", "of a version that is not known"),
        "core": str((findings.core or {}).get("sources", ""))[:KEY_LETTERS],
        "femimpact " + ("demo" if findings.answer else command): _file_name(results, findings),
        "seeds:": "; ".join(findings.seeds),
        "key": str(key or "")[:KEY_LETTERS],
    }
    return " · ".join(f"{name} {value}" for name, value in parts.items() if value)


KEY_LETTERS = 12
"""Letters of a hash that a line shows."""


def _head(*texts: str) -> tuple[str, str]:
    """Title that the study gives its report, and a line with author and date; each empty where it gives none."""
    title, *by = (" ".join(words.split()) for words in texts)
    return title, ", ".join(filter(None, by))


def _lead(study: Study | None, findings: Findings) -> list[str]:
    """Sentences on what was computed."""
    if study is None or findings.problems:
        return [f"{problem}." for problem in findings.problems]
    sentences = [f"History: {study.history_words}." if findings.history is not None else ""]
    base = ""
    # a parameter study may vary the level: its first sentence has the drive
    ran = findings.history is not None or bool(findings.sweep)
    if study.kind == "sine" and (ran or study.plan is None):
        reached = unit_text(study.sine.amplitude * (2.0 * math.pi * study.sine.frequency) ** 2, "m/s^2")
        base = f" The base moves by {1e3 * study.sine.amplitude:.4g} mm, with {reached} at {study.sine.frequency:g} Hz."
    elif ran:
        sentences.append(f"Drive: {'. '.join(drive_words(study.excitation))}.")
    if findings.sweep and study.sweep is not None:
        plan = study.sweep
        sentences.append(
            f"Sweep: {plan.start:g} to {plan.stop:g} Hz at {plan.points} points, {plan.refine} more around each "
            f"resonance; {plan.cycles} cycles at each frequency"
            f"{_sweep_level(study)}."
        )
    if findings.orbits is not None and study.orbits is not None:
        low, high = (unit_text(value, findings.orbits.unit) for value in study.orbits.range)
        drive = words_of(study.excitation)
        sentences.append(f"Periodic orbits over {findings.orbits.parameter} from {low} to {high}; drive: {drive}.")
    modes = None if study.reduction is None else study.reduction.modes
    kept = "in physical degrees of freedom" if modes is None else f"on {counted(modes, 'mode')}"
    steps = f", step {1e3 * findings.step:.4g} ms" if findings.step is not None else ""
    sentences.append(f"Method: {study.method.get('name', 'newmark')} {kept}{steps}.{base}")
    return [text for text in sentences if text]


def _sweep_level(study: Study) -> str:
    """The level of a sweep that is given as an acceleration."""
    level = study.sweep_level["acceleration"]
    if level is None:
        return ""
    ends = [level] if isinstance(level, (int, float)) else [one for _, one in level]
    return f"; the base accelerates by {' to '.join(unit_text(one, 'm/s^2') for one in dict.fromkeys(ends))}"


# ---- records ---------------------------------------------------------------------------------------


def records_of(results: ResultReading, best: Mapping[str, BestCase] | None = None) -> tuple[list[Any], list[str]]:
    """What the results hold that pictures are drawn of, and why there are no spectra; what cannot be read is noted."""
    data, run = results.parameter_study, results.run
    records = [
        results.curves,
        *results.ranges,
        results.followed,
        run,
        results.modes,
        *convergence_tables(results),
        *(best_measures(data, best) if data is not None and best else ()),
        *(
            (results.attempt(FILES["parameter_study"].name, lambda: measures_of(data)) or ())
            if data is not None
            else ()
        ),
    ]
    spectra, refused = list[Any](), list[str]()
    if run is not None:
        spectra, refused = results.attempt("spectra", lambda: spectra_of(run.whole, in_study_words)) or ([], [])
    return [record for record in (*records, *spectra) if record is not None], refused


DEFAULT_ACCURACY = 1e-3
"""Of tables of convergence whose notes are lost."""


def convergence_tables(results: ResultReading) -> Iterator[Any]:
    """Tables of a convergence study that can be read: of each printed, errors, orders and what an accuracy takes."""
    accuracy = results.findings.accuracy or DEFAULT_ACCURACY
    summary = results.table(FILES["convergence_summary"].name)
    for key, axis, known in (
        *((f"quantities_over_{axis}", axis, summary) for axis in ("mesh", "step", "modes")),
        ("statistics_over_mesh", "mesh", None),
        ("runs_over_step", "step", None),
    ):
        name = FILES[key].name
        columns = results.table(name)
        if columns is not None and (known is not None or not key.startswith("quantities")):
            yield results.attempt(name, partial(read_convergence, columns, results.units(name), axis, known, accuracy))


# ---- words and tables beside the pictures ----------------------------------------------------------


Beside = list[Element | Table | str]
"""Words, tables, and other elements of a part of a page, in their order."""


def tables_of(results: ResultReading) -> Iterator[Table]:
    """Tables of results that stand on the page and on the terminal alike."""
    for key, make in (
        ("modes", _modes), ("motion", _motion), ("orbits", _orbits), ("box", _boxes),
    ):  # fmt: skip
        parts = results.attempt(SECTIONS[key], partial(make, results)) or []
        yield from (part for part in parts if isinstance(part, Table))


def beside_of(results: ResultReading, records: Iterable[Any]) -> dict[str, list[Element]]:
    """Words, tables and the player of results, by the part of the page in which they stand."""
    parts = {
        key: results.attempt(SECTIONS[key], partial(make, results)) or []
        for key, make in (
            ("comparison", _comparison), ("orbits", _orbits), ("player", _player), ("motion", _motion),
            ("modes", _modes), ("recommended", _recommended), ("cases", _cases),
            ("box", _boxes),
        )
    }  # fmt: skip
    for record in records:
        pairs: list[tuple[str, Element]] | None = results.attempt("tables", partial(list, beside(record, True)))
        for key, one in pairs or ():
            parts.setdefault(key, []).append(one)
    return {key: [_as_element(part) for part in several] for key, several in parts.items() if several}


def _as_element(part: Element | Table | str) -> Element:
    if isinstance(part, Table):
        return table_element(part)
    return element("p", part) if isinstance(part, str) else part


def _of_file(results: ResultReading, key: str, make: Callable[[Any, Any, str], Table | None]) -> list[Table]:
    """The table of a file of results, by its key; none where there is no such file, or it cannot be read."""
    name = FILES[key].name
    columns = results.table(name)
    table = None if columns is None else results.attempt(name, partial(make, columns, results.units(name), name))
    return [] if table is None else [table]


def _motion(results: ResultReading) -> Beside:
    """By which criterion the motion is what it is, and the numbers of every channel."""
    history = results.findings.history
    if history is None:
        return []
    words = "The excitation has no cycle: no kind of periodic motion is looked for."
    if history.regime.label == FREE_DECAY:
        words = "Nothing drives it: a free decay."
    if history.frequency is not None:
        words = f"Kind of motion over the last third: {history.regime.label}. Criterion: {history.regime.criterion}."
    channels = channel_table(results.findings)
    return [words, *([] if channels is None else [channels])]


def _boxes(results: ResultReading) -> Beside:
    """Sizes of balls of a known material, their boxes and the beam there, and the pressure at the fastest impact."""
    study, of_design = results.best_design or (results.study, "by the gaps of the study file")
    balls = [one for one in study.structure.impactors if one.material] if study else []
    if study is None or not balls:
        return []
    rows, impacts = [], results.table(FILES["impacts"].name)
    structure, system = study.structure, drawn_system(study.structure, results.findings.points)
    for ball in balls:
        speeds = [] if impacts is None else impacts["approach_speed"][np.asarray(impacts["impactor"]) == ball.name]
        speed = max(speeds, default=math.nan)
        force, pressure = ball.wall_pressure(speed) if speed > 0.0 else (math.nan, math.nan)
        sizes = 1e3 * ball.diameter, 1e3 * ball.box_length, 1e3 * ball.box_mass(1e-3)
        high = 1e3 * structure.beam.drawn_at(system.position_of(structure.place_of(ball.at)))[1]
        rows.append((ball.name, ball.material, ball.wall, *sizes, high, float(speed), force, 1e-6 * pressure))
    # without impacts, or without a wall, a column has nothing
    names = "diameter (mm)", "box inside (mm)", "box of 1 mm walls (g)", "height of the beam there (mm)"
    of_impact = "fastest impact (m/s)", "force on a bare wall (N)", "Hertz pressure (MPa)"
    header = ("ball", "material", "wall", *names, *of_impact)
    filled = [i for i in range(len(header)) if any(row[i] not in ("", None) and row[i] == row[i] for row in rows)]
    cells = tuple(tuple(row[i] for i in filled) for row in rows)
    return [Table(f"Balls and their boxes, {of_design}", tuple(header[i] for i in filled), cells)]


def _player(results: ResultReading) -> Beside:
    film, study = results.film, results.study
    player = None if film is None or study is None else player_element(film, study.structure, study.output.exaggeration)
    return [] if player is None else [player]


def _comparison(results: ResultReading) -> Beside:
    """Table of the paper's results beside ours, and remarks on where they differ."""
    findings = results.findings
    content: Beside = [*_of_file(results, "comparison", _comparison_table)]
    if findings.remarks:
        remarks = list_element(findings.remarks, "notes")
        content.append(element("div.said", element("h3", "Where they differ, and why"), remarks))
    return content


def _comparison_table(columns: Mapping[str, Any], _units: Mapping[str, str], file: str) -> Table:
    rows = tuple(tuple(str(cell) or None for cell in row) for row in zip(*columns.values(), strict=True))
    return Table("The paper beside ours: median and range over starts", tuple(columns), rows, file)


def _modes(results: ResultReading) -> Beside:
    """Table of the modes, from its file or from the modes themselves."""
    title = f"Modes without {results.findings.carried}"
    tables = _of_file(results, "modes", partial(_mode_table, title))
    if tables or results.modes is None:
        return [*tables]
    return [table_of("Modes", *mode_columns(results.modes.modes))]


def _mode_table(title: str, columns: Mapping[str, Any], units: Mapping[str, str], file: str) -> Table:
    return table_of(title, {key: _whole(values) for key, values in columns.items()}, units, file)


def _recommended(results: ResultReading) -> Beside:
    return [*_of_file(results, "convergence_summary", summary_table)]


def _cases(results: ResultReading) -> Beside:
    """From the table, which may stand where the dataset is damaged."""
    return [*_of_file(results, "parameter_table", case_table)]


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


def _orbits(results: ResultReading) -> Beside:
    """Branches of periodic orbits, and the command that follows them again."""
    followed = results.followed
    if followed is None:
        return []
    parameter = followed.branches[0].parameter
    more = "bifurcations move with each further mode, so follow the branches again with one mode more"
    return [
        f"On {counted(followed.modes, 'mode')}: {more}. At stable orbits every small disturbance decays.",
        f"'femimpact orbits {FILES['study'].name}' in the folder of this page follows the branches again.",
        branch_table(followed, FILES["branch_table"].name),
        *_of_file(results, "bifurcations", partial(_bifurcation_table, parameter)),
    ]


def _bifurcation_table(parameter: str, columns: Mapping[str, Any], units: Mapping[str, str], file: str) -> Table | None:
    if not len(columns["branch"]):
        return None
    kinds = [kind_words(str(kind)) for kind in columns["kind"]]
    whole = {**columns, "branch": np.asarray(columns["branch"]).astype(int), "kind": kinds}
    # at an impact without speed it is infinite
    no_number = np.isin(columns["kind"], ("grazing", "sticking"))
    whole["largest_multiplier"] = np.where(no_number, math.nan, columns["largest_multiplier"])
    return table_of("Bifurcations", *in_shown_units(whole, units), file, digits={parameter: PARAMETER_DIGITS})


def about_section(findings: Findings, study: Study | None) -> Section:
    """Versions, the compiled core, seeds and start of the results."""
    core = findings.core
    rows = list(findings.versions.items()) or [("versions", "not known: the results do not say")]
    if core:
        words = ", ".join(f"{name} {core[name]}" for name in ("target", "compiler", "kind") if name in core)
        rows.append(("compiled core", words))
        if "sources" in core:
            rows.append(("its sources (SHA-256)", str(core["sources"])))
    rows.append(("seeds", "; ".join(findings.seeds) or "none: no random numbers were used"))
    if study is not None:
        rows.append(("start", START_WORDS[study.start] + ", but for [[start]]" * bool(study.begins)))
    pairs = [part for name, value in rows for part in (element("dt", name), element("dd", value))]
    return Section("versions", "Versions and seeds", (element("dl.about", *pairs),))


def files_section(folder: Path, checksums: Mapping[str, str]) -> tuple[Section, tuple[str, ...]]:
    """The files of results with what each is for, and lines for those that are lost."""
    present = {*result_files(folder), REPORT}
    # the report changes its size and that of the summary
    rows = [
        (name, "" if name in (SUMMARY, REPORT) else _size((folder / name).stat().st_size), purpose_of(name))
        for name in present
        if not name.endswith(".vtu")
    ]
    if (folder / STUDY_BLOCKS).is_dir():
        rows.append((f"{STUDY_BLOCKS}/", "", "finished blocks of cases, from which the same study goes on"))
    for scene in sorted({name.rpartition("/")[0] for name in present if name.endswith(".vtu")}):
        frames = [name for name in present if name.startswith(f"{scene}/")]
        total = sum((folder / name).stat().st_size for name in frames)
        rows.append((f"{scene}/", _size(total), f"{len(frames)} frames of {scene}.pvd"))
    groups: dict[str, list[tuple[str, str, str]]] = {group: [] for group in FILE_GROUPS}
    for row in sorted(rows):
        groups[_group_of(row[0])].append(row)
    tables = [_table_of_files(group, files) for group, files in groups.items() if files]
    return Section("files", "Files", tuple(tables)), _lost(checksums, present)


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


def _lost(checksums: Mapping[str, str], present: set[str]) -> tuple[str, ...]:
    lost = sorted(set(checksums) - present)
    if not lost:
        return ()
    more = f" and {len(lost) - 5} more" if len(lost) > 5 else ""
    return (f"files that {SUMMARY} names and that are gone: {', '.join(lost[:5])}{more}",)


def _size(count: int) -> str:
    for unit, factor in (("MB", 1e6), ("kB", 1e3)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count} B"
