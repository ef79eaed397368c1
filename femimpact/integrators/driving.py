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

JUMP = 1e-6
"""Share of the largest value of a history above which two pieces of it do not meet: those made of sines do to 1e-9."""


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
        if self.line is not None and np.size(time):
            # of a long record the samples around the times alone
            h, most = self.line.interval, self.line.samples.size - 1
            first = min(max(int(np.min(time) / h) - 1, 0), most)
            last = min(max(int(np.max(time) / h) + 2, first), most)
            knots = h * np.arange(first, last + 1)
            return np.asarray(np.interp(time, knots, self.line.samples[first : last + 1], right=0.0))
        if self.pieces is not None:
            return self.pieces.value(time)
        allowed = f"must give {np.size(time)} finite numbers for as many times"
        values = real_array("excitation", self.history(time), "m/s^2 or N", allowed)
        require(values.shape == np.shape(time), "excitation", f"array of shape {values.shape}", "m/s^2 or N", allowed)
        return values

    def value_at_steps(self, time: Array) -> Array:
        """s(t) at the even times (s) of steps, with what keeps a method of order 2 at that order where s(t) jumps.

        Trapezoids between the steps miss a share of the impulse of a jump, up to half a step of it. The step nearest to
        a jump has the value with which the two trapezoids beside it have the integral of s(t); it is one between those
        before and after the jump. A history without a closed form is read as it is.
        """
        values, h = self.value(time), float(time[1] - time[0])
        for jump in self._jumps[self._jumps > time[0]]:
            # steps to the first one are read as the run has begun there
            i = max(round((jump - time[0]) / h), 1)
            if i < time.size:
                before, after = time[0] + h * (i - 1), time[0] + h * (i + 1)
                beside = self.value(np.array([before, after]))
                values[i] = self._integral(before, after) / h - 0.5 * float(beside.sum())
        return values

    @cached_property
    def _jumps(self) -> Array:
        """Times (s) at which s(t) jumps, in a closed form."""
        if self.line is not None:
            sizes = np.abs(self.line.samples)
            end = self.line.interval * (sizes.size - 1)
            return np.array([end] if sizes[-1] > JUMP * sizes.max() else [])
        pieces = self.pieces
        if pieces is None:
            return np.zeros(0)
        h, right = np.diff(pieces.knots), pieces.table[:, 2]
        left = np.zeros_like(right)
        left[1:] = np.sum(pieces.coefficients * h[:, None] ** np.arange(pieces.degree + 1), axis=1)
        return np.asarray(pieces.knots[np.abs(right - left) > JUMP * np.abs(left).max()])

    def _integral(self, first: float, last: float) -> float:
        """Of s(t) from one time to another (s), in a closed form of pieces."""
        if self.line is not None:
            return float(self.line.motion_at(last)[1] - self.line.motion_at(first)[1])
        if self.pieces is None:
            raise TypeError("the integral of a history without pieces")
        return float(np.diff(self.pieces.velocity(np.array([first, last])))[0])


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
