"""How kernels are compiled, and when a compiled one is out of date."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

from femimpact.contact import formulas

__all__ = ["compiled", "inlined"]

# _nrt=False: nothing here allocates, and counting references to array slices would cost ten times the arithmetic
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

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
    """Compile a function of arrays and numbers."""
    return _compile(function)


def inlined(function: Function) -> Function:
    """Compile a function that is called from one place: a call would copy every array's descriptor."""
    return _compile(function, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
