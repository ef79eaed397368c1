"""Tables of a convergence study: fitted orders, the limit, what an accuracy takes; as records and as text."""

from __future__ import annotations

import html
import itertools
import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, choice, column, quantity, require, require_name, require_type, text
from femimpact.table import figure_note, frame_of
from femimpact.units import number_text

if TYPE_CHECKING:
    import pandas
    import xarray

ROUNDED = 1e-6
"""Relative difference of two rows below which a stall is taken for rounding; above it, for a coarse mesh."""

SMALLEST = 1e-14
"""Relative difference that is rounding whatever the others are."""

FALL = 1e-4
"""Share of itself by which a size has to fall for a row to be finer than the one before."""

AGREED = 0.3
"""Difference of a found order from the expected one up to which the term of that order is taken to be the only one."""

ABOVE_FLOOR = 10.0
"""Times the floor that an error must be for an order to be read of it."""


def agrees(fitted: float, expected: float) -> bool:
    """True if a found order is the expected one, so that errors between the rows and beyond follow from it."""
    return bool(abs(fitted - expected) <= AGREED)


def extrapolated(coarse: float, fine: float, ratio: float, order: float) -> float:
    """Richardson's value from two sizes, coarse over fine = `ratio`, whose error is C size^order."""
    return float(fine + (fine - coarse) / (ratio**order - 1.0))


def is_finer(size: Array) -> NDArray[np.bool_]:
    """True where a row has a smaller size than the one before, (n - 1,)."""
    return np.asarray(size[1:] < (1.0 - FALL) * size[:-1])


def usable_rows(size: Array, value: Array, order: float) -> int:
    """Number of leading rows that converge; rounding decides in those behind.

    Rounding is taken to begin where a relative difference below 1e-6 has not fallen by at least the root of what
    follows from the order.
    """
    scale = abs(float(value[-1])) or 1.0
    change = np.abs(np.diff(value)) / scale
    for i in range(change.size):
        if change[i] <= SMALLEST:
            return max(i + 1, 2)
        if i > 0 and change[i] < ROUNDED and change[i] > change[i - 1] * (size[i + 1] / size[i]) ** (0.5 * order):
            return max(i + 1, 2)
    return value.size


def rounding_floor(value: Array, usable: int) -> float:
    """Relative differences (largest) among the rows in which rounding decides; not a number where there are none."""
    left = np.abs(np.diff(value[usable - 1 :])) / (abs(float(value[usable - 1])) or 1.0)
    return float(left.max()) if left.size else math.nan


def observed_order(size: Array, value: Array) -> float:
    """Order p with (v1 - v2)/(v2 - v3) = (h1^p - h2^p)/(h2^p - h3^p) of the last three rows; else not a number."""
    from scipy.optimize import brentq

    if value.size < 3:
        return math.nan
    (h1, h2, h3), (v1, v2, v3) = size[-3:], value[-3:]
    if v2 == v3 or (v1 - v2) / (v2 - v3) <= 0.0:
        return math.nan

    def miss(p: float) -> float:
        return float(math.log((v1 - v2) / (v2 - v3)) - math.log((h1**p - h2**p) / (h2**p - h3**p)))

    low, high = 0.1, 14.0
    return float(brentq(miss, low, high)) if miss(low) * miss(high) < 0.0 else math.nan


def local_orders(size: Array, error: Array, floor: float) -> Array:
    """Order between each row and the one before, (n,).

    Not a number at the first, where the floor decides, and where the size does not fall.
    """
    orders = np.full(error.size, np.nan)
    rows = np.flatnonzero(np.isfinite(error) & (error > 0.0))
    for before, row in pairwise(rows):
        if min(error[before], error[row]) > ABOVE_FLOOR * floor and is_finer(size[[before, row]])[0]:
            orders[row] = math.log(error[before] / error[row]) / math.log(size[before] / size[row])
    return orders


def fitted_order(size: Array, error: Array, floor: float) -> float:
    """Slope of log(error) over log(size) where the error is above a floor; the coarsest row is left out of three.

    Not a number where the size does not fall from row to row: it is then no measure of how fine a row is.
    """
    usable = np.isfinite(error) & (error > floor)
    if np.count_nonzero(usable) > 2:
        usable[np.flatnonzero(usable)[0]] = False
    return slope(size, error, usable) if np.all(is_finer(size[usable])) else math.nan


