"""The labelled dataset of a study, with statistics over the starts of its cases, and its blocks on disk.

DIR/blocks holds `study.json`, the manifest: the key of the study and the code, the study in plain data, the labels of
its dataset and a checksum. Beside it is one file for each finished block, named by the key and its first case: a line
with the checksum of its name and the rest, then arrays as numpy writes them. Each file is written under a temporary
name, synced and renamed. A damaged file is reported and counts as missing: its block is run again.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from femimpact import __version__, core
from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.runs import BlockValues
from femimpact.app.results.result_directory import (
    FILES,
    REPORT,
    STUDY_BLOCKS,
    STUDY_FIGURE,
    STUDY_MANIFEST,
    result_files,
)
from femimpact.app.study.findings import place_words
from femimpact.app.study.study import Study
from femimpact.app.study.study_file import study_text
from femimpact.arrays import Array, Integers
from femimpact.errors import Fault, InputError, require
from femimpact.excitation.drives import drive_words, named_parts
from femimpact.excitation.harmonic import SteppedSine
from femimpact.figures.study_labels import PAIRED, STATISTICS, path_words
from femimpact.files import atomic_write, to_disk
from femimpact.integrators.planned_drive import PreflightRow, contact_notes, step_rows
from femimpact.response.cycles import deflection_warnings
from femimpact.structure.structure import gaps_with
from femimpact.system.system import System, without_impactors
from femimpact.units import unit_text

if TYPE_CHECKING:
    import xarray


LEAST_FOR_INTERVAL = 5
"""Starts from which the median has an interval."""

LEAST_FOR_QUANTILES = 40
"""Starts from which quantiles of 5 and 95 % are given."""

CONFIDENCE = 0.9
"""Least confidence of the interval of the median."""

APART = 0.1
"""Share of the median that the widest distance between neighbours must exceed for two groups."""

BESIDE = 2
"""Starts on each side of it at least."""


def median_ranks(
    starts: int,  # at least `LEAST_FOR_INTERVAL`
) -> tuple[int, int]:
    """Numbers from 0 of the sorted values between which the median lies with a probability of at least 90 %.

    The interval from the k-th smallest to the k-th largest of n values holds the median with the probability
    1 - 2 P(B < k), B binomial of n and 1/2; k is the largest for which that is at least 0.9. (David and Nagaraja,
    2003.)
    """
    from scipy.stats import binom

    k = 1
    while 1.0 - 2.0 * float(binom.cdf(k, starts, 0.5)) >= CONFIDENCE:
        k += 1
    return k - 1, starts - k


def endings_of(starts: int) -> tuple[str, ...]:
    """Ends of the names of the variables of a measure of numbers, the median first."""
    if starts == 1:
        return ("",)
    least = {"_median": LEAST_FOR_INTERVAL, "_quantile": LEAST_FOR_QUANTILES}
    return "", *(end for end in STATISTICS if starts >= least.get(end.rpartition("_")[0], 2))


def over_starts(
    values: Array,  # (cases, starts)
) -> dict[str, Array]:
    """Columns (cases,) by the end of their names, from values (cases, starts); "" is the median.

    What is not a number is left out; a case without numbers has none.

    Returns (cases,): `_low` and `_high` the extremes; `_median_low` and `_median_high` the 90 % interval of the median
    from 5 starts on; `_quantile_5` and `_quantile_95` from 40 on; `_groups` 1, or 2 where the sorted values lie in two
    groups.
    """
    cases, starts = values.shape
    if starts == 1:
        return {"": values[:, 0]}
    ordered = np.sort(values, axis=1)
    count = np.count_nonzero(~np.isnan(ordered), axis=1)
    found = {name: np.full(cases, np.nan) for name in endings_of(starts)}
    # cases of which as many starts have values are done together
    for n in np.unique(count[count > 0]).tolist():
        rows = count == n
        for name, column in _of_sorted(ordered[rows, :n]).items():
            if name in found:
                found[name][rows] = column
    return found


def _of_sorted(values: Array) -> dict[str, Array]:
    n = values.shape[1]
    middle = 0.5 * (values[:, (n - 1) // 2] + values[:, n // 2])
    found = {"": middle, "_low": values[:, 0], "_high": values[:, -1], "_groups": _groups(values, middle)}
    if n >= LEAST_FOR_INTERVAL:
        low, high = median_ranks(n)
        found |= {"_median_low": values[:, low], "_median_high": values[:, high]}
    if n >= LEAST_FOR_QUANTILES:
        for name, share in (("_quantile_5", 0.05), ("_quantile_95", 0.95)):
            place = share * (n - 1)
            below = int(place)
            found[name] = values[:, below] + (place - below) * (values[:, min(below + 1, n - 1)] - values[:, below])
    return found


def _groups(values: Array, middle: Array) -> Array:
    """1, or 2 where the widest distance between sorted values exceeds 10 % of the median, two starts on each side."""
    if values.shape[1] < 2 * BESIDE:
        return np.ones(len(values))
    distance = np.diff(values, axis=1)
    # of several that are widest one with two starts on each side is enough, whichever comes first
    widest = distance[:, BESIDE - 1 : 1 - BESIDE].max(axis=1)
    return np.where((widest >= distance.max(axis=1)) & (widest > APART * np.abs(middle)), 2.0, 1.0)


def labels_of(study: ParameterStudy) -> dict[str, Any]:
    """Labels of the dataset of a study, in types of JSON."""
    table = study.table
    rows = *_dwell_rows(study), *axis_rows(study)
    warnings = [*(str(row) for row in rows if row.passed), *contact_notes(study.nominal)]
    warnings += level_remarks(study)
    return {
        "dims": [place.path for place in table.places] if table.is_grid else ["case"],
        "shape": list(table.shape),
        "coordinates": {
            name: coordinate for axis in range(len(table.places)) for name, coordinate in _axis(study, axis)
        },
        "variables": dict(_variables(study)),
        "texts": ["failure", *(item.name for item in study.chosen if item.is_text)],
        "measures": [item.name for item in study.chosen],
        "attributes": {
            "title": "femimpact parameter study",
            "femimpact": __version__,
            "core": str(core.build_info()["sources"]),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "python": ".".join(map(str, sys.version_info[:3])),
            "starts": study.starts,
            "seed": study.seed,
            **({"cycles": study.dwell, "measured_cycles": study.dwell // 3} if study.has_cycle else {}),
            "drive": _drive(study),
            "place": str(study.observed),
            "contact_laws": ", ".join(f"{pair.name}: {pair.law.name}" for pair in study.nominal.contacts),
            "beam_length": study.nominal.length,
            "warnings": "\n".join(warnings),
            **_description(study),
        },
    }


def _axis(study: ParameterStudy, axis: int) -> Iterator[tuple[str, list[Any]]]:
    """The coordinate of an axis: dimensions, values, attributes. Of pairs of gaps their numbers, with the gaps."""
    table, place = study.table, study.table.places[axis]
    dims, levels = [place.path if table.is_grid else "case"], table.levels[axis]
    values = list(levels) if table.is_grid else [levels[code] for code in table.codes[axis].tolist()]
    words = path_words(place.path)
    distribution = str(study.distributions.get(place.path, ""))
    attributes = {"units": place.unit, "distribution": distribution}
    described = {"long_name": words} | {name: text for name, text in attributes.items() if text}
    if not any(isinstance(value, tuple) for value in values):
        yield place.path, [dims, values, described]
        return
    yield place.path, [dims, list(range(len(values))), {"long_name": f"{words}{PAIRED}"}]
    # of a number a side that is open stays so
    own = next((pair.gaps for pair in study.nominal.contacts if pair.name == place.part), (0.0, 0.0))
    for i, side in enumerate(("plus", "minus")):
        gaps = [gaps_with(own, value)[i] for value in values]
        yield f"{place.path}.{side}", [dims, gaps, described | {"long_name": f"{words}, to the {side} side"}]


def _variables(study: ParameterStudy) -> Iterator[tuple[str, dict[str, str]]]:
    """Variables with their attributes: measures with their statistics over the starts, and what is about the cases."""
    for item in study.chosen:
        observed = item.long_name.replace("the observed place", place_words(str(study.observed)))
        for end in endings_of(study.starts):
            # of words only how many there are
            if item.is_text and end not in ("", "_groups"):
                continue
            of_starts = STATISTICS.get(end, "of most starts" if item.is_text else "median over the starts")
            unit = "1" if end == "_groups" else item.unit
            words = f"{observed}, {of_starts}" if study.starts > 1 else observed
            better = {} if end or not item.better else {"better": item.better}
            yield f"{item.name}{end}", {"long_name": words} | ({"units": unit} if unit else {}) | better
    yield "periodic_starts", {"long_name": "starts from which the motion repeats, or has no impacts", "units": "1"}
    yield "failed_starts", {"long_name": "starts that have no values", "units": "1"}
    yield "failure", {"long_name": "why the first of them has none"}
    yield "finished", {"long_name": "whether the case has been run", "units": "1"}


def _drive(study: ParameterStudy) -> str:
    """What drives every case, with the numbers that no axis gives."""
    if isinstance(study.study, Study) and not study.has_cycle:
        axes = [place.path for place in study.places if place.owner in ("base", "force")]
        of_axes = [f"but {path_words(path)} as its axis has it" for path in axes]
        return "; ".join([", with ".join(drive_words(study.study.excitation)), *of_axes])
    varied = {place.field for place in study.places if place.owner == "base"}
    units = {"amplitude": "m", "acceleration": "m/s^2", "frequency": "Hz"}
    fixed = [
        f"{name} {unit_text(study.base[name], unit)}"
        for name, unit in units.items()
        if name not in varied and study.base.get(name) is not None
    ]
    of_axes = [f"{name} as its axis has it" for name in units if name in varied]
    return ", ".join(["a sine of the base", *fixed, *of_axes])


def level_remarks(study: ParameterStudy) -> list[str]:
    """That cases do not have the acceleration of [sweep], where it has one and no axis is the level."""
    plan: Any = getattr(study.study, "sweep", None)
    levels = {"base.amplitude", "base.acceleration"}
    if plan is None or plan.acceleration is None or any(place.path in levels for place in study.table.places):
        return []
    return ["the acceleration of [sweep] is not that of the cases, which have the level of [base]"]


def axis_rows(study: ParameterStudy) -> Iterator[PreflightRow]:
    """The step of each axis of frequencies, of the base, of a part of a sum or of a force; a sample has no step."""
    for place, levels in zip(study.table.places, study.table.levels, strict=True):
        if place.field == "frequency" and place.owner in ("base", "force") and study.plan_of_sample is None:
            yield from step_rows(without_impactors(study.nominal), np.unique(levels), f" of the axis {place.path}")


def _dwell_rows(study: ParameterStudy) -> Iterator[PreflightRow]:
    """The step of each stepped sine of a study file, over all of which a case has one value."""
    for which, _, part in named_parts(study.study.excitation) if isinstance(study.study, Study) else ():
        if isinstance(part, SteppedSine):
            yield from step_rows(without_impactors(study.nominal), part.steps, f" of {which}" * bool(which))


def _description(study: ParameterStudy) -> dict[str, str]:
    """Attributes that describe the study: its file, or system or function with base and method; and the sample."""
    given, plan = study.study, study.plan_of_sample
    sample = {} if plan is None else {"sample": f"{plan.points} points, {plan.method}, seed {plan.seed}"}
    if isinstance(given, Study):
        return {**sample, "study": study_text(given), "study_file": given.path.name}
    known = ", ".join(f"{name} {value}" for name, value in study.base.items() if value is not None)
    method = study.method or study.systems.method_of(study.nominal, {})
    # what is no dataclass may show its address, which no two processes share
    words = repr(method) if is_dataclass(method) else type(method).__name__
    name = f"System of {given.dofs} dofs" if isinstance(given, System) else getattr(given, "__qualname__", "function")
    return {**sample, "study": name, "base": f"sine, {known}", "method": words}


COUNTS = {"periodic_starts": np.int32, "failed_starts": np.int32, "finished": np.int8}
"""Types of the variables that count."""


class Columns:
    """Variables of all cases, filled block by block.

    Parameters
    ----------
    labels : mapping
        Of `labels_of`.
    """

    def __init__(self, labels: Mapping[str, Any]) -> None:
        self.labels = labels
        self.cases = int(np.prod(labels["shape"]))
        self.starts = int(labels["attributes"]["starts"])
        self.values: dict[str, NDArray[Any]] = {
            name: np.zeros(self.cases, dtype=COUNTS[name]) if name in COUNTS
            else np.full(self.cases, "", dtype=object) if name in labels["texts"]
            else np.full(self.cases, np.nan)
            for name in labels["variables"]
        }  # fmt: skip

    @property
    def done(self) -> NDArray[np.bool_]:
        """Whether there are values of a case."""
        return self.values["finished"] > 0

    @property
    def finished(self) -> int:
        """Cases of which there are values."""
        return int(np.count_nonzero(self.done))

    def add(self, block: BlockValues) -> None:
        """Enter the cases of a block."""
        cases, starts, values = block.cases, self.starts, self.values
        values["finished"][cases] = 1
        values["periodic_starts"][cases] = block.periodic.sum(axis=1)
        reasons = np.array(block.failures, dtype=object).reshape(-1, starts)
        values["failed_starts"][cases] = (reasons != "").sum(axis=1)
        values["failure"][cases] = [next(filter(None, row), "") for row in reasons.tolist()]
        for m, name in enumerate(self.labels["measures"]):
            if name in block.words:
                self._add_words(name, cases, block.words[name])
                continue
            for end, column in over_starts(block.values[:, :, m]).items():
                values[f"{name}{end}"][cases] = column

    def _add_words(self, name: str, cases: Integers, words: Sequence[str]) -> None:
        """The most frequent word of the starts, of several the first by its letters; and how many there are."""
        for row, case in enumerate(cases.tolist()):
            counts = Counter(word for word in words[row * self.starts : (row + 1) * self.starts] if word)
            self.values[name][case] = min(counts, key=lambda word: (-counts[word], word)) if counts else ""
            if self.starts > 1:
                self.values[f"{name}_groups"][case] = len(counts)


def dataset_of(
    columns: Columns,  # cases without values are not-a-numbers
) -> xarray.Dataset:  # xarray.Dataset
    """The labelled dataset: axes as coordinates, measures with their statistics over the starts as variables."""
    import xarray

    labels, values = columns.labels, columns.values
    dims, shape = labels["dims"], labels["shape"]
    coordinates: dict[str, Any] = {"case": ("case", np.arange(columns.cases))} if dims == ["case"] else {}
    for name, (along, levels, attributes) in labels["coordinates"].items():
        is_text = all(isinstance(level, str) for level in levels)
        coordinates[name] = along, np.array(levels, dtype=object if is_text else None), attributes
    variables = {name: (dims, values[name].reshape(shape), about) for name, about in labels["variables"].items()}
    attributes = dict(labels["attributes"])
    peaks = [values[name] for name in ("peak", "peak_high") if name in values]
    length = attributes.pop("beam_length", 0.0)
    bends = deflection_warnings(np.concatenate(peaks), length) if peaks else ()
    warnings = "\n".join(filter(None, (attributes.pop("warnings", ""), *bends)))
    attributes |= {"warnings": warnings} if warnings else {}
    if columns.starts >= LEAST_FOR_INTERVAL:
        attributes["median_interval"] = "90 %, by order statistics"
    return xarray.Dataset(variables, coords=coordinates, attrs=attributes)


BLOCKS, MANIFEST = STUDY_BLOCKS, STUDY_MANIFEST
REWRITTEN = frozenset(
    {REPORT, *(FILES[key].name for key in ("study", "parameter_study", "parameter_table", "best_study", "base_record"))}
)
"""Files beside the blocks that every call writes anew."""

NAME = re.compile(r"([0-9a-f]{16})-\d+\.block")
UNFINISHED = re.compile(r"\.(study(_[\w-]+)?|report|[0-9a-f]{16}-\d+)-\w{8}\.\w+")
"""Names of temporary files of a study."""


OTHER_CONTENT = "its checksum is that of another content"


class DamagedFileError(Exception):
    """A file does not hold what a study has written; the message says why."""


# ---- blocks ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class BlockFolder:
    """The finished blocks of one study."""

    folder: Path
    key: str  # of the study and the code
    damaged: Callable[[str, str], None]  # called with the name of each damaged file and the reason

    def blocks(self) -> Iterator[BlockValues]:
        """All blocks on disk."""
        for name in _names(self.folder):
            if keys_of([name]) == {self.key[:16]}:
                try:
                    yield self._read(name)
                except FileNotFoundError:
                    continue
                except DamagedFileError as error:
                    self.damaged(name, str(error))

    def _read(self, name: str) -> BlockValues:
        digest, _, payload = _bytes_of(self.folder / name).partition(b"\n")
        if digest != self._checksum_of(name, payload):
            raise DamagedFileError(OTHER_CONTENT)
        with np.load(io.BytesIO(payload)) as arrays:
            failures, words = json.loads(arrays["texts"].tobytes())
            return BlockValues(arrays["cases"], arrays["values"], arrays["periodic"], failures, words)

    def write(self, block: BlockValues) -> None:
        """Write a block to disk."""
        name, payload = f"{self.key[:16]}-{int(block.cases[0]):08d}.block", io.BytesIO()
        text = np.frombuffer(json.dumps([block.failures, block.words]).encode(), dtype=np.uint8)
        np.savez(payload, cases=block.cases, values=block.values, periodic=block.periodic, texts=text)
        content = payload.getvalue()
        atomic_write(self.folder / name, self._checksum_of(name, content) + b"\n" + content)
        to_disk(self.folder)

    def remove_unfinished(self) -> None:
        """Remove the temporary files of a process that was ended while it wrote."""
        for folder in (self.folder, self.folder.parent):
            for path in folder.iterdir():
                if UNFINISHED.fullmatch(path.name):
                    path.unlink(missing_ok=True)

    def _checksum_of(self, name: str, payload: bytes) -> bytes:
        """Of the content of a file and of what it is: under another name it is damaged."""
        return hashlib.sha256(f"{self.key} {name}".encode() + payload).hexdigest().encode()


def _bytes_of(path: Path) -> bytes:
    """Bytes of a file; one that cannot be read is damaged."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DamagedFileError(f"it cannot be read: {error.strerror}") from None


