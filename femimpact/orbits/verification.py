"""From a solution of the equations to an orbit: its multipliers, its symmetry, and its own event-driven run."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError, made
from femimpact.excitation import PointForce, Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.loop_data import FREE
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import IMPACT, SECTION, SEPARATE, TOUCH, EventStates, Sequence, product, state_unit
from femimpact.orbits.flow import HybridSystem
from femimpact.orbits.guess import recorder_of_events
from femimpact.orbits.newton import Solution
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
from femimpact.orbits.period import intervals_between, state_of
from femimpact.response.impacts import EventLog, Impacts
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.units import number_text

R = TypeVar("R")

VERIFIED = 1e-10
"""Largest miss of an orbit's own run after one period, times the largest multiplier where that is above 1."""

SYMMETRIC = 1e-8
"""Largest difference between an orbit and minus itself half a period later, in its units, of a symmetric one."""

SAME_PHASE = 1e-5
"""Difference of phases (rad) up to which an event of a run is that of its orbit."""

AT_START = 1e-12
"""Share of the period up to which an event before or after t = 0 is taken to be there."""


@dataclass(frozen=True, eq=False)
class OwnRun:
    """What the event-driven run of an orbit over one period leaves. It begins between two events."""

    log: EventLog
    phases: Array  # (events,) rad: of the drive at them
    first: int  # event of the orbit that it is to meet first
    missed: float  # by which it misses its start, in units; infinite where its events did not end


def verified(system: System, excitation: Sine | PointForce, solution: Solution) -> PeriodicOrbit:
    """The orbit of a solution of the equations.

    Raises `DivergenceError` if its own run meets other events, or does not end where it began.
    """
    run, impacts = own_run(system, excitation, solution)
    check_events(run, solution.events.sequence)
    orbit = orbit_of(system, excitation, solution, run, impacts)
    check_missed(run, solution.events, float(np.abs(orbit.multipliers[0])))
    return orbit


def check_missed(run: OwnRun, events: EventStates, growth: float) -> None:
    """Refuse an orbit whose own run misses its start after one period."""
    allowed = VERIFIED * max(1.0, growth)
    if run.missed <= allowed:
        return
    k, off = first_other(run, events), ""
    if k is not None and k < len(run.log):
        later = run.phases[k] - _expected_phases(run, events)[k]
        words = f"event {k + 1} of it, {_words(run.log, k)}, is {number_text(abs(later), 2)} rad of the excitation"
        off = f"; {words} {'later' if later > 0.0 else 'sooner'} than that of the orbit"
    raise DivergenceError(
        f"the orbit found is not confirmed: its own run misses its start by {number_text(run.missed, 2)} after one "
        "period (in "
        f"units of its length and of that times omega), above {number_text(allowed, 2)}{off}"
    )


def orbit_of(
    system: System, excitation: Sine | PointForce, solution: Solution, run: OwnRun, impacts: Impacts
) -> PeriodicOrbit:
    """The orbit of a solution, and of its own run with the impacts of that."""
    cycles = solution.events.sequence.cycles
    times = _times(solution.events.phases, excitation, cycles)
    order = _in_time(times)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # an event without speed has no finite saltation
        state, contact_state, monodromy = _at_start(excitation, solution, times, int(order[0]))
        half_map = _half_map(solution, int(order[0]))
    log = _log(system, solution, times, order)
    return _made(
        PeriodicOrbit,
        system=system,
        excitation=excitation,
        cycles=cycles,
        state=state_of(system, state, 0.0),
        events=log,
        contact_state=contact_state.astype(np.int8),
        impacts=_impacts(system, excitation, solution, run, impacts, log),
        monodromy=monodromy,
        half_map=half_map,
        residual=run.missed,
        length=solution.length,
    )


def _times(phases: Array, excitation: Sine | PointForce, cycles: int) -> Array:
    """Times (N,) of events within one period from t = 0 on, s."""
    period = cycles / excitation.frequency
    times = np.mod((phases - excitation.phase) / (2.0 * math.pi * excitation.frequency), period)
    near = np.minimum(times, period - times) <= AT_START * period
    return np.where(near, 0.0, times)


def _in_time(times: Array) -> NDArray[np.intp]:
    """Events from t = 0 on, those at one instant to rounding as they follow one another."""
    first = int(np.argmax(np.roll(times, 1) - times))
    return np.roll(np.arange(times.size), -first)


def _at_start(drive: Sine | PointForce, solution: Solution, times: Array, first: int) -> tuple[Array, Array, Array]:
    """State (2d,) and contact states at t = 0, before the first event or after it, and the monodromy there."""
    events, maps, hybrid = solution.events, solution.maps, solution.maps.hybrid
    sequence, later = events.sequence, np.roll(maps.steps, -1 - first, axis=0)
    if times[first] == 0.0:
        return events.states[first], sequence.contact_state[first], product(later)
    contact_state = sequence.contact_state[first - 1]
    flow, phase = hybrid.flow(contact_state), np.array([events.phases[first]])
    now = phase - times[first] * hybrid.omega
    before = now - (sequence.cycles / drive.frequency - times[first - 1]) * hybrid.omega
    (state,), (onto,) = flow.carried(events.states[first - 1][None], before, now)
    _, (up_to,) = flow.carried(state[None], now, phase)
    return state, contact_state, onto @ product(later[:-1]) @ maps.saltation[first] @ up_to


