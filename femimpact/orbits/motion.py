"""The motion between two events, in closed form: under a sine it is the linear flow of a contact state.

With z = (p, p') of structure and balls, and theta the phase of the drive, a set of pressed Kelvin-Voigt pairs leaves

    z' = A z + a + s sin(theta) + c cos(theta),   theta' = omega,
    z(t) = e^{A t} (z(0) - z_p(theta(0))) + int_0^t e^{A r} a dr + z_p(theta(t)),

with z_p the steady response. Coordinates that nothing couples move in closed form, the others by the eigenvalues of
their matrix, or by its exponential where these do not separate. An event is where its condition, linear in z, rises to
zero.

All of it is analytic in the numbers of the system. These may have a tiny imaginary part each, which then is a
derivative without a difference (Squire and Trapp, 1998). Complex matrices go by their exponential, whose rounding
leaves that part its digits; eigenvalues do not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
import scipy.optimize
from numpy.typing import NDArray

from femimpact.arrays import Array, Integers
from femimpact.contact.laws import SpeedPiece, restitution_over
from femimpact.errors import Fault, InputError
from femimpact.excitation.excitation import Excitation
from femimpact.integrators.channel_rows import drive_of
from femimpact.integrators.event_driven.block import RESONANCE
from femimpact.integrators.event_driven.complex_modes import SLOW
from femimpact.integrators.event_driven.equations import equations_of
from femimpact.integrators.event_driven.loop_data import CONTACT, FREE
from femimpact.system.system import System

Numbers = NDArray[Any]
"""Real numbers, or complex ones of a derivative."""

WELL_APART = 1e3
"""Condition of the eigenvectors beyond which the matrix exponential is taken, as beside slow motions."""

SERIES = 1e-4
"""|Delta| t^2 of a nearly critical coordinate up to which its sine is taken as a series."""

SHORT, TERMS = 0.5, 16
"""Phase (rad) and decay exponent up to which the integral of a sine is taken as a series, and its terms."""

HELD = 1e-2
"""Share of its change by damping that a coordinate must change by its stiffness to be divided by that."""

PROFILE = 16
"""Instants in a period of the fastest motion between which a body is seen to turn back."""

AT_ONCE = 1024
"""Instants at which the closed form is read at once: each takes a matrix."""

IN_CONTACT = 1e-6
"""Share of its length that an interval in contact counts for, where a run looks for a start."""

IMPACT, TOUCH, RELEASE, PRESS_AGAIN, SEPARATE = "impact", "touch", "release", "press again", "separate"
"""Kinds of events that an orbit may have."""

Event = tuple[str, int, float]
"""Kind, pair and side of an event."""

Conditions = tuple[Numbers, Numbers, Numbers]
"""What rises to zero at events: rows (N, 2d) of z, and (N, 2) of sin and cos of the phase, less levels (N,), in m."""


class ResonanceError(InputError, np.linalg.LinAlgError):
    """A steady response without bound: a bad input, and to a search along a curve a singular matrix."""


@dataclass(frozen=True, eq=False)
class HybridSystem:
    """The numbers of structure, balls, contacts and sine. One by which the equations are differentiated is complex."""

    mass: Numbers  # (d,) of structure and balls
    damping: Numbers  # (d, d)
    stiffness: Numbers  # (d, d)
    load: Numbers  # (d,) per unit of s(t): the base's acceleration, or the force
    constant: Numbers  # (d,) N
    force: Numbers  # (d, pairs) what a force on the structure at each pair does to the coordinates
    in_space: Numbers  # (pairs,) x_j = -force_j p - in_space_j ub
    gaps: Numbers  # (pairs, 2) m: to the + and to the - side
    restitution: Numbers  # (pairs,)
    over_speed: tuple[tuple[SpeedPiece, ...], ...]  # of each pair; of one restitution at all speeds none
    contact_stiffness: Numbers  # (pairs,) N/m, of Kelvin-Voigt pairs
    contact_damping: Numbers  # (pairs,) N s/m
    omega: Any  # rad/s
    amplitude: Any  # m of the base, or N
    moves_base: bool
    flows: dict[bytes, Flow] = field(default_factory=dict, init=False, repr=False)  # made before, by contact state
    rows: dict[Event, tuple[Numbers, Numbers, Any]] = field(default_factory=dict, init=False, repr=False)

    def flow(self, contact_state: Array) -> Flow:
        """The flow of a contact state (pairs,), made where it is first asked for."""
        pressed = pressed_in(contact_state)
        key = pressed.tobytes()
        if key not in self.flows:
            self.flows[key] = flow_of(self, pressed)
        return self.flows[key]

    @property
    def drive(self) -> Any:
        """Amplitude of s(t) beside sin(theta)."""
        return -self.amplitude * self.omega**2 if self.moves_base else self.amplitude

    def conditions(self, kind: Sequence[str], pair: Integers, side: Array) -> Conditions:
        """The depth beyond a wall, or the force of a contact over its stiffness; less where it falls to zero."""
        towards = np.array([1.0 if name in (RELEASE, SEPARATE) else -1.0 for name in kind]) * side
        gap, base = towards[:, None] * self.force.T[pair], towards * self.in_space[pair] * self.amplitude
        level = -towards * side * self.gaps[pair, np.where(side > 0.0, 0, 1)]
        damped = np.array([
            self.contact_damping[j] / self.contact_stiffness[j] if name in (RELEASE, PRESS_AGAIN) else 0.0
            for name, j in zip(kind, pair.tolist(), strict=True)
        ])  # fmt: skip
        of_base = np.array([base, damped * self.omega * base]).T
        return np.concatenate([gap, damped[:, None] * gap], axis=1), of_base, level

    def condition(self, event: Event) -> tuple[Numbers, Numbers, Any]:
        """That of one event, kept."""
        if event not in self.rows:
            parts = self.conditions(event[:1], np.array([event[1]]), np.array([event[2]]))
            self.rows[event] = parts[0][0], parts[1][0], parts[2][0]
        return self.rows[event]

    def impulses(self, kind: Sequence[str], pair: Integers, side: Array, speed: Numbers) -> tuple[Numbers, Numbers]:
        """Changes (N, 2d) of z by events over their approach speeds (N,), and their derivatives by these."""
        push, is_impact = self.force.T[pair] / self.mass, np.array([name == IMPACT for name in kind])
        unit = is_impact * side / (self.force.T[pair] * push).sum(axis=1)
        unit = np.concatenate([0.0 * push, unit[:, None] * push], axis=1)
        restitution, change = self.restitution[pair], np.zeros_like(speed)
        if any(self.over_speed):
            # of a step of the search the pair may leave its wall
            sizes = np.where(speed.real < 0.0, -speed, speed)
            at_speed = [restitution_over(self.over_speed[j], v) for j, v in zip(pair.tolist(), sizes, strict=True)]
            both = zip(at_speed, restitution, strict=True)
            restitution = np.array([constant if over is None else over for (over, _), constant in both])
            change = sizes * np.array([slope for _, slope in at_speed])
        return unit * (1.0 + restitution)[:, None], unit * (1.0 + restitution + change)[:, None]


def pressed_in(contact_state: NDArray[Any]) -> Array:
    """Sides of the pairs that are pressed, else 0: a wall that springs back behind its body does not act."""
    return np.where(np.abs(contact_state) == CONTACT, contact_state, 0.0)


def hybrid_system(system: System, excitation: Excitation) -> HybridSystem:
    """The numbers of a system on its modes under one sine."""
    drive = drive_of(system, excitation)
    equations = equations_of(system, drive)
    parameters = [pair.parameters for pair in system.contacts]
    return HybridSystem(
        mass=equations.M.diagonal().copy(),
        damping=equations.C,
        stiffness=equations.K,
        load=equations.drive[0],
        constant=equations.given,
        force=equations.force,
        in_space=equations.in_space,
        gaps=np.array([pair.gaps for pair in system.contacts], dtype=float).reshape(-1, 2),
        restitution=np.array([numbers.restitution for numbers in parameters]),
        over_speed=tuple(numbers.over_speed for numbers in parameters),
        contact_stiffness=np.array([numbers.stiffness for numbers in parameters]),
        contact_damping=np.array([numbers.damping for numbers in parameters]),
        omega=drive.omega,
        amplitude=drive.sine.amplitude / (-(drive.omega**2) if drive.share else 1.0),
        moves_base=bool(drive.share),
    )


@dataclass(frozen=True, eq=False)
class _Alone:
    """Coordinates that nothing couples: q'' + 2 sigma q' + kappa q = a."""

    members: NDArray[np.intp]
    sigma: Numbers
    kappa: Numbers
    constant: Numbers


