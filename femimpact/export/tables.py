"""Tables and labelled data on disk: CSV with units in the header, netCDF, JSON; what is drawn of a study's dataset."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import require
from femimpact.export.files import GuardedFile, atomic_path, atomic_write, file_path
from femimpact.regular_file import decimal_number, open_regular
from femimpact.units import GRAVITY, typeset_number

if TYPE_CHECKING:
    import xarray

__all__ = ["plain", "read_csv", "read_units", "write_csv", "write_json", "write_netcdf"]

BESIDE = frozenset({"periodic_starts", "failed_starts", "finished", "failure"})
"""Variables that are about the cases themselves."""

STATISTICS = ("_low", "_high", "_median_low", "_median_high", "_quantile_5", "_quantile_95", "_groups")
"""Endings of what is known of a measure beside its median."""


def measure_names(
    dataset: xarray.Dataset,  # xarray.Dataset: of `parameter_study`, or any other: then every variable of numbers
) -> list[str]:
    """Names of the measures that are numbers and have a value somewhere, without their statistics."""
    everything = {str(name) for name in dataset.data_vars}

    def is_statistic(name: str) -> bool:
        return any(name.endswith(end) and name.removesuffix(end) in everything for end in STATISTICS)

    return [
        str(name)
        for name, values in dataset.data_vars.items()
        if values.dtype.kind in "fiu"
        and str(name) not in BESIDE
        and not is_statistic(str(name))
        and np.isfinite(values.to_numpy()).any()
    ]


PAIRED = ", number of the pair of values"
"""End of the long name of an axis of gaps of which some are a pair: its numbers count them."""


def axis_names(dataset: xarray.Dataset) -> list[str]:
    """Names of the axes: coordinates but for the numbers of the cases and the two sides of pairs of gaps."""
    names = [str(name) for name in dataset.coords if name != "case"]
    sides = {f"{name}.{side}" for name in names for side in ("plus", "minus")}
    return [name for name in names if name not in sides]


def axis_words(dataset: xarray.Dataset, name: str) -> str:
    """Long name of an axis."""
    return str(dataset[name].attrs.get("long_name", name)).removesuffix(PAIRED)


def value_words(dataset: xarray.Dataset, name: str) -> list[str] | None:
    """Words of the values of an axis of names, or of gaps of which some are a pair (mm); None where numbers say it."""
    values = dataset[name].to_numpy()
    if f"{name}.plus" in dataset.coords:
        sides = (dataset[f"{name}.{side}"].to_numpy().reshape(-1).tolist() for side in ("plus", "minus"))
        return [f"({1e3 * plus:.4g}, {1e3 * minus:.4g})" for plus, minus in zip(*sides, strict=True)]
    return [str(value) for value in values.reshape(-1)] if values.dtype.kind not in "iuf" else None


def axis_value(dataset: xarray.Dataset, axis: str, index: int) -> tuple[str, str | float, str]:
    """Words of an axis, one of its values (a text where numbers do not say it), and the unit of the value, or ""."""
    if axis not in dataset.variables:
        return axis, str(index), ""
    names, unit = value_words(dataset, axis), str(dataset[axis].attrs.get("units", ""))
    if names is not None:
        return axis_words(dataset, axis), names[index], "mm" if f"{axis}.plus" in dataset.coords else ""
    value = float(dataset[axis].to_numpy().reshape(-1)[index])
    return axis_words(dataset, axis), value, "" if unit == "1" else unit


PREFIXES = {"m": (1e3, "mm"), "Pa": (1e-6, "MPa"), "N s": (1e3, "mN s"), "kg": (1e3, "g")}
"""Units of axes and measures that are shown in another one, by its factor and its name: the same wherever they are."""


def in_shown_units(columns: Mapping[str, Any], units: Mapping[str, str]) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns of numbers in the units in which they are shown, and these units."""
    shown = {name: PREFIXES.get(unit, (1.0, unit)) for name, unit in units.items()}
    scaled = {
        name: shown[name][0] * np.asarray(values)
        if name in shown and np.asarray(values).dtype.kind in "iuf"
        else values
        for name, values in columns.items()
    }
    return scaled, {name: unit for name, (_, unit) in shown.items()}


def case_columns(
    dataset: xarray.Dataset,  # of `parameter_study`
) -> tuple[dict[str, Any], dict[str, str]]:
    """A row for every case: values of the axes, then of the measures; and units."""
    shape = dataset["finished"].shape
    columns: dict[str, Any] = {}
    units: dict[str, str] = {}
    for group in (dataset.coords, dataset.data_vars):
        for name, values in group.items():
            column = values.broadcast_like(dataset["finished"]).transpose(*dataset["finished"].dims)
            columns[str(name)] = np.asarray(column.to_numpy()).reshape(int(np.prod(shape)))
            unit = str(values.attrs.get("units", ""))
            if unit and unit != "1":
                units[str(name)] = unit
    return columns, units


def unit_text(value: float, unit: str) -> str:
    """A number for the eye, with its unit."""
    factor, name = PREFIXES.get(unit, (1.0, unit))
    return f"{typeset_number(factor * float(value))} {unit_words(value, name)}".rstrip()


def unit_words(value: float, unit: str) -> str:
    """The unit that stands behind a number, of an acceleration with the number in g."""
    if unit == "m/s^2":
        return f"{unit} ({typeset_number(float(value) / GRAVITY, 3)} g)"
    return "" if unit == "1" else unit


PARAMETER_DIGITS = 8
"""Significant digits of a value of the parameter of branches: bifurcations side by side differ there."""


