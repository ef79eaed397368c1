"""The structure made ready for steps: the size of a step, its constants, and the operators, factorised once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.contact.laws import RIGID
from femimpact.errors import Fault, InputError, checked, quantity, require, require_type
from femimpact.system.matrices import Matrix
from femimpact.system.modes import first_elastic_frequency
from femimpact.system.system import System
from femimpact.units import rounded


class SteppingMethod(Protocol):
    """A method with steps, as its run takes it.

    A class that satisfies it becomes a complete method with the members of `stepping.newmark.SteppingMembers`.
    """

    @property
    def dt(self) -> float:
        """Step, s."""

    @property
    def refine(self) -> int:
        """Fine steps into which a step with contact is divided; 1 for none."""

    @property
    def allow_coarse_step(self) -> bool:
        """True where a step that does not resolve the contact is taken."""

    @property
    def divergence_limit(self) -> float:
        """Multiple of the resonant amplitude at which a run is stopped, 1."""

    @property
    def stability_limit(self) -> float:
        """Largest product of step and angular frequency (1) at which the method is stable; infinite where any is."""

    def scheme(self, step: float) -> core.steps.Scheme:
        """Constants of the method for a step in s."""


def scheme_of(method: SteppingMethod, dt: float | None = None) -> core.steps.Scheme:
    """Constants of a method for its step (s), or for a finer one."""
    return method.scheme(method.dt if dt is None else checked("dt", dt, quantity("s", above=0.0)))


def family_scheme(
    h: float, alpha_m: float, alpha_f: float, beta: float | None = None, gamma: float | None = None
) -> core.steps.Scheme:
    """Constants of the Newmark family, one balance of forces at alpha_m and alpha_f within the step h (s).

    Without beta and gamma they are those of order 2 that damp high modes most.
    """
    gamma = 0.5 - alpha_m + alpha_f if gamma is None else gamma
    beta = 0.25 * (1.0 - alpha_m + alpha_f) ** 2 if beta is None else beta
    weights = newmark_weights(h, beta, gamma)
    acceleration = (1.0 - alpha_f) / (1.0 - alpha_m)
    return core.steps.Scheme(
        h, *weights, alpha_f, alpha_m,
        carry=alpha_f / (1.0 - alpha_f), mass_response_a=acceleration, mass_response_u=acceleration * weights[2],
        mass_response_v=acceleration * weights[3], spring_now=1.0, mean=False, rigid=False,
    )  # fmt: skip


def newmark_weights(h: float, beta: float, gamma: float) -> tuple[float, float, float, float]:
    """Weights of a0 in displacement and velocity, and of a1 in both, for the step h (s)."""
    return h * h * (0.5 - beta), h * (1.0 - gamma), h * h * beta, h * gamma


def mean_scheme(h: float, weights: tuple[float, float, float, float], theta: float, rigid: bool) -> core.steps.Scheme:
    """Constants where one mean contact force per step is kept out of the acceleration."""
    return core.steps.Scheme(
        h, *weights, 0.0, 0.0,
        carry=0.0, mass_response_a=0.0, mass_response_u=h * h * theta, mass_response_v=h, spring_now=theta, mean=True,
        rigid=rigid,
    )  # fmt: skip


STEPS_PER_CONTACT = 20
LEAST_STEPS_PER_CONTACT = 10
STEPS_PER_PERIOD = 400
LEAST_STEPS_PER_CYCLE = 8


def shortest_contact(system: System) -> float:
    """Shortest contact time (s) among the pairs; infinite without one, and for rigid ones, which have none."""
    times = (pair.parameters.contact_time for pair in system.contacts if pair.parameters.kind != RIGID)
    return min(times, default=math.inf)


def recommended_step(system: System, refine: int = 1) -> float:
    """Step (s) that resolves the contact and the first mode: the smaller of refine T_c/20 and 1/(400 f1).

    Parameters
    ----------
    refine : int
        Fine steps into which the method divides a step with contact.

    Returns
    -------
    float, s
        At T_c/20 a collision's energy error is about 0.1 %; at 1/(400 f1) the period is
        lengthened by pi^2/(3 400^2) = 2e-5 (Hughes, 1987).

    Raises
    ------
    InputError
        If the system has neither a contact nor an elastic mode.
    """
    require_type(system, System, "system")
    refine = checked("refine", refine, quantity("1", at_least=1, at_most=1000, integer=True))
    first = first_elastic_frequency(system)
    by_mode = 1.0 / (STEPS_PER_PERIOD * first) if first > 0.0 else math.inf
    step = min(refine * shortest_contact(system) / STEPS_PER_CONTACT, by_mode)
    allowed = "must have a compliant contact or an elastic mode to recommend a step: give dt"
    require(math.isfinite(step), "system", f"{system.dofs} dofs", "", allowed)
    return step


def check_step(method: SteppingMethod, system: System) -> tuple[str, ...]:
    """Warnings of a step that was let through; an error for one that does not resolve the contact."""
    _check_laws(system, method)
    if math.isfinite(method.stability_limit):
        limit = method.stability_limit / _highest_omega(system)
        if method.dt > limit:
            allowed = f"must be <= {limit:.3g} s: with 2 beta < gamma the method is only conditionally stable"
            raise InputError([Fault("method.dt", method.dt, "s", allowed)])
    contact_time = shortest_contact(system)
    step, longest = method.dt / method.refine, contact_time / LEAST_STEPS_PER_CONTACT
    if step <= longest * (1.0 + 1e-9):
        return ()
    name = "dt" if method.refine == 1 else f"dt/{method.refine}"
    numbers = f"{name} = {step:.3g} s against a contact time of {contact_time:.3g} s"
    if method.allow_coarse_step:
        return (
            f"coarse step: {numbers}; a contact needs {LEAST_STEPS_PER_CONTACT} steps or more, "
            "so impacts, restitution and energy of this run are not to be trusted",
        )
    allowed = (
        f"must be <= {longest * method.refine:.3g} s ({numbers}, {LEAST_STEPS_PER_CONTACT} steps or more in a "
        f"contact): use dt = recommended_step(system) = {recommended_step(system):.3g} s, a longer contact_time, or "
        "allow_coarse_step = true to see what happens"
    )
    raise InputError([Fault("method.dt", method.dt, "s", allowed)])


def _check_laws(system: System, method: SteppingMethod) -> None:
    """Refuse a rigid contact without impulses, and a compliant one with them."""
    name, impulses = type(method).__name__, scheme_of(method).rigid
    meetings = ", ".join(pair.name for pair in system.contacts if pair.between)
    allowed = f"must not be there for {name}: balls that meet, with Rigid or KelvinVoigt walls, are for EventDriven()"
    require(not meetings, "meeting", meetings, "", allowed)
    for pair in system.contacts:
        if not pair.has_walls:
            continue
        rigid = pair.parameters.kind == RIGID
        if impulses:
            allowed = f"must be Rigid(restitution) for {name}; compliant laws are for Newmark and its family"
            require(rigid, f"{pair.name}.contact", pair.law.name, "", allowed)
            allowed = f"must have one restitution at all speeds for {name}: one over the speed is for EventDriven()"
            require(not pair.parameters.over_speed, f"{pair.name}.contact", pair.law, "", allowed)
        else:
            allowed = f"must be a compliant law for {name}: Rigid is for MoreauJean(dt) or EventDriven()"
            require(not rigid, f"{pair.name}.contact", pair.law.name, "", allowed)


def check_sampling(method: SteppingMethod, frequencies: NDArray[np.float64], key: str) -> None:
    """Refuse frequencies of the drive (Hz) that have fewer than 8 steps in a cycle."""
    least = LEAST_STEPS_PER_CYCLE
    highest, most = float(frequencies.max()), 1.0 / (least * method.dt)
    allowed = (
        f"must be <= {most:.4g} Hz with dt = {method.dt:g} s ({least} steps in a base cycle or more): take dt <= "
        f"{rounded(1.0 / (least * highest), math.floor):g} s, or the event-driven method"
    )
    require(highest <= most, key, highest, "Hz", allowed)


UNRESOLVED = "not resolved in time"
"""End of a note on modes that a step does not follow."""


def step_notes(method: SteppingMethod, system: System) -> tuple[str, ...]:
    """Notes on modes that the step does not follow: never an error, the scheme is stable for them."""
    if not system.is_diagonal:
        return ()
    omega, fastest = np.sqrt(system.K.diagonal() / system.M.diagonal()), 1.0 / (10.0 * method.dt)
    missed = int(np.count_nonzero(omega / (2.0 * math.pi) > fastest))
    words = f"{missed} of {omega.size} kept modes are faster than 1/(10 dt) = {fastest:.4g} Hz: {UNRESOLVED}"
    return (words,) if missed else ()


def _highest_omega(system: System) -> float:
    if system.is_diagonal:
        return float(np.sqrt(np.max(system.K.diagonal() / system.M.diagonal())))
    values = scipy.linalg.eigh(
        system.K.toarray(), system.M.toarray(), eigvals_only=True, subset_by_index=[system.dofs - 1] * 2
    )
    return float(np.sqrt(values[0]))


def bands(matrix: Matrix, least: int = 1) -> Array:
    """Lower bands (k + 1, n) of a symmetric sparse matrix, so many at least: bands[k, i] = A[i + k, i]."""
    entries = sparse.coo_array(matrix)
    row, column = entries.coords
    table = np.zeros((max(int(np.max(row - column, initial=0)) + 1, least), matrix.shape[0]))
    lower = row >= column
    np.add.at(table, (row[lower] - column[lower], column[lower]), entries.data[lower])
    return table


def operator_of(
    system: System,
    s: core.steps.Scheme,
    observed: Array,  # (dofs,) row read every step
    load: Array,  # (dofs,) of the drive
    more: Sequence[Array] = (),  # of drives along further loads
) -> core.steps.Operator:
    """Operator of a system for a scheme.

    S = (1 - alpha_m) M + (1 - alpha_f)(correct_v C + correct_u K), S a1 = load s - K u0
    - [C + (1 - alpha_f) dt K] v0 - [alpha_m M + (1 - alpha_f)(predict_v C + predict_u K)] a0.
    """
    M, C, K, felt = system.M, system.C, system.K, 1.0 - s.alpha_f
    effective = bands((1.0 - s.alpha_m) * M + felt * (s.correct_v * C + s.correct_u * K))
    factor = scipy.linalg.cholesky_banded(effective, lower=True)
    diagonal = system.is_diagonal
    m, c, k = (matrix.diagonal() for matrix in (M, C, K))
    scale = effective[0] if diagonal else np.ones(system.dofs)
    table = _rows(system, observed)
    a, u, v = _responses(system, s, (factor, True))
    # nothing where there is no constant load
    constant = np.array(system.constant_load) if np.any(system.constant_load) else np.zeros(0)
    by_constant = np.asarray(scipy.linalg.cho_solve_banded((factor, True), constant)) if constant.size else constant
    read = table @ by_constant if constant.size else constant
    more_load = np.array(more, dtype=float).reshape(-1, system.dofs)
    lower = factor.copy()
    lower[0] = 1.0 / lower[0]
    return core.steps.Operator(
        banded=not diagonal,
        modes=core.steps.ModalStep(
            load=load / scale,
            inertia=(s.alpha_m * m + felt * (s.predict_v * c + s.predict_u * k)) / scale,
            damping=(c + felt * s.dt * k) / scale,
            stiffness=k / scale,
            loss=0.25 * s.dt * c,
        ),
        mass_band=bands(M),
        damping_band=bands(C, lower.shape[0]),
        stiffness_band=bands(K, lower.shape[0]),
        cholesky_band=lower,
        narrow=_banded_step(system, s, factor),
        drive_load=np.array(load),
        more_load=more_load,
        more_a=np.ascontiguousarray(
            [scipy.linalg.cho_solve_banded((factor, True), each) for each in more_load]
        ).reshape(more_load.shape),
        constant_load=constant,
        constant_a=by_constant,
        constant_u=s.correct_u * by_constant,
        constant_v=s.correct_v * by_constant,
        constant_w=np.ascontiguousarray([s.correct_u * read, s.correct_v * read]),
        rows=table,
        response_a=a,
        response_u=u,
        response_v=v,
        compliance_u=np.ascontiguousarray(table @ u.T),
        compliance_v=np.ascontiguousarray(table @ v.T),
    )


def _banded_step(system: System, s: core.steps.Scheme, factor: Array) -> core.steps.BandedStep:
    """Up to four bands dof by dof, as the banded step reads them once from the first to the last."""
    most, n = factor.shape
    if most > 4 or system.is_diagonal:
        return core.steps.BandedStep(np.zeros(0), np.zeros(0))
    narrow, unit = np.zeros((n + 6, 12)), np.zeros((n + 6, 4))
    for first, matrix in ((0, system.C), (4, system.K), (8, s.alpha_m * system.M)):
        band = bands(matrix)
        narrow[3:-3, first : first + band.shape[0]] = -band.T
    unit[3:-3, 0] = 1.0 / factor[0] ** 2
    for k in range(1, most):
        unit[3 + k : -3, k] = -(factor[k] / factor[0])[: n - k]
    return core.steps.BandedStep(narrow.ravel(), unit.ravel())


def _rows(system: System, observed: Array) -> Array:
    """The observed place and every contact direction, each once."""
    rows: list[Array] = [observed]
    for pair in system.contacts:
        if not any(np.array_equal(pair.direction, row) for row in rows):
            rows.append(pair.direction)
    return np.ascontiguousarray(rows)


def _responses(system: System, s: core.steps.Scheme, factor: tuple[Array, bool]) -> tuple[Array, Array, Array]:
    """Accelerations, displacements and velocities that a force of 1 N along each b adds in one step.

    Within the balance: a = (1 - alpha_f) S^-1 b. As one mean force beside it, v gains dt M^-1 b and
    u gains mass_response_u M^-1 b, which changes the accelerations by -S^-1 (C dt + K mass_response_u) M^-1 b.
    """
    b = np.array([pair.direction for pair in system.contacts]).reshape(-1, system.dofs).T
    impulse_u = impulse_v = np.zeros_like(b)
    if s.mean:
        free = scipy.linalg.solveh_banded(bands(system.M), b, lower=True) if b.size else b
        impulse_u, impulse_v = s.mass_response_u * free, s.mass_response_v * free
        b = -(system.C @ impulse_v + system.K @ impulse_u)
    a = (1.0 - s.alpha_f) * scipy.linalg.cho_solve_banded(factor, b) if b.size else b
    return (
        np.ascontiguousarray(a.T),
        np.ascontiguousarray((impulse_u + s.correct_u * a).T),
        np.ascontiguousarray((impulse_v + s.correct_v * a).T),
    )
