"""The motion from one snapshot to the next, through the recorded events between them.

Between events structure and balls are one linear system, whose propagator is a matrix exponential: the excitation is
part of the state. A rigid impact is the recorded impulse. A ball that sticks to its wall, or the beam to a stop, is
held by a constraint. A compliant contact acts from the recorded touch on for the recorded duration: one of
Kelvin-Voigt is linear and belongs to the propagator, the force of any other law is taken along it by the Runge-Kutta
scheme of order 4 of Lawson (1967).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg

from femimpact.arrays import Array
from femimpact.contact.law import contact_force
from femimpact.contact.laws import KELVIN_VOIGT
from femimpact.integrators.channel_rows import Drive, drive_of
from femimpact.response.response import Response
from femimpact.system.contact_pair import ContactPair
from femimpact.system.system import System

STEPS_OF_CONTACT = 100
"""Steps of the Runge-Kutta scheme in one contact."""

JUST_INSIDE = 1e-15
"""Depth (m) at which a touch begins."""

SAMPLES_OF_HISTORY = 64
"""Straight lines that stand for an excitation without a closed form between two snapshots."""


@dataclass(frozen=True)
class Touching:
    """A contact that goes on: its pair, its side (+1 or -1), its approach speed (m/s) and its duration (s)."""

    pair: int
    side: int
    approach_speed: float = 0.0
    duration: float = math.inf


@dataclass(eq=False)
class Transition:
    """Matrices of a system with its balls, for the state (u, y, u', y', two of the excitation, 1)."""

    response: Response  # of a system whose matrices are small enough to be dense
    system: System = field(init=False)
    drive: Drive = field(init=False)
    inverse: Array = field(init=False)
    rows: Array = field(init=False)
    _known: dict[Any, Array] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.system = self.response.system
        self.drive = drive_of(self.system, self.response.base)
        balls = self.system.balls
        masses = np.diag([pair.mass for pair in balls])
        mass = scipy.linalg.block_diag(self.system.M.toarray(), masses) if balls else self.system.M.toarray()
        self.inverse = np.asarray(np.linalg.inv(mass), dtype=float)
        # x_j = rows_j (u, y) is what the gaps bound, but for a stop in space
        directions = np.array([pair.direction for pair in self.system.contacts]).reshape(-1, self.system.dofs)
        self.rows = np.hstack([-directions, np.eye(len(directions), len(balls))])
        for j, (first, second) in self.system.meetings.items():
            self.rows[j, self.system.dofs + np.array([first, second])] = 1.0, -1.0

    @property
    def size(self) -> int:
        """Number of dofs of structure and balls."""
        return int(self.inverse.shape[0])

    def state(self, nodal: Array, rates: Array, balls: Array, speeds: Array) -> Array:
        """The state of a snapshot: the only one of the system's dofs with these nodal values."""
        expansion: Any = self.system.expansion
        expansion = expansion if isinstance(expansion, np.ndarray) else expansion.toarray()
        u, v = np.linalg.lstsq(expansion, np.column_stack([nodal, rates]), rcond=None)[0].T
        return np.concatenate([u, balls, v, speeds, np.zeros(2), [1.0]])

    def nodal(self, state: Array) -> tuple[Array, Array, Array, Array]:
        """Nodal displacements and velocities, and those of the balls."""
        n, size = self.system.dofs, self.size
        u, y, v, rate = np.split(state[: 2 * size], [n, size, size + n])
        return np.asarray(self.system.expansion @ u), np.asarray(self.system.expansion @ v), y, rate

    def gap_motion(self, state: Array, j: int, time: float) -> tuple[float, float]:
        """Gap coordinate x (m) of a pair, ball or stop minus structure, and its rate."""
        n, pair = self.size, self.system.contacts[j]
        x, rate = float(self.rows[j] @ state[:n]), float(self.rows[j] @ state[n : 2 * n])
        if pair.fixed_to == "space":
            base = self.response.base
            x, rate = x + float(base.displacement(time)), rate + float(base.velocity(time))
        return x, rate

    def force(self, state: Array, touch: Touching, time: float) -> float:
        """Contact force (N) of the sign of its side; 0 of a rigid contact."""
        pair: ContactPair = self.system.contacts[touch.pair]
        if pair.parameters.is_rigid:
            return 0.0
        x, rate = self.gap_motion(state, touch.pair, time)
        # on the wall itself a dashpot's force would be zero
        depth = max(touch.side * x - pair.gaps[0 if touch.side > 0 else 1], JUST_INSIDE)
        normal = contact_force(pair.law, depth, touch.side * rate, touch.approach_speed, pair.effective_mass)
        return touch.side * normal

    def struck(self, state: Array, impulse: float, j: int, sticking: frozenset[int]) -> Array:
        """The state after an impulse (N s) of a pair, of the sign of its side."""
        after, n = state.copy(), self.size
        after[n : 2 * n] -= self._free(sticking) @ self.inverse @ self.rows[j] * impulse
        return after

    def held(self, state: Array, sticking: frozenset[int], time: float) -> Array:
        """The state with the relative speeds of sticking pairs taken out."""
        after, n = state.copy(), self.size
        chosen = sorted(sticking)
        rates = [self.gap_motion(state, j, time)[1] for j in chosen]
        rows = self.rows[chosen]
        along = self.inverse @ rows.T
        after[n : 2 * n] -= along @ np.linalg.solve(rows @ along, rates)
        return after

    def moved(
        self, state: Array, start: float, end: float, touching: tuple[Touching, ...], sticking: frozenset[int]
    ) -> Array:
        """The state at `end`, with no event in between."""
        compliant = [touch for touch in touching if not self.system.contacts[touch.pair].parameters.is_rigid]
        # a stop fixed in space has the base's motion in its force, which is not linear in the state
        pairs = self.system.contacts
        linear = frozenset(
            (touch.pair, touch.side)
            for touch in compliant
            if pairs[touch.pair].parameters.kind == KELVIN_VOIGT and pairs[touch.pair].fixed_to == "base"
        )
        nonlinear = [touch for touch in compliant if (touch.pair, touch.side) not in linear]
        if (sticking, linear) not in self._known:
            self._known[sticking, linear] = self._matrix(sticking, linear)
        knots, matrix = self._knots(start, end), self._known[sticking, linear]
        shortest = min((touch.duration for touch in nonlinear if touch.duration > 0.0), default=math.inf)
        for a, b in itertools.pairwise(knots):
            state = self._driven(state, a, b)
            steps = max(math.ceil(STEPS_OF_CONTACT * (b - a) / shortest), 4) if nonlinear else 1
            h = (b - a) / steps
            full = scipy.linalg.expm(matrix * h)
            if not nonlinear:
                state = full @ state
                continue
            half = scipy.linalg.expm(matrix * (0.5 * h))
            for i in range(steps):
                state = self._pushed(state, a + i * h, h, full, half, nonlinear, sticking)
        return state

    # ---- what it is made of ------------------------------------------------------------------------

    def _pushed(
        self, state: Array, time: float, h: float, full: Array, half: Array, nonlinear: list[Touching],
        sticking: frozenset[int],
    ) -> Array:  # fmt: skip
        """One step with contact forces: Lawson's scheme of order 4."""
        n, free = self.size, self._free(sticking) @ self.inverse
        columns = [free @ self.rows[touch.pair] for touch in nonlinear]

        def push(now: Array, at: float) -> Array:
            rate = np.zeros_like(now)
            for touch, column in zip(nonlinear, columns, strict=True):
                rate[n : 2 * n] -= column * self.force(now, touch, at)
            return rate

        first = push(state, time)
        ahead = half @ state
        second = push(half @ (state + 0.5 * h * first), time + 0.5 * h)
        third = push(ahead + 0.5 * h * second, time + 0.5 * h)
        fourth = push(full @ state + h * (half @ third), time + h)
        return np.asarray(full @ (state + h / 6.0 * first) + half @ (h / 3.0 * (second + third)) + h / 6.0 * fourth)

    def _free(self, sticking: frozenset[int]) -> Array:
        """Takes the constrained share out of velocities or accelerations."""
        if not sticking:
            return np.eye(self.size)
        rows = self.rows[sorted(sticking)]
        along = self.inverse @ rows.T
        return np.asarray(np.eye(self.size) - along @ np.linalg.solve(rows @ along, rows))

    def _matrix(self, sticking: frozenset[int], linear: frozenset[tuple[int, int]]) -> Array:
        """Rate of the state, as a matrix, with pairs that stick and contacts (pair, side) of spring and dashpot."""
        system, n, u = self.system, self.size, self.system.dofs
        stiffness, damping, preload = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        stiffness[:u, :u], damping[:u, :u] = system.K.toarray(), system.C.toarray()
        for row, pair in zip(self.rows, system.contacts, strict=True):
            stiffness += pair.free_stiffness * np.outer(row, row)
            damping += pair.free_damping * np.outer(row, row)
        for j, side in linear:
            row, pair = self.rows[j], system.contacts[j]
            stiffness += pair.parameters.stiffness * np.outer(row, row)
            damping += pair.parameters.damping * np.outer(row, row)
            preload += side * pair.parameters.stiffness * pair.gaps[0 if side > 0 else 1] * row
        masses = np.array([pair.mass for pair in system.balls])
        load = np.concatenate([self.drive.load, -self.drive.share * masses])
        accelerations = np.array([pair.acceleration for pair in system.balls])
        constant = np.concatenate([system.constant_load, masses * accelerations]) + preload
        free = self._free(sticking) @ self.inverse
        driven = free @ load
        if sticking:
            # a stop in space has the base's acceleration, with the sign opposite, in the frame of the base
            chosen = sorted(sticking)
            rows = self.rows[chosen]
            moving = np.array([float(system.contacts[j].fixed_to == "space") for j in chosen])
            along = self.inverse @ rows.T
            driven = driven - self.drive.share * along @ np.linalg.solve(rows @ along, moving)
        matrix = np.zeros((2 * n + 3, 2 * n + 3))
        matrix[:n, n : 2 * n] = np.eye(n)
        matrix[n : 2 * n, :n], matrix[n : 2 * n, n : 2 * n] = -free @ stiffness, -free @ damping
        matrix[n : 2 * n, 2 * n], matrix[n : 2 * n, -1] = driven, free @ constant
        wave = self.drive.closed_form if self.drive.is_sine else None
        # a sine and its cosine, or a value and its slope
        matrix[2 * n, 2 * n + 1] = self.drive.sine.omega if wave is not None else 1.0
        matrix[2 * n + 1, 2 * n] = -self.drive.sine.omega if wave is not None else 0.0
        return matrix

    def _driven(self, state: Array, start: float, end: float) -> Array:
        """The state with the excitation's part set for a time in which it has no corner."""
        state, n = state.copy(), self.size
        if self.drive.is_sine:
            wave = self.drive.sine
            angle = wave.omega * start + wave.phase
            state[2 * n : 2 * n + 2] = wave.amplitude * np.array([math.sin(angle), math.cos(angle)])
            return state
        inner = start + np.array([0.25, 0.75]) * (end - start)
        early, late = self.drive.value(inner)
        slope = (late - early) / (inner[1] - inner[0])
        state[2 * n : 2 * n + 2] = early - 0.25 * slope * (end - start), slope
        return state

    def _knots(self, start: float, end: float) -> list[float]:
        """Times from start to end between which the excitation has no corner."""
        if self.drive.is_sine:
            return [start, end]
        line = self.drive.line
        if line is None:
            return list(np.linspace(start, end, SAMPLES_OF_HISTORY + 1))
        first, last = math.floor(start / line.interval) + 1, math.ceil(end / line.interval) - 1
        inner = [line.interval * k for k in range(first, min(last, line.samples.size - 1) + 1)]
        return [start, *(t for t in inner if start < t < end), end]
