"""The loop over events, case by case: the next event, readings, ledger, transition."""

from __future__ import annotations

import cmath
import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.event_driven.ledger import Ledger, Products, add_to_ledger, any_compliant, write_energy
from femimpact.integrators.event_driven.motion import Flight, Watch, copy_flight, has_blocks, move, move_particles
from femimpact.integrators.event_driven.reading import (
    Grid,
    Snapshots,
    add_peaks,
    add_to_cycle,
    keep_snapshot,
    value_now,
)
from femimpact.integrators.event_driven.search import END, STUCK, Search, next_event
from femimpact.integrators.event_driven.states import (
    ENTERED,
    ENTERING,
    FITTING,
    STARTED,
    STARTING,
    Bounds,
    Case,
    Cases,
    Forms,
    Pairs,
    Place,
    enter_form,
    find_form,
    is_active,
    place_of,
    read_coordinates,
    set_bounds,
    set_steady_motion,
    set_walls,
    turn_knot,
    watch_of,
)
from femimpact.integrators.event_driven.touching import Tables, add_contact
from femimpact.integrators.event_driven.transition import (
    FIT,
    RELEASE_ALL,
    STAY,
    UNRESOLVED,
    apply_event,
    collide,
    set_start_states,
)
from femimpact.integrators.kernels.compiling import apart, called, compiled, inlined

__all__ = ["DONE", "FORM_WANTED", "RESONANT", "UNENDING", "Contacts", "Scratch", "run_cases"]

DONE, FORM_WANTED, RESONANT, UNENDING = range(4)
"""What a case stopped for: its end, a closed form not met before, a steady motion that is unbounded, or events that
do not end."""

EVENTS_AT_ONCE = 200
"""Events at one instant beyond which the motion is called unresolved."""

LEAST_ADVANCE = 1e-6
"""Of the time between two samples: what the search for a peak advances at least."""


class Contacts(NamedTuple):
    """Contacts that have not ended, and sums over the impacts of a window of each case."""

    touch: NDArray[Any]  # (C, 6, R): see ledger.BEGUN
    to_modes: NDArray[Any]  # (C, R, n) J, what open contacts have given to each mode
    window: NDArray[Any]  # (C, 2) s
    totals: NDArray[Any]  # (C, 6, R); see layout.TOTAL_COLUMNS


class Scratch(NamedTuple):
    """Working space of one thread."""

    flight: Flight
    trial: Flight
    mark: Flight
    spare: Flight
    crest: Flight
    search: Search
    bounds: Bounds
    products: Products
    turn: NDArray[Any]  # (2, K + 1) complex
    impulse: NDArray[Any]  # (R,)


@inlined
def _enter(
    c: int, pairs: Pairs, case: Case, cases: Cases, forms: Forms, s: Scratch, contacts: Contacts, b: Ledger | None
) -> int:  # fmt: skip
    """Take the coordinates of a case into the closed form of its contact states."""
    if cases.entering[c] == STARTING:
        set_start_states(pairs, case, cases.coordinates[c], s.flight, contacts.touch[c], contacts.to_modes[c])
        cases.entering[c] = STARTED
    f = find_form(case.state, cases.form[c, 0], forms.made, forms.key, forms.following)
    if f < 0:
        return FORM_WANTED
    n = forms.number[f]
    if not cases.known[c, n]:
        fine = True
        if case.omega != 0.0:
            fine = set_steady_motion(
                f, case.omega, case.amplitude, forms, s.bounds.steady, cases.sine[c, n], cases.harmonic[c, n],
                cases.particle_sine[c, n],
            )  # fmt: skip
        if not fine:
            return RESONANT
        cases.known[c, n] = True
    cases.form[c, 1] = f
    set_walls(
        case.state, case.gap, forms.constant[f], forms.static[f], forms.particle_given[f], forms.particles[f], s.bounds
    )
    place = place_of(f, case.omega, forms, cases.harmonic[c, n], s.bounds)
    state, before, after = cases.coordinates[c], s.products.before, s.products.after
    if b is not None and cases.entering[c] == STARTED:
        write_energy(c, pairs, case, s.flight, state, b, b.start[c])
    for i in range(before.shape[1]):
        before[1, i] = state[1, i]
    enter_form(place, forms.entries[f], forms.to_entry_u[f], forms.to_entry_v[f], forms.to_particle[f], state, s.flight)
    if b is not None and cases.entering[c] == FITTING:
        read_coordinates(place, s.flight, after)
        for i in range(b.mass.size):
            b.contact_loss[c] += 0.5 * b.mass[i] * (before[1, i] ** 2 - after[1, i] ** 2)
    cases.entering[c] = ENTERED
    return DONE


