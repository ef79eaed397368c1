// Contacts that last: impulse and largest force, and the tables of impacts and sticking phases.
#pragma once

#include "ledger.hpp"

namespace FEMIMPACT_TARGET {

// Instants of a contact at which its force is looked at for the largest, which is then refined.
constexpr Index PROBES = 16;

constexpr Index NEWTON_STEPS_OF_FORCE = 3;

// Share of the largest force that is not looked for.
constexpr double FORCE_TOLERANCE = 1e-12;

// Integral of a contact force, positive where the wall pushes.
[[gnu::always_inline]] inline double impulse_of(Index r, double side, const Scalars &scalars, const Motion &motion,
                                                double duration) {
    double total = scalars.constant(r) * duration;
    if (scalars.broken) {
        auto [value, rate, bend, twist] = taylor(scalars.follow, r, motion.drive);
        total += duration * (value + duration * (rate / 2.0 + duration * (bend / 6.0 + duration * twist / 24.0)));
    } else {
        auto [cosine, sine] = cosine_and_sine(scalars.omega * duration);
        Complex own = integral_of({0.0, scalars.omega}, {cosine, sine}, duration);
        total += (scalars.sine(r) * unit_phase(scalars.omega, motion.clock) * own).real;
    }
    ComplexArray growth = scalars.growth;
    exponentials(scalars.exponent, duration, growth);
    for (Index k = 0; k < scalars.exponent.size(); k++) {
        Complex own = integral_of(scalars.exponent(k), growth(k), duration);
        total += (scalars.weight(r, k) * motion.entry(k) * own).real;
    }
    return side * total;
}

// What is found of a contact force over some time: impulse, largest value and its time.
struct ForceOverTime {
    double impulse, largest, best;
};

// Largest of some values of a contact force, and its time, where entries stand alone.
[[gnu::always_inline]] inline ForceOverTime largest_probe(Index r, double side, double duration, const Scalars &scalars,
                                                          const Space &space) {
    // the last place in a row of probes is that of the sine
    Index last = scalars.exponent.size();
    const Motion &motion = space.motion;
    ComplexArray growth = space.turn.row(0), term = space.turn.row(1);
    double value = 0.0, rate = 0.0, bend = 0.0, twist = 0.0;
    if (scalars.broken) {
        Taylor own = taylor(scalars.follow, r, motion.drive);
        value = own.value;
        rate = own.rate;
        bend = own.bend;
        twist = own.twist;
    }
    value += scalars.constant(r);
    exponentials(scalars.exponent, duration / double(PROBES), growth);
    for (Index k = 0; k < last; k++) term(k) = scalars.weight(r, k) * motion.entry(k);
    auto [cosine, sine] = cosine_and_sine(scalars.omega * duration / double(PROBES));
    growth(last) = {cosine, sine};
    term(last) = scalars.sine(r) * unit_phase(scalars.omega, motion.clock);
    double best = 0.0, largest = 0.0;
    for (Index probe = 0; probe <= PROBES; probe++) {
        double t = double(probe) * duration / double(PROBES);
        double force = value + t * (rate + t * (bend / 2.0 + t * twist / 6.0));
        for (Index k = 0; k <= last; k++) {
            force += term(k).real;
            term(k) *= growth(k);
        }
        if (side * force > largest) {
            largest = side * force;
            best = t;
        }
    }
    return {0.0, largest, best};
}

[[gnu::always_inline]] inline double force_now(Index r, double side, const Scalars &scalars, const Motion &motion) {
    Complex phase = unit_phase(scalars.omega, motion.clock);
    return side * value_now(r, scalars.exponent.size(), phase, scalars, motion);
}

// The same where entries do not stand alone: by Gauss points.
[[gnu::noinline]] inline ForceOverTime force_over_points(Index r, double side, double duration, const Scalars &scalars,
                                                         const Space &space) {
    const Motion &motion = space.motion, &spare = space.spare;
    copy_motion(motion, spare);
    double start = motion.clock(0), elapsed = 0.0, impulse = 0.0, best = 0.0;
    // a dashpot pushes most at the touch, before any of the points
    double largest = larger(force_now(r, side, scalars, spare), 0.0);
    while (elapsed < duration) {
        double panel = next_panel(elapsed, duration - elapsed, scalars, spare), half = 0.5 * panel;
        for (Index node = 0; node < GAUSS_POINTS; node++) {
            double time = start + elapsed + half * (1.0 + NODES[node]);
            move(scalars, spare, time - spare.clock(0));
            double force = force_now(r, side, scalars, spare);
            impulse += half * WEIGHTS[node] * force;
            if (force > largest) {
                largest = force;
                best = time - start;
            }
        }
        elapsed += panel;
    }
    return {impulse, largest, best};
}

// Largest contact force by Newton's method, from the largest of those looked at.
[[gnu::always_inline]] inline double refined_force(Index r, double side, double best, double largest, double duration,
                                                   const Scalars &scalars, const Space &space) {
    for (Index step = 0; step < NEWTON_STEPS_OF_FORCE; step++) {
        copy_motion(space.motion, space.spare);
        move(scalars, space.spare, best);
        auto [force, slope, bend] = rates_now(r, scalars, space.spare, space.search.power);
        largest = larger(largest, side * force);
        // what is left to the crest
        if (side * bend >= 0.0 || slope * slope <= 2.0 * magnitude(bend) * FORCE_TOLERANCE * largest) break;
        best = smaller(larger(best - slope / bend, 0.0), duration);
    }
    return largest;
}

// ---- tables -----------------------------------------------------------------------------------------

// Whether the sums of the window are open.
[[gnu::always_inline]] inline bool is_counted(double time, const Case &c) {
    return c.window(0) <= time && time < c.window(1);
}

// Adds the impulse of a contact to the sum of the window.
[[gnu::always_inline]] inline void add_impulse(Index j, double time, double impulse, const Case &c) {
    if (is_counted(time, c)) c.totals(FORCE_TIME, j) += impulse;
}

// Begins a contact, or a sticking phase.
[[gnu::always_inline]] inline void begin_contact(Index j, double time, double approach, const Case &c) {
    c.touch(BEGUN, j) = time;
    c.touch(TOUCH_SPEED, j) = approach;
    c.touch(PUSHED, j) = c.touch(LARGEST_FORCE, j) = c.touch(LASTED, j) = c.touch(LOST, j) = 0.0;
    for (Index i = 0; i < c.to_modes.shape[1]; i++) c.to_modes(j, i) = 0.0;
}

// Adds an impact that ends now to the sums of its window.
[[gnu::always_inline]] inline void count_impact(Index j, double time, double approach, double impulse, const Case &c) {
    if (!is_counted(time, c)) return;
    c.totals(COUNT, j) += 1.0;
    c.totals(APPROACH_SUM, j) += approach;
    c.totals(LARGEST_APPROACH, j) = larger(c.totals(LARGEST_APPROACH, j), approach);
    c.totals(IMPULSE_SUM, j) += impulse;
}

// Adds impulse and largest force of one contact over some time from the present motion on.
[[gnu::noinline]] inline void add_contact(Index j, bool rigid, double duration, const Scalars &scalars, const Case &c,
                                          const Space &space) {
    Index r = c.state.size() + j;
    double side = side_of(c.state(j)), time = space.motion.clock(0);
    ForceOverTime found = {0.0, 0.0, 0.0};
    if (has_blocks(scalars))
        found = force_over_points(r, side, duration, scalars, space);
    else {
        double impulse = impulse_of(r, side, scalars, space.motion, duration);
        if (!rigid) found = largest_probe(r, side, duration, scalars, space);
        found.impulse = impulse;
    }
    double largest = found.largest;
    if (!rigid) largest = refined_force(r, side, found.best, largest, duration, scalars, space);
    c.touch(PUSHED, j) += found.impulse;
    c.touch(LASTED, j) += duration;
    c.touch(LARGEST_FORCE, j) = larger(c.touch(LARGEST_FORCE, j), largest);
    add_impulse(j, time, found.impulse, c);
    if (is_counted(time, c)) c.totals(PEAK_FORCE, j) = larger(c.totals(PEAK_FORCE, j), largest);
}

// Ends a compliant contact: an impact more.
[[gnu::noinline]] inline void end_contact(Index j, double rebound, double time, const Case &c, const Tables &tables) {
    const Matrix &touch = c.touch;
    double side = side_of(c.state(j));
    count_impact(j, time, touch(TOUCH_SPEED, j), touch(PUSHED, j), c);
    Index row = tables.number(0);
    if (row < tables.impacts.shape[0]) {
        Array out = tables.impacts.row(row);
        out(0) = touch(BEGUN, j);
        out(1) = double(j);
        out(2) = side;
        out(3) = touch(TOUCH_SPEED, j);
        out(4) = rebound;
        out(5) = touch(PUSHED, j);
        out(6) = touch(LARGEST_FORCE, j);
        out(7) = touch(LASTED, j);
        out(8) = touch(LOST, j);
        for (Index i = 0; i < c.to_modes.shape[1]; i++) out(9 + i) = c.to_modes(j, i);
    }
    tables.number(0) = row + 1;
}

// Ends a sticking phase; one that begins as another of the same pair ends goes on with it.
[[gnu::noinline]] inline void end_sticking(Index j, double time, const Case &c, const Tables &tables) {
    double start = c.touch(BEGUN, j), impulse = c.touch(PUSHED, j), side = side_of(c.state(j));
    Index row = tables.number(1);
    if (row < tables.sticking.shape[0])
        for (Index before = row - 1; before > larger(row - 1 - c.state.size(), Index(-1)); before--) {
            Array out = tables.sticking.row(before);
            if (out(0) == double(j) && out(1) == side && out(3) >= start) {
                out(3) = time;
                out(4) = out(4) + impulse;
                return;
            }
        }
    if (time > start) {
        if (row < tables.sticking.shape[0]) {
            Array out = tables.sticking.row(row);
            out(0) = double(j);
            out(1) = side;
            out(2) = start;
            out(3) = time;
            out(4) = impulse;
        }
        tables.number(1) = row + 1;
    }
}

}  // namespace FEMIMPACT_TARGET
