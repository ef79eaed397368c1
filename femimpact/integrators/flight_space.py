"""The linear equations between two events, solved in closed form.

While nothing changes its contact, structure and balls obey p = (u, y),

    M p'' + C p' + K p = B s(t) + G,   subject to  y_j - b_j u = side_j gap_j  for every riding pair j.

Its solution is p(t) = Re(E e^{Lambda t} H) + (particles) + Re(p^ e^{i theta(t)}) + p0: decaying exponentials of
the homogeneous equations (see `complex_modes`), bodies that nothing pulls back (free balls) on parabolas, and the
steady answer to s(t). An event changes H and the particles' velocities; the steady answer never.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.integrators.complex_modes import ComplexModes, complex_modes
from femimpact.integrators.driving import Drive
from femimpact.system import System

__all__ = ["Equations", "FlightSpace", "Riders", "equations_of", "flight_space", "undamped_modes", "wall_offset"]

RIGID = 1e-14
"""Eigenvalues below this share of the largest are rigid motions, where the stiffness is singular."""

Riders = tuple[tuple[int, int], ...]
"""Riding pairs: number and side (+1 or -1) of each."""


@dataclass(frozen=True, eq=False)
class FlightSpace:
    """Closed form of the motion for one set of riding pairs; K entries, P particles, p of size d.

    Parameters
    ----------
    riders : Riders
    modes : ComplexModes
        Lambda, of K entries.
    shape : ndarray (d, K)
        E.
    particle_shape : ndarray (d, P)
    particle_given, particle_drive : ndarray (P,)
        Accelerations: given + drive s(t).
    harmonic : ndarray (d,)
        p^ for s(t) = Re(e^{i theta}).
    static : ndarray (d,), m
        p0: constant loads and the gaps of riding pairs.
    follow, follow_rate : ndarray (d,)
        Steady answer to a straight s(t): follow s + follow_rate s'.
    to_entry_u, to_entry_v : ndarray (K, d)
        H = to_entry_u p + to_entry_v p', steady parts taken off.
    to_particle : ndarray (P, d)
        Particle coordinates from p, and their rates from p'.
    kick : ndarray (K, pairs), particle_kick : ndarray (P, pairs)
        Change of H and of the particles' rates by a unit impulse on the structure at each pair.
    jump_value, jump_slope : ndarray (K,)
        Change of H where a broken-line s(t) jumps by 1 in value, or in slope.
    force_shape, force_harmonic, force_static, force_follow, force_follow_rate
        The same for the contact force (N, on the structure) of every rider.
    """

    riders: Riders
    modes: ComplexModes
    shape: NDArray[Any]
    particle_shape: NDArray[Any]
    particle_given: NDArray[Any]
    particle_drive: NDArray[Any]
    harmonic: NDArray[Any]
    static: NDArray[Any]
    follow: NDArray[Any]
    follow_rate: NDArray[Any]
    to_entry_u: NDArray[Any]
    to_entry_v: NDArray[Any]
    to_particle: NDArray[Any]
    kick: NDArray[Any]
    particle_kick: NDArray[Any]
    jump_value: NDArray[Any]
    jump_slope: NDArray[Any]
    force_shape: NDArray[Any]
    force_harmonic: NDArray[Any]
    force_static: NDArray[Any]
    force_follow: NDArray[Any]
    force_follow_rate: NDArray[Any]


@dataclass(frozen=True, eq=False)
class Equations:
    """M, C, K, loads of p = (u, y), and the direction P_j in which a force on the structure at pair j acts."""

    M: NDArray[Any]
    C: NDArray[Any]
    K: NDArray[Any]
    drive: NDArray[Any]
    given: NDArray[Any]
    force: NDArray[Any]  # (d, pairs)


def equations_of(system: System, drive: Drive) -> Equations:
    """Matrices over all structure dofs and all balls; stops have no coordinate."""
    n, balls = system.dofs, len(system.balls)
    size = n + balls
    M, C, K = (np.zeros((size, size)) for _ in range(3))
    for matrix, own in ((M, system.M), (C, system.C), (K, system.K)):
        matrix[:n, :n] = own.toarray()
    load, given = np.zeros(size), np.zeros(size)
    load[:n] = drive.load
    force = np.zeros((size, len(system.contacts)))
    for j, pair in enumerate(system.contacts):
        force[:n, j] = pair.direction
        if pair.is_stop:
            continue
        force[n + j, j] = -1.0
        M[n + j, n + j] = pair.mass
        load[n + j] = -pair.mass * drive.share
        given[n + j] = pair.mass * pair.acceleration
        K += pair.free_stiffness * np.outer(force[:, j], force[:, j])
    return Equations(M, C, K, load, given, force)


def flight_space(system: System, drive: Drive, riders: Riders = ()) -> FlightSpace:
    """Closed form of the motion while exactly these pairs ride.

    Parameters
    ----------
    system : System
    drive : Drive
    riders : Riders

    Returns
    -------
    FlightSpace

    Raises
    ------
    InputError
        If the drive is a resonance without damping, whose closed form is unbounded.
    """
    whole = equations_of(system, drive)
    basis, offset = _constrained(system, whole, riders)
    M, C, K = (basis.T @ matrix @ basis for matrix in (whole.M, whole.C, whole.K))
    given = basis.T @ (whole.given - whole.K @ offset)
    omega_squared, vectors = undamped_modes(K, M)
    shapes = basis @ vectors
    damping = vectors.T @ C @ vectors
    load, given = shapes.T @ whole.drive, vectors.T @ given
    # what nothing pulls back and nothing brakes moves on parabolas: free balls, rigid motions
    stiff = omega_squared > 0.0
    braked = np.max(np.abs(damping), axis=0, initial=0.0) > 1e-15 * max(float(np.abs(damping).max(initial=0.0)), 1e-300)
    bound = stiff | braked
    omega_squared = np.where(stiff, omega_squared, 0.0)
    modes = complex_modes(omega_squared[bound], damping[np.ix_(bound, bound)])
    elastic, loose = shapes[:, bound], shapes[:, ~bound]
    momentum_u, momentum_loose = elastic.T @ whole.M, loose.T @ whole.M
    beta = modes.from_v @ load[bound]
    harmonic = _steady(drive, elastic, omega_squared[bound], damping[np.ix_(bound, bound)], load[bound])
    harmonic = harmonic - loose @ load[~bound] / max(drive.omega, 1e-300) ** 2
    compliance = elastic @ _solve_static(omega_squared[bound], damping[np.ix_(bound, bound)])
    static = offset + compliance @ given[bound]
    follow = compliance @ load[bound]
    if drive.samples is not None or np.any(given[bound] * ~stiff[bound]):
        kept = bool(np.all(np.abs(modes.exponent) > 0.0))
        require(kept, "system", None, "", "must have stiffness in every braked motion for this excitation")
    jump_value = modes.inverse_rate @ beta
    jump_slope = modes.inverse_rate @ jump_value
    found: dict[str, Any] = {
        "riders": riders,
        "modes": modes,
        "shape": elastic @ modes.shape,
        "particle_shape": loose,
        "particle_given": given[~bound],
        "particle_drive": load[~bound],
        "harmonic": harmonic,
        "static": static,
        "follow": follow,
        "follow_rate": -np.real(elastic @ modes.shape @ jump_slope),
        "to_entry_u": modes.from_u @ momentum_u,
        "to_entry_v": modes.from_v @ momentum_u,
        "to_particle": momentum_loose,
        "kick": modes.from_v @ elastic.T @ whole.force,
        "particle_kick": loose.T @ whole.force,
        "jump_value": jump_value,
        "jump_slope": jump_slope,
    }
    found.update(_contact_forces(whole, drive, found))
    return FlightSpace(**found)


def _constrained(system: System, whole: Equations, riders: Riders) -> tuple[NDArray[Any], NDArray[Any]]:
    """Basis of the motions that riding leaves, and the offset that puts every rider on its wall."""
    size = whole.M.shape[0]
    if not riders:
        return np.eye(size), np.zeros(size)
    offset, n = wall_offset(system, whole, riders), system.dofs
    stops = [i for i, (j, _) in enumerate(riders) if system.contacts[j].is_stop]
    rows = np.array([-whole.force[:, j] for j, _ in riders])
    left = np.eye(n) if not stops else scipy.linalg.null_space(rows[stops, :n])
    flying = [i for i in range(n, size) if i - n not in dict(riders)]
    basis = np.zeros((size, left.shape[1] + len(flying)))
    basis[:n, : left.shape[1]] = left
    basis[flying, left.shape[1] + np.arange(len(flying))] = 1.0
    for j, _ in riders:
        if not system.contacts[j].is_stop:
            basis[n + j, : left.shape[1]] = whole.force[:n, j] @ left
    return basis, offset


def wall_offset(system: System, whole: Equations, touching: Riders) -> NDArray[Any]:
    """Coordinates (d,) in which every one of these pairs is just at its wall, m."""
    n = system.dofs
    offset = np.zeros(whole.M.shape[0])
    walls = {j: side * system.contacts[j].gaps[0 if side > 0 else 1] for j, side in touching}
    stops = [j for j, _ in touching if system.contacts[j].is_stop]
    if stops:
        # the static shape of the push: its force has nothing to do in the motions that are left
        push = whole.force[:n, stops]
        shape = np.linalg.lstsq(whole.K[:n, :n], push, rcond=None)[0]
        shape = shape if np.allclose(whole.K[:n, :n] @ shape, push) else push
        # where several stops cannot be met at once, the nearest
        offset[:n] = shape @ np.linalg.lstsq(-push.T @ shape, np.array([walls[j] for j in stops]), rcond=None)[0]
    for j, wall in walls.items():
        if not system.contacts[j].is_stop:
            offset[n + j] = wall + whole.force[:n, j] @ offset[:n]
    return offset


def undamped_modes(K: NDArray[Any], M: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """All omega^2 and mass-normalised vectors; the slow modes to rounding, as they carry the energy."""
    off = np.abs(K - np.diag(np.diag(K))).sum() + np.abs(M - np.diag(np.diag(M))).sum()
    if off == 0.0:
        return np.diag(K) / np.diag(M), np.diag(1.0 / np.sqrt(np.diag(M)))
    alone = (np.abs(K).sum(axis=0) == 0.0) & (np.count_nonzero(M, axis=0) == 1)
    bound = np.ix_(~alone, ~alone)
    try:
        lower = np.linalg.cholesky(K[bound])
    except np.linalg.LinAlgError:
        values, vectors = scipy.linalg.eigh(K, M)
        return np.where(values > RIGID * float(values[-1]), values, 0.0), vectors
    # of the flexibility, whose largest eigenvalue is the slowest mode; solve_triangular would wake BLAS
    # threads, which takes a thousand times as long as these few numbers
    flexible = np.linalg.solve(lower, np.linalg.solve(lower, M[bound]).T)
    values, z = np.linalg.eigh(0.5 * (flexible + flexible.T))
    if values[0] <= 0.0:
        spread = "must not spread over so many decades: the fastest motions are lost in rounding; keep fewer modes"
        require(False, "stiffness", float(np.diag(K)[~alone].max()), "N/m", spread)
    omega_squared, vectors = np.zeros(K.shape[0]), np.zeros_like(K)
    omega_squared[~alone], vectors[bound] = _fast_corrected(
        1.0 / values, np.linalg.solve(lower.T, z) / np.sqrt(values), K[bound], M[bound]
    )
    vectors[np.ix_(alone, alone)] = np.diag(1.0 / np.sqrt(np.diag(M)[alone]))
    return omega_squared, vectors


def _fast_corrected(
    omega_squared: NDArray[Any], vectors: NDArray[Any], K: NDArray[Any], M: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Modes of a flexibility, fast ones first: those have lost the square of their frequency ratio in digits.

    They are made orthogonal to the slower ones, which keep theirs, and take omega^2 from the stiffness.
    """
    vectors = vectors.copy()
    for i in range(omega_squared.size - 1, -1, -1):
        slower = vectors[:, i + 1 :]
        vectors[:, i] -= slower @ (slower.T @ (M @ vectors[:, i]))
        vectors[:, i] /= np.sqrt(vectors[:, i] @ M @ vectors[:, i])
    fast = omega_squared > 1e-4 * omega_squared.max(initial=0.0)
    exact = np.einsum("ij,ij->j", vectors, K @ vectors)
    return np.where(fast, exact, omega_squared), vectors


