"""Contact: the scalar equation of a pair, its effect on a case, and the record of its impacts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import compiled, inlined
from femimpact.integrators.kernels.laws import SWITCHING_SPRING, kelvin_voigt_force, penetration, switching_stiffness
from femimpact.integrators.layout import (
    APPROACH,
    BUSY,
    CONTACT_LOSS,
    DAMPING,
    DISSIPATIVE,
    DURATION,
    FORCE,
    FREE_STIFFNESS,
    GAP_MINUS,
    GAP_PLUS,
    IMPULSE,
    LOSS,
    MASS,
    NORMAL,
    OPEN,
    PEAK,
    SIDE,
    START,
    STIFFNESS,
    X_BEFORE,
    Y_ACCELERATION,
    Y_RATE,
    Motion,
    Operator,
    Pairs,
    Record,
    Scheme,
    X,
    Y,
)

PAIR_ITERATIONS = 200
PAIR_TOLERANCE = 1e-15
"""Gauss-Seidel over pairs that share a structure stops at this change, relative to the largest force."""


@inlined
def _pair_force(
    j: int, c: int, x_free: float, rate_free: float, gate: float, mobility: float, x_before: float,
    s: Scheme, kind: int, constants: NDArray[Any],
) -> tuple[float, float]:  # fmt: skip
    """Force on the structure and its normal part, from the step's scalar equation of one pair.

    x = x_free - correct_u mobility F, x' = rate_free - correct_v mobility F, F = F(x, x').
    """
    spring, plus, minus = constants[FREE_STIFFNESS, j, c], constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c]
    stiffness, damping = constants[STIFFNESS, j, c], constants[DAMPING, j, c]
    if kind == SWITCHING_SPRING:
        # decided by the state before the step, as printed
        spring = switching_stiffness(x_before, plus, minus, spring, stiffness)
    give_u, give_v = s.correct_u * mobility, s.correct_v * mobility
    soften = 1.0 / (1.0 + give_u * spring)
    x = x_free * soften
    rate = rate_free - give_v * spring * x
    if kind == SWITCHING_SPRING:
        return spring * x, abs(spring * x)
    normal = 0.0
    if gate != 0.0:
        depth = gate * x - (plus if gate > 0.0 else minus)
        yielding = 1.0 + soften * (stiffness * give_u + damping * give_v)
        normal = kelvin_voigt_force(depth, gate * rate, stiffness, damping) / yielding
    x -= soften * give_u * gate * normal
    return gate * normal + spring * x, normal


@inlined
def contact_step(c: int, op: Operator, s: Scheme, pairs: Pairs, m: Motion, record: Record, work: NDArray[Any]) -> None:
    """Contact forces of one case, their effect on its state, and the bookkeeping of its impacts."""
    count = pairs.row.size
    x_free, rate_free, gate, force, normal = work[0], work[1], work[2], work[3], work[4]
    for j in range(count):
        x_free[j] = m.ball[Y, j, c] - m.w[pairs.row[j], c]
        rate_free[j] = m.ball[Y_RATE, j, c] - m.w_rate[pairs.row[j], c]
        # gated on the penetration without contact force, never inside the iteration
        gate[j] = penetration(x_free[j], pairs.constants[GAP_PLUS, j, c], pairs.constants[GAP_MINUS, j, c])[1]
        force[j] = 0.0
    for _ in range(PAIR_ITERATIONS):
        change, largest = 0.0, 0.0
        for j in range(count):
            others = 0.0
            for i in range(count):
                if i != j:
                    others += op.compliance[pairs.row[j], i] * force[i]
            mobility = 1.0 / pairs.constants[MASS, j, c] + op.compliance[pairs.row[j], j]
            new, normal[j] = _pair_force(
                j, c, x_free[j] - s.correct_u * others, rate_free[j] - s.correct_v * others,
                gate[j], mobility, m.ball[X_BEFORE, j, c], s, pairs.kind[j], pairs.constants,
            )  # fmt: skip
            change = max(change, abs(new - force[j]))
            largest = max(largest, abs(new))
            force[j] = new
        if count == 1 or change <= PAIR_TOLERANCE * largest:
            break
    for j in range(count):
        m.ball[FORCE, j, c] = force[j]
        if force[j] != 0.0:
            _apply_force(j, c, force[j], op, s, pairs.constants[MASS, j, c], m)
    for j in range(count):
        m.ball[X, j, c] = m.ball[Y, j, c] - m.w[pairs.row[j], c]
        rate = m.ball[Y_RATE, j, c] - m.w_rate[pairs.row[j], c]
        _book_impact(
            j, c, gate[j], x_free[j], rate_free[j], rate, normal[j], s.dt, pairs.kind[j], pairs.constants, m, record
        )


@inlined
def _apply_force(j: int, c: int, force: float, op: Operator, s: Scheme, mass: float, m: Motion) -> None:
    for i in range(m.q.shape[0]):
        gain = op.response[j, i] * force
        m.a[i, c] += gain
        m.q[i, c] += s.correct_u * gain
        m.v[i, c] += s.correct_v * gain
    for r in range(m.w.shape[0]):
        gain = op.compliance[r, j] * force
        m.w[r, c] += s.correct_u * gain
        m.w_rate[r, c] += s.correct_v * gain
    gain = -force / mass
    m.ball[Y_ACCELERATION, j, c] += gain
    m.ball[Y, j, c] += s.correct_u * gain
    m.ball[Y_RATE, j, c] += s.correct_v * gain


@inlined
def _book_impact(
    j: int, c: int, gate: float, x_free: float, rate_free: float, rate: float, normal: float, dt: float, kind: int,
    constants: NDArray[Any], m: Motion, record: Record,
) -> None:  # fmt: skip
    """Open, follow and close the record of one contact.

    It opens with the first force, even one that throws the ball back within the step, and closes
    when the ball is off the wall and without force.
    """
    touch, x, step = m.touch, m.ball[X, j, c], record.tally[0]
    depth, side = penetration(x, constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c])
    always = kind == SWITCHING_SPRING or constants[FREE_STIFFNESS, j, c] > 0.0
    if kind == SWITCHING_SPRING:
        normal = normal if side != 0.0 else 0.0
        gate = side
    if touch[OPEN, j, c] == 0.0:
        if normal == 0.0:
            touch[BUSY, j, c] = 1.0 if always else 0.0
            return
        approach = gate * rate_free
        gap = constants[GAP_PLUS, j, c] if gate > 0.0 else constants[GAP_MINUS, j, c]
        late = min(max((gate * x_free - gap) / max(approach, 1e-300), 0.0), dt)
        for field in range(OPEN, DISSIPATIVE + 1):
            touch[field, j, c] = 0.0
        touch[BUSY, j, c] = touch[OPEN, j, c] = 1.0
        touch[SIDE, j, c], touch[APPROACH, j, c], touch[START, j, c] = gate, approach, (step + 1) * dt - late
    off = side != touch[SIDE, j, c]
    closing = off and normal == 0.0
    if off:
        depth = 0.0
    dissipative = 0.0
    if kind != SWITCHING_SPRING:
        dissipative = normal - constants[STIFFNESS, j, c] * depth
    travel = touch[SIDE, j, c] * (x - m.ball[X_BEFORE, j, c])
    loss = 0.5 * (touch[DISSIPATIVE, j, c] + dissipative) * travel
    touch[LOSS, j, c] += loss
    m.ledger[CONTACT_LOSS, c] += loss
    impulse = 0.5 * dt * (touch[NORMAL, j, c] + normal)
    touch[IMPULSE, j, c] += impulse
    if m.window[0, c] <= step < m.window[1, c]:
        m.totals[4, j, c] = max(m.totals[4, j, c], normal)
        m.totals[5, j, c] += impulse
    touch[PEAK, j, c] = max(touch[PEAK, j, c], normal)
    touch[DURATION, j, c] += dt if normal > 0.0 else 0.0
    touch[NORMAL, j, c], touch[DISSIPATIVE, j, c] = normal, dissipative
    if closing:
        touch[OPEN, j, c], touch[BUSY, j, c] = 0.0, 1.0 if always else 0.0
        _write_impact(j, c, step, rate, m, record)


@inlined
def _write_impact(j: int, c: int, step: int, rate: float, m: Motion, record: Record) -> None:
    """Add a finished impact to the totals of its case, and to the table of case 0."""
    touch, totals = m.touch, m.totals
    if m.window[0, c] <= step < m.window[1, c]:
        totals[0, j, c] += 1.0
        totals[1, j, c] += touch[APPROACH, j, c]
        totals[2, j, c] = max(totals[2, j, c], touch[APPROACH, j, c])
        totals[3, j, c] += touch[IMPULSE, j, c]
    if c == 0:
        k = record.tally[3]
        if k < record.impacts.shape[0]:
            row = record.impacts[k]
            row[0], row[1], row[2] = touch[START, j, c], j, touch[SIDE, j, c]
            row[3], row[4] = touch[APPROACH, j, c], -touch[SIDE, j, c] * rate
            row[5], row[6] = touch[IMPULSE, j, c], touch[PEAK, j, c]
            row[7], row[8] = touch[DURATION, j, c], touch[LOSS, j, c]
        record.tally[3] += 1


@compiled
def collide(
    kind: int, stiffness: float, damping: float, mass: float, speed: float, start: float, s: Scheme
) -> tuple[float, float]:
    """Rebound over approach speed, and peak force (N), of one mass thrown at one wall with this step.

    The contact begins `start` (0 to 1) of a step after the last step in flight.
    """
    x, rate, acceleration = -start * s.dt * speed, speed, 0.0
    peak = 0.0
    for _ in range(100_000_000):
        x_free = x + s.dt * rate + s.predict_u * acceleration
        rate_free = rate + s.predict_v * acceleration
        depth = penetration(x_free, 0.0, np.inf)[0]
        force = 0.0
        if kind == SWITCHING_SPRING:
            if x > 0.0:
                force = stiffness * x_free / (1.0 + stiffness * s.correct_u / mass)
        elif depth > 0.0:
            yielding = 1.0 + (stiffness * s.correct_u + damping * s.correct_v) / mass
            force = kelvin_voigt_force(depth, rate_free, stiffness, damping) / yielding
        peak = max(peak, force)
        acceleration = -force / mass
        x = x_free + s.correct_u * acceleration
        rate = rate_free + s.correct_v * acceleration
        if x <= 0.0 and rate <= 0.0:
            break
    return -rate / speed, peak
