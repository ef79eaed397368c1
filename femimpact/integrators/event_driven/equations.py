"""The equations of structure and balls together, and their undamped modes: slow ones to rounding beside stiff walls."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import require
from femimpact.integrators.channel_rows import Drive
from femimpact.integrators.event_driven.complex_modes import SLOW, groups_of_equal_marks, part_of, stack
from femimpact.system.system import System

RIGID = 1e-14
"""Eigenvalues below this share of the largest are rigid motions, where the stiffness is singular."""

GIVING_WAY = 1e-6
"""Share of the largest deflection under the pushes of soft stops below which they are not met each, but give way."""

ORTHOGONAL = 1e-15
"""Cosine of the angle between two columns below which they are orthogonal to rounding."""

MOST_SWEEPS = 30
"""Sweeps of Jacobi rotations, of which some ten are enough; rounding may leave nothing orthogonal to the last digit."""

INDEPENDENT = 1e-9
"""Share of its mobility that a rigid stop must keep where others hold the structure, to be met beside them."""


@dataclass(frozen=True, eq=False)
class Equations:
    """M p'' + C p' + K p = drive s(t) + given + sum_j force_j F_j of p = (u, y); stops have no coordinate.

    Those of F systems with the same coordinates and pairs stand in one, with an axis (F, ...) before those of M to
    `in_space`; see `stacked`.
    """

    COMMON: ClassVar = ("stop", "rigid", "names", "dofs")

    M: Array  # (d, d)
    C: Array  # (d, d)
    K: Array  # (d, d)
    drive: Array  # (H, d) loads per unit of each s(t), the base's first; constant load, N
    given: Array  # (d,)
    # (d, pairs) what a force on the structure at each pair does to the coordinates: b there, -1 on its ball; of two
    # balls that meet -1 on the first and 1 on the second
    force: Array
    # (pairs,) x_j = -force_j p - in_space_j ub: -1 for a stop that stays where it is while the base moves, else 0
    in_space: Array
    stop: NDArray[np.bool_]  # (pairs,)
    rigid: NDArray[np.bool_]  # (pairs,)
    names: tuple[str, ...]  # of the pairs
    dofs: int  # of the structure


def stacked(items: Sequence[Equations]) -> Equations:
    """Equations of several systems with the same coordinates and pairs, in one."""
    first = items[0]
    names = [item.name for item in fields(Equations) if item.name not in Equations.COMMON]
    arrays: dict[str, Any] = {name: stack([getattr(each, name) for each in items]) for name in names}
    return replace(first, **arrays)


def equations_of(system: System, drive: Drive) -> Equations:
    """Matrices and loads over all structure dofs and all balls."""
    n, balls = system.dofs, len(system.balls)
    size = n + balls
    M, C, K = (np.zeros((size, size)) for _ in range(3))
    for matrix, of_structure in ((M, system.M), (C, system.C), (K, system.K)):
        matrix[:n, :n] = of_structure.toarray()
    load, constant = np.zeros((1 + len(drive.more), size)), np.zeros(size)
    load[:, :n] = [loaded.load for loaded in drive.loads]
    constant[:n] = system.constant_load
    force = np.zeros((size, len(system.contacts)))
    for j, pair in enumerate(system.contacts):
        force[:n, j] = pair.direction
        if pair.is_stop:
            continue
        force[n + j, j] = -1.0
        M[n + j, n + j] = pair.mass
        load[0, n + j] = -pair.mass * drive.share
        constant[n + j] = pair.mass * pair.acceleration
        K += pair.free_stiffness * np.outer(force[:, j], force[:, j])
        if pair.free_damping:
            C += pair.free_damping * np.outer(force[:, j], force[:, j])
    for j, (first, second) in system.meetings.items():
        force[n + first, j], force[n + second, j] = -1.0, 1.0
    marks = [(pair.kind == "stop", pair.parameters.is_rigid, pair.fixed_to == "space") for pair in system.contacts]
    stop, rigid, fixed = np.array(marks, dtype=bool).reshape(-1, 3).T.copy()
    # where a force drives, the base rests in space
    in_space = np.where(fixed & stop, -drive.share, 0.0)
    names = tuple(pair.name for pair in system.contacts)
    return Equations(M, C, K, load, constant, force, in_space, stop, rigid, names, n)


def require_met(
    equations: Equations,
    sticking: NDArray[np.intp],  # numbers of the pairs that stick. A ball always can: it is a coordinate by itself.
) -> None:
    """Refuse rigid stops that the modes kept cannot meet at once."""
    if not np.any(equations.stop[sticking]):
        return
    n, met = equations.dofs, list[int]()
    lower = np.linalg.cholesky(equations.M[:n, :n])
    basis = np.zeros((n, 0))
    for stop in sticking[equations.stop[sticking]].tolist():
        # its square is the mobility; of what is left of it, that beside those met
        push = np.linalg.solve(lower, equations.force[:n, stop])
        left = push - basis @ (basis.T @ push)
        left -= basis @ (basis.T @ left)
        massless = (
            " and ".join(equations.names[j] for j in met) + f" hold the structure where {equations.names[stop]} is met"
        )
        allowed = (
            f"must keep modes in which all rigid stops in touch can be met: the {n} kept leave none; keep more, or"
        )
        fits = bool(left @ left > INDEPENDENT * (push @ push))
        require(fits, "system", massless, "", f"{allowed} make one of the stops compliant (KelvinVoigt)")
        basis = np.column_stack([basis, left / np.sqrt(left @ left)])
        met.append(stop)


def wall_offsets(
    equations: Equations,  # of F systems
    active: NDArray[np.bool_],  # (pairs,)
    sticking: NDArray[np.intp],  # numbers of the pairs in contact that stick; see `require_met`
) -> Array:  # (F, d, pairs)
    """Coordinates in which each pair in contact is just at a wall 1 m away and the others at theirs at 0.

    Pairs that stick are so exactly. Where pressed stops cannot be met beside them, the nearest.
    """
    if np.any(active & equations.stop):
        return np.stack(
            [_offsets_at_stops(part_of(equations, f), active, sticking) for f in range(equations.M.shape[0])]
        )
    # a ball at a wall 1 m away, of a structure that is undeformed
    offset = np.zeros(equations.force.shape)
    balls, of_contact = ball_coordinates(equations.force[0, equations.dofs :], np.flatnonzero(active), sticking)
    for j, column in of_contact.items():
        offset[:, equations.dofs :, j] = balls[:, column]
    return offset


def ball_coordinates(
    push: Array,  # (balls, pairs): `force` of the balls
    contacts: NDArray[np.intp],  # numbers of pairs
    sticking: NDArray[np.intp],  # those of them that stick, which come first
) -> tuple[Array, dict[int, int]]:
    """Motions (balls, balls) of balls of which one for each contact is its x alone, and its column by its number.

    A contact that those before it leave no motion has none.
    """
    motions, of_contact = np.eye(push.shape[0]), dict[int, int]()
    for j in sorted(contacts.tolist(), key=lambda j: (j not in sticking, j)):
        x = -push[:, j] @ motions
        able = np.setdiff1d(np.flatnonzero(x), list(of_contact.values()))
        if able.size:
            # rows of balls are 0, 1 and -1, and so are all sums
            column = of_contact[j] = int(able[0])
            motions[:, column] /= x[column]
            x[column] = 0.0
            motions -= np.outer(motions[:, column], x)
    return motions, of_contact


def _offsets_at_stops(equations: Equations, active: NDArray[np.bool_], sticking: NDArray[np.intp]) -> Array:
    """Those of one system, (d, pairs), where stops are in contact."""
    n, offset = equations.dofs, np.zeros(equations.force.shape)
    held = sticking[equations.stop[sticking]]
    stops = np.concatenate([held, np.setdiff1d(np.flatnonzero(active & equations.stop), held)])
    # the static deflection under a push: its force does no work on the motions that are left
    push = equations.force[:n, stops]
    deflection = np.asarray(np.linalg.lstsq(equations.K[:n, :n], push, rcond=None)[0], dtype=float)
    shape: Array = deflection if np.allclose(equations.K[:n, :n] @ deflection, push) else push
    offset[:n, stops] = _columns_meeting(shape, push, held.size)
    carried = np.flatnonzero(active & ~equations.stop)
    balls, of_contact = ball_coordinates(equations.force[n:], carried, sticking)
    for j, column in of_contact.items():
        offset[n:] += np.outer(balls[:, column], equations.force[:n, j] @ offset[:n])
        offset[n:, j] += balls[:, column]
    return offset


def _columns_meeting(shape: Array, push: Array, held: int) -> Array:
    """Sums of deflections in which each place is at 1 m and the others at 0: exactly of the first ones, `held`."""
    x = -push.T @ shape
    meeting = np.zeros_like(shape)
    if held:
        meeting[:, :held] = shape[:, :held] @ np.linalg.inv(x[:held, :held])
    if held < shape.shape[1]:
        # what the others can do while the first stay where they are
        beside = shape[:, held:] - meeting[:, :held] @ x[:held, held:]
        values, vectors = np.linalg.eigh(push[:, held:].T @ beside)
        # several at one place share a deflection, and the first may leave them none
        moved = values > GIVING_WAY * np.abs(np.diag(x)[held:]).max()
        meeting[:, held:] = -beside @ (vectors[:, moved] / values[moved]) @ vectors[:, moved].T
        meeting[:, :held] -= meeting[:, held:] @ (-push[:, held:].T @ meeting[:, :held])
    return meeting


def undamped_modes(K: Array, M: Array) -> tuple[Array, Array]:
    """All omega^2 (F, n) and mass-normalised vectors (F, n, n) of matrices (F, n, n).

    The slow modes are exact to rounding, as they carry the energy.
    """
    diagonal = np.eye(K.shape[-1], dtype=bool)
    uncoupled = ~(((K != 0.0) | (M != 0.0)) & ~diagonal).any(axis=(1, 2))
    unheld = np.abs(K).sum(axis=1) == 0.0
    alone = unheld & ((M != 0.0).sum(axis=1) == 1)
    omega_squared, vectors = np.zeros(K.shape[:2]), np.zeros_like(K)
    for members in groups_of_equal_marks(uncoupled, unheld, alone):
        matrices, first = (K[members], M[members]), members[0]
        if uncoupled[first]:
            stiffness, mass = (matrix[:, diagonal] for matrix in matrices)
            modes = stiffness / mass, diagonal / np.sqrt(mass)[:, None, :]
        elif np.any(unheld[first] & ~alone[first]):
            modes = _beside_rigid_motions(*matrices, unheld[first])
        else:
            modes = _held_modes(*matrices, alone[first])
        omega_squared[members], vectors[members] = modes
    return omega_squared, vectors


def _held_modes(K: Array, M: Array, alone: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Modes where what is not stiffened is a mass that moves alone."""
    bound, free = np.flatnonzero(~alone), np.flatnonzero(alone)
    block = np.ix_(np.arange(K.shape[0]), bound, bound)
    try:
        lower = np.linalg.cholesky(K[block])
    except np.linalg.LinAlgError:
        # some are singular: one after the other
        if K.shape[0] == 1:
            values, vectors = scipy.linalg.eigh(K[0], M[0])
            return np.where(values > RIGID * float(values[-1]), values, 0.0)[None], vectors[None]
        squares, shapes = zip(*(_held_modes(K[[f]], M[[f]], alone) for f in range(K.shape[0])), strict=True)
        return np.concatenate(squares), np.concatenate(shapes)
    # of the flexibility, whose largest eigenvalue is the slowest mode; solve_triangular would start BLAS
    # threads, which takes a thousand times as long as these few numbers
    flexible = np.linalg.solve(lower, np.linalg.solve(lower, M[block]).mT)
    values, z = np.linalg.eigh(0.5 * (flexible + flexible.mT))
    # fast motions are lost in the rounding of slow ones
    graded = (values.max(axis=1, initial=0.0) * SLOW**2 >= 1.0) | (values.min(axis=1, initial=np.inf) <= 0.0)
    values = np.where(graded[:, None], 1.0, values)
    omega_squared, vectors = np.zeros(K.shape[:2]), np.zeros_like(K)
    omega_squared[:, bound], vectors[block] = _fast_corrected(
        1.0 / values, np.linalg.solve(lower.mT, z) / np.sqrt(values)[:, None, :], K[block], M[block]
    )
    for f in np.flatnonzero(graded).tolist():
        modes = _graded_modes(lower[f], M[block][f])
        omega_squared[f, bound], vectors[f, bound[:, None], bound] = modes
    vectors[:, free, free] = 1.0 / np.sqrt(M[:, free, free])
    return omega_squared, vectors


