"""An event-driven run that goes on from where another one ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact import core
from femimpact.arrays import Array, Complex
from femimpact.contact.laws import RIGID
from femimpact.excitation import Excitation
from femimpact.integrators.event_driven.closed_form import steady_entries
from femimpact.integrators.event_driven.loop_data import FREE
from femimpact.system.state import Continuation, State
from femimpact.system.system import System

Number = TypeVar("Number", np.float64, np.complex128)

KIND = "events"
"""All event-driven runs go on from one another: nothing that is held depends on the settings."""


@dataclass(frozen=True)
class Sampling:
    """Instants at which a run is read."""

    origin: float  # s: time of sample 0
    interval: float  # s
    first: int = 0  # sample at which the run begins

    def time(self, number: ArrayLike) -> Array:
        """Times (s) of samples counted from the beginning of the run."""
        return np.asarray(self.origin + self.interval * (self.first + np.asarray(number)))


@dataclass(frozen=True, eq=False)
class Held:
    """State of a run of one case where it ended."""

    sampling: Sampling  # of the run, from its end on
    # arrays of `core.events.Cases` by their names, in the closed form of the contact states; none where only the
    # contacts go on
    motion: Mapping[str, Array | Complex]
    driven: int  # entries that hold all of their response to polynomials; see `closed_form.driven_entries`
    state: Array  # (pairs,) contact states
    touch: Array  # (6, pairs) what those in progress have added up to; see `core.events.BEGUN`
    to_modes: Array  # (pairs, n) J: what they have given to each mode; without columns where it was not summed
    leaving: Array  # (2 pairs,) see `core.events.Search`


def held_by(initial: State, system: System, excitation: Excitation) -> Held | None:
    """The state of the run that ended at an initial state, as far as it goes on; None where none does.

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
    touch[core.events.BEGUN] += initial.time - left.time
    rigid = np.array([pair.parameters.kind == RIGID for pair in system.contacts], dtype=bool)
    state = np.where(rigid, FREE, held.state)
    return replace(held, motion={}, state=state, touch=touch, leaving=np.zeros_like(held.leaving))


def sampling_from(held: Held | None, time: float, interval: float) -> Sampling:
    """That of the earlier run where to the last bit its instants are among the new ones, else one from a time (s)."""
    if held is not None and held.motion:
        before = held.sampling
        going_on = Sampling(before.origin, interval, round(before.first * before.interval / interval))
        if going_on.time(0) == before.time(0):
            return going_on
    return Sampling(time, interval)


def resumed(held: Held, cases: core.events.Cases) -> core.events.Cases:
    """A case alone that goes on with its contacts in progress, and with the motion where that is held."""
    cases.state[0], cases.touch[0], cases.leaving[0] = held.state, held.touch, held.leaving
    if held.to_modes.shape == cases.to_modes[0].shape:
        cases.to_modes[0] = held.to_modes
    else:
        # it was not summed before
        cases.to_modes[0, held.state != FREE] = np.nan
    cases.entering[0] = core.events.RESUMED if held.motion else core.events.STARTED
    motion: dict[str, Any] = {name: values[None].copy() for name, values in held.motion.items()}
    if motion and cases.knots.size:
        # the earlier run may have begun before the first knot, and had one piece more
        now = np.searchsorted(cases.knots, motion["clock"][0, 0], side="right") - 1
        motion["piece"] = np.array([max(now, 0)], dtype=np.int64)
    return cases._replace(**motion)


def split_anew(held: Held, cases: core.events.Cases, forms: core.events.Forms, form: int) -> None:
    """Give entries of a case alone the share of their response that they hold in this run.

    The polynomials of a longer run may be faster, or slower beside a larger force, so that other entries are driven.
    """
    now, last = int(forms.driven[form]), int(forms.entries[form])
    first, end = min(now, held.driven), max(now, held.driven)
    if not held.motion or first == end:
        return
    rate = forms.coupling[form, :last, :last] + np.diag(forms.exponent[form, :last])
    steady = steady_entries(rate, forms.load[form, :, :last], first, end)
    steady = cases.drive[0] @ steady.reshape(cases.drive.shape[1], -1)
    cases.entry[0, first:end] += steady if now > held.driven else -steady


def final_state(
    system: System, excitation: Excitation, cases: core.events.Cases, forms: core.events.Forms, coordinates: Array,
    sampling: Sampling,
) -> State:  # fmt: skip
    """Where a case alone stands at the beginning of a sampling, with its coordinates (2, d)."""
    n, f, time = system.dofs, cases.form[0, 1], float(sampling.time(0))
    motion = {
        "entry": cases.entry[0, : forms.entries[f]], "rigid_body": cases.rigid_body[0, :, : forms.rigid_bodies[f]],
        "clock": cases.clock[0], "drive": cases.drive[0],
    }  # fmt: skip
    contacts = (cases.state, cases.touch, cases.to_modes, cases.leaving)
    copies = {name: _copy(values) for name, values in motion.items()}
    held = Held(sampling, copies, int(forms.driven[f]), *(_copy(values[0]) for values in contacts))
    places, rates = ((_copy(row[:n]), _copy(row[n:])) for row in coordinates)
    left = Continuation(KIND, held, places, rates, time, system, excitation, contacts_in_progress(held, system))
    return State(places[0], rates[0], places[1], rates[1], time=time, continuation=left)


def contacts_in_progress(held: Held | None, system: System) -> tuple[str, ...]:
    """Names of the contacts in progress."""
    states = np.zeros(0) if held is None else held.state
    return tuple(pair.name for pair, state in zip(system.contacts, states, strict=False) if state != FREE)


def _copy(array: NDArray[Number]) -> NDArray[Number]:
    copy = np.array(array)
    copy.setflags(write=False)
    return copy
