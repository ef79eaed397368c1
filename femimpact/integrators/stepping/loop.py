"""The loop over steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import ZERO, compiled_long, inlined
from femimpact.integrators.compiled.packs import WIDTH
from femimpact.integrators.stepping.banded import free_step_banded, free_step_banded_single
from femimpact.integrators.stepping.crest import split_cycles
from femimpact.integrators.stepping.free_step import (
    add_constant_load,
    blend_drive,
    free_step_ball,
    free_step_diagonal,
    free_step_single,
    move_obstacles,
    observe,
    read_drive,
    read_row,
    turn_drive,
)
from femimpact.integrators.stepping.keeping import any_due, close_cycles, keep, least
from femimpact.integrators.stepping.layout import (
    ACCELERATION,
    ACTING,
    BASE,
    BASE_BEFORE,
    BUSY,
    GAP_MINUS,
    GAP_PLUS,
    LOAD,
    MASS,
    RATE,
    RATE_BEFORE,
    REFINED,
    SHARE,
    STRUCTURE_LOSS,
    WORK,
    Y_BEFORE,
    Y_RATE,
    Cases,
    Coordinates,
    Fine,
    Motion,
    Operator,
    Pairs,
    Record,
    Scheme,
    X,
    Y,
)
from femimpact.integrators.stepping.ledger import (
    add_loss_banded,
    add_loss_diagonal,
    add_loss_single,
    add_work,
    add_work_on_ball,
    restore_refined_cases,
)
from femimpact.integrators.stepping.refine import in_reach, is_near, none_in_reach, redo_step, save_state
from femimpact.integrators.stepping.touch import contact_step
from femimpact.integrators.stepping.watch import keep_rate, look_ahead, look_around

Array = NDArray[np.float64]


@inlined
def _free_step(op: Operator, s: Scheme, m: Motion, acting: Array, physical: bool | None) -> None:
    """Structure of every case, and what is read of it."""
    if physical is not None:
        if m.w.shape[1] == 1:
            free_step_banded_single(op, s, m, 0, acting[0])
        else:
            free_step_banded(op, s, m, acting)
        read_row(op.rows[0], m.q, m.v, m.w[0], m.w_rate[0])
    elif m.w.shape[1] == 1:
        state = Coordinates(m.q, m.v, m.a)
        m.w[0, 0], m.w_rate[0, 0] = free_step_single(op.modes, op.rows[0], s, state, 0, acting[0])
    else:
        state = Coordinates(m.q, m.v, m.a)
        free_step_diagonal(op.modes, op.rows[0], s, state, m.w[0], m.w_rate[0], acting)
    for r in range(1, m.w.shape[0]):
        read_row(op.rows[r], m.q, m.v, m.w[r], m.w_rate[r])
    if op.constant_load.size > 0:
        add_constant_load(op, m)


@inlined
def _write_ledger(op: Operator, s: Scheme, pairs: Pairs, m: Motion, physical: bool | None) -> None:
    """Work and losses of the step of every case."""
    base, before = m.drive[BASE], m.drive[BASE_BEFORE]
    if physical is not None:
        add_loss_banded(op, s, m)
    elif m.loss_of_mode.size > 0:
        m.ledger[LOAD, 0] = add_loss_single(
            m.scratch[0, :, 0], op.drive_load, m.q[:, 0], m.v[:, 0], m.v_before[:, 0], m.loss_of_mode
        )
    else:
        add_loss_diagonal(
            m.scratch[0, :, 0], op.drive_load, m.q, m.v, m.v_before, m.ledger[STRUCTURE_LOSS], m.ledger[LOAD]
        )
    add_work(base, before, m.ledger)
    for j in range(pairs.row.size):
        add_work_on_ball(
            base, before, pairs.constants[SHARE, j, 0], pairs.constants[MASS, j], pairs.constants[ACCELERATION, j],
            m.ball[Y, j], m.ball[Y_BEFORE, j], m.ledger[WORK],
        )  # fmt: skip


@inlined
def _redo(s: Scheme, fine: Fine, cases: Cases, ledger: bool, physical: bool | None) -> int:
    """Cases in which a contact lasts or could have begun take the step in fine ones; returns how many."""
    refined = 0
    if fine.parts == 1:
        return refined
    for c in range(cases.motion.q.shape[1]):
        if is_near(c, cases.motion):
            redo_step(c, s.dt, fine, cases, ledger, physical)
            refined += 1
    return refined


@inlined
def _look_ahead(s: Scheme, fine: Fine, pairs: Pairs, m: Motion) -> None:
    """Before a step: what may be needed to redo it, or which gaps impulses will find closed."""
    if fine.parts > 1:
        save_state(m)
    if s.rigid:
        for j in range(pairs.row.size):
            look_ahead(
                0.5 * s.dt, m.ball[X, j], m.ball[RATE, j], pairs.constants[GAP_PLUS, j], pairs.constants[GAP_MINUS, j],
                m.touch[BUSY, j],
            )  # fmt: skip


@inlined
def _look_around(j: int, s: Scheme, fine: Fine, pairs: Pairs, m: Motion) -> int:
    """After a step without contact: rates of a pair, and in how many cases a contact could have taken place."""
    keep_rate(m.ball[RATE, j], m.ball[RATE_BEFORE, j], m.ball[Y_RATE, j], m.w_rate[pairs.row[j]])
    if fine.parts == 1:
        return 0
    return look_around(j, s.dt, m.ball, pairs.constants, m.touch)


@inlined
def _touch(
    looking: int, op: Operator, s: Scheme, fine: Fine | None, pairs: Pairs, m: Motion, record: Record, work: Array
) -> None:
    """Contact of the cases in reach of a wall, but for those that took fine steps and have had theirs.

    No more than `looking` pairs are.
    """
    time = (record.tally[0] + 1) * s.dt
    cases, skipped = m.q.shape[1], 0
    for c in range(cases):
        # packs without contact are passed over whole
        if c % WIDTH == 0 and cases > 1 and none_in_reach(c, pairs, m):
            skipped = c + WIDTH
        if c < skipped:
            continue
        reached = in_reach(c, pairs, m)
        if reached == 0:
            continue
        # the pairs of such a case are counted as they were before its fine steps
        if fine is not None and m.ledger[REFINED, c] > 0.0:
            continue
        looking -= reached
        contact_step(c, time, op, s, pairs, m, record, work)
        if looking <= 0:
            break


@compiled_long
def advance(
    steps: int, op: Operator, s: Scheme, fine: Fine | None, cases: Cases, ledger: bool, physical: bool | None
) -> None:
    """Take that many steps with every case; all results are written into the arrays given.

    Without `fine`, for a method that neither divides steps nor looks ahead, all that concerns it is
    left out when compiled; so is what concerns banded matrices unless the dofs are
    `physical`.
    """
    pairs, m, cycles, record = cases.pairs, cases.motion, cases.cycles, cases.record
    next_wrap = least(cycles.next_wrap)
    keeping = record.channels.shape[0] + record.fields.shape[0] > 0
    base, constants = m.drive[BASE], pairs.constants
    acting = m.drive[ACTING] if s.alpha_f != 0.0 else base
    parts = 1
    if fine is not None:
        parts = fine.parts
    sampled = m.table.shape[0] > 0
    if ledger and physical is None:
        for i in range(op.drive_load.size):
            m.scratch[0, i, 0] = 0.25 * s.dt * op.damping_band[0, i]
    for _ in range(steps):
        turn_drive(m.drive)
        if sampled:
            read_drive(m.table[parts * (record.tally[0] + 1)], base)
        if s.alpha_f != 0.0:
            blend_drive(s.alpha_f, base, m.drive[BASE_BEFORE], acting)
        if fine is not None:
            _look_ahead(s, fine, pairs, m)
        _free_step(op, s, m, acting, physical)
        if pairs.obstacles.size > 0:
            move_obstacles(parts * (record.tally[0] + 1), s, pairs, m)
        looking, refined = ZERO, 0
        for j in range(pairs.row.size):
            looking += free_step_ball(j, s, m.ball, constants, acting, m.w[pairs.row[j]], m.touch[BUSY, j])
            if fine is not None:
                looking += _look_around(j, s, fine, pairs, m)
        if looking > 0:
            if fine is not None:
                refined = _redo(s, fine, cases, ledger, physical)
            _touch(looking, op, s, fine, pairs, m, record, cases.pair_scratch)
        if ledger and (refined == 0 or base.size > 1):
            _write_ledger(op, s, pairs, m, physical)
        step = record.tally[0] + 1
        if step == next_wrap:
            split_cycles(step, s, m, cycles)
        if refined > 0:
            restore_refined_cases(m.ledger)
        observe(step, s, m, cycles)
        record.tally[0] = step
        if step == next_wrap:
            close_cycles(step, ledger, op, pairs, m, cycles, cases.energy_scratch)
            next_wrap = least(cycles.next_wrap)
        if keeping and any_due(step, record):
            keep(step, op, pairs, m, record, ledger)
