// The first crossing of a gap by a sum of decaying exponentials, a parabola and a sine: none is missed.
//
// A scalar x(t + s) = sum_k r_k e^{lambda_k s} + parabola + sine is bounded over the next s by
//
//     x(t + s) <= [x + x' s + S s^2/2 of the slow terms] + sum over the fast terms of |r_k|,
//
// since |e^z - 1 - z| <= |z|^2/2 and |e^z| <= 1 for Re z <= 0. Of a block of eigenvalues that lie together the same
// holds with norms, since no motion of it grows: |r_k| is then |w_k| |h| with the whole block's h. Whatever split into
// slow and fast is taken, the time at which the right-hand side meets the wall comes before any crossing: the motion is
// advanced by the longest of these times, again and again. Close to a wall that it approaches with speed, the bound is
// the tangent with a quadratic remainder, so that the distance left is squared by every advance, as in Newton's method,
// and never overshot.
#pragma once

#include "exponentials.hpp"
#include "loop_data.hpp"

namespace FEMIMPACT_TARGET {

// Terms of the exponential series of a block, whose steps have a norm below 1; and most of these steps.
constexpr Index TAYLOR = 18, MOST_STEPS = 100'000;

// Gauss-Legendre points on -1 to 1: where entries do not stand alone, products of motions are summed over them.
constexpr Index GAUSS_POINTS = 10;
constexpr double NODES[GAUSS_POINTS] = {
    -0.9739065285171717, -0.8650633666889845, -0.6794095682990244, -0.4333953941292472, -0.14887433898163122,
    0.14887433898163122, 0.4333953941292472,  0.6794095682990244,  0.8650633666889845,  0.9739065285171717,
};
constexpr double WEIGHTS[GAUSS_POINTS] = {
    0.06667134430868814, 0.1494513491505806,  0.21908636251598204, 0.26926671930999635, 0.29552422471475287,
    0.29552422471475287, 0.26926671930999635, 0.21908636251598204, 0.1494513491505806,  0.06667134430868814,
};

// Decay e^-80, 2e-35, of which nothing is left in any sum; two entries of a block decay by it nearly together.
constexpr double DECAY_EXPONENT = 80.0;

// A clearance below this share of the terms that make it is rounding: the pair is at its wall.
constexpr double AT_WALL = 32.0 * 2.220446049250313e-16;

// Of a pair that sticks, whose force may jump, beside 1 of a compliant contact, whose force is one of the state.
constexpr double STICKS = 2.0;

// e^{i theta} of the sine at the present time.
[[gnu::always_inline]] inline Complex unit_phase(double omega, GivenArray clock) {
    auto turn = cosine_and_sine(omega * clock(0) + clock(1));
    return {turn.cosine, turn.sine};
}

// Acceleration of a rigid-body coordinate, and its rate.
struct Push {
    double push, growth;
};
[[gnu::always_inline]] inline Push rigid_body_push(Index i, const Scalars &scalars, const Motion &motion) {
    double drive = scalars.rigid_body_drive(i);
    return {scalars.rigid_body_given(i) + drive * motion.drive(2), drive * motion.drive(3)};
}

// Numbers in `Motion.drive`: ub, ub', s, and the derivatives of s to the fifth.
constexpr Index DRIVE = 8;

// 1/n!.
constexpr double INVERSE_FACTORIAL[] = {1.0,       1.0,        1.0 / 2.0,   1.0 / 6.0,    1.0 / 24.0,
                                        1.0 / 120, 1.0 / 720., 1.0 / 5040., 1.0 / 40320., 1.0 / 362880.};

// Taylor's series of the derivative `first` of a drive, from its n-th term on with n = `from`.
[[gnu::always_inline]] inline double series(GivenArray d, Index first, Index from, double time) {
    double total = 0.0;
    for (Index n = DRIVE - 1 - first; n >= from; n--)
        total = d(first + n) * INVERSE_FACTORIAL[n] + total * time;
    for (Index n = 0; n < from; n++)
        total *= time;
    return total;
}

// The same of the sizes of the derivatives, from the first term on: a bound for all times up to this one.
[[gnu::always_inline]] inline double size_of_series(GivenArray d, Index first, double time) {
    double total = 0.0;
    for (Index n = DRIVE - 1 - first; n >= 0; n--)
        total = magnitude(d(first + n)) * INVERSE_FACTORIAL[n] + total * time;
    return total;
}

// Advances the rigid-body coordinates, and the drive where it is in pieces.
[[gnu::always_inline]] inline void move_rigid_bodies(const Scalars &scalars, const Motion &motion, double duration) {
    Array d = motion.drive, y = motion.rigid_body, v = motion.rigid_body_rate;
    for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
        auto [push, growth] = rigid_body_push(i, scalars, motion);
        y(i) += duration * (v(i) + duration * (0.5 * push + duration * growth / 6.0));
        v(i) += duration * (push + 0.5 * duration * growth);
    }
    if (scalars.degree > 1) {
        // what the terms from s'' on add to both integrals of s
        double moved = series(d, 0, 4, duration), faster = series(d, 1, 3, duration);
        for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
            y(i) += scalars.rigid_body_drive(i) * moved;
            v(i) += scalars.rigid_body_drive(i) * faster;
        }
        for (Index i = 0; i < DRIVE - 1; i++)
            d(i) += series(d, i, 1, duration);
    } else if (scalars.degree >= 0) {
        d(0) += duration * (d(1) + duration * (0.5 * d(2) + duration * d(3) / 6.0));
        d(1) += duration * (d(2) + 0.5 * duration * d(3));
        d(2) += duration * d(3);
    }
}

