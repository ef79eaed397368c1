"""Free motions of a damped structure, u'' + D u' + Omega^2 u = 0, in closed form: also where eigenvalues repeat.

With an invariant pair (X, S), X S^2 + D X S + Omega^2 X = 0, every X e^{S t} h is a motion. An eigenvalue that stands
alone has S = lambda. Eigenvalues that lie together share one pair: it is made diagonal where its eigenvectors are
well apart (equal parts), and stays an upper triangular block where they are not (nearly critical damping).
Pairs are orthogonal to one another with respect to B = [[D, I], [I, 0]] on (u, u'), so that each has its coordinates
h = G^-1 (X^T (D u + u') + S^T X^T u),   G = X^T D X + X^T X S + S^T X^T X.

Tisseur, Meerbergen (2001), The quadratic eigenvalue problem; Kressner (2009), A block Newton method for nonlinear
eigenvalue problems.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.errors import DivergenceError

__all__ = ["ComplexModes", "complex_modes"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

TOGETHER = 0.1
"""Eigenvalues nearer to one another than this share of their size are treated as one block."""

WELL_APART = 30.0
"""Condition of a block's eigenvectors up to which it is made diagonal: the ledger loses its square in digits."""

ROUNDING = 1e-14
"""Couplings within a block below this share of its size are rounding."""


COMPLETE = 1e-6
"""Error of a motion at its start beyond which modes are called incomplete; rounding is far below."""


@dataclass(frozen=True, eq=False)
class ComplexModes:
    """u(t) = Re(shape e^{(diag(exponent) + coupling) t} H), with n coordinates and K entries of H.

    Parameters
    ----------
    exponent : ndarray (K,), 1/s
        lambda, the slow ones first; Re <= 0.
    coupling : ndarray (K, K), 1/s
        Above the diagonal of the blocks; zero elsewhere.
    blocks : ndarray (B, 2) of int
        First entry and number of entries of each block that is not diagonal.
    shape : ndarray (n, K)
    from_u, from_v : ndarray (K, n)
        H = from_u u + from_v u'.
    """

    exponent: Complex
    coupling: Complex
    blocks: NDArray[np.int64]
    shape: Complex
    from_u: Complex
    from_v: Complex

    @property
    def size(self) -> Real:
        """|lambda| of every entry, ndarray (K,); within a block its norm: no motion of it is faster."""
        size: Real = np.abs(self.exponent)
        for first, count in self.blocks:
            own = slice(first, first + count)
            size[own] = np.linalg.norm(self.rate[own, own], 2)
        return size

    @property
    def rate(self) -> Complex:
        """H' = rate @ H, ndarray (K, K)."""
        return np.asarray(np.diag(self.exponent) + self.coupling)

    def integral(self, entry: Complex, duration: float) -> Complex:
        """Integral of e^{rate s} H over the duration, ndarray (K,)."""
        from scipy.sparse.linalg import expm_multiply

        mu = self.exponent
        safe = np.where(mu == 0.0, 1.0, mu)
        total = entry * np.where(mu == 0.0, duration, np.expm1(mu * duration) / safe)
        for first, count in self.blocks:
            own = slice(first, first + count)
            # e^A of A = [[rate, H], [0, 0]] t has the integral in its last column; scipy's expm of a triangular
            # matrix divides by differences of eigenvalues
            wide = np.zeros((count + 1, count + 1), dtype=complex)
            wide[:count, :count], wide[:count, count] = self.rate[own, own], entry[own]
            total[own] = expm_multiply(wide * duration, np.eye(count + 1, dtype=complex)[:, count])[:count]
        return np.asarray(total)

    @property
    def inverse_rate(self) -> Complex:
        """Inverse of `rate`, with zero where an exponent is zero."""
        scaled = np.where(self.exponent == 0.0, 1.0, self.exponent)
        inverse = np.linalg.inv(np.diag(scaled) + self.coupling)
        return np.asarray(inverse * (self.exponent != 0.0))


