"""One case of the reference cases: a number that is known, the same number computed, and how close it must be."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Case:
    """A known number beside the computed one."""

    name: str  # distinct among all cases
    source: str  # where the reference is from: author and year, or "derived here"
    quantity: str
    unit: str
    reference: float  # unit
    computed: float  # unit
    bound: float  # largest error allowed: relative to the reference, or absolute where the reference is zero
    reason: str  # why the bound is what it is

    @property
    def error(self) -> float:
        """Relative to the reference, or absolute where it is zero."""
        difference = abs(self.computed - self.reference)
        return difference / abs(self.reference) if self.reference else difference

    @property
    def passes(self) -> bool:
        """True if the error is a number within the bound."""
        return math.isfinite(self.error) and self.error <= self.bound
