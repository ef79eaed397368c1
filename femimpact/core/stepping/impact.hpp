// The record of one contact: when it opens, what it adds up to, and when it is an impact of the table.
#pragma once

#include "../columns.hpp"
#include "loop_data.hpp"

namespace FEMIMPACT_TARGET::stepping {

// What the equations of a step give for one pair.
struct PairSolution {
    double time;     // s, of the step's end
    double gate;     // +1 or -1: the side at hand, 0 between contacts
    double x_free;   // m, as it would be without contact forces in this step
    double approach; // m/s, at which the contact opens or has opened
    double normal;   // N, positive where the wall pushes
};

// Numbers of one pair's law in one case, for a contact that opened at this speed (m/s).
inline Law law_of(Index j, Index c, double approach, const Pairs &pairs) {
    GivenBlock constants = pairs.constants;
    return {
        .kind = pairs.kind(j),
        .gap_plus = constants(GAP_PLUS, j, c),
        .gap_minus = constants(GAP_MINUS, j, c),
        .stiffness = constants(STIFFNESS, j, c),
        .damping = constants(DAMPING, j, c),
        .exponent = constants(EXPONENT, j, c),
        .restitution = constants(RESTITUTION, j, c),
        .spring = constants(FREE_STIFFNESS, j, c),
        .dashpot = constants(FREE_DAMPING, j, c),
        .approach = approach,
        .address = pairs.address(j),
        .refused = pairs.refused.row(j).data,
    };
}

inline void open_contact(Index j, Index c, double gate, const PairSolution &found, const Scheme &s, const Pairs &pairs,
                         const Motion &m) {
    Block touch = m.touch;
    double approach = found.approach, late;
    double gap = gate > 0.0 ? pairs.constants(GAP_PLUS, j, c) : pairs.constants(GAP_MINUS, j, c);
    if (pairs.kind(j) == RIGID) {
        approach = gate * m.ball(RATE_BEFORE, j, c);
        // the gap closed up to half a step before this one, or within its first half
        double left = (gap - gate * m.ball(X_BEFORE, j, c)) / larger(approach, 1e-300);
        late = s.dt - smaller(larger(left, -s.dt), s.dt);
    } else
        late = smaller(larger((gate * found.x_free - gap) / larger(approach, 1e-300), 0.0), s.dt);
    for (Index field = OPEN; field <= REBOUND; field++)
        touch(field, j, c) = 0.0;
    touch(BUSY, j, c) = touch(OPEN, j, c) = 1.0;
    touch(SIDE, j, c) = gate;
    touch(APPROACH, j, c) = approach;
    touch(START, j, c) = found.time - late;
    for (Index k = 0; k < m.to_modes.shape[1]; k++)
        m.to_modes(j, k) = 0.0;
}

// Impulse (N s) of a step and its mean force (N) on the structure.
struct Pushed {
    double impulse, mean;
};

// Adds what the contact dissipates in this step: its dissipative force times the relative displacement.
inline Pushed add_contact_loss(Index j, Index c, double normal, const Scheme &s, const Pairs &pairs, const Motion &m) {
    Block touch = m.touch;
    Index kind = pairs.kind(j);
    double wall = touch(SIDE, j, c), x = m.ball(X, j, c), before = m.ball(X_BEFORE, j, c);
    double travel = wall * (x - before), loss, impulse;
    if (kind == RIGID) {
        // P (v0 + v1)/2: the work of the impulse
        loss = normal * s.dt * wall * 0.5 * (m.ball(RATE, j, c) + m.ball(RATE_BEFORE, j, c));
        impulse = s.dt * normal;
    } else {
        double dissipative = 0.0;
        if (kind != SWITCHING_SPRING) {
            Law law = law_of(j, c, touch(APPROACH, j, c), pairs);
            double depth = larger(wall * x - (wall > 0.0 ? law.gap_plus : law.gap_minus), 0.0);
            if (s.mean)
                dissipative = normal - wall * mean_forces_of_walls(law, before, x, s.dt).elastic;
            else if (kind == KELVIN_VOIGT)
                dissipative = normal - law.stiffness * depth;
            else
                dissipative = normal - elastic_force(law, depth);
        }
        if (s.mean) {
            loss = dissipative * travel;
            impulse = s.dt * normal;
        } else {
            loss = 0.5 * (touch(DISSIPATIVE, j, c) + dissipative) * travel;
            impulse = 0.5 * s.dt * (touch(NORMAL, j, c) + normal);
        }
        touch(DISSIPATIVE, j, c) = dissipative;
    }
    touch(NORMAL, j, c) = normal;
    touch(LOSS, j, c) += loss;
    m.ledger(CONTACT_LOSS, c) += loss;
    return {impulse, wall * impulse / s.dt};
}

// Adds a finished impact to the totals of its case, and to the table of case 0.
inline void write_impact(Index j, Index c, Index step, Index kind, const Motion &m, const Record &record) {
    Block touch = m.touch, totals = m.totals;
    if (m.window(0, c) <= step && step < m.window(1, c)) {
        totals(COUNT, j, c) += 1.0;
        totals(APPROACH_SUM, j, c) += touch(APPROACH, j, c);
        totals(LARGEST_APPROACH, j, c) = larger(totals(LARGEST_APPROACH, j, c), touch(APPROACH, j, c));
        totals(IMPULSE_SUM, j, c) += touch(IMPULSE, j, c);
    }
    if (c != 0)
        return;
    Index k = record.tally(IMPACTS_MET);
    if (k < record.impacts.shape[0]) {
        Array row = record.impacts.row(k);
        row(IMPACT_TIME) = touch(START, j, c);
        row(IMPACT_PAIR) = double(j);
        row(IMPACT_SIDE) = touch(SIDE, j, c);
        row(IMPACT_APPROACH_SPEED) = touch(APPROACH, j, c);
        row(IMPACT_REBOUND_SPEED) = touch(REBOUND, j, c);
        row(IMPACT_IMPULSE) = touch(IMPULSE, j, c);
        row(IMPACT_PEAK_FORCE) = kind == RIGID ? NOT_A_NUMBER : touch(PEAK, j, c);
        row(IMPACT_DURATION) = touch(DURATION, j, c);
        row(IMPACT_ENERGY_LOSS) = touch(LOSS, j, c);
        for (Index i = 0; i < m.to_modes.shape[1]; i++)
            row(IMPACT_COLUMNS + i) = m.to_modes(j, i);
    }
    record.tally(IMPACTS_MET) += 1;
}

// Opens, follows and closes the record of one contact.
//
// It opens with the first force, even one that turns the ball back within the step, and closes when the ball is off
// the wall and without force. A rigid contact closes with the first step without an impulse: impulses in consecutive
// steps, of a ball that sticks to its wall, are one contact, whose duration runs from the first to the last of them.
inline void record_contact(Index j, Index c, const PairSolution &found, GivenArray row, const Scheme &s,
                           const Pairs &pairs, const Motion &m, const Record &record) {
    Block touch = m.touch;
    GivenBlock constants = pairs.constants;
    Index kind = pairs.kind(j), step = record.tally(STEP);
    double gate = found.gate, normal = found.normal;
    double side = penetration(m.ball(X, j, c), constants(GAP_PLUS, j, c), constants(GAP_MINUS, j, c)).side;
    double always =
        kind == SWITCHING_SPRING || constants(FREE_STIFFNESS, j, c) + constants(FREE_DAMPING, j, c) > 0.0 ? 1.0 : 0.0;
    if (kind == SWITCHING_SPRING) {
        normal = side != 0.0 ? normal : 0.0;
        gate = side;
    }
    if (touch(OPEN, j, c) == 0.0) {
        if (normal == 0.0) {
            touch(BUSY, j, c) = always;
            return;
        }
        open_contact(j, c, gate, found, s, pairs, m);
    } else if (kind == RIGID && normal > 0.0)
        touch(DURATION, j, c) += s.dt;
    // of a coarse step from wall to wall the force may be that of the other one
    normal *= gate != 0.0 ? gate * touch(SIDE, j, c) : 1.0;
    bool closing = normal == 0.0 && (kind == RIGID || side != touch(SIDE, j, c));
    Pushed pushed = add_contact_loss(j, c, normal, s, pairs, m);
    if (m.window(0, c) <= step && step < m.window(1, c)) {
        m.totals(PEAK_FORCE, j, c) = larger(m.totals(PEAK_FORCE, j, c), normal);
        m.totals(FORCE_TIME, j, c) += pushed.impulse;
    }
    touch(IMPULSE, j, c) += pushed.impulse;
    touch(PEAK, j, c) = larger(touch(PEAK, j, c), normal);
    if (kind != RIGID)
        touch(DURATION, j, c) += normal != 0.0 ? s.dt : 0.0;
    if (kind != RIGID || normal > 0.0)
        touch(REBOUND, j, c) = -touch(SIDE, j, c) * m.ball(RATE, j, c);
    for (Index k = 0; k < m.to_modes.shape[1]; k++)
        // work of the mean force on each mode; the displacement of a mode is the mean of its velocities times dt
        m.to_modes(j, k) += pushed.mean * row(k) * 0.5 * s.dt * (m.v_before(k, 0) + m.v(k, 0));
    if (closing) {
        touch(OPEN, j, c) = 0.0;
        touch(BUSY, j, c) = always;
        write_impact(j, c, step, kind, m, record);
    }
}

} // namespace FEMIMPACT_TARGET::stepping