def _graded_modes(lower: Array, M: Array) -> tuple[Array, Array]:
    """Modes of a stiffness lower lower^T, all to rounding: by Jacobi rotations, which leave columns their sizes.

    With M = C C^T, C^T lower^-T has the singular values 1/omega and, to its left, C^T times the modes (Demmel, Veselic,
    1992, Jacobi's method is more accurate than QR).
    """
    of_mass = np.linalg.cholesky(M)
    columns = scipy.linalg.solve_triangular(lower, of_mass, lower=True)
    for _ in range(MOST_SWEEPS):
        turned = False
        for p, q in itertools.combinations(range(M.shape[0]), 2):
            (large, both), (_, small) = columns[[p, q]] @ columns[[p, q]].T
            if abs(both) <= ORTHOGONAL * np.sqrt(large * small):
                continue
            turned, apart = True, (small - large) / (2.0 * both)
            tangent = np.copysign(1.0, apart) / (abs(apart) + np.hypot(1.0, apart))
            rotation = np.array([[1.0, -tangent], [tangent, 1.0]]) / np.hypot(1.0, tangent)
            columns[[p, q]] = rotation @ columns[[p, q]]
        if not turned:
            break
    period = np.linalg.norm(columns, axis=1)
    return period**-2.0, np.linalg.solve(of_mass.T, (columns / period[:, None]).T)


