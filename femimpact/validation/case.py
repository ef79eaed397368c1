"""A reference case: a known number, the same number computed, how close it must be; tables; and a common system."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from femimpact.system.system import System


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


def oscillator(damping: float = 0.0, omega: float = 1.0, shape: float = 1.0, **others: Any) -> System:
    """A mode of 1 kg by its damping ratio, natural frequency (rad/s) and displacement at its place "tip"."""
    return System.from_matrices([[1.0]], [[2 * damping * omega]], [[omega**2]], points={"tip": [shape]}, **others)


HEADER = ("case", "source", "quantity", "reference", "computed", "error", "bound", "pass")


def table_row(case: Case) -> tuple[str, ...]:
    """One case as the words of a table's row, by `HEADER`."""
    quantity = case.quantity if case.unit == "1" else f"{case.quantity} ({case.unit})"
    # + 0.0: a zero has no sign
    numbers = (f"{case.reference + 0.0:.8g}", f"{case.computed + 0.0:.8g}", f"{case.error:.1e}", f"{case.bound:.1e}")
    return case.name, case.source, quantity, *numbers, "yes" if case.passes else "NO"


def case_columns(cases: Sequence[Case]) -> dict[str, list[Any]]:
    """The cases as columns of plain values, with their units and the reasons of their bounds."""
    names = ("name", "source", "quantity", "unit", "reference", "computed", "error", "bound", "passes", "reason")
    return {name: [getattr(case, name) for case in cases] for name in names}


def markdown_table(cases: Sequence[Case]) -> str:
    """The table as Markdown, each bound with its reason."""
    header = (*HEADER, "why this bound")
    # a bar inside a cell would end it
    rows = [[word.replace("|", "\\|") for word in (*table_row(case), case.reason)] for case in cases]
    return "\n".join(f"| {' | '.join(row)} |" for row in (header, ["---"] * len(header), *rows)) + "\n"
