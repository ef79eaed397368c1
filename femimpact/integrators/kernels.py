"""The compiled time loop of the Newmark family: arrays and numbers only.

Cases run side by side: every state array carries the case axis last and the innermost loops run
over cases, so that the compiler puts them in SIMD lanes. Contact is rare and scalar: one equation
per pair, solved only in the cases that touch. No fastmath: a case gets the same bits whatever runs
beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

from femimpact import contact

__all__ = [
    "CYCLE_COLUMNS",
    "ENERGY_COLUMNS",
    "IMPACT_COLUMNS",
    "TOTAL_COLUMNS",
    "Cycles",
    "Motion",
    "Operator",
    "Pairs",
    "Record",
    "Scheme",
    "advance",
    "collide",
]

# _nrt=False: nothing here allocates, and counting references to array slices would cost ten times the arithmetic
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function of arrays and numbers."""
    return cast(Function, njit(**OPTIONS)(function))


def inlined(function: Function) -> Function:
    """Compile a function that is called from one place: a call would copy every array's descriptor."""
    return cast(Function, njit(forceinline=True, **OPTIONS)(function))


# a contact law's formula stands in `contact`; here it is only compiled
_penetration = inlined(contact.penetration)
_kelvin_voigt_force = inlined(contact.kelvin_voigt_force)
_spring_potential = compiled(contact.spring_potential)
_switching_stiffness = inlined(contact.switching_stiffness)
_switching_potential = compiled(contact.switching_potential)
SWITCHING_SPRING = contact.SWITCHING_SPRING

PAIR_ITERATIONS = 200
PAIR_TOLERANCE = 1e-15
"""Gauss-Seidel over pairs that share a structure stops at this change, relative to the largest force."""

CYCLE_COLUMNS = ("maximum", "minimum", "square", "sine", "cosine", "samples")
ENERGY_COLUMNS = ("kinetic", "strain", "ball", "contact", "work", "structure_loss", "contact_loss")
IMPACT_COLUMNS = (
    "time", "pair", "side", "approach_speed", "rebound_speed", "impulse", "peak_force", "duration", "energy_loss",
)  # fmt: skip
TOTAL_COLUMNS = ("count", "approach_speed", "approach_speed_max", "impulse", "peak_force")

# rows of Motion.ball (., pairs, cases); y and x = y - w are relative to the base, FORCE acts on the structure
Y, Y_RATE, Y_ACCELERATION, X, X_BEFORE, FORCE, Y_BEFORE = range(7)
# rows of Motion.drive (., cases); SCALE is -amplitude omega^2, BASE the base acceleration
SINE, COSINE, TURN_SINE, TURN_COSINE, PHASE, PHASE_STEP, SCALE, BASE, BASE_BEFORE = range(9)
# rows of Motion.ledger (., cases)
WORK, STRUCTURE_LOSS, CONTACT_LOSS, LOAD, LOAD_BEFORE = range(5)
# rows of Pairs.constants (., pairs, cases)
MASS, GAP_PLUS, GAP_MINUS, STIFFNESS, DAMPING, FREE_STIFFNESS, ACCELERATION = range(7)
# rows of Motion.touch (., pairs, cases); BUSY: the pair must be looked at in every step
BUSY, OPEN, SIDE, START, APPROACH, IMPULSE, PEAK, DURATION, LOSS, NORMAL, DISSIPATIVE = range(11)


class Scheme(NamedTuple):
    """Newmark's constants for one step size."""

    dt: float
    predict_u: float  # dt^2 (1/2 - beta)
    predict_v: float  # dt (1 - gamma)
    correct_u: float  # dt^2 beta
    correct_v: float  # dt gamma


