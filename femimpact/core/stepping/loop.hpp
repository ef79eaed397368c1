// The loop over steps.
#pragma once

#include "keeping.hpp"
#include "refine.hpp"

namespace FEMIMPACT_TARGET::stepping {

// The structure without contact force of every case, and what is read of it.
template <bool BANDED>
[[gnu::always_inline]] inline void free_step(const Operator &op, const Scheme &s, const Motion &m, Array acting) {
    over_cases(m.q.shape[1], [&](auto zero, Index c) {
        using Value = decltype(zero);
        if constexpr (BANDED) {
            step_bands(op, s, m, c, load<Value>(acting, c));
            read_rows<Value>(op.rows, 0, m, c);
        } else {
            auto place = step_modes(op.modes, op.rows.row(0), s, m, c, load<Value>(acting, c));
            store(place.w, m.w.row(0), c);
            store(place.rate, m.w_rate.row(0), c);
            read_rows<Value>(op.rows, 1, m, c);
        }
        if (op.constant_load.size() > 0) {
            add_constant_load<Value>(op, m, c);
            add_constant_load_to_places<Value>(op, m, c);
        }
    });
}

// Work and losses of the step of every case.
template <bool BANDED> inline void write_ledger(const Stepped &given) {
    const Operator &op = given.structure;
    const Pairs &pairs = given.cases.pairs;
    const Motion &m = given.cases.motion;
    over_cases(m.q.shape[1], [&](auto zero, Index c) {
        using Value = decltype(zero);
        Value held;
        if constexpr (BANDED)
            held = add_loss_of_bands<Value>(op, given.scheme, m, c);
        else if (m.loss_of_mode.size() > 0)
            held = zero + add_loss_mode_by_mode(op, m);
        else
            held = add_loss_of_modes<Value>(op, m, c);
        add_work(load<Value>(m.drive.row(BASE), c), load<Value>(m.drive.row(BASE_BEFORE), c), held, pairs, m, c);
    });
}

// Contact of the cases in reach of a wall, but for those that took fine steps and have had theirs.
//
// No more than `looking` pairs are.
template <bool LOOKS_AHEAD> [[gnu::noinline]] inline void touch_walls(Index looking, const Stepped &given) {
    const Pairs &pairs = given.cases.pairs;
    const Motion &m = given.cases.motion;
    const double time = double(given.cases.record.tally(0) + 1) * given.scheme.dt;
    const Index cases = m.q.shape[1];
    Index skipped = 0;
    for (Index c = 0; c < cases; c++) {
        // packs without contact are passed over whole
        if (c % WIDTH == 0 && cases > 1 && in_reach<Pack>(c, pairs, m) == 0)
            skipped = c + WIDTH;
        if (c < skipped)
            continue;
        const Index reached = in_reach<double>(c, pairs, m);
        if (reached == 0)
            continue;
        // the pairs of such a case are counted as they were before its fine steps
        if (LOOKS_AHEAD && m.ledger(REFINED, c) > 0.0)
            continue;
        looking -= reached;
        contact_step(c, time, given.structure, given.scheme, given.cases);
        if (looking <= 0)
            break;
    }
}

// Takes cases in which a contact lasts or could have begun through the step in fine ones; returns how many.
template <bool BANDED> inline Index redo_steps(const Stepped &given, const Fine &fine) {
    Index refined = 0;
    if (fine.parts == 1)
        return refined;
    for (Index c = 0; c < given.cases.motion.q.shape[1]; c++)
        if (is_near(c, given.cases.motion)) {
            redo_step<BANDED>(c, given.scheme.dt, fine, given.cases, given.ledger);
            refined++;
        }
    return refined;
}

// Whether a custom law has given a force that is no number.
inline bool any_refused(const Pairs &pairs) {
    bool refused = false;
    for (Index j = 0; j < pairs.refused.shape[0]; j++)
        refused = refused || pairs.refused(j, 0) != 0.0;
    return refused;
}

// Takes that many steps with every case; all results are written into the arrays given. `fine` is read only by a method
// that divides steps or looks ahead.
template <bool BANDED, bool LOOKS_AHEAD> inline void advance_all(Index steps, const Stepped &given, const Fine *fine) {
    const Operator &op = given.structure;
    const Scheme &s = given.scheme;
    const Pairs &pairs = given.cases.pairs;
    const Motion &m = given.cases.motion;
    const Cycles &cycles = given.cases.cycles;
    const Record &record = given.cases.record;
    const bool keeping = record.channels.shape[0] + record.snapshots.shape[0] > 0, sampled = m.table.shape[0] > 0;
    const Array base = m.drive.row(BASE), acting = s.alpha_f != 0.0 ? m.drive.row(ACTING) : base;
    const Index parts = LOOKS_AHEAD ? fine->parts : 1;
    Index next_wrap = least(cycles.next_wrap);
    if (given.ledger && !BANDED)
        for (Index i = 0; i < op.drive_load.size(); i++)
            m.scratch(0, i, 0) = 0.25 * s.dt * op.damping_band(0, i);
    for (Index k = 0; k < steps; k++) {
        const Index step = record.tally(STEP) + 1;
        turn_drive(m.drive);
        if (sampled)
            read_drive(m.table.row(parts * step), base);
        if (s.alpha_f != 0.0)
            blend_drive(s.alpha_f, m.drive);
        if (LOOKS_AHEAD && parts > 1)
            save_state(m);
        if (LOOKS_AHEAD && s.rigid)
            for (Index j = 0; j < pairs.row.size(); j++)
                look_ahead(j, 0.5 * s.dt, pairs, m);
        free_step<BANDED>(op, s, m, acting);
        if (pairs.obstacles.size() > 0)
            move_obstacles(parts * step, s, pairs, m);
        Index looking = 0, refined = 0;
        for (Index j = 0; j < pairs.row.size(); j++) {
            looking += free_step_ball(j, acting, s, pairs, m);
            if (LOOKS_AHEAD)
                keep_rate(j, m.w_rate.row(pairs.row(j)), m);
            if (LOOKS_AHEAD && parts > 1)
                looking += look_around(j, s.dt, pairs, m);
        }
        if (looking > 0) {
            if (LOOKS_AHEAD)
                refined = redo_steps<BANDED>(given, *fine);
            touch_walls<LOOKS_AHEAD>(looking, given);
            if (any_refused(pairs))
                return;
        }
        if (given.ledger && (refined == 0 || base.size() > 1))
            write_ledger<BANDED>(given);
        if (step == next_wrap)
            split_cycles(step, s, m, cycles);
        if (refined > 0)
            restore_refined_cases(m.ledger);
        observe(step, s, m, cycles);
        record.tally(STEP) = step;
        if (step == next_wrap) {
            close_cycles(step, given);
            next_wrap = least(cycles.next_wrap);
        }
        if (keeping && any_due(step, record))
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
