"""The event-driven method as a value, and its equations laid out for the compiled loop."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.contact import KelvinVoigt, Rigid
from femimpact.errors import check_fields, quantity, require
from femimpact.integrators.driving import Drive
from femimpact.integrators.flight_space import FlightSpace
from femimpact.integrators.kernels.crossing import Flight, Space, Watch
from femimpact.integrators.kernels.search import Search
from femimpact.response import Channel
from femimpact.system import System

__all__ = [
    "EventDriven",
    "Outputs",
    "check_events",
    "force_directions",
    "new_flight",
    "new_search",
    "outputs_of",
    "space_of",
]

MOST_COMPLIANT = 4
"""Kelvin-Voigt contacts whose 3^n states are prepared."""


@dataclass(frozen=True)
class EventDriven:
    """Exact flight between impacts and through Kelvin-Voigt contacts: no step, nothing to tune.

    Between events every mode and every ball moves in closed form. The first crossing of a gap is
    approached by times in which a bound on the motion excludes one, so that none is missed, and
    met to rounding. An impact changes the relative speed v to -e v by an impulse
    (1 + e) v/(1/m + b^T M^-1 b). Impacts at the same instant are resolved one after another, the
    fastest first, until no pair at its wall approaches it.

    A Kelvin-Voigt contact is flown through: while its force pushes, structure, ball and wall are one
    linear system with a closed form of its own. It ends where its force k p + c p' would turn into a pull;
    what the wall has stored by then is lost as it springs back behind the ball.

    Parameters
    ----------
    closure : float, m
        For rigid contacts. A bounce that would rise no higher is the last: the pair is captured, its momentum handed
        over, and rides on its wall until the contact force changes sign. What is left out is a
        displacement below the closure and the energy m_eff v^2/2 of that bounce, which is booked as
        loss; the accumulation's end, 2 v/(a (1 - e)) later, is the start in the table of riding.
    samples_per_cycle : int
        Grid on which channels, statistics and ledger are read; events do not depend on it. A cycle's
        peak is that of the parabola through its largest sample and the two beside it.
    most_events : int
        Impacts and changes of riding or contact for each base cycle, on average over what is flown at once,
        beyond which a run is given up.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    closure: float = field(default=1e-12, metadata=quantity("m", above=0.0))
    samples_per_cycle: int = field(default=64, metadata=quantity("1", at_least=8, at_most=1_000_000, integer=True))
    most_events: int = field(default=1_000_000, metadata=quantity("1", at_least=10, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)


def check_events(system: System) -> None:
    """Refuse what the method cannot fly.

    Raises
    ------
    InputError
        If the system is not on its modes, or its contacts are neither all rigid nor all Kelvin-Voigt, or
        too many of the latter.
    """
    allowed = "must be on its normal modes for EventDriven: use reduce(system, modes=n)"
    require(system.is_diagonal, "system", f"{system.dofs} coupled dofs", "", allowed)
    compliant = sum(isinstance(pair.law, KelvinVoigt) for pair in system.contacts)
    allowed = f"must be at most {MOST_COMPLIANT} Kelvin-Voigt contacts for EventDriven; Newmark takes any number"
    require(compliant <= MOST_COMPLIANT, "system", f"{compliant} contacts", "", allowed)
    softest = float(system.K.diagonal().min(initial=np.inf))
    allowed = "must be > 0 for EventDriven through Kelvin-Voigt contacts; rigid ones and Newmark need none"
    require(compliant == 0 or softest > 0.0, "stiffness of the softest coordinate", softest, "N/m", allowed)
    laws = (Rigid, KelvinVoigt)
    for pair in system.contacts:
        allowed = "must be Rigid or KelvinVoigt for EventDriven; other laws are for Newmark and its family"
        require(isinstance(pair.law, laws), f"{pair.name}.contact", pair.law.name, "", allowed)
        allowed = "must be of one kind with all other contacts for EventDriven; Newmark mixes them"
        same = isinstance(pair.law, type(system.contacts[0].law))
        require(same, f"{pair.name}.contact", pair.law.name, "", allowed)
        clear = sum(pair.gaps) > 0.0
        require(clear, f"{pair.name}.gap", sum(pair.gaps), "m", "must leave some clearance between both walls")


@dataclass(frozen=True, eq=False)
class Outputs:
    """What is read at every sample, as rows over coordinates p and rates p'; force >= 0 names a pair's force."""

    position: NDArray[Any]  # (O, d)
    rate: NDArray[Any]  # (O, d)
    force: tuple[int, ...]


def new_search(scalars: int, entries: int, particles: int) -> Search:
    """Scratch space of a search for events."""
    return Search(
        leaving=np.zeros(scalars),
        at_wall=np.zeros(scalars),
        rate=np.zeros(scalars),
        found=np.zeros(5),
        size=np.zeros(entries),
        power=np.zeros((3, entries), dtype=complex),
        event=np.zeros(4),
        spare=new_flight(entries, particles),
    )


def new_flight(entries: int, particles: int) -> Flight:
    """A motion that is zero."""
    entry, term = np.zeros((2, entries), dtype=complex)
    return Flight(entry, np.zeros(particles), np.zeros(particles), np.zeros(4), term)


def outputs_of(system: System, observed: NDArray[Any], channels: tuple[Channel, ...]) -> Outputs:
    """Rows of the observed place and of every channel."""
    n, d = system.dofs, system.dofs + len(system.balls)
    position, rate = np.zeros((len(channels) + 1, d)), np.zeros((len(channels) + 1, d))
    position[0, :n] = observed
    force = [-1] * (len(channels) + 1)
    for i, channel in enumerate(channels, start=1):
        if channel.row is not None:
            (position if channel.kind == 0 else rate)[i, :n] = channel.row
        elif channel.kind == 5:
            force[i] = channel.ball
        else:
            target = rate if channel.kind == 3 else position
            if not system.contacts[channel.ball].is_stop:
                target[i, n + channel.ball] = 1.0
            if channel.kind == 4:
                target[i, :n] = -system.contacts[channel.ball].direction
    return Outputs(position, rate, tuple(force))


def space_of(system: System, drive: Drive, flight: FlightSpace, interval: float) -> Space:
    """A flight space with its watched scalars, as arrays for the compiled loop."""
    pairs = len(system.contacts)
    sides = dict(flight.riders)
    force = force_directions(system)
    wave = _wave(drive)
    broken = drive.samples is not None
    shape_rate = flight.shape @ flight.modes.rate
    rows = {
        "weight": -force.T @ flight.shape,
        "particle_weight": -force.T @ flight.particle_shape,
        "sine": -force.T @ flight.harmonic * wave,
        "constant": -force.T @ flight.static,
        "follow": -force.T @ flight.follow,
        "follow_rate": -force.T @ flight.follow_rate,
    }
    upper = np.array([pair.gaps[0] for pair in system.contacts])
    lower = np.array([-pair.gaps[1] for pair in system.contacts])
    for i, (j, side) in enumerate(flight.riders):
        rows["weight"][j] = side * flight.force_shape[i]
        rows["particle_weight"][j] = 0.0
        rows["sine"][j] = side * flight.force_harmonic[i] * wave
        rows["constant"][j] = side * flight.force_static[i]
        rows["follow"][j] = side * flight.force_follow[i]
        rows["follow_rate"][j] = side * flight.force_follow_rate[i]
        upper[j], lower[j] = math.inf, 0.0
    rates = -force.T @ np.real(shape_rate @ flight.kick + flight.particle_shape @ flight.particle_kick)
    particle_sine = np.zeros(flight.particle_given.size, dtype=complex)
    if not broken:
        particle_sine = -flight.particle_drive * wave / drive.omega**2
    used = [np.flatnonzero((row != 0.0) | (rate != 0.0)) for row, rate in zip(flight.shape, shape_rate, strict=True)]
    watch = Watch(
        exponent=flight.modes.exponent,
        coupling=flight.modes.coupling,
        blocks=flight.modes.blocks,
        size=flight.modes.size,
        omega=0.0 if broken else drive.omega,
        broken=broken,
        particle_given=flight.particle_given,
        particle_drive=flight.particle_drive if broken else np.zeros_like(flight.particle_drive),
        rides=np.array([float(sides.get(j, 0)) for j in range(pairs)]),
        upper=upper,
        lower=lower,
        weight=_contiguous(rows["weight"]),
        weight_size=np.abs(_contiguous(rows["weight"])),
        particle_weight=np.ascontiguousarray(rows["particle_weight"]),
        particle_rate_weight=np.zeros(rows["particle_weight"].shape),
        sine=_contiguous(rows["sine"]),
        constant=rows["constant"],
        follow=rows["follow"],
        follow_rate=rows["follow_rate"],
    )
    return Space(
        watch=watch,
        turn=np.exp(flight.modes.exponent * interval),
        particle_sine=particle_sine,
        kick=_contiguous(flight.kick),
        particle_kick=np.ascontiguousarray(flight.particle_kick),
        mobility=np.ascontiguousarray(rates),
        jump_value=flight.jump_value,
        jump_slope=flight.jump_slope,
        shape=_contiguous(flight.shape),
        shape_rate=_contiguous(shape_rate),
        particle_shape=np.ascontiguousarray(flight.particle_shape),
        shape_sine=_contiguous(flight.harmonic * wave),
        bound_sine=_contiguous(flight.harmonic * wave - flight.particle_shape @ particle_sine),
        shape_constant=flight.static,
        shape_follow=flight.follow,
        shape_follow_rate=flight.follow_rate,
        first=np.concatenate([[0], np.cumsum([row.size for row in used])]).astype(np.int64),
        members=np.concatenate([*used, np.zeros(0)]).astype(np.int64),
    )


def _wave(drive: Drive) -> complex:
    """Complex amplitude of s(t) = amplitude sin(theta) = Re(wave e^{i theta})."""
    return complex(0.0, -drive.amplitude)


def force_directions(system: System) -> NDArray[Any]:
    """What a force on the structure at each pair does to the coordinates, (d, pairs): b there, -1 on its ball."""
    n, balls = system.dofs, len(system.balls)
    force = np.zeros((n + balls, len(system.contacts)))
    for j, pair in enumerate(system.contacts):
        force[:n, j] = pair.direction
        if not pair.is_stop:
            force[n + j, j] = -1.0
    return force


def _contiguous(values: Any) -> NDArray[Any]:
    return np.ascontiguousarray(values, dtype=complex)
