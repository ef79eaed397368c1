// The loop over steps.
#pragma once

#include "recording.hpp"
#include "refine.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Whether a custom law has given a force that is no number.
inline bool any_refused(const Pairs &pairs) {
    bool refused = false;
    for (Index j = 0; j < pairs.refused.shape[0]; j++)
        refused = refused || pairs.refused(j, 0) != 0.0;
    return refused;
}

// One step of one case or of a pack of them, contact included. Returns how many took it in fine steps.
template <bool BANDED, bool LOOKS_AHEAD, class Value>
[[gnu::always_inline]] inline Index step_cases(Index c, FreeBall free, const Stepped &given, const Fine *fine) {
    const Operator &op = given.structure;
    const Scheme &s = given.scheme;
    const Pairs &pairs = given.cases.pairs;
    const Motion &m = given.cases.motion;
    const Value acting = acting_drive<Value>(s.alpha_f, m.drive, c);
    if (LOOKS_AHEAD && s.rigid)
        for (Index j = 0; j < pairs.row.size(); j++)
            look_ahead<Value>(j, c, 0.5 * s.dt, pairs, m);
    free_step<BANDED>(op, s, m, c, acting);
    const Index parts = LOOKS_AHEAD ? fine->parts : 1, begun = parts * given.cases.record.tally(STEP);
    if (m.more.shape[0] > 0)
        add_further_loads(begun, begun + parts, op, s, m);
    unsigned reached = 0, near = 0;
    for (Index j = 0; j < pairs.row.size(); j++) {
        const Index r = pairs.row(j);
        reached |= step_ball(j, c, acting, load<Value>(m.w.row(r), c), free, s, pairs, m);
        if (LOOKS_AHEAD)
            keep_rate(j, c, load<Value>(m.w_rate.row(r), c), m);
        if (LOOKS_AHEAD && parts > 1)
            near |= near_walls<Value>(j, c, s.dt, pairs, m);
    }
    const double end = double(given.cases.record.tally(STEP) + 1) * s.dt;
    // contact is rare: one case after the other
    for (unsigned left = reached & ~near; left != 0; left &= left - 1)
        contact_step(c + __builtin_ctz(left), end, op, s, given.cases);
    if (LOOKS_AHEAD)
        for (unsigned left = near; left != 0; left &= left - 1)
            redo_step<BANDED>(c + __builtin_ctz(left), s.dt, *fine, given.cases, given.ledger);
    // a single case that was refined has summed all by itself; of a pack its sums are restored
    if (given.ledger && near == 0 && m.drives.shape[0] > 0)
        add_work_of_drives(begun, begun + parts, op, pairs, m);
    if (given.ledger && (near == 0 || m.q.shape[1] > 1))
        write_ledger<BANDED>(c, load<Value>(m.drive.row(BASE), c), load<Value>(m.drive.row(BASE_BEFORE), c), op, s,
                             pairs, m);
    return __builtin_popcount(near);
}

// Takes that many steps with every case; all results are written into the arrays given. `fine` is read only by a method
// that divides steps or looks ahead.
template <bool BANDED, bool LOOKS_AHEAD> inline void advance_all(Index steps, const Stepped &given, const Fine *fine) {
    const Scheme &s = given.scheme;
    const Pairs &pairs = given.cases.pairs;
    const Motion &m = given.cases.motion;
    const Cycles &cycles = given.cases.cycles;
    const Record &record = given.cases.record;
    const bool recording = record.channels.shape[1] + record.snapshots.shape[0] > 0, sampled = m.table.shape[0] > 0;
    const Index parts = LOOKS_AHEAD ? fine->parts : 1, count = m.q.shape[1];
    const FreeBall free = free_ball(s);
    // packs go through all parts of a step at once where nothing concerns all cases between two of them
    const bool at_once = count > 1 && !LOOKS_AHEAD && !sampled && pairs.obstacles.size() == 0;
    Index next_wrap = least(cycles.next_wrap);
    for (Index k = 0; k < steps; k++) {
        const Index step = record.tally(STEP) + 1;
        const bool apart = !at_once || step == next_wrap;
        if (apart)
            over_cases(count, [&](auto zero, Index c) { turn_drive<decltype(zero)>(m.drive, c); });
        if (sampled)
            for (Index c = 0; c < count; c++)
                m.drive(BASE, c) = m.table(parts * step, c);
        if (LOOKS_AHEAD && parts > 1)
            save_state(m);
        if (pairs.obstacles.size() > 0)
            move_obstacles(parts * step, s, pairs, m);
        Index refined = 0;
        over_cases(count, [&](auto zero, Index c) {
            const bool is_pack = sizeof(zero) > sizeof(double) && !apart;
            if (is_pack)
                turn_drive<decltype(zero)>(m.drive, c);
            refined += step_cases<BANDED, LOOKS_AHEAD, decltype(zero)>(c, free, given, fine);
            if (is_pack)
                observe<decltype(zero)>(step, c, s, m, cycles);
        });
        if (any_refused(pairs))
            return;
        if (step == next_wrap)
            split_cycles(step, s, m, cycles);
        if (refined > 0)
            restore_refined_cases(m.ledger);
        if (apart)
            over_cases(count, [&](auto zero, Index c) { observe<decltype(zero)>(step, c, s, m, cycles); });
        record.tally(STEP) = step;
        if (step == next_wrap) {
            close_cycles(step, given);
            next_wrap = least(cycles.next_wrap);
        }
        if (recording && any_due(step, record))
            keep(step, given);
    }
}

// The same, compiled for each kind of structure and of method.
inline void advance(Index steps, const Stepped &given, const Fine *fine) {
    if (given.structure.banded)
        fine == nullptr ? advance_all<true, false>(steps, given, fine) : advance_all<true, true>(steps, given, fine);
    else
        fine == nullptr ? advance_all<false, false>(steps, given, fine) : advance_all<false, true>(steps, given, fine);
}

// Writes the energies of every case as they are before its first cycle.
inline void write_energies(const Stepped &given) {
    Array energy = given.cases.energy_scratch;
    for (Index c = 0; c < given.cases.motion.q.shape[1]; c++) {
        write_energy(c, given.structure, given.cases.pairs, given.cases.motion, energy);
        for (Index i = 0; i < ENERGY_COLUMNS; i++)
            given.cases.cycles.energy(0, i, c) = energy(i);
    }
}

} // namespace FEMIMPACT_TARGET::stepping
