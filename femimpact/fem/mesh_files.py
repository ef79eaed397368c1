"""Mesh files: read by meshio, checked to be one unbroken beam along x."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import Fault, InputError, require, require_path
from femimpact.fem.mesh import MOST_ELEMENTS, SAME_PLACE, Mesh
from femimpact.regular_file import open_regular

MOST_BYTES = 1_000_000_000
"""Most bytes of a mesh file."""

MOST_NODES = 1_000_000
"""Most nodes of a mesh file; no beam has as many."""

MOST_VALUES = 64
"""Distinct values of an array of whole numbers up to which they are tags; more are numbers of cells."""

UNGROUPED = (
    "some of its lines or points are in no physical group, as Mesh.SaveAll = 1 leaves them; give each line one, and "
    "save with Mesh.SaveAll = 0"
)
"""What is wrong with cell data of Gmsh that do not fit the cells."""

BEAMS_ONLY = (
    ": only beams are meshed; of a solid or a plate mesh the mid-line, and give its sections in the segments (width "
    "and thickness, or area and second_moment)"
)
"""Words on a mesh of faces or volumes."""


def read_mesh(path: str | Path) -> Mesh:
    """Read a beam mesh: tagged points become names, tagged lines become regions.

    Parameters
    ----------
    path : str or Path
        A file that meshio reads: Gmsh 2.2 and 4.1 with their named points and lines, VTU, VTK, XDMF, Abaqus, MED and
        others. Where a format names nothing, arrays of whole numbers on cells or points do: one of 0 and 1 by its
        name, another by its name and each of its values, as "section 2". Names that hold no line and no single point
        of the beam are left out.

    Returns
    -------
    Mesh
        Nodes sorted along x, the root moved to x = 0.

    Raises
    ------
    InputError
        In one line with the file and its format: if it is missing or cannot be read; holds no two-node lines; does not
        lie along x; or has a gap, a branch or lines on one another, with their places.

    Examples
    --------
    >>> import femimpact as fi
    >>> mesh = fi.read_mesh("meshes/stepped_cantilever.msh")
    >>> sorted(mesh.points)
    ['joint', 'mid', 'root', 'tip']
    """
    require_path(path, "mesh.file", "a mesh file")
    path = Path(path)
    try:
        open_regular(path, MOST_BYTES).close()
    except OSError as error:
        allowed = f"must be an existing mesh file: {error.strerror or 'cannot be read'}"
        raise InputError([Fault("mesh.file", str(path), "", allowed)]) from None
    kind = _format_of(path)
    try:
        content = _content(_raw_mesh(path, kind))
    # what a reader raises on a damaged file is without limit
    except Exception as error:
        reason = " ".join(_reason(error, kind).split())[:300]
        allowed = f"must be a mesh that meshio can read{f' as {kind}' if kind else ''}: {reason}"
        raise InputError([Fault("mesh.file", str(path), "", allowed)]) from None
    return _beam_mesh(content, kind, f"{path} ({kind})")


# ---- what a file holds ----------------------------------------------------------------------------


class _NotReadError(Exception):
    """A file that is no mesh; its words say why."""


def _format_of(path: Path) -> str:
    """The one format in which meshio is to read a file; its name for a suffix that several formats share."""
    import meshio

    known = [name for suffix, names in meshio.extension_to_filetypes.items() if path.name.lower().endswith(suffix)
             for name in names]  # fmt: skip
    if "gmsh" in known:
        with path.open("rb") as file:
            # the sections of the other format with this suffix begin with a bracket
            return "ansys" if file.read(1) == b"(" else "gmsh"
    return known[0] if known else ""


def _raw_mesh(path: Path, kind: str) -> Any:
    """What meshio reads of a file, without its prints; where it would end the process `_NotReadError` is raised."""
    import meshio

    if path.suffix == ".geo":
        mesh_file = path.with_suffix(".msh").name
        raise _NotReadError(f"it is a geometry of gmsh, which makes a mesh of it: gmsh -1 {path.name} -o {mesh_file}")
    if not kind:
        raise _NotReadError(f"no format has the suffix {path.suffix!r}")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            raw = meshio.read(path, file_format=kind)
        except SystemExit:
            raise _NotReadError(" ".join(printed.getvalue().split()) or "it is not in this format") from None
    if len(raw.points) > MOST_NODES:
        raise _NotReadError(f"{len(raw.points)} nodes are more than {MOST_NODES}")
    return raw


def _reason(error: Exception, kind: str) -> str:
    """Why a file is not read, in words."""
    if isinstance(error, _NotReadError):
        return str(error)
    if isinstance(error, MemoryError):
        return "more memory than there is"
    if kind == "gmsh" and "'gmsh:physical'" in str(error):
        return UNGROUPED
    return f"{type(error).__name__}: {error}".rstrip(": ")


@dataclass(frozen=True, eq=False)
class _Content:
    """Coordinates, cells by type, and groups of cells, by block, and of nodes, by name."""

    points: Array
    cells: list[tuple[str, NDArray[Any]]]
    groups: dict[str, list[NDArray[Any] | None]]
    nodes: dict[str, NDArray[Any]]


def _content(raw: Any) -> _Content:
    """The content of a mesh that meshio has read.

    Groups are those that the format names. Where it names none, an array of whole numbers is one: its name alone
    where it holds 0 and 1, else with each of its values.
    """
    cells = [(block.type, np.asarray(block.data)) for block in raw.cells]
    groups: dict[str, list[NDArray[Any] | None]] = {}
    nodes: dict[str, NDArray[Any]] = {}
    for name, chosen in raw.cell_sets.items():
        if not name.startswith("gmsh:"):
            groups[name] = [None if part is None else np.asarray(part, dtype=int) for part in chosen]
    for name, chosen in raw.point_sets.items():
        nodes[name] = np.asarray(chosen, dtype=int)
    for name, values in raw.cell_data.items():
        if name == "gmsh:physical":
            for label, chosen in _physical(raw, values).items():
                groups.setdefault(label, chosen)
            continue
        for label, tags in _labels(raw, name, values).items():
            groups.setdefault(label, [np.flatnonzero(np.isin(part, tags)) for part in values])
    for name, values in raw.point_data.items():
        for label, tags in _labels(raw, name, [values]).items():
            nodes.setdefault(label, np.flatnonzero(np.isin(values, tags)))
    return _Content(np.asarray(raw.points, dtype=float), cells, groups, nodes)


def _physical(raw: Any, values: Any) -> dict[str, list[NDArray[Any] | None]]:
    """Groups that Gmsh 2 and 4.0 name by a number, with their dimension; those of 4.1 are sets already."""
    dimension = [{"vertex": 0, "line": 1}.get(block.type, 2) for block in raw.cells]
    return {
        str(label): [
            np.flatnonzero(np.asarray(part) == int(tag)) if dim == int(space) else None
            for dim, part in zip(dimension, values, strict=True)
        ]
        for label, (tag, space) in raw.field_data.items()
    }


def _labels(raw: Any, name: str, values: Any) -> dict[str, list[int]]:
    """Names that an array of cells or nodes gives, and the values that each of them stands for."""
    if name in ("cell_tags", "point_tags"):
        families = getattr(raw, name, None) or {}
        numbers: dict[str, list[int]] = {}
        for value, labels in families.items():
            for label in labels:
                numbers.setdefault(str(label), []).append(int(value))
        return numbers
    arrays = [np.asarray(part) for part in values]
    if name.startswith("gmsh:") or any(array.ndim != 1 or array.dtype.kind not in "iub" for array in arrays):
        return {}
    distinct = np.unique(np.concatenate(arrays)) if arrays else np.zeros(0)
    if distinct.size > MOST_VALUES:
        return {}
    if np.all(np.isin(distinct, (0, 1))):
        return {name: [1]}
    return {f"{name} {value}": [int(value)] for value in distinct}


# ---- from what a file holds to a beam -------------------------------------------------------------


def _beam_mesh(content: _Content, kind: str, label: str) -> Mesh:
    points, cells = content.points, content.cells
    unsupported = sorted({of_type for of_type, _ in cells} - {"line", "vertex"})
    solid = any(not of_type.startswith("line") for of_type in unsupported)
    allowed = f"must hold two-node lines only, found {unsupported}{BEAMS_ONLY if solid else ''}"
    require(not unsupported, "mesh.file", label, "", allowed)
    count = sum(len(ends) for of_type, ends in cells if of_type == "line")
    require(0 < count <= 2 * MOST_ELEMENTS, "mesh.file", label, "", f"must hold line elements, 1 to {MOST_ELEMENTS}")
    located = points.ndim == 2 and points.shape[1] in (1, 2, 3) and bool(np.all(np.isfinite(points)))
    require(located, "mesh.file", label, "", "must hold finite coordinates in x, y and z")
    points = np.hstack([points, np.zeros((len(points), 3 - points.shape[1]))])
    for of_type, ends in cells:
        shaped = len(ends) == 0 or (ends.ndim == 2 and ends.shape[1] == {"line": 2, "vertex": 1}[of_type])
        known = shaped and (len(ends) == 0 or (ends.min() >= 0 and ends.max() < len(points)))
        require(bool(known), "mesh.file", label, "", "must hold cells between nodes that it defines")
    lines = np.concatenate([ends.astype(int) for of_type, ends in cells if of_type == "line" and len(ends)])
    members = _members(content.groups, cells)
    lines, owner = _merged(lines, members)
    _check_branches(lines, points, label)
    used = np.unique(lines)
    x, *beside = np.ptp(points[used], axis=0)
    size = f"x {x:.4g}, y {beside[0]:.4g}, z {beside[1]:.4g} m"
    along_x = x > 0 and max(beside) <= SAME_PLACE * x
    require(along_x, "mesh.file", label, "", f"must lie along the x axis; its extent is {size}")
    order = used[np.argsort(points[used, 0], kind="stable")]
    nodes = points[order, 0] - points[order[0], 0]
    rank = np.full(len(points), -1)
    rank[order] = np.arange(order.size)
    ends = np.sort(rank[lines], axis=1)
    # Gmsh writes no line that is in no group, once there are groups
    unsaved = ", or a line there has no physical group" if kind == "gmsh" else ""
    _check_row(ends, nodes, points[order[0], 0], label, unsaved)
    regions = {name: np.unique(ends[owner[chosen], 0]) for name, chosen in members.items() if chosen.size}
    return Mesh(nodes, _named_points(content, rank, nodes), regions)


def _members(groups: Mapping[str, Any], cells: Sequence[tuple[str, NDArray[Any]]]) -> dict[str, NDArray[np.int64]]:
    """Numbers of the lines of each group, lines counted through all blocks."""
    members = {}
    for name, chosen in groups.items():
        parts, offset = [np.zeros(0, dtype=int)], 0
        for (kind, data), part in zip(cells, chosen, strict=False):
            if kind == "line":
                numbers = np.asarray([] if part is None else part, dtype=int)
                parts.append(offset + numbers[(numbers >= 0) & (numbers < len(data))])
                offset += len(data)
        members[name] = np.concatenate(parts)
    return members


def _merged(
    lines: NDArray[np.int64], members: Mapping[str, NDArray[np.int64]]
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Lines with those that Gmsh 2 repeats for each group they are in as one; the new number of each line."""
    tags = np.zeros((len(lines), len(members)), dtype=bool)
    for i, chosen in enumerate(members.values()):
        tags[chosen, i] = True
    pairs, owner, count = np.unique(np.sort(lines, axis=1), axis=0, return_inverse=True, return_counts=True)
    owner = owner.ravel()
    if pairs.shape[0] == len(lines):
        return lines, np.arange(len(lines))
    total = np.zeros((len(pairs), len(members)), dtype=int)
    np.add.at(total, owner, tags)
    # each of the repeated ones in one group, and no two in the same: anything else is a line on another
    repeated = np.all(total <= 1, axis=1) & (total.sum(axis=1) == count)
    if not np.all(repeated[count > 1]):
        return lines, np.arange(len(lines))
    return pairs, owner


