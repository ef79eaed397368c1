"""The beam as a solid with what is on it: static geometry, and how every point of it moves."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, quantity
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.scene.placed import (
    SAME,
    Contact,
    PlacedStructure,
    ball_radius,
    body_side,
    offsets_of,
    placed_structure,
    travel_of,
)
from femimpact.structure.beam import Segment
from femimpact.structure.structure import PointMass, Structure
from femimpact.system.matrices import Matrix
from femimpact.system.system import System

BEAM, BOX, BALL, SUPPORT, BODY, STOP, CONTACT_POINT, CONNECTION = range(8)
PARTS = ("beam", "box", "ball", "support", "body", "stop", "contact point", "spring or dashpot")
"""Names of the values of the cell array `part`."""

VERTEX, LINE, TRIANGLE, QUAD, HEXAHEDRON, WEDGE = 1, 3, 5, 9, 12, 13

STATIONS = 120
"""Cells along the beam, at least."""

MOST_STATIONS = 2000
"""Cells along the beam beyond which not every node of the mesh has a separate section."""

HEXAHEDRON_CELL = [(HEXAHEDRON, list(range(8)))]
"""The one cell of a block."""


@dataclass(frozen=True, eq=False)
class Body:
    """A part of what is drawn: its solid at rest, and what moves it.

    The first four points of a block are its outline in the plane of motion.
    """

    part: int  # number in `PARTS`
    points: Array  # (k, 3) m
    cells: list[tuple[int, list[int]]]  # type, and numbers of points
    axis: Any  # m: x of the section that moves it, or of each point (k,); not a number where none does
    pair: int = -1  # number of the contact, -1 for none
    side: int = 0  # of a wall or a point of contact, +1 or -1
    ball: Any = -1  # number of the ball that carries it, or of each point (k,); -1 for none
    in_space: bool = False  # whether it is fixed in space, not with the base
    reaction: bool = False  # whether the force that is shown at a point of contact is that on the other body

    @property
    def outline(self) -> Array:
        """Corners (4, 2), x and y in m, of a block."""
        return self.points[:4, :2]


@dataclass(frozen=True, eq=False)
class Outline:
    """A cross-section of height 1 and width 1 about the axis, and the cells of a stretch of it."""

    points: Array  # (k, 2) y along the motion, z across it
    kind: int  # of the cells between two sections
    cells: NDArray[np.int64]  # (cells, corners) points of the first section
    area: Array  # (cells,) of each cell
    share: Array  # (cells,) of each cell in the second moment, which is 1 of all

    def cells_between(self, first: int) -> list[tuple[int, list[int]]]:
        """Cells from the section whose points begin at a number to the next section."""
        return [(self.kind, [*(first + cell), *(first + self.points.shape[0] + cell)]) for cell in self.cells]


AROUND = 24
"""Points around a round bar, or a tube."""


def outline_of(segment: Segment) -> Outline:
    """The outline of a segment: of a round bar wedges, of a tube blocks around its hole, otherwise one block."""
    if segment.diameter is None:
        corners = 0.5 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        return Outline(corners, HEXAHEDRON, np.arange(4)[None], np.ones(1), np.ones(1))
    turn = 2.0 * np.pi * np.arange(AROUND) / AROUND
    ring, i = 0.5 * np.column_stack([np.sin(turn), np.cos(turn)]), np.arange(AROUND)
    k = (i + 1) % AROUND
    if segment.wall is None:
        hole, points, cells, kind = 0.0, np.vstack([ring, np.zeros(2)]), [np.full(AROUND, AROUND), k, i], WEDGE
    else:
        hole = 1.0 - 2.0 * segment.wall / segment.diameter
        points, cells, kind = np.vstack([ring, hole * ring]), [k, i, AROUND + i, AROUND + k], HEXAHEDRON
    # of the triangle from the axis to a side: its area, and the integral of y^2 over it, times 6 / area
    area = 0.125 * math.sin(2.0 * math.pi / AROUND) * (1.0 - hole**2)
    square = ring[i, 0] ** 2 + ring[i, 0] * ring[k, 0] + ring[k, 0] ** 2
    return Outline(points, kind, np.column_stack(cells), np.full(AROUND, area), square / square.sum())


def sections_along(structure: Structure, stations: Array) -> tuple[Segment, Array]:
    """The segment that holds one stretch, and its width and height (m) as drawn at the stations, (stations, 2)."""
    beam, middle = structure.beam, 0.5 * float(stations[0] + stations[-1])
    i = beam.segment_index_at(middle)
    segment, start = beam.segments[i], beam.joints[i]
    return segment, np.array([segment.drawn_at(float(x) - start) for x in stations])


def _block(low: tuple[float, float, float], high: tuple[float, float, float]) -> Array:
    """Corners of a box in VTK's order of a hexahedron."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    lower = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]
    return np.array(lower + [(x, y, z1) for x, y, _ in lower])


