"""The beam as a solid with what is on it: static geometry, and how every point of it moves."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, quantity
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.scene.placed import SAME, Contact, PlacedStructure, ball_radius, body_side, placed_structure
from femimpact.structure.beam import Segment
from femimpact.structure.structure import PointMass, Structure
from femimpact.system.hermite import hermite_rows
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

BLOCK = list(range(8))


@dataclass
class Pieces:
    """Points and cells of a scene while it is built, one entry for each piece or each point."""

    points: list[Array] = field(default_factory=list)  # (k, 3) m
    # (k,) m: x of the section that moves each point; not a number where none does
    axis: list[Array] = field(default_factory=list)
    # (k,) number of the ball that carries each point, -1 otherwise
    ball: list[NDArray[np.int64]] = field(default_factory=list)
    # (k,) whether a point is fixed in space, not with the base
    in_space: list[NDArray[np.bool_]] = field(default_factory=list)
    cells: list[tuple[int, list[int], int, int]] = field(default_factory=list)  # (type, points, part, pair)
    # (point, pair, side, reaction) points of contact: side +1 or -1, and whether what is shown there is the force on
    # the other body
    marks: list[tuple[int, int, int, bool]] = field(default_factory=list)
    count: int = 0

    def add(
        self, points: Array, axis: Any, cells: list[tuple[int, list[int]]], part: int, pair: int, ball: int = -1,
        in_space: bool = False,
    ) -> None:  # fmt: skip
        """Add points that move in the same way, and the cells between them."""
        first, size = self.count, len(points)
        self.points.append(points)
        self.axis.append(np.broadcast_to(np.asarray(axis, dtype=float), size))
        self.ball.append(np.full(size, ball))
        self.in_space.append(np.full(size, in_space))
        self.cells += [(kind, [first + i for i in nodes], part, pair) for kind, nodes in cells]
        self.count += size

    def mark(
        self, point: Any, axis: float, pair: int, side: int, reaction: bool, ball: int = -1, in_space: bool = False
    ) -> None:
        """Add a point of contact."""
        self.marks.append((self.count, pair, side, reaction))
        self.add(np.array([point]), axis, [(VERTEX, [0])], CONTACT_POINT, pair, ball, in_space)


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


def add_beam(pieces: Pieces, placed: PlacedStructure, nodes: Array, subdivisions: int = 1) -> tuple[Array, ...]:
    """Cells between sections of one outline; the stretches of sections, none of which is shared.

    A stretch ends where a section jumps or a force acts, so that steps of the section show. Along a linear taper the
    faces are plane, and the cells have the volume of the beam.
    """
    held = [*(x for _, x in placed.bodies), *(x for _, x in placed.supports)]
    held += [x for _, places in placed.connections for x in places]
    cuts = [*placed.structure.beam.joints, *held, *(pair.position for pair in placed.contacts)]
    stretches = stretches_of(nodes, cuts, subdivisions)
    for stations in stretches:
        segment, sizes = sections_along(placed.structure, stations)
        outline = outline_of(segment)
        count = outline.points.shape[0]
        corners = sizes[:, None, ::-1] * outline.points
        points = np.concatenate([np.repeat(stations, count)[:, None], corners.reshape(-1, 2)], axis=1)
        cells = [cell for i in range(len(stations) - 1) for cell in outline.cells_between(count * i)]
        pieces.add(points, points[:, 0], cells, BEAM, -1)
    return stretches


def add_box(
    pieces: Pieces, j: int, ball: Contact, ends: tuple[float, float], width: float, exaggeration: float
) -> None:
    """Two end walls and a floor on the beam's upper edge; the inner faces stop the ball's surface."""
    x, radius = ball.position, ball_radius(ball.mass)
    wall, floor = 0.3 * radius, 0.5 * width
    inner = (exaggeration * ball.gaps[0] + radius, -exaggeration * ball.gaps[1] - radius)
    (left, right), top = ends, floor + wall + 2.0 * radius
    blocks = [
        _block((left, inner[0], floor), (right, inner[0] + wall, top)),
        _block((left, inner[1] - wall, floor), (right, inner[1], top)),
        _block((left, inner[1], floor), (right, inner[0], floor + wall)),
    ]
    for corners in blocks:
        pieces.add(corners, x, [(HEXAHEDRON, BLOCK)], BOX, j)


def add_ball(pieces: Pieces, j: int, ball: Contact, width: float, rings: int = 10, around: int = 20) -> Array:
    """A sphere of quadrilaterals with triangles at its poles; its centre (3,) in m."""
    radius = ball_radius(ball.mass)
    centre = np.array([ball.position, 0.0, 0.5 * width + 0.3 * radius + radius])
    polar = np.pi * np.arange(1, rings) / rings
    turn = 2.0 * np.pi * np.arange(around) / around
    belt = np.array([(np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)) for p in polar for t in turn])
    points = centre + radius * np.vstack([belt, [(0, 0, 1), (0, 0, -1)]])
    north, south = len(belt), len(belt) + 1
    cells: list[tuple[int, list[int]]] = []
    for i in range(around):
        k = (i + 1) % around
        cells.append((TRIANGLE, [north, i, k]))
        last = (rings - 2) * around
        cells.append((TRIANGLE, [south, last + k, last + i]))
        for r in range(rings - 2):
            cells.append((QUAD, [r * around + i, (r + 1) * around + i, (r + 1) * around + k, r * around + k]))
    pieces.add(points, math.nan, cells, BALL, j, ball=j)
    return centre


def add_body(pieces: Pieces, body: PointMass, x: float, width: float) -> None:
    """A steel cube of a body's mass below the beam's lower edge; the section at x carries it."""
    side, centre = body_side(body.mass), x + body.offset
    low, high = -0.5 * width - side, -0.5 * width
    corners = _block((centre - 0.5 * side, -0.5 * side, low), (centre + 0.5 * side, 0.5 * side, high))
    pieces.add(corners, x, [(HEXAHEDRON, BLOCK)], BODY, -1)


def add_support(
    pieces: Pieces,
    kind: str,  # of `Support`
    x: float,  # m: place, and length of the beam
    length: float,  # m
    section: tuple[float, float],  # pair of float, m: width and thickness of the beam there
) -> None:
    """A block that holds the beam; one that only holds the slope is a sleeve which moves along with the beam.

    A pinned support is a thin block.
    """
    thick, width = (0.004 if kind == "pinned" else 0.02) * length, 1.2 * section[0]
    high = 0.5 * section[1] + (0.015 if kind == "guided" else 0.05) * length
    # at an end the beam comes out of it
    centre = x - 0.5 * thick if x <= SAME * length else x + 0.5 * thick if x >= (1.0 - SAME) * length else x
    corners = _block((centre - 0.5 * thick, -high, -0.5 * width), (centre + 0.5 * thick, high, 0.5 * width))
    pieces.add(corners, x if kind == "guided" else math.nan, [(HEXAHEDRON, BLOCK)], SUPPORT, -1)


def add_tie(pieces: Pieces, places: tuple[float, float], length: float, level: int) -> None:
    """Lines from the beam's axis at two places (m) to beside it, and between these, for a spring or a dashpot.

    The beam is straight at rest, and would hide a line from place to place. The sections carry their legs. Those of
    one level are equally long.
    """
    leg = (0.04 + 0.015 * level) * length
    for x in places:
        pieces.add(np.array([(x, 0.0, 0.0), (x, -leg, 0.0)]), x, [(LINE, [0, 1])], CONNECTION, -1)
    # the lower ends of both legs
    pieces.cells.append((LINE, [pieces.count - 3, pieces.count - 1], CONNECTION, -1))


def add_connection(pieces: Pieces, x: float, length: float) -> None:
    """A line from the beam's axis to the base, for a spring or a dashpot."""
    pieces.add(np.array([(x, 0.0, 0.0)]), x, [], CONNECTION, -1)
    # -1 is the point before
    pieces.add(np.array([(x, -0.1 * length, 0.0)]), math.nan, [(LINE, [-1, 0])], CONNECTION, -1)


