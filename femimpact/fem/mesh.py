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

from femimpact.errors import Fault, InputError, checked, quantity, real_array, require, require_type
from femimpact.structure.structure import Structure
from femimpact.table import Head, head_of_values, short_repr

__all__ = ["Mesh", "read_mesh", "uniform_mesh"]

SAME_PLACE = 1e-9
"""Two positions closer than this share of the beam's length are one place."""


MOST_ELEMENTS = 100_000
"""Of a mesh made here; more is taken for a mistake."""


@short_repr
@dataclass(frozen=True, eq=False)
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

    Raises
    ------
    InputError
        If the nodes do not increase, a place is not on the beam, "root", "tip" or "mid" is given another
        place, or a region names an element that is none.
    """

    nodes: NDArray[Any]
    points: Mapping[str, float] = field(default_factory=dict)
    regions: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        allowed = "must be two or more increasing positions"
        nodes = real_array("mesh.nodes", self.nodes, "m", allowed)
        increasing = nodes.ndim == 1 and nodes.size >= 2 and bool(np.all(np.diff(nodes) > 0))
        require(increasing, "mesh.nodes", None, "m", allowed)
        at_root = abs(nodes[0]) <= SAME_PLACE * (nodes[-1] - nodes[0])
        require(bool(at_root), "mesh.nodes", float(nodes[0]), "m", "must begin with the root, at 0 m")
        nodes.setflags(write=False)
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "points", self._checked_points())
        object.__setattr__(self, "regions", self._checked_regions())

    def _checked_points(self) -> dict[str, float]:
        """Places by name: the three that every mesh has, and those given."""
        require_type(self.points, Mapping, "mesh.points")
        root, tip = float(self.nodes[0]), float(self.nodes[-1])
        places = {"root": root, "tip": tip, "mid": 0.5 * (root + tip)}
        slack = SAME_PLACE * (tip - root)
        for name, given in self.points.items():
            require_type(name, str, "mesh.points")
            on_beam = quantity("m", at_least=root - slack, at_most=tip + slack)
            at = min(max(checked(f"mesh.points.{name}", given, on_beam), root), tip)
            # a name that every mesh has means its place: another one would move what is attached there
            meant = abs(at - places.get(name, at)) <= slack
            allowed = f"must lie at {places.get(name, at):.9g} m, where {name!r} is on every beam: take another name"
            require(meant, f"mesh.points.{name}", given, "m", allowed)
            places.setdefault(name, at)
        return places

    def _checked_regions(self) -> dict[str, NDArray[Any]]:
        """Elements by name of their region."""
        require_type(self.regions, Mapping, "mesh.regions")
        regions = {}
        for name, given in self.regions.items():
            require_type(name, str, "mesh.regions")
            key, allowed = f"mesh.regions.{name}", f"must be numbers of elements, 0 to {self.elements - 1}, each once"
            members = real_array(key, given, "", allowed)
            whole = members.ndim == 1 and bool(np.all((members % 1 == 0) & (members >= 0) & (members < self.elements)))
            require(whole and np.unique(members).size == members.size, key, None, "", allowed)
            regions[name] = members.astype(int)
        return regions

    @property
    def _head(self) -> Head:
        lengths = np.diff(self.nodes)
        values = {
            "element lengths": f"{lengths.min():.5g} to {lengths.max():.5g} m",
            "points": ", ".join(f"{name} at {x:.5g} m" for name, x in self.points.items()),
            "regions": ", ".join(f"{name}: {members.size}" for name, members in self.regions.items()) or "none",
        }
        return head_of_values(f"Mesh: {self.elements} elements on {self.nodes[-1]:.5g} m", values)

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
    require_type(structure, Structure, "structure")
    elements = checked("mesh.elements", elements, quantity("1", at_least=1, at_most=MOST_ELEMENTS, integer=True))
    beam = structure.beam
    named = Mesh(np.array([0.0, beam.length])).points
    places = [(key, item.at, structure.place_of(item.at)) for key, item in structure.attachments]
    unknown = [(key, at) for key, at, place in places if isinstance(place, str) and place not in named]
    if unknown:
        raise InputError([Fault(f"{key}.at", at, "", _places_for(key, named, structure)) for key, at in unknown])
    attached = [named[place] if isinstance(place, str) else float(place) for _, _, place in places]
    breaks = np.array(_distinct([*beam.joints, *attached], beam.length))
    stretches = np.diff(breaks)
    wanted = f"must be >= {stretches.size}: one for each stretch between joints and attachments"
    require(elements >= stretches.size, "mesh.elements", elements, "", wanted)
    counts = _share(stretches, elements)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(breaks, breaks[1:], counts, strict=False)]
    nodes = np.concatenate([*pieces, breaks[-1:]])
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    owner = np.searchsorted(np.array(beam.joints[1:-1]), middles)
    regions = {segment.name: np.flatnonzero(owner == i) for i, segment in enumerate(beam.segments)}
    return Mesh(nodes, regions=regions)


def _places_for(key: str, named: Mapping[str, float], structure: Structure) -> str:
    """Places that one item of a structure may have on a mesh made here; a body's own name is none for itself."""
    bodies = [body.name for body in structure.masses if key != f"mass.{body.name}"]
    return f"must be one of {', '.join([*named, *bodies])}, or metres from the root"


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

    require(isinstance(path, (str, Path)), "mesh.file", path, "", "must be the path of a mesh file")
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
    located = bool(np.all(np.isfinite(points)))
    require(located, "mesh.file", label, "", "must hold finite coordinates in x, y and z")
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
