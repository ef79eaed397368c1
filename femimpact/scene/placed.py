"""A structure with its parts at their places, and the sizes in which they are drawn: the same in every picture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from femimpact.arrays import Array
from femimpact.structure.beam import Beam
from femimpact.structure.structure import (
    Absorber,
    Dashpot,
    Impactor,
    PointMass,
    Position,
    Spring,
    Stop,
    Structure,
    Support,
)
from femimpact.system.contact_pair import ContactPair, meetings_of
from femimpact.system.hermite import hermite_rows
from femimpact.system.matrices import Matrix
from femimpact.system.system import System

BALL_DENSITY = 7850.0
"""kg/m^3. The model has no ball radius; a steel sphere of the ball's mass is drawn, and a steel cube of a body's."""


SAME = 1e-9
"""Share of the beam's length within which two positions are one."""


def ball_radius(mass: float) -> float:
    """Radius (m) of the steel sphere that is drawn for a ball of this mass (kg)."""
    return float((3.0 * mass / (4.0 * math.pi * BALL_DENSITY)) ** (1.0 / 3.0))


def body_side(mass: float) -> float:
    """Side (m) of the steel cube that is drawn for a body of this mass (kg)."""
    return float((mass / BALL_DENSITY) ** (1.0 / 3.0))


TURNS = 6
"""Teeth of a zigzag."""


def zigzag(ends: ArrayLike, across: ArrayLike) -> Array:
    """Corners (k, 2) of a spring from one end to the other, straight for a while at both."""
    (first, last), teeth = np.asarray(ends, dtype=float), np.resize([1.0, -1.0], 2 * TURNS - 1)
    share = np.concatenate([[0.0], np.linspace(0.2, 0.8, 2 * TURNS + 1), [1.0]])
    side = np.concatenate([[0.0, 0.0], teeth, [0.0, 0.0]])
    return np.asarray(first + share[:, None] * (last - first) + side[:, None] * np.asarray(across))


@dataclass(frozen=True)
class DrawnContact:
    """A ball, an absorber or a stop as pictures show it; fields are those of `ContactPair`, but for the law."""

    name: str
    position: float  # m
    mass: float  # kg: infinite for a stop
    gaps: tuple[float, float]  # m: on the + and on the - side
    fixed_to: str = "base"
    law: str = ""  # its name; empty where it is not known
    free_stiffness: float = math.nan  # N/m and N s/m, of an absorber
    free_damping: float = math.nan
    between: tuple[str, ...] = ()  # names of balls that meet

    @property
    def is_stop(self) -> bool:
        """True of what moves no ball of its own: a fixed obstacle, or two balls that meet."""
        return math.isinf(self.mass)

    @property
    def kind(self) -> str:
        """The key of the part in study files: "stop", "meeting", "absorber" or "impactor"."""
        if self.is_stop:
            return "meeting" if self.between else "stop"
        return "impactor" if math.isnan(self.free_stiffness) else "absorber"


Contact = ContactPair | DrawnContact


