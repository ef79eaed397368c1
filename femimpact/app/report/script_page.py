"""The report of what a script has found: responses, curves, convergence, maps and tables under given headings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from femimpact import __version__
from femimpact.app.parametric.best import best_cases
from femimpact.app.parametric.measured_peaks import Calibration
from femimpact.app.report.markup import Element, element, picture_element
from femimpact.app.report.page import (
    Conclusion,
    Page,
    Section,
    table_element,
    table_of,
    write_page,
)
from femimpact.app.report.page_tables import beside, is_parameter_study, summary_table
from femimpact.app.report.player import player_element
from femimpact.app.report.result_conclusions import (
    TRANSIENT,
    answer_of,
    answer_of_runs,
    best_of,
    convergence_conclusions,
    factor_words,
    number_conclusion,
    result_conclusions,
    study_conclusions,
    study_failures,
    study_lead,
    study_missing,
    study_versions,
)
from femimpact.app.report.result_page import KEY_LETTERS, about_section, best_measures, records_of, worst_words
from femimpact.app.report.structure_drawing import structure_element
from femimpact.app.report.views import Measure, measures_of, sections_of, spectra_of
from femimpact.app.results.picture_data import ResultReading, Run, SweptCurves, read_results
from femimpact.app.results.results import StudyResults
from femimpact.app.study.findings import Findings, place_words
from femimpact.app.study.prepared import carried_words
from femimpact.app.study.summary import kind_of_peak, peak_of_history, rms_of_history
from femimpact.arrays import thinned_line
from femimpact.convergence.table import ConvergenceStudy, ConvergenceTable
from femimpact.errors import (
    Fault,
    InputError,
    instance,
    optional,
    require,
    require_type,
    suggestion,
    takes,
    text,
    warns,
)
from femimpact.excitation.drives import drive_words
from femimpact.excitation.excitation import has_cycle
from femimpact.figures.study_labels import axis_names, path_words
from femimpact.files import target_path
from femimpact.integrators.planned_drive import PreflightRow
from femimpact.orbits.branch import Branch
from femimpact.orbits.figures import kind_words, stretches
from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.response.response import Response
from femimpact.scene.placed import drawn_system, placed_structure
from femimpact.signals.decay import DecayEstimate
from femimpact.signals.densities import Spectrum
from femimpact.signals.one_pole import DampingEstimate
from femimpact.signals.shock_response import ShockResponseSpectrum
from femimpact.signals.transfer import TransferFunction
from femimpact.structure.structure import Structure
from femimpact.sweep.curve import FrequencyResponse
from femimpact.table import column_units
from femimpact.units import interval_texts, number_text, quantity_text, typeset_number, unit_text

MOST_PLAYERS = 3
"""Responses of a page that have a player."""

NO_PLAYER = "The player of this run was left out for the size of the page: a report of this run alone has it."

MOST_VALUES = 400
"""Values over one axis of a dataset that a picture shows, each with a dot."""

RECORDS = (
    DecayEstimate, PeriodicOrbit, Branch, Calibration, Spectrum, TransferFunction, ShockResponseSpectrum,
)  # fmt: skip
"""Kinds of records whose pictures are all that a page has of them."""

ALLOWED = (
    "must be a Response, the StudyResults of fi.load, a FrequencyResponse or a mapping of names to them, a "
    "ConvergenceTable, a ConvergenceStudy, a DecayEstimate, a DampingEstimate, "
    "an orbit or a branch, a Calibration, a Preflight, a spectrum or a transfer function, an "
    "xarray.Dataset, a pandas.DataFrame, a figure of matplotlib, a record with to_pandas, or a mapping of names to "
    "columns of one length"
)


@warns
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
        Each under its heading: a `Response`, what `load` returns of a run, a `FrequencyResponse` or a mapping of names
        to several, a `ConvergenceTable`, a `ConvergenceStudy`, a `DecayEstimate`, a `DampingEstimate`, a
        `PeriodicOrbit`, a `Branch`, a `Calibration`, a `Preflight`, a spectrum or a `TransferFunction`, a figure or
        axes of matplotlib, the dataset of `parameter_study` (what is best, maps and cases), another `xarray.Dataset`
        (quantities over two axes become maps), a `pandas.DataFrame`, any record with `to_pandas`, or a mapping of names
        to columns.
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
    parts = {name: read_results(one.directory) if isinstance(one, StudyResults) else one for name, one in parts.items()}
    players = _players(parts, structure)
    sections = [
        section
        for i, (heading, part) in enumerate(parts.items())
        for section in _sections(i, heading, part, players.get(heading))
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
    speaking: dict[str, Any] = {
        **responses,
        **curves,
        **{h: part for h, part in parts.items() if isinstance(part, DecayEstimate | DampingEstimate)},
    }
    read = {heading: part for heading, part in parts.items() if isinstance(part, ResultReading)}
    speaking |= {heading: part.findings for heading, part in read.items()}
    tables = {
        heading if table is part else f"{heading}, {table.axis}": table
        for heading, part in parts.items()
        for table in (part.tables.values() if isinstance(part, ConvergenceStudy) else [part])
        if isinstance(table, ConvergenceTable)
    }
    needed = tuple(one for heading, table in tables.items() for one in _of_convergence(heading, table))
    conclusions = (
        *(one for heading, part in parts.items() for one in _of_damping(heading, part)),
        *(one for heading, part in studies.items() for one in study_conclusions(part, *best[heading])),
        *_of_curves(curves),
        *_of_responses(responses),
        *(one for heading, part in parts.items() for one in _of_record(heading, part)),
        *(
            replace(one, label=f"{one.label}, {heading}")
            for heading, part in read.items()
            for one in result_conclusions(part, best_of(part))
        ),
    )
    accuracy = next((table.accuracy for table in tables.values()), None)
    page = Page(
        title=title,
        answer=_compared(curves)
        or _answer_of(responses)
        or answer_of(Findings(accuracy=accuracy), conclusions or needed),
        foot=" · ".join((f"femimpact {__version__}", *map(_computed_by, studies.values()))),
        lead=(
            *dict.fromkeys(f"{table.problem}." for table in tables.values() if table.problem),
            *(
                text
                for heading, part in studies.items()
                for text in (*study_lead(part), *worst_words(part, next(iter(best[heading][0].values()), None)))
            ),
        ),
        drawing=_drawing(structure, responses),
        conclusions=(*conclusions, *needed),
        missing=(
            *_of_studies(studies, study_missing),
            *(f"{heading}: {text}" for heading, part in read.items() for text in part.missing),
        ),
        warnings=(*_said("warnings", speaking), *_of_studies(studies, study_failures)),
        notes=(*notes, *_said("notes", speaking | tables)),
        sections=tuple(sections),
        first=tuple(
            one
            for i, (heading, part) in enumerate(studies.items())
            for one in sections_of(best_measures(part, best[heading][0]), {}, f"best-{i + 1}-")
        ),
    )
    return write_page(file, page)


def _answer_of(responses: Mapping[str, Response]) -> str:
    """What differs between two responses by what one of them carries; "" where there are none.

    They are named "without X" and "with X", or are the only two, under one drive.
    """
    named = {heading.lower(): (peak_of_history(one), rms_of_history(one)) for heading, one in responses.items()}
    pairs = [(name.removeprefix("without "), numbers) for name, numbers in named.items() if name.startswith("without ")]
    both = [(carried, alone, named[f"with {carried}"]) for carried, alone in pairs if f"with {carried}" in named]
    if len(responses) == 2 and not both:
        bare, loaded = sorted(responses, key=lambda heading: len(responses[heading].system.contacts))
        system, drives = responses[loaded].system, {tuple(drive_words(one.base)) for one in responses.values()}
        if system.contacts and not responses[bare].system.contacts and len(drives) == 1:
            both = [(carried_words(system), named[bare.lower()], named[loaded.lower()])]
    places = {place_words(one.system.default_place) for one in responses.values()}
    return answer_of_runs(*both[0], *places) if len(both) == len(places) == 1 else ""


def _computed_by(study: Any) -> str:
    """Core and seeds of a parameter study."""
    findings = study_versions(study)
    return f"core {str(findings.core.get('sources', 'not known'))[:KEY_LETTERS]}, seeds: {'; '.join(findings.seeds)}"


def _curves(heading: str, part: Any) -> dict[str, FrequencyResponse]:
    """Response curves of a part by their names; none of another part."""
    if isinstance(part, FrequencyResponse):
        return {heading: part}
    if isinstance(part, Mapping) and part and all(isinstance(one, FrequencyResponse) for one in part.values()):
        return {str(name): one for name, one in part.items()}
    return {}


def _said(kind: str, found: Mapping[str, Any]) -> tuple[str, ...]:
    texts = [f"{heading}: {said}" for heading, part in found.items() for said in getattr(part, kind, ())]
    return tuple(dict.fromkeys(texts))


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
        if math.isfinite(peak):
            over = "over the last third of the cycles" if has_cycle(one.base) else "of the whole run"
            note = f"{over}; {TRANSIENT}" if kind["peak_is_transient"] else over
            found.append(
                number_conclusion(f"Peak, {heading}", peak, "m", one_sample=kind["peak_is_one_start"], note=note)
            )
        if count:
            found.append(Conclusion(f"Motion, {heading}", one.regime.label, note=f"{count} impacts"))
        if one.energy is not None:
            residual = typeset_number(100 * float(one.energy.residual), 2)
            found.append(Conclusion(f"Energy unaccounted for, {heading}", residual, "%", note="of the energy put in"))
    return found


def _of_damping(heading: str, part: Any) -> Iterator[Conclusion]:
    """Damping ratios of an estimate; of another part nothing."""
    level, estimates = 95, list[tuple[float, float, tuple[float, float]]]()
    if isinstance(part, DecayEstimate):
        level = round(100 * part.level)
        estimates = [(one.damping_ratio, one.frequency, one.damping_ratio_interval) for one in part.modes]
    elif isinstance(part, DampingEstimate):
        estimates = [(part.ratio, part.frequency, part.interval)]
    for ratio, frequency, ends in estimates:
        if math.isfinite(ratio):
            value, low, high = interval_texts(*(100.0 * one for one in (ratio, *ends)))
            words = f"{level} % interval {low} to {high} %" if all(map(math.isfinite, ends)) else ""
            note = f"at {typeset_number(frequency)} Hz"
            yield Conclusion(
                f"Damping ratio, {heading}", value if words else number_text(100.0 * ratio), "%", words, note=note
            )


def _of_convergence(heading: str, table: ConvergenceTable) -> Iterator[Conclusion]:
    """What an accuracy takes, by a table of convergence."""
    columns = {**table.summary()[0], "axis": np.full(table.name.size, table.axis)}
    yield from (replace(one, note=f"{one.note}; {heading}") for one in convergence_conclusions(columns, table.accuracy))


def _of_record(heading: str, part: Any) -> Iterator[Conclusion]:
    """What an orbit, a branch, a transfer function, a calibration or a planned test says; of another part nothing."""
    if isinstance(part, PeriodicOrbit):
        kind, largest = "stable" if part.is_stable else "unstable", float(np.abs(part.multipliers).max(initial=0.0))
        note = f"{kind}, period {typeset_number(part.period)} s, largest multiplier {typeset_number(largest)}"
        yield number_conclusion(f"Largest motion, {heading}", float(np.max(part.steady().peak)), "m", note=note)
    elif isinstance(part, Branch):
        ends = " to ".join(typeset_number(end) for end in (part.values.min(), part.values.max()))
        changes = [f"{kind_words(one.kind)} at {typeset_number(one.value)}" for one in part.bifurcations]
        reach = [part.values[points] for points, is_stable in stretches(part) if is_stable]
        stable = ", ".join(f"{typeset_number(one.min())} to {typeset_number(one.max())}" for one in reach)
        some = f"stable {stable} {part.unit}".rstrip() if reach else "none of them stable"
        stable = "all of them stable" if part.is_stable.all() else some
        swept = part.parameter.rpartition(".")[2].replace("_", " ")
        yield Conclusion(f"Range of {swept}, {heading}", ends, part.unit, note=", ".join((stable, *changes)))
    elif isinstance(part, TransferFunction):
        for name, values in part.values.items():
            gain = np.where(np.isfinite(values), np.abs(values), -np.inf)
            if gain.max(initial=-np.inf) >= 0.0:
                label, note = f"Largest {name} over {part.of}", f"at {typeset_number(part.frequency[gain.argmax()])} Hz"
                yield number_conclusion(f"{label}, {heading}", float(gain.max()), part.units[name], note=note)
    elif isinstance(part, Spectrum):
        largest = int(np.argmax(part.values))
        value, note = typeset_number(part.values[largest]), f"at {typeset_number(part.frequency[largest])} Hz"
        yield Conclusion(f"Largest {part.kind} of {part.channel}, {heading}", value, part.unit, note=note)
    elif isinstance(part, ShockResponseSpectrum):
        largest = int(np.argmax(part.acceleration))
        note = f"at {typeset_number(part.frequency[largest])} Hz"
        label = f"Largest response to the shock, {heading}"
        yield number_conclusion(label, float(part.acceleration[largest]), "m/s^2", note=note)
    elif isinstance(part, Calibration):
        for one in part.parameters:
            ends = f"90 % interval {unit_text(one.low, one.unit)} to {unit_text(one.high, one.unit)}"
            bound = "both bounds" if one.bound == "both" else f"the {one.bound} bound"
            note = f"no interval: it reaches {bound}" if one.bound else ends
            label = f"{path_words(one.path).capitalize()}, {heading}"
            yield number_conclusion(label, one.median, one.unit, note=note)
    elif any(isinstance(row, PreflightRow) for row in getattr(part, "rows", ())):
        names = [row.what for row in part.rows if row.passed]
        yield Conclusion(f"Limits that are passed, {heading}", str(len(names) or "none"), note=", ".join(names))


def _compared(curves: Mapping[str, FrequencyResponse]) -> str:
    """The largest peaks of two curves of one unit beside each other; empty for others."""
    peaks = [one for one in curves.items() if np.any(np.isfinite(one[1].peak))]
    if len(peaks) != 2 or peaks[0][1].unit != peaks[1][1].unit or not all(one.peak_amplitude > 0 for _, one in peaks):
        return ""
    first, second = (
        f"{quantity_text(one.peak_amplitude, one.unit, 3)} at {number_text(one.peak_frequency, 3)} Hz ({name})"
        for name, one in peaks
    )
    change = factor_words(peaks[0][1].peak_amplitude / peaks[1][1].peak_amplitude)
    return f"Largest peak from {first} to {second}: {change}."


# ---- parts ----------------------------------------------------------------------------------------


def _sections(number: int, heading: str, part: Any, player: Element | None) -> list[Section]:
    """The sections of one part: the first is under its heading, the others name what they hold besides."""
    key = f"part-{number + 1}"
    records, elements = _shown(heading, part, key)
    shown: dict[str, list[Element]] = {} if player is None else {"player": [player]}
    for place, one in (*elements, *(pair for record in records for pair in beside(record))):
        shown.setdefault(place, []).append(one)
    return [
        replace(section, key=section.key if i else key, heading=f"{heading}: {section.heading}" if i else heading)
        for i, section in enumerate(sections_of(records, shown, f"{key}-"))
    ]


def _shown(heading: str, part: Any, key: str) -> tuple[list[Any], list[tuple[str, Element]]]:
    """What pictures are drawn of, and further words and tables with the section in which they stand."""
    curves = _curves(heading, part)
    if curves:
        return [SweptCurves(curves)], []
    if isinstance(part, Response):
        if not part.time.size:
            impacts = [pair for pair in beside(Run(part)) if pair[0] == "impacts"]
            words = element("p", "The history went to a sink, and there are no impacts.")
            return [], impacts or [("motion", words)]
        spectra, refused = spectra_of(part)
        return [Run(part), *spectra], [("spectra", element("p", words)) for words in refused]
    if isinstance(part, ResultReading):
        found, refused = records_of(part, best_of(part)[0])
        return found, [("spectra", element("p", words)) for words in refused]
    if isinstance(part, ConvergenceTable | ConvergenceStudy):
        tables = list(part.tables.values()) if isinstance(part, ConvergenceStudy) else [part]
        return tables, [("convergence", table_element(summary_table(*table.summary()))) for table in tables]
    if isinstance(part, RECORDS):
        return [part], []
    if isinstance(part, DampingEstimate):
        return [], [("decay", element("p", str(part)))]
    if any(kind.__module__.startswith("matplotlib.") for kind in type(part).__mro__):
        return [], [("study", picture_element(part, f"{key}-figure", heading))]
    if hasattr(part, "data_vars") and hasattr(part, "dims"):
        measures = measures_of(part)
        require(bool(measures), f"parts.{heading}", "a dataset", "", "must hold numbers over one axis or more")
        if not is_parameter_study(part):
            drawn = [_thinned(one) for one in measures]
            thinning = f"Of over {MOST_VALUES} values in a line the lowest and the highest of each stretch are drawn."
            thin = any(one is not other for one, other in zip(drawn, measures, strict=True))
            return drawn, [("study", element("p", thinning))] * thin
        about = about_section(study_versions(part), None)
        return [*measures, part], [("cases", one) for one in about.content]
    return [], [("study", _table(heading, part))]


def _thinned(one: Measure) -> Measure:
    """A measure with no more values over its one axis than its picture has room for."""
    values = one.dataset[one.name]
    if values.ndim != 1 or values.size <= MOST_VALUES:
        return one
    chosen = thinned_line(values.to_numpy().astype(float), MOST_VALUES)
    return replace(one, dataset=one.dataset[[one.name]].isel({values.dims[0]: chosen}))


def _players(parts: Mapping[str, Any], structure: Structure | None) -> dict[str, Element]:
    """Players of the first responses with snapshots, and a line for each further one."""
    players: dict[str, Element] = {}
    for number, (heading, part) in enumerate(parts.items(), 1):
        if structure is None or not isinstance(part, Response):
            continue
        if len(players) >= MOST_PLAYERS:
            if part.snapshots is not None:
                players[heading] = element("p", NO_PLAYER)
            continue
        player = player_element(part, structure, None, f"part-{number}-player")
        if player is not None:
            players[heading] = player
    return players


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
