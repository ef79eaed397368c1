"""What is drawn of the dataset of a parameter study: its measures and axes, their words, the cells of its maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.units import SHOWN_IN

if TYPE_CHECKING:
    import xarray


BESIDE = frozenset({"periodic_starts", "failed_starts", "finished", "failure"})
"""Variables that are about the cases themselves."""

STATISTICS = {
    "_low": "smallest of the starts",
    "_high": "largest of the starts",
    "_median_low": "lower end of the 90 % interval of the median",
    "_median_high": "upper end of the 90 % interval of the median",
    "_quantile_5": "quantile of 5 % of the starts",
    "_quantile_95": "quantile of 95 % of the starts",
    "_groups": "groups in which the values of the starts lie",
}
"""Endings of what is known of a measure beside its median, with words for each."""


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


def path_words(path: str) -> str:
    """Words for a number of a study by its path, as "gap of ball" for impactor.ball.gap."""
    owner, _, rest = path.partition(".")
    part, _, name = rest.replace("contact.", "").rpartition(".")
    name = "place" if name == "at" else name
    whose = part if owner in ("impactor", "absorber", "stop") else f"{owner} {part}".strip().replace(".", " ")
    return (f"{name} of {whose}" if rest else path).replace("_", " ")


def axis_words(dataset: xarray.Dataset, name: str) -> str:
    """Long name of an axis."""
    return str(dataset[name].attrs.get("long_name", path_words(name))).removesuffix(PAIRED)


def value_words(dataset: xarray.Dataset, name: str) -> list[str] | None:
    """Words of the values of an axis of names, or of gaps of which some are a pair (mm); None where numbers say it."""
    values = dataset[name].to_numpy()
    if f"{name}.plus" in dataset.coords:
        sides = (dataset[f"{name}.{side}"].to_numpy().reshape(-1).tolist() for side in ("plus", "minus"))
        return [f"({1e3 * plus:.4g}, {1e3 * minus:.4g})" for plus, minus in zip(*sides, strict=True)]
    return [str(value) for value in values.reshape(-1)] if values.dtype.kind not in "iuf" else None


def in_shown_units(columns: Mapping[str, Any], units: Mapping[str, str]) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns of numbers in the units in which they are shown, and these units."""
    factors_and_units = {name: SHOWN_IN.get(unit, (1.0, unit)) for name, unit in units.items()}
    scaled = {
        name: factors_and_units[name][0] * np.asarray(values)
        if name in factors_and_units and np.asarray(values).dtype.kind in "iuf"
        else values
        for name, values in columns.items()
    }
    return scaled, {name: unit for name, (_, unit) in factors_and_units.items()}


def sample_axes(dataset: xarray.Dataset) -> list[str]:
    """Names of the coordinates over which a list or a sample of cases is drawn; of pairs of gaps the two sides."""
    return [str(name) for name in dataset.coords if name != "case" and f"{name}.plus" not in dataset.coords]


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
