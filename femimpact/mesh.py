"""Meshes of a beam along x: sorted nodes, named points, named regions."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import Fault, InputError, require
from femimpact.structure import Structure

__all__ = ["Mesh", "read_mesh", "uniform_mesh"]

SAME_PLACE = 1e-9
"""Two positions closer than this share of the beam's length are one place."""


@dataclass(frozen=True)
class Mesh:
    """Line elements between sorted nodes.

    Parameters
    ----------
    nodes : ndarray (n,), m
        Increasing, root first.
    points : mapping of str to float
        Named places, m from the root; "root", "tip" and "mid" are always there.
    regions : mapping of str to ndarray
        Element numbers of each named region.
    """

    nodes: NDArray[Any]
    points: Mapping[str, float] = field(default_factory=dict)
    regions: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        nodes = np.array(self.nodes, dtype=float)
        increasing = nodes.ndim == 1 and nodes.size >= 2 and bool(np.all(np.diff(nodes) > 0))
        require(increasing, "mesh.nodes", None, "m", "must be two or more increasing positions")
        nodes.setflags(write=False)
        root, tip = float(nodes[0]), float(nodes[-1])
        standard = {"root": root, "tip": tip, "mid": 0.5 * (root + tip)}
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "points", {**standard, **self.points})

    @property
    def elements(self) -> int:
        """Number of elements."""
        return self.nodes.size - 1


def _distinct(positions: Iterable[float], length: float) -> list[float]:
    """Sorted positions without those that coincide with the one before."""
    places: list[float] = []
    for x in sorted(positions):
        if not places or x - places[-1] > SAME_PLACE * length:
            places.append(x)
    if length - places[-1] <= SAME_PLACE * length:
        places[-1] = length
    return places


def uniform_mesh(structure: Structure, elements: int) -> Mesh:
    """A mesh of N elements with a node at every joint, support, mass and impactor.

    The elements are shared out among the stretches between those places in proportion to their
    lengths, at least one each; a uniform cantilever with everything at its tip gets N equal ones.

    Parameters
    ----------
    structure : Structure
    elements : int
        Number of elements.

    Returns
    -------
    Mesh

    Raises
    ------
    InputError
        If there are fewer elements than stretches, or a place is named that no mesh gives.
    """
    whole = isinstance(elements, (int, np.integer)) and not isinstance(elements, bool) and elements >= 1
    require(whole, "mesh.elements", elements, "", "must be a whole number >= 1")
    beam = structure.beam
    named = Mesh(np.array([0.0, beam.length])).points
    allowed = f"must be one of {', '.join(named)}, or metres from the root"
    unknown = [
        (key, item.at) for key, item in structure.attachments if isinstance(item.at, str) and item.at not in named
    ]
    if unknown:
        raise InputError([Fault(f"{key}.at", at, "", allowed) for key, at in unknown])
    attached = [named[item.at] if isinstance(item.at, str) else float(item.at) for _, item in structure.attachments]
    breaks = np.array(_distinct([*beam.joints, *attached], beam.length))
    stretches = np.diff(breaks)
    wanted = f"must be >= {stretches.size}: one for each stretch between joints and attachments"
    require(elements >= stretches.size, "mesh.elements", elements, "", wanted)
    counts = _share(stretches, int(elements))
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(breaks, breaks[1:], counts, strict=False)]
    nodes = np.concatenate([*pieces, breaks[-1:]])
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    owner = np.searchsorted(np.array(beam.joints[1:-1]), middles)
    regions = {segment.name: np.flatnonzero(owner == i) for i, segment in enumerate(beam.segments)}
    return Mesh(nodes, regions=regions)


def _share(lengths: NDArray[Any], total: int) -> NDArray[Any]:
    """Whole numbers >= 1 with the given total: the longest element is split, again and again."""
    counts = np.ones(lengths.size, dtype=int)
    for _ in range(total - lengths.size):
        counts[np.argmax(lengths / counts)] += 1
    return counts


