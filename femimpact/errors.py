"""Errors and their words: the one place for the texts of input errors, and for what counts as a sound value."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import numbers
import operator
import re
import sys
import types
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar, cast

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


P = ParamSpec("P")
R = TypeVar("R")

LONGEST_SHOWN = 200
"""Characters of a value that a line shows."""

_BRACKETS: dict[type, tuple[str, str]] = {list: ("[", "]"), tuple: ("(", ")"), dict: ("{", "}"), set: ("{", "}")}

LONGEST_NAME = 255
"""Characters of the name of a file or a folder, on the usual file systems."""

MOST_AXES = 32

MOST_LAZY = 10**8
"""Entries of a range, or of a list with the same rows many times, for which memory is taken."""

MOST_ARGUMENTS = 3
"""Arguments of a call that a line names."""

MOST = 10**15
"""A whole number beyond this is taken for a mistake: it neither counts anything nor fits into a float."""


NO_NAME = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
"""Characters that no name may hold: control characters, ends of lines, halves of surrogate pairs."""

SMALLEST, LARGEST = 1e-30, 1e30
"""Range of numbers that must be above zero: beyond it, products and powers of a few underflow or overflow."""


class FemimpactError(Exception):
    """Base of every error that femimpact raises on purpose."""


class DivergenceError(FemimpactError):
    """A run whose motion is not finite, or grew past every physical bound."""


class CoreError(FemimpactError, ImportError):
    """The compiled core is missing, older than its sources, or not made for this processor."""


class _Shown(str):
    """Words in place of a value that cannot be pickled from one process to another."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def _shown(value: object) -> str:
    """A value in one short line, whatever it raises when it is asked."""
    if hasattr(type(value), "_head"):
        # results in a wrong place: all that they hold is no value to compare
        return type(value).__name__
    try:
        return _in_words(value)
    except Exception:
        # Python shows no whole number of more than some thousand digits, and a class may raise anything
        return f"a {type(value).__name__} that cannot be shown"


def _beginning(value: object, room: int) -> str:
    """Text of a value, to some characters at least: what is large, or contains itself, is cut off."""
    kind = type(value)
    if kind in (str, bytes, bytearray):
        return repr(value[: room + 1])  # type: ignore[index]
    if room <= 0 or kind not in _BRACKETS or not value:
        return repr(value) if room > 0 or kind not in _BRACKETS else "..."
    opening, closing = _BRACKETS[kind]
    inside = ""
    for entry in value:  # type: ignore[attr-defined]
        inner = room - len(inside) - len(opening)
        if inner <= 0:
            break
        words = _beginning(entry, inner)
        if kind is dict:
            words += f": {_beginning(value[entry], inner - len(words))}"  # type: ignore[index]
        inside += f", {words}" if inside else words
    return f"{opening}{inside}{',' if kind is tuple and len(value) == 1 else ''}{closing}"  # type: ignore[arg-type]


def _in_words(value: object) -> str:
    if isinstance(value, numbers.Number) and hasattr(value, "item"):
        # a number of numpy would show its type
        value = value.item()
    if hasattr(value, "dtype") and getattr(value, "shape", ()) != ():
        return f"array of {value.dtype} of shape {value.shape}"  # type: ignore[attr-defined]
    if hasattr(value, "data_vars"):
        return f"a dataset of {', '.join(map(str, value.data_vars))}"
    if dataclasses.is_dataclass(value) and isinstance(value, type):
        return f"the class {value.__name__} (did you mean {_call_of(value)}?)"
    if isinstance(value, types.FunctionType) and value.__name__.isidentifier():
        return f"the function {value.__name__} (did you mean {_call_of(value)}?)"
    words = " ".join(_beginning(value, LONGEST_SHOWN).split())
    return words if len(words) <= LONGEST_SHOWN else f"{words[: LONGEST_SHOWN - 3]}..."


