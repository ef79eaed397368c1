"""The Newmark method as a value, the step that it needs, and the structure made ready for its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.errors import Fault, InputError, check_fields, quantity, require
from femimpact.system import System

__all__ = ["Newmark", "check_sampling", "check_step", "recommended_step", "step_notes"]

STEPS_PER_CONTACT = 20
LEAST_STEPS_PER_CONTACT = 10
STEPS_PER_PERIOD = 400
LEAST_STEPS_PER_CYCLE = 8


@dataclass(frozen=True)
class Newmark:
    """Newmark's method: u1 = u0 + dt v0 + dt^2 [(1/2 - beta) a0 + beta a1], v1 = v0 + dt [(1 - gamma) a0 + gamma a1].

    The defaults are the constant average acceleration. (Newmark, 1959.)

    Parameters
    ----------
    dt : float, s
        Step; `recommended_step(system)` gives one.
    beta, gamma : float, 1
    allow_coarse_step : bool
        Let a step pass that does not resolve the contact; the results then carry a warning.
    divergence_limit : float, 1
        Stop when a displacement exceeds this many times the resonant amplitude of the structure
        without balls (plus the initial displacement).
    """

    dt: float = field(metadata=quantity("s", above=0.0))
    beta: float = field(default=0.25, metadata=quantity("1", at_least=0.0, at_most=0.5))
    gamma: float = field(default=0.5, metadata=quantity("1", at_least=0.5, at_most=1.0))
    allow_coarse_step: bool = False
    divergence_limit: float = field(default=1000.0, metadata=quantity("1", above=1.0))

    def __post_init__(self) -> None:
        check_fields(self)


def shortest_contact(system: System) -> float:
    """Shortest contact time (s) among the pairs; infinite without one."""
    return min((pair.parameters.contact_time for pair in system.contacts), default=math.inf)


def recommended_step(system: System) -> float:
    """Step (s) that resolves the contact and the first mode: the smaller of T_c/20 and 1/(400 f1).

    Parameters
    ----------
    system : System

    Returns
    -------
    float, s
        At T_c/20 a collision's energy error is about 0.1 %; at 1/(400 f1) the period is
        lengthened by pi^2/(3 400^2) = 2e-5.
    """
    by_mode = 1.0 / (STEPS_PER_PERIOD * system.first_frequency)
    return min(shortest_contact(system) / STEPS_PER_CONTACT, by_mode)


def check_step(system: System, method: Newmark) -> tuple[str, ...]:
    """Warnings of a step that was let through; an error for one that does not resolve the contact.

    Raises
    ------
    InputError
        If dt > T_c/10 and the method does not allow it, or the scheme is unstable at dt.
    """
    stable = 2.0 * method.beta >= method.gamma
    if not stable:
        omega = _highest_omega(system)
        limit = 1.0 / (omega * math.sqrt(0.5 * method.gamma - method.beta))
        if method.dt > limit:
            allowed = f"must be <= {limit:.3g} s: with 2 beta < gamma the method is only conditionally stable"
            raise InputError([Fault("method.dt", method.dt, "s", allowed)])
    contact_time = shortest_contact(system)
    longest = contact_time / LEAST_STEPS_PER_CONTACT
    if method.dt <= longest * (1.0 + 1e-9):
        return ()
    numbers = f"dt = {method.dt:.3g} s against a contact time of {contact_time:.3g} s"
    if method.allow_coarse_step:
        return (
            f"coarse step: {numbers}; a contact wants {LEAST_STEPS_PER_CONTACT} steps or more, "
            "so impacts, restitution and energy of this run are not to be trusted",
        )
    allowed = (
        f"must be <= {longest:.3g} s ({numbers}, {LEAST_STEPS_PER_CONTACT} steps or more in a contact): use "
        f"dt = recommended_step(system) = {recommended_step(system):.3g} s, a longer contact_time, or "
        "allow_coarse_step = true to see what happens"
    )
    raise InputError([Fault("method.dt", method.dt, "s", allowed)])


def check_sampling(frequencies: NDArray[Any], method: Newmark, key: str) -> None:
    """Refuse base frequencies (Hz) of which the step sees fewer than 8 points a cycle."""
    least = LEAST_STEPS_PER_CYCLE
    highest, most = float(frequencies.max()), 1.0 / (least * method.dt)
    allowed = f"must be <= {most:.4g} Hz with dt = {method.dt:g} s ({least} steps in a base cycle or more)"
    require(highest <= most, key, highest, "Hz", allowed)


def step_notes(system: System, method: Newmark) -> tuple[str, ...]:
    """Notes on modes that the step does not follow: never an error, the scheme is stable for them."""
    omega = np.sort(np.sqrt(system.K.diagonal() / system.M.diagonal())) if system.is_diagonal else None
    fastest = 1.0 / (10.0 * method.dt)
    if omega is None:
        return ()
    missed = int(np.count_nonzero(omega / (2.0 * math.pi) > fastest))
    if missed == 0:
        return ()
    return (f"{missed} of {omega.size} kept modes are faster than 1/(10 dt) = {fastest:.4g} Hz: not resolved in time",)


def _highest_omega(system: System) -> float:
    if system.is_diagonal:
        return float(np.sqrt(np.max(system.K.diagonal() / system.M.diagonal())))
    values = scipy.linalg.eigh(
        system.K.toarray(), system.M.toarray(), eigvals_only=True, subset_by_index=[system.dofs - 1] * 2
    )
    return float(np.sqrt(values[0]))


def bands(matrix: Any) -> NDArray[Any]:
    """Lower bands (k + 1, n) of a symmetric sparse matrix: bands[k, i] = A[i + k, i]."""
    entries = sparse.coo_array(matrix)
    row, column = entries.coords
    width = int(np.max(row - column, initial=0))
    result = np.zeros((width + 1, matrix.shape[0]))
    lower = row >= column
    np.add.at(result, (row[lower] - column[lower], column[lower]), entries.data[lower])
    return result


def factorise(system: System, method: Newmark) -> tuple[NDArray[Any], NDArray[Any]]:
    """Bands of L with S = M + gamma dt C + beta dt^2 K = L L^T (its diagonal inverted), and of S itself."""
    effective = system.M + method.gamma * method.dt * system.C + method.beta * method.dt**2 * system.K
    band = bands(effective)
    lower = scipy.linalg.cholesky_banded(band, lower=True)
    lower[0] = 1.0 / lower[0]
    return lower, band