class Operator(NamedTuple):
    """The structure, ready for a step: S = M + gamma dt C + beta dt^2 K, factorised once."""

    banded: bool
    load: NDArray[Any]  # (n,) -base_load; diagonal systems: already divided by S
    damping: NDArray[Any]  # (n,) C/S of a diagonal system
    stiffness: NDArray[Any]  # (n,) K/S of a diagonal system
    mass_band: NDArray[Any]  # (k + 1, n) lower bands; a diagonal system has one
    damping_band: NDArray[Any]
    stiffness_band: NDArray[Any]
    cholesky_band: NDArray[Any]  # (k + 1, n) lower bands of L, S = L L^T, diagonal inverted
    base_load: NDArray[Any]  # (n,)
    rows: NDArray[Any]  # (rows, n) places read every step: the observed one first
    response: NDArray[Any]  # (pairs, n) S^-1 b_j
    compliance: NDArray[Any]  # (rows, pairs) row_i S^-1 b_j


class Pairs(NamedTuple):
    """Contact pairs: the row of `Operator.rows` that each reads, its law, its numbers."""

    row: NDArray[Any]  # (pairs,)
    kind: NDArray[Any]  # (pairs,)
    constants: NDArray[Any]  # (7, pairs, cases)


class Motion(NamedTuple):
    """State at the present step; the case axis last."""

    q: NDArray[Any]  # (n, cases)
    v: NDArray[Any]
    a: NDArray[Any]
    w: NDArray[Any]  # (rows, cases)
    w_rate: NDArray[Any]
    ball: NDArray[Any]  # (7, pairs, cases)
    touch: NDArray[Any]  # (11, pairs, cases)
    totals: NDArray[Any]  # (columns, pairs, cases), impacts that end within the window
    window: NDArray[Any]  # (2, cases) first step, and the step after the last
    drive: NDArray[Any]  # (9, cases)
    ledger: NDArray[Any]  # (5, cases)
    v_before: NDArray[Any]  # (n, cases)
    scratch: NDArray[Any]  # (3, n, cases)


class Cycles(NamedTuple):
    """Statistics per base cycle; the state before the first step is row 0 of `energy`."""

    next_wrap: NDArray[Any]  # (cases,) step
    number: NDArray[Any]  # (cases,) cycles finished
    period: NDArray[Any]  # (cases,) steps per cycle, a real number
    sums: NDArray[Any]  # (columns, cases)
    values: NDArray[Any]  # (cycles, columns, cases)
    energy: NDArray[Any]  # (cycles + 1, columns, cases)


class Record(NamedTuple):
    """What case 0 keeps."""

    kind: NDArray[Any]  # (channels,)
    source: NDArray[Any]  # (channels,) row or pair
    rows: NDArray[Any]  # (rows, n)
    channels: NDArray[Any]  # (samples, channels)
    energy: NDArray[Any]  # (samples, columns)
    fields: NDArray[Any]  # (snapshots, 2, n + pairs)
    forces: NDArray[Any]  # (snapshots, pairs)
    impacts: NDArray[Any]  # (most, columns)
    stride: NDArray[Any]  # (4,): every, first sample, snapshot stride, first snapshot
    tally: NDArray[Any]  # (4,): step, samples, snapshots, impacts met


# ---- every step: arrays only, inner loops over cases ----------------------------------------------
# A loop over cases goes into SIMD lanes only while the compiler can check its few arrays against overlap:
# three written and two read are too many already, so some loops below are split in two.


@compiled
def _turn_base(drive: NDArray[Any]) -> None:
    """Base acceleration at the next step, by rotating the phase: no trigonometric call per step."""
    sine, cosine, turn_sine, turn_cosine = drive[SINE], drive[COSINE], drive[TURN_SINE], drive[TURN_COSINE]
    base, scale = drive[BASE], drive[SCALE]
    for c in range(sine.size):
        turned = sine[c] * turn_cosine[c] + cosine[c] * turn_sine[c]
        cosine[c] = cosine[c] * turn_cosine[c] - sine[c] * turn_sine[c]
        sine[c] = turned
    for c in range(sine.size):
        base[c] = scale[c] * sine[c]


