"""Several starts of one run: where the balls lie and how they move, and what the runs spread over.

The structure starts as the study says; the balls are drawn, the same ones in a run and in a parameter study.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from femimpact.app.results.result_directory import FILES
from femimpact.app.study.findings import Spread
from femimpact.app.study.prepared import PreparedStudy
from femimpact.app.study.summary import channel_summary, contact_forces, peak_of_history, spread_of
from femimpact.arrays import Array
from femimpact.errors import DivergenceError, FemimpactError
from femimpact.excitation import Excitation, Sine
from femimpact.files import write_csv
from femimpact.integrators.cases import SineCases, with_contacts_of, workers_of
from femimpact.integrators.runs import integrate
from femimpact.sweep import FrequencyResponse
from femimpact.sweep.curve import columns_of_dwells, curve_of, start_of
from femimpact.sweep.dwells import cases_of, dwell_cycles
from femimpact.system.state import State
from femimpact.system.system import System

HISTORY_INSTANTS = 4096
"""Of a motion at which its largest speed is looked for, which scales the speeds of starts."""

SEED = 0
"""Of the starts of a run."""

Report = Callable[[str, float], None]

# ---- where balls start ----------------------------------------------------------------------------


def unit_draws(starts: int, balls: int, seed: int) -> Array:
    """Numbers (starts, balls, 2) from 0 to 1, for the place and the speed of each ball; those of fewer starts first."""
    return np.random.default_rng(seed).random((starts, balls, 2))


def scaled_starts(
    draws: Array,  # (starts, balls, 2)
    gaps: Array,  # (cases, balls, 2) m: to the + and to the - side
    speed: Array,  # (cases,) m/s: amplitude times angular frequency of the base
) -> tuple[Array, Array]:  # (cases, starts, balls) m and m/s
    """Places of balls, uniform in their gaps, and speeds, uniform within +- a speed, relative to the structure.

    The body of an absorber, without walls, is in the middle.
    """
    plus, minus = np.moveaxis(np.where(np.isfinite(gaps), gaps, 0.0)[:, None], -1, 0)
    displacement = -minus + (plus + minus) * draws[None, :, :, 0]
    return displacement, speed[:, None, None] * (2.0 * draws[None, :, :, 1] - 1.0)


def _structure_at_balls(system: System, initial: State, base: Excitation) -> Array:
    """Displacement (m) of the structure at each ball where a run starts, (balls,): of a static state it is not zero."""
    u, *_ = initial.relative_to_base(system, base)
    return np.array([pair.direction @ u for pair in system.balls])


def placed_about_structure(runs: SineCases, common: System) -> SineCases:
    """The runs; those from a static state have their balls placed about the static displacement of the structure."""
    places, known = runs.ball_displacement.copy(), dict[Any, Any]()
    columns = [runs.amplitude, runs.frequency, runs.phase, runs.law_of, runs.gaps.reshape(len(places), -1)]
    rows = np.column_stack(columns)
    for run in range(len(places)):
        system = runs.system(run, common)
        if not (runs.initial.is_static_on(system) or np.any(runs.gaps[run] < 0.0)):
            continue
        key = id(system), rows[run].tobytes()
        if key not in known:
            base = Sine(float(runs.amplitude[run]), float(runs.frequency[run]), float(runs.phase[run]))
            try:
                known[key] = _structure_at_balls(with_contacts_of(system, runs, run), runs.initial, base)
            except FemimpactError:
                # the run itself fails with this error
                known[key] = 0.0
        places[run] += known[key]
    return replace(runs, ball_displacement=places)


def drawn_state(
    system: System,
    initial: State,
    base: Excitation,
    duration: float,  # s: of the run
    draws: Array,  # (balls, 2) of one start, as of `unit_draws`
) -> State:
    """The start of a history with its balls where the numbers have them, about the structure."""
    gaps = np.array([[pair.gaps for pair in system.balls]], dtype=float).reshape(1, len(system.balls), 2)
    placed, moving = (both[0, 0] for both in scaled_starts(draws[None], gaps, _largest_speed(base, duration)))
    if initial.is_static_on(system):
        placed = placed + _structure_at_balls(system, initial, base)
    given: dict[str, Any] = {"ball_displacement": placed} if placed.size else {}
    if np.any(moving):
        given["ball_velocity"] = moving
    return replace(initial, **given)


def _largest_speed(base: Excitation, duration: float) -> Array:
    """Largest speed of the base (m/s), (1,)."""
    if isinstance(base, Sine):
        return np.array([base.amplitude * (2.0 * np.pi * base.frequency)])
    return np.array([float(np.abs(base.velocity(np.linspace(0.0, duration, HISTORY_INSTANTS))).max())])


# ---- runs from several starts ---------------------------------------------------------------------


def drawn_curves(
    prepared: PreparedStudy,
    frequencies: Array,  # (n,) Hz
    report: Report,
) -> tuple[list[FrequencyResponse], dict[str, str]]:
    """The sweep with balls from each of the `starts` of [sweep], and why some have none: their motion diverged.

    A case is that of a parameter study. Raises `DivergenceError` where all starts fail.
    """
    study, small, method = prepared.study, prepared.small, prepared.method
    plan = study.sweep
    if plan is None:
        raise AssertionError("only of a study with a sweep")
    state, level, starts = study.initial, study.sweep_level, plan.starts
    cases = cases_of(
        small, state, level["amplitude"], level["acceleration"], dwell_cycles(frequencies, plan.cycles, None, None)
    )
    draws = unit_draws(starts, len(small.balls), SEED)
    speed = cases.amplitude * (2.0 * np.pi * cases.frequency)
    placed, moving = scaled_starts(draws, cases.gaps[:, : len(small.balls)], speed)
    about = {**level, "cycles": plan.cycles, "at": "tip"}
    about |= {"start": start_of(state, small)}
    found, failed = list[FrequencyResponse](), dict[str, str]()
    row, what = small.point_row("tip"), f"sweep with {prepared.carried}, {starts} starts"
    for i in range(starts):
        drawn = replace(cases, ball_displacement=placed[:, i], ball_velocity=moving[:, i])
        part = placed_about_structure(drawn, small)
        of_start = part_of(report, what, i, starts)
        try:
            results = method.run_cases(small, part, row, 0, workers_of(None), of_start)
        except DivergenceError as error:
            failed[f"start {i + 1}"] = str(error)
            continue
        found.append(curve_of(small, method, part, columns_of_dwells(results, part.frequency, False), about))
    _require_some(found, failed)
    return found, failed


def drawn_histories(prepared: PreparedStudy, report: Report) -> tuple[dict[str, Any], dict[str, str]]:
    """Medians and ranges of the numbers of a history over the `starts` of [output], by their names in a summary.

    Returns these and why some starts have none, as of `drawn_curves`.
    """
    study, small, starts = prepared.study, prepared.small, prepared.study.output.starts
    base, duration = study.excitation, study.history_duration
    record = replace(prepared.record, snapshots=0, ledger=False, state_at=None)
    draws, rows, failed = unit_draws(starts, len(small.balls), SEED), [], dict[str, str]()
    for i in range(starts):
        state = drawn_state(small, study.initial, base, duration, draws[i])
        progress = part_of(report, f"history, {starts} starts", i, starts)
        try:
            run = integrate(small, base, prepared.method, duration, record, state, progress)
        except DivergenceError as error:
            failed[f"start {i + 1}"] = str(error)
            continue
        channels = channel_summary(run)
        rows.append({
            "peak": peak_of_history(run),
            "rms": run.steady.rms[0],
            "channels": {name: {key: getattr(about, key) for key in OF_CHANNELS} for name, about in channels.items()},
            "contacts": {pair.name: contact_forces(run, pair.name) for pair in small.contacts if pair.has_walls},
        })  # fmt: skip
    _require_some(rows, failed)
    return {"count": len(rows), **_spreads(rows)}, failed


def _require_some(found: Sequence[Any], failed: Mapping[str, str]) -> None:
    """Raise `DivergenceError` where all starts have failed."""
    if not found:
        raise DivergenceError(f"all {len(failed)} starts have failed, the first: {next(iter(failed.values()))}")


OF_CHANNELS = ("largest", "rms", "largest_of_run")


def _spreads(rows: Sequence[Any]) -> Any:
    """Medians and ranges of numbers in equal tables of tables."""
    if isinstance(rows[0], Mapping):
        return {name: _spreads([row[name] for row in rows]) for name in rows[0]}
    return asdict(spread_of(rows))


def part_of(report: Report, what: str, index: int, count: int) -> Callable[[float], None]:
    """Progress of one of several equal parts."""
    return lambda share: report(what, (index + share) / count)


def spreads_of(
    curves: Sequence[FrequencyResponse],
    empty: FrequencyResponse,
    step: float,  # Hz: of the even grid, to which the frequency of a peak is known
) -> dict[str, Spread]:
    """Resonance and impacts at it over several starts in one frame: m, Hz, 1, N and N s."""
    at_peak = [int(np.nanargmax(curve.peak)) for curve in curves]
    ratio = empty.peak_amplitude / np.array([curve.peak_amplitude for curve in curves])
    columns = {
        name: spread_of([float(getattr(curve, name)[i]) for curve, i in zip(curves, at_peak, strict=True)])
        for name in ("cycle_mean_force", "peak_force", "mean_impulse")
    }
    return {
        "peak_amplitude": spread_of([curve.peak_amplitude for curve in curves]),
        "peak_frequency": spread_of([curve.peak_frequency for curve in curves], resolution=step),
        "amplitude_ratio": spread_of(ratio),
        "damping_amplitude_ratio": spread_of(empty.damping.ratio * ratio),
        **columns,
    }


def write_curves(folder: Path, curves: Mapping[str, Sequence[FrequencyResponse]]) -> None:
    """Median, smallest and largest peak of the starts in each frame, over the frequency."""
    columns: dict[str, Any] = {"frequency": next(iter(curves.values()))[0].frequency}
    for start, several in curves.items():
        peaks = np.array([curve.peak for curve in several])
        for name, found in (("median", np.median), ("low", np.min), ("high", np.max)):
            columns[f"{start}_{name}"] = found(peaks, axis=0)
    units = {name: "Hz" if name == "frequency" else "m" for name in columns}
    write_csv(folder / FILES["curves_of_starts"].name, columns, units)