def slope(size: NDArray[Any], error: Array, usable: NDArray[np.bool_]) -> float:
    """Slope of log(error) over log(size) through the usable rows; not a number with fewer than two."""
    if np.count_nonzero(usable) < 2:
        return math.nan
    return float(np.polyfit(np.log(size[usable]), np.log(error[usable]), 1)[0])


def relative_error(value: Array | float, reference: float) -> Array:
    """Relative differences from a reference; not a number against zero."""
    return np.asarray(np.abs(value - reference) / abs(reference) if reference else np.full(np.shape(value), np.nan))


def number_for(number: Array, error: Array, order: float, accuracy: float, floor: float) -> float:
    """Number (of elements, steps, modes) from which on the error is at most an accuracy.

    Between the last row that misses it and the next one the error is taken to fall with the order, or as from one to
    the other where that is slower, and behind the last row with the order; without an order (not a number) it is the
    number of a row. Not a number where the accuracy is below the floor, or no row meets it and there is no order.
    """
    known = np.flatnonzero(np.isfinite(error))
    missing = known[error[known] > accuracy]
    if known.size == 0 or accuracy < floor:
        return math.nan
    if missing.size == 0:
        return float(number[known[0]])
    last = missing[-1]
    after = known[known > last]
    enough = float(number[after[0]]) if after.size else math.inf
    if after.size and error[after[0]] > 0.0 and enough > number[last]:
        between = math.log(error[last] / error[after[0]]) / math.log(enough / float(number[last]))
        order = min(order, between) if order > 0.0 else order
    predicted = math.ceil(float(number[last]) * (error[last] / accuracy) ** (1.0 / order)) if order > 0.0 else math.inf
    best = min(enough, float(predicted))
    return best if math.isfinite(best) else math.nan


def number_of_case(number: Array, error: Array, doubt: float, accuracy: float) -> float:
    """Number of the first row from which on the error, and a doubt (of the reference) with it, is at most an accuracy.

    It needs no order. Not a number where the last row does not meet the accuracy.
    """
    known = np.flatnonzero(np.isfinite(error))
    missing = known[~(error[known] + doubt <= accuracy)]
    after = known[known > missing[-1]] if missing.size else known
    return float(number[after[0]]) if after.size else math.nan


MEANINGFUL = 3.0
"""Standard errors beyond which a difference of two means is taken to mean something."""


def statistic(
    value: Array,  # (cases,)
    scatter: Array,  # (cases,)
    number: Array,  # (cases,)
    known: NDArray[np.intp],  # cases that have values
    accuracy: float,
) -> dict[str, Any]:
    """Differences from the finest case; the recommended number is the first from which on none means anything."""
    reference = float(value[known[-1]])
    error = relative_error(value, reference)
    noise = MEANINGFUL * np.hypot(scatter, scatter[known[-1]]) / (abs(reference) or 1.0)
    beyond = known[error[known] > np.maximum(accuracy, noise[known])]
    first = known[known > beyond[-1]][0] if beyond.size else known[0]
    # of the finest case alone nothing is known
    settled = math.nan if first == known[-1] else float(number[first])
    return {"error": error, "reference": reference, "recommended": settled}


WIDTH = 80
"""Characters of a line."""

NAME, CELL = 25, 9
"""Characters of a quantity's name, or more where one is longer, and of a number."""

WIDTHS = (7, 9, 9, 11)
"""Widths of the columns of a row of orders, in characters."""

COUNTED = {"mesh": "elements", "step": "steps in a first period", "modes": "modes"}


def table_lines(table: ConvergenceTable) -> list[str]:
    """Lines of at most 80 columns: the problem, relative errors, their orders, and notes."""
    width = max([NAME, *(len(str(name)) + 1 for name in table.name)])
    failures = zip(table.label, table.failure, strict=True)
    reasons = [_wrapped(f"{label}: {reason}") for label, reason in failures if reason]
    return [
        *textwrap.wrap(table.problem, WIDTH), *_errors(table, width), *itertools.chain(*reasons), "",
        *_orders(table, width), *(line for note in table.notes for line in _wrapped(f"- {note}")),
    ]  # fmt: skip


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, subsequent_indent="  ")