def _steady(
    drive: Drive, elastic: NDArray[Any], omega_squared: NDArray[Any], damping: NDArray[Any], load: NDArray[Any]
) -> NDArray[Any]:
    """Answer p^ to s = Re(e^{i theta}); zero for a drive that is no sine."""
    if drive.samples is not None or drive.amplitude == 0.0 or omega_squared.size == 0:
        return np.zeros(elastic.shape[0], dtype=complex)
    dynamic = np.diag(omega_squared - drive.omega**2).astype(complex) + 1j * drive.omega * damping
    scale = np.abs(omega_squared) + drive.omega**2
    near = np.abs(np.diag(dynamic)) < 1e-9 * scale
    allowed = "must not be a natural frequency of an undamped mode: the steady answer is unbounded; add damping"
    require(not bool(np.any(near & (np.abs(load) > 0.0))), "frequency", drive.omega / (2 * np.pi), "Hz", allowed)
    return np.asarray(elastic @ np.linalg.solve(dynamic, load.astype(complex)))


def _solve_static(omega_squared: NDArray[Any], damping: NDArray[Any]) -> NDArray[Any]:
    """Inverse of the modal stiffness, zero where there is none."""
    with np.errstate(divide="ignore"):
        return np.diag(np.where(omega_squared > 0.0, 1.0 / omega_squared, 0.0))


