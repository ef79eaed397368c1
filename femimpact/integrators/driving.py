"""An excitation as the right-hand side of the equations: one scalar history, and where it acts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.errors import real_array, require
from femimpact.excitation import BrokenLine, Excitation, Harmonic, PiecewisePolynomial, require_excitation
from femimpact.excitation.piecewise_polynomial import pieces_of
from femimpact.structure.structure import Position
from femimpact.system.system import System

__all__ = ["Drive", "drive_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drive:
    """M u'' + C u' + K u = load s(t) + contacts, y'' = g - share s(t) + contacts.

    Parameters
    ----------
    load : ndarray (dofs,)
        -base_load (kg) where s is the base's acceleration, b (1) where it is a force.
    share : float, 1
        1 where s is the base's acceleration, 0 where it is a force.
    omega : float, rad/s
        Of what counts as a cycle.
    history : callable
        s (m/s^2 or N) at times in s.
    closed_form : Harmonic, BrokenLine, PiecewisePolynomial or None
        Of s(t), where it has one.
    at : str, float or None
        Place of a force; None where the base moves.
    """

    load: Array
    share: float
    omega: float
    history: Callable[[Array], ArrayLike]
    closed_form: Harmonic | BrokenLine | PiecewisePolynomial | None
    at: Position | None = None

    @property
    def sine(self) -> Harmonic:
        """s(t) as a sine, with amplitude 0 where it is not one."""
        return self.closed_form if isinstance(self.closed_form, Harmonic) else Harmonic(0.0, self.omega, 0.0)

    @property
    def line(self) -> BrokenLine | None:
        """s(t) as a broken line, where it is one."""
        return self.closed_form if isinstance(self.closed_form, BrokenLine) else None

    @property
    def in_pieces(self) -> bool:
        """Whether s(t) is made of polynomials between knots, straight lines among them."""
        return isinstance(self.closed_form, BrokenLine | PiecewisePolynomial)

    @cached_property
    def pieces(self) -> PiecewisePolynomial | None:
        """s(t) as polynomials between knots, where it is made of them or is a broken line."""
        form = self.closed_form
        return pieces_of(form) if isinstance(form, BrokenLine | PiecewisePolynomial) else None

    @property
    def is_sine(self) -> bool:
        """Whether s(t) is a sine; the values of anything else are tabulated by methods that take steps."""
        return isinstance(self.closed_form, Harmonic)

    @property
    def base_amplitude(self) -> float:
        """Of the base's displacement under a sine, m."""
        return -self.share * self.sine.amplitude / self.omega**2

    def value(self, time: Array) -> Array:
        """s(t) at times in s.

        Raises
        ------
        InputError
            If the history of a user's excitation is not of finite numbers, one for each time.
        """
        if self.is_sine:
            wave = self.sine
            return np.asarray(wave.amplitude * np.sin(wave.omega * time + wave.phase))
        if self.line is not None:
            knots = self.line.interval * np.arange(self.line.samples.size)
            return np.asarray(np.interp(time, knots, self.line.samples, right=0.0))
        if self.pieces is not None:
            return self.pieces.value(time)
        allowed = f"must give {np.size(time)} finite numbers for as many times"
        values = real_array("excitation", self.history(time), "m/s^2 or N", allowed)
        require(values.shape == np.shape(time), "excitation", f"array of shape {values.shape}", "m/s^2 or N", allowed)
        return values


def drive_of(system: System, excitation: Excitation) -> Drive:
    """The right-hand side of an excitation on a system.

    Raises
    ------
    InputError
        If the place of a force is unknown, or the value is no excitation.
    """
    require_excitation(excitation)
    # the two members that a user's excitation may lack
    at, closed_form = (getattr(excitation, name, None) for name in ("at", "closed_form"))
    omega = 2.0 * np.pi * excitation.frequency
    if at is None:
        return Drive(-system.base_load, 1.0, omega, excitation.acceleration, closed_form)
    force: Any = excitation
    return Drive(system.point_row(at), 0.0, omega, force.force, closed_form, at)
