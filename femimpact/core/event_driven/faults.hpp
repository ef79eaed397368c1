// Why a call would read or write outside its arrays, or never end: what types and shapes alone do not say.
//
// Indices that a run writes itself follow from those that it is given, as its times do; no two arrays that share memory
// are taken, of which one is written to. So the kernels index without looking.
#pragma once

#include "loop.hpp"

namespace FEMIMPACT_TARGET {

// Most that a number of a sample, an event or a row may be: each is a double too.
constexpr Index MOST_COUNTED = Index(1) << 52;

// Most pairs: each is a bit of a form's key.
constexpr Index MOST_PAIRS = 62;

// Of a piece of s(t).
constexpr Index HIGHEST_DEGREE = DRIVE - 3;

// Time between two samples as a share of the times themselves, below which rounding may exchange them.
constexpr double LEAST_INTERVAL = 1e-14;

inline bool is_countable(Index a) {
    return -MOST_COUNTED <= a && a <= MOST_COUNTED;
}
inline bool is_within(Index a, Index least, Index most) {
    return least <= a && a <= most;
}

// ---- closed forms -----------------------------------------------------------------------------------

// Whether blocks lie within the entries.
inline bool blocks_fit(View<const Index, 2> blocks, Index entries) {
    for (Index b = 0; b < blocks.shape[0]; b++)
        if (!is_within(blocks(b, 0), 0, entries) || !is_within(blocks(b, 1), 0, entries - blocks(b, 0)))
            return false;
    return true;
}

// Whether all values are finite.
inline bool are_finite(GivenArray values) {
    // a product with zero is zero, or not a number
    double total = 0.0;
    for (Index i = 0; i < values.size(); i++)
        total += 0.0 * values(i);
    return total == 0.0;
}

// Whether exponents and their sizes are finite: integrals over an infinite one take steps of no length.
inline bool are_finite(GivenComplexArray exponent, GivenArray size) {
    return are_finite({reinterpret_cast<const double *>(exponent.data), {2 * exponent.size()}}) &&
           are_finite(size.first(exponent.size()));
}

// Whether the coordinates of a form are moved by entries of it.
inline bool members_fit(GivenIndices first, GivenIndices members, Index entries) {
    Index last = 0;
    for (Index i = 0; i < first.size(); i++) {
        if (!is_within(first(i), last, members.size()))
            return false;
        last = first(i);
    }
    // unsigned: a negative one is a large one
    unsigned long long largest = 0;
    for (Index m = 0; m < last; m++) {
        const auto member = static_cast<unsigned long long>(members(m));
        largest = member > largest ? member : largest;
    }
    return last == 0 || largest < static_cast<unsigned long long>(entries);
}

inline const char *fault_of(const Forms &forms, Index most_numbers) {
    if (!is_within(forms.made, 0, forms.key.size()))
        return "forms.made: must be a number of forms";
    for (Index f = 0; f < forms.made; f++) {
        // a form that follows stands behind: the search for one ends
        if (forms.following(f) != -1 && !is_within(forms.following(f), f + 1, forms.key.size() - 1))
            return "forms.following: must be -1 or numbers of later forms";
        if (!is_within(forms.number(f), 0, most_numbers - 1))
            return "forms.number: must be less than cases.known has columns";
        if (!is_within(forms.entries(f), 0, forms.exponent.shape[1]))
            return "forms.entries: must be at most as many as there is room for";
        if (!is_within(forms.driven(f), 0, forms.entries(f)))
            return "forms.driven: must be at most as many as there are entries";
        if (!is_within(forms.slow(f), 0, forms.driven(f)))
            return "forms.slow: must be at most as many as are driven";
        if (!is_within(forms.rigid_bodies(f), 0, forms.rigid_body_drive.shape[2]))
            return "forms.rigid_bodies: must be at most as many as there is room for";
        if (!blocks_fit(forms.blocks.row(f), forms.entries(f)))
            return "forms.blocks: must lie within the entries";
        if (!are_finite(forms.exponent.row(f).first(forms.entries(f)), forms.size.row(f)))
            return "forms.exponent, forms.size: must be finite";
        if (!members_fit(forms.first.row(f), forms.members.row(f), forms.entries(f)))
            return "forms.first, forms.members: must be ascending, and numbers of entries";
    }
    return nullptr;
}

// ---- cases ------------------------------------------------------------------------------------------

// Of where cases are among the polynomials that s(t) is made of.
inline const char *fault_of_pieces(const Cases &cases) {
    if (!is_within(cases.degree, -1, HIGHEST_DEGREE))
        return "cases.degree: must be -1 to 5";
    if (!(cases.longest > 0.0))
        return "cases.longest: must be > 0";
    if (cases.drive.shape[1] < DRIVE)
        return "cases.drive: must have a load";
    for (Index c = 0; c < cases.omega.size(); c++) {
        for (Index i = 0; i < cases.drive.shape[1]; i++)
            if (!is_finite(cases.drive(c, i)))
                return "cases.drive: must be finite";
        if (!is_within(cases.piece(c), 0, larger(Index(0), cases.knots.size() - 1)))
            return "cases.piece: must be numbers of pieces";
    }
    return nullptr;
}

inline const char *fault_of(const Cases &cases, const Forms &forms) {
    const double pairs = double(cases.state.shape[1]);
    for (Index c = 0; c < cases.omega.size(); c++) {
        if (!(cases.omega(c) >= 0.0 && is_finite(cases.omega(c))))
            return "cases.omega: must be finite and >= 0";
        if (!is_finite(cases.clock(c, 0)))
            return "cases.clock: must be finite";
        if (cases.hit(c) != 0.0 && !(magnitude(cases.hit(c)) >= 1.0 && magnitude(cases.hit(c)) <= pairs))
            return "cases.hit: must be 0, or the number from 1 of a pair times a side";
        if (!is_within(cases.entering(c), ENTERED, STARTING))
            return "cases.entering: must be ENTERED to STARTING";
        if (!is_within(cases.form(c, 0), -1, forms.key.size() - 1))
            return "cases.form: must be -1 or numbers of forms";
        if (cases.entering(c) == ENTERED && !is_within(cases.form(c, 1), 0, forms.made - 1))
            return "cases.form: must be numbers of forms that were made";
        if (!is_countable(cases.sample(c)))
            return "cases.sample: must be at most 2^52";
        if (!is_countable(cases.events(c, 0)) || !is_countable(cases.events(c, 1)))
            return "cases.events: must be at most 2^52";
    }
    return fault_of_pieces(cases);
}

// Of the polynomials that a case meets until a time: a long record has many more.
inline const char *fault_of_pieces(Index c, double until, const Cases &cases) {
    const Index knots = cases.knots.size(), piece = cases.piece(c);
    for (Index i = piece; i < knots; i++) {
        if (!is_finite(cases.knots(i)) || !(i == piece || cases.knots(i) > cases.knots(i - 1)))
            return "cases.knots: must be finite and rise";
        if (!are_finite(cases.pieces.row(i)))
            return "cases.pieces: must be finite";
        if (cases.knots(i) > until)
            break;
    }
    if (piece + 1 < knots && !(cases.clock(c, 0) <= cases.knots(piece + 1)))
        return "cases.piece: must not have ended before the present time";
    return nullptr;
}

// Of the times and cycles that a call reads.
inline const char *fault_of(const Task &task, const Cases &cases, const Grid &grid) {
    for (Index c = 0; c < cases.omega.size(); c++) {
        if (!(grid.interval(c) > 0.0 && is_finite(grid.interval(c))))
            return "grid.interval: must be finite and > 0";
        if (!is_finite(grid.start(c)))
            return "grid.start: must be finite";
        if (!is_countable(grid.origin(c)))
            return "grid.origin: must be at most 2^52";
        if (grid.cycle(c) < 0)
            return "grid.cycle: must be >= 0";
        if (!is_countable(task.begin(c)) || !is_countable(task.end(c)))
            return "task.begin, task.end: must be at most 2^52";
        if (!is_finite(task.most(c)))
            return "task.most: must be finite";
        if (grid.cycle(c) >= grid.cycles.shape[1])
            continue;
        const double last = double(larger(cases.sample(c), task.begin(c)));
        const double begun = cycle_begin(grid.cycle(c), c, grid);
        if (begun + grid.per_cycle < last)
            return "grid.origin: the cycle that goes on must not have ended before the first sample";
        if (grid.cycle(c) > 0 && begun >= last + 1.0)
            return "grid.cycle: the cycle that goes on must have begun before the first sample";
    }
    for (Index i = 0; i < task.members.size(); i++) {
        const Index c = task.members(i);
        if (!is_within(c, 0, cases.omega.size() - 1))
            return "task.members: must be numbers of cases";
        const double interval = grid.interval(c), until = grid.start(c) + double(task.end(c)) * interval;
        if (!(interval > LEAST_INTERVAL * larger(magnitude(grid.start(c)), magnitude(until))))
            return "grid.interval: must be more than what rounding makes of the times";
        const double latest = larger(magnitude(cases.clock(c, 0)), magnitude(until));
        if (cases.degree > 1 && !(cases.longest > LEAST_INTERVAL * latest))
            return "cases.longest: must be more than what rounding makes of the times";
        // half an interval: what an event leaves may be rounded
        if (!(cases.clock(c, 0) <= until + 0.5 * interval))
            return "cases.clock: must not be later than the last sample";
        if (const char *fault = fault_of_pieces(c, latest, cases))
            return fault;
    }
    return nullptr;
}

// ---- calls ------------------------------------------------------------------------------------------

// Of the work of each of several drives.
inline const char *fault_of_drives(const Job &job, const Ledger &ledger) {
    const Index drives = ledger.drive_load.shape[0], rows = job.grid.work_of.shape[1];
    if (ledger.drive_pieces.shape[0] != 0 && ledger.drive_pieces.shape[0] != job.cases.knots.size())
        return "ledger.drive_pieces: must be none, or one at each knot";
    if (drives > 0 && job.cases.degree >= 0 && ledger.drive_pieces.shape[0] == 0)
        return "ledger.drive_pieces: must be given where the drive has pieces";
    if (rows != 0 && rows < job.grid.energy.shape[1])
        return "grid.work_of: must have no rows, or those of grid.energy";
    return nullptr;
}

// Of the rows that samples, snapshots and energies are written to.
inline const char *fault_of_rows(const Task &task, const Job &job, const Ledger *ledger) {
    const Grid &grid = job.grid;
    const Index energies = ledger != nullptr ? grid.energy.shape[1] : 0, shown = job.snapshots.shown.size();
    for (Index c = 0; c < job.cases.omega.size(); c++) {
        const Index samples = task.end(c) - task.begin(c);
        if (energies > 0 && samples > grid.kept.size())
            return "grid.kept: must have a row number for each sample";
        if (shown > 0 && samples > shown)
            return "snapshots.shown: must have a number for each sample";
    }
    for (Index i = 0; energies > 0 && i < grid.kept.size(); i++)
        if (grid.kept(i) >= energies)
            return "grid.kept: must be rows of grid.energy";
    for (Index i = 0; i < shown; i++)
        if (job.snapshots.shown(i) >= job.snapshots.fields_of.shape[0])
            return "snapshots.shown: must be numbers of snapshots";
    if (!is_within(job.tables.number(0), 0, MOST_COUNTED) || !is_within(job.tables.number(1), 0, MOST_COUNTED))
        return "tables.number: must be from 0 to 2^52";
    for (Index c = 0; c < job.tables.logged.size(); c++)
        if (!is_within(job.tables.logged(c), 0, MOST_COUNTED))
            return "tables.logged: must be from 0 to 2^52";
    return nullptr;
}

inline const char *fault_of(const Task &task, const Job &job, const Ledger *ledger) {
    const Grid &grid = job.grid;
    const Index pairs = job.cases.state.shape[1], coordinates = job.cases.coordinates.shape[2];
    // of coordinates of the structure: what a table of impacts and a row of energies have room for
    const Index modes = grid.energy.shape[2] - ENERGY_COLUMNS;
    if (pairs > MOST_PAIRS)
        return "cases.state: must be of at most 62 pairs";
    if (modes > coordinates || job.cases.to_modes.shape[2] > modes)
        return "cases.to_modes, grid.energy: must have at most a column for each coordinate of the structure";
    if (!(grid.per_cycle >= 1.0 && grid.per_cycle + 1.0 <= double(job.space.samples.size())))
        return "grid.per_cycle: must be >= 1, and less than space.samples has";
    if (grid.cycles.shape[1] > 0 && grid.values.shape[2] == 0)
        return "grid.cycles: must be none without an output";
    if (job.cases.omega.size() > 1 &&
        job.tables.impacts.shape[0] + job.tables.sticking.shape[0] + job.snapshots.shown.size() > 0)
        return "tables, snapshots: are of a single case";
    // losses are summed of the structure's coordinates only
    if (ledger != nullptr)
        for (Index i = modes; i < ledger->damping.size(); i++)
            if (ledger->damping(i) != 0.0)
                return "ledger.damping: must be zero for balls";
    if (const char *fault = fault_of(job.forms, job.cases.known.shape[1]))
        return fault;
    if (const char *fault = fault_of(job.cases, job.forms))
        return fault;
    if (const char *fault = fault_of(task, job.cases, grid))
        return fault;
    if (ledger != nullptr)
        if (const char *fault = fault_of_drives(job, *ledger))
            return fault;
    return fault_of_rows(task, job, ledger);
}

inline const char *fault_of(const SearchCall &call, double until) {
    if (__builtin_isnan(until))
        return "until: must be a number";
    if (!(call.scalars.omega >= 0.0 && is_finite(call.scalars.omega)))
        return "call.scalars.omega: must be finite and >= 0";
    if (!is_finite(call.motion.clock(0)))
        return "call.motion.clock: must be finite";
    if (call.motion.drive.size() < DRIVE)
        return "call.motion.drive: must have a load";
    if (!blocks_fit(call.scalars.blocks, call.scalars.exponent.size()))
        return "call.scalars.blocks: must lie within the entries";
    if (!is_within(call.scalars.driven, 0, call.scalars.exponent.size()) ||
        !is_within(call.scalars.slow, 0, call.scalars.driven))
        return "call.scalars.driven, call.scalars.slow: must be at most as many as there are entries, or are driven";
    if (!are_finite(call.scalars.exponent, call.scalars.size))
        return "call.scalars.exponent, call.scalars.size: must be finite";
    return nullptr;
}

} // namespace FEMIMPACT_TARGET
