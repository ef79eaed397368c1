"""The best case of a parameter study where the worst over some axes counts, and how sure it is.

Cases that agree in all axes but those of `worst_over` are one design, and its value is the worst of them. Axes of the
excitation, the start and the numerics are no choice of the user: what is best is said for each of their values, unless
they are in `worst_over`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.app.parametric.best_design import MORE, AxisMargin, BestCase, BestDesign, limit_words
from femimpact.app.study.parameter_plan import BestPlan
from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, kind_of, quantity, require, suggestion, warns
from femimpact.errors import checked as checked_value
from femimpact.figures.study_labels import BESIDE, STATISTICS, axis_names, axis_words
from femimpact.units import value_text

if TYPE_CHECKING:
    import xarray

FREQUENCY = "base.frequency"
FREQUENCY_OF_FORCE = r"force\..+\.frequency"
NO_DESIGN = ("base.", "force.", "start.", "mesh.", "reduction.", "method.")
"""Beginnings of the paths of the axes that are no choice of the user: of the excitation, the start, the numerics."""

NUMBER = quantity("1")

OF_CONTACT = ".contact."
"""Part of the paths of the axes of contact laws, whose values one seldom knows."""

BETTER = ("small", "large")
SAY_IT = 'set dataset[measure].attrs["better"] = "small" or "large"'
NOT_CHOSEN = f"of the excitation, the start or the numerics ({'*, '.join(NO_DESIGN)}*)"
NOTHING_TO_CHOOSE = f"all axes that have several values are {NOT_CHOSEN}, which are no choice"
NO_CHOICE = f", where those {NOT_CHOSEN} are no choice"

NO_BEST = "has no best case: "
UNMET = "no design keeps the limits"
"""Words of a refusal, and of one of its reasons."""

ENDS_OF_INTERVAL = ("_median_low", "_median_high")

OF_LAW = ("peak_force", "cycle_mean_force")
"""Measures that a contact law may not give."""


@warns
def best_case(
    dataset: xarray.Dataset,
    measure: str,
    worst_over: Sequence[str] | None = None,
    limits: Mapping[str, float] | None = None,
) -> BestCase:
    """The best case of a parameter study where the worst over some axes counts, and how sure it is.

    Cases that agree in all other axes are one design, in a grid, a list or a sample, and the value of a design is the
    worst of its cases, which must be there at all values of these axes at which another design is. What is best is said
    for each value of the other axes of the excitation (`base.amplitude`, `force.*`), the start (`start.*`) and the
    numerics (`mesh.*`, `reduction.*`, `method.*`), which are no choice of the user, unless they are in `worst_over`.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of `parameter_study`.
    measure : str
        Of which small values are better, or large ones: its attribute "better" says which, and can be set on a
        measure of one's own, `dataset[measure].attrs["better"] = "small"`.
    worst_over : sequence of str, optional
        Paths of axes; any other but those of the excitation counts as a choice, a restitution too. By default the
        frequencies of base and forces, where another axis remains.
    limits : mapping of str to float, optional
        What the worst value of a measure, of several starts the largest, may be at most; of a measure of which large
        values are better the smallest, at least.

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
    table = _designs_of(dataset, measure, worst_over, limits)
    designs = tuple(table.best(level) for level in range(table.levels))
    if all(design.reason for design in designs):
        raise InputError([Fault("measure", measure, "", f"{NO_BEST}{designs[0].reason}")])
    units = {name: table.unit(name) for name in (*table.values, measure, *table.limits)}
    most = {name: limit.sign * limit.bound for name, limit in table.limits.items()}
    return BestCase(
        measure, "large" if table.sign < 0.0 else "small", table.worst, most,
        int(dataset.attrs.get("starts", 1)), units, designs, table.uncertain,
    )  # fmt: skip


def ranked_designs(
    dataset: xarray.Dataset,
    measure: str,
    worst_over: Sequence[str],
    limits: Mapping[str, float] | None,
    count: int,
) -> list[dict[str, Any]]:
    """Values of the axes of at most so many best designs; where none keeps the limits, of those nearest to them."""
    return _designs_of(dataset, measure, worst_over, limits).ranked(count)