@compiled
def _free_step_diagonal(
    load: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any], s: Scheme,
    q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any], base: NDArray[Any],
) -> None:  # fmt: skip
    """One step of every mode without contact force, and the first place that is read every step."""
    n, cases = q.shape
    dt, pu, pv, cu, cv = s.dt, s.predict_u, s.predict_v, s.correct_u, s.correct_v
    for c in range(cases):
        w[c] = 0.0
        w_rate[c] = 0.0
    for i in range(n):
        g, d, k, r = load[i], damping[i], stiffness[i], row[i]
        qi, vi, ai = q[i], v[i], a[i]
        for c in range(cases):
            u_predicted = qi[c] + dt * vi[c] + pu * ai[c]
            v_predicted = vi[c] + pv * ai[c]
            acceleration = g * base[c] - (d * v_predicted + k * u_predicted)
            u_new = u_predicted + cu * acceleration
            v_new = v_predicted + cv * acceleration
            ai[c] = acceleration
            qi[c] = u_new
            vi[c] = v_new
            w[c] += r * u_new
            w_rate[c] += r * v_new


@compiled
def _free_step_single(
    load: NDArray[Any], damping: NDArray[Any], stiffness: NDArray[Any], row: NDArray[Any], s: Scheme,
    q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any], base: NDArray[Any],
) -> None:  # fmt: skip
    """The same step, operation by operation, of one case alone: sums stay in registers."""
    acting, total, total_rate = base[0], 0.0, 0.0
    for i in range(q.size):
        u_predicted = q[i] + s.dt * v[i] + s.predict_u * a[i]
        v_predicted = v[i] + s.predict_v * a[i]
        acceleration = load[i] * acting - (damping[i] * v_predicted + stiffness[i] * u_predicted)
        q[i] = u_predicted + s.correct_u * acceleration
        v[i] = v_predicted + s.correct_v * acceleration
        a[i] = acceleration
        total += row[i] * q[i]
        total_rate += row[i] * v[i]
    w[0] = total
    w_rate[0] = total_rate


@compiled
def _read_row(row: NDArray[Any], q: NDArray[Any], v: NDArray[Any], w: NDArray[Any], w_rate: NDArray[Any]) -> None:
    """Displacement and velocity of one place: a row over the dofs."""
    for c in range(w.size):
        w[c] = 0.0
        w_rate[c] = 0.0
    for i in range(row.size):
        if row[i] != 0.0:
            _add(w, row[i], q[i])
            _add(w_rate, row[i], v[i])


@compiled
def _add(target: NDArray[Any], scale: float, values: NDArray[Any]) -> None:
    for c in range(target.size):
        target[c] += scale * values[c]


@compiled
def _add_product(target: NDArray[Any], scale: float, f: NDArray[Any], g: NDArray[Any]) -> None:
    for c in range(target.size):
        target[c] += scale * f[c] * g[c]


@compiled
def _scale(target: NDArray[Any], scale: float) -> None:
    for c in range(target.size):
        target[c] *= scale


@compiled
def _free_step_banded(op: Operator, s: Scheme, m: Motion) -> None:
    """The step in physical dofs: banded right-hand side, forward and back substitution."""
    n, cases = m.q.shape
    rhs, u_predicted, v_predicted = m.scratch[0], m.scratch[1], m.scratch[2]
    base = m.drive[BASE]
    for i in range(n):
        load, q, v, a = op.load[i], m.q[i], m.v[i], m.a[i]
        u_i, v_i, rhs_i = u_predicted[i], v_predicted[i], rhs[i]
        for c in range(cases):
            u_i[c] = q[c] + s.dt * v[c] + s.predict_u * a[c]
            v_i[c] = v[c] + s.predict_v * a[c]
            rhs_i[c] = load * base[c]
    for i in range(n):
        _add(rhs[i], -op.damping_band[0, i], v_predicted[i])
        _add(rhs[i], -op.stiffness_band[0, i], u_predicted[i])
        for k in range(1, min(op.stiffness_band.shape[0], n - i)):
            _add(rhs[i], -op.damping_band[k, i], v_predicted[i + k])
            _add(rhs[i], -op.stiffness_band[k, i], u_predicted[i + k])
            _add(rhs[i + k], -op.damping_band[k, i], v_predicted[i])
            _add(rhs[i + k], -op.stiffness_band[k, i], u_predicted[i])
    _solve_banded(op.cholesky_band, rhs)
    for i in range(n):
        q, v, a, u_i, v_i, rhs_i = m.q[i], m.v[i], m.a[i], u_predicted[i], v_predicted[i], rhs[i]
        for c in range(cases):
            a[c] = rhs_i[c]
            q[c] = u_i[c] + s.correct_u * rhs_i[c]
            v[c] = v_i[c] + s.correct_v * rhs_i[c]


