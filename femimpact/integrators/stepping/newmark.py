"""The Newmark family and its relative with impulses, as values, with the constants of their step.

All of them are u1 = u0 + dt v0 + dt^2 [(1/2 - beta) a0 + beta a1], v1 = v0 + dt [(1 - gamma) a0 + gamma a1]
with one balance of forces per step; they differ in where within the step it is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from femimpact import core
from femimpact.contact.custom_law import force_pointer, law_error
from femimpact.contact.laws import RIGID
from femimpact.errors import check_fields, choice, quantity, require, truth
from femimpact.excitation.excitation import Excitation
from femimpact.integrators.cases import AchievedRestitution
from femimpact.integrators.stepping.operators import (
    SteppingMethod,
    check_sampling,
    check_step,
    family_scheme,
    mean_scheme,
    newmark_weights,
    recommended_step,
    scheme_of,
    step_notes,
)
from femimpact.integrators.stepping.run import check_recorder, run_steps, stepped_cases
from femimpact.response.response import Recorder
from femimpact.system.contact_pair import ContactPair
from femimpact.system.system import System


def stepped_restitution(
    method: SteppingMethod, pair: ContactPair, approach_speed: float, phases: int = 32
) -> AchievedRestitution | None:
    """Restitution of the pair's effective mass sent against a wall; None where the method does not take the law."""
    if (pair.parameters.kind == RIGID) != scheme_of(method).rigid:
        return None
    scheme = scheme_of(method, method.dt / method.refine)
    law, force = pair.parameters, pair.law.force_function(pair.effective_mass)
    pointer = None if force is None else force_pointer(force)
    address = 0 if pointer is None else pointer.address
    numbers = core.steps.Law(
        law.kind,
        0.0,
        np.inf,
        law.stiffness,
        law.damping,
        law.exponent,
        law.restitution,
        0.0,
        0.0,
        approach_speed,
        address,
    )
    starts = (np.arange(phases) + 0.5) / phases
    runs = [core.collide(numbers, pair.effective_mass, approach_speed, start, scheme) for start in starts]
    for *_, refused in runs:
        if pointer is not None and refused[0] != 0.0:
            raise law_error(pair.name, pointer, *refused)
    if any(np.isnan(ratio) for ratio, *_ in runs):
        allowed = f"must let a collision of {pair.name} end: this one has not within 10,000,000 steps, or has diverged"
        require(False, "method.dt", method.dt, "s", allowed)
    rebound, peak = (np.array(column) for column in list(zip(*runs, strict=True))[:2])
    return AchievedRestitution(
        law.restitution, float(rebound.mean()), float(rebound.min()), float(rebound.max()), float(peak.max())
    )


class SteppingMembers:
    """Members of `methods.Method` that methods with steps share, for one that satisfies `operators.SteppingMethod`."""

    @classmethod
    def for_system(cls, system: System, **settings: Any) -> Self:
        """The method with these settings, and with the recommended step unless they hold a dt."""
        step = {} if "dt" in settings else {"dt": recommended_step(system, settings.get("refine", 1))}
        return cls(**step, **settings)

    @property
    def stability_limit(self) -> float:
        """Largest dt omega (1) that is stable: any."""
        return math.inf

    # functions of the method, which comes first
    check = check_step
    check_drive = check_sampling
    notes = step_notes
    run = run_steps
    run_cases = stepped_cases
    achieved_restitution = stepped_restitution

    def time_grid(
        self: SteppingMethod, system: System, excitation: Excitation, duration: float, recorder: Recorder
    ) -> float:
        """The step, s; refused is a recorder with an interval."""
        check_recorder(recorder)
        return self.dt


