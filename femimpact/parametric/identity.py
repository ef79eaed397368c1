"""What a study is in plain data, and the key under which its blocks are kept: equal ones have equal results."""

from __future__ import annotations

import dataclasses
import dis
import hashlib
import inspect
import json
import types
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import scipy.sparse as sparse

from femimpact.core.binary import build_words
from femimpact.errors import InputError, require
from femimpact.parametric.definition import ParameterStudy
from femimpact.study.study import Study
from femimpact.system.system import System

NUMERICAL = ("contact", "excitation", "fem", "integrators", "response", "structure", "system", "parametric")
"""Folders whose sources decide the numbers."""

BESIDE = ("study/study.py", "study/parameter_plan.py", "study/base_motion.py")

WITHOUT = ("text", "path", "plan", "output", "sweep")
"""Fields of a study that its cases do not hang on."""


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
    """The study in what JSON has; two that are equal give the same results with the same code.

    Raises `InputError` if a function has no code that could be compared, and there is no version.
    """
    given: Any = study.study
    axes = {
        place.path: [_plain(value, study.version) for value in levels]
        for place, levels in zip(study.table.places, study.table.levels, strict=True)
    }
    return {
        "study": _plain(given, study.version),
        "mesh": None if study.systems.mesh is None else _plain(study.systems.mesh, None),
        "axes": axes,
        # in which the cases are counted
        "order": list(axes),
        "cases": "grid" if study.table.is_grid else [_digest(codes) for codes in study.table.codes],
        "measures": [
            item.name if item.function is None else _plain(item.function, study.version) for item in study.chosen
        ],
        "starts": study.starts,
        "seed": study.seed if study.starts > 1 else None,
        "cycles": study.dwell,
        "base": study.base,
        "at": study.observed,
        "method": _plain(study.method, None),
        **({} if isinstance(given, (Study, System)) else {"elements": study.elements, "modes": study.modes}),
    }