def parameter_text(value: float, unit: str) -> str:
    """A value of the parameter of branches with its unit."""
    return f"{value:.{PARAMETER_DIGITS}g} {unit_words(value, unit)}".rstrip()


def value_text(value: Any, unit: str) -> str:
    """A value of an axis for the eye: a name, a number or a pair of gaps."""
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return f"({', '.join(f'{1e3 * side:.4g}' for side in value)}) mm"
    return unit_text(value, unit)


def sample_axes(dataset: xarray.Dataset) -> list[str]:
    """Names of the coordinates over which a list or a sample of cases is drawn; of pairs of gaps the two sides."""
    return [str(name) for name in dataset.coords if name != "case" and f"{name}.plus" not in dataset.coords]


def thinned(count: int, most: int) -> NDArray[np.int64]:
    """At most so many of the numbers 0 to count - 1, evenly spread, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))


def map_panels(
    dataset: xarray.Dataset,
    axes: Sequence[str],  # three or more; the first two are those of each map
    most: int,  # values of the third axis where there is no fourth
    most_each: int,  # values of the third axis and of the fourth
) -> tuple[dict[str, list[int]], dict[str, int]]:
    """Numbers of the values of the third axis and the fourth that have a map, and of the others the middle one."""
    further = axes[2:4]
    shown = {name: thinned(dataset.sizes[name], most if len(further) < 2 else most_each).tolist() for name in further}
    return shown, {name: dataset.sizes[name] // 2 for name in axes[4:]}


def single_samples(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """True where a value is a sample of a motion that does not repeat, without an interval of its median.

    Of a dataset that is none of a parameter study nothing is known of it.
    """
    if "finished" not in dataset:
        return np.zeros((), dtype=bool)
    if "median_interval" in dataset.attrs:
        return np.zeros(dataset["finished"].shape, dtype=bool)
    repeated = dataset["periodic_starts"].to_numpy() + dataset["failed_starts"].to_numpy()
    return np.asarray((repeated < int(dataset.attrs.get("starts", 1))) & (dataset["finished"].to_numpy() > 0))


def unsure_cells(dataset: xarray.Dataset, measure: str) -> NDArray[np.bool_]:
    """True where the interval of the median is wider than the largest difference to the median of a neighbour."""
    median = dataset[measure].to_numpy()
    if f"{measure}_median_low" not in dataset:
        return np.zeros(median.shape, dtype=bool)
    width = dataset[f"{measure}_median_high"].to_numpy() - dataset[f"{measure}_median_low"].to_numpy()
    largest = np.zeros(median.shape)
    for dim in range(median.ndim):
        step = np.nan_to_num(np.abs(np.diff(median, axis=dim)))
        before, after = ([slice(None)] * median.ndim for _ in range(2))
        before[dim], after[dim] = slice(0, -1), slice(1, None)
        for side in (tuple(before), tuple(after)):
            largest[side] = np.maximum(largest[side], step)
    return np.asarray(width > largest)


UNSURE = "starts differ by more than neighbouring cells do"
"""Meaning of the mark in the corner of a cell of `unsure_cells`."""


@dataclass(frozen=True)
class BestMarks:
    """What a line of a measure over one axis has besides, in SI units."""

    within: str = ""  # words of the spans
    levels: tuple[tuple[str, float], ...] = ()  # words and values of the measure
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # by axis, its lowest and highest value


OUTLINED, OUTLINE = "the best", "#e4002b"
"""Meaning and colour of the outline of a cell at which `is_best` of a dataset is true."""

LOGARITHMIC = 10.0
"""Largest over smallest value of a map beyond which its colours are logarithmic, where all values are above 0."""


def has_logarithmic_colours(
    values: Array,  # of all cells that share a scale of colours; what is not finite does not count
) -> bool:
    """True where the colours of a map are to be logarithmic: one large cell would leave the others one colour."""
    finite = values[np.isfinite(values)]
    return bool(finite.size and finite.min() > 0.0 and finite.max() > LOGARITHMIC * finite.min())


# ---- tables on disk -------------------------------------------------------------------------------


NO_DECIMALS = ("nan", "inf", "-inf")
"""Numbers that `write_csv` writes too."""


def write_csv(path: str | Path, columns: Mapping[str, Sequence[Any]], units: Mapping[str, str]) -> Path:
    """Write equal-long columns as CSV; a header is the name and, in brackets, the unit.

    Parameters
    ----------
    path : str or Path
    columns : mapping of str to sequence
    units : mapping of str to str
        Columns without a unit are left out of it.

    Returns
    -------
    Path
    """
    path = Path(path)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([f"{name} [{units[name]}]" if units.get(name) else name for name in columns])
    for row in zip(*columns.values(), strict=True):
        writer.writerow([repr(float(value)) if isinstance(value, (float, np.floating)) else value for value in row])
    atomic_write(path, text.getvalue())
    return path


def read_csv(path: str | Path) -> dict[str, Any]:
    """Read a table that `write_csv` wrote: arrays by name, the unit taken off; numbers where all are.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    dict of str to ndarray (rows,)

    Raises
    ------
    InputError
        If there is no such file.
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


def write_netcdf(path: str | Path, dataset: xarray.Dataset) -> Path:
    """Write a labelled dataset as netCDF 4."""
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    path = Path(path)
    # `Dataset.to_netcdf` of earlier versions takes no open file for this engine, and writes another format
    with atomic_path(path) as temporary, GuardedFile(temporary) as file, h5netcdf.File(file, "w") as root:
        dataset.dump_to_store(H5NetCDFStore(root))
    return path
