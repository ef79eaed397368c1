"""The first crossing of a gap by a sum of decaying exponentials, a parabola and a sine: none is missed.

A scalar x(t + s) = sum_k r_k e^{lambda_k s} + parabola + sine is bounded over the next s by

    x(t + s) <= [x + x' s + S s^2/2 of the slow terms] + sum over the fast terms of |r_k|,

since |e^z - 1 - z| <= |z|^2/2 and |e^z| <= 1 for Re z <= 0. Of a block of eigenvalues that lie together the same
holds with norms, since no motion of it grows: |r_k| is then |w_k| |h| with the whole block's h. Whatever split into
slow and fast is taken,
the time at which the right-hand side meets the wall comes before any crossing: the motion is advanced by
the longest of these times, again and again. Close to a wall that it approaches with speed, the bound is the
tangent with a quadratic remainder, so that the distance left is squared by every advance, as in Newton's
method, and never overshot.
"""

from __future__ import annotations

import cmath
import math
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import called, inlined

__all__ = [
    "AT_WALL",
    "NODES",
    "WEIGHTS",
    "Flight",
    "Space",
    "Watch",
    "clear_time",
    "copy_flight",
    "derivatives",
    "has_blocks",
    "measure",
    "move",
    "move_particles",
    "multiply",
    "panels_of",
    "read_coordinates",
    "unit_phase",
]

TAYLOR, MOST_STEPS = 18, 100_000
"""Terms of the exponential series of a block, whose steps have a norm below 1; and most of these steps."""

NODES = (
    -0.9739065285171717, -0.8650633666889845, -0.6794095682990244, -0.4333953941292472, -0.14887433898163122,
    0.14887433898163122, 0.4333953941292472, 0.6794095682990244, 0.8650633666889845, 0.9739065285171717,
)  # fmt: skip
WEIGHTS = (
    0.06667134430868814, 0.1494513491505806, 0.21908636251598204, 0.26926671930999635, 0.29552422471475287,
    0.29552422471475287, 0.26926671930999635, 0.21908636251598204, 0.1494513491505806, 0.06667134430868814,
)  # fmt: skip
"""Gauss-Legendre points on -1 to 1: where entries do not stand alone, products of motions are summed over them."""

AT_WALL = 32.0 * 2.220446049250313e-16
"""A clearance below this share of the terms that make it is rounding: the pair is at its wall."""


class Watch(NamedTuple):
    """Scalars that events depend on (a pair's x, or a contact force), and the motion that they are read from.

    K entries, P particles, R scalars.
    """

    exponent: NDArray[Any]  # (K,) complex
    coupling: NDArray[Any]  # (K, K) complex, above the diagonal of the blocks
    blocks: NDArray[Any]  # (B, 2) first entry and number of entries of each block; none where its number is 0
    size: NDArray[Any]  # (K,) |lambda|, or the norm of the block
    omega: float  # of the sine
    broken: bool  # whether s(t) is a broken line
    particle_given: NDArray[Any]  # (P,)
    particle_drive: NDArray[Any]  # (P,), zero for a sine: that part is in the steady answer
    rides: NDArray[Any]  # (R,) side of a contact that lasts and whose force is watched, 0 in flight
    upper: NDArray[Any]  # (R,)
    lower: NDArray[Any]  # (R,)
    weight: NDArray[Any]  # (R, K) complex
    weight_size: NDArray[Any]  # (R, K)
    particle_weight: NDArray[Any]  # (R, P)
    particle_rate_weight: NDArray[Any]  # (R, P)
    sine: NDArray[Any]  # (R,) complex
    constant: NDArray[Any]  # (R,)
    follow: NDArray[Any]  # (R,)
    follow_rate: NDArray[Any]  # (R,)


