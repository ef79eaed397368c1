"""What is drawn of the best case: the worst of its measure over what is chosen, and how far that may be off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femimpact.app.parametric.best_design import MORE, BestCase
from femimpact.figures.study_labels import STATISTICS, BestMarks, axis_words

if TYPE_CHECKING:
    import xarray


def worst_over_axes(dataset: xarray.Dataset, best: BestCase) -> xarray.Dataset | None:
    """The worst of the measure of a best case over the axes of `worst_over`, with its statistics, on those that remain.

    `is_best` is true at the best. Of a list or a sample of cases None.
    """
    dims = [str(name) for name in dataset["finished"].dims]
    if dims == ["case"]:
        return None
    over, sign = [name for name in best.worst_over if name in dims], -1.0 if best.better == "large" else 1.0
    names = [f"{best.measure}{end}" for end in ("", *STATISTICS) if f"{best.measure}{end}" in dataset]
    sound = (dataset["failed_starts"] == 0) & (dataset["finished"] > 0)
    values = dataset[names].where(sound)
    found = (values.min if sign < 0.0 else values.max)(over, skipna=False, keep_attrs=True)
    at = (sign * values[best.measure]).fillna(np.inf).argmax(over) if over else {}
    for name in ("periodic_starts", "failed_starts", "finished"):
        if name in dataset:
            found[name] = dataset[name].isel(at)
    is_best = np.zeros([dataset.sizes[name] for name in dims if name not in over], dtype=bool)
    for design in best.designs:
        if design.case >= 0:
            where = dict(zip(dims, np.unravel_index(design.case, dataset["finished"].shape), strict=True))
            is_best[tuple(where[name] for name in dims if name not in over)] = True
    found["is_best"] = ([name for name in dims if name not in over], is_best)
    of_worst = f"worst {best.measure.replace('_', ' ')} over {' and '.join(axis_words(dataset, name) for name in over)}"
    median = ", median over the starts" if best.starts > 1 else ""
    if over:
        found[best.measure].attrs["long_name"] = f"{of_worst}{median}"
    return found.squeeze().assign_attrs(dataset.attrs)


def marks_of(best: BestCase) -> BestMarks:
    """The level of 15 % more, that of a limit, and between which values of each axis of numbers both are kept."""
    if len(best.designs) > 1:
        return BestMarks()
    (design,) = best.designs
    change = "less" if best.better == "large" else "more"
    more = MORE * abs(design.value)
    levels = [(f"{100.0 * MORE:g} % {change}", design.value + (-more if best.better == "large" else more))]
    levels += [("limit", best.limits[best.measure])] if best.measure in best.limits else []
    spans = {one.axis: (one.value - one.below, one.value + one.above) for one in design.margins}
    within = f"at most {100.0 * MORE:g} % {change} than the best{', within the limits' if best.limits else ''}"
    return BestMarks(within, tuple(levels), spans)
