"""The compiled core: C++20 kernels in `femimpact._core`, loaded when the first of its functions is asked for.

`from femimpact import core` costs nothing; `core.exponentials` loads the binary (`femimpact.core.binary`), and nothing
else does. The types of its functions are in `__init__.pyi`.

The structs of arrays that the functions take are named tuples here, `core.events.Cases` and `core.steps.Cases`, made
from the tables of the binary. Their fields are described in `event_driven/loop_data.hpp` and `stepping/loop_data.hpp`;
`events.pyi` and `steps.pyi` repeat names and types for type checkers.
"""

from __future__ import annotations

from collections import namedtuple
from types import SimpleNamespace
from typing import Any

# every function of the binary; a test compares them
__all__ = [
    "advance", "build_info", "choose_target", "collide", "cosine_and_sine", "elastic_potential", "exponentials",
    "keep_present", "next_event", "normal_force", "penetration", "run_cases", "switching_potential",
    "switching_stiffness", "tables", "write_energies",
]  # fmt: skip

ARGUMENTS = {"events": ("task", "job", "ledger", "search_call"), "steps": ("block", "fine", "law")}
"""Arguments that are tuples, of the functions for the loop over events and for the loop over steps."""


def __getattr__(name: str) -> Any:
    """A function of the binary, or its named tuples; the binary is loaded for the first of them."""
    from femimpact.core.binary import loaded

    if name in __all__:
        found = getattr(loaded(), name)
    elif name in ARGUMENTS:
        found = _tuples(loaded().tables(), ARGUMENTS[name])
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found
    return found


def _tuples(tables: list[tuple[str, str, str, int]], arguments: tuple[str, ...]) -> SimpleNamespace:
    """Named tuples of some arguments and of the tuples within them, by the names of their structs."""
    of_path = {path: name for path, kind, name, _ in tables if kind == "tuple" and path.partition(".")[0] in arguments}
    fields: dict[str, dict[str, None]] = {name: {} for name in of_path.values()}
    for path, *_ in tables:
        outer, _, field = path.rpartition(".")
        if outer in of_path:
            fields[of_path[outer]][field] = None
    return SimpleNamespace(**{name: namedtuple(name, names) for name, names in fields.items()})
