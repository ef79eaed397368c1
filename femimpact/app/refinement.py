"""The best design between the cases of a study: rounds of designs, each closer around the best of all before."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from femimpact.app.parametric.best import (
    NO_DESIGN,
    best_case,
    check_best,
    frequency_axes,
    no_force_words,
    ranked_designs,
)
from femimpact.app.parametric.best_design import BestCase
from femimpact.app.parametric.measures import MEASURES
from femimpact.app.parametric.paths import bounds_of_axis
from femimpact.app.parametric.verb import StudyProgress, parameter_study
from femimpact.app.study.parameter_plan import AxisValues
from femimpact.app.study.study import Study
from femimpact.arrays import Array
from femimpact.contact.laws import Rigid
from femimpact.errors import Fault, InputError, in_range, kind_of, quantity, require, warns
from femimpact.errors import checked as checked_value
from femimpact.progress import draws_progress
from femimpact.system.system import System

if TYPE_CHECKING:
    import xarray

FIRST, AROUND, BEST = 32, 8, 3
"""Designs of the first round, designs around each of the best in a later one, and how many these are."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """What `refine` finds.

    Parameters
    ----------
    best : BestCase
        Among the designs of all rounds.
    dataset : xarray.Dataset
        All cases of all rounds, as `parameter_study` returns a list of cases.
    """

    best: BestCase
    dataset: xarray.Dataset

    def __str__(self) -> str:
        return str(self.best)


@warns
@draws_progress
def refine(
    study: Study | System | Callable[..., Any],
    measure: str,
    axes: Mapping[str, Any] | None = None,
    *,
    worst_over: Sequence[str] | None = None,
    limits: Mapping[str, float] | None = None,
    rounds: int = 2,
    starts: int = 5,
    seed: int = 0,
    directory: str | Path | None = None,
    progress: Callable[[StudyProgress], None] | bool | None = None,
    **more: Any,
) -> Refinement:
    """The best case between the bounds of some axes: 32 designs, then 8 around each of the three best, again and again.

    The first designs are Sobol points (`scipy.stats.qmc.Sobol`) of the box of the bounds. In round k = 1, 2, ... those
    around one of the three best fill a box of half-width 32^(-1/d) 8^((1 - k)/d) of each of the d bounds. Every round
    is a parameter study of a list of cases from the same draws of the starts.

    Parameters
    ----------
    study : Study, System or function
        As of `parameter_study`.
    measure : str
        Which of its values are better, `best_case` says.
    axes : mapping, optional
        By paths: a tuple (low, high) of an axis that is searched, all values of one of `worst_over`. By default those
        of `[study.axes]`, from the smallest to the largest value.
    worst_over : sequence of str, optional
        Paths of the axes over which the worst counts; by default those of `[study.best]`, or the frequency of the base,
        where it is an axis.
    limits : mapping of str to float, optional
        As of `best_case`.
    rounds : int
        After the first.
    starts, seed : int
        Of each case, and of their draws and the designs.
    directory : str or Path, optional
        Where each round is kept as a study, in `round_1`, `round_2`, ...: the same call goes on from there.
    progress : callable or bool, optional
        Called with a `StudyProgress` of all rounds together; True draws a bar.
    **more
        Further arguments of `parameter_study`.

    Raises
    ------
    InputError
        If an axis has no two bounds or is one of the excitation that is not in `worst_over`, or what `parameter_study`
        and `best_case` refuse.

    Examples
    --------
    >>> import femimpact as fi
    >>> study = fi.load_study("meshes/stepped_cantilever.toml")
    >>> axes = {"impactor.ball.gap": (1e-3, 3e-3), "base.frequency": [8.5, 9.0]}
    >>> found = fi.refine(study, "peak", axes, rounds=0, starts=1, cycles=3)
    >>> found.dataset["peak"].size
    64
    """
    rounds = checked_value("rounds", rounds, quantity("1", at_least=0, at_most=100, integer=True))
    seed = checked_value("seed", seed, quantity("1", at_least=0, integer=True))
    if worst_over is None and isinstance(study, Study) and study.plan is not None and study.plan.best is not None:
        worst_over = study.plan.best.worst_over
    axes = _axes_of_study(study, worst_over) if axes is None else axes
    sound = isinstance(axes, Mapping) and len(axes) > 0 and all(isinstance(name, str) for name in axes)
    require(sound, "axes", kind_of(axes), "", "must be bounds by paths")
    names = tuple(axes)
    worst, most = check_best(measure, worst_over, limits, names, _known_measures(measure, limits))
    worst_values = {name: _values(name, axes[name]) for name in worst}
    bounds = {name: _bounds(name, axes[name]) for name in names if name not in worst}
    measures, studies = list(dict.fromkeys((measure, *most))), list[Any]()
    _require_forces(study, measures)
    box = np.array(list(bounds.values())).T
    # of each round after the first at most so many designs
    most_cases = (FIRST + rounds * BEST * AROUND) * math.prod(len(values) for values in worst_values.values())
    designs = box[0] + _sobol(FIRST, len(bounds), seed) * (box[1] - box[0])
    for number in range(rounds + 1):
        cases = [
            dict(zip((*bounds, *worst_values), (*design, *values), strict=True))
            for design in designs.tolist()
            for values in itertools.product(*worst_values.values())
        ]
        folder = None if directory is None else Path(directory) / f"round_{number + 1}"
        done = sum(one.sizes["case"] for one in studies)
        try:
            studies.append(
                parameter_study(
                    study, cases, measures, starts=starts, seed=seed, directory=folder,
                    progress=_of_all_rounds(progress, done, most_cases), **more,
                )
            )  # fmt: skip
        except InputError as error:
            faults = [replace(each, key="measure") if each.key == "measures" else each for each in error.faults]
            raise InputError(faults) from None
        dataset = _together(studies)
        if number < rounds:
            best = ranked_designs(dataset, measure, worst, limits, BEST)
            half = FIRST ** (-1.0 / len(bounds)) * AROUND ** (-number / len(bounds))
            designs = _around([[one[name] for name in bounds] for one in best], box, half, seed + number + 1)
    return Refinement(best_case(dataset, measure, worst, limits), dataset)


def _require_forces(study: Any, measures: list[str]) -> None:
    """Refuse the largest contact force of rigid contacts, which impacts in the first round would not give."""
    contacts: Any = study.contacts if isinstance(study, System) else ()
    if isinstance(study, Study):
        contacts = (*study.structure.impactors, *study.structure.stops)
    laws = {one.name: one.contact if isinstance(study, Study) else one.law for one in contacts}
    if "peak_force" in measures and any(isinstance(law, Rigid) for law in laws.values()):
        words = ", ".join(f"{name}: {law.name}" for name, law in laws.items())
        raise InputError([Fault("peak_force", None, "", no_force_words(words))])


def _of_all_rounds(progress: Any, done: int, most: int) -> Any:
    """Progress of a round as that of all rounds, of which some cases are done; what is no function is handed on."""
    if not callable(progress):
        return progress
    return lambda one: progress(replace(one, finished=done + one.finished, found=done + one.found, cases=most))


def _axes_of_study(study: Any, worst_over: Any) -> dict[str, Any]:
    """Axes of the table [study.axes]: the smallest and the largest number, of one in `worst_over` all values."""
    plan = study.plan if isinstance(study, Study) else None
    if plan is None:
        raise InputError([Fault("axes", None, "", "must be given: the study has no table [study.axes]")])
    over, axes = worst_over if isinstance(worst_over, (list, tuple)) else frequency_axes(plan.axes), dict[str, Any]()
    for name, axis in plan.axes.items():
        allowed = "must be a list of numbers to be searched between: give axes={...}"
        require(isinstance(axis, AxisValues), f"study.axes.{name}", str(axis), "", allowed)
        values = list(cast(AxisValues, axis).values)
        if name not in over:
            require(all(in_range(one, quantity("")) for one in values), f"study.axes.{name}", values, "", allowed)
            axes[name] = min(values), max(values)
        else:
            axes[name] = values
    return axes


def _known_measures(measure: Any, limits: Any) -> dict[str, str]:
    """Measures that are numbers, and channels that are asked for, with which of their values are better."""
    channels = (measure, *(limits if isinstance(limits, Mapping) else ()))
    known = {name: item.better for name, item in MEASURES.items() if not item.is_text}
    return known | {name: "small" for name in channels if isinstance(name, str) and "." in name}


def _values(name: str, value: Any) -> list[Any]:
    """All values of an axis over which the worst counts."""
    several = isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim == 1)
    require(several and len(value) > 0, f"axes.{name}", kind_of(value), "", "must be a list of values")
    return list(value)


def _bounds(name: str, value: Any) -> tuple[float, float]:
    """Lowest and highest value of an axis that is searched."""
    allowed = "is no choice of a design: name it in worst_over, or give its value with the study"
    require(not name.startswith(NO_DESIGN), f"axes.{name}", value, "", allowed)
    way = ", as a tuple: a list of values is that of an axis named in worst_over"
    require(not isinstance(value, list), f"axes.{name}", value, "", f"must be (low, high){way}")
    return bounds_of_axis(f"axes.{name}", value, way)


def _sobol(count: int, axes: int, seed: int) -> Array:
    """Points (count, axes) between 0 and 1."""
    from scipy.stats import qmc

    return np.asarray(qmc.Sobol(axes, seed=seed).random(count))


def _around(best: list[list[float]], box: Array, half: float, seed: int) -> Array:
    """Designs (n, axes) in boxes around the best, of a half-width over that of the bounds, cut at the bounds."""
    width, boxes = box[1] - box[0], []
    for number, centre in enumerate(best):
        low, high = np.maximum(centre - half * width, box[0]), np.minimum(centre + half * width, box[1])
        boxes.append(low + _sobol(AROUND, width.size, seed + 1000 * number) * (high - low))
    return np.concatenate(boxes)


def _together(studies: list[Any]) -> Any:
    """One dataset of the cases of several lists."""
    import xarray

    both = xarray.concat(studies, "case", combine_attrs="override") if len(studies) > 1 else studies[0]
    return both.assign_coords(case=np.arange(both.sizes["case"]))
