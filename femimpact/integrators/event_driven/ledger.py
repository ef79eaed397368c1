"""The energy ledger between events: exact integrals of products of exponentials, or Gauss points where terms mix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femimpact.integrators.compiled.compiling import apart, called, inlined
from femimpact.integrators.compiled.laws import spring_potential
from femimpact.integrators.event_driven.exponentials import cosine_and_sine, exponentials
from femimpact.integrators.event_driven.loop_data import (
    FREE,
    LARGEST_FORCE,
    LOST,
    SEPARATING,
    Case,
    Form,
    Ledger,
    Pairs,
    Products,
    Space,
)
from femimpact.integrators.event_driven.motion import (
    NODES,
    WEIGHTS,
    Array,
    Complex,
    Motion,
    Scalars,
    copy_motion,
    has_blocks,
    move,
    next_panel,
    unit_phase,
    value_now,
)
from femimpact.integrators.event_driven.states import (
    base_motion,
    gap_of,
    gap_on,
    is_active,
    read_coordinates,
    side_of,
)

__all__ = ["add_to_ledger", "any_compliant", "integral_of", "write_energy"]

PLACES = 16.0 * 2.220446049250313e-16
"""Rounding of a displacement as a share of the terms that make it."""


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
def _square(a: Complex, plus: Complex, minus: Complex, terms: int) -> float:
    """Integral of the square of a motion given by the strengths of its terms."""
    total = 0.0
    for k in range(terms):
        if a[k] == 0.0:
            continue
        total += 0.5 * (a[k] * (a[k] * plus[k, k] + a[k].conjugate() * minus[k, k])).real
        for m in range(k + 1, terms):
            if a[m] != 0.0:
                total += (a[k] * (a[m] * plus[k, m] + a[m].conjugate() * minus[k, m])).real
    return total


@inlined
def _exponent(k: int, scalars: Scalars) -> complex:
    """Exponent of a term: the entries, then the sine, then what is constant."""
    entries = scalars.exponent.size
    if k < entries:
        return complex(scalars.exponent[k])
    return complex(0.0, scalars.omega) if k == entries else complex(0.0, 0.0)


@apart
def _integrate_terms(scalars: Scalars, together: NDArray[np.bool_], duration: float, terms: int, s: Products) -> None:
    """Integrals of e^{mu_k s} e^{mu_m s} and of e^{mu_k s} conj(e^{mu_m s}) over the duration."""
    entries = scalars.exponent.size
    exponentials(scalars.exponent, duration, s.growth)
    cosine, sine = cosine_and_sine(scalars.omega * duration)
    s.growth[entries] = complex(cosine, sine)
    if terms > entries + 1:
        s.growth[entries + 1] = 1.0
    for k in range(terms):
        e = _exponent(k, scalars)
        for m in range(k, terms):
            if m < entries and not together[k, m]:
                continue
            other = _exponent(m, scalars)
            s.plus[k, m] = integral_of(e + other, s.growth[k] * s.growth[m], duration)
            s.minus[k, m] = integral_of(e + other.conjugate(), s.growth[k] * s.growth[m].conjugate(), duration)
            s.plus[m, k], s.minus[m, k] = s.plus[k, m], s.minus[k, m].conjugate()


@inlined
def any_compliant(case: Case, pairs: Pairs) -> bool:
    """Whether a compliant contact has begun and not ended."""
    found = False
    for j in range(case.state.size):
        found = found or (case.state[j] != FREE and not pairs.rigid[j])
    return found


@apart
def add_to_ledger(form: Form, pairs: Pairs, case: Case, space: Space, b: Ledger) -> None:
    """Add work, losses, and what contacts give to modes, from the mark to the present motion; set the mark there."""
    c, mark, motion, s = case.number, space.mark, space.motion, space.products
    scalars, shapes = form.scalars, form.shapes
    duration, active, moving = motion.clock[0] - mark.clock[0], False, False
    for j in range(case.state.size):
        active = active or is_active(case.state[j])
        moving = moving or (is_active(case.state[j]) and pairs.in_space[j] != 0.0)
    touching = any_compliant(case, pairs)
    read_coordinates(shapes, motion, s.after)
    if duration > 0.0:
        read_coordinates(shapes, mark, s.before)
        if touching:
            b.contact_loss[c] += _add_separating(pairs, case, space)
        if has_blocks(scalars) or moving or (scalars.broken and active):
            _sum_over_points(duration, form, pairs, case, space, b)
            read_coordinates(shapes, motion, s.after)
        else:
            terms = scalars.exponent.size + (2 if scalars.broken else 1)
            _integrate_terms(scalars, form.together, duration, terms, s)
            _set_strengths(terms, form, b.mass.size, space)
            if b.everywhere:
                _sum_products(terms, duration, form, case, space, b)
                for p in range(shapes.rigid_bodies):
                    b.work[c] += _work_on_rigid_body(p, form, mark, motion)
            for j in range(case.state.size):
                if is_active(case.state[j]) and not pairs.rigid[j]:
                    loss = _add_contact(j, terms, scalars, pairs, case, space)
                    b.contact_loss[c] += loss
                    case.touch[LOST, j] += loss
        if touching:
            b.rounding[c] += _rounding(pairs, case, s.after)
    copy_motion(motion, mark)


@apart
def _set_strengths(terms: int, form: Form, coordinates: int, space: Space) -> None:
    """Strengths of the terms of every coordinate's velocity."""
    scalars, shapes, mark, s = form.scalars, form.shapes, space.mark, space.products
    entries, phase = scalars.exponent.size, unit_phase(scalars.omega, mark.clock)
    for i in range(coordinates):
        strength = s.strength[i]
        for k in range(terms):
            strength[k] = complex(0.0, 0.0)
        for m in range(shapes.first[i], shapes.first[i + 1]):
            k = shapes.members[m]
            strength[k] = shapes.shape_rate[i, k] * mark.entry[k]
        harmonic = shapes.harmonic[i]
        for p in range(shapes.rigid_bodies):
            harmonic -= shapes.rigid_body_shape[i, p] * form.rigid_body_sine[p]
        strength[entries] = complex(0.0, scalars.omega) * harmonic * phase
        if scalars.broken:
            strength[entries + 1] = complex(shapes.follow[2, i] * mark.drive[3], 0.0)


