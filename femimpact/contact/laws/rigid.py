"""Rigid impact: an impulse, by Newton's restitution."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

from femimpact.contact.collision import Collision, collision_of
from femimpact.contact.formulas import RIGID
from femimpact.contact.parameters import ContactParameters
from femimpact.errors import check_fields, quantity

__all__ = ["Rigid"]


@dataclass(frozen=True)
class Rigid:
    """Impact of no duration: the relative speed v at the wall becomes -e v (Newton's restitution).

    For `EventDriven` and `MoreauJean`; the impulse is (1 + e) v/(1/m + b^T M^-1 b).

    Parameters
    ----------
    restitution : float, 1
        Speed after an impact over that before it.

    Raises
    ------
    InputError
        If the restitution is not between 0 and 1.
    """

    restitution: float = field(metadata=quantity("1", at_least=0.0, at_most=1.0))
    name: ClassVar[str] = "rigid"
    may_be_preloaded: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fields(self)

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Not a number: an impulse has no force."""
        return math.nan

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored: none."""
        return 0.0

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision, without duration and penetration."""
        return collision_of(self.restitution, 0.0, math.nan, 0.0, effective_mass, approach_speed)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop."""
        return ContactParameters(RIGID, math.inf, 0.0, 0.0, self.restitution)

    def force_function(self, effective_mass: float) -> None:
        """None: the time loop has a branch for rigid contacts."""

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Nothing beside the restitution."""
        return ()

    def with_restitution(self, restitution: float) -> Rigid:
        """The same law with another restitution (1)."""
        return replace(self, restitution=restitution)
