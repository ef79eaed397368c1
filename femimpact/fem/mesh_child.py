"""The process that reads mesh files: a separate script, for readers that raise, print, loop or fill the memory.

Run as `python -P mesh_child.py MEMORY FILE...`, it prints a line of JSON for each file: what the file holds as plain
lists, or why it could not be read. It ends when its standard input is closed, as it is when the parent is gone.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import threading
from pathlib import Path
from typing import Any

import meshio
import numpy as np

MOST_NODES = 1_000_000
"""Most nodes of a mesh file; no beam has as many."""


MOST_VALUES = 64
"""Distinct values of an array of whole numbers up to which they are tags; more are numbers of cells."""


UNGROUPED = (
    "some of its lines or points are in no physical group, as Mesh.SaveAll = 1 leaves them; give each line one, and "
    "save with Mesh.SaveAll = 0"
)
"""The words of meshio for cell data that do not fit the cells."""


def format_of(path: Path) -> str:
    """The one format in which meshio is to read a file; its name for a suffix that several formats share."""
    known = [name for suffix, names in meshio.extension_to_filetypes.items() if path.name.lower().endswith(suffix)
             for name in names]  # fmt: skip
    if "gmsh" in known:
        with path.open("rb") as file:
            # the sections of the other format with this suffix begin with a bracket
            return "ansys" if file.read(1) == b"(" else "gmsh"
    return known[0] if known else ""


def read_plainly(path: Path) -> dict[str, Any]:
    """The content of a mesh file as plain lists; under "failure" why it could not be read."""
    kind, words = format_of(path), io.StringIO()
    if path.suffix == ".geo":
        mesh = path.with_suffix(".msh").name
        return {"failure": f"it is a geometry of gmsh, which makes a mesh of it: gmsh -1 {path.name} -o {mesh}"}
    if not kind:
        return {"failure": f"no format has the suffix {path.suffix!r}"}
    try:
        with contextlib.redirect_stdout(words):
            raw = meshio.read(path, file_format=kind)
        if len(raw.points) > MOST_NODES:
            return {"format": kind, "failure": f"{len(raw.points)} nodes are more than {MOST_NODES}"}
        return {"format": kind} | plain_mesh(raw)
    except MemoryError:
        reason = "more memory than allowed"
    # what a reader raises on a damaged file is without limit; it ends the process where nothing can be read
    except (Exception, SystemExit) as error:
        if isinstance(error, SystemExit):
            reason = " ".join(words.getvalue().split()) or "it is not in this format"
        elif kind == "gmsh" and "'gmsh:physical'" in str(error):
            reason = UNGROUPED
        else:
            reason = f"{type(error).__name__}: {error}".rstrip(": ")
    return {"format": kind, "failure": reason}


def plain_mesh(raw: Any) -> dict[str, Any]:
    """Coordinates, cells by type and the groups of cells and nodes of a mesh that meshio has read.

    Groups are those that the format names. Where it names none, an array of whole numbers is one: its name alone
    where it holds 0 and 1, else with each of its values.
    """
    cells = [(block.type, np.asarray(block.data)) for block in raw.cells]
    groups: dict[str, list[list[int] | None]] = {}
    nodes: dict[str, list[int]] = {}
    for name, chosen in raw.cell_sets.items():
        if not name.startswith("gmsh:"):
            groups[name] = [None if part is None else np.asarray(part, dtype=int).tolist() for part in chosen]
    for name, chosen in raw.point_sets.items():
        nodes[name] = np.asarray(chosen, dtype=int).tolist()
    for name, values in raw.cell_data.items():
        if name == "gmsh:physical":
            for label, chosen in _physical(raw, values).items():
                groups.setdefault(label, chosen)
            continue
        for label, tags in _labels(raw, name, values).items():
            groups.setdefault(label, [np.flatnonzero(np.isin(part, tags)).tolist() for part in values])
    for name, values in raw.point_data.items():
        for label, tags in _labels(raw, name, [values]).items():
            nodes.setdefault(label, np.flatnonzero(np.isin(values, tags)).tolist())
    return {
        "points": np.asarray(raw.points, dtype=float).tolist(),
        "cells": [[kind, data.tolist() if kind in ("line", "vertex") else len(data)] for kind, data in cells],
        "groups": groups,
        "nodes": nodes,
    }


def _physical(raw: Any, values: Any) -> dict[str, list[list[int] | None]]:
    """Groups that Gmsh 2 and 4.0 name by a number, with their dimension; those of 4.1 are sets already."""
    dimension = [{"vertex": 0, "line": 1}.get(block.type, 2) for block in raw.cells]
    return {
        str(label): [
            np.flatnonzero(np.asarray(part) == int(tag)).tolist() if dim == int(space) else None
            for dim, part in zip(dimension, values, strict=True)
        ]
        for label, (tag, space) in raw.field_data.items()
    }


def _labels(raw: Any, name: str, values: Any) -> dict[str, list[int]]:
    """Names that an array of cells or nodes gives, and the values that each of them stands for."""
    tables = {"cell_tags": "cell_tags", "point_tags": "point_tags"}
    if name in tables:
        families = getattr(raw, tables[name], None) or {}
        found: dict[str, list[int]] = {}
        for value, labels in families.items():
            for label in labels:
                found.setdefault(str(label), []).append(int(value))
        return found
    arrays = [np.asarray(part) for part in values]
    if name.startswith("gmsh:") or any(array.ndim != 1 or array.dtype.kind not in "iub" for array in arrays):
        return {}
    distinct = np.unique(np.concatenate(arrays)) if arrays else np.zeros(0)
    if distinct.size > MOST_VALUES:
        return {}
    if np.all(np.isin(distinct, (0, 1))):
        return {name: [1]}
    return {f"{name} {value}": [int(value)] for value in distinct}


def _limit_memory(most: int) -> None:
    """Let allocations beyond a number of bytes fail, where the system can."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        limit = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(resource.RLIMIT_AS, (limit, hard))


def _end_with_parent() -> None:
    # not by `sys.stdin`: its lock, held by a thread that waits, stops Python at its end
    while os.read(0, 1):
        pass
    os._exit(1)


def main(memory: str, *files: str) -> None:
    """Read files one after the other, within a memory (bytes), and write their contents to the former stdout."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    output = os.fdopen(os.dup(1), "w", encoding="utf-8")
    silence = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(silence, descriptor)
    _limit_memory(int(memory))
    for file in files:
        try:
            line = json.dumps(read_plainly(Path(file)))
        except MemoryError:
            line = json.dumps({"failure": "more memory than allowed"})
        except Exception as error:
            line = json.dumps({"failure": f"{type(error).__name__}: {error}"})
        print(line, file=output, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
