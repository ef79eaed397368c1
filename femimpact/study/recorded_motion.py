"""The base motion of a study that a record gives: a file of columns beside the study file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

from femimpact.errors import InputError, check_fields, checked, choice, optional, quantity, text
from femimpact.excitation import RecordedBase
from femimpact.excitation.record_file import record_text

__all__ = ["RecordedMotion", "record_beside"]

NUMBER = quantity("1", at_least=0, integer=True)
"""Of a column that has no name."""


@dataclass(frozen=True)
class RecordedMotion:
    """`[base]`: the file of a record with the options of `RecordedBase.from_csv`, duration of the history, and start.

    Parameters
    ----------
    record : str
        Path of the file, from the folder of the study file.
    content : str
        The file as read: no run reads it again, wherever it is by then.
    scale : float
        Times which the column is m/s^2: 9.80665 for a record in g.
    detrend : {"none", "mean", "line"}
        What is removed: the mean of the acceleration (an offset), or its line of least squares (offset and drift).
    columns : two of int or str
        Time and acceleration, by their numbers from 0 or their names in the header.
    duration : float or None, s
        Of the simulated history; None is that of the record.
    start : {"base", "space", "static"}
        At rest relative to the base, at rest in the inertial frame, or in the static state (`State.static`).

    Raises
    ------
    InputError
        If a value is out of range, or the content is no record.
    """

    FREQUENCY_KEY: ClassVar[str] = "base.record"
    """What a study file has where the frequency of a cycle comes from."""

    record: str = field(metadata=text())
    content: str = field(repr=False, metadata=text())
    scale: float = field(default=1.0, metadata=quantity("1"))
    detrend: str = field(default="none", metadata=choice("none", "mean", "line"))
    columns: tuple[int | str, int | str] = (0, 1)
    duration: float | None = field(default=None, metadata=optional(quantity("s", above=0.0)))
    start: str = field(default="base", metadata=choice("base", "space", "static"))

    def __post_init__(self) -> None:
        check_fields(self)
        if isinstance(self.columns, (tuple, list)):
            plain = (str(c) if isinstance(c, str) else checked("columns", c, NUMBER) for c in self.columns)
            object.__setattr__(self, "columns", tuple(plain))
        with _faults_of_record():
            # made here, so that its faults are those of this noun
            _ = self.excitation

    @cached_property
    def excitation(self) -> RecordedBase:
        """The motion that drives the history."""
        return RecordedBase.from_text(self.content, self.scale, self.detrend, self.columns, self.record)

    @property
    def frequency(self) -> float:
        """What a cycle means, Hz: that of the largest line of the record's spectrum."""
        return self.excitation.frequency

    @property
    def history_duration(self) -> float:
        """Time (s) that the history takes."""
        return self.excitation.duration if self.duration is None else self.duration

    @property
    def words(self) -> str:
        """How long the history is, and what drives it."""
        base = self.excitation
        cycle = "a cycle is that of its largest line" if base.has_cycle else "no cycle; its largest line is at"
        return (
            f"{self.history_duration:g} s of the record {self.record!r} ({base.samples.size} samples, "
            f"{base.interval:.6g} s apart; {cycle}{',' * base.has_cycle} {base.frequency:.4g} Hz)"
        )


def record_beside(folder: Path, record: str) -> str:
    """What the file of a record holds, its path being given from a folder.

    Raises
    ------
    InputError
        If it cannot be read, or is no text.
    """
    with _faults_of_record():
        return record_text(folder / record)


@contextmanager
def _faults_of_record() -> Iterator[None]:
    """Faults of a file under the key that a study file has for it."""
    try:
        yield
    except InputError as error:
        raise InputError([replace(f, key="record") if f.key == "path" else f for f in error.faults]) from None
