// Contact formulas: numbers in, numbers out.
#pragma once

#include "../array.hpp"

namespace FEMIMPACT_TARGET {

// Normal force max(0, k p + c p') in N while the pair touches: the wall never pulls.
[[gnu::always_inline]] inline double kelvin_voigt_force(double depth, double rate, double stiffness, double damping) {
    double force = stiffness * depth + damping * rate;
    return force > 0.0 ? force : 0.0;
}

// Energy k p^2/2 (J) stored by a linear spring.
[[gnu::always_inline]] inline double spring_potential(double depth, double stiffness) {
    return 0.5 * stiffness * depth * depth;
}

} // namespace FEMIMPACT_TARGET