def stretches_of(
    nodes: Array,  # (n,) m
    cuts: Any,  # m: where a section jumps or a force acts
    subdivisions: int = 1,  # cells for each element, at least
) -> tuple[Array, ...]:
    """Positions (m) of sections along the beam, stretch by stretch: a cut belongs to both stretches beside it.

    Every node of the mesh is among them, and sections between, so that there are at least 120 cells; of a mesh with
    more than 2000 elements not every node is.
    """
    start, end = float(nodes[0]), float(nodes[-1])
    slack = SAME * (end - start)
    inner = [x for x in sorted(float(cut) for cut in cuts) if start + slack < x < end - slack]
    bounds = [start]
    bounds += [x for i, x in enumerate(inner) if i == 0 or x - inner[i - 1] > slack]
    return tuple(_stations(nodes, a, b, subdivisions, slack) for a, b in itertools.pairwise([*bounds, end]))


def _stations(nodes: Array, start: float, end: float, subdivisions: int, slack: float) -> Array:
    share = (end - start) / (nodes[-1] - nodes[0])
    between = nodes[(nodes > start + slack) & (nodes < end - slack)]
    most = max(math.ceil(MOST_STATIONS * share), 2)
    if between.size >= most:
        between = between[np.linspace(0, between.size - 1, most - 1).round().astype(int)]
    knots = np.concatenate([[start], between, [end]])
    elements = knots.size - 1
    pieces = max(min(max(subdivisions, math.ceil(STATIONS * share / elements)), most // elements), 1)
    inner = [np.linspace(a, b, pieces, endpoint=False) for a, b in itertools.pairwise(knots)]
    return np.concatenate([*inner, knots[-1:]])


def beam_bodies(placed: PlacedStructure, nodes: Array, subdivisions: int = 1) -> tuple[list[Body], tuple[Array, ...]]:
    """A body for each stretch of the beam, with cells between sections of one outline; and the stretches of sections.

    A stretch ends where a section jumps or a force acts, so that steps of the section show. Along a linear taper the
    faces are plane, and the cells have the volume of the beam.
    """
    held = [*(x for _, x in placed.bodies), *(x for _, x in placed.supports)]
    held += [x for _, places in placed.connections for x in places]
    cuts = [*placed.structure.beam.joints, *held, *(pair.position for pair in placed.contacts)]
    stretches, bodies = stretches_of(nodes, cuts, subdivisions), []
    for stations in stretches:
        segment, sizes = sections_along(placed.structure, stations)
        outline = outline_of(segment)
        count = outline.points.shape[0]
        corners = sizes[:, None, ::-1] * outline.points
        points = np.concatenate([np.repeat(stations, count)[:, None], corners.reshape(-1, 2)], axis=1)
        cells = [cell for i in range(len(stations) - 1) for cell in outline.cells_between(count * i)]
        bodies.append(Body(BEAM, points, cells, points[:, 0]))
    return bodies, stretches


def box_of_ball(j: int, ball: Contact, placed: PlacedStructure, width: float, exaggeration: float) -> list[Body]:
    """The walls that a ball can meet and a floor on the beam's upper edge; the inner faces stop the ball's surface."""
    x, radius = ball.position, ball_radius(ball.mass)
    wall, floor = 0.3 * radius, 0.5 * width
    inner, (left, right), top = placed.inner_faces(ball, exaggeration), placed.box_ends(ball), floor + wall + 2 * radius
    blocks = {
        1: _block((left, inner[0], floor), (right, inner[0] + wall, top)),
        -1: _block((left, inner[1] - wall, floor), (right, inner[1], top)),
        0: _block((left, inner[1], floor), (right, inner[0], floor + wall)),
    }
    met = {1: ball.gaps[0], -1: ball.gaps[1], 0: 0.0}
    return [Body(BOX, corners, HEXAHEDRON_CELL, x, j, side) for side, corners in blocks.items() if met[side] < math.inf]


def sphere(j: int, ball: Contact, centre: Array, rings: int = 10, around: int = 20) -> Body:
    """A ball of quadrilaterals with triangles at its poles."""
    polar = np.pi * np.arange(1, rings) / rings
    turn = 2.0 * np.pi * np.arange(around) / around
    belt = np.array([(np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)) for p in polar for t in turn])
    points = centre + ball_radius(ball.mass) * np.vstack([belt, [(0, 0, 1), (0, 0, -1)]])
    north, south = len(belt), len(belt) + 1
    cells: list[tuple[int, list[int]]] = []
    for i in range(around):
        k = (i + 1) % around
        cells.append((TRIANGLE, [north, i, k]))
        last = (rings - 2) * around
        cells.append((TRIANGLE, [south, last + k, last + i]))
        for r in range(rings - 2):
            cells.append((QUAD, [r * around + i, (r + 1) * around + i, (r + 1) * around + k, r * around + k]))
    return Body(BALL, points, cells, math.nan, j, ball=j)


def cube(body: PointMass, x: float, width: float) -> Body:
    """A steel cube of a body's mass below the beam's lower edge; the section at x carries it."""
    side, centre = body_side(body.mass), x + body.offset
    low, high = -0.5 * width - side, -0.5 * width
    corners = _block((centre - 0.5 * side, -0.5 * side, low), (centre + 0.5 * side, 0.5 * side, high))
    return Body(BODY, corners, HEXAHEDRON_CELL, x)


def support_block(
    kind: str,  # of `Support`
    x: float,  # m: place, and length of the beam
    length: float,  # m
    section: tuple[float, float],  # pair of float, m: width and thickness of the beam there
) -> Body:
    """A block that holds the beam; one that only holds the slope is a sleeve which moves along with the beam.

    A pinned support is a thin block.
    """
    thick, width = (0.004 if kind == "pinned" else 0.02) * length, 1.2 * section[0]
    high = 0.5 * section[1] + (0.015 if kind == "guided" else 0.05) * length
    # at an end the beam comes out of it
    centre = x - 0.5 * thick if x <= SAME * length else x + 0.5 * thick if x >= (1.0 - SAME) * length else x
    corners = _block((centre - 0.5 * thick, -high, -0.5 * width), (centre + 0.5 * thick, high, 0.5 * width))
    return Body(SUPPORT, corners, HEXAHEDRON_CELL, x if kind == "guided" else math.nan)


def connection(places: tuple[float, ...], length: float, level: int) -> Body:
    """Lines from the beam's axis at two places (m) to beside it, and between these; or from one place to the base.

    The beam is straight at rest, and would hide a line from place to place. The sections carry the legs; those of
    one level are equally long.
    """
    if len(places) == 1:
        (x,) = places
        return Body(
            CONNECTION, np.array([(x, 0.0, 0.0), (x, -0.1 * length, 0.0)]), [(LINE, [0, 1])], np.array([x, math.nan])
        )
    leg = (0.04 + 0.015 * level) * length
    points = np.array([(x, y, 0.0) for x in places for y in (0.0, -leg)])
    return Body(CONNECTION, points, [(LINE, [0, 1]), (LINE, [2, 3]), (LINE, [1, 3])], points[:, 0])


def stop_blocks(j: int, stop: Contact, structure: Structure, exaggeration: float) -> list[Body]:
    """A block on each closed side, whose face the beam's surface touches, with the points of contact of both."""
    x, in_space, section = stop.position, stop.fixed_to == "space", structure.beam.drawn_at(stop.position)
    half, thick, width = 0.5 * section[1], 0.02 * structure.beam.length, 1.2 * section[0]
    bodies = []
    for side, gap in ((1, stop.gaps[0]), (-1, stop.gaps[1])):
        if not math.isfinite(gap):
            continue
        face = exaggeration * gap + half
        low, high = sorted((side * face, side * (face + thick)))
        corners = _block((x - 0.5 * thick, low, -0.5 * width), (x + 0.5 * thick, high, 0.5 * width))
        bodies += [
            Body(STOP, corners, HEXAHEDRON_CELL, math.nan, j, side, in_space=in_space),
            # in front of the stop, or it would hide the arrows that begin there
            mark((x, side * half, 0.6 * width), x, j, side),
            mark((x, side * face, 0.6 * width), math.nan, j, side, in_space=in_space, reaction=True),
        ]
    return bodies


def mark(point: Any, axis: float, pair: int, side: int, **fixed: Any) -> Body:
    """A point of contact."""
    return Body(CONTACT_POINT, np.array([point]), [(VERTEX, [0])], axis, pair, side, **fixed)


def ball_bodies(j: int, ball: Contact, placed: PlacedStructure, exaggeration: float) -> list[Body]:
    """A ball in its box with the points of contact, or an absorber's body on a post and a line for its spring."""
    x, radius = ball.position, ball_radius(ball.mass)
    width, _ = placed.structure.beam.drawn_at(x)
    middle = offsets_of(placed.structure, exaggeration).get(ball.name, 0.0)
    centre = np.array([x, middle, 0.5 * width + 0.3 * radius + radius])
    # in front of the ball, or the ball would hide the arrows that begin there
    height = float(centre[2]) + 1.3 * radius
    if ball.kind == "absorber":
        top = height - 1.3 * radius
        points = np.array([(x, 0.0, 0.5 * width), (x, 0.0, top), (x, 0.0, top)])
        lines = [(LINE, [0, 1]), (LINE, [1, 2])]
        post = Body(CONNECTION, points, lines, np.array([x, x, math.nan]), j, ball=np.array([-1, -1, j]))
        return [sphere(j, ball, centre), post]
    bodies = [*box_of_ball(j, ball, placed, width, exaggeration), sphere(j, ball, centre)]
    for side, gap, face in zip((1, -1), ball.gaps, placed.inner_faces(ball, exaggeration), strict=True):
        if gap < math.inf:
            bodies.append(mark((x, face, height), x, j, side))
            bodies.append(mark((x, middle + side * radius, height), math.nan, j, side, ball=j, reaction=True))
    # of balls that meet, whose pairs come after those of all bodies, the second feels the force, the first the reaction
    numbers = {contact.name: k for k, contact in enumerate(placed.contacts)}
    for pair, meeting in enumerate(placed.structure.meetings, start=len(placed.contacts)):
        if ball.name in meeting.between and numbers.keys() >= set(meeting.between):
            first = ball.name == meeting.between[0]
            point = (x, middle + (radius if first else -radius), height)
            bodies.append(mark(point, math.nan, pair, 1, ball=j, reaction=first))
    return bodies


def bodies_on_beam(placed: PlacedStructure, exaggeration: float = 1.0) -> list[Body]:
    """Supports, bodies, springs, dashpots, balls in their boxes and stops, with clearances so many times as large."""
    structure, length = placed.structure, placed.length
    beam = structure.beam
    bodies = [support_block(support.kind, x, length, beam.drawn_at(x)) for support, x in placed.supports]
    bodies += [cube(body, x, beam.drawn_at(x)[0]) for body, x in placed.blocks]
    bodies += [connection(places, length, level) for level, (_, places) in enumerate(placed.connections)]
    for j, pair in enumerate(placed.contacts):
        if pair.is_stop:
            bodies += stop_blocks(j, pair, structure, exaggeration)
        else:
            bodies += ball_bodies(j, pair, placed, exaggeration)
    return bodies


EXAGGERATION: Any = quantity("1", above=0.0, at_most=1e9)
"""Factor by which motion and clearance are drawn larger."""

SWING = 0.08
"""Share of the beam's length that swing and gap fill where the factor is chosen."""


def chosen_exaggeration(
    deflection: Array,  # m
    motion: Array,  # (times, balls) m
    structure: Structure,
    balls: Sequence[Contact],
) -> float:
    """Factor, of one digit, with which the largest deflection and gap are a good size beside the beam."""
    gaps = [gap for pair in balls for gap in travel_of(pair, structure) if gap < math.inf]
    hung = motion[:, [pair.kind == "absorber" for pair in balls]]
    reach = float(np.abs(np.hstack([deflection, hung])).max()) + max(gaps, default=0.0)
    return float(f"{SWING * structure.beam.length / max(reach, 1e-12):.1g}")


@dataclass(frozen=True, eq=False)
class Scene:
    """Points, cells and the linear map from the motion to the points.

    x runs along the beam, y is the direction of motion, z the beam's width. The slope turns a
    cross-section or a box as a rigid body, to first order.
    """

    bodies: tuple[Body, ...]  # the stretches of the beam first
    first: NDArray[np.int64]  # (bodies,) number of the first point of each
    # (points, 3) m: at rest; clearances already exaggerated. Those of the beam come first, section by section.
    points: Array
    connectivity: NDArray[np.int64]  # cells in VTK's form: points of all, the end of each among these, and its type
    offsets: NDArray[np.int64]
    types: NDArray[np.uint8]
    part: NDArray[np.int32]  # (cells,) number in `PARTS`; number of the contact pair, -1 where there is none
    pair: NDArray[np.int32]  # (cells,)
    deflection: Matrix  # csr_array (points, 2 nodes) rows that read w and dw/dx at each point's section
    slope: Matrix  # csr_array (points, 2 nodes)
    arm: Array  # (points, 2) m: offset (x, y) of each point from the axis point that it is fixed to
    carried: Matrix  # csr_array (points, balls) 1 where a point belongs to a ball
    in_space: NDArray[np.bool_]  # (points,) whether a point is fixed in space
    # m: positions of the beam's sections; a jump of the section or a force lies between two stretches
    stretches: tuple[Array, ...]
    # (marks, 4) points of contact: point, pair, side, and 1 where the force on the ball or the stop is shown
    marks: NDArray[np.int64]
    exaggeration: float

    def motion(
        self,
        nodal: Array,  # relative to the base
        balls: Array,
        base: float = 0.0,  # motion of the base, and of what is fixed in space, in the frame that is drawn
        space: float = 0.0,
    ) -> Array:
        """Displacements (or velocities) of all points, ndarray (points, 3), without exaggeration."""
        slope = self.slope @ nodal
        result = np.zeros_like(self.points)
        result[:, 0] = -self.arm[:, 1] * slope
        result[:, 1] = self.deflection @ nodal + self.arm[:, 0] * slope + self.carried @ balls
        result[:, 1] += np.where(self.in_space, space, base)
        return result

    def rotation(self, nodal: Array) -> Array:
        """Turns of the sections about z at all points, ndarray (points, 3); 0 of what hangs on no section."""
        result = np.zeros_like(self.points)
        result[:, 2] = self.slope @ nodal
        return result

    def displacement(self, nodal: Array, balls: Array, base: float = 0.0, space: float = 0.0) -> Array:
        """Exaggerated displacement (points, 3), m, of a state; see `motion`."""
        return self.exaggeration * self.motion(nodal, balls, base, space)


def build_scene(
    structure: Structure,
    system: System,  # gives nodes and contact pairs
    exaggeration: float = 1.0,  # scales motion and clearance together, so that a ball stays in its box
    subdivisions: int = 1,  # cells of the beam for each element, at least
) -> Scene:
    """The beam of its real cross-section, and all that is on it or beside it.

    A body at the place of a ball is its box, and no cube beside it.
    """
    placed = placed_structure(structure, system)
    stretched, stretches = beam_bodies(placed, system.nodes, subdivisions)
    bodies = [*stretched, *bodies_on_beam(placed, exaggeration)]
    sizes = [len(body.points) for body in bodies]
    first = np.cumsum([0, *sizes])
    points = np.concatenate([body.points for body in bodies])
    axis, ball, in_space = (
        np.concatenate([np.broadcast_to(getattr(body, name), size) for body, size in zip(bodies, sizes, strict=True)])
        for name in ("axis", "ball", "in_space")
    )
    held = np.isfinite(axis)
    fixed, place = sparse.diags_array(held.astype(float)), np.where(held, axis, system.nodes[0])
    carried = np.flatnonzero(ball >= 0)
    cells = [
        (kind, at + np.array(cell), body) for body, at in zip(bodies, first, strict=False) for kind, cell in body.cells
    ]
    marks = [
        (at, body.pair, body.side, body.reaction)
        for body, at in zip(bodies, first, strict=False)
        if body.part == CONTACT_POINT
    ]
    return Scene(
        bodies=tuple(bodies),
        first=first[:-1],
        points=points,
        connectivity=np.concatenate([cell for _, cell, _ in cells]).astype(np.int64),
        offsets=np.cumsum([len(cell) for _, cell, _ in cells]).astype(np.int64),
        types=np.array([kind for kind, _, _ in cells], dtype=np.uint8),
        part=np.array([body.part for _, _, body in cells], dtype=np.int32),
        pair=np.array([body.pair for _, _, body in cells], dtype=np.int32),
        deflection=sparse.csr_array(fixed @ system.nodal_rows(place)),
        slope=sparse.csr_array(fixed @ system.nodal_rows(place, 1)),
        # what hangs on no section has no arm
        arm=np.where(held[:, None], np.column_stack([points[:, 0] - place, points[:, 1]]), 0.0),
        carried=sparse.csr_array(
            (np.ones(carried.size), (carried, ball[carried])), shape=(len(points), len(system.balls))
        ),
        in_space=in_space,
        stretches=stretches,
        marks=np.array(marks, dtype=np.int64).reshape(-1, 4),
        exaggeration=exaggeration,
    )


def snapshots_of(response: Response) -> Snapshots:
    """The snapshots of a response, or an error that says how to get them."""
    if response.snapshots is None or response.snapshots.time.size == 0:
        raise InputError(
            [Fault("snapshots", None, "", "the response holds none: integrate with Recorder(snapshots=STRIDE)")]
        )
    return response.snapshots
