"""One step without contact force: modes or banded dofs, balls, and what is looked at every step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import apart, called, inlined
from femimpact.integrators.compiled.packs import (
    WIDTH,
    Value,
    differ_in_sign,
    entry,
    fill,
    fma,
    how_many_beyond,
    load,
    product,
    store,
    times,
)
from femimpact.integrators.stepping.crest import add_crests
from femimpact.integrators.stepping.layout import (
    ACCELERATION,
    BASE,
    BASE_BEFORE,
    COSINE,
    GAP_MINUS,
    GAP_PLUS,
    LAST,
    LAST_RATE,
    OBSTACLE_RATE,
    OBSTACLE_RATE_BEFORE,
    SCALE,
    SHARE,
    SINE,
    TRAVEL,
    TRAVEL_RATE,
    TURN_COSINE,
    TURN_SINE,
    X_BEFORE,
    Y_ACCELERATION,
    Y_RATE,
    Coordinates,
    Cycles,
    ModalStep,
    Motion,
    Operator,
    Pairs,
    Scheme,
    X,
    Y,
)

Array = NDArray[np.float64]


@inlined
def turn_drive(drive: Array) -> None:
    """The drive at the next step, by rotating the phase: no trigonometric call per step."""
    if drive.shape[1] == 1:
        _turn(drive, 0, 0.0)
        return
    for c in range(0, drive.shape[1], WIDTH):
        _turn(drive, c, fill(0.0))


@inlined
def _turn(drive: Array, c: int, zero: Value) -> None:
    sine, cosine = load(drive, SINE, c, zero), load(drive, COSINE, c, zero)
    turn_sine, turn_cosine = load(drive, TURN_SINE, c, zero), load(drive, TURN_COSINE, c, zero)
    scale, base = load(drive, SCALE, c, zero), load(drive, BASE, c, zero)
    turned = fma(1.0, times(sine, turn_cosine), times(cosine, turn_sine))
    store(drive, COSINE, c, fma(-1.0, times(sine, turn_sine), times(cosine, turn_cosine)))
    store(drive, SINE, c, turned)
    store(drive, BASE_BEFORE, c, base)
    store(drive, BASE, c, times(scale, turned))


@inlined
def read_drive(table: Array, base: Array) -> None:
    """The drive at the next step from its samples."""
    for c in range(base.size):
        base[c] = table[c]


@inlined
def blend_drive(alpha: float, base: Array, before: Array, acting: Array) -> None:
    """The drive in the balance within the step."""
    for c in range(base.size):
        acting[c] = (1.0 - alpha) * base[c] + alpha * before[c]


@inlined
def free_step_diagonal(
    modes: ModalStep, row: Array, s: Scheme, state: Coordinates, w: Array, w_rate: Array, acting: Array
) -> None:
    """One step of every mode without contact force, and the first place that is read every step."""
    zero = fill(0.0)
    for c in range(0, acting.size, WIDTH):
        total, total_rate = _step_modes(modes, row, s, state, c, load(acting, 0, c, zero), zero)
        store(w, 0, c, total)
        store(w_rate, 0, c, total_rate)


@inlined
def free_step_single(
    modes: ModalStep, row: Array, s: Scheme, state: Coordinates, c: int, acting: float
) -> tuple[float, float]:
    """The same step, operation by operation, of one case alone."""
    return _step_modes(modes, row, s, state, c, acting, 0.0)


@inlined
def _step_modes(
    modes: ModalStep, row: Array, s: Scheme, state: Coordinates, c: int, acting: Value, zero: Value
) -> tuple[Value, Value]:
    """The step of one case, or of a pack of them: the sums that are read stay in registers."""
    q, v, a = state.q, state.v, state.a
    total, total_rate = zero, zero
    for i in range(q.shape[0]):
        u, rate, old = load(q, i, c, zero), load(v, i, c, zero), load(a, i, c, zero)
        acceleration = fma(
            -entry(modes.stiffness, i), u,
            fma(
                -entry(modes.damping, i), rate,
                fma(-entry(modes.inertia, i), old, product(entry(modes.load, i), acting)),
            ),
        )  # fmt: skip
        u_new = fma(s.correct_u, acceleration, fma(s.predict_u, old, fma(s.dt, rate, u)))
        v_new = fma(s.correct_v, acceleration, fma(s.predict_v, old, rate))
        store(a, i, c, acceleration)
        store(q, i, c, u_new)
        store(v, i, c, v_new)
        total, total_rate = fma(entry(row, i), u_new, total), fma(entry(row, i), v_new, total_rate)
    return total, total_rate


@called
def read_row(row: Array, q: Array, v: Array, w: Array, w_rate: Array) -> None:
    """Displacement and velocity of one place: a row over the dofs."""
    for c in range(w.size):
        w[c] = 0.0
        w_rate[c] = 0.0
    for i in range(row.size):
        if row[i] != 0.0:
            add(w, row[i], q[i])
            add(w_rate, row[i], v[i])


@called
def add(target: Array, scale: float, values: Array) -> None:
    """Add a multiple of a row over the cases."""
    for c in range(target.size):
        target[c] += scale * values[c]


@called
def add_product(target: Array, scale: float, f: Array, g: Array) -> None:
    """Add a multiple of the product of two rows over the cases."""
    for c in range(target.size):
        target[c] += scale * f[c] * g[c]


@apart
def add_constant_load(op: Operator, m: Motion) -> None:
    """What the constant load adds to a step of every case, the places that are read included."""
    if m.q.shape[1] == 1:
        add_constant_load_single(0, op, m)
        for r in range(m.w.shape[0]):
            m.w[r, 0] += op.constant_w[0, r]
            m.w_rate[r, 0] += op.constant_w[1, r]
        return
    for i in range(op.constant_load.size):
        add_number(m.a[i], op.constant_a[i])
        add_number(m.q[i], op.constant_u[i])
        add_number(m.v[i], op.constant_v[i])
    for r in range(m.w.shape[0]):
        add_number(m.w[r], op.constant_w[0, r])
        add_number(m.w_rate[r], op.constant_w[1, r])


@inlined
def add_constant_load_single(c: int, op: Operator, m: Motion) -> None:
    """The same for one case, but for the places."""
    for i in range(op.constant_load.size):
        m.a[i, c] += op.constant_a[i]
        m.q[i, c] += op.constant_u[i]
        m.v[i, c] += op.constant_v[i]


@called
def add_number(target: Array, number: float) -> None:
    """Add a number to a row over the cases."""
    for c in range(target.size):
        target[c] += number


@apart
def move_obstacles(index: int, s: Scheme, pairs: Pairs, m: Motion) -> None:
    """Stops fixed in space as the free step takes them to where they are at its end.

    `index` is that of the step's end among the fine steps of a base given by samples.
    """
    drive = m.drive
    for c in range(drive.shape[1]):
        if m.travel.shape[1] > 0:
            y, rate = m.travel[0, index, c], m.travel[1, index, c]
        else:
            y, rate = drive[TRAVEL, c] * drive[SINE, c], drive[TRAVEL_RATE, c] * drive[COSINE, c]
        drive[OBSTACLE_RATE_BEFORE, c], drive[OBSTACLE_RATE, c] = drive[OBSTACLE_RATE, c], rate
        place_obstacles(c, y, rate, s.dt, pairs, m)


@called
def place_obstacles(c: int, y: float, rate: float, dt: float, pairs: Pairs, m: Motion) -> None:
    """Stops fixed in space a step before y (m), at the rate (m/s) that they have there.

    y is the base's displacement, not a sum over steps: the free step adds dt times the rate, and no error stays.
    """
    for j in pairs.obstacles:
        m.ball[Y, j, c], m.ball[Y_RATE, j, c] = y - dt * rate, rate


@inlined
def free_step_ball(j: int, s: Scheme, ball: Array, constants: Array, acting: Array, w: Array, busy: Array) -> int:
    """One step of a ball without contact, and in how many cases its contact must be looked at.

    `ball` and `constants` hold its rows, `w` is the place of its pair. A stop has no share in the drive
    and stays where it is, or goes on at its rate.
    """
    if acting.size == 1:
        return _step_ball(s, ball, constants, j, 0, acting[0], w[0], busy[0])
    zero, looking = fill(0.0), 0
    for c in range(0, acting.size, WIDTH):
        looking += _step_ball(
            s, ball, constants, j, c, load(acting, 0, c, zero), load(w, 0, c, zero), load(busy, 0, c, zero)
        )
    return looking


@inlined
def _step_ball(s: Scheme, ball: Array, constants: Array, j: int, c: int, acting: Value, w: Value, busy: Value) -> int:
    # row r of pair j lies behind r times all pairs
    pairs = ball.shape[1]
    scale, inertia = 1.0 / (1.0 - s.alpha_m), s.alpha_m / (1.0 - s.alpha_m)
    share = constants[SHARE, j, 0]
    y, rate = load(ball, Y * pairs + j, c, acting), load(ball, Y_RATE * pairs + j, c, acting)
    old = load(ball, Y_ACCELERATION * pairs + j, c, acting)
    given = fma(-share, acting, load(constants, ACCELERATION * pairs + j, c, acting))
    new = fma(-inertia, old, product(scale, given))
    y = fma(s.correct_u, new, fma(s.predict_u, old, fma(s.dt, rate, y)))
    store(ball, Y * pairs + j, c, y)
    store(ball, Y_RATE * pairs + j, c, fma(s.correct_v, new, fma(s.predict_v, old, rate)))
    store(ball, Y_ACCELERATION * pairs + j, c, new)
    x = fma(-1.0, w, y)
    store(ball, X_BEFORE * pairs + j, c, load(ball, X * pairs + j, c, acting))
    store(ball, X * pairs + j, c, x)
    gap_plus, gap_minus = (
        load(constants, GAP_PLUS * pairs + j, c, acting),
        load(constants, GAP_MINUS * pairs + j, c, acting),
    )
    looking: int = how_many_beyond(x, gap_plus, gap_minus, busy)
    return looking


@inlined
def observe(step: int, s: Scheme, m: Motion, cycles: Cycles) -> None:
    """Add the observed place's displacement to the statistics of the running cycle."""
    if m.w.shape[1] == 1:
        _observe(0, m.w[0, 0], m.w_rate[0, 0], step, s, m, cycles)
        return
    for c in range(0, m.w.shape[1], WIDTH):
        _observe(c, load(m.w, 0, c, fill(0.0)), load(m.w_rate, 0, c, fill(0.0)), step, s, m, cycles)


@inlined
def _observe(c: int, w: Value, rate: Value, step: int, s: Scheme, m: Motion, cycles: Cycles) -> None:
    drive, sums, last = m.drive, cycles.sums, cycles.last
    # rare; the extremes have no other part in this loop
    if differ_in_sign(rate, load(last, LAST_RATE, c, w)):
        add_crests(c, (step - 1) * s.dt, s, m.w, m.w_rate, m.touch, sums, last)
    store(last, LAST, c, w)
    store(last, LAST_RATE, c, rate)
    store(sums, 2, c, fma(1.0, times(w, w), load(sums, 2, c, w)))
    store(sums, 3, c, fma(1.0, times(w, load(drive, SINE, c, w)), load(sums, 3, c, w)))
    store(sums, 4, c, fma(1.0, times(w, load(drive, COSINE, c, w)), load(sums, 4, c, w)))