@dataclass(frozen=True, eq=False)
class _Coupled:
    """Coordinates that contacts and springs couple: z' = matrix z + constant."""

    members: NDArray[np.intp]  # of (p, p')
    matrix: Numbers
    constant: Numbers
    unit: Numbers  # 1/s of p, 1 of p': in these units both are of one size
    rate: Numbers | None  # eigenvalues, right vectors and their inverse; None where they do not separate
    right: Numbers
    left: Numbers


@dataclass(frozen=True, eq=False)
class Flow:
    """z' = A z + a + s sin(theta) + c cos(theta)."""

    matrix: Numbers  # (2d, 2d) A
    constant: Numbers  # (2d,) a
    sine: Numbers  # (2d,) s and c
    cosine: Numbers
    steady_sine: Numbers  # (2d,) of the steady response
    steady_cosine: Numbers
    omega: Any  # rad/s
    alone: _Alone
    coupled: _Coupled

    def field(self, z: Numbers, phase: Numbers) -> Numbers:
        """Rates z' (n, 2d) at states (n, 2d) and phases (n,)."""
        driven = np.sin(phase)[:, None] * self.sine + np.cos(phase)[:, None] * self.cosine
        return np.asarray(z @ self.matrix.T + self.constant + driven)

    def turning(self, rates: Numbers, phase: Numbers) -> Numbers:
        """Second derivatives z'' (n, 2d) with these rates."""
        driven = np.cos(phase)[:, None] * self.sine - np.sin(phase)[:, None] * self.cosine
        return np.asarray(rates @ self.matrix.T + self.omega * driven)

    @cached_property
    def fastest(self) -> float:
        """Largest frequency, over that of the drive where that is less."""
        return max(1.0, float(np.abs(np.linalg.eigvals(self.matrix).imag).max()) / float(self.omega))

    def steady(self, phase: Numbers) -> Numbers:
        """The steady response (n, 2d) at phases (n,)."""
        steady = np.sin(phase)[:, None] * self.steady_sine + np.cos(phase)[:, None] * self.steady_cosine
        return np.asarray(steady)

    def carried(self, states: Numbers, begin: Numbers, end: Numbers) -> tuple[Numbers, Numbers]:
        """States (n, 2d) at phases `end` (n,) after those at phases `begin`, and their propagators (n, 2d, 2d)."""
        propagator, moved = self.over((end - begin) / self.omega)
        left = (propagator @ (states - self.steady(begin))[:, :, None])[:, :, 0]
        return left + moved + self.steady(end), propagator

    def over(self, time: Numbers) -> tuple[Numbers, Numbers]:
        """e^{A t} (n, 2d, 2d) and the integral of e^{A r} a (n, 2d) over times (n,) in s."""
        size, real = self.constant.size, np.real(time)
        kind = np.result_type(self.matrix, self.constant)
        propagator, moved = np.zeros((time.size, size, size), dtype=kind), np.zeros((time.size, size), dtype=kind)
        _add_alone(self.alone, real[:, None], propagator, moved)
        if self.coupled.members.size:
            members = self.coupled.members
            propagator[:, members[:, None], members], moved[:, members] = _over_coupled(self.coupled, real)
        if np.iscomplexobj(time):
            # the step of a derivative
            step = 1j * np.imag(time)[:, None]
            moved = moved + step * (propagator @ self.constant)
            propagator = propagator + step[:, :, None] * (propagator @ self.matrix)
        return propagator, moved


