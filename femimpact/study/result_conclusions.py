"""What results have found, as the conclusions of their report; a file that cannot be read is noted."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from femimpact.export import tables
from femimpact.export.report.page import Conclusion
from femimpact.structure.structure import Structure
from femimpact.study.picture_data import read_mode_shapes
from femimpact.study.result_directory import FILES, ResultsWarning
from femimpact.study.results import read_dataset, read_table
from femimpact.study.summary import Spread, contacts_of
from femimpact.svg import number_text

if TYPE_CHECKING:
    import xarray

    from femimpact.system.modes import Modes
    from femimpact.system.system import System

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class ResultReading:
    """A directory of results while it is read."""

    folder: Path  # with the files
    summary: dict[str, Any]  # empty where there is none
    missing: list[str] = field(default_factory=list)  # what could not be read, and why

    def attempt(self, what: str, make: Callable[[], T]) -> T | None:
        """What `make` returns; None, and a line of what is missing, where it fails."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                found: T | None = make()
            # what damaged results make a reader raise is without limit, and a report is made of the rest
            except Exception as error:
                words = " ".join(str(error).split()) or type(error).__name__
                self.miss(words if words.startswith(str(self.folder)) else f"{what}: {words}")
                found = None
        for one in caught:
            if issubclass(one.category, ResultsWarning):
                self.miss(str(one.message))
        return found

    @cached_property
    def history(self) -> xarray.Dataset | None:
        """The history; None where there is none, or it cannot be read."""
        return self.attempt(FILES["history"].name, lambda: read_dataset(self.folder, "history", self.summary))

    @cached_property
    def parameter_study(self) -> xarray.Dataset | None:
        """The dataset of a parameter study, as the history."""
        name = FILES["parameter_study"].name
        return self.attempt(name, lambda: read_dataset(self.folder, "parameter_study", self.summary))

    @cached_property
    def modes(self) -> tuple[System, Modes, Structure | None] | None:
        """The mode shapes, as the history."""
        return self.attempt(FILES["mode_shapes"].name, lambda: read_mode_shapes(self.folder, self.summary))

    def miss(self, text: str) -> None:
        """Note what is missing, with names of files alone: a report does not hang on where its directory is."""
        plain = text.replace(f"{self.folder}/", "").replace(f"{self.folder}: ", "")[:400]
        if plain not in self.missing:
            self.missing.append(plain)

    def table(self, name: str) -> dict[str, Any] | None:
        """A table of the results by the name of its file; None where there is none, or it cannot be read."""
        return self.attempt(name, lambda: read_table(self.folder, name, self.summary))

    def units(self, name: str) -> dict[str, str]:
        """Units of the columns of a table that was read."""
        return self.attempt(name, lambda: tables.read_units(self.folder / name)) or {}


def texts_of(values: Any) -> tuple[str, ...]:
    """What a summary has for a list of texts, whatever stands there."""
    return tuple(str(one) for one in values) if isinstance(values, (list, tuple)) else ()


FRAMES = {"base": "at rest relative to the base", "space": "at rest in the inertial frame"}

PREFIXES = {"m": (1e3, "mm"), "Pa": (1e-6, "MPa"), "N s": (1e3, "mN s")}


def conclusions_of(summary: Mapping[str, Any]) -> tuple[Conclusion, ...]:
    """Conclusions of a summary: peaks, damping, regime, stresses, forces, frequencies, energy; what it has of them."""
    return (
        *_peaks(summary), *_ratio(summary), *_damping(summary), *_history(summary), *_contacts(summary),
        *_frequencies(summary), *_energy(summary),
    )  # fmt: skip


def _shown(value: float) -> str:
    """Four digits, those at the end that are zero among them."""
    return str(int(value)) if value == int(value) and abs(value) >= 1000.0 else number_text(value, zeros=True)


def _at(data: Any, *keys: str) -> Any:
    """A value in tables of tables; None where any of them is something else."""
    for key in keys:
        data = data.get(key) if isinstance(data, Mapping) else None
    return data


def _number(data: Any, *keys: str) -> float | None:
    """A finite number in tables of tables."""
    value = _at(data, *keys)
    fits = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    return float(value) if fits else None


