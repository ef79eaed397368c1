"""Elastic bodies in contact, and the stiffness of a sphere on a flat wall."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from femimpact.errors import check_fields, checked, quantity, require_type

__all__ = ["ALUMINIUM", "STEEL", "Material", "hertz_stiffness"]


@dataclass(frozen=True)
class Material:
    """Elastic constants of a body in contact.

    Parameters
    ----------
    young_modulus : float, Pa
    poisson_ratio : float, 1

    Raises
    ------
    InputError
        If a value is out of range.
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
