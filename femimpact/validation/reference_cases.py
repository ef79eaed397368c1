"""All reference cases in the order of the table, run one after another, and printed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from femimpact.validation import beams, contacts, excitations, ledgers, orbits, structures, studies
from femimpact.validation.case import Case

REFERENCE_CASES: tuple[Callable[[], Case], ...] = (
    *beams.CASES, *structures.CASES, *beams.TAPER_CASES, *structures.OSCILLATOR_CASES, *excitations.CASES,
    *contacts.IMPACT_CASES, *orbits.CASES, *contacts.CASES, *ledgers.CASES, *excitations.READING_CASES, *studies.CASES,
)  # fmt: skip
"""Every case, not yet run."""

HEADER = ("case", "source", "quantity", "reference", "computed", "error", "bound", "pass")


def run_validation(progress: Callable[[str, float], None] | None = None) -> tuple[Case, ...]:
    """Run every reference case.

    Parameters
    ----------
    progress : callable, optional
        Called with "validation" and the share done, 0 to 1.

    Returns
    -------
    tuple of Case
        In the order of the table; a failed one is among them.
    """
    found = []
    for i, case in enumerate(REFERENCE_CASES):
        found.append(case())
        if progress is not None:
            progress("validation", (i + 1) / len(REFERENCE_CASES))
    return tuple(found)


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
