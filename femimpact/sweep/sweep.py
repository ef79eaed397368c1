"""Stepped-sine sweeps."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Any, Literal, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import checked, in_range, level_rows, quantity, real_array, require, require_type, truth, warns
from femimpact.excitation.drives import Rest
from femimpact.excitation.excitation import holds_drives, is_force
from femimpact.excitation.harmonic import Level, Sine, level_at, require_reach
from femimpact.integrators.cases import SineCases, SineDwellResults, joined, workers_of
from femimpact.integrators.channel_rows import drive_of, mode_notes
from femimpact.integrators.methods import Method, require_method
from femimpact.integrators.own_method import dwell, run_cases_apart
from femimpact.progress import Progress, check_progress, draws_progress
from femimpact.response.channels import Channel, channel_of
from femimpact.structure.structure import Position
from femimpact.sweep.curve import (
    OF_THE_CHANNEL,
    FrequencyResponse,
    columns_of_dwells,
    curve_of,
    start_of,
)
from femimpact.system.state import State
from femimpact.system.system import System

LEAST_CYCLES = 3
"""Fewest base cycles of a dwell: the last third is measured."""

MOST_CYCLES = 10**9
"""Most cycles of a dwell; more is taken for a mistake."""

ROUNDING_OF_CYCLES = 1e-9
"""Relative rounding allowed in a number of cycles: 4.1 Hz for 10 s are 41 of them."""


@overload
def frequency_sweep(
    system: System,
    amplitude: float | None = None,
    frequencies: ArrayLike = (),
    method: Method | None = None,
    cycles: int | None = None,
    *,
    direction: Literal["both"],
    acceleration: ArrayLike | None = None,
    channel: Position | Channel | None = None,
    duration: float | None = None,
    window: float | None = None,
    initial: State | None = None,
    at: Position | None = None,
    ledger: bool = True,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> dict[str, FrequencyResponse]: ...


@overload
def frequency_sweep(
    system: System,
    amplitude: float | None = None,
    frequencies: ArrayLike = (),
    method: Method | None = None,
    cycles: int | None = None,
    *,
    direction: Literal["up", "down"] | None = None,
    acceleration: ArrayLike | None = None,
    channel: Position | Channel | None = None,
    duration: float | None = None,
    window: float | None = None,
    initial: State | None = None,
    at: Position | None = None,
    ledger: bool = True,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> FrequencyResponse: ...


@warns
@draws_progress
def frequency_sweep(
    system: System,
    amplitude: float | None = None,
    frequencies: ArrayLike = (),
    method: Method | None = None,
    cycles: int | None = None,
    *,
    direction: Literal["up", "down", "both"] | None = None,
    acceleration: ArrayLike | None = None,
    channel: Position | Channel | None = None,
    duration: float | None = None,
    window: float | None = None,
    initial: State | None = None,
    at: Position | None = None,
    ledger: bool = True,
    threads: int | None = None,
    progress: Progress | bool | None = None,
) -> FrequencyResponse | dict[str, FrequencyResponse]:
    """Stepped-sine sweep: each frequency a separate run from the initial state, or from the last one's end.

    Parameters
    ----------
    system : System
        Reduced systems are fastest.
    amplitude : float, m
        Of the base displacement, the same at all frequencies. Or
    acceleration : float or array_like (k, 2), m/s^2
        the amplitude of the base's acceleration, the same at all frequencies, or rows of a frequency (Hz) and an
        amplitude, straight in a plot of the logarithms.
    frequencies : array_like (n,), Hz
        Of the base, each above 0. Near a resonance they should lie closer than a quarter of its width at half power,
        2 zeta f0.
    method : Newmark, HHT, WBZ, GeneralizedAlpha, MoreauJean or EventDriven
        How the motion is computed. `EventDriven()`, for a reduced system with rigid or Kelvin-Voigt contacts, has no
        step; the others take `dt=recommended_step(system)`.
    cycles : int
        Length of each dwell in base cycles; the last third is measured. Or
    duration : float, s
        its length in time.
    window : float, s
        The end of the duration, of which all complete base cycles are measured. The last third by default.
    direction : {"up", "down", "both"}, optional
        Each frequency begins with the end of the one before it, in rising or falling order; both ways are one chain,
        first up. The base is at zero where the frequency changes, and the motion relative to it goes on. By default
        each begins with the initial state.
    channel : str, float or Channel, optional
        What is measured in place of a displacement, as of `Recorder.channels`: "root.surface_stress".
    initial : State, optional
        At rest in the frame of the base by default. Every run begins at t = 0 s, whatever the state's time.
    at : str or float, optional
        The observed place, whose displacement is measured; `System.default_place` by default, the tip where it moves.
    ledger : bool
        Keep the energy residual of every case; costs about half as much again, event-driven up to as much again.
    threads : int, optional
        The number of cores by default; the results do not depend on it, to the last bit. A chain takes one.
    progress : callable or bool, optional
        Called with the share done, 0 to 1; True draws a bar.

    Returns
    -------
    FrequencyResponse, or a dict of two by the names "up" and "down" where the direction is "both"
        A frequency that diverged is a row of not-a-numbers, "failed", with a warning; the next one of a chain begins
        where that one began. Without contacts there is a warning too where the frequencies are too far apart for the
        peak of the first mode. Of a direction the frequencies of a curve rise, whichever way they were run.

    Raises
    ------
    DivergenceError
        If every frequency diverged.
    """
    state = State() if initial is None else initial
    require_type(system, System, "system")
    require_type(state, State, "initial")
    require_method(method)
    method, state, report = cast(Method, method), replace(state, time=0.0), check_progress(progress)
    ledger = checked("ledger", ledger, truth())
    ways = ("up", "down", "both")
    require(direction is None or direction in ways, "direction", direction, "", f"must be one of {', '.join(ways)}")
    alone = channel is None or at in (None, system.default_place)
    require(alone, "at", at, "", "goes without a channel, which names its own place")
    dwells = dwell_cycles(frequencies, cycles, duration, window)
    amplitude, level = _checked_level(amplitude, acceleration, dwells[0])
    place = system.default_place if at is None else at
    if channel is None:
        moves = bool(np.any(system.point_row(place)))
        require(moves, "at", place, "", f"must be a place that moves; {system.default_place!r} does")
    measured = channel_of(system, place if channel is None else channel)
    about: dict[str, Any] = {
        "amplitude": amplitude,
        "acceleration": level,
        "cycles": None if cycles is None else int(cycles),
        "duration": duration,
        "window": window,
        "at": place if channel is None else measured.name,
        "unit": measured.unit,
        "start": start_of(state, system),
        "notes": mode_notes(system, drive_of(system, Sine(0.0, 1.0)), (measured,)),
    }
    cases, workers = cases_of(system, state, amplitude, level, dwells), workers_of(threads)
    if direction is not None:
        cases = cases.of(np.argsort(cases.frequency, kind="stable"))
        curves = _chained_curves(system, method, cases, direction, measured, ledger, report, about)
        return curves if direction == "both" else curves[direction]
    row = _row(system, measured)
    # methods with steps end a run whose observed value leaves all bounds of a displacement
    size = 1.0 if row is None else max(float(np.max(np.abs(row))), 1e-300)
    scale = 1.0 if measured.unit == "m" or row is None else 2.0 ** math.ceil(math.log2(size))
    if row is None:
        measured_dwells = run_cases_apart(method, system, cases, measured, int(ledger), workers, report)
    else:
        measured_dwells = method.run_cases(system, cases, row / scale, int(ledger), workers, report)
    columns, warnings = columns_of_dwells(measured_dwells, cases.frequency, ledger)
    columns |= {name: scale * columns[name] for name in OF_THE_CHANNEL}
    return curve_of(system, method, cases, columns, warnings, about)


def _checked_level(amplitude: Any, acceleration: Any, frequency: Array) -> tuple[float | None, Level | None]:
    """Amplitude (m) or acceleration (m/s^2) of the base, one of which is given; rows reach over frequencies (Hz)."""
    allowed = "has no frequency to sweep over: integrate runs a free decay, and identify_decay reads its frequencies"
    require(not isinstance(amplitude, Rest), "amplitude", "Rest", "", allowed)
    under = "a sweep moves the base: under a force integrate at each frequency, or take a study file with its axis"
    forced = is_force(amplitude) or holds_drives(amplitude)
    require(not forced, "amplitude", type(amplitude).__name__, "", f"{under} force.NAME.frequency")
    exclusive = (amplitude is None) != (acceleration is None)
    wrong = None if amplitude is None else "both"
    require(exclusive, "amplitude", wrong, "", "must be given alone: one of amplitude (m) and acceleration (m/s^2)")
    if amplitude is None:
        level: Level = checked("acceleration", acceleration, level_rows("m/s^2"))
        require_reach(level, float(frequency.min()), float(frequency.max()))
        return None, level
    return checked("amplitude", amplitude, quantity("m", at_least=0.0)), None


def _chained_curves(
    system: System, method: Method, cases: SineCases, direction: str, channel: Channel, ledger: bool,
    progress: Progress | None, about: dict[str, Any],
) -> dict[str, FrequencyResponse]:  # fmt: skip
    """Curves by their direction, of one chain of dwells: each begins where the last one that has not failed ended.

    The base is at zero where the frequency changes: its displacement is continuous, and the motion relative to it.
    """
    ways = ["up", "down"] if direction == "both" else [direction]
    count = cases.frequency.size
    rising = list(range(count))
    chain = [number for way in ways for number in (rising if way == "up" else rising[::-1])]
    state, runs, curves = cases.initial, list[SineDwellResults](), {}
    observed = None if channel == channel_of(system, system.default_place) else channel
    for case in chain:
        one, state = dwell(method, system, cases, case, state, observed, ledger)
        runs.append(one)
        if progress is not None:
            progress(len(runs) / len(chain))
    for i, way in enumerate(ways):
        part = runs[i * count : (i + 1) * count]
        dwells = joined(part if way == "up" else part[::-1], np.arange(count))
        columns, warnings = columns_of_dwells(dwells, cases.frequency, ledger)
        curves[way] = curve_of(system, method, cases, columns, warnings, {**about, "direction": way})
    return curves


def _row(system: System, channel: Channel) -> Array | None:
    """Row (dofs,) of a channel that reads displacements of the structure alone, or None."""
    reading = channel.reading(system)
    others = [getattr(reading, item.name) for item in fields(reading) if item.name != "displacement"]
    return None if any(np.any(values) for values in others) else np.asarray(reading.displacement)


def dwell_cycles(
    frequencies: ArrayLike,  # (n,) Hz
    cycles: Any,  # the last third is measured
    duration: Any,  # s: the window is the last third of the duration by default
    window: Any,  # s
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Frequencies of dwells and their base cycles, all and measured, from a number of cycles or from a duration.

    Of a duration all complete cycles from t = 0 are run; measured are those that lie within the window at its end.
    """
    allowed = "must be one or more numbers > 0"
    f = np.atleast_1d(real_array("frequencies", frequencies, "Hz", allowed))
    fine = f.ndim == 1 and f.size > 0 and bool(np.all(f > 0))
    require(fine, "frequencies", None, "Hz", allowed)
    one = (cycles is None) != (duration is None)
    require(one, "cycles", cycles, "", "give either cycles (a whole number) or a duration (s)")
    if duration is None:
        require(window is None, "window", window, "s", "goes with a duration, not with cycles")
        count = checked("cycles", cycles, quantity("1", at_least=LEAST_CYCLES, at_most=MOST_CYCLES, integer=True))
        return f, np.full(f.size, count), np.full(f.size, count // 3)
    least = LEAST_CYCLES / float(f.min())
    allowed = f"must be a finite number >= {LEAST_CYCLES} base cycles, {least:g} s"
    most = MOST_CYCLES / float(f.max())
    sound = in_range(duration, quantity("s", at_least=least - ROUNDING_OF_CYCLES, at_most=most))
    require(sound, "duration", duration, "s", allowed)
    duration = float(duration)
    last = duration / 3.0 if window is None else window
    fits = in_range(last, quantity("s", above=0.0, at_most=duration))
    require(fits, "window", window, "s", f"must be > 0 and at most the duration, {duration:g} s")
    run = np.floor(duration * f + ROUNDING_OF_CYCLES).astype(int)
    measured = run - np.ceil((duration - last) * f - ROUNDING_OF_CYCLES).astype(int)
    short = measured < 1
    if np.any(short):
        slowest = float(f[short].min())
        allowed = f"must hold a whole base cycle of every frequency; {math.ceil(2e3 / slowest) / 1e3:g} s always does"
        require(False, "window", last, "s", allowed)
    return f, run, measured


def cases_of(
    system: System,
    state: State,
    amplitude: float | None,  # m: of the base, at all frequencies, or
    acceleration: Level | None,  # m/s^2, or rows of a frequency (Hz) and an acceleration
    dwells: tuple[Array, NDArray[np.int64], NDArray[np.int64]],  # of `dwell_cycles`
) -> SineCases:
    """Cases of a sweep, all from one state."""
    frequency, cycles, measured = dwells
    count, balls = frequency.size, len(system.balls)
    omega = 2.0 * np.pi * frequency
    amplitudes = np.full(count, amplitude) if acceleration is None else level_at(acceleration, frequency) / omega**2
    moved: dict[str, Any] = {}
    for name, none in (("ball_displacement", np.nan), ("ball_velocity", 0.0)):
        values = getattr(state, name)
        if values is not None and values.shape != (balls,):
            # refused, with the numbers of both
            state.relative_to_base(system, Sine(float(amplitudes[0]), float(frequency[0])))
        moved[name] = np.tile(np.full(balls, none) if values is None else values, (count, 1))
    return SineCases(
        frequency=frequency,
        amplitude=amplitudes,
        phase=np.zeros(count),
        gaps=np.tile(np.array([pair.gaps for pair in system.contacts]).reshape(-1, 2), (count, 1, 1)),
        laws=(tuple(pair.law for pair in system.contacts),),
        law_of=np.zeros(count, dtype=np.int64),
        initial=state,
        cycles=cycles,
        measured=measured,
        **moved,
    )
