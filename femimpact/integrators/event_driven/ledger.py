"""The energy ledger between events: exact integrals of products of exponentials, or Gauss points where terms mix."""

from __future__ import annotations

import cmath
from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.event_driven.motion import (
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
from femimpact.integrators.event_driven.states import (
    FREE,
    SEPARATING,
    Case,
    Pairs,
    Place,
    base_motion,
    gap_of,
    is_active,
    read_coordinates,
    side_of,
)
from femimpact.integrators.kernels.compiling import apart, called, inlined
from femimpact.integrators.kernels.laws import spring_potential

__all__ = [
    "BEGUN", "LARGEST_FORCE", "LASTED", "LOST", "PUSHED", "TOUCH_SPEED", "Ledger", "Products", "add_to_ledger",
    "any_compliant", "integral", "write_energy",
]  # fmt: skip

BEGUN, TOUCH_SPEED, PUSHED, LARGEST_FORCE, LASTED, LOST = range(6)
"""What a contact that has not ended adds up to: start (s), approach speed (m/s), impulse (N s), largest force (N),
duration (s) and loss (J)."""

PLACES = 16.0 * 2.220446049250313e-16
"""Rounding of a displacement as a share of the terms that make it."""


class Ledger(NamedTuple):
    """What the ledger needs of the equations, and what it has summed of one case; d coordinates, n of structure."""

    mass: NDArray[Any]  # (d,)
    damping: NDArray[Any]  # (d,)
    stiffness: NDArray[Any]  # (d,)
    load: NDArray[Any]  # (d,) per unit of s(t)
    given: NDArray[Any]  # (d,) N
    free_stiffness: NDArray[Any]  # (R,)
    work: NDArray[Any]  # (C,) J
    contact_loss: NDArray[Any]  # (C,) J
    rounding: NDArray[Any]  # (C,) J, what rounding may have made of the energies of contacts
    loss_of_mode: NDArray[Any]  # (C, n) J
    start: NDArray[Any]  # (C, 7 + n) energies that a case starts with
    everywhere: bool  # or only through compliant contacts, for the table of impacts


class Products(NamedTuple):
    """Working space for integrals of products: T terms of a motion, its entries, its sine, and what is constant."""

    before: NDArray[Any]  # (2, d)
    after: NDArray[Any]  # (2, d)
    strength: NDArray[Any]  # (d + R, T) complex
    growth: NDArray[Any]  # (T,) complex
    plus: NDArray[Any]  # (T, T) complex
    minus: NDArray[Any]  # (T, T) complex


@inlined
def integral_of(exponent: complex, growth: complex, duration: float) -> complex:
    """Integral of e^{mu s} over the duration, growth being e^{mu duration}; a series where mu is small."""
    z = exponent * duration
    if z.real * z.real + z.imag * z.imag < 1e-4:
        return duration * (1 + z / 2 * (1 + z / 3 * (1 + z / 4 * (1 + z / 5 * (1 + z / 6 * (1 + z / 7))))))
    return (growth - 1.0) / exponent


@inlined
def integral(exponent: complex, duration: float) -> complex:
    """Integral of e^{mu s} over the duration."""
    return integral_of(exponent, cmath.exp(exponent * duration), duration)


@inlined
def _first_moment(exponent: complex, growth: complex, duration: float) -> complex:
    """Integral of s e^{mu s} over the duration."""
    z = exponent * duration
    if z.real * z.real + z.imag * z.imag < 1e-2:
        series = 1 / 2 + z * (1 / 3 + z * (1 / 8 + z * (1 / 30 + z * (1 / 144 + z * (1 / 840 + z / 5760)))))
        return duration * duration * series
    return (duration * growth - (growth - 1.0) / exponent) / exponent


@called
def _product(a: NDArray[Any], b: NDArray[Any], plus: NDArray[Any], minus: NDArray[Any], terms: int) -> float:
    """Integral of the product of two motions given by the strengths of their terms."""
    total = 0.0
    for k in range(terms):
        if a[k] == 0.0:
            continue
        for m in range(terms):
            if b[m] == 0.0:
                continue
            total += (a[k] * (b[m] * plus[k, m] + b[m].conjugate() * minus[k, m])).real
    return 0.5 * total


@inlined
def _exponent(k: int, watch: Watch) -> complex:
    """Exponent of a term: the entries, then the sine, then what is constant."""
    entries = watch.exponent.size
    if k < entries:
        return complex(watch.exponent[k])
    return complex(0.0, watch.omega) if k == entries else complex(0.0, 0.0)


@apart
def _integrate_terms(watch: Watch, together: NDArray[Any], duration: float, terms: int, s: Products) -> None:
    """Integrals of e^{mu_k s} e^{mu_m s} and of e^{mu_k s} conj(e^{mu_m s}) over the duration."""
    entries = watch.exponent.size
    for k in range(terms):
        s.growth[k] = cmath.exp(_exponent(k, watch) * duration)
    for k in range(terms):
        e = _exponent(k, watch)
        for m in range(k, terms):
            if m < entries and not together[k, m]:
                continue
            other = _exponent(m, watch)
            s.plus[k, m] = integral_of(e + other, s.growth[k] * s.growth[m], duration)
            s.minus[k, m] = integral_of(e + other.conjugate(), s.growth[k] * s.growth[m].conjugate(), duration)
            s.plus[m, k], s.minus[m, k] = s.plus[k, m], s.minus[k, m].conjugate()


@inlined
def any_compliant(state: NDArray[Any], rigid: NDArray[Any]) -> bool:
    """Whether a compliant contact has begun and not ended."""
    found = False
    for j in range(state.size):
        found = found or (state[j] != FREE and not rigid[j])
    return found


@apart
def add_to_ledger(
    c: int, watch: Watch, place: Place, together: NDArray[Any], particle_sine: NDArray[Any],
    particle_given: NDArray[Any], pairs: Pairs, case: Case, mark: Flight, flight: Flight, spare: Flight,
    contact: NDArray[Any], to_modes: NDArray[Any], s: Products, b: Ledger,
) -> None:  # fmt: skip
    """Add work, losses, and what contacts give to modes, from the mark to the present state; set the mark there."""
    duration, active, moving = flight.clock[0] - mark.clock[0], False, False
    for j in range(case.state.size):
        active = active or is_active(case.state[j])
        moving = moving or (is_active(case.state[j]) and pairs.in_space[j] != 0.0)
    touching = any_compliant(case.state, pairs.rigid)
    read_coordinates(place, flight, s.after)
    if duration > 0.0:
        read_coordinates(place, mark, s.before)
        if touching:
            was = base_motion(case.omega, case.amplitude, mark)[0]
            b.contact_loss[c] += _add_separating(
                was, base_motion(case.omega, case.amplitude, flight)[0], pairs, case, contact, s
            )
        if has_blocks(watch) or moving or (watch.broken and active):
            _sum_over_points(c, duration, watch, place, pairs, case, mark, spare, contact, to_modes, s, b)
            read_coordinates(place, flight, s.after)
        else:
            terms = watch.exponent.size + (2 if watch.broken else 1)
            _integrate_terms(watch, together, duration, terms, s)
            _sum_products(c, terms, duration, watch, place, particle_sine, case.amplitude, mark, s, b)
            for p in range(place.particles):
                b.work[c] += _work_on_particle(watch, mark, flight, p, particle_sine[p], particle_given[p, 0])
            for j in range(case.state.size):
                if is_active(case.state[j]) and not pairs.rigid[j]:
                    loss = _add_contact(j, terms, watch, case.damping[j], pairs.direction, mark, to_modes[j], s)
                    b.contact_loss[c] += loss
                    contact[LOST, j] += loss
        if touching:
            b.rounding[c] += _rounding(pairs, case, contact, s.after)
    copy_flight(flight, mark)


@apart
def _sum_products(
    c: int, terms: int, duration: float, watch: Watch, place: Place, particle_sine: NDArray[Any], amplitude: float,
    mark: Flight, s: Products, b: Ledger,
) -> None:  # fmt: skip
    """Work on what the entries move, and the loss of every mode."""
    entries, phase, drive = watch.exponent.size, unit_phase(watch.omega, mark.clock), mark.drive
    # s(t) = amplitude sin(theta) = Re(-i amplitude e^{i theta}), or s + s' t
    wave = complex(0.0, -amplitude) * phase
    work = 0.0
    for i in range(b.mass.size):
        strength = s.strength[i]
        for k in range(terms):
            strength[k] = complex(0.0, 0.0)
        for m in range(place.first[i], place.first[i + 1]):
            k = place.members[m]
            strength[k] = place.shape_rate[i, k] * mark.entry[k]
        harmonic = place.harmonic[i]
        for p in range(place.particles):
            harmonic -= place.particle_shape[i, p] * particle_sine[p]
        strength[entries] = complex(0.0, watch.omega) * harmonic * phase
        if watch.broken:
            strength[entries + 1] = complex(place.follow[2, i] * drive[3], 0.0)
        driven = 0.0
        for k in range(terms):
            if strength[k] == 0.0:
                continue
            if watch.broken:
                e = _exponent(k, watch)
                both = drive[2] * integral_of(e, s.growth[k], duration)
                driven += (strength[k] * (both + drive[3] * _first_moment(e, s.growth[k], duration))).real
            else:
                driven += (
                    0.5 * (strength[k] * (wave * s.plus[k, entries] + wave.conjugate() * s.minus[k, entries])).real
                )
        work += b.load[i] * driven + b.given[i] * (s.after[0, i] - s.before[0, i])
        if b.damping[i] > 0.0:
            b.loss_of_mode[c, i] += b.damping[i] * _product(strength, strength, s.plus, s.minus, terms)
    b.work[c] += work


@inlined
def _work_on_particle(
    watch: Watch, mark: Flight, flight: Flight, p: int, turned: complex, given: float
) -> float:  # fmt: skip
    """What its drive does on a rigid-body coordinate of unit mass: all that its kinetic energy gains.

    The work of constant forces is in that of the coordinates already.
    """
    before, after = mark.particle_rate[p], flight.particle_rate[p]
    way = flight.particle[p] - mark.particle[p]
    if not watch.broken:
        was, now = turned * unit_phase(watch.omega, mark.clock), turned * unit_phase(watch.omega, flight.clock)
        before, after = before - watch.omega * was.imag, after - watch.omega * now.imag
        way += now.real - was.real
    gained: float = 0.5 * (after * after - before * before) - given * way
    return gained


@apart
def _add_contact(
    j: int, terms: int, watch: Watch, damping: float, direction: NDArray[Any], mark: Flight, to_modes: NDArray[Any],
    s: Products,
) -> float:  # fmt: skip
    """Loss of one contact, and work of its force on every mode."""
    d, entries, r = s.before.shape[1], watch.exponent.size, direction.shape[0] + j
    rate = s.strength[d + j]
    for k in range(terms):
        rate[k] = complex(0.0, 0.0)
        for i in range(d):
            rate[k] -= direction[j, i] * s.strength[i, k]
    loss: float = damping * _product(rate, rate, s.plus, s.minus, terms)
    # the loss is summed: its row may now hold the force
    force = rate
    for k in range(entries):
        force[k] = watch.weight[r, k] * mark.entry[k]
    force[entries] = watch.sine[r] * unit_phase(watch.omega, mark.clock)
    for i in range(to_modes.size):
        work = _product(force, s.strength[i], s.plus, s.minus, terms)
        work += watch.constant[r] * (s.after[0, i] - s.before[0, i])
        to_modes[i] += direction[j, i] * work
    return loss


@apart
def _sum_over_points(
    c: int, duration: float, watch: Watch, place: Place, pairs: Pairs, case: Case, mark: Flight, spare: Flight,
    contact: NDArray[Any], to_modes: NDArray[Any], s: Products, b: Ledger,
) -> None:  # fmt: skip
    """Work and losses by Gauss points, exact to rounding; uses `after` up."""
    copy_flight(mark, spare)
    panels, start = panels_of(watch, mark, duration), mark.clock[0]
    half = 0.5 * duration / panels
    for panel in range(panels):
        for node in range(len(NODES)):
            time, share = start + half * (2 * panel + 1 + NODES[node]), half * WEIGHTS[node]
            move(watch, spare, time - spare.clock[0])
            read_coordinates(place, spare, s.after)
            phase = unit_phase(watch.omega, spare.clock)
            acting = spare.drive[2] if watch.broken else case.amplitude * phase.imag
            base_rate = base_motion(case.omega, case.amplitude, spare)[1]
            for i in range(b.mass.size):
                v = s.after[1, i]
                b.work[c] += share * (b.load[i] * acting + b.given[i]) * v
                if b.damping[i] > 0.0:
                    b.loss_of_mode[c, i] += share * b.damping[i] * v * v
            for j in range(case.state.size):
                if not is_active(case.state[j]):
                    continue
                force = _force_now(case.state.size + j, watch, spare, phase)
                # what holds a stop in space does work where the stop moves against the base
                b.work[c] -= share * force * pairs.in_space[j] * base_rate
                if pairs.rigid[j]:
                    continue
                rate = gap_of(j, pairs.direction, pairs.in_space, s.after[1], base_rate)
                loss = share * case.damping[j] * rate * rate
                b.contact_loss[c] += loss
                contact[LOST, j] += loss
                for i in range(to_modes.shape[1]):
                    to_modes[j, i] += share * pairs.direction[j, i] * force * s.after[1, i]


@inlined
def _force_now(r: int, watch: Watch, flight: Flight, phase: complex) -> float:
    value = watch.constant[r] + (watch.sine[r] * phase).real
    if watch.broken:
        for m in range(4):
            value += watch.follow[m, r] * flight.drive[m]
    for k in range(watch.exponent.size):
        value += (watch.weight[r, k] * flight.entry[k]).real
    return float(value)


@inlined
def _add_separating(
    was: float, base: float, pairs: Pairs, case: Case, contact: NDArray[Any], s: Products
) -> float:  # fmt: skip
    """Loss of walls that spring back without force behind what leaves them."""
    loss = 0.0
    for j in range(case.state.size):
        if abs(case.state[j]) == SEPARATING:
            lost = _stored(j, pairs, case, s.before[0], was) - _stored(j, pairs, case, s.after[0], base)
            loss += lost
            contact[LOST, j] += lost
    return loss


@apart
def _stored(j: int, pairs: Pairs, case: Case, position: NDArray[Any], base: float) -> float:
    """Energy in a compliant wall."""
    x, side = gap_of(j, pairs.direction, pairs.in_space, position, base), side_of(case.state[j])
    depth = max(side * x - case.gap[0 if side > 0.0 else 1, j], 0.0)
    return float(spring_potential(depth, case.stiffness[j]))


@inlined
def _rounding(pairs: Pairs, case: Case, contact: NDArray[Any], state: NDArray[Any]) -> float:
    """Bound on what rounding makes of the energies of contacts.

    x = y - w is known to some units in the last place of y, w and the gap, and so the contact's energy to its
    largest force times that.
    """
    total = 0.0
    for j in range(case.state.size):
        if case.state[j] != FREE and not pairs.rigid[j]:
            size = abs(case.gap[0 if case.state[j] > 0.0 else 1, j])
            for i in range(state.shape[1]):
                size += abs(pairs.direction[j, i] * state[0, i])
            total += PLACES * size * contact[LARGEST_FORCE, j]
    return total


@apart
def write_energy(
    c: int, pairs: Pairs, case: Case, flight: Flight, state: NDArray[Any], b: Ledger, out: NDArray[Any]
) -> None:  # fmt: skip
    """Energies in the order of ENERGY_COLUMNS, then the loss of every mode, of the coordinates given."""
    n, base = b.loss_of_mode.shape[1], base_motion(case.omega, case.amplitude, flight)[0]
    out[0] = out[1] = out[2] = out[3] = out[5] = 0.0
    for i in range(b.mass.size):
        kinetic = 0.5 * b.mass[i] * state[1, i] ** 2
        if i < n:
            out[0] += kinetic
            out[1] += 0.5 * b.stiffness[i] * state[0, i] ** 2
            out[5] += b.loss_of_mode[c, i]
            out[7 + i] = b.loss_of_mode[c, i]
        else:
            out[2] += kinetic
    for j in range(case.state.size):
        out[3] += spring_potential(gap_of(j, pairs.direction, pairs.in_space, state[0], base), b.free_stiffness[j])
        if case.state[j] != FREE and not pairs.rigid[j]:
            out[3] += _stored(j, pairs, case, state[0], base)
    out[4], out[6] = b.work[c], b.contact_loss[c]