def _call_of(noun: Any) -> str:
    """A call of a class or a function, with the arguments that it needs where they are few."""
    args = inspect.signature(noun).parameters.values()
    needed = [
        one for one in args if one.default is one.empty and one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)
    ]
    named = [f"{one.name}=..." for one in needed]
    if not named and isinstance(noun, type):
        try:
            noun()
        except InputError:
            # one of several arguments is required
            return f"{noun.__name__}(...)"
    return f"{noun.__name__}({', '.join(named) if len(named) <= MOST_ARGUMENTS else '...'})"


def kind_of(value: object) -> object:
    """Text for a value of the wrong kind: the name of its class, or the class itself where the value is one."""
    return value if isinstance(value, (type, types.FunctionType)) else type(value).__name__


@dataclasses.dataclass(frozen=True)
class Fault:
    """One bad input: which key, which value, in which unit, and what is allowed."""

    key: str
    value: object
    unit: str
    allowed: str

    def __str__(self) -> str:
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        value_text = f" = {_shown(self.value)}{unit}" if self.value is not None else ""
        # a key of a file may be any text
        key = NO_NAME.sub(lambda match: repr(match[0])[1:-1], self.key)
        return f"{key}{value_text}: {self.allowed}"

    def __reduce__(self) -> tuple[Any, ...]:
        plain = self.value is None or isinstance(self.value, (str, bool, int, float))
        value = self.value if plain else _Shown(_shown(self.value))
        return Fault, (self.key, value, self.unit, self.allowed)

    def under(self, prefix: str) -> Fault:
        """The same fault with its key below a table's path."""
        return dataclasses.replace(self, key=f"{prefix}.{self.key}" if prefix else self.key)


class InputWarning(UserWarning):
    """An input that is allowed, and so unusual that another unit may have been meant."""


class ResultWarning(UserWarning):
    """What may make a number of a result wrong: one of the `warnings` that the result of a call holds."""


class InputError(FemimpactError, ValueError):
    """One or more bad inputs, each with key, value, unit and allowed range."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))

    def __reduce__(self) -> tuple[Any, ...]:
        # an exception is made again from its text by default, which is not what makes this one
        return type(self), (self.faults,)


class _Refused(Exception):  # noqa: N818 - raised and caught in this module only
    """A value is not what a field's metadata allows; what it says, if anything, is allowed too."""


def quantity(
    unit: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
    integer: bool = False,
    several: bool = False,
    finite: bool = True,
) -> dict[str, Any]:
    """Metadata of a dataclass field that holds a number, or several where it may: its unit and its allowed range.

    Where it need not be finite, infinity is held to the bounds, and what is not a number means unknown.
    """
    bounds = {"above": above, "at_least": at_least, "at_most": at_most, "below": below}
    limits = {k: v for k, v in bounds.items() if v is not None}
    words = {"above": "> ", "at_least": ">= ", "at_most": "<= ", "below": "< "}
    kind = "a whole number" if integer else "a finite number" if finite else "a number"
    range_words = " and ".join(f"{words[name]}{bound:g}" for name, bound in limits.items())
    of = "" if unit in ("", "1") else f" {unit}"
    take = functools.partial(_number, bounds=limits, integer=integer, finite=finite)
    schema = _number_schema(limits, integer, finite)
    return {
        "unit": unit,
        "allowed": f"must be {kind}{' ' + range_words + of if range_words else ', in' + of if of else ''}",
        "take": functools.partial(_numbers, take=take) if several else take,
        "schema": {"anyOf": [schema, {"type": "array", "items": schema, "minItems": 1}]} if several else schema,
    }


def _number_schema(bounds: Mapping[str, float], integer: bool, finite: bool) -> dict[str, Any]:
    """JSON schema of the numbers that `_number` takes; it cannot name what is not a number."""
    words = {"above": "exclusiveMinimum", "at_least": "minimum", "at_most": "maximum", "below": "exclusiveMaximum"}
    schema: dict[str, Any] = {"type": "integer" if integer else "number"}
    if integer:
        schema |= {"minimum": -MOST, "maximum": MOST}
    elif finite and bounds.get("above") == 0.0:
        schema |= {"minimum": SMALLEST, "maximum": LARGEST}
    elif finite:
        schema |= {"minimum": -sys.float_info.max, "maximum": sys.float_info.max}
    return schema | {words[name]: bound for name, bound in bounds.items()}


