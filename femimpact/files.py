"""Files written under a temporary name and then renamed, so that none is left incomplete; tables as such files.

Tables and labelled data: CSV with units in the header, netCDF, JSON.
"""

from __future__ import annotations

import csv
import errno
import io
import json
import math
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.errors import require, require_path
from femimpact.regular_file import decimal_number, kind_of, open_regular

__all__ = ["dataset_columns", "plain", "read_csv", "read_units", "write_csv", "write_json", "write_netcdf"]


if TYPE_CHECKING:
    import xarray


NO_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EROFS)
"""Error numbers of a file system that cannot write through to the disk."""


def file_path(path: str | Path) -> Path:
    """The path of a file, which need not exist.

    Raises `InputError` if it is no path: neither text nor a `Path`, no name, or a null character in it.
    """
    require_path(path, "path", "a file")
    require(bool(Path(path).name), "path", str(path), "", "must be the path of a file")
    return Path(path)


def target_path(path: str | Path) -> Path:
    """The path of a file that is written, where none is or a regular one.

    Raises `InputError` as of `file_path`, or if a pipe, a device, a socket or a directory is there, or a link to an
    open file, as /dev/stdout, all of which a rename would remove.
    """
    target, kind = file_path(path), ""
    with suppress(OSError):
        kind = kind_of(os.stat(target)) or "a link to an open file" * os.readlink(target).startswith("/proc/")
    require(not kind, "path", str(path), "", f"must be a file: this is {kind}")
    return target


@contextmanager
def atomic_path(
    path: str | Path,  # in an existing directory
) -> Iterator[Path]:
    """A temporary sibling that becomes `path` when the block ends well, and vanishes when it does not.

    Yields: where to write; it has the suffix of `path`.

    Raises `OSError` with the name of `path`, never with the temporary one.
    """
    target = target_path(path)
    require(target.parent.is_dir(), "path", str(path), "", f"must be in an existing directory: make {target.parent}")
    prefix = f".{target.stem}-"
    try:
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=target.suffix, dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            # mkstemp makes a private file; a result is an ordinary one
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            to_disk(temporary)
            os.replace(temporary, target)
        finally:
            with suppress(OSError):
                temporary.unlink()
    except OSError as error:
        # a failed write names no file, the others a hidden one
        hidden = error.filename is None or Path(os.fsdecode(error.filename)).name.startswith(prefix)
        if error.errno is not None and hidden:
            error.filename = str(target)
            # None would be shown as the end of an arrow
            del error.filename2
        raise


def atomic_write(path: str | Path, content: str | bytes) -> None:
    """Write text (UTF-8) or bytes to a file, which is complete or stays as it was."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def to_disk(path: Path) -> None:
    """Write a file, or the names in a directory, through to the disk, before a rename relies on it."""
    if path.is_dir() and os.name != "posix":  # no such thing outside POSIX
        return
    file = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(file)
    except OSError as error:
        if error.errno not in NO_SYNC:
            raise
    finally:
        os.close(file)


class GuardedFile(io.FileIO):
    """A file, written anew, for the HDF5 library that keeps the first failed write to itself and raises it when left.

    A write that fails inside HDF5 (a full disk) leaves its caches in a state in which closing the file ends
    the process. Here the library gets success from every write, and the caller gets the first failure.
    """

    failure: BaseException | None = None

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")

    def check(self) -> None:
        """Raise the first write that failed, if one did."""
        if self.failure is not None:
            raise self.failure

    def write(self, data: Any) -> int:
        """All of the data, or none and the failure kept."""
        rest = memoryview(data).cast("B")
        size = rest.nbytes
        try:
            while self.failure is None and rest.nbytes:
                rest = rest[super().write(rest) :]
        except BaseException as failure:
            self.failure = failure
        return size

    def readinto(self, buffer: Any) -> int:
        """Fill the buffer; what a failed write did not leave reads as zeros."""
        view = memoryview(buffer).cast("B")
        size = super().readinto(view) or 0
        if size < view.nbytes and self.failure is not None:
            view[size:] = bytes(view.nbytes - size)
            return view.nbytes
        return size

    def truncate(self, size: int | None = None) -> int:
        """Cut or lengthen the file; a failure is kept."""
        try:
            return super().truncate(size)
        except BaseException as failure:
            self.failure = self.failure or failure
            return size or 0

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Close the file; a failed write is raised in place of the error that HDF5 raised for it."""
        self.close()
        if self.failure is not None and (error is None or isinstance(error, Exception)):
            raise self.failure from None


NO_DECIMALS = ("nan", "inf", "-inf")
"""Numbers that `write_csv` writes too."""


