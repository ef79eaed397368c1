// The module's functions of the methods with steps: what Python hands over is checked, then a kernel takes it.
#pragma once

#include "../kernels.hpp"
#include "../tables.hpp"
#include "loop.hpp"

namespace FEMIMPACT_TARGET::stepping {

// What every function of the loop is handed, read and checked.
struct Handed {
    FromTuple arrays;
    Stepped stepped;
    Fine fine;
    bool has_fine = false;

    // false with an exception where anything is not what the tables say
    bool read(PyObject *block, PyObject *fine_steps) {
        has_fine = fine_steps != Py_None;
        return arrays.read("block", block, stepped) && (!has_fine || arrays.read("fine", fine_steps, fine));
    }
};

// advance(steps, block, fine or None)
inline PyObject *advance_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    Handed handed;
    if (!take_count(count, 3, "advance"))
        return nullptr;
    const Index steps = PyLong_AsLongLong(arguments[0]);
    if ((steps == -1 && PyErr_Occurred() != nullptr) || !handed.read(arguments[1], arguments[2]))
        return nullptr;
    const Fine *fine = handed.has_fine ? &handed.fine : nullptr;
    return run_apart([&] { kernels.advance(steps, &handed.stepped, fine); });
}

// keep_present(block), of the sample and the snapshot that are due at the present step, and write_energies(block).
template <auto KERNEL>
PyObject *block_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    Handed handed;
    const char *name = KERNEL == &femimpact_kernels::keep_present ? "keep_present" : "write_energies";
    if (!take_count(count, 1, name) || !handed.read(arguments[0], Py_None))
        return nullptr;
    return run_apart([&] { (kernels.*KERNEL)(&handed.stepped); });
}

// collide(law, mass, speed, start, scheme): rebound over approach speed, peak force (N), what a custom law refused
inline PyObject *collide_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    FromTuple of_law, of_scheme;
    Law law;
    Scheme scheme;
    double numbers[3] = {}, refused[3] = {}, result[2] = {};
    static constexpr const char *NAMES[3] = {"mass", "speed", "start"};
    if (!take_count(count, 5, "collide") || !of_law.read("law", arguments[0], law) ||
        !of_scheme.read("scheme", arguments[4], scheme))
        return nullptr;
    for (int k = 0; k < 3; k++)
        if (!take_number(arguments[1 + k], NAMES[k], &numbers[k]))
            return nullptr;
    law.refused = refused;
    {
        const WithoutLock others_run;
        kernels.collide(&law, numbers, &scheme, result);
    }
    return Py_BuildValue("(dd(ddd))", result[0], result[1], refused[0], refused[1], refused[2]);
}

// Lists the tables of all that these functions are handed.
inline void list_tables(ToList &rows) {
    Stepped block;
    Fine fine;
    Law law;
    rows.group("block", block, "Stepped");
    rows.group("fine", fine, "Fine");
    rows.group("law", law, "Law");
    rows.enumeration("steps", LAST_NAMES);
    rows.enumeration("steps", BALL_NAMES);
    rows.enumeration("steps", DRIVE_NAMES);
    rows.enumeration("steps", LEDGER_NAMES);
    rows.enumeration("steps", CONSTANT_NAMES);
    rows.enumeration("steps", TOUCH_NAMES);
}

} // namespace FEMIMPACT_TARGET::stepping
