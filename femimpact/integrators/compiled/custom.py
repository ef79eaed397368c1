"""A law of the user's own as machine code: compiled to a C function once, called by its address."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import lru_cache
from typing import Any, cast

from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic

from femimpact.errors import Fault, InputError

__all__ = ["address_of", "call_law"]

SIGNATURE = types.float64(types.float64, types.float64, types.float64)


@lru_cache(maxsize=256)
def _compiled_law(force: Callable[[float, float, float], float]) -> Any:
    """The C function of a law; the cache keeps it alive, as its address lies in arrays."""
    plain = getattr(force, "py_func", force)
    try:
        return cfunc(SIGNATURE, error_model="numpy")(plain)
    except Exception as error:
        # whatever the compiler raises is about the user's function
        name = getattr(force, "__name__", repr(force))
        words = " ".join(str(error).split())[:300]
        allowed = f"must be a plain function of depth, rate, approach_speed that numba compiles: {words}"
        raise InputError([Fault("contact.force", name, "", allowed)]) from error


def address_of(force: Callable[[float, float, float], float]) -> int:
    """Address of double force(double depth, double rate, double approach_speed).

    Raises
    ------
    InputError
        If numba cannot compile the function.
    """
    positional = not inspect.isclass(force)
    if not positional:
        raise InputError([Fault("contact.force", repr(force), "", "must be a plain function")])
    return int(_compiled_law(force).address)


@intrinsic
def _call_law(typing_context: Any, address: Any, depth: Any, rate: Any, approach: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        function = ir.FunctionType(double, [double, double, double])
        return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])

    return types.float64(types.int64, types.float64, types.float64, types.float64), generate


call_law = cast(Callable[[int, float, float, float], float], _call_law)
"""Force (N) of the law at an address, for a depth (m), its rate and the approach speed (m/s)."""
