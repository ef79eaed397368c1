"""How long each frequency of a sweep is run, and which of its base cycles are measured."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from femimpact.errors import checked, in_range, quantity, real_array, require
from femimpact.integrators.answers import SineCases, SineDwells
from femimpact.system.state import State
from femimpact.system.system import System

__all__ = ["LEAST_CYCLES", "cases_of", "dwells_of"]

LEAST_CYCLES = 3
"""Fewest base cycles of a dwell: the last third is measured."""

MOST_CYCLES = 10**9
"""Of a dwell; more is taken for a mistake."""

ROUNDING = 1e-9
"""Of a number of cycles: 4.1 Hz for 10 s are 41 of them."""


def dwells_of(amplitude: float, frequencies: ArrayLike, cycles: Any, duration: Any, window: Any) -> SineDwells:
    """Dwells from a number of cycles, or from a duration and the window at its end.

    Of a duration the whole cycles from t = 0 are run, of a window those that lie within the last of it.

    Parameters
    ----------
    amplitude : float, m
        Of the base.
    frequencies : array_like (n,), Hz
    cycles : int or None
        The last third is measured.
    duration, window : float or None, s
        The window is the last third of the duration by default.

    Returns
    -------
    SineDwells

    Raises
    ------
    InputError
        If neither or both ways are taken, or less than one whole cycle would be measured.
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
        return SineDwells(amplitude, f, np.full(f.size, count), np.full(f.size, count // 3))
    least = LEAST_CYCLES / float(f.min())
    allowed = f"must be a finite number >= {LEAST_CYCLES} base cycles, {least:g} s"
    whole = in_range(duration, quantity("s", at_least=least - ROUNDING, at_most=MOST_CYCLES / float(f.max())))
    require(whole, "duration", duration, "s", allowed)
    duration = float(duration)
    last = duration / 3.0 if window is None else window
    fits = in_range(last, quantity("s", above=0.0, at_most=duration))
    require(fits, "window", window, "s", f"must be > 0 and at most the duration, {duration:g} s")
    run = np.floor(duration * f + ROUNDING).astype(int)
    measured = run - np.ceil((duration - last) * f - ROUNDING).astype(int)
    short = measured < 1
    if np.any(short):
        slowest = float(f[short].min())
        allowed = f"must hold a whole base cycle of every frequency; {math.ceil(2e3 / slowest) / 1e3:g} s always does"
        require(False, "window", last, "s", allowed)
    return SineDwells(amplitude, f, run, measured)


def cases_of(system: System, dwells: SineDwells, state: State, acceleration: float | None) -> SineCases:
    """The dwells with an amplitude for each frequency."""
    count, balls = dwells.frequency.size, len(system.balls)
    amplitude = np.full(count, dwells.amplitude)
    if acceleration is not None:
        amplitude = acceleration / (2.0 * np.pi * dwells.frequency) ** 2
    moved: dict[str, Any] = {}
    for name, none in (("ball_displacement", np.nan), ("ball_velocity", 0.0)):
        values = getattr(state, name)
        # of another size than there are balls: refused with the first start
        fits = values is not None and values.shape == (balls,)
        moved[name] = np.tile(values if fits else np.full(balls, none), (count, 1))
    return SineCases(
        frequency=dwells.frequency,
        amplitude=amplitude,
        phase=np.zeros(count),
        gaps=np.tile(np.array([pair.gaps for pair in system.contacts]).reshape(-1, 2), (count, 1, 1)),
        laws=(tuple(pair.law for pair in system.contacts),),
        law_of=np.zeros(count, dtype=np.int64),
        initial=state,
        cycles=dwells.cycles,
        measured=dwells.measured,
        **moved,
    )