@dataclass(frozen=True, eq=False)
class _Part:
    """Some entries over the coordinates that they move: k of them, m coordinates.

    Of coordinates that have one entry each the diagonals stand in place of the matrices.
    """

    members: NDArray[np.intp]  # (m,)
    S: Complex  # (k, k) upper triangular; a block unless diagonal
    X: Complex  # (m, k), twice where the conjugate entry is left out
    from_u: Complex  # (k, m)
    from_v: Complex  # (k, m)


def complex_modes(omega_squared: Real, damping: Real) -> ComplexModes:
    """Closed form of u'' + D u' + Omega^2 u = 0.

    Parameters
    ----------
    omega_squared : ndarray (n,), 1/s^2
        Omega^2, >= 0.
    damping : ndarray (n, n), 1/s
        D, symmetric, positive semidefinite.

    Returns
    -------
    ComplexModes

    Raises
    ------
    DivergenceError
        If the modes do not give back displacements and velocities: they span too many decades.
    """
    alone, groups = _components(damping)
    parts = _uncoupled(alone, omega_squared, damping.diagonal())
    for members in groups:
        parts += _coupled(members, omega_squared[members], damping[np.ix_(members, members)])
    n, size = omega_squared.size, sum(part.S.shape[0] for part in parts)
    S, key = np.zeros((size, size), dtype=complex), np.zeros(size)
    shape, from_u, from_v = np.zeros((n, size), complex), np.zeros((size, n), complex), np.zeros((size, n), complex)
    sizes, first = np.zeros(size, dtype=np.int64), 0
    for part in parts:
        count = part.S.shape[0]
        own = slice(first, first + count)
        if part.S.ndim == 1:
            rows, entries = part.members, np.arange(first, first + count)
            S[entries, entries], shape[rows, entries] = part.S, part.X
            from_u[entries, rows], from_v[entries, rows] = part.from_u, part.from_v
            key[own], sizes[own] = np.abs(part.S), 1
            first += count
            continue
        S[own, own], shape[part.members, own] = part.S, part.X
        from_u[own, part.members], from_v[own, part.members] = part.from_u, part.from_v
        key[own], sizes[own] = np.abs(part.S.diagonal()), 1
        if count > 1 and np.any(np.triu(part.S, 1)):
            # entries of a block stay side by side
            key[own], sizes[own] = key[own].mean(), count
        first += count
    order = np.argsort(key, kind="stable")
    S, sizes = S[order[:, None], order], sizes[order]
    exponent, blocks, k = S.diagonal(), list[tuple[int, int]](), 0
    coupled = bool(np.any(sizes > 1))
    while coupled and k < size:
        if sizes[k] > 1:
            blocks.append((k, int(sizes[k])))
        k += int(sizes[k])
    modes = ComplexModes(
        np.minimum(exponent.real, 0.0) + 1j * exponent.imag,
        np.triu(S, 1) if coupled else np.zeros((size, size), dtype=complex),
        np.array(blocks, dtype=np.int64).reshape(-1, 2),
        shape[:, order],
        from_u[order],
        from_v[order],
    )
    _check_complete(modes)
    return modes


def _check_complete(modes: ComplexModes) -> None:
    """Refuse a closed form that does not give back the displacements and velocities it is made of."""
    unit = np.eye(modes.shape.shape[0])
    both = modes.shape @ modes.from_u, modes.shape @ modes.rate @ modes.from_v
    error = max(float(np.abs(each.real - unit).max(initial=0.0)) for each in both)
    if not error < COMPLETE:
        raise DivergenceError(
            f"the closed form of the damped structure misses its start by {error:.2g} (bound {COMPLETE:g}): its "
            "complex modes do not separate; Newmark needs none"
        )


