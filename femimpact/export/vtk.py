"""Files for ParaView: time series of VTU files with inline base64 data, and their PVD collection.

Inline base64 opens in every ParaView since 5; raw appended data does not. Geometry is encoded once.
"""

from __future__ import annotations

import base64
import itertools
import math
import os
import shutil
import struct
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.export.files import atomic_write
from femimpact.export.scene import BALL_DENSITY, BEAM, Scene, ball_radius, build_scene, snapshots_of, thinned
from femimpact.response.response import Response
from femimpact.structure.structure import Structure
from femimpact.system.modes import Modes
from femimpact.system.system import System

__all__ = ["write_deflection", "write_modes"]

LINE = 3
COLLECTION = (
    '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n'
    "<Collection>\n{}</Collection>\n</VTKFile>\n"
)
TYPES = {"float64": "Float64", "int64": "Int64", "int32": "Int32", "uint8": "UInt8"}


def _data(name: str, values: Any) -> str:
    """One DataArray, binary inline: the length as 8 bytes, then the values."""
    array = np.ascontiguousarray(values)
    width = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
    body = base64.b64encode(struct.pack("<Q", array.nbytes) + array.tobytes()).decode("ascii")
    return f'<DataArray type="{TYPES[str(array.dtype)]}" Name="{name}"{width} format="binary">{body}</DataArray>\n'


def _field(name: str, value: float | Sequence[float] | str) -> str:
    """One array of field data: numbers, or a line of text."""
    if isinstance(value, str):
        text = " ".join(str(byte) for byte in [*value.encode("ascii"), 0])
        return f'<DataArray type="String" Name="{name}" NumberOfTuples="1" format="ascii">{text}</DataArray>\n'
    values = np.atleast_1d(np.asarray(value, dtype=float))
    body = base64.b64encode(struct.pack("<Q", values.nbytes) + values.tobytes()).decode("ascii")
    size = f'NumberOfTuples="{values.size}"'
    return f'<DataArray type="Float64" Name="{name}" {size} format="binary">{body}</DataArray>\n'


class _Grid:
    """Static geometry of an unstructured grid, encoded once; `text` adds what changes."""

    def __init__(self, points: Any, connectivity: Any, offsets: Any, types: Any) -> None:
        self.size = f'NumberOfPoints="{len(points)}" NumberOfCells="{len(types)}"'
        self.geometry = (
            f"<Points>\n{_data('Points', points)}</Points>\n<Cells>\n{_data('connectivity', connectivity)}"
            f"{_data('offsets', offsets)}{_data('types', types)}</Cells>\n"
        )

    def text(
        self,
        fields: Mapping[str, float | Sequence[float] | str],
        points: Mapping[str, NDArray[Any]],
        cells: Mapping[str, NDArray[Any]],
    ) -> str:
        """The whole file of one step."""
        return (
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
            f'header_type="UInt64">\n<UnstructuredGrid>\n<FieldData>\n'
            f"{''.join(_field(name, value) for name, value in fields.items())}</FieldData>\n<Piece {self.size}>\n"
            f'<PointData Vectors="displacement">\n{"".join(_data(*item) for item in points.items())}</PointData>\n'
            f"<CellData>\n{''.join(_data(*item) for item in cells.items())}</CellData>\n"
            f"{self.geometry}</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        )


def _write_series(path: Path, times: Sequence[float], texts: Iterator[str]) -> Path:
    """One folder of frames and the collection that names them; a broken attempt leaves what was there before."""
    folder = path.with_suffix("")
    staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=path.parent))
    fresh, old = staging / "new", staging / "old"
    try:
        fresh.mkdir()
        entries = []
        for k, (time, text) in enumerate(zip(times, texts, strict=True)):
            (fresh / f"{k:04d}.vtu").write_text(text, encoding="ascii")
            entries.append(f'<DataSet timestep="{time!r}" group="" part="0" file="{folder.name}/{k:04d}.vtu"/>\n')
        try:
            with suppress(FileNotFoundError):
                folder.rename(old)
            fresh.rename(folder)
            atomic_write(path, COLLECTION.format("".join(entries)))
        except BaseException:
            if not fresh.is_dir():
                shutil.rmtree(folder)
            if old.is_dir():
                old.rename(folder)
            raise
    except OSError as error:
        # a failed write names no file, the others a hidden one
        hidden = error.filename is None or os.fsdecode(error.filename).startswith(str(staging))
        if error.errno is not None and hidden:
            error.filename, error.filename2 = str(path), None
        raise
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return path


def _checked(path: str | Path) -> Path:
    """The path of a collection whose folder of frames may be made or replaced."""
    path = Path(path)
    require(path.suffix == ".pvd", "path", str(path), "", "must end in .pvd")
    folder = path.with_suffix("")
    # what is replaced must be frames: a folder of that name may hold somebody's results
    ours = not folder.exists() or (folder.is_dir() and all(file.suffix == ".vtu" for file in folder.iterdir()))
    require(ours, "path", str(path), "", f"needs the folder {folder.name} for its frames, which holds other files")
    return path


