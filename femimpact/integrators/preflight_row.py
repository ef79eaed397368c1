"""One number of a planned test beside its limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from femimpact.units import number_text, quantity_text


@dataclass(frozen=True)
class PreflightRow:
    """One number of a planned test beside its limit.

    Parameters
    ----------
    what : str
        Name of the number, with the place, mode or key that it belongs to.
    value : float
        In `unit`.
    limit : float
        In `unit`; not a number where the row only informs.
    at_least : bool
        True where the value must not be below the limit, False where it must not be above.
    instead : str
        What to choose where the limit is passed; "" where it is kept.
    """

    what: str
    value: float
    unit: str
    limit: float = math.nan
    at_least: bool = False
    instead: str = ""

    @property
    def passed(self) -> bool:
        """True where the value is beyond the limit: the test does not show what it is made for."""
        return self.value < self.limit if self.at_least else self.value > self.limit

    def __str__(self) -> str:
        words = f"{self.what}: {_with_unit(self.value, self.unit)}"
        if not math.isnan(self.limit):
            words += f" (limit: at {'least' if self.at_least else 'most'} {_with_unit(self.limit, self.unit)})"
        return f"{words}; {self.instead}" if self.passed and self.instead else words


WITH_PREFIX = ("m", "s", "Pa")
"""Units of rows that are shown with the prefix that fits; Hz, m/s^2, g and others are read as they are."""


def _with_unit(value: float, unit: str) -> str:
    if unit in WITH_PREFIX:
        return quantity_text(value, unit)
    return f"{number_text(value)} {'' if unit == '1' else unit}".rstrip()


def row_of(
    what: str, value: float, unit: str, limit: float = math.nan, instead: str = "", *, at_least: bool = False
) -> PreflightRow:
    """A row whose advice is dropped where the limit is kept."""
    row = PreflightRow(what, float(value), unit, float(limit), at_least, instead)
    return row if row.passed else replace(row, instead="")


def rounded(value: float, to: Callable[[float], int] = math.ceil) -> float:
    """The value with two digits, rounded up, or to `math.floor`."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    # rounding of the quotient adds no digit
    return float(f"{digit * to(round(value / digit, 9)):.2g}")
