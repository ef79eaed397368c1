"""What can go wrong, and how it is worded: the only home of input-error texts."""

from __future__ import annotations

import dataclasses
import functools
import math
import numbers
from collections.abc import Iterable, Mapping
from typing import Any

__all__ = [
    "DivergenceError",
    "Fault",
    "FemimpactError",
    "InputError",
    "allowed_range",
    "check_fields",
    "choice",
    "field_faults",
    "in_range",
    "make_whole",
    "quantity",
    "require",
    "require_name",
    "require_type",
    "suggestion",
]


class FemimpactError(Exception):
    """Base of every error that femimpact raises on purpose."""


class DivergenceError(FemimpactError):
    """A run whose motion is not finite, or grew past every physical bound."""


@dataclasses.dataclass(frozen=True)
class Fault:
    """One bad input: which key, which value, in which unit, and what is allowed."""

    key: str
    value: object
    unit: str
    allowed: str

    def __str__(self) -> str:
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        value = self.value
        if isinstance(value, numbers.Number) and hasattr(value, "item"):
            # a number of numpy's own would show its type
            value = value.item()
        shown = f" = {value!r}{unit}" if value is not None else ""
        return f"{self.key}{shown}: {self.allowed}"

    def under(self, prefix: str) -> Fault:
        """The same fault with its key below a table's path."""
        return dataclasses.replace(self, key=f"{prefix}.{self.key}" if prefix else self.key)


class InputError(FemimpactError, ValueError):
    """One or more bad inputs, each with key, value, unit and allowed range."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))


def quantity(
    unit: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
    integer: bool = False,
    several: bool = False,
) -> dict[str, Any]:
    """Metadata of a dataclass field that holds a number, or several where it may: its unit and its allowed range."""
    bounds = {"above": above, "at_least": at_least, "at_most": at_most, "below": below}
    given = {k: v for k, v in bounds.items() if v is not None}
    return {"unit": unit, "bounds": given, "integer": integer, "several": several}


def choice(*names: str) -> dict[str, Any]:
    """Metadata of a dataclass field that holds one of a few names."""
    return {"unit": "", "choices": names}


def allowed_range(metadata: Mapping[str, Any]) -> str:
    """Words for the range that a field's metadata allows."""
    if "choices" in metadata:
        return f"must be {' or '.join(repr(name) for name in metadata['choices'])}"
    kind = "a whole number" if metadata["integer"] else "a finite number"
    words = {"above": "> ", "at_least": ">= ", "at_most": "<= ", "below": "< "}
    bounds = " and ".join(f"{words[name]}{bound:g}" for name, bound in metadata["bounds"].items())
    unit = "" if metadata["unit"] in ("", "1") else f" {metadata['unit']}"
    return f"must be {kind}{' ' + bounds + unit if bounds else ', in' + unit if unit else ''}"


def in_range(value: object, metadata: Mapping[str, Any]) -> bool:
    """Whether a value is what a field's metadata allows: a number within its range, or one of its names."""
    if "choices" in metadata:
        return isinstance(value, str) and value in metadata["choices"]
    if metadata["several"] and isinstance(value, (tuple, list)):
        return len(value) > 0 and all(in_range(entry, {**metadata, "several": False}) for entry in value)
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return False
    try:
        number, bounds = float(value), metadata["bounds"]
    except OverflowError:
        return False
    if not math.isfinite(number) or (metadata["integer"] and not number.is_integer()):
        return False
    return bool(
        bounds.get("above", -math.inf) < number < bounds.get("below", math.inf)
        and bounds.get("at_least", -math.inf) <= number <= bounds.get("at_most", math.inf)
    )


@functools.cache
def _declared(kind: Any, integer: bool = False) -> tuple[dataclasses.Field[Any], ...]:
    """Fields of a dataclass with a range of their own, or the whole numbers among them; looked up often."""
    declared = (field for field in dataclasses.fields(kind) if "unit" in field.metadata)
    return tuple(field for field in declared if field.metadata.get("integer") or not integer)


def field_faults(instance: Any) -> list[Fault]:
    """Every field of a dataclass that is outside its declared range."""
    faults = []
    for field in _declared(instance.__class__):
        value = getattr(instance, field.name)
        if value is None and field.default is None:
            continue
        if not in_range(value, field.metadata):
            allowed = allowed_range(field.metadata)
            faults.append(Fault(field.name, value, field.metadata["unit"], allowed))
    return faults


def make_whole(instance: Any) -> None:
    """Turn whole numbers of a sound dataclass into int: 10.0 is one, but no size of an array."""
    for field in _declared(instance.__class__, integer=True):
        value = getattr(instance, field.name)
        if value is not None:
            whole = tuple(map(int, value)) if isinstance(value, tuple) else int(value)
            object.__setattr__(instance, field.name, whole)


def check_fields(instance: Any) -> None:
    """Raise `InputError` naming every field outside its declared range; whole numbers become int."""
    faults = field_faults(instance)
    if faults:
        raise InputError(faults)
    make_whole(instance)


def require(condition: bool, key: str, value: object, unit: str, allowed: str) -> None:
    """Raise `InputError` for one key unless the condition holds."""
    if not condition:
        raise InputError([Fault(key, value, unit, allowed)])


def require_type(value: object, kind: type, key: str) -> None:
    """Raise `InputError` unless the value is of a kind."""
    require(isinstance(value, kind), key, type(value).__name__, "", f"must be a {kind.__name__}")


def suggestion(name: str, known: Iterable[str]) -> str:
    """Words that offer the closest known name, and list all of them."""
    import difflib

    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"unknown; {hint}known: {', '.join(names)}" if names else "unknown; none is defined"


def require_name(name: str, known: Iterable[str], key: str) -> None:
    """Raise `InputError` unless the name is one of the known ones."""
    names = list(known)
    require(name in names, key, name, "", suggestion(name, names))
