// The module's functions of the event-driven method: what Python hands over is checked, then a kernel takes it.
#pragma once

#include "../kernels.hpp"
#include "../tables.hpp"
#include "loop.hpp"

namespace FEMIMPACT_TARGET {

// run_cases(task, job, ledger or None)
inline PyObject *run_cases_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    if (!take_count(count, 3, "run_cases"))
        return nullptr;
    FromTuple handed;
    Task task = {};
    Job job = {};
    Ledger ledger = {};
    const bool has_ledger = arguments[2] != Py_None;
    if (!handed.read("job", arguments[1], job) || !handed.read("task", arguments[0], task) ||
        (has_ledger && !handed.read("ledger", arguments[2], ledger)))
        return nullptr;
    return run_apart([&] { kernels.run_cases(&task, &job, has_ledger ? &ledger : nullptr); });
}

// next_event((scalars, motion, search), until)
inline PyObject *next_event_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    if (!take_count(count, 2, "next_event"))
        return nullptr;
    FromTuple handed;
    SearchCall call = {};
    double until = 0.0;
    if (!handed.read("call", arguments[0], call) || !take_number(arguments[1], "until", &until))
        return nullptr;
    std::int64_t status = 0;
    {
        const WithoutLock others_run;
        status = kernels.next_event(&call, until);
    }
    return PyLong_FromLongLong(status);
}

// Lists the tables of all that these functions are handed.
inline void list_tables(ToList &rows) {
    Task task;
    Job job;
    Ledger ledger;
    SearchCall search_call;
    rows.group("task", task, "Task");
    rows.group("job", job, "Job");
    rows.group("ledger", ledger, "Ledger");
    rows.group("search_call", search_call, "SearchCall");
    rows.enumeration("events", ENTRY_NAMES);
    rows.enumeration("events", TOUCH_NAMES);
    rows.enumeration("events", STOP_NAMES);
    rows.enumeration("search", SEARCH_NAMES);
    rows.enumeration("cycle", CYCLE_NAMES);
    rows.enumeration("energy", ENERGY_NAMES);
    rows.enumeration("impact", IMPACT_NAMES);
    rows.enumeration("event", EVENT_NAMES);
    rows.enumeration("kind of event", EVENT_KIND_NAMES);
    rows.enumeration("total", TOTAL_NAMES);
    rows.enumeration("law kind", KIND_NAMES);
}

} // namespace FEMIMPACT_TARGET
