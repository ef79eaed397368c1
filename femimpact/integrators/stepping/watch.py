"""Which cases a contact concerns: a quick check of every pair, between contacts too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import inlined
from femimpact.integrators.stepping.layout import GAP_MINUS, GAP_PLUS, NEAR, OPEN, RATE, RATE_BEFORE, X_BEFORE, X

__all__ = ["keep_rate", "look_ahead", "look_around", "save"]

Array = NDArray[np.float64]


@inlined
def keep_rate(rate: Array, rate_before: Array, y_rate: Array, w_rate: Array) -> None:
    """Relative rate of a pair at this step and at the last."""
    for c in range(rate.size):
        rate_before[c] = rate[c]
        rate[c] = y_rate[c] - w_rate[c]


@inlined
def look_ahead(half: float, x: Array, rate: Array, gap_plus: Array, gap_minus: Array, busy: Array) -> None:
    """Before a step with impulses: mark the cases whose gap is closed half a step on."""
    for c in range(x.size):
        ahead = x[c] + half * rate[c]
        if ahead > gap_plus[c] or ahead < -gap_minus[c]:
            busy[c] = 1.0


@inlined
def look_around(j: int, dt: float, ball: Array, constants: Array, touch: Array) -> int:
    """After a step without contact: mark the cases in which one of pair j lasts, or could have taken place within it.

    The cubic through both ends with their rates stays below max(x0, x1) + 4/27 dt (|x0'| + |x1'|).
    """
    x, x_before, rate, rate_before = ball[X, j], ball[X_BEFORE, j], ball[RATE, j], ball[RATE_BEFORE, j]
    gap_plus, gap_minus, opened, near = constants[GAP_PLUS, j], constants[GAP_MINUS, j], touch[OPEN, j], touch[NEAR, j]
    reach = dt / 6.0
    looking = 0
    for c in range(x.size):
        beyond = reach * (abs(rate_before[c]) + abs(rate[c]))
        touching = max(x[c], x_before[c]) + beyond > gap_plus[c] or min(x[c], x_before[c]) - beyond < -gap_minus[c]
        near[c] = 1.0 if touching or opened[c] > 0.0 else 0.0
        looking += near[c] > 0.0
    return looking


@inlined
def save(target: Array, source: Array) -> None:
    """Copy rows over the cases, to redo a step from them."""
    for i in range(source.shape[0]):
        kept, values = target[i], source[i]
        for c in range(values.size):
            kept[c] = values[c]
