// The first crossing of a gap by a sum of decaying exponentials, a parabola and a sine: none is missed.
//
// A scalar x(t + s) = sum_k r_k e^{lambda_k s} + parabola + sine is bounded over the next s by
//
//     x(t + s) <= [x + x' s + S s^2/2 of the slow terms] + sum over the fast terms of |r_k|,
//
// since |e^z - 1 - z| <= |z|^2/2 and |e^z| <= 1 for Re z <= 0. Of a block of eigenvalues that lie together the same
// holds with norms, since no motion of it grows: |r_k| is then |w_k| |h| with h of all the block. Whatever split into
// slow and fast is taken, the time at which the right-hand side meets the wall comes before any crossing: the motion is
// advanced by the longest of these times, again and again. Close to a wall that it approaches with speed, the bound is
// the tangent with a quadratic remainder, so that the distance left is squared by every advance, as in Newton's method,
// and never overshot.
#pragma once

#include "motion.hpp"

namespace FEMIMPACT_TARGET {

// Items of `Search.found`, for scalar r: its value and rate, their rounding, and a time (s); see `clear_time`.
enum : Index { VALUE, SLOPE, VALUE_ROUNDING, SLOPE_ROUNDING, FARTHER_TIME };

// Or its second and third derivative, and bounds on the second to fourth; see `derivatives`.
enum : Index { SECOND, THIRD, SECOND_SIZE, THIRD_SIZE, FOURTH_SIZE };

// A clearance below this share of the terms that make it is rounding: the pair is at its wall.
constexpr double AT_WALL = 32.0 * 2.220446049250313e-16;

// Of a pair that sticks, whose force may jump, beside 1 of a compliant contact, whose force is one of the state.
constexpr double STICKS = 2.0;

// Taylor's series of the sizes of a drive's derivatives from `first` on: a bound for all times up to this one.
[[gnu::always_inline]] inline double size_of_series(GivenArray d, Index first, double time) {
    double total = 0.0;
    for (Index n = DRIVE - 1 - first; n >= 0; n--)
        total = magnitude(d(first + n)) * INVERSE_FACTORIAL[n] + total * time;
    return total;
}

// How far a derivative of scalar r may change within a time by those from one order on, which a polynomial adds.
//
// Bounds |x^(of)(t) - its Taylor series of the orders before `from`|, with the entries of the motion left out.
[[gnu::noinline]] inline double later_change(const Scalars &scalars, Index r, GivenArray d, Index of, Index from,
                                             double time) {
    double total = 0.0;
    for (Index order = DRIVE - 1; order >= from; order--) {
        double change = derivative(scalars.follow, r, d, order);
        for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
            // x = p y + q y' with y'' = s times a factor
            double p = scalars.rigid_body_weight(r, i), q = scalars.rigid_body_rate_weight(r, i);
            for (Index h = 0; h * DRIVE < d.size(); h++) {
                double higher = order + 1 < DRIVE ? q * d(h * DRIVE + order + 1) : 0.0;
                change += scalars.rigid_body_drive(h, i) * (p * d(h * DRIVE + order) + higher);
            }
        }
        total = magnitude(change) * INVERSE_FACTORIAL[order - of] + total * time;
    }
    for (Index n = of; n < from; n++)
        total *= time;
    return total;
}

// Change of the second derivative within a time beyond that by the third one.
[[gnu::always_inline]] inline double later_bend(const Scalars &scalars, Index r, GivenArray d, double time) {
    return later_change(scalars, r, d, 2, 4, time);
}

// Bound on a derivative of what drives an entry, from bounds on that of ub and on the next two.
[[gnu::always_inline]] inline double largest_push(const Scalars &scalars, Index k, double of_base, double of_speed,
                                                  double of_drive) {
    auto size = [](Complex a) { return magnitude(a.real) + magnitude(a.imag); };
    return size(scalars.load(0, k)) * of_drive + size(scalars.load(1, k)) * of_speed +
           size(scalars.load(2, k)) * of_base;
}

// The same by the loads behind the first, of the derivative `order` within a time: of forces s alone pushes.
[[gnu::noinline]] inline double further_push(const Scalars &scalars, Index k, GivenArray d, Index order, double time) {
    return over_further_loads(d, [=, &scalars](Index h, double &total) {
        Complex load = scalars.load(3 * h, k);
        double bound = size_of_series(d.part(h * DRIVE, (h + 1) * DRIVE), order + 2, time);
        total += (magnitude(load.real) + magnitude(load.imag)) * bound;
    });
}

