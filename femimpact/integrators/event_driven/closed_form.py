"""The linear equations between two events, solved in closed form for one set of pairs in contact.

With walls at w_j, structure and balls p = (u, y) obey

    M p'' + C p' + K p = B s(t) + G + sum_j P_j F_j,
    F_j = k_j (x_j - w_j) + c_j x_j'  of compliant pairs in contact,   x_j = w_j  of rigid pairs that stick,

x_j = -P_j p, and ub more for a stop fixed in space. Its solution is

    p(t) = Re(E e^{Lambda t} H) + (rigid-body coordinates) + (steady motion) + p0 + sum_j w_j p_j:

decaying exponentials of the homogeneous equations (see `complex_modes`), motions that nothing pulls back (free
balls) on parabolas, and the steady response to s(t), a sine or a polynomial. An event changes H and the rates of
the rigid-body coordinates, or the set of pairs in contact. On which side these are enters by the walls only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.excitation.piecewise_polynomial import ORDERS
from femimpact.integrators.event_driven.complex_modes import ComplexModes, complex_modes
from femimpact.integrators.event_driven.equations import Equations, require_met, undamped_modes, wall_offsets

__all__ = [
    "OF_DISPLACEMENT", "OF_VELOCITY", "ClosedForm", "Rows", "closed_form", "driven_entries", "followed", "gap_rows",
]  # fmt: skip

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

OF_DISPLACEMENT, OF_VELOCITY = (2, 0), (1, 1)
"""Where ub and ub' stand in `Rows.through` and in `Rows.follow`."""

SLOW = 1.0
"""|lambda| over the rate of the polynomials up to which an entry has its whole response to them."""

ROUNDED = 1e-12
"""Share of the terms of a sum below which it is rounding."""

