// A step in which contact takes place, redone by one case in fine steps with the second prepared operator.
#pragma once

#include "ledger.hpp"
#include "touch.hpp"
#include "watch.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Keeps the state before a step, to redo it from there.
inline void save_state(const Motion &m) {
    save(m.saved.row(0), m.q);
    save(m.saved.row(1), m.v);
    save(m.saved.row(2), m.a);
    save(m.saved_ball.row(0), m.ball.row(Y));
    save(m.saved_ball.row(1), m.ball.row(Y_RATE));
    save(m.saved_ball.row(2), m.ball.row(Y_ACCELERATION));
}

// Puts one case back to the start of its step.
inline void restore(Index c, const Motion &m) {
    for (Index i = 0; i < m.q.shape[0]; i++) {
        m.q(i, c) = m.saved(0, i, c);
        m.v(i, c) = m.saved(1, i, c);
        m.a(i, c) = m.saved(2, i, c);
    }
    for (Index j = 0; j < m.ball.shape[1]; j++) {
        m.ball(Y, j, c) = m.saved_ball(0, j, c);
        m.ball(Y_RATE, j, c) = m.saved_ball(1, j, c);
        m.ball(Y_ACCELERATION, j, c) = m.saved_ball(2, j, c);
        m.ball(X, j, c) = m.ball(X_BEFORE, j, c);
        m.ball(RATE, j, c) = m.ball(RATE_BEFORE, j, c);
    }
}

// Drive of one case after `part` fine steps of the step that began at `step`; at its ends as the others have it.
inline double drive_within(Index c, Index step, Index part, Index parts, const Motion &m) {
    if (part == 0)
        return m.drive(BASE_BEFORE, c);
    if (part == parts)
        return m.drive(BASE, c);
    if (m.table.shape[0] > 0)
        return m.table(step * parts + part, c);
    double angle = m.drive(PHASE, c) + m.drive(PHASE_STEP, c) * (double(step) + double(part) / double(parts));
    return m.drive(SCALE, c) * __builtin_sin(angle);
}

// Stops fixed in space before the fine step that ends after `part` of them; see `place_obstacles`.
inline void move_obstacles_within(Index c, Index step, Index part, Index parts, const Scheme &s, const Pairs &pairs,
                                  const Motion &m) {
    double y, rate;
    if (m.travel.shape[1] > 0) {
        y = m.travel(0, step * parts + part, c);
        rate = m.travel(1, step * parts + part, c);
    } else {
        double sine = m.drive(SINE, c), cosine = m.drive(COSINE, c);
        if (part < parts) {
            double angle = m.drive(PHASE, c) + m.drive(PHASE_STEP, c) * (double(step) + double(part) / double(parts));
            sine = __builtin_sin(angle);
            cosine = __builtin_cos(angle);
        }
        y = m.drive(TRAVEL, c) * sine;
        rate = m.drive(TRAVEL_RATE, c) * cosine;
    }
    place_obstacles(c, y, rate, s.dt, pairs, m);
}

// Takes one case through its step of dt again, in fine ones; its ledger and its peaks are summed apart.
template <bool BANDED>
[[gnu::noinline]] inline void redo_step(Index c, double dt, const Fine &fine, const Cases &cases, bool ledger) {
    const Operator &op = fine.structure;
    const Scheme &s = fine.scheme;
    const Pairs &pairs = cases.pairs;
    const Motion &m = cases.motion;
    const Index step = cases.record.tally(STEP), parts = fine.parts;
    const FreeBall free = free_ball(s);
    restore(c, m);
    double after = drive_within(c, step, 0, parts, m);
    for (Index part = 0; part < parts; part++) {
        double before = after;
        after = drive_within(c, step, part + 1, parts, m);
        if (pairs.obstacles.size() > 0)
            move_obstacles_within(c, step, part + 1, parts, s, pairs, m);
        double acting = s.alpha_f == 0.0 ? after : (1.0 - s.alpha_f) * after + s.alpha_f * before;
        free_step<BANDED>(op, s, m, c, acting);
        const Index begun = step * parts + part;
        if (m.more.shape[0] > 0)
            add_further_loads(begun, begun + 1, op, s, m);
        unsigned reached = 0;
        for (Index j = 0; j < pairs.row.size(); j++) {
            reached |= step_ball(j, c, acting, m.w(pairs.row(j), c), free, s, pairs, m);
            keep_rate(j, c, m.w_rate(pairs.row(j), c), m);
        }
        if (reached)
            contact_step(c, double(step) * dt + double(part + 1) * s.dt, op, s, cases);
        add_fine_step(c, step, part, parts, dt, m, cases.cycles);
        if (ledger && m.drives.shape[0] > 0)
            add_work_of_drives(begun, begun + 1, op, pairs, m);
        if (ledger)
            write_ledger<BANDED>(c, before, after, op, s, pairs, m);
    }
    m.ledger(REFINED, c) = 1.0;
    m.ledger(OWN_WORK, c) = m.ledger(WORK, c);
    m.ledger(OWN_LOSS, c) = m.ledger(STRUCTURE_LOSS, c);
}

} // namespace FEMIMPACT_TARGET::stepping
