"""The best case of a parameter study where the worst over some axes counts, and how sure it is.

Cases that agree in all axes but those of `worst_over` are one design, and its value is the worst of them. Axes of the
excitation, the start and the numerics are no choice of the user: what is best is said for each of their values, unless
they are in `worst_over`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, kind_of, quantity, require, suggestion
from femimpact.errors import checked as checked_value
from femimpact.export.tables import BESIDE, STATISTICS, axis_names, unit_text, value_text
from femimpact.study.parameter_plan import BestPlan

if TYPE_CHECKING:
    import xarray

FREQUENCY = "base.frequency"
NO_DESIGN = ("base.", "start.", "mesh.", "reduction.", "method.")
"""Beginnings of the paths of the axes that are no choice of the user: of the excitation, the start, the numerics."""

MORE = 0.15
"""Share by which the value may grow where an axis is off."""

CLIFF = 2.0
"""How many times as far an axis may be off to the other side where a side is the cliff."""

MOST_NAMED = 4
"""Designs that are told; of more their number."""

NUMBER = quantity("1")

NO_NAMES: Mapping[str, str] = {}

BETTER = ("small", "large")
SAY_IT = 'set dataset[measure].attrs["better"] = "small" or "large"'
NOT_CHOSEN = f"of the excitation, the start or the numerics ({'*, '.join(NO_DESIGN)}*)"
NOTHING_TO_CHOOSE = f"all axes that have several values are {NOT_CHOSEN}, which are no choice"
NO_CHOICE = f", where those {NOT_CHOSEN} are no choice"

OF_LAW = ("peak_force", "cycle_mean_force")
"""Measures that a contact law may not give."""


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
        Distances at which the value is 15 % worse, or a limit is passed, linear between the cases.
    below_found, above_found : bool
        Whether there is such a place within the cases; else the distance is that to the last case with a value.
    cliff : {"", "below", "above"}
        The side that is passed in less than half the distance of the other.
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
    cliff: str
    bound: str


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
    worst_bound : {"", "lowest", "highest"}
        Whether the worst is at the lowest or the highest frequency of the cases: a worse one may lie beyond.
    """

    at: Mapping[str, Any]
    values: Mapping[str, Any]
    value: float
    low: float
    high: float
    worst_at: Mapping[str, Any]
    case: int
    limited: Mapping[str, float]
    alike: tuple[Mapping[str, Any], ...]
    margins: tuple[AxisMargin, ...]
    without_value: tuple[tuple[Mapping[str, Any], str], ...]
    reason: str = ""
    worst_bound: str = ""


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
    """

    measure: str
    better: str
    worst_over: tuple[str, ...]
    limits: Mapping[str, float]
    starts: int
    units: Mapping[str, str]
    designs: tuple[BestDesign, ...]

    def __str__(self) -> str:
        return "\n".join(line for design in self.designs for line in design_lines(self, design))


def best_case(
    dataset: xarray.Dataset,
    measure: str,
    worst_over: Sequence[str] | None = None,
    limits: Mapping[str, float] | None = None,
) -> BestCase:
    """The best case of a parameter study where the worst over some axes counts, and how sure it is.

    Cases that agree in all other axes are one design, in a grid, a list or a sample, and the value of a design is the
    worst of its cases, which must be there at all values of these axes at which another design is. What is best is said
    for each value of the other axes of the excitation (`base.amplitude`, ...), the start (`start.*`) and the numerics
    (`mesh.*`, `reduction.*`, `method.*`), which are no choice of the user, unless they are named in `worst_over`.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of `parameter_study`.
    measure : str
        Of which small values are better, or large ones: its attribute "better" says which, and can be set on a
        measure of one's own, `dataset[measure].attrs["better"] = "small"`.
    worst_over : sequence of str, optional
        Paths of axes. By default `base.frequency`, where another axis remains.
    limits : mapping of str to float, optional
        What the worst value of a measure, of several starts the largest, may be at most; of a measure of which large
        values are better the smallest, at least.

    Returns
    -------
    BestCase

    Raises
    ------
    InputError
        If an axis or a measure is not known, nothing is left to choose between, or no case has a value within the
        limits.

    Examples
    --------
    >>> import femimpact as fi
    >>> study = fi.load_study("meshes/stepped_cantilever.toml")
    >>> axes = {"impactor.ball.gap": [1e-3, 2e-3], "base.frequency": [8.5, 9.0]}
    >>> found = fi.parameter_study(study, axes, ["peak"], cycles=30)
    >>> fi.best_case(found, "peak").worst_over
    ('base.frequency',)
    """
    require_study(dataset)
    axes = axes_of(dataset)
    known = better_of_measures(dataset)
    worst, most = check_best(measure, worst_over, limits, axes, known)
    require(dataset["finished"].size > 1, "dataset", "one case", "", "has nothing to choose between")
    for name in (measure, *most):
        _require_values(dataset, name)
    table = _Designs(dataset, axes, worst, measure, most, known)
    found = tuple(table.best(level) for level in range(table.levels))
    if all(design.reason for design in found):
        raise InputError([Fault("measure", measure, "", f"has no best case: {found[0].reason}")])
    units = {name: str(dataset[name].attrs.get("units", "")) for name in (*axes, measure, *most)}
    return BestCase(measure, known[measure], worst, most, int(dataset.attrs.get("starts", 1)), units, found)


def ranked_designs(
    dataset: xarray.Dataset,
    measure: str,
    worst_over: Sequence[str],
    limits: Mapping[str, float] | None,
    count: int,
) -> list[dict[str, Any]]:
    """Values of the axes of at most so many best designs; where none keeps the limits, of those nearest to them."""
    require_study(dataset)
    axes, known = axes_of(dataset), better_of_measures(dataset)
    worst, most = check_best(measure, worst_over, limits, axes, known)
    for name in (measure, *most):
        _require_values(dataset, name)
    return _Designs(dataset, axes, worst, measure, most, known).ranked(count)


def label_of(best: BestCase) -> str:
    """What its value is, as "smallest worst peak"."""
    worst = "worst " if best.worst_over else ""
    return f"{'largest' if best.better == 'large' else 'smallest'} {worst}{best.measure.replace('_', ' ')}"


def told_lines(best: BestCase) -> Iterator[str]:
    """The lines about its designs, of many the first."""
    for design in best.designs[:MOST_NAMED]:
        yield from design_lines(best, design)
    if more := more_designs(best):
        yield more


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
        yield f"{label_of(best)}{level}: {value} at {told(best, design.values)}"
        yield from (f"  {line}" for line in design_notes(best, design))
    if design.without_value:
        named = [f"{told(best, values)}: {why}" for values, why in design.without_value]
        yield f"  without a value: {_first_of(named)}"


def design_notes(best: BestCase, design: BestDesign, names: Mapping[str, str] = NO_NAMES) -> Iterator[str]:
    """What is known of a best design beside its value."""
    if design.worst_at:
        beyond = f"; it is the {design.worst_bound} frequency, and a worse one may lie beyond"
        yield f"worst at {told(best, design.worst_at, names)}{beyond if design.worst_bound else ''}"
    for name, value in design.limited.items():
        yield f"{name} {unit_text(value, best.units[name])}, limit {unit_text(best.limits[name], best.units[name])}"
    if math.isfinite(design.low):
        low, high = (unit_text(value, best.units[best.measure]) for value in (design.low, design.high))
        alike = _first_of([told(best, values, names) for values in design.alike])
        apart = f"the starts do not tell from it {alike}" if alike else "no other case overlaps it"
        yield f"90 % interval of the median {low} to {high}; {apart}"
    else:
        yield f"with starts = {best.starts} there is no interval: from 5 on cases that are as good are named"
    run = [one for one in design.margins if one.below or one.below_found or one.above or one.above_found]
    yield from (margin_words(best, margin, names) for margin in run)
    if alone := [names.get(one.axis, one.axis) for one in design.margins if one not in run]:
        yield f"how far {', '.join(alone)} may be off is not known: no other case differs in it alone"


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
    bound = f"; it is the {margin.bound} value of the axis" if margin.bound else ""
    change += " or a limit passed" if best.limits else ""
    axis = names.get(margin.axis, margin.axis)
    return f"{axis} for {100.0 * MORE:g} % {change}: {', '.join(sides)}{cliff}{bound}"


def told(best: BestCase, values: Mapping[str, Any], names: Mapping[str, str] = NO_NAMES) -> str:
    """Values of axes, by their paths or, where there are some, by their names in words."""
    return ", ".join(
        f"{names.get(name, f'{name} =')} {value_text(value, best.units[name])}" for name, value in values.items()
    )


def _first_of(named: Sequence[str]) -> str:
    """The first of some names, and how many more there are."""
    more = f"; and {len(named) - MOST_NAMED} more" if len(named) > MOST_NAMED else ""
    return "; ".join(named[:MOST_NAMED]) + more


def best_cases(
    dataset: xarray.Dataset,
    plan: BestPlan | None,  # of the study file
) -> tuple[dict[str, BestCase], dict[str, str]]:
    """The best case by each measure that says what is better, that of the plan first; and why one has none.

    The worst counts over the same axes for all; the limits hold for the measure of the plan.
    """
    axes, found, reasons = axes_of(dataset), dict[str, BestCase](), dict[str, str]()
    known = [name for name, better in better_of_measures(dataset).items() if better]
    if dataset["finished"].size < 2:
        return {}, {}
    if plan is None and not any(
        np.unique(dataset[axis].to_numpy().astype(str)).size > 1 for axis in axes if not axis.startswith(NO_DESIGN)
    ):
        return {}, dict.fromkeys(known, NOTHING_TO_CHOOSE)
    first = [] if plan is None else [plan.measure]
    for name in dict.fromkeys((*first, *known)):
        of_plan = plan if name in first else None
        try:
            found[name] = best_case(
                dataset, name, plan.worst_over if plan else None, of_plan.limits if of_plan else None
            )
        except InputError as error:
            reasons[name] = " ".join(str(error).split())
    return found, reasons


def require_study(dataset: Any) -> None:
    """Raise `InputError` unless the value is the dataset of a parameter study."""
    names = getattr(dataset, "data_vars", ())
    sound = hasattr(dataset, "coords") and "finished" in names and "failed_starts" in names
    require(sound, "dataset", kind_of(dataset), "", "must be what parameter_study returns")


def default_worst(
    axes: Sequence[str],  # paths
) -> tuple[str, ...]:
    """Axes over which the worst counts where none is named: the frequency, where another axis remains."""
    return (FREQUENCY,) if FREQUENCY in axes and len(axes) > 1 else ()


def check_best(
    measure: Any,
    worst_over: Any,
    limits: Any,
    axes: Sequence[str],  # paths of the study
    known: Mapping[str, str],  # its measures that are numbers, with what is better
) -> tuple[tuple[str, ...], dict[str, float]]:
    """The axes over which the worst counts, and the limits.

    Raises `InputError` if they, or the measure, do not fit the study.
    """
    mapping = limits is None or isinstance(limits, Mapping)
    require(mapping, "limits", limits, "", "must be numbers by the names of measures")
    for key, name in (("measure", measure), *(("limits", name) for name in limits or ())):
        require(isinstance(name, str), key, kind_of(name), "", "must be the name of a measure")
        require(name in known, key, name, "", f"is no number of the study: {suggestion(name, known)}")
    told = ", ".join(name for name, better in known.items() if better)
    allowed = (
        f"does not say whether small or large values are better: {f'take one of {told}, or ' if told else ''}{SAY_IT}"
    )
    require(known[measure] in BETTER, "measure", measure, "", allowed)
    several = worst_over is None or isinstance(worst_over, (list, tuple))
    require(several, "worst_over", worst_over, "", "must be a list of paths of axes")
    for name in worst_over or ():
        require(isinstance(name, str), "worst_over", kind_of(name), "", "must be a list of paths of axes")
    worst = default_worst(axes) if worst_over is None else tuple(dict.fromkeys(worst_over))
    for name in worst:
        require(name in axes, "worst_over", name, "", f"is no axis of the study: {suggestion(str(name), axes)}")
    free = [name for name in axes if name not in worst and not name.startswith(NO_DESIGN)]
    require(bool(free), "worst_over", list(worst), "", f"leaves no axis to choose on: {', '.join(axes)}{NO_CHOICE}")
    return worst, {
        name: float(checked_value(f"limits.{name}", value, NUMBER)) for name, value in (limits or {}).items()
    }


def axes_of(dataset: xarray.Dataset) -> tuple[str, ...]:
    """Paths of the axes over which the cases of a dataset are."""
    dims = dataset["finished"].dims
    return tuple(name for name in axis_names(dataset) if name in dims or "case" in dataset[name].dims)


def better_of_measures(dataset: xarray.Dataset) -> dict[str, str]:
    """Measures that are numbers, with which of their values are better: "small", "large" or, where none says it, ""."""
    beside = {f"{name}{end}" for name in dataset.data_vars for end in STATISTICS} | BESIDE
    return {
        str(name): str(values.attrs.get("better", ""))
        for name, values in dataset.data_vars.items()
        if values.dtype.kind == "f" and name not in beside
    }


def no_force_words(
    laws: str,  # of the contacts, by their names
) -> str:
    """Why there is no contact force to be measured."""
    return f"has no value of contacts without a contact time ({laws}): take another law, as kelvin-voigt"


def _require_values(dataset: xarray.Dataset, name: str) -> None:
    """Refuse a measure that no case has, with the contact laws where they are why."""
    values, failed = dataset[name].to_numpy(), dataset["failed_starts"].to_numpy() > 0
    if failed.all():
        first = next((str(reason) for reason in dataset["failure"].to_numpy().ravel() if reason), "not known")
        allowed = f"has no value: all {failed.size} cases have failed, the first: {first}"
        raise InputError([Fault(name, None, "", allowed)])
    laws = dataset.attrs.get("contact_laws", "")
    none = np.isnan(values) & ~failed & (dataset["finished"].to_numpy() > 0)
    if name in OF_LAW and laws and none.any():
        raise InputError([Fault(name, None, "", no_force_words(laws))])
    require(bool(np.isfinite(values).any()), name, None, "", "has no value in any case")


def _numbered(
    codes: Sequence[NDArray[np.int64]],  # (cases,) each: numbers from 0
    count: int,
) -> NDArray[np.int64]:
    """A number (cases,) for each distinct combination, in the order of the first codes, then of the next."""
    number = np.zeros(count, dtype=np.int64)
    for code in codes:
        number = np.unique(number * (code.max(initial=0) + 1) + code, return_inverse=True)[1].reshape(-1)
    return number


class _Designs:
    """Designs (rows) of a dataset with their worst values, small ones the better: large ones are turned.

    Rows are in the order of the values of the axes, axes by their names: what is found does not hang on how a dataset
    is sorted.
    """

    def __init__(
        self, dataset: xarray.Dataset, axes: Sequence[str], worst: Sequence[str], measure: str,
        limits: Mapping[str, float], better: Mapping[str, str],
    ) -> None:  # fmt: skip
        self.dataset, self.measure, self.worst = dataset, measure, worst
        self.values: dict[str, list[Any]] = {}
        self.codes: dict[str, NDArray[np.int64]] = {}
        for axis in axes:
            self.values[axis], self.codes[axis] = self._coded(axis)
        self.given = [axis for axis in self.codes if axis not in worst and axis.startswith(NO_DESIGN)]
        self.chosen = [axis for axis in self.codes if axis not in worst and axis not in self.given]
        self._make_rows()
        self.sign = -1.0 if better[measure] == "large" else 1.0
        ends = ("_median_low", "_median_high")[:: int(self.sign)]
        of_measure = [self._column(measure, end, self.sign) for end in ("", *ends)]
        # of a limit the sign, the worst values and what they may be
        signs = {name: -1.0 if better[name] == "large" else 1.0 for name in limits}
        of_limits = {name: self._column(name, "_high" if sign > 0.0 else "_low", sign) for name, sign in signs.items()}
        self.case_values = of_measure[0]
        self.lost = (self._flat("failed_starts") > 0) | (self._flat("finished") == 0)
        for column in (of_measure[0], *of_limits.values()):
            self.lost |= np.isnan(column)
        self.has_value = ~self._any(self.lost) & (self.met == self.to_meet)
        self.value, self.low, self.high = (self._worst(column) for column in of_measure)
        self.limits = {
            name: (sign, self._worst(of_limits[name]), sign * limits[name]) for name, sign in signs.items()
        }  # fmt: skip

    def _flat(self, name: str) -> NDArray[Any]:
        """A variable of all cases (cases,)."""
        whole = self.dataset[name].broadcast_like(self.dataset["finished"])
        return np.asarray(whole.transpose(*self.dataset["finished"].dims).to_numpy()).reshape(-1)

    def _column(self, name: str, end: str, sign: float) -> Array:
        """A statistic of a measure where there is one, else its value."""
        return sign * self._flat(f"{name}{end}" if f"{name}{end}" in self.dataset else name).astype(float)

    def _coded(self, axis: str) -> tuple[list[Any], NDArray[np.int64]]:
        """Distinct values of an axis in their order, and which of them each case has."""
        if f"{axis}.plus" in self.dataset.coords:
            pairs = np.stack([self._flat(f"{axis}.{side}") for side in ("plus", "minus")], axis=1)
            found, codes = np.unique(pairs, axis=0, return_inverse=True)
            return [tuple(pair) for pair in found.tolist()], codes.reshape(-1)
        values = self._flat(axis)
        found, codes = np.unique(values if values.dtype.kind in "iuf" else values.astype(str), return_inverse=True)
        return found.tolist(), codes.reshape(-1)

    def _make_rows(self) -> None:
        count = self.dataset["finished"].size
        level = _numbered([self.codes[axis] for axis in sorted(self.given)], count)
        row = _numbered([level, *(self.codes[axis] for axis in sorted(self.chosen))], count)
        self.order = np.argsort(row, kind="stable")
        self.counts = np.bincount(row)
        self.begins = np.cumsum(self.counts) - self.counts
        self.first = self.order[self.begins]  # a case of each row
        self.level = level[self.first]
        self.levels = int(self.level.max()) + 1
        # of how many values of the axes of the worst a row has a case, and how many its level has
        met = _numbered([self.codes[axis] for axis in self.worst], count)
        self.met, at_level = (
            np.bincount(np.unique(np.stack([of, met]), axis=1)[0], minlength=int(of.max()) + 1) for of in (row, level)
        )
        self.to_meet = at_level[self.level]
        self._check_rows()

    def _check_rows(self) -> None:
        """Refuse cases among which nothing can be chosen, with what to run instead."""
        count = self.dataset["finished"].size
        require(self.counts.size > 1, "dataset", "one design", "", "has nothing to choose between")
        designs = _numbered([self.codes[axis] for axis in sorted(self.chosen)], count).max() + 1
        other = f", or name {'it' if len(self.given) == 1 else 'them'} in worst_over" if designs < count else ""
        allowed = f"has no two designs that agree in {', '.join(self.given)}: study a grid, or a list in which some do"
        require(bool((np.bincount(self.level) > 1).any()), "dataset", None, "", f"{allowed}{other}")
        values = _numbered([self.codes[axis] for axis in self.worst], count).max() + 1
        of_base = any(axis.startswith(NO_DESIGN) for axis in self.worst)
        other = "" if of_base else ", or give worst_over = []"
        allowed = (
            f"has no two cases that agree in all axes but {', '.join(self.worst)}: study a grid, or a list in which "
            "each design is at every value of these"
        )
        require(values == 1 or bool((self.counts > 1).any()), "dataset", None, "", f"{allowed}{other}")

    def _worst(self, column: Array) -> Array:
        """The largest of the cases of each row; not a number where one is none."""
        return np.asarray(np.maximum.reduceat(column[self.order], self.begins))

    def _any(self, column: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return np.asarray(np.logical_or.reduceat(column[self.order], self.begins))

    def _told(self, case: int, axes: Sequence[str]) -> dict[str, Any]:
        """Values of some axes in a case."""
        return {axis: self.values[axis][self.codes[axis][case]] for axis in axes}

    def _cases(self, row: int) -> NDArray[np.int64]:
        return self.order[self.begins[row] : self.begins[row] + self.counts[row]]

    def _why(self, row: int) -> str:
        """Why a row has no value."""
        lost = [case for case in self._cases(row) if self.lost[case]]
        if not lost:
            must = f"every design must be at the same values of {', '.join(self.worst)}"
            return f"{self.met[row]} of {self.to_meet[row]} cases are there, and {must}"
        if self._flat("finished")[lost[0]] == 0:
            return "a case has not been run"
        reason = self._flat("failure")[lost[0]] if "failure" in self.dataset else ""
        return f"a case failed: {reason}" if reason else "a case has no value"

    def best(self, level: int) -> BestDesign:
        """The best of the rows of a level."""
        rows = np.flatnonzero(self.level == level)
        at = self._told(self.first[rows[0]], self.given)
        without = tuple(
            (self._told(self.first[row], self.chosen), self._why(row)) for row in rows[~self.has_value[rows]]
        )
        kept = rows[self.has_value[rows]]
        reason = "no design has a value" + (f": {without[0][1]}" if without else "") if not kept.size else ""
        for _, values, most in self.limits.values():
            kept = kept[values[kept] <= most]
        if not kept.size:
            reason = reason or f"no design keeps the limits{self._nearest(rows)}"
            none = math.nan
            return BestDesign(at, {}, none, none, none, {}, -1, {}, (), (), without, reason)
        # of equal values the first, by the values of the axes
        row = int(kept[np.argmin(self.value[kept])])
        cases = self._cases(row)
        case = int(cases[np.argmax(self.case_values[cases])])
        low, high = self.low[row], self.high[row]
        alike = kept[(self.low[kept] <= high) & (kept != row)]
        known = f"{self.measure}_median_low" in self.dataset
        low, high = sorted((self.sign * low, self.sign * high)) if known else (math.nan, math.nan)
        return BestDesign(
            at, self._told(case, self.chosen), float(self.sign * self.value[row]), float(low), float(high),
            self._told(case, self.worst), case,
            {name: float(sign * values[row]) for name, (sign, values, _) in self.limits.items()},
            tuple(self._told(self.first[other], self.chosen) for other in alike),
            tuple(self._margins(row, rows)), without, "",
            self._bound(FREQUENCY, case) if FREQUENCY in self.worst else "",
        )  # fmt: skip

    def _bound(self, axis: str, case: int) -> str:
        """Whether a case has the lowest or the highest of several values of an axis."""
        last = len(self.values[axis]) - 1
        return {0: "lowest", last: "highest"}.get(int(self.codes[axis][case]), "") if last else ""

    def ranked(self, count: int) -> list[dict[str, Any]]:
        """Values of the axes of the best rows of all levels; where none keeps the limits, of those nearest to them."""
        rows = np.flatnonzero(self.has_value)
        beyond = np.zeros(rows.size)
        for _, values, most in self.limits.values():
            beyond = np.maximum(beyond, np.maximum(values[rows] - most, 0.0) / (abs(most) or 1.0))
        order = np.lexsort((self.value[rows], beyond))[:count]
        return [self._told(self.first[row], [*self.given, *self.chosen]) for row in rows[order]]

    def _nearest(self, rows: NDArray[np.int64]) -> str:
        """The smallest worst value of each limited measure, in words."""
        found = []
        for name, (sign, values, _) in self.limits.items():
            own = values[rows][self.has_value[rows]]
            unit = str(self.dataset[name].attrs.get("units", ""))
            found.append(f"{name} is {unit_text(sign * float(own.min()), unit)} at {'best' if sign < 0 else 'least'}")
        return f": {', '.join(found)}"

    def _margins(self, row: int, rows: NDArray[np.int64]) -> Iterator[AxisMargin]:
        """How far each axis of numbers may be off."""
        tops = [(self.value, self.value[row] + MORE * abs(self.value[row]))]
        tops += [(values, most) for _, values, most in self.limits.values()]
        for axis in self.chosen:
            values = self.values[axis]
            if len(values) < 2 or not all(isinstance(value, (int, float)) for value in values):
                continue
            same = np.ones(rows.size, dtype=bool)
            for other in self.chosen:
                if other != axis:
                    codes = self.codes[other][self.first]
                    same &= codes[rows] == codes[row]
            line = rows[same]  # in the order of the values
            x = np.array(values, dtype=float)[self.codes[axis][self.first[line]]]
            place = int(np.flatnonzero(line == row)[0])
            excess = [np.where(self.has_value, column - top, np.nan)[line] for column, top in tops]
            below, above = (
                min((_reach(x[side], one[side]) for one in excess), key=lambda found: (found[0], not found[1]))
                for side in (slice(place, None, -1), slice(place, None))
            )
            value, bound = float(x[place]), self._bound(axis, self.first[row])
            unit = str(self.dataset[axis].attrs.get("units", ""))
            yield AxisMargin(axis, unit, value, below[0], above[0], below[1], above[1], _cliff(below, above), bound)


def _reach(
    x: Array,  # (points,) from the best outwards
    excess: Array,  # (points,) above 0 is too much
) -> tuple[float, bool]:
    """Distance to where the excess is 0, linear between the points, or to the last value; and whether it is met."""
    for i in range(1, x.size):
        if np.isnan(excess[i]):
            return abs(float(x[i - 1] - x[0])), False
        if excess[i] > 0.0:
            share = -excess[i - 1] / (excess[i] - excess[i - 1])
            return abs(float(x[i - 1] + share * (x[i] - x[i - 1]) - x[0])), True
    return abs(float(x[-1] - x[0])), False


def _cliff(below: tuple[float, bool], above: tuple[float, bool]) -> str:
    """The side on which it takes less than half the distance of the other; neither where that is not known."""
    if below[1] and above[0] > CLIFF * below[0]:
        return "below"
    return "above" if above[1] and below[0] > CLIFF * above[0] else ""
