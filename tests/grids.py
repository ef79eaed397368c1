"""Grids of VTK files, as tests read them."""

from __future__ import annotations

import numpy as np

__all__ = ["points_of", "read_series"]


def points_of(grid: object, chosen: object) -> np.ndarray:
    """Numbers of the points of the cells that a mask over cells chooses, in order, each once."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    # a cell at a time, as an object of VTK, would take most of the time of a test
    cells = grid.GetCells()
    points, offsets = (vtk_to_numpy(array) for array in (cells.GetConnectivityArray(), cells.GetOffsetsArray()))
    return np.unique(points[np.repeat(chosen, np.diff(offsets))])


def read_series(path: object) -> tuple[list[float], list]:
    """Times and grids of a collection, by VTK's readers."""
    import pyvista

    reader = pyvista.get_reader(path)
    grids = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        grids.append(reader.read()[0].copy())
    return reader.time_values, grids
