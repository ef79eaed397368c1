// The module's functions of the event-driven method: what Python hands over is checked, then a kernel takes it.
#pragma once

#include "../kernels.hpp"
#include "../tables.hpp"
#include "loop.hpp"

namespace FEMIMPACT_TARGET {

// Why a call would read or write outside its arrays, or null: what shapes alone do not say.
inline const char *fault_of(const Task &task, const Job &job, const Ledger *ledger) {
    const Grid &grid = job.grid;
    const Index cases = job.cases.omega.size();
    if (job.forms.made < 0 || job.forms.made > job.forms.key.size())
        return "forms.made: must be a number of forms";
    if (!(grid.per_cycle >= 1.0 && grid.per_cycle + 1.0 <= double(job.space.samples.size())))
        return "grid.per_cycle: must be >= 1, and less than space.samples has";
    if (cases > 1 && job.tables.impacts.shape[0] + job.tables.sticking.shape[0] + job.snapshots.shown.size() > 0)
        return "tables, snapshots: are of a single case";
    for (Index i = 0; i < task.members.size(); i++)
        if (task.members(i) < 0 || task.members(i) >= cases)
            return "task.members: must be numbers of cases";
    for (Index c = 0; c < cases; c++) {
        const Index samples = task.end(c) - task.begin(c);
        if (ledger != nullptr && grid.energy.shape[1] > 0 && samples > grid.kept.size())
            return "grid.kept: must have a row number for each sample";
        if (job.snapshots.shown.size() > 0 && samples > job.snapshots.shown.size())
            return "snapshots.shown: must have a number for each sample";
    }
    for (Index i = 0; i < grid.kept.size(); i++)
        if (grid.kept(i) >= grid.energy.shape[1] && ledger != nullptr && grid.energy.shape[1] > 0)
            return "grid.kept: must be rows of grid.energy";
    for (Index i = 0; i < job.snapshots.shown.size(); i++)
        if (job.snapshots.shown(i) >= job.snapshots.fields_of.shape[0])
            return "snapshots.shown: must be numbers of snapshots";
    return nullptr;
}

// run_cases(task, job, ledger or None)
inline PyObject *run_cases_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    if (!take_count(count, 3, "run_cases"))
        return nullptr;
    FromTuple handed;
    Task task;
    Job job;
    Ledger ledger;
    const bool has_ledger = arguments[2] != Py_None;
    if (!handed.read("job", arguments[1], job) || !handed.read("task", arguments[0], task) ||
        (has_ledger && !handed.read("ledger", arguments[2], ledger)))
        return nullptr;
    const Ledger *given = has_ledger ? &ledger : nullptr;
    if (const char *fault = fault_of(task, job, given))
        return PyErr_Format(PyExc_ValueError, "%s", fault);
    {
        const WithoutLock others_run;
        kernels.run_cases(&task, &job, given);
    }
    Py_IncRef(Py_None);
    return Py_None;
}

// next_event((scalars, motion, search), until)
inline PyObject *next_event_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    if (!take_count(count, 2, "next_event"))
        return nullptr;
    FromTuple handed;
    SearchCall call;
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

// handed_over(): names of the structs with their tables
inline PyObject *tables_of_entries() {
    PyObject *list = PyList_New(0);
    if (list == nullptr)
        return nullptr;
    Task task;
    Job job;
    Ledger ledger;
    SearchCall search_call;
    ToList rows(list);
    rows.group("task", task);
    rows.group("job", job);
    rows.group("ledger", ledger);
    rows.group("search_call", search_call);
    if (!rows.failed())
        return list;
    Py_DecRef(list);
    return nullptr;
}

} // namespace FEMIMPACT_TARGET
