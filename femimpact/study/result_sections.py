"""The sections of the report of results, each from the files that it is made of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from femimpact.export.report.blocks import Section, Table, list_element, table_element, table_of
from femimpact.export.report.convergence import axis_section, steps_section, summary_table
from femimpact.export.report.impacts import impacts_section
from femimpact.export.report.maps import maps_section
from femimpact.export.report.mode_shapes import modes_section
from femimpact.export.report.motion import energy_section, history_section
from femimpact.export.report.player import player_element
from femimpact.export.report.response_curves import curves_section
from femimpact.export.report.structure_parts import place_finder
from femimpact.study.picture_data import read_bands, read_curves, read_film, read_last_cycles
from femimpact.study.result_files import FILES, OTHER_FILES
from femimpact.study.result_reading import ResultReading, texts_of
from femimpact.svg.elements import Element, element

__all__ = ["SECTIONS"]

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
    finder = place_finder(film.structure, film.response.system.points)
    made = player_element(film.response, film.structure, finder, film.exaggeration)
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
