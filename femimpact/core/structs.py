"""The structs of arrays that functions of the core take, as named tuples, and arrays of their types and shapes."""

from __future__ import annotations

import functools
import math
import re
from collections import namedtuple
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np

Struct = TypeVar("Struct", bound=tuple[Any, ...])

Table = list[tuple[str, str, str, int]]
"""Name with those of the tuples around it, type, shape and writability of every value; see `core.tables`."""


def structs_of(table: Table, arguments: tuple[str, ...], rows: str) -> SimpleNamespace:
    """Named tuples of some arguments and of the tuples within them, by the names of their structs; and names of rows.

    Each tuple has in `_table` its fields but for numbers: an array with its type and the words of its axes, or a tuple.
    """
    of_path = {path: name for path, kind, name, _ in table if kind == "tuple" and path.partition(".")[0] in arguments}
    fields: dict[str, dict[str, tuple[str, str]]] = {name: {} for name in of_path.values()}
    space = SimpleNamespace()
    for path, kind, shape, _ in table:
        outer, _, field = path.rpartition(".")
        if outer in of_path:
            fields[of_path[outer]][field] = kind, shape
        elif (path, kind) == (rows, "names"):
            vars(space).update((name, number) for number, name in enumerate(shape.split(", ")))
    for name, kinds in fields.items():
        vars(space)[name] = namedtuple(name, kinds)
    for name, kinds in fields.items():
        vars(space)[name]._table = [
            (field, getattr(space, shape), []) if kind == "tuple" else (field, np.dtype(kind), shape.split())
            for field, (kind, shape) in kinds.items()
            if shape
        ]
    return space


def zeros(struct: type[Struct], lengths: Mapping[str, int], **members: Any) -> Struct:
    """A struct with arrays of zeros, but for the members that are given; all its numbers and tuples must be.

    The struct is a named tuple of `core.events` or `core.steps`, the lengths are those of the letters in its shapes.
    """
    for name, kind, shape, _ in _layout(struct, tuple(lengths.items()), frozenset(members))[0]:
        members[name] = np.zeros(shape, kind)
    return struct(**members)


LINE = 64
"""Bytes of a cache line."""


def zeros_together(struct: type[Struct], lengths: Mapping[str, int]) -> Struct:
    """A struct of arrays of zeros and of tuples of these, in one piece of memory, no two on one cache line.

    Threads that write to one line wait for each other, and accesses a multiple of the page size apart are mistaken
    for one another by the processor.
    """
    layout = _layout(struct, tuple(lengths.items()))
    memory = np.zeros(layout[1] + 4 * LINE, dtype=np.uint8)

    def placed(kind: Any, layout: Any, first: int) -> Any:
        """The array or the tuple that begins at a byte."""
        if isinstance(kind, np.dtype):
            return np.ndarray(layout, kind, memory, first)
        return kind(*(placed(kind, shape, first + place) for _, kind, shape, place in layout[0]))

    filled: Struct = placed(struct, layout, 2 * LINE + (-memory.ctypes.data) % LINE)
    return filled


@functools.lru_cache(maxsize=256)
def _layout(
    struct: Any, lengths: tuple[tuple[str, int], ...], without: frozenset[str] = frozenset()
) -> tuple[list[tuple[str, Any, Any, int]], int]:
    """Name, type, shape and place (bytes) of each array of a struct, and the bytes of them, in whole cache lines.

    The shape of a tuple within it is its layout.
    """
    length_of, members, size = dict(lengths), list[tuple[str, Any, Any, int]](), 0

    def length(axis: str) -> int:
        """That of an axis by its words, a sum of products as 2R+O or dK."""
        terms = (re.findall(r"\d+|\w", term) for term in axis.split("+"))
        return sum(math.prod(int(word) if word.isdigit() else length_of[word] for word in term) for term in terms)

    for name, kind, axes in struct._table:
        if name not in without:
            is_array = isinstance(kind, np.dtype)
            shape = tuple(map(length, axes)) if is_array else _layout(kind, lengths)
            members.append((name, kind, shape, size))
            size += -(-kind.itemsize * math.prod(shape) // LINE) * LINE if is_array else shape[1]
    return members, size
