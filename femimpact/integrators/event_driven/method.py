"""The event-driven method as a value, and what it takes."""

from __future__ import annotations

from dataclasses import dataclass, field

from femimpact.contact.formulas import KELVIN_VOIGT, RIGID
from femimpact.errors import check_fields, quantity, require
from femimpact.system.system import System

__all__ = ["EventDriven", "check_events"]

MOST_PAIRS = 60
"""Contact pairs of one system: the set of those in contact is a number of 64 bits."""


@dataclass(frozen=True)
class EventDriven:
    """Exact motion between impacts and through Kelvin-Voigt contacts: no step, nothing to tune.

    Between events every mode and every ball moves in closed form. The first crossing of a gap is
    approached by times in which a bound on the motion excludes one, so that none is missed, and
    met to rounding. A rigid impact changes the relative speed v to -e v by an impulse
    (1 + e) v/(1/m + b^T M^-1 b). Impacts at the same instant are resolved one after another, the
    fastest first, until no pair at its wall approaches it.

    While the force of a Kelvin-Voigt contact pushes, structure, ball and wall are one linear system with a
    closed form of its own. The contact ends where its force k p + c p' would turn into a pull; what the wall has
    stored by then is lost as it springs back behind the ball. Rigid and Kelvin-Voigt contacts may be mixed.

    Parameters
    ----------
    closure : float, m
        For rigid contacts. A bounce that would rise no higher is the last: the pair is captured, its momentum handed
        over, and sticks to its wall until the contact force changes sign. What is left out is a
        displacement below the closure and the energy m_eff v^2/2 of that bounce, which is counted as
        loss; the accumulation's end, 2 v/(a (1 - e)) later, is the start in the table of sticking phases.
    samples_per_cycle : int
        Grid on which channels, rms, harmonics and the ledger are read; neither events nor the peak of a cycle, which
        is exact, depend on it.
    most_events : int
        Impacts and changes of contact for each base cycle, on average over what is computed at once,
        beyond which a run is given up.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    closure: float = field(default=1e-12, metadata=quantity("m", above=0.0))
    samples_per_cycle: int = field(default=64, metadata=quantity("1", at_least=8, at_most=1_000_000, integer=True))
    most_events: int = field(default=1_000_000, metadata=quantity("1", at_least=10, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)


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