@dataclass(frozen=True)
class Newmark(SteppingMembers):
    """Newmark's method: M a1 + C v1 + K u1 = F1 + b f1.

    The defaults are the constant average acceleration. (Newmark, 1959.)

    Parameters
    ----------
    dt : float, s
        Step; `recommended_step(system)` gives one.
    beta, gamma : float, 1
        Weights of the accelerations in the displacement and in the velocity.
    allow_coarse_step : bool
        Let a step pass that does not resolve the contact; the results then carry a warning.
    divergence_limit : float, 1
        Stop when a displacement exceeds this many times the resonant amplitude of the structure
        without balls (plus the initial displacement).
    contact : {"end", "energy-consistent"}
        Where the law acts: on the state at the step's end, or as the mean over the displacement of the step,
        f = [V(p1) - V(p0)]/(p1 - p0) for a law with the potential V, its dissipative part at the
        step's mean rate. Then no contact force makes or loses energy that its law does not, at any
        step. It needs beta = 1/4, gamma = 1/2. (Discrete gradient: Gonzalez, 1996; of a penalty
        potential: Armero and Petocz, 1998.)
    refine : int
        Fine steps into which a step is divided in which a contact takes place, or could: dt is then
        the step without contact.

    Raises
    ------
    InputError
        If an energy-consistent contact has another beta or gamma.
    """

    dt: float = field(metadata=quantity("s", above=0.0))
    beta: float = field(default=0.25, metadata=quantity("1", at_least=0.0, at_most=0.5))
    gamma: float = field(default=0.5, metadata=quantity("1", at_least=0.5, at_most=1.0))
    allow_coarse_step: bool = field(default=False, metadata=truth())
    divergence_limit: float = field(default=1000.0, metadata=quantity("1", above=1.0))
    contact: str = field(default="end", metadata=choice("end", "energy-consistent"))
    refine: int = field(default=1, metadata=quantity("1", at_least=1, at_most=1000, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)
        if self.contact == "energy-consistent":
            for name, value in (("beta", 0.25), ("gamma", 0.5)):
                parameter = getattr(self, name)
                require(parameter == value, name, parameter, "", f"must be {value:g} for an energy-consistent contact")

    @property
    def stability_limit(self) -> float:
        """Largest dt omega (1) that is stable: infinite where 2 beta >= gamma."""
        return 1.0 / math.sqrt(0.5 * self.gamma - self.beta) if 2.0 * self.beta < self.gamma else math.inf

    def scheme(self, step: float) -> core.steps.Scheme:
        """Constants for a step in s."""
        if self.contact == "energy-consistent":
            return mean_scheme(step, newmark_weights(step, self.beta, self.gamma), 0.5, rigid=False)
        return family_scheme(step, 0.0, 0.0, self.beta, self.gamma)


@dataclass(frozen=True)
class HHT(SteppingMembers):
    """Hilber, Hughes and Taylor: M a1 + (1 + alpha)(C v1 + K u1 - F1) = alpha (C v0 + K u0 - F0), contacts included.

    gamma = 1/2 - alpha, beta = (1 - alpha)^2/4: order 2, with high modes damped. (Hilber et al., 1977.)

    Parameters
    ----------
    dt : float, s
        Step; `recommended_step(system)` gives one.
    alpha : float, 1
        0 is the average acceleration; -1/3 damps most.
    allow_coarse_step, divergence_limit, refine
        As of `Newmark`.

    Examples
    --------
    >>> import femimpact as fi
    >>> run = fi.integrate(system, fi.Sine(amplitude=0.2e-3, frequency=5.0), fi.HHT(dt=1e-4, alpha=-0.1), duration=1.0)
    >>> bool(run.channels["tip"].any())
    True
    """

    dt: float = field(metadata=quantity("s", above=0.0))
    alpha: float = field(default=-0.1, metadata=quantity("1", at_least=-1.0 / 3.0, at_most=0.0))
    allow_coarse_step: bool = field(default=False, metadata=truth())
    divergence_limit: float = field(default=1000.0, metadata=quantity("1", above=1.0))
    refine: int = field(default=1, metadata=quantity("1", at_least=1, at_most=1000, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def scheme(self, step: float) -> core.steps.Scheme:
        """Constants for a step in s."""
        return family_scheme(step, alpha_m=0.0, alpha_f=-self.alpha)


@dataclass(frozen=True)
class WBZ(SteppingMembers):
    """Wood, Bossak and Zienkiewicz: M [(1 - alpha) a1 + alpha a0] + C v1 + K u1 = F1 + b f1.

    gamma = 1/2 - alpha, beta = (1 - alpha)^2/4: order 2, with high modes damped. (Wood et al., 1980.)

    Parameters
    ----------
    dt : float, s
        Step; `recommended_step(system)` gives one.
    alpha : float, 1
        0 is the average acceleration; -1 damps most.
    allow_coarse_step, divergence_limit, refine
        As of `Newmark`.
    """

    dt: float = field(metadata=quantity("s", above=0.0))
    alpha: float = field(default=-0.1, metadata=quantity("1", at_least=-1.0, at_most=0.0))
    allow_coarse_step: bool = field(default=False, metadata=truth())
    divergence_limit: float = field(default=1000.0, metadata=quantity("1", above=1.0))
    refine: int = field(default=1, metadata=quantity("1", at_least=1, at_most=1000, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def scheme(self, step: float) -> core.steps.Scheme:
        """Constants for a step in s."""
        return family_scheme(step, alpha_m=self.alpha, alpha_f=0.0)


@dataclass(frozen=True)
class GeneralizedAlpha(SteppingMembers):
    """Generalised alpha: M a_m + C v_f + K u_f = F_f + b f_f, each taken within the step.

    alpha_m = (2 r - 1)/(r + 1), alpha_f = r/(r + 1), gamma = 1/2 - alpha_m + alpha_f,
    beta = (1 - alpha_m + alpha_f)^2/4. (Chung and Hulbert, 1993.)

    Parameters
    ----------
    dt : float, s
        Step; `recommended_step(system)` gives one.
    spectral_radius : float, 1
        r at infinite frequency: 1 damps nothing, 0 annihilates the highest modes in one step.
    allow_coarse_step, divergence_limit, refine
        As of `Newmark`.
    """

    dt: float = field(metadata=quantity("s", above=0.0))
    spectral_radius: float = field(default=0.8, metadata=quantity("1", at_least=0.0, at_most=1.0))
    allow_coarse_step: bool = field(default=False, metadata=truth())
    divergence_limit: float = field(default=1000.0, metadata=quantity("1", above=1.0))
    refine: int = field(default=1, metadata=quantity("1", at_least=1, at_most=1000, integer=True))

    def __post_init__(self) -> None:
        check_fields(self)

    def scheme(self, step: float) -> core.steps.Scheme:
        """Constants for a step in s."""
        r = self.spectral_radius
        alpha_m, alpha_f = (2.0 * r - 1.0) / (r + 1.0), r / (r + 1.0)
        return family_scheme(step, alpha_m, alpha_f)


@dataclass(frozen=True)
class MoreauJean(SteppingMembers):
    """Time stepping with impulses for rigid contacts: velocities jump, no impact is a separate event.

    M (v1 - v0) = dt (F - C v - K u)_theta + b P, u1 = u0 + dt v_theta, with ._theta = theta .1 + (1 - theta) .0;
    where the gap is closed half a step on, 0 <= P and v1 >= -e v0 in the direction of separation, one of
    them with equality. (Moreau, 1988; Jean, 1999.)

    Parameters
    ----------
    dt : float, s
        Resolves the motion between impacts; a rigid contact has no duration. Instants of impact are met to
        a step.
    theta : float, 1
        1/2 loses no energy beside the impacts; 1 is the implicit Euler rule.
    allow_coarse_step, divergence_limit
        As of `Newmark`.

    Examples
    --------
    >>> import femimpact as fi
    >>> run = fi.integrate(rigid, fi.Sine(amplitude=0.2e-3, frequency=5.0), fi.MoreauJean(dt=1e-4), duration=1.0)
    >>> bool(run.channels["tip"].any())
    True
    """

    dt: float = field(metadata=quantity("s", above=0.0))
    theta: float = field(default=0.5, metadata=quantity("1", at_least=0.5, at_most=1.0))
    allow_coarse_step: bool = field(default=False, metadata=truth())
    divergence_limit: float = field(default=1000.0, metadata=quantity("1", above=1.0))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def refine(self) -> int:
        """A rigid contact has nothing to resolve: 1."""
        return 1

    def scheme(self, step: float) -> core.steps.Scheme:
        """Constants for a step in s."""
        h, th = step, self.theta
        weights = h * h * th * (1.0 - th), h * (1.0 - th), h * h * th * th, h * th
        return mean_scheme(h, weights, th, rigid=True)