def _beside_rigid_motions(K: Array, M: Array, unheld: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Modes where nothing stiffens some coordinates that share mass with others: these modes have no momentum in them.

    M_RR z_R + M_RE z_E = 0 leaves K_EE z_E = omega^2 (M_EE - M_ER M_RR^-1 M_RE) z_E of the others.
    """
    every, rigid, others = np.arange(K.shape[0]), np.flatnonzero(unheld), np.flatnonzero(~unheld)
    of_rigid, of_others = np.ix_(every, rigid, rigid), np.ix_(every, others, others)
    lower = np.linalg.cholesky(M[of_rigid])
    carried = np.linalg.solve(M[of_rigid], M[np.ix_(every, rigid, others)])
    left = M[of_others] - M[np.ix_(every, others, rigid)] @ carried
    omega_squared, vectors = np.zeros(K.shape[:2]), np.zeros_like(K)
    omega_squared[:, others], z = undamped_modes(K[of_others], 0.5 * (left + left.mT))
    vectors[of_others], vectors[np.ix_(every, rigid, others)] = z, -carried @ z
    vectors[of_rigid] = np.linalg.inv(lower).mT
    return omega_squared, vectors


def _fast_corrected(omega_squared: Array, vectors: Array, K: Array, M: Array) -> tuple[Array, Array]:
    """Modes of a flexibility, fast ones first: those have lost the square of their frequency ratio in digits.

    They are made orthogonal to the slower ones, which keep theirs, and take omega^2 from the stiffness.
    """
    vectors = vectors.copy()
    for i in range(omega_squared.shape[1] - 1, -1, -1):
        slower, mode = vectors[:, :, i + 1 :], vectors[:, :, i : i + 1]
        mode = mode - slower @ (slower.mT @ (M @ mode))
        vectors[:, :, i : i + 1] = mode / np.sqrt(mode.mT @ M @ mode)
    fast = omega_squared > 1e-4 * omega_squared.max(axis=1, initial=0.0)[:, None]
    exact = (vectors * (K @ vectors)).sum(axis=1)
    return np.where(fast, exact, omega_squared), vectors
