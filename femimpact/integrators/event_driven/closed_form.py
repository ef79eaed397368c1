"""The linear equations between two events, solved in closed form for one set of pairs in contact.

With walls at w_j, structure and balls p = (u, y) obey

    M p'' + C p' + K p = B s(t) + G + sum_j P_j F_j,
    F_j = k_j (x_j - w_j) + c_j x_j'  of compliant pairs in contact,   x_j = w_j  of rigid pairs that stick,

x_j = -P_j p, and ub more for a stop fixed in space. Its solution is

    p(t) = Re(E e^{Lambda t} H) + (rigid-body coordinates) + (steady motion) + p0 + sum_j w_j p_j:

decaying exponentials of the homogeneous equations (see `complex_modes`), motions that nothing pulls back (free
balls) on parabolas, and the steady response to s(t), a sine or a polynomial. An event changes H and the rates of
the rigid-body coordinates, or the set of pairs in contact. On which side these are enters by the walls only.

What is steady of an entry divides by lambda. Slow ones have none under polynomials and constant loads, which drive
them: H' = Lambda H + load, from where the motion is.

Those of F systems are made together, in arrays (F, ...), as a call on small matrices takes longer than what it does.
Each has the bits that it has alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex, Integers
from femimpact.excitation.piecewise_polynomial import ORDERS
from femimpact.integrators.event_driven.complex_modes import (
    SLOW,
    ComplexModes,
    complex_modes,
    groups_of_equal_marks,
    part_of,
    stack,
)
from femimpact.integrators.event_driven.equations import (
    INDEPENDENT,
    Equations,
    ball_coordinates,
    require_met,
    undamped_modes,
    wall_offsets,
)

OF_DISPLACEMENT, OF_VELOCITY = (2, 0), (1, 1)
"""Indices of ub and ub' in `Rows.through` and in `Rows.follow`."""

FOLLOWED = 1.0
"""|lambda| over the rate of the polynomials up to which an entry takes all of its response to them."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Scalars read from a motion: R of them, of F systems."""

    weight: Complex  # (F, R, K) of the entries H
    rigid_body: Array  # (F, R, P) of the rigid-body coordinates and their rates
    rigid_body_rate: Array  # (F, R, P)
    constant: Array  # (F, R, 1 + pairs) of constant loads, and per metre of each wall
    apart: Array  # the same directly, beside the response of the entries to them
    # of H loads: (F, 3H, R) directly of s, ub' and ub of each, beside the response of the entries to them
    through: Array
    # (F, 8H, R) steady, per unit of ub, ub', s and the derivatives of s to the fifth of each, under polynomials s(t)
    follow: Array

    @property
    def by_rows(self) -> tuple[Array | Complex, ...]:
        """All arrays with their rows along axis 1."""
        return (
            self.weight, self.rigid_body, self.rigid_body_rate, self.constant, self.apart, self.through.mT,
            self.follow.mT,
        )  # fmt: skip


def from_rows(arrays: Iterable[Any]) -> Rows:
    """Rows of arrays that have them along axis 1, as of `Rows.by_rows`."""
    *others, through, follow = arrays
    return Rows(*others, *(np.ascontiguousarray(array.mT) for array in (through, follow)))


def by_load(values: Array, items: int) -> Array:
    """A view (F, H, items, R) of what has so many items of each load, (F, H items, R)."""
    return values.reshape(values.shape[0], -1, items, values.shape[2])


def in_rows(values: Array) -> Array:
    """The inverse of `by_load`."""
    return values.reshape(values.shape[0], -1, values.shape[3])


def rate_of(rows: Rows, modes: ComplexModes) -> Rows:
    """Rates of scalars that have no direct part of s or ub'."""
    through, follow = by_load(rows.through, 3), by_load(rows.follow, ORDERS)
    zero = np.zeros_like(through[:, :, :1])
    return Rows(
        weight=rows.weight @ modes.rate,
        rigid_body=rows.rigid_body_rate,
        rigid_body_rate=rows.rigid_body,
        constant=0.0 * rows.constant,
        apart=0.0 * rows.apart,
        through=in_rows(np.concatenate([zero, through[:, :, 2:], zero], axis=2)),
        follow=in_rows(np.concatenate([zero, follow[:, :, :-1]], axis=2)),
    )