def level_rows(unit: str) -> dict[str, Any]:
    """Metadata of a dataclass field that holds rows of a frequency (Hz) and a level, or a number for all frequencies.

    Between the rows the level is straight in a plot of the logarithms.
    """
    rows = "rows of a frequency in Hz, which rises, and a level, all > 0"

    def take(value: Any) -> Any:
        if not isinstance(value, (tuple, list)) and getattr(value, "ndim", 0) != 2:
            return _number(value, {"at_least": 0.0}, False, True)
        return _rising_rows(value, {"above": 0.0}, "Hz", fewest=2)

    row = {"type": "array", "items": _number_schema({"above": 0.0}, False, True), "minItems": 2, "maxItems": 2}
    table = {"type": "array", "items": row, "minItems": 2}
    return {
        "unit": unit,
        "allowed": f"must be a finite number >= 0 {unit}, or {rows}",
        "take": take,
        "schema": {"anyOf": [_number_schema({"at_least": 0.0}, False, True), table], "x-rows": unit},
    }


def factor_rows(unit: str) -> dict[str, Any]:
    """Metadata of a dataclass field that holds rows of a number in a unit, rising, and a factor; or none."""
    bounds = {"at_least": 0.0}
    number = _number_schema(bounds, False, True)
    row = {
        "type": "array",
        "prefixItems": [{**number, "x-unit": unit}, {**number, "x-unit": "1"}],
        "minItems": 2,
        "maxItems": 2,
    }
    return {
        "unit": "",
        "allowed": f"must be rows of a number in {unit}, which rises, and a factor, all >= 0",
        "take": functools.partial(_rising_rows, bounds=bounds, unit=unit),
        "schema": {"type": "array", "items": row},
    }


def _rising_rows(value: Any, bounds: Mapping[str, float], unit: str, fewest: int = 0) -> tuple[tuple[float, ...], ...]:
    """Pairs of numbers of which the first ones rise."""
    rows = value.tolist() if hasattr(value, "tolist") and getattr(value, "ndim", 0) == 2 else value
    if not isinstance(rows, (tuple, list)) or len(rows) < fewest:
        raise _Refused
    taken: list[tuple[float, ...]] = []
    for row in rows:
        if not isinstance(row, (tuple, list)) or len(row) != 2:
            raise _Refused
        taken.append(tuple(_number(part, bounds, False, True) for part in row))
        if len(taken) > 1 and taken[-1][0] <= taken[-2][0]:
            raise _Refused(f": {taken[-2][0]:g} {unit} is followed by {taken[-1][0]:g} {unit}")
    return tuple(taken)


def choice(*names: str) -> dict[str, Any]:
    """Metadata of a dataclass field that holds one of a few names."""
    allowed = f"must be {' or '.join(repr(name) for name in names)}"
    take = functools.partial(_instance, kinds=(str,), among=names)
    return {"unit": "", "allowed": allowed, "take": take, "schema": {"enum": list(names)}}


def truth(*names: str) -> dict[str, Any]:
    """Metadata of a dataclass field that is True or False, or one of a few names: no number counts as either."""

    def take(value: Any) -> bool | str:
        if isinstance(value, str) and value in names:
            return value
        # a truth value of numpy is one, without numpy being loaded for it
        of_numpy = getattr(getattr(value, "dtype", None), "kind", "") == "b" and value.shape == ()
        if not isinstance(value, bool) and not of_numpy:
            raise _Refused
        return bool(value)

    schema = {"enum": [True, False, *names]} if names else {"type": "boolean"}
    allowed = f"must be True or False{''.join(f', or {name!r}' for name in names)}"
    return {"unit": "", "allowed": allowed, "take": take, "schema": schema}


def text(*, several: bool = False) -> dict[str, Any]:
    """Metadata of a dataclass field that holds a text, or a tuple of them."""
    if several:
        return items(str) | {"allowed": "must be texts", "schema": {"type": "array", "items": {"type": "string"}}}
    take = functools.partial(_instance, kinds=(str,))
    return {"unit": "", "allowed": "must be a text", "take": take, "schema": {"type": "string"}}


