"""Largest and smallest displacement of a cycle: those of the cubic through both ends of each step with their rates.

Between two changes of sign of the rate the motion rises or falls: the extremes of a cycle are among its begin, its
end and the crests, which are computed where the rate changes sign, and nowhere else.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import apart, called, inlined
from femimpact.integrators.compiled.packs import WIDTH, differ_in_sign
from femimpact.integrators.stepping.layout import (
    DURATION,
    LAST,
    LAST_RATE,
    NORMAL,
    REFINED,
    START,
    Cycles,
    Motion,
    Scheme,
)
from femimpact.response.columns import MAXIMUM, MINIMUM

__all__ = ["add_crests", "add_fine_step", "split_cycles"]

Array = NDArray[np.float64]


@called
def _cubic(w0: float, a: float, w1: float, b: float) -> tuple[float, float]:
    """Bend and twist of w0 + t (a + t (bend + t twist)), t from 0 to 1, that ends at w1 with the rate b."""
    increment = w1 - w0
    return 3.0 * increment - 2.0 * a - b, a + b - 2.0 * increment


@called
def _crest(w0: float, a: float, w1: float, b: float) -> float:
    """Extreme value of the cubic through both ends of an interval, with rates of opposite signs.

    a and b are per interval: w' times its length.
    """
    bend, twist = _cubic(w0, a, w1, b)
    root = math.sqrt(max(bend * bend - 3.0 * twist * a, 0.0))
    # the root of a + 2 bend t + 3 twist t^2 that lies inside, without cancellation; rounding may lead out
    t = min(max(a / (math.copysign(root, a) - bend), 0.0), 1.0)
    return w0 + t * (a + t * (bend + t * twist))


@called
def _include(c: int, w: float, sums: Array) -> None:
    """Add one displacement to the extremes of the running cycle; one that is not a number changes nothing."""
    if w > sums[MAXIMUM, c]:
        sums[MAXIMUM, c] = w
    if w < sums[MINIMUM, c]:
        sums[MINIMUM, c] = w


@called
def _extend(c: int, h: float, w: float, rate: float, impact: float, sums: Array, last: Array) -> None:
    """Take one case from its last place on to w and w', a time h later (s), past an `impact` or none.

    Two motions meet in an impact: each has one end of the step, and what lies between is no cubic.
    """
    before, rate_before = last[LAST, c], last[LAST_RATE, c]
    if differ_in_sign(rate_before, rate):
        if impact < math.inf:
            _include(c, before + impact * rate_before, sums)
        else:
            _include(c, before, sums)
            _include(c, w, sums)
            if rate_before * rate < 0.0:
                _include(c, _crest(before, h * rate_before, w, h * rate), sums)
    last[LAST, c], last[LAST_RATE, c] = w, rate


@called
def _end_cycle(c: int, cycles: Cycles) -> None:
    """Write the extremes of the cycle that ends at the last place, and begin the next one there."""
    k, sums, w = cycles.number[c], cycles.sums, cycles.last[LAST, c]
    _include(c, w, sums)
    if k < cycles.values.shape[0]:
        cycles.values[k, MAXIMUM, c], cycles.values[k, MINIMUM, c] = sums[MAXIMUM, c], sums[MINIMUM, c]
    sums[MAXIMUM, c] = sums[MINIMUM, c] = w


@apart
def _add_interval(
    c: int, start: float, stop: float, dt: float, w: float, rate: float, impact: float, cycles: Cycles
) -> None:
    """Take one case from its last place, at `start`, on to w and w' at `stop` (both in steps of dt).

    A cycle that ends within gets the part before its end, the next one the part after it.
    """
    sums, last, h = cycles.sums, cycles.last, (stop - start) * dt
    end = (cycles.number[c] + 1) * cycles.period[c]
    if start < end < stop:
        share, before = (end - start) / (stop - start), last[LAST, c]
        a, b = h * last[LAST_RATE, c], h * rate
        bend, twist = _cubic(before, a, w, b)
        place = before + share * (a + share * (bend + share * twist))
        slope = (a + share * (2.0 * bend + 3.0 * share * twist)) / h
        if impact < math.inf:
            # the instants of impacts and of cycles are not known to more than the step
            place, slope = before + share * (w - before), rate
        _extend(c, share * h, place, slope, impact, sums, last)
        _end_cycle(c, cycles)
        h *= 1.0 - share
    _extend(c, h, w, rate, impact, sums, last)
    if end == stop:
        _end_cycle(c, cycles)


@called
def _impact_in(c: int, begun: float, rigid: bool, touch: Array) -> float:
    """Time (s) from the begin of a step to its first impulse, which may lie half a step before it; else infinite.

    The impulses of a ball that stays on its wall make no jump.
    """
    first = math.inf
    if rigid:
        for j in range(touch.shape[1]):
            if touch[NORMAL, j, c] != 0.0 and touch[DURATION, j, c] == 0.0:
                first = min(first, touch[START, j, c] - begun)
    return first


@apart
def add_crests(
    first: int, begun: float, s: Scheme, w: Array, w_rate: Array, touch: Array, sums: Array, last: Array
) -> None:
    """Crests of the step that began at that time (s) in the pack of cases from `first` on, or in one case alone."""
    for c in range(first, min(first + WIDTH, w.shape[1])):
        if differ_in_sign(last[LAST_RATE, c], w_rate[0, c]):
            _extend(c, s.dt, w[0, c], w_rate[0, c], _impact_in(c, begun, s.rigid, touch), sums, last)


@apart
def split_cycles(step: int, s: Scheme, m: Motion, cycles: Cycles) -> None:
    """Extremes of the cases whose base cycle ends within this step, but for those whose fine steps have had theirs."""
    for c in range(cycles.number.size):
        if step == cycles.next_wrap[c] and m.ledger[REFINED, c] == 0.0:
            impact = _impact_in(c, (step - 1) * s.dt, s.rigid, m.touch)
            _add_interval(c, step - 1.0, float(step), s.dt, m.w[0, c], m.w_rate[0, c], impact, cycles)


@inlined
def add_fine_step(c: int, step: int, part: int, parts: int, dt: float, m: Motion, cycles: Cycles) -> None:
    """Extremes within one of the fine steps into which a case divides the step of dt that began at `step`."""
    w, rate, last = m.w[0, c], m.w_rate[0, c], cycles.last
    if differ_in_sign(last[LAST_RATE, c], rate) or step + 1 == cycles.next_wrap[c]:
        _add_interval(c, step + part / parts, step + (part + 1) / parts, dt, w, rate, math.inf, cycles)
    else:
        last[LAST, c], last[LAST_RATE, c] = w, rate
