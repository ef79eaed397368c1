"""Conclusions of a report of results. A file of the results that cannot be read is noted."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeGuard, TypeVar

import numpy as np

from femimpact.app.parametric.best import UNMET, best_cases
from femimpact.app.parametric.best_design import (
    MOST_NAMED,
    BestCase,
    design_notes,
    label_of,
    limit_words,
    limited_words,
    more_designs,
    told,
)
from femimpact.app.report.page import Conclusion
from femimpact.app.results.picture_data import ResultReading
from femimpact.app.results.result_directory import FILES
from femimpact.app.study.findings import (
    START_WORDS,
    ContactSummary,
    CurveSummary,
    Findings,
    HistorySummary,
    Spread,
    history_words,
)
from femimpact.app.study.prepared import ROOT_STRESS
from femimpact.excitation.drives import Rest
from femimpact.figures.study_labels import axis_names, axis_words, measure_names, single_samples, value_words
from femimpact.orbits.figures import MARKS, kind_words
from femimpact.response.regimes import FREE_DECAY
from femimpact.units import (
    SHOWN_IN,
    counted,
    interval_texts,
    name_words,
    number_text,
    prefixed,
    quantity_text,
    ranges_text,
    typeset_number,
    unit_text,
    unit_words,
)

if TYPE_CHECKING:
    import xarray

T = TypeVar("T")

ANSWER_DIGITS = 5
"""Of ends of stable ranges; the tables have them all."""

ORDERED = "of the response without contacts"
"""What has an order of convergence. Forces of contacts have none, and take more modes."""

NEEDED, PEAK = "Needed: ", "Peak of "
"""Beginnings of labels of conclusions of which the answer is made."""


def best_of(results: ResultReading) -> tuple[Mapping[str, BestCase], Mapping[str, str]]:
    """Best cases of a parameter study by their measures, and reasons for which there is none."""
    data, plan = results.parameter_study, None if results.study is None else results.study.plan
    if data is None:
        return {}, {}
    name, chosen = FILES["parameter_study"].name, None if plan is None else plan.best
    return results.attempt(name, lambda: best_cases(data, chosen)) or ({}, {})


def result_conclusions(
    results: ResultReading, best: tuple[Mapping[str, BestCase], Mapping[str, str]]
) -> tuple[Conclusion, ...]:
    """What is concluded from a directory of results, on its page and on the terminal alike."""
    columns, data = results.table(FILES["convergence_summary"].name), results.parameter_study
    accuracy, name = results.findings.accuracy, FILES["parameter_study"].name
    chosen = None if results.study is None or results.study.plan is None else results.study.plan.best
    return (
        *conclusions_of(results.findings, (None if chosen is None else chosen.limits) or {}),
        *(results.attempt("conclusions", lambda: convergence_conclusions(columns, accuracy)) or ()),
        *(() if data is None else results.attempt(name, lambda: study_conclusions(data, *best)) or ()),
    )


def answer_of(findings: Findings, conclusions: Sequence[Conclusion]) -> str:
    """What was found, in a sentence; empty where nothing was."""
    empty, ball = (findings.sweep.get(case) for case in ("empty", "ball"))
    if empty is not None and ball is not None and _known(empty.peak_amplitude) and _known(ball.peak_amplitude):
        return _answer_of_sweep(findings, empty, ball)
    history, without = findings.history, findings.history_without
    if history is not None and without is not None:
        starts = findings.history_starts
        median = (history.peak, history.rms) if starts is None else (starts.peak.median, starts.rms.median)
        answer = answer_of_runs(findings.carried, (without.peak, without.rms), median, findings.observed)
        # a spring moves the beam without an impact
        untouched = history.impacts == 0 and starts is None and "absorber" not in findings.carried
        return f"Without an impact t{answer[1:]}" if untouched and answer else answer
    needed = [one for one in conclusions if one.label.startswith(NEEDED)]
    if needed:
        counts = " and ".join(f"{one.value} {one.label.removeprefix(NEEDED)}" for one in needed)
        asked = f"relative error of {findings.accuracy:g}" if findings.accuracy is not None else "small error"
        return f"A {asked} {ORDERED} takes {counts}."
    if findings.orbits is not None and findings.orbits.branches:
        one, plural = conclusions[0], "es" * (len(findings.orbits.branches) > 1)
        return f"{one.value} branch{plural} of periodic orbits {one.note}."
    if not conclusions:
        return ""
    unmet = conclusions[0].note.partition(f"no best case: {UNMET}")[2].partition(";")[0]
    if unmet:
        return f"{UNMET.capitalize()}{unmet}."
    # of a history its peak, of a study what is best
    one = next((each for each in conclusions if each.label == f"{PEAK}{findings.observed}"), conclusions[0])
    of = one.note.partition("; ")[0]
    kind = f"; {findings.history.regime.label}" if one.label.startswith(PEAK) and findings.history is not None else ""
    return f"{one.label}: {one.value} {one.unit}".rstrip() + f"{f', {of}' if of else ''}{kind}."


def _answer_of_sweep(findings: Findings, empty: CurveSummary, ball: CurveSummary) -> str:
    """By how much the largest motion differs with what the structure carries."""
    start: Mapping[str, Spread] = next((findings.starts[one] for one in START_WORDS if one in findings.starts), {})
    median = {name: spread.median for name, spread in start.items() if _known(spread.median)}
    peak = median.get("peak_amplitude", ball.peak_amplitude)
    frequency = median.get("peak_frequency", ball.peak_frequency)
    ratio = median.get("amplitude_ratio", empty.peak_amplitude / peak)
    verb, factor = _change(findings.carried, ratio)
    least = "at least " if empty.resolved is False else ""
    if least and factor != SAME:
        factor = f"{least if ratio >= 1.0 else 'at most '}{factor}"
    return (
        f"The {findings.carried} {verb} the largest motion of {findings.observed} from {least}"
        f"{quantity_text(empty.peak_amplitude, 'm', 3)} at {number_text(empty.peak_frequency, 3)} Hz to "
        f"{quantity_text(peak, 'm', 3)} at {number_text(frequency, 3)} Hz: {factor}."
    )


def answer_of_runs(
    carried: str, without: tuple[float, float], found: tuple[float, float], place: str = "the tip"
) -> str:
    """By how much rms and peak (m) of a place differ with what the structure carries; "" where they are not known."""
    texts = []
    for name, before, after in zip(("largest motion", "rms"), without, found, strict=True):
        if before > 0.0 and after > 0.0:
            verb, factor = _change(carried, before / after)
            size = quantity_text(after, "m", 3)
            change = f", {size}" if factor == SAME else f" from {quantity_text(before, 'm', 3)} to {size}, {factor}"
            texts.append(f"{verb} the {name} of {place}{change}")
    return f"The {carried} {', and '.join(reversed(texts))}." if texts else ""


def _change(carried: str, ratio: float) -> tuple[str, str]:
    """What a body does by the ratio of a motion without it to that with it, and by how much."""
    one, factor = not (carried.endswith("s") or " and " in carried), factor_words(ratio)
    verb = "hardly change" if factor == SAME else "lower" if ratio >= 1.0 else "raise"
    return f"{verb}{'s' * one}", factor


SAME = "the same to three digits"


def factor_words(ratio: float) -> str:
    """By how much the second of two motions differs from the first, by the ratio of the first to it."""
    factor = number_text(max(ratio, 1.0 / ratio), 3)
    return SAME if factor == "1" else f"{factor} times {'less' if ratio >= 1.0 else 'more'}"


def than_words(ratio: float) -> str:
    """The same before the name of the first of them."""
    factor = factor_words(ratio)
    return f"{factor} {'as' if factor == SAME else 'than'}"


def result_warnings(results: ResultReading) -> tuple[str, ...]:
    """What is warned of in a directory of results, on its page and on the terminal alike."""
    data, name = results.parameter_study, FILES["parameter_study"].name
    failures = () if data is None else results.attempt(name, lambda: study_failures(data)) or ()
    return (*results.findings.warnings, *failures)


NO_LIMITS: Mapping[str, float] = {}


def conclusions_of(findings: Findings, limits: Mapping[str, float] = NO_LIMITS) -> tuple[Conclusion, ...]:
    """Conclusions of a summary: peaks, damping, regime, stresses, forces, frequencies, energy; what it has of them.

    Stresses and moments stand beside the limits that the study gives them, by the names of their channels.
    """
    return (
        *_peaks(findings),
        *_ratio(findings),
        # of a sweep the cards have the stress, and the table the rest of its history
        *(_stresses(findings, limits) if findings.sweep else ()),
        *_damping(findings),
        *_history(findings),
        *(() if findings.sweep else _stresses(findings, limits)),
        *_contacts(findings),
        *_frequencies(findings),
        *_energy(findings),
        *_orbits(findings),
    )


def _orbits(findings: Findings) -> list[Conclusion]:
    """How many branches of periodic orbits there are, and where their orbits are stable."""
    orbits = findings.orbits
    if orbits is None or not orbits.branches:
        return []
    ranges = {i: branch.stable for i, branch in enumerate(orbits.branches, 1) if branch.stable}
    stable = [f"branch {i} {ranges_text(each, orbits.unit, 2, ANSWER_DIGITS)}" for i, each in ranges.items()]
    where = f"stable: {'; '.join(stable[:MOST_NAMED])}" if stable else "no stable orbits"
    if len(stable) > MOST_NAMED:
        where += f"; and orbits of {len(stable) - MOST_NAMED} more branches"
    # two branches share the point at which they meet
    places = {(each.kind, f"{each.value:.9g}") for branch in orbits.branches for each in branch.bifurcations}
    kinds = Counter(kind for kind, _ in places)
    details = tuple(f"{kind_words(kind)}: {kinds[kind]}" for kind in MARKS if kind in kinds)
    note = f"over {orbits.parameter}, on {counted(orbits.modes, 'mode')}; {where}"
    return [Conclusion("Branches of periodic orbits", str(len(orbits.branches)), note=note, details=details)]


def _four_digits(value: float) -> str:
    """Four digits, those at the end that are zero among them."""
    return str(int(value)) if value == int(value) and abs(value) >= 1000.0 else typeset_number(value, zeros=True)


def number_conclusion(label: str, value: float, unit: str, **more: Any) -> Conclusion:
    """The conclusion of a number, in the unit that fits."""
    factor, unit = prefixed(abs(value), unit)
    return Conclusion(label, _four_digits(factor * value), "" if unit == "1" else unit, **more)


TRANSIENT = "a transient of the start has not died out"


def _known(value: float | None) -> TypeGuard[float]:
    """Whether a number is known, and finite."""
    return value is not None and math.isfinite(value)


def _settling(part: CurveSummary | HistorySummary) -> str:
    return f"; {TRANSIENT}" if part.peak_is_transient else ""


def _peaks(findings: Findings) -> Iterator[Conclusion]:
    for case, words in (("empty", f"without {findings.carried}"), ("ball", f"with {findings.carried}")):
        curve = findings.sweep.get(case)
        if curve is None or not (_known(curve.peak_amplitude) and _known(curve.peak_frequency)):
            continue
        label = f"Largest peak {words}"
        several = _from_starts(findings, "peak_amplitude", label, "m") if case == "ball" else []
        if several:
            at = _from_starts(findings, "peak_frequency", "", "Hz")
            ends = f" ({at[0].scatter.partition(' over')[0]})" if at and " over" in at[0].scatter else ""
            yield from (replace(one, note=f"at {at[0].value} Hz{ends}" if at else "") for one in several)
            continue
        coarse = curve.resolved is False and _known(curve.peak_too_low_at_most)
        yield number_conclusion(
            label,
            curve.peak_amplitude,
            "m",
            scatter=f"may be read up to {typeset_number(100 * curve.peak_too_low_at_most, 2)} % too low"
            if coarse
            else "",
            one_sample=curve.peak_is_one_start,
            note=f"at {typeset_number(curve.peak_frequency)} Hz, relative to the base{_settling(curve)}",
        )


def _of_spread(spread: Spread, label: str, unit: str, words: str, **more: Any) -> Conclusion:
    """A median with its range in words."""
    text, unit = spread.in_unit_that_fits(unit)
    value, _, scatter = text.partition(" (")
    scatter = f"{scatter.rstrip(')')} over {words}" if scatter else words
    return Conclusion(label, value, "" if unit == "1" else unit, scatter, **more)


def _from_starts(findings: Findings, name: str, label: str, unit: str) -> list[Conclusion]:
    """A quantity that was taken over several starts, in the first frame of them."""
    count = findings.starts_of_sweep
    spreads = [(words, findings.starts.get(start, {}).get(name)) for start, words in START_WORDS.items()]
    known = [(words, spread) for words, spread in spreads if spread is not None and _known(spread.median)]
    if not known:
        return []
    words, first = known[0]
    # of a run the balls are drawn, and the structure is at rest
    text = f"starts {words}" if count is None else f"{count} starts of the {findings.carried}, the beam {words}"
    return [_of_spread(first, label, unit, text)]


def _of_history(
    findings: Findings,
    history: HistorySummary,
    spread: Spread | None,
    value: float | None,
    label: str,
    unit: str,
    **more: Any,
) -> list[Conclusion]:
    """A quantity of the history: its median and range over several starts, else its value; none where it has none."""
    if spread is not None and findings.history_starts is not None and _known(spread.median):
        words = f"{findings.history_starts.count} starts of the {findings.carried}"
        return [_of_spread(spread, label, unit, words, **more)]
    if not _known(value):
        return []
    return [number_conclusion(label, value, unit, one_sample=history.peak_is_one_start, **more)]


def _ratio(findings: Findings) -> list[Conclusion]:
    carried = findings.carried
    them = "them" if carried.endswith("s") or " and " in carried else "it"
    label = f"Peak without {carried} over peak with {them}"
    several = _from_starts(findings, "amplitude_ratio", label, "1")
    if several or not _known(findings.amplitude_ratio):
        return several
    sample = any(curve.peak_is_one_start for curve in findings.sweep.values())
    return [Conclusion(label, _four_digits(findings.amplitude_ratio), one_sample=sample)]


DROP = "Equivalent damping by the drop of the peak"
"""With impacts the width of a peak is no damping."""


def _damping(findings: Findings) -> Iterator[Conclusion]:
    empty, ball = findings.sweep.get("empty"), findings.sweep.get("ball")
    # a stop bounds the motion, which is no damping
    of_drop = "stop" not in findings.carried
    several = _from_starts(findings, "damping_amplitude_ratio", DROP, "%") if of_drop else []
    yield from several
    if of_drop and not several and ball is not None and _known(ball.damping_amplitude_ratio):
        yield Conclusion(
            DROP,
            _four_digits(100 * ball.damping_amplitude_ratio),
            "%",
            one_sample=ball.peak_is_one_start,
            note=f"damping without {findings.carried} times the ratio",
        )
    if empty is not None and _known(empty.damping_fit):
        ratio, words = _four_digits(100 * empty.damping_fit), ""
        if all(map(math.isfinite, empty.damping_fit_interval)):
            ratio, low, high = interval_texts(*(100 * one for one in (empty.damping_fit, *empty.damping_fit_interval)))
            words = f"95 % interval {low} to {high} %"
        half, coarse = empty.damping_half_power, " (not resolved)" if empty.resolved is False else ""
        details = (f"as a check: by half-power {typeset_number(100 * half)} %{coarse}",) if _known(half) else ()
        label = f"Damping ratio without {findings.carried}"
        yield Conclusion(label, ratio, "%", words, note="one-pole fit of the curve", details=details)


def _history(findings: Findings) -> Iterator[Conclusion]:
    """Of a history: its kind of motion, where it has a cycle, and the peak of the observed place.

    Over several starts each number is the median with its range.
    """
    history, starts = findings.history, findings.history_starts
    if history is None:
        return
    cyclic, label = history.frequency is not None, history.regime.label
    at = (
        f"of the history at {typeset_number(history.frequency)} Hz"
        if history.frequency is not None
        else f"of the history: {Rest.words}"
        if label == FREE_DECAY
        else "of the history"
    )
    # without a cycle nothing could repeat
    if cyclic or label in ("no impacts", FREE_DECAY):
        rate = (
            f"{_four_digits(history.impacts_per_cycle)} impacts in a cycle" if _known(history.impacts_per_cycle) else ""
        )
        yield Conclusion("Kind of motion", label, scatter=rate, note=at)
    over = f"over the last third of the cycles {at}" if cyclic else history.window_of_peaks
    of_peak, of_rms = (None, None) if starts is None else (starts.peak, starts.rms)
    rms = history_words(of_rms, history.rms, "m")
    details = (f"rms {rms} {history.window_of_peaks}{f'; the motion is {history.steadiness}' if cyclic else ''}",)
    yield from _of_history(
        findings,
        history,
        of_peak,
        history.peak,
        f"{PEAK}{findings.observed}",
        "m",
        note=over + _settling(history),
        details=details if rms else (),
    ) or [Conclusion(f"{PEAK}{findings.observed}", "none", note="the history is shorter than a cycle")]
    without = findings.history_without
    if without is not None:
        label, rms = f"{PEAK}{findings.observed} without {findings.carried}", history_words(None, without.rms, "m")
        note, details = over + _settling(without), (f"rms {rms} {without.window_of_peaks}",)
        sample = without.peak_is_one_start
        yield number_conclusion(label, without.peak, "m", one_sample=sample, note=note, details=details)


def _stresses(findings: Findings, limits: Mapping[str, float]) -> Iterator[Conclusion]:
    """The largest of every stress and moment of a history, and that without what the structure carries.

    On a sine of the base the latter is of the steady motion: at the peak of the sweep, else at the history's frequency.
    """
    history, starts, carried = findings.history, findings.history_starts, findings.carried
    empty, without = findings.sweep.get("empty"), findings.history_without
    carries = bool(findings.contacts) or "absorber" in carried
    cycle = None if history is None else history.frequency
    at = "" if cycle is None else f" at {typeset_number(cycle)} Hz"
    for name, channel in {} if history is None else history.channels.items():
        if history is None or channel.unit not in ("Pa", "N m"):
            continue
        label = f"Largest {name_words(name)}"
        spread = None if starts is None else starts.channels.get(name, {}).get("largest_of_run")
        when = "" if spread else f", {typeset_number(channel.time_of_largest)} s after its start"
        with_it = f"{label} with {carried}" if carries else label
        note = f"of the whole history{at}{when}"
        size, unit = channel.largest_of_run if spread is None else spread.highest, channel.unit
        beside = (limit_words(name, size, limits[name], unit),) if name in limits else ()
        yield from _of_history(
            findings, history, spread, channel.largest_of_run, with_it, unit, note=note, details=beside
        )
        if without is not None and name in without.channels:
            bare = without.channels[name].largest_of_run
            yield number_conclusion(f"{label} without {carried}", bare, channel.unit, note="of the whole history")
    label, at_history = f"Largest {name_words(ROOT_STRESS)} without {carried}", None
    if history is not None and _known(history.root_stress_without):
        at_history = history.root_stress_without
    if empty is not None and _known(empty.root_stress):
        note = f"at {typeset_number(empty.peak_frequency)} Hz, where the peak of the sweep is"
        details = (f"{unit_text(at_history, 'Pa')}{at}, steady",) if at_history is not None else ()
        yield number_conclusion(label, empty.root_stress, "Pa", note=note, details=details)
    elif at_history is not None:
        yield number_conclusion(label, at_history, "Pa", note=f"steady{at}")


def _contacts(findings: Findings) -> Iterator[Conclusion]:
    history, starts = findings.history, findings.history_starts
    if starts is None:
        yield from _from_starts(findings, "cycle_mean_force", "Cycle-averaged contact force", "N")
        yield from _from_starts(findings, "peak_force", "Largest contact force", "N")
    if history is None:
        return
    for name, contact in findings.contacts.items():
        if contact.impacts == 0:
            yield Conclusion(f"Impacts of {name}", "none", note="in the run")
            continue
        spreads = starts.contacts.get(name, {}) if starts is not None else {}
        count, third = f"{contact.impacts} impacts of the run", "over the last third"
        # a rigid law has no force
        rigid = not _known(contact.peak_force)
        key, what, unit = ("largest_impulse", "impulse", "N s") if rigid else ("peak_force", "force", "N")
        over = "of the whole run" if rigid else history.window_of_peaks
        impulse = history_words(spreads.get("mean_impulse"), contact.mean_impulse, "N s")
        details = (*([f"mean impulse {impulse} {history.window_of_peaks}"] if impulse else []), _restitution(contact))
        yield from _of_history(
            findings,
            history,
            spreads.get(key),
            getattr(contact, key),
            f"Largest {what} of {name}",
            unit,
            note=f"{over}; law: {contact.law}; {count}",
            details=details,
        )
        # without a cycle nothing may move over the last third
        if history.frequency is None:
            continue
        yield from _of_history(
            findings,
            history,
            spreads.get("cycle_mean_force"),
            contact.cycle_mean_force,
            f"Cycle-averaged force of {name}",
            "N",
            note=f"{third}; {count}",
        )


def _restitution(contact: ContactSummary) -> str:
    """Restitution of a contact's law, with the step where the method has one, and of the run's impacts."""
    words = f"restitution {number_text(contact.restitution)} of the law"
    if contact.achieved_by == "step":
        words += f", {number_text(contact.achieved_restitution.mean)} with this step"
    if not _known(contact.observed_restitution):
        return words
    return (
        f"{words}; the run's impacts rebound with {number_text(contact.observed_restitution)} of their approach speed "
        f"(median; the beam moves meanwhile)"
    )


def _frequencies(findings: Findings) -> Iterator[Conclusion]:
    for case, words in (("empty", f"without {findings.carried}"), ("glued", "with the balls glued on")):
        for first in findings.natural_frequency.get(case, ())[:1]:
            yield number_conclusion("First natural frequency", first, "Hz", note=words)


def _energy(findings: Findings) -> Iterator[Conclusion]:
    if _known(findings.energy_residual):
        note = "of the energy put in: a check of the computation"
        yield Conclusion("Energy unaccounted for", typeset_number(100 * findings.energy_residual, 2), "%", note=note)


def convergence_conclusions(
    columns: Mapping[str, Any] | None,  # or None: as of `convergence_summary.csv`
    accuracy: Any = None,  # relative error that was asked for
) -> tuple[Conclusion, ...]:
    """The numbers with which every quantity that has an order is accurate, over each axis."""
    if columns is None or not {"axis", "quantity", "recommended", "expected_order"} <= set(columns):
        return ()
    words = {"mesh": "elements", "step": "steps in the first period", "modes": "modes"}
    axes, conclusions = np.asarray(columns["axis"]), []
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
        conclusions.append(
            Conclusion(
                f"{NEEDED}{words.get(axis, axis)}",
                f"{recommended[worst]:.0f}",
                scatter=f"{asked}{known_for}, {ORDERED}",
                note=f"most for {columns['quantity'][worst]}",
            )
        )
    return tuple(conclusions)


# ---- of a parameter study ------------------------------------------------------------------------


MOST_NAMES = 20
"""Values of an axis of names that are listed."""

MOST_MEASURES = 8
"""Measures that have conclusions."""

OF_MOTION = ("peak", "rms", "peak_ratio")
"""Measures of the motion at the observed place."""

NO_BEST_CASES: Mapping[str, BestCase] = {}
NO_REASONS: Mapping[str, str] = {}


def study_lead(data: xarray.Dataset) -> list[str]:
    """Sentences on the cases, starts and axes of a parameter study."""
    sizes, starts = tuple(data["finished"].sizes.values()), int(data.attrs["starts"])
    shape = f" ({' x '.join(map(str, sizes))})" if len(sizes) > 1 else ""
    each = f"{starts} starts each" if starts > 1 else "one start each"
    run = "a case is a run of the whole history, all of which is measured"
    if "cycles" in data.attrs:
        cycles, measured = (int(data.attrs[name]) for name in ("cycles", "measured_cycles"))
        run = f"{cycles} cycles of the base, of which the last {measured} are measured"
    drive = [f"Drive: {data.attrs['drive']}."] if "drive" in data.attrs else []
    return [
        *drive,
        f"Parameter study: {int(np.prod(sizes))} cases{shape}, {each}; {run}, at {data.attrs['place']}.",
        f"Axes: {'; '.join(_axes(data))}.",
    ]


def _axes(data: xarray.Dataset) -> Iterator[str]:
    """Every axis with its reach."""
    for name in axis_names(data):
        words, names, values = axis_words(data, name), value_words(data, name), data[name].to_numpy()
        if names is not None:
            distinct = list(dict.fromkeys(names))
            more = f" and {len(distinct) - MOST_NAMES} more" if len(distinct) > MOST_NAMES else ""
            yield f"{words}: {'; '.join(distinct[:MOST_NAMES])}{more}{_unit_of_labels(data, name)}"
            continue
        low, high = (_text(end, data[name].attrs) for end in (values.min(), values.max()))
        yield f"{words}: {low} to {high}, {np.unique(values).size} values"


def _unit_of_labels(data: xarray.Dataset, name: str) -> str:
    """Unit behind the text labels of an axis: mm of pairs of gaps, whose axis has a `.plus` beside it; else none."""
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
    names = [name for name in measure_names(data) if name not in best and (name in reasons or not best)]
    # what was asked for and cannot be had comes first
    names.sort(key=lambda name: UNMET not in reasons.get(name, ""))
    conclusions = [one for name in best for one in _of_best(data, best[name])][:MOST_MEASURES]
    for name in names[: MOST_MEASURES - len(conclusions)]:
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
        # not "largest largest approach speed"
        label = f"{word.capitalize()} {name_words(name).removeprefix(f'{word} ')}"
        conclusions.append(_of_case(data, name, at, label, f"at {_place(data, values.dims, at)}; {rest}"))
    return tuple(conclusions)


def _of_best(data: xarray.Dataset, best: BestCase) -> Iterator[Conclusion]:
    """The best design, for each value of the excitation's other axes; of many the first ones."""
    names = {axis: axis_words(data, axis) for axis in axis_names(data)}
    values, label = data[best.measure], label_of(best).capitalize()
    array = values.to_numpy()
    other, find = ("smallest", np.nanargmin) if best.better == "large" else ("largest", np.nanargmax)
    most = np.unravel_index(int(find(array)), array.shape)
    rest = f"the {other} is {_text(array[most], values.attrs)}, at {_place(data, values.dims, most)}"
    named = best.designs[:MOST_NAMED]
    for design in named:
        level = f"for {told(best, design.at, names)}: " if design.at else ""
        if design.reason:
            yield Conclusion(label, "none", note=f"{level}{design.reason}")
            continue
        more = more_designs(best) if design is named[-1] else ""
        place = f"{level}at {told(best, design.values, names)}{limited_words(design)}"
        note = "; ".join(filter(None, (place, rest, more)))
        at = np.unravel_index(design.case, array.shape)
        yield _of_case(data, best.measure, at, label, note, tuple(design_notes(best, design, names)))


