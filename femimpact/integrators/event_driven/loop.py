"""The loop over events, case by case: the next event, readings, ledger, transition."""

from __future__ import annotations

import math

from femimpact.integrators.compiled.addresses import by_address
from femimpact.integrators.compiled.compiling import apart, called, compiled_long, inlined
from femimpact.integrators.event_driven.exponentials import cosine_and_sine, exponentials
from femimpact.integrators.event_driven.ledger import add_to_ledger, any_compliant, write_energy
from femimpact.integrators.event_driven.loop_data import (
    ENTERED,
    ENTERING,
    RESUMED,
    STARTED,
    STARTING,
    Case,
    Cases,
    Form,
    Job,
    Ledger,
)
from femimpact.integrators.event_driven.motion import (
    Array,
    Indices,
    Motion,
    copy_motion,
    has_blocks,
    move,
    move_rigid_bodies,
    unit_phase,
    value_now,
)
from femimpact.integrators.event_driven.reading import add_peaks, add_to_cycle, cycle_end, end_cycle, keep_snapshot
from femimpact.integrators.event_driven.search import END, STUCK, negligible_approach, next_event
from femimpact.integrators.event_driven.states import (
    enter_form,
    find_form,
    form_of,
    is_active,
    read_coordinates,
    set_bounds,
    set_steady_motion,
    set_walls,
    turn_knot,
)
from femimpact.integrators.event_driven.touching import add_contact
from femimpact.integrators.event_driven.transition import (
    COLLIDE,
    RELEASE_ALL,
    STAY,
    UNRESOLVED,
    apply_event,
    collide,
    set_start_states,
)

__all__ = ["DONE", "FORM_WANTED", "RESONANT", "UNENDING", "run_cases"]

DONE, FORM_WANTED, RESONANT, UNENDING = range(4)
"""What a case stopped for: its end, a closed form not made before, a steady motion that is unbounded, or events that
do not end."""

EVENTS_AT_ONCE = 200
"""Events at one instant beyond which the motion is called unresolved."""


@apart
def _enter(case: Case, job: Job, b: Ledger | None) -> int:
    """Take the coordinates of a case into the closed form of its contact states."""
    c, pairs, cases, forms, space = case.number, job.pairs, job.cases, job.forms, job.space
    motion, bounds = space.motion, space.bounds
    if cases.entering[c] == STARTING:
        set_start_states(pairs, case, motion)
        cases.entering[c] = STARTED
    f = find_form(case.state, cases.form[c, 0], forms)
    if f < 0:
        return FORM_WANTED
    n = forms.number[f]
    if not cases.known[c, n]:
        if case.omega != 0.0 and not set_steady_motion(f, case, cases, forms, bounds.steady):
            return RESONANT
        cases.known[c, n] = True
    cases.form[c, 1] = f
    set_walls(f, case, forms, bounds)
    form = by_address(form_of(f, case, cases, forms, bounds))
    if b is not None and cases.entering[c] >= STARTED:
        write_energy(pairs, case, motion, case.coordinates, b, b.start[c])
    if cases.entering[c] != RESUMED:
        enter_form(f, form.shapes, forms, case.coordinates, motion)
    cases.entering[c] = ENTERED
    return DONE


