"""Kind of motion in a window of impacts: k impacts in n cycles, sticking, chatter, or no period up to n."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femimpact.arrays import Array
from femimpact.errors import check_fields, checked, choice, kind_of, quantity, require, require_type, text
from femimpact.excitation.drives import Rest
from femimpact.response.impacts import Impacts, StickingPhases

MOST_CYCLES = 1e8
"""Most cycles of a window; more is taken for a mistake."""


FREE_DECAY = "free decay"
"""Kind of every motion that nothing drives."""


@dataclass(frozen=True)
class RegimeCriteria:
    """Criteria of the kinds of motion.

    Raises `InputError` if a value is out of range: periods and repeats are whole numbers from 1, the impacts of a
    chatter from 3, tolerances are not negative, and shares are at most 1.
    """

    # base cycles after which a motion must repeat to be periodic
    longest_period: int = field(default=8, metadata=quantity("1", at_least=1, integer=True))
    # repeats after the first period that the window must hold
    repeats: int = field(default=4, metadata=quantity("1", at_least=1, integer=True))
    # rad: of the base phase, between an impact and its counterpart in the window's last period
    phase_tolerance: float = field(default=1e-2, metadata=quantity("rad", at_least=0.0))
    # of the approach speed, in shares of the counterpart's
    speed_tolerance: float = field(default=1e-2, metadata=quantity("1", at_least=0.0))
    # impacts of less than this share of the window's largest impulse are left out of the period
    significant_share: float = field(default=0.1, metadata=quantity("1", at_least=0.0, at_most=1.0))
    # impacts in a row on one wall, each slower than the one before and sooner after it, that make a chatter
    chatter_impacts: int = field(default=4, metadata=quantity("1", at_least=3, integer=True))
    # share of the cycles in which something must stick, or chatter
    cycle_share: float = field(default=0.5, metadata=quantity("1", above=0.0, at_most=1.0))

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Regime:
    """Kind of motion in a time window.

    Parameters
    ----------
    kind : str
        "no impacts", "periodic", "sticking", "chatter", "chaotic" where no period was found up to the
        longest one that was tested (a longer period, a transient and noise get this name too), "not periodic" where
        the excitation has no cycle, "free decay" where nothing drives the structure, or "undecided" where the window
        is too short or its table incomplete.
    impacts, cycles : int
        Significant impacts in that many base cycles, after which they repeat; 0 where nothing repeats.
        Sticking and chattering motions may repeat too.
    label : str
        In words, and what was tested: "2:1 periodic", "no period up to 8 cycles".
    criterion : str
        What the motion was tested for, with the numbers.
    """

    kind: str = field(
        metadata=choice(
            "no impacts", "periodic", "sticking", "chatter", "chaotic", "not periodic", "undecided", FREE_DECAY
        )
    )
    impacts: int = field(metadata=quantity("1", at_least=0, integer=True))
    cycles: int = field(metadata=quantity("1", at_least=0, integer=True))
    label: str = field(metadata=text())
    criterion: str = field(metadata=text())

    def __post_init__(self) -> None:
        check_fields(self)

    def __repr__(self) -> str:
        return f"Regime: {self.label} ({self.kind})" if self.kind not in self.label else f"Regime: {self.label}"


@dataclass(frozen=True, eq=False)
class _Window:
    """Impacts of a window in order of time, and the window."""

    start: float
    end: float
    frequency: float
    time: Array
    phase: Array
    impactor: NDArray[np.str_]
    side: Array
    speed: Array
    impulse: Array

    @property
    def cycles(self) -> int:
        """Whole base cycles in the window."""
        # a window meant as ten cycles must not count nine by rounding
        return math.floor((self.end - self.start) * self.frequency + 1e-6)

    def only(self, chosen: NDArray[np.bool_]) -> _Window:
        names = ("time", "phase", "impactor", "side", "speed", "impulse")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def cycle_of(self, time: float) -> int:
        return min(max(math.floor((time - self.start) * self.frequency), 0), max(self.cycles - 1, 0))


def significant(impacts: Impacts, share: float = 0.1) -> NDArray[np.bool_]:
    """Mask (n,) of the impacts whose impulse is at least a share (1) of the largest; 0 keeps all."""
    _require_table(impacts, Impacts, "impacts")
    return _at_least(impacts.impulse, checked("share", share, quantity("1", at_least=0.0, at_most=1.0)))


def impacts_per_cycle(impacts: Impacts, frequency: float, start: float, end: float) -> float:
    """Impacts of any size per base cycle (frequency in Hz) that touch in start <= time < end (s)."""
    _require_table(impacts, Impacts, "impacts")
    frequency, start, end = _checked_window(frequency, start, end)
    count = np.count_nonzero((impacts.time >= start) & (impacts.time < end))
    return float(count / ((end - start) * frequency))


def classify(
    impacts: Impacts,
    sticking: StickingPhases,
    frequency: float,  # Hz: of the base
    start: float,  # s: the window, start <= time < end; the transient should be over
    end: float,  # s
    criteria: RegimeCriteria | None = None,
) -> Regime:
    """Kind of motion that the impacts of a time window show.

    k:n periodic: n is the smallest number of base cycles, up to `longest_period`, after which the
    k significant impacts repeat in count, impactor, side, phase and approach speed, over at least
    `repeats` repeats. Sticking is looked for first, then chatter, then plain periodicity: a ball that
    sticks or chatters in every cycle in the same way is called after that, and its label and counts
    say that it repeats. Of what does not repeat the label says up to how many cycles a period was
    looked for; its kind is "chaotic" by this criterion alone, for a longer period, a transient and
    noise look the same. Where the excitation has no phase (`RecordedBase`), 2 pi frequency time takes
    its place. A compliant contact never sticks here: a ball that lies on its wall there is one long contact.

    Raises `InputError` if the window is empty, or the frequency is not positive.
    """
    _require_table(impacts, Impacts, "impacts")
    _require_table(sticking, StickingPhases, "sticking")
    frequency, start, end = _checked_window(frequency, start, end)
    rules = RegimeCriteria() if criteria is None else criteria
    require_type(rules, RegimeCriteria, "criteria")
    window = _window(impacts, frequency, start, end)
    count, period = _smallest_period(window, rules)
    repeated = f"{count}:{period} periodic" if period else ""
    chatter = (
        f"runs of at least {rules.chatter_impacts} impacts on one wall, each slower and sooner than the one before,"
    )
    for kind, seen, what in (
        ("sticking", _sticking_cycles(sticking, window), "something sticks"),
        ("chatter", _chattering_cycles(window, rules.chatter_impacts), chatter),
    ):
        if len(seen) >= rules.cycle_share * max(window.cycles, 1):
            words = f"{what} in {len(seen)} of {window.cycles} cycles, at least {rules.cycle_share:g} of them"
            criterion = f"{words}; {_period_words(rules)}" if period else words
            return Regime(kind, count, period, f"{kind}, {repeated}" if period else kind, criterion)
    if period:
        words = f"{_period_words(rules)}; the smallest period up to {_testable(window, rules)} cycles"
        return Regime("periodic", count, period, repeated, words)
    return _without_period(impacts, window, rules)


def without_cycle(impacts: Impacts, base: Any) -> Regime:
    """The kind of motion under an excitation that has no cycle."""
    if isinstance(base, Rest):
        return Regime(FREE_DECAY, 0, 0, FREE_DECAY, Rest.words)
    if len(impacts) == 0:
        return Regime("no impacts", 0, 0, "no impacts", "no impact in the run")
    words = "the excitation has no cycle after which anything could repeat"
    return Regime("not periodic", 0, 0, "not periodic: the excitation has no cycle", words)


def _without_period(impacts: Impacts, window: _Window, rules: RegimeCriteria) -> Regime:
    """Name of a motion that was not seen to repeat, stick or chatter."""
    cycles, testable = window.cycles, _testable(window, rules)
    if impacts.dropped and window.end > impacts.time.max(initial=-np.inf):
        label = f"undecided: {impacts.dropped} impacts met a full table"
        return Regime("undecided", 0, 0, label, "a table that holds every impact of the window is needed")
    if not window.time.size:
        words = f"no impact in {cycles} cycles, and sticking in fewer than {rules.cycle_share:g} of them"
        return Regime("no impacts", 0, 0, "no impacts", words)
    if not testable:
        words = f"a period needs {rules.repeats + 1} cycles to show {rules.repeats} repeats"
        return Regime("undecided", 0, 0, f"undecided: {cycles} whole cycles are too few", words)
    tested = f"no period up to {testable} cycle{'s' if testable > 1 else ''}"
    words = (
        f'{tested}, where {_period_words(rules)}; no more than this is meant by the kind "chaotic": a longer period, a '
        "transient and noise have it too"
    )
    return Regime("chaotic", 0, 0, tested, words)


def _period_words(rules: RegimeCriteria) -> str:
    return (
        f"impacts of at least {rules.significant_share:g} of the largest impulse repeat in count, impactor, side, "
        f"phase (within {rules.phase_tolerance:g} rad) and approach speed (within {rules.speed_tolerance:g} of it) "
        f"over at least {rules.repeats} repeats"
    )


def _require_table(table: object, kind: type, key: str) -> None:
    """Refuse what has no column of times; any table that has those of a kind will do."""
    first = "time" if kind is Impacts else "start"
    require(isinstance(getattr(table, first, None), np.ndarray), key, kind_of(table), "", f"must be {kind.__name__}")


def _checked_window(frequency: object, start: object, end: object) -> tuple[float, float, float]:
    f = checked("frequency", frequency, quantity("Hz", above=0.0))
    first, last = (checked(key, value, quantity("s")) for key, value in (("start", start), ("end", end)))
    require(last > first, "end", last, "s", f"must be after the start, {first:g} s")
    few = (last - first) * f <= MOST_CYCLES
    require(few, "end", last, "s", f"must leave a window of at most {MOST_CYCLES:g} base cycles")
    return f, first, last


def _window(impacts: Impacts, frequency: float, start: float, end: float) -> _Window:
    order = np.argsort(impacts.time, kind="stable")
    order = order[(impacts.time[order] >= start) & (impacts.time[order] < end)]
    names = ("time", "phase", "impactor", "side", "approach_speed", "impulse")
    time, phase, *others = (np.asarray(getattr(impacts, name))[order] for name in names)
    phase = np.where(np.isnan(phase), 2.0 * np.pi * frequency * time, phase)
    return _Window(start, end, frequency, time, phase, *others)


def _at_least(impulse: Array, share: float) -> NDArray[np.bool_]:
    size = np.abs(impulse)
    return np.asarray(size >= share * size.max(initial=0.0))


def _testable(window: _Window, rules: RegimeCriteria) -> int:
    """Longest period (cycles) of which the window holds enough repeats."""
    return min(rules.longest_period, window.cycles // (rules.repeats + 1))


def _smallest_period(window: _Window, rules: RegimeCriteria) -> tuple[int, int]:
    """Significant impacts and base cycles after which they repeat; 0 and 0 where they do not."""
    large = window.only(_at_least(window.impulse, rules.significant_share))
    for period in range(1, _testable(window, rules) + 1):
        count = _repeating(large, period, rules)
        if count:
            return count, period
    return 0, 0


def _repeating(window: _Window, period: int, rules: RegimeCriteria) -> int:
    """Impacts in so many cycles if the window's impacts repeat after them, else 0.

    Each impactor's impacts on each side are matched for themselves, so that impacts at the same
    instant cannot change places by rounding.
    """
    total = 0
    for impactor, side in sorted(set(zip(window.impactor.tolist(), window.side.tolist(), strict=True))):
        group = window.only((window.impactor == impactor) & (window.side == side))
        count = _group_repeating(group, period, rules)
        if not count:
            return 0
        total += count
    return total


def _group_repeating(window: _Window, period: int, rules: RegimeCriteria) -> int:
    length = period / window.frequency
    slack = rules.phase_tolerance / (2.0 * np.pi * window.frequency)
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
        and np.all(np.abs(turn) <= rules.phase_tolerance)
        and np.all(np.abs(speed[last] - speed) <= rules.speed_tolerance * speed[last])
    )
    return count if repeats else 0


def _sticking_cycles(sticking: StickingPhases, window: _Window) -> set[int]:
    end = np.where(np.isnan(sticking.end), window.end, sticking.end)  # nan: it lasts
    cycles: set[int] = set()
    for first, last in zip(np.asarray(sticking.start).tolist(), end.tolist(), strict=True):
        if last > window.start and first < window.end:
            cycles.update(range(window.cycle_of(first), window.cycle_of(last) + 1))
    return cycles


def _chattering_cycles(window: _Window, shortest: int) -> set[int]:
    cycles: set[int] = set()
    for impactor in sorted(set(window.impactor.tolist())):
        of_pair = window.only(window.impactor == impactor)
        interval = np.diff(of_pair.time, prepend=0.0)
        length = min(of_pair.time.size, 1)
        for i in range(1, of_pair.time.size):
            if of_pair.side[i] != of_pair.side[i - 1] or of_pair.speed[i] >= of_pair.speed[i - 1]:
                length = 1
            elif length == 1 or interval[i] < interval[i - 1]:
                length += 1
            else:
                length = 2  # slower but later: a new run may begin with the impact before
            if length >= shortest:
                first = float(of_pair.time[i - length + 1])
                cycles.update(range(of_pair.cycle_of(first), of_pair.cycle_of(float(of_pair.time[i])) + 1))
    return cycles
