"""Conclusions of a report of results. A file of the results that cannot be read is noted."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from femimpact.app.parametric.best_design import MOST_NAMED, BestCase, design_notes, label_of, more_designs, told
from femimpact.app.report.page import Conclusion
from femimpact.app.results.picture_data import StructureModes, read_mode_shapes
from femimpact.app.results.result_directory import FILES, ResultsWarning
from femimpact.app.results.results import carried_of, read_dataset, read_table
from femimpact.app.study.study import Study
from femimpact.app.study.study_file import load_study
from femimpact.app.study.summary import Spread, contacts_of, spread_text, window_of_peaks
from femimpact.figures.study_labels import axis_names, axis_words, measure_names, single_samples, value_words
from femimpact.files import read_units
from femimpact.orbits.figures import MARKS, kind_words
from femimpact.units import SHOWN_IN, interval_texts, prefixed, typeset_number, unit_text, unit_words

if TYPE_CHECKING:
    import xarray

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class ResultReading:
    """A directory of results with the data read from it, and notes on what could not be read."""

    folder: Path  # with the files
    summary: dict[str, Any]  # empty where there is none
    missing: list[str] = field(default_factory=list)  # what could not be read or is not as it was, and why
    failures: list[str] = field(default_factory=list)  # what could not be read

    def attempt(self, what: str, make: Callable[[], T]) -> T | None:
        """The value of `make()`; where it fails None, and a line in `missing`."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                found: T | None = make()
            # what damaged results make a reader raise is without limit, and a report is made of the rest
            except Exception as error:
                words = " ".join(str(error).split()) or type(error).__name__
                text = words if words.startswith(str(self.folder)) else f"{what}: {words}"
                self.failures.append(self.miss(text))
                found = None
        for one in caught:
            if issubclass(one.category, ResultsWarning):
                self.miss(str(one.message))
        return found

    @cached_property
    def study(self) -> Study | None:
        """The study of the results, as the history."""
        path = self.folder / FILES["study"].name
        return self.attempt(path.name, lambda: load_study(path)) if path.exists() else None

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
    def modes(self) -> StructureModes | None:
        """The mode shapes, as the history."""
        return self.attempt(FILES["mode_shapes"].name, lambda: read_mode_shapes(self.folder, self.summary))

    def miss(self, text: str) -> str:
        """Note what is missing, with names of files alone: a report does not hang on where its directory is."""
        plain = text.replace(f"{self.folder}/", "").replace(f"{self.folder}: ", "")[:400]
        if plain not in self.missing:
            self.missing.append(plain)
        return plain

    def table(self, name: str) -> dict[str, Any] | None:
        """A table of the results by the name of its file; None where there is none, or it cannot be read."""
        return self.attempt(name, lambda: read_table(self.folder, name, self.summary))

    def units(self, name: str) -> dict[str, str]:
        """Units of the columns of a table that was read."""
        return self.attempt(name, lambda: read_units(self.folder / name)) or {}


def texts_of(values: Any) -> tuple[str, ...]:
    """Texts of a list in a summary; none where something else stands there."""
    return tuple(str(one) for one in values) if isinstance(values, (list, tuple)) else ()


STARTS = {"base": "at rest relative to the base", "space": "at rest in the inertial frame"}


def conclusions_of(summary: Mapping[str, Any]) -> tuple[Conclusion, ...]:
    """Conclusions of a summary: peaks, damping, regime, stresses, forces, frequencies, energy; what it has of them."""
    return (
        *_peaks(summary), *_ratio(summary), *_damping(summary), *_history(summary), *_contacts(summary),
        *_frequencies(summary), *_energy(summary), *_orbits(summary),
    )  # fmt: skip


def _orbits(summary: Mapping[str, Any]) -> list[Conclusion]:
    """How many branches of periodic orbits there are, and where their orbits are stable."""
    found, branches = _at(summary, "orbits"), _at(summary, "orbits", "branches")
    if not isinstance(branches, list) or not branches:
        return []
    stable = sum(1 for branch in branches if _number(branch, "stable_points"))
    # two branches share the point at which they meet
    places = {
        (str(_at(each, "kind")), f"{_number(each, 'value') or 0.0:.9g}")
        for branch in branches
        for each in _at(branch, "bifurcations") or []
    }
    kinds = Counter(kind for kind, _ in places)
    details = tuple(f"{kind_words(kind)}: {kinds[kind]}" for kind in MARKS if kind in kinds)
    note = f"over {_at(found, 'parameter')}, on {_at(found, 'modes')} modes; {stable} of them with stable orbits"
    return [Conclusion("Branches of periodic orbits", str(len(branches)), note=note, details=details)]


