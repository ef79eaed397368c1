"""From a solution of the equations to an orbit: its multipliers, its symmetry, and its own event-driven run."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError, changed, made
from femimpact.excitation import PointForce, Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import IMPACT, SECTION, SEPARATE, Sequence, known_flow, product, state_unit
from femimpact.orbits.flow import HybridSystem
from femimpact.orbits.guess import recorder_of_events
from femimpact.orbits.newton import Solution
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
from femimpact.orbits.period import intervals_between, state_of
from femimpact.response.impacts import EventLog, Impacts
from femimpact.response.response import Response
from femimpact.system.state import State
from femimpact.system.system import System

VERIFIED = 1e-10
"""Largest miss of an orbit's own run after one period, times the largest multiplier where that is above 1."""

SYMMETRIC = 1e-8
"""Largest difference between an orbit and minus itself half a period later, in its units, of a symmetric one."""

AT_START = 1e-12
"""Share of the period up to which an event before or after t = 0 is taken to be there."""


def verified(system: System, excitation: Sine | PointForce, found: Solution) -> PeriodicOrbit:
    """The orbit of a solution of the equations.

    Raises `DivergenceError` if its own run meets other events, or does not end where it began.
    """
    run, missed, first = own_run(system, excitation, found)
    check_events(run.events, found.sequence, first)
    orbit = orbit_of(system, excitation, found, run, missed)
    check_missed(missed, float(np.abs(orbit.multipliers[0])))
    return orbit


def check_missed(missed: float, growth: float) -> None:
    """Refuse an orbit whose own run misses its start after one period."""
    allowed = VERIFIED * max(1.0, growth)
    if not missed <= allowed:
        raise DivergenceError(
            f"the orbit found is not confirmed: its own run misses its start by {missed:.2g} after one period (in "
            f"units of its length and of that times omega), above {allowed:.2g}"
        )


