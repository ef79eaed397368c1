"""The periodic orbit: its events, its state at t = 0, its multipliers, and what is read of one period of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex
from femimpact.errors import (
    changed,
    check_fields,
    column,
    having,
    instance,
    optional,
    quantity,
    warnings_left_to_caller,
)
from femimpact.excitation.excitation import MEMBERS, Excitation
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import multipliers_of
from femimpact.orbits.motion import IMPACT, TOUCH, Motion, hybrid_system
from femimpact.response.channels import Channel, resolve_channels
from femimpact.response.cycles import SteadyMotion, cycle_statistics, steady_motion
from femimpact.response.energy import EnergyLedger
from femimpact.response.impacts import EventLog, Impacts
from femimpact.response.response import Recorder, Response
from femimpact.structure.structure import Position
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import Head, head_of_values, short_repr
from femimpact.units import number_text

if TYPE_CHECKING:
    import xarray

LARGEST_SHOWN = 4
"""Multipliers that a notebook shows."""

SAMPLES = 1024
"""Least number of instants of a cycle at which an orbit is read."""

NEUTRAL = 1e-10
"""Distance of a modulus from 1 up to which it is 1: an orbit is confirmed to this, and its multipliers are no more."""


@short_repr
@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic motion under a sine, stable or not, found by `find_orbit` and verified by an event-driven run.

    Parameters
    ----------
    system : System
        On its modes.
    excitation : Sine or PointForce
        One sine, of the base or of a force.
    cycles : int
        Periods of the excitation after which the motion repeats.
    state : State
        At t = 0, after an event there: a run from it stays on a stable orbit.
    events : EventLog
        The events of one period, with the states just after them; times in s, 0 <= time < period. Where the motion
        meets nothing there are none.
    contact_state : ndarray (pairs,) of int
        At t = 0, as of `EventLog`.
    impacts : Impacts
        Table of the impacts of one period, by their times of touch within it.
    monodromy : ndarray (2(n+balls), 2(n+balls))
        Derivative of the state (u, y, u', y') one period later by that at t = 0, the saltation at events included.
    residual : float, 1
        By which the orbit's own run misses its start after one period: displacements over `length`, velocities over
        `length` times omega.
    length : float, m
        Unit of displacements: the smallest of the gaps, or 1e-3 of the motion's size where that is larger; without
        gaps the size itself, the largest displacement or velocity over omega just after the events.
    half_map : ndarray or None
        Of a symmetric orbit: derivative of minus the state half a period later by the state just after its first event.
        Its square is the monodromy there. None of any other.
    """

    system: System = field(metadata=instance(System))
    excitation: Excitation = field(metadata=having("an excitation", MEMBERS))
    cycles: int = field(metadata=quantity("1", at_least=1, integer=True))
    state: State = field(metadata=instance(State))
    events: EventLog = field(metadata=instance(EventLog))
    contact_state: NDArray[np.integer[Any]] = field(metadata=column("1", "pairs", of="whole number"))
    impacts: Impacts = field(metadata=instance(Impacts))
    monodromy: Array = field(metadata=column("1", "coordinates", "coordinates"))
    residual: float = field(metadata=quantity("1", at_least=0.0))
    length: float = field(metadata=quantity("m", above=0.0))
    half_map: Array | None = field(default=None, metadata=optional(column("1", "coordinates", "coordinates")))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def period(self) -> float:
        """Period of the motion, s."""
        return self.cycles / self.excitation.frequency

    @cached_property
    def multipliers(self) -> Complex:
        """Floquet multipliers (2(n+balls),), 1, largest modulus first: how a small disturbance grows in one period.

        They are the eigenvalues of the monodromy. Fast modes decay by e^-50 and more within a period: multipliers
        below 1e-13 of the norm of the matrix are rounding. Where an impact has no speed they are infinite: those of an
        orbit that grazes are not tested.
        """
        return multipliers_of(self.monodromy)

    @cached_property
    def half_multipliers(self) -> Complex:
        """Those of the half map of a symmetric orbit, whose squares the multipliers are; none of any other orbit.

        At -1 of one of them, +1 of its square, the orbit loses its symmetry; at +1 it has a fold.
        """
        return np.zeros(0, dtype=complex) if self.half_map is None else multipliers_of(self.half_map)

    @property
    def is_stable(self) -> bool:
        """True if every small disturbance decays: all multipliers are below 1 - 1e-10, as `decays` has it."""
        return bool(decays(self.multipliers))

    @property
    def is_symmetric(self) -> bool:
        """True if the motion half a period later is the same with the opposite sign.

        False of an orbit found for an even number of `cycles`: half of its period is whole cycles of the excitation,
        after which that is the same.
        """
        return self.half_map is not None

    def steady(self, channel: Position | Channel | None = None) -> SteadyMotion:
        """Peak, rms, first harmonic and its phase of any channel over one period.

        The peak is the largest |w(t)| of the motion itself, to 1e-9. The others are sums over 1,024 samples in a cycle
        of the excitation: where impacts bend w(t) they are exact to some 1e-6 of the peak, those of a sweep, with 64
        samples, to some 1e-4.

        Parameters
        ----------
        channel : str, float or Channel, optional
            As of `Recorder.channels`: a place or a ball gives its displacement relative to the base, m. The system's
            default place by default.

        Returns
        -------
        SteadyMotion
            Arrays of one entry, in the unit of the channel; as `Response.steady` of a run that has settled on it.

        Raises
        ------
        InputError
            If there is no such channel.
        """
        channels = (self.system.default_place if channel is None else channel,)
        run, cycles = run_of(self, channels), self.cycles
        (read,) = resolve_channels(self.system, channels)
        phase = 2.0 * math.pi * self.excitation.frequency * run.time[1:] + self.excitation.phase
        first = np.arange(cycles) * (phase.size // cycles)
        motion = steady_motion(cycle_statistics(run.channels[read.name][1:], phase, first), np.array([cycles]))
        return changed(motion, peak=np.array([abs(run.largest(read).value)]), steadiness=np.array(["periodic"]))

    @cached_property
    def energy(self) -> EnergyLedger:
        """Energies over one period from t = 0, relative to the base; work and losses since then."""
        energy = period_of(self, ()).energy
        assert energy is not None
        for values in (*vars(energy).values(), *energy.work_of.values()):
            if isinstance(values, np.ndarray):
                # it is read again and again
                values.setflags(write=False)
        return energy

    @property
    def work(self) -> float:
        """Work of the excitation in one period, J.

        It is that of `losses` to rounding: to 1e-12 of the energy that moves, times the largest multiplier where that
        is above 1.
        """
        return float(self.energy.work[-1])

    @property
    def losses(self) -> float:
        """Energy dissipated in one period, J: `structure_loss` and `contact_loss`."""
        return self.structure_loss + self.contact_loss

    @property
    def structure_loss(self) -> float:
        """Energy dissipated by the structure's damping in one period, J."""
        return float(self.energy.structure_loss[-1])

    @property
    def contact_loss(self) -> float:
        """Energy dissipated by impacts and by the dashpots of contacts and absorbers in one period, J.

        The share of each impact is `impacts.energy_loss`.
        """
        return float(self.energy.contact_loss[-1])

    @cached_property
    def clearances(self) -> Mapping[str, tuple[float, float]]:
        """How near each pair comes to its + and to its - wall where it turns back before it, m, by the pair's name.

        It is the smallest distance to the wall at the crests of the gap that reach no wall: the next contact appears
        (by grazing) where it falls to zero. An impact is no such crest, nor is what lies within a contact. Infinite
        where there is no crest: where there is no wall, or each approach ends at the wall.
        """
        pairs = enumerate(self.system.contacts)
        return {pair.name: (_clearance(self, j, 1.0), _clearance(self, j, -1.0)) for j, pair in pairs}

    @property
    def smallest_clearance(self) -> float:
        """The smallest of `clearances`, m: how far the next contact is; infinite where there is none to come."""
        return min((each for of_pair in self.clearances.values() for each in of_pair), default=math.inf)

    @property
    def smallest_approach_speed(self) -> float:
        """Relative speed at touch of the slowest impact, m/s: how far the loss of an impact is. Infinite without one.

        Not that of a contact which lasts over all of the period, and has no touch.
        """
        # from its states: where it is zero no run is as exact
        log, speeds = self.events, [math.inf]
        for k in np.flatnonzero(np.isin(log.kind, (IMPACT, TOUCH))).tolist():
            event = TOUCH, int(log.pair[k]), float(log.side[k])
            speeds.append(float(self._motion.condition(k - 1, event, self._motion.end[[k - 1]])[1, 0]))
        return max(min(speeds), 0.0)

    def to_xarray(self, channels: Sequence[Position | Channel] | None = None) -> xarray.Dataset:
        """One period from t = 0 to T, both included, as a labelled dataset over time, with the multipliers.

        Scalars are attributes, with their units in their names. A velocity that jumps at an impact has the value after
        it from there on.

        Parameters
        ----------
        channels : sequence of str, float or Channel, optional
            As of `Recorder.channels`. By default displacement and velocity of each named place and ball, and gap and
            contact force of each pair that has walls.

        Returns
        -------
        xarray.Dataset
            Channels, energies and the base's displacement over "time", and the real and imaginary parts of the
            multipliers over "multiplier"; of a symmetric orbit of the half multipliers too.

        Raises
        ------
        InputError
            If there is no such channel.
        """
        data = period_of(self, self._channels if channels is None else channels).to_xarray()
        data = data.assign(parts_of("multipliers", self.multipliers, "multiplier"))
        if self.is_symmetric:
            data = data.assign(parts_of("half_multipliers", self.half_multipliers, "multiplier"))
        return data.assign_attrs(
            cycles=self.cycles,
            period_s=self.period,
            is_stable=int(self.is_stable),
            is_symmetric=int(self.is_symmetric),
            impacts=len(self.impacts),
            work_J=self.work,
            structure_loss_J=self.structure_loss,
            contact_loss_J=self.contact_loss,
            smallest_clearance_m=self.smallest_clearance,
            smallest_approach_speed_m_per_s=self.smallest_approach_speed,
            residual=self.residual,
        )

    @cached_property
    def _motion(self) -> Motion:
        """The motion between the events; without events that of the period from t = 0."""
        hybrid, log = hybrid_system(self.system, self.excitation), self.events
        states, contact_state = np.hstack([log.displacement, log.velocity]), log.contact_state.astype(float)
        begin, pair = log.time, np.array(log.pair, dtype=int)
        if not len(log):
            begin, pair = np.zeros(1), np.full(1, -1)
            contact_state, states = self.contact_state[None].astype(float), state_vector(self.state)[None]
        end = np.append(begin[1:], begin[0] + self.period)
        begin, end = (hybrid.omega * time + self.excitation.phase for time in (begin, end))
        return Motion(hybrid, begin, end, states, contact_state, pair)

    @property
    def _channels(self) -> tuple[str, ...]:
        """Places and balls with their velocities, and gap and force of each pair with walls."""
        pairs = [pair.name for pair in self.system.contacts if pair.has_walls]
        moving = dict.fromkeys([*self.system.points, *(pair.name for pair in self.system.balls)])
        of_pairs = [f"{name}.{read}" for name in pairs for read in ("gap", "contact_force")]
        return (*moving, *(f"{name}.velocity" for name in moving), *of_pairs)

    @property
    def _head(self) -> Head:
        size = np.abs(self.multipliers[:LARGEST_SHOWN])
        values = {
            "period": f"{self.period:.6g} s, {self.cycles} of the excitation at {self.excitation.frequency:.6g} Hz",
            "impacts": f"{len(self.impacts)} in a period",
            "largest multipliers": ", ".join(f"{value:.6g}" for value in size),
            "residual": f"{number_text(self.residual, 2)} after a period, by its own run",
        }
        kind = "symmetric, " if self.is_symmetric else ""
        return head_of_values(f"PeriodicOrbit: {kind}{'stable' if self.is_stable else 'unstable'}", values)


def decays(multipliers: Complex) -> NDArray[np.bool_]:
    """Whether every small disturbance decays, of multipliers (..., 2(n+balls)), the largest first.

    Those of an undamped motion are 1, and rounding puts them to either side.
    """
    return np.asarray(np.abs(multipliers[..., 0]) < 1.0 - NEUTRAL)


def parts_of(name: str, multipliers: Complex, *axes: str) -> dict[str, Any]:
    """Real and imaginary parts of multipliers as variables of a dataset with some axes."""
    words = f"Floquet {name.replace('_', ' ')}"
    return {
        f"{name}_{part}": (axes, np.array(getattr(multipliers, part)), {"units": "1", "long_name": f"{words}, {part}"})
        for part in ("real", "imag")
    }


def state_vector(state: State) -> Array:
    """The vector (u, y, u', y') of a state that has all of them."""
    return np.concatenate([state.displacement, state.ball_displacement, state.velocity, state.ball_velocity])


def state_of(system: System, vector: Array, time: float) -> State:
    """The state of a system from the vector (u, y, u', y') at a time."""
    n, d = system.dofs, vector.size // 2
    return State(vector[:n], vector[d : d + n], vector[n:d], vector[d + n :], time=time)


def run_of(orbit: PeriodicOrbit, channels: Sequence[Position | Channel]) -> Response:
    """The event-driven run of an orbit over one period.

    It begins at the instant of reading next to the middle of the longest interval between events, so that no event is
    at its ends: these instants divide the period from t = 0.
    """
    motion, frequency, phase = orbit._motion, orbit.excitation.frequency, orbit.excitation.phase
    omega, k = float(motion.hybrid.omega), motion.longest()
    begin, end = ((float(each[k]) - phase) / omega for each in (motion.begin, motion.end))
    # at least one instant is inside
    finer = 2 ** max(math.ceil(math.log2(2.0 / (SAMPLES * frequency * (end - begin)))), 0)
    interval = 1.0 / (frequency * SAMPLES * finer)
    time = interval * round(0.5 * (begin + end) / interval) if len(orbit.events) else 0.0
    (state,) = motion.at(k, np.array([omega * time + phase]))
    recorder = Recorder(channels=channels, impacts=max(len(orbit.impacts), 1))
    method, start = EventDriven(samples_per_cycle=SAMPLES * finer), state_of(orbit.system, state, time)
    with warnings_left_to_caller():
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


def _clearance(orbit: PeriodicOrbit, j: int, side: float) -> float:
    """Smallest distance at which a pair turns back before a wall, m.

    Infinite where it never does: where there is no wall, or each approach ends at the wall.
    """
    motion, event, log = orbit._motion, (TOUCH, j, side), orbit.events
    if not math.isfinite(motion.hybrid.gaps[j, 0 if side > 0.0 else 1]):
        return math.inf
    apart = motion.contact_state[:, j] * side <= 0.0
    heights = [height for k in np.flatnonzero(apart).tolist() for _, height in motion.crests(event, k)]
    if not heights and np.all(apart) and not np.any((log.pair == j) & (log.side == side)):
        # it stands still
        heights = [float(motion.condition(0, event, motion.begin[[0]])[0, 0])]
    return max(-max(heights, default=-math.inf), 0.0)
