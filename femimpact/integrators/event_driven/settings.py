"""The numbers that the event-driven loop takes of its method, and which systems it takes."""

from __future__ import annotations

from typing import Protocol

from femimpact.contact.formulas import KELVIN_VOIGT, RIGID
from femimpact.errors import require
from femimpact.system.system import System

__all__ = ["EventSettings", "check_events"]

MOST_PAIRS = 60
"""Contact pairs of one system: the set of those in contact is a number of 64 bits."""


class EventSettings(Protocol):
    """The event-driven method, as its run takes it; see `EventDriven`."""

    @property
    def closure(self) -> float:
        """Height of a bounce that is the last, m."""

    @property
    def samples_per_cycle(self) -> int:
        """Instants of a base cycle at which a run is read."""

    @property
    def most_events(self) -> int:
        """Events of a base cycle beyond which a run is given up."""


def check_events(system: System) -> None:
    """Refuse what the method cannot compute exactly, and say what does.

    Raises
    ------
    InputError
        If the system is not on its modes, or a contact is neither rigid nor Kelvin-Voigt, or leaves no clearance.
    """
    allowed = "must be on its normal modes for EventDriven: use reduce(system, modes=n)"
    require(system.is_diagonal, "system", f"{system.dofs} coupled dofs", "", allowed)
    allowed = f"must be at most {MOST_PAIRS} contacts for EventDriven; Newmark takes any number"
    require(len(system.contacts) <= MOST_PAIRS, "system", f"{len(system.contacts)} contacts", "", allowed)
    for pair in system.contacts:
        allowed = "must be Rigid or KelvinVoigt for EventDriven; other laws are for Newmark and its family"
        require(pair.parameters.kind in (RIGID, KELVIN_VOIGT), f"{pair.name}.contact", pair.law.name, "", allowed)
        clear = sum(pair.gaps) > 0.0
        require(clear, f"{pair.name}.gap", sum(pair.gaps), "m", "must leave some clearance between both walls")
