"""The record of one contact: when it opens, what it adds up to, and when it is an impact of the table."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import inlined
from femimpact.integrators.compiled.laws import (
    KELVIN_VOIGT,
    RIGID,
    SWITCHING_SPRING,
    LawNumbers,
    elastic_mean,
    normal_force,
    penetration,
)
from femimpact.integrators.stepping.layout import (
    APPROACH,
    BUSY,
    CONTACT_LOSS,
    DAMPING,
    DISSIPATIVE,
    DURATION,
    EXPONENT,
    FREE_STIFFNESS,
    GAP_MINUS,
    GAP_PLUS,
    IMPULSE,
    LOSS,
    NORMAL,
    OPEN,
    PEAK,
    RATE,
    RATE_BEFORE,
    REBOUND,
    RESTITUTION,
    SIDE,
    START,
    STIFFNESS,
    X_BEFORE,
    Motion,
    Pairs,
    Record,
    Scheme,
    X,
)


class PairSolution(NamedTuple):
    """What the equations of a step give for one pair."""

    time: float  # s, of the step's end
    gate: float  # +1 or -1: the side at hand, 0 between contacts
    x_free: float  # m, as it would be without contact forces in this step
    approach: float  # m/s, at which the contact opens or has opened
    normal: float  # N, positive where the wall pushes


@inlined
def law_numbers(j: int, c: int, approach: float, pairs: Pairs) -> LawNumbers:
    """Numbers of one pair's law in one case, for a contact that opened at this speed (m/s)."""
    constants = pairs.constants
    return LawNumbers(
        pairs.kind[j], constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c], constants[STIFFNESS, j, c],
        constants[DAMPING, j, c], constants[EXPONENT, j, c], constants[RESTITUTION, j, c],
        constants[FREE_STIFFNESS, j, c], approach, pairs.address[j],
    )  # fmt: skip


@inlined
def record_contact(
    j: int, c: int, found: PairSolution, row: NDArray[np.float64], s: Scheme, pairs: Pairs, m: Motion, record: Record
) -> None:
    """Open, follow and close the record of one contact.

    It opens with the first force, even one that turns the ball back within the step, and closes
    when the ball is off the wall and without force. A rigid contact closes with the first step
    without an impulse: impulses in consecutive steps, of a ball that sticks to its wall, are one
    contact, whose duration runs from the first to the last of them.
    """
    touch, constants, kind, gate, normal = m.touch, pairs.constants, pairs.kind[j], found.gate, found.normal
    side = penetration(m.ball[X, j, c], constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c])[1]
    always = kind == SWITCHING_SPRING or constants[FREE_STIFFNESS, j, c] > 0.0
    if kind == SWITCHING_SPRING:
        normal = normal if side != 0.0 else 0.0
        gate = side
    if touch[OPEN, j, c] == 0.0:
        if normal == 0.0:
            touch[BUSY, j, c] = 1.0 if always else 0.0
            return
        _open(j, c, gate, found, s, pairs, m)
    elif kind == RIGID and normal > 0.0:
        touch[DURATION, j, c] += s.dt
    # of a coarse step from wall to wall the force may be that of the other one
    normal *= gate * touch[SIDE, j, c] if gate != 0.0 else 1.0
    closing = normal == 0.0 and (kind == RIGID or side != touch[SIDE, j, c])
    step = record.tally[0]
    impulse, passed = _add_contact_loss(j, c, normal, s, pairs, m)
    if m.window[0, c] <= step < m.window[1, c]:
        m.totals[4, j, c] = max(m.totals[4, j, c], normal)
        m.totals[5, j, c] += impulse
    touch[IMPULSE, j, c] += impulse
    touch[PEAK, j, c] = max(touch[PEAK, j, c], normal)
    if kind != RIGID:
        touch[DURATION, j, c] += s.dt if normal != 0.0 else 0.0
    if kind != RIGID or normal > 0.0:
        touch[REBOUND, j, c] = -touch[SIDE, j, c] * m.ball[RATE, j, c]
    for k in range(m.to_modes.shape[1]):
        # work of the mean force on each mode; the displacement of a mode is the mean of its velocities times dt
        m.to_modes[j, k] += passed * row[k] * 0.5 * s.dt * (m.v_before[k, 0] + m.v[k, 0])
    if closing:
        touch[OPEN, j, c], touch[BUSY, j, c] = 0.0, 1.0 if always else 0.0
        _write_impact(j, c, step, kind, m, record)


