"""The numbers of a law once the effective mass of its pair is known."""

from __future__ import annotations

import math
from typing import NamedTuple

from femimpact.contact.formulas import CUSTOM, RIGID

__all__ = ["ContactParameters"]


class ContactParameters(NamedTuple):
    """Numbers that the time loop needs of a law."""

    kind: int
    stiffness: float  # N/m, or N/m^n
    damping: float  # N s/m; of a power law its loss factor d, 1
    contact_time: float  # s, from touch to zero force
    restitution: float  # 1, of one collision in continuous time
    exponent: float = 1.0

    @classmethod
    def of_function(cls, contact_time: float, restitution: float) -> ContactParameters:
        """Numbers of a law whose force is a function that the time loop calls."""
        return cls(CUSTOM, math.nan, 0.0, contact_time, restitution)

    @property
    def is_rigid(self) -> bool:
        """Whether the contact is an impulse, without force and duration."""
        return self.kind == RIGID
