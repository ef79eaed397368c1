"""One step without contact force: modes or banded dofs, balls, and what is looked at every step."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import compiled, inlined
from femimpact.integrators.layout import (
    BASE,
    BASE_BEFORE,
    COSINE,
    SCALE,
    SINE,
    TURN_COSINE,
    TURN_SINE,
    Scheme,
)

# A loop over cases goes into SIMD lanes only while the compiler can check its few arrays against overlap:
# three written and two read are too many already, so some loops below are split in two.


@inlined
def turn_drive(drive: NDArray[Any]) -> None:
    """The drive at the next step, by rotating the phase: no trigonometric call per step."""
    sine, cosine, turn_sine, turn_cosine = drive[SINE], drive[COSINE], drive[TURN_SINE], drive[TURN_COSINE]
    base, before, scale = drive[BASE], drive[BASE_BEFORE], drive[SCALE]
    for c in range(sine.size):
        turned = sine[c] * turn_cosine[c] + cosine[c] * turn_sine[c]
        cosine[c] = cosine[c] * turn_cosine[c] - sine[c] * turn_sine[c]
        sine[c] = turned
    for c in range(sine.size):
        before[c] = base[c]
    for c in range(sine.size):
        base[c] = scale[c] * sine[c]


@inlined
def read_drive(table: NDArray[Any], base: NDArray[Any]) -> None:
    """The drive at the next step from its samples."""
    for c in range(base.size):
        base[c] = table[c]


@inlined
def blend_drive(alpha: float, base: NDArray[Any], before: NDArray[Any], acting: NDArray[Any]) -> None:
    """What the balance within the step feels of the drive."""
    for c in range(base.size):
        acting[c] = (1.0 - alpha) * base[c] + alpha * before[c]


@inlined
def free_step_diagonal(
    load: NDArray[Any], inertia: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any],
    s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any],
    acting: NDArray[Any],
) -> None:  # fmt: skip
    """One step of every mode without contact force, and the first place that is read every step."""
    n, cases = q.shape
    dt, pu, pv, cu, cv = s.dt, s.predict_u, s.predict_v, s.correct_u, s.correct_v
    for c in range(cases):
        w[c] = 0.0
        w_rate[c] = 0.0
    for i in range(n):
        g, j, d, k, r = load[i], inertia[i], damping[i], stiffness[i], row[i]
        qi, vi, ai = q[i], v[i], a[i]
        for c in range(cases):
            u, rate, old = qi[c], vi[c], ai[c]
            acceleration = g * acting[c] - (k * u + d * rate + j * old)
            u_new = u + dt * rate + pu * old + cu * acceleration
            v_new = rate + pv * old + cv * acceleration
            ai[c] = acceleration
            qi[c] = u_new
            vi[c] = v_new
            w[c] += r * u_new
            w_rate[c] += r * v_new


@inlined
def free_step_single(
    load: NDArray[Any], inertia: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any],
    s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], acting: float,
) -> tuple[float, float]:  # fmt: skip
    """The same step, operation by operation, of one case alone: sums stay in registers."""
    total, total_rate = 0.0, 0.0
    for i in range(q.size):
        u, rate, old = q[i], v[i], a[i]
        acceleration = load[i] * acting - (stiffness[i] * u + damping[i] * rate + inertia[i] * old)
        u_new = u + s.dt * rate + s.predict_u * old + s.correct_u * acceleration
        v_new = rate + s.predict_v * old + s.correct_v * acceleration
        q[i], v[i], a[i] = u_new, v_new, acceleration
        total += row[i] * u_new
        total_rate += row[i] * v_new
    return total, total_rate


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


@inlined
def free_step_ball(
    s: Scheme, y: NDArray[Any], y_rate: NDArray[Any], y_acceleration: NDArray[Any], given: NDArray[Any],
    share: float, acting: NDArray[Any],
) -> None:  # fmt: skip
    """One step of a ball in free flight; a stop has no share in the drive and stays where it is."""
    scale, inertia = 1.0 / (1.0 - s.alpha_m), s.alpha_m / (1.0 - s.alpha_m)
    for c in range(y.size):
        y[c] += s.dt * y_rate[c] + s.predict_u * y_acceleration[c]
        y_rate[c] += s.predict_v * y_acceleration[c]
    for c in range(y.size):
        y_acceleration[c] = scale * (given[c] - share * acting[c]) - inertia * y_acceleration[c]
    for c in range(y.size):
        y[c] += s.correct_u * y_acceleration[c]
        y_rate[c] += s.correct_v * y_acceleration[c]


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
