// Contacts that last: impulse and largest force, and the tables of impacts and sticking phases.
#pragma once

#include "ledger.hpp"
#include "reading.hpp"

namespace FEMIMPACT_TARGET {

// Sets the scratch motion to the present one at an instant from now on.
[[gnu::always_inline]] inline void set_motion_at(double time, const Scalars &scalars, const Space &space) {
    copy_motion(space.motion, space.scratch);
    if (time > space.scratch.clock(0)) {
        move(scalars, space.scratch, time - space.scratch.clock(0));
        space.scratch.clock(0) = time;
    }
}

[[gnu::always_inline]] inline double scalar_now(Index r, const Scalars &scalars, const Motion &motion) {
    return value_now(r, scalars.exponent.size(), unit_phase(scalars.omega, motion.clock), scalars, motion);
}

// Integral of a scalar where entries do not stand alone: by Gauss points; uses the motion up.
[[gnu::noinline]] inline double integral_over_points(Index r, double duration, const Scalars &scalars,
                                                     const Motion &motion) {
    double start = motion.clock(0), elapsed = 0.0, total = 0.0;
    while (elapsed < duration) {
        double panel = next_panel(elapsed, duration - elapsed, scalars, motion), half = 0.5 * panel;
        for (Index node = 0; node < GAUSS_POINTS; node++) {
            double time = start + elapsed + half * (1.0 + NODES[node]);
            move(scalars, motion, time - motion.clock(0));
            total += half * WEIGHTS[node] * scalar_now(r, scalars, motion);
        }
        elapsed += panel;
    }
    return total;
}

// Integral of a contact force between two instants, positive where the wall pushes.
[[gnu::noinline]] inline double impulse_between(Index j, double begin, double end, const Scalars &scalars,
                                                const Case &c, const Space &space) {
    Index r = c.state.size() + j;
    double side = side_of(c.state(j)), duration = end - begin;
    set_motion_at(begin, scalars, space);
    const Motion &motion = space.scratch;
    if (has_blocks(scalars) || scalars.driven > 0)
        return side * integral_over_points(r, duration, scalars, motion);
    double total = scalars.constant(r) * duration;
    if (scalars.degree >= 0) {
        auto [value, rate, bend, twist] = taylor(scalars, r, motion.drive);
        total += duration * (value + duration * (rate / 2.0 + duration * (bend / 6.0 + duration * twist / 24.0)));
        // the same from the fourth derivative on
        double later = 0.0;
        for (Index order = scalars.degree > 1 ? DRIVE - 1 : 0; order >= 4; order--) {
            double factor = INVERSE_FACTORIAL[order] / double(order + 1);
            later = derivative(scalars.follow, r, motion.drive, order) * factor + later * duration;
        }
        for (Index n = 0; n < 5; n++)
            later *= duration;
        total += later;
    } else {
        auto [cosine, sine] = cosine_and_sine(scalars.omega * duration);
        Complex integral = integral_of({0.0, scalars.omega}, {cosine, sine}, duration);
        total += (scalars.sine(r) * unit_phase(scalars.omega, motion.clock) * integral).real;
    }
    ComplexArray growth = scalars.growth;
    exponentials(scalars.exponent, duration, growth);
    for (Index k = 0; k < scalars.exponent.size(); k++) {
        Complex integral = integral_of(scalars.exponent(k), growth(k), duration);
        total += (scalars.weight(r, k) * motion.entry(k) * integral).real;
    }
    return side * total;
}

// Largest contact force between two instants, or what is known already where that is more.
[[gnu::noinline]] inline double largest_force(Index j, double begin, double end, double known, double least,
                                              const Scalars &scalars, const Case &c, const Space &space) {
    Index r = c.state.size() + j;
    double side = side_of(c.state(j));
    Array row = space.extremes;
    set_motion_at(end, scalars, space);
    double last = scalar_now(r, scalars, space.scratch);
    row(0) = larger(larger(side * known, last), 0.0);
    row(1) = smaller(smaller(side * known, last), 0.0);
    copy_motion(space.motion, space.scratch);
    follow_peak(r, side, begin, end, least, scalars, space, row);
    return side > 0.0 ? row(0) : -row(1);
}

// Adds impulse and largest force of one contact from the present motion on to an instant (s).
//
// What lies within the window is added to its sums: a contact that goes on across an end of it is cut there. `interval`
// (s) is that of two samples.
[[gnu::noinline]] inline void add_contact(Index j, double until, double interval, const Scalars &scalars, const Case &c,
                                          const Space &space) {
    const Matrix &touch = c.touch, &totals = c.totals;
    double start = space.motion.clock(0), opened = smaller(larger(c.window(0), start), until);
    const double parts[] = {start, opened, smaller(larger(c.window(1), opened), until), until};
    for (Index part = 0; part < 3; part++) {
        double begin = parts[part], end = parts[part + 1];
        bool inside = part == 1;
        if (end <= begin)
            continue;
        double impulse = impulse_between(j, begin, end, scalars, c, space);
        // this contact may have pushed more before the window, and another one more within it
        double known = touch(LARGEST_FORCE, j);
        if (inside)
            known = smaller(known, totals(PEAK_FORCE, j));
        double least = LEAST_ADVANCE * smaller(interval, end - begin);
        double largest = largest_force(j, begin, end, known, least, scalars, c, space);
        touch(PUSHED, j) += impulse;
        touch(LARGEST_FORCE, j) = larger(touch(LARGEST_FORCE, j), largest);
        if (inside) {
            totals(FORCE_TIME, j) += impulse;
            totals(PEAK_FORCE, j) = larger(totals(PEAK_FORCE, j), largest);
        }
    }
    touch(LASTED, j) += until - start;
}

// ---- tables -----------------------------------------------------------------------------------------

// Whether the sums of the window are open.
[[gnu::always_inline]] inline bool is_counted(double time, const Case &c) {
    return c.window(0) <= time && time < c.window(1);
}

// Adds the impulse of a contact to the sum of the window.
[[gnu::always_inline]] inline void add_impulse(Index j, double time, double impulse, const Case &c) {
    if (is_counted(time, c))
        c.totals(FORCE_TIME, j) += impulse;
}

// Begins a contact, or a sticking phase.
[[gnu::always_inline]] inline void begin_contact(Index j, double time, double approach, const Case &c) {
    c.touch(BEGUN, j) = time;
    c.touch(TOUCH_SPEED, j) = approach;
    c.touch(PUSHED, j) = c.touch(LARGEST_FORCE, j) = c.touch(LASTED, j) = c.touch(LOST, j) = 0.0;
    for (Index i = 0; i < c.to_modes.shape[1]; i++)
        c.to_modes(j, i) = 0.0;
}

// Adds an impact that ends now to the sums of its window.
[[gnu::always_inline]] inline void count_impact(Index j, double time, double approach, double impulse, const Case &c) {
    if (!is_counted(time, c))
        return;
    c.totals(COUNT, j) += 1.0;
    c.totals(APPROACH_SUM, j) += approach;
    c.totals(LARGEST_APPROACH, j) = larger(c.totals(LARGEST_APPROACH, j), approach);
    c.totals(IMPULSE_SUM, j) += impulse;
}

// Adds to the impulse of the impact that was counted last.
[[gnu::always_inline]] inline void correct_impulse(Index j, double time, double impulse, const Case &c) {
    add_impulse(j, time, impulse, c);
    if (is_counted(time, c))
        c.totals(IMPULSE_SUM, j) += impulse;
}

// Ends a compliant contact: an impact more.
[[gnu::noinline]] inline void end_contact(Index j, double rebound, double time, const Case &c, const Tables &tables) {
    const Matrix &touch = c.touch;
    double side = side_of(c.state(j));
    count_impact(j, time, touch(TOUCH_SPEED, j), touch(PUSHED, j), c);
    Index row = tables.number(0);
    if (row < tables.impacts.shape[0]) {
        Array out = tables.impacts.row(row);
        out(IMPACT_TIME) = touch(BEGUN, j);
        out(IMPACT_PAIR) = double(j);
        out(IMPACT_SIDE) = side;
        out(IMPACT_APPROACH_SPEED) = touch(TOUCH_SPEED, j);
        out(IMPACT_REBOUND_SPEED) = rebound;
        out(IMPACT_IMPULSE) = touch(PUSHED, j);
        out(IMPACT_PEAK_FORCE) = touch(LARGEST_FORCE, j);
        out(IMPACT_DURATION) = touch(LASTED, j);
        out(IMPACT_ENERGY_LOSS) = touch(LOST, j);
        for (Index i = 0; i < c.to_modes.shape[1]; i++)
            out(IMPACT_COLUMNS + i) = c.to_modes(j, i);
    }
    tables.number(0) = row + 1;
}

// Ends a sticking phase; one that begins as another of the same pair ends goes on with it.
[[gnu::noinline]] inline void end_sticking(Index j, double time, const Case &c, const Tables &tables) {
    double start = c.touch(BEGUN, j), impulse = c.touch(PUSHED, j), side = side_of(c.state(j));
    // it ends before its bounces would have: from its capture on
    if (start > time)
        start = time - c.touch(LASTED, j);
    Index row = tables.number(1);
    for (Index before = row - 1; before > larger(row - 1 - c.state.size(), Index(-1)); before--) {
        // a full table may hold the phase that goes on
        if (before >= tables.sticking.shape[0])
            continue;
        Array out = tables.sticking.row(before);
        if (out(STICKING_PAIR) == double(j) && out(STICKING_SIDE) == side && out(STICKING_END) >= start) {
            out(STICKING_END) = time;
            out(STICKING_IMPULSE) = out(STICKING_IMPULSE) + impulse;
            return;
        }
    }
    if (time > start || impulse != 0.0) {
        if (row < tables.sticking.shape[0]) {
            Array out = tables.sticking.row(row);
            out(STICKING_PAIR) = double(j);
            out(STICKING_SIDE) = side;
            out(STICKING_START) = start;
            out(STICKING_END) = time;
            out(STICKING_IMPULSE) = impulse;
        }
        tables.number(1) = row + 1;
    }
}

} // namespace FEMIMPACT_TARGET
