"""What drives a run, in words with its numbers and their units."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from femimpact.excitation.chirp import Chirp
from femimpact.excitation.excitation import is_force, words_of
from femimpact.units import typeset_number, unit_text


def drive_words(excitation: Any) -> list[str]:
    """A line for each drive: its name, what it is, and its numbers with units."""
    lines = []
    drives = getattr(excitation, "drives", (excitation,))
    for name, drive in zip(getattr(excitation, "names", ("",)), drives, strict=True):
        numbers = ", ".join(_numbers(getattr(drive, "history", drive), "N" if is_force(drive) else "m/s^2"))
        lines.append(f"{f'{name}, ' * (name not in ('', 'base'))}{words_of(drive)}{'; ' * bool(numbers)}{numbers}")
    return lines


def _numbers(history: Any, unit: str) -> Iterator[str]:
    """Numbers of a drive by their names, with units, where they are not those that it has by default."""
    for part in getattr(history, "parts", ()):
        yield from _numbers(part, unit)
    for item in dataclasses.fields(history) if dataclasses.is_dataclass(history) else ():
        value, name = getattr(history, item.name), item.name.replace("_", " ")
        if item.name in ("by", "at", "name", "parts", "end") or value is None or value is item.default:
            continue
        own = item.metadata.get("unit") or ""
        if name in ("level", "amplitude"):
            own = unit if unit == "N" else "m" if "amplitude" in (name, getattr(history, "by", "")) else "m/s^2"
        if isinstance(value, (str, bool)):
            yield name if isinstance(value, bool) else value
        elif isinstance(value, (int, float)):
            if value != item.default:
                yield f"{name} {unit_text(value, own)}"
        elif name == "level":
            yield (
                f"level {unit_text(value[0][1], own)} at {value[0][0]:g} Hz to {unit_text(value[-1][1], own)} at "
                f"{value[-1][0]:g} Hz in {len(value)} rows"
            )
        elif name in ("psd", "frequencies"):
            f = np.ravel([row[0] if name == "psd" else row for row in value])
            yield f"{f.min():g} to {f.max():g} Hz" + (f" in {f.size} steps" if name == "frequencies" else "")
        else:
            yield f"{np.size(value)} {name}"
    if isinstance(history, Chirp) and history.kind == "logarithmic":
        yield f"{typeset_number(60.0 * abs(math.log2(history.stop / history.start)) / history.duration)} oct/min"
    elif isinstance(history, Chirp):
        yield f"{typeset_number(abs(history.stop - history.start) / history.duration)} Hz/s"