def _peaks(summary: Mapping[str, Any]) -> list[Conclusion]:
    found = []
    for case, words in (("empty", "without ball"), ("ball", "with ball")):
        peak, frequency = (
            _number(summary, "sweep", case, "peak_amplitude"),
            _number(summary, "sweep", case, "peak_frequency"),
        )
        if peak is None or frequency is None:
            continue
        low = _number(summary, "sweep", case, "peak_too_low_at_most")
        coarse = _at(summary, "sweep", case, "resolved") is False and low is not None
        found.append(
            Conclusion(
                f"Largest peak {words}", _shown(1e3 * peak), "mm",
                scatter=f"may be read up to {100 * low:.2g} % too low" if coarse and low is not None else "",
                one_sample=bool(_at(summary, "sweep", case, "peak_is_one_start")),
                note=f"at {number_text(frequency)} Hz, relative to the base",
            )
        )  # fmt: skip
    return found


def _spread(summary: Mapping[str, Any], start: str, name: str) -> Spread | None:
    median, lowest, highest = (_number(summary, "starts", start, name, key) for key in ("median", "lowest", "highest"))
    if median is None or lowest is None or highest is None:
        return None
    return Spread(median, lowest, highest, _number(summary, "starts", start, name, "resolution") or 0.0)


def _from_starts(summary: Mapping[str, Any], name: str, label: str, unit: str, scale: float = 1.0) -> list[Conclusion]:
    """A quantity that was taken over several starts: in the first frame of them, and in the others in words."""
    spreads = [(words, _spread(summary, start, name)) for start, words in FRAMES.items()]
    known = [(words, spread.text(scale)) for words, spread in spreads if spread is not None]
    if not known:
        return []
    (words, text), *others = known
    value, _, scatter = text.partition(" (")
    between = f"{scatter.rstrip(')')} over starts {words}" if scatter else words
    return [Conclusion(label, value, unit, between, note="; ".join(f"{words}: {text}" for words, text in others))]


def _ratio(summary: Mapping[str, Any]) -> list[Conclusion]:
    several = _from_starts(summary, "peak_frequency", "Frequency of the peak with ball", "Hz")
    several += _from_starts(summary, "amplitude_ratio", "Peak without ball over peak with it", "")
    ratio = _number(summary, "amplitude_ratio")
    if several or ratio is None:
        return several
    sample = any(_at(summary, "sweep", case, "peak_is_one_start") for case in ("empty", "ball"))
    return [Conclusion("Peak without ball over peak with it", _shown(ratio), one_sample=bool(sample))]


def _damping(summary: Mapping[str, Any]) -> list[Conclusion]:
    found = []
    ratio = _number(summary, "sweep", "empty", "damping_fit")
    if ratio is not None:
        interval = _at(summary, "sweep", "empty", "damping_fit_interval")
        known = isinstance(interval, list) and len(interval) == 2 and all(isinstance(one, float) for one in interval)
        words = f"interval {100 * interval[0]:.4g} to {100 * interval[1]:.4g} %" if known else ""
        found.append(
            Conclusion("Damping ratio without ball", _shown(100 * ratio), "%", words, note="one-pole fit of the curve")
        )
    several = _from_starts(summary, "damping_amplitude_ratio", "Damping ratio with ball", "%", 100.0)
    with_ball = _number(summary, "sweep", "ball", "damping_amplitude_ratio")
    if several or with_ball is None:
        return found + several
    sample = bool(_at(summary, "sweep", "ball", "peak_is_one_start"))
    return [
        *found,
        Conclusion(
            "Damping ratio with ball", _shown(100 * with_ball), "%", one_sample=sample, note="by the drop of the peak"
        ),
    ]


def _history(summary: Mapping[str, Any]) -> list[Conclusion]:
    history = summary.get("history")
    if not isinstance(history, Mapping):
        return []
    sample = history.get("steadiness") != "periodic"
    frequency = _number(history, "frequency")
    at = f"of the history at {number_text(frequency)} Hz" if frequency is not None else "of the history"
    found = []
    label = _at(history, "regime", "label")
    if isinstance(label, str):
        per_cycle = _number(history, "impacts_per_cycle")
        rate = f"{_shown(per_cycle)} impacts in a cycle" if per_cycle is not None else ""
        found.append(Conclusion("Kind of motion", label, scatter=rate, note=at))
    peak = _number(history, "peak")
    if peak is not None:
        found.append(
            Conclusion("Peak of the tip", _shown(1e3 * peak), "mm", one_sample=sample, note=f"over the last third {at}")
        )
    channels = history.get("channels")
    for name, about in channels.items() if isinstance(channels, Mapping) else ():
        unit, largest = _at(about, "unit"), _number(about, "largest_of_run")
        if unit in ("Pa", "N m") and largest is not None:
            scale, shown = PREFIXES.get(unit, (1.0, unit))
            words = f"largest of the run{_when(about)}"
            found.append(Conclusion(str(name), _shown(scale * largest), shown, one_sample=sample, note=words))
    return found


