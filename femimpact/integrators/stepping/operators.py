"""The structure made ready for the steps of a method: factorised once, however often contact switches."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.integrators.stepping.layout import BandedStep, ModalStep, Operator, Scheme
from femimpact.system.matrices import Matrix
from femimpact.system.system import System

__all__ = ["bands", "operator_of"]

Array = NDArray[np.float64]


def bands(matrix: Matrix) -> Array:
    """Lower bands (k + 1, n) of a symmetric sparse matrix: bands[k, i] = A[i + k, i]."""
    entries = sparse.coo_array(matrix)
    row, column = entries.coords
    width = int(np.max(row - column, initial=0))
    result = np.zeros((width + 1, matrix.shape[0]))
    lower = row >= column
    np.add.at(result, (row[lower] - column[lower], column[lower]), entries.data[lower])
    return result


def _widened(band: Array, width: int) -> Array:
    return np.vstack([band, np.zeros((width - band.shape[0], band.shape[1]))])


def operator_of(system: System, s: Scheme, observed: Array, load: Array) -> Operator:
    """Operator of a system for a scheme.

    S = (1 - alpha_m) M + (1 - alpha_f)(correct_v C + correct_u K), S a1 = load s - K u0
    - [C + (1 - alpha_f) dt K] v0 - [alpha_m M + (1 - alpha_f)(predict_v C + predict_u K)] a0.

    Parameters
    ----------
    system : System
    s : Scheme
    observed : ndarray (dofs,)
        Row read every step.
    load : ndarray (dofs,)
        Of the drive.

    Returns
    -------
    Operator
    """
    M, C, K, felt = system.M, system.C, system.K, 1.0 - s.alpha_f
    effective = bands((1.0 - s.alpha_m) * M + felt * (s.correct_v * C + s.correct_u * K))
    factor = scipy.linalg.cholesky_banded(effective, lower=True)
    diagonal = system.is_diagonal
    m, c, k = (matrix.diagonal() for matrix in (M, C, K))
    scale = effective[0] if diagonal else np.ones(system.dofs)
    table = _rows(system, observed)
    a, u, v = _responses(system, s, (factor, True))
    constant = _constant(system, s, (factor, True))
    lower = factor.copy()
    lower[0] = 1.0 / lower[0]
    return Operator(
        banded=not diagonal,
        modes=ModalStep(
            load=load / scale,
            inertia=(s.alpha_m * m + felt * (s.predict_v * c + s.predict_u * k)) / scale,
            damping=(c + felt * s.dt * k) / scale,
            stiffness=k / scale,
            loss=0.25 * s.dt * c,
        ),
        mass_band=bands(M),
        damping_band=_widened(bands(C), lower.shape[0]),
        stiffness_band=_widened(bands(K), lower.shape[0]),
        cholesky_band=lower,
        narrow=_banded_step(system, s, factor),
        drive_load=np.array(load),
        constant_load=constant[0],
        constant_a=constant[1],
        constant_u=s.correct_u * constant[1],
        constant_v=s.correct_v * constant[1],
        constant_w=_constant_rows(table, s, constant[1]),
        rows=table,
        response_a=a,
        response_u=u,
        response_v=v,
        compliance_u=np.ascontiguousarray(table @ u.T),
        compliance_v=np.ascontiguousarray(table @ v.T),
    )


def _banded_step(system: System, s: Scheme, factor: Array) -> BandedStep:
    """Up to four bands dof by dof, as the banded step reads them once from the first to the last."""
    most, n = factor.shape
    if most > 4 or system.is_diagonal:
        return BandedStep(np.zeros(0), np.zeros(0))
    narrow, unit = np.zeros((n + 6, 12)), np.zeros((n + 6, 4))
    for first, matrix in ((0, system.C), (4, system.K), (8, s.alpha_m * system.M)):
        band = bands(matrix)
        narrow[3:-3, first : first + band.shape[0]] = -band.T
    unit[3:-3, 0] = 1.0 / factor[0] ** 2
    for k in range(1, most):
        unit[3 + k : -3, k] = -(factor[k] / factor[0])[: n - k]
    return BandedStep(narrow.ravel(), unit.ravel())


def _rows(system: System, observed: Array) -> Array:
    """The observed place and every contact direction, each once."""
    rows: list[Array] = [observed]
    for pair in system.contacts:
        if not any(np.array_equal(pair.direction, row) for row in rows):
            rows.append(pair.direction)
    return np.ascontiguousarray(rows)


def _constant(system: System, s: Scheme, factor: tuple[Array, bool]) -> tuple[Array, Array]:
    """The constant load (N) and what it does in one step to the accelerations, S^-1 f; nothing where there is none."""
    load = np.array(system.constant_load)
    if not np.any(load):
        return np.zeros(0), np.zeros(0)
    return load, np.asarray(scipy.linalg.cho_solve_banded(factor, load))


def _constant_rows(table: Array, s: Scheme, a: Array) -> Array:
    if a.size == 0:
        return np.zeros((2, 0))
    read = table @ a
    return np.ascontiguousarray([s.correct_u * read, s.correct_v * read])


def _responses(system: System, s: Scheme, factor: tuple[Array, bool]) -> tuple[Array, Array, Array]:
    """What a force of 1 N along each b does in one step to accelerations, displacements and velocities.

    Within the balance: a = (1 - alpha_f) S^-1 b. As one mean force beside it, v gains dt M^-1 b and
    u gains give_u M^-1 b, to which the accelerations answer by -S^-1 (C dt + K give_u) M^-1 b.
    """
    b = np.array([pair.direction for pair in system.contacts]).reshape(-1, system.dofs).T
    impulse_u = impulse_v = np.zeros_like(b)
    if s.mean:
        free = scipy.linalg.solveh_banded(bands(system.M), b, lower=True) if b.size else b
        impulse_u, impulse_v = s.give_u * free, s.give_v * free
        b = -(system.C @ impulse_v + system.K @ impulse_u)
    a = (1.0 - s.alpha_f) * scipy.linalg.cho_solve_banded(factor, b) if b.size else b
    return (
        np.ascontiguousarray(a.T),
        np.ascontiguousarray((impulse_u + s.correct_u * a).T),
        np.ascontiguousarray((impulse_v + s.correct_v * a).T),
    )