def gap_rows(
    equations: Equations,
    rows: Rows,  # of all coordinates, or their rates
    base: tuple[int, int],  # which of the inputs in `through` and in `follow` is the base's motion: ub, or ub'
) -> Rows:
    """Rows of x_j = -P_j p - in_space_j ub, or of x_j'."""
    P = -equations.force.mT
    through, follow = rows.through @ P.mT, rows.follow @ P.mT
    through[:, base[0]] -= equations.in_space
    follow[:, base[1]] -= equations.in_space
    return Rows(
        P @ rows.weight, P @ rows.rigid_body, P @ rows.rigid_body_rate, P @ rows.constant, P @ rows.apart, through,
        follow,
    )  # fmt: skip


def driven_entries(
    modes: ComplexModes,
    rate: float | None,  # 1/s: of the polynomials; only slow ones are driven by a sine's constant loads, or by lines
) -> NDArray[np.int64]:
    """Number (F,) of the entries, the slowest ones, that are advanced with all of their response to polynomials.

    The response of a fast entry is a polynomial itself, beside the exponential: a sum of derivatives of s over powers
    of lambda, which for a slow one are large and cancel the exponential.
    """
    size = modes.size
    if not rate:
        return modes.slow
    fast = np.concatenate([size > FOLLOWED * rate, np.ones((size.shape[0], 1), dtype=bool)], axis=1)
    count: NDArray[np.int64] = fast.argmax(axis=1)
    for first, length in modes.blocks:
        count = np.where((first < count) & (count < first + length), first, count)
    return np.maximum(count, modes.slow)


def settled(rows: Rows, modes: ComplexModes, constant: Complex) -> Array:
    """Steady part (F, R, 1 + pairs) of scalars, as in `Rows.constant`, without that of slow entries."""
    settled_rows = rows.constant
    for f in np.flatnonzero(modes.slow).tolist():
        fast = slice(int(modes.slow[f]), None)
        response = _solved(modes.rate[f, fast, fast], -constant[f, fast])
        settled_rows = settled_rows.copy() if settled_rows is rows.constant else settled_rows
        settled_rows[f] = rows.apart[f] + (rows.weight[f, :, fast] @ response).real
    return settled_rows


def _solved(rate: Complex, right: Complex) -> Complex:
    """Lambda^-1 times a vector or some."""
    return np.asarray(scipy.linalg.solve_triangular(rate, right)) if right.size else right


def followed(rows: Rows, modes: ComplexModes, load: Complex, driven: NDArray[np.int64]) -> Array:
    """Steady response (F, 8, R) of scalars under a polynomial, as in `Rows.follow`, without that of driven entries."""
    if not np.any(driven):
        return rows.follow
    rates = modes.rate
    return np.stack([
        rows.follow[f] if count == 0 else _followed(part_of(rows, f), rates[f], load[f], count)
        for f, count in enumerate(driven.tolist())
    ])  # fmt: skip


def _followed(rows: Rows, rate: Complex, load: Complex, driven: int) -> Array:
    """That of one system, (8, R)."""
    follow = []
    for of_fast, through in zip(
        steady_entries(rate, load, driven, rate.shape[0]), rows.through.reshape(-1, 3, rows.through.shape[1]),
        strict=True,
    ):  # fmt: skip
        response = np.zeros((ORDERS, rate.shape[0]), dtype=complex)
        response[:, driven:] = of_fast
        # each row by itself: the rounding of a matrix product depends on its shape, and events not on what else is read
        follow.append(np.sum(response[:, None, :] * rows.weight, axis=2).real)
        follow[-1][:3] += through[::-1]
    return np.concatenate(follow)


def steady_entries(
    rate: Complex,  # (K, K) 1/s: of one system; see `ComplexModes`
    load: Complex,  # (3H, K) as of `ClosedForms`
    first: int,  # of the entries, which are whole blocks, and the one behind the last
    end: int,
) -> Complex:
    """Steady response (H, 8, entries) of some entries, per unit of ub, ub', s and the derivatives of s to the fifth."""
    chosen, forces = slice(first, end), load.reshape(-1, 3, load.shape[1])
    entries = np.zeros((forces.shape[0], ORDERS, end - first), dtype=complex)
    for of_load, response in zip(forces, entries, strict=True):
        before = np.zeros(end - first, dtype=complex)
        for order in range(ORDERS):
            # G' = Lambda G + load (s, ub', ub) with G a sum over ub and its derivatives
            forcing = of_load[2 - order, chosen] if order < 3 else 0.0
            before = _solved(rate[chosen, chosen], before - forcing)
            response[order] = before
    return entries


