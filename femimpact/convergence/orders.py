"""Orders of convergence from values over a size: extrapolation, fits, the round-off floor, what an accuracy takes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "agrees", "extrapolated", "fitted_order", "is_finer", "local_orders", "number_for", "number_of_case",
    "observed_order", "rounding_floor", "usable_rows",
]  # fmt: skip

Row = NDArray[np.float64]

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


def agrees(found: float, expected: float) -> bool:
    """Whether a found order is the expected one, so that errors between the rows and beyond follow from it."""
    return bool(abs(found - expected) <= AGREED)


def extrapolated(coarse: float, fine: float, ratio: float, order: float) -> float:
    """Richardson's value from two sizes, coarse over fine = `ratio`, whose error is C size^order."""
    return float(fine + (fine - coarse) / (ratio**order - 1.0))


def is_finer(size: Row) -> NDArray[np.bool_]:
    """Whether each row has a smaller size than the one before, (n - 1,)."""
    return np.asarray(size[1:] < (1.0 - FALL) * size[:-1])


def usable_rows(size: Row, value: Row, order: float) -> int:
    """How many leading rows (n,) converge; in those behind, rounding decides.

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


def rounding_floor(value: Row, usable: int) -> float:
    """Relative differences (largest) among the rows in which rounding decides; not a number where there are none."""
    left = np.abs(np.diff(value[usable - 1 :])) / (abs(float(value[usable - 1])) or 1.0)
    return float(left.max()) if left.size else math.nan


def observed_order(size: Row, value: Row) -> float:
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


def local_orders(size: Row, error: Row, floor: float) -> Row:
    """Order between each row and the one before, (n,).

    Not a number at the first, where the floor decides, and where the size does not fall.
    """
    found = np.full(error.size, np.nan)
    rows = np.flatnonzero(np.isfinite(error) & (error > 0.0))
    for before, row in pairwise(rows):
        if min(error[before], error[row]) > ABOVE_FLOOR * floor and is_finer(size[[before, row]])[0]:
            found[row] = math.log(error[before] / error[row]) / math.log(size[before] / size[row])
    return found


def fitted_order(size: Row, error: Row, floor: float) -> float:
    """Slope of log(error) over log(size) where the error is above a floor; the coarsest row is left out of three.

    Not a number where the size does not fall from row to row: it is then no measure of how fine a row is.
    """
    usable = np.isfinite(error) & (error > floor)
    if np.count_nonzero(usable) > 2:
        usable[np.flatnonzero(usable)[0]] = False
    if np.count_nonzero(usable) < 2 or not np.all(is_finer(size[usable])):
        return math.nan
    return float(np.polyfit(np.log(size[usable]), np.log(error[usable]), 1)[0])


def number_for(number: Row, error: Row, order: float, accuracy: float, floor: float) -> float:
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
    found = math.ceil(float(number[last]) * (error[last] / accuracy) ** (1.0 / order)) if order > 0.0 else math.inf
    best = min(enough, float(found))
    return best if math.isfinite(best) else math.nan


def number_of_case(number: Row, error: Row, doubt: float, accuracy: float) -> float:
    """Number of the first row from which on the error, and a doubt (of the reference) with it, is at most an accuracy.

    It needs no order. Not a number where the last row does not meet the accuracy.
    """
    known = np.flatnonzero(np.isfinite(error))
    missing = known[~(error[known] + doubt <= accuracy)]
    after = known[known > missing[-1]] if missing.size else known
    return float(number[after[0]]) if after.size else math.nan