def write_modes(
    path: str | Path,
    system: System,
    modes: Modes,
    structure: Structure,
    subdivisions: int = 8,
    scale: float | None = None,
) -> Path:
    """Mode shapes as a time series: one step per mode, its time value the natural frequency in Hz.

    Parameters
    ----------
    path : str or Path
        The `.pvd` file; its frames go into a folder of the same name.
    system : System
    modes : Modes
        Of that system.
    structure : Structure
    subdivisions : int
        Line cells per element, along its Hermite curve.
    scale : float, m
        Largest deflection drawn; a tenth of the beam's length by default.

    Returns
    -------
    Path
        Point vectors `displacement` (along y) and `rotation` (about z), cell array `part`.
    """
    path = _checked(path)
    whole = isinstance(subdivisions, int) and subdivisions >= 1
    require(whole, "subdivisions", subdivisions, "cells", "must be a whole number >= 1")
    height = 0.1 * structure.beam.length if scale is None else scale
    require(0.0 < height < math.inf, "scale", scale, "m", "must be a finite number > 0")
    x = _stations(system.nodes, subdivisions)
    w, slope = (np.asarray(system.deflection_rows(x, order) @ modes.vectors) for order in (0, 1))
    factor = height / np.abs(w).max(axis=0)
    cells = np.column_stack([np.arange(x.size - 1), np.arange(1, x.size)])
    points = np.column_stack([x, np.zeros((x.size, 2))])
    types = np.full(len(cells), LINE, dtype=np.uint8)
    grid = _Grid(points, cells.astype(np.int64).ravel(), 2 * np.arange(1, x.size, dtype=np.int64), types)
    part = np.full(len(cells), BEAM, dtype=np.int32)

    def frame(i: int) -> str:
        vectors = np.zeros((2, x.size, 3))
        vectors[0, :, 1], vectors[1, :, 2] = factor[i] * w[:, i], factor[i] * slope[:, i]
        fields = {
            "TimeValue": float(modes.natural_frequency[i]),
            "natural_frequency": float(modes.natural_frequency[i]),
            "damping_ratio": float(modes.damping_ratio[i]),
            "effective_mass": float(modes.effective_mass[i]),
        }
        return grid.text(fields, {"displacement": vectors[0], "rotation": vectors[1]}, {"part": part})

    frequencies = [float(f) for f in modes.natural_frequency]
    return _write_series(path, frequencies, (frame(i) for i in range(len(frequencies))))


def _stations(nodes: NDArray[Any], subdivisions: int) -> NDArray[Any]:
    """Points (m) along the beam, every node among them: at least 100, and about 2000 at most."""
    elements = nodes.size - 1
    pieces = max(min(max(subdivisions, math.ceil(100 / elements)), 2000 // elements), 1)
    inner = [np.linspace(a, b, pieces, endpoint=False) for a, b in itertools.pairwise(nodes)]
    return np.concatenate([*inner, nodes[-1:]])


def write_deflection(
    path: str | Path,
    response: Response,
    structure: Structure,
    exaggeration: float = 1.0,
    most: int = 600,
    frame: str = "base",
) -> Path:
    """The moving beam, its boxes and balls as a time series with real time values.

    Parameters
    ----------
    path : str or Path
        The `.pvd` file; its frames go into a folder of the same name.
    response : Response
        With snapshots.
    structure : Structure
    exaggeration : float, 1
        Scales the motion and the clearance together, so that each ball stays in its box.
    most : int
        At most so many snapshots, evenly thinned.
    frame : {"base", "space"}
        Whether displacements are relative to the moving base or absolute.

    Returns
    -------
    Path
        Point vectors `displacement` (m, exaggerated; warp by 1) and `velocity` (m/s, true), cell
        arrays `part` (0 beam, 1 box, 2 ball), `contact_force` (N, on box and ball) and `state`
        (1 in contact).
    """
    path = _checked(path)
    snapshots = snapshots_of(response)
    positive = isinstance(exaggeration, (int, float)) and 0.0 < exaggeration < math.inf
    require(positive, "exaggeration", exaggeration, "1", "must be a finite number > 0")
    require(frame in ("base", "space"), "frame", frame, "", "must be 'base' or 'space'")
    require(isinstance(most, int) and most >= 1, "most", most, "snapshots", "must be a whole number >= 1")
    scene = build_scene(structure, response.system, exaggeration)
    grid = _Grid(scene.points, scene.connectivity, scene.offsets, scene.types)
    chosen = thinned(snapshots.time.size, most)
    absolute = frame == "space"
    fixed = _about(response, exaggeration, frame)

    def text(k: int) -> str:
        time = float(snapshots.time[k])
        shift = float(response.base.displacement(time)) if absolute else 0.0
        speed = float(response.base.velocity(time)) if absolute else 0.0
        points = {
            "displacement": scene.displacement(snapshots, k, shift),
            "velocity": scene.motion(snapshots.velocity[k], snapshots.ball_velocity[k], speed),
        }
        force = _on_cells(scene, snapshots.contact_force[k])
        cells = {"part": scene.part, "contact_force": force, "state": (force != 0.0).astype(np.int32)}
        return grid.text({"TimeValue": time, **fixed}, points, cells)

    return _write_series(path, [float(snapshots.time[k]) for k in chosen], (text(int(k)) for k in chosen))


def _about(response: Response, exaggeration: float, frame: str) -> dict[str, float | Sequence[float] | str]:
    """Field data that is the same in every file; the radii (m) in the order of the impactors."""
    motion = "relative to the moving base" if frame == "base" else "absolute, in space"
    note = f"displacement {motion}; displacement and clearance times {exaggeration:g}; velocity true, not exaggerated"
    fields: dict[str, float | Sequence[float] | str] = {"exaggeration": float(exaggeration)}
    if response.system.balls:
        # the model has no radius: the ball is a point mass to it
        fields["ball_radius"] = [ball_radius(pair.mass) for pair in response.system.balls]
        note += f"; each ball is drawn as a steel sphere ({BALL_DENSITY:g} kg/m^3) of its mass"
    return {**fields, "note": note}


def _on_cells(scene: Scene, forces: NDArray[Any]) -> NDArray[Any]:
    """Contact force (N) of its pair on every cell of boxes and balls, 0 on the beam."""
    # the beam's pair is -1, which reads the appended zero
    return np.asarray(np.append(forces, 0.0)[scene.pair])
