"""Files for ParaView: time series of VTU files with inline base64 data, and their PVD collection.

Inline base64 opens in every ParaView since 5; raw appended data does not. Geometry is encoded once.
"""

from __future__ import annotations

import base64
import shutil
import struct
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.export.files import atomic_write
from femimpact.export.scene import BALL_DENSITY, BEAM, Scene, ball_radius, build_scene, snapshots_of
from femimpact.modes import Modes
from femimpact.response import Response
from femimpact.structure import Structure
from femimpact.system import System, hermite_rows

__all__ = ["write_deflection", "write_modes"]

LINE = 3
TYPES = {"float64": "Float64", "int64": "Int64", "int32": "Int32", "uint8": "UInt8"}


def _data(name: str, values: Any) -> str:
    """One DataArray, binary inline: the length as 8 bytes, then the values."""
    array = np.ascontiguousarray(values)
    width = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
    body = base64.b64encode(struct.pack("<Q", array.nbytes) + array.tobytes()).decode("ascii")
    return f'<DataArray type="{TYPES[str(array.dtype)]}" Name="{name}"{width} format="binary">{body}</DataArray>\n'


def _field(name: str, value: float | str) -> str:
    if isinstance(value, str):
        text = " ".join(str(byte) for byte in [*value.encode("ascii"), 0])
        return f'<DataArray type="String" Name="{name}" NumberOfTuples="1" format="ascii">{text}</DataArray>\n'
    body = base64.b64encode(struct.pack("<Qd", 8, value)).decode("ascii")
    return f'<DataArray type="Float64" Name="{name}" NumberOfTuples="1" format="binary">{body}</DataArray>\n'


class _Grid:
    """Static geometry of an unstructured grid, encoded once; `text` adds what changes."""

    def __init__(self, points: Any, connectivity: Any, offsets: Any, types: Any) -> None:
        self.size = f'NumberOfPoints="{len(points)}" NumberOfCells="{len(types)}"'
        self.geometry = (
            f"<Points>\n{_data('Points', points)}</Points>\n<Cells>\n{_data('connectivity', connectivity)}"
            f"{_data('offsets', offsets)}{_data('types', types)}</Cells>\n"
        )

    def text(self, fields: Mapping[str, float | str], points: Mapping[str, Any], cells: Mapping[str, Any]) -> str:
        return (
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
            f'header_type="UInt64">\n<UnstructuredGrid>\n<FieldData>\n'
            f"{''.join(_field(name, value) for name, value in fields.items())}</FieldData>\n<Piece {self.size}>\n"
            f'<PointData Vectors="displacement">\n{"".join(_data(*item) for item in points.items())}</PointData>\n'
            f"<CellData>\n{''.join(_data(*item) for item in cells.items())}</CellData>\n"
            f"{self.geometry}</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        )


def _write_series(path: Path, times: Sequence[float], texts: Any) -> Path:
    """One folder of frames and the collection that names them; nothing is left of a broken attempt."""
    folder = path.with_suffix("")
    staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=path.parent))
    try:
        entries = []
        for k, (time, text) in enumerate(zip(times, texts, strict=True)):
            (staging / f"{k:04d}.vtu").write_text(text, encoding="ascii")
            entries.append(f'<DataSet timestep="{time!r}" group="" part="0" file="{folder.name}/{k:04d}.vtu"/>\n')
        staging.chmod(0o755)
        if folder.is_dir():
            shutil.rmtree(folder)
        staging.rename(folder)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n<Collection>\n'
    atomic_write(path, head + "".join(entries) + "</Collection>\n</VTKFile>\n")
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
    nodes = system.nodes
    pieces = max(subdivisions, -(-100 // (nodes.size - 1)) if nodes.size < 100 else 1)
    pieces = max(min(pieces, 2000 // (nodes.size - 1)), 1)
    x = np.concatenate([np.linspace(a, b, pieces, endpoint=False) for a, b in zip(nodes, nodes[1:], strict=False)] + [nodes[-1:]])
    w, slope = (np.asarray(system.deflection_rows(x, order) @ modes.vectors) for order in (0, 1))
    factor = (scale or 0.1 * structure.beam.length) / np.abs(w).max(axis=0)
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
            "natural_frequency_Hz": float(modes.natural_frequency[i]),
            "damping_ratio": float(modes.damping_ratio[i]),
            "effective_mass_kg": float(modes.effective_mass[i]),
        }
        return grid.text(fields, {"displacement": vectors[0], "rotation": vectors[1]}, {"part": part})

    frequencies = [float(f) for f in modes.natural_frequency]
    return _write_series(Path(path), frequencies, (frame(i) for i in range(len(frequencies))))


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
    snapshots = snapshots_of(response)
    positive = isinstance(exaggeration, (int, float)) and 0 < exaggeration < np.inf
    require(positive, "exaggeration", exaggeration, "1", "must be a finite number > 0")
    require(frame in ("base", "space"), "frame", frame, "", "must be 'base' or 'space'")
    scene = build_scene(structure, response.system, exaggeration)
    grid = _Grid(scene.points, scene.connectivity, scene.offsets, scene.types)
    chosen = np.unique(np.linspace(0, snapshots.time.size - 1, min(most, snapshots.time.size)).round().astype(int))
    absolute = frame == "space"
    about = (
        f"displacement x {exaggeration:g}, clearance x {exaggeration:g}, relative to the {frame}; "
        f"balls drawn as steel spheres ({BALL_DENSITY:g} kg/m^3)"
    )
    radius = max((ball_radius(pair.mass) for pair in response.system.contacts), default=0.0)

    def text(k: int) -> str:
        time = float(snapshots.time[k])
        shift, speed = (float(f(time)) if absolute else 0.0 for f in (response.base.displacement, response.base.velocity))
        velocity = scene.motion(snapshots.velocity[k], snapshots.ball_velocity[k], speed)
        force = _on_cells(scene, snapshots.contact_force[k])
        fields: dict[str, float | str] = {
            "TimeValue": time, "exaggeration": float(exaggeration), "ball_radius_m": radius, "note": about,
        }  # fmt: skip
        points = {"displacement": scene.displacement(snapshots, k, shift), "velocity": velocity}
        state = (force != 0.0).astype(np.int32)
        return grid.text(fields, points, {"part": scene.part, "contact_force": force, "state": state})

    return _write_series(Path(path), [float(snapshots.time[k]) for k in chosen], (text(int(k)) for k in chosen))


def _on_cells(scene: Scene, forces: NDArray[Any]) -> NDArray[Any]:
    """Contact force (N) of its pair on every cell of boxes and balls, 0 on the beam."""
    return np.append(forces, 0.0)[scene.pair]