def _half_map(solution: Solution, first: int) -> Array | None:
    """Minus the derivative of the state half a period later by that after the first event, of a symmetric orbit."""
    hybrid, sequence = solution.maps.hybrid, solution.events.sequence
    unit = state_unit(solution.length, hybrid.omega, hybrid.mass.size)
    if not may_be_symmetric(hybrid, sequence) or asymmetry(solution.events, unit) > SYMMETRIC:
        return None
    return -product(np.roll(solution.maps.steps, -1 - first, axis=0)[: len(sequence.kind) // 2])


def may_be_symmetric(hybrid: HybridSystem, sequence: Sequence) -> bool:
    """Whether both sides of what is met are equal, and the events half a period later are those of the other side."""
    gaps = hybrid.gaps[np.unique(sequence.pair[sequence.pair >= 0])]
    equal = np.allclose(gaps[:, 0], gaps[:, 1], rtol=1e-12, atol=0.0) and not np.any(hybrid.constant)
    return sequence.cycles % 2 == 1 and equal and halves_agree(sequence, -1.0)


def halves_agree(sequence: Sequence, sign: float) -> bool:
    """Whether the events of the second half of a period are those of the first, on the same side or on the other."""
    half, odd = divmod(len(sequence.kind), 2)
    if odd or sequence.kind[:half] != sequence.kind[half:]:
        return False
    one_side = sequence.pair, sign * sequence.side, sign * sequence.contact_state
    other = sequence.pair, sequence.side, sequence.contact_state
    return all(np.array_equal(here[:half], there[half:]) for here, there in zip(one_side, other, strict=True))


def asymmetry(events: EventStates, unit: Array) -> float:
    """Largest difference between an orbit that may be symmetric and minus itself half a period later, in its units."""
    states, phases, half = events.states, events.phases, len(events.phases) // 2
    apart = np.abs(states[:half] + states[half:]) / unit
    turned = np.abs(phases[half:] - phases[:half] - math.pi * events.sequence.cycles)
    return float(max(apart.max(), turned.max()))


def own_run(
    system: System, excitation: Sine | PointForce, solution: Solution, pair: int | None = None
) -> tuple[OwnRun, Impacts]:
    """The run of an orbit from where nothing, or a pair, is in contact if it ever is not, and its impacts."""
    sequence, hybrid = solution.events.sequence, solution.maps.hybrid
    between = intervals_between(hybrid, solution.events)
    state, middle, first = between.start(pair)
    time = float(_times(np.array([middle]), excitation, sequence.cycles)[0])
    period, start = sequence.cycles / excitation.frequency, state_of(system, state, time)
    try:
        run = integrate(system, excitation, EventDriven(), period, recorder_of_events(sequence.cycles), start)
    except InputError as error:
        if not all(fault.key.endswith(".gap") for fault in error.faults):
            raise DivergenceError(f"the orbit found is not confirmed: {error}") from None
        # that none of the events is at
        name, place = error.faults[0].key.split(".")[1], error.faults[0].value
        where = f"between two events {name} is at {place:.6g} m, beyond a wall"
        raise OtherMotionError(f"the orbit found is no motion of the system: {where}") from None
    log, end = cast(EventLog, run.events), cast(State, run.final_state)
    unit = state_unit(solution.length, hybrid.omega, hybrid.mass.size)
    phases = middle + hybrid.omega * (log.time - time)
    return OwnRun(log, phases, first, float(np.max(np.abs(state_vector(end) - state) / unit))), run.impacts


def first_other(run: OwnRun, events: EventStates) -> int | None:
    """Row of the log of a run with the first event that its orbit has not, or has at another phase.

    It is the number of rows where the first one is missing, and None where there is none.
    """
    expected, other = _expected_phases(run, events), _other_event(run, events.sequence)
    count = min(run.phases.size, expected.size)
    late = np.flatnonzero(np.abs(run.phases[:count] - expected[:count]) > SAME_PHASE)
    return min([*late[:1].tolist(), *([] if other is None else [other])], default=None)


def _other_event(run: OwnRun, sequence: Sequence) -> int | None:
    """Row of the log of a run at which it has another event than its orbit has; None where it has not."""
    log = run.log
    met, expected = list(zip(log.kind, log.pair, log.side, strict=True)), _expected(sequence, run.first)
    equal = [one == other for one, other in zip(met, expected, strict=False)]
    return None if all(equal) and len(met) == len(expected) else [*equal, False].index(False)


def _expected(sequence: Sequence, first: int) -> list[Any]:
    """Events of an orbit from one on; sections are none."""
    rows = list(zip(sequence.kind, sequence.pair, sequence.side, strict=True))
    return [row for row in [*rows[first:], *rows[:first]] if row[0] != SECTION]


def _expected_phases(run: OwnRun, events: EventStates) -> Array:
    """Phases of the events that a run is to meet."""
    phases = np.where(np.arange(events.phases.size) < run.first, events.phases + events.sequence.turn, events.phases)
    rows = np.flatnonzero(np.array(events.sequence.kind) != SECTION)
    return phases[np.roll(rows, -np.searchsorted(rows, run.first))]


def _words(log: EventLog, row: int) -> str:
    """Kind, pair, side and time of an event."""
    side = "+" if log.side[row] > 0 else "-"
    return f"{log.kind[row]} of {log.contacts[log.pair[row]]} on its {side} side at t = {log.time[row]:.6g} s"


class OtherMotionError(DivergenceError):
    """A solution of the equations that is no motion of the system: it meets other events, or is beyond a wall."""


def check_events(run: OwnRun, sequence: Sequence) -> None:
    """Refuse an orbit of which the own run meets other events."""
    i, log = _other_event(run, sequence), run.log
    if i is None:
        return
    if i < len(log) and log.impacts[i] > 1:
        met = f"impacts of {log.impacts[i]} pairs at one instant, t = {log.time[i]:.6g} s"
        raise OtherMotionError(f"the orbit found has {met}: such orbits are not looked for")
    met, count = _words(log, i) if i < len(log) else "nothing more", len(_expected(sequence, run.first))
    raise OtherMotionError(
        f"the orbit found is no motion of the system: after {i} of its {count} events its own run meets {met}; "
        "start nearer to an orbit with the contacts of that run"
    )


def _log(system: System, solution: Solution, times: Array, order: NDArray[np.intp]) -> EventLog:
    """The events of one period from t = 0 on; sections are none."""
    sequence = solution.events.sequence
    order = order[[sequence.kind[k] != SECTION for k in order]]
    kind, d = np.array(sequence.kind)[order], solution.events.states.shape[1] // 2
    return _made(
        EventLog,
        time=np.maximum.accumulate(times[order]),
        kind=kind,
        pair=sequence.pair[order],
        side=sequence.side[order].astype(np.int64),
        impacts=np.isin(kind, (IMPACT, SEPARATE)).astype(np.int64),
        contact_state=sequence.contact_state[order].astype(np.int8),
        displacement=solution.events.states[order, :d],
        velocity=solution.events.states[order, d:],
        contacts=tuple(pair.name for pair in system.contacts),
    )


def _impacts(
    system: System, excitation: Sine | PointForce, solution: Solution, run: OwnRun, table: Impacts, log: EventLog
) -> Impacts:
    """The impacts of one period at the times of their events, from the table of its own run.

    Where that begins within a contact, it cuts it: such a pair has its impacts from a run that begins where it is free.
    """
    names, touches = np.array(log.contacts), np.flatnonzero(np.isin(log.kind, (IMPACT, TOUCH)))
    held = np.flatnonzero(solution.events.sequence.contact_state[run.first - 1] != FREE)
    parts = [_rows_of(table, ~np.isin(table.impactor, names[held]))]
    for j in np.intersect1d(held, log.pair[touches]).tolist():
        run_of_pair = own_run(system, excitation, solution, j)[1]
        parts.append(_rows_of(run_of_pair, run_of_pair.impactor == names[j]))
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    period, omega = solution.events.sequence.cycles / excitation.frequency, float(solution.maps.hybrid.omega)
    columns["time"], place = np.mod(columns["time"], period), np.full(len(columns["time"]), len(log))
    for i, (time, name, side) in enumerate(zip(*(columns[one] for one in ("time", "impactor", "side")), strict=True)):
        own = touches[(names[log.pair[touches]] == name) & (log.side[touches] == side)]
        apart = np.abs(np.mod(log.time[own] - time + 0.5 * period, period) - 0.5 * period)
        if own.size and omega * apart.min() <= SAME_PHASE:
            # of an event at t = 0 the run's own time may be just before the end of the period
            place[i] = own[np.argmin(apart)]
            columns["time"][i] = log.time[place[i]]
    columns["phase"] = np.mod(omega * columns["time"] + excitation.phase, 2.0 * math.pi)
    order = np.lexsort((place, columns["time"]))
    sorted_columns = {name: column[order] for name, column in columns.items()}
    return _made(Impacts, law=table.law, dropped=table.dropped, **sorted_columns)


def _rows_of(table: Impacts, rows: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
    """Columns of some rows of a table."""
    return {item.name: getattr(table, item.name)[rows] for item in fields(table) if "axes" in item.metadata}


def _made(record: type[R], /, **values: Any) -> R:
    """A record whose arrays are only read: what is derived from them is kept."""
    for value in values.values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return made(record, **values)