ABLE = 1e-3
"""Share of the largest mobility of a coordinate at a stop, in speed, from which it may be the one that meets it."""

ROUNDED = 1e-12
"""Share of the terms of a sum below which it is rounding."""

SLOWEST = 0.25 * SLOW**2
"""omega^2 (1/s^2) up to which an undamped motion surely has slow entries."""

UNMET = 1e-9
"""Remainder of a wall 1 m away, beyond rounding, where a pressed stop gives way to others."""


@dataclass(frozen=True, eq=False)
class ClosedForms:
    """Closed forms of F systems, one set of pairs in contact: K entries, P rigid-body coordinates, p of size d."""

    modes: ComplexModes
    rigid_body_shape: Array  # (F, d, P)
    rigid_body_given: Array  # (F, P, 1 + pairs) accelerations of constant loads, and per metre of each wall
    rigid_body_drive: Array  # (F, H, P) acceleration per unit of each s(t)
    position: Rows  # of all coordinates
    velocity: Rows
    # force on the structure at each pair (N): of compliant pairs as if they were in contact, of rigid ones that stick;
    # zero for others
    contact_force: Rows
    load: Complex  # (F, 3H, K) what s, ub' and ub of each load add to H'
    given: Complex  # (F, K, 1 + pairs) the same of constant loads, and per metre of each wall
    to_entry_u: Complex  # (F, K, d) H = to_entry_u p + to_entry_v p', steady parts taken off
    to_entry_v: Complex  # (F, K, d)
    to_rigid_body: Array  # (F, P, d)
    impulse_entry: Complex  # (F, K, pairs) change of H and of the rates by a unit impulse on the structure at each pair
    impulse_rigid_body: Array


@dataclass(frozen=True, eq=False)
class _Contact:
    """Which pairs are in contact, the same of all systems, and the contact parameters of each."""

    COMMON: ClassVar = ("active", "rigid")

    active: NDArray[np.bool_]  # (pairs,)
    rigid: NDArray[np.bool_]  # (pairs,)
    stiffness: Array  # (F, pairs)
    damping: Array  # (F, pairs)

    @cached_property
    def sticking(self) -> Integers:
        """Numbers of the rigid pairs."""
        return np.flatnonzero(self.active & self.rigid)

    @cached_property
    def pressed(self) -> NDArray[np.bool_]:
        """True for compliant pairs in contact."""
        return self.active & ~self.rigid


@dataclass(frozen=True, eq=False)
class _Loads:
    """Matrices with the springs of the contacts, and loads from where each pair is just at its wall."""

    C: Array
    K: Array
    offset: Array  # (F, d, pairs)
    moved: Array  # (F, d) per unit of ub
    constant: Array  # (F, d, 1 + pairs)
    drive: Array  # (F, 3H, d) of s, ub' and ub of each load
    unmet: Array  # (F, pairs, pairs) what is left of each wall in the offsets


@dataclass(frozen=True, eq=False)
class _SteadyResponse:
    """Response of the coordinates to the loads, from where each pair is just at its wall: small at stiff contacts."""

    constant: Array  # (F, d, 1 + pairs) of constant loads, and per metre of each wall
    follow: Array  # (F, 8H, d) steady, per unit of ub, ub', s and the derivatives of s to the fifth of each load


@dataclass(frozen=True, eq=False)
class _UndampedMotions:
    """Shapes of undamped motions, mass-normalised: those that something pulls back or brakes, and the others."""

    elastic: Array  # (F, d, n)
    rigid_body: Array  # (F, d, P)
    omega_squared: Array  # (F, n)
    damping: Array  # (F, n, n)


