"""Search of periodic orbits: Newton from a first guess, and the verification by an event-driven run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, cast

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, InputError, instance, items, kind_of, quantity, require, takes
from femimpact.excitation import Excitation, PointForce, Sine
from femimpact.integrators.event_driven.loop_data import check_events
from femimpact.orbits.equations import EventStates, state_unit
from femimpact.orbits.flow import HybridSystem, hybrid_system
from femimpact.orbits.guess import first_guess, sine_of
from femimpact.orbits.newton import solve
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
from femimpact.orbits.verification import verified
from femimpact.response.response import Response
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.units import number_text

DISTINCT = 1e-6
"""Largest difference of states, in their units, of one orbit that was found twice."""

SYSTEM, CYCLES = instance(System), quantity("1", at_least=1, at_most=1000, integer=True)

STATE = {f"guess.{field.name}" for field in fields(State)}
"""Keys of a state that is none of the system."""

GUESSES = Response, State, PeriodicOrbit
"""What a search begins from."""

GRAZING = 1e-8
"""Speed of an event, in lengths and rad of the drive, at which a search has ended on no impact."""

LEAST_UNIT = 1e-3
"""Share of the size of a motion below which no gap is its unit: rounding of the motion would be read as a miss."""

TRY = "try a run that has settled for longer, a start nearer to the orbit, or another number of cycles"


@takes(system=SYSTEM, cycles=CYCLES, guess=instance(*GUESSES))
def find_orbit(
    system: System, excitation: Excitation, cycles: int = 1, *, guess: Response | State | PeriodicOrbit
) -> PeriodicOrbit:
    """The periodic orbit next to a motion, stable or unstable, with its multipliers.

    z(t + T) = z(t) of z = (u, y, u', y'), T = cycles/frequency, solved for the states after the events and their times.

    Parameters
    ----------
    system : System
        On its modes, with rigid and Kelvin-Voigt contacts.
    excitation : Sine or PointForce
        One sine of the base or of a force.
    cycles : int
        Periods of the excitation in one of the orbit. The one found may repeat after fewer.
    guess : Response, State or PeriodicOrbit
        The end of a run; a state near the orbit at the time that it names, 0 s unless it says otherwise; or another
        orbit, as of a system with slightly different numbers.

    Returns
    -------
    PeriodicOrbit
        Verified: an event-driven run over one period meets the same events and ends where it began.

    Raises
    ------
    InputError
        If the excitation is not one sine, a contact is of another law, or the motion of the guess sticks, has impacts
        of two pairs at one instant or leaves a ball untouched.
    DivergenceError
        If no orbit is found from the guess, or the one found is not a motion of the system.
    """
    check_events(system)
    sine = one_sine(excitation)
    if not isinstance(guess, State):
        count, of_guess = (
            f"{one.dofs} dofs, {len(one.balls)} balls and {len(one.contacts) - len(one.balls)} stops"
            for one in (system, guess.system)
        )
        require(count == of_guess, "system", count, "", f"must have as many as that of the guess: {of_guess}")
    return orbit_near(system, sine, first_guess(system, sine, cycles, guess))


@takes(system=SYSTEM, guesses=items(*GUESSES), cycles=CYCLES)
def find_orbits(
    system: System, excitation: Excitation, guesses: Sequence[State | Response | PeriodicOrbit], cycles: int = 1
) -> tuple[PeriodicOrbit, ...]:
    """The distinct orbits, stable and unstable, that `find_orbit` finds from several guesses.

    Parameters
    ----------
    system, excitation, cycles
        As of `find_orbit`.
    guesses : sequence of State, Response or PeriodicOrbit
        Left out are those from which no orbit is found, and those that lead to none: a motion that sticks, a state
        beyond a wall, an orbit of other cycles, a run under another drive than a sine.

    Returns
    -------
    tuple of PeriodicOrbit
        In the order in which they were found.

    Raises
    ------
    InputError
        As of `find_orbit`, but for what a guess alone leads to.
    """
    check_events(system)
    sine, orbits = one_sine(excitation), list[PeriodicOrbit]()
    for guess in guesses:
        try:
            orbit = find_orbit(system, sine, cycles, guess=guess)
        except DivergenceError:
            continue
        except InputError as error:
            # a faulty call is no matter of the motion, nor is a state of another number of coordinates
            keys = [fault.key for fault in error.faults]
            if not all(key.split(".")[0] == "guess" for key in keys) or STATE.intersection(keys):
                raise
            continue
        if not any(_is_same(orbit, other) for other in orbits):
            orbits.append(orbit)
    return tuple(orbits)


def orbit_near(system: System, excitation: Sine | PointForce, guess: EventStates) -> PeriodicOrbit:
    """The orbit that Newton's method finds from a first guess, verified.

    Raises `DivergenceError` if there is none, or it is no motion of the system.
    """
    hybrid = hybrid_system(system, excitation)
    length = length_of(hybrid, guess.states)
    solution = solve(hybrid, guess, length)
    of_guess, length = length, length_of(hybrid, solution.events.states)
    if length > 2.0 * of_guess:
        # a motion that is far larger than its guess has its rounding, too
        solution = solve(hybrid, solution.events, length)
    if not solution.converged:
        changes, residual = solution.changes, solution.residual
        last = f"the last changed them by {number_text(changes[-1], 2)}" if changes else "none could be made"
        left = f"a residual of {number_text(residual, 2)}" if math.isfinite(residual) else "no finite residual"
        raise DivergenceError(
            f"no periodic orbit found: after {len(changes)} steps of Newton's method {len(guess.phases)} events "
            f"leave {left} (in units of {number_text(length, 3)} m, of it times omega and of 1 rad), "
            f"{last}; {TRY}"
        )
    if np.min(np.abs(solution.maps.distance_rate)) <= GRAZING * length:
        raise DivergenceError(f"no periodic orbit found: the search ends where a contact begins at no speed; {TRY}")
    return verified(system, excitation, replace(solution, length=length))


def length_of(hybrid: HybridSystem, states: Array) -> float:
    """Unit of displacements (m): the smallest gap, or what is seen of motions that are far larger.

    Without walls, and with walls at no distance, it is the size of the motion: the largest displacement, or velocity
    over omega.
    """
    gaps = np.where(np.isfinite(hybrid.gaps), np.abs(hybrid.gaps), 0.0).max(axis=1)
    size = float(np.abs(states / state_unit(1.0, hybrid.omega, hybrid.mass.size)).max(initial=0.0)) or 1.0
    if not np.any(gaps > 0.0):
        return size
    return max(float(gaps[gaps > 0.0].min()), LEAST_UNIT * size)


def one_sine(excitation: Any) -> Sine | PointForce:
    """The one sine of an excitation.

    Raises `InputError` for any other.
    """
    drive = sine_of(excitation)
    allowed = "must be one Sine, or a PointForce with one: periodic orbits are those under a single sine"
    require(drive is not None, "excitation", kind_of(excitation), "", allowed)
    return cast("Sine | PointForce", drive)


def _is_same(orbit: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Whether the first event of an orbit is one of another: the same state after it at the same phase of the drive."""
    omega = 2.0 * math.pi * orbit.excitation.frequency
    unit = state_unit(orbit.length, omega, len(orbit.monodromy) // 2)
    if len(orbit.events) == 0 or len(other.events) == 0:
        apart = np.abs(state_vector(orbit.state) - state_vector(other.state)) / unit
        return len(orbit.events) == len(other.events) and bool(np.all(apart <= DISTINCT))
    one, log = orbit.events, other.events
    later = omega * (log.time - one.time[0])
    apart = np.abs(np.concatenate([log.displacement - one.displacement[0], log.velocity - one.velocity[0]], axis=1))
    near = np.all(apart <= DISTINCT * unit, axis=1) & (np.abs(np.exp(1j * later) - 1.0) <= DISTINCT)
    return bool(np.any(near & (log.kind == one.kind[0]) & (log.pair == one.pair[0]) & (log.side == one.side[0])))
