"""Energies of a case, and what a step adds to work and losses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import called, inlined
from femimpact.integrators.compiled.laws import (
    SWITCHING_SPRING,
    elastic_potential,
    penetration,
    spring_potential,
    switching_potential,
)
from femimpact.integrators.stepping.free_step import add, add_product
from femimpact.integrators.stepping.layout import (
    ACCELERATION,
    APPROACH,
    CONTACT_LOSS,
    EXPONENT,
    FREE_STIFFNESS,
    GAP_MINUS,
    GAP_PLUS,
    HELD,
    LOAD,
    LOAD_BEFORE,
    MASS,
    OWN_LOSS,
    OWN_WORK,
    REFINED,
    SHARE,
    STIFFNESS,
    STRUCTURE_LOSS,
    WORK,
    Y_BEFORE,
    Y_RATE,
    Motion,
    Operator,
    Pairs,
    Scheme,
    X,
    Y,
)

Array = NDArray[np.float64]


@inlined
def add_loss_diagonal(
    scale: Array, weight: Array, q: Array, v: Array, v_before: Array, loss: Array, load: Array
) -> None:
    """Add dt c ((v0 + v1)/2)^2 of every mode to the loss, and sum load @ q; scale is dt c/4."""
    n, cases = q.shape
    for i in range(n):
        sc, we, qi, vi, before = scale[i], weight[i], q[i], v[i], v_before[i]
        for c in range(cases):
            twice = vi[c] + before[c]
            before[c] = vi[c]
            loss[c] += sc * twice * twice
        for c in range(cases):
            load[c] += we * qi[c]


@inlined
def add_loss_single(scale: Array, weight: Array, q: Array, v: Array, v_before: Array, loss_of_mode: Array) -> float:
    """The same of one case alone, mode by mode; returns load @ q."""
    total = 0.0
    for i in range(q.size):
        twice = v[i] + v_before[i]
        v_before[i] = v[i]
        loss_of_mode[i] += scale[i] * twice * twice
        total += weight[i] * q[i]
    return total


@called
def add_loss_banded(op: Operator, s: Scheme, m: Motion) -> None:
    """The same in physical dofs: dt vbar^T C vbar with vbar the mean of both velocities."""
    n, cases = m.q.shape
    load, loss = m.ledger[LOAD], m.ledger[STRUCTURE_LOSS]
    for i in range(n):
        add(load, op.drive_load[i], m.q[i])
        add(m.v_before[i], 1.0, m.v[i])
    for i in range(n):
        add_product(loss, 0.25 * s.dt * op.damping_band[0, i], m.v_before[i], m.v_before[i])
        for k in range(1, min(op.damping_band.shape[0], n - i)):
            add_product(loss, 0.5 * s.dt * op.damping_band[k, i], m.v_before[i], m.v_before[i + k])
    for i in range(n):
        for c in range(cases):
            m.v_before[i, c] = m.v[i, c]


@inlined
def add_work(base: Array, base_before: Array, ledger: Array) -> None:
    """Work of the drive on the structure over one step, by the trapezoidal rule.

    With the loss above it is the exact balance of the linear part for beta = 1/4, gamma = 1/2.
    """
    work, load, load_before = ledger[WORK], ledger[LOAD], ledger[LOAD_BEFORE]
    for c in range(work.size):
        work[c] += 0.5 * (base[c] + base_before[c]) * (load[c] - load_before[c])
        load_before[c] = load[c]
    for c in range(work.size):
        load[c] = 0.0


@inlined
def add_work_on_ball(
    base: Array, base_before: Array, share: float, mass: Array, given: Array, y: Array, y_before: Array, work: Array
) -> None:
    """Work of inertia and of the constant acceleration on one ball over one step."""
    for c in range(work.size):
        acting = given[c] - share * (0.5 * (base[c] + base_before[c]))
        work[c] += mass[c] * acting * (y[c] - y_before[c])
        y_before[c] = y[c]


@called
def write_ledger_of_case(c: int, base: float, before: float, op: Operator, s: Scheme, pairs: Pairs, m: Motion) -> None:
    """All of the above for one case and one of its fine steps."""
    n, load, loss = m.q.shape[0], 0.0, 0.0
    for i in range(n):
        load += op.drive_load[i] * m.q[i, c]
        m.v_before[i, c] += m.v[i, c]
    for i in range(n):
        lost = 0.25 * s.dt * op.damping_band[0, i] * m.v_before[i, c] * m.v_before[i, c]
        if m.loss_of_mode.size > 0:
            m.loss_of_mode[i] += lost
        else:
            loss += lost
        for k in range(1, min(op.damping_band.shape[0], n - i)):
            loss += 0.5 * s.dt * op.damping_band[k, i] * m.v_before[i, c] * m.v_before[i + k, c]
    for i in range(n):
        m.v_before[i, c] = m.v[i, c]
    m.ledger[STRUCTURE_LOSS, c] += loss
    acting = 0.5 * (base + before)
    m.ledger[WORK, c] += acting * (load - m.ledger[LOAD_BEFORE, c])
    m.ledger[LOAD_BEFORE, c] = load
    for j in range(pairs.row.size):
        constants = pairs.constants
        pull = constants[ACCELERATION, j, c] - constants[SHARE, j, c] * acting
        m.ledger[WORK, c] += constants[MASS, j, c] * pull * (m.ball[Y, j, c] - m.ball[Y_BEFORE, j, c])
        m.ball[Y_BEFORE, j, c] = m.ball[Y, j, c]


@inlined
def restore_refined_cases(ledger: Array) -> None:
    """Put back the sums of the cases that took the step in fine ones."""
    for c in range(ledger.shape[1]):
        if ledger[REFINED, c] > 0.0:
            ledger[REFINED, c] = 0.0
            ledger[WORK, c], ledger[STRUCTURE_LOSS, c] = ledger[OWN_WORK, c], ledger[OWN_LOSS, c]


@called
def _quadratic(band: Array, values: Array, c: int) -> float:
    """x^T A x of a symmetric matrix kept by its lower bands."""
    total = 0.0
    n = values.shape[0]
    for i in range(n):
        total += band[0, i] * values[i, c] * values[i, c]
        for k in range(1, min(band.shape[0], n - i)):
            total += 2.0 * band[k, i] * values[i, c] * values[i + k, c]
    return total


@called
def write_energy(c: int, op: Operator, pairs: Pairs, m: Motion, out: Array) -> None:
    """Energies of one case at the present step, in the order of ENERGY_COLUMNS."""
    constants = pairs.constants
    out[0] = 0.5 * _quadratic(op.mass_band, m.v, c)
    out[1] = 0.5 * _quadratic(op.stiffness_band, m.q, c)
    out[2] = out[3] = 0.0
    for j in range(pairs.row.size):
        out[2] += 0.5 * constants[MASS, j, c] * m.ball[Y_RATE, j, c] * m.ball[Y_RATE, j, c]
        x, spring, stiffness = m.ball[X, j, c], constants[FREE_STIFFNESS, j, c], constants[STIFFNESS, j, c]
        gap_plus, gap_minus = constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c]
        if pairs.kind[j] == SWITCHING_SPRING:
            out[3] += switching_potential(x, gap_plus, gap_minus, spring, stiffness)
        else:
            out[3] += spring_potential(x, spring)
            out[3] += elastic_potential(
                pairs.kind[j], penetration(x, gap_plus, gap_minus)[0], stiffness, constants[EXPONENT, j, c],
                m.touch[APPROACH, j, c], pairs.address[j],
            )  # fmt: skip
    loss = m.ledger[STRUCTURE_LOSS, c]
    for i in range(m.loss_of_mode.size):
        loss += m.loss_of_mode[i]
    out[4], out[5], out[6] = m.ledger[WORK, c], loss, m.ledger[CONTACT_LOSS, c]
    if op.constant_load.size > 0:
        # a constant load has a potential: no sum over steps
        held = 0.0
        for i in range(op.constant_load.size):
            held += op.constant_load[i] * m.q[i, c]
        out[4] += held - m.ledger[HELD, c]
