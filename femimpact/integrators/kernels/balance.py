"""Energies of a closed-form flight: work and loss as exact integrals of products of exponentials."""

from __future__ import annotations

import cmath
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import called, inlined
from femimpact.integrators.kernels.crossing import (
    NODES,
    WEIGHTS,
    Flight,
    Space,
    copy_flight,
    has_blocks,
    move,
    panels_of,
    read_coordinates,
    unit_phase,
)

__all__ = ["Balance", "book_flight", "integral_of", "write_balance"]


class Balance(NamedTuple):
    """What the ledger needs of the equations, and what it has summed; d coordinates, n of them structure."""

    mass: NDArray[Any]  # (d,)
    damping: NDArray[Any]  # (d,)
    stiffness: NDArray[Any]  # (d,)
    load: NDArray[Any]  # (d,) per unit of s(t)
    given: NDArray[Any]  # (d,) constant force
    force: NDArray[Any]  # (d, R) direction of a force on the structure at each pair
    spring: NDArray[Any]  # (R,) free stiffness
    structure: NDArray[Any]  # (1,) n
    loss_of_mode: NDArray[Any]  # (n,)
    sums: NDArray[Any]  # (2,) work, contact loss
    growth: NDArray[Any]  # (K + 2,) complex scratch
    strength: NDArray[Any]  # (K + 2,) complex scratch
    position: NDArray[Any]  # (d,) scratch
    velocity: NDArray[Any]  # (d,) scratch
    spare: Flight  # scratch, of the size of the motion


@inlined
def integral_of(exponent: complex, growth: complex, duration: float) -> complex:
    """Integral of e^{mu s} over the duration, growth being e^{mu duration}; a series where mu is small."""
    z = exponent * duration
    if z.real * z.real + z.imag * z.imag < 1e-4:
        return duration * (1 + z / 2 * (1 + z / 3 * (1 + z / 4 * (1 + z / 5 * (1 + z / 6 * (1 + z / 7))))))
    return (growth - 1.0) / exponent


@inlined
def _first_moment(exponent: complex, growth: complex, duration: float) -> complex:
    """Integral of s e^{mu s} over the duration."""
    z = exponent * duration
    if z.real * z.real + z.imag * z.imag < 1e-2:
        series = 1 / 2 + z * (1 / 3 + z * (1 / 8 + z * (1 / 30 + z * (1 / 144 + z * (1 / 840 + z / 5760)))))
        return duration * duration * series
    return (duration * growth - (growth - 1.0) / exponent) / exponent


@called
def book_flight(space: Space, flight: Flight, duration: float, amplitude: float, b: Balance) -> None:
    """Add work of the drive and loss of every mode over a flight that starts at the present state."""
    if has_blocks(space.watch):
        _sum_over_nodes(space, flight, duration, amplitude, b)
        return
    phase = unit_phase(space.watch.omega, flight.clock)
    wave = complex(0.0, space.watch.omega)
    entries = space.watch.exponent.size
    for k in range(entries):
        b.growth[k] = cmath.exp(space.watch.exponent[k] * duration)
    b.growth[entries] = cmath.exp(wave * duration)
    b.growth[entries + 1] = 1.0
    # s(t) = amplitude sin(theta) = Re(-i amplitude e^{i theta}), or s0 + slope t
    s = complex(0.0, -amplitude) * phase
    work = 0.0
    for i in range(b.mass.size):
        work += _book_coordinate(i, space, flight, duration, phase, s, b)
    for m in range(flight.particle.size):
        work += _work_on_particle(m, space, flight, duration, phase, wave)
    b.sums[0] += work


@called
def _sum_over_nodes(space: Space, flight: Flight, duration: float, amplitude: float, b: Balance) -> None:
    """The same where entries do not stand alone: by Gauss points, exact to rounding."""
    copy_flight(flight, b.spare)
    panels = panels_of(space.watch, flight, duration)
    half, start = 0.5 * duration / panels, flight.clock[0]
    for panel in range(panels):
        for node in range(len(NODES)):
            time = start + half * (2 * panel + 1 + NODES[node])
            move(space.watch, b.spare, time - b.spare.clock[0])
            phase = unit_phase(space.watch.omega, b.spare.clock)
            read_coordinates(space, b.spare, phase, b.position, b.velocity)
            s = b.spare.clock[1] if space.watch.broken else amplitude * phase.imag
            for i in range(b.mass.size):
                v, share = b.velocity[i], half * WEIGHTS[node]
                b.sums[0] += share * (b.load[i] * s + b.given[i]) * v
                if b.damping[i] > 0.0:
                    b.loss_of_mode[i] += share * b.damping[i] * v * v


