// The module's functions of the methods with steps: what Python hands over is checked, then a kernel takes it.
#pragma once

#include "../kernels.hpp"
#include "../tables.hpp"
#include "loop.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Steps, cycles and samples beyond which a count is a mistake: products of two of them are integers of the loop.
constexpr double MOST = 1e15;

// Why an operator does not belong to a block, or null: its shapes by themselves are checked before.
inline const char *fault_of(const Operator &op, Index loads, Index dofs, Index places, Index pairs) {
    if (op.drive_load.size() != dofs || op.rows.shape[0] != places || op.response_a.shape[0] != pairs)
        return "operator: must be of as many dofs, places and pairs as the block";
    if (op.mass_band.shape[0] < 1 || op.cholesky_band.shape[0] < 1)
        return "operator: must have a band at least";
    if (op.narrow.columns.size() != 0 && op.narrow.columns.size() != 12 * (dofs + 6))
        return "operator.narrow.columns: must have none or 12 (n + 6) entries";
    if (op.narrow.columns.size() != 0 && op.narrow.factor.size() != 4 * (dofs + 6))
        return "operator.narrow.factor: must have 4 (n + 6) entries";
    if (op.more_load.shape[0] != loads || op.more_load.shape[1] != dofs)
        return "operator.more_load: must be of as many loads and dofs as the block";
    if (op.constant_load.size() != 0 && op.constant_load.size() != dofs)
        return "operator.constant_load: must have none or n entries";
    if (op.constant_w.shape[1] != (op.constant_load.size() == 0 ? 0 : places))
        return "operator.constant_w: must have a column for each place, or none";
    return nullptr;
}

// Why pairs would lead outside their arrays, or null.
inline const char *fault_of(const Pairs &pairs, Index places) {
    for (Index j = 0; j < pairs.row.size(); j++) {
        if (pairs.row(j) < 0 || pairs.row(j) >= places)
            return "cases.pairs.row: must be numbers of places";
        if (pairs.kind(j) == CUSTOM && pairs.address(j) == 0)
            return "cases.pairs.address: must be that of a function for a custom law";
    }
    for (Index k = 0; k < pairs.obstacles.size(); k++)
        if (pairs.obstacles(k) < 0 || pairs.obstacles(k) >= pairs.row.size())
            return "cases.pairs.obstacles: must be numbers of pairs";
    return nullptr;
}

// Why a record would be written outside its arrays, or null.
inline const char *fault_of(const Record &record, Index modes, Index modes_of_impacts, bool ledger) {
    if (record.stride(0) < 1 || record.stride(2) < 1)
        return "cases.record.stride: must be >= 1";
    for (Index k = 0; k < 4; k++)
        if (record.tally(k) < 0 || double(record.tally(k)) > MOST || magnitude(double(record.stride(k))) > MOST)
            return "cases.record.tally, stride: must be 0 to 1e15";
    if (ledger && record.channels.shape[1] > 0 &&
        (record.energy.shape[1] < record.channels.shape[1] || record.energy.shape[0] < ENERGY_COLUMNS + modes))
        return "cases.record.energy: must have a row for each energy and mode, and a column for each sample";
    if (record.impacts.shape[0] > 0 && record.impacts.shape[1] < IMPACT_COLUMNS + modes_of_impacts)
        return "cases.record.impacts: must have a column for each number of an impact and each mode";
    return nullptr;
}

// Why statistics of cycles would be written outside their arrays, or null; `last` is the step that the call ends at.
inline const char *fault_of(const Cycles &cycles, double last, bool ledger) {
    if (ledger && cycles.energy.shape[0] <= cycles.values.shape[0])
        return "cases.cycles.energy: must have a row more than cycles.values";
    if (cycles.energy.shape[0] < 1)
        return "cases.cycles.energy: must have a row";
    for (Index c = 0; c < cycles.number.size(); c++) {
        if (cycles.number(c) < 0 || double(cycles.number(c)) > MOST)
            return "cases.cycles.number: must be 0 to 1e15";
        if (!(cycles.period(c) > 0.0 && (double(cycles.number(c)) + last + 2.0) * cycles.period(c) < 9e18))
            return "cases.cycles.period: must be > 0, and so short that cycles have numbers";
    }
    return nullptr;
}

// Why several drives of a single case would lead outside their arrays, or null; `last` is the last fine step.
inline const char *fault_of_drives(const Motion &m, const Record &record, double last, bool ledger) {
    const Index loads = m.more.shape[0], drives = m.drives.shape[0];
    if (loads + drives > 0 && m.q.shape[1] != 1)
        return "cases.motion.more, drives: must be of a single case";
    if ((loads > 0 && double(m.more.shape[1]) <= last) || (drives > 0 && double(m.drives.shape[1]) <= last))
        return "cases.motion.more, drives: must reach to the last fine step";
    for (Index k = 0; k < drives; k++)
        if (m.drive_place(k) < 0 || m.drive_place(k) > loads)
            return "cases.motion.drive_place: must be numbers of loads";
    if (ledger && drives > 0 && record.work_of.shape[1] < record.channels.shape[1])
        return "cases.record.work_of: must have a column for each sample";
    return nullptr;
}