@inlined
def _add_to_ledger(
    c: int, f: int, watch: Watch, place: Place, pairs: Pairs, case: Case, cases: Cases, forms: Forms, s: Scratch,
    contacts: Contacts, b: Ledger,
) -> None:  # fmt: skip
    add_to_ledger(
        c, watch, place, forms.together[f], cases.particle_sine[c, forms.number[f]], forms.particle_given[f], pairs,
        case, s.mark, s.flight, s.spare, contacts.touch[c], contacts.to_modes[c], s.products, b,
    )  # fmt: skip


@apart
def _read(
    c: int, f: int, first: int, until: float, event: bool, watch: Watch, place: Place, pairs: Pairs, case: Case,
    cases: Cases, forms: Forms, s: Scratch, grid: Grid, shots: Snapshots, contacts: Contacts, b: Ledger | None,
) -> None:  # fmt: skip
    """Read the motion at every grid time up to an instant; `s.flight` is left at the last of them.

    What falls on an event is read after it.
    """
    dt, started, phase, active = grid.interval[c], False, complex(1.0, 0.0), 0
    alone, events, flight = not has_blocks(watch), watch.lasting.size, s.flight
    turn = complex(math.cos(watch.omega * dt), math.sin(watch.omega * dt))
    while True:
        sample = cases.sample[c] + 1
        i, time = sample - first - 1, sample * dt
        if time > until or (event and time == until):
            break
        if started and alone:
            for k in range(active):
                flight.entry[k] *= s.turn[0, k]
            move_particles(watch, flight, time - flight.clock[0])
            phase *= turn
        else:
            move(watch, flight, time - flight.clock[0])
            theta = watch.omega * time + flight.clock[1]
            started, phase = True, complex(math.cos(theta), math.sin(theta))
            for k in range(watch.exponent.size):
                if flight.entry[k] != 0.0:
                    active, s.turn[0, k] = k + 1, cmath.exp(watch.exponent[k] * dt)
        flight.clock[0] = time
        for o in range(grid.values.shape[2]):
            value = value_now(events + o, active, phase, watch, flight)
            if o == 0:
                number = (sample - 1 - grid.origin[c]) // grid.per_cycle
                add_to_cycle(number, value, phase, grid.cycles[c])
            if i < grid.values.shape[1]:
                grid.values[c, i, o] = value
        if b is not None and grid.energy.shape[1] > 0 and grid.kept[i] >= 0:
            _add_to_ledger(c, f, watch, place, pairs, case, cases, forms, s, contacts, b)
            write_energy(c, pairs, case, flight, s.products.after, b, grid.energy[c, grid.kept[i]])
        if shots.shown.size > 0 and shots.shown[i] >= 0:
            keep_snapshot(shots.shown[i], place, pairs, case, flight, s.products.after, shots)
        cases.sample[c] = sample


