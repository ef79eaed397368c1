"""Steps: which one a system needs, and whether a method's step resolves contact, drive and modes."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from femimpact.contact.formulas import RIGID
from femimpact.errors import Fault, InputError, checked, quantity, require, require_type
from femimpact.integrators.stepping.scheme import SteppingMethod, scheme_of
from femimpact.system.modes import first_elastic_frequency
from femimpact.system.system import System

__all__ = ["check_sampling", "check_step", "recommended_step", "shortest_contact", "step_notes"]

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
    system : System
    refine : int
        Fine steps into which the method divides a step with contact.

    Returns
    -------
    float, s
        At T_c/20 a collision's energy error is about 0.1 %; at 1/(400 f1) the period is
        lengthened by pi^2/(3 400^2) = 2e-5.

    Raises
    ------
    InputError
        If the system has neither a contact nor an elastic mode, or refine is out of range.
    """
    require_type(system, System, "system")
    refine = checked("refine", refine, quantity("1", at_least=1, at_most=1000, integer=True))
    first = first_elastic_frequency(system)
    by_mode = 1.0 / (STEPS_PER_PERIOD * first) if first > 0.0 else math.inf
    step = min(refine * shortest_contact(system) / STEPS_PER_CONTACT, by_mode)
    allowed = "must have a compliant contact or an elastic mode to recommend a step: give dt"
    require(math.isfinite(step), "system", f"{system.dofs} dofs", "", allowed)
    return step


def check_step(system: System, method: SteppingMethod) -> tuple[str, ...]:
    """Warnings of a step that was let through; an error for one that does not resolve the contact.

    Raises
    ------
    InputError
        If the step in contact exceeds T_c/10 and the method does not allow it, the scheme is
        unstable at dt, or the method is not made for a contact's law.
    """
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
    for pair in system.contacts:
        rigid = pair.parameters.kind == RIGID
        if impulses:
            allowed = f"must be Rigid(restitution) for {name}; compliant laws are for Newmark and its family"
            require(rigid, f"{pair.name}.contact", pair.law.name, "", allowed)
        else:
            allowed = f"must be a compliant law for {name}: Rigid is for MoreauJean(dt) or EventDriven()"
            require(not rigid, f"{pair.name}.contact", pair.law.name, "", allowed)


def check_sampling(frequencies: NDArray[np.float64], method: SteppingMethod, key: str) -> None:
    """Refuse frequencies of the drive (Hz) that have fewer than 8 steps in a cycle."""
    least = LEAST_STEPS_PER_CYCLE
    highest, most = float(frequencies.max()), 1.0 / (least * method.dt)
    allowed = f"must be <= {most:.4g} Hz with dt = {method.dt:g} s ({least} steps in a base cycle or more)"
    require(highest <= most, key, highest, "Hz", allowed)


def step_notes(system: System, method: SteppingMethod) -> tuple[str, ...]:
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
