"""The compiled core: C++20 kernels in `femimpact._core`, loaded when the first of its functions is asked for.

`from femimpact import core` costs nothing; `core.exponentials` loads the binary (`femimpact.core.binary`), and nothing
else does. The types of its functions are in `__init__.pyi`.
"""

from __future__ import annotations

from typing import Any

# every function of the binary; a test compares them
__all__ = [
    "advance", "build_info", "choose_target", "collide", "cosine_and_sine", "elastic_potential", "exponentials",
    "keep_present", "next_event", "normal_force", "penetration", "run_cases", "switching_potential",
    "switching_stiffness", "tables", "write_energies",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """A function of the binary, which is loaded for the first of them."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from femimpact.core.binary import loaded

    found = globals()[name] = getattr(loaded(), name)
    return found
