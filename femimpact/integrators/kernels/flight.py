"""One step without contact force: modes or banded dofs, balls, and what is looked at every step."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import called, inlined
from femimpact.integrators.kernels.packs import WIDTH, entry, fill, fma, load, product, store
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
    load_of: NDArray[Any], inertia: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any],
    s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any],
    acting: NDArray[Any],
) -> None:  # fmt: skip
    """One step of every mode without contact force, and the first place that is read every step."""
    zero = fill(0.0)
    for c in range(0, acting.size, WIDTH):
        total, total_rate = _step_modes(
            load_of, inertia, damping, stiffness, row, s, q, v, a, c, load(acting, 0, c, zero), zero
        )
        store(w, 0, c, total)
        store(w_rate, 0, c, total_rate)


@inlined
def free_step_single(
    load_of: NDArray[Any], inertia: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any],
    s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], c: int, acting: float,
) -> tuple[float, float]:  # fmt: skip
    """The same step, operation by operation, of one case alone."""
    return _step_modes(load_of, inertia, damping, stiffness, row, s, q, v, a, c, acting, 0.0)


@inlined
def _step_modes(
    load_of: NDArray[Any], inertia: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any],
    s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], c: int, acting: Any, zero: Any,
) -> tuple[Any, Any]:  # fmt: skip
    """The step of one case, or of a pack of them: the sums that are read stay in registers."""
    total, total_rate = zero, zero
    for i in range(q.shape[0]):
        u, rate, old = load(q, i, c, zero), load(v, i, c, zero), load(a, i, c, zero)
        acceleration = fma(
            -entry(stiffness, i), u,
            fma(-entry(damping, i), rate, fma(-entry(inertia, i), old, product(entry(load_of, i), acting))),
        )  # fmt: skip
        u_new = fma(s.correct_u, acceleration, fma(s.predict_u, old, fma(s.dt, rate, u)))
        v_new = fma(s.correct_v, acceleration, fma(s.predict_v, old, rate))
        store(a, i, c, acceleration)
        store(q, i, c, u_new)
        store(v, i, c, v_new)
        total, total_rate = fma(entry(row, i), u_new, total), fma(entry(row, i), v_new, total_rate)
    return total, total_rate


@called
def read_row(row: NDArray[Any], q: NDArray[Any], v: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any]) -> None:
    """Displacement and velocity of one place: a row over the dofs."""
    for c in range(w.size):
        w[c] = 0.0
        w_rate[c] = 0.0
    for i in range(row.size):
        if row[i] != 0.0:
            add(w, row[i], q[i])
            add(w_rate, row[i], v[i])


@called
def add(target: NDArray[Any], scale: float, values: NDArray[Any]) -> None:
    """Add a multiple of a row over the cases."""
    for c in range(target.size):
        target[c] += scale * values[c]


@called
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
