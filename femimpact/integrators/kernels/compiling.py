"""How kernels are compiled, and when a compiled one is out of date."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite.binding import Linkage
from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from femimpact.contact import formulas

__all__ = ["ZERO", "apart", "called", "compiled", "entry", "inlined"]

# _nrt=False: nothing here allocates, and counting references to array slices would cost ten times the arithmetic
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}

ZERO = cast(int, np.int64(0))
"""To numba a written 0 is of a type of its own: what is called with it, and with an index, is compiled twice."""

Function = TypeVar("Function", bound=Callable[..., Any])


class _Part(JITCodeLibrary):
    """Code of an inner function: what it is linked into optimises it and makes machine code of it, once.

    numba does both for every function with all that it calls: a function five calls deep six times over.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    @property
    def codegen(self) -> _Part:
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Nothing: there is no machine code that could be told where its environment lies."""


class _Apart(_Part):
    """Code of an inner function that stays one."""

    def add_ir_module(self, module: Any) -> None:
        for function in module.functions:
            if function.blocks:
                function.attributes.add("noinline")
        super().add_ir_module(module)  # type: ignore[no-untyped-call]


class _Whole(JITCodeLibrary):
    """Code of a function with all that it calls: what nobody else can call may lose arguments that it does not use."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)  # type: ignore[no-untyped-call]
        self.enable_object_caching()  # type: ignore[no-untyped-call]

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = Linkage.internal
        super()._optimize_final_module()  # type: ignore[no-untyped-call]


class _WholeCompiler(Compiler):
    """numba's compiler, with code of another kind."""

    KIND: Any = _Whole

    def __init__(self, typing: Any, target: Any, library: Any, *others: Any) -> None:
        own = library or self.KIND(target.codegen(), "femimpact")
        super().__init__(typing, target, own, *others)  # type: ignore[no-untyped-call]


class _PartCompiler(_WholeCompiler):
    KIND = _Part


class _ApartCompiler(_WholeCompiler):
    KIND = _Apart


def _stamp() -> tuple[tuple[float, int], ...]:
    """Times and sizes of every source that ends up in compiled code."""
    here = Path(__file__)
    sources = [*sorted(here.parent.glob("*.py")), here.parent.parent / "layout.py", Path(formulas.__file__)]
    return tuple((source.stat().st_mtime, source.stat().st_size) for source in sources)


STAMP = _stamp()


def compiled(function: Function) -> Function:
    """Compile a function of arrays and numbers that only Python calls, and keep it on disk."""
    options: dict[str, Any] = OPTIONS | {"cache": True, "no_cfunc_wrapper": True, "pipeline_class": _WholeCompiler}
    dispatcher = njit(**options)(function)
    # numba looks at the function's own file only; here one function inlines others of other files
    file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if file is not None:
        file._source_stamp = STAMP
    return cast(Function, dispatcher)


def entry(function: Function) -> Function:
    """Let Python too call a function that compiled ones call."""
    return cast(Function, compiled(getattr(function, "py_func", function)))


def _inner(function: Function, compiler: type[_WholeCompiler], forceinline: bool) -> Function:
    # inlining said outright: what is left out here is taken over from the caller that is compiled first
    options: dict[str, Any] = {"forceinline": forceinline, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(Function, njit(**OPTIONS, **options, pipeline_class=compiler)(function))


def called(function: Function) -> Function:
    """Compile a function that only compiled ones call: it needs no entry from Python and no place on disk."""
    return _inner(function, _PartCompiler, False)


def inlined(function: Function) -> Function:
    """The same, compiled into those that call it: a call would copy every array's descriptor."""
    return _inner(function, _PartCompiler, True)


def apart(function: Function) -> Function:
    """The same, kept out of those that call it: beside its variables a loop would lack registers for its own."""
    return _inner(function, _ApartCompiler, False)
