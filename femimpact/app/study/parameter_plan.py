"""The tables [study], [study.axes] and [study.sample] of a study file, and what the values of an axis may be."""

from __future__ import annotations

import itertools
import math
import numbers
from collections.abc import Iterable, Mapping, Sized
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from femimpact.errors import (
    Fault,
    InputError,
    check_fields,
    checked,
    choice,
    in_range,
    instance,
    optional,
    quantity,
    text,
)

MOST_POINTS = 10_000_000
"""Largest number of points of an axis or a sample; more is taken for a mistake."""

MOST_STARTS = 100_000

NUMBER = quantity("1")

DISTRIBUTIONS: Mapping[str, tuple[str, str]] = {
    "uniform": ("lowest", "highest"),
    "normal": ("mean", "standard deviation"),
    "lognormal": ("median", "standard deviation of the logarithm"),
}
"""Distributions of an axis, with what their two numbers are."""

GRID = {"from", "to", "points"}

AXIS = (
    "must be a list of values or { from = .., to = .., points = .. }; of a sample it may be { from = .., to = .. }, "
    + ", ".join(f"{{ {name} = [{first}, {second}] }}" for name, (first, second) in DISTRIBUTIONS.items())
)


@dataclass(frozen=True)
class AxisValues:
    """Values of an axis: numbers, pairs of numbers (gaps) or names."""

    values: tuple[Any, ...]


