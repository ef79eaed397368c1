"""The equations of a periodic orbit and their solution: unknown are the states after its events and their phases.

An orbit with N events in `cycles` periods of the drive has the states z_k (2d,) just after each and the phases theta_k
of the drive there. With the flow z-_k from (z_{k-1}, theta_{k-1}) to theta_k, event N before the first at
theta_N - 2 pi cycles,

    z_k = J_k(z-_k, theta_k),   h_k(z-_k, theta_k) = 0,

with the jump J of a rigid impact, the identity of any other event, and h the distance of a gap from its wall, or the
force of a Kelvin-Voigt contact over its stiffness. Nothing is divided by an approach speed: where it is zero, the
derivatives stay regular. The phase of the drive at t = 0 is in none of the equations. All are analytic, see `motion`.
They are solved by Newton's method, damped far from the solution.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from femimpact.arrays import Array, Complex, Integers
from femimpact.orbits.motion import Flow, HybridSystem, Motion, Numbers, pressed_in

STEP = 1e-30
"""Imaginary part of a complex step, times the value."""

MOST_STEPS = 60
"""Steps of one search."""

EXACT = 1e-12
"""Largest change of a state or a phase, in its unit, at which a search ends."""

ROUNDED = 1e-8
"""The same where rounding ends it: slow impacts leave their phases no more digits."""

NEAR, FALL = 0.1, 0.1
"""Change below which the next one is less than this share of it, beside a solution that is not singular."""

GIVEN = 1e-6
"""First change up to which the guess is a solution already, but for rounding."""

LEAST_SHARE = 1e-3
"""Least share of a step that is tried."""

LEAST_UNIT = 1e-3
"""Share of the size of a motion below which no gap is its unit: rounding of the motion would be read as a miss."""


@dataclass(frozen=True, eq=False)
class EventSequence:
    """The events of an orbit in their order, N of them."""

    kind: tuple[str, ...]  # of `response.impacts.EVENT_KINDS`, or SECTION
    pair: Integers  # (N,) number of the pair; -1 of a section
    side: Array  # (N,) +1 or -1: which wall
    contact_state: Array  # (N, pairs) after each event: 0, +-1 in contact, +-2 separating
    section: Array  # (N,) rad: phase of a section
    cycles: int
    # True of the first half of a symmetric orbit, after which its opposite comes: its cycles are those of both halves
    is_half: bool = False

    @property
    def turn(self) -> float:
        """Phase (rad) after which the events come again, those of a half on the other side."""
        return (np.pi if self.is_half else 2.0 * np.pi) * self.cycles

    def between(self, phases: Array) -> Array:
        """Phases (N,) from each event to the next, the first one once more after the last."""
        return np.diff(np.append(phases, phases[0] + self.turn))

    def rows(self, rows: Any) -> EventSequence:  # numbers of events, or a slice of them
        """Some of the events."""
        arrays = {name: getattr(self, name)[rows] for name in ("pair", "side", "contact_state", "section")}
        return replace(self, kind=tuple(np.array(self.kind)[rows].tolist()), **arrays)


SECTION = "section"
"""Kind of a fixed phase where the motion meets no event."""


@dataclass(frozen=True, eq=False)
class EventStates:
    """The events of one period, the states after them and the phases of the drive at them: the unknowns."""

    sequence: EventSequence
    states: Numbers  # (N, 2d)
    phases: Numbers  # (N,) rad

    def motion(self, hybrid: HybridSystem) -> Motion:
        """The motion between them."""
        sequence = self.sequence
        end = self.phases + sequence.between(self.phases)
        return Motion(hybrid, self.phases, end, self.states, sequence.contact_state, sequence.pair)


@dataclass(frozen=True, eq=False)
class EventMaps:
    """Maps of the flow from each event to the next, maps of the events, and their derivatives, numbers (N, ...)."""

    hybrid: HybridSystem
    events: EventStates
    propagator: Numbers  # (N, 2d, 2d) from after the event before to the event
    field_before: Numbers  # (N, 2d) z' just after the event before, and just before the event
    field_arrived: Numbers
    field_after: Numbers  # (N, 2d) z' just after the event, from `jumped`
    row: Numbers  # (N, 2d) of h
    distance: Numbers  # (N,) h
    distance_by_phase: Numbers  # (N,) at a fixed state
    impulse: Numbers  # (N, 2d) derivative of the change of z by the approach speed
    speed_row: Numbers  # (N, 2d) of the approach speed
    speed: Numbers  # (N,) m/s
    speed_by_phase: Numbers  # (N,)
    jumped: Numbers  # (N, 2d) J(z-)

    @property
    def jump(self) -> Numbers:
        """Derivative (N, 2d, 2d) of J by the state."""
        return np.asarray(np.eye(self.row.shape[1]) + self.impulse[:, :, None] * self.speed_row[:, None, :])

    @property
    def jumped_by_phase(self) -> Numbers:
        """Derivative (N, 2d) of J by the phase, with the state that flows."""
        omega = self.hybrid.omega
        explicit = self.impulse * self.speed_by_phase[:, None]
        return np.asarray((self.jump @ self.field_arrived[:, :, None])[:, :, 0] / omega + explicit)

    @property
    def distance_rate(self) -> Numbers:
        """Derivative (N,) of h by the phase, with the state that flows: 0 where an event grazes."""
        return np.asarray((self.row * self.field_arrived).sum(axis=1) / self.hybrid.omega + self.distance_by_phase)

    @property
    def saltation(self) -> Numbers:
        """Matrices (N, 2d, 2d) of the events at a fixed time: the phases of the events eliminated."""
        after = self.field_after / self.hybrid.omega - self.jumped_by_phase
        # the event comes sooner by what the state is nearer to it
        return np.asarray(self.jump + after[:, :, None] * (self.row / self.distance_rate[:, None])[:, None, :])

    @property
    def steps(self) -> Numbers:
        """Derivatives (N, 2d, 2d) of the state after each event by that after the one before, at fixed times."""
        return np.asarray(self.saltation @ self.propagator)


def event_maps(hybrid: HybridSystem, events: EventStates) -> EventMaps:
    """The maps from each event to the next."""
    sequence, states, phases = events.sequence, events.states, events.phases
    last, d = np.arange(phases.size) - 1, hybrid.mass.size
    start, begin, before = states[last], phases[last], sequence.contact_state[last]
    begin[0] -= sequence.turn
    if sequence.is_half:
        start[0], before[0] = -start[0], -before[0]
    arrived, field_before, field_arrived, field_after = (np.zeros_like(states) for _ in range(4))
    propagator = np.zeros((*states.shape, states.shape[1]), dtype=states.dtype)
    for flow, each in _flows(hybrid, before):
        arrived[each], propagator[each] = flow.carried(start[each], begin[each], phases[each])
        field_before[each] = flow.field(start[each], begin[each])
        field_arrived[each] = flow.field(arrived[each], phases[each])
    row = change = impulse = np.zeros((phases.size, 2 * d))
    of_base, level, by_phase = np.zeros((phases.size, 2)), sequence.section, 1.0
    if SECTION not in sequence.kind:
        (row, of_base, level), by_phase = hybrid.conditions(sequence.kind, sequence.pair, sequence.side), 0.0
    sine, cosine = np.sin(phases), np.cos(phases)
    speed_row = np.concatenate([0.0 * row[:, :d], row[:, :d]], axis=1)
    speed = (speed_row * arrived).sum(axis=1) + hybrid.omega * of_base[:, 0] * cosine
    if SECTION not in sequence.kind:
        change, impulse = hybrid.impulses(sequence.kind, sequence.pair, sequence.side, speed)
    jumped = arrived + change * speed[:, None]
    for flow, each in _flows(hybrid, sequence.contact_state):
        field_after[each] = flow.field(jumped[each], phases[each])
    return EventMaps(
        hybrid=hybrid,
        events=events,
        propagator=propagator,
        field_before=field_before,
        field_arrived=field_arrived,
        field_after=field_after,
        row=row,
        distance=(row * arrived).sum(axis=1)
        + of_base[:, 0] * sine
        + of_base[:, 1] * cosine
        + by_phase * phases
        - level,
        distance_by_phase=of_base[:, 0] * cosine - of_base[:, 1] * sine + by_phase,
        impulse=impulse,
        speed_row=speed_row,
        speed=speed,
        speed_by_phase=-hybrid.omega * of_base[:, 0] * sine,
        jumped=jumped,
    )


def _flows(hybrid: HybridSystem, contact_state: Array) -> list[tuple[Flow, list[int]]]:
    """The flows of contact states (N, pairs), each with the numbers of those that have it."""
    members: dict[bytes, list[int]] = {}
    for k, state in enumerate(pressed_in(contact_state)):
        members.setdefault(state.tobytes(), []).append(k)
    return [(hybrid.flow(contact_state[each[0]]), each) for each in members.values()]


def residual(maps: EventMaps) -> Numbers:
    """(N, 2d + 1): the states less those that the events make, and h."""
    return np.concatenate([maps.events.states - maps.jumped, maps.distance[:, None]], axis=1)


def jacobian(maps: EventMaps) -> Numbers:
    """Derivatives of `residual` by the states and phases, (N, 2d + 1, N, 2d + 1)."""
    count, size = maps.row.shape
    jump, omega = maps.jump, maps.hybrid.omega
    found = np.zeros((count, size + 1, count, size + 1), dtype=maps.propagator.dtype)
    each, before = np.arange(count), np.arange(count) - 1
    # of z- by the state and the phase of the event before
    by_before = np.concatenate([maps.propagator, -(maps.propagator @ maps.field_before[:, :, None]) / omega], axis=2)
    if maps.events.sequence.is_half:
        by_before[0, :, :size] *= -1.0
    found[each, :size, before] = -jump @ by_before
    found[each, size, before] = (maps.row[:, None, :] @ by_before)[:, 0]
    # with one event it is the event itself
    found[each, :size, each, :size] += np.eye(size)
    found[each, :size, each, size] -= maps.jumped_by_phase
    found[each, size, each, size] += maps.distance_rate
    return found


def derivative_by(hybrid_at: Callable[[complex], HybridSystem], value: float, events: EventStates) -> Array:
    """Derivative of `residual` by a number of the system, (N, 2d + 1), exact to rounding by a complex step."""
    step = STEP * max(abs(value), 1.0)
    maps = event_maps(hybrid_at(complex(value, step)), replace(events, states=events.states.astype(complex)))
    return np.asarray(residual(maps).imag) / step


def state_unit(length: float, omega: Any, coordinates: int) -> Array:
    """Units (2d,) of a state: a length (m), and that times omega."""
    return np.repeat([length, length * float(omega)], coordinates)


def units_of(hybrid: HybridSystem, sequence: EventSequence, length: float) -> tuple[Array, Array]:
    """Units (2d + 1,) of the states and the phase of an event, and of its rows in `residual`."""
    state = state_unit(length, hybrid.omega, hybrid.mass.size)
    # h is a length, or the phase of a section
    return np.append(state, 1.0), np.append(state, length if sequence.pair.max(initial=-1) >= 0 else 1.0)


def product(steps: Array) -> Array:
    """Product of matrices, the first one applied first."""
    return np.asarray(reduce(lambda found, step: step @ found, steps, np.eye(steps.shape[1])))


def multipliers_of(matrix: Array) -> Complex:
    """Eigenvalues of a map, the largest modulus first."""
    values = np.linalg.eigvals(matrix).astype(complex)
    found = np.asarray(values[np.argsort(-np.abs(values), kind="stable")])
    found.setflags(write=False)
    return found


def length_of(hybrid: HybridSystem, states: Array) -> float:
    """Unit of displacements (m): the smallest gap, or what is seen of motions that are far larger.

    Without walls, and with walls at no distance, it is the size of the motion: the largest displacement, or velocity
    over omega.
    """
    gaps = np.where(np.isfinite(hybrid.gaps), np.abs(hybrid.gaps), 0.0).max(axis=1)
    size = float(np.abs(states / state_unit(1.0, hybrid.omega, hybrid.mass.size)).max(initial=0.0)) or 1.0
    if not np.any(gaps > 0.0):
        return size
    return max(float(gaps[gaps > 0.0].min()), LEAST_UNIT * size)


def may_be_symmetric(hybrid: HybridSystem, sequence: EventSequence) -> bool:
    """Whether both sides of what is met are equal, and the events half a period later are those of the other side."""
    gaps = hybrid.gaps[np.unique(sequence.pair[sequence.pair >= 0])]
    equal = np.allclose(gaps[:, 0], gaps[:, 1], rtol=1e-12, atol=0.0) and not np.any(hybrid.constant)
    return sequence.cycles % 2 == 1 and equal and halves_agree(sequence, -1.0)


def halves_agree(sequence: EventSequence, sign: float) -> bool:
    """Whether the events of the second half of a period are those of the first, on the same side or on the other."""
    half, odd = divmod(len(sequence.kind), 2)
    if odd or sequence.kind[:half] != sequence.kind[half:]:
        return False
    one_side = sequence.pair, sign * sequence.side, sign * sequence.contact_state
    other = sequence.pair, sequence.side, sequence.contact_state
    return all(np.array_equal(here[:half], there[half:]) for here, there in zip(one_side, other, strict=True))


def asymmetry(events: EventStates, unit: Array) -> float:
    """Largest difference between an orbit that may be symmetric and minus itself half a period later, in its units."""
    states, phases, half = events.states, events.phases, len(events.phases) // 2
    apart = np.abs(states[:half] + states[half:]) / unit
    turned = np.abs(phases[half:] - phases[:half] - math.pi * events.sequence.cycles)
    return float(max(apart.max(), turned.max()))


# ---- their solution --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a search ended."""

    hybrid: HybridSystem
    events: EventStates
    length: float  # m: unit of displacements
    changes: tuple[float, ...] = ()  # largest of each step, in units of the length, the length times omega, and rad
    residual: float = 0.0  # largest, in the same units
    converged: bool = True

    @cached_property
    def maps(self) -> EventMaps:
        """Those between its events."""
        return event_maps(self.hybrid, self.events)

    @cached_property
    def motion(self) -> Motion:
        """The motion between its events."""
        return self.events.motion(self.hybrid)


