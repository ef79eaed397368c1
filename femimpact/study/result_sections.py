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
    REPORT,
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
        content.append(
            table_element(
                Table("The paper beside ours: median and range over starts", header, rows, FILES["comparison"].name)
            )
        )
    remarks = texts_of(results.summary.get("remarks"))
    if remarks:
        content.append(element("div.said", element("h3", "Where they differ, and why"), list_element(remarks, "notes")))
    scan = results.table(FILES["restitution"].name)
    if scan is not None:
        units = results.units(FILES["restitution"].name)
        content.append(table_element(table_of("Scan of the restitution", scan, units, FILES["restitution"].name)))
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
        drawn = [FILES[key].name for key in ("movie", "deflection_scene")]
        drawn = [name for name in drawn if (results.folder / name).exists()]
        if drawn:
            results.miss(
                f"{FILES['snapshots'].name}: results of an earlier version have none for a player; "
                f"{drawn[0]} shows the motion"
            )
        return []
    made = player_element(film.response, film.structure, film.exaggeration)
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
    name = FILES["impacts"].name
    columns = results.table(name)
    made = None if columns is None else impacts_section(columns, results.units(name), name)
    return [] if made is None else [made]


def _modes(results: ResultReading) -> list[Section]:
    found = results.modes
    name = FILES["modes"].name
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
    recommended = results.table(FILES["convergence_summary"].name)
    if recommended is not None:
        made = summary_table(recommended, FILES["convergence_summary"].name)
        sections.append(Section("recommended", "Recommended numbers", (table_element(made),)))
    for axis in ("mesh", "step", "modes"):
        name = FILES[f"quantities_over_{axis}"].name
        columns = results.table(name)
        section = None if columns is None else axis_section(axis, columns, results.units(name), name)
        sections += [] if section is None else [section]
    name = FILES["statistics_over_mesh"].name
    columns = results.table(name)
    section = None if columns is None else axis_section("mesh", columns, results.units(name), name, statistics=True)
    sections += [] if section is None else [section]
    name = FILES["step_convergence"].name
    columns = results.table(name)
    section = None if columns is None else steps_section(columns, name)
    return sections + ([] if section is None else [section])


def _parameter_study(results: ResultReading) -> list[Section]:
    """Every measure over the axes of the study, and a row for each case."""
    data = results.parameter_study
    maps = None if data is None else maps_section(data, "study", "The measures over the axes")
    name = FILES["parameter_table"].name
    columns = results.table(name)
    sections = [] if maps is None else [maps]
    if columns is not None:
        made = table_of("A row for each case", columns, results.units(name), name)
        sections.append(Section("cases", "Cases", (table_element(made),)))
    return sections


def _contact_table(results: ResultReading) -> list[Section]:
    name = FILES["contact_table"].name
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


UNSIZED = frozenset({SUMMARY, REPORT})
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
    present = {*result_files(folder), REPORT, *([SUMMARY] if (folder / SUMMARY).exists() else [])}
    rows = [
        (file.name, "" if file.name in UNSIZED else _size((folder / file.name).stat().st_size), file.purpose)
        for file in FILES.values()
        if file.name in present
    ]
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


def _size(count: int) -> str:
    for unit, factor in (("MB", 1e6), ("kB", 1e3)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count} B"
