"""Channels of supports: forces and moments on the structure, and the force that drives the base."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from femimpact.errors import check_fields, choice, place, require, suggestion
from femimpact.response.channels.reading import Reading, zero_reading
from femimpact.structure.structure import Position
from femimpact.system.system import System

__all__ = ["ShakerForce", "SupportReaction"]


@dataclass(frozen=True)
class SupportReaction:
    """Force (N, along +w) or moment (N m, along +dw/dx) of one support on the structure.

    It is read from the held rows of M, C and K, with the forces that act on the support itself taken off, and with
    the acceleration that the equations of motion give; see `femimpact.system.reactions.Reaction`. With all dofs or
    all modes it is the sum of inertia and contact forces. With modes left out it is the reaction of the
    modes that are kept; `ShakerForce` then shows the other sum, and a note of the response the difference.

    A root has three forces, which differ in phase: this one; the elastic shear force EI w''', which leaves damping
    and the mass beside the root out; and the shaker's force, which alone closes the balance of power.

    Parameters
    ----------
    at : str or float
        Place of the support.
    quantity : {"force", "moment"}

    Raises
    ------
    InputError
        If a value is out of range; when it is read, if no support gives this reaction.
    """

    at: Position = field(metadata=place())
    quantity: str = field(default="force", metadata=choice("force", "moment"))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it."""
        return f"{self.at}.reaction_{self.quantity}"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "N" if self.quantity == "force" else "N m"

    def reading(self, system: System) -> Reading:
        """The reaction of this support alone."""
        known = list(system.reactions)
        at = self.at if isinstance(self.at, str) else f"{self.at:.9g}"
        reaction = f"{at}.{self.quantity}"
        require(reaction in known, "channels", self.name, "", f"no such reaction: {suggestion(reaction, known)}")
        return replace(zero_reading(system), reaction=np.eye(len(known))[known.index(reaction)])


@dataclass(frozen=True)
class ShakerForce:
    """Force (N, along +w) that moves the base: the rate of the momentum of all that stands on it, but for other forces.

    base_load u'' + m ub'' + sum m_j (y_j'' + ub'') - (gravity and other constant forces) - (forces of stops that stand
    in space) - (a driving point force). Its power is what the energy in the inertial frame gains and damping takes.
    The mass of the shaker's own table is not in it.

    With modes left out, u'' is that of the kept ones, and the mass m and gravity are those of all: the momentum and
    the power of the motion that is computed. At rest it is the whole weight whatever the number of modes, and gravity
    reads as a base acceleration of -g does.
    """

    @property
    def name(self) -> str:
        """Always the same: there is one base."""
        return "shaker_force"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "N"

    def reading(self, system: System) -> Reading:
        """Momentum of structure and balls, and what else acts on them."""
        balls = np.array([0.0 if pair.is_stop else pair.mass for pair in system.contacts])
        given = sum(mass * pair.acceleration for mass, pair in zip(balls, system.contacts, strict=True))
        held = sum(item.constant for item in system.reactions.values() if item.unit == "N")
        constant = system.constant_resultant + held + given
        # a stop's direction points against w
        in_space = np.array([1.0 if pair.is_stop and pair.fixed_to == "space" else 0.0 for pair in system.contacts])
        return replace(
            zero_reading(system),
            acceleration=system.base_load,
            ball_acceleration=balls,
            base=np.array([0.0, 0.0, system.total_mass + float(balls.sum())]),
            contact_force=in_space,
            point_force=-1.0,
            constant=-constant,
        )