UNMET = 1e-9
"""What is left of a wall 1 m away, beyond rounding, where a pressed stop gives way to others."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Scalars read from a motion: R of them.

    Parameters
    ----------
    weight : ndarray (R, K), complex
        Of the entries H.
    rigid_body, rigid_body_rate : ndarray (R, P)
        Of the rigid-body coordinates and their rates.
    constant : ndarray (R, 1 + pairs)
        Of constant loads, and per metre of each wall.
    through : ndarray (3, R)
        Directly of s, ub' and ub, beside the response of the entries to them.
    follow : ndarray (8, R)
        Steady, per unit of ub, ub', s and the derivatives of s to the fifth, under a polynomial s(t).
    """

    weight: Complex
    rigid_body: Array
    rigid_body_rate: Array
    constant: Array
    through: Array
    follow: Array


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Closed form of the motion for one set of pairs in contact: K entries, P rigid-body coordinates, p of size d.

    Parameters
    ----------
    modes : ComplexModes
    rigid_body_shape : ndarray (d, P)
    rigid_body_given : ndarray (P, 1 + pairs)
        Accelerations of constant loads, and per metre of each wall.
    rigid_body_drive : ndarray (P,)
        Acceleration per unit of s(t).
    position, velocity : Rows
        Of all coordinates.
    contact_force : Rows
        Force on the structure at each pair (N): of compliant pairs as if they were in contact, of rigid ones that
        stick; zero for others.
    load : ndarray (3, K), complex
        What s, ub' and ub add to H'.
    to_entry_u, to_entry_v : ndarray (K, d)
        H = to_entry_u p + to_entry_v p', steady parts taken off.
    to_rigid_body : ndarray (P, d)
    impulse_entry : ndarray (K, pairs), impulse_rigid_body : ndarray (P, pairs)
        Change of H and of the rates by a unit impulse on the structure at each pair.
    reaction : ndarray (pairs, pairs)
        Impulses on the structure at the pairs that stick (rows; zero for others) by a unit one at each other pair.
    unheld : pair of bool
        Whether a constant load, and whether s(t), drives a motion that is braked but not pulled back: neither it nor
        a polynomial s(t) has a steady response.
    """

    modes: ComplexModes
    rigid_body_shape: Array
    rigid_body_given: Array
    rigid_body_drive: Array
    position: Rows
    velocity: Rows
    contact_force: Rows
    load: Complex
    to_entry_u: Complex
    to_entry_v: Complex
    to_rigid_body: Array
    impulse_entry: Complex
    impulse_rigid_body: Array
    reaction: Array
    unheld: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class _Loads:
    """Matrices with the springs of the contacts, and loads from where each pair is just at its wall."""

    C: Array
    K: Array
    offset: Array  # (d, pairs)
    moved: Array  # (d,) per unit of ub
    constant: Array  # (d, 1 + pairs)
    drive: Array  # (3, d) of s, ub' and ub
    unmet: Array  # (pairs, pairs) what is left of each wall in the offsets


@dataclass(frozen=True, eq=False)
class _SteadyResponse:
    """Response of the coordinates to the loads, from where each pair is just at its wall: small at stiff contacts."""

    constant: Array  # (d, 1 + pairs) of constant loads, and per metre of each wall
    follow: Array  # (8, d) steady, per unit of ub, ub', s and the derivatives of s to the fifth


def _loads(
    whole: Equations, active: NDArray[np.bool_], sticking: NDArray[np.intp], stiffness: Array, damping: Array
) -> _Loads:
    P = whole.force
    K, C = whole.K + (P * stiffness) @ P.T, whole.C + (P * damping) @ P.T
    offset = wall_offsets(whole, active, sticking)
    unmet = np.diag(active.astype(float)) + P.T @ offset
    unmet = np.where((np.abs(unmet) > UNMET) & active[:, None] & active, unmet, 0.0)
    moved = offset @ whole.in_space
    constant = np.column_stack([whole.given, -whole.K @ offset - (P * stiffness) @ unmet])
    drive = np.array([
        whole.drive - whole.M @ moved,
        -whole.C @ moved - (P * damping) @ (unmet @ whole.in_space),
        -whole.K @ moved - (P * stiffness) @ (unmet @ whole.in_space),
    ])  # fmt: skip
    return _Loads(C, K, offset, moved, constant, drive, unmet)


def closed_form(
    whole: Equations, active: NDArray[np.bool_], rigid: NDArray[np.bool_], stiffness: Array, damping: Array
) -> ClosedForm:
    """Closed form of the motion while exactly these pairs are in contact.

    Parameters
    ----------
    whole : Equations
    active, rigid : ndarray (pairs,) of bool
        In contact; whether a pair then sticks.
    stiffness, damping : ndarray (pairs,)
        Of compliant pairs, N/m and N s/m.

    Returns
    -------
    ClosedForm

    Raises
    ------
    InputError
        If the pairs that stick leave one another no motion to be met with.
    """
    sticking = np.flatnonzero(active & rigid)
    pressed = active & ~rigid
    require_met(whole, sticking)
    loads = _loads(whole, active, sticking, np.where(pressed, stiffness, 0.0), np.where(pressed, damping, 0.0))
    basis = _free_basis(whole, sticking, pressed)
    # what a pair does to a motion that leaves its gap as it is, is exactly nothing
    direction = basis.T @ whole.force
    K = basis.T @ whole.K @ basis + (direction * np.where(pressed, stiffness, 0.0)) @ direction.T
    C = basis.T @ whole.C @ basis + (direction * np.where(pressed, damping, 0.0)) @ direction.T
    omega_squared, vectors = undamped_modes(K, basis.T @ whole.M @ basis)
    shapes, damped = basis @ vectors, vectors.T @ C @ vectors
    # what nothing pulls back and nothing brakes moves on parabolas: free balls, rigid motions
    stiff = omega_squared > 0.0
    braked = np.max(np.abs(damped), axis=0, initial=0.0) > 1e-15 * max(float(np.abs(damped).max(initial=0.0)), 1e-300)
    bound = stiff | braked
    square, own_damping = np.where(stiff, omega_squared, 0.0)[bound], damped[np.ix_(bound, bound)]
    modes = complex_modes(square, own_damping)
    elastic, rigid_body = shapes[:, bound], shapes[:, ~bound]
    modal, modal_drive = elastic.T @ loads.constant, loads.drive @ elastic
    unheld = tuple(_drives(values[:, square == 0.0], values) for values in (modal.T, modal_drive))
    compliance = np.divide(1.0, square, out=np.zeros_like(square), where=square > 0.0)
    settled = elastic @ (compliance[:, None] * modal)
    # q = a0 ub + a1 ub' + a2 s + a3 s' + ... with ub'' = s, and no derivative of s beyond the fifth
    a0 = compliance * modal_drive[2]
    a1 = compliance * (modal_drive[1] - own_damping @ a0)
    a2 = compliance * (modal_drive[0] - own_damping @ a1 - a0)
    a = [a0, a1, a2]
    while len(a) < ORDERS:
        a.append(-compliance * (own_damping @ a[-1] + a[-2]))
    from_walls = np.array(a) @ elastic.T
    follow = from_walls.copy()
    follow[0] += loads.moved
    momentum = elastic.T @ whole.M
    shape, zero = elastic @ modes.shape, np.zeros(shapes.shape[0])
    static = np.column_stack([settled[:, 0], loads.offset + settled[:, 1:]])
    position = Rows(shape, rigid_body, 0.0 * rigid_body, static, np.array([zero, zero, loads.moved]), follow)
    entries = np.asarray(modal_drive @ modes.from_v.T, dtype=complex)
    pairs = whole.stop.size
    nothing = np.zeros((pairs, rigid_body.shape[1]))
    no_force = Rows(
        np.zeros((pairs, shape.shape[1]), dtype=complex), nothing, nothing, np.zeros((pairs, 1 + pairs)),
        np.zeros((3, pairs)), np.zeros((ORDERS, pairs)),
    )  # fmt: skip
    form = ClosedForm(
        modes=modes,
        rigid_body_shape=rigid_body,
        rigid_body_given=rigid_body.T @ loads.constant,
        rigid_body_drive=rigid_body.T @ loads.drive[0],
        position=position,
        velocity=_rate(position, modes),
        contact_force=no_force,
        load=entries,
        to_entry_u=modes.from_u @ momentum,
        to_entry_v=modes.from_v @ momentum,
        to_rigid_body=rigid_body.T @ whole.M,
        impulse_entry=modes.from_v @ elastic.T @ whole.force,
        impulse_rigid_body=rigid_body.T @ whole.force,
        reaction=_reactions(whole, sticking),
        unheld=unheld,
    )
    response = _SteadyResponse(settled, from_walls)
    force = no_force
    if not np.all(rigid):
        force = _compliant_forces(whole, form, loads, response, active, np.where(rigid, 0.0, stiffness), damping)
    if sticking.size:
        force = _with_sticking(whole, form, loads, response, sticking, force)
    return replace(form, contact_force=force)


def _reactions(whole: Equations, sticking: NDArray[np.intp]) -> Array:
    """Impulses (pairs, pairs) by which sticking pairs stay at rest on their walls, of a unit one at each other pair."""
    reaction = np.zeros((whole.stop.size, whole.stop.size))
    if 0 < sticking.size < whole.stop.size:
        others = np.delete(np.arange(whole.stop.size), sticking)
        mobility = whole.force[:, sticking].T @ np.linalg.solve(whole.M, whole.force)
        reaction[np.ix_(sticking, others)] = -np.linalg.solve(mobility[:, sticking], mobility[:, others])
    return reaction


def _drives(loads: Array, whole: Array) -> bool:
    """Whether some loads are more than the rounding of all."""
    return bool(np.any(np.abs(loads) > 1e-12 * np.abs(whole).max(initial=0.0)))


def _free_basis(whole: Equations, sticking: NDArray[np.intp], pressed: NDArray[np.bool_]) -> Array:
    """Basis of the motions that sticking pairs leave, (d, motions).

    Where the structure has rigid motions, a ball that is pressed moves with its place beside its own coordinate: that
    is then its gap, and nothing stiffens a rigid motion of all.
    """
    size, n = whole.M.shape[0], whole.dofs
    rigid = not np.all(np.any(whole.K[:n, :n] != 0.0, axis=0))
    carried = np.flatnonzero(pressed & ~whole.stop) if rigid else np.zeros(0, dtype=np.intp)
    if sticking.size + carried.size == 0:
        return np.eye(size)
    stops = sticking[whole.stop[sticking]]
    left = np.eye(n) if stops.size == 0 else scipy.linalg.null_space(-whole.force[:n, stops].T)
    held = set(sticking.tolist())
    moving = [i for i in range(n, size) if i - n not in held]
    basis = np.zeros((size, left.shape[1] + len(moving)))
    basis[:n, : left.shape[1]] = left
    basis[moving, left.shape[1] + np.arange(len(moving))] = 1.0
    for j in (*sticking[~whole.stop[sticking]], *carried):
        # a ball at a place that a stop holds is at rest to the last bit
        moved, push = np.asarray(left), whole.force[:n, j]
        basis[n + j, : left.shape[1]] = _without_rounding(push @ moved, np.abs(push) @ np.abs(moved))
    return basis


def _without_rounding(sums: Array, sizes: Array) -> Array:
    """Sums that are zero where nothing but rounding is left of terms of these sizes."""
    return np.where(np.abs(sums) > ROUNDED * sizes, sums, 0.0)


def _rate(rows: Rows, modes: ComplexModes) -> Rows:
    """Rates of scalars that have no direct part of s or ub'."""
    zero = np.zeros(rows.weight.shape[0])
    return Rows(
        weight=rows.weight @ modes.rate,
        rigid_body=rows.rigid_body_rate,
        rigid_body_rate=rows.rigid_body,
        constant=0.0 * rows.constant,
        through=np.array([zero, rows.through[2], zero]),
        follow=np.array([zero, *rows.follow[:-1]]),
    )