def _components(damping: Real) -> tuple[NDArray[np.intp], list[NDArray[np.intp]]]:
    """Coordinates that move alone, and groups that damping couples; terms of the size of rounding couple nothing."""
    diagonal = np.diag(damping)
    # a dashpot that does not act on a mode may leave rounding below zero
    scale = np.sqrt(np.abs(np.outer(diagonal, diagonal)))
    off = np.abs(damping)
    coupled = (off > 1e-12 * (scale + 1e-300)) & (off > 1e-13 * float(diagonal.max(initial=0.0)))
    np.fill_diagonal(coupled, False)
    if not coupled.any():
        return np.arange(diagonal.size), []
    lonely = np.asarray(~coupled.any(axis=0))
    return np.flatnonzero(lonely), [members for members in _linked(coupled) if not lonely[members[0]]]


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


def _uncoupled(members: NDArray[np.intp], omega_squared: Real, damping: Real) -> list[_Part]:
    """Coordinates that move alone: lambda = -c/2 +- sqrt(c^2/4 - omega^2)."""
    if not members.size:
        return []
    c, square = damping[members], omega_squared[members]
    discriminant = 0.25 * c * c - square
    root = np.sqrt(np.abs(discriminant))
    together = 2.0 * root <= TOGETHER * np.maximum(0.5 * c, root)
    parts = []
    for i in np.flatnonzero(together):
        parts += _coupled(members[[i]], square[[i]], c[[i], None])
    swinging = np.flatnonzero(~together & (discriminant < 0.0))
    sigma, w = -0.5 * c[swinging], root[swinging]
    parts.append(_diagonal(members[swinging], sigma + 1j * w, 2.0, 0.5 + 0.5j * sigma / w, -0.5j / w))
    creeping = np.flatnonzero(~together & (discriminant >= 0.0))
    if not creeping.size:
        return parts
    # the slow one from the product of both: no difference of near numbers
    fast = -0.5 * c[creeping] - root[creeping]
    slow = square[creeping] / fast
    apart = slow - fast
    parts.append(_diagonal(members[creeping], slow, 1.0, -fast / apart, 1.0 / apart))
    parts.append(_diagonal(members[creeping], fast, 1.0, slow / apart, -1.0 / apart))
    return parts


def _diagonal(members: NDArray[np.intp], value: Any, weight: float, from_u: Any, from_v: Any) -> _Part:
    """One entry for each of some coordinates."""
    S, to_u, to_v = (np.asarray(each, dtype=complex) for each in (value, from_u, from_v))
    return _Part(members, S, np.full(members.size, weight, dtype=complex), to_u, to_v)


def _coupled(members: NDArray[np.intp], omega_squared: Real, damping: Real) -> list[_Part]:
    """Coordinates that damping couples, or one near its critical damping; one of every two conjugate entries."""
    # (unit u, u'): the norm of the state is its energy, and no motion grows in it
    unit = np.sqrt(np.maximum(omega_squared, 1e-12 * max(float(omega_squared.max()), 1.0)))
    n = unit.size
    state = np.block([[np.zeros((n, n)), np.diag(unit)], [-np.diag(omega_squared / unit), -damping]])
    values, right = scipy.linalg.eig(state)
    near = 2.0 * np.abs(values[:, None] - values) <= TOGETHER * (np.abs(values)[:, None] + np.abs(values))
    parts, alone = list[_Part](), []
    for own in _linked(near):
        if np.all(values[own].imag < 0.0):
            continue
        if own.size == 1:
            alone.append(own[0])
            continue
        X, S = _invariant(state, values, own)
        X, S = _refined_pair(X / unit[:, None], S, omega_squared, damping)
        weight = 1.0 if bool(np.any(values[own].imag <= 0.0)) else 2.0
        parts.append(_normalised(members, X, S, damping, weight))
    if alone:
        parts.append(_simple(members, values[alone], right[:n, alone] / unit[:, None], omega_squared, damping))
    return parts


