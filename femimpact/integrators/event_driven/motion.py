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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import apart, inlined
from femimpact.integrators.event_driven.exponentials import cosine_and_sine, exponentials

__all__ = [
    "AT_WALL",
    "NODES",
    "STICKS",
    "WEIGHTS",
    "Array",
    "Complex",
    "Indices",
    "Motion",
    "Scalars",
    "Search",
    "clear_time",
    "copy_motion",
    "derivatives",
    "has_blocks",
    "measure",
    "move",
    "move_rigid_bodies",
    "multiply",
    "next_panel",
    "rates_now",
    "rigid_body_push",
    "taylor",
    "unit_phase",
    "value_now",
]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Indices = NDArray[np.int64]

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

DECAY_EXPONENT = 80.0
"""Decay e^-80, 2e-35, of which nothing is left in any sum; two entries of a block decay by it nearly together."""

AT_WALL = 32.0 * 2.220446049250313e-16
"""A clearance below this share of the terms that make it is rounding: the pair is at its wall."""

STICKS = 2.0
"""Of a pair that sticks, whose force may jump, beside 1 of a compliant contact, whose force is one of the state."""


class Scalars(NamedTuple):
    """Scalars read from a motion in closed form; the first E of them (gaps and contact forces) decide events.

    K entries, P rigid-body coordinates, R scalars.
    """

    exponent: Complex  # (K,)
    coupling: Complex  # (K, K), above the diagonal of the blocks
    blocks: Indices  # (B, 2) first entry and number of entries of each block; none where its number is 0
    size: Array  # (K,) |lambda|, or the norm of the block
    omega: float  # of the sine
    broken: bool  # whether s(t) is a broken line
    rigid_body_given: Array  # (P,) constant acceleration
    rigid_body_drive: Array  # (P,) acceleration per unit of s(t); zero for a sine, as that part is in `sine`
    lasting: Array  # (E,) side of a contact whose force is watched for its end, times STICKS if it sticks, else 0
    upper: Array  # (E + 1,); the last two are those of the search for the peak
    lower: Array  # (E + 1,)
    weight: Complex  # (R, K)
    weight_size: Array  # (R, K)
    rigid_body_weight: Array  # (R, P)
    rigid_body_rate_weight: Array  # (R, P)
    sine: Complex  # (R,)
    constant: Array  # (R,)
    follow: Array  # (4, R) steady motion under a broken line, per unit of ub, ub', s and s'
    term: Complex  # (K,) scratch
    growth: Complex  # (K,) scratch


class Motion(NamedTuple):
    """Where the motion is: homogeneous part, rigid-body coordinates, time, a drive by samples."""

    entry: Complex  # (K,)
    rigid_body: Array  # (P,)
    rigid_body_rate: Array  # (P,)
    clock: Array  # (2,): time, phase of the sine at t = 0
    drive: Array  # (4,): ub, ub', s, s' of a broken line; zero for a sine


class Search(NamedTuple):
    """What a search leaves behind, and its scratch space; R scalars, K entries."""

    leaving: Array  # (R,) side of a bound just left, or at which another bound was met at rest; else 0
    at_wall: Array  # (R,) side of the wall touched at this instant, else 0
    rate: Array  # (R,)
    found: Array  # (5,) scratch
    size: Array  # (K,) |H|; see `measure`
    power: Complex  # (3, K): H', and scratch
    event: Array  # (2,): scalar, side
    negligible: Array  # (1,) m/s, see `negligible_approach`


@inlined
def unit_phase(omega: float, clock: Array) -> complex:
    """e^{i theta} of the sine at the present time."""
    cosine, sine = cosine_and_sine(omega * clock[0] + clock[1])
    return complex(cosine, sine)


@inlined
def rigid_body_push(i: int, scalars: Scalars, motion: Motion) -> tuple[float, float]:
    """Acceleration of a rigid-body coordinate, and its rate."""
    drive = scalars.rigid_body_drive[i]
    return scalars.rigid_body_given[i] + drive * motion.drive[2], drive * motion.drive[3]