def name_text(*, lines: bool = False) -> dict[str, Any]:
    """Metadata of a dataclass field that holds a name, which files and pages of results can hold; or several lines."""
    allowed = f"must be a text without control characters{', but for ends of lines and tabs' if lines else ''}"

    def take(value: Any) -> str:
        named: str = _instance(value, (str,))
        if NO_NAME.search(re.sub("[\t\r\n]", "", named) if lines else named):
            raise _Refused
        return named

    return text() | {"allowed": allowed, "take": take}


def place() -> dict[str, Any]:
    """Metadata of a dataclass field that holds a name of a place, or metres from the root."""
    allowed = 'must be "root", "tip", "mid", a point of the mesh, or metres from the root >= 0'
    schema = {"anyOf": [{"type": "string"}, _number_schema({"at_least": 0.0}, False, True)]}

    def take(value: Any) -> str | float:
        return value if isinstance(value, str) else _number(value, {"at_least": 0.0}, False, True)

    return {"unit": "", "allowed": allowed, "take": take, "schema": schema}


def instance(*kinds: Any) -> dict[str, Any]:
    """Metadata of a dataclass field that holds a value of one of some kinds."""
    names = " or ".join(kind.__name__ for kind in kinds)
    take = functools.partial(_instance, kinds=kinds)
    article = "an" if names[0] in "AEIOU" else "a"
    return {"unit": "", "allowed": f"must be {article} {names}", "take": take, "kinds": kinds}


def having(what: str, names: tuple[str, ...]) -> dict[str, Any]:
    """Metadata of a dataclass field that holds any object with some members, however it comes by them.

    `isinstance` of a protocol does not find those that `__getattr__` gives, from Python 3.12 on.
    """

    def take(value: Any) -> Any:
        if isinstance(value, type) or not all(hasattr(value, name) for name in names):
            raise _Refused
        return value

    return {"unit": "", "allowed": f"must be {what}", "take": take}


def items(*kinds: Any) -> dict[str, Any]:
    """Metadata of a dataclass field that holds a tuple of values of some kinds; a list becomes one."""
    names = " or ".join(kind.__name__ for kind in kinds)

    def take(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, (tuple, list)):
            raise _Refused
        return tuple(_instance(entry, kinds) for entry in value)

    return {"unit": "", "allowed": f"must be a list or a tuple of {names}", "take": take}


def column(unit: str, *axes: str | int, of: str = "number", finite: bool = False) -> dict[str, Any]:
    """Metadata of a dataclass field that holds an array: its unit, and the name or the length of every axis.

    Arrays with an axis of the same name are equally long there. `of` is "number", "complex number",
    "whole number", "text" or "truth value".
    """
    shape = f"({', '.join(map(str, axes))}{',' if len(axes) == 1 else ''})"
    return {
        "unit": unit,
        "allowed": f"must be an array {shape} of {'finite ' if finite else ''}{of}s",
        "take": functools.partial(_array, axes=axes, of=of, finite=finite),
        "axes": axes,
    }


