"""A run from several starts of its balls: what its sweep and its history spread over.

The structure starts as the study says; the balls are drawn, the same ones as in a parameter study of as many starts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from femimpact.app.parametric.definition import ParameterStudy
from femimpact.app.parametric.runs import drawn_state, unit_draws
from femimpact.app.parametric.verb import block_cases, run_blocks
from femimpact.app.report.pictures import Report
from femimpact.app.study.findings import Findings, HistoryStarts, Spread
from femimpact.app.study.prepared import PreparedStudy
from femimpact.app.study.study import SweepPlan
from femimpact.app.study.summary import channel_summary, contact_forces, peak_of_history, rms_of_history, spread_of
from femimpact.arrays import Array
from femimpact.errors import DivergenceError
from femimpact.integrators.cases import workers_of
from femimpact.integrators.runs import integrate
from femimpact.sweep.curve import FrequencyResponse

SEED = 0
"""Of the starts of a run."""

SEEDS = (f"{SEED} of the further starts",)

OF_CHANNELS = ("largest", "rms", "largest_of_run")

OF_CURVES = ("peak", "cycle_mean_force", "peak_force", "mean_impulse")
"""Measures of a curve."""


@dataclass(frozen=True, eq=False)
class StartCurves:
    """Curves over the frequency of the base, each from another start of the balls."""

    frequency: Array  # (n,) Hz
    measures: Mapping[str, Array]  # `OF_CURVES`, (starts, n): m, N, N and N s

    @property
    def starts(self) -> int:
        """Number of the curves."""
        return len(self.measures["peak"])


def drawn_curves(
    prepared: PreparedStudy,
    empty: FrequencyResponse,  # without balls, over the same frequencies
    report: Report,
) -> tuple[StartCurves, Findings]:
    """The sweep with balls from each of the `starts` of [sweep], and which have none: their motion diverged.

    Raises `DivergenceError` where all starts fail.
    """
    study, plan = prepared.study, cast(SweepPlan, prepared.study.sweep)
    level = zip(empty.frequency.tolist(), empty.base_amplitude.tolist(), strict=True)
    cases = [{"base.frequency": f, "base.amplitude": amplitude, "base.start": study.start} for f, amplitude in level]
    definition = ParameterStudy(
        prepared.small, cases, OF_CURVES, starts=plan.starts, seed=SEED, cycles=plan.cycles, method=prepared.method,
        at=prepared.small.default_place,
    )  # fmt: skip
    values = np.full((len(cases), plan.starts, len(OF_CURVES)), np.nan)
    reasons = np.full((len(cases), plan.starts), "", dtype=object)
    blocks = block_cases(definition)
    for number, block in enumerate(run_blocks(definition, blocks, workers_of(None)), start=1):
        values[block.cases] = block.values
        reasons[block.cases] = np.reshape(block.failures, (-1, plan.starts))
        report(f"sweep with {prepared.carried}, {plan.starts} starts", number / len(blocks))
    has_failed = (reasons != "").all(axis=0)
    failed = {f"start {i + 1}": str(reasons[0, i]) for i in np.flatnonzero(has_failed).tolist()}
    said = replace(_failures("sweep", plan.starts, failed), seeds=SEEDS)
    kept = np.moveaxis(values[:, ~has_failed], 0, 1)
    return StartCurves(empty.frequency, {name: kept[..., m] for m, name in enumerate(OF_CURVES)}), said


def drawn_histories(prepared: PreparedStudy, report: Report) -> Findings:
    """Medians and ranges of the numbers of a history over the `starts` of [output], and which of them diverged.

    Raises `DivergenceError` where all starts fail.
    """
    study, small, starts = prepared.study, prepared.small, prepared.study.output.starts
    base, duration = study.excitation, study.history_duration
    record = replace(prepared.record, snapshots=0, ledger=False, state_at=None)
    draws, rows, failed = unit_draws(starts, len(small.balls), SEED), [], dict[str, str]()
    for i in range(starts):
        state = drawn_state(small, prepared.initial, base, duration, draws[i])
        progress = _part_of(report, f"history, {starts} starts", i, starts)
        try:
            run = integrate(small, base, prepared.method, duration, record, state, progress)
        except DivergenceError as error:
            failed[f"start {i + 1}"] = str(error)
            continue
        channels = channel_summary(run)
        rows.append({
            "peak": peak_of_history(run),
            "rms": rms_of_history(run),
            "channels": {name: {key: getattr(about, key) for key in OF_CHANNELS} for name, about in channels.items()},
            "contacts": {pair.name: contact_forces(run, pair.name) for pair in small.contacts if pair.has_walls},
        })  # fmt: skip
    said = _failures("history", starts, failed)
    return replace(said, seeds=SEEDS, history_starts=HistoryStarts(count=len(rows), **_spreads(rows)))


def _failures(part: str, starts: int, failed: Mapping[str, str]) -> Findings:
    """The starts of a part that failed, with the reason of each.

    Raises `DivergenceError` where all of them have failed.
    """
    if not failed:
        return Findings()
    name, why = next(iter(failed.items()))
    if len(failed) == starts:
        raise DivergenceError(f"all {starts} starts have failed, the first: {why}")
    text = f"{part}: {len(failed)} of the further starts failed and are in no range; {name}: {why}"
    return Findings(failed_starts={part: failed}, warnings=(text,))


def _spreads(rows: Sequence[Any]) -> Any:
    """Medians and ranges of numbers in equal tables of tables."""
    if isinstance(rows[0], Mapping):
        return {name: _spreads([row[name] for row in rows]) for name in rows[0]}
    return spread_of(rows)


def _part_of(report: Report, what: str, index: int, count: int) -> Callable[[float], None]:
    """Progress of one of several equal parts."""
    return lambda share: report(what, (index + share) / count)


def spreads_of(
    curves: StartCurves,
    empty: FrequencyResponse,
    step: float,  # Hz: of the even grid, to which the frequency of a peak is known
) -> dict[str, Spread]:
    """Resonance and impacts at it over several starts in one frame: m, Hz, 1, N and N s."""
    at_peak = np.nanargmax(curves.measures["peak"], axis=1)
    largest = {name: values[np.arange(at_peak.size), at_peak].tolist() for name, values in curves.measures.items()}
    peaks = largest.pop("peak")
    ratio = empty.peak_amplitude / np.array(peaks)
    return {
        "peak_amplitude": spread_of(peaks),
        "peak_frequency": spread_of(curves.frequency[at_peak].tolist(), resolution=step),
        "amplitude_ratio": spread_of(ratio),
        "damping_amplitude_ratio": spread_of(empty.damping.ratio * ratio),
        **{name: spread_of(values) for name, values in largest.items()},
    }


def columns_of_starts(curves: Mapping[str, StartCurves]) -> tuple[dict[str, Any], dict[str, str]]:
    """Median, smallest and largest peak of the starts in each frame, over the frequency, and their units."""
    columns: dict[str, Any] = {"frequency": next(iter(curves.values())).frequency}
    units = {"frequency": "Hz"}
    for start, several in curves.items():
        columns[f"{start}_starts"] = np.full(several.frequency.size, several.starts)
        for end, statistic in (("", np.median), ("_low", np.min), ("_high", np.max)):
            columns[f"{start}_peak{end}"] = statistic(several.measures["peak"], axis=0)
            units[f"{start}_peak{end}"] = "m"
    return columns, units