def _names(folder: Path) -> list[str]:
    """Names of the files in the folder of blocks, sorted; none where there is no folder."""
    try:
        return sorted(os.listdir(folder))
    except FileNotFoundError:
        return []


def keys_of(names: list[str]) -> set[str]:
    """The beginnings of the keys of the studies whose blocks have these names."""
    return {matched[1] for matched in map(NAME.fullmatch, names) if matched}


# ---- manifest --------------------------------------------------------------------------------------


def block_folder(
    directory: Path,  # of results; locked by the caller
    plain: Mapping[str, Any],  # `study`, the study in plain data, and `table`, the labels of its dataset
    key: str,  # of the study and the code
    say: Callable[[str], None],  # called with a line for each damaged file
) -> BlockFolder:
    """The blocks of a study in a directory, which says from now on that it is the study's.

    A directory with a block of this study belongs to it, whatever its manifest says.

    Raises `InputError` if the directory holds another study, a damaged one of which no block is this study's, or
    something that is not a study.
    """

    def damaged(name: str, reason: str) -> None:
        say(f"{BLOCKS}/{name} is damaged ({reason}): its cases are run again")

    folder = directory / BLOCKS
    keys = keys_of(_names(folder))
    now = json.loads(json.dumps({"key": key, **plain}))
    earlier = None
    try:
        earlier = _manifest(folder / MANIFEST)
    except FileNotFoundError:
        names = (name for name in result_files(directory) if not STUDY_FIGURE.fullmatch(name))
        other = next((name for name in names if name not in REWRITTEN), None)
        allowed = f"holds results of another kind ({other}): choose another directory"
        require(other is None, "directory", str(directory), "", allowed)
    except DamagedFileError as error:
        if keys and key[:16] not in keys:
            raise _damaged(directory, error) from None
        say(f"{BLOCKS}/{MANIFEST} is damaged ({error}): it is written again")
    difference = "" if earlier is None or key[:16] in keys else first_difference(earlier["study"], now["study"])
    allowed = f"holds another study: {difference}; choose another directory"
    require(not difference, "directory", str(directory), "", allowed)
    folder.mkdir(parents=True, exist_ok=True)
    if earlier != now:
        atomic_write(folder / MANIFEST, json.dumps({"sha256": _checksum(now), **now}))
    return BlockFolder(folder, key, damaged)


