"""Small systems with periodic orbits, by plain numbers: for the package and for the reference in many digits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import femimpact as fi


@dataclass(frozen=True)
class Model:
    """Modes of unit mass with balls and stops under a sine of the base."""

    omega: tuple[float, ...]  # rad/s: of the modes
    ratio: float  # damping ratio of the modes
    base_load: tuple[float, ...]
    # of each pair: shape of the modes, mass of the ball or None for a stop, gap of both sides
    pairs: tuple[tuple[tuple[float, ...], float | None, float], ...]
    law: tuple[float, float]  # restitution and 0, or stiffness (N/m) and damping (N s/m)
    amplitude: float  # m
    frequency: float  # Hz
    in_space: bool = False
    acceleration: float = 0.0  # m/s^2 of the balls
    held: tuple[float, float] = (0.0, 0.0)  # spring (N/m) and dashpot (N s/m) that hold each ball

    @property
    def is_rigid(self) -> bool:
        """True if the contacts are."""
        return self.law[1] == 0.0

    def system(self) -> fi.System:
        """The package's system."""
        law = fi.Rigid(self.law[0]) if self.is_rigid else fi.KelvinVoigt(stiffness=self.law[0], damping=self.law[1])
        points = {f"place {j}": shape for j, (shape, _, _) in enumerate(self.pairs)}
        balls = [
            fi.Impactor(
                f"ball {j}", f"place {j}", mass, gap, law, self.held[0], self.acceleration, free_damping=self.held[1]
            )
            for j, (_, mass, gap) in enumerate(self.pairs)
            if mass is not None
        ]
        stops = [
            fi.Stop(f"stop {j}", f"place {j}", (gap, gap), law, fixed_to="space" if self.in_space else "base")
            for j, (_, mass, gap) in enumerate(self.pairs)
            if mass is None
        ]
        damping = np.diag(2.0 * self.ratio * np.array(self.omega))
        return fi.System.from_matrices(
            np.eye(len(self.omega)), damping, np.diag(np.square(self.omega)), points=points, base_load=self.base_load,
            impactors=balls, stops=stops,
        )  # fmt: skip

    def orbit(self) -> fi.orbits.PeriodicOrbit:
        """The orbit that a run from rest leads to."""
        system, base = self.system(), fi.Sine(self.amplitude, self.frequency)
        run = fi.integrate(system, base, fi.EventDriven(), 400 / self.frequency, fi.Recorder(channels=(), ledger=False))
        return fi.find_orbit(system, base, guess=run)


FIRST = 2.0 * math.pi * 5.3

MODELS = {
    "rigid": Model((FIRST,), 0.0029, (0.178,), (((6.2,), 3.43e-3, 2e-3),), (0.6, 0.0), 0.2037e-3, 5.3),
    "Kelvin-Voigt": Model((FIRST,), 0.0029, (0.178,), (((6.2,), 3.43e-3, 2e-3),), (3000.0, 2.0), 0.2037e-3, 5.3),
    "stop in space": Model(
        (FIRST, 6.3 * FIRST), 0.02, (0.178, 0.07), (((6.2, -4.0), None, 3e-3),), (0.7, 0.0), 0.5e-3, 5.6, in_space=True
    ),
    "Kelvin-Voigt stop in space": Model(
        (FIRST,), 0.02, (0.178,), (((6.2,), None, 3e-3),), (500.0, 0.5), 0.5e-3, 5.6, in_space=True
    ),
    "two balls": Model(
        (FIRST,), 0.0029, (0.178,), (((6.2,), 3.43e-3, 2e-3), ((4.1,), 2.0e-3, 1.5e-3)), (0.5, 0.0), 0.3e-3, 5.3
    ),
    "gravity": Model(
        (FIRST,), 0.0029, (0.178,), (((6.2,), 3.43e-3, 2e-3),), (0.6, 0.0), 0.2037e-3, 5.3, acceleration=-0.05
    ),
}  # fmt: skip

HELD_BALL = Model(
    (FIRST, 6.3 * FIRST), 0.01, (0.178, 0.07), (((6.2, -4.0), 3.43e-3, 2e-3),), (0.6, 0.0), 0.2e-3, 5.3,
    acceleration=-0.05, held=(2.0, 1e-2),
)  # fmt: skip
"""A ball on a spring and a dashpot, of which digits by parameters are kept alone."""
