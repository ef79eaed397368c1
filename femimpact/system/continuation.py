"""What a run has reached beyond displacements and velocities, so that the same method can go on from it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.excitation import Excitation

__all__ = ["Continuation", "begun_anew", "same_excitation"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Continuation:
    """What a method needs of a run to go on with it; opaque to all others.

    Parameters
    ----------
    kind : object
        Equal for methods that can go on from `held`.
    held : object
        Arrays of the method's own.
    displacements, velocities : pair of ndarray
        Of the dofs (dofs,) and of the balls (balls,) relative to the base at that time, m and m/s.
    time : float, s
    system : System
    excitation : Excitation
    touching : tuple of str
        Names of the contacts in progress, sticking ones included.
    """

    kind: object
    held: Any
    displacements: tuple[Array, Array]
    velocities: tuple[Array, Array]
    time: float
    system: Any
    excitation: Excitation
    touching: tuple[str, ...] = ()

    def has_contacts_of(self, system: Any, excitation: Excitation, time: float) -> bool:
        """Whether contacts in progress are those of a system under an excitation from a time (s) on.

        The cavities of balls move with a base that jumps, a stop that is fixed in space does not.
        """
        alone = all(pair.fixed_to == "base" for pair in system.contacts)
        return _same_contacts(self.system, system) and (alone or self._same_drive(excitation, time))

    def has_equations_of(self, system: Any, excitation: Excitation, time: float) -> bool:
        """Whether all equations are those of the run, so that accelerations too go on as they are."""
        return self._same_drive(excitation, time) and _same_equations(self.system, system)

    def _same_drive(self, excitation: Excitation, time: float) -> bool:
        return time == self.time and same_excitation(self.excitation, excitation)


def begun_anew(left: Continuation | None, going_on: Collection[str]) -> tuple[str, ...]:
    """A note on contacts in progress at the end of a run, but for those that go on in the one that began there."""
    names = [] if left is None else [name for name in left.touching if name not in going_on]
    if not names:
        return ()
    return (
        f"the initial state is inside a contact of {', '.join(names)}, which begins anew: the state was left by "
        "another method, on another system or under another excitation, or its values were changed",
    )


def same_excitation(first: Any, second: Any) -> bool:
    """Whether two excitations are one: the same object, equal ones, or equal samples at the same place."""
    if first is second:
        return True
    if type(first) is not type(second):
        return False
    lines = [getattr(item, "closed_form", None) for item in (first, second)]
    if all(hasattr(line, "samples") for line in lines):
        places = [getattr(item, "at", None) for item in (first, second)]
        rest = [(line.interval, line.initial_velocity) for line in lines if line is not None]
        return places[0] == places[1] and rest[0] == rest[1] and np.array_equal(*(line.samples for line in lines))  # type: ignore[union-attr]
    return bool(np.all(first == second))


def _same_contacts(first: Any, second: Any) -> bool:
    if first is second or first.contacts is second.contacts:
        return True
    names = ("name", "gaps", "law", "mass", "fixed_to", "free_stiffness", "acceleration")
    return len(first.contacts) == len(second.contacts) and all(
        all(getattr(a, name) == getattr(b, name) for name in names) and np.array_equal(a.direction, b.direction)
        for a, b in zip(first.contacts, second.contacts, strict=True)
    )


def _same_equations(first: Any, second: Any) -> bool:
    if first is second:
        return True
    if first.dofs != second.dofs or not _same_contacts(first, second):
        return False
    loads = all(np.array_equal(getattr(first, name), getattr(second, name)) for name in ("base_load", "constant_load"))
    return loads and all((getattr(first, name) != getattr(second, name)).nnz == 0 for name in ("M", "C", "K"))
