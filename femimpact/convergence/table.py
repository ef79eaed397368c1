"""The results of a convergence study: one table for each axis."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence.orders import agrees
from femimpact.convergence.text import COUNTED, table_lines
from femimpact.errors import check_fields, choice, column, quantity, require, require_name, require_type, text
from femimpact.svg.axis import axis_of
from femimpact.svg.chart import COLOURS, Chart, Line, notebook_markup
from femimpact.table import frame_of

if TYPE_CHECKING:
    import pandas
    import xarray

__all__ = ["ConvergenceStudy", "ConvergenceTable"]

Array = NDArray[np.float64]

MEANINGFUL = 3.0
"""Standard errors beyond which a difference of two means is taken to mean something."""


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
        Over meshes Richardson's value, with the refinement of the finest mesh; over steps the one that is exact in
        time; over modes the one of all dofs; of statistics the finest case's. Not a number of distances.
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

    Raises
    ------
    InputError
        If a column is of the wrong kind, or not as long as the others along its axis.
    """

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
        return f"<pre>{html.escape(repr(self))}</pre>" + notebook_markup(self._picture)

    @property
    def _picture(self) -> Chart | None:
        """Errors of the first quantities over the number."""
        lines: list[Line] = []
        for i, name in enumerate(self.name.tolist()):
            known = np.isfinite(self.error[:, i]) & (self.error[:, i] > 0.0)
            if np.any(known) and len(lines) < COLOURS:
                x, y = self.number[known], self.error[known, i]
                lines.append(Line(name, x, y, 1 + len(lines), marked=np.ones(x.size, dtype=bool)))
        across = axis_of(COUNTED[self.axis], *(line.x for line in lines), logarithmic=True)
        up = axis_of("relative error", *(line.y for line in lines), logarithmic=True)
        return Chart("", across, up, tuple(lines)) if lines else None

    @property
    def is_statistic(self) -> NDArray[np.bool_]:
        """Whether a quantity scatters, (quantities,) of bool."""
        return np.asarray(np.any(self.scatter > 0.0, axis=0))

    @property
    def recommended_is_bound(self) -> NDArray[np.bool_]:
        """Whether fewer than the recommended number may do, (quantities,) of bool.

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
        """Whether a difference from the reference is beyond three standard errors, (cases, quantities) of bool."""
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
        """Number of the column of a quantity.

        Raises
        ------
        InputError
            If there is no such quantity.
        """
        names: list[str] = self.name.tolist()
        require_name(name, names, "quantity")
        return names.index(name)

    def columns(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Columns of a row a case and their units: of each quantity value, error, order and, if any, scatter."""
        columns: dict[str, Any] = {"case": self.label, "number": self.number, "size": self.size}
        units = {"size": {"mesh": "m", "step": "s", "modes": "1"}[self.axis]}
        for i, (name, unit) in enumerate(zip(self.name.tolist(), self.unit.tolist(), strict=True)):
            key = _key(name)
            columns |= {key: self.value[:, i], f"{key}_error": self.error[:, i], f"{key}_order": self.order[:, i]}
            units |= {key: unit, f"{key}_error": "1", f"{key}_order": "1"}
            if np.any(self.scatter[:, i] > 0.0):
                columns[f"{key}_scatter"], units[f"{key}_scatter"] = self.scatter[:, i], unit
        return columns | {"failure": self.failure}, units

    def summary(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Columns of a row a quantity and their units: reference, orders, floor and recommended number."""
        columns = {
            "quantity": self.name, "unit": self.unit, "reference": self.reference,
            "fitted_order": self.fitted_order, "expected_order": self.expected_order, "floor": self.floor,
            "recommended": self.recommended, "recommended_is_bound": self.recommended_is_bound,
        }  # fmt: skip
        return columns, {
            "quantity": "",
            "unit": "",
            "reference": "",
            "fitted_order": "1",
            "expected_order": "1",
            "floor": "1",
            "recommended": "1",
            "recommended_is_bound": "",
        }

    def to_pandas(self) -> pandas.DataFrame:
        """A row a case; units in `attrs["units"]`."""
        columns, units = self.columns()
        return frame_of(columns, dict.fromkeys(columns, "") | units, index="case")

    def to_xarray(self) -> xarray.Dataset:
        """All of the table as a labelled dataset over cases and quantities."""
        import xarray

        both, one = ("case", "quantity"), ("quantity",)
        data: dict[str, Any] = {name: (both, np.array(getattr(self, name)))
                                for name in ("value", "error", "order", "scatter")}  # fmt: skip
        of_quantities = ("unit", "fitted_order", "expected_order", "reference", "floor", "recommended")
        for name in (*of_quantities, "recommended_is_bound"):
            data[name] = (one, np.array(getattr(self, name)))
        for name in ("number", "size", "failure"):
            data[name] = (("case",), np.array(getattr(self, name)))
        coords = {"case": np.array(self.label), "quantity": np.array(self.name)}
        attributes = {
            "axis": self.axis, "problem": self.problem, "accuracy": self.accuracy, "notes": "; ".join(self.notes),
        }  # fmt: skip
        return xarray.Dataset(data, coords=coords, attrs=attributes)


def _key(name: str) -> str:
    """A quantity's name as that of a column."""
    plain = "".join(letter if letter.isalnum() else "_" for letter in name.replace("''", "2"))
    return "_".join(part for part in plain.split("_") if part)


@dataclass(frozen=True, eq=False)
class ConvergenceStudy:
    """Tables of a convergence study by the name of their axis: "mesh", "step", "modes".

    Parameters
    ----------
    tables : mapping of str to ConvergenceTable

    Raises
    ------
    InputError
        If a value is not a table of the axis of its name.
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