def closed_forms(
    equations: Equations,  # of F systems; see `equations.stacked`
    active: NDArray[np.bool_],  # (pairs,) in contact; whether a pair then sticks
    stiffness: Array,  # (F, pairs) of compliant pairs, N/m and N s/m
    damping: Array,  # (F, pairs)
) -> list[tuple[Integers, ClosedForms]]:
    """Closed forms of the motion while exactly these pairs are in contact.

    Returns (ndarray of int, ClosedForms): numbers of systems with as many entries, and their closed forms.

    Raises `InputError` if the pairs that stick leave one another no motion to be met with, in any of the systems.
    """
    contact = _Contact(active, equations.rigid, stiffness, damping)
    forms = []
    for members, motions in _undamped_motions(equations, contact):
        for part, modes in complex_modes(motions.omega_squared, motions.damping):
            systems = members[part]
            forms.append(
                (systems, _forms(part_of(equations, systems), part_of(contact, systems), part_of(motions, part), modes))
            )
    return forms


def _undamped_motions(equations: Equations, contact: _Contact) -> Iterator[tuple[Integers, _UndampedMotions]]:
    """Motions of the systems that have as many of each kind."""
    for members, basis in _free_bases(equations, contact):
        omega_squared, shapes, damped = _motions_on(part_of(equations, members), basis, part_of(contact, members))
        # what nothing pulls back and nothing brakes moves on parabolas: free balls, rigid motions
        stiff, size = omega_squared > 0.0, np.abs(damped)
        largest = np.maximum(size.max(axis=(1, 2), initial=0.0), 1e-300)
        bound = stiff | (size.max(axis=1, initial=0.0) > 1e-15 * largest[:, None])
        for part in groups_of_equal_marks(bound):
            linked, others = np.flatnonzero(bound[part[0]]), np.flatnonzero(~bound[part[0]])
            square = np.where(stiff, omega_squared, 0.0)[part]
            yield (
                members[part],
                _UndampedMotions(
                    np.take(shapes[part], linked, axis=2),
                    np.take(shapes[part], others, axis=2),
                    np.take(square, linked, axis=1),
                    damped[np.ix_(part, linked, linked)],
                ),
            )


def _motions_on(equations: Equations, basis: Array, contact: _Contact) -> tuple[Array, Array, Array]:
    """omega^2, shapes and modal damping of all motions that the pairs in contact leave."""
    # what a pair does to a motion that leaves its gap as it is, is exactly nothing
    direction, pressed = basis.mT @ equations.force, contact.pressed
    if np.any(_has_slow(equations)):
        direction = _without_rounding(direction, np.abs(basis.mT) @ np.abs(equations.force))
    K = basis.mT @ equations.K @ basis + (direction * np.where(pressed, contact.stiffness, 0.0)[:, None]) @ direction.mT
    C = basis.mT @ equations.C @ basis + (direction * np.where(pressed, contact.damping, 0.0)[:, None]) @ direction.mT
    omega_squared, vectors = undamped_modes(K, basis.mT @ equations.M @ basis)
    return omega_squared, basis @ vectors, vectors.mT @ C @ vectors


def _loads(equations: Equations, contact: _Contact) -> _Loads:
    active, P = contact.active, equations.force
    stiffness, damping = (
        P * np.where(contact.pressed, numbers, 0.0)[:, None] for numbers in (contact.stiffness, contact.damping)
    )
    K, C = equations.K + stiffness @ P.mT, equations.C + damping @ P.mT
    offset = wall_offsets(equations, active, contact.sticking)
    unmet = np.diag(active.astype(float)) + P.mT @ offset
    unmet = np.where((np.abs(unmet) > UNMET) & active[:, None] & active, unmet, 0.0)
    moved, left = _times(offset, equations.in_space), _times(unmet, equations.in_space)
    constant = np.concatenate([equations.given[:, :, None], -equations.K @ offset - stiffness @ unmet], axis=2)
    drive = [
        equations.drive[:, 0] - _times(equations.M, moved),
        -_times(equations.C, moved) - _times(damping, left),
        -_times(equations.K, moved) - _times(stiffness, left),
    ]
    zero = np.zeros_like(moved)
    # forces behind the first load
    drive += [part for h in range(1, equations.drive.shape[1]) for part in (equations.drive[:, h], zero, zero)]
    return _Loads(C, K, offset, moved, constant, np.stack(drive, axis=1), unmet)


