"""One period of an orbit: its own event-driven run, read from t = 0 on, and where it turns back before a wall."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import changed
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.loop_data import FREE
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import known_flow
from femimpact.orbits.flow import Flow, HybridSystem, hybrid_system
from femimpact.response.channels import Channel, resolve_channels
from femimpact.response.energy import EnergyLedger
from femimpact.response.response import Recorder, Response
from femimpact.response.signals import SteadyMotion, cycle_statistics, steady_motion
from femimpact.structure.structure import Position
from femimpact.system.state import State

if TYPE_CHECKING:
    from femimpact.orbits.orbit import PeriodicOrbit

SAMPLES = 1024
"""Least number of instants of a cycle at which an orbit is read."""

PROFILE = 16
"""Instants in a period of the fastest motion between which a body is seen to turn back."""

AT_ONCE = 1024
"""Instants at which the closed form is read at once: each takes a matrix."""

HELD = 1e-6
"""Share of its length that an interval in contact counts for, where a run looks for a start."""


@dataclass(frozen=True, eq=False)
class Intervals:
    """The motion between the events of one period; the last interval goes on to the first event of the next one."""

    hybrid: HybridSystem
    omega: float  # rad/s
    phase: float  # rad: of the excitation at t = 0
    begin: Array  # (K,) s
    end: Array  # (K,)
    states: Array  # (K, 2d) at their begin
    contact_state: NDArray[np.integer]  # (K, pairs)
    flows: dict[bytes, Flow]

    def at(self, k: int, times: Array) -> Array:
        """States (n, 2d) at times (n,) in interval k, s."""
        flow = known_flow(self.hybrid, self.contact_state[k], self.flows)
        begin, found = self.omega * self.begin[k] + self.phase, [np.zeros((0, self.states.shape[1]))]
        for part in np.split(times, range(AT_ONCE, times.size, AT_ONCE)):
            from_begin = np.tile(self.states[k], (part.size, 1)), np.full(part.size, begin)
            found.append(flow.carried(*from_begin, self.omega * part + self.phase)[0])
        return np.concatenate(found)

    def gaps(self, k: int, times: Array) -> tuple[Array, Array]:
        """What the gaps bound, x (n, pairs) in m, and its rate, in interval k."""
        state, phases, hybrid = self.at(k, times), self.omega * times + self.phase, self.hybrid
        u, v = np.split(state, 2, axis=1)
        # of a force the base stands still
        amplitude = hybrid.amplitude if hybrid.moves_base else 0.0
        base, rate = amplitude * np.sin(phases), amplitude * self.omega * np.cos(phases)
        return (
            -(u @ hybrid.force + np.outer(base, hybrid.in_space)),
            -(v @ hybrid.force + np.outer(rate, hybrid.in_space)),
        )

    def instants(self, k: int) -> Array:
        """Instants (n,) of interval k, its ends included, that are dense beside its fastest motion."""
        matrix = known_flow(self.hybrid, self.contact_state[k], self.flows).matrix
        fastest = max(self.omega, float(np.abs(np.linalg.eigvals(matrix).imag).max()))
        begin, end = float(self.begin[k]), float(self.end[k])
        return np.linspace(begin, end, 2 + math.ceil(PROFILE * fastest * (end - begin) / (2.0 * math.pi)))


def intervals_of(orbit: PeriodicOrbit) -> Intervals:
    """The intervals between the events of an orbit; of one without events the period from t = 0."""
    log, state = orbit.events, orbit.state
    begin, contact_state, states = log.time, log.contact_state, np.hstack([log.displacement, log.velocity])
    if not len(log):
        parts: list[Array] = [
            np.asarray(each)
            for each in (state.displacement, state.ball_displacement, state.velocity, state.ball_velocity)
        ]
        begin, contact_state, states = np.zeros(1), orbit.contact_state[None], np.concatenate(parts)[None]
    omega = 2.0 * math.pi * orbit.excitation.frequency
    end = np.append(begin[1:], begin[0] + orbit.period)
    hybrid = hybrid_system(orbit.system, orbit.excitation)
    return Intervals(hybrid, omega, orbit.excitation.phase, begin, end, states, contact_state, {})


def run_of(orbit: PeriodicOrbit, channels: Sequence[Position | Channel]) -> Response:
    """The event-driven run of an orbit over one period.

    It begins at the instant of reading next to the middle of the longest interval between events, so that no event is
    at its ends: these instants divide the period from t = 0.
    """
    intervals, n = intervals_of(orbit), orbit.system.dofs
    length = intervals.end - intervals.begin
    k = int(np.argmax(length * np.where(np.any(intervals.contact_state != FREE, axis=1), HELD, 1.0)))
    # at least one instant is inside
    finer = 2 ** max(math.ceil(math.log2(2.0 / (SAMPLES * orbit.excitation.frequency * length[k]))), 0)
    interval = 1.0 / (orbit.excitation.frequency * SAMPLES * finer)
    time = interval * round(0.5 * (intervals.begin[k] + intervals.end[k]) / interval) if len(orbit.events) else 0.0
    (state,) = intervals.at(k, np.array([time]))
    d = state.size // 2
    start = State(state[:n], state[d : d + n], state[n:d], state[d + n :], time=time)
    recorder = Recorder(channels=tuple(channels), impacts=max(len(orbit.impacts), 1))
    method = EventDriven(samples_per_cycle=SAMPLES * finer)
    return integrate(orbit.system, orbit.excitation, method, orbit.period, recorder, start)


def period_of(orbit: PeriodicOrbit, channels: Sequence[Position | Channel]) -> Response:
    """The run of an orbit as it goes from t = 0 to t = T, both included, with the impacts of the orbit."""
    run = run_of(orbit, channels)
    count = run.time.size - 1
    first = -round(run.start * count / orbit.period) % count

    def periodic(values: Array) -> Array:
        rolled = np.roll(values[:-1], -first, axis=0)
        return np.concatenate([rolled, rolled[:1]])

    def summed(values: Array) -> Array:
        rises = np.roll(np.diff(values, axis=0), -first, axis=0)
        return np.cumsum(np.concatenate([np.zeros_like(values[:1]), rises]), axis=0)

    time, energy = np.linspace(0.0, orbit.period, count + 1), run.energy
    assert energy is not None
    ledger = changed(
        energy,
        time=time,
        **{name: periodic(energy[name]) for name in ("kinetic", "strain", "ball", "contact")},
        **{
            name: summed(getattr(energy, name))
            for name in ("work", "structure_loss", "contact_loss", "structure_loss_of_mode")
        },
        work_of={name: summed(values) for name, values in energy.work_of.items()},
    )
    histories = {name: periodic(values) for name, values in run.channels.items()}
    return changed(run, time=time, channels=histories, energy=ledger, impacts=orbit.impacts, start=0.0)


def steady_of(orbit: PeriodicOrbit, channel: Position | Channel) -> SteadyMotion:
    """Amplitudes of a channel over one period, arrays of one entry."""
    run, cycles = run_of(orbit, (channel,)), orbit.cycles
    (read,) = resolve_channels(orbit.system, (channel,))
    phase = 2.0 * math.pi * orbit.excitation.frequency * run.time[1:] + orbit.excitation.phase
    first = np.arange(cycles) * (phase.size // cycles)
    motion = steady_motion(cycle_statistics(run.channels[read.name][1:], phase, first), np.array([cycles]))
    return changed(motion, peak=np.array([abs(run.largest(read).value)]), steadiness=np.array(["periodic"]))


def clearances_of(orbit: PeriodicOrbit) -> Array:
    """Smallest distances (pairs, 2) at which each pair turns back before its + and its - wall, m.

    Infinite where it never does: where there is no wall, or each approach ends at the wall.
    """
    intervals = intervals_of(orbit)
    found = np.full((len(orbit.system.contacts), 2), np.inf)
    times = [intervals.instants(k) for k in range(intervals.begin.size)]
    read = [intervals.gaps(k, each) for k, each in enumerate(times)]
    for j, column in np.ndindex(found.shape):
        side, wall = (1.0, -1.0)[column], float(intervals.hybrid.gaps[j, column])
        apart = intervals.contact_state[:, j] * side <= 0.0
        near = np.array([wall - float((side * x[:, j]).max()) for x, _ in read])
        if not math.isfinite(wall):
            continue
        if np.all(apart) and not np.any((orbit.events.pair == j) & (orbit.events.side == side)):
            found[j, column] = near.min()
        for k in np.flatnonzero(apart).tolist():
            rate = side * read[k][1][:, j]
            for i in np.flatnonzero((rate[:-1] > 0.0) & (rate[1:] <= 0.0)).tolist():

                def rate_at(time: float, k: int = k, j: int = j) -> float:
                    return float(intervals.gaps(k, np.array([time]))[1][0, j])

                # beyond the smallest distance so far by more than its rate allows, it is not looked for
                low, high = times[k][i : i + 2]
                top = scipy.optimize.brentq(rate_at, low, high, xtol=1e-15 * orbit.period)
                x = float(intervals.gaps(k, np.array([top]))[0][0, j])
                found[j, column] = min(found[j, column], wall - side * x)
            before = k - 1
            of_wall = len(orbit.events) and orbit.events.pair[k] == j and orbit.events.side[k] == side
            # an impact elsewhere turns it back
            if apart[before] and not of_wall and side * read[before][1][-1, j] > 0.0 >= rate[0]:
                found[j, column] = min(found[j, column], wall - side * float(read[k][0][0, j]))
    return np.maximum(found, 0.0)
