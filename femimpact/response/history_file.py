"""A history on disk, written while the run goes on: netCDF 4 with a time axis that grows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from femimpact.errors import require, require_type
from femimpact.files import GuardedFile, atomic_path
from femimpact.response.history import HistoryPiece

__all__ = ["history_writer"]

CHUNK = 16_384
"""Samples that lie together in the file: 128 kB of one channel."""


@contextmanager
def history_writer(path: str | Path) -> Iterator[Callable[[HistoryPiece], None]]:
    """A sink for `Recorder` that writes channels, energies and the base's motion as they come.

    The file appears when the block ends well; when it does not, what was there before stays.
    `xarray.open_dataset(path, engine="h5netcdf")` reads it, a part at a time. Warnings and
    the energy residual are known at the end only: the response has them.

    Parameters
    ----------
    path : str or Path
        In an existing directory.

    Yields
    ------
    callable
        Takes one `HistoryPiece` after another; those of one run.

    Raises
    ------
    InputError
        If no file can be there; from the sink, for a piece with snapshots, which have no place in the
        file, or for one that does not follow the piece before.
    """
    import h5netcdf

    with atomic_path(path) as temporary, GuardedFile(temporary) as raw, h5netcdf.File(raw, "w") as file:

        def write(piece: HistoryPiece) -> None:
            require_type(piece, HistoryPiece, "piece")
            bare = piece.snapshots is None
            require(bare, "record.snapshots", None, "", "must be 0: this file has place for channels and energies only")
            _append(file, piece)
            file.flush()
            raw.check()

        yield write


def _append(file: Any, piece: HistoryPiece) -> None:
    """Add the samples of a piece behind those that the file has."""
    data = piece.to_xarray()
    if "time" not in file.dimensions:
        file.dimensions = {"time": None}
        file.attrs.update(data.attrs)
        for name, values in data.variables.items():
            variable = file.create_variable(str(name), ("time",), values.dtype, chunks=(CHUNK,))
            variable.attrs.update(values.attrs)
    before = file.dimensions["time"].size
    same = set(file.variables) == {str(name) for name in data.variables}
    later = before == 0 or piece.time.size == 0 or piece.time[0] > file.variables["time"][before - 1]
    require(same and later, "record.sink", None, "", "must get the pieces of one run, one after the other")
    file.resize_dimension("time", before + piece.time.size)
    for name, values in data.variables.items():
        file.variables[str(name)][before:] = values.values
