"""Mesh files: read by a separate process, checked to be one unbroken beam along x."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.child_process import child_process
from femimpact.errors import Fault, InputError, require, require_path
from femimpact.fem.mesh import MOST_ELEMENTS, SAME_PLACE, Mesh
from femimpact.regular_file import check_regular

TIME_LIMIT = 30.0
"""Seconds for one file; a beam of 100,000 elements takes two."""

MEMORY_LIMIT = 3_000_000_000
"""Bytes of address space of the process that reads, libraries included."""

MOST_BYTES = 1_000_000_000
"""Most bytes of a mesh file: a larger one does not fit in the memory that the reading process may allocate."""

PIPE_BYTES = 65536
"""Read of a pipe at once; Linux keeps as many."""

BEAMS_ONLY = (
    ": only beams are meshed; of a solid or a plate mesh the mid-line, and give its sections in the segments (width "
    "and thickness, or area and second_moment)"
)
"""Words on a mesh of faces or volumes."""

CHILD = Path(__file__).with_name("mesh_child.py")


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
        In one line with the file and its format: if it is missing, cannot be read, or not within 30 s and 3 GB; holds
        no two-node lines; does not lie along x; or has a gap, a branch or lines on one another, with their places.

    Examples
    --------
    >>> import femimpact as fi
    >>> mesh = fi.read_mesh("meshes/stepped_cantilever.msh")
    >>> sorted(mesh.points)
    ['joint', 'mid', 'root', 'tip']
    """
    require_path(path, "mesh.file", "a mesh file")
    (outcome,) = read_outcomes([Path(path)])
    if isinstance(outcome, InputError):
        raise outcome
    return outcome


def read_outcomes(paths: Sequence[Path]) -> list[Mesh | InputError]:
    """The mesh of each file, or its fault; one process reads them until it has to be ended."""
    unread = {path: reason for path in paths if (reason := _why_not_read(path))}
    # closed here, so that no process outlives the call
    with closing(_read_files([path for path in paths if path not in unread])) as contents:
        return [_outcome(path, unread[path] if path in unread else next(contents)) for path in paths]


def _why_not_read(path: Path) -> str:
    """Why the process may not open a file by its name; empty where it may."""
    try:
        check_regular(path, MOST_BYTES)
    except OSError as error:
        return error.strerror or "cannot be read"
    return ""


def _outcome(path: Path, read: Mapping[str, Any] | str) -> Mesh | InputError:
    """The mesh that a file holds, or the error that says why there is none; `read` is a text of a file not read."""
    try:
        if isinstance(read, str):
            raise InputError([Fault("mesh.file", str(path), "", f"must be an existing mesh file: {read}")])
        kind = read.get("format")
        reason = " ".join(str(read.get("failure")).split())
        allowed = f"must be a mesh that meshio can read{f' as {kind}' if kind else ''}: {reason[:300]}"
        require("failure" not in read, "mesh.file", str(path), "", allowed)
        return _beam_mesh(read, f"{path} ({kind})" if kind else str(path))
    except InputError as error:
        return error


# ---- the process that reads -----------------------------------------------------------------------


def _read_files(paths: Sequence[Path]) -> Generator[Mapping[str, Any]]:
    """The content of each file, or why it could not be read, in order."""
    # one thread: each thread of linear algebra takes address space
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONIOENCODING": "utf-8"}
    done = 0
    while done < len(paths):
        left, contents = map(str, map(Path.resolve, paths[done:])), _Contents()
        command = [sys.executable, "-P", "-W", "ignore", str(CHILD), str(MEMORY_LIMIT), *left]
        with child_process(command, contents.listen, stderr=subprocess.DEVNULL, env=environment) as process:
            while done < len(paths) and not contents.ended:
                done += 1
                yield contents.next(process)


