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
    taylor,
    unit_phase,
    value_now,
)
from femimpact.integrators.event_driven.reading import LEAST_ADVANCE, follow_peak
from femimpact.integrators.event_driven.states import side_of
from femimpact.response.columns import APPROACH_SUM, COUNT, FORCE_TIME, IMPULSE_SUM, LARGEST_APPROACH, PEAK_FORCE

__all__ = [
    "add_contact", "add_impulse", "begin_contact", "correct_impulse", "count_impact", "end_contact", "end_sticking",
]  # fmt: skip


@apart
def add_contact(j: int, until: float, interval: float, scalars: Scalars, case: Case, space: Space) -> None:
    """Add impulse and largest force of one contact from the present motion on to an instant (s).

    What lies within the window is added to its sums: a contact that goes on across an end of it is cut there.
    `interval` (s) is that of two samples.
    """
    touch, totals, window, start = case.touch, case.totals, case.window, space.motion.clock[0]
    opened = min(max(window[0], start), until)
    parts = (start, opened, min(max(window[1], opened), until), until)
    for part in range(3):
        begin, end, inside = parts[part], parts[part + 1], part == 1
        if end <= begin:
            continue
        impulse = _impulse(j, begin, end, scalars, case, space)
        # this contact may have pushed more before the window, and another one more within it
        known = min(touch[LARGEST_FORCE, j], totals[PEAK_FORCE, j]) if inside else touch[LARGEST_FORCE, j]
        largest = _largest(j, begin, end, known, LEAST_ADVANCE * min(interval, end - begin), scalars, case, space)
        touch[PUSHED, j] += impulse
        touch[LARGEST_FORCE, j] = max(touch[LARGEST_FORCE, j], largest)
        if inside:
            totals[FORCE_TIME, j] += impulse
            totals[PEAK_FORCE, j] = max(totals[PEAK_FORCE, j], largest)
    touch[LASTED, j] += until - start


@inlined
def _spare_motion_at(time: float, scalars: Scalars, space: Space) -> None:
    """Set the spare motion to the present one at an instant from now on."""
    copy_motion(space.motion, space.spare)
    if time > space.spare.clock[0]:
        move(scalars, space.spare, time - space.spare.clock[0])
        space.spare.clock[0] = time


@apart
def _impulse(j: int, begin: float, end: float, scalars: Scalars, case: Case, space: Space) -> float:
    """Integral of a contact force between two instants, positive where the wall pushes."""
    r, side, duration = case.state.size + j, side_of(case.state[j]), end - begin
    _spare_motion_at(begin, scalars, space)
    if has_blocks(scalars):
        return side * _over_points(r, duration, scalars, space.spare)
    motion, wave = space.spare, complex(0.0, scalars.omega)
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


@apart
def _over_points(r: int, duration: float, scalars: Scalars, motion: Motion) -> float:
    """Integral of a scalar where entries do not stand alone: by Gauss points; uses the motion up."""
    start, elapsed, total = motion.clock[0], 0.0, 0.0
    while elapsed < duration:
        panel = next_panel(elapsed, duration - elapsed, scalars, motion)
        half = 0.5 * panel
        for node in range(len(NODES)):
            time = start + elapsed + half * (1.0 + NODES[node])
            move(scalars, motion, time - motion.clock[0])
            total += half * WEIGHTS[node] * _value(r, scalars, motion)
        elapsed += panel
    return total


@inlined
def _value(r: int, scalars: Scalars, motion: Motion) -> float:
    return value_now(r, scalars.exponent.size, unit_phase(scalars.omega, motion.clock), scalars, motion)


@apart
def _largest(
    j: int, begin: float, end: float, known: float, least: float, scalars: Scalars, case: Case, space: Space
) -> float:  # fmt: skip
    """Largest contact force between two instants, or what is known already where that is more."""
    r, side, row = case.state.size + j, side_of(case.state[j]), space.extremes
    _spare_motion_at(end, scalars, space)
    last = _value(r, scalars, space.spare)
    row[0], row[1] = max(max(side * known, last), 0.0), min(min(side * known, last), 0.0)
    copy_motion(space.motion, space.spare)
    follow_peak(r, side, begin, end, least, scalars, space, row)
    return float(row[0] if side > 0.0 else -row[1])


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