def _shown(value: float) -> str:
    """Four digits, those at the end that are zero among them."""
    return str(int(value)) if value == int(value) and abs(value) >= 1000.0 else typeset_number(value, zeros=True)


def number_conclusion(label: str, value: float, unit: str, **more: Any) -> Conclusion:
    """The conclusion of a number, in the unit that fits."""
    factor, shown = prefixed(abs(value), unit)
    return Conclusion(label, _shown(factor * value), "" if shown == "1" else shown, **more)


TRANSIENT = "a transient of the start has not died out"


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
    carried = carried_of(summary)
    for case, words in (("empty", f"without {carried}"), ("ball", f"with {carried}")):
        peak, frequency = (_number(summary, "sweep", case, f"peak_{name}") for name in ("amplitude", "frequency"))
        if peak is None or frequency is None:
            continue
        several = _from_starts(summary, "peak_amplitude", f"Largest peak {words}", "m") if case == "ball" else []
        if several:
            found += several
            continue
        low = _number(summary, "sweep", case, "peak_too_low_at_most")
        coarse = _at(summary, "sweep", case, "resolved") is False and low is not None
        settling = f"; {TRANSIENT}" if _at(summary, "sweep", case, "peak_is_transient") else ""
        found.append(
            number_conclusion(
                f"Largest peak {words}", peak, "m",
                scatter=f"may be read up to {typeset_number(100 * (low or 0.0), 2)} % too low" if coarse else "",
                one_sample=bool(_at(summary, "sweep", case, "peak_is_one_start")),
                note=f"at {typeset_number(frequency)} Hz, relative to the base{settling}",
            )
        )  # fmt: skip
    return found


def spread_at(data: Any, *keys: str) -> Spread | None:
    """Median and range in tables of tables; None where something else stands there."""
    median, lowest, highest = (_number(data, *keys, key) for key in ("median", "lowest", "highest"))
    if median is None or lowest is None or highest is None:
        return None
    return Spread(median, lowest, highest, _number(data, *keys, "resolution") or 0.0)


def _of_spread(spread: Spread, label: str, unit: str, words: str, note: str = "") -> Conclusion:
    """A median with its range in words."""
    text, shown = spread.in_unit_that_fits(unit)
    value, _, scatter = text.partition(" (")
    scatter = f"{scatter.rstrip(')')} over {words}" if scatter else words
    return Conclusion(label, value, "" if shown == "1" else shown, scatter, note=note)


def _from_starts(summary: Mapping[str, Any], name: str, label: str, unit: str) -> list[Conclusion]:
    """A quantity that was taken over several starts: in the first frame of them, and in the others in words."""
    count, frames = _number(summary, "starts_of_sweep"), {**STARTS, "static": "in the static position"}
    spreads = [(words, spread_at(summary, "starts", start, name)) for start, words in frames.items()]
    known = [(words, spread) for words, spread in spreads if spread is not None]
    if not known:
        return []
    (words, first), *others = known
    note = "; ".join(f"{words}: {spread_text(spread, unit)}" for words, spread in others)
    # of a run the balls are drawn, and the structure is at rest
    text = f"starts {words}" if count is None else f"{count:.0f} starts of the {carried_of(summary)}, the beam {words}"
    return [_of_spread(first, label, unit, text, note)]


def _from_history_starts(
    summary: Mapping[str, Any], keys: tuple[str, ...], label: str, unit: str, note: str = ""
) -> list[Conclusion]:
    """A quantity of the history that was taken over several starts."""
    spread, count = spread_at(summary, "history_starts", *keys), _number(summary, "history_starts", "count")
    return (
        []
        if spread is None
        else [_of_spread(spread, label, unit, f"{count or 0:.0f} starts of the {carried_of(summary)}", note)]
    )


def _ratio(summary: Mapping[str, Any]) -> list[Conclusion]:
    carried = carried_of(summary)
    them = "them" if carried.endswith("s") or " and " in carried else "it"
    label = f"Peak without {carried} over peak with {them}"
    several = _from_starts(summary, "peak_frequency", f"Frequency of the peak with {carried}", "Hz")
    several += _from_starts(summary, "amplitude_ratio", label, "1")
    ratio = _number(summary, "amplitude_ratio")
    if several or ratio is None:
        return several
    sample = any(_at(summary, "sweep", case, "peak_is_one_start") for case in ("empty", "ball"))
    return [Conclusion(label, _shown(ratio), one_sample=bool(sample))]


