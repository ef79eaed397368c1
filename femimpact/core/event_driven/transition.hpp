// What an event does: an impulse where rigid bodies collide, a change of contact state everywhere else.
#pragma once

#include "contact_phases.hpp"
#include "search.hpp"

namespace FEMIMPACT_TARGET {

// After an event: the closed form stays; another one is entered; rigid impacts follow in this form; another one is
// entered, and the impacts follow there; or impacts at one instant do not end.
enum : Index { STAY, ENTER, COLLIDE, RELEASE_ALL, UNRESOLVED };

// Most collisions that one instant may take among several pairs.
constexpr Index COLLISIONS_AT_ONCE = 100'000;

// Share of its mobility below which pairs that stick leave a pair no motion against its wall.
constexpr double UNMOVED = 1e-9;

// Share of an impact's speed that rounding may leave of none where it does not reach.
constexpr double ROUNDING_SHARE = 1e-12;

// Sets the contact states of the coordinates that a case starts from.
[[gnu::noinline]] inline void set_start_states(const Pairs &pairs, const Case &c, const Motion &motion) {
    auto [base, base_rate] = base_motion(c, motion);
    const double sides[] = {1.0, -1.0};
    for (Index j = 0; j < c.state.size(); j++) {
        c.state(j) = FREE;
        double x = gap_of(j, pairs, c.coordinates.row(0), base);
        double rate = gap_of(j, pairs, c.coordinates.row(1), base_rate);
        for (double side : sides) {
            double depth = side * x - gap_on(side, j, c);
            if (depth > 0.0 && !pairs.rigid(j)) {
                bool pushes = c.stiffness(j) * depth + c.damping(j) * side * rate > 0.0;
                c.state(j) = side * (pushes ? CONTACT : SEPARATING);
                begin_contact(j, motion.clock(0), larger(side * rate, 0.0), c);
            }
        }
    }
}

// Time (s) that the bounces to come take if none rises above the closure, else -1.
//
// Under a pressing acceleration a they last 2 v/(a (1 - e)) and stay below v^2/(2 a).
[[gnu::noinline]] inline double bounces_left(Index j, double side, double rebound, const Scalars &scalars,
                                             const Pairs &pairs, const Case &c, const Space &space) {
    const Search &search = space.search;
    double e = c.restitution(j);
    // of the moment: the bounces rise no higher than the closure
    measure(scalars, space.motion, 0.0, search);
    derivatives(j, scalars, space.motion, unit_phase(scalars.omega, space.motion.clock), 0.0, search);
    double press = side * search.found(SECOND), steepest = search.found(THIRD_SIZE);
    if (press <= 1e-12 * search.found(SECOND_SIZE) || rebound * rebound > 2.0 * press * pairs.closure)
        return -1.0;
    double lasting = e < 1.0 ? 2.0 * larger(rebound, 0.0) / (press * (1.0 - e)) : 2.0 * rebound / press;
    // and the press must last until the bounces are over
    return steepest * lasting <= 0.5 * press ? lasting : -1.0;
}

// Writes one collision into the table; the velocities are those before it, and then those after it.
[[gnu::noinline]] inline void write_impact(Index r, double side, double approach, double rebound, double push,
                                           const Pairs &pairs, const Space &space, const Tables &tables,
                                           const Ledger *b) {
    Array velocity = space.products.after.row(1);
    Index row = tables.number(0);
    tables.number(0) = row + 1;
    space.row(r) = row;
    if (row < tables.impacts.shape[0]) {
        Array out = tables.impacts.row(row);
        out(IMPACT_TIME) = space.motion.clock(0);
        out(IMPACT_PAIR) = double(r);
        out(IMPACT_SIDE) = side;
        out(IMPACT_APPROACH_SPEED) = approach;
        out(IMPACT_REBOUND_SPEED) = rebound;
        // an impulse has no largest force and no duration
        out(IMPACT_IMPULSE) = push;
        out(IMPACT_PEAK_FORCE) = NOT_A_NUMBER;
        out(IMPACT_DURATION) = 0.0;
        out(IMPACT_ENERGY_LOSS) = 0.5 * push * (approach - rebound);
    }
    if (!b)
        return;
    for (Index i = 0; i < b->loss_of_mode.shape[1]; i++) {
        double momentum = pairs.direction(r, i) * side * push;
        if (row < tables.impacts.shape[0])
            tables.impacts(row, IMPACT_COLUMNS + i) = momentum * (velocity(i) + 0.5 * momentum / b->mass(i));
        velocity(i) += momentum / b->mass(i);
    }
}

// Changes the motion by the impulses of all pairs.
[[gnu::noinline]] inline void add_impulses(const Form &form, const Space &space) {
    for (Index r = 0; r < space.impulse.size(); r++) {
        if (space.impulse(r) == 0.0)
            continue;
        for (Index k = 0; k < form.scalars.exponent.size(); k++)
            space.motion.entry(k) += form.impulse_entry(k, r) * space.impulse(r);
        for (Index p = 0; p < form.shapes.rigid_bodies; p++)
            space.motion.rigid_body_rate(p) += form.impulse_rigid_body(p, r) * space.impulse(r);
    }
}

// Makes compliant contacts push that an impulse elsewhere presses, and others separate; whether any has changed.
[[gnu::noinline]] inline bool change_contacts(const Scalars &scalars, const Pairs &pairs, const Case &c,
                                              const Motion &motion) {
    bool changed = false;
    Complex phase = unit_phase(scalars.omega, motion.clock);
    for (Index j = 0; j < c.state.size(); j++) {
        if (pairs.rigid(j) || c.state(j) == FREE)
            continue;
        double side = side_of(c.state(j));
        bool pushes = side * value_now(c.state.size() + j, scalars.exponent.size(), phase, scalars, motion) > 0.0;
        if (is_active(c.state(j)) != pushes) {
            c.state(j) = side * (pushes ? CONTACT : SEPARATING);
            changed = true;
        }
    }
    return changed;
}

// Lets all pairs go that stick.
[[gnu::always_inline]] inline void release_all(double time, const Pairs &pairs, const Case &c, const Tables &tables) {
    for (Index i = 0; i < c.state.size(); i++)
        if (pairs.rigid(i) && is_active(c.state(i))) {
            c.released(i) = side_of(c.state(i));
            end_sticking(i, time, c, tables);
            c.state(i) = FREE;
        }
}

// Whether pairs that stick take up an impulse elsewhere: none rebounds, or is left behind, above the closure.
[[gnu::noinline]] inline bool stay_in_place(Index j, double side, double push, const Form &form, const Pairs &pairs,
                                            const Case &c, const Motion &motion) {
    const Scalars &scalars = form.scalars;
    Complex phase = unit_phase(scalars.omega, motion.clock);
    double slow = ROUNDING_SHARE * push * -pairs.mobility(j, j);
    for (Index i = 0; i < c.state.size(); i++) {
        if (form.reaction(i, j) == 0.0)
            continue;
        double side_of_wall = side_of(c.state(i)), felt = -pairs.mobility(i, i);
        double share = side_of_wall * form.reaction(i, j) * side * push;
        double speed = felt * (share > 0.0 ? c.restitution(i) * share : -share);
        double force = value_now(c.state.size() + i, scalars.exponent.size(), phase, scalars, motion);
        double press = felt * side_of_wall * force;
        if (speed > slow && speed * speed > 2.0 * larger(press, 0.0) * pairs.closure)
            return false;
    }
    return true;
}

// Stops a pair at its wall; the impulses of those that stick belong to their sticking phases.
[[gnu::noinline]] inline void push_in_place(Index j, double side, double approach, double push, bool real,
                                            const Form &form, const Pairs &pairs, const Case &c, const Space &space,
                                            const Tables &tables, const Ledger *b) {
    double time = space.motion.clock(0);
    Array impulse = space.impulse, velocity = space.products.after.row(1);
    read_coordinates(form.shapes, space.motion, space.products.after);
    double base_rate = base_motion(c, space.motion).rate;
    for (Index i = 0; i < impulse.size(); i++) {
        double share = form.reaction(i, j) * side * push;
        impulse(i) = i == j ? side * push : 0.0;
        if (b) {
            add_work_of_base(-((share + impulse(i)) * pairs.in_space(i) * base_rate), c, *b);
            // an impulse works at the mean of the velocities before and after
            for (Index k = 0; k < velocity.size(); k++)
                velocity(k) += 0.5 * pairs.direction(i, k) * share / b->mass(k);
        }
        if (share != 0.0) {
            double pushed = side_of(c.state(i)) * share;
            c.touch(PUSHED, i) += pushed;
            add_impulse(i, time, pushed, c);
        }
    }
    if (real) {
        count_impact(j, time, approach, push, c);
        write_impact(j, side, approach, 0.0, push, pairs, space, tables, b);
    }
    add_impulse(j, time, push, c);
    if (b)
        b->contact_loss(c.number) += 0.5 * push * approach;
    add_impulses(form, space);
}

// Makes a rigid impact without rebound, of pairs that stick and one that meets its wall: STAY or ENTER.
//
// COLLIDE where none sticks; RELEASE_ALL where a pair rebounds, or is left by its wall: an impact elsewhere passes
// through sticking pairs as a separate impact.
[[gnu::noinline]] inline Index beside_sticking(Index j, double side, const Form &form, const Pairs &pairs,
                                               const Case &c, const Space &space, const Tables &tables,
                                               const Ledger *b) {
    const Search &search = space.search;
    const Scalars &scalars = form.scalars;
    double time = space.motion.clock(0), mobility = 0.0;
    bool sticking = false;
    for (Index i = 0; i < c.state.size(); i++) {
        sticking = sticking || (pairs.rigid(i) && is_active(c.state(i)));
        mobility += pairs.mobility(j, i) * (i == j ? 1.0 : form.reaction(i, j));
    }
    if (!sticking)
        return COLLIDE;
    double approach = side * search.rate(j), lasting = 0.0;
    // a wall that those in place leave no motion against cannot push
    double push = mobility < UNMOVED * pairs.mobility(j, j) ? approach / -mobility : 0.0;
    // a speed that rounding has left, as where equal parts at rest were turned into modes, is no impact
    bool real = approach > search.negligible(0);
    if (real) {
        // what presses it there is decided with the sticking pairs in place: without their forces it may seem to leave
        lasting = bounces_left(j, side, c.restitution(j) * approach, scalars, pairs, c, space);
        bool caught = lasting >= 0.0 || c.restitution(j) == 0.0;
        if (push == 0.0 || !caught || !stay_in_place(j, side, push, form, pairs, c, space.motion)) {
            release_all(time, pairs, c, tables);
            return RELEASE_ALL;
        }
    }
    push_in_place(j, side, approach, push, real, form, pairs, c, space, tables, b);
    bool changed = change_contacts(scalars, pairs, c, space.motion);
    search.leaving(j) = 0.0;
    if (lasting >= 0.0) {
        c.state(j) = side * CONTACT;
        begin_contact(j, time + lasting, 0.0, c);
    }
    return changed || lasting >= 0.0 ? ENTER : STAY;
}

// Changes contact states by the event that the search has found: STAY, ENTER, COLLIDE or RELEASE_ALL.
//
// With `collide` the one place for what an event does to a motion, and so for its linearisation.
[[gnu::noinline]] inline Index apply_event(Index status, const Form &form, const Pairs &pairs, const Case &c,
                                           const Space &space, const Tables &tables, const Ledger *b) {
    const Search &search = space.search;
    Index r = Index(search.event(0)), count = c.state.size(), j = r % count;
    double time = space.motion.clock(0), side = search.event(1), state = c.state(j), side_of_wall = side_of(state);
    if (r >= count) {
        if (magnitude(state) == SEPARATING) {
            c.state(j) = side_of_wall * CONTACT;
        } else if (pairs.rigid(j)) {
            end_sticking(j, time, c, tables);
            c.state(j) = FREE;
            search.leaving(j) = side_of_wall;
        } else {
            c.state(j) = side_of_wall * SEPARATING;
        }
        return ENTER;
    }
    if (magnitude(state) == SEPARATING) {
        end_contact(j, -side_of_wall * search.rate(r), time, c, tables);
        c.state(j) = FREE;
        return STAY;
    }
    if (pairs.rigid(j) && status != REST)
        return beside_sticking(j, side, form, pairs, c, space, tables, b);
    c.state(j) = side * CONTACT;
    begin_contact(j, time, larger(side * search.rate(r), 0.0), c);
    search.leaving(j) = 0.0;
    // what began at rest does not end by the rounding of its rate
    if (status == REST && !pairs.rigid(j))
        search.leaving(count + j) = -side;
    return ENTER;
}

// Finds which rigid pairs are at their walls, and their rates.
[[gnu::noinline]] inline void find_pairs_at_walls(Index first, double side, const Scalars &scalars, const Pairs &pairs,
                                                  const Case &c, const Space &space) {
    const Search &search = space.search;
    Complex phase = unit_phase(scalars.omega, space.motion.clock);
    measure(scalars, space.motion, 0.0, search);
    for (Index r = 0; r < c.state.size(); r++) {
        search.at_wall(r) = 0.0;
        if (!pairs.rigid(r))
            continue;
        safe_advance(r, scalars, space.motion, scalars.size.size(), phase, 1.0, search);
        if (c.released(r) != 0.0) {
            search.at_wall(r) = c.released(r);
            c.released(r) = 0.0;
        }
    }
    search.at_wall(first) = side;
}

// First pair that has just collided and bounces no higher than the closure, -1 for none.
//
// `search.event[0]` gets the end (s) of its bounces.
[[gnu::always_inline]] inline Index caught_pair(const Scalars &scalars, const Pairs &pairs, const Case &c,
                                                const Space &space) {
    const Search &search = space.search;
    for (Index r = 0; r < space.impulse.size(); r++) {
        if (space.impulse(r) == 0.0)
            continue;
        double side = search.at_wall(r);
        double lasting = bounces_left(r, side, -side * search.rate(r), scalars, pairs, c, space);
        if (lasting >= 0.0) {
            search.event(0) = space.motion.clock(0) + lasting;
            return r;
        }
    }
    return -1;
}

// Takes its rebound from a pair; the impulse becomes the one that does it.
[[gnu::noinline]] inline void capture(Index r, const Form &form, const Pairs &pairs, const Case &c, const Space &space,
                                      const Tables &tables, const Ledger *b) {
    const Search &search = space.search;
    Array impulse = space.impulse;
    double rebound = -search.at_wall(r) * search.rate(r);
    for (Index i = 0; i < impulse.size(); i++)
        impulse(i) = 0.0;
    double back = rebound / -pairs.mobility(r, r);
    impulse(r) = -search.at_wall(r) * back;
    add_impulses(form, space);
    // the last impact of a pair that sticks ends without rebound, be it in the table or not
    Index row = space.row(r);
    if (row < tables.impacts.shape[0]) {
        tables.impacts(row, IMPACT_REBOUND_SPEED) = 0.0;
        tables.impacts(row, IMPACT_IMPULSE) -= back;
        tables.impacts(row, IMPACT_ENERGY_LOSS) += 0.5 * back * rebound;
        Array velocity = space.products.after.row(1);
        for (Index i = 0; b && i < b->loss_of_mode.shape[1]; i++) {
            double momentum = pairs.direction(r, i) * impulse(r);
            tables.impacts(row, IMPACT_COLUMNS + i) += momentum * (velocity(i) + 0.5 * momentum / b->mass(i));
        }
    }
    correct_impulse(r, space.motion.clock(0), -back, c);
    search.leaving(r) = 0.0;
}

// Makes rigid impacts at this instant: STAY or ENTER, or UNRESOLVED where they do not end.
//
// The rule for simultaneous impacts: one after another at the same instant, the fastest first, each with its
// restitution, until no pair at its wall approaches it. For e = 1 and equal masses in a row it is Newton's cradle.
[[gnu::noinline]] inline Index collide(Index first, double side, const Form &form, const Pairs &pairs, const Case &c,
                                       const Space &space, const Tables &tables, const Ledger *b) {
    const Scalars &scalars = form.scalars;
    const Search &search = space.search;
    Array impulse = space.impulse;
    double time = space.motion.clock(0);
    find_pairs_at_walls(first, side, scalars, pairs, c, space);
    read_coordinates(form.shapes, space.motion, space.products.after);
    double base_rate = base_motion(c, space.motion).rate, largest = 0.0;
    bool again = true;
    for (Index r = 0; r < impulse.size(); r++) {
        impulse(r) = 0.0;
        largest = larger(largest, search.at_wall(r) * search.rate(r));
    }
    for (Index collision = 0; collision < COLLISIONS_AT_ONCE; collision++) {
        // what is left of the approach after so many collisions is rounding
        double fastest = 1e-14 * largest;
        Index hit = -1;
        for (Index r = 0; r < impulse.size(); r++)
            if (search.at_wall(r) * search.rate(r) > fastest) {
                fastest = search.at_wall(r) * search.rate(r);
                hit = r;
            }
        if (hit < 0) {
            again = false;
            break;
        }
        double wall = search.at_wall(hit), e = c.restitution(hit);
        double push = (1.0 + e) * fastest / -pairs.mobility(hit, hit);
        count_impact(hit, time, fastest, push, c);
        add_impulse(hit, time, push, c);
        write_impact(hit, wall, fastest, e * fastest, push, pairs, space, tables, b);
        if (b) {
            b->contact_loss(c.number) += 0.5 * push * (1.0 - e) * fastest;
            add_work_of_base(-(wall * push * pairs.in_space(hit) * base_rate), c, *b);
        }
        impulse(hit) += wall * push;
        search.leaving(hit) = 0.0;
        for (Index r = 0; r < impulse.size(); r++)
            search.rate(r) += pairs.mobility(r, hit) * wall * push;
    }
    if (again)
        return UNRESOLVED;
    add_impulses(form, space);
    Index caught = caught_pair(scalars, pairs, c, space);
    if (caught >= 0) {
        capture(caught, form, pairs, c, space, tables, b);
        double wall = search.at_wall(caught), rebound = -search.at_wall(caught) * search.rate(caught);
        if (b) {
            b->contact_loss(c.number) -= 0.5 * wall * impulse(caught) * rebound;
            add_work_of_base(-(impulse(caught) * pairs.in_space(caught) * base_rate), c, *b);
        }
        c.state(caught) = wall * CONTACT;
        begin_contact(caught, search.event(0), 0.0, c);
    }
    bool changed = change_contacts(scalars, pairs, c, space.motion);
    return changed || caught >= 0 ? ENTER : STAY;
}

// What an event has done to its pair, by the contact states before and after it and the impacts that ended with it.
//
// A rigid pair that touches has met its wall at a speed that rounding has left.
[[gnu::always_inline]] inline Index kind_of_event(double before, double after, bool rigid, Index impacts) {
    if (before == FREE) {
        if (!rigid || (impacts == 0 && after == FREE))
            return KIND_TOUCH;
        return after == FREE ? KIND_IMPACT : KIND_CAPTURE;
    }
    if (after == FREE)
        return rigid ? KIND_LET_GO : KIND_SEPARATE;
    return is_active(after) ? KIND_PRESS_AGAIN : KIND_RELEASE;
}

// Writes an event into the log, with contact states and coordinates just after it; `form` is the one before it.
[[gnu::noinline]] inline void write_event(Index j, double side, double before, Index impacts, const Form &form,
                                          const Pairs &pairs, const Case &c, const Space &space, const Tables &tables) {
    Index row = tables.logged(c.number), count = c.state.size(), d = c.coordinates.shape[1];
    tables.logged(c.number) = row + 1;
    if (row >= tables.events.shape[1])
        return;
    Array out = tables.events.row(c.number, row);
    out(EVENT_TIME) = space.motion.clock(0);
    out(EVENT_KIND) = double(kind_of_event(before, c.state(j), pairs.rigid(j), impacts));
    out(EVENT_PAIR) = double(j);
    out(EVENT_SIDE) = before == FREE ? side : side_of(before);
    out(EVENT_IMPACTS) = double(impacts);
    for (Index i = 0; i < count; i++)
        out(EVENT_COLUMNS + i) = c.state(i);
    read_coordinates(form.shapes, space.motion, {out.part(EVENT_COLUMNS + count, out.size()).data, {2, d}});
}

} // namespace FEMIMPACT_TARGET
