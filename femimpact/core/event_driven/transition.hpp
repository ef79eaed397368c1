// What an event does: an impulse where rigid bodies collide, a change of contact state everywhere else.
#pragma once

#include "contact_phases.hpp"
#include "search.hpp"

namespace FEMIMPACT_TARGET {

// After an event: the closed form stays; another one is entered; rigid impacts follow in this form; another one is
// entered, and the impacts follow there; or impacts at one instant do not end.
enum : Index { STAY, ENTER, COLLIDE, LET_GO, UNRESOLVED };

// Most collisions that one instant may take among several pairs.
constexpr Index COLLISIONS_AT_ONCE = 100'000;

// Times its rounding by which a pair may be short of its wall beside another that has met its own: equal parts differ
// by the rounding of their modes and of the impacts before.
constexpr double BESIDE = 64.0;

// Share of an impact's speed that rounding may leave of none where it does not reach.
constexpr double ROUNDING_SHARE = 1e-12;

// Share of an impact's speed that impulses may miss of what is asked of them.
constexpr double UNMET_SHARE = 1e-6;

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

// Restitution of an impact with this approach speed (m/s): a + b v^p of the last piece that begins below it, where the
// pieces of the pair, each with its first speed, a, b and p, say how it depends on the speed.
[[gnu::always_inline]] inline double restitution_of(Index j, double approach, const Case &c) {
    GivenArray pieces = c.over_speed.row(j);
    double restitution = c.restitution(j);
    for (Index k = 0; k < pieces.size() && pieces(k) <= approach; k += 4) {
        double power = pieces(k + 3) == 1.0 ? approach : __builtin_pow(approach, pieces(k + 3));
        restitution = pieces(k + 1) + (pieces(k + 2) != 0.0 ? pieces(k + 2) * power : 0.0);
    }
    return restitution;
}

// Time (s) that the bounces to come take if none rises above the closure, else -1.
//
// Under a pressing acceleration a they last 2 v/(a (1 - e)) and stay below v^2/(2 a).
[[gnu::noinline]] inline double bounces_left(Index j, double side, double rebound, const Scalars &scalars,
                                             const Pairs &pairs, const Case &c, const Space &space) {
    const Search &search = space.search;
    double e = restitution_of(j, larger(rebound, 0.0), c);
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

// Whether a pair sticks.
[[gnu::always_inline]] inline bool any_sticks(const Pairs &pairs, const Case &c) {
    bool found = false;
    for (Index j = 0; j < c.state.size(); j++)
        found = found || (pairs.rigid(j) && is_active(c.state(j)));
    return found;
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

// Changes contact states by the event that the search has found: STAY, ENTER or COLLIDE.
//
// With `collide` the one place for what an event does to a motion, and so for its linearisation.
[[gnu::noinline]] inline Index apply_event(Index status, const Pairs &pairs, const Case &c, const Space &space,
                                           const Tables &tables) {
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
        return COLLIDE;
    c.state(j) = side * CONTACT;
    begin_contact(j, time, larger(side * search.rate(r), 0.0), c);
    search.leaving(j) = 0.0;
    // what began at rest does not end by the rounding of its rate
    if (status == REST && !pairs.rigid(j))
        search.leaving(count + j) = -side;
    return ENTER;
}

// Finds which rigid pairs are at their walls, and their rates; returns the largest approach speed (m/s).
//
// A pair that sticks is at its wall at rest, and so is one that was let go at this instant.
[[gnu::noinline]] inline double find_pairs_at_walls(Index first, double side, const Scalars &scalars,
                                                    const Pairs &pairs, const Case &c, const Space &space) {
    const Search &search = space.search;
    Complex phase = unit_phase(scalars.omega, space.motion.clock);
    measure(scalars, space.motion, 0.0, search);
    double largest = 0.0;
    for (Index r = 0; r < c.state.size(); r++) {
        double &wall = search.at_wall(r) = 0.0;
        search.rate(r) = space.impulses.rounding(r) = 0.0;
        if (!pairs.rigid(r))
            continue;
        if (is_active(c.state(r)) || c.released(r) != 0.0) {
            wall = is_active(c.state(r)) ? side_of(c.state(r)) : c.released(r);
            c.released(r) = 0.0;
            continue;
        }
        clear_time(r, scalars, space.motion, scalars.size.size(), phase, 1.0, search);
        double value = search.found(VALUE), near = BESIDE * search.found(VALUE_ROUNDING);
        search.rate(r) = search.found(SLOPE);
        space.impulses.rounding(r) = search.found(SLOPE_ROUNDING);
        if (r == first)
            wall = side;
        else if (scalars.upper(r) - value <= near)
            wall = 1.0;
        else if (value - scalars.lower(r) <= near)
            wall = -1.0;
        largest = larger(largest, wall * search.rate(r));
    }
    return largest;
}

// Sets the approach speeds that impulses of the gathered pairs take away.
[[gnu::always_inline]] inline void set_mobility(Index n, const Pairs &pairs, const Space &space) {
    const Impulses &x = space.impulses;
    Array wall = space.search.at_wall;
    for (Index i = 0; i < n; i++)
        for (Index j = 0; j < n; j++)
            x.mobility(i, j) = -(wall(x.pair(i)) * wall(x.pair(j))) * pairs.mobility(x.pair(i), x.pair(j));
}

// Gathers the pairs that close or rest at their walls, with what their restitutions ask for; how many, 0 where none
// closes.
[[gnu::noinline]] inline Index gather_pairs(double largest, bool rebounds, const Pairs &pairs, const Case &c,
                                            const Space &space) {
    const Search &search = space.search;
    const Impulses &x = space.impulses;
    Index n = 0;
    bool closes = false;
    for (Index r = 0; r < c.state.size(); r++) {
        double approach = search.at_wall(r) * search.rate(r), rest = larger(x.rounding(r), ROUNDING_SHARE * largest);
        if (search.at_wall(r) == 0.0 || approach < -rest)
            continue;
        x.pair(n) = r;
        // what is no impact lets none go
        x.held(n) = !rebounds && is_active(c.state(r));
        x.approach(n) = approach > rest ? approach : 0.0;
        x.target(n) = (1.0 + (rebounds ? restitution_of(r, x.approach(n), c) : 0.0)) * x.approach(n);
        closes = closes || approach > rest;
        n++;
    }
    set_mobility(n, pairs, space);
    return closes ? n : 0;
}

// Solves for the impulses beside pairs that stick; whether some of these are left behind by their walls, and let go.
//
// What would fall back from below the closure stays.
[[gnu::noinline]] inline bool are_let_go(Index n, double largest, const Scalars &scalars, const Pairs &pairs,
                                         const Case &c, const Space &space, const Tables &tables) {
    const Impulses &x = space.impulses;
    Complex phase = unit_phase(scalars.omega, space.motion.clock);
    bool left = false;
    for (bool again = true; again;) {
        solve_impulses(x, n);
        again = left = false;
        for (Index i = 0; i < n; i++) {
            Index r = x.pair(i);
            x.trial(i) = 0.0;
            if (!is_active(c.state(r)) || x.held(i))
                continue;
            double speed = 0.0;
            for (Index j = 0; j < n; j++)
                speed += x.mobility(i, j) * x.impulse(j);
            double force = value_now(c.state.size() + r, scalars.exponent.size(), phase, scalars, space.motion);
            double press = x.mobility(i, i) * side_of(c.state(r)) * force;
            if (speed <= ROUNDING_SHARE * largest)
                continue;
            if (speed * speed > 2.0 * larger(press, 0.0) * pairs.closure) {
                x.trial(i) = 1.0;
                left = true;
            } else {
                x.held(i) = 1;
                again = true;
            }
        }
    }
    if (!left)
        return false;
    for (Index i = 0; i < n; i++)
        if (x.trial(i) != 0.0) {
            Index r = x.pair(i);
            c.released(r) = side_of(c.state(r));
            end_sticking(r, space.motion.clock(0), c, tables);
            c.state(r) = FREE;
        }
    return true;
}

// Sets the velocities amid impulses, at whose mean with those after them each works, and then those after them.
[[gnu::noinline]] inline void change_velocities(Index n, const Pairs &pairs, const Space &space, const Ledger &b) {
    const Impulses &x = space.impulses;
    Array velocity = space.products.after.row(1), middle = space.products.before.row(1);
    for (Index i = 0; i < b.loss_of_mode.shape[1]; i++) {
        double momentum = 0.0;
        for (Index k = 0; k < n; k++)
            momentum += pairs.direction(x.pair(k), i) * space.search.at_wall(x.pair(k)) * x.impulse(k);
        middle(i) = velocity(i) + 0.5 * momentum / b.mass(i);
        velocity(i) += momentum / b.mass(i);
    }
}

// Writes one collision into the table.
[[gnu::noinline]] inline void write_impact(Index k, double rebound, const Pairs &pairs, const Space &space,
                                           const Tables &tables, const Ledger *b) {
    const Impulses &x = space.impulses;
    Index r = x.pair(k), row = tables.number(0);
    double side = space.search.at_wall(r), push = x.impulse(k), approach = x.approach(k);
    tables.number(0) = row + 1;
    space.row(r) = row;
    if (row >= tables.impacts.shape[0])
        return;
    Array out = tables.impacts.row(row);
    out(IMPACT_TIME) = space.motion.clock(0);
    out(IMPACT_PAIR) = double(r);
    out(IMPACT_SIDE) = side;
    out(IMPACT_APPROACH_SPEED) = approach;
    out(IMPACT_REBOUND_SPEED) = rebound;
    out(IMPACT_IMPULSE) = push;
    // an impulse has no largest force and no duration
    out(IMPACT_PEAK_FORCE) = NOT_A_NUMBER;
    out(IMPACT_DURATION) = 0.0;
    out(IMPACT_ENERGY_LOSS) = 0.5 * push * (approach - rebound);
    for (Index i = 0; b && i < b->loss_of_mode.shape[1]; i++)
        out(IMPACT_COLUMNS + i) = pairs.direction(r, i) * side * push * space.products.before(1, i);
}

// Whether the impulses do what is asked of them: none do where walls leave a body no motion between them.
[[gnu::noinline]] inline bool are_met(Index n, double largest, const Impulses &x) {
    for (Index i = 0; i < n; i++) {
        double missing = x.target(i);
        for (Index j = 0; j < n; j++)
            missing -= x.mobility(i, j) * x.impulse(j);
        if (missing > UNMET_SHARE * largest)
            return false;
    }
    return true;
}

// Passes the impulses of n pairs on: to their rates, to what is added to the motion, to sums and tables.
//
// Those of pairs that stick belong to their sticking phases, and the motion has them without being told. What is not
// real is no impact.
[[gnu::noinline]] inline void pass_on(Index n, bool real, double slow, double base_rate, const Pairs &pairs,
                                      const Case &c, const Space &space, const Tables &tables, const Ledger *b) {
    const Search &search = space.search;
    const Impulses &x = space.impulses;
    double time = space.motion.clock(0);
    // what rests, and is reached by rounding only, is not hit
    for (Index k = 0; k < n; k++)
        if (x.approach(k) == 0.0 && magnitude(x.impulse(k)) * x.mobility(k, k) <= slow)
            x.impulse(k) = 0.0;
    if (b)
        change_velocities(n, pairs, space, *b);
    for (Index k = 0; k < n; k++) {
        Index hit = x.pair(k);
        double push = x.impulse(k), wall = search.at_wall(hit), approach = x.approach(k);
        if (push == 0.0)
            continue;
        if (b)
            add_work_of_base(-(wall * push * pairs.in_space(hit) * base_rate), c, *b);
        for (Index r = 0; r < c.state.size(); r++)
            search.rate(r) += pairs.mobility(r, hit) * wall * push;
        add_impulse(hit, time, push, c);
        if (is_active(c.state(hit))) {
            c.touch(PUSHED, hit) += push;
            continue;
        }
        double e = real ? restitution_of(hit, approach, c) : 0.0;
        if (real) {
            count_impact(hit, time, approach, push, c);
            write_impact(k, e * approach, pairs, space, tables, b);
        }
        if (b)
            b->contact_loss(c.number) += 0.5 * push * (1.0 - e) * approach;
        space.impulse(hit) += wall * push;
        // what stays at its wall has a rate of rounding, which is no impact again
        search.leaving(hit) = e * approach == 0.0 ? wall : 0.0;
    }
    for (Index r = 0; r < c.state.size(); r++)
        if (is_active(c.state(r)))
            search.rate(r) = 0.0;
}

// Captures the pairs that have just collided and bounce no higher than the closure: takes their rebounds away by
// impulses of all together. Whether there are any.
[[gnu::noinline]] inline bool capture(double base_rate, const Form &form, const Pairs &pairs, const Case &c,
                                      const Space &space, const Tables &tables, const Ledger *b) {
    const Search &search = space.search;
    const Impulses &x = space.impulses;
    Array impulse = space.impulse;
    double time = space.motion.clock(0);
    Index n = 0;
    bool caught = false;
    auto hold = [&](Index r) {
        x.pair(n) = r;
        x.held(n) = x.pushes(n) = 1;
        x.approach(n) = x.target(n) = search.at_wall(r) * search.rate(r);
        n++;
    };
    for (Index r = 0; r < c.state.size(); r++)
        if (pairs.rigid(r) && is_active(c.state(r)))
            hold(r);
    for (Index r = 0; r < c.state.size(); r++) {
        if (impulse(r) == 0.0)
            continue;
        double wall = search.at_wall(r);
        double lasting = bounces_left(r, wall, -wall * search.rate(r), form.scalars, pairs, c, space);
        if (lasting >= 0.0) {
            hold(r);
            set_mobility(n, pairs, space);
            // one that those held leave no motion stays with them
            if (factorise_pushing(0.0, x, n).independent < n) {
                n--;
                lasting = -1.0;
            }
        }
        if (lasting < 0.0) {
            impulse(r) = 0.0;
            continue;
        }
        c.state(r) = wall * CONTACT;
        begin_contact(r, time + lasting, 0.0, c);
        search.leaving(r) = 0.0;
        caught = true;
    }
    if (!caught)
        return false;
    set_mobility(n, pairs, space);
    solve_impulses(x, n);
    if (b)
        change_velocities(n, pairs, space, *b);
    for (Index k = 0; k < n; k++) {
        Index r = x.pair(k);
        double wall = search.at_wall(r), push = x.impulse(k), rebound = -x.approach(k);
        if (b)
            add_work_of_base(-(wall * push * pairs.in_space(r) * base_rate), c, *b);
        if (impulse(r) == 0.0) {
            c.touch(PUSHED, r) += push;
            add_impulse(r, time, push, c);
            continue;
        }
        impulse(r) = wall * push;
        correct_impulse(r, time, push, c);
        if (b)
            b->contact_loss(c.number) -= 0.5 * push * rebound;
        // the last impact of a pair that sticks ends without rebound, be it in the table or not
        Index row = space.row(r);
        if (row >= tables.impacts.shape[0])
            continue;
        tables.impacts(row, IMPACT_REBOUND_SPEED) = 0.0;
        tables.impacts(row, IMPACT_IMPULSE) += push;
        tables.impacts(row, IMPACT_ENERGY_LOSS) -= 0.5 * push * rebound;
        for (Index i = 0; b && i < b->loss_of_mode.shape[1]; i++)
            tables.impacts(row, IMPACT_COLUMNS + i) +=
                pairs.direction(r, i) * wall * push * space.products.before(1, i);
    }
    add_impulses(form, space);
    return true;
}

// Makes rigid impacts at this instant: STAY or ENTER, LET_GO where walls leave pairs that stick before the rest is
// made, or UNRESOLVED where they do not end.
//
// Moreau's rule for all pairs that close or rest at their walls, together: impulses p >= 0, u+ + e u- >= 0, one of
// both zero. What separates takes no part, and is looked at again afterwards.
[[gnu::noinline]] inline Index collide(Index first, double side, const Form &form, const Pairs &pairs, const Case &c,
                                       const Space &space, const Tables &tables, const Ledger *b) {
    const Scalars &scalars = form.scalars;
    double largest = find_pairs_at_walls(first, side, scalars, pairs, c, space);
    double base_rate = base_motion(c, space.motion).rate;
    bool sticking = any_sticks(pairs, c);
    // a speed that rounding has left, as where equal parts at rest were turned into modes, is no impact
    bool real = !sticking || largest > space.search.negligible(0);
    read_coordinates(form.shapes, space.motion, space.products.after);
    for (Index r = 0; r < c.state.size(); r++)
        space.impulse(r) = 0.0;
    Index collision = 0, n = 0;
    for (; collision < COLLISIONS_AT_ONCE; collision++) {
        n = gather_pairs(largest, real, pairs, c, space);
        if (n == 0)
            break;
        if (!sticking)
            solve_impulses(space.impulses, n);
        else if (are_let_go(n, largest, scalars, pairs, c, space, tables)) {
            add_impulses(form, space);
            return LET_GO;
        }
        if (!are_met(n, largest, space.impulses)) {
            // for the words of the refusal
            for (Index i = 0; i < n; i++)
                space.impulse(space.impulses.pair(i)) = 1.0;
            return UNRESOLVED;
        }
        pass_on(n, real, ROUNDING_SHARE * largest, base_rate, pairs, c, space, tables, b);
    }
    if (n > 0)
        return UNRESOLVED;
    add_impulses(form, space);
    bool caught = real && capture(base_rate, form, pairs, c, space, tables, b);
    bool changed = change_contacts(scalars, pairs, c, space.motion);
    return changed || caught ? ENTER : STAY;
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