def _forms(equations: Equations, contact: _Contact, motions: _UndampedMotions, modes: ComplexModes) -> ClosedForms:
    """The closed forms on motions whose complex modes are known."""
    loads, elastic, rigid_body = _loads(equations, contact), motions.elastic, motions.rigid_body
    modal, modal_drive = elastic.mT @ loads.constant, loads.drive @ elastic
    response = _steady_response(motions, modal, modal_drive)
    follow = response.follow.copy()
    follow[:, 0] += loads.moved
    through = np.zeros_like(loads.drive)
    through[:, 2] = loads.moved
    position = Rows(
        weight=elastic @ modes.shape,
        rigid_body=rigid_body,
        rigid_body_rate=0.0 * rigid_body,
        constant=np.concatenate([response.constant[:, :, :1], loads.offset + response.constant[:, :, 1:]], axis=2),
        apart=np.concatenate([np.zeros_like(response.constant[:, :, :1]), loads.offset], axis=2),
        through=through,
        follow=follow,
    )
    momentum, pairs = elastic.mT @ equations.M, contact.active.size
    no_forces = (np.zeros((each.shape[0], pairs, *each.shape[2:]), each.dtype) for each in position.by_rows)
    forms = ClosedForms(
        modes=modes,
        rigid_body_shape=rigid_body,
        rigid_body_given=rigid_body.mT @ loads.constant,
        rigid_body_drive=np.stack(
            [_times(rigid_body.mT, loads.drive[:, h]) for h in range(0, loads.drive.shape[1], 3)], axis=1
        ),
        position=position,
        velocity=rate_of(position, modes),
        contact_force=from_rows(no_forces),
        load=np.asarray(modal_drive @ modes.from_v.mT, dtype=complex),
        given=modes.from_v @ modal,
        to_entry_u=modes.from_u @ momentum,
        to_entry_v=modes.from_v @ momentum,
        to_rigid_body=rigid_body.mT @ equations.M,
        impulse_entry=modes.from_v @ elastic.mT @ equations.force,
        impulse_rigid_body=rigid_body.mT @ equations.force,
    )
    force = forms.contact_force
    if not np.all(contact.rigid):
        force = _compliant_forces(equations, forms, loads, response, contact)
    if contact.sticking.size:
        force = _with_sticking(equations, forms, loads, response, contact.sticking, force)
    return replace(forms, contact_force=force)


def _steady_response(motions: _UndampedMotions, modal: Array, modal_drive: Array) -> _SteadyResponse:
    """Response by the ansatz q = a0 ub + a1 ub' + a2 s + a3 s' + ...; s has no derivative beyond the fifth."""
    square, damping = motions.omega_squared, motions.damping
    # of what holds slow entries nothing is taken: see `settled` and `followed`
    compliance = np.divide(1.0, square, out=np.zeros_like(square), where=square > SLOWEST)
    follow = []
    for h in range(0, modal_drive.shape[1], 3):
        a0 = compliance * modal_drive[:, h + 2]
        a1 = compliance * (modal_drive[:, h + 1] - _times(damping, a0))
        a2 = compliance * (modal_drive[:, h] - _times(damping, a1) - a0)
        a = [a0, a1, a2]
        while len(a) < ORDERS:
            a.append(-compliance * (_times(damping, a[-1]) + a[-2]))
        follow.append(np.stack(a, axis=1) @ motions.elastic.mT)
    settled = motions.elastic @ (compliance[:, :, None] * modal)
    return _SteadyResponse(settled, np.concatenate(follow, axis=1))


def _times(matrix: Array, vector: Array) -> Array:
    """Products (F, m) of matrices (F, m, n) and vectors (F, n)."""
    return np.asarray((matrix @ vector[:, :, None])[:, :, 0])


