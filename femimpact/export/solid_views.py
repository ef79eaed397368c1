"""Beam, boxes and balls as solids in three dimensions, drawn off screen by VTK: a view of all, and one of each ball."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.export.figures.drawing import BLUE, DARK, ORANGE
from femimpact.export.scene import BALL, BEAM, BOX, ball_radius
from femimpact.export.scene_pieces import HEXAHEDRON, section_at
from femimpact.export.sheet import VIEWS, WIDTH, Film

__all__ = ["solid_views"]

Array = NDArray[np.float64]
EYE = np.array([0.0, -0.4, 1.0])
"""From what is looked at to the eye, m: from above, a little from the - side; the beam at rest lies level."""

UPRIGHT = np.array([0.0, 1.0, 0.4]) / math.hypot(1.0, 0.4)
"""What is upright in a picture seen from there; x is level in it."""

SAMPLES = 4
"""Of a pixel, for smooth edges."""

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


@dataclass(frozen=True, eq=False)
class View:
    """A part of the picture, and what it shows.

    A parallel projection, so that lengths stay lengths.

    Parameters
    ----------
    edges : (float, float), 1
        Left and right end, by the width of the picture.
    target : ndarray (3,), m
        In the middle of it, where the beam is at rest.
    scale : float, m
        Half of its height.
    lift : ndarray (frames,), m
        How far the target has gone along y: a close-up goes with its box.
    """

    edges: tuple[float, float]
    target: Array
    scale: float
    lift: Array


@dataclass(frozen=True, eq=False)
class Surface:
    """A solid as VTK draws it, once in each view.

    Parameters
    ----------
    solid : Solid
    place : ndarray (k, 3), m
        The memory of its points.
    points, data, properties : of VTK
    """

    solid: Solid
    place: Array
    points: Any
    data: Any
    properties: list[Any] = field(default_factory=list)


def solid_views(film: Film) -> Generator[NDArray[np.uint8], None, None]:
    """The views of each frame of a film side by side, (rows of `VIEWS`, `WIDTH`, 4): red, green, blue, and no meaning.

    The window is made here, of the class that VTK's environment variable names, and ends with the generator.
    """
    surfaces, views, window = [_surface(solid) for solid in _solids(film)], _views(film), _window()
    renderers = [_renderer(view, surfaces, window) for view in views]
    return _drawn(film, surfaces, views, window, renderers)


def _drawn(
    film: Film, surfaces: list[Surface], views: list[View], window: Any, renderers: list[Any]
) -> Generator[NDArray[np.uint8], None, None]:
    from vtkmodules.util import numpy_support
    from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

    to_numpy: Any = numpy_support.vtk_to_numpy
    pixels, height = vtkUnsignedCharArray(), VIEWS.stop - VIEWS.start
    try:
        for i in range(film.chosen.size):
            _move(surfaces, film, i)
            for view, renderer in zip(views, renderers, strict=True):
                _aim(renderer, view.target + np.array([0.0, view.lift[i], 0.0]))
            window.Render()
            window.GetRGBACharPixelData(0, 0, WIDTH - 1, height - 1, 0, pixels)
            # VTK's rows are from below
            yield to_numpy(pixels).reshape(height, WIDTH, 4)[::-1]
    finally:
        window.Finalize()


# ---- what is drawn --------------------------------------------------------------------------------


def _solids(film: Film) -> list[Solid]:
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


# ---- from where -----------------------------------------------------------------------------------


def _views(film: Film) -> list[View]:
    """The whole beam, on the left half where there are balls, and a close-up of each of these on the right one."""
    balls, beam = film.response.system.balls, film.structure.beam
    half = 0.5 if balls else 1.0
    aspect = half * WIDTH / (VIEWS.stop - VIEWS.start)
    target = np.array([0.5 * beam.length, 0.0, 0.25 * beam.segments[0].rectangle[0]])
    scale = max(UPRIGHT[1] * 1.08 * film.reach, 0.56 * beam.length / aspect)
    views = [View((0.0, half), target, scale, np.zeros(film.chosen.size))]
    for j, pair in enumerate(balls):
        edges, radius = (half + half * j / len(balls), half + half * (j + 1) / len(balls)), ball_radius(pair.mass)
        above = 0.5 * section_at(film.structure, pair.position)[0] + 1.3 * radius
        high = UPRIGHT[1] * (film.scene.exaggeration * max(pair.gaps) + 2.2 * radius)
        scale = max(high, 1.6 * radius * len(balls) / aspect)
        lift = film.scene.exaggeration * film.at_pair(j)[film.chosen]
        views.append(View(edges, np.array([pair.position, 0.0, above]), scale, lift))
    return views


def _aim(renderer: Any, target: Array) -> None:
    camera = renderer.GetActiveCamera()
    camera.SetFocalPoint(*target)
    camera.SetPosition(*(target + EYE))
    renderer.ResetCameraClippingRange()


def _move(surfaces: list[Surface], film: Film, i: int) -> None:
    """Take all solids to where they are at frame i, and colour those that touch."""
    from matplotlib.colors import to_rgb

    moved = film.moved(i)
    for surface in surfaces:
        solid = surface.solid
        if solid.source.size:
            surface.place[:] = moved[solid.source]
            surface.points.Modified()
        touches = solid.contact is not None and film.touches(i, *solid.contact)
        for drawn in surface.properties:
            drawn.SetColor(*to_rgb(ORANGE if touches else solid.colour))


# ---- by VTK ---------------------------------------------------------------------------------------


def _surface(solid: Solid) -> Surface:
    from vtkmodules.util import numpy_support
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    to_vtk: Any = numpy_support.numpy_to_vtk
    to_numbers: Any = numpy_support.numpy_to_vtkIdTypeArray
    place, points, faces, data = np.array(solid.place), vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(to_vtk(place))
    offsets = np.cumsum([0, *(face.size for face in solid.faces)]).astype(np.int64)
    around = np.concatenate(solid.faces).astype(np.int64)
    faces.SetData(to_numbers(offsets, deep=1), to_numbers(around, deep=1))
    data.SetPoints(points)
    data.SetPolys(faces)
    if solid.is_round:
        outwards = place - place.mean(axis=0)
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
        data.GetPointData().SetNormals(to_vtk(outwards, deep=1))
    return Surface(solid, place, points, data)


def _window() -> Any:
    # what draws by OpenGL registers itself
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(SAMPLES)
    window.SetSize(WIDTH, VIEWS.stop - VIEWS.start)
    # nothing is shown: what a swap does to all samples takes as long as all the rest
    window.SwapBuffersOff()
    return window


def _renderer(view: View, surfaces: list[Surface], window: Any) -> Any:
    from vtkmodules.vtkRenderingCore import vtkActor, vtkLightKit, vtkPolyDataMapper, vtkRenderer

    renderer = vtkRenderer()
    window.AddRenderer(renderer)
    renderer.SetViewport(view.edges[0], 0.0, view.edges[1], 1.0)
    renderer.SetBackground(1.0, 1.0, 1.0)
    vtkLightKit().AddLightsToRenderer(renderer)
    for surface in surfaces:
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputData(surface.data)
        actor.SetMapper(mapper)
        renderer.AddActor(actor)
        drawn, light = actor.GetProperty(), surface.solid.light
        # the faces of all but a ball are to be seen
        drawn.SetInterpolationToPhong() if surface.solid.is_round else drawn.SetInterpolationToFlat()
        drawn.SetAmbient(light.get("ambient", 0.0))
        drawn.SetSpecular(light.get("specular", 0.0))
        drawn.SetSpecularPower(light.get("specular_power", 1.0))
        surface.properties.append(drawn)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(view.scale)
    camera.SetViewUp(0.0, 1.0, 0.0)
    return renderer
