// One step without contact force: modes or banded dofs, balls, and what is looked at every step.
#pragma once

#include "../columns.hpp"
#include "banded.hpp"
#include "extremes.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Displacement (m) and velocity (m/s) of a place.
template <class Value> struct Place {
    Value w, rate;
};

// The drive at the next step, by rotating the phase: no trigonometric call per step.
template <class Value> [[gnu::always_inline]] inline void turn_drive(Matrix drive, Index c) {
    Value sine = load<Value>(drive.row(SINE), c), cosine = load<Value>(drive.row(COSINE), c);
    Value turn_sine = load<Value>(drive.row(TURN_SINE), c), turn_cosine = load<Value>(drive.row(TURN_COSINE), c);
    Value turned = sine * turn_cosine + cosine * turn_sine;
    store(cosine * turn_cosine - sine * turn_sine, drive.row(COSINE), c);
    store(turned, drive.row(SINE), c);
    store(load<Value>(drive.row(BASE), c), drive.row(BASE_BEFORE), c);
    store(load<Value>(drive.row(SCALE), c) * turned, drive.row(BASE), c);
}

// The drive in the balance within the step.
template <class Value> [[gnu::always_inline]] inline Value acting_drive(double alpha, Matrix drive, Index c) {
    Value base = load<Value>(drive.row(BASE), c);
    return alpha == 0.0 ? base : (1.0 - alpha) * base + alpha * load<Value>(drive.row(BASE_BEFORE), c);
}

// One step of every mode without contact force, of one case or of a pack of them; returns the place of a row. The sums
// that are read stay in registers.
template <class Value>
[[gnu::always_inline]] inline Place<Value> step_modes(const ModalStep &modes, GivenArray row, const Scheme &s,
                                                      const Motion &m, Index c, Value acting) {
    Place<Value> place = {Value{}, Value{}};
    // copies: what is written to the state below is none of them
    const double dt = s.dt, predict_u = s.predict_u, predict_v = s.predict_v;
    const double correct_u = s.correct_u, correct_v = s.correct_v;
    const ModalStep of = modes;
    const Matrix q = m.q, v = m.v, a = m.a;
#pragma GCC unroll 4
    for (Index i = 0; i < q.shape[0]; i++) {
        const Value u = load<Value>(q.row(i), c), rate = load<Value>(v.row(i), c), old = load<Value>(a.row(i), c);
        const Value given = without(of.inertia(i), old, of.load(i) * acting);
        const Value acceleration = without(of.stiffness(i), u, without(of.damping(i), rate, given));
        const Value u_new = fma(correct_u, acceleration, fma(predict_u, old, fma(dt, rate, u)));
        const Value v_new = fma(correct_v, acceleration, fma(predict_v, old, rate));
        store(acceleration, a.row(i), c);
        store(u_new, q.row(i), c);
        store(v_new, v.row(i), c);
        place = {fma(row(i), u_new, place.w), fma(row(i), v_new, place.rate)};
    }
    return place;
}

// Displacement and velocity of one place: a row over the dofs.
template <class Value> [[gnu::always_inline]] inline Place<Value> read_row(GivenArray row, const Motion &m, Index c) {
    Place<Value> place = {Value{}, Value{}};
    for (Index i = 0; i < row.size(); i++)
        if (row(i) != 0.0)
            place = {place.w + row(i) * load<Value>(m.q.row(i), c), place.rate + row(i) * load<Value>(m.v.row(i), c)};
    return place;
}

// Writes places that are read in every step, from row `first` on.
template <class Value> inline void read_rows(GivenMatrix rows, Index first, const Motion &m, Index c) {
    for (Index r = first; r < rows.shape[0]; r++) {
        auto place = read_row<Value>(rows.row(r), m, c);
        store(place.w, m.w.row(r), c);
        store(place.rate, m.w_rate.row(r), c);
    }
}

// What the constant load adds to a step.
template <class Value> [[gnu::noinline]] inline void add_constant_load(const Operator &op, const Motion &m, Index c) {
    for (Index i = 0; i < op.constant_load.size(); i++) {
        store(load<Value>(m.a.row(i), c) + op.constant_a(i), m.a.row(i), c);
        store(load<Value>(m.q.row(i), c) + op.constant_u(i), m.q.row(i), c);
        store(load<Value>(m.v.row(i), c) + op.constant_v(i), m.v.row(i), c);
    }
    for (Index r = 0; r < m.w.shape[0]; r++) {
        store(load<Value>(m.w.row(r), c) + op.constant_w(0, r), m.w.row(r), c);
        store(load<Value>(m.w_rate.row(r), c) + op.constant_w(1, r), m.w_rate.row(r), c);
    }
}

// One step of the structure without contact force, of one case or of a pack of them, and what is read of it.
template <bool BANDED, class Value>
[[gnu::always_inline]] inline void free_step(const Operator &op, const Scheme &s, const Motion &m, Index c,
                                             Value acting) {
    if constexpr (BANDED) {
        step_bands(op, s, m, c, acting);
        read_rows<Value>(op.rows, 0, m, c);
    } else {
        auto place = step_modes(op.modes, op.rows.row(0), s, m, c, acting);
        store(place.w, m.w.row(0), c);
        store(place.rate, m.w_rate.row(0), c);
        read_rows<Value>(op.rows, 1, m, c);
    }
    if (op.constant_load.size() > 0)
        add_constant_load<Value>(op, m, c);
}

