// The energy ledger between events: exact integrals of products of exponentials, or Gauss points where terms mix.
#pragma once

#include "../contact/formulas.hpp"
#include "states.hpp"

namespace FEMIMPACT_TARGET {

// Rounding of a displacement as a share of the terms that make it.
constexpr double PLACES = 16.0 * 2.220446049250313e-16;

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

// Whether a compliant contact has begun and not ended.
[[gnu::always_inline]] inline bool any_compliant(const Case &c, const Pairs &pairs) {
    bool found = false;
    for (Index j = 0; j < c.state.size(); j++)
        found = found || (c.state(j) != FREE && !pairs.rigid(j));
    return found;
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

// Adds the work on what the entries move, and the loss of every mode.
[[gnu::noinline]] inline void sum_products(Index terms, double duration, const Form &form, const Case &c,
                                           const Space &space, const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Products &s = space.products;
    Index entries = scalars.exponent.size();
    Array drive = space.mark.drive;
    // s(t) = amplitude sin(theta) = Re(-i amplitude e^{i theta}), or s + s' t
    Complex wave = Complex{0.0, -c.amplitude} * unit_phase(scalars.omega, space.mark.clock);
    double work = 0.0;
    for (Index i = 0; i < b.mass.size(); i++) {
        ComplexArray strength = s.strength.row(i);
        double driven = 0.0;
        for (Index k = 0; k < terms; k++) {
            if (strength(k) == 0.0)
                continue;
            if (scalars.degree >= 0) {
                Complex e = exponent_of(k, scalars);
                Complex both = drive(2) * integral_of(e, s.growth(k), duration);
                driven += (strength(k) * (both + drive(3) * first_moment(e, s.growth(k), duration))).real;
            } else {
                Complex both = wave * s.plus(k, entries) + conjugate(wave) * s.minus(k, entries);
                driven += 0.5 * (strength(k) * both).real;
            }
        }
        work += b.load(i) * driven + b.given(i) * (s.after(0, i) - s.before(0, i));
        if (b.damping(i) > 0.0)
            b.loss_of_mode(c.number, i) += b.damping(i) * square_of(strength, s.plus, s.minus, terms);
    }
    b.work(c.number) += work;
}

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
        double driven = integral_of_product(acting, steady, duration), twice = 0.0;
        for (Index k = scalars.driven; !is_driven && k < terms; k++) {
            if (strength(k) == 0.0)
                continue;
            Complex by_drive = {0.0, 0.0}, by_rate = {0.0, 0.0};
            for (Index j = 0; j < POWERS; j++) {
                by_drive += drive(2 + j) * s.moments(k, j);
                by_rate += rates[j] * s.moments(k, j);
            }
            driven += (strength(k) * by_drive).real;
            twice += (strength(k) * by_rate).real;
        }
        work += b.load(i) * driven + b.given(i) * (s.after(0, i) - s.before(0, i));
        if (b.damping(i) > 0.0) {
            double own = integral_of_product(steady, steady, duration) + 2.0 * twice;
            if (!is_driven)
                own += square_of(strength, s.plus, s.minus, terms);
            b.loss_of_mode(c.number, i) += b.damping(i) * own;
        }
    }
    b.work(c.number) += work;
}

// What its drive does on a rigid-body coordinate of unit mass: all that its kinetic energy gains.
//
// The work of constant forces is in that of the coordinates already.
[[gnu::always_inline]] inline double work_on_rigid_body(Index p, const Form &form, const Motion &mark,
                                                        const Motion &motion) {
    const Scalars &scalars = form.scalars;
    double before = mark.rigid_body_rate(p), after = motion.rigid_body_rate(p);
    double increment = motion.rigid_body(p) - mark.rigid_body(p);
    if (scalars.degree < 0) {
        Complex turned = form.rigid_body_sine(p);
        Complex was = turned * unit_phase(scalars.omega, mark.clock);
        Complex now = turned * unit_phase(scalars.omega, motion.clock);
        before -= scalars.omega * was.imag;
        after -= scalars.omega * now.imag;
        increment += now.real - was.real;
    }
    return 0.5 * (after * after - before * before) - form.load_on_rigid_body(p, 0) * increment;
}

