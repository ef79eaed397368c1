"""Periodic motions with rigid impacts in closed form: a stop, a ball in a box on an oscillator, a light ball."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.laws import Rigid
from femimpact.excitation.drives import Drives, PointForce
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import integrate
from femimpact.orbits.orbit import PeriodicOrbit
from femimpact.orbits.search import two_impact_orbits
from femimpact.structure.structure import Impactor, Stop
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case
from femimpact.validation.closed_forms import stop_orbits
from femimpact.validation.contacts import shaken_floor

ORBITS = (
    # mass ratio, restitution, damping ratio, frequency ratio, total clearance; speed of the ball; largest eigenvalue
    (0.1, 0.8, 0.01, 1.0, 20.0, 7.696818, 0.9515),
    (0.1, 0.6, 0.01, 1.0, 24.0, 7.527982, 0.8785),
    (0.05, 0.7, 0.005, 1.0, 40.0, 15.249852, 0.9604),
    (0.1, 0.8, 0.01, 0.98, 20.0, 9.475270, 1.2605),
)
"""Two impacts in each cycle, M = K = F = 1: the project's table, compared with an event-driven simulation before."""

Orbit = tuple[float, float, float, float, float, float, float]


# ---- an oscillator that hits one stop ------------------------------------------------------------


def stop_once_a_cycle(omega: float, stop: float) -> Case:
    """An oscillator pushed by a sine against one rigid stop, one impact in each cycle."""
    damping, restitution = 0.05, 0.8
    speed, phase, _ = stop_orbits(damping, restitution, omega, stop)[-1]
    wall = Stop("wall", "tip", (stop, math.inf), Rigid(restitution))
    system = System.from_matrices([[1.0]], [[2 * damping]], [[1.0]], points={"tip": [1.0]}, stops=[wall])
    push = PointForce("tip", Sine(1.0, omega / (2 * math.pi), phase))
    # 1 % too fast: the motion has to find the orbit
    start = State([stop], [-1.01 * restitution * speed])
    run = integrate(system, push, EventDriven(), 400 * 2 * math.pi / omega, initial=start)
    return Case(
        f"oscillator against a stop at {stop:g}, {omega:g} w0", "derived here (linear half of the orbit)",
        "impact speed after 400 cycles", "m/s", speed, float(run.impacts.approach_speed[-1]), 1e-11,
        "rounding; the start's 1 % have decayed",
    )  # fmt: skip


def several_forces() -> Case:
    """The same under two sines of force at one place, together one: the phase at its impacts is that of their sum."""
    damping, restitution, omega = 0.05, 0.8, 2.5
    speed, phase, _ = stop_orbits(damping, restitution, omega, 0.0)[-1]
    wall = Stop("wall", "tip", (0.0, math.inf), Rigid(restitution))
    system = System.from_matrices([[1.0]], [[2 * damping]], [[1.0]], points={"tip": [1.0]}, stops=[wall])
    both = (PointForce("tip", Sine(1.0, omega / (2 * math.pi), phase + sign * math.pi / 3)) for sign in (1, -1))
    start = State([0.0], [-1.01 * restitution * speed])
    run = integrate(system, Drives(forces=tuple(both)), EventDriven(), 400 * 2 * math.pi / omega, initial=start)
    return Case(
        "oscillator against a stop under two forces at one place", "derived here (linear half of the orbit)",
        "phase of the impact after 400 cycles", "rad", phase % (2 * math.pi), float(run.impacts.phase[-1]), 1e-9,
        "rounding; the start's 1 % have decayed",
    )  # fmt: skip


# ---- a ball between two walls on an oscillator ---------------------------------------------------


def _two_impacts(orbit: Orbit) -> PeriodicOrbit:
    """The faster of the orbits in closed form."""
    mu, e, zeta, ratio, clearance, *_ = orbit
    ball = Impactor("ball", "tip", mu, clearance / 2, Rigid(e))
    system = System.from_matrices([[1.0]], [[2 * zeta]], [[1.0]], points={"tip": [1.0]}, impactors=[ball])
    return two_impact_orbits(system, PointForce("tip", Sine(1.0, ratio / (2 * math.pi))))[0]


