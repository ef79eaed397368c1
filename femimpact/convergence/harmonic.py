"""Steady response of the structure without contacts to a sine of its base: exact in time, or of Newmark's steps."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.excitation import Sine
from femimpact.integrators.stepping.newmark import Newmark
from femimpact.system.system import System

__all__ = ["newmark_frequency", "steady_amplitude", "time_factors"]


def time_factors(base: Sine, step: Newmark | None = None) -> tuple[complex, complex]:
    """v/u (1/s) and a/u (1/s^2) of a steady motion u e^(i omega t): exact, or as Newmark's formulas relate them.

    With z = e^(i omega dt), the formulas of a step give v = dt (1 - gamma + gamma z)/(z - 1) a and
    u = [dt v + dt^2 (1/2 - beta + beta z) a]/(z - 1).
    """
    omega = 2.0 * math.pi * base.frequency
    if step is None:
        return 1j * omega, complex(-(omega**2))
    z = cmath.exp(1j * omega * step.dt)
    speed = step.dt * (1.0 - step.gamma + step.gamma * z) / (z - 1.0)
    place = (step.dt * speed + step.dt**2 * (0.5 - step.beta + step.beta * z)) / (z - 1.0)
    return speed / place, 1.0 / place


def newmark_frequency(frequency: NDArray[np.float64], step: Newmark) -> NDArray[np.float64]:
    """Frequencies (Hz) at which undamped modes move in Newmark's steps.

    A step multiplies by z with (z - 1)^2 + Omega^2 [beta z^2 + (1/2 + gamma - 2 beta) z + 1/2 - gamma + beta] = 0,
    Omega = omega dt; its frequency is arg(z)/(2 pi dt). For gamma = 1/2 and small steps the relative error is
    -(12 beta - 1)/24 Omega^2, which is -Omega^2/12 at beta = 1/4.
    """
    found = []
    for omega in 2.0 * math.pi * np.asarray(frequency):
        square = (omega * step.dt) ** 2
        roots = np.roots([
            1.0 + square * step.beta,
            -2.0 + square * (0.5 + step.gamma - 2.0 * step.beta),
            1.0 + square * (0.5 - step.gamma + step.beta),
        ])  # fmt: skip
        found.append(abs(np.angle(roots[0])) / (2.0 * math.pi * step.dt))
    return np.array(found)


def steady_amplitude(system: System, base: Sine, step: Newmark | None = None) -> NDArray[np.complex128]:
    """Complex amplitudes (dofs,) of the structure without contacts and constant loads; the base's is real.

    The stiffness is applied through its factor, as in `solve_stiffness`, so that fine meshes keep their digits.
    """
    from scipy.sparse.linalg import splu

    velocity, acceleration = time_factors(base, step)
    alpha, beta = system.rayleigh or (0.0, 0.0)
    rest = (acceleration + alpha * velocity) * system.M
    if system.rayleigh is None:
        rest = rest + velocity * system.C
    factor = sparse.csr_array(system.stiffness_factor)
    scale = 2.0 * math.pi * (system.first_frequency or base.frequency)
    blocks: Any = [
        [scale * sparse.eye_array(factor.shape[0]), factor],
        [(1.0 + beta * velocity) * factor.T, rest / -scale],
    ]
    matrix = sparse.block_array(blocks, format="csc").astype(complex)
    load = base.amplitude * (2.0 * math.pi * base.frequency) ** 2 * system.base_load
    right = np.concatenate([np.zeros(factor.shape[0]), load / -scale]).astype(complex)
    solver = splu(matrix)
    found = solver.solve(right)
    # one refinement: without it 256 elements leave 1e-9, with it 1024 leave 1e-10
    found = found + solver.solve(right - matrix @ found)
    return np.asarray(found[factor.shape[0] :])