def _contact_forces(whole: Equations, drive: Drive, found: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """Contact force of every rider from what the equations of motion leave over."""
    riders = found["riders"]
    names = ("force_shape", "force_harmonic", "force_static", "force_follow", "force_follow_rate")
    if not riders:
        size = found["modes"].exponent.size
        return dict(zip(names, (np.zeros((0, size), dtype=complex), *(np.zeros(0) for _ in range(4))), strict=True))
    directions = whole.force[:, [j for j, _ in riders]]
    inverse = np.linalg.solve(whole.M, directions)
    # F = (P^T M^-1 P)^-1 P^T M^-1 (M p'' + C p' + K p - B s - G)
    project = np.linalg.solve(directions.T @ inverse, inverse.T)
    rate, omega = found["modes"].rate, drive.omega
    shape = whole.M @ found["shape"] @ rate @ rate + whole.C @ found["shape"] @ rate + whole.K @ found["shape"]
    p = found["harmonic"]
    harmonic = -(omega**2) * (whole.M @ p) + 1j * omega * (whole.C @ p) + whole.K @ p - whole.drive
    particle = whole.M @ found["particle_shape"]
    static = whole.K @ found["static"] - whole.given + particle @ found["particle_given"]
    follow = whole.K @ found["follow"] - whole.drive + particle @ found["particle_drive"]
    follow_rate = whole.K @ found["follow_rate"] + whole.C @ found["follow"]
    values = (project @ shape, project @ harmonic, project @ static, project @ follow, project @ follow_rate)
    return dict(zip(names, values, strict=True))
