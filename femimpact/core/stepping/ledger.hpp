// Energies of a case, and what a step adds to work and losses.
#pragma once

#include "free_step.hpp"
#include "impact.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Adds dt c ((v0 + v1)/2)^2 of every mode to the loss, and returns load @ q.
template <class Value>
[[gnu::always_inline]] inline Value add_loss_of_modes(const Operator &op, const Motion &m, Index c) {
    Array losses = m.ledger.row(STRUCTURE_LOSS);
    Value loss = load<Value>(losses, c), total = Value{};
    for (Index i = 0; i < m.q.shape[0]; i++) {
        Value rate = load<Value>(m.v.row(i), c), twice = rate + load<Value>(m.v_before.row(i), c);
        store(rate, m.v_before.row(i), c);
        loss = loss + op.modes.loss(i) * twice * twice;
        total = total + op.drive_load(i) * load<Value>(m.q.row(i), c);
    }
    store(loss, losses, c);
    return total;
}

// The same of one case alone, mode by mode.
inline double add_loss_mode_by_mode(const Operator &op, const Motion &m) {
    double total = 0.0;
    for (Index i = 0; i < m.q.shape[0]; i++) {
        double rate = m.v(i, 0), twice = rate + m.v_before(i, 0);
        m.v_before(i, 0) = rate;
        m.loss_of_mode(i) += op.modes.loss(i) * twice * twice;
        total += op.drive_load(i) * m.q(i, 0);
    }
    return total;
}

// The same in physical dofs: dt vbar^T C vbar with vbar the mean of both velocities.
template <class Value> inline Value add_loss_of_bands(const Operator &op, const Scheme &s, const Motion &m, Index c) {
    const Index n = m.q.shape[0];
    Array losses = m.ledger.row(STRUCTURE_LOSS);
    Value loss = load<Value>(losses, c), total = Value{};
    for (Index i = 0; i < n; i++) {
        total = total + op.drive_load(i) * load<Value>(m.q.row(i), c);
        store(load<Value>(m.v_before.row(i), c) + load<Value>(m.v.row(i), c), m.v_before.row(i), c);
    }
    for (Index i = 0; i < n; i++) {
        Value twice = load<Value>(m.v_before.row(i), c);
        loss = loss + 0.25 * s.dt * op.damping_band(0, i) * twice * twice;
        for (Index k = 1; k < smaller(op.damping_band.shape[0], n - i); k++)
            loss = loss + 0.5 * s.dt * op.damping_band(k, i) * twice * load<Value>(m.v_before.row(i + k), c);
    }
    for (Index i = 0; i < n; i++)
        store(load<Value>(m.v.row(i), c), m.v_before.row(i), c);
    store(loss, losses, c);
    return total;
}

// Work of the drive over one step, by the trapezoidal rule, on the structure whose load @ q is given, and of inertia
// and of the constant acceleration on each ball.
//
// With the loss above it is the exact balance of the linear part for beta = 1/4, gamma = 1/2.
template <class Value>
[[gnu::always_inline]] inline void add_work(Value base, Value before, Value held, const Pairs &pairs, const Motion &m,
                                            Index c) {
    Value work = load<Value>(m.ledger.row(WORK), c), mean = 0.5 * (base + before);
    work = work + mean * (held - load<Value>(m.ledger.row(LOAD_BEFORE), c));
    store(held, m.ledger.row(LOAD_BEFORE), c);
    for (Index j = 0; j < pairs.row.size(); j++) {
        Value y = load<Value>(m.ball.row(Y, j), c);
        Value acting = load<Value>(pairs.constants.row(ACCELERATION, j), c) - pairs.constants(SHARE, j, 0) * mean;
        Value increment = y - load<Value>(m.ball.row(Y_BEFORE, j), c);
        work = work + load<Value>(pairs.constants.row(MASS, j), c) * acting * increment;
        store(y, m.ball.row(Y_BEFORE, j), c);
    }
    store(work, m.ledger.row(WORK), c);
}

