"""The parameter of a branch: a number of the excitation or of a contact, by the path that a study file has."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from femimpact.contact.laws import Rigid
from femimpact.errors import quantity, require, require_type, suggestion
from femimpact.excitation import PointForce, Sine
from femimpact.orbits.flow import HybridSystem, hybrid_system
from femimpact.system.contact_pair import ContactPair
from femimpact.system.system import System

SHORT = {"frequency": "base.frequency", "amplitude": "base.amplitude"}
"""Short forms of paths. Of a force, too, these are frequency and amplitude."""

OF_MODES = ("mass", "beam", "spring", "dashpot", "mesh", "reduction", "damping")
"""Tables of a study file of which every number changes the modes or their damping."""


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


def parameter_of(system: System, excitation: Sine | PointForce, path: Any) -> Parameter:
    """The parameter of a path.

    Raises `InputError` if the system has no such number, or it is none that a branch follows.
    """
    require_type(path, str, "parameter")
    known = _of_excitation(system, excitation) | _of_contacts(system, excitation)
    found = known.get(SHORT.get(path, path))
    require(found is not None, "parameter", path, "", "" if found else _refusal(system, path, [*known, *SHORT]))
    assert found is not None
    return found


def _refusal(system: System, path: str, known: list[str]) -> str:
    """Why a number is none that a branch follows."""
    names, (owner, _, rest) = ", ".join(sorted(known)), path.partition(".")
    if owner in OF_MODES:
        return f"changes the modes, which a system has; known: {names}"
    parts = [pair for pair in system.contacts if rest.startswith(f"{pair.name}.")]
    if not parts:
        return suggestion(path, known)
    number = rest.removeprefix(f"{parts[0].name}.")
    if number == "gap":
        return f"must have the same gap on both sides, not {parts[0].gaps} m; known: {names}"
    if number == "contact.restitution":
        return f"must have a Rigid contact, not {parts[0].law.name}; known: {names}"
    return f"is no number that a branch is followed over; known: {names}"


def _of_excitation(system: System, excitation: Sine | PointForce) -> dict[str, Parameter]:
    hybrid, of_force = hybrid_system(system, excitation), isinstance(excitation, PointForce)
    sine = excitation.history if isinstance(excitation, PointForce) else excitation
    numbers = {
        "frequency": ("Hz", quantity("Hz", above=0.0), _at_frequency),
        "amplitude": ("N" if of_force else "m", quantity("N" if of_force else "m", at_least=0.0), _at_amplitude),
    }
    return {
        f"base.{name}": Parameter(
            f"base.{name}", unit, float(getattr(sine, name)), allowed, hybrid, partial(hybrid_at, hybrid),
            partial(_with_excitation, system, excitation, name),
        )
        for name, (unit, allowed, hybrid_at) in numbers.items()
    }  # fmt: skip


def _of_contacts(system: System, excitation: Sine | PointForce) -> dict[str, Parameter]:
    hybrid, found = hybrid_system(system, excitation), dict[str, Parameter]()
    for j, pair in enumerate(system.contacts):
        owner, gaps = "stop" if pair.is_stop else "impactor", {gap for gap in pair.gaps if math.isfinite(gap)}
        if len(gaps) == 1:
            path, one_stop = f"{owner}.{pair.name}.gap", pair.is_stop and math.inf in pair.gaps
            found[path] = Parameter(
                path, "m", gaps.pop(), quantity("m") if one_stop else quantity("m", above=0.0), hybrid,
                partial(_at_gap, hybrid, j), partial(_with_pair, system, excitation, j, _with_gap),
            )  # fmt: skip
        if pair.has_walls and pair.parameters.is_rigid:
            path = f"{owner}.{pair.name}.contact.restitution"
            found[path] = Parameter(
                path, "1", pair.parameters.restitution, quantity("1", at_least=0.0, at_most=1.0), hybrid,
                partial(_at_restitution, hybrid, j), partial(_with_pair, system, excitation, j, _with_restitution),
            )  # fmt: skip
    return found


def _at_frequency(hybrid: HybridSystem, value: Any) -> HybridSystem:
    return replace(hybrid, omega=2.0 * math.pi * value)


def _at_amplitude(hybrid: HybridSystem, value: Any) -> HybridSystem:
    return replace(hybrid, amplitude=value)


def _at_gap(hybrid: HybridSystem, j: int, value: Any) -> HybridSystem:
    """The system with the finite gaps of a pair changed together."""
    gaps = hybrid.gaps.astype(np.result_type(hybrid.gaps, type(value)))
    gaps[j, np.isfinite(hybrid.gaps[j])] = value
    return replace(hybrid, gaps=gaps)


def _at_restitution(hybrid: HybridSystem, j: int, value: Any) -> HybridSystem:
    restitution = hybrid.restitution.astype(np.result_type(hybrid.restitution, type(value)))
    restitution[j] = value
    return replace(hybrid, restitution=restitution)


def _with_excitation(system: System, excitation: Any, name: str, value: float) -> tuple[System, Any]:
    if isinstance(excitation, PointForce):
        return system, replace(excitation, history=replace(excitation.history, **{name: value}))
    return system, replace(excitation, **{name: value})


def _with_pair(
    system: System, excitation: Any, j: int, change: Callable[[ContactPair, float], ContactPair], value: float
) -> tuple[System, Any]:
    contacts = [change(pair, value) if i == j else pair for i, pair in enumerate(system.contacts)]
    return replace(system, contacts=tuple(contacts)), excitation


def _with_gap(pair: ContactPair, value: float) -> ContactPair:
    plus, minus = (value if math.isfinite(gap) else gap for gap in pair.gaps)
    return replace(pair, gaps=(plus, minus))


def _with_restitution(pair: ContactPair, value: float) -> ContactPair:
    return replace(pair, law=Rigid(value))