// The derivative of some order of what a polynomial adds to a scalar.
[[gnu::always_inline]] inline double derivative(GivenMatrix follow, Index r, GivenArray d, Index order) {
    double total = 0.0;
    for (Index i = 0; i + order < DRIVE; i++)
        total += follow(i, r) * d(i + order);
    return total;
}

// What a polynomial adds to a scalar: the value and its first three derivatives.
struct Taylor {
    double value, rate, bend, twist;
};
[[gnu::always_inline]] inline Taylor taylor(const Scalars &scalars, Index r, GivenArray d) {
    GivenMatrix follow = scalars.follow;
    if (scalars.degree > 1)
        return {derivative(follow, r, d, 0), derivative(follow, r, d, 1), derivative(follow, r, d, 2),
                derivative(follow, r, d, 3)};
    double a = follow(0, r), b = follow(1, r), c = follow(2, r), e = follow(3, r);
    return {a * d(0) + b * d(1) + c * d(2) + e * d(3), a * d(1) + b * d(2) + c * d(3), a * d(2) + b * d(3), a * d(3)};
}

// How far a derivative of scalar r may change within a time by those from one order on, which a polynomial adds.
//
// Bounds |x^(of)(t) - its Taylor series of the orders before `from`|, with the entries of the motion left out.
[[gnu::noinline]] inline double later_change(const Scalars &scalars, Index r, GivenArray d, Index of, Index from,
                                             double time) {
    double total = 0.0;
    for (Index order = DRIVE - 1; order >= from; order--) {
        double own = derivative(scalars.follow, r, d, order);
        for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
            // x = p y + q y' with y'' = s times a factor
            double p = scalars.rigid_body_weight(r, i), q = scalars.rigid_body_rate_weight(r, i);
            double higher = order + 1 < DRIVE ? q * d(order + 1) : 0.0;
            own += scalars.rigid_body_drive(i) * (p * d(order) + higher);
        }
        total = magnitude(own) * INVERSE_FACTORIAL[order - of] + total * time;
    }
    for (Index n = of; n < from; n++)
        total *= time;
    return total;
}

// Change of the second derivative within a time beyond that by the third one.
[[gnu::always_inline]] inline double later_bend(const Scalars &scalars, Index r, GivenArray d, double time) {
    return later_change(scalars, r, d, 2, 4, time);
}

// Sets `out` to Lambda times a vector of entries.
[[gnu::always_inline]] inline void multiply(const Scalars &scalars, GivenComplexArray entry, ComplexArray out) {
    for (Index k = 0; k < scalars.exponent.size(); k++)
        out(k) = scalars.exponent(k) * entry(k);
    for (Index b = 0; b < scalars.blocks.shape[0]; b++) {
        Index first = scalars.blocks(b, 0), last = first + scalars.blocks(b, 1);
        for (Index k = first; k < last; k++)
            for (Index m = k + 1; m < last; m++)
                out(k) += scalars.coupling(k, m) * entry(m);
    }
}

// The derivative of some order of what drives an entry.
[[gnu::always_inline]] inline Complex push_on_entry(const Scalars &scalars, Index k, GivenArray d, Index order) {
    Complex total = scalars.load(2, k) * d(order);
    if (order + 1 < DRIVE)
        total += scalars.load(1, k) * d(order + 1);
    if (order + 2 < DRIVE)
        total += scalars.load(0, k) * d(order + 2);
    return total;
}