@apart
def _sum_products(terms: int, duration: float, form: Form, case: Case, space: Space, b: Ledger) -> None:
    """Work on what the entries move, and the loss of every mode."""
    c, scalars, mark, s = case.number, form.scalars, space.mark, space.products
    entries, drive = scalars.exponent.size, mark.drive
    # s(t) = amplitude sin(theta) = Re(-i amplitude e^{i theta}), or s + s' t
    wave = complex(0.0, -case.amplitude) * unit_phase(scalars.omega, mark.clock)
    work = 0.0
    for i in range(b.mass.size):
        strength, driven = s.strength[i], 0.0
        for k in range(terms):
            if strength[k] == 0.0:
                continue
            if scalars.broken:
                e = _exponent(k, scalars)
                both = drive[2] * integral_of(e, s.growth[k], duration)
                driven += (strength[k] * (both + drive[3] * _first_moment(e, s.growth[k], duration))).real
            else:
                both = wave * s.plus[k, entries] + wave.conjugate() * s.minus[k, entries]
                driven += 0.5 * (strength[k] * both).real
        work += b.load[i] * driven + b.given[i] * (s.after[0, i] - s.before[0, i])
        if b.damping[i] > 0.0:
            b.loss_of_mode[c, i] += b.damping[i] * _square(strength, s.plus, s.minus, terms)
    b.work[c] += work


@inlined
def _work_on_rigid_body(p: int, form: Form, mark: Motion, motion: Motion) -> float:
    """What its drive does on a rigid-body coordinate of unit mass: all that its kinetic energy gains.

    The work of constant forces is in that of the coordinates already.
    """
    scalars, turned = form.scalars, form.rigid_body_sine[p]
    before, after = mark.rigid_body_rate[p], motion.rigid_body_rate[p]
    increment = motion.rigid_body[p] - mark.rigid_body[p]
    if not scalars.broken:
        was, now = turned * unit_phase(scalars.omega, mark.clock), turned * unit_phase(scalars.omega, motion.clock)
        before, after = before - scalars.omega * was.imag, after - scalars.omega * now.imag
        increment += now.real - was.real
    gained: float = 0.5 * (after * after - before * before) - form.load_on_rigid_body[p, 0] * increment
    return gained


@apart
def _add_contact(j: int, terms: int, scalars: Scalars, pairs: Pairs, case: Case, space: Space) -> float:
    """Loss of one contact, and work of its force on every mode."""
    s, mark, to_modes = space.products, space.mark, case.to_modes
    d, entries, r = s.before.shape[1], scalars.exponent.size, case.state.size + j
    rate = s.strength[d + j]
    for k in range(terms):
        rate[k] = complex(0.0, 0.0)
        for i in range(d):
            rate[k] -= pairs.direction[j, i] * s.strength[i, k]
    loss: float = case.damping[j] * _square(rate, s.plus, s.minus, terms)
    # the loss is summed: its row may now hold the force
    force = rate
    for k in range(entries):
        force[k] = scalars.weight[r, k] * mark.entry[k]
    force[entries] = scalars.sine[r] * unit_phase(scalars.omega, mark.clock)
    for m in range(terms):
        # the integral of the force times e^{mu s}, and times its conjugate
        along, against = complex(0.0, 0.0), complex(0.0, 0.0)
        for k in range(terms):
            if force[k] != 0.0:
                along += force[k] * s.plus[k, m]
                against += force[k] * s.minus[k, m]
        for i in range(to_modes.shape[1]):
            strength = s.strength[i, m]
            work = 0.5 * (strength * along + strength.conjugate() * against).real
            to_modes[j, i] += pairs.direction[j, i] * work
    for i in range(to_modes.shape[1]):
        to_modes[j, i] += pairs.direction[j, i] * scalars.constant[r] * (s.after[0, i] - s.before[0, i])
    return loss


