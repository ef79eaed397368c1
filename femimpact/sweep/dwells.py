"""Dwells of a sweep: its cases, and dwells that are run one by one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import DivergenceError, checked, in_range, quantity, real_array, require
from femimpact.excitation import Sine
from femimpact.excitation.levels import Level, level_at
from femimpact.integrators.cases import SineCases, run_each
from femimpact.integrators.methods import Method
from femimpact.integrators.runs import response_by
from femimpact.progress import Progress
from femimpact.response.channels import Channel, channel_of
from femimpact.response.cycles import ROUNDING, SteadyMotion, samples_by_cycle, steady_motion
from femimpact.response.energy import BALANCED
from femimpact.response.impacts import ImpactStatistics
from femimpact.response.response import Recorder, Response
from femimpact.system.state import State
from femimpact.system.system import System

LEAST_CYCLES = 3
"""Fewest base cycles of a dwell: the last third is measured."""

MOST_CYCLES = 10**9
"""Most cycles of a dwell; more is taken for a mistake."""

ROUNDING_OF_CYCLES = 1e-9
"""Relative rounding allowed in a number of cycles: 4.1 Hz for 10 s are 41 of them."""


def dwell_cycles(
    frequencies: ArrayLike,  # (n,) Hz
    cycles: Any,  # the last third is measured
    duration: Any,  # s: the window is the last third of the duration by default
    window: Any,  # s
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Frequencies of dwells and their base cycles, all and measured, from a number of cycles or from a duration.

    Of a duration all complete cycles from t = 0 are run; measured are those that lie within the window at its end.

    Raises `InputError` if neither or both ways are taken, or less than one whole cycle would be measured.
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


@dataclass(frozen=True, eq=False)
class DwellRun:
    """Results of one dwell."""

    motion: SteadyMotion | None  # of the channel over the measured cycles; None of a dwell that failed
    statistics: ImpactStatistics | None  # over the measured cycles
    residual: float  # largest energy residual; not a number without a ledger
    end: State  # at its end; of a dwell that failed, that at its start
    failure: str = ""  # empty where it has come to its end
    warnings: tuple[str, ...] = ()


def dwells_apart(
    system: System, cases: SineCases, method: Method, channel: Channel, ledger: bool, workers: int,
    progress: Progress | None,
) -> list[DwellRun]:  # fmt: skip
    """Dwells of a channel that all begin with the initial state, spread over threads.

    Raises `InputError` if a dwell cannot be run at all.
    """

    def run(case: int, _: Progress | None) -> DwellRun:
        return _dwell(system, cases, case, cases.initial, method, channel, ledger)

    return list(run_each(run, range(cases.frequency.size), workers, progress))


def dwell_chain(
    system: System, cases: SineCases,
    order: Sequence[int],  # numbers of cases; one may occur more than once
    method: Method, channel: Channel, ledger: bool, progress: Progress | None,
) -> list[DwellRun]:  # fmt: skip
    """Dwells in some order, each of which begins where the last one that has not failed ended.

    The base is at zero where the frequency changes: its displacement is continuous, and the motion relative to it.

    Raises `InputError` if a dwell cannot be run at all.
    """
    state, found = cases.initial, list[DwellRun]()
    for case in order:
        found.append(_dwell(system, cases, case, state, method, channel, ledger))
        state = found[-1].end
        if progress is not None:
            progress(len(found) / len(order))
    return found


def _dwell(
    system: System, cases: SineCases, case: int, start: State, method: Method, channel: Channel, ledger: bool
) -> DwellRun:
    """One dwell: what comes before three times the measured cycles, then these, whose last third is measured."""
    f, amplitude = float(cases.frequency[case]), float(cases.amplitude[case])
    cycles, measured = int(cases.cycles[case]), int(cases.measured[case])
    allowed = "must be at most a third of the dwell where each frequency is a separate run"
    require(3 * measured <= cycles, "window", measured / f, "s", allowed)
    base = Sine(amplitude, f, phase=-2.0 * math.pi * f * start.time)
    state = start
    try:
        if cycles > 3 * measured:
            before = response_by(method, system, base, (cycles - 3 * measured) / f, _recorder((), False), state)
            state = _end_of(before)
        # of the default place every run has the amplitudes
        default = channel == channel_of(system, system.default_place)
        begin = None if default else state.time + (2.0 * measured + ROUNDING) / f
        record = replace(_recorder((), ledger), state_at=begin)
        run = response_by(method, system, base, 3 * measured / f, record, state)
        motion = run.steady if default else _motion(system, base, run, method, channel, measured)
    except DivergenceError as error:
        return DwellRun(None, None, math.nan, start, f"at {f:g} Hz: {error}")
    residual = math.nan if run.energy is None else run.energy.residual
    return DwellRun(motion, run.statistics, residual, _end_of(run), warnings=run.warnings)


def _recorder(channels: tuple[Channel, ...], ledger: bool) -> Recorder:
    """The recorder of a run; of a ledger that does not close the curve warns, not the run."""
    return Recorder(channels, ledger=ledger, memory_limit=1e15, residual_limit=BALANCED)


def _end_of(run: Response) -> State:
    state = run.final_state
    assert state is not None
    return state


def _motion(system: System, base: Sine, run: Response, method: Method, channel: Channel, measured: int) -> SteadyMotion:
    """Amplitudes of a channel over the last third of a run, which is run once more with the channel read."""
    state = run.kept_state
    assert state is not None
    again = response_by(method, system, base, measured / base.frequency, _recorder((channel,), False), state)
    # the first sample is the last one of the cycle before
    cycles = samples_by_cycle(again.time, again.channels[channel.name], base, measured)
    motion = steady_motion(cycles, np.array([measured]))
    return replace(motion, peak=np.array([abs(again.largest(channel).value)]))
