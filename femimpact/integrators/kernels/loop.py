"""The loop over steps, and what it keeps now and then."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import compiled
from femimpact.integrators.kernels.flight import (
    free_step_ball,
    free_step_banded,
    free_step_banded_single,
    free_step_diagonal,
    free_step_single,
    look,
    observe,
    read_row,
    turn_base,
)
from femimpact.integrators.kernels.ledger import (
    book_loss_banded,
    book_loss_diagonal,
    book_loss_single,
    book_work,
    book_work_on_ball,
    write_energy,
)
from femimpact.integrators.kernels.touch import contact_step
from femimpact.integrators.layout import (
    ACCELERATION,
    BASE,
    BASE_BEFORE,
    BUSY,
    COSINE,
    FORCE,
    GAP_MINUS,
    GAP_PLUS,
    LOAD,
    MASS,
    PHASE,
    PHASE_STEP,
    SINE,
    STRUCTURE_LOSS,
    WORK,
    X_BEFORE,
    Y_ACCELERATION,
    Y_BEFORE,
    Y_RATE,
    Cycles,
    Motion,
    Operator,
    Pairs,
    Record,
    Scheme,
    X,
    Y,
)


@compiled
def _close_cycles(
    step: int, ledger: bool, op: Operator, pairs: Pairs, m: Motion, cycles: Cycles, energy: NDArray[Any]
) -> None:
    """Write the statistics of every case whose base cycle ends at this step, and start the next."""
    for c in range(cycles.number.size):
        if step != cycles.next_wrap[c]:
            continue
        k = cycles.number[c]
        begun = math.ceil(k * cycles.period[c])
        if k < cycles.values.shape[0]:
            for i in range(cycles.sums.shape[0]):
                cycles.values[k, i, c] = cycles.sums[i, c]
            cycles.values[k, 5, c] = step - begun
            if ledger:
                write_energy(c, op, pairs, m, energy)
                for i in range(energy.size):
                    cycles.energy[k + 1, i, c] = energy[i]
        cycles.number[c] = k + 1
        cycles.next_wrap[c] = math.ceil((k + 2) * cycles.period[c])
        for i in range(cycles.sums.shape[0]):
            cycles.sums[i, c] = 0.0
        cycles.sums[0, c], cycles.sums[1, c] = -np.inf, np.inf
        # the rotated phase is set right once a cycle, so that rounding cannot add up
        angle = m.drive[PHASE, c] + m.drive[PHASE_STEP, c] * step
        m.drive[SINE, c], m.drive[COSINE, c] = math.sin(angle), math.cos(angle)


@compiled
def _write_sample(op: Operator, pairs: Pairs, m: Motion, record: Record, ledger: bool) -> None:
    k = record.tally[1]
    for i in range(record.kind.size):
        kind, index, value = record.kind[i], record.source[i], 0.0
        if kind == 0 or kind == 1:
            state = m.q if kind == 0 else m.v
            for d in range(state.shape[0]):
                value += record.rows[index, d] * state[d, 0]
        elif kind == 2:
            value = m.ball[Y, index, 0]
        elif kind == 3:
            value = m.ball[Y_RATE, index, 0]
        elif kind == 4:
            value = m.ball[X, index, 0]
        else:
            value = m.ball[FORCE, index, 0]
        record.channels[k, i] = value
    if ledger:
        write_energy(0, op, pairs, m, record.energy[k])
    record.tally[1] = k + 1


@compiled
def _write_snapshot(m: Motion, record: Record) -> None:
    k, n = record.tally[2], m.q.shape[0]
    for i in range(n):
        record.fields[k, 0, i] = m.q[i, 0]
        record.fields[k, 1, i] = m.v[i, 0]
    for j in range(m.ball.shape[1]):
        record.fields[k, 0, n + j] = m.ball[Y, j, 0]
        record.fields[k, 1, n + j] = m.ball[Y_RATE, j, 0]
        record.forces[k, j] = m.ball[FORCE, j, 0]
    record.tally[2] = k + 1


@compiled
def keep(step: int, op: Operator, pairs: Pairs, m: Motion, record: Record, ledger: bool) -> None:
    """Write the sample and the snapshot that are due at this step."""
    every, first, stride, first_field = record.stride
    if step >= first and (step - first) % every == 0 and record.tally[1] < record.channels.shape[0]:
        _write_sample(op, pairs, m, record, ledger)
    if step >= first_field and (step - first_field) % stride == 0 and record.tally[2] < record.fields.shape[0]:
        _write_snapshot(m, record)


@compiled
def _least(values: NDArray[Any]) -> int:
    least: int = values[0]
    for value in values:
        least = min(least, value)
    return least


@compiled
def _any_due(step: int, record: Record) -> bool:
    every, first, stride, first_field = record.stride
    sample: bool = record.channels.shape[0] > 0 and (step - first) % every == 0
    field: bool = record.fields.shape[0] > 0 and (step - first_field) % stride == 0
    return sample or field


@compiled
def advance(
    steps: int, op: Operator, s: Scheme, pairs: Pairs, m: Motion, cycles: Cycles, record: Record,
    ledger: bool, work: NDArray[Any], energy: NDArray[Any],
) -> None:  # fmt: skip
    """Take that many steps with every case; all results are written into the arrays given.

    `work` (5, pairs) and `energy` (columns,) are scratch space.
    """
    next_wrap = _least(cycles.next_wrap)
    keeping = record.channels.shape[0] + record.fields.shape[0] > 0
    base, w, w_rate, constants = m.drive[BASE], m.w, m.w_rate, pairs.constants
    single = w.shape[1] == 1
    if ledger and not op.banded:
        for i in range(op.base_load.size):
            m.scratch[0, i, 0] = 0.25 * s.dt * op.damping_band[0, i]
    for _ in range(steps):
        turn_base(m.drive)
        if op.banded:
            if single:
                free_step_banded_single(op, s, m.q[:, 0], m.v[:, 0], m.a[:, 0], base[0], m.scratch)
            else:
                free_step_banded(op, s, m)
            read_row(op.rows[0], m.q, m.v, w[0], w_rate[0])
        elif single:
            free_step_single(
                op.load, op.damping, op.stiffness, op.rows[0], s, m.q[:, 0], m.v[:, 0], m.a[:, 0], w[0], w_rate[0], base
            )
        else:
            free_step_diagonal(op.load, op.damping, op.stiffness, op.rows[0], s, m.q, m.v, m.a, w[0], w_rate[0], base)
        for r in range(1, w.shape[0]):
            read_row(op.rows[r], m.q, m.v, w[r], w_rate[r])
        looking = 0
        for j in range(pairs.row.size):
            free_step_ball(
                s, m.ball[Y, j], m.ball[Y_RATE, j], m.ball[Y_ACCELERATION, j], constants[ACCELERATION, j], base
            )
            looking += look(
                m.ball[X, j], m.ball[X_BEFORE, j], m.ball[Y, j], w[pairs.row[j]], constants[GAP_PLUS, j],
                constants[GAP_MINUS, j], m.touch[BUSY, j],
            )  # fmt: skip
        if looking > 0:
            for c in range(m.q.shape[1]):
                for j in range(pairs.row.size):
                    x = m.ball[X, j, c]
                    outside = x > constants[GAP_PLUS, j, c] or x < -constants[GAP_MINUS, j, c]
                    if outside or m.touch[BUSY, j, c] > 0.0:
                        contact_step(c, op, s, pairs, m, record, work)
                        break
        if ledger:
            if op.banded:
                book_loss_banded(op, s, m)
            elif single:
                book_loss_single(
                    m.scratch[0, :, 0], op.base_load, m.q[:, 0], m.v[:, 0], m.v_before[:, 0],
                    m.ledger[STRUCTURE_LOSS], m.ledger[LOAD],
                )  # fmt: skip
            else:
                book_loss_diagonal(
                    m.scratch[0, :, 0], op.base_load, m.q, m.v, m.v_before, m.ledger[STRUCTURE_LOSS], m.ledger[LOAD]
                )
            book_work(base, m.drive[BASE_BEFORE], m.ledger)
            for j in range(pairs.row.size):
                book_work_on_ball(
                    base, m.drive[BASE_BEFORE], constants[MASS, j], constants[ACCELERATION, j], m.ball[Y, j],
                    m.ball[Y_BEFORE, j], m.ledger[WORK],
                )  # fmt: skip
            for c in range(base.size):
                m.drive[BASE_BEFORE, c] = base[c]
        observe(w[0], m.drive, cycles.sums)
        step = record.tally[0] + 1
        record.tally[0] = step
        if step == next_wrap:
            _close_cycles(step, ledger, op, pairs, m, cycles, energy)
            next_wrap = _least(cycles.next_wrap)
        if keeping and _any_due(step, record):
            keep(step, op, pairs, m, record, ledger)