class _Contents:
    """What the process that reads files prints: a line for each."""

    def __init__(self) -> None:
        self.ended = False
        self._output: queue.Queue[bytes] = queue.Queue()
        self._rest = b""

    def listen(self, pipe: IO[bytes]) -> None:
        # no bytes mean that the process has ended
        while part := pipe.read(PIPE_BYTES):
            self._output.put(part)
        self._output.put(b"")

    def next(self, process: subprocess.Popen[bytes]) -> Mapping[str, Any]:
        """The content of the next file, or why it could not be read; `ended` if the process did not survive it."""
        reason = f"not done within {TIME_LIMIT:g} s"
        with suppress(queue.Empty):
            line = self._next_line(time.monotonic() + TIME_LIMIT)
            if line is not None:
                content: Mapping[str, Any] = json.loads(line)
                return content
            reason = f"the process that reads ended with status {process.wait()}"
        self.ended = True
        return {"failure": reason}

    def _next_line(self, deadline: float) -> bytes | None:
        """One complete line, or None at the end; `queue.Empty` is raised where the deadline (s) comes first."""
        parts = [self._rest]
        while b"\n" not in parts[-1]:
            part = self._output.get(timeout=max(deadline - time.monotonic(), 0.0))
            if not part:
                return None
            parts.append(part)
        line, _, self._rest = b"".join(parts).partition(b"\n")
        return line


# ---- from what a file holds to a beam -------------------------------------------------------------


def _beam_mesh(read: Mapping[str, Any], label: str) -> Mesh:
    cells = [(str(kind), data) for kind, data in read["cells"]]
    unsupported = sorted({kind for kind, _ in cells} - {"line", "vertex"})
    solid = any(not kind.startswith("line") for kind in unsupported)
    allowed = f"must hold two-node lines only, found {unsupported}{BEAMS_ONLY if solid else ''}"
    require(not unsupported, "mesh.file", label, "", allowed)
    count = sum(len(data) for kind, data in cells if kind == "line")
    require(0 < count <= 2 * MOST_ELEMENTS, "mesh.file", label, "", f"must hold line elements, 1 to {MOST_ELEMENTS}")
    points = np.asarray(read["points"], dtype=float)
    located = points.ndim == 2 and points.shape[1] in (1, 2, 3) and bool(np.all(np.isfinite(points)))
    require(located, "mesh.file", label, "", "must hold finite coordinates in x, y and z")
    points = np.hstack([points, np.zeros((len(points), 3 - points.shape[1]))])
    for kind, data in cells:
        ends = np.asarray(data)
        shaped = len(data) == 0 or (ends.ndim == 2 and ends.shape[1] == {"line": 2, "vertex": 1}[kind])
        known = shaped and (len(data) == 0 or (ends.min() >= 0 and ends.max() < len(points)))
        require(bool(known), "mesh.file", label, "", "must hold cells between nodes that it defines")
    lines = np.concatenate([np.asarray(data, dtype=int) for kind, data in cells if kind == "line" and data])
    members = _members(read["groups"], cells)
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
    unsaved = ", or a line there has no physical group" if read.get("format") == "gmsh" else ""
    _check_row(ends, nodes, points[order[0], 0], label, unsaved)
    regions = {name: np.unique(ends[owner[chosen], 0]) for name, chosen in members.items() if chosen.size}
    return Mesh(nodes, _named_points(read, cells, rank, nodes), regions)


def _members(groups: Mapping[str, Any], cells: Sequence[tuple[str, Any]]) -> dict[str, NDArray[np.int64]]:
    """Numbers of the lines of each group, lines counted through all blocks."""
    members = {}
    for name, chosen in groups.items():
        parts, offset = [np.zeros(0, dtype=int)], 0
        for (kind, data), part in zip(cells, chosen, strict=False):
            if kind == "line":
                numbers = np.asarray(part or [], dtype=int)
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


def _named_points(
    read: Mapping[str, Any], cells: Sequence[tuple[str, Any]], rank: NDArray[np.int64], nodes: Array
) -> dict[str, float]:
    """Positions of the groups of vertices and nodes that are one node of the beam."""
    points: dict[str, float] = {}
    for name, chosen in read["groups"].items():
        found = [
            data[i][0]
            for (kind, data), part in zip(cells, chosen, strict=False) if kind == "vertex"
            for i in part or [] if 0 <= i < len(data)
        ]  # fmt: skip
        if found:
            place = np.unique(rank[found])
            single = place.size == 1 and bool(place[0] >= 0)
            require(single, "mesh.point", name, "", "must be exactly one node of the beam")
            points[name] = float(nodes[place[0]])
    for name, members in read["nodes"].items():
        place = np.unique([rank[i] for i in members if 0 <= i < rank.size])
        if place.size == 1 and place[0] >= 0:
            points.setdefault(name, float(nodes[place[0]]))
    return points