@compiled
def _free_step_banded_single(
    op: Operator, s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], base: float, scratch: NDArray[Any]
) -> None:
    """The same step of one case alone."""
    n, bands, lower = q.size, op.cholesky_band.shape[0], op.cholesky_band
    rhs, u_predicted, v_predicted = scratch[0, :, 0], scratch[1, :, 0], scratch[2, :, 0]
    for i in range(n):
        u_predicted[i] = q[i] + s.dt * v[i] + s.predict_u * a[i]
        v_predicted[i] = v[i] + s.predict_v * a[i]
        rhs[i] = op.load[i] * base - op.damping_band[0, i] * v_predicted[i] - op.stiffness_band[0, i] * u_predicted[i]
    for k in range(1, bands):
        damping, stiffness = op.damping_band[k], op.stiffness_band[k]
        for i in range(n - k):
            rhs[i] -= damping[i] * v_predicted[i + k] + stiffness[i] * u_predicted[i + k]
        for i in range(n - k):
            rhs[i + k] -= damping[i] * v_predicted[i] + stiffness[i] * u_predicted[i]
    for i in range(n):
        value = rhs[i]
        for k in range(1, min(bands, i + 1)):
            value -= lower[k, i - k] * rhs[i - k]
        rhs[i] = value * lower[0, i]
    for i in range(n - 1, -1, -1):
        value = rhs[i]
        for k in range(1, min(bands, n - i)):
            value -= lower[k, i] * rhs[i + k]
        rhs[i] = value * lower[0, i]
    for i in range(n):
        a[i] = rhs[i]
        q[i] = u_predicted[i] + s.correct_u * rhs[i]
        v[i] = v_predicted[i] + s.correct_v * rhs[i]


@compiled
def _solve_banded(lower: NDArray[Any], rhs: NDArray[Any]) -> None:
    """Solve L L^T x = rhs in place; L by its lower bands with the reciprocal of its diagonal in row 0."""
    bands, n = lower.shape
    for i in range(n):
        for k in range(1, min(bands, i + 1)):
            _add(rhs[i], -lower[k, i - k], rhs[i - k])
        _scale(rhs[i], lower[0, i])
    for i in range(n - 1, -1, -1):
        for k in range(1, min(bands, n - i)):
            _add(rhs[i], -lower[k, i], rhs[i + k])
        _scale(rhs[i], lower[0, i])


@compiled
def _free_step_ball(
    s: Scheme, y: NDArray[Any], y_rate: NDArray[Any], y_acceleration: NDArray[Any], given: NDArray[Any],
    base: NDArray[Any],
) -> None:  # fmt: skip
    """One step of a ball in free flight."""
    for c in range(y.size):
        y[c] += s.dt * y_rate[c] + s.predict_u * y_acceleration[c]
        y_rate[c] += s.predict_v * y_acceleration[c]
    for c in range(y.size):
        y_acceleration[c] = given[c] - base[c]
    for c in range(y.size):
        y[c] += s.correct_u * y_acceleration[c]
        y_rate[c] += s.correct_v * y_acceleration[c]