def orbit_of(
    system: System, excitation: Sine | PointForce, found: Solution, run: Response, missed: float
) -> PeriodicOrbit:
    """The orbit of a solution and its own run."""
    cycles, times = found.sequence.cycles, _times(found.phases, excitation, found.sequence.cycles)
    order = _in_time(times)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # an event without speed has no finite saltation
        state, contact_state, monodromy = _at_start(excitation, found, times, int(order[0]))
        half_map = _half_map(found, int(order[0]))
    return made(
        PeriodicOrbit,
        system=system,
        excitation=excitation,
        cycles=cycles,
        state=state_of(system, state, 0.0),
        events=_log(system, found, times, order),
        contact_state=contact_state.astype(np.int8),
        impacts=_impacts(run, cycles / excitation.frequency),
        monodromy=monodromy,
        half_map=half_map,
        residual=missed,
        length=found.length,
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


def _at_start(excitation: Sine | PointForce, found: Solution, times: Array, first: int) -> tuple[Array, Array, Array]:
    """State (2d,) and contact states at t = 0, before the first event or after it, and the monodromy there."""
    sequence, later, hybrid = found.sequence, np.roll(found.maps.steps, -1 - first, axis=0), found.maps.hybrid
    if times[first] == 0.0:
        return found.states[first], sequence.contact_state[first], product(later)
    contact_state = sequence.contact_state[first - 1]
    flow, phase = known_flow(hybrid, contact_state, found.flows), np.array([found.phases[first]])
    now = phase - times[first] * hybrid.omega
    before = now - (sequence.cycles / excitation.frequency - times[first - 1]) * hybrid.omega
    (state,), (onto,) = flow.carried(found.states[first - 1][None], before, now)
    _, (up_to,) = flow.carried(state[None], now, phase)
    return state, contact_state, onto @ product(later[:-1]) @ found.maps.saltation[first] @ up_to


def _half_map(found: Solution, first: int) -> Array | None:
    """Minus the derivative of the state half a period later by that after the first event, of a symmetric orbit."""
    hybrid, sequence = found.maps.hybrid, found.sequence
    unit = state_unit(found.length, hybrid.omega, hybrid.mass.size)
    if not may_be_symmetric(hybrid, sequence) or asymmetry(sequence, found.states, found.phases, unit) > SYMMETRIC:
        return None
    return -product(np.roll(found.maps.steps, -1 - first, axis=0)[: len(sequence.kind) // 2])


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


def asymmetry(sequence: Sequence, states: Array, phases: Array, unit: Array) -> float:
    """Largest difference between an orbit that may be symmetric and minus itself half a period later, in its units."""
    half = len(phases) // 2
    apart = np.abs(states[:half] + states[half:]) / unit
    turned = np.abs(phases[half:] - phases[:half] - math.pi * sequence.cycles)
    return float(max(apart.max(), turned.max()))


def own_run(system: System, excitation: Sine | PointForce, found: Solution) -> tuple[Response, float, int]:
    """A run over one period, by how much it misses its start, and the event that it meets first."""
    sequence, hybrid = found.sequence, found.maps.hybrid
    between = intervals_between(hybrid, sequence, found.states, found.phases, found.flows)
    state, middle, first = between.start()
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
    end, unit = cast(State, run.final_state), state_unit(found.length, hybrid.omega, hybrid.mass.size)
    return run, float(np.max(np.abs(state_vector(end) - state) / unit)), first


def other_event(log: EventLog, sequence: Sequence, first: int) -> int | None:
    """Row of a log at which it has another event than an orbit has from its event `first` on; None where it has not."""
    met, expected = list(zip(log.kind, log.pair, log.side, strict=True)), _expected(sequence, first)
    equal = [one == other for one, other in zip(met, expected, strict=False)]
    return None if all(equal) and len(met) == len(expected) else [*equal, False].index(False)


def _expected(sequence: Sequence, first: int) -> list[Any]:
    """Events of an orbit from one on; sections are none."""
    rows = list(zip(sequence.kind, sequence.pair, sequence.side, strict=True))
    return [row for row in [*rows[first:], *rows[:first]] if row[0] != SECTION]


class OtherMotionError(DivergenceError):
    """A solution of the equations that is no motion of the system: it meets other events, or is beyond a wall."""


def check_events(log: Any, sequence: Sequence, first: int) -> None:
    """Refuse an orbit of which the own run, with its log from event `first` on, meets other events."""
    i = other_event(log, sequence, first)
    if i is None:
        return
    met, count = "nothing more", len(_expected(sequence, first))
    if i < len(log) and log.impacts[i] > 1:
        met = f"impacts of {log.impacts[i]} pairs at one instant, t = {log.time[i]:.6g} s"
        raise OtherMotionError(f"the orbit found has {met}: such orbits are not looked for")
    if i < len(log):
        side = "+" if log.side[i] > 0 else "-"
        met = f"{log.kind[i]} of {log.contacts[log.pair[i]]} on its {side} side at t = {log.time[i]:.6g} s"
    raise OtherMotionError(
        f"the orbit found is no motion of the system: after {i} of its {count} events its own run meets {met}; "
        "start nearer to an orbit with the contacts of that run"
    )


def _log(system: System, found: Solution, times: Array, order: NDArray[np.intp]) -> EventLog:
    """The events of one period from t = 0 on; sections are none."""
    sequence = found.sequence
    order = order[[sequence.kind[k] != SECTION for k in order]]
    kind, d = np.array(sequence.kind)[order], found.states.shape[1] // 2
    return made(
        EventLog,
        time=np.maximum.accumulate(times[order]),
        kind=kind,
        pair=sequence.pair[order],
        side=sequence.side[order].astype(np.int64),
        impacts=np.isin(kind, (IMPACT, SEPARATE)).astype(np.int64),
        contact_state=sequence.contact_state[order].astype(np.int8),
        displacement=found.states[order, :d],
        velocity=found.states[order, d:],
        contacts=tuple(pair.name for pair in system.contacts),
    )


def _impacts(run: Response, period: float) -> Impacts:
    """The table of impacts of one period, by their times within it."""
    table = run.impacts
    time = np.mod(table.time, period)
    order = np.argsort(time, kind="stable")
    names = [item.name for item in fields(table) if "axes" in item.metadata]
    columns = {name: (time if name == "time" else getattr(table, name))[order] for name in names}
    return changed(table, **columns)
