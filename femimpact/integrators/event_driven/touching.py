"""Contacts that last: impulse and largest force over a flight, and the tables of impacts and sticking phases."""

from __future__ import annotations

import cmath
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.event_driven.ledger import (
    BEGUN,
    LARGEST_FORCE,
    LASTED,
    LOST,
    PUSHED,
    TOUCH_SPEED,
    integral,
)
from femimpact.integrators.event_driven.motion import (
    NODES,
    WEIGHTS,
    Flight,
    Watch,
    copy_flight,
    has_blocks,
    move,
    multiply,
    panels_of,
    taylor,
    unit_phase,
)
from femimpact.integrators.event_driven.search import Search
from femimpact.integrators.event_driven.states import side_of
from femimpact.integrators.kernels.compiling import apart, inlined
from femimpact.integrators.layout import (
    APPROACH_SUM,
    COUNT,
    FORCE_TIME,
    IMPULSE_SUM,
    LARGEST_APPROACH,
    PEAK_FORCE,
)

__all__ = ["Tables", "add_contact", "begin_contact", "count_impact", "end_contact", "end_sticking"]

PROBES = 16
"""Instants of a contact at which its force is looked at for the largest, which is then refined."""


class Tables(NamedTuple):
    """Impacts and sticking phases of a single case, one row each; those beyond the last row are counted."""

    impacts: NDArray[Any]  # (most, 9 + n); see layout.IMPACT_COLUMNS, then the energy given to each mode
    sticking: NDArray[Any]  # (most, 5): pair, side, start and end (s), impulse (N s)
    number: NDArray[Any]  # (2,) rows of both


@apart
def add_contact(
    r: int, state: float, rigid: bool, counted: bool, watch: Watch, flight: Flight, duration: float, spare: Flight,
    turn: NDArray[Any], search: Search, contact: NDArray[Any], totals: NDArray[Any],
) -> None:  # fmt: skip
    """Add impulse and largest force of one contact over a flight that begins at the state given."""
    side, j = side_of(state), r - contact.shape[1]
    if has_blocks(watch):
        impulse, largest = _over_points(r, side, watch, flight, duration, spare, search)
    else:
        impulse, largest = _impulse(r, side, watch, flight, duration), 0.0
        if not rigid:
            largest = _largest(r, side, watch, flight, duration, turn)
    contact[PUSHED, j] += impulse
    contact[LASTED, j] += duration
    contact[LARGEST_FORCE, j] = max(contact[LARGEST_FORCE, j], largest)
    if counted:
        totals[FORCE_TIME, j] += impulse
        totals[PEAK_FORCE, j] = max(totals[PEAK_FORCE, j], largest)


@inlined
def _impulse(r: int, side: float, watch: Watch, flight: Flight, duration: float) -> float:
    """Integral of a contact force over a flight, positive where the wall pushes."""
    wave = complex(0.0, watch.omega)
    total = watch.constant[r] * duration
    if watch.broken:
        value, rate, bend, twist = taylor(watch.follow, r, flight.drive)
        total += duration * (value + duration * (rate / 2 + duration * (bend / 6 + duration * twist / 24)))
    else:
        total += (watch.sine[r] * unit_phase(watch.omega, flight.clock) * integral(wave, duration)).real
    for k in range(watch.exponent.size):
        total += (watch.weight[r, k] * flight.entry[k] * integral(watch.exponent[k], duration)).real
    return float(side * total)


@inlined
def _largest(r: int, side: float, watch: Watch, flight: Flight, duration: float, turn: NDArray[Any]) -> float:
    """Largest contact force over a flight."""
    # the last place in a row of probes is that of the sine
    last = watch.exponent.size
    turned = watch.sine[r] * unit_phase(watch.omega, flight.clock)
    value, rate, bend, twist = 0.0, 0.0, 0.0, 0.0
    if watch.broken:
        value, rate, bend, twist = taylor(watch.follow, r, flight.drive)
    value += watch.constant[r]
    for k in range(last + 1):
        e = watch.exponent[k] if k < last else complex(0.0, watch.omega)
        turn[0, k] = cmath.exp(e * (duration / PROBES))
        turn[1, k] = watch.weight[r, k] * flight.entry[k] if k < last else turned
    best, largest = 0.0, 0.0
    for probe in range(PROBES + 1):
        t = probe * duration / PROBES
        force = value + t * (rate + t * (bend / 2 + t * twist / 6))
        for k in range(last + 1):
            force += turn[1, k].real
            turn[1, k] *= turn[0, k]
        if side * force > largest:
            largest, best = side * force, t
    for _ in range(2):
        force = value + best * (rate + best * (bend / 2 + best * twist / 6))
        slope, curve, change = rate + best * (bend + best * twist / 2), bend + best * twist, twist
        for k in range(last + 1):
            e = watch.exponent[k] if k < last else complex(0.0, watch.omega)
            term = (watch.weight[r, k] * flight.entry[k] if k < last else turned) * cmath.exp(e * best)
            force += term.real
            slope += (e * term).real
            curve += (e * e * term).real
            change += (e * e * e * term).real
        largest = max(largest, side * force)
        if side * curve >= 0.0:
            break
        near = -slope / curve
        best = min(max(best - slope / (curve + 0.5 * change * near), 0.0), duration)
    return largest


