"""What the loop requires of a method with steps, and the constants of the two kinds of step."""

from __future__ import annotations

from typing import Protocol

from femimpact.errors import checked, quantity
from femimpact.integrators.stepping.layout import Scheme

__all__ = ["SteppingMethod", "family_scheme", "mean_scheme", "newmark_weights", "scheme_of"]


class SteppingMethod(Protocol):
    """A method with steps, as its run takes it.

    Whoever satisfies it can take the answers of `stepping.answers.SteppingAnswers`, and is then a whole method.
    """

    @property
    def dt(self) -> float:
        """Step, s."""

    @property
    def refine(self) -> int:
        """Fine steps into which a step with contact is divided; 1 for none."""

    @property
    def allow_coarse_step(self) -> bool:
        """Whether a step passes that does not resolve the contact."""

    @property
    def divergence_limit(self) -> float:
        """Multiple of the resonant amplitude at which a run is stopped, 1."""

    @property
    def stability_limit(self) -> float:
        """Largest product of step and angular frequency (1) at which the method is stable; infinite where any is."""

    def scheme(self, step: float) -> Scheme:
        """Constants of the method for a step in s."""


def scheme_of(method: SteppingMethod, dt: float | None = None) -> Scheme:
    """Constants of a method for its own step (s), or for a finer one."""
    return method.scheme(method.dt if dt is None else checked("dt", dt, quantity("s", above=0.0)))


def family_scheme(
    h: float, alpha_m: float, alpha_f: float, beta: float | None = None, gamma: float | None = None
) -> Scheme:
    """Constants of the Newmark family, one balance of forces at alpha_m and alpha_f within the step h (s).

    Without beta and gamma they are those of order 2 that damp high modes most.
    """
    gamma = 0.5 - alpha_m + alpha_f if gamma is None else gamma
    beta = 0.25 * (1.0 - alpha_m + alpha_f) ** 2 if beta is None else beta
    weights = newmark_weights(h, beta, gamma)
    give = (1.0 - alpha_f) / (1.0 - alpha_m)
    return Scheme(
        h, *weights, alpha_f, alpha_m,
        carry=alpha_f / (1.0 - alpha_f), give_a=give, give_u=give * weights[2], give_v=give * weights[3],
        spring_now=1.0, mean=False, rigid=False,
    )  # fmt: skip


def newmark_weights(h: float, beta: float, gamma: float) -> tuple[float, float, float, float]:
    """Weights of a0 in displacement and velocity, and of a1 in both, for the step h (s)."""
    return h * h * (0.5 - beta), h * (1.0 - gamma), h * h * beta, h * gamma


def mean_scheme(h: float, weights: tuple[float, float, float, float], theta: float, rigid: bool) -> Scheme:
    """Constants where one mean contact force per step is kept out of the acceleration."""
    return Scheme(
        h, *weights, 0.0, 0.0,
        carry=0.0, give_a=0.0, give_u=h * h * theta, give_v=h, spring_now=theta, mean=True, rigid=rigid,
    )  # fmt: skip
