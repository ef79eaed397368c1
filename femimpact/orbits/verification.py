"""From a solution of the equations to an orbit: its multipliers, its symmetry, and its own event-driven run."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError, changed, made
from femimpact.excitation import PointForce, Sine
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.loop_data import FREE
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import IMPACT, SECTION, SEPARATE, Sequence, known_flow
from femimpact.orbits.flow import Flow, HybridSystem
from femimpact.orbits.guess import recorder_of_events
from femimpact.orbits.newton import Solution
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
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


def verified(
    system: System, excitation: Sine | PointForce, hybrid: HybridSystem, sequence: Sequence, found: Solution,
    length: float, flows: dict[bytes, Flow],
) -> PeriodicOrbit:  # fmt: skip
    """The orbit of a solution of the equations.

    Raises `DivergenceError` if its own run meets other events, or does not end where it began.
    """
    unit = np.repeat([length, length * float(hybrid.omega)], hybrid.mass.size)
    times = _times(found.phases, excitation, sequence.cycles)
    order = np.argsort(times, kind="stable")
    steps = found.passed.saltation @ found.passed.propagator
    state, contact_state, monodromy = _at_start(hybrid, excitation, sequence, found, times, flows, steps)
    run, missed = _own_run(system, excitation, sequence, found, flows, unit)
    _check_events(run, sequence)
    growth = max(1.0, float(np.abs(np.linalg.eigvals(monodromy)).max()))
    if not missed <= VERIFIED * growth:
        raise DivergenceError(
            f"the orbit found is not confirmed: its own run misses its start by {missed:.2g} after one period (in gaps "
            f"and gaps times omega), above {VERIFIED * growth:.2g}"
        )
    return made(
        PeriodicOrbit,
        system=system,
        excitation=excitation,
        cycles=sequence.cycles,
        state=_state(system, state, 0.0),
        events=_log(system, sequence, found, times, order),
        contact_state=contact_state.astype(np.int8),
        impacts=_impacts(run, sequence.cycles / excitation.frequency),
        monodromy=monodromy,
        half_map=_half_map(hybrid, sequence, found, steps, unit, int(order[0])),
        residual=missed,
        length=length,
    )


def _times(phases: Array, excitation: Sine | PointForce, cycles: int) -> Array:
    """Times (N,) of events within one period from t = 0 on, s."""
    period = cycles / excitation.frequency
    times = np.mod((phases - excitation.phase) / (2.0 * math.pi * excitation.frequency), period)
    near = np.minimum(times, period - times) <= AT_START * period
    return np.where(near, 0.0, times)


def _product(steps: Array) -> Array:
    """Product of matrices, the first one applied first."""
    found = np.eye(steps.shape[1])
    for step in steps:
        found = step @ found
    return found


def _at_start(
    hybrid: HybridSystem, excitation: Sine | PointForce, sequence: Sequence, found: Solution, times: Array,
    flows: dict[bytes, Flow], steps: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """State (2d,) and contact states at t = 0, and the monodromy there."""
    first = int(np.argmin(times))
    later = np.roll(steps, -1 - first, axis=0)
    if times[first] == 0.0:
        return found.states[first], sequence.contact_state[first], _product(later)
    contact_state = sequence.contact_state[first - 1]
    flow, phase = known_flow(hybrid, contact_state, flows), np.array([found.phases[first]])
    now = phase - times[first] * hybrid.omega
    before = now - (sequence.cycles / excitation.frequency - times[first - 1]) * hybrid.omega
    (state,), (onto,) = flow.carried(found.states[first - 1][None], before, now)
    _, (up_to,) = flow.carried(state[None], now, phase)
    return state, contact_state, onto @ _product(later[:-1]) @ found.passed.saltation[first] @ up_to


def _half_map(
    hybrid: HybridSystem, sequence: Sequence, found: Solution, steps: Array, unit: Array, first: int
) -> Array | None:
    """Minus the derivative of the state half a period later by that after the first event, of a symmetric orbit."""
    half, odd = len(sequence.kind) // 2, len(sequence.kind) % 2
    alike = np.allclose(hybrid.gaps[:, 0], hybrid.gaps[:, 1], rtol=1e-12, atol=0.0) and not np.any(hybrid.constant)
    if odd or sequence.cycles % 2 == 0 or not alike:
        return None
    same = sequence.kind[:half] == sequence.kind[half:]
    same = same and np.array_equal(sequence.pair[:half], sequence.pair[half:])
    same = same and np.array_equal(sequence.side[:half], -sequence.side[half:])
    same = same and np.array_equal(sequence.contact_state[:half], -sequence.contact_state[half:])
    apart = np.abs(found.states[:half] + found.states[half:]) / unit
    turned = np.abs(found.phases[half:] - found.phases[:half] - math.pi * sequence.cycles)
    if not same or max(apart.max(), turned.max()) > SYMMETRIC:
        return None
    return -_product(np.roll(steps, -1 - first, axis=0)[:half])


def _state(system: System, state: Array, time: float) -> State:
    n, d = system.dofs, state.size // 2
    return State(state[:n], state[d : d + n], state[n:d], state[d + n :], time=time)


def _own_run(
    system: System, excitation: Sine | PointForce, sequence: Sequence, found: Solution, flows: dict[bytes, Flow],
    unit: Array,
) -> tuple[Response, float]:  # fmt: skip
    """A run over one period, and by how much it misses its start.

    It begins in the first period, in the middle of the longest interval between events, where nothing is in contact if
    there is such: so that no event falls on its ends.
    """
    hybrid, before = found.passed.hybrid, np.roll(sequence.contact_state, 1, axis=0)
    begun = np.roll(found.phases, 1)
    begun[0] -= 2.0 * math.pi * sequence.cycles
    free = ~np.any(before != FREE, axis=1)
    # of any length before one in contact
    k = int(np.argmax((found.phases - begun) * np.where(free, 1.0, 1e-6)))
    middle = 0.5 * (begun[[k]] + found.phases[[k]])
    (state,), _ = known_flow(hybrid, before[k], flows).carried(found.states[[k - 1]], begun[[k]], middle)
    time = float(_times(middle, excitation, sequence.cycles)[0])
    period = sequence.cycles / excitation.frequency
    try:
        run = integrate(system, excitation, EventDriven(), period, recorder_of_events(), _state(system, state, time))
    except InputError as error:
        # beyond a wall that none of the events is at
        raise DivergenceError(f"the orbit found is no motion of the system: {error}") from None
    end: Any = run.final_state
    return run, float(np.max(np.abs(state_vector(end) - state) / unit))


def _check_events(run: Response, sequence: Sequence) -> None:
    """Refuse an orbit of which the own run meets other events."""
    log: Any = run.events
    met = list(zip(log.kind.tolist(), log.pair.tolist(), log.side.tolist(), strict=True))
    of_orbit = zip(sequence.kind, sequence.pair.tolist(), sequence.side.tolist(), strict=True)
    rows = [row for row in of_orbit if row[0] != SECTION]
    # the run begins before one of them
    orders = [[*rows[k:], *rows[:k]] for k in range(max(len(rows), 1))]
    if met in orders:
        return
    equal = [[one == other for one, other in zip(met, order, strict=False)] for order in orders]
    i, first = max([*row, False].index(False) for row in equal), "nothing more"
    if i < len(met):
        kind, pair, side = met[i]
        name = run.system.contacts[pair].name
        first = f"{kind} of {name} on its {'+' if side > 0 else '-'} side at t = {log.time[i]:.6g} s"
    raise DivergenceError(
        f"the orbit found is no motion of the system: after {i} of its {len(rows)} events its own run meets {first}; "
        "start nearer to an orbit with the contacts of that run"
    )


def _log(system: System, sequence: Sequence, found: Solution, times: Array, order: NDArray[np.intp]) -> EventLog:
    """The events of one period from t = 0 on; sections are none."""
    order = order[[sequence.kind[k] != SECTION for k in order]]
    kind, d = np.array(sequence.kind)[order], found.states.shape[1] // 2
    return made(
        EventLog,
        time=times[order],
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
