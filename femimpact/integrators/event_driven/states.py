"""Closed forms of the contact states that were met, and how a motion is taken from one to another.

The case axis comes first: each case is a run of its own. C cases, F closed forms, K entries, P rigid-body
coordinates, d coordinates (structure, then balls), R pairs. Rows of scalars: x of every pair, the contact force of
every pair on the structure, then the O outputs.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.event_driven.motion import Flight, Watch, unit_phase
from femimpact.integrators.kernels.compiling import apart, inlined

__all__ = [
    "CONTACT", "ENTERED", "ENTERING", "FITTING", "FREE", "SEPARATING", "STARTED", "STARTING", "Bounds", "Case",
    "Cases", "Forms", "Pairs", "Place", "base_motion", "enter_form", "find_form", "gap_of", "is_active", "place_of",
    "read_coordinates", "set_bounds", "set_steady_motion", "set_walls", "side_of", "turn_knot", "watch_of",
]  # fmt: skip

FREE, CONTACT, SEPARATING = range(3)
"""Contact states of a pair; the last two times the side of the wall. A rigid pair in contact sticks."""

ENTERED, ENTERING, FITTING, STARTED, STARTING = range(5)
"""How a case stands to its closed form: in it; to enter it with the coordinates it has; the same with velocities that
are made to fit its sticking pairs; as a start whose contact states are found, or are still to be found."""

RESONANCE = 1e-9
"""Distance of an undamped natural frequency from that of the drive, as a share of it, below which they are one."""


class Forms(NamedTuple):
    """Closed forms, one for each set of pairs in contact; on which side they are enters by the walls."""

    made: int  # number of forms; another thread may be adding more, which this call must not see
    key: NDArray[Any]  # (F,) bit j is set where pair j is in contact
    following: NDArray[Any]  # (F,) the next form for the same contact parameters, -1 for none
    number: NDArray[Any]  # (F,) among those of the same contact parameters
    entries: NDArray[Any]  # (F,)
    particles: NDArray[Any]  # (F,)
    exponent: NDArray[Any]  # (F, K) complex
    coupling: NDArray[Any]  # (F, K, K) complex; see Watch
    blocks: NDArray[Any]  # (F, B, 2)
    size: NDArray[Any]  # (F, K)
    particle_given: NDArray[Any]  # (F, P, 1 + R) of a unit load, and per m of each wall
    particle_drive: NDArray[Any]  # (F, P)
    weight: NDArray[Any]  # (F, 2R + O, K) complex
    weight_size: NDArray[Any]  # (F, 2R + O, K)
    particle_weight: NDArray[Any]  # (F, 2R + O, P)
    particle_rate_weight: NDArray[Any]  # (F, 2R + O, P)
    constant: NDArray[Any]  # (F, 2R + O, 1 + R)
    through: NDArray[Any]  # (F, 3, 2R + O) directly of s, ub' and ub
    follow: NDArray[Any]  # (F, 4, 2R + O) see Watch
    shape: NDArray[Any]  # (F, d, K) complex
    shape_rate: NDArray[Any]  # (F, d, K) complex
    particle_shape: NDArray[Any]  # (F, d, P)
    static: NDArray[Any]  # (F, d, 1 + R)
    position_through: NDArray[Any]  # (F, d) directly of ub
    position_follow: NDArray[Any]  # (F, 4, d)
    load: NDArray[Any]  # (F, 3, K) complex: what s, ub' and ub add to the rate of each entry
    to_entry_u: NDArray[Any]  # (F, K, d) complex
    to_entry_v: NDArray[Any]  # (F, K, d) complex
    to_particle: NDArray[Any]  # (F, P, d)
    impulse_entry: NDArray[Any]  # (F, K, R) complex: what a unit impulse on the structure at a pair adds
    impulse_particle: NDArray[Any]  # (F, P, R)
    together: NDArray[Any]  # (F, T, T) whether the product of two terms of the motion occurs in the ledger
    first: NDArray[Any]  # (F, d + 1) entries that move coordinate i: members[first[i]:first[i + 1]]
    members: NDArray[Any]  # (F, d K)


class Pairs(NamedTuple):
    """What all cases have in common: R pairs, d coordinates."""

    direction: NDArray[Any]  # (R, d) of a force on the structure
    in_space: NDArray[Any]  # (R,) -1 for a stop that does not move with the base, whose x is w + ub; else 0
    rigid: NDArray[Any]  # (R,) whether the law is that of rigid impacts
    mobility: NDArray[Any]  # (R, R) change of x_i' by a unit impulse on the structure at j
    closure: float  # m


class Case(NamedTuple):
    """One case: its drive, its contacts, and their states."""

    omega: float  # of the sine; 0 for a broken line
    amplitude: float  # of s(t): m/s^2 or N
    gap: NDArray[Any]  # (2, R) to the + and to the - wall
    stiffness: NDArray[Any]  # (R,)
    damping: NDArray[Any]  # (R,)
    restitution: NDArray[Any]  # (R,)
    state: NDArray[Any]  # (R,) contact states


class Cases(NamedTuple):
    """What every case is given, and where it is."""

    omega: NDArray[Any]  # (C,)
    amplitude: NDArray[Any]  # (C,)
    knots: NDArray[Any]  # (n,) s(t) of a broken line; none for a sine
    knot_interval: float  # s
    gap: NDArray[Any]  # (C, 2, R)
    stiffness: NDArray[Any]  # (C, R)
    damping: NDArray[Any]  # (C, R)
    restitution: NDArray[Any]  # (C, R)
    state: NDArray[Any]  # (C, R)
    form: NDArray[Any]  # (C, 2) the first form for the case's contact parameters, the present one
    entry: NDArray[Any]  # (C, K) complex
    particle: NDArray[Any]  # (C, 2, P) and their rates
    clock: NDArray[Any]  # (C, 2) see Flight
    drive: NDArray[Any]  # (C, 4) see Flight
    coordinates: NDArray[Any]  # (C, 2, d) displacements and velocities where a form is to be entered
    entering: NDArray[Any]  # (C,) ENTERED, or what is to be done first
    leaving: NDArray[Any]  # (C, 2R) see Search
    hit: NDArray[Any]  # (C,) number from 1 of the pair that meets a rigid wall at this instant, times its side; else 0
    released: NDArray[Any]  # (C, R) side of a sticking pair that an impact has let go at this instant
    sample: NDArray[Any]  # (C,) samples taken since t = 0
    events: NDArray[Any]  # (C, 2) in this call, and at one instant
    known: NDArray[Any]  # (C, N) whether the steady motion in a form is known
    sine: NDArray[Any]  # (C, N, 2R + O) complex: steady motion of the scalars
    harmonic: NDArray[Any]  # (C, N, d) complex: of the coordinates
    particle_sine: NDArray[Any]  # (C, N, P) complex


class Place(NamedTuple):
    """How coordinates are read from the motion in the present form."""

    omega: float
    shape: NDArray[Any]  # (d, K) complex
    shape_rate: NDArray[Any]  # (d, K) complex
    particle_shape: NDArray[Any]  # (d, P)
    static: NDArray[Any]  # (d,)
    harmonic: NDArray[Any]  # (d,) complex
    follow: NDArray[Any]  # (4, d)
    first: NDArray[Any]  # (d + 1,)
    members: NDArray[Any]  # (d K,)
    particles: int


class Bounds(NamedTuple):
    """What the present contact states and walls make of the scalars: working space of one thread."""

    upper: NDArray[Any]  # (2R + 1,)
    lower: NDArray[Any]  # (2R + 1,)
    lasting: NDArray[Any]  # (2R,)
    constant: NDArray[Any]  # (2R + O,)
    static: NDArray[Any]  # (d,)
    given: NDArray[Any]  # (P,)
    nothing: NDArray[Any]  # (P,) zero
    wall: NDArray[Any]  # (1 + R,) 1, then side times gap of each pair in contact or separating
    steady: NDArray[Any]  # (2, K) complex


@inlined
def side_of(state: float) -> float:
    """Side of the wall of a pair in contact or separating."""
    return 1.0 if state > 0.0 else -1.0


@inlined
def is_active(state: float) -> bool:
    """Whether a pair is in contact."""
    return abs(state) == CONTACT


@inlined
def find_form(state: NDArray[Any], first: int, count: int, keys: NDArray[Any], following: NDArray[Any]) -> int:
    """Number of the closed form for these contact states, or -1 if it was not met before."""
    key = 0
    for j in range(state.size):
        if is_active(state[j]):
            key |= 1 << j
    f = first
    while 0 <= f < count and keys[f] != key:
        f = following[f]
    return f if f < count else -1


@inlined
def base_motion(omega: float, amplitude: float, flight: Flight) -> tuple[float, float]:
    """Displacement and velocity of the base, as far as stops fixed in space feel it."""
    if omega == 0.0:
        return flight.drive[0], flight.drive[1]
    # s = amplitude sin(theta) is the second derivative
    phase = unit_phase(omega, flight.clock)
    return -amplitude * phase.imag / (omega * omega), -amplitude * phase.real / omega


@apart
def set_steady_motion(
    f: int, omega: float, amplitude: float, forms: Forms, h: NDArray[Any], sine: NDArray[Any],
    harmonic: NDArray[Any], particle_sine: NDArray[Any],
) -> bool:  # fmt: skip
    """Steady motion under a sine in one form; False where it is unbounded. `h` (2, K) is scratch space."""
    wave, of_base = complex(0.0, -amplitude), -1.0 / (omega * omega)
    of_speed = complex(0.0, omega * of_base)
    last, particles = forms.entries[f], forms.particles[f]
    for turn in range(2):
        direction = 1.0 if turn == 0 else -1.0
        for k in range(last - 1, -1, -1):
            total = forms.load[f, 0, k] + direction * of_speed * forms.load[f, 1, k] + of_base * forms.load[f, 2, k]
            total *= 0.5
            for m in range(k + 1, last):
                total += forms.coupling[f, k, m] * h[turn, m]
            apart = complex(0.0, direction * omega) - forms.exponent[f, k]
            if abs(apart) < RESONANCE * omega and total != 0.0 and wave != 0.0:
                return False
            h[turn, k] = total / apart if total != 0.0 else complex(0.0, 0.0)
    for p in range(particles):
        particle_sine[p] = forms.particle_drive[f, p] * of_base * wave
    for r in range(sine.size):
        total = forms.through[f, 0, r] + of_speed * forms.through[f, 1, r] + of_base * forms.through[f, 2, r]
        for k in range(last):
            w = forms.weight[f, r, k]
            total += w * h[0, k] + (w * h[1, k]).conjugate()
        sine[r] = total * wave
        for p in range(particles):
            q = forms.particle_weight[f, r, p] + complex(0.0, omega) * forms.particle_rate_weight[f, r, p]
            sine[r] += q * particle_sine[p]
    for i in range(harmonic.size):
        total = complex(of_base * forms.position_through[f, i], 0.0)
        for k in range(last):
            w = forms.shape[f, i, k]
            total += w * h[0, k] + (w * h[1, k]).conjugate()
        harmonic[i] = total * wave
        for p in range(particles):
            harmonic[i] += forms.particle_shape[f, i, p] * particle_sine[p]
    return True


@inlined
def watch_of(f: int, omega: float, forms: Forms, sine: NDArray[Any], s: Bounds) -> Watch:
    """Scalars of one case in one form, as the search and the readings take them."""
    last, particles, broken = forms.entries[f], forms.particles[f], omega == 0.0
    drive = forms.particle_drive[f][:particles] if broken else s.nothing[:particles]
    return Watch(
        forms.exponent[f][:last], forms.coupling[f], forms.blocks[f], forms.size[f][:last], omega, broken,
        s.given[:particles], drive, s.lasting, s.upper, s.lower, forms.weight[f], forms.weight_size[f],
        forms.particle_weight[f], forms.particle_rate_weight[f], sine, s.constant, forms.follow[f],
    )  # fmt: skip


@inlined
def place_of(f: int, omega: float, forms: Forms, harmonic: NDArray[Any], s: Bounds) -> Place:
    """Coordinates of one case in one form."""
    return Place(
        omega, forms.shape[f], forms.shape_rate[f], forms.particle_shape[f], s.static, harmonic,
        forms.position_follow[f], forms.first[f], forms.members[f], forms.particles[f],
    )  # fmt: skip


@apart
def set_walls(
    state: NDArray[Any], gap: NDArray[Any], constant: NDArray[Any], static: NDArray[Any], given: NDArray[Any],
    particles: int, s: Bounds,
) -> None:  # fmt: skip
    """What constant loads and the walls in contact add to every scalar, coordinate and rigid-body coordinate."""
    s.wall[0] = 1.0
    for j in range(state.size):
        side = side_of(state[j])
        s.wall[1 + j] = 0.0 if state[j] == FREE else side * gap[0 if side > 0.0 else 1, j]
    for r in range(s.constant.size):
        total = 0.0
        for w in range(s.wall.size):
            total += constant[r, w] * s.wall[w]
        s.constant[r] = total
    for i in range(s.static.size):
        total = 0.0
        for w in range(s.wall.size):
            total += static[i, w] * s.wall[w]
        s.static[i] = total
    for p in range(particles):
        total = 0.0
        for w in range(s.wall.size):
            total += given[p, w] * s.wall[w]
        s.given[p] = total


@apart
def set_bounds(state: NDArray[Any], gap: NDArray[Any], s: Bounds) -> None:
    """Bounds of the watched scalars, and the side of a contact that lasts."""
    pairs = state.size
    for j in range(pairs):
        side = side_of(state[j])
        for r in (j, pairs + j):
            s.upper[r], s.lower[r], s.lasting[r] = math.inf, -math.inf, 0.0
        if state[j] == FREE:
            s.upper[j], s.lower[j] = gap[0, j], -gap[1, j]
        elif is_active(state[j]):
            s.lasting[pairs + j] = side
            if side > 0.0:
                s.lower[pairs + j] = 0.0
            else:
                s.upper[pairs + j] = 0.0
        elif side > 0.0:
            s.lower[j], s.upper[pairs + j] = gap[0, j], 0.0
        else:
            s.upper[j], s.lower[pairs + j] = -gap[1, j], 0.0


@apart
def read_coordinates(place: Place, flight: Flight, out: NDArray[Any]) -> None:
    """Displacements and velocities of all coordinates (2, d) at the present time."""
    omega, d = place.omega, flight.drive
    phase = unit_phase(omega, flight.clock)
    for i in range(out.shape[1]):
        turned = place.harmonic[i] * phase
        x, v = place.static[i] + turned.real, -omega * turned.imag
        if omega == 0.0:
            a, b, c, e = place.follow[0, i], place.follow[1, i], place.follow[2, i], place.follow[3, i]
            x += a * d[0] + b * d[1] + c * d[2] + e * d[3]
            v += a * d[1] + b * d[2] + c * d[3]
        for m in range(place.first[i], place.first[i + 1]):
            k = place.members[m]
            h, shape, rate = flight.entry[k], place.shape[i, k], place.shape_rate[i, k]
            x += shape.real * h.real - shape.imag * h.imag
            v += rate.real * h.real - rate.imag * h.imag
        for p in range(place.particles):
            x += place.particle_shape[i, p] * flight.particle[p]
            v += place.particle_shape[i, p] * flight.particle_rate[p]
        out[0, i], out[1, i] = x, v


@apart
def enter_form(
    place: Place, entries: int, from_u: NDArray[Any], from_v: NDArray[Any], to_particle: NDArray[Any],
    state: NDArray[Any], flight: Flight,
) -> None:  # fmt: skip
    """The homogeneous part and the rigid-body coordinates of coordinates (2, d) in a form; these are used up."""
    omega, d = place.omega, flight.drive
    phase = unit_phase(omega, flight.clock)
    for i in range(state.shape[1]):
        turned = place.harmonic[i] * phase
        state[0, i] -= place.static[i] + turned.real
        state[1, i] += omega * turned.imag
        if omega == 0.0:
            a, b, c, e = place.follow[0, i], place.follow[1, i], place.follow[2, i], place.follow[3, i]
            state[0, i] -= a * d[0] + b * d[1] + c * d[2] + e * d[3]
            state[1, i] -= a * d[1] + b * d[2] + c * d[3]
    for k in range(entries):
        total = complex(0.0, 0.0)
        for i in range(state.shape[1]):
            total += from_u[k, i] * state[0, i] + from_v[k, i] * state[1, i]
        flight.entry[k] = total
    for p in range(place.particles):
        x, v = 0.0, 0.0
        for i in range(state.shape[1]):
            x += to_particle[p, i] * state[0, i]
            v += to_particle[p, i] * state[1, i]
        flight.particle[p], flight.particle_rate[p] = x, v


@inlined
def gap_of(j: int, direction: NDArray[Any], in_space: NDArray[Any], values: NDArray[Any], base: float) -> float:
    """The x of a pair, or its rate, from the coordinates, or their rates, and the base's."""
    x = -in_space[j] * base
    for i in range(values.size):
        x -= direction[j, i] * values[i]
    return float(x)


@apart
def turn_knot(
    index: int, knots: NDArray[Any], interval: float, entries: int, follow: NDArray[Any], from_u: NDArray[Any],
    from_v: NDArray[Any], flight: Flight,
) -> None:  # fmt: skip
    """A new straight piece of s(t) from a knot on: what the steady motion changes by is taken up by the entries."""
    d, value, slope = flight.drive, 0.0, 0.0
    if index < knots.size - 1:
        value, slope = knots[index], (knots[index + 1] - knots[index]) / interval
    jump, jump_rate = value - d[2], slope - d[3]
    d[2], d[3] = value, slope
    for i in range(follow.shape[1]):
        x = follow[2, i] * jump + follow[3, i] * jump_rate
        v = follow[1, i] * jump + follow[2, i] * jump_rate
        for k in range(entries):
            flight.entry[k] -= from_u[k, i] * x + from_v[k, i] * v
