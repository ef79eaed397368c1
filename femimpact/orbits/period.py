"""One period of an orbit: its own event-driven run, read from t = 0 on, and where it turns back before a wall."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import changed
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.loop_data import FREE
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import IMPACT, TOUCH, EventStates
from femimpact.orbits.flow import Flow, HybridSystem, hybrid_system
from femimpact.response.channels import Channel, resolve_channels
from femimpact.response.cycles import SteadyMotion, cycle_statistics, steady_motion
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Position
from femimpact.system.state import State
from femimpact.system.system import System

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
    begin: Array  # (K,) rad: phases of the excitation
    end: Array  # (K,)
    states: Array  # (K, 2d) at their begin
    contact_state: NDArray[Any]  # (K, pairs)

    def at(self, k: int, phases: Array) -> Array:
        """States (n, 2d) at phases (n,) in interval k."""
        states = [np.zeros((0, self.states.shape[1]))]
        for part in np.split(phases, range(AT_ONCE, phases.size, AT_ONCE)):
            from_begin = np.tile(self.states[k], (part.size, 1)), np.full(part.size, self.begin[k])
            states.append(self.flow(k).carried(*from_begin, part)[0])
        return np.concatenate(states)

    def gaps(self, k: int, phases: Array) -> Array:
        """What the gaps bound, with its rate and the rate of that (3, n, pairs), m, m/s and m/s^2, in interval k."""
        state, hybrid, d = self.at(k, phases), self.hybrid, self.hybrid.mass.size
        moves = state[:, :d], state[:, d:], self.flow(k).field(state, phases)[:, d:]
        base = np.sin(phases), hybrid.omega * np.cos(phases), -(hybrid.omega**2) * np.sin(phases)
        return -np.array([
            of_it @ hybrid.force + np.outer(hybrid.amplitude * of_base, hybrid.in_space)
            for of_it, of_base in zip(moves, base, strict=True)
        ])  # fmt: skip

    def flow(self, k: int) -> Flow:
        """That of interval k."""
        return self.hybrid.flow(self.contact_state[k])

    def instants(self, k: int) -> Array:
        """Phases (n,) of interval k, its ends included, that are dense beside its fastest motion."""
        fastest = max(1.0, float(np.abs(np.linalg.eigvals(self.flow(k).matrix).imag).max()) / float(self.hybrid.omega))
        begin, end = float(self.begin[k]), float(self.end[k])
        return np.linspace(begin, end, 2 + math.ceil(PROFILE * fastest * (end - begin) / (2.0 * math.pi)))

    def longest(self, pair: int | None = None) -> int:
        """Number of the longest interval in which nothing, or a pair, is in contact, if there is one."""
        held = self.contact_state if pair is None else self.contact_state[:, [pair]]
        return int(np.argmax((self.end - self.begin) * np.where(np.any(held != FREE, axis=1), HELD, 1.0)))

    def start(self, pair: int | None = None) -> tuple[Array, float, int]:
        """State and phase in the middle of the longest interval, and number of the event that follows.

        A run over one period that begins there has no event at its ends.
        """
        k, count = self.longest(pair), self.begin.size
        middle, first = 0.5 * float(self.begin[k] + self.end[k]), (k + 1) % count
        turn = 0.0 if first else float(self.end[-1] - self.begin[0])
        return self.at(k, np.array([middle]))[0], middle - turn, first


def intervals_between(hybrid: HybridSystem, events: EventStates) -> Intervals:
    """The intervals between some events."""
    begin, sequence = events.phases, events.sequence
    return Intervals(hybrid, begin, begin + sequence.between(begin), events.states, sequence.contact_state)


def intervals_of(orbit: PeriodicOrbit) -> Intervals:
    """The intervals between the events of an orbit; of one without events the period from t = 0."""
    log, state, excitation = orbit.events, orbit.state, orbit.excitation
    hybrid, contact_state = hybrid_system(orbit.system, excitation), np.asarray(log.contact_state, dtype=float)
    begin, states = log.time, np.hstack([log.displacement, log.velocity])
    if not len(log):
        parts: Any = state.displacement, state.ball_displacement, state.velocity, state.ball_velocity
        begin, contact_state, states = np.zeros(1), orbit.contact_state[None].astype(float), np.concatenate(parts)[None]
    end = np.append(begin[1:], begin[0] + orbit.period)
    begin, end = (hybrid.omega * time + excitation.phase for time in (begin, end))
    return Intervals(hybrid, begin, end, states, contact_state)


def state_of(system: System, vector: Array, time: float) -> State:
    """The state of a system from the vector (u, y, u', y') at a time."""
    n, d = system.dofs, vector.size // 2
    return State(vector[:n], vector[d : d + n], vector[n:d], vector[d + n :], time=time)


def run_of(orbit: PeriodicOrbit, channels: Sequence[Position | Channel]) -> Response:
    """The event-driven run of an orbit over one period.

    It begins at the instant of reading next to the middle of the longest interval between events, so that no event is
    at its ends: these instants divide the period from t = 0.
    """
    intervals, frequency, phase = intervals_of(orbit), orbit.excitation.frequency, orbit.excitation.phase
    omega, k = float(intervals.hybrid.omega), intervals.longest()
    begin, end = ((float(phases[k]) - phase) / omega for phases in (intervals.begin, intervals.end))
    # at least one instant is inside
    finer = 2 ** max(math.ceil(math.log2(2.0 / (SAMPLES * frequency * (end - begin)))), 0)
    interval = 1.0 / (frequency * SAMPLES * finer)
    time = interval * round(0.5 * (begin + end) / interval) if len(orbit.events) else 0.0
    (state,) = intervals.at(k, np.array([omega * time + phase]))
    recorder = Recorder(channels=channels, impacts=max(len(orbit.impacts), 1))
    method, start = EventDriven(samples_per_cycle=SAMPLES * finer), state_of(orbit.system, state, time)
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


def smallest_approach_speed_of(orbit: PeriodicOrbit) -> float:
    """Relative speed of the slowest touch of an orbit, m/s, from its states: where it is zero no run is as exact."""
    intervals, log, speeds = intervals_of(orbit), orbit.events, [math.inf]
    for k in np.flatnonzero(np.isin(log.kind, (IMPACT, TOUCH))).tolist():
        rates = intervals.gaps(k - 1, intervals.end[[k - 1]])[1, 0]
        speeds.append(float(log.side[k] * rates[log.pair[k]]))
    return max(min(speeds), 0.0)


def clearances_of(orbit: PeriodicOrbit) -> Array:
    """Smallest distances (pairs, 2) at which each pair turns back before its + and its - wall, m.

    Infinite where it never does: where there is no wall, or each approach ends at the wall.
    """
    intervals = intervals_of(orbit)
    phases = [intervals.instants(k) for k in range(intervals.begin.size)]
    read = [intervals.gaps(k, at) for k, at in enumerate(phases)]
    clearances = np.full((len(orbit.system.contacts), 2), np.inf)
    for j, column in np.ndindex(clearances.shape):
        side, wall = (1.0, -1.0)[column], float(intervals.hybrid.gaps[j, column])
        if not math.isfinite(wall):
            continue
        apart = intervals.contact_state[:, j] * side <= 0.0
        met = (orbit.events.pair == j) & (orbit.events.side == side)
        crests = list[float]()
        for k in np.flatnonzero(apart).tolist():
            tops = _tops(intervals, k, j, side, phases[k], side * read[k][:, :, j])
            crests += (wall - side * intervals.gaps(k, np.array(tops))[0, :, j]).tolist()
            # an impact elsewhere turns it back
            if (
                met.size
                and not met[k]
                and apart[k - 1]
                and side * read[k - 1][1, -1, j] > 0.0 >= side * read[k][1, 0, j]
            ):
                crests.append(wall - side * float(read[k][0, 0, j]))
        if not crests and np.all(apart) and not np.any(met):
            # it stands still
            crests = [wall - side * float(read[0][0, 0, j])]
        clearances[j, column] = max(min(crests, default=math.inf), 0.0)
    return clearances


def _tops(intervals: Intervals, k: int, pair: int, side: float, phases: Array, read: Array) -> list[float]:
    """Phases in interval k at which the gap of a pair turns back, given it, its rate and the rate of that (3, n)."""

    def zero(derivative: int, low: float, high: float) -> float:
        def value(phase: float) -> float:
            return float(intervals.gaps(k, np.array([phase]))[derivative, 0, pair])

        ends = value(low), value(high)
        if ends[0] * ends[1] >= 0.0:
            # rounding puts it at one of them
            return (low, high)[int(np.argmin(np.abs(ends)))]
        return float(scipy.optimize.brentq(value, low, high))

    (_, rate, slope), step = read, np.diff(phases) / float(intervals.hybrid.omega)
    tops = [zero(1, phases[i], phases[i + 1]) for i in np.flatnonzero((rate[:-1] > 0.0) & (rate[1:] <= 0.0)).tolist()]
    # twice within a step, beside a wall that it leaves slowly: the extreme of the rate lies between
    for sign in (1.0, -1.0):
        before, after = sign * rate[:-1], sign * rate[1:]
        up, down = sign * slope[:-1], sign * slope[1:]
        may = (before <= 0.0) & (after <= 0.0) & (up > 0.0) & (down < 0.0)
        may &= (before + step * up > 0.0) & (after - step * down > 0.0)
        for i in np.flatnonzero(may).tolist():
            middle = zero(2, phases[i], phases[i + 1])
            if sign * side * float(intervals.gaps(k, np.array([middle]))[1, 0, pair]) > 0.0:
                tops.append(zero(1, middle, phases[i + 1]) if sign > 0.0 else zero(1, phases[i], middle))
    return tops
