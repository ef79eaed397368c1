// Which cases a contact concerns: a quick check of every pair, between contacts too.
#pragma once

#include "../pack.hpp"
#include "loop_data.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Keeps the relative rate of a pair at this step and at the last.
[[gnu::always_inline]] inline void keep_rate(Index j, Array w_rate, const Motion &m) {
    over_cases(w_rate.size(), [&](auto zero, Index c) {
        using Value = decltype(zero);
        Array rate = m.ball.row(RATE, j);
        store(load<Value>(rate, c), m.ball.row(RATE_BEFORE, j), c);
        store(load<Value>(m.ball.row(Y_RATE, j), c) - load<Value>(w_rate, c), rate, c);
    });
}

// Before a step with impulses: marks the cases whose gap is closed half a step on.
[[gnu::always_inline]] inline void look_ahead(Index j, double half, const Pairs &pairs, const Motion &m) {
    over_cases(m.q.shape[1], [&](auto zero, Index c) {
        using Value = decltype(zero);
        Array busy = m.touch.row(BUSY, j);
        Value ahead = load<Value>(m.ball.row(X, j), c) + half * load<Value>(m.ball.row(RATE, j), c);
        auto closed = (ahead > load<Value>(pairs.constants.row(GAP_PLUS, j), c)) |
                      (ahead < -load<Value>(pairs.constants.row(GAP_MINUS, j), c));
        store(chosen(closed, filled<Value>(1.0), load<Value>(busy, c)), busy, c);
    });
}

// After a step without contact: marks the cases in which one of pair j lasts, or could have taken place within it, and
// returns how many these are.
//
// The cubic through both ends with their rates stays below max(x0, x1) + 4/27 dt (|x0'| + |x1'|).
[[gnu::always_inline]] inline Index look_around(Index j, double dt, const Pairs &pairs, const Motion &m) {
    double reach = dt / 6.0;
    Index looking = 0;
    over_cases(m.q.shape[1], [&](auto zero, Index c) {
        using Value = decltype(zero);
        Value x = load<Value>(m.ball.row(X, j), c), before = load<Value>(m.ball.row(X_BEFORE, j), c);
        Value beyond = reach * (magnitude(load<Value>(m.ball.row(RATE_BEFORE, j), c)) +
                                magnitude(load<Value>(m.ball.row(RATE, j), c)));
        auto near = (larger(x, before) + beyond > load<Value>(pairs.constants.row(GAP_PLUS, j), c)) |
                    (smaller(x, before) - beyond < -load<Value>(pairs.constants.row(GAP_MINUS, j), c)) |
                    (load<Value>(m.touch.row(OPEN, j), c) > zero);
        store(chosen(near, filled<Value>(1.0), zero), m.touch.row(NEAR, j), c);
        looking += how_many(near);
    });
    return looking;
}

// Copies rows over the cases, to redo a step from them.
inline void save(Matrix target, Matrix source) {
    __builtin_memcpy(target.data, source.data, source.shape[0] * source.shape[1] * sizeof(double));
}

} // namespace FEMIMPACT_TARGET::stepping