def optional(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """The same metadata for a field that may also be None."""
    take = metadata["take"]
    return {
        **metadata,
        "allowed": f"{metadata['allowed']}, or None",
        "take": lambda value: None if value is None else take(value),
    }


_COMPARISONS = {"above": operator.gt, "at_least": operator.ge, "at_most": operator.le, "below": operator.lt}


OF_FILES = ": a number in SI units, for texts with units are those of study files"


def _number(value: Any, bounds: Mapping[str, float], integer: bool, finite: bool) -> float | int:
    """The value as float or int of Python, whatever kind of number it is."""
    # the usual type first: what a number is takes longer to find out than all the rest
    if type(value) is not float and (isinstance(value, bool) or not isinstance(value, numbers.Real)):
        raise _Refused(OF_FILES if isinstance(value, str) and value[:1].isdigit() else "")
    if getattr(getattr(value, "dtype", None), "kind", "f") not in "iuf":
        # numpy counts a duration among its whole numbers
        raise _Refused
    try:
        number = float(value)
    except Exception:
        # too large, or of a class that is no number although it says so
        raise _Refused from None
    if not math.isfinite(number):
        if finite or integer:
            raise _Refused
        if math.isnan(number):
            return number
    inside = True
    for name, bound in bounds.items():
        inside = inside and _COMPARISONS[name](number, bound)
    if not inside or (integer and (not number.is_integer() or abs(number) > MOST)):
        raise _Refused
    if finite and bounds.get("above") == 0.0 and not SMALLEST <= number <= LARGEST:
        raise _Refused(f", and of {SMALLEST:g} to {LARGEST:g} in size")
    return int(number) if integer else number


def _numbers(value: Any, take: Callable[[Any], float]) -> float | tuple[float, ...]:
    if hasattr(value, "tolist") and getattr(value, "ndim", 0) == 1:
        value = tuple(value)
    if not isinstance(value, (tuple, list)):
        return take(value)
    if not value:
        raise _Refused
    return tuple(take(entry) for entry in value)


def _instance(value: Any, kinds: tuple[Any, ...], among: tuple[str, ...] | None = None) -> Any:
    if not isinstance(value, kinds) or (among is not None and value not in among):
        raise _Refused
    # a text of numpy is one, but of another type
    return str(value) if isinstance(value, str) and type(value) is not str else value


_KINDS = {
    "number": ("f", "iuf", float),
    "complex number": ("c", "iufc", complex),
    "whole number": ("iu", "iu", int),
    "text": ("U", "U", str),
    "truth value": ("b", "b", bool),
}
"""Of an array: its dtypes that stay, those that are turned, and what into."""


def _array(value: Any, axes: tuple[str | int, ...], of: str, finite: bool) -> NDArray[Any]:
    import numpy as np

    _, usable, kind = _KINDS[of]
    array = _unmasked(value)
    fits = array.ndim == len(axes) and all(isinstance(n, str) or n == m for n, m in zip(axes, array.shape, strict=True))
    if array.dtype.kind not in usable or not fits:
        raise _Refused
    if of != "text":
        # of the same type it stays the very same array, also after unpickling, where asarray would make a new one
        array = array if array.dtype == kind else array.astype(kind)
        if finite and not np.isfinite(array).all():
            raise _Refused
    return array


def _unmasked(value: Any) -> NDArray[Any]:
    """A value as an array, whatever it holds; numpy would take what is masked for sound numbers."""
    import numpy as np

    if type(value) is np.ndarray:
        return value
    if _is_endless(value) or _is_masked(value):
        raise _Refused
    if isinstance(value, range) and not -MOST_LAZY <= (value.stop - value.start) // value.step <= MOST_LAZY:
        raise _Refused
    try:
        return np.asarray(value)
    except Exception:
        # rows of several lengths, no memory, or whatever an object of another library raises
        raise _Refused from None


def _is_endless(value: Any) -> bool:
    """True if a list contains itself, lies too deep for an array, or has more entries than memory is taken for."""
    known: dict[int, float] = {}

    def size(rows: Any, above: tuple[int, ...]) -> float:
        """Entries of a list, of one that is there many times counted once and added as often."""
        if id(rows) in above or len(above) == MOST_AXES:
            return math.inf
        if id(rows) not in known:
            inner = [entry for entry in rows if isinstance(entry, (list, tuple))]
            known[id(rows)] = len(rows) + sum(size(entry, (*above, id(rows))) for entry in inner)
        return known[id(rows)]

    return isinstance(value, (list, tuple)) and size(value, ()) > MOST_LAZY


def _is_masked(value: Any) -> bool:
    import numpy as np

    if isinstance(value, (list, tuple)):
        return any(_is_masked(entry) for entry in value if isinstance(entry, (list, tuple, np.ma.MaskedArray)))
    return bool(np.ma.is_masked(value))


def real_array(key: str, value: Any, unit: str, allowed: str, *, finite: bool = True) -> NDArray[np.float64]:
    """A new array of float, of any shape.

    Raises `InputError` if the value holds anything but real numbers, finite ones where they must be: text, truth
    values, nothing, masked entries, rows of several lengths.
    """
    import numpy as np

    if not _is_endless(value) and _is_masked(value):
        require(False, key, "masked entries", unit, f"{allowed}; fill or drop what is masked")
    try:
        numbers = _unmasked(value)
    except _Refused:
        numbers = np.array(None)
    if numbers.dtype.kind not in "iuf" or (finite and not np.isfinite(numbers).all()):
        description = f"array of {numbers.dtype}" if numbers.ndim and numbers.dtype.kind in "iufcbU" else value
        require(False, key, description, unit, allowed)
    return np.array(numbers, dtype=float)


def in_range(value: object, metadata: Mapping[str, Any]) -> bool:
    """True if a value is what a field's metadata allows: a number within its range, one of its names, ..."""
    try:
        metadata["take"](value)
    except _Refused:
        return False
    return True


def checked(key: str, value: object, metadata: Mapping[str, Any]) -> Any:
    """The value in the one type that its metadata allows, as float(5) for 5.

    Raises `InputError` naming the key, the value and what is allowed.
    """
    try:
        return metadata["take"](value)
    except _Refused as refusal:
        raise InputError([Fault(key, value, metadata["unit"], f"{metadata['allowed']}{refusal}")]) from None


@functools.cache
def _declared(kind: Any) -> tuple[tuple[str, Mapping[str, Any], bool], ...]:
    """Name and metadata of the fields of a dataclass that have such, and whether they may be None."""
    of = dataclasses.fields(kind)
    return tuple((field.name, dict(field.metadata), field.default is None) for field in of if "unit" in field.metadata)


def _hint(value: object, key: str, kinds: Any) -> str:
    """Words that point to an attribute of that name which is of the right kind, as of a study."""
    inner = getattr(value, "__dict__", {}).get(key)
    return f": pass its .{key}" if kinds and isinstance(inner, kinds) else ""


def _taken(
    declared: Iterable[tuple[str, Mapping[str, Any], bool]], value_of: Callable[[str], Any]
) -> tuple[dict[str, Any], list[Fault]]:
    """Sound ones of some fields or arguments, each in its one type, and the faults of the others."""
    values: dict[str, Any] = {}
    faults: list[Fault] = []
    sizes: dict[str | int, tuple[int, str]] = {}
    for name, metadata, may_be_none in declared:
        value = value_of(name)
        if value is None and may_be_none:
            continue
        try:
            values[name] = taken = metadata["take"](value)
        except _Refused as refusal:
            hint = _hint(value, name, metadata.get("kinds", ()))
            faults.append(Fault(name, value, metadata["unit"], f"{metadata['allowed']}{refusal}{hint}"))
            continue
        if "axes" not in metadata or taken is None:
            continue
        # arrays are as long along a named axis as the first one that has it
        for axis, size in zip(metadata["axes"], taken.shape, strict=True):
            length, first = sizes.setdefault(axis, (size, name))
            if size != length and isinstance(axis, str):
                faults.append(Fault(name, _Shown(f"{size} {axis}"), "", f"must have {length} {axis}, as {first} has"))
    return values, faults


def check_fields(instance: Any, *more: Fault) -> None:
    """Raise `InputError` naming every field outside its declared range, and more faults where there are any.

    What is sound is turned into its one type: numbers into float or int, lists of numbers into tuples.
    """
    values, faults = _taken(_declared(instance.__class__), functools.partial(getattr, instance))
    if faults or more:
        raise InputError([*faults, *more])
    for name, value in values.items():
        object.__setattr__(instance, name, value)


@functools.cache
def _defaults(kind: Any) -> dict[str, Any]:
    """Values of the fields of a dataclass that may be left out."""
    defaults = {field.name: field.default for field in dataclasses.fields(kind)}
    return {name: value for name, value in defaults.items() if value is not dataclasses.MISSING}


def made(kind: type[R], /, **values: Any) -> R:
    """A frozen dataclass of values that this package computed, which are in their one type and need no check."""
    record = object.__new__(kind)
    vars(record).update(_defaults(cast(Any, kind)) | values)
    return record


def changed(record: R, **values: Any) -> R:
    """A copy of a frozen dataclass with other values that this package computed and need no check."""
    fields = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}  # type: ignore[arg-type]
    return made(type(record), **fields | values)


