"""The key of a study: a hash of its data, of the code of its functions, of femimpact's sources and of library versions.

Equal keys have equal results. Values are written as plain data, in types of JSON: nouns by their fields, arrays by a
hash of their content, functions and classes of the user by their code and by all that it takes from elsewhere, those
of libraries by their names. Code is read, not run (`function_code`). What cannot be followed is refused: it needs a
version in its place.
"""

from __future__ import annotations

import builtins
import copyreg
import dataclasses
import hashlib
import inspect
import json
import sys
import types
import weakref
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sparse

from femimpact.core.binary import build_words
from femimpact.errors import Fault, InputError
from femimpact.parametric.definition import ParameterStudy
from femimpact.parametric.function_code import (
    NotComparableError,
    check_open,
    code_hash,
    global_names,
    imported_modules,
    is_library,
    is_library_file,
    is_library_module,
    named,
    source_files,
)
from femimpact.study.study import Study
from femimpact.system.system import System

NUMERICAL = ("contact", "excitation", "fem", "integrators", "response", "structure", "system", "parametric")
"""Folders whose sources decide the numbers."""

BESIDE = ("study/study.py", "study/parameter_plan.py", "study/drives.py", "study/starts.py")
"""Files of other folders whose sources do."""

WITHOUT = ("text", "path", "plan", "output", "sweep", "orbits")
"""Fields of a study that do not change its cases."""

COMPILED_PLAINLY = {"nopython": True, "boundscheck": None}
"""Options of a function that Numba has compiled, where none is given."""

OF_INTERPRETER = {
    "__dict__", "__weakref__", "__doc__", "__module__", "__firstlineno__", "__static_attributes__",
    "__annotations_cache__", "__slotnames__", "_abc_impl", "_value2member_map_",
}  # fmt: skip
"""Attributes of a class that do not decide what it does, or that are filled while it is used."""

# ---- the key -----------------------------------------------------------------------------------------


@cache
def sources_key() -> str:
    """Hash of the sources of the numerical folders."""
    root = Path(__file__).parent.parent
    digest = hashlib.sha256()
    sources = sorted(path for folder in NUMERICAL for path in (root / folder).rglob("*.py"))
    for path in (*sources, *(root / name for name in BESIDE)):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def code_key() -> str:
    """Hash of the sources of the numerical folders, of the core, and of the versions of numpy and scipy."""
    words = f"{sources_key()} {build_words()} numpy {np.__version__} scipy {scipy.__version__}"
    return hashlib.sha256(words.encode()).hexdigest()


def plain_study(study: ParameterStudy) -> dict[str, Any]:
    """The study as plain data: two that are equal give the same results with the same code.

    Raises `InputError` if a function has no code that could be compared, and there is no version.
    """
    given: Any = study.study
    axes = {
        place.path: [_compared(value, study.version) for value in levels]
        for place, levels in zip(study.table.places, study.table.levels, strict=True)
    }
    return {
        "study": _compared(given, study.version),
        "mesh": None if study.systems.mesh is None else _compared(study.systems.mesh, None),
        "axes": axes,
        # decides the numbers of the cases
        "order": list(axes),
        "cases": "grid" if study.table.is_grid else [_digest(codes) for codes in study.table.codes],
        "measures": [
            item.name if item.function is None else _compared(item.function, study.version) for item in study.chosen
        ],
        "starts": study.starts,
        "seed": study.seed if study.starts > 1 else None,
        "cycles": study.dwell,
        "base": study.base,
        "at": study.observed,
        "method": _compared(study.method, study.version),
        **({} if isinstance(given, (Study, System)) else {"elements": study.elements, "modes": study.modes}),
    }


