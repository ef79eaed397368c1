"""Time integration without contact: the known period elongation and numerical damping of each method."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femimpact.excitation import Sine
from femimpact.integrators import methods
from femimpact.integrators.integrate import integrate
from femimpact.integrators.stepping.newmark import HHT, WBZ, GeneralizedAlpha, MoreauJean, Newmark
from femimpact.response.response import Response
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case

__all__ = ["CASES", "METHODS", "Method"]

Array = NDArray[np.float64]

STEPS = 20
"""Steps in a period."""


@dataclass(frozen=True)
class Method:
    """A method of time integration and its amplification, known from its formula.

    Parameters
    ----------
    name, source : str
    make : callable
        The method with a step (s).
    amplification : callable
        Of omega dt: the matrix (k, k) that one step applies to an undamped oscillator's state.
    """

    name: str
    source: str
    make: Callable[[float], methods.Method]
    amplification: Callable[[float], Array]


def alpha_amplification(angle: float, beta: float, gamma: float, mass: float, force: float) -> Array:
    """One step on (u, dt v, dt^2 a) of u'' = -omega^2 u, angle = omega dt.

    Inertia is taken `mass` of a step, the spring `force` of a step before the end.
    """
    w = angle**2
    ahead = np.array([[1.0, 0.0, -beta], [0.0, 1.0, -gamma], [(1 - force) * w, 0.0, 1 - mass]])
    behind = np.array([[1.0, 1.0, 0.5 - beta], [0.0, 1.0, 1 - gamma], [-force * w, 0.0, -mass]])
    return np.linalg.solve(ahead, behind)


def second_order(angle: float, mass: float, force: float) -> Array:
    """The same with gamma = 1/2 - mass + force and beta = (1 - mass + force)^2/4."""
    return alpha_amplification(angle, (1 - mass + force) ** 2 / 4, 0.5 - mass + force, mass, force)


def theta_amplification(angle: float, theta: float) -> Array:
    """One step of the theta rule on (u, dt v)."""
    w = angle**2
    ahead = np.array([[1.0, -theta], [theta * w, 1.0]])
    behind = np.array([[1.0, 1 - theta], [-(1 - theta) * w, 1.0]])
    return np.linalg.solve(ahead, behind)


METHODS = (
    Method(
        "Newmark 1/4, 1/2", "Newmark (1959)", Newmark,
        partial(alpha_amplification, beta=0.25, gamma=0.5, mass=0.0, force=0.0),
    ),
    Method(
        "Newmark 0.3025, 0.6", "Newmark (1959)", partial(Newmark, beta=0.3025, gamma=0.6),
        partial(alpha_amplification, beta=0.3025, gamma=0.6, mass=0.0, force=0.0),
    ),
    Method(
        "HHT, alpha -0.1", "Hilber et al. (1977)", partial(HHT, alpha=-0.1), partial(second_order, mass=0.0, force=0.1)
    ),
    Method(
        "WBZ, alpha -0.1", "Wood et al. (1980)", partial(WBZ, alpha=-0.1), partial(second_order, mass=-0.1, force=0.0)
    ),
    Method(
        "generalised alpha, r = 0.5", "Chung and Hulbert (1993)", partial(GeneralizedAlpha, spectral_radius=0.5),
        partial(second_order, mass=0.0, force=1 / 3),
    ),
    Method("Moreau-Jean, theta 1/2", "Jean (1999)", MoreauJean, partial(theta_amplification, theta=0.5)),
)  # fmt: skip
"""Methods of the cases; another one is another entry."""


def _free_vibration(method: methods.Method, periods: int) -> Response:
    """An undamped oscillator of 1 Hz, let go at 1 m."""
    system = System.from_matrices([[1.0]], [[0.0]], [[4 * math.pi**2]], points={"tip": [1.0]})
    return integrate(system, Sine(0.0, 1.0), method, float(periods), initial=State(displacement=[1.0]))


def _root(method: Method) -> tuple[complex, complex]:
    """Principal root of one step: of the amplification matrix, and of the motion computed."""
    roots = np.linalg.eigvals(method.amplification(2 * math.pi / STEPS))
    exact = complex(max(roots, key=lambda root: (abs(root), root.imag)))
    # 100 steps on, the third root of a method has decayed
    u = _free_vibration(method.make(1 / STEPS), 10)["tip"][100:]
    # two principal roots: u[n+2] = p u[n+1] + q u[n]
    p, q = np.linalg.lstsq(np.column_stack([u[1:-1], u[:-2]]), u[2:])[0]
    found = complex(max(np.roots([1.0, -p, -q]), key=lambda root: root.imag))
    return complex(exact.real, abs(exact.imag)), found


def _period(root: complex) -> float:
    return 2 * math.pi / (math.atan2(root.imag, root.real) * STEPS)


def _damping(root: complex) -> float:
    return -math.log(abs(root)) / math.atan2(root.imag, root.real)


def period_elongation(method: Method) -> Case:
    """How much too long a free vibration is."""
    exact, found = _root(method)
    return Case(
        f"{method.name}: period, {STEPS} steps a period", f"{method.source}, amplification matrix",
        "period elongation", "1", _period(exact) - 1, _period(found) - 1, 1e-9,
        "200 steps of rounding over an elongation of 1 %",
    )  # fmt: skip


def numerical_damping(method: Method) -> Case:
    """Damping ratio that the method adds."""
    exact, found = _root(method)
    reference = _damping(exact)
    # the average acceleration has none: its root lies on the unit circle, to rounding
    reference = 0.0 if abs(reference) < 1e-14 else reference
    return Case(
        f"{method.name}: damping, {STEPS} steps a period", f"{method.source}, amplification matrix",
        "numerical damping ratio", "1", reference, _damping(found), 1e-10, "200 steps of rounding",
    )  # fmt: skip


def energy_is_kept() -> Case:
    """The average acceleration keeps the energy of an undamped linear structure."""
    energy = _free_vibration(Newmark(1 / STEPS), 1000).energy
    assert energy is not None
    stored = energy.stored
    return Case(
        "Newmark 1/4, 1/2: energy of 1000 free periods", "Hughes (1987)", "largest change of energy", "1", 0.0,
        float(np.max(np.abs(stored / stored[0] - 1))), 1e-10, "20,000 steps of rounding",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    *(partial(check, method) for method in METHODS for check in (period_elongation, numerical_damping)),
    energy_is_kept,
)
"""The cases of this subject, in the order of the table."""
