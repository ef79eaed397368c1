"""Dwells of a sweep: its cases, and a chain of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femimpact.arrays import Array
from femimpact.errors import checked, in_range, quantity, real_array, require
from femimpact.excitation import Sine
from femimpact.excitation.levels import Level, level_at
from femimpact.integrators.cases import SineCases, SineDwellResults
from femimpact.integrators.methods import Method
from femimpact.integrators.separate_runs import dwell
from femimpact.progress import Progress
from femimpact.response.channels import Channel, channel_of
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
    exclusive = (cycles is None) != (duration is None)
    require(exclusive, "cycles", cycles, "", "give either cycles (a whole number) or a duration (s)")
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


def dwell_chain(
    system: System, cases: SineCases,
    order: Sequence[int],  # numbers of cases; one may occur more than once
    method: Method, channel: Channel, ledger: bool, progress: Progress | None,
) -> list[SineDwellResults]:  # fmt: skip
    """Dwells in some order, each of which begins where the last one that has not failed ended.

    The base is at zero where the frequency changes: its displacement is continuous, and the motion relative to it.

    Raises `InputError` if a dwell cannot be run at all.
    """
    state, dwells = cases.initial, list[SineDwellResults]()
    default = channel == channel_of(system, system.default_place)
    for case in order:
        result_of_case, state = dwell(method, system, cases, case, state, None if default else channel, ledger)
        dwells.append(result_of_case)
        if progress is not None:
            progress(len(dwells) / len(order))
    return dwells
