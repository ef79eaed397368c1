"""Modes and responses as grids of pyvista, for notebooks."""

from __future__ import annotations

from typing import Any

import numpy as np

from femimpact.errors import kind_of, require, require_type
from femimpact.export.vtk.deflection import deflection_series
from femimpact.export.vtk.formats import Series
from femimpact.export.vtk.modes import mode_series
from femimpact.response.response import Response
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes
from femimpact.system.system import System


def to_pyvista(
    result: Modes | Response,
    structure: Structure,
    system: System | None = None,
    *,
    scale: float | None = None,
    exaggeration: float = 1.0,
    most: int = 600,
    frame: str = "base",
) -> Any:
    """Modes, or the frames of a response, as grids of pyvista with the arrays of the files for ParaView.

    `to_pyvista(modes, structure, system)[1].warp_by_vector("displacement").plot(scalars="axial_stress")` draws the
    second mode.

    Parameters
    ----------
    result : Modes or Response
        A response with snapshots.
    structure : Structure
    system : System, optional
        Whose modes they are; a response has its system.
    scale : float, m
        Of modes; see `export.vtk.write_modes`.
    exaggeration : float, 1
        Of a response, as `most` and `frame`; see `export.vtk.write_deflection`.
    most : int
    frame : {"base", "space"}

    Returns
    -------
    pyvista.MultiBlock
        One UnstructuredGrid for each mode, or for each frame with its time in the field data as `TimeValue` (s); the
        names of the blocks say mode or time.

    Raises
    ------
    InputError
        If a value is out of range, or the system of modes is missing.

    Examples
    --------
    >>> import femimpact as fi
    >>> full = fi.assemble(structure, elements=10)
    >>> blocks = fi.to_pyvista(fi.solve_modes(full, count=2), structure, full)
    >>> blocks[1].active_scalars_name
    'relative_stress'
    """
    require(isinstance(result, (Modes, Response)), "result", kind_of(result), "", "must be Modes or a Response")
    require_type(structure, Structure, "structure")
    if isinstance(result, Response):
        return _grids(deflection_series(result, structure, exaggeration, most, frame))
    require(system is not None, "system", None, "", "must be the system whose modes they are")
    require_type(system, System, "system")
    return _grids(mode_series(system, result, structure, scale=scale))  # type: ignore[arg-type]


def _grids(series: Series) -> Any:
    import pyvista

    cells = np.split(series.connectivity, series.offsets[:-1])
    flat = np.concatenate([np.concatenate([[cell.size], cell]) for cell in cells])
    blocks: Any = pyvista.MultiBlock()
    for name, (time, frame) in zip(series.names, series.timed_frames(), strict=True):
        grid: Any = pyvista.UnstructuredGrid(flat, series.types, series.points.copy())
        grid.point_data.update(dict(frame.points))
        grid.cell_data.update(dict(frame.cells))
        for key, value in {"TimeValue": time, **frame.fields}.items():
            grid.field_data[key] = [value] if isinstance(value, str) else np.atleast_1d(value)
        if series.coloured_by:
            grid.set_active_scalars(series.coloured_by)
        blocks.append(grid, name)
    return blocks
