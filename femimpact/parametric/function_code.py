"""Code of functions, read without running it: its names, imports and source files, and what is a library."""

from __future__ import annotations

import ast
import dis
import hashlib
import importlib.util
import os
import sys
import sysconfig
import types
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

HIDING = {"globals", "__globals__", "f_globals", "__builtins__", "__import__", "import_module", "modules"}
"""Names by which code reaches what it does not name."""

HIDING_FUNCTIONS = {"eval", "exec"}
"""The same as names of the module alone: many objects have a method `eval`."""

CALL = "PRECALL" if "PRECALL" in dis.opmap else "CALL"
"""Step before which a function and its arguments lie on the stack."""

HEAP_TYPE = 1 << 9
"""Flag of a class that is neither of the interpreter nor of C."""


class NotComparableError(Exception):
    """A value has no form that could be compared with that of another call; the message names it."""


# ---- libraries ---------------------------------------------------------------------------------------


@cache
def _library_folders() -> tuple[str, ...]:
    """The standard library and femimpact, whose sources are in the key."""
    standard = {os.path.dirname(os.__file__), sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib")}
    return tuple(f"{folder}{os.sep}" for folder in (*standard, str(Path(__file__).parent.parent)))


def is_library_file(path: str) -> bool:
    """True for a file of the standard library, of an installed one, or of femimpact."""
    installed = {"site-packages", "dist-packages"} & set(Path(path).parts)
    return bool(installed) or path.startswith(("<frozen ", *_library_folders()))


def is_library_module(names: Mapping[str, Any]) -> bool:
    """True if a module, given by its names, is of a library."""
    file = names.get("__file__")
    if file is None:
        # of C, or a folder without `__init__.py`
        places = list(names.get("__path__", ()))
        top = str(names.get("__name__")).partition(".")[0]
        return all(map(is_library_file, places)) if places else top in sys.stdlib_module_names
    return is_library_file(str(file))


def is_library(value: Any) -> bool:
    """True if a library holds this very class or function under its name: a name can be copied."""
    home = str(getattr(value, "__module__", None))
    if isinstance(value, type) and not value.__flags__ & HEAP_TYPE:
        return home not in sys.modules or is_library_module(vars(sys.modules[home]))
    if isinstance(value, types.FunctionType) and not value.__closure__ and is_library_file(value.__code__.co_filename):
        return True
    name = str(getattr(value, "__qualname__", getattr(value, "__name__", "")))
    # functions of arrays do not always say where they are from
    for module in dict.fromkeys((home, "builtins", "numpy", "scipy.special")):
        found: Any = sys.modules.get(module)
        if isinstance(found, types.ModuleType) and is_library_module(vars(found)):
            for part in name.split("."):
                found = getattr(found, part, None)
            if found is value:
                return True
    return False


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


def check_open(code: types.CodeType) -> None:
    """Refuse code that takes something by a name that is made while it runs."""
    hiding = sorted(HIDING & {name for part in _codes(code) for name in part.co_names})
    hiding += sorted(HIDING_FUNCTIONS & global_names(code))
    if hiding:
        raise NotComparableError(f"what it takes by {hiding[0]}")
    for part in _codes(code):
        steps = list(dis.get_instructions(part))
        for i, step in enumerate(steps):
            loads = step.argval == "getattr" and step.opname.startswith("LOAD_") and step.opname != "LOAD_CONST"
            if loads and not _takes_literal(steps[i + 1 :]):
                raise NotComparableError("what it takes by getattr with a computed name")


def _takes_literal(steps: list[dis.Instruction]) -> bool:
    """True if `getattr`, loaded before these steps, is called there with a text as its second argument."""
    made: list[dis.Instruction] = []
    for step in steps:
        if step.opname == "PUSH_NULL" and not made:
            continue
        if step.opcode in dis.hasjrel:
            # one of two values
            return False
        if step.opname == CALL and step.arg == len(made):
            return len(made) > 1 and made[1].opname.startswith("LOAD_CONST") and isinstance(made[1].argval, str)
        effect = dis.stack_effect(step.opcode, step.arg, jump=False)
        if effect > 0:
            made += [step] * effect
        else:
            if len(made) + effect < 1:
                return False
            del made[len(made) + effect :]
            # a step without effect on the stack's height has made its uppermost value
            if step.opname not in ("CACHE", "NOP", "EXTENDED_ARG"):
                made[-1] = step
    return False


# ---- imports and source files ------------------------------------------------------------------------


def imported_modules(code: types.CodeType, names: Mapping[str, Any]) -> list[types.ModuleType]:
    """Modules of the user (not of libraries) that a function's code, or a function within it, imports when it runs."""
    found: dict[str, types.ModuleType] = {}
    package = str(names.get("__package__") or "")
    for part in _codes(code):
        steps = list(dis.get_instructions(part))
        for level, taken, step in zip(steps, steps[1:], steps[2:], strict=False):
            if step.opname == "IMPORT_NAME":
                for name in _module_names(str(step.argval), level.argval, taken.argval or (), package):
                    if _user_spec(name) is not None:
                        found[name] = importlib.import_module(name)
    return [found[name] for name in sorted(found)]


def _module_names(name: str, level: int, taken: Any, package: str) -> Iterator[str]:
    """Names of the modules that an import statement may load: the one it names, those above and within it."""
    try:
        full = importlib.util.resolve_name("." * level + name, package)
    except ImportError:
        return
    parts = full.split(".")
    yield from (".".join(parts[: i + 1]) for i in range(len(parts)))
    yield from (f"{full}.{item}" for item in taken)


def _user_spec(name: str) -> ModuleSpec | None:
    """The place of a module of the user; None for one of a library, or where there is none."""
    try:
        top = name.partition(".")[0]
        for part in dict.fromkeys((top, name)):
            spec = None if part == "__main__" else importlib.util.find_spec(part)
            places = () if spec is None else spec.submodule_search_locations or ()
            if spec is None or not (spec.has_location or places):
                return None
            if is_library_file(str(spec.origin)) or any(map(is_library_file, places)):
                return None
    except (ImportError, AttributeError, ValueError):
        return None
    return spec


def source_files(names: Mapping[str, Any], known: Collection[str] = ()) -> dict[str, str]:
    """Hashes of the file of a module, given by what it holds, and of all files of the user that it imports.

    Comments, docstrings and the form of the text do not count. Modules that are known are left out.

    Raises `NotComparableError` if one of them is not in Python.
    """
    found: dict[str, str] = {}
    file = names.get("__file__")
    left = [] if file is None else [(str(names["__name__"]), str(file), "__path__" in names)]
    while left:
        name, path, is_package = left.pop()
        if name in found or name in known:
            continue
        tree = _tree(name, path)
        found[name] = hashlib.sha256(ast.dump(tree).encode()).hexdigest()
        package = name if is_package else name.rpartition(".")[0]
        for node in ast.walk(tree):
            inner: list[str] = []
            if isinstance(node, ast.Import):
                inner = [part for item in node.names for part in _module_names(item.name, 0, (), "")]
            elif isinstance(node, ast.ImportFrom):
                taken = [item.name for item in node.names]
                inner = list(_module_names(node.module or "", node.level, taken, package))
            for other in inner:
                spec = None if other in found else _user_spec(other)
                if spec is not None and spec.has_location:
                    left.append((other, str(spec.origin), spec.submodule_search_locations is not None))
    return dict(sorted(found.items()))


def _tree(name: str, path: str) -> ast.Module:
    """The syntax of a source file, without docstrings."""
    try:
        tree = ast.parse(Path(path).read_bytes()) if path.endswith(".py") else None
    except (OSError, SyntaxError, ValueError):
        tree = None
    if tree is None:
        raise NotComparableError(f"the module {name}, which has no source")
    for node in ast.walk(tree):
        body: Any = getattr(node, "body", None)
        first = body[0] if isinstance(body, list) and body else None
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
            del body[0]
    return tree
