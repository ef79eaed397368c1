"""Files of measured signals: columns of text and UFF 58, read with units into a dataset in SI, and written."""

from __future__ import annotations

import csv
import io
import itertools
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femimpact.arrays import Array, even_interval
from femimpact.errors import InputError, InputWarning, checked, instance, optional, quantity, require
from femimpact.excitation.column_names import TIMES, in_si, unit_of
from femimpact.excitation.columns import TextTable, interval_of, is_column, record_text, text_table
from femimpact.excitation.uff import UFF, names_in_uff, read_uff, write_uff
from femimpact.files import atomic_path
from femimpact.units import read_unit

if TYPE_CHECKING:
    import xarray


def read_record(
    path: str | Path,
    *,
    columns: Sequence[int | str] | None = None,
    units: Sequence[str] | None = None,
    sample_rate: float | None = None,
) -> xarray.Dataset:
    """Measured signals over time from a file of columns or a UFF file, in SI units.

    Parameters
    ----------
    path : str or Path
        Rows of numbers as of `RecordedBase.from_csv`, with or without a header, in which a row or brackets may name
        units. A name that ends with .uff, .uf, .ufb or .unv is a UFF file: its datasets 58 and 58b are read. That of a
        PEER file (AT2) has its samples in rows.
    columns : sequence of int or str, optional
        By number from 0 or by name: the time, and the signals; all of the file by default. With `sample_rate` the
        signals alone.
    units : sequence of str, optional
        Of the columns, in their order, in place of those in the file: "s", "mm", "g".
    sample_rate : float, Hz, optional
        Of a file without a column of time.

    Returns
    -------
    xarray.Dataset
        Signals over `time` (s), each with its unit in `attrs["units"]`: in SI where the unit is known. The texts in
        `attrs["notes"]` say what was taken for what.

    Examples
    --------
    >>> import femimpact as fi
    >>> record = fi.read_record("ring-down.csv")  # doctest: +SKIP
    >>> fi.identify_decay(record["time"], record["tip"])  # doctest: +SKIP
    """
    checked("path", path, instance(str, Path))
    rate = checked("sample_rate", sample_rate, optional(quantity("Hz", above=0.0)))
    if columns is not None:
        sound = isinstance(columns, (list, tuple)) and len(columns) > 0 and all(map(is_column, columns))
        require(sound, "columns", columns, "", "must be numbers from 0 or names of the header")
    if units is not None:
        sound = isinstance(units, (list, tuple)) and len(units) > 0 and all(isinstance(unit, str) for unit in units)
        require(sound, "units", units, "", 'must be texts, one for each column, as ("s", "mm")')
    return _reader(path)(path, columns, units, rate, lambda names: range(len(names)))


Pick = Callable[[list[str]], Sequence[int]]
"""Which signals are read, of their names."""


def _reader(path: str | Path) -> Callable[..., xarray.Dataset]:
    return _read_uff if Path(path).suffix.lower() in UFF else _read_text


def _read_text(
    path: str | Path, columns: Sequence[int | str] | None, units: Sequence[str] | None, rate: float | None, pick: Pick
) -> xarray.Dataset:
    """Columns of a text; where none are given, some of the signals."""
    table, file = text_table(record_text(path), path), Path(path)
    if columns is None:
        places, notes = _places(table, rate, pick)
    else:
        places, notes = [table.place(column) for column in columns], list[str]()
    needed = ("a signal", "") if rate is not None else ("time and a signal", "; or give sample_rate")
    left = "".join(f"; {name!r} has numbers in few of its rows, or in none" for name in table.left)
    allowed = f"{file.name}: must be {needed[0]} or more{needed[1]}{left}"
    require(len(places) >= 1 + (rate is None), "columns", [table.name(p) for p in places], "", allowed)
    commas = rate is not None and not table.names and table.has_decimal_commas
    require(not commas, "path", str(path), "", "has commas between digits alone: decimal ones? put semicolons between")
    values = table.read(places)
    names, stated = _given_units(units, [table.name(p) for p in places], [table.units.get(p, "") for p in places])
    if rate is None:
        unit, factor, _ = in_si(names[0], stated[0], ("s",))
        require(unit in ("", "s"), "units", unit, "", f"{file.name}: {names[0]!r} must be a time, in a unit of s")
        seconds = factor * values[0]
        interval = table.interval(seconds)
        # a unit of all times says nothing of a column without a name
        unsure = not unit or names[0] == f"column {places[0]}"
        counts = ", and it counts by 1: are these samples?" * (unsure and interval == factor)
        notes.insert(0, f"{names[0]!r} is the time, in {stated[0] or 's: no unit is there'}{counts}")
        names, stated, values = names[1:], stated[1:], values[1:]
    else:
        seconds = np.arange(values[0].size) / rate
        notes.insert(0, f"no column of time: {rate:g} samples in a second")
    require(len({*names}) == len(names), "columns", names, "", f"{file.name}: must have different names: give numbers")
    return _dataset(seconds, zip(names, values, stated, strict=True), notes, path)


