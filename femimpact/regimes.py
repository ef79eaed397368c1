"""Which kind of motion a window of impacts shows: k impacts in n cycles, riding, chatter, or nothing that repeats."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from femimpact.errors import require

__all__ = ["Regime", "classify", "impacts_per_cycle", "significant"]

SHORTEST_CHATTER = 4
"""Impacts on one wall, one slower and sooner than the other, that make a chatter."""


class ImpactTable(Protocol):
    """Columns of `impacts.Impacts` that tell one motion from another."""

    @property
    def time(self) -> NDArray[Any]: ...  # noqa: D102
    @property
    def phase(self) -> NDArray[Any]: ...  # noqa: D102
    @property
    def impactor(self) -> NDArray[Any]: ...  # noqa: D102
    @property
    def side(self) -> NDArray[Any]: ...  # noqa: D102
    @property
    def approach_speed(self) -> NDArray[Any]: ...  # noqa: D102
    @property
    def impulse(self) -> NDArray[Any]: ...  # noqa: D102
    @property
    def dropped(self) -> int: ...  # noqa: D102


class RidingTable(Protocol):
    """Columns of `impacts.Riding` that tell when something rides."""

    @property
    def start(self) -> NDArray[Any]: ...  # noqa: D102
    @property
    def end(self) -> NDArray[Any]: ...  # noqa: D102


@dataclass(frozen=True)
class Regime:
    """Kind of motion in a time window.

    Parameters
    ----------
    kind : str
        "none", "periodic", "riding", "chatter", "irregular", or "undecided" where the window is too
        short or its table incomplete.
    impacts, cycles : int
        Significant impacts in that many base cycles, after which they repeat; 0 where nothing repeats.
        Riding and chattering motions may repeat too.
    label : str
        In words, as "2:1 periodic".
    criterion : str
        What was asked of the motion, with the numbers.
    """

    kind: str
    impacts: int
    cycles: int
    label: str
    criterion: str


@dataclass(frozen=True, eq=False)
class _Window:
    """Impacts of a window in order of time, and the window."""

    start: float
    end: float
    frequency: float
    time: NDArray[Any]
    phase: NDArray[Any]
    impactor: NDArray[Any]
    side: NDArray[Any]
    speed: NDArray[Any]

    @property
    def cycles(self) -> int:
        """Whole base cycles in the window."""
        # a window meant as ten cycles must not count nine by rounding
        return math.floor((self.end - self.start) * self.frequency + 1e-6)

    def only(self, chosen: NDArray[Any]) -> _Window:
        columns = (self.time, self.phase, self.impactor, self.side, self.speed)
        return _Window(self.start, self.end, self.frequency, *(column[chosen] for column in columns))

    def cycle_of(self, time: float) -> int:
        return min(max(math.floor((time - self.start) * self.frequency), 0), max(self.cycles - 1, 0))


def significant(impacts: ImpactTable, share: float = 0.1) -> NDArray[Any]:
    """Which impacts have an impulse of at least a share of the largest.

    Parameters
    ----------
    impacts : Impacts
    share : float, 1
        0 keeps all.

    Returns
    -------
    ndarray (n,) of bool
    """
    return _at_least(impacts.impulse, share)


def impacts_per_cycle(impacts: ImpactTable, frequency: float, start: float, end: float) -> float:
    """Impacts of any size per base cycle (frequency in Hz) that touch in start <= time < end (s)."""
    _check_window(frequency, start, end)
    count = np.count_nonzero((impacts.time >= start) & (impacts.time < end))
    return float(count / ((end - start) * frequency))


def classify(
    impacts: ImpactTable,
    riding: RidingTable,
    frequency: float,
    start: float,
    end: float,
    *,
    longest_period: int = 8,
    phase_tolerance: float = 1e-2,
    speed_tolerance: float = 1e-2,
    repeats: int = 4,
    significant_share: float = 0.1,
) -> Regime:
    """Kind of motion that the impacts of a time window show.

    Riding is looked for first, then chatter, then plain periodicity: a ball that rides or chatters in
    every cycle in the same way is called after that, and its label and counts say that it repeats.

    Parameters
    ----------
    impacts : Impacts
    riding : Riding
    frequency : float, Hz
        Of the base.
    start, end : float, s
        The window, start <= time < end; the transient should be over.
    longest_period : int
        Base cycles after which a motion must repeat to be periodic.
    phase_tolerance : float, rad
        Of the base phase, between an impact and its counterpart in the window's last period.
    speed_tolerance : float, 1
        Of the approach speed, in shares of the window's largest.
    repeats : int
        Repeats after the first period that the window must hold.
    significant_share : float, 1
        Impacts of less than this share of the window's largest impulse are left out of the period.

    Returns
    -------
    Regime
    """
    _check_window(frequency, start, end)
    for key, least, value in (("longest_period", 1, longest_period), ("repeats", 1, repeats)):
        require(value >= least, key, value, "1", f"must be at least {least}")
    order = np.argsort(impacts.time, kind="stable")
    order = order[(impacts.time[order] >= start) & (impacts.time[order] < end)]
    columns = (impacts.time, impacts.phase, impacts.impactor, impacts.side, impacts.approach_speed)
    everything = _Window(start, end, frequency, *(np.asarray(column)[order] for column in columns))
    large = everything.only(_at_least(np.asarray(impacts.impulse)[order], significant_share))
    cycles = everything.cycles
    testable = min(longest_period, cycles // (repeats + 1))

    matched = (
        f"impacts of at least {significant_share:g} of the largest impulse repeat in count, impactor, side, phase "
        f"(within {phase_tolerance:g} rad) and approach speed (within {speed_tolerance:g} of the largest) "
        f"over at least {repeats} repeats"
    )
    period, count = 0, 0
    for n in range(1, testable + 1):
        count = _repeating(large, n, phase_tolerance, speed_tolerance)
        if count:
            period = n
            break
    repeated = f"{count}:{period} periodic" if period else ""

    def regime(kind: str, label: str, criterion: str) -> Regime:
        return Regime(kind, count, period, label, criterion)

    ridden = _ridden_cycles(riding, everything)
    if 2 * len(ridden) >= max(cycles, 1):
        criterion = f"something rides in {len(ridden)} of {cycles} cycles, at least half"
        return regime("riding", _joined("riding", repeated), _joined(criterion, matched if period else ""))
    chattered = _chattering_cycles(everything)
    if 2 * len(chattered) >= max(cycles, 1):
        criterion = (
            f"runs of at least {SHORTEST_CHATTER} impacts on one wall with falling approach speed and shrinking "
            f"intervals in {len(chattered)} of {cycles} cycles, at least half"
        )
        return regime("chatter", _joined("chatter", repeated), _joined(criterion, matched if period else ""))
    if period:
        return regime("periodic", repeated, f"{matched}; the smallest period up to {testable} cycles")
    if impacts.dropped and (not impacts.time.size or end > impacts.time.max()):
        label = f"undecided: {impacts.dropped} impacts met a full table"
        return regime("undecided", label, "a table that holds every impact of the window")
    if not everything.time.size:
        return regime("none", "no impacts", f"no impact in {cycles} cycles, and riding in fewer than half of them")
    if not testable:
        label = f"undecided: {cycles} whole cycles are too few"
        return regime("undecided", label, f"a period needs {repeats + 1} cycles to show {repeats} repeats")
    tested = f"no period up to {testable} cycle{'s' if testable > 1 else ''} repeats"
    return regime("irregular", f"irregular: chaotic by the criterion that {tested}", f"{tested}: {matched}")


def _check_window(frequency: float, start: float, end: float) -> None:
    require(frequency > 0.0, "frequency", frequency, "Hz", "must be above 0")
    require(end > start, "end", end, "s", f"must be after the start, {start:g} s")


def _at_least(impulse: NDArray[Any], share: float) -> NDArray[Any]:
    size = np.abs(impulse)
    return np.asarray(size >= share * size.max(initial=0.0))


def _joined(first: str, second: str) -> str:
    return f"{first}, {second}" if second else first


def _repeating(window: _Window, period: int, phase_tolerance: float, speed_tolerance: float) -> int:
    """Impacts in so many cycles if the window's impacts repeat after them, else 0.

    Each impactor's impacts on each side are matched for themselves, so that impacts at the same
    instant cannot change places by rounding.
    """
    total = 0
    largest = window.speed.max(initial=0.0)
    for impactor, side in sorted(set(zip(window.impactor.tolist(), window.side.tolist(), strict=True))):
        group = window.only((window.impactor == impactor) & (window.side == side))
        count = _group_repeating(group, period, phase_tolerance, speed_tolerance * largest)
        if not count:
            return 0
        total += count
    return total


def _group_repeating(window: _Window, period: int, phase_tolerance: float, speed_tolerance: float) -> int:
    length = period / window.frequency
    slack = phase_tolerance / (2.0 * np.pi * window.frequency)
    time = window.time[::-1]
    if time.size < 2 or time[0] < window.end - length - slack or time[-1] > window.start + length + slack:
        return 0
    # how far back in the table one period lies
    count = int(np.argmin(np.abs(time[1:] - (time[0] - length)))) + 1
    # against the last period and not the next one: a slow drift is no repetition
    index = np.arange(time.size)
    last = index % count
    cycles = (time[last] - time) * window.frequency
    phase, speed = window.phase[::-1], window.speed[::-1]
    turn = phase[last] - phase
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))  # 0 and 2 pi are one phase
    repeats = (
        np.all(np.round(cycles) == period * (index // count))
        and np.all(np.abs(turn) <= phase_tolerance)
        and np.all(np.abs(speed[last] - speed) <= speed_tolerance)
    )
    return count if repeats else 0


def _ridden_cycles(riding: RidingTable, window: _Window) -> set[int]:
    end = np.where(np.isnan(riding.end), window.end, riding.end)  # nan: it lasts
    cycles: set[int] = set()
    for first, last in zip(np.asarray(riding.start).tolist(), end.tolist(), strict=True):
        if last > window.start and first < window.end:
            cycles.update(range(window.cycle_of(first), window.cycle_of(last) + 1))
    return cycles


def _chattering_cycles(window: _Window) -> set[int]:
    cycles: set[int] = set()
    for impactor in sorted(set(window.impactor.tolist())):
        own = window.only(window.impactor == impactor)
        interval = np.diff(own.time, prepend=0.0)
        length = min(own.time.size, 1)
        for i in range(1, own.time.size):
            if own.side[i] != own.side[i - 1] or own.speed[i] >= own.speed[i - 1]:
                length = 1
            elif length == 1 or interval[i] < interval[i - 1]:
                length += 1
            else:
                length = 2  # slower but later: a new run may begin with the impact before
            if length >= SHORTEST_CHATTER:
                first = float(own.time[i - length + 1])
                cycles.update(range(own.cycle_of(first), own.cycle_of(float(own.time[i])) + 1))
    return cycles
