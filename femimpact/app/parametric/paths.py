"""Values of a study by their paths, the study with some of them changed, and the system and method of a case."""

from __future__ import annotations

import dataclasses
import math
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np

from femimpact.app.study.drives import BASES, FORCES, base_with, force_of, force_table, kind_of, named_forces
from femimpact.app.study.drives import PARTS as KINDS_OF_PARTS
from femimpact.app.study.file_units import OF_SINE, START
from femimpact.app.study.study import (
    Gravity,
    Study,
    build_systems,
    check_method,
    method_for,
    read_mesh_of,
)
from femimpact.errors import Fault, InputError, checked, in_range, quantity, require, suggestion
from femimpact.excitation.excitation import LineLoad
from femimpact.excitation.harmonic import Sine
from femimpact.fem.assembly import assemble, assembled_with_modes
from femimpact.fem.mesh import Mesh
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.methods import METHODS, Method
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.structure.beam import ModalDamping, Rayleigh
from femimpact.structure.structure import Structure, gaps_with
from femimpact.system.contact_pair import ContactPair, root_mobility
from femimpact.system.modes import rayleigh_of, with_damping, with_modal_damping
from femimpact.system.reduction import reduce, reduced_on
from femimpact.system.system import System, with_checked_pairs


class Stage(IntEnum):
    """The first step of making a case that a changed value repeats, in the order of the steps."""

    MODES = 0
    DAMPING = 1
    BALL = 2
    METHOD = 3
    CASE = 4


@dataclass(frozen=True)
class Place:
    """A value of a study."""

    path: str
    unit: str
    stage: Stage
    owner: str  # name of the table of the study, or of the argument, in which it stands
    part: str  # name of the body, segment or contact; empty where there is one only
    field: str


PARTS = {
    "mass": "masses", "impactor": "impactors", "stop": "stops", "meeting": "meetings", "spring": "springs",
    "dashpot": "dashpots", "absorber": "absorbers",
}  # fmt: skip
"""Tables of a study file, and the fields of `Structure` that they become."""

OF_BALL = ("mass", "free_stiffness", "acceleration", "free_damping")
"""Numbers of a ball in a system; its acceleration there includes gravity."""

BASE = {"frequency": "Hz", "amplitude": "m", "acceleration": "m/s^2", "phase": "rad", "start": ""}

FIXED = "does not follow from the contacts, the excitation and the start, which are all that a System leaves open"


def paths_of_study(study: Study) -> dict[str, Place]:
    """Every value of a study that an axis may have, by its path."""
    return {place.path: place for place in _places(study)}


def paths_of_system(system: System) -> dict[str, Place]:
    """The same of a system: contacts, excitation and start."""
    return {place.path: place for place in _places_of_system(system)}


def paths_of_function(names: tuple[str, ...], system: System) -> dict[str, Place]:
    """The same of a function that returns a structure or a system, whose arguments are values, too."""
    arguments = {name: Place(name, "", Stage.MODES, "function", "", name) for name in names}
    return {**paths_of_system(system), **arguments}


def _places(study: Study) -> Iterator[Place]:
    structure = study.structure
    segments = structure.beam.segments
    for segment in segments:
        part = segment.name if len(segments) > 1 else ""
        yield from _fields_of(segment, "beam", part, Stage.MODES)
    for owner, name in PARTS.items():
        for item in getattr(structure, name):
            for place in _fields_of(item, owner, item.name, Stage.MODES):
                # the weight along the beam that is left out depends on the ball, too
                hangs = structure.axial is not None and place.stage == Stage.BALL
                yield replace(place, stage=Stage.MODES) if hangs else place
            yield from _law_of(owner, item.name, getattr(item, "contact", None))
    if structure.damping is not None:
        for name in ("ratio", "ratios", "frequencies"):
            if hasattr(structure.damping, name):
                yield _place("damping", "", name, "Hz" if name == "frequencies" else "1", Stage.DAMPING)
    yield _place("gravity", "", "acceleration", "m/s^2", Stage.MODES)
    if structure.axial is not None:
        yield from _fields_of(structure.axial, "axial", "", Stage.MODES)
    yield from _fields_of(study.mesh, "mesh", "", Stage.MODES)
    if study.reduction is not None:
        yield from _fields_of(study.reduction, "reduction", "", Stage.MODES)
    yield from _fields_of(METHODS[study.method.get("name", "newmark")], "method", "", Stage.METHOD)
    moving = [ball.name for ball in structure.impactors] + [body.name for body in structure.absorbers]
    yield from _excitation_and_start(moving, _units_of_base(study.base))
    for name, force in named_forces(study.base, study.forces):
        history = getattr(force, "history", force)
        axes = FORCES[kind_of(history, FORCES)].axes(history)
        along = isinstance(force.at, LineLoad)
        for key, unit in ({**axes, "density": "N/m"} if along else {"at": "m", **axes}).items():
            yield _place("force", name, key, unit, Stage.CASE)


