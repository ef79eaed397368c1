// Work and losses of motions by exponentials: exact integrals of the products of two terms.
#pragma once

#include "states.hpp"

namespace FEMIMPACT_TARGET {

// Adds work of the base, the first of several drives: of what holds stops in space too.
[[gnu::always_inline]] inline void add_work_of_base(double work, const Case &c, const Ledger &b) {
    b.work(c.number) += work;
    b.work_of(c.number, 0) += work;
}

// Integral of e^{mu s} over the duration, growth being e^{mu duration}; a series where mu is small.
[[gnu::always_inline]] inline Complex integral_of(Complex exponent, Complex growth, double duration) {
    Complex z = exponent * duration;
    if (z.real * z.real + z.imag * z.imag < 1e-4) {
        Complex series = 1.0 + z / 7.0;
        for (Index n = 6; n >= 2; n--)
            series = 1.0 + z / double(n) * series;
        return duration * series;
    }
    return (growth - 1.0) / exponent;
}

// Integral of s e^{mu s} over the duration.
[[gnu::always_inline]] inline Complex first_moment(Complex exponent, Complex growth, double duration) {
    Complex z = exponent * duration;
    if (z.real * z.real + z.imag * z.imag < 1e-2) {
        Complex series = 1 / 840.0 + z / 5760.0;
        series = 1 / 144.0 + z * series;
        series = 1 / 30.0 + z * series;
        series = 1 / 8.0 + z * series;
        series = 1 / 3.0 + z * series;
        series = 1 / 2.0 + z * series;
        return duration * duration * series;
    }
    return (duration * growth - (growth - 1.0) / exponent) / exponent;
}

// Integral of the square of a motion given by the strengths of its terms.
inline double square_of(GivenComplexArray a, const ComplexMatrix &plus, const ComplexMatrix &minus, Index terms) {
    double total = 0.0;
    for (Index k = 0; k < terms; k++) {
        if (a(k) == 0.0)
            continue;
        total += 0.5 * (a(k) * (a(k) * plus(k, k) + conjugate(a(k)) * minus(k, k))).real;
        for (Index m = k + 1; m < terms; m++)
            if (a(m) != 0.0)
                total += (a(k) * (a(m) * plus(k, m) + conjugate(a(m)) * minus(k, m))).real;
    }
    return total;
}

// Exponent of a term: the entries, then the sine, then what is constant.
[[gnu::always_inline]] inline Complex exponent_of(Index k, const Scalars &scalars) {
    Index entries = scalars.exponent.size();
    if (k < entries)
        return scalars.exponent(k);
    return {0.0, k == entries ? scalars.omega : 0.0};
}

// Sets the integrals of e^{mu_k s} e^{mu_m s} and of e^{mu_k s} conj(e^{mu_m s}) over the duration.
//
// Those of driven entries are left out: the integrals of what these move are sums over points.
[[gnu::noinline]] inline void integrate_terms(const Scalars &scalars, View<const unsigned char, 2> together,
                                              double duration, Index terms, const Products &s) {
    Index entries = scalars.exponent.size();
    exponentials(scalars.exponent, duration, s.growth);
    auto [cosine, sine] = cosine_and_sine(scalars.omega * duration);
    s.growth(entries) = {cosine, sine};
    if (terms > entries + 1)
        s.growth(entries + 1) = {1.0, 0.0};
    for (Index k = scalars.driven; k < terms; k++) {
        Complex e = exponent_of(k, scalars);
        for (Index m = k; m < terms; m++) {
            if (m < entries && !together(k, m))
                continue;
            Complex other = exponent_of(m, scalars);
            s.plus(k, m) = integral_of(e + other, s.growth(k) * s.growth(m), duration);
            s.minus(k, m) = integral_of(e + conjugate(other), s.growth(k) * conjugate(s.growth(m)), duration);
            s.plus(m, k) = s.plus(k, m);
            s.minus(m, k) = conjugate(s.minus(k, m));
        }
    }
}

// Sets the strengths of the terms of every coordinate's velocity.
[[gnu::noinline]] inline void set_strengths(Index terms, const Form &form, Index coordinates, const Space &space) {
    const Scalars &scalars = form.scalars;
    const Shapes &shapes = form.shapes;
    const Motion &mark = space.mark;
    Index entries = scalars.exponent.size();
    Complex phase = unit_phase(scalars.omega, mark.clock);
    for (Index i = 0; i < coordinates; i++) {
        ComplexArray strength = space.products.strength.row(i);
        for (Index k = 0; k < terms; k++)
            strength(k) = {0.0, 0.0};
        for (Index m = shapes.first(i); m < shapes.first(i + 1); m++) {
            Index k = shapes.members(m);
            if (k >= scalars.driven)
                strength(k) = shapes.shape_rate(i, k) * mark.entry(k);
        }
        Complex harmonic = shapes.harmonic(i);
        for (Index p = 0; p < shapes.rigid_bodies; p++)
            harmonic -= shapes.rigid_body_shape(i, p) * form.rigid_body_sine(p);
        strength(entries) = Complex{0.0, scalars.omega} * harmonic * phase;
        if (scalars.degree == 0 || scalars.degree == 1)
            strength(entries + 1) = {shapes.follow(2, i) * mark.drive(3), 0.0};
    }
}

// Adds to a number the integral of something times a coordinate's velocity, from that of it times each term that has a
// strength.
template <class Along>
[[gnu::always_inline]] inline double add_terms(double total, Index first, Index terms, GivenComplexArray strength,
                                               Along along) {
    for (Index k = first; k < terms; k++)
        if (strength(k) != 0.0)
            total += (strength(k) * along(k)).real;
    return total;
}

// Integral of a sine, of which `wave` is e^{i theta} times -i amplitude at the mark, times a coordinate's velocity.
[[gnu::always_inline]] inline double work_under_sine(Complex wave, GivenComplexArray strength, Index terms, Index sine,
                                                     const Products &s) {
    return 0.5 * add_terms(0.0, 0, terms, strength,
                           [&](Index k) { return wave * s.plus(k, sine) + conjugate(wave) * s.minus(k, sine); });
}

// The same of a line, of which `drive` has the value and the rate.
[[gnu::always_inline]] inline double work_under_line(GivenArray drive, GivenComplexArray strength, Index terms,
                                                     double duration, const Scalars &scalars, const Products &s) {
    return add_terms(0.0, 0, terms, strength, [&](Index k) {
        Complex e = exponent_of(k, scalars);
        return drive(2) * integral_of(e, s.growth(k), duration) + drive(3) * first_moment(e, s.growth(k), duration);
    });
}

// Adds the work of each of several sines on a coordinate; returns that of their sum, which may cancel.
[[gnu::noinline]] inline double add_work_of_sines(Index i, GivenComplexArray strength, Index terms, Complex phase,
                                                  Index sine, const Case &c, const Products &s, const Ledger &b) {
    Complex of_all = {0.0, 0.0};
    for (Index k = 0; k < b.drive_load.shape[0]; k++) {
        Complex wave = b.drive_load(k, i) * (Complex{0.0, -1.0} * b.drive_amplitude(k) * phase);
        of_all += wave;
        b.work_of(c.number, k) += work_under_sine(wave, strength, terms, sine, s);
    }
    return work_under_sine(of_all, strength, terms, sine, s);
}

// Work of constant forces on a coordinate, which stands beside that of several drives.
[[gnu::always_inline]] inline double add_work_of_constant(Index i, const Case &c, const Products &s, const Ledger &b) {
    double work = b.given(i) * (s.after(0, i) - s.before(0, i));
    if (b.drive_load.shape[0] > 0)
        b.work_of(c.number, b.drive_load.shape[0]) += work;
    return work;
}

// Adds the work on what the entries move, and the loss of every mode.
[[gnu::noinline]] inline void sum_products(Index terms, double duration, const Form &form, const Case &c,
                                           const Space &space, const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Products &s = space.products;
    Index entries = scalars.exponent.size();
    Array drive = space.mark.drive;
    // s(t) = amplitude sin(theta) = Re(-i amplitude e^{i theta}), or s + s' t
    Complex phase = unit_phase(scalars.omega, space.mark.clock);
    Complex wave = Complex{0.0, -c.amplitude(0).real} * phase;
    double work = 0.0;
    for (Index i = 0; i < b.mass.size(); i++) {
        ComplexArray strength = s.strength.row(i);
        double of_drives = b.drive_load.shape[0] > 0 ? add_work_of_sines(i, strength, terms, phase, entries, c, s, b)
                           : scalars.degree < 0
                               ? b.load(i) * work_under_sine(wave, strength, terms, entries, s)
                               : b.load(i) * work_under_line(drive, strength, terms, duration, scalars, s);
        work += of_drives + add_work_of_constant(i, c, s, b);
        if (b.damping(i) > 0.0)
            b.loss_of_mode(c.number, i) += b.damping(i) * square_of(strength, s.plus, s.minus, terms);
    }
    b.work(c.number) += work;
}

// Integral of the square of a pair's relative speed; its row of strengths holds that speed's terms.
[[gnu::noinline]] inline double square_of_rate(Index j, Index terms, const Pairs &pairs, const Products &s) {
    Index d = s.before.shape[1];
    ComplexArray rate = s.strength.row(d + j);
    for (Index k = 0; k < terms; k++) {
        rate(k) = {0.0, 0.0};
        for (Index i = 0; i < d; i++)
            rate(k) -= pairs.direction(j, i) * s.strength(i, k);
    }
    return square_of(rate, s.plus, s.minus, terms);
}

// Loss of one contact; adds the work of its force on every mode.
[[gnu::noinline]] inline double add_contact_work(Index j, Index terms, const Scalars &scalars, const Pairs &pairs,
                                                 const Case &c, const Space &space) {
    const Products &s = space.products;
    const Motion &mark = space.mark;
    Index d = s.before.shape[1], entries = scalars.exponent.size(), r = c.state.size() + j;
    Index modes = c.to_modes.shape[1];
    double loss = c.damping(j) * square_of_rate(j, terms, pairs, s);
    // the loss is summed: its row may now hold the force
    ComplexArray force = s.strength.row(d + j);
    for (Index k = 0; k < entries; k++)
        force(k) = scalars.weight(r, k) * mark.entry(k);
    force(entries) = scalars.sine(r) * unit_phase(scalars.omega, mark.clock);
    for (Index m = 0; m < terms; m++) {
        // the integral of the force times e^{mu s}, and times its conjugate
        Complex along = {0.0, 0.0}, against = {0.0, 0.0};
        for (Index k = 0; k < terms; k++)
            if (force(k) != 0.0) {
                along += force(k) * s.plus(k, m);
                against += force(k) * s.minus(k, m);
            }
        for (Index i = 0; i < modes; i++) {
            Complex strength = s.strength(i, m);
            double work = 0.5 * (strength * along + conjugate(strength) * against).real;
            c.to_modes(j, i) += pairs.direction(j, i) * work;
        }
    }
    for (Index i = 0; i < modes; i++)
        c.to_modes(j, i) += pairs.direction(j, i) * scalars.constant(r) * (s.after(0, i) - s.before(0, i));
    return loss;
}

} // namespace FEMIMPACT_TARGET
