// Work and losses under a drive by polynomials: exact moments of exponentials, and Taylor series of driven entries.
#pragma once

#include "gauss.hpp"
#include "ledger_products.hpp"

namespace FEMIMPACT_TARGET {

// Powers of the time that a polynomial of the drive has.
constexpr Index POWERS = 6;

// Terms of the series of `set_moments` for small and for larger exponents.
constexpr Index FEW_TERMS = 10, SOME_TERMS = 15, MANY_TERMS = 22;

// 6!/(n + 6)!
struct SeriesOfMoments {
    double values[MANY_TERMS + 1];
    constexpr SeriesOfMoments() : values{} {
        values[0] = 1.0;
        for (Index n = 1; n <= MANY_TERMS; n++)
            values[n] = values[n - 1] / double(n + POWERS);
    }
    constexpr double operator[](Index n) const { return values[n]; }
};
constexpr SeriesOfMoments SERIES;

// Sets `out` to the integrals of s^j/j! e^{mu s} over the duration, j = 0 to 5, growth being e^{mu duration}.
//
// By parts from the lowest power up where mu is large; else from the series of the highest one down, which is stable
// there, of the same integral from its end on.
[[gnu::noinline]] inline void set_moments(Complex exponent, Complex growth, double duration, ComplexArray out) {
    Complex z = exponent * (-duration);
    double size = z.real * z.real + z.imag * z.imag;
    if (size > 9.0) {
        double power = 1.0;
        Complex inverse = Complex{1.0, 0.0} / exponent;
        out(0) = (growth - 1.0) * inverse;
        for (Index j = 1; j < POWERS; j++) {
            power *= duration / double(j);
            out(j) = (power * growth - out(j - 1)) * inverse;
        }
        return;
    }
    // 6! times the sum of z^n/(n + 6)!
    Complex total = {0.0, 0.0};
    for (Index n = size < 0.25 ? FEW_TERMS : size < 2.0 ? SOME_TERMS : MANY_TERMS; n >= 0; n--)
        total = SERIES[n] + z * total;
    total *= INVERSE_FACTORIAL[POWERS];
    for (Index j = POWERS - 1; j >= 0; j--) {
        out(j) = total;
        total = INVERSE_FACTORIAL[j] + z * total;
    }
    double power = duration;
    for (Index j = 0; j < POWERS; j++) {
        out(j) = power * growth * out(j);
        power *= duration;
    }
}

// Sets the values at the Gauss points of a polynomial by its derivatives at the beginning.
//
// Points advance side by side, here and below: none waits for another.
[[gnu::always_inline]] inline void set_values(const double *derivatives, const double *times, double *values) {
    for (Index node = 0; node < GAUSS_POINTS; node++)
        values[node] = derivatives[POWERS - 1] * INVERSE_FACTORIAL[POWERS - 1];
    for (Index j = POWERS - 2; j >= 0; j--)
        for (Index node = 0; node < GAUSS_POINTS; node++)
            values[node] = derivatives[j] * INVERSE_FACTORIAL[j] + values[node] * times[node];
}

// Adds the values of a Taylor series to those at the Gauss points.
[[gnu::always_inline]] inline void add_series(GivenArray terms, Index count, const double *times, double *values) {
    double total[GAUSS_POINTS] = {};
    for (Index n = count - 1; n >= 0; n--)
        for (Index node = 0; node < GAUSS_POINTS; node++)
            total[node] = terms(n) + times[node] * total[node];
    for (Index node = 0; node < GAUSS_POINTS; node++)
        values[node] += total[node];
}

[[gnu::always_inline]] inline double integral_of_product(const double *one, const double *other, double duration) {
    double total = 0.0;
    for (Index node = 0; node < GAUSS_POINTS; node++)
        total += WEIGHTS[node] * one[node] * other[node];
    return 0.5 * duration * total;
}

// Whether driven entries, which are the first ones, move a coordinate.
[[gnu::always_inline]] inline bool is_moved_by_driven(const Shapes &shapes, Index i, Index driven) {
    return shapes.first(i) < shapes.first(i + 1) && shapes.members(shapes.first(i)) < driven;
}

// Whether driven and other entries move the same coordinate.
[[gnu::always_inline]] inline bool are_mixed(const Shapes &shapes, Index driven, Index coordinates) {
    for (Index i = 0; driven > 0 && i < coordinates; i++) {
        if (is_moved_by_driven(shapes, i, driven) && shapes.members(shapes.first(i + 1) - 1) >= driven)
            return true;
    }
    return false;
}

// Sets the rates of what driven entries move, as the Taylor series of each coordinate; `term` is scratch space.
[[gnu::noinline]] inline void set_driven_rates(Index terms, const Form &form, const Space &space, const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Shapes &shapes = form.shapes;
    ComplexArray term = scalars.term;
    for (Index k = 0; k < scalars.driven; k++)
        term(k) = space.mark.entry(k);
    double factor = 1.0;
    for (Index n = 0; n < terms; n++) {
        for (Index i = 0; i < b.mass.size(); i++) {
            if (!is_moved_by_driven(shapes, i, scalars.driven))
                continue;
            double total = 0.0;
            for (Index m = shapes.first(i); m < shapes.first(i + 1) && shapes.members(m) < scalars.driven; m++)
                total += (shapes.shape_rate(i, shapes.members(m)) * term(shapes.members(m))).real;
            space.products.rates(i, n) = total * factor;
        }
        for (Index k = 0; k < scalars.driven; k++)
            term(k) = next_term(scalars, k, term, space.mark.drive, n);
        factor *= INVERSE[n + 1];
    }
}

// A coordinate's velocity under a polynomial: its values at the Gauss points, and the strengths of the other terms.
struct Velocity {
    const double *values;
    GivenComplexArray strength;
    Index first, terms; // of the strengths that count
};

// Adds to a number the integral of a polynomial, by its derivatives, times the exponentials in a coordinate's velocity.
[[gnu::always_inline]] inline double add_exponentials(double total, const double *derivatives, const Velocity &v,
                                                      const Products &s) {
    return add_terms(total, v.first, v.terms, v.strength, [&](Index k) {
        Complex by_drive = {0.0, 0.0};
        for (Index j = 0; j < POWERS; j++)
            by_drive += derivatives[j] * s.moments(k, j);
        return by_drive;
    });
}

// Integral of a polynomial, by its values at the Gauss points and its derivatives, times a coordinate's velocity.
[[gnu::always_inline]] inline double work_under_polynomial(const double *derivatives, const double *values,
                                                           const Velocity &v, double duration, const Products &s) {
    return add_exponentials(integral_of_product(values, v.values, duration), derivatives, v, s);
}

// Adds the work of each of several drives on a coordinate; returns that of their sum, which may cancel.
[[gnu::noinline]] inline double add_work_of_polynomials(Index i, const Velocity &v, const double *times,
                                                        double duration, double mark, const Case &c, const Products &s,
                                                        const Ledger &b) {
    double of_all[POWERS] = {}, derivatives[POWERS], values[GAUSS_POINTS];
    Index piece = c.piece(0);
    double later = mark - c.knots(piece);
    for (Index k = 0; k < b.drive_load.shape[0]; k++) {
        double load = b.drive_load(k, i);
        if (load == 0.0)
            continue;
        for (Index n = 0; n < POWERS; n++) {
            double total = 0.0;
            for (Index m = POWERS - 1; m >= n; m--)
                total = b.drive_pieces(piece, POWERS * k + m) * INVERSE_FACTORIAL[m - n] + total * later;
            derivatives[n] = load * total;
            of_all[n] += derivatives[n];
        }
        set_values(derivatives, times, values);
        b.work_of(c.number, k) += work_under_polynomial(derivatives, values, v, duration, s);
    }
    set_values(of_all, times, values);
    return work_under_polynomial(of_all, values, v, duration, s);
}

// Adds the work on what the entries move, and the loss of every mode, under a polynomial.
[[gnu::noinline]] inline void sum_polynomials(Index terms, double duration, const Form &form, const Case &c,
                                              const Space &space, const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Products &s = space.products;
    Array drive = space.mark.drive;
    for (Index k = scalars.driven; k < terms; k++)
        set_moments(scalars.exponent(k), s.growth(k), duration, s.moments.row(k));
    Index series = 0;
    if (scalars.driven > 0) {
        series = terms_of_driven(scalars, duration);
        set_driven_rates(series, form, space, b);
    }
    double times[GAUSS_POINTS], acting[GAUSS_POINTS], steady[GAUSS_POINTS], work = 0.0;
    for (Index node = 0; node < GAUSS_POINTS; node++)
        times[node] = 0.5 * duration * (1.0 + NODES[node]);
    set_values(&drive(2), times, acting);
    for (Index i = 0; i < b.mass.size(); i++) {
        ComplexArray strength = s.strength.row(i);
        double rates[POWERS];
        for (Index j = 0; j < POWERS; j++)
            rates[j] = derivative(form.shapes.follow_rate, i, drive, j);
        set_values(rates, times, steady);
        // driven entries and others move no coordinate together: else points would be summed
        bool is_driven = is_moved_by_driven(form.shapes, i, scalars.driven);
        if (is_driven)
            add_series(s.rates.row(i), series, times, steady);
        Velocity velocity = {steady, strength, is_driven ? terms : scalars.driven, terms};
        double of_drives = b.drive_load.shape[0] > 0
                               ? add_work_of_polynomials(i, velocity, times, duration, space.mark.clock(0), c, s, b)
                               : b.load(i) * work_under_polynomial(&drive(2), acting, velocity, duration, s);
        work += of_drives + add_work_of_constant(i, c, s, b);
        if (b.damping(i) > 0.0) {
            double twice = add_exponentials(0.0, rates, velocity, s);
            double square = integral_of_product(steady, steady, duration) + 2.0 * twice;
            if (!is_driven)
                square += square_of(strength, s.plus, s.minus, terms);
            b.loss_of_mode(c.number, i) += b.damping(i) * square;
        }
    }
    b.work(c.number) += work;
}

} // namespace FEMIMPACT_TARGET