def add_stop(pieces: Pieces, j: int, stop: Contact, structure: Structure, exaggeration: float) -> None:
    """A block on each closed side, whose face the beam's surface touches, with the points of contact of both."""
    x, in_space, section = stop.position, stop.fixed_to == "space", structure.beam.drawn_at(stop.position)
    half, thick, width = 0.5 * section[1], 0.02 * structure.beam.length, 1.2 * section[0]
    for side, gap in ((1, stop.gaps[0]), (-1, stop.gaps[1])):
        if not math.isfinite(gap):
            continue
        face = exaggeration * gap + half
        low, high = sorted((side * face, side * (face + thick)))
        corners = _block((x - 0.5 * thick, low, -0.5 * width), (x + 0.5 * thick, high, 0.5 * width))
        pieces.add(corners, math.nan, [(HEXAHEDRON, BLOCK)], STOP, j, in_space=in_space)
        # in front of the stop, or it would hide the arrows that begin there
        pieces.mark((x, side * half, 0.6 * width), x, j, side, False)
        pieces.mark((x, side * face, 0.6 * width), math.nan, j, side, True, in_space=in_space)


def add_suspension(pieces: Pieces, j: int, x: float, width: float, height: float) -> None:
    """A post on the beam's upper edge, and a line from its top to an absorber's body, for its spring and dashpot."""
    post = np.array([(x, 0.0, 0.5 * width), (x, 0.0, height)])
    pieces.add(post, x, [(LINE, [0, 1])], CONNECTION, j)
    # -1 is the point before
    pieces.add(post[1:], math.nan, [(LINE, [-1, 0])], CONNECTION, j, ball=j)


