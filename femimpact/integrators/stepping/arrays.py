"""The arrays of a block of cases: pairs, state, drive and statistics as the compiled loop takes them.

A run may go on from the step at which another one ended.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse.linalg
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.contact.custom_law import ForcePointer
from femimpact.contact.laws import KELVIN_VOIGT, RIGID, SWITCHING_SPRING
from femimpact.core.structs import zeros
from femimpact.excitation.excitation import Excitation
from femimpact.integrators.channel_rows import Drive
from femimpact.integrators.stepping.operators import SteppingMethod, scheme_of
from femimpact.response.impacts import CYCLE_COLUMNS, MAXIMUM, MINIMUM
from femimpact.system.contact_pair import ContactPair
from femimpact.system.state import ROUNDED, State
from femimpact.system.system import System


@dataclass(frozen=True, eq=False)
class Held:
    """State of a run of one case where it ended."""

    origin: float  # s: time of its step 0
    step: int
    motion: Mapping[str, Array]  # arrays of `core.steps.Motion` and `core.steps.Cycles` by their names
    cycles: Mapping[str, Array | NDArray[np.int64]]
    gaps: Array  # (2, pairs, 1) m: of rigid contacts that the run began in, these are the start's
    # (pairs, n) J: what contacts in progress have given to each mode; without columns where it was not summed
    to_modes: Array

    def contacts_in_progress(self, system: System) -> tuple[str, ...]:
        """Names of the contacts in progress."""
        opened = self.motion["touch"][core.steps.OPEN, :, 0] != 0.0
        return tuple(pair.name for pair, is_open in zip(system.contacts, opened, strict=True) if is_open)


def kind_of_steps(method: SteppingMethod) -> object:
    """Methods whose steps are the same go on from one another."""
    return "steps", scheme_of(method), method.refine


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of each case of a block; all excitations act along one load."""

    excitations: Sequence[Excitation]
    # length of each case; the block runs to the longest, and what a case does after its end does not count
    steps: Sequence[int]
    window_start: Sequence[int]  # step after the beginning from which impacts are counted, to the end of the case
    initial: State = field(default_factory=State)
    origin: float = 0.0  # s: time of step 0
    # of one case alone that goes on from the end of a run: its step there, and its contacts in progress; whether all
    # else that is held goes on as well, as the drive, the accelerations and the base cycle are the same
    step: int = 0
    held: Held | None = None
    complete: bool = False
    # the system with the gaps and laws of each case, and its start, where these differ; laws of the same kinds that
    # have compiled branches, and no static start. None for those of all cases.
    each: Sequence[tuple[System, State]] = ()

    @property
    def cycle(self) -> int:
        """Base cycles that were finished before."""
        return int(self.held.cycles["number"][0]) if self.held is not None and self.complete else 0

    def times(self, method: SteppingMethod) -> Array:
        """Times (s) of all fine steps from step 0 to the end."""
        steps = self.step + max(self.steps)
        time = self.origin + np.arange(steps * method.refine + 1) * (method.dt / method.refine)
        return np.asarray(time, dtype=float)


