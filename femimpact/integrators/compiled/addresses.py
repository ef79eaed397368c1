"""Named tuples that compiled functions pass by address.

numba copies the descriptor of every array of a tuple into every call and every function that has it as argument; most
of the time of compiling went there. By address a tuple is one argument, and a field is read where it is used.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import typeof
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
    unbox,
)

from femimpact.integrators.compiled.compiling import UNCOUNTED, inlined

if UNCOUNTED:
    from numba._dispatcher import compute_fingerprint

__all__ = ["by_address", "from_python"]

Held = TypeVar("Held")

WORD = ir.IntType(64)

BYTES = ir.IntType(8).as_pointer()


class _Address(types.Type):
    """Where a named tuple lies: its fields one after another, each from a whole word on."""

    def __init__(self, held: Any) -> None:
        self.held = held
        # a short name: it stands in the symbol of every function that has such an argument
        stamp = hashlib.sha256(str(held).encode()).hexdigest()[:8]
        super().__init__(name=f"{held.instance_class.__name__}{stamp}")


@register_model(_Address)
class _AddressModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, BYTES)  # type: ignore[no-untyped-call]


def _is_tuple(kind: Any) -> bool:
    return isinstance(kind, types.BaseNamedTuple)


def _leaves(kind: Any) -> int:
    """Numbers and pointers that a value consists of."""
    if isinstance(kind, ir.BaseStructType):
        return sum(_leaves(element) for element in kind.elements)
    return int(kind.count) * _leaves(kind.element) if isinstance(kind, ir.ArrayType) else 1


def _words(context: Any, kind: Any) -> int:
    """Words that are enough for a value, or for all fields of a named tuple."""
    if _is_tuple(kind):
        return sum(_words(context, field) for field in kind.types)
    # none of them is longer than a word
    return _leaves(context.data_model_manager[kind].get_data_type())


def _place(context: Any, builder: Any, start: Any, kind: Any, index: int) -> Any:
    """Address of one field of a named tuple."""
    before = sum(_words(context, field) for field in kind.types[:index])
    return builder.gep(start, [ir.Constant(WORD, 8 * before)], inbounds=True)


def _store(context: Any, builder: Any, start: Any, kind: Any, value: Any) -> None:
    for index, field in enumerate(kind.types):
        own, place = builder.extract_value(value, index), _place(context, builder, start, kind, index)
        if _is_tuple(field):
            _store(context, builder, place, field, own)
        else:
            data = context.data_model_manager[field].as_data(builder, own)
            builder.store(data, builder.bitcast(place, data.type.as_pointer()))


def _generated(typing: Callable[..., Any]) -> Callable[..., Any]:
    return cast(Callable[..., Any], intrinsic(typing))


@_generated
def _by_address(typing: Any, value: Any) -> Any:
    if not _is_tuple(value):
        return value(value), lambda context, builder, signature, values: values[0]

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        memory = ir.ArrayType(WORD, max(_words(context, value), 1))
        start = builder.bitcast(cgutils.alloca_once(builder, memory), BYTES)  # type: ignore[no-untyped-call]
        _store(context, builder, start, value, values[0])
        return start

    return _Address(value)(value), generate


# ---- from Python -----------------------------------------------------------------------------------


class _Flattened:
    """Arrays and numbers of a named tuple, one after another, and the type of it all."""

    def __init__(self, value: Any) -> None:
        arrays: list[Any] = []
        numbers: list[Any] = []
        _flatten(value, arrays, numbers)
        self.arrays = tuple(arrays)
        self.numbers = tuple(numbers)
        # arrays of other types would be read as those of the type
        key = type(value), compute_fingerprint(value)
        kind = _ADDRESSES.get(key)
        if kind is None:
            kind = _ADDRESSES.setdefault(key, _Address(typeof(value)))  # type: ignore[no-untyped-call]
        self._numba_type_ = kind


_ADDRESSES: dict[tuple[type, bytes], _Address] = {}
"""Types by what distinguishes them, as numba keeps its own: to find one anew takes longer than a short run."""


def _flatten(value: Any, arrays: list[Any], numbers: list[Any]) -> None:
    for field in value:
        if isinstance(field, np.ndarray):
            arrays.append(field)
        elif isinstance(field, tuple):
            _flatten(field, arrays, numbers)
        else:
            numbers.append(field)


def _fields_in(context: Any, kind: Any, start: int = 0) -> Iterator[tuple[int, Any]]:
    """Word and type of each array and number of a named tuple."""
    for field in kind.types:
        if _is_tuple(field):
            yield from _fields_in(context, field, start)
        else:
            yield start, field
        start += _words(context, field)


@unbox(_Address)  # type: ignore[untyped-decorator, no-untyped-call]
def _unbox_flattened(kind: Any, value: Any, c: Any) -> Any:
    """Fill the memory of a named tuple: its arrays in one loop, not in code of its own for each."""
    builder, context, api = c.builder, c.context, c.pyapi
    memory = ir.ArrayType(WORD, max(_words(context, kind.held), 1))
    start = builder.bitcast(cgutils.alloca_once(builder, memory), BYTES)  # type: ignore[no-untyped-call]
    numbers, arrays = (api.object_getattr_string(value, name) for name in ("numbers", "arrays"))
    fields = list(_fields_in(context, kind.held))
    words = [word for word, field in fields if isinstance(field, types.Array)]
    own = [(word, field) for word, field in fields if not isinstance(field, types.Array)]
    for index, (word, field) in enumerate(own):
        number = c.unbox(field, api.tuple_getitem(numbers, index)).value
        data = context.data_model_manager[field].as_data(builder, number)
        place = builder.gep(start, [ir.Constant(WORD, 8 * word)], inbounds=True)
        builder.store(data, builder.bitcast(place, data.type.as_pointer()))
    places = ir.Constant.literal_array([WORD(word) for word in words])
    table = cgutils.global_constant(builder, "words", places)  # type: ignore[no-untyped-call]
    failed = cgutils.alloca_once_value(builder, ir.IntType(32)(0))  # type: ignore[no-untyped-call]
    item = api._get_function(ir.FunctionType(api.pyobj, [api.pyobj, api.py_ssize_t]), name="PyTuple_GetItem")
    with cgutils.for_range(builder, WORD(len(words))) as loop:
        word = builder.load(builder.gep(table, [WORD(0), loop.index], inbounds=True))
        place = builder.gep(start, [builder.mul(word, WORD(8))], inbounds=True)
        status = api.numba_array_adaptor(builder.call(item, [arrays, loop.index]), place)
        builder.store(builder.or_(builder.load(failed), status), failed)
    for held in (numbers, arrays):
        api.decref(held)
    wrong = cgutils.is_not_null(builder, builder.load(failed))  # type: ignore[no-untyped-call]
    with builder.if_then(wrong, likely=False):
        api.err_set_string("PyExc_TypeError", "a field of a named tuple is no array that compiled code can read")
    return NativeValue(start, is_error=wrong)  # type: ignore[no-untyped-call]


def _from_python(value: Any) -> Any:
    return None if value is None else _Flattened(value)


# ---- in compiled code ------------------------------------------------------------------------------


@infer_getattr
class _Fields(AttributeTemplate):
    key = _Address

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]
        if name not in kind.held.fields:
            return None
        field = kind.held.types[kind.held.fields.index(name)]
        return _Address(field) if _is_tuple(field) else field


@lower_getattr_generic(_Address)  # type: ignore[untyped-decorator, no-untyped-call]
def _field(context: Any, builder: Any, kind: Any, start: Any, name: str) -> Any:
    index = kind.held.fields.index(name)
    field, place = kind.held.types[index], _place(context, builder, start, kind.held, index)
    if _is_tuple(field):
        return place
    model = context.data_model_manager[field]
    data = builder.load(builder.bitcast(place, model.get_data_type().as_pointer()))
    return model.from_data(builder, data)


@inlined
def _same(value: Held) -> Held:
    return value


from_python: Callable[[Held], Held] = cast(Any, _from_python) if UNCOUNTED else lambda value: value
"""A named tuple, or None, as Python is to give it to a compiled function: good as long as its arrays are."""

# what lies there is not counted as a reference: where numba counts them, tuples are passed as they are
by_address: Callable[[Held], Held] = cast(Any, _by_address) if UNCOUNTED else _same
"""A named tuple as functions called from here are to get it; anything else is what it was.

It is good until the function that made it returns.
"""