def add_contacts(
    pieces: Pieces,
    placed: PlacedStructure,  # whose balls come before its stops
    exaggeration: float,
    marked: bool,  # whether the points of contact of balls are added
) -> None:
    """Balls in their boxes, absorbers on their springs, and stops."""
    for j, pair in enumerate(placed.contacts):
        if pair.is_stop:
            add_stop(pieces, j, pair, placed.structure, exaggeration)
            continue
        x, radius = pair.position, ball_radius(pair.mass)
        width, _ = placed.structure.beam.drawn_at(x)
        if pair.has_walls:
            add_box(pieces, j, pair, placed.box_ends(pair), width, exaggeration)
        # in front of the ball, or the ball would hide the arrows that begin there
        height = float(add_ball(pieces, j, pair, width)[2]) + 1.3 * radius
        if not pair.has_walls:
            add_suspension(pieces, j, x, width, height - 1.3 * radius)
            continue
        for side, gap in ((1, pair.gaps[0]), (-1, pair.gaps[1])) if marked else ():
            pieces.mark((x, side * (exaggeration * gap + radius), height), x, j, side, False)
            pieces.mark((x, side * radius, height), math.nan, j, side, True, ball=j)


EXAGGERATION: Any = quantity("1", above=0.0, at_most=1e9)
"""Factor by which motion and clearance are drawn larger."""

SWING = 0.08
"""Share of the beam's length that swing and gap fill where the factor is chosen."""


def chosen_exaggeration(
    deflection: Array,  # m
    structure: Structure,
    balls: Sequence[Contact],
) -> float:
    """Factor, of one digit, with which the largest deflection and gap are a good size beside the beam."""
    gaps = [max(pair.gaps) for pair in balls if pair.has_walls]
    reach = float(np.abs(deflection).max()) + max(gaps, default=0.0)
    return float(f"{SWING * structure.beam.length / max(reach, 1e-12):.1g}")


@dataclass(frozen=True, eq=False)
class Scene:
    """Points, cells and the linear map from the motion to the points.

    x runs along the beam, y is the direction of motion, z the beam's width. The slope turns a
    cross-section or a box as a rigid body, to first order.
    """

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
        """Rotation dw/dx about z of all points, ndarray (points, 3); 0 of what hangs on no section."""
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
    *,
    all_parts: bool = False,  # supports, springs, dashpots and points of contact of the balls too
) -> Scene:
    """The beam of its real cross-section, a box and a ball for each impactor, bodies and stops, as a movie shows them.

    A body at the place of a ball is its box, and no cube beside it.
    """
    pieces, placed, length = Pieces(), placed_structure(structure, system), structure.beam.length
    stretches = add_beam(pieces, placed, system.nodes, subdivisions)
    for support, x in placed.supports if all_parts else ():
        add_support(pieces, support.kind, x, length, structure.beam.drawn_at(x))
    for body, x in placed.blocks:
        add_body(pieces, body, x, structure.beam.drawn_at(x)[0])
    for level, (_, (at, *to)) in enumerate(placed.connections if all_parts else ()):
        if to:
            add_tie(pieces, (at, to[0]), length, level)
        else:
            add_connection(pieces, at, length)
    add_contacts(pieces, placed, exaggeration, marked=all_parts)
    return _scene(pieces, system, stretches, exaggeration)


def _scene(pieces: Pieces, system: System, stretches: tuple[Array, ...], exaggeration: float) -> Scene:
    points, axis = np.concatenate(pieces.points), np.concatenate(pieces.axis)
    ball = np.concatenate(pieces.ball)
    held = np.isfinite(axis)
    fixed, place = sparse.diags_array(held.astype(float)), np.where(held, axis, system.nodes[0])
    carried = sparse.csr_array(
        (np.ones(np.count_nonzero(ball >= 0)), (np.flatnonzero(ball >= 0), ball[ball >= 0])),
        shape=(len(points), len(system.balls)),
    )
    kinds, nodes, parts, pairs = zip(*pieces.cells, strict=True)
    return Scene(
        points=points,
        connectivity=np.concatenate([np.array(cell, dtype=np.int64) for cell in nodes]),
        offsets=np.cumsum([len(cell) for cell in nodes]).astype(np.int64),
        types=np.array(kinds, dtype=np.uint8),
        part=np.array(parts, dtype=np.int32),
        pair=np.array(pairs, dtype=np.int32),
        deflection=sparse.csr_array(fixed @ hermite_rows(system.nodes, place)),
        slope=sparse.csr_array(fixed @ hermite_rows(system.nodes, place, 1)),
        # what hangs on no section has no arm
        arm=np.where(held[:, None], np.column_stack([points[:, 0] - place, points[:, 1]]), 0.0),
        carried=carried,
        in_space=np.concatenate(pieces.in_space),
        stretches=stretches,
        marks=np.array(pieces.marks, dtype=np.int64).reshape(-1, 4),
        exaggeration=exaggeration,
    )


def snapshots_of(response: Response) -> Snapshots:
    """The snapshots of a response, or an error that says how to get them."""
    if response.snapshots is None or response.snapshots.time.size == 0:
        raise InputError(
            [Fault("snapshots", None, "", "the response holds none: integrate with Recorder(snapshots=STRIDE)")]
        )
    return response.snapshots