DROP = "Equivalent damping by the drop of the peak"
"""With impacts the width of a peak is no damping."""


def _damping(summary: Mapping[str, Any]) -> list[Conclusion]:
    found, carried = [], carried_of(summary)
    ratio = _number(summary, "sweep", "empty", "damping_fit")
    if ratio is not None:
        interval = _at(summary, "sweep", "empty", "damping_fit_interval")
        known = isinstance(interval, list) and len(interval) == 2 and all(isinstance(one, float) for one in interval)
        shown, words = _shown(100 * ratio), ""
        if known:
            shown, low, high = interval_texts(100 * ratio, *(100 * one for one in interval))
            words = f"95 % interval {low} to {high} %"
        note = "one-pole fit of the curve"
        found.append(Conclusion(f"Damping ratio without {carried}", shown, "%", words, note=note))
    several = _from_starts(summary, "damping_amplitude_ratio", DROP, "%")
    with_ball = _number(summary, "sweep", "ball", "damping_amplitude_ratio")
    if several or with_ball is None:
        return found + several
    sample = bool(_at(summary, "sweep", "ball", "peak_is_one_start"))
    return [
        *found,
        Conclusion(
            DROP, _shown(100 * with_ball), "%", one_sample=sample, note=f"damping without {carried} times the ratio"
        ),
    ]


def _history(summary: Mapping[str, Any]) -> list[Conclusion]:
    history = summary.get("history")
    if not isinstance(history, Mapping):
        return []
    sample = bool(history.get("peak_is_one_start"))
    frequency = _number(history, "frequency")
    at = f"of the history at {typeset_number(frequency)} Hz" if frequency is not None else "of the history"
    found = []
    label = _at(history, "regime", "label")
    # without a cycle nothing could repeat
    if isinstance(label, str) and (frequency is not None or label == "no impacts"):
        per_cycle = _number(history, "impacts_per_cycle")
        rate = f"{_shown(per_cycle)} impacts in a cycle" if per_cycle is not None else ""
        found.append(Conclusion("Kind of motion", label, scatter=rate, note=at))
    peak = _number(history, "peak")
    over = f"over the last third of the cycles {at}" if frequency is not None else window_of_peaks(history)
    over += f"; {TRANSIENT}" if history.get("peak_is_transient") else ""
    several = _from_history_starts(summary, ("peak",), "Peak of the tip", "m", over)
    if several:
        found += several
    elif peak is not None:
        found.append(number_conclusion("Peak of the tip", peak, "m", one_sample=sample, note=over))
    channels = history.get("channels")
    for name, about in channels.items() if isinstance(channels, Mapping) else ():
        unit, largest = _at(about, "unit"), _number(about, "largest_of_run")
        if unit in ("Pa", "N m") and largest is not None:
            time = _number(about, "time_of_largest")
            words = "largest of the run" if time is None else f"largest of the run, at {typeset_number(time)} s"
            keys = ("channels", str(name), "largest_of_run")
            several = _from_history_starts(summary, keys, str(name), unit, "largest of the run")
            found += several or [number_conclusion(str(name), largest, unit, one_sample=sample, note=words)]
    return found


def _contacts(summary: Mapping[str, Any]) -> list[Conclusion]:
    history = summary.get("history")
    history = history if isinstance(history, Mapping) else {}
    sample = bool(history.get("peak_is_one_start"))
    several = _from_starts(summary, "cycle_mean_force", "Cycle-averaged contact force", "N")
    several += _from_starts(summary, "peak_force", "Largest contact force", "N")
    if several and "history_starts" not in summary:
        return several
    found = []
    averaged = "Mean" if _number(history, "frequency") is None else "Cycle-averaged"
    try:
        contacts = contacts_of(summary)
    except (TypeError, KeyError, ValueError):
        return []
    for name, contact in contacts.items():
        law, count = _at(contact, "law"), _number(contact, "impacts")
        if count == 0.0:
            found.append(Conclusion(f"Impacts of {name}", "none", note="in the run"))
            continue
        impacts = f"{count:.0f} impacts of the run" if count is not None else ""
        # a rigid law has no force
        key, what, unit, over = (
            ("largest_impulse", "impulse", "N s", "of the whole run")
            if _number(contact, "peak_force") is None
            else ("peak_force", "force", "N", window_of_peaks(history))
        )
        for entry, label, of, note in (
            (key, f"Largest {what} of {name}", unit, f"{over}; law: {law}; {impacts}"),
            ("cycle_mean_force", f"{averaged} force of {name}", "N", f"over the last third; {impacts}"),
        ):
            value = _number(contact, entry)
            if value is not None:
                found += _from_history_starts(summary, ("contacts", name, entry), label, of, note) or [
                    number_conclusion(label, value, of, one_sample=sample, note=note)
                ]
    return found