def _places(table: TextTable, rate: float | None, pick: Pick) -> tuple[list[int], list[str]]:
    """Places of time and signals, and notes on the columns that are left out."""
    of_time = [p for p in table.places if unit_of(table.units.get(p, ""), ("s",))]
    named = [p for p in table.places if TIMES.fullmatch(table.names.get(p, ""))]
    time = (of_time or named)[:1]
    first = table.places[0]
    counts = f"must have a column of time: {table.name(first)!r} counts samples; give sample_rate"
    require(bool(time) or rate is not None or first not in table.counted, "path", str(table.path), "", counts)
    time = time or [first][rate is not None :]
    counted = table.counted
    # "T [°C]" beside a time is a temperature
    further = {*of_time, *(p for p in named if not table.units.get(p))} - {*time, *counted}
    left_out = {*time, *counted, *further}
    signals = [p for p in table.places if p not in left_out]
    notes = [f"{table.name(p)!r} is left out: it counts samples" for p in counted]
    notes += [f"column {p}, {table.name(p)!r}, is left out: a further time" for p in sorted(further)]
    notes += [f"{name!r} is left out: few of its rows have numbers, or none" for name in table.left]
    if rate is not None and time:
        notes.append(f"the column of time {table.name(time[0])!r} is not used: the sample rate is given")
        time = []
    return [*time, *(signals[i] for i in pick([table.name(p) for p in signals]))], notes


def columns_in(text: str) -> list[tuple[str, str]]:
    """Names and units of the signals that `read_record` finds in a text of columns; none where it finds no record."""
    try:
        table = text_table(text, "text")
        places, _ = _places(table, None, lambda names: range(len(names)))
    except InputError:
        return []
    return [(table.names.get(p, ""), table.units.get(p, "")) for p in places[1:]]


def _given_units(units: Sequence[str] | None, names: list[str], stated: list[str]) -> tuple[list[str], list[str]]:
    """Names of columns and their units: those given, with a warning where they contradict those of the file."""
    if units is None:
        return names, stated
    require(len(units) == len(names), "units", list(units), "", f"must be one for each of the columns {names}")
    for name, unit, other in zip(names, units, stated, strict=True):
        if other and unit_of(unit) != unit_of(other):
            warnings.warn(
                f"units of {name!r}: {unit!r} is given, and the file has {other!r}", InputWarning, stacklevel=4
            )
    return names, list(units)


def _dataset(
    time: Array,  # s
    signals: Iterable[tuple[str, Array, str]],  # name, values and unit as it is written
    notes: Sequence[str],
    path: str | Path,
) -> xarray.Dataset:
    """Signals in SI, with notes on what was taken for what."""
    import xarray

    in_units, all_notes = dict[str, tuple[str, Array, dict[str, str]]](), [*notes]
    for name, values, unit in signals:
        si, factor, note = in_si(name, unit)
        in_units[name] = ("time", factor * values, {"units": si})
        all_notes.append(note)
    allowed = f"{Path(path).name}: must be signals, and none of the name of the time"
    require("time" not in in_units, "columns", list(in_units), "", allowed)
    coords = {"time": ("time", time, {"units": "s"})}
    return xarray.Dataset(in_units, coords, {"source": Path(path).name, "notes": tuple(all_notes)})


def one_signal(
    path: Path,
    column: str | None,  # name of the signal; the only one by default
    units: Sequence[str] | None,  # of time and signal
    sample_rate: float | None,  # Hz
) -> xarray.Dataset:
    """The record of one signal of a file.

    Raises `InputError` as of `read_record`, or if there are several and none is named.
    """

    def pick(names: list[str]) -> list[int]:
        require(column is not None or len(names) == 1, "column", None, "", f"must name one of the signals: {names}")
        require(column is None or column in names, "column", column, "", f"must be one of the signals: {names}")
        return [0 if column is None else names.index(column)]

    reader = _reader(path)
    alone = sample_rate is not None or reader is _read_uff
    return reader(path, None, units[-1:] if units and alone else units, sample_rate, pick)


