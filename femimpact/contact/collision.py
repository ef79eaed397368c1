"""One collision of a mass with a wall: restitution, duration, force and loss, in closed form and by integration."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from femimpact.errors import check_fields, checked, quantity, require

EFFECTIVE_MASS: Any = quantity("kg", above=0.0, at_most=1e15)
"""Effective mass of a contact, kg; with a larger one stiffnesses and energies overflow."""


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
    """Mass (kg) and speed (m/s) of a collision, both > 0."""
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


def largest_by_parabola(values: Any) -> float:
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

    Raises
    ------
    InputError
        If the force gives no finite number, or the contact does not end.
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


def linear_angle(damping_ratio: float) -> float:
    """acos(z)/sqrt(1 - z^2), continued beyond z = 1 as acosh(z)/sqrt(z^2 - 1)."""
    z = damping_ratio
    if abs(z - 1.0) < 1e-6:
        return 1.0 - (z - 1.0) / 3.0
    if z < 1.0:
        return math.acos(z) / math.sqrt(1.0 - z * z)
    return math.acosh(z) / math.sqrt(z * z - 1.0)


def restitution_of_damping_ratio(
    damping_ratio: float,  # z of the contact, >= 0
) -> float:
    """Restitution of a Kelvin-Voigt contact that ends at zero force.

    e = exp(-2 z acos(z)/sqrt(1 - z^2)), z = c/(2 sqrt(k m_eff)); for z > 1 with acosh.

    Returns 1: rebound speed over approach speed, from 1 (z = 0) towards 0.

    From m x'' + c x' + k x = 0, x(0) = 0, left at the first zero of k x + c x'
    (derived here; the same condition as Schwager and Poeschel, 2007).
    """
    z = damping_ratio
    return math.exp(-2.0 * z * linear_angle(z))


def damping_ratio_for_restitution(restitution: float) -> float:
    """Contact damping ratio z whose restitution (contact ending at zero force) is the one given."""
    if restitution >= 1.0:
        return 0.0
    from scipy.optimize import brentq

    # e(z) lies below exp(-2 z) up to z = 1 and near 1/(4 z^2) far beyond: this brackets both.
    upper = 1.0 + 1.0 / math.sqrt(restitution)
    target = math.log(restitution)
    return float(brentq(lambda z: -2.0 * z * linear_angle(z) - target, 0.0, upper, xtol=1e-16, rtol=1e-15))


def contact_time_of(stiffness: float, damping: float, effective_mass: float) -> float:
    """Contact time (s) of the linear law, from touch to zero force: 2 acos(z)/(w0 sqrt(1 - z^2))."""
    omega = math.sqrt(stiffness / effective_mass)
    return 2.0 * linear_angle(damping / (2.0 * math.sqrt(stiffness * effective_mass))) / omega


def restitution_of_loss_factor(
    loss: float,  # d >= 0
) -> float:
    """Restitution of a force k p^n (1 + d p'/v0), whatever k, n and the mass.

    d (1 + e) = ln[(1 + d)/(1 - e d)]

    Returns 1: from 1 (d = 0) towards 0, always below 1/d.

    m v dv/(1 + d v/v0) = -k p^n dp over loading (v0 to 0) and unloading (0 to -e v0) gives both
    sides of the same work. (Derived here; the relation of Gonthier et al., 2004.)
    """
    loss = checked("loss", loss, quantity("1", at_least=0.0))
    if loss == 0.0:
        return 1.0
    from scipy.optimize import brentq

    upper = min(1.0, (1.0 - 1e-16) / loss)
    if _work_left(loss, upper) >= 0.0:
        return upper
    return float(brentq(lambda e: _work_left(loss, e), 0.0, upper, xtol=1e-16, rtol=1e-14))


def loss_factor_for_restitution(restitution: float) -> float:
    """Loss factor d of a force k p^n (1 + d p'/v0) with exactly the restitution given, 0 < e <= 1.

    The root of d (1 + e) = ln[(1 + d)/(1 - e d)], 0 < d < 1/e.
    """
    e = restitution
    if e >= 1.0:
        return 0.0
    from scipy.optimize import brentq

    upper = (1.0 - 1e-16) / e
    # a contact this lossy ends at the pole d = 1/e, to rounding
    if _work_left(upper, e) >= 0.0:
        return upper
    return float(brentq(lambda d: _work_left(d, e), 0.5 * (1.0 - e), upper, xtol=1e-16, rtol=1e-14))


def _work_left(d: float, e: float) -> float:
    """Difference of both sides of the relation over d^2; its series where they cancel."""
    if d < 0.02:
        return math.fsum((-1.0) ** n * d ** (n - 2) * (1.0 + (-1.0) ** (n + 1) * e**n) / n for n in range(2, 9))
    return (d * (1.0 + e) - math.log1p(d) + math.log1p(-min(e * d, 1.0 - 1e-16))) / d**2
