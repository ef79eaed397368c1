"""A whole series in one temporal VTKHDF file of version 2.0: the grid once, then every frame's arrays.

Read by VTK 9.3 and ParaView 5.12 or newer, which came first with time in the format. Field data is not in it: what a
`.pvd` keeps there is in attributes of the group `femimpact`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from femimpact.export.files import GuardedFile, atomic_path
from femimpact.export.vtk.series import Series

__all__ = ["write_vtkhdf"]

COMPRESSION: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
VERSION = (2, 0)


def write_vtkhdf(path: Path, series: Series) -> Path:
    """Write a series, whole or not at all.

    Parameters
    ----------
    path : Path
        Ends in `.vtkhdf`.
    series : Series

    Returns
    -------
    Path
    """
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
