"""The parameter of a branch: a number of the excitation, a contact, a ball or the damping, by the path of a study file.

Of each the system is known twice: as a `System`, and as the numbers of its equations, which may be complex.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
import scipy.special

from femimpact.contact.collision import damping_ratio_for_restitution, linear_angle
from femimpact.contact.laws import KelvinVoigt, Rigid
from femimpact.errors import quantity, require, require_type, suggestion
from femimpact.excitation.drives import PointForce
from femimpact.excitation.harmonic import Sine
from femimpact.orbits.motion import HybridSystem, Numbers, hybrid_system
from femimpact.system.contact_pair import ContactPair
from femimpact.system.modes import with_checked_fields, with_checked_pairs
from femimpact.system.system import System

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


def parameter_of(system: System, excitation: Sine | PointForce, path: Any) -> Parameter:
    """The parameter of a path.

    Raises `InputError` if the system has no such number, or it is none that a branch follows.
    """
    require_type(path, str, "parameter")
    hybrid = hybrid_system(system, excitation)
    known = {each.path: each for each in _parameters(system, excitation, hybrid)}
    found = known.get(SHORT.get(path, path))
    require(found is not None, "parameter", path, "", "" if found else _refusal(system, path, [*known, *SHORT]))
    assert found is not None
    return found


def _refusal(system: System, path: str, known: list[str]) -> str:
    """Why a number is none that a branch follows."""
    names, owner = ", ".join(sorted(known)), path.partition(".")[0]
    if path == FACTOR:
        return f"must have a system with damping, of which this one has none; known: {names}"
    if owner in OF_DAMPING:
        return f"is in a system's damping matrix, of which {FACTOR} multiplies all; known: {names}"
    if owner in OF_MODES:
        return f"changes the modes, which a system has; known: {names}"
    pair = next((pair for pair in system.contacts if path.startswith(f"{_place(pair)}.")), None)
    if pair is None:
        return suggestion(path, known)
    number = path.removeprefix(f"{_place(pair)}.")
    if number == "gap" and pair.has_walls:
        return f"must have the same gap on both sides, not {pair.gaps} m; known: {names}"
    if number.startswith("contact."):
        return f"is no number of the contact's law, {_words(pair.law)}; known: {names}"
    return f"is no number that a branch is followed over; known: {names}"


def _place(pair: ContactPair) -> str:
    """Path of a pair."""
    owner = "stop" if pair.is_stop else "impactor" if pair.has_walls else "absorber"
    return f"{owner}.{pair.name}"


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
    if np.any(undivided.damping):
        yield Parameter(
            FACTOR, "1", factor, quantity("1", at_least=0.0), hybrid, partial(_at_factor, undivided),
            partial(_with_factor, given, excitation), of_matrices=True,
        )  # fmt: skip


def _of_excitation(system: System, excitation: Sine | PointForce, hybrid: HybridSystem) -> Iterator[Parameter]:
    of_force = isinstance(excitation, PointForce)
    sine = excitation.history if isinstance(excitation, PointForce) else excitation
    numbers = {
        "frequency": ("Hz", quantity("Hz", above=0.0), _at_frequency),
        "amplitude": ("N" if of_force else "m", quantity("N" if of_force else "m", at_least=0.0), _at_amplitude),
    }
    for name, (unit, allowed, hybrid_at) in numbers.items():
        yield Parameter(
            f"base.{name}", unit, float(getattr(sine, name)), allowed, hybrid, partial(hybrid_at, hybrid),
            partial(_with_excitation, system, excitation, name),
        )  # fmt: skip


def _of_pair(
    system: System, excitation: Sine | PointForce, hybrid: HybridSystem, j: int, pair: ContactPair
) -> Iterator[Parameter]:
    def parameter(
        name: str, unit: str, value: float, allowed: dict[str, Any], hybrid_at: Callable[..., HybridSystem],
        with_value: Callable[[ContactPair, float], ContactPair], of_matrices: bool = False,
    ) -> Parameter:  # fmt: skip
        return Parameter(
            f"{_place(pair)}.{name}", unit, value, allowed, hybrid, partial(hybrid_at, hybrid, j),
            partial(_with_pair, system, excitation, j, with_value), of_matrices,
        )  # fmt: skip

    gaps = {gap for gap in pair.gaps if math.isfinite(gap)}
    if len(gaps) == 1:
        one_stop = pair.is_stop and math.inf in pair.gaps
        allowed = quantity("m") if one_stop else quantity("m", above=0.0)
        yield parameter("gap", "m", gaps.pop(), allowed, _at_gap, _with_gap)
    if pair.has_walls and pair.parameters.is_rigid:
        allowed = quantity("1", at_least=0.0, at_most=1.0)
        value = pair.parameters.restitution
        with_value = partial(_with_contact, law=Rigid(value), name="restitution")
        yield parameter("contact.restitution", "1", value, allowed, _at_restitution, with_value)
    if isinstance(pair.law, KelvinVoigt):
        for name, item in NUMBERS.items():
            law = _law_that_has(pair, name)
            if law is not None:
                numbers, unit, value = _numbers_of(law), item.metadata["unit"], float(getattr(law, name))
                hybrid_at = partial(_at_contact, numbers=numbers, name=name, effective_mass=pair.effective_mass)
                with_value = partial(_with_contact, law=law, name=name)
                yield parameter(f"contact.{name}", unit, value, dict(item.metadata), hybrid_at, with_value)
    if not pair.is_stop:
        of_law = _numbers_of(pair.law) if isinstance(pair.law, KelvinVoigt) else None
        at_mass = partial(_at_mass, pair=pair, coordinate=system.dofs + j, numbers=of_law)
        yield parameter("mass", "kg", pair.mass, quantity("kg", above=0.0), at_mass, _with_mass, of_matrices=True)


def _at_frequency(hybrid: HybridSystem, value: Any) -> HybridSystem:
    return replace(hybrid, omega=2.0 * math.pi * value)


def _at_amplitude(hybrid: HybridSystem, value: Any) -> HybridSystem:
    return replace(hybrid, amplitude=value)


def _at_factor(hybrid: HybridSystem, value: Any) -> HybridSystem:
    return replace(hybrid, damping=value * hybrid.damping)


def _at_gap(hybrid: HybridSystem, j: int, value: Any) -> HybridSystem:
    """The system with the finite gaps of a pair changed together."""
    return replace(hybrid, gaps=_with_entry(hybrid.gaps, (j, np.isfinite(hybrid.gaps[j])), value))


def _at_restitution(hybrid: HybridSystem, j: int, value: Any) -> HybridSystem:
    return replace(hybrid, restitution=_with_entry(hybrid.restitution, j, value))


def _at_contact(
    hybrid: HybridSystem, j: int, value: Any, *, numbers: dict[str, Any], name: str, effective_mass: float
) -> HybridSystem:
    """The system with another number of a Kelvin-Voigt law, whose other one is held."""
    given = numbers | {name: value}
    if name == "restitution":
        given["ratio_and_angle"] = _ratio_and_angle(value)
    return _with_spring(hybrid, j, given, effective_mass)


def _at_mass(
    hybrid: HybridSystem, j: int, value: Any, *, pair: ContactPair, coordinate: int, numbers: dict[str, Any] | None
) -> HybridSystem:
    """The system with another mass of a ball, for which the numbers of its law give another spring and dashpot."""
    varied = replace(
        hybrid,
        mass=_with_entry(hybrid.mass, coordinate, value),
        load=_with_entry(hybrid.load, coordinate, -value if hybrid.moves_base else 0.0),
        constant=_with_entry(hybrid.constant, coordinate, value * pair.acceleration),
    )
    return varied if numbers is None else _with_spring(varied, j, numbers, 1.0 / (pair.first_mode**2 + 1.0 / value))


def _with_spring(hybrid: HybridSystem, j: int, numbers: dict[str, Any], effective_mass: Any) -> HybridSystem:
    """The system with the spring and dashpot of a Kelvin-Voigt law by its numbers, which may be complex."""
    stiffness, damping = numbers["stiffness"], numbers["damping"]
    if numbers["ratio_and_angle"] is not None:
        ratio, angle = numbers["ratio_and_angle"]
        if numbers["contact_time"] is not None:
            rate = 2.0 * angle / numbers["contact_time"]
            stiffness = effective_mass * rate * rate
        damping = 2.0 * ratio * np.sqrt(stiffness * effective_mass)
    return replace(
        hybrid,
        contact_stiffness=_with_entry(hybrid.contact_stiffness, j, stiffness),
        contact_damping=_with_entry(hybrid.contact_damping, j, damping),
    )


def _numbers_of(law: KelvinVoigt) -> dict[str, Any]:
    """Numbers of a law, None where it is given with others, and what follows from its restitution alone."""
    both = None if law.restitution is None else _ratio_and_angle(law.restitution)
    return {name: getattr(law, name) for name in NUMBERS} | {"ratio_and_angle": both}


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


def _with_excitation(system: System, excitation: Any, name: str, value: float) -> tuple[System, Any]:
    if isinstance(excitation, PointForce):
        return system, replace(excitation, history=replace(excitation.history, **{name: value}))
    return system, replace(excitation, **{name: value})


def _with_pair(
    system: System, excitation: Any, j: int, change: Callable[[ContactPair, float], ContactPair], value: float
) -> tuple[System, Any]:
    contacts = [change(pair, value) if i == j else pair for i, pair in enumerate(system.contacts)]
    return with_checked_pairs(system, tuple(contacts)), excitation


def _with_gap(pair: ContactPair, value: float) -> ContactPair:
    plus, minus = (value if math.isfinite(gap) else gap for gap in pair.gaps)
    return replace(pair, gaps=(plus, minus))


def _with_contact(pair: ContactPair, value: float, *, law: Rigid | KelvinVoigt, name: str) -> ContactPair:
    number: dict[str, Any] = {name: value}
    return replace(pair, law=replace(law, **number))


def _with_mass(pair: ContactPair, value: float) -> ContactPair:
    return replace(pair, mass=value)


def _with_factor(system: System, excitation: Any, value: float) -> tuple[System, Any]:
    """The system with all of its damping multiplied: of the structure, and of the dashpots that hold balls."""
    reactions = {name: replace(item, on_velocity=value * item.on_velocity) for name, item in system.reactions.items()}
    contacts = [
        replace(pair, free_damping=value * pair.free_damping) if pair.free_damping else pair for pair in system.contacts
    ]
    rayleigh = None if system.rayleigh is None else (value * system.rayleigh[0], value * system.rayleigh[1])
    scaled: dict[str, Any] = {"C": value * system.C, "rayleigh": rayleigh, "reactions": reactions}
    varied = with_checked_fields(system, **scaled, contacts=tuple(contacts))
    # another branch that begins with it has the same scale
    varied.derived[FACTOR] = system, value
    return varied, excitation
