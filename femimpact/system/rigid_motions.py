"""Rigid motions that nothing holds, of a beam on one spring or of coordinates without stiffness."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

__all__ = ["rigid_motions"]

FREE = 1e-9
"""Share of a strain's terms below which it is rounding."""


def rigid_motions(system: Any) -> NDArray[np.float64]:
    """Motions without strain: K r = 0, r^T M r = 1.

    Parameters
    ----------
    system : System
        Of a beam as `assemble` gives it, or on coordinates whose matrices are diagonal. Of others none are known.

    Returns
    -------
    ndarray (dofs, k), kg^-0.5
        Orthonormal with M, computed once for a system; k = 0 where all is held.
    """
    kept = system.derived_undamped
    if "rigid motions" not in kept:
        motions = _rigid_motions(system)
        motions.setflags(write=False)
        kept["rigid motions"] = motions
    found: NDArray[np.float64] = kept["rigid motions"]
    return found


def _rigid_motions(system: Any) -> NDArray[np.float64]:
    if system.is_diagonal:
        unheld = np.flatnonzero(system.K.diagonal() == 0.0)
        motions = np.zeros((system.dofs, unheld.size))
        motions[unheld, np.arange(unheld.size)] = 1.0 / np.sqrt(system.M.diagonal()[unheld])
        return motions
    if system.sections is None or not sparse.issparse(system.expansion):
        return np.zeros((system.dofs, 0))
    straight = _straight_motions(system.nodes)
    factor: Any = sparse.csr_array(system.stiffness_factor)
    expansion: Any = system.expansion
    dofs = np.asarray(expansion.T @ straight)
    held = straight - expansion @ dofs
    # each strain by its own terms: springs may be softer than the beam by any number of decades
    terms = (abs(factor) @ np.abs(dofs)).max(axis=1)
    strains = (factor @ dofs)[terms > 0.0] / terms[terms > 0.0, None]
    sizes, shares = np.linalg.svd(np.vstack([held, strains]), full_matrices=False)[1:]
    motions = dofs @ shares[sizes <= FREE * np.sqrt(strains.shape[0] + 1.0)].T
    if not motions.size:
        return np.asarray(motions)
    lower = np.linalg.cholesky(motions.T @ (system.M @ motions))
    return np.asarray(np.linalg.solve(lower, motions.T).T)


def _straight_motions(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Translation and rotation about the root, (2 nodes, 2), both at most 1."""
    length = float(nodes[-1])
    motions = np.zeros((2 * nodes.size, 2))
    motions[0::2, 0] = 1.0
    motions[0::2, 1], motions[1::2, 1] = nodes / length, 1.0 / length
    return motions
