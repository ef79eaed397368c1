"""The equations of a periodic orbit: unknown are the states after its events and the phases of its events.

An orbit with N events in `cycles` periods of the drive has the states z_k (2d,) just after each and the phases theta_k
of the drive there. With the flow z-_k from (z_{k-1}, theta_{k-1}) to theta_k, event N before the first at
theta_N - 2 pi cycles,

    z_k = J_k(z-_k, theta_k),   h_k(z-_k, theta_k) = 0,

with the jump J of a rigid impact, the identity of any other event, and h the distance of a gap from its wall, or the
force of a Kelvin-Voigt contact over its stiffness. Nothing is divided by an approach speed: where it is zero, the
derivatives stay regular. The phase of the drive at t = 0 is in none of the equations. All are analytic, see `flow`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex, Integers
from femimpact.integrators.event_driven.loop_data import CONTACT
from femimpact.orbits.flow import HybridSystem, Numbers

STEP = 1e-30
"""Imaginary part of a complex step, times the value."""


@dataclass(frozen=True, eq=False)
class Sequence:
    """The events of an orbit in their order, N of them."""

    kind: tuple[str, ...]  # of `core.events.EVENT_NAMES`, or SECTION
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

    def rows(self, rows: Any) -> Sequence:  # numbers of events, or a slice of them
        """Some of the events."""
        arrays = {name: getattr(self, name)[rows] for name in ("pair", "side", "contact_state", "section")}
        return replace(self, kind=tuple(np.array(self.kind)[rows].tolist()), **arrays)

    @property
    def is_impact(self) -> NDArray[np.bool_]:
        """True for rigid impacts, (N,)."""
        return np.array([kind == IMPACT for kind in self.kind], dtype=bool)


IMPACT, TOUCH, RELEASE, PRESS_AGAIN, SEPARATE, SECTION = (
    "impact", "touch", "release", "press again", "separate", "section",
)  # fmt: skip
"""Kinds of events: those of a log that an orbit may have, and a fixed phase where the motion meets none."""


@dataclass(frozen=True, eq=False)
class EventStates:
    """The events of one period, the states after them and the phases of the drive at them: the unknowns."""

    sequence: Sequence
    states: Numbers  # (N, 2d)
    phases: Numbers  # (N,) rad


@dataclass(frozen=True, eq=False)
class EventMaps:
    """Maps of the flow from each event to the next, maps of the events, and their derivatives, numbers (N, ...)."""

    hybrid: HybridSystem
    events: EventStates
    propagator: Numbers  # (N, 2d, 2d) from after the event before to the event
    arrived: Numbers  # (N, 2d) z-
    field_before: Numbers  # (N, 2d) z' just after the event before, and just before the event
    field_arrived: Numbers
    field_after: Numbers  # (N, 2d) z' just after the event, from `jumped`
    row: Numbers  # (N, 2d) of h
    distance: Numbers  # (N,) h
    distance_by_phase: Numbers  # (N,) at a fixed state
    impulse: Numbers  # (N, 2d) change of z by a unit approach speed
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


@dataclass(frozen=True, eq=False)
class _Rows:
    """What the events read of a state, and do to it."""

    gap: Numbers  # (N, d) of side_k x_j, but for the base's part
    in_space: Numbers  # (N,) of ub in it
    wall: Numbers  # (N,) m
    damped: Numbers  # (N,) s: c/k where the force is zero at the event
    by_phase: Numbers  # (N,) derivative of a section
    impulse: Numbers  # (N, d) change of p' by a unit approach speed


def _rows(hybrid: HybridSystem, sequence: Sequence) -> _Rows:
    count, d = len(sequence.kind), hybrid.mass.size
    contact = hybrid.gaps, hybrid.restitution, hybrid.contact_stiffness, hybrid.contact_damping
    kind = np.result_type(float, hybrid.mass, *contact)
    rows = _Rows(*(np.zeros(shape, dtype=kind) for shape in ((count, d), count, count, count, count, (count, d))))
    for k, (name, j, side) in enumerate(zip(sequence.kind, sequence.pair.tolist(), sequence.side, strict=True)):
        if name == SECTION:
            rows.by_phase[k] = 1.0
            continue
        rows.gap[k], rows.in_space[k] = -side * hybrid.force[:, j], -side * hybrid.in_space[j]
        rows.wall[k] = hybrid.gaps[j, 0 if side > 0 else 1]
        if name == IMPACT:
            push = hybrid.force[:, j] / hybrid.mass
            rows.impulse[k] = side * (1.0 + hybrid.restitution[j]) / (hybrid.force[:, j] @ push) * push
        elif name in (RELEASE, PRESS_AGAIN):
            rows.damped[k] = hybrid.contact_damping[j] / hybrid.contact_stiffness[j]
    return rows


def event_maps(hybrid: HybridSystem, events: EventStates) -> EventMaps:
    """The maps from each event to the next."""
    sequence, states, phases = events.sequence, events.states, events.phases
    last = np.arange(phases.size) - 1
    start, begin = states[last], phases[last]
    begin[0] -= sequence.turn
    # a wall that springs back behind its body does not act
    after = np.where(np.abs(sequence.contact_state) == CONTACT, sequence.contact_state, 0.0)
    before = after[last]
    if sequence.is_half:
        start[0], before[0] = 0.0 - start[0], 0.0 - before[0]
    arrived, propagator = _flown(hybrid, before, start, begin, phases)
    rows, d = _rows(hybrid, sequence), hybrid.mass.size
    nothing = np.zeros_like(rows.gap)
    speed_row = np.concatenate([nothing, rows.gap], axis=1)
    base, base_rate = hybrid.amplitude * np.sin(phases), hybrid.amplitude * np.cos(phases)
    speed = (speed_row * arrived).sum(axis=1) + rows.in_space * hybrid.omega * base_rate
    speed_by_phase = -rows.in_space * hybrid.omega * base
    depth = (rows.gap * arrived[:, :d]).sum(axis=1) + rows.in_space * base - rows.wall
    impulse = np.concatenate([nothing, rows.impulse], axis=1)
    jumped = arrived + impulse * speed[:, None]
    return EventMaps(
        hybrid=hybrid,
        events=events,
        propagator=propagator,
        arrived=arrived,
        field_before=_fields(hybrid, before, start, begin),
        field_arrived=_fields(hybrid, before, arrived, phases),
        field_after=_fields(hybrid, after, jumped, phases),
        row=np.concatenate([rows.gap, rows.damped[:, None] * rows.gap], axis=1),
        distance=depth + rows.damped * speed + rows.by_phase * (phases - sequence.section),
        distance_by_phase=rows.in_space * base_rate + rows.damped * speed_by_phase + rows.by_phase,
        impulse=impulse,
        speed_row=speed_row,
        speed=speed,
        speed_by_phase=speed_by_phase,
        jumped=jumped,
    )


def _by_state(contact_state: Array) -> list[tuple[Array, NDArray[np.intp]]]:
    """Distinct contact states and the numbers of the events that have each, of (N, pairs)."""
    groups: dict[bytes, list[int]] = {}
    for k, state in enumerate(contact_state):
        groups.setdefault(state.tobytes(), []).append(k)
    return [(contact_state[members[0]], np.array(members)) for members in groups.values()]


def _flown(
    hybrid: HybridSystem, contact_state: Array, start: Numbers, begin: Numbers, end: Numbers
) -> tuple[Numbers, Numbers]:
    """States (N, 2d) at phases after others, with nothing between, and the propagators."""
    groups = _by_state(contact_state)
    parts = [hybrid.flow(state).carried(start[members], begin[members], end[members]) for state, members in groups]
    order = np.argsort(np.concatenate([members for _, members in groups]))
    arrived, propagator = (np.concatenate(arrays)[order] for arrays in zip(*parts, strict=True))
    return arrived, propagator


def _fields(hybrid: HybridSystem, contact_state: Array, states: Numbers, phases: Numbers) -> Numbers:
    """Rates z' (N, 2d) of states (N, 2d) in their contact states."""
    rates = np.zeros(states.shape, dtype=np.result_type(states, phases))
    for state, members in _by_state(contact_state):
        rates[members] = hybrid.flow(state).field(states[members], phases[members])
    return rates


