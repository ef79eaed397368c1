"""Modal coordinates: the same equations on a few normal modes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sparse

from femimpact.errors import require
from femimpact.modes import solve_modes
from femimpact.system import System

__all__ = ["reduce"]


def reduce(system: System, modes: int) -> System:
    """The system on its lowest normal modes, u = Phi q: a `System` again, with diagonal matrices.

    q'' + 2 zeta omega q' + omega^2 q = -Phi^T base_load ub'' + sum_j (b_j^T Phi) F_j.

    Parameters
    ----------
    system : System
    modes : int
        How many normal modes are kept, 1 to the number of dofs; exactly so many.

    Returns
    -------
    System
        M = 1, C = diag(2 zeta omega), K = diag(omega^2); contacts keep their effective mass.

    Raises
    ------
    InputError
        If modes is out of range, or the damping does not decouple on the modes.
    """
    kept = solve_modes(system, modes)
    phi = kept.vectors
    omega = 2.0 * math.pi * kept.natural_frequency
    if system.rayleigh is None:
        _check_decoupled(phi.T @ (system.C @ phi))
    contacts = tuple(replace(pair, direction=_row(pair.direction @ phi)) for pair in system.contacts)
    return replace(
        system,
        M=sparse.eye_array(modes, format="csr"),
        C=sparse.diags_array(2.0 * kept.damping_ratio * omega, format="csr"),
        K=sparse.diags_array(omega**2, format="csr"),
        stiffness_factor=sparse.diags_array(omega, format="csr"),
        base_load=_row(phi.T @ system.base_load),
        rigid_translation=_row(phi.T @ (system.M @ system.rigid_translation)),
        expansion=np.asarray(system.expansion @ phi),
        contacts=contacts,
        directions={name: _row(row @ phi) for name, row in system.directions.items()},
    )


def _check_decoupled(damping: Any) -> None:
    """Raise unless the modal damping matrix is diagonal, seen against its diagonal."""
    diagonal = np.sqrt(np.abs(np.diag(damping)))
    off = np.abs(damping - np.diag(np.diag(damping)))
    allowed = "must decouple on the normal modes (Rayleigh does) to reduce the system"
    decoupled = bool(np.all(off <= 1e-6 * np.outer(diagonal, diagonal) + 1e-300))
    require(decoupled, "damping", float(off.max()), "1/s", allowed)


def _row(array: Any) -> Any:
    row = np.array(array, dtype=float)
    row.setflags(write=False)
    return row
