"""Contacts that last: impulse and largest force, and the tables of impacts and sticking phases."""

from __future__ import annotations

from femimpact.integrators.compiled.compiling import apart, inlined
from femimpact.integrators.event_driven.exponentials import cosine_and_sine, exponentials
from femimpact.integrators.event_driven.ledger import integral_of
from femimpact.integrators.event_driven.loop_data import (
    BEGUN,
    LARGEST_FORCE,
    LASTED,
    LOST,
    PUSHED,
    TOUCH_SPEED,
    Case,
    Space,
    Tables,
)
from femimpact.integrators.event_driven.motion import (
    NODES,
    WEIGHTS,
    Motion,
    Scalars,
    copy_motion,
    has_blocks,
    move,
    next_panel,
    rates_now,
    taylor,
    unit_phase,
    value_now,
)
from femimpact.integrators.event_driven.states import side_of
from femimpact.response.columns import APPROACH_SUM, COUNT, FORCE_TIME, IMPULSE_SUM, LARGEST_APPROACH, PEAK_FORCE

__all__ = [
    "add_contact", "add_impulse", "begin_contact", "correct_impulse", "count_impact", "end_contact", "end_sticking",
]  # fmt: skip

PROBES = 16
"""Instants of a contact at which its force is looked at for the largest, which is then refined."""

NEWTON_STEPS = 3

FORCE_TOLERANCE = 1e-12
"""Share of the largest force that is not looked for."""


@apart
def add_contact(j: int, rigid: bool, duration: float, scalars: Scalars, case: Case, space: Space) -> None:
    """Add impulse and largest force of one contact over some time from the present motion on."""
    r, side, time = case.state.size + j, side_of(case.state[j]), space.motion.clock[0]
    if has_blocks(scalars):
        impulse, largest, best = _over_points(r, side, duration, scalars, space)
    else:
        impulse, largest, best = _impulse(r, side, scalars, space.motion, duration), 0.0, 0.0
        if not rigid:
            largest, best = _largest_probe(r, side, duration, scalars, space)
    if not rigid:
        largest = _refined(r, side, best, largest, duration, scalars, space)
    case.touch[PUSHED, j] += impulse
    case.touch[LASTED, j] += duration
    case.touch[LARGEST_FORCE, j] = max(case.touch[LARGEST_FORCE, j], largest)
    add_impulse(j, time, impulse, case)
    if _is_counted(time, case):
        case.totals[PEAK_FORCE, j] = max(case.totals[PEAK_FORCE, j], largest)


@inlined
def _impulse(r: int, side: float, scalars: Scalars, motion: Motion, duration: float) -> float:
    """Integral of a contact force, positive where the wall pushes."""
    wave = complex(0.0, scalars.omega)
    total = scalars.constant[r] * duration
    if scalars.broken:
        value, rate, bend, twist = taylor(scalars.follow, r, motion.drive)
        total += duration * (value + duration * (rate / 2 + duration * (bend / 6 + duration * twist / 24)))
    else:
        cosine, sine = cosine_and_sine(scalars.omega * duration)
        own = integral_of(wave, complex(cosine, sine), duration)
        total += (scalars.sine[r] * unit_phase(scalars.omega, motion.clock) * own).real
    growth = scalars.growth
    exponentials(scalars.exponent, duration, growth)
    for k in range(scalars.exponent.size):
        own = integral_of(scalars.exponent[k], growth[k], duration)
        total += (scalars.weight[r, k] * motion.entry[k] * own).real
    return float(side * total)


@inlined
def _largest_probe(
    r: int, side: float, duration: float, scalars: Scalars, space: Space
) -> tuple[float, float]:  # fmt: skip
    """Largest of some values of a contact force, and its time, where entries stand alone."""
    # the last place in a row of probes is that of the sine
    last, motion, turn = scalars.exponent.size, space.motion, space.turn
    value, rate, bend, twist = 0.0, 0.0, 0.0, 0.0
    if scalars.broken:
        value, rate, bend, twist = taylor(scalars.follow, r, motion.drive)
    value += scalars.constant[r]
    exponentials(scalars.exponent, duration / PROBES, turn[0])
    for k in range(last):
        turn[1, k] = scalars.weight[r, k] * motion.entry[k]
    cosine, sine = cosine_and_sine(scalars.omega * duration / PROBES)
    turn[0, last] = complex(cosine, sine)
    turn[1, last] = scalars.sine[r] * unit_phase(scalars.omega, motion.clock)
    best, largest = 0.0, 0.0
    for probe in range(PROBES + 1):
        t = probe * duration / PROBES
        force = value + t * (rate + t * (bend / 2 + t * twist / 6))
        for k in range(last + 1):
            force += turn[1, k].real
            turn[1, k] *= turn[0, k]
        if side * force > largest:
            largest, best = side * force, t
    return largest, best


