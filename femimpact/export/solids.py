"""What is drawn of a film in three dimensions: surfaces, their colours, and the points of the scene that move them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.export.figures.drawing import BLUE, DARK
from femimpact.export.scene import BALL, BEAM, BOX
from femimpact.export.scene_pieces import HEXAHEDRON
from femimpact.export.sheet import Film

__all__ = ["Solid", "solids_of"]

Array = NDArray[np.float64]

FACES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))
"""Of a hexahedron in VTK's order."""

MATT = {"ambient": 0.4}
SHINY = {"ambient": 0.25, "specular": 0.4, "specular_power": 20.0}
"""Shares of VTK's light that a surface gives back."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A surface of one colour.

    Parameters
    ----------
    place : ndarray (k, 3), m
        Of its points; those of the scene move.
    faces : list of ndarray
        Numbers of the points around each face.
    colour : str
    light : mapping
        `MATT` or `SHINY`.
    source : ndarray (k,)
        Numbers of the points in the scene; empty where it does not move.
    contact : (int, int), optional
        The pair that colours it when it touches, and on which side; 0 for both.
    is_round : bool
        Whether it is a ball, of which no single face is to be seen.
    """

    place: Array
    faces: list[NDArray[np.intp]]
    colour: str
    light: Mapping[str, float]
    source: NDArray[np.intp]
    contact: tuple[int, int] | None = None
    is_round: bool = False


def solids_of(film: Film) -> list[Solid]:
    """Beam, boxes, balls, stops and supports."""
    scene = film.scene
    solids = [_solid(film, np.flatnonzero(scene.part == BEAM), "#a3acb6", MATT)]
    for j in range(len(film.response.system.balls)):
        mine = scene.pair == j
        plus, minus, floor = np.flatnonzero((scene.part == BOX) & mine).tolist()
        solids += [_solid(film, [cell], "#7b8a9a", MATT, (j, side)) for cell, side in ((plus, 1), (minus, -1))]
        solids.append(_solid(film, [floor], "#c3ced9", {}))
        ball = _solid(film, np.flatnonzero((scene.part == BALL) & mine), BLUE, SHINY, (j, 0))
        solids.append(replace(ball, is_round=True))
    solids += [_solid(film, [cell], DARK, MATT, (j, side)) for cell, j, side in film.stops()]
    return solids + _supports(film)


def _solid(
    film: Film, cells: ArrayLike, colour: str, light: Mapping[str, float],
    contact: tuple[int, int] | None = None,
) -> Solid:  # fmt: skip
    """The outer faces of some cells of the scene."""
    scene = film.scene
    nodes = np.split(scene.connectivity, scene.offsets[:-1])
    faces: dict[tuple[int, ...], NDArray[np.int64] | None] = {}
    for cell in np.asarray(cells):
        own = [nodes[cell][list(face)] for face in FACES] if scene.types[cell] == HEXAHEDRON else [nodes[cell]]
        for face in own:
            # one between two cells is within
            key = tuple(sorted(face.tolist()))
            faces[key] = None if key in faces else face
    outer = [face for face in faces.values() if face is not None]
    source, number = np.unique(np.concatenate(outer), return_inverse=True)
    ends = np.cumsum([face.size for face in outer])
    return Solid(scene.points[source], np.split(number.reshape(-1), ends[:-1]), colour, light, source, contact)


def _supports(film: Film) -> list[Solid]:
    """A block where the beam is held."""
    structure = film.structure
    length, width = structure.beam.length, structure.beam.segments[0].rectangle[0]
    shift = {0.0: -0.01 * length, length: 0.01 * length}
    corners = np.array([(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    blocks = []
    for support in structure.supports:
        x = film.response.system.position_of(support.at)
        place = 0.5 * corners * (0.02 * length, 0.1 * length, 1.2 * width) + (x + shift.get(x, 0.0), 0.0, 0.0)
        faces = [np.array(face) for face in FACES]
        blocks.append(Solid(place, faces, DARK, {}, np.array([], dtype=np.intp)))
    return blocks
