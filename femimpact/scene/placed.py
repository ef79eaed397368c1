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
from femimpact.system.contact_pair import ContactPair
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

    @property
    def is_stop(self) -> bool:
        """True of a fixed obstacle, false of a ball."""
        return math.isinf(self.mass)

    @property
    def has_walls(self) -> bool:
        """False of an absorber."""
        return min(self.gaps) < math.inf


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
    stops = [drawn(stop, math.inf, stop.fixed_to) for stop in structure.stops]
    return replace(system, contacts=(*balls, *stops))


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
        if ball.is_stop or not ball.has_walls:
            return None
        return max(self.at(ball.position), key=lambda body: body.mass, default=None)

    def box_ends(self, ball: Contact) -> tuple[float, float]:
        """Both ends (m from the root) of a ball's box: its middle is the centre of the body that it is."""
        half, box = 1.3 * ball_radius(ball.mass), self.box_of(ball)
        shift = 2.0 * box.offset if box else 0.0
        return ball.position - half + min(shift, 0.0), ball.position + half + max(shift, 0.0)

    def half_height(self, x: float, exaggeration: float = 1.0) -> float:
        """Distance (m) from the axis to the top of the beam, and of cubes and boxes on it, at a place (m)."""
        near = SAME * self.length
        tops = [0.5 * self.structure.beam.drawn_at(min(max(x, 0.0), self.length))[1]]
        tops += [0.5 * body_side(body.mass) for body, place in self.blocks if abs(place - x) <= near]
        boxed = [c for c in self.contacts if c.has_walls and not c.is_stop and abs(c.position - x) <= near]
        return max(tops + [exaggeration * pair.gaps[0] + 1.3 * ball_radius(pair.mass) for pair in boxed])

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
        system.contacts,
        tuple((support, place(support.at)) for support in structure.supports),
        tuple((body, place(body.at)) for body in structure.masses),
        tuple((item, tuple(map(place, ends.values()))) for _, item, ends in structure.connections),
    )
