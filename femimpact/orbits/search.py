"""Search of periodic orbits: first guesses, by a run or in closed form, and Newton's method from them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from femimpact.arrays import Array
from femimpact.contact.laws import restitution_over
from femimpact.errors import (
    DivergenceError,
    Fault,
    InputError,
    changed,
    instance,
    items,
    kind_of,
    quantity,
    require,
    takes,
    warns,
)
from femimpact.excitation.drives import PointForce, alone
from femimpact.excitation.excitation import Excitation
from femimpact.excitation.harmonic import Sine
from femimpact.excitation.sums import Sum
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.event_driven.loop_data import CONTACT, FREE, SEPARATING, check_events
from femimpact.integrators.runs import integrate
from femimpact.orbits.equations import SECTION, EventSequence, EventStates, event_maps, length_of, solve, state_unit
from femimpact.orbits.motion import IMPACT, PRESS_AGAIN, RELEASE, SEPARATE, TOUCH, HybridSystem, hybrid_system
from femimpact.orbits.orbit import PeriodicOrbit, state_vector
from femimpact.orbits.verification import MOST_EVENTS, OtherMotionError, verified
from femimpact.response.impacts import EventLog
from femimpact.response.response import Recorder, Response
from femimpact.system.state import State, same_excitation
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

FASTEST, SPEEDS = 1e3, 4000
"""Largest approach speed over that of gap and drive, and speeds between which roots are looked for."""

TRY = "try a run that has settled for longer, a start nearer to the orbit, or another number of cycles"

BEFORE = {IMPACT: FREE, TOUCH: FREE, RELEASE: CONTACT, PRESS_AGAIN: SEPARATING, SEPARATE: SEPARATING}
"""Contact state, without the side, of a pair before an event of each kind that an orbit may have."""

STICKS = (
    "must lead to a motion without sticking: orbits that stick to a wall, or chatter, are not looked for; try another "
    "amplitude, frequency or gap, or in Python a start off the wall: fi.State(), with ball_displacement=[...] of balls"
)


@warns
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
        given, of_guess = (
            f"{one.dofs} dofs, {len(one.balls)} balls and {len(one.contacts) - len(one.balls)} stops"
            for one in (system, guess.system)
        )
        require(given == of_guess, "system", given, "", f"must have as many as that of the guess: {of_guess}")
    return orbit_near(system, sine, first_guess(system, sine, cycles, guess))


@warns
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
    sine, found = one_sine(excitation), list[PeriodicOrbit]()
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
        if not any(_is_same(orbit, other) for other in found):
            found.append(orbit)
    return tuple(found)


def orbit_near(system: System, excitation: Sine | PointForce, guess: EventStates) -> PeriodicOrbit:
    """The orbit that Newton's method finds from a first guess, verified.

    Raises `DivergenceError` if there is none, or it is no motion of the system.
    """
    hybrid = hybrid_system(system, excitation)
    found = solve(hybrid, guess, length_of(hybrid, guess.states))
    length = length_of(hybrid, found.events.states)
    if length > 2.0 * found.length:
        # a motion that is far larger than its guess has its rounding, too
        found = solve(hybrid, found.events, length)
    if not found.converged:
        last = (
            f"the last changed them by {number_text(found.changes[-1], 2)}" if found.changes else "none could be made"
        )
        left = (
            f"a residual of {number_text(found.residual, 2)}" if math.isfinite(found.residual) else "no finite residual"
        )
        raise DivergenceError(
            f"no periodic orbit found: after {len(found.changes)} steps of Newton's method {len(guess.phases)} events "
            f"leave {left} (in units of {number_text(length, 3)} m, of it times omega and of 1 rad), "
            f"{last}; {TRY}"
        )
    found = replace(found, length=length)
    if np.min(np.abs(found.maps.distance_rate)) <= GRAZING * length:
        raise DivergenceError(f"no periodic orbit found: the search ends where a contact begins at no speed; {TRY}")
    return verified(system, excitation, found)


def one_sine(excitation: Any) -> Sine | PointForce:
    """The one sine of an excitation.

    Raises `InputError` for any other.
    """
    drive = sine_of(excitation)
    allowed = (
        "must be one Sine, or a PointForce with one: periodic orbits are those under a single sine, and integrate runs "
        "others"
    )
    require(drive is not None, "excitation", kind_of(alone(excitation)), "", allowed)
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


# ---- the first guess ------------------------------------------------------------------------------


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
    recorder = Recorder(channels=(), ledger=False, impacts=0, events=2 * cycles * MOST_EVENTS)
    try:
        run = integrate(system, excitation, EventDriven(), 2.0 * period, recorder, start)
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
    sequence = EventSequence((SECTION,) * 2, np.full(2, -1), np.zeros(2), states, phases, cycles)
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
    sequence = EventSequence(
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
    touched = {*met.tolist(), *np.flatnonzero(state != FREE).tolist()}
    touched |= {ball for j, balls in system.meetings.items() if j in touched for ball in balls}
    for j, pair in enumerate(system.balls):
        if pair.free_stiffness == 0.0 and j not in touched:
            return pair.name
    return None


# ---- two impacts in a period ----------------------------------------------------------------------


@warns
@takes(system=instance(System))
def two_impact_orbits(system: System, excitation: Excitation) -> tuple[PeriodicOrbit, ...]:
    """The symmetric orbits with one impact on each wall in a period of the excitation, in closed form.

    With the propagator P over half a period and the impulse q (1 + e) of a unit approach speed, the motion just after
    the impact on the + wall is z_p(theta) + v a, (I + P) a = q (1 + e): linear in the approach speed v. That the gap
    is closed there, at that speed, makes

        (g + v alpha)^2 + v^2 (1 + beta)^2/omega^2 = |X|^2,

    a quadratic in v, with alpha and beta what the gap and its rate read of P a, and X the amplitude of the gap in the
    steady response: at most two. Where e depends on v the same equation is solved for every v.

    Parameters
    ----------
    system : System
        On its modes, with one rigid ball or stop between equal walls, and no constant force.

    Returns
    -------
    tuple of PeriodicOrbit
        Stable and unstable, the higher approach speed first. A solution that is no motion of the system, because it
        meets a wall once more or leaves the gap, is not among them, nor is one whose impacts have no speed.

    Raises
    ------
    InputError
        If the system or the excitation is another one, or a natural frequency without damping.
    DivergenceError
        If rounding keeps a solution from being confirmed, as beside a natural frequency with next to no damping.
    """
    check_events(system)
    sine = one_sine(excitation)
    walls = [j for j, pair in enumerate(system.contacts) if pair.has_walls]
    require(len(walls) == 1, "system", f"{len(walls)} pairs with walls", "", "must have one ball or stop with walls")
    pair = system.contacts[walls[0]]
    require(pair.parameters.is_rigid, f"{pair.name}.contact", pair.law.name, "", "must be Rigid")
    equal = pair.gaps[0] == pair.gaps[1]
    require(equal, f"{pair.name}.gap", pair.gaps, "m", "must be the same on both sides")
    hybrid, found = hybrid_system(system, sine), list[PeriodicOrbit]()
    constant = bool(np.any(hybrid.constant))
    require(not constant, "system", "constant forces", "", "must have none: with gravity no orbit is symmetric")
    for guess in _solutions(hybrid, walls[0]):
        try:
            found.append(orbit_near(system, sine, guess))
        except OtherMotionError:
            continue
    return tuple(found)


def _solutions(hybrid: HybridSystem, pair: int) -> list[EventStates]:
    """Roots of the equation with a positive speed, the largest one first."""
    pieces, hybrid = hybrid.over_speed[pair], replace(hybrid, over_speed=((),) * len(hybrid.over_speed))
    flow, d, pairs = hybrid.flow(np.zeros(hybrid.gaps.shape[0])), hybrid.mass.size, hybrid.gaps.shape[0]
    sequence = EventSequence(
        (IMPACT, IMPACT), np.full(2, pair), np.array([1.0, -1.0]), np.zeros((2, pairs)), np.zeros(2), 1
    )  # fmt: skip
    rows = event_maps(hybrid, EventStates(sequence, np.zeros((2, 2 * d)), np.array([0.0, math.pi])))
    half = flow.over(np.array([math.pi / hybrid.omega]))[0][0]
    after = np.linalg.solve(np.eye(2 * d) + half, rows.impulse[0])
    alpha, beta = (float(row[0] @ (half @ after)) for row in (rows.row, rows.speed_row))
    in_space = -hybrid.in_space[pair] * hybrid.amplitude
    # the gap in the steady response: along sin(theta) and along cos(theta)
    along = np.array([float(rows.row[0] @ steady) for steady in (flow.steady_sine, flow.steady_cosine)])
    along[0] += in_space
    gap, omega, constant = float(hybrid.gaps[pair, 0]), float(hybrid.omega), float(hybrid.restitution[pair])
    largest, least = float(along @ along), GRAZING * gap * omega

    def share(speed: float) -> float:
        """The impulse over that of the restitution of all speeds."""
        return float((1.0 + restitution_over(pieces, speed)[0]) / (1.0 + constant)) if pieces else 1.0

    def parts(speed: float) -> tuple[float, float]:
        """The two parts of |X|, m."""
        return gap + speed * share(speed) * alpha, speed * ((1.0 + share(speed) * beta) / omega)

    if pieces:
        speeds = np.geomspace(least, FASTEST * (gap + math.sqrt(largest)) * omega, SPEEDS)
        beyond = [math.hypot(*parts(speed)) > math.sqrt(largest) for speed in speeds.tolist()]
        roots = np.array([
            brentq(lambda speed: math.hypot(*parts(speed)) - math.sqrt(largest), speeds[k], speeds[k + 1], xtol=1e-300)
            for k in np.flatnonzero(np.diff(beyond))
        ])  # fmt: skip
    else:
        tail = (1.0 + beta) / omega
        roots = np.roots([alpha**2 + tail**2, 2.0 * alpha * gap, gap**2 - largest])
    guesses = []
    for speed in sorted((float(root.real) for root in roots if root.imag == 0.0 and root.real > least), reverse=True):
        # X = R sin(theta + lead)
        phase = math.atan2(*parts(speed)) - math.atan2(along[1], along[0])
        state = speed * (share(speed) * after) + flow.steady(np.array([phase]))[0]
        phases = phase % (2.0 * math.pi) + np.array([0.0, math.pi])
        guesses.append(EventStates(sequence, np.array([state, -state]), phases))
    return guesses
