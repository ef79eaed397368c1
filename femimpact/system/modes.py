"""Modes of a system, and its damping matrix from damping ratios of these modes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.arrays import Array, own
from femimpact.errors import (
    check_fields,
    column,
    in_range,
    made,
    quantity,
    require,
    require_type,
)
from femimpact.structure.beam import ModalDamping, Rayleigh, rayleigh_coefficients, realised_damping_ratio
from femimpact.system.hermite import damped_reactions
from femimpact.system.matrices import diagonal_matrix, rigid_motions, stiffness_solver
from femimpact.system.system import System, with_checked_fields
from femimpact.table import Head, frame_of, head_of_columns, short_repr

if TYPE_CHECKING:
    import pandas


def with_modal_damping(system: System, alpha: float, beta: float) -> System:
    """The same system, on its modes, with C = alpha M + beta K (1/s, s), both >= 0."""
    C = diagonal_matrix(alpha * system.M.diagonal() + beta * system.K.diagonal())
    reactions = damped_reactions(system.reactions, alpha, beta)
    return with_checked_fields(system, C=C, rayleigh=(alpha, beta), reactions=reactions)


STILL = 1e-9
"""Share of what a motion may do below which a place is still."""

DENSE_LIMIT = 60
"""Up to this many dofs the dense solver is both exact and faster than shift-invert."""


@short_repr
@dataclass(frozen=True, eq=False)
class Modes:
    """Undamped modes of the structure, mass-normalised, positive at the tip.

    Participation factor and effective mass are those of Clough and Penzien, 2003.

    Parameters
    ----------
    natural_frequency : ndarray (count,), Hz
    damping_ratio : ndarray (count,), 1
        Realised by the system's damping matrix: phi^T C phi/(2 omega).
    participation_factor : ndarray (count,), kg^0.5
        phi^T M r for base motion, held dofs included.
    vectors : ndarray (dofs, count)
        phi, with phi^T M phi = 1.
    """

    natural_frequency: Array = field(metadata=column("Hz", "modes", finite=True))
    damping_ratio: Array = field(metadata=column("1", "modes", finite=True))
    participation_factor: Array = field(metadata=column("kg^0.5", "modes", finite=True))
    vectors: Array = field(metadata=column("kg^-0.5", "dofs", "modes", finite=True))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def _head(self) -> Head:
        dofs, count = self.vectors.shape
        return head_of_columns(f"Modes: {count} of {dofs} dofs", *mode_columns(self))

    def to_pandas(self) -> pandas.DataFrame:
        """A row for every mode by its number from 1, without the vectors; units in `attrs["units"]`."""
        return frame_of(*mode_columns(self), index="mode")

    @property
    def effective_mass(self) -> Array:
        """Square of the participation factor, (count,) in kg; all of them sum to the moving mass."""
        return own(self.participation_factor**2)


def mode_columns(modes: Modes) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns of a row for every mode, by its number from 1, and their units."""
    units = {
        "mode": "1", "natural_frequency": "Hz", "damping_ratio": "1", "participation_factor": "kg^0.5",
        "effective_mass": "kg",
    }  # fmt: skip
    numbers = {"mode": np.arange(1, modes.natural_frequency.size + 1)}
    return numbers | {name: getattr(modes, name) for name in units if name not in numbers}, units


def require_modes_of(dofs: int, modes: Modes) -> None:
    """Raise `InputError` unless modes may be those of a system with so many dofs."""
    rows = modes.vectors.shape[0]
    require(rows == dofs, "modes", rows, "dofs", f"must be modes of the system, with {dofs} dofs")


def mode_count(system: System, count: int, key: str = "count") -> int:
    """The checked number of modes asked of a system: a whole number up to that of its dofs."""
    require_type(system, System, "system")
    within = in_range(count, quantity("modes", at_least=1, at_most=system.dofs, integer=True))
    require(within, key, count, "modes", f"must be a whole number from 1 to {system.dofs} (the dofs)")
    return int(count)


def solve_modes(system: System, count: int) -> Modes:
    """The lowest natural modes, (K - omega^2 M) phi = 0, phi^T M phi = 1.

    Parameters
    ----------
    count : int
        How many, 1 to the number of dofs.

    Raises
    ------
    InputError
        If masses or stiffnesses differ beyond rounding.

    Notes
    -----
    Rounding in an assembled Hermite stiffness grows like N^4 and spoils the low modes of a fine
    mesh (3e-4 at N = 2000) whatever the eigensolver. Here both solvers work on the stiffness
    factor G, K = G^T G, whose condition number is the root of K's, and the frequency is read
    from the Rayleigh quotient |G phi|^2.
    """
    return lowest_modes(system, mode_count(system, count))


