"""Records of measured or simulated signals as files: columns of text with units, and UFF 58."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import checked, instance, require
from femimpact.excitation.record_files import UFF, load_pyuff
from femimpact.export.files import atomic_path, atomic_write
from femimpact.identification import DecayEstimate

if TYPE_CHECKING:
    import xarray

KINDS = {"m": 8, "m/s": 11, "m/s^2": 12, "N": 13}
"""Type of the data of a UFF dataset by the SI unit."""


def write_record(path: str | Path, dataset: xarray.Dataset) -> Path:
    """Write signals over time as a file of columns with a row of units, or as UFF 58 where the name ends with .uff.

    Parameters
    ----------
    path : str or Path
    dataset : xarray.Dataset
        Of signals over one axis, `time` (s), as of `read_record`.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If the dataset has no signal over `time`, or no file can be there.
    """
    file = Path(checked("path", path, instance(str, Path)))
    sound = hasattr(dataset, "data_vars") and "time" in dataset.coords and len(dataset.data_vars) > 0
    sound = sound and all(one.dims == ("time",) and one.dtype.kind in "iuf" for one in dataset.data_vars.values())
    require(sound, "dataset", type(dataset).__name__, "", "must be an xarray.Dataset of numbers over the axis time")
    time = np.asarray(dataset["time"], dtype=float)
    signals = {str(name): np.asarray(one, dtype=float) for name, one in dataset.data_vars.items()}
    with atomic_path(file) as made:
        if file.suffix.lower() in UFF:
            _write_uff(made, time, signals, {name: str(dataset[name].attrs.get("units", "")) for name in signals})
        else:
            table = np.column_stack([time, *signals.values()])
            names = [re.sub(r"[,;\t\n\"#]", " ", name) for name in signals]
            units = [str(dataset[name].attrs.get("units", "")) or "-" for name in signals]
            header = "\n".join([",".join(["time", *names]), ",".join(["s", *units])])
            np.savetxt(made, table, fmt="%.17g", delimiter=",", header=header, comments="")
    return file


def _write_uff(path: Path, time: Array, signals: dict[str, Array], units: dict[str, str]) -> None:
    pyuff = load_pyuff()
    step = float(time[-1] - time[0]) / max(time.size - 1, 1)
    require(math.isfinite(step) and step > 0.0, "dataset", step, "s", "must have rising times")
    sets = [
        pyuff.prepare_58(
            binary=0, func_type=1, rsp_node=i, rsp_dir=3, ref_node=i, ref_dir=3, data=values, x=time, id1=name[:80],
            ord_data_type=4, num_pts=time.size, abscissa_spacing=1, abscissa_min=float(time[0]), abscissa_inc=step,
            abscissa_spec_data_type=17, abscissa_axis_units_lab="s", orddenom_spec_data_type=0,
            ordinate_spec_data_type=KINDS.get(units[name], 0), ordinate_axis_units_lab=units[name][:20] or "NONE",
        )
        for i, (name, values) in enumerate(signals.items(), 1)
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


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