@dataclass(frozen=True)
class Distribution:
    """A distribution from which a sample takes the values of an axis.

    Parameters
    ----------
    name : str
        One of `DISTRIBUTIONS`, or the name of a frozen distribution of scipy's.
    numbers : tuple of float
        What `DISTRIBUTIONS` says, or the distribution's arguments.
    frozen : object, optional
        That of scipy's, with its `ppf`.
    """

    name: str
    numbers: tuple[float, ...]
    frozen: Any = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.name} {list(self.numbers)}"

    def quantile(self, share: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Values below which these shares of the distribution lie."""
        from scipy import stats

        if self.frozen is not None:
            return np.asarray(self.frozen.ppf(share), dtype=float)
        first, second = self.numbers
        if self.name == "uniform":
            return np.asarray(first + (second - first) * share)
        normal = np.asarray(stats.norm.ppf(share))
        return np.asarray(first + second * normal if self.name == "normal" else first * np.exp(second * normal))


@dataclass(frozen=True)
class SamplePlan:
    """`[study.sample]`: so many points from the axes' distributions, by a method of scipy.stats.qmc or at random.

    Parameters
    ----------
    points : int
        Cases; of a Sobol sequence a power of two.
    method : str
        Sequence or design that spreads them, or "random".
    seed : int
        Seed of the random numbers of the sample.

    Raises
    ------
    InputError
        If the points of a Sobol sequence are not a power of two.
    """

    points: int = field(metadata=quantity("1", at_least=1, at_most=MOST_POINTS, integer=True))
    method: str = field(default="sobol", metadata=choice("sobol", "halton", "latin-hypercube", "random"))
    seed: int = field(default=0, metadata=quantity("1", at_least=0, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)
        if self.method == "sobol" and self.points & (self.points - 1):
            below = 1 << (self.points.bit_length() - 1)
            allowed = f"must be a power of two for a Sobol sequence, as {below} or {2 * below}"
            raise InputError([Fault("points", self.points, "", allowed)])


@dataclass(frozen=True)
class BestPlan:
    """`[study.best]`: which case is the best of the study; no case hangs on it.

    Parameters
    ----------
    measure : str
        One of the study's, of which small or large values are better.
    worst_over : tuple of str or None
        Study paths of the axes over which the worst counts; any other but those of the excitation counts as a choice.
        Absent: the frequencies of base and forces, where another axis remains.
    limits : mapping of str to float, or None
        What the worst value of a measure, of several starts the largest, may be at most. Absent: none.

    Raises
    ------
    InputError
        If a limit is not a finite number.
    """

    measure: str = field(metadata=text())
    worst_over: tuple[str, ...] | None = field(default=None, metadata=optional(text(several=True)))
    limits: Mapping[str, float] | None = field(default=None, metadata=optional(instance(Mapping)))

    def __post_init__(self) -> None:
        check_fields(self)
        given = self.limits or {}
        limits = {name: float(checked(f"limits.{name}", value, NUMBER)) for name, value in given.items()} or None
        object.__setattr__(self, "limits", limits)


@dataclass(frozen=True)
class ParameterPlan:
    """`[study]`: what is measured over which axes, and from how many starts.

    Parameters
    ----------
    measures : tuple of str
        By their names, as "peak" or "root.surface_stress".
    axes : mapping of str to AxisValues or Distribution
        By the study path of the value.
    starts : int
        Number of starts of each case, with the balls at different places and speeds; of several the median is taken.
    seed : int
        Seed of the random numbers of the starts.
    cycles : int or None
        Base cycles in each case, the last third of which is measured. Absent: those of [sweep].
    sample : SamplePlan or None
        Absent: the full grid of the axes.
    best : BestPlan or None
        Absent: the best by the first measure that says what is better, without limits.
    """

    measures: tuple[str, ...] = field(metadata=text(several=True))
    axes: Mapping[str, AxisValues | Distribution] = field(metadata=instance(Mapping))
    starts: int = field(default=1, metadata=quantity("1", at_least=1, at_most=MOST_STARTS, integer=True))
    seed: int = field(default=0, metadata=quantity("1", at_least=0, integer=True))
    cycles: int | None = field(
        default=None, metadata=optional(quantity("1", at_least=3, at_most=10_000_000, integer=True))
    )
    sample: SamplePlan | None = field(default=None, metadata=optional(instance(SamplePlan)))
    best: BestPlan | None = field(default=None, metadata=optional(instance(BestPlan)))

    def __post_init__(self) -> None:
        check_fields(self)


def is_part_of_path(given: Any) -> bool:
    """True for a table of axes: without quotes TOML takes the dots of a path for tables in one another."""
    inner = isinstance(given, Mapping) and any(isinstance(value, (dict, list)) for value in given.values())
    return inner and not set(given) <= set(DISTRIBUTIONS)


def axis_from(key: str, axis: Any) -> AxisValues | Distribution:
    """The values or the distribution of an axis.

    Parameters
    ----------
    key : str
        Key of the study file that faults name.
    axis : sequence, mapping, frozen distribution of scipy's, AxisValues or Distribution

    Raises
    ------
    InputError
        If it is none of them, empty, repeated or not finite.
    """
    if isinstance(axis, (AxisValues, Distribution)):
        return axis
    if isinstance(axis, Mapping):
        return _axis_of_table(key, axis)
    if hasattr(axis, "ppf") and hasattr(axis, "dist"):
        numbers_of = (*axis.args, *(value for _, value in sorted(axis.kwds.items())))
        return Distribution(str(axis.dist.name), tuple(float(value) for value in numbers_of), axis)
    if isinstance(axis, (str, bytes)) or not isinstance(axis, Iterable):
        raise InputError([Fault(key, axis, "", AXIS)])
    values = tuple(_value(key, value) for value in _entries(key, axis))
    if not values:
        raise InputError([Fault(key, [], "", "must have one value or more")])
    known = set[Any]()
    for value in values:
        # a gap that is a number has it on both sides
        same = value[0] if isinstance(value, tuple) and value[0] == value[1] else value
        if same in known:
            raise InputError([Fault(key, value, "", "is given twice: the values of an axis must be distinct")])
        known.add(same)
    return AxisValues(values)


def _entries(key: str, axis: Iterable[Any]) -> list[Any]:
    """The values as a list, of which no endless one is made."""
    try:
        size = len(axis) if isinstance(axis, Sized) else 0
        values = list(itertools.islice(axis, MOST_POINTS + 1)) if size <= MOST_POINTS else []
    except Exception:
        # an object of another library may raise anything
        raise InputError([Fault(key, axis, "", AXIS)]) from None
    if max(size, len(values)) > MOST_POINTS:
        raise InputError([Fault(key, axis, "", f"must have {MOST_POINTS} values or fewer")])
    return values


def _axis_of_table(key: str, given: Mapping[str, Any]) -> AxisValues | Distribution:
    names = set(given)
    if names == GRID or names == {*GRID, "spacing"}:
        first, last = (_number(f"{key}.{name}", given[name]) for name in ("from", "to"))
        points = checked(f"{key}.points", given["points"], quantity("1", at_least=2, at_most=MOST_POINTS, integer=True))
        spacing = checked(f"{key}.spacing", given.get("spacing", "even"), choice("even", "logarithmic"))
        if first == last:
            raise InputError([Fault(f"{key}.to", last, "", "must not be the value of from")])
        if spacing == "even":
            return AxisValues(tuple(np.linspace(first, last, points).tolist()))
        if min(first, last) <= 0.0:
            raise InputError([Fault(f"{key}.from", first, "", "must be > 0, as to, for a logarithmic spacing")])
        return AxisValues(tuple(np.geomspace(first, last, points).tolist()))
    if names == {"from", "to"}:
        return _distribution(key, "uniform", [given["from"], given["to"]])
    if len(names) == 1 and next(iter(names)) in DISTRIBUTIONS:
        name = next(iter(names))
        return _distribution(f"{key}.{name}", name, given[name])
    raise InputError([Fault(key, dict(given), "", AXIS)])


def _distribution(key: str, name: str, given: Any) -> Distribution:
    words = DISTRIBUTIONS[name]
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise InputError([Fault(key, given, "", f"must be [{words[0]}, {words[1]}]")])
    first, second = (_number(key, value) for value in given)
    sound = second > first if name == "uniform" else second > 0.0 and (name == "normal" or first > 0.0)
    if not sound:
        order = "the first below the second" if name == "uniform" else "the last > 0, and a median > 0"
        raise InputError([Fault(key, list(given), "", f"must be [{words[0]}, {words[1]}], {order}")])
    return Distribution(name, (first, second))


def _number(key: str, value: Any) -> float:
    return float(checked(key, value, quantity("1")))


def _value(key: str, value: Any) -> Any:
    """One value of an axis: a number, a pair of numbers or a name."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, (list, tuple)) or getattr(value, "shape", None) == (2,):
        # a side of a stop may be open
        pair = tuple(
            entry if isinstance(entry, float) and entry == math.inf else _number(key, entry) for entry in value
        )
        if len(pair) == 2:
            return pair
    elif in_range(value, NUMBER):
        return int(value) if isinstance(value, numbers.Integral) else float(value)
    raise InputError([Fault(key, value, "", "must be finite numbers, pairs of them (gaps), or names")])
