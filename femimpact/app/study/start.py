"""How places and balls of a study begin: the tables [[start]], and the state that they give a system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from femimpact.errors import check_fields, faults_of, name_text, optional, place, quantity, require, suggestion
from femimpact.excitation.harmonic import Sine
from femimpact.structure.structure import Position
from femimpact.system.state import STILL, State
from femimpact.system.system import System


@dataclass(frozen=True)
class PartStart:
    """`[[start]]`: how a place of the structure or a ball begins, relative to the base, in a history or a case.

    A force holds the place where it is displaced to, and lets go at the start: the structure has the static shape of
    that force and of the constant ones. With a speed of the place the structure moves in such a shape.

    Parameters
    ----------
    at : str or float, m
        A place. Without a place and a ball the speed is that of everything, as if the base had been stopped.
    ball : str
        Or the name of a ball or an absorber. Those without such a table go with their place of the structure.
    displacement : float, m
        Of a place; of a ball in its box, where 0 is its place in the undeformed structure.
    speed : float, m/s
        Of a place; of a ball relative to its box.

    Raises
    ------
    InputError
        If there are a place and a ball, or a displacement of neither.
    """

    at: Position | None = field(default=None, metadata=optional(place()))
    ball: str | None = field(default=None, metadata=optional(name_text()))
    displacement: float | None = field(default=None, metadata=optional(quantity("m")))
    speed: float = field(default=0.0, metadata=quantity("m/s"))

    def __post_init__(self) -> None:
        check_fields(self)
        require(self.at is None or self.ball is None, "ball", self.ball, "", "must be left out: at is given")
        of_one = self.displacement is None or self.at is not None or self.ball is not None
        require(of_one, "displacement", self.displacement, "m", "needs a place, at = 'tip', or a ball, ball = 'NAME'")


def state_of(parts: Sequence[PartStart], system: System) -> State:
    """The state of a system that begins so.

    Raises `InputError` if a place or a ball is unknown, or no force moves a place.
    """
    rest, still = State().static_contacts(system, Sine(0.0, 1.0)), np.zeros(system.dofs)
    drop = sum(part.speed for part in parts if part.at is None and part.ball is None)
    pulled, u, bending = False, still if rest is None else rest.displacement, still
    for part in parts:
        if part.at is not None:
            with faults_of("start.at"):
                row = system.point_row(part.at)
                sag, bent = (State.under_force(system, force, part.at).displacement for force in (0.0, 1.0))
            shape = bent - sag
            moves = float(row @ shape) > STILL * float(np.linalg.norm(row) * np.linalg.norm(shape))
            require(moves, "start.at", part.at, "", "must be a place that a force moves")
            shape = shape / float(row @ shape)
            bending = part.speed * shape
            if part.displacement is not None:
                pulled, u = True, sag + (part.displacement - float(row @ sag)) * shape
    balls = {pair.name: np.array([pair.direction @ u, drop + pair.direction @ bending]) for pair in system.balls}
    for part in parts:
        if part.ball is not None:
            require(part.ball in balls, "start.ball", part.ball, "", suggestion(part.ball, balls))
            balls[part.ball] = balls[part.ball] + [part.displacement or 0.0, part.speed]
    y, y_rate = np.reshape([*balls.values()], (-1, 2)).T
    return State(u if pulled else None, drop * system.rigid_translation + bending, y, y_rate)
