"""The damping matrix of a system, from ratios of its own modes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.sparse as sparse
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import require, require_type
from femimpact.structure.damping import ModalDamping, Rayleigh, rayleigh_coefficients
from femimpact.system.computed import with_checked_fields
from femimpact.system.modes import Modes, solve_modes
from femimpact.system.reactions import damped_reactions
from femimpact.system.system import System

__all__ = ["damped_with_modes", "rayleigh_of", "with_damping"]


def with_damping(system: System, damping: Rayleigh | ModalDamping | None) -> System:
    """The same system with another damping, its ratios those of the modes that the system has now.

    Parameters
    ----------
    system : System
        Also after `add_terms`, which leaves the damping of the structure what it was.
    damping : Rayleigh, ModalDamping or None
        None is no damping. C is replaced whole, dashpots and damping that a user adds included.

    Returns
    -------
    System

    Raises
    ------
    InputError
        If the damping is of another kind, or refers to a mode that the system does not have.
    """
    require_type(system, System, "system")
    return damped_with_modes(system, damping)[0]


def damped_with_modes(
    system: System, damping: Rayleigh | ModalDamping | None, least: int = 1
) -> tuple[System, Modes]:  # fmt: skip
    """The damped system, and the modes that its ratios refer to: as many as these need, but not less than `least`."""
    known = damping is None or isinstance(damping, (Rayleigh, ModalDamping))
    require(known, "damping", damping, "", "must be a Rayleigh, a ModalDamping or None")
    count, key, value = 1, "damping.modes", None
    if isinstance(damping, ModalDamping):
        count, key, value = len(damping.each), "damping.ratios", damping.each
    elif damping is not None and damping.modes:
        count, value = max(damping.modes), damping.modes
    allowed = f"must be at most {system.dofs}, the dofs of this mesh: use more elements"
    require(count <= system.dofs, key, value, "", allowed)
    modes = solve_modes(system, max(count, least))
    if isinstance(damping, ModalDamping):
        return _by_modes(system, modes, np.array(damping.each)), modes
    alpha, beta = (0.0, 0.0) if damping is None else rayleigh_of(damping, 2.0 * math.pi * modes.natural_frequency)
    damped = with_checked_fields(
        system,
        C=sparse.csr_array(system.C.shape) if damping is None else sparse.csr_array(alpha * system.M + beta * system.K),
        rayleigh=(alpha, beta),
        reactions=damped_reactions(system.reactions, alpha, beta),
    )
    return damped, modes


def rayleigh_of(damping: Rayleigh, omega: NDArray[np.float64]) -> tuple[float, float]:
    """Coefficients alpha (1/s) and beta (s) of a damping on a structure with the angular frequencies omega (rad/s)."""
    ratio = damping.ratio if isinstance(damping.ratio, tuple) else (damping.ratio, damping.ratio)
    if damping.modes:
        first, second = damping.modes
        elastic = bool(min(omega[first - 1], omega[second - 1]) > 0.0)
        rigid = int(np.count_nonzero(omega == 0.0))
        allowed = f"must be elastic ones, from {rigid + 1} on: a rigid motion has no ratio"
        require(elastic, "damping.modes", damping.modes, "", allowed)
        return rayleigh_coefficients((omega[first - 1], omega[second - 1]), ratio)
    low, high = damping.frequencies or (0.0, 0.0)
    return rayleigh_coefficients((2 * math.pi * low, 2 * math.pi * high), ratio)


def _by_modes(system: System, modes: Modes, ratio: NDArray[np.float64]) -> System:
    """C = beta K + sum_k c_k (M phi_k)(M phi_k)^T, on the held rows, too."""
    omega = 2.0 * math.pi * modes.natural_frequency[: ratio.size]
    held = bool(omega[0] > 0.0)
    require(held, "damping.ratios", float(ratio[0]), "", "needs a structure that is held: a rigid motion has no ratio")
    beta = 2.0 * float(ratio[-1] / omega[-1])
    size = 2.0 * ratio * omega - beta * omega**2
    vectors = modes.vectors[:, : ratio.size]
    momentum = system.M @ vectors
    full = (momentum * size) @ momentum.T
    reactions = {
        name: replace(
            item,
            on_velocity=_row(beta * item.on_displacement + ((item.on_acceleration @ vectors) * size) @ momentum.T),
        )
        for name, item in system.reactions.items()
    }
    C = sparse.csr_array(beta * system.K + sparse.csr_array(0.5 * (full + full.T)))
    return with_checked_fields(system, C=C, rayleigh=None, reactions=reactions)


def _row(values: ArrayLike) -> NDArray[np.float64]:
    row = np.array(values, dtype=float)
    row.setflags(write=False)
    return row
