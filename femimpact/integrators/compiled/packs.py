"""Eight cases side by side as one number, a SIMD register's worth: no loop that a compiler may fail to vectorise.

A source written with these functions serves one case alone too: what they do for a pack they do for a float,
with the same rounding. They are called without the first argument.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, register_model

__all__ = [
    "WIDTH",
    "Value",
    "differ_in_sign",
    "entry",
    "fill",
    "fma",
    "how_many_beyond",
    "load",
    "product",
    "store",
    "times",
]

Value: TypeAlias = Any
"""A float, or a pack: what `load` gives, as its last argument is."""

WIDTH = 8
"""Cases in a pack."""

LANES = ir.VectorType(ir.DoubleType(), WIDTH)


def _generated(typing: Callable[..., Any]) -> Callable[..., Any]:
    return cast(Callable[..., Any], intrinsic(typing))


class _Pack(types.Type):
    """Eight doubles."""


PACK = _Pack(name="Pack")


@register_model(_Pack)
class _PackModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, LANES)  # type: ignore[no-untyped-call]


def _spread(builder: Any, number: Any) -> Any:
    """A number in every lane."""
    one = builder.insert_element(ir.Constant(LANES, ir.Undefined), number, ir.IntType(32)(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH))


def _address(context: Any, builder: Any, kind: Any, values: Any) -> Any:
    """Where (array, row, case, like) lies; the array is contiguous, and no index is negative."""
    array, row, case, like = values
    descriptor = context.make_array(kind)(context, builder, array)
    cases = builder.extract_value(descriptor.shape, kind.ndim - 1)
    start = builder.gep(descriptor.data, [builder.add(builder.mul(row, cases), case)], inbounds=True)
    return builder.bitcast(start, ir.PointerType(like.type))


def _is_contiguous(array: Any) -> bool:
    return isinstance(array, types.Array) and array.layout == "C" and array.dtype == types.float64


@_generated
def fill(typing: Any, number: Any) -> Any:
    """A number in every lane of a pack."""
    return PACK(types.float64), lambda context, builder, signature, values: _spread(builder, values[0])


@_generated
def load(typing: Any, array: Any, row: Any, case: Any, like: Any) -> Any:
    """Read an array (n, cases) in a row from a case on: a pack where `like` is one, else a float."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        # as doubles are aligned: an array need not start where a register's worth does
        return builder.load(_address(context, builder, array, values), align=8)

    return (like(array, types.intp, types.intp, like), generate) if _is_contiguous(array) else None


@_generated
def store(typing: Any, array: Any, row: Any, case: Any, value: Any) -> Any:
    """Write a value to where `load` reads it."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        builder.store(values[3], _address(context, builder, array, values), align=8)
        return context.get_dummy_value()

    return (types.void(array, types.intp, types.intp, value), generate) if _is_contiguous(array) else None


@_generated
def entry(typing: Any, table: Any, index: Any) -> Any:
    """Read a number of a flat table; the index is not checked, and must not be negative."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        descriptor = context.make_array(table)(context, builder, values[0])
        return builder.load(builder.gep(descriptor.data, [values[1]], inbounds=True))

    return (types.float64(table, types.intp), generate) if _is_contiguous(table) else None


@_generated
def fma(typing: Any, number: Any, value: Any, to: Any) -> Any:
    """A number times a value, plus another value, rounded once."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        factor, name = values[0], "llvm.fma.f64"
        if value == PACK:
            factor, name = _spread(builder, factor), f"llvm.fma.v{WIDTH}f64"
        kind = ir.FunctionType(values[1].type, [values[1].type] * 3)
        function = cgutils.get_or_insert_function(builder.module, kind, name)  # type: ignore[no-untyped-call]
        return builder.call(function, [factor, *values[1:]])

    return value(types.float64, value, value), generate


@_generated
def product(typing: Any, number: Any, value: Any) -> Any:
    """A number times a value."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.fmul(_spread(builder, values[0]) if value == PACK else values[0], values[1])

    return value(types.float64, value), generate


@_generated
def times(typing: Any, a: Any, b: Any) -> Any:
    """Product of two values."""
    return a(a, a), lambda context, builder, signature, values: builder.fmul(*values)


@_generated
def differ_in_sign(typing: Any, a: Any, b: Any) -> Any:
    """Whether two values differ in sign in any lane; zeros have a sign."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        whole = ir.IntType(64)
        bits = ir.VectorType(whole, WIDTH) if a == PACK else whole
        changed = builder.xor(*(builder.bitcast(value, bits) for value in values))
        below = builder.icmp_signed("<", changed, ir.Constant(bits, None if a == PACK else 0))
        if a != PACK:
            return below
        return builder.icmp_unsigned("!=", builder.bitcast(below, ir.IntType(WIDTH)), ir.IntType(WIDTH)(0))

    return types.boolean(a, a), generate


@_generated
def how_many_beyond(typing: Any, x: Any, plus: Any, minus: Any, busy: Any) -> Any:
    """In how many lanes x > plus, x < -minus or busy > 0."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x_, plus_, minus_, busy_ = values
        zero = ir.Constant(x_.type, None if x == PACK else 0.0)
        beyond = builder.or_(
            builder.or_(
                builder.fcmp_ordered(">", x_, plus_), builder.fcmp_ordered("<", x_, builder.fsub(zero, minus_))
            ),
            builder.fcmp_ordered(">", busy_, zero),
        )
        if x != PACK:
            return builder.zext(beyond, ir.IntType(64))
        return builder.zext(builder.ctpop(builder.bitcast(beyond, ir.IntType(WIDTH))), ir.IntType(64))

    return types.intp(x, x, x, x), generate