@apart
def _over_points(
    r: int, side: float, watch: Watch, flight: Flight, duration: float, spare: Flight, search: Search
) -> tuple[float, float]:  # fmt: skip
    """Both where entries do not stand alone: by Gauss points, and Newton's method from the largest of them."""
    rate = search.power
    copy_flight(flight, spare)
    panels = panels_of(watch, flight, duration)
    half, start, impulse, best = 0.5 * duration / panels, flight.clock[0], 0.0, 0.0
    # a dashpot pushes most at the touch, before any of the points
    largest = max(_force(r, side, watch, spare), 0.0)
    for panel in range(panels):
        for node in range(len(NODES)):
            time = start + half * (2 * panel + 1 + NODES[node])
            move(watch, spare, time - spare.clock[0])
            force = _force(r, side, watch, spare)
            impulse += half * WEIGHTS[node] * force
            if force > largest:
                largest, best = force, time - start
    for _ in range(3):
        copy_flight(flight, spare)
        move(watch, spare, best)
        multiply(watch, spare.entry, rate[1])
        multiply(watch, rate[1], rate[2])
        turned = side * watch.sine[r] * unit_phase(watch.omega, spare.clock)
        slope, bend = -watch.omega * turned.imag, -(watch.omega**2) * turned.real
        if watch.broken:
            _, follow_rate, follow_bend, _ = taylor(watch.follow, r, spare.drive)
            slope, bend = slope + side * follow_rate, bend + side * follow_bend
        for k in range(watch.exponent.size):
            slope += side * (watch.weight[r, k] * rate[1, k]).real
            bend += side * (watch.weight[r, k] * rate[2, k]).real
        largest = max(largest, _force(r, side, watch, spare))
        if bend >= 0.0:
            break
        best = min(max(best - slope / bend, 0.0), duration)
    return impulse, largest


@inlined
def _force(r: int, side: float, watch: Watch, spare: Flight) -> float:
    """Contact force at the spare motion."""
    force = watch.constant[r] + (watch.sine[r] * unit_phase(watch.omega, spare.clock)).real
    if watch.broken:
        force += taylor(watch.follow, r, spare.drive)[0]
    for k in range(watch.exponent.size):
        force += (watch.weight[r, k] * spare.entry[k]).real
    return float(side * force)


# ---- tables ----------------------------------------------------------------------------------------


@inlined
def begin_contact(j: int, time: float, approach: float, contact: NDArray[Any], to_modes: NDArray[Any]) -> None:
    """A contact, or a sticking phase, begins."""
    contact[BEGUN, j], contact[TOUCH_SPEED, j] = time, approach
    contact[PUSHED, j] = contact[LARGEST_FORCE, j] = contact[LASTED, j] = contact[LOST, j] = 0.0
    for i in range(to_modes.shape[1]):
        to_modes[j, i] = 0.0


@inlined
def count_impact(j: int, counted: bool, approach: float, impulse: float, totals: NDArray[Any]) -> None:
    """Add an impact that ends now to the sums of its window."""
    if counted:
        totals[COUNT, j] += 1.0
        totals[APPROACH_SUM, j] += approach
        totals[LARGEST_APPROACH, j] = max(totals[LARGEST_APPROACH, j], approach)
        totals[IMPULSE_SUM, j] += impulse


@apart
def end_contact(
    j: int, side: float, rebound: float, counted: bool, contact: NDArray[Any], to_modes: NDArray[Any],
    totals: NDArray[Any], tables: Tables,
) -> None:  # fmt: skip
    """A compliant contact has ended: an impact more."""
    count_impact(j, counted, contact[TOUCH_SPEED, j], contact[PUSHED, j], totals)
    row = tables.number[0]
    if row < tables.impacts.shape[0]:
        out = tables.impacts[row]
        out[0], out[1], out[2], out[3], out[4] = contact[BEGUN, j], j, side, contact[TOUCH_SPEED, j], rebound
        out[5], out[6] = contact[PUSHED, j], contact[LARGEST_FORCE, j]
        out[7], out[8] = contact[LASTED, j], contact[LOST, j]
        for i in range(to_modes.shape[1]):
            out[9 + i] = to_modes[j, i]
    tables.number[0] = row + 1


@apart
def end_sticking(j: int, side: float, time: float, contact: NDArray[Any], tables: Tables) -> None:
    """A sticking phase has ended; one that begins as another of the same pair ends goes on with it."""
    start, impulse = contact[BEGUN, j], contact[PUSHED, j]
    row = tables.number[1]
    if row < tables.sticking.shape[0]:
        for before in range(row - 1, max(row - 1 - contact.shape[1], -1), -1):
            out = tables.sticking[before]
            if out[0] == j and out[1] == side and out[3] >= start:
                out[3], out[4] = time, out[4] + impulse
                return
    if time > start:
        if row < tables.sticking.shape[0]:
            out = tables.sticking[row]
            out[0], out[1], out[2], out[3], out[4] = j, side, start, time, impulse
        tables.number[1] = row + 1
