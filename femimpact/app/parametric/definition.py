"""`ParameterStudy`: axes, measures and starts, checked before the first case; and the table of its cases."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from femimpact.app.parametric.measures import Measure, check_names, measures_of
from femimpact.app.parametric.paths import (
    CaseSystems,
    Place,
    Stage,
    pair_with,
    paths_of_function,
    paths_of_study,
    paths_of_system,
    study_with,
    unknown_path,
)
from femimpact.app.study.drives import BASES
from femimpact.app.study.parameter_plan import MOST_STARTS, AxisValues, Distribution, SamplePlan, axis_from
from femimpact.app.study.study import Study
from femimpact.arrays import Integers
from femimpact.errors import Fault, InputError, check_fields, checked, kind_of, optional, quantity, require
from femimpact.excitation.harmonic import Sine
from femimpact.integrators.methods import Method, require_method
from femimpact.structure.structure import Position
from femimpact.system.system import System

CHECKED = 500
"""Values of an axis up to which each is checked; of more the smallest and the largest."""

CYCLES = 300
"""Cycles of the base in a case, where neither the call nor the study says."""

MOST_CASES = 100_000_000


@dataclass(frozen=True, eq=False)
class ParameterStudy:
    """Cases over named axes, what is measured of them, and from how many starts.

    Parameters
    ----------
    study : Study, System or callable
        A function of values that returns a `Structure` or a `System`; its arguments are axes.
    axes : mapping of str to values, or sequence of mappings
        By study path. Values are a list, {"from": .., "to": .., "points": ..}, or for a sample a distribution:
        {"normal": [mean, deviation]}, {"from": .., "to": ..} or one of scipy.stats. A sequence of mappings is a list
        of cases.
    measures : sequence of str or callable
        Names of `parametric.measures.MEASURES`, of a channel, or functions of a `Response` that return a number.
    starts : int
        Of each case.
    seed : int
        Of the starts.
    sample : SamplePlan or mapping, optional
        With points, method and seed.
    cycles : int, optional
        Of the base; the last third is measured. That of [study] or [sweep], or 300.
    excitation : Sine, optional
        Of a system or a function: what no axis gives. Other drives are those of a study file.
    method : Method, optional
        Of a system or a function; by default event-driven, or Newmark's where that does not take the system.
    at : str or float, optional
        The observed place; the tip by default.
    elements, modes : int
        Of the structures that a function returns.
    version : str, optional
        Of the functions given, in place of their code.
    """

    study: Study | System | Callable[..., Any]
    axes: Any
    measures: Any
    starts: int = field(default=1, metadata=quantity("1", at_least=1, at_most=MOST_STARTS, integer=True))
    seed: int = field(default=0, metadata=quantity("1", at_least=0, integer=True))
    sample: Any = None
    cycles: int | None = field(
        default=None, metadata=optional(quantity("1", at_least=3, at_most=10_000_000, integer=True))
    )
    excitation: Sine | None = None
    method: Method | None = None
    at: Position | None = None
    elements: int = field(default=40, metadata=quantity("1", at_least=1, at_most=100_000, integer=True))
    modes: int = field(default=4, metadata=quantity("1", at_least=1, integer=True))
    version: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        known = isinstance(self.study, (Study, System)) or (callable(self.study) and not isinstance(self.study, type))
        of = " (of a Structure fi.reduce(fi.assemble(structure, elements=40), modes=6))"
        require(known, "study", kind_of(self.study), "", f"must be a Study, a System{of} or a function of values")
        if self.method is not None:
            require_method(self.method)
        allowed = (
            "must be a Sine, of whose cycles a case is made; cases of a chirp, a record, a force or another drive are "
            "those of a study file, load_study(path); of a System they are runs of integrate, one for each value"
        )
        sine = self.excitation is None or isinstance(self.excitation, Sine)
        require(sine, "excitation", kind_of(self.excitation), "", allowed)
        require(self.version is None or isinstance(self.version, str), "version", self.version, "", "must be a text")
        named = not isinstance(self.measures, (str, bytes)) and isinstance(self.measures, Sequence)
        require(named, "measures", kind_of(self.measures), "", "must be a list of names or functions")
        if isinstance(self.study, Study):
            for key in ("excitation", "method"):
                allowed = "belongs to a System or a function: a Study has its own"
                require(getattr(self, key) is None, key, kind_of(getattr(self, key)), "", allowed)
            if not self.has_cycle:
                allowed = f"must be left out: {self._motion} has no cycle, and a case is the whole history"
                require(self.cycles is None, "cycles", self.cycles, "", allowed)
        self._check_axes()
        self._check_nominal()

    # ---- what follows from it ----------------------------------------------------------------------

    @cached_property
    def _rows(self) -> tuple[dict[str, Any], ...] | None:
        """Cases that are given one by one."""
        if isinstance(self.axes, Mapping):
            return None
        rows = self.axes
        sound = isinstance(rows, Sequence) and not isinstance(rows, (str, bytes, range))
        sound = sound and len(rows) > 0
        sound = sound and all(isinstance(row, Mapping) and row and row.keys() == rows[0].keys() for row in rows)
        allowed = "must be values by their paths, or a list of cases that all give the same ones"
        require(bool(sound), "axes", kind_of(self.axes), "", allowed)
        require(self.sample is None, "sample", kind_of(self.sample), "", "is for axes, not for a list of cases")
        read = {path: [axis_from(path, [row[path]]) for row in rows] for path in rows[0]}
        return tuple(
            {path: found[i].values[0] for path, found in read.items() if isinstance(found[i], AxisValues)}  # type: ignore[union-attr]
            for i in range(len(rows))
        )

    @cached_property
    def _axes(self) -> dict[str, AxisValues | Distribution]:
        if self._rows is not None:
            return {path: AxisValues(tuple(dict.fromkeys(row[path] for row in self._rows))) for path in self._rows[0]}
        require(len(self.axes) > 0, "axes", "none", "", "must be one or more")
        for path in self.axes:
            require(isinstance(path, str), "axes", path, "", "must be values by their study paths, which are texts")
        return {path: axis_from(f"axes.{path}", given) for path, given in self.axes.items()}

    @property
    def distributions(self) -> dict[str, Distribution]:
        """Distributions of the axes of a sample, by their paths."""
        return {path: axis for path, axis in self._axes.items() if isinstance(axis, Distribution)}

    @cached_property
    def plan_of_sample(self) -> SamplePlan | None:
        """How the cases are sampled; None for a grid or a list."""
        if self.sample is None or isinstance(self.sample, SamplePlan):
            return self.sample
        names = set(SamplePlan.__dataclass_fields__)
        sound = isinstance(self.sample, Mapping) and set(self.sample) <= names and "points" in self.sample
        require(sound, "sample", self.sample, "", "must give points, and may give method and seed")
        try:
            return SamplePlan(**self.sample)
        except InputError as error:
            raise InputError([fault.under("sample") for fault in error.faults]) from None

    @cached_property
    def known(self) -> dict[str, Place]:
        """All values that an axis may change, by their paths."""
        if isinstance(self.study, Study):
            return paths_of_study(self.study)
        if isinstance(self.study, System):
            return paths_of_system(self.study)
        return paths_of_function(self._arguments, self.nominal)

    @cached_property
    def _arguments(self) -> tuple[str, ...]:
        if isinstance(self.study, (Study, System)):
            return ()
        return tuple(inspect.signature(self.study).parameters)

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The values that the axes give."""
        return tuple(self.known[path] for path in self._axes)

    @cached_property
    def table(self) -> CaseTable:
        """All cases."""
        if self._rows is not None:
            return _of_columns(self.places, [tuple(row[place.path] for row in self._rows) for place in self.places])
        if self.plan_of_sample is not None:
            return sampled_cases(self.places, self._axes, self.plan_of_sample)
        return full_grid(self.places, self._axes)

    @cached_property
    def systems(self) -> CaseSystems:
        """Systems and methods of cases, made when they are asked for."""
        return CaseSystems(self.study, self.method, self.elements, self.modes)

    @cached_property
    def nominal(self) -> System:
        """The system of the study as it is; of a function that of the first case."""
        if not self._arguments:
            return self.systems.of({})
        first = {}
        for name in self._arguments:
            axis = self._axes.get(name)
            if axis is not None:
                value = axis.values[0] if isinstance(axis, AxisValues) else float(axis.quantile(np.array([0.5]))[0])
                first[Place(name, "", Stage.MODES, "function", "", name)] = value
        return self.systems.of(first)

    @cached_property
    def chosen(self) -> tuple[Measure, ...]:
        """The measures."""
        return measures_of(self.measures, self.nominal, "" if self.has_cycle else self._motion)

    @property
    def has_cycle(self) -> bool:
        """True if the base moves by a sine: cases of other motions are runs of the complete history."""
        return not isinstance(self.study, Study) or self.study.kind == "sine"

    @property
    def _motion(self) -> str:
        """Name of the motion of a base that has no cycle."""
        study: Any = self.study
        return f"the record {study.record!r}" if study.kind == "record" else f"a motion of kind {study.kind!r}"

    @cached_property
    def dwell(self) -> int:
        """Cycles of the base in each case; 0 where there are none."""
        if not self.has_cycle:
            return 0
        if self.cycles is not None:
            return self.cycles
        if isinstance(self.study, Study):
            if self.study.plan is not None and self.study.plan.cycles is not None:
                return self.study.plan.cycles
            if self.study.sweep is not None:
                return self.study.sweep.cycles
        return CYCLES

    @property
    def base(self) -> dict[str, Any]:
        """Frequency, level, phase and start of the base where no axis gives them; None is not known."""
        if not self.has_cycle:
            return {}
        given: Any = self.study
        sine, start = (given.sine, given.start) if isinstance(given, Study) else (self.excitation, "base")
        levels = [path for path in ("base.amplitude", "base.acceleration") if path in self._axes]
        by = levels[0].removeprefix("base.") if levels else getattr(sine, "by", "amplitude")
        level = getattr(sine, "level", None) if getattr(sine, "by", by) == by else None
        numbers = {"frequency": getattr(sine, "frequency", None), by: level, "phase": getattr(sine, "phase", 0.0)}
        return numbers | {"start": start}

    @property
    def observed(self) -> Position:
        """The observed place."""
        return self.nominal.default_place if self.at is None else self.at

    @property
    def runs(self) -> int:
        """Cases times starts."""
        return self.table.size * self.starts

    # ---- checks ------------------------------------------------------------------------------------

    def _check_axes(self) -> None:
        axes = self._axes
        if self._arguments:
            self._check_arguments()
        faults = [
            unknown_path(path, self.known, isinstance(self.study, System)) for path in axes if path not in self.known
        ]
        for place in (self.known[path] for path in axes if path in self.known):
            of_start = place.owner == "start" or (place.owner, place.unit) == ("base", "")
            if of_start and bool(getattr(self.study, "begins", ())):
                faults.append(Fault(place.path, None, "", "must not be an axis beside [[start]]"))
            if place.owner == "start" and self.starts > 1:
                allowed = f"must not be an axis with starts = {self.starts}: either gives the balls their places"
                faults.append(Fault(place.path, None, "", allowed))
            values = axes[place.path]
            if isinstance(values, AxisValues):
                faults += self._faults_of(place, values.values)
        if faults:
            raise InputError(faults)
        if self.plan_of_sample is not None:
            for place, levels in zip(self.places, self.table.levels, strict=True):
                faults += self._faults_of(place, levels)
        if faults:
            raise InputError(faults)
        both = {"base.amplitude", "base.acceleration"} <= set(axes)
        require(not both, "base.acceleration", None, "", "must be given alone: base.amplitude is an axis too")
        for name, value in self.base.items():
            allowed = "must be given: by an axis, or by excitation = Sine(...)"
            require(value is not None or f"base.{name}" in axes, f"base.{name}", None, "", allowed)

    def _check_arguments(self) -> None:
        parameters = inspect.signature(self.study).parameters.values()  # type: ignore[arg-type]
        for one in parameters:
            allowed = "is an argument of the function, and must be an axis"
            given = one.default is not one.empty or one.name in self._axes
            require(given or one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD), one.name, None, "", allowed)

    def _faults_of(self, place: Place, values: Sequence[Any]) -> list[Fault]:
        """A fault among values of an axis, each alone: they may still not fit those of other axes."""
        if len(values) and all(isinstance(value, (int, float)) for value in values):
            # the ends first, which are often what was given
            ends = min(values), max(values)
            values = ends if len(values) > CHECKED else (*ends, *values)
        for value in values:
            try:
                self._check_value(place, value)
            except InputError as error:
                unit = "" if isinstance(value, str) else place.unit
                return [Fault(place.path, value, unit, error.faults[0].allowed)]
        return []

    def _check_value(self, place: Place, value: Any) -> None:
        if place.owner == "function":
            return
        if place.owner == "start":
            number = isinstance(value, (int, float))
            require(number, place.path, value, place.unit, f"must be a finite number, in {place.unit}")
        elif place.owner == "base" and self.has_cycle:
            checked(place.field, value, BASES["sine"].table_keys[place.field].metadata)
        elif place.owner == "method" and isinstance(self.study, Study):
            self.systems.method_of(self.nominal, {place: value})
        elif isinstance(self.study, Study):
            study_with(self.study, {place: value})
            if place.field in ("at", "to") and isinstance(value, str):
                self.nominal.position_of(self.study.structure.place_of(value))
        else:
            pair_with(next(pair for pair in self.nominal.contacts if pair.name == place.part), place.field, value)

    def _check_nominal(self) -> None:
        """Refuse a place, a measure or a method that the system does not take: every case would fail."""
        moves = self.at is None or bool(np.any(self.nominal.point_row(self.at)))
        require(moves, "at", self.at, "", f"must be a place that moves; {self.nominal.default_place!r} does")
        check_names(self.chosen, tuple(self._axes))
        if not any(place.stage == Stage.METHOD for place in self.places):
            self.systems.method_of(self.nominal, {})


