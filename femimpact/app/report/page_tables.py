"""Tables and sentences that stand beside the pictures of records."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from femimpact.app.report.markup import Element, element
from femimpact.app.report.page import Table, table_element, table_of
from femimpact.app.results.branch_file import FollowedBranches
from femimpact.app.results.picture_data import Run, SweptCurves
from femimpact.app.results.result_directory import FILES
from femimpact.app.study.findings import START_WORDS, Findings, history_words
from femimpact.contact.laws import Rigid
from femimpact.convergence.table import ConvergenceTable
from femimpact.excitation.drives import drive_words
from femimpact.figures.study_labels import in_shown_units
from femimpact.files import dataset_columns
from femimpact.orbits.figures import stable_ranges
from femimpact.response.impacts import impact_columns
from femimpact.signals.decay import DecayEstimate
from femimpact.sweep.curve import ONE_START, FrequencyResponse
from femimpact.units import parameter_text, ranges_text, unit_text

# ---- response curves -------------------------------------------------------------------------------


def dwell_words(curve: FrequencyResponse) -> str:
    """How each frequency of a curve is held, and how the base moves."""
    length = f"{curve.cycles} cycles" if curve.cycles is not None else f"{curve.duration:g} s"
    start = START_WORDS.get(curve.start, "from a given state")
    if isinstance(curve.acceleration, tuple):
        (first, low), (last, high) = curve.acceleration[0], curve.acceleration[-1]
        accelerations = f"{unit_text(low, 'm/s^2')} at {first:g} Hz to {unit_text(high, 'm/s^2')} at {last:g} Hz"
        driven = f"accelerates by {accelerations}, by the rows of the study"
    elif curve.acceleration is not None:
        driven = f"accelerates by {unit_text(curve.acceleration, 'm/s^2')}"
    else:
        driven = f"moves by {1e3 * (curve.amplitude or 0.0):.4g} mm"
    return f"Each frequency is held for {length}, from a start {start}; the end of it is measured. The base {driven}."


# ---- runs ------------------------------------------------------------------------------------------


SHOWN = (
    "time", "impactor", "side", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss",
)  # fmt: skip
"""Columns of the table, where an impact has them."""

ROWS = 100


def impact_table(columns: Mapping[str, Any], units: Mapping[str, str], file: str = "") -> Table | None:
    """The last impacts, from columns as of `impacts.csv`; None without impacts."""
    needed = ("time", "impactor", "side", "impulse", "approach_speed")
    if any(name not in columns for name in needed) or not len(columns["time"]):
        return None
    numbers = {name: np.asarray(columns[name]) for name in SHOWN if name in columns}
    count = numbers["time"].size
    known = {name: one for name, one in numbers.items() if one.dtype.kind != "f" or np.any(np.isfinite(one))}
    title = f"The last {ROWS} of {count} impacts" if count > ROWS else f"All {count} impacts"
    return table_of(title, {name: one[max(count - ROWS, 0) :] for name, one in known.items()}, units, file)


def channel_table(found: Findings) -> Table | None:
    """Largest values and rms of every channel of a history, over several starts their medians and ranges."""
    history, starts = found.history, found.history_starts
    if history is None:
        return None
    names = {"largest_of_run": "largest of the run", "largest": "largest over the last third", "rms": "rms there"}
    if history.frequency is None:
        names = {"largest_of_run": "largest of the run", "rms": "its rms"}
    bare = {} if found.history_without is None else found.history_without.channels
    rows = []
    for name, channel in history.channels.items():
        # the impulses of a rigid pair that has collided are those of its contact
        if math.isfinite(channel.largest_of_run):
            spreads = starts.channels.get(name, {}) if starts is not None else {}
            cells = (history_words(spreads.get(key), getattr(channel, key), channel.unit) for key in names)
            own = [unit_text(channel.largest_of_run, channel.unit)] if starts is not None else []
            alone = [history_words(None, getattr(bare[name], key), channel.unit) for key in names if name in bare]
            rows.append((name, *cells, *(alone or [""] * len(names) * bool(bare)), *own, channel.time_of_largest))
    title, own = "Channels of the history", list[str]()
    if starts is not None:
        title, own = f"{title}: medians and ranges of {starts.count} starts", ["largest of the study's own start"]
    elif history.peak_is_one_start:
        title = f"{title}: {ONE_START}"
    of_bare = [f"{words} without {found.carried}" for words in names.values() if bare]
    header = ("channel", *names.values(), *of_bare, *own, "at (s)")
    return Table(title, header, tuple(rows)) if rows else None


# ---- convergence -----------------------------------------------------------------------------------


def cases_of_axis(columns: Mapping[str, Any], units: Mapping[str, str], file: str = "") -> Table | None:
    """Values of the cases of a table of convergence; None of one without errors."""
    names = [name.removesuffix("_error") for name in columns if name.endswith("_error")]
    if not names or "number" not in columns:
        return None
    first = "case" if "case" in columns else "number"
    return table_of("Values of the cases", {name: columns[name] for name in (first, *names)}, units, file)


def summary_table(columns: Mapping[str, Any], units: Mapping[str, str], file: str = "") -> Table:
    """Reference, orders and recommended number of every quantity."""
    shown = ("axis", "quantity", "unit", "reference", "fitted_order", "expected_order", "recommended")
    values = {name: columns[name] for name in shown if name in columns}
    if "recommended_is_bound" in columns:
        bounds = np.asarray(columns["recommended_is_bound"]).astype(str)
        values["fewer_may_do"] = ["yes" if one == "True" else "" for one in bounds]
    return table_of("What an accuracy takes", values, {}, file)


# ---- parameter studies, orbits and contacts --------------------------------------------------------


def case_table(columns: Mapping[str, Any], units: Mapping[str, str], file: str = "") -> Table:
    """A row for each case of a parameter study, in the units of its maps and conclusions."""
    return table_of("A row for each case", *in_shown_units(columns, units), file)


def branch_table(followed: FollowedBranches, file: str = "") -> Table:
    """A row for each branch of periodic orbits."""
    rows = tuple(
        (
            number, origin, cycle, parameter_text(branch.values.min(), branch.unit),
            parameter_text(branch.values.max(), branch.unit), len(branch),
            ranges_text(stable_ranges(branch), branch.unit) or "nowhere", *branch.end,
        )
        for number, (branch, origin, cycle) in enumerate(
            zip(followed.branches, followed.origins, followed.cycles, strict=True), 1
        )
    )  # fmt: skip
    header = ("branch", "followed from", "cycles", "from", "to", "points", "stable", "first end", "last end")
    return Table("The branches", header, rows, file)


# ---- by records -----------------------------------------------------------------------------------


def beside(record: Any, folder: bool = False) -> Iterator[tuple[str, Element]]:
    """Words and tables beside the pictures of a record, each with the key of the part of a page in which it stands.

    With `folder` the files of results stand beside the page.
    """

    def file(key: str) -> str:
        return FILES[key].name if folder else ""

    if isinstance(record, SweptCurves):
        yield "response", element("p", dwell_words(next(iter(record.curves.values()))))
    elif isinstance(record, Run):
        yield from (("drive", element("p", words)) for words in drive_words(record.whole.base))
        if Rigid.name in record.whole.impacts.law.values():
            words = "A rigid impact is an impulse without a force: a contact force is drawn only where bodies stick."
            yield "motion", element("p", words)
        impacts = impact_table(*impact_columns(record.whole.impacts), file("impacts"))
        yield from () if impacts is None else [("impacts", table_element(impacts))]
    elif isinstance(record, ConvergenceTable):
        cases = cases_of_axis(*record.columns(), file(f"{record.kind}_over_{record.axis}"))
        yield from () if cases is None else [("convergence", table_element(cases))]
    elif isinstance(record, DecayEstimate):
        yield from (("decay", element("p", str(mode))) for mode in record.modes)
        yield "decay", table_element(table_of("Over the amplitude", *record.columns()))
    elif is_parameter_study(record):
        yield "cases", table_element(case_table(*dataset_columns(record)))


def is_parameter_study(part: Any) -> bool:
    """True for the dataset of `parameter_study` that has what it tells of its cases."""
    names, about = getattr(part, "data_vars", ()), getattr(part, "attrs", {})
    return {"finished", "failed_starts", "periodic_starts", "failure"} <= {*names} and {"starts", "place"} <= {*about}