def _free_bases(equations: Equations, contact: _Contact) -> list[tuple[Integers, Array]]:
    """Bases of the motions that sticking pairs leave, (F, d, motions), of systems with as many.

    Where the structure has slow or rigid motions, a ball that is pressed moves with its place beside its coordinate,
    and a pressed stop leaves a motion less: gaps are then coordinates, and what is stiff is beside what is slow.
    """
    n, every = equations.dofs, np.arange(equations.M.shape[0])
    stops = contact.sticking[equations.stop[contact.sticking]]
    is_loose, left = _has_slow(equations), [np.eye(n)] * every.size
    pressed = np.flatnonzero(contact.pressed & equations.stop)
    for f in np.flatnonzero(is_loose & (pressed.size > 0) | (stops.size > 0)).tolist():
        alone = part_of(equations, f)
        require_met(alone, contact.sticking)
        left[f] = (
            _beside_stops(alone, stops, pressed) if is_loose[f] else scipy.linalg.null_space(-alone.force[:n, stops].T)
        )
    motions = np.array([each.shape[1] for each in left])
    bases_of_parts = []
    for members in groups_of_equal_marks(is_loose[:, None], motions[:, None]):
        # balls that meet have the gap between them as a coordinate: their motion together is as slow as without it
        beside = is_loose[members[0]] | (np.arange(equations.stop.size) >= equations.M.shape[1] - n)
        carried = contact.pressed & ~equations.stop & beside
        bases = stack([left[f] for f in members])
        bases_of_parts.append(
            (members, _basis_of(part_of(equations, members), bases, contact.sticking, np.flatnonzero(carried)))
        )
    return bases_of_parts


def _has_slow(equations: Equations) -> NDArray[np.bool_]:
    """Whether the structure has slow or rigid motions, (F,)."""
    stiffness, mass = (np.diagonal(each, axis1=1, axis2=2)[:, : equations.dofs] for each in (equations.K, equations.M))
    return np.asarray(np.any(stiffness <= SLOW**2 * mass, axis=1))


def _beside_stops(equations: Equations, held: Integers, pressed: Integers) -> Array:
    """Motions (n, m) of one structure in which some stops stay where they are, then one for each pressed stop.

    Each stop is met by one coordinate, the slowest that does so well: others stay as slow as they are.
    """
    n, met = equations.dofs, list[int]()
    stiffness, mass = equations.K.diagonal()[:n] / equations.M.diagonal()[:n], np.sqrt(equations.M.diagonal()[:n])
    rows = equations.force[:n, [*held, *pressed]].T.copy()
    least = INDEPENDENT * np.abs(rows / mass).max(axis=1)
    chosen = list[int]()
    for i in range(rows.shape[0]):
        size = np.abs(rows[i] / mass)
        if size.max() <= least[i]:
            continue
        able = np.flatnonzero(size >= ABLE * size.max())
        pivot = int(able[np.argmin(stiffness[able])])
        rows[i] /= rows[i, pivot]
        others = np.delete(np.arange(rows.shape[0]), i)
        rows[others] -= rows[others, pivot][:, None] * rows[i]
        rows[others, pivot] = 0.0
        met.append(pivot)
        chosen.append(i)
    free = np.setdiff1d(np.arange(n), met)
    motions = np.eye(n)[:, free]
    motions[met] = -rows[chosen][:, free]
    return np.hstack([motions, np.eye(n)[:, [pivot for i, pivot in zip(chosen, met, strict=True) if i >= held.size]]])


def _basis_of(equations: Equations, left: Array, sticking: Integers, carried: Integers) -> Array:
    """Motions (F, n, m) of the structure with the balls that stick or are carried, and all other coordinates."""
    n, (count, size, _), motions = equations.dofs, equations.M.shape, left.shape[2]
    held = sticking[~equations.stop[sticking]]
    balls, of_contact = ball_coordinates(equations.force[0, n:], np.concatenate([held, carried]), held)
    moving = np.setdiff1d(np.arange(size - n), [of_contact[j] for j in held.tolist() if j in of_contact])
    basis = np.zeros((count, size, motions + moving.size))
    basis[:, :n, :motions] = left
    basis[:, n:, motions:] = balls[:, moving]
    for j, column in of_contact.items():
        # a ball at a place that a stop holds is at rest to the last bit
        push = equations.force[:, None, :n, j]
        place = _without_rounding(push @ left, np.abs(push) @ np.abs(left))
        basis[:, n:, :motions] += balls[:, column, None] * place
    return basis


def _without_rounding(sums: Array, sizes: Array) -> Array:
    """Sums that are zero where nothing but rounding is left of terms of these sizes."""
    return np.where(np.abs(sums) > ROUNDED * sizes, sums, 0.0)


