"""One step without contact force in physical dofs: banded matrices, cases in packs of eight or one alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import apart, inlined
from femimpact.integrators.compiled.packs import WIDTH, Value, entry, fill, fma, load, product, store
from femimpact.integrators.stepping.layout import BandedStep, Coordinates, Motion, Operator, Scheme

__all__ = ["free_step_banded", "free_step_banded_single"]

Array = NDArray[np.float64]


@inlined
def free_step_banded(op: Operator, s: Scheme, m: Motion, acting: Array) -> None:
    """The step of every case, eight at a time."""
    if op.narrow.columns.size > 0:
        _packs(op.narrow, op.drive_load, s, Coordinates(m.q, m.v, m.a), acting)
    else:
        for c in range(0, acting.size, WIDTH):
            _step_wide(op, s, m, c, load(acting, 0, c, fill(0.0)))


@inlined
def free_step_banded_single(op: Operator, s: Scheme, m: Motion, c: int, acting: float) -> None:
    """The same step, operation by operation, of one case alone."""
    if op.narrow.columns.size > 0:
        _alone(op.narrow, op.drive_load, s, Coordinates(m.q, m.v, m.a), c, acting)
    else:
        _step_wide(op, s, m, c, acting)


@apart
def _packs(matrices: BandedStep, drive: Array, s: Scheme, state: Coordinates, acting: Array) -> None:
    zero = fill(0.0)
    for c in range(0, acting.size, WIDTH):
        _step(matrices, drive, s, state, c, load(acting, 0, c, zero), zero)


@apart
def _alone(matrices: BandedStep, drive: Array, s: Scheme, state: Coordinates, c: int, acting: float) -> None:
    _step(matrices, drive, s, state, c, acting, 0.0)


@inlined
def _step(
    matrices: BandedStep, drive: Array, s: Scheme, state: Coordinates, c: int, acting: Value, zero: Value
) -> None:
    """Two sweeps: right-hand side with forward substitution, back substitution with the new state.

    Column j of the matrices reaches the rows j - 3 to j + 3; r0 to r6 are the sums of those so far. In between,
    q and v hold what is predicted, a half of the solution.
    """
    narrow, factor, q, v, a, n = matrices.columns, matrices.factor, state.q, state.v, state.a, state.q.shape[0]
    averaged = (s.alpha_f != 0.0) | (s.alpha_m != 0.0)
    r0 = r1 = r2 = r3 = r4 = r5 = y1 = y2 = y3 = zero
    for j in range(n + 3):
        t, f, r6 = 12 * j, 4 * j, zero
        if j < n:
            rate, old = load(v, j, c, zero), load(a, j, c, zero)
            increment, gain = fma(s.dt, rate, product(s.predict_u, old)), product(s.predict_v, old)
            u, rate = fma(1.0, increment, load(q, j, c, zero)), fma(1.0, gain, rate)
            store(q, j, c, u)
            store(v, j, c, rate)
            r3 = fma(entry(drive, j), acting, r3)
            if averaged:
                u, rate = fma(-s.alpha_f, increment, u), fma(-s.alpha_f, gain, rate)
                r0, r1 = fma(entry(narrow, t + 11), old, r0), fma(entry(narrow, t + 22), old, r1)
                r2, r3 = fma(entry(narrow, t + 33), old, r2), fma(entry(narrow, t + 44), old, r3)
                r4, r5 = fma(entry(narrow, t + 45), old, r4), fma(entry(narrow, t + 46), old, r5)
                r6 = product(entry(narrow, t + 47), old)
            r0 = fma(entry(narrow, t + 3), rate, fma(entry(narrow, t + 7), u, r0))
            r1 = fma(entry(narrow, t + 14), rate, fma(entry(narrow, t + 18), u, r1))
            r2 = fma(entry(narrow, t + 25), rate, fma(entry(narrow, t + 29), u, r2))
            r3 = fma(entry(narrow, t + 36), rate, fma(entry(narrow, t + 40), u, r3))
            r4 = fma(entry(narrow, t + 37), rate, fma(entry(narrow, t + 41), u, r4))
            r5 = fma(entry(narrow, t + 38), rate, fma(entry(narrow, t + 42), u, r5))
            r6 = fma(entry(narrow, t + 39), rate, fma(entry(narrow, t + 43), u, r6))
        # row j - 3 is complete; of the rows before the first, all is zero
        y = fma(entry(factor, f + 1), y1, fma(entry(factor, f + 2), y2, fma(entry(factor, f + 3), y3, r0)))
        if j >= 3:
            store(a, j - 3, c, product(entry(factor, f), y))
        y1, y2, y3 = y, y1, y2
        r0, r1, r2, r3, r4, r5 = r1, r2, r3, r4, r5, r6
    y1 = y2 = y3 = zero
    for i in range(n - 1, -1, -1):
        # all is read before anything is written: an array a multiple of 4096 bytes further looks like the same place
        f, half, u, rate = 4 * i, load(a, i, c, zero), load(q, i, c, zero), load(v, i, c, zero)
        y = fma(entry(factor, f + 17), y1, fma(entry(factor, f + 22), y2, fma(entry(factor, f + 27), y3, half)))
        store(q, i, c, fma(s.correct_u, y, u))
        store(v, i, c, fma(s.correct_v, y, rate))
        store(a, i, c, y)
        y1, y2, y3 = y, y1, y2


@apart
def _step_wide(op: Operator, s: Scheme, m: Motion, c: int, acting: Value) -> None:
    """The same with any number of bands."""
    n, bands, lower = m.q.shape[0], op.cholesky_band.shape[0], op.cholesky_band
    rhs, u_felt, v_felt = m.scratch[0], m.scratch[1], m.scratch[2]
    for i in range(n):
        rate, old = load(m.v, i, c, acting), load(m.a, i, c, acting)
        increment, gain = fma(s.dt, rate, product(s.predict_u, old)), product(s.predict_v, old)
        u, rate = fma(1.0, increment, load(m.q, i, c, acting)), fma(1.0, gain, rate)
        store(m.q, i, c, u)
        store(m.v, i, c, rate)
        store(u_felt, i, c, fma(-s.alpha_f, increment, u))
        store(v_felt, i, c, fma(-s.alpha_f, gain, rate))
    for i in range(n):
        value = product(op.drive_load[i], acting)
        for j in range(max(0, i - bands + 1), min(n, i + bands)):
            k, first = abs(i - j), min(i, j)
            value = fma(-op.stiffness_band[k, first], load(u_felt, j, c, acting), value)
            value = fma(-op.damping_band[k, first], load(v_felt, j, c, acting), value)
            if (s.alpha_m != 0.0) & (k < op.mass_band.shape[0]):
                value = fma(-s.alpha_m * op.mass_band[k, first], load(m.a, j, c, acting), value)
        for j in range(max(0, i - bands + 1), i):
            value = fma(-lower[i - j, j], load(rhs, j, c, acting), value)
        store(rhs, i, c, product(lower[0, i], value))
    for i in range(n - 1, -1, -1):
        value = load(rhs, i, c, acting)
        for j in range(i + 1, min(n, i + bands)):
            value = fma(-lower[j - i, i], load(m.a, j, c, acting), value)
        value = product(lower[0, i], value)
        store(m.a, i, c, value)
        store(m.q, i, c, fma(s.correct_u, value, load(m.q, i, c, acting)))
        store(m.v, i, c, fma(s.correct_v, value, load(m.v, i, c, acting)))