class Space(NamedTuple):
    """A `FlightSpace` ready for the kernels; K entries, P particles, R pairs, d coordinates."""

    watch: Watch
    turn: NDArray[Any]  # (K,) complex, e^{lambda dt} from one sample to the next
    particle_sine: NDArray[Any]  # (P,) complex
    kick: NDArray[Any]  # (K, R) complex
    particle_kick: NDArray[Any]  # (P, R)
    mobility: NDArray[Any]  # (R, R) change of x_i' by a unit impulse on the structure at j
    jump_value: NDArray[Any]  # (K,) complex
    jump_slope: NDArray[Any]  # (K,) complex
    shape: NDArray[Any]  # (d, K) complex
    shape_rate: NDArray[Any]  # (d, K) complex
    particle_shape: NDArray[Any]  # (d, P)
    shape_sine: NDArray[Any]  # (d,) complex
    bound_sine: NDArray[Any]  # (d,) complex, without the particles' share
    shape_constant: NDArray[Any]  # (d,)
    shape_follow: NDArray[Any]  # (d,)
    shape_follow_rate: NDArray[Any]  # (d,)
    first: NDArray[Any]  # (d + 1,) entries of coordinate i: members[first[i]:first[i + 1]]
    members: NDArray[Any]


class Flight(NamedTuple):
    """Where the motion is: homogeneous part, particles, time; and scratch space."""

    entry: NDArray[Any]  # (K,) complex
    particle: NDArray[Any]  # (P,)
    particle_rate: NDArray[Any]  # (P,)
    clock: NDArray[Any]  # (4,): time, s, its slope (both zero for a sine), phase of the sine at t = 0
    term: NDArray[Any]  # (K,) complex scratch


@inlined
def unit_phase(omega: float, clock: NDArray[Any]) -> complex:
    """e^{i theta} of the sine at the present time."""
    theta = omega * clock[0] + clock[3]
    return complex(math.cos(theta), math.sin(theta))


@inlined
def move_particles(watch: Watch, flight: Flight, duration: float) -> None:
    """Advance the particles, and s(t) where it is a broken line."""
    s, slope = flight.clock[1], flight.clock[2]
    for i in range(flight.particle.size):
        given = watch.particle_given[i] + watch.particle_drive[i] * s
        twist = watch.particle_drive[i] * slope
        flight.particle[i] += duration * (flight.particle_rate[i] + duration * (0.5 * given + duration * twist / 6.0))
        flight.particle_rate[i] += duration * (given + 0.5 * duration * twist)
    flight.clock[1] += duration * slope


@inlined
def multiply(watch: Watch, entry: NDArray[Any], out: NDArray[Any]) -> None:
    """Lambda times a vector of entries."""
    for k in range(watch.exponent.size):
        out[k] = watch.exponent[k] * entry[k]
    for b in range(watch.blocks.shape[0]):
        first = watch.blocks[b, 0]
        last = first + watch.blocks[b, 1]
        for k in range(first, last):
            for m in range(k + 1, last):
                out[k] += watch.coupling[k, m] * entry[m]


@inlined
def measure(watch: Watch, flight: Flight, size: NDArray[Any], rate: NDArray[Any]) -> None:
    """|H| of every entry, the norm within a block, and H'."""
    multiply(watch, flight.entry, rate)
    for k in range(watch.exponent.size):
        h = flight.entry[k]
        size[k] = math.sqrt(h.real * h.real + h.imag * h.imag)
    for b in range(watch.blocks.shape[0]):
        first = watch.blocks[b, 0]
        last, square = first + watch.blocks[b, 1], 0.0
        for k in range(first, last):
            square += size[k] * size[k]
        for k in range(first, last):
            size[k] = math.sqrt(square)


@called
def _move_block(watch: Watch, first: int, last: int, flight: Flight, duration: float) -> None:
    """e^{Lambda t} of one block into `term`: e^{mean t}, and Taylor's series of what is left, small in every step."""
    mean = complex(0.0, 0.0)
    for k in range(first, last):
        mean += watch.exponent[k] / (last - first)
    # all of it has died out long before so many steps
    steps = min(int(duration * (watch.size[first] + abs(mean))), MOST_STEPS) + 1
    step = duration / steps
    turn, entry, term = cmath.exp(mean * step), flight.entry, flight.term
    for _ in range(steps):
        for k in range(first, last):
            entry[k] *= turn
            term[k] = entry[k]
        for order in range(1, TAYLOR + 1):
            for k in range(first, last):
                total = (watch.exponent[k] - mean) * term[k]
                for m in range(k + 1, last):
                    total += watch.coupling[k, m] * term[m]
                term[k] = total * (step / order)
                entry[k] += term[k]
    for k in range(first, last):
        term[k] = entry[k]