@inlined
def _open(j: int, c: int, gate: float, found: PairSolution, s: Scheme, pairs: Pairs, m: Motion) -> None:
    touch, approach = m.touch, found.approach
    gap = pairs.constants[GAP_PLUS, j, c] if gate > 0.0 else pairs.constants[GAP_MINUS, j, c]
    if pairs.kind[j] == RIGID:
        approach = gate * m.ball[RATE_BEFORE, j, c]
        # the gap closed up to half a step before this one, or within its first half
        late = s.dt - min(max((gap - gate * m.ball[X_BEFORE, j, c]) / max(approach, 1e-300), -s.dt), s.dt)
    else:
        late = min(max((gate * found.x_free - gap) / max(approach, 1e-300), 0.0), s.dt)
    for field in range(OPEN, REBOUND + 1):
        touch[field, j, c] = 0.0
    touch[BUSY, j, c] = touch[OPEN, j, c] = 1.0
    touch[SIDE, j, c], touch[APPROACH, j, c], touch[START, j, c] = gate, approach, found.time - late
    for k in range(m.to_modes.shape[1]):
        m.to_modes[j, k] = 0.0


@inlined
def _add_contact_loss(j: int, c: int, normal: float, s: Scheme, pairs: Pairs, m: Motion) -> tuple[float, float]:
    """Add what the contact dissipates in this step: its dissipative force times the relative displacement.

    Returns the impulse (N s) of the step and the mean force (N) on the structure.
    """
    touch, constants, kind = m.touch, pairs.constants, pairs.kind[j]
    wall, x, before = touch[SIDE, j, c], m.ball[X, j, c], m.ball[X_BEFORE, j, c]
    travel = wall * (x - before)
    if kind == RIGID:
        # P (v0 + v1)/2: the work of the impulse
        loss = normal * s.dt * wall * 0.5 * (m.ball[RATE, j, c] + m.ball[RATE_BEFORE, j, c])
        impulse = s.dt * normal
    else:
        dissipative, gap_plus, gap_minus = 0.0, constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c]
        depth = max(wall * x - (gap_plus if wall > 0.0 else gap_minus), 0.0)
        if kind == KELVIN_VOIGT and not s.mean:
            dissipative = normal - constants[STIFFNESS, j, c] * depth
        elif s.mean:
            if kind != SWITCHING_SPRING:
                law = law_numbers(j, c, touch[APPROACH, j, c], pairs)
                dissipative = normal - wall * elastic_mean(law, before, x, s.dt)
        elif kind != SWITCHING_SPRING:
            dissipative = normal - normal_force(
                kind, depth, 0.0, constants[STIFFNESS, j, c], 0.0, constants[EXPONENT, j, c],
                touch[APPROACH, j, c], pairs.address[j],
            )  # fmt: skip
        if s.mean:
            loss, impulse = dissipative * travel, s.dt * normal
        else:
            loss = 0.5 * (touch[DISSIPATIVE, j, c] + dissipative) * travel
            impulse = 0.5 * s.dt * (touch[NORMAL, j, c] + normal)
        touch[DISSIPATIVE, j, c] = dissipative
    touch[NORMAL, j, c] = normal
    touch[LOSS, j, c] += loss
    m.ledger[CONTACT_LOSS, c] += loss
    return impulse, wall * impulse / s.dt


@inlined
def _write_impact(j: int, c: int, step: int, kind: int, m: Motion, record: Record) -> None:
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
            row[3], row[4] = touch[APPROACH, j, c], touch[REBOUND, j, c]
            row[5], row[6] = touch[IMPULSE, j, c], math.nan if kind == RIGID else touch[PEAK, j, c]
            row[7], row[8] = touch[DURATION, j, c], touch[LOSS, j, c]
            for i in range(m.to_modes.shape[1]):
                row[9 + i] = m.to_modes[j, i]
        record.tally[3] += 1
