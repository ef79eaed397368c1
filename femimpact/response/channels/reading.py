"""What a channel is: a name, a unit, and a linear reading of the state."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import check_fields, column, quantity
from femimpact.system.system import System

__all__ = ["Channel", "Reading", "zero_reading"]


@dataclass(frozen=True, eq=False)
class Reading:
    """A scalar that is linear in the state of a system, in its accelerations, in the base's motion and in the forces.

    value = displacement u + velocity u' + acceleration u'' + ball_displacement y + ball_velocity y'
    + ball_acceleration y'' + base (ub, ub', ub'') + contact_force F + point_force F(t) + reaction R + constant

    u and y are relative to the base, F_j acts on the structure along the direction b_j of its pair. Change a
    `zero_reading` with `dataclasses.replace`.

    Parameters
    ----------
    displacement, velocity, acceleration : ndarray (dofs,)
    ball_displacement, ball_velocity, ball_acceleration : ndarray (pairs,)
        Entries of stops are without effect: a stop does not move by itself.
    base : ndarray (3,)
        Of the base's displacement (m), velocity (m/s) and acceleration (m/s^2).
    contact_force : ndarray (pairs,)
        Per newton of each F_j, centring springs left out. Of a rigid pair this is the force while it sticks; an
        impact is an impulse, which no instant shows.
    reaction : ndarray (reactions,)
        Per unit of each of `System.reactions`, in their order.
    point_force : float
        Per newton of the force that drives, where one does.
    constant : float

    Raises
    ------
    InputError
        If a row is not one of finite numbers.
    """

    displacement: NDArray[np.float64] = field(metadata=column("1", "dofs", finite=True))
    velocity: NDArray[np.float64] = field(metadata=column("1", "dofs", finite=True))
    acceleration: NDArray[np.float64] = field(metadata=column("1", "dofs", finite=True))
    ball_displacement: NDArray[np.float64] = field(metadata=column("1", "pairs", finite=True))
    ball_velocity: NDArray[np.float64] = field(metadata=column("1", "pairs", finite=True))
    ball_acceleration: NDArray[np.float64] = field(metadata=column("1", "pairs", finite=True))
    base: NDArray[np.float64] = field(metadata=column("1", 3, finite=True))
    contact_force: NDArray[np.float64] = field(metadata=column("1/N", "pairs", finite=True))
    reaction: NDArray[np.float64] = field(metadata=column("1", "reactions", finite=True))
    point_force: float = field(default=0.0, metadata=quantity("1"))
    constant: float = field(default=0.0, metadata=quantity("1"))

    def __post_init__(self) -> None:
        check_fields(self)


def zero_reading(system: System) -> Reading:
    """The reading that is zero in every state of a system: others are made of it by `dataclasses.replace`."""
    if "zero reading" not in system.derived:
        dofs, pairs, base = np.zeros(system.dofs), np.zeros(len(system.contacts)), np.zeros(3)
        reactions = np.zeros(len(system.reactions))
        system.derived["zero reading"] = Reading(dofs, dofs, dofs, pairs, pairs, pairs, base, pairs, reactions)
    zero: Reading = system.derived["zero reading"]
    return zero


@runtime_checkable
class Channel(Protocol):
    """One recorded column: what it is called, its unit, and what it reads of a state.

    A user's class with these three serves in `Recorder.channels` beside the names of the built-in ones.
    """

    @property
    def name(self) -> str:
        """Under which a response holds it."""

    @property
    def unit(self) -> str:
        """Unit of its values."""

    def reading(self, system: System) -> Reading:
        """What it reads of a system's state."""