def _designs_of(
    dataset: xarray.Dataset, measure: str, worst_over: Sequence[str] | None, limits: Mapping[str, float] | None
) -> _Designs:  # fmt: skip
    """The designs of a dataset, which has values of the measures."""
    names = getattr(dataset, "data_vars", ())
    sound = hasattr(dataset, "coords") and "finished" in names and "failed_starts" in names
    require(sound, "dataset", kind_of(dataset), "", "must be what parameter_study returns")
    axes, known = axes_of(dataset), better_of_measures(dataset)
    worst, most = check_best(measure, worst_over, limits, axes, known)
    require(dataset["finished"].size > 1, "dataset", "one case", "", "has nothing to choose between")
    for name in (measure, *most):
        _require_values(dataset, name)
    return _Designs(dataset, axes, worst, measure, most, known)


def best_cases(
    dataset: xarray.Dataset,
    plan: BestPlan | None,  # of the study file
    worst_over: Sequence[str] | None = None,  # without a plan
) -> tuple[dict[str, BestCase], dict[str, str]]:
    """The best case by the measure of the plan, else by the first that has one; and why those before it have none."""
    axes, found, reasons = axes_of(dataset), dict[str, BestCase](), dict[str, str]()
    known = [name for name, better in better_of_measures(dataset).items() if better]
    if dataset["finished"].size < 2:
        return {}, {}
    if plan is None and not any(
        np.unique(dataset[axis].to_numpy().astype(str)).size > 1 for axis in axes if not axis.startswith(NO_DESIGN)
    ):
        return {}, dict.fromkeys(known, NOTHING_TO_CHOOSE)
    asked = known if plan is None else [plan.measure]
    for name in asked:
        try:
            found[name] = best_case(dataset, name, *((plan.worst_over, plan.limits) if plan else (worst_over,)))
            break
        except InputError as error:
            # a page says whose best case it is
            words = " ".join(str(error).split()).removeprefix("dataset: ")
            reasons[name] = words.partition(NO_BEST)[2] or words
    if plan is not None and reasons:
        reasons |= {name: f"[study.best] asks for {plan.measure}" for name in known if name not in reasons}
    return found, reasons


def check_best(
    measure: Any,
    worst_over: Any,
    limits: Any,
    axes: Sequence[str],  # paths of the study
    known: Mapping[str, str],  # its measures that are numbers, with what is better
) -> tuple[tuple[str, ...], dict[str, float]]:
    """The axes over which the worst counts, and the limits."""
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
    # without a choice the frequency, where another axis remains
    frequencies = frequency_axes(axes)
    default = frequencies if len(axes) > len(frequencies) else ()
    worst = default if worst_over is None else tuple(dict.fromkeys(worst_over))
    for name in worst:
        require(name in axes, "worst_over", name, "", f"is no axis of the study: {suggestion(str(name), axes)}")
    free = [name for name in axes if name not in worst and not name.startswith(NO_DESIGN)]
    require(bool(free), "worst_over", list(worst), "", f"leaves no axis to choose on: {', '.join(axes)}{NO_CHOICE}")
    return worst, {
        name: float(checked_value(f"limits.{name}", value, NUMBER)) for name, value in (limits or {}).items()
    }


def frequency_axes(axes: Iterable[str]) -> tuple[str, ...]:
    """Those of the frequency of the base or of a force."""
    return tuple(name for name in axes if name == FREQUENCY or re.fullmatch(FREQUENCY_OF_FORCE, name))


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


@dataclass(frozen=True, eq=False)
class _Limit:
    """What the worst of a measure may be, turned where large values are better."""

    sign: float
    worst: Array  # (rows,)
    bound: float


