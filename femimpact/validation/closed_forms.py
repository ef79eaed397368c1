"""Closed forms of periodic motions with rigid impacts on an oscillator M = K = 1: at one stop, and a ball in a box."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

ClosedForm = tuple[float, float, NDArray[np.float64]]
"""Approach speed, phase of the force (a sine) at the impact on the + wall, and the map of a small disturbance."""

# ---- one impact in each cycle on a stop, or in so many cycles -----------------------------------


def stop_coefficients(
    damping: float, restitution: float, omega: float, cycles: int = 1
) -> tuple[float, float, float]:  # fmt: skip
    """x, tail and A of (x^2 + tail^2) v^2 - 2 stop x v + stop^2 = (F A)^2, with the speed v and the force F.

    With the forced motion's value P and rate Q at the impact, the free part goes from (stop - P, -e v - Q)
    to (stop - P, v - Q) in one period: linear in v. P^2 + (Q/omega)^2 = (F A)^2 is then a quadratic in v.
    """
    x, w = np.linalg.solve(_free(damping, omega, cycles) - np.eye(2), [0.0, 1 + restitution])
    return float(x), float((restitution + w) / omega), 1 / math.hypot(1 - omega**2, 2 * damping * omega)


def stop_orbits(
    damping: float, restitution: float, omega: float, stop: float, force: float = 1.0, cycles: int = 1
) -> list[ClosedForm]:
    """The solutions with a positive speed, the slower one first."""
    x, tail, amplitude = stop_coefficients(damping, restitution, omega, cycles)
    orbits = []
    for speed in _positive([x**2 + tail**2, -2 * stop * x, stop**2 - (force * amplitude) ** 2]):
        # forced motion A sin(omega t + psi): P = A sin(psi), Q = A omega cos(psi); the force leads it
        psi = math.atan2(stop - speed * x, -speed * tail)
        phase = psi + math.atan2(2 * damping * omega, 1 - omega**2)
        orbits.append((speed, phase, stop_map(damping, restitution, omega, stop, speed, cycles)))
    return orbits


def stop_harmonic(damping: float, restitution: float, omega: float, orbit: ClosedForm, cycles: int = 1) -> float:
    """Amplitude at omega: that of the response to a unit force and to the mean line of the impulses at omega."""
    speed, phase, _ = orbit
    impulses = (1 + restitution) * speed * omega / (math.pi * cycles)
    amplitude = 1 / math.hypot(1 - omega**2, 2 * damping * omega)
    return amplitude * math.hypot(math.cos(phase), math.sin(phase) - impulses)


def stop_map(
    damping: float, restitution: float, omega: float, stop: float, speed: float, cycles: int = 1
) -> NDArray[np.float64]:
    """Derivative of (u, u') just after an impact by that just after the one before: saltation times propagator."""
    x, tail, _ = stop_coefficients(damping, restitution, omega, cycles)
    # the force there is P'' + 2 zeta P' + P
    force = (1 - omega**2) * (stop - speed * x) - 2 * damping * omega * tail * speed
    before, after = (force - stop - 2 * damping * rate for rate in (speed, -restitution * speed))
    saltation = np.array([[-restitution, 0.0], [(after + restitution * before) / speed, -restitution]])
    return np.asarray(saltation @ _free(damping, omega, cycles))


def _free(damping: float, omega: float, cycles: int) -> NDArray[np.float64]:
    """Propagator of the oscillator over so many cycles."""
    from scipy.linalg import expm

    return np.asarray(expm(np.array([[0.0, 1.0], [-1.0, -2 * damping]]) * (2 * math.pi * cycles / omega)))


# ---- two impacts in each cycle of a ball between two walls ---------------------------------------


def box_coefficients(mu: float, e: float, zeta: float, omega: float) -> tuple[float, float, float]:
    """P, r and A of (p u - clearance/2)^2 + (r u)^2 = A^2, with the speed u of the ball under a force of 1 N.

    The half-cycle map of the oscillator under the ball's impulse is linear in u, as the impact at a stop is.
    """
    eta, period = math.sqrt(1 - zeta**2), math.pi / omega
    decay, c, s = math.exp(-zeta * period), math.cos(eta * period), math.sin(eta * period)
    jump = [
        [decay * s, 1 + decay * c],
        [eta * (1 + decay * c) - decay * zeta * s, -zeta * (1 + decay * c) - decay * eta * s],
    ]
    a1, a2 = np.linalg.solve(jump, [0.0, 2 * mu])
    after = -(1 - e - 2 * mu * e) / (1 + e)
    amplitude = 1 / math.hypot(1 - omega**2, 2 * zeta * omega)
    return float(math.pi / (2 * omega) - a2), float((after - (eta * a1 - zeta * a2)) / omega), amplitude


def box_orbits(mu: float, e: float, zeta: float, omega: float, clearance: float) -> list[ClosedForm]:
    """The solutions with a positive speed, the slower one first; the map is that over half a cycle, its sign turned."""
    p, r, amplitude = box_coefficients(mu, e, zeta, omega)
    lead, orbits = math.atan2(2 * zeta * omega, 1 - omega**2), list[ClosedForm]()
    for u in _positive([p * p + r * r, -p * clearance, 0.25 * clearance**2 - amplitude**2]):
        phase = math.atan2(p * u - 0.5 * clearance, r * u) + lead
        orbits.append((2 * u * (1 + mu) / (1 + e), phase, _half_map(mu, e, zeta, omega, clearance, u, phase)))
    return orbits


def box_fold(mu: float, e: float, zeta: float, omega: float) -> float:
    """The clearance at which both solutions are one."""
    p, r, amplitude = box_coefficients(mu, e, zeta, omega)
    return 2 * amplitude * math.hypot(p, r) / abs(r)


def _half_map(
    mu: float, e: float, zeta: float, omega: float, clearance: float, u: float, phase: float
) -> NDArray[np.float64]:
    """Minus the derivative of (x, y, x', y') after the impact on the - wall by that on the + wall."""
    eta, period = math.sqrt(1 - zeta**2), math.pi / omega
    decay, c, s = math.exp(-zeta * period), math.cos(eta * period), math.sin(eta * period)
    flow = np.zeros((4, 4))
    flow[np.ix_([0, 2], [0, 2])] = decay * np.array([[c + zeta / eta * s, s / eta], [-s / eta, c - zeta / eta * s]])
    flow[np.ix_([1, 3], [1, 3])] = np.array([[1.0, period], [0.0, 1.0]])
    gap, rate = np.array([-1.0, 1.0, 0, 0]), np.array([0, 0, -1.0, 1.0])
    jump = np.eye(4) - (1 + e) / (1 + 1 / mu) * np.outer([0, 0, -1.0, 1 / mu], rate)
    place, after = u * period / 2 - clearance / 2, -(1 - e - 2 * mu * e) / (1 + e) * u
    # the ball turns round, and the oscillator takes up 2 mu u
    before, later = (
        np.array([v, w, math.sin(phase) - 2 * zeta * v - place, 0.0]) for v, w in ((after - 2 * mu * u, u), (after, -u))
    )
    saltation = jump + np.outer(later - jump @ before, gap) / (gap @ before)
    return np.asarray(-saltation @ flow)


def _positive(polynomial: list[float]) -> list[float]:
    """Its real positive roots, the smaller one first."""
    return sorted(float(root.real) for root in np.roots(polynomial) if root.imag == 0.0 and root.real > 0.0)
