"""The report of what a script has found: responses, curves, convergence, maps and tables under given headings."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.app.parametric.best import best_cases
from femimpact.app.report.markup import Element, element, markup
from femimpact.app.report.page import (
    MOST_BYTES,
    Conclusion,
    Page,
    Section,
    Table,
    page_bytes,
    table_element,
    table_of,
    write_page,
)
from femimpact.app.report.page_tables import (
    case_table,
    cases_of_axis,
    curve_table,
    dwell_words,
    impact_table,
    summary_table,
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
from femimpact.app.report.result_page import about_section, best_measures
from femimpact.app.report.structure_drawing import structure_element
from femimpact.app.report.views import measures_of, sections_of, spectra_of
from femimpact.app.results.picture_data import Run, SweptCurves
from femimpact.app.study.summary import kind_of_peak, peak_of_history
from femimpact.convergence.table import ConvergenceStudy, ConvergenceTable
from femimpact.errors import Fault, InputError, instance, optional, require, require_type, suggestion, takes, text
from femimpact.excitation.drives import drive_words
from femimpact.excitation.excitation import has_cycle
from femimpact.figures.study_labels import axis_names, case_columns
from femimpact.files import target_path
from femimpact.response.impacts import impact_columns
from femimpact.response.response import Response
from femimpact.scene.placed import drawn_system, placed_structure
from femimpact.signals.decay import DecayEstimate
from femimpact.structure.structure import Structure
from femimpact.sweep.curve import FrequencyResponse
from femimpact.table import column_units
from femimpact.units import typeset_number

LAST_ROWS = 10
"""Rows of a table that are kept where fewer players and pictures are not enough."""

HEAVY = {"player": "This player was left out", "picture": "This picture was left out"}
"""Classes of the elements that a page which is too large goes without, and what then stands in their place."""


def bounded_page(page: Page, most: int = MOST_BYTES) -> Page:
    """The page if it has at most so many bytes; else one with fewer players, fewer pictures, shorter tables.

    They are left out from the last to the second of either, and of every table the last rows stay. A page of many
    hundred results may still be larger.
    """
    for kind, words in HEAVY.items():
        over = len(page_bytes(page)) - most
        if over > 0:
            page = replace(page, sections=copy.deepcopy(page.sections))
            _leave_out(page, kind, f"{words} for the size of the page: a report of this result alone has it.", over)
    return page if len(page_bytes(page)) <= most else _with_shorter_tables(page)


def _leave_out(page: Page, kind: str, words: str, over: int) -> None:
    """Take elements of a class out of the page until it is smaller by so many bytes, or only the first is left."""
    for holder, heavy in reversed(list(_holders(page, kind))[1:]):
        if over <= 0:
            break
        note = element("p", words)
        over -= len(markup(heavy).encode()) - len(markup(note).encode())
        holder[list(holder).index(heavy)] = note


def _with_shorter_tables(page: Page) -> Page:
    """The page with the last rows alone of every table."""
    for body in (one for section in page.sections for part in section.content for one in part.iter("tbody")):
        for row in list(body)[:-LAST_ROWS]:
            body.remove(row)
    return replace(page, notes=(*page.notes, f"of every table the last {LAST_ROWS} rows at most"))


def _holders(page: Page, kind: str) -> Iterator[tuple[Any, Element]]:
    """Every element of a class with what holds it."""
    for section in page.sections:
        for part in section.content:
            for holder in part.iter():
                for child in holder:
                    if child.get("class") == kind:
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
            for one in sections_of(best_measures(part, best[heading][0]), {}, f"best-{i + 1}-")
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
            note = f"at {typeset_number(curve.peak_frequency)} Hz{f'; {TRANSIENT}' if curve.peak_is_transient else ''}"
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
            residual = typeset_number(100 * float(one.energy.residual), 2)
            found.append(Conclusion(f"Energy unaccounted for, {heading}", residual, "%", note="of the energy put in"))
    return found


# ---- parts ----------------------------------------------------------------------------------------


def _sections(number: int, heading: str, part: Any, structure: Structure | None) -> list[Section]:
    """The sections of one part: the first is under its heading, the others name what they hold besides."""
    key = f"part-{number + 1}"
    records, beside = _shown(heading, part, structure, key)
    made = sections_of(records, beside, f"{key}-")
    return [
        replace(section, key=section.key if i else key, heading=f"{heading}: {section.heading}" if i else heading)
        for i, section in enumerate(made)
    ]


def _shown(
    heading: str, part: Any, structure: Structure | None, key: str
) -> tuple[list[Any], dict[str, list[Element]]]:
    """What pictures are drawn of, and words and tables by the section in which they stand."""
    curves = _curves(heading, part)
    if curves:
        words = element("p", dwell_words(next(iter(curves.values()))))
        return [SweptCurves(curves)], {"response": [words, table_element(curve_table(curves))]}
    if isinstance(part, Response):
        return _of_run(part, structure, key)
    if isinstance(part, ConvergenceTable):
        return [part], {"convergence": [table_element(table) for table in _tables_of(part)]}
    if isinstance(part, ConvergenceStudy):
        each = list(part.tables.values())
        return each, {"convergence": [table_element(table) for one in each for table in _tables_of(one)]}
    if isinstance(part, DecayEstimate):
        table = table_element(table_of("Over the amplitude", *part.columns()))
        return [part], {"decay": [*(element("p", str(mode)) for mode in part.modes), table]}
    if hasattr(part, "data_vars") and hasattr(part, "dims"):
        measures = measures_of(part)
        require(bool(measures), f"parts.{heading}", "a dataset", "", "must hold numbers over one axis or more")
        if not is_parameter_study(part):
            return measures, {}
        about = about_section(study_versions(part), None)
        return measures, {"cases": [table_element(case_table(*case_columns(part))), *about.content]}
    return [], {"study": [_table(heading, part)]}


def _of_run(run: Response, structure: Structure | None, key: str) -> tuple[list[Any], dict[str, list[Element]]]:
    beside: dict[str, list[Element]] = {}
    player = None if structure is None else player_element(run, structure, None, f"{key}-player")
    if player is not None:
        beside["player"] = [player]
    impacts = impact_table(*impact_columns(run.impacts))
    if impacts is not None:
        beside["impacts"] = [table_element(impacts)]
    if not run.time.size:
        words = "The history went to a sink, and there are no impacts."
        return [], beside or {"motion": [element("p", words)]}
    spectra, refused = spectra_of(run)
    beside["drive"] = [element("p", words) for words in drive_words(run.base)]
    beside["spectra"] = [element("p", words) for words in refused]
    return [Run(run), *spectra], beside


def _tables_of(table: ConvergenceTable) -> list[Table]:
    return [summary_table(*table.summary()), *filter(None, [cases_of_axis(*table.columns())])]


def _table(heading: str, part: Any) -> Element:
    """A table of a frame, a record or columns."""
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
