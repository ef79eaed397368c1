// A motion under a sine at eight instants at once, equally far apart.
#pragma once

#include "bounds.hpp"

namespace FEMIMPACT_TARGET {

// Most entries of a motion that is looked at so.
constexpr Index MOST_ENTRIES = 16;

// Powers of a number, from 0 to 8.
struct Powers {
    double real[WIDTH + 1], imag[WIDTH + 1];

    [[gnu::always_inline]] Complex at(Index n) const { return {real[n], imag[n]}; }
    // The first eight of them times a number: real parts.
    [[gnu::always_inline]] Pack times(Complex number) const {
        return number.real * load<Pack>({real, {WIDTH}}, 0) - number.imag * load<Pack>({imag, {WIDTH}}, 0);
    }
    [[gnu::always_inline]] void set(Complex base) {
        real[0] = 1.0;
        imag[0] = 0.0;
        for (Index n = 1; n <= WIDTH; n++) {
            // of halves: a rounding for each doubling
            Complex power = n == 1 ? base : at(n / 2) * at(n - n / 2);
            real[n] = power.real;
            imag[n] = power.imag;
        }
    }
};

// e^{i omega n h} and e^{lambda n h} of every entry of a closed form, for a step h.
struct Steps {
    Index form = -1; // -1 where nothing is set
    double step;     // s
    double time[WIDTH];
    Powers turn, growth[MOST_ENTRIES];
};

// Whether a motion may be looked at so: what drives it is a sine, and each entry moves alone.
[[gnu::always_inline]] inline bool may_step(const Scalars &scalars) {
    return scalars.degree < 0 && scalars.driven == 0 && scalars.slow == 0 && !has_blocks(scalars) &&
           scalars.omega > 0.0 && scalars.exponent.size() <= MOST_ENTRIES;
}

// Sets the steps of a form, where they are those of another one.
[[gnu::noinline]] inline void set_steps(Index form, double step, const Scalars &scalars, Steps &steps) {
    if (steps.form == form)
        return;
    steps.form = form;
    steps.step = step;
    for (Index n = 0; n < WIDTH; n++)
        steps.time[n] = double(n) * step;
    exponentials(scalars.exponent, step, scalars.growth);
    for (Index k = 0; k < scalars.exponent.size(); k++)
        steps.growth[k].set(scalars.growth(k));
    auto [cosine, sine] = cosine_and_sine(scalars.omega * step);
    steps.turn.set({cosine, sine});
}

// Scalar r of a motion, `phase` being its e^{i theta}, now and after each of seven steps.
[[gnu::always_inline]] inline Pack values_ahead(Index r, Index active, Complex phase, const Scalars &scalars,
                                                const Motion &motion, const Steps &steps) {
    Pack value = scalars.constant(r) + steps.turn.times(scalars.sine(r) * phase);
    for (Index k = 0; k < active; k++)
        value = value + steps.growth[k].times(scalars.weight(r, k) * motion.entry(k));
    const Pack time = load<Pack>({steps.time, {WIDTH}}, 0);
    for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
        double p = scalars.rigid_body_weight(r, i), q = scalars.rigid_body_rate_weight(r, i);
        double y = motion.rigid_body(i), v = motion.rigid_body_rate(i), push = scalars.rigid_body_given(i);
        value = value + (p * y + q * v + time * (p * v + q * push + time * (0.5 * p * push)));
    }
    return value;
}

// Advances a motion by some steps, up to eight.
[[gnu::always_inline]] inline void take_steps(Index count, const Scalars &scalars, const Motion &motion,
                                              const Steps &steps) {
    for (Index k = 0; k < scalars.exponent.size(); k++)
        motion.entry(k) *= steps.growth[k].at(count);
    move_rigid_bodies(scalars, motion, double(count) * steps.step);
    motion.clock(0) += double(count) * steps.step;
}

// Share of the terms that make a scalar by which it is farther from its bounds where a step is clear.
constexpr double CLEAR = 1e-12;

// How far a scalar may stand out between two instants above and below what it is at both, and its rounding.
//
// Each of its terms does by |x''| step^2/8 at most, and by no more than twice its size; sizes are those that `measure`
// has set at this time or an earlier one.
[[gnu::always_inline]] inline double margin_between(Index r, const Scalars &scalars, const Motion &motion, Index active,
                                                    double step, const Search &search) {
    const double share = step * step / 8.0, omega = scalars.omega;
    Complex wave = scalars.sine(r);
    double size = __builtin_sqrt(wave.real * wave.real + wave.imag * wave.imag), total = omega * omega * size * share;
    double scale = magnitude(scalars.constant(r)) + size * (1.0 + omega * motion.clock(0));
    for (Index i = 0; i < scalars.rigid_body_given.size(); i++) {
        double p = scalars.rigid_body_weight(r, i), q = scalars.rigid_body_rate_weight(r, i);
        total += magnitude(p * scalars.rigid_body_given(i)) * share;
        scale += magnitude(p * motion.rigid_body(i)) + magnitude(q * motion.rigid_body_rate(i));
    }
    for (Index k = 0; k < active; k++) {
        double largest = scalars.weight_size(r, k) * search.size(k);
        total += largest * smaller(scalars.size(k) * scalars.size(k) * share, 2.0);
        scale += largest;
    }
    return total + CLEAR * scale;
}

// Advances a motion by as many steps as show that no watched scalar meets its bounds meanwhile; `measure` was called
// at this time or an earlier one.
[[gnu::noinline]] inline void step_ahead(const Scalars &scalars, const Motion &motion, Index active, double until,
                                         const Search &search, const Steps &steps) {
    for (Index r = 0; r < scalars.lasting.size(); r++)
        search.margin(r) = margin_between(r, scalars, motion, active, steps.step, search);
    Complex phase = unit_phase(scalars.omega, motion.clock);
    while (until - motion.clock(0) > double(WIDTH - 1) * steps.step) {
        unsigned near = 1U << WIDTH;
        for (Index r = 0; r < scalars.lasting.size(); r++) {
            const double upper = scalars.upper(r), lower = scalars.lower(r);
            if (upper == INFINITE && lower == -INFINITE)
                continue;
            const Pack x = values_ahead(r, active, phase, scalars, motion, steps);
            near |= ~bits_where(x < filled<Pack>(upper - search.margin(r)));
            near |= ~bits_where(x > filled<Pack>(lower + search.margin(r)));
        }
        const Index clear = __builtin_ctz(near);
        if (clear < WIDTH) {
            if (clear > 1)
                take_steps(clear - 1, scalars, motion, steps);
            return;
        }
        take_steps(WIDTH - 1, scalars, motion, steps);
        phase *= steps.turn.at(WIDTH - 1);
    }
}

} // namespace FEMIMPACT_TARGET
