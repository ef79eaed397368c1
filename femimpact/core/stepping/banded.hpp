// One step without contact force in physical dofs: banded matrices, cases in packs of eight or one alone.
#pragma once

#include "../pack.hpp"
#include "loop_data.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Two sweeps: right-hand side with forward substitution, back substitution with the new state.
//
// Column j of the matrices reaches the rows j - 3 to j + 3; r0 to r6 are the sums of those so far. In between, q and v
// hold what is predicted, a half of the solution.
template <class Value>
[[gnu::noinline]] inline void step_narrow(const Operator &op, const Scheme &s, const Motion &m, Index c, Value acting) {
    GivenArray narrow = op.narrow.columns, factor = op.narrow.factor;
    const Matrix q = m.q, v = m.v, a = m.a;
    const Index n = q.shape[0];
    const bool averaged = s.alpha_f != 0.0 || s.alpha_m != 0.0;
    const Value zero = Value{};
    Value r0 = zero, r1 = zero, r2 = zero, r3 = zero, r4 = zero, r5 = zero, y1 = zero, y2 = zero, y3 = zero;
    for (Index j = 0; j < n + 3; j++) {
        const Index t = 12 * j, f = 4 * j;
        Value r6 = zero;
        if (j < n) {
            Value rate = load<Value>(v.row(j), c), old = load<Value>(a.row(j), c);
            Value increment = fma(s.dt, rate, s.predict_u * old), gain = s.predict_v * old;
            Value u = increment + load<Value>(q.row(j), c);
            rate = gain + rate;
            store(u, q.row(j), c);
            store(rate, v.row(j), c);
            r3 = fma(op.drive_load(j), acting, r3);
            if (averaged) {
                u = without(s.alpha_f, increment, u);
                rate = without(s.alpha_f, gain, rate);
                r0 = fma(narrow(t + 11), old, r0);
                r1 = fma(narrow(t + 22), old, r1);
                r2 = fma(narrow(t + 33), old, r2);
                r3 = fma(narrow(t + 44), old, r3);
                r4 = fma(narrow(t + 45), old, r4);
                r5 = fma(narrow(t + 46), old, r5);
                r6 = narrow(t + 47) * old;
            }
            r0 = fma(narrow(t + 3), rate, fma(narrow(t + 7), u, r0));
            r1 = fma(narrow(t + 14), rate, fma(narrow(t + 18), u, r1));
            r2 = fma(narrow(t + 25), rate, fma(narrow(t + 29), u, r2));
            r3 = fma(narrow(t + 36), rate, fma(narrow(t + 40), u, r3));
            r4 = fma(narrow(t + 37), rate, fma(narrow(t + 41), u, r4));
            r5 = fma(narrow(t + 38), rate, fma(narrow(t + 42), u, r5));
            r6 = fma(narrow(t + 39), rate, fma(narrow(t + 43), u, r6));
        }
        // row j - 3 is complete; of the rows before the first, all is zero
        Value y = fma(factor(f + 1), y1, fma(factor(f + 2), y2, fma(factor(f + 3), y3, r0)));
        if (j >= 3)
            store(factor(f) * y, a.row(j - 3), c);
        y3 = y2;
        y2 = y1;
        y1 = y;
        r0 = r1;
        r1 = r2;
        r2 = r3;
        r3 = r4;
        r4 = r5;
        r5 = r6;
    }
    y1 = y2 = y3 = zero;
    for (Index i = n - 1; i >= 0; i--) {
        // all is read before anything is written: an array a multiple of 4096 bytes further looks like the same place
        const Index f = 4 * i;
        Value half = load<Value>(a.row(i), c), u = load<Value>(q.row(i), c), rate = load<Value>(v.row(i), c);
        Value y = fma(factor(f + 17), y1, fma(factor(f + 22), y2, fma(factor(f + 27), y3, half)));
        store(fma(s.correct_u, y, u), q.row(i), c);
        store(fma(s.correct_v, y, rate), v.row(i), c);
        store(y, a.row(i), c);
        y3 = y2;
        y2 = y1;
        y1 = y;
    }
}

// The same with any number of bands.
template <class Value>
[[gnu::noinline]] inline void step_wide(const Operator &op, const Scheme &s, const Motion &m, Index c, Value acting) {
    const Index n = m.q.shape[0], bands = op.cholesky_band.shape[0];
    const GivenMatrix lower = op.cholesky_band;
    const Matrix rhs = m.scratch.row(0), u_felt = m.scratch.row(1), v_felt = m.scratch.row(2);
    for (Index i = 0; i < n; i++) {
        Value rate = load<Value>(m.v.row(i), c), old = load<Value>(m.a.row(i), c);
        Value increment = fma(s.dt, rate, s.predict_u * old), gain = s.predict_v * old;
        Value u = increment + load<Value>(m.q.row(i), c);
        rate = gain + rate;
        store(u, m.q.row(i), c);
        store(rate, m.v.row(i), c);
        store(without(s.alpha_f, increment, u), u_felt.row(i), c);
        store(without(s.alpha_f, gain, rate), v_felt.row(i), c);
    }
    for (Index i = 0; i < n; i++) {
        Value value = op.drive_load(i) * acting;
        const Index begin = larger(Index(0), i - bands + 1);
        for (Index j = begin; j < smaller(n, i + bands); j++) {
            const Index k = i > j ? i - j : j - i, first = smaller(i, j);
            value = without(op.stiffness_band(k, first), load<Value>(u_felt.row(j), c), value);
            value = without(op.damping_band(k, first), load<Value>(v_felt.row(j), c), value);
            if (s.alpha_m != 0.0 && k < op.mass_band.shape[0])
                value = without(s.alpha_m * op.mass_band(k, first), load<Value>(m.a.row(j), c), value);
        }
        for (Index j = begin; j < i; j++)
            value = without(lower(i - j, j), load<Value>(rhs.row(j), c), value);
        store(lower(0, i) * value, rhs.row(i), c);
    }
    for (Index i = n - 1; i >= 0; i--) {
        Value value = load<Value>(rhs.row(i), c);
        for (Index j = i + 1; j < smaller(n, i + bands); j++)
            value = without(lower(j - i, i), load<Value>(m.a.row(j), c), value);
        value = lower(0, i) * value;
        store(value, m.a.row(i), c);
        store(fma(s.correct_u, value, load<Value>(m.q.row(i), c)), m.q.row(i), c);
        store(fma(s.correct_v, value, load<Value>(m.v.row(i), c)), m.v.row(i), c);
    }
}

// The step of one case alone, or of a pack of them.
template <class Value>
[[gnu::always_inline]] inline void step_bands(const Operator &op, const Scheme &s, const Motion &m, Index c,
                                              Value acting) {
    if (op.narrow.columns.size() > 0)
        step_narrow(op, s, m, c, acting);
    else
        step_wide(op, s, m, c, acting);
}

} // namespace FEMIMPACT_TARGET::stepping
