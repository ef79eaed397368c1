"""One step without contact force: modes or banded dofs, balls, and what is looked at every step."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import compiled, inlined
from femimpact.integrators.layout import BASE, COSINE, SCALE, SINE, TURN_COSINE, TURN_SINE, Motion, Operator, Scheme

# A loop over cases goes into SIMD lanes only while the compiler can check its few arrays against overlap:
# three written and two read are too many already, so some loops below are split in two.


@inlined
def turn_base(drive: NDArray[Any]) -> None:
    """Base acceleration at the next step, by rotating the phase: no trigonometric call per step."""
    sine, cosine, turn_sine, turn_cosine = drive[SINE], drive[COSINE], drive[TURN_SINE], drive[TURN_COSINE]
    base, scale = drive[BASE], drive[SCALE]
    for c in range(sine.size):
        turned = sine[c] * turn_cosine[c] + cosine[c] * turn_sine[c]
        cosine[c] = cosine[c] * turn_cosine[c] - sine[c] * turn_sine[c]
        sine[c] = turned
    for c in range(sine.size):
        base[c] = scale[c] * sine[c]


@inlined
def free_step_diagonal(
    load: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any], s: Scheme,
    q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any], base: NDArray[Any],
) -> None:  # fmt: skip
    """One step of every mode without contact force, and the first place that is read every step."""
    n, cases = q.shape
    dt, pu, pv, cu, cv = s.dt, s.predict_u, s.predict_v, s.correct_u, s.correct_v
    for c in range(cases):
        w[c] = 0.0
        w_rate[c] = 0.0
    for i in range(n):
        g, d, k, r = load[i], damping[i], stiffness[i], row[i]
        qi, vi, ai = q[i], v[i], a[i]
        for c in range(cases):
            u_predicted = qi[c] + dt * vi[c] + pu * ai[c]
            v_predicted = vi[c] + pv * ai[c]
            acceleration = g * base[c] - (d * v_predicted + k * u_predicted)
            u_new = u_predicted + cu * acceleration
            v_new = v_predicted + cv * acceleration
            ai[c] = acceleration
            qi[c] = u_new
            vi[c] = v_new
            w[c] += r * u_new
            w_rate[c] += r * v_new


@inlined
def free_step_single(
    load: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any], s: Scheme,
    q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any], base: NDArray[Any],
) -> None:  # fmt: skip
    """The same step, operation by operation, of one case alone: sums stay in registers."""
    acting, total, total_rate = base[0], 0.0, 0.0
    for i in range(q.size):
        u_predicted = q[i] + s.dt * v[i] + s.predict_u * a[i]
        v_predicted = v[i] + s.predict_v * a[i]
        acceleration = load[i] * acting - (damping[i] * v_predicted + stiffness[i] * u_predicted)
        q[i] = u_predicted + s.correct_u * acceleration
        v[i] = v_predicted + s.correct_v * acceleration
        a[i] = acceleration
        total += row[i] * q[i]
        total_rate += row[i] * v[i]
    w[0] = total
    w_rate[0] = total_rate


@compiled
def read_row(row: NDArray[Any], q: NDArray[Any], v: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any]) -> None:
    """Displacement and velocity of one place: a row over the dofs."""
    for c in range(w.size):
        w[c] = 0.0
        w_rate[c] = 0.0
    for i in range(row.size):
        if row[i] != 0.0:
            add(w, row[i], q[i])
            add(w_rate, row[i], v[i])


@compiled
def add(target: NDArray[Any], scale: float, values: NDArray[Any]) -> None:
    """Add a multiple of a row over the cases."""
    for c in range(target.size):
        target[c] += scale * values[c]


@compiled
def add_product(target: NDArray[Any], scale: float, f: NDArray[Any], g: NDArray[Any]) -> None:
    """Add a multiple of the product of two rows over the cases."""
    for c in range(target.size):
        target[c] += scale * f[c] * g[c]


@compiled
def _scale(target: NDArray[Any], scale: float) -> None:
    for c in range(target.size):
        target[c] *= scale


@compiled
def free_step_banded(op: Operator, s: Scheme, m: Motion) -> None:
    """The step in physical dofs: banded right-hand side, forward and back substitution."""
    n, cases = m.q.shape
    rhs, u_predicted, v_predicted = m.scratch[0], m.scratch[1], m.scratch[2]
    base = m.drive[BASE]
    for i in range(n):
        load, q, v, a = op.load[i], m.q[i], m.v[i], m.a[i]
        u_i, v_i, rhs_i = u_predicted[i], v_predicted[i], rhs[i]
        for c in range(cases):
            u_i[c] = q[c] + s.dt * v[c] + s.predict_u * a[c]
            v_i[c] = v[c] + s.predict_v * a[c]
            rhs_i[c] = load * base[c]
    for i in range(n):
        add(rhs[i], -op.damping_band[0, i], v_predicted[i])
        add(rhs[i], -op.stiffness_band[0, i], u_predicted[i])
        for k in range(1, min(op.stiffness_band.shape[0], n - i)):
            add(rhs[i], -op.damping_band[k, i], v_predicted[i + k])
            add(rhs[i], -op.stiffness_band[k, i], u_predicted[i + k])
            add(rhs[i + k], -op.damping_band[k, i], v_predicted[i])
            add(rhs[i + k], -op.stiffness_band[k, i], u_predicted[i])
    _solve_banded(op.cholesky_band, rhs)
    for i in range(n):
        q, v, a, u_i, v_i, rhs_i = m.q[i], m.v[i], m.a[i], u_predicted[i], v_predicted[i], rhs[i]
        for c in range(cases):
            a[c] = rhs_i[c]
            q[c] = u_i[c] + s.correct_u * rhs_i[c]
            v[c] = v_i[c] + s.correct_v * rhs_i[c]


@compiled
def free_step_banded_single(
    op: Operator, s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], base: float, scratch: NDArray[Any]
) -> None:
    """The same step of one case alone."""
    n, bands, lower = q.size, op.cholesky_band.shape[0], op.cholesky_band
    rhs, u_predicted, v_predicted = scratch[0, :, 0], scratch[1, :, 0], scratch[2, :, 0]
    for i in range(n):
        u_predicted[i] = q[i] + s.dt * v[i] + s.predict_u * a[i]
        v_predicted[i] = v[i] + s.predict_v * a[i]
        rhs[i] = op.load[i] * base - op.damping_band[0, i] * v_predicted[i] - op.stiffness_band[0, i] * u_predicted[i]
    for k in range(1, bands):
        damping, stiffness = op.damping_band[k], op.stiffness_band[k]
        for i in range(n - k):
            rhs[i] -= damping[i] * v_predicted[i + k] + stiffness[i] * u_predicted[i + k]
        for i in range(n - k):
            rhs[i + k] -= damping[i] * v_predicted[i] + stiffness[i] * u_predicted[i]
    for i in range(n):
        value = rhs[i]
        for k in range(1, min(bands, i + 1)):
            value -= lower[k, i - k] * rhs[i - k]
        rhs[i] = value * lower[0, i]
    for i in range(n - 1, -1, -1):
        value = rhs[i]
        for k in range(1, min(bands, n - i)):
            value -= lower[k, i] * rhs[i + k]
        rhs[i] = value * lower[0, i]
    for i in range(n):
        a[i] = rhs[i]
        q[i] = u_predicted[i] + s.correct_u * rhs[i]
        v[i] = v_predicted[i] + s.correct_v * rhs[i]


@compiled
def _solve_banded(lower: NDArray[Any], rhs: NDArray[Any]) -> None:
    """Solve L L^T x = rhs in place; L by its lower bands with the reciprocal of its diagonal in row 0."""
    bands, n = lower.shape
    for i in range(n):
        for k in range(1, min(bands, i + 1)):
            add(rhs[i], -lower[k, i - k], rhs[i - k])
        _scale(rhs[i], lower[0, i])
    for i in range(n - 1, -1, -1):
        for k in range(1, min(bands, n - i)):
            add(rhs[i], -lower[k, i], rhs[i + k])
        _scale(rhs[i], lower[0, i])


@inlined
def free_step_ball(
    s: Scheme, y: NDArray[Any], y_rate: NDArray[Any], y_acceleration: NDArray[Any], given: NDArray[Any],
    base: NDArray[Any],
) -> None:  # fmt: skip
    """One step of a ball in free flight."""
    for c in range(y.size):
        y[c] += s.dt * y_rate[c] + s.predict_u * y_acceleration[c]
        y_rate[c] += s.predict_v * y_acceleration[c]
    for c in range(y.size):
        y_acceleration[c] = given[c] - base[c]
    for c in range(y.size):
        y[c] += s.correct_u * y_acceleration[c]
        y_rate[c] += s.correct_v * y_acceleration[c]


@inlined
def look(
    x: NDArray[Any], x_before: NDArray[Any], y: NDArray[Any], w: NDArray[Any], gap_plus: NDArray[Any],
    gap_minus: NDArray[Any], busy: NDArray[Any],
) -> int:  # fmt: skip
    """Relative displacement of a ball, and in how many cases its contact must be looked at."""
    for c in range(x.size):
        x_before[c] = x[c]
        x[c] = y[c] - w[c]
    looking = 0
    for c in range(x.size):
        looking += (x[c] > gap_plus[c]) | (x[c] < -gap_minus[c]) | (busy[c] > 0.0)
    return looking


@inlined
def observe(w: NDArray[Any], drive: NDArray[Any], sums: NDArray[Any]) -> None:
    """Add the observed place's displacement to the sums of the running cycle."""
    largest, least, square = sums[0], sums[1], sums[2]
    for c in range(w.size):
        largest[c] = w[c] if w[c] > largest[c] else largest[c]
        least[c] = w[c] if w[c] < least[c] else least[c]
        square[c] += w[c] * w[c]
    sine, cosine, in_phase, in_quadrature = drive[SINE], drive[COSINE], sums[3], sums[4]
    for c in range(w.size):
        in_phase[c] += w[c] * sine[c]
        in_quadrature[c] += w[c] * cosine[c]
