"""Matrices that a user gives, also from files, checked; and the rigid motions that nothing holds."""

from __future__ import annotations

import gzip
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, checked, optional, real_array, require, require_path, text
from femimpact.regular_file import open_regular

FREE = 1e-9
"""Share of a strain's terms below which it is rounding."""


def rigid_motions(
    # of a beam as `assemble` gives it, of matrices, or on coordinates whose matrices are diagonal
    system: Any,
) -> NDArray[np.float64]:
    """Motions without strain: K r = 0, r^T M r = 1.

    Returns (dofs, k) kg^-0.5: orthonormal with M, computed once for a system; k = 0 where all is held.
    """
    derived = system.derived_undamped
    if "rigid motions" not in derived:
        motions = _rigid_motions(system)
        motions.setflags(write=False)
        derived["rigid motions"] = motions
    basis: NDArray[np.float64] = derived["rigid motions"]
    return basis


def _rigid_motions(system: Any) -> NDArray[np.float64]:
    if system.is_diagonal:
        unheld = np.flatnonzero(system.K.diagonal() == 0.0)
        motions = np.zeros((system.dofs, unheld.size))
        motions[unheld, np.arange(unheld.size)] = 1.0 / np.sqrt(system.M.diagonal()[unheld])
        return motions
    if system.sections is None or not sparse.issparse(system.expansion):
        return _with_unit_mass(system, _null_space(system))
    straight = _straight_motions(system.nodes)
    factor: Any = sparse.csr_array(system.stiffness_factor)
    expansion: Any = system.expansion
    dofs = np.asarray(expansion.T @ straight)
    held = straight - expansion @ dofs
    # each strain from its terms alone: springs may be softer than the beam by any number of decades
    terms = (abs(factor) @ np.abs(dofs)).max(axis=1)
    strains = (factor @ dofs)[terms > 0.0] / terms[terms > 0.0, None]
    sizes, shares = np.linalg.svd(np.vstack([held, strains]), full_matrices=False)[1:]
    return _with_unit_mass(system, dofs @ shares[sizes <= FREE * np.sqrt(strains.shape[0] + 1.0)].T)


def _null_space(system: Any) -> NDArray[np.float64]:
    """Motions (dofs, k) without strain, where strains are fewer than dofs: those of `System.from_matrices`."""
    factor: Any = sparse.csr_array(system.stiffness_factor)
    factor = factor[np.flatnonzero(np.diff(factor.indptr))]
    if factor.shape[0] >= system.dofs:
        return np.zeros((system.dofs, 0))
    stiffness = system.K.diagonal()
    scale = np.sqrt(np.where(stiffness > 0.0, stiffness, 1.0))
    strains = np.linalg.qr(factor.toarray().T / scale[:, None], mode="complete")[0]
    return np.asarray(strains[:, factor.shape[0] :] / scale[:, None])


