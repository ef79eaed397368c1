"""The switching spring of the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from femimpact.contact.collision import Collision, collision_of
from femimpact.contact.formulas import SWITCHING_SPRING, switching_potential
from femimpact.contact.parameters import ContactParameters
from femimpact.errors import check_fields, quantity

__all__ = ["SwitchingSpring"]


@dataclass(frozen=True)
class SwitchingSpring:
    """The paper's law: k_I0 x inside the gap, k_I x outside, switched by the state before the step.

    The force jumps at the wall, and deciding one step late feeds energy in; the energy ledger
    of a run shows how much. Kept to reproduce the paper (eq. 25 to 30), not to be trusted.

    Parameters
    ----------
    free_stiffness : float, N/m
        k_I0, acts on the full relative displacement while the ball is inside its gap.
    stiffness : float, N/m
        k_I, acts on the full relative displacement outside.

    Raises
    ------
    InputError
        If a stiffness is out of range.
    """

    free_stiffness: float = field(metadata=quantity("N/m", at_least=0.0))
    stiffness: float = field(metadata=quantity("N/m", above=0.0))
    name: ClassVar[str] = "switching-spring"
    restitution: ClassVar[float | None] = None
    may_be_preloaded: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_fields(self)

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N) k_I p beside a wall at gap 0."""
        return self.stiffness * max(depth, 0.0)

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored beside a wall at gap 0."""
        return switching_potential(max(depth, 0.0), 0.0, 0.0, self.free_stiffness, self.stiffness)

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision: half a period of the mass on the spring k_I."""
        m, v = effective_mass, approach_speed
        omega = math.sqrt(self.stiffness / m)
        return collision_of(1.0, math.pi / omega, v * math.sqrt(self.stiffness * m), v / omega, m, v)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop."""
        half_period = math.pi * math.sqrt(effective_mass / self.stiffness)
        return ContactParameters(SWITCHING_SPRING, self.stiffness, 0.0, half_period, 1.0)

    def force_function(self, effective_mass: float) -> None:
        """None: the time loop has a branch for switching springs."""

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Stiffness and damping, which is none."""
        return ("stiffness", self.stiffness, "N/m"), ("damping", 0.0, "N s/m")

    def with_restitution(self, restitution: float) -> None:
        """None: the law in continuous time loses nothing."""
