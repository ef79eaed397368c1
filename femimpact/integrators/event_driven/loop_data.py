"""Input of a run: systems that are taken, instants that are read, contact states, and what an earlier run has left.

Its arrays are the named tuples `core.events`, beside which are the names of their rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from femimpact import core
from femimpact.arrays import Array, Complex
from femimpact.contact.laws import KELVIN_VOIGT, RIGID
from femimpact.errors import require
from femimpact.excitation.chirp import Chirp
from femimpact.excitation.drives import parts_in
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine, SteppedSine
from femimpact.integrators.channel_rows import drive_of
from femimpact.response.response import Recorder
from femimpact.system.state import State
from femimpact.system.system import System

FREE, CONTACT, SEPARATING = range(3)
"""Contact states of a pair; the last two times the side of the wall. A rigid pair in contact sticks."""

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
    """Refuse what the method cannot compute exactly, and say what does."""
    allowed = "must be on its normal modes for EventDriven: use reduce(system, modes=n)"
    require(system.is_diagonal, "system", f"{system.dofs} coupled dofs", "", allowed)
    allowed = f"must be at most {MOST_PAIRS} contacts for EventDriven; Newmark takes any number"
    require(len(system.contacts) <= MOST_PAIRS, "system", f"{len(system.contacts)} contacts", "", allowed)
    for pair in system.contacts:
        allowed = "must be Rigid or KelvinVoigt for EventDriven; other laws are for Newmark and its family"
        require(pair.parameters.kind in (RIGID, KELVIN_VOIGT), f"{pair.name}.contact", pair.law.name, "", allowed)
        clear = sum(pair.gaps) > 0.0
        require(clear, f"{pair.name}.gap", sum(pair.gaps), "m", "must leave some clearance between both walls")


SAMPLES_OF_A_PERIOD = 20
"""Readings in a period of the highest kept mode, under a drive by samples."""

MOST_SAMPLES = 1_000_000
"""Readings of a run under a drive by samples, where no interval is given."""

LEAST_SAMPLES = 8
"""Readings in a base cycle, of which its rms and harmonic are taken."""

WHOLE = 1e-9
"""Share of itself by which rounding may put a number of samples off an integer."""


@dataclass(frozen=True)
class ReadingGrid:
    """Instants at which a run is read."""

    interval: float  # s
    # samples in what counts as a base cycle: those of a period of a sine, which need not be an integer; under a
    # drive by samples `LEAST_SAMPLES` or more
    per_cycle: float
    follows_cycles: bool = False  # whether there are `EventSettings.samples_per_cycle` in each
    chosen: tuple[str, ...] = ()  # a note on how the interval was chosen where the drive is given by samples
    origin: float = 0.0  # s: time of sample 0
    first: int = 0  # sample at which the run begins

    def time(self, number: ArrayLike) -> Array:
        """Times (s) of samples counted from the beginning of the run."""
        return np.asarray(self.origin + self.interval * (self.first + np.asarray(number)))


def reading_grid(
    system: System,  # on its modes
    excitation: Excitation,
    method: EventSettings,
    duration: float,  # s
    recorder: Recorder,
) -> ReadingGrid:
    """The instants at which a run is read: as the recorder has them, or as they suit the drive.

    Without an interval of the recorder there are `samples_per_cycle` in a cycle of a sine, and in the shortest cycle of
    a chirp, a stepped sine, and sums of these and sines. Another drive by samples is read at their interval, or at 1/20
    of the period of the highest kept mode if that is less. There are no more than 10^6 instants.
    """
    drive, chosen = drive_of(system, excitation), tuple[str, ...]()
    if not drive.in_pieces and recorder.interval is None:
        samples = method.samples_per_cycle
        return ReadingGrid((2.0 * math.pi / drive.omega) / samples, float(samples), follows_cycles=True)
    longest = 1.0 / (LEAST_SAMPLES * excitation.frequency)
    if recorder.interval is not None:
        interval = recorder.interval
        allowed = f"must be <= {longest:.4g} s, {LEAST_SAMPLES} readings in a cycle; Recorder.every keeps fewer of them"
        resolved = drive.in_pieces or interval <= longest * (1.0 + WHOLE)
        require(resolved, "record.interval", interval, "s", allowed)
    elif all(isinstance(part, Sine | Chirp | SteppedSine) for part in parts_in(excitation)):
        finest = 1.0 / (method.samples_per_cycle * excitation.frequency)
        reason = f"1/{method.samples_per_cycle} of the shortest cycle of the drive, {excitation.frequency:.4g} Hz"
        interval, chosen = _at_most(finest, reason, duration)
    elif drive.line is not None:
        interval, chosen = _suited(system, drive.line.interval, "the interval of the samples that drive it", duration)
    elif drive.pieces is not None:
        knots = drive.pieces.knots
        mean = float(knots[-1] - knots[0]) / (knots.size - 1)
        interval, chosen = _suited(system, mean, "the mean length of the polynomials that drive it", duration)
    per_cycle = 1.0 / (excitation.frequency * interval)
    if abs(per_cycle - round(per_cycle)) <= WHOLE * per_cycle:
        per_cycle = float(round(per_cycle))
    # the largest line of a record may lie near its last one
    return ReadingGrid(interval, max(per_cycle, float(LEAST_SAMPLES)), chosen=chosen)


def _suited(system: System, between: float, reason: str, duration: float) -> tuple[float, tuple[str, ...]]:
    """Interval (s) that suits a drive with a time between its samples or knots (s), and a note that says so."""
    highest = math.sqrt(float(np.max(system.K.diagonal() / system.M.diagonal()))) / (2.0 * math.pi)
    period = 1.0 / highest if highest > 0.0 else math.inf
    finest = between
    if period / SAMPLES_OF_A_PERIOD < between:
        finest = period / SAMPLES_OF_A_PERIOD
        reason = f"1/{SAMPLES_OF_A_PERIOD} of the period of the highest kept mode, {highest:.4g} Hz"
    return _at_most(finest, reason, duration)


def _at_most(finest: float, reason: str, duration: float) -> tuple[float, tuple[str, ...]]:
    """An interval (s), or a longer one where a run of a duration (s) would have too many readings; and a note."""
    interval = finest
    # the state at the start is one of them
    if duration > (MOST_SAMPLES - 1) * finest:
        interval = duration / (MOST_SAMPLES - 1)
        reason = f"so that there are no more than {MOST_SAMPLES:,} readings; {finest:.4g} s would be {reason}"
    return interval, (
        f"read every {interval:.4g} s, {reason}; Recorder(interval=) sets another one, and largest(channel) of the "
        "response finds what lies between",
    )


KIND = "events"
"""All event-driven runs go on from one another: nothing that is held depends on the settings."""


@dataclass(frozen=True, eq=False)
class Held:
    """State of a run of one case where it ended."""

    grid: ReadingGrid  # of the run, from its end on
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


def grid_from(held: Held | None, time: float, grid: ReadingGrid) -> ReadingGrid:
    """The instants of the earlier run where to the last bit they are among the new ones, else those from a time (s)."""
    if held is not None and held.motion:
        before = held.grid
        first = round(before.first * before.interval / grid.interval)
        going_on = replace(grid, origin=before.origin, first=first)
        if going_on.time(0) == before.time(0):
            return going_on
    return replace(grid, origin=time)


def contacts_in_progress(held: Held | None, system: System) -> tuple[str, ...]:
    """Names of the contacts in progress."""
    states = np.zeros(0) if held is None else held.state
    return tuple(pair.name for pair, state in zip(system.contacts, states, strict=False) if state != FREE)
