"""Stiffness and mass of the bare beam: the only weak forms, integrated once for all structures on a mesh."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from skfem import BilinearForm
from skfem.helpers import dd, ddot

from femimpact.fem.discretisation import Discretisation
from femimpact.system.matrices import Matrix

__all__ = ["Entries", "beam_matrices", "bending", "inertia", "joined"]

Array = NDArray[np.float64]


@BilinearForm  # type: ignore[untyped-decorator]
def bending(u: Any, v: Any, w: Any) -> Any:
    """Integral of EI u'' v''."""
    return w.bending_stiffness * ddot(dd(u), dd(v))


@BilinearForm  # type: ignore[untyped-decorator]
def inertia(u: Any, v: Any, w: Any) -> Any:
    """Integral of rho A u v."""
    return w.mass_per_length * u * v


class Entries(NamedTuple):
    """Entries of a matrix over all dofs of a basis, held ones included; those at one place are summed.

    Parameters
    ----------
    row, column : ndarray (entries,)
    value : ndarray (entries,)
    """

    row: NDArray[np.integer[Any]]
    column: NDArray[np.integer[Any]]
    value: Array

    def times(self, vector: Array) -> Array:
        """The matrix times a vector (dofs,)."""
        return np.asarray(np.bincount(self.row, self.value * vector[self.column], vector.size), dtype=float)

    def row_of(self, dof: int, dofs: int) -> Array:
        """One row of the matrix, (dofs,)."""
        own = self.row == dof
        return np.asarray(np.bincount(self.column[own], self.value[own], dofs), dtype=float)

    def on(self, free: NDArray[np.int64], dofs: int) -> Matrix:
        """The matrix on the free ones of so many dofs."""
        number = np.full(dofs, -1)
        number[free] = np.arange(free.size)
        row, column = number[self.row], number[self.column]
        inside = (row >= 0) & (column >= 0)
        places = row[inside], column[inside]
        block: Matrix = sparse.csr_array((self.value[inside], places), shape=(free.size, free.size))
        block.eliminate_zeros()
        return block


def joined(*parts: Entries) -> Entries:
    """Entries of the sum of matrices."""
    return Entries(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def beam_matrices(grid: Discretisation) -> tuple[Entries, Entries]:
    """K and M of the bare beam over all dofs."""
    sections, basis = grid.sections, grid.basis
    stiffness = sections.bending_stiffness * sections.bending_polynomial
    mass = sections.mass_per_length * sections.mass_polynomial
    return _weighted(bending, "bending_stiffness", basis, stiffness), _weighted(inertia, "mass_per_length", basis, mass)


def _weighted(form: Any, name: str, basis: Any, coefficients: Array) -> Entries:
    """A form whose coefficient is a polynomial in every element: (powers, elements), by powers of x = 2 s - 1."""
    powers = [power for power, coefficient in enumerate(coefficients) if coefficient.any()]
    parts = [_integrals(form, name, basis, power) for power in powers]
    row, column, _ = parts[0]
    value = sum(coefficients[power] * part.value for power, part in zip(powers, parts, strict=True))
    return Entries(row, column, np.ravel(value))


@lru_cache(maxsize=16)
def _integrals(form: Any, name: str, basis: Any, power: int) -> Entries:
    """Entries of a form whose coefficient is x^power, with x from -1 to 1 in every element.

    Their value is (16, elements): a coefficient of each element may multiply it. Structures on one mesh share them.
    """
    x = 2.0 * basis.X[0] - 1.0 + basis.zero_w()
    found = form.coo_data(basis, **{name: x**power})
    row, column = found.indices
    entries = Entries(row, column, found.data.reshape(-1, basis.nelems))
    for array in entries:
        array.setflags(write=False)
    return entries