@apart
def _read(begin: int, until: float, event: bool, form: Form, case: Case, job: Job, b: Ledger | None) -> None:
    """Read the motion at every grid time after a sample up to an instant; it is left at the last of them.

    What falls on an event is read after it.
    """
    c, cases, grid, snapshots, turn = case.number, job.cases, job.grid, job.snapshots, job.space.turn
    scalars, motion = form.scalars, job.space.motion
    dt, read, phase, wave, active = grid.interval[c], 0, complex(1.0, 0.0), complex(1.0, 0.0), 0
    alone, events, observed = not has_blocks(scalars), scalars.lasting.size, 0.0
    measured = grid.cycles.shape[1]
    while True:
        sample = cases.sample[c] + 1
        i, time = sample - begin - 1, grid.start[c] + sample * dt
        if time > until or (event and time == until):
            break
        if read > 0 and alone:
            if read == 1:
                exponentials(scalars.exponent, dt, turn)
                cosine, sine = cosine_and_sine(scalars.omega * dt)
                wave = complex(cosine, sine)
            for k in range(active):
                motion.entry[k] *= turn[k]
            move_rigid_bodies(scalars, motion, time - motion.clock[0])
            phase *= wave
        else:
            move(scalars, motion, time - motion.clock[0])
            motion.clock[0] = time
            phase = unit_phase(scalars.omega, motion.clock)
            for k in range(scalars.exponent.size):
                if motion.entry[k] != 0.0:
                    active = k + 1
        motion.clock[0], read = time, read + 1
        for o in range(grid.values.shape[2]):
            value = value_now(events + o, active, phase, scalars, motion)
            if o == 0:
                observed = value
            if i < grid.values.shape[1]:
                grid.values[c, i, o] = value
        if b is not None and grid.energy.shape[1] > 0 and grid.kept[i] >= 0:
            add_to_ledger(form, job.pairs, case, job.space, b)
            write_energy(job.pairs, case, motion, job.space.products.after, b, grid.energy[c, grid.kept[i]])
        if snapshots.shown.size > 0 and snapshots.shown[i] >= 0:
            keep_snapshot(snapshots.shown[i], form.shapes, job.pairs, case, job.space, snapshots)
        cases.sample[c] = sample
        if sample > grid.origin[c] and grid.cycle[c] < measured:
            if cycle_end(c, grid) < time:
                end_cycle(c, cycle_end(c, grid), sample - 1, scalars, job.space, grid)
            if grid.cycle[c] < measured:
                add_to_cycle(sample, time, observed, phase, c, job.space, grid)
                if cycle_end(c, grid) == time:
                    add_peaks(c, time, observed, sample, scalars, job.space, grid)
                    grid.cycle[c] += 1


@called
def _to_next_event(begin: int, until: float, form: Form, case: Case, job: Job, b: Ledger | None) -> int:
    """Take a case to its next event, reading all before it; STUCK and END as in the search."""
    c, cases, space, scalars = case.number, job.cases, job.space, form.scalars
    motion, knot, index = space.motion, math.inf, 0
    if scalars.broken:
        index = math.floor(motion.clock[0] / cases.knot_interval + 1e-9) + 1
        if index < cases.knots.size:
            knot = index * cases.knot_interval
    copy_motion(motion, space.mark)
    copy_motion(motion, space.trial)
    status = next_event(scalars, space.trial, min(until, knot), space.search)
    reached = space.trial.clock[0]
    if reached > motion.clock[0]:
        cases.events[c, 1] = 0
        for j in range(case.state.size):
            if is_active(case.state[j]):
                add_contact(j, reached, job.grid.interval[c], scalars, case, space)
    copy_motion(motion, space.begin)
    _read(begin, reached, status != END, form, case, job, b)
    # the samples first: where they exclude a peak none is looked for
    if job.grid.cycle[c] < job.grid.cycles.shape[1] and cycle_end(c, job.grid) < reached:
        end_cycle(c, cycle_end(c, job.grid), cases.sample[c], scalars, space, job.grid)
    if job.grid.cycle[c] < job.grid.cycles.shape[1]:
        phase = unit_phase(scalars.omega, space.trial.clock)
        last = value_now(scalars.lasting.size, scalars.exponent.size, phase, scalars, space.trial)
        add_peaks(c, reached, last, cases.sample[c], scalars, space, job.grid)
    copy_motion(space.trial, motion)
    if b is not None and (b.everywhere or any_compliant(case, job.pairs)):
        add_to_ledger(form, job.pairs, case, space, b)
    if status == END and reached >= knot:
        turn_knot(index, cases.form[c, 1], cases, job.forms, motion)
    return status


