"""What an event does: an impulse where rigid bodies collide, a change of contact state everywhere else."""

from __future__ import annotations

import math

from femimpact.integrators.compiled.compiling import apart, inlined
from femimpact.integrators.event_driven.loop_data import (
    CONTACT,
    FREE,
    SEPARATING,
    Case,
    Form,
    Ledger,
    Pairs,
    Space,
    Tables,
)
from femimpact.integrators.event_driven.motion import (
    Motion,
    Scalars,
    derivatives,
    measure,
    unit_phase,
    value_now,
)
from femimpact.integrators.event_driven.search import REST, safe_advance
from femimpact.integrators.event_driven.states import (
    base_motion,
    gap_of,
    gap_on,
    is_active,
    read_coordinates,
    side_of,
)
from femimpact.integrators.event_driven.touching import (
    add_impulse,
    begin_contact,
    count_impact,
    end_contact,
    end_sticking,
    take_back,
)

__all__ = ["ENTER", "FIT", "RELEASE_ALL", "STAY", "UNRESOLVED", "apply_event", "collide", "set_start_states"]

STAY, ENTER, FIT, RELEASE_ALL, UNRESOLVED = range(5)
"""After an event: the closed form stays; another one is entered; the same with velocities that are made to fit the
pairs that stick; the same, and the impact follows there; or impacts at one instant do not end."""

COLLISIONS_AT_ONCE = 100_000
"""Most collisions that one instant may take among several pairs."""


@apart
def set_start_states(pairs: Pairs, case: Case, motion: Motion) -> None:
    """Contact states of the coordinates that a case starts from."""
    base, base_rate = base_motion(case, motion)
    for j in range(case.state.size):
        case.state[j] = FREE
        x = gap_of(j, pairs, case.coordinates[0], base)
        rate = gap_of(j, pairs, case.coordinates[1], base_rate)
        for wall in range(2):
            side = 1.0 if wall == 0 else -1.0
            depth = side * x - gap_on(side, j, case)
            if depth > 0.0 and not pairs.rigid[j]:
                pushes = case.stiffness[j] * depth + case.damping[j] * side * rate > 0.0
                case.state[j] = side * (CONTACT if pushes else SEPARATING)
                begin_contact(j, motion.clock[0], max(side * rate, 0.0), case)


@apart
def apply_event(status: int, scalars: Scalars, pairs: Pairs, case: Case, space: Space, tables: Tables) -> int:
    """Change contact states by the event that the search has found: STAY, ENTER, FIT or RELEASE_ALL.

    With `collide` the one place for what an event does to a motion, and so for its linearisation.
    """
    search, time = space.search, space.motion.clock[0]
    r, side, count = int(search.event[0]), search.event[1], case.state.size
    j = r % count
    state = case.state[j]
    own = side_of(state)
    if r >= count:
        if abs(state) == SEPARATING:
            case.state[j] = own * CONTACT
        elif pairs.rigid[j]:
            end_sticking(j, time, case, tables)
            case.state[j] = FREE
            search.leaving[j] = own
        else:
            case.state[j] = own * SEPARATING
        return ENTER
    if abs(state) == SEPARATING:
        end_contact(j, -own * search.rate[r], time, case, tables)
        case.state[j] = FREE
        return STAY
    if pairs.rigid[j] and status != REST:
        return _before_impact(j, side, scalars, pairs, case, space, tables)
    case.state[j] = side * CONTACT
    begin_contact(j, time, max(side * search.rate[r], 0.0), case)
    search.leaving[j] = 0.0
    if status == REST and not pairs.rigid[j]:
        # what began at rest does not end by the rounding of its rate
        search.leaving[count + j] = -side
    return ENTER


