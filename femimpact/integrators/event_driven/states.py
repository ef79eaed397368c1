"""Closed forms of the contact states that have occurred, and how a motion is taken from one to another."""

from __future__ import annotations

import math

from femimpact.integrators.compiled.compiling import apart, called, inlined
from femimpact.integrators.event_driven.loop_data import (
    CONTACT,
    FREE,
    Bounds,
    Case,
    Cases,
    Form,
    Forms,
    Pairs,
    Shapes,
)
from femimpact.integrators.event_driven.motion import (
    STICKS,
    Array,
    Complex,
    Motion,
    Scalars,
    unit_phase,
)

__all__ = [
    "base_motion", "enter_form", "find_form", "form_of", "gap_of", "gap_on", "is_active", "read_coordinates",
    "set_bounds", "set_steady_motion", "set_walls", "side_of", "turn_knot",
]  # fmt: skip

RESONANCE = 1e-9
"""Distance of an undamped natural frequency from that of the drive, as a share of it, below which they are one."""


@inlined
def side_of(state: float) -> float:
    """Side of the wall of a pair in contact or separating."""
    return 1.0 if state > 0.0 else -1.0


@inlined
def gap_on(side: float, j: int, case: Case) -> float:
    """Gap (m) of a pair on one side."""
    return float(case.gap_plus[j] if side > 0.0 else case.gap_minus[j])


@inlined
def is_active(state: float) -> bool:
    """Whether a pair is in contact."""
    return abs(state) == CONTACT


@inlined
def find_form(state: Array, first: int, forms: Forms) -> int:
    """Number of the closed form for these contact states, or -1 if it was not made before."""
    key = 0
    for j in range(state.size):
        if is_active(state[j]):
            key |= 1 << j
    f = first
    while 0 <= f < forms.made and forms.key[f] != key:
        f = forms.following[f]
    return f if f < forms.made else -1


@inlined
def base_motion(case: Case, motion: Motion) -> tuple[float, float]:
    """Displacement and velocity of the base, by which stops fixed in space move against it."""
    omega = case.omega
    if omega == 0.0:
        return motion.drive[0], motion.drive[1]
    # s = amplitude sin(theta) is the second derivative
    phase = unit_phase(omega, motion.clock)
    return -case.amplitude * phase.imag / (omega * omega), -case.amplitude * phase.real / omega


@apart
def set_steady_motion(f: int, case: Case, cases: Cases, forms: Forms, h: Complex) -> bool:
    """Steady motion under a sine in one form; False where it is unbounded. `h` (2, K) is scratch space."""
    c, n, omega = case.number, forms.number[f], case.omega
    sine, harmonic, rigid_body_sine = cases.sine[c, n], cases.harmonic[c, n], cases.rigid_body_sine[c, n]
    wave, of_base = complex(0.0, -case.amplitude), -1.0 / (omega * omega)
    of_speed = complex(0.0, omega * of_base)
    last, rigid_bodies = forms.entries[f], forms.rigid_bodies[f]
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
    for p in range(rigid_bodies):
        rigid_body_sine[p] = forms.rigid_body_drive[f, p] * of_base * wave
    for r in range(sine.size):
        total = forms.through[f, 0, r] + of_speed * forms.through[f, 1, r] + of_base * forms.through[f, 2, r]
        for k in range(last):
            w = forms.weight[f, r, k]
            total += w * h[0, k] + (w * h[1, k]).conjugate()
        sine[r] = total * wave
        for p in range(rigid_bodies):
            q = forms.rigid_body_weight[f, r, p] + complex(0.0, omega) * forms.rigid_body_rate_weight[f, r, p]
            sine[r] += q * rigid_body_sine[p]
    for i in range(harmonic.size):
        total = complex(of_base * forms.position_through[f, i], 0.0)
        for k in range(last):
            w = forms.shape[f, i, k]
            total += w * h[0, k] + (w * h[1, k]).conjugate()
        harmonic[i] = total * wave
        for p in range(rigid_bodies):
            harmonic[i] += forms.rigid_body_shape[f, i, p] * rigid_body_sine[p]
    return True


