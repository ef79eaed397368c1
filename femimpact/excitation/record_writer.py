"""Records of measured or simulated signals as files: columns of text with units, and UFF 58."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femimpact.arrays import Array, even_interval
from femimpact.errors import checked, instance, require
from femimpact.excitation.record_files import columns_in
from femimpact.excitation.uff import UFF, names_in_uff, write_uff
from femimpact.files import atomic_path
from femimpact.units import read_unit

if TYPE_CHECKING:
    import xarray


def write_record(path: str | Path, dataset: xarray.Dataset) -> Path:
    """Write signals over time as a file of columns with a row of units, or as UFF 58 where the name ends with .uff.

    Parameters
    ----------
    path : str or Path
    dataset : xarray.Dataset
        Of signals over one axis, `time` (timedelta64, or numbers in s or the unit that it names), as of `read_record`.
        UFF 58 keeps 6 digits of the interval and 12 of a sample.

    Raises
    ------
    InputError
        If the dataset has no signal over `time`, holds what is no finite number, its times are no times from a
        beginning or not evenly spaced, it has a name or a unit that would be read back as another, or no file can be
        there.
    """
    file = Path(checked("path", path, instance(str, Path)))
    sound = hasattr(dataset, "data_vars") and "time" in dataset.coords and len(dataset.data_vars) > 0
    sound = sound and all(array.dims == ("time",) and array.dtype.kind in "iuf" for array in dataset.data_vars.values())
    require(sound, "dataset", type(dataset).__name__, "", "must be an xarray.Dataset of numbers over the axis time")
    time = _seconds(dataset["time"])
    held = [(_line(name), _line(array.attrs.get("units", "")), np.asarray(array, dtype=float))
            for name, array in dataset.data_vars.items()]  # fmt: skip
    for name, values in (("time", time), *((name, values) for name, _, values in held)):
        require(bool(np.isfinite(values).all()), "dataset", name, "", "must hold finite numbers")
    require(time.size >= 2, "dataset", time.size, "samples", "must have 2 or more")
    step, bad = even_interval(time)
    require(bad < 0, "dataset", time[max(bad, 0)], "s", "must have evenly spaced times that rise: this one is off")
    is_uff = file.suffix.lower() in UFF
    text = "" if is_uff else _header(held)
    # what stands for the rows
    read_back = names_in_uff(held) if is_uff else columns_in(text + "".join(f"{k}{',0' * len(held)}\n" for k in (0, 1)))
    for (name, unit, _), other in itertools.zip_longest(held, read_back, fillvalue=("", "", None)):
        back = f"as {other[0]!r}{f' in {other[1]}' if other[1] else ''}" if other[0] else "as no signal"
        same = bool(name) and (name, unit) == tuple(other[:2])
        require(same, "dataset", name, unit, f"would be read back {back}: choose another name or unit")
    with atomic_path(file) as unfinished:
        if is_uff:
            write_uff(unfinished, float(time[0]), step, held)
        else:
            table = np.column_stack([time, *(values for _, _, values in held)])
            np.savetxt(unfinished, table, fmt="%.17g", delimiter=",", header=text[:-1], comments="", encoding="utf-8")
    return file


def _seconds(time: xarray.DataArray) -> Array:
    """Times in s, from timedelta64 or from numbers in a unit that they name."""
    kind, unit = time.dtype.kind, str(time.attrs.get("units") or "s")
    if kind == "m":
        return np.asarray(time.to_numpy() / np.timedelta64(1, "s"))
    kinds = "must be numbers or timedelta64, from a beginning on: subtract the first time"
    require(kind in "iuf", "dataset", f"time of {time.dtype}", "", kinds)
    known = read_unit(unit, ("s",))
    require(known is not None, "dataset", unit, "", "must have its time in a unit of s")
    return np.asarray(time, dtype=float) * (known[1] if known else 1.0)


def _line(word: object) -> str:
    """A name or a unit without the ends of lines."""
    return " ".join(str(word).split())


def _header(held: Sequence[tuple[str, str, Array]]) -> str:
    """Rows of names and of units."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["time", *(name for name, _, _ in held)])
    rows.writerow(["s", *(unit or "-" for _, unit, _ in held)])
    return text.getvalue()