def _scaled(rows: Rows, factor: Array, also: Rows, by: Array) -> Rows:
    """Sum of two sets of rows, each row with its own factor."""
    first, second = factor[:, None], by[:, None]
    return Rows(
        weight=first * rows.weight + second * also.weight,
        rigid_body=first * rows.rigid_body + second * also.rigid_body,
        rigid_body_rate=first * rows.rigid_body_rate + second * also.rigid_body_rate,
        constant=first * rows.constant + second * also.constant,
        through=factor * rows.through + by * also.through,
        follow=factor * rows.follow + by * also.follow,
    )


def gap_rows(whole: Equations, rows: Rows, base: tuple[int, int]) -> Rows:
    """Rows of x_j = -P_j p - in_space_j ub, or of x_j'.

    Parameters
    ----------
    whole : Equations
    rows : Rows
        Of all coordinates, or their rates.
    base : tuple of int
        Which of the inputs in `through` and in `follow` is the base's motion: ub, or ub'.
    """
    P = -whole.force.T
    through, follow = rows.through @ P.T, rows.follow @ P.T
    through[base[0]] -= whole.in_space
    follow[base[1]] -= whole.in_space
    return Rows(P @ rows.weight, P @ rows.rigid_body, P @ rows.rigid_body_rate, P @ rows.constant, through, follow)


