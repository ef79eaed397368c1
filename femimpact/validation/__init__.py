"""The reference cases: exact and published numbers beside those computed here, in the order of their table."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from femimpact.validation import beams, contacts, excitations, ledgers, orbits, other_programs, structures
from femimpact.validation.case import Case, case_columns, markdown_table

__all__ = ["Case", "case_columns", "markdown_table", "run_validation"]

REFERENCE_CASES: tuple[Callable[[], Iterator[Case]], ...] = (
    *beams.CASES, *structures.CASES, *beams.TAPER_CASES, *structures.OSCILLATOR_CASES, *excitations.CASES,
    *contacts.IMPACT_CASES, *orbits.CASES, *contacts.CASES,
    *ledgers.CASES, *excitations.READING_CASES,
)  # fmt: skip
"""Functions that run cases, each those of one subject."""


def run_validation(
    progress: Callable[[str, float], None] | None = None, *, with_programs: bool = False
) -> tuple[Case, ...]:
    """Run every reference case, or every comparison with other programs.

    Parameters
    ----------
    progress : callable, optional
        Called with "validation" and the share done, 0 to 1.
    with_programs : bool
        The numbers of other programs in place of the exact and published ones.

    Returns
    -------
    tuple of Case
        In the order of the table; a failed one is among them.
    """
    comparisons = list[Case]()
    functions = other_programs.PROGRAMS if with_programs else REFERENCE_CASES
    for i, cases in enumerate(functions):
        comparisons.extend(cases())
        if progress is not None:
            progress("validation", (i + 1) / len(functions))
    return tuple(comparisons)