def flow_of(hybrid: HybridSystem, contact_state: Numbers) -> Flow:
    """The flow of a contact state (pairs,): +-1 of the pairs that are pressed, 0 of the others.

    Raises `ResonanceError` at a natural frequency without damping.
    """
    pressed = np.flatnonzero(contact_state)
    side = contact_state[pressed]
    P, k, c = hybrid.force[:, pressed], hybrid.contact_stiffness[pressed], hybrid.contact_damping[pressed]
    in_space, gap = hybrid.in_space[pressed], hybrid.gaps[pressed, np.where(side > 0, 0, 1)]
    K, C = hybrid.stiffness + (P * k) @ P.T, hybrid.damping + (P * c) @ P.T
    loads = (
        hybrid.constant - P @ (k * side * gap),
        hybrid.load * hybrid.drive - P @ (k * in_space) * hybrid.amplitude,
        -P @ (c * in_space) * (hybrid.amplitude * hybrid.omega),
    )
    inverse, d = 1.0 / hybrid.mass, hybrid.mass.size
    A = np.zeros((2 * d, 2 * d), dtype=np.result_type(inverse, K, C))
    A[:d, d:], A[d:, :d], A[d:, d:] = np.eye(d), -inverse[:, None] * K, -inverse[:, None] * C
    constant, sine, cosine = (np.concatenate([np.zeros(d), inverse * load]) for load in loads)
    turned = hybrid.omega * C
    dynamic = np.empty((2 * d, 2 * d), dtype=np.result_type(A, turned))
    dynamic[:d, :d] = dynamic[d:, d:] = K - hybrid.omega**2 * np.diag(hybrid.mass)
    dynamic[:d, d:], dynamic[d:, :d] = -turned, turned
    try:
        response = np.linalg.solve(dynamic, np.concatenate(loads[1:]))
    except np.linalg.LinAlgError:
        frequency = float(np.real(hybrid.omega)) / (2.0 * np.pi)
        raise ResonanceError([Fault("frequency", frequency, "Hz", RESONANCE)]) from None
    steady = response[:d], response[d:]
    off = ((K != 0.0) | (C != 0.0)) & ~np.eye(d, dtype=bool)
    alone, others = np.flatnonzero(~off.any(axis=0)), np.flatnonzero(off.any(axis=0))
    return Flow(
        A, constant, sine, cosine,
        np.concatenate([steady[0], -hybrid.omega * steady[1]]),
        np.concatenate([steady[1], hybrid.omega * steady[0]]),
        hybrid.omega,
        _Alone(alone, 0.5 * (inverse * np.diagonal(C))[alone], (inverse * np.diagonal(K))[alone], constant[d + alone]),
        _coupled(A, constant, np.concatenate([others, d + others])),
    )  # fmt: skip