def _check_branches(lines: NDArray[np.int64], points: Array, label: str) -> None:
    degree = np.bincount(np.unique(np.sort(lines, axis=1), axis=0).ravel(), minlength=len(points))
    busy = int(np.argmax(degree))
    place = ", ".join(f"{x:.6g}" for x in points[busy])
    allowed = f"must be one unbroken row of line elements: a branch at ({place}) m, where {degree[busy]} lines meet"
    require(degree[busy] <= 2, "mesh.file", label, "", allowed)


def _check_row(ends: NDArray[np.int64], nodes: Array, root: float, label: str, unsaved: str) -> None:
    """Refuse lines (n, 2) between sorted nodes that are not one line between each two neighbours.

    `unsaved` is what else may be wrong where one is missing.
    """
    between = np.zeros(nodes.size - 1, dtype=int)
    # +1 where a line begins and -1 where it ends: the number of lines over each stretch
    steps = np.zeros(nodes.size, dtype=int)
    np.add.at(steps, ends[:, 0], 1)
    np.add.at(steps, ends[:, 1], -1)
    between[:] = np.cumsum(steps)[:-1]
    coincident = np.flatnonzero(np.diff(nodes) <= SAME_PLACE * nodes[-1])
    fault = ""
    if coincident.size:
        joined = between[coincident[0]] > 0
        at = f"x = {root + nodes[coincident[0]]:.6g} m"
        fault = f"a line of no length at {at}" if joined else f"a gap at {at}: two nodes there that no line joins"
    elif np.any(between != 1):
        first = int(np.flatnonzero(between != 1)[0])
        span = f"from x = {root + nodes[first]:.6g} to {root + nodes[first + 1]:.6g} m"
        fault = f"a gap {span}{unsaved}" if between[first] == 0 else f"{between[first]} lines on one another {span}"
    elif np.any(ends[:, 0] == ends[:, 1]):
        fault = f"a line of no length at x = {root + nodes[ends[ends[:, 0] == ends[:, 1], 0][0]]:.6g} m"
    require(not fault, "mesh.file", label, "", f"must be one unbroken row of line elements: {fault}")


def _named_points(content: _Content, rank: NDArray[np.int64], nodes: Array) -> dict[str, float]:
    """Positions of the groups of vertices and nodes that are one node of the beam."""
    points: dict[str, float] = {}
    for name, chosen in content.groups.items():
        named_nodes = [
            data[i][0]
            for (kind, data), part in zip(content.cells, chosen, strict=False) if kind == "vertex"
            for i in ([] if part is None else part) if 0 <= i < len(data)
        ]  # fmt: skip
        if named_nodes:
            place = np.unique(rank[named_nodes])
            single = place.size == 1 and bool(place[0] >= 0)
            require(single, "mesh.point", name, "", "must be exactly one node of the beam")
            points[name] = float(nodes[place[0]])
    for name, members in content.nodes.items():
        place = np.unique([rank[i] for i in members if 0 <= i < rank.size])
        if place.size == 1 and place[0] >= 0:
            points.setdefault(name, float(nodes[place[0]]))
    return points
