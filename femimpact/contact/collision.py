"""One collision in continuous time: a mass thrown at a wall of a given law."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from femimpact.contact.formulas import (
    kelvin_voigt_force,
    power_force,
    power_potential,
    spring_potential,
    switching_potential,
)
from femimpact.contact.laws import (
    ContactLaw,
    CustomLaw,
    KelvinVoigt,
    PowerLaw,
    Rigid,
    SwitchingSpring,
    loss_factor,
    require_law,
    spring_and_dashpot,
)
from femimpact.contact.restitution import contact_time_of, restitution_of_damping_ratio, restitution_of_loss_factor
from femimpact.errors import check_fields, checked, quantity, require

__all__ = ["Collision", "collide", "contact_force", "contact_potential", "power_contact_time"]

QUADRATURE = 60
"""Gauss points of the contact time's quadrature; its integrand is smooth after the change of variable."""


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


def contact_force(law: ContactLaw, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
    """Normal force of a law (N, pushing the bodies apart).

    Parameters
    ----------
    law : ContactLaw
        A Rigid one has no force: not a number. The switching spring's is beside its wall at gap 0.
    depth : float, m
    rate : float, m/s
    approach_speed : float, m/s
        At the start of the contact.
    effective_mass : float, kg

    Returns
    -------
    float, N

    Raises
    ------
    InputError
        If the law is none, a number is out of range, or a custom law's force is not finite.
    """
    require_law(law)
    depth, rate = checked("depth", depth, quantity("m")), checked("rate", rate, quantity("m/s"))
    approach_speed, effective_mass = _speed(approach_speed), _mass(effective_mass)
    return _force(law, depth, rate, approach_speed, effective_mass)


def _speed(value: object) -> float:
    return float(checked("approach_speed", value, quantity("m/s", above=0.0)))


def _mass(value: object) -> float:
    return float(checked("effective_mass", value, quantity("kg", above=0.0)))


def _force(law: ContactLaw, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
    """`contact_force` of values that were checked before."""
    if isinstance(law, KelvinVoigt):
        return kelvin_voigt_force(depth, rate, *spring_and_dashpot(law, effective_mass)) if depth > 0.0 else 0.0
    if isinstance(law, PowerLaw):
        return power_force(depth, rate, law.stiffness, law.exponent, loss_factor(law), approach_speed)
    if isinstance(law, CustomLaw):
        return max(_own_force(law, depth, rate, approach_speed), 0.0) if depth > 0.0 else 0.0
    return math.nan if isinstance(law, Rigid) else law.stiffness * max(depth, 0.0)


def _own_force(law: CustomLaw, depth: float, rate: float, approach_speed: float) -> float:
    return float(checked("force", law.force(depth, rate, approach_speed), quantity("N")))


def contact_potential(law: ContactLaw, depth: float, effective_mass: float, approach_speed: float = 0.25) -> float:
    """Energy (J) that a law has stored at a penetration (m): the part that it gives back.

    A Rigid contact stores none; of a custom law it is the integral of force(p, 0, v0).

    Raises
    ------
    InputError
        If the law is none, or a number is out of range.
    """
    require_law(law)
    depth = checked("depth", depth, quantity("m"))
    approach_speed, effective_mass = _speed(approach_speed), _mass(effective_mass)
    if isinstance(law, KelvinVoigt):
        return spring_potential(max(depth, 0.0), spring_and_dashpot(law, effective_mass)[0])
    if isinstance(law, PowerLaw):
        return power_potential(depth, law.stiffness, law.exponent)
    if isinstance(law, SwitchingSpring):
        return switching_potential(max(depth, 0.0), 0.0, 0.0, law.free_stiffness, law.stiffness)
    if isinstance(law, CustomLaw) and depth > 0.0:
        from scipy.integrate import quad

        return float(quad(lambda p: _own_force(law, p, 0.0, approach_speed), 0.0, depth)[0])
    return 0.0


def collide(law: ContactLaw, effective_mass: float, approach_speed: float) -> Collision:
    """Throw a mass at a wall of the law: m p'' = -N(p, p'), p(0) = 0, p'(0) = v, until N is zero again.

    Parameters
    ----------
    law : ContactLaw
    effective_mass : float, kg
    approach_speed : float, m/s

    Returns
    -------
    Collision
        In closed form for the linear and the power laws, by integration for a custom one.

    Raises
    ------
    InputError
        If a number is not > 0, or a custom law never lets go.
    """
    require_law(law)
    m, v = _mass(effective_mass), _speed(approach_speed)
    if isinstance(law, Rigid):
        return _collision(law.restitution, 0.0, math.nan, 0.0, m, v)
    if isinstance(law, SwitchingSpring):
        omega = math.sqrt(law.stiffness / m)
        return _collision(1.0, math.pi / omega, v * math.sqrt(law.stiffness * m), v / omega, m, v)
    if isinstance(law, KelvinVoigt):
        return _linear_collision(*spring_and_dashpot(law, m), m, v)
    if isinstance(law, PowerLaw):
        return _power_collision(law, m, v)
    return _numerical_collision(lambda p, rate: _force(law, p, rate, v, m), m, v)


def _collision(e: float, time: float, peak: float, depth: float, mass: float, speed: float) -> Collision:
    return Collision(e, time, peak, depth, 0.5 * mass * speed**2 * (1.0 - e * e))


def _linear_collision(stiffness: float, damping: float, mass: float, speed: float) -> Collision:
    """Closed form of m p'' + c p' + k p = 0 up to the first zero of the force."""
    z = damping / (2.0 * math.sqrt(stiffness * mass))
    time = contact_time_of(stiffness, damping, mass)
    omega = math.sqrt(stiffness / mass)
    # sampled finely, then by a parabola: peak force and penetration have no short closed form for all z
    t = np.linspace(0.0, time, 2001)
    root = np.sqrt(complex(z * z - 1.0)) if z != 1.0 else complex(1e-9)
    p = speed / omega * np.real(np.exp(-z * omega * t) * np.sinh(root * omega * t) / root)
    rate = speed * np.real(np.exp(-z * omega * t) * (np.cosh(root * omega * t) - z / root * np.sinh(root * omega * t)))
    force = np.maximum(stiffness * p + damping * rate, 0.0)
    return _collision(restitution_of_damping_ratio(z), time, _crest(force), _crest(p), mass, speed)


def _crest(values: Any) -> float:
    """Largest value, by the parabola through the largest sample and its neighbours."""
    i = int(np.argmax(values))
    if i == 0 or i == values.size - 1:
        return float(values[i])
    before, at, after = values[i - 1 : i + 2]
    return float(at - 0.125 * (after - before) ** 2 / (before + after - 2.0 * at))


def _potential_of_speed(loss: float, ratio: float) -> float:
    """(Stored energy)/(m v0^2) when the relative speed is `ratio` times the approach speed, -e to 1.

    m v dv/(1 + d v/v0) = -dU gives U/(m v0^2) = (1 - r)/d - ln[(1 + d)/(1 + d r)]/d^2, written
    here without differences of near numbers.
    """
    v = (1.0 - ratio) / max(1.0 + loss * ratio, 1e-300)
    u = loss * v
    if u > 1.0:
        # no near numbers here, and v may be huge next to the speed at which the force vanishes
        return (1.0 - ratio) / loss - math.log1p(u) / loss**2
    series = sum((-u) ** n / (n + 2.0) for n in range(8))
    shape = series if abs(u) < 0.02 else (u - math.log1p(u)) / u**2
    return ratio * v + v * v * shape


def _power_collision(law: PowerLaw, mass: float, speed: float) -> Collision:
    d, k, n = loss_factor(law), law.stiffness, law.exponent
    deepest = _depth(_potential_of_speed(d, 0.0) * mass * speed**2, k, n)
    # the force k p^n (1 + d r) is largest before the deepest point
    ratios = np.linspace(0.0, 1.0, 4001)[:-1]
    depths = [_depth(_potential_of_speed(d, r) * mass * speed**2, k, n) for r in ratios]
    force = k * np.array(depths) ** n * (1.0 + d * ratios)
    time = power_contact_time(k, n, d, mass, speed)
    return _collision(restitution_of_loss_factor(d), time, _crest(force), deepest, mass, speed)


def _depth(energy: float, stiffness: float, exponent: float) -> float:
    return float(((exponent + 1.0) * max(energy, 0.0) / stiffness) ** (1.0 / (exponent + 1.0)))


def power_contact_time(stiffness: float, exponent: float, loss: float, mass: float, speed: float) -> float:
    """Contact time (s) of k p^n (1 + d p'/v0): the integral of -m dv/N over the speed, from v to -e v.

    For d = 0 and n = 3/2 it is 2.9432 times the largest penetration over v (Hertz; Johnson, 1985).
    """
    e = restitution_of_loss_factor(loss)
    x, w = np.polynomial.legendre.leggauss(QUADRATURE)
    s, w = 0.5 * (x + 1.0), 0.5 * w
    scale, q = mass * speed**2, exponent + 1.0
    # coming: -m dv/N, clustered at the touch, where the force grows from zero
    r = 1.0 - s**q
    depth = np.array([_depth(_potential_of_speed(loss, value) * scale, stiffness, exponent) for value in r])
    coming = mass * speed * q * s ** (q - 1.0) / (stiffness * depth**exponent * (1.0 + loss * r))
    # leaving: dp/|v|, for a lossy contact creeps back at a speed that hardly changes; clustered where it turns
    deepest = _depth(_potential_of_speed(loss, 0.0) * scale, stiffness, exponent)
    back = [_leaving_speed(loss, e, value) for value in (1.0 - s * s) ** q * _potential_of_speed(loss, 0.0)]
    leaving = 2.0 * s * deepest / (speed * np.array(back))
    return float(np.sum(w * (coming + leaving)))


def _leaving_speed(loss: float, restitution: float, potential: float) -> float:
    """Relative speed over v0 on the way back, positive, where (stored energy)/(m v0^2) is `potential`."""
    from scipy.optimize import brentq

    def left(ratio: float) -> float:
        return _potential_of_speed(loss, -ratio) - potential

    if left(restitution) >= 0.0:
        return restitution
    return float(brentq(left, 0.0, restitution, xtol=1e-17, rtol=1e-14))


def _numerical_collision(force: Callable[[float, float], float], mass: float, speed: float) -> Collision:
    """Integrate one collision to 1e-10, with the scale of length taken from the force itself."""
    from scipy.integrate import solve_ivp

    # the depth at which the static force has taken up the energy
    depth, energy = 1e-9, 0.5 * mass * speed**2
    while force(depth, 0.0) * depth < energy and depth < 1.0:
        depth *= 2.0
    longest = 1e3 * depth / speed

    def rates(_: float, y: Any) -> list[float]:
        return [y[1], -force(y[0], y[1]) / mass]

    def off(_: float, y: Any) -> float:
        return float(y[0] if y[1] < 0.0 else 1.0)

    off.terminal, off.direction = True, -1.0  # type: ignore[attr-defined]
    run: Any = solve_ivp(
        rates, (0.0, longest), [0.0, speed], events=off, rtol=1e-10, atol=[1e-12 * depth, 1e-12 * speed],
        max_step=longest, first_step=1e-3 * depth / speed,
    )  # fmt: skip
    let_go = bool(run.t_events) and bool(run.t_events[0].size)
    require(let_go, "force", None, "N", f"must let the ball go: still in contact {longest:g} s after {speed:g} m/s")
    loads = np.array([force(p, rate) for p, rate in run.y.T])
    under_force = run.t[np.flatnonzero(loads > 0.0)[-1]] if np.any(loads > 0.0) else run.t[-1]
    return _collision(
        -float(run.y[1, -1]) / speed, float(under_force), float(loads.max()), float(run.y[0].max()), mass, speed
    )
