// Contact formulas: numbers in, numbers out. The loops over time, the ledgers and Python call these; a contact force is
// written down nowhere else.
#pragma once

#include "../array.hpp"
#include "../fields.hpp"

namespace FEMIMPACT_TARGET {

// Kinds of laws, numbered as in femimpact/contact/laws.py.
ENUMERATION(KIND_NAMES, KELVIN_VOIGT, SWITCHING_SPRING, POWER, CUSTOM, RIGID);
constexpr Index KINDS = RIGID + 1;

// Depth (m), and the side of the wall: +1, -1, or 0 between contacts.
struct Penetration {
    double depth, side;
};

// Of a ball at x = y_ball - w_structure.
[[gnu::always_inline]] inline Penetration penetration(double x, double gap_plus, double gap_minus) {
    if (x > gap_plus)
        return {x - gap_plus, 1.0};
    if (x < -gap_minus)
        return {-(x + gap_minus), -1.0};
    return {0.0, 0.0};
}

// Normal force max(0, k p + c p') in N while the pair touches: the wall never pulls.
[[gnu::always_inline]] inline double kelvin_voigt_force(double depth, double rate, double stiffness, double damping) {
    double force = stiffness * depth + damping * rate;
    return force > 0.0 ? force : 0.0;
}

// Energy k p^2/2 (J) stored by a linear spring.
[[gnu::always_inline]] inline double spring_potential(double depth, double stiffness) {
    return 0.5 * stiffness * depth * depth;
}

// Spring stiffness (N/m) of the paper's law: decided by the state before the step.
[[gnu::always_inline]] inline double switching_stiffness(double x_before, double gap_plus, double gap_minus,
                                                         double free_stiffness, double stiffness) {
    return x_before > gap_plus || x_before < -gap_minus ? stiffness : free_stiffness;
}

// Work (J) that the force k(x) x does from the centre to x: the potential of the law.
[[gnu::always_inline]] inline double switching_potential(double x, double gap_plus, double gap_minus,
                                                         double free_stiffness, double stiffness) {
    double wall = x > 0.0 ? gap_plus : gap_minus;
    if (magnitude(x) <= wall)
        return 0.5 * free_stiffness * x * x;
    return 0.5 * free_stiffness * wall * wall + 0.5 * stiffness * (x * x - wall * wall);
}

// Normal force k p^n max(0, 1 + d p'/v0) in N of Hertz and of the laws that add damping to it.
[[gnu::always_inline]] inline double power_force(double depth, double rate, double stiffness, double exponent,
                                                 double loss, double approach_speed) {
    if (depth <= 0.0)
        return 0.0;
    double power = exponent == 1.5 ? depth * __builtin_sqrt(depth) : __builtin_pow(depth, exponent);
    double elastic = stiffness * power;
    if (loss == 0.0)
        return elastic;
    double factor = 1.0 + loss * rate / approach_speed;
    return factor > 0.0 ? elastic * factor : 0.0;
}

// Energy k p^(n + 1)/(n + 1) (J) stored by the elastic part.
[[gnu::always_inline]] inline double power_potential(double depth, double stiffness, double exponent) {
    if (depth <= 0.0)
        return 0.0;
    if (exponent == 1.5)
        return 0.4 * stiffness * depth * depth * __builtin_sqrt(depth);
    return stiffness * __builtin_pow(depth, exponent + 1.0) / (exponent + 1.0);
}

} // namespace FEMIMPACT_TARGET