def _of_case(
    data: xarray.Dataset, measure: str, at: Any, label: str, note: str, details: tuple[str, ...] = ()
) -> Conclusion:
    """The value of a measure in one case, with its range over the starts."""
    attributes, value, starts = data[measure].attrs, float(data[measure].to_numpy()[at]), int(data.attrs["starts"])
    unit = attributes.get("units", "1")
    factor, unit = SHOWN_IN.get(unit, (1.0, unit))
    scatter = ""
    if starts > 1 and f"{measure}_low" in data:
        low, high = (_text(data[f"{measure}{end}"].to_numpy()[at], attributes) for end in ("_low", "_high"))
        scatter = f"{low} to {high} over {starts} starts"
    sample = bool(single_samples(data)[at]) and not scatter
    # that of `femimpact run` is of the last third
    note += "; of the whole history, its start included" * (measure in OF_MOTION and "cycles" not in data.attrs)
    number = typeset_number(factor * value, zeros=True)
    return Conclusion(label, number, unit_words(value, unit), scatter, sample, note, details)


def _place(data: xarray.Dataset, dims: tuple[Any, ...], index: Any) -> str:
    """Values of the axes of a case."""
    chosen = dict(zip(dims, (int(i) for i in index), strict=True))
    return ", ".join(_value(data.isel(chosen), name) for name in axis_names(data))


