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
from scipy.sparse.csgraph import connected_components

from femimpact.errors import DivergenceError

__all__ = ["ComplexModes", "complex_modes"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

TOGETHER = 3e-2
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
        size = np.abs(self.exponent)
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
        mu = self.exponent
        safe = np.where(mu == 0.0, 1.0, mu)
        total = entry * np.where(mu == 0.0, duration, np.expm1(mu * duration) / safe)
        for first, count in self.blocks:
            own = slice(first, first + count)
            # e^A of A = [[rate, H], [0, 0]] t has the integral in its corner
            wide = np.zeros((count + 1, count + 1), dtype=complex)
            wide[:count, :count], wide[:count, count] = self.rate[own, own], entry[own]
            total[own] = scipy.linalg.expm(wide * duration)[:count, count]
        return np.asarray(total)

    @property
    def inverse_rate(self) -> Complex:
        """Inverse of `rate`, with zero where an exponent is zero."""
        scaled = np.where(self.exponent == 0.0, 1.0, self.exponent)
        inverse = np.linalg.inv(np.diag(scaled) + self.coupling)
        return np.asarray(inverse * (self.exponent != 0.0))


@dataclass(frozen=True, eq=False)
class _Pair:
    """One invariant pair, over the coordinates it moves; `weight` 2 stands for the conjugate pair that is left out."""

    X: Complex
    S: Complex
    from_u: Complex
    from_v: Complex
    weight: float


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
    """
    n = omega_squared.size
    found: list[tuple[NDArray[np.intp], _Pair]] = []
    for members in _components(damping):
        own, among = omega_squared[members], damping[np.ix_(members, members)]
        alone = _single(float(own[0]), float(among[0, 0])) if members.size == 1 else []
        found += [(members, pair) for pair in alone or _pairs(own, among)]
    found.sort(key=lambda item: float(np.abs(np.diag(item[1].S)).mean()))
    size = sum(pair.S.shape[0] for _, pair in found)
    exponent, coupling = np.zeros(size, dtype=complex), np.zeros((size, size), dtype=complex)
    shape, from_u, from_v = np.zeros((n, size), complex), np.zeros((size, n), complex), np.zeros((size, n), complex)
    blocks, first = list[tuple[int, int]](), 0
    for members, pair in found:
        count = pair.S.shape[0]
        entries = slice(first, first + count)
        exponent[entries] = np.minimum(np.diag(pair.S).real, 0.0) + 1j * np.diag(pair.S).imag
        coupling[entries, entries] = np.triu(pair.S, 1)
        shape[members, entries] = pair.weight * pair.X
        from_u[entries, members], from_v[entries, members] = pair.from_u, pair.from_v
        if np.any(coupling[entries, entries]):
            blocks.append((first, count))
        first += count
    modes = ComplexModes(exponent, coupling, np.array(blocks, dtype=np.int64).reshape(-1, 2), shape, from_u, from_v)
    _check_complete(modes)
    return modes


def _check_complete(modes: ComplexModes) -> None:
    """Refuse a closed form that does not give back the displacements and velocities it is made of."""
    unit = np.eye(modes.shape.shape[0])
    error = max(
        float(np.abs((modes.shape @ modes.from_u).real - unit).max(initial=0.0)),
        float(np.abs((modes.shape @ modes.rate @ modes.from_v).real - unit).max(initial=0.0)),
    )
    if not error < COMPLETE:
        raise DivergenceError(
            f"the closed form of the damped structure misses its start by {error:.2g} (bound {COMPLETE:g}): its "
            "complex modes do not separate; Newmark needs none"
        )


def _components(damping: Real) -> list[NDArray[np.intp]]:
    """Groups of coordinates that damping couples; off-diagonal terms of the size of rounding couple nothing."""
    diagonal, off = np.abs(np.diag(damping)), np.abs(damping - np.diag(np.diag(damping)))
    scale = np.sqrt(np.outer(diagonal, diagonal))
    coupled = (off > 1e-12 * (scale + 1e-300)) & (off > 1e-13 * float(diagonal.max(initial=0.0)))
    count, label = connected_components(coupled, directed=False)
    return [np.flatnonzero(label == i) for i in range(count)]


def _single(omega_squared: float, c: float) -> list[_Pair]:
    """One coordinate: lambda = -c/2 +- sqrt(c^2/4 - omega^2); none where both lie together."""
    discriminant = 0.25 * c * c - omega_squared
    root = np.sqrt(abs(discriminant))
    if 2.0 * root <= TOGETHER * max(0.5 * c, root):
        return []
    one = np.ones((1, 1), dtype=complex)
    if discriminant < 0.0:
        sigma = -0.5 * c
        return [_Pair(one, one * complex(sigma, root), one * complex(0.5, 0.5 * sigma / root), -0.5j / root * one, 2.0)]
    # the slow one from the product of both: no difference of near numbers
    fast = -0.5 * c - root
    slow = omega_squared / fast
    return [
        _Pair(one, one * own, one * (-sign * other / (slow - fast)), one * (sign / (slow - fast)), 1.0)
        for own, other, sign in ((slow, fast, 1.0), (fast, slow, -1.0))
    ]


def _pairs(omega_squared: Real, damping: Real) -> list[_Pair]:
    """Invariant pairs of coupled coordinates, one of every two conjugate ones."""
    # (unit u, u'): the norm of the state is its energy, and no motion grows in it
    unit = np.sqrt(np.maximum(omega_squared, 1e-12 * max(float(omega_squared.max()), 1.0)))
    n = unit.size
    state = np.block([[np.zeros((n, n)), np.diag(unit)], [-np.diag(omega_squared / unit), -damping]])
    values, right = scipy.linalg.eig(state)
    distance = np.abs(values[:, None] - values) * 2.0
    near = distance <= TOGETHER * (np.abs(values)[:, None] + np.abs(values))
    count, label = connected_components(near, directed=False)
    pairs = []
    for i in range(count):
        members = np.flatnonzero(label == i)
        if np.all(values[members].imag < 0.0):
            continue
        own_conjugate = bool(np.any(values[members].imag <= 0.0))
        if members.size == 1:
            X, S = right[:n, members] / unit[:, None], values[members][:, None]
        else:
            X, S = _invariant(state, values, members)
            X = X / unit[:, None]
        X, S = _refined(X.astype(complex), S.astype(complex), omega_squared, damping)
        if members.size == 1 and own_conjugate:
            X, S = X.real.astype(complex), S.real.astype(complex)
        pairs.append(_normalised(X, S, damping, 1.0 if own_conjugate else 2.0))
    return pairs


def _invariant(state: Real, values: Complex, members: NDArray[np.intp]) -> tuple[Complex, Complex]:
    """Orthonormal basis of the invariant subspace of some eigenvalues (its upper half), and the triangular S."""

    def chosen(value: Any) -> bool:
        return bool(int(np.argmin(np.abs(values - value))) in members)

    schur: Any = scipy.linalg.schur
    triangular, vectors, m = schur(state.astype(complex), output="complex", sort=chosen)
    return vectors[: state.shape[0] // 2, :m], triangular[:m, :m]


def _refined(X: Complex, S: Complex, omega_squared: Real, damping: Real) -> tuple[Complex, Complex]:
    """An invariant pair after two Newton steps: slow decays keep their digits beside fast modes (Kressner, 2009)."""
    for _ in range(2):
        try:
            X, S = _newton_step(X, S, omega_squared, damping)
        except np.linalg.LinAlgError:
            break
        if S.shape[0] > 1:
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
        # rows scaled to one another: the fast modes must not drown the slow ones
        scale = 1.0 / np.max(np.abs(border), axis=1)
        step = np.linalg.solve(border * scale[:, None], right * scale)
        dX[:, j], dS[:, j] = step[:n], step[n:]
    return X + dX, S + dS


def _normalised(X: Complex, S: Complex, damping: Real, weight: float) -> _Pair:
    """The pair with its coordinates; diagonal where its eigenvectors are well apart."""
    size = float(np.abs(np.diag(S)).max())
    if S.shape[0] > 1:
        S = np.where(np.abs(S) > ROUNDING * size, S, np.diag(np.diag(S)))
    diagonal = not np.any(np.triu(S, 1))
    if not diagonal:
        own, vectors = scipy.linalg.eig(S)
        if np.linalg.cond(vectors) <= WELL_APART:
            X, S, diagonal = X @ vectors, np.diag(own), True
    G = X.T @ damping @ X + X.T @ X @ S + S.T @ X.T @ X
    both = np.linalg.solve(G, np.hstack([X.T @ damping + S.T @ X.T, X.T])).astype(complex)
    n = X.shape[0]
    return _Pair(X, S, both[:, :n], both[:, n:], weight)
