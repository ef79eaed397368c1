"""Beam, boxes and balls as solids in three dimensions, drawn off screen by VTK: a view of all, and one of each ball.

The time of smooth edges grows with the number of pixels, white or not: the window of a view has the size of what the
solids cover in any frame.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.export.figures.drawing import ORANGE
from femimpact.export.scene import ball_radius
from femimpact.export.scene_pieces import section_at
from femimpact.export.sheet import VIEWS, WIDTH, Film
from femimpact.export.solids import Solid, solids_of

__all__ = ["Placed", "solid_views"]

Array = NDArray[np.float64]
Placed = tuple[slice, slice, NDArray[np.uint8]]
"""Rows and columns of the sheet, and what is there, (rows, columns, 4): red, green, blue, and a byte of no meaning."""

EYE = np.array([0.0, -0.4, 1.0])
"""From what is looked at to the eye, m: from above, a little from the - side; the beam at rest lies level."""

UPRIGHT = np.array([0.0, 1.0, 0.4]) / math.hypot(1.0, 0.4)
"""What is upright in a picture seen from there; x is level in it."""

SAMPLES = 4
"""Of a pixel, for smooth edges."""

MARGIN = 2
"""Pixels around what is covered."""


@dataclass(frozen=True, eq=False)
class View:
    """A part of the sheet, and what it shows.

    A parallel projection, so that lengths stay lengths.

    Parameters
    ----------
    rows, columns : (int, int)
        Of the sheet, from and to.
    target : ndarray (3,), m
        What is looked at, where the beam is at rest.
    pixel : float, m
    lift : ndarray (frames,), m
        How far the target has gone along y: a close-up goes with its box.
    middle : (float, float), pixels
        Where the middle is beside the target: to the right, and up.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    target: Array
    pixel: float
    lift: Array
    middle: tuple[float, float] = (0.0, 0.0)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.columns[1] - self.columns[0], self.rows[1] - self.rows[0]


@dataclass(frozen=True, eq=False)
class Surface:
    """A solid as VTK draws it, the same one in each view.

    Parameters
    ----------
    solid : Solid
    place : ndarray (k, 3), m
        The memory of its points.
    points, data : of VTK
    """

    solid: Solid
    place: Array
    points: Any
    data: Any


@dataclass(frozen=True, eq=False)
class Window:
    """A view as VTK draws it, with the colours of the solids in it."""

    view: View
    window: Any
    renderer: Any
    properties: list[Any]


def solid_views(film: Film) -> Generator[list[Placed], None, None]:
    """The views of each frame of a film.

    The windows are made here, of the class that VTK's environment variable names, and end with the generator.
    """
    solids = solids_of(film)
    surfaces = [_surface(solid) for solid in solids]
    windows = [_window(_covered(film, view, solids), surfaces) for view in _views(film)]
    return _frames(film, surfaces, windows)


def _frames(film: Film, surfaces: list[Surface], windows: list[Window]) -> Generator[list[Placed], None, None]:
    from matplotlib.colors import to_rgb

    try:
        for i in range(film.chosen.size):
            moved, colours = film.moved(i), []
            for surface in surfaces:
                solid = surface.solid
                if solid.source.size:
                    surface.place[:] = moved[solid.source]
                    surface.points.Modified()
                touches = solid.contact is not None and film.touches(i, *solid.contact)
                colours.append(to_rgb(ORANGE if touches else solid.colour))
            yield [_drawn(shown, i, colours) for shown in windows]
    finally:
        for shown in windows:
            shown.window.Finalize()


# ---- from where -----------------------------------------------------------------------------------


