"""The beam as a solid, its boxes and balls: static geometry, and how every point of it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.structure.structure import Structure
from femimpact.system.system import System, hermite_rows

__all__ = ["BALL", "BALL_DENSITY", "BEAM", "BOX", "Scene", "ball_radius", "build_scene", "snapshots_of", "thinned"]

BALL_DENSITY = 7850.0
"""kg/m^3. The model knows no ball radius; a steel sphere of the ball's mass is drawn."""

BEAM, BOX, BALL = 0, 1, 2
TRIANGLE, QUAD, HEXAHEDRON = 5, 9, 12
STATIONS = 120


def ball_radius(mass: float) -> float:
    """Radius (m) of the steel sphere that is drawn for a ball of this mass (kg)."""
    return float((3.0 * mass / (4.0 * math.pi * BALL_DENSITY)) ** (1.0 / 3.0))


@dataclass(frozen=True, eq=False)
class Scene:
    """Points, cells and the linear map from the motion to the points.

    x runs along the beam, y is the direction of motion, z the beam's width. The slope turns a
    cross-section or a box as a rigid body, to first order.

    Parameters
    ----------
    points : ndarray (points, 3), m
        At rest; clearances already exaggerated.
    connectivity, offsets, types : ndarray
        Cells as VTK wants them.
    part, pair : ndarray (cells,)
        0 beam, 1 box, 2 ball; number of the contact pair, -1 for the beam.
    deflection, slope : csr_array (points, 2 nodes)
        Rows that read w and dw/dx at each point's section.
    arm : ndarray (points, 2), m
        Offset (x, y) of each point from the axis point that it is fixed to.
    carried : csr_array (points, balls)
        1 where a point belongs to a ball.
    exaggeration : float, 1
    """

    points: NDArray[Any]
    connectivity: NDArray[Any]
    offsets: NDArray[Any]
    types: NDArray[Any]
    part: NDArray[Any]
    pair: NDArray[Any]
    deflection: Any
    slope: Any
    arm: NDArray[Any]
    carried: Any
    exaggeration: float

    def motion(self, nodal: NDArray[Any], balls: NDArray[Any], base: float = 0.0) -> NDArray[Any]:
        """Displacements (or velocities) of all points, ndarray (points, 3), without exaggeration."""
        slope = self.slope @ nodal
        result = np.zeros_like(self.points)
        result[:, 0] = -self.arm[:, 1] * slope
        result[:, 1] = self.deflection @ nodal + self.arm[:, 0] * slope + self.carried @ balls + base
        return result

    def displacement(self, snapshots: Snapshots, k: int, base: float = 0.0) -> NDArray[Any]:
        """Exaggerated displacement (points, 3), m, of snapshot k."""
        motion = self.motion(snapshots.displacement[k], snapshots.ball_displacement[k], base)
        return self.exaggeration * motion


@dataclass
class _Builder:
    """Collects pieces while a scene is built."""

    points: list[NDArray[Any]]
    axis: list[NDArray[Any]]  # x of the section that moves each point; nan for a ball
    ball: list[NDArray[Any]]  # number of the ball that carries each point, -1 otherwise
    cells: list[tuple[int, list[int], int, int]]

    def add(self, points: NDArray[Any], axis: Any, cells: list[tuple[int, list[int]]], part: int, pair: int) -> None:
        first = sum(len(piece) for piece in self.points)
        self.points.append(points)
        self.axis.append(np.broadcast_to(np.asarray(axis, dtype=float), len(points)))
        self.ball.append(np.full(len(points), pair if part == BALL else -1))
        self.cells += [(kind, [first + i for i in nodes], part, pair) for kind, nodes in cells]


