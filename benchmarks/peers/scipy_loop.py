"""The loop that one writes with scipy: banded Cholesky of all dofs, one step after the other, in Python."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from femimpact.integrators.stepping.operators import bands

NAME = "scipy banded loop by hand"
SPACE = "20 dofs"
MODES = 20
SETTINGS = (2e-4, 1e-4, 5e-5, 2e-5, 1e-5)


def missing() -> str:
    """Scipy is always there."""
    return ""


def usual(task) -> float:
    """Step that the task asks for, s."""
    return task.dt


def history(problem, task, frequency, duration, setting):
    """The tip after every step of `setting` seconds; Newmark, contact as the scalar equation of the step."""
    system, dt, steps = problem.full(ball=task.ball), setting, round(duration / setting)
    factor = scipy.linalg.cholesky_banded(bands(system.M + 0.5 * dt * system.C + 0.25 * dt * dt * system.K), lower=True)
    C, K, row, load = system.C, system.K, system.point_row("tip"), system.base_load
    ball = _Ball(system.contacts[0], factor, dt) if task.ball else None
    u, v, a = (np.zeros(system.dofs) for _ in range(3))
    tips = np.empty(steps)
    omega = 2.0 * np.pi * frequency
    for n in range(steps):
        acting = -problem.amplitude * omega**2 * np.sin(omega * dt * (n + 1))
        u_predicted = u + dt * v + 0.25 * dt * dt * a
        v_predicted = v + 0.5 * dt * a
        rhs = -load * acting - C @ v_predicted - K @ u_predicted
        a = scipy.linalg.cho_solve_banded((factor, True), rhs, check_finite=False)
        u, v = u_predicted + 0.25 * dt * dt * a, v_predicted + 0.5 * dt * a
        if ball is not None:
            force = ball.step(acting, float(row @ u), float(row @ v))
            if force:
                a = a + ball.h * force
                u, v = u + 0.25 * dt * dt * ball.h * force, v + 0.5 * dt * ball.h * force
        tips[n] = row @ u
    return dt * np.arange(1, steps + 1), tips


class _Ball:
    """The ball between its walls, one step at a time."""

    def __init__(self, pair, factor, dt):
        self.pair, self.dt = pair, dt
        self.h = scipy.linalg.cho_solve_banded((factor, True), pair.direction)
        mobility = 1.0 / pair.mass + pair.direction @ self.h
        law = pair.parameters
        self.yielding = 1.0 + mobility * (0.25 * dt * dt * law.stiffness + 0.5 * dt * law.damping)
        self.y = self.speed = self.acceleration = 0.0

    def step(self, acting, tip, tip_speed):
        """Force of the step, beside the structure's free step."""
        dt, pair = self.dt, self.pair
        self.y += dt * self.speed + 0.25 * dt * dt * (self.acceleration - acting)
        self.speed += 0.5 * dt * (self.acceleration - acting)
        self.acceleration = -acting
        x, rate = self.y - tip, self.speed - tip_speed
        side = 1.0 if x > pair.gaps[0] else -1.0 if x < -pair.gaps[1] else 0.0
        if not side:
            return 0.0
        depth, law = side * x - pair.gaps[0 if side > 0 else 1], pair.parameters
        force = side * max(0.0, law.stiffness * depth + law.damping * side * rate) / self.yielding
        self.y -= 0.25 * dt * dt * force / pair.mass
        self.speed -= 0.5 * dt * force / pair.mass
        self.acceleration -= force / pair.mass
        return force
