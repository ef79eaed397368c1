"""Constant load along a beam: an acceleration, a spin about a hub, a force at the tip."""

from __future__ import annotations

from dataclasses import dataclass, field

from femimpact.errors import LARGEST, check_fields, choice, quantity


@dataclass(frozen=True)
class Axial:
    """Constant load along the beam, which is held along its axis at the root and slides at its other supports.

    With a(x) = acceleration + spin^2 (hub + x) and the normal force N(x) of all that lies beyond x, it adds

        integral of N w'^2 + sum over bodies of mass a(x + offset) offset turn^2

    to twice the potential energy, the turn being w' at the body. In the plane of rotation spin^2 times w^2 of every
    mass is taken away. Under spin a body is a point: its rotary inertia has no share in the load.

    Parameters
    ----------
    acceleration : float, m/s^2
        Along the beam, positive towards the tip: of a hanging beam 9.81, of a standing one -9.81.
    spin : float, rad/s
        Speed of rotation about an axis across the beam. Balls and absorbers are refused beside it.
    hub : float, m
        From that axis to the root.
    tension : float, N
        Force at the tip, which keeps its direction along the undeformed beam; a negative one presses.
    spin_plane : {"flap", "lag"}
        Whether the deflection is along the axis of rotation or in the plane of rotation. In that plane the base's
        acceleration is the axis's, along the deflection.

    Examples
    --------
    >>> import femimpact as fi
    >>> fi.Structure(structure.beam, axial=fi.Axial(acceleration=9.81)).axial.acceleration
    9.81
    """

    acceleration: float = field(default=0.0, metadata=quantity("m/s^2", at_least=-LARGEST, at_most=LARGEST))
    spin: float = field(default=0.0, metadata=quantity("rad/s", at_least=0.0, at_most=LARGEST))
    hub: float = field(default=0.0, metadata=quantity("m", at_least=0.0, at_most=LARGEST))
    tension: float = field(default=0.0, metadata=quantity("N", at_least=-LARGEST, at_most=LARGEST))
    spin_plane: str = field(default="flap", metadata=choice("flap", "lag"))

    def __post_init__(self) -> None:
        check_fields(self)