def _frequencies(summary: Mapping[str, Any]) -> list[Conclusion]:
    found, carried = [], carried_of(summary)
    for case, words in (("empty", f"without {carried}"), ("glued", "with the balls glued on")):
        values = _at(summary, "natural_frequency", case)
        if isinstance(values, list) and values and isinstance(values[0], (int, float)):
            found.append(number_conclusion("First natural frequency", float(values[0]), "Hz", note=words))
    return found


def _energy(summary: Mapping[str, Any]) -> list[Conclusion]:
    residual = _number(summary, "energy_residual")
    if residual is None:
        return []
    return [
        Conclusion(
            "Energy unaccounted for",
            typeset_number(100 * residual, 2),
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


# ---- of a parameter study ------------------------------------------------------------------------


MOST_NAMES = 20
"""Values of an axis of names that are listed."""

MOST_MEASURES = 8
"""Measures that have conclusions."""

NO_BEST_CASES: Mapping[str, BestCase] = {}
NO_REASONS: Mapping[str, str] = {}


def study_lead(data: xarray.Dataset) -> list[str]:
    """Sentences on the cases, starts and axes of a parameter study."""
    sizes, starts = tuple(data["finished"].sizes.values()), int(data.attrs["starts"])
    shape = f" ({' x '.join(map(str, sizes))})" if len(sizes) > 1 else ""
    each = f"{starts} starts each" if starts > 1 else "one start each"
    run = "a case is a run of the whole history of the base"
    if "cycles" in data.attrs:
        cycles, measured = (int(data.attrs[name]) for name in ("cycles", "measured_cycles"))
        run = f"{cycles} cycles of the base, of which the last {measured} are measured"
    drive = [f"Drive: {data.attrs['drive']}."] if "drive" in data.attrs else []
    return [
        f"Parameter study: {int(np.prod(sizes))} cases{shape}, {each}; {run}, at {data.attrs['place']}.",
        *drive,
        f"Axes: {'; '.join(_axes(data))}.",
    ]


def _axes(data: xarray.Dataset) -> Iterator[str]:
    """Every axis with its reach."""
    for name in axis_names(data):
        words, names, found = axis_words(data, name), value_words(data, name), data[name].to_numpy()
        if names is not None:
            distinct = list(dict.fromkeys(names))
            more = f" and {len(distinct) - MOST_NAMES} more" if len(distinct) > MOST_NAMES else ""
            yield f"{words}: {'; '.join(distinct[:MOST_NAMES])}{more}{_unit_of_words(data, name)}"
            continue
        low, high = (_text(value, data[name].attrs) for value in (found.min(), found.max()))
        yield f"{words}: {low} to {high}, {np.unique(found).size} values"


def _unit_of_words(data: xarray.Dataset, name: str) -> str:
    """Unit of the words of an axis, which pairs of gaps alone have."""
    return " mm" if f"{name}.plus" in data.coords else ""


def study_conclusions(
    data: xarray.Dataset,
    best: Mapping[str, BestCase] = NO_BEST_CASES,
    reasons: Mapping[str, str] = NO_REASONS,  # why a measure that says what is better has no best case, by its name
) -> tuple[Conclusion, ...]:
    """The best case with all that is known of it; where there is none the smallest and largest value of each measure.

    A measure with a reason has its worst value and the reason: its smallest value of all cases may be one beside a
    resonance.
    """
    samples, starts = single_samples(data), int(data.attrs["starts"])
    names = [name for name in measure_names(data) if name not in best and (name in reasons or not best)]
    found = [one for name in best for one in _of_best(data, best[name])][:MOST_MEASURES]
    for name in names[: MOST_MEASURES - len(found)]:
        values = data[name]
        array = values.to_numpy()
        least, most = (
            np.unravel_index(int(find(array)), array.shape) for find in (np.nanargmin, np.nanargmax)
        )  # fmt: skip
        (word, at), (other, end) = ("smallest", least), ("largest", most)
        rest = f"the {other} is {_text(array[end], values.attrs)}, at {_place(data, values.dims, end)}"
        if name in reasons:
            if values.attrs.get("better") == "small":
                (word, at), (other, end) = (other, end), (word, at)
            rest = f"no best case: {reasons[name]}; the {other} of all cases is {_text(array[end], values.attrs)}"
        factor, unit = SHOWN_IN.get(values.attrs.get("units", "1"), (1.0, values.attrs.get("units", "1")))
        scatter = ""
        if starts > 1 and f"{name}_low" in data:
            low, high = (_text(data[f"{name}{side}"].to_numpy()[at], values.attrs) for side in ("_low", "_high"))
            scatter = f"{low} to {high} over {starts} starts"
        found.append(
            Conclusion(
                f"{word.capitalize()} {name.replace('_', ' ')}", typeset_number(factor * float(array[at]), zeros=True),
                unit_words(array[at], unit), scatter, bool(samples[at]) and not scatter,
                f"at {_place(data, values.dims, at)}; {rest}",
            )
        )  # fmt: skip
    return tuple(found)


def _of_best(data: xarray.Dataset, best: BestCase) -> Iterator[Conclusion]:
    """The best design, for each value of the excitation's other axes; of many the first ones."""
    names = {axis: axis_words(data, axis) for axis in axis_names(data)}
    values, starts, samples = data[best.measure], best.starts, single_samples(data).reshape(-1)
    array = values.to_numpy()
    factor, unit = SHOWN_IN.get(values.attrs.get("units", "1"), (1.0, values.attrs.get("units", "1")))
    other, find = ("smallest", np.nanargmin) if best.better == "large" else ("largest", np.nanargmax)
    most = np.unravel_index(int(find(array)), array.shape)
    rest = f"the {other} is {_text(array[most], values.attrs)}, at {_place(data, values.dims, most)}"
    shown = best.designs[:MOST_NAMED]
    for design in shown:
        level = f"for {told(best, design.at, names)}: " if design.at else ""
        if design.reason:
            yield Conclusion(label_of(best).capitalize(), "none", note=f"{level}{design.reason}")
            continue
        scatter = ""
        if starts > 1 and f"{best.measure}_low" in data:
            low, high = (
                _text(data[f"{best.measure}{end}"].to_numpy().reshape(-1)[design.case], values.attrs)
                for end in ("_low", "_high")
            )
            scatter = f"{low} to {high} over {starts} starts"
        notes = tuple(design_notes(best, design, names))
        more = more_designs(best) if design is shown[-1] else ""
        yield Conclusion(
            label_of(best).capitalize(), typeset_number(factor * design.value, zeros=True),
            unit_words(design.value, unit),
            scatter, bool(samples[design.case]) and not scatter,
            "; ".join(filter(None, (f"{level}at {told(best, design.values, names)}", rest, more))), notes,
        )  # fmt: skip


def _place(data: xarray.Dataset, dims: tuple[Any, ...], index: Any) -> str:
    """Values of the axes of a case."""
    chosen = dict(zip(dims, (int(i) for i in index), strict=True))
    return ", ".join(_value(data.isel(chosen), name) for name in axis_names(data))


def _value(one: xarray.Dataset, name: str) -> str:
    """The value of an axis in one case."""
    names = value_words(one, name)
    shown = _text(one[name].item(), one[name].attrs) if names is None else f"{names[0]}{_unit_of_words(one, name)}"
    return f"{axis_words(one, name)} {shown}"


def _text(value: Any, attributes: Mapping[str, Any]) -> str:
    """A value with its unit."""
    return unit_text(value, attributes.get("units", "1"))


def study_missing(data: xarray.Dataset) -> tuple[str, ...]:
    """A line on the cases that were not run; none where all were."""
    finished = data["finished"].to_numpy()
    left = int(np.count_nonzero(finished == 0))
    if not left:
        return ()
    return (f"{left} of {finished.size} cases: the study was not finished; the same femimpact study goes on with it",)


def study_failures(data: xarray.Dataset) -> tuple[str, ...]:
    """A line on the cases with failed starts, and the reason of the first; none where no start failed."""
    failed = data["failed_starts"].to_numpy()
    if not failed.any():
        return ()
    first = next((str(reason) for reason in data["failure"].to_numpy().ravel() if reason), "not known")
    return (f"{int(np.count_nonzero(failed))} of {failed.size} cases have starts that failed, the first: {first}",)


def study_versions(data: xarray.Dataset) -> dict[str, Any]:
    """Versions and seeds of a study, by the names that a summary has for them."""
    versions = {name: data.attrs[name] for name in ("femimpact", "numpy", "scipy", "python") if name in data.attrs}
    starts = int(data.attrs["starts"])
    seeds = [f"{data.attrs['seed']} of the {starts} starts"] if starts > 1 else []
    seeds += [f"sample: {data.attrs['sample']}"] if "sample" in data.attrs else []
    return {"versions": versions, "seeds": "; ".join(seeds)}
