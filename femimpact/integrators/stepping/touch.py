"""Contact: the equations of the pairs of one case, their effect on its state, and one collision alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import apart, compiled, inlined
from femimpact.integrators.compiled.laws import RIGID, LawNumbers, penetration
from femimpact.integrators.stepping.impact import PairSolution, law_numbers, record_contact
from femimpact.integrators.stepping.layout import (
    APPROACH,
    FORCE,
    GAP_MINUS,
    GAP_PLUS,
    MOBILITY,
    OBSTACLE_RATE,
    OBSTACLE_RATE_BEFORE,
    OPEN,
    RATE,
    RATE_BEFORE,
    WORK,
    X_BEFORE,
    Y_ACCELERATION,
    Y_BEFORE,
    Y_RATE,
    Motion,
    Operator,
    Pairs,
    Record,
    Scheme,
    X,
    Y,
)
from femimpact.integrators.stepping.pair import FreePair, pair_force

PAIR_ITERATIONS = 200
PAIR_TOLERANCE = 1e-15
"""Gauss-Seidel over pairs that share a structure stops at this change, relative to the largest force."""


@inlined
def _side_at_hand(
    s: Scheme, kind: int, x: float, x_before: float, rate_before: float, gap_plus: float, gap_minus: float
) -> float:
    """Wall whose contact a step is about, from its contact-free end: +1, -1, or 0 between contacts."""
    if kind == RIGID:
        # half a step on, from the state before the step
        return penetration(x_before + 0.5 * s.dt * rate_before, gap_plus, gap_minus)[1]
    side = penetration(x, gap_plus, gap_minus)[1]
    return penetration(x_before, gap_plus, gap_minus)[1] if s.mean and side == 0.0 else side


@inlined
def _approach_speed(gate: float, rate: float, x: float, x_before: float, dt: float) -> float:
    """Speed (m/s) at which a contact opens: that before the step, or of the motion into the wall if it ends within."""
    speed = gate * rate
    return speed if speed > 0.0 else max(gate * (x - x_before) / dt, 1e-300)


@inlined
def contact_step(
    c: int, time: float, op: Operator, s: Scheme, pairs: Pairs, m: Motion, record: Record, work: NDArray[np.float64]
) -> None:
    """Contact forces of one case, their effect on its state, and the record of its contacts.

    `time` is that of the step's end.
    """
    count, constants = pairs.row.size, pairs.constants
    x_free, rate_free, gate, force, normal, approach = work[0], work[1], work[2], work[3], work[4], work[5]
    if s.carry != 0.0:
        for j in range(count):
            if m.ball[FORCE, j, c] != 0.0:
                _apply_force(j, c, s.carry * m.ball[FORCE, j, c], op, s, constants[MOBILITY, j, c], m)
    for j in range(count):
        x_free[j] = m.ball[Y, j, c] - m.w[pairs.row[j], c]
        rate_free[j] = m.ball[Y_RATE, j, c] - m.w_rate[pairs.row[j], c]
        gate[j] = _side_at_hand(
            s, pairs.kind[j], x_free[j], m.ball[X_BEFORE, j, c], m.ball[RATE_BEFORE, j, c],
            constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c],
        )  # fmt: skip
        approach[j] = m.touch[APPROACH, j, c]
        if m.touch[OPEN, j, c] == 0.0 and gate[j] != 0.0:
            approach[j] = _approach_speed(gate[j], rate_free[j], x_free[j], m.ball[X_BEFORE, j, c], s.dt)
        force[j] = 0.0
    for _ in range(PAIR_ITERATIONS):
        change, largest = 0.0, 0.0
        for j in range(count):
            others_u, others_v, r = 0.0, 0.0, pairs.row[j]
            for i in range(count):
                if i != j:
                    others_u += op.compliance_u[r, i] * force[i]
                    others_v += op.compliance_v[r, i] * force[i]
            mobility = constants[MOBILITY, j, c]
            if s.mean and count > 1 and pairs.kind[j] != RIGID:
                # what the others push may open or close this contact; its mean force is continuous there
                gate[j] = _side_at_hand(
                    s, pairs.kind[j], x_free[j] - others_u, m.ball[X_BEFORE, j, c], m.ball[RATE_BEFORE, j, c],
                    constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c],
                )  # fmt: skip
                if m.touch[OPEN, j, c] == 0.0 and gate[j] != 0.0 and approach[j] <= 0.0:
                    approach[j] = _approach_speed(
                        gate[j], rate_free[j] - others_v, x_free[j] - others_u, m.ball[X_BEFORE, j, c], s.dt
                    )
            free = FreePair(
                gate[j], x_free[j] - others_u, rate_free[j] - others_v, m.ball[X_BEFORE, j, c],
                m.ball[RATE_BEFORE, j, c], op.compliance_u[r, j] + s.give_u * mobility,
                op.compliance_v[r, j] + s.give_v * mobility,
            )  # fmt: skip
            new, normal[j] = pair_force(s, law_numbers(j, c, approach[j], pairs), free)
            change = max(change, abs(new - force[j]))
            largest = max(largest, abs(new))
            force[j] = new
        if count == 1 or change <= PAIR_TOLERANCE * largest:
            break
    if pairs.obstacles.size > 0:
        _add_work_of_obstacles(c, force, s, pairs, m)
    for j in range(count):
        m.ball[FORCE, j, c] = force[j]
        if force[j] != 0.0:
            _apply_force(j, c, force[j], op, s, constants[MOBILITY, j, c], m)
    for j in range(count):
        m.ball[X, j, c] = m.ball[Y, j, c] - m.w[pairs.row[j], c]
        m.ball[RATE, j, c] = m.ball[Y_RATE, j, c] - m.w_rate[pairs.row[j], c]
        found = PairSolution(time, gate[j], x_free[j], approach[j], normal[j])
        record_contact(j, c, found, op.rows[pairs.row[j]], s, pairs, m, record)


@apart
def _add_work_of_obstacles(c: int, force: NDArray[np.float64], s: Scheme, pairs: Pairs, m: Motion) -> None:
    """Work of what holds a stop in space: relative to the base it moves at y' and pushes with F, a power F y'.

    A mean force acts over the displacement of the step, an impulse at the mean of the rates as its loss is
    summed, a force at the step's end by the trapezoidal rule.
    """
    for j in pairs.obstacles:
        increment = m.ball[Y, j, c] - m.ball[Y_BEFORE, j, c]
        mean = force[j]
        if s.rigid:
            increment = 0.5 * s.dt * (m.drive[OBSTACLE_RATE, c] + m.drive[OBSTACLE_RATE_BEFORE, c])
        elif not s.mean:
            mean = 0.5 * (m.ball[FORCE, j, c] + force[j])
        m.ledger[WORK, c] += mean * increment


@inlined
def _apply_force(j: int, c: int, force: float, op: Operator, s: Scheme, mobility: float, m: Motion) -> None:
    for i in range(m.q.shape[0]):
        m.a[i, c] += op.response_a[j, i] * force
        m.q[i, c] += op.response_u[j, i] * force
        m.v[i, c] += op.response_v[j, i] * force
    for r in range(m.w.shape[0]):
        m.w[r, c] += op.compliance_u[r, j] * force
        m.w_rate[r, c] += op.compliance_v[r, j] * force
    gain = -force * mobility
    m.ball[Y_ACCELERATION, j, c] += s.give_a * gain
    m.ball[Y, j, c] += s.give_u * gain
    m.ball[Y_RATE, j, c] += s.give_v * gain


@compiled
def collide(law: LawNumbers, mass: float, speed: float, start: float, s: Scheme) -> tuple[float, float]:
    """Rebound over approach speed, and peak force (N), of one mass sent against one wall with this step.

    The wall of the + side stands at gap 0, the contact begins `start` (0 to 1) of a step after the last step without
    contact, and the law's approach speed is that of this collision.
    """
    x, rate, acceleration, before = -start * s.dt * speed, speed, 0.0, 0.0
    peak, approach = 0.0, 0.0
    for _ in range(100_000_000):
        x_before, rate_before = x, rate
        old = acceleration
        acceleration = -s.alpha_m / (1.0 - s.alpha_m) * old - s.give_a * s.carry * before / mass
        x += s.dt * rate + s.predict_u * old + s.correct_u * acceleration
        rate += s.predict_v * old + s.correct_v * acceleration
        gate = _side_at_hand(s, law.kind, x, x_before, rate_before, 0.0, np.inf)
        if approach == 0.0 and gate != 0.0:
            approach = _approach_speed(gate, rate, x, x_before, s.dt)
        numbers = LawNumbers(
            law.kind, 0.0, np.inf, law.stiffness, law.damping, law.exponent, law.restitution, 0.0, approach, law.address
        )
        free = FreePair(gate, x, rate, x_before, rate_before, s.give_u / mass, s.give_v / mass)
        force, normal = pair_force(s, numbers, free)
        peak = max(peak, normal)
        x -= s.give_u * force / mass
        rate -= s.give_v * force / mass
        acceleration -= s.give_a * force / mass
        left = x <= 0.0 or law.kind == RIGID
        # an algorithmic acceleration may last longer than the force
        if left and rate <= 0.0 and force == 0.0 and abs(rate - rate_before) <= 1e-13 * speed:
            break
        before = force
    return -rate / speed, peak