def study_key(plain: Mapping[str, Any]) -> str:
    """Hash of a study in plain data and of the code."""
    text = json.dumps([plain, code_key()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def first_difference(one: Any, other: Any, path: str = "") -> str:
    """Where two plain data differ first, in words; nothing where they do not."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for name in dict.fromkeys((*one, *other)):
            inner = f"{path}.{name}" if path else str(name)
            if name not in one or name not in other:
                return f"{inner} is in one of them only"
            found = first_difference(one[name], other[name], inner)
            if found:
                return found
        return ""
    if isinstance(one, list) and isinstance(other, list):
        for i, (mine, its) in enumerate(zip(one, other, strict=False)):
            found = first_difference(mine, its, f"{path}[{i}]")
            if found:
                return found
        return "" if len(one) == len(other) else f"{path} has {len(one)} entries there, {len(other)} here"
    return "" if one == other else f"{path} is {_short(one)} there, {_short(other)} here"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _plain(value: Any, version: str | None) -> Any:
    """A value in what JSON has: nouns by their fields, arrays by their content, functions by their code."""
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if np.isfinite(value) else repr(value)
    if isinstance(value, (np.integer, np.floating, np.bool_)):
        return _plain(value.item(), version)
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "content": _digest(value)}
    if sparse.issparse(value):
        matrix: Any = value
        rows = matrix.tocoo()
        return {"shape": list(rows.shape), "content": _digest(*rows.coords, rows.data)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item, version) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, version) for item in value]
    if isinstance(value, (set, frozenset)):
        # in the same order in every process
        return {"set": sorted(json.dumps(_plain(item, version), sort_keys=True) for item in value)}
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    if isinstance(value, types.ModuleType):
        return {"module": value.__name__}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        left_out = WITHOUT if isinstance(value, Study) else ("computed_together",)
        found = {
            item.name: _plain(getattr(value, item.name), version)
            for item in dataclasses.fields(value)
            if item.name not in left_out
        }
        return {"noun": type(value).__name__, **found}
    if callable(value):
        return _function(value, version)
    allowed = f"holds a {type(value).__name__}, which cannot be compared with that of another call: give version='...'"
    require(version is not None, "study", type(value).__name__, "", allowed)
    return {"noun": type(value).__name__, "version": version}


def _function(value: Any, version: str | None, above: tuple[Any, ...] = ()) -> Any:
    """A function by its code, constants, defaults and what it takes from where it was made.

    `above` are the functions that take this one: one that takes itself is not looked at again.
    """
    name = str(getattr(value, "__qualname__", type(value).__name__))
    if version is not None:
        return {"function": name, "version": version}
    if hasattr(value, "func") and hasattr(value, "keywords"):
        # of functools.partial
        return {"partial": _function(value.func, None), "given": _plain([*value.args, value.keywords], None)}
    if hasattr(value, "__func__"):
        return {"method": _function(value.__func__, None), "of": _plain(vars(value.__self__), None)}
    value = _unwrapped(value)
    if not hasattr(value, "__code__"):
        allowed = "has no code that could be compared with that of another call: give version='...'"
        require(not _is_compiled(value), "study", name, "", allowed)
        return {"object": _function(type(value).__call__, None, above), "of": _plain(vars(value), None)}
    cells = [cell.cell_contents for cell in value.__closure__ or ()]
    given = {"defaults": [list(value.__defaults__ or ()), dict(value.__kwdefaults__ or {})], "cells": cells}
    try:
        taken = _plain(given, None) | {"names": _taken_names(value, (*above, value))}
    except (InputError, RecursionError):
        allowed = "uses values that cannot be compared with those of another call: give version='...'"
        require(False, "study", name, "", allowed)
    return {"function": name, "code": _code(value.__code__), "taken": taken}


def _taken_names(function: Any, above: tuple[Any, ...]) -> dict[str, Any]:
    """What a function takes by name from its module: values, and functions of that module by their code."""
    found: dict[str, Any] = {}
    names = function.__globals__
    for name in sorted(_global_names(function.__code__) & names.keys()):
        item = _unwrapped(names[name])
        if isinstance(item, types.FunctionType) and item.__globals__ is names:
            found[name] = "itself" if item in above else _function(item, None, above)
        elif isinstance(item, (type, types.FunctionType)) or _is_compiled(item):
            # of a library: its name
            found[name] = {"name": str(getattr(item, "__qualname__", type(item).__name__))}
        else:
            found[name] = _plain(item, None)
    return found


def _unwrapped(value: Any) -> Any:
    """The function within one that keeps or compiles it."""
    return value if hasattr(value, "__code__") or isinstance(value, type) else inspect.unwrap(value)


def _is_compiled(value: Any) -> bool:
    """Whether it is called, but has no code of Python's."""
    return callable(value) and not hasattr(type(value).__call__, "__code__")


def _global_names(code: types.CodeType) -> set[str]:
    """Names that code takes from its module, those within it included."""
    found = {
        str(step.argval) for step in dis.get_instructions(code) if step.opname in ("LOAD_GLOBAL", "LOAD_NAME")
    }  # fmt: skip
    for item in code.co_consts:
        if isinstance(item, types.CodeType):
            found |= _global_names(item)
    return found


def _code(code: types.CodeType) -> str:
    """Hash of compiled code, its names and constants; not of where it stands."""
    names = [*code.co_names, *code.co_varnames, *code.co_freevars]
    return hashlib.sha256(repr((code.co_code, _constant(code.co_consts), names)).encode()).hexdigest()


def _constant(value: Any) -> Any:
    """A constant of code in a form that reads alike in every process."""
    if isinstance(value, types.CodeType):
        return _code(value)
    if isinstance(value, tuple):
        return [_constant(item) for item in value]
    if isinstance(value, frozenset):
        return {"set": sorted(repr(_constant(item)) for item in value)}
    return repr(value)


def _digest(*arrays: Any) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{np.asarray(array).dtype.str} {np.shape(array)}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
