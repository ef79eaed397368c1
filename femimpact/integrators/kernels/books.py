"""The ledger of flights through compliant contacts: exact integrals of products of exponentials."""

from __future__ import annotations

import cmath
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.kernels.balance import integral_of
from femimpact.integrators.kernels.compiling import called, inlined
from femimpact.integrators.kernels.crossing import (
    NODES,
    WEIGHTS,
    Flight,
    Watch,
    copy_flight,
    has_blocks,
    move,
    panels_of,
    unit_phase,
)
from femimpact.integrators.kernels.forms import CONTACT, FREE, REBOUND, Forms, Waves, read_state

__all__ = [
    "APPROACH", "DURATION", "IMPULSE", "LOSS", "PEAK", "START", "Books", "book_flight", "integral", "keep_books",
    "open_books", "write_impact",
]  # fmt: skip

PLACES = 16.0 * 2.220446049250313e-16
"""Rounding of a displacement as a share of the terms that make it."""

START, APPROACH, IMPULSE, PEAK, DURATION, LOSS = range(6)
"""Rows of `Journey.touch`: what an open contact adds up to."""

MASS, DAMPING, STIFFNESS, LOAD, GIVEN = range(5)
"""Rows of `Books.numbers`."""


class Books(NamedTuple):
    """What the ledger needs of the equations, and what it has summed.

    d coordinates, n of them structure; R pairs, S states of contact, T = K + 1 terms of a motion.
    """

    numbers: NDArray[Any]  # (5, d)
    loose: NDArray[Any]  # (S, d) whether a coordinate flies by itself
    pair: NDArray[Any]  # (3, R) stiffness and damping of its walls, free stiffness
    direction: NDArray[Any]  # (R, d) of a force on the structure
    gap: NDArray[Any]  # (2, R)
    sums: NDArray[Any]  # (cases, 3) work, contact loss, what rounding may have made of both; J
    loss_of_mode: NDArray[Any]  # (cases, n)
    kept: NDArray[Any]  # (samples,) number of the energy row that a sample fills, -1 for none
    shown: NDArray[Any]  # (samples,) number of the snapshot, -1 for none
    energy: NDArray[Any]  # (cases, rows, 7 + n)
    fields: NDArray[Any]  # (snapshots, 2, d)
    impacts: NDArray[Any]  # (most, 9 + n); see layout.IMPACT_COLUMNS, then the energy given to each mode
    tally: NDArray[Any]  # (1,) impacts met
    to_modes: NDArray[Any]  # (cases, R, n) energy that the open contacts have passed on
    before: NDArray[Any]  # (2, d) scratch
    after: NDArray[Any]  # (2, d) scratch
    strength: NDArray[Any]  # (d + R, T) complex scratch
    growth: NDArray[Any]  # (T,) complex scratch
    plus: NDArray[Any]  # (T, T) complex scratch
    minus: NDArray[Any]  # (T, T) complex scratch
    together: NDArray[Any]  # (S, T, T) whether the product of two terms occurs in any sum
    spare: Flight  # scratch


@inlined
def integral(exponent: complex, duration: float) -> complex:
    """Integral of e^{mu s} over the duration."""
    return integral_of(exponent, cmath.exp(exponent * duration), duration)


@inlined
def _product(a: NDArray[Any], b: NDArray[Any], plus: NDArray[Any], minus: NDArray[Any]) -> float:
    """Integral of the product of two motions given by the strengths of their terms."""
    total = 0.0
    for k in range(a.size):
        if a[k] == 0.0:
            continue
        for m in range(b.size):
            if b[m] == 0.0:
                continue
            total += (a[k] * (b[m] * plus[k, m] + b[m].conjugate() * minus[k, m])).real
    return 0.5 * total


@inlined
def _integrate_terms(exponent: NDArray[Any], together: NDArray[Any], omega: float, duration: float, b: Books) -> None:
    """Integrals of e^{mu_k s} e^{mu_m s} and of e^{mu_k s} conj(e^{mu_m s}) over the duration."""
    terms, wave = exponent.size + 1, complex(0.0, omega)
    for k in range(terms):
        e = exponent[k] if k + 1 < terms else wave
        b.growth[k] = cmath.exp(e * duration)
    for k in range(terms):
        e = exponent[k] if k + 1 < terms else wave
        for m in range(k, terms):
            if not together[k, m]:
                continue
            f = exponent[m] if m + 1 < terms else wave
            b.plus[k, m] = integral_of(e + f, b.growth[k] * b.growth[m], duration)
            b.minus[k, m] = integral_of(e + f.conjugate(), b.growth[k] * b.growth[m].conjugate(), duration)
            b.plus[m, k], b.minus[m, k] = b.plus[k, m], b.minus[k, m].conjugate()


@inlined
def _penetration(j: int, state: NDArray[Any], side: float, b: Books) -> float:
    x = 0.0
    for i in range(state.shape[1]):
        x -= b.direction[j, i] * state[0, i]
    depth: float = max(side * x - b.gap[0 if side > 0.0 else 1, j], 0.0)
    return depth