@dataclass(frozen=True, eq=False)
class DrawnSystem:
    """Places, contacts and curves between the nodes of a system, under the same names, for pictures."""

    nodes: Array  # (n,) m
    points: Mapping[str, float]  # m
    contacts: tuple[DrawnContact, ...] = ()  # balls first, then absorbers and stops
    total_mass: float = math.nan  # kg
    first_frequency: float = math.nan  # Hz: not a number where it was not kept
    # (Hz, 1) natural frequencies and damping ratios of the lowest modes, where they were kept
    modes: tuple[Array, Array] = field(default_factory=lambda: (np.zeros(0), np.zeros(0)))
    beam: Beam | None = None  # whose segments say where it shears

    @property
    def dofs(self) -> int:
        """Number of nodal values: deflection and slope of each node."""
        return 2 * self.nodes.size

    @property
    def balls(self) -> tuple[DrawnContact, ...]:
        """The contacts that are balls."""
        return tuple(contact for contact in self.contacts if not contact.is_stop)

    @property
    def meetings(self) -> dict[int, tuple[int, int]]:
        """Of the contacts that are balls that meet, by their number: those of the two balls."""
        return meetings_of(self.contacts)

    def position_of(self, at: Position) -> float:
        """Metres from the root of a place."""
        return float(self.points[at] if isinstance(at, str) else at)

    def nodal_rows(self, positions: ArrayLike, derivative: int = 0) -> Matrix:
        """Sparse rows that read the deflection or its turn from nodal values (w1, w1', w2, w2', ...)."""
        beam, middles = self.beam, 0.5 * (self.nodes[1:] + self.nodes[:-1])
        shear = np.array([beam.segments[beam.segment_index_at(x)].shear_length for x in middles if beam is not None])
        return hermite_rows(self.nodes, positions, derivative, shear_lengths=shear if shear.any() else None)

    def deflection_rows(self, positions: ArrayLike) -> Array:
        """Rows that read the deflection from nodal values (w1, w1', w2, w2', ...)."""
        return np.asarray(self.nodal_rows(positions).toarray())


def drawn_system(
    structure: Structure,
    points: Mapping[str, float],  # m: places that a mesh or a system names
) -> DrawnSystem:
    """The places and contacts of a structure that is not assembled; KeyError for a place that has no name there."""
    length = structure.beam.length
    system = DrawnSystem(np.zeros(0), {"root": 0.0, "tip": length, "mid": 0.5 * length, **points}, beam=structure.beam)

    def drawn(part: Impactor | Absorber | Stop, mass: float, fixed_to: str = "base") -> DrawnContact:
        place = system.position_of(structure.place_of(part.at))
        hung = (part.stiffness, part.damping) if isinstance(part, Absorber) else ()
        return DrawnContact(part.name, place, mass, part.gaps, fixed_to, part.contact.name, *hung)

    balls = [drawn(ball, ball.mass) for ball in structure.impactors]
    balls += [drawn(body, body.mass) for body in structure.absorbers]
    others = [drawn(stop, math.inf, stop.fixed_to) for stop in structure.stops]
    places = {ball.name: ball.position for ball in balls}
    for item in structure.meetings:
        at = places[item.between[0]]
        others.append(DrawnContact(item.name, at, math.inf, item.gaps, law=item.contact.name, between=item.between))
    return replace(system, contacts=(*balls, *others))


def offsets_of(structure: Structure, exaggeration: float = 1.0) -> dict[str, float]:
    """Distances (m) from the axis at which balls are drawn that stand at their zero, by name.

    Balls that meet are drawn beside one another about the middle of their box, with gaps so many times as large; a ball
    that meets no other is on the axis.
    """
    radius, offsets = {ball.name: ball_radius(ball.mass) for ball in structure.impactors}, dict[str, float]()
    for name in radius:
        together = {} if name in offsets else {name: 0.0}
        # as often as there are meetings: the order of the file is any
        for meeting in [*structure.meetings] * len(structure.meetings):
            first, second = meeting.between
            apart = exaggeration * meeting.gap + radius[first] + radius[second]
            if first in together:
                together.setdefault(second, together[first] + apart)
            elif second in together:
                together[first] = together[second] - apart
        ends = [sign * max(sign * at + radius[one] for one, at in together.items()) for sign in (1, -1) if together]
        offsets |= {one: at - 0.5 * sum(ends) for one, at in together.items()}
    return offsets


def travel_of(ball: Contact, structure: Structure) -> tuple[float, float]:
    """Free travel (m) of a ball to the + and to the - side, to a wall or to a ball that stands at its zero."""
    met = {(meeting.between[k], k): meeting.gap for meeting in structure.meetings for k in (0, 1)}
    plus, minus = (min(gap, met.get((ball.name, k), math.inf)) for k, gap in enumerate(ball.gaps))
    return plus, minus


