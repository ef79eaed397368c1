"""The report of what a script has found: responses, curves, convergence, maps and tables under given headings."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.app.parametric.best import best_cases
from femimpact.app.report.charts import (
    axis_section,
    curve_table,
    curves_section,
    energy_section,
    history_section,
    impacts_section,
    summary_table,
)
from femimpact.app.report.drive_charts import drive_section, spectra_section
from femimpact.app.report.maps import maps_section
from femimpact.app.report.page import (
    MOST_BYTES,
    Conclusion,
    Page,
    Section,
    page_bytes,
    table_element,
    table_of,
    write_page,
)
from femimpact.app.report.player import player_element
from femimpact.app.report.result_conclusions import (
    TRANSIENT,
    number_conclusion,
    study_conclusions,
    study_failures,
    study_lead,
    study_missing,
    study_versions,
)
from femimpact.app.report.result_page import about_section, best_sections, cases_section
from femimpact.app.report.structure_drawing import structure_element
from femimpact.app.study.summary import drive_name, kind_of_peak, peak_of_history
from femimpact.convergence import ConvergenceStudy, ConvergenceTable
from femimpact.errors import Fault, InputError, instance, optional, require, require_type, suggestion, takes, text
from femimpact.excitation.excitation import has_cycle
from femimpact.figures.study_labels import axis_names, case_columns
from femimpact.files import target_path
from femimpact.response.impacts import impact_columns
from femimpact.response.response import Response
from femimpact.scene.placed import drawn_system, placed_structure
from femimpact.signals.decay import DecayEstimate
from femimpact.structure.structure import Structure
from femimpact.svg import Element, chart_element, element, markup, thinned_line
from femimpact.sweep import FrequencyResponse
from femimpact.table import column_units
from femimpact.units import typeset

POINT = re.compile(r"([ML])(-?\d+) (-?\d+)")
"""A point of a line or of dots, as `svg` writes it."""

FEWER = (600, 200, 60)
"""Points of a line that are tried in turn."""

LAST_ROWS = 10
"""Rows of a table that are kept where fewer points and players are not enough."""


def bounded_page(page: Page, most: int = MOST_BYTES) -> Page:
    """The page if it has at most so many bytes; else one with fewer points of its lines, fewer players, shorter tables.

    Of every stretch of a line its lowest and its highest point stay. Players go from the last to the second, and of
    every table the last rows stay. A page of many hundred results may still be larger.
    """
    if len(page_bytes(page)) <= most:
        return page
    for points in FEWER:
        words = f"{points} points of a line at most, its extremes among them: a report has at most {most / 1e6:g} MB"
        made = replace(_thinned(page, points), notes=(*page.notes, words))
        if len(page_bytes(made)) <= most:
            return made
    over = len(page_bytes(made)) - most
    over -= _leave_out_players(made, over)
    return _with_shorter_tables(made) if over > 0 else made


def _thinned(page: Page, most: int) -> Page:
    sections = copy.deepcopy(page.sections)
    for path in (one for section in sections for part in section.content for one in part.iter("path")):
        path.set("d", thinned_path(path.get("d", ""), most))
    return replace(page, sections=sections)


def thinned_path(path: str, most: int) -> str:
    """The path with at most so many points, but for two of every piece; one that is closed or has other parts stays."""
    found = POINT.findall(path)
    if len(found) <= most or path.endswith("Z") or "V" in path or "H" in path:
        return path
    end = "h0" if "h0" in path else ""
    starts = [i for i, (kind, _, _) in enumerate(found) if kind == "M"]
    # dots are pieces of one point each, and one line of them is thinned
    pieces = [found] if end else [found[a:b] for a, b in zip(starts, [*starts[1:], len(found)], strict=True)]
    parts = list[str]()
    for piece in pieces:
        heights = np.array([float(y) for _, _, y in piece])
        kept = thinned_line(heights, max(most * len(piece) // len(found), 4))
        parts += [f"{piece[i][0]}{piece[i][1]} {piece[i][2]}{end}" for i in kept.tolist()]
    return "".join(parts)


def _leave_out_players(page: Page, over: int) -> int:
    """Take players out of the page until it is smaller by so many bytes, or only one is left; by how many it is."""
    left_out = "This player was left out for the size of the page: a report of this result alone has it."
    saved = 0
    for holder, player in reversed(list(_holders(page))[1:]):
        if saved >= over:
            break
        note = element("p", left_out)
        saved += len(markup(player).encode()) - len(markup(note).encode())
        holder[list(holder).index(player)] = note
    return saved


def _with_shorter_tables(page: Page) -> Page:
    """The page with the last rows alone of every table."""
    for body in (one for section in page.sections for part in section.content for one in part.iter("tbody")):
        for row in list(body)[:-LAST_ROWS]:
            body.remove(row)
    return replace(page, notes=(*page.notes, f"of every table the last {LAST_ROWS} rows at most"))


def _holders(page: Page) -> Iterator[tuple[Element, Element]]:
    """Every player with what holds it."""
    for section in page.sections:
        for part in section.content:
            for holder in part.iter():
                for child in holder:
                    if child.get("class") == "player":
                        yield holder, child


ALLOWED = (
    "must be a Response, a FrequencyResponse or a mapping of names to them, a ConvergenceTable, a ConvergenceStudy, a "
    "DecayEstimate, an xarray.Dataset, a pandas.DataFrame, a record with to_pandas, or a mapping of names to columns "
    "of one length"
)


@takes(
    structure=optional(instance(Structure)),
    title=text(),
    notes=text(several=True),
    worst_over=optional(text(several=True)),
)
def report(
    path: str | Path,
    parts: Mapping[str, Any],
    structure: Structure | None = None,
    title: str = "Results",
    notes: tuple[str, ...] = (),
    worst_over: tuple[str, ...] | None = None,
) -> Path:
    """Write what a script has found as one HTML file that opens in any browser, without a connection.

    Parameters
    ----------
    path : str or Path
    parts : mapping of str to result
        Each under its heading: a `Response`, a `FrequencyResponse` or a mapping of names to several, a
        `ConvergenceTable`, a `ConvergenceStudy`, a `DecayEstimate`, the dataset of `parameter_study` (what is best,
        maps and cases), another `xarray.Dataset` (quantities over two axes become maps), a
        `pandas.DataFrame`, any record with `to_pandas`, or a mapping of names to columns.
    structure : Structure, optional
        Is drawn, and gives the player of a response with snapshots its beam.
    title : str
    notes : tuple of str
    worst_over : tuple of str, optional
        Paths of the axes of parameter studies over which the worst counts, as of `best_case`.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If a part is none of these, no parameter study has an axis of `worst_over`, or no file can be there.

    Examples
    --------
    >>> import femimpact as fi
    >>> run = fi.integrate(system, fi.Sine(amplitude=0.2e-3, frequency=5.0), fi.EventDriven(), duration=2.0)
    >>> fi.report("report.html", {"Run": run}, structure).name  # doctest: +SKIP
    'report.html'
    """
    file = target_path(path)
    require_type(parts, Mapping, "parts")
    for heading in parts:
        require_type(heading, str, "parts")
    made = [
        section for i, (heading, part) in enumerate(parts.items()) for section in _sections(i, heading, part, structure)
    ]
    responses = {heading: part for heading, part in parts.items() if isinstance(part, Response)}
    studies = {heading: part for heading, part in parts.items() if is_parameter_study(part)}
    axes = {name for part in studies.values() for name in axis_names(part)}
    for name in worst_over or ():
        require(name in axes, "worst_over", name, "", f"is no axis of a parameter study: {suggestion(name, axes)}")
    best = {
        heading: best_cases(part, None, worst_over and tuple(name for name in worst_over if name in axis_names(part)))
        for heading, part in studies.items()
    }
    curves = {
        name if name == heading else f"{heading}, {name}": curve
        for heading, part in parts.items()
        for name, curve in _curves(heading, part).items()
    }
    speaking = {**responses, **curves, **{h: part for h, part in parts.items() if isinstance(part, DecayEstimate)}}
    page = Page(
        title=title,
        lead=tuple(text for part in studies.values() for text in study_lead(part)),
        drawing=_drawing(structure, responses),
        conclusions=(
            *_of_curves(curves),
            *_of_responses(responses),
            *(one for heading, part in studies.items() for one in study_conclusions(part, *best[heading])),
        ),
        missing=_of_studies(studies, study_missing),
        warnings=(*_said("warnings", speaking), *_of_studies(studies, study_failures)),
        notes=(*notes, *_said("notes", speaking)),
        sections=tuple(made),
        first=tuple(
            one
            for i, (heading, part) in enumerate(studies.items())
            for one in best_sections(part, best[heading][0], f"best-{i + 1}")
        ),
    )
    return write_page(file, bounded_page(page))


def _curves(heading: str, part: Any) -> dict[str, FrequencyResponse]:
    """Response curves of a part by their names; none of another part."""
    if isinstance(part, FrequencyResponse):
        return {heading: part}
    if isinstance(part, Mapping) and part and all(isinstance(one, FrequencyResponse) for one in part.values()):
        return {str(name): one for name, one in part.items()}
    return {}


def _said(kind: str, found: Mapping[str, Any]) -> tuple[str, ...]:
    texts = [f"{heading}: {said}" for heading, part in found.items() for said in getattr(part, kind)]
    return tuple(dict.fromkeys(texts))


def is_parameter_study(part: Any) -> bool:
    """True for the dataset of `parameter_study` that has what it tells of its cases."""
    names, about = getattr(part, "data_vars", ()), getattr(part, "attrs", {})
    return {"finished", "failed_starts", "periodic_starts", "failure"} <= {*names} and {"starts", "place"} <= {*about}


def _of_studies(studies: Mapping[str, Any], lines: Callable[[Any], tuple[str, ...]]) -> tuple[str, ...]:
    """Lines on parameter studies, each with its heading."""
    return tuple(f"{heading}: {line}" for heading, part in studies.items() for line in lines(part))


def _study(key: str, heading: str, data: Any) -> list[Section]:
    """Maps of a parameter study, a row for each case, and what made it."""
    maps = maps_section(data, key, heading)
    cases = cases_section(*case_columns(data), key=f"{key}-cases")
    about = about_section(study_versions(data), None)
    rest = [cases, replace(about, key=f"{key}-versions")]
    return [*([maps] if maps is not None else []), *(replace(one, heading=f"{heading}: {one.heading}") for one in rest)]


def _drawing(structure: Structure | None, responses: Mapping[str, Response]) -> Element | None:
    if structure is None:
        return None
    points = next((dict(one.system.points) for one in responses.values()), {})
    try:
        return structure_element(placed_structure(structure, drawn_system(structure, points)))
    except KeyError as error:
        allowed = f"has a part at {error}, a point of a mesh: give a Response on that mesh among the parts"
        raise InputError([Fault("structure", None, "", allowed)]) from None


def _of_curves(curves: Mapping[str, FrequencyResponse]) -> list[Conclusion]:
    found = []
    for name, curve in curves.items():
        if np.any(np.isfinite(curve.peak)):
            note = f"at {typeset(curve.peak_frequency)} Hz{f'; {TRANSIENT}' if curve.peak_is_transient else ''}"
            label, sample = f"Largest peak, {name}", curve.peak_is_sample
            found.append(number_conclusion(label, curve.peak_amplitude, curve.unit, one_sample=sample, note=note))
    return found


def _of_responses(responses: Mapping[str, Response]) -> list[Conclusion]:
    found = []
    for heading, one in responses.items():
        count, peak, kind = len(one.impacts) + one.impacts.dropped, peak_of_history(one), kind_of_peak(one)
        if count:
            found.append(Conclusion(f"Motion, {heading}", one.regime.label, note=f"{count} impacts"))
        if math.isfinite(peak):
            over = "over the last third of the cycles" if has_cycle(one.base) else "of the whole run"
            note = f"{over}; {TRANSIENT}" if kind["peak_is_transient"] else over
            found.append(
                number_conclusion(f"Peak, {heading}", peak, "m", one_sample=kind["peak_is_one_start"], note=note)
            )
        if one.energy is not None:
            residual = typeset(100 * float(one.energy.residual), 2)
            found.append(Conclusion(f"Energy unaccounted for, {heading}", residual, "%", note="of the energy put in"))
    return found


# ---- parts ----------------------------------------------------------------------------------------


def _sections(number: int, heading: str, part: Any, structure: Structure | None) -> list[Section]:
    """The sections of one part, by the first kind that it is of."""
    key = f"part-{number + 1}"
    if isinstance(part, Response):
        return _response(key, heading, part, structure)
    curves = _curves(heading, part)
    if curves:
        section = curves_section(curves, key, heading)
        return [Section(key, heading, (*section.content, table_element(curve_table(curves))))]
    if is_parameter_study(part):
        return _study(key, heading, part)
    for kind, make in KINDS.items():
        if isinstance(part, kind):
            return [
                replace(
                    section,
                    key=f"{key}-{i}" if i else key,
                    heading=heading if section.heading in (heading, "") else f"{heading}: {section.heading}",
                )
                for i, section in enumerate(make(part))
            ]
    return [Section(key, heading, (_table(heading, part),))]


def _response(key: str, heading: str, response: Response, structure: Structure | None) -> list[Section]:
    sections = []
    if structure is not None:
        player = player_element(response, structure, None)
        sections += (
            [Section(f"{key}-player", f"{heading}: the motion", (element("div", player),))]
            if player is not None
            else []
        )
    if response.time.size:
        history = response.to_xarray()
        energy = energy_section(history, drive_name(response.base))
        sections.append(drive_section(response.base, float(response.time[-1]), f"{key}-drive", f"{heading}: the drive"))
        sections.append(history_section(history, key=key, heading=heading))
        spectra = spectra_section(response, f"{key}-spectra", f"{heading}: spectra")
        sections += [spectra] if spectra is not None else []
        sections += [Section(f"{key}-energy", f"{heading}: energy", energy.content)] if energy is not None else []
    impacts = impacts_section(*impact_columns(response.impacts))
    sections += [Section(f"{key}-impacts", f"{heading}: impacts", impacts.content)] if impacts is not None else []
    return sections or [Section(key, heading, (element("p", "The history went to a sink, and there are no impacts."),))]


def _convergence(table: ConvergenceTable) -> list[Section]:
    kind = "statistics" if np.any(table.is_statistic) else "convergence"
    section = axis_section(table.axis, *table.columns(), kind=kind)
    columns, _ = table.summary()
    summary = table_element(summary_table(columns))
    return [Section(section.key, section.heading, (*section.content, summary))] if section is not None else []


def _decay(found: DecayEstimate) -> list[Section]:
    chart = found._picture
    rows = [element("p", str(mode)) for mode in found.modes]
    table = table_element(table_of("Over the amplitude", *found.columns()))
    return [Section("decay", "", (*rows, *([chart_element(chart)] if chart else []), table))]


KINDS: Mapping[type, Callable[[Any], list[Section]]] = {
    ConvergenceTable: _convergence,
    ConvergenceStudy: lambda study: [one for table in study.tables.values() for one in _convergence(table)],
    DecayEstimate: _decay,
}
"""Function that makes the sections of a part, by the kind of the part."""


def _table(heading: str, part: Any) -> Element:
    """A table of a frame, a record or columns; maps of a dataset."""
    if hasattr(part, "data_vars") and hasattr(part, "dims"):
        section = maps_section(part)
        require(section is not None, f"parts.{heading}", "a dataset", "", "must hold numbers over one axis or more")
        return element("div", *(section.content if section is not None else ()))
    units: Mapping[str, str] = {}
    if callable(getattr(part, "to_pandas", None)) and not isinstance(part, type):
        units = column_units(part) if hasattr(part, "__dataclass_fields__") else {}
        part = part.to_pandas()
    columns: dict[str, Any] = {}
    if hasattr(part, "columns") and hasattr(part, "reset_index"):
        units = {**units, **part.attrs.get("units", {})}
        named = part.index.name is not None
        frame = part.reset_index() if named else part
        columns = {str(name): frame[name].to_numpy() for name in frame.columns}
    elif isinstance(part, Mapping) and part:
        columns = {str(name): np.asarray(values) for name, values in part.items()}
    fits = bool(columns) and all(one.ndim == 1 and one.dtype.kind in "biufUSO" for one in columns.values())
    fits = fits and len({one.size for one in columns.values()}) == 1
    require(fits, f"parts.{heading}", type(part).__name__, "", ALLOWED)
    return table_element(table_of(heading, columns, units))
