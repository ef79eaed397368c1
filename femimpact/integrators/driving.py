"""An excitation as the right-hand side of the equations: one scalar history, and where it acts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.excitation import Excitation, PointForce, RecordedBase, Sine
from femimpact.system.system import System

__all__ = ["Drive", "drive_of"]


@dataclass(frozen=True, eq=False)
class Drive:
    """M u'' + C u' + K u = load s(t) + contacts, y'' = g - share s(t) + contacts.

    s(t) = amplitude sin(omega t + phase), or a broken line through samples.

    Parameters
    ----------
    load : ndarray (dofs,)
        -base_load (kg) where s is the base's acceleration, b (1) where it is a force.
    share : float, 1
        1 where s is the base's acceleration, 0 where it is a force.
    amplitude : float, m/s^2 or N
        Of the sine; 0 for samples.
    omega : float, rad/s
        Of the sine, or of what counts as a cycle.
    phase : float, rad
    samples : ndarray (n,) or None
    interval : float, s
        Between samples.
    initial_velocity : float, m/s
        Of the base where s is its acceleration by samples.
    """

    load: NDArray[Any]
    share: float
    amplitude: float
    omega: float
    phase: float
    samples: NDArray[Any] | None = None
    interval: float = 0.0
    initial_velocity: float = 0.0

    def value(self, time: NDArray[Any]) -> NDArray[Any]:
        """s(t) at times in s; zero beyond the last sample."""
        if self.samples is None:
            return np.asarray(self.amplitude * np.sin(self.omega * time + self.phase))
        knots = self.interval * np.arange(self.samples.size)
        return np.asarray(np.interp(time, knots, self.samples, right=0.0))


def drive_of(system: System, excitation: Excitation) -> Drive:
    """The right-hand side of an excitation on a system.

    Raises
    ------
    InputError
        If the place of a force is unknown, or the excitation is none of the known kinds.
    """
    omega = 2.0 * np.pi * excitation.frequency
    if isinstance(excitation, Sine):
        return Drive(-system.base_load, 1.0, -excitation.amplitude * omega**2, omega, excitation.phase)
    if isinstance(excitation, PointForce):
        history = excitation.history
        return Drive(system.point_row(excitation.at), 0.0, history.amplitude, omega, history.phase)
    known = isinstance(excitation, RecordedBase)
    require(known, "excitation", excitation, "", "must be a Sine, a PointForce or a RecordedBase")
    return Drive(
        -system.base_load,
        1.0,
        0.0,
        omega,
        0.0,
        excitation.samples,
        excitation.interval,
        excitation.initial_velocity,
    )