def _with_unit_mass(system: Any, motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Motions (dofs, k) made orthonormal with the mass."""
    if not motions.size:
        return motions
    lower = np.linalg.cholesky(motions.T @ (system.M @ motions))
    return np.asarray(np.linalg.solve(lower, motions.T).T)


def _straight_motions(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Translation and rotation about the root, (2 nodes, 2), both at most 1."""
    length = float(nodes[-1])
    motions = np.zeros((2 * nodes.size, 2))
    motions[0::2, 0] = 1.0
    motions[0::2, 1], motions[1::2, 1] = nodes / length, 1.0 / length
    return motions


Matrix: TypeAlias = "sparse.csr_array[Any, Any]"
"""Sparse, of floats. With the type of its entries, scipy-stubs would make a union of each product with an array."""

RANK_TOLERANCE = 1e-13
"""Eigenvalues below this share of the largest are taken as zero: rigid motions."""


NEGLIGIBLE_ROW = 1e-12
"""Limit for a matrix scaled to a unit diagonal: a remainder of a row below it is taken as zero."""

ROUNDING = 1e-8
"""Share of a row's sum by which two products of one matrix may differ."""

FINITE = "must hold finite numbers"

MOST_DOFS = 1_000_000
"""Most dofs of a sparse matrix; no model of a beam has as many."""

MOST_FULL = 20_000
"""Dofs of a system by its matrices: a full one of as many takes 3 GB."""


def checked_matrix(name: str, value: Any) -> Matrix:
    """A square, symmetric, finite matrix as csr_array (dofs, dofs).

    Raises `InputError` naming the matrix and what is wrong with it.
    """
    entries: Any = value
    if sparse.issparse(value):
        require(entries.dtype.kind in "iuf", name, f"matrix of {entries.dtype}", "", FINITE)
        matrix: Matrix = sparse.csr_array(sound_sparse(name, entries)).astype(float)
    else:
        entries = np.atleast_2d(real_array(name, value, "", FINITE))
        require(entries.ndim == 2, name, entries.shape, "", "must be a square matrix")
        matrix = sparse.csr_array(entries)
    square = matrix.shape[0] == matrix.shape[1] and matrix.shape[0] > 0
    require(square, name, matrix.shape, "", "must be a square matrix")
    require(bool(np.all(np.isfinite(matrix.data))), name, None, "", FINITE)
    skew = float(abs(matrix - matrix.T).max())
    require(
        skew <= 1e-9 * float(abs(matrix).max()), name, skew, "", "must be symmetric; this is the largest difference"
    )
    return matrix


def sound_sparse(name: str, value: Any) -> Any:
    """A sparse matrix of two dimensions whose indices lie within its shape: compiled code follows them unasked.

    Raises `InputError` naming the matrix and what is wrong with it, before anything as large as its shape is
    allocated.
    """
    sized = len(value.shape) == 2 and max(value.shape) <= MOST_DOFS
    require(sized, name, tuple(value.shape), "", f"must be a matrix of at most {MOST_DOFS:,} rows and columns")
    try:
        if value.format in ("csr", "csc", "bsr"):
            parts = value.data, value.indices, value.indptr
            integer = all(np.asarray(part).dtype.kind in "iu" for part in parts[1:])
            # scipy takes a negative last one for a matrix without entries, of which it checks no more
            ends = np.asarray(value.indptr).astype(np.int64)
            if ends[0] != 0 or np.any(np.diff(ends) < 0):
                raise ValueError("indptr must begin with 0 and not fall")
            # a new matrix of the same arrays: what the given one has found out about itself may be out of date
            matrix: Any = getattr(sparse, f"{value.format}_array")(parts, shape=value.shape)
            matrix.check_format(full_check=True)
        else:
            entries = value.tocoo()
            integer = all(np.asarray(part).dtype.kind in "iu" for part in entries.coords)
            matrix = sparse.coo_array((entries.data, entries.coords), shape=value.shape)
    # lists and dictionaries that somebody wrote into raise whatever comes first
    except Exception as error:
        words = " ".join(str(error).split()) or type(error).__name__
        raise InputError([Fault(name, None, "", f"must be a sound sparse matrix: {words}")]) from None
    require(integer, name, None, "", "must be a sound sparse matrix: its indices are no whole numbers")
    return matrix


def checked_row(key: str, value: ArrayLike, dofs: int) -> Array:
    """A read-only row (dofs,) of finite numbers."""
    allowed = f"must hold {dofs} finite numbers"
    row = np.atleast_1d(real_array(key, value, "", allowed))
    require(row.shape == (dofs,), key, f"array of shape {row.shape}", "", allowed)
    row.setflags(write=False)
    return row


def checked_shapes(nodes: ArrayLike | None, expansion: Any, dofs: int) -> tuple[Array, Matrix]:
    """Nodes (n,) and the matrix (2 n, dofs) that reads w and w' there; none of either where none is given.

    Raises `InputError` if one is given without the other, or they do not fit.
    """
    both = (nodes is None) == (expansion is None)
    require(both, "nodes", None, "m", "must be given with expansion, the rows that read w and w' there")
    if nodes is None:
        return np.zeros(0), sparse.csr_array((0, dofs))
    places = np.atleast_1d(real_array("nodes", nodes, "m", FINITE))
    rising = places.ndim == 1 and places.size >= 2 and bool(np.all(np.diff(places) > 0.0))
    require(rising, "nodes", f"array of shape {places.shape}", "m", "must be two or more increasing positions")
    allowed = f"must have the shape ({2 * places.size}, {dofs}): w and w' at every node, by the dofs"
    shapes: Any = expansion
    if sparse.issparse(expansion):
        require(shapes.shape == (2 * places.size, dofs), "expansion", shapes.shape, "", allowed)
        shapes = sound_sparse("expansion", shapes).toarray()
    rows = np.atleast_2d(real_array("expansion", shapes, "", FINITE))
    require(rows.shape == (2 * places.size, dofs), "expansion", rows.shape, "", allowed)
    places.setflags(write=False)
    return places, sparse.csr_array(rows)


def definite_factor(name: str, matrix: Array, strictly: bool = False) -> tuple[Array, int]:
    """G (dofs, dofs) with A = G^T G, and the rank of A.

    A is scaled to a unit diagonal first, so that what is zero to rounding does not depend on the units of the dofs.

    Raises `InputError` if A has a negative eigenvalue, or, strictly, one that is zero.
    """
    scale = _scale(matrix)
    values, vectors = scipy.linalg.eigh(matrix / scale / scale[:, None])
    largest = float(np.max(np.abs(values)))
    fine = values[0] > RANK_TOLERANCE * largest if strictly else values[0] >= -1e-9 * largest
    if not fine:
        allowed = "must be positive definite" if strictly else "must be positive semidefinite"
        lowest = float(scipy.linalg.eigvalsh(matrix)[0])
        require(False, name, lowest, "", f"{allowed}; this is its lowest eigenvalue")
    values = np.where(values > RANK_TOLERANCE * largest, values, 0.0)
    return np.sqrt(values)[:, None] * vectors.T * scale, int(np.count_nonzero(values))


def _scale(matrix: Array) -> Array:
    """The root of each diagonal entry (dofs,), not less than what keeps scaled entries beside the diagonal up to 1."""
    diagonal = np.diag(matrix)
    positive = np.flatnonzero(diagonal > 0.0)
    square = (matrix[:, positive] * (matrix[:, positive] / diagonal[positive])).max(axis=1, initial=0.0)
    return np.sqrt(np.where(square > 0.0, square, float(np.abs(matrix).max()) or 1.0))


def banded_factor(matrix: Matrix, semidefinite: bool = False) -> Matrix | None:
    """Upper triangular G (dofs, dofs) with A = G^T G of a sparse symmetric A, by Cholesky's method on its band.

    None where A is not positive definite. With `semidefinite`, A may be singular: G then has a zero row for each
    motion without stiffness, and None is returned where A is indefinite. A is scaled to a unit diagonal first, so that
    rounding does not depend on the units of the dofs.
    """
    size = matrix.shape[0]
    entries = sparse.coo_array(sparse.triu(matrix))
    scale = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    offset = entries.coords[1] - entries.coords[0]
    width = int(offset.max(initial=0))
    # the rows below the last one stay empty
    band = np.zeros((size + width, width + 1))
    band[entries.coords[0], offset] = entries.data
    unit = np.where(scale > 0.0, scale, 1.0)
    column = np.minimum(np.arange(size)[:, None] + np.arange(width + 1), size - 1)
    band[:size] /= unit[:, None] * unit[column]
    for j in range(size):
        pivot, row = band[j, 0], band[j, 1:].copy()
        if semidefinite and pivot <= NEGLIGIBLE_ROW and np.abs(row).max(initial=0.0) <= NEGLIGIBLE_ROW:
            if pivot < -NEGLIGIBLE_ROW:
                return None
            band[j] = 0.0
            continue
        if pivot <= 0.0:
            return None
        for i in np.flatnonzero(row):
            band[j + 1 + i, : width - i] -= row[i] * row[i:] / pivot
        band[j] /= math.sqrt(pivot)
    rows, offsets = np.nonzero(band[:size])
    values = band[rows, offsets] * unit[rows + offsets]
    return sparse.csr_array((values, (rows, rows + offsets)), shape=(size, size))


def factor_of_sum(name: str, factor: Matrix, added: Matrix, total: Matrix) -> Matrix:
    """G of K = G_0^T G_0 + added, by G_0 and K: both factors stacked, or Cholesky's of K where `added` is indefinite.

    Raises `InputError` naming what is added where K is not positive definite, with the share up to which it is.
    """
    of_added = banded_factor(added, semidefinite=True)
    if of_added is not None:
        return sparse.csr_array(sparse.vstack([factor, of_added], format="csr")) if added.nnz else factor
    of_total = banded_factor(total)
    if of_total is not None:
        return of_total
    low, high = 0.0, 1.0
    while high - low > 1e-5:
        share = 0.5 * (low + high)
        stands = banded_factor(sparse.csr_array(total - (1.0 - share) * added)) is not None
        low, high = (share, high) if stands else (low, share)
    allowed = (
        f"must leave the stiffness positive definite: under this one the structure has buckled, at {high:.5f} of it"
    )
    raise InputError([Fault(name, None, "", allowed)])


def check_semidefinite(name: str, matrix: Matrix) -> None:
    """Raise `InputError` unless a symmetric sparse matrix is positive semidefinite, to 1e-9 of its largest entry."""
    if matrix.nnz == 0 or float(abs(matrix).max()) == 0.0:
        return
    shifted = matrix.toarray()
    shifted[np.diag_indices_from(shifted)] += 1e-9 * np.max(np.abs(shifted))
    try:
        scipy.linalg.cholesky(shifted, overwrite_a=True)
    except scipy.linalg.LinAlgError:
        require(False, name, None, "", "must be positive semidefinite")


def same_product(matrix: Matrix, product: Callable[[Array], Array]) -> bool:
    """True if a sparse matrix (dofs, dofs) and another product do the same to one vector, to rounding.

    A fixed vector without pattern finds any difference but those made for it, at the cost of a product.
    """
    x = 1.0 + np.modf(np.sqrt(2.0) * np.arange(1, matrix.shape[0] + 1))[0]
    difference = np.abs(matrix @ x - product(x))
    # each row relative to its size; rows of a dense factor carry the rounding of the largest one
    size = abs(matrix) @ x
    return bool(np.all(difference <= ROUNDING * (size + 1e-4 * size.max(initial=0.0))))


def stiffness_solver(system: Any) -> Callable[[Array], Array]:
    """K^-1 of a system, through its stiffness factor: a function of loads (dofs, ...) in N; see `solve_stiffness`.

    Where rigid motions r are free it gives the elastic displacements, r^T M u = 0, under the loads and the inertia
    forces of the rigid motion that these cause. It is made once for a system.
    """
    derived = system.derived_undamped
    if "stiffness solver" not in derived:
        derived["stiffness solver"] = _stiffness_solver(system)
    solve: Callable[[Array], Array] = derived["stiffness solver"]
    return solve


def _stiffness_solver(system: Any) -> Callable[[Array], Array]:
    from scipy.sparse.linalg import splu

    factor = sparse.csr_array(system.stiffness_factor)
    rigid = rigid_motions(system)
    momentum = system.M @ rigid
    if rigid.shape[1]:
        factor = sparse.csr_array(sparse.vstack([factor, momentum.T]))
    solver, strains = splu(_augmented(factor)), factor.shape[0]

    def solve(loads: Array) -> Array:
        if rigid.shape[1]:
            loads = loads - momentum @ (rigid.T @ loads)
        right = np.concatenate([np.zeros((strains, *loads.shape[1:])), -loads])
        displacement = solver.solve(right)[strains:]
        if rigid.shape[1]:
            displacement = displacement - rigid @ (momentum.T @ displacement)
        return np.asarray(displacement)

    return solve


def _augmented(factor: Matrix) -> Any:
    """[I, G; G^T, 0] by columns; a scale of I is of no account, as SuperLU scales rows and columns itself."""
    strains, dofs = factor.shape
    entries, strain = factor.tocoo(), np.arange(strains)
    row, column = entries.coords[0], strains + entries.coords[1]
    values = np.concatenate([np.ones(strains), entries.data, entries.data])
    places = np.concatenate([strain, row, column]), np.concatenate([strain, column, row])
    return sparse.csc_array((values, places), shape=(strains + dofs, strains + dofs))


def diagonal_matrix(values: Array) -> Matrix:
    """The matrix with these numbers (dofs,) on its diagonal."""
    entries = np.flatnonzero(values)
    first = np.searchsorted(entries, np.arange(values.size + 1))
    return sparse.csr_array((values[entries], entries, first), shape=(values.size, values.size))


def check_damping(system: Any) -> None:
    """Refuse a damping matrix that is not the one of its coefficients, or that feeds energy in."""
    shape = getattr(system.C, "shape", None)
    fits = sparse.issparse(system.C) and shape == system.M.shape
    require(fits, "C", shape or type(system.C).__name__, "", f"must be a sparse matrix of shape {system.M.shape}")
    if system.rayleigh is None:
        check_semidefinite("C", checked_matrix("C", system.C))
        return
    pair = isinstance(system.rayleigh, tuple) and len(system.rayleigh) == 2
    require(pair, "rayleigh", system.rayleigh, "", "must be two numbers, alpha (1/s) and beta (s), or None")
    alpha, beta = system.rayleigh
    fits = same_product(system.C, lambda x: alpha * (system.M @ x) + beta * (system.K @ x))
    allowed = "must be alpha and beta of C = alpha M + beta K: replace both, or give rayleigh=None for another damping"
    require(fits, "rayleigh", system.rayleigh, "", allowed)


# ---- files --------------------------------------------------------------------------------------------

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
        open_regular(path, MOST_BYTES).close()
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
    # numpy leaves a path open where the file is damaged
    with path.open("rb") as file, np.load(file) as arrays:
        names = list(arrays)
        if name is None and {"format", "shape", "data"} <= set(names):
            return sparse.load_npz(path)
        chosen = names[0] if name is None and len(names) == 1 else name
        require(chosen in names, "name", chosen, "", f"must be one of the arrays of the file: {', '.join(names)}")
        return arrays[chosen]