@inlined
def move_rigid_bodies(scalars: Scalars, motion: Motion, duration: float) -> None:
    """Advance the rigid-body coordinates, and the drive where it is a broken line."""
    d, y, v = motion.drive, motion.rigid_body, motion.rigid_body_rate
    for i in range(scalars.rigid_body_given.size):
        push, growth = rigid_body_push(i, scalars, motion)
        y[i] += duration * (v[i] + duration * (0.5 * push + duration * growth / 6.0))
        v[i] += duration * (push + 0.5 * duration * growth)
    if scalars.broken:
        d[0] += duration * (d[1] + duration * (0.5 * d[2] + duration * d[3] / 6.0))
        d[1] += duration * (d[2] + 0.5 * duration * d[3])
        d[2] += duration * d[3]


@inlined
def taylor(follow: Array, r: int, d: Array) -> tuple[float, float, float, float]:
    """What a broken line adds to scalar r: the value and its three derivatives, the last of which is constant."""
    a, b, c, e = follow[0, r], follow[1, r], follow[2, r], follow[3, r]
    return a * d[0] + b * d[1] + c * d[2] + e * d[3], a * d[1] + b * d[2] + c * d[3], a * d[2] + b * d[3], a * d[3]


@inlined
def multiply(scalars: Scalars, entry: Complex, out: Complex) -> None:
    """Lambda times a vector of entries."""
    for k in range(scalars.exponent.size):
        out[k] = scalars.exponent[k] * entry[k]
    for b in range(scalars.blocks.shape[0]):
        first = scalars.blocks[b, 0]
        last = first + scalars.blocks[b, 1]
        for k in range(first, last):
            for m in range(k + 1, last):
                out[k] += scalars.coupling[k, m] * entry[m]


@apart
def measure(scalars: Scalars, motion: Motion, search: Search) -> None:
    """|H| of every entry, the norm within a block, and H'."""
    size = search.size
    multiply(scalars, motion.entry, search.power[0])
    for k in range(scalars.exponent.size):
        h = motion.entry[k]
        size[k] = math.sqrt(h.real * h.real + h.imag * h.imag)
    for b in range(scalars.blocks.shape[0]):
        first = scalars.blocks[b, 0]
        last, square = first + scalars.blocks[b, 1], 0.0
        for k in range(first, last):
            square += size[k] * size[k]
        for k in range(first, last):
            size[k] = math.sqrt(square)


@apart
def _move_block(scalars: Scalars, first: int, last: int, motion: Motion, duration: float) -> None:
    """Advance the entries of one block: by e^{mean t}, and Taylor's series of what is left, small in every step."""
    mean = complex(0.0, 0.0)
    for k in range(first, last):
        mean += scalars.exponent[k] / (last - first)
    # all of it has decayed long before so many steps
    steps = min(int(duration * (scalars.size[first] + abs(mean))), MOST_STEPS) + 1
    step = duration / steps
    turn, entry, term = cmath.exp(mean * step), motion.entry, scalars.term
    for _ in range(steps):
        for k in range(first, last):
            entry[k] *= turn
            term[k] = entry[k]
        for order in range(1, TAYLOR + 1):
            for k in range(first, last):
                total = (scalars.exponent[k] - mean) * term[k]
                for m in range(k + 1, last):
                    total += scalars.coupling[k, m] * term[m]
                term[k] = total * (step / order)
                entry[k] += term[k]


@apart
def move(scalars: Scalars, motion: Motion, duration: float) -> None:
    """Advance the homogeneous part, the rigid-body coordinates and the clock."""
    growth = scalars.growth
    exponentials(scalars.exponent, duration, growth)
    for b in range(scalars.blocks.shape[0]):
        first = scalars.blocks[b, 0]
        last = first + scalars.blocks[b, 1]
        if last > first:
            _move_block(scalars, first, last, motion, duration)
        for k in range(first, last):
            growth[k] = 1.0
    for k in range(scalars.exponent.size):
        motion.entry[k] *= growth[k]
    move_rigid_bodies(scalars, motion, duration)
    motion.clock[0] += duration


@inlined
def has_blocks(scalars: Scalars) -> bool:
    """Whether some entries do not stand alone."""
    return bool(scalars.blocks.shape[0] > 0 and scalars.blocks[0, 1] > 0)