@apart
def _before_impact(
    j: int, side: float, scalars: Scalars, pairs: Pairs, case: Case, space: Space, tables: Tables
) -> int:  # fmt: skip
    """Before a rigid impact pairs that stick are let go (RELEASE_ALL), or take this one in (FIT)."""
    search, time, sticking = space.search, space.motion.clock[0], False
    for i in range(case.state.size):
        sticking = sticking or (pairs.rigid[i] and is_active(case.state[i]))
    if not sticking:
        return STAY
    # what presses it there is decided with the sticking pairs in place: without their forces it may seem to leave
    lasting = -1.0
    if side * search.rate[j] <= search.negligible[0]:
        # a speed that rounding has left, as where equal parts at rest were turned into modes: no impact
        lasting = 0.0
    else:
        rebound = case.restitution[j] * side * search.rate[j]
        lasting = _bounces_left(j, side, rebound, scalars, pairs, case, space)
    if lasting >= 0.0:
        case.state[j] = side * CONTACT
        begin_contact(j, time + lasting, 0.0, case)
        return FIT
    # an impact elsewhere passes through sticking pairs as an impact of its own: they are let go
    for i in range(case.state.size):
        if pairs.rigid[i] and is_active(case.state[i]):
            case.released[i] = side_of(case.state[i])
            end_sticking(i, time, case, tables)
            case.state[i] = FREE
    return RELEASE_ALL


@apart
def collide(
    first: int, side: float, form: Form, pairs: Pairs, case: Case, space: Space, tables: Tables, b: Ledger | None
) -> int:  # fmt: skip
    """Rigid impacts at this instant: STAY or ENTER, or UNRESOLVED where they do not end.

    The rule for simultaneous impacts: one after another at the same instant, the fastest first, each with its own
    restitution, until no pair at its wall approaches it. For e = 1 and equal masses in a row it is Newton's cradle.
    """
    scalars, search, impulse, time = form.scalars, space.search, space.impulse, space.motion.clock[0]
    _find_touching(first, side, scalars, pairs, case, space)
    read_coordinates(form.shapes, space.motion, space.products.after)
    base_rate, largest, again = base_motion(case, space.motion)[1], 0.0, True
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
        count_impact(hit, time, fastest, push, case)
        add_impulse(hit, time, push, case)
        _write_impact(hit, fastest, push, pairs, case, space, tables, b)
        if b is not None:
            b.contact_loss[case.number] += 0.5 * push * (1.0 - e) * fastest
            b.work[case.number] -= wall * push * pairs.in_space[hit] * base_rate
        impulse[hit] += wall * push
        search.leaving[hit] = 0.0
        for r in range(impulse.size):
            search.rate[r] += pairs.mobility[r, hit] * wall * push
    if again:
        return UNRESOLVED
    _add_impulses(form, space)
    caught = _caught_pair(scalars, pairs, case, space)
    if caught >= 0:
        _capture(caught, form, pairs, space, tables)
        wall, rebound = search.at_wall[caught], -search.at_wall[caught] * search.rate[caught]
        take_back(caught, time, -wall * impulse[caught], case)
        if b is not None:
            b.contact_loss[case.number] -= 0.5 * wall * impulse[caught] * rebound
            b.work[case.number] -= impulse[caught] * pairs.in_space[caught] * base_rate
        case.state[caught] = wall * CONTACT
        begin_contact(caught, search.event[0], 0.0, case)
    changed = _changes_contacts(scalars, pairs, case, space.motion)
    return ENTER if changed or caught >= 0 else STAY


@apart
def _find_touching(first: int, side: float, scalars: Scalars, pairs: Pairs, case: Case, space: Space) -> None:
    """Which rigid pairs are at their walls, and their rates."""
    search, phase = space.search, unit_phase(scalars.omega, space.motion.clock)
    measure(scalars, space.motion, search)
    for r in range(case.state.size):
        search.at_wall[r] = 0.0
        if pairs.rigid[r]:
            safe_advance(r, scalars, space.motion, scalars.size.size, phase, 1.0, search)
            if case.released[r] != 0.0:
                search.at_wall[r], case.released[r] = case.released[r], 0.0
    search.at_wall[first] = side


@apart
def _write_impact(
    r: int, approach: float, push: float, pairs: Pairs, case: Case, space: Space, tables: Tables, b: Ledger | None
) -> None:  # fmt: skip
    """Note one collision; the velocities are those before it, and then those after it."""
    side, rebound, velocity = space.search.at_wall[r], case.restitution[r] * approach, space.products.after[1]
    row = tables.number[0]
    tables.number[0] = row + 1
    if row < tables.impacts.shape[0]:
        out = tables.impacts[row]
        out[0], out[1], out[2], out[3], out[4] = space.motion.clock[0], r, side, approach, rebound
        # an impulse has no largest force and no duration
        out[5], out[6], out[7], out[8] = push, math.nan, 0.0, 0.5 * push * (approach - rebound)
    if b is not None:
        for i in range(b.loss_of_mode.shape[1]):
            own = pairs.direction[r, i] * side * push
            if row < tables.impacts.shape[0]:
                tables.impacts[row, 9 + i] = own * (velocity[i] + 0.5 * own / b.mass[i])
            velocity[i] += own / b.mass[i]


