"""What an event does: an impulse where rigid bodies collide, a change of contact state everywhere else."""

from __future__ import annotations

import math

from femimpact.integrators.compiled.compiling import apart, inlined
from femimpact.integrators.event_driven.loop_data import (
    CONTACT,
    FREE,
    PUSHED,
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
    correct_impulse,
    count_impact,
    end_contact,
    end_sticking,
)

__all__ = ["COLLIDE", "ENTER", "RELEASE_ALL", "STAY", "UNRESOLVED", "apply_event", "collide", "set_start_states"]

STAY, ENTER, COLLIDE, RELEASE_ALL, UNRESOLVED = range(5)
"""After an event: the closed form stays; another one is entered; rigid impacts follow in this form; another one is
entered, and the impacts follow there; or impacts at one instant do not end."""

COLLISIONS_AT_ONCE = 100_000
"""Most collisions that one instant may take among several pairs."""

UNMOVED = 1e-9
"""Share of its own mobility below which pairs that stick leave a pair no motion against its wall."""

ROUNDING_SHARE = 1e-12
"""Share of an impact's speed that rounding may leave of none where it does not reach."""


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
def apply_event(
    status: int, form: Form, pairs: Pairs, case: Case, space: Space, tables: Tables, b: Ledger | None
) -> int:  # fmt: skip
    """Change contact states by the event that the search has found: STAY, ENTER, COLLIDE or RELEASE_ALL.

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
        return _beside_sticking(j, side, form, pairs, case, space, tables, b)
    case.state[j] = side * CONTACT
    begin_contact(j, time, max(side * search.rate[r], 0.0), case)
    search.leaving[j] = 0.0
    if status == REST and not pairs.rigid[j]:
        # what began at rest does not end by the rounding of its rate
        search.leaving[count + j] = -side
    return ENTER


@apart
def _beside_sticking(
    j: int, side: float, form: Form, pairs: Pairs, case: Case, space: Space, tables: Tables, b: Ledger | None
) -> int:  # fmt: skip
    """A rigid impact without rebound, of pairs that stick and one that meets its wall: STAY or ENTER.

    COLLIDE where none sticks; RELEASE_ALL where a pair rebounds, or is left by its wall: an impact elsewhere passes
    through sticking pairs as an impact of its own.
    """
    search, time, scalars, sticking, mobility = space.search, space.motion.clock[0], form.scalars, False, 0.0
    for i in range(case.state.size):
        sticks = pairs.rigid[i] and is_active(case.state[i])
        sticking = sticking or sticks
        mobility += pairs.mobility[j, i] * (1.0 if i == j else form.reaction[i, j])
    if not sticking:
        return COLLIDE
    approach, lasting = side * search.rate[j], 0.0
    # a wall that those in place leave no motion against cannot push
    push = approach / -mobility if mobility < UNMOVED * pairs.mobility[j, j] else 0.0
    # a speed that rounding has left, as where equal parts at rest were turned into modes, is no impact
    real = approach > search.negligible[0]
    if real:
        # what presses it there is decided with the sticking pairs in place: without their forces it may seem to leave
        lasting = _bounces_left(j, side, case.restitution[j] * approach, scalars, pairs, case, space)
        caught = lasting >= 0.0 or case.restitution[j] == 0.0
        if push == 0.0 or not caught or not _stay_in_place(j, side, push, form, pairs, case, space.motion):
            _release_all(time, pairs, case, tables)
            return RELEASE_ALL
    _push_in_place(j, side, approach, push, real, form, pairs, case, space, tables, b)
    changed = _changes_contacts(scalars, pairs, case, space.motion)
    search.leaving[j] = 0.0
    if lasting >= 0.0:
        case.state[j] = side * CONTACT
        begin_contact(j, time + lasting, 0.0, case)
    return ENTER if changed or lasting >= 0.0 else STAY


@inlined
def _release_all(time: float, pairs: Pairs, case: Case, tables: Tables) -> None:
    """Let go all pairs that stick."""
    for i in range(case.state.size):
        if pairs.rigid[i] and is_active(case.state[i]):
            case.released[i] = side_of(case.state[i])
            end_sticking(i, time, case, tables)
            case.state[i] = FREE


@apart
def _stay_in_place(j: int, side: float, push: float, form: Form, pairs: Pairs, case: Case, motion: Motion) -> bool:
    """Whether pairs that stick take up an impulse elsewhere: none rebounds, or is left behind, above the closure."""
    scalars, phase = form.scalars, unit_phase(form.scalars.omega, motion.clock)
    slow = ROUNDING_SHARE * push * -pairs.mobility[j, j]
    for i in range(case.state.size):
        if form.reaction[i, j] == 0.0:
            continue
        own, felt = side_of(case.state[i]), -pairs.mobility[i, i]
        share = own * form.reaction[i, j] * side * push
        speed = felt * (case.restitution[i] * share if share > 0.0 else -share)
        press = felt * own * value_now(case.state.size + i, scalars.exponent.size, phase, scalars, motion)
        if speed > slow and speed * speed > 2.0 * max(press, 0.0) * pairs.closure:
            return False
    return True


@apart
def _push_in_place(
    j: int, side: float, approach: float, push: float, real: bool, form: Form, pairs: Pairs, case: Case, space: Space,
    tables: Tables, b: Ledger | None,
) -> None:  # fmt: skip
    """Stop a pair at its wall; the impulses of those that stick belong to their sticking phases."""
    time, impulse, velocity = space.motion.clock[0], space.impulse, space.products.after[1]
    read_coordinates(form.shapes, space.motion, space.products.after)
    base_rate = base_motion(case, space.motion)[1]
    for i in range(impulse.size):
        share = form.reaction[i, j] * side * push
        impulse[i] = side * push if i == j else 0.0
        if b is not None:
            b.work[case.number] -= (share + impulse[i]) * pairs.in_space[i] * base_rate
            # an impulse works at the mean of the velocities before and after
            for k in range(velocity.size):
                velocity[k] += 0.5 * pairs.direction[i, k] * share / b.mass[k]
        if share != 0.0:
            pushed = side_of(case.state[i]) * share
            case.touch[PUSHED, i] += pushed
            add_impulse(i, time, pushed, case)
    if real:
        count_impact(j, time, approach, push, case)
        _write_impact(j, side, approach, 0.0, push, pairs, case, space, tables, b)
    add_impulse(j, time, push, case)
    if b is not None:
        b.contact_loss[case.number] += 0.5 * push * approach
    _add_impulses(form, space)


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
        _write_impact(hit, wall, fastest, e * fastest, push, pairs, case, space, tables, b)
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
        _capture(caught, form, pairs, case, space, tables, b)
        wall, rebound = search.at_wall[caught], -search.at_wall[caught] * search.rate[caught]
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
    r: int, side: float, approach: float, rebound: float, push: float, pairs: Pairs, case: Case, space: Space,
    tables: Tables, b: Ledger | None,
) -> None:  # fmt: skip
    """Note one collision; the velocities are those before it, and then those after it."""
    velocity = space.products.after[1]
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
def _capture(
    r: int, form: Form, pairs: Pairs, case: Case, space: Space, tables: Tables, b: Ledger | None
) -> None:  # fmt: skip
    """Take its rebound from a pair; the impulse becomes the one that does it."""
    search, impulse, velocity = space.search, space.impulse, space.products.after[1]
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
            if b is not None:
                for i in range(b.loss_of_mode.shape[1]):
                    own = pairs.direction[r, i] * impulse[r]
                    tables.impacts[row, 9 + i] += own * (velocity[i] + 0.5 * own / b.mass[i])
            break
    correct_impulse(r, space.motion.clock[0], -back, case)
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
