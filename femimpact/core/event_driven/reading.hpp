// What is read of a motion between events: samples on a grid, statistics of base cycles, and their exact peaks.
#pragma once

#include "../contact/formulas.hpp"
#include "states.hpp"

namespace FEMIMPACT_TARGET {

// Share of the largest value by which a peak may stand out and not be looked for.
constexpr double PEAK_TOLERANCE = 1e-10;

// Of the time between two samples: what the search for a peak advances at least.
constexpr double LEAST_ADVANCE = 1e-6;

// Share of the terms that make a value below which no peak is looked for, where these cancel.
constexpr double CANCELLED = 1e-11;

// Metres below which nothing moves, and newtons below which nothing pushes.
constexpr double LEAST_MOTION = 1e-20;

// Least advances below which a time is short.
constexpr double SHORT = 1e3;

constexpr Index NEWTON_STEPS_OF_PEAK = 6;

// Where the times of the extremes stand in a row of `Grid.cycles`.
constexpr Index MAXIMUM_TIME = 6, MINIMUM_TIME = 7;

// Adds what w is at a time to the extremes of a cycle.
[[gnu::always_inline]] inline void include(double w, double time, Array row) {
    if (w > row(0)) {
        row(0) = w;
        row(MAXIMUM_TIME) = time;
    }
    if (w < row(1)) {
        row(1) = w;
        row(MINIMUM_TIME) = time;
    }
}

// Where a cycle begins, in samples.
[[gnu::always_inline]] inline double cycle_begin(Index number, Index c, const Grid &grid) {
    return double(grid.origin(c)) + double(number) * grid.per_cycle;
}

// When (s) the cycle ends that goes on.
[[gnu::always_inline]] inline double cycle_end(Index c, const Grid &grid) {
    return grid.start(c) + cycle_begin(grid.cycle(c) + 1, c, grid) * grid.interval(c);
}

// Adds a sample to the sums over the cycle that goes on, to which it belongs.
[[gnu::always_inline]] inline void add_to_cycle(Index sample, double time, double w, Complex phase, Index c,
                                                const Space &space, const Grid &grid) {
    Index number = grid.cycle(c);
    Array row = grid.cycles.row(c, number);
    space.samples(sample - Index(__builtin_floor(cycle_begin(number, c, grid))) - 1) = w;
    include(w, time, row);
    row(2) += w * w;
    row(3) += w * phase.imag;
    row(4) += w * phase.real;
    row(5) += 1.0;
}

// Keeps the motion of all coordinates at one sample, with the forces of compliant contacts.
[[gnu::noinline]] inline void keep_snapshot(Index number, const Shapes &shapes, const Pairs &pairs, const Case &c,
                                            const Space &space, const Snapshots &snapshots) {
    const Matrix &state = space.products.after;
    const Motion &motion = space.motion;
    read_coordinates(shapes, motion, state);
    for (Index m = 0; m < state.shape[1]; m++) {
        snapshots.fields_of(number, 0, m) = state(0, m);
        snapshots.fields_of(number, 1, m) = state(1, m);
    }
    auto [base, speed] = base_motion(c, motion);
    for (Index j = 0; j < c.state.size(); j++) {
        if (c.state(j) == FREE || pairs.rigid(j))
            continue;
        double side = side_of(c.state(j));
        double depth = side * gap_of(j, pairs, state.row(0), base) - gap_on(side, j, c);
        double rate = side * gap_of(j, pairs, state.row(1), speed);
        if (depth > 0.0)
            snapshots.forces(number, j) = side * kelvin_voigt_force(depth, rate, c.stiffness(j), c.damping(j));
    }
}

// ---- the peak of a cycle, and of a contact ----------------------------------------------------------

// What is too little to be looked for in scalar r where large terms cancel.
[[gnu::always_inline]] inline double negligible_motion(Index r, const Scalars &scalars, const Motion &motion,
                                                       const Search &search) {
    Complex wave = scalars.sine(r);
    double scale = magnitude(scalars.constant(r)) + magnitude(wave.real) + magnitude(wave.imag);
    for (Index k = 0; k < scalars.size.size(); k++)
        scale += k < scalars.slow ? size_of_product(scalars.weight(r, k), motion.entry(k))
                                  : scalars.weight_size(r, k) * search.size(k);
    for (Index p = 0; p < scalars.rigid_body_given.size(); p++)
        scale += magnitude(scalars.rigid_body_weight(r, p) * motion.rigid_body(p));
    return CANCELLED * scale + LEAST_MOTION;
}

// How far w may stand out above and below what it is at both ends of an interval.
//
// Each of its terms does by |w''| interval^2/8 at most, and by no more than twice its size.
[[gnu::always_inline]] inline double excess_between(Index r, double interval, double duration, const Scalars &scalars,
                                                    const Motion &motion, const Search &search) {
    double shorter = smaller(interval, duration), share = shorter * shorter / 8.0;
    Complex wave = scalars.sine(r);
    double total =
        scalars.omega * scalars.omega * __builtin_sqrt(wave.real * wave.real + wave.imag * wave.imag) * share;
    if (scalars.degree >= 0) {
        Taylor steady = taylor(scalars, r, motion.drive);
        total += (magnitude(steady.bend) + magnitude(steady.twist) * duration) * share;
    }
    if (scalars.degree > 1)
        total += later_bend(scalars, r, motion.drive, duration) * share;
    for (Index p = 0; p < scalars.rigid_body_given.size(); p++) {
        double weight = scalars.rigid_body_weight(r, p), rate_weight = scalars.rigid_body_rate_weight(r, p);
        auto [push, growth] = rigid_body_push(p, scalars, motion);
        double bent = weight * growth + rigid_body_twist(rate_weight, p, scalars, motion.drive);
        total += (magnitude(weight * push + rate_weight * growth) + magnitude(bent) * duration) * share;
    }
    for (Index k = 0; k < scalars.size.size(); k++) {
        double bent = smaller(scalars.size(k) * scalars.size(k) * share, 2.0) * search.size(k);
        if (k < scalars.driven)
            bent = (search.drift(0, k) + search.drift(1, k)) * share;
        total += scalars.weight_size(r, k) * bent;
    }
    return total;
}

// Number of the entries that matter: the fastest are left out that together add no more than `least`.
[[gnu::always_inline]] inline Index leave_out_ripples(double least, Index active, GivenArray weight_size,
                                                      const Search &search) {
    double left = 0.0;
    while (active > 0) {
        left += weight_size(active - 1) * search.size(active - 1);
        if (left > least)
            break;
        active--;
        search.size(active) = 0.0;
        search.power(0, active) = {0.0, 0.0};
    }
    return active;
}

// Time in which scalar r rises on, or in which its only peak has been looked at; the same where it falls.
[[gnu::always_inline]] inline double advance_to_peak(Index r, double wanted, double rate, double remaining,
                                                     const Scalars &scalars, const Space &space, Array row) {
    Array found = space.search.found;
    double side = rate >= 0.0 ? 1.0 : -1.0, speed = side * rate, bend = side * found(SECOND), bound = found(THIRD_SIZE);
    if (bound <= 0.0)
        bound = 1e-300;
    double rising = (bend + __builtin_sqrt(bend * bend + 2.0 * speed * bound)) / bound;
    if (bend >= 0.0)
        return rising;
    double concave = smaller(-bend / bound, remaining);
    // where peaks alone are wanted, a trough has none inside
    if (rising >= concave || side * wanted < 0.0)
        return larger(rising, concave);
    // to second order in the rate, which is speed + bend t + twist t^2/2
    double inner = bend * bend - 2.0 * speed * side * found(THIRD);
    double first = inner > 0.0 ? 2.0 * speed / (__builtin_sqrt(inner) - bend) : -speed / bend;
    double low = 0.0, high = concave, time = smaller(first, concave);
    for (Index step = 0; step < NEWTON_STEPS_OF_PEAK; step++) {
        copy_motion(space.scratch, space.peak_trial);
        move(scalars, space.peak_trial, time);
        auto [value, rate_there, bend_there] = rates_now(r, scalars, space.peak_trial, space.search.power);
        include(value, space.peak_trial.clock(0), row);
        double slope = side * rate_there, curve = side * bend_there;
        (slope > 0.0 ? low : high) = time;
        // what is left to the peak
        if (slope * slope <= -2.0 * curve * PEAK_TOLERANCE * (row(0) - row(1)) || curve >= 0.0)
            break;
        time = smaller(larger(time - slope / curve, low), high);
    }
    return concave;
}

// Extends row[0] and row[1] to the extremes of scalar r of the scratch motion between two instants, to
// `PEAK_TOLERANCE`.
//
// `wanted` is 1 where only the largest value is, -1 for the smallest, 0 for both. Advances by times in which a bound on
// the motion excludes more than the extremes so far; where these are approached, by those in which the scalar surely
// rises on, or is surely concave, so that its only peak is found. The extremes hold what it is at the end already.
[[gnu::noinline]] inline void follow_peak(Index r, double wanted, double start, double until, double least,
                                          const Scalars &scalars, const Space &space, Array row) {
    const Motion &motion = space.scratch;
    const Search &search = space.search;
    double upper = scalars.upper(r), lower = scalars.lower(r);
    move(scalars, motion, start - motion.clock(0));
    motion.clock(0) = start;
    double safe = 0.0, remaining = until - start;
    while (safe < remaining) {
        Complex phase = unit_phase(scalars.omega, motion.clock);
        remaining = until - motion.clock(0);
        measure(scalars, motion, larger(remaining, 0.0), search);
        double slack = PEAK_TOLERANCE * larger(magnitude(row(0)), magnitude(row(1))) +
                       negligible_motion(r, scalars, motion, search);
        scalars.upper(r) = wanted < 0.0 ? INFINITE : row(0) + slack;
        scalars.lower(r) = wanted > 0.0 ? -INFINITE : row(1) - slack;
        Index active = leave_out_ripples(0.25 * slack, scalars.size.size(), scalars.weight_size.row(r), search);
        safe = clear_time(r, scalars, motion, active, phase, remaining, search);
        double value = search.found(VALUE), rate = search.found(SLOPE);
        include(value, motion.clock(0), row);
        // far below the extremes so far long times are safe, and curvature need not be computed
        if (safe < remaining && (0.25 * magnitude(rate) * safe < row(0) - row(1) || safe < SHORT * least)) {
            derivatives(r, scalars, motion, phase, remaining, search);
            // of what is no number least advances alone would be left
            if (!is_finite(slack + value + rate + search.found(SECOND) + search.found(THIRD_SIZE) +
                           search.found(FOURTH_SIZE)))
                break;
            safe = larger(larger(safe, least), advance_to_peak(r, wanted, rate, remaining, scalars, space, row));
        }
        if (safe < remaining)
            move(scalars, motion, safe);
    }
    // the bounds of a contact are those of its end too
    scalars.upper(r) = upper;
    scalars.lower(r) = lower;
}

// Extends the extremes of the cycle that goes on from where the closed form began up to an instant in it.
//
// `last` is w at that instant, and `read` the number of the last sample before it. Only between samples where more than
// the extremes is not excluded by what w may do there, is a peak looked for.
[[gnu::noinline]] inline void add_peaks(Index c, double until, double last, Index read, const Scalars &scalars,
                                        const Space &space, const Grid &grid) {
    Index number = grid.cycle(c);
    double interval = grid.interval(c), begun = cycle_begin(number, c, grid);
    Index first = Index(__builtin_floor(begun));
    double begin = grid.start(c) + begun * interval;
    Array row = grid.cycles.row(c, number);
    const Motion &motion = space.scratch;
    // before the first cycle nothing is measured, and what lasts no time is no motion
    if (until <= larger(begin, space.begin.clock(0)))
        return;
    copy_motion(space.begin, motion);
    if (motion.clock(0) < begin) {
        move(scalars, motion, begin - motion.clock(0));
        motion.clock(0) = begin;
    }
    double time = motion.clock(0), least = LEAST_ADVANCE * interval;
    Index r = scalars.lasting.size();
    measure(scalars, motion, until - time, space.search);
    double before = value_now(r, scalars.size.size(), unit_phase(scalars.omega, motion.clock), scalars, motion);
    include(before, time, row);
    include(last, until, row);
    double slack = PEAK_TOLERANCE * larger(magnitude(row(0)), magnitude(row(1))) +
                   negligible_motion(r, scalars, motion, space.search);
    double excess = excess_between(r, interval, until - time, scalars, motion, space.search) - slack;
    Index place = Index((time - (grid.start(c) + double(first) * interval)) / interval) + 1;
    double start = INFINITE;
    while (time < until) {
        double at = grid.start(c) + double(first + place) * interval, value = last;
        if (first + place <= read && at < until)
            value = space.samples(place - 1);
        else
            at = until;
        place++;
        if (larger(before, value) + excess > row(0) || smaller(before, value) - excess < row(1))
            start = smaller(start, time);
        else if (start < time) {
            follow_peak(r, 0.0, start, time, least, scalars, space, row);
            start = INFINITE;
        }
        time = at;
        before = value;
    }
    if (start < until)
        follow_peak(r, 0.0, start, until, least, scalars, space, row);
}

// Ends the cycle that goes on at a time between two samples, `read` being the number of the first of them.
[[gnu::noinline]] inline void end_cycle(Index c, double end, Index read, const Scalars &scalars, const Space &space,
                                        const Grid &grid) {
    const Motion &motion = space.peak_trial;
    copy_motion(space.begin, motion);
    move(scalars, motion, end - motion.clock(0));
    motion.clock(0) = end;
    Complex phase = unit_phase(scalars.omega, motion.clock);
    double last = value_now(scalars.lasting.size(), scalars.exponent.size(), phase, scalars, motion);
    add_peaks(c, end, last, read, scalars, space, grid);
    grid.cycle(c) += 1;
}

} // namespace FEMIMPACT_TARGET