def _simple(members: NDArray[np.intp], values: Complex, X: Complex, omega_squared: Real, damping: Real) -> _Part:
    """Entries of eigenvalues that stand alone, after two Newton steps: slow decays keep their digits beside fast."""
    n, k = X.shape
    rows, real = np.arange(k), values.imag == 0.0
    pivot = np.argmax(np.abs(X), axis=0)
    X = X / X[pivot, rows]
    for _ in range(2):
        border = np.zeros((k, n + 1, n + 1), dtype=complex)
        border[:, :n, :n] = values[:, None, None] * damping
        border[:, range(n), range(n)] += values[:, None] ** 2 + omega_squared
        residual = np.einsum("kij,jk->ki", border[:, :n, :n], X)
        border[:, :n, n] = (2.0 * values * X + damping @ X).T
        border[rows, n, pivot] = 1.0
        # rows scaled to one another: rounding of the fast modes must not exceed the slow one
        scale = 1.0 / np.max(np.abs(border), axis=2)
        right = np.concatenate([-residual, np.zeros((k, 1))], axis=1) * scale
        step = np.linalg.solve(border * scale[:, :, None], right[:, :, None])[:, :, 0]
        X, values = X + step[:, :n].T, values + step[:, n]
    values, X = np.where(real, values.real, values), np.where(real, X.real, X)
    # the left vector of a symmetric problem: x^T (v + (lambda + D) u) / x^T (2 lambda + D) x
    turned = damping @ X
    norm = np.einsum("ik,ik->k", X, 2.0 * values * X + turned)
    weight = np.where(real, 1.0, 2.0)
    return _Part(members, np.diag(values), weight * X, ((values * X + turned) / norm).T, (X / norm).T)


def _invariant(state: Real, values: Complex, members: NDArray[np.intp]) -> tuple[Complex, Complex]:
    """Orthonormal basis of the invariant subspace of some eigenvalues (its upper half), and the triangular S."""

    def chosen(value: Any) -> bool:
        return bool(int(np.argmin(np.abs(values - value))) in members)

    schur: Any = scipy.linalg.schur
    triangular, vectors, m = schur(state.astype(complex), output="complex", sort=chosen)
    return vectors[: state.shape[0] // 2, :m], triangular[:m, :m]


def _refined_pair(X: Complex, S: Complex, omega_squared: Real, damping: Real) -> tuple[Complex, Complex]:
    """An invariant pair after two Newton steps: slow decays keep their digits beside fast modes (Kressner, 2009)."""
    for _ in range(2):
        try:
            X, S = _newton_step(X, S, omega_squared, damping)
        except np.linalg.LinAlgError:
            break
        S, turned = scipy.linalg.schur(S, output="complex")
        X = X @ turned
    return X, S


def _newton_step(X: Complex, S: Complex, omega_squared: Real, damping: Real) -> tuple[Complex, Complex]:
    n, m = X.shape
    rates, square = X @ S, S @ S
    residual = X @ square + damping @ rates + omega_squared[:, None] * X
    dX, dS = np.zeros_like(X), np.zeros_like(S)
    for j in range(m):
        s = S[j, j]
        border = np.zeros((n + m, n + m), dtype=complex)
        border[:n, :n] = s * damping + np.diag(s * s + omega_squared)
        border[:n, n:] = X @ (S + s * np.eye(m)) + damping @ X
        # the correction is orthogonal to the pair itself, in the energy
        border[n:, :n] = (omega_squared[:, None] * X).conj().T + s * rates.conj().T
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


def _normalised(members: NDArray[np.intp], X: Complex, S: Complex, damping: Real, weight: float) -> _Part:
    """The pair with its coordinates; diagonal where its eigenvectors are well apart."""
    S = np.where(np.abs(S) > ROUNDING * float(np.abs(np.diag(S)).max()), S, np.diag(np.diag(S)))
    if np.any(np.triu(S, 1)):
        own, vectors = scipy.linalg.eig(S)
        if np.linalg.cond(vectors) <= WELL_APART:
            X, S = X @ vectors, np.diag(own)
    n, turned = X.shape[0], damping @ X
    G = X.T @ turned + X.T @ X @ S + S.T @ X.T @ X
    both = np.linalg.solve(G, np.hstack([turned.T + S.T @ X.T, X.T])).astype(complex)
    return _Part(members, S, weight * X, both[:, :n], both[:, n:])