@apart
def copy_motion(source: Motion, target: Motion) -> None:
    """Set one motion to another."""
    for k in range(source.entry.size):
        target.entry[k] = source.entry[k]
    for i in range(source.rigid_body.size):
        target.rigid_body[i], target.rigid_body_rate[i] = source.rigid_body[i], source.rigid_body_rate[i]
    for i in range(4):
        target.drive[i] = source.drive[i]
    target.clock[0], target.clock[1] = source.clock[0], source.clock[1]


@apart
def next_panel(elapsed: float, remaining: float, scalars: Scalars, motion: Motion) -> float:
    """Next part of a time (s) in which ten Gauss points integrate products of two motions to rounding.

    Their error is below 1e-14 where twice the largest |lambda| times the part is below 6. An entry that has decayed
    since the time began is set to zero, and needs no short parts.
    """
    fastest = scalars.omega
    for k in range(scalars.exponent.size):
        if -scalars.exponent[k].real * elapsed > DECAY_EXPONENT:
            motion.entry[k] = 0.0
        elif motion.entry[k] != 0.0:
            fastest = max(fastest, scalars.size[k])
    return remaining if fastest * remaining <= 3.0 else 3.0 / fastest


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
    r: int, scalars: Scalars, motion: Motion, active: int, phase: complex, remaining: float, search: Search
) -> float:  # fmt: skip
    """Time in which scalar r surely meets neither bound.

    `search` is as `measure` leaves it, with nothing but zeros from entry `active` on; its `found` gets value, rate,
    the rounding of both, and the time in which the farther bound is surely not met.
    """
    size, rate_of, found = search.size, search.power[0], search.found
    d, broken = motion.drive, scalars.broken
    turned, wave = scalars.sine[r] * phase, scalars.sine[r]
    size_of_sine = math.sqrt(wave.real * wave.real + wave.imag * wave.imag)
    value = scalars.constant[r] + turned.real
    rate = -scalars.omega * turned.imag
    scale = abs(scalars.constant[r]) + size_of_sine
    scale_rate = scalars.omega * size_of_sine
    bend = scalars.omega * scale_rate
    pull, twist = 0.0, 0.0
    if broken:
        followed, follow_rate, follow_pull, follow_twist = taylor(scalars.follow, r, d)
        value, rate, pull, twist = value + followed, rate + follow_rate, follow_pull, abs(follow_twist)
        # a drive, and the sine below, are known no better than the time is
        scale += abs(followed) + 0.1 * abs(follow_rate) * motion.clock[0]
        scale_rate += abs(follow_rate)
    for i in range(scalars.rigid_body_given.size):
        p, q = scalars.rigid_body_weight[r, i], scalars.rigid_body_rate_weight[r, i]
        push, growth = rigid_body_push(i, scalars, motion)
        value += p * motion.rigid_body[i] + q * motion.rigid_body_rate[i]
        rate += p * motion.rigid_body_rate[i] + q * push
        scale += abs(p * motion.rigid_body[i]) + abs(q * motion.rigid_body_rate[i])
        scale_rate += abs(p * motion.rigid_body_rate[i]) + abs(q * push)
        pull += p * push + q * growth
        twist += abs(p * growth)
    if broken:
        twist *= remaining
    fast = 0.0
    for k in range(active):
        fast += scalars.weight_size[r, k] * size[k]
    scale += fast
    upper, lower = scalars.upper[r], scalars.lower[r]
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
            weight, h, h_rate = scalars.weight[r, k], motion.entry[k], rate_of[k]
            own = scalars.weight_size[r, k] * size[k]
            value += weight.real * h.real - weight.imag * h.imag
            rate += weight.real * h_rate.real - weight.imag * h_rate.imag
            fast = fast - own if k + 1 < active else 0.0
            speed = own * scalars.size[k]
            scale_rate += speed
            bend += speed * scalars.size[k]
    found[0], found[1] = value, rate
    if upper < math.inf:
        scale += abs(upper)
    if lower > -math.inf:
        scale += abs(lower)
    found[2] = AT_WALL * (scale + 0.1 * scalars.omega * size_of_sine * motion.clock[0])
    found[3] = AT_WALL * scale_rate
    # at the wall and leaving it with speed: the parabola returns later
    if up == 0.0 and rate < 0.0:
        up = _first_meeting(0.0, rate, bend + pull + twist)
    if down == 0.0 and rate > 0.0:
        down = _first_meeting(0.0, -rate, bend - pull + twist)
    found[4] = down if upper - value < value - lower else up
    return min(up, down)


