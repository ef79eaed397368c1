"""What was identified from a record, as files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femimpact.errors import require
from femimpact.files import atomic_path
from femimpact.signals.decay import DecayEstimate

if TYPE_CHECKING:
    import xarray


IDENTIFIED = ("identify.json", "identify.png")
"""Files of `write_decay`."""


def write_decay(
    directory: Path,
    found: DecayEstimate,
    record: xarray.Dataset,  # which it is of
    force: bool,  # whether files of the same names are replaced
) -> None:
    """Write what was identified from a record as JSON and as a figure."""
    from femimpact import figures

    there = ", ".join(name for name in IDENTIFIED if (directory / name).exists())
    require(force or not there, "output", str(directory), "", f"has {there} already: choose another, or --force")
    require(not directory.exists() or directory.is_dir(), "output", str(directory), "", "must be a directory")
    directory.mkdir(parents=True, exist_ok=True)
    columns, units = found.columns()
    content = {
        "source": record.attrs.get("source", ""), "signal": str(next(iter(record.data_vars))),
        "level": found.level, "modes": [vars(mode) for mode in found.modes], "noise": found.noise,
        "over_amplitude": {name: values.tolist() for name, values in columns.items()},
        "units": {**units, "noise": found.unit},
        "warnings": found.warnings, "notes": [*record.attrs.get("notes", ()), *found.notes],
    }  # fmt: skip
    text = json.dumps(_finite(content), indent=2, ensure_ascii=False) + "\n"
    # both or none: one alone would be in the way of the next run
    with atomic_path(directory / IDENTIFIED[0]) as table, atomic_path(directory / IDENTIFIED[1]) as picture:
        table.write_text(text, encoding="utf-8")
        figures.save_figure(figures.decay(found, ax=figures.OffScreen()), picture)


def _finite(value: Any) -> Any:
    """The value with None where a number is not finite, which JSON has no word for."""
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
