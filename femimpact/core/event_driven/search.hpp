// The next event: the first watched scalar that meets its bound, whatever it stands for.
#pragma once

#include "bounds.hpp"

namespace FEMIMPACT_TARGET {

// How a search ended: at the end of the time, at a bound at speed, at one at rest that presses on, at the end of a
// contact, or with nothing within any reasonable number of advances.
ENUMERATION(SEARCH_NAMES, END, HIT, REST, RELEASE, STUCK);

constexpr Index MOST_ADVANCES = 10'000'000;

// Advances in a row that are too short to change the time; a sine that stands with it is never past its wall.
constexpr Index MOST_STANDING = 10'000;

// Share of the largest entry below which one has decayed, and is left out from then on.
constexpr double NEGLIGIBLE_SHARE = 1e-24;

// Size of an entry that has decayed, whatever the others: a motion that nothing drives is at rest in the end.
constexpr double NEGLIGIBLE_SIZE = 1e-60;

// Times its rounding that a rate must have, to end what began at rest at this instant: its start had none.
constexpr double SETTLED = 1e5;

// Times its rounding by which the force of a pair that sticks is past zero: a contact elsewhere has made it jump.
constexpr double PAST = 100.0;

// Share of the closure that an approach may cross in a cycle and still be none, of a pair just let go and beside others
// that stick.
constexpr double NEGLIGIBLE_APPROACH = 1e-3;

constexpr double PI = 3.141592653589793;

// Speed (m/s) of an approach that rounding has left: it crosses less than the closure in a cycle, or in 1 s.
[[gnu::always_inline]] inline double negligible_approach(double closure, double omega) {
    return NEGLIGIBLE_APPROACH * closure * (omega > 0.0 ? omega / (2.0 * PI) : 1.0);
}

// Time in which clearance >= speed s + bend s^2/2 + twist s^3/6 + bound s^4/24, or somewhat less.
//
// Each term that leads to the wall stays below a quarter of one of lower order that leads away.
[[gnu::always_inline]] inline double creep_time(double clearance, double speed, double bend, double twist,
                                                double bound) {
    double away_speed = larger(-speed, 0.0), away_bend = larger(-bend, 0.0), away_twist = larger(-twist, 0.0);
    if (bound <= 0.0)
        return speed <= 0.0 && bend <= 0.0 && twist <= 0.0 ? INFINITE : 0.0;
    double by_clearance = __builtin_pow(6.0 * clearance / bound, 0.25);
    double time = larger(larger(by_clearance, __builtin_pow(6.0 * away_speed / bound, 1.0 / 3.0)),
                         larger(__builtin_sqrt(3.0 * away_bend / bound), away_twist / bound));
    if (speed > 0.0)
        time = smaller(time, 0.25 * clearance / speed);
    if (bend > 0.0)
        time = smaller(time, larger(__builtin_sqrt(0.5 * clearance / bend), 0.5 * away_speed / bend));
    if (twist > 0.0) {
        double by_speed = __builtin_sqrt(1.5 * away_speed / twist), by_bend = 0.75 * away_bend / twist;
        time = smaller(time, larger(__builtin_pow(1.5 * clearance / twist, 1.0 / 3.0), larger(by_speed, by_bend)));
    }
    return time;
}

// Time (s) in which scalar r crosses no bound; `at_wall` gets the side of the bound that it is at now, else 0.
//
// 0 where it is at a bound and approaches it at speed, -1 where it presses on one at rest.
[[gnu::always_inline]] inline double safe_advance(Index r, const Scalars &scalars, const Motion &motion, Index active,
                                                  Complex phase, double remaining, const Search &search) {
    Array found = search.found;
    double safe = clear_time(r, scalars, motion, active, phase, remaining, search);
    double value = found(VALUE), rate = found(SLOPE), rounding = found(VALUE_ROUNDING),
           rate_rounding = found(SLOPE_ROUNDING);
    search.rate(r) = rate;
    search.at_wall(r) = 0.0;
    if (scalars.upper(r) - value <= rounding)
        search.at_wall(r) = 1.0;
    else if (value - scalars.lower(r) <= rounding)
        search.at_wall(r) = -1.0;
    double over = scalars.upper(r) - value, under = value - scalars.lower(r), farther = found(FARTHER_TIME);
    double side = over < under ? 1.0 : -1.0;
    double clearance = larger(smaller(over, under), 0.0), toward = side * rate;
    // a wall does not pull, be it for a moment
    if (magnitude(scalars.lasting(r)) == STICKS && smaller(over, under) < -PAST * rounding)
        return 0.0;
    if (search.at_wall(r) == 0.0) {
        search.leaving(r) = 0.0;
        if (2.0 * magnitude(rate) * safe > clearance || safe >= remaining)
            return safe;
    } else if (search.leaving(r) != side) {
        if (toward > rate_rounding)
            return 0.0;
    } else {
        bool is_gap = r < scalars.lasting.size() / 2;
        if (toward > larger(SETTLED * rate_rounding, is_gap ? search.negligible(0) : 0.0))
            return 0.0;
    }
    // it creeps along its wall, where the bound by a parabola is far too low
    derivatives(r, scalars, motion, phase, remaining, search);
    double bend = side * found(SECOND), twist = side * found(THIRD);
    if (search.at_wall(r) != 0.0 && toward >= -rate_rounding) {
        toward = 0.0;
        // a pair that was let go has no acceleration left but rounding
        double share = search.leaving(r) == side ? 1e-9 : 1e-12;
        // and none is known better than the time is
        double noise = share * found(SECOND_SIZE) + 0.1 * AT_WALL * found(THIRD_SIZE) * motion.clock(0);
        double noise_of_twist = share * found(THIRD_SIZE);
        bool unknown = twist == 0.0 && found(THIRD_SIZE) > 0.0 && search.leaving(r) != side;
        if (bend > noise || (bend >= -noise && (twist > noise_of_twist || unknown)))
            return -1.0;
        // touching without a push, and nothing that could begin one
        if (found(THIRD_SIZE) == 0.0 && bend >= -noise)
            return INFINITE;
        // neither a push nor a pull beyond rounding: on as far as the pair stays at its wall to rounding
        if (bend >= -noise && magnitude(twist) <= noise_of_twist && found(FOURTH_SIZE) > 0.0)
            return __builtin_pow(24.0 * rounding / found(FOURTH_SIZE), 0.25);
        bend = smaller(bend, 0.0);
    }
    double creep = smaller(creep_time(clearance, toward, bend, twist, found(FOURTH_SIZE)), farther);
    return creep > safe ? creep : safe;
}

// Moves to the first event or to `until`: END, HIT, REST or RELEASE, the pair and side in `event`.
[[gnu::noinline]] inline Index next_event(const Scalars &scalars, const Motion &motion, double until,
                                          const Search &search) {
    Index standing = 0;
    for (Index advance = 0; advance < MOST_ADVANCES && standing < MOST_STANDING; advance++) {
        Complex phase = unit_phase(scalars.omega, motion.clock);
        double remaining = until - motion.clock(0);
        measure(scalars, motion, larger(remaining, 0.0), search);
        double largest = 0.0;
        for (Index k = 0; k < scalars.size.size(); k++)
            largest = larger(largest, search.size(k));
        Index active = 0;
        for (Index k = 0; k < scalars.size.size(); k++) {
            if (search.size(k) < NEGLIGIBLE_SHARE * largest || search.size(k) < NEGLIGIBLE_SIZE) {
                search.size(k) = 0.0;
                motion.entry(k) = {0.0, 0.0};
                search.power(0, k) = {0.0, 0.0};
            } else if (search.size(k) > 0.0)
                active = k + 1;
        }
        double safe = remaining;
        for (Index r = 0; r < scalars.lasting.size(); r++) {
            if (scalars.upper(r) == INFINITE && scalars.lower(r) == -INFINITE)
                continue;
            double advanced = safe_advance(r, scalars, motion, active, phase, remaining, search);
            if (advanced > 0.0) {
                safe = smaller(safe, advanced);
                continue;
            }
            search.event(0) = double(r);
            search.event(1) = search.at_wall(r);
            if (scalars.lasting(r) != 0.0)
                return RELEASE;
            return advanced == 0.0 ? HIT : REST;
        }
        if (safe >= remaining) {
            move(scalars, motion, larger(remaining, 0.0));
            motion.clock(0) = until;
            return END;
        }
        standing = motion.clock(0) + safe == motion.clock(0) ? standing + 1 : 0;
        move(scalars, motion, safe);
    }
    return STUCK;
}

} // namespace FEMIMPACT_TARGET
