"""The cases of a study: a full grid of its axes, a list, or a sample of distributions; and in which order they run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import Fault, InputError
from femimpact.parametric.paths import Place, Stage
from femimpact.study.parameter_plan import AxisValues, Distribution, SamplePlan

__all__ = ["CaseTable", "full_grid", "listed_cases", "sampled_cases"]

MOST_CASES = 100_000_000


@dataclass(frozen=True, eq=False)
class CaseTable:
    """Values of all cases: of each axis its levels, and the number of the level that a case has.

    Parameters
    ----------
    places : tuple of Place
    levels : tuple of tuple
        Values of each axis.
    codes : tuple of ndarray (cases,) of int
        Which of them a case has.
    shape : tuple of int
        Of a grid the number of values of each axis, of a list or a sample the number of cases.
    is_grid : bool
    """

    places: tuple[Place, ...]
    levels: tuple[tuple[Any, ...], ...]
    codes: tuple[NDArray[np.int64], ...]
    shape: tuple[int, ...]
    is_grid: bool

    @property
    def size(self) -> int:
        """Number of cases."""
        return math.prod(self.shape)

    def value(self, axis: int, case: int) -> Any:
        """Value of an axis in a case."""
        return self.levels[axis][int(self.codes[axis][case])]

    def values(self, case: int) -> dict[str, Any]:
        """Values of a case by their paths."""
        return {place.path: self.value(axis, case) for axis, place in enumerate(self.places)}

    def axes_before(self, stage: Stage) -> tuple[int, ...]:
        """Numbers of the axes whose values make a case anew before some stage."""
        return tuple(axis for axis, place in enumerate(self.places) if place.stage < stage)

    @cached_property
    def running_order(self) -> NDArray[np.int64]:
        """Cases in the order in which they run: those that share their modes next to one another."""
        axes = sorted(self.axes_before(Stage.CASE), key=lambda axis: self.places[axis].stage)
        if not axes:
            return np.arange(self.size)
        return np.lexsort([np.arange(self.size), *(self.codes[axis] for axis in reversed(axes))])


def full_grid(places: Sequence[Place], axes: Mapping[str, AxisValues | Distribution]) -> CaseTable:
    """Every value of every axis with every value of the others.

    Raises
    ------
    InputError
        If an axis is a distribution, or there are more cases than anyone means.
    """
    levels = []
    for place in places:
        axis = axes[place.path]
        if isinstance(axis, Distribution):
            allowed = "is a distribution, and there is no sample: give sample, or in a study file [study.sample]"
            raise InputError([Fault(place.path, axis.name, "", allowed)])
        levels.append(axis.values)
    shape = tuple(len(values) for values in levels)
    _check_size(math.prod(shape))
    grid = np.indices(shape).reshape(len(shape), -1)
    return CaseTable(tuple(places), tuple(levels), tuple(grid), shape, True)


def listed_cases(places: Sequence[Place], rows: Sequence[Mapping[str, Any]]) -> CaseTable:
    """Cases given one by one."""
    columns = [tuple(row[place.path] for row in rows) for place in places]
    return _of_columns(places, columns)


def sampled_cases(
    places: Sequence[Place], axes: Mapping[str, AxisValues | Distribution], plan: SamplePlan
) -> CaseTable:  # fmt: skip
    """Cases from the distributions of the axes.

    Raises
    ------
    InputError
        If an axis has values in place of a distribution.
    """
    from scipy.stats import qmc

    for place in places:
        axis = axes[place.path]
        if isinstance(axis, AxisValues):
            allowed = "must be a distribution in a sample, as {from = .., to = ..} or {normal = [mean, deviation]}"
            raise InputError([Fault(place.path, f"{len(axis.values)} values", "", allowed)])
    _check_size(plan.points)
    count = len(places)
    engines: dict[str, Any] = {"sobol": qmc.Sobol, "halton": qmc.Halton, "latin-hypercube": qmc.LatinHypercube}
    if plan.method == "random":
        shares = np.random.default_rng(plan.seed).random((plan.points, count))
    else:
        # the same numbers from versions of scipy that call the argument by another name
        shares = engines[plan.method](count, **_seeded(engines[plan.method], plan.seed)).random(plan.points)
    # where a share is 0 a distribution without bounds has no value
    shares = np.clip(shares, 2.0**-53, 1.0 - 2.0**-53)
    columns = []
    for j, place in enumerate(places):
        axis = axes[place.path]
        own = axis if isinstance(axis, Distribution) else Distribution("uniform", (0.0, 1.0))
        columns.append(tuple(own.quantile(shares[:, j]).tolist()))
    return _of_columns(places, columns)


def _seeded(engine: Any, seed: int) -> dict[str, Any]:
    """The argument that seeds a sequence: `rng` from scipy 1.15 on."""
    import inspect

    name = "rng" if "rng" in inspect.signature(engine).parameters else "seed"
    return {name: np.random.default_rng(seed)}


def _of_columns(places: Sequence[Place], columns: Sequence[tuple[Any, ...]]) -> CaseTable:
    levels, codes = [], []
    for column in columns:
        number: dict[Any, int] = {}
        codes.append(np.array([number.setdefault(value, len(number)) for value in column], dtype=np.int64))
        levels.append(tuple(number))
    return CaseTable(tuple(places), tuple(levels), tuple(codes), (len(columns[0]),), False)


def _check_size(cases: int) -> None:
    if cases > MOST_CASES:
        raise InputError([Fault("axes", f"{cases:.4g} cases", "", f"must be at most {MOST_CASES:.0g} cases")])