def read_manifest(directory: Path) -> dict[str, Any]:
    """The manifest of the study in a directory: `key`, `study` and `table`."""
    try:
        return _manifest(directory / BLOCKS / MANIFEST)
    except FileNotFoundError:
        raise InputError([Fault("directory", str(directory), "", "must hold a parameter study")]) from None
    except DamagedFileError as error:
        raise _damaged(directory, error) from None


def _damaged(directory: Path, error: DamagedFileError) -> InputError:
    advice = f"run the same study again to write it anew, remove {BLOCKS}, or choose another directory"
    allowed = f"holds a {BLOCKS}/{MANIFEST} that is damaged ({error}): {advice}"
    return InputError([Fault("directory", str(directory), "", allowed)])


def _manifest(path: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(_bytes_of(path))
        same = found.pop("sha256", None) == _checksum(found)
    except (ValueError, RecursionError, AttributeError, TypeError):
        raise DamagedFileError("it is no table in JSON") from None
    if not same:
        raise DamagedFileError(OTHER_CONTENT)
    return found


def _checksum(plain: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def first_difference(one: Any, other: Any, path: str = "") -> str:
    """The first difference between two plain data as text; empty where they are equal."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for name in dict.fromkeys((*one, *other)):
            inner = f"{path}.{name}" if path else str(name)
            if name not in one or name not in other:
                absent = "at its default" if "noun" in one else "absent"
                there, here = (_short(each[name]) if name in each else absent for each in (one, other))
                return f"{inner} is {there} there, {here} here"
            found = first_difference(one[name], other[name], inner)
            if found:
                return found
        return ""
    if isinstance(one, list) and isinstance(other, list):
        for i, (first, second) in enumerate(zip(one, other, strict=False)):
            found = first_difference(first, second, f"{path}[{i}]")
            if found:
                return found
        return "" if len(one) == len(other) else f"{path} has {len(one)} entries there, {len(other)} here"
    return "" if one == other else f"{path} is {_short(one)} there, {_short(other)} here"


def _short(plain: Any) -> str:
    text = json.dumps(plain)
    return text if len(text) <= 60 else f"{text[:57]}..."
