// Largest and smallest displacement of a cycle: those of the cubic through both ends of each step with their rates.
//
// Between two changes of sign of the rate the motion rises or falls: the extremes of a cycle are among its begin, its
// end and the crests, which are computed where the rate changes sign, and nowhere else.
#pragma once

#include "../columns.hpp"
#include "../pack.hpp"
#include "loop_data.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Of w0 + t (a + t (bend + t twist)), t from 0 to 1, that ends at w1 with the rate b.
struct Cubic {
    double bend, twist;
};

inline Cubic cubic(double w0, double a, double w1, double b) {
    double increment = w1 - w0;
    return {3.0 * increment - 2.0 * a - b, a + b - 2.0 * increment};
}

// Extreme value of the cubic through both ends of an interval, with rates of opposite signs.
//
// a and b are per interval: w' times its length.
inline double extreme_between(double w0, double a, double w1, double b) {
    auto [bend, twist] = cubic(w0, a, w1, b);
    double root = __builtin_sqrt(larger(bend * bend - 3.0 * twist * a, 0.0));
    // the root of a + 2 bend t + 3 twist t^2 that lies inside, without cancellation; rounding may lead out
    double t = smaller(larger(a / (__builtin_copysign(root, a) - bend), 0.0), 1.0);
    return w0 + t * (a + t * (bend + t * twist));
}

// Adds one displacement to the extremes of the running cycle; one that is not a number changes nothing.
inline void include(Index c, double w, Matrix sums) {
    if (w > sums(MAXIMUM, c))
        sums(MAXIMUM, c) = w;
    if (w < sums(MINIMUM, c))
        sums(MINIMUM, c) = w;
}

// Takes one case from its last place on to w and w', a time h later (s), past an `impact` or none.
//
// Two motions meet in an impact: each has one end of the step, and what lies between is no cubic.
inline void extend(Index c, double h, double w, double rate, double impact, Matrix sums, Matrix last) {
    double before = last(LAST, c), rate_before = last(LAST_RATE, c);
    if (differ_in_sign(rate_before, rate)) {
        if (impact < INFINITE)
            include(c, before + impact * rate_before, sums);
        else {
            include(c, before, sums);
            include(c, w, sums);
            if (rate_before * rate < 0.0)
                include(c, extreme_between(before, h * rate_before, w, h * rate), sums);
        }
    }
    last(LAST, c) = w;
    last(LAST_RATE, c) = rate;
}

// Writes the extremes of the cycle that ends at the last place, and begins the next one there.
inline void end_cycle(Index c, const Cycles &cycles) {
    Index k = cycles.number(c);
    Matrix sums = cycles.sums;
    double w = cycles.last(LAST, c);
    include(c, w, sums);
    if (k < cycles.values.shape[0]) {
        cycles.values(k, MAXIMUM, c) = sums(MAXIMUM, c);
        cycles.values(k, MINIMUM, c) = sums(MINIMUM, c);
    }
    sums(MAXIMUM, c) = sums(MINIMUM, c) = w;
}

// Takes one case from its last place, at `start`, on to w and w' at `stop` (both in steps of dt).
//
// A cycle that ends within gets the part before its end, the next one the part after it.
[[gnu::noinline]] inline void add_interval(Index c, double start, double stop, double dt, double w, double rate,
                                           double impact, const Cycles &cycles) {
    Matrix sums = cycles.sums, last = cycles.last;
    double h = (stop - start) * dt;
    double end = double(cycles.number(c) + 1) * cycles.period(c);
    if (start < end && end < stop) {
        double share = (end - start) / (stop - start), before = last(LAST, c);
        double a = h * last(LAST_RATE, c), b = h * rate;
        auto [bend, twist] = cubic(before, a, w, b);
        double place = before + share * (a + share * (bend + share * twist));
        double slope = (a + share * (2.0 * bend + 3.0 * share * twist)) / h;
        if (impact < INFINITE) {
            // the instants of impacts and of cycles are not known to more than the step
            place = before + share * (w - before);
            slope = rate;
        }
        extend(c, share * h, place, slope, impact, sums, last);
        end_cycle(c, cycles);
        h *= 1.0 - share;
    }
    extend(c, h, w, rate, impact, sums, last);
    if (end == stop)
        end_cycle(c, cycles);
}

// Time (s) from the begin of a step to its first impulse, which may lie half a step before it; else infinite.
//
// The impulses of a ball that stays on its wall make no jump.
inline double impact_in(Index c, double begun, bool rigid, Block touch) {
    double first = INFINITE;
    if (rigid)
        for (Index j = 0; j < touch.shape[1]; j++)
            if (touch(NORMAL, j, c) != 0.0 && touch(DURATION, j, c) == 0.0)
                first = smaller(first, touch(START, j, c) - begun);
    return first;
}

// Crests of the step that began at that time (s) in the pack of cases from `first` on, or in one case alone.
[[gnu::noinline]] inline void add_extremes(Index first, double begun, const Scheme &s, const Motion &m,
                                           const Cycles &cycles) {
    for (Index c = first; c < smaller(first + WIDTH, m.w.shape[1]); c++)
        if (differ_in_sign(cycles.last(LAST_RATE, c), m.w_rate(0, c)))
            extend(c, s.dt, m.w(0, c), m.w_rate(0, c), impact_in(c, begun, s.rigid, m.touch), cycles.sums, cycles.last);
}

// Extremes of the cases whose base cycle ends within this step, but for those whose fine steps have had theirs.
[[gnu::noinline]] inline void split_cycles(Index step, const Scheme &s, const Motion &m, const Cycles &cycles) {
    for (Index c = 0; c < cycles.number.size(); c++)
        if (step == cycles.next_wrap(c) && m.ledger(REFINED, c) == 0.0) {
            double impact = impact_in(c, double(step - 1) * s.dt, s.rigid, m.touch);
            add_interval(c, double(step) - 1.0, double(step), s.dt, m.w(0, c), m.w_rate(0, c), impact, cycles);
        }
}

// Extremes within one of the fine steps into which a case divides the step of dt that began at `step`.
inline void add_fine_step(Index c, Index step, Index part, Index parts, double dt, const Motion &m,
                          const Cycles &cycles) {
    double w = m.w(0, c), rate = m.w_rate(0, c);
    if (differ_in_sign(cycles.last(LAST_RATE, c), rate) || step + 1 == cycles.next_wrap(c)) {
        double start = double(step) + double(part) / double(parts);
        double stop = double(step) + double(part + 1) / double(parts);
        add_interval(c, start, stop, dt, w, rate, INFINITE, cycles);
    } else {
        cycles.last(LAST, c) = w;
        cycles.last(LAST_RATE, c) = rate;
    }
}

} // namespace FEMIMPACT_TARGET::stepping