def _read_uff(
    path: str | Path, columns: Sequence[int | str] | None, units: Sequence[str] | None, rate: float | None, pick: Pick
) -> xarray.Dataset:
    """Datasets 58 of a UFF file, of one number of samples and one interval."""
    require(rate is None, "sample_rate", rate, "Hz", "must not be given with a UFF file, which has its own")
    sets = read_uff(path)
    names = _different([signal.name for signal in sets])
    chosen = pick(names)
    if columns is not None:
        missing = [c for c in columns if (c not in names if isinstance(c, str) else c >= len(sets))]
        require(not missing, "columns", missing, "", f"must be among {names}, or their numbers from 0")
        chosen = [names.index(c) if isinstance(c, str) else c for c in columns]
    sets, names = [sets[i] for i in chosen], [names[i] for i in chosen]
    names, stated = _given_units(units, names, [signal.unit for signal in sets])
    times = []
    for name, signal in zip(names, sets, strict=True):
        of_time, factor, _ = in_si("time", signal.unit_of_time, ("s",))
        allowed = f"the time of {name!r} is in {of_time!r}: must be in a unit of s"
        require(of_time in ("", "s"), "path", str(path), "", allowed)
        times.append(signal.time * factor)
    notes = [f"the time is in {sets[-1].unit_of_time or 's: no unit is there'}"]
    same = all(x.shape == times[0].shape and np.allclose(x, times[0], rtol=1e-9, atol=0.0) for x in times)
    require(same, "columns", names, "", "must be datasets over the same times: choose some by columns")
    interval_of(times[0], Path(path), lambda row: f"sample {row + 1}")
    return _dataset(times[0], zip(names, (signal.values for signal in sets), stated, strict=True), notes, path)


def _different(names: Sequence[str]) -> list[str]:
    """Names, none of them twice."""
    different = dict[str, None]()
    for i, name in enumerate(names, 1):
        while name in different:
            name = f"{name} {i}"
        different[name] = None
    return list(different)


def write_record(path: str | Path, dataset: xarray.Dataset) -> Path:
    """Write signals over time as a file of columns with a row of units, or as UFF 58 where the name ends with .uff.

    Parameters
    ----------
    path : str or Path
    dataset : xarray.Dataset
        Of signals over one axis, `time` (timedelta64, or numbers in s or the unit that it names), as of `read_record`.
        UFF 58 keeps 6 digits of the interval and 12 of a sample.

    Raises
    ------
    InputError
        If the dataset has no signal over `time`, holds what is no finite number, its times are no times from a
        beginning or not evenly spaced, it has a name or a unit that would be read back as another, or no file can be
        there.
    """
    file = Path(checked("path", path, instance(str, Path)))
    sound = hasattr(dataset, "data_vars") and "time" in dataset.coords and len(dataset.data_vars) > 0
    sound = sound and all(array.dims == ("time",) and array.dtype.kind in "iuf" for array in dataset.data_vars.values())
    require(sound, "dataset", type(dataset).__name__, "", "must be an xarray.Dataset of numbers over the axis time")
    time = _seconds(dataset["time"])
    signals = []
    for key, array in dataset.data_vars.items():
        # without the ends of lines
        name, unit = (" ".join(str(word).split()) for word in (key, array.attrs.get("units", "")))
        signals.append((name, unit, np.asarray(array, dtype=float)))
    for name, values in (("time", time), *((name, values) for name, _, values in signals)):
        require(bool(np.isfinite(values).all()), "dataset", name, "", "must hold finite numbers")
    require(time.size >= 2, "dataset", time.size, "samples", "must have 2 or more")
    step, bad = even_interval(time)
    require(bad < 0, "dataset", time[max(bad, 0)], "s", "must have evenly spaced times that rise: this one is off")
    is_uff = file.suffix.lower() in UFF
    text = "" if is_uff else _header(signals)
    two_rows = "".join(f"{k}{',0' * len(signals)}\n" for k in (0, 1))
    read_back = names_in_uff(signals) if is_uff else columns_in(text + two_rows)
    for (name, unit, _), other in itertools.zip_longest(signals, read_back, fillvalue=("", "", None)):
        back = f"as {other[0]!r}{f' in {other[1]}' if other[1] else ''}" if other[0] else "as no signal"
        same = bool(name) and (name, unit) == tuple(other[:2])
        require(same, "dataset", name, unit, f"would be read back {back}: choose another name or unit")
    with atomic_path(file) as unfinished:
        if is_uff:
            write_uff(unfinished, float(time[0]), step, signals)
        else:
            table = np.column_stack([time, *(values for _, _, values in signals)])
            np.savetxt(unfinished, table, fmt="%.17g", delimiter=",", header=text[:-1], comments="", encoding="utf-8")
    return file


def _seconds(time: xarray.DataArray) -> Array:
    """Times in s, from timedelta64 or from numbers in a unit that they name."""
    kind, unit = time.dtype.kind, str(time.attrs.get("units") or "s")
    if kind == "m":
        return np.asarray(time.to_numpy() / np.timedelta64(1, "s"))
    kinds = "must be numbers or timedelta64, from a beginning on: subtract the first time"
    require(kind in "iuf", "dataset", f"time of {time.dtype}", "", kinds)
    known = read_unit(unit, ("s",))
    require(known is not None, "dataset", unit, "", "must have its time in a unit of s")
    return np.asarray(time, dtype=float) * (known[1] if known else 1.0)


def _header(signals: Sequence[tuple[str, str, Array]]) -> str:
    """Rows of names and of units."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["time", *(name for name, _, _ in signals)])
    rows.writerow(["s", *(unit or "-" for _, unit, _ in signals)])
    return text.getvalue()
