"""A step in which contact takes place, redone by one case in fine steps with the second prepared operator."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import called, inlined
from femimpact.integrators.compiled.packs import fill, how_many_beyond, load
from femimpact.integrators.stepping.banded import free_step_banded_single
from femimpact.integrators.stepping.crest import add_fine_step
from femimpact.integrators.stepping.free_step import add_constant_load_single, free_step_single, place_obstacles
from femimpact.integrators.stepping.layout import (
    ACCELERATION,
    BASE,
    BASE_BEFORE,
    BUSY,
    COSINE,
    GAP_MINUS,
    GAP_PLUS,
    NEAR,
    OWN_LOSS,
    OWN_WORK,
    PHASE,
    PHASE_STEP,
    RATE,
    RATE_BEFORE,
    REFINED,
    SCALE,
    SHARE,
    SINE,
    STRUCTURE_LOSS,
    TRAVEL,
    TRAVEL_RATE,
    WORK,
    X_BEFORE,
    Y_ACCELERATION,
    Y_RATE,
    Cases,
    Coordinates,
    Fine,
    Motion,
    Operator,
    Pairs,
    Scheme,
    X,
    Y,
)
from femimpact.integrators.stepping.ledger import write_ledger_of_case
from femimpact.integrators.stepping.touch import contact_step
from femimpact.integrators.stepping.watch import save

__all__ = ["in_reach", "is_near", "none_in_reach", "redo_step", "save_state"]

Array = NDArray[np.float64]


@inlined
def save_state(m: Motion) -> None:
    """Keep the state before a step, to redo it from there."""
    save(m.saved[0], m.q)
    save(m.saved[1], m.v)
    save(m.saved[2], m.a)
    save(m.saved_ball[0], m.ball[Y])
    save(m.saved_ball[1], m.ball[Y_RATE])
    save(m.saved_ball[2], m.ball[Y_ACCELERATION])


@inlined
def _restore(c: int, m: Motion) -> None:
    """Put one case back to the start of its step."""
    for i in range(m.q.shape[0]):
        m.q[i, c], m.v[i, c], m.a[i, c] = m.saved[0, i, c], m.saved[1, i, c], m.saved[2, i, c]
    for j in range(m.ball.shape[1]):
        m.ball[Y, j, c], m.ball[Y_RATE, j, c] = m.saved_ball[0, j, c], m.saved_ball[1, j, c]
        m.ball[Y_ACCELERATION, j, c] = m.saved_ball[2, j, c]
        m.ball[X, j, c], m.ball[RATE, j, c] = m.ball[X_BEFORE, j, c], m.ball[RATE_BEFORE, j, c]


@inlined
def is_near(c: int, m: Motion) -> bool:
    """Whether any pair of a case was in contact in this step, or could have been."""
    near = 0.0
    for j in range(m.ball.shape[1]):
        near = max(near, m.touch[NEAR, j, c])
    return near > 0.0


@inlined
def in_reach(c: int, pairs: Pairs, m: Motion) -> int:
    """How many pairs of a case must be looked at."""
    reached = 0
    for j in range(pairs.row.size):
        x = m.ball[X, j, c]
        outside = (x > pairs.constants[GAP_PLUS, j, c]) | (x < -pairs.constants[GAP_MINUS, j, c])
        reached += outside | (m.touch[BUSY, j, c] > 0.0)
    return reached


@inlined
def none_in_reach(c: int, pairs: Pairs, m: Motion) -> bool:
    """Whether no pair of a pack of cases must be looked at."""
    zero, reached, count = fill(0.0), 0, pairs.row.size
    for j in range(count):
        reached += how_many_beyond(
            load(m.ball, X * count + j, c, zero),
            load(pairs.constants, GAP_PLUS * count + j, c, zero),
            load(pairs.constants, GAP_MINUS * count + j, c, zero),
            load(m.touch, BUSY * count + j, c, zero),
        )
    return reached == 0


@inlined
def _drive_within(c: int, step: int, part: int, parts: int, m: Motion) -> float:
    """Drive of one case after `part` fine steps of the step that began at `step`; at its ends as the others have it."""
    if part == 0:
        value: float = m.drive[BASE_BEFORE, c]
    elif part == parts:
        value = m.drive[BASE, c]
    elif m.table.shape[0] > 0:
        value = m.table[step * parts + part, c]
    else:
        value = m.drive[SCALE, c] * math.sin(m.drive[PHASE, c] + m.drive[PHASE_STEP, c] * (step + part / parts))
    return value


@called
def _move_obstacles_within(c: int, step: int, part: int, parts: int, s: Scheme, pairs: Pairs, m: Motion) -> None:
    """Stops fixed in space before the fine step that ends after `part` of them; see `place_obstacles`."""
    if m.travel.shape[1] > 0:
        y, rate = m.travel[0, step * parts + part, c], m.travel[1, step * parts + part, c]
    else:
        sine, cosine = m.drive[SINE, c], m.drive[COSINE, c]
        if part < parts:
            angle = m.drive[PHASE, c] + m.drive[PHASE_STEP, c] * (step + part / parts)
            sine, cosine = math.sin(angle), math.cos(angle)
        y, rate = m.drive[TRAVEL, c] * sine, m.drive[TRAVEL_RATE, c] * cosine
    place_obstacles(c, y, rate, s.dt, pairs, m)


@inlined
def _fine_free_step(
    c: int, before: float, after: float, op: Operator, s: Scheme, pairs: Pairs, m: Motion, physical: bool | None
) -> None:
    """One fine step of one case without contact force."""
    acting = (1.0 - s.alpha_f) * after + s.alpha_f * before
    if physical is not None:
        free_step_banded_single(op, s, m, c, acting)
    else:
        free_step_single(op.modes, op.rows[0], s, Coordinates(m.q, m.v, m.a), c, acting)
    add_constant_load_single(c, op, m)
    _read_rows(c, op.rows, m.q, m.v, m.w, m.w_rate)
    scale, inertia = 1.0 / (1.0 - s.alpha_m), s.alpha_m / (1.0 - s.alpha_m)
    for j in range(pairs.row.size):
        given = pairs.constants[ACCELERATION, j, c] - pairs.constants[SHARE, j, c] * acting
        old = m.ball[Y_ACCELERATION, j, c]
        new = scale * given - inertia * old
        m.ball[Y, j, c] += s.dt * m.ball[Y_RATE, j, c] + s.predict_u * old + s.correct_u * new
        m.ball[Y_RATE, j, c] += s.predict_v * old + s.correct_v * new
        m.ball[Y_ACCELERATION, j, c] = new
        r = pairs.row[j]
        m.ball[X_BEFORE, j, c], m.ball[RATE_BEFORE, j, c] = m.ball[X, j, c], m.ball[RATE, j, c]
        m.ball[X, j, c] = m.ball[Y, j, c] - m.w[r, c]
        m.ball[RATE, j, c] = m.ball[Y_RATE, j, c] - m.w_rate[r, c]


@called
def _read_rows(c: int, rows: Array, q: Array, v: Array, w: Array, w_rate: Array) -> None:
    for r in range(rows.shape[0]):
        total, total_rate = 0.0, 0.0
        for i in range(rows.shape[1]):
            total += rows[r, i] * q[i, c]
            total_rate += rows[r, i] * v[i, c]
        w[r, c], w_rate[r, c] = total, total_rate


@called
def redo_step(c: int, dt: float, fine: Fine, cases: Cases, ledger: bool, physical: bool | None) -> None:
    """Take one case through its step of dt again, in fine ones; its ledger and its crests are its own."""
    parts, op, s, pairs, m, record = fine.parts, fine.operator, fine.scheme, cases.pairs, cases.motion, cases.record
    step = record.tally[0]
    _restore(c, m)
    after = _drive_within(c, step, 0, parts, m)
    for part in range(parts):
        before, after = after, _drive_within(c, step, part + 1, parts, m)
        if pairs.obstacles.size > 0:
            _move_obstacles_within(c, step, part + 1, parts, s, pairs, m)
        _fine_free_step(c, before, after, op, s, pairs, m, physical)
        if in_reach(c, pairs, m) > 0:
            contact_step(c, step * dt + (part + 1) * s.dt, op, s, pairs, m, record, cases.pair_scratch)
        add_fine_step(c, step, part, parts, dt, m, cases.cycles)
        if ledger:
            write_ledger_of_case(c, before, after, op, s, pairs, m)
    m.ledger[REFINED, c] = 1.0
    m.ledger[OWN_WORK, c], m.ledger[OWN_LOSS, c] = m.ledger[WORK, c], m.ledger[STRUCTURE_LOSS, c]
