"""Named tuples that compiled functions pass by address.

numba copies the descriptor of every array of a tuple into every call and every function that has it as argument; most
of the time of compiling went there. By address a tuple is one argument, and a field is read where it is used.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any, TypeVar, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model

from femimpact.integrators.compiled.compiling import UNCOUNTED, inlined

__all__ = ["by_address"]

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


# what lies there is not counted as a reference: where numba counts them, tuples are passed as they are
by_address: Callable[[Held], Held] = cast(Any, _by_address) if UNCOUNTED else _same
"""A named tuple as functions called from here are to get it; anything else is what it was.

It is good until the function that made it returns.
"""