def row_line(name: str, cells: Iterable[str], width: int = NAME) -> str:
    """A line of a printed table: its name, and its cells in columns of equal width."""
    return f"{name:<{width}}{''.join(f'{entry:>{CELL}}' for entry in cells)}"[:WIDTH].rstrip()


def cell(value: Any, form: str = ".1e") -> str:
    """A number; a dash where there is none."""
    return "-" if math.isnan(value) else format(value, form)


def _errors(table: ConvergenceTable, width: int) -> list[str]:
    # cases that have values, thinned evenly to those that fit
    known = np.flatnonzero(np.any(np.isfinite(table.value), axis=1))
    most = min((WIDTH - width) // CELL, known.size)
    cases = known[np.unique(np.linspace(0, known.size - 1, most).round().astype(int))].tolist()
    statistics = bool(np.all(table.is_statistic))
    title = f"Over the {table.axis}: " + ("differences from the finest" if statistics else "relative errors")
    if len(cases) < known.size:
        title += f", {len(cases)} of {known.size} cases"
    if np.any(table.is_statistic):
        title += " (* beyond the scatter)"
    lines = [title, row_line(COUNTED[table.axis][:NAME], [number_text(table.number[i]) for i in cases], width)]
    meaningful = table.meaningful
    for j, name in enumerate(table.name):
        marks = ["*" if table.is_statistic[j] and meaningful[i, j] else "" for i in cases]
        cells = [cell(table.error[i, j]) + mark for i, mark in zip(cases, marks, strict=True)]
        lines.append(row_line(str(name), cells, width))
    return lines


def _orders(table: ConvergenceTable, width: int) -> list[str]:
    """Orders, floors, recommended numbers and limits of what does not scatter."""
    drawn = np.flatnonzero(~table.is_statistic)
    # of runs in steps that are read back none is known
    if not np.any(np.isfinite([table.fitted_order[drawn], table.expected_order[drawn], table.recommended[drawn]])):
        return []

    def line(name: str, cells: Sequence[str], end: str) -> str:
        columns = "".join(f"{entry:>{places}}" for entry, places in zip(cells, WIDTHS, strict=True))
        return f"{name:<{width - 2}}{columns}{end}"[:WIDTH].rstrip()

    lines = [line("", ["order", "expected", "floor", f"for {100.0 * table.accuracy:g} %"], "  limit")]
    for j in drawn:
        orders = [cell(table.fitted_order[j], ".2f"), cell(table.expected_order[j], "g")]
        number = ("<= " if table.recommended_is_bound[j] else "") + cell(table.recommended[j], ".5g")
        unit = "" if table.unit[j] == "1" else f" {table.unit[j]}"
        limit = "" if math.isnan(table.reference[j]) else f"  {table.reference[j]:.7g}{unit}"
        lines.append(line(str(table.name[j]), [*orders, cell(table.floor[j]), number], limit))
    return [*lines, ""]


LINEAR = "motion without balls"
"""Quantity of runs in steps, with the order of the method."""


@dataclass(frozen=True, eq=False)
class ConvergenceTable:
    """Values over one axis of a convergence study, with their errors and orders; `print` shows both.

    Parameters
    ----------
    axis : {"mesh", "step", "modes"}
    label : ndarray (cases,) of str
    number : ndarray (cases,)
        Of elements, of steps per first natural period, or of modes.
    size : ndarray (cases,)
        Longest element (m), step (s), or one over the number of modes.
    failure : ndarray (cases,) of str
        Why a case has no values; empty where it has.
    name, unit : ndarray (quantities,) of str
        Of the quantities.
    value : ndarray (cases, quantities)
    error : ndarray (cases, quantities), 1
        Relative to the reference; of mode shapes the distance from the limit, that of the finest mesh included.
    order : ndarray (cases, quantities), 1
        Between a case and the one before.
    scatter : ndarray (cases, quantities)
        Standard error of a mean over starts, in the unit of the value; 0 of what does not scatter.
    fitted_order, expected_order : ndarray (quantities,), 1
        Exponent of the size with which the error falls, as found and as the quantity's docstring derives it; not a
        number where none is known.
    reference : ndarray (quantities,)
        Over meshes Richardson's value (1911), with the refinement of the finest mesh; over steps the one that is exact
        in time; over modes the one of all dofs; of statistics the finest case's. Not a number of distances.
    floor : ndarray (quantities,), 1
        Relative error at which rounding was seen to decide; not a number where it was not reached.
    recommended : ndarray (quantities,)
        Number that gives the accuracy: by the fitted order between the cases where it is within 0.3 of the expected
        one, and checked on a separate case where the axis makes one; else that of the first case from which on the
        error, with what extrapolation has added to the reference, is small enough (`recommended_is_bound`). Not a
        number where none is known.
    accuracy : float, 1
        The relative error asked for.
    notes : tuple of str
    problem : str
        What the values are of, in a line.
    """

    _figure: ClassVar[str] = "fi.figures.convergence_panels(table)"

    axis: str = field(metadata=choice("mesh", "step", "modes"))
    label: NDArray[np.str_] = field(metadata=column("", "cases", of="text"))
    number: Array = field(metadata=column("1", "cases"))
    size: Array = field(metadata=column("m, s or 1", "cases"))
    failure: NDArray[np.str_] = field(metadata=column("", "cases", of="text"))
    name: NDArray[np.str_] = field(metadata=column("", "quantities", of="text"))
    unit: NDArray[np.str_] = field(metadata=column("", "quantities", of="text"))
    value: Array = field(metadata=column("of each quantity", "cases", "quantities"))
    error: Array = field(metadata=column("1", "cases", "quantities"))
    order: Array = field(metadata=column("1", "cases", "quantities"))
    scatter: Array = field(metadata=column("of each quantity", "cases", "quantities"))
    fitted_order: Array = field(metadata=column("1", "quantities"))
    expected_order: Array = field(metadata=column("1", "quantities"))
    reference: Array = field(metadata=column("of each quantity", "quantities"))
    floor: Array = field(metadata=column("1", "quantities"))
    recommended: Array = field(metadata=column("1", "quantities"))
    accuracy: float = field(metadata=quantity("1", above=0.0, below=1.0))
    notes: tuple[str, ...] = field(default=(), metadata=text(several=True))
    problem: str = field(default="", metadata=text())

    def __post_init__(self) -> None:
        check_fields(self)

    def __repr__(self) -> str:
        return "\n".join(table_lines(self))

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>" + figure_note(self)

    @property
    def is_statistic(self) -> NDArray[np.bool_]:
        """True for quantities that scatter, (quantities,) of bool."""
        return np.asarray(np.any(self.scatter > 0.0, axis=0))

    @property
    def kind(self) -> str:
        """What the quantities are: "statistics" that scatter, errors of "runs" in steps, or other "quantities"."""
        if np.any(self.is_statistic):
            return "statistics"
        return "runs" if LINEAR in self.name else "quantities"

    @property
    def recommended_is_bound(self) -> NDArray[np.bool_]:
        """True where fewer than the recommended number may do, (quantities,) of bool.

        It is where already the coarsest case has the accuracy, and where the fitted order is not the expected one: the
        number is then that of a case that has the accuracy, and none is read between the cases.
        """
        known = np.isfinite(self.error)
        coarsest = np.any(known, axis=0) & (self.recommended == self.number[np.argmax(known, axis=0)])
        pairs = zip(self.fitted_order, self.expected_order, strict=True)
        unlike = ~np.array([agrees(*pair) for pair in pairs], dtype=bool) & ~self.is_statistic
        return np.asarray(coarsest | (unlike & np.isfinite(self.recommended)))

    @property
    def meaningful(self) -> NDArray[np.bool_]:
        """True where a difference from the reference is beyond three standard errors, (cases, quantities) of bool."""
        noise = MEANINGFUL * np.hypot(self.scatter, self.scatter[self._finest])
        apart = self.error * np.abs(self.reference) > noise
        return np.asarray(apart | (self.scatter == 0.0))

    @property
    def _finest(self) -> int:
        known = np.flatnonzero(np.any(np.isfinite(self.value), axis=1))
        return int(known[-1]) if known.size else 0

    @property
    def number_for_all(self) -> float:
        """Smallest number with which every quantity that has an order is as accurate as asked for."""
        ordered = np.isfinite(self.expected_order)
        return float(self.recommended[ordered].max()) if np.any(ordered) else math.nan

    def index(self, name: str) -> int:
        """Number of the column of a quantity."""
        names: list[str] = self.name.tolist()
        require_name(name, names, "quantity")
        return names.index(name)

    def columns(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Columns of a row a case and their units: of each quantity value, error, order and, if any, scatter."""
        columns: dict[str, Any] = {"case": self.label, "number": self.number, "size": self.size}
        units = {"size": {"mesh": "m", "step": "s", "modes": "1"}[self.axis]}
        for i, (name, unit) in enumerate(zip(self.name.tolist(), self.unit.tolist(), strict=True)):
            key = re.sub(r"[\W_]+", "_", name.replace("''", "2")).strip("_")
            columns |= {key: self.value[:, i], f"{key}_error": self.error[:, i], f"{key}_order": self.order[:, i]}
            units |= {key: unit, f"{key}_error": "1", f"{key}_order": "1"}
            if np.any(self.scatter[:, i] > 0.0):
                columns[f"{key}_scatter"], units[f"{key}_scatter"] = self.scatter[:, i], unit
        return columns | {"failure": self.failure}, units

    def summary(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Columns of a row a quantity and their units: reference, orders, floor and recommended number."""
        units = {
            "unit": "", "reference": "", "fitted_order": "1", "expected_order": "1", "floor": "1", "recommended": "1",
            "recommended_is_bound": "",
        }  # fmt: skip
        return {"quantity": self.name} | {name: getattr(self, name) for name in units}, {"quantity": "", **units}

    def to_pandas(self) -> pandas.DataFrame:
        """A row a case; units in `attrs["units"]`."""
        columns, units = self.columns()
        return frame_of(columns, dict.fromkeys(columns, "") | units, index="case")

    def to_xarray(self) -> xarray.Dataset:
        """All of the table as a labelled dataset over cases and quantities."""
        import xarray

        both = ("value", "error", "order", "scatter")
        data: dict[str, Any] = {name: (("case", "quantity"), np.array(getattr(self, name))) for name in both}
        names = ("unit", "fitted_order", "expected_order", "reference", "floor", "recommended", "recommended_is_bound")
        data |= {name: (("quantity",), np.array(getattr(self, name))) for name in names}
        data |= {name: (("case",), np.array(getattr(self, name))) for name in ("number", "size", "failure")}
        coords = {"case": np.array(self.label), "quantity": np.array(self.name)}
        attributes = {
            "axis": self.axis, "problem": self.problem, "accuracy": self.accuracy, "notes": "; ".join(self.notes),
        }  # fmt: skip
        return xarray.Dataset(data, coords=coords, attrs=attributes)


def new_column(
    name: str, unit: str, value: Array, scatter: Array | None = None, expected_order: float = math.nan
) -> dict[str, Any]:
    """A quantity of a table of which nothing is known but its values (cases,)."""
    missing = np.full(value.size, np.nan)
    column = {"name": name, "unit": unit, "value": value, "expected_order": expected_order}
    column |= {"scatter": np.zeros(value.size) if scatter is None else scatter, "error": missing, "order": missing}
    return column | dict.fromkeys(("fitted_order", "reference", "floor", "recommended"), math.nan)


def table_of(
    axis: str, label: Sequence[str], number: Array, size: Array, columns: Sequence[dict[str, Any]],
    failure: Sequence[str] | None = None, **others: Any,
) -> ConvergenceTable:  # fmt: skip
    """A table of quantities, each as of `new_column`."""
    failures = np.array([""] * len(label) if failure is None else failure)
    of_quantities: dict[str, Any] = {name: np.array([column[name] for column in columns]).T for name in columns[0]}
    return ConvergenceTable(axis, np.array(label), number, size, failures, **of_quantities, **others)


@dataclass(frozen=True, eq=False)
class ConvergenceStudy:
    """Tables of a convergence study by the name of their axis: "mesh", "step", "modes".

    Parameters
    ----------
    tables : mapping of str to ConvergenceTable
    """

    tables: Mapping[str, ConvergenceTable]

    def __post_init__(self) -> None:
        require_type(self.tables, Mapping, "tables")
        for name, table in self.tables.items():
            require_type(table, ConvergenceTable, f"tables.{name}")
            require(table.axis == name, f"tables.{name}", table.axis, "", f"must be of the axis {name!r}")

    def __repr__(self) -> str:
        return "\n\n".join(map(repr, self.tables.values()))

    def _repr_html_(self) -> str:
        return "".join(table._repr_html_() for table in self.tables.values())

    def __getitem__(self, axis: str) -> ConvergenceTable:
        require_name(axis, self.tables, "axis")
        return self.tables[axis]
