"""What every method has in common for those who choose one: its check, its time grid, its notes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from femimpact.integrators.event_driven import EventDriven, check_events
from femimpact.integrators.stepping.newmark import HHT, WBZ, GeneralizedAlpha, MoreauJean, Newmark, SteppingMethod
from femimpact.integrators.stepping.step_size import check_sampling, check_step, step_notes
from femimpact.system.system import System

__all__ = ["METHODS", "Method", "check_method", "check_resolution", "method_notes", "time_grid"]

Method = SteppingMethod | EventDriven

METHODS: Mapping[str, Any] = {
    "newmark": Newmark,
    "hht": HHT,
    "wbz": WBZ,
    "generalized-alpha": GeneralizedAlpha,
    "moreau-jean": MoreauJean,
    "event-driven": EventDriven,
}
"""Methods by the name that a study file gives them."""


def check_method(system: System, method: Method) -> tuple[str, ...]:
    """Warnings of a method on a system; an error for one that cannot do what the system asks.

    Raises
    ------
    InputError
        If the step does not resolve the contact, or the method is not made for a contact's law.
    """
    if isinstance(method, EventDriven):
        check_events(system)
        return ()
    return check_step(system, method)


def check_resolution(frequencies: NDArray[Any], method: Method, key: str) -> None:
    """Refuse frequencies of the drive (Hz) that a step does not see."""
    if not isinstance(method, EventDriven):
        check_sampling(frequencies, method, key)


def method_notes(system: System, method: Method) -> tuple[str, ...]:
    """Notes on modes that a step does not follow."""
    return () if isinstance(method, EventDriven) else step_notes(system, method)


def time_grid(method: Method, frequency: float) -> float:
    """Time (s) between the instants at which a run under a drive of this frequency (Hz) can be read."""
    return 1.0 / (frequency * method.samples_per_cycle) if isinstance(method, EventDriven) else method.dt