def residual(maps: EventMaps) -> Numbers:
    """(N, 2d + 1): the states less those that the events make, and h."""
    return np.concatenate([maps.events.states - maps.jumped, maps.distance[:, None]], axis=1)


def jacobian(maps: EventMaps) -> Numbers:
    """Derivatives of `residual` by the states and phases, (N, 2d + 1, N, 2d + 1)."""
    count, size = maps.row.shape
    jump, omega = maps.jump, maps.hybrid.omega
    matrix = np.zeros((count, size + 1, count, size + 1), dtype=maps.propagator.dtype)
    event, before = np.arange(count), np.arange(count) - 1
    # of z- by the state and the phase of the event before
    by_before = np.concatenate([maps.propagator, -(maps.propagator @ maps.field_before[:, :, None]) / omega], axis=2)
    if maps.events.sequence.is_half:
        by_before[0, :, :size] *= -1.0
    matrix[event, :size, before] = -jump @ by_before
    matrix[event, size, before] = (maps.row[:, None, :] @ by_before)[:, 0]
    # with one event it is the event itself
    matrix[event, :size, event, :size] += np.eye(size)
    matrix[event, :size, event, size] -= maps.jumped_by_phase
    matrix[event, size, event, size] += maps.distance_rate
    return matrix


def derivative_by(hybrid_at: Callable[[complex], HybridSystem], value: float, events: EventStates) -> Array:
    """Derivative of `residual` by a number of the system, (N, 2d + 1), exact to rounding by a complex step."""
    step = STEP * max(abs(value), 1.0)
    maps = event_maps(hybrid_at(complex(value, step)), replace(events, states=events.states.astype(complex)))
    return np.asarray(residual(maps).imag) / step


def state_unit(length: float, omega: Any, coordinates: int) -> Array:
    """Units (2d,) of a state: a length (m), and that times omega."""
    return np.repeat([length, length * float(omega)], coordinates)


def units_of(hybrid: HybridSystem, sequence: Sequence, length: float) -> tuple[Array, Array]:
    """Units (2d + 1,) of the states and the phase of an event, and of its rows in `residual`."""
    state = state_unit(length, hybrid.omega, hybrid.mass.size)
    # h is a length, or the phase of a section
    return np.append(state, 1.0), np.append(state, length if sequence.pair.max(initial=-1) >= 0 else 1.0)


def product(steps: Array) -> Array:
    """Product of matrices, the first one applied first."""
    return np.asarray(reduce(lambda matrix, step: step @ matrix, steps, np.eye(steps.shape[1])))


def multipliers_of(matrix: Array) -> Complex:
    """Eigenvalues of a map, the largest modulus first."""
    values = np.linalg.eigvals(matrix).astype(complex)
    multipliers = np.asarray(values[np.argsort(-np.abs(values), kind="stable")])
    multipliers.setflags(write=False)
    return multipliers