@called
def move(watch: Watch, flight: Flight, duration: float) -> None:
    """Advance the homogeneous part, the particles and the clock."""
    for b in range(watch.blocks.shape[0]):
        first = watch.blocks[b, 0]
        _move_block(watch, first, first + watch.blocks[b, 1], flight, duration)
    for k in range(watch.exponent.size):
        if flight.entry[k] == 0.0:
            continue
        e = watch.exponent[k]
        decay = math.exp(e.real * duration)
        angle = e.imag * duration
        flight.entry[k] *= complex(decay * math.cos(angle), decay * math.sin(angle))
    # what an entry of a block was multiplied by here means nothing
    for b in range(watch.blocks.shape[0]):
        first = watch.blocks[b, 0]
        for k in range(first, first + watch.blocks[b, 1]):
            flight.entry[k] = flight.term[k]
    move_particles(watch, flight, duration)
    flight.clock[0] += duration


@inlined
def has_blocks(watch: Watch) -> bool:
    """Whether some entries do not stand alone."""
    return bool(watch.blocks.shape[0] > 0 and watch.blocks[0, 1] > 0)


@inlined
def copy_flight(source: Flight, target: Flight) -> None:
    """Set one motion to another."""
    for k in range(source.entry.size):
        target.entry[k] = source.entry[k]
    for i in range(source.particle.size):
        target.particle[i], target.particle_rate[i] = source.particle[i], source.particle_rate[i]
    for i in range(4):
        target.clock[i] = source.clock[i]


@inlined
def panels_of(watch: Watch, flight: Flight, duration: float) -> int:
    """Parts of a time in each of which ten Gauss points integrate products of two motions to rounding.

    Their error is below 1e-14 where twice the largest |lambda| times the part is below 6.
    """
    fastest = watch.omega
    for k in range(watch.exponent.size):
        if flight.entry[k] != 0.0:
            fastest = max(fastest, watch.size[k])
    return int(fastest * duration / 3.0) + 1


@inlined
def _first_meeting(clearance: float, speed: float, bend: float) -> float:
    """Smallest s > 0 with speed s + bend s^2/2 = clearance >= 0; infinite if there is none."""
    root = speed * speed + 2.0 * bend * clearance
    if root < 0.0:
        return math.inf
    root = math.sqrt(root)
    if speed < 0.0:
        return (root - speed) / bend if bend > 0.0 else math.inf
    return 2.0 * clearance / (speed + root) if speed + root > 0.0 else math.inf


@called
def clear_time(
    r: int,
    watch: Watch,
    flight: Flight,
    active: int,
    size: NDArray[Any],
    rate_of: NDArray[Any],
    phase: complex,
    remaining: float,
    found: NDArray[Any],
) -> float:
    """Time in which scalar r surely meets neither bound.

    `size` (K,) holds |H|, and nothing but zeros from `active` on, `rate_of` (K,) holds H'; `found` gets value, rate,
    the rounding of both, and the time in which the farther bound is surely not met.
    """
    clock, broken = flight.clock, watch.broken
    turned, wave = watch.sine[r] * phase, watch.sine[r]
    size_of_sine = math.sqrt(wave.real * wave.real + wave.imag * wave.imag)
    value = watch.constant[r] + turned.real
    rate = -watch.omega * turned.imag
    scale = abs(watch.constant[r]) + size_of_sine
    scale_rate = watch.omega * size_of_sine
    bend = watch.omega * scale_rate
    pull, twist = 0.0, 0.0
    if broken:
        value += watch.follow[r] * clock[1] + watch.follow_rate[r] * clock[2]
        rate += watch.follow[r] * clock[2]
    for i in range(flight.particle.size):
        p, d = watch.particle_weight[r, i], watch.particle_rate_weight[r, i]
        given = watch.particle_given[i] + watch.particle_drive[i] * clock[1]
        value += p * flight.particle[i] + d * flight.particle_rate[i]
        rate += p * flight.particle_rate[i] + d * given
        scale += abs(p * flight.particle[i]) + abs(d * flight.particle_rate[i])
        scale_rate += abs(p * flight.particle_rate[i]) + abs(d * given)
        pull += p * given
        twist += abs(p * watch.particle_drive[i] * clock[2])
    if broken:
        twist *= remaining
    fast = 0.0
    for k in range(active):
        fast += watch.weight_size[r, k] * size[k]
    scale += fast
    upper, lower = watch.upper[r], watch.lower[r]
    up = math.inf if upper == math.inf else 0.0
    down = math.inf if lower == -math.inf else 0.0
    for k in range(active + 1):
        over, under = upper - value - fast, value - lower - fast
        # a square root only where this split reaches beyond the best one so far
        if over > (rate + 0.5 * (bend + pull + twist) * up) * up and over > 0.0 and up < math.inf:
            up = max(up, _first_meeting(over, rate, bend + pull + twist))
        if under > (0.5 * (bend - pull + twist) * down - rate) * down and under > 0.0 and down < math.inf:
            down = max(down, _first_meeting(under, -rate, bend - pull + twist))
        if k < active:
            weight, h, h_rate = watch.weight[r, k], flight.entry[k], rate_of[k]
            own = watch.weight_size[r, k] * size[k]
            value += weight.real * h.real - weight.imag * h.imag
            rate += weight.real * h_rate.real - weight.imag * h_rate.imag
            fast = fast - own if k + 1 < active else 0.0
            speed = own * watch.size[k]
            scale_rate += speed
            bend += speed * watch.size[k]
    found[0], found[1] = value, rate
    if upper < math.inf:
        scale += abs(upper)
    if lower > -math.inf:
        scale += abs(lower)
    # the sine is known no better than the time is
    found[2] = AT_WALL * (scale + 0.1 * watch.omega * size_of_sine * clock[0])
    found[3] = AT_WALL * scale_rate
    # at the wall and leaving it with speed: the parabola returns later
    if up == 0.0 and rate < 0.0:
        up = _first_meeting(0.0, rate, bend + pull + twist)
    if down == 0.0 and rate > 0.0:
        down = _first_meeting(0.0, -rate, bend - pull + twist)
    found[4] = down if upper - value < value - lower else up
    return min(up, down)