@apart
def _add_impulses(form: Form, space: Space) -> None:
    """Change the motion by the impulses of all pairs."""
    for r in range(space.impulse.size):
        if space.impulse[r] == 0.0:
            continue
        for k in range(form.scalars.exponent.size):
            space.motion.entry[k] += form.impulse_entry[k, r] * space.impulse[r]
        for p in range(form.shapes.rigid_bodies):
            space.motion.rigid_body_rate[p] += form.impulse_rigid_body[p, r] * space.impulse[r]


@apart
def _bounces_left(
    j: int, side: float, rebound: float, scalars: Scalars, pairs: Pairs, case: Case, space: Space
) -> float:  # fmt: skip
    """Time (s) that the bounces to come take if none rises above the closure, else -1.

    Under a pressing acceleration a they last 2 v/(a (1 - e)) and stay below v^2/(2 a).
    """
    e, search = case.restitution[j], space.search
    measure(scalars, space.motion, search)
    derivatives(j, scalars, space.motion, unit_phase(scalars.omega, space.motion.clock), search)
    press, steepest = side * search.found[0], search.found[3]
    if press <= 1e-12 * search.found[2] or rebound * rebound > 2.0 * press * pairs.closure:
        return -1.0
    lasting: float = 2.0 * max(rebound, 0.0) / (press * (1.0 - e)) if e < 1.0 else 2.0 * rebound / press
    # and the press must last until the bounces are over
    return lasting if steepest * lasting <= 0.5 * press else -1.0


@inlined
def _caught_pair(scalars: Scalars, pairs: Pairs, case: Case, space: Space) -> int:
    """First pair that has just collided and bounces no higher than the closure, -1 for none.

    `search.event[0]` gets the end (s) of its bounces.
    """
    search = space.search
    for r in range(space.impulse.size):
        if space.impulse[r] == 0.0:
            continue
        side = search.at_wall[r]
        lasting = _bounces_left(r, side, -side * search.rate[r], scalars, pairs, case, space)
        if lasting >= 0.0:
            search.event[0] = space.motion.clock[0] + lasting
            return r
    return -1


@apart
def _capture(r: int, form: Form, pairs: Pairs, space: Space, tables: Tables) -> None:
    """Take its rebound from a pair; the impulse becomes the one that does it."""
    search, impulse = space.search, space.impulse
    rebound = -search.at_wall[r] * search.rate[r]
    for i in range(impulse.size):
        impulse[i] = 0.0
    back = rebound / -pairs.mobility[r, r]
    impulse[r] = -search.at_wall[r] * back
    _add_impulses(form, space)
    # the last impact of a pair that sticks ends without rebound
    for row in range(min(tables.number[0], tables.impacts.shape[0]) - 1, -1, -1):
        if tables.impacts[row, 1] == r:
            tables.impacts[row, 4] = 0.0
            tables.impacts[row, 5] -= back
            tables.impacts[row, 8] += 0.5 * back * rebound
            break
    search.leaving[r] = 0.0


@apart
def _changes_contacts(scalars: Scalars, pairs: Pairs, case: Case, motion: Motion) -> bool:
    """Whether an impulse elsewhere makes compliant contacts push that did not, or the other way round."""
    changed, phase = False, unit_phase(scalars.omega, motion.clock)
    for j in range(case.state.size):
        if pairs.rigid[j] or case.state[j] == FREE:
            continue
        side = side_of(case.state[j])
        pushes = side * value_now(case.state.size + j, scalars.exponent.size, phase, scalars, motion) > 0.0
        if is_active(case.state[j]) != pushes:
            case.state[j] = side * (CONTACT if pushes else SEPARATING)
            changed = True
    return changed
