"""scipy's LSODA with events: the integrator stops where a gap closes and where the force has gone to zero."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

NAME = "scipy LSODA with events"
SPACE = "8 modes"
MODES = 8
SETTINGS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
READ = 1e-3
"""Seconds between two values read: the tip's history needs no more."""


def missing() -> str:
    """Scipy is always there."""
    return ""


def usual(task) -> float:
    """Relative tolerance; the absolute one is a thousandth of it (m, m/s)."""
    return 1e-8


def history(problem, task, frequency, duration, setting, method="LSODA"):
    """The tip at even instants."""
    motion = _Motion(problem.modal(ball=task.ball), problem.amplitude, frequency)
    time, state, phase, leaving = 0.0, np.zeros(2 * motion.n + 2), 0, 0
    wanted = READ * np.arange(1, round(duration / READ) + 1)
    times, tips = [], []
    while time < duration:
        changes = motion.changes(phase, leaving) if task.ball else []
        run = solve_ivp(
            motion.derivative(phase), (time, duration), state, method=method, rtol=setting, atol=1e-3 * setting,
            t_eval=wanted[wanted > time], events=[change[0] for change in changes] or None,
        )  # fmt: skip
        if len(run.t):
            times.append(run.t)
            tips.append(run.y[: motion.n].T @ motion.tip)
        if run.status != 1:
            break
        _, next_phase, next_leaving = next(c for c, t in zip(changes, run.t_events, strict=True) if t.size)
        time = next(t[0] for t in run.t_events if t.size)
        state = next(y[0] for y in run.y_events if y.size)
        phase, leaving = next_phase, next_leaving
    return np.concatenate(times), np.concatenate(tips)


class _Motion:
    """Right-hand sides and events. State: q, q', y, y'. Phases: 0 without contact, +1 and -1 pressed against a wall."""

    def __init__(self, system, amplitude, frequency):
        self.n, self.tip = system.dofs, system.point_row("tip")
        self.k, self.c, self.load = system.K.diagonal(), system.C.diagonal(), system.base_load
        self.omega = 2.0 * np.pi * frequency
        self.top = -amplitude * self.omega**2
        self.pair = system.contacts[0] if system.contacts else None

    def force(self, state, side):
        """Of the wall on the ball, towards the centre; negative where it would pull."""
        return self.pair.parameters.stiffness * self.depth(state, side) + self.pair.parameters.damping * side * (
            state[-1] - self.pair.direction @ state[self.n : 2 * self.n]
        )

    def depth(self, state, side):
        """How far the ball is inside a wall, m."""
        gap = self.pair.gaps[0 if side > 0 else 1]
        return side * (state[-2] - self.pair.direction @ state[: self.n]) - gap

    def derivative(self, phase):
        """Of the state, in one phase."""
        n, out = self.n, np.zeros(2 * self.n + 2)

        def f(t, state):
            acting = self.top * np.sin(self.omega * t)
            rates = out.copy()
            rates[:n] = state[n : 2 * n]
            rates[n : 2 * n] = -self.load * acting - self.c * state[n : 2 * n] - self.k * state[:n]
            rates[-2], rates[-1] = state[-1], -acting
            if phase:
                push = phase * self.force(state, phase)
                rates[n : 2 * n] += self.pair.direction * push
                rates[-1] -= push / self.pair.mass
            return rates

        return f

    def changes(self, phase, leaving):
        """Events that end a phase, each with the phase and the wall being left that follow."""
        if phase:
            return [(_event(lambda s: self.force(s, phase), -1), 0, phase)]
        found = [(_event(lambda s, w=side: self.depth(s, w), 1), side, 0) for side in (1, -1) if side != leaving]
        if leaving:
            found.append((_event(lambda s: self.force(s, leaving), 1), leaving, 0))
            found.append((_event(lambda s: self.depth(s, leaving), -1), 0, 0))
        return found


def _event(value, direction):
    def event(t, state):
        return value(state)

    event.terminal, event.direction = True, direction
    return event