def _coupled(A: Numbers, constant: Numbers, members: NDArray[np.intp]) -> _Coupled:
    matrix, n = A[np.ix_(members, members)], members.size // 2
    none = np.zeros((0, 0))
    # of (omega p, p') the eigenvectors are of one size, but those of slow motions
    omega = np.sqrt(np.abs(np.diagonal(matrix[n:, :n])))
    unit = np.concatenate([np.maximum(omega, SLOW), np.ones(n)])
    rate, right, left = None, none, none
    if n and not np.iscomplexobj(matrix):
        values, vectors = np.linalg.eig(unit[:, None] * matrix / unit)
        if np.linalg.cond(vectors) < WELL_APART:
            rate, right, left = values, vectors / unit[:, None], np.linalg.inv(vectors) * unit
    return _Coupled(members, matrix, constant[members], unit, rate, right, left)


def _over_coupled(coupled: _Coupled, time: Numbers) -> tuple[Numbers, Numbers]:
    if coupled.rate is None:
        size, unit = coupled.constant.size, coupled.unit
        augmented = np.zeros((size + 1, size + 1), dtype=np.result_type(coupled.matrix, coupled.constant))
        augmented[:size, :size] = unit[:, None] * coupled.matrix / unit
        augmented[:size, size] = unit * coupled.constant
        both = scipy.linalg.expm(time[:, None, None] * augmented)[:, :size] / unit[:, None]
        return both[:, :, :size] * unit, both[:, :, size]
    exponent, still = time[:, None] * coupled.rate, coupled.rate == 0.0
    integral = np.where(still, time[:, None], np.expm1(exponent) / np.where(still, 1.0, coupled.rate))
    propagator = (coupled.right * np.exp(exponent)[:, None, :]) @ coupled.left
    integrated = (coupled.right * integral[:, None, :]) @ coupled.left
    return propagator.real, integrated.real @ coupled.constant


