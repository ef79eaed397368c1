"""Free motions of a damped structure, u'' + D u' + Omega^2 u = 0, in closed form: also where eigenvalues repeat.

With an invariant pair (X, S), X S^2 + D X S + Omega^2 X = 0, every X e^{S t} h is a motion. An eigenvalue that stands
alone has S = lambda. Eigenvalues that lie together share one pair: it is made diagonal where its eigenvectors are
well apart (equal parts), and stays an upper triangular block where they are not (nearly critical damping).
Eigenvalues of nearly zero frequency share one pair too, over displacements and velocities as they are: the motions of
each alone would be large, and nearly cancel.
Pairs are orthogonal to one another with respect to B = [[D, I], [I, 0]] on (u, u'), so that each has its coordinates
h = G^-1 (X^T (D u + u') + S^T X^T u),   G = X^T D X + X^T X S + S^T X^T X.

Those of F structures are computed together where their eigenvalues have the same pattern, each with the bits that it
has alone.

Tisseur, Meerbergen (2001), The quadratic eigenvalue problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex
from femimpact.errors import DivergenceError

T = TypeVar("T")


def groups_of_equal_marks(
    *marks: NDArray[np.bool_ | np.int64],  # (F, ...) of each of F items, as which of its coordinates are coupled
) -> list[NDArray[np.intp]]:
    """Numbers of the items that have the same marks, group by group."""
    count = marks[0].shape[0]
    if count == 1:
        return [np.zeros(1, dtype=np.intp)]
    rows = np.concatenate([each.reshape(count, -1) for each in marks], axis=1)
    if np.all(rows == rows[0]):
        return [np.arange(count)]
    kinds, kind = np.unique(rows, axis=0, return_inverse=True)
    return [np.flatnonzero(kind.reshape(-1) == number) for number in range(kinds.shape[0])]


def part_of(
    items: T,  # dataclass: fields that its attribute `COMMON` names are the same for all items
    members: NDArray[np.intp] | int,  # or int: rising, each once. Of all items the dataclass itself is returned.
) -> T:
    """Some of the items of a dataclass of arrays (F, ...), or one of them without the axis."""
    record: Any = items
    common = getattr(record, "COMMON", ())
    values = {item.name: getattr(record, item.name) for item in fields(record) if item.name not in common}
    counts = (value.shape[0] for value in values.values() if isinstance(value, np.ndarray))
    if isinstance(members, np.ndarray) and members.size == next(counts):
        return items
    chosen = {
        name: part_of(value, members) if is_dataclass(value) else value[members] for name, value in values.items()
    }
    changed: T = replace(record, **chosen)
    return changed


def stack(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Arrays in one, with an axis before the others; of a single one a view, which takes a tenth of the time."""
    return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)


WELL_APART = 30.0
"""Condition of a block's eigenvectors up to which it is made diagonal: the ledger loses its square in digits."""

ROUNDING = 1e-14
"""Couplings within a block below this share of its size are rounding."""


def diagonal_where_apart(X: Complex, S: Complex) -> tuple[Complex, Complex]:
    """The pair without couplings of the size of rounding; diagonal where its eigenvectors are well apart."""
    S = np.where(np.abs(S) > ROUNDING * float(np.abs(np.diag(S)).max()), S, np.diag(np.diag(S)))
    if np.any(np.triu(S, 1)):
        values, vectors = scipy.linalg.eig(S)
        if np.linalg.cond(vectors) <= WELL_APART:
            X, S = X @ vectors, np.diag(values)
    return X, S


