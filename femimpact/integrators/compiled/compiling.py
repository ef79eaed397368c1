"""How kernels are compiled: by numba's private insides where they are known, else by its public way."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import numba
import numpy as np
from numba.core import config

from femimpact.integrators.compiled.code_files import CodeFiles, candidates, open_code_files

__all__ = [
    "TESTED",
    "UNCOUNTED",
    "VERSIONS",
    "ZERO",
    "apart",
    "called",
    "compiled",
    "compiled_long",
    "entry",
    "inlined",
]

ZERO = cast(int, np.int64(0))
"""To numba a written 0 is of a type of its own: what is called with it, and with an index, is compiled twice."""

TESTED = frozenset({("0.68.1", "0.50.0")})
"""Versions of numba and llvmlite whose private insides are known."""

VERSIONS = (numba.__version__, llvmlite.__version__)

UNCOUNTED = VERSIONS in TESTED and not getattr(config, "DISABLE_JIT", 0)
"""Whether compiled functions count no references to arrays."""

PACKAGE = Path(__file__).parents[2]

Function = TypeVar("Function", bound=Callable[..., Any])

if VERSIONS in TESTED:
    from femimpact.integrators.compiled import numba_insides

    FILES: CodeFiles | None = open_code_files(PACKAGE, candidates(PACKAGE), *VERSIONS)

    def _whole(function: Callable[..., Any], long: bool = False) -> Any:
        # the stamp is of the package's sources
        inside = Path(inspect.getfile(function)).is_relative_to(PACKAGE)
        return numba_insides.compiled(function, FILES if inside else None, long)

    def _part(function: Callable[..., Any], forceinline: bool) -> Any:
        return numba_insides.called(function, forceinline)

    _apart = numba_insides.apart
else:
    FILES = None
    logging.getLogger("femimpact").warning(
        "numba %s with llvmlite %s is not a pair whose private insides femimpact was tested with: "
        "kernels are compiled for minutes, in every process anew, and run slower, with the same results",
        *VERSIONS,
    )

    def _whole(function: Callable[..., Any], long: bool = False) -> Any:
        return numba.njit(nogil=True, error_model="numpy")(function)

    def _part(function: Callable[..., Any], forceinline: bool) -> Any:
        return _whole(function)

    _apart = _whole


def compiled(function: Function) -> Function:
    """Compile a function of arrays and numbers that only Python calls, and keep it on disk."""
    return cast(Function, _whole(function))


def compiled_long(function: Function) -> Function:
    """The same for a function that takes long to compile: a line on stderr says so."""
    return cast(Function, _whole(function, long=True))


def entry(function: Function) -> Function:
    """Let Python too call a function that compiled ones call."""
    return compiled(getattr(function, "py_func", function))


def called(function: Function) -> Function:
    """Compile a function that only compiled ones call: it needs no entry from Python and no place on disk."""
    return cast(Function, _part(function, False))


def inlined(function: Function) -> Function:
    """The same, compiled into those that call it: a call would copy every array's descriptor."""
    return cast(Function, _part(function, True))


def apart(function: Function) -> Function:
    """The same, kept out of those that call it: beside its variables a loop would lack registers for its own."""
    return cast(Function, _apart(function))
