"""A directory of results while its report is made: what cannot be read is noted, and stops nothing."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from femimpact.export import tables
from femimpact.structure.structure import Structure
from femimpact.study.picture_data import read_mode_shapes
from femimpact.study.result_directory import ResultsWarning
from femimpact.study.result_files import FILES
from femimpact.study.results import read_dataset, read_table

if TYPE_CHECKING:
    import xarray

    from femimpact.system.modes import Modes
    from femimpact.system.system import System

__all__ = ["ResultReading", "texts_of"]

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class ResultReading:
    """A directory of results while it is read.

    Parameters
    ----------
    folder : Path
        With the files.
    summary : dict
        Empty where there is none.
    missing : list of str
        What could not be read, and why.
    """

    folder: Path
    summary: dict[str, Any]
    missing: list[str] = field(default_factory=list)

    def attempt(self, what: str, make: Callable[[], T]) -> T | None:
        """What `make` returns; None, and a line of what is missing, where it fails."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                found: T | None = make()
            # what damaged results make a reader raise is without limit, and a report is made of the rest
            except Exception as error:
                words = " ".join(str(error).split()) or type(error).__name__
                self.miss(words if words.startswith(str(self.folder)) else f"{what}: {words}")
                found = None
        for one in caught:
            if issubclass(one.category, ResultsWarning):
                self.miss(str(one.message))
        return found

    @cached_property
    def history(self) -> xarray.Dataset | None:
        """The history; None where there is none, or it cannot be read."""
        return self.attempt(FILES["history"], lambda: read_dataset(self.folder, "history", self.summary))

    @cached_property
    def modes(self) -> tuple[System, Modes, Structure | None] | None:
        """The mode shapes, as the history."""
        return self.attempt(FILES["mode_shapes"], lambda: read_mode_shapes(self.folder, self.summary))

    def miss(self, text: str) -> None:
        """Note what is missing, with names of files alone: a report does not hang on where its directory is."""
        plain = text.replace(f"{self.folder}/", "").replace(f"{self.folder}: ", "")[:400]
        if plain not in self.missing:
            self.missing.append(plain)

    def table(self, name: str) -> dict[str, Any] | None:
        """A table of the results by the name of its file; None where there is none, or it cannot be read."""
        return self.attempt(name, lambda: read_table(self.folder, name, self.summary))

    def units(self, name: str) -> dict[str, str]:
        """Units of the columns of a table that was read."""
        return self.attempt(name, lambda: tables.read_units(self.folder / name)) or {}


def texts_of(values: Any) -> tuple[str, ...]:
    """What a summary has for a list of texts, whatever stands there."""
    return tuple(str(one) for one in values) if isinstance(values, (list, tuple)) else ()