def _add_alone(alone: _Alone, time: Numbers, propagator: Numbers, moved: Numbers) -> None:
    """Write the closed form of coordinates that nothing couples: e^{-sigma t} (cos, sin/w) of any damping."""
    sigma, kappa, p = alone.sigma, alone.kappa, alone.members
    v = p + propagator.shape[1] // 2
    cosine, sine = _damped_cosine_and_sine(sigma, kappa, time)
    held = cosine + sigma * sine
    propagator[:, p, p], propagator[:, p, v] = held, sine
    propagator[:, v, p], propagator[:, v, v] = -kappa * sine, cosine - sigma * sine
    moved[:, v] = sine * alone.constant
    if np.any(alone.constant):
        moved[:, p] = _integral_of_sine(sigma, kappa, time, held) * alone.constant


def _integral_of_sine(sigma: Numbers, kappa: Numbers, time: Numbers, held: Numbers) -> Numbers:
    """Integral of e^{-sigma t} sinh(r t)/r: no formula is a small difference of large numbers where it is taken."""
    square, decay = np.abs(np.real(kappa)) * time**2, np.real(sigma) * time
    is_short = np.maximum(np.sqrt(square), decay) < SHORT
    is_held = square > HELD * (1.0 + decay)
    by_stiffness = (1.0 - held) / np.where(np.real(kappa) == 0.0, 1.0, kappa)
    # the derivatives of the sine at t = 0, one after the other
    before, now, term = 0.0 * kappa, 1.0 + 0.0 * kappa, 0.5 * time**2
    series: Numbers = 0.0 * time
    for n in range(TERMS):
        series = series + now * term
        before, now, term = now, -2.0 * sigma * now - kappa * before, term * time / (n + 3.0)
    # much damping: both rates are real, and far apart
    root = np.sqrt(np.where(is_short | is_held, 1.0, sigma**2 - kappa))
    by_damping = (_grown(-kappa / (sigma + root), time) - _grown(-(sigma + root), time)) / (2.0 * root)
    return np.where(is_short, series, np.where(is_held, by_stiffness, by_damping))


def _grown(rate: Numbers, time: Numbers) -> Numbers:
    """Integral of e^{rate t}."""
    still = rate == 0.0
    return np.where(still, time, np.expm1(rate * time) / np.where(still, 1.0, rate))


def _damped_cosine_and_sine(sigma: Numbers, kappa: Numbers, time: Numbers) -> tuple[Numbers, Numbers]:
    """e^{-sigma t} cosh(r t) and e^{-sigma t} sinh(r t)/r, r^2 = sigma^2 - kappa, for either sign of it."""
    delta = sigma**2 - kappa
    x, decay = delta * time**2, np.exp(-sigma * time)
    root = np.sqrt(np.where(delta.real < 0.0, -delta, delta))
    near, slow = np.abs(x) < SERIES, np.where(delta == 0.0, 1.0, root)
    swinging = delta.real < 0.0
    # the slow rate from the product of both: no difference of near numbers
    fast = np.where(swinging | (sigma == 0.0), 1.0, root + sigma)
    rising, falling = np.exp(np.where(swinging, 0.0, -kappa / fast) * time), np.exp(-fast * time)
    cosine = np.where(swinging, decay * np.cos(root * time), 0.5 * (rising + falling))
    sine = np.where(swinging, decay * np.sin(root * time), 0.5 * (rising - falling)) / slow
    return (
        np.where(near, decay * (1.0 + x / 2.0 * (1.0 + x / 12.0 * (1.0 + x / 30.0))), cosine),
        np.where(near, decay * time * (1.0 + x / 6.0 * (1.0 + x / 20.0 * (1.0 + x / 42.0))), sine),
    )