def _units_of_base(base: Any) -> Mapping[str, str]:
    """Keys of [base] that are numbers, and the start, each with its unit; of the parts of a sum as well."""
    if isinstance(base, Sine):
        return BASE
    kind = BASES[kind_of(base, BASES)]
    units = kind.axes(base) | {key: one.metadata["unit"] for key, one in kind.beside.items()}
    for number, part in enumerate(getattr(base, "parts", ()), start=1):
        of_part = KINDS_OF_PARTS[kind_of(part, KINDS_OF_PARTS)].axes(part)
        units |= {f"parts.{number}.{key}": unit for key, unit in of_part.items()}
    return units


def _places_of_system(system: System) -> Iterator[Place]:
    for pair in system.contacts:
        if pair.has_walls:
            yield _place(pair.kind, pair.name, "gap", "m", Stage.CASE)
        if not pair.is_stop:
            units = {"mass": "kg", "free_stiffness": "N/m", "acceleration": "m/s^2", "free_damping": "N s/m"}
            for name in OF_BALL:
                yield _place(pair.kind, pair.name, name, units[name], Stage.BALL)
        yield from _law_of(pair.kind, pair.name, pair.law)
    yield from _excitation_and_start([pair.name for pair in system.balls], BASE)


def _excitation_and_start(balls: list[str], base: Mapping[str, str]) -> Iterator[Place]:
    for name, unit in base.items():
        part, _, key = name.rpartition(".")
        yield _place("base", part, key, unit, Stage.CASE)
    for ball in balls:
        for name, unit in START.items():
            yield _place("start", ball, name, unit, Stage.CASE)


def _place(owner: str, part: str, name: str, unit: str, stage: Stage) -> Place:
    return Place(".".join(piece for piece in (owner, part, name) if piece), unit, stage, owner, part, name)


def _fields_of(noun: Any, owner: str, part: str, stage: Stage) -> Iterator[Place]:
    """Fields of a noun that hold numbers."""
    for item in dataclasses.fields(noun):
        unit = item.metadata.get("unit", "")
        is_place = item.name in ("at", "to")
        closed = item.name != "gap" or min(noun.gaps) < math.inf
        if not (unit or is_place) or not closed:
            continue
        changed = stage
        if owner in ("impactor", "stop", "meeting"):
            # an acceleration is added to gravity, which the structure has
            of_ball = item.name in OF_BALL and item.name != "acceleration"
            changed = Stage.CASE if item.name == "gap" else Stage.BALL if of_ball else stage
        yield _place(owner, part, item.name, "m" if is_place else unit, changed)


def _law_of(owner: str, part: str, law: Any) -> Iterator[Place]:
    if dataclasses.is_dataclass(law):
        for item in dataclasses.fields(law):
            if item.metadata.get("unit") and not isinstance(getattr(law, item.name), str):
                yield _place(owner, part, f"contact.{item.name}", item.metadata["unit"], Stage.CASE)


def study_with(study: Study, values: Mapping[Place, Any]) -> Study:
    """The study with some of its values changed; those of the start of the balls stay what they were."""
    for place, value in values.items():
        try:
            changed = _changed(study, place, value)
        except InputError as error:
            raise _under(place, error) from None
        study = replace(study, **changed)
    return study


def _under(place: Place, error: InputError) -> InputError:
    """The error of a noun with the path of the noun before its keys."""
    # faults of a sum name the part
    above = "base." if place.owner == "base" else place.path.removesuffix(place.field.rpartition(".")[2])
    return InputError([replace(fault, key=f"{above}{fault.key}") for fault in error.faults])


def _changed(study: Study, place: Place, value: Any) -> dict[str, Any]:
    """The fields of a study that another value at a place changes."""
    owner, name = place.owner, place.field
    if owner == "start":
        return {}
    if owner == "gravity":
        return {"structure": replace(study.structure, gravity=Gravity(value).acceleration)}
    if owner == "force":
        forces = dict(named_forces(study.base, study.forces))
        forces[place.part] = force_of(force_table(forces[place.part]) | {name: value})
        return {"forces": tuple(forces.values())}
    if owner == "base":
        beside = BASES[kind_of(study.base, BASES)].beside.get(name)
        if beside is not None:
            return {beside.argument: checked(name, value, beside.metadata)}
        return {"base": base_with(study.base, place.path.removeprefix("base."), value)}
    above = {"beam": ("structure", "beam", "segments", place.part), "damping": ("structure", "damping")}
    above["axial"] = ("structure", "axial")
    above |= {part: ("structure", nouns, place.part) for part, nouns in PARTS.items()}
    first, *keys = *above.get(owner, (owner,)), *name.split(".")
    return {first: _with(getattr(study, first), keys, value)}


def _with(noun: Any, keys: Sequence[str], value: Any) -> Any:
    """A noun with another value behind some keys: of fields, of a table, and of names among several nouns."""
    if not keys:
        return value
    first, *rest = keys
    if first == "gap" and isinstance(noun.gap, tuple) and math.inf in noun.gap:
        value = gaps_with(noun.gaps, value)
    if isinstance(noun, tuple):
        return tuple(_with(item, rest, value) if first in ("", item.name) else item for item in noun)
    if isinstance(noun, Mapping):
        # of a method, which checks it when it is made
        return {**noun, first: value}
    return replace(noun, **{first: _with(getattr(noun, first), rest, value)})


