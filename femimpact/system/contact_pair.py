"""A ball between its walls, an absorber, two balls, or the structure beside a stop: a scalar gap along a direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from femimpact.arrays import Array, own
from femimpact.contact.law import ContactLaw, require_law, resolve
from femimpact.contact.laws import ContactParameters, NoWalls
from femimpact.errors import (
    changed,
    check_fields,
    choice,
    column,
    made,
    name_text,
    quantity,
    require,
    require_type,
    text,
)
from femimpact.structure.structure import (
    Absorber,
    Impactor,
    Meeting,
    Stop,
    require_free_damping,
    require_preload,
    sound_gaps,
)


@dataclass(frozen=True, eq=False)
class ContactPair:
    """A ball between its two walls, two balls, or the beam between two stops: a scalar gap along one direction vector.

    An absorber is a ball whose gaps are infinite. Of two balls that meet, x = y_a - y_b: the pair has no coordinate of
    its own, as a stop has none, and its direction is zero.

    Parameters
    ----------
    name : str
    direction : ndarray (dofs,)
        b: the structure's displacement at the pair is b @ u, and x = y - b @ u is what the gaps bound.
        A stop fixed to the base has y = 0 and b = -(row of its place), so that x is the deflection there; one fixed
        in space has y = ub, the base's displacement, so that x is the absolute displacement there.
    position : float, m
        Not a number for a system given by matrices.
    mass : float, kg
        Of the ball; infinite for a stop and for balls that meet.
    gaps : pair of float, m
        On the + and on the - side; of a stop one may be negative where their sum is > 0 (preload).
    first_mode : float, kg^-0.5
        phi1, the first mass-normalised mode at the pair; of balls that meet sqrt(1/m_a + 1/m_b).
    flexibility : float, m/N
        b^T K^-1 b of the unreduced structure, which a reduced one is compared with; not a number where it is unknown.
    free_stiffness : float, N/m
    acceleration : float, m/s^2
        Constant one of the ball, gravity included.
    fixed_to : {"base", "space"}
        What a stop stands on; a ball's cavity moves with the structure.
    free_damping : float, N s/m
        Of the dashpot beside the centring spring.
    between : tuple of str
        Names of two balls that meet, the second on the + side; empty for other pairs.
    """

    name: str = field(metadata=name_text())
    direction: Array = field(metadata=column("1", "dofs", finite=True))
    position: float = field(metadata=quantity("m", finite=False))
    mass: float = field(metadata=quantity("kg", above=0.0, finite=False))
    gaps: tuple[float, float] = field(metadata=quantity("m", several=True, finite=False))
    law: ContactLaw
    first_mode: float = field(metadata=quantity("kg^-0.5"))
    flexibility: float = field(default=math.nan, metadata=quantity("m/N", at_least=0.0, finite=False))
    free_stiffness: float = field(default=0.0, metadata=quantity("N/m", at_least=0.0))
    acceleration: float = field(default=0.0, metadata=quantity("m/s^2"))
    fixed_to: str = field(default="base", metadata=choice("base", "space"))
    free_damping: float = field(default=0.0, metadata=quantity("N s/m", at_least=0.0))
    between: tuple[str, ...] = field(default=(), metadata=text(several=True))

    def __post_init__(self) -> None:
        check_fields(self)
        require(not math.isnan(self.mass), "mass", self.mass, "kg", "must be a number > 0 kg, infinite for a stop")
        two = isinstance(self.gaps, tuple) and sound_gaps(self.gaps) and (self.is_stop or min(self.gaps) >= 0.0)
        allowed = "must be two numbers >= 0 (to the + side, to the - side), or of a stop one negative and their sum > 0"
        require(two, "gaps", self.gaps, "m", allowed)
        based = self.is_stop or self.fixed_to == "base"
        require(based, "fixed_to", self.fixed_to, "", "must be 'base' for a ball: its cavity moves with the structure")
        require_law(self.law)
        require_preload(self.gaps, self.law)
        require_free_damping(self.free_damping, self.law)

    @cached_property
    def is_stop(self) -> bool:
        """True if the pair moves no ball of its own: a fixed obstacle, or two balls that meet."""
        return math.isinf(self.mass)

    @cached_property
    def kind(self) -> str:
        """The key of the part in study files: "stop", "meeting", "absorber" or "impactor"."""
        if self.is_stop:
            return "meeting" if self.between else "stop"
        return "absorber" if isinstance(self.law, NoWalls) else "impactor"

    @cached_property
    def sign(self) -> float:
        """-1 of a stop, whose direction points against w: its force on the beam is that many times F; else 1."""
        return -1.0 if self.kind == "stop" else 1.0

    @cached_property
    def has_walls(self) -> bool:
        """False of an absorber, and of a ball that meets no wall."""
        return min(self.gaps) < math.inf

    @property
    def is_preloaded(self) -> bool:
        """True if the undeformed structure would be inside a stop."""
        return min(self.gaps) < 0.0

    @property
    def preload_words(self) -> str:
        """The depth of a preload: "preloaded by 0.1 mm", or "" without one."""
        return f"preloaded by {-1e3 * min(self.gaps):.4g} mm" if self.is_preloaded else ""

    @property
    def mobility(self) -> float:
        """1/m of the ball (1/kg), 0 for a stop."""
        return 0.0 if self.is_stop else 1.0 / self.mass

    @cached_property
    def effective_mass(self) -> float:
        """1/(1/m + phi1^2), kg."""
        inverse = self.first_mode**2 + self.mobility
        # a stop where the first mode has a node: any finite number; the time scale of the law is then unknown
        return 1.0 / inverse if inverse > 0.0 else 1.0

    @cached_property
    def parameters(self) -> ContactParameters:
        """The law's numbers for this pair's effective mass."""
        return resolve(self.law, self.effective_mass)

    def shares_place(self, other: ContactPair) -> bool:
        """True if both pairs are at one place: the same direction object, position, first mode and flexibility."""
        require_type(other, ContactPair, "other")
        return (
            self.direction is other.direction
            and self.is_stop == other.is_stop
            and self.between == other.between
            and all(
                getattr(self, name) == getattr(other, name)
                or (math.isnan(getattr(self, name)) and math.isnan(getattr(other, name)))
                for name in ("position", "first_mode", "flexibility")
            )
        )


def contact_pair(
    item: Impactor | Absorber | Stop | Meeting, row: Array, position: float, first_mode: float, flexibility: float,
    gravity: float = 0.0,
) -> ContactPair:  # fmt: skip
    """The pair of an impactor, an absorber, a stop or a meeting, its law resolved for the first mode's mass.

    The row (dofs,) reads the structure's displacement at the position (m); the first mode there is mass-normalised
    (kg^-0.5), the flexibility is in m/N, and gravity (m/s^2) is added to the acceleration of a ball.
    """
    stop = item if isinstance(item, Stop) else None
    if isinstance(item, Absorber):
        stiffness, damping, acceleration = item.stiffness, item.damping, gravity
    elif isinstance(item, Impactor):
        stiffness, damping, acceleration = item.free_stiffness, item.free_damping, item.acceleration + gravity
    else:
        stiffness, damping, acceleration = 0.0, 0.0, 0.0
    pair = made(
        ContactPair,
        name=item.name,
        direction=own(-row if stop else row),
        position=position,
        mass=math.inf if isinstance(item, Stop | Meeting) else item.mass,
        gaps=item.gaps,
        law=item.contact,
        first_mode=first_mode,
        flexibility=flexibility,
        free_stiffness=stiffness,
        acceleration=acceleration,
        fixed_to=stop.fixed_to if stop else "base",
        free_damping=damping,
        between=item.between if isinstance(item, Meeting) else (),
    )
    # a law that has no numbers for this mass is refused here, not in the middle of a run
    require_type(pair.parameters, ContactParameters, "parameters")
    return pair


def meetings_of(contacts: Sequence[Any]) -> dict[int, tuple[int, int]]:
    """Of contacts that are balls that meet, by their number: those of the two balls."""
    numbers = {contact.name: j for j, contact in enumerate(contacts)}
    between = {j: contact.between for j, contact in enumerate(contacts) if contact.between}
    return {j: (numbers[first], numbers[second]) for j, (first, second) in between.items()}


def root_mobility(balls: Sequence[ContactPair]) -> float:
    """Square root (kg^-0.5) of the sum of 1/m of balls: what `first_mode` is of two that meet."""
    return math.sqrt(sum(ball.mobility for ball in balls))


def meeting_pairs(meetings: Sequence[Meeting], pairs: Sequence[ContactPair]) -> tuple[ContactPair, ...]:
    """The pairs of balls that meet, which have no share in the structure; `pairs` has those of the balls."""
    met = [[pair for pair in pairs if pair.name in item.between] for item in meetings]
    return tuple(
        contact_pair(item, 0.0 * balls[0].direction, balls[0].position, root_mobility(balls), math.nan)
        for item, balls in zip(meetings, met, strict=True)
    )


def pair_along(pair: ContactPair, direction: Array) -> ContactPair:
    """The same pair in other coordinates of the structure, (dofs,); law and effective mass stay."""
    direction.setflags(write=False)
    moved = changed(pair, direction=direction)
    # a user's law takes a while to integrate
    moved.__dict__["parameters"] = pair.parameters
    return moved
