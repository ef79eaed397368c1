// The module's functions of the event-driven method: what Python hands over is checked, then a kernel takes it.
#pragma once

#include "../kernels.hpp"
#include "../tables.hpp"
#include "loop.hpp"

namespace FEMIMPACT_TARGET {

// Why closed forms would lead outside their arrays, or null.
inline const char *fault_of(const Forms &forms, Index most_numbers) {
    if (forms.made < 0 || forms.made > forms.key.size())
        return "forms.made: must be a number of forms";
    for (Index f = 0; f < forms.made; f++) {
        if (forms.following(f) < -1 || forms.following(f) >= forms.key.size())
            return "forms.following: must be -1 or numbers of forms";
        if (forms.number(f) < 0 || forms.number(f) >= most_numbers)
            return "forms.number: must be less than cases.known has columns";
        if (forms.entries(f) < 0 || forms.entries(f) > forms.exponent.shape[1])
            return "forms.entries: must be at most as many as there is room for";
        if (forms.driven(f) < 0 || forms.driven(f) > forms.entries(f))
            return "forms.driven: must be at most as many as there are entries";
        if (forms.rigid_bodies(f) < 0 || forms.rigid_bodies(f) > forms.rigid_body_drive.shape[1])
            return "forms.rigid_bodies: must be at most as many as there is room for";
        for (Index b = 0; b < forms.blocks.shape[1]; b++) {
            const Index first = forms.blocks(f, b, 0), length = forms.blocks(f, b, 1);
            if (first < 0 || length < 0 || first + length > forms.entries(f))
                return "forms.blocks: must lie within the entries";
        }
    }
    return nullptr;
}

// Why a case would lead outside its arrays or never end, or null.
inline const char *fault_of(const Cases &cases, const Grid &grid, const Forms &forms) {
    const double pairs = double(cases.state.shape[1]);
    for (Index c = 0; c < cases.omega.size(); c++) {
        if (!(grid.interval(c) > 0.0 && grid.interval(c) < INFINITE))
            return "grid.interval: must be finite and > 0";
        if (!(magnitude(cases.hit(c)) <= pairs))
            return "cases.hit: must be at most the number of pairs";
        if (cases.entering(c) < ENTERED || cases.entering(c) > STARTING)
            return "cases.entering: must be ENTERED to STARTING";
        if (cases.form(c, 0) < -1 || cases.form(c, 0) >= forms.key.size())
            return "cases.form: must be -1 or numbers of forms";
        if (cases.entering(c) == ENTERED && (cases.form(c, 1) < 0 || cases.form(c, 1) >= forms.made))
            return "cases.form: must be numbers of forms that were made";
        if (cases.piece(c) < 0 || cases.piece(c) > cases.knots.size())
            return "cases.piece: must be numbers of pieces";
        if (grid.cycle(c) < 0)
            return "grid.cycle: must be >= 0";
    }
    if (!(cases.longest > 0.0))
        return "cases.longest: must be > 0";
    if (cases.degree < -1 || cases.degree > DRIVE - 3)
        return "cases.degree: must be -1 to 5";
    for (Index i = 0; i < cases.knots.size(); i++)
        if (!(magnitude(cases.knots(i)) < INFINITE && (i == 0 || cases.knots(i) > cases.knots(i - 1))))
            return "cases.knots: must be finite and rise";
    return nullptr;
}

// Why a call would read or write outside its arrays or never end, or null: what shapes alone do not say.
inline const char *fault_of(const Task &task, const Job &job, const Ledger *ledger) {
    const Grid &grid = job.grid;
    const Index cases = job.cases.omega.size();
    if (const char *fault = fault_of(job.forms, job.cases.known.shape[1]))
        return fault;
    if (const char *fault = fault_of(job.cases, grid, job.forms))
        return fault;
    if (!(grid.per_cycle >= 1.0 && grid.per_cycle + 1.0 <= double(job.space.samples.size())))
        return "grid.per_cycle: must be >= 1, and less than space.samples has";
    if (cases > 1 && job.tables.impacts.shape[0] + job.tables.sticking.shape[0] + job.snapshots.shown.size() > 0)
        return "tables, snapshots: are of a single case";
    for (Index i = 0; i < task.members.size(); i++)
        if (task.members(i) < 0 || task.members(i) >= cases)
            return "task.members: must be numbers of cases";
    // losses are summed of the structure's coordinates only
    if (ledger != nullptr)
        for (Index i = ledger->loss_of_mode.shape[1]; i < ledger->damping.size(); i++)
            if (ledger->damping(i) != 0.0)
                return "ledger.damping: must be zero for balls";
    for (Index c = 0; c < cases; c++) {
        const Index samples = task.end(c) - task.begin(c), last = larger(job.cases.sample(c), task.begin(c));
        if (grid.cycle(c) < grid.cycles.shape[1] && cycle_begin(grid.cycle(c), c, grid) + grid.per_cycle < double(last))
            return "grid.origin: the cycle that goes on must not have ended before the first sample";
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
