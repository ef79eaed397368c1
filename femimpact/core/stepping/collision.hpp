// One collision alone, by the steps of the loop.
#pragma once

#include "free_step.hpp"
#include "touch.hpp"
#include "watch.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Steps after which a collision that has not ended never will.
constexpr Index MOST_STEPS = 10'000'000;

// Rebound over approach speed, not a number where the collision has not ended, and peak force (N).
struct Collision {
    double rebound, peak;
};

// One mass (kg) sent against one wall at a speed (m/s) with this step.
//
// The wall of the + side stands at gap 0, the contact begins `start` (0 to 1) of a step after the last step without
// contact, and the law's approach speed is that of this collision. The mass is the ball of a block of one case; the
// structure of that block has no degree of freedom, and stands still.
inline Collision collide(const Law &law, double mass, double speed, double start, const Scheme &s) {
    double ball[RATE_BEFORE + 1] = {}, touch[REBOUND + 1] = {}, constants[FREE_DAMPING + 1] = {}, ledger[HELD + 1] = {};
    double totals[FORCE_TIME + 1] = {}, scratch[6] = {}, still[2] = {};
    Index tally[4] = {}, window[2] = {};
    const Index pair = 0;
    constants[MASS] = mass;
    constants[MOBILITY] = 1.0 / mass;
    constants[GAP_MINUS] = INFINITE;
    constants[STIFFNESS] = law.stiffness;
    constants[DAMPING] = law.damping;
    constants[EXPONENT] = law.exponent;
    constants[RESTITUTION] = law.restitution;
    ball[Y] = ball[X] = ball[X_BEFORE] = -start * s.dt * speed;
    ball[Y_RATE] = ball[RATE] = ball[RATE_BEFORE] = speed;
    Operator op = {};
    op.rows = op.response_a = op.response_u = op.response_v = {still, {1, 0}};
    op.compliance_u = op.compliance_v = {still, {1, 1}};
    Cases cases = {};
    cases.pairs = {{&pair, {1}}, {&law.kind, {1}},     {&law.address, {1}}, {constants, {FREE_DAMPING + 1, 1, 1}},
                   {},           {law.refused, {1, 3}}};
    Motion &m = cases.motion;
    m.w = {still, {1, 1}};
    m.w_rate = {still + 1, {1, 1}};
    m.ball = {ball, {RATE_BEFORE + 1, 1, 1}};
    m.touch = {touch, {REBOUND + 1, 1, 1}};
    m.totals = {totals, {FORCE_TIME + 1, 1, 1}};
    m.window = {window, {2, 1}};
    m.ledger = {ledger, {HELD + 1, 1}};
    m.to_modes = {still, {1, 0}};
    cases.record.tally = {tally, {4}};
    cases.pair_scratch = {scratch, {6, 1}};
    const FreeBall free = free_ball(s);
    double peak = 0.0;
    for (; tally[0] < MOST_STEPS && law.refused[0] == 0.0 && magnitude(ball[RATE]) < INFINITE; tally[0]++) {
        if (s.rigid)
            look_ahead<double>(0, 0, 0.5 * s.dt, cases.pairs, m);
        const unsigned reached = step_ball(0, 0, 0.0, 0.0, free, s, cases.pairs, m);
        keep_rate(0, 0, 0.0, m);
        if (reached) {
            contact_step(0, double(tally[0] + 1) * s.dt, op, s, cases);
            // the force of this step
            peak = larger(peak, cases.pair_scratch(4, 0));
        }
        const bool left = ball[X] <= 0.0 || law.kind == RIGID;
        // an algorithmic acceleration may last longer than the force
        if (left && ball[RATE] <= 0.0 && ball[FORCE] == 0.0 &&
            magnitude(ball[RATE] - ball[RATE_BEFORE]) <= 1e-13 * speed)
            return {-ball[RATE] / speed, peak};
    }
    return {NOT_A_NUMBER, peak};
}

} // namespace FEMIMPACT_TARGET::stepping
