"""Records of measured or simulated signals as files: columns of text with units, and UFF 58."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import checked, instance, require
from femimpact.excitation.record_files import UFF, load_pyuff
from femimpact.export.files import atomic_path

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
