"""Public names of a package that are loaded from their modules when they are first used; a stub says where each is."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from typing import Any


def modules_of(init: str) -> dict[str, str]:
    """Module of each public name, from the lines `from MODULE import NAME as NAME` of the stub beside `__init__.py`.

    The module `.` is the package itself: the name is that of one of its modules.
    """
    # without ast, re and pathlib, which an import of the package would wait for
    with open(init.removesuffix("c") + "i", encoding="utf-8") as stub:
        words = [line.split() for line in stub]
    return {row[3]: row[1] for row in words if row[:1] == ["from"]}


def face(package: str, init: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package, whose `__init__.py` is given with its path."""
    module_of = modules_of(init)
    names = sorted(module_of)

    def attribute(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = _loaded(package, module_of[name], name)
        setattr(sys.modules[package], name, value)
        return value

    return attribute, lambda: sorted(names), names


def _loaded(package: str, module: str, name: str) -> Any:
    """A public name of a package; of a class, the allowed ranges of its fields stand in its docstring."""
    if module == ".":
        return importlib.import_module(f"{package}.{name}")
    value = getattr(importlib.import_module(module), name)
    if isinstance(value, type):
        importlib.import_module("femimpact.errors").show_ranges(value)
    return value
