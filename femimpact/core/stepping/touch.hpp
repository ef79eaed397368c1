// Contact: the equations of the pairs of one case, and their effect on its state.
#pragma once

#include "impact.hpp"
#include "pair.hpp"

namespace FEMIMPACT_TARGET::stepping {

constexpr int PAIR_ITERATIONS = 200;
// The same of impulses, which are linear in one another and rare: twenty equal balls on a mass take some 400.
constexpr int IMPULSE_ITERATIONS = 20'000;
// Gauss-Seidel over pairs that share a structure stops at this change, relative to the largest force.
constexpr double PAIR_TOLERANCE = 1e-15;

// Wall whose contact a step is about, from its contact-free end: +1, -1, or 0 between contacts.
inline double side_at_hand(const Scheme &s, Index kind, double x, double x_before, double rate_before, double gap_plus,
                           double gap_minus) {
    if (kind == RIGID)
        // half a step on, from the state before the step
        return penetration(x_before + 0.5 * s.dt * rate_before, gap_plus, gap_minus).side;
    double side = penetration(x, gap_plus, gap_minus).side;
    return s.mean && side == 0.0 ? penetration(x_before, gap_plus, gap_minus).side : side;
}

// Speed (m/s) at which a contact opens: that before the step, or of the motion into the wall if it ends within.
inline double approach_speed(double gate, double rate, double x, double x_before, double dt) {
    double speed = gate * rate;
    return speed > 0.0 ? speed : larger(gate * (x - x_before) / dt, 1e-300);
}

// Work of what holds a stop in space: relative to the base it moves at y' and pushes with F, a power F y'.
//
// A mean force acts over the displacement of the step, an impulse at the mean of the rates as its loss is summed, a
// force at the step's end by the trapezoidal rule.
[[gnu::noinline]] inline void add_work_of_obstacles(Index c, Array force, const Scheme &s, const Pairs &pairs,
                                                    const Motion &m) {
    for (Index k = 0; k < pairs.obstacles.size(); k++) {
        Index j = pairs.obstacles(k);
        double increment = m.ball(Y, j, c) - m.ball(Y_BEFORE, j, c), mean = force(j);
        if (s.rigid)
            increment = 0.5 * s.dt * (m.drive(OBSTACLE_RATE, c) + m.drive(OBSTACLE_RATE_BEFORE, c));
        else if (!s.mean)
            mean = 0.5 * (m.ball(FORCE, j, c) + force(j));
        m.ledger(WORK, c) += mean * increment;
        if (m.drives.shape[0] > 0)
            m.work_of(0) += mean * increment;
    }
}

// What a force on the structure does in a step to one case.
inline void apply_force(Index j, Index c, double force, const Operator &op, const Scheme &s, double mobility,
                        const Motion &m) {
    for (Index i = 0; i < m.q.shape[0]; i++) {
        m.a(i, c) += op.response_a(j, i) * force;
        m.q(i, c) += op.response_u(j, i) * force;
        m.v(i, c) += op.response_v(j, i) * force;
    }
    for (Index r = 0; r < m.w.shape[0]; r++) {
        m.w(r, c) += op.compliance_u(r, j) * force;
        m.w_rate(r, c) += op.compliance_v(r, j) * force;
    }
    double gain = -force * mobility;
    m.ball(Y_ACCELERATION, j, c) += s.mass_response_a * gain;
    m.ball(Y, j, c) += s.mass_response_u * gain;
    m.ball(Y_RATE, j, c) += s.mass_response_v * gain;
}

// Contact forces of one case, their effect on its state, and the record of its contacts.
//
// `time` is that of the step's end.
inline void contact_step(Index c, double time, const Operator &op, const Scheme &s, const Cases &cases) {
    const Pairs &pairs = cases.pairs;
    const Motion &m = cases.motion;
    const Index count = pairs.row.size();
    GivenBlock constants = pairs.constants;
    Matrix work = cases.pair_scratch;
    Array x_free = work.row(0), rate_free = work.row(1), gate = work.row(2), force = work.row(3);
    Array normal = work.row(4), approach = work.row(5);
    if (s.carry != 0.0)
        for (Index j = 0; j < count; j++)
            if (m.ball(FORCE, j, c) != 0.0)
                apply_force(j, c, s.carry * m.ball(FORCE, j, c), op, s, constants(MOBILITY, j, c), m);
    for (Index j = 0; j < count; j++) {
        double x_before = m.ball(X_BEFORE, j, c);
        x_free(j) = m.ball(Y, j, c) - m.w(pairs.row(j), c);
        rate_free(j) = m.ball(Y_RATE, j, c) - m.w_rate(pairs.row(j), c);
        gate(j) = side_at_hand(s, pairs.kind(j), x_free(j), x_before, m.ball(RATE_BEFORE, j, c),
                               constants(GAP_PLUS, j, c), constants(GAP_MINUS, j, c));
        // what separates takes no part in impulses elsewhere, and is looked at again in the next step
        if (s.rigid && count > 1 && gate(j) * m.ball(RATE_BEFORE, j, c) < 0.0 && gate(j) * rate_free(j) <= 0.0)
            gate(j) = 0.0;
        approach(j) = m.touch(APPROACH, j, c);
        if (m.touch(OPEN, j, c) == 0.0 && gate(j) != 0.0)
            approach(j) = approach_speed(gate(j), rate_free(j), x_free(j), x_before, s.dt);
        force(j) = 0.0;
    }
    const int iterations = s.rigid ? IMPULSE_ITERATIONS : PAIR_ITERATIONS;
    for (int k = 0; k < iterations; k++) {
        double change = 0.0, largest = 0.0;
        for (Index j = 0; j < count; j++) {
            double others_u = 0.0, others_v = 0.0;
            const Index r = pairs.row(j);
            for (Index i = 0; i < count; i++)
                if (i != j) {
                    others_u += op.compliance_u(r, i) * force(i);
                    others_v += op.compliance_v(r, i) * force(i);
                }
            double x_before = m.ball(X_BEFORE, j, c), rate_before = m.ball(RATE_BEFORE, j, c);
            double x = x_free(j) - others_u, rate = rate_free(j) - others_v, mobility = constants(MOBILITY, j, c);
            if (s.mean && count > 1 && pairs.kind(j) != RIGID) {
                // what the others push may open or close this contact; its mean force is continuous there
                gate(j) = side_at_hand(s, pairs.kind(j), x, x_before, rate_before, constants(GAP_PLUS, j, c),
                                       constants(GAP_MINUS, j, c));
                if (m.touch(OPEN, j, c) == 0.0 && gate(j) != 0.0 && approach(j) <= 0.0)
                    approach(j) = approach_speed(gate(j), rate, x, x_before, s.dt);
            }
            FreePair free = {gate(j),
                             x,
                             rate,
                             x_before,
                             rate_before,
                             op.compliance_u(r, j) + s.mass_response_u * mobility,
                             op.compliance_v(r, j) + s.mass_response_v * mobility};
            PairForce found = pair_force(s, law_of(j, c, approach(j), pairs), free);
            normal(j) = found.normal;
            change = larger(change, magnitude(found.total - force(j)));
            largest = larger(largest, magnitude(found.total));
            force(j) = found.total;
        }
        if (count == 1 || change <= PAIR_TOLERANCE * largest)
            break;
    }
    if (pairs.obstacles.size() > 0)
        add_work_of_obstacles(c, force, s, pairs, m);
    for (Index j = 0; j < count; j++) {
        m.ball(FORCE, j, c) = force(j);
        if (force(j) != 0.0)
            apply_force(j, c, force(j), op, s, constants(MOBILITY, j, c), m);
    }
    for (Index j = 0; j < count; j++) {
        const Index r = pairs.row(j);
        m.ball(X, j, c) = m.ball(Y, j, c) - m.w(r, c);
        m.ball(RATE, j, c) = m.ball(Y_RATE, j, c) - m.w_rate(r, c);
        double braked = constants(FREE_DAMPING, j, c), travel = m.ball(X, j, c) - m.ball(X_BEFORE, j, c);
        if (braked > 0.0)
            // the mean rate of the step is travel over dt
            m.ledger(CONTACT_LOSS, c) += braked / s.dt * travel * travel;
        record_contact(j, c, {time, gate(j), x_free(j), approach(j), normal(j)}, op.rows.row(r), s, pairs, m,
                       cases.record);
    }
}

} // namespace FEMIMPACT_TARGET::stepping
