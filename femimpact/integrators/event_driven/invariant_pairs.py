"""Invariant pairs (X, S), X S^2 + D X S + Omega^2 X = 0, of eigenvalues that lie together.

Kressner (2009), A block Newton method for nonlinear eigenvalue problems.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

__all__ = ["diagonal_where_apart", "invariant_pair"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

WELL_APART = 30.0
"""Condition of a block's eigenvectors up to which it is made diagonal: the ledger loses its square in digits."""

ROUNDING = 1e-14
"""Couplings within a block below this share of its size are rounding."""


def invariant_pair(
    state: Real, unit: Real, values: Complex, members: NDArray[np.intp], omega_squared: Real, damping: Real
) -> tuple[Complex, Complex]:  # fmt: skip
    """X (n, k) and the upper triangular S (k, k) of some eigenvalues.

    Parameters
    ----------
    state : ndarray (2 n, 2 n)
        Of (unit u, u').
    unit : ndarray (n,), 1/s
    values : ndarray (2 n,), 1/s
        All eigenvalues.
    members : ndarray (k,) of int
        Which of them.
    omega_squared : ndarray (n,), 1/s^2
    damping : ndarray (n, n), 1/s
    """
    X, S = _invariant(state, values, members)
    return _refined_pair(X / unit[:, None], S, omega_squared, damping)


def diagonal_where_apart(X: Complex, S: Complex) -> tuple[Complex, Complex]:
    """The pair without couplings of the size of rounding; diagonal where its eigenvectors are well apart."""
    S = np.where(np.abs(S) > ROUNDING * float(np.abs(np.diag(S)).max()), S, np.diag(np.diag(S)))
    if np.any(np.triu(S, 1)):
        own, vectors = scipy.linalg.eig(S)
        if np.linalg.cond(vectors) <= WELL_APART:
            X, S = X @ vectors, np.diag(own)
    return X, S


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