def _approach_speeds(orbit: Orbit, off: float, cycles: int) -> NDArray[np.float64]:
    """Approach speeds of a run started beside the orbit, the ball `off` too fast."""
    exact = _two_impacts(orbit)
    start = replace(exact.state, ball_velocity=(1 + off) * np.asarray(exact.state.ball_velocity))
    run = integrate(exact.system, exact.excitation, EventDriven(), cycles * exact.period, initial=start)
    return np.asarray(run.impacts.approach_speed)


def _settled_speed(orbit: Orbit) -> float:
    """Ball's speed of the run: a stable orbit is found from 1 % off, the unstable one is followed for ten impacts."""
    mu, e, *_, growth = orbit
    speeds = _approach_speeds(orbit, 0.01, 200) if growth < 1 else _approach_speeds(orbit, 0.0, 5)
    return float(speeds[-1]) * (1 + e) / (2 * (1 + mu))


def _label(orbit: Orbit) -> str:
    mu, e, _, ratio, *_, growth = orbit
    return f"ball in a box, mu = {mu:g}, e = {e:g}, {ratio:g} w0 ({'stable' if growth < 1 else 'unstable'})"


def box_speed(orbit: Orbit) -> Case:
    """Speed of the ball, two impacts in each cycle."""
    return Case(
        f"{_label(orbit)}: speed", "derived here (half-cycle map)", "speed of the ball", "m/s", orbit[5],
        _settled_speed(orbit), 5.1e-7 / orbit[5], "6 decimals of the table",
    )  # fmt: skip


def box_eigenvalue(orbit: Orbit) -> Case:
    """Largest eigenvalue of the half-cycle map, from how a small disturbance grows or decays."""
    growth = orbit[-1]
    exact = float(_two_impacts(orbit).impacts.approach_speed[0])
    off = _approach_speeds(orbit, 1e-7, 20)[:36] / exact - 1
    # four states at an impact: the deviations obey a recurrence of order four
    columns = np.column_stack([off[k : off.size - 4 + k] for k in range(4)])
    # each equation in units of its size, for one that grows
    weight = 1 / np.max(np.abs(columns), axis=1)
    factors = np.linalg.lstsq(weight[:, None] * columns, weight * off[4:])[0]
    largest = float(np.max(np.abs(np.roots([1.0, *-factors[::-1]]))))
    return Case(
        f"{_label(orbit)}: growth", "derived here (half-cycle map)", "largest eigenvalue, absolute", "1", growth,
        largest, 1e-4, "4 decimals of the table; the disturbance of 1e-7 is small, not infinitely so",
    )  # fmt: skip


# ---- a light ball --------------------------------------------------------------------------------


def light_ball(restitution: float) -> Case:
    """Largest damping ratio that a light ball adds, over the mass ratio: (2/pi) (1 + e)/(1 - e).

    It is reached at the amplitude 2 s/pi of the half clearance, s = (1 - e)/(1 + e): impacts fall
    where the box is at its centre. A box that moves as a sine whatever the ball does is this limit.
    """
    sigma, half, frequency = (1 - restitution) / (1 + restitution), 4e-3, 5.0
    omega = 2 * math.pi * frequency
    box = Sine(2 * sigma / math.pi * half, frequency, math.pi)
    speed = 2 * half * omega / math.pi
    # 1 % too fast, seen from the box
    start = State(ball_displacement=[half], ball_velocity=[-1.01 * speed * (1 - sigma)])
    run = integrate(shaken_floor(restitution, (half, half)), box, EventDriven(), 300 / frequency, initial=start)
    # a damping ratio z takes 2 pi z M w^2 a^2 in each cycle; the ball's mass here is 1
    loss = 2 * float(run.impacts.energy_loss[-1])
    return Case(
        f"light ball, e = {restitution:g}: largest damping", "derived here (slow invariant manifold)",
        "damping ratio over mass ratio", "1", 2 / (math.pi * sigma),
        loss / (2 * math.pi * (omega * box.amplitude) ** 2), 1e-10, "rounding; the start's 1 % have decayed",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    *(partial(stop_once_a_cycle, omega, stop) for omega, stop in ((1.5, 0.0), (2.0, 0.3), (2.5, 0.0))),
    several_forces,
    *(partial(check, orbit) for orbit in ORBITS for check in (box_speed, box_eigenvalue)),
    *(partial(light_ball, e) for e in (0.3, 0.5, 0.7)),
)
"""The cases of this subject, in the order of the table."""
