// femimpact._core: Python's side of the kernels, in the limited API. Compiled once, for the lowest processor.
#include "arguments.hpp"
#include "event_driven/entries.hpp"
#include "targets.hpp"

#include <cstdlib>

// the build gives FEMIMPACT_COMPILER, FEMIMPACT_KIND, FEMIMPACT_SOURCES and FEMIMPACT_KEY, each a text
namespace FEMIMPACT_TARGET {

namespace {

// found by the build in the file of the binary, without loading it
__attribute__((used)) const char KEY[] = "femimpact build key " FEMIMPACT_KEY;

// chosen when the module is imported
const femimpact_kernels *kernels = nullptr;

bool put(PyObject *dict, const char *name, PyObject *value) {
    const bool done = value != nullptr && PyDict_SetItemString(dict, name, value) == 0;
    if (value != nullptr) {
        Py_DecRef(value);
    }
    return done;
}

PyObject *target_names() {
    PyObject *names = PyTuple_New(TARGET_COUNT);
    for (int k = 0; names != nullptr && k < TARGET_COUNT; k++) {
        PyObject *name = PyUnicode_FromString(TARGETS[k].name);
        // the tuple takes it, also where it fails
        if (name == nullptr || PyTuple_SetItem(names, k, name) != 0) {
            Py_DecRef(names);
            return nullptr;
        }
    }
    return names;
}

PyObject *build_info(PyObject *, PyObject *) {
    PyObject *info = PyDict_New();
    if (info == nullptr) {
        return nullptr;
    }
    if (put(info, "target", PyUnicode_FromString(kernels->target)) && put(info, "targets", target_names()) &&
        put(info, "compiler", PyUnicode_FromString(FEMIMPACT_COMPILER)) &&
        put(info, "sources", PyUnicode_FromString(FEMIMPACT_SOURCES)) &&
        put(info, "kind", PyUnicode_FromString(FEMIMPACT_KIND))) {
        return info;
    }
    Py_DecRef(info);
    return nullptr;
}

PyObject *choose(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    double level = 0.0;
    if (!take_count(count, 2, "choose_target") || !take_number(arguments[0], "level", &level)) {
        return nullptr;
    }
    const char *asked = PyUnicode_AsUTF8AndSize(arguments[1], nullptr);
    if (asked == nullptr) {
        return nullptr;
    }
    const Choice choice = choose_target(level >= 4.0 ? 4 : level >= 1.0 ? static_cast<int>(level) : 0, asked);
    if (choice.target == nullptr) {
        return PyErr_Format(PyExc_ImportError, "%s", choice.refusal);
    }
    return PyUnicode_FromString(choice.target->name);
}

PyObject *exponentials(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    static constexpr Wanted EXPONENT = {"exponent", Type::complex128, 1, "(K,)", false};
    static constexpr Wanted OUT = {"out", Type::complex128, 1, "(K,)", true};
    Argument exponent, out;
    double time = 0.0;
    if (!take_count(count, 3, "exponentials") || !exponent.take(arguments[0], EXPONENT) ||
        !take_number(arguments[1], "time", &time) || !out.take(arguments[2], OUT) ||
        !same_size(exponent, out, 0, "exponent and out")) {
        return nullptr;
    }
    {
        const WithoutLock others_run;
        kernels->exponentials(exponent.doubles(), time, out.doubles(), exponent.size(0));
    }
    Py_IncRef(Py_None);
    return Py_None;
}

PyObject *cosine_and_sine(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    double angle = 0.0, cosine = 0.0, sine = 0.0;
    if (!take_count(count, 1, "cosine_and_sine") || !take_number(arguments[0], "angle", &angle)) {
        return nullptr;
    }
    kernels->cosine_and_sine(angle, &cosine, &sine);
    return Py_BuildValue("(dd)", cosine, sine);
}

PyObject *kelvin_voigt_force(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    double depth = 0.0, rate = 0.0, stiffness = 0.0, damping = 0.0;
    if (!take_count(count, 4, "kelvin_voigt_force") || !take_number(arguments[0], "depth", &depth) ||
        !take_number(arguments[1], "rate", &rate) || !take_number(arguments[2], "stiffness", &stiffness) ||
        !take_number(arguments[3], "damping", &damping)) {
        return nullptr;
    }
    return PyFloat_FromDouble(kernels->kelvin_voigt_force(depth, rate, stiffness, damping));
}

PyObject *spring_potential(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    double depth = 0.0, stiffness = 0.0;
    if (!take_count(count, 2, "spring_potential") || !take_number(arguments[0], "depth", &depth) ||
        !take_number(arguments[1], "stiffness", &stiffness)) {
        return nullptr;
    }
    return PyFloat_FromDouble(kernels->spring_potential(depth, stiffness));
}

PyObject *run_cases(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    return run_cases_entry(*kernels, arguments, count);
}

PyObject *next_event(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    return next_event_entry(*kernels, arguments, count);
}

PyObject *tables(PyObject *, PyObject *) {
    return tables_of_entries();
}

template <typename Function> PyCFunction method(Function function) noexcept {
    return reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(function));
}

PyMethodDef METHODS[] = {
    {"build_info", build_info, METH_NOARGS,
     "build_info()\n--\n\nTarget in use, targets held, compiler, hash of the sources, kind of build."},
    {"choose_target", method(choose), METH_FASTCALL,
     "choose_target(level, asked, /)\n--\n\nName of the target that a processor of x86-64-v<level> takes."},
    {"exponentials", method(exponentials), METH_FASTCALL,
     "exponentials(exponent, time, out, /)\n--\n\ne^{lambda t} of several lambda with Re lambda <= 0, written to out."},
    {"cosine_and_sine", method(cosine_and_sine), METH_FASTCALL,
     "cosine_and_sine(angle, /)\n--\n\nBoth of an angle (rad)."},
    {"kelvin_voigt_force", method(kelvin_voigt_force), METH_FASTCALL,
     "kelvin_voigt_force(depth, rate, stiffness, damping, /)\n--\n\nNormal force max(0, k p + c p') (N)."},
    {"spring_potential", method(spring_potential), METH_FASTCALL,
     "spring_potential(depth, stiffness, /)\n--\n\nEnergy k p^2/2 (J) stored by a linear spring."},
    {"run_cases", method(run_cases), METH_FASTCALL,
     "run_cases(task, job, ledger, /)\n--\n\nTake event-driven cases to their last samples; the arrays are written "
     "to."},
    {"next_event", method(next_event), METH_FASTCALL,
     "next_event(call, until, /)\n--\n\nMove to the first event or to `until`; returns how the search ended."},
    {"tables", tables, METH_NOARGS,
     "tables()\n--\n\nName, type, shape and whether it is written to, of every value of each tuple handed over."},
    {nullptr, nullptr, 0, nullptr},
};

PyModuleDef MODULE = {
    {{1, nullptr}, nullptr, 0, nullptr}, "_core", "The compiled core.", -1, METHODS, nullptr, nullptr, nullptr, nullptr,
};

} // namespace

static PyObject *created() {
    const Choice choice = choose_target(processor_level(), getenv("FEMIMPACT_CORE"));
    if (choice.target == nullptr) {
        return PyErr_Format(PyExc_ImportError, "%s", choice.refusal);
    }
    kernels = choice.target->kernels();
    return PyModule_Create2(&MODULE, PYTHON_ABI_VERSION);
}

} // namespace FEMIMPACT_TARGET

extern "C" FEMIMPACT_EXPORTED PyObject *PyInit__core(void) {
    return FEMIMPACT_TARGET::created();
}
