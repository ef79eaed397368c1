"""Matrices of other programs, from files."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sparse

from femimpact.errors import Fault, InputError, checked, optional, require, require_path, text
from femimpact.regular_file import check_regular
from femimpact.system.matrices import MOST_DOFS, Matrix, checked_matrix

SUFFIXES = (".mtx", ".mtx.gz", ".npz")

MOST_BYTES = 2_000_000_000
"""Most bytes of a file."""

MOST_ENTRIES = 50_000_000
"""Most entries of a Matrix Market file."""


def read_matrix(path: str | Path, name: str | None = None) -> Matrix:
    """A symmetric matrix from a file, for `System.from_matrices`.

    Parameters
    ----------
    path : str or Path
        Matrix Market (.mtx, .mtx.gz), or .npz: a sparse matrix as scipy saves it, or arrays by name as numpy does.
    name : str, optional
        Of the array in an .npz file with several.

    Returns
    -------
    csr_array (dofs, dofs)

    Raises
    ------
    InputError
        If there is no such file or array, it cannot be read, or holds no square, symmetric matrix of finite numbers.
    """
    require_path(path, "path", "a matrix file")
    checked("name", name, optional(text()))
    path = Path(path)
    known = path.name.endswith(SUFFIXES)
    require(known, "path", str(path), "", f"must end with {', '.join(SUFFIXES)}")
    try:
        check_regular(path, MOST_BYTES)
        matrix = _of_archive(path, name) if path.suffix == ".npz" else _of_market(path)
    except InputError:
        raise
    # what a damaged file makes its reader raise is without limit
    except Exception as error:
        reason = getattr(error, "strerror", None) or str(error)
        words = " ".join(reason.split())[:300] or type(error).__name__
        raise InputError([Fault("path", str(path), "", f"must be a readable matrix file: {words}")]) from None
    return checked_matrix(path.name, matrix)


def _of_market(path: Path) -> Any:
    """The matrix of a Matrix Market file, read by scipy.

    Its lines are read by numpy first: of "1,5" and "1d3" scipy takes the 1, and leaves the rest of the line.
    """
    from scipy.io import mminfo, mmread

    rows, columns, entries, layout, kind, symmetry = mminfo(path)
    if kind == "complex" or symmetry not in ("general", "symmetric"):
        raise ValueError(f"a {kind}, {symmetry} matrix, in place of a real one that is symmetric or general")
    if max(rows, columns) > MOST_DOFS or entries > MOST_ENTRIES:
        raise ValueError(f"of {rows} rows and {entries} entries: at most {MOST_DOFS:,} and {MOST_ENTRIES:,} are read")
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        lines = (line for line in file if line.strip() and not line.startswith(b"%"))
        # the sizes
        next(lines)
        table = np.loadtxt(lines, comments=None, ndmin=2)
    numbers = [*(("row", "column") if layout == "coordinate" else ()), *(() if kind == "pattern" else (kind,))]
    if table.shape[1] != len(numbers) or (kind == "integer" and np.any(table % 1.0)):
        raise ValueError(f"its lines must be of numbers: {', '.join(numbers)}")
    matrix = mmread(path)
    if not sparse.issparse(matrix):
        return matrix
    summed = matrix.tocsr()
    if summed.nnz < matrix.nnz:
        both = ", as where a symmetric one has both of its halves" if symmetry == "symmetric" else ""
        raise ValueError(f"an entry stands in it more than once{both}")
    return summed


def _of_archive(path: Path, name: str | None) -> Any:
    """An array of an .npz file, or the sparse matrix that scipy saved there."""
    with np.load(path) as arrays:
        names = list(arrays)
        if name is None and {"format", "shape", "data"} <= set(names):
            return sparse.load_npz(path)
        chosen = names[0] if name is None and len(names) == 1 else name
        require(chosen in names, "name", chosen, "", f"must be one of the arrays of the file: {', '.join(names)}")
        return arrays[chosen]