class _Designs:
    """Designs (rows) of a dataset with their worst values, small ones the better: large ones are turned.

    Rows are in the order of the values of the axes, axes by their names: what is found does not hang on how a dataset
    is sorted.
    """

    def __init__(
        self, dataset: xarray.Dataset, axes: Sequence[str], worst: tuple[str, ...], measure: str,
        limits: Mapping[str, float], better: Mapping[str, str],
    ) -> None:  # fmt: skip
        self.dataset, self.measure, self.worst = dataset, measure, worst
        coded = {axis: self._coded(axis) for axis in axes}
        self.values = {axis: values for axis, (values, _) in coded.items()}
        self.codes = {axis: codes for axis, (_, codes) in coded.items()}
        self.given = [axis for axis in axes if axis not in worst and axis.startswith(NO_DESIGN)]
        self.chosen = [axis for axis in axes if axis not in worst and axis not in self.given]
        self.uncertain = tuple(axis for axis in self.chosen if OF_CONTACT in axis and len(self.values[axis]) > 1)
        self._make_rows()
        signs = {name: -1.0 if better[name] == "large" else 1.0 for name in (measure, *limits)}
        self.sign = signs[measure]
        self.case_values, low, high = (
            self._column(measure, end, self.sign) for end in ("", *ENDS_OF_INTERVAL[:: int(self.sign)])
        )
        of_limits = {name: self._column(name, "_high" if signs[name] > 0.0 else "_low", signs[name]) for name in limits}
        self.lost = (self._flat("failed_starts") > 0) | (self._flat("finished") == 0)
        for column in (self.case_values, *of_limits.values()):
            self.lost |= np.isnan(column)
        any_lost = np.logical_or.reduceat(self.lost[self.order], self.begins)
        self.has_value = ~any_lost & (self.met == self.to_meet)
        self.value, self.low, self.high = (self._worst(column) for column in (self.case_values, low, high))
        self.limits = {
            name: _Limit(signs[name], self._worst(column), signs[name] * limits[name])
            for name, column in of_limits.items()
        }

    def unit(self, name: str) -> str:
        """Of an axis or a measure."""
        return str(self.dataset[name].attrs.get("units", ""))

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
            levels, codes = np.unique(pairs, axis=0, return_inverse=True)
            return [tuple(pair) for pair in levels.tolist()], codes.reshape(-1)
        values = self._flat(axis)
        levels, codes = np.unique(values if values.dtype.kind in "iuf" else values.astype(str), return_inverse=True)
        return levels.tolist(), codes.reshape(-1)

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
        allowed = f"no two designs agree in {', '.join(self.given)}: study a grid, or a list in which some do"
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
        valued = kept = rows[self.has_value[rows]]
        reason = "" if kept.size else f"no design has a value{f': {without[0][1]}' if without else ''}"
        for limit in self.limits.values():
            kept = kept[limit.worst[kept] <= limit.bound]
        if not kept.size:
            reason = reason or f"{UNMET}: {self._nearest(valued)}"
            return BestDesign(at, without_value=without, reason=reason)
        # of equal values the first, by the values of the axes
        row = int(kept[np.argmin(self.value[kept])])
        case = self._worst_case(row)
        alike = kept[(self.low[kept] <= self.high[row]) & (kept != row)]
        alike = alike[np.argsort(self.value[alike], kind="stable")]
        known = f"{self.measure}_median_low" in self.dataset
        low, high = sorted((self.sign * self.low[row], self.sign * self.high[row])) if known else (math.nan, math.nan)
        return BestDesign(
            at, self._told(case, self.chosen), float(self.sign * self.value[row]), float(low), float(high),
            self._told(case, self.worst), case,
            {name: float(limit.sign * limit.worst[row]) for name, limit in self.limits.items()},
            tuple(self._told(self.first[other], self.chosen) for other in alike),
            tuple(self._margins(row, rows)), without, "", tuple((self.sign * self.value[alike]).tolist()),
            self._worst_bounds(row), self._groups(case),
            tuple(self._groups(self._worst_case(other)) for other in alike), self._over_uncertain(row, rows),
            (valued.size - kept.size, valued.size),
        )  # fmt: skip

    def _worst_case(self, row: int) -> int:
        """The case of a row that has its value."""
        cases = self._cases(row)
        return int(cases[np.argmax(self.case_values[cases])])

    def _groups(self, case: int) -> tuple[float, ...]:
        """Smallest and largest start of a case whose starts lie in two groups; else nothing."""
        if f"{self.measure}_groups" not in self.dataset or not self._flat(f"{self.measure}_groups")[case] > 1.0:
            return ()
        return tuple(float(self._flat(f"{self.measure}{end}")[case]) for end in ("_low", "_high"))

    def _worst_bounds(self, row: int) -> dict[str, str]:
        """Axes of the worst of which each worst case of a row has the lowest number, or each the highest."""
        cases = self._cases(row)
        cases = cases[self.case_values[cases] == self.value[row]]
        found = dict[str, str]()
        for axis in self.worst:
            values, codes = self.values[axis], self.codes[axis][cases]
            # a seed is a name that happens to be a number
            if (
                len(values) > 1
                and not axis.endswith(".seed")
                and all(isinstance(value, (int, float)) for value in values)
            ):
                for end, code in (("lowest", 0), ("highest", len(values) - 1)):
                    if (codes == code).all():
                        found[axis] = end
        return found

    def _over_uncertain(self, row: int, rows: NDArray[np.int64]) -> float:
        """The worst value of the rows that agree with one in all axes but the uncertain ones."""
        others = [axis for axis in self.chosen if axis not in self.uncertain and len(self.values[axis]) > 1]
        if not self.uncertain or not others:
            return math.nan
        same = self._agree(row, rows, self.uncertain)
        return float(self.sign * self.value[same][self.has_value[same]].max())

    def _agree(self, row: int, rows: NDArray[np.int64], but: Sequence[str]) -> NDArray[np.int64]:
        """Those of some rows that agree with one in all chosen axes but some."""
        same = np.ones(rows.size, dtype=bool)
        for axis in self.chosen:
            if axis not in but:
                codes = self.codes[axis][self.first]
                same &= codes[rows] == codes[row]
        return rows[same]

    def ranked(self, count: int) -> list[dict[str, Any]]:
        """Values of the axes of the best rows of all levels; where none keeps the limits, of those nearest to them."""
        nearest = self._by_limits(np.flatnonzero(self.has_value))[:count]
        return [self._told(self.first[row], [*self.given, *self.chosen]) for row in nearest]

    def _by_limits(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows that have a value by the largest share by which they pass a limit, of equal shares by their values."""
        beyond = np.zeros(rows.size)
        for limit in self.limits.values():
            beyond = np.maximum(beyond, np.maximum(limit.worst[rows] - limit.bound, 0.0) / (abs(limit.bound) or 1.0))
        return rows[np.lexsort((self.value[rows], beyond))]

    def _nearest(self, rows: NDArray[np.int64]) -> str:
        """The row whose limit that is passed most is passed least, with its limited measures, in words."""
        row = self._by_limits(rows)[0]
        axes = self._told(self.first[row], self.chosen)
        at = ", ".join(
            f"{axis_words(self.dataset, axis)} {value_text(one, self.unit(axis))}" for axis, one in axes.items()
        )
        limited = (
            limit_words(name, limit.sign * float(limit.worst[row]), limit.sign * limit.bound, self.unit(name))
            for name, limit in self.limits.items()
        )
        return f"the nearest, whose largest share of a limit is smallest, has {at}, with {' and '.join(limited)}"

    def _margins(self, row: int, rows: NDArray[np.int64]) -> Iterator[AxisMargin]:
        """How far each axis of numbers may be off.

        A design that the starts cannot tell from the best is no place where the value is 15 % worse.
        """
        more = self.value - (self.value[row] + MORE * abs(self.value[row]))
        beyond = [np.where(self.low > self.high[row], more, np.minimum(more, 0.0))]
        beyond += [limit.worst - limit.bound for limit in self.limits.values()]
        for axis in self.chosen:
            values = self.values[axis]
            if len(values) < 2 or not all(isinstance(value, (int, float)) for value in values):
                continue
            line = self._agree(row, rows, [axis])  # in the order of the values
            x = np.array(values, dtype=float)[self.codes[axis][self.first[line]]]
            place = int(np.flatnonzero(line == row)[0])
            excess = [np.where(self.has_value, one, np.nan)[line] for one in beyond]
            below, above = (
                min((_reach(x[side], one[side]) for one in excess), key=lambda found: (found[0], not found[1]))
                for side in (slice(place, None, -1), slice(place, None))
            )
            value, bounds = float(x[place]), {values[0]: "lowest", values[-1]: "highest"}
            yield AxisMargin(
                axis, self.unit(axis), value, below[0], above[0], below[1], above[1], bounds.get(value, "")
            )


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