def solve(
    hybrid: HybridSystem,
    guess: EventStates,
    length: float,  # m: unit of displacements; that of velocities is it times omega
) -> Solution:
    """Solution of the equations from a first guess.

    A step is shortened until the step that would follow it, with the same matrix, is shorter (the natural
    monotonicity test of Deuflhard, 2011, which does not depend on units), and the events keep their order.
    """
    maps, converged = event_maps(hybrid, guess), False
    (count, size), changes = guess.states.shape, list[float]()
    unit, by_rows = units_of(hybrid, guess.sequence, length)

    def scaled_step(factors: Any, made: EventMaps) -> Array:
        right = (residual(made) / by_rows).reshape(-1)
        return -np.asarray(dgetrs(*factors, right)[0]).reshape(count, size + 1)

    while len(changes) < MOST_STEPS:
        matrix = (jacobian(maps) / by_rows[:, None, None] * unit).reshape(2 * [count * (size + 1)])
        *factors, singular = dgetrf(matrix)
        if singular or not np.all(np.isfinite(matrix)):
            break
        step, here = scaled_step(factors, maps), maps.events
        change, share = float(np.abs(step).max()), 1.0
        if not np.isfinite(change):
            break
        norm = float(np.linalg.norm(step))
        while True:
            moved = here.states + share * step[:, :size] * unit[:-1]
            turned = here.phases + share * step[:, size]
            if change <= ROUNDED or np.all(here.sequence.between(turned) >= 0.0):
                after = event_maps(hybrid, replace(here, states=moved, phases=turned))
                next_norm = float(np.linalg.norm(scaled_step(factors, after)))
                if change <= ROUNDED or next_norm <= (1.0 - 0.25 * share) * norm:
                    break
            share *= 0.5
            if share < LEAST_SHARE:
                break
        if share < LEAST_SHARE:
            break
        maps = after
        changes.append(change)
        converged = change <= EXACT or _at_rounding(changes)
        if converged:
            break
    left = residual(maps) / by_rows
    return Solution(hybrid, maps.events, length, tuple(changes), float(np.abs(left).max()), converged)


def _at_rounding(changes: list[float]) -> bool:
    """Whether the steps fall no more, after one that fell as beside a solution that is not singular.

    Beside one that is singular each step is about half of the one before, and the error is as large as the step.
    """
    pairs = list(pairwise(changes))
    if not pairs or changes[-1] > ROUNDED or changes[-1] < FALL * changes[-2]:
        return False
    return changes[0] <= GIVEN or any(before > GIVEN and after <= FALL * min(before, NEAR) for before, after in pairs)
