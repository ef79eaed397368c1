// The module's functions of the contact formulas: numbers in, numbers out.
#pragma once

#include "../arguments.hpp"
#include "../kernels.hpp"

namespace FEMIMPACT_TARGET {

// A formula by its name in Python and the names of its arguments; the functions themselves stand in kernels.cpp.
struct Formula {
    const char *name, *document;
    int arguments;
    const char *names[6];
    int results;
};

constexpr Formula FORMULAS[FEMIMPACT_FORMULA_COUNT] = {
    {"penetration",
     "penetration(x, gap_plus, gap_minus, /)\n--\n\nPenetration (m) and side (+1, -1, or 0 between contacts).",
     3,
     {"x", "gap_plus", "gap_minus"},
     2},
    {"kelvin_voigt_force",
     "kelvin_voigt_force(depth, rate, stiffness, damping, /)\n--\n\nNormal force max(0, k p + c p') (N).",
     4,
     {"depth", "rate", "stiffness", "damping"},
     1},
    {"spring_potential",
     "spring_potential(depth, stiffness, /)\n--\n\nEnergy k p^2/2 (J) stored by a linear spring.",
     2,
     {"depth", "stiffness"},
     1},
    {"switching_stiffness",
     "switching_stiffness(x_before, gap_plus, gap_minus, free_stiffness, stiffness, /)\n--\n\nSpring stiffness (N/m) "
     "of the paper's law.",
     5,
     {"x_before", "gap_plus", "gap_minus", "free_stiffness", "stiffness"},
     1},
    {"switching_potential",
     "switching_potential(x, gap_plus, gap_minus, free_stiffness, stiffness, /)\n--\n\nWork (J) of the paper's law "
     "from the centre to x.",
     5,
     {"x", "gap_plus", "gap_minus", "free_stiffness", "stiffness"},
     1},
    {"power_force",
     "power_force(depth, rate, stiffness, exponent, loss, approach_speed, /)\n--\n\nNormal force k p^n max(0, 1 + d "
     "p'/v0) (N).",
     6,
     {"depth", "rate", "stiffness", "exponent", "loss", "approach_speed"},
     1},
    {"power_potential",
     "power_potential(depth, stiffness, exponent, /)\n--\n\nEnergy k p^(n + 1)/(n + 1) (J) stored by the elastic part.",
     3,
     {"depth", "stiffness", "exponent"},
     1},
};

// Calls one formula with the numbers that Python gives.
template <int WHICH>
PyObject *formula_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    constexpr const Formula &formula = FORMULAS[WHICH];
    double given[6] = {}, found[2] = {};
    if (!take_count(count, formula.arguments, formula.name))
        return nullptr;
    for (int k = 0; k < formula.arguments; k++)
        if (!take_number(arguments[k], formula.names[k], &given[k]))
            return nullptr;
    kernels.formulas[WHICH](given, found);
    return formula.results == 1 ? PyFloat_FromDouble(found[0]) : Py_BuildValue("(dd)", found[0], found[1]);
}

} // namespace FEMIMPACT_TARGET
