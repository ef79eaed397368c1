"""The first guess of an orbit: events and states of one period, from a run that begins where the caller says."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, changed, kind_of, require
from femimpact.excitation import Excitation, PointForce, Sine, Sum
from femimpact.excitation.drives import alone
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.loop_data import CONTACT, FREE, SEPARATING
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import IMPACT, PRESS_AGAIN, RELEASE, SECTION, SEPARATE, TOUCH, EventStates, Sequence
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
from femimpact.response.impacts import EventLog
from femimpact.response.response import Recorder, Response
from femimpact.system.state import State, same_excitation
from femimpact.system.system import System

MOST_EVENTS = 1000
"""Events of one period of the drive beyond which a motion is taken for chatter."""

BEFORE = {IMPACT: FREE, TOUCH: FREE, RELEASE: CONTACT, PRESS_AGAIN: SEPARATING, SEPARATE: SEPARATING}
"""Contact state, without the side, of a pair before an event of each kind that an orbit may have."""

STICKS = "must lead to a motion without sticking: orbits that stick to a wall, or chatter, are not looked for"


def recorder_of_events(cycles: int) -> Recorder:
    """What a run keeps of which the events alone are read, over two periods of so many of the drive."""
    return Recorder(channels=(), ledger=False, impacts=cycles * MOST_EVENTS, events=2 * cycles * MOST_EVENTS)


def first_guess(
    system: System, excitation: Excitation, cycles: int, guess: Response | State | PeriodicOrbit
) -> EventStates:
    """Events and states of one period, which is so many of the excitation.

    Those of an orbit are its own. A state, or the end of a run, is followed over two periods. The first period is
    begun in the middle of its longest interval that leaves every contact as it begins.

    Raises `InputError` if there is none, or a ball touches nothing.
    """
    if isinstance(guess, PeriodicOrbit):
        return _of_orbit(system, guess, cycles)
    start = guess if isinstance(guess, State) else _end_of(guess, excitation)
    period, omega = cycles / excitation.frequency, 2.0 * math.pi * excitation.frequency
    try:
        run = integrate(system, excitation, EventDriven(), 2.0 * period, recorder_of_events(cycles), start)
    except InputError as error:
        renamed = [replace(fault, key=re.sub("^initial", "guess", fault.key)) for fault in error.faults]
        raise InputError(renamed) from None
    log: Any = run.events
    final: Any = run.final_state
    require(log.dropped == 0, "guess", f"{len(log) + log.dropped} events in two periods", "", STICKS)
    held = final.continuation.held.state.astype(log.contact_state.dtype)
    # what lies of each interval in the first period, so that a whole one follows its middle
    times, ends = np.append(start.time, log.time), np.append(log.time, math.inf)
    ends = np.minimum(ends, start.time + period)
    intervals = np.flatnonzero(times < ends)
    fault = "must nearly repeat: in one period its contacts do not end as they begin"
    for i in intervals[np.argsort((times - ends)[intervals], kind="stable")].tolist():
        begin = 0.5 * (times[i] + ends[i])
        rows = np.flatnonzero((log.time > begin) & (log.time <= begin + period))
        state = log.contact_state[rows[-1]] if rows.size else held
        if not _may_be_met(log, rows, state, system):
            fault = STICKS
        elif np.array_equal(_state_before(log, int(rows[0]) if rows.size else len(log), held), state):
            _check_rows(log, rows, state, system)
            if not rows.size:
                return without_events(state_vector(final), state, omega * final.time + excitation.phase, cycles)
            return _of_rows(log, rows, omega * log.time[rows] + excitation.phase, cycles)
    raise InputError([Fault("guess", None, "", fault)])


def without_events(state: Array, contact_state: NDArray[Any], phase: float, cycles: int) -> EventStates:
    """A guess of a motion that meets nothing, from its state (2d,) at a phase: two sections stand for events."""
    phases = np.mod(phase, 2.0 * math.pi) + math.pi * cycles * np.arange(2)
    states = np.tile(contact_state.astype(float), (2, 1))
    sequence = Sequence((SECTION,) * 2, np.full(2, -1), np.zeros(2), states, phases, cycles)
    return EventStates(sequence, np.tile(state, (2, 1)), phases)


def sine_of(excitation: Any) -> Sine | PointForce | None:
    """The drive of an excitation that is one sine, None of any other."""
    drive = alone(excitation)
    history = drive.history if isinstance(drive, PointForce) else drive
    while isinstance(history, Sum) and len(history.parts) == 1:
        history = history.parts[0]
    if not isinstance(history, Sine):
        return None
    return changed(drive, history=history) if isinstance(drive, PointForce) else history


def _end_of(run: Response, excitation: Excitation) -> State:
    """Where a run has ended, at a time when the excitation has the phase that its own has there."""
    require(
        run.final_state is not None, "guess", "Response", "", "must have a final_state: one read from files has none"
    )
    state = cast(State, run.final_state)
    if same_excitation(run.base, excitation):
        return state
    base = sine_of(run.base)
    allowed = "must be under one sine, at a phase of which it ends; of another run give final_state, at its time"
    require(base is not None, "guess", f"a run under {kind_of(run.base)}", "", allowed)
    base = cast("Sine | PointForce", base)
    phase = 2.0 * math.pi * base.frequency * state.time + base.phase
    turn = (phase - excitation.phase) % (2.0 * math.pi)
    return replace(state, time=turn / (2.0 * math.pi * excitation.frequency), continuation=None)


def _of_rows(log: EventLog, rows: NDArray[np.intp], phases: Array, cycles: int) -> EventStates:
    sequence = Sequence(
        tuple(log.kind[rows].tolist()), log.pair[rows], log.side[rows].astype(float),
        log.contact_state[rows].astype(float), np.zeros(rows.size), cycles,
    )  # fmt: skip
    states = np.concatenate([log.displacement[rows], log.velocity[rows]], axis=1)
    # by whole periods of the orbit: t = 0 is at the same of its `cycles`
    return EventStates(sequence, states, phases - sequence.turn * math.floor(phases[0] / sequence.turn))


def _of_orbit(system: System, orbit: PeriodicOrbit, cycles: int) -> EventStates:
    """That of an orbit, or of several periods of it."""
    times, left = divmod(cycles, orbit.cycles)
    require(left == 0, "guess.cycles", orbit.cycles, "", f"must divide the cycles of the orbit looked for, {cycles}")
    for j, side in set(zip(orbit.events.pair.tolist(), orbit.events.side.tolist(), strict=True)):
        pair, other = system.contacts[j], orbit.system.contacts[j]
        same = pair.parameters.is_rigid == other.parameters.is_rigid and math.isfinite(pair.gaps[0 if side > 0 else 1])
        allowed = "must be met at a wall of the same law: else give its state, guess=orbit.state"
        require(same, f"guess.{other.name}", f"{other.law.name} on the {'+' if side > 0 else '-'} side", "", allowed)
    omega, log = 2.0 * math.pi * orbit.excitation.frequency, orbit.events
    if len(log):
        rows = np.tile(np.arange(len(log)), times)
        later = np.repeat(np.arange(times) * orbit.period, len(log))
        return _of_rows(log, rows, omega * (log.time[rows] + later) + orbit.excitation.phase, cycles)
    return without_events(state_vector(orbit.state), orbit.contact_state, orbit.excitation.phase, cycles)


def _state_before(log: EventLog, row: int, at_end: NDArray[Any]) -> NDArray[Any]:
    """Contact states (pairs,) before an event: those that the next event of each pair begins from."""
    state = at_end.copy()
    for k in range(len(log) - 1, row - 1, -1):
        state[log.pair[k]] = BEFORE.get(str(log.kind[k]), CONTACT) * log.side[k]
    return state


def _may_be_met(log: EventLog, rows: NDArray[np.intp], state: NDArray[Any], system: System) -> bool:
    """Whether no pair of some events sticks."""
    rigid = np.array([pair.parameters.is_rigid for pair in system.contacts], dtype=bool)
    return not np.any(state[rigid]) and all(
        kind in BEFORE and not (kind == TOUCH and rigid[pair])
        for kind, pair in zip(log.kind[rows].tolist(), log.pair[rows].tolist(), strict=True)
    )


def _check_rows(log: EventLog, rows: NDArray[np.intp], state: NDArray[Any], system: System) -> None:
    """Refuse impacts of several pairs at one instant, and balls that touch nothing."""
    for k in rows[log.impacts[rows] > 1].tolist():
        allowed = "must be impacts of one pair at a time: orbits with impacts at one instant are not looked for"
        require(False, "guess", f"{log.impacts[k]} impacts at t = {log.time[k]:.6g} s", "", allowed)
    name, allowed = untouched_ball(system, log.pair[rows], state), "must touch a wall: else it may be anywhere"
    require(name is None, f"guess.{name}", "no contact in a period", "", allowed)


def untouched_ball(system: System, met: NDArray[Any], state: NDArray[Any]) -> str | None:
    """Name of a ball that touches nothing, from the pairs that have events and the contact states at one."""
    for j, pair in enumerate(system.balls):
        if pair.free_stiffness == 0.0 and state[j] == FREE and j not in met:
            return pair.name
    return None
