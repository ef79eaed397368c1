// Closed forms of the contact states that have occurred, and how a motion is taken from one to another.
#pragma once

#include "bounds.hpp"

namespace FEMIMPACT_TARGET {

// Distance of an undamped natural frequency from that of the drive, as a share of it, below which they are one.
constexpr double RESONANCE = 1e-9;

// Side of the wall of a pair in contact or separating.
[[gnu::always_inline]] inline double side_of(double state) {
    return state > 0.0 ? 1.0 : -1.0;
}

// Gap (m) of a pair on one side.
[[gnu::always_inline]] inline double gap_on(double side, Index j, const Case &c) {
    return side > 0.0 ? c.gap_plus(j) : c.gap_minus(j);
}

// Whether a pair is in contact.
[[gnu::always_inline]] inline bool is_active(double state) {
    return magnitude(state) == CONTACT;
}

// Number of the closed form for these contact states, or -1 if it was not made before.
[[gnu::always_inline]] inline Index find_form(GivenArray state, Index first, const Forms &forms) {
    Index key = 0;
    for (Index j = 0; j < state.size(); j++)
        if (is_active(state(j)))
            key |= Index(1) << j;
    Index f = first;
    while (0 <= f && f < forms.made && forms.key(f) != key)
        f = forms.following(f);
    return f < forms.made ? f : -1;
}

// Displacement and velocity of the base, by which stops fixed in space move against it.
struct BaseMotion {
    double position, rate;
};
[[gnu::always_inline]] inline BaseMotion base_motion(const Case &c, const Motion &motion) {
    double omega = c.omega;
    if (omega == 0.0)
        return {motion.drive(0), motion.drive(1)};
    // s = amplitude sin(theta) is the second derivative
    Complex phase = unit_phase(omega, motion.clock);
    double amplitude = c.amplitude(0).real;
    return {-amplitude * phase.imag / (omega * omega), -amplitude * phase.real / omega};
}

// Adds a value, or is it: a zero before it would have a sign.
[[gnu::always_inline]] inline void put(Complex &sum, Complex value, bool first) {
    sum = first ? value : sum + value;
}

// Adds the steady motion under a sine of one load in one form; false where it is unbounded. `h` (2, K) is scratch
// space.
[[gnu::noinline]] inline bool add_steady_motion(Index load, Index f, const Case &c, const Forms &forms,
                                                const ComplexMatrix &h) {
    const Cases &cases = c.all;
    Index n = forms.number(f), last = forms.entries(f), rigid_bodies = forms.rigid_bodies(f);
    double omega = c.omega, of_base = -1.0 / (omega * omega);
    ComplexArray sine = cases.sine.row(c.number, n), harmonic = cases.harmonic.row(c.number, n);
    ComplexArray rigid_body_sine = cases.rigid_body_sine.row(c.number, n);
    // s = Im(a e^{i theta}) = Re(-i a e^{i theta})
    Complex amplitude = c.amplitude(load), wave = {amplitude.imag, -amplitude.real}, of_speed = {0.0, omega * of_base};
    bool first = load == 0;
    for (Index turn = 0; turn < 2; turn++) {
        double direction = turn == 0 ? 1.0 : -1.0;
        for (Index k = last - 1; k >= 0; k--) {
            Complex total = forms.load(f, 3 * load, k) + direction * of_speed * forms.load(f, 3 * load + 1, k);
            total += of_base * forms.load(f, 3 * load + 2, k);
            total *= 0.5;
            for (Index m = k + 1; m < last; m++)
                total += forms.coupling(f, k, m) * h(turn, m);
            Complex apart = Complex{0.0, direction * omega} - forms.exponent(f, k);
            bool close = __builtin_hypot(apart.real, apart.imag) < RESONANCE * omega;
            if (close && total != 0.0 && wave != 0.0)
                return false;
            h(turn, k) = total != 0.0 ? total / apart : Complex{0.0, 0.0};
        }
    }
    for (Index p = 0; p < rigid_bodies; p++)
        put(rigid_body_sine(p), forms.rigid_body_drive(f, load, p) * of_base * wave, first);
    for (Index r = 0; r < sine.size(); r++) {
        Complex total = forms.through(f, 3 * load, r) + of_speed * forms.through(f, 3 * load + 1, r);
        total += Complex{of_base * forms.through(f, 3 * load + 2, r), 0.0};
        for (Index k = 0; k < last; k++) {
            Complex w = forms.weight(f, r, k);
            total += w * h(0, k) + conjugate(w * h(1, k));
        }
        put(sine(r), total * wave, first);
        for (Index p = 0; p < rigid_bodies; p++) {
            Complex of_rate = Complex{0.0, omega} * forms.rigid_body_rate_weight(f, r, p);
            Complex moved = first ? rigid_body_sine(p) : forms.rigid_body_drive(f, load, p) * of_base * wave;
            sine(r) += (forms.rigid_body_weight(f, r, p) + of_rate) * moved;
        }
    }
    for (Index i = 0; i < harmonic.size(); i++) {
        Complex total = {first ? of_base * forms.position_through(f, i) : 0.0, 0.0};
        for (Index k = 0; k < last; k++) {
            Complex w = forms.shape(f, i, k);
            total += w * h(0, k) + conjugate(w * h(1, k));
        }
        put(harmonic(i), total * wave, first);
        for (Index p = 0; p < rigid_bodies; p++) {
            Complex moved = first ? rigid_body_sine(p) : forms.rigid_body_drive(f, load, p) * of_base * wave;
            harmonic(i) += forms.rigid_body_shape(f, i, p) * moved;
        }
    }
    return true;
}

// Sets the steady motion under sines of one frequency in one form; false where it is unbounded.
inline bool set_steady_motion(Index f, const Case &c, const Forms &forms, const ComplexMatrix &h) {
    bool bounded = true;
    for (Index load = 0; bounded && load < c.amplitude.size(); load++)
        bounded = add_steady_motion(load, f, c, forms, h);
    return bounded;
}

// How coordinates are read from the motion in one closed form.
struct Shapes {
    const Forms &forms;
    const Bounds &bounds;
    Index form;
    double omega;
    Index degree;                                                    // see Scalars
    GivenComplexArray harmonic;                                      // (d,)
    GivenComplexMatrix shape = forms.shape.row(form);                // (d, K)
    GivenComplexMatrix shape_rate = forms.shape_rate.row(form);      // (d, K)
    GivenMatrix rigid_body_shape = forms.rigid_body_shape.row(form); // (d, P)
    GivenArray static_part = bounds.static_part;                     // (d,)
    GivenArray static_rate = bounds.static_rate;                     // (d,)
    GivenMatrix follow = forms.position_follow.row(form);            // (8H, d)
    GivenMatrix follow_rate = forms.velocity_follow.row(form);       // (8H, d)
    GivenIndices first = forms.first.row(form);                      // (d + 1,)
    GivenIndices members = forms.members.row(form);                  // (d K,)
    Index rigid_bodies = forms.rigid_bodies(form);
};

// The closed form that a case is in, with the parts that its drive and walls determine.
struct Form {
    const Forms &forms;
    Index number;
    Scalars scalars;
    Shapes shapes;
    GivenComplexArray rigid_body_sine;                                     // (P,)
    View<const unsigned char, 2> together = forms.together.row(number);    // (K, K)
    GivenComplexMatrix impulse_entry = forms.impulse_entry.row(number);    // (K, R)
    GivenMatrix impulse_rigid_body = forms.impulse_rigid_body.row(number); // (P, R)
    GivenMatrix load_on_rigid_body = forms.rigid_body_given.row(number);   // (P, 1 + R)
};

// A closed form as the search, the readings and the ledger of a case take it.
[[gnu::always_inline]] inline Form form_of(Index f, const Case &c, const Forms &forms, const Bounds &bounds) {
    const Cases &cases = c.all;
    Index n = forms.number(f), last = forms.entries(f), rigid_bodies = forms.rigid_bodies(f);
    Index degree = c.omega == 0.0 ? cases.degree : -1;
    // what a sine does to a rigid-body coordinate is in the steady motion
    GivenMatrix drive = degree >= 0 ? forms.rigid_body_drive.row(f) : bounds.nothing;
    Scalars scalars = {
        .exponent = forms.exponent.row(f).first(last),
        .coupling = forms.coupling.row(f),
        .blocks = forms.blocks.row(f),
        .size = forms.size.row(f).first(last),
        .omega = c.omega,
        .degree = degree,
        .rigid_body_given = bounds.given.first(rigid_bodies),
        .rigid_body_drive = drive,
        .lasting = bounds.lasting,
        .upper = bounds.upper,
        .lower = bounds.lower,
        .weight = forms.weight.row(f),
        .weight_size = forms.weight_size.row(f),
        .rigid_body_weight = forms.rigid_body_weight.row(f),
        .rigid_body_rate_weight = forms.rigid_body_rate_weight.row(f),
        .sine = cases.sine.row(c.number, n),
        .constant = bounds.constant,
        .follow = forms.follow.row(f),
        .driven = forms.driven(f),
        .slow = forms.slow(f),
        .load = forms.load.row(f),
        .given = bounds.entry_given.first(last),
        .term = bounds.steady.row(0),
        .growth = bounds.steady.row(1),
    };
    return {forms,
            f,
            scalars,
            {forms, bounds, f, c.omega, degree, cases.harmonic.row(c.number, n)},
            cases.rigid_body_sine.row(c.number, n)};
}

[[gnu::always_inline]] inline void multiply(GivenMatrix matrix, GivenArray vector, Array out) {
    for (Index r = 0; r < out.size(); r++) {
        double total = 0.0;
        for (Index w = 0; w < vector.size(); w++)
            total += matrix(r, w) * vector(w);
        out(r) = total;
    }
}

// Sets what constant loads and the walls in contact add to every scalar, coordinate and rigid-body coordinate.
[[gnu::noinline]] inline void set_walls(Index f, const Case &c, const Forms &forms, const Bounds &bounds) {
    bounds.wall(0) = 1.0;
    for (Index j = 0; j < c.state.size(); j++) {
        double side = side_of(c.state(j));
        bounds.wall(1 + j) = c.state(j) == FREE ? 0.0 : side * gap_on(side, j, c);
    }
    multiply(forms.constant.row(f), bounds.wall, bounds.constant);
    multiply(forms.static_part.row(f), bounds.wall, bounds.static_part);
    multiply(forms.static_rate.row(f), bounds.wall, bounds.static_rate);
    multiply(forms.rigid_body_given.row(f), bounds.wall, bounds.given);
    for (Index k = 0; k < bounds.entry_given.size(); k++) {
        Complex total = {0.0, 0.0};
        for (Index w = 0; k < forms.slow(f) && w < bounds.wall.size(); w++)
            total += forms.given(f, k, w) * bounds.wall(w);
        bounds.entry_given(k) = total;
    }
}

// Sets the bounds of the watched scalars, and the side of a contact that lasts.
[[gnu::noinline]] inline void set_bounds(const Pairs &pairs, const Case &c, const Bounds &s) {
    Index count = c.state.size();
    for (Index j = 0; j < count; j++) {
        double state = c.state(j), side = side_of(state);
        Index force = count + j;
        const Index watched[] = {j, force};
        for (Index r : watched) {
            s.upper(r) = INFINITE;
            s.lower(r) = -INFINITE;
            s.lasting(r) = 0.0;
        }
        if (state == FREE) {
            s.upper(j) = c.gap_plus(j);
            s.lower(j) = -c.gap_minus(j);
        } else if (is_active(state)) {
            s.lasting(force) = side * (pairs.rigid(j) ? STICKS : 1.0);
            (side > 0.0 ? s.lower : s.upper)(force) = 0.0;
        } else if (side > 0.0) {
            s.lower(j) = c.gap_plus(j);
            s.upper(force) = 0.0;
        } else {
            s.upper(j) = -c.gap_minus(j);
            s.lower(force) = 0.0;
        }
    }
}

// Steady displacement and velocity of coordinate i under a polynomial.
struct Followed {
    double position, rate;
};
[[gnu::always_inline]] inline Followed followed(const Shapes &shapes, Index i, GivenArray d) {
    const Index last = shapes.degree > 1 ? DRIVE : 4;
    return {derivative(shapes.follow, i, d, 0, last), derivative(shapes.follow_rate, i, d, 0, last)};
}

// Sets `out` to displacements and velocities of all coordinates (2, d) at the present time.
[[gnu::noinline]] inline void read_coordinates(const Shapes &shapes, const Motion &motion, const Matrix &out) {
    double omega = shapes.omega;
    Complex phase = unit_phase(omega, motion.clock);
    for (Index i = 0; i < out.shape[1]; i++) {
        Complex turned = shapes.harmonic(i) * phase;
        double x = shapes.static_part(i) + turned.real, v = shapes.static_rate(i) - omega * turned.imag;
        if (omega == 0.0) {
            auto steady = followed(shapes, i, motion.drive);
            x += steady.position;
            v += steady.rate;
        }
        for (Index m = shapes.first(i); m < shapes.first(i + 1); m++) {
            Index k = shapes.members(m);
            Complex h = motion.entry(k), shape = shapes.shape(i, k), rate = shapes.shape_rate(i, k);
            x += shape.real * h.real - shape.imag * h.imag;
            v += rate.real * h.real - rate.imag * h.imag;
        }
        for (Index p = 0; p < shapes.rigid_bodies; p++) {
            x += shapes.rigid_body_shape(i, p) * motion.rigid_body(p);
            v += shapes.rigid_body_shape(i, p) * motion.rigid_body_rate(p);
        }
        out(0, i) = x;
        out(1, i) = v;
    }
}

// Sets the homogeneous part and the rigid-body coordinates to coordinates (2, d) in a form; these are used up.
[[gnu::noinline]] inline void enter_form(Index f, const Shapes &shapes, const Forms &forms, const Matrix &state,
                                         const Motion &motion) {
    double omega = shapes.omega;
    Complex phase = unit_phase(omega, motion.clock);
    for (Index i = 0; i < state.shape[1]; i++) {
        Complex turned = shapes.harmonic(i) * phase;
        state(0, i) -= shapes.static_part(i) + turned.real;
        state(1, i) += omega * turned.imag - shapes.static_rate(i);
        if (omega == 0.0) {
            auto steady = followed(shapes, i, motion.drive);
            state(0, i) -= steady.position;
            state(1, i) -= steady.rate;
        }
    }
    for (Index k = 0; k < forms.entries(f); k++) {
        Complex total = {0.0, 0.0};
        for (Index i = 0; i < state.shape[1]; i++)
            total += forms.to_entry_u(f, k, i) * state(0, i) + forms.to_entry_v(f, k, i) * state(1, i);
        motion.entry(k) = total;
    }
    for (Index p = 0; p < shapes.rigid_bodies; p++) {
        double x = 0.0, v = 0.0;
        for (Index i = 0; i < state.shape[1]; i++) {
            x += forms.to_rigid_body(f, p, i) * state(0, i);
            v += forms.to_rigid_body(f, p, i) * state(1, i);
        }
        motion.rigid_body(p) = x;
        motion.rigid_body_rate(p) = v;
    }
}

// The x of a pair, or its rate, from the coordinates, or their rates, and the base's.
[[gnu::always_inline]] inline double gap_of(Index j, const Pairs &pairs, GivenArray values, double base) {
    double x = -pairs.in_space(j) * base;
    for (Index i = 0; i < values.size(); i++)
        x -= pairs.direction(j, i) * values(i);
    return x;
}

// Begins a piece of s(t) at its knot: what the steady motion changes by is taken up by the entries.
[[gnu::noinline]] inline void begin_piece(Index piece, Index f, const Cases &cases, const Forms &forms,
                                          const Motion &motion) {
    GivenArray next = cases.pieces.row(piece);
    GivenMatrix follow = forms.position_follow.row(f), rate = forms.velocity_follow.row(f);
    Array d = motion.drive;
    // the motion of the base goes on: a piece carries it to the last digit
    Index last = larger(cases.degree, Index(1)) + 3;
    for (Index begin = 0; begin < d.size(); begin += DRIVE) {
        double jump[DRIVE] = {};
        for (Index j = 2; j < last; j++)
            jump[j] = next(begin + j) - d(begin + j);
        for (Index j = 0; j < DRIVE; j++)
            d(begin + j) = next(begin + j);
        for (Index i = 0; i < follow.shape[1]; i++) {
            double x = follow(begin + 2, i) * jump[2] + follow(begin + 3, i) * jump[3];
            double v = rate(begin + 2, i) * jump[2] + rate(begin + 3, i) * jump[3];
            for (Index j = 4; j < last; j++) {
                x += follow(begin + j, i) * jump[j];
                v += rate(begin + j, i) * jump[j];
            }
            for (Index k = 0; k < forms.entries(f); k++)
                motion.entry(k) -= forms.to_entry_u(f, k, i) * x + forms.to_entry_v(f, k, i) * v;
        }
    }
}

} // namespace FEMIMPACT_TARGET