@compiled
def _look(
    x: NDArray[Any], x_before: NDArray[Any], y: NDArray[Any], w: NDArray[Any], gap_plus: NDArray[Any],
    gap_minus: NDArray[Any], busy: NDArray[Any],
) -> int:  # fmt: skip
    """Relative displacement of a ball, and in how many cases its contact must be looked at."""
    for c in range(x.size):
        x_before[c] = x[c]
        x[c] = y[c] - w[c]
    looking = 0
    for c in range(x.size):
        looking += (x[c] > gap_plus[c]) | (x[c] < -gap_minus[c]) | (busy[c] > 0.0)
    return looking


@compiled
def _observe(w: NDArray[Any], drive: NDArray[Any], sums: NDArray[Any]) -> None:
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


@compiled
def _book_loss_diagonal(
    scale: NDArray[Any], weight: NDArray[Any], q: NDArray[Any], v: NDArray[Any], v_before: NDArray[Any],
    loss: NDArray[Any], load: NDArray[Any],
) -> None:  # fmt: skip
    """Add dt c ((v0 + v1)/2)^2 of every mode to the loss, and sum base_load @ q; scale is dt c/4."""
    n, cases = q.shape
    for i in range(n):
        sc, we, qi, vi, before = scale[i], weight[i], q[i], v[i], v_before[i]
        for c in range(cases):
            twice = vi[c] + before[c]
            before[c] = vi[c]
            loss[c] += sc * twice * twice
        for c in range(cases):
            load[c] += we * qi[c]


@compiled
def _book_loss_single(
    scale: NDArray[Any], weight: NDArray[Any], q: NDArray[Any], v: NDArray[Any], v_before: NDArray[Any],
    loss: NDArray[Any], load: NDArray[Any],
) -> None:  # fmt: skip
    """The same, operation by operation, of one case alone."""
    lost, total = loss[0], load[0]
    for i in range(q.size):
        twice = v[i] + v_before[i]
        v_before[i] = v[i]
        lost += scale[i] * twice * twice
        total += weight[i] * q[i]
    loss[0], load[0] = lost, total


@compiled
def _book_loss_banded(op: Operator, s: Scheme, m: Motion) -> None:
    """The same in physical dofs: dt vbar^T C vbar with vbar the mean of both velocities."""
    n, cases = m.q.shape
    load, loss = m.ledger[LOAD], m.ledger[STRUCTURE_LOSS]
    for i in range(n):
        _add(load, op.base_load[i], m.q[i])
        _add(m.v_before[i], 1.0, m.v[i])
    for i in range(n):
        _add_product(loss, 0.25 * s.dt * op.damping_band[0, i], m.v_before[i], m.v_before[i])
        for k in range(1, min(op.damping_band.shape[0], n - i)):
            _add_product(loss, 0.5 * s.dt * op.damping_band[k, i], m.v_before[i], m.v_before[i + k])
    for i in range(n):
        for c in range(cases):
            m.v_before[i, c] = m.v[i, c]


@compiled
def _book_work(base: NDArray[Any], base_before: NDArray[Any], ledger: NDArray[Any]) -> None:
    """Work of the inertia forces on the structure over one step, by the trapezoidal rule.

    With the loss above it is the exact balance of the linear part for beta = 1/4, gamma = 1/2.
    """
    work, load, load_before = ledger[WORK], ledger[LOAD], ledger[LOAD_BEFORE]
    for c in range(work.size):
        work[c] -= 0.5 * (base[c] + base_before[c]) * (load[c] - load_before[c])
        load_before[c] = load[c]
    for c in range(work.size):
        load[c] = 0.0


@compiled
def _book_work_on_ball(
    base: NDArray[Any], base_before: NDArray[Any], mass: NDArray[Any], given: NDArray[Any], y: NDArray[Any],
    y_before: NDArray[Any], work: NDArray[Any],
) -> None:  # fmt: skip
    """Work of inertia and of the constant acceleration on one ball over one step."""
    for c in range(work.size):
        work[c] += mass[c] * (given[c] - 0.5 * (base[c] + base_before[c])) * (y[c] - y_before[c])
        y_before[c] = y[c]