// Why a call of that many steps would read or write outside its arrays, or null: what shapes alone do not say.
inline const char *fault_of(Index steps, const Stepped &given, const Fine *fine) {
    const Motion &m = given.cases.motion;
    const Pairs &pairs = given.cases.pairs;
    const Record &record = given.cases.record;
    const Index dofs = m.q.shape[0], count = m.q.shape[1], places = m.w.shape[0], modes = m.loss_of_mode.size();
    const double parts = fine == nullptr ? 1.0 : double(fine->parts);
    if (steps < 0 || double(steps) > MOST)
        return "steps: must be 0 to 1e15";
    if (count != 1 && (count < WIDTH || count % WIDTH != 0))
        return "cases: must be one alone, or whole packs of eight";
    if (places < 1)
        return "cases.motion.w: must have a place";
    if (const char *fault = fault_of(given.structure, m.more.shape[0], dofs, places, pairs.row.size()))
        return fault;
    if (const char *fault = fault_of(pairs, places))
        return fault;
    if (const char *fault = fault_of(record, modes, m.to_modes.shape[1], given.ledger))
        return fault;
    const double last = double(record.tally(STEP)) + double(steps);
    if (const char *fault = fault_of(given.cases.cycles, last, given.ledger))
        return fault;
    if (modes != 0 && (modes != dofs || count != 1))
        return "cases.motion.loss_of_mode: must have none, or n entries of a single case";
    if (m.to_modes.shape[1] != 0 && (m.to_modes.shape[1] != dofs || count != 1))
        return "cases.motion.to_modes: must have none, or n columns of a single case";
    if (!(parts >= 1.0 && parts <= 1e6))
        return "fine.parts: must be 1 to 1e6";
    if (const char *fault = fault_of_drives(m, record, last * parts, given.ledger))
        return fault;
    if (m.table.shape[0] != 0 && double(m.table.shape[0]) <= last * parts)
        return "cases.motion.table: must reach to the last fine step";
    if (m.travel.shape[1] != 0 && double(m.travel.shape[1]) <= last * parts)
        return "cases.motion.travel: must reach to the last fine step";
    if (fine == nullptr)
        return nullptr;
    if (fine->structure.banded != given.structure.banded)
        return "fine.operator.banded: must be that of operator";
    if (parts > 1.0 && (m.saved.shape[1] != dofs || m.saved_ball.shape[1] != pairs.row.size()))
        return "cases.motion.saved, saved_ball: must hold all dofs and pairs";
    return fault_of(fine->structure, m.more.shape[0], dofs, places, pairs.row.size());
}

// What every function of the loop is handed, read and checked.
struct Handed {
    FromTuple arrays, fine_arrays;
    Stepped stepped;
    Fine fine;
    bool has_fine = false;

    // false with an exception where anything is not what the tables say
    bool read(PyObject *block, PyObject *fine_steps) {
        has_fine = fine_steps != Py_None;
        return arrays.read("block", block, stepped) && arrays.are_apart() &&
               (!has_fine || fine_arrays.read("fine", fine_steps, fine));
    }
    const Fine *given_fine() const { return has_fine ? &fine : nullptr; }
};

// advance(steps, block, fine or None)
inline PyObject *advance_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    Handed handed;
    if (!take_count(count, 3, "advance"))
        return nullptr;
    const Index steps = PyLong_AsLongLong(arguments[0]);
    if ((steps == -1 && PyErr_Occurred() != nullptr) || !handed.read(arguments[1], arguments[2]))
        return nullptr;
    const Fine *fine = handed.given_fine();
    return run_apart(fault_of(steps, handed.stepped, fine), [&] { kernels.advance(steps, &handed.stepped, fine); });
}

// keep_present(block), of the sample and the snapshot that are due at the present step, and write_energies(block).
template <auto KERNEL>
PyObject *block_entry(const femimpact_kernels &kernels, PyObject *const *arguments, Py_ssize_t count) {
    Handed handed;
    const char *name = KERNEL == &femimpact_kernels::keep_present ? "keep_present" : "write_energies";
    if (!take_count(count, 1, name) || !handed.read(arguments[0], Py_None))
        return nullptr;
    return run_apart(fault_of(0, handed.stepped, nullptr), [&] { (kernels.*KERNEL)(&handed.stepped); });
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
    if (law.kind == CUSTOM && law.address == 0)
        return PyErr_Format(PyExc_ValueError, "law.address: must be that of a function for a custom law");
    const double positive[] = {numbers[0], numbers[1], scheme.dt};
    for (double number : positive)
        if (!(number > 0.0 && number < INFINITE))
            return PyErr_Format(PyExc_ValueError, "mass, speed, scheme.dt: must be finite and > 0");
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
