"""The parameter of a branch: a number of the excitation, a contact, a ball or the damping, by the path of a study file.

Of each the system is known twice: as a `System`, and as the numbers of its equations, which may be complex.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
import scipy.special

from femimpact.arrays import own
from femimpact.contact.collision import damping_ratio_for_restitution, linear_angle
from femimpact.contact.laws import KelvinVoigt, Rigid, speed_pieces_of
from femimpact.errors import changed, faults_of, quantity, require, require_type, suggestion
from femimpact.excitation.drives import PointForce
from femimpact.excitation.excitation import LineLoad
from femimpact.excitation.harmonic import Sine
from femimpact.orbits.motion import HybridSystem, Numbers, hybrid_system
from femimpact.response.channels import resolve_channels
from femimpact.structure.structure import gaps_with
from femimpact.system.contact_pair import ContactPair
from femimpact.system.system import System, with_checked_fields, with_checked_pairs

SHORT = {"frequency": "base.frequency", "amplitude": "base.amplitude"}
"""Short forms of paths. Of a force, too, these are frequency and amplitude."""

OF_MODES = ("mass", "beam", "spring", "mesh", "reduction", "support")
"""Tables of a study file of which every number changes the modes."""

OF_DAMPING = ("damping", "dashpot")
"""Tables of a study file that a system has as one matrix."""

FACTOR = "damping.factor"
"""Path of what multiplies all damping of structure and balls."""

NUMBERS = {item.name: item for item in fields(KelvinVoigt)}
"""Numbers of a Kelvin-Voigt law, of which it is given two."""


@dataclass(frozen=True)
class Parameter:
    """A number that varies, and what has it."""

    path: str
    unit: str
    value: float  # where the branch is begun
    allowed: dict[str, Any]  # metadata of its range
    hybrid: HybridSystem  # there
    hybrid_at: Callable[[Any], HybridSystem]  # of a real or a complex value
    at: Callable[[float], tuple[System, Sine | PointForce]]
    of_matrices: bool = False  # whether masses or damping differ at other values
    place: str = ""  # name of the displacement whose largest value is kept


def parameter_of(system: System, excitation: Sine | PointForce, path: Any, of: Any = None) -> Parameter:
    """The parameter of a path, and the displacement whose largest value is kept.

    Raises `InputError` if the system has no such number or displacement, or the number is none that a branch follows.
    """
    require_type(path, str, "parameter")
    hybrid = hybrid_system(system, excitation)
    known = {each.path: each for each in _parameters(system, excitation, hybrid)}
    found = known.get(SHORT.get(path, path))
    require(found is not None, "parameter", path, "", "" if found else _refusal(system, path, [*known, *SHORT]))
    assert found is not None
    walls = [pair for pair in system.contacts if pair.has_walls]
    if of is None and walls and not any(pair.is_stop or np.any(pair.direction) for pair in walls):
        # no ball meets the beam; in its box each has the gap for its largest displacement
        of = f"{walls[0].name}.absolute_displacement"
    with faults_of("of"):
        (channel,) = resolve_channels(system, (system.default_place if of is None else of,))
    require(channel.unit == "m", "of", of, channel.unit, "must be a displacement")
    return replace(found, place=channel.name)


def _refusal(system: System, path: str, known: list[str]) -> str:
    """Why a number is none that a branch follows."""
    names, owner = ", ".join(sorted(known)), path.partition(".")[0]
    if path == FACTOR:
        return f"must have a system with damping, of which this one has none; known: {names}"
    if owner in OF_DAMPING:
        return f"is in a system's damping matrix, of which {FACTOR} multiplies all; known: {names}"
    if owner in OF_MODES:
        return f"changes the modes, which a system has; known: {names}"
    pair = next((pair for pair in system.contacts if path.startswith(f"{pair.kind}.{pair.name}.")), None)
    if pair is None:
        return suggestion(path, known)
    number = path.removeprefix(f"{pair.kind}.{pair.name}.")
    if number == "gap" and pair.has_walls:
        return f"must have the same gap on both sides, not {pair.gaps} m; known: {names}"
    if number.startswith("contact."):
        return f"is no number of the contact's law, {_words(pair.law)}; known: {names}"
    return f"is no number that a branch is followed over; known: {names}"


def _words(law: Any) -> str:
    """What a law is given with."""
    given = [name for name in NUMBERS if getattr(law, name, None) is not None]
    return f"{type(law).__name__} with {' and '.join(given)}" if given else law.name


def _parameters(system: System, excitation: Sine | PointForce, hybrid: HybridSystem) -> Iterator[Parameter]:
    """All numbers that a branch may be followed over."""
    yield from _of_excitation(system, excitation, hybrid)
    for j, pair in enumerate(system.contacts):
        yield from _of_pair(system, excitation, hybrid, j, pair)
    given, factor = system.derived.get(FACTOR, (system, 1.0))
    undivided = hybrid if given is system else hybrid_system(given, excitation)

    def hybrid_at(value: Any) -> HybridSystem:
        return replace(undivided, damping=value * undivided.damping)

    def at(value: float) -> tuple[System, Sine | PointForce]:
        return _with_factor(given, value), excitation

    if np.any(undivided.damping):
        yield Parameter(FACTOR, "1", factor, quantity("1", at_least=0.0), hybrid, hybrid_at, at, of_matrices=True)


def _of_excitation(system: System, excitation: Any, hybrid: HybridSystem) -> Iterator[Parameter]:
    of_force = "1" if isinstance(getattr(excitation, "at", None), LineLoad) else "N"
    sine, unit = (excitation, "m") if isinstance(excitation, Sine) else (excitation.history, of_force)

    def at(value: float, name: str) -> tuple[System, Sine | PointForce]:
        number: dict[str, Any] = {name: value}
        if sine is excitation:
            return system, replace(excitation, **number)
        return system, replace(excitation, history=replace(sine, **number))

    def at_frequency(value: Any) -> HybridSystem:
        level = hybrid.amplitude * (sine.frequency / value) ** 2 if sine.by == "acceleration" else hybrid.amplitude
        return replace(hybrid, omega=2.0 * math.pi * value, amplitude=level)

    def at_amplitude(value: Any) -> HybridSystem:
        return replace(hybrid, amplitude=value)

    for name, of, allowed, hybrid_at in (
        ("frequency", "Hz", quantity("Hz", above=0.0), at_frequency),
        ("amplitude", unit, quantity(unit, at_least=0.0), at_amplitude),
    ):
        yield Parameter(f"base.{name}", of, getattr(sine, name), allowed, hybrid, hybrid_at, partial(at, name=name))


def _of_pair(
    system: System, excitation: Sine | PointForce, hybrid: HybridSystem, j: int, pair: ContactPair
) -> Iterator[Parameter]:
    """Numbers of a pair: its finite gaps together, the numbers of its law, the mass of a ball."""

    def parameter(
        name: str, value: float, allowed: dict[str, Any], hybrid_at: Callable[[Any], HybridSystem],
        pair_at: Callable[[float], ContactPair], of_matrices: bool = False,
    ) -> Parameter:  # fmt: skip
        def at(value: float) -> tuple[System, Sine | PointForce]:
            contacts = [pair_at(value) if i == j else other for i, other in enumerate(system.contacts)]
            return with_checked_pairs(system, tuple(contacts)), excitation

        path = f"{pair.kind}.{pair.name}.{name}"
        return Parameter(path, allowed["unit"], float(value), allowed, hybrid, hybrid_at, at, of_matrices)

    def with_spring(varied: HybridSystem, law: KelvinVoigt, effective_mass: Any, **number: Any) -> HybridSystem:
        """With the spring and dashpot of a law, one of whose numbers may be complex."""
        has = {name: getattr(law, name) for name in NUMBERS} | number
        stiffness, damping = has["stiffness"], has["damping"]
        if has["restitution"] is not None:
            ratio, angle = _ratio_and_angle(has["restitution"])
            if has["contact_time"] is not None:
                rate = 2.0 * angle / has["contact_time"]
                stiffness = effective_mass * rate * rate
            damping = 2.0 * ratio * np.sqrt(stiffness * effective_mass)
        return replace(
            varied,
            contact_stiffness=_with_entry(varied.contact_stiffness, j, stiffness),
            contact_damping=_with_entry(varied.contact_damping, j, damping),
        )

    def at_gap(value: Any) -> HybridSystem:
        return replace(hybrid, gaps=_with_entry(hybrid.gaps, (j, np.isfinite(hybrid.gaps[j])), value))

    def at_restitution(value: Any) -> HybridSystem:
        pieces = speed_pieces_of(pair.law, value) if isinstance(pair.law, Rigid) else ()
        over_speed = (*hybrid.over_speed[:j], pieces, *hybrid.over_speed[j + 1 :])
        return replace(hybrid, restitution=_with_entry(hybrid.restitution, j, value), over_speed=over_speed)

    def at_law(value: Any, law: KelvinVoigt, name: str) -> HybridSystem:
        return with_spring(hybrid, law, pair.effective_mass, **{name: value})

    def at_mass(value: Any) -> HybridSystem:
        i = system.dofs + j
        varied = replace(
            hybrid,
            mass=_with_entry(hybrid.mass, i, value),
            load=_with_entry(hybrid.load, i, -value if hybrid.moves_base else 0.0),
            constant=_with_entry(hybrid.constant, i, value * pair.acceleration),
        )
        if not isinstance(pair.law, KelvinVoigt):
            return varied
        return with_spring(varied, pair.law, 1.0 / (pair.first_mode**2 + 1.0 / value))

    def with_gap(value: float) -> ContactPair:
        return replace(pair, gaps=gaps_with(pair.gaps, value))

    def with_law(value: float, law: Rigid | KelvinVoigt, name: str) -> ContactPair:
        number: dict[str, Any] = {name: value}
        return replace(pair, law=replace(law, **number))

    gaps = {gap for gap in pair.gaps if math.isfinite(gap)}
    if len(gaps) == 1:
        one_stop = pair.is_stop and math.inf in pair.gaps
        yield parameter("gap", gaps.pop(), quantity("m") if one_stop else quantity("m", above=0.0), at_gap, with_gap)
    if pair.has_walls and pair.parameters.is_rigid:
        allowed, value = quantity("1", at_least=0.0, at_most=1.0), pair.parameters.restitution
        pair_at = partial(with_law, law=pair.law if isinstance(pair.law, Rigid) else Rigid(value), name="restitution")
        yield parameter("contact.restitution", value, allowed, at_restitution, pair_at)
    for name, item in NUMBERS.items() if isinstance(pair.law, KelvinVoigt) else ():
        law = _law_that_has(pair, name)
        if law is not None:
            hybrid_at, pair_at = partial(at_law, law=law, name=name), partial(with_law, law=law, name=name)
            yield parameter(f"contact.{name}", getattr(law, name), dict(item.metadata), hybrid_at, pair_at)
    # the law of balls that meet has numbers for their masses
    meets = any(pair.name in other.between and not other.parameters.is_rigid for other in system.contacts)
    if not pair.is_stop and not meets:
        yield parameter(
            "mass", pair.mass, quantity("kg", above=0.0), at_mass, lambda value: replace(pair, mass=value), True
        )


@lru_cache(maxsize=16)
def _ratio_and_angle(restitution: Any) -> tuple[Any, Any]:
    """Damping ratio z of a contact and its angle 2F1(1, 1; 3/2; (1 - z)/2), where e = exp(-2 z angle)."""
    e = restitution.real
    z = damping_ratio_for_restitution(e)
    angle, slope = linear_angle(z), -scipy.special.hyp2f1(2.0, 2.0, 2.5, 0.5 * (1.0 - z)) / 3.0
    # nothing of a real number
    step = -(restitution - e) / (2.0 * e * (angle + z * slope))
    return z + step, angle + slope * step


def _with_entry(array: Numbers, index: Any, value: Any) -> Numbers:
    """An array with other entries."""
    entries = array.astype(np.result_type(array, type(value)))
    entries[index] = value
    return entries


def _law_that_has(pair: ContactPair, name: str) -> KelvinVoigt | None:
    """A pair's law where it is given with a number, or as stiffness and damping where the number is one of these."""
    law, has = pair.law, pair.parameters
    if isinstance(law, KelvinVoigt) and getattr(law, name) is not None:
        return law
    return KelvinVoigt(has.stiffness, has.damping) if name in ("stiffness", "damping") else None


def _with_factor(system: System, value: float) -> System:
    """The system with all of its damping multiplied: of the structure, and of the dashpots that hold balls."""
    reactions = {
        name: changed(item, on_velocity=own(value * item.on_velocity)) for name, item in system.reactions.items()
    }
    contacts = [
        replace(pair, free_damping=value * pair.free_damping) if pair.free_damping else pair for pair in system.contacts
    ]
    rayleigh = None if system.rayleigh is None else (value * system.rayleigh[0], value * system.rayleigh[1])
    scaled: dict[str, Any] = {"C": value * system.C, "rayleigh": rayleigh, "reactions": reactions}
    varied = with_checked_fields(system, **scaled, contacts=tuple(contacts))
    # another branch that begins with it has the same scale
    varied.derived[FACTOR] = system, value
    return varied