# ---- contact: rare, one case at a time ------------------------------------------------------------


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
        spring = _switching_stiffness(x_before, plus, minus, spring, stiffness)
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
        normal = _kelvin_voigt_force(depth, gate * rate, stiffness, damping) / yielding
    x -= soften * give_u * gate * normal
    return gate * normal + spring * x, normal


@inlined
def _contact_step(c: int, op: Operator, s: Scheme, pairs: Pairs, m: Motion, record: Record, work: NDArray[Any]) -> None:
    """Contact forces of one case, their effect on its state, and the bookkeeping of its impacts."""
    count = pairs.row.size
    x_free, rate_free, gate, force, normal = work[0], work[1], work[2], work[3], work[4]
    for j in range(count):
        x_free[j] = m.ball[Y, j, c] - m.w[pairs.row[j], c]
        rate_free[j] = m.ball[Y_RATE, j, c] - m.w_rate[pairs.row[j], c]
        # gated on the penetration without contact force, never inside the iteration
        gate[j] = _penetration(x_free[j], pairs.constants[GAP_PLUS, j, c], pairs.constants[GAP_MINUS, j, c])[1]
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
    depth, side = _penetration(x, constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c])
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
    touch[IMPULSE, j, c] += 0.5 * dt * (touch[NORMAL, j, c] + normal)
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
        totals[4, j, c] = max(totals[4, j, c], touch[PEAK, j, c])
    if c == 0:
        k = record.tally[3]
        if k < record.impacts.shape[0]:
            row = record.impacts[k]
            row[0], row[1], row[2] = touch[START, j, c], j, touch[SIDE, j, c]
            row[3], row[4] = touch[APPROACH, j, c], -touch[SIDE, j, c] * rate
            row[5], row[6] = touch[IMPULSE, j, c], touch[PEAK, j, c]
            row[7], row[8] = touch[DURATION, j, c], touch[LOSS, j, c]
        record.tally[3] += 1


# ---- now and then: cycles, samples, energies ------------------------------------------------------


@compiled
def _quadratic(band: NDArray[Any], values: NDArray[Any], c: int) -> float:
    """x^T A x of a symmetric matrix kept by its lower bands."""
    total = 0.0
    n = values.shape[0]
    for i in range(n):
        total += band[0, i] * values[i, c] * values[i, c]
        for k in range(1, min(band.shape[0], n - i)):
            total += 2.0 * band[k, i] * values[i, c] * values[i + k, c]
    return total


