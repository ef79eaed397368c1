"""Records of measured or simulated signals as files: columns of text with units, and UFF 58."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.arrays import Array, even_interval
from femimpact.errors import checked, instance, require
from femimpact.excitation.uff import UFF, write_uff
from femimpact.export.files import atomic_path, atomic_write
from femimpact.identification import DecayEstimate
from femimpact.units import read_unit

if TYPE_CHECKING:
    import xarray


def write_record(path: str | Path, dataset: xarray.Dataset) -> Path:
    """Write signals over time as a file of columns with a row of units, or as UFF 58 where the name ends with .uff.

    Parameters
    ----------
    path : str or Path
    dataset : xarray.Dataset
        Of signals over one axis, `time` (s, or the unit that it names), as of `read_record`. UFF 58 keeps 6 digits of
        the interval and 12 of a sample.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If the dataset has no signal over `time`, holds what is no finite number, its times are not evenly spaced (UFF),
        or no file can be there.
    """
    file = Path(checked("path", path, instance(str, Path)))
    sound = hasattr(dataset, "data_vars") and "time" in dataset.coords and len(dataset.data_vars) > 0
    sound = sound and all(one.dims == ("time",) and one.dtype.kind in "iuf" for one in dataset.data_vars.values())
    require(sound, "dataset", type(dataset).__name__, "", "must be an xarray.Dataset of numbers over the axis time")
    unit = str(dataset["time"].attrs.get("units") or "s")
    known = read_unit(unit, ("s",))
    require(known is not None, "dataset", unit, "", "must have its time in a unit of s")
    time = np.asarray(dataset["time"], dtype=float) * (known[1] if known else 1.0)
    held = [(_cell(name), _cell(one.attrs.get("units", "")), np.asarray(one, dtype=float))
            for name, one in dataset.data_vars.items()]  # fmt: skip
    for name, values in (("time", time), *((name, values) for name, _, values in held)):
        require(bool(np.isfinite(values).all()), "dataset", name, "", "must hold finite numbers")
    with atomic_path(file) as made:
        if file.suffix.lower() in UFF:
            _write_uff(made, time, held)
        else:
            rows = [["time", *(name for name, _, _ in held)], ["s", *(unit or "-" for _, unit, _ in held)]]
            header = "\n".join(map(",".join, rows))
            table = np.column_stack([time, *(values for _, _, values in held)])
            np.savetxt(made, table, fmt="%.17g", delimiter=",", header=header, comments="")
    return file


def _cell(word: object) -> str:
    """A name or a unit without what ends a cell or a line."""
    return re.sub(r"[,;\s\"#]+", " ", str(word)).strip()


def _write_uff(path: Path, time: Array, held: list[tuple[str, str, Array]]) -> None:
    require(time.size >= 2, "dataset", time.size, "samples", "must have 2 or more in a UFF file")
    step, bad = even_interval(time)
    require(bad < 0, "dataset", time[max(bad, 0)], "s", "must have evenly spaced times in a UFF file: this one is off")
    write_uff(path, float(time[0]), step, held)


IDENTIFIED = ("identify.json", "identify.png")
"""Files of `write_decay`."""


def write_decay(
    directory: Path,
    found: DecayEstimate,
    record: xarray.Dataset,  # which it is of
    force: bool,  # whether files of the same names are replaced
) -> None:
    """Write what was identified from a record as JSON and as a figure."""
    from femimpact.export import figures

    there = ", ".join(name for name in IDENTIFIED if (directory / name).exists())
    require(force or not there, "output", str(directory), "", f"has {there} already: choose another, or --force")
    require(not directory.exists() or directory.is_dir(), "output", str(directory), "", "must be a directory")
    directory.mkdir(parents=True, exist_ok=True)
    columns, units = found.columns()
    content = {
        "source": record.attrs.get("source", ""), "signal": str(next(iter(record.data_vars))),
        "level": found.level, "modes": [vars(mode) for mode in found.modes], "noise": found.noise,
        "over_amplitude": {name: values.tolist() for name, values in columns.items()},
        "units": {**units, "noise": found.unit},
        "warnings": found.warnings, "notes": [*record.attrs.get("notes", ()), *found.notes],
    }  # fmt: skip
    atomic_write(directory / IDENTIFIED[0], json.dumps(_finite(content), indent=2, ensure_ascii=False) + "\n")
    figures.save_figure(figures.decay(found, ax=figures.OffScreen()), directory / IDENTIFIED[1])


def _finite(value: Any) -> Any:
    """The value with None where a number is not finite, which JSON has no word for."""
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
