"""What the dataset of a parameter study says in words: its axes, its conclusions, and what is missing of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from femimpact.export.report.blocks import Conclusion
from femimpact.export.study_columns import axis_names, axis_words, measure_names, single_samples, value_words
from femimpact.svg.axis import number_text

if TYPE_CHECKING:
    import xarray

__all__ = ["study_conclusions", "study_failures", "study_lead", "study_missing", "study_versions"]

MOST_NAMES = 20
"""Values of an axis of names that are listed."""

MOST_MEASURES = 8
"""Measures that have conclusions."""

SHOWN = {"m": (1e3, "mm"), "Pa": (1e-6, "MPa"), "N s": (1e3, "mN s")}
"""Units of axes and measures that are shown in another one, by its factor and its name."""


def study_lead(data: xarray.Dataset) -> list[str]:
    """What was studied, in sentences."""
    sizes, starts = tuple(data["finished"].sizes.values()), int(data.attrs["starts"])
    shape = f" ({' x '.join(map(str, sizes))})" if len(sizes) > 1 else ""
    each = f"{starts} starts each" if starts > 1 else "one start each"
    run = "a case is a run of the whole history of the base"
    if "cycles" in data.attrs:
        cycles, measured = (int(data.attrs[name]) for name in ("cycles", "measured_cycles"))
        run = f"{cycles} cycles of the base, of which the last {measured} are measured"
    return [
        f"Parameter study: {int(np.prod(sizes))} cases{shape}, {each}; {run}, at {data.attrs['place']}.",
        f"Axes: {'; '.join(_axes(data))}.",
    ]


def _axes(data: xarray.Dataset) -> Iterator[str]:
    """Every axis with its reach."""
    for name in axis_names(data):
        words, names, found = axis_words(data, name), value_words(data, name), data[name].to_numpy()
        if names is not None:
            distinct = list(dict.fromkeys(names))
            more = f" and {len(distinct) - MOST_NAMES} more" if len(distinct) > MOST_NAMES else ""
            yield f"{words}: {'; '.join(distinct[:MOST_NAMES])}{more}{_unit_of_words(data, name)}"
            continue
        low, high = (_text(value, data[name].attrs) for value in (found.min(), found.max()))
        yield f"{words}: {low} to {high}, {np.unique(found).size} values"


def _unit_of_words(data: xarray.Dataset, name: str) -> str:
    """Unit of the words of an axis, which pairs of gaps alone have."""
    return " mm" if f"{name}.plus" in data.coords else ""


def study_conclusions(data: xarray.Dataset) -> tuple[Conclusion, ...]:
    """The smallest and the largest value of every measure, where they are, and the scatter of the first."""
    samples, starts = single_samples(data), int(data.attrs["starts"])
    found = []
    for name in measure_names(data)[:MOST_MEASURES]:
        values = data[name]
        array = values.to_numpy()
        least, most = (
            np.unravel_index(int(find(array)), array.shape) for find in (np.nanargmin, np.nanargmax)
        )  # fmt: skip
        factor, unit = SHOWN.get(values.attrs.get("units", "1"), (1.0, values.attrs.get("units", "1")))
        scatter = ""
        if starts > 1 and f"{name}_low" in data:
            low, high = (_text(data[f"{name}{end}"].to_numpy()[least], values.attrs) for end in ("_low", "_high"))
            scatter = f"{low} to {high} over {starts} starts"
        found.append(
            Conclusion(
                f"Smallest {name.replace('_', ' ')}", number_text(factor * float(array[least]), zeros=True),
                "" if unit == "1" else unit, scatter, bool(samples[least]) and not scatter,
                f"at {_place(data, values.dims, least)}; the largest is {_text(array[most], values.attrs)}, "
                f"at {_place(data, values.dims, most)}",
            )
        )  # fmt: skip
    return tuple(found)


def _place(data: xarray.Dataset, dims: tuple[Any, ...], index: Any) -> str:
    """Values of the axes of a case."""
    chosen = dict(zip(dims, (int(i) for i in index), strict=True))
    return ", ".join(_value(data.isel(chosen), name) for name in axis_names(data))


def _value(one: xarray.Dataset, name: str) -> str:
    """The value of an axis in one case."""
    names = value_words(one, name)
    shown = _text(one[name].item(), one[name].attrs) if names is None else f"{names[0]}{_unit_of_words(one, name)}"
    return f"{axis_words(one, name)} {shown}"


def _text(value: Any, attributes: Mapping[str, Any]) -> str:
    """A value with its unit."""
    factor, unit = SHOWN.get(attributes.get("units", "1"), (1.0, attributes.get("units", "1")))
    shown = number_text(factor * float(value))
    return shown if unit in ("", "1") else f"{shown} {unit}"


def study_missing(data: xarray.Dataset) -> tuple[str, ...]:
    """What of the cases has not been run."""
    finished = data["finished"].to_numpy()
    left = int(np.count_nonzero(finished == 0))
    if not left:
        return ()
    return (f"{left} of {finished.size} cases: the study was not finished; the same femimpact study goes on with it",)


def study_failures(data: xarray.Dataset) -> tuple[str, ...]:
    """How many cases have starts without values, and why the first of them has."""
    failed = data["failed_starts"].to_numpy()
    if not failed.any():
        return ()
    first = next((str(reason) for reason in data["failure"].to_numpy().ravel() if reason), "not known")
    return (f"{int(np.count_nonzero(failed))} of {failed.size} cases have starts that failed, the first: {first}",)


def study_versions(data: xarray.Dataset) -> dict[str, Any]:
    """Versions and seeds of a study, by the names that a summary has for them."""
    versions = {name: data.attrs[name] for name in ("femimpact", "numpy", "scipy", "python") if name in data.attrs}
    starts = int(data.attrs["starts"])
    seeds = [f"{data.attrs['seed']} of the {starts} starts"] if starts > 1 else []
    seeds += [f"sample: {data.attrs['sample']}"] if "sample" in data.attrs else []
    return {"versions": versions, "seeds": "; ".join(seeds)}
