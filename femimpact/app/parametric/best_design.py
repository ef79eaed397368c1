"""The best designs of a parameter study as records, in words and as what is drawn: how sure each is, what is chosen."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.figures.study_labels import STATISTICS, BestMarks, axis_words
from femimpact.units import name_words, number_text, unit_text, value_text

if TYPE_CHECKING:
    import xarray

MORE = 0.15
"""Share by which the value may grow where an axis is off."""

CLIFF = 2.0
"""How many times as far an axis may be off to the other side where a side is the cliff."""

MOST_NAMED = 4
"""Designs that are told; of more their number."""

NO_NAMES: Mapping[str, str] = {}


@dataclass(frozen=True)
class AxisMargin:
    """How far the value of an axis may be off to each side of the best case, the other axes as they are.

    Parameters
    ----------
    axis, unit : str
        Path, and unit of all numbers.
    value : float
        Of the best case.
    below, above : float
        Distances at which the value is 15 % worse, or a limit is passed, linear between the cases. A case whose
        interval overlaps that of the best, where there are intervals, is not worse.
    below_found, above_found : bool
        Whether there is such a place within the cases; else the distance is that to the last case with a value.
    bound : {"", "lowest", "highest"}
        Whether the case has the lowest or the highest value of the axis: a better one may lie beyond.
    """

    axis: str
    unit: str
    value: float
    below: float
    above: float
    below_found: bool
    above_found: bool
    bound: str

    @property
    def cliff(self) -> str:
        """The side, "below" or "above", that is passed in less than half the distance of the other; "" for neither."""
        if self.below_found and self.above > CLIFF * self.below:
            return "below"
        return "above" if self.above_found and self.below > CLIFF * self.above else ""


@dataclass(frozen=True, eq=False)
class BestDesign:
    """The best of the designs for one value of each axis of the excitation that is no part of the worst.

    Parameters
    ----------
    at : mapping
        Those values by the paths of their axes; empty where there are none.
    values : mapping
        Of the other axes, by their paths: numbers, texts or pairs of gaps. Empty where there is no best.
    value : float
        Worst value of the measure, of several starts of the medians.
    low, high : float
        Ends of the 90 % interval of the median, each the worst of the cases; not numbers of less than 5 starts.
    worst_at : mapping
        Where the measure is worst: values of the axes of `worst_over`.
    case : int
        Number of that case, as `run_case` takes it; -1 where there is no best.
    limited : mapping of str to float
        Worst values of the limited measures, of several starts of the largest.
    alike : tuple of mapping
        Values of the designs that keep the limits and that the starts cannot tell from the best: intervals overlap.
    margins : tuple of AxisMargin
        Of every axis of numbers that has several values.
    without_value : tuple of (mapping, str)
        Designs that have no value, and why: a case has failed, has not been run, or is not there.
    reason : str
        Why there is no best; empty where there is one.
    alike_values : tuple of float
        Worst values of the designs in `alike`, which are in their order.
    worst_bounds : mapping of str to {"lowest", "highest"}
        Axes of `worst_over` of numbers of which the worst case has the lowest or the highest: a worse one may lie
        beyond.
    groups : tuple of float
        Smallest and largest start of the worst case where its starts lie in two groups (two motions); else empty.
    alike_groups : tuple of tuple of float
        The same of each design in `alike`.
    over_uncertain : float
        Worst value where the axes in `BestCase.uncertain` have any of their values; not a number without such axes, or
        without another one to choose on.
    beyond : tuple of int
        How many designs do not keep the limits, and how many have a value.
    """

    at: Mapping[str, Any]
    values: Mapping[str, Any] = field(default_factory=dict)
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    worst_at: Mapping[str, Any] = field(default_factory=dict)
    case: int = -1
    limited: Mapping[str, float] = field(default_factory=dict)
    alike: tuple[Mapping[str, Any], ...] = ()
    margins: tuple[AxisMargin, ...] = ()
    without_value: tuple[tuple[Mapping[str, Any], str], ...] = ()
    reason: str = ""
    alike_values: tuple[float, ...] = ()
    worst_bounds: Mapping[str, str] = field(default_factory=dict)
    groups: tuple[float, ...] = ()
    alike_groups: tuple[tuple[float, ...], ...] = ()
    over_uncertain: float = math.nan
    beyond: tuple[int, int] = (0, 0)


@dataclass(frozen=True, eq=False)
class BestCase:
    """What `best_case` finds; as a text, some lines for the eye.

    Parameters
    ----------
    measure : str
    better : {"small", "large"}
        Which of its values are better.
    worst_over : tuple of str
        Paths of the axes over which the worst counts.
    limits : mapping of str to float
    starts : int
        Of each case.
    units : mapping of str to str
        Of axes and measures, by their names.
    designs : tuple of BestDesign
        One for each combination of the values of the excitation's other axes, which is one without such axes.
    uncertain : tuple of str
        Axes of contact laws (restitution, contact time, ...) that have several values and are no part of `worst_over`:
        they count as chosen, as a gap does.
    """

    measure: str
    better: str
    worst_over: tuple[str, ...]
    limits: Mapping[str, float]
    starts: int
    units: Mapping[str, str]
    designs: tuple[BestDesign, ...]
    uncertain: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join(line for design in self.designs for line in design_lines(self, design))


def label_of(best: BestCase) -> str:
    """What its value is, as "smallest worst peak"."""
    worst = "worst " if best.worst_over else ""
    return f"{'largest' if best.better == 'large' else 'smallest'} {worst}{name_words(best.measure)}"


def more_designs(best: BestCase) -> str:
    """How many designs there are beside the first, where not all are told."""
    more = len(best.designs) - MOST_NAMED
    return f"and {more} more, for other values of {', '.join(best.designs[0].at)}" if more > 0 else ""


def design_lines(best: BestCase, design: BestDesign) -> Iterator[str]:
    """What is known of a best design, in lines for the eye."""
    level = f" for {told(best, design.at)}" if design.at else ""
    if design.reason:
        yield f"{label_of(best)}{level}: none, {design.reason}"
    else:
        value = unit_text(design.value, best.units[best.measure])
        yield f"{label_of(best)}{level}: {value} at {told(best, design.values)}{limited_words(design)}"
        yield from (f"  {line}" for line in design_notes(best, design))
    if design.without_value:
        named = [f"{told(best, values)}: {why}" for values, why in design.without_value]
        yield f"  without a value: {_first_of(named)}"


def limit_words(name: str, value: float, limit: float, unit: str) -> str:
    """A value beside its limit, and the share of the limit that it uses."""
    used = f", {number_text(100.0 * value / limit, 3)} % of it" if limit > 0.0 else ""
    return f"{name} {unit_text(value, unit)}, {LIMIT} {unit_text(limit, unit)}{used}"


def limited_words(design: BestDesign) -> str:
    """How many designs do not keep the limits; empty where all do."""
    return " within the limits, which {} of {} designs do not keep".format(*design.beyond) if design.beyond[0] else ""


LIMIT, WORST_AT, OF_AXIS = "limit", "worst at", "value of the axis"
"""Words before the limit of a measure, before the place where a design is worst, and where it is at an axis's edge."""