def read_mesh(path: str | Path) -> Mesh:
    """Read a beam mesh: tagged points become names, tagged lines become regions.

    Parameters
    ----------
    path : str or Path
        A file that meshio reads; Gmsh 4.1 keeps interior tagged points.

    Returns
    -------
    Mesh
        Nodes sorted along x, the root moved to x = 0.

    Raises
    ------
    InputError
        If the file is missing or unreadable, holds no two-node lines, does not lie along x,
        or its lines do not form one unbroken beam.
    """
    import meshio

    path = Path(path)
    require(path.is_file(), "mesh.file", str(path), "", "must be an existing mesh file")
    try:
        # meshio prints an empty line for Gmsh 4.1, and ends the process on an unknown format
        with contextlib.redirect_stdout(io.StringIO()):
            raw = meshio.read(path)
    except (meshio.ReadError, ValueError, KeyError, IndexError, SystemExit) as error:
        message = f"must be a mesh that meshio can read ({type(error).__name__}: {error})"
        require(False, "mesh.file", str(path), "", message)
    return _from_meshio(raw, str(path))


def _from_meshio(raw: Any, label: str) -> Mesh:
    unsupported = sorted({block.type for block in raw.cells} - {"line", "vertex"})
    require(not unsupported, "mesh.file", label, "", f"must hold two-node lines only, found {unsupported}")
    lines = [block.data for block in raw.cells if block.type == "line"]
    require(len(lines) > 0, "mesh.file", label, "", "must hold line elements")
    segments = np.concatenate(lines)
    used = np.unique(segments)
    points = np.asarray(raw.points, dtype=float)[used]
    points = np.hstack([points, np.zeros((len(points), 3 - points.shape[1]))])
    extent = np.ptp(points, axis=0)
    along_x = extent[0] > 0 and max(extent[1], extent[2]) <= SAME_PLACE * extent[0]
    size = f"x {extent[0]:.4g}, y {extent[1]:.4g}, z {extent[2]:.4g} m"
    require(along_x, "mesh.file", label, "", f"must lie along the x axis; its extent is {size}")

    order = np.argsort(points[:, 0])
    nodes = points[order, 0] - points[order[0], 0]
    rank = np.full(len(raw.points), -1)
    rank[used[order]] = np.arange(used.size)
    ends = np.sort(rank[segments], axis=1)
    unbroken = bool(np.array_equal(np.sort(ends[:, 0]), np.arange(used.size - 1)))
    unbroken = unbroken and bool(np.all(ends[:, 1] == ends[:, 0] + 1))
    require(unbroken, "mesh.file", label, "", "must be one unbroken row of line elements, none on another")
    named, regions = _groups(raw, rank, nodes, ends[:, 0])
    return Mesh(nodes, named, regions)


def _groups(
    raw: Any, rank: NDArray[Any], nodes: NDArray[Any], element_of_line: NDArray[Any]
) -> tuple[dict[str, float], dict[str, NDArray[Any]]]:
    """Positions of tagged points and elements of tagged lines, by the names of their groups."""
    points: dict[str, float] = {}
    regions: dict[str, NDArray[Any]] = {}
    for name, blocks in raw.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        offset = 0
        members: list[NDArray[Any]] = []
        for block, chosen in zip(raw.cells, blocks, strict=True):
            indices = np.asarray(chosen if chosen is not None else [], dtype=int)
            if block.type == "line":
                members.append(element_of_line[offset + indices])
                offset += len(block.data)
            elif indices.size:
                place = rank[block.data[indices, 0]]
                single = place.size == 1 and bool(place[0] >= 0)
                require(single, "mesh.point", name, "", "must be exactly one node of the beam")
                points[name] = float(nodes[place[0]])
        elements = np.sort(np.concatenate(members)) if members else np.array([], dtype=int)
        if elements.size:
            regions[name] = elements
    return points, regions
