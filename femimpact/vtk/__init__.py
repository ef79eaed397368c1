"""Mode shapes and deflections of a solid beam as files for ParaView, and as grids of pyvista.

Fields are there for colours and arrows; one script in each folder opens its files.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.errors import instance, kind_of, require, require_type, takes
from femimpact.response.response import Response
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes
from femimpact.system.system import System
from femimpact.vtk.deflection import deflection_series
from femimpact.vtk.formats import Series, checked_path, write_pvd, write_vtkhdf
from femimpact.vtk.modes import mode_motion_series, mode_series
from femimpact.vtk.script import DEFLECTION, MODE, MODES, SeriesSummary, View, write_script

__all__ = ["to_pyvista", "write_deflection", "write_mode", "write_modes"]

SYSTEM, MODES_OF, STRUCTURE = instance(System), instance(Modes), instance(Structure)


@takes(system=SYSTEM, modes=MODES_OF, structure=STRUCTURE)
def write_modes(
    path: str | Path,
    system: System,
    modes: Modes,
    structure: Structure,
    subdivisions: int = 1,
    scale: float | None = None,
) -> Path:
    """Mode shapes as a time series: one step per mode, its time value the number of the mode, 1 for the first.

    Parameters
    ----------
    path : str or Path
        A `.pvd` file, whose frames go into a folder of the same name, or a `.vtkhdf` file (ParaView 5.12 or newer).
        The script `open_in_paraview.py` beside it opens it in ParaView.
    system : System
    modes : Modes
        Of that system.
    structure : Structure
    subdivisions : int
        Cells of the beam for each element, at least; there are 120 in all, at least.
    scale : float, m
        Largest deflection drawn; a tenth of the beam's length by default. All arrays are those of this deflection.

    Returns
    -------
    Path
        Arrays as of `write_deflection`, those of contacts and velocities left out; field data `name` ("mode 2,
        32.99 Hz"), `natural_frequency` (Hz), `damping_ratio`, `effective_mass` (kg), `amplitude` (m) and
        `modal_coordinate` (kg^0.5 m), by which the mass-normalised mode is multiplied.

    Raises
    ------
    InputError
        If the path cannot be written.
    """
    path = checked_path(path)
    return _write(path, mode_series(system, modes, structure, subdivisions, scale), MODES)


@takes(system=SYSTEM, modes=MODES_OF, structure=STRUCTURE)
def write_mode(
    path: str | Path,
    system: System,
    modes: Modes,
    structure: Structure,
    mode: int,
    frames: int = 24,
    subdivisions: int = 1,
    scale: float | None = None,
) -> Path:
    """One mode over one period, undamped: a series that plays in a loop.

    Parameters
    ----------
    path : str or Path
        As of `write_modes`.
    system : System
    modes : Modes
    structure : Structure
    mode : int
        Number of the mode, 1 for the first.
    frames : int
        In one period, its end left out.
    subdivisions : int
    scale : float, m

    Returns
    -------
    Path
        Arrays as of `write_modes`, and the velocity; the time value is in s.

    Raises
    ------
    InputError
        If the path cannot be written.
    """
    path = checked_path(path)
    return _write(path, mode_motion_series(system, modes, structure, mode, frames, subdivisions, scale), MODE)


@takes(response=instance(Response), structure=STRUCTURE)
def write_deflection(
    path: str | Path,
    response: Response,
    structure: Structure,
    exaggeration: float = 1.0,
    most: int = 600,
    frame: str = "base",
) -> Path:
    """The moving beam, its boxes and balls as a time series with real time values: an even grid and every impact.

    Of a captured accumulation of impacts its start and its end have a frame. A state at an impact is the one just
    before its impulse. It is computed from the snapshot before it through the recorded events in between, and must
    meet the snapshot after it: the largest share of the largest displacement by which it does not is in the field
    data, as `impact_state_mismatch`. Of an event-driven run that is rounding. See `femimpact.vtk.deflection`.

    Parameters
    ----------
    path : str or Path
        A `.pvd` file, whose frames go into a folder of the same name, or a `.vtkhdf` file (ParaView 5.12 or newer).
        The script `open_in_paraview.py` beside it opens it in ParaView.
    response : Response
        With snapshots.
    structure : Structure
    exaggeration : float, 1
        Scales the motion and the clearance together, so that each ball stays in its box. A compliant contact lets
        the ball into its wall by the penetration of its law.
    most : int
        At most so many frames, evenly thinned; impacts have at least half of them if need be.
    frame : {"base", "space"}
        Whether displacements and velocities are relative to the moving base or absolute.

    Returns
    -------
    Path
        Point vectors `displacement` (m, exaggerated; warp by 1), `velocity` (m/s), `rotation` (rad, about z),
        `contact_force_vector` (N) and `contact_impulse_vector` (N s, in the frame of an impact) at points of contact
        on wall and ball; point scalars `curvature` (1/m), `bending_moment` (N m), `shear_force` (N),
        `axial_strain`, `axial_stress` (Pa) and `strain_energy_density` (J/m^3), whose signs are those of
        `femimpact.system.hermite`. Cell arrays `part` (0 beam, 1 box, 2 ball, 3 support, 4 body, 5 stop,
        6 contact point, 7 spring or dashpot), `contact_pair` (-1: none), `contact_force` (N, on box and
        ball), `state` (1 in contact) and `mean_strain_energy_density` (J/m^3). The units are in the field data as
        `units`; `name` says time and impact, `contacts` what presses, with force and impulse. All but the displacement
        are true, not exaggerated.

    Raises
    ------
    InputError
        If the response holds no snapshots, or the path cannot be written.

    Warns
    -----
    UserWarning
        If impacts have no frame: more of them than `most` lets in, or states that cannot be computed.
    """
    path = checked_path(path)
    names = [pair.name for pair in response.system.contacts if not pair.between]
    return _write(path, deflection_series(response, structure, exaggeration, most, frame), DEFLECTION, names)


def _write(path: Path, series: Series, view: View, names: Sequence[str] = ()) -> Path:
    write, summary = write_vtkhdf if path.suffix == ".vtkhdf" else write_pvd, SeriesSummary()
    write(path, summary.gathering(series))
    write_script(path, view, summary, names)
    return path


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
        Of modes; see `fi.vtk.write_modes`.
    exaggeration : float, 1
        Of a response, as `most` and `frame`; see `fi.vtk.write_deflection`.
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
        If the system of modes is missing.

    Examples
    --------
    >>> import femimpact as fi
    >>> full = fi.assemble(structure, elements=10)
    >>> blocks = fi.vtk.to_pyvista(fi.solve_modes(full, count=2), structure, full)
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