// Sets `out` to Lambda times some derivative of the entries, and what a polynomial adds to that of driven ones.
[[gnu::always_inline]] inline void differentiate(const Scalars &scalars, GivenComplexArray entry, GivenArray d,
                                                 Index order, ComplexArray out) {
    multiply(scalars, entry, out);
    for (Index k = 0; k < scalars.driven; k++)
        out(k) += push_on_entry(scalars, k, d, order);
}

// Bound on a derivative of what drives an entry, from bounds on that of ub and on the next two.
[[gnu::always_inline]] inline double largest_push(const Scalars &scalars, Index k, double of_base, double of_speed,
                                                  double of_drive) {
    auto size = [](Complex a) { return magnitude(a.real) + magnitude(a.imag); };
    return size(scalars.load(0, k)) * of_drive + size(scalars.load(1, k)) * of_speed +
           size(scalars.load(2, k)) * of_base;
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
        // here what its push alone may do: no motion of a block grows by itself
        change(k) = largest_push(scalars, k, bound[2], bound[3], bound[4]);
        size(k) += ahead * largest_push(scalars, k, bound[0], bound[1], bound[2]);
    }
    if (scalars.blocks.shape[0] > 0) {
        sum_within_blocks(scalars, size);
        sum_within_blocks(scalars, bend);
        sum_within_blocks(scalars, change);
    }
    for (Index k = 0; k < scalars.driven; k++)
        change(k) = ahead * (scalars.size(k) * (bend(k) + ahead * change(k)) + change(k));
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

// e^z by the C library.
[[gnu::always_inline]] inline Complex exponential(Complex z) {
    double size = __builtin_exp(z.real);
    return {size * __builtin_cos(z.imag), size * __builtin_sin(z.imag)};
}

// Advances the entries of one block: by e^{mean t}, and Taylor's series of what is left, small in every step.
[[gnu::noinline]] inline void move_block(const Scalars &scalars, Index first, Index last, const Motion &motion,
                                         double duration) {
    Complex mean = {0.0, 0.0};
    for (Index k = first; k < last; k++)
        mean += scalars.exponent(k) / double(last - first);
    // all of it has decayed long before so many steps
    double norm = larger(0.0, magnitude(duration) * (scalars.size(first) + __builtin_hypot(mean.real, mean.imag)));
    Index steps = (norm < double(MOST_STEPS) ? Index(norm) : MOST_STEPS) + 1;
    double step = duration / double(steps);
    Complex turn = exponential(mean * step);
    ComplexArray entry = motion.entry, term = scalars.term;
    for (Index i = 0; i < steps; i++) {
        for (Index k = first; k < last; k++) {
            entry(k) *= turn;
            term(k) = entry(k);
        }
        for (Index order = 1; order <= TAYLOR; order++)
            for (Index k = first; k < last; k++) {
                Complex total = (scalars.exponent(k) - mean) * term(k);
                for (Index m = k + 1; m < last; m++)
                    total += scalars.coupling(k, m) * term(m);
                term(k) = total * (step / double(order));
                entry(k) += term(k);
            }
    }
}

// Terms of Taylor's series of driven entries, by |lambda| times the time: below 0.1, below 0.6, below 2.
constexpr Index TERMS_OF_SLOW = 10, TERMS_OF_SLOWER = 15, MOST_TERMS = 24;

constexpr double INVERSE[MOST_TERMS + 1] = {
    0.0,      1.0,      1.0 / 2,  1.0 / 3,  1.0 / 4,  1.0 / 5,  1.0 / 6,  1.0 / 7,  1.0 / 8,
    1.0 / 9,  1.0 / 10, 1.0 / 11, 1.0 / 12, 1.0 / 13, 1.0 / 14, 1.0 / 15, 1.0 / 16, 1.0 / 17,
    1.0 / 18, 1.0 / 19, 1.0 / 20, 1.0 / 21, 1.0 / 22, 1.0 / 23, 1.0 / 24,
};

[[gnu::always_inline]] inline Index terms_of_driven(const Scalars &scalars, double duration) {
    double largest = 0.0;
    for (Index k = 0; k < scalars.driven; k++)
        largest = larger(largest, scalars.size(k) * duration);
    return largest < 0.1 ? TERMS_OF_SLOW : largest < 0.6 ? TERMS_OF_SLOWER : MOST_TERMS;
}

// The next derivative of driven entry k under a polynomial, `order` being that of `term`.
[[gnu::always_inline]] inline Complex next_term(const Scalars &scalars, Index k, GivenComplexArray term, GivenArray d,
                                                Index order) {
    Complex next = scalars.exponent(k) * term(k);
    if (order < DRIVE)
        next += push_on_entry(scalars, k, d, order);
    for (Index b = 0; b < scalars.blocks.shape[0]; b++) {
        Index last = scalars.blocks(b, 0) + scalars.blocks(b, 1);
        if (k >= scalars.blocks(b, 0) && k < last)
            for (Index m = k + 1; m < last; m++)
                next += scalars.coupling(k, m) * term(m);
    }
    return next;
}

