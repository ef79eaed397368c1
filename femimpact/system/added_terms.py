"""Terms that a user adds to the equations of motion: stiffness, mass, damping and load on all dofs of the basis."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import own
from femimpact.errors import require, require_type
from femimpact.system.contact_pair import ContactPair
from femimpact.system.hermite import Reaction
from femimpact.system.matrices import Matrix, banded_factor, check_damping, checked_matrix, checked_row, factor_of_sum
from femimpact.system.modes import first_mode_at, flexibility, solve_modes
from femimpact.system.system import System, with_checked_fields


def add_terms(
    system: System,
    *,
    stiffness: Any = None,
    mass: Any = None,
    damping: Any = None,
    load: ArrayLike | None = None,
) -> System:
    """The same structure with more terms in its equations, assembled on all dofs of its basis.

    M + mass, C + damping, K + stiffness and constant_load + load on the free dofs; the base load follows from the
    added mass, the reactions from the rows of the held dofs. First frequency, effective masses and compliances of the
    contacts are computed anew where mass or stiffness is added. Positions, mesh and named places stay.

    Parameters
    ----------
    system : System
        As `assemble` gives it, before `reduce`.
    stiffness, mass, damping : sparse or array_like (2 n, 2 n), optional
        Symmetric, on the dofs (w1, w1', w2, w2', ...) of `Discretisation.basis`, held ones included (N/m, kg, N s/m
        for deflections). A stiffness may be indefinite, as that of a compressive force.
    load : array_like (2 n,), N, optional
        Constant force on every dof, a moment (N m) on slopes.

    Raises
    ------
    InputError
        If a term does not fit the basis or is not symmetric, if the sum of the stiffness is not positive definite
        (the structure has buckled), that of the mass not positive definite, or that of the damping not positive
        semidefinite; for a system that is reduced or given by matrices.

    Notes
    -----
    Rayleigh coefficients stay what they are and hold for the sums: C = alpha M + beta K + damping, so that added mass
    and stiffness have their share of the damping. Damping by modes (`ModalDamping`) stays the matrix it is. Where the
    ratios are to be those of the new modes, `with_damping` computes the damping anew.

    The stiffness factor G, K = G^T G, carries the digits of fine meshes (`solve_modes`). A positive semidefinite
    stiffness, as of a foundation or of tension, has a separate factor, and both are stacked: no digit is lost. An
    indefinite one has none. G is then the Cholesky factor of the sum K, which is rounded as K is: frequencies are
    good to about 1e-16 N^4 relative for N elements, 3e-10 for 40 and 3e-4 for 2000, and worse near buckling by the
    ratio of the unloaded stiffness to what is left of it.

    Examples
    --------
    A mass of 1 g that moves with the deflection of the last node; all dofs of the basis count, held ones too:

    >>> import numpy as np
    >>> import femimpact as fi
    >>> full = fi.assemble(structure, elements=4)
    >>> mass = np.zeros((10, 10))
    >>> mass[8, 8] = 1e-3
    >>> heavier = fi.system.add_terms(full, mass=mass)
    """
    require_type(system, System, "system")
    must = "must be a system as assemble gives it: add terms before reduce, and to the matrices of System.from_matrices"
    assembled = system.nodes.size > 0 and sparse.issparse(system.expansion)
    require(assembled, "system", f"{system.dofs} dofs", "", must)
    size, expansion = 2 * system.nodes.size, sparse.csr_array(system.expansion)
    terms = {"stiffness": stiffness, "mass": mass, "damping": damping}
    on_basis = {name: _matrix_on_basis(name, value, size) for name, value in terms.items()}
    force = np.zeros(size) if load is None else checked_row("load", load, size)
    free = {name: sparse.csr_array(expansion.T @ matrix @ expansion) for name, matrix in on_basis.items()}
    rigid = np.zeros(size)
    rigid[0::2] = 1.0
    momentum = on_basis["mass"] @ rigid
    constant_load = own(system.constant_load + expansion.T @ force)
    loaded: dict[str, Any] = {
        "rayleigh": system.rayleigh if damping is None else None,
        "constant_load": constant_load,
        "constant_resultant": float(system.rigid_translation @ constant_load),
        "reactions": {
            name: _with_terms(item, system.rayleigh, on_basis, momentum, force, expansion)
            for name, item in system.reactions.items()
        },
    }
    if mass is None and stiffness is None:
        # modes and compliances stay
        summed = with_checked_fields(system, C=sparse.csr_array(system.C + free["damping"]), **loaded)
    else:
        summed = _with_new_matrices(system, free, expansion.T @ momentum, float(rigid @ momentum), loaded)
    # the sum may couple what was not coupled
    summed.__dict__.pop("is_diagonal", None)
    check_damping(summed)
    return summed


def _with_new_matrices(
    system: System,
    free: dict[str, Matrix],  # added stiffness, mass and damping on the free dofs
    base_load: NDArray[np.float64],  # (dofs,) kg: of the added mass
    total_mass: float,  # kg: of the added mass
    loaded: dict[str, Any],  # other fields
) -> System:
    """The system with added mass, stiffness and damping, and all that follows from them."""
    M, K = sparse.csr_array(system.M + free["mass"]), sparse.csr_array(system.K + free["stiffness"])
    if free["mass"].nnz:
        require(banded_factor(M) is not None, "mass", None, "", "must leave the mass matrix positive definite")
    C = system.C + free["damping"]
    if system.rayleigh is not None:
        alpha, beta = system.rayleigh
        C = alpha * M + beta * K + free["damping"]
    bare = with_checked_fields(
        system,
        M=M,
        C=sparse.csr_array(C),
        K=K,
        stiffness_factor=factor_of_sum("stiffness", system.stiffness_factor, free["stiffness"], K),
        base_load=own(system.base_load + base_load),
        total_mass=system.total_mass + total_mass,
        first_frequency=math.nan,
        contacts=(),
        **loaded,
    )
    return _with_contacts(bare, system.contacts)


def _matrix_on_basis(name: str, value: Any, size: int) -> Matrix:
    if value is None:
        return sparse.csr_array((size, size))
    matrix = checked_matrix(name, value)
    allowed = f"must have the shape ({size}, {size}): all dofs of the basis, held ones included"
    require(matrix.shape == (size, size), name, matrix.shape, "", allowed)
    return matrix


def _with_terms(
    item: Reaction,
    rayleigh: tuple[float, float] | None,
    on_basis: dict[str, Matrix],
    momentum: NDArray[np.float64],
    force: NDArray[np.float64],
    expansion: Matrix,
) -> Reaction:
    """A reaction with the rows of the added terms at its dof."""
    if item.dof is None:
        return item
    added = {name: (matrix[[item.dof]] @ expansion).toarray()[0] for name, matrix in on_basis.items()}
    alpha, beta = rayleigh or (0.0, 0.0)
    damped = alpha * added["mass"] + beta * added["stiffness"] + added["damping"]
    return replace(
        item,
        on_acceleration=own(item.on_acceleration + added["mass"]),
        on_velocity=own(item.on_velocity + damped),
        on_displacement=own(item.on_displacement + added["stiffness"]),
        on_base_acceleration=item.on_base_acceleration + float(momentum[item.dof]),
        constant=item.constant + float(force[item.dof]),
    )


def _with_contacts(bare: System, contacts: tuple[ContactPair, ...]) -> System:
    """A system whose matrices are new, with its first frequency and what its contacts take from the matrices."""
    modes = solve_modes(bare, 1)
    rows = np.array([-pair.direction if pair.is_stop else pair.direction for pair in contacts])
    compliance = flexibility(bare, rows.reshape(len(contacts), bare.dofs))
    pairs = tuple(
        pair if pair.between else replace(pair, first_mode=first_mode_at(bare, modes, row), flexibility=float(flexible))
        for pair, row, flexible in zip(contacts, rows, compliance, strict=True)
    )
    frequency = float(modes.natural_frequency[0])
    return with_checked_fields(bare, first_frequency=frequency, contacts=pairs)