@inlined
def form_of(f: int, case: Case, cases: Cases, forms: Forms, bounds: Bounds) -> Form:
    """A closed form as the search, the readings and the ledger of a case take it."""
    c, n, last, rigid_bodies = case.number, forms.number[f], forms.entries[f], forms.rigid_bodies[f]
    broken = case.omega == 0.0
    # what a sine does to a rigid-body coordinate is in the steady motion
    drive = forms.rigid_body_drive[f][:rigid_bodies] if broken else bounds.nothing[:rigid_bodies]
    scalars = Scalars(
        forms.exponent[f][:last], forms.coupling[f], forms.blocks[f], forms.size[f][:last], case.omega, broken,
        bounds.given[:rigid_bodies], drive, bounds.lasting, bounds.upper, bounds.lower, forms.weight[f],
        forms.weight_size[f], forms.rigid_body_weight[f], forms.rigid_body_rate_weight[f], cases.sine[c, n],
        bounds.constant, forms.follow[f], bounds.steady[0], bounds.steady[1],
    )  # fmt: skip
    shapes = Shapes(
        case.omega, forms.shape[f], forms.shape_rate[f], forms.rigid_body_shape[f], bounds.static,
        cases.harmonic[c, n], forms.position_follow[f], forms.first[f], forms.members[f], rigid_bodies,
    )  # fmt: skip
    return Form(
        scalars, shapes, forms.together[f], cases.rigid_body_sine[c, n], forms.impulse_entry[f],
        forms.impulse_rigid_body[f], forms.reaction[f], forms.rigid_body_given[f],
    )  # fmt: skip


@apart
def set_walls(f: int, case: Case, forms: Forms, bounds: Bounds) -> None:
    """What constant loads and the walls in contact add to every scalar, coordinate and rigid-body coordinate."""
    wall = bounds.wall
    wall[0] = 1.0
    for j in range(case.state.size):
        side = side_of(case.state[j])
        wall[1 + j] = 0.0 if case.state[j] == FREE else side * gap_on(side, j, case)
    _multiply(forms.constant[f], wall, bounds.constant)
    _multiply(forms.static[f], wall, bounds.static)
    _multiply(forms.rigid_body_given[f], wall, bounds.given)


@called
def _multiply(matrix: Array, vector: Array, out: Array) -> None:
    for r in range(out.size):
        total = 0.0
        for w in range(vector.size):
            total += matrix[r, w] * vector[w]
        out[r] = total


@apart
def set_bounds(pairs: Pairs, case: Case, s: Bounds) -> None:
    """Bounds of the watched scalars, and the side of a contact that lasts."""
    state, count = case.state, case.state.size
    for j in range(count):
        side = side_of(state[j])
        for r in (j, count + j):
            s.upper[r], s.lower[r], s.lasting[r] = math.inf, -math.inf, 0.0
        if state[j] == FREE:
            s.upper[j], s.lower[j] = case.gap_plus[j], -case.gap_minus[j]
        elif is_active(state[j]):
            s.lasting[count + j] = side * (STICKS if pairs.rigid[j] else 1.0)
            if side > 0.0:
                s.lower[count + j] = 0.0
            else:
                s.upper[count + j] = 0.0
        elif side > 0.0:
            s.lower[j], s.upper[count + j] = case.gap_plus[j], 0.0
        else:
            s.upper[j], s.lower[count + j] = -case.gap_minus[j], 0.0


