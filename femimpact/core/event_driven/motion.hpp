// Motion in closed form: a sum of decaying exponentials, rigid-body coordinates, and a drive by pieces or a sine.
#pragma once

#include "exponentials.hpp"
#include "loop_data.hpp"

namespace FEMIMPACT_TARGET {

// Terms of the exponential series of a block, whose steps have a norm below 1; and most of these steps.
constexpr Index TAYLOR = 18, MOST_STEPS = 100'000;

// e^{i theta} of the sine at the present time.
[[gnu::always_inline]] inline Complex unit_phase(double omega, GivenArray clock) {
    auto turn = cosine_and_sine(omega * clock(0) + clock(1));
    return {turn.cosine, turn.sine};
}

// Numbers of each load in `Motion.drive`: ub, ub', s, and the derivatives of s to the fifth.
//
// One load, the first, is what is compiled everywhere below; further ones are added behind it.
constexpr Index DRIVE = 8;

// A sum over the loads behind the first, to which `add` adds one: out of line, since most drives have none.
template <class Add> [[gnu::noinline]] inline double over_further_loads(GivenArray d, Add add) {
    double total = 0.0;
    for (Index h = 1; h * DRIVE < d.size(); h++)
        add(h, total);
    return total;
}

// A sum over all loads, from a first term on.
template <class Add> [[gnu::always_inline]] inline double over_loads(GivenArray d, double total, Add add) {
    add(0, total);
    return d.size() > DRIVE ? total + over_further_loads(d, add) : total;
}

// Acceleration of a rigid-body coordinate by an item of each load; see DRIVE.
[[gnu::always_inline]] inline auto of_rigid_body(Index i, const Scalars &scalars, GivenArray d, Index item) {
    return [=, &scalars](Index h, double &total)
               __attribute__((always_inline)) { total += scalars.rigid_body_drive(h, i) * d(h * DRIVE + item); };
}

// Rate of the growth of that acceleration times a weight.
[[gnu::always_inline]] inline double rigid_body_twist(double weight, Index i, const Scalars &scalars, GivenArray d) {
    double twist = weight * scalars.rigid_body_drive(0, i) * d(4);
    return d.size() > DRIVE ? twist + weight * over_further_loads(d, of_rigid_body(i, scalars, d, 4)) : twist;
}

// Acceleration of a rigid-body coordinate, and its rate.
struct Push {
    double push, growth;
};
[[gnu::always_inline]] inline Push rigid_body_push(Index i, const Scalars &scalars, const Motion &motion) {
    GivenArray d = motion.drive;
    return {over_loads(d, scalars.rigid_body_given(i), of_rigid_body(i, scalars, d, 2)),
            over_loads(d, 0.0, of_rigid_body(i, scalars, d, 3))};
}

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

// Advances the rigid-body coordinates, and the drive where it is in pieces.
[[gnu::always_inline]] inline void move_rigid_bodies(const Scalars &scalars, const Motion &motion, double duration) {
    Array all = motion.drive, y = motion.rigid_body, v = motion.rigid_body_rate;
    for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
        auto [push, growth] = rigid_body_push(i, scalars, motion);
        y(i) += duration * (v(i) + duration * (0.5 * push + duration * growth / 6.0));
        v(i) += duration * (push + 0.5 * duration * growth);
    }
    if (scalars.degree < 0)
        return;
    for (Index h = 0; h * DRIVE < all.size(); h++) {
        Array d = all.part(h * DRIVE, (h + 1) * DRIVE);
        if (scalars.degree > 1) {
            // what the terms from s'' on add to both integrals of s
            double moved = series(d, 0, 4, duration), faster = series(d, 1, 3, duration);
            for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
                y(i) += scalars.rigid_body_drive(h, i) * moved;
                v(i) += scalars.rigid_body_drive(h, i) * faster;
            }
            for (Index i = 0; i < DRIVE - 1; i++)
                d(i) += series(d, i, 1, duration);
        } else {
            d(0) += duration * (d(1) + duration * (0.5 * d(2) + duration * d(3) / 6.0));
            d(1) += duration * (d(2) + 0.5 * duration * d(3));
            d(2) += duration * d(3);
        }
    }
}

// The derivative of some order of what polynomials add to a scalar; of each load the items before `last` count.
[[gnu::always_inline]] inline double derivative(GivenMatrix follow, Index r, GivenArray d, Index order,
                                                Index last = DRIVE) {
    return over_loads(d, 0.0, [=](Index h, double &total) __attribute__((always_inline)) {
        for (Index i = h * DRIVE; i + order < h * DRIVE + last; i++)
            total += follow(i, r) * d(i + order);
    });
}

// What a polynomial adds to a scalar: the value and its first three derivatives.
struct Taylor {
    double value, rate, bend, twist;
};
[[gnu::always_inline]] inline Taylor taylor(const Scalars &scalars, Index r, GivenArray d) {
    // of a line all others are zero
    const Index last = scalars.degree > 1 ? DRIVE : 4;
    return {derivative(scalars.follow, r, d, 0, last), derivative(scalars.follow, r, d, 1, last),
            derivative(scalars.follow, r, d, 2, last), derivative(scalars.follow, r, d, 3, last)};
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
    if (order == 0)
        total += scalars.given(k);
    // of forces s alone pushes
    for (Index h = 1; h * DRIVE < d.size() && order + 2 < DRIVE; h++)
        total += scalars.load(3 * h, k) * d(h * DRIVE + order + 2);
    return total;
}

// Sets `out` to Lambda times some derivative of the entries, and what a polynomial adds to that of driven ones.
[[gnu::always_inline]] inline void differentiate(const Scalars &scalars, GivenComplexArray entry, GivenArray d,
                                                 Index order, ComplexArray out) {
    multiply(scalars, entry, out);
    for (Index k = 0; k < scalars.driven; k++)
        out(k) += push_on_entry(scalars, k, d, order);
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
    for (Index i = 2; i < d.size(); i++)
        found = found || d(i) != 0.0;
    for (Index k = 0; k < scalars.driven; k++)
        found = found || scalars.load(1, k) != 0.0 || scalars.load(2, k) != 0.0 || scalars.given(k) != 0.0;
    return found && scalars.driven > 0;
}

// Adds what a polynomial does to driven entries in a time, and constant loads to slow ones: the rest of `move` leaves
// it out.
//
// H' = Lambda H + F has the Taylor series of c_0 = 0, c_{n+1} = Lambda c_n + F^(n). An entry that is slow beside the
// polynomial has all of its response; of a fast one the response that is a polynomial itself is apart (`follow`), and
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

// Sets one array to another as long, and one motion to another.
template <class T> [[gnu::always_inline]] inline void copy(View<const T, 1> source, View<T, 1> target) {
    for (Index k = 0; k < source.size(); k++)
        target(k) = source(k);
}
[[gnu::noinline]] inline void copy_motion(const Motion &source, const Motion &target) {
    copy<Complex>(source.entry, target.entry);
    copy<double>(source.rigid_body, target.rigid_body);
    copy<double>(source.rigid_body_rate, target.rigid_body_rate);
    copy<double>(source.clock, target.clock);
    copy<double>(source.drive, target.drive);
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
