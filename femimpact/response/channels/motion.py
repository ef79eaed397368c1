"""Channels of motion: displacement, velocity and acceleration of places and balls, relative to the base or in space."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from femimpact.errors import check_fields, place, quantity, truth
from femimpact.response.channels.reading import Reading, zero_reading
from femimpact.structure.structure import Position
from femimpact.system.system import System

__all__ = ["Motion", "Rotation"]

NAMES = ("displacement", "velocity", "acceleration")
UNITS = ("m", "m/s", "m/s^2")


@dataclass(frozen=True)
class Motion:
    """Displacement, velocity or acceleration of a place or a ball: w(x, t) or y(t), in space with the base's added.

    The acceleration is the one that the equations of motion give at the instant of the sample, for every method.
    Beside rigid contacts it is that between impacts, whose share is an impulse.

    Parameters
    ----------
    at : str or float
        A place of the structure, metres from the root, or a ball's name.
    derivative : int, 1
        0 for the displacement (m), 1 for the velocity (m/s), 2 for the acceleration (m/s^2).
    absolute : bool
        In the inertial frame; otherwise relative to the moving base.

    Raises
    ------
    InputError
        If a value is out of range; when it is read, if the place is unknown.
    """

    at: Position = field(metadata=place())
    derivative: int = field(default=0, metadata=quantity("1", at_least=0, at_most=2, integer=True))
    absolute: bool = field(default=False, metadata=truth())

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it unless it is the relative displacement."""
        read = NAMES[self.derivative]
        if self.absolute:
            return f"{self.at}.absolute_{read}"
        return f"{self.at}.{read}" if self.derivative else str(self.at)

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return UNITS[self.derivative]

    def reading(self, system: System) -> Reading:
        """Row of the place, or the coordinate of the ball, and the base's share."""
        balls = [pair.name for pair in system.contacts]
        nothing = zero_reading(system)
        base = np.eye(3)[self.derivative] if self.absolute else nothing.base
        if self.at in balls and self.at not in system.points:
            coordinate: Any = np.eye(len(balls))[balls.index(str(self.at))]
            moving = {("ball_displacement", "ball_velocity", "ball_acceleration")[self.derivative]: coordinate}
        else:
            moving = {NAMES[self.derivative]: system.point_row(self.at)}
        return replace(nothing, base=base, **moving)


@dataclass(frozen=True)
class Rotation:
    """Slope w'(x, t) of the deflection at a place on the beam, 1.

    Parameters
    ----------
    at : str or float
        A named place, or metres from the root.

    Raises
    ------
    InputError
        If the value is no place; when it is read, if the place is unknown or lies on no beam.
    """

    at: Position = field(metadata=place())

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def name(self) -> str:
        """The place, with what is read of it."""
        return f"{self.at}.rotation"

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return "1"

    def reading(self, system: System) -> Reading:
        """Row of w' there."""
        row = system.deflection_rows([system.position_of(self.at)], derivative=1)[0]
        return replace(zero_reading(system), displacement=np.asarray(row))
