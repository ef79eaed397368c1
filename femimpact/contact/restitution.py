"""The restitution of contact laws in closed form, and the stiffness of Hertz from two materials."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from femimpact.errors import check_fields, checked, quantity, require_type


@dataclass(frozen=True)
class Material:
    """Elastic constants of a body in contact.

    Parameters
    ----------
    young_modulus : float, Pa
    poisson_ratio : float, 1
    """

    young_modulus: float = field(metadata=quantity("Pa", above=0.0))
    poisson_ratio: float = field(metadata=quantity("1", above=-1.0, at_most=0.5))

    def __post_init__(self) -> None:
        check_fields(self)


STEEL = Material(210e9, 0.30)
ALUMINIUM = Material(70e9, 0.33)


def hertz_stiffness(radius: float, ball: Material, wall: Material) -> float:
    """Stiffness (N/m^1.5) of a sphere on a flat wall: k = 4/3 E* sqrt(R), 1/E* = sum of (1 - nu^2)/E.

    Parameters
    ----------
    radius : float, m
        Of the ball.
    ball, wall : Material

    Returns
    -------
    float, N/m^1.5

    Raises
    ------
    InputError
        If the radius is not > 0, or a body is no material.

    Notes
    -----
    Hertz (1882); Johnson, Contact Mechanics (1985).
    """
    size = checked("radius", radius, quantity("m", above=0.0))
    for key, body in (("ball", ball), ("wall", wall)):
        require_type(body, Material, key)
    compliance = sum((1.0 - body.poisson_ratio**2) / body.young_modulus for body in (ball, wall))
    return 4.0 / 3.0 / compliance * math.sqrt(size)


EFFECTIVE_MASS: Any = quantity("kg", above=0.0, at_most=1e15)
"""Of a contact; a heavier one has stiffnesses and energies beyond those of numbers."""


def linear_angle(damping_ratio: float) -> float:
    """acos(z)/sqrt(1 - z^2), continued beyond z = 1 as acosh(z)/sqrt(z^2 - 1)."""
    z: float = checked("damping_ratio", damping_ratio, quantity("1", at_least=0.0))
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
    z: float = checked("damping_ratio", damping_ratio, quantity("1", at_least=0.0))
    return math.exp(-2.0 * z * linear_angle(z))


def damping_ratio_for_restitution(restitution: float) -> float:
    """Contact damping ratio z whose restitution (contact ending at zero force) is the one given."""
    restitution = checked("restitution", restitution, quantity("1", above=0.0, at_most=1.0))
    if restitution >= 1.0:
        return 0.0
    from scipy.optimize import brentq

    # e(z) lies below exp(-2 z) up to z = 1 and near 1/(4 z^2) far beyond: this brackets both.
    upper = 1.0 + 1.0 / math.sqrt(restitution)
    target = math.log(restitution)
    return float(brentq(lambda z: -2.0 * z * linear_angle(z) - target, 0.0, upper, xtol=1e-16, rtol=1e-15))


def contact_time_of(stiffness: float, damping: float, effective_mass: float) -> float:
    """Contact time (s) of the linear law, from touch to zero force: 2 acos(z)/(w0 sqrt(1 - z^2))."""
    stiffness = checked("stiffness", stiffness, quantity("N/m", above=0.0))
    damping = checked("damping", damping, quantity("N s/m", at_least=0.0))
    effective_mass = checked("effective_mass", effective_mass, EFFECTIVE_MASS)
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
    e: float = checked("restitution", restitution, quantity("1", above=0.0, at_most=1.0))
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
