"""Time series of VTU files with inline, compressed base64 data, and their PVD collection.

Inline base64 opens in every ParaView since 5; raw appended data does not. Geometry is encoded once.
"""

from __future__ import annotations

import base64
import os
import shutil
import struct
import tempfile
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.export.files import atomic_write, file_path
from femimpact.export.vtk.series import Series, Value

__all__ = ["checked_path", "write_frames", "write_pvd"]

COLLECTION = (
    '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n'
    "<Collection>\n{}</Collection>\n</VTKFile>\n"
)
TYPES = {"float64": "Float64", "int64": "Int64", "int32": "Int32", "uint8": "UInt8"}


def _body(array: NDArray[Any]) -> str:
    """Values in one compressed block, in base64: number of blocks, size of a block and of the last, compressed size."""
    packed = zlib.compress(array.tobytes(), level=1)
    header = struct.pack("<4Q", 1, array.nbytes, 0, len(packed))
    return (base64.b64encode(header) + base64.b64encode(packed)).decode("ascii")


def _data(name: str, values: Any) -> str:
    """One DataArray, binary inline."""
    array = np.ascontiguousarray(values)
    width = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
    kind = TYPES[str(array.dtype)]
    return f'<DataArray type="{kind}" Name="{name}"{width} format="binary">{_body(array)}</DataArray>\n'


def _field(name: str, value: Value) -> str:
    """One array of field data: numbers, or a line of text."""
    if isinstance(value, str):
        text = " ".join(str(byte) for byte in [*value.encode("ascii", "replace"), 0])
        return f'<DataArray type="String" Name="{name}" NumberOfTuples="1" format="ascii">{text}</DataArray>\n'
    values = np.atleast_1d(np.asarray(value, dtype=float))
    size = f'NumberOfTuples="{values.size}"'
    return f'<DataArray type="Float64" Name="{name}" {size} format="binary">{_body(values)}</DataArray>\n'


class Grid:
    """Static geometry of an unstructured grid, encoded once; `text` adds what changes."""

    def __init__(self, points: Any, connectivity: Any, offsets: Any, types: Any, coloured_by: str = "") -> None:
        self.active = 'Vectors="displacement"' + (f' Scalars="{coloured_by}"' if coloured_by else "")
        self.size = f'NumberOfPoints="{len(points)}" NumberOfCells="{len(types)}"'
        self.geometry = (
            f"<Points>\n{_data('Points', points)}</Points>\n<Cells>\n{_data('connectivity', connectivity)}"
            f"{_data('offsets', offsets)}{_data('types', types)}</Cells>\n"
        )

    def text(
        self,
        fields: Mapping[str, Value],
        points: Mapping[str, NDArray[np.float64]],
        cells: Mapping[str, NDArray[np.float64 | np.int32]],
    ) -> str:
        """The whole file of one step."""
        return (
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
            f'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n<FieldData>\n'
            f"{''.join(_field(name, value) for name, value in fields.items())}</FieldData>\n<Piece {self.size}>\n"
            f"<PointData {self.active}>\n{''.join(_data(*item) for item in points.items())}</PointData>\n"
            f"<CellData>\n{''.join(_data(*item) for item in cells.items())}</CellData>\n"
            f"{self.geometry}</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        )


def write_pvd(path: Path, series: Series) -> Path:
    """Write a series as one VTU file a frame, and the collection that names them."""
    grid = Grid(series.points, series.connectivity, series.offsets, series.types, series.coloured_by)
    texts = (grid.text({"TimeValue": time, **f.fields}, f.points, f.cells) for time, f in series.timed_frames())
    return write_frames(path, series.times, texts, series.names)


def write_frames(path: Path, times: Sequence[float], texts: Iterable[str], names: Sequence[str] = ()) -> Path:
    """One folder of frames and the collection that names them; a broken attempt leaves what was there before."""
    folder = path.with_suffix("")
    staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=path.parent))
    fresh, old = staging / "new", staging / "old"
    try:
        fresh.mkdir()
        entries = []
        for k, (time, text) in enumerate(zip(times, texts, strict=True)):
            (fresh / f"{k:04d}.vtu").write_text(text, encoding="ascii")
            name = f' name="{escape(names[k])}"' if names else ""
            place = f'part="0" file="{folder.name}/{k:04d}.vtu"'
            entries.append(f'<DataSet timestep="{time!r}" group=""{name} {place}/>\n')
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
            error.filename = str(path)
            # None would be shown as the end of an arrow
            del error.filename2
        raise
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return path


def checked_path(path: str | Path) -> Path:
    """The path of a collection whose folder of frames may be made or replaced."""
    path = file_path(path)
    require(path.suffix in (".pvd", ".vtkhdf"), "path", str(path), "", "must end in .pvd (or .vtkhdf: one file)")
    if path.suffix == ".vtkhdf":
        return path
    folder = path.with_suffix("")
    # what is replaced must be frames: a folder of that name may hold somebody's results
    ours = not folder.exists() or (folder.is_dir() and all(file.suffix == ".vtu" for file in folder.iterdir()))
    require(ours, "path", str(path), "", f"needs the folder {folder.name} for its frames, which holds other files")
    return path