def inputs_alone(system: System, excitation: Excitation, steps: int, initial: State, method: SteppingMethod) -> Inputs:
    """A run alone, whose last third is measured, with what goes on of the run that ended at its initial state."""
    inputs = Inputs([excitation], [steps], [2 * steps // 3], initial, initial.time)
    left = initial.left_by_run(system, excitation)
    if left is None or left.kind != kind_of_steps(method):
        return inputs
    held: Held = left.held
    if left.has_equations_of(system, excitation, initial.time):
        return replace(inputs, origin=held.origin, step=held.step, held=held, complete=True)
    return replace(inputs, held=held)


def pairs_of(
    system: System, operator: core.steps.Operator, drive: Drive, forces: Sequence[ForcePointer | None], inputs: Inputs
) -> core.steps.Pairs:  # fmt: skip
    """Contact pairs: the row that each reads, its law and its numbers, which may differ among cases."""
    contacts = system.contacts
    rows = [next(i for i, row in enumerate(operator.rows) if np.array_equal(row, pair.direction)) for pair in contacts]
    constants = np.zeros((12, len(contacts), len(inputs.excitations)))
    for j, pair in enumerate(contacts):
        constants[core.steps.MASS, j] = 0.0 if pair.is_stop else pair.mass
        constants[core.steps.MOBILITY, j] = pair.mobility
        constants[core.steps.ACCELERATION, j] = pair.acceleration
        constants[core.steps.SHARE, j] = 0.0 if pair.is_stop else drive.share
        for c, (of_case, _) in enumerate(inputs.each or [(system, inputs.initial)]):
            for row, number in _of_contact(of_case.contacts[j]).items():
                constants[row, j, c if inputs.each else slice(None)] = number
    obstacles = [j for j, pair in enumerate(contacts) if pair.fixed_to == "space" and drive.share != 0.0]
    return core.steps.Pairs(
        row=np.array(rows, dtype=np.int64),
        kind=np.array([pair.parameters.kind for pair in contacts], dtype=np.int64),
        address=np.array([0 if force is None else force.address for force in forces], dtype=np.int64),
        constants=_placed(constants, 10),
        obstacles=np.array(obstacles, dtype=np.int64),
        refused=np.zeros((len(contacts), 3)),
    )


def _of_contact(pair: ContactPair) -> dict[int, float]:
    """Numbers of a pair's gaps and law, by their rows."""
    numbers = pair.parameters
    return {
        core.steps.GAP_PLUS: pair.gaps[0],
        core.steps.GAP_MINUS: pair.gaps[1],
        core.steps.STIFFNESS: numbers.stiffness,
        core.steps.DAMPING: numbers.damping,
        core.steps.EXPONENT: numbers.exponent,
        core.steps.RESTITUTION: numbers.restitution,
        core.steps.FREE_STIFFNESS: pair.free_stiffness + getattr(pair.law, "free_stiffness", 0.0),
        core.steps.FREE_DAMPING: pair.free_damping,
    }


def motion_of(
    system: System,
    operator: core.steps.Operator,
    pairs: core.steps.Pairs,
    inputs: Inputs,
    drives: Sequence[Drive],
    method: SteppingMethod,
    modal: bool,
    record: core.steps.Record,
) -> core.steps.Motion:
    """State at the start: displacements, velocities and the accelerations that the balance gives."""
    lanes, dofs, count = len(drives), system.dofs, len(system.contacts)
    starts = inputs.each or [(system, inputs.initial)] * lanes
    states = [
        start.relative_to_base(own, excitation)
        for (own, start), excitation in zip(starts, inputs.excitations, strict=True)
    ]
    q, v, y, y_rate = (np.ascontiguousarray(np.array(columns).T) for columns in zip(*states, strict=True))
    constants, w, w_rate = pairs.constants, operator.rows @ q, operator.rows @ v
    drive, first = _drive(drives, inputs, method.dt), inputs.step
    ball = np.zeros((9, count, lanes))
    ball[core.steps.Y] = ball[core.steps.Y_BEFORE] = y
    ball[core.steps.Y_RATE] = y_rate
    ball[core.steps.X] = ball[core.steps.X_BEFORE] = y - w[pairs.row]
    ball[core.steps.RATE] = ball[core.steps.RATE_BEFORE] = y_rate - w_rate[pairs.row]
    free_stiffness, free_damping = constants[core.steps.FREE_STIFFNESS], constants[core.steps.FREE_DAMPING]
    springs = free_stiffness * ball[core.steps.X] + free_damping * ball[core.steps.RATE]
    # where contact forces are no part of the acceleration, neither are those of centring springs and their dashpots
    inside = np.zeros_like(springs) if scheme_of(method).mean else springs
    touch = np.zeros((12, count, lanes))
    touch[core.steps.BUSY] = (pairs.kind[:, None] == SWITCHING_SPRING) | (free_stiffness + free_damping > 0.0)
    # any speed > 0: a law's potential is asked for before its first contact
    touch[core.steps.APPROACH] = 1.0
    held = inputs.held
    if held is None:
        pushes = _contacts_at_start(system, inputs, pairs, ball, touch)
        ball[core.steps.FORCE] = springs + pushes
    else:
        # contacts in progress go on
        constants[[core.steps.GAP_PLUS, core.steps.GAP_MINUS]] = held.gaps
        touch[...] = held.motion["touch"]
        if not inputs.complete:
            # of steps that are counted anew
            touch[core.steps.START] -= held.step * method.dt
        ball[core.steps.FORCE] = held.motion["ball"][core.steps.FORCE]
        pushes = ball[core.steps.FORCE] - springs
    if not scheme_of(method).mean:
        inside = inside + pushes
    ball[core.steps.Y_ACCELERATION] = (
        constants[core.steps.ACCELERATION] - constants[core.steps.SHARE] * drive[core.steps.BASE]
    ) - inside * constants[core.steps.MOBILITY]
    load = operator.rows[pairs.row].T @ inside + np.outer(operator.drive_load, drive[core.steps.BASE])
    table, travel, more, apart = _histories(drives, inputs, method, pairs.obstacles.size > 0)
    load += np.asarray(system.constant_load)[:, None] - (system.C @ v + system.K @ q)
    for own, further in zip(operator.more_load, drives[0].more, strict=True):
        load += np.outer(own, further.value(np.array([inputs.origin])))
    ledger = np.zeros((8, lanes))
    ledger[core.steps.LOAD_BEFORE] = operator.drive_load @ q
    ledger[core.steps.HELD] = np.asarray(system.constant_load) @ q
    redo = method.refine > 1
    # C order matters: the case axis must be contiguous
    a = scipy.linalg.solveh_banded(operator.mass_band, load, lower=True)
    # what is gone through in every step, but for the drive and the statistics
    q, v, a, w, w_rate, ball, touch, ledger = (
        _placed(values, place) for place, values in enumerate((q, v, a, w, w_rate, ball, touch, ledger))
    )
    drive_parts = drives[0].parts
    lengths = {
        "C": lanes, "P": count, "n": dofs, "m": dofs if modal else 0, "D": len(drive_parts),
        "i": dofs if modal and record.impacts.shape[0] > 0 else 0, "s": dofs if redo else 0, "r": count if redo else 0,
    }  # fmt: skip
    return zeros(
        core.steps.Motion,
        lengths,
        q=q,
        v=v,
        a=a,
        w=w,
        w_rate=w_rate,
        ball=ball,
        touch=touch,
        window=first + np.array([inputs.window_start, inputs.steps], dtype=np.int64),
        drive=drive,
        table=table,
        travel=travel,
        more=more,
        drives=apart,
        drive_place=np.array([part.place for part in drive_parts], dtype=np.int64),
        held_by_drive=np.array([float(part.load @ q[:, 0]) for part in drive_parts]),
        ledger=ledger,
        v_before=v.copy(),
    )


def _placed(values: Array, place: int) -> Array:
    """A copy that begins with a cache line, at another distance from the page's start for each place.

    Loads across two lines cost twice, and accesses a multiple of the page size apart are mistaken for one another.
    """
    memory = np.empty(values.size + 1024)
    line, page = memory.ctypes.data // 8, 512
    start = (-line) % 8 + ((place * 168 - (line + (-line) % 8)) % page) // 8 * 8
    copy = memory[start : start + values.size].reshape(values.shape)
    copy[...] = values
    return copy


def _contacts_at_start(
    system: System, inputs: Inputs, pairs: core.steps.Pairs, ball: Array, touch: Array
) -> Array:  # fmt: skip
    """Contacts that a start is in: they are open from the start on. Returns the forces (N) of compliant ones.

    The wall of a rigid one, in a static start, is moved to the start, less than rounding may: impulses look at whether
    a gap is closed.
    """
    pushes = np.zeros(ball.shape[1:])
    if inputs.initial.is_static_on(system):
        _static_contacts_at_start(system, inputs, pairs, ball, touch, pushes)
    gaps = pairs.constants[[core.steps.GAP_PLUS, core.steps.GAP_MINUS]]
    over = np.stack([ball[core.steps.X], -ball[core.steps.X]]) - gaps
    within = (over.max(axis=0) > ROUNDED) & (touch[core.steps.OPEN] == 0.0) & (pairs.kind != RIGID)[:, None]
    for j, c in np.argwhere(within).tolist():
        pair = (inputs.each[c][0] if inputs.each else system).contacts[j]
        side, depth = (1.0, float(over[0, j, c])) if over[0, j, c] > 0.0 else (-1.0, float(over[1, j, c]))
        rate, x = side * float(ball[core.steps.RATE, j, c]), float(ball[core.steps.X, j, c])
        speed = _approach_within(pair, depth, rate)
        if pairs.kind[j] == SWITCHING_SPRING:
            # its force is that of a spring from the centre on
            force = elastic = pair.parameters.stiffness * abs(x)
            pushes[j, c] = side * force - pairs.constants[core.steps.FREE_STIFFNESS, j, c] * x
        else:
            force, elastic = (pair.law.normal_force(depth, p, speed, pair.effective_mass) for p in (rate, 0.0))
            pushes[j, c] = side * force
        touch[core.steps.BUSY, j, c] = touch[core.steps.OPEN, j, c] = 1.0
        touch[core.steps.SIDE, j, c], touch[core.steps.APPROACH, j, c] = side, speed
        touch[core.steps.NORMAL, j, c] = touch[core.steps.PEAK, j, c] = force
        touch[core.steps.DISSIPATIVE, j, c] = force - elastic
    return pushes


def _approach_within(pair: ContactPair, depth: float, rate: float) -> float:
    """Approach speed (m/s) of a contact that a run starts in, at a depth (m) and its rate; see `State`."""
    if pair.parameters.kind in (KELVIN_VOIGT, SWITCHING_SPRING):
        return max(rate, 0.0)
    # of a custom law the energy may depend on the speed itself
    stored = pair.law.potential(depth, pair.effective_mass, abs(rate) or 1.0)
    return math.sqrt(rate**2 + 2.0 * stored / pair.effective_mass)


def _static_contacts_at_start(
    system: System, inputs: Inputs, pairs: core.steps.Pairs, ball: Array, touch: Array, pushes: Array
) -> None:  # fmt: skip
    """Those of them that a static start is in, with their forces (N) in `pushes`."""
    contacts_at: dict[float, Any] = {}
    for c, excitation in enumerate(inputs.excitations):
        at = float(excitation.displacement(inputs.initial.time))
        if at not in contacts_at:
            contacts_at[at] = inputs.initial.static_contacts(system, excitation)
        normal = contacts_at[at].normal
        for j in np.flatnonzero(normal):
            side, gap = math.copysign(1.0, normal[j]), core.steps.GAP_PLUS if normal[j] > 0.0 else core.steps.GAP_MINUS
            depth = side * ball[core.steps.X, j, c] - pairs.constants[gap, j, c]
            numbers, force = system.contacts[j].parameters, 0.0
            if numbers.kind == RIGID:
                # a start may have been given elsewhere, away from the wall
                if abs(depth) > ROUNDED:
                    continue
                pairs.constants[gap, j, c] += depth - ROUNDED
                force = abs(normal[j])
            elif depth <= 0.0:
                continue
            elif numbers.kind == KELVIN_VOIGT:
                rate = side * ball[core.steps.RATE, j, c]
                force = core.normal_force(KELVIN_VOIGT, depth, rate, numbers.stiffness, numbers.damping, 1.0, 1.0)
                touch[core.steps.DISSIPATIVE, j, c] = force - numbers.stiffness * depth
            else:
                force = core.normal_force(numbers.kind, depth, 0.0, numbers.stiffness, 0.0, numbers.exponent, 1.0)
            touch[core.steps.BUSY, j, c] = touch[core.steps.OPEN, j, c] = 1.0
            touch[core.steps.SIDE, j, c], touch[core.steps.APPROACH, j, c] = side, 0.0
            touch[core.steps.NORMAL, j, c] = touch[core.steps.PEAK, j, c] = force
            pushes[j, c] += side * force


def _drive(drives: Sequence[Drive], inputs: Inputs, dt: float) -> Array:
    omega, phase, amplitude = (
        np.array([getattr(drive.sine, name) for drive in drives]) for name in ("omega", "phase", "amplitude")
    )
    origin, rows = inputs.origin, np.zeros((14, len(drives)))
    phase = phase + omega * origin
    rows[core.steps.SINE], rows[core.steps.COSINE] = np.sin(phase), np.cos(phase)
    rows[core.steps.TURN_SINE], rows[core.steps.TURN_COSINE] = np.sin(omega * dt), np.cos(omega * dt)
    rows[core.steps.PHASE], rows[core.steps.PHASE_STEP] = phase, omega * dt
    rows[core.steps.SCALE] = amplitude
    rows[core.steps.BASE] = [float(drive.value(np.array([origin]))[0]) for drive in drives]
    rows[core.steps.BASE_BEFORE] = rows[core.steps.ACTING] = rows[core.steps.BASE]
    travel = np.array([drive.base_amplitude for drive in drives])
    rows[core.steps.TRAVEL], rows[core.steps.TRAVEL_RATE] = travel, travel * omega
    rows[core.steps.OBSTACLE_RATE] = [float(excitation.velocity(origin)) for excitation in inputs.excitations]
    rows[core.steps.OBSTACLE_RATE_BEFORE] = rows[core.steps.OBSTACLE_RATE]
    return _placed(rows, 8)


def _histories(
    drives: Sequence[Drive], inputs: Inputs, method: SteppingMethod, in_space: bool
) -> tuple[Array, Array, Array, Array]:
    """Values at every fine step where the drives are no single sine, else no rows.

    They are those of the drives (T, C), with displacement and velocity of the base (2, T, C) for stops fixed in space;
    of the loads behind the first (H, T); and of each of several drives (D, T).
    """
    cases, several = len(drives), bool(drives[0].parts)
    if not any(drive.is_tabulated for drive in drives):
        return np.zeros((0, cases)), np.zeros((2, 0, cases)), np.zeros((0, 0)), np.zeros((0, 0))
    time, travel = inputs.times(method), np.zeros((2, 0, cases))
    table = np.ascontiguousarray(np.array([_at_steps(drive, time, method.refine) for drive in drives]).T)
    if in_space:
        motions = [[excitation.displacement(time), excitation.velocity(time)] for excitation in inputs.excitations]
        travel = np.ascontiguousarray(np.moveaxis(np.array(motions), 0, -1))
    more, apart = (
        np.array([_at_steps(each, time, method.refine) for each in loads if several]).reshape(-1, time.size)
        for loads in (drives[0].more, drives[0].own)
    )
    return table, travel, more, apart


def _at_steps(drive: Drive, time: Array, refine: int) -> Array:
    """Values of a drive at all fine steps; those at coarse steps are among them."""
    if drive.members:
        return np.asarray(sum(_at_steps(part, time, refine) for part in drive.members))
    values = drive.value_at_steps(time)
    if refine > 1:
        values[::refine] = drive.value_at_steps(time[::refine])
    return values


def cycles_of(inputs: Inputs, motion: core.steps.Motion, dt: float, ledger: bool) -> core.steps.Cycles:
    """Statistics per cycle of each excitation, empty but for the place of the motion's start."""
    lanes = len(inputs.excitations)
    period = np.array([1.0 / (excitation.frequency * dt) for excitation in inputs.excitations])
    most = int((inputs.step + max(inputs.steps)) / period.min()) + 1
    sums = np.zeros((len(CYCLE_COLUMNS), lanes))
    sums[MAXIMUM] = sums[MINIMUM] = motion.w[0]
    return zeros(
        core.steps.Cycles,
        {"C": lanes, "K": most, "k": (most if ledger else 0) + 1},
        # no run is as long as the largest integers
        next_wrap=np.ceil(np.minimum(period, 2.0**62)).astype(np.int64),
        period=period,
        sums=_placed(sums, 9),
        last=_placed(np.array([motion.w[0], motion.w_rate[0]]), 11),
    )


def limits_of(
    system: System,
    inputs: Inputs,
    drives: Sequence[Drive],
    operator: core.steps.Operator,
    motion: core.steps.Motion,
    method: SteppingMethod,
) -> Array:
    """Displacement (m) of the observed place beyond which a case counts as diverging.

    A multiple of what the drive does at resonance, the initial state, and a ball's motion within
    one radian of the first mode can amount to; without an elastic mode, within the run.
    """
    alpha, beta = system.rayleigh or (0.0, 0.0)
    omega = 2.0 * math.pi * system.first_frequency
    time = 1.0 / omega if omega > 0.0 else max(inputs.steps) * method.dt
    ratio = max(0.5 * (alpha / omega + beta * omega), 1e-3) if omega > 0.0 else 1.0
    forced = [
        0.0 if drive.share else _acceleration(system, drive, motion.table[:, c] if motion.table.size else None)
        for c, drive in enumerate(drives)
    ]
    # several drives have a block alone
    forced[0] += sum(_acceleration(system, *part) for part in zip(drives[0].more, motion.more, strict=True))
    amplitude = np.array([excitation.amplitude for excitation in inputs.excitations]) + time**2 * np.array(forced)
    rates = np.vstack([motion.w_rate, motion.ball[core.steps.Y_RATE]])
    acceleration = max((abs(pair.acceleration) for pair in system.contacts), default=0.0)
    if np.any(system.constant_load):
        # static deflections are of this size over the first mode's time
        free = scipy.sparse.linalg.spsolve(system.M.tocsc(), np.asarray(system.constant_load))
        acceleration = max(acceleration, float(np.abs(operator.rows @ np.atleast_1d(free)).max()))
    scale = amplitude / ratio + np.abs(motion.w).max(axis=0) + np.abs(rates).max(axis=0) * time + acceleration * time**2
    return np.asarray(method.divergence_limit * (scale + 1e-9))


def _acceleration(system: System, drive: Drive, values: Array | None) -> float:
    """Largest acceleration (m/s^2) that a force on the structure gives to its place; by its values if no sine."""
    largest = abs(drive.sine.amplitude) if values is None else float(np.abs(values).max())
    free = scipy.sparse.linalg.spsolve(system.M.tocsc(), drive.load)
    return largest * float(np.atleast_1d(free) @ drive.load)
