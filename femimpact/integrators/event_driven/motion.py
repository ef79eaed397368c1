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

from femimpact.integrators.kernels.compiling import apart, inlined

__all__ = [
    "AT_WALL",
    "NODES",
    "WEIGHTS",
    "Flight",
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
    "taylor",
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
    """Scalars read from a motion in closed form; the first E of them (gaps and contact forces) decide events.

    K entries, P rigid-body coordinates, R scalars.
    """

    exponent: NDArray[Any]  # (K,) complex
    coupling: NDArray[Any]  # (K, K) complex, above the diagonal of the blocks
    blocks: NDArray[Any]  # (B, 2) first entry and number of entries of each block; none where its number is 0
    size: NDArray[Any]  # (K,) |lambda|, or the norm of the block
    omega: float  # of the sine
    broken: bool  # whether s(t) is a broken line
    particle_given: NDArray[Any]  # (P,) constant acceleration
    particle_drive: NDArray[
        Any
    ]  # (P,) acceleration per unit of s(t); zero for a sine: that part is in the steady motion
    lasting: NDArray[Any]  # (E,) side of a contact whose force is watched for its end, else 0
    upper: NDArray[Any]  # (E + 1,); the last two are those of the search for the peak
    lower: NDArray[Any]  # (E + 1,)
    weight: NDArray[Any]  # (R, K) complex
    weight_size: NDArray[Any]  # (R, K)
    particle_weight: NDArray[Any]  # (R, P)
    particle_rate_weight: NDArray[Any]  # (R, P)
    sine: NDArray[Any]  # (R,) complex
    constant: NDArray[Any]  # (R,)
    follow: NDArray[Any]  # (4, R) steady motion under a broken line, per unit of ub, ub', s and s'


class Flight(NamedTuple):
    """Where the motion is: homogeneous part, rigid-body coordinates, time, a drive by samples; and scratch space."""

    entry: NDArray[Any]  # (K,) complex
    particle: NDArray[Any]  # (P,)
    particle_rate: NDArray[Any]  # (P,)
    clock: NDArray[Any]  # (2,): time, phase of the sine at t = 0
    drive: NDArray[Any]  # (4,): ub, ub', s, s' of a broken line; zero for a sine
    term: NDArray[Any]  # (K,) complex scratch


@inlined
def unit_phase(omega: float, clock: NDArray[Any]) -> complex:
    """e^{i theta} of the sine at the present time."""
    theta = omega * clock[0] + clock[1]
    return complex(math.cos(theta), math.sin(theta))


@inlined
def move_particles(watch: Watch, flight: Flight, duration: float) -> None:
    """Advance the rigid-body coordinates, and the drive where it is a broken line."""
    d = flight.drive
    for i in range(watch.particle_given.size):
        given = watch.particle_given[i] + watch.particle_drive[i] * d[2]
        twist = watch.particle_drive[i] * d[3]
        flight.particle[i] += duration * (flight.particle_rate[i] + duration * (0.5 * given + duration * twist / 6.0))
        flight.particle_rate[i] += duration * (given + 0.5 * duration * twist)
    if watch.broken:
        d[0] += duration * (d[1] + duration * (0.5 * d[2] + duration * d[3] / 6.0))
        d[1] += duration * (d[2] + 0.5 * duration * d[3])
        d[2] += duration * d[3]


@inlined
def taylor(follow: NDArray[Any], r: int, d: NDArray[Any]) -> tuple[float, float, float, float]:
    """What a broken line adds to scalar r: the value and its three derivatives, the last of which is constant."""
    a, b, c, e = follow[0, r], follow[1, r], follow[2, r], follow[3, r]
    return a * d[0] + b * d[1] + c * d[2] + e * d[3], a * d[1] + b * d[2] + c * d[3], a * d[2] + b * d[3], a * d[3]


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


@apart
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


@apart
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


@apart
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


@apart
def copy_flight(source: Flight, target: Flight) -> None:
    """Set one motion to another."""
    for k in range(source.entry.size):
        target.entry[k] = source.entry[k]
    for i in range(source.particle.size):
        target.particle[i], target.particle_rate[i] = source.particle[i], source.particle_rate[i]
    for i in range(4):
        target.drive[i] = source.drive[i]
    target.clock[0], target.clock[1] = source.clock[0], source.clock[1]


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


@apart
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
    d, broken = flight.drive, watch.broken
    turned, wave = watch.sine[r] * phase, watch.sine[r]
    size_of_sine = math.sqrt(wave.real * wave.real + wave.imag * wave.imag)
    value = watch.constant[r] + turned.real
    rate = -watch.omega * turned.imag
    scale = abs(watch.constant[r]) + size_of_sine
    scale_rate = watch.omega * size_of_sine
    bend = watch.omega * scale_rate
    pull, twist = 0.0, 0.0
    if broken:
        followed, follow_rate, follow_pull, follow_twist = taylor(watch.follow, r, d)
        value, rate, pull, twist = value + followed, rate + follow_rate, follow_pull, abs(follow_twist)
        scale, scale_rate = scale + abs(followed), scale_rate + abs(follow_rate)
    for i in range(watch.particle_given.size):
        p, q = watch.particle_weight[r, i], watch.particle_rate_weight[r, i]
        given, growth = watch.particle_given[i] + watch.particle_drive[i] * d[2], watch.particle_drive[i] * d[3]
        value += p * flight.particle[i] + q * flight.particle_rate[i]
        rate += p * flight.particle_rate[i] + q * given
        scale += abs(p * flight.particle[i]) + abs(q * flight.particle_rate[i])
        scale_rate += abs(p * flight.particle_rate[i]) + abs(q * given)
        pull += p * given + q * growth
        twist += abs(p * growth)
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
    found[2] = AT_WALL * (scale + 0.1 * watch.omega * size_of_sine * flight.clock[0])
    found[3] = AT_WALL * scale_rate
    # at the wall and leaving it with speed: the parabola returns later
    if up == 0.0 and rate < 0.0:
        up = _first_meeting(0.0, rate, bend + pull + twist)
    if down == 0.0 and rate > 0.0:
        down = _first_meeting(0.0, -rate, bend - pull + twist)
    found[4] = down if upper - value < value - lower else up
    return min(up, down)


@apart
def derivatives(
    r: int, watch: Watch, flight: Flight, phase: complex, size: NDArray[Any], power: NDArray[Any], found: NDArray[Any]
) -> None:
    """Second and third derivative of scalar r, and bounds on the second to fourth: found[0:5].

    `size` and the first row of `power` (3, K) are as `measure` leaves them; the other rows are scratch space.
    """
    turned = watch.sine[r] * phase
    size_of_sine = math.sqrt(turned.real * turned.real + turned.imag * turned.imag)
    omega, d = watch.omega, flight.drive
    second, third = -(omega**2) * turned.real, omega**3 * turned.imag
    size2, size3, size4 = omega**2 * size_of_sine, omega**3 * size_of_sine, omega**4 * size_of_sine
    if watch.broken:
        _, _, pull, twist = taylor(watch.follow, r, d)
        second, third, size2, size3 = second + pull, third + twist, size2 + abs(pull), size3 + abs(twist)
    for i in range(watch.particle_given.size):
        p, q = watch.particle_weight[r, i], watch.particle_rate_weight[r, i]
        pull = p * (watch.particle_given[i] + watch.particle_drive[i] * d[2]) + q * watch.particle_drive[i] * d[3]
        twist = p * watch.particle_drive[i] * d[3]
        second, third, size2, size3 = second + pull, third + twist, size2 + abs(pull), size3 + abs(twist)
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
