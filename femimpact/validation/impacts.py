"""Rigid impacts in closed form: collisions, a bouncing ball, a ball on a vibrating table."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from femimpact.contact import Rigid
from femimpact.excitation import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.integrate import integrate
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Impactor, Stop
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case

__all__ = ["CASES", "free_masses", "shaken_floor"]

GRAVITY = 9.81
FREQUENCY = 20.0
"""Of the vibrating table, Hz."""


def free_masses(masses: list[float], restitution: float) -> System:
    """Bodies in a row, free and in touch when their displacements are equal: each meets the next one only."""
    n = len(masses)
    points = {f"mass {i}": np.eye(n)[i] for i in range(n)}
    points |= {f"between {i}": np.eye(n)[i] - np.eye(n)[i + 1] for i in range(n - 1)}
    stops = [Stop(f"contact {i}", f"between {i}", (0.0, math.inf), Rigid(restitution)) for i in range(n - 1)]
    zero = np.zeros((n, n))
    return System.from_matrices(np.diag(masses), zero, zero, points=points, stops=stops)


def shaken_floor(restitution: float, gap: tuple[float, float], acceleration: float = 0.0) -> System:
    """A ball between walls that move with the base: the structure has no motion where the ball is."""
    ball = Impactor("ball", "floor", 1.0, gap, Rigid(restitution), acceleration=acceleration)
    return System.from_matrices([[1.0]], [[0.1]], [[1.0]], points={"floor": [0.0]}, impactors=[ball])


def _collision_run(masses: list[float], restitution: float) -> Response:
    """The first body sent against the others with 2 m/s from 1 m away."""
    n = len(masses)
    start = State(displacement=[-1.0] + [0.0] * (n - 1), velocity=[2.0] + [0.0] * (n - 1))
    channels = tuple(f"mass {i}.velocity" for i in range(n))
    return integrate(
        free_masses(masses, restitution), Sine(0.0, 1.0), EventDriven(), 1.0, Recorder(channels), start
    )  # fmt: skip


def collision(body: int, restitution: float) -> Case:
    """Velocities after a collision of two free bodies, from momentum and restitution."""
    m = [0.3, 0.7]
    common = 2.0 * m[0] / sum(m)
    # in the frame of the centre of mass each velocity is turned and multiplied by e
    reference = common - restitution * (2.0 - common) if body == 0 else common + restitution * common
    return Case(
        f"collision of 0.3 and 0.7 kg, e = {restitution:g}, body {body + 1}",
        "derived here (momentum and restitution)", "velocity after", "m/s", reference,
        float(_collision_run(m, restitution)[f"mass {body}.velocity"][-1]), 1e-12, "rounding",
    )  # fmt: skip


def cradle() -> Case:
    """Newton's cradle: the last of five equal bodies in touch leaves with the first one's speed."""
    run = _collision_run([1.0] * 5, 1.0)
    final = np.array([run[f"mass {i}.velocity"][-1] for i in range(5)])
    return Case(
        "Newton's cradle of five", "derived here (momentum and energy)", "largest error of the five velocities", "m/s",
        0.0, float(np.max(np.abs(final - [0, 0, 0, 0, 2.0]))), 1e-12, "rounding",
    )  # fmt: skip


def ball_comes_to_rest(restitution: float) -> Case:
    """A dropped ball rests after v/g + 2 e v/(g (1 - e)), v = sqrt(2 g h)."""
    height = 4e-3
    speed = math.sqrt(2 * GRAVITY * height)
    rest = speed / GRAVITY + 2 * restitution * speed / (GRAVITY * (1 - restitution))
    system = shaken_floor(restitution, (1.0, height), -GRAVITY)
    run = integrate(system, Sine(0.0, 5.0), EventDriven(), rest + 0.1, Recorder(("ball",)))
    found = float(run.sticking.start[0]) if run.sticking.start.size == 1 else math.nan
    return Case(
        f"bouncing ball, e = {restitution:g}", "derived here (geometric series)", "time to rest", "s", rest, found,
        1e-12, "rounding; bounces below the closure of 1e-12 m are summed in closed form",
    )  # fmt: skip


def ball_leaves_the_table() -> Case:
    """A ball at rest on a table A sin(w t) leaves it where A w^2 sin(theta) = g."""
    gain = 1.3
    table = Sine(gain * GRAVITY / (2 * math.pi * FREQUENCY) ** 2, FREQUENCY)
    run = integrate(shaken_floor(0.4, (1.0, 0.0), -GRAVITY), table, EventDriven(), 2.0)
    phase = np.mod(table.omega * run.sticking.end[:-1], 2 * math.pi)
    exact = math.asin(1 / gain)
    worst = float(phase[np.argmax(np.abs(phase - exact))]) if phase.size else math.nan
    return Case(
        "ball on a vibrating table: it leaves", "derived here (A w^2 sin = g)", "phase of leaving, the worst of 2 s",
        "rad", exact, worst, 1e-9, "rounding of t w at t = 2 s",
    )  # fmt: skip


def ball_bounces_once_a_cycle(restitution: float) -> Case:
    """One bounce in each cycle: cos(theta) = pi g (1 - e)/((1 + e) A w^2).

    A free motion of one period from and to the same height starts with v = g T/2 and ends with -v. The
    impact demands v - A w cos(theta) = e (v + A w cos(theta)).
    """
    pull = math.pi * GRAVITY * (1 - restitution) / (1 + restitution)
    # 1.3: theta = 0.69, where the bounce is stable
    omega = 2 * math.pi * FREQUENCY
    theta = math.acos(1 / 1.3)
    table = Sine(1.3 * pull / omega**2, FREQUENCY, theta)
    rebound = GRAVITY / (2 * FREQUENCY) - table.amplitude * omega * math.cos(theta)
    # 2 % too fast: the motion has to find the orbit
    start = State(ball_displacement=[0.0], ball_velocity=[1.02 * rebound])
    run = integrate(
        shaken_floor(restitution, (1.0, 0.0), -GRAVITY), table, EventDriven(), 400 / FREQUENCY, initial=start
    )  # fmt: skip
    return Case(
        f"ball on a vibrating table: once a cycle, e = {restitution:g}", "derived here (as Holmes, 1982)",
        "phase of the impact after 400 cycles", "rad", theta, float(run.impacts.phase[-1]), 1e-9,
        "rounding of t w at 400 cycles; the start's 2 % have decayed",
    )  # fmt: skip


def ball_is_left() -> Case:
    """A ball that falls on a free table without rebound stops it alone: what lies there is left by its table.

    With the ball that lies there the impulse would be v/(1/m + 1/(M + m')).
    """
    table, lying, falling, height = 1.0, 0.5, 0.2, 4e-3
    balls = [
        Impactor(name, "table", mass, (1.0, gap), Rigid(0.0), acceleration=-pull)
        for name, mass, gap, pull in (("lying", lying, 0.0, GRAVITY), ("falling", falling, height, 3 * GRAVITY))
    ]
    zero = np.zeros((1, 1))
    system = System.from_matrices([[table]], zero, zero, points={"table": [1.0]}, impactors=balls)
    run = integrate(system, Sine(0.0, 50.0), EventDriven(), 0.04)
    # table and ball are pulled together by the weight of the ball
    speed = math.sqrt(2 * (3 * GRAVITY - lying * GRAVITY / (table + lying)) * height)
    hit = run.impacts.impactor == "falling"
    return Case(
        "ball that falls beside one that lies on a free table", "derived here (momentum)", "impulse of its impact",
        "N s", speed / (1 / falling + 1 / table), float(run.impacts.impulse[hit][0]), 1e-11, "rounding",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    *(partial(collision, body, e) for e in (0.0, 0.6, 1.0) for body in (0, 1)),
    cradle,
    *(partial(ball_comes_to_rest, e) for e in (0.3, 0.7, 0.95)),
    ball_leaves_the_table,
    ball_is_left,
    *(partial(ball_bounces_once_a_cycle, e) for e in (0.5, 0.8)),
)
"""The cases of this subject, in the order of the table."""