// Adds the work of each of several drives on a single case from one fine step to another, before `add_work`.
[[gnu::noinline]] inline void add_work_of_drives(Index from, Index to, const Operator &op, const Pairs &pairs,
                                                 const Motion &m) {
    const Index drives = m.drives.shape[0];
    for (Index k = 0; k < drives; k++) {
        const Index place = m.drive_place(k);
        const GivenArray load = place == 0 ? op.drive_load : op.more_load.row(place - 1);
        double held = 0.0, mean = 0.5 * (m.drives(k, from) + m.drives(k, to));
        for (Index i = 0; i < load.size(); i++)
            held += load(i) * m.q(i, 0);
        const double work = mean * (held - m.held_by_drive(k));
        m.held_by_drive(k) = held;
        m.work_of(k) += work;
        // that along the first load is added for all cases alike
        m.ledger(WORK, 0) += place > 0 ? work : 0.0;
    }
    for (Index j = 0; j < pairs.row.size(); j++) {
        const double travel = pairs.constants(MASS, j, 0) * (m.ball(Y, j, 0) - m.ball(Y_BEFORE, j, 0));
        m.work_of(0) -= pairs.constants(SHARE, j, 0) * 0.5 * (m.drives(0, from) + m.drives(0, to)) * travel;
        m.work_of(drives) += pairs.constants(ACCELERATION, j, 0) * travel;
    }
}

// All of the above for one step of one case or of a pack of them.
template <bool BANDED, class Value>
[[gnu::always_inline]] inline void write_ledger(Index c, Value base, Value before, const Operator &op, const Scheme &s,
                                                const Pairs &pairs, const Motion &m) {
    Value held;
    if constexpr (BANDED)
        held = add_loss_of_bands<Value>(op, s, m, c);
    else if (m.loss_of_mode.size() > 0)
        held = Value{} + add_loss_mode_by_mode(op, m);
    else
        held = add_loss_of_modes<Value>(op, m, c);
    add_work(base, before, held, pairs, m, c);
}

// Puts back the sums of the cases that took the step in fine ones.
inline void restore_refined_cases(Matrix ledger) {
    for (Index c = 0; c < ledger.shape[1]; c++)
        if (ledger(REFINED, c) > 0.0) {
            ledger(REFINED, c) = 0.0;
            ledger(WORK, c) = ledger(OWN_WORK, c);
            ledger(STRUCTURE_LOSS, c) = ledger(OWN_LOSS, c);
        }
}

// x^T A x of a symmetric matrix kept by its lower bands.
inline double quadratic(GivenMatrix band, Matrix values, Index c) {
    const Index n = values.shape[0];
    double total = 0.0;
    for (Index i = 0; i < n; i++) {
        total += band(0, i) * values(i, c) * values(i, c);
        for (Index k = 1; k < smaller(band.shape[0], n - i); k++)
            total += 2.0 * band(k, i) * values(i, c) * values(i + k, c);
    }
    return total;
}

// Work of the constant load since the start; it has a potential: no sum over steps.
inline double work_of_constant_load(Index c, const Operator &op, const Motion &m) {
    double held = 0.0;
    for (Index i = 0; i < op.constant_load.size(); i++)
        held += op.constant_load(i) * m.q(i, c);
    return held - m.ledger(HELD, c);
}

// Energies of one case at the present step, in the order of ENERGY_COLUMNS.
inline void write_energy(Index c, const Operator &op, const Pairs &pairs, const Motion &m, Array out) {
    out(ENERGY_KINETIC) = 0.5 * quadratic(op.mass_band, m.v, c);
    out(ENERGY_STRAIN) = 0.5 * quadratic(op.stiffness_band, m.q, c);
    out(ENERGY_BALL) = out(ENERGY_CONTACT) = 0.0;
    for (Index j = 0; j < pairs.row.size(); j++) {
        Law law = law_of(j, c, m.touch(APPROACH, j, c), pairs);
        double x = m.ball(X, j, c);
        out(ENERGY_BALL) += 0.5 * pairs.constants(MASS, j, c) * m.ball(Y_RATE, j, c) * m.ball(Y_RATE, j, c);
        if (law.kind == SWITCHING_SPRING)
            out(ENERGY_CONTACT) += switching_potential(x, law.gap_plus, law.gap_minus, law.spring, law.stiffness);
        else {
            out(ENERGY_CONTACT) += spring_potential(x, law.spring);
            out(ENERGY_CONTACT) += elastic_potential(law, penetration(x, law.gap_plus, law.gap_minus).depth);
        }
    }
    double loss = m.ledger(STRUCTURE_LOSS, c);
    for (Index i = 0; i < m.loss_of_mode.size(); i++)
        loss += m.loss_of_mode(i);
    out(ENERGY_WORK) = m.ledger(WORK, c);
    out(ENERGY_STRUCTURE_LOSS) = loss;
    out(ENERGY_CONTACT_LOSS) = m.ledger(CONTACT_LOSS, c);
    if (op.constant_load.size() > 0)
        out(ENERGY_WORK) += work_of_constant_load(c, op, m);
}

} // namespace FEMIMPACT_TARGET::stepping