# ---- table of the cases -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CaseTable:
    """Values of all cases: of each axis its levels, and the number of the level that a case has."""

    places: tuple[Place, ...]
    levels: tuple[tuple[Any, ...], ...]  # values of each axis
    codes: tuple[Integers, ...]  # (cases,) which of them a case has
    shape: tuple[int, ...]  # of a grid the number of values of each axis, of a list or a sample the number of cases
    is_grid: bool

    @property
    def size(self) -> int:
        """Number of cases."""
        return math.prod(self.shape)

    def value(self, axis: int, case: int) -> Any:
        """Value of an axis in a case."""
        return self.levels[axis][int(self.codes[axis][case])]

    def values(self, case: int) -> dict[Place, Any]:
        """Values of a case by their places."""
        return {place: self.value(axis, case) for axis, place in enumerate(self.places)}

    def axes_before(self, stage: Stage) -> tuple[int, ...]:
        """Numbers of the axes whose values make a case anew before some stage."""
        return tuple(axis for axis, place in enumerate(self.places) if place.stage < stage)

    @cached_property
    def running_order(self) -> Integers:
        """Cases in the order in which they run: those that share their modes next to one another."""
        axes = sorted(self.axes_before(Stage.CASE), key=lambda axis: self.places[axis].stage)
        if not axes:
            return np.arange(self.size)
        return np.lexsort([np.arange(self.size), *(self.codes[axis] for axis in reversed(axes))])