@apart
def derivatives(r: int, scalars: Scalars, motion: Motion, phase: complex, search: Search) -> None:
    """Second and third derivative of scalar r, and bounds on the second to fourth: found[0:5].

    `search` is as `measure` leaves it.
    """
    size, power, found = search.size, search.power, search.found
    turned = scalars.sine[r] * phase
    size_of_sine = math.sqrt(turned.real * turned.real + turned.imag * turned.imag)
    omega, d = scalars.omega, motion.drive
    second, third = -(omega**2) * turned.real, omega**3 * turned.imag
    size2, size3, size4 = omega**2 * size_of_sine, omega**3 * size_of_sine, omega**4 * size_of_sine
    if scalars.broken:
        _, _, pull, twist = taylor(scalars.follow, r, d)
        second, third, size2, size3 = second + pull, third + twist, size2 + abs(pull), size3 + abs(twist)
    for i in range(scalars.rigid_body_given.size):
        p, q = scalars.rigid_body_weight[r, i], scalars.rigid_body_rate_weight[r, i]
        push, growth = rigid_body_push(i, scalars, motion)
        pull, twist = p * push + q * growth, p * growth
        second, third, size2, size3 = second + pull, third + twist, size2 + abs(pull), size3 + abs(twist)
    multiply(scalars, power[0], power[1])
    multiply(scalars, power[1], power[2])
    for k in range(scalars.size.size):
        second += (scalars.weight[r, k] * power[1, k]).real
        third += (scalars.weight[r, k] * power[2, k]).real
        own = scalars.weight_size[r, k] * size[k] * scalars.size[k] ** 2
        size2 += own
        size3 += own * scalars.size[k]
        size4 += own * scalars.size[k] ** 2
    found[0], found[1], found[2], found[3], found[4] = second, third, size2, size3, size4


@inlined
def value_now(r: int, active: int, phase: complex, scalars: Scalars, motion: Motion) -> float:
    """Scalar r at the present time, of the first entries that are active."""
    value = scalars.constant[r] + (scalars.sine[r] * phase).real
    if scalars.broken:
        value += taylor(scalars.follow, r, motion.drive)[0]
    for k in range(active):
        w, h = scalars.weight[r, k], motion.entry[k]
        value += w.real * h.real - w.imag * h.imag
    for p in range(scalars.rigid_body_given.size):
        value += scalars.rigid_body_weight[r, p] * motion.rigid_body[p]
        value += scalars.rigid_body_rate_weight[r, p] * motion.rigid_body_rate[p]
    return float(value)


@apart
def rates_now(r: int, scalars: Scalars, motion: Motion, power: Complex) -> tuple[float, float, float]:
    """Scalar r with its first and second derivative; `power` (3, K) is scratch space."""
    omega, phase, d = scalars.omega, unit_phase(scalars.omega, motion.clock), motion.drive
    turned = scalars.sine[r] * phase
    value = value_now(r, scalars.exponent.size, phase, scalars, motion)
    rate, bend = -omega * turned.imag, -(omega**2) * turned.real
    if scalars.broken:
        _, own_rate, own_bend, _ = taylor(scalars.follow, r, d)
        rate, bend = rate + own_rate, bend + own_bend
    multiply(scalars, motion.entry, power[1])
    multiply(scalars, power[1], power[2])
    for k in range(scalars.exponent.size):
        rate += (scalars.weight[r, k] * power[1, k]).real
        bend += (scalars.weight[r, k] * power[2, k]).real
    for p in range(scalars.rigid_body_given.size):
        weight, rate_weight = scalars.rigid_body_weight[r, p], scalars.rigid_body_rate_weight[r, p]
        push, growth = rigid_body_push(p, scalars, motion)
        rate += weight * motion.rigid_body_rate[p] + rate_weight * push
        bend += weight * push + rate_weight * growth
    return value, rate, bend
