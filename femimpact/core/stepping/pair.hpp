// The step's scalar equation of one pair: the force F with F = law(x_free - compliance_u F, rate_free - compliance_v
// F).
#pragma once

#include "loop_data.hpp"

namespace FEMIMPACT_TARGET::stepping {

constexpr int MOST_ITERATIONS = 200;
constexpr double ROUNDING = 2.3e-16;

// One pair at a step's end as it would be without its force, and what 1 N does to it.
struct FreePair {
    double gate; // +1 or -1: the side at hand, 0 between contacts; decided before the equation is solved
    double x;    // m
    double rate; // m/s
    double x_before;
    double rate_before;
    double compliance_u; // m/N
    double compliance_v; // m/(s N)
};

// On the structure (N), centring spring and its dashpot included, and its normal part, positive where its wall pushes.
struct PairForce {
    double total, normal;
};

// Signed force of the law where that force leaves the pair.
inline double law_at(double force, bool mean, double dt, const Law &law, const FreePair &free) {
    double x = free.x - free.compliance_u * force;
    if (mean)
        return mean_forces_of_walls(law, free.x_before, x, dt).normal;
    double depth = free.gate * x - (free.gate > 0.0 ? law.gap_plus : law.gap_minus);
    double rate = free.gate * (free.rate - free.compliance_v * force);
    return free.gate * normal_force(law, depth, rate);
}

// Root of force - law(force), which rises with the force: Illinois steps in a bracket, bisection now and then.
inline double solve(bool mean, double dt, const Law &law, const FreePair &free) {
    double high = law_at(0.0, mean, dt, law, free);
    if (high == 0.0)
        return 0.0;
    double low = 0.0, low_excess = -high, high_excess = high - law_at(high, mean, dt, law, free), force = high;
    if (high_excess == 0.0)
        return high;
    int side = 0;
    for (int k = 0; k < MOST_ITERATIONS; k++) {
        // the weights of Illinois keep the bracket shrinking from both ends; a bisection bounds the number of steps
        force = (low * high_excess - high * low_excess) / (high_excess - low_excess);
        if (k % 4 == 3 || !(smaller(low, high) < force && force < larger(low, high)))
            force = 0.5 * (low + high);
        double excess = force - law_at(force, mean, dt, law, free);
        if (magnitude(excess) <= ROUNDING * magnitude(force) ||
            magnitude(high - low) <= 2.0 * ROUNDING * magnitude(force))
            break;
        if ((excess > 0.0) == (high_excess > 0.0)) {
            high = force;
            high_excess = excess;
            low_excess *= side == 1 ? 0.5 : 1.0;
            side = 1;
        } else {
            low = force;
            low_excess = excess;
            high_excess *= side == -1 ? 0.5 : 1.0;
            side = -1;
        }
    }
    return force;
}

// Normal force of the wall at hand (N, signed), whose rigid law has an impulse.
[[gnu::always_inline]] inline double wall_force(const Scheme &s, const Law &law, const FreePair &free) {
    double gate = free.gate;
    if (law.kind == RIGID)
        return gate * larger(gate * (free.rate + law.restitution * free.rate_before) / free.compliance_v, 0.0);
    if (law.kind == KELVIN_VOIGT && !s.mean) {
        double depth = gate * free.x - (gate > 0.0 ? law.gap_plus : law.gap_minus);
        double denominator = 1.0 + law.stiffness * free.compliance_u + law.damping * free.compliance_v;
        return gate * kelvin_voigt_force(depth, gate * free.rate, law.stiffness, law.damping) / denominator;
    }
    return solve(s.mean, s.dt, law, free);
}

// Forces of a pair that has a dashpot beside its centring spring.
//
// A mean force has the mean rate of the step, travel over dt, one at the step's end has the rate there.
[[gnu::noinline]] inline PairForce braked_force(const Scheme &s, const Law &law, const FreePair &free) {
    double on_travel = s.mean ? law.dashpot / s.dt : 0.0, on_rate = s.mean ? 0.0 : law.dashpot;
    double on_x = law.spring * s.spring_now + on_travel;
    double old = (law.spring * (1.0 - s.spring_now) - on_travel) * free.x_before;
    double left = 1.0 / (1.0 + free.compliance_u * on_x + free.compliance_v * on_rate);
    double pull = left * (on_x * free.x + on_rate * free.rate + old);
    if (free.gate == 0.0)
        return {pull, 0.0};
    double x = free.x - free.compliance_u * pull, rate = free.rate - free.compliance_v * pull;
    FreePair beside = {
        free.gate, x, rate, free.x_before, free.rate_before, free.compliance_u * left, free.compliance_v * left};
    double force = wall_force(s, law, beside);
    return {pull + left * force, free.gate * force};
}

// Forces of one pair at a step's end.
inline PairForce pair_force(const Scheme &s, const Law &law, const FreePair &free) {
    if (law.dashpot > 0.0)
        return braked_force(s, law, free);
    double spring = law.spring, gate = free.gate;
    if (law.kind == SWITCHING_SPRING)
        // decided by the state before the step, as printed
        spring = switching_stiffness(free.x_before, law.gap_plus, law.gap_minus, spring, law.stiffness);
    double old = spring * (1.0 - s.spring_now) * free.x_before;
    double compliance_factor = 1.0 / (1.0 + free.compliance_u * s.spring_now * spring);
    double x = (free.x - free.compliance_u * old) * compliance_factor;
    double pull = spring * s.spring_now * x + old;
    if (law.kind == SWITCHING_SPRING)
        return {pull, magnitude(pull)};
    if (gate == 0.0)
        return {pull, 0.0};
    double rate = free.rate - free.compliance_v * pull;
    double compliance_u = free.compliance_u * compliance_factor;
    double compliance_v = free.compliance_v * (1.0 - free.compliance_u * compliance_factor * s.spring_now * spring);
    double force = wall_force(s, law, {gate, x, rate, free.x_before, free.rate_before, compliance_u, compliance_v});
    return {force + spring * s.spring_now * (x - compliance_u * force) + old, gate * force};
}

} // namespace FEMIMPACT_TARGET::stepping