def full_grid(places: Sequence[Place], axes: Mapping[str, AxisValues | Distribution]) -> CaseTable:
    """Every value of every axis with every value of the others."""
    levels = []
    for path, axis in axes.items():
        if isinstance(axis, Distribution):
            allowed = "is a distribution, and there is no sample: give sample, or in a study file [study.sample]"
            raise InputError([Fault(path, axis.name, "", allowed)])
        levels.append(axis.values)
    shape = tuple(len(values) for values in levels)
    _check_size(math.prod(shape))
    grid = np.indices(shape).reshape(len(shape), -1)
    return CaseTable(tuple(places), tuple(levels), tuple(grid), shape, True)


def sampled_cases(
    places: Sequence[Place], axes: Mapping[str, AxisValues | Distribution], plan: SamplePlan
) -> CaseTable:  # fmt: skip
    """Cases from the distributions of the axes."""
    from scipy.stats import qmc

    distributions = []
    for path, axis in axes.items():
        if isinstance(axis, AxisValues):
            allowed = "must be a distribution in a sample, as {from = .., to = ..} or {normal = [mean, deviation]}"
            raise InputError([Fault(path, f"{len(axis.values)} values", "", allowed)])
        distributions.append(axis)
    _check_size(plan.points)
    count = len(places)
    engines: dict[str, Any] = {"sobol": qmc.Sobol, "halton": qmc.Halton, "latin-hypercube": qmc.LatinHypercube}
    if plan.method == "random":
        shares = np.random.default_rng(plan.seed).random((plan.points, count))
    else:
        engine = engines[plan.method]
        # the argument that seeds a sequence is `rng` from scipy 1.15 on
        name = "rng" if "rng" in inspect.signature(engine).parameters else "seed"
        shares = engine(count, **{name: np.random.default_rng(plan.seed)}).random(plan.points)
    # where a share is 0 a distribution without bounds has no value
    shares = np.clip(shares, 2.0**-53, 1.0 - 2.0**-53)
    pairs = zip(distributions, shares.T, strict=True)
    return _of_columns(places, [tuple(distribution.quantile(share).tolist()) for distribution, share in pairs])


def _of_columns(places: Sequence[Place], columns: Sequence[tuple[Any, ...]]) -> CaseTable:
    """Cases given one by one, by the values (cases,) of each place."""
    levels, codes = [], []
    for column in columns:
        number: dict[Any, int] = {}
        codes.append(np.array([number.setdefault(value, len(number)) for value in column], dtype=np.int64))
        levels.append(tuple(number))
    return CaseTable(tuple(places), tuple(levels), tuple(codes), (len(columns[0]),), False)


def _check_size(cases: int) -> None:
    if cases > MOST_CASES:
        raise InputError([Fault("axes", f"{cases:.4g} cases", "", f"must be at most {MOST_CASES:.0g} cases")])
