"""The compiled core: C++20 kernels in `femimpact._core`, loaded when the first of its functions is asked for.

`from femimpact import core` costs nothing; `core.exponentials` loads the binary (`femimpact.core.binary`), and nothing
else does. The types of its functions are in `__init__.pyi`.

The structs of arrays that the functions take are named tuples here, `core.events.Cases` and `core.steps.Cases`, beside
the names of the rows of their arrays. Both come from the tables of the binary, which `event_driven/loop_data.hpp` and
`stepping/loop_data.hpp` describe; the build writes `events.pyi` and `steps.pyi` from these for type checkers.
"""

from __future__ import annotations

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
    from femimpact.core.binary import LOADING, loaded

    with LOADING:
        if name in globals():
            return globals()[name]
        if name in __all__:
            attribute = getattr(loaded(), name)
        elif name in ARGUMENTS:
            from femimpact.core.structs import structs_of

            attribute = structs_of(loaded().tables(), ARGUMENTS[name], name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = attribute
        return attribute
