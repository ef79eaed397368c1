// femimpact._core: Python's side of the kernels, in the limited API. Compiled once, for the lowest processor.
#include "arguments.hpp"
#include "contact/entries.hpp"
#include "event_driven/entries.hpp"
#include "stepping/entries.hpp"
#include "targets.hpp"

#include <cstdlib>

// the build gives FEMIMPACT_COMPILER, FEMIMPACT_KIND, FEMIMPACT_SOURCES and FEMIMPACT_KEY, each a text
namespace FEMIMPACT_TARGET {

namespace {

// found by the build in the file of the binary, without loading it
__attribute__((used)) const char KEY[] = "femimpact build key " FEMIMPACT_KEY;

// chosen when the module is imported
const femimpact_kernels *kernels = nullptr;

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
    // the dictionary takes the tuple; where that is null its exception stays
    return Py_BuildValue("{sssNssssss}", "target", kernels->target, "targets", target_names(), "compiler",
                         FEMIMPACT_COMPILER, "sources", FEMIMPACT_SOURCES, "kind", FEMIMPACT_KIND);
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
    return run_apart([&] { kernels->exponentials(exponent.doubles(), time, out.doubles(), exponent.size(0)); });
}

PyObject *cosine_and_sine(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    double angle = 0.0, cosine = 0.0, sine = 0.0;
    if (!take_count(count, 1, "cosine_and_sine") || !take_number(arguments[0], "angle", &angle)) {
        return nullptr;
    }
    kernels->cosine_and_sine(angle, &cosine, &sine);
    return Py_BuildValue("(dd)", cosine, sine);
}

// A function that is handed the kernels too.
template <auto ENTRY> PyObject *entry(PyObject *, PyObject *const *arguments, Py_ssize_t count) {
    return ENTRY(*kernels, arguments, count);
}

PyObject *tables(PyObject *, PyObject *) {
    PyObject *list = PyList_New(0);
    if (list == nullptr) {
        return nullptr;
    }
    ToList rows(list);
    list_tables(rows);
    stepping::list_tables(rows);
    if (!rows.failed()) {
        return list;
    }
    Py_DecRef(list);
    return nullptr;
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
    {FORMULAS[0].name, method(entry<formula_entry<0>>), METH_FASTCALL, FORMULAS[0].document},
    {FORMULAS[1].name, method(entry<formula_entry<1>>), METH_FASTCALL, FORMULAS[1].document},
    {FORMULAS[2].name, method(entry<formula_entry<2>>), METH_FASTCALL, FORMULAS[2].document},
    {FORMULAS[3].name, method(entry<formula_entry<3>>), METH_FASTCALL, FORMULAS[3].document},
    {FORMULAS[4].name, method(entry<formula_entry<4>>), METH_FASTCALL, FORMULAS[4].document},
    {"advance", method(entry<stepping::advance_entry>), METH_FASTCALL,
     "advance(steps, block, fine, /)\n--\n\nTake a block of cases that many steps on; the arrays are written to."},
    {"keep_present", method(entry<stepping::block_entry<&femimpact_kernels::keep_present>>), METH_FASTCALL,
     "keep_present(block, /)\n--\n\nWrite the sample and the snapshot that are due at the present step."},
    {"write_energies", method(entry<stepping::block_entry<&femimpact_kernels::write_energies>>), METH_FASTCALL,
     "write_energies(block, /)\n--\n\nWrite the energies of every case to the first row of its statistics."},
    {"collide", method(entry<stepping::collide_entry>), METH_FASTCALL,
     "collide(law, mass, speed, start, scheme, /)\n--\n\nRebound over approach speed, peak force (N), and what a "
     "custom law was given for a force that is no number."},
    {"run_cases", method(entry<run_cases_entry>), METH_FASTCALL,
     "run_cases(task, job, ledger, /)\n--\n\nTake event-driven cases to their last samples; the arrays are written "
     "to."},
    {"next_event", method(entry<next_event_entry>), METH_FASTCALL,
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