// Loss of one contact; adds the work of its force on every mode.
[[gnu::noinline]] inline double add_contact_work(Index j, Index terms, const Scalars &scalars, const Pairs &pairs,
                                                 const Case &c, const Space &space) {
    const Products &s = space.products;
    const Motion &mark = space.mark;
    Index d = s.before.shape[1], entries = scalars.exponent.size(), r = c.state.size() + j;
    Index modes = c.to_modes.shape[1];
    ComplexArray rate = s.strength.row(d + j);
    for (Index k = 0; k < terms; k++) {
        rate(k) = {0.0, 0.0};
        for (Index i = 0; i < d; i++)
            rate(k) -= pairs.direction(j, i) * s.strength(i, k);
    }
    double loss = c.damping(j) * square_of(rate, s.plus, s.minus, terms);
    // the loss is summed: its row may now hold the force
    ComplexArray force = rate;
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

// Adds work and losses by Gauss points, exact to rounding; uses `after` up.
[[gnu::noinline]] inline void sum_over_points(double duration, const Form &form, const Pairs &pairs, const Case &c,
                                              const Space &space, const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Motion &spare = space.spare;
    Matrix after = space.products.after;
    copy_motion(space.mark, spare);
    double start = space.mark.clock(0), elapsed = 0.0;
    while (elapsed < duration) {
        double panel = next_panel(elapsed, duration - elapsed, scalars, spare), half = 0.5 * panel;
        for (Index node = 0; node < GAUSS_POINTS; node++) {
            double time = start + elapsed + half * (1.0 + NODES[node]), share = half * WEIGHTS[node];
            move(scalars, spare, time - spare.clock(0));
            read_coordinates(form.shapes, spare, after);
            Complex phase = unit_phase(scalars.omega, spare.clock);
            double acting = scalars.degree >= 0 ? spare.drive(2) : c.amplitude * phase.imag;
            double base_rate = base_motion(c, spare).rate;
            for (Index i = 0; i < b.mass.size(); i++) {
                double v = after(1, i);
                b.work(c.number) += share * (b.load(i) * acting + b.given(i)) * v;
                if (b.damping(i) > 0.0)
                    b.loss_of_mode(c.number, i) += share * b.damping(i) * v * v;
            }
            for (Index j = 0; j < c.state.size(); j++) {
                if (!is_active(c.state(j)))
                    continue;
                double force = value_now(c.state.size() + j, scalars.exponent.size(), phase, scalars, spare);
                // what holds a stop in space does work where the stop moves against the base
                b.work(c.number) -= share * force * pairs.in_space(j) * base_rate;
                if (pairs.rigid(j))
                    continue;
                double rate = gap_of(j, pairs, after.row(1), base_rate);
                double loss = share * c.damping(j) * rate * rate;
                b.contact_loss(c.number) += loss;
                c.touch(LOST, j) += loss;
                for (Index i = 0; i < c.to_modes.shape[1]; i++)
                    c.to_modes(j, i) += share * pairs.direction(j, i) * force * after(1, i);
            }
        }
        elapsed += panel;
    }
}

// Energy in a compliant wall.
[[gnu::noinline]] inline double stored_in_wall(Index j, const Pairs &pairs, const Case &c, GivenArray position,
                                               double base) {
    double x = gap_of(j, pairs, position, base), side = side_of(c.state(j));
    return spring_potential(larger(side * x - gap_on(side, j, c), 0.0), c.stiffness(j));
}

// Loss of walls that spring back without force behind what leaves them.
[[gnu::always_inline]] inline double add_separating(const Pairs &pairs, const Case &c, const Space &space) {
    const Products &s = space.products;
    double loss = 0.0, was = base_motion(c, space.mark).position, base = base_motion(c, space.motion).position;
    for (Index j = 0; j < c.state.size(); j++)
        if (magnitude(c.state(j)) == SEPARATING) {
            double lost =
                stored_in_wall(j, pairs, c, s.before.row(0), was) - stored_in_wall(j, pairs, c, s.after.row(0), base);
            loss += lost;
            c.touch(LOST, j) += lost;
        }
    return loss;
}

// Bound on what rounding makes of the energies of contacts.
//
// x = y - w is known to some units in the last place of y, w and the gap, and so the contact's energy to its largest
// force times that.
[[gnu::always_inline]] inline double rounding_of_contacts(const Pairs &pairs, const Case &c, const Matrix &state) {
    double total = 0.0;
    for (Index j = 0; j < c.state.size(); j++)
        if (c.state(j) != FREE && !pairs.rigid(j)) {
            double size = magnitude(gap_on(c.state(j), j, c));
            for (Index i = 0; i < state.shape[1]; i++)
                size += magnitude(pairs.direction(j, i) * state(0, i));
            total += PLACES * size * c.touch(LARGEST_FORCE, j);
        }
    return total;
}

// Adds work, losses, and what contacts give to modes, from the mark to the present motion; sets the mark there.
[[gnu::noinline]] inline void add_to_ledger(const Form &form, const Pairs &pairs, const Case &c, const Space &space,
                                            const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Products &s = space.products;
    const Motion &mark = space.mark, &motion = space.motion;
    double duration = motion.clock(0) - mark.clock(0);
    bool active = false, moving = false;
    for (Index j = 0; j < c.state.size(); j++) {
        active = active || is_active(c.state(j));
        moving = moving || (is_active(c.state(j)) && pairs.in_space(j) != 0.0);
    }
    bool touching = any_compliant(c, pairs);
    read_coordinates(form.shapes, motion, s.after);
    if (duration > 0.0) {
        read_coordinates(form.shapes, mark, s.before);
        if (touching)
            b.contact_loss(c.number) += add_separating(pairs, c, space);
        if (has_blocks(scalars) || moving || (scalars.degree >= 0 && active) ||
            are_mixed(form.shapes, scalars.driven, b.mass.size())) {
            sum_over_points(duration, form, pairs, c, space, b);
            read_coordinates(form.shapes, motion, s.after);
        } else {
            bool polynomial = scalars.degree > 1;
            Index terms = scalars.exponent.size() + (polynomial ? 0 : scalars.degree >= 0 ? 2 : 1);
            integrate_terms(scalars, form.together, duration, terms, s);
            set_strengths(terms, form, b.mass.size(), space);
            if (b.everywhere) {
                if (polynomial)
                    sum_polynomials(terms, duration, form, c, space, b);
                else
                    sum_products(terms, duration, form, c, space, b);
                for (Index p = 0; p < form.shapes.rigid_bodies; p++)
                    b.work(c.number) += work_on_rigid_body(p, form, mark, motion);
            }
            for (Index j = 0; j < c.state.size(); j++)
                if (is_active(c.state(j)) && !pairs.rigid(j)) {
                    double loss = add_contact_work(j, terms, scalars, pairs, c, space);
                    b.contact_loss(c.number) += loss;
                    c.touch(LOST, j) += loss;
                }
        }
        if (touching)
            b.rounding(c.number) += rounding_of_contacts(pairs, c, s.after);
    }
    copy_motion(motion, mark);
}

// Sets `out` to the energies of the coordinates given (kinetic, strain, of balls, of contacts, work, losses of the
// structure and of contacts), then the loss of every mode.
[[gnu::noinline]] inline void write_energy(const Pairs &pairs, const Case &c, const Motion &motion, const Matrix &state,
                                           const Ledger &b, Array out) {
    Index n = b.loss_of_mode.shape[1];
    double base = base_motion(c, motion).position;
    out(0) = out(1) = out(2) = out(3) = out(5) = 0.0;
    for (Index i = 0; i < b.mass.size(); i++) {
        double kinetic = 0.5 * b.mass(i) * (state(1, i) * state(1, i));
        if (i < n) {
            out(0) += kinetic;
            out(1) += 0.5 * b.stiffness(i) * (state(0, i) * state(0, i));
            out(5) += b.loss_of_mode(c.number, i);
            out(7 + i) = b.loss_of_mode(c.number, i);
        } else
            out(2) += kinetic;
    }
    for (Index j = 0; j < c.state.size(); j++) {
        out(3) += spring_potential(gap_of(j, pairs, state.row(0), base), b.free_stiffness(j));
        if (c.state(j) != FREE && !pairs.rigid(j))
            out(3) += stored_in_wall(j, pairs, c, state.row(0), base);
    }
    out(4) = b.work(c.number);
    out(6) = b.contact_loss(c.number);
}

} // namespace FEMIMPACT_TARGET
