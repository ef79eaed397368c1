"""How kernels are compiled, and when a compiled one is out of date."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

from femimpact.contact import formulas

__all__ = ["called", "compiled", "inlined"]

# _nrt=False: nothing here allocates, and counting references to array slices would cost ten times the arithmetic
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}

Function = TypeVar("Function", bound=Callable[..., Any])


def _stamp() -> tuple[tuple[float, int], ...]:
    """Times and sizes of every source that ends up in compiled code."""
    here = Path(__file__)
    sources = [*sorted(here.parent.glob("*.py")), here.parent.parent / "layout.py", Path(formulas.__file__)]
    return tuple((source.stat().st_mtime, source.stat().st_size) for source in sources)


STAMP = _stamp()


def _compile(function: Function, **options: Any) -> Function:
    dispatcher = njit(**OPTIONS, **options)(function)
    # numba looks at the function's own file only; here one function inlines others of other files
    file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if file is not None:
        file._source_stamp = STAMP
    return cast(Function, dispatcher)


def compiled(function: Function) -> Function:
    """Compile a function of arrays and numbers that Python calls, and keep it on disk."""
    return _compile(function, cache=True, forceinline=False, no_cpython_wrapper=False, no_cfunc_wrapper=True)


def called(function: Function) -> Function:
    """Compile a function that only compiled ones call: it needs no entry from Python and no place on disk."""
    # said outright: what is left out here is taken over from the caller that is compiled first
    return _compile(function, forceinline=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def inlined(function: Function) -> Function:
    """The same, compiled into those that call it: a call would copy every array's descriptor."""
    return _compile(function, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
