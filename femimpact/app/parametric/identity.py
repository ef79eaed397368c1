"""The key of a study: a hash of its data, of the code of its functions, of femimpact's sources and of library versions.

Equal keys have equal results. A study is plain data, in types of JSON: numbers and texts, arrays by a hash of their
content, nouns by their fields, functions of the user by their code, the texts of their files and the values that they
read. Code is read, not run. Whatever is none of this is refused: it needs a version in its place.
"""

from __future__ import annotations

import dataclasses
import dis
import hashlib
import json
import math
import os
import sys
import sysconfig
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from importlib.machinery import ModuleSpec
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sparse

from femimpact import core
from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.study.study import Study
from femimpact.core.binary import build_words
from femimpact.errors import Fault, InputError
from femimpact.system.system import System

PACKAGE = next(folder for folder in Path(__file__).parents if folder.name == "femimpact")
"""The folder of femimpact's sources, which are in the key."""

HOMES = ("builtins", "numpy", "scipy.special")
"""Modules of functions that do not say where they are from, as functions of arrays."""


class NotComparableError(Exception):
    """A value has no form that could be compared with that of another call; the message names it."""


# ---- libraries ---------------------------------------------------------------------------------------


@cache
def _library_folders() -> tuple[str, ...]:
    """The standard library and femimpact."""
    standard = {os.path.dirname(os.__file__), sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib")}
    return tuple(f"{folder}{os.sep}" for folder in (*standard, str(PACKAGE)))


def is_library_file(path: str) -> bool:
    """True for a file of the standard library, of an installed one, or of femimpact."""
    installed = {"site-packages", "dist-packages"} & set(Path(path).parts)
    return bool(installed) or path.startswith(("<frozen ", *_library_folders()))


def is_library_module(names: Mapping[str, Any]) -> bool:
    """True if a module, given by its names, is of a library."""
    places = [names["__file__"]] if names.get("__file__") else list(names.get("__path__", ()))
    if not places:
        return str(names.get("__name__")).partition(".")[0] in sys.stdlib_module_names
    return all(is_library_file(str(place)) for place in places)


def library_name(value: Any) -> str:
    """The full name of a class or function that a library holds under this name; empty for any other."""
    name = str(getattr(value, "__qualname__", getattr(value, "__name__", "")))
    for home in dict.fromkeys((str(getattr(value, "__module__", None)), *HOMES)):
        found: Any = sys.modules.get(home)
        if isinstance(found, types.ModuleType) and is_library_module(vars(found)):
            first, *parts = name.split(".")
            # of a module as it is: to ask it for a name that it has not may warn
            found = vars(found).get(first)
            for part in parts:
                found = getattr(found, part, None)
            if found is value:
                return f"{home}.{name}"
    return ""


# ---- code --------------------------------------------------------------------------------------------


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    """Code and all that is within it."""
    yield code
    for item in code.co_consts:
        if isinstance(item, types.CodeType):
            yield from _codes(item)


def global_names(code: types.CodeType) -> set[str]:
    """Names that code takes from its module, those within it included."""
    loads = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS")
    return {str(step.argval) for part in _codes(code) for step in dis.get_instructions(part) if step.opname in loads}


def named(code: types.CodeType) -> set[str]:
    """All names and texts in code: what it takes of a module is among them."""
    texts = {item for part in _codes(code) for item in part.co_consts if isinstance(item, str)}
    return texts.union(*(part.co_names for part in _codes(code)))


def code_hash(code: types.CodeType) -> str:
    """Hash of compiled code, its names and constants; not of where it stands."""
    names = [*code.co_names, *code.co_varnames, *code.co_freevars]
    return hashlib.sha256(repr((code.co_code, _constant(code.co_consts), names)).encode()).hexdigest()


def _constant(value: Any) -> Any:
    """A constant of code in a form that is the same in every process."""
    if isinstance(value, types.CodeType):
        return code_hash(value)
    if isinstance(value, tuple):
        return [_constant(item) for item in value]
    if isinstance(value, frozenset):
        return {"set": sorted(repr(_constant(item)) for item in value)}
    return repr(value)


# ---- source files ------------------------------------------------------------------------------------


def add_source_files(
    names: Mapping[str, Any],  # those of a module of the user
    files: dict[str, str],  # hashes by the names of modules, to which those of the module are added
) -> None:
    """Add the file of a module and of all modules of the user that it imports, by the code of their texts.

    Raises `NotComparableError` if one of them is not in Python.
    """
    file, spec = str(names["__file__"]), names.get("__spec__")
    name = str(names["__name__"]) if names["__name__"] != "__main__" else spec.name if spec else Path(file).stem
    left = [(name, file, "__path__" in names)]
    while left:
        name, file, is_package = left.pop()
        if name in files:
            continue
        try:
            content = Path(file).read_bytes()
            code = compile(content, file, "exec", dont_inherit=True)
        except (OSError, SyntaxError, ValueError):
            raise NotComparableError(f"the module {name}, which has no text in Python") from None
        files[name] = hashlib.sha256(content).hexdigest()
        for other in sorted(imported_by(code, name if is_package else name.rpartition(".")[0])):
            found = _spec(other)
            if found is not None and found.has_location and not is_library_file(str(found.origin)):
                left.append((other, str(found.origin), found.submodule_search_locations is not None))


def imported_by(
    code: types.CodeType,
    package: str,  # of the module in which the code stands
) -> set[str]:
    """Names of all modules that code may import: those that it names, those above, and what it takes of them."""
    names = set[str]()
    for part in _codes(code):
        # a large number of a name stands in an instruction before it
        steps = [step for step in dis.get_instructions(part) if step.opname != "EXTENDED_ARG"]
        for level, taken, step in zip(steps, steps[1:], steps[2:], strict=False):
            if step.opname != "IMPORT_NAME":
                continue
            try:
                full = resolve_name("." * level.argval + str(step.argval), package)
            except ImportError:
                continue
            above = full.split(".")
            names |= {".".join(above[: i + 1]) for i in range(len(above))}
            names |= {f"{full}.{item}" for item in taken.argval or ()}
    return names


def _spec(name: str) -> ModuleSpec | None:
    """Where a module is, which is not imported for that; None where there is none."""
    loaded: ModuleSpec | None = getattr(sys.modules.get(name), "__spec__", None)
    if loaded is not None or not name:
        return loaded
    above = _spec(name.rpartition(".")[0])
    if "." in name and (above is None or above.submodule_search_locations is None):
        return None
    places = above.submodule_search_locations if above is not None else None
    finders: list[Any] = [finder for finder in sys.meta_path if hasattr(finder, "find_spec")]
    return next((spec for finder in finders if (spec := finder.find_spec(name, places)) is not None), None)


NUMERICAL = ("contact", "excitation", "fem", "integrators", "response", "structure", "system", "app/parametric")
"""Folders whose sources decide the numbers."""

BESIDE = ("app/study/study.py", "app/study/parameter_plan.py", "app/study/drives.py", "app/study/start.py")
"""Files of other folders whose sources do."""

WITHOUT = ("text", "path", "as_read", "plan", "output", "sweep", "orbits")
"""Fields of a study that do not change its cases."""

HIDING = {"eval", "exec", "globals", "__import__"}
"""Functions of the interpreter that reach what the code does not name."""

UNKNOWN = {
    types.FunctionType: "a function without a file", types.BuiltinFunctionType: "a function of C",
    types.MethodType: "a bound method", types.ModuleType: "a module",
}  # fmt: skip
"""Words for what is no plain data, by its type."""

FUNCTIONS = {property: "fget", staticmethod: "__func__", classmethod: "__func__", cached_property: "func"}
"""Attributes of what is made of the methods of a class that hold the function."""

# ---- the key -----------------------------------------------------------------------------------------


@cache
def sources_key() -> str:
    """Hash of the sources of the numerical folders.

    Raises `FileNotFoundError` if one of them has no sources.
    """
    digest = hashlib.sha256()
    paths = [PACKAGE / name for name in BESIDE]
    for folder in NUMERICAL:
        sources = sorted((PACKAGE / folder).rglob("*.py"))
        if not sources:
            raise FileNotFoundError(f"femimpact has no sources in {folder}, which decide the numbers of a study")
        paths += sources
    for path in paths:
        digest.update(str(path.relative_to(PACKAGE)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Sources of femimpact and of its core, and versions of numpy and scipy."""
    core_sources = str(core.build_info()["sources"])
    return {"sources": sources_key(), "core": core_sources, "numpy": np.__version__, "scipy": scipy.__version__}


def study_key(plain: Mapping[str, Any]) -> str:
    """Hash of a study in plain data, of the code and of the build of the core."""
    return hashlib.sha256(json.dumps([plain, versions(), build_words()], sort_keys=True).encode()).hexdigest()


def plain_study(study: ParameterStudy) -> dict[str, Any]:
    """The study as plain data: two that are equal give the same results with the same code."""
    given: Any = study.study
    walk = _Walk(study.version)
    axes = {
        place.path: _compared(list(levels), walk)
        for place, levels in zip(study.table.places, study.table.levels, strict=True)
    }
    plain = {
        "study": _compared(given, walk),
        "mesh": _compared(study.systems.mesh, walk),
        "axes": axes,
        # decides the numbers of the cases
        "order": list(axes),
        "cases": "grid" if study.table.is_grid else [_digest(codes) for codes in study.table.codes],
        "measures": [item.name if item.function is None else _compared(item.function, walk) for item in study.chosen],
        "starts": study.starts,
        "seed": study.seed if study.starts > 1 else None,
        "cycles": study.dwell,
        "base": study.base,
        "at": study.observed,
        "method": _compared(study.method, walk),
        **({} if isinstance(given, (Study, System)) else {"elements": study.elements, "modes": study.modes}),
    }
    return plain | ({"files": walk.files} if walk.files else {})


def _compared(value: Any, walk: _Walk) -> Any:
    """A value as plain data; `InputError` if it is none."""
    try:
        return _plain(value, replace(walk, name=_name(value)))
    except Exception as error:
        # also one that an object of the user raises when it is looked at
        what = "values that hold one another" if isinstance(error, RecursionError) else error
        allowed = (
            f"uses a value that a later call cannot recognise ({what}): "
            "give version='...', a text that you change whenever the numbers change"
        )
        raise InputError([Fault("study", _name(value), "", allowed)]) from None


# ---- values ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Walk:
    """State of the walk from a value to all that it depends on."""

    version: str | None  # in place of the code of functions
    name: str = ""  # of the value in the code that reads it
    # number of each function, class and module that was met, with the value: its id stays its own
    seen: dict[Any, tuple[int, Any]] = field(default_factory=dict)
    # hashes of the files that were met, by the names of their modules
    files: dict[str, str] = field(default_factory=dict)

    def again(self, value: Any, reader: Any = None) -> dict[str, int] | None:
        """The number of what was met before, of a module by the same code; None where it is met first."""
        key = id(value), id(reader)
        if key in self.seen:
            return {"again": self.seen[key][0]}
        self.seen[key] = len(self.seen), (value, reader)
        return None


def _plain(value: Any, walk: _Walk) -> Any:
    """A value as plain data."""
    if value is None or type(value) in (bool, int, str):
        return value
    if isinstance(value, np.generic) and not isinstance(value.item(), np.generic):
        return _plain(value.item(), walk)
    if type(value) is float:
        return value if math.isfinite(value) else repr(value)
    if type(value) in (complex, bytes):
        return repr(value)
    if isinstance(value, np.generic) or (type(value) is np.ndarray and not value.dtype.hasobject):
        return {"shape": list(value.shape), "content": _digest(value)}
    if sparse.issparse(value):
        matrix: Any = value
        rows = matrix.tocoo()
        return {"shape": list(rows.shape), "content": _digest(*rows.coords, rows.data)}
    if type(value) in (dict, types.MappingProxyType):
        if all(type(key) is str for key in value):
            return {key: _plain(item, walk) for key, item in value.items()}
        return {"pairs": [[_plain(key, walk), _plain(item, walk)] for key, item in value.items()]}
    if type(value) in (list, tuple):
        return [_plain(item, walk) for item in value]
    if _is_frozen(type(value)):
        return _noun(value, walk)
    if type(value) is partial:
        return {"partial": _plain(value.func, walk), "given": _plain([value.args, value.keywords], walk)}
    if walk.version is not None:
        return {"name": _name(value), "version": walk.version}
    if callable(value) and library_name(value):
        return {"name": library_name(value)}
    if isinstance(value, types.FunctionType):
        return walk.again(value) or _function(value, walk)
    if isinstance(value, type) and _is_frozen(value):
        return walk.again(value) or _class(value, walk)
    raise NotComparableError(f"{walk.name}, {_kind(value)}")


def _kind(value: Any) -> str:
    """Words for what a value is that is no plain data."""
    if isinstance(value, type):
        return "a class that is no frozen dataclass"
    return UNKNOWN.get(type(value), f"a {type(value).__name__}")


def _is_frozen(kind: type) -> bool:
    """True for a frozen dataclass, and not for a class beneath one that is none."""
    return "__dataclass_params__" in vars(kind) and bool(vars(kind)["__dataclass_params__"].frozen)


def _noun(value: Any, walk: _Walk) -> dict[str, Any]:
    """A frozen dataclass by its fields: of a library without those at their defaults, of the user with its class."""
    kind = type(value)
    left_out = WITHOUT if isinstance(value, Study) else ("computed_together",)
    fields = {item.name: item for item in dataclasses.fields(value) if item.name not in left_out}
    found = {name: _plain(getattr(value, name), replace(walk, name=name)) for name in fields}
    if not library_name(kind):
        return {"noun": _plain(kind, walk), **found}
    return {"noun": kind.__name__} | {
        name: plain for name, plain in found.items() if not _is_default(plain, fields[name], walk)
    }


def _is_default(plain: Any, item: dataclasses.Field[Any], walk: _Walk) -> bool:
    """True if a field in plain data is at its default."""
    default = item.default if item.default_factory is dataclasses.MISSING else item.default_factory()
    return default is not dataclasses.MISSING and json.dumps(plain) == json.dumps(_plain(default, walk))


def _digest(*arrays: Any) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{np.asarray(array).dtype.str} {np.shape(array)}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


# ---- functions, classes and modules ------------------------------------------------------------------


def _function(value: types.FunctionType, walk: _Walk) -> dict[str, Any]:
    """A function of Python by its code, its file, and all values that it reads of where it was made."""
    code, names = value.__code__, value.__globals__
    found: dict[str, Any] = {
        "function": value.__qualname__,
        "code": code_hash(code),
        "defaults": _plain([value.__defaults__, value.__kwdefaults__], walk),
        "cells": {
            name: _read(_content(cell), code, replace(walk, name=name))
            for name, cell in zip(code.co_freevars, value.__closure__ or (), strict=True)
        },
    }
    if is_library_file(code.co_filename):
        return found
    if Path(code.co_filename).name != Path(str(names.get("__file__", ""))).name:
        raise NotComparableError(f"{walk.name}, {_kind(value)}")
    add_source_files(names, walk.files)
    # the unit decides no number
    attributes = {name: item for name, item in vars(value).items() if name != "unit"}
    return found | {"attributes": _plain(attributes, walk), "reads": _values_read(value, walk)}


def _content(cell: types.CellType) -> Any:
    """The content of a cell of a closure; None where it has not been filled."""
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _values_read(function: types.FunctionType, walk: _Walk) -> dict[str, Any]:
    """The values that a function reads of its module, and of modules that it imports when it runs, by their names."""
    code, names = function.__code__, function.__globals__
    used = global_names(code)
    hiding = sorted(used & HIDING - names.keys())
    if hiding:
        raise NotComparableError(f"what {walk.name} takes by {hiding[0]}")
    found = {name: names[name] for name in sorted(used & names.keys())}
    loaded = imported_by(code, str(names.get("__package__") or ""))
    found |= {f"import {name}": sys.modules[name] for name in sorted(loaded & sys.modules.keys())}
    return {name: _read(item, code, replace(walk, name=name)) for name, item in found.items()}


def _read(value: Any, code: types.CodeType, walk: _Walk) -> Any:
    """A value that code reads; of a module of the user what the code names of it."""
    if not isinstance(value, types.ModuleType):
        return _plain(value, walk)
    names = vars(value)
    if is_library_module(names):
        return {"module": value.__name__}
    again = walk.again(value, code)
    if again is not None:
        return again
    if names.get("__file__"):
        add_source_files(names, walk.files)
    elif "__path__" not in names:
        raise NotComparableError(f"{walk.name}, a module without a file")
    used = sorted(name for name in named(code) & names.keys() if not name.startswith("__"))
    return {"module": value.__name__} | {
        name: _read(names[name], code, replace(walk, name=f"{value.__name__}.{name}")) for name in used
    }


def _class(value: type, walk: _Walk) -> dict[str, Any]:
    """A frozen dataclass of the user by its bases, methods and attributes."""
    found: dict[str, Any] = {}
    for name, item in sorted(vars(value).items()):
        inner = getattr(item, FUNCTIONS[type(item)]) if type(item) in FUNCTIONS else item
        if isinstance(inner, types.FunctionType):
            # what the decorator has made follows from the fields
            file, made = inner.__code__.co_filename, name.startswith("__")
            if not (made and (file == "<string>" or is_library_file(file))):
                found[name] = _plain(inner, replace(walk, name=f"{value.__qualname__}.{name}"))
        elif not name.startswith("__") and not isinstance(item, types.MemberDescriptorType):
            found[name] = _plain(item, replace(walk, name=f"{value.__qualname__}.{name}"))
    names = vars(sys.modules[value.__module__]) if value.__module__ in sys.modules else {}
    if not names.get("__file__"):
        raise NotComparableError(f"{walk.name}, a class without a file")
    add_source_files(names, walk.files)
    return {"class": value.__qualname__, "bases": _plain(list(value.__bases__), walk), "attributes": found}


def _name(value: Any) -> str:
    return str(getattr(value, "__qualname__", getattr(value, "__name__", type(value).__name__)))