@called
def _run_case(
    c: int, first: int, until: float, most: float, pairs: Pairs, case: Case, cases: Cases, forms: Forms, s: Scratch,
    grid: Grid, shots: Snapshots, contacts: Contacts, tables: Tables, b: Ledger | None,
) -> int:  # fmt: skip
    """Take one case to a time, or to where it stops."""
    walls, flight = True, s.flight
    touch, to_modes, totals = contacts.touch[c], contacts.to_modes[c], contacts.totals[c]
    while True:
        if cases.entering[c] != ENTERED:
            status = _enter(c, pairs, case, cases, forms, s, contacts, b)
            if status != DONE:
                return status
            walls = False
        f = cases.form[c, 1]
        n = forms.number[f]
        if walls:
            set_walls(
                case.state, case.gap, forms.constant[f], forms.static[f], forms.particle_given[f], forms.particles[f],
                s.bounds,
            )  # fmt: skip
        set_bounds(case.state, case.gap, s.bounds)
        watch = watch_of(f, case.omega, forms, cases.sine[c, n], s.bounds)
        place = place_of(f, case.omega, forms, cases.harmonic[c, n], s.bounds)
        copy_flight(flight, s.mark)
        walls = False
        hit, effect = cases.hit[c], STAY
        if hit == 0.0:
            knot, index = math.inf, 0
            if watch.broken:
                index = math.floor(flight.clock[0] / cases.knot_interval + 1e-9) + 1
                if index < cases.knots.size:
                    knot = index * cases.knot_interval
            copy_flight(flight, s.trial)
            status = next_event(watch, s.trial, min(until, knot), s.search)
            reached = s.trial.clock[0]
            if reached > flight.clock[0]:
                cases.events[c, 1] = 0
                counted = contacts.window[c, 0] <= flight.clock[0] < contacts.window[c, 1]
                for j in range(case.state.size):
                    if is_active(case.state[j]):
                        add_contact(
                            case.state.size + j, case.state[j], pairs.rigid[j], counted, watch, flight,
                            reached - flight.clock[0], s.spare, s.turn, s.search, touch, totals,
                        )  # fmt: skip
            if grid.cycle[c] < grid.cycles.shape[1]:
                length = grid.per_cycle * grid.interval[c]
                grid.cycle[c] = add_peaks(
                    grid.cycle[c], grid.origin[c] * grid.interval[c], length, reached,
                    LEAST_ADVANCE * grid.interval[c], watch, flight, s.spare, s.crest, s.search, grid.cycles[c],
                )  # fmt: skip
            _read(
                c,
                f,
                first,
                reached,
                status != END,
                watch,
                place,
                pairs,
                case,
                cases,
                forms,
                s,
                grid,
                shots,
                contacts,
                b,
            )
            copy_flight(s.trial, flight)
            if b is not None and (b.everywhere or any_compliant(case.state, pairs.rigid)):
                _add_to_ledger(c, f, watch, place, pairs, case, cases, forms, s, contacts, b)
            if status == END:
                if reached >= knot:
                    turn_knot(
                        index, cases.knots, cases.knot_interval, forms.entries[f], forms.position_follow[f],
                        forms.to_entry_u[f], forms.to_entry_v[f], flight,
                    )  # fmt: skip
                if reached >= until:
                    return DONE
                continue
            cases.events[c, 0] += 1
            cases.events[c, 1] += 1
            if status == STUCK or cases.events[c, 1] > EVENTS_AT_ONCE or cases.events[c, 0] > most:
                return UNENDING
        time = flight.clock[0]
        counted = contacts.window[c, 0] <= time < contacts.window[c, 1]
        if hit == 0.0:
            pair, side = int(s.search.event[0]), s.search.event[1]
            free = pair < case.state.size and abs(case.state[pair]) == 0.0
            effect = apply_event(
                status,
                counted,
                watch,
                pairs,
                case,
                flight,
                s.search,
                cases.released[c],
                touch,
                to_modes,
                totals,
                tables,
            )
            if effect == RELEASE_ALL or (effect == STAY and free):
                hit = side * (pair + 1)
        if hit != 0.0 and effect != RELEASE_ALL:
            effect = collide(
                c, int(abs(hit)) - 1, 1.0 if hit > 0.0 else -1.0, counted, watch, place, pairs, case, flight, s.search,
                cases.released[c], s.impulse, forms.impulse_entry[f], forms.impulse_particle[f], s.products.after,
                touch, to_modes, totals, tables, b,
            )  # fmt: skip
            hit = 0.0
        cases.hit[c] = hit
        if effect == UNRESOLVED:
            return UNENDING
        if effect == STAY:
            walls = True
        else:
            read_coordinates(place, flight, cases.coordinates[c])
            cases.entering[c] = FITTING if effect == FIT else ENTERING


@compiled
def run_cases(
    members: NDArray[Any], begin: NDArray[Any], end: NDArray[Any], most: NDArray[Any], stopped: NDArray[Any],
    pairs: Pairs, cases: Cases, forms: Forms, s: Scratch, grid: Grid, shots: Snapshots, contacts: Contacts,
    tables: Tables, b: Ledger | None,
) -> None:  # fmt: skip
    """Take some cases from where they are to their sample `end`, reading those after `begin`.

    `most` (C,) are the events allowed in all; `stopped` (C,) gets what each one stopped for.
    """
    for i in range(members.size):
        c = members[i]
        home = Flight(
            cases.entry[c], cases.particle[c, 0], cases.particle[c, 1], cases.clock[c], cases.drive[c], s.flight.term
        )
        case = Case(
            cases.omega[c], cases.amplitude[c], cases.gap[c], cases.stiffness[c], cases.damping[c],
            cases.restitution[c], cases.state[c],
        )  # fmt: skip
        copy_flight(home, s.flight)
        for r in range(s.search.leaving.size):
            s.search.leaving[r] = cases.leaving[c, r]
        # nothing is read before
        cases.sample[c] = max(cases.sample[c], begin[c])
        time = end[c] * grid.interval[c]
        stopped[c] = _run_case(
            c, begin[c], time, most[c], pairs, case, cases, forms, s, grid, shots, contacts, tables, b
        )
        copy_flight(s.flight, home)
        for r in range(s.search.leaving.size):
            cases.leaving[c, r] = s.search.leaving[r]