def driven_entries(modes: ComplexModes, rate: float | None) -> int:
    """Number of the entries, the slowest ones, that are advanced with their whole response to polynomials.

    The response of a fast entry is a polynomial itself, beside the exponential: a sum of derivatives of s over powers
    of lambda, which for a slow one are large and cancel the exponential.

    Parameters
    ----------
    modes : ComplexModes
    rate : float or None, 1/s
        Of the polynomials; none of a sine or of straight lines is driven.
    """
    if not rate:
        return 0
    count = int(np.argmax(np.append(modes.size > SLOW * rate, True)))
    for first, length in modes.blocks:
        if first < count < first + length:
            count = int(first)
    return count


def followed(rows: Rows, modes: ComplexModes, load: Complex, driven: int) -> Array:
    """Steady response (8, R) of scalars under a polynomial, as in `Rows.follow`, without that of driven entries."""
    fast = slice(driven, None)
    rate = modes.rate[fast, fast]
    response = np.zeros((ORDERS, load.shape[1]), dtype=complex)
    before = np.zeros(load.shape[1] - driven, dtype=complex)
    for order in range(ORDERS):
        # G' = Lambda G + load (s, ub', ub) with G a sum over ub and its derivatives
        own = load[2 - order, fast] if order < 3 else 0.0
        before = scipy.linalg.solve_triangular(rate, before - own) if before.size else before
        response[order, fast] = before
    follow = (response @ rows.weight.T).real
    follow[:3] += rows.through[::-1]
    return np.asarray(follow)


