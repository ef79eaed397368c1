"""Matrices that a user gives, checked: shapes, symmetry, definiteness."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import require

__all__ = ["checked_matrix", "checked_row", "definite_factor"]

RANK_TOLERANCE = 1e-13
"""Eigenvalues below this share of the largest are taken as zero: rigid motions."""


def checked_matrix(name: str, value: Any) -> Any:
    """A square, symmetric, finite matrix as csr_array (dofs, dofs).

    Raises
    ------
    InputError
        Naming the matrix and what is wrong with it.
    """
    given: Any = value if sparse.issparse(value) else np.atleast_2d(np.array(value, dtype=float))
    matrix = sparse.csr_array(given)
    square = matrix.shape[0] == matrix.shape[1] and matrix.shape[0] > 0
    require(square, name, matrix.shape, "", "must be a square matrix")
    require(bool(np.all(np.isfinite(matrix.data))), name, None, "", "must hold finite numbers")
    skew = float(abs(matrix - matrix.T).max())
    require(
        skew <= 1e-9 * float(abs(matrix).max()), name, skew, "", "must be symmetric; this is the largest difference"
    )
    return matrix


def checked_row(key: str, value: ArrayLike, dofs: int) -> NDArray[Any]:
    """A read-only row (dofs,) of finite numbers."""
    row = np.atleast_1d(np.array(value, dtype=float))
    fits = row.shape == (dofs,) and bool(np.all(np.isfinite(row)))
    require(fits, key, f"array of shape {row.shape}", "", f"must hold {dofs} finite numbers")
    row.setflags(write=False)
    return row


def definite_factor(name: str, matrix: NDArray[Any], strictly: bool = False) -> tuple[NDArray[Any], int]:
    """G (dofs, dofs) with A = G^T G, and the rank of A.

    Raises
    ------
    InputError
        If A has a negative eigenvalue, or, strictly, one that is zero.
    """
    values, vectors = scipy.linalg.eigh(matrix)
    largest = float(np.max(np.abs(values)))
    allowed = "must be positive definite" if strictly else "must be positive semidefinite"
    least = RANK_TOLERANCE * largest if strictly else -1e-9 * largest
    fine = values[0] > least if strictly else values[0] >= least
    require(bool(fine), name, float(values[0]), "", f"{allowed}; this is its lowest eigenvalue")
    values = np.where(values > RANK_TOLERANCE * largest, values, 0.0)
    return np.sqrt(values)[:, None] * vectors.T, int(np.count_nonzero(values))