def design_notes(best: BestCase, design: BestDesign, names: Mapping[str, str] = NO_NAMES) -> Iterator[str]:
    """What is known of a best design beside its value."""
    if best.uncertain:
        yield choice_words(best, design, names)
    if design.worst_at:
        places = [
            told(best, {axis: value}, names)
            + (f" (the {end} value of the axis: a worse one may lie beyond)" if end else "")
            for axis, value in design.worst_at.items()
            for end in [design.worst_bounds.get(axis)]
        ]
        yield f"{WORST_AT} {', '.join(places)}"
    if best.measure == "peak_ratio" and "base.frequency" in best.worst_over:
        yield "peak_ratio compares cases of one frequency, and is near 1 off resonance: peak is the largest motion"
    for name, value in design.limited.items():
        yield limit_words(name, value, best.limits[name], best.units[name])
    if math.isfinite(design.low):
        low, high = (unit_text(value, best.units[best.measure]) for value in (design.low, design.high))
        alike = [
            f"{told(best, values, names)} ({value_beside(best, design, value)}{motions_words(best, ends, '; its')})"
            for values, value, ends in zip(design.alike, design.alike_values, design.alike_groups, strict=True)
        ]
        apart = f"as good within it: {_first_of(alike)}" if alike else "no other case is as good within it"
        over = " and ".join(names.get(axis, axis) for axis in best.worst_over)
        each = f", each end the worst over {over}" if over else ""
        yield f"90 % interval of the median {low} to {high}{each}; {apart}"
    else:
        yield f"with starts = {best.starts} there is no interval: from 5 on cases that are as good are named"
    if design.groups:
        yield f"two motions{motions_words(best, design.groups, ': at its worst the')}"
    run = [one for one in design.margins if one.below or one.below_found or one.above or one.above_found]
    yield from (margin_words(best, margin, names) for margin in run)
    if alone := [names.get(one.axis, one.axis) for one in design.margins if one not in run]:
        yield f"how far {', '.join(alone)} may be off is not known: no other case differs in it alone"


def motions_words(
    best: BestCase,
    ends: Sequence[float],  # smallest and largest start, or nothing
    whose: str,  # begins the words
) -> str:
    """That starts lie in two groups; empty where they do not."""
    between = " to ".join(unit_text(value, best.units[best.measure]) for value in ends)
    return f"{whose} starts lie in two groups, {between}" if between else ""


def choice_words(best: BestCase, design: BestDesign, names: Mapping[str, str] = NO_NAMES) -> str:
    """That axes of contact laws count as chosen, what that may cost, and how to be safe over them."""
    one = len(best.uncertain) == 1
    axes = " and ".join(names.get(axis, axis) for axis in best.uncertain)
    counted = f"{axes} {'counts as a choice' if one else 'count as choices'}"
    if math.isnan(design.over_uncertain):
        return f"{counted}: no other axis is left to choose on"
    others = {axis: value for axis, value in design.values.items() if axis not in best.uncertain}
    value = unit_text(design.over_uncertain, best.units[best.measure])
    reach = f"{told(best, others, names)} has {'down' if best.better == 'large' else 'up'} to {value}"
    safe = f"to be safe over {'it' if one else 'them'}, worst_over = {json.dumps([*best.worst_over, *best.uncertain])}"
    return f"{counted}: over all {'its' if one else 'their'} values {reach}; {safe}"


