"""How places and balls of a study begin: the tables [[start]], and the state that they give a system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from femimpact.errors import check_fields, faults_of, name_text, optional, place, quantity, require, suggestion
from femimpact.excitation.harmonic import Sine
from femimpact.structure.structure import Position
from femimpact.system.state import State
from femimpact.system.system import System


@dataclass(frozen=True)
class PartStart:
    """`[[start]]`: how a place of the structure or a ball begins, relative to the base, in a history or a case.

    A place is displaced as by `State.pulled`, and has its speed from an ideal blow as of `State.struck`.

    Parameters
    ----------
    at : str or float, m
        A place. Without a place and a ball the speed is that of everything, as if the base had been stopped.
    ball : str
        Or the name of a ball or an absorber. Those without such a table lie in their boxes, at rest.
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
    base, drop = Sine(0.0, 1.0), sum(part.speed for part in parts if part.at is None and part.ball is None)
    state = State().static_contacts(system, base) or State()
    u, v = state.displacement, drop * system.rigid_translation
    with faults_of("start.at"):
        for part in parts:
            if part.at is not None and part.displacement is not None:
                u = State.pulled(part.at, part.displacement).relative_to_base(system, base)[0]
            if part.at is not None and part.speed:
                v = v + State.struck(part.at, part.speed).relative_to_base(system, base)[1]
    bent = np.zeros(system.dofs) if u is None else u
    balls = {pair.name: np.array([pair.direction @ bent, drop]) for pair in system.balls}
    for part in parts:
        if part.ball is not None:
            require(part.ball in balls, "start.ball", part.ball, "", suggestion(part.ball, balls))
            pair = next(one for one in system.balls if one.name == part.ball)
            balls[part.ball] = pair.direction @ np.array([bent, v]).T + [part.displacement or 0.0, part.speed]
    y, y_rate = np.reshape([*balls.values()], (-1, 2)).T
    return State(u, v, y, y_rate)
