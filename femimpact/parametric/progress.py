"""How far a study is."""

from __future__ import annotations

from dataclasses import dataclass, field

from femimpact.errors import check_fields, quantity

__all__ = ["StudyProgress"]


@dataclass(frozen=True)
class StudyProgress:
    """How far a study is.

    Parameters
    ----------
    cases : int
    finished : int
        Those found on disk included.
    found : int
        Cases that an earlier call had finished.
    failed : int
        Finished cases of which a start has no values.
    rate : float, 1/s
        Cases finished in a second by this call.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    cases: int = field(metadata=quantity("1", at_least=1, integer=True))
    finished: int = field(metadata=quantity("1", at_least=0, integer=True))
    found: int = field(metadata=quantity("1", at_least=0, integer=True))
    failed: int = field(metadata=quantity("1", at_least=0, integer=True))
    rate: float = field(metadata=quantity("1/s", at_least=0.0))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def share(self) -> float:
        """Share that is done, 0 to 1."""
        return self.finished / self.cases

    @property
    def remaining(self) -> float:
        """Time (s) that the rest takes at this rate; infinite before the first cases."""
        left = self.cases - self.finished
        return left / self.rate if self.rate > 0.0 else float("inf") if left else 0.0

    def __float__(self) -> float:
        return self.share

    def __str__(self) -> str:
        failed = f", {self.failed} failed" if self.failed else ""
        return f"{self.finished} of {self.cases} cases, {self.rate:.3g}/s{failed}"