def _when(about: Any) -> str:
    time = _number(about, "time_of_largest")
    return "" if time is None else f", at {number_text(time)} s"


def _contacts(summary: Mapping[str, Any]) -> list[Conclusion]:
    sample = _at(summary, "history", "steadiness") != "periodic"
    several = _from_starts(summary, "cycle_mean_force", "Cycle-averaged contact force", "mN", 1e3)
    several += _from_starts(summary, "peak_force", "Largest contact force", "N")
    if several:
        return several
    found = []
    averaged = "Mean" if _number(summary, "history", "frequency") is None else "Cycle-averaged"
    try:
        contacts = contacts_of(summary)
    except (TypeError, KeyError, ValueError):
        return []
    for name, contact in contacts.items():
        law, count = _at(contact, "law"), _number(contact, "impacts")
        force, mean = _number(contact, "peak_force"), _number(contact, "cycle_mean_force")
        if count == 0.0:
            found.append(Conclusion(f"Impacts of {name}", "none", note="in the run"))
            continue
        impacts = f"{count:.0f} impacts of the run" if count is not None else ""
        if force is not None:
            found.append(
                Conclusion(
                    f"Largest force of {name}", _shown(force), "N", one_sample=sample, note=f"law: {law}; {impacts}"
                )
            )
        if mean is not None:
            scale, unit = (1e3, "mN") if mean < 1.0 else (1.0, "N")
            found.append(
                Conclusion(f"{averaged} force of {name}", _shown(scale * mean), unit, one_sample=sample, note=impacts)
            )
    return found


def _frequencies(summary: Mapping[str, Any]) -> list[Conclusion]:
    found = []
    for case, words in (("empty", "without ball"), ("glued", "with the balls glued on")):
        values = _at(summary, "natural_frequency", case)
        if isinstance(values, list) and values and isinstance(values[0], (int, float)):
            found.append(Conclusion("First natural frequency", _shown(float(values[0])), "Hz", note=words))
    return found


def _energy(summary: Mapping[str, Any]) -> list[Conclusion]:
    residual = _number(summary, "energy_residual")
    if residual is None:
        return []
    return [
        Conclusion(
            "Energy unaccounted for",
            number_text(100 * residual, 2),
            "%",
            note="of the energy put in: a check of the computation",
        )
    ]


def convergence_conclusions(
    columns: Mapping[str, Any] | None,  # or None: as of `convergence_summary.csv`
    accuracy: Any = None,  # relative error that was asked for
) -> tuple[Conclusion, ...]:
    """The numbers with which every quantity that has an order is accurate, over each axis."""
    if columns is None or not {"axis", "quantity", "recommended", "expected_order"} <= set(columns):
        return ()
    words = {"mesh": "elements", "step": "steps in the first period", "modes": "modes"}
    axes, found = np.asarray(columns["axis"]), []
    recommended, order = (np.asarray(columns[name], dtype=float) for name in ("recommended", "expected_order"))
    for axis in dict.fromkeys(axes.tolist()):
        mine = (axes == axis) & np.isfinite(order)
        known = mine & np.isfinite(recommended)
        if not known.any():
            continue
        worst = int(np.argmax(np.where(known, recommended, -np.inf)))
        unknown = int(mine.sum() - known.sum())
        known_for = (
            f"not known for {unknown} of {int(mine.sum())} quantities"
            if unknown
            else "for every quantity that has an order"
        )
        asked = f"for a relative error of {accuracy:g}, " if isinstance(accuracy, float) else ""
        found.append(
            Conclusion(
                f"Needed: {words.get(axis, axis)}",
                f"{recommended[worst]:.0f}",
                scatter=asked + known_for,
                note=f"most for {columns['quantity'][worst]}",
            )
        )
    return tuple(found)