@apart
def _over_points(
    r: int, side: float, duration: float, scalars: Scalars, space: Space
) -> tuple[float, float, float]:  # fmt: skip
    """Impulse, largest value and its time where entries do not stand alone: by Gauss points."""
    motion, spare = space.motion, space.spare
    copy_motion(motion, spare)
    start, elapsed, impulse, best = motion.clock[0], 0.0, 0.0, 0.0
    # a dashpot pushes most at the touch, before any of the points
    largest = max(_force(r, side, scalars, spare), 0.0)
    while elapsed < duration:
        panel = next_panel(elapsed, duration - elapsed, scalars, spare)
        half = 0.5 * panel
        for node in range(len(NODES)):
            time = start + elapsed + half * (1.0 + NODES[node])
            move(scalars, spare, time - spare.clock[0])
            force = _force(r, side, scalars, spare)
            impulse += half * WEIGHTS[node] * force
            if force > largest:
                largest, best = force, time - start
        elapsed += panel
    return impulse, largest, best


@inlined
def _force(r: int, side: float, scalars: Scalars, motion: Motion) -> float:
    phase = unit_phase(scalars.omega, motion.clock)
    return side * value_now(r, scalars.exponent.size, phase, scalars, motion)


@inlined
def _refined(
    r: int, side: float, best: float, largest: float, duration: float, scalars: Scalars, space: Space
) -> float:  # fmt: skip
    """Largest contact force by Newton's method, from the largest of those looked at."""
    for _ in range(NEWTON_STEPS):
        copy_motion(space.motion, space.spare)
        move(scalars, space.spare, best)
        force, slope, bend = rates_now(r, scalars, space.spare, space.search.power)
        largest = max(largest, side * force)
        # what is left to the crest
        if side * bend >= 0.0 or slope * slope <= 2.0 * abs(bend) * FORCE_TOLERANCE * largest:
            break
        best = min(max(best - slope / bend, 0.0), duration)
    return largest


# ---- tables ----------------------------------------------------------------------------------------


@inlined
def _is_counted(time: float, case: Case) -> bool:
    """Whether the sums of the window are open."""
    return bool(case.window[0] <= time < case.window[1])


@inlined
def add_impulse(j: int, time: float, impulse: float, case: Case) -> None:
    """Add the impulse of a contact to the sum of the window."""
    if _is_counted(time, case):
        case.totals[FORCE_TIME, j] += impulse


@inlined
def begin_contact(j: int, time: float, approach: float, case: Case) -> None:
    """A contact, or a sticking phase, begins."""
    touch = case.touch
    touch[BEGUN, j], touch[TOUCH_SPEED, j] = time, approach
    touch[PUSHED, j] = touch[LARGEST_FORCE, j] = touch[LASTED, j] = touch[LOST, j] = 0.0
    for i in range(case.to_modes.shape[1]):
        case.to_modes[j, i] = 0.0


@inlined
def count_impact(j: int, time: float, approach: float, impulse: float, case: Case) -> None:
    """Add an impact that ends now to the sums of its window."""
    if _is_counted(time, case):
        case.totals[COUNT, j] += 1.0
        case.totals[APPROACH_SUM, j] += approach
        case.totals[LARGEST_APPROACH, j] = max(case.totals[LARGEST_APPROACH, j], approach)
        case.totals[IMPULSE_SUM, j] += impulse


@inlined
def correct_impulse(j: int, time: float, impulse: float, case: Case) -> None:
    """Add to the impulse of the impact that was counted last."""
    add_impulse(j, time, impulse, case)
    if _is_counted(time, case):
        case.totals[IMPULSE_SUM, j] += impulse


@apart
def end_contact(j: int, rebound: float, time: float, case: Case, tables: Tables) -> None:
    """A compliant contact has ended: an impact more."""
    touch, side = case.touch, side_of(case.state[j])
    count_impact(j, time, touch[TOUCH_SPEED, j], touch[PUSHED, j], case)
    row = tables.number[0]
    if row < tables.impacts.shape[0]:
        out = tables.impacts[row]
        out[0], out[1], out[2], out[3], out[4] = touch[BEGUN, j], j, side, touch[TOUCH_SPEED, j], rebound
        out[5], out[6], out[7], out[8] = touch[PUSHED, j], touch[LARGEST_FORCE, j], touch[LASTED, j], touch[LOST, j]
        for i in range(case.to_modes.shape[1]):
            out[9 + i] = case.to_modes[j, i]
    tables.number[0] = row + 1


@apart
def end_sticking(j: int, time: float, case: Case, tables: Tables) -> None:
    """A sticking phase has ended; one that begins as another of the same pair ends goes on with it."""
    impulse, side = case.touch[PUSHED, j], side_of(case.state[j])
    start = case.touch[BEGUN, j]
    if start > time:
        # it ends before its bounces would have: from its capture on
        start = time - case.touch[LASTED, j]
    row = tables.number[1]
    if row < tables.sticking.shape[0]:
        for before in range(row - 1, max(row - 1 - case.state.size, -1), -1):
            out = tables.sticking[before]
            if out[0] == j and out[1] == side and out[3] >= start:
                out[3], out[4] = time, out[4] + impulse
                return
    if time > start or impulse != 0.0:
        if row < tables.sticking.shape[0]:
            out = tables.sticking[row]
            out[0], out[1], out[2], out[3], out[4] = j, side, start, time, impulse
        tables.number[1] = row + 1