@called
def derivatives(
    r: int, watch: Watch, flight: Flight, phase: complex, size: NDArray[Any], power: NDArray[Any], found: NDArray[Any]
) -> None:
    """Second and third derivative of scalar r, and bounds on the second to fourth: found[0:5].

    `size` and the first row of `power` (3, K) are as `measure` leaves them; the other rows are scratch space.
    """
    turned = watch.sine[r] * phase
    size_of_sine = math.sqrt(turned.real * turned.real + turned.imag * turned.imag)
    omega, clock = watch.omega, flight.clock
    second, third = -(omega**2) * turned.real, omega**3 * turned.imag
    size2, size3, size4 = omega**2 * size_of_sine, omega**3 * size_of_sine, omega**4 * size_of_sine
    for i in range(flight.particle.size):
        pull = watch.particle_weight[r, i] * (watch.particle_given[i] + watch.particle_drive[i] * clock[1])
        second += pull
        third += watch.particle_weight[r, i] * watch.particle_drive[i] * clock[2]
        size2 += abs(pull)
        size3 += abs(watch.particle_weight[r, i] * watch.particle_drive[i] * clock[2])
    multiply(watch, power[0], power[1])
    multiply(watch, power[1], power[2])
    for k in range(watch.size.size):
        second += (watch.weight[r, k] * power[1, k]).real
        third += (watch.weight[r, k] * power[2, k]).real
        own = watch.weight_size[r, k] * size[k] * watch.size[k] ** 2
        size2 += own
        size3 += own * watch.size[k]
        size4 += own * watch.size[k] ** 2
    found[0], found[1], found[2], found[3], found[4] = second, third, size2, size3, size4


@called
def read_coordinates(
    space: Space, flight: Flight, phase: complex, position: NDArray[Any], velocity: NDArray[Any]
) -> None:
    """Displacements and velocities of all coordinates (d,) at the present time."""
    s, slope = flight.clock[1], flight.clock[2]
    for i in range(position.size):
        turned = space.shape_sine[i] * phase
        x, v = space.shape_constant[i] + turned.real, -space.watch.omega * turned.imag
        if space.watch.broken:
            x += space.shape_follow[i] * s + space.shape_follow_rate[i] * slope
            v += space.shape_follow[i] * slope
        for m in range(space.first[i], space.first[i + 1]):
            k = space.members[m]
            x += (space.shape[i, k] * flight.entry[k]).real
            v += (space.shape_rate[i, k] * flight.entry[k]).real
        for m in range(flight.particle.size):
            x += space.particle_shape[i, m] * flight.particle[m]
            v += space.particle_shape[i, m] * flight.particle_rate[m]
        position[i], velocity[i] = x, v
