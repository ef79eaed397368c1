"""The beam as a solid with what is on it: static geometry, and how every point of it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from femimpact.errors import Fault, InputError, quantity
from femimpact.export.scene_pieces import (
    BALL,
    BALL_DENSITY,
    BEAM,
    BOX,
    Pieces,
    add_ball,
    add_beam,
    add_body,
    add_box,
    add_connection,
    add_stop,
    add_support,
    add_tie,
    ball_radius,
    section_at,
    stretches_of,
)
from femimpact.response.history import Snapshots
from femimpact.response.response import Response
from femimpact.structure.structure import Position, Structure
from femimpact.system.hermite import hermite_rows
from femimpact.system.matrices import Matrix
from femimpact.system.system import System

__all__ = [
    "BALL", "BALL_DENSITY", "BEAM", "BOX", "EXAGGERATION", "Scene", "ball_radius", "build_scene", "build_whole_scene",
    "snapshots_of", "thinned",
]  # fmt: skip

Array = NDArray[np.float64]

EXAGGERATION: Any = quantity("1", above=0.0, at_most=1e9)
"""By which motion and clearance are drawn larger."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Points, cells and the linear map from the motion to the points.

    x runs along the beam, y is the direction of motion, z the beam's width. The slope turns a
    cross-section or a box as a rigid body, to first order.

    Parameters
    ----------
    points : ndarray (points, 3), m
        At rest; clearances already exaggerated. Those of the beam come first, four for each section.
    connectivity, offsets, types : ndarray
        Cells in VTK's form: points of all, the end of each among these, and its type.
    part, pair : ndarray (cells,)
        Number in `PARTS`; number of the contact pair, -1 where there is none.
    deflection, slope : csr_array (points, 2 nodes)
        Rows that read w and dw/dx at each point's section.
    arm : ndarray (points, 2), m
        Offset (x, y) of each point from the axis point that it is fixed to.
    carried : csr_array (points, balls)
        1 where a point belongs to a ball.
    in_space : ndarray (points,)
        Whether a point is fixed in space.
    stretches : tuple of ndarray, m
        Positions of the beam's sections; a jump of the section or a force lies between two stretches.
    marks : ndarray (marks, 4)
        Points of contact: point, pair, side, and 1 where the force on the ball or the stop is shown.
    exaggeration : float, 1
    """

    points: Array
    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]
    types: NDArray[np.uint8]
    part: NDArray[np.int32]
    pair: NDArray[np.int32]
    deflection: Matrix
    slope: Matrix
    arm: Array
    carried: Matrix
    in_space: NDArray[np.bool_]
    stretches: tuple[Array, ...]
    marks: NDArray[np.int64]
    exaggeration: float

    def motion(self, nodal: Array, balls: Array, base: float = 0.0, space: float = 0.0) -> Array:
        """Displacements (or velocities) of all points, ndarray (points, 3), without exaggeration.

        Parameters
        ----------
        nodal, balls : ndarray
            Relative to the base.
        base, space : float
            Motion of the base, and of what is fixed in space, in the frame that is drawn.
        """
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


def build_scene(structure: Structure, system: System, exaggeration: float = 1.0) -> Scene:
    """The beam of its real cross-section, a box and a ball for each impactor, and the stops: what a movie shows.

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
    pieces = Pieces()
    stretches = stretches_of(system.nodes, _cuts(structure, system))
    add_beam(pieces, structure, stretches)
    for j, pair in enumerate(system.balls):
        width, _ = section_at(structure, pair.position)
        add_box(pieces, j, pair.position, width, ball_radius(pair.mass), pair.gaps, exaggeration)
        add_ball(pieces, j, pair.position, width, ball_radius(pair.mass))
    for j, pair in enumerate(system.contacts):
        if pair.is_stop:
            section = section_at(structure, pair.position)
            add_stop(
                pieces, j, pair.position, structure.beam.length, section, pair.gaps, exaggeration,
                pair.fixed_to == "space",
            )  # fmt: skip
    return _scene(pieces, system, stretches, exaggeration)


def build_whole_scene(structure: Structure, system: System, exaggeration: float = 1.0, subdivisions: int = 1) -> Scene:
    """The same with supports, bodies, springs, dashpots and points of contact of the balls.

    Parameters
    ----------
    structure : Structure
    system : System
    exaggeration : float, 1
    subdivisions : int
        Cells of the beam for each element, at least.

    Returns
    -------
    Scene
    """
    pieces, length = Pieces(), structure.beam.length
    stretches = stretches_of(system.nodes, _cuts(structure, system), subdivisions)
    add_beam(pieces, structure, stretches)
    for support in structure.supports:
        x = _position(structure, system, support.at)
        add_support(pieces, support.kind, x, length, section_at(structure, x))
    for body in structure.masses:
        if body.mass > 0.0:
            x = _position(structure, system, body.at)
            add_body(pieces, x, body.offset, section_at(structure, x)[0], body.mass)
    for level, (_, _, places) in enumerate(structure.connections):
        at, *to = (_position(structure, system, place) for place in places.values())
        if to:
            add_tie(pieces, (at, to[0]), length, level)
        else:
            add_connection(pieces, at, length)
    for j, pair in enumerate(system.contacts):
        x, section = pair.position, section_at(structure, pair.position)
        if pair.is_stop:
            add_stop(pieces, j, x, length, section, pair.gaps, exaggeration, pair.fixed_to == "space")
            continue
        radius = ball_radius(pair.mass)
        add_box(pieces, j, x, section[0], radius, pair.gaps, exaggeration)
        # in front of the ball, or the ball would hide the arrows that begin there
        height = float(add_ball(pieces, j, x, section[0], radius)[2]) + 1.3 * radius
        for side, gap in ((1, pair.gaps[0]), (-1, pair.gaps[1])):
            pieces.mark((x, side * (exaggeration * gap + radius), height), x, j, side, False)
            pieces.mark((x, side * radius, height), math.nan, j, side, True, ball=j)
    return _scene(pieces, system, stretches, exaggeration)


def _cuts(structure: Structure, system: System) -> list[float]:
    """Positions (m) at which a section may jump or a force acts."""
    held = [*(body.at for body in structure.masses), *(support.at for support in structure.supports)]
    held += [place for _, _, ends in structure.connections for place in ends.values()]
    return [
        *structure.beam.joints,
        *(_position(structure, system, at) for at in held),
        *(pair.position for pair in system.contacts),
    ]


def _position(structure: Structure, system: System, at: Position) -> float:
    """Metres from the root of a place, or of a body by its name."""
    return system.position_of(structure.place_of(at))


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


def thinned(count: int, most: int) -> NDArray[np.int64]:
    """At most so many of the numbers 0 to count - 1, evenly spread, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))