def _compliant_forces(
    equations: Equations, forms: ClosedForms, loads: _Loads, response: _SteadyResponse, contact: _Contact
) -> Rows:
    """Forces k (x - w) + c x' of every compliant pair; of those in contact without a difference of near numbers."""
    P, active = -equations.force.mT, contact.active
    x, rate = gap_rows(equations, forms.position, OF_DISPLACEMENT), gap_rows(equations, forms.velocity, OF_VELOCITY)
    depth = P @ response.constant
    wall = np.where(active[:, None], -loads.unmet, -np.eye(active.size))
    offset = np.where(active[:, None], 0.0, P @ loads.offset)
    x.constant[:, :, 0] = depth[:, :, 0]
    x.constant[:, :, 1:] = depth[:, :, 1:] + offset + wall
    x.apart[:, :, 0], x.apart[:, :, 1:] = 0.0, offset + wall
    moved = -_times(loads.unmet, equations.in_space)
    follow_depth = _times(P, response.follow[:, 0]) + moved
    x.follow[:, 0] = np.where(active, follow_depth, x.follow[:, 0])
    x.through[:, 2] = np.where(active, moved, x.through[:, 2])
    rate.follow[:, 1] = np.where(active, follow_depth, rate.follow[:, 1])
    rate.through[:, 1] = np.where(active, moved, rate.through[:, 1])
    stiffness, damping = np.where(contact.rigid, 0.0, contact.stiffness)[:, :, None], contact.damping[:, :, None]
    pairs = zip(x.by_rows, rate.by_rows, strict=True)
    return from_rows(stiffness * here + damping * there for here, there in pairs)


def _with_sticking(
    equations: Equations, forms: ClosedForms, loads: _Loads, response: _SteadyResponse, sticking: Integers, force: Rows
) -> Rows:
    """Forces of the pairs that stick: what the equations of motion leave over."""
    M, C, K = equations.M, loads.C, loads.K
    directions = equations.force[:, :, sticking]
    inverse = np.linalg.solve(M, directions)
    # F = (P^T M^-1 P)^-1 P^T M^-1 (M p'' + C p' + K p - loads)
    coupling = np.linalg.inv(directions.mT @ inverse)
    # where nothing moves a ball no force holds it: its sign would be that of rounding
    project = _without_rounding(coupling @ inverse.mT, np.abs(coupling) @ np.abs(inverse.mT))
    shape, rate, modes = forms.position.weight, forms.velocity.weight, forms.modes
    left = M @ (rate @ modes.rate) + C @ rate + K @ shape
    # the response of the entries to a load begins with an acceleration
    begun = (rate @ forms.load.mT).real.mT @ M.mT
    rigid_body = M @ forms.rigid_body_shape
    driven = np.stack([_times(rigid_body, of_load) for of_load in np.moveaxis(forms.rigid_body_drive, 1, 0)], axis=1)
    a, of_loads = by_load(response.follow, ORDERS), by_load(loads.drive, 3)
    follow = a @ K.mT[:, None]
    follow[:, :, 1:] += a[:, :, :-1] @ C.mT[:, None]
    follow[:, :, 2:] += a[:, :, :-2] @ M.mT[:, None]
    follow[:, :, :3] -= of_loads[:, :, ::-1]
    follow[:, :, 2] += driven
    follow = in_rows(follow)
    through = begun - loads.drive
    through[:, ::3] += driven
    constant, apart = (
        part - loads.constant + rigid_body @ forms.rigid_body_given
        for part in (K @ response.constant, M @ (rate @ forms.given).real)
    )
    force.weight[:, sticking] = project @ left
    force.rigid_body[:, sticking] = force.rigid_body_rate[:, sticking] = 0.0
    # balls that fly on together press on one another by rounding alone
    met = (sticking >= M.shape[1] - equations.dofs) & ~equations.stop[sticking]
    weight = np.where(met[:, None], np.abs(project), 0.0)
    of_loads, of_drive = weight @ np.abs(loads.constant), _times(weight, np.abs(loads.drive).max(axis=1))[:, None]
    force.constant[:, sticking] = _without_rounding(project @ constant, of_loads)
    force.apart[:, sticking] = _without_rounding(project @ apart, of_loads)
    force.through[:, :, sticking] = _without_rounding(through @ project.mT, of_drive)
    force.follow[:, :, sticking] = _without_rounding(follow @ project.mT, of_drive)
    return force