def lowest_modes(system: System, count: int) -> Modes:
    """The same of a number of modes that the system has."""
    rigid = rigid_motions(system)[:, :count]
    rigid_count = rigid.shape[1]
    vectors, omega = _vectors(system, count, rigid)
    omega[:rigid_count] = 0.0
    order = np.argsort(omega)
    vectors, omega = vectors[:, order], omega[order]
    ratio = damping_ratios(system, vectors, omega)
    participation = vectors.T @ system.base_load
    natural = omega / (2 * math.pi)
    for array in (natural, ratio, participation, vectors):
        array.setflags(write=False)
    return made(
        Modes, natural_frequency=natural, damping_ratio=ratio, participation_factor=participation, vectors=vectors
    )


def damping_ratios(system: System, vectors: Array, omega: Array) -> Array:
    """Damping ratio (1) of normalised modes (dofs, count) of angular frequencies omega (rad/s); 0 of rigid motions."""
    if system.rayleigh is not None and np.all(omega > 0.0):
        return realised_damping_ratio(*system.rayleigh, omega)
    damping = np.einsum("ij,ij->j", vectors, system.C @ vectors)
    # a rigid motion has no ratio to a critical damping
    return np.asarray(np.divide(damping, 2 * omega, out=np.zeros_like(omega), where=omega > 0))


