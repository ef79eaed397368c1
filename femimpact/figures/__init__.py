"""Figures of results, in one style: every figure is a function of a result.

A figure of one panel takes `ax=None` and returns axes; one of several panels takes `figure=None` and returns
its axes as an array. Without them it is drawn on a new pyplot figure, which a notebook shows. `OffScreen()` in their
place gives a figure that is not shown, for a file. matplotlib is loaded by the first figure. For other figures
in the same style there are `STYLE`, which `matplotlib.rc_context` takes, and `COLOURS`.
"""

from __future__ import annotations

from typing import Any

from femimpact.lazy import loaded, modules_of

_MODULE_OF = modules_of(__file__)

__all__ = sorted(_MODULE_OF)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = loaded(__name__, _MODULE_OF[name], name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
