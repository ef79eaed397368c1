"""Private insides of numba: code that is made once with all that calls it, and kept on disk in files of our own.

Only for the versions in `TESTED`; `compiling` does without this module for every other one.
"""

from __future__ import annotations

import gc
import hashlib
import logging
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from llvmlite import ir
from llvmlite.binding import Linkage
from numba import njit
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.serialize import dumps
from numba.core.targetconfig import ConfigStack
from numba.core.types.functions import BaseFunction

from femimpact.integrators.compiled.code_files import CodeFiles

__all__ = ["apart", "called", "compiled"]

# _nrt=False: nothing here allocates, and counting references to array slices would cost ten times the arithmetic
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}

BYTES = ir.IntType(8).as_pointer()


class _Part(JITCodeLibrary):
    """Code of an inner function: what it is linked into optimises it and makes machine code of it, once.

    numba does both for every function with all that it calls: a function five calls deep six times over.
    """

    def add_ir_module(self, module: Any) -> None:
        # nothing in the function writes to where a named tuple lies that was passed by address
        for function in module.functions:
            for argument in function.args if function.blocks else ():
                if argument.type == BYTES and argument.name.count(".") == 1:
                    argument.add_attribute("noalias")
        super().add_ir_module(module)  # type: ignore[no-untyped-call]

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    @property
    def codegen(self) -> _Part:
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Nothing: there is no machine code to set the place of its environment in."""


class _Apart(_Part):
    """Code of an inner function that stays one."""

    def add_ir_module(self, module: Any) -> None:
        for function in module.functions:
            if function.blocks:
                function.attributes.add("noinline")
        super().add_ir_module(module)


class _Whole(JITCodeLibrary):
    """Code of a function with all that it calls: what no other code can call may lose unused arguments."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)  # type: ignore[no-untyped-call]
        self.enable_object_caching()  # type: ignore[no-untyped-call]

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = Linkage.internal
        super()._optimize_final_module()  # type: ignore[no-untyped-call]


@contextmanager
def _call_types_remembered() -> Iterator[None]:
    """Within it a call whose types were resolved before is not resolved again.

    numba tries every overload of an operator anew at each of its uses, and in each of several rounds: a fifth of the
    time. Only one thread is in here at a time: it holds numba's lock.
    """
    known: dict[tuple[Any, ...], tuple[Any, Any]] = {}
    resolve, collects = BaseFunction.get_call_type, gc.isenabled()

    def get_call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
        flags = ConfigStack.top_or_none()  # type: ignore[no-untyped-call]
        # an overload is compiled with the flags of its caller
        own = "" if flags is None else repr(sorted(flags._values.items(), key=str))
        key = (id(function), tuple(args), tuple(sorted(kws.items())), own)
        if key not in known:
            # with the function itself: its number is not given to another one as long as it exists
            known[key] = (resolve(function, context, args, kws), function)
        return known[key][0]

    BaseFunction.get_call_type = get_call_type  # type: ignore[method-assign, assignment]
    # a million small objects exist as long as this: to look through them again and again finds nothing
    gc.disable()
    try:
        yield
    finally:
        BaseFunction.get_call_type = resolve  # type: ignore[method-assign]
        if collects:
            gc.enable()


class _WholeCompiler(Compiler):
    """numba's compiler, with code of another kind."""

    KIND: Any = _Whole

    def __init__(self, typing: Any, target: Any, library: Any, *others: Any) -> None:
        own = library or self.KIND(target.codegen(), "femimpact")
        super().__init__(typing, target, own, *others)  # type: ignore[no-untyped-call]

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        # all that it calls is compiled within
        with _call_types_remembered() if self.KIND is _Whole else nullcontext():
            return super().compile_extra(function)  # type: ignore[no-untyped-call]


class _PartCompiler(_WholeCompiler):
    KIND = _Part


class _ApartCompiler(_WholeCompiler):
    KIND = _Apart


class _OnDisk(NullCache):
    """numba's interface to a cache of one function, over files that are checked before they are read.

    numba's own files end the process that reads a damaged one, and are stamped with the function's own source only.
    """

    def __init__(self, function: Callable[..., Any], files: CodeFiles, long: bool) -> None:
        self._name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self._files = files
        self._long = long

    def file_name(self, signature: Any, codegen: Any) -> str:
        """Name of the file for arguments of these types on this processor and this Python."""
        key = repr((signature, codegen.magic_tuple(), sys.version_info[:3]))
        return f"{self._name}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.code"

    def load_overload(self, signature: Any, target: Any) -> Any:
        target.refresh()
        payload = self._files.read(self.file_name(signature, target.codegen()))
        if payload is None:
            if self._long:
                words = "femimpact compiles %s for this kind of system: up to half a minute, once on this machine"
                logging.getLogger("femimpact").warning(words, self._name)
            return None
        try:
            return CompileResult._rebuild(target, *pickle.loads(payload))  # type: ignore[no-untyped-call]
        except Exception as error:
            # whole, of these sources and these versions, and yet not to be taken
            logging.getLogger("femimpact").warning("compiled code of %s is made again: %s", self._name, error)
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        if result.library.has_dynamic_globals or any(not part.can_cache for part in result.lifted):
            return
        payload = dumps(result._reduce())  # type: ignore[no-untyped-call]
        self._files.write(self.file_name(signature, result.codegen), payload)


def _compiled(function: Callable[..., Any], compiler: type[Compiler], **more: bool) -> Any:
    options: dict[str, Any] = OPTIONS | more | {"pipeline_class": compiler}
    return njit(**options)(function)


def compiled(function: Callable[..., Any], files: CodeFiles | None, long: bool) -> Any:
    """Compile a function that only Python calls, and keep it in files where there are any; say so if it takes long."""
    dispatcher = _compiled(function, _WholeCompiler)
    if files is not None:
        dispatcher._cache = _OnDisk(function, files, long)
    return dispatcher


def called(function: Callable[..., Any], forceinline: bool) -> Any:
    """Compile a function that only compiled ones call."""
    # inlining said outright: what is left out here is taken over from the caller that is compiled first
    return _compiled(function, _PartCompiler, no_cpython_wrapper=True, forceinline=forceinline)


def apart(function: Callable[..., Any]) -> Any:
    """Compile a function that only compiled ones call, and keep it out of them."""
    return _compiled(function, _ApartCompiler, no_cpython_wrapper=True, forceinline=False)