def _vectors(system: System, count: int, rigid: Array) -> tuple[Array, Array]:
    """Normalised modes (dofs, count), the rigid motions first, and their angular frequencies (rad/s)."""
    elastic = count - rigid.shape[1]
    try:
        with np.errstate(all="ignore"):
            parts = [rigid]
            if elastic and (system.dofs <= DENSE_LIMIT or count > system.dofs // 4):
                parts.append(_dense_modes(system, elastic, rigid))
            elif elastic:
                parts.append(_shift_invert_modes(system, elastic))
            vectors = _normalised(system, np.hstack(parts))
            omega: Array = np.linalg.norm(system.stiffness_factor @ vectors, axis=0)
        sound = bool(np.isfinite(vectors).all() and np.isfinite(omega).all())
    # of matrices that are singular to rounding, by LAPACK, by SuperLU or ARPACK, and by what looks for infinities
    except (np.linalg.LinAlgError, RuntimeError, ValueError):
        sound = False
    allowed = "must have modes in numbers: its masses, or its stiffnesses, differ by too many powers of ten"
    require(sound, "system", None, "", allowed)
    return vectors, omega


def _dense_modes(system: System, count: int, rigid: Array) -> Array:
    """Elastic modes from the singular values of G L^-T, K = G^T G and M = L L^T: omega, not omega squared."""
    lower = scipy.linalg.cholesky(system.M.toarray(), lower=True)
    factor = scipy.linalg.solve_triangular(lower, system.stiffness_factor.toarray().T, lower=True).T
    basis = None
    if rigid.shape[1]:
        # of what is orthogonal to the rigid motions, with M
        motions = scipy.linalg.solve_triangular(lower, system.M @ rigid, lower=True)
        basis = scipy.linalg.qr(motions)[0][:, rigid.shape[1] :]
        factor = factor @ basis
    # with fewer strains than dofs, those without strain, too
    right = scipy.linalg.svd(factor, full_matrices=factor.shape[0] < factor.shape[1])[2][::-1][:count].T
    right = right if basis is None else basis @ right
    return np.asarray(scipy.linalg.solve_triangular(lower, right, lower=True, trans="T"))


def solve_stiffness(
    system: System,
    loads: Array,  # (dofs, k) N
) -> Array:  # (dofs, k) m
    """Static displacements K^-1 f, with K applied through its factor G.

    K x = f is solved as the stable mixed problem [s I, G; G^T, 0] [-G x / s; x] = [0; f] / s
    (the augmented system of Bjoerck, 1967): its rounding grows like the condition of G, the root of K's.
    """
    return stiffness_solver(system)(loads)


def first_elastic_frequency(system: System) -> float:
    """The lowest natural frequency (Hz) that is not that of a rigid motion; 0 where none is known."""
    if system.first_frequency > 0.0:
        return system.first_frequency
    rigid_count = rigid_motions(system).shape[1]
    if rigid_count in (0, system.dofs):
        return system.first_frequency
    return float(lowest_modes(system, rigid_count + 1).natural_frequency[rigid_count])


def first_resonance(system: System) -> tuple[float, float]:
    """Natural frequency (Hz) and damping ratio (1) of the lowest mode that is no rigid motion, or of the last one."""
    modes = lowest_modes(system, min(rigid_motions(system).shape[1] + 1, system.dofs))
    return float(modes.natural_frequency[-1]), float(modes.damping_ratio[-1])


def first_mode_at(system: System, modes: Modes, row: Array) -> float:
    """The first mode (kg^-0.5) as a row reads it.

    Where rigid motions are free, all of them together, or the first elastic mode at a place that they leave still.
    """
    rigid_count = int(np.count_nonzero(modes.natural_frequency == 0.0))
    if rigid_count == 0:
        return float(row @ modes.vectors[:, 0])
    rigid = rigid_motions(system)
    moved = float(np.linalg.norm(row @ rigid))
    if moved > STILL * float(np.abs(row) @ np.abs(rigid).max(axis=1)):
        return moved
    return float(row @ lowest_modes(system, rigid.shape[1] + 1).vectors[:, -1])


def flexibility(system: System, rows: Array) -> Array:
    """b^T K^-1 b (m/N) of every row (k, dofs), through the stiffness factor so that fine meshes keep their digits.

    Not a number where rigid motions are free.
    """
    if rows.size == 0:
        return np.zeros(len(rows))
    if rigid_motions(system).shape[1]:
        return np.full(len(rows), math.nan)
    solved = solve_stiffness(system, rows.T)
    return np.asarray(np.einsum("ji,ij->j", rows, solved))


def _shift_invert_modes(system: System, count: int) -> Array:
    """Lanczos on K^-1 M, in which rigid motions are the fastest of all."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    inverse, mass = (
        LinearOperator(system.M.shape, matvec=product, dtype=float)
        for product in (stiffness_solver(system), system.M.__matmul__)
    )
    # a fixed start vector: the same call gives the same bits
    start = np.ones(system.dofs)
    # of K^-1 M the lowest modes are so much the largest that so many vectors hold five of them, in one pass
    most = max(2 * count + 1, 16)
    return np.asarray(eigsh(system.K, k=count, M=mass, sigma=0.0, OPinv=inverse, v0=start, ncv=most, tol=0)[1])


def _normalised(system: System, vectors: Array) -> Array:
    """Scaled to unit modal mass; positive at the tip, or at the largest component where the tip is still."""
    vectors = vectors / np.sqrt(np.einsum("ij,ij->j", vectors, system.M @ vectors))
    tip = system.point_row(system.default_place) @ vectors
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=0)[None], axis=0)[0]
    still = np.abs(tip) < 1e-9 * np.abs(largest)
    sign = np.where(np.where(still, largest, tip) < 0, -1.0, 1.0)
    return vectors * sign


def with_damping(system: System, damping: Rayleigh | ModalDamping | None) -> System:
    """The same system with another damping, its ratios those of the modes that the system has now.

    Parameters
    ----------
    system : System
        Also after `add_terms`, which leaves the damping of the structure what it was.
    damping : Rayleigh, ModalDamping or None
        None is no damping. All of C is replaced, dashpots and damping that a user adds included.

    Raises
    ------
    InputError
        If the damping refers to a mode that the system does not have.
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
    modes = lowest_modes(system, max(count, least))
    if isinstance(damping, ModalDamping):
        return _by_modes(system, modes, np.array(damping.each)), modes
    alpha, beta = (0.0, 0.0) if damping is None else rayleigh_of(damping, 2.0 * math.pi * modes.natural_frequency)
    rigid = rigid_motions(system)
    if alpha > 0.0 and rigid.shape[1] == 2 and system.sections is not None:
        # that of a beam which nothing holds keeps its momentum
        momentum = system.M @ rigid
        C = sparse.csr_array(alpha * (system.M - sparse.csr_array(momentum @ momentum.T)) + beta * system.K)
        return with_checked_fields(system, C=C, rayleigh=None), modes
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
    rigid = int(np.count_nonzero(omega == 0.0))
    still = bool(rigid < ratio.size and not np.any(ratio[:rigid]))
    allowed = f"must begin with {rigid} of 0: a rigid motion has no ratio, and those of elastic modes follow"
    require(rigid == 0 or still, "damping.ratios", float(ratio[0]), "", allowed)
    beta = 2.0 * float(ratio[-1] / omega[-1])
    size = 2.0 * ratio * omega - beta * omega**2
    vectors = modes.vectors[:, : ratio.size]
    momentum = system.M @ vectors
    full = (momentum * size) @ momentum.T
    reactions = {}
    for name, item in system.reactions.items():
        row = beta * item.on_displacement + ((item.on_acceleration @ vectors) * size) @ momentum.T
        reactions[name] = replace(item, on_velocity=own(row))
    C = sparse.csr_array(beta * system.K + sparse.csr_array(0.5 * (full + full.T)))
    return with_checked_fields(system, C=C, rayleigh=None, reactions=reactions)