def pair_with(pair: ContactPair, name: str, value: Any) -> ContactPair:
    """A contact of a system with another gap, number of its law or of its body."""
    if name == "gap":
        return replace(pair, gaps=gaps_with(pair.gaps, value))
    if name.startswith("contact."):
        return replace(pair, law=replace(pair.law, **{name.removeprefix("contact."): value}))  # type: ignore[type-var]
    return replace(pair, **{name: value})


def bounds_of_axis(key: str, value: Any, way: str = "") -> tuple[float, float]:
    """Lowest and highest value of an axis that is searched, as (low, high)."""
    two = isinstance(value, (tuple, list)) and len(value) == 2
    two = two and all(in_range(end, quantity("")) for end in value) and value[0] < value[1]
    require(two, key, value, "", f"must be (low, high), two numbers with low < high{way}")
    return float(value[0]), float(value[1])


def unknown_path(path: str, known: Mapping[str, Place], of_system: bool) -> Fault:
    """The fault of a path that is not known."""
    parts = ("beam", "mass", "damping", "mesh", "reduction", "gravity", "axial", "spring", "dashpot", "support")
    if of_system and path.partition(".")[0] in parts:
        return Fault(path, None, "", f"{FIXED}: give a Study, or a function that returns a structure")
    of_base = {one for one in known if one.startswith("base.")}
    if path.startswith("base.") and of_base == {"base.history", "base.initial"}:
        return Fault(path, None, "", "needs a motion of the base, and [base] of this study is of kind 'rest'")
    if path == "base.frequency" and of_base:
        return Fault(path, None, "", f"is no number of this base: {OF_SINE}")
    return Fault(path, None, "", suggestion(path, known))


# ---- the system and the method of a case ------------------------------------------------------------

KEPT = 16
"""Systems that are kept for later cases."""

Values = Mapping[Place, Any]


@dataclass(eq=False)
class CaseSystems:
    """Makes the systems of cases from what a study is given."""

    given: Study | System | Callable[..., Any]  # of a callable its arguments are values of the case
    method: Method | None  # for all cases; None takes that of the study, or the one that suits the system
    elements: int  # of the structures that a function returns
    modes: int
    mesh: Mesh | None = None
    lock: threading.RLock = field(default_factory=threading.RLock, init=False)

    def __post_init__(self) -> None:
        if isinstance(self.given, Study) and self.mesh is None:
            self.mesh = read_mesh_of(self.given)
        self._kept = lru_cache(KEPT)(lambda items: self._made(dict(items)))

    def __reduce__(self) -> tuple[Any, ...]:
        # systems are made again where this is sent to, and a lock cannot be sent
        return CaseSystems, (self.given, self.method, self.elements, self.modes, self.mesh)

    def of(self, values: Values) -> System:
        """The system of a case, for its values before `Stage.METHOD`."""
        # one thread at a time: several at so many small calls would take longer than one after the other
        with self.lock:
            return self._kept(tuple((place, value) for place, value in values.items() if place.stage < Stage.METHOD))

    def _made(self, values: Values) -> System:
        of_modes, of_damping, of_balls = (
            {place: value for place, value in values.items() if place.stage == stage}
            for stage in (Stage.MODES, Stage.DAMPING, Stage.BALL)
        )
        if of_balls:
            rest = {place: value for place, value in values.items() if place.stage < Stage.BALL}
            return _with_balls(self.of(rest), of_balls)
        if of_damping and isinstance(self.given, Study):
            damping = study_with(self.given, of_damping).structure.damping
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

        Of a system or a function it is by default event-driven, or Newmark's where that does not take the system.
        """
        if self.method is not None:
            self.method.check(system)
            return self.method
        if not isinstance(self.given, Study):
            try:
                EventDriven().check(system)
            except InputError:
                return Newmark.for_system(system)
            return EventDriven()
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
    """The system with other masses, centring springs, dashpots and accelerations of its balls."""
    contacts = {pair.name: pair for pair in system.contacts}
    for place, value in values.items():
        contacts[place.part] = pair_with(contacts[place.part], place.field, value)
    for name, pair in contacts.items():
        if pair.between:
            contacts[name] = replace(pair, first_mode=root_mobility([contacts[ball] for ball in pair.between]))
    return with_checked_pairs(system, tuple(contacts.values()))


def _is_damping_of_modes(study: Study, damping: Rayleigh | ModalDamping | None) -> bool:
    """True if the damping of the reduced system follows from these ratios alone."""
    kept = study.reduction.modes if study.reduction else math.inf
    if study.structure.dashpots or damping is None:
        return False
    if isinstance(damping, ModalDamping):
        return len(damping.each) <= kept
    return damping.modes is None or max(damping.modes) <= kept
