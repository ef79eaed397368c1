"""The cases of a study: a grid, a list or a sample; and from the values of a case to its system and method."""

from __future__ import annotations

import math
import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import Fault, InputError, require
from femimpact.fem.assembly import assemble, assembled_with_modes
from femimpact.fem.mesh import Mesh
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import Method
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.parametric.paths import Place, Stage, damping_with, study_with
from femimpact.structure.damping import ModalDamping, Rayleigh
from femimpact.structure.structure import Structure
from femimpact.study.parameter_plan import AxisValues, Distribution, SamplePlan
from femimpact.study.study import Study, build_systems, check_method, method_for, read_mesh_of
from femimpact.system.modes import rayleigh_of, with_checked_pairs, with_damping, with_modal_damping
from femimpact.system.reduction import reduce, reduced_on
from femimpact.system.system import System

MOST_CASES = 100_000_000


@dataclass(frozen=True, eq=False)
class CaseTable:
    """Values of all cases: of each axis its levels, and the number of the level that a case has."""

    places: tuple[Place, ...]
    levels: tuple[tuple[Any, ...], ...]  # values of each axis
    codes: tuple[NDArray[np.int64], ...]  # (cases,) which of them a case has
    shape: tuple[int, ...]  # of a grid the number of values of each axis, of a list or a sample the number of cases
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

    Raises `InputError` if an axis is a distribution, or there are more cases than anyone means.
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


KEPT = 16
"""Systems that are kept for later cases."""

Values = Mapping[Place, Any]


def default_method(system: System) -> Method:
    """Event-driven where that takes the system, else Newmark's with the recommended step."""
    method = EventDriven()
    try:
        method.check(system)
    except InputError:
        return Newmark.for_system(system)
    return method


@dataclass(eq=False)
class CaseSystems:
    """Makes the systems of cases from what a study is given."""

    given: Study | System | Callable[..., Any]  # of a callable its arguments are values of the case
    method: Method | None  # for all cases; None takes that of the study, or the one that suits the system
    elements: int  # of the structures that a function returns
    modes: int
    mesh: Mesh | None = None
    made: dict[tuple[Any, ...], System] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)
    making: Any = field(default_factory=threading.RLock)

    def __post_init__(self) -> None:
        if isinstance(self.given, Study):
            self.mesh = read_mesh_of(self.given)

    def __getstate__(self) -> dict[str, Any]:
        # what was made is made again where it is sent to, and a lock cannot be sent
        return {name: getattr(self, name) for name in ("given", "method", "elements", "modes", "mesh")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.made, self.lock, self.making = {}, threading.Lock(), threading.RLock()

    def of(self, values: Values) -> System:
        """The system of a case, for its values before `Stage.METHOD`.

        Raises `InputError` if there is no such system.
        """
        key = tuple((place.path, values[place]) for place in values if place.stage < Stage.METHOD)
        with self.lock:
            found = self.made.pop(key, None)
            if found is not None:
                # the one that was asked for last is dropped last
                self.made[key] = found
                return found
        # one thread at a time: several at so many small calls would take longer than one after the other
        with self.making:
            system = self._made(values)
        with self.lock:
            while len(self.made) >= KEPT:
                self.made.pop(next(iter(self.made)))
            return self.made.setdefault(key, system)

    def _made(self, values: Values) -> System:
        of_modes = {place: value for place, value in values.items() if place.stage == Stage.MODES}
        of_damping = {place: value for place, value in values.items() if place.stage == Stage.DAMPING}
        of_balls = {place: value for place, value in values.items() if place.stage == Stage.BALL}
        if of_balls:
            rest = {place: value for place, value in values.items() if place.stage < Stage.BALL}
            return _with_balls(self.of(rest), of_balls)
        if of_damping and isinstance(self.given, Study):
            damping = damping_with(self.given, of_damping)
            if _is_damping_of_modes(self.given, damping):
                return _damped(self.of(of_modes), damping)
        with warnings.catch_warnings():
            # of numbers that are unusual the nominal study has warned
            warnings.simplefilter("ignore")
            return self._built({**of_modes, **of_damping})

    def _built(self, values: Values) -> System:
        if isinstance(self.given, System):
            return self.given
        if isinstance(self.given, Study):
            return _built_of_study(study_with(self.given, values), self.mesh, bool(values))
        found = self.given(**{place.field: value for place, value in values.items()})
        if isinstance(found, System):
            return found
        kind = type(found).__name__
        require(isinstance(found, Structure), "study", kind, "", "must return a Structure or a System")
        return reduce(assemble(found, elements=self.elements), self.modes)

    def method_of(self, system: System, values: Values) -> Method:
        """The method for a system with the contacts of a case.

        Raises `InputError` if it does not take the system.
        """
        if self.method is not None:
            self.method.check(system)
            return self.method
        if not isinstance(self.given, Study):
            return default_method(system)
        study = study_with(self.given, {place: v for place, v in values.items() if place.stage == Stage.METHOD})
        method = method_for(study, system)
        check_method(study, system, method)
        return method


def _built_of_study(study: Study, mesh: Mesh | None, is_changed: bool) -> System:
    """The system of a study; of one that is changed its modes are solved once, for its damping and its reduction."""
    if study.reduction is None or not is_changed:
        return build_systems(study, mesh)[1]
    kept, elements = study.reduction.modes, None if mesh else study.mesh.elements
    full, modes = assembled_with_modes(study.structure, elements, mesh, kept + 1)
    require(kept <= full.dofs, "reduction.modes", kept, "", f"must be <= {full.dofs}, the dofs of this mesh")
    return reduced_on(full, modes, kept) if modes.natural_frequency[0] > 0.0 else reduce(full, kept)


def _damped(system: System, damping: Rayleigh | ModalDamping | None) -> System:
    """The system with another damping; one on its modes has their frequencies in its matrices."""
    if not (system.is_diagonal and isinstance(damping, Rayleigh)):
        return with_damping(system, damping)
    square = system.K.diagonal() / system.M.diagonal()
    alpha, beta = rayleigh_of(damping, np.sort(np.sqrt(square)))
    return with_modal_damping(system, alpha, beta)


def _with_balls(system: System, values: Values) -> System:
    """The system with other masses, centring springs and accelerations of its balls."""
    contacts = list(system.contacts)
    for place, value in values.items():
        j = next(i for i, pair in enumerate(contacts) if pair.name == place.part)
        contacts[j] = replace(contacts[j], **{place.field: value})
    return with_checked_pairs(system, tuple(contacts))


def _is_damping_of_modes(study: Study, damping: Rayleigh | ModalDamping | None) -> bool:
    """Whether the damping of the reduced system is that of these ratios alone."""
    kept = study.reduction.modes if study.reduction else math.inf
    if study.structure.dashpots or damping is None:
        return False
    if isinstance(damping, ModalDamping):
        return len(damping.each) <= kept
    return damping.modes is None or max(damping.modes) <= kept
