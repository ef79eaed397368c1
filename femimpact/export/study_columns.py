"""What the variables of a parameter study's dataset are: measures, their statistics over starts, and their marks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray

__all__ = [
    "BESIDE",
    "STATISTICS",
    "axis_names",
    "axis_words",
    "measure_names",
    "single_samples",
    "unsure_cells",
    "value_words",
]

BESIDE = frozenset({"periodic_starts", "failed_starts", "finished", "failure"})
"""Variables that are about the cases themselves."""

STATISTICS = ("_low", "_high", "_median_low", "_median_high", "_quantile_5", "_quantile_95", "_groups")
"""Endings of what is known of a measure beside its median."""


def measure_names(dataset: xarray.Dataset) -> list[str]:
    """Names of the measures that are numbers and have a value somewhere, without their statistics.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of `parameter_study`, or any other: then every variable of numbers.
    """
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


def single_samples(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Where a value is a sample of a motion that does not repeat, and no interval says how far others lie."""
    if "median_interval" in dataset.attrs:
        return np.zeros(dataset["finished"].shape, dtype=bool)
    repeated = dataset["periodic_starts"].to_numpy() + dataset["failed_starts"].to_numpy()
    return np.asarray((repeated < int(dataset.attrs.get("starts", 1))) & (dataset["finished"].to_numpy() > 0))


def unsure_cells(dataset: xarray.Dataset, measure: str) -> NDArray[np.bool_]:
    """Where the interval of the median is wider than the largest difference to the median of a neighbour."""
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