@apart
def _sum_over_points(duration: float, form: Form, pairs: Pairs, case: Case, space: Space, b: Ledger) -> None:
    """Work and losses by Gauss points, exact to rounding; uses `after` up."""
    c, scalars, spare, s = case.number, form.scalars, space.spare, space.products
    copy_motion(space.mark, spare)
    start, elapsed = space.mark.clock[0], 0.0
    while elapsed < duration:
        panel = next_panel(elapsed, duration - elapsed, scalars, spare)
        half = 0.5 * panel
        for node in range(len(NODES)):
            time, share = start + elapsed + half * (1.0 + NODES[node]), half * WEIGHTS[node]
            move(scalars, spare, time - spare.clock[0])
            read_coordinates(form.shapes, spare, s.after)
            phase = unit_phase(scalars.omega, spare.clock)
            acting = spare.drive[2] if scalars.broken else case.amplitude * phase.imag
            base_rate = base_motion(case, spare)[1]
            for i in range(b.mass.size):
                v = s.after[1, i]
                b.work[c] += share * (b.load[i] * acting + b.given[i]) * v
                if b.damping[i] > 0.0:
                    b.loss_of_mode[c, i] += share * b.damping[i] * v * v
            for j in range(case.state.size):
                if not is_active(case.state[j]):
                    continue
                force = value_now(case.state.size + j, scalars.exponent.size, phase, scalars, spare)
                # what holds a stop in space does work where the stop moves against the base
                b.work[c] -= share * force * pairs.in_space[j] * base_rate
                if pairs.rigid[j]:
                    continue
                rate = gap_of(j, pairs, s.after[1], base_rate)
                loss = share * case.damping[j] * rate * rate
                b.contact_loss[c] += loss
                case.touch[LOST, j] += loss
                for i in range(case.to_modes.shape[1]):
                    case.to_modes[j, i] += share * pairs.direction[j, i] * force * s.after[1, i]
        elapsed += panel


@inlined
def _add_separating(pairs: Pairs, case: Case, space: Space) -> float:
    """Loss of walls that spring back without force behind what leaves them."""
    loss, s = 0.0, space.products
    was, base = base_motion(case, space.mark)[0], base_motion(case, space.motion)[0]
    for j in range(case.state.size):
        if abs(case.state[j]) == SEPARATING:
            lost = _stored(j, pairs, case, s.before[0], was) - _stored(j, pairs, case, s.after[0], base)
            loss += lost
            case.touch[LOST, j] += lost
    return loss


@apart
def _stored(j: int, pairs: Pairs, case: Case, position: Array, base: float) -> float:
    """Energy in a compliant wall."""
    x, side = gap_of(j, pairs, position, base), side_of(case.state[j])
    depth = max(side * x - gap_on(side, j, case), 0.0)
    return float(spring_potential(depth, case.stiffness[j]))


@inlined
def _rounding(pairs: Pairs, case: Case, state: Array) -> float:
    """Bound on what rounding makes of the energies of contacts.

    x = y - w is known to some units in the last place of y, w and the gap, and so the contact's energy to its
    largest force times that.
    """
    total = 0.0
    for j in range(case.state.size):
        if case.state[j] != FREE and not pairs.rigid[j]:
            size = abs(gap_on(case.state[j], j, case))
            for i in range(state.shape[1]):
                size += abs(pairs.direction[j, i] * state[0, i])
            total += PLACES * size * case.touch[LARGEST_FORCE, j]
    return total


@apart
def write_energy(
    pairs: Pairs, case: Case, motion: Motion, state: Array, b: Ledger, out: Array
) -> None:  # fmt: skip
    """Energies in the order of ENERGY_COLUMNS, then the loss of every mode, of the coordinates given."""
    c, n, base = case.number, b.loss_of_mode.shape[1], base_motion(case, motion)[0]
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
        out[3] += spring_potential(gap_of(j, pairs, state[0], base), b.free_stiffness[j])
        if case.state[j] != FREE and not pairs.rigid[j]:
            out[3] += _stored(j, pairs, case, state[0], base)
    out[4], out[6] = b.work[c], b.contact_loss[c]
