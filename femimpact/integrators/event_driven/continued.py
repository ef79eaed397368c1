"""An event-driven run that goes on from where another one ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.excitation import Excitation
from femimpact.integrators.event_driven.loop_data import BEGUN, FREE, STARTED, Cases
from femimpact.system.continuation import Continuation
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["Held", "final_state", "held_by", "resume_contacts", "touching"]

Array = NDArray[np.float64]

KIND = "events"
"""All event-driven runs go on from one another: nothing that is held depends on the settings."""


@dataclass(frozen=True, eq=False)
class Held:
    """Contacts of a case at the end of its run.

    Parameters
    ----------
    state : ndarray (pairs,)
        Contact states.
    touch : ndarray (6, pairs)
        What those in progress have added up to; see `loop_data.BEGUN`.
    to_modes : ndarray (pairs, n), J
        What they have given to each mode; without columns where it was not summed.
    leaving : ndarray (2 pairs,)
        See `motion.Search`.
    """

    state: Array
    touch: Array
    to_modes: Array
    leaving: Array


def held_by(initial: State, system: System, excitation: Excitation) -> Held | None:
    """Contacts of the run that ended at an initial state, where they go on.

    Another acceleration of the base jumps, and with it the force of a pair that sticks: whether it still does is
    found anew.
    """
    left = initial.left_by_run(system, excitation)
    if left is None or left.kind != KIND:
        return None
    held: Held = left.held
    if left.has_equations_of(system, excitation, initial.time):
        return held
    # where the time was set anew, touches are as long ago as they were
    touch = held.touch.copy()
    touch[BEGUN] += initial.time - left.time
    rigid = np.array([pair.parameters.kind == RIGID for pair in system.contacts], dtype=bool)
    return Held(np.where(rigid, FREE, held.state), touch, held.to_modes, np.zeros_like(held.leaving))


def resume_contacts(held: Held, cases: Cases) -> None:
    """Contacts in progress go on in a case alone."""
    cases.state[0], cases.touch[0], cases.leaving[0] = held.state, held.touch, held.leaving
    if held.to_modes.shape == cases.to_modes[0].shape:
        cases.to_modes[0] = held.to_modes
    else:
        # it was not summed before
        cases.to_modes[0, held.state != FREE] = np.nan
    cases.entering[0] = STARTED


def final_state(
    system: System, excitation: Excitation, cases: Cases, coordinates: Array, time: float
) -> State:  # fmt: skip
    """Where a case alone stands at a time (s) with its coordinates (2, d), and its contacts."""
    n = system.dofs
    held = Held(*(_copy(getattr(cases, name)[0]) for name in ("state", "touch", "to_modes", "leaving")))
    places, rates = ((_copy(row[:n]), _copy(row[n:])) for row in coordinates)
    left = Continuation(KIND, held, places, rates, time, system, excitation, touching(held, system))
    return State(places[0], rates[0], places[1], rates[1], time=time, continuation=left)


def touching(held: Held | None, system: System) -> tuple[str, ...]:
    """Names of the contacts in progress."""
    states = np.zeros(0) if held is None else held.state
    return tuple(pair.name for pair, state in zip(system.contacts, states, strict=False) if state != FREE)


def _copy(array: Array) -> Array:
    copy = np.array(array)
    copy.setflags(write=False)
    return copy
