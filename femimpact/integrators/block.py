"""A block of cases side by side: one system, one method, many base motions."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.contact.formulas import SWITCHING_SPRING
from femimpact.excitation import Sine
from femimpact.integrators import layout
from femimpact.integrators.kernels import loop
from femimpact.integrators.kernels.ledger import write_energy
from femimpact.integrators.newmark import Newmark, bands, factorise
from femimpact.signals import CycleStatistics
from femimpact.system import State, System

__all__ = ["Block", "prepare", "run_block"]

STEPS_BETWEEN_CHECKS = 4_000_000
"""Mode-steps between two looks at progress, interrupts and divergence: some 10 ms of work."""

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Block:
    """Arrays of one compiled run; the kernel writes into them."""

    operator: layout.Operator
    scheme: layout.Scheme
    pairs: layout.Pairs
    motion: layout.Motion
    cycles: layout.Cycles
    record: layout.Record
    ledger: bool
    steps: int
    ends: NDArray[Any]
    cases: int
    limit: NDArray[Any]
    diverged: NDArray[Any]

    @property
    def cycle_statistics(self) -> CycleStatistics:
        """Statistics of every finished base cycle of the real cases."""
        values = self.cycles.values[:, :, : self.cases]
        columns = {name: values[:, i] for i, name in enumerate(layout.CYCLE_COLUMNS)}
        return CycleStatistics(**columns)


def _lanes(cases: int) -> int:
    """Width of the case axis: one alone, else a multiple of 8 and at least 16, which fills SIMD registers."""
    return 1 if cases == 1 else max(16, 8 * math.ceil(cases / 8))


def empty_record(dofs: int) -> layout.Record:
    """A record that keeps nothing."""
    return layout.Record(
        kind=np.zeros(0, dtype=np.int64),
        source=np.zeros(0, dtype=np.int64),
        rows=np.zeros((0, dofs)),
        channels=np.zeros((0, 0)),
        energy=np.zeros((0, len(layout.ENERGY_COLUMNS))),
        fields=np.zeros((0, 2, 0)),
        forces=np.zeros((0, 0)),
        impacts=np.zeros((0, len(layout.IMPACT_COLUMNS))),
        stride=np.ones(4, dtype=np.int64),
        tally=np.zeros(4, dtype=np.int64),
    )


def prepare(
    system: System,
    bases: Sequence[Sine],
    method: Newmark,
    *,
    steps: Sequence[int],
    window_start: Sequence[int],
    initial: State,
    observed: NDArray[Any],
    ledger: bool,
    record: layout.Record | None = None,
) -> Block:
    """Lay out all arrays of a block; nothing runs yet.

    Parameters
    ----------
    system : System
    bases : sequence of Sine
        One for each case.
    method : Newmark
    steps : sequence of int
        Length of each case; the block runs to the longest, and what a case does after its own end
        does not count.
    window_start : sequence of int
        Step from which impacts are counted, for each case, to its own end.
    initial : State
    observed : ndarray (dofs,)
        Row whose value gets cycle statistics.
    ledger : bool
    record : layout.Record, optional
        What case 0 keeps.

    Returns
    -------
    Block
    """
    lanes = _lanes(len(bases))
    # idle lanes repeat the last case: finite numbers, no effect on the others
    padded = [*bases, *[bases[-1]] * (lanes - len(bases))]
    idle = lanes - len(bases)
    window = np.array([[*w, *[w[-1]] * idle] for w in (window_start, steps)], dtype=np.int64)
    operator = _operator(system, method, observed)
    scheme = layout.Scheme(
        dt=method.dt,
        predict_u=method.dt**2 * (0.5 - method.beta),
        predict_v=method.dt * (1.0 - method.gamma),
        correct_u=method.dt**2 * method.beta,
        correct_v=method.dt * method.gamma,
    )
    pairs = _pairs(system, operator, lanes)
    motion = _motion(system, operator, pairs, padded, method, initial, window)
    longest = max(steps)
    cycles = _cycles(padded, method.dt, longest, ledger)
    block = Block(
        operator=operator,
        scheme=scheme,
        pairs=pairs,
        motion=motion,
        cycles=cycles,
        record=record or empty_record(system.dofs),
        ledger=ledger,
        steps=longest,
        ends=np.array(steps),
        cases=len(bases),
        limit=_limits(system, padded, motion, method),
        diverged=np.full(lanes, np.inf),
    )
    if ledger:
        for c in range(lanes):
            write_energy(c, operator, pairs, motion, cycles.energy[0, :, c])
    return block


def _operator(system: System, method: Newmark, observed: NDArray[Any]) -> layout.Operator:
    lower, effective = factorise(system, method)
    diagonal = system.is_diagonal
    rows: list[NDArray[Any]] = [observed]
    for pair in system.contacts:
        if not any(np.array_equal(pair.direction, row) for row in rows):
            rows.append(pair.direction)
    table = np.ascontiguousarray(rows)
    directions = np.array([pair.direction for pair in system.contacts]).reshape(-1, system.dofs)
    response = scipy.linalg.cho_solve_banded((_true_factor(lower), True), directions.T).T
    scale = effective[0] if diagonal else np.ones(system.dofs)
    return layout.Operator(
        banded=not diagonal,
        load=-system.base_load / scale,
        damping=system.C.diagonal() / scale,
        stiffness=system.K.diagonal() / scale,
        mass_band=bands(system.M),
        damping_band=_widened(bands(system.C), lower.shape[0]),
        stiffness_band=_widened(bands(system.K), lower.shape[0]),
        cholesky_band=lower,
        base_load=np.array(system.base_load),
        rows=table,
        response=np.ascontiguousarray(response),
        compliance=np.ascontiguousarray(table @ response.T),
    )


def _true_factor(lower: NDArray[Any]) -> NDArray[Any]:
    factor = lower.copy()
    factor[0] = 1.0 / factor[0]
    return factor


def _widened(band: NDArray[Any], width: int) -> NDArray[Any]:
    return np.vstack([band, np.zeros((width - band.shape[0], band.shape[1]))])


def _pairs(system: System, operator: layout.Operator, lanes: int) -> layout.Pairs:
    contacts = system.contacts
    rows = [next(i for i, row in enumerate(operator.rows) if np.array_equal(row, pair.direction)) for pair in contacts]
    constants = np.zeros((7, len(contacts), lanes))
    for j, pair in enumerate(contacts):
        constants[layout.MASS, j] = pair.mass
        constants[layout.GAP_PLUS, j], constants[layout.GAP_MINUS, j] = pair.gaps
        constants[layout.STIFFNESS, j] = pair.parameters.stiffness
        constants[layout.DAMPING, j] = pair.parameters.damping
        constants[layout.FREE_STIFFNESS, j] = pair.free_stiffness + getattr(pair.law, "free_stiffness", 0.0)
        constants[layout.ACCELERATION, j] = pair.acceleration
    return layout.Pairs(
        row=np.array(rows, dtype=np.int64),
        kind=np.array([pair.parameters.kind for pair in contacts], dtype=np.int64),
        constants=constants,
    )


def _motion(
    system: System,
    operator: layout.Operator,
    pairs: layout.Pairs,
    bases: list[Sine],
    method: Newmark,
    initial: State,
    window: NDArray[Any],
) -> layout.Motion:
    lanes, dofs, balls = len(bases), system.dofs, len(system.contacts)
    states = [initial.relative_to_base(system, base) for base in bases]
    q, v, y, y_rate = (np.ascontiguousarray(np.array(columns).T) for columns in zip(*states, strict=True))
    constants = pairs.constants
    w = operator.rows @ q
    ball = np.zeros((7, balls, lanes))
    ball[layout.Y] = ball[layout.Y_BEFORE] = y
    ball[layout.Y_RATE] = y_rate
    ball[layout.X] = ball[layout.X_BEFORE] = y - w[pairs.row]
    ball[layout.FORCE] = force = constants[layout.FREE_STIFFNESS] * ball[layout.X]
    base = np.array([float(excitation.acceleration(0.0)) for excitation in bases])
    ball[layout.Y_ACCELERATION] = constants[layout.ACCELERATION] - base - force / constants[layout.MASS]
    load = operator.rows[pairs.row].T @ force - np.outer(system.base_load, base) - system.C @ v - system.K @ q
    always = (pairs.kind[:, None] == SWITCHING_SPRING) | (constants[layout.FREE_STIFFNESS] > 0.0)
    touch = np.zeros((11, balls, lanes))
    touch[layout.BUSY] = always
    ledger = np.zeros((5, lanes))
    ledger[layout.LOAD_BEFORE] = system.base_load @ q
    return layout.Motion(
        q=q,
        v=v,
        # C order matters: the case axis must be contiguous
        a=np.ascontiguousarray(scipy.linalg.solveh_banded(operator.mass_band, load, lower=True)),
        w=w,
        w_rate=operator.rows @ v,
        ball=ball,
        touch=touch,
        totals=np.zeros((len(layout.TOTAL_COLUMNS), balls, lanes)),
        window=window,
        drive=_drive(bases, method.dt),
        ledger=ledger,
        v_before=v.copy(),
        scratch=np.zeros((3, dofs, lanes)),
    )


def _drive(bases: list[Sine], dt: float) -> NDArray[Any]:
    omega, phase, amplitude = (
        np.array([getattr(base, name) for base in bases]) for name in ("omega", "phase", "amplitude")
    )
    drive = np.zeros((9, len(bases)))
    drive[layout.SINE], drive[layout.COSINE] = np.sin(phase), np.cos(phase)
    drive[layout.TURN_SINE], drive[layout.TURN_COSINE] = np.sin(omega * dt), np.cos(omega * dt)
    drive[layout.PHASE], drive[layout.PHASE_STEP] = phase, omega * dt
    drive[layout.SCALE] = -amplitude * omega**2
    drive[layout.BASE] = drive[layout.BASE_BEFORE] = drive[layout.SCALE] * drive[layout.SINE]
    return drive


def _cycles(bases: list[Sine], dt: float, steps: int, ledger: bool) -> layout.Cycles:
    lanes = len(bases)
    period = np.array([1.0 / (base.frequency * dt) for base in bases])
    most = int(steps / period.min()) + 1
    sums = np.zeros((len(layout.CYCLE_COLUMNS), lanes))
    sums[0], sums[1] = -np.inf, np.inf
    return layout.Cycles(
        next_wrap=np.ceil(period).astype(np.int64),
        number=np.zeros(lanes, dtype=np.int64),
        period=period,
        sums=sums,
        values=np.zeros((most, len(layout.CYCLE_COLUMNS), lanes)),
        energy=np.zeros(((most if ledger else 0) + 1, len(layout.ENERGY_COLUMNS), lanes)),
    )


def _limits(system: System, bases: list[Sine], motion: layout.Motion, method: Newmark) -> NDArray[Any]:
    """Displacement (m) of the observed place beyond which a case counts as diverging.

    A multiple of what the base does at resonance, the initial state, and a ball's flight within
    one radian of the first mode can amount to.
    """
    amplitude = np.array([base.amplitude for base in bases])
    alpha, beta = system.rayleigh or (0.0, 0.0)
    omega = 2.0 * math.pi * system.first_frequency
    ratio = max(0.5 * (alpha / omega + beta * omega), 1e-3)
    rates = np.vstack([motion.w_rate, motion.ball[layout.Y_RATE]])
    given = max((abs(pair.acceleration) for pair in system.contacts), default=0.0)
    scale = amplitude / ratio + np.abs(motion.w).max(axis=0) + np.abs(rates).max(axis=0) / omega + given / omega**2
    return np.asarray(method.divergence_limit * (scale + 1e-9))


def run_block(block: Block, progress: Progress | None = None, stop: threading.Event | None = None) -> None:
    """Run a block to its end, in pieces: between them it reports, listens and looks for divergence.

    Parameters
    ----------
    block : Block
    progress : callable, optional
        Called with the share of the block that is done, 0 to 1.
    stop : threading.Event, optional
        Ends the run early once set.
    """
    lanes, dofs = block.motion.q.shape[1], block.motion.q.shape[0]
    work, energy = np.zeros((5, max(len(block.pairs.row), 1))), np.zeros(len(layout.ENERGY_COLUMNS))
    piece = max(1000, STEPS_BETWEEN_CHECKS // (lanes * dofs))
    done = 0
    while done < block.steps:
        if stop is not None and stop.is_set():
            return
        # pieces end where cases end, so that none is judged by what comes after
        steps = min(piece, int(block.ends[block.ends > done].min()) - done)
        loop.advance(
            steps, block.operator, block.scheme, block.pairs, block.motion, block.cycles, block.record,
            block.ledger, work, energy,
        )  # fmt: skip
        done += steps
        with np.errstate(invalid="ignore"):
            out = ~(np.abs(block.motion.w[0]) <= block.limit) & np.isinf(block.diverged)
        out[: block.cases] &= block.ends >= done
        block.diverged[out] = done * block.scheme.dt
        if bool(np.all(np.isfinite(block.diverged[: block.cases]))):
            return
        if progress is not None:
            progress(done / block.steps)
