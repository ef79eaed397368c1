"""What an event does: an impulse where rigid bodies meet, a change of contact state everywhere else."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from femimpact.integrators.event_driven.ledger import Ledger
from femimpact.integrators.event_driven.motion import Flight, Watch, clear_time, derivatives, measure, unit_phase
from femimpact.integrators.event_driven.search import REST, Search, look
from femimpact.integrators.event_driven.states import (
    CONTACT,
    FREE,
    SEPARATING,
    Case,
    Pairs,
    Place,
    base_motion,
    gap_of,
    is_active,
    read_coordinates,
    side_of,
)
from femimpact.integrators.event_driven.touching import (
    Tables,
    begin_contact,
    count_impact,
    end_contact,
    end_sticking,
)
from femimpact.integrators.kernels.compiling import apart, inlined
from femimpact.integrators.layout import FORCE_TIME

__all__ = ["ENTER", "FIT", "RELEASE_ALL", "STAY", "UNRESOLVED", "apply_event", "collide", "set_start_states"]

STAY, ENTER, FIT, RELEASE_ALL, UNRESOLVED = range(5)
"""After an event: the closed form stays; another one is entered; the same with velocities that are made to fit the
pairs that stick; the same, and the impact follows there; or impacts at one instant do not end."""

COLLISIONS_AT_ONCE = 100_000
"""Most collisions that one instant may take among several pairs."""


@apart
def set_start_states(
    pairs: Pairs, case: Case, coordinates: NDArray[Any], flight: Flight, contact: NDArray[Any], to_modes: NDArray[Any]
) -> None:  # fmt: skip
    """Contact states of the coordinates that a case starts from."""
    place, speed = base_motion(case.omega, case.amplitude, flight)
    for j in range(case.state.size):
        case.state[j] = FREE
        x = gap_of(j, pairs.direction, pairs.in_space, coordinates[0], place)
        rate = gap_of(j, pairs.direction, pairs.in_space, coordinates[1], speed)
        for wall in range(2):
            side = 1.0 if wall == 0 else -1.0
            depth = side * x - case.gap[wall, j]
            if depth > 0.0 and not pairs.rigid[j]:
                pushes = case.stiffness[j] * depth + case.damping[j] * side * rate > 0.0
                case.state[j] = side * (CONTACT if pushes else SEPARATING)
                begin_contact(j, 0.0, max(side * rate, 0.0), contact, to_modes)


@apart
def apply_event(
    status: int, counted: bool, watch: Watch, pairs: Pairs, case: Case, flight: Flight, search: Search,
    released: NDArray[Any], contact: NDArray[Any], to_modes: NDArray[Any], totals: NDArray[Any], tables: Tables,
) -> int:  # fmt: skip
    """Change contact states by the event that the search has found: STAY, ENTER, FIT or RELEASE_ALL.

    With `collide` the one place for what an event does to a motion, and so for its linearisation.
    """
    r, side, time = int(search.event[0]), search.event[1], flight.clock[0]
    count = case.state.size
    j = r % count
    state = case.state[j]
    own = side_of(state)
    if r >= count:
        if abs(state) == SEPARATING:
            case.state[j] = own * CONTACT
        elif pairs.rigid[j]:
            end_sticking(j, own, time, contact, tables)
            case.state[j] = FREE
            search.leaving[j] = own
        else:
            case.state[j] = own * SEPARATING
        return ENTER
    if abs(state) == SEPARATING:
        case.state[j] = FREE
        end_contact(j, own, -own * search.rate[r], counted, contact, to_modes, totals, tables)
        return STAY
    if pairs.rigid[j] and status != REST:
        return _before_impact(j, side, watch, pairs, case, flight, search, released, contact, to_modes, tables)
    case.state[j] = side * CONTACT
    begin_contact(j, time, max(side * search.rate[r], 0.0), contact, to_modes)
    search.leaving[j] = 0.0
    if status == REST and not pairs.rigid[j]:
        # what began at rest does not end by the rounding of its rate
        search.leaving[count + j] = -side
    return ENTER


@apart
def _before_impact(
    j: int, side: float, watch: Watch, pairs: Pairs, case: Case, flight: Flight, search: Search,
    released: NDArray[Any], contact: NDArray[Any], to_modes: NDArray[Any], tables: Tables,
) -> int:  # fmt: skip
    """Before a rigid impact pairs that stick are let go (RELEASE_ALL), or take this one in (FIT)."""
    sticking, moving = False, pairs.in_space[j] != 0.0
    for i in range(case.state.size):
        if pairs.rigid[i] and is_active(case.state[i]):
            sticking, moving = True, moving or pairs.in_space[i] != 0.0
    if not sticking:
        return STAY
    # what presses it there is decided with the sticking pairs in place: without their forces it may seem to leave
    lasting = -1.0
    if not moving:
        e = case.restitution[j]
        lasting = _bounces_left(j, side, e * side * search.rate[j], e, pairs.closure, watch, flight, search)
    if lasting >= 0.0:
        case.state[j] = side * CONTACT
        begin_contact(j, flight.clock[0] + lasting, 0.0, contact, to_modes)
        return FIT
    # an impact elsewhere passes through sticking pairs as an impact of its own: they are let go
    for i in range(case.state.size):
        if pairs.rigid[i] and is_active(case.state[i]):
            released[i] = side_of(case.state[i])
            end_sticking(i, released[i], flight.clock[0], contact, tables)
            case.state[i] = FREE
    return RELEASE_ALL


@apart
def collide(
    c: int, first: int, side: float, counted: bool, watch: Watch, place: Place, pairs: Pairs, case: Case,
    flight: Flight, search: Search, released: NDArray[Any], impulse: NDArray[Any], of_entry: NDArray[Any],
    of_particle: NDArray[Any], state: NDArray[Any], contact: NDArray[Any], to_modes: NDArray[Any],
    totals: NDArray[Any], tables: Tables, b: Ledger | None,
) -> int:  # fmt: skip
    """Rigid impacts at this instant: STAY or ENTER, or UNRESOLVED where they do not end.

    The rule for simultaneous impacts: one after another at the same instant, the fastest first, each with its own
    restitution, until no pair at its wall approaches it. For e = 1 and equal masses in a row it is Newton's cradle.
    """
    _find_touching(first, side, watch, pairs, flight, search, released)
    read_coordinates(place, flight, state)
    base_rate, largest, again = base_motion(case.omega, case.amplitude, flight)[1], 0.0, True
    for r in range(impulse.size):
        impulse[r] = 0.0
        largest = max(largest, search.at_wall[r] * search.rate[r])
    for _ in range(COLLISIONS_AT_ONCE):
        # what is left of the approach after so many collisions is rounding
        fastest, hit = 1e-14 * largest, -1
        for r in range(impulse.size):
            if search.at_wall[r] * search.rate[r] > fastest:
                fastest, hit = search.at_wall[r] * search.rate[r], r
        if hit < 0:
            again = False
            break
        wall, e = search.at_wall[hit], case.restitution[hit]
        push = (1.0 + e) * fastest / -pairs.mobility[hit, hit]
        count_impact(hit, counted, fastest, push, totals)
        if counted:
            totals[FORCE_TIME, hit] += push
        _write_impact(hit, wall, fastest, e * fastest, push, flight.clock[0], pairs.direction, state, tables, b)
        if b is not None:
            b.contact_loss[c] += 0.5 * push * (1.0 - e) * fastest
            b.work[c] -= wall * push * pairs.in_space[hit] * base_rate
        impulse[hit] += wall * push
        search.leaving[hit] = 0.0
        for r in range(impulse.size):
            search.rate[r] += pairs.mobility[r, hit] * wall * push
    if again:
        return UNRESOLVED
    _add_impulses(impulse, of_entry, of_particle, watch, flight)
    caught = _caught_pair(impulse, watch, pairs, case, flight, search)
    if caught >= 0:
        _capture(caught, impulse, watch, pairs, flight, search, of_entry, of_particle, tables)
        wall, rebound = search.at_wall[caught], -search.at_wall[caught] * search.rate[caught]
        if b is not None:
            b.contact_loss[c] -= 0.5 * wall * impulse[caught] * rebound
            b.work[c] -= impulse[caught] * pairs.in_space[caught] * base_rate
        case.state[caught] = wall * CONTACT
        begin_contact(caught, search.event[0], 0.0, contact, to_modes)
    changed = _changes_contacts(watch, pairs, case, flight, search)
    return ENTER if changed or caught >= 0 else STAY


@apart
def _find_touching(
    first: int, side: float, watch: Watch, pairs: Pairs, flight: Flight, search: Search, released: NDArray[Any]
) -> None:  # fmt: skip
    """Which rigid pairs are at their walls, and their rates."""
    phase = unit_phase(watch.omega, flight.clock)
    measure(watch, flight, search.size, search.power[0])
    for r in range(released.size):
        search.at_wall[r] = 0.0
        if pairs.rigid[r]:
            look(r, watch, flight, watch.size.size, phase, 1.0, search)
            if released[r] != 0.0:
                search.at_wall[r], released[r] = released[r], 0.0
    search.at_wall[first] = side


@inlined
def _write_impact(
    r: int, side: float, approach: float, rebound: float, push: float, time: float, direction: NDArray[Any],
    state: NDArray[Any], tables: Tables, b: Ledger | None,
) -> None:  # fmt: skip
    """Note one collision; the velocities are those before it, and then those after it."""
    row = tables.number[0]
    tables.number[0] = row + 1
    if row < tables.impacts.shape[0]:
        out = tables.impacts[row]
        # an impulse has no largest force and no duration
        out[0], out[1], out[2], out[3], out[4] = time, r, side, approach, rebound
        out[5], out[6], out[7], out[8] = push, math.nan, 0.0, 0.5 * push * (approach - rebound)
    if b is not None:
        for i in range(b.loss_of_mode.shape[1]):
            own = direction[r, i] * side * push
            if row < tables.impacts.shape[0]:
                tables.impacts[row, 9 + i] = own * (state[1, i] + 0.5 * own / b.mass[i])
            state[1, i] += own / b.mass[i]


@apart
def _add_impulses(
    impulse: NDArray[Any], of_entry: NDArray[Any], of_particle: NDArray[Any], watch: Watch, flight: Flight
) -> None:  # fmt: skip
    for r in range(impulse.size):
        if impulse[r] == 0.0:
            continue
        for k in range(watch.exponent.size):
            flight.entry[k] += of_entry[k, r] * impulse[r]
        for p in range(watch.particle_given.size):
            flight.particle_rate[p] += of_particle[p, r] * impulse[r]


@apart
def _bounces_left(
    j: int, side: float, rebound: float, e: float, closure: float, watch: Watch, flight: Flight, search: Search
) -> float:  # fmt: skip
    """Time (s) that the bounces to come take if none rises above the closure, else -1.

    Under a pressing acceleration a they last 2 v/(a (1 - e)) and stay below v^2/(2 a).
    """
    measure(watch, flight, search.size, search.power[0])
    phase = unit_phase(watch.omega, flight.clock)
    derivatives(j, watch, flight, phase, search.size, search.power, search.found)
    press, steepest = side * search.found[0], search.found[3]
    if press <= 1e-12 * search.found[2] or rebound * rebound > 2.0 * press * closure:
        return -1.0
    lasting: float = 2.0 * max(rebound, 0.0) / (press * (1.0 - e)) if e < 1.0 else 2.0 * rebound / press
    # and the press must last until the bounces are over
    return lasting if steepest * lasting <= 0.5 * press else -1.0


@inlined
def _caught_pair(
    impulse: NDArray[Any], watch: Watch, pairs: Pairs, case: Case, flight: Flight, search: Search
) -> int:  # fmt: skip
    """First pair that has just collided and bounces no higher than the closure, -1 for none.

    `search.event[0]` gets the end (s) of its bounces.
    """
    for r in range(impulse.size):
        if impulse[r] == 0.0:
            continue
        side, e = search.at_wall[r], case.restitution[r]
        lasting = _bounces_left(r, side, -side * search.rate[r], e, pairs.closure, watch, flight, search)
        if lasting >= 0.0:
            search.event[0] = flight.clock[0] + lasting
            return r
    return -1


@inlined
def _capture(
    r: int, impulse: NDArray[Any], watch: Watch, pairs: Pairs, flight: Flight, search: Search, of_entry: NDArray[Any],
    of_particle: NDArray[Any], tables: Tables,
) -> None:  # fmt: skip
    """Take its rebound from a pair; `impulse` becomes the one that does it."""
    rebound = -search.at_wall[r] * search.rate[r]
    for i in range(impulse.size):
        impulse[i] = 0.0
    back = rebound / -pairs.mobility[r, r]
    impulse[r] = -search.at_wall[r] * back
    _add_impulses(impulse, of_entry, of_particle, watch, flight)
    # the last impact of a pair that sticks ends without rebound
    for row in range(min(tables.number[0], tables.impacts.shape[0]) - 1, -1, -1):
        if tables.impacts[row, 1] == r:
            tables.impacts[row, 4] = 0.0
            tables.impacts[row, 5] -= back
            tables.impacts[row, 8] += 0.5 * back * rebound
            break
    search.leaving[r] = 0.0


@apart
def _changes_contacts(watch: Watch, pairs: Pairs, case: Case, flight: Flight, search: Search) -> bool:
    """Whether an impulse elsewhere makes compliant contacts push that did not, or the other way round."""
    changed, phase = False, unit_phase(watch.omega, flight.clock)
    measure(watch, flight, search.size, search.power[0])
    for j in range(case.state.size):
        state = case.state[j]
        if pairs.rigid[j] or state == FREE:
            continue
        # of this only the value is wanted
        clear_time(
            case.state.size + j, watch, flight, watch.size.size, search.size, search.power[0], phase, 1.0, search.found
        )
        side = side_of(state)
        pushes = side * search.found[0] > 0.0
        if is_active(state) != pushes:
            case.state[j] = side * (CONTACT if pushes else SEPARATING)
            changed = True
    return changed