// Whether anything drives the driven entries now.
[[gnu::always_inline]] inline bool are_pushed(const Scalars &scalars, GivenArray d) {
    bool found = false;
    for (Index i = 2; i < DRIVE; i++)
        found = found || d(i) != 0.0;
    for (Index k = 0; k < scalars.driven; k++)
        found = found || scalars.load(1, k) != 0.0 || scalars.load(2, k) != 0.0;
    return found && scalars.driven > 0;
}

// Adds what a polynomial does to driven entries in a time, which the rest of `move` leaves out.
//
// H' = Lambda H + F has the Taylor series of c_0 = 0, c_{n+1} = Lambda c_n + F^(n). An entry that is slow beside the
// polynomial has its whole response; of a fast one the response that is a polynomial itself is apart (`follow`), and
// its entry is the rest. Taken apart too, the response of a slow one would be a small difference of large numbers.
[[gnu::noinline]] inline void drive_entries(const Scalars &scalars, const Motion &motion, double duration) {
    if (!are_pushed(scalars, motion.drive))
        return;
    ComplexArray term = scalars.term, entry = motion.entry;
    Index driven = scalars.driven, terms = terms_of_driven(scalars, duration);
    for (Index k = 0; k < driven; k++)
        term(k) = {0.0, 0.0};
    double factor = 1.0;
    for (Index n = 0; n < terms; n++) {
        factor *= duration * INVERSE[n + 1];
        for (Index k = 0; k < driven; k++) {
            term(k) = next_term(scalars, k, term, motion.drive, n);
            entry(k) += term(k) * factor;
        }
    }
}

// Advances the homogeneous part, the rigid-body coordinates and the clock.
[[gnu::noinline]] inline void move(const Scalars &scalars, const Motion &motion, double duration) {
    ComplexArray growth = scalars.growth;
    exponentials(scalars.exponent, duration, growth);
    for (Index b = 0; b < scalars.blocks.shape[0]; b++) {
        Index first = scalars.blocks(b, 0), last = first + scalars.blocks(b, 1);
        if (last > first)
            move_block(scalars, first, last, motion, duration);
        for (Index k = first; k < last; k++)
            growth(k) = {1.0, 0.0};
    }
    for (Index k = 0; k < scalars.exponent.size(); k++)
        motion.entry(k) *= growth(k);
    if (scalars.driven > 0)
        drive_entries(scalars, motion, duration);
    move_rigid_bodies(scalars, motion, duration);
    motion.clock(0) += duration;
}

// Whether some entries do not stand alone.
[[gnu::always_inline]] inline bool has_blocks(const Scalars &scalars) {
    return scalars.blocks.shape[0] > 0 && scalars.blocks(0, 1) > 0;
}

// Sets one motion to another.
[[gnu::noinline]] inline void copy_motion(const Motion &source, const Motion &target) {
    for (Index k = 0; k < source.entry.size(); k++)
        target.entry(k) = source.entry(k);
    for (Index i = 0; i < source.rigid_body.size(); i++) {
        target.rigid_body(i) = source.rigid_body(i);
        target.rigid_body_rate(i) = source.rigid_body_rate(i);
    }
    for (Index i = 0; i < DRIVE; i++)
        target.drive(i) = source.drive(i);
    target.clock(0) = source.clock(0);
    target.clock(1) = source.clock(1);
}