def build_scene(structure: Structure, system: System, exaggeration: float = 1.0) -> Scene:
    """Geometry of a structure: the beam of its real cross-section, one box and one ball for each impactor.

    Parameters
    ----------
    structure : Structure
    system : System
        Gives nodes and contact pairs.
    exaggeration : float, 1
        Scales motion and clearance together, so that a ball stays in its box.

    Returns
    -------
    Scene
    """
    builder = _Builder([], [], [], [])
    _add_beam(builder, structure)
    for j, pair in enumerate(system.balls):
        width, _ = _section_at(structure, pair.position)
        _add_box(builder, j, pair.position, width, ball_radius(pair.mass), pair.gaps, exaggeration)
        _add_ball(builder, j, pair.position, width, ball_radius(pair.mass))
    points = np.concatenate(builder.points)
    axis, ball = np.concatenate(builder.axis), np.concatenate(builder.ball)
    fixed = sparse.diags_array((ball < 0).astype(float))
    place = np.where(ball < 0, axis, 0.0)
    carried = sparse.csr_array(
        (np.ones(np.count_nonzero(ball >= 0)), (np.flatnonzero(ball >= 0), ball[ball >= 0])),
        shape=(len(points), len(system.balls)),
    )
    kinds, nodes, parts, pairs = zip(*builder.cells, strict=True)
    return Scene(
        points=points,
        connectivity=np.concatenate([np.array(cell, dtype=np.int64) for cell in nodes]),
        offsets=np.cumsum([len(cell) for cell in nodes]).astype(np.int64),
        types=np.array(kinds, dtype=np.uint8),
        part=np.array(parts, dtype=np.int32),
        pair=np.array(pairs, dtype=np.int32),
        deflection=sparse.csr_array(fixed @ hermite_rows(system.nodes, place)),
        slope=sparse.csr_array(fixed @ hermite_rows(system.nodes, place, 1)),
        # a ball hangs on no section: its arm is zero
        arm=np.where((ball < 0)[:, None], np.column_stack([points[:, 0] - axis, points[:, 1]]), 0.0),
        carried=carried,
        exaggeration=exaggeration,
    )


def _section_at(structure: Structure, position: float) -> tuple[float, float]:
    """Width and thickness (m) of the segment that holds a position."""
    joints = np.array(structure.beam.joints)
    segment = min(int(np.searchsorted(joints, position, side="right")) - 1, len(joints) - 2)
    return structure.beam.segments[segment].rectangle


BLOCK = [0, 1, 2, 3, 4, 5, 6, 7]


def _block(low: tuple[float, float, float], high: tuple[float, float, float]) -> NDArray[Any]:
    """Corners of a box in VTK's order of a hexahedron."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    lower = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)]
    return np.array(lower + [(x, y, z1) for x, y, _ in lower])


def _add_beam(builder: _Builder, structure: Structure) -> None:
    beam = structure.beam
    for segment, start, end in zip(beam.segments, beam.joints, beam.joints[1:], strict=False):
        width, thickness = segment.rectangle
        stations = np.linspace(start, end, max(round(STATIONS * segment.length / beam.length), 2) + 1)
        corners = 0.5 * np.array([(-thickness, -width), (thickness, -width), (thickness, width), (-thickness, width)])
        points = np.array([(x, y, z) for x in stations for y, z in corners])
        cells = [
            (HEXAHEDRON, [4 * i + c for c in range(4)] + [4 * i + 4 + c for c in range(4)])
            for i in range(len(stations) - 1)
        ]
        builder.add(points, points[:, 0], cells, BEAM, -1)


def _add_box(
    builder: _Builder, j: int, x: float, width: float, radius: float, gaps: tuple[float, float], exaggeration: float
) -> None:
    """Two end walls and a floor on the beam's upper edge; the inner faces stop the ball's surface."""
    wall = 0.3 * radius
    floor = 0.5 * width
    inner = (exaggeration * gaps[0] + radius, -exaggeration * gaps[1] - radius)
    left, right, top = x - radius - wall, x + radius + wall, floor + wall + 2.0 * radius
    blocks = [
        _block((left, inner[0], floor), (right, inner[0] + wall, top)),
        _block((left, inner[1] - wall, floor), (right, inner[1], top)),
        _block((left, inner[1], floor), (right, inner[0], floor + wall)),
    ]
    for corners in blocks:
        builder.add(corners, x, [(HEXAHEDRON, BLOCK)], BOX, j)


def _add_ball(
    builder: _Builder, j: int, x: float, width: float, radius: float, rings: int = 10, around: int = 20
) -> None:
    """A sphere of quadrilaterals with triangles at its poles."""
    centre = np.array([x, 0.0, 0.5 * width + 0.3 * radius + radius])
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
    builder.add(points, math.nan, cells, BALL, j)


def snapshots_of(response: Response) -> Snapshots:
    """The snapshots of a response, or an error that says how to get them."""
    from femimpact.errors import Fault, InputError

    if response.snapshots is None or response.snapshots.time.size == 0:
        raise InputError(
            [Fault("snapshots", None, "", "the response holds none: integrate with Recorder(snapshots=STRIDE)")]
        )
    return response.snapshots


def thinned(count: int, most: int) -> NDArray[Any]:
    """At most so many of the numbers 0 to count - 1, evenly spread, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))
