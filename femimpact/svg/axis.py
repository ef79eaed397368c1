"""An axis of a chart: its range, its round ticks, and where on it a value lies."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["MINUS", "NO_NUMBER", "TIMES", "Axis", "axis_of", "number_text"]

Array = NDArray[np.float64]

TICKS = 6
"""Ticks of a linear axis, about."""

MINUS, TIMES, NO_NUMBER, INFINITE = "\u2212", "\u00d7", "\u2013", "\u221e"
"""A minus and a multiplication sign, a dash for a missing value, and the sign of infinity."""

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

MARGIN = 0.04
"""Share of the range that is left free at an end."""


@dataclass(frozen=True)
class Axis:
    """A range of values and how it is divided.

    Parameters
    ----------
    label : str
        Quantity with its unit.
    low, high : float
    logarithmic : bool
    """

    label: str
    low: float
    high: float
    logarithmic: bool = False

    def share(self, values: ArrayLike) -> Array:
        """Where values lie, 0 at the low end and 1 at the high one; not a number where the axis has no place."""
        array = np.asarray(values, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if self.logarithmic:
                ends = np.log10([self.low, self.high])
                found = (np.log10(np.where(array > 0.0, array, np.nan)) - ends[0]) / (ends[1] - ends[0])
            else:
                # halves, or a range of the largest numbers overflows
                found = (0.5 * array - 0.5 * self.low) / (0.5 * self.high - 0.5 * self.low)
        return np.where(np.isfinite(found), found, np.nan)

    @property
    def ticks(self) -> list[tuple[float, str]]:
        """Round values within the range, each with its text."""
        return _log_ticks(self) if self.logarithmic else _linear_ticks(self)


def axis_of(label: str, *values: ArrayLike, logarithmic: bool = False, tight: bool = False, zero: bool = False) -> Axis:
    """The axis on which all finite values have a place.

    Parameters
    ----------
    label : str
    *values : array_like
    logarithmic : bool
    tight : bool
        Whether it ends with the values, without a margin.
    zero : bool
        Whether 0 is on it.
    """
    found = [np.asarray(one, dtype=float).ravel() for one in values]
    array = np.concatenate([*found, np.zeros(1 if zero and not logarithmic else 0)])
    array = array[np.isfinite(array) & ((array > 0.0) | (not logarithmic))]
    if array.size == 0:
        return Axis(label, 0.1 if logarithmic else 0.0, 1.0, logarithmic)
    low, high = float(array.min()), float(array.max())
    if logarithmic:
        # room for what is beside it
        low, high = (min(max(end, 1e-300), 1e300) for end in (low, high))
        low, high = (low / 2.0, high * 2.0) if high <= low * 1.0001 else (low, high)
        widened = 1.0 if tight else 10.0 ** (MARGIN * (math.log10(high) - math.log10(low)))
        return Axis(label, low / widened, high * widened, True)
    if not high - low > 1e-12 * max(abs(low), abs(high)):
        half = 0.5 * abs(high) or 0.5
        return Axis(label, low - half, high + half)
    margin = 0.0 if tight else MARGIN * (0.5 * high - 0.5 * low) * 2.0
    most = 8e307
    return Axis(label, max(low if zero and low == 0.0 else low - margin, -most), min(high + margin, most))


def number_text(value: float, digits: int = 4, zeros: bool = False) -> str:
    """A number for the eye, with a minus sign and without a power of ten where that is readable.

    Parameters
    ----------
    value : float
    digits : int
        That count.
    zeros : bool
        Whether zeros at its end stay: they say how exact it is.
    """
    if math.isnan(value):
        return NO_NUMBER
    if math.isinf(value):
        return INFINITE if value > 0 else f"{MINUS}{INFINITE}"
    text = f"{value:#.{digits}g}".rstrip(".") if zeros and value else f"{value:.{digits}g}"
    mantissa, _, exponent = text.partition("e")
    if exponent:
        power = int(exponent)
        # 12340 is read more easily than with a power of ten
        text = f"{value:.0f}" if 0 < power < 7 else f"{mantissa}{TIMES}{_power_of_ten(power)}"
    return text.replace("-", MINUS)


def _power_of_ten(power: int) -> str:
    return "10" + str(power).translate(RAISED)


def _linear_ticks(axis: Axis) -> list[tuple[float, str]]:
    span = axis.high - axis.low
    step = _round_step(span / TICKS)
    if not 0.0 < step < math.inf:
        return [(axis.low, number_text(axis.low))]
    first, last = math.ceil(axis.low / step - 1e-9), math.floor(axis.high / step + 1e-9)
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    values = [k * step for k in range(first, min(last, first + 4 * TICKS) + 1)]
    largest = max(map(abs, values), default=0.0)
    plain = digits <= 5 and largest < 1e6

    def text(value: float) -> str:
        if plain:
            return f"{value:.{digits}f}".replace("-", MINUS) if value else "0"
        return number_text(value if abs(value) > 1e-9 * step else 0.0, 6)

    return [(value, text(value)) for value in values]


def _round_step(least: float) -> float:
    """The least of 1, 2, 5, 10, ... times a power of ten that is not below a value."""
    if not 0.0 < least < math.inf:
        return 0.0
    decade = 10.0 ** math.floor(math.log10(least))
    return next((n * decade for n in (1.0, 2.0, 5.0, 10.0) if n * decade >= least * (1.0 - 1e-9)), 10.0 * decade)


def _log_ticks(axis: Axis) -> list[tuple[float, str]]:
    first, last = math.floor(math.log10(axis.low)), math.ceil(math.log10(axis.high))
    decades = last - first
    steps = (1.0,) if decades > 3 else (1.0, 3.0) if decades > 2 else (1.0, 2.0, 5.0)
    stride = max(1, -(-decades // 8))
    values = [n * 10.0**k for k in range(max(first, -307), min(last, 308) + 1, stride) for n in steps]
    return [(v, _power_text(v, decades)) for v in values if axis.low * (1 - 1e-9) <= v <= axis.high * (1 + 1e-9)]


def _power_text(value: float, decades: int) -> str:
    power = round(math.log10(value))
    is_power = abs(value / 10.0**power - 1.0) < 1e-9
    return f"{value:g}" if decades <= 4 or not is_power else _power_of_ten(power)