def value_beside(best: BestCase, design: BestDesign, value: float) -> str:
    """The value of a design, and by how much it is worse than the best."""
    share = abs(value - design.value) / abs(design.value) if design.value else 0.0
    change = "less" if best.better == "large" else "more"
    return f"{unit_text(value, best.units[best.measure])}{f', {100.0 * share:.0f} % {change}' if share else ''}"


def margin_words(best: BestCase, margin: AxisMargin, names: Mapping[str, str] = NO_NAMES) -> str:
    """How far an axis may be off."""
    sides = []
    for distance, found, word in (
        (margin.below, margin.below_found, "less"), (margin.above, margin.above_found, "more"),
    ):  # fmt: skip
        known = f"{'' if found else 'at least '}{unit_text(distance, margin.unit)} {word}"
        sides.append(known if distance or found else f"{word} was not run")
    change = "less" if best.better == "large" else "more"
    cliff = f"; the cliff is {margin.cliff} it" if margin.cliff else ""
    bound = f"; it is the {margin.bound} {OF_AXIS}" if margin.bound else ""
    change += " or a limit passed" if best.limits else ""
    axis = names.get(margin.axis, margin.axis)
    return f"{axis} for {100.0 * MORE:g} % {change}{apart_words(best)}: {', '.join(sides)}{cliff}{bound}"


def apart_words(best: BestCase) -> str:
    """That a case which the intervals cannot tell from the best counts as none that is worse; empty without these."""
    return ", where the intervals are apart" if any(math.isfinite(one.low) for one in best.designs) else ""


def told(best: BestCase, values: Mapping[str, Any], names: Mapping[str, str] = NO_NAMES) -> str:
    """Values of axes, by their paths or, where there are some, by their names in words."""
    return ", ".join(
        f"{names.get(name, f'{name} =')} {value_text(value, best.units[name])}" for name, value in values.items()
    )


def _first_of(named: Sequence[str]) -> str:
    """The first of some names, and how many more there are."""
    more = f"; and {len(named) - MOST_NAMED} more" if len(named) > MOST_NAMED else ""
    return "; ".join(named[:MOST_NAMED]) + more


# ---- what is drawn ------------------------------------------------------------------------------------


def worst_over_axes(dataset: xarray.Dataset, best: BestCase) -> xarray.Dataset | None:
    """The worst of the measure of a best case over the axes of `worst_over`, with its statistics, on those that remain.

    `is_best` is true at the best. Of a list or a sample of cases None.
    """
    dims = [str(name) for name in dataset["finished"].dims]
    if dims == ["case"]:
        return None
    over, sign = [name for name in best.worst_over if name in dims], -1.0 if best.better == "large" else 1.0
    names = [f"{best.measure}{end}" for end in ("", *STATISTICS) if f"{best.measure}{end}" in dataset]
    sound = (dataset["failed_starts"] == 0) & (dataset["finished"] > 0)
    values = dataset[names].where(sound)
    found = (values.min if sign < 0.0 else values.max)(over, skipna=False, keep_attrs=True)
    at = (sign * values[best.measure]).fillna(np.inf).argmax(over) if over else {}
    for name in ("periodic_starts", "failed_starts", "finished"):
        if name in dataset:
            found[name] = dataset[name].isel(at)
    is_best = np.zeros([dataset.sizes[name] for name in dims if name not in over], dtype=bool)
    for design in best.designs:
        if design.case >= 0:
            where = dict(zip(dims, np.unravel_index(design.case, dataset["finished"].shape), strict=True))
            is_best[tuple(where[name] for name in dims if name not in over)] = True
    found["is_best"] = ([name for name in dims if name not in over], is_best)
    of_worst = f"worst {name_words(best.measure)} over {' and '.join(axis_words(dataset, name) for name in over)}"
    median = ", median over the starts" if best.starts > 1 else ""
    if over:
        found[best.measure].attrs["long_name"] = f"{of_worst}{median}"
    return found.squeeze().assign_attrs(dataset.attrs)


def marks_of(best: BestCase) -> BestMarks:
    """The level of 15 % more, that of a limit, and between which values of each axis of numbers both are kept."""
    if len(best.designs) > 1:
        return BestMarks()
    (design,) = best.designs
    change = "less" if best.better == "large" else "more"
    more = MORE * abs(design.value)
    levels = [(f"{100.0 * MORE:g} % {change}", design.value + (-more if best.better == "large" else more))]
    levels += [("limit", best.limits[best.measure])] if best.measure in best.limits else []
    spans = {one.axis: (one.value - one.below, one.value + one.above) for one in design.margins}
    near = " or not apart from it" if apart_words(best) else ""
    within = f"at most {100.0 * MORE:g} % {change} than the best{near}{', within the limits' if best.limits else ''}"
    return BestMarks(within, tuple(levels), spans)
