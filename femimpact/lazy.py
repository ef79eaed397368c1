"""Public names that are loaded from their modules when they are first used; a stub says where each one is."""

from __future__ import annotations

import importlib
from typing import Any


def modules_of(init: str) -> dict[str, str]:
    """Module of each public name, from the lines `from MODULE import NAME as NAME` of the stub beside `__init__.py`.

    The module `.` is the package itself: the name is that of one of its modules.
    """
    # without ast, re and pathlib, which an import of the package would wait for
    with open(init.removesuffix("c") + "i", encoding="utf-8") as stub:
        words = [line.split() for line in stub]
    return {row[3]: row[1] for row in words if row[:1] == ["from"]}


def loaded(package: str, module: str, name: str) -> Any:
    """A public name of a package; of a class, the allowed ranges of its fields stand in its docstring."""
    if module == ".":
        return importlib.import_module(f"{package}.{name}")
    value = getattr(importlib.import_module(module), name)
    if isinstance(value, type):
        importlib.import_module("femimpact.errors").show_ranges(value)
    return value
