"""The next event: the first watched scalar that meets its bound, whatever it stands for."""

from __future__ import annotations

import math

from femimpact.integrators.compiled.compiling import ZERO, apart, inlined
from femimpact.integrators.event_driven.motion import (
    AT_WALL,
    STICKS,
    Motion,
    Scalars,
    Search,
    clear_time,
    derivatives,
    measure,
    move,
    unit_phase,
)

__all__ = ["END", "HIT", "RELEASE", "REST", "STUCK", "negligible_approach", "next_event", "safe_advance"]

END, HIT, REST, RELEASE, STUCK = range(5)
"""How a search ended: at the end of the time, at a bound at speed, at one at rest that presses on, at the end of a
contact, or with nothing within any reasonable number of advances."""


NEGLIGIBLE_SHARE = 1e-24
"""Share of the largest entry below which one has decayed, and is left out from then on."""


NEGLIGIBLE_SIZE = 1e-60
"""Size of an entry that has decayed, whatever the others: a motion that nothing drives is at rest in the end."""


SETTLED = 1e5
"""Times its rounding that a rate must have, to end what began at rest at this instant: its own start had none."""


PAST = 100.0
"""Times its rounding by which the force of a pair that sticks is past zero: a contact elsewhere has made it jump."""


NEGLIGIBLE_APPROACH = 1e-3
"""Share of the closure that an approach may cross in a cycle and still be none, of a pair just let go and beside others
that stick."""


@inlined
def negligible_approach(closure: float, omega: float) -> float:
    """Speed (m/s) of an approach that rounding has left: it crosses less than the closure in a cycle, or in 1 s."""
    return NEGLIGIBLE_APPROACH * closure * (omega / (2.0 * math.pi) if omega > 0.0 else 1.0)


@inlined
def _creep_time(clearance: float, speed: float, bend: float, twist: float, bound: float) -> float:
    """Time in which clearance >= speed s + bend s^2/2 + twist s^3/6 + bound s^4/24, or somewhat less.

    Each term that leads to the wall stays below a quarter of one of lower order that leads away.
    """
    away_speed, away_bend, away_twist = max(-speed, 0.0), max(-bend, 0.0), max(-twist, 0.0)
    if bound <= 0.0:
        return math.inf if speed <= 0.0 and bend <= 0.0 and twist <= 0.0 else 0.0
    time: float = max(
        max((6.0 * clearance / bound) ** 0.25, (6.0 * away_speed / bound) ** (1.0 / 3.0)),
        max(math.sqrt(3.0 * away_bend / bound), away_twist / bound),
    )
    if speed > 0.0:
        time = min(time, 0.25 * clearance / speed)
    if bend > 0.0:
        time = min(time, max(math.sqrt(0.5 * clearance / bend), 0.5 * away_speed / bend))
    if twist > 0.0:
        by_speed, by_bend = math.sqrt(1.5 * away_speed / twist), 0.75 * away_bend / twist
        time = min(time, max((1.5 * clearance / twist) ** (1.0 / 3.0), max(by_speed, by_bend)))
    return time


@inlined
def safe_advance(
    r: int, scalars: Scalars, motion: Motion, active: int, phase: complex, remaining: float, c: Search
) -> float:  # fmt: skip
    """Time (s) in which scalar r crosses no bound; `at_wall` gets the side of the bound that it is at now, else 0.

    0 where it is at a bound and approaches it at speed, -1 where it presses on one at rest.
    """
    safe: float = clear_time(r, scalars, motion, active, phase, remaining, c)
    value, rate, rounding, rate_rounding = c.found[0], c.found[1], c.found[2], c.found[3]
    c.rate[r] = rate
    c.at_wall[r] = 0.0
    if scalars.upper[r] - value <= rounding:
        c.at_wall[r] = 1.0
    elif value - scalars.lower[r] <= rounding:
        c.at_wall[r] = -1.0
    over, under, farther = scalars.upper[r] - value, value - scalars.lower[r], c.found[4]
    side = 1.0 if over < under else -1.0
    clearance, toward = max(min(over, under), 0.0), side * rate
    if abs(scalars.lasting[r]) == STICKS and min(over, under) < -PAST * rounding:
        # a wall does not pull, be it for a moment
        return 0.0
    if c.at_wall[r] == 0.0:
        c.leaving[r] = 0.0
        if 2.0 * abs(rate) * safe > clearance or safe >= remaining:
            return safe
    elif c.leaving[r] != side:
        if toward > rate_rounding:
            return 0.0
    elif toward > max(SETTLED * rate_rounding, c.negligible[0] if r < scalars.lasting.size // 2 else 0.0):
        return 0.0
    # it creeps along its wall, where the bound by a parabola is far too low
    derivatives(r, scalars, motion, phase, c)
    bend, twist = side * c.found[0], side * c.found[1]
    if c.at_wall[r] != 0.0 and toward >= -rate_rounding:
        toward = 0.0
        # a pair that was let go has no acceleration left but rounding
        share = 1e-9 if c.leaving[r] == side else 1e-12
        # and none is known better than the time is
        noise = share * c.found[2] + 0.1 * AT_WALL * c.found[3] * motion.clock[0]
        noise_of_twist = share * c.found[3]
        unknown = twist == 0.0 and c.found[3] > 0.0 and c.leaving[r] != side
        if bend > noise or (bend >= -noise and (twist > noise_of_twist or unknown)):
            return -1.0
        if c.found[3] == 0.0 and bend >= -noise:
            # touching without a push, and nothing that could begin one
            return math.inf
        if bend >= -noise and abs(twist) <= noise_of_twist and c.found[4] > 0.0:
            # neither a push nor a pull beyond rounding: on as far as the pair stays at its wall to rounding
            return float((24.0 * rounding / c.found[4]) ** 0.25)
        bend = min(bend, 0.0)
    creep = min(_creep_time(clearance, toward, bend, twist, c.found[4]), farther)
    return creep if creep > safe else safe


@apart
def next_event(scalars: Scalars, motion: Motion, until: float, c: Search) -> int:
    """Move to the first event or to `until`: END, HIT, REST or RELEASE, the pair and side in `event`."""
    for _ in range(10_000_000):
        phase = unit_phase(scalars.omega, motion.clock)
        measure(scalars, motion, c)
        largest = 0.0
        for k in range(scalars.size.size):
            largest = max(largest, c.size[k])
        active = ZERO
        for k in range(scalars.size.size):
            if c.size[k] < NEGLIGIBLE_SHARE * largest or c.size[k] < NEGLIGIBLE_SIZE:
                c.size[k], motion.entry[k], c.power[0, k] = 0.0, 0.0, 0.0
            elif c.size[k] > 0.0:
                active = k + 1
        remaining = until - motion.clock[0]
        safe = remaining
        for r in range(scalars.lasting.size):
            if scalars.upper[r] == math.inf and scalars.lower[r] == -math.inf:
                continue
            own = safe_advance(r, scalars, motion, active, phase, remaining, c)
            if own > 0.0:
                safe = min(safe, own)
                continue
            c.event[0], c.event[1] = r, c.at_wall[r]
            if scalars.lasting[r] != 0.0:
                return RELEASE
            return HIT if own == 0.0 else REST
        if safe >= remaining:
            move(scalars, motion, max(remaining, 0.0))
            motion.clock[0] = until
            return END
        move(scalars, motion, safe)
    return STUCK