def with_ranges(words: str | None, declared: Iterable[tuple[str, Mapping[str, Any], bool]]) -> str | None:
    """A docstring with the allowed range of each declared field or argument below its entry."""
    ranges = {name: metadata["allowed"] for name, metadata, _ in declared}

    def entry(match: re.Match[str]) -> str:
        # the first entry of a name is the argument's: one of the values returned may have the same name
        of_entry = {name: ranges.pop(name) for name in match[2].split(", ") if name in ranges}
        if len(set(of_entry.values())) == 1:
            words = next(iter(of_entry.values()))
            return f"{match[0]}{match[1]}    {words[0].upper()}{words[1:]}.\n"
        return match[0] + "".join(f"{match[1]}    `{name}` {allowed}.\n" for name, allowed in of_entry.items())

    return words and re.sub(r"^( *)(\w+(?:, \w+)*)(?: : .*)?\n(?:\1 +\S.*\n)*", entry, words, flags=re.MULTILINE)


class _DocstringWithRanges:
    """Docstring of a dataclass, with the allowed ranges of its fields once it is read: most never are."""

    def __init__(self, words: str | None) -> None:
        self.words = words

    def __get__(self, instance: Any, kind: Any) -> str | None:
        return with_ranges(self.words, _declared(kind))


def show_ranges(kind: Any) -> None:
    """Put the allowed ranges of its fields into the docstring of a dataclass, for `help` and the site."""
    if dataclasses.is_dataclass(kind):
        kind.__doc__ = _DocstringWithRanges(kind.__doc__)  # type: ignore[assignment]


