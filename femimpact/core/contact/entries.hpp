// The module's functions of the contact formulas: numbers in, numbers out.
#pragma once

#include "../arguments.hpp"
#include "../kernels.hpp"

namespace FEMIMPACT_TARGET {

// A formula by its name in Python and the names of its arguments; the functions themselves stand in kernels.cpp.
struct Formula {
    const char *name, *document;
    const char *names[7];
    int arguments, results;
};

constexpr Formula FORMULAS[FEMIMPACT_FORMULA_COUNT] = {
    {"penetration",
     "penetration(x, gap_plus, gap_minus, /)\n--\n\nPenetration (m) and side (+1, -1, or 0 between contacts).",
     {"x", "gap_plus", "gap_minus"},
     3,
     2},
    {"normal_force",
     "normal_force(kind, depth, rate, stiffness, damping, exponent, approach_speed, /)\n--\n\nNormal force (N) of a "
     "law "
     "with a compiled branch.",
     {"kind", "depth", "rate", "stiffness", "damping", "exponent", "approach_speed"},
     7,
     1},
    {"elastic_potential",
     "elastic_potential(kind, depth, stiffness, exponent, /)\n--\n\nEnergy (J) stored by a law with a compiled branch.",
     {"kind", "depth", "stiffness", "exponent"},
     4,
     1},
    {"switching_stiffness",
     "switching_stiffness(x_before, gap_plus, gap_minus, free_stiffness, stiffness, /)\n--\n\nSpring stiffness (N/m) "
     "of the paper's law.",
     {"x_before", "gap_plus", "gap_minus", "free_stiffness", "stiffness"},
     5,
     1},
    {"switching_potential",
     "switching_potential(x, gap_plus, gap_minus, free_stiffness, stiffness, /)\n--\n\nWork (J) of the paper's law "
     "from the centre to x.",
     {"x", "gap_plus", "gap_minus", "free_stiffness", "stiffness"},
     5,
     1},
};

// Calls one formula with the numbers that Python gives.
template <int WHICH>
PyObject *formula_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    constexpr const Formula &formula = FORMULAS[WHICH];
    double given[7] = {}, found[2] = {};
    if (!take_count(count, formula.arguments, formula.name))
        return nullptr;
    for (int k = 0; k < formula.arguments; k++)
        if (!take_number(arguments[k], formula.names[k], &given[k]))
            return nullptr;
    kernels.formulas[WHICH](given, found);
    return formula.results == 1 ? PyFloat_FromDouble(found[0]) : Py_BuildValue("(dd)", found[0], found[1]);
}

} // namespace FEMIMPACT_TARGET