def study_key(plain: Mapping[str, Any]) -> str:
    """Hash of a study in plain data and of the code."""
    text = json.dumps([plain, code_key()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _compared(value: Any, version: str | None) -> Any:
    """A value as plain data; `InputError` if it cannot be compared."""
    try:
        return _plain(value, _Walk(version))
    except Exception as error:
        # also one that an object of the user raises when it is looked at
        what = "too many that hold one another" if isinstance(error, RecursionError) else error
        allowed = (
            f"uses a value that a later call cannot recognise ({what}): "
            "give version='...', a text that you change whenever the numbers change"
        )
        raise InputError([Fault("study", _name(value), "", allowed)]) from None


# ---- values ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Walk:
    """State of the walk from a value to all that it depends on."""

    version: str | None = None  # in place of the code of functions
    # names of the module of the first function: its file does not count, but what is taken from it
    home: Mapping[str, Any] = field(default_factory=dict)
    # functions, lists and modules that hold the value: one that holds itself is not looked at again
    above: tuple[Any, ...] = ()
    # numbers of the objects and classes that were met, and of functions of other modules, by their id
    seen: dict[int, tuple[int, Any]] = field(default_factory=dict)
    # hashes of the files that were met, by the names of their modules
    files: dict[str, str] = field(default_factory=dict)

    def into(self, value: Any) -> _Walk:
        """The walk below a value."""
        return replace(self, above=(*self.above, value))

    def is_above(self, value: Any) -> bool:
        return any(item is value for item in self.above)


def _plain(value: Any, walk: _Walk) -> Any:
    """A value as plain data."""
    if type(value) in (type(None), bool, int, str):
        return value
    if walk.version is None and not isinstance(value, type) and not is_library(type(value)):
        return _once(value, _object, walk)
    if isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else repr(value)
    if isinstance(value, (np.integer, np.floating, np.bool_)):
        return _plain(value.item(), walk)
    if isinstance(value, np.ndarray) and not isinstance(value, np.ma.MaskedArray):
        content = _plain(value.ravel().tolist(), walk) if value.dtype.hasobject else _digest(value)
        return {"shape": list(value.shape), "content": content}
    if sparse.issparse(value):
        matrix: Any = value
        rows = matrix.tocoo()
        return {"shape": list(rows.shape), "content": _digest(*rows.coords, rows.data)}
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    if isinstance(value, (Mapping, list, tuple, set, frozenset)):
        return "itself" if walk.is_above(value) else _container(value, walk.into(value))
    if isinstance(value, types.ModuleType):
        return _module(value, set(), walk)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        left_out = WITHOUT if isinstance(value, Study) else ("computed_together",)
        names = [item.name for item in dataclasses.fields(value) if item.name not in left_out]
        return {"noun": type(value).__name__, **{name: _plain(getattr(value, name), walk) for name in names}}
    if isinstance(value, (property, cached_property, staticmethod, classmethod)):
        inner = [getattr(value, name, None) for name in ("fget", "fset", "fdel", "func", "__func__")]
        return {"noun": type(value).__name__, "of": _plain(inner, walk)}
    if callable(value):
        return _function(value, walk)
    return {"noun": type(value).__name__, "version": walk.version} if walk.version is not None else _copied(value, walk)


def _container(value: Any, walk: _Walk) -> Any:
    """Lists and mappings by their items; a set in the same order in every process."""
    if isinstance(value, weakref.WeakKeyDictionary):
        # what a function with an overload for each type has found
        return {}
    if isinstance(value, Mapping):
        found: Any = {str(key): _plain(item, walk) for key, item in value.items()}
        if not all(map(_is_data, value)):
            found = {"keys": [_plain(key, walk) for key in value], "items": [*found.values()]}
        made = getattr(value, "default_factory", None) if isinstance(value, defaultdict) else None
        return found if made is None else {"items": found, "default": _plain(made, walk)}
    if isinstance(value, (list, tuple)):
        return [_plain(item, walk) for item in value]
    # each as if it were the first
    alone = (_plain(item, replace(walk, seen=dict(walk.seen), files=dict(walk.files))) for item in value)
    return {"set": sorted(json.dumps(item, sort_keys=True) for item in alone)}


def _is_data(key: Any) -> bool:
    """True if the text of a key identifies it."""
    if isinstance(key, type):
        return is_library(key)
    inner = key if isinstance(key, (tuple, frozenset)) else ()
    return is_library(type(key)) and not isinstance(key, types.FunctionType) and all(map(_is_data, inner))


def _once(value: Any, described: Callable[[Any, _Walk], Any], walk: _Walk) -> Any:
    """The description of a value where it is met first; its number where it is met again."""
    if id(value) in walk.seen:
        return {"again": walk.seen[id(value)][0]}
    walk.seen[id(value)] = len(walk.seen), value
    return described(value, walk)


def _digest(*arrays: Any) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{np.asarray(array).dtype.str} {np.shape(array)}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _object(value: Any, walk: _Walk) -> Any:
    """An object of a class of the user, by its class and by all that it holds; no property is called."""
    kind = type(value)
    kept = {name for base in kind.__mro__ for name, item in vars(base).items() if isinstance(item, cached_property)}

    def lasting(state: Any) -> Any:
        # what a property has kept follows from the rest
        return {name: state[name] for name in state if name not in kept} if isinstance(state, dict) else state

    walk = _at_home(vars(sys.modules[kind.__module__]) if kind.__module__ in sys.modules else {}, walk)
    held: Any = object.__getstate__(value)
    every = [lasting(item or {}) for item in (held if isinstance(held, tuple) else (held,))]
    found = {"noun": kind.__name__, "class": _plain(kind, walk), "holds": _plain(every, walk)}
    _, arguments, state, items, pairs = _parts(value)
    hooks = ("__reduce__", "__reduce_ex__", "__getstate__")
    is_copied_differently = any(getattr(kind, name) is not getattr(object, name) for name in hooks)
    # a list or an array holds more than its attributes
    more = [arguments[1:], lasting(state) if is_copied_differently else None, items, pairs]
    return found | ({"parts": _plain(more, walk)} if is_copied_differently or any(more) else {})


def _copied(value: Any, walk: _Walk) -> Any:
    """An object of a library, by what a copy of it is made from."""
    top = type(value).__module__.partition(".")[0]
    if top not in sys.stdlib_module_names and top not in ("numpy", "scipy", "femimpact"):
        raise NotComparableError(f"a {type(value).__name__}")
    made_by, *parts = _parts(value)
    return {"noun": type(value).__name__, "made_by": _name(made_by), "parts": _plain(parts, walk)}


def _parts(value: Any) -> list[Any]:
    """The function that copies an object, its arguments, state, items, and pairs of key and value."""
    kind: Any = type(value)
    copied: Any = copyreg.dispatch_table.get(kind)
    try:
        parts = copied(value) if copied else kind.__reduce_ex__(value, 2)
    except Exception:
        raise NotComparableError(f"a {kind.__name__}") from None
    if isinstance(parts, str):
        # a variable of a type decides no number
        if getattr(builtins, parts, None) is not value and kind.__module__ != "typing":
            raise NotComparableError(f"{parts}, which has no code in Python")
        return [parts]
    made_by, arguments, state, items, pairs = (*parts, None, None, None)[:5]
    return [made_by, arguments, state, list(items or ()), list(pairs or ())]


# ---- functions, classes and modules ------------------------------------------------------------------


def _function(value: Any, walk: _Walk) -> Any:
    """A callable: of Python by its code, of a library by its name, any other by what it is made from."""
    if walk.version is not None:
        return {"function": _name(value), "version": walk.version}
    if isinstance(value, type):
        return {"name": value.__qualname__} if is_library(value) else _once(value, _class, walk)
    if isinstance(value, partial):
        return {"partial": _function(value.func, walk), "given": _plain([*value.args, value.keywords], walk)}
    if isinstance(value, types.MethodType):
        of: Any = value.__self__
        held = vars(of) if is_library(type(of)) and not isinstance(of, type) and hasattr(of, "__dict__") else of
        return {"method": _function(value.__func__, walk), "of": _plain(held, walk)}
    inner = _unwrapped(value)
    if isinstance(inner, types.FunctionType):
        if walk.is_above(inner):
            return "itself"
        walk = _at_home(inner.__globals__, walk)
        once = inner.__globals__ is not walk.home and not is_library_file(inner.__code__.co_filename)
        found = _once(inner, _of_python, walk) if once else _of_python(inner, walk)
        options = getattr(value, "targetoptions", COMPILED_PLAINLY)
        return found if options == COMPILED_PLAINLY else {"compiled": found, "options": _plain(options, walk)}
    if is_library(inner):
        return {"name": _name(inner)}
    if hasattr(type(inner).__call__, "__code__") and hasattr(inner, "__dict__"):
        return {"object": _function(type(inner).__call__, walk), "of": _plain(vars(inner), walk)}
    return _copied(inner, walk)


def _of_python(value: types.FunctionType, walk: _Walk) -> dict[str, Any]:
    """A function by its code, constants, defaults and what it takes from where it was made."""
    library = is_library_file(value.__code__.co_filename)
    if not library:
        check_open(value.__code__)
    cells = [_content(cell) for cell in value.__closure__ or ()]
    defaults = [list(value.__defaults__ or ()), dict(value.__kwdefaults__ or {})]
    given: dict[str, Any] = {"defaults": defaults, "cells": cells}
    held = {} if library else vars(value)
    attributes = {
        name: item for name, item in held.items() if name != "unit" and not any(item is cell for cell in cells)
    }
    if attributes:
        given["attributes"] = attributes
    walk = walk.into(value)
    taken = _plain(given, walk) | {"names": _taken_names(value, walk)}
    if not library:
        used = named(value.__code__)
        imported = {
            item.__name__: _module(item, used, walk) for item in imported_modules(value.__code__, value.__globals__)
        }
        taken |= {"imported": imported} if imported else {}
    found = {"function": value.__qualname__, "code": code_hash(value.__code__), "taken": taken}
    return found | ({} if library else _of_file(value.__globals__, walk))


def _content(cell: types.CellType) -> Any:
    """The content of a cell of a closure; None where it has not been filled."""
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _taken_names(function: types.FunctionType, walk: _Walk) -> dict[str, Any]:
    """The names that a function takes from its module: of a library by name, anything else by its content."""
    names, used = function.__globals__, named(function.__code__)
    found: dict[str, Any] = {}
    for name in sorted(global_names(function.__code__) & names.keys()):
        item = names[name]
        if isinstance(item, types.ModuleType):
            found[name] = _module(item, used, walk)
            continue
        inner = _unwrapped(item)
        beside = isinstance(inner, types.FunctionType) and inner.__globals__ is names
        by_name = callable(inner) and not beside and is_library(inner)
        found[name] = {"name": _name(inner)} if by_name else _plain(item, walk)
    return found


def _unwrapped(value: Any) -> Any:
    """The function within an object of a library that keeps or compiles it."""
    plain = isinstance(value, (type, types.FunctionType, types.ModuleType)) or not is_library(type(value))
    return value if plain or not callable(value) else inspect.unwrap(value)


def _class(value: Any, walk: _Walk) -> Any:
    """A class of the user, by its bases and all its attributes."""
    names = vars(sys.modules[value.__module__]) if value.__module__ in sys.modules else {}
    walk = _at_home(names, walk)
    return {
        "class": value.__qualname__,
        "made_by": _plain(type(value), walk),
        "bases": [_plain(base, walk) for base in value.__bases__],
        "attributes": {
            name: _plain(item, walk) for name, item in sorted(vars(value).items()) if name not in OF_INTERPRETER
        },
        **_of_file(names, walk),
    }


def _module(value: types.ModuleType, used: set[str], walk: _Walk) -> Any:
    """A module of a library by its name, one of the user by its file and by what is used of it."""
    names, found = vars(value), {"module": value.__name__}
    if walk.is_above(value):
        return found
    library, inner = is_library_module(names), walk.into(value)
    if not library and (value.__name__ == "__main__" or not ({"__file__", "__path__"} & names.keys())):
        raise NotComparableError(f"the module {value.__name__} as a whole")
    taken = {
        name: _module(item, used, inner) if isinstance(item, types.ModuleType) else _plain(item, inner)
        for name, item in sorted(names.items())
        # of a library what the user's module has put there
        if name in used and not name.startswith("__") and (not library or _is_at_home(item, walk))
    }
    files = {} if library else _of_file(names, walk)
    return found | files | ({"taken": taken} if taken else {})


def _at_home(names: Mapping[str, Any], walk: _Walk) -> _Walk:
    """The way on, which began in the module that holds these names if it has just begun."""
    return walk if walk.home else replace(walk, home=names)


def _is_at_home(value: Any, walk: _Walk) -> bool:
    """True for a function or class of the module in which the walk began."""
    if isinstance(value, types.FunctionType):
        return value.__globals__ is walk.home
    return isinstance(value, type) and value.__module__ == walk.home.get("__name__")


def _of_file(names: Mapping[str, Any], walk: _Walk) -> dict[str, Any]:
    """The files of a module of the user that were not met yet, unless the first function is from it."""
    at_home = names is walk.home or names.get("__name__") in ("__main__", walk.home.get("__name__"))
    files = {} if at_home or is_library_module(names) else source_files(names, walk.files)
    walk.files.update(files)
    return {"files": files} if files else {}


def _name(value: Any) -> str:
    return str(getattr(value, "__qualname__", getattr(value, "__name__", type(value).__name__)))