// Adds the values of driven entries within a block, whose motions mix.
[[gnu::always_inline]] inline void sum_within_blocks(const Scalars &scalars, Array values) {
    for (Index b = 0; b < scalars.blocks.shape[0]; b++) {
        Index first = scalars.blocks(b, 0), last = first + scalars.blocks(b, 1);
        if (last > scalars.driven)
            continue;
        double total = 0.0;
        for (Index k = first; k < last; k++)
            total += values(k);
        for (Index k = first; k < last; k++)
            values(k) = total;
    }
}

// Factor by which a slow motion may grow by itself within a time: a velocity becomes a displacement.
[[gnu::always_inline]] inline double largest_growth(const Scalars &scalars, Index k, double time) {
    return k < scalars.slow ? __builtin_exp(scalars.size(k) * time) : 1.0;
}

// Sets what bounds driven entries over a time: |H|, from what it is now, and |H''| with its change.
[[gnu::noinline]] inline void measure_driven(const Scalars &scalars, const Motion &motion, double ahead,
                                             const Search &search) {
    Array size = search.size, bend = search.drift.row(0), change = search.drift.row(1), d = motion.drive;
    ComplexArray twice = search.power.row(1);
    differentiate(scalars, search.power.row(0), d, 1, twice);
    double bound[5];
    for (Index order = 0; order < 5; order++)
        bound[order] = size_of_series(d, order, ahead);
    for (Index k = 0; k < scalars.driven; k++) {
        bend(k) = magnitude(twice(k).real) + magnitude(twice(k).imag);
        // here what its push alone may do: no motion of a block grows by itself, but of a slow one
        change(k) = largest_push(scalars, k, bound[2], bound[3], bound[4]);
        size(k) += ahead * largest_push(scalars, k, bound[0], bound[1], bound[2]);
        if (k < scalars.slow)
            size(k) += ahead * (magnitude(scalars.given(k).real) + magnitude(scalars.given(k).imag));
        if (d.size() > DRIVE) {
            change(k) += further_push(scalars, k, d, 2, ahead);
            size(k) += ahead * further_push(scalars, k, d, 0, ahead);
        }
    }
    if (scalars.blocks.shape[0] > 0) {
        sum_within_blocks(scalars, size);
        sum_within_blocks(scalars, bend);
        sum_within_blocks(scalars, change);
    }
    for (Index k = 0; k < scalars.driven; k++) {
        double growth = largest_growth(scalars, k, ahead);
        size(k) *= growth;
        change(k) = ahead * (scalars.size(k) * growth * (bend(k) + ahead * change(k)) + change(k));
    }
}

// Sets |H| of every entry, the norm within a block, and H'; of driven entries what bounds them for a time.
[[gnu::noinline]] inline void measure(const Scalars &scalars, const Motion &motion, double ahead,
                                      const Search &search) {
    Array size = search.size;
    differentiate(scalars, motion.entry, motion.drive, 0, search.power.row(0));
    for (Index k = 0; k < scalars.exponent.size(); k++) {
        Complex h = motion.entry(k);
        size(k) = __builtin_sqrt(h.real * h.real + h.imag * h.imag);
    }
    for (Index b = 0; b < scalars.blocks.shape[0]; b++) {
        Index first = scalars.blocks(b, 0), last = first + scalars.blocks(b, 1);
        double square = 0.0;
        for (Index k = first; k < last; k++)
            square += size(k) * size(k);
        for (Index k = first; k < last; k++)
            size(k) = __builtin_sqrt(square);
    }
    if (scalars.driven > 0)
        measure_driven(scalars, motion, ahead, search);
}

// Size of what a real part is a sum of: what may be lost of a slow motion now, of which a bound tells of later.
[[gnu::always_inline]] inline double size_of_product(Complex a, Complex b) {
    return magnitude(a.real * b.real) + magnitude(a.imag * b.imag);
}

// Smallest s > 0 with speed s + bend s^2/2 = clearance >= 0; infinite if there is none.
[[gnu::always_inline]] inline double first_meeting(double clearance, double speed, double bend) {
    double root = speed * speed + 2.0 * bend * clearance;
    if (root < 0.0)
        return INFINITE;
    root = __builtin_sqrt(root);
    if (speed < 0.0)
        return bend > 0.0 ? (root - speed) / bend : INFINITE;
    return speed + root > 0.0 ? 2.0 * clearance / (speed + root) : INFINITE;
}

