"""Euler-Bernoulli beams: natural frequencies, static deflection and forced response in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from femimpact.contact import Rigid
from femimpact.excitation import Sine
from femimpact.fem.assembly import assemble
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.integrate import integrate
from femimpact.response.response import Recorder
from femimpact.structure.damping import Rayleigh
from femimpact.structure.structure import Beam, PointMass, Stop, Structure
from femimpact.system.modes import solve_modes
from femimpact.system.reduction import reduce
from femimpact.validation.case import Case

__all__ = [
    "BENDING_STIFFNESS",
    "CASES",
    "ELEMENTS",
    "LENGTH",
    "MASS_PER_LENGTH",
    "ROOTS",
    "beam_frequency",
    "uniform_beam",
]

LENGTH, WIDTH, THICKNESS, YOUNG_MODULUS, DENSITY = 0.3, 0.02, 1e-3, 70e9, 2700.0
BENDING_STIFFNESS = YOUNG_MODULUS * WIDTH * THICKNESS**3 / 12
MASS_PER_LENGTH = DENSITY * WIDTH * THICKNESS
ELEMENTS = 80
ROOTS = (1.87510407, 4.69409113, 7.85475744, 10.99554073, 14.13716839)
"""beta L of the clamped-free beam, 8 decimals: Blevins (1979), table 8-1."""


def uniform_beam() -> Beam:
    """The cantilever of these cases."""
    return Beam.uniform(
        length=LENGTH, width=WIDTH, thickness=THICKNESS, young_modulus=YOUNG_MODULUS, density=DENSITY
    )  # fmt: skip


def beam_frequency(root: float) -> float:
    """Natural frequency (Hz) of beta L."""
    return (root / LENGTH) ** 2 * math.sqrt(BENDING_STIFFNESS / MASS_PER_LENGTH) / (2 * math.pi)


def _computed_root(structure: Structure, mode: int) -> float:
    frequency = float(solve_modes(assemble(structure, ELEMENTS), mode).natural_frequency[mode - 1])
    return math.sqrt(frequency / beam_frequency(1.0))


def _mesh_error(root: float) -> float:
    # cubic elements raise omega^2 by (beta h)^4/720, beta L goes with its fourth root
    return (root / ELEMENTS) ** 4 / 2880


def cantilever_root(mode: int) -> Case:
    """Roots of 1 + cos x cosh x = 0."""
    root = ROOTS[mode - 1]
    return Case(
        f"cantilever, mode {mode}", "Blevins (1979), table 8-1", "beta L", "1", root,
        _computed_root(Structure(uniform_beam()), mode), 1.2 * _mesh_error(root) + 5e-9 / root,
        f"(beta h)^4/2880 of {ELEMENTS} cubic elements, and the 8 decimals of the reference",
    )  # fmt: skip


def tip_mass_root(mode: int, ratio: float) -> Case:
    """Roots of 1 + cos x cosh x + ratio x (cos x sinh x - sin x cosh x) = 0, ratio = tip mass/beam mass."""
    from scipy.optimize import brentq

    def determinant(x: float) -> float:
        # over cosh x, which would overflow digits
        c, s, t = math.cos(x), math.sin(x), math.tanh(x)
        return 1 / math.cosh(x) + c + ratio * x * (c * t - s)

    # between the root of the clamped-pinned beam below and that of the clamped-free one
    below = 0.1 if mode == 1 else (mode - 0.75) * math.pi - 0.01
    root = float(brentq(determinant, below, ROOTS[mode - 1], xtol=1e-15, rtol=1e-15))
    beam = uniform_beam()
    structure = Structure(beam, masses=(PointMass("box", "tip", ratio * beam.mass),))
    return Case(
        f"cantilever with a tip mass of {ratio:g} beam masses, mode {mode}", "derived here (transcendental equation)",
        "beta L", "1", root, _computed_root(structure, mode), 1.2 * _mesh_error(root) + 1e-9,
        f"(beta h)^4/2880 of {ELEMENTS} cubic elements, and 1e-9 of rounding",
    )  # fmt: skip


def tip_flexibility() -> Case:
    """Static deflection of the tip under a force there, L^3/(3 E I)."""
    probe = Stop("probe", "tip", (math.inf, 0.1), Rigid(0.5))
    system = assemble(Structure(uniform_beam(), stops=(probe,)), ELEMENTS)
    return Case(
        "cantilever, static tip deflection of 1 N", "derived here (F L^3/(3 E I))", "deflection", "m",
        LENGTH**3 / (3 * BENDING_STIFFNESS), system.contacts[0].flexibility, 1e-9,
        "cubic elements are exact for end loads: rounding only",
    )  # fmt: skip


def _modal_series(frequency: float, alpha: float, beta: float) -> float:
    """Tip amplitude over base amplitude, relative motion: the sum over the clamped-free modes.

    phi(L) = 2 (-1)^(n+1) and the mean of phi is 2 s/x, for phi of unit mean square.
    """
    omega, total = 2 * math.pi * frequency, 0j
    for n, x in enumerate((*ROOTS, *((n + 0.5) * math.pi for n in range(5, 10)))):
        s = (math.sinh(x) - math.sin(x)) / (math.cosh(x) + math.cos(x))
        own = 2 * math.pi * beam_frequency(x)
        total += (-1) ** n * 4 * s / x * omega**2 / (own**2 - omega**2 + 1j * omega * (alpha + beta * own**2))
    return abs(total)


def base_sine(ratio: float) -> Case:
    """Steady tip amplitude of a cantilever on a base that moves as a sine."""
    damping, first, second = 0.05, beam_frequency(ROOTS[0]), beam_frequency(ROOTS[1])
    structure = Structure(uniform_beam(), damping=Rayleigh(ratio=damping, frequencies=(first, second)))
    alpha = 4 * math.pi * damping * first * second / (first + second)
    beta = damping / (math.pi * (first + second))
    base = Sine(1e-3, ratio * first)
    # the transient has fallen by exp(-0.05 2 pi 20) = 2e-3 at 20 periods, so wait for 80
    wait, keep = 80 / first, 20 / base.frequency
    run = integrate(
        reduce(assemble(structure, ELEMENTS), 10), base, EventDriven(), wait + keep, Recorder(("tip",), start=wait)
    )
    angle = base.omega * run.time
    in_phase, quadrature = np.linalg.lstsq(np.column_stack([np.sin(angle), np.cos(angle)]), run["tip"])[0]
    return Case(
        f"cantilever on a shaken base, {ratio:g} f1", "derived here (modal series, 10 modes)",
        "tip over base amplitude", "1", _modal_series(base.frequency, alpha, beta),
        math.hypot(in_phase, quadrature) / base.amplitude, 2e-7,
        "the roots to 8 decimals, at resonance times 2 x 10; mesh 1e-9, transient 1e-11",
    )  # fmt: skip


CASES: tuple[Callable[[], Case], ...] = (
    *(partial(cantilever_root, mode) for mode in (1, 2, 3)),
    *(partial(tip_mass_root, mode, ratio) for ratio in (0.5, 2.0) for mode in (1, 2, 3)),
    tip_flexibility,
    *(partial(base_sine, ratio) for ratio in (0.5, 1.0, 3.0)),
)
"""The cases of this subject, in the order of the table."""
