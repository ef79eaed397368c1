"""Matrices of other programs, from files."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse as sparse

from femimpact.errors import Fault, InputError, checked, optional, require, require_path, text
from femimpact.system.matrices import Matrix, checked_matrix

__all__ = ["read_matrix"]

SUFFIXES = (".mtx", ".mtx.gz", ".npz")


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
    require(path.is_file(), "path", str(path), "", "must be an existing file")
    try:
        with warnings.catch_warnings():
            # newer versions of the reader warn of a default that is to change, older ones have no such argument
            warnings.simplefilter("ignore", DeprecationWarning)
            found = _arrays(path, name) if path.suffix == ".npz" else scipy.io.mmread(path)
    except InputError:
        raise
    except Exception as error:  # readers of damaged files raise errors of any kind
        words = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError([Fault("path", str(path), "", f"must be a readable matrix file: {words}")]) from None
    return checked_matrix(path.name, found)


def _arrays(path: Path, name: str | None) -> Any:
    # a damaged archive would leave a file open that numpy opened itself
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        names = archive.files
        if name is None and {"format", "shape", "data"} <= set(names):
            return sparse.load_npz(path)
        chosen = names[0] if name is None and len(names) == 1 else name
        require(chosen in names, "name", chosen, "", f"must be one of the arrays of the file: {', '.join(names)}")
        return archive[str(chosen)]