// Time in which scalar r surely meets neither bound.
//
// `search` is as `measure` leaves it, with nothing but zeros from entry `active` on; its `found` gets value, rate, the
// rounding of both, and the time in which the farther bound is surely not met.
[[gnu::noinline]] inline double clear_time(Index r, const Scalars &scalars, const Motion &motion, Index active,
                                           Complex phase, double remaining, const Search &search) {
    Array size = search.size, found = search.found, d = motion.drive;
    ComplexArray rate_of = search.power.row(0);
    bool pieces = scalars.degree >= 0;
    Complex turned = scalars.sine(r) * phase, wave = scalars.sine(r);
    double size_of_sine = __builtin_sqrt(wave.real * wave.real + wave.imag * wave.imag);
    double value = scalars.constant(r) + turned.real;
    double rate = -scalars.omega * turned.imag;
    double scale = magnitude(scalars.constant(r)) + size_of_sine;
    double scale_rate = scalars.omega * size_of_sine;
    double bend = scalars.omega * scale_rate;
    double pull = 0.0, twist = 0.0;
    if (pieces) {
        Taylor followed = taylor(scalars, r, d);
        value += followed.value;
        rate += followed.rate;
        pull = followed.bend;
        twist = magnitude(followed.twist);
        // a drive, and the sine below, are known no better than the time is
        scale += magnitude(followed.value) + 0.1 * magnitude(followed.rate) * motion.clock(0);
        scale_rate += magnitude(followed.rate);
    }
    for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
        double p = scalars.rigid_body_weight(r, i), q = scalars.rigid_body_rate_weight(r, i);
        auto [push, growth] = rigid_body_push(i, scalars, motion);
        double y = motion.rigid_body(i), v = motion.rigid_body_rate(i);
        value += p * y + q * v;
        rate += p * v + q * push;
        scale += magnitude(p * y) + magnitude(q * v);
        scale_rate += magnitude(p * v) + magnitude(q * push);
        pull += p * push + q * growth;
        twist += magnitude(p * growth + rigid_body_twist(q, i, scalars, d));
    }
    if (pieces)
        twist *= remaining;
    if (scalars.degree > 1)
        twist += later_bend(scalars, r, d, remaining);
    double fast = 0.0, known = 0.0;
    for (Index k = 0; k < active; k++) {
        double largest = scalars.weight_size(r, k) * size(k);
        fast += largest;
        scale += k < scalars.slow ? size_of_product(scalars.weight(r, k), motion.entry(k)) : 0.0;
        known += k < scalars.slow ? 0.0 : largest;
    }
    scale += known;
    double upper = scalars.upper(r), lower = scalars.lower(r);
    double up = upper == INFINITE ? INFINITE : 0.0, down = lower == -INFINITE ? INFINITE : 0.0;
    for (Index k = 0; k <= active; k++) {
        double over = upper - value - fast, under = value - lower - fast;
        // a square root only where this split reaches beyond the best one so far
        if (over > (rate + 0.5 * (bend + pull + twist) * up) * up && over > 0.0 && up < INFINITE)
            up = larger(up, first_meeting(over, rate, bend + pull + twist));
        if (under > (0.5 * (bend - pull + twist) * down - rate) * down && under > 0.0 && down < INFINITE)
            down = larger(down, first_meeting(under, -rate, bend - pull + twist));
        if (k < active) {
            Complex weight = scalars.weight(r, k), h = motion.entry(k), h_rate = rate_of(k);
            double size_of_term = scalars.weight_size(r, k) * size(k);
            value += weight.real * h.real - weight.imag * h.imag;
            rate += weight.real * h_rate.real - weight.imag * h_rate.imag;
            fast = k + 1 < active ? fast - size_of_term : 0.0;
            double speed = size_of_term * scalars.size(k);
            scale_rate += k < scalars.slow ? size_of_product(weight, h_rate) : speed;
            if (k < scalars.driven) {
                pull += (weight * search.power(1, k)).real;
                bend += scalars.weight_size(r, k) * search.drift(1, k);
            } else
                bend += speed * scalars.size(k);
        }
    }
    found(VALUE) = value;
    found(SLOPE) = rate;
    if (upper < INFINITE)
        scale += magnitude(upper);
    if (lower > -INFINITE)
        scale += magnitude(lower);
    found(VALUE_ROUNDING) = AT_WALL * (scale + 0.1 * scalars.omega * size_of_sine * motion.clock(0));
    found(SLOPE_ROUNDING) = AT_WALL * scale_rate;
    // at the wall and leaving it with speed: the parabola returns later
    if (up == 0.0 && rate < 0.0)
        up = first_meeting(0.0, rate, bend + pull + twist);
    if (down == 0.0 && rate > 0.0)
        down = first_meeting(0.0, -rate, bend - pull + twist);
    found(FARTHER_TIME) = upper - value < value - lower ? down : up;
    return smaller(up, down);
}

