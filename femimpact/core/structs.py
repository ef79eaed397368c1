"""The structs of arrays that functions of the core take, as named tuples, and arrays of their types and shapes."""

from __future__ import annotations

import functools
import math
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
            (field, None, getattr(space, shape)) if kind == "tuple" else (field, np.dtype(kind), shape.split())
            for field, (kind, shape) in kinds.items()
            if shape
        ]
    return space


def zeros(struct: type[Struct], lengths: Mapping[str, int], **members: Any) -> Struct:
    """A struct with arrays of zeros, but for the members that are given; all its numbers must be.

    The struct is a named tuple of `core.events` or `core.steps`, the lengths are those of the letters in its shapes.
    """
    filled: Struct = _zeros(struct, _Lengths(lengths), members)
    return filled


def _zeros(struct: Any, lengths: _Lengths, members: dict[str, Any]) -> Any:
    arrays = {
        name: _zeros(axes, lengths, {}) if kind is None else np.zeros([lengths[axis] for axis in axes], kind)
        for name, kind, axes in struct._table
        if name not in members
    }
    return struct(**arrays, **members)


class _Lengths(dict[str, int]):
    """Lengths of axes by their words, as 2R+O or dK, from those of single letters."""

    def __missing__(self, axis: str) -> int:
        self[axis] = sum(math.prod(map(self.__getitem__, factors), start=number) for number, factors in _terms(axis))
        return self[axis]


@functools.cache
def _terms(axis: str) -> list[tuple[int, str]]:
    """Terms of a sum of products, each by its number and its letters."""
    return [(int(term[0]), term[1:]) if term[0].isdigit() else (1, term) for term in axis.split("+")]
