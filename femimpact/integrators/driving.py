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
from femimpact.excitation.excitation import AT_SAMPLE
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

        Trapezoids between the steps miss a share of the impulse of a jump, up to half a step of it. At the step nearest
        to a jump, the jumps of s(t) and of its slope count by the shares with which the two trapezoids beside that step
        have their impulses. What does not jump there is read as it is, so that the values of a sum are the sums of
        those of its parts. So is a history without a closed form.
        """
        values, h = self.value(time), float(time[1] - time[0])
        read = values.copy()
        for jump, left, size, bend in self._jumps:
            # steps to the first one are read as the run has begun there
            i = max(round((jump - time[0]) / h), 1)
            if jump > time[0] and i < time.size:
                after = time[i] - jump
                # at the jump itself rounding decides on which side the history is read
                beyond = after > 0.0 if abs(after) > AT_SAMPLE * h else abs(read[i] - left) > 0.5 * abs(size)
                values[i] += size * (after / h + 0.5 - beyond)
                values[i] += bend * (0.5 * after * (1.0 + after / h) - max(after, 0.0))
        return values

    @cached_property
    def _jumps(self) -> Array:
        """Times (s) at which s(t) jumps in a closed form, its values before, its changes and its slope's: (n, 4)."""
        if self.line is not None:
            samples, h = self.line.samples, self.line.interval
            last, largest = float(samples[-1]), float(np.abs(samples).max())
            found = np.array([[h * (samples.size - 1), last, -last, (samples[-2] - last) / h]])
        elif self.pieces is not None:
            h, table, c = np.diff(self.pieces.knots), self.pieces.table, self.pieces.coefficients
            before = np.zeros((table.shape[0], 2))
            for n in range(self.pieces.degree, -1, -1):
                before[1:, 1] = before[1:, 1] * h + before[1:, 0]
                before[1:, 0] = before[1:, 0] * h + c[:, n]
            found = np.column_stack([self.pieces.knots, before[:, 0], table[:, 2:4] - before])
            largest = float(np.abs(before[:, 0]).max())
        else:
            return np.zeros((0, 4))
        return np.asarray(found[np.abs(found[:, 2]) > JUMP * largest])


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