@dataclass(frozen=True, eq=False)
class PlacedStructure:
    """A structure, the contacts of its system, and its other parts with their places (m from the root)."""

    structure: Structure
    contacts: Sequence[Contact]
    supports: tuple[tuple[Support, float], ...]
    bodies: tuple[tuple[PointMass, float], ...]
    # of one place where they are fixed to the base
    connections: tuple[tuple[Spring | Dashpot, tuple[float, ...]], ...]

    @property
    def length(self) -> float:
        """Length (m) of the beam."""
        return self.structure.beam.length

    def at(self, x: float) -> list[PointMass]:
        """Bodies at a place (m from the root)."""
        return [body for body, place in self.bodies if abs(place - x) <= SAME * self.length]

    def box_of(self, ball: Contact) -> PointMass | None:
        """The body that is a ball's box: the heaviest at its place; None where there is none, and of all but balls."""
        if ball.kind != "impactor":
            return None
        return max(self.at(ball.position), key=lambda body: body.mass, default=None)

    def box_ends(self, ball: Contact) -> tuple[float, float]:
        """Both ends (m from the root) of a ball's box: its middle is the centre of the body that it is."""
        masses = [other.mass for other in self.contacts if other.name in {ball.name, *self.met_by(ball)}]
        half, box = 1.3 * ball_radius(max(masses)), self.box_of(ball)
        shift = 2.0 * box.offset if box else 0.0
        return ball.position - half + min(shift, 0.0), ball.position + half + max(shift, 0.0)

    def half_height(self, x: float, exaggeration: float = 1.0) -> float:
        """Distance (m) from the axis to the top of the beam, and of cubes and boxes on it, at a place (m)."""
        near = SAME * self.length
        tops = [0.5 * self.structure.beam.drawn_at(min(max(x, 0.0), self.length))[1]]
        tops += [0.5 * body_side(body.mass) for body, place in self.blocks if abs(place - x) <= near]
        boxed = [c for c in self.contacts if c.kind == "impactor" and abs(c.position - x) <= near]
        return max(tops + [self.inner_faces(ball, exaggeration)[0] + 0.3 * ball_radius(ball.mass) for ball in boxed])

    def met_by(self, ball: Contact) -> set[str]:
        """Names of the balls that a ball meets."""
        pairs = (set(meeting.between) for meeting in self.structure.meetings)
        return {name for pair in pairs if ball.name in pair for name in pair - {ball.name}}

    def inner_faces(self, ball: Contact, exaggeration: float = 1.0) -> tuple[float, float]:
        """Where (m) a ball's surface is at the end of its travel to the + and to the - side, as drawn."""
        radius, middle = ball_radius(ball.mass), offsets_of(self.structure, exaggeration).get(ball.name, 0.0)
        plus, minus = (exaggeration * (gap if gap < math.inf else 0.0) for gap in travel_of(ball, self.structure))
        return middle + plus + radius, middle - minus - radius

    @property
    def blocks(self) -> list[tuple[PointMass, float]]:
        """Bodies that are drawn as cubes, with their places: those with a mass that are no ball's box."""
        boxes = [self.box_of(contact) for contact in self.contacts]
        return [(body, x) for body, x in self.bodies if body.mass > 0.0 and all(body is not box for box in boxes)]


def placed_structure(structure: Structure, system: System | DrawnSystem) -> PlacedStructure:
    """A structure with its parts where its system has them."""

    def place(at: Position) -> float:
        return system.position_of(structure.place_of(at))

    return PlacedStructure(
        structure,
        # balls that meet are drawn as balls; the pair, which comes after all others, has no body
        [pair for pair in system.contacts if not pair.between],
        tuple((support, place(support.at)) for support in structure.supports),
        tuple((body, place(body.at)) for body in structure.masses),
        tuple((item, tuple(map(place, ends.values()))) for _, item, ends in structure.connections),
    )