@called
def book_flight(
    c: int, number: int, forms: Forms, waves: Waves, watch: Watch, mode: NDArray[Any], mark: Flight, flight: Flight,
    touch: NDArray[Any], b: Books,
) -> None:  # fmt: skip
    """Add work of the drive, losses of modes and contacts, and what contacts give to modes, since the mark; set it."""
    duration, d, last = flight.clock[0] - mark.clock[0], b.numbers.shape[1], watch.exponent.size
    harmonic, omega = waves.harmonic[c, number], watch.omega
    read_state(number, forms, harmonic, omega, mark, b.before)
    read_state(number, forms, harmonic, omega, flight, b.after)
    if has_blocks(watch):
        _sum_over_nodes(c, number, forms, waves, watch, mode, mark, duration, touch, b)
        read_state(number, forms, harmonic, omega, flight, b.after)
        for j in range(mode.size):
            if mode[j] != FREE:
                _add_rounding(c, j, touch, b)
        copy_flight(flight, mark)
        return
    _integrate_terms(watch.exponent, b.together[number], omega, duration, b)
    phase = unit_phase(omega, mark.clock)
    for i in range(d):
        for k in range(last):
            b.strength[i, k] = forms.shape_rate[number, i, k] * mark.entry[k]
        b.strength[i, last] = complex(0.0, omega) * harmonic[i] * phase
    # s(t) = amplitude sin(theta) = Re(-i amplitude e^{i theta})
    s = complex(0.0, -waves.amplitude[c]) * phase
    work = 0.0
    for i in range(d):
        if b.loose[number, i] != 0.0:
            work += 0.5 * b.numbers[MASS, i] * (b.after[1, i] ** 2 - b.before[1, i] ** 2)
            continue
        drive = 0.0
        for k in range(last + 1):
            strength = b.strength[i, k]
            if strength == 0.0:
                continue
            drive += (strength * (s * b.plus[k, last] + s.conjugate() * b.minus[k, last])).real
        work += 0.5 * b.numbers[LOAD, i] * drive + b.numbers[GIVEN, i] * (b.after[0, i] - b.before[0, i])
        if b.numbers[DAMPING, i] > 0.0:
            b.loss_of_mode[c, i] += b.numbers[DAMPING, i] * _product(b.strength[i], b.strength[i], b.plus, b.minus)
    b.sums[c, 0] += work
    for j in range(mode.size):
        if mode[j] != FREE:
            _add_rounding(c, j, touch, b)
        if abs(mode[j]) == REBOUND:
            _add_rebound(c, j, mode[j], touch, b)
        elif mode[j] != FREE:
            _add_contact(c, j, watch, mode[j], mark, phase, touch, b)
    copy_flight(flight, mark)


@inlined
def _add_rounding(c: int, j: int, touch: NDArray[Any], b: Books) -> None:
    """Add a bound on what rounding makes of a contact's energy, from the state last read.

    x = y - w is known to some units in the last place of y, w and the gap, and so the contact's energy to its
    largest force times that.
    """
    size = 0.0
    for i in range(b.after.shape[1]):
        size += abs(b.direction[j, i] * b.after[0, i])
    b.sums[c, 2] += PLACES * size * touch[PEAK, j]


@inlined
def _add_rebound(c: int, j: int, mode: float, touch: NDArray[Any], b: Books) -> None:
    """Loss of a wall that springs back behind the ball."""
    side = 1.0 if mode > 0.0 else -1.0
    was, left = _penetration(j, b.before, side, b), _penetration(j, b.after, side, b)
    loss = 0.5 * b.pair[0, j] * (was * was - left * left)
    b.sums[c, 1] += loss
    touch[LOSS, j] += loss


@inlined
def _add_contact(
    c: int, j: int, watch: Watch, mode: float, mark: Flight, phase: complex, touch: NDArray[Any], b: Books
) -> None:
    """Loss of one contact, and work of its force on every mode."""
    d, last, pairs = b.numbers.shape[1], watch.exponent.size, b.gap.shape[1]
    side = 1.0 if mode > 0.0 else -1.0
    rate = b.strength[d + j]
    for k in range(last + 1):
        rate[k] = complex(0.0, 0.0)
        for i in range(d):
            rate[k] -= b.direction[j, i] * b.strength[i, k]
    loss = b.pair[1, j] * _product(rate, rate, b.plus, b.minus)
    # the loss is summed: its row may now hold the force
    force = rate
    for k in range(last):
        force[k] = watch.weight[pairs + j, k] * mark.entry[k]
    force[last] = watch.sine[pairs + j] * phase
    wall = watch.constant[pairs + j] - side * b.pair[0, j] * b.gap[0 if side > 0.0 else 1, j]
    for i in range(b.to_modes.shape[2]):
        work = _product(force, b.strength[i], b.plus, b.minus) + wall * (b.after[0, i] - b.before[0, i])
        b.to_modes[c, j, i] += b.direction[j, i] * work
    b.sums[c, 1] += loss
    touch[LOSS, j] += loss