def takes(**metadata: Mapping[str, Any]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator of a function that declares arguments as a dataclass declares its fields.

    Before the function begins, `InputError` names every argument outside its declared range. What is sound comes to
    it in its one type. An argument whose default is None may be None.
    """

    def checking(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)
        declared = [(name, each, signature.parameters[name].default is None) for name, each in metadata.items()]

        @functools.wraps(function)
        def call(*args: P.args, **named: P.kwargs) -> R:
            try:
                bound = signature.bind(*args, **named)
            except TypeError as error:
                names = ", ".join(name for name in signature.parameters if name not in ("self", "cls"))
                about = (function.__doc__ or "").strip().partition("\n")[0]
                # a misspelt name is one that is missing too
                wrong = [name for name in named if name not in signature.parameters]
                why = f"got an unexpected keyword argument {wrong[0]!r}" if wrong else error
                raise TypeError(f"{function.__qualname__}() {why}; its arguments are {names}: {about}") from None
            bound.apply_defaults()
            values, faults = _taken(declared, bound.arguments.__getitem__)
            if faults:
                raise InputError(faults)
            bound.arguments.update(values)
            return function(*bound.args, **bound.kwargs)

        call.__doc__ = with_ranges(function.__doc__, declared)
        return call

    return checking


_silent = ContextVar("_silent", default=False)  # True while a function decorated by `warns` is at work


@contextmanager
def warnings_left_to_caller() -> Iterator[None]:
    """Context in which functions decorated by `warns` are silent: their caller shows the warnings of results itself."""
    token = _silent.set(True)
    try:
        yield
    finally:
        _silent.reset(token)


def warns(function: Callable[P, R]) -> Callable[P, R]:
    """Decorator of a public function: each of the `warnings` of its result is a `ResultWarning` of the call, too.

    Functions that it calls itself are silent, so that a study warns once and not once for each of its cases. Of several
    results that differ in their warnings one is shown.
    """

    @functools.wraps(function)
    def call(*args: P.args, **named: P.kwargs) -> R:
        if _silent.get():
            return function(*args, **named)
        with warnings_left_to_caller():
            result = function(*args, **named)
        parts: tuple[Any, ...] = (result,)
        if isinstance(result, (dict, tuple)):
            parts = tuple(result.values() if isinstance(result, dict) else result)
        texts = list(dict.fromkeys(words for part in parts for words in _warnings_of(part)))
        if len(parts) > 1 and len(texts) > 1:
            texts = [f"{texts[0]}; {len(texts) - 1} more in the warnings of {len(parts)} results"]
        for words in texts:
            warnings.warn(f"{words} (docs/reference/warnings.md)", ResultWarning, stacklevel=2)
        return result

    return call


def _warnings_of(result: Any) -> tuple[str, ...]:
    """Warnings that a result holds: as texts, or as lines of one text among the attributes of a dataset."""
    attributes = getattr(result, "attrs", None)
    if attributes is not None:
        return tuple(str(attributes.get("warnings", "")).splitlines())
    return tuple(getattr(result, "warnings", ()))


def rising_numbers(key: str, values: Any, most: int) -> NDArray[np.int64]:
    """Three or more increasing whole numbers from 1, as a study of convergence goes through them."""
    allowed = f"must be three or more increasing numbers, whole and 1 to {most}"
    numbers = real_array(key, values, "", allowed)
    rising = numbers.ndim == 1 and numbers.size >= 3 and bool((numbers[1:] > numbers[:-1]).all())
    in_bounds = rising and bool((numbers % 1 == 0).all()) and numbers[0] >= 1 and numbers[-1] <= most
    require(in_bounds, key, values, "", allowed)
    return numbers.astype(int)


def require(condition: bool, key: str, value: object, unit: str, allowed: str) -> None:
    """Raise `InputError` for one key unless the condition holds."""
    if not condition:
        raise InputError([Fault(key, value, unit, allowed)])


@contextmanager
def faults_of(key: str) -> Iterator[None]:
    """Context in which faults name another key: that of the argument or the table that a value is made of."""
    try:
        yield
    except InputError as error:
        raise InputError([dataclasses.replace(fault, key=key) for fault in error.faults]) from None


@contextmanager
def faults_under(prefix: str) -> Iterator[None]:
    """Context in which faults have their keys below a table's path."""
    try:
        yield
    except InputError as error:
        raise InputError([fault.under(prefix) for fault in error.faults]) from None


def require_type(value: object, kind: type, key: str) -> None:
    """Raise `InputError` unless the value is of a kind; say so where an attribute of that name is, as of a study."""
    fits = isinstance(value, kind)
    # of a list one is made
    names: dict[type, str] = {tuple: "list or a tuple", Mapping: "dictionary, as {'name': value}"}
    name = names.get(kind, kind.__name__)
    require(fits, key, kind_of(value), "", f"must be a {name}{'' if fits else _hint(value, key, kind)}")


def suggestion(name: str, known: Iterable[str]) -> str:
    """Words that offer the closest known name, and list all of them."""
    import difflib

    def nearness(other: str) -> tuple[float, int]:
        # of two that are as like, the one that begins like it
        equal = [own == its for own, its in zip(name, other, strict=False)]
        return difflib.SequenceMatcher(None, other, name).ratio(), [*equal, False].index(False)

    names = sorted(known)
    close = max(difflib.get_close_matches(name, names), key=nearness, default="")
    hint = f"did you mean {close!r}? " if close else ""
    return f"unknown; {hint}known: {', '.join(names)}" if names else "unknown; none is defined"


def require_path(value: object, key: str, of: str) -> None:
    """Raise `InputError` unless the value can be the path of something, as "a file": text or a path, without null."""
    text = isinstance(value, (str, Path))
    usable = text and "\0" not in str(value) and all(len(part) <= LONGEST_NAME for part in Path(str(value)).parts)
    require(usable, key, value if text else kind_of(value), "", f"must be the path of {of}")


def require_name(name: str, known: Iterable[str], key: str) -> None:
    """Raise `InputError` unless the name is one of the known ones."""
    names = list(known)
    require_type(name, str, key)
    if name not in names:
        # the words take longer than all the rest
        require(False, key, name, "", suggestion(name, names))