def write_csv(path: str | Path, columns: Mapping[str, Sequence[Any]], units: Mapping[str, str]) -> Path:
    """Write equal-long columns as CSV; a header is the name and, in brackets, the unit.

    Parameters
    ----------
    units : mapping of str to str
        Columns without a unit are left out of it.
    """
    path = Path(path)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{name} [{units[name]}]" if units.get(name) else name for name in columns])
    for row in zip(*columns.values(), strict=True):
        writer.writerow([repr(float(value)) if isinstance(value, (float, np.floating)) else value for value in row])
    atomic_write(path, text.getvalue())
    return path


def dataset_columns(dataset: xarray.Dataset) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns and units of a labelled dataset, as `write_csv` takes them: a row for each point of its largest variable.

    Coordinates come first; what does not vary along an axis is repeated.
    """
    whole = max(dataset.data_vars.values(), key=lambda values: values.ndim)
    columns: dict[str, Any] = {}
    units: dict[str, str] = {}
    for group in (dataset.coords, dataset.data_vars):
        for name, values in group.items():
            columns[str(name)] = np.asarray(values.broadcast_like(whole).transpose(*whole.dims).to_numpy()).reshape(-1)
            unit = str(values.attrs.get("units", ""))
            if unit and unit != "1":
                units[str(name)] = unit
    return columns, units


def read_csv(path: str | Path) -> dict[str, Any]:
    """Read a table that `write_csv` wrote: arrays by name, the unit taken off; numbers where all are.

    Raises
    ------
    OSError
        If it cannot be read, or is no regular file.
    ValueError
        If it has no header, a row of another length, or in a column with a unit a cell that is no number.
    """
    path = file_path(path)
    require(path.exists(), "path", str(path), "", "must be an existing table")
    with open_regular(path) as raw, io.TextIOWrapper(raw, encoding="utf-8", newline="") as file:
        lines = csv.reader(file)
        header = next(lines, None)
        if header is None:
            raise ValueError("it is empty")
        rows = []
        for row in lines:
            if len(row) != len(header):
                raise ValueError(f"line {lines.line_num} has {len(row)} cells, the header {len(header)}")
            rows.append((lines.line_num, row))
    columns: dict[str, Any] = {}
    for i, title in enumerate(header):
        name, _, unit = title.partition(" [")
        cells = ((line, row[i]) for line, row in rows)
        other = next((one for one in cells if decimal_number(one[1]) is None and one[1] not in NO_DECIMALS), None)
        if unit and other is not None:
            raise ValueError(f"line {other[0]}, {name}: {other[1]!r} is no number")
        columns[name] = np.array([row[i] for _, row in rows], dtype=float if other is None else str)
    return columns


def read_units(path: str | Path) -> dict[str, str]:
    """Units of the columns of a table that `write_csv` wrote, by their names; of those that have one."""
    with open_regular(file_path(path)) as raw, io.TextIOWrapper(raw, encoding="utf-8", newline="") as file:
        header = next(csv.reader(file), [])
    parts = [title.partition(" [") for title in header]
    return {name: unit.removesuffix("]") for name, _, unit in parts if unit}


def write_json(path: str | Path, data: Mapping[str, Any]) -> Path:
    """Write plain data as JSON; what is not a finite number becomes null, the only notation that JSON has for it."""
    path = Path(path)
    atomic_write(path, json.dumps(plain(data), indent=2, allow_nan=False) + "\n")
    return path


def plain(value: Any) -> Any:
    """The same data in what JSON has; a number that is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (np.integer, np.bool_)):
        return value.item()
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value


def write_netcdf(path: str | Path, dataset: xarray.Dataset, **groups: xarray.Dataset) -> Path:
    """Write a labelled dataset as netCDF 4, compressed without loss, and others as groups of it by their names."""
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    path = Path(path)
    # `Dataset.to_netcdf` of earlier versions takes no open file for this engine, and writes another format
    with atomic_path(path) as temporary, GuardedFile(temporary) as file, h5netcdf.File(file, "w") as root:
        for name, data in {"": dataset, **groups}.items():
            smaller = data.copy()
            for values in smaller.variables.values():
                if values.size > 1000 and values.dtype.kind in "fiu":
                    values.encoding = {**values.encoding, "zlib": True, "complevel": 1, "shuffle": True}
            smaller.dump_to_store(H5NetCDFStore(root.create_group(name) if name else root))
    return path


def load_netcdf(
    path: Path,
    engine: str | None = "h5netcdf",  # None is that of the file's own format
    group: str | None = None,
) -> Any:
    """The dataset of a netCDF file that is no device or pipe, or a group of one; None where it has no such group."""
    import h5netcdf
    import xarray

    # the library opens it by its name
    with open_regular(path) as file:
        begin = file.read(len(HDF5))
    require(begin == HDF5 or begin.startswith(b"CDF"), "format", "another one", "", "must be netCDF")
    if group is not None:
        with h5netcdf.File(path) as root:
            if group not in root.groups:
                return None
    return xarray.load_dataset(path, engine=engine, group=group)


HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of a file in the format of netCDF 4; earlier ones begin with CDF."""
