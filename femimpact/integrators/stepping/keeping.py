"""What the loop over steps keeps now and then: cycle statistics, samples and snapshots."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import SWITCHING_SPRING
from femimpact.integrators.compiled.compiling import ZERO, apart, called, inlined
from femimpact.integrators.stepping.layout import (
    COSINE,
    FORCE,
    NORMAL,
    PHASE,
    PHASE_STEP,
    SIDE,
    SINE,
    Y_RATE,
    Cycles,
    Motion,
    Operator,
    Pairs,
    Record,
    Y,
)
from femimpact.integrators.stepping.ledger import write_energy
from femimpact.response.columns import ENERGY_COLUMNS, MINIMUM

__all__ = ["any_due", "close_cycles", "keep", "least"]

LOSS_COLUMNS = len(ENERGY_COLUMNS)
"""Where the losses of the modes begin in a row of energies."""


@apart
def close_cycles(
    step: int, ledger: bool, op: Operator, pairs: Pairs, m: Motion, cycles: Cycles, energy: NDArray[np.float64]
) -> None:
    """Write the statistics of every case whose base cycle ends at this step, and start the next."""
    for c in range(cycles.number.size):
        if step != cycles.next_wrap[c]:
            continue
        k = cycles.number[c]
        begun = math.ceil(k * cycles.period[c])
        if k < cycles.values.shape[0]:
            # the extremes are there: a cycle ends within a step
            for i in range(MINIMUM + 1, cycles.sums.shape[0]):
                cycles.values[k, i, c] = cycles.sums[i, c]
            cycles.values[k, 5, c] = step - begun
            if ledger:
                write_energy(c, op, pairs, m, energy)
                for i in range(energy.size):
                    cycles.energy[k + 1, i, c] = energy[i]
        cycles.number[c] = k + 1
        cycles.next_wrap[c] = math.ceil((k + 2) * cycles.period[c])
        for i in range(MINIMUM + 1, cycles.sums.shape[0]):
            cycles.sums[i, c] = 0.0
        # the rotated phase is set right once a cycle, so that rounding cannot add up
        angle = m.drive[PHASE, c] + m.drive[PHASE_STEP, c] * step
        m.drive[SINE, c], m.drive[COSINE, c] = math.sin(angle), math.cos(angle)


@inlined
def _contact_force(j: int, pairs: Pairs, m: Motion) -> float:
    """Force (N) of a pair on the structure without its centring spring; the switching spring's is all of its law."""
    if pairs.kind[j] == SWITCHING_SPRING:
        return float(m.ball[FORCE, j, 0])
    return float(m.touch[SIDE, j, 0] * m.touch[NORMAL, j, 0])


@called
def _write_sample(op: Operator, pairs: Pairs, m: Motion, record: Record, ledger: bool) -> None:
    k = record.tally[1]
    for i in range(record.used.shape[0]):
        value = 0.0
        if record.used[i, 0]:
            for d in range(m.q.shape[0]):
                value += record.rows[i, 0, d] * m.q[d, 0]
        if record.used[i, 1]:
            for d in range(m.v.shape[0]):
                value += record.rows[i, 1, d] * m.v[d, 0]
        if record.used[i, 2]:
            for j in range(m.ball.shape[1]):
                value += record.pair_rows[i, 0, j] * m.ball[Y, j, 0] + record.pair_rows[i, 1, j] * m.ball[Y_RATE, j, 0]
        if record.used[i, 3]:
            for j in range(m.ball.shape[1]):
                value += record.pair_rows[i, 2, j] * m.ball[FORCE, j, 0]
                value += record.pair_rows[i, 3, j] * _contact_force(j, pairs, m)
        record.channels[k, i] = value
    if ledger:
        write_energy(ZERO, op, pairs, m, record.energy[k])
        for i in range(m.loss_of_mode.size):
            record.energy[k, LOSS_COLUMNS + i] = m.loss_of_mode[i]
    record.tally[1] = k + 1


@called
def _write_snapshot(pairs: Pairs, m: Motion, record: Record) -> None:
    k, n = record.tally[2], m.q.shape[0]
    for i in range(n):
        record.fields[k, 0, i] = m.q[i, 0]
        record.fields[k, 1, i] = m.v[i, 0]
    for j in range(m.ball.shape[1]):
        record.fields[k, 0, n + j] = m.ball[Y, j, 0]
        record.fields[k, 1, n + j] = m.ball[Y_RATE, j, 0]
        record.forces[k, j] = _contact_force(j, pairs, m)
    record.tally[2] = k + 1


@apart
def keep(step: int, op: Operator, pairs: Pairs, m: Motion, record: Record, ledger: bool) -> None:
    """Write the sample and the snapshot that are due at this step."""
    every, first, stride, first_field = record.stride
    if step >= first and (step - first) % every == 0 and record.tally[1] < record.channels.shape[0]:
        _write_sample(op, pairs, m, record, ledger)
    if step >= first_field and (step - first_field) % stride == 0 and record.tally[2] < record.fields.shape[0]:
        _write_snapshot(pairs, m, record)


@called
def least(values: NDArray[np.int64]) -> int:
    """Smallest of some numbers."""
    smallest: int = values[0]
    for value in values:
        smallest = min(smallest, value)
    return smallest


@called
def any_due(step: int, record: Record) -> bool:
    """Whether a sample or a snapshot falls on this step."""
    every, first, stride, first_field = record.stride
    sample: bool = record.channels.shape[0] > 0 and (step - first) % every == 0
    field: bool = record.fields.shape[0] > 0 and (step - first_field) % stride == 0
    return sample or field