def _value(one: xarray.Dataset, name: str) -> str:
    """The value of an axis in one case."""
    names = value_words(one, name)
    text = _text(one[name].item(), one[name].attrs) if names is None else f"{names[0]}{_unit_of_labels(one, name)}"
    return f"{axis_words(one, name)} {text}"


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
    """A line on the cases with failed starts, and the reason of the first; and what the study warns of."""
    failed, lines = data["failed_starts"].to_numpy(), list[str]()
    if failed.any():
        first = next((str(reason) for reason in data["failure"].to_numpy().ravel() if reason), "not known")
        count = int(np.count_nonzero(failed))
        lines.append(f"{count} of {failed.size} cases have starts that failed, the first: {first}")
    return (*lines, *data.attrs.get("warnings", "").splitlines())


def study_versions(data: xarray.Dataset) -> Findings:
    """Versions and seeds of a parameter study, which has no summary."""
    versions = {name: str(data.attrs[name]) for name in ("femimpact", "numpy", "scipy", "python") if name in data.attrs}
    starts = int(data.attrs["starts"])
    seeds = [f"{data.attrs['seed']}, of the {starts} starts"] if starts > 1 else []
    seeds += [f"sample: {data.attrs['sample']}"] if "sample" in data.attrs else []
    known = {"sources": str(data.attrs["core"])} if "core" in data.attrs else {}
    return Findings(versions=versions, core=known, seeds=tuple(seeds))
