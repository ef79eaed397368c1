"""Matrices that a user gives, checked: shapes, symmetry, definiteness."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import require

__all__ = ["checked_matrix", "checked_row", "definite_factor", "real_array"]

RANK_TOLERANCE = 1e-13
"""Eigenvalues below this share of the largest are taken as zero: rigid motions."""


FINITE = "must hold finite numbers"


def real_array(key: str, value: Any, unit: str, allowed: str) -> NDArray[Any]:
    """An array of float, of any shape.

    Raises
    ------
    InputError
        If the value holds anything but finite real numbers: text, truth values, nothing, rows of several lengths.
    """
    try:
        given = np.asarray(value)
    except ValueError:
        given = np.array(None)
    fine = given.dtype.kind in "iuf" and bool(np.all(np.isfinite(given)))
    shown = f"array of {given.dtype}" if given.ndim and given.dtype.kind in "iufcbU" else value
    require(fine, key, shown, unit, allowed)
    return np.array(given, dtype=float)


def checked_matrix(name: str, value: Any) -> Any:
    """A square, symmetric, finite matrix as csr_array (dofs, dofs).

    Raises
    ------
    InputError
        Naming the matrix and what is wrong with it.
    """
    given: Any = value if sparse.issparse(value) else np.atleast_2d(real_array(name, value, "", FINITE))
    matrix = sparse.csr_array(given)
    square = matrix.shape[0] == matrix.shape[1] and matrix.shape[0] > 0
    require(square, name, matrix.shape, "", "must be a square matrix")
    require(bool(np.all(np.isfinite(matrix.data))), name, None, "", FINITE)
    skew = float(abs(matrix - matrix.T).max())
    require(
        skew <= 1e-9 * float(abs(matrix).max()), name, skew, "", "must be symmetric; this is the largest difference"
    )
    return matrix


def checked_row(key: str, value: ArrayLike, dofs: int) -> NDArray[Any]:
    """A read-only row (dofs,) of finite numbers."""
    allowed = f"must hold {dofs} finite numbers"
    row = np.atleast_1d(real_array(key, value, "", allowed))
    require(row.shape == (dofs,), key, f"array of shape {row.shape}", "", allowed)
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
