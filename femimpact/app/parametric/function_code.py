"""Code of functions, read without running it: its names, its source files and all that these import."""

from __future__ import annotations

import ast
import dis
import hashlib
import os
import sys
import sysconfig
import types
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

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
    """Add the file of a module and of all modules of the user that it imports, by the syntax of their texts.

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
            tree = ast.parse(content)
        except (OSError, SyntaxError, ValueError):
            raise NotComparableError(f"the module {name}, which has no text in Python") from None
        files[name] = hashlib.sha256(content).hexdigest()
        for other in _imported(tree, name if is_package else name.rpartition(".")[0]):
            found = _spec(other)
            if found is not None and found.has_location and not is_library_file(str(found.origin)):
                left.append((other, str(found.origin), found.submodule_search_locations is not None))


def _imported(tree: ast.Module, package: str) -> Iterator[str]:
    """Names of all modules that a text may import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for item in node.names:
                yield from _module_names(item.name, 0, (), package)
        elif isinstance(node, ast.ImportFrom):
            yield from _module_names(node.module or "", node.level, [item.name for item in node.names], package)


def imported_by(
    code: types.CodeType,
    package: str,  # of the module in which the code stands
) -> set[str]:
    """Names of all modules that code may import when it runs."""
    found = set[str]()
    for part in _codes(code):
        steps = list(dis.get_instructions(part))
        for level, taken, step in zip(steps, steps[1:], steps[2:], strict=False):
            if step.opname == "IMPORT_NAME":
                found |= {*_module_names(str(step.argval), level.argval, taken.argval or (), package)}
    return found


def _module_names(
    name: str,
    level: int,  # dots before the name
    taken: Iterable[str],  # what is imported from there, which may be modules
    package: str,
) -> Iterator[str]:
    """Names of the modules that an import statement may load: the one it names, those above and within it."""
    try:
        full = resolve_name("." * level + name, package)
    except ImportError:
        return
    parts = full.split(".")
    yield from (".".join(parts[: i + 1]) for i in range(len(parts)))
    yield from (f"{full}.{item}" for item in taken)


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