@called
def _sum_over_nodes(
    c: int, number: int, forms: Forms, waves: Waves, watch: Watch, mode: NDArray[Any], mark: Flight, duration: float,
    touch: NDArray[Any], b: Books,
) -> None:  # fmt: skip
    """Work and losses where entries do not stand alone: by Gauss points, exact to rounding; uses `after` up."""
    for j in range(mode.size):
        if abs(mode[j]) == REBOUND:
            _add_rebound(c, j, mode[j], touch, b)
    copy_flight(mark, b.spare)
    panels = panels_of(watch, mark, duration)
    half, start, pairs = 0.5 * duration / panels, mark.clock[0], b.gap.shape[1]
    for panel in range(panels):
        for node in range(len(NODES)):
            time, share = start + half * (2 * panel + 1 + NODES[node]), half * WEIGHTS[node]
            move(watch, b.spare, time - b.spare.clock[0])
            read_state(number, forms, waves.harmonic[c, number], watch.omega, b.spare, b.after)
            s = waves.amplitude[c] * unit_phase(watch.omega, b.spare.clock).imag
            for i in range(b.numbers.shape[1]):
                v = b.after[1, i]
                b.sums[c, 0] += share * (b.numbers[LOAD, i] * s + b.numbers[GIVEN, i]) * v
                if b.numbers[DAMPING, i] > 0.0:
                    b.loss_of_mode[c, i] += share * b.numbers[DAMPING, i] * v * v
            for j in range(pairs):
                if abs(mode[j]) != CONTACT:
                    continue
                side, x, rate = 1.0 if mode[j] > 0.0 else -1.0, 0.0, 0.0
                for i in range(b.numbers.shape[1]):
                    x -= b.direction[j, i] * b.after[0, i]
                    rate -= b.direction[j, i] * b.after[1, i]
                loss = share * b.pair[1, j] * rate * rate
                b.sums[c, 1] += loss
                touch[LOSS, j] += loss
                depth = x - side * b.gap[0 if side > 0.0 else 1, j]
                force = b.pair[0, j] * depth + b.pair[1, j] * rate
                for i in range(b.to_modes.shape[2]):
                    b.to_modes[c, j, i] += share * b.direction[j, i] * force * b.after[1, i]


@inlined
def open_books(c: int, j: int, b: Books) -> None:
    """A contact begins."""
    for i in range(b.to_modes.shape[2]):
        b.to_modes[c, j, i] = 0.0


@inlined
def write_impact(c: int, j: int, side: float, rebound: float, touch: NDArray[Any], b: Books) -> None:
    """Add a finished impact to the table."""
    row = b.tally[0]
    if row < b.impacts.shape[0]:
        out = b.impacts[row]
        out[0], out[1], out[2], out[3], out[4] = touch[START, j], j, side, touch[APPROACH, j], rebound
        out[5], out[6], out[7], out[8] = touch[IMPULSE, j], touch[PEAK, j], touch[DURATION, j], touch[LOSS, j]
        for i in range(b.to_modes.shape[2]):
            out[9 + i] = b.to_modes[c, j, i]
    b.tally[0] = row + 1


@inlined
def keep_books(
    c: int, number: int, i: int, forms: Forms, waves: Waves, watch: Watch, mode: NDArray[Any], flight: Flight,
    mark: Flight, touch: NDArray[Any], b: Books,
) -> None:  # fmt: skip
    """Energies and the whole motion at sample i, where they are kept."""
    row, snapshot = b.kept[i], b.shown[i]
    if row >= 0 and b.energy.shape[1] > 0:
        book_flight(c, number, forms, waves, watch, mode, mark, flight, touch, b)
        _write_energy(c, mode, b, b.energy[c, row])
    if snapshot >= 0:
        read_state(number, forms, waves.harmonic[c, number], watch.omega, flight, b.after)
        for m in range(b.after.shape[1]):
            b.fields[snapshot, 0, m], b.fields[snapshot, 1, m] = b.after[0, m], b.after[1, m]


@inlined
def _write_energy(c: int, mode: NDArray[Any], b: Books, out: NDArray[Any]) -> None:
    """Energies in the order of ENERGY_COLUMNS, then the loss of every mode, from the coordinates last read."""
    n = b.loss_of_mode.shape[1]
    out[0] = out[1] = out[2] = out[3] = out[5] = 0.0
    for i in range(b.numbers.shape[1]):
        kinetic = 0.5 * b.numbers[MASS, i] * b.after[1, i] ** 2
        if i < n:
            out[0] += kinetic
            out[1] += 0.5 * b.numbers[STIFFNESS, i] * b.after[0, i] ** 2
            out[5] += b.loss_of_mode[c, i]
            out[7 + i] = b.loss_of_mode[c, i]
        else:
            out[2] += kinetic
    for j in range(mode.size):
        x = 0.0
        for i in range(b.numbers.shape[1]):
            x -= b.direction[j, i] * b.after[0, i]
        out[3] += 0.5 * b.pair[2, j] * x * x
        if mode[j] != FREE:
            depth = _penetration(j, b.after, 1.0 if mode[j] > 0.0 else -1.0, b)
            out[3] += 0.5 * b.pair[0, j] * depth * depth
    out[4], out[6] = b.sums[c, 0], b.sums[c, 1]