@apart
def read_coordinates(shapes: Shapes, motion: Motion, out: Array) -> None:
    """Displacements and velocities of all coordinates (2, d) at the present time."""
    omega, d = shapes.omega, motion.drive
    phase = unit_phase(omega, motion.clock)
    for i in range(out.shape[1]):
        turned = shapes.harmonic[i] * phase
        x, v = shapes.static[i] + turned.real, -omega * turned.imag
        if omega == 0.0:
            a, b, c, e = shapes.follow[0, i], shapes.follow[1, i], shapes.follow[2, i], shapes.follow[3, i]
            x += a * d[0] + b * d[1] + c * d[2] + e * d[3]
            v += a * d[1] + b * d[2] + c * d[3]
        for m in range(shapes.first[i], shapes.first[i + 1]):
            k = shapes.members[m]
            h, shape, rate = motion.entry[k], shapes.shape[i, k], shapes.shape_rate[i, k]
            x += shape.real * h.real - shape.imag * h.imag
            v += rate.real * h.real - rate.imag * h.imag
        for p in range(shapes.rigid_bodies):
            x += shapes.rigid_body_shape[i, p] * motion.rigid_body[p]
            v += shapes.rigid_body_shape[i, p] * motion.rigid_body_rate[p]
        out[0, i], out[1, i] = x, v


@apart
def enter_form(f: int, shapes: Shapes, forms: Forms, state: Array, motion: Motion) -> None:
    """The homogeneous part and the rigid-body coordinates of coordinates (2, d) in a form; these are used up."""
    entries, from_u, from_v, to_rigid_body = (
        forms.entries[f], forms.to_entry_u[f], forms.to_entry_v[f], forms.to_rigid_body[f],
    )  # fmt: skip
    omega, d = shapes.omega, motion.drive
    phase = unit_phase(omega, motion.clock)
    for i in range(state.shape[1]):
        turned = shapes.harmonic[i] * phase
        state[0, i] -= shapes.static[i] + turned.real
        state[1, i] += omega * turned.imag
        if omega == 0.0:
            a, b, c, e = shapes.follow[0, i], shapes.follow[1, i], shapes.follow[2, i], shapes.follow[3, i]
            state[0, i] -= a * d[0] + b * d[1] + c * d[2] + e * d[3]
            state[1, i] -= a * d[1] + b * d[2] + c * d[3]
    for k in range(entries):
        total = complex(0.0, 0.0)
        for i in range(state.shape[1]):
            total += from_u[k, i] * state[0, i] + from_v[k, i] * state[1, i]
        motion.entry[k] = total
    for p in range(shapes.rigid_bodies):
        x, v = 0.0, 0.0
        for i in range(state.shape[1]):
            x += to_rigid_body[p, i] * state[0, i]
            v += to_rigid_body[p, i] * state[1, i]
        motion.rigid_body[p], motion.rigid_body_rate[p] = x, v


@inlined
def gap_of(j: int, pairs: Pairs, values: Array, base: float) -> float:
    """The x of a pair, or its rate, from the coordinates, or their rates, and the base's."""
    x = -pairs.in_space[j] * base
    for i in range(values.size):
        x -= pairs.direction[j, i] * values[i]
    return float(x)


@apart
def turn_knot(index: int, f: int, cases: Cases, forms: Forms, motion: Motion) -> None:
    """A new straight piece of s(t) from a knot on: what the steady motion changes by is taken up by the entries."""
    knots, interval, entries = cases.knots, cases.knot_interval, forms.entries[f]
    follow, from_u, from_v = forms.position_follow[f], forms.to_entry_u[f], forms.to_entry_v[f]
    d, value, slope = motion.drive, 0.0, 0.0
    if index < knots.size - 1:
        value, slope = knots[index], (knots[index + 1] - knots[index]) / interval
    jump, jump_rate = value - d[2], slope - d[3]
    d[2], d[3] = value, slope
    for i in range(follow.shape[1]):
        x = follow[2, i] * jump + follow[3, i] * jump_rate
        v = follow[1, i] * jump + follow[2, i] * jump_rate
        for k in range(entries):
            motion.entry[k] -= from_u[k, i] * x + from_v[k, i] * v