@inlined
def _book_coordinate(
    i: int, space: Space, flight: Flight, duration: float, phase: complex, s: complex, b: Balance
) -> float:
    """Work on one coordinate (its particles left out), its loss added to its mode."""
    entries, wave = space.watch.exponent.size, complex(0.0, space.watch.omega)
    first, count = space.first[i], space.first[i + 1] - space.first[i]
    # the members, then the steady sine, then the steady straight line
    for m in range(count):
        k = space.members[first + m]
        b.strength[m] = space.shape[i, k] * flight.entry[k] * space.watch.exponent[k]
    b.strength[count] = wave * space.bound_sine[i] * phase
    b.strength[count + 1] = space.shape_follow[i] * flight.clock[2] if space.watch.broken else 0.0
    terms = count + 2 if space.watch.broken else count + 1
    work, loss = 0.0, 0.0
    for p in range(terms):
        k = space.members[first + p] if p < count else entries + p - count
        e = space.watch.exponent[k] if k < entries else (wave if k == entries else complex(0.0, 0.0))
        strength, growth = b.strength[p], b.growth[k]
        if strength == 0.0:
            continue
        integral = integral_of(e, growth, duration)
        if space.watch.broken:
            moment = _first_moment(e, growth, duration)
            work += b.load[i] * (strength * (flight.clock[1] * integral + flight.clock[2] * moment)).real
        else:
            with_wave = strength * s * integral_of(e + wave, growth * b.growth[entries], duration)
            against = strength * s.conjugate() * integral_of(e - wave, growth * b.growth[entries].conjugate(), duration)
            work += 0.5 * b.load[i] * (with_wave + against).real
        work += b.given[i] * (strength * integral).real
        if b.damping[i] == 0.0:
            continue
        for q in range(p, terms):
            other = space.members[first + q] if q < count else entries + q - count
            f = space.watch.exponent[other] if other < entries else (wave if other == entries else complex(0.0, 0.0))
            both = strength * b.strength[q] * integral_of(e + f, growth * b.growth[other], duration)
            conjugate = b.strength[q].conjugate() * integral_of(
                e + f.conjugate(), growth * b.growth[other].conjugate(), duration
            )
            loss += (0.5 if q == p else 1.0) * (both + strength * conjugate).real
    if b.damping[i] > 0.0:
        b.loss_of_mode[i] += b.damping[i] * loss
    return work


@inlined
def _work_on_particle(m: int, space: Space, flight: Flight, duration: float, phase: complex, wave: complex) -> float:
    """Work of the drive and of the constant force on one particle of unit mass."""
    given, drive = space.watch.particle_given[m], space.watch.particle_drive[m]
    s, slope = flight.clock[1], flight.clock[2]
    rate = flight.particle_rate[m]
    if space.watch.broken:
        after = rate + duration * (given + drive * (s + 0.5 * duration * slope))
        gained: float = 0.5 * (after * after - rate * rate)
        return gained
    # the parabola P and the sine h of the motion, h'' being the drive: integral of (g + h'') (P' + h')
    before = space.particle_sine[m] * phase
    after_sine = before * cmath.exp(wave * duration)
    h_rate, h_rate_before = (wave * after_sine).real, (wave * before).real
    after = rate + given * duration
    parabola = given * duration * (rate + 0.5 * given * duration)
    swing = 0.5 * (h_rate * h_rate - h_rate_before * h_rate_before)
    # g h of the first product cancels that of h'' P' by parts
    work: float = parabola + swing + h_rate * after - h_rate_before * rate
    return work


@called
def write_balance(b: Balance, out: NDArray[Any]) -> None:
    """Energies in the order of ENERGY_COLUMNS from the coordinates last read."""
    n = int(b.structure[0])
    out[0] = out[1] = out[2] = out[3] = 0.0
    for i in range(b.mass.size):
        kinetic = 0.5 * b.mass[i] * b.velocity[i] * b.velocity[i]
        if i < n:
            out[0] += kinetic
            out[1] += 0.5 * b.stiffness[i] * b.position[i] * b.position[i]
        else:
            out[2] += kinetic
    for j in range(b.spring.size):
        if b.spring[j] > 0.0:
            x = 0.0
            for i in range(b.mass.size):
                x -= b.force[i, j] * b.position[i]
            out[3] += 0.5 * b.spring[j] * x * x
    loss = 0.0
    for i in range(n):
        loss += b.loss_of_mode[i]
    out[4], out[5], out[6] = b.sums[0], loss, b.sums[1]
