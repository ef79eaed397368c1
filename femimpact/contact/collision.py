"""One collision in continuous time: restitution, duration, force and loss of a mass at a wall of a law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from femimpact.contact.restitution import EFFECTIVE_MASS
from femimpact.errors import check_fields, checked, quantity, require


@dataclass(frozen=True)
class Collision:
    """One collision of an effective mass with a wall.

    Parameters
    ----------
    restitution : float, 1
        Rebound over approach speed.
    contact_time : float, s
        From touch to zero force.
    peak_force : float, N
        Not a number for a rigid contact, which has an impulse only.
    largest_penetration : float, m
    energy_loss : float, J
        (1 - e^2) m v^2/2.
    """

    restitution: float = field(metadata=quantity("1", at_least=0.0, finite=False))
    contact_time: float = field(metadata=quantity("s", at_least=0.0, finite=False))
    peak_force: float = field(metadata=quantity("N", at_least=0.0, finite=False))
    largest_penetration: float = field(metadata=quantity("m", at_least=0.0, finite=False))
    energy_loss: float = field(metadata=quantity("J", finite=False))

    def __post_init__(self) -> None:
        check_fields(self)


def mass_and_speed(effective_mass: object, approach_speed: object) -> tuple[float, float]:
    """Mass (kg) and speed (m/s) of a collision, both > 0.

    Raises `InputError` if they are not, or beyond numbers.
    """
    mass = float(checked("effective_mass", effective_mass, EFFECTIVE_MASS))
    speed = float(checked("approach_speed", approach_speed, quantity("m/s", above=0.0)))
    return mass, speed


def collision_of(
    restitution: float, contact_time: float, peak_force: float, largest_penetration: float, effective_mass: float,
    approach_speed: float,
) -> Collision:  # fmt: skip
    """The collision with the energy loss (1 - e^2) m v^2/2 that its restitution gives."""
    loss = 0.5 * effective_mass * approach_speed**2 * (1.0 - restitution * restitution)
    return Collision(restitution, contact_time, peak_force, largest_penetration, loss)


def crest(values: Any) -> float:
    """Largest value, by the parabola through the largest sample and its neighbours."""
    i = int(np.argmax(values))
    if i == 0 or i == values.size - 1:
        return float(values[i])
    before, at, after = values[i - 1 : i + 2]
    return float(at - 0.125 * (after - before) ** 2 / (before + after - 2.0 * at))


def integrated_collision(
    force: Callable[[float, float], float], effective_mass: float, approach_speed: float
) -> Collision:
    """Integrate one collision to 1e-10, with the scale of length taken from the force itself.

    Parameters
    ----------
    force : callable
        Normal force (N), never below zero, at a penetration (m) and its rate (m/s).
    effective_mass : float, kg
    approach_speed : float, m/s

    Returns
    -------
    Collision

    Raises
    ------
    InputError
        If the force is no function or gives no finite number, mass or speed are not > 0, or the contact does not end.
    """
    from scipy.integrate import solve_ivp

    is_function = callable(force) and not isinstance(force, type)
    require(is_function, "force", force, "", "must be a function of depth, rate")
    mass, speed = mass_and_speed(effective_mass, approach_speed)

    def push(depth: float, rate: float) -> float:
        return float(checked("force", force(depth, rate), quantity("N")))

    # the depth at which the static force has taken up the energy
    depth, energy = 1e-9, 0.5 * mass * speed**2
    while push(depth, 0.0) * depth < energy and depth < 1.0:
        depth *= 2.0
    longest = 1e3 * depth / speed

    def rates(_: float, y: Any) -> list[float]:
        return [y[1], -push(y[0], y[1]) / mass]

    def off(_: float, y: Any) -> float:
        return float(y[0] if y[1] < 0.0 else 1.0)

    off.terminal, off.direction = True, -1.0  # type: ignore[attr-defined]
    # of a mass that its force throws beyond numbers the motion has no end, which is said below
    with np.errstate(over="ignore", invalid="ignore"):
        run: Any = solve_ivp(
            rates, (0.0, longest), [0.0, speed], events=off, rtol=1e-10, atol=[1e-12 * depth, 1e-12 * speed],
            max_step=longest, first_step=1e-3 * depth / speed,
        )  # fmt: skip
    let_go = bool(run.t_events) and bool(run.t_events[0].size)
    require(let_go, "force", None, "N", f"must let the ball go: still in contact {longest:g} s after {speed:g} m/s")
    loads = np.array([push(p, rate) for p, rate in run.y.T])
    under_force = run.t[np.flatnonzero(loads > 0.0)[-1]] if np.any(loads > 0.0) else run.t[-1]
    return collision_of(
        -float(run.y[1, -1]) / speed, float(under_force), float(loads.max()), float(run.y[0].max()), mass, speed
    )
