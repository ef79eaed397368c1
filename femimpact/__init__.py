"""Vibro-impact dynamics of beams, and the design of impact dampers on them.

Public names are loaded from their modules on first use, so that `import femimpact` costs nothing.
"""

from __future__ import annotations

from typing import Any

from femimpact.lazy import loaded, modules_of

__version__ = "0.1.0"

_MODULE_OF = modules_of(__file__)

__all__ = ["__version__", *sorted(_MODULE_OF)]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = loaded(__name__, _MODULE_OF[name], name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