// Sets found[0:5] to the second and third derivative of scalar r, and bounds on the second to fourth.
//
// The last two hold for the time that remains. `search` is as `measure` leaves it.
[[gnu::noinline]] inline void derivatives(Index r, const Scalars &scalars, const Motion &motion, Complex phase,
                                          double remaining, const Search &search) {
    Array size = search.size, found = search.found;
    ComplexArray once = search.power.row(0), twice = search.power.row(1), thrice = search.power.row(2);
    Complex turned = scalars.sine(r) * phase;
    double size_of_sine = __builtin_sqrt(turned.real * turned.real + turned.imag * turned.imag);
    double omega = scalars.omega, omega2 = omega * omega, omega3 = omega * omega2, omega4 = omega2 * omega2;
    double second = -omega2 * turned.real, third = omega3 * turned.imag;
    double size2 = omega2 * size_of_sine, size3 = omega3 * size_of_sine, size4 = omega4 * size_of_sine;
    auto add = [&](double pull, double twist) {
        second += pull;
        third += twist;
        size2 += magnitude(pull);
        size3 += magnitude(twist);
    };
    if (scalars.degree >= 0) {
        Taylor followed = taylor(scalars, r, motion.drive);
        add(followed.bend, followed.twist);
    }
    for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
        double p = scalars.rigid_body_weight(r, i), q = scalars.rigid_body_rate_weight(r, i);
        auto [push, growth] = rigid_body_push(i, scalars, motion);
        add(p * push + q * growth, p * growth + rigid_body_twist(q, i, scalars, motion.drive));
    }
    if (scalars.degree > 1) {
        size3 += later_change(scalars, r, motion.drive, 3, 4, remaining);
        size4 += later_change(scalars, r, motion.drive, 4, 4, remaining);
    }
    differentiate(scalars, once, motion.drive, 1, twice);
    differentiate(scalars, twice, motion.drive, 2, thrice);
    double ahead[4] = {};
    for (Index order = 0; scalars.driven > 0 && order < 4; order++)
        ahead[order] = size_of_series(motion.drive, 2 + order, remaining);
    for (Index k = 0; k < scalars.size.size(); k++) {
        second += (scalars.weight(r, k) * twice(k)).real;
        third += (scalars.weight(r, k) * thrice(k)).real;
        double rate = scalars.size(k), weight = scalars.weight_size(r, k);
        if (k < scalars.driven) {
            // from |H''|, its change, and that of what drives it
            double bent = search.drift(0, k) + search.drift(1, k);
            double pushed = weight * largest_push(scalars, k, ahead[0], ahead[1], ahead[2]);
            double then = weight * largest_push(scalars, k, ahead[1], ahead[2], ahead[3]);
            if (motion.drive.size() > DRIVE) {
                pushed += weight * further_push(scalars, k, motion.drive, 2, remaining);
                then += weight * further_push(scalars, k, motion.drive, 3, remaining);
            }
            double twisted = weight * rate * bent + pushed;
            size2 += weight * search.drift(0, k);
            size3 += twisted;
            size4 += rate * twisted + then;
            continue;
        }
        double bent = weight * size(k) * (rate * rate);
        size2 += bent;
        size3 += bent * rate;
        size4 += bent * (rate * rate);
    }
    found(SECOND) = second;
    found(THIRD) = third;
    found(SECOND_SIZE) = size2;
    found(THIRD_SIZE) = size3;
    found(FOURTH_SIZE) = size4;
}

} // namespace FEMIMPACT_TARGET