def _compliant_forces(
    whole: Equations, form: ClosedForm, loads: _Loads, response: _SteadyResponse, active: NDArray[np.bool_],
    stiffness: Array, damping: Array,
) -> Rows:  # fmt: skip
    """Forces k (x - w) + c x' of every compliant pair; of those in contact without a difference of near numbers."""
    P = -whole.force.T
    x, rate = gap_rows(whole, form.position, OF_DISPLACEMENT), gap_rows(whole, form.velocity, OF_VELOCITY)
    depth = P @ response.constant
    wall = np.where(active[:, None], -loads.unmet, -np.eye(active.size))
    own = np.where(active[:, None], 0.0, P @ loads.offset)
    x.constant[:, 0] = depth[:, 0]
    x.constant[:, 1:] = depth[:, 1:] + own + wall
    moved = -(loads.unmet @ whole.in_space)
    follow_depth = P @ response.follow[0] + moved
    x.follow[0] = np.where(active, follow_depth, x.follow[0])
    x.through[2] = np.where(active, moved, x.through[2])
    rate.follow[1] = np.where(active, follow_depth, rate.follow[1])
    rate.through[1] = np.where(active, moved, rate.through[1])
    return _scaled(x, stiffness, rate, damping)


def _with_sticking(
    whole: Equations,
    form: ClosedForm,
    loads: _Loads,
    response: _SteadyResponse,
    sticking: NDArray[np.intp],
    force: Rows,
) -> Rows:
    """Forces of the pairs that stick: what the equations of motion leave over."""
    M, C, K = whole.M, loads.C, loads.K
    directions = whole.force[:, sticking]
    inverse = np.linalg.solve(M, directions)
    # F = (P^T M^-1 P)^-1 P^T M^-1 (M p'' + C p' + K p - loads)
    coupling = np.linalg.inv(directions.T @ inverse)
    # where nothing moves a ball no force holds it: its sign would be that of rounding
    project = _without_rounding(coupling @ inverse.T, np.abs(coupling) @ np.abs(inverse.T))
    shape, rate, modes = form.position.weight, form.velocity.weight, form.modes
    left = M @ (rate @ modes.rate) + C @ rate + K @ shape
    # the response of the entries to a load begins with an acceleration
    begun = (rate @ form.load.T).real.T
    rigid_body = M @ form.rigid_body_shape
    drive = loads.drive
    driven = rigid_body @ form.rigid_body_drive
    a = response.follow
    follow = np.array([
        a[0] @ K.T - drive[2],
        a[1] @ K.T + a[0] @ C.T - drive[1],
        a[2] @ K.T + a[1] @ C.T + a[0] @ M.T - drive[0] + driven,
        *(a[i] @ K.T + a[i - 1] @ C.T + a[i - 2] @ M.T for i in range(3, ORDERS)),
    ])  # fmt: skip
    through = np.array([begun[0] @ M.T - drive[0] + driven, begun[1] @ M.T - drive[1], begun[2] @ M.T - drive[2]])
    force.weight[sticking] = project @ left
    force.rigid_body[sticking] = force.rigid_body_rate[sticking] = 0.0
    force.constant[sticking] = project @ (K @ response.constant - loads.constant + rigid_body @ form.rigid_body_given)
    force.through[:, sticking] = through @ project.T
    force.follow[:, sticking] = follow @ project.T
    return force
