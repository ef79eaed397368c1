"""Formats of ParaView's files: VTU and PVD as XML, and VTKHDF."""

from __future__ import annotations

import base64
import os
import shutil
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require
from femimpact.files import GuardedFile, atomic_path, atomic_write, target_path

Value = float | Sequence[float] | str
"""A value of field data: numbers, or a line of text."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Arrays and field data of one frame."""

    fields: Mapping[str, Value]  # numbers or text
    points: Mapping[str, NDArray[np.float64]]
    cells: Mapping[str, NDArray[np.float64 | np.int32]]


@dataclass(frozen=True, eq=False)
class Series:
    """Frames on one grid, each made when it is needed."""

    points: NDArray[np.float64]  # (points, 3) m
    connectivity: NDArray[np.int64]  # cells in VTK's form: points of all, the end of each among these, and its type
    offsets: NDArray[np.int64]
    types: NDArray[np.uint8]
    times: Sequence[float]
    names: Sequence[str]  # of every frame
    frame: Callable[[int], Frame]
    coloured_by: str = ""  # array at points that ParaView colours by when it opens the file; "" for none

    def timed_frames(self) -> Iterator[tuple[float, Frame]]:
        """Every frame with its time."""
        return ((time, self.frame(k)) for k, time in enumerate(self.times))


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


def write_pvd(path: Path, series: Series) -> Path:
    """Write a series as one VTU file a frame, and the collection that names them."""
    active = 'Vectors="displacement"' + (f' Scalars="{series.coloured_by}"' if series.coloured_by else "")
    size = f'NumberOfPoints="{len(series.points)}" NumberOfCells="{len(series.types)}"'
    # the same in every frame: encoded once
    geometry = (
        f"<Points>\n{_data('Points', series.points)}</Points>\n<Cells>\n"
        f"{_data('connectivity', series.connectivity)}{_data('offsets', series.offsets)}"
        f"{_data('types', series.types)}</Cells>\n"
    )

    def text(time: float, frame: Frame) -> str:
        fields, points, cells = {"TimeValue": time, **frame.fields}, frame.points, frame.cells
        return (
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
            f'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n<FieldData>\n'
            f"{''.join(_field(name, value) for name, value in fields.items())}</FieldData>\n<Piece {size}>\n"
            f"<PointData {active}>\n{''.join(_data(*item) for item in points.items())}</PointData>\n"
            f"<CellData>\n{''.join(_data(*item) for item in cells.items())}</CellData>\n"
            f"{geometry}</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        )

    return write_frames(path, series.times, (text(*timed) for timed in series.timed_frames()), series.names)


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
    path = target_path(path)
    require(path.parent.is_dir(), "path", str(path), "", f"must be in an existing directory: make {path.parent}")
    require(path.suffix in (".pvd", ".vtkhdf"), "path", str(path), "", "must end in .pvd (or .vtkhdf: one file)")
    if path.suffix == ".vtkhdf":
        return path
    folder = path.with_suffix("")
    # what is replaced must be frames: a folder of that name may hold somebody's results
    ours = not folder.exists() or (folder.is_dir() and all(file.suffix == ".vtu" for file in folder.iterdir()))
    require(ours, "path", str(path), "", f"needs the folder {folder.name} for its frames, which holds other files")
    return path


COMPRESSION: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
VERSION = (2, 0)


def write_vtkhdf(
    path: Path,  # ends in `.vtkhdf`
    series: Series,
) -> Path:
    """Write a series as one file."""
    import h5py

    with atomic_path(path) as temporary, GuardedFile(temporary) as guarded, h5py.File(guarded, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(VERSION, dtype=np.int64)
        kind = b"UnstructuredGrid"
        root.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))
        _write_grid(root, series)
        _write_steps(root, series)
        _write_arrays(root, file.create_group("femimpact"), series)
    return path


def _write_grid(root: Any, series: Series) -> None:
    sizes = {
        "NumberOfPoints": len(series.points),
        "NumberOfCells": len(series.types),
        "NumberOfConnectivityIds": len(series.connectivity),
    }
    for name, size in sizes.items():
        root[name] = np.array([size], dtype=np.int64)
    arrays = {
        "Points": series.points,
        "Connectivity": series.connectivity,
        "Offsets": np.concatenate([[0], series.offsets]).astype(np.int64),
        "Types": series.types,
    }
    for name, array in arrays.items():
        root.create_dataset(name, data=array, **COMPRESSION)


def _write_steps(root: Any, series: Series) -> None:
    """Times, and that every frame has the first grid."""
    count = len(series.times)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(count)
    steps["Values"] = np.array(series.times, dtype=float)
    steps["NumberOfParts"] = np.ones(count, dtype=np.int64)
    for name in ("PartOffsets", "PointOffsets"):
        steps[name] = np.zeros(count, dtype=np.int64)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = np.zeros((count, 1), dtype=np.int64)


def _write_arrays(root: Any, about: Any, series: Series) -> None:
    """Arrays of points and cells, one frame behind the other."""
    count = len(series.times)
    groups = {"PointData": len(series.points), "CellData": len(series.types)}
    for kind in groups:
        root.create_group(kind)
        root["Steps"].create_group(f"{kind}Offsets")
    about.attrs["names"] = list(series.names)
    for k, (_, frame) in enumerate(series.timed_frames()):
        if k == 0:
            about.attrs.update(dict(frame.fields))
        for kind, arrays in (("PointData", frame.points), ("CellData", frame.cells)):
            size = groups[kind]
            for name, values in arrays.items():
                if k == 0:
                    shape, chunk = (count * size, *values.shape[1:]), (size, *values.shape[1:])
                    root[kind].create_dataset(name, shape, values.dtype, chunks=chunk, **COMPRESSION)
                    root[f"Steps/{kind}Offsets"][name] = size * np.arange(count, dtype=np.int64)
                root[kind][name][k * size : (k + 1) * size] = values