@compiled
def write_energy(c: int, op: Operator, pairs: Pairs, m: Motion, out: NDArray[Any]) -> None:
    """Energies of one case at the present step, in the order of ENERGY_COLUMNS."""
    constants = pairs.constants
    out[0] = 0.5 * _quadratic(op.mass_band, m.v, c)
    out[1] = 0.5 * _quadratic(op.stiffness_band, m.q, c)
    out[2] = out[3] = 0.0
    for j in range(pairs.row.size):
        out[2] += 0.5 * constants[MASS, j, c] * m.ball[Y_RATE, j, c] * m.ball[Y_RATE, j, c]
        x, spring, stiffness = m.ball[X, j, c], constants[FREE_STIFFNESS, j, c], constants[STIFFNESS, j, c]
        plus, minus = constants[GAP_PLUS, j, c], constants[GAP_MINUS, j, c]
        if pairs.kind[j] == SWITCHING_SPRING:
            out[3] += _switching_potential(x, plus, minus, spring, stiffness)
        else:
            out[3] += _spring_potential(x, spring)
            out[3] += _spring_potential(_penetration(x, plus, minus)[0], stiffness)
    out[4], out[5], out[6] = m.ledger[WORK, c], m.ledger[STRUCTURE_LOSS, c], m.ledger[CONTACT_LOSS, c]


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
        _turn_base(m.drive)
        if op.banded:
            if single:
                _free_step_banded_single(op, s, m.q[:, 0], m.v[:, 0], m.a[:, 0], base[0], m.scratch)
            else:
                _free_step_banded(op, s, m)
            _read_row(op.rows[0], m.q, m.v, w[0], w_rate[0])
        elif single:
            _free_step_single(
                op.load, op.damping, op.stiffness, op.rows[0], s, m.q[:, 0], m.v[:, 0], m.a[:, 0], w[0], w_rate[0], base
            )
        else:
            _free_step_diagonal(op.load, op.damping, op.stiffness, op.rows[0], s, m.q, m.v, m.a, w[0], w_rate[0], base)
        for r in range(1, w.shape[0]):
            _read_row(op.rows[r], m.q, m.v, w[r], w_rate[r])
        looking = 0
        for j in range(pairs.row.size):
            _free_step_ball(
                s, m.ball[Y, j], m.ball[Y_RATE, j], m.ball[Y_ACCELERATION, j], constants[ACCELERATION, j], base
            )
            looking += _look(
                m.ball[X, j], m.ball[X_BEFORE, j], m.ball[Y, j], w[pairs.row[j]], constants[GAP_PLUS, j],
                constants[GAP_MINUS, j], m.touch[BUSY, j],
            )  # fmt: skip
        if looking > 0:
            for c in range(m.q.shape[1]):
                for j in range(pairs.row.size):
                    x = m.ball[X, j, c]
                    outside = x > constants[GAP_PLUS, j, c] or x < -constants[GAP_MINUS, j, c]
                    if outside or m.touch[BUSY, j, c] > 0.0:
                        _contact_step(c, op, s, pairs, m, record, work)
                        break
        if ledger:
            if op.banded:
                _book_loss_banded(op, s, m)
            elif single:
                _book_loss_single(
                    m.scratch[0, :, 0], op.base_load, m.q[:, 0], m.v[:, 0], m.v_before[:, 0],
                    m.ledger[STRUCTURE_LOSS], m.ledger[LOAD],
                )  # fmt: skip
            else:
                _book_loss_diagonal(
                    m.scratch[0, :, 0], op.base_load, m.q, m.v, m.v_before, m.ledger[STRUCTURE_LOSS], m.ledger[LOAD]
                )
            _book_work(base, m.drive[BASE_BEFORE], m.ledger)
            for j in range(pairs.row.size):
                _book_work_on_ball(
                    base, m.drive[BASE_BEFORE], constants[MASS, j], constants[ACCELERATION, j], m.ball[Y, j],
                    m.ball[Y_BEFORE, j], m.ledger[WORK],
                )  # fmt: skip
            for c in range(base.size):
                m.drive[BASE_BEFORE, c] = base[c]
        _observe(w[0], m.drive, cycles.sums)
        step = record.tally[0] + 1
        record.tally[0] = step
        if step == next_wrap:
            _close_cycles(step, ledger, op, pairs, m, cycles, energy)
            next_wrap = _least(cycles.next_wrap)
        if keeping and _any_due(step, record):
            keep(step, op, pairs, m, record, ledger)


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
        depth = _penetration(x_free, 0.0, np.inf)[0]
        force = 0.0
        if kind == SWITCHING_SPRING:
            if x > 0.0:
                force = stiffness * x_free / (1.0 + stiffness * s.correct_u / mass)
        elif depth > 0.0:
            yielding = 1.0 + (stiffness * s.correct_u + damping * s.correct_v) / mass
            force = _kelvin_voigt_force(depth, rate_free, stiffness, damping) / yielding
        peak = max(peak, force)
        acceleration = -force / mass
        x = x_free + s.correct_u * acceleration
        rate = rate_free + s.correct_v * acceleration
        if x <= 0.0 and rate <= 0.0:
            break
    return -rate / speed, peak
