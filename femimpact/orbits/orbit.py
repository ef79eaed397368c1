"""The periodic orbit: its events, its state at t = 0, its multipliers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array, Complex
from femimpact.errors import check_fields, column, having, instance, optional, quantity
from femimpact.excitation import Excitation
from femimpact.excitation.excitation import MEMBERS
from femimpact.response.impacts import EventLog, Impacts
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.table import Head, head_of_values, short_repr

LARGEST_SHOWN = 4
"""Multipliers that a notebook shows."""


NEUTRAL = 1e-10
"""Distance of a modulus from 1 up to which it is 1: an orbit is confirmed to this, and its multipliers are no more."""


@short_repr
@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic motion under a sine, stable or not, found by `find_orbit` and verified by an event-driven run.

    Parameters
    ----------
    system : System
    excitation : Sine or PointForce
    cycles : int
        Periods of the excitation after which the motion repeats.
    state : State
        At t = 0, after an event there: a run from it stays on a stable orbit.
    events : EventLog
        The events of one period, with the states just after them; times in s, 0 <= time < period. Where the motion
        meets nothing there are none.
    contact_state : ndarray (pairs,) of int
        At t = 0, as of `EventLog`.
    impacts : Impacts
        Table of the impacts of one period, by their times of touch within it.
    monodromy : ndarray (2(n+balls), 2(n+balls))
        Derivative of the state (u, y, u', y') one period later by that at t = 0, the saltation at events included.
    residual : float, 1
        By which the orbit's own run misses its start after one period: displacements over `length`, velocities over
        `length` times omega.
    length : float, m
        Unit of displacements: the smallest of the gaps, or 1e-3 of the motion's size where that is larger; without
        gaps the size itself, the largest displacement or velocity over omega just after the events.
    half_map : ndarray or None
        Of a symmetric orbit: derivative of minus the state half a period later by the state just after its first event.
        Its square is the monodromy there. None of any other.
    """

    system: System = field(metadata=instance(System))
    excitation: Excitation = field(metadata=having("an excitation", MEMBERS))
    cycles: int = field(metadata=quantity("1", at_least=1, integer=True))
    state: State = field(metadata=instance(State))
    events: EventLog = field(metadata=instance(EventLog))
    contact_state: NDArray[np.integer[Any]] = field(metadata=column("1", "pairs", of="whole number"))
    impacts: Impacts = field(metadata=instance(Impacts))
    monodromy: Array = field(metadata=column("1", "coordinates", "coordinates"))
    residual: float = field(metadata=quantity("1", at_least=0.0))
    length: float = field(metadata=quantity("m", above=0.0))
    half_map: Array | None = field(default=None, metadata=optional(column("1", "coordinates", "coordinates")))

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def period(self) -> float:
        """Period of the motion, s."""
        return self.cycles / self.excitation.frequency

    @cached_property
    def multipliers(self) -> Complex:
        """Floquet multipliers (2(n+balls),), 1, largest modulus first: how a small disturbance grows in one period.

        They are the eigenvalues of the monodromy. Fast modes decay by e^-50 and more within a period: multipliers
        below 1e-13 of the norm of the matrix are rounding. Where an impact has no speed they are infinite: those of an
        orbit that grazes are not tested.
        """
        return _sorted_eigenvalues(self.monodromy)

    @cached_property
    def half_multipliers(self) -> Complex:
        """Those of the half map of a symmetric orbit, whose squares the multipliers are; none of any other orbit.

        At -1 of one of them, +1 of its square, the orbit loses its symmetry; at +1 it has a fold.
        """
        return np.zeros(0, dtype=complex) if self.half_map is None else _sorted_eigenvalues(self.half_map)

    @property
    def is_stable(self) -> bool:
        """True if every small disturbance decays: all multipliers are below 1 - 1e-10, as `decays` has it."""
        return bool(decays(self.multipliers))

    @property
    def is_symmetric(self) -> bool:
        """True if the motion half a period later is the same with the opposite sign."""
        return self.half_map is not None

    @property
    def _head(self) -> Head:
        size = np.abs(self.multipliers[:LARGEST_SHOWN])
        values = {
            "period": f"{self.period:.6g} s, {self.cycles} of the excitation at {self.excitation.frequency:.6g} Hz",
            "impacts": f"{len(self.impacts)} in a period",
            "largest multipliers": ", ".join(f"{value:.6g}" for value in size),
            "residual": f"{self.residual:.2g} after a period, by its own run",
        }
        kind = "symmetric, " if self.is_symmetric else ""
        return head_of_values(f"PeriodicOrbit: {kind}{'stable' if self.is_stable else 'unstable'}", values)


def decays(multipliers: Complex) -> NDArray[np.bool_]:
    """Whether every small disturbance decays, of multipliers (..., 2(n+balls)), the largest first.

    Those of an undamped motion are 1, and rounding puts them to either side.
    """
    return np.asarray(np.abs(multipliers[..., 0]) < 1.0 - NEUTRAL)


def state_vector(state: State) -> Array:
    """The vector (u, y, u', y') of a state that has all of them."""
    return np.concatenate([state.displacement, state.ball_displacement, state.velocity, state.ball_velocity])


def _sorted_eigenvalues(matrix: Array) -> Complex:
    values = np.linalg.eigvals(matrix).astype(complex)
    return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])