# ---- from event to event -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion between the events of one period; the last interval goes on to the first event of the next one."""

    hybrid: HybridSystem
    begin: Array  # (K,) rad: phases of the excitation
    end: Array  # (K,)
    states: Array  # (K, 2d) at their begin
    contact_state: NDArray[Any]  # (K, pairs)
    pair: Integers  # (K,) of the events at their begin; -1 where that is none

    @property
    def cycle(self) -> float:
        """Phase (rad) of one period."""
        return float(self.end[-1] - self.begin[0])

    def flow(self, k: int) -> Flow:
        """That of interval k."""
        return self.hybrid.flow(self.contact_state[k])

    def at(self, k: int, phases: Array) -> Array:
        """States (n, 2d) at phases (n,) in interval k."""
        parts = [np.zeros((0, self.states.shape[1]))]
        for part in np.split(phases, range(AT_ONCE, phases.size, AT_ONCE)):
            from_begin = np.tile(self.states[k], (part.size, 1)), np.full(part.size, self.begin[k])
            parts.append(self.flow(k).carried(*from_begin, part)[0])
        return np.concatenate(parts)

    def condition(self, k: int, event: Event, phases: Array) -> Array:
        """How far beyond that of an event its condition is, m, and its first two rates (3, n), in interval k."""
        flow, omega, (row, base, level) = self.flow(k), self.hybrid.omega, self.hybrid.condition(event)
        state = self.at(k, phases)
        rate = flow.field(state, phases)
        sine, cosine = np.sin(phases), omega * np.cos(phases)
        of_base = np.array([[sine, cosine / omega], [cosine, -omega * sine], [-(omega**2) * sine, -omega * cosine]])
        values = np.array([z @ row for z in (state, rate, flow.turning(rate, phases))]) + base @ of_base
        values[0] -= level
        return np.asarray(values)

    def crests(self, event: Event, m: int) -> list[tuple[float, float]]:
        """Phases of the crests of a condition in interval m, of earlier or later cycles too, and how far beyond it is.

        Also that at its beginning, where an event of another pair turns it round.
        """
        turns, k = divmod(m, self.begin.size)
        phases = np.linspace(self.begin[k], self.end[k], self._instants(k))
        _, rate, slope = self.condition(k, event, phases)

        def zero(derivative: int, low: float, high: float) -> float:
            def value(phase: float) -> float:
                return float(self.condition(k, event, np.array([phase]))[derivative, 0])

            ends = value(low), value(high)
            if ends[0] * ends[1] >= 0.0:
                # rounding puts it at one of them
                return (low, high)[int(np.argmin(np.abs(ends)))]
            return float(scipy.optimize.brentq(value, low, high))

        passes = np.flatnonzero((rate[:-1] > 0.0) & (rate[1:] <= 0.0)).tolist()
        tops = [zero(1, phases[i], phases[i + 1]) for i in passes]
        # twice within a step, beside a wall that it leaves slowly: the extreme of the rate lies between
        step = np.diff(phases) / float(self.hybrid.omega)
        for sign in (1.0, -1.0):
            before, after = sign * rate[:-1], sign * rate[1:]
            up, down = sign * slope[:-1], sign * slope[1:]
            may = (before <= 0.0) & (after <= 0.0) & (up > 0.0) & (down < 0.0)
            may &= (before + step * up > 0.0) & (after - step * down > 0.0)
            for i in np.flatnonzero(may).tolist():
                middle = zero(2, phases[i], phases[i + 1])
                if sign * float(self.condition(k, event, np.array([middle]))[1, 0]) > 0.0:
                    tops.append(zero(1, middle, phases[i + 1]) if sign > 0.0 else zero(1, phases[i], middle))
        goes_on = self.pair[k] != event[1]
        if goes_on and self.condition(k - 1, event, self.end[[k - 1]])[1, 0] > 0.0 >= rate[0]:
            tops.append(float(phases[0]))
        heights = self.condition(k, event, np.array(tops))[0].tolist()
        return [(top + turns * self.cycle, height) for top, height in zip(tops, heights, strict=True)]

    def _instants(self, k: int) -> int:
        """Number of instants of interval k, its ends included, that are dense beside its fastest motion."""
        turns = float(self.end[k] - self.begin[k]) / (2.0 * math.pi)
        return 2 + math.ceil(PROFILE * self.flow(k).fastest * turns)

    def longest(self) -> int:
        """Number of the longest interval in which nothing is in contact, if there is one."""
        held = np.any(self.contact_state != FREE, axis=1)
        return int(np.argmax((self.end - self.begin) * np.where(held, IN_CONTACT, 1.0)))

    def start(self) -> tuple[Array, float, int]:
        """State and phase in the middle of the longest interval, and number of the event that follows.

        A run over one period that begins there has no event at its ends.
        """
        k = self.longest()
        middle, first = 0.5 * float(self.begin[k] + self.end[k]), (k + 1) % self.begin.size
        return self.at(k, np.array([middle]))[0], middle - (0.0 if first else self.cycle), first
