"""The sections of the report of results, each from the files that it is made of, and the list of files at its end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.export.report.charts import (
    axis_section,
    curves_section,
    energy_section,
    history_section,
    impacts_section,
    modes_section,
    steps_section,
    summary_table,
)
from femimpact.export.report.maps import maps_section
from femimpact.export.report.page import Section, Table, list_element, table_element, table_of
from femimpact.export.report.player import player_element
from femimpact.study.picture_data import read_bands, read_curves, read_film, read_last_cycles
from femimpact.study.result_conclusions import ResultReading, texts_of
from femimpact.study.result_directory import (
    FILES,
    NAMES,
    OTHER_FILES,
    STUDY_BLOCKS,
    STUDY_FIGURE,
    SUMMARY,
    is_folder,
    result_files,
)
from femimpact.study.study import Study
from femimpact.svg import Element, element

CASES = {"empty": "without ball", "ball": "with ball"}


def _comparison(results: ResultReading) -> list[Section]:
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
    remarks = texts_of(results.summary.get("remarks"))
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


def _curves(results: ResultReading) -> list[Section]:
    swept = read_curves(results.folder, results.summary)
    if swept is None:
        return []
    curves, _ = swept
    named = {CASES.get(case, case): curve for case, curve in curves.items()}
    return [curves_section(named, bands=read_bands(results.folder, results.summary))]


def _player(results: ResultReading) -> list[Section]:
    film = read_film(results.folder, results.summary)
    if film is None:
        drawn = next(
            (FILES[name] for name in ("movie", "deflection_scene") if (results.folder / FILES[name]).exists()), ""
        )
        if drawn:
            results.miss(
                f"{FILES['snapshots']}: results of an earlier version have none for a player; {drawn} shows the motion"
            )
        return []
    made = player_element(film.response, film.structure, film.exaggeration)
    return [Section("player", "The motion", (made,))] if made is not None else []


def _motion(results: ResultReading) -> list[Section]:
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


def _energy(results: ResultReading) -> list[Section]:
    history = results.history
    made = None if history is None else energy_section(history)
    return [] if made is None else [made]


def _impacts(results: ResultReading) -> list[Section]:
    name = FILES["impacts"]
    columns = results.table(name)
    made = None if columns is None else impacts_section(columns, results.units(name), name)
    return [] if made is None else [made]


def _modes(results: ResultReading) -> list[Section]:
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


def _convergence(results: ResultReading) -> list[Section]:
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


def _parameter_study(results: ResultReading) -> list[Section]:
    """Every measure over the axes of the study, and a row for each case."""
    data = results.parameter_study
    maps = None if data is None else maps_section(data, "study", "The measures over the axes")
    name = OTHER_FILES["parameter_table"]
    columns = results.table(name)
    sections = [] if maps is None else [maps]
    if columns is not None:
        made = table_of("A row for each case", columns, results.units(name), name)
        sections.append(Section("cases", "Cases", (table_element(made),)))
    return sections


def _contact_table(results: ResultReading) -> list[Section]:
    name = OTHER_FILES["contact_table"]
    columns = results.table(name)
    if columns is None:
        return []
    made = table_of("One collision, by its approach speed", columns, results.units(name), name)
    return [Section("contact", "Contacts alone", (table_element(made),))]


SECTIONS: tuple[tuple[str, Callable[[ResultReading], list[Section]]], ...] = (
    ("comparison", _comparison),
    ("response curves", _curves),
    ("player", _player),
    ("histories", _motion),
    ("impacts", _impacts),
    ("energy", _energy),
    ("modes", _modes),
    ("convergence", _convergence),
    ("parameter study", _parameter_study),
    ("contacts", _contact_table),
)
"""What a report says of results, in its order: the words for it, and what makes its sections."""


PURPOSES = {
    "summary": "the numbers of this page, machine-readable",
    "study": "the study that was run, from which it can be run again",
    "modes": "frequencies, damping and effective masses of the modes",
    "mode_shapes": "mode shapes with labels (netCDF, xarray)",
    "sweep": "response curves, a row for each frequency",
    "sweep_data": "response curves with labels (netCDF, xarray)",
    "history": "every channel over time (netCDF, xarray)",
    "impacts": "every impact, a row each",
    "impact_data": "impacts with the energy to each mode (netCDF, xarray)",
    "snapshots": "whole deflections, from which player and movie are drawn",
    "last_cycles": "channels of the last cycles at every step",
    "modes_scene": "mode shapes for ParaView",
    "modes_script": "opens modes.pvd in ParaView",
    "deflection_scene": "the moving beam for ParaView, also at every impact",
    "deflection_script": "opens deflection.pvd in ParaView",
    "deflection_hdf": "the moving beam for ParaView in one file",
    "movie": "the moving beam in slow motion",
    "movie_without_encoder": "the moving beam in slow motion",
    "mode_figure": "mode shapes",
    "response_figure": "response curves",
    "force_figure": "contact force over the last cycles",
    "portrait_figure": "phase portraits",
    "impact_histograms": "how often which impact speed and impulse came",
    "impulse_phase": "impulse over the phase of the base",
    "sticking": "times in which a ball and its wall moved together",
    "old_sticking": "times in which a ball and its wall moved together",
    "base_record": "the record that moved the base",
    "contact_table": "one collision of every contact over its speed",
    "comparison": "the paper beside ours",
    "restitution": "scan of the restitution",
    "restitution_figure": "scan of the restitution",
    "response_of_starts": "response curves of both starts",
    "curves_of_starts": "peaks with ball over the frequency: median, smallest and largest of the starts in each frame",
    "mesh_convergence": "natural frequencies over the mesh",
    "mesh_convergence_figure": "natural frequencies over the mesh",
    "step_convergence": "errors of runs in steps",
    "step_convergence_figure": "errors of runs in steps",
    "quantities_over_mesh": "values and errors over the mesh",
    "quantities_over_step": "values and errors over the step",
    "quantities_over_modes": "values and errors over the modes",
    "statistics_over_mesh": "means of runs with contacts over the mesh",
    "convergence_summary": "orders and recommended numbers",
    "parameter_study": "every measure over the axes of the study, with labels (netCDF, xarray)",
    "parameter_table": "every measure and its statistics, a row for each case",
    "convergence_notes": "what was studied, with versions and notes",
    "report": "this page",
}
"""What each file is for, by its key."""

UNSIZED = frozenset({SUMMARY, OTHER_FILES["report"]})
"""Files whose size the report itself changes."""


def about_section(summary: Mapping[str, Any], study: Study | None) -> Section:
    """Versions, the compiled core, and where chance comes in."""
    rows: list[tuple[str, str]] = []
    versions, core = summary.get("versions"), summary.get("core")
    if isinstance(versions, Mapping):
        rows += [(str(name), str(version)) for name, version in versions.items()]
    if isinstance(core, Mapping):
        rows.append(
            (
                "compiled core",
                ", ".join(f"{name} {core[name]}" for name in ("target", "compiler", "kind") if name in core),
            )
        )
        if "sources" in core:
            rows.append(("its sources (SHA-256)", str(core["sources"])))
    seeds = summary.get("seeds")
    rows.append(("seeds", str(seeds) if seeds else "none: no random numbers were used"))
    if study is not None:
        rows.append(
            (
                "start",
                {"base": "at rest relative to the base", "space": "at rest in the inertial frame"}.get(
                    study.base.start, study.base.start
                ),
            )
        )
    if not isinstance(versions, Mapping):
        rows.insert(0, ("versions", "not known: the results do not say"))
    pairs = [part for name, value in rows for part in (element("dt", name), element("dd", value))]
    return Section("versions", "Versions and seeds", (element("dl.about", *pairs),))


def files_section(folder: Path, summary: Mapping[str, Any]) -> tuple[Section, tuple[str, ...]]:
    """The files of results with what each is for, and lines for those that are lost."""
    present = set(result_files(folder)) | {
        OTHER_FILES["report"],
        SUMMARY if (folder / SUMMARY).exists() else OTHER_FILES["report"],
    }
    keys = {name: key for key, name in {**OTHER_FILES, **FILES}.items()}
    rows = []
    for name in sorted(set(NAMES) & present):
        size = "" if name in UNSIZED else _size((folder / name).stat().st_size)
        rows.append((name, size, _purpose(name, keys[name])))
    rows += [
        (path.name, _size(path.stat().st_size), "a measure over the axes of the study")
        for path in sorted(folder.glob("study_*.png"))
        if STUDY_FIGURE.fullmatch(path.name)
    ]
    if is_folder(folder / STUDY_BLOCKS):
        rows.append((f"{STUDY_BLOCKS}/", "", "finished blocks of cases, from which the same study goes on"))
    for scene in sorted({name.partition("/")[0] for name in present if "/" in name}):
        frames = [name for name in present if name.startswith(f"{scene}/")]
        total = sum((folder / name).stat().st_size for name in frames)
        rows.append((f"{scene}/", _size(total), f"{len(frames)} frames of {scene}.pvd"))
    body = [
        element(
            "tr", element("td", element("a", name, href=name)), element("td.number", size), element("td", words),
        )
        for name, size, words in sorted(rows)
    ]  # fmt: skip
    head = element(
        "tr",
        element("th", "file", scope="col"),
        element("th.number", "size", scope="col"),
        element("th", "what it is for", scope="col"),
    )
    shown = element(
        "table", element("caption", "Files beside this page"), element("thead", head), element("tbody", *body)
    )
    holder = element(
        "div.table", element("div.scroll", shown, tabindex="0", role="region", aria_label="Files beside this page")
    )
    return Section("files", "Files", (holder,)), _lost(summary, present)


def _lost(summary: Mapping[str, Any], present: set[str]) -> tuple[str, ...]:
    known = summary.get("checksums")
    lost = sorted(set(map(str, known)) - present) if isinstance(known, Mapping) else []
    if not lost:
        return ()
    more = f" and {len(lost) - 5} more" if len(lost) > 5 else ""
    return (f"files that {SUMMARY} names and that are gone: {', '.join(lost[:5])}{more}",)


def _purpose(name: str, key: str) -> str:
    if key in PURPOSES:
        return PURPOSES[key]
    if name.startswith("mode_"):
        return f"mode {name.split('_')[1].partition('.')[0]} over its period, for ParaView"
    return f"the same as a figure: {name.removesuffix('.png')}.csv" if name.endswith(".png") else ""


def _size(count: int) -> str:
    for unit, factor in (("MB", 1e6), ("kB", 1e3)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count} B"