def _invariant(state: Array, values: Complex, members: NDArray[np.intp]) -> tuple[Complex, Complex]:
    """Orthonormal basis of the invariant subspace of some eigenvalues (its upper half), and the triangular S."""

    def chosen(value: Any) -> bool:
        return bool(int(np.argmin(np.abs(values - value))) in members)

    schur: Any = scipy.linalg.schur
    triangular, vectors, m = schur(state.astype(complex), output="complex", sort=chosen)
    return vectors[: state.shape[0] // 2, :m], triangular[:m, :m]


def _refined_pair(X: Complex, S: Complex, omega_squared: Array, damping: Array) -> tuple[Complex, Complex]:
    """An invariant pair after two Newton steps: slow decays keep their digits beside fast modes (Kressner, 2009)."""
    for _ in range(2):
        try:
            X, S = _newton_step(X, S, omega_squared, damping)
        except np.linalg.LinAlgError:
            break
        S, turned = scipy.linalg.schur(S, output="complex")
        X = X @ turned
    return X, S


def _newton_step(X: Complex, S: Complex, omega_squared: Array, damping: Array) -> tuple[Complex, Complex]:
    n, m = X.shape
    rates, square = X @ S, S @ S
    residual = X @ square + damping @ rates + omega_squared[:, None] * X
    dX, dS = np.zeros_like(X), np.zeros_like(S)
    for j in range(m):
        s = S[j, j]
        border = np.zeros((n + m, n + m), dtype=complex)
        border[:n, :n] = s * damping + np.diag(s * s + omega_squared)
        border[:n, n:] = X @ (S + s * np.eye(m)) + damping @ X
        # the correction is orthogonal to the pair itself, in the energy, or as if slow motions had that of others
        border[n:, :n] = (np.maximum(omega_squared, SLOW**2)[:, None] * X).conj().T + s * rates.conj().T
        border[n:, n:] = rates.conj().T @ X
        earlier = dX[:, :j] @ S[:j, j]
        right = np.concatenate([
            -residual[:, j] - dX[:, :j] @ square[:j, j] - damping @ earlier - X @ (dS[:, :j] @ S[:j, j]),
            -rates.conj().T @ earlier,
        ])  # fmt: skip
        # rows scaled to one another: rounding of the fast modes must not exceed the slow ones
        scale = 1.0 / np.max(np.abs(border), axis=1)
        step = np.linalg.solve(border * scale[:, None], right * scale)
        dX[:, j], dS[:, j] = step[:n], step[n:]
    return X + dX, S + dS


SLOW = 0.9
"""|lambda| (1/s) up to which a motion is slow: its displacement and its velocity times 1 s are of one size."""

TOGETHER = 0.1
"""Eigenvalues nearer to one another than this share of their size are treated as one block."""

COMPLETE = 1e-6
"""Error of a motion at its start beyond which modes are called incomplete; rounding is far below."""


@dataclass(frozen=True, eq=False)
class ComplexModes:
    """u(t) = Re(shape e^{(diag(exponent) + coupling) t} H) of F structures: n coordinates, K entries of H each."""

    COMMON: ClassVar = ("blocks",)

    exponent: Complex  # (F, K) 1/s: lambda, the slow ones first; Re <= 0
    coupling: Complex  # (F, K, K) 1/s: above the diagonal of the blocks; zero elsewhere
    # (B, 2) first entry and number of entries of each block that is not diagonal, the same for all
    blocks: NDArray[np.int64]
    shape: Complex  # (F, n, K)
    from_u: Complex  # (F, K, n) H = from_u u + from_v u'
    from_v: Complex  # (F, K, n)

    @cached_property
    def slow(self) -> NDArray[np.int64]:
        """Number (F,) of the first entries among which all slow ones are, whole blocks."""
        is_slow = np.abs(self.exponent) <= SLOW
        for first, count in self.blocks:
            is_slow[:, first : first + count] |= is_slow[:, first : first + count].any(axis=1, keepdims=True)
        return np.asarray((is_slow * np.arange(1, is_slow.shape[1] + 1)).max(axis=1, initial=0))

    @property
    def size(self) -> Array:
        """|lambda| of every entry, ndarray (F, K); within a block its norm: no motion of it is faster."""
        size: Array = np.abs(self.exponent)
        for first, count in self.blocks:
            of_block = slice(first, first + count)
            size[:, of_block] = np.linalg.norm(self.rate[:, of_block, of_block], 2, axis=(1, 2))[:, None]
        return size

    @cached_property
    def rate(self) -> Complex:
        """H' = rate @ H, ndarray (F, K, K)."""
        rate, entries = self.coupling.copy(), np.arange(self.exponent.shape[1])
        rate[:, entries, entries] += self.exponent
        return rate


@dataclass(frozen=True, eq=False)
class _Part:
    """Some entries over the coordinates that they move, of F structures: k entries, m coordinates.

    Of coordinates that have one entry each the diagonals stand in place of the matrices, (F, k).
    """

    members: NDArray[np.intp]  # (m,)
    S: Complex  # (F, k, k) upper triangular; a block unless diagonal
    X: Complex  # (F, m, k), twice where the conjugate entry is left out
    from_u: Complex  # (F, k, m)
    from_v: Complex  # (F, k, m)


@dataclass(frozen=True, eq=False)
class _Component:
    """Coordinates that damping couples, of F structures, and the eigenvalues of their motions."""

    COMMON: ClassVar = ("members",)

    members: NDArray[np.intp]  # (m,)
    omega_squared: Array  # (F, m)
    damping: Array  # (F, m, m)
    unit: Array  # (F, m)
    state: Array  # (F, 2 m, 2 m)
    values: Complex  # (F, 2 m)
    right: Complex  # (F, 2 m, 2 m)
    near: NDArray[np.bool_]  # (F, 2 m, 2 m) whether two eigenvalues lie together

    @property
    def alone(self) -> NDArray[np.bool_]:
        """True for eigenvalues that lie with no other one, (F, 2 m)."""
        return np.asarray(np.count_nonzero(self.near, axis=2) == 1)


SWINGING, CREEPING, CRITICAL, DRIFTING, COUPLED = range(5)
"""How a coordinate moves: with an entry, with two real ones, with a block, slowly, or with others."""


def complex_modes(
    omega_squared: Array,  # (F, n) 1/s^2: omega^2, >= 0
    damping: Array,  # (F, n, n) 1/s: D, symmetric, positive semidefinite
) -> list[tuple[NDArray[np.intp], ComplexModes]]:
    """Closed forms of u'' + D u' + Omega^2 u = 0 of F structures.

    Returns (ndarray of int, ComplexModes): numbers of structures of which entries have the same pattern, and theirs.

    Raises `DivergenceError` if the modes do not give back displacements and velocities: they span too many decades.
    """
    coupled = _coupled_coordinates(damping)
    alone = _kinds(omega_squared, np.diagonal(damping, axis1=1, axis2=2))
    kinds: NDArray[np.int64] = np.where(coupled.any(axis=1), COUPLED, alone)
    groups = []
    for members in groups_of_equal_marks(coupled, kinds):
        square, D = omega_squared[members], damping[members]
        components = [_component(linked, square, D) for linked in _linked(coupled[members[0]]) if linked.size > 1]
        has_blocks = np.any((kinds[members] == CRITICAL) | (kinds[members] == DRIFTING), axis=1)
        for part in _groups_of_equal_eigenvalues(components, has_blocks):
            parts = _uncoupled(kinds[members[0]], square[part], np.diagonal(D[part], axis1=1, axis2=2))
            for component in components:
                parts += _coupled(part_of(component, part))
            modes = _joined(parts, omega_squared.shape[1], part.size)
            _check_complete(modes)
            groups.append((members[part], modes))
    return groups


def _groups_of_equal_eigenvalues(components: list[_Component], has_blocks: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Numbers of structures with as many entries in each component; blocks are made one structure at a time."""
    count = has_blocks.size
    if count == 1 or not (components or has_blocks.any()):
        return [np.arange(count)]
    entries = [np.count_nonzero(component.values.imag >= 0.0, axis=1, keepdims=True) for component in components]
    simple = ~has_blocks
    for component in components:
        simple &= component.alone.all(axis=1)
    return groups_of_equal_marks(np.where(simple, -1, np.arange(count)), *entries)


def _joined(parts: list[_Part], n: int, count: int) -> ComplexModes:
    """All entries of `count` structures, in the order of their size."""
    size = sum(part.S.shape[1] for part in parts)
    S, key = np.zeros((count, size, size), dtype=complex), np.zeros((count, size))
    shape = np.zeros((count, n, size), dtype=complex)
    from_u, from_v = np.zeros((2, count, size, n), dtype=complex)
    sizes, first = np.ones(size, dtype=np.int64), 0
    for part in parts:
        columns = slice(first, first + part.S.shape[1])
        entries, first = np.arange(columns.start, columns.stop), columns.stop
        if part.S.ndim == 2:
            S[:, entries, entries], shape[:, part.members, entries] = part.S, part.X
            from_u[:, entries, part.members], from_v[:, entries, part.members] = part.from_u, part.from_v
            key[:, columns] = np.abs(part.S)
            continue
        S[:, columns, columns], shape[:, part.members, columns] = part.S, part.X
        from_u[:, columns, part.members], from_v[:, columns, part.members] = part.from_u, part.from_v
        key[:, columns] = np.abs(np.diagonal(part.S, axis1=1, axis2=2))
        if count == 1 and np.any(np.triu(part.S, 1)):
            # entries of a block stay side by side
            key[:, columns], sizes[columns] = key[:, columns].mean(), entries.size
    order = np.argsort(key, axis=1, kind="stable")
    case = np.arange(count)[:, None]
    S, sizes = S[case[:, :, None], order[:, :, None], order[:, None, :]], sizes[order[0]]
    exponent, blocks, k = np.diagonal(S, axis1=1, axis2=2), list[tuple[int, int]](), 0
    has_blocks = bool(np.any(sizes > 1))
    while has_blocks and k < size:
        if sizes[k] > 1:
            blocks.append((k, int(sizes[k])))
        k += int(sizes[k])
    # no motion grows: what does is rounding, unless its block lets velocities become displacements
    drifts = (sizes > 1) & (np.abs(exponent) <= SLOW)
    return ComplexModes(
        np.where(drifts, exponent.real, np.minimum(exponent.real, 0.0)) + 1j * exponent.imag,
        np.triu(S, 1) if has_blocks else np.zeros((count, size, size), dtype=complex),
        np.array(blocks, dtype=np.int64).reshape(-1, 2),
        shape[case[:, :, None], np.arange(n)[:, None], order[:, None, :]],
        from_u[case, order],
        from_v[case, order],
    )


def _check_complete(modes: ComplexModes) -> None:
    """Refuse a closed form that does not give back the displacements and velocities it is made of."""
    unit = np.eye(modes.shape.shape[1])
    both = modes.shape @ modes.from_u, modes.shape @ modes.rate @ modes.from_v
    error = max(float(np.abs(each.real - unit).max(initial=0.0)) for each in both)
    if not error < COMPLETE:
        raise DivergenceError(
            f"the closed form of the damped structure misses its start by {error:.2g} (bound {COMPLETE:g}): its "
            "complex modes do not separate; Newmark needs none"
        )


def _coupled_coordinates(damping: Array) -> NDArray[np.bool_]:
    """Mask of pairs of coordinates that damping couples, (F, n, n); terms of the size of rounding couple nothing."""
    diagonal = np.diagonal(damping, axis1=1, axis2=2)
    # a dashpot that does not act on a mode may leave rounding below zero
    scale = np.sqrt(np.abs(diagonal[:, :, None] * diagonal[:, None, :]))
    off, largest = np.abs(damping), diagonal.max(axis=1, initial=0.0)[:, None, None]
    coupled = (off > 1e-12 * (scale + 1e-300)) & (off > 1e-13 * largest)
    return np.asarray(coupled & ~np.eye(diagonal.shape[1], dtype=bool))


def _linked(near: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Groups of a symmetric relation."""
    if np.count_nonzero(near) == np.count_nonzero(near.diagonal()):
        return [np.array([i]) for i in range(near.shape[0])]
    # whom each is linked to over ever longer chains; a graph library takes ten times as long for so few
    reached, chain = near | np.eye(near.shape[0], dtype=bool), 1
    while chain < near.shape[0]:
        reached, chain = reached @ reached, 2 * chain
    label = reached.argmax(axis=0)
    return [np.flatnonzero(label == i) for i in np.unique(label)]


def _kinds(omega_squared: Array, damping: Array) -> NDArray[np.int64]:
    """How each coordinate (F, n) would move alone."""
    discriminant = 0.25 * damping * damping - omega_squared
    root = np.sqrt(np.abs(discriminant))
    together = 2.0 * root <= TOGETHER * np.maximum(0.5 * damping, root)
    fastest = np.where(discriminant < 0.0, np.sqrt(omega_squared), 0.5 * damping + root)
    kinds = np.where(together, CRITICAL, np.where(discriminant < 0.0, SWINGING, CREEPING))
    return np.where(fastest <= SLOW, DRIFTING, kinds)


def _uncoupled(kinds: NDArray[np.int64], omega_squared: Array, damping: Array) -> list[_Part]:
    """Coordinates that move alone: lambda = -c/2 +- sqrt(c^2/4 - omega^2)."""
    parts = []
    for i in np.flatnonzero(kinds == CRITICAL):
        coordinate = np.array([i])
        parts += _coupled(_component(coordinate, omega_squared, damping[:, :, None] * np.eye(kinds.size)))
    root = np.sqrt(np.abs(0.25 * damping * damping - omega_squared))
    parts += [_drifting(i, omega_squared, damping) for i in np.flatnonzero(kinds == DRIFTING).tolist()]
    swinging, creeping = np.flatnonzero(kinds == SWINGING), np.flatnonzero(kinds == CREEPING)
    if swinging.size:
        sigma, w = -0.5 * damping[:, swinging], root[:, swinging]
        parts.append(_diagonal(swinging, sigma + 1j * w, 2.0, 0.5 + 0.5j * sigma / w, -0.5j / w))
    if creeping.size:
        # the slow one from the product of both: no difference of near numbers
        fast = -0.5 * damping[:, creeping] - root[:, creeping]
        slow = omega_squared[:, creeping] / fast
        apart = slow - fast
        parts.append(_diagonal(creeping, slow, 1.0, -fast / apart, 1.0 / apart))
        parts.append(_diagonal(creeping, fast, 1.0, slow / apart, -1.0 / apart))
    return parts


def _drifting(member: int, omega_squared: Array, damping: Array) -> _Part:
    """A slow coordinate u, and u' - lambda_1 u: nothing is divided, and neither grows where lambda vanishes."""
    square, sigma = omega_squared[:, member].astype(complex), 0.5 * damping[:, member]
    fast = -sigma - np.sqrt(sigma * sigma - square)
    # from the product of both: no difference of near numbers
    slow = np.divide(square, fast, out=np.zeros_like(square), where=fast != 0.0)
    one, none = np.ones_like(slow), np.zeros_like(slow)
    S = np.stack([np.stack([slow, one], axis=1), np.stack([none, fast], axis=1)], axis=1)
    from_u, from_v = np.stack([one, -slow], axis=1), np.stack([none, one], axis=1)
    return _Part(
        np.array([member]), S, np.stack([one, none], axis=1)[:, None, :], from_u[:, :, None], from_v[:, :, None]
    )


def _diagonal(members: NDArray[np.intp], value: Any, weight: float, from_u: Any, from_v: Any) -> _Part:
    """One entry for each of some coordinates."""
    S, to_u, to_v = (np.asarray(each, dtype=complex) for each in (value, from_u, from_v))
    return _Part(members, S, np.full(S.shape, weight, dtype=complex), to_u, to_v)


def _component(members: NDArray[np.intp], omega_squared: Array, damping: Array) -> _Component:
    """Eigenvalues of coordinates (m,) that damping couples, or of one near its critical damping."""
    square, D = omega_squared[:, members], damping[:, members[:, None], members]
    # (unit u, u'): the norm of the state is its energy, and no motion grows in it but slow ones
    unit = np.sqrt(np.maximum(square, np.maximum(1e-12 * square.max(axis=1), SLOW**2)[:, None]))
    n = members.size
    state, i = np.zeros((square.shape[0], 2 * n, 2 * n)), np.arange(n)
    state[:, i, n + i], state[:, n + i, i], state[:, n:, n:] = unit, -square / unit, -D
    values, right = np.linalg.eig(state)
    both = np.abs(values[:, :, None]), np.abs(values[:, None, :])
    near = 2.0 * np.abs(values[:, :, None] - values[:, None, :]) <= TOGETHER * (both[0] + both[1])
    near |= np.maximum(*both) <= SLOW
    return _Component(members, square, D, unit, state, values.astype(complex), right.astype(complex), near)


def _coupled(component: _Component) -> list[_Part]:
    """Entries of coordinates that damping couples, one of every two conjugate ones; blocks of one structure alone."""
    parts, alone = list[_Part](), component.alone
    if not np.all(alone):
        linked = [block for block in _linked(component.near[0]) if block.size > 1]
        # of two conjugate blocks one is enough
        parts = [_block(component, block) for block in linked if not np.all(component.values[0, block].imag < 0.0)]
    chosen = alone & (component.values.imag >= 0.0)
    if np.any(chosen):
        # as many of each structure
        entries = np.nonzero(chosen)[1].reshape(chosen.shape[0], -1)
        parts.append(_simple(component, entries))
    return parts


def _block(component: _Component, members: NDArray[np.intp]) -> _Part:
    """Entries of some eigenvalues that lie together, of one structure."""
    values, damping = component.values[0], component.damping[0]
    X, S = _invariant(component.state[0], values, members)
    X, S = _refined_pair(X / component.unit[0][:, None], S, component.omega_squared[0], damping)
    X, S = diagonal_where_apart(X, S)
    weight = 1.0 if bool(np.any(values[members].imag <= 0.0)) else 2.0
    n, turned = X.shape[0], damping @ X
    G = X.T @ turned + X.T @ X @ S + S.T @ X.T @ X
    both = np.linalg.solve(G, np.hstack([turned.T + S.T @ X.T, X.T])).astype(complex)
    return _Part(component.members, S[None], weight * X[None], both[None, :, :n], both[None, :, n:])


def _simple(component: _Component, entries: NDArray[np.intp]) -> _Part:
    """Entries (F, k) of eigenvalues that stand alone, after two Newton steps: slow decays keep their digits."""
    n, (count, k) = component.members.size, entries.shape
    case, rows = np.arange(count)[:, None], np.arange(k)
    values, damping, square = component.values[case, entries], component.damping, component.omega_squared
    X = component.right[case[:, :, None], np.arange(n)[:, None], entries[:, None, :]] / component.unit[:, :, None]
    real = values.imag == 0.0
    pivot = np.argmax(np.abs(X), axis=1)
    X = X / X[case, pivot, rows][:, None, :]
    for _ in range(2):
        border = np.zeros((count, k, n + 1, n + 1), dtype=complex)
        border[..., :n, :n] = values[:, :, None, None] * damping[:, None]
        border[..., range(n), range(n)] += values[:, :, None] ** 2 + square[:, None, :]
        residual = (border[..., :n, :n] @ X.mT[..., None])[..., 0]
        border[..., :n, n] = (2.0 * values[:, None, :] * X + damping @ X).mT
        border[case, rows, n, pivot] = 1.0
        # rows scaled to one another: rounding of the fast modes must not exceed the slow one
        scale = 1.0 / np.max(np.abs(border), axis=3)
        right = np.concatenate([-residual, np.zeros((count, k, 1))], axis=2) * scale
        step = np.linalg.solve(border * scale[..., None], right[..., None])[..., 0]
        X, values = X + step[..., :n].mT, values + step[..., n]
    values, X = np.where(real, values.real, values), np.where(real[:, None, :], X.real, X)
    # the left vector of a symmetric problem: x^T (v + (lambda + D) u) / x^T (2 lambda + D) x
    turned = damping @ X
    norm = (X * (2.0 * values[:, None, :] * X + turned)).sum(axis=1, keepdims=True)
    weight = np.where(real, 1.0, 2.0)[:, None, :]
    S = values[:, :, None] * np.eye(k)
    return _Part(component.members, S, weight * X, ((values[:, None, :] * X + turned) / norm).mT, (X / norm).mT)
