"""Reading a case, and trying a recommended number on a separate case."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from femimpact.convergence.cases import Axis, Case, Plan
from femimpact.convergence.orders import extrapolated
from femimpact.convergence.quantities import Reading, Watched
from femimpact.errors import FemimpactError

__all__ = ["Measured", "Trial", "measured_of", "number_tried"]

Array = NDArray[np.float64]

Measured = tuple[tuple[Reading, ...], ...] | FemimpactError
"""Readings of each watched quantity, or why there are none."""

LOSS = 0.5
"""Order that a jump between two nodes may take from two cases alone."""

STRIDE = 1.1
"""Factor to the next number that is tried, where the case of one misses the accuracy."""


def measured_of(case: Case | FemimpactError, finest: Case, watched: Sequence[Watched]) -> Measured:
    """The readings of each watched quantity of a case, or why there are none."""
    if isinstance(case, FemimpactError):
        return case
    try:
        return tuple(one.read(case, finest) for one in watched)
    except FemimpactError as error:
        return error
    # what a factorisation or a memory does not manage is a row with its reason, too
    except (MemoryError, ArithmeticError, np.linalg.LinAlgError, RuntimeError) as error:
        return FemimpactError(f"{type(error).__name__}: {error}")


class Trial(NamedTuple):
    """What the cases of recommended numbers are made and read of; those that were are kept."""

    axis: Axis
    plan: Plan
    finest: Case
    most: float
    accuracy: float
    known: dict[float, Case | FemimpactError | None]

    def case(self, number: float) -> Case | FemimpactError | None:
        """The case of a number; None where the axis does not make one."""
        if number not in self.known:
            self.known[number] = self.axis.case(self.plan, number)
        return self.known[number]

    def error(self, number: float, watched: Watched, part: int, reference: float, own: float) -> float | None:
        """Relative error of a quantity in the case of a number; None where there is no case to read it of.

        Beyond the rows of a reference that is extrapolated, it is that from a case of twice the number, with what this
        one misses by an order that is `LOSS` below the expected one.
        """
        case, finest = self.case(number), self.finest
        beyond = number > self.most and math.isfinite(self.axis.ratio)
        if beyond:
            twice = self.case(2.0 * number)
            if not isinstance(twice, Case):
                return None
            finest = twice
        if not isinstance(case, Case):
            return None if case is None else math.inf
        found = measured_of(case, finest, [watched])
        exact = measured_of(finest, finest, [watched]) if beyond else None
        if isinstance(found, FemimpactError) or isinstance(exact, FemimpactError):
            return math.inf
        reading = found[0][part]
        order = reading.order - LOSS
        if reading.is_distance:
            return math.hypot(reading.value, reading.value / math.sqrt(4.0**order - 1.0) if beyond else own)
        if exact is not None:
            reference = extrapolated(reading.value, exact[0][part].value, 2.0, order)
        return abs(reading.value - reference) / abs(reference) if reference else math.inf


def number_tried(trial: Trial, watched: Watched, part: int, column: dict[str, Any], own: float, number: Array) -> float:
    """The recommended number, or the next larger one whose own case has the accuracy.

    Between the rows a place may lie otherwise in its element, and lengths fall otherwise on each side of a joint.
    Beyond them it is a multiple of the first number that an order is fitted to, so that a place which is a node of the
    rows is a node of this case and of the one with twice the number.
    """
    most = STRIDE * max(2.0 * trial.most, column["recommended"])
    known = number[np.isfinite(column["error"])]
    unit = 1.0 if math.isinf(trial.axis.ratio) else float(known[min(1, known.size - 1)])

    def admitted(found: float) -> float:
        return unit * math.ceil(found / unit) if found > trial.most else found

    wanted = admitted(column["recommended"])
    enough = number[(number >= wanted) & (column["error"] <= trial.accuracy)]
    while math.isfinite(wanted) and wanted not in enough:
        error = trial.error(wanted, watched, part, column["reference"], own)
        if error is None or error <= trial.accuracy:
            return float(wanted)
        beyond = math.ceil(STRIDE * wanted)
        rows = enough[enough <= beyond]
        wanted = rows[0] if rows.size else admitted(beyond) if beyond <= most else math.nan
    return float(wanted)