// Adds what further loads do in a step of a single case, from one fine step to another.
[[gnu::noinline]] inline void add_further_loads(Index from, Index to, const Operator &op, const Scheme &s,
                                                const Motion &m) {
    for (Index h = 0; h < m.more.shape[0]; h++) {
        const double acting = (1.0 - s.alpha_f) * m.more(h, to) + s.alpha_f * m.more(h, from);
        for (Index i = 0; i < m.q.shape[0]; i++) {
            const double acceleration = op.more_a(h, i) * acting;
            m.a(i, 0) += acceleration;
            m.q(i, 0) += s.correct_u * acceleration;
            m.v(i, 0) += s.correct_v * acceleration;
        }
    }
    read_rows<double>(op.rows, 0, m, 0);
}

// Stops fixed in space a step before y (m), at the rate (m/s) that they have there.
//
// y is the base's displacement, not a sum over steps: the free step adds dt times the rate, and no error stays.
inline void place_obstacles(Index c, double y, double rate, double dt, const Pairs &pairs, const Motion &m) {
    for (Index k = 0; k < pairs.obstacles.size(); k++) {
        Index j = pairs.obstacles(k);
        m.ball(Y, j, c) = y - dt * rate;
        m.ball(Y_RATE, j, c) = rate;
    }
}

// Stops fixed in space as the free step takes them to where they are at its end.
//
// `index` is that of the step's end among the fine steps of a base given by samples.
[[gnu::noinline]] inline void move_obstacles(Index index, const Scheme &s, const Pairs &pairs, const Motion &m) {
    Matrix drive = m.drive;
    for (Index c = 0; c < drive.shape[1]; c++) {
        bool sampled = m.travel.shape[1] > 0;
        double y = sampled ? m.travel(0, index, c) : drive(TRAVEL, c) * drive(SINE, c);
        double rate = sampled ? m.travel(1, index, c) : drive(TRAVEL_RATE, c) * drive(COSINE, c);
        drive(OBSTACLE_RATE_BEFORE, c) = drive(OBSTACLE_RATE, c);
        drive(OBSTACLE_RATE, c) = rate;
        place_obstacles(c, y, rate, s.dt, pairs, m);
    }
}

// The cases in which a pair must be looked at, as bits: x is beyond a gap, or the pair is busy.
template <class Value>
[[gnu::always_inline]] inline unsigned in_reach(Index j, Index c, Value x, const Pairs &pairs, const Motion &m) {
    return bits_where((x > load<Value>(pairs.constants.row(GAP_PLUS, j), c)) |
                      (x < -load<Value>(pairs.constants.row(GAP_MINUS, j), c)) |
                      (load<Value>(m.touch.row(BUSY, j), c) > Value{}));
}

// Shares of the load and of the last acceleration in a free ball's next one.
struct FreeBall {
    double scale, inertia;
};

inline FreeBall free_ball(const Scheme &s) {
    return {1.0 / (1.0 - s.alpha_m), s.alpha_m / (1.0 - s.alpha_m)};
}

// One step of a ball without contact, of one case or of a pack of them; w is the place of its pair. A stop has no share
// in the drive and stays where it is, or goes on at its rate. Returns the cases in which its contact must be looked at.
template <class Value>
[[gnu::always_inline]] inline unsigned step_ball(Index j, Index c, Value acting, Value w, FreeBall free,
                                                 const Scheme &s, const Pairs &pairs, const Motion &m) {
    const double share = pairs.constants(SHARE, j, 0);
    Array y_row = m.ball.row(Y, j), rate_row = m.ball.row(Y_RATE, j), old_row = m.ball.row(Y_ACCELERATION, j);
    Array x_row = m.ball.row(X, j);
    Value y = load<Value>(y_row, c), rate = load<Value>(rate_row, c), old = load<Value>(old_row, c);
    Value given = without(share, acting, load<Value>(pairs.constants.row(ACCELERATION, j), c));
    Value now = without(free.inertia, old, free.scale * given);
    y = fma(s.correct_u, now, fma(s.predict_u, old, fma(s.dt, rate, y)));
    store(y, y_row, c);
    store(fma(s.correct_v, now, fma(s.predict_v, old, rate)), rate_row, c);
    store(now, old_row, c);
    Value x = y - w;
    store(load<Value>(x_row, c), m.ball.row(X_BEFORE, j), c);
    store(x, x_row, c);
    return in_reach(j, c, x, pairs, m);
}

// Adds the observed place's displacement to the statistics of the running cycle.
template <class Value>
[[gnu::always_inline]] inline void observe(Index step, Index c, const Scheme &s, const Motion &m,
                                           const Cycles &cycles) {
    Matrix sums = cycles.sums, last = cycles.last;
    Value w = load<Value>(m.w.row(0), c), rate = load<Value>(m.w_rate.row(0), c);
    // rare; the extremes have no other part in this loop
    if (differ_in_sign(rate, load<Value>(last.row(LAST_RATE), c)))
        add_extremes(c, double(step - 1) * s.dt, s, m, cycles);
    store(w, last.row(LAST), c);
    store(rate, last.row(LAST_RATE), c);
    store(w * w + load<Value>(sums.row(SQUARE), c), sums.row(SQUARE), c);
    store(w * load<Value>(m.drive.row(SINE), c) + load<Value>(sums.row(SINE_SUM), c), sums.row(SINE_SUM), c);
    store(w * load<Value>(m.drive.row(COSINE), c) + load<Value>(sums.row(COSINE_SUM), c), sums.row(COSINE_SUM), c);
}

} // namespace FEMIMPACT_TARGET::stepping