// Next part of a time (s) in which ten Gauss points integrate products of two motions to rounding.
//
// Their error is below 1e-14 where twice the largest |lambda| times the part is below 6. An entry that has decayed
// since the time began is set to zero, and needs no short parts.
[[gnu::noinline]] inline double next_panel(double elapsed, double remaining, const Scalars &scalars,
                                           const Motion &motion) {
    double fastest = scalars.omega;
    for (Index k = 0; k < scalars.exponent.size(); k++) {
        if (k >= scalars.driven && -scalars.exponent(k).real * elapsed > DECAY_EXPONENT)
            motion.entry(k) = {0.0, 0.0};
        else if (motion.entry(k) != 0.0)
            fastest = larger(fastest, scalars.size(k));
    }
    return fastest * remaining <= 3.0 ? remaining : 3.0 / fastest;
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
        twist += magnitude(p * growth + q * scalars.rigid_body_drive(i) * d(4));
    }
    if (pieces)
        twist *= remaining;
    if (scalars.degree > 1)
        twist += later_bend(scalars, r, d, remaining);
    double fast = 0.0;
    for (Index k = 0; k < active; k++)
        fast += scalars.weight_size(r, k) * size(k);
    scale += fast;
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
            double own = scalars.weight_size(r, k) * size(k);
            value += weight.real * h.real - weight.imag * h.imag;
            rate += weight.real * h_rate.real - weight.imag * h_rate.imag;
            fast = k + 1 < active ? fast - own : 0.0;
            double speed = own * scalars.size(k);
            scale_rate += speed;
            if (k < scalars.driven) {
                pull += (weight * search.power(1, k)).real;
                bend += scalars.weight_size(r, k) * search.drift(1, k);
            } else
                bend += speed * scalars.size(k);
        }
    }
    found(0) = value;
    found(1) = rate;
    if (upper < INFINITE)
        scale += magnitude(upper);
    if (lower > -INFINITE)
        scale += magnitude(lower);
    found(2) = AT_WALL * (scale + 0.1 * scalars.omega * size_of_sine * motion.clock(0));
    found(3) = AT_WALL * scale_rate;
    // at the wall and leaving it with speed: the parabola returns later
    if (up == 0.0 && rate < 0.0)
        up = first_meeting(0.0, rate, bend + pull + twist);
    if (down == 0.0 && rate > 0.0)
        down = first_meeting(0.0, -rate, bend - pull + twist);
    found(4) = upper - value < value - lower ? down : up;
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
        add(p * push + q * growth, p * growth + q * scalars.rigid_body_drive(i) * motion.drive(4));
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
            double twisted = weight * rate * bent + pushed;
            size2 += weight * search.drift(0, k);
            size3 += twisted;
            size4 += rate * twisted + weight * largest_push(scalars, k, ahead[1], ahead[2], ahead[3]);
            continue;
        }
        double own = weight * size(k) * (rate * rate);
        size2 += own;
        size3 += own * rate;
        size4 += own * (rate * rate);
    }
    found(0) = second;
    found(1) = third;
    found(2) = size2;
    found(3) = size3;
    found(4) = size4;
}

// Scalar r at the present time, of the first entries that are active.
[[gnu::always_inline]] inline double value_now(Index r, Index active, Complex phase, const Scalars &scalars,
                                               const Motion &motion) {
    double value = scalars.constant(r) + (scalars.sine(r) * phase).real;
    if (scalars.degree >= 0)
        value += taylor(scalars, r, motion.drive).value;
    for (Index k = 0; k < active; k++) {
        Complex w = scalars.weight(r, k), h = motion.entry(k);
        value += w.real * h.real - w.imag * h.imag;
    }
    for (Index p = 0; p < scalars.rigid_body_given.size(); p++) {
        value += scalars.rigid_body_weight(r, p) * motion.rigid_body(p);
        value += scalars.rigid_body_rate_weight(r, p) * motion.rigid_body_rate(p);
    }
    return value;
}

// Scalar r with its first and second derivative; `power` (3, K) is scratch space.
struct Rates {
    double value, rate, bend;
};
[[gnu::noinline]] inline Rates rates_now(Index r, const Scalars &scalars, const Motion &motion,
                                         const ComplexMatrix &power) {
    double omega = scalars.omega;
    Complex phase = unit_phase(omega, motion.clock), turned = scalars.sine(r) * phase;
    double value = value_now(r, scalars.exponent.size(), phase, scalars, motion);
    double rate = -omega * turned.imag, bend = -(omega * omega) * turned.real;
    if (scalars.degree >= 0) {
        Taylor followed = taylor(scalars, r, motion.drive);
        rate += followed.rate;
        bend += followed.bend;
    }
    differentiate(scalars, motion.entry, motion.drive, 0, power.row(1));
    differentiate(scalars, power.row(1), motion.drive, 1, power.row(2));
    for (Index k = 0; k < scalars.exponent.size(); k++) {
        rate += (scalars.weight(r, k) * power(1, k)).real;
        bend += (scalars.weight(r, k) * power(2, k)).real;
    }
    for (Index p = 0; p < scalars.rigid_body_given.size(); p++) {
        double weight = scalars.rigid_body_weight(r, p), rate_weight = scalars.rigid_body_rate_weight(r, p);
        auto [push, growth] = rigid_body_push(p, scalars, motion);
        rate += weight * motion.rigid_body_rate(p) + rate_weight * push;
        bend += weight * push + rate_weight * growth;
    }
    return {value, rate, bend};
}

} // namespace FEMIMPACT_TARGET
