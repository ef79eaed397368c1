"""What a summary says, as records: plain numbers in Hz, m, N, N s and 1, written by their fields and read back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from femimpact.errors import require
from femimpact.response.regimes import Regime
from femimpact.units import at_place, decimal_place, number_text, prefixed, unit_text

T = TypeVar("T")


START_WORDS: Mapping[str, str] = {
    "base": "at rest relative to the base", "space": "at rest in the inertial frame", "static": "in the static state",
}  # fmt: skip
"""How a run begins, in words."""


@dataclass(frozen=True)
class Spread:
    """One quantity of a chaotic motion over several starts."""

    median: float
    lowest: float
    highest: float
    resolution: float = 0.0  # what one start's value is exact to, as the step of a grid; 0 where it is rounding

    def text(self, scale: float = 1.0, digits: int = 4) -> str:
        """Median and range in words, to two digits of half the range, of at most so many that are significant.

        What is exact to the step of a grid has no more digits than the step. The range is rounded outwards, after a
        quarter of it at each end for the starts that were not run.
        """
        low, middle, high, step = (scale * x for x in (self.lowest, self.median, self.highest, self.resolution))
        largest = max(abs(low), abs(middle), abs(high))
        if not 0.0 < largest < math.inf:
            return number_text(middle)
        beyond = step + (high - low) / 4.0
        place = max(
            decimal_place((high - low) / 2.0) - 1, decimal_place(step), decimal_place(largest + beyond) - digits + 1
        )
        unit = 10.0**place
        down, up = math.floor((low - beyond) / unit + 1e-6), math.ceil((high + beyond) / unit - 1e-6)
        if low >= 0.0:
            down = max(down, 0)
        # a median far below the largest value keeps two digits
        of_middle = min(place, decimal_place(middle) - 1) if middle else place
        return f"{at_place(middle, of_middle)} ({at_place(down * unit, place)} to {at_place(up * unit, place)})"

    def in_unit_that_fits(self, unit: str) -> tuple[str, str]:
        """The same words, and the unit with the prefix in which they are; a ratio may be in %."""
        factor, shown = (100.0, "%") if unit == "%" else prefixed(max(abs(self.lowest), abs(self.highest)), unit)
        return self.text(factor), shown


def spread_text(spread: Spread, unit: str) -> str:
    """Median and range in words, with the unit that fits."""
    text, shown = spread.in_unit_that_fits(unit)
    return text if shown == "1" else f"{text} {shown}"


def history_words(spread: Spread | None, value: float | None, unit: str) -> str:
    """A number of a history in words with its unit, of several starts their median and range; "" of none."""
    if spread is not None and math.isfinite(spread.median):
        return spread_text(spread, unit)
    return unit_text(value, unit) if value is not None and math.isfinite(value) else ""


@dataclass(frozen=True)
class CoarseDamping:
    """Damping ratios of the even grid alone."""

    damping_fit: float
    damping_half_power: float


@dataclass(frozen=True)
class CurveSummary:
    """A response curve: its peak, its damping by its width, and how exact they are."""

    peak_frequency: float
    peak_amplitude: float
    peak_is_one_start: bool
    peak_is_transient: bool
    peak_too_low_at_most: float  # share of the peak
    resolved: bool | None  # None where the curve shows no resonance
    damping_fit: float
    damping_fit_interval: tuple[float, ...]
    damping_fit_frequency: float
    damping_half_power: float
    damping_half_power_interval: tuple[float, ...]
    coarse_grid: CoarseDamping
    start: str
    cycles: int | None
    largest_energy_residual: float
    steadiness: Mapping[str, int]  # frequencies of each kind of motion
    warnings: tuple[str, ...]
    coarse_warnings: tuple[str, ...]
    damping_amplitude_ratio: float | None = None  # by the drop of the peak, of a curve with balls
    root_stress: float | None = None  # Pa: of the peak, of a linear structure on a base


@dataclass(frozen=True)
class ChannelSummary:
    """A channel of a history; none of its numbers is known of the force of a rigid pair that has collided."""

    unit: str
    largest: float  # over the last third, without a cycle of the whole run, as the rms
    rms: float
    largest_of_run: float
    time_of_largest: float  # s


@dataclass(frozen=True)
class HistorySummary:
    """A history: the default place over the last third of the cycles, its impacts, and every channel."""

    peak: float  # without a cycle that of the whole run, as the rms
    peak_is_one_start: bool
    peak_is_transient: bool
    rms: float
    steadiness: str
    impacts: int
    impacts_per_cycle: float
    regime: Regime
    channels: Mapping[str, ChannelSummary]
    frequency: float | None = None  # None where the drive has no cycle
    root_stress_without: float | None = None  # Pa: steady, of a linear structure without what it carries, on a sine

    @property
    def window_of_peaks(self) -> str:
        """Words for the part of the run of which the peaks are."""
        return "of the whole run" if self.frequency is None else "over the last third"


@dataclass(frozen=True)
class AchievedRestitution:
    """Restitution of a law with the step of the run."""

    mean: float
    lowest: float
    highest: float


@dataclass(frozen=True)
class ContactSummary:
    """The law of a contact; of a history its impacts, with the forces as of `contact_forces`."""

    law: str
    restitution: float
    stiffness: float
    damping: float
    contact_time: float
    effective_mass: float
    total_clearance: float
    achieved_restitution: AchievedRestitution
    achieved_by: str  # {"law", "step"}
    name: str | None = None  # of the first contact
    impacts: int | None = None
    observed_restitution: float | None = None  # median of the run
    peak_force: float | None = None
    mean_impulse: float | None = None
    largest_impulse: float | None = None
    cycle_mean_force: float | None = None
    mean_approach_speed: float | None = None


@dataclass(frozen=True)
class HistoryStarts:
    """Medians and ranges of a history over several starts, by the names of its numbers."""

    count: int
    peak: Spread
    rms: Spread
    channels: Mapping[str, Mapping[str, Spread]]
    contacts: Mapping[str, Mapping[str, Spread]]


@dataclass(frozen=True)
class PlacedBifurcation:
    """A bifurcation and the value of the parameter at it."""

    kind: str
    value: float


@dataclass(frozen=True)
class BranchSummary:
    """A branch of periodic orbits."""

    origin: str
    cycles: int
    points: int
    stable: tuple[tuple[float, float], ...]  # ranges of the parameter with stable orbits, from low to high
    lowest: float  # of the parameter
    highest: float
    largest_peak: float
    ends: tuple[str, ...]
    bifurcations: tuple[PlacedBifurcation, ...]


@dataclass(frozen=True)
class OrbitsSummary:
    """Branches of periodic orbits over a parameter."""

    parameter: str
    unit: str
    range: tuple[float, ...]
    modes: int
    branches: tuple[BranchSummary, ...]


def place_words(place: str) -> str:
    """A place in words."""
    return {"tip": "the tip", "mid": "the middle"}.get(place, place)


@dataclass(frozen=True)
class Findings:
    """What a summary says of the results of a study; a field at its default is not written."""

    study: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    core: Mapping[str, Any] = field(default_factory=dict)
    method: str = ""
    step: float | None = None  # s
    carried: str = "ball"  # what the structure carries, in words
    place: str = "tip"  # whose motion is read
    natural_frequency: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    damping_ratio: tuple[float, ...] = ()
    restitution: float | None = None
    contact: ContactSummary | None = None
    further_contacts: Mapping[str, ContactSummary] = field(default_factory=dict)
    sweep: Mapping[str, CurveSummary] = field(default_factory=dict)
    amplitude_ratio: float | None = None
    history: HistorySummary | None = None
    history_without: HistorySummary | None = None  # of what the structure carries, but on a sine of the base
    energy_residual: float | None = None
    work: float | None = None  # J
    work_of: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    answer: tuple[str, ...] = ()  # lines that a terminal has in place of all else
    starts: Mapping[str, Mapping[str, Spread]] = field(default_factory=dict)  # of the sweep, by the frame of the start
    starts_of_sweep: int | None = None
    history_starts: HistoryStarts | None = None
    failed_starts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # why, by part and start
    orbits: OrbitsSummary | None = None
    problems: tuple[str, ...] = ()  # that tables of convergence are of, in words
    accuracy: float | None = None  # relative error that their recommended numbers are for
    points: Mapping[str, float] = field(default_factory=dict)  # m: places that a mesh file names
    seeds: tuple[str, ...] = ()  # of random numbers, each with what was drawn
    unfinished: tuple[str, ...] = ()  # parts that were still to come when the run was ended
    pictures: Mapping[str, str] = field(default_factory=dict)  # what became of each kind of them
    checksums: Mapping[str, str] = field(default_factory=dict)  # SHA-256 of every file; none where they are not known

    @property
    def observed(self) -> str:
        """The place whose motion is read, in words."""
        return place_words(self.place)

    @property
    def contacts(self) -> dict[str, ContactSummary]:
        """Every contact by its name; none where the study has none."""
        return {} if self.contact is None else {str(self.contact.name): self.contact, **self.further_contacts}


def joined(first: Findings, further: Findings) -> Findings:
    """Both: texts and tables one behind the other, and the further of two single values where it is none by default."""
    changes = dict[str, Any]()
    for item in fields(Findings):
        before, after = getattr(first, item.name), getattr(further, item.name)
        if isinstance(before, tuple):
            changes[item.name] = (*before, *(one for one in after if one not in before))
        elif isinstance(before, Mapping):
            changes[item.name] = {**before, **after}
        elif after != item.default:
            changes[item.name] = after
    return replace(first, **changes)


def summary_of(findings: Findings) -> dict[str, Any]:
    """What `read_findings` reads: notes and warnings are there, also where there are none."""
    return {**written(findings), "notes": list(findings.notes), "warnings": list(findings.warnings)}


def written(record: Any) -> Any:
    """A record as tables of tables by its fields, without those that are at their defaults."""
    if is_dataclass(record):
        values = {item.name: getattr(record, item.name) for item in fields(record) if not _is_default(record, item)}
        return {name: written(value) for name, value in values.items()}
    if isinstance(record, Mapping):
        return {name: written(value) for name, value in record.items()}
    return [written(one) for one in record] if isinstance(record, tuple) else record


def _is_default(record: Any, item: Field[Any]) -> bool:
    value = getattr(record, item.name)
    return value is None if item.default is None else not (_has_no_default(item) or value or item.type == "float")


def read_findings(summary: Mapping[str, Any]) -> Findings:
    """What a summary says.

    Raises `InputError` with the key and the value where the summary is damaged, or that of another program.
    """
    return _record(Findings, summary, "summary")


def _record(kind: type[T], value: Any, key: str) -> T:
    """The record of a table: a number that is not known is nan."""
    require(isinstance(value, Mapping), key, value, "", "must be a table: the summary is damaged")
    hints = get_type_hints(kind)
    known = [item for item in fields(kind) if item.name in value or _has_no_default(item)]  # type: ignore[arg-type]
    return kind(**{item.name: _read(hints[item.name], value.get(item.name), f"{key}.{item.name}") for item in known})


def _has_no_default(item: Field[Any]) -> bool:
    return item.default is MISSING and item.default_factory is MISSING


def _read(kind: Any, value: Any, key: str) -> Any:
    origin, parts = get_origin(kind), get_args(kind)
    if kind is Any or (origin is UnionType and value is None):
        return value
    if origin is UnionType:
        return _read(parts[0], value, key)
    if is_dataclass(kind):
        return _record(kind, value, key)  # type: ignore[arg-type]
    if kind is float and value is None:
        return math.nan
    shape = {Mapping: (Mapping, "a table"), tuple: ((list, tuple), "a list"), float: ((int, float), "a number")}
    expected, words = shape.get(origin or kind, (kind, f"of the type {getattr(kind, '__name__', kind)}"))
    fits = isinstance(value, expected) and (kind is bool or not isinstance(value, bool))
    require(fits, key, value, "", f"must be {words}: the summary is damaged")
    if origin is Mapping:
        return {str(name): _read(parts[1], one, f"{key}.{name}") for name, one in value.items()}
    if origin is tuple:
        return tuple(_read(parts[0], one, f"{key}.{number}") for number, one in enumerate(value, 1))
    return float(value) if kind is float else value
