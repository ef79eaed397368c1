"""Where the balls of a case start: the same unit draws for every case, scaled to its gaps and its base."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, suggestion
from femimpact.excitation import Excitation
from femimpact.integrators.methods import METHODS
from femimpact.study.base_motion import SignalMotion
from femimpact.study.study import BaseMotion, Gravity, MeshChoice, Reduction, Study
from femimpact.system.state import State
from femimpact.system.system import System


class Stage(IntEnum):
    """From where on a changed value makes a case anew; what comes first in running order is the lowest."""

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
    "mass": "masses", "impactor": "impactors", "stop": "stops", "spring": "springs", "dashpot": "dashpots",
    "absorber": "absorbers",
}  # fmt: skip
"""Tables of a study file, and the fields of `Structure` that they become."""

OF_BALL = ("mass", "free_stiffness", "acceleration", "free_damping")
"""Numbers of a ball in a system; its acceleration there is the whole, with gravity."""

BASE = {"frequency": "Hz", "amplitude": "m", "phase": "rad", "start": ""}

OF_LEVEL = {"amplitude": "m", "acceleration": "m/s^2", "octaves_per_minute": "1/min"}
"""Keys of [base] of a motion that are no fields of its noun."""

START = {"position": "m", "speed": "m/s"}

FIXED = "does not follow from the contacts, the excitation and the start, which are all that a System leaves open"


def paths_of_study(study: Study) -> dict[str, Place]:
    """Every value of a study that an axis may have, by its path."""
    return {place.path: place for place in _places(study)}


def paths_of_system(system: System) -> dict[str, Place]:
    """The same of a system: contacts, excitation and start."""
    return {place.path: place for place in _places_of_system(system)}


def paths_of_function(names: tuple[str, ...], system: System) -> dict[str, Place]:
    """The same of a function that returns a structure or a system, whose arguments are values, too."""
    own = {name: Place(name, "", Stage.MODES, "function", "", name) for name in names}
    return {**paths_of_system(system), **own}


def _places(study: Study) -> Iterator[Place]:
    structure = study.structure
    segments = structure.beam.segments
    for segment in segments:
        part = segment.name if len(segments) > 1 else ""
        yield from _fields_of(segment, "beam", part, Stage.MODES)
    for owner, name in PARTS.items():
        for item in getattr(structure, name):
            yield from _fields_of(item, owner, item.name, Stage.MODES)
            yield from _law_of(owner, item.name, getattr(item, "contact", None))
    if structure.damping is not None:
        for name in ("ratio", "ratios", "frequencies"):
            if hasattr(structure.damping, name):
                yield _place("damping", "", name, "Hz" if name == "frequencies" else "1", Stage.DAMPING)
    yield _place("gravity", "", "acceleration", "m/s^2", Stage.MODES)
    yield from _fields_of(study.mesh, "mesh", "", Stage.MODES)
    if study.reduction is not None:
        yield from _fields_of(study.reduction, "reduction", "", Stage.MODES)
    yield from _fields_of(METHODS[study.method.get("name", "newmark")], "method", "", Stage.METHOD)
    moving = [ball.name for ball in structure.impactors] + [body.name for body in structure.absorbers]
    yield from _excitation_and_start(moving, _units_of_base(study.base))


def _units_of_base(base: Any) -> Mapping[str, str]:
    """Values of [base] that are numbers, and the start, each with its unit, by their keys in a study file."""
    if isinstance(base, BaseMotion):
        return BASE
    if not isinstance(base, SignalMotion):
        return {"scale": "1", "duration": "s", "start": ""}
    known = {item.name: item.metadata.get("unit", "") for item in dataclasses.fields(base.excitation)}
    numbers = {
        name: {**known, **OF_LEVEL}.get(name, "")
        for name, value in base.values
        if isinstance(value, (int, float, tuple)) and not isinstance(value, bool)
    }
    # what a start is called beside a chirp's first frequency
    return {**numbers, "history": "s", "initial": ""}


def _places_of_system(system: System) -> Iterator[Place]:
    for pair in system.contacts:
        owner = "stop" if pair.is_stop else "impactor" if pair.has_walls else "absorber"
        if pair.has_walls:
            yield _place(owner, pair.name, "gap", "m", Stage.CASE)
        if not pair.is_stop:
            units = {"mass": "kg", "free_stiffness": "N/m", "acceleration": "m/s^2", "free_damping": "N s/m"}
            for name in OF_BALL:
                yield _place(owner, pair.name, name, units[name], Stage.BALL)
        yield from _law_of(owner, pair.name, pair.law)
    yield from _excitation_and_start([pair.name for pair in system.balls], BASE)


def _excitation_and_start(balls: list[str], base: Mapping[str, str]) -> Iterator[Place]:
    for name, unit in base.items():
        yield _place("base", "", name, unit, Stage.CASE)
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
        if not unit and not is_place:
            continue
        own = stage
        if owner in ("impactor", "stop"):
            # an acceleration is added to gravity, which the structure has
            of_ball = item.name in OF_BALL and item.name != "acceleration"
            own = Stage.CASE if item.name == "gap" else Stage.BALL if of_ball else stage
        yield _place(owner, part, item.name, "m" if is_place else unit, own)


def _law_of(owner: str, part: str, law: Any) -> Iterator[Place]:
    if dataclasses.is_dataclass(law):
        for item in dataclasses.fields(law):
            if item.metadata.get("unit") and not isinstance(getattr(law, item.name), str):
                yield _place(owner, part, f"contact.{item.name}", item.metadata["unit"], Stage.CASE)


def study_with(study: Study, values: Mapping[Place, Any]) -> Study:
    """The study with some of its values changed; those of the start of the balls stay what they were.

    Raises `InputError` if a value is out of range, or does not fit the others.
    """
    found: dict[str, Any] = {"structure": study.structure}
    for place, value in values.items():
        try:
            _change(found, study, place, value)
        except InputError as error:
            raise _under(place, error) from None
    return replace(study, **found)


def damping_with(study: Study, values: Mapping[Place, Any]) -> Any:
    """The damping of a study with some of its values changed; see `study_with`."""
    damping: Any = study.structure.damping
    for place, value in values.items():
        try:
            damping = replace(damping, **{place.field: value})
        except InputError as error:
            raise _under(place, error) from None
    return damping


def _under(place: Place, error: InputError) -> InputError:
    """The error of a noun with the path of the noun before its keys."""
    return InputError([replace(fault, key=f"{_prefix(place)}{fault.key}") for fault in error.faults])


def _prefix(place: Place) -> str:
    return place.path.removesuffix(place.field.rpartition(".")[2])


def _change(found: dict[str, Any], study: Study, place: Place, value: Any) -> None:
    structure, owner, name = found["structure"], place.owner, place.field
    if owner == "start":
        return
    if owner in PARTS:
        changed = tuple(
            _item_with(item, name, value) if item.name == place.part else item
            for item in getattr(structure, PARTS[owner])
        )
        found["structure"] = replace(structure, **{PARTS[owner]: changed})
    elif owner == "beam":
        segments = tuple(
            replace(segment, **{name: value}) if place.part in ("", segment.name) else segment
            for segment in structure.beam.segments
        )
        found["structure"] = replace(structure, beam=replace(structure.beam, segments=segments))
    elif owner == "damping":
        found["structure"] = replace(structure, damping=replace(structure.damping, **{name: value}))
    elif owner == "gravity":
        found["structure"] = replace(structure, gravity=Gravity(value).acceleration)
    elif owner == "method":
        # checked by the method, when it is made
        found["method"] = {**found.get("method", study.method), name: value}
    elif owner == "base" and isinstance(study.base, SignalMotion) and name not in ("history", "initial"):
        signal: Any = found.get("base", study.base)
        found["base"] = replace(signal, values=tuple({**dict(signal.values), name: value}.items()))
    else:
        kept: BaseMotion | MeshChoice | Reduction | Any = found.get(owner, getattr(study, owner))
        found[owner] = replace(kept, **{name: value})


def _item_with(item: Any, name: str, value: Any) -> Any:
    if name.startswith("contact."):
        return replace(item, contact=replace(item.contact, **{name.removeprefix("contact."): value}))
    return replace(item, **{name: value})


def unknown_path(path: str, known: Mapping[str, Place], of_system: bool) -> Fault:
    """What is wrong with a path that is not known."""
    parts = ("beam", "mass", "damping", "mesh", "reduction", "gravity", "spring", "dashpot", "support")
    if of_system and path.partition(".")[0] in parts:
        return Fault(path, None, "", f"{FIXED}: give a Study, or a function that returns a structure")
    return Fault(path, None, "", suggestion(path, known))


def unit_draws(starts: int, balls: int, seed: int) -> Array:
    """Numbers (starts, balls, 2) from 0 to 1, for the place and the speed of each ball; those of fewer starts first."""
    return np.random.default_rng(seed).random((starts, balls, 2))


def scaled_starts(
    draws: Array,  # (starts, balls, 2)
    gaps: Array,  # (cases, balls, 2) m: to the + and to the - side
    speed: Array,  # (cases,) m/s: amplitude times angular frequency of the base
) -> tuple[Array, Array]:  # (cases, starts, balls) m and m/s
    """Places of balls, uniform in their gaps, and speeds, uniform within +- a speed, relative to the structure.

    The body of an absorber, without walls, is in the middle.
    """
    plus, minus = np.moveaxis(np.where(np.isfinite(gaps), gaps, 0.0)[:, None], -1, 0)
    displacement = -minus + (plus + minus) * draws[None, :, :, 0]
    return displacement, speed[:, None, None] * (2.0 * draws[None, :, :, 1] - 1.0)


def structure_at_balls(system: System, initial: State, base: Excitation) -> Array:
    """Displacement (m) of the structure at each ball where a run starts, (balls,): of a static state it is not zero."""
    u, *_ = initial.relative_to_base(system, base)
    return np.array([pair.direction @ u for pair in system.balls])


def placed_balls(
    given: Array,  # (balls,) m: not a number where no axis places a ball; zero is a place as any other
    system: System,
    initial: State,  # from which the run starts
    base: Excitation,
) -> Array:
    """Displacements (m) of the balls, (balls,), those that are not given where they lie; all not given stay so."""
    left = np.isnan(given)
    if left.all() or not left.any():
        return given
    if not initial.is_static_on(system):
        return np.where(left, 0.0, given)
    *_, other, _ = initial.relative_to_base(system, base)
    return np.where(left, other[: given.size], given)
