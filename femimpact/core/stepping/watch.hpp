// Which cases a contact concerns: a quick check of every pair, between contacts too.
#pragma once

#include "../pack.hpp"
#include "loop_data.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Keeps the relative rate of a pair at this step and at the last; w_rate is that of its place.
template <class Value> [[gnu::always_inline]] inline void keep_rate(Index j, Index c, Value w_rate, const Motion &m) {
    Array rate = m.ball.row(RATE, j);
    store(load<Value>(rate, c), m.ball.row(RATE_BEFORE, j), c);
    store(load<Value>(m.ball.row(Y_RATE, j), c) - w_rate, rate, c);
}

// Before a step with impulses: marks the cases whose gap is closed half a step on.
template <class Value>
[[gnu::always_inline]] inline void look_ahead(Index j, Index c, double half, const Pairs &pairs, const Motion &m) {
    Array busy = m.touch.row(BUSY, j);
    Value ahead = load<Value>(m.ball.row(X, j), c) + half * load<Value>(m.ball.row(RATE, j), c);
    auto closed = (ahead > load<Value>(pairs.constants.row(GAP_PLUS, j), c)) |
                  (ahead < -load<Value>(pairs.constants.row(GAP_MINUS, j), c));
    store(chosen(closed, filled<Value>(1.0), load<Value>(busy, c)), busy, c);
}

// After a step without contact: the cases in which one of pair j lasts, or could have taken place within it, as bits.
//
// The cubic through both ends with their rates stays below max(x0, x1) + 4/27 dt (|x0'| + |x1'|).
template <class Value>
[[gnu::always_inline]] inline unsigned near_walls(Index j, Index c, double dt, const Pairs &pairs, const Motion &m) {
    double reach = dt / 6.0;
    Value x = load<Value>(m.ball.row(X, j), c), before = load<Value>(m.ball.row(X_BEFORE, j), c);
    Value beyond = reach * (magnitude(load<Value>(m.ball.row(RATE_BEFORE, j), c)) +
                            magnitude(load<Value>(m.ball.row(RATE, j), c)));
    return bits_where((larger(x, before) + beyond > load<Value>(pairs.constants.row(GAP_PLUS, j), c)) |
                      (smaller(x, before) - beyond < -load<Value>(pairs.constants.row(GAP_MINUS, j), c)) |
                      (load<Value>(m.touch.row(OPEN, j), c) > Value{}));
}

// Copies rows over the cases, to redo a step from them.
inline void save(Matrix target, Matrix source) {
    __builtin_memcpy(target.data, source.data, source.shape[0] * source.shape[1] * sizeof(double));
}

} // namespace FEMIMPACT_TARGET::stepping