def _views(film: Film) -> list[View]:
    """The whole beam, on the left half where there are balls, and a close-up of each of these on the right one."""
    balls, beam = film.response.system.balls, film.structure.beam
    rows, half = (VIEWS.start, VIEWS.stop), WIDTH // 2 if balls else WIDTH
    height = rows[1] - rows[0]
    aspect = half / height
    target = np.array([0.5 * beam.length, 0.0, 0.25 * beam.segments[0].rectangle[0]])
    scale = max(UPRIGHT[1] * 1.08 * film.reach, 0.56 * beam.length / aspect)
    views = [View(rows, (0, half), target, 2.0 * scale / height, np.zeros(film.chosen.size))]
    for j, pair in enumerate(balls):
        radius = ball_radius(pair.mass)
        columns = (half + half * j // len(balls), half + half * (j + 1) // len(balls))
        above = 0.5 * section_at(film.structure, pair.position)[0] + 1.3 * radius
        high = UPRIGHT[1] * (film.scene.exaggeration * max(pair.gaps) + 2.2 * radius)
        scale = max(high, 1.6 * radius * len(balls) / aspect)
        lift = film.scene.exaggeration * film.at_pair(j)[film.chosen]
        views.append(View(rows, columns, np.array([pair.position, 0.0, above]), 2.0 * scale / height, lift))
    return views


def _covered(film: Film, view: View, solids: list[Solid]) -> View:
    """The part of a view that its solids cover in any frame."""
    still = np.concatenate([solid.place for solid in solids if not solid.source.size] or [np.zeros((0, 3))])
    moving = np.concatenate([solid.source for solid in solids])
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for i in range(film.chosen.size):
        seen = np.concatenate([film.moved(i)[moving], still]) - view.target
        seen[:, 1] -= view.lift[i]
        for axis, values in enumerate((seen[:, 0], seen @ UPRIGHT)):
            low[axis], high[axis] = min(low[axis], values.min()), max(high[axis], values.max())
    # from the left and from the upper edge
    size = np.array(view.size)
    first = np.floor(0.5 * size + np.array([low[0], -high[1]]) / view.pixel).astype(int) - MARGIN
    last = np.ceil(0.5 * size + np.array([high[0], -low[1]]) / view.pixel).astype(int) + MARGIN
    first = np.clip(first, 0, size - 1)
    last = np.clip(last, first + 1, size)
    (left, top), (right, bottom) = first.tolist(), last.tolist()
    right_of, below = (0.5 * (first + last - size)).tolist()
    return replace(
        view,
        rows=(view.rows[0] + top, view.rows[0] + bottom),
        columns=(view.columns[0] + left, view.columns[0] + right),
        middle=(right_of, -below),
    )


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


def _window(view: View, surfaces: list[Surface]) -> Window:
    # what draws by OpenGL registers itself
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.vtkRenderingCore import vtkLightKit, vtkRenderer, vtkRenderWindow

    window, renderer = vtkRenderWindow(), vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(SAMPLES)
    window.SetSize(*view.size)
    # nothing is shown: what a swap does to all samples takes as long as all the rest
    window.SwapBuffersOff()
    window.AddRenderer(renderer)
    renderer.SetBackground(1.0, 1.0, 1.0)
    vtkLightKit().AddLightsToRenderer(renderer)
    camera, (columns, rows) = renderer.GetActiveCamera(), view.size
    camera.ParallelProjectionOn()
    camera.SetParallelScale(0.5 * rows * view.pixel)
    camera.SetWindowCenter(2.0 * view.middle[0] / columns, 2.0 * view.middle[1] / rows)
    camera.SetViewUp(0.0, 1.0, 0.0)
    return Window(view, window, renderer, [_shown(surface, renderer) for surface in surfaces])


def _shown(surface: Surface, renderer: Any) -> Any:
    """What tells the colour of a surface that is added to a view."""
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

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
    return drawn


def _drawn(shown: Window, i: int, colours: list[tuple[float, float, float]]) -> Placed:
    from vtkmodules.util import numpy_support
    from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

    view, camera, pixels = shown.view, shown.renderer.GetActiveCamera(), vtkUnsignedCharArray()
    target = view.target + np.array([0.0, view.lift[i], 0.0])
    camera.SetFocalPoint(*target)
    camera.SetPosition(*(target + EYE))
    shown.renderer.ResetCameraClippingRange()
    for drawn, colour in zip(shown.properties, colours, strict=True):
        drawn.SetColor(*colour)
    shown.window.Render()
    columns, rows = view.size
    shown.window.GetRGBACharPixelData(0, 0, columns - 1, rows - 1, 0, pixels)
    to_numpy: Any = numpy_support.vtk_to_numpy
    # VTK's rows are from below
    return slice(*view.rows), slice(*view.columns), to_numpy(pixels).reshape(rows, columns, 4)[::-1]