@called
def _run_case(begin: int, until: float, most: float, case: Case, job: Job, b: Ledger | None) -> int:
    """Take one case to a time, or to where it stops."""
    c, pairs, cases, forms, space = case.number, job.pairs, job.cases, job.forms, job.space
    walls, motion, search = True, space.motion, space.search
    search.negligible[0] = negligible_approach(pairs.closure, case.omega)
    while True:
        if cases.entering[c] != ENTERED:
            status = _enter(case, job, b)
            if status != DONE:
                return status
            walls = False
        f = cases.form[c, 1]
        if walls:
            set_walls(f, case, forms, space.bounds)
        set_bounds(pairs, case, space.bounds)
        form = by_address(form_of(f, case, cases, forms, space.bounds))
        walls = False
        hit, effect = cases.hit[c], STAY
        if hit == 0.0:
            status = _to_next_event(begin, until, form, case, job, b)
            if status == END:
                if motion.clock[0] >= until:
                    return DONE
                continue
            cases.events[c, 0] += 1
            cases.events[c, 1] += 1
            if status == STUCK or cases.events[c, 1] > EVENTS_AT_ONCE or cases.events[c, 0] > most:
                return UNENDING
            pair, side = int(search.event[0]), search.event[1]
            effect = apply_event(status, form, pairs, case, space, job.tables, b)
            if effect in (COLLIDE, RELEASE_ALL):
                hit = side * (pair + 1)
        if hit != 0.0 and effect != RELEASE_ALL:
            side = 1.0 if hit > 0.0 else -1.0
            effect = collide(int(abs(hit)) - 1, side, form, pairs, case, space, job.tables, b)
            hit = 0.0
        cases.hit[c] = hit
        if effect == UNRESOLVED:
            # for the words of the refusal
            for r in range(search.at_wall.size // 2):
                case.released[r] = search.at_wall[r] if space.impulse[r] != 0.0 else 0.0
            return UNENDING
        if effect == STAY:
            walls = True
        else:
            read_coordinates(form.shapes, motion, case.coordinates)
            cases.entering[c] = ENTERING


@inlined
def _motion_of(c: int, cases: Cases) -> Motion:
    """The motion of a case, where it lies between calls."""
    body = cases.rigid_body[c]
    return Motion(cases.entry[c], body[0], body[1], cases.clock[c], cases.drive[c])


@inlined
def _case_of(c: int, cases: Cases) -> Case:
    return Case(
        c, cases.omega[c], cases.amplitude[c], cases.gap_plus[c], cases.gap_minus[c], cases.stiffness[c],
        cases.damping[c], cases.restitution[c], cases.state[c], cases.released[c], cases.coordinates[c],
        cases.touch[c], cases.to_modes[c], cases.window[c], cases.totals[c],
    )  # fmt: skip


@compiled_long
def run_cases(
    members: Indices, begin: Indices, end: Indices, most: Array, stopped: Indices,
    whole: Job, ledger: Ledger | None,
) -> None:  # fmt: skip
    """Take some cases from where they are to their sample `end`, reading those after `begin`.

    `most` (C,) are the events allowed in all; `stopped` (C,) gets what each one stopped for.
    """
    job, b = by_address(whole), by_address(ledger)
    cases, space = job.cases, job.space
    for i in range(members.size):
        c = members[i]
        kept, case = by_address(_motion_of(c, cases)), by_address(_case_of(c, cases))
        copy_motion(kept, space.motion)
        for r in range(space.search.leaving.size):
            space.search.leaving[r] = cases.leaving[c, r]
        # nothing is read before
        cases.sample[c] = max(cases.sample[c], begin[c])
        until = job.grid.start[c] + end[c] * job.grid.interval[c]
        stopped[c] = _run_case(begin[c], until, most[c], case, job, b)
        copy_motion(space.motion, kept)
        for r in range(space.search.leaving.size):
            cases.leaving[c, r] = space.search.leaving[r]
